"""Measured data as a user hands it over: a folder with a measurement.yaml and CSV files.

The schema, fabric-measurement/1, is a contract: other programs write it. Units stand in the names
of keys and columns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
from pydantic import Field

from ...errors import InputError
from ...inputs.groups import Keys, Positive
from ...inputs.keys import one_of, plain
from ...inputs.validation import mistakes, one_line, read_yaml, suggestion
from ...rigs.cases import TowKeys

__all__ = [
    "FILE",
    "SCHEMA",
    "CantileverRig",
    "DrapeRig",
    "FabricKeys",
    "Measurement",
    "MeasurementKeys",
    "PictureFrameRig",
    "Run",
    "read_measurement",
]

Array = npt.NDArray[np.float64]
Test = Literal["picture_frame", "cantilever", "drape"]

SCHEMA = "fabric-measurement/1"
FILE = "measurement.yaml"
TESTS: tuple[str, ...] = get_args(Test)


class MeasuredTowKeys(Keys):
    """Section and material of the tows; by default those of Wei & Zhang's Table 3."""

    width_mm: Positive = Field(4.57, description="width of the section in the sheet")
    height_mm: Positive = Field(0.04, description="height of the section across the sheet")
    density_kg_mm3: Positive = Field(7.0e-6, description="density")
    C1_MPa: Positive = Field(60000.0, description="Neo-Hookean constant; E = 6 C1")

    def tow(self) -> TowKeys:
        """The same as keys of a case."""
        return TowKeys(**self.model_dump())


class FabricKeys(Keys):
    """The fabric that was tested."""

    areal_density_kg_m2: Positive = Field(description="mass per area")
    tow_spacing_mm: Positive = Field(12.0, description="of the virtual tows")
    tow: MeasuredTowKeys = Field(default_factory=MeasuredTowKeys, description="the virtual tows")


class PictureFrameRig(Keys):
    """A picture frame."""

    frame_length_mm: Positive = Field(description="between the hinges of a bar")
    fabric_length_mm: Positive = Field(description="side of the woven square")


class CantileverRig(Keys):
    """A strip that hangs from a clamp."""

    width_mm: Positive = Field(description="of the specimens")
    gravity_mm_s2: Positive = Field(9810.0, description="downwards")


class DrapeRig(Keys):
    """A hemisphere that presses a sheet through a hole."""

    punch_radius_mm: Positive = Field(description="radius of the hemisphere")
    hole_radius_mm: Positive = Field(description="of die and holder")
    punch_travel_mm: Positive = Field(description="depth of the draw")
    fabric_size_mm: Positive = Field(description="side of the square sheet")
    edge_radius_mm: Positive = Field(10.0, description="rounding of the hole's edge")
    duration_s: Positive = Field(description="time of the draw")


class NoiseKeys(Keys):
    """One sigma of a reading."""

    force_N: Positive | None = Field(None, description="of a force")
    z_mm: Positive | None = Field(None, description="of a height")
    angle_deg: Positive | None = Field(None, description="of an angle")


class RunKeys(Keys):
    """One file of readings."""

    file: Annotated[str, Field(min_length=1)] = Field(description="a CSV in the folder")
    role: Literal["fit", "holdout"] = Field(
        description="holdout: used for nothing but to report an error"
    )
    label: str = Field("", description="free text")


class MeasurementKeys(Keys):
    """The content of a measurement.yaml; ``rig`` depends on the test."""

    schema_: Literal["fabric-measurement/1"] = Field(alias="schema", description="version")
    test: Test = Field(description="which test")
    title: str = Field("", description="free text")
    fabric: FabricKeys = Field(description="the fabric")
    noise: NoiseKeys = Field(default_factory=NoiseKeys, description="one sigma of a reading")
    runs: list[RunKeys] = Field(min_length=1, description="the readings")


class _PictureFrameKeys(MeasurementKeys):
    rig: PictureFrameRig = Field(description="the frame")


class _CantileverKeys(MeasurementKeys):
    rig: CantileverRig = Field(description="the specimens")


class _DrapeKeys(MeasurementKeys):
    rig: DrapeRig = Field(description="the tools")


KEYS: dict[str, type[MeasurementKeys]] = {
    "picture_frame": _PictureFrameKeys,
    "cantilever": _CantileverKeys,
    "drape": _DrapeKeys,
}

QUANTITY = {"picture_frame": "force_N", "cantilever": "z_mm", "drape": "angle_deg"}
"""What is compared in each test; also the key of its noise."""

COLUMNS = {
    "picture_frame": ("time_s", "displacement_mm", "force_N"),
    "cantilever": ("length_mm", "s_mm", "x_mm", "z_mm"),
    "drape": ("x_mm", "y_mm", "angle_deg", "std_deg"),
}
OPTIONAL = {"drape": ("std_deg",)}
MAY_BE_EMPTY = {"cantilever": ("s_mm",)}
FEWEST = {"picture_frame": 4, "cantilever": 3, "drape": 1}
"""Readings without which a file says nothing."""

