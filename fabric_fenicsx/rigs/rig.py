"""What the package knows of a rig: a test of a fabric that a case file can ask for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ..fabric.paths import TowPaths
from .cases import Case

if TYPE_CHECKING:
    from .common import Session

__all__ = ["Compared", "Rig"]

C = TypeVar("C", bound=Case)


@dataclass(frozen=True, slots=True)
class Compared:
    """A rig's table, whose rows one run has like another of a case that differs in its fabric.

    Attributes:
        file: its name in the results.
        columns: what depends on the fabric.
        along: the column in which rows of one run lie between those of another, increasing; None:
            both have the same rows.
    """

    file: str
    columns: tuple[str, ...]
    along: str | None = None


@dataclass(frozen=True, slots=True)
class Rig(Generic[C]):
    """A rig. Its file defines one as ``RIG``; `rigs/registry.py` has the names of the files.

    Reading and checking a case is done without dolfinx, which takes a second to import: a rig's
    file imports it, and all of solving, mechanics and output, inside the functions that run.

    Attributes:
        case: the model of its keys. Its docstring says what the rig is, and `test` is
            ``Literal["NAME"]`` with the name of the file.
        fabrics: what a case meshes, each specimen by name, the smallest first; the folder is the
            one that files in the case count from. A ValueError is a sheet that cannot be.
        run: runs a case and writes its results into the session's folder; returns the content of
            result.json (`rigs.common.extend`). Collective.
        check: raises ValueError or InputError where the tows do not fit into the sheet, without
            reading a file; None: what `fabrics` raises.
        read_files: reads what files a case names beside its mesh, for ``fabric-fenicsx check``;
            raises InputError.
        crossing_gap: largest distance in height of the two nodes of a crossing [mm].
        quarter: whether what a case models is the part x >= 0, y >= 0 of a symmetric sheet.
        steps: time steps of one specimen, from what runs took; None: no estimate is made.
        iterations: of Newton for each step, from what runs took.
        compared: what a run with another fabric is compared by; None: by its quantities alone.
    """

    case: type[C]
    fabrics: Callable[[C, Path], dict[str, TowPaths]]
    run: Callable[[C, Session], dict[str, Any]]
    check: Callable[[C], object] | None = None
    read_files: Callable[[C, Path], object] = lambda case, base: None
    crossing_gap: Callable[[C], float] = lambda case: 0.0
    quarter: Callable[[C], bool] = lambda case: False
    steps: Callable[[C], float] | None = None
    iterations: float = 3.0
    compared: Compared | None = None
