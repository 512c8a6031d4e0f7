"""ParaView series read back as written, survive a kill and resume; pictures show the data."""

from __future__ import annotations

import os
import resource
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from matplotlib import colormaps
from matplotlib.colors import to_rgb

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.net import WARP, WEFT, Net, single_tow
from fabric_fenicsx.output import files
from fabric_fenicsx.output.canvas import canvas
from fabric_fenicsx.output.colours import colour_table, rgb
from fabric_fenicsx.output.lines import COLOURS, arc_length
from fabric_fenicsx.output.paraview import TimeSeries
from fabric_fenicsx.output.pictures import VIEWS, _stations, aim, draw_net
from fabric_fenicsx.output.polydata import poly_data
from fabric_fenicsx.output.surfaces import RevolvedSurface, triangles
from fabric_fenicsx.output.vtk_xml import packed, xml_file
from fabric_fenicsx.solving.snapshot import Snapshot, at_rest

ARRAYS = [field.name for field in fields(Snapshot) if field.name != "time"]
SMALL = (320, 240)


def square(low: float, high: float, spacing: float = 12.0) -> Net:
    """A flat sheet of tows along x (warp) and y (weft), a crossing at every node."""
    at = np.arange(low, high + 1e-9, spacing)
    n = len(at)
    points = np.zeros((2, n, n, 3))  # family, tow, place along it
    points[0, :, :, 0], points[0, :, :, 1] = at[None, :], at[:, None]
    points[1, :, :, 1], points[1, :, :, 0] = at[None, :], at[:, None]
    number = np.arange(2 * n * n).reshape(2, n, n)
    cells = np.stack([number[..., :-1], number[..., 1:]], axis=-1).reshape(-1, 2)
    return Net(
        points=points.reshape(-1, 3),
        cells=cells,
        cell_tow=np.repeat(np.arange(2 * n), n - 1),
        tow_family=np.repeat([WARP, WEFT], n),
        crossings=np.column_stack([number[0].ravel(), number[1].T.ravel()]),
        ends=np.column_stack([number[..., 0].ravel(), number[..., -1].ravel()]),
        normals=np.tile([0.0, 0.0, 1.0], (len(cells), 1)),
    )


def dome(net: Net, time: float = 1.0) -> Snapshot:
    """The sheet pushed into a smooth hill, its corners sheared."""
    state = at_rest(net, time)
    x, y = net.points[:, 0], net.points[:, 1]
    state.displacement[:, 2] = 60.0 * np.exp(-(x**2 + y**2) / 60.0**2)
    at = net.points[net.crossings[:, 0]]
    return replace(state, shear_angle=np.radians(40.0) * at[:, 0] * at[:, 1] / 144.0**2)


def noise(net: Net, time: float) -> Snapshot:
    """A snapshot with another number in every place."""
    seeded = np.random.default_rng(7)
    rest = at_rest(net, time)
    return replace(rest, **{n: seeded.normal(size=getattr(rest, n).shape) for n in ARRAYS})


NET = square(-144.0, 144.0, 24.0)


def test_hand_made_sheet_joins_warp_and_weft_at_one_place() -> None:
    places = NET.points[NET.crossings]
    np.testing.assert_array_equal(places[:, 0], places[:, 1])
    assert (NET.node_family[NET.crossings] == [WARP, WEFT]).all()


def test_at_rest_directors_follow_the_tows() -> None:
    d1, d2, d3 = np.moveaxis(at_rest(NET).directors, 1, 0)
    weft = NET.node_family == WEFT
    np.testing.assert_allclose(d1[~weft], np.tile([1.0, 0.0, 0.0], (np.sum(~weft), 1)))
    np.testing.assert_allclose(d2[weft], np.tile([-1.0, 0.0, 0.0], (np.sum(weft), 1)))
    np.testing.assert_allclose(d3, np.tile([0.0, 0.0, 1.0], (len(d3), 1)))


@pytest.mark.parametrize("name", ARRAYS)
def test_wrong_shape_names_the_array(name: str, tmp_path: Path) -> None:
    good = at_rest(NET)
    with pytest.raises(ValueError, match=r"snapshot: \w+ has shape"):
        replace(good, **{name: getattr(good, name)[..., None]})
    other = at_rest(square(0.0, 48.0))  # fits itself, not the net
    with pytest.raises(ValueError, match="snapshot: displacement has shape"):
        TimeSeries(tmp_path, NET).add(other)
    if name not in ("displacement", "section_forces", "shear_angle"):  # these set the counts
        with pytest.raises(ValueError, match=f"snapshot: {name} has shape"):
            replace(good, **{name: getattr(good, name)[1:]})


