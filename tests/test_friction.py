"""Coulomb friction: a tow on an incline and a tow over a drum, against their closed forms.

The drum is a tool written here, as a user would write one: a class with three methods.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from fabric_fenicsx import _dolfinx
from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.fabric.section import RectangularSection
from fabric_fenicsx.mechanics.contact import root
from fabric_fenicsx.mechanics.tools import HoledPlate
from fabric_fenicsx.solving import contacts
from fabric_fenicsx.solving.contacts import ContactLaw
from fabric_fenicsx.solving.generalised_alpha import GeneralisedAlpha
from fabric_fenicsx.solving.model import Model, Support
from fabric_fenicsx.solving.stepping import StepControl, Stepper

SECTION = RectangularSection(width=4.57, height=0.04, density=7e-9, C1=60000.0)
MU = 0.3
GRAVITY = 9810.0


def run(model, end, step, force_tolerance):
    newton = model.newton(force_tolerance=force_tolerance, limit=30)
    stepper = Stepper(model, newton, StepControl(first=step, smallest=step / 64, largest=step))
    stepper.run(end)
    return stepper


def displacement(model):
    disc = model.disc
    return disc.gather_nodes(disc.tows.u_n.x.array.reshape(-1, 3)[: disc.owned])


def on_an_incline(slope, end, step, radius=0.0):
    """Mean slip [mm] along the incline of a tow released from rest.

    The plane is the face of a holed plate whose hole is far away; gravity is turned instead of the
    plane. The tow starts at the penetration that carries its weight, d = sqrt(2 δ p / k), so that
    it does not bounce.
    """
    law = ContactLaw(stiffness=0.5, layer=0.5, friction=MU, stick_stiffness=0.5)
    weight = SECTION.density * SECTION.area * GRAVITY * np.cos(slope)
    depth = np.sqrt(2.0 * law.layer * weight / law.stiffness)
    plane = HoledPlate("plane", lambda time: (1e4, 0.0, depth), 1.0, 1.0, side=1.0)
    net = single_tow(
        np.column_stack([np.linspace(0.0, 30.0, 6), np.zeros((6, 2))]), (0.0, 0.0, 1.0)
    )
    model = Model(
        net,
        SECTION,
        gravity=(GRAVITY * np.sin(slope), 0.0, -GRAVITY * np.cos(slope)),
        inertia=GeneralisedAlpha(radius),
        tools=[plane],
        contact_law=law,
    )
    # Of a weight of 4e-4 N. Rounding leaves EA/h u ε = 1e4 N/mm · 47 mm · 2e-16 = 1e-10 N.
    run(model, end, step, force_tolerance=1e-9)
    return displacement(model)[:, 0].mean()


def test_slides_above_the_friction_angle():
    """Acceleration g (sin φ − μ cos φ), so the slip is half of it times t².

    The stick stretches by μ p / k_t = 0.3 · 1.1e-5 / 0.5 = 7e-6 mm before it slides: nothing
    against the slip of 47 mm. The run starts with v̇ = 0 although the tow accelerates at once, an
    error of first order: it halves with the step, and extrapolating it away leaves the exact slip.
    """
    slope, end = np.radians(30.0), 0.2
    exact = GRAVITY * (np.sin(slope) - MU * np.cos(slope)) * end**2 / 2.0
    coarse, fine = (on_an_incline(slope, end, end / n) for n in (40, 80))
    assert (coarse - exact) / (fine - exact) == pytest.approx(2.0, abs=0.1)
    assert 2.0 * fine - coarse == pytest.approx(exact, rel=1e-3)


def test_sticks_below_the_friction_angle():
    """Tan 16° = 0.287 < 0.3: nothing but the stretch of the stick, w sin φ / k_t per length."""
    slope = np.radians(16.0)
    weight = SECTION.density * SECTION.area * GRAVITY
    stretch = weight * np.sin(slope) / 0.5
    assert on_an_incline(slope, 1.0, 0.01) == pytest.approx(stretch, rel=0.05)


@dataclass(frozen=True)
class Drum:
    """A cylinder along y, its place on the axis."""

    name: str
    path: object
    radius: float

    def numbers(self):
        return {"radius": self.radius}

    def distance(self, x, place, numbers):
        r = x - place
        return root(r[0] ** 2 + r[2] ** 2) - numbers["radius"]

    def profile(self, extent):
        return np.zeros((2, 2))


def over_a_drum(cells, wrap=np.pi / 2.0, mu=MU, steps=40):
    """Pull at the far end over the dead load at the near one, while the tow slides.

    The tow lies on the drum from the start, the dead load T1 at its first end, and its other end is
    pulled along its tangent by 2 mm: far more than the stick and the tow stretch.
    """
    radius, tail, load = 50.0, 10.0, 0.5
    angle = np.linspace(0.0, wrap, cells + 1)
    arc = radius * np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle)])
    first = arc[0] - [tail, 0.0, 0.0]
    pull = np.array([np.cos(wrap), 0.0, -np.sin(wrap)])
    points = np.vstack([first, arc, arc[-1] + tail * pull])
    middles = (points[1:] + points[:-1]) / 2.0
    net = single_tow(points, middles / np.linalg.norm(middles, axis=1)[:, None])
    last = len(points) - 1
    law = ContactLaw(stiffness=50.0, layer=0.01, friction=mu, stick_stiffness=50.0)
    # The drum is larger by the penetration under T1/R, or nothing would hold the tow at first.
    overlap = np.sqrt(2.0 * law.layer * load / radius / law.stiffness)
    # Out of the plane, and turns but for those about y, nothing happens: held.
    supports = [
        Support(np.arange(last + 1), (1, 3, 5)),
        Support(np.array([last]), (0, 2), lambda time: 2.0 * time * pull[None, :]),
    ]
    model = Model(
        net,
        SECTION,
        tools=[Drum("drum", lambda time: (0.0, 0.0, 0.0), radius + overlap)],
        contact_law=law,
        supports=supports,
    )
    near = np.flatnonzero(model.disc.local_nodes[: model.disc.owned] == 0)
    model.system.nodal_loads[near, 0] = -load
    pulls = []
    newton = model.newton(force_tolerance=1e-8, limit=40)
    stepper = Stepper(
        model,
        newton,
        StepControl(first=1.0 / steps, smallest=1e-4, largest=1.0 / steps),
        observe=lambda step: pulls.append(float(model.reactions()[last, :3] @ pull)),
    )
    stepper.run(1.0)
    return np.array(pulls) / load


def test_capstan():
    """T2/T1 = exp(μ φ) while it slides; on the way there it sticks, with less.

    On a polygon of n cells a node that turns the tow by δ = φ/n takes T2 − T1 = μ N with
    N = (T1 + T2) sin(δ/2), up to δ³: each node passes on (1 + μ sin(δ/2))/(1 − μ sin(δ/2)) at the
    direction that halves the turn, where T cos(δ/2) balances: a product that tends to exp(μ φ) like
    1/n².
    """
    exact = np.exp(MU * np.pi / 2.0)
    ratio = over_a_drum(40)
    assert ratio[-1] == pytest.approx(exact, rel=2e-3)
    assert abs(ratio[-1] - ratio[-5]) < 1e-3 * exact, "it slides steadily"
    assert ratio[0] < ratio[-1]


def test_capstan_does_not_depend_on_the_step():
    coarse, fine = over_a_drum(20, steps=10)[-1], over_a_drum(20, steps=40)[-1]
    assert coarse == pytest.approx(fine, rel=1e-3)


def test_smooth_drum_passes_the_load_on():
    """Without friction T2 = T1: the twin that must not show the capstan's ratio."""
    assert over_a_drum(20, mu=1e-9)[-1] == pytest.approx(1.0, abs=5e-3)


