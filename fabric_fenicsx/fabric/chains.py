"""From loose line cells to the net: find the tows, direct and number them, find the crossings.

The net that comes out depends on where the cells lie and on nothing else: neither the order of
nodes and cells nor the direction of a cell in the file matters.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from fabric_fenicsx.fabric.net import WARP, WEFT, Net

from ..arrays import Array, Integers

__all__ = ["CROSSING_TOLERANCE", "net_from_lines", "place"]

CROSSING_TOLERANCE = 1e-3
"""A warp and a weft node closer than this part of the mean cell length are a crossing."""

SAME_PLACE = 1e-6
"""Part of a length below which a component or a distance counts as nothing."""

CLEAR = 0.1
"""A family points along its axis if more than this of a unit vector does."""

NAMES = {WARP: "warp", WEFT: "weft"}
OWN_AXIS = {WARP: 1, WEFT: 0}
Z, Y, X = 2, 1, 0


def net_from_lines(
    points: Array, warp: Integers, weft: Integers, crossing_gap: float = 0.0
) -> tuple[Net, Integers]:
    """Build the net of the tows that line cells form.

    The cells of a family must form open chains. Warp tows are directed towards +y and weft tows
    towards +x; a family that lies across its axis is directed along its main one, or against it
    where otherwise the warp would not lie to the left of the weft, seen from above. Tows are
    numbered warp first, by the place of their middle, and nodes along the tows. A node that a
    warp and a weft cell share becomes two.

    The sheet's normal at a crossing is weft direction × warp direction, turned as a whole so that
    a sheet which does not stand upright has it upwards, +z. Between two crossings it is
    interpolated along the tow, then made perpendicular to the cell.

    Args:
        points: node positions [mm], shape (n, 3).
        warp: nodes of each warp cell, shape (n_warp_cells, 2).
        weft: nodes of each weft cell, shape (n_weft_cells, 2).
        crossing_gap: largest distance in height, along z, of the two nodes of a crossing [mm].

    Returns:
        The net, and for each of its nodes the row of `points` it came from.

    Raises:
        ValueError: the cells do not form tows that cross; says which group and where.
    """
    parts = _warp_left_of_weft(
        points, [_tows(points, lines, family) for family, lines in ((WARP, warp), (WEFT, weft))]
    )
    source = np.concatenate([nodes for nodes, _ in parts])
    counts = np.concatenate([count for _, count in parts])
    family = np.repeat([WARP, WEFT], [len(count) for _, count in parts])
    node_tow = np.repeat(np.arange(len(counts)), counts)
    last = np.cumsum(counts) - 1
    first = last - counts + 1
    begins = np.setdiff1d(np.arange(len(source)), last)
    cells = np.column_stack([begins, begins + 1])
    at = np.ascontiguousarray(points[source])
    crossings = _crossings(at, cells, len(parts[WARP][0]), crossing_gap)
    net = Net(
        points=at,
        cells=cells,
        cell_tow=node_tow[begins],
        tow_family=family,
        crossings=crossings,
        ends=np.column_stack([first, last]),
        normals=_sheet_normals(at, cells, node_tow, crossings),
    )
    return net, source


def place(point: Array) -> str:
    """A position as the messages print it."""
    return "({:g}, {:g}, {:g})".format(*(point + 0.0))


def _tows(points: Array, lines: Integers, family: int) -> tuple[Integers, Integers]:
    """Nodes along the tows of one family, one tow after another, and the node count of each."""
    group = f"group '{NAMES[family]}'"
    lengths = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
    if not lengths.all():
        where = points[lines[np.argmin(lengths), 0]]
        raise ValueError(f"{group} has a cell of no length at {place(where)} mm")
    nodes, inverse = np.unique(lines, return_inverse=True)
    local = inverse.reshape(-1, 2)
    at = points[nodes]

    degree = np.bincount(local.ravel())
    if degree.max() > 2:
        node = np.argmax(degree)
        raise ValueError(
            f"{group} branches at {place(at[node])} mm, where {degree[node]} of its cells meet; "
            "a tow is a chain, at most 2 cells to a node"
        )
    size = len(nodes)
    graph = csr_array(
        coo_array((np.ones(len(local)), (local[:, 0], local[:, 1])), shape=(size, size))
    )
    n_tows, tow = connected_components(graph, directed=False)
    ends = np.flatnonzero(degree == 1)
    open_ended = np.isin(tow, tow[ends])
    if not open_ended.all():
        raise ValueError(
            f"{group} has a closed loop through {place(at[np.argmin(open_ended)])} mm; "
            "a tow is a chain with two ends"
        )
    pairs = ends[np.argsort(tow[ends], kind="stable")].reshape(n_tows, 2)
    chords = at[pairs[:, 1]] - at[pairs[:, 0]]
    spans = np.linalg.norm(chords, axis=1)
    if spans.min() <= SAME_PLACE * lengths.mean():
        raise ValueError(
            f"{group} has a tow whose two ends meet at {place(at[pairs[np.argmin(spans), 0]])} mm; "
            "a tow is a chain with two ends apart"
        )
    start = np.where(_direction(chords, OWN_AXIS[family]) > 0, pairs[:, 0], pairs[:, 1])
    hops = dijkstra(graph, directed=False, indices=start, unweighted=True, min_only=True)

    along = np.lexsort((hops, tow))
    counts = np.bincount(tow)
    firsts = np.cumsum(counts) - counts
    middle = np.add.reduceat(at[along], firsts, axis=0) / counts[:, None]
    rank = np.empty(n_tows, dtype=np.int64)
    rank[_by_place(middle, at[start], SAME_PLACE * lengths.mean(), family)] = np.arange(n_tows)
    along = np.lexsort((hops, rank[tow]))
    return nodes[along], np.bincount(rank[tow])


def _warp_left_of_weft(
    points: Array, parts: list[tuple[Integers, Integers]]
) -> list[tuple[Integers, Integers]]:
    """The tows of both families; one that lies across its axis may be turned round."""
    chords = []
    for nodes, counts in parts:
        last = np.cumsum(counts) - 1
        chords.append(points[nodes[last]] - points[nodes[last - counts + 1]])
    across = [f for f in (WARP, WEFT) if _lean(chords[f])[OWN_AXIS[f]] <= CLEAR]
    t, s = (c.mean(axis=0) / np.linalg.norm(c, axis=1).mean() for c in chords)
    if across and _upwards(np.cross(s, t)[None]) < 0.0:
        nodes, counts = parts[across[0]]
        tows = np.split(nodes, np.cumsum(counts)[:-1])
        parts[across[0]] = np.concatenate([tow[::-1] for tow in tows]), counts
    return parts


def _lean(chords: Array) -> Array:
    """How much of the chords' directions lies along each axis, on the mean."""
    lengths = np.linalg.norm(chords, axis=1)
    lean: Array = np.round((np.abs(chords) / lengths[:, None]).mean(axis=0), 6)
    return lean


