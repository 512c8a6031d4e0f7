"""From folders of measured data to what the model lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import FitError, InputError, SolveError
from .collective import collective, from_root

if TYPE_CHECKING:
    from ..loop.inference.diagnosis import Diagnosis
    from ..loop.inference.effects import Effect
    from ..loop.inference.experiment import Experiment
    from ..loop.measurement.reading import Measurement

__all__ = ["diagnose"]

Test = tuple["Experiment", list["Measurement"]]


def diagnose(
    folders: Annotated[
        list[Path], typer.Argument(metavar="FOLDER...", help="Each with a measurement.yaml.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Report; default: results/diagnosis_ and the folder's name"
        ),
    ] = None,
    effects: Annotated[
        str | None,
        typer.Option("--effects", metavar="NAME,NAME", help="Try these effects only."),
    ] = None,
    effects_from: Annotated[
        Path | None,
        typer.Option("--effects-from", metavar="FILE.py", help="Your own laws or EFFECTS. Is run."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")] = False,
) -> None:
    """Fit the model to measurements and name the effects that it lacks.

    Several folders are tests of one fabric. Writes report.json, report.html and its figures. Exit
    code 2: bad input, nothing has been written. 3: the baseline model could not be fitted.
    """
    target = out if out is not None else _default(folders)

    def action(comm: Any) -> int:
        _diagnose(comm, folders, target, effects, effects_from, quiet)
        return 0

    raise typer.Exit(collective(action))


def _default(folders: Sequence[Path]) -> Path:
    names = "_".join(folder.resolve().name for folder in folders)
    return Path("results") / f"diagnosis_{names}"


def _diagnose(
    comm: Any,
    folders: Sequence[Path],
    out: Path,
    effects: str | None,
    effects_from: Path | None,
    quiet: bool,
) -> None:
    """Rank 0 searches, which takes seconds with small systems; the others wait."""
    from mpi4py import MPI

    from ..loop.inference.effects import read_effects
    from ..loop.registry import ORDER, experiment_class
    from ..terminal import searching, summarise_diagnosis

    measurements = from_root(comm, lambda: _read(folders))
    # On every rank: these import PETSc, which starts up in all processes at once.
    for test in ORDER:
        if any(m.test == test for m in measurements):
            experiment_class(test)
    from ..output.record import prepare_folder

    def search() -> dict[str, Any]:
        own = read_effects(effects_from) if effects_from is not None else []
        tests = _prepared(measurements, own)
        names = _wanted(effects, tests)
        for experiment, _ in tests:
            # Drapes must first be given what the other tests find.
            if experiment.test != "drape":
                _try_out(experiment, own)
        prepare_folder(out, MPI.COMM_SELF)
        return _report(tests, names, own, out, progress)

    with searching(quiet or comm.rank != 0) as progress:
        report = from_root(comm, search)
    if comm.rank == 0 and not quiet:
        summarise_diagnosis(report, out)


def _read(folders: Sequence[Path]) -> list[Measurement]:
    from ..loop.measurement.reading import read_measurement

    places = [folder.resolve() for folder in folders]
    for i, folder in enumerate(folders):
        if places[i] in places[:i]:
            raise InputError(f"{folder}: stands twice, allowed is once")
    return [read_measurement(folder) for folder in folders]


def _prepared(measurements: Sequence[Measurement], own: Sequence[Effect]) -> list[Test]:
    """The experiment of each test with its measurements."""
    from ..loop.registry import ORDER, experiment_class

    tests: list[Test] = []
    for test in ORDER:
        same = [m for m in measurements if m.test == test]
        if same:
            mine = [effect for effect in own if effect.test == test]
            try:
                tests.append((experiment_class(test)(same, mine), same))
            except SolveError as error:
                raise _unfitted(test, error) from error
    for experiment, _ in tests:
        known = [effect.name for effect in experiment.effects]
        for name in known:
            if known.count(name) > 1:
                raise InputError(f"--effects-from: {name}: stands twice, allowed is a new name")
    return tests


def _report(
    tests: Sequence[Test],
    names: Sequence[str] | None,
    own: Sequence[Effect],
    out: Path,
    progress: Callable[[float, str], None],
) -> dict[str, Any]:
    """Search and write; report.json comes last."""
    from ..loop.registry import hand_on
    from ..loop.report.content import combined_report, test_report, write_report
    from ..loop.report.page import write_page

    parts: list[tuple[Diagnosis, dict[str, Any]]] = []
    for number, (experiment, measurements) in enumerate(tests):
        hand_on(experiment, [diagnosis for diagnosis, _ in parts])
        if experiment.test == "drape":
            _try_out(experiment, own)
        diagnosis = _search(experiment, names, _part(progress, number, len(tests)))
        parts.append((diagnosis, test_report(diagnosis, measurements)))
    report = combined_report([part for _, part in parts])
    progress(1.0, "drawing")
    try:
        write_page(out, parts)
        write_report(out, report)
    except OSError as error:
        raise InputError(f"{out}: the report cannot be written ({error.strerror})") from error
    return report


def _wanted(effects: str | None, tests: Sequence[Test]) -> list[str] | None:
    """The names of --effects; None for all of them."""
    from ..inputs.keys import one_of

    if effects is None:
        return None
    allowed = [effect.name for experiment, _ in tests for effect in experiment.effects]
    names = [name.strip() for name in effects.split(",")]
    for name in names:
        if name not in allowed:
            raise InputError(f"--effects: {name!r}, allowed is {one_of(allowed)}")
    return names


def _try_out(experiment: Experiment, own: Sequence[Effect]) -> None:
    """Evaluate every form of the user's own effects once: what fails there is their file's."""
    start = {p.name: p.starts[0] for p in experiment.baseline}
    names = [effect.name for effect in own]
    for effect in (effect for effect in experiment.effects if effect.name in names):
        for variant in effect.variants:
            first = variant.grid(amplitudes=False)[0]
            first |= {p.name: 1e-9 for p in variant.amplitudes}
            try:
                experiment.predict((variant,), start | first)
            except Exception as error:
                reason = " ".join(f"{type(error).__name__}: {error}".split())
                place = f"--effects-from: {effect.name}, {variant.label}"
                raise InputError(f"{place}: cannot be evaluated ({reason})") from error


def _part(
    progress: Callable[[float, str], None], number: int, count: int
) -> Callable[[float, str], None]:
    """The progress of one of several tests."""
    return lambda share, what: progress((number + share) / count, what)


def _search(
    experiment: Experiment, names: Sequence[str] | None, progress: Callable[[float, str], None]
) -> Any:
    from ..loop.inference.search import diagnose_test

    try:
        return diagnose_test(experiment, names, progress)
    except SolveError as error:
        raise _unfitted(experiment.test, error) from error


def _unfitted(test: str, error: SolveError) -> FitError:
    return FitError(f"{test}: the baseline could not be fitted ({error})")
