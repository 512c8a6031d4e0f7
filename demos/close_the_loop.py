# %% [markdown]
# # The loop, closed to the end
#
# From measured curves to the effects that a model lacks, and on to a drape that has them. The
# crossings of this fabric hold a powder of binder: they are stiff until it breaks, which goes by
# the largest angle that a crossing has seen. And the roll was stored with a fold in it: each strip
# of the bending test is curved 70 mm from its clamp. Neither is on the package's list of effects.
#
# 1. Frames and strips are measured: made up by formulas, without the package, noise included.
# 2. `diagnose` fits the baseline, finds that no listed effect will do, and discovers two terms.
# 3. A sheet is draped as the baseline says, as found, and with the true binder.
#
# ```
# python demos/close_the_loop.py
# ```
#
# A minute and a half on one core; `docs` behind it puts the figure into `docs/images`. Of your own
# measurements steps 2 and 3 are two commands:
#
# ```
# fabric-fenicsx diagnose my/frames my/strips --out results/found
# fabric-fenicsx run demos/drape.yaml --fabric results/found/fabric.yaml --uncertainty
# ```
#
# An effect that is on the list is hidden, and named again, in `hidden_friction.py`.

# %%
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from matplotlib.figure import Figure
from scipy.integrate import solve_bvp
from ufl import max_value

import fabric_fenicsx as ff

# %% [markdown]
# ## The truth
#
# Of a crossing, per area, m = k1 γ h(Γ) + β dγ/dt, with Γ the largest |γ| so far; of a strip, per
# width, M = B (κ − κ0(s)). B and the weight are those of the fabric of `drape.yaml`.

# %%
K1, DASHPOT = 0.4, 2.0  # N/mm, N s/mm
LOST, BREAKS = 0.8, 0.25  # share, rad
C1, DENSITY = 60000.0, 0.2132  # MPa, kg/m²: demos/drape.yaml
WEIGHT, B = DENSITY * 9.81e-6, 6.0 * C1 * 4.57 * 0.04**3 / 12.0 / 12.0  # N/mm², N mm
FOLD, PLACE, WIDTH = -0.01, 70.0, 15.0  # 1/mm, mm, mm
FRAME, FABRIC = 192.0, 96.0  # mm
FORCE_NOISE, HEIGHT_NOISE = 0.1, 0.15  # N, mm


def held(largest: Any) -> Any:
    """What is left of the springs: 1 − 0.8 Γ⁴/(Γ⁴ + Γ_b⁴)."""
    q = (largest / BREAKS) ** 4
    return 1.0 - LOST * q / (1.0 + q)


def fold(s: Any) -> Any:
    """Curvature of the unloaded strip [1/mm] at an arc length from the clamp [mm]; downwards."""
    return FOLD / np.cosh((s - PLACE) / WIDTH) ** 2


# %% [markdown]
# ## Measured, without the package
#
# A frame goes out and back, further each time: F = m L_fabric²/(L_frame sin θ), θ = π/4 − γ/2.
# Strips hang by θ' = M/B + κ0, M' = w (L − s) cos θ.


# %%
def frame(rate: float, turns: tuple[float, ...], noise: Any) -> dict[str, Any]:
    """Readings of a run at a rate [mm/min] that turns at these displacements [mm]."""
    corners = np.array([0.0, *turns])
    at = np.append(0.0, np.cumsum(np.abs(np.diff(corners)))) * 60.0 / rate
    time = np.linspace(0.0, at[-1], 239 * 20 + 1)
    D = np.interp(time, at, corners)
    gamma = np.pi / 2 - 2 * np.arccos((np.sqrt(2.0) * FRAME + D) / (2 * FRAME))
    largest = np.maximum.accumulate(np.abs(gamma))
    m = K1 * gamma * held(largest) + DASHPOT * np.gradient(gamma, time)
    F = m * FABRIC**2 / (FRAME * np.sin(np.pi / 4 - gamma / 2))
    columns = {"time_s": time[::20], "displacement_mm": D[::20], "force_N": F[::20]}
    columns["force_N"] = columns["force_N"] + FORCE_NOISE * noise.standard_normal(240)
    return columns


