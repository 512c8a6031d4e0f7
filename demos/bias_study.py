# %% [markdown]
# # What a bias extension measures, pinned and slipping
#
# The classical formulas suppose constant shear in each zone of the strip. First, pinned strips of
# three lengths on ever finer nets: what angle and force do they have beside the formulas? Then a
# large strip whose crossings slip or whose tows are crimped: from where on does it matter?
#
# ```
# python demos/bias_study.py          # into results/bias_study, some ten minutes
# python demos/bias_study.py docs     # and the tables and pictures of docs/bias_extension.md
# ```
#
# Runs that have ended are kept.

# %%
import json
import re
import sys
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline, LinearNDInterpolator

import fabric_fenicsx as ff

DOCS = Path(__file__).parents[1] / "docs"
K1, K3 = 0.02, 0.08  # N/mm
WIDTH = 100.0  # mm
RATIOS = (2.0, 2.5, 3.0)
DIAGONALS = (8, 16, 32)
ANGLES = (20.0, 40.0)  # of the formula [degrees]
TRAVELS = (20.0, 40.0, 60.0, 80.0, 105.0)  # of the large strip [mm]


def pulled(folder: Path, **keys: Any) -> tuple[pd.DataFrame, dict[str, Any]]:
    """The curve and the result of a strip; collective."""
    if not (folder / "result.json").exists():
        crossover = {"k1_N_mm": K1, "k3_N_mm": K3, "dashpot_N_s_mm": 0.0}
        crossover |= keys.pop("crossover", {})
        tow = {"per_width_mm": 12.0, "relaxation_time_s": 0.0} | keys.pop("tow", {})
        case = ff.make_case("bias_extension", crossover=crossover, tow=tow, **keys)
        ff.run(case, folder)
    MPI.COMM_WORLD.barrier()
    return pd.read_csv(folder / "curve.csv"), json.loads((folder / "result.json").read_text())


# %% [markdown]
# ## Pinned: three lengths, three spacings
#
# The tows hardly bend in the plane, so that the crossings carry all. Errors are of first order in
# the spacing; the limit is extrapolated so from the two finest.

# %%
READ = ("shear_angle_deg", "centre_angle_deg", "force_N")


def travel_at(strip: ff.BiasStrip, degrees: float) -> float:
    """Travel [mm] at which the formula gives an angle."""
    half = np.pi / 4.0 - np.radians(degrees) / 2.0
    return float((strip.length - strip.width) * (np.sqrt(2.0) * np.cos(half) - 1.0))


def pinned(folder: Path) -> dict[float, dict[str, Any]]:
    """Of each ratio: folders, unknowns, iterations, and what was read, (levels, READ, ANGLES).

    Forces are divided by that of the energy of the zones.
    """
    found = {}
    for ratio in RATIOS:
        strip = ff.BiasStrip(ratio * WIDTH, WIDTH)
        travel = np.array([travel_at(strip, degrees) for degrees in ANGLES])
        force = strip.force(lambda gamma: K1 * gamma + K3 * gamma**3, np.radians(ANGLES))
        one: dict[str, Any] = {"strip": strip, "folders": [], "effort": [], "read": []}
        for count in DIAGONALS:
            spacing = WIDTH / count / np.sqrt(2.0)
            own = folder / f"pinned_{ratio:g}_{count}"
            curve, result = pulled(
                own,
                length_mm=strip.length,
                width_mm=WIDTH,
                warp_spacing_mm=spacing,
                weft_spacing_mm=spacing,
                travel_mm=float(travel[-1]),
                rate_mm_min=60.0,
                tow={"stiffness": {"bending_in_plane_Nmm": 0.01}},
                solver={"first_step_s": 1.0, "largest_step_s": float(travel[-1]) / 12.0},
            )
            at = [CubicSpline(curve["displacement_mm"], curve[name])(travel) for name in READ]
            one["folders"].append(own)
            one["effort"].append((result["dofs"], result["newton_iterations"]))
            one["read"].append([at[0], at[1], at[2] / force])
        one["read"] = np.array(one["read"])
        found[ratio] = one
    return found