LARGEST = 1e12
"""Of a reading in N, mm, s or degrees: sums of squares of such are still numbers."""


@dataclass(frozen=True, slots=True)
class Run:
    """One file of readings.

    Attributes:
        file: its name.
        holdout: whether it may only be used to report an error.
        label: free text.
        columns: readings by column, each (n,); an empty optional entry is NaN.
    """

    file: str
    holdout: bool
    label: str
    columns: dict[str, Array]

    @property
    def count(self) -> int:
        """Number of readings."""
        return len(next(iter(self.columns.values())))


@dataclass(frozen=True, slots=True)
class Measurement:
    """A test that was measured.

    Attributes:
        folder: where it was read.
        test: which test.
        title: free text.
        fabric: what was tested.
        rig: the rig, by test.
        noise: one sigma of a reading of ``quantity``; None where it is not given.
        runs: the readings.
    """

    folder: Path
    test: str
    title: str
    fabric: FabricKeys
    rig: Any
    noise: float | None
    runs: tuple[Run, ...]

    @property
    def quantity(self) -> str:
        """What is compared: force_N, z_mm or angle_deg."""
        return QUANTITY[self.test]


def read_measurement(folder: Path) -> Measurement:
    """Read and check a folder of measured data.

    Args:
        folder: with a measurement.yaml.

    Raises:
        InputError: one line with the file, the key or column, and what is allowed.
    """
    if not folder.is_dir():
        what = "is a file" if folder.exists() else "no such folder"
        raise InputError(f"{folder}: {what}, allowed is a folder with a {FILE}")
    path = folder / FILE
    _refuse_devices(path)
    data = read_yaml(path, "a measurement")
    if not isinstance(data, dict):
        raise InputError(f"{path}: {plain(data)}, allowed is a mapping of keys")
    # Before all else: with another schema or test every other key may rightly differ.
    _check_choice(path, data, "schema", (SCHEMA,))
    _check_choice(path, data, "test", TESTS)
    keys, found = mistakes(KEYS[data["test"]], data)
    if found:
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        raise InputError(one_line(f"{path}: {found[0][1]}{more}"))
    _check_noise(path, keys)
    _check_runs(path, keys)
    _check_rig(path, keys)
    runs = tuple(_read_run(folder, keys, entry) for entry in keys.runs)
    noise = getattr(keys.noise, QUANTITY[keys.test])
    return Measurement(folder, keys.test, keys.title, keys.fabric, keys.rig, noise, runs)


