"""Kinematic nets against the Chebyshev net of the sphere, an independent net, and symmetry."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import pyvista as pv
import reference
from solve import orders

import fabric_fenicsx as ff
from fabric_fenicsx.__main__ import main
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.geometry.triangles import write_stl
from fabric_fenicsx.rigs.kinematic import known_angles

ROOT = Path(__file__).parents[1]
DEMO = ROOT / "demos" / "drape.yaml"
RADIUS = 76.2
#: The paper's tools at 65 mm.
FORMED = ff.FormedHemisphere(RADIUS, 80.0, 10.0, 65.0)


@dataclass(frozen=True)
class Dome:
    """A sphere or an upside-down one; a cylinder where ``along_x`` is 0. Cut off at a height."""

    along_x: float = 1.0
    rim: float = np.inf

    @property
    def apex(self):
        return np.array([0.0, 0.0, -RADIUS])

    def level(self, x):
        r = x * [self.along_x, 1.0, 1.0]
        size = np.linalg.norm(r, axis=1)
        value = np.where(x[:, 2] < self.rim, size - RADIUS, np.nan)
        return value, r / size[:, None]


def stations(half, spacing, *, quarter=False):
    n = round(half / spacing)
    side = np.linspace(0.0, half, n + 1)
    return side if quarter else np.concatenate([-side[:0:-1], side])


def net(surface, spacing, half=144.0, other=None, *, quarter=False, **angles):
    u, v = (stations(size, spacing, quarter=quarter) for size in (half, other or half))
    return ff.net_on_surface(surface, u, v, **angles)


def lathe(profile, pieces=180):
    """Triangles of a profile of radii and heights, (k, 2), turned about the z axis."""
    around = np.linspace(0.0, 2.0 * np.pi, pieces + 1)[:-1]
    r, z = np.asarray(profile).T
    rows = np.stack(
        [np.outer(r, np.cos(around)), np.outer(r, np.sin(around)), np.outer(z, np.ones(pieces))],
        axis=-1,
    )
    a, b, c, d = rows[:-1], rows[1:], np.roll(rows[1:], -1, 1), np.roll(rows[:-1], -1, 1)
    triangles = [np.stack(three, axis=2).reshape(-1, 3, 3) for three in ((a, c, b), (a, d, c))]
    return ff.Triangles.from_corners(np.concatenate(triangles))


@cache
def bullet(shank, facet=2.0):
    """A hemisphere that presses downwards, and a shank above it [mm], of facets [degrees]."""
    angle = np.linspace(0.0, np.pi / 2.0, round(90.0 / facet) + 1)
    dome = RADIUS * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    return lathe(np.vstack([dome, [[RADIUS, RADIUS + shank]]]), round(360.0 / facet))


def upside_down(name):
    """A punch of the demos, which rises into its sheet, as one that presses downwards."""
    punch = ff.read_stl(ROOT / "meshes" / f"{name}.stl")
    return ff.Triangles(punch.points * [1.0, 1.0, -1.0], punch.cells[:, ::-1])


# The net against closed forms ---------------------------------------------------------------------


@pytest.mark.parametrize("warp", [90.0, 60.0])
def test_on_a_sphere_it_is_the_chebyshev_net(warp):
    """Similarity solution of sine-Gordon, at 90 and 60 degrees; second order, by chords."""
    errors = []
    for spacing in (6.0, 3.0, 1.5):
        found = net(Dome(), spacing, 72.0, quarter=True, warp_angle=warp)
        xi = found.u[:, None] * found.v / RADIUS**2
        exact = reference.chebyshev_angle(xi, np.radians(warp))
        # On the net's own edge the tows' directions are one-sided.
        errors.append(np.abs(np.degrees(found.angle - exact))[:-1, :-1].max())
        assert found.extension < 1e-12
    assert (orders(errors) > 1.9).all(), errors
    assert errors[-1] < 0.02


def test_the_other_quarters_of_an_oblique_net():
    """Where the flat tows meet at 120 degrees, the angle still falls: ω(0) = 120 degrees there."""
    found = net(Dome(), 3.0, 60.0, warp_angle=60.0)
    xi = np.abs(found.u[:, None] * found.v) / RADIUS**2
    obtuse = found.u[:, None] * found.v < 0.0
    exact = np.pi - reference.chebyshev_angle(xi, np.radians(120.0))
    np.testing.assert_allclose(found.angle[obtuse], exact[obtuse], atol=2e-3)


def test_a_surface_that_can_be_unrolled_shears_nothing():
    """On a cylinder the net is the flat one rolled up, whatever its direction: order 2 in h/R."""
    errors = []
    for spacing in (8.0, 4.0):
        found = net(Dome(along_x=0.0), spacing, 80.0, warp_angle=120.0, weft_angle=30.0)
        errors.append(np.degrees(np.abs(found.shear)).max())
        arc = RADIUS * np.arctan2(found.place[..., 1], -found.place[..., 2])
        assert found.place[..., 0] == pytest.approx(found.flat[..., 0], abs=spacing**2 / 20.0)
        assert arc == pytest.approx(found.flat[..., 1], abs=spacing**2 / 20.0)
    assert orders(errors)[0] > 1.9 and errors[1] < 0.1


def test_it_ends_where_the_tows_lie_side_by_side():
    """ω falls to 0 at ξ = 1.98 on a sphere; the exact net goes no further, nor does this."""
    found = net(Dome(), 2.0, 130.0, quarter=True)
    xi = found.u[:, None] * found.v / RADIUS**2
    exact = np.degrees(reference.chebyshev_angle(xi))
    there = ~np.isnan(found.place[..., 0])
    # Ended crossings take with them what lies behind them only: ξ grows along both tows.
    assert there[exact > 6.0].all() and not there[exact < -3.0].any()
    assert np.array_equal(found.ended, ~there) and found.ended.any()
    reliable = exact > 15.0
    np.testing.assert_allclose(np.degrees(found.angle)[reliable], exact[reliable], atol=1.0)
    assert np.nanmin(np.degrees(found.angle)) > 0.0


def test_it_ends_where_the_surface_does():
    found = net(Dome(rim=-30.0), 3.0, 90.0)
    there = ~np.isnan(found.place[..., 0])
    assert found.place[there][:, 2].max() < -30.0
    # The principal tow leaves at the arc R acos(30/R); chords are a little shorter.
    end = found.u[there[:, found.v == 0.0][:, 0]].max()
    assert end == pytest.approx(RADIUS * np.arccos(30.0 / RADIUS), abs=3.1)
    assert np.isnan(found.at(found.shear, [[85.0, 0.0], [0.0, 200.0]])).all()


# The formed surface -------------------------------------------------------------------------------


def test_the_formed_hemisphere_is_a_smooth_distance():
    """Value and gradient fit, the gradient is a unit vector, and both go on across the seams."""
    rng = np.random.default_rng(5)
    x = rng.uniform([-130.0, -130.0, -66.0], [130.0, 130.0, 2.0], (4000, 3))
    value, gradient = FORMED.level(x)
    x, value, gradient = (a[np.abs(value) < 4.0] for a in (x, value, gradient))
    assert np.linalg.norm(gradient, axis=1) == pytest.approx(1.0, abs=1e-12)
    e = 1e-5
    for i, step in enumerate(e * np.eye(3)):
        slope = (FORMED.level(x + step)[0] - FORMED.level(x - step)[0]) / (2.0 * e)
        np.testing.assert_allclose(slope, gradient[:, i], atol=1e-5)
    on_punch, on_edge, on_flange = [0.0, 0.0, -65.0], [83.0, 0.0, 0.0], [0.0, 95.0, 0.0]
    on_edge[2] = -10.0 + np.sqrt(100.0 - 49.0)
    np.testing.assert_allclose(
        FORMED.level(np.array([on_punch, on_edge, on_flange]))[0], 0.0, atol=1e-12
    )


@pytest.mark.parametrize("depth", [0.0, 1.0, 30.0, 86.2])
def test_the_cone_touches_punch_and_edge(depth):
    """Its ends lie on both circles, and its slope is that of their tangents there."""
    formed = ff.FormedHemisphere(RADIUS, 80.0, 10.0, depth)
    slope = formed.slope
    start = np.array([RADIUS * np.sin(slope), RADIUS * (1.0 - np.cos(slope)) - depth])
    end = np.array([90.0 - 10.0 * np.sin(slope), 10.0 * np.cos(slope) - 10.0])
    assert end - start == pytest.approx(formed.span * np.array([np.cos(slope), np.sin(slope)]))


def test_five_angles_of_an_independent_net():
    """An independently written net of 1 mm on the same surface, given to 0.1 degrees.

    The differences between 4, 2 and 1 mm halve twice: what is left at 1 mm is below 0.1.
    """
    case = ff.load_case(DEMO)
    places = [[point.x_mm, point.y_mm] for point in case.points]
    independent = [52.3, 63.9, 87.4, 64.0, 72.5]
    found = net(FORMED, 1.0, quarter=True)
    angles = 90.0 - found.at(np.degrees(np.abs(found.shear)), places)
    assert angles == pytest.approx(independent, abs=0.1)
    assert found.extension < 1e-12
    assert np.abs(FORMED.level(found.place.reshape(-1, 3))[0]).max() < 1e-10
    # As a case, with the whole sheet and a coarser net.
    assert known_angles(case, ROOT) == pytest.approx(independent, abs=0.3)


# Invariance ---------------------------------------------------------------------------------------


def test_a_ply_turned_on_a_surface_of_revolution_is_the_net_turned():
    straight = net(FORMED, 6.0)
    turned = net(FORMED, 6.0, warp_angle=127.0, weft_angle=37.0)
    c, s = np.cos(np.radians(37.0)), np.sin(np.radians(37.0))
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(turned.place, straight.place @ turn.T, atol=1e-9)
    np.testing.assert_allclose(turned.shear, straight.shear, atol=1e-9)


def test_a_quarter_turn_swaps_the_families():
    one = net(FORMED, 6.0, 144.0, 96.0)
    other = net(FORMED, 6.0, 96.0, 144.0, warp_angle=180.0, weft_angle=90.0)
    # The turned ply's weft lies where the warp was, its warp against where the weft was.
    np.testing.assert_allclose(other.place, one.place.swapaxes(0, 1)[:, ::-1], atol=1e-9)
    np.testing.assert_allclose(other.shear, -one.shear.T[:, ::-1], atol=1e-9)


def test_mirrored_and_by_quarters():
    whole = net(FORMED, 6.0, 144.0, 96.0)
    np.testing.assert_allclose(whole.place[::-1], whole.place * [-1.0, 1.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(whole.shear[:, ::-1], -whole.shear, atol=1e-9)
    quarter = net(FORMED, 6.0, 144.0, 96.0, quarter=True)
    middle = (len(whole.u) // 2, len(whole.v) // 2)
    np.testing.assert_allclose(quarter.place, whole.place[middle[0] :, middle[1] :], atol=1e-12)


def test_a_punch_off_the_sheets_centre():
    """The same net, of which the sheet is another part: its places and angles move with it."""
    centred = ff.kinematic_net(ff.load_case(DEMO), spacing=6.0)
    case = ff.load_case(DEMO, ["symmetry=none", "punch_offset_x_mm=24", "punch_offset_y_mm=-12"])
    moved = ff.kinematic_net(case, spacing=6.0)
    assert moved.u[[0, -1]] == pytest.approx([-168.0, 120.0])
    assert moved.flat[0, 0] == pytest.approx([-144.0, -144.0])
    places, shift = np.array([[40.0, 30.0], [-70.0, 80.0]]), np.array([24.0, -12.0, 0.0])
    there = moved.at(moved.place, places + shift[:2]) - shift
    np.testing.assert_allclose(there, centred.at(centred.place, places), atol=1e-9)


def test_the_sheet_is_cut_along_its_outline():
    weave = "weave={outline: circle, warp_angle_deg: 45, weft_angle_deg: -45}"
    found = ff.kinematic_net(ff.load_case(DEMO, ["symmetry=none", weave]), spacing=6.0)
    radius = np.linalg.norm(found.flat, axis=2)
    assert np.array_equal(found.sheet, radius < 144.0 + 1e-6)
    # Tows at ±45 degrees: what shears lies on the axes, and not on the diagonals.
    low, high = found.at(np.abs(found.shear), [[72.0, 72.0], [102.0, 0.0]])
    assert low < 1e-6 and np.degrees(high) == pytest.approx(37.0, abs=1.5)


# Punches from triangles ---------------------------------------------------------------------------


@pytest.mark.parametrize("depth", [20.0, 65.0])
def test_a_hemisphere_from_triangles_is_that_of_the_formula(depth):
    """To what its facets of 2 degrees sink, R (1 − cos 1°) = 0.01 mm, and the raster of 0.6 mm."""
    formed = ff.FormedHemisphere(RADIUS, 80.0, 10.0, depth)
    seen = ff.FormedMould.of(bullet(20.0), ff.round_die(80.0, 10.0), depth)
    exact, found = (net(surface, 6.0) for surface in (formed, seen))
    off = formed.level(found.place.reshape(-1, 3))[0]
    assert np.abs(off).max() < 0.02
    assert np.degrees(np.abs(found.shear - exact.shear)).max() < 0.15
    assert found.extension < 1e-12
    x = found.place[::9, ::9].reshape(-1, 3) + np.array([0.1, 0.2, 0.3])
    _, gradient = seen.level(x)
    for i, step in enumerate(1e-4 * np.eye(3)):
        slope = (seen.level(x + step)[0] - seen.level(x - step)[0]) / 2e-4
        np.testing.assert_allclose(slope, gradient[:, i], atol=1e-4)


@pytest.mark.parametrize(("name", "half"), [("double_dome", (144.0, 108.0)), ("box", (120.0,) * 2)])
def test_moulds_of_the_demos(name, half):
    """Upright walls and hollows: the net is whole, symmetric, and lies between the tools."""
    plate = ff.read_stl(ROOT / "meshes" / f"{name}_plate.stl")
    formed = ff.FormedMould.of(upside_down(name), plate, 46.0)
    found = net(formed, 4.0, *half)
    assert not found.ended.any() and found.extension < 1e-12
    shear, place = np.degrees(found.shear), found.place
    # The file's triangles are symmetric but for the diagonals of its quadrangles.
    for mirrored in (shear[::-1], shear[:, ::-1]):
        np.testing.assert_allclose(mirrored, -shear, atol=0.3)
    # Between the domes K < 0 and geodesics drift apart, so that this shows in the places too.
    np.testing.assert_allclose(place[::-1], place * [-1.0, 1.0, 1.0], atol=0.3)
    if name == "box":
        np.testing.assert_allclose(shear, shear.T, atol=1e-3)
    assert 30.0 < np.abs(shear).max() < 80.0
    assert place[..., 2].min() > -46.01 and place[..., 2].max() < 0.01
    assert place[0, 0, 2] == pytest.approx(0.0, abs=1e-9)
    # Nowhere inside the punch: its signed distance is that of the sheet's other side.
    from fabric_fenicsx.geometry.distance import exact_distance

    punch = upside_down(name)
    inside = exact_distance(punch, place.reshape(-1, 3) + np.array([0.0, 0.0, 46.0]))
    assert inside.min() > -0.15


def test_upright_walls_keep_the_tows_on_them():
    """A tall bullet in a tight hole: the principal tow's length is a quarter circle and a wall."""
    formed = ff.FormedMould.of(bullet(100.0, 3.0), ff.round_die(RADIUS + 1.0, 5.0), 150.0)
    found = net(formed, 2.0, 220.0, 8.0, quarter=True)
    wall = found.place[:, 0]
    on_it = (wall[:, 2] > -150.0 + RADIUS + 2.0) & (wall[:, 2] < -7.0)
    arc = found.u[on_it] - RADIUS * np.pi / 2.0
    assert arc == pytest.approx(wall[on_it, 2] + 150.0 - RADIUS, abs=0.1)


