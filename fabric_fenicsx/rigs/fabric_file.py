"""A fabric as a diagnosis found it, schema fabric/1, and a case that takes it.

The file has its numbers in the keys of a case, so that it can be read and changed by hand, and
beside them what they were fitted as: parameters with standard errors, their correlations, and how
specimens differ. A parameter moves keys of the file by given factors.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import Field, ValidationError, model_validator

from ..arrays import Array
from ..errors import InputError
from ..inputs.groups import Keys, NotNegative, Positive
from ..inputs.validation import mistakes, one_line, read_keys
from .cases import Case
from .shear_law_keys import BendingLawKeys, ShearLawKeys

__all__ = [
    "FILE",
    "SCHEMA",
    "FabricFile",
    "FoundCrossoverKeys",
    "moved",
    "read_fabric",
    "resolved",
    "taken",
    "with_fabric",
]

AnyCase = TypeVar("AnyCase", bound=Case)

SCHEMA = "fabric/1"
FILE = "fabric.yaml"

#: Rounding of correlations, as a least eigenvalue.
ROUNDING = 1e-6

Correlation = Annotated[float, Field(ge=-1.0, le=1.0)]


class WovenKeys(Keys):
    """What the sheet weighs, and what width of it the tow stands for."""

    areal_density_kg_m2: Positive = Field(description="mass per area, of warp and weft together")
    tow_spacing_mm: Positive = Field(description="width of fabric that the tow stands for")


class FoundTowKeys(Keys):
    """The tow: its section belongs to its C1, B = 6 C1 I per spacing."""

    width_mm: Positive = Field(description="of the section in the sheet")
    height_mm: Positive = Field(description="of the section across the sheet")
    C1_MPa: Positive = Field(description="Neo-Hookean constant; E = 6 C1")
    bending_in_plane_Nmm: Positive | None = Field(None, description="as tow.stiffness of a case")
    stretch_N_mm: Positive | None = Field(None, description="as tow.stiffness of a case")
    bending: list[BendingLawKeys] = Field(default_factory=list, description="as in a case")
    crimp_strain: NotNegative | None = Field(None, description="as in a case; null: the case's")


#: Keys of the tow that a case has in ``tow.stiffness``.
OF_STIFFNESS = ("bending_in_plane_Nmm", "stretch_N_mm")


class FoundCrossoverKeys(Keys):
    """What acts between the tows of a crossing, as in a case."""

    k1_N_mm: NotNegative = Field(description="as in a case")
    k3_N_mm: NotNegative = Field(description="as in a case")
    dashpot_N_s_mm: NotNegative = Field(description="as in a case")
    laws: list[ShearLawKeys] = Field(default_factory=list, description="as in a case")
    slip_limit_N: Positive | None = Field(
        None, description="as in a case, of tow_spacing_mm squared; null: the case's"
    )
    translation_N_mm: Positive | None = Field(None, description="likewise")

    def of(self, area: float) -> dict[str, Any]:
        """Keys of a case whose crossings are so many times as large."""
        names = ("slip_limit_N", "translation_N_mm")
        per_crossing = {name: getattr(self, name) for name in names}
        given = {name: area * value for name, value in per_crossing.items() if value is not None}
        return self.model_dump(exclude=set(per_crossing)) | given


class TestKeys(Keys):
    """A test and what it said."""

    test: str = Field(description="its kind")
    titles: list[str] = Field(description="of its measurements")
    verdict: str = Field(description="of the diagnosis")
    known: str = Field("", description="what is known where no effect explains the readings")


class ParameterKeys(Keys):
    """A number as it was fitted."""

    name: str = Field(description="as in report.json")
    test: str = Field(description="where it was fitted")
    effect: str = Field("baseline", description="what it is part of")
    form: str = Field("", description="of the effect")
    value: float = Field(description="as fitted")
    std: NotNegative | None = Field(None, description="standard error; null: on a bound, or none")
    keys: dict[str, float | list[float]] = Field(
        description="of this file: by how much each changes when the parameter does by one"
    )


class SpecimenKeys(Keys):
    """How specimens differ."""

    parameters: list[str] = Field(description="that differ together")
    test: str = Field(description="where it was found")
    share: NotNegative = Field(description="one sigma, of the values")
    std: NotNegative = Field(description="standard error of that")


class OtherKeys(Keys):
    """An effect that no case takes from this file."""

    effect: str = Field(description="its name")
    form: str = Field(description="of the effect")
    test: str = Field(description="where it was found")
    values: dict[str, float] = Field(description="as fitted")
    std: dict[str, float | None] = Field(description="standard errors")


class FabricFile(Keys):
    """The content of a fabric.yaml."""

    schema_: Literal["fabric/1"] = Field(alias="schema", description="version")
    fabric: WovenKeys = Field(description="the sheet")
    tow: FoundTowKeys | None = Field(None, description="null: that of the case stands")
    crossover: FoundCrossoverKeys | None = Field(None, description="null: that of the case stands")
    tests: list[TestKeys] = Field(default_factory=list, description="where it comes from")
    parameters: list[ParameterKeys] = Field(default_factory=list, description="what was fitted")
    correlations: list[list[Correlation]] = Field(
        default_factory=list, description="of the parameters' errors, a row for each"
    )
    specimens: list[SpecimenKeys] = Field(default_factory=list, description="how they differ")
    not_of_the_fabric: list[OtherKeys] = Field(
        default_factory=list, description="of the rig, or of what the sheet was before"
    )
    without_a_key: list[OtherKeys] = Field(
        default_factory=list, description="of the fabric, but no case has it"
    )

    @model_validator(mode="after")
    def _goes_together(self) -> FabricFile:
        count, r = len(self.parameters), self.correlations
        if [len(row) for row in r] != [count] * count:
            raise ValueError(f"correlations: allowed are {count} rows of {count}, as parameters")
        R = np.array(r).reshape(count, count)
        if count and (
            not np.allclose(R, R.T, atol=ROUNDING)
            or not np.allclose(R.diagonal(), 1.0)
            or np.linalg.eigvalsh(R)[0] < -ROUNDING * count
        ):
            raise ValueError("correlations: allowed is a symmetric matrix that is one of these")
        data = self.model_dump()
        for i, p in enumerate(self.parameters):
            for key, factor in p.keys.items():
                try:
                    _add(data, key, factor, 0.0)
                except (KeyError, IndexError, TypeError, ValueError):
                    raise ValueError(
                        f"parameters.{i}.keys: {key}, allowed is a number of this file"
                    ) from None
        known = {(p.test, p.name) for p in self.parameters}
        for i, s in enumerate(self.specimens):
            for name in s.parameters:
                if (s.test, name) not in known:
                    raise ValueError(f"specimens.{i}.parameters: {name} is none of {s.test}")
        return self


def read_fabric(path: Path) -> FabricFile:
    """Read a fabric.yaml and check it; files of laws count from its folder.

    Raises:
        InputError: one line that names the file, the key and what is allowed.
    """
    found: FabricFile = read_keys(path, "a fabric", SCHEMA, "schema", {SCHEMA: FabricFile})
    return found


def moved(fabric: FabricFile, change: Array) -> FabricFile:
    """The fabric with its parameters changed, (n_parameters,), to first order.

    Raises:
        ValueError: there is no such fabric: a number is beyond what is allowed.
    """
    data = fabric.model_dump(by_alias=True)
    for p, by in zip(fabric.parameters, change, strict=True):
        for key, factor in p.keys.items():
            _add(data, key, factor, float(by))
    try:
        return FabricFile.model_validate(data)
    except ValidationError as error:
        raise ValueError(str(error)) from error


def with_fabric(case: AnyCase, fabric: FabricFile) -> AnyCase:
    """A case with what the file has in the place of its own section, weight and crossings.

    Raises:
        InputError: it is not for a fabric of one kind of tow.
    """
    if case.tow_types or not hasattr(case, "spacings"):
        raise InputError("one kind of tow, allowed is a woven case without tow_types")
    data = case.model_dump()
    tow = data["tow"]
    if fabric.tow is not None:
        own = fabric.tow.model_dump(exclude=set(OF_STIFFNESS), exclude_none=True)
        tow |= own | {"per_width_mm": fabric.fabric.tow_spacing_mm, "D1_per_MPa": 0.0}
        if tow["bundle"] is not None:
            tow |= {"bundle": None, "section_law": "linear"}
        # What the section says is not said twice.
        stiffness = (tow["stiffness"] or {}) | {"bending_out_of_plane_Nmm": None}
        given = {name: getattr(fabric.tow, name) for name in OF_STIFFNESS}
        stiffness |= {name: value for name, value in given.items() if value is not None}
        tow["stiffness"] = stiffness if any(v is not None for v in stiffness.values()) else None
    if fabric.crossover is not None:
        warp, weft = case.spacings
        data["crossover"] |= fabric.crossover.of(warp * weft / fabric.fabric.tow_spacing_mm**2)
    found = _checked(case, data)
    # The weight follows from the density of the section, whatever that is.
    ratio = fabric.fabric.areal_density_kg_m2 / areal_density(found)
    if found.tow.bundle is None:
        tow["density_kg_mm3"] *= ratio
    else:
        tow["bundle"]["filament_density_kg_mm3"] *= ratio
    return _checked(case, data)


def areal_density(case: Case) -> float:
    """Mass per area of a case's warp and weft [kg/m²]."""
    from .common import KG_M2, section

    spacings = case.spacings  # type: ignore[attr-defined]
    return float(KG_M2 * sum(section(case.tow, s).mass()[0] / s for s in spacings))


