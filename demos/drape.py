# %% [markdown]
# # Draping a plain weave over a hemisphere
#
# The experiment of Wei & Zhang, built from the parts of the package rather than from a case file:
# each part can be exchanged: the sheet, the section, the crossings, the tools and their motion.
#
# ```
# python demos/drape.py                # or: mpirun -n 2 python demos/drape.py
# fabric-fenicsx run demos/drape.yaml  # the same from a case file
# ```
#
# Units: N, mm, s, tonne. The quarter x >= 0, y >= 0 of the sheet is modelled.

# %%
from pathlib import Path

from mpi4py import MPI

import numpy as np

import fabric_fenicsx as ff

# %% [markdown]
# ## The fabric
#
# Stiffness and weight per width of fabric are those of the section in Table 3 for tows 12 mm apart,
# but for bending in the sheet's plane: tows are bundles of fibres that slide (`drape.yaml` has the
# reasons). The crossings' in-plane moment per area of fabric is m = k1 γ + k3 γ³ + β γ̇. The paper
# shows its curves in figures only: these numbers are assumed.

# %%
SPACING = 6.0
SECTION = ff.FabricSection(
    ff.RectangularSection(width=4.57, height=0.04, density=7e-9, C1=60000.0),
    width=SPACING,
    base_width=12.0,
    per_width=(None, None, None, None, 9.5),
)
AREA = SPACING**2
CROSSINGS = ff.CrossoverLaw(
    translation=100.0, k1=0.02 * AREA, k3=0.08 * AREA, dashpot=2.0 * AREA, alignment=1000.0
)

# %% [markdown]
# ## The tools
#
# Each is an analytic surface and a path: a function from time to the place of its reference point.
# The punch goes down 65 mm in 60 s; the holder closes in the first 6 s.

# %%
PUNCH_RADIUS, HOLE_RADIUS, EDGE_RADIUS = 76.2, 80.0, 10.0
SPEED = 65.0 / 60.0


def punch_path(time: float) -> tuple[float, float, float]:
    """Centre of the hemisphere: it touches the sheet at the start."""
    return 0.0, 0.0, PUNCH_RADIUS - SPEED * time


def holder_path(time: float) -> tuple[float, float, float]:
    """Face of the holder: from a gap of 1 mm to a slight overlap of the contact layers."""
    return 0.0, 0.0, 1.0 - 1.2 * min(time / 6.0, 1.0)


TOOLS = [
    ff.Sphere("punch", punch_path, PUNCH_RADIUS),
    ff.HoledPlate("die", lambda time: (0.0, 0.0, 0.0), HOLE_RADIUS, EDGE_RADIUS, side=1.0),
    ff.HoledPlate("holder", holder_path, HOLE_RADIUS, EDGE_RADIUS, side=-1.0),
]


# %% [markdown]
# ## The run


# %%
def main(folder: Path = Path("results/demo_drape"), duration: float = 60.0) -> dict[str, float]:
    """Drape for ``duration`` seconds (60 is the whole draw) and draw the result.

    Returns:
        Punch depth [mm], largest shear angle [degrees] and Newton iterations.
    """
    net = ff.mesh(ff.centred_sheet(288.0, 288.0, SPACING, SPACING, quarter=True))

    # On the plane x = 0 a node keeps its x and turns about x only; likewise for y = 0.
    on_x = np.flatnonzero(np.abs(net.points[:, 0]) < 1e-6)
    on_y = np.flatnonzero(np.abs(net.points[:, 1]) < 1e-6)
    planes = [ff.Support(on_x, (0, 4, 5)), ff.Support(on_y, (1, 3, 5))]

    model = ff.Model(
        net,
        SECTION,
        crossovers=CROSSINGS,
        gravity=(0.0, 0.0, -9810.0),
        inertia=ff.GeneralisedAlpha(radius=0.0),
        viscosity=1.0,
        tools=TOOLS,
        contact_law=ff.ContactLaw(stiffness=0.5, layer=0.5),
        supports=planes,
        symmetry=(0, 1),
    )
    run = ff.simulate(
        model,
        folder,
        test="drape",
        end=duration,
        control=ff.StepControl(first=0.1, smallest=1e-4, largest=3.0),
        quarter=True,
    )
    if run.last is None:
        raise SystemExit(run.stop)

    if MPI.COMM_WORLD.rank == 0:
        surfaces = [
            ff.RevolvedSurface(tool.name, tool.profile(180.0), np.array(tool.path(run.last.time)))
            for tool in TOOLS[:2]
        ]
        ff.draw_net(folder / "drape.png", net, run.last, surfaces=surfaces, mirror=True)
    return {
        "depth_mm": SPEED * run.last.time,
        "largest_shear_deg": float(np.degrees(np.abs(run.last.shear_angle).max())),
        "newton_iterations": run.summary["newton_iterations"],
    }


if __name__ == "__main__":
    numbers = main()
    if MPI.COMM_WORLD.rank == 0:
        print(numbers)