def pinned_table(found: dict[float, dict[str, Any]]) -> list[str]:
    """Angles and forces over the spacings, and their limits."""
    heads = [f"zone A, its centre [°], force at {degrees:g}°" for degrees in ANGLES]
    lines = [
        f"| L/W | spacing [mm] | {' | '.join(heads)} | unknowns | iterations |",
        "|" + "---|" * (4 + len(ANGLES)),
    ]
    for ratio, one in found.items():
        read = one["read"]
        levels = [*read, 2.0 * read[-1] - read[-2]]
        names = [f"{WIDTH / count / np.sqrt(2.0):.2f}" for count in DIAGONALS] + ["→ 0"]
        efforts = [*one["effort"], ("", "")]
        for name, level, effort in zip(names, levels, efforts, strict=True):
            cells = [f"{a:.1f}, {c:.1f}, {f:.3f}" for a, c, f in level.T]
            lines.append(
                f"| {ratio:g} | {name} | {' | '.join(cells)} | {effort[0]} | {effort[1]} |"
            )
    return lines


def draw_pinned(path: Path, found: dict[float, dict[str, Any]]) -> None:
    """Angle and force over the spacing, and the angle along the middle of the finest strips."""
    figure = Figure(figsize=(13.0, 4.0), layout="constrained")
    angle, force, along = figure.subplots(1, 3)
    spacing = WIDTH / np.array(DIAGONALS) / np.sqrt(2.0)
    for number, (ratio, one) in enumerate(found.items()):
        colour, read = f"C{number}", one["read"][:, :, -1]
        limit = 2.0 * read[-1] - read[-2]
        x = np.append(spacing, 0.0)
        for axes, k, style in ((angle, 0, "o-"), (angle, 1, "s:"), (force, 2, "o-")):
            axes.plot(x, np.append(read[:, k], limit[k]), style, color=colour)
        results = ff.read_results(one["folders"][-1])
        net, last, _ = results.at(max(results.steps))
        places = net.points[net.crossings[:, 0], :2]
        shear = LinearNDInterpolator(places, np.degrees(last.shear_angle))
        y = np.linspace(0.0, one["strip"].length / 2.0, 400)
        line = np.column_stack([np.zeros_like(y), y])
        along.plot(y, shear(line), color=colour, label=f"L/W = {ratio:g}")
        zone = one["strip"].gripped(line)
        constant = ANGLES[-1] * (1.0 - zone / 2.0)
        along.plot(y, constant, "--", color=colour, lw=1.0)
    angle.axhline(ANGLES[-1], color="#7f8c8d", ls="--")
    force.axhline(1.0, color="#7f8c8d", ls="--")
    angle.set(xlabel="spacing [mm]", ylabel="angle of zone A (o), of its centre (□) [°]")
    force.set(xlabel="spacing [mm]", ylabel="force / that of the zones' energy")
    along.set(xlabel="from the middle towards the clamp, x = 0 [mm]", ylabel="shear angle [°]")
    along.legend()
    for axes in (angle, force, along):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


# %% [markdown]
# ## Slip and crimp on a large strip
#
# 150 x 450 mm with tows 5.3 mm apart, pulled by 105 mm. Springs of 10 N/mm take half the iterations
# of stiffer ones where crossings slip.

# %%
LARGE = {
    "length_mm": 450.0,
    "width_mm": 150.0,
    "warp_spacing_mm": 5.3,
    "weft_spacing_mm": 5.3,
    "travel_mm": TRAVELS[-1],
    "rate_mm_min": 60.0,
    "solver": {"first_step_s": 2.0, "largest_step_s": 5.0},
}
CASES: dict[str, dict[str, Any]] = {
    "pinned": {},
    "slip at 0.3 N": {"crossover": {"translation_N_mm": 10.0, "slip_limit_N": 0.3}},
    "slip at 0.1 N": {"crossover": {"translation_N_mm": 10.0, "slip_limit_N": 0.1}},
    "crimp 2 %": {"tow": {"crimp_strain": 0.02, "crimp_stiffness_share": 0.005}},
}
SLIPPED = 0.05
"""Slip [mm] beyond what the springs give, from which on a crossing counts as slipping."""


