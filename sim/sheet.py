"""Triangles as a sheet: which share an edge, which lie in one plane, which sides go on in a straight line.

A side is a triangle's: side 3 t + k runs from corner k of triangle t to the next. An edge is what sides share.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# How far vertices that were meant to lie in a plane may be off it, as a share of their coordinates: some roundings each.
ROUNDING = 16 * np.finfo(float).eps

PORTION = 2**17  # rows
INDEX = np.int32  # of vertices and sides: a file has room for so many, and in memory they are most of a sheet


class Sheet(NamedTuple):
    vertices: np.ndarray  # (n, 3) m, no two alike
    corners: np.ndarray  # (m, 3) vertices of each triangle
    area: np.ndarray  # (m, 3) m^2, twice the area along the normal
    rounding: float  # m
    start: np.ndarray  # (3 m,) vertex where each side starts
    end: np.ndarray  # (3 m,) vertex where it ends
    border: np.ndarray  # (b,) the sides that no other triangle has
    pairs: np.ndarray  # (p, 2) the two sides at an edge of two triangles
    crowded: np.ndarray  # (c,) a side of each edge of more than two


def sheet(vertices: np.ndarray, corners: np.ndarray, distinct: bool = True) -> tuple[Sheet, int, int]:
    """The sheet of triangles with vertices (n, 3) m and corners (m, 3), how many were without an area, and how many were there
    already; the latter stay unless `distinct`.

    A triangle has no area when it is no higher over its longest side than its vertices may be off by rounding.
    """
    used = np.zeros(len(vertices), bool)
    used[corners] = True
    rounding = ROUNDING * float(np.abs(vertices[used]).max(initial=0.0))
    vertices, corners = weld(vertices, corners)
    area, longest = areas(vertices, corners)
    solid = np.linalg.norm(area, axis=1) > rounding * longest
    kept = np.flatnonzero(solid)
    if distinct:
        kept = kept[firsts(np.sort(corners[kept], axis=1))]
    degenerate = int(np.sum(~solid))
    duplicate = len(corners) - degenerate - len(kept)
    corners, area = corners[kept], area[kept]
    start, end = corners.ravel(), corners[:, [1, 2, 0]].ravel()
    edge = np.minimum(start, end) * np.int64(len(vertices)) + np.maximum(start, end)
    order = np.argsort(edge, kind="stable")
    first = np.flatnonzero(np.diff(edge[order], prepend=-1))
    del edge
    order = order.astype(INDEX)
    sides = np.diff(first, append=len(order))
    two = first[sides == 2]
    pairs = np.stack([order[two], order[two + 1]], axis=1)
    whole = Sheet(
        vertices, corners, area, rounding, start, end, order[first[sides == 1]], pairs, order[first[sides > 2]]
    )
    return whole, degenerate, duplicate


def weld(vertices: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same triangles with vertices that are equal made one."""
    order, fresh = alike_rows(vertices)
    number = np.empty(len(order), INDEX)
    number[order] = np.cumsum(fresh) - 1
    return vertices[order[fresh]], number[corners]


def firsts(rows: np.ndarray) -> np.ndarray:
    """Numbers, rising, of the rows (m, 3) that are not there already."""
    order, fresh = alike_rows(rows)
    return np.sort(order[fresh])


def alike_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An order that brings rows (n, 3) that are equal together, the first of them first, and which of them are such firsts."""
    order = np.lexsort(rows.T)
    fresh = np.ones(len(order), bool)
    fresh[1:] = False
    for k in range(3):
        column = rows[order, k]
        fresh[1:] |= column[1:] != column[:-1]
    return order, fresh


def areas(vertices: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Twice the area of each triangle along its normal (m, 3) m^2, and its longest side (m,) m."""
    area, length = np.empty((len(corners), 3)), np.empty(len(corners))
    for some in portions(len(corners)):
        a, b, c = (vertices[corners[some, k]] for k in range(3))
        sides = np.stack([b - a, c - b, a - c])
        squared = np.sum(sides**2, axis=2)
        largest = squared.argmax(axis=0)
        longest = np.take_along_axis(sides, largest[None, :, None], axis=0)[0]
        squared = squared.max(axis=0)
        cross = np.cross(sides[2], sides[0])
        # of a sliver it is mostly rounding: made square to the longest side, its plane holds the vertices all the same
        along = np.sum(cross * longest, axis=1) / np.where(squared > 0, squared, 1.0)
        area[some], length[some] = cross - along[:, None] * longest, np.sqrt(squared)
    return area, length


def portions(n: int):
    """Slices of n rows, few enough at a time that what is computed from them takes little memory."""
    return (slice(begin, begin + PORTION) for begin in range(0, n, PORTION))


