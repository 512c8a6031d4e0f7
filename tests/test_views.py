"""What is read back of a run and shown: the whole sheet, fibres, scenes, films, other formats."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import pyvista as pv
from test_output import NET, dome, square

from fabric_fenicsx.__main__ import main
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.axes import tow_axes
from fabric_fenicsx.fabric.crossings import crossing_numbers
from fabric_fenicsx.output.fibres import fibre_map
from fabric_fenicsx.output.files import write_npz
from fabric_fenicsx.output.film import encoder
from fabric_fenicsx.output.mirror import whole_sheet
from fabric_fenicsx.output.results import read_results, seen_arrays, write_setup
from fabric_fenicsx.output.surfaces import RevolvedSurface
from fabric_fenicsx.solving.snapshot import Snapshot, at_rest

QUARTER = square(0.0, 144.0, 24.0)
ANGLE = np.linspace(0.0, np.pi / 2.0, 46)
RADIUS = 60.0
PUNCH = RevolvedSurface(
    "punch", RADIUS * np.column_stack([np.sin(ANGLE), -np.cos(ANGLE)]), np.zeros(3)
)


def command(*arguments: object) -> int:
    """Exit code of the command line."""
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return int(ended.value.code or 0)


def state(net, time: float) -> Snapshot:
    """A hill that grows with time; directors along the bent tows."""
    flat = dome(net, time)
    share = time / 4.0
    displacement = share * flat.displacement
    return replace(
        flat,
        displacement=displacement,
        axes=tow_axes(net, displacement, symmetry=(0, 1) if net is QUARTER else ()),
        shear_angle=share * flat.shear_angle,
    )


def write_step(folder, number, snapshot, places):
    """What `view` and its like need of a step file."""
    (folder / "steps").mkdir(exist_ok=True)
    arrays = {"time": np.array(snapshot.time), "u": snapshot.displacement}
    arrays |= seen_arrays(snapshot, places)
    write_npz(folder / "steps" / f"step_{number:05d}.npz", arrays, compressed=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a run of five steps, as `run` leaves it."""
    path = tmp_path_factory.mktemp("rün mit Leerzeichen") / "результаты"
    path.mkdir()
    write_setup(path, QUARTER, [PUNCH])
    for number, time in enumerate((0.5, 1.0, 2.0, 3.0, 4.0), start=1):
        places = {"punch": np.array([0.0, 0.0, 100.0 - time])}
        write_step(path, number, state(QUARTER, time), places)
    (path / "case.yaml").write_text("test: drape\ntitle: hill </script>\n", encoding="utf-8")
    return path


def by_place(points):
    """Order of points by their coordinates."""
    return np.lexsort(np.round(points, 6).T)


def test_whole_sheet_is_the_sheet_of_which_the_quarter_is_one():
    """Compared crossing by crossing and node by node with the same hill on the whole sheet."""
    net, whole = whole_sheet(QUARTER, state(QUARTER, 3.0))
    same = state(NET, 3.0)
    assert len(net.tow_family) == len(NET.tow_family)
    assert (net.cells[:-1, 1] == net.cells[1:, 0])[np.diff(net.cell_tow) == 0].all()
    a = by_place(np.column_stack([net.points, net.node_family]))
    b = by_place(np.column_stack([NET.points, NET.node_family]))
    np.testing.assert_allclose(net.points[a], NET.points[b], atol=1e-12)
    np.testing.assert_allclose(whole.displacement[a], same.displacement[b], atol=1e-12)
    np.testing.assert_allclose(whole.directors[a], same.directors[b], atol=1e-12)
    a = by_place(net.points[net.crossings[:, 0]])
    b = by_place(NET.points[NET.crossings[:, 0]])
    # Shear changes its sign from quarter to quarter, as x y does.
    np.testing.assert_allclose(whole.shear_angle[a], same.shear_angle[b], atol=1e-12)
    np.testing.assert_allclose(whole.axes[a], same.axes[b], atol=1e-12)
    numbers, expected = np.column_stack(crossing_numbers(net)), crossing_numbers(NET)
    np.testing.assert_array_equal(numbers[a], np.column_stack(expected)[b])


