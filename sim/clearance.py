"""How long a ball goes for sure before anything can happen to it: what spares a method with small steps most of its searches.

As long as no step changes the velocity faster than by `push` (m/s^2, of each axis), nor its curve's, a distance along n that is g
and falls at the speed u now is at least g - u t - |n| . push t^2/2 after the time t, whatever the method and the fields.
"""

import numpy as np

from sim.curves.majorant import stride
from sim.curves.parabola import bends  # bound to the curve's own before they are compiled
from sim.forces import HIGH, LOW
from sim.model import FASTEST
from sim.packed import NORMAL, axis_of, from_edge, height, segments, vector
from sim.vector import axpy, dot, larger, norm, scale, size, sub, within
from sim.walk import distance

AHEAD, FARTHEST = 16.0, 64.0  # times the way of a step: how far around to look first, and at most; more takes longer than it spares
SPARE, ASIDE = 1.25, 1 / 64  # of the push now, and of all of it along each axis: as much is allowed for
FEW = 32  # features that are looked at one by one, for what each tells, and not in a tree, which tells the distance alone
SURE = 1e-9  # share of a distance or time that is left to rounding


def push_of(curve, h, v, v1):
    """How fast (m/s^2, along each axis) a step of h (s) from velocity v to v1 (m/s), and its curve, change the velocity."""
    return larger(bends(curve, 0.0, h), scale(1.0 / h, size(sub(v1, v))))


def allowed(push):
    """A push (m/s^2, along each axis) that is not exceeded at once."""
    aside = ASIDE * norm(push)
    return axpy(SPARE, push, (aside, aside, aside))


def pushes_within(curve, h, v, v1, most):
    """Whether `push_of` is no more than `most` (m/s^2, along each axis), but for rounding."""
    return within(bends(curve, 0.0, h), most) & within(size(sub(v1, v)), scale(h, most))


def free_time(features, search, x, v, push, radius, look):
    """A lower bound (s) of the time until a ball at x (m) with velocity v (m/s) touches anything, or is faster than any may be;
    in a tree looked for no farther than `look` (m) around."""
    return min(touchless(features, search, x, v, push, radius, look), (FASTEST - norm(v)) / norm(push) * (1.0 - SURE))


def touchless(features, search, x, v, push, radius, look):
    """The time that no touch ends."""
    unsure = SURE * (radius + abs(x[0]) + abs(x[1]) + abs(x[2]))
    slack = radius + unsure
    count = len(features.faces) + len(features.edges)
    few = count <= FEW or len(features.tree.items) == 0
    soonest = among(features, count if few else features.everywhere, x, v, push, slack, unsure)
    if few:
        return soonest
    gap = distance(features.tree, x, radius + look, search)
    till = stride(gap * (1.0 - SURE) - slack, -norm(v), norm(push), 0.0) if gap > slack else 0.0
    return min(till * (1.0 - SURE), soonest)


def among(features, count, x, v, push, slack, unsure):
    """`free_time` from the first `count` features, which are to be farther than `slack` (m), known to half of `unsure` (m).

    One that a ball gets away from it does not touch before it turns, so that it may be in touch with an edge, to what is unsure,
    and anywhere beside a face, to whose plane it has to come down again; with its foot on the face.
    """
    n, soonest, speed, most = len(features.faces), np.inf, norm(v), norm(push)
    bounded = len(features.outline) > n
    for i in range(count):
        if i < n:
            normal = vector(features.faces, i, NORMAL)
            gap, rise, pull = height(features.faces, i, x), dot(normal, v), dot(size(normal), push)
            gap, rise, least = abs(gap), rise if gap > 0.0 else -rise, 2.0 * unsure - slack
        else:
            off = from_edge(features.edges, i - n, x)
            gap, pull, least = norm(off), most, -2.0 * unsure
            rise = dot(off, v) / gap if gap > unsure else -speed
        gap = gap * (1.0 - SURE) - slack
        till = 0.0
        if gap > 0.0 or (gap >= least and rise > 0.0):
            # a bound like that, above zero now and then, is so in between, too: of most features no root is needed
            if gap + soonest * (rise - 0.5 * pull * soonest) > 0.0:
                continue
            till = stride(gap, rise, pull, 0.0) if gap > 0.0 else back(gap, rise, pull)
        if bounded and i < n and till < soonest:
            till = max(till, off_face(features, i, x, v, push, unsure))
        if till <= 0.0:
            return 0.0
        soonest = min(soonest, till)
    return soonest * (1.0 - SURE)


def off_face(features, f, x, v, push, unsure):
    """The time (s) that the foot of a ball on the plane of face f is at least beside the bounds of its outline."""
    first, last = segments(features.faces, features.outline, f)
    if first == last:
        return 0.0
    low, high = (np.inf, np.inf), (-np.inf, -np.inf)
    for k in range(first, last):
        u, w = features.outline[k, 0], features.outline[k, 1]
        low, high = (min(low[0], u), min(low[1], w)), (max(high[0], u), max(high[1], w))
    normal = vector(features.faces, f, NORMAL)
    foot, way = axpy(-height(features.faces, f, x), normal, x), axpy(-dot(normal, v), normal, v)
    unsure += SURE * (abs(foot[0]) + abs(foot[1]) + abs(foot[2]))
    axis, till = int(axis_of(features.faces, features.outline, f)), 0.0
    for k in range(2):
        c = (axis + 1 + k) % 3
        over = foot[c] - high[k]
        gap, rise = (over, way[c]) if over > 0.0 else (low[k] - foot[c], -way[c])
        pull = push[c] + abs(normal[c]) * dot(size(normal), push)
        if gap > unsure:
            till = max(till, stride(gap - unsure, rise, pull, 0.0))
    return till


def back(gap, rise, pull):
    """The time (s) at which a distance that is `gap` (m), grows at the speed `rise` (m/s) and is pulled down by `pull` (m/s^2), has
    turned, and is no more above zero."""
    return (rise + np.sqrt(max(rise * rise + 2.0 * pull * gap, 0.0))) / pull if pull > 0.0 else np.inf


def region_free_time(x, v, push, forces):
    """A lower bound (s) of the time until a centre at x (m) with velocity v (m/s) crosses the face of any region."""
    soonest = np.inf
    for f in range(len(forces.selective)):
        for k in range(3):
            for limit in (LOW, HIGH):
                gap = x[k] - forces.selective[f, limit + k]
                if np.isfinite(gap):
                    rise = v[k] if gap > 0.0 else -v[k]
                    soonest = min(soonest, stride(abs(gap) * (1.0 - SURE), rise, push[k], 0.0))
    return soonest * (1.0 - SURE)
