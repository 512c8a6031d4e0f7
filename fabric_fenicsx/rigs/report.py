"""From the folder of a drape and what its reader asks for to the page about it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from ..arrays import Array
from ..errors import InputError
from ..inputs.keys import one_of
from ..inputs.tables import Column, read_table
from ..output.draped import draped_sheet
from ..output.mirror import whole_sheet
from ..output.pattern import circle
from ..output.report.analysis import Drape, Settings, analysed
from ..output.report.content import content
from ..output.report.page import write_page
from ..output.results import Results, read_results
from ..output.wrinkles import buckling_ratio
from .drape import DrapeCase, rim
from .load import load_case

__all__ = ["report", "wrinkles"]


PLACE = (Column("x_mm"), Column("y_mm"), Column("z_mm", optional=True))
ANGLES = (
    *PLACE,
    Column("angle_deg"),
    Column("std_deg", optional=True, may_be_empty=True),
    Column("repeat", optional=True),
)

TONNE_MM2 = 1e12
"""g/m² in one tonne/mm²."""


def report(
    folder: Path | str,
    out: Path | str | None = None,
    *,
    time: float | None = None,
    mirror: bool | None = None,
    trim: Path | str | float | None = None,
    locking_deg: float | None = None,
    thickness_mm: float | None = None,
    fibre_volume_fraction: float | None = None,
    areal_weight_g_m2: float | None = None,
    fibre_density_g_cm3: float | None = None,
    measured: Path | str | None = None,
    measured_outline: Path | str | None = None,
    against: Path | str | None = None,
    smallest_mm: float = 0.5,
) -> dict[str, Any]:
    """Write the page on a drape: report.html, report.json, the flat pattern and figures.

    Args:
        folder: of the run; one that stopped early will do.
        out: folder for the page; by default `report` in that of the run.
        time: of the step that is shown [s]; by default the last.
        mirror: whether to complete a quarter; by default as the case says.
        trim: CSV of a closed trim line (x_mm, y_mm, and z_mm if it is not one in plan), or the
            radius of a circle in plan about the punch's axis [mm]; by default the circle where the
            die's face begins to be flat.
        locking_deg: locking angle [°]; by default that of a law of the case.
        thickness_mm: of the flat fabric.
        fibre_volume_fraction: of the flat fabric.
        areal_weight_g_m2: of the flat fabric; by default that of the case.
        fibre_density_g_cm3: density of the fibres.
        measured: CSV of measured angles: x_mm, y_mm on the flat sheet or, with z_mm, of the draped
            one; angle_deg; std_deg and repeat if there are.
        measured_outline: CSV of the measured draped outline: x_mm, y_mm, and z_mm if there is.
        against: folder of another run of a drape.
        smallest_mm: amplitude of a wave across the sheet, and gap to a tool, that is told.

    Returns:
        The content of report.json.

    Raises:
        InputError: a file or number is none of these, or the run is no drape; nothing is written.
    """
    folder = Path(folder)
    for name, value in (
        ("locking_deg", locking_deg),
        ("thickness_mm", thickness_mm),
        ("fibre_volume_fraction", fibre_volume_fraction),
        ("areal_weight_g_m2", areal_weight_g_m2),
        ("fibre_density_g_cm3", fibre_density_g_cm3),
        ("smallest_mm", smallest_mm),
    ):
        top = 1.0 if name == "fibre_volume_fraction" else 90.0 if name == "locking_deg" else np.inf
        if value is not None and not 0.0 < value < top:
            below = "" if np.isinf(top) else f" and below {top:g}"
            raise InputError(f"{name}: {value:g}, allowed is a number above 0{below}")
    drape = _read(folder, time, mirror)
    line, trim_name = _trim(trim, drape)
    settings = Settings(
        trim=line,
        trim_name=trim_name,
        locking=locking_deg,
        thickness=thickness_mm,
        fibre_fraction=fibre_volume_fraction,
        areal_weight=areal_weight_g_m2,
        fibre_density=fibre_density_g_cm3,
        measured=None if measured is None else read_table(Path(measured), ANGLES, 1),
        measured_outline=None if measured_outline is None else _line(Path(measured_outline)),
        against=None if against is None else _read(Path(against), time, mirror),
        smallest=smallest_mm,
    )
    return write_page(folder / "report" if out is None else Path(out), analysed(drape, settings))


def wrinkles(folder: Path) -> dict[str, float]:
    """The page's measures of wrinkles in one number each, of the last step of a run.

    Raises:
        InputError: it is none of a woven sheet.
    """
    found = content(analysed(_read(folder, None, None), Settings()))["wrinkles"]
    waves = (found["out_of_plane"] or {}).get("largest", [])
    bent = found["curvature"]["percentile_90_beyond_tool_1_m"]
    numbers = {
        "wave_amplitude_mm": waves[0]["amplitude_mm"] if waves else 0.0,
        "curvature_beyond_tool_1_mm": None if bent is None else 1e-3 * bent,
        "in_plane_amplitude_mm": (found["in_plane"] or {}).get("percentile_90_mm"),
        "over_buckling_load": (found["compression"] or {}).get("largest_over_buckling_load"),
    }
    return {name: float(value) for name, value in numbers.items() if value is not None}


def _read(folder: Path, time: float | None, mirror: bool | None) -> Drape:
    """A run as the page needs it.

    Raises:
        InputError: it is none, or none of a drape.
    """
    results = read_results(folder)
    path = folder / "case.yaml"
    case = load_case(path) if path.exists() else None
    if case is not None and not isinstance(case, DrapeCase):
        raise InputError(f"{folder}: a run of {case.test}, allowed is one of a drape")
    number = results.nearest(time)
    net, snapshot, tools = results.at(number)
    quarter = (case is not None and case.symmetry == "quarter") if mirror is None else mirror
    compression = None
    if case is not None:
        # Carried through the mirror in the place of the axial force, which it is a multiple of.
        ratio = buckling_ratio(net, snapshot, _stiffness(case, results))
        held = np.zeros_like(snapshot.section_forces)
        held[:, 0] = ratio
        carried = replace(snapshot, section_forces=held)
        compression = (whole_sheet(net, carried)[1] if quarter else carried).section_forces[:, 0]
    if quarter:
        net, snapshot = whole_sheet(net, snapshot)
    try:
        sheet = draped_sheet(net, snapshot)
    except ValueError as error:
        raise InputError(f"{folder}: {error}, allowed is the run of a woven sheet") from None
    rows = _rows(folder / "steps.csv", results.steps[number])
    known: dict[str, Any] = {}
    if case is not None:
        known = {
            "depth": case.punch_travel_mm * rows["time_s"].to_numpy() / case.duration_s
            if len(rows)
            else None,
            "case": yaml.safe_load(path.read_text(encoding="utf-8")),
            "locking": _locking(case),
            "layer": case.contact.layer_mm,
            "areal_weight": _areal_weight(case),
            "edge_radius": rim(case),
            "centre": (case.punch_offset_x_mm, case.punch_offset_y_mm),
        }
    return Drape(
        folder=folder,
        title=(case.title if case is not None else "") or folder.name,
        sheet=sheet,
        tools=tools,
        time=results.steps[number],
        rows=rows,
        result=_result(folder / "result.json"),
        compression=compression,
        **known,
    )


def _rows(path: Path, until: float) -> pd.DataFrame:
    """steps.csv up to a time [s]; empty where it is not there."""
    if not path.exists():
        return pd.DataFrame()
    try:
        rows = pd.read_csv(path)
        return rows[rows["time_s"] <= until * (1.0 + 1e-12)]
    except (OSError, ValueError, KeyError) as error:
        line = " ".join(str(error).split())
        raise InputError(f"{path}: not the steps of a run ({line})") from None


def _result(path: Path) -> Mapping[str, Any] | None:
    if not path.exists():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        line = " ".join(str(error).split())
        raise InputError(f"{path}: not the result of a run ({line})") from None
    if not isinstance(content, dict):
        raise InputError(f"{path}: not the result of a run")
    return content


def _sections(case: DrapeCase, results: Results) -> tuple[Any, Any]:
    from .common import tow_sections

    spacings = case.sheet.warp_spacing_mm, case.sheet.weft_spacing_mm
    return tow_sections(case, results.net, spacings)


def _stiffness(case: DrapeCase, results: Results) -> Array:
    """E I of each tow out of the sheet's plane [N mm²], (n_tows,)."""
    sections, kind = _sections(case, results)
    return np.array([section.stiffness()[4] for section in sections])[kind]