@pytest.mark.parametrize(
    ("friction", "large", "symmetric"),
    [(MU, 1, True), (2.0 * contacts.LOW_FRICTION, 1, False), (MU, contacts.LARGE, False)],
)
def test_large_nets_have_the_symmetric_part_of_a_low_friction(
    monkeypatch, friction, large, symmetric
):
    """A bent tow pushed across a plane, some nodes of which slip and some stick.

    With K e the residual's derivative in a direction e, by central differences, the tangent K̂ has
    d · K̂ e = d · K e; of its symmetric part d · K̂ e = (d · K e + e · K d)/2.
    """
    monkeypatch.setattr(contacts, "LARGE", large)
    law = ContactLaw(stiffness=0.5, layer=0.5, friction=friction, stick_stiffness=0.5)
    plane = HoledPlate("plane", lambda time: (1e4, 0.0, 0.2), 1.0, 1.0, side=1.0)
    net = single_tow(
        np.column_stack([np.linspace(0.0, 30.0, 6), np.zeros((6, 2))]), (0.0, 0.0, 1.0)
    )
    model = Model(net, SECTION, tools=[plane], contact_law=law)
    system, disc = model.system, model.disc
    assert system.symmetric == symmetric
    rng = np.random.default_rng(4)
    w = np.zeros((6, 6))
    w[:, 0], w[:, 1], w[:, 2] = 0.02, np.linspace(0.0, 0.4, 6), rng.normal(0.0, 0.02, 6)
    d, e = np.zeros((2, 6, 6))
    d[:, :3], e[:, :3] = rng.normal(size=(2, 6, 3))

    def friction_forces(step):
        x = disc.vector()
        x.array[:] = (w + step).ravel()
        system.set_increment(x)
        return system.term_forces("plane friction")

    def slope(direction, h=1e-6):
        return (friction_forces(h * direction) - friction_forces(-h * direction)) / (2.0 * h)

    by_differences = np.vdot(d, slope(e)), np.vdot(e, slope(d))
    friction_forces(0.0 * w)
    term = next(t for t in system.terms if t.name == "plane friction")
    K = disc.matrix()
    K.setLGMap(*disc.maps()[:1] * 2)
    _dolfinx.add_matrix(K, _dolfinx.compile_form(term.tangent, disc.comm))
    K.assemble()

    def product(left, right):
        x, y = disc.vector(), disc.vector()
        x.array[:] = right.ravel()
        K.mult(x, y)
        return float(np.vdot(left, y.array_r.reshape(6, 6)))

    found = product(d, e), product(e, d)
    # The two differ: friction's own tangent is not symmetric.
    assert abs(by_differences[0] - by_differences[1]) > 0.1 * abs(by_differences[0])
    wanted = (np.mean(by_differences),) * 2 if symmetric else by_differences
    assert found == pytest.approx(wanted, rel=1e-6)
