"""Terms that were found without a formula: their shape with its band, and the shortest formula."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import OptimizeWarning, curve_fit

from ...arrays import Array
from ...mechanics.scalars import derivative_of, numpy_function, symbol
from ..inference.diagnosis import Diagnosis
from ..inference.effects import Effect, Shape, Variant
from .words import parameter_unit

__all__ = ["Discovered", "discovered_report", "discovered_terms", "names_of"]


#: Points of a shape that is shown.
POINTS = 101
#: ... of which one over two variables has every so many.
STEP = 5
#: A formula may be off by this many standard errors of the shape, or by this share of its range.
SIGMAS, SHARE = 2.0, 0.03
#: Share of the range below which a place is none.
LEAST = 1e-6


@dataclass(frozen=True, slots=True)
class Discovered:
    """A term that was found.

    Attributes:
        name: discovered_1, ..., the strongest first.
        effect, variant: the term and its form.
        values: of all parameters of the model.
        table: the variable or both, the shape and its standard error (``std_...``), with units.
        formula: the shortest one that is near the shape.
    """

    name: str
    effect: Effect
    variant: Variant
    values: dict[str, float]
    table: pd.DataFrame
    formula: str

    @property
    def shape(self) -> Shape:
        """Of the form."""
        assert self.variant.shape is not None
        return self.variant.shape


def discovered_terms(d: Diagnosis, first: int = 1) -> list[Discovered]:
    """The terms of the reported model that have no name, the strongest first.

    Args:
        d: what was found.
        first: number of the first one.
    """
    found: list[Discovered] = []
    for effect in (e for e in d.effects if not e.listed):
        variant = effect.form_in(d.final.variants)
        assert variant.shape is not None
        table = _shape_table(d, variant)
        about = effect.acts_on.replace("_", " ") + ": "
        if table.columns[1].startswith("share_of_"):
            about = table.columns[1].removeprefix("share_of_").replace("_", " ") + " × "
        about = variant.shape.begins or about
        name = f"discovered_{first + len(found)}"
        formula = about + (_listed(d, table) if variant.shape.points else _shortest(table))
        found.append(Discovered(name, effect, variant, d.final.values, table, formula))
    return found


def _shape_table(d: Diagnosis, variant: Variant) -> pd.DataFrame:
    """A term's shape over its variable, as far as that was reached."""
    shape = variant.shape
    assert shape is not None
    x = np.array(shape.points) if shape.points else np.linspace(*shape.ends, POINTS)
    at = {"x": x}
    columns = {shape.x: shape.reach * x}
    if shape.also:
        x, w = (grid.ravel() for grid in np.meshgrid(x[::STEP], x[::STEP]))
        at = {"x": x, "w": w}
        columns = {shape.also: shape.also_reach * w, shape.x: shape.reach * x}
    symbols = {p.name: symbol() for p in variant.parameters} | {name: symbol() for name in at}
    value = shape.value(symbols, *(symbols[name] for name in at))
    by = [p.name for p in variant.parameters]
    evaluate = numpy_function([value, *(derivative_of(value, symbols[n]) for n in by)], symbols)
    values, *slopes = evaluate({n: d.final.values[n] for n in by} | at)
    full = {n: np.broadcast_to(s, x.shape) for n, s in zip(by, slopes, strict=True)}
    columns[shape.y] = np.broadcast_to(values, x.shape)
    return pd.DataFrame(columns | {f"std_{shape.y}": d.final.error_of(full)})


@dataclass(frozen=True, slots=True)
class _Formula:
    """A formula of x in [0, 1]: value, starts, and its text from the unit's name and numbers."""

    value: Callable[..., Array]
    starts: tuple[tuple[float, ...], ...]
    text: Callable[..., str]


