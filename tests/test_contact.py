"""Contact whose stiffness follows the load: how deep tows sink, what it stores, what is kept."""

import shutil
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

import numpy as np
import pytest
from solve import Statics
from test_rigs import SMALL

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.fabric.section import RectangularSection
from fabric_fenicsx.mechanics.contact import LIMIT, NEAR_LIMIT
from fabric_fenicsx.mechanics.tools import HoledPlate
from fabric_fenicsx.output.results import read_net
from fabric_fenicsx.output.steps import StepFile
from fabric_fenicsx.rigs import drape
from fabric_fenicsx.rigs.common import Session
from fabric_fenicsx.rigs.drape import DrapeCase
from fabric_fenicsx.rigs.run import make_case
from fabric_fenicsx.solving.contacts import ContactLaw
from fabric_fenicsx.solving.model import Model, Support

SECTION = RectangularSection(width=4.57, height=0.04, density=7e-9, C1=60000.0)
LENGTH, LAYER, STIFFNESS, OVERLAP = 30.0, 0.5, 0.5, 0.05


def pressed_on_a_plate(*, held=False, overlap=OVERLAP):
    """A tow along x on a plate that overlaps it a little, free to move up and down unless held."""
    x = np.linspace(0.0, LENGTH, 6)
    net = single_tow(np.column_stack([x, np.zeros((6, 2))]), (0.0, 0.0, 1.0))
    components = (0, 1, 2, 3, 4, 5) if held else (0, 1, 3, 4, 5)
    plate = HoledPlate("plate", lambda time: (1e4, 0.0, overlap), 1.0, 1.0, 1.0)
    return Model(
        net,
        SECTION,
        tools=[plate],
        contact_law=ContactLaw(stiffness=STIFFNESS, layer=LAYER),
        supports=[Support(np.arange(6), components)],
    )


def push(model, per_length):
    """Push downwards by a force per tow length [N/mm]."""
    own = model.disc.places[: model.disc.owned]
    model.system.nodal_loads[: len(own), 2] = -per_length * model.net.node_lengths[own]


def state(model):
    """Depth of every node [mm], k of the step and of the next one [N/mm²], and energy [N mm]."""
    memory = model.histories.save()["plate: stiffness"]
    return -model.contacts.gaps()["plate"], memory, model.system.energies()["plate"]


@pytest.mark.mpi
@pytest.mark.parametrize("load", [1e-3, 1e-2, 1e-1, 1.0, 10.0])
def test_half_a_layer_is_never_exceeded(load):
    """D = √(2δp/k): with the k that is given while that is shallow, else with the one that grew."""
    model = pressed_on_a_plate()
    push(model, load)
    Statics(model, force_tolerance=1e-9).run(1)
    depth, memory, _ = state(model)
    k = memory[:, 1]
    assert depth == pytest.approx(np.sqrt(2.0 * LAYER * load / k), rel=1e-6)
    assert (depth <= LIMIT * LAYER).all()
    given = np.sqrt(2.0 * LAYER * load / STIFFNESS)
    assert (k == pytest.approx(STIFFNESS)) == (given <= LIMIT * LAYER)
    assert model.tool_forces()["plate"][2] == pytest.approx(load * LENGTH, rel=1e-6)


@pytest.mark.mpi
def test_energy_of_stiffening_is_booked():
    """At the k of a step ΔE + loss = ∫ k φ′ dd, exact by Simpson's rule for a quadratic pressure.

    The load grows by a third in each step, so that k grows within steps and between them.
    """
    model = pressed_on_a_plate()
    statics = Statics(model, force_tolerance=1e-11)
    load, before = 1e-2, None
    grown = 0
    for _ in range(12):
        push(model, load)
        statics.step(0.1, keep=False)
        k = model.contacts._memories["plate"].x.array[0]
        depth, _, energy = state(model)
        loss = model.system.losses()["plate"]
        if before is not None:
            depth_n, energy_n, k_n = before
            middle = (depth + depth_n) / 2.0
            pressures = [k * d**2 / (2.0 * LAYER) for d in (depth_n, middle, depth)]
            mean = np.dot([1.0, 4.0, 1.0], np.array(pressures)) / 6.0
            work = float(np.mean(mean * (depth - depth_n))) * LENGTH
            assert energy - energy_n + loss == pytest.approx(work, rel=1e-8)
            assert (loss < -1e-9) == (k > k_n * (1.0 + 1e-9))
            grown += loss < -1e-9
        before = (depth, energy, k)
        statics.stepper.advance(0.1)
        load *= 4.0 / 3.0
    assert grown >= 3


