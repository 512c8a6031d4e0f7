"""Rows of docs/reference.md about bias extension."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from reference_table import CLOSED, IDENTITY, Row, number, size

# isort: split
import test_bias_extension as bias

from fabric_fenicsx.fabric.bias_strip import BiasStrip


def trellis() -> Iterator[Row]:
    """Constant shear in each zone: kinematics, and the energy's balance there and back."""
    for degrees in (45.0, 35.0):
        strip, net, places, gamma, zone, inner = bias.imposed(degrees)
        exact = float(np.degrees(strip.angle(20.0)))
        found = np.degrees(gamma[inner & (zone == 0)])
        yield Row(
            f"Strip of 100 x 250 mm at {degrees:g}°, its motion imposed on a net, 20 mm",
            "shear angle of zone A [degrees]",
            number(exact),
            CLOSED,
            "sin γ = (\\|r\\|² − p² − q²)/2pq",
            number(float(found[np.abs(found - exact).argmax()])),
            size(np.abs(found - exact).max(), "°"),
        )
        ends = net.points[net.cells]
        same = np.diff(strip.gripped(net.points)[net.cells], axis=1)[:, 0] == 0
        length, before = (
            np.linalg.norm(np.diff(x, axis=1)[:, 0], axis=1) for x in (places[net.cells], ends)
        )
        yield Row(
            "the same",
            "length of every cell of a tow over that before",
            "1",
            IDENTITY,
            "tows that do not stretch",
            "",
            size(np.abs(length / before - 1.0)[same].max()),
        )
    strip, gamma = BiasStrip(200.0, 100.0), np.linspace(0.0, 1.0, 2001)[1:]

    def moment(angle: np.ndarray) -> np.ndarray:
        return 0.02 * angle + 0.08 * angle**3

    back = strip.moment(gamma, strip.force(moment, gamma))
    yield Row(
        "Moment from the force of the zones' energy, 100 x 200 mm, up to 57°",
        "m(γ) over that which made the force",
        "1",
        IDENTITY,
        "F dd = Σ A m dγ, solved for m",
        "",
        size(np.abs(back / moment(gamma) - 1.0).max()),
    )


def pinned() -> Iterator[Row]:
    """A net of its own, which costs less work than constant shear in each zone."""
    with TemporaryDirectory() as folder:
        found, limit, bounds = bias.refined(Path(folder))
    names = ("force [N]", "angle of zone A [degrees]", "work [N mm]")
    for name, values, end, bound in zip(names, found, limit, bounds, strict=True):
        change = np.diff(values)
        yield Row(
            "Strip of 40 x 100 mm pulled by 16 mm, 16 meshes over its width⁵",
            f"{name} [extrapolated]",
            f"< {number(float(bound), 5)}",
            CLOSED,
            "constant shear in each zone; of the work an upper bound",
            f"{number(float(values[-1]), 5)} [{number(float(end), 5)}]",
            f"{size(values[-1] / end - 1.0)}",
            f"{np.log2(change[0] / change[1]):.2f}",
        )
