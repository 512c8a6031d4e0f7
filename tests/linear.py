"""A test whose model is linear, for the inference: what it should say follows by dense matrices."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from fabric_fenicsx.inputs.parameters import Parameter
from fabric_fenicsx.loop.inference.effects import Effect, Variant
from fabric_fenicsx.loop.inference.experiment import NO_DEVIATIONS, Readings


def readings(observed, *, run=None, holdout=(), specimen=None, **more):
    """Readings of runs that are specimens of their own, in one line each, unless said otherwise.

    Args:
        observed: (n,).
        run: number of the run, (n,); by default one run.
        holdout: numbers of the runs that are held out.
        specimen: number of the specimen, (n,); by default that of the run.
        more: further attributes of Readings.
    """
    count = len(observed)
    run = np.zeros(count, dtype=np.int64) if run is None else run
    specimen = run if specimen is None else specimen
    given = {
        "usable": np.ones(count, dtype=bool),
        "weight": np.ones(count),
        "covariates": {},
        "folder": np.zeros(count, dtype=np.int64),
        "chain": run,
    }
    return Readings(
        observed=observed,
        run=run,
        holdout=np.isin(run, holdout),
        names=tuple(f"run {k}" for k in range(run.max() + 1)),
        specimen=specimen,
        specimens=tuple(f"specimen {k}" for k in range(specimen.max() + 1)),
        **(given | more),
    )


def linear_effect(name, *amplitudes, acts_on=""):
    """An effect of one form, by default with one amplitude, of the same name."""
    own = amplitudes or (Parameter(name, amplitude=True),)
    return Effect(name, "linear", "", (Variant("only", own),), acts_on=acts_on)


class Linear:
    """Σ_k θ_k (1 + δ_k) x_k, with a column x_k for each parameter.

    Args:
        data: the readings.
        columns: x by name, those of the baseline and those of effects, (n,) each.
        baseline: names of the baseline's parameters.
        effects: that may be added.
        noise: one sigma where it is given.
    """

    test, quantity, notes, one_curve = "linear", "force_N", (), None
    curves_only = each_its_own_way = False
    in_copies = True
    settles = False
    alike = frozenset()
    imitated = MappingProxyType({})

    def __init__(self, data, columns, baseline, *, effects=(), noise=None):
        self.readings, self.columns = data, columns
        self.baseline = tuple(Parameter(name, (0.0,)) for name in baseline)
        self.effects, self.noise = list(effects), noise
        self.terms = [e for e in effects if not e.listed]

    @property
    def of_fitted(self):
        return self

    def predict(self, variants, values, deviations=NO_DEVIATIONS):
        names = [p.name for p in (*self.baseline, *(p for v in variants for p in v.parameters))]
        slopes = {
            name: self.columns[name]
            * (1.0 + deviations[name][self.readings.specimen] if name in deviations else 1.0)
            for name in names
        }
        return sum(values[name] * slope for name, slope in slopes.items()), slopes

    def settle(self, variants, values):
        pass

    def reached(self, terms, values):
        return np.ones(len(self.readings.observed), dtype=bool)

    def added_alike(self, variant, variants):
        return False

    def law(self, variants, values):
        return None


def covariance(data, rows, noise):
    """Of the errors of some readings: AR(1) along each line, and the model's own."""
    at = np.flatnonzero(rows)
    same = data.chain[at][:, None] == data.chain[at]
    correlation = np.where(same, noise.correlation ** np.abs(at[:, None] - at), 0.0)
    floor, share = noise.floor, noise.share
    sigma = (np.sqrt(floor**2 + (share * data.observed) ** 2) / data.weight)[at]
    V = sigma[:, None] * sigma * correlation
    error = data.model_error
    return V if error is None else V + error[at] @ error[at].T


def drawn(data, noise, rng):
    """Errors of all readings."""
    V = covariance(data, np.ones(len(data.observed), dtype=bool), noise)
    return np.linalg.cholesky(V) @ rng.normal(size=len(V))
