# %% [markdown]
# # How much do the assumptions of the drape matter?
#
# The paper leaves open the sheet's size, the edge radius, the places of the five points and the
# curves of springs and dashpots. `demos/drape.yaml` declares a value and a reason for each. Here
# each is varied by itself, and the shift of the five angles is printed as a table in Markdown.
#
# ```
# python demos/drape_assumptions.py      # some twenty drapes, a few minutes
# ```

# %%
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

import fabric_fenicsx as ff

CASE = Path(__file__).parent / "drape.yaml"

# %% [markdown]
# Each variation is a name and the settings that make it; `points` moves all five places outward
# or inward along their radius.

# %%
VARIATIONS: dict[str, list[str]] = {
    "sheet 264 mm": ["sheet.width_mm=264", "sheet.length_mm=264"],
    "sheet 312 mm": ["sheet.width_mm=312", "sheet.length_mm=312"],
    "edge radius 8 mm": ["edge_radius_mm=8"],
    "edge radius 12 mm": ["edge_radius_mm=12"],
    "shear springs halved": ["crossover.k1_N_mm=0.01", "crossover.k3_N_mm=0.04"],
    "shear springs doubled": ["crossover.k1_N_mm=0.04", "crossover.k3_N_mm=0.16"],
    "dashpots halved": ["crossover.dashpot_N_s_mm=1"],
    "dashpots doubled": ["crossover.dashpot_N_s_mm=4"],
    "alignment 300 N mm": ["crossover.alignment_N_mm=300"],
    "alignment 3000 N mm": ["crossover.alignment_N_mm=3000"],
    "relaxation time 0.3 s": ["tow.relaxation_time_s=0.3"],
    "relaxation time 3 s": ["tow.relaxation_time_s=3"],
    "holder closed from the start": ["holder_gap_start_mm=-0.2"],
    "holder gap -0.4 mm": ["holder_gap_mm=-0.4"],
    "holder closes in 20 s": ["holder_closing_s=20"],
    "contact half as stiff": ["contact.stiffness_N_mm2=0.5"],
    "contact twice as stiff": ["contact.stiffness_N_mm2=2"],
    "contact layer 0.5 mm": ["contact.layer_mm=0.5"],
    "four cells per spacing": ["sheet.subdivisions=4"],
    "steps of at most 0.25 s": ["solver.largest_step_s=0.25"],
}
OUTWARD = {"points 6 mm inward": -6.0, "points 6 mm outward": 6.0}


# %%
def angles(folder: Path, settings: list[str], outward: float = 0.0) -> np.ndarray:
    """The five angles [degrees] of a variation."""
    case: Any = ff.load_case(CASE, settings)
    points = []
    for point in case.points:
        factor = 1.0 + outward / np.hypot(point.x_mm, point.y_mm)
        moved = {"x_mm": point.x_mm * factor, "y_mm": point.y_mm * factor}
        points.append(point.model_copy(update=moved))
    case = case.model_copy(update={"points": points})
    result = ff.run(case, folder, pictures=False)
    if not result["completed"]:
        raise SystemExit(f"{settings}: {result['stopped_because']}")
    return np.array([point["angle_deg"] for point in result["quantities"]["points"]])


def main(folder: Path = Path("results/assumptions")) -> dict[str, np.ndarray]:
    """Run all variations; returns the shift of the five angles [degrees] of each."""
    root = MPI.COMM_WORLD.rank == 0
    reference = angles(folder, [])
    shifts = {name: angles(folder, settings) - reference for name, settings in VARIATIONS.items()}
    shifts |= {name: angles(folder, [], outward) - reference for name, outward in OUTWARD.items()}
    if root:
        print("| varied | 1 | 2 | 3 | 4 | 5 |\n|---|---|---|---|---|---|")
        print("| as declared | " + " | ".join(f"{a:.1f}" for a in reference) + " |")
        for name, shift in shifts.items():
            print(f"| {name} | " + " | ".join(f"{a:+.1f}" for a in shift) + " |")
    return shifts


if __name__ == "__main__":
    main()