def large(folder: Path) -> dict[str, tuple[pd.DataFrame, dict[str, Any], Path]]:
    """Curve, result and folder of the large strip in each of the cases."""
    found = {}
    for name, keys in CASES.items():
        own = folder / re.sub(r"\W+", "_", name)
        found[name] = (*pulled(own, **LARGE, **keys), own)
    return found


def onset(folder: Path, limit: float) -> tuple[float, float, float]:
    """Travel [mm] at which the first crossing slips, and its |x| and |y| [mm]."""
    results = ff.read_results(folder)
    curve = pd.read_csv(folder / "curve.csv")
    for number, travel in zip(results.steps, curve["displacement_mm"], strict=True):
        net, state, _ = results.at(number)
        warp, weft = net.crossings.T
        slip = np.linalg.norm(state.displacement[weft] - state.displacement[warp], axis=1)
        if slip.max() > limit / 10.0 + SLIPPED:
            x, y, _ = np.abs(net.points[warp[slip.argmax()]])
            return float(travel), float(x), float(y)
    return np.nan, np.nan, np.nan


def large_table(found: dict[str, tuple[pd.DataFrame, dict[str, Any], Path]]) -> list[str]:
    """Angles, force, slip and effort of the large strip."""
    lines = [
        f"| 150 x 450 mm | angle [°] at {', '.join(f'{d:g}' for d in TRAVELS)} mm | force at "
        "105 mm [N] | slip at 105 mm: largest, edges, mean [mm] | let go | steps, iterations |",
        "|---" * 6 + "|",
    ]
    formula = np.degrees(ff.BiasStrip(450.0, 150.0).angle(np.array(TRAVELS)))
    lines.append(f"| formula | {', '.join(f'{a:.1f}' for a in formula)} | | | | |")
    for name, (curve, result, _) in found.items():
        x = curve["displacement_mm"]
        angle = CubicSpline(x, curve["shear_angle_deg"])(TRAVELS)
        last = curve.iloc[-1]
        slip = [last[f"{which}_slip_mm"] for which in ("largest", "edge", "mean")]
        lines.append(
            f"| {name} | {', '.join(f'{a:.1f}' for a in angle)} | {last['force_N']:.1f} | "
            f"{', '.join(f'{s:.2f}' for s in slip)} | {last['crossings_let_go']:.1f} | "
            f"{result['steps']}, {result['newton_iterations']} |"
        )
    return lines


def draw_large(path: Path, found: dict[str, tuple[pd.DataFrame, dict[str, Any], Path]]) -> None:
    """Angle, force and slip over the travel, and where on the strip the crossings have slipped."""
    figure = Figure(figsize=(15.0, 4.6), layout="constrained")
    angle, force, slip, where = figure.subplots(1, 4, width_ratios=(1.0, 1.0, 1.0, 0.62))
    for name, (curve, _, _) in found.items():
        travel = curve["displacement_mm"]
        angle.plot(travel, curve["shear_angle_deg"], label=name)
        force.plot(travel, curve["force_N"])
        if name.startswith("slip"):
            (line,) = slip.plot(travel, curve["largest_slip_mm"], label=f"{name}: largest")
            for which, style in (("edge", "--"), ("mean", ":")):
                slip.plot(travel, curve[f"{which}_slip_mm"], style, color=line.get_color())
    x = np.linspace(0.0, TRAVELS[-1], 200)
    formula = np.degrees(ff.BiasStrip(450.0, 150.0).angle(x))
    angle.plot(x, formula, "--", color="#7f8c8d", label="formula")
    angle.set_ylabel("angle of zone A [°]")
    force.set_ylabel("force [N]")
    slip.set_ylabel("slip: largest, on the edges (- -), mean (:) [mm]")
    slip.set_yscale("log")
    slip.set_ylim(1e-2)
    for axes in (angle, force, slip):
        axes.set_xlabel("travel [mm]")
        axes.grid(alpha=0.3)
    angle.legend()
    slip.legend()
    results = ff.read_results(found["slip at 0.1 N"][2])
    net, last, _ = results.at(max(results.steps))
    warp, weft = net.crossings.T
    size = np.linalg.norm(last.displacement[weft] - last.displacement[warp], axis=1)
    size = np.maximum(size, 1e-2)
    at = net.points[warp]
    dots = where.scatter(at[:, 0], at[:, 1], c=np.log10(size), s=5.0, cmap="magma_r")
    bar = figure.colorbar(dots, ax=where, label="slip at 105 mm [mm], on the flat strip")
    bar.set_ticks([-2.0, -1.0, 0.0, 1.0], labels=["≤ 0.01", "0.1", "1", "10"])
    where.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]", title="slip at 0.1 N")
    figure.savefig(path, dpi=110)


