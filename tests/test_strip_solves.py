"""Strips solved in several processes, with models that are kept: the same to the last bit."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest
from measurements.strips import WIDTH, corners, pulled
from scipy.interpolate import PchipInterpolator

from fabric_fenicsx.errors import SolveError
from fabric_fenicsx.loop import workers
from fabric_fenicsx.loop.kinds.bias_extension import BiasExtensionRig, strip
from fabric_fenicsx.loop.kinds.bias_extension.curves import KNOTS, Curve
from fabric_fenicsx.loop.kinds.bias_extension.phases import Phase
from fabric_fenicsx.loop.kinds.bias_extension.strip import solved_strip, strip_case
from fabric_fenicsx.loop.kinds.bias_extension.ways import alike, way_of
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run
from fabric_fenicsx.rigs.bias_extension import build

GAMMA = np.radians(KNOTS)
SOFT, STIFF = (Curve.through(k * (0.02 * GAMMA + 0.2 * GAMMA**3)) for k in (1.0, 5.0))
SLIPPING = {"crossover.slip_limit_N": 0.3, "crossover.translation_N_mm": 10.0}
CRIMPED = {"tow.crimp_strain": 0.02}
STRETCHED = {"tow.stiffness.stretch_N_mm": 40.0}


def case(changes=None, length=40.0, travel=5.0, width=20.0, **more):
    own = {"length_mm": length, "width_mm": width}
    run = Run("run.csv", False, "", {}, own=own)
    fabric = FabricKeys(areal_density_kg_m2=0.3, tow_spacing_mm=5.0)
    measured = Measurement(Path(), "bias_extension", "", fabric, BiasExtensionRig(), None, (run,))
    return strip_case(measured, run, travel, 1.0, changes or {}, **{"steps": 6, **more})


def hasty(case):
    """One iteration is not enough for a step, whatever its length."""
    keys = {"iteration_limit": 1, "smallest_step_s": case.solver.first_step_s}
    return case.model_copy(update={"solver": case.solver.model_copy(update=keys)})


def same(one, other):
    return all(np.array_equal(a, b) for a, b in zip(astuple(one), astuple(other), strict=True))


@pytest.mark.parametrize(
    "changes",
    [{}, CRIMPED, SLIPPING, STRETCHED],
    ids=["pinned", "crimped", "slipping", "stretched"],
)
def test_a_model_that_is_kept_remembers_nothing(changes):
    """Neither what it did nor what it was: one that is pulled again is like a new one."""
    strip._strip.cache_clear()
    fresh = solved_strip(case(changes), SOFT)
    other = {name: 1.7 * value for name, value in changes.items() if "translation" not in name}
    between = solved_strip(case(changes | other), STIFF)
    assert not same(fresh, between)
    # One that stops on its way leaves its increment in the fields.
    with pytest.raises(SolveError):
        solved_strip(hasty(case(changes)), SOFT)
    assert same(solved_strip(case(changes), SOFT), fresh)
    strip._strip.cache_clear()
    assert same(solved_strip(case(changes | other), STIFF), between)


@pytest.mark.parametrize("changes", [{}, SLIPPING], ids=["pinned", "slipping"])
def test_a_strip_stays_in_its_plane_unheld(monkeypatch, changes):
    """Nothing pulls it out: free to leave the plane it goes the same way."""
    strip._strip.cache_clear()
    held = solved_strip(case(changes), SOFT)
    monkeypatch.setattr(strip, "build", lambda case, session, plane: build(case, session))
    strip._strip.cache_clear()
    free = solved_strip(case(changes), SOFT)
    strip._strip.cache_clear()
    assert not same(held, free)
    for name in ("travel", "force", "gamma", "middle"):
        one, other = getattr(held, name), getattr(free, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-7 * np.abs(other).max())


def test_a_way_back_is_solved_as_such():
    """Of a strip that slips, against the rig's finite elements with the law itself."""
    moments = 0.02 * GAMMA + 0.2 * GAMMA**3
    way = 14.0
    path = solved_strip(
        case(SLIPPING, 2.0 * WIDTH, way, WIDTH, back=True, steps=40), Curve.through(moments)
    )
    law = {"k1_N_mm": 0.02, "k3_N_mm": 0.2, "slip_limit_N": 0.3, "translation_N_mm": 10.0}
    times, places = corners(1.0, way, 0.0)
    exact = pulled(2.0 * WIDTH, times, places, law=law, steps=160, readings=57)
    force, angle = exact["force_N"], exact["shear_angle_deg"]
    at = exact["displacement_mm"]
    assert np.diff(path.back.travel).min() > 0.0 == path.back.travel[0]
    for rows, one in ((slice(29), path), (slice(30, None), path.back)):
        near = PchipInterpolator(one.travel, one.force)(at[rows])
        assert near == pytest.approx(force[rows], abs=0.01 * force.max())
        middle = np.degrees(PchipInterpolator(one.travel, one.middle)(at[rows]))
        assert middle == pytest.approx(angle[rows], abs=0.2)
    # On its way back it is sheared less at the same place, and pulls less.
    assert (angle[:28] - angle[:28:-1])[10:20].min() > 2.0
    assert (force[:28] - force[:28:-1])[10:20].min() > 0.05 * force.max()


