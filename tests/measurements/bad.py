"""Measurement folders with one thing wrong each, and what an error about it must name.

`for case in CASES: case.write(folder)`; the one line of the error must contain every text of
`case.says`: the file, and the key or column or value. `good` writes the same folders unbroken.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from measurements.programmes import Frame

YAML = "measurement.yaml"
RIGS = {
    "picture_frame": {"frame_length_mm": 192, "fabric_length_mm": 96},
    "cantilever": {"width_mm": 50},
    "drape": {
        "punch_radius_mm": 76.2,
        "hole_radius_mm": 80,
        "punch_travel_mm": 65,
        "fabric_size_mm": 260,
        "edge_radius_mm": 10,
        "duration_s": 60,
    },
}
NOISE = {"picture_frame": {"force_N": 0.02}, "cantilever": {"z_mm": 0.1}, "drape": {"angle_deg": 1}}
Table = list[list[str]]


def _table(test: str, run: int) -> Table:
    """Header and twenty rows of a run, as text."""
    t = np.linspace(0, 1, 20)
    if test == "picture_frame":
        frame, angle = Frame(), 0.8 * t
        moment = 0.02 * angle + 0.08 * angle**3
        force = moment * frame.fabric**2 / frame.travel_per_angle(angle)
        force += 0.02 * np.sin(40 * t + run)
        columns = {"time_s": 60 * t, "displacement_mm": frame.displacement(angle), "force_N": force}
    elif test == "cantilever":
        s = (80.0 + 40 * run) * t
        # The parabola that a nearly stiff strip hangs in; its x differs from s in the third order.
        z = -1e-3 * s**2
        columns = {"length_mm": 0 * s + s[-1], "s_mm": s, "x_mm": s - 2e-6 * s**3 / 3, "z_mm": z}
    else:
        columns = {"x_mm": 100 * t, "y_mm": 100 * t[::-1], "angle_deg": 90 - 30 * np.sin(np.pi * t)}
    rows = [[f"{value:.5f}" for value in row] for row in zip(*columns.values(), strict=True)]
    return [list(columns), *rows]


def _save(folder: Path, content: object, tables: dict[str, Table]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / YAML).write_text(yaml.safe_dump(content, sort_keys=False))
    for name, table in tables.items():
        (folder / name).write_text("".join(",".join(row) + "\n" for row in table))


def _plain(test: str) -> tuple[dict, dict[str, Table]]:
    tables = {f"run{i}.csv": _table(test, i) for i in (1, 2, 3)}
    roles = ("fit", "fit", "holdout")
    content = {
        "schema": "fabric-measurement/1",
        "test": test,
        "title": "a plain one",
        "fabric": {"areal_density_kg_m2": 0.21894, "tow_spacing_mm": 12},
        "rig": deepcopy(RIGS[test]),
        "noise": deepcopy(NOISE[test]),
        "runs": [{"file": f, "role": r} for f, r in zip(tables, roles, strict=True)],
    }
    return content, tables


def good(test: str, folder: Path) -> None:
    """A folder of a test with nothing wrong."""
    _save(folder, *_plain(test))


@dataclass(frozen=True)
class Bad:
    """One broken folder; `says` are the texts that its error must contain."""

    name: str
    says: tuple[str, ...]
    write: Callable[[Path], None]


def _keys(name: str, says: str, spoil: Callable[[dict], object], test="picture_frame") -> Bad:
    """A case whose `measurement.yaml` is spoilt: `spoil` changes the content in place."""

    def write(folder: Path) -> None:
        content, tables = _plain(test)
        spoil(content)
        _save(folder, content, tables)

    return Bad(name, (YAML, *says.split()), write)


def _cells(name: str, says: str, spoil: Callable[[Table], object], test="picture_frame") -> Bad:
    """A case whose second table is spoilt in place; a run in the middle is easily forgotten."""

    def write(folder: Path) -> None:
        content, tables = _plain(test)
        spoil(tables["run2.csv"])
        _save(folder, content, tables)

    return Bad(name, ("run2.csv", *says.split()), write)


def _file(name: str, says: tuple[str, ...], spoil: Callable[[Path], object]) -> Bad:
    """A case where a file of a good folder is spoilt."""

    def write(folder: Path) -> None:
        good("picture_frame", folder)
        spoil(folder)

    return Bad(name, says, write)


def _set(*path: str | int, to: object) -> Callable[[dict], None]:
    def spoil(content: dict) -> None:
        for step in path[:-1]:
            content = content[step]
        content[path[-1]] = to

    return spoil


def _drop(*path: str | int) -> Callable[[dict], None]:
    def spoil(content: dict) -> None:
        for step in path[:-1]:
            content = content[step]
        del content[path[-1]]

    return spoil


def _cell(row: int, column: int, text: str) -> Callable[[Table], None]:
    def spoil(table: Table) -> None:
        table[row][column] = text

    return spoil


def _without(column: int) -> Callable[[Table], None]:
    def spoil(table: Table) -> None:
        for row in table:
            del row[column]

    return spoil


def _extra(table: Table) -> None:
    for i, row in enumerate(table):
        row.append("temperature_K" if i == 0 else "293")


def _swap_rows(table: Table) -> None:
    table[5], table[9] = table[9], table[5]


def _repeat_row(table: Table) -> None:
    table.insert(6, list(table[5]))


# Makes a folder beside itself if a loader runs what a tag asks for.
PYTHON_TAG = "title: !!python/object/apply:os.mkdir ['{}']\n"
EXECUTED = "executed"


def _python_tag(folder: Path) -> None:
    path = folder / YAML
    lines = path.read_text().replace("title: a plain one\n", PYTHON_TAG.format(folder / EXECUTED))
    path.write_text(lines)


def _binary(path: Path) -> None:
    path.write_bytes(bytes(range(256)) * 8)


CASES: list[Bad] = [
    _file("no_yaml", (YAML,), lambda f: (f / YAML).unlink()),
    _file("empty_yaml", (YAML,), lambda f: (f / YAML).write_text("")),
    _file("yaml_is_a_list", (YAML,), lambda f: (f / YAML).write_text("- schema\n- test\n")),
    _file("yaml_is_a_word", (YAML,), lambda f: (f / YAML).write_text("picture_frame\n")),
    _file("yaml_unclosed", (YAML,), lambda f: (f / YAML).write_text("schema: [fabric\n")),
    _file("yaml_binary", (YAML,), lambda f: _binary(f / YAML)),
    _file("yaml_python_tag", (YAML,), _python_tag),
    _keys("schema_other", "schema fabric-measurement/1", _set("schema", to="fabric-measurement/9")),
    _keys("schema_missing", "schema", _drop("schema")),
    _keys("test_unknown", "test biaxial cantilever", _set("test", to="biaxial")),
    _keys("test_missing", "test", _drop("test")),
    _keys("key_unknown", "temperature_K", _set("temperature_K", to=293)),
    _keys("fabric_missing", "fabric", _drop("fabric")),
    _keys("fabric_key_unknown", "areal_density", _set("fabric", "areal_density", to=0.2)),
    _keys("density_negative", "areal_density_kg_m2", _set("fabric", "areal_density_kg_m2", to=-1)),
    _keys("density_text", "areal_density_kg_m2", _set("fabric", "areal_density_kg_m2", to="low")),
    _keys("spacing_zero", "tow_spacing_mm", _set("fabric", "tow_spacing_mm", to=0)),
    _keys("tow_key_unknown", "tow radius_mm", _set("fabric", "tow", to={"radius_mm": 1.0})),
    _keys("rig_missing", "rig", _drop("rig")),
    _keys("rig_key_missing", "fabric_length_mm", _drop("rig", "fabric_length_mm")),
    _keys("rig_key_unknown", "frame_length_m", _set("rig", "frame_length_m", to=0.192)),
    _keys("rig_of_another_test", "width_mm", _set("rig", "width_mm", to=50)),
    _keys("length_negative", "frame_length_mm", _set("rig", "frame_length_mm", to=-192)),
    _keys("length_nan", "frame_length_mm", _set("rig", "frame_length_mm", to=float("nan"))),
    _keys("width_missing", "width_mm", _drop("rig", "width_mm"), "cantilever"),
    _keys("gravity_text", "gravity_mm_s2", _set("rig", "gravity_mm_s2", to="g"), "cantilever"),
    _keys("punch_missing", "punch_radius_mm", _drop("rig", "punch_radius_mm"), "drape"),
    _keys("noise_key_unknown", "noise force_kN", _set("noise", to={"force_kN": 1e-5})),
    _keys("noise_of_another_test", "noise z_mm", _set("noise", to={"z_mm": 0.1})),
    _keys("noise_negative", "force_N", _set("noise", "force_N", to=-0.02)),
    _keys("noise_of_round_off", "force_N", _set("noise", "force_N", to=1e-12)),
    _keys("noise_is_a_number", "noise", _set("noise", to=0.02)),
    _keys("role_unknown", "role train holdout", _set("runs", 1, "role", to="train")),
    _keys("role_missing", "role", _drop("runs", 1, "role")),
    _keys("run_file_missing_key", "file", _drop("runs", 1, "file")),
    _keys("run_key_unknown", "speed", _set("runs", 1, "speed", to=3)),
    _keys("runs_missing", "runs", _drop("runs")),
    _keys("runs_empty", "runs", _set("runs", to=[])),
    _keys(
        "no_run_to_fit",
        "fit",
        lambda content: [run.update(role="holdout") for run in content["runs"]],
    ),
    _file("csv_missing", ("run2.csv",), lambda f: (f / "run2.csv").unlink()),
    _file("csv_empty", ("run2.csv",), lambda f: (f / "run2.csv").write_text("")),
    _file("csv_binary", ("run2.csv",), lambda f: _binary(f / "run2.csv")),
    _cells("header_only", "", lambda table: table.__delitem__(slice(1, None))),
    _cells("one_reading", "", lambda table: table.__delitem__(slice(2, None))),
    _cells("column_missing", "force_N", _without(2)),
    _cells("column_unknown", "temperature_K", _extra),
    _cells("column_unit", "force_kN", _cell(0, 2, "force_kN")),
    _cells("column_twice", "displacement_mm", _cell(0, 2, "displacement_mm")),
    _cells("cell_text", "force_N", _cell(7, 2, "overload")),
    _cells("cell_empty", "force_N", _cell(7, 2, "")),
    _cells("cell_nan", "force_N", _cell(7, 2, "nan")),
    _cells("cell_infinite", "displacement_mm", _cell(7, 1, "inf")),
    _cells("cell_decimal_comma", "", _cell(7, 2, "1,5")),
    _cells("time_backwards", "time_s", _swap_rows),
    _cells("time_twice", "time_s", _repeat_row),
    _cells("beyond_the_frame", "displacement_mm", _cell(20, 1, "150")),
    _cells("length_column_missing", "length_mm", _without(0), "cantilever"),
    _cells("length_column_negative", "length_mm", _cell(3, 0, "-80"), "cantilever"),
    _cells("arc_beyond_length", "s_mm", _cell(20, 1, "500"), "cantilever"),
    _cells("drape_column_missing", "angle_deg", _without(2), "drape"),
    _cells("angle_impossible", "angle_deg", _cell(3, 2, "270"), "drape"),
    _cells("mark_off_the_sheet", "x_mm", _cell(3, 0, "900"), "drape"),
]