def test_what_cannot_give_way_fails_with_the_tool():
    """A held tow that a plate overlaps by more than half a layer: no stiffness helps."""
    model = pressed_on_a_plate(held=True, overlap=0.3)
    newton = model.newton(force_tolerance=1e-9, limit=10)
    outcome = newton.solve(model.targets(0.0, 1.0))
    assert not outcome.converged and "sink into the plate by 0.3 mm" in outcome.reason


def test_holder_and_die_that_cannot_both_give_way_are_refused():
    with pytest.raises(InputError, match=r"holder_gap_mm: at least -contact.layer_mm / 2 = -0.1"):
        make_case("drape", contact={"layer_mm": 0.2})
    make_case("drape", contact={"layer_mm": 0.2}, holder_gap_mm=-0.1)


HEAVY = SMALL | {
    "tow": {"C1_MPa": 6e5},
    "contact": {"layer_mm": 0.4, "friction": 0.2},
    "holder_force_N": 2000.0,
    "holder_closing_s": 2.0,
    "punch_travel_mm": 6,
    "duration_s": 6,
}


def drawn(folder, *, comm, resume=False, **keys):
    session = Session(folder, comm, Path(), perf_counter(), pictures=False, resume=resume)
    return drape.run(DrapeCase(**(HEAVY | keys)), session)


def last_step(folder):
    with StepFile(max(folder.glob("steps/*.npz"))) as step:
        return {name: step[name] for name in step.names}


@pytest.fixture(scope="module")
def heavy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("heavy")
    drawn(folder, comm=MPI.COMM_SELF)
    return folder


def test_stiffness_outlives_a_restart(heavy, tmp_path):
    """The same bits as without one, stiffnesses among them, some of which have grown."""
    shutil.copytree(heavy, tmp_path, dirs_exist_ok=True)
    for path in sorted(tmp_path.glob("steps/*.npz"))[-4:]:
        path.unlink()
    drawn(tmp_path, comm=MPI.COMM_SELF, resume=True)
    whole, resumed = last_step(heavy), last_step(tmp_path)
    for name in whole:
        np.testing.assert_array_equal(whole[name], resumed[name], err_msg=name)
    assert whole["history: die: stiffness"][:, 0].max() > 2.0


def test_bound_holds_in_a_drape(heavy):
    """Of nodes against the die, from their places alone."""
    net, hole, edge = read_net(heavy / "net.npz"), SMALL["hole_radius_mm"], SMALL["edge_radius_mm"]
    for path in heavy.glob("steps/*.npz"):
        with np.load(path) as file:
            x, y, z = (net.points + file["u"]).T
        inward, upward = hole + edge - np.hypot(x, y), z + edge
        face = np.where(inward > 0.0, np.hypot(inward, np.maximum(upward, 0.0)), upward) - edge
        assert face.min() > -LIMIT * 0.4 - 1e-6


def test_a_quarter_is_the_whole(heavy, tmp_path):
    short = {"sheet": {"width_mm": 120, "length_mm": 120}, "punch_travel_mm": 3, "duration_s": 3}
    whole = drawn(tmp_path, comm=MPI.COMM_SELF, symmetry="none", **short)
    part = drawn(tmp_path / "q", comm=MPI.COMM_SELF, **short)
    assert whole["completed"] and part["completed"]
    depth = [run["health"]["penetration"]["die"]["largest_mm"] for run in (whole, part)]
    assert depth[0] == pytest.approx(depth[1], rel=2e-3)
    assert max(depth) > NEAR_LIMIT * 0.4 / 2.0


@pytest.mark.mpi
def test_ranks_agree(heavy, tmp_path):
    folder = MPI.COMM_WORLD.bcast(tmp_path)
    drawn(folder, comm=MPI.COMM_WORLD)
    one, more = last_step(heavy), last_step(folder)
    assert np.abs(one["u"] - more["u"]).max() < 1e-3
    k, k_more = (step["history: die: stiffness"][:, 0] for step in (one, more))
    assert k == pytest.approx(k_more, rel=1e-2)
