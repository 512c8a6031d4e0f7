"""A fitted model: what it leaves, what it foretells, and how well either is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eigh
from scipy.stats import chi2

from ...arrays import Array, Flags
from .effects import Variant
from .experiment import Readings
from .variances import Variances

__all__ = ["Fit", "orthogonal_to", "soft_size", "uncertainty"]


#: Least information about a combination of parameters, as a share of the most: round-off.
LEAST_KNOWN = 1e-14


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted model; two are the same only if they are one object.

    Attributes:
        variants: the effects in it.
        values: common parameters by name.
        std: their standard errors; see ``errors``.
        correlated: pairs of parameters that the data hardly tell apart.
        at_bound: parameters that ended on a bound.
        converged: false where the search ended at its cap of evaluations.
        residual: observed minus expected at every reading, used or not, (n,).
        expected: the model there, with the specimens' deviations, (n,).
        used: readings that were fitted, (n,).
        variances: with which they were.
        deviations: by group of parameters, of every specimen from the common ones, (n_specimens,);
            zero of those that were not fitted.
        slopes: derivatives of the expected readings in the common parameters, then in each
            specimen's deviations, group by group, (n, n_columns).
        root: of the covariance of these columns' parameters, (n_columns, n_columns): their change
            with one standard error of independent combinations of them.
        white: residuals that were fitted, white, (n_used,).
        readings: of the test.
    """

    variants: tuple[Variant, ...]
    values: dict[str, float]
    std: dict[str, float]
    correlated: tuple[tuple[str, str], ...]
    at_bound: tuple[str, ...]
    converged: bool
    residual: Array
    expected: Array
    used: Flags
    variances: Variances
    deviations: dict[str, Array]
    slopes: Array
    root: Array
    white: Array
    readings: Readings

    @cached_property
    def penalty(self) -> float:
        """Σ δ²/τ² of the specimens."""
        scatter = self.variances.scatter
        return sum(float(np.sum((d / scatter[g]) ** 2)) for g, d in self.deviations.items())

    @property
    def sum_of_squares(self) -> float:
        """Of the white residuals that were fitted, and of what specimens had to differ by."""
        return float(self.white @ self.white) + self.penalty

    def size(self, robust: float | None) -> float:
        """The same, where residuals far off count by their size only; see soft_size."""
        return soft_size(self.white, robust) + self.penalty

    @property
    def freedom(self) -> int:
        """Readings less parameters."""
        return max(int(self.used.sum()) - len(self.values), 1)

    def rms(self, rows: Flags) -> float:
        """Root mean square of the residual at these readings; NaN if there are none."""
        own = (self.residual * self.readings.weight)[rows]
        return float(np.sqrt(np.mean(own**2))) if len(own) else float("nan")

    def predictive_rms(self, rows: Flags, *, open_ended: bool = False) -> float:
        """Root mean square of the residual over sigma there, less what the prediction allows for.

        A prediction is as uncertain as the parameters it is made with, those of a specimen that
        was not fitted among them, and its errors go together: with G Gᵀ the covariance of what is
        expected, white, r · (1 + G Gᵀ)⁻¹ r is what remains of the sum of squares. NaN if there are
        none; infinite where what is expected, or its slope, is not a number.

        Args:
            rows: there.
            open_ended: whether what no reading that was fitted depends on may be anything; by
                default it is known to be as it began.
        """
        if not rows.any():
            return float("nan")
        left, _ = self._predicted(rows, self._unseen if open_ended else ())
        return float(np.sqrt(left / rows.sum()))

    def predictive_likelihood(self, rows: Flags) -> float:
        """−2 log of the density of the readings there, as they are predicted, but for n ln 2π.

        What the parameters are not known by makes a prediction vague, which is paid for. Infinite
        where what is expected, or its slope, is not a number.
        """
        left, determinant = self._predicted(rows)
        return left + determinant

    @property
    def _unseen(self) -> list[int]:
        """Places of parameters that no reading depends on that was fitted, but for bounds."""
        names = enumerate(self.std.items())
        return [k for k, (n, std) in names if np.isinf(std) and n not in self.at_bound]

    def _predicted(self, rows: Flags, anything: Sequence[int] = ()) -> tuple[float, float]:
        """For the readings there r · C⁻¹ r and ln det C, C being what a prediction scatters by.

        Without what columns at some places can make, in r and in C.
        """
        if not self._are_numbers(rows):
            return float("inf"), 0.0
        whiten = self.variances.noise.whitener(self.readings, rows)
        both = whiten(np.column_stack([self.residual[rows], self.slopes[rows] @ self.root]))
        if anything:
            both = orthogonal_to(whiten(self.slopes[rows][:, list(anything)]), both)
        r = both[:, 0]
        parts, size = _along(both[:, 1:], r)
        allowed = float(np.sum(parts**2 / (1.0 + 1.0 / np.maximum(size, 1e-150) ** 2)))
        determinant = whiten.log_determinant + float(np.sum(np.log1p(size**2)))
        return max(float(r @ r) - allowed, 0.0), determinant

    def _are_numbers(self, rows: Flags) -> bool:
        """Whether what is expected there, and its slopes, are."""
        return bool(np.isfinite(self.residual[rows]).all() and np.isfinite(self.slopes[rows]).all())

    def chance_of(self, rows: Flags, known: Sequence[str] = ()) -> float:
        """Chance of readings as far from what is expected as these, where parameters take it.

        One parameter that is off is a single number, however many readings show it: with z the
        residual's parts along what parameters change, each over its own scatter, that of χ² = z·z.
        As if some common parameters were known to be as found. None where what is expected, or its
        slope, is not a number.
        """
        if not self._are_numbers(rows):
            return 0.0
        whiten = self.variances.noise.whitener(self.readings, rows)
        changes = whiten(self.slopes[rows] @ self._root_given(known))
        parts, size = _along(changes, whiten(self.residual[rows]))
        seen = size > LEAST_KNOWN * size.max(initial=0.0)
        z = parts[seen] / np.hypot(1.0, size[seen])
        return float(chi2.sf(z @ z, int(seen.sum())))

    def prediction_std(self, rows: Flags, known: Sequence[str] = ()) -> float:
        """Standard error of the expected readings there, root mean square.

        As if some common parameters were known to be as found.
        """
        weight = self.readings.weight[rows][:, None]
        square = np.sum((weight * (self.slopes[rows] @ self._root_given(known))) ** 2, axis=1)
        return float(np.sqrt(np.mean(square)))

    def factors(self, specimen: int) -> dict[str, float]:
        """What parameters of a specimen are over what all have in common, where they differ."""
        return {
            name: 1.0 + float(deviation[specimen])
            for group, deviation in self.deviations.items()
            for name in group.split()
        }

    def error_of(self, slopes: Mapping[str, Array]) -> Array:
        """Standard error of a function of the common parameters from its slopes, (n,) each."""
        count = len(next(iter(slopes.values())))
        columns = [np.broadcast_to(slopes.get(name, 0.0), count) for name in self.values]
        J = np.column_stack(columns)
        known = self.root[: len(self.values)]
        return np.asarray(np.linalg.norm(J @ known, axis=1) * self.misfit)

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors, for what is left where that is more than the noise."""
        return {name: std * self.misfit for name, std in self.std.items()}

    def wald(self, names: Sequence[str], known: Sequence[str]) -> float:
        """Wald's statistic of some parameters: square of their distance from nothing, in errors.

        As if others were known to be as found. It is that of all together: of two that the readings
        hardly tell apart each may have any error.
        """
        place = {name: k for k, name in enumerate(self.values)}
        left = self._root_given(known)[[place[n] for n in names]]
        found = np.array([self.values[n] for n in names])
        # In errors, however different: of what nothing depends on there is none.
        errors = np.linalg.norm(left, axis=1)
        known_at_all = (errors > 0.0) & np.isfinite(errors)
        own, found, errors = left[known_at_all], found[known_at_all], errors[known_at_all]
        # Smallest combination of the independent ones that takes them there: zero where none does.
        least = np.linalg.lstsq(own / errors[:, None], found / errors, rcond=1e-8)[0]
        return float(least @ least) / self.misfit**2

    def _root_given(self, known: Sequence[str]) -> Array:
        """What known parameters leave of the independent combinations; see root."""
        given = self.root[[k for k, name in enumerate(self.values) if name in known]]
        return self.root - self.root @ np.linalg.pinv(given) @ given if len(given) else self.root

    @property
    def misfit(self) -> float:
        """What is left over what the noise allows for, 1 at least: standard errors grow by it."""
        return max(1.0, float(np.sqrt(self.sum_of_squares / self.freedom)))


def soft_size(r: Array, robust: float | None) -> float:
    """Sum of squares, where residuals beyond a limit count by their size only (soft L1)."""
    if robust is None:
        return float(r @ r)
    return float(2.0 * robust**2 * np.sum(np.sqrt(1.0 + (r / robust) ** 2) - 1.0))


def _along(changes: Array, r: Array) -> tuple[Array, Array]:
    """Parts of white residuals along what parameters change, and one sigma of these changes."""
    along, size, _ = np.linalg.svd(changes, full_matrices=False)
    return along.T @ r, size


def orthogonal_to(J: Array, columns: Array) -> Array:
    """The part of columns, (n, k), that no combination of those of J, (n, m), can make."""
    scale = np.linalg.norm(J, axis=0)
    scale[scale == 0.0] = 1.0
    Q, R = np.linalg.qr(J / scale)
    keep = np.abs(np.diag(R)) > 1e-10
    Q = Q[:, keep]
    # Twice, for the round-off of nearly dependent columns.
    for _ in range(2):
        columns = columns - Q @ (Q.T @ columns)
    return columns


def uncertainty(J: Array) -> tuple[Array, Array, Array]:
    """Standard errors (infinite where nothing depends on it), correlations, root of the covariance.

    The covariance is root rootᵀ, without what nothing depends on. Combinations of parameters that
    the data say nothing about are as uncertain as round-off allows to tell.
    """
    if J.shape[1] == 0:
        return np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0))
    scale = np.linalg.norm(J, axis=0)
    dead = scale == 0.0
    safe = np.where(dead, 1.0, scale)
    information = (J / safe).T @ (J / safe)
    information[dead, dead] = 1.0
    # By QR iterations: divide and conquer, as in numpy, may not converge where columns are alike.
    known, vectors = eigh(information, driver="ev")
    scaled_root = vectors / np.sqrt(np.maximum(known, LEAST_KNOWN * known[-1]))
    std = np.linalg.norm(scaled_root, axis=1)
    correlation = (scaled_root @ scaled_root.T) / np.outer(std, std)
    root = scaled_root / safe[:, None]
    root[dead] = 0.0
    return np.where(dead, np.inf, std / safe), correlation, root
