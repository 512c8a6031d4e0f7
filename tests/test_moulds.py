"""Tools from STL files against the analytic sphere: distance, contact and a small drape."""

from functools import cache
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
import pyvista as pv
from solve import GivenSection, Statics, orders, plain_net, set_state

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.geometry.distance import DistanceGrid, exact_distance
from fabric_fenicsx.geometry.triangles import Triangles, read_stl, write_stl
from fabric_fenicsx.mechanics.tools import Mould, Sphere
from fabric_fenicsx.rigs.drape import DrapeCase, tools
from fabric_fenicsx.solving.contacts import ContactLaw
from fabric_fenicsx.solving.model import Model, Support
from fabric_fenicsx.solving.parts import CrossoverLaw

MESHES = Path(__file__).parents[1] / "meshes"
RADIUS = 30.0
SECTION = GivenSection((4000.0, 1500.0, 1500.0, 60.0, 50.0, 900.0))
CROSSOVERS = CrossoverLaw(translation=100.0, k1=5.0, k3=2.0, dashpot=0.0, alignment=100.0)


def ball(level, radius=RADIUS):
    """A sphere of 20 · 4^level triangles whose corners lie on it."""
    body = pv.Icosphere(radius=radius, nsub=level)
    return Triangles(np.array(body.points, float), body.faces.reshape(-1, 4)[:, 1:].astype(int))


def around_the_surface(n=400, depth=4.0):
    """Random points near the sphere, (n, 3), and their distances."""
    rng = np.random.default_rng(3)
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    d = rng.uniform(-depth, depth, n)
    return direction * (RADIUS + d)[:, None], d


# Distance on the grid -----------------------------------------------------------------------------


def test_spline_of_a_smooth_distance_converges():
    """Cubic splines: order 4 in the distance, 3 in its gradient, 2 in its second derivatives.

    The values on the grid are exact here; the largest error, in the bulk of the grid.
    """
    x, d = around_the_surface()
    r = np.linalg.norm(x, axis=1)
    n = x / r[:, None]
    H = (np.eye(3) - n[:, :, None] * n[:, None, :]) / r[:, None, None]
    errors = []
    for cell in (4.0, 2.0, 1.0):
        axis = np.arange(-44.0, 44.0 + cell / 2.0, cell)
        X = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
        grid = DistanceGrid.from_values(
            np.full(3, -44.0), cell, np.linalg.norm(X, axis=-1) - RADIUS
        )
        found = grid.evaluate(x)
        errors.append([np.abs(f - e).max() for f, e in zip(found, (d, n, H), strict=True)])
    for column, order in zip(np.array(errors).T, (4.0, 3.0, 2.0), strict=True):
        assert orders(column)[-1] > order - 0.35
    assert errors[-1][0] < 1e-5


def test_derivatives_are_those_of_the_distance():
    """Gradient and second derivatives against differences of the spline: Newton relies on them."""
    grid = DistanceGrid.of(ball(2), 4.0, 4.0)
    x, _ = around_the_surface(40)
    _, gradient, hessian = grid.evaluate(x)
    e = 1e-4
    for i, step in enumerate(e * np.eye(3)):
        above, below = grid.evaluate(x + step), grid.evaluate(x - step)
        assert (above[0] - below[0]) / (2 * e) == pytest.approx(gradient[:, i], abs=1e-7)
        difference = (above[1] - below[1]) / (2 * e)
        np.testing.assert_allclose(difference, hessian[:, :, i], atol=1e-6)


def test_distance_of_the_triangles_converges_with_them():
    """A sphere's facets sink by s²/8R: order 2 in their size s; inside and outside alike."""
    x, d = around_the_surface()
    errors = [np.abs(exact_distance(ball(level), x) - d).max() for level in (2, 3, 4)]
    assert orders(errors) == pytest.approx(2.0, abs=0.3)


