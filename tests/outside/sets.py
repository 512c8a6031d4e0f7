"""What a set is: its runs, its truth, and how it is written as a measurement folder."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

Array = NDArray[np.float64]

DIGITS = {"time_s": 7, "displacement_mm": 6, "force_N": 7, "length_mm": 3, "s_mm": 4}


UNDECIDED = 10.0  # a difference of log-likelihoods that decides nothing


@dataclass
class Run:
    """One CSV file: its columns by name, its role and the specimen it was measured on."""

    columns: dict[str, Array]
    role: str = "fit"
    specimen: str | None = None
    label: str = ""


@dataclass(frozen=True)
class Term:
    """What a term acts on and the variables it depends on, in the words of the contract."""

    acts_on: str
    depends_on: frozenset[str]

    def __str__(self) -> str:
        return f"{self.acts_on}: {' '.join(sorted(self.depends_on))}"


def terms(text: str) -> tuple[Term, ...]:
    """Terms written as ``moment: rate path | travel: force``; the first is the truth."""
    parts = (part.split(":") for part in text.split("|"))
    return tuple(Term(acts.strip(), frozenset(on.split())) for acts, on in parts)


def not_parted(left: dict[str, float], right: tuple[Term, ...], rows: int) -> tuple[Term, ...]:
    """The terms of no more variables that leave too little to be told from the true one.

    ``left`` is in units of the noise; ``rows`` is the number of fitted readings.
    """
    limit = np.sqrt(2 * UNDECIDED / rows)
    most = len(right[0].depends_on)
    near = [term for words, rest in left.items() if rest < limit for term in terms(words)]
    return tuple(term for term in near if term not in right and len(term.depends_on) <= most)


@dataclass
class Truth:
    """What is known of a set, and which answers are right.

    ``accept`` lists the sets of names that are right; the empty set stands for ``no_effect``.
    ``unlisted`` says that ``unexplained`` and ``effect_discovered`` are right.
    ``rivals`` are pairs of which one is to be named with the other among its rivals.
    ``fairness`` holds residuals over the noise: of the baseline, of each listed effect, ...
    ``terms`` has, for each effect that is to be discovered, what it is and what else is right.
    ``noise_held_out`` is the noise of the held-out readings alone.
    """

    effects: tuple[str, ...] = ()
    forms: tuple[str, ...] = ()
    accept: list[frozenset[str]] = field(default_factory=list)
    unlisted: bool = False
    rivals: tuple[str, ...] = ()
    parameters: dict[str, float] = field(default_factory=dict)
    noise_rms: float = 0.0
    noise_held_out: float = 0.0
    terms: tuple[tuple[Term, ...], ...] = ()
    fairness: dict[str, Any] = field(default_factory=dict)


@dataclass
class MeasurementSet:
    """A measurement with its truth; ``further`` makes one more run of the same truth.

    ``further`` takes what a person can do at the rig: for a frame a table of times and places of
    the crosshead (seconds, mm), for a strip an overhang (mm).  ``advice`` is such a description
    that parts the two effects of a set that cannot tell them apart.
    """

    name: str
    family: str
    test: str
    fault: str
    fabric: dict[str, Any]
    rig: dict[str, float]
    noise: dict[str, float]
    runs: list[Run]
    truth: Truth
    further: Callable[[Any], Run] | None = None
    advice: Any = None

    def with_run(self, run: Run) -> MeasurementSet:
        """The same set with one more run to be fitted."""
        return replace(self, runs=[*self.runs, run])

    def write(self, folder: Path, specimens: bool = True) -> Path:
        """Write the folder; ``specimens=False`` leaves the ``specimen`` keys out."""
        folder.mkdir(parents=True, exist_ok=True)
        entries = []
        for number, run in enumerate(self.runs, 1):
            name = f"run{number}.csv"
            _write_csv(folder / name, run.columns)
            entry = {"file": name, "role": run.role}
            if run.label:
                entry["label"] = run.label
            if specimens and run.specimen is not None:
                entry["specimen"] = run.specimen
            entries.append(entry)
        document: dict[str, Any] = {
            "schema": "fabric-measurement/1",
            "test": self.test,
            "title": "a set made from the contract alone",
            "fabric": self.fabric,
            "rig": self.rig,
        }
        if self.noise:
            document["noise"] = self.noise
        document["runs"] = entries
        (folder / "measurement.yaml").write_text(yaml.safe_dump(document, sort_keys=False))
        return folder


def _write_csv(path: Path, columns: dict[str, Array]) -> None:
    """Write columns of equal length; a value that is not a number leaves its cell empty."""
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            writer.writerow(
                "" if np.isnan(value) else f"{value:.{DIGITS.get(name, 6)}f}"
                for name, value in zip(columns, row, strict=True)
            )
