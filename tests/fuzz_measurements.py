"""Measurement folders broken at random: their keys, the cells of their CSVs, their files."""

from __future__ import annotations

import os
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from fuzz import change, scrambled
from measurements.bad import RIGS, good
from measurements.cantilever import Strip, hang, stiffness_per_width, weight_per_area

DENSITY = 0.5
"""Of the fabric of the strips, kg/m²."""

CELLS = (
    *("0", "-0", "1", "-1", "1e308", "-1e308", "1e-320", "1e400", "nan", "NaN", "inf", "-inf", ""),
    *(" ", "x", "1_000", "٣", "0x10", "1e5 ", '"1"', "=1+1", "1 2", "1.2.3", "-", "1d5", "\u22121"),
    *("True", "None", "1\t", "9" * 400, "0." + "0" * 400 + "1", "12 mm", "1e", "#1", "\x00", "1;2"),
)
"""What is put into a cell."""

PATHS = (
    *("/dev/zero", "/dev/stdin", "../run1.csv", ".", "/", "measurement.yaml", "x\x00y", "a" * 300),
)
"""What is put in for the name of a file."""


def valid(test: str, folder: Path) -> None:
    """A small folder of a test that the model can follow."""
    good(test, folder)
    if test != "cantilever":
        return
    path = folder / "measurement.yaml"
    content = yaml.safe_load(path.read_text())
    content["fabric"]["areal_density_kg_m2"] = DENSITY
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    draw = np.random.default_rng(1)
    stiffness, weight = stiffness_per_width(6e4, 4.57, 0.04, 12), weight_per_area(DENSITY)
    for run in (1, 2, 3):
        length = 60.0 + 30.0 * run
        s, x, z, _ = hang(Strip(length, stiffness, weight))
        at = np.linspace(5.0, length, 12)
        noise = 0.1 * draw.standard_normal(12)
        rows = zip(at, np.interp(at, s, x), np.interp(at, s, z) + noise, strict=True)
        text = "".join(f"{length},{a:.3f},{b:.3f},{c:.3f}\n" for a, b, c in rows)
        (folder / f"run{run}.csv").write_text("length_mm,s_mm,x_mm,z_mm\n" + text)


def broken(seed: int, folder: Path) -> None:
    """Make a folder, broken or only changed, by the number of a seed."""
    draw = random.Random(seed)
    valid(draw.choice(tuple(RIGS)), folder)
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        kind = draw.random()
        if kind < 0.35:
            _change_keys(folder / "measurement.yaml", draw)
        elif kind < 0.45:
            path = draw.choice([path for path in folder.iterdir() if path.is_file()])
            path.write_bytes(scrambled(path.read_bytes(), draw))
        elif kind < 0.5:
            _change_file(folder, draw)
        else:
            _change_table(folder / f"run{draw.randint(1, 3)}.csv", draw)


def _change_keys(path: Path, draw: random.Random) -> None:
    if not path.is_file():
        return
    try:
        content = yaml.safe_load(path.read_bytes())
    except (yaml.YAMLError, ValueError):
        return  # Broken by an earlier change: as bad as it gets.
    if not isinstance(content, dict) or not content:
        return
    if draw.random() < 0.15 and content.get("runs"):
        content["runs"] = [{"file": draw.choice(PATHS), "role": "fit"}]
    else:
        change(content, draw)
    path.write_bytes(yaml.dump(content, allow_unicode=True).encode("utf-8", "surrogatepass"))


def _change_file(folder: Path, draw: random.Random) -> None:
    """Something else where a file was."""
    path = folder / draw.choice(("measurement.yaml", "run1.csv", "run2.csv", "run3.csv"))
    path.unlink(missing_ok=True)
    kinds: tuple[Callable[[], object], ...] = (
        lambda: None,
        path.mkdir,
        lambda: os.mkfifo(path),
        lambda: path.symlink_to(path.name),
        lambda: path.symlink_to("/dev/zero"),
        lambda: path.write_bytes(b"\xff\xfe" + "a,b\n".encode("utf-16-le")),
    )
    draw.choice(kinds)()


def _change_table(path: Path, draw: random.Random) -> None:
    if not path.is_file():
        return
    table = [row.split(",") for row in path.read_text("utf-8", "replace").splitlines()]
    if len(table) < 2:
        return
    row, column = draw.randrange(len(table)), draw.randrange(len(table[0]))
    body = table[1:]
    end = "\n"
    match draw.randrange(12):
        case 0 | 1:
            table[row][column : column + 1] = [draw.choice(CELLS)]
        case 2:
            del table[row]
        case 3:
            table.insert(row, list(table[draw.randrange(len(table))]))
        case 4:
            draw.shuffle(body)
            table[1:] = body
        case 5:
            for cells in table:
                del cells[column : column + 1]
        case 6:
            factor = draw.choice((0, -1, 1e-12, 1e-3, 0.5, 2, 1e3, 1e9, 1e100, 1e300))
            _each(body, column, lambda value: value * factor)
        case 7:
            _each(body, column, lambda value: value + draw.gauss(0, 1))
        case 8:
            table[1:] = body[: draw.randrange(12)]
        case 9:
            table[1:] = body[:: draw.choice((-1, 2, 7))]
        case 10:
            table[0][column : column + 1] = [draw.choice((*CELLS, "force_N", "x_mm", "Time_s"))]
        case 11:
            end = draw.choice(("\r\n", "\r", "\n\n", ";\n", "\n# note\n", " \n", "\x0b", "\u2028"))
    path.write_bytes(end.join(",".join(cells) for cells in table).encode("utf-8"))


def _each(rows: list[list[str]], column: int, new: Callable[[float], Any]) -> None:
    """Change every cell of a column that holds a number."""
    for cells in rows:
        try:
            cells[column] = repr(new(float(cells[column])))
        except (ValueError, IndexError):
            continue
