# %% [markdown]
# # How much do the assumptions of the drape matter?
#
# The paper leaves open the sheet's size, the edge radius, the places of the five points and the
# curves of springs and dashpots. `demos/drape.yaml` declares a value and a reason for each. Here
# each is varied by itself, and the shift of the five angles is printed as a table in Markdown.
#
# ```
# python demos/drape_assumptions.py      # some forty drapes, ten minutes
# ```

# %%
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

import fabric_fenicsx as ff

HERE = Path(__file__).parent
CASES = {"bundles": HERE / "drape.yaml", "solid strips": HERE / "drape_paper.yaml"}

# %% [markdown]
# Each variation is a name and the settings that make it, for both cases: `drape.yaml`, whose tows
# bend in the sheet's plane as bundles of fibres do, and `drape_paper.yaml` with the paper's solid
# strips. `points` moves all five places outward or inward along their radius.

# %%
VARIATIONS: dict[str, list[str]] = {
    "sheet 264 mm instead of 288": ["sheet.width_mm=264", "sheet.length_mm=264"],
    "sheet 312 mm": ["sheet.width_mm=312", "sheet.length_mm=312"],
    "edge radius 8 mm instead of 10": ["edge_radius_mm=8"],
    "edge radius 12 mm": ["edge_radius_mm=12"],
    "friction 0.3": ["contact.friction=0.3"],
    "shear springs halved": ["crossover.k1_N_mm=0.01", "crossover.k3_N_mm=0.04"],
    "shear springs doubled": ["crossover.k1_N_mm=0.04", "crossover.k3_N_mm=0.16"],
    "dashpots halved": ["crossover.dashpot_N_s_mm=1"],
    "dashpots doubled": ["crossover.dashpot_N_s_mm=4"],
    "relaxation time of bending 0.5 s instead of 1": ["tow.relaxation_time_s=0.5"],
    "relaxation time of bending 2 s": ["tow.relaxation_time_s=2"],
    "contact four times as stiff": ["contact.stiffness_N_mm2=4"],
    "punch 0.05 mm off its axis": ["symmetry=none", "punch_offset_x_mm=0.05"],
    "four cells per spacing instead of two": ["sheet.subdivisions=4"],
    "steps of at most 0.25 s instead of 1": [
        "solver.largest_step_s=0.25",
        "solver.first_step_s=0.025",
    ],
}
#: Of one of the cases only.
OWN = {
    "bundles": {
        "no friction instead of 0.1": ["contact.friction=0"],
        "holder force 40 N instead of 80": ["holder_force_N=40"],
        "holder force 400 N": ["holder_force_N=400"],
        "in-plane bending three times as high": ["tow.stiffness.bending_in_plane_Nmm=28.5"],
        "in-plane bending a tenth": ["tow.stiffness.bending_in_plane_Nmm=0.95"],
        "half the spacing": ["sheet.warp_spacing_mm=3", "sheet.weft_spacing_mm=3"],
    },
    "solid strips": {
        "friction 0.1 instead of none": ["contact.friction=0.1"],
        "holder gap -0.4 mm instead of -0.2": ["holder_gap_mm=-0.4"],
        "half the spacing": [
            "sheet.warp_spacing_mm=6",
            "sheet.weft_spacing_mm=6",
            "tow.per_width_mm=12",
        ],
    },
}
OUTWARD = {"points 6 mm inward": -6.0, "points 6 mm outward": 6.0}


# %%
def angles(folder: Path, path: Path, settings: list[str], outward: float = 0.0) -> np.ndarray:
    """The five angles [degrees] of a variation."""
    case: Any = ff.load_case(path, settings)
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


def main(folder: Path = Path("results/assumptions")) -> dict[str, dict[str, np.ndarray]]:
    """Run all variations; returns the shift of the five angles [degrees] of each, by case."""
    shifts: dict[str, dict[str, np.ndarray]] = {}
    for kind, path in CASES.items():
        reference = angles(folder, path, [])
        shifts[kind] = {"as declared": reference}
        for name, settings in {**VARIATIONS, **OWN[kind]}.items():
            shifts[kind][name] = angles(folder, path, settings) - reference
        for name, outward in OUTWARD.items():
            shifts[kind][name] = angles(folder, path, [], outward) - reference
    if MPI.COMM_WORLD.rank == 0:
        print(table(shifts))
    return shifts


def table(shifts: dict[str, dict[str, np.ndarray]]) -> str:
    """Both cases beside each other, in Markdown."""
    kinds = list(shifts)
    numbers = " | ".join(str(k) for _ in kinds for k in range(1, 6))
    lines = [f"| {' / '.join(kinds)} | {numbers} |", "|---" * (5 * len(kinds) + 1) + "|"]
    for name in dict.fromkeys(name for kind in kinds for name in shifts[kind]):
        form = "{:.1f}" if name == "as declared" else "{:+.1f}"
        cells = []
        for kind in kinds:
            own = shifts[kind].get(name)
            cells += [""] * 5 if own is None else [form.format(angle) for angle in own]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
