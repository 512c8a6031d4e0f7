"""Fibres on the shell elements of a part, against closed forms; decks run by CalculiX.

A translation surface x(u, v) = p(u) + q(v) of two curves by their arc lengths is a Chebyshev net:
tows along p′ and q′ keep their length, and sin γ = p′ · q′.
"""

from __future__ import annotations

import base64
import struct
import zlib
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
import pyvista as pv
from solve import orders
from test_output import NET, square
from test_views import command, sheared, write_step

from fabric_fenicsx.fabric.net import Net, single_tow
from fabric_fenicsx.inputs.deck import read_deck
from fabric_fenicsx.inputs.shell_mesh import ShellMesh, padded
from fabric_fenicsx.output.fibres import FibreMap, fibre_map
from fabric_fenicsx.output.results import write_setup
from fabric_fenicsx.output.shells import Placement, on_shells, warp_share
from fabric_fenicsx.solving.snapshot import Snapshot, at_rest

GAMMA = np.radians(40.0)

RADIUS = 70.0

KINDS = {"S3": 3, "S4": 4, "S6": 6, "S8R": 8}


def strip(kind: str, length: float, width: float, n: int, m: int):
    """Points (p, 2) and elements (n, k), from 1, of a strip in n by m elements or pairs of them."""
    size = KINDS[kind]
    step = 1 if size < 5 else 2
    across = m * step + 1
    x, y = np.meshgrid(
        np.linspace(0.0, length, n * step + 1), np.linspace(0.0, width, across), indexing="ij"
    )

    def at(i, j):
        return i * across + j + 1

    elements = []
    for i in range(0, n * step, step):
        for j in range(0, m * step, step):
            square_ = [(i, j), (i + step, j), (i + step, j + step), (i, j + step)]
            faces = [square_] if size in (4, 8) else [square_[:3], [square_[0], *square_[2:]]]
            for face in faces:
                sides = zip(face, [*face[1:], face[0]], strict=True)
                middles = [((a + c) // 2, (b + d) // 2) for (a, b), (c, d) in sides]
                elements.append([at(*p) for p in (face if step == 1 else face + middles)])
    return np.column_stack([x.ravel(), y.ravel()]), np.array(elements)


def mesh_of(kind: str, places, elements) -> ShellMesh:
    count = len(elements)
    return ShellMesh(
        np.asarray(places, dtype=float),
        np.arange(1, len(places) + 1),
        padded([np.asarray(elements, dtype=np.int64) - 1]),
        np.arange(1, count + 1),
        [kind] * count,
    )


def flat_mesh(kind: str, *, z: float = 0.0, side: float = 40.0) -> ShellMesh:
    """A square about the origin."""
    points, elements = strip(kind, 2.0 * side, 2.0 * side, 3, 4)
    return mesh_of(kind, np.column_stack([points - side, np.full(len(points), z)]), elements)


def translation_surface(u, v):
    """Place, warp and weft of the surface of two circles."""
    zero = np.zeros_like(u)
    place = [RADIUS * np.sin(u / RADIUS), RADIUS * np.sin(v / RADIUS)]
    place.append(RADIUS * (2.0 - np.cos(u / RADIUS) - np.cos(v / RADIUS)))
    warp = np.stack([np.cos(u / RADIUS), zero, np.sin(u / RADIUS)], axis=-1)
    weft = np.stack([zero, np.cos(v / RADIUS), np.sin(v / RADIUS)], axis=-1)
    return np.stack(place, axis=-1), warp, weft


def curved(spacing: float) -> FibreMap:
    """The fibres of the net on the surface."""
    return fibre_map(*on_surface(spacing))


def on_surface(spacing: float) -> tuple[Net, Snapshot]:
    """The net on the surface."""
    net = square(-60.0, 60.0, spacing)
    place, warp, weft = translation_surface(*net.points.T[:2])
    up = np.cross(warp, weft)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    along = np.where((net.node_family == net.node_family[0])[:, None], warp, weft)
    directors = np.stack([along, np.cross(up, along), up], axis=1)
    shear = np.arcsin(np.einsum("ij,ij->i", warp, weft))[net.crossings[:, 0]]
    axes = along[net.crossings]
    rest = at_rest(net)
    bent = replace(
        rest,
        displacement=place - net.points,
        directors=directors,
        shear_angle=shear,
        axes=axes,
    )
    return net, bent


@pytest.mark.parametrize("kind", KINDS)
def test_uniform_shear_is_the_same_in_every_element(kind):
    """Exact, on the fabric's other side and on elements that look the other way too."""
    snapshot, warp, weft = sheared(GAMMA)
    mesh = flat_mesh(kind, z=-0.3)
    back = replace(mesh, nodes=flipped(mesh))
    for one in (mesh, back):
        fibres = on_shells(fibre_map(NET, snapshot), one)
        count = len(one.numbers)
        assert fibres.covered.all()
        np.testing.assert_allclose(fibres.distance, 0.3, rtol=1e-12)
        np.testing.assert_allclose(fibres.warp, np.tile(warp, (count, 1)), atol=1e-12)
        np.testing.assert_allclose(fibres.weft, np.tile(weft, (count, 1)), atol=1e-12)
        np.testing.assert_allclose(fibres.shear, GAMMA, rtol=1e-12)
    # Two thirds of the fibres are warp. The product of thickness and fraction is the areal volume.
    thick = fibres.layer(0.3, 0.5, constant="volume-fraction", share=2 / 3)
    np.testing.assert_allclose(thick.thickness, 0.3 / np.cos(GAMMA), rtol=1e-12)
    np.testing.assert_allclose(thick.fraction, [[0.5 * 2 / 3, 0.5 / 3]] * count, rtol=1e-12)
    dense = fibres.layer(0.3, 0.5, constant="thickness", share=2 / 3)
    np.testing.assert_allclose(dense.thickness, 0.3, rtol=1e-12)
    np.testing.assert_allclose(dense.fraction.sum(axis=1), 0.5 / np.cos(GAMMA), rtol=1e-12)
    assert warp_share(NET) == pytest.approx(0.5, rel=1e-12)


def test_the_angle_between_the_fibres_stays_where_an_element_is_tilted():
    """By 40 degrees about x: so are warp and weft, whatever the element's corners say."""
    snapshot, warp, weft = sheared(GAMMA)
    tilt = Placement((np.radians(40.0), 0.0, 0.0)).rotation
    mesh = flat_mesh("S4", side=4.0)
    fibres = on_shells(fibre_map(NET, snapshot), replace(mesh, points=mesh.points @ tilt.T))
    assert fibres.covered.all()
    for found, expected in ((fibres.warp, tilt @ warp), (fibres.weft, tilt @ weft)):
        np.testing.assert_allclose(found, np.tile(expected, (len(found), 1)), atol=1e-12)


def flipped(mesh: ShellMesh):
    """Nodes in the other sense of rotation."""
    size = int(mesh.sizes[0])
    half = size // 2 if size > 4 else size
    corners = mesh.nodes[:, :half][:, ::-1]
    # From the last corner back: the side before a corner comes after it.
    middles = np.roll(mesh.nodes[:, half:size][:, ::-1], -1, axis=1) if size > 4 else None
    return padded([corners if middles is None else np.hstack([corners, middles])])


def test_directions_on_a_curved_surface_converge_with_the_square_of_the_size():
    errors = []
    for n in (5, 10, 20):
        fabric = curved(120.0 / n)
        # Elements across the meshes of the fabric, turned by 30 degrees.
        points, elements = strip("S4", 50.0, 40.0, n, n)
        points = (points - [25.0, 20.0]) @ np.array([[0.75**0.5, 0.5], [-0.5, 0.75**0.5]]) + 20.0
        mesh = mesh_of("S4", translation_surface(*points.T)[0], elements)
        fibres = on_shells(fabric, mesh)
        assert fibres.covered.all()
        middles = points[elements - 1].mean(axis=1)
        _, warp, weft = translation_surface(*middles.T)
        shear = np.arcsin(np.einsum("ij,ij->i", warp, weft))
        assert np.degrees(np.abs(shear).max()) > 13.0
        wrong = [
            *(fibres.warp - warp).T,
            *(fibres.weft - weft).T,
            fibres.shear - shear,
            fibres.density - 1.0 / np.cos(shear),
            fibres.distance / RADIUS,
            # The angle between what is written is the shear angle.
            np.einsum("ij,ij->i", fibres.warp, fibres.weft) - np.sin(shear),
        ]
        errors.append(np.sqrt(np.mean(np.square(wrong), axis=1)))
        for vectors in (fibres.warp, fibres.weft):
            np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, rtol=1e-12)
            np.testing.assert_allclose(
                np.einsum("ij,ij->i", vectors, mesh.normals), 0.0, atol=1e-12
            )
    assert np.max(errors[-1]) < 5e-3
    assert orders(errors).min() > 1.8, errors


def test_a_part_in_coordinates_of_its_own_gets_the_same_fibres():
    """The part is moved and turned away, and brought back by its placement."""
    fabric = curved(12.0)
    points, elements = strip("S8R", 60.0, 50.0, 6, 5)
    places = translation_surface(*(points - 25.0).T)[0]
    there = Placement((0.3, -1.1, 2.0), (30.0, -400.0, 7.0))
    turn = there.rotation
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    # About x first, about z last: R x = Rz (Ry (Rx x)).
    quarter = Placement((np.pi / 2, 0.0, np.pi / 2)).rotation
    np.testing.assert_allclose(quarter @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(quarter @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    expected = on_shells(fabric, mesh_of("S8R", places, elements))
    own = (places - np.array(there.offset)) @ turn
    found = on_shells(fabric, mesh_of("S8R", own, elements), placement=there)
    # Fabric and part turned together: nothing but the directions turns with them.
    moved = replace(
        fabric,
        place=(fabric.place - np.array(there.offset)) @ turn,
        **{name: getattr(fabric, name) @ turn for name in ("warp", "weft", "normal")},
    )
    together = on_shells(moved, mesh_of("S8R", own, elements))
    for other in (found, together):
        np.testing.assert_array_equal(other.covered, expected.covered)
        np.testing.assert_allclose(other.warp, expected.warp @ turn, atol=1e-9)
        np.testing.assert_allclose(other.weft, expected.weft @ turn, atol=1e-9)
        for name in ("distance", "shear", "density"):
            np.testing.assert_allclose(
                getattr(other, name), getattr(expected, name), rtol=1e-9, atol=1e-9
            )


def test_what_the_fabric_does_not_cover_gets_no_direction():
    fabric = fibre_map(NET, at_rest(NET))  # from -144 to 144
    points, elements = strip("S4", 400.0, 40.0, 40, 4)
    flat = np.column_stack([points, np.zeros(len(points))])
    mesh = mesh_of("S4", flat, elements)
    inside = mesh.centres[:, 0] < 144.0
    fibres = on_shells(fabric, mesh, distance=1000.0)
    np.testing.assert_array_equal(fibres.covered, inside)
    for values in (fibres.warp, fibres.weft, fibres.shear, fibres.density):
        assert np.isnan(values[~inside]).all() and np.isfinite(values[inside]).all()
    lifted = mesh_of("S4", flat + np.array([0.0, 0.0, 5.5]), elements)
    assert not on_shells(fabric, lifted).covered.any()
    np.testing.assert_array_equal(on_shells(fabric, lifted, distance=5.6).covered, inside)
    # Steep walls that stand on the fabric.
    for degrees, seen in ((44.0, True), (46.0, False)):
        slope = np.radians(degrees)
        turn = Placement((slope, 0.0, 0.0))
        steep = on_shells(fabric, mesh, placement=turn, distance=100.0)
        assert steep.covered.any() == seen
    front, back = (on_shells(fabric, mesh, side=side).covered for side in ("front", "back"))
    np.testing.assert_array_equal(front, inside)
    assert not back.any()


def run_folder(path: Path, net: Net, snapshot: Snapshot) -> Path:
    """The folder of a run that ended so."""
    path.mkdir(exist_ok=True)
    write_setup(path, net)
    write_step(path, 1, snapshot, {})
    return path


@pytest.fixture(scope="module")
def unsheared(tmp_path_factory):
    return run_folder(tmp_path_factory.mktemp("a run at rest"), NET, at_rest(NET))


MESSY = """*Heading
** a part with two kinds of elements, a set by numbers, one by sets, and an included file
*NODE, nset=all, input=nodes of the part.inc
*Element, type=S4R, elset=Skin
1, 1, 2, 5,
4
2, 2,3,6,5
*ELEMENT, TYPE=S3, ELSET=\"the rim\"
 7, 4,5,8
 8,
 5,6,8
*ELEMENT, TYPE=T3D2, ELSET=BARS
20, 1, 2
*ELSET, ELSET=EVERY, GENERATE
1, 2, 1
*Elset, elset=EVERY
the RIM,
*INCLUDE, INPUT=material.inc
*Shell Section, elset=EVERY, material=UD
0.7
*SOLID SECTION, ELSET=BARS, MATERIAL=UD
1.
*STEP
*STATIC
*BOUNDARY
1, 1, 6
*CLOAD
8, 1, 1.
*END STEP
"""


@pytest.fixture
def messy(tmp_path):
    path = tmp_path / "messy.inp"
    path.write_text(MESSY)
    nodes = [(0, 0), (90, 0), (180, 0), (0, 90), (90, 90), (180, 90), (999, 999), (90, 180)]
    lines = [f"{k}, {x}, {y}" for k, (x, y) in enumerate(nodes, start=1)]
    (tmp_path / "nodes of the part.inc").write_text("\n".join(lines) + "\n")
    (tmp_path / "material.inc").write_text("*MATERIAL, NAME=UD\n*ELASTIC\n1., 0.3\n")
    return path


def test_a_deck_keeps_what_is_not_of_the_fabric(unsheared, messy, capsys):
    """One of four elements is covered; the others keep the section that they had."""
    mesh = read_deck(messy)
    np.testing.assert_array_equal(mesh.numbers, [1, 2, 7, 8])
    assert mesh.types == ["S4R", "S4R", "S3", "S3"]
    np.testing.assert_array_equal(mesh.sizes, [4, 4, 3, 3])
    np.testing.assert_allclose(mesh.areas, [8100.0, 8100.0, 4050.0, 4050.0])
    out = messy.with_name("mapped.inp")
    options = ["--material", "UD", "--thickness", 0.25, "--plies", "bisector", "--out", out]
    assert command("map", unsheared, messy, *options) == 0
    assert capsys.readouterr().err == ""
    assert command("map", unsheared, messy, *options, "--offset", 90, 0, 0) == 0
    error = capsys.readouterr().err
    assert error.startswith("3 of 4 elements (75.0%, 66.7% of the area) are not covered")
    text = out.read_text()
    again = read_deck(out)
    np.testing.assert_array_equal(again.points, mesh.points)
    np.testing.assert_array_equal(again.nodes, mesh.nodes)
    old, new = again.deck.sections
    assert (new.name, new.elements) == ("FABRIC_1", {1})
    assert (old.name, old.elements) == ("EVERY_UNCOVERED", {2, 7, 8})
    for kept in ("*ELEMENT, TYPE=T3D2, ELSET=BARS", "*SOLID SECTION", "*CLOAD", "** a part"):
        assert kept in text
    assert "INCLUDE" not in text and "INPUT" not in text.upper()
    # Mapped once more, to other elements: no name is used twice.
    twice = messy.with_name("twice.inp")
    options[-1] = twice
    assert command("map", unsheared, out, *options, "--offset", -144, 0, 0) == 0
    third = read_deck(twice)
    names = [section.name for section in third.deck.sections]
    assert names == ["FABRIC1_1"] and third.deck.sections[0].elements == {1, 2, 7, 8}


def pv_mesh(mesh: ShellMesh) -> pv.UnstructuredGrid:
    kinds = {3: 5, 4: 9, 6: 22, 8: 23}
    size = int(mesh.sizes[0])
    cells = np.insert(mesh.nodes[:, :size], 0, size, axis=1).ravel()
    return pv.UnstructuredGrid(cells, np.full(len(mesh.nodes), kinds[size]), mesh.points)


def decoded(path):
    """Arrays of a .vtu by their names: base64 of blocks packed by zlib, read without VTK."""
    root = ET.parse(path).getroot()
    assert root.get("header_type") == "UInt32" and root.get("compressor") == "vtkZLibDataCompressor"
    types = {"Float64": "<f8", "Float32": "<f4", "Int64": "<i8", "UInt8": "u1"}
    found = {}
    for array in root.iter("DataArray"):
        text = "".join(array.text.split())
        (blocks,) = struct.unpack("<I", base64.b64decode(text[:8])[:4])
        head = 4 * (3 + blocks)
        cut = -(-head // 3) * 4
        sizes = struct.unpack(f"<{3 + blocks}I", base64.b64decode(text[:cut])[:head])[3:]
        packed, raw, start = base64.b64decode(text[cut:]), b"", 0
        for size in sizes:
            raw += zlib.decompress(packed[start : start + size])
            start += size
        width = int(array.get("NumberOfComponents") or 1)
        values = np.frombuffer(raw, types[array.get("type")])
        found[array.get("Name")] = values.reshape(-1, width) if width > 1 else values
    return found


def test_table_and_vtk_hold_the_same(tmp_path, capsys):
    """Weight and density of the fibres give the fraction, 600 / (1000 · 2.5 · 0.5) = 0.48."""
    folder = run_folder(tmp_path / "run", NET, sheared(GAMMA)[0])
    mesh = flat_mesh("S8R", side=150.0)  # beyond the fabric
    part = tmp_path / "part.vtu"
    pv_mesh(mesh).save(part)
    outs = [tmp_path / "a.csv", tmp_path / "a.vtu"]
    options = ["--areal-weight", 600, "--fibre-density", 2.5, "--thickness", 0.5]
    options += ["--constant", "thickness", "--warp-share", 0.6]
    files = [word for out in outs for word in ("--out", out)]
    assert command("map", folder, part, *options, *files) == 0
    printed = capsys.readouterr()
    assert printed.out.split() == [str(out) for out in outs]
    table = pd.read_csv(outs[0])
    covered = table["covered"] == 1
    assert 0 < (~covered).sum() < covered.sum()
    assert printed.err.startswith(f"{(~covered).sum()} of {len(mesh.numbers)} elements")
    assert table[["warp_x", "shear_deg", "thickness_mm"]][~covered].isna().all(axis=None)
    fraction = table["volume_fraction"][covered]
    np.testing.assert_allclose(fraction, 0.48 / np.cos(GAMMA), rtol=1e-8)
    np.testing.assert_allclose(table["volume_fraction_warp"][covered], 0.6 * fraction, rtol=1e-8)
    np.testing.assert_allclose(table["shear_deg"][covered], 40.0, rtol=1e-8)
    arrays = decoded(outs[1])
    np.testing.assert_allclose(arrays["Points"], mesh.points, atol=1e-12)
    np.testing.assert_array_equal(arrays["connectivity"].reshape(-1, 8), mesh.nodes)
    np.testing.assert_array_equal(arrays["types"], 23)
    for name in ("shear_deg", "thickness_mm", "volume_fraction_weft", "distance_mm"):
        np.testing.assert_allclose(arrays[name], table[name], rtol=1e-8, atol=1e-9)
    warp = table[["warp_x", "warp_y", "warp_z"]]
    np.testing.assert_allclose(arrays["warp"], warp, atol=1e-8)
    try:
        import meshio
    except ImportError:
        return
    read = meshio.read(outs[1])
    np.testing.assert_allclose(read.cell_data["weft"][0], arrays["weft"])


def test_meshes_of_several_kinds_are_read(unsheared, tmp_path):
    """STL and a mix of cells with lines among them, which are no shells."""
    corners = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]])
    pv.PolyData(corners, faces=[3, 0, 1, 2, 3, 0, 2, 3]).save(tmp_path / "a.stl")
    cells = [2, 0, 1, 4, 0, 1, 2, 3, 3, 0, 1, 2]
    pv.UnstructuredGrid(cells, [3, 9, 5], corners).save(tmp_path / "b.vtk")
    for name, areas in (("a.stl", [50.0, 50.0]), ("b.vtk", [100.0, 50.0])):
        out = tmp_path / "out.vtu"
        assert command("map", unsheared, tmp_path / name, "--out", out) == 0
        made = pv.read(out)
        np.testing.assert_allclose(made.compute_cell_sizes()["Area"], areas)
        assert made["covered"].all()
        np.testing.assert_array_equal(made["element"], [1, 2])


def test_a_net_without_crossings_is_one_line(tmp_path, capsys):
    points = np.column_stack([np.arange(5.0), np.zeros((5, 2))])
    tow = single_tow(points, (0.0, 0.0, 1.0))
    run = run_folder(tmp_path / "run", tow, at_rest(tow))
    pv_mesh(flat_mesh("S4")).save(tmp_path / "part.vtu")
    assert command("map", run, tmp_path / "part.vtu", "--out", tmp_path / "a.csv") == 2
    error = capsys.readouterr().err
    assert error == f"{run}: the fabric has no meshes between its crossings\n"


GOOD = ["map", "{run}", "{dir}/part.inp"]

OUT = ["--out", "{dir}/out.csv"]

DECK = ["--out", "{dir}/out.inp"]

BAD = {
    "no mesh": (
        ["map", "{run}", "{dir}/none.vtu", *OUT],
        "none.vtu: no such file, allowed is a mesh",
    ),
    "no deck": (
        ["map", "{run}", "{dir}/none.inp", *OUT],
        "none.inp: no such file, allowed is a deck",
    ),
    "format": (["map", "{run}", "{dir}/part.xyz", *OUT], "part.xyz: "),
    "broken": (["map", "{run}", "{dir}/broken.vtu", *OUT], "broken.vtu: "),
    "lines": (["map", "{run}", "{dir}/lines.vtk", *OUT], "lines.vtk: no shell elements, allowed"),
    "solids": (["map", "{run}", "{dir}/solids.inp", *OUT], "solids.inp: no shell elements"),
    "no node": (["map", "{run}", "{dir}/lost.inp", *OUT], "line 3: element 7: there is no node 9"),
    "no data": (["map", "{run}", "{dir}/empty.inp", *OUT], "empty.inp: no shell elements"),
    "huge": (["map", "{run}", "{dir}/huge.inp", *OUT], "allowed is a number up to 999999999"),
    "circle": (["map", "{run}", "{dir}/circle.inp", *OUT], "files that include one another"),
    "short": (["map", "{run}", "{dir}/short.inp", *OUT], "S3 have a number and 3 nodes"),
    "far": (
        [*GOOD, *OUT, "--offset", "0", "0", "700"],
        "the fabric covers no element, the nearest is 700",
    ),
    "ending": ([*GOOD, "--out", "{dir}/a.xyz"], "a.xyz: allowed is a file with the ending"),
    "itself": (
        [
            *GOOD,
            "--out",
            "{dir}/part.inp",
            "--material",
            "UD",
            "--thickness",
            "1",
            "--plies",
            "warp",
        ],
        "is the part's own mesh",
    ),
    "thin": (
        [*GOOD, *OUT, "--thickness", "-0.1"],
        "--thickness: -0.1, allowed is a number above 0",
    ),
    "nan": ([*GOOD, *OUT, "--thickness", "nan"], "--thickness: nan, allowed is a number above 0"),
    "full": (
        [*GOOD, *OUT, "--volume-fraction", "1.2"],
        "allowed is a number above 0 and at most 1",
    ),
    "heavy": (
        [*GOOD, *OUT, "--areal-weight", "900", "--fibre-density", "1", "--thickness", "0.5"],
        "more fibres than fit",
    ),
    "weight": (
        [*GOOD, *OUT, "--areal-weight", "900"],
        "--areal-weight: allowed is with --fibre-density",
    ),
    "all": (
        [
            *GOOD,
            *OUT,
            "--areal-weight",
            "300",
            "--fibre-density",
            "2",
            "--thickness",
            "0.5",
            "--volume-fraction",
            "0.3",
        ],
        "allowed is with one of",
    ),
    "no name": (
        [*GOOD, *DECK, "--thickness", "1"],
        "out.inp: a deck needs --material and --thickness",
    ),
    "a comma": (
        [*GOOD, *DECK, "--thickness", "1", "--material", "a,b"],
        "--material: 'a,b', allowed is",
    ),
    "plies in S3": (
        [*GOOD, *DECK, "--thickness", "1", "--material", "UD"],
        "not in S3: allowed is a mesh of second order, or one ply",
    ),
    "solver": (
        [*GOOD, *OUT, "--solver", "nastran"],
        "--solver: nastran, allowed is calculix or abaqus",
    ),
    "plies": ([*GOOD, *OUT, "--plies", "four"], "--plies: four, allowed is warp-weft"),
    "constant": ([*GOOD, *OUT, "--constant", "all"], "--constant: all, allowed is volume-fraction"),
    "side": ([*GOOD, *OUT, "--side", "left"], "--side: left, allowed is both, front or back"),
    "share": ([*GOOD, *OUT, "--warp-share", "1.5"], "--warp-share: 1.5, allowed is"),
    "distance": ([*GOOD, *OUT, "--max-distance", "0"], "--max-distance: 0, allowed is"),
    "angle": ([*GOOD, *OUT, "--max-angle", "120"], "--max-angle: 120, allowed is"),
    "no direction": ([*GOOD, *OUT, "--reference", "0", "0", "0"], "--reference: 0 0 0, allowed is"),
    "across": ([*GOOD, "--out", "{dir}/o.rad", "--reference", "0", "0", "1"], "across element 1"),
    "second order": (
        ["map", "{run}", "{dir}/six.inp", "--out", "{dir}/o.rad"],
        "no shells of second order",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line_and_writes_nothing(unsheared, tmp_path, capfd, name):
    head = "*NODE\n1, 0., 0., 0.\n2, 9., 0., 0.\n3, 0., 9., 0.\n4, 0., 0., 9.\n"
    mesh = pv.UnstructuredGrid([2, 0, 1], [3], np.eye(3))
    mesh.save(tmp_path / "lines.vtk")
    files = {
        "part.inp": head + "*ELEMENT, TYPE=S3\n1, 1, 2, 3\n",
        "solids.inp": head + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n",
        "lost.inp": "*ELEMENT, TYPE=S3\n6, 1, 2, 3\n7, 1, 2, 9\n" + head,
        "empty.inp": head + "*ELEMENT, TYPE=S3\n",
        "huge.inp": head + "*ELEMENT, TYPE=S3\n1, 1, 2, 99999999999999999999\n",
        "short.inp": head + "*ELEMENT, TYPE=S3\n1, 1, 2\n",
        "circle.inp": "*INCLUDE, INPUT=circle.inp\n",
        "six.inp": head
        + "5, 4., 0.\n6, 4., 4.\n7, 0., 4.\n*ELEMENT, TYPE=S6\n1, 1, 2, 3, 5, 6, 7\n",
        "broken.vtu": "<VTKFile type='UnstructuredGrid'><Piece",
        "part.xyz": "1 2 3",
        "out.csv": "there before",
        "out.inp": "there before",
    }
    for file, text in files.items():
        (tmp_path / file).write_text(text)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    arguments, expected = BAD[name]
    assert command(*(word.format(run=unsheared, dir=tmp_path) for word in arguments)) == 2
    printed = capfd.readouterr()
    assert expected in printed.err and len(printed.err.splitlines()) == 1, printed.err
    assert printed.out == ""
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
