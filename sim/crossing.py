"""Triangles of a surface that pass through each other: nothing that a ball minds, but seldom what was meant."""

from __future__ import annotations

import numpy as np

from sim.sheet import Sheet, sheet
from sim.tree import build, overlapping

MOST = 100_000  # triangles among which such pairs are looked for, some seconds' work
PAIRS = 2**22  # at a time, where every triangle meets every box


def crossings(vertices: np.ndarray, corners: np.ndarray) -> int | None:
    """How many pairs of the triangles with vertices (n, 3) m and corners (m, 3) pass through each other and share no vertex; None
    where there are too many triangles to look.

    Both have corners on either side of the other's plane, and the stretches that they cut out of the line common to both
    planes overlap (Moeller 1997, doi:10.1080/10867651.1997.10487472), all by more than rounding.
    """
    if len(corners) > MOST:
        return None
    whole, _, _ = sheet(vertices, corners)
    n = len(whole.corners)
    low, high = (join.reduce([whole.vertices[whole.corners[:, k]] for k in range(3)]) for join in (np.minimum, np.maximum))
    tree, total = build(low, high), 0
    size = max(1, PAIRS // max(1, n))
    for begin in range(0, n, size):
        some = slice(begin, begin + size)
        one, other = overlapping(tree, low[some], high[some])
        one += begin
        later = one < other
        total += _count(whole, one[later], other[later])
    return total


def _count(whole: Sheet, one: np.ndarray, other: np.ndarray) -> int:
    """How many of the triangles `one` (k,) pass through those `other` (k,)."""
    corners = whole.corners
    apart = (corners[one][:, :, None] != corners[other][:, None, :]).all(axis=(1, 2))
    one, other = one[apart], other[apart]
    height, apart = _heights(whole, one, other)
    one, other, height = one[apart], other[apart], height[apart]
    height1, apart = _heights(whole, other, one)
    one, other, height, height1 = one[apart], other[apart], height[apart], height1[apart]

    # along a line that is as long as the sine between the planes, what rounds by 1/sine rounds by 1
    line, origin = np.cross(_normals(whole, one), _normals(whole, other)), whole.vertices[corners[one, 0]]
    along, along1 = (np.sum((whole.vertices[corners[t]] - origin[:, None]) * line[:, None], axis=2) for t in (one, other))
    (first, last), (first1, last1) = _stretch(along, height), _stretch(along1, height1)
    return int(np.sum(np.minimum(last, last1) - np.maximum(first, first1) > whole.rounding))


def _normals(whole: Sheet, t: np.ndarray) -> np.ndarray:
    return whole.area[t] / np.linalg.norm(whole.area[t], axis=1, keepdims=True)


def _heights(whole: Sheet, one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The heights (k, 3) m of the corners of triangles `one` (k,) over the planes of `other`, zero for rounding, and which
    triangles have corners on either side."""
    from_plane = whole.vertices[whole.corners[one]] - whole.vertices[whole.corners[other, 0]][:, None]
    height = np.sum(from_plane * _normals(whole, other)[:, None], axis=2)
    height[np.abs(height) <= whole.rounding] = 0.0
    return height, (height.min(axis=1) < 0) & (height.max(axis=1) > 0)


def _stretch(along: np.ndarray, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From where to where triangles with corners at (along, height), (k, 3) each, have the height 0."""
    ends = []
    for i, j in ((0, 1), (1, 2), (2, 0)):
        p, q, h, g = along[:, i], along[:, j], height[:, i], height[:, j]
        passes = h * g < 0
        ends.append(np.where(passes, p + (q - p) * h / np.where(passes, h - g, 1.0), np.nan))
        ends.append(np.where(h == 0, p, np.nan))
    return np.nanmin(ends, axis=0), np.nanmax(ends, axis=0)
