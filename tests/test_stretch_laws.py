"""Stretch of crimped tows: the closed form, one tow drawn straight, its tangent, its keys."""

from mpi4py import MPI

import numpy as np
import pytest
from solve import GivenSection, Statics, orders, set_loads, taylor_remainders
from ufl import as_ufl

from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.mechanics.stretch_laws import Uncrimping
from fabric_fenicsx.rigs.cases import TowKeys
from fabric_fenicsx.solving.model import Model, Support

EA, STRAIN, SHARE = 4000.0, 0.02, 0.05
LAW = Uncrimping(STRAIN, SHARE)
SECTION = GivenSection((EA, 1500.0, 1500.0, 60.0, 50.0, 90.0))


def value(expression):
    return float(as_ufl(expression)(()))


def slope(strain):
    """Of N/EA: r up to ε_c/2, 1 from 3 ε_c/2, linear between."""
    return SHARE + (1.0 - SHARE) * np.clip(strain / STRAIN - 0.5, 0.0, 1.0)


def test_force_and_energy_are_integrals_of_the_slope():
    """Simpson's rule is exact on parabolas and cubics whose joints lie on its grid, of 0.0005."""
    for strain in (-0.015, 0.004, 0.01, 0.0175, 0.03, 0.05):
        path = np.linspace(0.0, strain, 2 * round(abs(strain) / 5e-4) + 1)
        weight = np.ones(len(path))
        weight[1:-1:2], weight[2:-1:2] = 4.0, 2.0
        weight *= (path[1] - path[0]) / 3.0
        force = [value(LAW.force(as_ufl(e), as_ufl)) for e in path]
        assert force[-1] == pytest.approx(weight @ slope(path), rel=1e-12)
        energy = value(LAW.energy(as_ufl(strain), as_ufl))
        assert energy == pytest.approx(weight @ np.array(force), rel=1e-12)
    assert value(LAW.stiffness(as_ufl)) == SHARE


def tow(uncrimping=LAW):
    """A straight tow of 40 mm in four cells, held at its foot."""
    net = single_tow(np.linspace([0.0, 0.0, 0.0], [40.0, 0.0, 0.0], 5), (0.0, 0.0, 1.0))
    held = Support(np.array([0]), (0, 1, 2, 3, 4, 5))
    return Model(net, SECTION, uncrimping=uncrimping, supports=[held], comm=MPI.COMM_SELF)


def test_one_tow_is_drawn_straight():
    """N = EA (r ε + (1 − r) h): ε of the closed form for forces below, within and past the crimp.

    Past it a straight tow under the same force is shorter by (1 − r) ε_c of its length.
    """
    model = tow()
    statics = Statics(model, force_tolerance=1e-9)
    lengths = []
    forces = (1.0, 0.25 * EA * STRAIN, 2.0 * EA * STRAIN)
    for force in forces:
        set_loads(model, 4, [force, 0.0, 0.0, 0.0, 0.0, 0.0])
        statics.step(1.0, keep=True)
        lengths.append(statics.displacements[4, 0] / 40.0)
    back = [EA * value(LAW.force(as_ufl(e), as_ufl)) for e in lengths]
    assert back == pytest.approx(forces, rel=1e-9)
    assert lengths[0] == pytest.approx(1.0 / (SHARE * EA), rel=1e-9)
    assert lengths[2] == pytest.approx(forces[2] / EA + (1.0 - SHARE) * STRAIN, rel=1e-9)
    stored = model.system.energies()["tows"]
    assert stored == pytest.approx(40.0 * EA * value(LAW.energy(as_ufl(lengths[2]), as_ufl)))


def test_tangent():
    """Within the crimp's transition: remainders of the residual go with the square of the step."""
    model = tow()
    rng = np.random.default_rng(4)
    disc = model.disc
    x, d = disc.vector(), disc.vector()
    place = 1e-3 * rng.normal(size=(5, 6))
    place[:, 0] += np.linspace(0.0, 40.0 * STRAIN, 5)
    x.array[:] = place[disc.local_nodes].ravel()
    d.array[:] = rng.normal(size=30)
    rest = taylor_remainders(model, x, d, largest=1e-3)
    assert orders(rest) == pytest.approx(2.0, abs=0.1)


def test_a_share_of_one_is_a_straight_tow():
    for uncrimping in (None, Uncrimping(STRAIN, 1.0)):
        model = tow(uncrimping)
        set_loads(model, 4, [60.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        statics = Statics(model, force_tolerance=1e-9)
        statics.step(1.0, keep=True)
        assert statics.displacements[4, 0] == pytest.approx(40.0 * 60.0 / EA, rel=1e-9)


def test_keys_of_a_case():
    assert TowKeys().crimp_strain == 0.0
    with pytest.raises(ValueError, match="crimp_stiffness_share"):
        TowKeys.model_validate({"crimp_strain": 0.01, "crimp_stiffness_share": 0.0})
