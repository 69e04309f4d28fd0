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


class Search(NamedTuple):
    """Room to search in, one place for each of `found`, `times` and `until` for each item."""

    found: np.ndarray  # items to look at
    times: np.ndarray  # s, from when; later, when one is touched
    until: np.ndarray  # s
    stack: np.ndarray  # (2 STACK,) level and number of the groups that wait to be looked at
    waits: np.ndarray  # (STACK,) s, when the path comes to them
    stay: np.ndarray  # (2 WIDE,) s, when the path comes to each box of a group, and when it leaves them


def search_room(n: int) -> Search:
    """For n items, all of them found."""
    stack = np.zeros(2 * STACK, np.int64), np.zeros(STACK), np.zeros(2 * WIDE)
    return Search(np.arange(n), np.zeros(n), np.full(n, np.inf), *stack)


def along(tree, path, reach, margin, search, first):
    """Find the items whose box the path may come within `margin` (m) of on each axis in the time `reach` (s), see `cast`.

    They are written into `search.found` from place `first` on; returns the place after them. Without a tree nothing is done,
    and all of `found` counts.
    """
    if len(tree.items) == 0:
        return len(search.found)
    ray, top = cast(path, reach, margin), enter(tree, search)
    while top > 0:
        top, first = onward(tree, ray, reach, search, top, first)
    return first


def enter(tree, search):
    """Put the root on the stack of groups; returns how many are on it."""
    search.stack[0], search.stack[1], search.waits[0] = len(tree.level) - 2, 0, 0.0
    return 1


def onward(tree, ray, reach, search, top, first):
    """Walk on to the next group with items that the ray may meet within `reach` (s), roughly in order of time.

    They are written into `search.found` from place `first` on, with the times between which it may be there. Returns how many
    groups are left on the stack, none at the end, and the place after the items.
    """
    box, items, level = tree.box, tree.items, tree.level
    found, since, until, stack, waits, stay = search
    while top > 0:
        top -= 1
        if waits[top] > reach:
            continue
        depth, group, bottom, last = stack[2 * top], stack[2 * top + 1], top, first
        meet(box, level[depth] + group, ray, reach, stay)
        for c in range(WIDE):
            near, far, child = stay[c], stay[WIDE + c], WIDE * group + c
            if near > far * (1.0 + 1e-9):  # a box too many costs time, one too few an answer
                continue
            if depth == 0:
                found[last], since[last], until[last] = items[child], near, far
                last += 1
                continue
            place = top
            while place > bottom and waits[place - 1] < near:  # the nearest is on top
                stack[2 * place], stack[2 * place + 1] = stack[2 * place - 2], stack[2 * place - 1]
                waits[place] = waits[place - 1]
                place -= 1
            stack[2 * place], stack[2 * place + 1], waits[place] = depth - 1, child, near
            top += 1
        if last > first:
            return top, last
    return 0, first


def cast(path, reach, margin):
    """What the path x + v t + k t^2/2 is to boxes that it may come within `margin` (m) of until `reach` (s): the axes, the
    curved one last, straight paths along each, and the curve. At most one part of k is not zero."""
    x, v, k = path
    last = 0 if k[0] != 0.0 else (1 if k[1] != 0.0 else 2)
    i, j = (last + 1) % 3, (last + 2) % 3
    slabs = slab(x[i], v[i], 0.0, margin), slab(x[j], v[j], 0.0, margin), slab(x[last], v[last], k[last], margin)
    return (i, j, last), slabs, arch(x[last], v[last], k[last], reach, margin)


def slab(x, v, k, margin):
    """How to tell the times at which x + v t is beside a box: 1/v, and the ends by which it comes and goes. A path that is
    not straight has 1/v = 0: it may be there always."""
    inverse = 1.0 / v if abs(v) > TINY else HUGE  # not infinite, which makes NaN with 0
    front, rear = (x + margin, x - margin) if inverse > 0.0 else (x - margin, x + margin)
    return inverse if k == 0.0 else 0.0, front, rear


def arch(x, v, k, reach, margin):
    """The path x + v t + k t^2/2, when and where it turns, and how near to a box counts, rounding included."""
    if k == 0.0:
        return x, v, k, -1.0, x, margin
    return x, v, k, -v / k, x - 0.5 * v * v / k, margin + 1e-14 * (abs(x) + reach * (abs(v) + reach * abs(k)))


def meet(box, g, ray, reach, stay):
    """Write into `stay` when the ray is at the boxes of group g; those it does not come to it leaves before it comes."""
    (i, j, last), slabs, bow = ray
    for c in range(box.shape[2]):  # of no length known in advance and with one array written: so it becomes vector instructions
        near, far = within(float(box[g, i, c]), float(box[g, i + 3, c]), slabs[0], 0.0, reach)
        near, far = within(float(box[g, j, c]), float(box[g, j + 3, c]), slabs[1], near, far)
        low, high = float(box[g, last, c]), float(box[g, last + 3, c])
        near, far = within(low, high, slabs[2], near, far)
        stay[c] = near
        stay[WIDE + c] = far if passes(low, high, bow, near, far) else -1.0


def within(low, high, slab, near, far):
    """The part of the times `near` to `far` (s) at which a straight path is between `low` and `high` (m)."""
    inverse, front, rear = slab
    entry, exit = (low, high) if inverse > 0.0 else (high, low)
    a, b = (entry - front) * inverse, (exit - rear) * inverse
    b = b if inverse != 0.0 else far
    return a if a > near else near, b if b < far else far


def passes(low, high, bow, near, far):
    """Whether a path comes between `low` and `high` (m) in the times from `near` to `far` (s); a straight one is known to."""
    x, v, k, turn, peak, margin = bow
    a, b = x + near * (v + 0.5 * near * k), x + far * (v + 0.5 * far * k)
    least, most = (a, b) if a < b else (b, a)
    turns = (near < turn) & (turn < far)
    least = peak if turns & (peak < least) else least
    most = peak if turns & (peak > most) else most
    return (k == 0.0) | ((least <= high + margin) & (most >= low - margin))


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
