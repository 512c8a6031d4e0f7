"""fabric.yaml: the fabric as diagnoses found it, for a case to take; see rigs.fabric_file.

Laws that were found are written by the keys that a case has for them. What a parameter of the fit
does to these is their derivative, so that its standard error, which is the fit's, is theirs too.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.linalg import block_diag

from ..arrays import Array
from ..errors import InputError
from ..mechanics.bending_laws import BENDING_LAWS, BendingLaw
from ..mechanics.laws import LAWS
from ..mechanics.laws.law import CrossingLaw
from ..mechanics.laws.tabulated import TabulatedSpring
from ..output.files import write_text
from ..rigs.fabric_file import FILE, SCHEMA, FabricFile
from .inference.curve import Curve
from .inference.diagnosis import Diagnosis
from .inference.effects import Effect, Variant
from .inference.fitted import Fit
from .measurement.schema import Measurement
from .report.content import nearest_model, scatter
from .report.plausibility import correlation_of

__all__ = [
    "JOINED",
    "NEAREST",
    "fabric_content",
    "fabric_file",
    "joined_fabrics",
    "law_entries",
    "write_fabric",
]


BASELINE = {
    "k1_N": "crossover.k1_N_mm",
    "k3_N": "crossover.k3_N_mm",
    "c1_N_s": "crossover.dashpot_N_s_mm",
    "C1_MPa": "tow.C1_MPa",
}
"""Keys of what every fabric has, by the parameter that is fitted."""

NEAREST = "fabric_nearest.yaml"
"""The file with models that came nearest and are not accepted."""

JOINED = "fabric_with_{}.yaml"
"""Files with models that take something from another test, by their effects."""

PLACES = {
    "picture_frame": "crossover.laws",
    "bias_extension": "crossover.laws",
    "cantilever": "tow.bending",
}
"""Where the laws of a test go."""

CURVE_POINTS = 13
"""Of a tabulated law: the curves that readings know are smooth."""

HEAD = """\
# The fabric as it was found by `fabric-fenicsx diagnose`, in the keys of a case. To drape with it:
#     fabric-fenicsx run CASE.yaml --fabric fabric.yaml [--uncertainty]
# or `fabric: fabric.yaml` in the case. What is not here is the case's own. `parameters` are the
# numbers as they were fitted, with the keys that each moves; see docs/fabric.md.
"""


@dataclass(slots=True)
class _Part:
    """What one diagnosis adds to the file."""

    test: str
    tow: dict[str, Any] = field(default_factory=dict)
    crossover: dict[str, Any] = field(default_factory=dict)
    parameters: list[dict[str, Any]] = field(default_factory=list)
    correlations: Array = field(default_factory=lambda: np.zeros((0, 0)))
    specimens: list[dict[str, Any]] = field(default_factory=list)
    others: dict[str, list[dict[str, Any]]] = field(
        default_factory=lambda: {"not_of_the_fabric": [], "without_a_key": []}
    )
    known: str = ""
    of_strips: bool = False


def fabric_content(
    tests: Sequence[tuple[Diagnosis, Sequence[Measurement]]],
    folder: Path,
    *,
    nearest: bool = False,
) -> dict[str, Any]:
    """The content of fabric.yaml.

    Crossings are those of the first test that has them, a picture frame, or of strips in whose
    model there is an effect of the fabric: their tows are not stretched by a rig.

    Args:
        tests: diagnoses of one fabric, each with the measurements that it is of.
        folder: from which the files of laws count.
        nearest: of what is not explained take the model that came nearest, where there is one.
    """
    parts = [_part(d, folder, nearest) for d, _ in tests]
    with_crossings = [part for part in parts if part.crossover]
    of_strips = [part for part in with_crossings if part.of_strips]
    kept = next(iter(of_strips or with_crossings), None)
    for k, part in enumerate(parts):
        if part.crossover and part is not kept:
            parts[k] = _Part(part.test, others=part.others, known=part.known)
    every = [m for _, measurements in tests for m in measurements]
    found = [m for d, of in tests for m in of if d.experiment.test == "cantilever"]
    # A stiffness belongs to the section that it was found with.
    stated = [m for m in every if "tow" in m.fabric.model_fields_set]
    of = (found or stated or every)[0].fabric
    for part, (_, measurements) in zip(parts, tests, strict=True):
        _at_spacing(part, (of.tow_spacing_mm / measurements[0].fabric.tow_spacing_mm) ** 2)
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "fabric": {
            "areal_density_kg_m2": of.areal_density_kg_m2,
            "tow_spacing_mm": of.tow_spacing_mm,
        },
    }
    own = {name: value for part in parts for name, value in part.tow.items()}
    if found or stated or own:
        tow = {name: getattr(of.tow, name) for name in ("width_mm", "height_mm", "C1_MPa")}
        if "bending_in_plane_Nmm" in of.tow.model_fields_set and of.tow.bending_in_plane_Nmm:
            tow["bending_in_plane_Nmm"] = of.tow.bending_in_plane_Nmm
        content["tow"] = tow | own
    crossovers = [part.crossover for part in parts if part.crossover]
    if crossovers:
        content["crossover"] = crossovers[0]
    content["tests"] = [
        {
            "test": d.experiment.test,
            "titles": [m.title for m in measurements],
            "verdict": d.verdict,
            **({"known": part.known} if part.known else {}),
        }
        for (d, measurements), part in zip(tests, parts, strict=True)
    ]
    content["parameters"] = [p for part in parts for p in part.parameters]
    matrix = block_diag(*(part.correlations for part in parts if part.parameters))
    content["correlations"] = matrix.tolist() if content["parameters"] else []
    content["specimens"] = [s for part in parts for s in part.specimens]
    for name in ("not_of_the_fabric", "without_a_key"):
        content[name] = [entry for part in parts for entry in part.others[name]]
    return _rounded(content)


def fabric_file(
    tests: Sequence[tuple[Diagnosis, Sequence[Measurement]]], folder: Path
) -> FabricFile:
    """The same as a case takes it; see fabric_content."""
    return FabricFile.model_validate(fabric_content(tests, folder), context={"base": folder})


def joined_fabrics(
    tests: Sequence[tuple[Diagnosis, Sequence[Measurement]]], folder: Path
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Names and contents of files with the models of Diagnosis.joined that were kept."""
    for d, measurements in tests:
        for model in d.joined:
            if model.kept:
                shown = replace(d, best=model.fit, verdict="unexplained")
                name = "_".join(["frames", *(e.name for e in model.effects)])
                yield name, fabric_content([(shown, measurements)], folder, nearest=True)


