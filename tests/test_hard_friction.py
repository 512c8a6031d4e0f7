"""Frictions without a formula to first order: what is fitted at all hangs on that."""

import numpy as np
from test_rig_terms import FABRIC, FRAME, MORE, force_of, write

from fabric_fenicsx.loop.inference.beside import by_itself
from fabric_fenicsx.loop.inference.criteria import CRITERIA
from fabric_fenicsx.loop.inference.first_order import ToFirstOrder
from fabric_fenicsx.loop.inference.models import Models


def polishing(t, D, speed, run):
    """A hard friction that falls with the shear that the cloth has gone through."""
    theta = np.arccos((np.sqrt(2.0) + D / FRAME) / 2.0)
    path = np.cumsum(np.abs(np.diff(2.0 * theta, prepend=2.0 * theta[0])))
    m = 0.02 * np.sign(speed) / (1.0 + path / 0.2)
    # In a hold it stays as it was.
    moving = np.maximum.accumulate(np.where(speed != 0.0, np.arange(len(t)), 0))
    return force_of(D, speed) + m[moving] * FABRIC**2 / (FRAME * np.sin(theta))


def test_to_first_order_a_hard_friction_is_nearer_than_what_it_is_not(tmp_path):
    """With a stick as soft as 0.005 rad it had left more than a reading by the time and the way."""
    experiment = write(tmp_path / "set", polishing, MORE)
    names = "dissipative_moment_of_path", "reading_of_time_and_direction"
    effects = [next(t for t in experiment.terms if t.name == name) for name in names]
    models = Models(experiment, effects)
    linear = ToFirstOrder(experiment, models.base, models.variances, CRITERIA.far)
    own, other = (linear.least_left(by_itself(forms)) for forms in models.signed(effects).values())
    assert own < 0.5 * other
