"""Fibres on shell elements as files: table, VTK, decks of two solvers, /DRAPE of a third.

A sheared fabric is two unidirectional plies, one along the warp and one along the weft, each with
its share of the thickness; one ply along the warp or along the bisector can be had instead.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count

import numpy as np
import pandas as pd
import pyvista as pv

from fabric_fenicsx.inputs.deck import Deck, rows
from fabric_fenicsx.inputs.shell_mesh import NAMES, ShellMesh
from fabric_fenicsx.output.shells import ShellFibres

from ..arrays import Array

__all__ = ["LAYUPS", "Ply", "abaqus", "calculix", "drape", "grid", "plies", "table"]


LAYUPS = ("warp-weft", "symmetric", "warp", "bisector")
"""What a fabric is written as; `symmetric` has half of the warp on either side of the weft."""

PLIES_IN_CALCULIX = ("S6", "S8R")
"""Elements to which CalculiX gives more than one ply."""


@dataclass(frozen=True, slots=True, eq=False)
class Ply:
    """A unidirectional ply on n elements.

    Attributes:
        name: of the family that it is made of.
        share: of the layer's thickness.
        along: unit vectors along its fibres, shape (n, 3).
    """

    name: str
    share: float
    along: Array


def plies(fibres: ShellFibres, layup: str, share: float) -> list[Ply]:
    """The plies of a layer, in the order of the element's normal.

    Args:
        fibres: on the elements.
        layup: one of `LAYUPS`.
        share: of the warp in the volume of the fibres, and so in the thickness.
    """
    warp, weft = fibres.warp, fibres.weft
    if layup == "warp":
        return [Ply("WARP", 1.0, warp)]
    if layup == "bisector":
        middle = warp + weft
        return [Ply("BISECTOR", 1.0, middle / np.linalg.norm(middle, axis=1, keepdims=True))]
    between = Ply("WEFT", 1.0 - share, weft)
    if layup == "symmetric":
        return [Ply("WARP", share / 2.0, warp), between, Ply("WARP", share / 2.0, warp)]
    return [Ply("WARP", share, warp), between]


def table(mesh: ShellMesh, fibres: ShellFibres) -> str:
    """A row for each element; what the fabric does not cover has empty cells."""
    columns: dict[str, object] = {"element": mesh.numbers, "covered": fibres.covered.astype(int)}
    centres = mesh.centres
    columns |= {f"{axis}_mm": centres[:, i] for i, axis in enumerate("xyz")}
    for name in ("warp", "weft"):
        vectors = getattr(fibres, name)
        columns |= {f"{name}_{axis}": vectors[:, i] for i, axis in enumerate("xyz")}
    return pd.DataFrame(columns | _scalars(fibres)).to_csv(index=False, float_format="%.9g")


def grid(mesh: ShellMesh, fibres: ShellFibres) -> pv.UnstructuredGrid:
    """The mesh with the same data in its cells, nan where there is no fabric."""
    kinds = {3: pv.CellType.TRIANGLE, 4: pv.CellType.QUAD}
    kinds |= {6: pv.CellType.QUADRATIC_TRIANGLE, 8: pv.CellType.QUADRATIC_QUAD}
    sizes = mesh.sizes
    cells = np.column_stack([sizes, mesh.nodes]).ravel()
    types = np.array([kinds[size] for size in sizes.tolist()])
    made = pv.UnstructuredGrid(cells[cells >= 0], types, mesh.points)
    made.cell_data["element"] = mesh.numbers
    made.cell_data["covered"] = fibres.covered.astype(np.int64)
    made.cell_data["warp"], made.cell_data["weft"] = fibres.warp, fibres.weft
    for name, values in _scalars(fibres).items():
        made.cell_data[name] = values
    return made


def _scalars(fibres: ShellFibres) -> dict[str, Array]:
    return {
        "shear_deg": np.degrees(fibres.shear),
        "density_factor": fibres.density,
        "distance_mm": fibres.distance,
        "thickness_mm": fibres.thickness,
        "volume_fraction": fibres.fraction.sum(axis=1),
        "volume_fraction_warp": fibres.fraction[:, 0],
        "volume_fraction_weft": fibres.fraction[:, 1],
    }


def calculix(mesh: ShellMesh, fibres: ShellFibres, layers: list[Ply], material: str) -> str:
    """A deck with a section for each class of elements that have the same directions and thickness.

    Raises:
        ValueError: several plies on elements that CalculiX gives only one.
    """
    if len(layers) > 1:
        given = {mesh.types[k] for k in np.flatnonzero(fibres.covered)}
        others = sorted(given - set(PLIES_IN_CALCULIX))
        if others:
            raise ValueError(
                f"CalculiX has several plies in elements {' and '.join(PLIES_IN_CALCULIX)} only,"
                f" not in {', '.join(others)}: allowed is a mesh of second order, or one ply"
            )
    deck = mesh.deck or _deck(mesh, NAMES)
    prefix = _unused("FABRIC", deck)
    normals = mesh.normals
    classes: dict[tuple[str, ...], list[int]] = {}
    for k in np.flatnonzero(fibres.covered).tolist():
        directions = [_axes(ply.along[k], normals[k]) for ply in layers]
        thickness = [f"{ply.share * fibres.thickness[k]:.9g}" for ply in layers]
        classes.setdefault((*directions, *thickness), []).append(k)
    lines = []
    for number, (key, members) in enumerate(classes.items(), start=1):
        name = f"{prefix}_{number}"
        lines += [f"*ELSET, ELSET={name}", *rows(mesh.numbers[members].tolist())]
        # A ply that has the axes of another shares its orientation.
        axes_of = dict(zip([ply.name for ply in layers], key, strict=False))
        for ply_name, points in axes_of.items():
            lines += [f"*ORIENTATION, NAME={name}_{ply_name}", points, "3, 0."]
        thicknesses = key[len(layers) :]
        if len(layers) == 1:
            orientation = f"{name}_{layers[0].name}"
            options = f"ELSET={name}, MATERIAL={material}, ORIENTATION={orientation}"
            lines += [f"*SHELL SECTION, {options}", thicknesses[0]]
            continue
        lines.append(f"*SHELL SECTION, COMPOSITE, ELSET={name}")
        for ply, value in zip(layers, thicknesses, strict=True):
            lines.append(f"{value}, , {material}, {name}_{ply.name}")
    return deck.with_sections(_numbers(mesh, fibres), lines, [])


def abaqus(mesh: ShellMesh, fibres: ShellFibres, layers: list[Ply], material: str) -> str:
    """A deck with one section, whose axes, angles and thicknesses are distributions over elements.

    The section's own axes are along the first ply; the angle of any other is from there, about the
    element's normal.
    """
    deck = mesh.deck or _deck(mesh, NAMES | {6: "STRI65"})
    name = _unused("FABRIC", deck)
    rows_of = np.flatnonzero(fibres.covered).tolist()
    numbers, normals = mesh.numbers, mesh.normals
    kinds = {"AXES": "COORD3D, COORD3D", "ANGLE": "ANGLE", "LENGTH": "LENGTH"}
    model = []
    for kind, words in kinds.items():
        model += [f"*DISTRIBUTION TABLE, NAME={name}_{kind}", words]

    def distribution(of: str, kind: str, default: str, values: list[str]) -> list[str]:
        options = f"NAME={name}_{of}, LOCATION=ELEMENT, TABLE={name}_{kind}"
        data = [f"{numbers[k]}, {value}" for k, value in zip(rows_of, values, strict=True)]
        return [f"*DISTRIBUTION, {options}", f", {default}", *data]

    first = layers[0].along
    lines = [f"*ELSET, ELSET={name}", *rows(numbers[rows_of].tolist())]
    axes = [_axes(first[k], normals[k]) for k in rows_of]
    lines += distribution("FIRST_AXES", "AXES", "1., 0., 0., 0., 1., 0.", axes)
    lines += [f"*ORIENTATION, NAME={name}_FIRST", f"{name}_FIRST_AXES", "3, 0."]
    section = [f"*SHELL SECTION, ELSET={name}, COMPOSITE, ORIENTATION={name}_FIRST"]
    for number, ply in enumerate(layers, start=1):
        thickness = [f"{ply.share * fibres.thickness[k]:.9g}" for k in rows_of]
        lines += distribution(f"THICKNESS_{number}", "LENGTH", thickness[0], thickness)
        angle = "0."
        if ply.along is not first:
            angle = f"{name}_ANGLE_{number}"
            angles = np.degrees(_angle(first[rows_of], ply.along[rows_of], normals[rows_of]))
            values = [f"{value:.9g}" for value in angles]
            lines += distribution(f"ANGLE_{number}", "ANGLE", "0.", values)
        section.append(f"{name}_THICKNESS_{number}, 3, {material}, {angle}")
    return deck.with_sections(_numbers(mesh, fibres), [*lines, *section], model)


def drape(
    mesh: ShellMesh,
    fibres: ShellFibres,
    factor: Array,
    layers: list[Ply],
    reference: tuple[float, float, float],
) -> str:
    """A block /DRAPE for each ply; columns as OpenRadioss reads them, angles in degrees.

    An angle counts from the projection of the reference vector on the element, about its normal.

    Args:
        mesh: of the part.
        fibres: on its elements.
        factor: thickness of the layer over that of the flat one, shape (n,).
        layers: the plies.
        reference: VX, VY, VZ of the stack.

    Raises:
        ValueError: an element of second order, or the reference is across an element.
    """
    if (mesh.sizes > 4).any():
        raise ValueError("OpenRadioss has no shells of second order, allowed are S3 and S4")
    rows_of = np.flatnonzero(fibres.covered)
    normals = mesh.normals[rows_of]
    start = np.asarray(reference) - (normals @ reference)[:, None] * normals
    length = np.linalg.norm(start, axis=1)
    across = np.flatnonzero(length < 1e-3 * np.linalg.norm(reference))
    if len(across):
        element = mesh.numbers[rows_of[across[0]]]
        raise ValueError(f"the reference direction is across element {element}: allowed is another")
    vector = ", ".join(f"{value:g}" for value in reference)
    lines = [
        f"# angles from the vector ({vector}) of /STACK or /PROP projected on each element,",
        "# with def_orth = 2 and no other angle in /PLY; thinning multiplies the flat thickness",
    ]
    for number, ply in enumerate(layers, start=1):
        lines += [f"/DRAPE/{number}", f"fabric {ply.name.lower()}"]
        lines.append("#   Entity Entity_ID            Thinning         theta_drape")
        angles = np.degrees(_angle(start / length[:, None], ply.along[rows_of], normals))
        for k, angle in zip(rows_of.tolist(), angles.tolist(), strict=True):
            kind = "SH3N" if mesh.sizes[k] == 3 else "SHELL"
            lines.append(f"{kind:<10}{mesh.numbers[k]:>10}{factor[k]:>20.9f}{angle:>20.9f}")
    return "\n".join(lines) + "\n"


def _numbers(mesh: ShellMesh, fibres: ShellFibres) -> frozenset[int]:
    return frozenset(mesh.numbers[fibres.covered].tolist())


def _axes(along: Array, normal: Array) -> str:
    """Points a on the first axis and b on the second one, as both solvers read them."""
    values = np.round([*along, *np.cross(normal, along)], 9) + 0.0  # no minus before a zero
    return ", ".join(f"{value:.9f}" for value in values)


def _angle(start: Array, along: Array, normals: Array) -> Array:
    """From one line to another about the normals [rad], from -π/2 to below π/2."""
    sine = np.einsum("ij,ij->i", normals, np.cross(start, along))
    angle = np.arctan2(sine, np.einsum("ij,ij->i", start, along))
    return (angle + np.pi / 2.0) % np.pi - np.pi / 2.0


def _unused(name: str, deck: Deck) -> str:
    """A name that stands nowhere in the deck, with a number behind it where it must."""
    text = "\n".join(deck.lines).upper()
    names = (f"{name}{number or ''}" for number in count())
    return next(name for name in names if name not in text)


def _deck(mesh: ShellMesh, names: dict[int, str]) -> Deck:
    """A deck of a mesh that was none; names of the elements by their number of nodes."""
    used = np.unique(mesh.nodes[mesh.nodes >= 0])
    lines = ["*NODE, NSET=PART_NODES"]
    for k in used.tolist():
        lines.append(", ".join([str(mesh.point_numbers[k]), *map(repr, mesh.points[k].tolist())]))
    sizes = mesh.sizes
    for size, kind in names.items():
        for place, k in enumerate(np.flatnonzero(sizes == size).tolist()):
            if place == 0:
                lines.append(f"*ELEMENT, TYPE={kind}, ELSET=PART")
            nodes = mesh.point_numbers[mesh.nodes[k, :size]].tolist()
            lines.append(", ".join(map(str, [mesh.numbers[k], *nodes])))
    return Deck(lines, [], len(lines), len(lines))
