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

from fabric_fenicsx.fabric.gmsh_io import read_msh, write_msh
from fabric_fenicsx.fabric.section import RectangularSection
from fabric_fenicsx.fabric.sheet import centred_sheet
from fabric_fenicsx.mechanics.tools import Mould
from fabric_fenicsx.output.folder import prepare_folder
from fabric_fenicsx.output.pictures import draw_net
from fabric_fenicsx.output.surfaces import TriangleSurface
from fabric_fenicsx.rigs.simulation import simulate
from fabric_fenicsx.solving.model import Model, Support
from fabric_fenicsx.solving.parts import ContactLaw, CrossoverLaw
from fabric_fenicsx.solving.stepping import GeneralisedAlpha, StepControl

MESHES = Path(__file__).parents[1] / "meshes"

# %% [markdown]
# ## The fabric
#
# As in `drape.py`, on tows 8 mm apart: two thirds of the section's width for each of them, and the
# same assumed moments per area.

# %%
SPACING = 8.0
SECTION = RectangularSection(width=3.05, height=0.04, density=7e-9, C1=60000.0)
AREA = SPACING**2
CROSSINGS = CrossoverLaw(
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


def moulds(shape: str) -> list[Mould]:
    """Punch, holder and die; the die is the holder's plate turned over."""
    plate = MESHES / f"{shape}_plate.stl"
    holder = Mould.from_stl("holder", holder_path, plate, cell=CELL)
    return [
        Mould.from_stl("punch", punch_path, MESHES / f"{shape}.stl", cell=CELL),
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
    comm = MPI.COMM_WORLD
    prepare_folder(folder, comm)
    mesh = folder / "sheet.msh"
    if comm.rank == 0:
        write_msh(centred_sheet(*SIZES[shape], SPACING, SPACING, quarter=True), mesh)
    comm.barrier()
    net = read_msh(mesh)

    # On the plane x = 0 a node keeps its x and turns about x only; likewise for y = 0.
    on_x = np.flatnonzero(np.abs(net.points[:, 0]) < 1e-6)
    on_y = np.flatnonzero(np.abs(net.points[:, 1]) < 1e-6)
    tools = moulds(shape)
    model = Model(
        net,
        SECTION,
        crossovers=CROSSINGS,
        gravity=(0.0, 0.0, -9810.0),
        inertia=GeneralisedAlpha(radius=0.0),
        viscosity=1.0,
        tools=tools,
        contact_law=ContactLaw(stiffness=0.5, layer=0.5),
        supports=[Support(on_x, (0, 4, 5)), Support(on_y, (1, 3, 5))],
        comm=comm,
    )
    run = simulate(
        model,
        folder,
        test=shape,
        end=duration,
        control=StepControl(first=0.1, smallest=1e-4, largest=3.0, largest_move=4.0),
        force_tolerance=1e-4,
        quarter=True,
    )
    if run.last is None:
        raise SystemExit(run.stop)

    if comm.rank == 0:
        colours = {"punch": "#8aa0b8", "holder": "#dfe3e8"}
        surfaces = [
            TriangleSurface(
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
        draw_net(folder / f"{shape}.png", net, run.last, surfaces=surfaces, mirror=True, radius=1.3)
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
