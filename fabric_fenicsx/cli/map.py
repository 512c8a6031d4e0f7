"""Fibre directions, thickness and fibre volume fraction on the shell elements of a part."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from .collective import say
from .results import Folder, Mirror, Time, listed, opened, writable

if TYPE_CHECKING:
    from ..inputs.shell_mesh import ShellMesh
    from ..output.shells import ShellFibres

__all__ = ["map"]

ENDINGS = (".inp", ".rad", ".vtu", ".csv")
SOLVERS = ("calculix", "abaqus")
CONSTANT = ("volume-fraction", "thickness")
Vector = tuple[float, float, float]

DENSEST = math.pi / (2.0 * math.sqrt(3.0))
"""Fibre volume fraction of round fibres side by side in hexagons; none is larger."""


def _option(name: str, metavar: str, text: str) -> Any:
    return typer.Option(name, metavar=metavar, help=text)


def map(
    folder: Folder,
    part: Annotated[
        Path,
        typer.Argument(
            metavar="MESH",
            help="Shell elements: an Abaqus or CalculiX deck (.inp), VTK, STL, any of meshio.",
        ),
    ],
    out: Annotated[
        list[Path],
        typer.Option(
            "--out",
            metavar="FILE",
            help=".inp (deck), .rad (OpenRadioss /DRAPE), .vtu or .csv. May be repeated.",
        ),
    ],
    thickness: Annotated[
        float | None, _option("--thickness", "MM", "Of the flat layer, for decks.")
    ] = None,
    volume_fraction: Annotated[
        float | None, _option("--volume-fraction", "V", "Of the fibres in the flat layer.")
    ] = None,
    areal_weight: Annotated[
        float | None,
        _option("--areal-weight", "G_PER_M2", "Of the flat fabric; gives V or MM, with density."),
    ] = None,
    fibre_density: Annotated[
        float | None, _option("--fibre-density", "G_PER_CM3", "Of the fibres.")
    ] = None,
    constant: Annotated[
        str,
        _option("--constant", "WHAT", "What shear leaves as it is: volume-fraction or thickness."),
    ] = "volume-fraction",
    share: Annotated[
        float | None,
        _option("--warp-share", "SHARE", "Of the fibres' volume; default: of the tows' length."),
    ] = None,
    layup: Annotated[
        str,
        _option("--plies", "WHAT", "warp-weft (two plies), symmetric (three), warp or bisector."),
    ] = "warp-weft",
    solver: Annotated[str, _option("--solver", "NAME", "Of an .inp: calculix or abaqus.")] = (
        "calculix"
    ),
    material: Annotated[
        str | None, _option("--material", "NAME", "Of a ply, as it is called in the deck.")
    ] = None,
    offset: Annotated[
        Vector, _option("--offset", "X Y Z", "Moves the part to its place among the tools, in mm.")
    ] = (0.0, 0.0, 0.0),
    turn: Annotated[
        Vector,
        _option("--rotate", "X Y Z", "Turns it before, about x, then y, then z, in degrees."),
    ] = (0.0, 0.0, 0.0),
    distance: Annotated[
        float, _option("--max-distance", "MM", "From an element to the fabric.")
    ] = 5.0,
    angle: Annotated[
        float, _option("--max-angle", "DEG", "Between an element's normal and the fabric's.")
    ] = 45.0,
    side: Annotated[
        str,
        _option("--side", "NAME", "Elements whose normals point to the fabric's front or back."),
    ] = "both",
    reference: Annotated[
        Vector, _option("--reference", "X Y Z", "Direction from which .rad counts angles.")
    ] = (1.0, 0.0, 0.0),
    time: Time = None,
    mirror: Mirror = None,
) -> None:
    """Carry fibre directions, thickness and volume fraction to the shell elements of a part.

    Elements that the fabric does not cover get no direction; how many they are is told.
    """
    from ..output.fibres import fibre_map
    from ..output.files import write_text, write_vtk
    from ..output.shell_files import LAYUPS, abaqus, calculix, drape, grid, plies, table
    from ..output.shells import SIDES, Placement, on_shells, warp_share
    from .shell_mesh import read_shell_mesh

    results, mirror, _ = opened(folder, mirror)
    for name, given, allowed in (
        ("--constant", constant, CONSTANT),
        ("--plies", layup, LAYUPS),
        ("--solver", solver, SOLVERS),
        ("--side", side, SIDES),
    ):
        listed(name, given, allowed)
    _within("--max-distance", distance, 0.0, math.inf)
    _within("--max-angle", angle, 0.0, 90.0)
    if not any(reference):
        raise InputError("--reference: 0 0 0, allowed is a direction")
    flat, fraction = _flat_layer(thickness, volume_fraction, areal_weight, fibre_density)
    decks = [path for path in out if path.suffix == ".inp"]
    if decks and (material is None or math.isnan(flat)):
        raise InputError(f"{decks[0]}: a deck needs --material and --thickness")
    if material is not None and (not material.strip() or set(material) & set(",*\n\r")):
        raise InputError(f"--material: {material!r}, allowed is a name without comma and asterisk")
    mesh = read_shell_mesh(part)
    net, snapshot, tools = results.at(results.nearest(time), mirror=mirror)
    share = warp_share(net) if share is None else share
    _within("--warp-share", share, 0.0, 1.0)
    angles = (math.radians(turn[0]), math.radians(turn[1]), math.radians(turn[2]))
    try:
        bare = on_shells(
            fibre_map(net, snapshot, tools),
            mesh,
            placement=Placement(angles, offset),
            distance=distance,
            angle=math.radians(angle),
            side=side,
        )
    except ValueError as error:
        raise InputError(f"{folder}: {error}") from None
    if not bare.covered.any():
        raise InputError(
            f"{part}: the fabric covers no element, the nearest is {bare.distance.min():.3g} mm"
            " away: allowed is --max-distance, --max-angle, --side, a place by --offset, --rotate"
        )
    fibres = bare.layer(flat, fraction, constant=constant, share=share)
    layers = plies(fibres, layup, share)
    texts: dict[Path, str] = {}
    for path in out:
        writable(path, ENDINGS)
        if path.exists() and part.samefile(path):
            raise InputError(f"{path}: is the part's own mesh, allowed is another file")
        try:
            if path.suffix == ".inp":
                write = abaqus if solver == "abaqus" else calculix
                texts[path] = write(mesh, fibres, layers, material or "")
            elif path.suffix == ".rad":
                factor = bare.layer(1.0, math.nan, constant=constant, share=share).thickness
                texts[path] = drape(mesh, fibres, factor, layers, reference)
            elif path.suffix == ".csv":
                texts[path] = table(mesh, fibres)
        except ValueError as error:
            raise InputError(f"{path}: {error}") from None
    for path in out:
        if path in texts:
            write_text(path, texts[path])
        else:
            write_vtk(path, grid(mesh, fibres), portable=True)
        print(path)
    _tell(mesh, fibres)


def _flat_layer(
    thickness: float | None,
    fraction: float | None,
    weight: float | None,
    density: float | None,
) -> tuple[float, float]:
    """Thickness [mm] and fibre volume fraction of the flat layer, nan where they are not given.

    Raises:
        InputError: one is no positive number, or they say more or less than both.
    """
    from ..output.shells import flat_fraction

    for name, value, most in (
        ("--thickness", thickness, math.inf),
        ("--volume-fraction", fraction, 1.0),
        ("--areal-weight", weight, math.inf),
        ("--fibre-density", density, math.inf),
    ):
        if value is not None:
            _within(name, value, 0.0, most)
    if (weight is None) != (density is None):
        raise InputError("--areal-weight: allowed is with --fibre-density, and it with that")
    if weight is not None and density is not None:
        if (thickness is None) == (fraction is None):
            raise InputError(
                "--areal-weight: allowed is with one of --thickness and --volume-fraction"
            )
        if thickness is None:
            # φ t is the same for every layer of this fabric.
            thickness = flat_fraction(weight, density, 1.0) / (fraction or 1.0)
        fraction = flat_fraction(weight, density, thickness)
        if fraction > 1.0:
            raise InputError(
                f"--areal-weight: more fibres than fit into the thickness, {fraction:.3g} of it"
            )
    return (
        math.nan if thickness is None else thickness,
        math.nan if fraction is None else fraction,
    )


def _within(name: str, value: float, above: float, most: float) -> None:
    if not above < value <= most or not math.isfinite(value):
        limit = "" if math.isinf(most) else f" and at most {most:g}"
        raise InputError(f"{name}: {value:g}, allowed is a number above {above:g}{limit}")


def _tell(mesh: ShellMesh, fibres: ShellFibres) -> None:
    """What the user should know of the elements."""
    bare = ~fibres.covered
    if bare.any():
        areas = mesh.areas
        say(
            f"{bare.sum()} of {len(bare)} elements ({bare.mean():.1%},"
            f" {areas[bare].sum() / areas.sum():.1%} of the area) are not covered by the fabric:"
            " they have no direction"
        )
    tight = int((fibres.fraction.sum(axis=1) > DENSEST).sum())
    if tight:
        say(
            f"{tight} elements have a fibre volume fraction above {DENSEST:.3f}, the largest that"
            " round fibres can have"
        )
