"""A scene in one HTML file: the net over its tools, to be turned and played in any browser.

The file needs no network and nothing beside it. Coordinates and values of the frames are whole
numbers of 16 bits: of a sheet of 300 mm they keep 0.005 mm.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.output.colours import colour_table, rgb
from fabric_fenicsx.output.files import write_text
from fabric_fenicsx.output.lines import COLOURS, round_step, scale_limits, tow_lines, tow_spacing
from fabric_fenicsx.output.surfaces import TriangleSurface, triangulated
from fabric_fenicsx.solving.snapshot import Snapshot

__all__ = ["SHOWN", "write_scene"]


SHOWN = ("shear_angle", "axial_force", "contact_pressure", "bending_out_of_plane", "displacement")
"""Keys of COLOURS that a scene offers."""

NO_VALUE = 65535

Frame = tuple[Net, Snapshot, list[TriangleSurface]]


def write_scene(
    path: Path,
    frames: Sequence[Frame],
    *,
    title: str,
    colour: str = "shear_angle",
    hidden: Sequence[str] = (),
) -> None:
    """Write a scene.

    Args:
        path: the file, .html; its folder is made.
        frames: net, state and tools in their places, one after the other in time; the net and the
            tools are the same in all.
        title: of the page.
        colour: what colours the tows at first, one of SHOWN.
        hidden: names of tools that are not shown at first.

    Raises:
        ValueError: there is no frame, or no such colour.
        OSError: the file cannot be written.
    """
    if not frames:
        raise ValueError("scene: no frame")
    if colour not in SHOWN:
        raise ValueError(f"scene: colour is {colour!r}, not one of {', '.join(SHOWN)}")
    order = [colour, *(name for name in SHOWN if name != colour)]
    lines = [list(tow_lines(*frame[:2], COLOURS[colour])) for frame in frames]
    points = np.stack([np.concatenate([line.points for line in at]) for at in lines])
    low = points.min(axis=(0, 1))
    extent = np.maximum(np.ptp(points.reshape(-1, 3), axis=0), 1e-9)
    whole = np.rint((points - low) / extent * 65535).astype("<u2")
    data = {
        "low": low.tolist(),
        "extent": extent.tolist(),
        "radius": 0.12 * tow_spacing(frames[0][0]),
        "tows": [0, *np.cumsum([len(line.points) for line in lines[0]]).tolist()],
        "frames": [
            {
                "label": f"t = {snapshot.time:.4g} s",
                "points": _packed(at),
                "places": [tool.place.tolist() for tool in tools],
            }
            for at, (_, snapshot, tools) in zip(whole, frames, strict=True)
        ],
        "colours": [_coloured(name, frames) for name in order],
        "maps": [_packed(_map(diverging)) for diverging in (False, True)],
        "tools": [_tool(tool, tool.name in hidden) for tool in frames[-1][2]],
    }
    text = files("fabric_fenicsx.output").joinpath("scene.html").read_text(encoding="utf-8")
    text = text.replace("@TITLE@", escape(title))
    text = text.replace("@DATA@", json.dumps(data).replace("</", "<\\/"))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)


def _coloured(name: str, frames: Sequence[Frame]) -> dict[str, Any]:
    """One quantity at the nodes of all frames, on one scale."""
    quantity = COLOURS[name]
    values = np.stack(
        [
            np.concatenate([line.values for line in tow_lines(net, snapshot, quantity)])
            for net, snapshot, _ in frames
        ]
    )
    low, high = scale_limits(quantity, values)
    known = np.isfinite(values)
    part = np.clip((np.where(known, values, low) - low) / (high - low), 0.0, 1.0)
    whole = np.where(known, np.rint(part * (NO_VALUE - 1)), NO_VALUE).astype("<u2")
    step = round_step(high - low)
    ticks = step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1.0)
    return {
        "title": quantity.title,
        "map": int(low < 0.0),
        "labels": [[(tick - low) / (high - low), f"{tick + 0.0:.4g}"] for tick in ticks.tolist()],
        "frames": [_packed(at) for at in whole],
    }


def _tool(tool: TriangleSurface, hidden: bool) -> dict[str, Any]:
    """Triangles of a tool with normals that keep its sharp edges sharp."""
    mesh = triangulated(replace(tool, place=np.zeros(3))).compute_normals(
        cell_normals=False, split_vertices=True, feature_angle=40.0, consistent_normals=False
    )
    cells = mesh.faces.reshape(-1, 4)[:, 1:]
    return {
        "name": tool.name,
        "hidden": hidden,
        "colour": [*rgb(tool.colour), tool.opacity],
        "points": _packed(np.asarray(mesh.points, dtype="<f4")),
        "normals": _packed(np.asarray(mesh.point_data["Normals"], dtype="<f4")),
        "cells": _packed(cells.astype("<u4")),
        "count": int(cells.size),
    }


def _map(diverging: bool) -> npt.NDArray[np.uint8]:
    """256 colours, shape (256, 3)."""
    return np.rint(255.0 * colour_table(diverging)).astype(np.uint8)


def _packed(values: npt.NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
