"""The numbers of the page: report.json, schema fabric-drape-report/1, a group for each section."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fabric_fenicsx.output.comparison import differing_keys, line_distance
from fabric_fenicsx.output.page import finite
from fabric_fenicsx.output.pattern import area, nesting_box
from fabric_fenicsx.output.report.analysis import Against, Analysis, Drape
from fabric_fenicsx.output.thickness import flat_fabric

from ...arrays import Array, Flags

__all__ = ["SCHEMA", "content"]


SCHEMA = "fabric-drape-report/1"

FEW = 6
"""Places that are listed of many."""


def content(a: Analysis) -> dict[str, Any]:
    """All numbers of the page; one that is not finite is None."""
    drape = a.drape
    groups: dict[str, Any] = {
        "schema": SCHEMA,
        "title": drape.title,
        "folder": str(drape.folder),
        "time_s": drape.time,
        "run": _run(drape, a),
        "shear": _shear(a),
        "wrinkles": _wrinkles(a),
        "bridging": _bridging(a),
        "thickness": _thickness(a),
        "draw_in": _draw_in(a),
        "pattern": _pattern(a),
        "forces": forces(drape),
        "measured": _measured(a),
        "against": None if a.against is None else _against(a, a.against),
    }
    numbers: dict[str, Any] = finite(groups)
    return numbers


def _run(drape: Drape, a: Analysis) -> dict[str, Any]:
    result = drape.result
    solver = (drape.case or {}).get("solver", {})
    known = result or {}
    numbers: dict[str, Any] = {
        "completed": known.get("completed"),
        "stopped_because": known.get("stopped_because"),
        "health": known.get("health"),
        "discretisation_error": known.get("discretisation_error"),
        "force_tolerance_N": solver.get("force_tolerance_N"),
        "penetration_mm": a.penetration,
        "contact_layer_mm": drape.layer,
    }
    for key in ("steps", "newton_iterations", "wasted_iterations", "dofs", "ranks", "seconds"):
        numbers[key] = known.get(key)
    return numbers


def _shear(a: Analysis) -> dict[str, Any]:
    most, snapshot = int(a.shear.argmax()), a.drape.sheet.snapshot
    numbers: dict[str, Any] = {
        "largest_deg": a.shear[most],
        "at": _place(a, most),
        "percentile_50_90_99_deg": np.percentile(a.shear, [50, 90, 99]).tolist(),
        "locking_deg": a.locking,
        "directors_off_by_deg": math.degrees(
            float(np.abs(snapshot.director_turn - snapshot.shear_angle).max())
        ),
    }
    if a.locking is not None:
        numbers |= {
            "smallest_margin_deg": a.locking - a.shear[most],
            "beyond_locking_percent": 100.0 * float(np.mean(a.shear > a.locking)),
        }
    return numbers


def _wrinkles(a: Analysis) -> dict[str, Any]:
    net = a.drape.sheet.net
    touching = _touching(a)
    bent = np.where(touching, a.curvature, np.nan)
    steep = sorted(a.waves, key=lambda wave: -wave.amplitude)
    spacing = float(np.nanmedian(a.ripple_span)) if np.isfinite(a.ripple_span).any() else None
    compression = a.drape.compression
    ripple = None
    if spacing is not None:
        k = int(np.nanargmax(a.ripple))
        ripple = {
            "largest_amplitude_mm": a.ripple[k],
            "amplitude_over_wavelength": a.ripple[k] / (2.0 * a.ripple_span[k]),
            "percentile_90_mm": float(np.nanpercentile(a.ripple, 90)),
            "at": _place(a, k),
        }
    return {
        "out_of_plane": None
        if a.node_gap is None
        else {
            "smallest_amplitude_mm": a.settings.smallest,
            "tows": len({wave.tow for wave in a.waves}),
            "largest": [
                {
                    "family": "weft" if net.tow_family[wave.tow] else "warp",
                    "amplitude_mm": wave.amplitude,
                    "wavelength_mm": wave.wavelength,
                    "amplitude_over_wavelength": wave.amplitude / wave.wavelength,
                    "at": _node_place(a, wave.node),
                }
                for wave in steep[:FEW]
            ],
        },
        "curvature": {
            "largest_beyond_tool_1_m": _largest(1e3 * bent),
            "percentile_90_beyond_tool_1_m": _percentile(1e3 * bent, 90),
            "largest_off_tool_1_m": _largest(1e3 * np.where(touching, np.nan, a.curvature)),
        },
        "in_plane": ripple,
        "compression": None
        if compression is None
        else {
            "largest_over_buckling_load": max(float(compression.max()), 0.0),
            "compressed_percent": 100.0 * float(np.mean(compression > 0.0)),
            "beyond_buckling_load_percent": 100.0 * float(np.mean(compression > 1.0)),
        },
    }


def _touching(a: Analysis) -> Flags:
    if a.gap is None:
        return np.zeros(a.drape.sheet.count, dtype=bool)
    return np.asarray(a.gap.distance < a.settings.smallest)


def _bridging(a: Analysis) -> dict[str, Any] | None:
    if a.gap is None:
        return None
    gap = a.gap.distance
    spanned = np.where(a.hollow & (gap > a.settings.smallest), gap, -np.inf)
    order = np.argsort(-spanned)[:FEW]
    off = np.where(a.hollow | np.isnan(gap), -np.inf, gap)
    far = int(off.argmax())
    return {
        "smallest_gap_mm": a.settings.smallest,
        "crossings": int(np.isfinite(spanned).sum()),
        "largest": [
            {"gap_mm": gap[k], "tool": a.gap.names[a.gap.nearest[k]], "at": _place(a, k)}
            for k in order.tolist()
            if np.isfinite(spanned[k])
        ],
        "largest_elsewhere": {
            "gap_mm": gap[far],
            "tool": a.gap.names[a.gap.nearest[far]],
            "at": _place(a, far),
        },
    }


def _thickness(a: Analysis) -> dict[str, Any]:
    s = a.settings
    weight = a.drape.areal_weight if s.areal_weight is None else s.areal_weight
    flat = flat_fabric(
        thickness=s.thickness,
        fibre_fraction=s.fibre_fraction,
        areal_weight=weight,
        fibre_density=s.fibre_density,
    )
    factor = [float(a.density.min()), float(np.median(a.density)), float(a.density.max())]
    return {
        "factor_least_median_most": factor,
        "flat_thickness_mm": flat.thickness,
        "flat_fibre_volume_fraction": flat.fibre_fraction,
        "areal_weight_g_m2": weight,
        "areal_weight_is": "given" if s.areal_weight is not None else "of the case",
        "fibre_density_g_cm3": s.fibre_density,
        "thickness_mm": flat.thickness and [flat.thickness * f for f in factor],
        "fibre_volume_fraction": flat.fibre_fraction and [flat.fibre_fraction * f for f in factor],
    }


def _draw_in(a: Analysis) -> dict[str, Any]:
    along = a.outline.along
    k = int(along.argmax())
    return {
        "ends": len(along),
        "least_mean_most_mm": [along.min(), along.mean(), along[k]],
        "most_at": _xyz(a.outline.flat[k], a.outline.place[k]),
    }


def _pattern(a: Analysis) -> dict[str, Any] | None:
    pattern = a.pattern
    if pattern is None:
        return None
    numbers: dict[str, Any] = {
        "trim": a.settings.trim_name,
        "closed": pattern.closed,
        "trim_line_outside_mm": pattern.outside,
        "trim_line_off_the_fabric_mm": pattern.distance,
        "points": sum(map(len, pattern.lines)),
    }
    if pattern.closed:
        line = pattern.lines[0]
        length, width, angle = nesting_box(line)
        size = area(line)
        back = a.drape.sheet.to_place(line)[0][:, : pattern.trim.shape[1]]
        numbers |= {
            "area_mm2": size,
            "box_length_mm": length,
            "box_width_mm": width,
            "box_angle_deg": math.degrees(angle),
            "area_over_box_percent": 100.0 * size / (length * width),
            "mapped_again_off_by_mm": _largest(np.linalg.norm(back - pattern.trim, axis=1)),
        }
    return numbers


def forces(drape: Drape) -> dict[str, Any] | None:
    """Largest and last forces of the tools [N] and the energy balance of the rows."""
    rows = drape.rows
    if rows.empty:
        return None
    tools = {}
    for name in tool_names(drape):
        size = rows[f"{name}_force_z_N"].abs()
        k = int(size.to_numpy().argmax())
        tools[name] = {
            "largest_N": size.iloc[k],
            "largest_at_s": rows["time_s"].iloc[k],
            "last_N": size.iloc[-1],
        }
    last = rows.iloc[-1]
    energy = {
        key: float(last[f"{key}_N_mm"])
        for key in ("external_work", "stored", "kinetic", "lost", "remainder")
    }
    work = max(abs(energy["external_work"]), 1e-300)
    late = rows.iloc[len(rows) // 10 :]
    kinetic = (late["kinetic_N_mm"] / late["stored_N_mm"].clip(lower=1e-300)).max()
    return {
        "tools": tools,
        "punch_depth_mm": None if drape.depth is None else float(drape.depth[-1]),
        "energy_N_mm": energy,
        "remainder_over_work_percent": 100.0 * abs(energy["remainder"]) / work,
        "largest_kinetic_over_stored": float(kinetic),
    }


def tool_names(drape: Drape) -> list[str]:
    """Tools whose forces the rows have."""
    ending = "_force_z_N"
    names = [c.removesuffix(ending) for c in drape.rows.columns if c.endswith(ending)]
    return [name for name in names if name != "external"]


def _measured(a: Analysis) -> dict[str, Any] | None:
    outline = a.settings.measured_outline
    if a.measured is None and outline is None:
        return None
    numbers: dict[str, Any] = {"angles": None, "outline": None, "scatter_deg": None}
    if a.measured is not None:
        numbers["angles"] = a.measured.angles.numbers()
        numbers["scatter_deg"] = a.measured.scatter
    if outline is not None:
        own = a.outline.place[:, : outline.shape[1]]
        numbers["outline"] = line_distance(own, outline)
    return numbers


def _against(a: Analysis, against: Against) -> dict[str, Any]:
    drape, other = a.drape, against.other
    gap = against_difference(a, against)
    known = np.isfinite(gap)
    k = int(np.argmax(np.where(known, np.abs(gap), -1.0)))
    mine, theirs = forces(drape), forces(other)
    rows = {}
    if mine is not None and theirs is not None:
        rows = {
            name: {"this_N": value["last_N"], "other_N": theirs["tools"][name]["last_N"]}
            for name, value in mine["tools"].items()
            if name in theirs["tools"]
        }
    return {
        "folder": str(other.folder),
        "title": other.title,
        "time_s": other.time,
        "crossings_compared": int(known.sum()),
        "shear": {
            "rms_deg": float(np.sqrt(np.mean(gap[known] ** 2))) if known.any() else None,
            "largest_deg": float(np.abs(gap[k])) if known.any() else None,
            "at": _place(a, k) if known.any() else None,
        },
        "outline": line_distance(a.outline.place[:, :2], against.outline.place[:, :2]),
        "draw_in_least_mean_most_mm": [
            float(v)
            for v in (
                against.outline.along.min(),
                against.outline.along.mean(),
                against.outline.along.max(),
            )
        ],
        "forces": rows,
        "keys": differing_keys(drape.case or {}, other.case or {}),
    }


def against_difference(a: Analysis, against: Against) -> Array:
    """Shear angle of the other drape less that of this one, signed [°], (n,)."""
    return np.asarray(against.shear - np.degrees(a.drape.sheet.snapshot.shear_angle))


def _place(a: Analysis, crossing: int) -> dict[str, list[float]]:
    sheet = a.drape.sheet
    return _xyz(sheet.flat[crossing], sheet.place[crossing])


def _node_place(a: Analysis, node: int) -> dict[str, list[float]]:
    net, u = a.drape.sheet.net, a.drape.sheet.snapshot.displacement
    return _xyz(net.points[node], net.points[node] + u[node])


def _xyz(flat: Array, place: Array) -> dict[str, list[float]]:
    return {"flat_mm": flat[:2].tolist(), "draped_mm": place.tolist()}


def _largest(values: Array) -> float | None:
    return float(np.nanmax(values)) if np.isfinite(values).any() else None


def _percentile(values: Array, share: float) -> float | None:
    return float(np.nanpercentile(values, share)) if np.isfinite(values).any() else None
