"""A blank holder pushed by a force: its height, its friction, its tangent, and a drape with it."""

import shutil
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest
from solve import Statics
from test_rigs import SMALL

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.fabric.section import RectangularSection
from fabric_fenicsx.mechanics.tools import HoledPlate
from fabric_fenicsx.rigs import drape
from fabric_fenicsx.rigs.common import Session
from fabric_fenicsx.rigs.drape import DrapeCase
from fabric_fenicsx.rigs.load import load_case
from fabric_fenicsx.solving.contacts import ContactLaw
from fabric_fenicsx.solving.model import Model, Support

SECTION = RectangularSection(width=4.57, height=0.04, density=7e-9, C1=60000.0)
LENGTH = 40.0
PATIENT = {"first_step_s": 0.1, "largest_step_s": 0.75}


def squeezed(force, *, mu, pull=0.0, cells=8, far=1e4):
    """A tow along x between die and holder, its first node moved along x by ``pull`` over the run.

    The faces are those of holed plates whose hole is ``far`` away. The die overlaps the tow by
    0.1 mm at first, so that there is a vertical stiffness from the start.
    """
    x = np.linspace(0.0, LENGTH, cells + 1)
    net = single_tow(np.column_stack([x, np.zeros((cells + 1, 2))]), (0.0, 0.0, 1.0))
    supports = [Support(np.arange(cells + 1), (1, 3, 4, 5))]
    if pull:
        supports.append(
            Support(np.array([0]), (0,), lambda time: np.array([[-pull * time, 0.0, 0.0]]))
        )
    else:
        supports.append(Support(np.arange(cells + 1), (0,)))
    return Model(
        net,
        SECTION,
        tools=[
            HoledPlate("die", lambda time: (far, 0.0, 0.1), 1.0, 4.0, 1.0),
            HoledPlate("holder", lambda time: (far, 0.0, 0.5), 1.0, 4.0, -1.0),
        ],
        contact_law=ContactLaw(stiffness=0.5, layer=0.5, friction=mu, stick_stiffness=0.5),
        pressed={"holder": lambda time: force},
        supports=supports,
    )


def height(force):
    """The holder's place z [mm] on a tow between flat plates, its force [N], and the exact place.

    Each face sinks by d with kφ′(d) = F/L: d = √(2δp/k), k the given one or what it has grown to.
    """
    model = squeezed(force, mu=0.0)
    Statics(model, force_tolerance=1e-10).run(1)
    kept = model.histories.save()
    die, holder = (kept[f"{name}: stiffness"][:, 1] for name in ("die", "holder"))
    assert np.ptp(die) == pytest.approx(0.0, abs=1e-6 * die[0])
    assert (die[0] > 0.5 + 1e-9) == (force > 10.0) == (holder[0] > 0.5 + 1e-9)
    p, layer = force / LENGTH, 0.5
    d, e = (np.sqrt(2.0 * layer * p / k.mean()) for k in (die, holder))
    assert max(d, e) < layer / 2.0
    return model.tool_place("holder")[2], model.tool_forces()["holder"][2], 0.1 - d - e


@pytest.mark.mpi
@pytest.mark.parametrize("force", [0.4, 30.0])
def test_height_between_flat_plates(force):
    """The distance functions round their roots by 1e-4 mm, which moves a face by 5e-9 mm."""
    place, pushed, exact = height(force)
    assert place == pytest.approx(exact, abs=3e-8)
    assert pushed == pytest.approx(-force, rel=1e-9)


def pulled_out(force, mu):
    """Pull [N] on a tow under the holder, and the tension in each of its cells.

    Pulled by 2 mm; the stick stretches by μp/k_t = 0.3 · 0.1/0.5 = 0.06 mm before.
    """
    model = squeezed(force, mu=mu, pull=2.0)
    statics = Statics(model, force_tolerance=1e-9, limit=40)
    for _ in range(9):
        statics.step(0.1, keep=True)
    statics.step(0.1, keep=False)
    return -model.reactions()[0, 0], model.snapshot(1.0).section_forces[:, 0]


