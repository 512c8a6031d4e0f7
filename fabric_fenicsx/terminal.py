"""What a run says while it goes on and when it has ended. Rank 0 only; needs no dolfinx."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from .inputs.keys import unit

__all__ = [
    "counting",
    "following",
    "searching",
    "show_quantities",
    "summarise",
    "summarise_convergence",
    "summarise_diagnosis",
]

COMPILING = "compiling forms, about a minute on a first run"

HEADINGS = {
    "x_mm": "x \\[mm]",
    "y_mm": "y \\[mm]",
    "measured_deg": "measured [°]",
    "std_deg": "± [°]",
    "paper_deg": "paper [°]",
    "angle_deg": "this run [°]",
    "kinematic_deg": "kinematic net [°]",
}

UNSHOWN = ("shear_deg", "director_turn_deg")
"""Of a drape's points, in result.json only: a table has no room for them."""


class Following:
    """Tells of steps on stderr: a bar on a terminal, else only of a first compilation."""

    def __init__(self, bar: Progress | None) -> None:
        self._bar = bar
        self._task = bar.add_task("preparing", total=1.0, steps="") if bar else None
        self._begun = threading.Event()

    def __call__(self, fraction: float, steps: int, iterations: int) -> None:
        """Progress of the run: fraction done, accepted steps, iterations of the last one."""
        self._begun.set()
        if self._bar is not None and self._task is not None:
            self._bar.update(
                self._task, completed=fraction, description="running", steps=f"{steps} steps"
            )

    def end(self) -> None:
        """Stop to watch."""
        self._begun.set()

    def watch_compilation(self) -> None:
        """Say so once if forms are compiled and not just read from the cache."""
        while not self._begun.wait(0.5):
            module = sys.modules.get("fabric_fenicsx._dolfinx")
            spent = getattr(module, "compile_seconds", [0.0])
            if spent[0] > 2.0:
                if self._bar is not None and self._task is not None:
                    self._bar.update(self._task, description=COMPILING)
                else:
                    print(COMPILING, file=sys.stderr, flush=True)
                return


@contextmanager
def following() -> Iterator[Any]:
    """A function (fraction, steps, iterations) that shows progress."""
    console = Console(stderr=True)
    bar = None
    if console.is_terminal:
        bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[steps]}"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
        )
        bar.start()
    watcher = Following(bar)
    threading.Thread(target=watcher.watch_compilation, daemon=True).start()
    try:
        yield watcher
    finally:
        watcher.end()
        if bar is not None:
            bar.stop()


@contextmanager
def counting(what: str, total: int) -> Iterator[Any]:
    """A function that is told how many of a number of things are done; shown on a terminal."""
    console = Console(stderr=True)
    with Progress(
        TextColumn(what),
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f}"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def searching(quiet: bool) -> Iterator[Callable[[float, str], None]]:
    """A function (share done, what is being done) that shows both on a terminal unless quiet."""
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description:<45}"),
        BarColumn(),
        TaskProgressColumn(),
        console=console,
        transient=True,
        disable=quiet or not console.is_terminal,
    ) as bar:
        task = bar.add_task("reading", total=1.0)
        yield lambda share, what: bar.update(task, completed=share, description=what)


def summarise_diagnosis(report: dict[str, Any], folder: Any) -> None:
    """Print what a diagnosis found, test by test, and where its page is."""
    console = Console(highlight=False)
    for test, part in report.get("tests", {report["test"]: report}).items():
        console.print(f"{test}: {part['verdict']}", soft_wrap=True)
        console.print(part["headline"], soft_wrap=True)
        table = Table()
        for heading in ("", "parameter", "value", "±", "unit"):
            table.add_column(heading, no_wrap=True, overflow="fold")
        found = [*part["effects"], *part["beside"], *part["discovered"]]
        for effect in [{"name": "baseline", **part["baseline"]}, *found]:
            for k, (name, value) in enumerate(effect["parameters"].items()):
                table.add_row(
                    "" if k else effect["name"],
                    name,
                    _shown(value),
                    _shown(effect["std"][name]),
                    part["parameters"][name]["unit"],
                )
        if table.row_count:
            console.print(table)
        error = part["error"]
        table = Table(f"error, {error['quantity']}", "before", "after", "noise")
        for kind, label in (("fit", "fitted"), ("holdout", "held out")):
            row = [_shown(error[when][kind]) for when in ("before", "after")]
            table.add_row(label, *row, _shown(error["noise"]))
        console.print(table)
    console.print(f"report in {folder / 'report.html'}", soft_wrap=True)
    console.print(f"for run CASE.yaml --fabric: {folder / 'fabric.yaml'}", soft_wrap=True)