def resolved(case: Case, base: Path) -> tuple[Case, FabricFile | None]:
    """A case with its fabric's numbers in the place of its own, and that fabric if it names one.

    Args:
        case: the case; one that has been resolved already is the same again.
        base: folder that relative paths in it count from.

    Raises:
        InputError: one line that names the file, the key and what is allowed.
    """
    if case.fabric is None:
        return case, None
    path = base / case.fabric
    fabric = read_fabric(path)
    try:
        return with_fabric(case, fabric), fabric
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def taken(fabric: FabricFile) -> dict[str, Any]:
    """Which numbers of a case come from a file, for result.json."""
    sources: dict[str, list[ParameterKeys]] = {}
    for p in fabric.parameters:
        for key in p.keys:
            sources.setdefault(key, []).append(p)
            # Numbers of a law that are not fitted are its form's.
            sources.setdefault(key.rpartition(".")[0], []).append(p)
    rows = []
    for key, value in _numbers(fabric):
        law = ".laws." in key or ".bending." in key
        own = sources.get(key, [])
        of = own or (sources.get(key.rpartition(".")[0], []) if law else [])
        rows.append(
            {
                "key": key,
                "value": value,
                "std": _std(own, key),
                "source": "; ".join(dict.fromkeys(_source(p) for p in of)) or "stated",
            }
        )
    groups = {"tow": fabric.tow, "crossover": fabric.crossover}
    return {
        "taken": rows,
        "of_the_case": [name for name, group in groups.items() if group is None],
        "not_of_the_fabric": [o.effect for o in fabric.not_of_the_fabric],
        "without_a_key": [o.effect for o in fabric.without_a_key],
        "tests": [t.model_dump() for t in fabric.tests],
    }


