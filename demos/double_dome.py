# %% [markdown]
# # Draping a plain weave over a double dome
#
# Tools of any shape come from STL files: here a punch of two domes and a plate with its outline as
# a hole, used as the holder below the sheet and, turned over, as the die above it. The punch rises
# from below. `meshes/make_moulds.py` writes the files.
#
# ```
# python demos/double_dome.py      # or: mpirun -n 2 python demos/double_dome.py
# python demos/double_dome.py box  # a box with rounded edges instead
# ```
#
# Units: N, mm, s, tonne. The quarter x >= 0, y >= 0 of the sheet is modelled.

# %%
import sys
from pathlib import Path

from mpi4py import MPI

import numpy as np

import fabric_fenicsx as ff

MESHES = Path(__file__).parents[1] / "meshes"

# %% [markdown]
# ## The fabric
#
# As in `drape.py`, on tows 8 mm apart: the same stiffness per width, the same assumed moments per
# area.

# %%
SPACING = 8.0
SECTION = ff.FabricSection(
    ff.RectangularSection(width=4.57, height=0.04, density=7e-9, C1=60000.0),
    width=SPACING,
    base_width=12.0,
    per_width=(None, None, None, None, 9.5),
)
AREA = SPACING**2
CROSSINGS = ff.CrossoverLaw(
    translation=100.0, k1=0.02 * AREA, k3=0.08 * AREA, dashpot=2.0 * AREA, alignment=450.0
)

# %% [markdown]
# ## The tools
#
# A mould's distance is sampled once on a grid, whose cell is the finest detail it can show. The
# punch rises 46 mm in 60 s; the holder closes the gap to the die in the first 6 s.

# %%
SIZES = {"double_dome": (288.0, 216.0), "box": (240.0, 240.0)}  # of the sheet, along x and y
RISE, DURATION = 46.0, 60.0
CELL = 2.5


def punch_path(time: float) -> tuple[float, float, float]:
    """Place of the punch's top: it touches the sheet at the start."""
    return 0.0, 0.0, RISE * time / DURATION


def holder_path(time: float) -> tuple[float, float, float]:
    """Face of the holder: from a gap of 1 mm to a slight overlap of the contact layers."""
    return 0.0, 0.0, -1.0 + 1.2 * min(time / 6.0, 1.0)


def moulds(shape: str) -> list[ff.Mould]:
    """Punch, holder and die; the die is the holder's plate turned over."""
    plate = MESHES / f"{shape}_plate.stl"
    holder = ff.Mould.from_stl("holder", holder_path, plate, cell=CELL)
    return [
        ff.Mould.from_stl("punch", punch_path, MESHES / f"{shape}.stl", cell=CELL),
        holder,
        holder.turned_over("die", lambda time: (0.0, 0.0, 0.0)),
    ]


# %% [markdown]
# ## The run


# %%
def main(
    folder: Path = Path("results/demo_double_dome"),
    duration: float = DURATION,
    shape: str = "double_dome",
) -> dict[str, float]:
    """Drape for ``duration`` seconds (60 is the whole draw) and draw the result.

    Args:
        folder: for the results.
        duration: end of the run [s].
        shape: "double_dome" or "box".

    Returns:
        Height of the punch and of the sheet [mm], largest shear angle [degrees], Newton iterations.
    """
    net = ff.mesh(ff.centred_sheet(*SIZES[shape], SPACING, SPACING, quarter=True))
    tools = moulds(shape)
    model = ff.Model(
        net,
        SECTION,
        crossovers=CROSSINGS,
        gravity=(0.0, 0.0, -9810.0),
        inertia=ff.GeneralisedAlpha(radius=0.0),
        viscosity=1.0,
        tools=tools,
        contact_law=ff.ContactLaw(stiffness=0.5, layer=0.5),
        supports=ff.symmetry_planes(net),
        symmetry=(0, 1),
    )
    run = ff.simulate(
        model,
        folder,
        test=shape,
        end=duration,
        control=ff.StepControl(first=0.1, smallest=1e-4, largest=3.0, largest_move=4.0),
        quarter=True,
    )
    if run.last is None:
        raise SystemExit(run.stop)

    if MPI.COMM_WORLD.rank == 0:
        colours = {"punch": "#8aa0b8", "holder": "#dfe3e8"}
        surfaces = [
            ff.TriangleSurface(
                tool.name,
                tool.surface.points,
                tool.surface.cells,
                np.array(tool.path(run.last.time)),
                colour=colours[tool.name],
                opacity=1.0,
            )
            for tool in tools
            if tool.name in colours
        ]
        ff.draw_net(
            folder / f"{shape}.png", net, run.last, surfaces=surfaces, mirror=True, radius=1.3
        )
    return {
        "punch_mm": punch_path(run.last.time)[2],
        "sheet_mm": float((net.points + run.last.displacement)[:, 2].max()),
        "largest_shear_deg": float(np.degrees(np.abs(run.last.shear_angle).max())),
        "newton_iterations": run.summary["newton_iterations"],
    }


if __name__ == "__main__":
    chosen = sys.argv[1] if sys.argv[1:] else "double_dome"
    numbers = main(Path(f"results/demo_{chosen}"), shape=chosen)
    if MPI.COMM_WORLD.rank == 0:
        print(numbers)
