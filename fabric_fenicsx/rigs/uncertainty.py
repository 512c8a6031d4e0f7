"""What a diagnosed fabric's uncertainty makes of a run's results, by a few further runs.

Of the fabric's parameters θ the fits say a covariance A Aᵀ, and specimens differ by S z with
independent z of variance one. To first order a result f has the standard deviations

    |f′ A|  (fit)    and    |f′ S|  (specimens).

The derivative is taken along the principal axes W of both together, W Wᵀ = A Aᵀ + S Sᵀ, in units
of each parameter's own spread: one run f(θ + W_j) − f(θ) for each. An axis that leaves what is
allowed, as a negative spring, is gone the other way or less far. As W spans A and S and is no
smaller than either, f′ A = (f′ W)(W⁺ A) does not magnify the errors of the differences.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from shutil import rmtree
from typing import Any

from mpi4py import MPI

import numpy as np

from ..arrays import Array
from ..errors import InputError
from ..output.files import write_text
from ..parallel import from_root
from .cases import Case
from .drape import DrapeCase
from .fabric_file import FabricFile, moved, with_fabric
from .registry import rig

__all__ = ["Spread", "ensemble", "spread", "uncertain"]

Runner = Callable[[Case, Path, Callable[[float, int, int], None]], dict[str, Any]]

#: Steps along an axis in the order in which they are tried.
STEPS = (1.0, -1.0, 0.5, -0.5, 0.25, -0.25, 0.1, -0.1)
#: Share of the largest eigenvalue that is round-off.
ROUNDING = 1e-9
#: Numbers that say how a run was solved, or where something is.
NOT_COMPARED = {
    "failed_attempts",
    "wasted_iterations_share",
    "energy_won_share",
    "kinetic_over_stored_energy",
    "at_s",
    "x0_mm",
    "y0_mm",
}


@dataclass(frozen=True, slots=True)
class Spread:
    """How uncertain a fabric's parameters are.

    Attributes:
        axes: W, a column for each run, (n_parameters, n_axes).
        fit: W⁺ A, (n_axes, n_parameters).
        specimens: W⁺ S, (n_axes, n_groups).
    """

    axes: Array
    fit: Array
    specimens: Array


def uncertain(fabric: FabricFile) -> list[str]:
    """Names of the parameters with an error or with a scatter between specimens."""
    A, S = _roots(fabric)
    known = (np.abs(A).sum(axis=1) + np.abs(S).sum(axis=1)) > 0.0
    return [p.name for p, own in zip(fabric.parameters, known, strict=True) if own]


def spread(fabric: FabricFile) -> Spread:
    """Axes of what the fit and the specimens leave uncertain; see the module."""
    A, S = _roots(fabric)
    T = A @ A.T + S @ S.T
    size = np.sqrt(T.diagonal())
    unit = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(T / np.outer(unit, unit))
    kept = values > ROUNDING * max(float(values[-1]), 1.0) if len(values) else np.zeros(0, bool)
    # The largest first.
    values, vectors = values[kept][::-1], vectors[:, kept][:, ::-1]
    back = vectors.T / np.sqrt(values)[:, None] / unit
    return Spread(vectors * np.sqrt(values) * unit[:, None], back @ A, back @ S)


def _roots(fabric: FabricFile) -> tuple[Array, Array]:
    """A and S of the module; a parameter that moves no key has none."""
    count = len(fabric.parameters)
    acts = np.array([bool(p.keys) for p in fabric.parameters], dtype=float)
    std = np.array([p.std or 0.0 for p in fabric.parameters]) * acts
    known, vectors = np.linalg.eigh(np.array(fabric.correlations).reshape(count, count))
    A = std[:, None] * vectors * np.sqrt(np.maximum(known, 0.0))
    S = np.zeros((count, len(fabric.specimens)))
    for k, group in enumerate(fabric.specimens):
        for i, p in enumerate(fabric.parameters):
            if p.test == group.test and p.name in group.parameters:
                S[i, k] = group.share * p.value * acts[i]
    return A, S


def ensemble(
    case: Case,
    fabric: FabricFile,
    result: Mapping[str, Any],
    folder: Path,
    runner: Runner,
    progress: Callable[[float, int, int], None],
    comm: MPI.Comm,
) -> dict[str, Any]:
    """Run a case with its fabric changed and say how uncertain its results are. Collective.

    Args:
        case: as it was run.
        fabric: that it has.
        result: of that run, result.json.
        folder: of that run; ``uncertainty.csv`` is written into it.
        runner: from a case and a folder to its result.json.
        progress: told the share of these runs that is done, and steps and iterations.
        comm: communicator.

    Returns:
        ``uncertainty`` of result.json.
    """
    known: Spread = from_root(comm, partial(spread, fabric))
    first: _Seen = from_root(comm, partial(_seen, case, result, folder))
    count = known.axes.shape[1]
    slopes: list[_Seen | None] = []
    left_out = []
    for j in range(count):
        found = from_root(comm, partial(_changed, case, fabric, known.axes[:, j]))
        if found is None:
            left_out.append(f"run {j + 1}: there is no such fabric")
            slopes.append(None)
            continue
        step, changed = found
        place = folder / "uncertainty" / f"run_{j + 1}"

        def told(done: float, steps: int, iterations: int, j: int = j) -> None:
            progress((j + done) / count, steps, iterations)

        other = runner(changed, place, told)
        if not other["completed"]:
            left_out.append(f"run {j + 1}: {other['stopped_because']}")
        slopes.append(from_root(comm, partial(_slope, case, first, other, place, step)))
    summary = partial(_summary, case, fabric, known, first, slopes, left_out, folder)
    told_of: dict[str, Any] = from_root(comm, summary)
    return told_of


def _changed(case: Case, fabric: FabricFile, axis: Array) -> tuple[float, Case] | None:
    """The first step along an axis that a fabric and its case allow, and that case."""
    for step in STEPS:
        try:
            return step, with_fabric(case, moved(fabric, step * axis))
        except (ValueError, InputError):
            continue
    return None


# What is compared -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Seen:
    """Results of a run, or how they change: numbers by name, and columns of the rig's table."""

    numbers: dict[str, float]
    table: dict[str, Array]


