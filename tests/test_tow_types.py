"""Tows of several types within a family: from the keys of a case to forces of single tows."""

from pathlib import Path
from time import perf_counter

from mpi4py import MPI

import numpy as np
import pytest
from solve import Statics

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.net import WEFT
from fabric_fenicsx.rigs.cantilever import CantileverCase, strip
from fabric_fenicsx.rigs.common import Session, crossover_law, tow_net, tow_sections
from fabric_fenicsx.rigs.load import load_case
from fabric_fenicsx.solving.model import Model, Support

TYPES = [
    {"family": "weft", "repeat": 3, "tows": [1], "C1_MPa": 20000.0},
    {"family": "weft", "repeat": 3, "tows": [2], "width_mm": 2.0, "density_kg_mm3": 1e-6},
]


def case_and_net(types):
    case = CantileverCase.model_validate(
        {"test": "cantilever", "lengths_mm": [48.0], "width_mm": 72.0, "tow_types": types}
    )
    session = Session(Path(), MPI.COMM_SELF, Path(), perf_counter())
    return case, tow_net(case, strip(case, 48.0), session)


def test_each_tow_carries_what_its_section_does():
    """Weft tows pulled by the same stretch ε: N = E A ε with each tow's own E = 6 C1 and width.

    The warp only follows. From y = 0 on the six wefts are of the types 0, 1, 2, 0, 1, 2.
    """
    case, net = case_and_net(TYPES)
    sections, kind = tow_sections(case, net, case.spacings)
    stretch, length = 1e-3, 48.0
    wefts = np.flatnonzero(net.tow_family == WEFT)
    left, right = net.ends[wefts].T
    assert np.ptp(net.points[left, 0]) == 0.0
    moved = np.tile([stretch * length, 0.0, 0.0], (len(wefts), 1))
    model = Model(
        net,
        sections,
        tow_section=kind,
        crossovers=crossover_law(case.crossover, 144.0),
        supports=[
            Support(left, (0, 1, 2, 3, 4, 5)),
            Support(right, (0, 1, 2, 3, 4, 5), lambda time: time * moved),
        ],
        comm=MPI.COMM_SELF,
    )
    Statics(model, force_tolerance=1e-8).step(1.0, keep=False)
    order = np.argsort(net.points[left, 1])
    pulled = model.reactions()[right, 0][order]
    exact = stretch * 6.0 * 0.04 * np.array([60000 * 4.57, 20000 * 4.57, 60000 * 2.0] * 2)
    assert len(wefts) == 6
    assert pulled == pytest.approx(exact, rel=1e-9)
    mass = np.array([s.mass()[0] for s in sections])
    assert mass / (4.57 * 0.04) == pytest.approx([7e-9, 7e-9, 7e-9, 1e-9 * 2.0 / 4.57])


def test_two_types_for_one_tow_are_refused():
    twice = [*TYPES, {"family": "weft", "repeat": 2, "tows": [0], "width_mm": 3.0}]
    case, net = case_and_net(twice)
    with pytest.raises(InputError, match=r"tow_types\.2: weft tow 2 has a type already"):
        tow_sections(case, net, case.spacings)


def test_a_tow_beyond_the_repeat_is_refused(tmp_path):
    path = tmp_path / "case.yaml"
    path.write_text("test: drape\ntow_types: [{family: warp, repeat: 2, tows: [2]}]\n")
    with pytest.raises(InputError, match=r"tow_types\.0.*tows: 2, allowed is 0 to repeat - 1"):
        load_case(path)
