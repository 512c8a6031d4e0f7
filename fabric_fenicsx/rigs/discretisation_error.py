"""How far the angles of one drape may be from those of ever finer tows, told by the drape itself.

The tows' axes at a crossing are slopes of fourth order through five places (fabric.axes). Those
through three are of second order, as the places themselves are: the difference between both shear
angles falls with the spacing as the error does, and is large where that is, at tools' edges. It is
a recovery estimate after the idea of Zienkiewicz & Zhu (Int. J. Numer. Methods Eng. 24, 1987), an
indicator and no bound: docs/convergence.md compares it with the error found by refinement.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..fabric.axes import axes_shear, tow_axes
from ..fabric.net import Net
from ..solving.snapshot import Snapshot

__all__ = ["recovered_error", "studied_error"]

OF = "shear angle, root mean square over the crossings"


def recovered_error(net: Net, snapshot: Snapshot, symmetry: Sequence[int]) -> dict[str, Any]:
    """An estimate from one run, for result.json.

    Args:
        net: the net.
        snapshot: its last step.
        symmetry: planes that the net is mirrored by, see fabric.axes.
    """
    rougher = tow_axes(net, snapshot.displacement, symmetry=symmetry, reach=1)
    difference = np.degrees(axes_shear(snapshot.axes) - axes_shear(rougher))
    return {
        "estimate_deg": round(float(np.sqrt(np.mean(difference**2))), 4),
        "of": OF,
        "source": "this run alone: tows' axes through five places less those through three; an "
        "indicator of the error by the spacing, without that by steps and contact, see "
        "docs/convergence.md",
    }


def studied_error(total: dict[str, Any]) -> dict[str, Any] | None:
    """The same from the total of a convergence study; None where it has none."""
    found = total["regions"]["all"]
    if found is None:
        return None
    return {
        "estimate_deg": round(found["error"], 4),
        "uncertainty_deg": round(found["uncertainty"], 4),
        "of": OF,
        "source": f"convergence study of this case ({', '.join(total['of'])}), converge.json",
    }
