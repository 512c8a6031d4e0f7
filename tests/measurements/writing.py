"""Writes a measurement folder; what is in the data is told to the caller, never to the folder."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

TITLES = ("plain weave, sheet 4", "dry fabric, second delivery", "glass roving cloth", "series B")
LABELS = ("first", "second", "repeat", "afternoon")


@dataclass(frozen=True)
class Run:
    """One CSV: its columns by name, in the order written; a column of None is written empty."""

    columns: dict[str, np.ndarray | None]
    role: str


@dataclass(frozen=True)
class Truth:
    """What was put into a set.

    `verdict` is what a report should say, `acceptable` the sets of names that are right answers
    (empty set: no effect named), `near` a listed effect that an unlisted one resembles,
    `effect_to_noise` the rms that a refitted baseline leaves of the noise-free data, over sigma.
    """

    name: str
    test: str
    verdict: str
    effects: list[dict[str, Any]]
    acceptable: list[frozenset[str]]
    baseline: dict[str, float]
    noise: float
    noise_declared: bool
    effect_to_noise: float
    near: str | None = None
    remarks: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Measurement:
    """A set before it is written. `model` is what simulated it, for studies of rivals."""

    truth: Truth
    fabric: dict[str, Any]
    rig: dict[str, Any]
    noise: dict[str, float]
    runs: list[Run]
    model: Any
    digits: dict[str, int]


def _csv(run: Run, digits: dict[str, int], path: Path, end: str) -> None:
    names = list(run.columns)
    count = next(len(c) for c in run.columns.values() if c is not None)
    texts = []
    for name, column in run.columns.items():
        if column is None:
            texts.append([""] * count)
        elif name in digits:
            texts.append([f"{value:.{digits[name]}f}" for value in column])
        else:
            texts.append([f"{value:.9g}" for value in column])
    lines = [",".join(names), *(",".join(row) for row in zip(*texts, strict=True))]
    path.write_text(end.join(lines) + end, newline="")


def write(measurement: Measurement, folder: Path, rng: np.random.Generator) -> Truth:
    """Write `measurement.yaml` and the CSVs into `folder` (made); the truth comes back."""
    folder.mkdir(parents=True, exist_ok=True)
    end = "\r\n" if rng.uniform() < 0.15 else "\n"
    labelled = rng.uniform() < 0.5
    stem = rng.choice(["run", "specimen_", "test-"])
    runs = []
    for i, run in enumerate(measurement.runs):
        entry = {"file": f"{stem}{i + 1}.csv", "role": run.role}
        if labelled:
            entry["label"] = LABELS[i % len(LABELS)]
        runs.append(entry)
        _csv(run, measurement.digits, folder / entry["file"], end)
    content = {
        "schema": "fabric-measurement/1",
        "test": measurement.truth.test,
        "title": str(rng.choice(TITLES)),
        "fabric": measurement.fabric,
        "rig": measurement.rig,
        **({"noise": measurement.noise} if measurement.noise else {}),
        "runs": runs,
    }
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
    (folder / "measurement.yaml").write_text(text)
    return measurement.truth