def strip(length: float, noise: Any) -> dict[str, Any]:
    """Readings of a strip of this overhang [mm]."""

    def along(s: Any, y: Any) -> Any:
        bend = y[1] / B + fold(s)
        weight = WEIGHT * (length - s)
        return np.stack([bend, weight * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    def ends(clamp: Any, free: Any) -> Any:
        return np.array([clamp[0], free[1], clamp[2], clamp[3]])

    s = np.linspace(0.0, length, 201)
    start = np.stack([-0.5 * s / length, 0 * s, s, -0.2 * s])
    line = solve_bvp(along, ends, s, start, tol=1e-6, max_nodes=20000)
    at = np.linspace(length / 20, length, 20)
    _, _, x, z = line.sol(at)
    z = z + HEIGHT_NOISE * noise.standard_normal(20)
    return {"length_mm": np.full(20, length), "s_mm": at, "x_mm": x, "z_mm": z}


def measure(folder: Path) -> list[Path]:
    """Write both measurements as a user would, once; the last run of each is held out."""
    rng = np.random.default_rng(0)
    out_and_back = (40.0, 0.0, 65.0, 0.0, 85.0, 0.0)
    frames = [frame(rate, out_and_back, rng) for rate in (35.0, 350.0)]
    frames.append(frame(105.0, (55.0, 0.0, 75.0, 0.0), rng))
    strips = [strip(length, rng) for length in (120.0, 180.0, 250.0, 150.0)]
    sides = {"frame_length_mm": FRAME, "fabric_length_mm": FABRIC}
    for name, test, rig, noise, runs in (
        ("frames", "picture_frame", sides, {"force_N": FORCE_NOISE}, frames),
        ("strips", "cantilever", {"width_mm": 50.0}, {"z_mm": HEIGHT_NOISE}, strips),
    ):
        (folder / name).mkdir(parents=True, exist_ok=True)
        files = [
            {"file": f"run{k}.csv", "role": "fit", "specimen": "one"} for k in range(len(runs))
        ]
        files[-1]["role"] = "holdout"
        for file, columns in zip(files, runs, strict=True):
            pd.DataFrame(columns).to_csv(folder / name / file["file"], index=False)
        content = {
            "schema": "fabric-measurement/1",
            "test": test,
            "title": f"{name} of a fabric with a binder and a fold",
            "fabric": {"areal_density_kg_m2": DENSITY},
            "rig": rig,
            "noise": noise,
            "runs": files,
        }
        (folder / name / "measurement.yaml").write_text(yaml.safe_dump(content))
    return [folder / "frames", folder / "strips"]


# %% [markdown]
# ## The truth as a law
#
# In the finite elements the binder is a law of a crossing that remembers Γ.


# %%
@dataclass(frozen=True)
class Binder(ff.CrossingLaw):
    """M = k1 γ h(Γ)."""

    k1: Any = ff.per_area("k1_N_mm", "stiffness per area while the binder holds")

    def moment(self, at: ff.Crossing) -> Any:
        """Moment that resists γ."""
        return at.number(self.k1) * at.gamma * held(self.history(at)["largest"])

    def history(self, at: ff.Crossing) -> dict[str, Any]:
        """The largest |γ| so far."""
        return {"largest": max_value(at.past("largest"), at.size)}


# %% [markdown]
# ## Three drapes
#
# The sheet of `drape.yaml` with tows 12 mm apart, over a hemisphere, 65 mm deep.

# %%
CASE = Path(__file__).with_name("drape.yaml")
OUT, PICTURE = Path("results/demo_close_the_loop"), "close_the_loop.png"
SETTINGS = ["sheet.warp_spacing_mm=12", "sheet.weft_spacing_mm=12"]


def drapes(folder: Path, found: ff.Found, fabric: Path) -> dict[str, dict[str, Any]]:
    """Drape with the baseline, as found, and in truth; returns result.json of each."""
    base = {k: v for d in found.diagnoses for k, v in d.baseline.values.items()}
    baseline = [
        f"crossover.k1_N_mm={max(base['k1_N'], 0.0)}",
        f"crossover.k3_N_mm={max(base['k3_N'], 0.0)}",
        f"crossover.dashpot_N_s_mm={max(base['c1_N_s'], 0.0)}",
        f"tow.C1_MPa={base['C1_MPa']}",
    ]
    crossing = ["crossover.k1_N_mm=0", "crossover.k3_N_mm=0"]
    truth = [*crossing, f"crossover.dashpot_N_s_mm={DASHPOT}"]

    def binder(area: float) -> Binder:
        return Binder(K1 * area)

    def run(name: str, settings: list[str], **more: Any) -> dict[str, Any]:
        case = ff.load_case(CASE, [*SETTINGS, *settings])
        result = ff.run(case, folder / "drapes" / name, pictures=False, **more)
        if not result["completed"]:
            raise SystemExit(f"{name}: {result['stopped_because']}")
        return result

    return {
        "baseline": run("baseline", baseline),
        "found": run("found", [], fabric=fabric, uncertainty=True),
        "truth": run("truth", truth, laws=[binder]),
    }


# %% [markdown]
# ## Beside each other


# %%
def angles(folder: Path, name: str) -> pd.DataFrame:
    """Shear angle of each crossing [degrees] of the quarter, by its place on the flat sheet."""
    rows = pd.read_csv(folder / "drapes" / name / "crossings.csv")
    return rows.pivot(index="y0_mm", columns="x0_mm", values="shear_deg")


def table(folder: Path, results: dict[str, dict[str, Any]]) -> str:
    """What the drapes have in common with the truth, in Markdown."""
    uncertain = results["found"]["uncertainty"]
    force = uncertain["quantities"]["punch_force_N"]["fit"]
    (rms,) = (r["fit_deg"] for r in uncertain["regions"] if r["region"] == "all")
    lines = [
        "| drape | punch force, N | largest shear, ° | angles off the truth, ° rms | at most |",
        "|---|---|---|---|---|",
    ]
    for name, result in results.items():
        own, found = result["quantities"], name == "found"
        off = (angles(folder, name) - angles(folder, "truth")).to_numpy()
        cells = [
            f"{own['punch_force_N']:.2f}" + f" ± {force:.2f}" * found,
            f"{own['largest_shear_angle_deg']:.2f}",
            f"{np.sqrt(np.mean(off**2)):.4f}" + f" (stated: {rms:.4f})" * found,
            f"{np.abs(off).max():.3f}",
        ]
        lines.append("| " + " | ".join([name, *cells]) + " |")
    return "\n".join(lines)


def figure(folder: Path, found: ff.Found) -> Figure:
    """What was found beside what was hidden, and what it does to the drape."""
    drawn = Figure(figsize=(11.0, 6.4), layout="constrained")
    (binder, creased, forces), maps = drawn.subplots(2, 3)
    frames, _ = found.diagnoses
    x, f, std = np.loadtxt(folder / "found/discovered_1.csv", delimiter=",", skiprows=1).T
    k1 = frames.final.values["k1_N"]
    binder.axhline(frames.baseline.values["k1_N"], color="#9aa5b1", ls="--", label="baseline")
    binder.fill_between(x, k1 * (1 + f - 2 * std), k1 * (1 + f + 2 * std), color="#cfdde6")
    binder.plot(x, k1 * (1 + f), color="#22577a", label="found, ± 2 standard errors")
    binder.plot(x, K1 * held(x), ":", color="#c8553d", label="hidden")
    binder.set(
        ylim=(0, 1.4 * K1),
        xlabel="largest shear angle so far [rad]",
        ylabel="spring of a crossing [N/mm]",
    )
    s, kappa, std = np.loadtxt(folder / "found/discovered_2.csv", delimiter=",", skiprows=1).T
    creased.fill_between(s, kappa - 2 * std, kappa + 2 * std, color="#cfdde6")
    creased.plot(s, kappa, color="#22577a", label="found")
    creased.plot(s, fold(s), ":", color="#c8553d", label="hidden")
    creased.set(xlabel="arc length of the strip [mm]", ylabel="curvature unloaded [1/mm]")
    colours = {"baseline": "#9aa5b1", "found": "#22577a", "truth": "#c8553d"}
    for (name, colour), style in zip(colours.items(), ("--", "-", ":"), strict=True):
        steps = pd.read_csv(folder / "drapes" / name / "steps.csv")
        forces.plot(
            65 / 60 * steps["time_s"], -steps["punch_force_z_N"], style, color=colour, label=name
        )
    forces.set(xlabel="depth of the draw [mm]", ylabel="punch force [N]")
    for axes in (binder, creased, forces):
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, fontsize=8)
    truth = angles(folder, "truth")
    shown = {"shear angle in truth [°]": truth}
    for name in ("baseline", "found"):
        shown[f"{name} − truth [°]"] = angles(folder, name) - truth
    limit = float(np.abs(shown["baseline − truth [°]"]).to_numpy().max())
    for axes, (title, values) in zip(maps, shown.items(), strict=True):
        of_truth = values is truth
        low, colour = (0.0, "viridis") if of_truth else (-limit, "RdBu_r")
        high = float(truth.to_numpy().max()) if of_truth else limit
        drawing = axes.pcolormesh(
            values.columns, values.index, values, cmap=colour, vmin=low, vmax=high
        )
        drawn.colorbar(drawing, ax=axes, shrink=0.8)
        axes.set(title=title, xlabel="x on the flat sheet [mm]", aspect="equal")
    maps[0].set(ylabel="y on the flat sheet [mm]")
    return drawn


# %%
def main(folder: Path = OUT) -> dict[str, Any]:
    """Go round the loop; returns the diagnosis' report and result.json of each drape."""
    found = ff.diagnose(
        [ff.read_measurement(f) for f in measure(folder / "measured")], folder / "found"
    )
    for test, report in found.report["tests"].items():
        print(f"{test}: {report['headline']}")
        for term in report["discovered"]:
            print(f"  {term['name']}: {term['meaning']}: {term['formula']}")
    results = drapes(folder, found, folder / "found" / "fabric.yaml")
    print(table(folder, results))
    figure(folder, found).savefig(folder / PICTURE, dpi=120)
    return {"report": found.report, "drapes": results}


if __name__ == "__main__":
    main()
    if sys.argv[1:] == ["docs"]:
        shutil.copy(OUT / PICTURE, Path(__file__).parents[1] / "docs" / "images")
