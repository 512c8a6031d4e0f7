"""What a fitted model says of a further run, and how near it can come to what that may read.

All in units of the noise. With θ the parameters, those of the further run alone included,

    r(θ) = [Y(θ) - Y(θ̂);  ε(θ);  y(θ) - y],    D = min |r|²

Y the readings there are, y the further run, ε the differences of its specimen from those before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from ...arrays import Array
from ...errors import SolveError
from .effects import of_first, of_the_first
from .experiment import Experiment
from .fitted import Fit
from .fitting import parameters_of

__all__ = ["Foretold", "Known", "Nearest"]


#: A draw changes the readings there are, |·|²/σ², by at most this many times what it should to
#: first order ...
PLAUSIBLE = 2.0
#: ... or is made smaller, so many times, to this share.
SHRINKS, SHRINK = 2, 0.2
#: Evaluations of a model for a minimum, and the share of it by which steps end.
EVALUATIONS, ENOUGH = 8, 1e-3
#: Residual where a model has no solution: the trust region shrinks.
OUT_OF_REACH = 1e6


class Known:
    """A fitted model at the readings there are.

    Args:
        experiment: of them.
        fitted: the model.
        sigma: of a reading.

    Attributes:
        fitted, sigma: as given.
        names: of its parameters.
        at: their values as fitted, (k,).
        lower, upper: their bounds, (k,).
        slopes: of the readings that were fitted, (n, k).
    """

    def __init__(self, experiment: Experiment, fitted: Fit, sigma: float) -> None:
        self._experiment, self.fitted, self.sigma = experiment, fitted, sigma
        self.names = list(fitted.values)
        self.at = np.array(list(fitted.values.values()))
        bounds = {p.name: (p.lower, p.upper) for p in parameters_of(experiment, fitted.variants)}
        self.lower, self.upper = (np.array([bounds[n][k] for n in self.names]) for k in (0, 1))
        rows = fitted.used
        self._weight = fitted.readings.weight[rows] / sigma
        self.slopes = fitted.slopes[rows, : len(self.names)] * self._weight[:, None]
        # Specimens as they were found: what is moved is what they have in common.
        self._alike, _ = experiment.predict(fitted.variants, fitted.values)

    def moved(self, theta: Array) -> tuple[Array, Array]:
        """Change of the readings that were fitted from the fit's, and slopes, (n,) and (n, k).

        Raises:
            SolveError: the model has no solution there.
        """
        values = dict(zip(self.names, theta.tolist(), strict=True))
        y, slopes = self._experiment.predict(self.fitted.variants, values)
        rows = self.fitted.used
        J = np.column_stack([slopes[name][rows] * self._weight for name in self.names])
        change = (y - self._alike)[rows] * self._weight
        _check_numbers(change, J)
        return change, J

    def drawn(self, count: int) -> list[tuple[Array, float]]:
        """Parameters that may be the true ones, (k,), each with D of the readings there are.

        Half of them are opposite to the others.
        """
        root = self.fitted.root[: len(self.at)]
        half = np.random.default_rng(0).standard_normal((count // 2, root.shape[1]))
        found = []
        for z in np.concatenate([half, -half]):
            step = root @ z
            for _ in range(SHRINKS):
                theta = np.clip(self.at + step, self.lower, self.upper)
                try:
                    change = float(np.sum(self.moved(theta)[0] ** 2))
                except SolveError:
                    change = np.inf
                if change <= PLAUSIBLE * (z @ z):
                    found.append((theta, change))
                    break
                step = SHRINK * step
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """A model with the parameters that come nearest to a run.

    Attributes:
        theta: the parameters, (m,).
        r, J: the residual of the module's docstring for y = 0, and its slopes, (n,) and (n, m).
        lower, upper: bounds, (m,).
    """

    theta: Array
    r: Array
    J: Array
    lower: Array
    upper: Array

    def step(self, run: Array) -> tuple[Array, float]:
        """Parameters to first order about these, (m,), and D, of a run as it may be read, (n,)."""
        r = self.r.copy()
        r[len(r) - len(run) :] -= run
        scale = np.linalg.norm(self.J, axis=0)
        scale[scale == 0.0] = 1.0
        # As many rows as there are parameters, and one, have the same sum of squares.
        R = np.asarray(np.linalg.qr(np.column_stack([self.J / scale, r]), mode="r"))
        low, high = ((end - self.theta) * scale for end in (self.lower, self.upper))
        step = np.linalg.lstsq(R[:, :-1], -R[:, -1], rcond=None)[0]
        if not ((low <= step) & (step <= high)).all():
            step = lsq_linear(R[:, :-1], -R[:, -1], (low, high), method="bvls").x
        left = R[:, :-1] @ step + R[:, -1]
        return np.clip(self.theta + step / scale, self.lower, self.upper), float(left @ left)

    def loss(self, run: Array) -> float:
        """D to first order about these parameters."""
        return self.step(run)[1]


class Foretold:
    """What a model says of a further run.

    Args:
        known: the model at the readings there are.
        run: experiment of the further run alone.
        scatter: relative scatter between specimens, by parameter; empty where its specimen is one
            that was measured.
        specimen: the number of that one, where it is to be as the model found it; by default it is
            as all are in common.

    Attributes:
        read_at_fit: the run as the fit foretells it, (n,).

    Raises:
        SolveError: the model has no solution for it.
    """

    def __init__(
        self,
        known: Known,
        run: Experiment,
        scatter: Mapping[str, float],
        specimen: int | None = None,
    ) -> None:
        self.known, self._run = known, run
        #: What a parameter of that specimen is, over what all have in common.
        self._of_specimen = {} if specimen is None else known.fitted.factors(specimen)
        variants = known.fitted.variants
        of_one = [p for v in variants for p in v.parameters if p.of_one]
        self._variants = tuple(of_the_first(v) for v in variants)
        # Parameters of each run or specimen: in the further one it may have any of them.
        self._each: dict[str, list[float]] = {}
        for p in of_one:
            self._each.setdefault(of_first(p).name, []).append(known.fitted.values[p.name])
        shared = set(known.names) - {p.name for p in of_one}
        self._place = {n: k for k, n in enumerate(known.names) if n in shared}
        self._scatter = {
            n: share * abs(known.fitted.values[n])
            for n, share in scatter.items()
            if n in shared and share > 0.0
        }
        own = [p for v in self._variants for p in v.parameters if p.name in self._each]
        none = np.zeros(len(self._scatter))
        at = np.array([*known.at, *(values[0] for values in self._each.values()), *none])
        lower = np.array([*known.lower, *(p.lower for p in own), *(none - np.inf)])
        upper = np.array([*known.upper, *(p.upper for p in own), *(none + np.inf)])
        y, J = self._read(at)
        self.read_at_fit = y
        self._fit = Nearest(
            at, *self._stacked(at, np.zeros(len(known.slopes)), known.slopes, y, J), lower, upper
        )

    def first_order(self, run: Array) -> float:
        """D of a run as it may be read, (n,), to first order about the fit."""
        return self._fit.loss(run)

    def nearest(self, run: Array) -> Nearest:
        """The parameters that come nearest to a run, (n,).

        Raises:
            SolveError: the model has no solution at its fit.
        """
        tried = {self._fit.theta.tobytes(): (self._fit.r, self._fit.J)}

        def stacked(theta: Array) -> tuple[Array, Array]:
            if (key := theta.tobytes()) not in tried:
                moved = self.known.moved(theta[: len(self.known.names)])
                tried[key] = self._stacked(theta, *moved, *self._read(theta))
            return tried[key]

        def residual(theta: Array) -> Array:
            try:
                r = stacked(theta)[0].copy()
            except SolveError:
                return np.full(len(self._fit.r), OUT_OF_REACH)
            r[len(r) - len(run) :] -= run
            return r

        starts = (self._fit.step(run)[0], self._fit.theta)
        found = least_squares(
            residual,
            min(starts, key=lambda theta: float(np.sum(residual(theta) ** 2))),
            jac=lambda theta: stacked(theta)[1],
            bounds=(self._fit.lower, self._fit.upper),
            x_scale="jac",
            ftol=ENOUGH,
            xtol=ENOUGH,
            max_nfev=EVALUATIONS,
        )
        return Nearest(found.x, *stacked(found.x), self._fit.lower, self._fit.upper)

    def likely(self, theta: Array, change: float, rng: np.random.Generator) -> tuple[Array, float]:
        """The run for parameters as of Known.drawn, (n,), what is its own drawn too; and its D.

        Raises:
            SolveError: the model has no solution there.
        """
        own = [float(rng.choice(values)) for values in self._each.values()]
        different = rng.standard_normal(len(self._scatter))
        run = self._read(np.array([*theta, *own, *different]))[0]
        return run, min(self._fit.loss(run), change + float(different @ different))

    def _read(self, theta: Array) -> tuple[Array, Array]:
        """The run, (n,), and its slopes, (n, m)."""
        values = {name: float(theta[k]) for name, k in self._place.items()}
        first = len(self.known.names)
        own = {name: k for k, name in enumerate(self._each, start=first)}
        other = {name: k for k, name in enumerate(self._scatter, start=first + len(own))}
        for name, k in other.items():
            values[name] += self._scatter[name] * float(theta[k])
        values |= {name: float(theta[k]) for name, k in own.items()}
        for name, factor in self._of_specimen.items():
            values[name] *= factor
        y, slopes = self._run.predict(self._variants, values)
        J = np.zeros((len(y), len(theta)))
        for name, k in (*self._place.items(), *own.items()):
            J[:, k] = slopes[name] * self._of_specimen.get(name, 1.0)
        for name, k in other.items():
            J[:, k] = slopes[name] * self._scatter[name]
        rows = self._run.readings.usable
        _check_numbers(y[rows], J[rows])
        weight = self._run.readings.weight[rows] / self.known.sigma
        return y[rows] * weight, J[rows] * weight[:, None]

    def _stacked(
        self, theta: Array, change: Array, slopes: Array, y: Array, J: Array
    ) -> tuple[Array, Array]:
        """The residual of the module's docstring for y = 0, and its slopes."""
        before = np.zeros((len(change), len(theta)))
        before[:, : slopes.shape[1]] = slopes
        prior = np.eye(len(theta))[len(theta) - len(self._scatter) :]
        return np.concatenate([change, prior @ theta, y]), np.concatenate([before, prior, J])


def _check_numbers(*arrays: Array) -> None:
    """Refuse readings or slopes that are no numbers, as where a power overflows."""
    if not all(np.isfinite(array).all() for array in arrays):
        raise SolveError("the model is not a number at these parameters")
