"""Tow meshes: the sheet, the file it makes, and what is read back from any file."""

import importlib.util
import os
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.gmsh_io import mesh_net, read_msh, write_msh
from fabric_fenicsx.fabric.net import WARP, WEFT
from fabric_fenicsx.fabric.paths import is_straight
from fabric_fenicsx.fabric.sheet import Sheet, centred_sheet, spaced_sheet

gmsh = pytest.importorskip("gmsh")

MESHES = Path(__file__).parent.parent / "meshes"
# Gmsh spaces the nodes of a divided line to about 1e-10 of its length.
GMSH_ROUNDING = 1e-8

SMALL = Sheet((0.0, 40.0), (0.0, 30.0), (10.0, 20.0, 30.0), (10.0, 20.0), subdivisions=2)
# Three points of a plus sign: a warp tow and a weft tow that share the node 1.
PLUS = np.array([[0, -1, 0], [0, 0, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 0]], dtype=float)
PLUS_GROUPS = {"warp": [[0, 1], [1, 2]], "weft": [[3, 1], [1, 4]], "tow_ends": [0, 2, 3, 4]}


def write_lines(path, points, groups, *, version=4.1, binary=0, orders=None):
    """Write a mesh of discrete entities, node by node and cell by cell as given."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        tags = np.arange(len(points)) + 1
        for tag, (name, cells) in enumerate(groups.items(), start=1):
            cells = np.asarray(cells)
            dim = 1 if cells.ndim == 2 else 0
            gmsh.model.addDiscreteEntity(dim, tag)
            group = gmsh.model.addPhysicalGroup(dim, [tag])
            gmsh.model.setPhysicalName(dim, group, name)
            if tag == 1:
                gmsh.model.mesh.addNodes(dim, tag, tags, np.asarray(points, dtype=float).ravel())
            if cells.size:
                kind = 15 if dim == 0 else {2: 1, 3: 8}[cells.shape[1]]
                gmsh.model.mesh.addElementsByType(tag, kind, [], cells.ravel() + 1)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


def as_groups(net):
    families = net.tow_family[net.cell_tow]
    return {
        "warp": net.cells[families == WARP],
        "weft": net.cells[families == WEFT],
        "tow_ends": net.ends.ravel(),
    }


def shuffled(points, groups, rng, *, one_node_per_crossing=()):
    """The same mesh with nodes and cells in another order and half of the cells turned round."""
    alias = np.arange(len(points))
    for warp, weft in one_node_per_crossing:
        alias[weft] = warp
    number = rng.permutation(len(points))
    turned = {}
    for name, cells in groups.items():
        cells = rng.permutation(number[alias[np.asarray(cells)]])
        if cells.ndim == 2:
            cells = np.where(rng.random(len(cells))[:, None] < 0.5, cells, cells[:, ::-1])
        turned[name] = cells
    moved = np.empty_like(points)
    moved[number] = points
    return moved, turned


def assert_same_net(net, wanted):
    for field in fields(wanted):
        np.testing.assert_allclose(
            getattr(net, field.name), getattr(wanted, field.name), rtol=0.0, atol=1e-12
        )


@pytest.fixture(scope="module")
def small_net(tmp_path_factory):
    path = tmp_path_factory.mktemp("mesh") / "small.msh"
    write_msh(SMALL, path)
    return read_msh(path)


# The sheet


def test_centred_sheet_has_tows_at_half_spacings():
    sheet = centred_sheet(48.0, 36.5, 12.0, 6.0)
    assert sheet.warp_positions == (-18.0, -6.0, 6.0, 18.0)
    assert sheet.weft_positions == (-15.0, -9.0, -3.0, 3.0, 9.0, 15.0)
    assert sheet.x_range == (-24.0, 24.0)
    assert sheet.y_range == (-18.25, 18.25)


def test_quarter_is_the_positive_part_of_the_whole():
    whole, quarter = (centred_sheet(48.0, 48.0, 12.0, 12.0, quarter=q) for q in (False, True))
    assert quarter.warp_positions == tuple(x for x in whole.warp_positions if x > 0.0)
    assert quarter.x_range == quarter.y_range == (0.0, 24.0)
    # Half a spacing to the symmetry plane and to the edge: half as many cells as between tows.
    assert quarter.divisions(WARP).tolist() == [1, 2, 1]


@pytest.mark.parametrize(("subdivisions", "end_cells"), [(1, 1), (2, 1), (3, 2), (4, 2), (8, 4)])
def test_both_end_pieces_keep_the_cell_size(subdivisions, end_cells):
    sheet = centred_sheet(0.6, 0.6, 0.1, 0.1, subdivisions=subdivisions)
    cells = sheet.divisions(WEFT).tolist()
    assert cells == [end_cells, *[subdivisions] * 5, end_cells]


def test_spaced_sheet_takes_as_many_tows_as_fit():
    sheet = spaced_sheet((0.0, 96.0), (0.0, 76.2), 12.0, 12.0)
    assert sheet.warp_positions == (6.0, 18.0, 30.0, 42.0, 54.0, 66.0, 78.0, 90.0)
    np.testing.assert_allclose(sheet.weft_positions, 38.1 + 12.0 * (np.arange(6) - 2.5))


def test_a_tow_within_rounding_of_the_edge_lies_on_it():
    sheet = Sheet((0.0, 0.3), (0.0, 1.0), (0.0, 0.1 * 3), (0.5,), subdivisions=2)
    assert sheet.warp_positions == (0.0, 0.3)
    assert sheet.stations(WEFT).tolist() == [0.0, 0.3]
    assert sheet.divisions(WARP).tolist() == [1, 1]


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: centred_sheet(-1.0, 48.0, 12.0, 12.0), "width is -1.0; a length above 0"),
        (lambda: centred_sheet(48.0, 48.0, 12.0, 0.0), "weft_spacing is 0.0; a length above 0"),
        (lambda: centred_sheet(48.0, 20.0, 12.0, 12.0), "weft_spacing is 12.0 mm; a length of 20"),
        (lambda: centred_sheet(48.0, 48.0, 12.0, 12.0, subdivisions=0), "subdivisions is 0"),
        (lambda: centred_sheet(48.0, 48.0, 12.0, 12.0, subdivisions=1.5), "not a whole number"),
        (lambda: spaced_sheet((0.0, 9.0), (0.0, 99.0), 12.0, 12.0), "x_range from 0.0 to 9.0"),
        (lambda: Sheet((0.0, 0.0), (0.0, 9.0), (1.0,), (1.0,)), "x_range goes from 0.0 to 0.0"),
        (lambda: Sheet((0.0, 9.0), (0.0, 9.0), (), (1.0,)), "warp_positions has no tows"),
        (lambda: Sheet((0.0, 9.0), (0.0, 9.0), (1.0,), (10.0,)), "weft_positions has a tow at 10"),
        (lambda: Sheet((0.0, 9.0), (0.0, 9.0), (2.0, 1.0), (1.0,)), "warp_positions must increase"),
        (lambda: Sheet((0.0, 9.0), (0.0, 9.0), (float("nan"),), (1.0,)), "a tow at nan"),
    ],
)
def test_a_sheet_that_cannot_be_says_why(make, text):
    with pytest.raises(ValueError, match=text.replace("(", r"\(")):
        make()


# Written and read


def test_counts_lengths_and_places(small_net):
    # 3 warp tows of 30 mm in 3 x 2 cells and 2 weft tows of 40 mm in 4 x 2 cells.
    net = small_net
    assert net.tow_family.tolist() == [WARP] * 3 + [WEFT] * 2
    assert np.bincount(net.cell_tow).tolist() == [6, 6, 6, 8, 8]
    assert len(net.points) == 3 * 7 + 2 * 9
    tow_lengths = np.bincount(net.cell_tow, weights=net.lengths)
    np.testing.assert_allclose(tow_lengths, [30.0] * 3 + [40.0] * 2, rtol=1e-12)
    np.testing.assert_allclose(net.lengths, 5.0, atol=GMSH_ROUNDING)
    np.testing.assert_allclose(
        net.points[net.ends],
        [
            *([[x, 0.0, 0.0], [x, 30.0, 0.0]] for x in (10.0, 20.0, 30.0)),
            *([[0.0, y, 0.0], [40.0, y, 0.0]] for y in (10.0, 20.0)),
        ],
        atol=1e-12,
    )


def test_round_trip_gives_every_node_of_the_sheet(small_net):
    warp = [[x, y, 0.0] for x in (10.0, 20.0, 30.0) for y in np.linspace(0.0, 30.0, 7)]
    weft = [[x, y, 0.0] for y in (10.0, 20.0) for x in np.linspace(0.0, 40.0, 9)]
    np.testing.assert_allclose(small_net.points, warp + weft, atol=GMSH_ROUNDING)


def test_each_tow_crosses_each_tow_of_the_other_family(small_net):
    net = small_net
    places = net.points[net.crossings]
    np.testing.assert_allclose(places[:, 0], places[:, 1], atol=1e-12)
    wanted = [[x, y, 0.0] for x in (10.0, 20.0, 30.0) for y in (10.0, 20.0)]
    np.testing.assert_allclose(places[:, 0], wanted, atol=1e-12)
    assert (net.node_family[net.crossings] == [WARP, WEFT]).all()


def test_a_flat_sheet_has_its_normal_upwards(small_net):
    assert (small_net.normals == [0.0, 0.0, 1.0]).all()


def test_tows_on_the_edge_cross_at_the_ends_of_the_others(tmp_path):
    edge = (0.0, 12.0, 24.0)
    write_msh(Sheet((0.0, 24.0), (0.0, 24.0), edge, edge), tmp_path / "edge.msh")
    net = read_msh(tmp_path / "edge.msh")
    assert len(net.crossings) == 9
    assert np.isin(net.ends, net.crossings).all()


# Any order, any format, any surface


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("shared", [False, True])
def test_order_in_the_file_does_not_matter(tmp_path, small_net, version, binary, shared):
    points, groups = shuffled(
        small_net.points,
        as_groups(small_net),
        np.random.default_rng(7),
        one_node_per_crossing=small_net.crossings if shared else (),
    )
    path = write_lines(tmp_path / "shuffled.msh", points, groups, version=version, binary=binary)
    assert_same_net(read_msh(path), small_net)


def test_a_shared_node_becomes_two(tmp_path):
    net = read_msh(write_lines(tmp_path / "plus.msh", PLUS, PLUS_GROUPS))
    assert len(net.points) == 6
    assert net.crossings.tolist() == [[1, 4]]
    np.testing.assert_array_equal(net.points[[1, 4]], 0.0)


def test_a_sheet_turned_in_its_plane_keeps_its_normal(tmp_path):
    for degrees in (30.0, 45.0, 60.0, 90.0, 135.0, 180.0):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        net = read_msh(write_lines(tmp_path / "turned.msh", PLUS @ turn.T, PLUS_GROUPS))
        np.testing.assert_allclose(net.normals, [[0.0, 0.0, 1.0]] * 4, atol=1e-12)


def test_normals_of_a_cylinder_are_radial(tmp_path, small_net):
    # Bend the sheet about an axis along y, radius 50 mm; weft cells become chords.
    radius = 50.0
    x, y, _ = small_net.points.T
    angle = (x - 20.0) / radius
    bent = np.column_stack([radius * np.sin(angle), y, radius * (np.cos(angle) - 1.0)])
    net = read_msh(write_lines(tmp_path / "bent.msh", bent, as_groups(small_net)))
    radial = (net.points[net.cells].mean(axis=1) - np.array([0.0, 0.0, -radius])) * [1.0, 0.0, 1.0]
    radial /= np.linalg.norm(radial, axis=1)[:, None]
    # Beyond the last crossing the normal is that crossing's: exact along the warp and, made
    # perpendicular to the cell, along a plane weft.
    np.testing.assert_allclose(net.normals, radial, atol=1e-7)
    assert net.normals[:, 0].min() < -0.1


# What is not a tow mesh


def bad_mesh(tmp_path, **changes):
    groups = {**PLUS_GROUPS, **changes}
    groups = {name: cells for name, cells in groups.items() if cells is not None}
    return write_lines(tmp_path / "bad.msh", PLUS, groups)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (
            {"weft": None},
            "group 'weft' of dimension 1 is missing (found: 'tow_ends' of dimension 0, 'warp' of "
            "dimension 1); a tow mesh has lines in 'warp' and 'weft' and points in 'tow_ends'",
        ),
        (
            {"warp": [0, 2]},
            "group 'warp' of dimension 1 is missing (found: 'tow_ends' of dimension 0, 'warp' of "
            "dimension 0, 'weft' of dimension 1); a tow mesh",
        ),
        ({"tow_ends": None}, "group 'tow_ends' of dimension 0 is missing"),
        ({"warp": [[0, 1, 2]]}, "group 'warp' has cells of type 'Line 3'; first-order cells"),
        (
            {"warp": [[0, 1], [1, 2], [1, 4]]},
            "group 'warp' branches at (0, 0, 0) mm, where 3 of its cells meet; a tow is a chain",
        ),
        ({"weft": [[3, 1], [1, 4], [4, 3]]}, "group 'weft' has a closed loop through ("),
        ({"weft": [[3, 3], [1, 4]]}, "group 'weft' has a cell of no length at (-1, 0, 0) mm"),
        ({"weft": [[3, 4]]}, "groups 'warp' and 'weft' do not cross"),
        (
            {"tow_ends": [0, 2, 3]},
            "group 'tow_ends' lacks the tow ends at (1, 0, 0) mm; the ends of all tows, 4 points",
        ),
        (
            {"tow_ends": [0, 1, 2, 3, 4]},
            "group 'tow_ends' has points that end no tow, at (0, 0, 0) mm; the ends of all tows",
        ),
        ({"weft": [[0, 1], [1, 2]]}, "warp and weft run along each other at (0, -1, 0) mm"),
    ],
)
def test_a_mesh_that_is_no_tow_mesh_says_why(tmp_path, capfd, changes, text):
    path = bad_mesh(tmp_path, **changes)
    assert_input_error(path, text, capfd)


def assert_input_error(path, text, capfd):
    capfd.readouterr()
    with pytest.raises(InputError) as caught:
        read_msh(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert text in message
    assert "\n" not in message
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("absent.msh", None, "no such file; a gmsh mesh file (.msh) is allowed"),
        ("empty.msh", b"", "not a gmsh mesh; a gmsh mesh file (.msh) is allowed"),
        ("script.msh", b'Printf("x");\n', "not a gmsh mesh"),
        ("mesh.txt", b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "not a gmsh mesh"),
        ("header.msh", b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "(found: none)"),
        ("version.msh", b"$MeshFormat\n99 0 8\n$EndMeshFormat\n", "Unknown MSH file version 99"),
        ("rubbish.msh", b"$MeshFormat\nfoo\n$Nodes\n1 2\n", "gmsh reports 'Error loading"),
    ],
)
def test_a_file_that_is_no_mesh_says_so(tmp_path, capfd, name, content, text):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    assert_input_error(tmp_path / name, text, capfd)


def test_a_folder_is_no_mesh(tmp_path, capfd):
    (tmp_path / "folder.msh").mkdir()
    assert_input_error(tmp_path / "folder.msh", "cannot be read (Is a directory)", capfd)


@pytest.mark.parametrize("part", [0.1, 0.25, 0.4, 0.6, 0.75, 0.9])
def test_a_torn_file_is_refused_and_the_next_one_read(tmp_path, capfd, small_net, part):
    path = tmp_path / "torn.msh"
    write_msh(SMALL, path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(part * len(whole))])
    assert_input_error(path, "", capfd)
    path.write_bytes(whole)
    assert_same_net(read_msh(path), small_net)


def test_a_group_without_cells_is_empty(tmp_path, capfd):
    path = write_lines(tmp_path / "bad.msh", PLUS, PLUS_GROUPS)
    # Take the two weft cells, entity 2 of dimension 1, out of the file.
    head, elements = path.read_text().split("$Elements\n")
    lines = elements.splitlines()
    at = next(i for i, line in enumerate(lines) if line.split() == ["1", "2", "1", "2"])
    blocks, cells, low, high = map(int, lines[0].split())
    lines[0] = f"{blocks - 1} {cells - 2} {low} {high}"
    del lines[at : at + 3]
    path.write_text(head + "$Elements\n" + "\n".join(lines) + "\n")
    assert_input_error(path, "group 'weft' is empty; a tow mesh has lines in", capfd)


def test_a_cell_with_an_unknown_node_is_refused(tmp_path, capfd):
    path = write_lines(tmp_path / "bad.msh", PLUS, PLUS_GROUPS)
    text = path.read_text()
    assert "\n1 1 2 \n" in text
    path.write_text(text.replace("\n1 1 2 \n", "\n1 1 99 \n"))
    assert_input_error(path, "gmsh reports 'Unknown node 99 in element", capfd)


def test_three_tows_at_a_crossing_are_refused(tmp_path, capfd):
    points = np.vstack([PLUS, [[-1, 1e-6, 0], [0, 1e-6, 0], [1, 1e-6, 0]]])
    groups = {
        "warp": PLUS_GROUPS["warp"],
        "weft": [*PLUS_GROUPS["weft"], [5, 6], [6, 7]],
        "tow_ends": [*PLUS_GROUPS["tow_ends"], 5, 7],
    }
    path = write_lines(tmp_path / "bad.msh", points, groups)
    assert_input_error(path, "more than two tows cross at (0, 0, 0) mm", capfd)


def test_a_curve_of_both_families_is_refused(tmp_path, capfd):
    path = tmp_path / "bad.msh"
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    ends = [gmsh.model.geo.addPoint(x, 0.0, 0.0) for x in (0.0, 1.0)]
    curve = gmsh.model.geo.addLine(*ends)
    gmsh.model.geo.synchronize()
    for name, dim, tags in (("warp", 1, [curve]), ("weft", 1, [curve]), ("tow_ends", 0, ends)):
        gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), name)
    gmsh.model.mesh.generate(1)
    gmsh.write(str(path))
    gmsh.finalize()
    assert_input_error(path, "groups 'warp' and 'weft' share 1 of their curves", capfd)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("mesh.vtk", "cannot be written; the ending .msh is allowed"),
        ("absent/mesh.msh", "cannot be written; a folder that exists is allowed"),
    ],
)
def test_a_mesh_that_cannot_be_written_says_why(tmp_path, name, text):
    with pytest.raises(InputError, match=text):
        write_msh(SMALL, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


# Manners


def test_gmsh_prints_nothing_and_leaves_ctrl_c_alone(tmp_path):
    # In a process of its own, for some gmsh take Ctrl-C when they are imported.
    script = f"""
