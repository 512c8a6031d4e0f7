"""A net of stiff tows on a sphere: the Chebyshev net of two crossing great circles.

Tows that keep their length, turn freely at their crossings and slip nowhere make a Chebyshev net.
On a sphere of radius R, from two great circles that cross at right angles, the angle ω between the
tows depends on the arc lengths u and v along warp and weft by ξ = u v/R² alone (similarity solution
of the sine-Gordon equation ω_uv = −sin ω/R²):

    ξ ω″ + ω′ + sin ω = 0,    ω(0) = π/2,    ω′(0) = −1.

A quarter of a flat net is bent onto the sphere: its radius shrinks from infinity. The net lies
between two tools written here, as a user would write them, one inside and one outside; the planes
of symmetry make great circles of the middle tows. Nothing else tells the net where to go.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
import reference
import ufl
from solve import GivenSection, Statics, orders

from fabric_fenicsx.fabric.chains import net_from_lines
from fabric_fenicsx.solving.contacts import ContactLaw
from fabric_fenicsx.solving.model import Model, Support
from fabric_fenicsx.solving.parts import CrossoverLaw

#: Radius of the sphere, and how far from the middle tows angles are compared [mm]: to ξ = 0.89,
#: where the shear angle is 49 degrees.
RADIUS, COMPARED = 76.2, 72.0
#: The net goes on beyond that [mm], so that the free ends, where tows carry no moment, are outside.
BEYOND = 12.0
# Bending counts for little against stretch: EI/(EA h²) is 1e-8 of a cell of 3 mm.
STIFF = GivenSection((1e4, 1e4, 1e4, 1e-3, 1e-3, 1e-3))
TURNING = CrossoverLaw(translation=1e3, k1=0.0, k3=0.0, dashpot=0.0, alignment=1.0)
CONTACT = ContactLaw(stiffness=50.0, layer=0.1)
#: Of the two tools [mm]; it presses the net from both sides.
OVERLAP = 0.02


@dataclass(frozen=True)
class Ball:
    """A sphere that grows out of the plane z = 0, which it touches in the origin from below.

    The third number of its place is its curvature 1/R, so that it can begin as the plane. With
    ``side`` −1 it is the hollow around the ball. ``overlap`` moves the surface into the net.
    """

    name: str
    path: object
    side: float
    overlap: float

    def numbers(self):
        return {"side": self.side, "overlap": self.overlap}

    def distance(self, x, place, numbers):
        # |x − c| − R with c = (0, 0, −R), without the difference of two large numbers.
        curvature = place[2]
        s = curvature * ufl.dot(x, x) + 2.0 * x[2]
        outside = s / (1.0 + ufl.sqrt(1.0 + curvature * s))
        return numbers["side"] * outside - numbers["overlap"]

    def profile(self, extent):
        return np.zeros((2, 2))


def quarter_net(spacing):
    """A quarter of a net with the middle tows on its edges x = 0 and y = 0, a cell for each bay."""
    at = np.linspace(0.0, COMPARED + BEYOND, round((COMPARED + BEYOND) / spacing) + 1)
    lines, points = ([], []), []
    for family in (0, 1):
        for across in at:
            first = len(at) * len(points)
            xy = (0.0 * at + across, at)
            points.append(np.column_stack([*(xy if family == 0 else xy[::-1]), 0.0 * at]))
            nodes = first + np.arange(len(at))
            lines[family].append(np.column_stack([nodes[:-1], nodes[1:]]))
    return net_from_lines(np.vstack(points), *map(np.vstack, lines))[0]


def planes_of_symmetry(net):
    """Nodes on x = 0 stay there and turn about x only; likewise on y = 0."""
    on_x, on_y = (np.flatnonzero(net.points[:, axis] < 1e-9) for axis in (0, 1))
    return [Support(on_x, (0, 4, 5)), Support(on_y, (1, 3, 5))]


@cache
def on_the_sphere(spacing, section=STIFF, crossovers=TURNING, steps=20):
    """Model and displacements of the net on the sphere."""
    net = quarter_net(spacing)

    def curvature(time):
        return (0.0, 0.0, time / RADIUS)

    tools = [Ball("inside", curvature, 1.0, OVERLAP), Ball("outside", curvature, -1.0, OVERLAP)]
    model = Model(
        net,
        section,
        crossovers=crossovers,
        tools=tools,
        contact_law=CONTACT,
        supports=planes_of_symmetry(net),
    )
    statics = Statics(model, force_tolerance=1e-6, limit=40)
    statics.run(steps)
    model.system.set_increment(model.disc.vector())
    return model, statics.displacements


def angles(spacing, **options):
    """Shear angles [degrees] of the crossings compared, and the exact ones."""
    model, _ = on_the_sphere(spacing, **options)
    u, v, _ = model.net.points[model.net.crossings[:, 0]].T
    inside = np.maximum(u, v) < COMPARED + 1e-9
    exact = np.pi / 2.0 - reference.chebyshev_angle(u * v / RADIUS**2)
    found = np.abs(model.shear_angles())
    return np.degrees(found[inside]), np.degrees(exact[inside])


def errors(spacing, **options):
    """Largest and root-mean-square error of the shear angle [degrees]."""
    found, exact = angles(spacing, **options)
    off = found - exact
    return np.abs(off).max(), np.sqrt(np.mean(off**2))


def check_order(spacings):
    largest, rms = np.array([errors(s) for s in spacings]).T
    # A net of chords: its angles err with the square of the angle h/R that a chord spans.
    assert (orders(rms) > 1.9).all(), f"orders {orders(rms)}, errors {rms} degrees"
    assert (orders(largest) > 1.6).all(), f"orders {orders(largest)}, errors {largest} degrees"
    return largest[-1]


def test_the_net_lies_on_the_sphere_and_keeps_its_lengths():
    model, u = on_the_sphere(6.0)
    place = model.net.points + u
    off = np.linalg.norm(place - np.array([0.0, 0.0, -RADIUS]), axis=1) - RADIUS
    assert np.abs(off).max() < 1e-3
    stretch = model.disc.cell_values(model.fields.strain_n)[:, :3]
    assert np.abs(stretch).max() < 1e-5
    gaps = u[model.net.crossings[:, 0]] - u[model.net.crossings[:, 1]]
    assert np.abs(gaps).max() < 1e-3


def test_shear_angles_are_those_of_the_chebyshev_net():
    found, exact = angles(6.0)
    assert exact.max() == pytest.approx(49.007, abs=1e-3)
    # Of second order in h/R = 0.079 rad, the angle that a cell spans: (h/R)²/4 is 0.09 degrees.
    np.testing.assert_allclose(found, exact, atol=0.1)
    # Where it is sheared by 40 degrees at most; and not at all along the middle tows.
    np.testing.assert_allclose(found[exact < 40.0], exact[exact < 40.0], atol=0.07)
    np.testing.assert_allclose(found[exact == 0.0], 0.0, atol=1e-6)


def test_converges_with_the_spacing():
    assert check_order((12.0, 6.0)) < 0.1


@pytest.mark.slow
def test_converges_with_the_spacing_further():
    assert check_order((12.0, 6.0, 3.0)) < 0.03


def test_the_way_there_does_not_matter():
    for one, other in zip(angles(12.0), angles(12.0, steps=40), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5)


def test_tows_that_stretch_make_another_net():
    # The twin that must not fit: soft tows whose crossings resist the shear.
    soft = GivenSection((50.0, 50.0, 50.0, 10.0, 10.0, 10.0))
    rigid = CrossoverLaw(translation=1e3, k1=10.0, k3=0.0, dashpot=0.0, alignment=1.0)
    assert errors(12.0, section=soft, crossovers=rigid)[0] > 2.0
