# %% [markdown]
# # The picture frame, with and without dashpots
#
# A hinged frame shears the fabric to 55 degrees. In pure shear the normalised force is m / cos γ,
# with m the moment per area that the crossings carry: the beams hardly matter. The demo runs the
# loading once with the rotary dashpots and once without, and compares both with that formula.
#
# ```
# python demos/picture_frame.py                # or: mpirun -n 2 python demos/picture_frame.py
# fabric-fenicsx run demos/picture_frame.yaml  # with hold and unloading, from a case file
# ```

# %%
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pandas as pd

import fabric_fenicsx as ff

K1, K3, BETA = 0.02, 0.08, 2.0  # N/mm, N/mm, N s/mm


# %% [markdown]
# ## One loading


# %%
def load(folder: Path, beta: float) -> pd.DataFrame:
    """Load to 55 degrees at 35 mm/min; returns the curve that the rig writes."""
    case = ff.make_case(
        "picture_frame",
        hold_s=0,
        unload=False,
        crossover={"k1_N_mm": K1, "k3_N_mm": K3, "dashpot_N_s_mm": beta},
        solver={"first_step_s": 2.0, "largest_step_s": 8.0},
    )
    ff.run(case, folder)
    return pd.read_csv(folder / "curve.csv")


# %% [markdown]
# ## Comparison with the formula
#
# The dashpot's part needs the rate of shear: the model's is the difference quotient over a step,
# and so is the one below.


# %%
def main(folder: Path = Path("results/demo_picture_frame")) -> dict[str, float]:
    """Run both; returns the largest relative deviations from m / cos γ."""
    deviations = {}
    for name, beta in (("elastic", 0.0), ("viscous", BETA)):
        curve = load(folder / name, beta)
        gamma = np.radians(curve["shear_angle_deg"].to_numpy())
        rate = np.diff(gamma, prepend=0.0) / np.diff(curve["time_s"], prepend=0.0)
        moment = K1 * gamma + K3 * gamma**3 + beta * rate
        exact = moment / np.cos(gamma)
        error = np.abs(curve["normalised_force_N_mm"] - exact).max() / exact.max()
        deviations[name] = float(error)
    return deviations


if __name__ == "__main__":
    numbers = main()
    if MPI.COMM_WORLD.rank == 0:
        print(numbers)