def test_time_must_be_a_number() -> None:
    with pytest.raises(ValueError, match="time is nan"):
        at_rest(NET, float("nan"))


def test_series_reads_back_as_written(tmp_path: Path) -> None:
    series = TimeSeries(tmp_path / "new" / "folder", NET)
    times = [0.0, 0.1, 1.0 / 3.0]
    for time in times[:-1]:
        series.add(at_rest(NET, time))
    state = noise(NET, times[-1])
    series.add(state)
    assert series.times == times

    folder = tmp_path / "new" / "folder"
    names = {f"{kind}_{i:05d}.vtu" for kind in ("tows", "crossings") for i in range(3)}
    assert {p.name for p in folder.iterdir()} == names | {"tows.pvd", "crossings.pvd"}

    reader = pv.PVDReader(folder / "tows.pvd")
    assert reader.time_values == times
    reader.set_active_time_value(times[-1])
    tows = reader.read()[0]
    np.testing.assert_array_equal(tows.points, NET.points)
    np.testing.assert_array_equal(tows.cell_connectivity.reshape(-1, 2), NET.cells)
    assert set(tows.celltypes) == {pv.CellType.LINE}
    at_points = {
        "displacement": state.displacement,
        "d1": state.directors[:, 0],
        "d2": state.directors[:, 1],
        "d3": state.directors[:, 2],
        "contact_pressure": state.contact_pressure,
    }
    in_cells = {
        "section_forces": state.section_forces,
        "section_moments": state.section_moments,
        "tow": NET.cell_tow,
        "family": NET.tow_family[NET.cell_tow],
    }
    for data, expected in ((tows.point_data, at_points), (tows.cell_data, in_cells)):
        assert set(data.keys()) == set(expected)
        for name, values in expected.items():
            np.testing.assert_array_equal(data[name], values, err_msg=name)
    assert tows.GetCellData().GetArray("section_moments").GetComponentName(1) == "M2"
    assert tows.field_data["TimeValue"][0] == times[-1]

    reader = pv.PVDReader(folder / "crossings.pvd")
    reader.set_active_time_value(times[-1])
    crossings = reader.read()[0]
    np.testing.assert_array_equal(crossings.points, NET.points[NET.crossings[:, 0]])
    assert set(crossings.celltypes) == {pv.CellType.VERTEX}
    assert crossings.n_cells == len(NET.crossings)
    warp, weft = state.displacement[NET.crossings[:, 0]], state.displacement[NET.crossings[:, 1]]
    shear = state.shear_angle * 180.0 / np.pi
    np.testing.assert_allclose(crossings["displacement"], (warp + weft) / 2.0, rtol=1e-14)
    np.testing.assert_allclose(crossings["shear_angle_deg"], shear, rtol=1e-14)
    np.testing.assert_allclose(crossings["angle_deg"], 90.0 - shear, atol=1e-12)
    np.testing.assert_array_equal(crossings["moment"], state.crossing_moment)


def test_net_without_crossings_writes_tows_alone(tmp_path: Path) -> None:
    tow = single_tow(np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]]), (0.0, 0.0, 1.0))
    TimeSeries(tmp_path, tow).add(at_rest(tow))
    assert {p.name for p in tmp_path.iterdir()} == {"tows.pvd", "tows_00000.vtu"}


def test_time_does_not_run_backwards(tmp_path: Path) -> None:
    series = TimeSeries(tmp_path, NET)
    series.add(at_rest(NET, 1.0))
    with pytest.raises(ValueError, match="time 1 s is not after 1 s"):
        series.add(at_rest(NET, 1.0))
    assert series.times == [1.0]


class Killed(BaseException):
    """Stands for the end of the process: nothing in the writer may catch it."""


