"""Write the moulds of the demos as STL files, in mm: `python meshes/make_moulds.py`.

A punch has its highest point at z = 0 and rises into the sheet above it; the file that ends in
`_punch` is the same turned over, to press downwards as that of a drape case does. A plate lies with
its face in z = 0, below the sheet; its hole has the punch's outline, a gap wider, and a rounded
edge.
"""

from pathlib import Path

import numpy as np

from fabric_fenicsx.geometry.triangles import Triangles, write_stl

FOLDER = Path(__file__).parent


def outline(corners, pieces, straight):
    """Bases and outward normals, (n, 2) each, of a closed curve around convex corners.

    An offset of the curve is bases + t · normals. ``pieces`` are those of a quarter turn, and
    ``straight`` the length of pieces along the sides [mm].
    """
    corners = np.asarray(corners, dtype=float)
    bases, normals = [], []
    for k, corner in enumerate(corners):
        before, after = corner - corners[k - 1], corners[(k + 1) % len(corners)] - corner
        first, last = (np.arctan2(-d[0], d[1]) for d in (before, after))
        turn = (last - first) % (2.0 * np.pi)
        n = max(1, round(pieces * turn / (np.pi / 2.0)))
        angle = first + turn * np.arange(n + 1) / n
        bases.append(np.repeat(corner[None], n + 1, axis=0))
        normals.append(np.column_stack([np.cos(angle), np.sin(angle)]))
        m = max(1, round(np.linalg.norm(after) / straight))
        share = np.arange(1, m)[:, None] / m
        bases.append(corner + share * after)
        normals.append(np.repeat(normals[-1][-1:], m - 1, axis=0))
    return np.vstack(bases), np.vstack(normals)


def quilt(rows, *, close):
    """Triangles of rows of points, (k, n, 3), each row a closed curve, anticlockwise from above.

    Rows go from the outside below to the inside above; ``close`` joins the last to the first, else
    first and last row are filled about their middles.
    """
    rows = np.asarray(rows)
    lower, upper = (rows, np.roll(rows, -1, axis=0)) if close else (rows[:-1], rows[1:])
    a, b = lower, np.roll(lower, -1, axis=1)
    d, c = upper, np.roll(upper, -1, axis=1)
    parts = [np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]
    triangles = [part.reshape(-1, 3, 3) for part in parts]
    if not close:
        for row, order in ((rows[0], (1, 0, 2)), (rows[-1], (0, 1, 2))):
            middle = np.broadcast_to(row.mean(axis=0), row.shape)
            fan = np.stack([row, np.roll(row, -1, axis=0), middle], axis=1)
            triangles.append(fan[:, order])
    return Triangles.from_corners(np.concatenate(triangles))


def swept(curve, profile):
    """Rows of a profile of offsets and heights, (k, 2), along a curve."""
    bases, normals = curve
    return [np.column_stack([bases + t * normals, np.full(len(bases), z)]) for t, z in profile]


def plate(curve, gap, edge=8.0, width=95.0, thickness=15.0):
    """A plate with a hole at the offset ``gap`` of a curve."""
    angle = np.linspace(0.0, np.pi / 2.0, 9)
    rounding = np.column_stack([gap + edge - edge * np.cos(angle), edge * (np.sin(angle) - 1.0)])
    # From the outer wall over the face and the rounding down the hole, and back below.
    outer = [[gap + edge + width, -thickness], [gap + edge + width, 0.0]]
    profile = np.vstack([outer, rounding[::-1], [[gap, -thickness]]])
    return quilt(swept(curve, profile), close=True)


def double_dome(half=40.0, radius=46.0, blend=12.0, shank=25.0):
    """Two spheres about (±half, 0), blended into each other, on a shank of their outline."""
    bases, normals = outline([[-half, 0.0], [half, 0.0]], 17, 4.0)
    flat = bases + radius * normals
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    rows = []
    for angle in np.linspace(0.0, np.pi / 2.0, 22)[:-1]:
        ray = np.column_stack([np.cos(angle) * flat, np.full(len(flat), np.sin(angle))])
        low, high = np.zeros(len(ray)), np.full(len(ray), half + 2.0 * radius)
        for _ in range(60):
            middle = (low + high) / 2.0
            x = middle[:, None] * ray
            d = [np.linalg.norm(x - [s * half, 0.0, 0.0], axis=1) - radius for s in (-1.0, 1.0)]
            inside = -blend * np.logaddexp(-d[0] / blend, -d[1] / blend) < 0.0
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        rows.append(low[:, None] * ray)
    rows.insert(0, rows[0] - [0.0, 0.0, shank])
    rows = np.array(rows)
    return quilt(rows - [0.0, 0.0, rows[..., 2].max()], close=False)


def box(curve, edge, height=60.0):
    """A box whose top edge and corners are rounded with the same radius."""
    angle = np.linspace(0.0, np.pi / 2.0, 13)
    rounding = np.column_stack([edge * np.cos(angle), edge * (np.sin(angle) - 1.0)])
    return quilt(swept(curve, np.vstack([[[edge, -height]], rounding])), close=False)


def turned_over(surface):
    """The mirror image in z = 0."""
    return Triangles(surface.points * [1.0, 1.0, -1.0], surface.cells[:, ::-1])


def main():
    """Write all of them."""
    racetrack = outline([[-40.0, 0.0], [40.0, 0.0]], 17, 4.0)
    square = outline(30.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), 12, 60.0)
    moulds = {
        "double_dome": double_dome(),
        "double_dome_plate": plate(racetrack, 52.0),
        "box": box(square, 20.0),
        "box_plate": plate(square, 25.0),
    }
    moulds |= {f"{name}_punch": turned_over(moulds[name]) for name in ("double_dome", "box")}
    for name, surface in moulds.items():
        assert surface.closed and surface.volume > 0.0, name
        write_stl(FOLDER / f"{name}.stl", surface, name)
        print(f"{name}.stl: {len(surface.cells)} triangles, {surface.volume:.0f} mm³")


if __name__ == "__main__":
    main()
