# %% [markdown]
# # How far a drape is from convergence
#
# Four drapes with other cells, spacings of the same fabric, steps and contact, as `fabric-fenicsx
# converge` runs them, and the estimate that each single run gives of itself beside what refinement
# finds.
#
# ```
# python demos/convergence.py          # into results/convergence, some twenty minutes
# python demos/convergence.py docs     # and the page into docs/convergence.md
# ```
#
# Runs that have ended are kept; one that was cut goes on.

# %%
import re
import shutil
import sys
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pandas as pd
from scipy.interpolate import CloughTocher2DInterpolator

import fabric_fenicsx as ff

HERE = Path(__file__).parent
DOCS = HERE.parent / "docs"

# %% [markdown]
# ## The drapes
#
# By case file: what the page calls it, which families are run, and the smallest radius of the tools
# that the fabric is bent over [mm].

# %%
DRAPES = {
    "drape": ("Hemisphere", ("cells", "spacing", "steps", "contact"), 10.0),
    "double_dome": ("Double dome", ("cells", "spacing", "contact"), 8.0),
    "box": ("Box", ("cells", "spacing", "contact"), 8.0),
    "drape_paper": ("Hemisphere, solid strips", ("cells", "spacing"), 10.0),
}


def study(name: str, folder: Path) -> dict[str, Any]:
    """The convergence study of a case file; collective."""
    case = ff.load_case(HERE / f"{name}.yaml")
    return ff.converge(case, folder / name, only=DRAPES[name][1], base=HERE, resume=True)


# %% [markdown]
# ## What single runs say of themselves
#
# The error of a run is taken against its two finest companions, extrapolated with order 2; the
# estimate is what the run had in its result.json.


# %%
def shear_on(folder: Path, places: np.ndarray) -> np.ndarray:
    """Shear of a run [degrees] at places on the flat sheet, (n,)."""
    table = pd.read_csv(folder / "crossings.csv")
    flat = table[["x0_mm", "y0_mm"]].to_numpy()
    return CloughTocher2DInterpolator(flat, table["shear_deg"].to_numpy())(places)


def estimates(found: dict[str, Any], folder: Path) -> list[tuple[float, float, float]]:
    """Spacing [mm], estimate and error [degrees rms] of the runs of a study but its finest."""
    (family,) = (f for f in found["families"] if f["name"] == "spacing")
    levels = family["levels"]
    rows = []
    for level in levels[:-1]:
        table = pd.read_csv(folder / level["folder"] / "crossings.csv")
        places = table[["x0_mm", "y0_mm"]].to_numpy()
        fine, finest = (shear_on(folder / one["folder"], places) for one in levels[-2:])
        off = finest + (finest - fine) / 3.0 - table["shear_deg"].to_numpy()
        error = float(np.sqrt(np.nanmean(off**2)))
        rows.append((level["size"], level["estimate_deg"], error))
    return rows


# %% [markdown]
# ## The page


# %%
def changes_table(found: dict[str, Any]) -> list[str]:
    """The changes of the shear by family and region, with order and error of the case."""
    lines = [
        "| family | region | changes, rms [°] | largest [°] (at x, y [mm]) | order | "
        "error of the case [°] | with safety [°] |",
        "|---|---|---|---|---|---|---|",
    ]
    for family in found["families"]:
        done = [level["value"] for level in family["levels"] if level["completed"]]
        for row in family["regions"]:
            whole = row["region"] == "all"
            named = f"{family['varied']}: {', '.join(f'{v:g}' for v in done)}" if whole else ""
            x, y = row["largest_at_mm"][-1]
            changes = ", ".join(f"{change:.3f}" for change in row["changes_deg"])
            largest = ", ".join(f"{abs(change):.2f}" for change in row["largest_deg"])
            lines.append(
                f"| {named} | {row['region']} | {changes} | {largest} ({x:g}, {y:g}) | "
                f"{order_of(row)} | {row['error']:.2f} | {row['uncertainty']:.2f} |"
            )
    return lines


def order_of(row: dict[str, Any]) -> str:
    """The observed order, or why there is none."""
    return row["basis"] if row["order"] is None else f"{row['order']:.2f}"


def numbers_table(found: dict[str, Any]) -> list[str]:
    """Punch force and points over the spacings, extrapolated, with their errors from all sizes."""
    (family,) = (f for f in found["families"] if f["name"] == "spacing")
    done = [f"{level['value']:g} mm" for level in family["levels"] if level["completed"]]
    lines = [
        f"| | {' | '.join(done)} | extrapolated | order | error of the case, all families |",
        "|---" * (len(done) + 4) + "|",
    ]
    for row in family["quantities"]:
        total = found["total"]["quantities"][row["name"]]
        name = row["name"].replace("punch_force_N", "punch force [N]")
        values = " | ".join(f"{value:.2f}" for value in row["values"])
        limit = "-" if row["order"] is None else f"{row['extrapolated']:.2f}"
        lines.append(f"| {name} | {values} | {limit} | {order_of(row)} | {total['error']:.2f} |")
    return lines


def estimates_table(found: dict[str, dict[str, Any]], folder: Path) -> list[str]:
    """Estimates of single runs beside their errors."""
    lines = [
        "| drape | spacing [mm] | spacing over the smallest tool radius | "
        "estimate of the run alone [° rms] | error by refinement [° rms] | ratio |",
        "|---|---|---|---|---|---|",
    ]
    for name, one in found.items():
        if name != "drape_paper":
            for spacing, estimate, error in estimates(one, folder / name):
                lines.append(
                    f"| {DRAPES[name][0]} | {spacing:g} | {spacing / DRAPES[name][2]:.2f} | "
                    f"{estimate:.2f} | {error:.2f} | {estimate / error:.2f} |"
                )
    return lines


def write_page(found: dict[str, dict[str, Any]], folder: Path) -> None:
    """Put the tables between the marks of docs/convergence.md, the pictures beside it."""
    page = DOCS / "convergence.md"
    text = page.read_text(encoding="utf-8")
    parts = {"estimates": estimates_table(found, folder)}
    for name, one in found.items():
        total = one["total"]["regions"]["all"]
        parts[name] = [
            *changes_table(one),
            "",
            *numbers_table(one),
            "",
            f"Error of the case: {total['error']:.2f}° rms, with the factors of safety "
            f"{total['uncertainty']:.2f}° ({', '.join(one['total']['of'])} added).",
        ]
        shutil.copy(folder / name / "converge.png", DOCS / "images" / f"convergence_{name}.png")
    for name, lines in parts.items():
        begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
        new = "\n".join([begin, *lines, end])
        text = re.sub(f"{begin}.*?{end}", lambda _, new=new: new, text, flags=re.S)
    page.write_text(text, encoding="utf-8")


def main(folder: Path = Path("results/convergence"), page: bool = False) -> dict[str, Any]:
    """Run the studies, print what they find, write the page if that is wanted."""
    found = {name: study(name, folder) for name in DRAPES}
    if MPI.COMM_WORLD.rank == 0:
        for name, one in found.items():
            print(f"\n{DRAPES[name][0]}", *changes_table(one), "", *numbers_table(one), sep="\n")
        print("", *estimates_table(found, folder), sep="\n")
        if page:
            write_page(found, folder)
    return found


if __name__ == "__main__":
    main(page="docs" in sys.argv[1:])