def _seen(case: Case, result: Mapping[str, Any], folder: Path) -> _Seen:
    """Results of the run that others are compared with."""
    compared = rig(case.test).compared
    table: dict[str, Array] = {}
    if compared is not None:
        import pandas as pd

        rows = pd.read_csv(folder / compared.file)
        table = {name: rows[name].to_numpy(dtype=float) for name in rows}
    numbers = dict(_flat(result))
    if isinstance(case, DrapeCase):
        from .report import wrinkles

        # A mesh of one's own need not be a woven sheet.
        with suppress(InputError):
            numbers |= {f"wrinkles.{name}": value for name, value in wrinkles(folder).items()}
    return _Seen(numbers, table)


def _slope(
    case: Case, first: _Seen, result: Mapping[str, Any], folder: Path, step: float
) -> _Seen | None:
    """How results change with a whole step; None of a run that stopped."""
    compared = rig(case.test).compared
    other = _seen(case, result, folder) if result["completed"] else None
    for name in ("steps", "paraview"):
        for old in folder.rglob(name):
            rmtree(old, ignore_errors=True)
    if other is None:
        return None
    numbers = {
        name: (other.numbers[name] - value) / step
        for name, value in first.numbers.items()
        if name in other.numbers
    }
    table = {}
    for name in compared.columns if compared is not None else ():
        values = other.table[name]
        if compared is not None and compared.along is not None:
            values = np.interp(first.table[compared.along], other.table[compared.along], values)
        table[name] = (values - first.table[name]) / step
    return _Seen(numbers, table)


def _flat(result: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Numbers of a result by dotted names: its quantities, and those of its health."""
    for group in ("quantities", "health"):
        for name, value in _leaves(result.get(group, {}), "" if group == "quantities" else group):
            if name.rpartition(".")[2] not in NOT_COMPARED:
                yield name, value


def _leaves(group: Any, place: str) -> Iterator[tuple[str, float]]:
    if isinstance(group, Mapping) or isinstance(group, list):
        entries = group.items() if isinstance(group, Mapping) else enumerate(group)
        for name, value in entries:
            yield from _leaves(value, f"{place}.{name}" if place else str(name))
    elif isinstance(group, (int, float)) and not isinstance(group, bool):
        yield place, float(group)


# What is said ---------------------------------------------------------------------------------


def _summary(
    case: Case,
    fabric: FabricFile,
    known: Spread,
    first: _Seen,
    slopes: Sequence[_Seen | None],
    left_out: Sequence[str],
    folder: Path,
) -> dict[str, Any]:
    done = [j for j, slope in enumerate(slopes) if slope is not None]
    seen = [slope for slope in slopes if slope is not None]
    fit, specimens = known.fit[done], known.specimens[done]

    def spreads(changes: Sequence[Any]) -> tuple[Array, Array]:
        """Of fit and specimens, from the changes with each run, (n_runs,) or (n_runs, n)."""
        J = np.array(changes, dtype=float).reshape(len(done), -1).T
        return np.linalg.norm(J @ fit, axis=1), np.linalg.norm(J @ specimens, axis=1)

    quantities = {}
    for name, value in first.numbers.items():
        if all(name in slope.numbers for slope in seen):
            (of_fit,), (of_specimens,) = spreads([slope.numbers[name] for slope in seen])
            if of_fit or of_specimens:
                quantities[name] = {"value": value, "fit": of_fit, "specimens": of_specimens}
    told = {
        "of": uncertain(fabric),
        "runs": len(slopes),
        "left_out": list(left_out),
        "quantities": {n: {k: float(v) for k, v in q.items()} for n, q in quantities.items()},
    }
    compared = rig(case.test).compared
    if compared is None or not seen:
        return told
    columns = dict(first.table)
    for name in compared.columns:
        of_fit, of_specimens = spreads([slope.table[name] for slope in seen])
        columns |= {f"{name}_fit": of_fit, f"{name}_specimens": of_specimens}
    import pandas as pd

    text = pd.DataFrame(columns).to_csv(index=False, float_format="%.6g")
    write_text(folder / "uncertainty.csv", text)
    told["table"] = "uncertainty.csv"
    if isinstance(case, DrapeCase):
        told["regions"] = _regions(case, folder, columns)
    return told


def _regions(case: DrapeCase, folder: Path, columns: Mapping[str, Array]) -> list[dict[str, Any]]:
    """Root mean square of the crossings' angles' errors [degrees], by where they end."""
    from .convergence import REGIONS, region_of

    region = region_of(folder)
    rows = []
    for name in REGIONS:
        own = (region == name) | (name == "all")
        if own.any():
            errors = [columns[f"angle_deg_{of}"][own] for of in ("fit", "specimens")]
            of_fit, of_specimens = (float(np.sqrt(np.mean(e**2))) for e in errors)
            rows.append({"region": name, "fit_deg": of_fit, "specimens_deg": of_specimens})
    return rows
