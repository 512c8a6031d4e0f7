# %% [markdown]
# # Strips that bend under their own weight
#
# A heavy strip of bending stiffness B per width and weight w per area hangs as an elastica,
#
# $$ B \theta'' = -w (L - s) \cos\theta, \qquad \theta(0) = 0, \quad \theta'(L) = 0, $$
#
# with θ the slope downwards. Scipy solves it here, and the net of beams is laid beside it for the
# paper's three overhangs.
#
# ```
# python demos/cantilever.py                # or: mpirun -n 2 python demos/cantilever.py
# fabric-fenicsx run demos/cantilever.yaml  # from a case file
# ```

# %%
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pandas as pd
from scipy.integrate import solve_bvp, trapezoid

import fabric_fenicsx as ff


# %%
def elastica_drop(length: float, weight: float, stiffness: float) -> float:
    """Drop [mm] of the tip of the heavy elastica; weight [N/mm], stiffness [N mm²]."""

    def slope(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.vstack([y[1], -weight / stiffness * (length - s) * np.cos(y[0])])

    def ends(at_clamp: np.ndarray, at_tip: np.ndarray) -> np.ndarray:
        return np.array([at_clamp[0], at_tip[1]])

    s = np.linspace(0.0, length, 400)
    # The guess hangs down at the tip: it leads to the stable shape.
    guess = np.vstack([1.3 * s / length, np.full_like(s, 1.3 / length)])
    solution = solve_bvp(slope, ends, s, guess, tol=1e-8, max_nodes=20000)
    return float(trapezoid(np.sin(solution.sol(s)[0]), s))


# %% [markdown]
# The net's weight per width is that of its tows, hanging and crossing ones alike, as in eq. (8) of
# the paper; its bending stiffness is that of the hanging tows.


# %%
def main(folder: Path = Path("results/demo_cantilever")) -> dict[float, tuple[float, float]]:
    """Run the three specimens; returns the tip's drop [mm] by the net and by the elastica."""
    case = ff.make_case("cantilever", solver={"force_tolerance_N": 1e-8})
    ff.run(case, folder)
    shape = pd.read_csv(folder / "shape.csv")

    keys = case.tow
    # kg becomes tonne.
    tow = ff.RectangularSection(
        keys.width_mm, keys.height_mm, 1e-3 * keys.density_kg_mm3, keys.C1_MPa
    )
    drops = {}
    for length, own in shape.groupby("length_mm"):
        sheet = ff.spaced_sheet(
            (0.0, float(length)),
            (0.0, case.width_mm),
            case.warp_spacing_mm,
            case.weft_spacing_mm,
        )
        hanging, crossing = len(sheet.weft_positions), len(sheet.warp_positions)
        tows_length = hanging * length + crossing * case.width_mm
        weight = tow.density * tow.area * tows_length * case.gravity_mm_s2 / length
        exact = elastica_drop(float(length), weight, hanging * tow.stiffness()[4])
        drops[float(length)] = (float(-own["z_mm"].iloc[-1]), exact)
    return drops


if __name__ == "__main__":
    numbers = main()
    if MPI.COMM_WORLD.rank == 0:
        for overhang, (net, exact) in numbers.items():
            print(f"overhang {overhang:6.1f} mm: net {net:7.2f} mm, elastica {exact:7.2f} mm")