import signal
handler = signal.getsignal(signal.SIGINT)
from fabric_fenicsx.fabric.gmsh_io import mesh_net, read_msh, write_msh
from fabric_fenicsx.fabric.sheet import centred_sheet
write_msh(centred_sheet(24.0, 24.0, 12.0, 12.0), {str(tmp_path / "small.msh")!r})
assert len(read_msh({str(tmp_path / "small.msh")!r}).crossings) == 4
assert signal.getsignal(signal.SIGINT) is handler
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


@pytest.mark.skipif(not hasattr(gmsh, "isInitialized"), reason="gmsh before 4.9 cannot tell")
def test_a_session_of_the_caller_goes_on(tmp_path):
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.model.add("mine")
        write_msh(SMALL, tmp_path / "small.msh")
        (tmp_path / "torn.msh").write_bytes(b"$MeshFormat\nfoo\n")
        with pytest.raises(InputError):
            read_msh(tmp_path / "torn.msh")
        assert len(read_msh(tmp_path / "small.msh").crossings) == 6
        assert gmsh.model.getCurrent() == "mine"
        assert gmsh.option.getNumber("Mesh.ElementOrder") == 2
    finally:
        gmsh.finalize()


# The meshes of the demos


@pytest.mark.parametrize(
    ("name", "tows", "cells", "length"),
    [
        # 12 + 12 tows of 144 mm in 1 + 11 x 2 + 1 cells.
        ("drape_12mm", (12, 12), 576, 24 * 144.0),
        # 8 + 8 tows of 96 mm in 1 + 7 x 2 + 1 cells.
        ("picture_frame_12mm", (8, 8), 256, 16 * 96.0),
        # 12 warp tows of 76.2 mm in 1 + 5 x 2 + 1 cells; 6 weft tows of 152.4 mm with ends of
        # 10.2 mm, 2 + 11 x 2 + 2 cells.
        ("cantilever_12mm", (12, 6), 12 * 12 + 6 * 26, 12 * 76.2 + 6 * 152.4),
    ],
)
def test_demo_mesh(tmp_path, name, tows, cells, length):
    net = read_msh(MESHES / f"{name}.msh")
    assert np.bincount(net.tow_family).tolist() == list(tows)
    assert len(net.cells) == cells
    assert len(net.crossings) == tows[0] * tows[1]
    np.testing.assert_allclose(net.lengths.sum(), length, rtol=1e-12)


