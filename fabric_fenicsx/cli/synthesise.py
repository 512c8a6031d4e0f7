"""From a case to measurements with a hidden effect."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from ..parallel import from_root
from .collective import collective
from .options import Settings

if TYPE_CHECKING:
    from ..loop.synthesise import Case, Hidden

__all__ = ["synthesise"]


def synthesise(
    case: Annotated[Path, typer.Argument(metavar="CASE.yaml", help="The case of the test.")],
    noise: Annotated[
        float, typer.Option("--noise", metavar="X", help="One sigma of a reading [N, mm, °].")
    ],
    settings: Settings = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            metavar="NAME[/FORM][:KEY=X,KEY=X]",
            help="An effect to hide; strengths that are not given make it clearly visible. "
            "May be repeated.",
        ),
    ] = None,
    rates: Annotated[
        str | None,
        typer.Option(
            "--rates",
            metavar="X,X",
            help="Of the crosshead [mm/min], a run for each, the last one held out; default: the "
            "case's, ten times and, in a picture frame, three times that",
        ),
    ] = None,
    lengths: Annotated[
        str | None,
        typer.Option(
            "--lengths",
            metavar="X,X",
            help="Of a strip [mm], each pulled at every rate; default: the case's and 1.25 times "
            "that.",
        ),
    ] = None,
    angle_noise: Annotated[
        float | None,
        typer.Option(
            "--angle-noise",
            metavar="X",
            help="Of a strip: one sigma of its shear angle [°], which is then read as well.",
        ),
    ] = None,
    cells: Annotated[
        int | None,
        typer.Option(
            "--cells",
            metavar="N",
            min=1,
            help="Of a drape, between two crossings; default: as in a diagnosis.",
        ),
    ] = None,
    spacing: Annotated[
        float | None,
        typer.Option(
            "--spacing",
            metavar="MM",
            help="Of a drape's tows, the same fabric; default: the case's.",
        ),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            "--model",
            metavar="elements|kinematic",
            help="Of a drape; a kinematic net knows offset and rotation only.",
        ),
    ] = None,
    readings: Annotated[int, typer.Option("--readings", min=10, help="Of each run.")] = 200,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the noise.")] = 0,
    effects_from: Annotated[
        Path | None,
        typer.Option("--effects-from", metavar="FILE.py", help="Your own laws or EFFECTS. Is run."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Default: results/measured_ and the case's name"),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Do not say what was put in.")] = False,
) -> None:
    """Measure a case in the model, with effects in it that the folder does not tell of.

    For a trial of diagnose, or of a planned test: would these runs show that effect? Exit code 2:
    bad input, nothing has been written.
    """
    folder = out if out is not None else Path("results") / f"measured_{case.stem}"

    def action(comm: Any) -> int:
        from ..rigs.load import load_case

        loaded = from_root(comm, lambda: load_case(case, settings or []))
        if comm.size > 1:
            # It starts up in all processes at once, and rank 0 alone will need it.
            import_module("petsc4py.PETSc")
        put_in = from_root(
            comm,
            lambda: _write(
                case,
                loaded,
                folder,
                effect or [],
                noise,
                {
                    "rates": _numbers("rates", rates) or None,
                    "lengths": _numbers("lengths", lengths) or None,
                    "angle_noise": angle_noise,
                    "cells": cells,
                    "spacing": spacing,
                    "model": model,
                },
                readings,
                seed,
                effects_from,
            ),
        )
        if comm.rank == 0 and not quiet:
            for hidden in put_in:
                numbers = ", ".join(f"{key} = {x:.6g}" for key, x in hidden.values.items())
                print(f"{hidden.name}, {hidden.label}: {numbers}")
            print(folder)
        return 0

    raise typer.Exit(collective(action))


def _write(
    path: Path,
    case: Case,
    folder: Path,
    effects: list[str],
    noise: float,
    of_kind: dict[str, Any],
    readings: int,
    seed: int,
    effects_from: Path | None,
) -> list[Hidden]:
    from ..loop import synthesise as loop
    from ..loop.own_effects import read_effects

    if not 0.0 < noise < float("inf"):
        raise InputError(f"--noise: {noise:g}, allowed is more than 0")
    hidden = [loop.parse_effect(text) for text in effects]
    own = read_effects(effects_from) if effects_from is not None else []
    made = loop.synthesise(
        case,
        hidden,
        noise,
        seed=seed,
        readings=readings,
        own=own,
        place=str(path),
        **{name: value for name, value in of_kind.items() if value is not None},
    )
    try:
        loop.write_measurement(folder, made)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror})") from error
    return made.effects


def _numbers(option: str, text: str | None) -> list[float]:
    """The numbers of an option."""
    found = []
    for part in text.split(",") if text is not None else []:
        try:
            found.append(float(part))
        except ValueError:
            found.append(0.0)
        if not 0.0 < found[-1] < float("inf"):
            raise InputError(f"--{option}: {part.strip()!r}, allowed are numbers more than 0")
    return found
