"""A bounding volume hierarchy: which of many boxes does a segment of a line pass through?

The boxes are sorted along a Morton curve, each WIDE of them in a row make a group, each WIDE groups one on the level above, and
so on to a single one (Lauterbach et al. 2009, doi:10.1111/j.1467-8659.2009.01377.x; the boxes of a group side by side, so that
vector instructions test them at once, Wald et al. 2008, doi:10.1109/RT.2008.4634620).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

WIDE = 8  # boxes in a group
STACK = 512  # groups that may wait to be looked at: WIDE on each level of more levels than any tree has
TINY, HUGE = 1e-150, 1e150


class Tree(NamedTuple):
    box: np.ndarray  # (groups, 6, WIDE) float32 m, lower and upper corners, rounded outward; (inf, -inf) where there is none
    items: np.ndarray  # (boxes,) the boxes in the order of the lowest groups; none: no tree
    level: np.ndarray  # (levels + 1,) number of the first group on each level, the lowest first


def spread_bits(n: np.ndarray) -> np.ndarray:
    """The 21 low bits of n, two zeros between each and the next."""
    n = n.astype(np.uint64)
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        n = (n | (n << np.uint64(shift))) & np.uint64(mask)
    return n


def build(low: np.ndarray, high: np.ndarray) -> Tree:
    """The tree over bounded boxes with corners `low` and `high` (n, 3)."""
    n = len(low)
    if n == 0:
        return Tree(np.zeros((0, 6, WIDE), np.float32), np.zeros(0, np.int64), np.zeros(1, np.int64))
    origin = low.min(axis=0)
    span = max(np.max(high.max(axis=0) - origin), np.finfo(float).tiny)
    code = np.zeros(n, np.uint64)
    for k in range(3):
        middle = 0.5 * (low[:, k] - origin[k]) + 0.5 * (high[:, k] - origin[k])
        code |= spread_bits(middle / span * (2**21 - 1)) << np.uint64(k)
    order = np.argsort(code, kind="stable")

    sizes = [-(-n // WIDE)]
    while sizes[-1] > 1:
        sizes.append(-(-sizes[-1] // WIDE))
    level = np.append(0, np.cumsum(sizes))
    box = np.empty((level[-1], 6, WIDE), np.float32)
    for row, corners, empty, join in ((0, low, np.inf, np.minimum), (3, high, -np.inf, np.maximum)):
        for k in range(3):
            edge = outward(corners[order, k], empty)
            for begin, size in zip(level, sizes):
                padded = np.full(size * WIDE, empty, np.float32)
                padded[: len(edge)] = edge
                box[begin : begin + size, row + k] = padded.reshape(size, WIDE)
                edge = join.reduce(box[begin : begin + size, row + k], axis=1)
    return Tree(box, order, level)


def outward(values: np.ndarray, far: float) -> np.ndarray:
    """The nearest float32 that are no nearer to -far than the values."""
    with np.errstate(over="ignore"):
        rounded = values.astype(np.float32)
    wrong = rounded > values if far > 0 else rounded < values
    return np.where(wrong, np.nextafter(rounded, np.float32(-far)), rounded)


def along(tree, x, direction, reach, margin, bulge, found, stack, passed, most):
    """Write into `found` the items whose box x + s * direction, 0 <= s <= reach, may come within `margin` (m) of on each axis,
    with any part of the vector `bulge` (m) added; how many they are, or some number above `most` when they are more than that.

    `stack` and `passed` are room for 2 STACK and WIDE numbers. Without a tree `found` stays as it is, and all of it counts.
    """
    box, items, level = tree.box, tree.items, tree.level
    if len(items) == 0:
        return len(found)
    # near and far side of a box on each axis: a negative direction swaps them
    i0, i1, i2 = inverse(direction[0]), inverse(direction[1]), inverse(direction[2])
    n0, n1, n2 = 0 if i0 > 0.0 else 3, 1 if i1 > 0.0 else 4, 2 if i2 > 0.0 else 5
    f0, f1, f2 = 3 - n0, 5 - n1, 7 - n2
    # a box is met by the front `a` of what moves on an axis and left by its rear `b`
    a0, b0 = swell(x[0], margin, bulge[0], i0)
    a1, b1 = swell(x[1], margin, bulge[1], i1)
    a2, b2 = swell(x[2], margin, bulge[2], i2)
    stack[0], stack[1] = len(level) - 2, 0
    top, count = 1, 0
    while top > 0 and count <= most:
        top -= 1
        depth, group = stack[2 * top], stack[2 * top + 1]
        g = level[depth] + group
        for k in range(WIDE):
            # float: what follows is to be of double precision
            near = max((float(box[g, n0, k]) - a0) * i0, (float(box[g, n1, k]) - a1) * i1)
            near = max(near, max((float(box[g, n2, k]) - a2) * i2, 0.0))
            far = min((float(box[g, f0, k]) - b0) * i0, (float(box[g, f1, k]) - b1) * i1)
            far = min(far, min((float(box[g, f2, k]) - b2) * i2, reach))
            # a little slack for the rounding of the products: a box too many costs time, one too few an answer
            passed[k] = near <= far * (1.0 + 1e-9)
        for k in range(WIDE):
            if passed[k]:
                if depth == 0:
                    found[count] = items[WIDE * group + k]
                    count += 1
                else:
                    stack[2 * top], stack[2 * top + 1] = depth - 1, WIDE * group + k
                    top += 1
    return count


def swell(x, margin, bulge, heading):
    """The front and the rear of what moves along an axis at x, reaching `margin` both ways and `bulge` one way."""
    low, high = x - margin + min(bulge, 0.0), x + margin + max(bulge, 0.0)
    return (high, low) if heading > 0.0 else (low, high)


def inverse(a):
    """1/a, and where that is infinite a number so large that it does as well, and makes no NaN with 0."""
    return 1.0 / a if abs(a) > TINY else HUGE


def overlapping(tree: Tree, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which items may share a point with which of the boxes `low` to `high` (k, 3) m: pairs (query, item), a row each.

    All boxes go down the tree side by side. Without a tree there are none.
    """
    query = np.arange(len(low) if len(tree.items) else 0)
    group = np.zeros_like(query)
    for begin in tree.level[-2::-1]:
        meets = np.ones((len(query), WIDE), bool)
        for k in range(3):
            box = tree.box[begin + group]
            meets &= (box[:, k] <= high[query, k, None]) & (low[query, k, None] <= box[:, 3 + k])
        row, child = np.nonzero(meets)
        query, group = query[row], WIDE * group[row] + child
    return query, tree.items[group]