def test_the_script_writes_the_demo_meshes(tmp_path):
    spec = importlib.util.spec_from_file_location("generate", MESHES / "generate.py")
    assert spec is not None and spec.loader is not None
    generate = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(generate)
    generate.main(tmp_path)
    names = sorted(os.listdir(tmp_path))
    assert names == sorted(path.name for path in MESHES.glob("*.msh"))
    for name in names:
        assert_same_net(read_msh(tmp_path / name), read_msh(MESHES / name))


def test_net_without_gmsh_is_the_one_that_gmsh_reads(tmp_path):
    """Straight tows are divided as gmsh would; stations beside crossings keep their places."""
    for sheet in (SMALL, centred_sheet(72.0, 50.0, 12.0, 8.0, subdivisions=3, quarter=True)):
        assert is_straight(sheet)
        write_msh(sheet, tmp_path / "sheet.msh")
        read, made = read_msh(tmp_path / "sheet.msh"), mesh_net(sheet)
        for field in fields(made):
            of_file, own = getattr(read, field.name), getattr(made, field.name)
            np.testing.assert_allclose(own, of_file, rtol=0.0, atol=GMSH_ROUNDING)


def test_straight_net_needs_no_gmsh(tmp_path):
    script = f"""
import sys
sys.modules["gmsh"] = None
from fabric_fenicsx.fabric.gmsh_io import mesh_net, write_msh
from fabric_fenicsx.fabric.sheet import centred_sheet
sheet = centred_sheet(24.0, 24.0, 12.0, 12.0)
print(len(mesh_net(sheet).crossings))
try:
    write_msh(sheet, {str(tmp_path / "sheet.msh")!r})
except Exception as error:
    print(type(error).__name__)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.split() == ["4", "InputError"], done.stderr
