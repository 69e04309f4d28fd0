"""Through a tree of boxes: what may a ball on a path touch, in what order, and how far is a place from all of it?"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.instructions import fma, lowest_bit, no_later, prefetch
from sim.tree import FACE, HIGH, LIDS, LOW, NORMAL, OFFSET, ROWS, SINE, WIDE

ABREAST = 8  # groups looked at together: the instructions of one wait for each other, those of several do not
DEEP = 256  # groups that may wait to be looked at: WIDE on each level of more levels than any tree has
TINY, HUGE = 1e-30, 1e30
SINGLE = np.float32(8 * np.finfo(np.float32).eps)  # what is known of a place in single precision, as a share of its coordinates
EARLY, LATE = np.float32(1 - 1e-6), np.float32(1 + 1e-6)
NEVER, NONE, HALF, ONE, INFINITE = np.float32(-1.0), np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(np.inf)


class Search(NamedTuple):
    """Room to search in, one place for each of `found`, `times` and `until` for each item."""

    found: np.ndarray  # items to look at
    times: np.ndarray  # s, from when; later, when one is touched
    until: np.ndarray  # s
    stack: np.ndarray  # (2 DEEP,) level and number of the groups that wait to be looked at
    waits: np.ndarray  # (DEEP,) float32 s, when the path comes to them; for `distance` m, how far they are
    stay: np.ndarray  # (ABREAST * 2 WIDE,) float32 s, when the path comes to each box of a group, and when it leaves them; or m
    abreast: np.ndarray  # (2 ABREAST,) level and number of the groups that are looked at


def search_room(n: int) -> Search:
    """For n items, all of them found."""
    stack, waits = np.zeros(2 * DEEP, np.int64), np.zeros(DEEP, np.float32)
    stay, abreast = np.zeros(ABREAST * 2 * WIDE, np.float32), np.zeros(2 * ABREAST, np.int64)
    return Search(np.arange(n), np.zeros(n), np.full(n, np.inf), stack, waits, stay, abreast)


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
    """Walk on to the next groups with items that the ray may meet within `reach` (s), roughly in order of time.

    Their ranks are written into `search.found` from place `first` on, with the times between which it may be there. Returns how many
    groups are left on the stack, none at the end, and the place after the items.
    """
    found, since, until, stack, waits, stay, abreast = search
    reach = later(reach)
    while top > 0:
        count = 0
        while top > 0 and count < ABREAST:
            top -= 1
            if waits[top] <= reach:
                abreast[2 * count], abreast[2 * count + 1] = stack[2 * top], stack[2 * top + 1]
                count += 1
        for j in range(count):
            depth, group = abreast[2 * j], tree.level[abreast[2 * j]] + abreast[2 * j + 1]
            if depth > LIDS or ray.k == NONE:
                meet(tree.groups, group, ray, reach, stay, 2 * WIDE * j)
            if depth <= LIDS:
                sieve(tree.groups, group, ray, reach, depth == LIDS, stay, 2 * WIDE * j)
        last = first
        for j in range(count - 1, -1, -1):  # what is behind the nearest comes to lie on top
            depth, group, near, bottom = abreast[2 * j], abreast[2 * j + 1], 2 * WIDE * j, top
            mask = no_later(stay, near)
            while mask != 0:
                c = lowest_bit(mask)
                mask &= mask - 1
                if depth == 0:
                    found[last], since[last], until[last] = rank(tree, group, c), stay[near + c], stay[near + WIDE + c]
                    last += 1
                else:
                    top = line_up(tree, search, bottom, top, depth - 1, WIDE * group + c, stay[near + c])
        if last > first:
            return top, last
    return 0, first


def line_up(tree, search, bottom, top, depth, group, near):
    """Put a group on the stack from place `bottom` on, in order: the nearest is on top; returns how many are on it. One of the lowest
    will be looked at soon, and is on its way into the cache."""
    stack, waits, place = search.stack, search.waits, top
    while place > bottom and waits[place - 1] < near:
        stack[2 * place], stack[2 * place + 1] = stack[2 * place - 2], stack[2 * place - 1]
        waits[place] = waits[place - 1]
        place -= 1
    stack[2 * place], stack[2 * place + 1], waits[place] = depth, group, near
    if depth == 0:
        for k in range(ROWS):
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


def wide(stay):
    """WIDE, but not known to the compiler: loops of no known length, with one array written, become vector instructions."""
    return len(stay) // (2 * ABREAST)


def meet(groups, g, ray, reach, stay, begin):
    """Write into `stay` from place `begin` on when the ray is at the boxes of group g; those it does not come to it leaves before it
    comes."""
    i, j, last = ray.axes
    (x, y, z), (_, _, vz), half = ray.x, ray.v, HALF * ray.k
    beside = ray.radius + ray.slack
    if ray.k == NONE:
        for c in range(wide(stay)):
            near, far = within(bounds(groups, g, i, c), x, beside, NONE, NONE, ray.inverse[0], NONE, reach)
            near, far = within(bounds(groups, g, j, c), y, beside, NONE, NONE, ray.inverse[1], near, far)
            near, far = within(bounds(groups, g, last, c), z, beside, NONE, NONE, ray.inverse[2], near, far)
            stay[begin + c], stay[begin + WIDE + c] = near, far
        return
    turn, above = -vz / ray.k, beside + ray.fuzz
    peak = at(turn, z, vz, half)
    for c in range(wide(stay)):
        near, far = within(bounds(groups, g, i, c), x, beside, NONE, NONE, ray.inverse[0], NONE, reach)
        near, far = within(bounds(groups, g, j, c), y, beside, NONE, NONE, ray.inverse[1], near, far)
        least, most = extent_between(at(near, z, vz, half), at(far, z, vz, half), peak, (near < turn) & (turn < far))
        low, high = bounds(groups, g, last, c)
        misses = (least > high + above) | (most < low - above)
        stay[begin + c], stay[begin + WIDE + c] = near, NEVER if misses else far


def at(t, x, v, half):
    """Where x + v t + half t^2 is."""
    return fma(t, fma(t, half, v), x)


def extent_between(a, b, peak, turns):
    """The least and the most of a quadratic between two times at which it is a and b, and `peak` in between if it `turns` there."""
    least, most = min(a, b), max(a, b)
    return min(least, peak) if turns else least, max(most, peak) if turns else most


def within(box, x, slack, before, beyond, inverse, near, far):
    """The part of the times `near` to `far` (s), and a little more, at which a straight path is between the bounds (m) of a box, or no
    more than `slack` and `before` (m) before the first, `slack` and `beyond` (m) beyond the second."""
    low, high = box[0] - (x + slack) - before, box[1] - (x - slack) + beyond
    first, last = (low, high) if inverse > NONE else (high, low)
    a, b = first * (inverse * EARLY), last * (inverse * LATE)
    return a if a > near else near, b if b < far else far


def reaches(n, sine, radius, front):
    """How far (m) before and beyond a box along an axis the ball may be that touches what is in it, under an angle with that `sine` to a
    normal with the part n along the axis: to either side of it, but of a face whose `front` it touches straight before it."""
    wide = radius * min(abs(n) + sine, ONE)
    return -radius * n if front else wide, radius * n if front else wide


def sieve(groups, g, ray, reach, lids, stay, begin):
    """The same for the boxes of a group with planes, or with `lids`, without those of which it is plain that the ball does not touch what
    is in them in the time that it is there: by its height over the planes. What `meet` tells of a straight ray is taken over.

    That is a quadratic of time, which stays between the least and the most of its control points. A ball touches a face where it comes
    down on it, so not where it only rises, nor where it comes to it lower than that and sinks; and from its front if it begins there and
    nothing pushes it back. Since it touches along the plane's normal, but for a certain angle, it is so high over an edge as the cosine
    of that tells. And it flies away from whatever it may touch if its velocity is nearer to the normal than a right angle less that one.
    """
    i, j, last = ray.axes
    (x, y, z), (vx, vy, vz), k, half = ray.x, ray.v, ray.k, HALF * ray.k
    radius, slack, straight = ray.radius, ray.slack, k == NONE
    turn = NEVER if straight else -vz / k
    peak, flat = at(turn, z, vz, half), np.sqrt(vx * vx + vy * vy)
    deep, up = (INFINITE, NONE) if lids else (NONE, INFINITE)  # nobody knows how far below a lid items go, nor which side of one is whose
    for c in range(wide(stay)):
        nx, ny, nz = normal(groups, g, ray.axes, c)
        offset, sine = groups[row(g, OFFSET) + c], groups[row(g, SINE) + c]
        face, cosine = sine == FACE, ONE - sine * sine  # at most
        fuzz = ray.fuzz + SINGLE * abs(offset)
        front = face & (nz * k <= NONE) & (fma(nz, z, fma(ny, y, fma(nx, x, -offset))) > radius + ray.climb + fuzz)

        near, far = (stay[begin + c], stay[begin + WIDE + c]) if straight else (NONE, reach)
        before, beyond = reaches(nx, sine, radius, front)
        near, far = within(bounds(groups, g, i, c), x, slack, before, beyond, ray.inverse[0], near, far)
        before, beyond = reaches(ny, sine, radius, front)
        near, far = within(bounds(groups, g, j, c), y, slack, before, beyond, ray.inverse[1], near, far)
        start = at(near, z, vz, half)
        least, most = extent_between(start, at(far, z, vz, half), peak, (near < turn) & (turn < far))
        before, beyond = reaches(nz, sine, radius, front)
        low, high = bounds(groups, g, last, c)
        beside = (near > far) | (least > high + (slack + ray.fuzz) + beyond) | (most < low - (slack + ray.fuzz) - before)

        # of the height the control points, and how it changes from the first to the second and from there to the third
        half_span, v0, v1 = HALF * (far - near), fma(near, k, vz), fma(far, k, vz)
        height = fma(nz, start, fma(ny, fma(near, vy, y), fma(nx, fma(near, vx, x), -offset)))
        rise = half_span * fma(nz, v0, fma(ny, vy, nx * vx))
        rise_on = fma(half_span * half_span, (nz + nz) * k, rise)
        middle, end = height + rise, height + rise + rise_on
        least, most = min(min(height, end), middle), max(max(height, end), middle)
        above = least > radius + ray.margin + fuzz
        below = most < (-radius if face else cosine * radius) - ray.margin - fuzz - deep
        aslant = half_span * sine
        leaves = (rise - aslant * (flat + abs(v0)) > ray.climb + fuzz) & (rise_on > aslant * (flat + abs(v1)))
        away = leaves & (height > fuzz - (NONE if face else cosine * radius + up))
        under = radius - ray.margin - fuzz if near > NONE else -fuzz
        back = face & (height < under) & (rise < -ray.climb - fuzz) & (rise_on < NONE)
        stay[begin + c], stay[begin + WIDE + c] = near, NEVER if beside | above | below | away | back else far


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
    for c in range(wide(stay)):
        u, v, w = outside(bounds(groups, g, 0, c), x[0]), outside(bounds(groups, g, 1, c), x[1]), outside(bounds(groups, g, 2, c), x[2])
        stay[c] = np.sqrt(u * u + v * v + w * w) * EARLY - fuzz


def outside(box, x):
    """How far (m) x is outside the bounds (m) of a box."""
    return max(max(box[0] - x, x - box[1]), NONE)


def off(groups, g, x, fuzz, stay):
    """The same for the items of the lowest group g, by their planes besides."""
    for c in range(wide(stay)):
        (n, m, u), offset = normal(groups, g, (0, 1, 2), c), groups[row(g, OFFSET) + c]
        height = n * x[0] + m * x[1] + u * x[2] - offset
        stay[c] = max(stay[c], abs(height) - fuzz - SINGLE * abs(offset))
