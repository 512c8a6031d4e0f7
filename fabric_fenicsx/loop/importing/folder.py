"""Write imported runs as a folder of measured data that says what it was made from."""

from __future__ import annotations

import io
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ...errors import InputError
from ...inputs.keys import documented
from ...inputs.tables import read_table
from ...inputs.validation import dotted_place, mistakes, one_line, parse_yaml
from ..kinds import KINDS
from ..measurement.reading import read_folder
from ..measurement.schema import FILE, SCHEMA
from .target import Target
from .wishes import ImportedRun

__all__ = ["ACCOUNT", "account", "content_of", "write_import"]

ACCOUNT = "import.txt"

OPEN = "FILL_IN"
"""Stands for a value that is not known yet while a text is made."""

SHARED = "runs"


def content_of(
    target: Target, runs: Sequence[Mapping[str, str]], settings: Sequence[str]
) -> tuple[dict[str, Any], list[str]]:
    """The content of a measurement.yaml, and the keys in it that have yet to be filled in.

    Args:
        target: the test.
        runs: keys of each run.
        settings: ``dotted.key=value``; ``runs.key=value`` is of every run.

    Raises:
        InputError: a key or a value is not allowed.
    """
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "test": target.test,
        "title": "",
        "fabric": {},
        "rig": {},
        "runs": [dict(run) for run in runs],
    }
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not key or not equals:
            raise InputError(f"--set: {setting}, allowed is KEY=VALUE")
        value = parse_yaml(text, f"--set {key}", places=False)
        path = key.split(".")
        every = path[0] == SHARED and len(path) > 1 and not path[1].isdecimal()
        places = [[SHARED, str(k), *path[1:]] for k in range(len(runs))] if every else [path]
        for place in places:
            _put(content, place, value, key)
    missing = []
    for group in ("fabric", "rig"):
        if not isinstance(content[group], dict):
            raise InputError(f"--set: {group}, allowed are its keys, as {group}.KEY=VALUE")
    for known in documented(target.keys):
        if known.default != "needed":
            continue
        group, _, name = known.name.rpartition(".")
        if group == "runs[]":
            missing += [
                f"runs.{k}.{name}" for k, run in enumerate(content["runs"]) if name not in run
            ]
        elif group in ("fabric", "rig") and name not in content[group]:
            missing.append(known.name)
    _, problems = mistakes(target.keys, content)
    wrong = [text for place, text in problems if dotted_place(place) not in missing]
    if wrong:
        raise InputError(one_line(f"--set: {wrong[0]}"))
    if not content["title"]:
        del content["title"]
    return content, missing


def _put(content: dict[str, Any], place: Sequence[str], value: Any, key: str) -> None:
    at: Any = content
    for part in place[:-1]:
        if isinstance(at, list):
            at = at[int(part)] if part.isdecimal() and int(part) < len(at) else None
        elif isinstance(at, dict):
            at = at.setdefault(part, {})
        if not isinstance(at, (dict, list)):
            raise InputError(f"--set: {key}, allowed is a key of {FILE}, or runs.0.KEY of a run")
    if not isinstance(at, dict) or list(place) == [SHARED]:
        raise InputError(f"--set: {key}, allowed is a key of {FILE}, or runs.0.KEY of a run")
    at[place[-1]] = value


