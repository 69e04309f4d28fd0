"""What a ball can hit: flat facets, gathered from the scene's surfaces into arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.tree import Tree, build

#: Outlines of a facet, the part of its plane p + u e1 + v e2 that it covers.
PLANE, TRIANGLE, PARALLELOGRAM = 0, 1, 2

# With so few facets, looking at every one is faster than walking a tree.
FEW = 32

# How far past its outline a facet still counts, as a share of its edges: neighbours share an edge without a crack.
EDGE = 1e-12


class Facets(NamedTuple):
    """n flat pieces of surface; u = across[0].(x - point) and v = across[1].(x - point) are coordinates along its edges."""

    point: np.ndarray  # (n, 3) m, where u = v = 0
    normal: np.ndarray  # (n, 3) unit
    across: np.ndarray  # (n, 2, 3) 1/m
    outline: np.ndarray  # (n,) PLANE, TRIANGLE or PARALLELOGRAM
    two_sided: np.ndarray  # (n,) bool; a one-sided facet is hit from the side its normal points to
    surface: np.ndarray  # (n,) index of the surface it belongs to
    low: np.ndarray  # (n, 3) m, bounding box
    high: np.ndarray  # (n, 3) m


def facets(point, e1, e2, outline: int, two_sided: bool) -> Facets:
    """Facets with a corner at `point` (n, 3) m and edges `e1`, `e2` (n, 3) m; the normal is along e1 x e2."""
    point, e1, e2 = (np.atleast_2d(np.asarray(a, float)) for a in (point, e1, e2))
    area = np.cross(e1, e2)
    squared = np.sum(area**2, axis=1, keepdims=True)
    across = np.stack([np.cross(e2, area) / squared, np.cross(area, e1) / squared], axis=1)
    corners = [point, point + e1, point + e2] + ([point + e1 + e2] if outline == PARALLELOGRAM else [])
    n = len(point)
    if outline == PLANE:
        low, high = np.full((n, 3), -np.inf), np.full((n, 3), np.inf)
    else:
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        # larger by what `covers` lets pass beside the outline, or the tree would open the cracks that it closes
        margin = 8 * EDGE * np.maximum(np.abs(low), np.abs(high)).max(axis=1, keepdims=True)
        low, high = low - margin, high + margin
    return Facets(
        point, area / np.sqrt(squared), across, np.full(n, outline), np.full(n, two_sided), np.zeros(n, int), low, high
    )


def triangles(vertices: np.ndarray, corners: np.ndarray, two_sided: bool = True) -> Facets:
    """Facets of triangles: vertices (n, 3) m, corners (m, 3) indices; those without an area are left out."""
    a, b, c = (vertices[corners[:, k]] for k in range(3))
    solid = np.any(np.cross(b - a, c - a) != 0, axis=1)
    return facets(a[solid], (b - a)[solid], (c - a)[solid], TRIANGLE, two_sided)


def gather(surfaces: list[Facets]) -> tuple[Facets, Tree]:
    """All facets of a scene in one, `surface` numbered in order, and the tree over them (empty where they are few)."""
    numbered = [each._replace(surface=np.full(len(each.point), i)) for i, each in enumerate(surfaces)]
    if not numbered:
        numbered = [facets(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), TRIANGLE, True)]
    joined = Facets(*(np.ascontiguousarray(np.concatenate(column)) for column in zip(*numbered)))
    few = len(joined.point) <= FEW
    return joined, build(joined.low[:0], joined.high[:0]) if few else build(joined.low, joined.high)


def height(facets, f, x):
    """Signed distance (m) of x to the plane of facet f, positive on the side its normal points to."""
    n, p = facets.normal, facets.point
    return n[f, 0] * (x[0] - p[f, 0]) + n[f, 1] * (x[1] - p[f, 1]) + n[f, 2] * (x[2] - p[f, 2])


def covers(facets, f, x):
    """Whether facet f covers the point x of its plane."""
    if facets.outline[f] == PLANE:
        return True
    p, d = facets.point, facets.across
    x0, x1, x2 = x[0] - p[f, 0], x[1] - p[f, 1], x[2] - p[f, 2]
    u = d[f, 0, 0] * x0 + d[f, 0, 1] * x1 + d[f, 0, 2] * x2
    v = d[f, 1, 0] * x0 + d[f, 1, 1] * x1 + d[f, 1, 2] * x2
    if u < -EDGE or v < -EDGE:
        return False
    if facets.outline[f] == TRIANGLE:
        return u + v <= 1 + EDGE
    return u <= 1 + EDGE and v <= 1 + EDGE