def _areal_weight(case: DrapeCase) -> float:
    """Of the flat fabric of evenly spaced tows of the first type [g/m²]."""
    from .common import section

    spacings = case.sheet.warp_spacing_mm, case.sheet.weft_spacing_mm
    mass = sum(float(section(case.tow, width).mass()[0]) / width for width in spacings)
    return TONNE_MM2 * mass


def _locking(case: DrapeCase) -> float | None:
    """The smallest locking angle of the case's laws [°]."""
    laws = [law.model_dump() for law in case.crossover.laws]
    angles = [float(law["angle_deg"]) for law in laws if "locking" in str(law["law"])]
    return min(angles, default=None)


def _trim(trim: Path | str | float | None, drape: Drape) -> tuple[Array | None, str]:
    """The trim line and its name.

    Raises:
        InputError: it is neither a radius nor a line.
    """
    if trim is None:
        if drape.edge_radius is None:
            return None, ""
        name = f"of radius {drape.edge_radius:g} mm in plan, where the die's face begins to be flat"
        return circle(drape.edge_radius, drape.centre), name
    try:
        radius = float(trim)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        path = Path(str(trim))
        return _line(path), f"of {path.name}"
    if not 0.0 < radius < np.inf:
        raise InputError(f"trim: {radius:g}, allowed is {one_of(['a radius in mm', 'a CSV file'])}")
    return circle(radius, drape.centre), f"of radius {radius:g} mm in plan"


def _line(path: Path) -> Array:
    """A closed line from a CSV [mm], (n, 2) or (n, 3)."""
    table = read_table(path, PLACE, 3)
    return np.column_stack([table[name] for name in ("x_mm", "y_mm", "z_mm") if name in table])