def _refuse_devices(path: Path) -> None:
    """A pipe or a device may never end."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise InputError(f"{path}: is a pipe or a device, allowed is a file")


def _check_choice(path: Path, data: dict[Any, Any], key: str, allowed: tuple[str, ...]) -> None:
    value = data.get(key)
    if value not in allowed:
        close = suggestion(value, allowed) if isinstance(value, str) else ""
        shown = f"{plain(value)}{close}" if key in data else "missing"
        raise InputError(one_line(f"{path}: {key}: {shown}, allowed is {one_of(list(allowed))}"))


def _check_noise(path: Path, keys: MeasurementKeys) -> None:
    given = [name for name in NoiseKeys.model_fields if getattr(keys.noise, name) is not None]
    own = QUANTITY[keys.test]
    # More than this test's own may be kept in one place for several tests.
    if given and own not in given:
        raise InputError(
            f"{path}: noise.{given[0]}: of another test, allowed is {own} with test: {keys.test}"
        )


def _check_runs(path: Path, keys: MeasurementKeys) -> None:
    files = [entry.file for entry in keys.runs]
    for i, name in enumerate(files):
        if not name.isprintable():
            raise InputError(f"{path}: runs.{i}.file: {plain(name)}, allowed is the name of a CSV")
        if name in files[:i]:
            raise InputError(f"{path}: runs.{i}.file: {name!r} stands twice, allowed is once")
    if all(entry.role == "holdout" for entry in keys.runs):
        raise InputError(
            f"{path}: runs: every role is holdout, needed is at least one run with role: fit"
        )


def _check_rig(path: Path, keys: Any) -> None:
    rig = keys.rig
    if keys.test == "picture_frame" and rig.fabric_length_mm > rig.frame_length_mm:
        raise InputError(
            f"{path}: rig.fabric_length_mm: {rig.fabric_length_mm:g}, "
            f"allowed is at most frame_length_mm, {rig.frame_length_mm:g}"
        )
    if keys.test == "drape":
        deepest = rig.punch_radius_mm + rig.edge_radius_mm
        if rig.punch_travel_mm > deepest:
            raise InputError(
                f"{path}: rig.punch_travel_mm: {rig.punch_travel_mm:g}, allowed is at most "
                f"punch_radius_mm + edge_radius_mm, {deepest:g}: the punch has no shank"
            )
        if rig.hole_radius_mm <= rig.punch_radius_mm:
            raise InputError(
                f"{path}: rig.hole_radius_mm: {rig.hole_radius_mm:g}, "
                f"allowed is more than punch_radius_mm, {rig.punch_radius_mm:g}"
            )


def _read_run(folder: Path, keys: Any, entry: RunKeys) -> Run:
    path = folder / entry.file
    table = _read_table(path)
    names = COLUMNS[keys.test]
    optional = OPTIONAL.get(keys.test, ())
    found = [str(name).strip() for name in table.columns]
    for name in found:
        if name not in names or found.count(name) > 1:
            what = "stands twice" if found.count(name) > 1 else "unknown column"
            close = "" if name in names else suggestion(name, names)
            raise InputError(
                one_line(f"{path}: {name}: {what}{close}, allowed are {one_of(list(names))}")
            )
    for name in names:
        if name not in found and name not in optional:
            raise InputError(f"{path}: {name}: missing column, needed are {_listed(keys.test)}")
    table.columns = pd.Index(found)
    columns = {
        name: _numbers(path, name, table[name], name in MAY_BE_EMPTY.get(keys.test, ()))
        for name in found
    }
    count = len(table)
    if count < FEWEST[keys.test]:
        raise InputError(
            f"{path}: {count} readings, allowed are {FEWEST[keys.test]} or more of them"
        )
    _check_readings(path, keys, columns)
    return Run(entry.file, entry.role == "holdout", entry.label, columns)


def _read_table(path: Path) -> pd.DataFrame:
    try:
        _refuse_devices(path)
        if path.is_dir():
            raise InputError(f"{path}: is a folder, allowed is a CSV that `runs` names")
        text = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file, allowed is a CSV that `runs` names") from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: not UTF-8 text at byte {error.start}, allowed is a CSV file"
        ) from None
    except (OSError, ValueError) as error:
        raise InputError(one_line(f"{path}: cannot be read ({error})")) from None
    rows = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not rows:
        raise InputError(f"{path}: empty, allowed is a CSV file with a line of column names")
    cells = [[cell.strip() for cell in row.split(",")] for row in rows]
    for number, row in enumerate(cells[1:], start=1):
        if len(row) != len(cells[0]):
            raise InputError(
                f"{path}: reading {number}: {len(row)} cells, allowed are {len(cells[0])}, "
                "as many as column names"
            )
    return pd.DataFrame(cells[1:], columns=cells[0], dtype=str)


def _numbers(path: Path, name: str, cells: pd.Series[str], may_be_empty: bool) -> Array:
    values = np.full(len(cells), math.nan)
    for i, cell in enumerate(cells):
        if may_be_empty and cell.lower() in ("", "nan"):
            continue
        try:
            values[i] = float(cell)
        except ValueError:
            values[i] = math.nan
        if not abs(values[i]) <= LARGEST or "_" in cell:
            shown = plain(cell) if cell else "an empty cell"
            raise InputError(
                one_line(
                    f"{path}: {name}: {shown} in reading {i + 1}, allowed is a number up to 1e12"
                )
            )
    return values


def _check_readings(path: Path, keys: Any, columns: dict[str, Array]) -> None:
    def refuse(column: str, wrong: npt.NDArray[np.bool_], allowed: str) -> None:
        if wrong.any():
            i = int(np.argmax(wrong))
            value = columns[column][i]
            raise InputError(
                f"{path}: {column}: {value:g} in reading {i + 1}, allowed is {allowed}"
            )

    if keys.test == "picture_frame":
        time, travel = columns["time_s"], columns["displacement_mm"]
        refuse("time_s", np.diff(time, prepend=-math.inf) <= 0.0, "a time that increases")
        frame = keys.rig.frame_length_mm
        # At gamma = ±90 degrees the frame is closed.
        out, back = (2.0 - math.sqrt(2.0)) * frame, -math.sqrt(2.0) * frame
        refuse(
            "displacement_mm",
            (travel >= out) | (travel <= back),
            f"between {back:.4g} and {out:.4g}, where the frame is closed",
        )
    elif keys.test == "cantilever":
        length, s = columns["length_mm"], columns["s_mm"]
        refuse("length_mm", length <= 0.0, "more than 0")
        refuse("s_mm", (s < 0.0) | (s > 1.001 * length), "from 0 to length_mm")
        reach = np.hypot(columns["x_mm"], columns["z_mm"])
        refuse("x_mm", reach > 1.1 * length, "within length_mm of the clamp")
    else:
        half = keys.rig.fabric_size_mm / 2.0
        for column in ("x_mm", "y_mm"):
            refuse(
                column,
                np.abs(columns[column]) > half * 1.0001,
                f"on the sheet, from {-half:g} to {half:g}",
            )
        angle = columns["angle_deg"]
        refuse("angle_deg", (angle <= 0.0) | (angle >= 180.0), "between 0 and 180")
        if "std_deg" in columns:
            refuse("std_deg", columns["std_deg"] <= 0.0, "more than 0")


def _listed(test: str) -> str:
    optional = OPTIONAL.get(test, ())
    return ", ".join(f"{name} (optional)" if name in optional else name for name in COLUMNS[test])