def write_fabric(folder: Path, content: Mapping[str, Any], name: str = FILE) -> None:
    """Write fabric.yaml, or the same under another name.

    Raises:
        InputError: it cannot be written.
    """
    text = yaml.safe_dump(
        dict(content), sort_keys=False, default_flow_style=None, allow_unicode=True, width=110
    )
    try:
        write_text(folder / name, HEAD.replace(FILE, name) + text)
    except OSError as error:
        raise InputError(f"{folder}: {name} cannot be written ({error.strerror})") from error


def law_entries(
    variant: Variant, values: Mapping[str, float], folder: Path
) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]]]:
    """The laws of a form, of a crossing or of bending, as entries of a case's list.

    Args:
        variant: a form with laws.
        values: of its parameters.
        folder: from which files count.

    Returns:
        Entries; by parameter, the derivatives of their keys by dotted places from the list on.
    """
    laws = variant.laws  # type: ignore[attr-defined]
    entries = [_entry(law, folder) for law in laws(values)]
    slopes: dict[str, dict[str, Any]] = {}
    for name in (*(p.name for p in variant.parameters), *getattr(variant, "of_baseline", ())):
        h = 1e-4 * abs(values[name]) or 1e-4
        ends = [laws({**values, name: values[name] + s * h}) for s in (1.0, -1.0)]
        slopes[name] = {}
        for i, (above, below) in enumerate(zip(*ends, strict=True)):
            inside = f"{i}." if "file" not in entries[i] else f"{i}.values."
            up, down = above.keys(), below.keys()
            for key in up:
                slope = _slope(up[key], down[key], 2.0 * h)
                if np.any(slope):
                    slopes[name][inside + key] = slope
    return entries, slopes