def test_a_strip_that_was_stopped_goes_on_as_if_it_had_not_been():
    """And is another one while it stands still, with more of a lever, where some of it slips."""
    slow = replace(SOFT, dashpot=0.02)
    wanted = case(SLIPPING, 2.0 * WIDTH, 14.0, WIDTH, steps=20)
    path, rest = (solved_strip(wanted, slow, stops) for stops in (0, 1000))
    held = rest.rest
    assert path.rest is None and held is not None
    for name in ("travel", "force", "gamma", "middle"):
        one, other = getattr(path, name), getattr(rest, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-5 * np.abs(other).max())
    assert (held.force[1:] < path.force[1:]).all()
    # The lever is of a strip in which nothing slips: the work of its moments is more force.
    along = PchipInterpolator(path.travel, path.gamma).derivative()(path.travel[-2])
    sheared = path.gamma[-2] > 0.5 * path.gamma[-2].max()
    assert held.lever[-2][sheared].mean() > 1.02 * along[sheared].mean()
    # Stopped seldom, it is where it ends as it was found there, and nearly so on its way.
    seldom = solved_strip(wanted, slow, 5).rest
    for name, off in (("force", 0.02), ("gamma", 0.02), ("middle", 0.01)):
        one, other = getattr(seldom, name), getattr(held, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=off * np.abs(other).max())
        np.testing.assert_allclose(one[-1], other[-1], rtol=1e-9, atol=1e-12)
    # Without dashpots and slip nothing changes where it stops.
    assert solved_strip(case(), SOFT, 1000).rest is None


@pytest.mark.parametrize("changes", [{}, SLIPPING], ids=["pinned", "slipping"])
def test_a_strip_that_is_held_comes_to_rest_as_the_rig_s_does(changes):
    """And goes back from there: dashpots spread the angles otherwise than springs do."""
    way, hold, speed, dashpot = 14.0, 2.0, 5.0, 0.05
    wanted = case(changes, 2.0 * WIDTH, way, WIDTH, back=True, hold=hold, steps=40)
    keys = {"travel_mm": way, "rate_mm_min": 60.0 * speed}
    step = {"first_step_s": way / speed / 40, "largest_step_s": way / speed / 40}
    solver = wanted.solver.model_copy(update=step)
    curve = replace(SOFT, dashpot=dashpot)
    path = solved_strip(wanted.model_copy(update={**keys, "solver": solver}), curve, 1)
    law = {"k1_N_mm": 0.02, "k3_N_mm": 0.2, "dashpot_N_s_mm": dashpot}
    law |= {name.split(".")[1]: value for name, value in changes.items()}
    times = np.array([0.0, way, way + speed * hold, 2.0 * way + speed * hold]) / speed
    exact = pulled(2.0 * WIDTH, times, [0.0, way, way, 0.0], law=law, steps=400, readings=401)
    time, force, angle = (exact[n] for n in ("time_s", "force_N", "shear_angle_deg"))
    held = time > times[1] + 0.04
    held &= time <= times[2]
    since = time[held] - times[1]
    near = path.rest.force[-1] + path.hold.at("force", since)
    fall = np.interp(times[1], time, force) - force[held][-1]
    assert fall > 0.1 * force.max()
    assert near == pytest.approx(force[held], abs=0.08 * fall)
    assert near[since > 0.3] == pytest.approx(force[held][since > 0.3], abs=0.03 * fall)
    near = np.degrees(path.rest.middle[-1] + path.hold.at("middle", since))
    # As near as steps of the way out are, of which there are few.
    assert near == pytest.approx(angle[held], abs=0.25)
    back = time > times[2] + 0.1
    near = PchipInterpolator(path.back.travel, path.back.force)(exact["displacement_mm"][back])
    assert near == pytest.approx(force[back], abs=0.01 * force.max())


