# %% [markdown]
# # How the weave changes the drape
#
# The same tows and the same shear law per area, woven in three ways, drape over a hemisphere.
# The longer the floats, the fewer crossings lock the tows, and the softer is the sheet in its
# plane; see `demos/weaves.py` for the rule, which is an assumption of this package. A coarse net
# (tows 24 mm apart, a quarter of the sheet) makes the comparison quick.
#
# ```
# python demos/weave_drape.py      # or: mpirun -n 2 python demos/weave_drape.py
# ```

# %%
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

import numpy as np

from fabric_fenicsx.fabric.weave import WEAVES
from fabric_fenicsx.output.folder import prepare_folder
from fabric_fenicsx.output.pictures import draw_net
from fabric_fenicsx.rigs import drape
from fabric_fenicsx.rigs.common import Session, control
from fabric_fenicsx.rigs.drape import DrapeCase
from fabric_fenicsx.rigs.simulation import simulate
from fabric_fenicsx.rigs.weave_keys import WeaveKeys

# %% [markdown]
# The sheet of `demos/drape.yaml` with half as many tows. Each is as wide as two of those, so that
# the sheet keeps its weight and its stiffness against bending out of its plane.

# %%
CASE = DrapeCase.model_validate(
    {
        "test": "drape",
        "sheet": {"warp_spacing_mm": 24.0, "weft_spacing_mm": 24.0},
        "tow": {"width_mm": 9.14},
    }
)
NAMES = ("plain", "twill_2_2", "satin_8")


def main(folder: Path = Path("results/weave_drape"), duration: float = 60.0) -> dict[str, dict]:
    """Drape each weave for ``duration`` seconds; 60 is the whole draw.

    Returns:
        For each its mean float [crossings], largest and mean shear angle [degrees], force of the
        whole punch [N] and energy of the in-plane springs [N mm].
    """
    comm = MPI.COMM_WORLD
    numbers = {}
    for name in NAMES:
        own = folder / name
        prepare_folder(own, comm)
        session = Session(own, comm, Path(), perf_counter())
        case = CASE.model_copy(update={"weave": WeaveKeys(pattern=name)})
        model = drape.build(case, session)
        run = simulate(
            model,
            own,
            test="drape",
            end=duration,
            control=control(case.solver, case.edge_radius_mm / 2.0),
            force_tolerance=case.solver.force_tolerance_N,
            quarter=True,
        )
        if run.last is None or run.last.time < duration:
            raise SystemExit(f"{name}: {run.stop}")
        shear = np.abs(run.last.shear_angle)
        row = run.rows[-1]
        numbers[name] = {
            "mean_float": WEAVES[name].float_length[0],
            "largest_shear_deg": float(np.degrees(shear.max())),
            "mean_shear_deg": float(np.degrees(shear.mean())),
            "punch_force_N": -row["punch_force_z_N"],
            "shear_energy_N_mm": row["energy_rotational_spring_N_mm"],
        }
        if comm.rank == 0:
            draw_net(
                own / "drape.png",
                model.net,
                run.last,
                mirror=True,
                title=name.replace("_", " "),
                limits=(0.0, 40.0),
            )
    return numbers


if __name__ == "__main__":
    table = main()
    if MPI.COMM_WORLD.rank == 0:
        for title, row in table.items():
            print(f"{title:12}" + "  ".join(f"{key} {value:.4g}" for key, value in row.items()))