def _formulas(v: str, unit: str, reach: float) -> Iterator[_Formula]:
    """Of one number, then of two, then of three, the amplitude first."""

    def at(share: float) -> str:
        return f"{share * reach:.3g}{' ' + unit if unit else ''}"

    yield _Formula(lambda x, a: a * x, ((1.0,),), lambda a: f"{a:.3g} {v}/{at(1.0)}")
    yield _Formula(lambda x, a: a * x**2, ((1.0,),), lambda a: f"{a:.3g} ({v}/{at(1.0)})²")
    yield _Formula(
        lambda x, a, b: a * x + b * np.abs(x),
        ((1.0, 0.5),),
        lambda a, b: f"{(a + b) / reach:.3g} {v} above 0, {(a - b) / reach:.3g} {v} below",
    )
    yield _Formula(
        lambda x, a, b: a * (1.0 - np.exp(-x / b)),
        ((1.0, 0.1), (1.0, 0.5)),
        lambda a, b: f"{a:.3g} (1 − exp(−{v}/{at(b)}))",
    )
    yield _Formula(
        lambda x, a, b: a * np.log1p(x / b),
        ((0.3, 0.1),),
        lambda a, b: f"{a:.3g} ln(1 + {v}/{at(b)})",
    )
    yield _Formula(
        lambda x, a, n: a * x**n,
        ((1.0, 1.5), (1.0, 3.0)),
        lambda a, n: f"{a:.3g} ({v}/{at(1.0)})^{n:.3g}",
    )
    yield _Formula(
        lambda x, a, b: a * np.maximum(x - b, 0.0),
        ((1.0, 0.3), (1.0, 0.6)),
        lambda a, b: f"{a / reach:.3g} max({v} − {at(b)}, 0)",
    )
    yield _Formula(
        lambda x, a, w: a * np.tanh(x / w),
        ((1.0, 0.03), (1.0, 0.2)),
        lambda a, w: f"{a:.3g} tanh({v}/{at(w)})",
    )
    yield _Formula(
        lambda x, a, b, w: a / (1.0 + np.exp(-(x - b) / w)) - a / (1.0 + np.exp(b / w)),
        ((1.0, 0.3, 0.05), (1.0, 0.6, 0.05)),
        lambda a, b, w: f"{a:.3g} s(({v} − {at(b)})/{at(w)}), s(y) = 1/(1 + exp(−y))",
    )
    yield _Formula(
        lambda x, a, b, w: a * np.exp(-((np.log(np.maximum(x, LEAST) / b) / w) ** 2)),
        ((1.0, 0.1, 0.5), (1.0, 0.4, 0.5)),
        lambda a, b, w: f"{a:.3g} exp(−(ln({v}/{at(b)})/{abs(w):.3g})²)",
    )
    yield _Formula(
        lambda x, a, b, w: np.where(x > b, a * np.exp(-(x - b) / w), 0.0),
        tuple((1.0, b, 0.1) for b in (0.1, 0.3, 0.5, 0.7, 0.9)),
        lambda a, b, w: f"{a:.3g} exp(−({v} − {at(b)})/{at(w)}) from {at(b)} on",
    )
    yield _Formula(
        lambda x, a, b, n: _of_sides(x, a, b) * np.abs(x) ** n,
        ((1.0, 0.5, 0.5), (1.0, 0.5, 2.0)),
        lambda a, b, n: f"{a:.3g} above 0, {b:.3g} below, times (|{v}|/{at(1.0)})^{n:.3g}",
    )
    yield _Formula(
        lambda x, a, b, w: _of_sides(x, a, b) * (1.0 - np.exp(-np.abs(x) / w)),
        ((1.0, 0.5, 0.1), (1.0, 0.5, 0.3)),
        lambda a, b, w: f"{a:.3g} above 0, {b:.3g} below, times (1 − exp(−|{v}|/{at(w)}))",
    )
    yield _Formula(
        lambda x, a, b, w: a * (np.exp(-(((x - b) / w) ** 2)) - np.exp(-((b / w) ** 2))),
        ((1.0, 0.3, 0.1), (1.0, 0.6, 0.1)),
        lambda a, b, w: f"{a:.3g} {_bump(f'{v} − {at(b)}', at(abs(w)), np.exp(-((b / w) ** 2)))}",
    )
    yield _Formula(
        lambda x, a, b, n: a * np.sin(2.0 * np.pi * n * x) + b * (np.cos(2.0 * np.pi * n * x) - 1),
        tuple((1.0, 0.1, n) for n in np.arange(1.0, 16.0, 0.25)),
        lambda a, b, n: _wave(np.hypot(a, b), f"{v}/{at(1.0 / n)}", np.arctan2(b, a)),
    )


def _of_sides(x: Array, above: float, below: float) -> Array:
    """One number above 0 and another one below."""
    return np.where(x > 0.0, above, below)


def _wave(size: float, turns: str, phase: float) -> str:
    """A sine, less what it is where the variable is nothing."""
    added = (phase, -size * np.sin(phase))
    ahead, start = (f"{'−' if n < 0.0 else '+'} {abs(n):.2g}" for n in added)
    return f"{size:.3g} sin(2π {turns} {ahead}) {start}"


def _bump(place: str, width: str, at_zero: float) -> str:
    """A Gaussian, less what it is where the variable is nothing."""
    text = f"exp(−(({place})/{width})²)"
    return f"({text} − {at_zero:.2g})" if at_zero > SHARE else text


def _named(column: str) -> tuple[str, str]:
    """A variable's name in words, and its unit."""
    unit = parameter_unit(column)
    name = column.removesuffix("_" + unit.replace("/", "_").replace("²", "2")) if unit else column
    return name.replace("_rad", "").replace("_", " "), unit