@pytest.mark.parametrize("dashpot", [0.0, 0.05], ids=["at once", "within a moment"])
def test_beyond_its_ends_a_strip_goes_on_as_a_line(dashpot):
    """Also where its first steps are short, for what gives way within them."""
    wanted = case({}, back=True)
    path = solved_strip(wanted, replace(SOFT, dashpot=dashpot))
    way = way_of(path, alike(path), replace(SOFT, dashpot=dashpot))
    top = path.travel[-1]
    D = np.array([-0.1, -0.06, -0.02, 0.9999, 1.02, 1.06]) * top
    for phase in (Phase.OUT, Phase.BACK):
        force = way.force(D, np.full(6, phase, dtype=np.int8), replace(SOFT, dashpot=dashpot))
        assert np.ptp(np.diff(force[:3])) < 0.05 * np.ptp(force)
        assert np.abs(np.diff(force)).max() < 1.2 * np.ptp(force[2:4])
        gamma = way.at("gamma", D, np.full(6, phase, dtype=np.int8))
        assert gamma[1] - gamma[0] == pytest.approx(gamma[2] - gamma[1], rel=1e-9)
        beyond = way.at("gamma", top * np.array([1.02, 1.04, 1.06]), np.full(3, phase, np.int8))
        assert beyond[1] - beyond[0] == pytest.approx(beyond[2] - beyond[1], rel=1e-9)


def test_a_way_back_has_a_curve_of_its_own():
    """Half the moments on the same way make half of their force."""
    both = replace(STIFF, back=Curve(tuple(m / 2.0 for m in STIFF.moments)))
    path = solved_strip(case(back=True, steps=20), both)
    D = np.linspace(1.0, 4.0, 7)
    out, back = (PchipInterpolator(p.travel, p.force)(D) for p in (path, path.back))
    # But for what the tows' bending makes of it.
    assert back == pytest.approx(out / 2.0, rel=0.1)


def test_a_way_out_is_had_without_the_way_back(monkeypatch):
    def stops(model, case, *more):
        if case.unload:
            raise SolveError("on the way back")
        return original(model, case, *more)

    whole, original = solved_strip(case(), SOFT), strip.pulled
    monkeypatch.setattr(strip, "pulled", stops)
    assert same(solved_strip(case(back=True), SOFT), whole) and whole.back is None


def test_processes_find_what_one_finds(monkeypatch):
    tasks = [(case(length=length), curve) for length in (50.0, 40.0) for curve in (SOFT, STIFF)]
    alone = [solved_strip(*task) for task in tasks]
    monkeypatch.setattr(workers, "cores", lambda: 2)
    together = workers.each_of(solved_strip, [*tasks, (hasty(case()), SOFT)])
    assert all(same(a, b) for a, b in zip(alone, together[:-1], strict=True))
    assert isinstance(together[-1], SolveError)
    # They last, each with an MPI of its own.
    pids = set(workers.each_of(os.getpid, [(), (), ()]))
    assert len(pids) in (1, 2) and os.getpid() not in pids
    assert pids <= set(workers.each_of(os.getpid, [()] * 40))


def test_beside_mpirun_there_are_none(monkeypatch):
    """Its ranks have the cores, and a process that one of them starts is no rank."""
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    assert workers.each_of(os.getpid, [(), (), ()]) == [os.getpid()] * 3


ASKS = """
import os, sys, time
from fabric_fenicsx.loop import workers
workers.cores = lambda: 2
found = workers.each_of(os.getpid, [()] * 2 + [()] * 20)
print(*[worker.process.pid for worker in workers._workers], flush=True)
workers.each_of(time.sleep, [(3.0,)] * 4)
"""


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGKILL, marks=pytest.mark.slow)]
)
def test_workers_end_with_whoever_asks(number):
    """At once on Ctrl-C; where it has no time to end them, when their task is done."""
    asking = subprocess.Popen(
        [sys.executable, "-c", ASKS], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    pids = [int(pid) for pid in asking.stdout.readline().split()]
    time.sleep(0.5)
    asking.send_signal(number)
    asking.wait(20)
    assert len(pids) == 2
    until = time.monotonic() + 20.0
    while any(map(alive, pids)) and time.monotonic() < until:
        time.sleep(0.1)
    assert not any(map(alive, pids))


def alive(pid):
    with suppress(OSError):
        # One that has ended and that nobody has waited for is still listed.
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    return False