def test_whole_sheet_reflects_resultants():
    """A tow across x = 0, bent alike on both sides, twisted against itself, pulled alike."""
    rest = at_rest(QUARTER)
    forces, moments = np.ones((len(QUARTER.cells), 3)), np.ones((len(QUARTER.cells), 3))
    net, whole = whole_sheet(QUARTER, replace(rest, section_forces=forces, section_moments=moments))
    middle = net.points[net.cells].mean(axis=1)
    along_x = np.abs(net.tangents[:, 0]) > 0.5
    left = along_x & (middle[:, 0] < 0.0) & (middle[:, 1] > 0.0)
    np.testing.assert_array_equal(whole.section_forces[left], [[1, -1, -1]] * left.sum())
    np.testing.assert_array_equal(whole.section_moments[left], [[-1, 1, 1]] * left.sum())
    right_below = along_x & (middle[:, 0] > 0.0) & (middle[:, 1] < -1.0)
    expected = [[-1, 1, -1]] * right_below.sum()
    np.testing.assert_array_equal(whole.section_moments[right_below], expected)
    # Each frame is right-handed.
    d1, d2, d3 = np.moveaxis(whole.directors, 1, 0)
    np.testing.assert_allclose(np.cross(d1, d2), d3, atol=1e-12)


def test_results_are_read_as_written(folder):
    results = read_results(folder)
    assert list(results.steps.values()) == [0.5, 1.0, 2.0, 3.0, 4.0]
    net, snapshot, (punch,) = results.at(results.nearest(1.9))
    np.testing.assert_array_equal(net.points, QUARTER.points)
    written = state(QUARTER, 2.0)
    np.testing.assert_allclose(snapshot.displacement, written.displacement, atol=1e-12)
    np.testing.assert_allclose(snapshot.shear_angle, written.shear_angle, atol=1e-12)
    np.testing.assert_array_equal(punch.place, [0.0, 0.0, 98.0])
    assert np.linalg.norm(punch.points, axis=1) == pytest.approx(RADIUS, rel=1e-6)
    between = list(results.frames(8))[3]  # t = 0.5 + 3 · 0.5 = 2
    np.testing.assert_allclose(between[1].displacement, written.displacement, atol=1e-12)
    late = list(results.frames(15))[9]  # t = 2.75, between two steps: the hill grows evenly
    np.testing.assert_allclose(late[1].displacement, state(QUARTER, 2.75).displacement, atol=1e-12)
    np.testing.assert_allclose(late[2][0].place, [0.0, 0.0, 97.25], atol=1e-12)


def sheared(gamma: float):
    """A sheet in pure shear: the warp turned by γ/2 and the weft by −γ/2, towards each other."""
    rest = at_rest(NET)
    warp = np.array([np.cos(gamma / 2.0), np.sin(gamma / 2.0), 0.0])
    weft = np.array([np.sin(gamma / 2.0), np.cos(gamma / 2.0), 0.0])
    x, y = NET.points[:, :1], NET.points[:, 1:2]
    up = np.array([0.0, 0.0, 1.0])
    directors = np.array([[v, np.cross(up, v), up] for v in (warp, weft)])[NET.node_family]
    displacement = x * warp + y * weft - NET.points
    return (
        replace(
            rest,
            displacement=displacement,
            directors=directors,
            axes=tow_axes(NET, displacement),
            shear_angle=np.full(len(NET.crossings), gamma),
        ),
        warp,
        weft,
    )


def test_fibres_of_a_sheared_sheet():
    """Fibres keep their length, so that their density rises as the area of the meshes falls."""
    gamma = np.radians(40.0)
    snapshot, warp, weft = sheared(gamma)
    table = fibre_map(NET, snapshot)
    count = len(NET.crossings)
    np.testing.assert_allclose(table.warp, np.tile(warp, (count, 1)), atol=1e-12)
    np.testing.assert_allclose(table.weft, np.tile(weft, (count, 1)), atol=1e-12)
    np.testing.assert_allclose(table.normal, np.tile([0.0, 0.0, 1.0], (count, 1)), atol=1e-12)
    np.testing.assert_allclose(table.density, 1.0 / np.cos(gamma), rtol=1e-12)
    corners = table.place[table.quads]
    assert len(corners) == 12 * 12
    area = np.linalg.norm(
        np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1
    )
    np.testing.assert_allclose(area / 2.0, 24.0**2 / table.density[0], rtol=1e-12)
    assert set(table.mould) == {""} and not table.moved.any()


