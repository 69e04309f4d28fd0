"""A bounding volume hierarchy over what balls can touch. `sim.walk` finds in it what a path comes near.

The boxes are halved again and again, WIDE of them make a group, WIDE groups one on the level above, and so on to a single one; the
boxes of a group are side by side, so that vector instructions test them at once (Wald et al. 2008,
doi:10.1109/RT.2008.4634620).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.memory import aligned

WIDE = 16  # boxes in a group
PORTION = 2**12 * WIDE  # items of groups that are worked on at once

# Rows of a group: corners of its boxes in m, rounded outward, (inf, -inf) where there is none; on the two lowest levels also planes, each
# a unit normal, the offset (m) from the origin, and the sine of the largest angle between the normal and the direction of a touch. On
# the lowest level they are those in which the items lie. Of a face that is none, though it may have two sides; ANY where no angle is too
# large. On the next they are lids, under which all items of a lowest group are, and there the angle may be to either side of the normal.
LOW, HIGH, NORMAL, OFFSET, SINE, ROWS = 0, 3, 6, 9, 10, 11
FACE, ANY = np.float32(0.0), np.float32(2.0)
LIDS = 1  # the level whose groups have lids
ASKEW = 1e-3  # rad, by which angles under lids are taken for more: sines are of single precision, and none is that of a face


class Tree(NamedTuple):
    groups: np.ndarray  # (groups * ROWS * WIDE,) float32, the rows above of one group after the other
    items: np.ndarray  # (boxes,) the boxes in the order of the lowest groups, faces first in each; none: no tree
    ranks: np.ndarray  # (lowest groups, 3) int32, the rank of its first face, of its first other box, and how many are faces
    level: np.ndarray  # (levels + 1,) number of the first group on each level, the lowest first
    extent: float  # m, the largest coordinate of all boxes


def build(low: np.ndarray, high: np.ndarray, plane: np.ndarray | None = None) -> Tree:
    """The tree over bounded boxes with corners `low` and `high` (n, 3) m of flat items in the planes (n, 5): a unit normal, its offset
    (m) from the origin, and FACE, or for an edge the sine of the largest angle to the normal at which a ball touches it.

    Without `plane` a box is all that is known of an item. Its rank is its number in the order of the tree, all faces before all
    others: within a group ranks go up one by one, which spares searches to look into `items`.
    """
    n = len(low)
    if n == 0:
        return Tree(np.zeros(0, np.float32), np.zeros(0, np.int64), np.zeros((0, 3), np.int32), np.zeros(1, np.int64), 0.0)
    order = halved(low, high)
    is_face = plane[order, 4] == FACE if plane is not None else np.zeros(n, bool)
    order = order[np.lexsort((~is_face, np.arange(n) // WIDE))]
    faces = np.add.reduceat(is_face, np.arange(0, n, WIDE), dtype=np.int32)
    before = np.cumsum(faces) - faces
    ranks = np.stack([before, faces.sum() + WIDE * np.arange(len(faces)) - before, faces], axis=1).astype(np.int32)
    sizes = [-(-n // WIDE)]
    while sizes[-1] > 1:
        sizes.append(-(-sizes[-1] // WIDE))
    level = np.append(0, np.cumsum(sizes))
    groups = aligned((level[-1], ROWS, WIDE), np.float32)
    below = [outward(corners[order, k], far) for corners, far in ((low, np.inf), (high, -np.inf)) for k in range(3)]
    for begin, size in zip(level, sizes):
        here = slice(begin, begin + size)
        for k in range(6):
            join, empty = (np.minimum, np.inf) if k < HIGH else (np.maximum, -np.inf)
            groups[here, k] = grouped(below[k], size, empty)
            below[k] = join.reduce(groups[here, k], axis=1)
    groups[:, NORMAL:], groups[:, SINE] = 0.0, ANY
    if plane is not None:
        plane = plane[order]
        write_planes(groups[: sizes[0]], plane)
        if len(sizes) > 1:
            write_planes(groups[level[LIDS] : level[LIDS + 1]], lids(low[order], high[order], plane))
    return Tree(groups.ravel(), order, ranks, level, float(max(np.abs(low).max(), np.abs(high).max())))


def write_planes(groups: np.ndarray, planes: np.ndarray) -> None:
    """Write planes (k, 5) into the rows of the groups, WIDE to each."""
    for k in range(5):
        groups[:, NORMAL + k] = grouped(planes[:, k], len(groups), ANY if NORMAL + k == SINE else 0.0)


def lids(low: np.ndarray, high: np.ndarray, plane: np.ndarray) -> np.ndarray:
    """The lids (groups, 5) of lowest groups, whose items have boxes (n, 3) m and planes (n, 5)."""
    first = np.arange(0, len(plane), PORTION)
    return np.concatenate([lids_of(*(each[i : i + PORTION] for each in (low, high, plane))) for i in first])


def lids_of(low: np.ndarray, high: np.ndarray, plane: np.ndarray) -> np.ndarray:
    """The same of some groups: the mean of the normals, all turned to the side of the first, is square to the lid."""
    first, group = np.arange(0, len(plane), WIDE), np.arange(len(plane)) // WIDE
    normal, offset, sine = plane[:, :3].astype(float), plane[:, 3], plane[:, 4]
    side = np.where(np.einsum("ij,ij->i", normal, normal[first][group]) < 0.0, -1.0, 1.0)
    normal *= side[:, None]
    mean = np.add.reduceat(normal, first)
    size = np.linalg.norm(mean, axis=1)
    mean /= np.where(size > 0.0, size, 1.0)[:, None]
    cosine = np.clip(np.einsum("ij,ij->i", normal, mean[group]), -1.0, 1.0)
    angle = np.where(sine <= 1.0, np.arccos(cosine) + np.arcsin(np.minimum(sine, 1.0)) + ASKEW, np.pi)
    angle = np.maximum.reduceat(angle, first)
    # how far an item goes along the mean: along its normal as far as its plane is off, and across it as far as its box lets it
    across = mean[group] - cosine[:, None] * normal
    top = cosine * side * offset + np.einsum("ij,ij->i", across, 0.5 * low + 0.5 * high)
    top += np.einsum("ij,ij->i", np.abs(across), 0.5 * high - 0.5 * low)
    return np.column_stack([mean, np.maximum.reduceat(top, first), np.where(angle < 0.5 * np.pi, np.sin(angle), ANY)])


def halved(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """An order of the boxes (n, 3) m in which those of a group are near each other: all are halved by their middles along the axis in
    which these are farthest apart, and so are the halves, down to groups; a first half is full.

    The boxes are sorted along each axis once, and each half keeps that order.
    """
    n, size = len(low), WIDE
    while size < n:
        size *= 2
    middle = np.full((3, size), np.inf, np.float32)
    middle[:, :n] = (0.5 * low + 0.5 * high).T
    sorted_ = [np.argsort(along, kind="stable").astype(np.int32) for along in middle]
    beyond = np.empty(size, bool)
    while size > WIDE:
        parts = -(-n // size)
        rows = [each[: parts * size].reshape(parts, size) for each in sorted_]
        last = np.minimum(size, n - size * np.arange(parts)) - 1
        extent = [along[row[np.arange(parts), last]] - along[row[:, 0]] for along, row in zip(middle, rows)]
        axis = np.argmax(extent, axis=0)
        for k in range(3):
            mine = rows[k][axis == k]
            beyond[mine[:, : size // 2]], beyond[mine[:, size // 2 :]] = False, True
        for k in range(3):
            second = beyond[rows[k]]
            sorted_[k] = np.stack([rows[k][which].reshape(parts, -1) for which in (~second, second)], axis=1).ravel()
        size //= 2
    return sorted_[0][sorted_[0] < n].astype(np.int64)


def grouped(column: np.ndarray, size: int, empty: float) -> np.ndarray:
    """The column (n,) as `size` rows of WIDE, `empty` at the end."""
    padded = np.full(size * WIDE, empty, np.float32)
    padded[: len(column)] = column
    return padded.reshape(size, WIDE)


def outward(values: np.ndarray, far: float) -> np.ndarray:
    """The nearest float32 that are no nearer to -far than the values."""
    with np.errstate(over="ignore"):
        rounded = values.astype(np.float32)
    wrong = rounded > values if far > 0 else rounded < values
    return np.where(wrong, np.nextafter(rounded, np.float32(-far)), rounded)


def overlapping(tree: Tree, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which items may share a point with which of the boxes `low` to `high` (k, 3) m: pairs (query, item), a row each.

    All boxes go down the tree side by side. Without a tree there are none.
    """
    groups = tree.groups.reshape(-1, ROWS, WIDE)
    query = np.arange(len(low) if len(tree.items) else 0)
    group = np.zeros_like(query)
    for begin in tree.level[-2::-1]:
        meets, box = np.ones((len(query), WIDE), bool), groups[begin + group, :NORMAL]
        for k in range(3):
            meets &= (box[:, LOW + k] <= high[query, k, None]) & (low[query, k, None] <= box[:, HIGH + k])
        row, child = np.nonzero(meets)
        query, group = query[row], WIDE * group[row] + child
    return query, tree.items[group]
