"""Weave patterns: which tow lies on top at each crossing, and what follows from it.

A pattern is a binary matrix that repeats over the sheet. Row j belongs to weft tow j and column i
to warp tow i; 1 says that the warp tow lies on top. Tows are numbered along the sheet's axes, so
that a matrix reads with the weft tow of smallest y first.

How a weave acts on the in-plane moments is an assumption of this package: Wei & Zhang model one
fabric and give no rule. Two tows resist turning where they are locked in each other, that is where
they change sides next to the crossing; a tow that floats over its neighbours is only pressed on
them by its tension. Each crossing has two neighbours along either tow, and its

    interlacing = (neighbouring crossings where the tow lies on the other side) / 4

scales the in-plane spring, dashpot and friction there. Position and alignment of the tows are held
as in any weave. A plain weave has 1 everywhere, and the mean over a repeat is half the sum of the
inverse mean float lengths in warp and weft: 1/2 in a 2/2 twill, 2/5 in a 5-harness satin. It
orders weaves as their shear stiffness is known to be ordered; it does not tell a 2/2 twill from a
2/2 basket, whose floats are as long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import gcd, inf
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Integers
from ..errors import InputError

__all__ = [
    "PLAIN",
    "WEAVES",
    "WeavePattern",
    "basket",
    "biaxial",
    "pattern_from_file",
    "pattern_from_text",
    "plain",
    "satin",
    "twill",
    "unidirectional",
]

Rows = tuple[tuple[int, ...], ...]

UP, DOWN = "1x#", "0.-"
"""Characters of a drawn pattern: warp on top, weft on top."""


@dataclass(frozen=True, slots=True)
class WeavePattern:
    """A repeat of a weave.

    Attributes:
        rows: 1 where the warp tow lies on top, 0 where the weft tow does; a row for each weft tow.
        stitches: 1 where a stitch ties the two tows, in a matrix of the same shape; a tied
            crossing counts as interlaced. Empty: no stitches.
        loose: allow tows that neither interlace nor are stitched.

    Raises:
        ValueError: the matrix is not one of 0 and 1, or a tow holds on to nothing.
    """

    rows: Rows
    stitches: Rows = ()
    loose: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", _binary("pattern", self.rows))
        if len(self.stitches):
            object.__setattr__(self, "stitches", _binary("stitches", self.stitches))
            if self._tied.shape != self.matrix.shape:
                raise ValueError(
                    f"weave: stitches are {_size(self._tied)}, the pattern is {_size(self.matrix)}"
                )
        if self.loose:
            return
        for name, axis in (("warp", 0), ("weft", 1)):
            over = self.matrix.any(axis=axis) & ~self.matrix.all(axis=axis)
            free = ~(over | self._tied.any(axis=axis))
            if free.any():
                raise ValueError(
                    f"weave: {name} tow {np.argmax(free)} of the repeat never changes sides; "
                    "every tow must interlace or be stitched"
                )

    @property
    def matrix(self) -> Integers:
        """The rows as an array, shape (weft repeat, warp repeat)."""
        return np.array(self.rows, dtype=np.int64)

    @property
    def repeat(self) -> tuple[int, int]:
        """Smallest number of warp and of weft tows after which the pattern comes again."""
        both = np.stack([self.matrix, self._tied])
        return _period(both, 2), _period(both, 1)

    def over(self, i: npt.ArrayLike, j: npt.ArrayLike) -> Any:
        """Whether warp tow i lies on top of weft tow j; numbers or arrays of them."""
        return self._repeated(self.matrix.astype(bool), i, j)

    def interlacing(self, i: npt.ArrayLike, j: npt.ArrayLike) -> Any:
        """Share of the four neighbours where warp tow i or weft tow j lies on the other side."""
        return self._repeated(self._weights, i, j)

    @property
    def mean_interlacing(self) -> float:
        """Mean over the repeat."""
        return float(self._weights.mean())

    @property
    def float_length(self) -> tuple[float, float]:
        """Mean number of crossings from one change of sides to the next, of warp and weft tows."""
        size = self.matrix.size
        warp, weft = (int(self._changes(axis).sum()) for axis in (0, 1))
        return size / warp if warp else inf, size / weft if weft else inf

    @property
    def longest_float(self) -> tuple[float, float]:
        """Largest number of crossings without a change of sides, of warp and weft tows."""
        return _longest(self._changes(0).T), _longest(self._changes(1))

    def other_face(self) -> WeavePattern:
        """The fabric seen from below, its warp tows in the same order."""
        return WeavePattern(_tuples(1 - self.matrix), self.stitches, self.loose)

    def turned(self) -> WeavePattern:
        """Warp and weft exchanged, the same face."""
        stitches = _tuples(self._tied.T) if self.stitches else ()
        return WeavePattern(_tuples(1 - self.matrix.T), stitches, self.loose)

    def shifted(self, warp: int, weft: int) -> WeavePattern:
        """The pattern begun at another warp and weft tow."""
        move = (-weft, -warp)
        stitches = _tuples(np.roll(self._tied, move, (0, 1))) if self.stitches else ()
        return WeavePattern(_tuples(np.roll(self.matrix, move, (0, 1))), stitches, self.loose)

    @property
    def _tied(self) -> Integers:
        return np.array(self.stitches) if self.stitches else np.zeros_like(self.matrix)

    @property
    def _weights(self) -> Array:
        changes = np.zeros(self.matrix.shape)
        for axis in (0, 1):
            after = self._changes(axis)
            changes += after + np.roll(after, 1, axis)
        return np.maximum(changes / 4.0, self._tied)

    def _changes(self, axis: int) -> Integers:
        """1 where the next crossing along warp (0) or weft (1) is of the other kind."""
        return self.matrix ^ np.roll(self.matrix, -1, axis)

    def _repeated(self, values: npt.NDArray[Any], i: npt.ArrayLike, j: npt.ArrayLike) -> Any:
        rows, columns = values.shape
        return values[np.asarray(j) % rows, np.asarray(i) % columns]


def plain() -> WeavePattern:
    """Over one, under one."""
    return twill(1, 1)


def twill(over: int, under: int, step: int = 1) -> WeavePattern:
    """Over some, under some, moved by ``step`` warp tows from each weft tow to the next."""
    if over < 1 or under < 1:
        raise ValueError(f"twill: over {over}, under {under}; at least 1 each is needed")
    size = over + under
    if gcd(step, size) != 1:
        raise ValueError(f"twill: step {step} and {size} tows of the repeat have a common factor")
    i, j = np.meshgrid(np.arange(size), np.arange(size))
    return WeavePattern(_tuples((i - step * j) % size < over))


def satin(harnesses: int, shift: int) -> WeavePattern:
    """Each warp tow floats over all weft tows but one; neighbours never interlace side by side.

    Args:
        harnesses: tows of the repeat; 5 and 8 are usual.
        shift: warp tows from a weft tow's interlacing to the next one's.

    Raises:
        ValueError: no satin has these numbers.
    """
    good = [s for s in range(2, harnesses - 1) if gcd(s, harnesses) == 1]
    if shift not in good:
        allowed = ", ".join(map(str, good)) or "none; there is no such satin"
        raise ValueError(f"satin: shift {shift} with {harnesses} harnesses; allowed: {allowed}")
    return twill(harnesses - 1, 1, shift)


def basket(warp: int, weft: int | None = None) -> WeavePattern:
    """A plain weave of groups of warp tows over groups of weft tows (as many unless given)."""
    weft = warp if weft is None else weft
    if warp < 1 or weft < 1:
        raise ValueError(f"basket: groups of {warp} and {weft} tows; at least 1 is needed")
    return WeavePattern(_tuples(np.kron([[1, 0], [0, 1]], np.ones((weft, warp), dtype=int))))


def unidirectional() -> WeavePattern:
    """Warp tows under stitching threads that run along the weft and tie each of them."""
    return WeavePattern(((0,),), stitches=((1,),))


def biaxial(stitches: Sequence[Sequence[int]] = ((1, 0), (0, 1))) -> WeavePattern:
    """Warp tows on weft tows, tied by stitches at some crossings (non-crimp fabric)."""
    tied = _binary("stitches", stitches)
    return WeavePattern(_tuples(np.ones_like(np.array(tied))), tied)


def pattern_from_text(text: str) -> WeavePattern:
    """A pattern from a drawing: a line for each weft tow, ``x`` where the warp lies on top.

    1 and # mean the same as x; 0, . and - the weft on top. Spaces and what follows a % are ignored.

    Raises:
        ValueError: another character, or no weave.
    """
    lines = ["".join(line.split("%")[0].split()) for line in text.splitlines()]
    rows = [line for line in lines if line]
    strange = sorted(set("".join(rows)) - set(UP + DOWN))
    if strange:
        raise ValueError(f"weave: {strange[0]!r} in a drawn pattern; {UP} and {DOWN} are allowed")
    return WeavePattern(tuple(tuple(int(c in UP) for c in row) for row in rows))


def pattern_from_file(path: str | Path) -> WeavePattern:
    """A pattern from a text file, see `pattern_from_text`.

    Raises:
        InputError: the file is missing or no weave.
    """
    path = Path(path)
    try:
        return pattern_from_text(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _binary(what: str, rows: Sequence[Sequence[int]]) -> Rows:
    widths = sorted({len(row) for row in rows})
    if not widths or widths == [0]:
        raise ValueError(f"weave: {what} is empty; rows of 0 and 1 are needed")
    if len(widths) > 1:
        raise ValueError(
            f"weave: {what} has rows of {widths[0]} and {widths[-1]} numbers; a rectangle is needed"
        )
    for row in rows:
        for value in row:
            if value not in (0, 1):
                raise ValueError(f"weave: {what} holds {value!r}; 0 and 1 are allowed")
    return _tuples(rows)


def _tuples(rows: Any) -> Rows:
    return tuple(tuple(int(value) for value in row) for row in rows)


def _size(matrix: Integers) -> str:
    return f"{matrix.shape[0]} x {matrix.shape[1]}"


def _period(stack: Integers, axis: int) -> int:
    """Smallest divisor of the extent by which a shift changes nothing."""
    size = stack.shape[axis]
    return next(
        d
        for d in range(1, size + 1)
        if size % d == 0 and np.array_equal(stack, np.roll(stack, d, axis))
    )


def _longest(changes: Integers) -> float:
    """Longest run between two changes in the rows of a repeating pattern."""
    longest = 0.0
    for row in changes:
        at = np.flatnonzero(row)
        if not len(at):
            return inf
        longest = max(longest, float(np.diff(np.append(at, at[0] + len(row))).max()))
    return longest


PLAIN = plain()

WEAVES: dict[str, WeavePattern] = {
    "plain": PLAIN,
    "twill_2_1": twill(2, 1),
    "twill_2_2": twill(2, 2),
    "twill_3_1": twill(3, 1),
    "satin_5": satin(5, 2),
    "satin_8": satin(8, 3),
    "basket_2": basket(2),
    "unidirectional": unidirectional(),
    "biaxial": biaxial(),
}
"""Patterns by the name that a case uses."""