def test_signs_and_what_is_far_away():
    surface = ball(3)
    grid = DistanceGrid.of(surface, 3.0, 3.0)
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 28.0], [0.0, 0.0, 32.0], [300.0, -200.0, 0.0]])
    d, n, H = grid.evaluate(points)
    assert d[1:3] == pytest.approx([-2.0, 2.0], abs=0.2)
    assert d[0] < -25.0 and d[3] > 300.0
    assert n[2] == pytest.approx([0.0, 0.0, 1.0], abs=0.05)
    assert np.all(H[3] == 0.0)
    # Turned inside out it is a cavity.
    inside = exact_distance(surface.reversed(), points[:3])
    assert inside == pytest.approx(-exact_distance(surface, points[:3]))
    assert surface.closed and surface.volume > 0.0 > surface.reversed().volume


def test_an_open_sheet_has_the_side_of_its_normals():
    plane = pv.Plane(i_size=40.0, j_size=40.0, i_resolution=8, j_resolution=8).triangulate()
    cells = plane.faces.reshape(-1, 4)[:, 1:].astype(int)
    sheet = Triangles(np.array(plane.points, float), cells)
    up = float(np.sign(sheet.area_vectors[:, 2].mean()))
    assert not sheet.closed
    x = np.array([[1.0, 2.0, 1.5], [3.0, -4.0, -0.5]])
    grid = DistanceGrid.of(sheet, 1.0, 4.0)
    d, n, _ = grid.evaluate(x)
    assert d == pytest.approx(up * x[:, 2], abs=1e-6)
    assert n[:, 2] == pytest.approx([up, up], abs=1e-6)
    reverse = DistanceGrid.of(sheet.reversed(), 1.0, 4.0)
    assert reverse.evaluate(x)[0] == pytest.approx(-up * x[:, 2], abs=1e-6)


def test_turned_over():
    """A mirrored plate is the plate at mirrored points."""
    plate = Mould.from_stl("holder", punch_path, MESHES / "box_plate.stl", cell=5.0)
    die = plate.turned_over("die", punch_path)
    x = np.random.default_rng(1).uniform([-150.0, -150.0, -30.0], [150.0, 150.0, 30.0], (50, 3))
    mirror = np.array([1.0, 1.0, -1.0])
    (d, n, H), (e, m, G) = plate.sample(x), die.sample(x * mirror)
    np.testing.assert_allclose(e, d, atol=1e-9)
    np.testing.assert_allclose(m, n * mirror, atol=1e-9)
    np.testing.assert_allclose(G, H * mirror * mirror[:, None], atol=1e-9)
    assert die.surface.volume == pytest.approx(plate.surface.volume) and die.surface.volume > 0.0


@pytest.mark.parametrize("path", sorted(MESHES.glob("*.stl")), ids=lambda path: path.name)
def test_moulds_of_the_demos(path):
    surface = read_stl(path)
    assert surface.closed and surface.volume > 0.0
    assert path.stat().st_size < 300_000


# Contact ------------------------------------------------------------------------------------------


def punch_path(time):
    """From 1 mm above the net's middle down by 7 mm, a little off the crossings."""
    return 37.0, 35.5, RADIUS + 1.0 - 7.0 * time


@cache
def mould(level, cell=1.5):
    """The ball as a punch."""
    surface = ball(level)
    return Mould("punch", punch_path, surface, DistanceGrid.of(surface, cell, 3.0))


def pressed_net(tool, comm=MPI.COMM_SELF, friction=0.2):
    """A net of 5 x 5 tows, its tows' ends held, under a tool."""
    net = plain_net(5, 5, 12.0, 2)
    supports = [Support(net.ends.ravel(), (0, 1, 2, 3, 4, 5))]
    return Model(
        net,
        SECTION,
        crossovers=CROSSOVERS,
        tools=[tool],
        contact_law=ContactLaw(2.0, 0.5, friction, 0.5),
        supports=supports,
        comm=comm,
    )


