"""A pin-jointed net of stiff tows laid over a dome: angles between warp and weft, no forces.

The net is built node by node from the punch's axis outwards: a node lies on the surface, one rod
from each of its two inner neighbours; the two tows through the axis follow meridians. This is a
kinematic stand-in for a drape: it knows where an offset punch or a turned sheet moves the pattern,
but nothing of stiffness, friction or the path of forming. Units: mm, rad, degrees where named.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import fsolve

from measurements.sets import Recipe
from measurements.writing import Measurement, Run, Truth


@dataclass(frozen=True)
class Dome:
    """Surface of revolution: cap of the punch, a cone that touches it, the die's edge, a flange.

    Lengths [mm]; the cap's top lies `travel` above the flange.
    """

    punch_radius: float = 76.2
    hole_radius: float = 80.0
    travel: float = 65.0
    edge_radius: float = 10.0

    @property
    def contact_angle(self) -> float:
        """Polar angle [rad] at which the sheet leaves the punch: a common tangent of two circles.

        Raises:
            ValueError: punch and die edge overlap.
        """
        out = self.hole_radius + self.edge_radius
        up = self.edge_radius + self.punch_radius - self.travel
        near = (self.punch_radius + self.edge_radius) / np.hypot(out, up)
        if near > 1:
            raise ValueError(f"{self}: the punch does not pass through the hole")
        return float(np.arctan2(out, up) - np.arccos(near))

    def height(self, r: np.ndarray) -> np.ndarray:
        """Height [mm] above the flange at a distance r [mm] from the axis."""
        angle, edge = self.contact_angle, self.edge_radius
        centre = self.travel - self.punch_radius
        leave = self.punch_radius * np.sin(angle)
        land = self.hole_radius + edge - edge * np.sin(angle)
        cap = centre + np.sqrt(np.clip(self.punch_radius**2 - r**2, 0, None))
        cone = centre + self.punch_radius * np.cos(angle) - (r - leave) * np.tan(angle)
        past = np.clip(self.hole_radius + edge - r, 0, edge)
        fillet = edge - np.sqrt(edge**2 - past**2)
        return np.where(r < leave, cap, np.where(r < land, cone, fillet))


def net(dome: Dome, reach: float, rod: float) -> np.ndarray:
    """Nodes of the quadrant u, v >= 0 of the net: (n, n, 3) [mm]; NaN where no net can be laid.

    The other quadrants are mirror images, as dome and first tows are.
    """
    count = int(np.ceil(reach / rod)) + 2
    nodes = np.full((count, count, 3), np.nan)
    nodes[0, 0] = 0, 0, dome.travel

    def away(r: float, last: np.ndarray) -> float:
        return (r - last[0]) ** 2 + (float(dome.height(r)) - last[2]) ** 2 - rod**2

    for i in range(1, count):
        last = nodes[i - 1, 0]
        # Bisection between no step and a whole one; the chord grows all the way.
        low, high = last[0], last[0] + rod
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if away(middle, last) < 0 else (low, middle)
        nodes[i, 0] = high, 0, dome.height(high)
        nodes[0, i] = 0, high, dome.height(high)

    def lengths(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> list[float]:
        point = np.array([*p, float(dome.height(np.hypot(*p)))])
        return [np.sum((point - q) ** 2) - rod**2 for q in (a, b)]

    for i in range(1, count):
        for j in range(1, count):
            a, b, inner = nodes[i - 1, j], nodes[i, j - 1], nodes[i - 1, j - 1]
            guess = (a + b - inner)[:2]
            if not np.isfinite(guess).all():
                continue
            place, _, found, _ = fsolve(lengths, guess, (a, b), full_output=True)
            # The inner node is a solution too: the cell folded onto itself.
            if found == 1 and np.hypot(*(place - inner[:2])) > 0.2 * rod:
                nodes[i, j] = *place, dome.height(np.hypot(*place))
    return nodes


def angle_field(dome: Dome, reach: float, rod: float = 4.0) -> RegularGridInterpolator:
    """Angle [degrees] between the tows at (|u|, |v|) [mm] along weft and warp from the axis.

    It is the acute one, as a protractor shows it. Taken in the middles of the cells, where the
    mean of opposite rods is second-order; extrapolated by half a cell on the axes.
    """
    nodes = net(dome, reach, rod)
    weft = (nodes[1:, 1:] - nodes[:-1, 1:] + nodes[1:, :-1] - nodes[:-1, :-1]) / 2
    warp = (nodes[1:, 1:] - nodes[1:, :-1] + nodes[:-1, 1:] - nodes[:-1, :-1]) / 2
    cosine = (weft * warp).sum(-1) / np.linalg.norm(weft, axis=-1) / np.linalg.norm(warp, axis=-1)
    middles = rod * (np.arange(len(nodes) - 1) + 0.5)
    angle = np.degrees(np.arccos(cosine))
    return RegularGridInterpolator((middles, middles), angle, bounds_error=False, fill_value=None)


def angles(
    field: RegularGridInterpolator,
    x: np.ndarray,
    y: np.ndarray,
    offset: tuple[float, float] = (0.0, 0.0),
    rotation: float = 0.0,
) -> np.ndarray:
    """Angles [degrees] at marks (x, y) [mm] of the flat sheet as it was meant to lie.

    The punch's axis meets the sheet at `offset` [mm]; the sheet lies turned by `rotation` [rad]
    (counter-clockwise) under marks that keep to the tool's axes.
    """
    x, y = x - offset[0], y - offset[1]
    u = np.cos(rotation) * x + np.sin(rotation) * y
    v = np.cos(rotation) * y - np.sin(rotation) * x
    return field(np.abs(np.stack([u, v], axis=-1)))


def drape_set(
    rng: np.random.Generator, name: str, effects: tuple[str, ...] = (), quadrant: bool = False
) -> Measurement:
    """Marks on a sheet over a dome; effects out of punch_offset and ply_rotation."""
    dome = Dome(travel=round(rng.uniform(50, 68), 1))
    size = float(rng.choice([240, 260, 280]))
    sigma = round(rng.uniform(1, 2), 1)
    offset, rotation, told = (0.0, 0.0), 0.0, []
    if "punch_offset" in effects:
        way, far = rng.uniform(0, 2 * np.pi), rng.uniform(4, 15)
        offset = (far * np.cos(way), far * np.sin(way))
        told.append({"name": "punch_offset", "parameters": {"x": offset[0], "y": offset[1]}})
    if "ply_rotation" in effects:
        rotation = np.radians(rng.choice([-1, 1]) * rng.uniform(4, 15))
        told.append({"name": "ply_rotation", "parameters": {"rotation": rotation}})

    reach = 0.42 * size
    field = angle_field(dome, reach * 1.2 + np.hypot(*offset))
    count = int(rng.integers(40, 121))
    # Marks are where they are written.
    x, y = np.round(rng.uniform(0 if quadrant else -reach, reach, (2, 4 * count)), 1)
    true = angles(field, x, y, offset, rotation)
    # Where the net cannot be laid there is nothing to read.
    kept = np.flatnonzero(np.isfinite(true) & np.isfinite(angles(field, x, y)))[:count]
    x, y, true = x[kept], y[kept], true[kept]
    ratio = float(np.sqrt(np.mean((true - angles(field, x, y)) ** 2))) / sigma
    columns = {
        "x_mm": x,
        "y_mm": y,
        "angle_deg": true + rng.normal(0, sigma, len(x)),
        **({"std_deg": np.full(len(x), sigma)} if rng.uniform() < 0.5 else {}),
    }
    last = 3 * len(x) // 4
    runs = [
        Run({key: value[part] for key, value in columns.items()}, role)
        for part, role in ((slice(0, last), "fit"), (slice(last, None), "holdout"))
    ]
    verdict = "effect_found" if effects else "no_effect"
    truth = Truth(name, "drape", verdict, told, [frozenset(effects)], {}, sigma, True, ratio)
    rig = {
        "punch_radius_mm": dome.punch_radius,
        "hole_radius_mm": dome.hole_radius,
        "punch_travel_mm": dome.travel,
        "fabric_size_mm": size,
        "edge_radius_mm": dome.edge_radius,
        "duration_s": 60,
    }
    fabric = {"areal_density_kg_m2": 0.21894, "tow_spacing_mm": 12}
    digits = {"x_mm": 1, "y_mm": 1, "angle_deg": 1, "std_deg": 1}
    noise = {"angle_deg": sigma}
    return Measurement(truth, fabric, rig, noise, runs, dome, digits)


def drapes(seed: int) -> list[Recipe]:
    """Nine kinematic drapes: none, an offset punch, a turned sheet, and both."""
    rows = [
        ("drape-none-1", {}),
        ("drape-none-2", {"quadrant": True}),
        *((f"drape-punch_offset-{i}", {"effects": ("punch_offset",)}) for i in (1, 2, 3)),
        *((f"drape-ply_rotation-{i}", {"effects": ("ply_rotation",)}) for i in (1, 2, 3)),
        ("drape-both", {"effects": ("punch_offset", "ply_rotation")}),
    ]
    return [Recipe(name, seed, drape_set, options) for name, options in rows]
