"""Through a tree of boxes: what may a ball on a path touch, in what order, and how far is a place from all of it?"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.instructions import lowest_bit, no_later, prefetch
from sim.tree import FACE, HIGH, LOW, NORMAL, OFFSET, ROWS, SINE, WIDE

DEEP = 256  # groups that may wait to be looked at: WIDE on each level of more levels than any tree has
TINY, HUGE = 1e-30, 1e30
SINGLE = np.float32(8 * np.finfo(np.float32).eps)  # what is known of a place in single precision, as a share of its coordinates
EARLY, LATE = np.float32(1 - 1e-6), np.float32(1 + 1e-6)
NEVER, NONE, HALF, ONE = np.float32(-1.0), np.float32(0.0), np.float32(0.5), np.float32(1.0)


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
    ray = cast(path, reach, radius, margin, False, tree.extent)
    top = enter(tree, search, ray_size(ray))
    while top > 0:
        top, first = onward(tree, ray, reach, search, top, first)
    return first


def enter(tree, search, size):
    """Put the root on the stack of groups; returns how many are on it: none where `size`, of the numbers that boxes are held against,
    is not finite. A ball that has diverged would be at the empty places of groups, too, and be led out of the tree."""
    search.stack[0], search.stack[1], search.waits[0] = len(tree.level) - 2, 0, 0.0
    return 1 if size < np.inf else 0


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
            meet(tree.groups, tree.level[depth] + group, ray, reach, stay)
        if depth == 0:
            sieve(tree.groups, group, ray, reach, stay)
        mask = no_later(stay)
        while mask != 0:
            c = lowest_bit(mask)
            mask &= mask - 1
            if depth == 0:
                found[last], since[last], until[last] = rank(tree, group, c), stay[c], stay[WIDE + c]
                last += 1
            else:
                top = line_up(tree, search, bottom, top, depth - 1, WIDE * group + c, stay[c])
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
    for k in range(NORMAL):
        prefetch(tree.groups, row(tree.level[depth] + group, k))
    if depth == 0:
        for k in range(NORMAL, ROWS):
            prefetch(tree.groups, row(group, k))
        prefetch(tree.ranks, group)
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


def ray_size(ray):
    """The size of all numbers of the path, and of how far the ball may be off it."""
    x, v = ray.x, ray.v
    return abs(x[0]) + abs(x[1]) + abs(x[2]) + abs(v[0]) + abs(v[1]) + abs(v[2]) + abs(ray.k) + ray.slack


def inverse(v):
    """1/v (s/m), and never infinite, which makes NaN with 0."""
    return np.float32(1.0 / v if abs(v) > TINY else HUGE)


def later(t):
    """A time (s) in single precision that is not before t."""
    return np.float32(t) * LATE


def row(g, k):
    """Where row k of group g begins."""
    return (g * ROWS + k) * WIDE


def bounds(groups, g, k, c):
    """From where to where (m) box c of group g is along axis k."""
    return groups[row(g, LOW + k) + c], groups[row(g, HIGH + k) + c]


def normal(groups, g, axes, c):
    """The parts along three axes of the normal of item c of the lowest group g."""
    return groups[row(g, NORMAL + axes[0]) + c], groups[row(g, NORMAL + axes[1]) + c], groups[row(g, NORMAL + axes[2]) + c]


def meet(groups, g, ray, reach, stay):
    """Write into `stay` when the ray is at the boxes of group g; those it does not come to it leaves before it comes."""
    i, j, last = ray.axes
    beside = ray.radius + ray.slack
    x, v, k = ray.x[2], ray.v[2], ray.k
    if k == NONE:
        for c in range(len(stay) // 2):  # of no length known in advance and with one array written: so it becomes vector instructions
            near, far = within(bounds(groups, g, i, c), ray.x[0], ray.inverse[0], beside, NONE, reach)
            near, far = within(bounds(groups, g, j, c), ray.x[1], ray.inverse[1], beside, near, far)
            near, far = within(bounds(groups, g, last, c), x, ray.inverse[2], beside, near * EARLY, far * LATE)
            stay[c], stay[WIDE + c] = near * EARLY, far * LATE
        return
    turn, above = -v / k, beside + ray.fuzz
    peak = x + HALF * v * turn
    for c in range(len(stay) // 2):
        near, far = within(bounds(groups, g, i, c), ray.x[0], ray.inverse[0], beside, NONE, reach)
        near, far = within(bounds(groups, g, j, c), ray.x[1], ray.inverse[1], beside, near, far)
        near, far = near * EARLY, far * LATE
        a, b = x + near * (v + HALF * near * k), x + far * (v + HALF * far * k)
        least, most = extent_between(a, b, peak, (near < turn) & (turn < far))
        low, high = bounds(groups, g, last, c)
        misses = (least > high + above) | (most < low - above)
        stay[c], stay[WIDE + c] = near, NEVER if misses else far


def extent_between(a, b, peak, turns):
    """The least and the most of a quadratic between two times at which it is a and b, and `peak` in between if it `turns` there."""
    least, most = min(a, b), max(a, b)
    return min(least, peak) if turns else least, max(most, peak) if turns else most


def within(box, x, inverse, beside, near, far):
    """The part of the times `near` to `far` (s) at which a straight path is between the bounds (m) of a box, or `beside` (m) that."""
    low, high = box
    a, b = (low - beside - x) * inverse, (high + beside - x) * inverse
    a, b = (a, b) if inverse > NONE else (b, a)
    return a if a > near else near, b if b < far else far


def sieve(groups, g, ray, reach, stay):
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
    for c in range(len(stay) // 2):
        n, m, u = normal(groups, g, ray.axes, c)
        offset, sine = groups[row(g, OFFSET) + c], groups[row(g, SINE) + c]
        face = sine == FACE
        aside, beside = ray.radius * min(abs(n) + sine, ONE), ray.radius * min(abs(m) + sine, ONE)
        near, far = (stay[c], stay[WIDE + c]) if straight else (NONE, reach)
        near, far = within(bounds(groups, g, i, c), ray.x[0], ray.inverse[0], aside + ray.slack, near, far)
        near, far = within(bounds(groups, g, j, c), ray.x[1], ray.inverse[1], beside + ray.slack, near, far)
        near, far = near * EARLY, far * LATE
        a, b = x + near * (v + HALF * near * k), x + far * (v + HALF * far * k)
        least, most = extent_between(a, b, peak, (near < turn) & (turn < far))
        aloft = ray.radius * min(abs(u) + sine, ONE) + ray.slack + ray.fuzz
        low, high = bounds(groups, g, last, c)
        gone = (near > far) | (least > high + aloft) | (most < low - aloft)
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
    place, least = (np.float32(x[0]), np.float32(x[1]), np.float32(x[2])), np.float32(reach)
    top = enter(tree, search, abs(place[0]) + abs(place[1]) + abs(place[2]))
    while top > 0:
        top -= 1
        if waits[top] >= least:
            continue
        depth, group, bottom = stack[2 * top], stack[2 * top + 1], top
        away(tree.groups, tree.level[depth] + group, place, fuzz, stay)
        if depth == 0:
            off(tree.groups, group, place, fuzz, stay)
        for c in range(WIDE):
            if stay[c] < least:
                if depth == 0:
                    least = stay[c]
                else:
                    top = line_up(tree, search, bottom, top, depth - 1, WIDE * group + c, stay[c])
    return min(np.float64(least), reach)


def away(groups, g, x, fuzz, stay):
    """Write into `stay` how far x is from each of the boxes of group g at least."""
    for c in range(len(stay) // 2):
        u, v, w = outside(bounds(groups, g, 0, c), x[0]), outside(bounds(groups, g, 1, c), x[1]), outside(bounds(groups, g, 2, c), x[2])
        stay[c] = np.sqrt(u * u + v * v + w * w) * EARLY - fuzz


def outside(box, x):
    """How far (m) x is outside the bounds (m) of a box."""
    return max(max(box[0] - x, x - box[1]), NONE)


def off(groups, g, x, fuzz, stay):
    """The same for the items of the lowest group g, by their planes besides."""
    for c in range(len(stay) // 2):
        (n, m, u), offset = normal(groups, g, (0, 1, 2), c), groups[row(g, OFFSET) + c]
        height = n * x[0] + m * x[1] + u * x[2] - offset
        stay[c] = max(stay[c], abs(height) - fuzz - SINGLE * abs(offset))