def _slope(up: Any, down: Any, h: float) -> Any:
    if isinstance(up, list):
        return [_slope(a, b, h) for a, b in zip(up, down, strict=True)]
    return 0.0 if up is None or isinstance(up, str) else (up - down) / h


def _entry(law: CrossingLaw | BendingLaw, folder: Path) -> dict[str, Any]:
    """A law as a case has it, per area or width."""
    keys = {key: value for key, value in law.keys().items() if value is not None}
    if type(law) in (LAWS.get(law.law), BENDING_LAWS.get(law.law)):
        return {"law": law.law, **keys}
    file = Path(str(sys.modules[type(law).__module__].__file__))
    place = os.path.relpath(file.resolve(), folder.resolve())
    return {"law": "own", "file": place, "name": type(law).__name__, "values": keys}


# One diagnosis --------------------------------------------------------------------------------


def _part(d: Diagnosis, folder: Path, nearest: bool) -> _Part:
    model = nearest_model(d) if nearest else d.final
    effects = _effects(d, model)
    part = _Part(d.experiment.test)
    if d.verdict == "unexplained":
        part.known = _known(d, model)
    known = any(effect.of_fabric for effect, _ in effects)
    part.of_strips = known and part.test == "bias_extension"
    for effect, variant in effects:
        kept = getattr(variant, "laws", None) or getattr(variant, "changes", None)
        if not effect.of_fabric:
            part.others["not_of_the_fabric"].append(_other(d, model, effect, variant))
        elif kept is None:
            part.others["without_a_key"].append(_other(d, model, effect, variant))
    if part.test == "picture_frame" and d.curve is not None:
        _add_curve(part, d.curve)
    else:
        _add_fitted(part, model, effects, folder)
    return part


def _effects(d: Diagnosis, model: Fit) -> list[tuple[Effect, Variant]]:
    """Those of a model, each with its form; of the reported one the strongest first."""
    known = d.effects if model is d.final else (*d.experiment.effects, *d.experiment.terms)
    return [
        (effect, variant)
        for effect in known
        for variant in model.variants
        if variant in effect.variants
    ]


def _other(d: Diagnosis, model: Fit, effect: Effect, variant: Variant) -> dict[str, Any]:
    names = [p.name for p in variant.parameters]
    return {
        "effect": effect.name,
        "form": variant.label,
        "test": d.experiment.test,
        "values": {name: model.values[name] for name in names},
        "std": {name: _std(model, name) for name in names},
    }


def _std(model: Fit, name: str) -> float | None:
    """Standard error; None on a bound, or where the data say nothing of it."""
    error = model.errors[name]
    return None if name in model.at_bound or not np.isfinite(error) else float(error)


def _known(d: Diagnosis, model: Fit) -> str:
    unit, rows = d.experiment.quantity, model.used & d.experiment.readings.first
    left = f"what is left of {unit} is {model.rms(rows):.3g} rms, where a reading "
    left += f"scatters by {d.noise:.3g}"
    if d.curve is not None:
        return f"the moment against the angle at one rate, as a table; with the baseline {left}"
    if model.variants:
        return f"the model that came nearest, which is not accepted; {left}"
    return f"the baseline's fit; {left}, and no effect of this file explains it"


