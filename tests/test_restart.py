"""A run that goes on from a step file, on another number of ranks than it began on."""

import shutil
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest
from test_rigs import SMALL

from fabric_fenicsx.output.steps import StepFile
from fabric_fenicsx.rigs import drape
from fabric_fenicsx.rigs.common import Session
from fabric_fenicsx.rigs.drape import DrapeCase

# Everything that remembers: friction on the tools, the height of a pushed holder, a Maxwell branch,
# friction and slip at the crossings, the viscosity of bending.
CASE = SMALL | {
    "holder_force_N": 60,
    "contact": {"friction": 0.2},
    "crossover": {
        "slip_limit_N": 0.5,
        "laws": [
            {"law": "maxwell", "k_N_mm": 0.05, "relaxation_time_s": 5},
            {"law": "coulomb_friction", "limit_N_mm": 0.002},
        ],
    },
    "solver": {"force_tolerance_N": 1e-7, "iteration_limit": 25},
}
MEMORIES = {"Maxwell branch", "Coulomb friction", "slip along", "traction", "height"}


def arrays(path):
    """All arrays of a step, whole."""
    with StepFile(path) as file:
        return {name: file[name] for name in file.names}


@pytest.mark.slow
@pytest.mark.mpi
def test_resume_on_another_number_of_ranks(tmp_path):
    """Begun on one rank, gone on with on all: the end of the run on one rank.

    Under mpirun on two. Every array of the step file agrees: sums in another order leave 1e-12 of
    it, and the bound leaves room for a step that takes one iteration more.
    """
    world = MPI.COMM_WORLD
    whole = Path(world.bcast(str(tmp_path)))
    again = whole / "again"
    case = DrapeCase.model_validate(CASE)

    def run(comm, folder, *, resume=False):
        session = Session(folder, comm, Path(), perf_counter(), resume=resume, pictures=False)
        assert drape.run(case, session)["completed"]

    if world.rank == 0:
        run(MPI.COMM_SELF, whole)
        shutil.copytree(whole / "steps", again / "steps")
        shutil.copytree(whole / "paraview", again / "paraview")
        shutil.copy(whole / "steps.csv", again)
        files = sorted((again / "steps").glob("*.npz"))
        with StepFile(files[len(files) // 2]) as middle:
            for memory in MEMORIES:
                names = [name for name in middle.names if memory in name]
                assert names and all(np.abs(middle[name]).max() > 0.0 for name in names), memory
        for file in files[len(files) // 2 + 1 :]:
            file.unlink()
    world.barrier()
    run(world, again, resume=True)
    if world.rank == 0:
        ends = [sorted((folder / "steps").glob("*.npz"))[-1] for folder in (whole, again)]
        one, other = map(arrays, ends)
        assert one.keys() == other.keys()
        assert one["number"] == other["number"]
        for name in (name for name in one if one[name].dtype.kind == "f"):
            size = np.abs(one[name]).max()
            np.testing.assert_allclose(other[name], one[name], atol=1e-7 * size, err_msg=name)
        tables = [pd.read_csv(folder / "crossings.csv") for folder in (whole, again)]
        assert tables[1].to_numpy() == pytest.approx(tables[0].to_numpy(), abs=1e-6)
        sums = [pd.read_csv(folder / "steps.csv").iloc[-1] for folder in (whole, again)]
        for name in ("external_work_N_mm", "lost_N_mm", "stored_N_mm", "holder_height_mm"):
            assert sums[1][name] == pytest.approx(sums[0][name], rel=1e-7)
