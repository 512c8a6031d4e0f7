"""Strips whose zones shear evenly, as those that are made up by the formula, and what slips there.

The forces and angles here are the formula's (Harrison, Clifford and Long 2004; Launay et al. 2008),
written out anew.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from fabric_fenicsx.loop.expressions.marching import Varying
from fabric_fenicsx.loop.inference.models import Models
from fabric_fenicsx.loop.kinds import slipping
from fabric_fenicsx.loop.kinds.bias_extension import BiasExtensionRig
from fabric_fenicsx.loop.kinds.bias_extension.even_shear import EVEN
from fabric_fenicsx.loop.kinds.bias_extension.model import BiasExtension
from fabric_fenicsx.loop.kinds.bias_extension.proposals import proposals
from fabric_fenicsx.loop.kinds.bias_extension.quantities import coarser
from fabric_fenicsx.loop.kinds.bias_extension.strip import strip_case
from fabric_fenicsx.loop.kinds.slipping import left_by
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run

LAW = {"k1_N": 0.03, "k3_N": 0.1, "c1_N_s": 0.05}
SIZES = ((80.0, 40.0), (110.0, 40.0), (120.0, 50.0))
FORCE_NOISE, ANGLE_NOISE = 0.02, 0.4


def angle(length, width, D):
    """γ of zone A [rad]."""
    return np.pi / 2 - 2 * np.arccos((1 + D / (length - width)) / np.sqrt(2))


def force(length, width, gamma, rate, law):
    """By the work of the zones [N]."""
    pull = (length - width) / 2 * (np.cos(gamma / 2) - np.sin(gamma / 2))

    def moment(g, g_rate):
        return law["k1_N"] * g + law["k3_N"] * g**3 + law["c1_N_s"] * g_rate

    middle, sides = width * (2 * length - 3 * width) / 2, width**2
    return (middle * moment(gamma, rate) + sides * moment(gamma / 2, rate / 2) / 2) / pull


def made_up(size, seed=None, holdout=False, count=60):
    """A run out and half-way back by the formula."""
    length, width = size
    top, speed = 0.3 * (length - width), 0.5 if holdout else 1.0
    D = np.concatenate([np.linspace(0, top, count), np.linspace(top, 0.5 * top, count // 2)[1:]])
    time = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(D)))]) / speed
    V = np.where(np.arange(len(D)) < count, speed, -speed)

    gamma = angle(length, width, D)
    lever = 2 / ((length - width) * (np.cos(gamma / 2) - np.sin(gamma / 2)))
    F, gamma = force(length, width, gamma, lever * V, LAW), np.degrees(gamma)
    if seed is not None:
        rng = np.random.default_rng(seed)
        F = F + FORCE_NOISE * rng.normal(size=len(F))
        gamma = gamma + ANGLE_NOISE * rng.normal(size=len(F))
    columns = {"time_s": time, "displacement_mm": D, "force_N": F, "shear_angle_deg": gamma}
    own = {"length_mm": length, "width_mm": width}
    return Run("run.csv", holdout, "", columns, own=own)


def measured(*runs, spacing=7.0):
    fabric = FabricKeys(areal_density_kg_m2=0.3, tow_spacing_mm=spacing)
    noises = {"shear_angle_deg": ANGLE_NOISE}
    return Measurement(
        Path(), "bias_extension", "", fabric, BiasExtensionRig(), FORCE_NOISE, runs, besides=noises
    )


@pytest.fixture(scope="module")
def strips():
    return BiasExtension([measured(made_up(SIZES[0], 0), made_up(SIZES[1], 1))])


def names_of(strips):
    return [p.name for p in strips.baseline]


def forms(strips, *names):
    return [v for e in strips.effects if e.name in names for v in e.variants]


def test_all_of_a_strip_that_shears_evenly_is_the_formula(strips):
    clean = BiasExtension([measured(made_up(SIZES[0]), made_up(SIZES[1]))], like=strips)
    expected, _ = clean.predict((), {**LAW, EVEN.name: 1.0})
    forces = clean.readings.first & clean.readings.usable
    off = (expected - clean.readings.observed)[forces]
    # But for where it turns, and the speed of a reading is that of neither way.
    assert np.sort(np.abs(off))[:-8].max() < 1e-3 * np.abs(expected[forces]).max()
    angles = ~clean.readings.first
    unit = clean.readings.others[0].unit
    assert expected[angles] / unit == pytest.approx(
        clean.readings.observed[angles] / unit, abs=1e-6
    )


def test_nothing_of_it_is_the_net(strips, monkeypatch):
    monkeypatch.setattr(BiasExtension, "may_be_even", False)
    net = BiasExtension([measured(made_up(SIZES[0], 0), made_up(SIZES[1], 1))], first=strips.curve)
    assert names_of(net) == list(LAW)
    expected, _ = net.predict((), LAW)
    assert expected == pytest.approx(strips.predict((), {**LAW, EVEN.name: 0.0})[0], rel=1e-9)


def test_the_baseline_finds_law_and_share_of_what_the_formula_made_up():
    runs = [made_up(size, k, holdout=k == 2) for k, size in enumerate(SIZES)]
    base = Models(BiasExtension([measured(*runs)]), []).base
    for name, value in LAW.items():
        assert base.values[name] == pytest.approx(value, abs=3 * base.errors[name])
        assert base.errors[name] < 0.15 * value
    assert base.values[EVEN.name] > 0.9
    used, first = base.used, base.readings.first
    for rows in (used & first, used & ~first):
        assert base.rms(rows) == pytest.approx(FORCE_NOISE, rel=0.15)
    # The share is of the model and not of a specimen.
    assert EVEN.name not in base.deviations


@pytest.mark.parametrize(
    "name, label",
    [
        (None, None),
        ("crossover_slip", "at a force"),
        ("crossover_slip", "of the strip, beyond a force"),
        ("tow_uncrimping", "soft throughout"),
        ("tow_uncrimping", "of the strip, drawn out"),
        ("clamp_slip", "share of the travel"),
        ("clamp_slip", "beyond a force"),
    ],
)
def test_slopes_are_differences(strips, name, label):
    own = [v for v in forms(strips, name) if v.label == label]
    assert len(own) == (name is not None)
    values = {**LAW, EVEN.name: 0.6}
    values |= {p.name: 1.1 * p.starts[0] for v in own for p in v.parameters}
    _, slopes = strips.predict(own, values)
    for parameter, slope in slopes.items():
        h = 1e-5 * max(abs(values[parameter]), 1e-2)
        up, down = (
            strips.predict(own, {**values, parameter: values[parameter] + s * h})[0]
            for s in (1.0, -1.0)
        )
        difference = (up - down) / (2.0 * h)
        assert slope == pytest.approx(difference, abs=2e-3 * np.abs(difference).max() + 1e-9)


def test_what_slips_in_series_is_what_the_force_that_it_leaves_makes_of_it():
    """Made up by a root found at each reading, at no rate; the largest force so far is kept."""
    length, width = SIZES[0]

    def slip(F):
        return (length - width) * 0.5 * max(F / width - 0.01, 0.0)

    law = {**LAW, "c1_N_s": 0.0}
    run = made_up(SIZES[0])
    D = np.linspace(0.0, 12.0, 80)

    def off(d, D):
        return d + slip(still(length, width, d, law)) - D

    true = [brentq(off, 0.0, travel, args=(travel,)) for travel in D]
    read = {
        "time_s": D,
        "displacement_mm": D,
        "force_N": still(length, width, np.array(true), law),
        "shear_angle_deg": np.degrees(angle(length, width, np.array(true))),
    }
    strips = BiasExtension([measured(replace(run, columns=read))])
    (form,) = (v for v in forms(strips, "crossover_slip") if v.label.startswith("of the strip"))
    values = {**law, EVEN.name: 1.0, "slip_mm_N": 0.5, "slip_from_N_mm": 0.01}
    expected, _ = strips.predict([form], values)
    first, unit = strips.readings.first, strips.readings.others[0].unit
    without, _ = strips.predict((), {**law, EVEN.name: 1.0})
    changed = np.abs(without - expected)[first].max()
    assert changed > 0.1 * read["force_N"].max()
    assert expected[first] == pytest.approx(read["force_N"], abs=0.01 * changed)
    assert expected[~first] / unit == pytest.approx(read["shear_angle_deg"], abs=0.05)


def still(length, width, D, law):
    """The force where nothing moves."""
    return force(length, width, angle(length, width, D), 0.0, law)


def test_what_slips_is_looked_for_once_beside_next_to_nothing_of_other_forms(strips, monkeypatch):
    """Thousands of forms are looked at beside a model that slips."""
    (slip,) = (v for v in forms(strips, "crossover_slip") if v.label.startswith("of the strip"))
    friction, *_ = forms(strips, "crossover_friction")
    values = {**LAW, EVEN.name: 0.6, "slip_mm_N": 0.5, "slip_from_N_mm": 0.01}
    values |= {p.name: p.starts[0] for p in friction.parameters if p.starts}
    (amount,) = (p.name for p in friction.amplitudes)
    asked = []
    monkeypatch.setattr(
        slipping, "left_by", lambda *a, f=slipping.left_by: asked.append(a) or f(*a)
    )
    alone, slopes = strips.predict([slip], values)
    beside, more = strips.predict([slip, friction], {**values, amount: 1e-9})
    assert len(asked) == 1
    assert beside == pytest.approx(alone, rel=1e-6)
    assert all(more[name] == pytest.approx(slope, abs=1e-5) for name, slope in slopes.items())
    little = 1e-4
    some, _ = strips.predict([slip, friction], {**values, amount: little})
    assert len(asked) == 2
    # What slips by it is left out of its slope.
    by, change = (
        more[amount][strips.readings.first],
        ((some - alone) / little)[strips.readings.first],
    )
    assert by @ change > 0.98 * np.linalg.norm(by) * np.linalg.norm(change)
    assert 0.6 < np.linalg.norm(change) / np.linalg.norm(by) <= 1.05
    strips.predict([slip], {**values, "k1_N": 0.031})
    assert len(asked) == 3


def test_what_slips_is_looked_for_again_where_strips_were_solved_anew(strips, monkeypatch):
    """What slips goes by the force as it is foretold, which changes then."""
    own = BiasExtension([measured(made_up(SIZES[0], 0), made_up(SIZES[1], 1))], like=strips)
    (slip,) = (v for v in forms(own, "crossover_slip") if v.label.startswith("of the strip"))
    values = {**LAW, EVEN.name: 0.3, "slip_mm_N": 0.5, "slip_from_N_mm": 0.01}
    asked = []
    monkeypatch.setattr(
        slipping, "left_by", lambda *a, f=slipping.left_by: asked.append(a) or f(*a)
    )
    before, _ = own.predict([slip], values)
    own.settle([slip], values)
    after, _ = own.predict([slip], values)
    assert len(asked) == 2
    assert not np.array_equal(after, before)
    # Where nothing is solved anew what slips is known.
    own.settle([slip], values)
    assert np.array_equal(own.predict([slip], values)[0], after)
    assert len(asked) == 2


def test_what_a_force_leaves_is_found_where_it_falls_steeply():
    D = Varying(np.linspace(0.0, 2.0, 9)[:, None])

    def added(travel, by):
        x = travel["D"]
        force = np.maximum(x.value, 0.0) ** 3
        slope = 3.0 * np.maximum(x.value, 0.0) ** 2
        behind = -np.tanh(5.0 * force)
        steep = -5.0 / np.cosh(5.0 * force) ** 2 * slope
        return Varying(behind, {p: steep * s for p, s in x.slopes.items()} | {"a": behind})

    found = left_by(added, {"D": D, "D_rate": D}, 12)
    exact = [
        brentq(lambda x, d=d: x + np.tanh(5.0 * max(d + x, 0.0) ** 3), -2.0, 0.0) for d in D.value
    ]
    assert found.value[:, 0] == pytest.approx(exact, abs=1e-3)
    assert (found.slopes["a"] <= 0.0).all() and set(found.slopes) == {"a"}


def test_forces_of_strips_that_go_back_tell_the_share_by_themselves():
    runs = [made_up(size, k) for k, size in enumerate(SIZES)]
    for run in runs:
        del run.columns["shear_angle_deg"]
    base = Models(BiasExtension([measured(*runs)]), []).base
    assert base.values[EVEN.name] > 0.8 and base.errors[EVEN.name] < 0.15
    for name, value in LAW.items():
        assert base.values[name] == pytest.approx(value, abs=3 * base.errors[name])


def test_there_is_no_share_where_nothing_tells_it():
    def share_of(*runs):
        return EVEN.name in names_of(BiasExtension([measured(*runs)]))

    runs = made_up(SIZES[0], 0), made_up(SIZES[1], 1, holdout=True)
    assert share_of(*runs)
    blind = {k: v for k, v in runs[0].columns.items() if k != "shear_angle_deg"}
    assert share_of(replace(runs[0], columns=blind))
    one_way = {name: column[:60] for name, column in blind.items()}
    assert not share_of(replace(runs[0], columns=one_way), runs[1])
    # Nor where the formula is not known.
    assert not share_of(made_up((76.0, 40.0), 0))


def test_a_picture_frame_of_the_fabric_knows_no_share():
    *_, frame = proposals([measured(made_up(SIZES[0], 0), made_up(SIZES[1], 1))])
    force, slopes = frame.model([frame.measurement]).predict((), {**LAW, EVEN.name: 0.7})
    assert force.any() and not slopes[EVEN.name].any() and slopes["k1_N"].any()


def test_of_a_net_of_which_little_is_left_nothing_is_solved_anew(strips):
    before = strips._strips.count
    strips.settle((), {**LAW, EVEN.name: 0.97})
    assert strips._strips.count == before
    net = BiasExtension([measured(made_up(SIZES[0], 0), made_up(SIZES[1], 1))], like=strips)
    before = net._strips.count
    net.settle((), {**LAW, EVEN.name: 0.5})
    assert net._strips.count == before + 1


def test_fine_nets_are_solved_coarser_where_the_share_makes_up_for_it():
    run = made_up(SIZES[0])
    fine, wide = measured(run, spacing=1.5), measured(run, spacing=9.0)
    assert coarser(wide, run) == 1.0
    times = coarser(fine, run)
    assert times * 1.5 == pytest.approx(40.0 / (8 * np.sqrt(2.0)))
    slip = {"crossover.slip_limit_N": 0.1, "tow.crimp_strain": 0.02}
    case = strip_case(fine, run, 10.0, 1.0, slip, coarser=times)
    assert case.warp_spacing_mm == pytest.approx(times * 1.5)
    # The same limit per area of fabric, and the same crimp.
    assert case.crossover.slip_limit_N == pytest.approx(0.1 * times**2)
    assert case.tow.crimp_strain == 0.02