def _add_fitted(
    part: _Part, model: Fit, effects: Sequence[tuple[Effect, Variant]], folder: Path
) -> None:
    """Baseline and laws of a fitted model, with how well each is known."""
    keys: dict[str, dict[str, Any]] = {}
    of: dict[str, tuple[str, str]] = {}
    for name, value in model.values.items():
        if name in BASELINE:
            group, _, key = BASELINE[name].partition(".")
            getattr(part, group)[key] = value
            keys[name], of[name] = {BASELINE[name]: 1.0}, ("baseline", "")
    laws: list[dict[str, Any]] = []
    for effect, variant in effects:
        if not effect.of_fabric:
            continue
        changes = getattr(variant, "changes", None)
        if changes is not None and model.values[variant.parameters[0].name] > 0.0:
            (p,) = variant.parameters
            value, h = model.values[p.name], 1e-4 * model.values[p.name]
            above, below = changes(value + h), changes(value - h)
            for place, changed in changes(value).items():
                group, _, key = _of_file(place).partition(".")
                getattr(part, group)[key] = changed
            slopes_of = {_of_file(k): _slope(above[k], below[k], 2.0 * h) for k in above}
            keys[p.name] = {k: slope for k, slope in slopes_of.items() if slope}
            of[p.name] = (effect.name, variant.label)
        if getattr(variant, "laws", None) is None:
            continue
        entries, slopes = law_entries(variant, model.values, folder)
        nothing = [p.name for p in variant.amplitudes if p.one_sided and p.name in model.at_bound]
        gone = {int(place.partition(".")[0]) for name in nothing for place in slopes[name]}
        # A part of a general form that is not needed is not in the fabric.
        stay = [i for i in range(len(entries)) if i not in gone]
        place_of = {i: len(laws) + k for k, i in enumerate(stay)}
        laws += [entries[i] for i in stay]
        for name, own in slopes.items():
            placed = {}
            for place, slope in own.items():
                i, _, key = place.partition(".")
                if int(i) in place_of:
                    placed[f"{PLACES[part.test]}.{place_of[int(i)]}.{key}"] = slope
            keys[name] = keys.get(name, {}) | placed
            of.setdefault(name, (effect.name, variant.label))
    group, _, key = PLACES.get(part.test, "").partition(".")
    if key:
        getattr(part, group)[key] = laws
    part.parameters = [
        {
            "name": name,
            "test": part.test,
            "effect": of[name][0],
            **({"form": of[name][1]} if of[name][1] else {}),
            "value": model.values[name],
            "std": _std(model, name),
            "keys": keys[name],
        }
        for name in model.values
        if keys.get(name)
    ]
    names = [p["name"] for p in part.parameters]
    part.correlations = correlation_of(model, names)
    for group, own_scatter in scatter(model).items():
        shared = [name for name in group.split() if name in names]
        if shared and own_scatter["share"] > 0.0:
            part.specimens.append({"parameters": shared, "test": part.test, **own_scatter})


def _of_file(place: str) -> str:
    """A key of the file for one of a case: the tow's stiffnesses are its own there."""
    return place.replace("tow.stiffness.", "tow.")


def _at_spacing(part: _Part, area: float) -> None:
    """Limits of slip of crossings that stand for so many times the area."""
    for key in ("slip_limit_N", "translation_N_mm"):
        if key in part.crossover:
            part.crossover[key] *= area
            for p in part.parameters:
                if f"crossover.{key}" in p["keys"]:
                    p["keys"][f"crossover.{key}"] *= area


def _add_curve(part: _Part, curve: Curve) -> None:
    """An elastic law through the curve, from nothing at no shear, not falling."""
    at = np.linspace(0.0, float(curve.at[-1]), CURVE_POINTS)
    inside = at[1:] >= float(curve.at[0])
    at = np.append(0.0, at[1:][inside])
    value = np.interp(at, curve.at, curve.value)
    value[0] = 0.0
    law = TabulatedSpring(tuple(at), tuple(np.maximum.accumulate(np.maximum(value, 0.0))))
    std = np.interp(at, curve.at, curve.std)
    std[0] = 0.0
    part.crossover = {"k1_N_mm": 0.0, "k3_N_mm": 0.0, "dashpot_N_s_mm": 0.0}
    part.crossover["laws"] = [{"law": law.law, **law.keys()}]
    part.parameters = [
        {
            "name": "curve_band",
            "test": part.test,
            "effect": "curve",
            "value": 0.0,
            "std": 1.0,
            "keys": {"crossover.laws.0.moments_N_mm": std.tolist()},
        }
    ]
    part.correlations = np.eye(1)


def _rounded(value: Any) -> Any:
    """Plain data with ten digits of each number."""
    if isinstance(value, Mapping):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(inner) for inner in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.10g}")
    return value