def test_fibres_lie_on_the_mould_that_presses():
    """Crossings pressed 0.3 mm into a ball come onto it, those that are free stay."""
    gamma = np.radians(10.0)
    snapshot, _, _ = sheared(gamma)
    place = (NET.points + snapshot.displacement) * [1.0, 1.0, 0.0]
    r = np.hypot(*place.T[:2])
    near = r < 0.7 * RADIUS
    place[near, 2] = -np.sqrt((RADIUS - 0.3) ** 2 - r[near] ** 2)
    snapshot = replace(
        snapshot, displacement=place - NET.points, contact_pressure=near.astype(float)
    )
    (ball,) = read_tools(PUNCH)
    table = fibre_map(NET, snapshot, [ball])
    touched = np.array([name == "punch" for name in table.mould])
    np.testing.assert_array_equal(touched, near[NET.crossings[:, 0]])
    assert 9 <= touched.sum() < len(touched)
    # The triangles of the picture, 2° wide, lie up to R (1 − cos 1°) = 0.009 mm inside the ball.
    distance = np.linalg.norm(table.place[touched], axis=1)
    assert np.abs(distance - RADIUS).max() < 0.02
    assert np.abs(table.moved[touched] - 0.3).max() < 0.02
    outwards = table.place[touched] / distance[:, None]
    for vectors in (table.warp, table.weft):
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, rtol=1e-12)
        # Tangents of those triangles: 1° off at most across them, as much along.
        assert np.abs(np.einsum("ij,ij->i", vectors[touched], outwards)).max() < 0.025
    assert not table.moved[~touched].any()


def read_tools(*surfaces):
    """Tools as a run keeps them."""
    import tempfile

    with tempfile.TemporaryDirectory() as path:
        write_setup(Path(path), QUARTER, surfaces)
        write_step(Path(path), 1, at_rest(QUARTER), {})
        return read_results(Path(path)).tools


def test_fibres_command(folder, tmp_path):
    assert command("fibres", folder) == 0
    table = pd.read_csv(folder / "fibres.csv")
    assert len(table) == 13 * 13  # the whole sheet, by the case's symmetry
    vectors = table[["warp_x", "warp_y", "warp_z"]].to_numpy()
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, rtol=1e-7)
    at = table[["x0_mm", "y0_mm"]].to_numpy()
    expected = np.abs(40.0 * at[:, 0] * at[:, 1] / 144.0**2)
    np.testing.assert_allclose(np.abs(table["shear_deg"]), expected, atol=1e-6)
    surface = pv.read(folder / "fibres.vtp")
    assert surface.n_cells == 12 * 12
    np.testing.assert_allclose(surface["density_factor"], table["density_factor"], rtol=1e-6)
    path = tmp_path / "quarter.csv"
    assert command("fibres", folder, "--no-mirror", "--time", 1, "--out", path) == 0
    assert len(pd.read_csv(path)) == 7 * 7


def test_scene_holds_the_run_and_needs_no_network(folder):
    assert command("view", folder, "--html") == 0
    text = (folder / "scene.html").read_text(encoding="utf-8")
    assert "http" not in text and "src=" not in text and "@" not in re.sub(r"@media", "", text)
    assert "hill &lt;/script&gt;" in text
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.S)[1])
    assert len(data["frames"]) == 5 and data["colours"][0]["title"].startswith("shear")
    raw = np.frombuffer(base64.b64decode(data["frames"][-1]["points"]), "<u2").reshape(-1, 3)
    points = np.array(data["low"]) + raw / 65535.0 * np.array(data["extent"])
    net, snapshot, _ = read_results(folder).at(5, mirror=True)
    expected = net.points + snapshot.displacement  # nodes rise along the tows
    assert np.abs(points - expected).max() < 0.005
    assert data["tows"][-1] == len(net.points)
    assert data["frames"][-1]["places"] == [[0.0, 0.0, 96.0]]
    values = np.frombuffer(base64.b64decode(data["colours"][0]["frames"][-1]), "<u2")
    top = float(data["colours"][0]["labels"][-1][1])
    largest = np.degrees(np.abs(snapshot.shear_angle)).max()
    assert values.max() / 65534 * top == pytest.approx(largest, abs=0.01)


