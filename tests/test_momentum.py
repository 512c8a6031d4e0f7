"""Linear and angular momentum: what acts from outside changes them, step by step and over a run."""

import numpy as np
import pytest
from solve import GivenSection, orders, set_loads

from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.mechanics.tools import Sphere
from fabric_fenicsx.solving.balance import Balance
from fabric_fenicsx.solving.contacts import ContactLaw
from fabric_fenicsx.solving.generalised_alpha import GeneralisedAlpha
from fabric_fenicsx.solving.model import Model, Support
from fabric_fenicsx.solving.momentum import Momentum
from fabric_fenicsx.solving.stepping import StepControl, Stepper

SECTION = GivenSection((500.0, 200.0, 200.0, 40.0, 60.0, 90.0), (0.02, 0.3, 0.2, 0.1))


def swinging(end, step, observe, *, radius=0.9):
    """A soft, heavy rod swings about a held end over a ball, a moment on its free end."""
    x = np.linspace(0.0, 12.0, 9)
    points = np.column_stack([x + 3.0, 0.2 * x + 1.0, 0.5 + 0.0 * x])
    net = single_tow(points, (0.0, 0.0, 1.0))
    model = Model(
        net,
        SECTION,
        gravity=(0.0, 0.5, -9.0),
        inertia=GeneralisedAlpha(radius),
        mass_scale=2.0,
        tools=[Sphere("ball", lambda time: (10.0, 3.0, -2.0), 2.0)],
        contact_law=ContactLaw(stiffness=20.0, layer=0.5, friction=0.2),
        supports=[Support(np.array([0]), (0, 1, 2, 4))],
    )
    set_loads(model, 8, [0.1, 0.0, 0.0, 2.0, -1.0, 1.5])
    newton = model.newton(force_tolerance=1e-10, limit=30)
    stepper = Stepper(model, newton, StepControl(step, step / 100.0, step))
    stepper.start_consistently()
    stepper.observe = lambda step: observe(model, step)
    stepper.run(end)


@pytest.mark.mpi
def test_momentum_rate_is_what_acts_from_outside():
    """Σ ρA a and Σ x × ρA a + Λ(JΩ̇ + Ω×JΩ) against weight, ball, support and loads, every step.

    Tows act within: their forces and moments cancel in the sum to round-off, whatever the state.
    Only the residual of the free nodes is left, below 1e-10.
    """
    worst, size, ball = np.zeros(6), np.zeros(6), []

    def observe(model, step):
        momentum = Momentum(model)
        rate = momentum.wrench(model.system.term_forces("inertia"))
        outside = momentum.external(model.outside(), step.reactions)
        np.maximum(worst, np.abs(rate - outside), out=worst)
        np.maximum(size, np.abs(outside), out=size)
        ball.append(np.linalg.norm(model.tool_forces()["ball"]))

    swinging(1.0, 0.05, observe)
    assert size.min() > 0.1
    assert max(ball) > 1.0
    assert worst.max() < 1e-9


def test_momentum_is_the_impulse():
    """Δp = ∫ f dt by the trapezoidal rule from the first step on: the gap is of second order."""
    names = [
        f"{turning}{{}}_{axis}_N_{unit}"
        for turning, unit in (("", "s"), ("angular_", "mm_s"))
        for axis in "xyz"
    ]
    gaps = []
    for step in (0.01, 0.005, 0.0025):
        rows, balance = [], []

        def observe(model, step, rows=rows, balance=balance):
            if not balance:
                balance.append(Balance(model))
            rows.append(balance[0].step(step, model.outside()))

        swinging(0.4, step, observe)
        momentum, impulse = (
            np.array([[row[name.format(what)] for name in names] for row in rows])
            for what in ("momentum", "impulse")
        )
        gaps.append(np.abs(momentum - momentum[0] - impulse + impulse[0]).max())
    assert gaps[-1] < 1e-3 * np.abs(momentum).max()
    assert orders(gaps)[-1] == pytest.approx(2.0, abs=0.2)
