"""Sheet and weave of a case: their keys, and what the rigs make of them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from ..arrays import Array
from ..errors import InputError
from ..fabric.crossings import areas, crossing_numbers
from ..fabric.layout import TowLayout, spaced_layout
from ..fabric.net import Net
from ..fabric.outline import Circle, Outline, Polygon, rectangle
from ..fabric.weave import WEAVES, WeavePattern, pattern_from_file
from ..inputs.groups import Keys, Positive

__all__ = ["SheetKeys", "WeaveKeys", "crossing_weights", "layout", "pattern"]

Binary = Annotated[int, Field(ge=0, le=1)]
Angle = Annotated[float, Field(ge=-180.0, le=180.0)]


class SheetKeys(Keys):
    """The sheet and its virtual tows; warp runs along y, weft along x."""

    width_mm: Positive = Field(288.0, description="along x")
    length_mm: Positive = Field(288.0, description="along y")
    warp_spacing_mm: Positive = Field(12.0, description="distance between warp tows")
    weft_spacing_mm: Positive = Field(12.0, description="distance between weft tows")
    subdivisions: Annotated[int, Field(ge=1, le=64)] = Field(
        2, description="cells of a tow between two crossings"
    )


class WeaveKeys(Keys):
    """Pattern, angles, outline and crimp of the tows."""

    pattern: str | list[list[Binary]] = Field(
        "plain",
        description=f"{', '.join(WEAVES)}; a text file (.txt) that draws it; or a matrix, "
        "a row for each weft tow, 1 where the warp lies on top",
    )
    stitches: list[list[Binary]] = Field(
        default_factory=list, description="with a matrix: 1 where a stitch ties the tows"
    )
    warp_angle_deg: Angle = Field(90.0, description="of the warp from the x axis")
    weft_angle_deg: Angle = Field(0.0, description="of the weft from the x axis")
    warp_spacings_mm: list[Positive] = Field(
        default_factory=list,
        description="distances between warp tows in turn, instead of sheet.warp_spacing_mm",
    )
    weft_spacings_mm: list[Positive] = Field(
        default_factory=list,
        description="distances between weft tows in turn, instead of sheet.weft_spacing_mm",
    )
    outline: Literal["rectangle", "circle"] | list[tuple[float, float]] = Field(
        "rectangle",
        description="of the sheet: its width and length, a circle of its width, or a polygon's "
        "points x, y in mm",
    )
    crimp_mm: Annotated[float, Field(ge=0.0)] = Field(
        0.0, description="distance of the axes of crossing tows; 0: straight tows"
    )
    shear_law_of: Literal["plain", "this"] = Field(
        "plain",
        description="the weave on which k1, k3 and the dashpot were measured: a plain one, or this",
    )

    @model_validator(mode="after")
    def _is_a_weave(self) -> WeaveKeys:
        if isinstance(self.pattern, str):
            if self.stitches:
                raise ValueError("stitches: need a matrix as pattern")
            if self.pattern not in WEAVES and not self.pattern.endswith(".txt"):
                raise ValueError(
                    f"pattern: {self.pattern!r}; allowed: {', '.join(WEAVES)}, a file .txt or a "
                    "matrix of 0 and 1"
                )
        else:
            pattern(self)
        if not isinstance(self.outline, str):
            Polygon(tuple(self.outline))
        return self


def pattern(keys: WeaveKeys, base: Path = Path()) -> WeavePattern:
    """The pattern of a case; the name of a file counts from ``base``."""
    if not isinstance(keys.pattern, str):
        stitches = tuple(map(tuple, keys.stitches))
        return WeavePattern(tuple(map(tuple, keys.pattern)), stitches)
    return WEAVES.get(keys.pattern) or pattern_from_file(base / keys.pattern)


def layout(keys: WeaveKeys, sheet: SheetKeys, *, quarter: bool, base: Path = Path()) -> TowLayout:
    """The tows of a case, for `write_msh`; read the mesh with ``crossing_gap=crimp``.

    Raises:
        InputError: such a sheet cannot be.
    """
    try:
        return spaced_layout(
            _outline(keys, sheet),
            warp_angle=keys.warp_angle_deg,
            weft_angle=keys.weft_angle_deg,
            warp_spacing=keys.warp_spacings_mm or sheet.warp_spacing_mm,
            weft_spacing=keys.weft_spacings_mm or sheet.weft_spacing_mm,
            subdivisions=sheet.subdivisions,
            quarter=quarter,
            crimp=keys.crimp_mm,
            pattern=pattern(keys, base),
        )
    except ValueError as error:
        raise InputError(f"weave, sheet: {error}") from None


def crossing_weights(
    keys: WeaveKeys, sheet: SheetKeys, net: Net, base: Path = Path()
) -> dict[str, Array]:
    """Factors on the in-plane moments of each crossing, for `Model(**...)`.

    Returns:
        "patch", the area of the crossing over sheet.warp_spacing_mm · sheet.weft_spacing_mm, by
        which the laws per area are multiplied elsewhere, and "interlacing", the same times the
        interlacing, by the mean one of the repeat where the laws are this weave's own. Each
        (n_crossings,); 1 in a plain weave of evenly spaced tows at right angles.
    """
    weave = pattern(keys, base)
    share = weave.interlacing(*crossing_numbers(net))
    if keys.shear_law_of == "this":
        share = share / weave.mean_interlacing
    patch = areas(net) / (sheet.warp_spacing_mm * sheet.weft_spacing_mm)
    return {"patch": patch, "interlacing": share * patch}


def _outline(keys: WeaveKeys, sheet: SheetKeys) -> Outline:
    if keys.outline == "circle":
        return Circle(sheet.width_mm / 2.0)
    if keys.outline == "rectangle":
        half = (sheet.width_mm / 2.0, sheet.length_mm / 2.0)
        return rectangle((-half[0], half[0]), (-half[1], half[1]))
    return Polygon(tuple(keys.outline))