def _source(p: ParameterKeys) -> str:
    return f"{p.test}: {p.effect}" + (f", {p.form}" if p.form else "")


def _std(own: list[ParameterKeys], key: str) -> float | None:
    """Of a number that one parameter moves."""
    if len(own) != 1 or own[0].std is None or isinstance(own[0].keys[key], list):
        return None
    return abs(own[0].std * float(own[0].keys[key]))  # type: ignore[arg-type]


def _numbers(fabric: FabricFile) -> Iterator[tuple[str, Any]]:
    """What replaces a case's own, by dotted keys of the file; names of laws and files are none."""
    data = fabric.model_dump(include={"fabric", "tow", "crossover"}, exclude_none=True)
    yield from ((key, value) for key, value in _leaves(data, "") if not isinstance(value, str))


def _leaves(group: Any, place: str) -> Iterator[tuple[str, Any]]:
    if isinstance(group, Mapping):
        for name, value in group.items():
            yield from _leaves(value, f"{place}.{name}" if place else name)
    elif isinstance(group, list) and any(isinstance(entry, Mapping) for entry in group):
        for i, entry in enumerate(group):
            yield from _leaves(entry, f"{place}.{i}")
    elif group != []:
        yield place, group


def _add(data: Any, dotted: str, factor: float | list[float], by: float) -> None:
    """Add to the number at a place of plain data; to each of a list's in their order."""
    *groups, last = (int(part) if part.isdecimal() else part for part in dotted.split("."))
    for part in groups:
        data = data[part]
    value = data[last]
    if isinstance(factor, list):
        data[last] = [v + f * by for v, f in zip(value, factor, strict=True)]
    else:
        data[last] = value + factor * by


def _checked(case: AnyCase, data: dict[str, Any]) -> AnyCase:
    found, problems = mistakes(type(case), data)
    if problems:
        raise InputError(one_line(problems[0][1]))
    checked: AnyCase = found
    return checked