@pytest.mark.parametrize("replacements", range(4))
def test_killed_writer_leaves_a_series_that_opens_and_resumes(
    replacements: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    series = TimeSeries(tmp_path, NET)
    series.add(at_rest(NET, 0.0))
    done = []

    def stop(source: Path, target: Path) -> None:  # a step puts four files in place
        if len(done) == replacements:
            source.write_bytes(source.read_bytes()[:100])  # it was still being written
            raise Killed
        done.append(target)
        move(source, target)

    move = os.replace
    monkeypatch.setattr(files.os, "replace", stop)
    with pytest.raises(Killed):
        series.add(at_rest(NET, 0.5))
    monkeypatch.undo()

    for name in ("tows", "crossings"):
        reader = pv.PVDReader(tmp_path / f"{name}.pvd")
        named = [0.0, 0.5] if tmp_path / f"{name}.pvd" in done else [0.0]
        assert reader.time_values == named
        for time in named:
            reader.set_active_time_value(time)
            assert "displacement" in reader.read()[0].point_data

    again = TimeSeries(tmp_path, NET, resume=True)
    assert again.times == [0.0]  # a step counts when both collections name it
    again.add(at_rest(NET, 0.6))
    assert pv.PVDReader(tmp_path / "crossings.pvd").time_values == [0.0, 0.6]
    assert len(list(tmp_path.iterdir())) == 2 + 2 * 2  # nothing unfinished stays


def test_append_to_a_full_disk_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    files.append_text(path, "a,b\n")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, limits[1]))
    try:
        with pytest.raises(OSError, match=r"table\.csv"):
            files.append_text(path, "1.5,2.5\n")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_text() == "a,b\n"
    files.append_text(path, "1,2\n")
    assert path.read_text() == "a,b\n1,2\n"


def test_a_step_is_on_the_disk_before_it_has_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = []
    for name in ("fsync", "replace"):
        real = getattr(os, name)
        monkeypatch.setattr(
            files.os, name, lambda *given, name=name, real=real: (done.append(name), real(*given))
        )
    files.write_npz(tmp_path / "a.npz", {"u": np.ones(3)}, compressed=False, durable=True)
    assert done == ["fsync", "replace"]


def test_resume_keeps_the_steps_up_to_a_time(tmp_path: Path) -> None:
    series = TimeSeries(tmp_path, NET)
    for time in (0.0, 0.1, 0.2, 0.3):
        series.add(at_rest(NET, time))
    series = TimeSeries(tmp_path, NET, resume=True, until=0.1)
    assert series.times == [0.0, 0.1]
    assert not (tmp_path / "tows_00002.vtu").exists()
    series.add(noise(NET, 0.15))
    reader = pv.PVDReader(tmp_path / "tows.pvd")
    assert reader.time_values == [0.0, 0.1, 0.15]
    assert TimeSeries(tmp_path, NET, resume=True).times == [0.0, 0.1, 0.15]
    assert TimeSeries(tmp_path, NET).times == []  # anew
    assert {p.name for p in tmp_path.iterdir()} == {"tows.pvd", "crossings.pvd"}


def test_resume_of_a_damaged_collection_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "tows.pvd").write_text("<VTKFile")
    with pytest.raises(InputError, match=r"tows\.pvd: not a collection that can be resumed"):
        TimeSeries(tmp_path, NET, resume=True)


def test_only_files_of_the_series_are_removed(tmp_path: Path) -> None:
    for name in ("tows_final.vtu", "tows_00000.vtu", "notes.txt"):
        (tmp_path / name).write_text("kept?")
    TimeSeries(tmp_path, NET)
    left = {p.name for p in tmp_path.iterdir()}
    assert left == {"tows_final.vtu", "notes.txt", "tows.pvd", "crossings.pvd"}


PROFILE = np.array([[0.0, 58.0], [30.0, 44.0], [60.0, 18.0], [90.0, -2.0]])
PUNCH = RevolvedSurface("punch", PROFILE, np.zeros(3))


def picture(path: Path) -> np.ndarray:
    """Pixels (height, width, 3) as numbers."""
    return np.asarray(pv.read(path).point_data.active_scalars, dtype=float).reshape(
        SMALL[1], SMALL[0], -1
    )[::-1]


