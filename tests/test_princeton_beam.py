"""The Princeton beam, bent about both axes and so twisted: against three codes."""

import numpy as np
import pytest
import reference
from solve import GivenSection, Statics, set_loads

from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.solving.model import Model, Support

LENGTH, HIGH, WIDE = 508.0, 12.3777, 3.2024
E = 71.7e3
G = E / 2.0 / 1.31
STIFF, SOFT = WIDE * HIGH**3 / 12.0, HIGH * WIDE**3 / 12.0
ROWS = reference.table("princeton_beam.csv")
CODES = ("ANSYS_beam", "ANSYS_solid", "Exudyn16")


def section(torsion, shear=1.0):
    """With the torsion constant over the polar moment, and the shear factor."""
    EA, GA, GJ = E * WIDE * HIGH, shear * G * WIDE * HIGH, G * torsion * (STIFF + SOFT)
    return GivenSection((EA, GA, GA, GJ, E * SOFT, E * STIFF))


def tips(cells, given):
    """Tip displacements [mm] of all rows, (14, 3)."""
    net = single_tow(np.linspace(0.0, LENGTH, cells + 1)[:, None] * [1.0, 0, 0], (0, 0, 1))
    found = []
    for row in ROWS:
        model = Model(net, given, supports=[Support(np.array([0]), (0, 1, 2, 3, 4, 5))])
        beta = np.radians(float(row["beta_deg"]))
        force = float(row["F_N"]) * np.array([0.0, np.cos(beta), np.sin(beta), 0, 0, 0])
        statics = Statics(model, force_tolerance=1e-5)
        statics.run(2, lambda part, m=model, f=force: set_loads(m, cells, part * f))
        found.append(statics.displacements[-1])
    return np.array(found)


def published(code):
    """Tip displacements [mm] along y and z of a code, (14, 2)."""
    sign = -1.0 if code == "Exudyn16" else 1.0
    return 1e3 * np.array([[sign * float(r[f"{code}_uy"]), float(r[f"{code}_uz"])] for r in ROWS])


def test_princeton_beam_within_the_codes():
    """With EXUDYN's section, the softest in torsion.

    The three codes differ by up to 4 mm (torsion constants, and 3D elements). EXUDYN, at the end of
    their interval, has only 16 elements: in the plane case beta = 90, where neither torsion nor a
    shear factor matters, it is 0.2 and 0.3 mm from ANSYS. Ours may leave the interval by that and
    by our own error with 32 cells, which is a third of the difference to 16 (order 2).
    """
    coarse, fine = tips(16, section(0.198))[:, 1:], tips(32, section(0.198))[:, 1:]
    codes = np.array([published(code) for code in CODES])
    plane = {
        row["F_N"]: 1e3 * abs(float(row["Exudyn16_uz"]) - float(row["ANSYS_beam_uz"]))
        for row in ROWS
        if row["beta_deg"] == "90"
    }
    theirs = np.array([plane[row["F_N"]] for row in ROWS])[:, None]
    allowed = theirs + np.abs(fine - coarse) / 3.0
    outside = np.maximum(codes.min(axis=0) - fine, fine - codes.max(axis=0))
    assert theirs.max() < 0.35
    assert (outside <= allowed).all(), f"outside by {outside} mm, allowed {allowed} mm"


def test_princeton_beam_equals_ansys_beams():
    """One number, the torsion constant, is fitted; the 24 displacements then agree.

    0.217 of the polar moment is 3 % above the rectangle's own (RectangularSection: 0.210), as of
    a section divided coarsely. In the plane cases, beta = 0 and 90, it has no effect.
    """
    fine = tips(64, section(0.217, 5.0 / 6.0))[:, 1:]
    # Our error with 64 cells is 8 micrometres in 200 mm (a third of the difference to 32 cells);
    # theirs is not known.
    np.testing.assert_allclose(fine, published("ANSYS_beam"), atol=0.01)


@pytest.mark.parametrize("torsion", [0.198, 0.24])
def test_another_torsion_constant_shows(torsion):
    off = np.abs(tips(32, section(torsion, 5.0 / 6.0))[:, 1:] - published("ANSYS_beam"))
    assert off.max() > 0.2
