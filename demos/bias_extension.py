# %% [markdown]
# # Bias extension, pinned and slipping
#
# A strip of 75 x 180 mm is pulled at 45 degrees to its tows. The classical formula gives the shear
# angle of its middle from the travel, and the energy of the zones the moment of the crossings from
# the force. Both suppose constant shear in each zone. The demo runs the net and asks what they
# make of it, then lets the crossings slip.
#
# ```
# python demos/bias_extension.py                # or: mpirun -n 2 python demos/bias_extension.py
# fabric-fenicsx run demos/bias_extension.yaml  # 100 x 200 mm, from a case file
# ```

# %%
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pandas as pd

import fabric_fenicsx as ff

K1, K3 = 0.02, 0.08  # N/mm
LENGTH, WIDTH = 180.0, 75.0  # mm


# %% [markdown]
# ## One strip


# %%
def pull(folder: Path, **crossover: float) -> pd.DataFrame:
    """Pull the strip by 30 mm; returns the curve that the rig writes."""
    case = ff.make_case(
        "bias_extension",
        length_mm=LENGTH,
        width_mm=WIDTH,
        warp_spacing_mm=5.3,
        weft_spacing_mm=5.3,
        travel_mm=30.0,
        rate_mm_min=60.0,
        tow={"per_width_mm": 12.0},
        crossover={"k1_N_mm": K1, "k3_N_mm": K3, "dashpot_N_s_mm": 0.0, **crossover},
        solver={"first_step_s": 1.0, "largest_step_s": 2.0},
    )
    ff.run(case, folder)
    return pd.read_csv(folder / "curve.csv")


# %% [markdown]
# ## What the formulas make of it


# %%
def main(folder: Path = Path("results/demo_bias_extension")) -> dict[str, float]:
    """Run both; returns angles and slip at the end, and how far the moment found is off."""
    strip = ff.BiasStrip(LENGTH, WIDTH)
    pinned = pull(folder / "pinned")
    slipping = pull(folder / "slipping", translation_N_mm=10.0, slip_limit_N=0.15)
    angle = strip.angle(pinned["displacement_mm"].to_numpy())
    found = strip.moment(angle, pinned["force_N"].to_numpy())
    exact = K1 * angle + K3 * angle**3
    return {
        "formula_deg": float(np.degrees(angle[-1])),
        "pinned_deg": float(pinned["shear_angle_deg"].iloc[-1]),
        "slipping_deg": float(slipping["shear_angle_deg"].iloc[-1]),
        "moment_off": float(np.abs(found - exact).max() / exact.max()),
        "slip_mm": float(slipping["largest_slip_mm"].iloc[-1]),
    }


if __name__ == "__main__":
    numbers = main()
    if MPI.COMM_WORLD.rank == 0:
        print(numbers)