# The command --------------------------------------------------------------------------------------


def command(capsys, *arguments):
    with pytest.raises(SystemExit) as end:
        main(["kinematic", *map(str, arguments)])
    captured = capsys.readouterr()
    return end.value.code or 0, captured.out, captured.err.strip()


def test_the_command_writes_what_it_says(tmp_path, capsys):
    code, out, _ = command(capsys, DEMO, "--out", tmp_path, "--spacing", "6")
    assert code == 0
    for text in ("x [mm]", "kinematic net [°]", "measured [°]", "71.2", "largest shear", "draw in"):
        assert text in out
    table = pd.read_csv(tmp_path / "kinematic.csv")
    assert list(table) == ["x0", "y0", "x", "y", "z", "shear_deg"]
    found = ff.kinematic_net(ff.load_case(DEMO), spacing=6.0)
    assert len(table) == found.sheet.sum() == 49**2
    np.testing.assert_allclose(table[["x", "y", "z"]], found.place.reshape(-1, 3), atol=1e-4)
    surface = pv.read(tmp_path / "kinematic.vtp")
    assert surface.n_cells == 48**2
    np.testing.assert_allclose(surface["shear_deg"], table["shear_deg"], atol=1e-4)
    assert (tmp_path / "kinematic.png").stat().st_size > 20000


