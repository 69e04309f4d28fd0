"""A bounding volume hierarchy: which of many boxes does a segment of a line pass through?

The boxes are sorted along a Morton curve and a complete binary tree is laid over them, its nodes numbered as in a heap:
the children of node i are 2i + 1 and 2i + 2 (Lauterbach et al. 2009, doi:10.1111/j.1467-8659.2009.01377.x).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

LEAF = 4  # boxes in a leaf
DEPTH = 64  # more than any tree that fits in memory is deep


class Tree(NamedTuple):
    low: np.ndarray  # (nodes, 3) m, lower corners; no nodes: no tree
    high: np.ndarray  # (nodes, 3) m, upper corners
    items: np.ndarray  # (leaves * LEAF,) the boxes in the order of the leaves, -1 where a leaf is not full


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
    """The tree over boxes with corners `low` and `high` (n, 3). Unbounded boxes are allowed."""
    n = len(low)
    if n == 0:
        return Tree(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64))
    bounded = np.isfinite(low).all(axis=1)
    centre = np.where(bounded[:, None], 0.5 * (np.where(bounded[:, None], low, 0) + np.where(bounded[:, None], high, 0)), 0)
    origin = centre.min(axis=0)
    span = max(np.max(centre.max(axis=0) - origin), np.finfo(float).tiny)
    x, y, z = (spread_bits(((centre[:, k] - origin[k]) / span * (2**21 - 1)).astype(np.uint64)) for k in range(3))
    order = np.argsort(x | y << np.uint64(1) | z << np.uint64(2), kind="stable")

    leaves = 1 << int(np.ceil(np.log2(np.ceil(n / LEAF))))
    items = np.full(leaves * LEAF, -1, np.int64)
    items[:n] = order
    levels = []
    for corners, empty, join in ((low, np.inf, np.min), (high, -np.inf, np.max)):
        padded = np.full((leaves * LEAF, 3), empty)
        padded[:n] = corners[order]
        level = [join(padded.reshape(leaves, LEAF, 3), axis=1)]
        while len(level[-1]) > 1:
            level.append(join(level[-1].reshape(-1, 2, 3), axis=1))
        levels.append(np.concatenate(level[::-1]))
    return Tree(levels[0], levels[1], items)


def passes(tree, node, x, direction, reach):
    """Whether x + s * direction, 0 <= s <= reach, passes through the box of `node`: the slab test, closed."""
    if tree.low[node, 0] > tree.high[node, 0]:  # holds no box; the division would not tell
        return False
    near, far = 0.0, reach
    for axis in range(3):
        low, high = tree.low[node, axis], tree.high[node, axis]
        if direction[axis] == 0.0:
            if not (low <= x[axis] <= high):
                return False
        else:
            a, b = (low - x[axis]) / direction[axis], (high - x[axis]) / direction[axis]
            near, far = max(near, min(a, b)), min(far, max(a, b))
    # a little slack for the rounding of the divisions: a box too many costs time, one too few an answer
    return near <= far + 1e-9 * (abs(far) + 1.0)


def along(tree, x, direction, reach, found):
    """Write into `found` the items whose box x + s * direction, 0 <= s <= reach, may pass through; how many they are.

    Without a tree `found` stays as it is, and all of it counts.
    """
    if len(tree.items) == 0:
        return len(found)
    stack = np.empty(DEPTH, np.int64)
    stack[0], top, count = 0, 1, 0
    first_leaf = len(tree.items) // LEAF - 1
    while top > 0:
        top -= 1
        node = stack[top]
        if not passes(tree, node, x, direction, reach):
            continue
        if node < first_leaf:
            stack[top], stack[top + 1], top = 2 * node + 2, 2 * node + 1, top + 2
            continue
        for k in range((node - first_leaf) * LEAF, (node - first_leaf + 1) * LEAF):
            if tree.items[k] >= 0:
                found[count] = tree.items[k]
                count += 1
    return count
