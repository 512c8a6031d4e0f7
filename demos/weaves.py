# %% [markdown]
# # Weaves, braids and non-crimp fabrics
#
# A weave is a binary matrix that repeats: 1 where the warp tow lies on top. This demo draws the
# usual ones, a drawn one of one's own, braids, sheets cut along other outlines and a stitched
# fabric; all are tows that gmsh meshes, crimped by Bézier splines.
#
# ```
# python demos/weaves.py
# ```
#
# Lengths are in mm.

# %%
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

import matplotlib as mpl
import numpy as np

import fabric_fenicsx as ff

HERE = Path(__file__).parent

# %% [markdown]
# ## The fabrics
#
# Tows 10 mm apart whose axes are 1.7 mm apart where they cross. A braid is a weave at two slanted
# angles; warp and weft may differ in width and spacing; the stitched fabric has straight tows
# under threads. A sheet may be cut along a circle or along any polygon.

# %%
SPACING, CRIMP = 10.0, 1.7
SQUARE = ff.rectangle((-60.0, 60.0), (-60.0, 60.0))
HERRINGBONE = ff.pattern_from_file(HERE / "herringbone.txt")
# What a notch cuts loose falls out.
NOTCHED = ff.Polygon(((-65, -50), (65, -50), (65, 50), (22, 50), (0, 5), (-22, 50), (-65, 50)))


@dataclass(frozen=True)
class Fabric:
    """A fabric to draw; widths and thicknesses are those of warp and weft."""

    title: str
    pattern: ff.WeavePattern
    outline: ff.Outline = SQUARE
    angles: tuple[float, float] = (90.0, 0.0)
    spacings: tuple[float | tuple[float, ...], float | tuple[float, ...]] = (SPACING, SPACING)
    width: tuple[float, float] = (9.3, 9.3)
    thickness: tuple[float, float] = (1.6, 1.6)
    crimp: float = CRIMP

    def layout(self, subdivisions: int = 6) -> ff.TowLayout:
        """Its tows."""
        return ff.spaced_layout(
            self.outline,
            warp_angle=self.angles[0],
            weft_angle=self.angles[1],
            warp_spacing=self.spacings[0],
            weft_spacing=self.spacings[1],
            subdivisions=subdivisions,
            crimp=self.crimp,
            pattern=self.pattern,
        )


FABRICS = {
    "plain": Fabric("plain weave", ff.WEAVES["plain"]),
    "twill_2_2": Fabric("2/2 twill", ff.WEAVES["twill_2_2"]),
    "satin_5": Fabric("5-harness satin", ff.WEAVES["satin_5"]),
    "satin_8": Fabric(
        "8-harness satin", ff.WEAVES["satin_8"], ff.rectangle((-80.0, 80.0), (-80.0, 80.0))
    ),
    "basket_2": Fabric("2 × 2 basket", ff.WEAVES["basket_2"]),
    "herringbone": Fabric("herringbone, drawn in a text file", HERRINGBONE),
    "braid_30": Fabric("diamond braid at ±30°", ff.WEAVES["plain"], angles=(30.0, -30.0)),
    "braid_45": Fabric(
        "regular braid at ±45°, cut to a disc",
        ff.WEAVES["twill_2_2"],
        ff.Circle(65.0),
        angles=(45.0, -45.0),
    ),
    "notched": Fabric(
        "3/1 twill of unequal spacing, cut to a polygon",
        ff.WEAVES["twill_3_1"],
        NOTCHED,
        spacings=(SPACING, 6.0),
        width=(9.3, 5.4),
        thickness=(1.6, 1.2),
        crimp=1.5,
    ),
    "unidirectional": Fabric(
        "unidirectional, stitched",
        ff.WEAVES["unidirectional"],
        spacings=(SPACING, 20.0),
        width=(9.6, 0.7),
        thickness=(1.5, 0.5),
        crimp=1.05,
    ),
}


# %% [markdown]
# ## What the weave does in the model
#
# Two tows resist turning where they are locked in each other. This package takes, as an
# assumption of its own, the share of the four neighbouring crossings where the tow lies on the
# other side, and scales the in-plane spring, dashpot and friction of each crossing by it. A law
# m = k₁γ + k₃γ³ per area that holds for the plain weave then gives a fabric whose shear stiffness
# falls with the mean float length: half the sum of its inverses in warp and weft.


# %%
def net_of(fabric: Fabric, path: Path) -> ff.Net:
    """Mesh a fabric by gmsh and read the mesh."""
    ff.write_msh(fabric.layout(), path)
    return ff.read_msh(path, crossing_gap=fabric.crimp)


def numbers_of(fabric: Fabric, net: ff.Net) -> dict[str, float]:
    """What describes a fabric: floats, interlacing, crimp, angle between warp and weft."""
    weave = fabric.pattern
    over = weave.over(*ff.crossing_numbers(net))
    chords = net.points[net.ends[:, 1]] - net.points[net.ends[:, 0]]
    lengths = np.bincount(net.cell_tow, weights=net.lengths)
    plan = np.linalg.norm(chords[:, :2], axis=1)
    return {
        "crossings": len(net.crossings),
        "warp_on_top": float(over.mean()),
        "float_warp": weave.float_length[0],
        "float_weft": weave.float_length[1],
        "longest_float": max(weave.longest_float),
        "shear_stiffness": float(weave.interlacing(*ff.crossing_numbers(net)).mean()),
        "crimp_percent": 100.0 * float(lengths.sum() / plan.sum() - 1.0),
        "angle_deg": 90.0 - float(np.degrees(np.median(ff.reference_angle(net)))),
    }


def main(folder: Path = Path("results/weaves"), *, pictures: bool = True) -> dict[str, dict]:
    """Mesh and draw each fabric; returns the numbers of each. Rank 0 alone works."""
    if MPI.COMM_WORLD.rank:
        return {}
    folder.mkdir(parents=True, exist_ok=True)
    numbers = {}
    for name, fabric in FABRICS.items():
        net = net_of(fabric, folder / f"{name}.msh")
        numbers[name] = numbers_of(fabric, net)
        if pictures:
            ff.draw_weave(
                folder / f"{name}.png",
                net,
                width=fabric.width,
                thickness=fabric.thickness,
                title=fabric.title,
            )
    if pictures:
        draw_stiffness(folder / "stiffness.png", numbers)
    return numbers


def draw_stiffness(path: Path, numbers: dict[str, dict]) -> None:
    """Shear stiffness of the woven fabrics against their mean float length."""
    figure = mpl.figure.Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    floats = np.linspace(1.0, 5.0, 100)
    axes.plot(floats, 1.0 / floats, color="0.75", zorder=0, label="1 / mean float")
    seen: dict[tuple[float, float], list[str]] = {}
    for name, own in numbers.items():
        if np.isfinite(own["float_warp"]):
            weave = FABRICS[name].pattern
            at = (own["float_warp"], weave.mean_interlacing)
            seen.setdefault(at, []).append(name)
    for (x, y), names in seen.items():
        axes.plot(x, y, "o", color="#2f5d8a")
        axes.annotate(", ".join(names), (x, y), (6, 6), textcoords="offset points", fontsize=8)
    axes.set(
        xlabel="mean float length [crossings]",
        ylabel="in-plane stiffness, plain weave = 1",
        xlim=(0.8, 5.2),
        ylim=(0.0, 1.1),
    )
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    table = main()
    for title, row in table.items():
        print(f"{title:15}" + "  ".join(f"{key} {value:.4g}" for key, value in row.items()))