def write_import(
    folder: Path,
    target: Target,
    runs: Mapping[str, ImportedRun],
    content: Mapping[str, Any],
    missing: Sequence[str],
) -> None:
    """Write the folder, once it is known that `diagnose` will read it.

    Args:
        folder: new, or empty.
        target: the test.
        runs: by the name of their CSV.
        content: of its measurement.yaml.
        missing: its keys that have yet to be filled in.

    Raises:
        InputError: there is something in it already, or a reading is not allowed.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: exists, allowed is a new or an empty folder")
    with tempfile.TemporaryDirectory() as name:
        staged = Path(name) / "folder"
        staged.mkdir()
        for file, run in runs.items():
            (staged / file).write_text(_csv(target, run), encoding="utf-8")
        (staged / FILE).write_text(_yaml(target, content, missing), encoding="utf-8")
        (staged / ACCOUNT).write_text(account(runs), encoding="utf-8")
        _check(staged, target, runs, missing)
        try:
            shutil.copytree(staged, folder, dirs_exist_ok=True)
        except OSError as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"{folder}: cannot be written ({reason})") from None


def _check(
    staged: Path, target: Target, runs: Mapping[str, ImportedRun], missing: Sequence[str]
) -> None:
    """Read what was written as a diagnosis does; a mistake is told of the export it is from."""
    try:
        if not missing:
            read_folder(staged, KINDS)
            return
        for file in runs:
            read_table(staged / file, target.columns, target.fewest)
    except InputError as error:
        text = str(error)
        for file, run in runs.items():
            text = text.replace(str(staged / file), str(run.path))
        raise InputError(text.replace(f"{staged / FILE}: ", "--set: ")) from None


def _csv(target: Target, run: ImportedRun) -> str:
    names = [column.name for column in target.columns if column.name in run.columns]
    cells = [
        ["" if np.isnan(value) else f"{value + 0.0:.12g}" for value in run.columns[name]]
        for name in names
    ]
    return "\n".join([",".join(names), *(",".join(row) for row in zip(*cells, strict=True)), ""])


def _yaml(target: Target, content: Mapping[str, Any], missing: Sequence[str]) -> str:
    """The text of a measurement.yaml, with a mark where a value has to be filled in."""
    known = {key.name: key for key in documented(target.keys)}
    whole: dict[str, Any] = {**content, "runs": [dict(run) for run in content["runs"]]}
    whole |= {"fabric": dict(content["fabric"]), "rig": dict(content["rig"])}
    marks: list[str] = []
    for dotted in missing:
        *groups, name = dotted.split(".")
        at: Any = whole
        for part in groups:
            at = at[int(part)] if isinstance(at, list) else at[part]
        at[name] = f"{OPEN}{len(marks)}"
        key = known[
            ".".join(
                "runs[]" if part == "runs" else part for part in groups if not part.isdecimal()
            )
            + f".{name}"
        ]
        marks.append(f" # FILL IN {key.allowed}: {key.description}")
    text = yaml.safe_dump(whole, sort_keys=False, allow_unicode=True)
    for k, mark in reversed(list(enumerate(marks))):
        text = text.replace(f" {OPEN}{k}\n", f"{mark}\n")
    head = [f"# Imported; {ACCOUNT} says from which files and columns."]
    if missing:
        head.append(f"# Not known yet: {', '.join(missing)}.")
    return "\n".join([*head, text])


def account(runs: Mapping[str, ImportedRun], width: int = 200) -> str:
    """What was taken for what, as a table, and which rows were left out."""
    table = Table()
    for heading in ("file", "from", "column", "taken from", "unit", "factor"):
        table.add_column(heading, no_wrap=heading == "column", overflow="fold")
    notes = []
    for file, run in runs.items():
        source = f"{run.path.name}, {run.label}" if run.label else run.path.name
        for k, taken in enumerate(run.taken):
            table.add_row(
                file if k == 0 else "",
                escape(source) if k == 0 else "",
                taken.column,
                escape(taken.heading) or "-",
                escape(taken.unit) or "-",
                "-" if taken.factor is None else f"{taken.factor:.12g}",
                end_section=k == len(run.taken) - 1,
            )
        last = f"line {run.lines[0]} to {run.lines[-1]}"
        notes.append(f"{file}: {len(run.lines)} readings, {last} of {run.path}")
        said = [f"{t.column}: {'; '.join(t.remarks)}" for t in run.taken if t.remarks]
        notes += [f"{file}: {words}" for words in (*said, *run.notes)]
    console = Console(file=io.StringIO(), width=width, highlight=False)
    console.print(table)
    for note in notes:
        console.print(escape(note), soft_wrap=True)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()
