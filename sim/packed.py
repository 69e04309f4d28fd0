"""What a ball can touch, as the kernels see it: one row of numbers for each face, each edge and each side of an outline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.geometry import EDGE, Features
from sim.memory import aligned
from sim.tree import Tree
from sim.vector import axpy, dot, norm, scale, sub
from sim.walk import along

# Columns of a face, one line of the processor's cache; and of the first row of its outline, of which the segments follow.
POINT, NORMAL, SIDES, OUTLINE, FACE_WIDTH = 0, 3, 6, 7, 8
AXIS, LAST, SURFACE, OUTLINE_WIDTH = 0, 1, 2, 4
# Columns of an edge.
START, ALONG, LENGTH, OF, EDGE_WIDTH = 0, 3, 6, 7, 8


class Packed(NamedTuple):
    """All that a ball can touch, numbered through: n faces, then m edges."""

    faces: np.ndarray  # (n, FACE_WIDTH) a point of its plane in m, its unit normal, 1 or 2 sides to touch, the first row of its
    # outline
    outline: np.ndarray  # (k, OUTLINE_WIDTH) of each face first the coordinate in which its normal is largest, the row after its
    # last one, and the number of its surface; then segments u0, v0, u1, v1 in m, in the two coordinates after AXIS in cyclic
    # order; none: it is unbounded
    edges: np.ndarray  # (m, EDGE_WIDTH) its start in m, its unit vector, its length in m, the number of its surface
    tree: Tree  # over the boxes of all that is bounded; empty where there is little
    everywhere: int  # so many faces, the first ones, are unbounded: in no tree, looked at always


def pack(features: Features) -> Packed:
    """The features, in their order."""
    f, e = features.faces, features.edges
    n, count = len(f.surface), np.diff(f.first)
    faces, edges = aligned((n, FACE_WIDTH)), aligned((len(e.surface), EDGE_WIDTH))
    outline, head = aligned((n + len(f.outline), OUTLINE_WIDTH)), f.first[:-1] + np.arange(n)
    faces[:, POINT : POINT + 3], faces[:, NORMAL : NORMAL + 3] = f.point, f.normal
    faces[:, SIDES], faces[:, OUTLINE] = 1.0 + f.two_sided, head
    outline[np.arange(len(f.outline)) + np.repeat(np.arange(n) + 1, count)] = f.outline
    outline[head] = np.stack([f.axis, head + 1 + count, f.surface, np.zeros(n)], axis=1)  # AXIS, LAST, SURFACE
    edges[:, START : START + 3], edges[:, ALONG : ALONG + 3] = e.start, e.along
    edges[:, LENGTH], edges[:, OF] = e.length, e.surface
    return Packed(faces, outline, edges, features.tree, features.everywhere)


def vector(rows, i, column):
    """The vector at `column` of row i."""
    return rows[i, column], rows[i, column + 1], rows[i, column + 2]


def height(faces, f, x):
    """Signed distance (m) of x to the plane of face f, positive on the side its normal points to."""
    return dot(vector(faces, f, NORMAL), sub(x, vector(faces, f, POINT)))


def segments(faces, outline, f):
    """The rows of the outline of face f that are segments: the first, and the one after the last."""
    head = int(faces[f, OUTLINE])
    return head + 1, int(outline[head, LAST])


def axis_of(faces, outline, f):
    """The coordinate in which the normal of face f is largest."""
    return outline[int(faces[f, OUTLINE]), AXIS]


def covers(faces, outline, f, x):
    """Whether face f covers the point x of its plane: x is inside its outline, or beside it by rounding only.

    Inside is where a ray along u crosses the outline an odd number of times. A segment holds its lower end, not its upper,
    so that a ray through a corner counts it once.
    """
    first, last = segments(faces, outline, f)
    if first == last:
        return True
    axis = axis_of(faces, outline, f)
    u, v = (x[1], x[2]) if axis == 0.0 else ((x[2], x[0]) if axis == 1.0 else (x[0], x[1]))
    near, inside = EDGE * (abs(x[0]) + abs(x[1]) + abs(x[2])), False
    for k in range(first, last):
        u0, v0, u1, v1 = outline[k, 0], outline[k, 1], outline[k, 2], outline[k, 3]
        du, dv = u1 - u0, v1 - v0
        side = du * (v - v0) - dv * (u - u0)  # the distance to the segment's line times its length; positive to its left
        if (v0 > v) != (v1 > v) and (side > 0.0) == (dv > 0.0):
            inside = not inside
        if side * side <= near * near * (du * du + dv * dv):
            if min(u0, u1) - near <= u <= max(u0, u1) + near and min(v0, v1) - near <= v <= max(v0, v1) + near:
                return True
    return inside


def ahead(features, x, direction, reach, search):
    """Write into `search.found` what x + s * direction, 0 <= s <= reach, may pass through; how many they are."""
    path = x, direction, (0.0, 0.0, 0.0)
    return along(features.tree, path, reach, 0.0, 0.0, search, features.everywhere)


def from_edge(edges, e, x):
    """The vector (m) to x from the nearest point of edge e."""
    along = vector(edges, e, ALONG)
    off = sub(x, vector(edges, e, START))
    return axpy(-min(max(dot(off, along), 0.0), edges[e, LENGTH]), along, off)


def across_edge(edges, e, x, v):
    """The part of v across edge e; all of it where the nearest point to x is a corner at its end."""
    axis = vector(edges, e, ALONG)
    along = dot(sub(x, vector(edges, e, START)), axis)
    return axpy(-dot(v, axis), axis, v) if 0.0 < along < edges[e, LENGTH] else v


def facing(features, item, x):
    """The unit normal at the touch of `item` with a ball at x, from the surface to the ball."""
    n = len(features.faces)
    if item >= n:
        off = from_edge(features.edges, item - n, x)
        return scale(1.0 / norm(off), off)
    normal = vector(features.faces, item, NORMAL)
    return normal if height(features.faces, item, x) >= 0.0 else scale(-1.0, normal)


def surface_of(features, item):
    """The number of the surface that a feature belongs to."""
    n = len(features.faces)
    if item >= n:
        return features.edges[item - n, OF]
    return features.outline[int(features.faces[item, OUTLINE]), SURFACE]
