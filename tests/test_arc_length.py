"""Continuation through limit points: a truss and an arch that snap through, a tow that buckles."""

import numpy as np
import pytest
from scipy.special import ellipk
from solve import GivenSection, set_loads

from fabric_fenicsx.errors import SolveError
from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.solving.arc_length import ArcLength
from fabric_fenicsx.solving.generalised_alpha import GeneralisedAlpha
from fabric_fenicsx.solving.model import Model, Support


def displacement(model):
    disc = model.disc
    return disc.gather_nodes(disc.tows.u_n.x.array.reshape(-1, 3)[: disc.owned])


def truss(load, **options):
    """Half of a two-bar truss: one cell from (0, 0) to the apex at (100, 10) on a roller."""
    points = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 10.0]])
    section = GivenSection((5e4, 2e4, 2e4, 1e3, 1e3, 1e3))
    out_of_plane = Support(np.array([0, 1]), (1, 3, 5))
    supports = [Support(np.array([0]), (0, 2)), Support(np.array([1]), (0,)), out_of_plane]
    normal = np.array([-10.0, 0.0, 100.0]) / np.hypot(10.0, 100.0)
    model = Model(single_tow(points, normal), section, supports=supports)
    path = ArcLength(model, lambda factor: load(model, factor), force_tolerance=1e-8, **options)
    return model, path


def truss_path():
    """Deflections [mm] of the apex through both limit points, with the load's found and exact [N].

    P(w) = EA (l/L − 1)(w − h)/l with l² = a² + (h − w)².
    """
    a, h, EA = 100.0, 10.0, 5e4
    model, path = truss(lambda m, f: set_loads(m, 1, [0, 0, -f, 0, 0, 0]), length=0.7, largest=1.0)
    w, P = [0.0], [0.0]
    while w[-1] < 2.3 * h:
        P.append(path.step().factor)
        w.append(-displacement(model)[1, 2])
    w, P = np.array(w), np.array(P)
    L, current = np.hypot(a, h), np.hypot(a, h - w)
    return w, P, EA * (current / L - 1.0) * (w - h) / current


def test_two_bar_truss_snaps_through():
    """Both limit points and the way down.

    A straight bar with free ends: any model of it has this path, to the solver's tolerance.
    """
    w, P, exact = truss_path()
    assert pytest.approx(exact, abs=1e-6) == P
    assert (np.diff(w) > 0.0).all()
    # EA (h/L)³ is 49.26 N.
    assert P.min() < -0.19 * 49.26 and P.max() > 0.19 * 49.26
    assert np.abs(np.diff(w)).max() <= 1.0 + 1e-8


def test_a_step_that_cannot_converge_is_cut_and_then_given_up():
    model, path = truss(
        lambda m, f: set_loads(m, 1, [0, 0, -f, 0, 0, 0]), length=0.5, smallest=0.1, limit=1
    )
    with pytest.raises(SolveError, match=r"no step of 0\.1 mm converges"):
        path.step()
    assert displacement(model) == pytest.approx(0.0)


def test_inertia_is_refused():
    net = single_tow(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), (0.0, 0.0, 1.0))
    section = GivenSection((1.0,) * 6)
    model = Model(net, section, inertia=GeneralisedAlpha(0.5))
    with pytest.raises(ValueError, match="inertia"):
        ArcLength(model, length=1.0, force_tolerance=1e-8)


def arch_limit(cells):
    """Largest P R²/EI on the path of the clamped-hinged arch of 215° under a load at its crown."""
    R, EI = 100.0, 1e6
    angle = np.radians(215.0) * (np.linspace(0.0, 1.0, cells + 1) - 0.5)
    points = R * np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle)])
    middles = (points[1:] + points[:-1]) / 2.0
    net = single_tow(points, middles / np.linalg.norm(middles, axis=1)[:, None])
    # Inextensible within 1e-6: E A R²/E I = 1e6.
    section = GivenSection((1e8, 5e7, 5e7, 1e6, EI, EI))
    supports = [
        Support(np.array([0]), (0, 1, 2, 3, 4, 5)),
        Support(np.array([cells]), (0, 2)),
        Support(np.arange(cells + 1), (1, 3, 5)),
    ]
    model = Model(net, section, supports=supports)
    crown = cells // 2
    path = ArcLength(
        model,
        lambda factor: set_loads(model, crown, [0, 0, -factor * EI / R**2, 0, 0, 0]),
        length=30.0,
        largest=60.0,
        force_tolerance=1e-4,
    )
    w, P = [0.0], [0.0]
    while P[-1] >= P[-2:][0]:
        path.largest = 60.0 if P[-1] < 8.5 else 4.0
        P.append(path.step().factor)
        w.append(-displacement(model)[crown, 2])
    a, b, c = np.polyfit(np.array(w[-3:]) - w[-2], P[-3:], 2)
    return c - b**2 / (4.0 * a)


def test_clamped_hinged_arch():
    """P R²/EI = 8.97 at the limit point (DaDeppo & Schmidt, J. Appl. Mech. 42 (1975)).

    Of the arch's length only the polygon's chord is there, an error of second order: 40 and 80
    cells, extrapolated. Three digits of the reference are known.
    """
    coarse, fine = (arch_limit(cells) for cells in (40, 80))
    assert 8.97 < fine < coarse
    assert (4.0 * fine - coarse) / 3.0 == pytest.approx(8.97, abs=0.005)


def buckled():
    """Angles α [rad] at a buckled tow's free end, its load over Euler's, and the elastica's.

    P/P_c = (2 K(sin α/2)/π)². A clamped tow whose section is 50 times stiffer out of the plane; a
    side load of 1e-4 P_c starts it. Displacements out of the plane [mm] come last.
    """
    L, cells, EI = 100.0, 40, 1e3
    x = np.linspace(0.0, L, cells + 1)
    net = single_tow(np.column_stack([x, 0.0 * x, 0.0 * x]), (0.0, 0.0, 1.0))
    section = GivenSection((5e4, 5e4, 5e4, 1e3, 50.0 * EI, EI))
    model = Model(net, section, supports=[Support(np.array([0]), (0, 1, 2, 3, 4, 5))])
    critical = np.pi**2 * EI / (4.0 * L**2)

    def load(factor):
        set_loads(model, cells, [-factor * critical, 1e-4 * factor * critical, 0, 0, 0, 0])

    path = ArcLength(model, load, length=0.5, largest=8.0, force_tolerance=1e-9)
    found = []
    while not found or found[-1][0] < np.radians(80.0):
        factor = path.step().factor
        end = model.disc.gather_nodes(
            model.disc.tows.q_n.x.array.reshape(-1, 4)[: model.disc.owned]
        )[cells]
        # The turn is about z. The load is turned by 1e-4, which is added to the end's angle.
        found.append((2.0 * np.arctan2(end[3], end[0]) + 1e-4, factor))
    alpha, P = np.array(found).T
    exact = (2.0 * ellipk(np.sin(alpha / 2.0) ** 2) / np.pi) ** 2
    return alpha, P, exact, displacement(model)[:, 2]


@pytest.mark.mpi
def test_a_tow_buckles_in_the_plane_of_the_sheet():
    """Euler's load and the elastica beyond it.

    The path turns sharply at P_c, where load control would need luck. Shear and stretch make up
    EI/(L² κGA) = 2e-6.
    """
    alpha, P, exact, out_of_plane = buckled()
    far = alpha > np.radians(15.0)
    assert far.sum() >= 6
    assert P[far] == pytest.approx(exact[far], rel=1e-3)
    assert np.abs(out_of_plane).max() < 1e-9
