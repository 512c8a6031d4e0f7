"""Colours of values and of surfaces.

Matplotlib is asked only for those that are rarely needed: its import takes longer than a picture.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array

__all__ = ["colour_table", "rgb"]


SHADES = 256

# Every 32nd part of matplotlib's viridis (N. Smith, S. van der Walt, CC0) from 0.06 to 1:
# perceptually uniform; without its darkest end, in which the shading of a tube would be lost.
# Linear between them it is off by less than 3 of 255.
SEQUENTIAL = """
481769 482071 472a7a 46337f 433d84 404588 3d4e8a 39568c 355e8d 31668e 2e6d8e
2b748e 297b8e 26828e 23898e 21918c 1f978b 1f9f88 21a585 26ad81 2eb37c 3aba76
46c06f 56c667 65cb5e 77d153 89d548 9dd93b b0dd2f c5e021 d8e219 ece51b fde725
"""


def colour_table(diverging: bool = False) -> Array:
    """Red, green and blue of 256 even parts of a scale, from 0 to 1, shape (256, 3).

    Args:
        diverging: pale in the middle, for values of which both signs matter.
    """
    part = np.linspace(0.0, 1.0, SHADES)
    if diverging:
        from matplotlib import colormaps

        return np.asarray(colormaps["coolwarm"](part)[:, :3], dtype=np.float64)
    known = np.array([rgb(f"#{code}") for code in SEQUENTIAL.split()])
    at = np.linspace(0.0, 1.0, len(known))
    return np.column_stack([np.interp(part, at, channel) for channel in known.T])


def rgb(colour: str) -> tuple[float, float, float]:
    """Red, green and blue of a colour from 0 to 1: #rrggbb, or any name that matplotlib knows."""
    if len(colour) == 7 and colour.startswith("#"):
        red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
        return red, green, blue
    from matplotlib.colors import to_rgb

    return to_rgb(colour)
