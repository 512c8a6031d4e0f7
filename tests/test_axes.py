"""The directions of the tows where they cross, and the angles between them."""

from __future__ import annotations

import numpy as np
import pytest
from test_output import square

from fabric_fenicsx.fabric.axes import axes_shear, shear_at, tow_axes
from fabric_fenicsx.fabric.sheet import Sheet, centred_sheet
from fabric_fenicsx.rigs.common import mesh

SIZE = 96.0


def hill(x, y):
    """Displacements of a sheet that is symmetric about both planes, (n, 3)."""
    u = np.column_stack([2e-5 * x * y**2, -3e-5 * y * x**2, 20.0 * np.cos(x / 40) * np.cos(y / 30)])
    return u + np.column_stack([0.1 * x, -0.05 * y, 0.0 * x])


def exact_shear(x, y):
    """Angle from weft to warp short of 90 degrees [rad], of tows that were along y and x."""
    ones, zeros = np.ones_like(x), np.zeros_like(x)
    z_x = -0.5 * np.sin(x / 40) * np.cos(y / 30)
    z_y = -20.0 / 30.0 * np.cos(x / 40) * np.sin(y / 30)
    by_x = np.column_stack([1.1 * ones + 2e-5 * y**2, -6e-5 * y * x, z_x])
    by_y = np.column_stack([4e-5 * x * y, 0.95 * ones - 3e-5 * x**2, z_y + zeros])
    cosine = (by_x * by_y).sum(axis=1)
    return np.arcsin(cosine / np.linalg.norm(by_x, axis=1) / np.linalg.norm(by_y, axis=1))


def moved(spacing, *, quarter=False):
    """Net, places of its crossings on the flat sheet and their shear by the axes."""
    sheet = centred_sheet(SIZE, SIZE, spacing, spacing, subdivisions=2, quarter=quarter)
    net = mesh(sheet)
    axes = tow_axes(net, hill(*net.points[:, :2].T), symmetry=(0, 1) if quarter else ())
    return net, net.points[net.crossings].mean(axis=1)[:, :2], axes_shear(axes)


def test_the_angle_is_of_fourth_order_and_of_second_at_free_ends():
    """Against the closed form of a curved sheet, inside of the outer two crossings and there."""
    inner, outer = [], []
    for spacing in (8.0, 4.0):
        _, at, shear = moved(spacing)
        off = np.abs(shear - exact_shear(*at.T))
        far = np.abs(at).max(axis=1) > SIZE / 2.0 - 2.0 * spacing
        inner.append(off[~far].max())
        outer.append(off[far].max())
    orders = [np.log2(coarse / fine) for coarse, fine in (inner, outer)]
    assert orders[0] == pytest.approx(4.0, abs=0.3)
    assert orders[1] > 1.8


def test_a_quarter_has_the_angles_of_the_whole_sheet():
    """Beside the planes of symmetry too: there the tows go on as their images."""
    _, at, shear = moved(8.0, quarter=True)
    _, whole_at, whole = moved(8.0)
    right = (whole_at > 0.0).all(axis=1)
    a, b = np.lexsort(np.round(at, 6).T), np.lexsort(np.round(whole_at[right], 6).T)
    np.testing.assert_allclose(at[a], whole_at[right][b], atol=1e-9)
    np.testing.assert_allclose(shear[a], whole[right][b], atol=1e-12)


def test_crossings_in_the_plane_of_symmetry():
    """A quarter whose outer tows lie in the planes, against the sheet of which it is one."""
    quarter, whole = square(0.0, 96.0), square(-96.0, 96.0)
    shears = [
        axes_shear(tow_axes(net, hill(*net.points[:, :2].T), symmetry=planes))
        for net, planes in ((quarter, (0, 1)), (whole, ()))
    ]
    at, other = (net.points[net.crossings[:, 0], :2] for net in (quarter, whole))
    right = (other > -1e-9).all(axis=1)
    a, b = np.lexsort(np.round(at, 6).T), np.lexsort(np.round(other[right], 6).T)
    np.testing.assert_allclose(shears[0][a], shears[1][right][b], atol=1e-12)


def test_a_rigid_turn_and_waves_between_crossings_change_nothing():
    """Of waves with nodes in the crossings the axes see nothing, as a protractor."""
    net, _, shear = moved(8.0)
    places = net.points + hill(*net.points[:, :2].T)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turned = axes_shear(tow_axes(net, places @ turn.T - net.points))
    np.testing.assert_allclose(turned, shear, atol=1e-12)
    wavy = places - net.points
    between = np.setdiff1d(np.arange(len(net.points)), [*net.crossings.ravel(), *net.ends.ravel()])
    wavy[between, 0] += 3.0
    np.testing.assert_array_equal(axes_shear(tow_axes(net, wavy)), shear)


def test_one_crossing_takes_the_ends_of_its_tows():
    """Tows turned by 20 degrees towards each other: 40 degrees in closed form."""
    net = mesh(Sheet((-5.0, 5.0), (-5.0, 5.0), (0.0,), (0.0,)))
    turn = np.radians(20.0)
    u = np.zeros_like(net.points)
    x, y = net.points[:, 0], net.points[:, 1]
    u[:, 0] = x * (np.cos(turn) - 1.0) + y * np.sin(turn)
    u[:, 1] = x * np.sin(turn) + y * (np.cos(turn) - 1.0)
    np.testing.assert_allclose(axes_shear(tow_axes(net, u)), np.radians(40.0), atol=1e-12)


def test_points_between_crossings():
    """Interpolation is of second order or better; across an axis the angle changes its sign."""
    places = np.random.default_rng(5).uniform(0.0, SIZE / 2.0 - 8.0, (400, 2))
    worst = []
    for spacing in (8.0, 4.0):
        net, _, shear = moved(spacing, quarter=True)
        found = shear_at(net, shear, places, quarter=True)
        worst.append(np.abs(found - exact_shear(*places.T)).max())
        np.testing.assert_allclose(
            shear_at(net, shear, places * [-1.0, 1.0], quarter=True), -found, atol=1e-14
        )
        several = shear_at(net, np.column_stack([shear, -shear]), places, quarter=True)
        np.testing.assert_allclose(several, np.column_stack([found, -found]), atol=1e-14)
    assert np.log2(worst[0] / worst[1]) > 1.8
