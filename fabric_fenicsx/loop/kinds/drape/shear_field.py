"""The shear angle of a drape as a smooth function of the place on the flat sheet."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from mpi4py import MPI

import numpy as np
from scipy.interpolate import CubicHermiteSpline, RectBivariateSpline

from ....arrays import Array
from ....errors import InputError, SolveError
from ....rigs.common import Session, control
from ....rigs.drape import DrapeCase, build
from ....rigs.kinematic import kinematic_net
from ....rigs.simulation import simulate
from ...measurement.case import measured_case, tow_of
from ...measurement.schema import FILE, Measurement

__all__ = [
    "Net",
    "ShearField",
    "ShearLaw",
    "Solve",
    "drape_case",
    "hermite_weights",
    "kinematic_field",
    "solved_field",
]


#: Weights of 1 − δ⁴/16, in sixteenths.
SHAPIRO = (-1.0, 4.0, 10.0, 4.0, -1.0)


@dataclass(frozen=True, slots=True)
class ShearLaw:
    """m = k1 γ + k3 γ³ + c1 γ̇ per area of fabric; by default that of ``demos/drape.yaml``.

    Attributes:
        k1, k3: of the spring [N/mm].
        c1: of the dashpot [N s/mm].
    """

    k1: float = 0.02
    k3: float = 0.08
    c1: float = 2.0


class ShearField:
    """Signed shear angle over a flat sheet, bicubic between crossings, constant beyond the outer.

    Args:
        x, y: of the crossings [mm], increasing, (n,) and (m,), four or more.
        gamma: signed shear angle there [rad], (n, m).
    """

    def __init__(self, x: Array, y: Array, gamma: Array) -> None:
        self.x, self.y, self.gamma = x, y, gamma
        self._spline = RectBivariateSpline(x, y, gamma)

    @classmethod
    def of_quarter(cls, places: Array, gamma: Array) -> ShearField:
        """The whole sheet from the part x > 0, y > 0: γ changes its sign across either axis.

        Args:
            places: of the crossings on the flat sheet [mm], (n, 2), a full grid.
            gamma: there [rad], (n,).
        """
        x, y = (np.unique(np.round(places[:, i], 6)) for i in (0, 1))
        quarter = np.full((len(x), len(y)), np.nan)
        rows, columns = (
            np.searchsorted(ends, np.round(places[:, i], 6)) for i, ends in ((0, x), (1, y))
        )
        quarter[rows, columns] = gamma
        half = np.vstack([-quarter[::-1], quarter])
        whole = np.hstack([-half[:, ::-1], half])
        return cls(np.concatenate([-x[::-1], x]), np.concatenate([-y[::-1], y]), whole)

    def filtered(self) -> ShearField:
        """The same without waves of two spacings, by 1 − δ⁴/16 along x and y.

        Waves of four spacings lose a quarter of their height, cubics nothing; beyond the edges the
        field goes on as its point reflection. R. Shapiro, Rev. Geophys. 8 (1970), 359-387.
        """
        gamma = self.gamma
        for axis in (0, 1):
            wide = [(2, 2) if i == axis else (0, 0) for i in (0, 1)]
            padded = np.pad(gamma, wide, mode="reflect", reflect_type="odd")
            count = gamma.shape[axis]
            shifted = [np.take(padded, np.arange(k, k + count), axis=axis) for k in range(5)]
            gamma = np.tensordot(SHAPIRO, shifted, axes=1) / 16.0
        return ShearField(self.x, self.y, gamma)

    def at(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """γ [rad] at places [mm], (n,), and its derivatives in x and in y [rad/mm], (n,) each."""
        a, b = np.clip(x, self.x[0], self.x[-1]), np.clip(y, self.y[0], self.y[-1])
        slope_x = np.where(a == x, self._spline(a, b, dx=1, grid=False), 0.0)
        slope_y = np.where(b == y, self._spline(a, b, dy=1, grid=False), 0.0)
        return self._spline(a, b, grid=False), slope_x, slope_y


Solve = Callable[[DrapeCase], ShearField]
Net = Callable[[DrapeCase, float | None], ShearField]
"""From a case and the spacing of a kinematic net's own tows [mm] to its field."""

#: A kinematic net's sheet over the case's: nothing of it depends on where the sheet ends.
BEYOND = 1.5


