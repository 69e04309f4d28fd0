"""From triangles to what a ball can touch: faces merged where they are flat, and only the edges that stick out.

An edge in a plane or in a valley is never touched but together with a face beside it, so dropping it changes no answer; and a
corner that sticks out is the end of an edge that does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim.cones import corner_cones, edge_normals, spreads
from sim.geometry import EDGE, Edges, Faces, Features, height
from sim.inside import distances, sides
from sim.sheet import Sheet, folds, merge, portions, sheet, straighten
from sim.tree import FACE, Tree, build

# With so few faces, looking at every one is faster than walking a tree; each edge, which takes a search, counts for so many.
FEW, EDGE_COUNTS = 32, 4

LOOKS = 2**22  # segments of outlines, half a second's work


@dataclass
class Reduction:
    """What became of the triangles of a surface, in numbers."""

    triangles: int
    degenerate: int = 0  # without an area, dropped
    duplicate: int = 0  # there already, dropped
    faces: int = 0
    edges: int = 0  # kept
    flat: int = 0  # sides of triangles in one plane: no edges
    inner: int = 0  # edges that stick out only to where no ball can be, dropped
    boundary: int = 0  # edges of one triangle
    nonmanifold: int = 0  # edges of more than two
    corners: int = 0  # ends of the edges kept
    closed: bool = False  # every edge has two triangles that wind alike
    side: str = "both"  # where balls can be: outside, inside or both
    room: bool = False  # one convex room of all surfaces: no outline of a face is kept


class Part(NamedTuple):
    """The features of one surface."""

    faces: Faces
    edges: Edges
    low: np.ndarray  # (n, 3) m, bounding boxes of the faces
    high: np.ndarray  # (n, 3) m


def features(shapes: Sequence, starts: np.ndarray, reduce: bool = True, edges: bool = True) -> tuple[Features, list[Reduction]]:
    """What balls that start at `starts` (k, 3) m can touch of the shapes' surfaces, and what was reduced, surface by surface.

    A ball never gets through a closed surface, so that only the side where all of them start counts; without starts both do.
    Without `reduce` every triangle stays a face and every edge an edge; without `edges` there are none.
    """
    starts = np.unique(np.asarray(starts, float).reshape(-1, 3), axis=0)
    built = [
        _plane(shape, number) if shape.unbounded else _surface(shape, number, starts, reduce, edges)
        for number, shape in enumerate(shapes)
    ]
    reductions = [reduction for _, reduction in built]
    order = sorted(range(len(shapes)), key=lambda number: not shapes[number].unbounded)
    faces, kept, low, high = zip(NOTHING, *(built[number][0] for number in order))
    everywhere = sum(shape.unbounded for shape in shapes)
    faces, kept = _join(faces), _join(kept)
    low, high = (np.concatenate([*boxes, kept.start])[everywhere:] for boxes in (low, high))
    del built  # of a million triangles each form takes a hundred megabytes or more
    tree = _tree(faces, kept, low, high, everywhere)
    del low, high
    # in the order of the tree, so that what is near in space is near in memory
    if len(tree.items):
        n, of_face = len(faces.axis), tree.items < len(faces.axis)
        face, edge = np.append(np.arange(everywhere), tree.items[of_face]), tree.items[~of_face] - n
        tree.items[of_face], tree.items[~of_face] = np.arange(everywhere, n), np.arange(n, n + len(edge))
        faces = _picked(faces, face)
        kept = Edges(*(array[edge] for array in kept))
    elif reduce and edges and len(kept.length) == 0 and _is_room(faces, starts):
        faces = faces._replace(first=np.zeros_like(faces.first), outline=NO_OUTLINE)
        for reduction in reductions:
            reduction.room = True
    return Features(faces, kept, tree, everywhere), reductions


def _is_room(faces: Faces, starts: np.ndarray) -> bool:
    """Whether faces without an edge that sticks out or is open bound one convex room, with all of `starts` (k, 3) m inside.

    No ball in it comes to a face's plane but on the face, so that their outlines tell nothing.
    """
    if len(starts) == 0 or faces.two_sided.any():
        return False
    of = np.repeat(np.arange(len(faces.surface)), np.diff(faces.first))
    row, axis, normal = np.arange(len(of)), faces.axis[of], faces.normal[of]
    u, v = (axis + 1) % 3, (axis + 2) % 3
    corner = np.empty((len(of), 3))
    corner[row, u], corner[row, v] = faces.outline[:, 0], faces.outline[:, 1]
    corner[row, axis] = 0.0
    across = normal * (faces.point[of] - corner)
    across[row, axis] = normal[row, axis] * faces.point[of, axis]
    corner[row, axis] = across.sum(axis=1) / normal[row, axis]
    slack = 8 * EDGE * np.abs(corner).max(initial=0.0)
    return all(
        (height(faces, np.full(len(x), f), x) > least).all()
        for f in range(len(faces.surface))
        for x, least in ((corner, -slack), (starts, 0.0))
    )


def _tree(faces: Faces, edges: Edges, low: np.ndarray, high: np.ndarray, everywhere: int) -> Tree:
    """The tree over boxes `low` to `high` (n, 3) m of faces, and of edges of which only the start is in them so far; none over
    few. The boxes are overwritten."""
    n = len(low) - len(edges.start)
    if everywhere + n + EDGE_COUNTS * len(edges.start) <= FEW:
        return build(low[:0], high[:0])
    for k in range(3):
        end = edges.start[:, k] + edges.length * edges.along[:, k]
        low[n:, k], high[n:, k] = np.minimum(low[n:, k], end), np.maximum(high[n:, k], end)
    # larger by what `covers` lets pass beside an outline, or the tree would open the cracks that it closes
    margin = np.zeros(len(low))
    for k in range(3):
        margin = np.maximum(margin, np.maximum(-low[:, k], high[:, k]))
    margin *= 8 * EDGE
    low -= margin[:, None]
    high += margin[:, None]
    del margin, end  # of a million triangles, tens of megabytes
    tree = build(low, high, _planes(faces, edges)[everywhere:])
    tree.items[:] += everywhere
    tree.ranks[:, :2] += everywhere
    return tree


def _planes(faces: Faces, edges: Edges) -> np.ndarray:
    """The planes (n + m, 5) of n faces and m edges, for the tree."""
    n = len(faces.axis)
    planes = np.empty((n + len(edges.length), 5), np.float32)
    planes[:n, :3], planes[n:, :3] = faces.normal, edges.normal
    planes[:n, 3] = np.sum(faces.normal * faces.point, axis=1)
    # of the normal without its rounding along the edge, which would count for more the farther off its start is
    slant = np.einsum("ij,ij->i", edges.normal, edges.along)
    planes[n:, 3] = np.einsum("ij,ij->i", edges.normal, edges.start) - slant * np.einsum("ij,ij->i", edges.along, edges.start)
    planes[:n, 4], planes[n:, 4] = FACE, edges.spread
    return planes


def _picked(faces: Faces, which: np.ndarray) -> Faces:
    """The faces `which` (k,), in this order."""
    count = np.diff(faces.first)[which]
    first = np.append(0, np.cumsum(count))
    row = np.arange(first[-1]) + np.repeat(faces.first[which] - first[:-1], count)
    return Faces(*(array[which] for array in faces[:-2]), first, faces.outline[row])


def _join(column):
    """Parts one after the other: arrays, or Faces or Edges of arrays."""
    if isinstance(column[0], np.ndarray):
        some = [part for part in column if len(part)] or column[:1]
        return np.ascontiguousarray(some[0] if len(some) == 1 else np.concatenate(some))
    joined = type(column[0])(*(_join(arrays) for arrays in zip(*column)))
    if isinstance(joined, Faces):
        rows = np.concatenate([np.diff(faces.first) for faces in column])
        joined = joined._replace(first=np.append(0, np.cumsum(rows)))
    return joined


def _plane(shape, number: int) -> tuple[Part, Reduction]:
    vertices, corners = shape.mesh()
    a, b, c = vertices[corners[0]]
    normal = np.cross(b - a, c - a)
    normal = (normal / np.linalg.norm(normal))[None]
    axis = np.abs(normal).argmax(axis=1)
    sides, numbers = np.array([shape.two_sided]), np.array([number])
    face = Faces(a[None], normal, sides, numbers, axis, np.zeros(2, int), NO_OUTLINE)
    reduction = Reduction(len(corners), faces=1, side="both" if shape.two_sided else "outside")
    return Part(face, NOTHING.edges, np.full((1, 3), -np.inf), np.full((1, 3), np.inf)), reduction


def _surface(shape, number: int, starts: np.ndarray, reduce: bool, edges: bool) -> tuple[Part, Reduction]:
    mesh = shape.mesh()
    whole, degenerate, duplicate = sheet(*mesh, distinct=reduce)
    alike, onward, flat, rise = folds(whole)
    side, closed = sides(whole, alike, starts if reduce else starts[:0])
    if not shape.two_sided:
        side = np.ones_like(side)
    one, other = whole.pairs.T

    inner = reduce & alike & (side[one // 3] * rise > whole.rounding)
    flat &= reduce & onward & (alike | shape.two_sided)
    while True:
        first, normal, face, sign = merge(whole, flat)
        level = reduce & onward & (face[one // 3] == face[other // 3])
        faces, low, high = _faces(whole, level, first, normal, face, sign, side)
        double = _double(whole, faces, face)
        if len(double) == 0:
            break
        flat &= ~np.isin(face[one // 3], double)
    inner &= ~level

    out = ~level & ~inner
    open_ = len(whole.border) + len(whole.crowded)
    kept = np.concatenate([whole.border, whole.crowded, one[out]])
    beyond = np.concatenate([np.full(len(whole.border), -1), np.full(len(whole.crowded), -2), face[other[out] // 3]])
    lines, corners = NOTHING.edges, 0
    if edges:
        wound = np.where(side[first] < 0, -normal.T, normal.T).T.astype(np.float32)[face] * sign.astype(np.float32)[:, None]
        strange = np.concatenate([kept[:open_], one[~alike]])
        outward = np.zeros((len(kept), 3), np.float32)
        known = alike[out] & (np.abs(rise[out]) > whole.rounding)
        outward[open_:][known] = edge_normals(wound[one[out][known] // 3], wound[other[out][known] // 3], rise[out][known] < 0)
        cones = corner_cones(whole, wound, strange)
        del wound, rise, known
        lines, corners = _edges(whole, kept, sign[kept // 3] < 0, face[kept // 3], beyond, outward, cones, number, reduce)
    reduction = Reduction(
        triangles=len(mesh.triangles),
        degenerate=degenerate,
        duplicate=duplicate,
        faces=len(first),
        edges=len(lines.length),
        flat=int(level.sum()),
        inner=int(inner.sum()),
        boundary=len(whole.border),
        nonmanifold=len(whole.crowded),
        corners=corners,
        closed=closed,
        side=_side(whole, side, closed),
    )
    return Part(faces._replace(surface=np.full(len(first), number)), lines, low, high), reduction


def _side(whole: Sheet, side: np.ndarray, closed: bool) -> str:
    """Where balls can be, in a word; `side` (m,) as `sides` tells it."""
    if not closed or len(side) == 0 or np.any(side != side[0]) or side[0] == 0:
        return "both"
    origin = whole.vertices[whole.corners[0, 0]]
    volume = np.sum((whole.vertices[whole.start[::3]] - origin) * whole.area)
    return "outside" if side[0] * volume > 0 else "inside"


def _faces(whole: Sheet, flat, first, normal, face, sign, side) -> tuple[Faces, np.ndarray, np.ndarray]:
    """The faces and their boxes."""
    n = len(first)
    outer = np.ones(len(whole.start), bool)
    outer[whole.pairs[flat]] = False
    merged = np.bincount(face, minlength=n) > 1
    alone, some = (np.flatnonzero(outer & np.repeat(which[face], 3)) for which in (~merged, merged))
    turned = sign[some // 3] < 0
    a, b = np.where(turned, whole.end[some], whole.start[some]), np.where(turned, whole.start[some], whole.end[some])
    line, end = straighten(whole, a, b, face[some // 3])

    of = np.concatenate([face[alone // 3], face[some[line] // 3]])
    begin, end = np.concatenate([whole.start[alone], a[line]]), np.concatenate([whole.end[alone], end])
    del alone, some, a, b, line
    order = np.argsort(of, kind="stable")
    axis = np.abs(normal).argmax(axis=1)
    outline = np.empty((len(of), 4))
    coordinates = whole.vertices.ravel()
    for rows in portions(len(of)):
        here = order[rows]
        from_, to, w = 3 * begin[here], 3 * end[here], axis[of[here]]
        u, v = (w + 1) % 3, (w + 2) % 3
        for column, place in enumerate((from_ + u, from_ + v, to + u, to + v)):
            outline[rows, column] = coordinates[place]

    # one-sided faces look to where the balls are
    toward = side[first]
    point = whole.vertices[whole.corners[first, 0]]
    normal[toward < 0] *= -1.0
    boxes = []
    for join, far in ((np.minimum, np.inf), (np.maximum, -np.inf)):
        box = np.full((n, 3), far)
        for k in range(3):
            join.at(box, face, whole.vertices[whole.corners[:, k]])
        boxes.append(box)
    rows = np.append(0, np.cumsum(np.bincount(of, minlength=n)))
    return Faces(point, normal, toward == 0, np.zeros(n, int), axis, rows, outline), *boxes


def _double(whole: Sheet, faces: Faces, face: np.ndarray) -> np.ndarray:
    """Faces whose triangles lie over each other: there they would be taken for holes. `face` (m,) is that of each triangle.

    It shows where a triangle's middle is not covered. Of a million triangles with long outlines some are looked at.
    """
    some = np.flatnonzero(np.bincount(face)[face] > 1)
    some = some[:: 1 + np.diff(faces.first)[face[some]].sum() // LOOKS]
    middle = sum(whole.vertices[whole.corners[some, k]] for k in range(3)) / 3
    return np.unique(face[some[distances(faces, face[some], middle) > 4 * whole.rounding]])


def _edges(whole: Sheet, kept, turned, here, beyond, normal, cones, number: int, reduce: bool) -> tuple[Edges, int]:
    """The edges of sides `kept` (k,) between faces `here` and `beyond`, made one where they go straight on, and the count of
    their distinct ends. `turned` tells which sides run against the winding of the face `here`, `normal` (k, 3) how they stick out."""
    a, b = whole.start[kept], whole.end[kept]
    if reduce:
        # run all edges between two faces the same way, along the outline of the one
        swap = (beyond > here) != turned
        a[swap], b[swap] = b[swap], a[swap]
        ends = np.bincount(a, minlength=len(whole.vertices)) + np.bincount(b, minlength=len(whole.vertices))
        # where no other edge meets it, an edge goes on between the same faces
        lone = np.flatnonzero((ends[a] == 2) | (ends[b] == 2))
        low, high = np.minimum(here[lone], beyond[lone]), np.maximum(here[lone], beyond[lone])
        group = np.unique(low * (len(whole.corners) + 2) + high, return_inverse=True)[1]
        line, end = straighten(whole, a[lone], b[lone], group)
        b[lone[line]] = end
        stays = np.ones(len(a), bool)
        stays[lone] = False
        stays[lone[line]] = True
        a, b, normal = a[stays], b[stays], normal[stays]
    start, way = whole.vertices[a], whole.vertices[b] - whole.vertices[a]
    length = np.linalg.norm(way, axis=1)
    way /= length[:, None]
    corner = np.zeros(len(whole.vertices), bool)
    corner[a] = corner[b] = True
    spread = spreads(normal, (a, b), cones)
    return Edges(start, way, length, np.full(len(a), number), normal, spread), int(corner.sum())


NO_OUTLINE = np.zeros((0, 4))
NO_ROWS, NO_NUMBER = np.zeros((0, 3)), np.zeros(0, np.int64)
NOTHING = Part(
    Faces(NO_ROWS, NO_ROWS, np.zeros(0, bool), NO_NUMBER, NO_NUMBER, np.zeros(1, np.int64), NO_OUTLINE),
    Edges(NO_ROWS, NO_ROWS, np.zeros(0), NO_NUMBER, NO_ROWS.astype(np.float32), np.zeros(0, np.float32)),
    NO_ROWS,
    NO_ROWS,
)