def pressed(tool, comm=MPI.COMM_SELF):
    """Displacements, force of the tool and iterations after five steps of the punch."""
    model = pressed_net(tool, comm)
    statics = Statics(model, force_tolerance=1e-9)
    statics.run(4)
    statics.step(0.05, keep=False)
    force = model.tool_forces()["punch"]
    statics.stepper.advance(0.05)
    return statics.displacements, force, [outcome.iterations for outcome in statics.outcomes]


@cache
def analytic():
    return pressed(Sphere("punch", punch_path, RADIUS))


def contact_forces(tool):
    """Forces of a tool and its friction on a bent net, and the tangent's change along a move."""
    model = pressed_net(tool)
    disc, system = model.disc, model.system
    net = model.net
    r = net.points[:, :2] - [36.0, 36.0]
    u = np.zeros((len(net.points), 3))
    u[:, 2] = -3.0 * np.exp(-np.sum(r**2, axis=1) / 400.0)
    q = np.zeros((len(u), 4))
    q[:, 0] = 1.0
    set_state(model, u, q)
    model.set_time(0.0, 1.0)
    x = disc.vector()
    w = np.zeros((len(u), 6))
    w[:, 0], w[:, 1] = 0.3, -0.1
    x.array[:] = w[disc.local_nodes[: disc.owned]].ravel()
    system.set_increment(x)
    names = ["punch", "punch friction"]
    return [disc.gather_nodes(system.term_forces(name)) for name in names]


def test_contact_forces_are_those_of_the_sphere():
    """Pressure and friction of each node: their error falls with the square of the facets.

    Nodes penetrate by up to 3 mm, where the pressure goes with d: the finest facets, which sink by
    up to 0.028 mm, change it by some 1 %, and turn it by up to 1.3/R = 0.04. Friction has the
    direction of the slip in the facets' planes: of the tool's 7 mm downwards a tilt of 0.04 makes
    0.3 mm of slip, against some 3 mm.
    """
    exact = contact_forces(Sphere("punch", punch_path, RADIUS))
    assert min(np.abs(f).max() for f in exact) > 0.05
    for k in range(2):
        errors = []
        for level in (2, 3, 4):
            found = contact_forces(mould(level, 1.5))[k]
            errors.append(np.linalg.norm(found - exact[k]) / np.linalg.norm(exact[k]))
        assert errors[-1] < (0.04, 0.1)[k]
        assert np.log2(errors[0] / errors[-1]) / 2.0 > 1.4


def test_drape_is_that_of_the_sphere():
    u, force, _ = analytic()
    assert u[:, 2].min() < -5.0
    errors, pulls = [], []
    for level in (2, 3, 4):
        found, pull, iterations = pressed(mould(level))
        errors.append(np.abs(found - u).max())
        pulls.append(pull)
        assert max(iterations) <= 12
    # A facet of 20 · 4^4 has a circumradius of 1.3 mm: it sinks by up to 1.3²/2R = 0.028 mm.
    assert errors[-1] < 0.028
    assert np.log2(errors[0] / errors[-1]) / 2.0 > 1.4
    # Sunk facets pull less, by the square of their size; they tilt by up to 1.3/R = 0.04, here one
    # way and there another.
    pull = pulls[-1] + (pulls[-1] - pulls[-2]) / 3.0
    assert np.abs(pull - force).max() < 0.01 * np.linalg.norm(force)


def test_newton_converges_quadratically():
    """The tangent holds the second derivatives: no more iterations than with the analytic tool."""
    iterations = pressed(mould(4))[2]
    assert sum(iterations) <= sum(analytic()[2]) + 5


@pytest.mark.mpi
def test_drape_does_not_depend_on_the_ranks():
    together, force, _ = pressed(mould(3), MPI.COMM_WORLD)
    alone, force_alone, _ = pressed(mould(3))
    np.testing.assert_allclose(together, alone, atol=1e-8)
    assert force == pytest.approx(force_alone, abs=1e-7)