def _direction(chords: Array, own: int) -> Array:
    """+1 or -1 for each chord: whether it goes the way of its family."""
    lengths, lean = np.linalg.norm(chords, axis=1), _lean(chords)
    axis = own if lean[own] > CLEAR else int(np.argmax(lean))
    signs = np.zeros(len(chords))
    for k in (axis, *(other for other in (X, Y, Z) if other != axis)):
        decided = (signs != 0) | (np.abs(chords[:, k]) <= SAME_PLACE * lengths)
        signs = np.where(decided, signs, np.sign(chords[:, k]))
    return signs


def _by_place(middle: Array, start: Array, grain: float, family: int) -> Integers:
    """Order of the tows: across their family's axis first, then along it, then by height."""
    keys = [1 - OWN_AXIS[family], OWN_AXIS[family], Z]
    coarse = np.round(middle / grain)
    return np.lexsort([table[:, k] for table in (start, middle, coarse) for k in reversed(keys)])


def _crossings(points: Array, cells: Integers, n_warp: int, gap: float) -> Integers:
    """Warp node and weft node of each crossing, in the order of the warp nodes."""
    lengths = np.linalg.norm(points[cells[:, 1]] - points[cells[:, 0]], axis=1)
    reach = CROSSING_TOLERANCE * lengths.mean()
    # A height of reach + gap counts as much as a distance of reach in the plan.
    scaled = points * np.array([1.0, 1.0, reach / (reach + gap)])
    tree = cKDTree(scaled[n_warp:])
    found = tree.query(scaled[:n_warp], k=2, distance_upper_bound=reach)
    distance, partner = np.asarray(found[0]), np.asarray(found[1])
    warp = np.flatnonzero(np.isfinite(distance[:, 0]))
    if not len(warp):
        raise ValueError(
            "groups 'warp' and 'weft' do not cross; at a crossing each has a node, "
            f"no further apart than {reach:.3g} mm"
            + (f" in the plan and {gap:g} mm in height" if gap else "")
        )
    weft = partner[warp, 0] + n_warp
    crowded = np.isfinite(distance[warp, 1]) | (np.bincount(weft)[weft] > 1)
    if crowded.any():
        raise ValueError(
            f"more than two tows cross at {place(points[warp[np.argmax(crowded)]])} mm; "
            "one of 'warp' and one of 'weft' are allowed"
        )
    return np.column_stack([warp, weft])


