"""Write docs/reference.md: every verified number beside the reference it is compared with.

The numbers come from the same functions that the tests use; this only lays them side by side.

    python scripts/reference_page.py        # a few minutes, or: make reference
"""

from __future__ import annotations

from pathlib import Path

from reference_beams import bends, hanging, twisted, unstable
from reference_nets import dynamics, held, invariances, nets, sliding
from reference_strips import pinned, trellis

PAGE = Path(__file__).resolve().parents[1] / "docs" / "reference.md"
INTRODUCTION = """# Verified numbers

Written by `make reference`, with the functions that the tests use. An *identity* is what must come
out equal; a *second method* is a numerical solution that shares no code with the package: shooting,
or an initial value problem. An order is that of the error on the two finest meshes (or steps), each
twice as fine as the one before; elements with two nodes and one point have order 2. Against another
code the difference is both codes' error. Errors are relative where no unit stands, those of
components of a length over that length; errors of the size of round-off are given as a bound.
"""

NOTES = """
¹ The published converged numbers 13.7208006, 23.6459716 and 53.5776446 belong to another axis than
the circle: their input gives three points of the arc, and its curve is the parabola through them.
The circle itself ends at 13.60463, 23.56058 and 53.47548.

² Stiffnesses from ply data, none fitted. Bending stiffness goes with the cube of the thickness: a
strip 3 % thinner than nominal deflects 9 % more. The measured shortenings contradict the
deflections measured with them by up to 44 mm; the tests bound them by that, and they are left out
here. "On the whole" is the slope of computed over measured deflections.

³ A tow released on an incline accelerates at once, but the run begins without acceleration: an
error of first order in the step.

⁴ More cells do not make it smaller: a tow that resists bending leaves the drum a little elsewhere.
With half the height, an eighth of the bending stiffness, most of it is gone.

⁵ The error is that of the spacing, against the extrapolated value. Tows could take the motion of
constant shear in each zone, so that their own costs less.
"""

SECTIONS = {
    "Beams": (bends, hanging, twisted),
    "Snap-through and buckling": (unstable,),
    "In time": (dynamics,),
    "Nets": (nets,),
    "Bias extension": (trellis, pinned),
    "Friction and holder": (sliding, held),
    "What must not matter": (invariances,),
}
HEADER = "| case | quantity | reference | kind | source | ours | error | order |"


def main() -> None:
    """Compute all rows and write the page."""
    parts = [INTRODUCTION]
    for title, makers in SECTIONS.items():
        lines = [f"## {title}", HEADER, "|---" * 8 + "|"]
        for make in makers:
            print(f"{title}: {make.__name__}", flush=True)
            for r in make():
                cells = (r.case, r.quantity, r.reference, r.kind, r.source, r.ours, r.error)
                lines.append("| " + " | ".join((*cells, r.order)) + " |")
        parts.append("\n".join(lines) + "\n")
    PAGE.write_text("\n".join(parts) + NOTES, encoding="utf-8")


if __name__ == "__main__":
    main()