@pytest.mark.parametrize("view", VIEWS)
def test_picture_has_its_size_and_fills_its_frame(view: str, tmp_path: Path) -> None:
    path = tmp_path / "new" / f"{view}.png"
    draw_net(path, NET, dome(NET), surfaces=[PUNCH], view=view, size=SMALL)
    pixels = picture(path)
    assert pv.read(path).dimensions == (*SMALL, 1)
    assert pixels.std() > 10.0
    ink = np.any(pixels < 250.0, axis=2)
    assert not ink[:, :3].any() and not ink[:3].any() and not ink[-3:].any()  # nothing cut off
    gap = slice(int(0.835 * SMALL[0]), int(0.85 * SMALL[0]))
    assert not ink[SMALL[1] // 3 :, gap].any()  # between the net and the scale
    net = np.argwhere(ink[:, : gap.start])
    reach = np.ptp(net, axis=0) / (0.885 * SMALL[1], 0.8 * SMALL[0])  # of the frame of the net
    assert 0.95 < reach.max() < 1.02


def test_picture_changes_with_the_data(tmp_path: Path) -> None:
    state = dome(NET)
    states = {
        "state": state,
        "same": state,
        "flatter": replace(state, displacement=state.displacement * 0.5),
        "less_sheared": replace(state, shear_angle=state.shear_angle * 0.5),
    }
    for name, each in states.items():
        draw_net(tmp_path / f"{name}.png", NET, each, size=SMALL, limits=(0.0, 40.0))
    drawn = {name: picture(tmp_path / f"{name}.png") for name in states}
    assert np.abs(drawn["same"] - drawn["state"]).max() == 0.0
    assert np.abs(drawn["flatter"] - drawn["state"]).mean() > 1.0
    assert np.abs(drawn["less_sheared"] - drawn["state"]).mean() > 0.3


def test_mirrored_quarter_is_the_picture_of_the_whole_sheet(tmp_path: Path) -> None:
    quarter = square(0.0, 144.0, 24.0)
    draw_net(tmp_path / "whole.png", NET, dome(NET), view="top", size=SMALL)
    for mirror in (True, False):
        path = tmp_path / f"{mirror}.png"
        draw_net(path, quarter, dome(quarter), view="top", size=SMALL, mirror=mirror)
    whole = picture(tmp_path / "whole.png")
    assert np.abs(picture(tmp_path / "True.png") - whole).mean() < 0.5
    assert np.abs(picture(tmp_path / "False.png") - whole).mean() > 5.0


@pytest.mark.parametrize("colour", COLOURS)
def test_every_quantity_can_colour_the_net(colour: str, tmp_path: Path) -> None:
    net = square(0.0, 48.0)
    draw_net(tmp_path / "rest.png", net, at_rest(net), colour=colour, size=SMALL)
    draw_net(tmp_path / "noise.png", net, noise(net, 0.0), colour=colour, size=SMALL)
    assert np.abs(picture(tmp_path / "rest.png") - picture(tmp_path / "noise.png")).mean() > 1.0


def test_tow_without_crossings_is_drawn(tmp_path: Path) -> None:
    tow = single_tow(np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]]), (0.0, 0.0, 1.0))
    draw_net(tmp_path / "tow.png", tow, at_rest(tow), size=SMALL, title="one tow")
    assert picture(tmp_path / "tow.png").std() > 5.0


def test_picture_says_what_is_wrong(tmp_path: Path) -> None:
    path, state = tmp_path / "never.png", at_rest(NET)
    with pytest.raises(ValueError, match="view is 'below', not one of perspective, top"):
        draw_net(path, NET, state, view="below")
    with pytest.raises(ValueError, match="colour is 'red', not one of shear_angle"):
        draw_net(path, NET, state, colour="red")
    with pytest.raises(ValueError, match=r"limits are \(1.0, 1.0\), not a lower"):
        draw_net(path, NET, state, limits=(1.0, 1.0))
    with pytest.raises(ValueError, match="displacement has shape"):
        draw_net(path, NET, at_rest(square(0.0, 48.0)))
    with pytest.raises(ValueError, match=r"surface punch: profile has shape \(3,\)"):
        RevolvedSurface("punch", np.zeros(3), np.zeros(3))
    with pytest.raises(ValueError, match=r"surface punch: centre has shape \(2,\)"):
        RevolvedSurface("punch", PROFILE, np.zeros(2))
    with pytest.raises(ValueError, match="surface punch: profile has a negative radius"):
        RevolvedSurface("punch", -PROFILE, np.zeros(3))
    assert not path.exists()


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("flat", [False, True])
def test_camera_shows_every_point_and_leaves_no_room(view: str, flat: bool) -> None:
    """Against all points, of which the camera's search takes a few; also of a plane."""
    extent = [100.0, 70.0, 0.0 if flat else 30.0]
    points = np.random.default_rng(3).normal(size=(4000, 3)) * extent
    looks: list[Any] = []
    aim(SimpleNamespace(look=lambda *look: looks.append(look)), view, [points], (1600, 1200))
    ((focus, position, up, angle, height),) = looks
    w = np.subtract(position, focus)
    away = np.linalg.norm(w)
    u, v, w = np.cross(up, w / away), np.array(up), w / away
    a, b, depth = ((points - focus) @ axis for axis in (u, v, w))
    s = height if height is not None else np.tan(np.radians(angle) / 2.0) * (away - depth)
    assert (height is None) == (view == "perspective")
    p, q = a / s * 1200 / 1600, b / s
    assert p.min() > -0.9401 and p.max() < 0.6601 and q.min() > -0.9301 and q.max() < 0.8401
    # In one direction it is full, in the other the room is shared.
    full = [np.ptp(p) / 1.6, np.ptp(q) / 1.77]
    assert max(full) == pytest.approx(1.0, abs=1e-6)
    middle = [(p.min() + p.max()) / 2.0, (q.min() + q.max()) / 2.0]
    assert middle == pytest.approx([-0.14, -0.045], abs=1e-6)