# %% [markdown]
# ## The same fabric with other tows
#
# A limit per crossing goes with the area that the crossing stands for, as the springs' stiffness.


# %%
def spaced(folder: Path) -> list[str]:
    """A table of 100 x 200 mm with slip, at three spacings of one fabric."""
    lines = [
        "| spacing [mm] | angle at 20, 32 mm [°] | force [N] | mean slip [mm] |",
        "|---" * 4 + "|",
    ]
    for count in (10, 14, 20):
        spacing = WIDTH / count / np.sqrt(2.0)
        area = (spacing / 5.3) ** 2
        curve, _ = pulled(
            folder / f"slip_{count}",
            warp_spacing_mm=spacing,
            weft_spacing_mm=spacing,
            travel_mm=32.0,
            rate_mm_min=60.0,
            crossover={"translation_N_mm": 10.0 * area, "slip_limit_N": 0.1 * area},
            solver={"first_step_s": 1.0, "largest_step_s": 2.0},
        )
        at = [
            CubicSpline(curve["displacement_mm"], curve[name])([20.0, 32.0])
            for name in ("shear_angle_deg", "force_N", "mean_slip_mm")
        ]
        cells = [f"{a:.1f}, {b:.1f}" for a, b in at[:2]] + ["{:.3f}, {:.3f}".format(*at[2])]
        lines.append(f"| {spacing:.2f} | {' | '.join(cells)} |")
    return lines


def main(folder: Path = Path("results/bias_study"), page: bool = False) -> dict[str, list[str]]:
    """Run the studies and print their tables; write the page if that is wanted."""
    free, strip = pinned(folder), large(folder)
    tables = {
        "pinned": pinned_table(free),
        "large": large_table(strip),
        "spaced": spaced(folder),
    }
    if MPI.COMM_WORLD.rank == 0:
        for limit in (0.3, 0.1):
            travel, x, y = onset(strip[f"slip at {limit} N"][2], limit)
            tables["large"] += [
                "",
                f"With {limit} N the first crossing slips at {travel:.0f} mm, "
                f"{x:.0f} mm from the middle line and {225.0 - y:.0f} mm from the clamp.",
            ]
        print(*(line for lines in tables.values() for line in ["", *lines]), sep="\n")
        if page:
            draw_pinned(DOCS / "images" / "bias_pinned.png", free)
            draw_large(DOCS / "images" / "bias_slip.png", strip)
            path = DOCS / "bias_extension.md"
            text = path.read_text(encoding="utf-8")
            for name, lines in tables.items():
                begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
                new = "\n".join([begin, *lines, end])
                text = re.sub(f"{begin}.*?{end}", lambda _, new=new: new, text, flags=re.S)
            path.write_text(text, encoding="utf-8")
    return tables


if __name__ == "__main__":
    main(page="docs" in sys.argv[1:])