def test_the_command_says_where_the_net_ends(tmp_path, capsys):
    """Walls all but upright: ω falls to (π/2) cos 89.9° at their foot, less than a degree."""
    write_stl(tmp_path / "bullet.stl", bullet(150.0, 5.0))
    (tmp_path / "deep.yaml").write_text(
        "{test: drape, symmetry: none, punch_stl: bullet.stl, hole_radius_mm: 76.4, "
        "edge_radius_mm: 5, punch_travel_mm: 200, sheet: {width_mm: 560, length_mm: 560}}"
    )
    code, out, line = command(capsys, tmp_path / "deep.yaml", "--out", tmp_path, "--spacing", "8")
    assert code == 1 and "largest shear" in out
    assert "the net ends at x = " in line and "\n" not in line
    assert not pd.read_csv(tmp_path / "kinematic.csv").isna().any().any()


WRONG = {
    "no drape": ([ROOT / "demos" / "picture_frame.yaml"], "test: picture_frame"),
    "a mesh": ([DEMO, "--set", "mesh=a.msh"], "mesh: a kinematic net takes"),
    "spacing": ([DEMO, "--spacing", "0"], "spacing: 0 mm, allowed is above 0"),
    "too coarse": ([DEMO, "--spacing", "21"], "at most a quarter of the hole's radius, 20"),
    "too fine": ([DEMO, "--spacing", "0.01"], "crossings, allowed are"),
    "punch and hole": (
        [DEMO, "--set", "punch_radius_mm=90", "--set", "punch_travel_mm=40"],
        "punch_radius_mm: ",
    ),
    "no file": ([DEMO, "--set", "punch_stl=none.stl"], "none.stl"),
    "beside the sheet": (
        [DEMO, "--set", "symmetry=none", "--set", "punch_offset_x_mm=150"],
        "punch_offset_x_mm, punch_offset_y_mm: the axis misses",
    ),
    "punch in the die": (
        [DEMO, "--set", f"punch_stl={ROOT / 'meshes' / 'box.stl'}", "--set", "hole_radius_mm=40"],
        "punch and die meet",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_bad_input_is_one_line(name, tmp_path, capsys):
    arguments, expected = WRONG[name]
    code, out, line = command(capsys, *arguments, "--out", tmp_path / "made")
    assert code == 2 and expected in line and str(arguments[0]) in line
    assert "\n" not in line and not out and not (tmp_path / "made").exists()


def test_nets_and_surfaces_that_cannot_be():
    side = stations(10.0, 1.0)
    for u, v, angles, words in (
        (side[:2], side, {}, "three or more"),
        (side + 0.5, side, {}, "0 among them"),
        (side, side[::-1], {}, "increasing"),
        (side, side, {"warp_angle": 0.0}, "to the left of the weft"),
    ):
        with pytest.raises(ValueError, match=words):
            ff.net_on_surface(FORMED, u, v, **angles)
    with pytest.raises(ValueError, match="allowed is 0 to 86"):
        ff.FormedHemisphere(RADIUS, 80.0, 10.0, 90.0)
    die = ff.round_die(80.0, 10.0)
    beside = ff.Triangles(bullet(20.0).points + np.array([300.0, 0.0, 0.0]), bullet(20.0).cells)
    raised = ff.Triangles(die.points + np.array([0.0, 0.0, 3.0]), die.cells)
    half = ff.Triangles(die.points, die.cells[(die.points[die.cells, 0] > 0.0).all(axis=1)])
    for punch, plate, depth, words in (
        (bullet(20.0), die, 0.0, "above 0"),
        (beside, die, 20.0, "misses the punch"),
        (bullet(20.0), raised, 20.0, "z = 3 mm"),
        (bullet(20.0), half, 20.0, "does not surround"),
        (bullet(20.0), lathe([[90.0, 0.0], [120.0, 0.0]]), 20.0, "no rounded edge"),
    ):
        with pytest.raises(ValueError, match=words):
            ff.FormedMould.of(punch, plate, depth)
    with pytest.raises(InputError, match="needs drape"):
        ff.kinematic_net(ff.make_case("cantilever"))
