"""Write the tow meshes of the demos: python meshes/generate.py [FOLDER].

The files go beside this script unless another folder is given. Lengths are in mm; the tows are
12 mm apart and a tow has two cells between two crossings.
"""

import sys
from pathlib import Path

import fabric_fenicsx as ff

SPACING = 12.0
INCH = 25.4

SHEETS: dict[str, ff.Sheet] = {
    # A quarter of a square blank; x = 0 and y = 0 are its symmetry planes.
    "drape_12mm": ff.centred_sheet(288.0, 288.0, SPACING, SPACING, subdivisions=2, quarter=True),
    # The sheared square inside the frame, a corner at the origin.
    "picture_frame_12mm": ff.spaced_sheet(
        (0.0, 96.0), (0.0, 96.0), SPACING, SPACING, subdivisions=2
    ),
    # A strip of 3 x 6 inches, clamped at x = 0; the weft tows hang over.
    "cantilever_12mm": ff.spaced_sheet(
        (0.0, 6.0 * INCH), (0.0, 3.0 * INCH), SPACING, SPACING, subdivisions=2
    ),
}


def main(folder: Path = Path(__file__).parent) -> None:
    """Write every mesh into a folder that exists."""
    for name, sheet in SHEETS.items():
        ff.write_msh(sheet, folder / f"{name}.msh")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
