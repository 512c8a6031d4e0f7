"""What a model may be believed by: noise as it was stated, held-out runs that are foretold."""

import numpy as np
from linear import Linear, readings

from fabric_fenicsx.inputs.parameters import Parameter
from fabric_fenicsx.loop.inference.effects import Effect, Variant
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.judge import Judge
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.variances import Variances

#: One sigma of a reading.
SIGMA = 0.1


def judged(acts_on="", since=0.5, stated=SIGMA, scatter=SIGMA):
    """A line that bends: little is seen of that in the fitted run, all of it in the held-out one.

    Args:
        acts_on: of the bend; of a term without a formula one says.
        since: where it begins; the fitted run ends at 1, the other one at 2.
        stated: one sigma as it is stated.
        scatter: as it is.
    """
    t = np.concatenate([np.linspace(0.0, 1.0, 60), np.linspace(0.0, 2.0, 60)])
    run = np.repeat([0, 1], 60)
    bend = np.maximum(t - since, 0.0) ** 2
    observed = 2.0 + t + bend + scatter * np.random.default_rng(1).normal(size=120)
    data = readings(observed, run=run, holdout=(1,), specimen=np.zeros_like(run))
    amplitude = Parameter("bend", (), amplitude=True)
    effect = Effect("bend", "linear", "", (Variant("only", (amplitude,)),), acts_on=acts_on)
    columns = {"a": np.ones_like(t), "b": t, "bend": bend}
    test = Linear(data, columns, ("a", "b"), effects=[effect], noise=stated)
    judge = Judge(test, [effect])
    start = {"a": 2.0, "b": 1.0, "bend": 1.0}
    model = fit(test, effect.variants, start, data.fit, Variances(Noise(SIGMA)))
    return judge, judge.weighed(model, (effect,))


def test_a_term_without_a_formula_has_to_be_known_where_it_foretells():
    for since, known in ((0.0, True), (0.9, False)):
        judge, model = judged(since=since)
        own = judge.expected_holdout(model.fit, SIGMA)
        assert 0.5 * own < judge.holdout(model.fit) < 2.0 * own
        assert (own < 4.0 * SIGMA) is known
        # An effect with a name may say that it does not know, ...
        assert judge.foretells(model)
        # ... any function at all may not.
        judge, model = judged("moment", since)
        assert judge.foretells(model) is known


def test_noise_beyond_what_was_stated():
    for scatter, more in ((SIGMA, False), (1.1 * SIGMA, False), (2.0 * SIGMA, True)):
        judge, model = judged(scatter=scatter)
        assert judge.doubtful_noise(model) is more
    judge, model = judged(stated=None, scatter=2.0 * SIGMA)
    assert not judge.doubtful_noise(model)
