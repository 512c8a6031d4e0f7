"""From a folder of measured data to a checked measurement, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml
from pydantic import Field, create_model

from ...arrays import Array
from ...errors import InputError
from ...inputs.groups import Keys, Positive
from ...inputs.keys import plain
from ...inputs.tables import read_table
from ...inputs.validation import read_keys
from .kind import Kind
from .schema import FILE, SCHEMA, Measurement, MeasurementKeys, Run, RunKeys

__all__ = ["measurement_models", "read_folder", "write_folder"]


#: Keys of an entry of ``runs`` that every kind has.
COMMON = RunKeys.model_fields
#: Least noise that can be meant, as a share of the largest reading: round-off is not far below.
LEAST_NOISE = 1e-9
#: Decimals of columns that are not compared.
DECIMALS = {"time_s": 6, "displacement_mm": 6}


def read_folder(folder: Path, kinds: Sequence[Kind]) -> Measurement:
    """Read and check a folder of measured data.

    Args:
        folder: with a measurement.yaml.
        kinds: of measurements that there are.

    Raises:
        InputError: one line with the file, the key or column, and what is allowed.
    """
    if not folder.is_dir():
        what = "is a file" if folder.exists() else "no such folder"
        raise InputError(f"{folder}: {what}, allowed is a folder with a {FILE}")
    path = folder / FILE
    keys = read_keys(path, "a measurement", SCHEMA, "test", measurement_models(kinds))
    kind = next(kind for kind in kinds if kind.name == keys.test)
    if problem := _problem(keys, kind):
        raise InputError(f"{path}: {problem}")
    runs = []
    for entry in keys.runs:
        columns = read_table(folder / entry.file, kind.columns, kind.fewest)
        for column, wrong, allowed in kind.mistakes(keys.rig, columns):
            if wrong.any():
                i = int(np.argmax(wrong))
                raise InputError(
                    f"{folder / entry.file}: {column}: {columns[column][i]:g} in reading {i + 1}, "
                    f"allowed is {allowed}"
                )
        own = {name: getattr(entry, name) for name in kind.run.model_fields if name not in COMMON}
        holdout = entry.role == "holdout"
        runs.append(Run(entry.file, holdout, entry.label, columns, entry.specimen, own))
    noise = getattr(keys.noise, kind.quantity)
    # Of a run there may be none, only what is measured besides.
    every = np.abs(np.concatenate([run.columns[kind.quantity] for run in runs]))
    largest = float(np.fmax.reduce(every, initial=0.0))
    if noise is not None and noise < LEAST_NOISE * largest:
        raise InputError(
            f"{path}: noise.{kind.quantity}: {noise:g} beside readings of up to {largest:g}, "
            f"allowed is {LEAST_NOISE * largest:.2g} or more"
        )
    sigmas = {name: getattr(keys.noise, name) for name in kind.besides}
    return Measurement(
        folder,
        kind.name,
        keys.title,
        keys.fabric,
        keys.rig,
        noise,
        tuple(runs),
        {name: sigma for name, sigma in sigmas.items() if sigma is not None},
    )


def measurement_models(kinds: Sequence[Kind]) -> dict[str, type[MeasurementKeys]]:
    """The keys of a measurement of each kind."""
    # More than a kind's own noise may be kept in one place for several kinds.
    sigmas: dict[str, Any] = {
        kind.quantity: (Positive | None, Field(None, description=f"of the {kind.label}"))
        for kind in kinds
    }
    for name in (name for kind in kinds for name in kind.besides):
        sigmas[name] = (Positive | None, Field(None, description=f"of {name}"))
    noise = create_model("NoiseKeys", __base__=Keys, __doc__="One sigma of a reading.", **sigmas)
    models = {}
    for kind in kinds:
        own: dict[str, Any] = {
            "test": (Literal[kind.name], Field(description="which test")),
            "rig": (kind.rig, Field(description="the rig")),
            "runs": (list[kind.run], Field(min_length=1, description="the readings")),  # type: ignore[name-defined]
            "noise": (noise, Field(default_factory=noise, description="one sigma of a reading")),
        }
        models[kind.name] = create_model(f"{kind.name} keys", __base__=MeasurementKeys, **own)
    return models


def _problem(keys: Any, kind: Kind) -> str | None:
    """What is wrong with keys that are right one by one: the key, and what is allowed."""
    given = [name for name, value in keys.noise if value is not None]
    if given and not {kind.quantity, *kind.besides} & set(given):
        return (
            f"noise.{given[0]}: of another test, allowed is {kind.quantity} with test: {kind.name}"
        )
    files = [entry.file for entry in keys.runs]
    for i, name in enumerate(files):
        if not name.isprintable():
            return f"runs.{i}.file: {plain(name)}, allowed is the name of a CSV"
        if name in files[:i]:
            return f"runs.{i}.file: {name!r} stands twice, allowed is once"
    if all(entry.role == "holdout" for entry in keys.runs):
        return "runs: every role is holdout, needed is at least one run with role: fit"
    return kind.wrong_rig(keys.rig)


def write_folder(
    folder: Path,
    kind: Kind,
    content: Mapping[str, Any],
    noise: float,
    tables: Mapping[str, Mapping[str, Array]],
) -> None:
    """Write a folder that ``read_folder`` reads.

    Args:
        folder: new, or empty.
        kind: of the measurement.
        content: of its measurement.yaml.
        noise: one sigma of a reading, which says how many decimals are written.
        tables: columns of each CSV file, by its name, (n,) each.

    Raises:
        InputError: there is something in it already.
        OSError: it cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: exists, allowed is a new or an empty folder")
    folder.mkdir(parents=True, exist_ok=True)
    # Three decimals more than the noise.
    last = max(0, 3 - int(np.floor(np.log10(noise))))
    for file, columns in tables.items():
        names = [column.name for column in kind.columns if column.name in columns]
        texts = [[f"{v:.{DECIMALS.get(name, last)}f}" for v in columns[name]] for name in names]
        lines = [",".join(names), *(",".join(row) for row in zip(*texts, strict=True))]
        (folder / file).write_text("\n".join(lines) + "\n", encoding="utf-8")
    text = yaml.safe_dump(dict(content), sort_keys=False, allow_unicode=True)
    (folder / FILE).write_text(text, encoding="utf-8")
