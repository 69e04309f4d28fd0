"""A bounding volume hierarchy: which of many boxes does a path pass through, and how far is a place from all of them?

The boxes are halved again and again, WIDE of them make a group, WIDE groups one on the level above, and so on to a single one; the
boxes of a group are side by side, so that vector instructions test them at once (Wald et al. 2008,
doi:10.1109/RT.2008.4634620).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.prefetch import prefetch

WIDE = 16  # boxes in a group
DEEP = 256  # groups that may wait to be looked at: WIDE on each level of more levels than any tree has
TINY, HUGE = 1e-30, 1e30
SINGLE = np.float32(8 * np.finfo(np.float32).eps)  # what is known of a place in single precision, as a share of its coordinates
EARLY, LATE = np.float32(1 - 1e-6), np.float32(1 + 1e-6)
NEVER, NONE, HALF, ONE = np.float32(-1.0), np.float32(0.0), np.float32(0.5), np.float32(1.0)

# The last row of planes: the sine of the largest angle between the normal and the direction of a touch. Of a face it is none, though
# that may have two sides; ANY where no angle is too large.
FACE, ANY = np.float32(0.0), np.float32(2.0)


class Tree(NamedTuple):
    box: np.ndarray  # (groups, 6, WIDE) float32 m, lower and upper corners, rounded outward; (inf, -inf) where there is none
    plane: np.ndarray  # (lowest groups, 5, WIDE) float32, of the items, as `build` gets them
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
        none = [np.zeros((0, k, WIDE), np.float32) for k in (6, 5)]
        return Tree(*none, np.zeros(0, np.int64), np.zeros((0, 3), np.int32), np.zeros(1, np.int64), 0.0)
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
    box = np.empty((level[-1], 6, WIDE), np.float32)
    below = [outward(corners[order, k], far) for corners, far in ((low, np.inf), (high, -np.inf)) for k in range(3)]
    for begin, size in zip(level, sizes):
        groups = slice(begin, begin + size)
        for k in range(6):
            join, empty = (np.minimum, np.inf) if k < 3 else (np.maximum, -np.inf)
            box[groups, k] = grouped(below[k], size, empty)
            below[k] = join.reduce(box[groups, k], axis=1)
    planes = np.zeros((sizes[0], 5, WIDE), np.float32)
    planes[:, 4] = ANY
    if plane is not None:
        for k in range(5):
            planes[:, k] = grouped(plane[order, k], sizes[0], 0.0)
    return Tree(box, planes, order, ranks, level, float(max(np.abs(low).max(), np.abs(high).max())))


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


class Search(NamedTuple):
    """Room to search in, one place for each of `found`, `times` and `until` for each item."""

    found: np.ndarray  # items to look at
    times: np.ndarray  # s, from when; later, when one is touched
    until: np.ndarray  # s
    stack: np.ndarray  # (2 DEEP,) level and number of the groups that wait to be looked at
    waits: np.ndarray  # (DEEP,) float32 s, when the path comes to them; for `distance` m, how far they are
    stay: np.ndarray  # (2 WIDE,) float32 s, when the path comes to each box of a group, and when it leaves them; or m


def search_room(n: int) -> Search:
    """For n items, all of them found."""
    stack = np.zeros(2 * DEEP, np.int64), np.zeros(DEEP, np.float32), np.zeros(2 * WIDE, np.float32)
    return Search(np.arange(n), np.zeros(n), np.full(n, np.inf), *stack)


def along(tree, path, reach, radius, margin, search, first):
    """Find the items that a ball of `radius` (m) no farther than `margin` (m) from the path may touch in the time `reach` (s), see
    `cast`.

    Their ranks are written into `search.found` from place `first` on; returns the place after them. Without a tree nothing is done,
    and all of `found` counts.
    """
    if len(tree.items) == 0:
        return len(search.found)
    ray, top = cast(path, reach, radius, margin, False, tree.extent), enter(tree, search)
    while top > 0:
        top, first = onward(tree, ray, reach, search, top, first)
    return first


def enter(tree, search):
    """Put the root on the stack of groups; returns how many are on it."""
    search.stack[0], search.stack[1], search.waits[0] = len(tree.level) - 2, 0, 0.0
    return 1


def onward(tree, ray, reach, search, top, first):
    """Walk on to the next group with items that the ray may meet within `reach` (s), roughly in order of time.

    Their ranks are written into `search.found` from place `first` on, with the times between which it may be there. Returns how many
    groups are left on the stack, none at the end, and the place after the items.
    """
    found, since, until, stack, waits, stay = search
    reach = later(reach)
    while top > 0:
        top -= 1
        if waits[top] > reach:
            continue
        depth, group, bottom, last = stack[2 * top], stack[2 * top + 1], top, first
        if depth > 0 or ray.k == NONE:
            meet(tree.box, tree.level[depth] + group, ray, reach, stay)
        if depth == 0:
            sieve(tree.box, tree.plane, group, ray, reach, stay)
        for c in range(WIDE):
            near, far, child = stay[c], stay[WIDE + c], WIDE * group + c
            if near > far:
                continue
            if depth == 0:
                found[last], since[last], until[last] = rank(tree, group, c), near, far
                last += 1
                continue
            top = line_up(tree, search, bottom, top, depth - 1, child, near)
        if last > first:
            return top, last
    return 0, first


def line_up(tree, search, bottom, top, depth, group, near):
    """Put a group on the stack from place `bottom` on, in order: the nearest is on top; returns how many are on it. It will be looked
    at soon, so it is on its way into the cache."""
    stack, waits, place = search.stack, search.waits, top
    while place > bottom and waits[place - 1] < near:
        stack[2 * place], stack[2 * place + 1] = stack[2 * place - 2], stack[2 * place - 1]
        waits[place] = waits[place - 1]
        place -= 1
    stack[2 * place], stack[2 * place + 1], waits[place] = depth, group, near
    for k in range(6):
        prefetch(tree.box[tree.level[depth] + group], k)
    if depth == 0:
        for k in range(5):
            prefetch(tree.plane[group], k)
    return top + 1


def rank(tree, group, c):
    """The rank of the box at place c of the lowest group `group`."""
    faces = tree.ranks[group, 2]
    return tree.ranks[group, 0] + c if c < faces else tree.ranks[group, 1] + c - faces


class Ray(NamedTuple):
    """What a path is to boxes and planes, in single precision: enough to tell what need not be looked at, if what it rounds is
    allowed for."""

    axes: tuple  # the curved one last
    x: tuple  # float32 m, where it starts, along each of these axes
    v: tuple  # float32 m/s
    k: float  # float32 m/s^2, along the last
    inverse: tuple  # float32 s/m, 1/v
    radius: float  # float32 m, of the ball
    margin: float  # float32 m, how far it may be off the path
    slack: float  # float32 m, the margin and how well places are known
    fuzz: float  # float32 m, how well heights are known
    climb: float  # float32 m: a ball that gets so much higher over a face does not touch it; infinite where it may be off the path


def cast(path, reach, radius, margin, slides, extent):
    """The Ray of a ball of `radius` (m) no farther than `margin` (m) from the path x + v t + k t^2/2 until `reach` (s). At most one
    part of k is not zero. A ball that `slides` comes onto surfaces from beside, at any height. No box has a coordinate larger
    than `extent` (m)."""
    x, v, k = path
    last = 0 if k[0] != 0.0 else (1 if k[1] != 0.0 else 2)
    i, j = (last + 1) % 3, (last + 2) % 3
    size = max(abs(x[0]), max(abs(x[1]), abs(x[2])))
    speed, pull = max(abs(v[0]), max(abs(v[1]), abs(v[2]))), abs(k[last])
    out = size + extent  # as far as it can be from all boxes for good
    if pull > 0.0:
        reach = min(reach, (speed + np.sqrt(speed * speed + 2.0 * pull * out)) / pull)
    else:
        reach = min(reach, out / speed) if speed > 0.0 else 0.0
    fuzz = SINGLE * (size + reach * (speed + 0.5 * reach * pull))
    return Ray(
        (i, j, last),
        (np.float32(x[i]), np.float32(x[j]), np.float32(x[last])),
        (np.float32(v[i]), np.float32(v[j]), np.float32(v[last])),
        np.float32(k[last]),
        (inverse(v[i]), inverse(v[j]), inverse(v[last])),
        np.float32(radius),
        np.float32(margin),
        np.float32(margin + SINGLE * size),
        np.float32(np.inf if slides else fuzz),
        np.float32(2.0 * fuzz if margin == 0.0 else np.inf),
    )


def inverse(v):
    """1/v (s/m), and never infinite, which makes NaN with 0."""
    return np.float32(1.0 / v if abs(v) > TINY else HUGE)


def later(t):
    """A time (s) in single precision that is not before t."""
    return np.float32(t) * LATE


def meet(box, g, ray, reach, stay):
    """Write into `stay` when the ray is at the boxes of group g; those it does not come to it leaves before it comes."""
    i, j, last = ray.axes
    beside = ray.radius + ray.slack
    x, v, k = ray.x[2], ray.v[2], ray.k
    if k == NONE:
        for c in range(box.shape[2]):  # of no length known in advance and with one array written: so it becomes vector instructions
            near, far = within(box[g, i, c], box[g, i + 3, c], ray.x[0], ray.inverse[0], beside, NONE, reach)
            near, far = within(box[g, j, c], box[g, j + 3, c], ray.x[1], ray.inverse[1], beside, near, far)
            near, far = within(box[g, last, c], box[g, last + 3, c], x, ray.inverse[2], beside, near * EARLY, far * LATE)
            stay[c], stay[WIDE + c] = near * EARLY, far * LATE
        return
    turn, above = -v / k, beside + ray.fuzz
    peak = x + HALF * v * turn
    for c in range(box.shape[2]):
        near, far = within(box[g, i, c], box[g, i + 3, c], ray.x[0], ray.inverse[0], beside, NONE, reach)
        near, far = within(box[g, j, c], box[g, j + 3, c], ray.x[1], ray.inverse[1], beside, near, far)
        near, far = near * EARLY, far * LATE
        a, b = x + near * (v + HALF * near * k), x + far * (v + HALF * far * k)
        least, most = extent_between(a, b, peak, (near < turn) & (turn < far))
        misses = (least > box[g, last + 3, c] + above) | (most < box[g, last, c] - above)
        stay[c], stay[WIDE + c] = near, NEVER if misses else far


def extent_between(a, b, peak, turns):
    """The least and the most of a quadratic between two times at which it is a and b, and `peak` in between if it `turns` there."""
    least, most = min(a, b), max(a, b)
    return min(least, peak) if turns else least, max(most, peak) if turns else most


def within(low, high, x, inverse, beside, near, far):
    """The part of the times `near` to `far` (s) at which a straight path is between `low` and `high` (m)."""
    a, b = (low - beside - x) * inverse, (high + beside - x) * inverse
    a, b = (a, b) if inverse > NONE else (b, a)
    return a if a > near else near, b if b < far else far


def sieve(box, plane, g, ray, reach, stay):
    """The same for the items of the lowest group g, without those of which it is plain that the ball does not touch them in the time
    that it is at their boxes: by its height over their planes. What `meet` tells of a straight ray is taken over.

    That is a quadratic of time, which stays between the least and the most of its control points. A ball touches a face where
    it comes down on it, so not where it only rises. And since it touches along the plane's normal, but for a certain angle, it
    is so high over an edge as the cosine of that tells, and no farther beside any box than the normal points that way.
    """
    i, j, last = ray.axes
    x, v, k = ray.x[2], ray.v[2], ray.k
    straight = k == NONE
    turn = NEVER if straight else -v / k
    peak = x + HALF * v * turn
    for c in range(plane.shape[2]):
        n, m, u, offset, sine = plane[g, i, c], plane[g, j, c], plane[g, last, c], plane[g, 3, c], plane[g, 4, c]
        face = sine == FACE
        aside, beside = ray.radius * min(abs(n) + sine, ONE), ray.radius * min(abs(m) + sine, ONE)
        near, far = (stay[c], stay[WIDE + c]) if straight else (NONE, reach)
        near, far = within(box[g, i, c], box[g, i + 3, c], ray.x[0], ray.inverse[0], aside + ray.slack, near, far)
        near, far = within(box[g, j, c], box[g, j + 3, c], ray.x[1], ray.inverse[1], beside + ray.slack, near, far)
        near, far = near * EARLY, far * LATE
        a, b = x + near * (v + HALF * near * k), x + far * (v + HALF * far * k)
        least, most = extent_between(a, b, peak, (near < turn) & (turn < far))
        aloft = ray.radius * min(abs(u) + sine, ONE) + ray.slack + ray.fuzz
        gone = (near > far) | (least > box[g, last + 3, c] + aloft) | (most < box[g, last, c] - aloft)
        span = far - near
        h = n * (ray.x[0] + near * ray.v[0]) + m * (ray.x[1] + near * ray.v[1]) + u * a - offset
        rise = HALF * span * (n * ray.v[0] + m * ray.v[1] + u * (v + near * k))
        middle = h + rise
        end = middle + rise + HALF * span * span * u * k
        least, most = min(min(h, end), middle), max(max(h, end), middle)
        fuzz = ray.fuzz + SINGLE * abs(offset)
        above = least > ray.radius + ray.margin + fuzz
        cosine = -ONE if face else ONE - sine * sine  # at most
        below = most < cosine * ray.radius - ray.margin - fuzz
        away = (h > fuzz) & (rise > ray.climb + fuzz) & (end > middle)
        back = (h < -fuzz) & (rise < -ray.climb - fuzz) & (end < middle)
        stay[c], stay[WIDE + c] = near, NEVER if gone | above | below | (face & (away | back)) else far


def distance(tree, x, reach, search):
    """A lower bound (m) of the distance from x to any item, and `reach` (m) if that is less."""
    stack, waits, stay = search.stack, search.waits, search.stay
    fuzz = np.float32(SINGLE * (max(abs(x[0]), max(abs(x[1]), abs(x[2]))) + reach))
    place, least, top = (np.float32(x[0]), np.float32(x[1]), np.float32(x[2])), np.float32(reach), enter(tree, search)
    while top > 0:
        top -= 1
        if waits[top] >= least:
            continue
        depth, group, bottom = stack[2 * top], stack[2 * top + 1], top
        away(tree.box, tree.level[depth] + group, place, fuzz, stay)
        if depth == 0:
            off(tree.plane, group, place, fuzz, stay)
        for c in range(WIDE):
            if stay[c] < least:
                if depth == 0:
                    least = stay[c]
                else:
                    top = line_up(tree, search, bottom, top, depth - 1, WIDE * group + c, stay[c])
    return min(np.float64(least), reach)


def away(box, g, x, fuzz, stay):
    """Write into `stay` how far x is from each of the boxes of group g at least."""
    for c in range(box.shape[2]):
        u = max(max(box[g, 0, c] - x[0], x[0] - box[g, 3, c]), NONE)
        v = max(max(box[g, 1, c] - x[1], x[1] - box[g, 4, c]), NONE)
        w = max(max(box[g, 2, c] - x[2], x[2] - box[g, 5, c]), NONE)
        stay[c] = np.sqrt(u * u + v * v + w * w) * EARLY - fuzz


def off(plane, g, x, fuzz, stay):
    """The same for the items of the lowest group g, by their planes besides."""
    for c in range(plane.shape[2]):
        height = plane[g, 0, c] * x[0] + plane[g, 1, c] * x[1] + plane[g, 2, c] * x[2] - plane[g, 3, c]
        stay[c] = max(stay[c], abs(height) - fuzz - SINGLE * abs(plane[g, 3, c]))


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