@pytest.mark.mpi
def test_pulling_a_tow_from_under_the_holder():
    """Both faces slip: the pull is 2 μ F, whatever the stiffness; it is the tow's tension."""
    force, mu = 4.0, 0.3
    pull, tension = pulled_out(force, mu)
    assert pull == pytest.approx(2.0 * mu * force, rel=1e-6)
    # Half-way along cell i the nodes behind it carry the load: falls linearly to the free end.
    middles = (np.arange(8) + 0.5) / 8.0
    assert tension == pytest.approx(2.0 * mu * force * (1.0 - middles), rel=1e-6)


@pytest.mark.mpi
def test_tangent_with_a_free_height():
    """K − (K e)(eᵀ K)/s against central differences of the residual, on the rounded edge as well.

    The height is found anew at each place, to 1e-10 of the force: differences over 1e-5 mm have an
    error of some 1e-6 of the largest entry.
    """
    model = squeezed(2.0, mu=0.3, far=LENGTH / 2.0)
    disc, system = model.disc, model.system
    model.set_time(0.0, 1.0)
    rng = np.random.default_rng(3)
    nodes = disc.net.sizes["nodes"] * 6
    w, h = rng.normal(size=(2, nodes)) * np.tile([1e-2] * 3 + [1e-3] * 3, nodes // 6)
    # Deep enough that the edges of the holes touch.
    w[2::6] -= 0.3

    def vector(values):
        x = disc.vector()
        x.array[:] = values.reshape(-1, 6)[disc.local_nodes[: disc.owned]].ravel()
        return x

    def residual(values):
        F = disc.vector()
        # Twice: about the place itself, so that the tangent's section forces are those there.
        for _ in range(2):
            system.set_increment(vector(values), linearise_from="last")
        system.residual(F)
        return F.array_r.copy()

    eps = 1e-3
    difference = (residual(w + eps * h) - residual(w - eps * h)) / (2.0 * eps)
    residual(w)
    column, row, s = model.contacts.pressed["holder"].dyad()
    A = disc.matrix()
    system.tangent(A)
    product = disc.vector()
    A.mult(vector(h), product)
    product.axpy(-row.dot(vector(h)) / s, column)
    scale = np.abs(difference).max()
    assert product.array_r == pytest.approx(difference, abs=1e-5 * scale)


def test_drape_with_a_holder_force(tmp_path):
    """The force is met at every step and the energies balance; a resumed run ends the same."""
    small = SMALL | {
        "holder_force_N": 80,
        "contact": {"friction": 0.2},
        "solver": PATIENT,
    }
    case = DrapeCase.model_validate(small)

    def run(folder, resume):
        where = Session(
            folder, MPI.COMM_SELF, Path(), perf_counter(), resume=resume, pictures=False
        )
        return drape.run(case, where), pd.read_csv(folder / "steps.csv")

    result, steps = run(tmp_path, resume=False)
    assert result["completed"]
    assert result["quantities"]["holder_force_N"] == pytest.approx(80.0, rel=1e-8)
    wanted = 80.0 * np.minimum(steps["time_s"] / 6.0, 1.0)
    assert -steps["holder_force_z_N"].to_numpy() == pytest.approx(wanted.to_numpy(), rel=1e-8)
    last = steps.iloc[-1]
    assert abs(last["remainder_N_mm"]) < 0.02 * last["external_work_N_mm"]

    again = tmp_path / "again"
    shutil.copytree(tmp_path / "steps", again / "steps")
    shutil.copytree(tmp_path / "paraview", again / "paraview")
    shutil.copy(tmp_path / "steps.csv", again)
    for file in sorted((again / "steps").glob("*.npz"))[len(steps) * 2 // 3 :]:
        file.unlink()
    _, resumed = run(again, resume=True)
    columns = ["holder_height_mm", "external_work_N_mm", "lost_N_mm", "stored_N_mm"]
    columns += ["impulse_z_N_s", "external_force_z_N"]
    assert resumed.iloc[-1][columns].to_numpy() == pytest.approx(last[columns].to_numpy(), rel=1e-5)


def test_force_and_gap_exclude_each_other(tmp_path):
    path = tmp_path / "case.yaml"
    path.write_text("test: drape\nholder_force_N: 100\nholder_gap_mm: -0.1\n")
    with pytest.raises(InputError, match="holder_force_N, holder_gap_mm: one of the two"):
        load_case(path)
