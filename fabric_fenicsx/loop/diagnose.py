"""From folders of measured data to a report of what the model lacks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any

from mpi4py import MPI

from ..errors import FitError, InputError, SolveError
from ..inputs.keys import one_of
from ..output.folder import prepare_folder
from .fabric import JOINED, NEAREST, fabric_content, fabric_file, joined_fabrics, write_fabric
from .inference.diagnosis import Diagnosis
from .inference.effects import Effect
from .inference.experiment import Experiment
from .inference.first_order import SMALL
from .inference.next_tests import next_tests
from .inference.same_specimen import same_specimen_tests
from .inference.search import diagnose_test
from .kinds import KINDS
from .measurement.kind import Kind
from .measurement.reading import read_folder
from .measurement.schema import Measurement
from .own_effects import of_test, read_effects
from .report.content import combined_report, test_report
from .report.discovered import Discovered, discovered_terms
from .report.page import write_report

__all__ = ["Found", "diagnose", "read_measurement", "read_measurements"]

Test = tuple[Kind, list[Measurement], Any]
"""A kind, its measurements and the experiment made of them."""


@dataclass(frozen=True, slots=True)
class Found:
    """What a diagnosis found.

    Attributes:
        report: the content of report.json.
        diagnoses: of each test, in the order of the kinds.
        fabric: the content of fabric.yaml.
    """

    report: dict[str, Any]
    diagnoses: tuple[Diagnosis, ...]
    fabric: dict[str, Any]


def read_measurement(folder: Path | str) -> Measurement:
    """Read and check a folder of measured data.

    Raises:
        InputError: one line with the file, the key or column, and what is allowed.
    """
    return read_folder(Path(folder), KINDS)


def read_measurements(folders: Sequence[Path]) -> list[Measurement]:
    """Read folders of measured data, tests of one fabric.

    Raises:
        InputError: as read_measurement, or a folder stands twice.
    """
    places = [folder.resolve() for folder in folders]
    for i, folder in enumerate(folders):
        if places[i] in places[:i]:
            raise InputError(f"{folder}: stands twice, allowed is once")
    return [read_measurement(folder) for folder in folders]


def diagnose(
    measurements: Sequence[Measurement],
    out: Path | str | None = None,
    *,
    effects: Sequence[str] | None = None,
    effects_from: Path | None = None,
    models: Mapping[str, Callable[..., Experiment]] = MappingProxyType({}),
    progress: Callable[[float, str], None] = lambda done, what: None,
) -> Found:
    """Fit the model to measurements of one fabric, trace what is left, and report.

    Args:
        measurements: of any kinds.
        out: folder for report.json, report.html, its figures and fabric.yaml; None writes nothing.
        effects: names of those to try; by default all that are known.
        effects_from: a Python file with effects of the user's own.
        models: by test, to be taken instead of that kind's own; see Kind.experiment.
        progress: told the share that is done and what is being done.

    Raises:
        InputError: an effect cannot be used, or the report cannot be written.
        FitError: a baseline could not be fitted.
    """
    own = read_effects(effects_from) if effects_from is not None else []
    tests = _experiments(measurements, own, models)
    _check_names(effects, tests)
    for kind, _, experiment in tests:
        if not kind.needs_others:
            _try_out(experiment, own)
    folder = None if out is None else Path(out)
    if folder is not None:
        prepare_folder(folder, MPI.COMM_SELF)
    parts: list[tuple[Diagnosis, dict[str, Any], list[Discovered]]] = []
    for number, (kind, same, experiment) in enumerate(tests):

        def part(share: float, what: str, number: int = number) -> None:
            progress((number + share) / len(tests), what)

        if kind.needs_others:
            if parts:
                experiment.take(fabric_file(_with_measurements(parts, tests), folder or Path()))
            _try_out(experiment, own)
        try:
            diagnosis = diagnose_test(experiment, effects, part)
        except SolveError as error:
            raise _unfitted(kind, error) from error
        part(0.93, "with other tests")
        kind.join(experiment, same, diagnosis, [found for found, _, _ in parts], effects)
        part(0.95, "further tests")
        noise = diagnosis.noise_model
        inflation = (1.0 + noise.correlation) / (1.0 - noise.correlation)
        advice = next_tests(
            experiment,
            kind,
            same,
            diagnosis.pairs,
            diagnosis.noise,
            inflation,
            diagnosis.final.variances.scatter,
        )
        advice += same_specimen_tests(
            experiment,
            kind,
            same,
            diagnosis.final,
            diagnosis.in_scatter,
            diagnosis.noise * inflation**0.5,
        )
        terms = discovered_terms(diagnosis, 1 + sum(len(found) for _, _, found in parts))
        parts.append((diagnosis, test_report(diagnosis, same, advice, terms), terms))
    report = combined_report([content for _, content, _ in parts])
    measured = _with_measurements(parts, tests)
    fabric = fabric_content(measured, folder or Path())
    if folder is not None:
        progress(1.0, "drawing")
        # Whoever stops it while it draws finds nothing there.
        with TemporaryDirectory(dir=folder, prefix=".writing-") as place:
            drawn = Path(place)
            write_fabric(drawn, fabric)
            if any(d.best is not None for d, _, _ in parts):
                write_fabric(drawn, fabric_content(measured, folder, nearest=True), NEAREST)
            for name, content in joined_fabrics(measured, folder):
                write_fabric(drawn, content, JOINED.format(name))
            write_report(drawn, parts, report)
            _moved(drawn, folder)
    return Found(report, tuple(diagnosis for diagnosis, _, _ in parts), fabric)


def _moved(drawn: Path, folder: Path) -> None:
    """Move what was written to where it belongs, report.json last.

    Fabrics of an earlier diagnosis, which are none of these measurements' any more, are removed.
    """
    for earlier in (folder / NEAREST, *folder.glob(JOINED.format("*"))):
        earlier.unlink(missing_ok=True)
    for path in sorted(drawn.iterdir(), key=lambda path: path.name == "report.json"):
        path.replace(folder / path.name)


def _experiments(
    measurements: Sequence[Measurement],
    own: Sequence[Effect],
    models: Mapping[str, Callable[..., Experiment]],
) -> list[Test]:
    """The tests in the order of the kinds, each with its experiment."""
    tests: list[Test] = []
    for kind in KINDS:
        same = [m for m in measurements if m.test == kind.name]
        if same:
            try:
                model = models.get(kind.name, kind.experiment)
                tests.append((kind, same, model(same, of_test(own, kind.name))))
            except SolveError as error:
                raise _unfitted(kind, error) from error
    for _, _, experiment in tests:
        known = [effect.name for effect in experiment.effects]
        for name in known:
            if known.count(name) > 1:
                raise InputError(f"--effects-from: {name}: stands twice, allowed is a new name")
    return tests


def _with_measurements(
    parts: Sequence[tuple[Diagnosis, dict[str, Any], list[Discovered]]], tests: Sequence[Test]
) -> list[tuple[Diagnosis, list[Measurement]]]:
    """The diagnoses so far, each with what it is of."""
    return [(d, same) for (d, _, _), (_, same, _) in zip(parts, tests, strict=False)]


def _check_names(names: Sequence[str] | None, tests: Sequence[Test]) -> None:
    allowed = [effect.name for _, _, experiment in tests for effect in experiment.effects]
    for name in names or ():
        if name not in allowed:
            raise InputError(f"--effects: {name!r}, allowed is {one_of(allowed)}")


def _try_out(experiment: Experiment, own: Sequence[Effect]) -> None:
    """Evaluate every form of the user's own effects once: what fails there is their file's."""
    start = {p.name: p.starts[0] for p in experiment.baseline}
    names = [effect.name for effect in own]
    for effect in (effect for effect in experiment.effects if effect.name in names):
        for variant in effect.variants:
            first = variant.grid(amplitudes=False)[0]
            first |= {p.name: SMALL for p in variant.amplitudes}
            try:
                experiment.predict((variant,), start | first)
            except Exception as error:
                reason = " ".join(f"{type(error).__name__}: {error}".split())
                place = f"--effects-from: {effect.name}, {variant.label}"
                raise InputError(f"{place}: cannot be evaluated ({reason})") from error


def _unfitted(kind: Kind, error: SolveError) -> FitError:
    return FitError(f"{kind.name}: the baseline could not be fitted ({error})")
