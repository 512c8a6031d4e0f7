"""Curvature, waves, distances, draw-in and flat patterns of draped nets against closed forms."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from test_output import square

from fabric_fenicsx.fabric.axes import axes_shear, tow_axes
from fabric_fenicsx.fabric.quads import meshes, rim_faces
from fabric_fenicsx.output.curvature import (
    excess_curvature,
    principal_curvatures,
    shape_operators,
)
from fabric_fenicsx.output.draped import draped_sheet
from fabric_fenicsx.output.draw_in import draw_in
from fabric_fenicsx.output.pattern import (
    area,
    circle,
    flat_pattern,
    nesting_box,
    to_line,
    write_pattern,
)
from fabric_fenicsx.output.surfaces import RevolvedSurface, TriangleSurface, triangulated
from fabric_fenicsx.output.tool_distance import deepest_penetration, tool_distance
from fabric_fenicsx.output.wrinkles import buckling_ratio, in_plane_waves, tow_waves, waves
from fabric_fenicsx.solving.snapshot import at_rest

NET = square(-60.0, 60.0, 6.0)
R = 100.0


def laid(net, place):
    """The net with its nodes at the places that a function of x and y gives."""
    rest = at_rest(net)
    displacement = place(*net.points[:, :2].T) - net.points
    axes = tow_axes(net, displacement)
    return draped_sheet(
        net, replace(rest, displacement=displacement, axes=axes, shear_angle=axes_shear(axes))
    )


def pure_shear(gamma):
    """Warp and weft turned by γ/2 towards each other."""
    c, s = np.cos(gamma / 2.0), np.sin(gamma / 2.0)
    return lambda x, y: np.column_stack([c * x + s * y, s * x + c * y, 0.0 * x])


def on_cylinder(height=lambda s, t: 0.0, skew=0.0):
    """Laid on a cylinder about y, lifted by a function of the arc length s and of y."""

    def place(x, y):
        s, t = x + skew * y, y * np.sqrt(1.0 - skew**2)
        r = R + height(s, t)
        return np.column_stack([r * np.sin(s / R), t, r * np.cos(s / R) - R])

    return place


def cylinder():
    """The tool below: triangles a quarter of a degree wide."""
    angle = np.radians(np.arange(-60.0, 60.01, 0.25))
    rim = np.column_stack([R * np.sin(angle), 0.0 * angle, R * np.cos(angle) - R])
    points = np.concatenate([rim + np.array([0.0, y, 0.0]) for y in (-100.0, 100.0)])
    n, k = len(angle), np.arange(len(angle) - 1)
    cells = np.concatenate(
        [np.column_stack([k, k + 1, k + n]), np.column_stack([k + 1, k + 1 + n, k + n])]
    )
    return TriangleSurface("die", points, cells, np.zeros(3))


def nodes(sheet):
    return sheet.net.points + sheet.snapshot.displacement


# Curvature.


@pytest.mark.parametrize("flipped", [False, True])
def test_curvature_of_a_cap_of_a_ball(flipped):
    """S = −1/R above a ball and 1/R in a bowl, to second order in the spacing."""
    sign = 1.0 if flipped else -1.0

    def cap(x, y):
        return np.column_stack([x, y, sign * (R - np.sqrt(R**2 - x**2 - y**2))])

    errors = []
    for spacing in (8.0, 4.0):
        sheet = laid(square(-32.0, 32.0, spacing), cap)
        principal = principal_curvatures(shape_operators(sheet))
        known = np.isfinite(principal).all(axis=1)
        count = round(64.0 / spacing) + 1
        assert known.sum() == (count - 2) ** 2  # all but the rim
        errors.append(float(np.abs(principal[known] * R - sign).max()))
    assert errors[1] < 0.02
    assert np.log2(errors[0] / errors[1]) > 1.7


def test_curvature_beyond_the_tools_is_none_where_the_fabric_lies_on_it():
    """On the tool no curvature is left; of a wave A cos(k s) on it A k² at its crests."""
    for amplitude in (0.0, 0.5):
        k = 2.0 * np.pi / 48.0
        sheet = laid(NET, on_cylinder(lambda s, t, a=amplitude: a * np.cos(k * s)))  # noqa: B023
        feet = tool_distance([cylinder()], sheet.place[: sheet.count]).feet[0]
        beyond = excess_curvature(shape_operators(sheet), shape_operators(sheet, feet))
        crest = np.abs(np.abs(sheet.flat[: sheet.count, 0]) % 48.0) < 1e-9
        crest &= np.isfinite(beyond)
        # The quadric through places 6 mm apart has (2 − 2 cos(k h))/h² for k².
        seen = amplitude * (2.0 - 2.0 * np.cos(6.0 * k)) / 36.0
        assert np.abs(beyond[crest]) == pytest.approx(seen, abs=0.02 * 0.5 * k**2 + 2e-5)


# Wrinkles.


def test_a_wave_on_a_tool_is_found_with_its_amplitude_and_length():
    """A sine of 1 mm and 40 mm along the weft; the negative twin is sheared more and has none."""
    wavy = laid(NET, on_cylinder(lambda s, t: 1.0 + np.sin(2.0 * np.pi * t / 40.0)))
    distance = tool_distance([cylinder()], nodes(wavy))
    assert distance.distance == pytest.approx(
        1.0 + np.sin(2.0 * np.pi * nodes(wavy)[:, 1] / 40.0), abs=2e-3
    )
    found = tow_waves(wavy, distance, 0.5)
    # Of 120 mm of a tow that runs along y the two crests and troughs between others.
    inner = [wave for wave in found if abs(wavy.net.points[wave.node, 1]) < 25.0]
    assert {wave.tow for wave in found} == {wave.tow for wave in inner}
    assert len({wave.tow for wave in found}) == 21
    assert all(wavy.net.tow_family[wave.tow] == 1 for wave in found)
    for wave in inner:
        assert wave.amplitude == pytest.approx(1.0, rel=0.03)
        assert wave.wavelength == pytest.approx(40.0, rel=0.03)

    smooth = laid(NET, on_cylinder(skew=np.sin(np.radians(30.0))))
    sheared, waved = (np.abs(s.snapshot.shear_angle).max() for s in (smooth, wavy))
    assert sheared == pytest.approx(np.radians(30.0), rel=0.01) and sheared > 5.0 * waved
    assert tow_waves(smooth, tool_distance([cylinder()], nodes(smooth)), 0.05) == []


def test_a_single_rise_is_no_wave():
    arc = np.linspace(0.0, 100.0, 51)
    assert waves(arc, 3.0 * np.exp(-(((arc - 50.0) / 10.0) ** 2)), 0.2) == []
    assert waves(arc, np.sin(2.0 * np.pi * arc / 25.0), 1.2) == []
    found = waves(arc, np.sin(2.0 * np.pi * arc / 25.0) + 0.01 * arc, 0.2)
    assert [round(length) for _, _, length in found[1:]] == [25] * (len(found) - 1)
    assert [a for _, a, _ in found[1:]] == pytest.approx([1.0] * (len(found) - 1), rel=0.01)


def refined(low, high, spacing):
    """A sheet whose tows have a node halfway between crossings."""
    net = square(low, high, spacing / 2.0)
    at = net.points[net.crossings[:, 0]]
    even = (np.abs(at[:, :2] / spacing - np.round(at[:, :2] / spacing)) < 1e-9).all(axis=1)
    kept = net.crossings[even]
    tow = np.zeros(len(net.points), dtype=int)
    tow[net.cells.ravel()] = np.repeat(net.cell_tow, 2)
    stays = np.isin(np.arange(len(net.tow_family)), tow[kept])
    cells = stays[net.cell_tow]
    number = np.cumsum(stays) - 1
    used = np.unique(net.cells[cells])
    node = np.full(len(net.points), -1)
    node[used] = np.arange(len(used))
    return replace(
        net,
        points=net.points[used],
        cells=node[net.cells[cells]],
        cell_tow=number[net.cell_tow[cells]],
        tow_family=net.tow_family[stays],
        crossings=node[kept],
        ends=node[net.ends[stays]],
        normals=net.normals[cells],
    )


def test_waves_within_the_sheet_are_told_from_smooth_curves():
    """Each tow 0.4 mm off its chord between crossings is; tows along circles are not."""
    net = refined(-48.0, 48.0, 12.0)
    wave = 0.4

    def rippled(x, y):
        between = np.abs(np.sin(np.pi * x / 12.0)) > 0.5
        across = np.where(between, wave * np.sign(np.sin(np.pi * x / 12.0)), 0.0)
        return np.column_stack([x, y + across, 0.0 * x])

    amplitude, span = in_plane_waves(laid(net, rippled))
    assert amplitude == pytest.approx(wave, rel=1e-9)
    assert span == pytest.approx(12.0)

    def bent(x, y):
        return np.column_stack([(R + y) * np.sin(x / R), (R + y) * np.cos(x / R) - R, 0.0 * x])

    amplitude, _ = in_plane_waves(laid(net, bent))
    sagitta = 12.0**2 / (8.0 * R)
    assert np.nanmax(amplitude) < 0.005 * sagitta

    coarse, _ = in_plane_waves(laid(NET, bent))
    assert np.isnan(coarse).all()  # no node between crossings: not assessed


def test_compression_over_eulers_load():
    net = refined(-48.0, 48.0, 12.0)
    forces = np.zeros((len(net.cells), 3))
    forces[:, 0] = -(np.pi**2) * 8.8 / 12.0**2
    ratio = buckling_ratio(
        net, replace(at_rest(net), section_forces=forces), np.full(len(net.tow_family), 8.8)
    )
    assert ratio == pytest.approx(1.0)


# Distances.


def test_distance_from_open_tools():
    """Over a holed plate: outside everywhere above it and in the hole, unknown past its rim."""
    profile = np.array([[40.0, -20.0], [40.0, 0.0], [90.0, 0.0]])
    die = RevolvedSurface("die", profile, np.zeros(3))
    mesh = triangulated(die)
    plate = TriangleSurface(
        "die", np.array(mesh.points), mesh.faces.reshape(-1, 4)[:, 1:].astype(int), np.zeros(3)
    )
    points = np.array(
        [[70.0, 0.0, 3.0], [70.0, 0.0, -0.5], [30.0, 0.0, -10.0], [0.0, 0.0, -30.0], [99.0, 0, 1.0]]
    )
    found = tool_distance([plate, replace(plate, name="holder")], points)
    assert found.names == ["die"]
    assert found.distance == pytest.approx([3.0, -0.5, 10.0, np.nan, np.nan], abs=0.02, nan_ok=True)
    assert deepest_penetration([plate], points) == {"die": pytest.approx(0.5)}
    assert tool_distance([], points) is None


# Outline and pattern.


def test_draw_in_of_a_sheet_in_pure_shear():
    """Each end moves by L (1 − cos γ/2) towards the sheet, along its tow."""
    gamma = np.radians(40.0)
    ends = draw_in(laid(NET, pure_shear(gamma)))
    half = 60.0
    for axis in (0, 1):
        side = np.abs(np.abs(ends.flat[:, axis]) - half) < 1e-9
        other = ends.flat[:, 1 - axis]
        # u·t at x = 60: 60 (1 − cos) − y sin.
        exact = half * (1.0 - np.cos(gamma / 2.0)) - np.sign(ends.flat[:, axis]) * other * np.sin(
            gamma / 2.0
        )
        mine = side & (np.abs(other) < half - 1e-9)
        assert ends.along[mine] == pytest.approx(exact[mine])


def test_flat_pattern_in_pure_shear_is_the_inverse_map():
    """A circle on the sheared sheet comes from an ellipse of area π r²/cos γ, turned by 45°."""
    gamma, radius = np.radians(35.0), 30.0
    sheet = laid(NET, pure_shear(gamma))
    pattern = flat_pattern(sheet, circle(radius))
    assert pattern.closed and pattern.outside == 0.0
    (line,) = pattern.lines
    c, s = np.cos(gamma / 2.0), np.sin(gamma / 2.0)
    exact = pattern.trim @ np.linalg.inv(np.array([[c, s], [s, c]]))
    assert line == pytest.approx(exact, abs=1e-9)
    assert area(line) == pytest.approx(np.pi * radius**2 / np.cos(gamma), rel=1e-3)
    length, width, angle = nesting_box(line)
    axes = [2.0 * radius / (c - s), 2.0 * radius / (c + s)]
    assert [length, width] == pytest.approx(axes, rel=2e-3)
    assert np.abs(angle) == pytest.approx(np.pi / 4.0, abs=0.02)
    back, found = sheet.to_place(line)
    assert found.inside.all()
    assert back[:, :2] == pytest.approx(pattern.trim, abs=1e-9)


def test_flat_pattern_on_a_cylinder_is_its_development():
    """Given in space and in plan, x = R sin(s/R); the chords of the faces cost h²/8R at most."""
    sheet = laid(NET, on_cylinder())
    ring = 40.0 * np.column_stack([np.cos(a := np.radians(np.arange(0, 360, 5))), np.sin(a)])
    trim = np.column_stack([R * np.sin(ring[:, 0] / R), ring[:, 1], R * np.cos(ring[:, 0] / R) - R])
    for line in (trim, trim[:, :2]):
        pattern = flat_pattern(sheet, line)
        assert pattern.closed
        assert pattern.distance <= 6.0**2 / (8.0 * R) + 1e-9
        assert to_line(pattern.lines[0], ring).max() < 0.02


def test_flat_pattern_ends_where_the_trim_line_leaves_the_sheet():
    sheet = laid(NET, lambda x, y: np.column_stack([x, y, 0.0 * x]))
    pattern = flat_pattern(
        sheet, np.array([[-30.0, -30.0], [80.0, -30.0], [80.0, 30.0], [-30, 30]])
    )
    assert not pattern.closed
    # Both long sides leave by 20 mm, the short one lies outside: 100 mm, to the step of 2 mm.
    assert pattern.outside == pytest.approx(100.0, abs=4.1)
    assert len(pattern.lines) == 1
    assert pattern.lines[0][:, 0].max() <= 60.0 + 1e-6


def test_the_surface_reaches_to_the_tows_ends():
    """Meshes and rim of a sheet whose tows end half a spacing beyond their last crossings."""
    net = refined(-36.0, 36.0, 12.0)
    crosses = np.abs(net.points[net.crossings[:, 0]][:, :2]).max(axis=1) < 30.0
    net = replace(net, crossings=net.crossings[crosses])
    assert len(meshes(net)) == 16
    tip, before, rim = rim_faces(net)
    assert len(tip) == len(before) == 20 and len(rim) == 16
    sheet = draped_sheet(net, at_rest(net))
    corners = sheet.flat[sheet.faces][:, :, :2]
    diagonals = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    size = np.abs(diagonals[0][:, 0] * diagonals[1][:, 1] - diagonals[0][:, 1] * diagonals[1][:, 0])
    assert size.sum() / 2.0 == pytest.approx(48.0**2 + 4 * 48.0 * 12.0)
    inside = sheet.to_place(np.array([[0.0, 35.9], [35.9, 1.0], [30.0, 30.0], [0.0, 36.1]]))[1]
    assert inside.inside.tolist() == [True, True, False, False]


def test_pattern_files(tmp_path):
    """The same lines in all three, in mm; the DXF as an independent reader has it, if there."""
    sheet = laid(NET, pure_shear(0.3))
    pattern = flat_pattern(sheet, circle(30.0))
    assert write_pattern(tmp_path, pattern) == ["pattern.svg", "pattern.dxf", "pattern.csv"]
    table = pd.read_csv(tmp_path / "pattern.csv")
    assert table[["x_mm", "y_mm"]].to_numpy() == pytest.approx(pattern.lines[0], abs=1e-4)
    lines = (tmp_path / "pattern.dxf").read_text().splitlines()
    pairs = list(zip(map(int, lines[::2]), lines[1::2], strict=True))
    at = [k for k, pair in enumerate(pairs) if pair == (0, "VERTEX")]
    read = np.array([[float(dict(pairs[k : k + 5])[code]) for code in (10, 20)] for k in at])
    assert read == pytest.approx(pattern.lines[0], abs=1e-4)
    assert pairs[-1] == (0, "EOF") and (70, "1") in pairs
    svg = (tmp_path / "pattern.svg").read_text()
    points = re.search(r'points="([^"]*)"', svg)[1].split()
    assert len(points) == len(pattern.lines[0])
    width = float(re.search(r'width="([\d.]+)mm"', svg)[1])
    assert width == pytest.approx(np.ptp(pattern.lines[0][:, 0]) + 10.0, abs=1e-2)
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.readfile(tmp_path / "pattern.dxf")
    (polyline,) = document.modelspace().query("POLYLINE")
    assert polyline.is_closed and not document.audit().errors
    assert [v.dxf.location.x for v in polyline.vertices] == pytest.approx(table["x_mm"].tolist())