# Files --------------------------------------------------------------------------------------------


def test_stl_there_and_back(tmp_path):
    """Binary, as written here, and ASCII, as others write it: single precision, nothing else."""
    surface = ball(1)
    write_stl(tmp_path / "ball.stl", surface)
    again = read_stl(tmp_path / "ball.stl")
    assert (len(again.points), len(again.cells)) == (len(surface.points), len(surface.cells))
    assert again.closed
    assert again.volume == pytest.approx(surface.volume, rel=1e-6)
    assert (tmp_path / "ball.stl").stat().st_size == 84 + 50 * len(surface.cells)
    pv.read(tmp_path / "ball.stl").save(tmp_path / "text.stl", binary=False)
    assert read_stl(tmp_path / "text.stl").volume == pytest.approx(surface.volume, rel=1e-5)


def binary(triangles):
    """A binary STL of any triangles (m, 3, 3)."""
    records = b"".join(
        np.float32(np.vstack([np.zeros(3), t])).tobytes() + b"\0\0" for t in np.array(triangles)
    )
    return bytes(80) + np.uint32(len(triangles)).tobytes() + records


A, B, C, D, E = np.vstack([np.zeros(3), np.eye(3), [1.0, 1.0, 1.0]])
WRONG = {
    "not an STL file": b"$MeshFormat\n4.1 0 8\n",
    "no triangles": binary([]),
    "has no triangles": b"solid nothing\nendsolid nothing\n",
    "not finite": binary([[A, B, [np.nan, 0.0, 0.0]]]),
    "oriented against each other": binary([[A, B, C], [A, B, D]]),
    "more than two triangles": binary([[A, B, C], [B, A, D], [A, B, E]]),
    "neither a binary nor an ASCII": binary([[A, B, C]])[:-1],
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_files_are_named(tmp_path, text):
    path = tmp_path / "wrong.stl"
    path.write_bytes(WRONG[text])
    with pytest.raises(InputError, match=text) as error:
        Mould.from_stl("punch", punch_path, path)
    assert "wrong.stl" in str(error.value) and "\n" not in str(error.value)


def test_missing_file():
    with pytest.raises(InputError, match=r"nowhere\.stl: cannot be read") as error:
        read_stl("nowhere.stl")
    assert "\n" not in str(error.value)


def test_punch_of_a_case(tmp_path):
    """A case's STL counts from its folder; its lowest point meets the sheet at the start."""
    write_stl(tmp_path / "ball.stl", ball(2))
    case = DrapeCase(test="drape", punch_stl="ball.stl", punch_cell_mm=4.0, punch_travel_mm=90.0)
    punch = tools(case, tmp_path)[0]
    assert isinstance(punch, Mould) and punch.grid.cell == 4.0
    lowest = punch.surface.points[:, 2].min()
    assert punch.path(0.0)[2] + lowest == pytest.approx(0.0, abs=1e-9)
    assert punch.path(case.duration_s)[2] + lowest == pytest.approx(-90.0)
    with pytest.raises(InputError, match=r"none\.stl: cannot be read"):
        tools(case.model_copy(update={"punch_stl": "none.stl"}), tmp_path)


def test_an_unsymmetric_punch_needs_the_whole_sheet(tmp_path):
    """A step along x in a quarter: the mirrored half would lie inside the punch."""
    body = pv.Box((-20.0, 20.0, -20.0, 20.0, -40.0, 0.0)).triangulate()
    body.points[:, 2] += 0.3 * body.points[:, 0]
    body.save(tmp_path / "step.stl")
    case = DrapeCase(test="drape", punch_stl="step.stl")
    with pytest.raises(InputError, match=r"punch_stl: step.stl: not symmetric about x = 0"):
        tools(case, tmp_path)
    assert tools(case.model_copy(update={"symmetry": "none"}), tmp_path)[0].name == "punch"