def _sheet_normals(
    points: Array, cells: Integers, node_tow: Integers, crossings: Integers
) -> Array:
    """Unit normal of the sheet at each cell, perpendicular to it."""
    chords = points[cells[:, 1]] - points[cells[:, 0]]
    lengths = np.linalg.norm(chords, axis=1)
    tangents = chords / lengths[:, None]
    node_tangents = np.zeros_like(points)
    for end in (0, 1):
        node_tangents[cells[:, end]] += tangents
    sheet = np.cross(node_tangents[crossings[:, 1]], node_tangents[crossings[:, 0]])
    sine = np.linalg.norm(sheet, axis=1)
    if sine.min() <= SAME_PLACE:
        where = place(points[crossings[np.argmin(sine), 0]])
        raise ValueError(f"warp and weft run along each other at {where} mm; they must cross")
    sheet *= _upwards(sheet / sine[:, None]) / sine[:, None]

    # Stations along each tow: nodes rise along a tow and from tow to tow.
    order = np.argsort(crossings.ravel())
    stations = crossings.ravel()[order]
    at_station = np.repeat(sheet, 2, axis=0)[order]
    arc = np.zeros(len(points))
    arc[cells[:, 1]] = lengths
    arc = np.cumsum(arc)
    middle = (arc[cells[:, 0]] + arc[cells[:, 1]]) / 2.0
    tow = node_tow[cells[:, 0]]
    after = np.searchsorted(stations, cells[:, 1])
    left, right = np.maximum(after - 1, 0), np.minimum(after, len(stations) - 1)
    has_left = (after > 0) & (node_tow[stations[left]] == tow)
    has_right = (after < len(stations)) & (node_tow[stations[right]] == tow)
    left = np.where(has_left, left, right)
    right = np.where(has_right, right, left)
    gap = arc[stations[right]] - arc[stations[left]]
    share = np.divide(middle - arc[stations[left]], gap, out=np.zeros_like(gap), where=gap > 0.0)
    normals = at_station[left] * (1.0 - share)[:, None] + at_station[right] * share[:, None]

    alone = ~(has_left | has_right)
    if alone.any():
        centres = points[cells[alone]].mean(axis=1)
        nearest = cKDTree(points[crossings[:, 0]]).query(centres)[1]
        normals[alone] = sheet[nearest]

    normals -= np.einsum("ij,ij->i", normals, tangents)[:, None] * tangents
    sizes = np.linalg.norm(normals, axis=1)
    if sizes.min() <= SAME_PLACE:
        where = place(points[cells[np.argmin(sizes), 0]])
        raise ValueError(f"a tow leaves the sheet's surface at {where} mm; it must lie in it")
    return normals / sizes[:, None]


def _upwards(normals: Array) -> float:
    """+1 or -1: what turns the normals towards +z on the mean, else towards +y, else +x."""
    mean = normals.mean(axis=0)
    for axis in (Z, Y, X):
        if abs(mean[axis]) > 0.1:
            return float(np.sign(mean[axis]))
    return 1.0
