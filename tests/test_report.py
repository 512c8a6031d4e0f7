"""The page on a drape: what is computed for it against closed forms, and the page itself."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from test_output import square
from test_views import command, write_step

import fabric_fenicsx as ff
from fabric_fenicsx.fabric.axes import axes_shear, tow_axes
from fabric_fenicsx.fabric.quads import meshes, rim_faces
from fabric_fenicsx.output.comparison import (
    compared_angles,
    differing_keys,
    line_distance,
    repeat_scatter,
)
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
from fabric_fenicsx.output.results import write_setup
from fabric_fenicsx.output.surfaces import RevolvedSurface, TriangleSurface, triangulated
from fabric_fenicsx.output.thickness import flat_fabric
from fabric_fenicsx.output.tool_distance import deepest_penetration, tool_distance
from fabric_fenicsx.output.wrinkles import buckling_ratio, in_plane_waves, tow_waves, waves
from fabric_fenicsx.solving.snapshot import at_rest

ROOT = Path(__file__).parents[1]
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


# Thickness.


def test_flat_fabric_from_what_is_known():
    """200 g/m² of fibres of 2 g/cm³ are 0.1 mm thick: V = 0.5 at 0.2 mm."""
    assert flat_fabric(
        thickness=0.2, areal_weight=200.0, fibre_density=2.0
    ).fibre_fraction == pytest.approx(0.5)
    assert flat_fabric(
        fibre_fraction=0.5, areal_weight=200.0, fibre_density=2.0
    ).thickness == pytest.approx(0.2)
    assert flat_fabric(areal_weight=200.0).thickness is None


# Comparisons.


def test_measured_map_of_known_shares():
    """Off by 1, 3 and 7 degrees on a half, a quarter and a quarter of the places."""
    gamma = np.radians(25.0)
    sheet = laid(NET, pure_shear(gamma))
    x, y = (v.ravel() for v in np.meshgrid([-30.0, -11.0, 11.0, 30.0], [-20.0, 20.0]))
    off = np.array([1.0, -1.0, 1.0, -1.0, 3.0, -3.0, 7.0, -7.0])
    table = {"x_mm": x, "y_mm": y, "angle_deg": 65.0 - off}
    numbers = compared_angles(sheet, table).numbers()
    assert numbers["within_2_deg_percent"] == 50.0
    assert numbers["within_6_deg_percent"] == 75.0
    assert numbers["rms_deg"] == pytest.approx(np.sqrt(np.mean(off**2)))
    assert numbers["mean_deg"] == pytest.approx(0.0, abs=1e-9)
    # Two repeats that are the same in the mean.
    twice = {k: np.tile(v, 2) for k, v in table.items()}
    twice["angle_deg"] += np.repeat([0.5, -0.5], len(x))
    assert compared_angles(sheet, twice).numbers() == pytest.approx(numbers, abs=1e-9)
    # The same places of the draped sheet, and one beyond it.
    place = pure_shear(gamma)(x, y)
    draped = {"x_mm": place[:, 0], "y_mm": place[:, 1], "z_mm": place[:, 2]}
    draped = {k: np.append(v, 500.0) for k, v in draped.items()}
    again = compared_angles(sheet, {**draped, "angle_deg": np.append(65.0 - off, 60.0)}).numbers()
    assert again.pop("places_beyond_the_sheet") == 1
    numbers.pop("places_beyond_the_sheet")
    assert again == pytest.approx(numbers, abs=1e-9)


def test_scatter_of_repeats():
    """Two places, three and two repeats: 2 + 0.5 over 3 degrees of freedom."""
    table = {
        "x_mm": np.array([0.0, 0.0, 0.0, 5.0, 5.0]),
        "y_mm": np.zeros(5),
        "angle_deg": np.array([50.0, 51.0, 52.0, 60.0, 61.0]),
        "repeat": np.array([1.0, 2.0, 3.0, 1.0, 2.0]),
    }
    assert repeat_scatter(table) == pytest.approx(np.sqrt(2.5 / 3.0))
    assert repeat_scatter({"std_deg": np.array([1.0, np.nan, 7.0])}) == pytest.approx(5.0)
    assert repeat_scatter({}) is None


def test_outlines_apart_and_keys_that_differ():
    assert line_distance(circle(40.0), circle(37.0))["largest_mm"] == pytest.approx(3.0, abs=0.02)
    mine = {"title": "a", "contact": {"friction": 0.1, "layer_mm": 0.5}, "points": []}
    other = {"title": "b", "contact": {"friction": 0.3, "layer_mm": 0.5}, "mesh": "x.msh"}
    assert differing_keys(mine, other) == [
        {"key": "contact.friction", "this": 0.1, "other": 0.3},
        {"key": "points", "this": [], "other": None},
        {"key": "mesh", "this": None, "other": "x.msh"},
    ]


# The page.

QUARTER = square(0.0, 144.0, 12.0)
BALL = RevolvedSurface(
    "punch",
    60.0
    * np.column_stack(
        [np.sin(np.linspace(0.0, np.pi / 2, 46)), -np.cos(np.linspace(0.0, np.pi / 2, 46))]
    ),
    np.zeros(3),
)


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    """A quarter pushed into a smooth hill, as `run` leaves it, with a case and half a table."""
    folder = tmp_path_factory.mktemp("rün") / "drape"
    folder.mkdir()
    write_setup(folder, QUARTER, [BALL])
    x, y = QUARTER.points[:, 0], QUARTER.points[:, 1]
    rest = at_rest(QUARTER, 30.0)
    rest.displacement[:, 2] = -30.0 * np.exp(-(x**2 + y**2) / 60.0**2)
    axes = tow_axes(QUARTER, rest.displacement, symmetry=(0, 1))
    state = replace(rest, axes=axes, shear_angle=axes_shear(axes))
    write_step(folder, 1, state, {"punch": np.array([0.0, 0.0, 30.2])})
    (folder / "case.yaml").write_text("test: drape\ntitle: hill <b> & more\n", encoding="utf-8")
    rows = {"time_s": [15.0, 30.0], "punch_force_z_N": [-1.0, -2.0]}
    for name in ("external_work", "stored", "kinetic", "lost", "remainder"):
        rows[f"{name}_N_mm"] = [1.0, 2.0]
    pd.DataFrame(rows).to_csv(folder / "steps.csv", index=False)
    (folder / "result.json").write_text(
        json.dumps({"completed": False, "stopped_because": "Newton <failed> at 31 s"})
    )
    return folder


class Page(HTMLParser):
    """Tags that are left open, and all references."""

    EMPTY = frozenset({"meta", "img", "br", "link"})

    def __init__(self):
        super().__init__()
        self.open, self.references, self.wrong = [], [], []

    def handle_starttag(self, tag, attributes):
        self.references += [v for k, v in attributes if k in ("src", "href")]
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)


def test_the_page_is_one_valid_file(run_folder, tmp_path):
    """Against itself: no difference. Stopped early: it says so, and why. All inside one file."""
    measured = tmp_path / "angles.csv"
    measured.write_text("x_mm,y_mm,angle_deg,std_deg\n60,60,88,1\n-60,30,89,1\n30,-20,90,\n")
    outline = tmp_path / "outline.csv"
    outline.write_text("x_mm,y_mm\n-145,-145\n145,-145\n145,145\n-145,145\n")
    out = tmp_path / "page"
    options = ["--measured", measured, "--measured-outline", outline, "--against", run_folder]
    options += ["--locking-deg", "50", "--thickness-mm", "0.2", "--fibre-density-g-cm3", "1.8"]
    assert command("report", run_folder, "--out", out, "--trim", "70", *options) == 0
    text = (out / "report.html").read_text(encoding="utf-8")
    page = Page()
    page.feed(text)
    assert text.lstrip().startswith("<!DOCTYPE html>")
    assert page.open == [] and page.wrong == []
    assert len(page.references) == 9 and all(r.startswith("data:image/") for r in page.references)
    assert "hill &lt;b&gt; &amp; more" in text
    assert "stopped early: Newton &lt;failed&gt; at 31 s" in text
    assert "Health: not assessed" in text
    assert "http" not in re.sub(r'src="[^"]*"', "", text)

    numbers = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert numbers["schema"] == "fabric-drape-report/1"
    against = numbers["against"]
    assert against["shear"]["largest_deg"] == pytest.approx(0.0, abs=1e-9)
    assert against["outline"]["largest_mm"] == pytest.approx(0.0, abs=1e-9)
    assert against["keys"] == [] and against["crossings_compared"] == 25 * 25
    assert numbers["measured"]["angles"]["places"] == 3
    assert numbers["measured"]["outline"]["largest_mm"] == pytest.approx(1.0)
    assert numbers["pattern"]["closed"] and numbers["pattern"]["mapped_again_off_by_mm"] < 1e-6
    assert numbers["shear"]["smallest_margin_deg"] == pytest.approx(
        50.0 - numbers["shear"]["largest_deg"]
    )
    t = numbers["thickness"]
    # Of the case: 7e-6 kg/mm³ · 4.57 · 0.04 mm² each 12 mm, twice.
    weight = 7e-6 * 4.57 * 0.04 / 12.0 * 2.0 * 1e9
    assert t["areal_weight_g_m2"] == pytest.approx(weight)
    assert t["flat_fibre_volume_fraction"] == pytest.approx(weight / (1000.0 * 1.8 * 0.2))
    for name in ("pattern.svg", "pattern.dxf", "pattern.csv", "shear.png", "wrinkles.png"):
        assert (out / name).stat().st_size > 0


def test_health_and_what_is_missing_are_said(run_folder, tmp_path):
    result = run_folder / "result.json"
    before = result.read_text()
    try:
        health = {"warnings": ["a tow stands on edge"]}
        result.write_text(json.dumps({"completed": True, "health": health}))
        assert command("report", run_folder, "--out", tmp_path / "a") == 0
        text = (tmp_path / "a" / "report.html").read_text(encoding="utf-8")
        assert "a tow stands on edge" in text and "The run completed" in text
        assert "no locking angle is known" in text
        result.unlink()
        assert command("report", run_folder, "--out", tmp_path / "b") == 0
        assert "left no result" in (tmp_path / "b" / "report.html").read_text(encoding="utf-8")
    finally:
        result.write_text(before)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--trim", "-3"], "trim: -3, allowed is a radius in mm or a CSV file"),
        (["--trim", "none.csv"], "none.csv: no such file"),
        (["--locking-deg", "95"], "locking_deg: 95, allowed is a number above 0 and below 90"),
        (["--measured", "case.yaml"], "unknown column"),
        (["--against", "nowhere"], "allowed is the folder of a run"),
    ],
)
def test_bad_input_is_one_line(run_folder, tmp_path, capsys, options, said):
    options = [run_folder / o if o == "case.yaml" else o for o in options]
    assert command("report", run_folder, "--out", tmp_path / "page", *options) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert not (tmp_path / "page").exists()


def test_only_drapes(run_folder, tmp_path, capsys):
    folder = tmp_path / "frame"
    folder.mkdir()
    write_setup(folder, QUARTER)
    write_step(folder, 1, at_rest(QUARTER), {})
    (folder / "case.yaml").write_text("test: picture_frame\n")
    assert command("report", folder) == 2
    assert "a run of picture_frame, allowed is one of a drape" in capsys.readouterr().err


@pytest.mark.slow
def test_a_sheet_cut_to_the_pattern_drapes_to_the_trim_line(tmp_path):
    """The demo, its pattern for a circle of 100 mm, and that sheet draped: every end within 1 mm.

    What remains is mechanics, not the map: less fabric is held, and it draws in a little more.
    """
    radius = 100.0
    case = ff.load_case(ROOT / "demos" / "drape.yaml")
    ff.run(case, tmp_path / "whole", pictures=False)
    numbers = ff.report(tmp_path / "whole", trim=radius)
    assert numbers["pattern"]["mapped_again_off_by_mm"] < 1e-3
    line = pd.read_csv(tmp_path / "whole" / "report" / "pattern.csv")[["x_mm", "y_mm"]]
    outline = [tuple(place) for place in line.to_numpy().tolist()]
    keys = case.model_dump(exclude={"test", "weave", "assumptions"}, exclude_unset=True)
    cut = ff.make_case("drape", **keys, weave={"outline": outline})
    ff.run(cut, tmp_path / "cut", pictures=False)
    results = ff.read_results(tmp_path / "cut")
    net, snapshot, _ = results.at(results.nearest(None), mirror=True)
    ends = draw_in(draped_sheet(net, snapshot)).place[:, :2]
    assert len(ends) > 150
    off = to_line(ends, circle(radius))
    print(f"off the trim line by {np.sqrt(np.mean(off**2)):.2f} mm rms, {off.max():.2f} mm at most")
    assert off.max() < 1.0