def summarise_convergence(study: dict[str, Any], folder: Any) -> None:
    """Print changes, orders and errors of a convergence study, family by family."""
    console = Console(highlight=False)
    for family in study["families"]:
        done = [level["value"] for level in family["levels"] if level["completed"]]
        for level in family["levels"]:
            if not level["completed"]:
                console.print(f"{level['folder']}: {level['stopped_because']}", soft_wrap=True)
        steps = [f"{a:g} → {b:g}" for a, b in pairwise(done)]
        title = escape(f"{family['varied']}: root mean square (largest) changes")
        table = Table("", *steps, "order", "error", "±", title=title, title_justify="left")
        for row in family["regions"]:
            pairs = zip(row["changes_deg"], row["largest_deg"], strict=True)
            changes = [f"{rms:.3f} ({abs(largest):.2f})" for rms, largest in pairs]
            table.add_row(escape(f"shear, {row['region']} [°]"), *changes, *_estimated(row))
        for row in family["quantities"]:
            changes = [f"{b - a:+.3f}" for a, b in pairwise(row["values"])]
            table.add_row(escape(row["name"]), *changes, *_estimated(row))
        if table.row_count:
            console.print(table)
    total = study["total"]
    found = total["regions"]["all"]
    if found is not None:
        console.print(
            f"shear angle of the case: error {found['error']:.2f}° rms, with its factors of safety "
            f"{found['uncertainty']:.2f}°; {total['combination']} ({', '.join(total['of'])})",
            soft_wrap=True,
        )
    console.print(f"results in {folder}", soft_wrap=True)


def _estimated(row: dict[str, Any]) -> tuple[str, ...]:
    order = row["basis"] if row["order"] is None else f"{row['order']:.2f}"
    numbers = (row["error"], row["uncertainty"])
    return order, *("-" if number is None else f"{number:.3f}" for number in numbers)


def summarise(result: dict[str, Any], folder: Any) -> None:
    """Print the quantities of a result, and lists of them as tables of their own."""
    console = Console(highlight=False)
    seconds = result["seconds"]["total"]
    console.print(
        f"{result['test']}: {result['steps']} steps, {result['newton_iterations']} iterations, "
        f"{seconds:.1f} s; results in {folder}",
        soft_wrap=True,
    )
    if "fabric" in result:
        _show_fabric(console, result["fabric"])
    show_quantities(console, result.get("quantities", {}))
    if "uncertainty" in result:
        _show_uncertainty(console, result["uncertainty"])
    error = result.get("discretisation_error")
    if error is not None:
        console.print(
            f"error of the {error['of']}: about {error['estimate_deg']:.2g}°, by {error['source']}",
            soft_wrap=True,
        )


def _show_fabric(console: Console, fabric: dict[str, Any]) -> None:
    """Which numbers are not the case's own, and what their file does not say."""
    table = Table()
    for heading in ("from the fabric's file", "value", "±", "found in"):
        table.add_column(heading, overflow="fold")
    for row in fabric["taken"]:
        value = f"{len(row['value'])} values" if isinstance(row["value"], list) else row["value"]
        table.add_row(row["key"], _shown(value), _shown(row["std"]), row["source"])
    console.print(table)
    for test in fabric["tests"]:
        if test["known"]:
            console.print(f"{test['test']}: {test['known']}", soft_wrap=True)
    for name, words in (
        ("of_the_case", "not in the file, as in the case"),
        ("not_of_the_fabric", "not of the fabric, left out"),
        ("without_a_key", "of the fabric, but no case has it"),
    ):
        if fabric[name]:
            console.print(f"{words}: {', '.join(fabric[name])}", soft_wrap=True)


def _show_uncertainty(console: Console, found: dict[str, Any]) -> None:
    """Quantities with what the fit and the specimens leave open; of the health in the file only."""
    for name, row in found["quantities"].items():
        if name.startswith("health.") or name.rpartition(".")[2] in UNSHOWN:
            continue
        words = name.removesuffix(_ending(name)).replace("_", " ").replace(".", " ")
        console.print(
            f"{words} {_shown(row['value'])} ± {row['fit']:.2g} {unit(name)} (fit) "
            f"± {row['specimens']:.2g} (specimens)",
            soft_wrap=True,
        )
    for row in found.get("regions", []):
        console.print(
            f"angles, {row['region']}: ± {row['fit_deg']:.2g}° (fit) "
            f"± {row['specimens_deg']:.2g}° (specimens), rms",
            soft_wrap=True,
        )


def show_quantities(console: Console, quantities: dict[str, Any]) -> None:
    """Print quantities, and lists of them as tables of their own."""
    table = Table("quantity", "value", "unit")
    for name, value in quantities.items():
        if isinstance(value, (int, float, str)):
            label = unit(name)
            table.add_row(name.removesuffix(_ending(name)).replace("_", " "), _shown(value), label)
    if table.row_count:
        console.print(table)
    for name, value in quantities.items():
        if isinstance(value, list) and value and all(isinstance(row, dict) for row in value):
            console.print(_rows(name, value))


def _rows(name: str, rows: list[dict[str, Any]]) -> Table:
    columns = [
        key
        for key in dict.fromkeys(key for row in rows for key in row)
        if key not in UNSHOWN and all(not isinstance(row.get(key), (list, dict)) for row in rows)
    ]
    titles = [HEADINGS.get(key) or _heading(key) for key in columns]
    table = Table(*titles, title=name, title_justify="left")
    for row in rows:
        table.add_row(*(_shown(row.get(key)) for key in columns))
    return table


def _heading(key: str) -> str:
    words = key.removesuffix(_ending(key)).replace("_", " ")
    return f"{words} \\[{unit(key)}]" if unit(key) else words


def _ending(name: str) -> str:
    """The part of a name that is its unit."""
    from .inputs.keys import UNITS

    return next(("_" + end for end in UNITS if name.endswith("_" + end)), "")


def _shown(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