def drape_case(
    measurement: Measurement,
    shear: ShearLaw,
    C1: float,
    changes: Mapping[str, Any] | None = None,
) -> DrapeCase:
    """The case of a measured drape, a quarter of it.

    Args:
        measurement: of a drape.
        shear: law of the crossings.
        C1: Neo-Hookean constant of the tows [MPa].
        changes: other keys, by their dotted names.

    Raises:
        InputError: there can be no such case.
    """
    rig, fabric = measurement.rig, measurement.fabric
    s = fabric.tow_spacing_mm
    if rig.fabric_size_mm < 4.0 * s:
        raise InputError(
            f"{measurement.folder / FILE}: rig.fabric_size_mm: {rig.fabric_size_mm:g}, "
            f"allowed is four times tow_spacing_mm or more, {4.0 * s:g}"
        )
    keys: dict[str, Any] = {
        "test": "drape",
        "sheet": {
            "width_mm": rig.fabric_size_mm,
            "length_mm": rig.fabric_size_mm,
            "warp_spacing_mm": s,
            "weft_spacing_mm": s,
        },
        "tow": {
            **tow_of(fabric, C1),
            "stiffness": {"bending_in_plane_Nmm": fabric.tow.bending_in_plane_Nmm},
        },
        "crossover": {"k1_N_mm": shear.k1, "k3_N_mm": shear.k3, "dashpot_N_s_mm": shear.c1},
    }
    for name in ("punch_radius", "hole_radius", "edge_radius", "punch_travel"):
        keys[f"{name}_mm"] = getattr(rig, f"{name}_mm")
    keys["duration_s"] = rig.duration_s
    return measured_case(DrapeCase, keys, changes or {}, str(measurement.folder / FILE))


def solved_field(case: DrapeCase) -> ShearField:
    """Run a quarter of a drape on this rank alone and keep the shear angles at its end.

    Raises:
        InputError: there is no such sheet.
        SolveError: the run stopped before its end.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        session = Session(folder, MPI.COMM_SELF, Path(), perf_counter())
        try:
            model = build(case, session)
        except ValueError as error:
            raise InputError(f"drape: {error}") from None
        outcome = simulate(
            model,
            folder,
            test="drape",
            end=case.duration_s,
            control=control(case.solver, case.edge_radius_mm / 2.0),
            force_tolerance=case.solver.force_tolerance_N,
            iteration_limit=case.solver.iteration_limit,
        )
    if not outcome.completed or outcome.last is None:
        raise SolveError(f"the drape stopped before its end: {outcome.stop}")
    places = model.net.points[model.net.crossings].mean(axis=1)[:, :2]
    return ShearField.of_quarter(places, outcome.last.shear_angle)


def kinematic_field(case: DrapeCase, spacing: float | None = None) -> ShearField:
    """Shear angles of the kinematic net over the tools, some way beyond the sheet's edges too.

    Args:
        case: of a drape; only its shapes matter.
        spacing: of the net's own tows [mm], see ``rigs.kinematic.kinematic_net``.

    Raises:
        InputError: there is no such net, or it ends on the sheet.
    """
    sides = {name: BEYOND * getattr(case.sheet, name) for name in ("width_mm", "length_mm")}
    larger = case.model_copy(update={"sheet": case.sheet.model_copy(update=sides)})
    net = kinematic_net(larger, spacing=spacing)
    if net.ended.any():
        raise InputError(f"punch_travel_mm: {case.punch_travel_mm:g}: the kinematic net ends")
    return ShearField(net.u, net.v, net.shear)


def hermite_weights(
    solved_at: Sequence[float], value: float
) -> tuple[list[float], list[float], list[float]]:
    """Interpolation among the fields at zero and at the given amplitudes.

    Piecewise cubic with slopes by second-order differences, so that only the interval's ends and
    their neighbours matter: once continuously differentiable, linear in the fields.

    Args:
        solved_at: amplitudes, without zero.
        value: the amplitude that is asked for; taken to the nearest end beyond them.

    Returns:
        The amplitudes that matter, their fields' weights, and the weights' derivatives.
    """
    nodes = np.unique([0.0, *solved_at])
    inside = float(np.clip(value, nodes[0], nodes[-1]))
    k = int(np.clip(np.searchsorted(nodes, inside, side="right") - 1, 0, len(nodes) - 2))
    near = nodes[max(k - 1, 0) : k + 3]
    unit = np.eye(len(near))
    tangents = np.gradient(unit, near, axis=0, edge_order=2 if len(near) > 2 else 1)
    spline = CubicHermiteSpline(near, unit, tangents, axis=0)
    slopes = spline(inside, 1) if inside == value else np.zeros(len(near))
    return near.tolist(), spline(inside).tolist(), slopes.tolist()