def _separated(table: pd.DataFrame) -> str:
    """The formula of a shape over two variables: a product, if it is near one.

    The nearest product of a function of each is the first part of the table's singular value
    decomposition.
    """
    *variables, y, std = table.columns
    other, first = (_named(str(column))[0] for column in variables)
    grid, band = (table.pivot(index=variables[0], columns=variables[1], values=c) for c in (y, std))
    left, sizes, right = np.linalg.svd(grid.to_numpy())
    off = np.abs(grid.to_numpy() - sizes[0] * np.outer(left[:, 0], right[0]))
    allowed = np.maximum(SIGMAS * band.to_numpy(), SHARE * float(np.ptp(grid.to_numpy())))
    if (off > allowed).any():
        return f"f({other}, {first}), no product of one of each"
    # Each is 1 where it is largest; the size goes to the first.
    parts = [left[:, 0], right[0]]
    tops = [part[np.argmax(np.abs(part))] for part in parts]
    size = sizes[0] * tops[0] * tops[1]
    words = []
    for part, top, axis, amount in zip(
        parts, tops, (grid.index, grid.columns), (size, 1.0), strict=True
    ):
        one = pd.DataFrame({str(axis.name): axis, "y": amount * part / top})
        words.append(_shortest(one.assign(std=0.0)))
    return " × ".join(words)


def _listed(d: Diagnosis, table: pd.DataFrame) -> str:
    """What runs or specimens have that each has a value of its own."""
    of, value, _ = (str(column) for column in table.columns)
    each = zip(table[value], names_of(d, of, table[of]), strict=True)
    return f"({', '.join(f'{amount:.3g} of {of} {name}' for amount, name in each)})"


def names_of(d: Diagnosis, of: str, numbers: Iterable[float]) -> list[str]:
    """What a report calls runs, or specimens, that have these numbers, counted from 1."""
    specimens = d.experiment.readings.specimens
    return [specimens[round(n) - 1] if of == "specimen" else f"{n:.0f}" for n in numbers]


def _shortest(table: pd.DataFrame) -> str:
    """The formula of fewest numbers that is near a shape; that it has none where there is none."""
    if len(table.columns) > 3:
        return _separated(table)
    name, own, std = (table[c].to_numpy() for c in table.columns)
    reach = float(np.abs(name).max())
    v, unit = _named(str(table.columns[0]))
    x = name / reach
    size = float(np.ptp(own)) or 1.0
    allowed = np.maximum(SIGMAS * std, SHARE * size)
    start = float(own[np.argmin(np.abs(name))])
    # As far as it goes from there, either way.
    far = float(own[np.argmax(np.abs(own - start))]) - start or size
    best: tuple[int, float, str] | None = None
    for formula in _formulas(v, unit, reach):
        for guess in formula.starts:
            scaled = (guess[0] * far, *guess[1:])
            try:
                with np.errstate(all="ignore"), warnings.catch_warnings():
                    # Only how near it is matters, not what is known of its numbers.
                    warnings.simplefilter("ignore", OptimizeWarning)
                    found, _ = curve_fit(
                        formula.value, x, own - start, scaled, sigma=allowed, maxfev=500
                    )
            except (RuntimeError, ValueError, FloatingPointError):
                continue
            with np.errstate(all="ignore"):
                off = float(np.max(np.abs(formula.value(x, *found) - own + start) / allowed))
            text = formula.text(*found)
            if off <= 1.0 and (best is None or (len(found), off) < best[:2]):
                best = (len(found), off, text)
    if best is None:
        return f"f({v}), no short formula"
    if abs(start) <= SHARE * size:
        return f"({best[2]})"
    sign, text = ("−", best[2][1:]) if best[2].startswith("-") else ("+", best[2])
    return f"({start:.3g} {sign} {text})"


def discovered_report(d: Diagnosis, terms: Sequence[Discovered]) -> list[dict[str, Any]]:
    """Terms as report.json has them."""
    by_name = {e.name: e for e in (*d.experiment.effects, *d.experiment.terms)}

    def rival(name: str) -> dict[str, Any]:
        other = by_name[name]
        if other.listed:
            return {"name": name}
        return {"acts_on": other.acts_on, "depends_on": list(other.depends_on)}

    def rivals(term: Discovered) -> list[dict[str, Any]]:
        effect, factor_of = term.effect, term.variant.factor_of
        own = effect.in_general
        found = [rival(name) for name in d.rivals.get(effect.name, []) if name not in own]
        whatever: list[dict[str, Any]] = [{"name": name} for name in own]
        if factor_of:
            both = [factor_of, *effect.depends_on]
            found = [r for r in found if set(r.get("depends_on", ())) != set(both)]
            whatever.append({"acts_on": effect.acts_on, "depends_on": both})
        return [{**one, "in_general": True} for one in whatever] + found

    errors = d.final.errors
    reported = []
    for term in terms:
        names = [p.name for p in term.variant.parameters]
        reported.append(
            {
                "name": term.name,
                "acts_on": term.effect.acts_on,
                "depends_on": list(term.effect.depends_on),
                "parameters": {name: term.values[name] for name in names},
                "std": {n: None if n in d.final.at_bound else errors[n] for n in names},
                "shape": f"{term.name}.csv",
                "formula": term.formula,
                "file": f"{term.name}.py",
                "rivals": rivals(term),
                "variant": term.variant.label,
                "meaning": term.effect.meaning,
                "of": term.effect.name,
                "rival_names": list(d.rivals.get(term.effect.name, [])),
                # Zeros of strips are alike for another reason.
                "one_curve": term.effect.test != "cantilever"
                and term.effect.name in d.experiment.alike,
            }
        )
    return reported