def test_scale_is_that_of_matplotlib():
    part = np.linspace(0.06, 1.0, 256)
    assert np.abs(colour_table() - colormaps["viridis"](part)[:, :3]).max() < 3.0 / 255.0
    assert rgb("#336699") == pytest.approx(to_rgb("#336699"))
    assert rgb("teal") == to_rgb("teal")


def test_turned_profile_is_closed_at_seam_and_pole():
    """A hemisphere has a rim and no other boundary; a repeated point leaves no empty triangle."""
    angle = np.linspace(0.0, np.pi / 2.0, 91)
    profile = 40.0 * np.column_stack([np.sin(angle), -np.cos(angle)])
    profile = np.insert(profile, 30, profile[30], axis=0)
    points, cells = triangles(RevolvedSurface("punch", profile, np.array([1.0, 2.0, 3.0])))
    sides = np.sort(cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, times = np.unique(sides, axis=0, return_counts=True)
    assert set(times) == {1, 2} and (times == 1).sum() == 180
    a, b, c = points[cells].transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(2.0 * np.pi * 40.0**2, rel=3e-4)


def test_tubes_have_pieces_where_their_curve_bends():
    """Chords of an arc of radius R stay within s of it where their length is at most √(8 R s)."""
    straight = np.linspace([0.0, 0.0, 0.0], [60.0, 0.0, 0.0], 11)
    np.testing.assert_allclose(
        _stations(straight, arc_length(straight), 0.02), arc_length(straight)
    )
    radius, near = 20.0, 0.05
    angle = np.linspace(0.0, 1.5, 7)
    bent = radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle])
    fine = _stations(bent, arc_length(bent), near)
    longest = np.sqrt(8.0 * radius * near)
    assert 0.5 * longest < np.diff(fine).max() < 1.1 * longest
    assert np.isin(arc_length(bent), fine).all()


@pytest.mark.parametrize("count", [0, 3, 200_000])
def test_files_without_vtk_are_those_that_vtk_reads(tmp_path: Path, count: int):
    """Also without a number in it, and with more than VTK puts into one block."""
    points = np.random.default_rng(count).normal(size=(count, 3))
    corners = np.arange(3 * (count // 3))
    name = 'a <&" b'
    sections = {
        "PointData": {name: packed(points, ("u", "v", "w"))},
        "Points": {"Points": packed(points, small=True)},
        "Polys": {
            "connectivity": packed(corners, small=True),
            "offsets": packed(3 * np.arange(1, count // 3 + 1)),
        },
    }
    counts = {"NumberOfPoints": count, "NumberOfPolys": count // 3}
    parts = xml_file("PolyData", counts, sections, {"when": packed(np.array([1.5]))})
    (tmp_path / "a.vtp").write_bytes(b"".join(parts))
    mesh = pv.read(tmp_path / "a.vtp")
    assert np.array_equal(mesh.points, points) and np.array_equal(mesh.point_data[name], points)
    assert np.array_equal(mesh.faces.reshape(-1, 4)[:, 1:].ravel(), corners)
    assert mesh.field_data["when"] == [1.5]


def test_edges_of_a_picture_are_smooth(tmp_path):
    """A slanted edge between black and white has greys: pixels are means of several."""
    from PIL import Image

    with canvas(tmp_path / "edge.png", (200, 200), ()) as scene:
        corners = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 0.6, 0.0]])
        scene.add(poly_data(corners, faces=np.array([[0, 1, 2]])), "#000000", ambient=1.0)
        scene.look(np.zeros(3), np.array([0.0, 0.0, 5.0]), np.array([0.0, 1.0, 0.0]), 30.0, 1.5)
    grey = np.asarray(Image.open(tmp_path / "edge.png").convert("L"))
    assert grey.shape == (200, 200) and grey.min() == 0 and grey.max() == 255
    assert np.count_nonzero((grey > 30) & (grey < 225)) > 50