def test_pictures_and_films(folder, tmp_path):
    assert command("view", folder, "--colour", "displacement", "--view", "top") == 0
    assert (folder / "view.png").stat().st_size > 10_000
    film = tmp_path / "new" / "film.gif"
    assert command("animate", folder, "--frames", 3, "--width", 160, "--out", film) == 0
    from PIL import Image

    with Image.open(film) as opened:
        assert (opened.n_frames, opened.size) == (3, (160, 120))
    assert [path.name for path in film.parent.iterdir()] == ["film.gif"]


def test_an_mp4_without_ffmpeg_says_what_brings_it(monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match="pip install imageio-ffmpeg"):
        encoder(Path("a.mp4"))


def test_export_goes_through_meshio(folder, tmp_path):
    meshio = pytest.importorskip("meshio")
    path = tmp_path / "net.vtk"
    assert command("export", folder, path, "--no-mirror") == 0
    mesh = meshio.read(path)
    expected = QUARTER.points + state(QUARTER, 4.0).displacement
    np.testing.assert_allclose(mesh.points, expected, atol=1e-9)
    np.testing.assert_array_equal(mesh.cells_dict["line"], QUARTER.cells)
    assert "displacement" in mesh.point_data


BAD = {
    "no folder": (["view", "{}/nothing"], "net.npz: no such file, allowed is the folder of a run"),
    "no such colour": (["view", "{}", "--colour", "red"], "--colour: red, allowed is shear_angle"),
    "no such view": (["animate", "{}", "--view", "below"], "--view: below, allowed is perspective"),
    "no such tool": (["view", "{}", "--hide", "lid"], "--hide: lid, allowed is punch"),
    "no screen": (["view", "{}", "--window"], "--window: there is no screen"),
    "ending": (["view", "{}", "--out", "a.xyz"], "a.xyz: allowed is a file with the ending .png"),
    "film": (["animate", "{}", "--out", "a.avi"], "allowed is a file with the ending .gif or .mp4"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line(folder, capsys, monkeypatch, name):
    arguments, expected = BAD[name]
    for display in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(display, raising=False)
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    assert command(*(argument.format(folder) for argument in arguments)) == 2
    printed = capsys.readouterr()
    assert expected in printed.err and len(printed.err.splitlines()) == 1
    assert printed.out == ""
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_a_screen_that_does_not_answer_is_one_line(folder, capfd, monkeypatch):
    """VTK would draw into a window that nobody sees and end well."""
    monkeypatch.setenv("DISPLAY", ":987")
    assert command("view", folder, "--window") == 2
    printed = capfd.readouterr()
    assert printed.err == (
        "a window: the screen that DISPLAY names cannot be reached, allowed is a saved picture\n"
    )
    assert printed.out == ""


@pytest.mark.parametrize("part", ["net.npz", "steps/step_00005.npz", "steps/step_00002.npz"])
@pytest.mark.parametrize("cut", [0.0, 0.6])
def test_a_file_cut_short_is_one_line(folder, tmp_path, capfd, part, cut):
    import shutil

    broken = tmp_path / "broken"
    shutil.copytree(folder, broken)
    path = broken / part
    whole = path.read_bytes()
    path.write_bytes(whole[: int(cut * len(whole))])
    assert command("view", broken, "--out", tmp_path / "a.png") == 2
    printed = capfd.readouterr().err
    assert len(printed.splitlines()) == 1 and str(broken) in printed
    assert not (tmp_path / "a.png").exists()
