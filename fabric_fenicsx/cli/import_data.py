"""From exports of testing machines to a folder of measured data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from shutil import get_terminal_size
from typing import Annotated

import typer

from ..errors import InputError
from .options import Settings
from .results import listed

__all__ = ["import_data"]

CAMERA = "dic."
"""Before the names of columns in a camera's tables."""

POINTS = ("x_mm", "y_mm")
ANGLES = ("shear_angle_deg", "angle_deg", "frame")

Pairs = list[str] | None


def import_data(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Exports as they are, as text.")
    ],
    test: Annotated[
        str,
        typer.Option(
            "--as", metavar="TEST", help="picture_frame, bias_extension, cantilever or drape."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="New, or empty.")],
    settings: Settings = None,
    columns: Annotated[
        Pairs,
        typer.Option(
            "--column",
            metavar="OURS=HEADING",
            help='As --column force_N="Standardkraft in kN", or its number; of a camera\'s table '
            "dic.OURS. Nothing behind the =: there is none.",
        ),
    ] = None,
    units: Annotated[
        Pairs, typer.Option("--unit", metavar="OURS=UNIT", help="As --unit time_s=min.")
    ] = None,
    constants: Annotated[
        Pairs,
        typer.Option("--constant", metavar="OURS=X", help="As --constant length_mm=200."),
    ] = None,
    decimal: Annotated[
        str | None, typer.Option("--decimal", metavar=",|.", help="Mark of the decimals.")
    ] = None,
    separator: Annotated[
        str | None,
        typer.Option("--separator", metavar="X", help="Between cells: a sign, tab or blanks."),
    ] = None,
    encoding: Annotated[
        str | None, typer.Option("--encoding", metavar="NAME", help="Of the text, as cp1252.")
    ] = None,
    skip: Annotated[
        int, typer.Option("--skip", metavar="N", min=0, help="Lines at the top of each file.")
    ] = 0,
    rate: Annotated[
        float | None,
        typer.Option("--rate", metavar="X", help="Of the crosshead, mm/min, without a time."),
    ] = None,
    gauge: Annotated[
        float | None,
        typer.Option("--gauge", metavar="MM", help="Length that a strain is of, for the travel."),
    ] = None,
    zero: Annotated[
        Pairs,
        typer.Option("--zero", metavar="OURS", help="Take the first reading of a column off it."),
    ] = None,
    turn: Annotated[
        Pairs, typer.Option("--turn", metavar="OURS", help="Turn the sign of a column.")
    ] = None,
    preload: Annotated[
        float | None,
        typer.Option("--preload", metavar="N", help="Begin where the force first reaches this."),
    ] = None,
    break_share: Annotated[
        float | None,
        typer.Option(
            "--break", metavar="%", help="End where the force falls below this of its largest."
        ),
    ] = None,
    thin: Annotated[
        int | None,
        typer.Option(
            "--thin", metavar="N", min=10, help="Keep about N readings a run, by equal travel."
        ),
    ] = None,
    role: Annotated[
        Pairs,
        typer.Option("--role", metavar="fit|holdout", help="Of all runs, or of each in turn."),
    ] = None,
    label: Annotated[
        Pairs, typer.Option("--label", metavar="TEXT", help="Of all runs, or of each in turn.")
    ] = None,
    specimen: Annotated[
        Pairs, typer.Option("--specimen", metavar="NAME", help="Of all runs, or of each in turn.")
    ] = None,
    dic: Annotated[
        list[Path] | None,
        typer.Option(
            "--dic",
            metavar="FILE",
            help="Points with x, y and a shear angle: of all frames, or one file each.",
        ),
    ] = None,
    zone: Annotated[
        str | None,
        typer.Option(
            "--zone",
            metavar="X,X,Y,Y",
            help="Where angles are averaged, mm; default: the middle third.",
        ),
    ] = None,
    dic_rate: Annotated[
        float | None, typer.Option("--dic-rate", metavar="X", help="Frames per second.")
    ] = None,
    dic_start: Annotated[
        float,
        typer.Option("--dic-start", metavar="S", help="Time of the force at the camera's zero."),
    ] = 0.0,
    frame: Annotated[
        float | None,
        typer.Option("--frame", metavar="N", help="Of a drape's points; default: the last."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Do not say what was taken.")] = False,
) -> None:
    """Turn exports of testing machines into a folder that diagnose reads.

    Finds separators, decimals, encoding, headings, units and specimens, says what it took for what,
    and asks where it cannot tell. Exit code 2: bad input, nothing has been written.
    """
    from ..loop.importing.angles import Zone, add_angles
    from ..loop.importing.folder import account, content_of, write_import
    from ..loop.importing.runs import read_runs
    from ..loop.importing.target import TESTS, target_of
    from ..loop.importing.wishes import Wishes

    listed("--as", test, TESTS)
    if decimal is not None:
        listed("--decimal", decimal, [",", "."])
    for name, number in (("--rate", rate), ("--gauge", gauge), ("--dic-rate", dic_rate)):
        _positive(name, number)
    _positive("--break", break_share, most=100.0)
    target = target_of(test)
    ours = [column.name for column in target.columns]
    for name, wanted, only in (
        ("--thin", thin, target.moves),
        ("--rate", rate, target.moves),
        ("--preload", preload, target.moves),
        ("--break", break_share, target.moves),
        ("--dic", dic, "shear_angle_deg" in ours),
        ("--gauge", gauge, target.moves),
        ("--frame", frame, test == "drape"),
        ("--zone", zone, dic),
        ("--dic-rate", dic_rate, dic),
    ):
        if wanted is not None and not only:
            raise InputError(f"{name}: not of {test}" + " without --dic" * (only is dic))
    for option, names in (("--zero", zero), ("--turn", turn)):
        for name in names or []:
            listed(option, name, ours)
    allowed = list(dict.fromkeys([*ours, *(ANGLES if set(ANGLES) & set(ours) else ())]))
    allowed += [f"{CAMERA}{name}" for name in (*POINTS, *ANGLES, "time_s")] if dic else []
    by_hand = _pairs("--column", columns, allowed)
    said = _pairs("--unit", units, allowed)
    camera = Wishes(
        columns={k.removeprefix(CAMERA): v for k, v in by_hand.items() if k.startswith(CAMERA)},
        units={k.removeprefix(CAMERA): v for k, v in said.items() if k.startswith(CAMERA)},
        separator=_separator(separator),
        decimal=decimal,
        encoding=encoding,
        turn=tuple(turn or []),
    )
    wishes = replace(
        camera,
        columns={k: v for k, v in by_hand.items() if not k.startswith(CAMERA)},
        units={k: v for k, v in said.items() if not k.startswith(CAMERA)},
        constants={k: _value(k, v) for k, v in _pairs("--constant", constants, ours).items()},
        skip=skip,
        rate=rate,
        gauge=gauge,
        zero=tuple(zero or []),
        preload=preload,
        break_share=None if break_share is None else break_share / 100.0,
        thin=thin,
        frame=frame,
    )
    read = [run for path in files for run in read_runs(path, target, wishes)]
    if dic:
        if len(read) > 1:
            raise InputError(f"--dic: {len(read)} runs, allowed is one: import them one by one")
        add_angles(read[0], dic, camera, Zone(_zone(zone), dic_rate, dic_start))
    runs = {f"run{k}.csv": run for k, run in enumerate(read, start=1)}
    keys = [
        {"file": file, "role": "fit", "label": " ".join(filter(None, [run.path.stem, run.label]))}
        for file, run in runs.items()
    ]
    for key, given in (("role", role), ("label", label), ("specimen", specimen)):
        for entry, value in zip(keys, _each(f"--{key}", given, len(keys)), strict=False):
            entry[key] = value
    content, missing = content_of(target, keys, settings or [])
    write_import(out, target, runs, content, missing)
    if not quiet:
        print(account(runs, get_terminal_size((120, 24)).columns), end="")
        if missing:
            print(f"to be filled in: {', '.join(missing)}")
        print(out)


def _pairs(option: str, given: Pairs, allowed: Sequence[str]) -> dict[str, str]:
    """NAME=TEXT of an option that may be repeated."""
    found = {}
    for text in given or []:
        name, equals, value = text.partition("=")
        listed(option, name, allowed)
        if not equals:
            raise InputError(f"{option}: {text}, allowed is {name}=...")
        found[name] = value.strip()
    return found


def _each(option: str, given: Pairs, count: int) -> list[str]:
    """A text for each run, from one for all or one for each."""
    if given is None:
        return []
    if len(given) not in (1, count):
        raise InputError(f"{option}: given {len(given)} times, allowed is once or {count} times")
    return given * count if len(given) == 1 else given


def _separator(given: str | None) -> str | None:
    """The sign of --separator, which may be given by its name."""
    from ..inputs.exports.text import SEPARATORS

    signs = {name: sign for sign, name in SEPARATORS.items()} | {"\\t": "\t"}
    sign = signs.get(given or "", given)
    if sign is not None and (len(sign) != 1 or sign.isalnum() or sign in "\"'.+-\r\n"):
        raise InputError(f"--separator: {given}, allowed is a sign or one of {', '.join(signs)}")
    return sign


def _value(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"--constant: {name}={text}, allowed is a number")
    return value


def _positive(option: str, value: float | None, most: float = math.inf) -> None:
    if value is not None and not (0.0 < value <= most and math.isfinite(value)):
        limit = "" if math.isinf(most) else f" and at most {most:g}"
        raise InputError(f"{option}: {value:g}, allowed is a number more than 0{limit}")


def _zone(text: str | None) -> tuple[float, float, float, float] | None:
    if text is None:
        return None
    try:
        a, b, c, d = (float(part) for part in text.split(","))
    except ValueError:
        a = b = c = d = math.nan
    if not (a < b and c < d):
        raise InputError(f"--zone: {text}, allowed is least x, largest x, least y, largest y in mm")
    return a, b, c, d