def components(n: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The parts into which links a[i] - b[i] join the numbers 0 to n - 1: for each number the smallest in its part."""
    root = np.arange(n)
    while len(a):
        low, high = np.minimum(root[a], root[b]), np.maximum(root[a], root[b])
        apart = low != high
        a, b = a[apart], b[apart]
        np.minimum.at(root, high[apart], low[apart])
        while not np.array_equal(root, up := root[root]):
            root = up
    return root


def heights(sheet: Sheet, normal: np.ndarray, triangle: np.ndarray, side: np.ndarray) -> np.ndarray:
    """How high (m) the corner opposite to each side (k,) is over the plane of each triangle (k,), with unit normals (m, 3)."""
    far, near = sheet.start[side - side % 3 + (side + 2) % 3], sheet.start[3 * triangle]
    return sum(normal[triangle, k] * (sheet.vertices[far, k] - sheet.vertices[near, k]) for k in range(3))


def folds(sheet: Sheet) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of each pair of sides: whether their triangles wind alike; whether the normals, of winding made alike, are less than a
    right angle apart; whether both are in one plane; and the height (m) of the farther far corner over the other's plane.

    The smaller triangle tells whether they are in one plane: its own, drawn out to the larger, is less sure.
    """
    normal = sheet.area / np.linalg.norm(sheet.area, axis=1, keepdims=True)
    one, other = sheet.pairs.T
    alike = sheet.start[one] == sheet.end[other]
    onward, flat, rise = np.empty(len(one), bool), np.empty(len(one), bool), np.empty(len(one))
    for some in portions(len(one)):
        p, q = one[some], other[some]
        first, second = heights(sheet, normal, p // 3, q), heights(sheet, normal, q // 3, p)
        rise[some] = np.where(np.abs(first) > np.abs(second), first, second)
        flat[some] = np.minimum(np.abs(first), np.abs(second)) <= sheet.rounding
        cosine = np.sum(normal[p // 3] * normal[q // 3], axis=1)
        onward[some] = np.where(alike[some], cosine, -cosine) > 0
    return alike, onward, flat, rise


def merge(sheet: Sheet, flat: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Triangles joined by the pairs of sides `flat` (p,) as faces: the first triangle (f,) of each and its unit normal (f, 3);
    the face of each triangle (m,) and the sign that its winding has in it. What is not flat as a whole stays apart."""
    a, b = (sheet.pairs[flat] // 3).T
    m = len(sheet.corners)
    root = components(m, a, b)
    while True:
        heads = np.flatnonzero(root == np.arange(m))
        face = np.empty(m, np.int64)
        face[heads] = np.arange(len(heads))
        face = face[root]
        normal = sheet.area[heads] / np.linalg.norm(sheet.area[heads], axis=1, keepdims=True)
        sign, off = np.ones(m), np.zeros(m, bool)
        some = np.flatnonzero(np.bincount(face)[face] > 1) if m else heads
        # the mean over the face, as what it differs by from the first: that sum is of small numbers, and rounds little
        share = np.sum(sheet.area[some] * normal[face[some]], axis=1)
        sign[some] = np.where(share < 0, -1.0, 1.0)
        total = np.bincount(face[some], np.abs(share), len(heads))
        for k in range(3):
            rest = sign[some] * sheet.area[some, k] - np.abs(share) * normal[face[some], k]
            change = np.bincount(face[some], rest, len(heads))
            normal[:, k] += np.divide(change, total, out=np.zeros(len(heads)), where=total > 0)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        for k in range(3):
            from_first = sheet.vertices[sheet.corners[some, k]] - sheet.vertices[sheet.corners[root[some], 0]]
            off[some] |= np.abs(np.sum(normal[face[some]] * from_first, axis=1)) > sheet.rounding
        if not off.any():
            return heads, normal, face, sign
        root = np.where(np.bincount(face, off)[face] > 0, np.arange(m), root)


def straighten(sheet: Sheet, a, b, group) -> tuple[np.ndarray, np.ndarray]:
    """Segments from vertices a to b (k,) that follow each other in a straight line, made one within each group (k,), where it
    has no other segments at their joint. Returns the first segment of each line and the vertex at which the line ends.
    """
    x, n = sheet.vertices, len(a)
    key = np.concatenate([b, a]) + np.tile(group, 2) * len(x)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    two = first[np.diff(first, append=2 * n) == 2]
    i, j = order[two], order[two + 1] - n
    joined = (i < n) & (j >= 0)  # one comes in, one goes out
    i, j = i[joined], j[joined]
    straight = beside(sheet, b[i], a[i], b[j])
    i, j = i[straight], j[straight]

    line, end, kept = components(n, i, j), b.copy(), np.ones(n, bool)
    head, tail = line.copy(), line.copy()
    goes, comes = np.zeros(n, bool), np.zeros(n, bool)
    goes[i], comes[j] = True, True
    head[line[goes & ~comes]], tail[line[comes & ~goes]] = np.flatnonzero(goes & ~comes), np.flatnonzero(comes & ~goes)
    head, tail = head[line[j]], tail[line[j]]
    # a gentle curve is straight at each joint but not as a whole
    bent = np.zeros(n, bool)
    bent[line[j[~beside(sheet, a[j], a[head], b[tail])]]] = True
    whole = ~bent[line[j]]
    end[head[whole]] = b[tail[whole]]
    kept[j[whole]] = False
    kept = np.flatnonzero(kept)
    return kept, end[kept]


def beside(sheet: Sheet, vertex, start, end) -> np.ndarray:
    """Whether vertices are on the segments from `start` to `end`, all (k,) vertices, but for rounding, and not at an end."""
    out = np.empty(len(vertex), bool)
    for some in portions(len(out)):
        near = sheet.vertices[start[some]]
        along, here = sheet.vertices[end[some]] - near, sheet.vertices[vertex[some]] - near
        squared, share = np.sum(along**2, axis=1), np.sum(here * along, axis=1)
        off = np.sum(np.cross(along, here) ** 2, axis=1)
        out[some] = (off <= sheet.rounding**2 * squared) & (share > 0) & (share < squared)
    return out
