"""How long a ball goes for sure before anything can happen to it: what spares a method with small steps most of its searches.

As long as no step changes the velocity faster than by `push` (m/s^2), nor its curve's, a distance that is g and falls at the
speed u now is at least g - u t - push t^2/2 after the time t, whatever the method and the fields.
"""

import numpy as np

from sim.curves.majorant import stride
from sim.curves.parabola import bend, bend_squared  # bound to the curve's own before they are compiled
from sim.forces import HIGH, LOW
from sim.packed import NORMAL, from_edge, height, vector
from sim.tree import distance
from sim.vector import dot, norm, sub

AHEAD, FARTHEST = 16.0, 64.0  # times the way of a step: how far around to look first, and at most; more takes longer than it spares
SPARE = 1.25  # of the push now: as much is allowed for
SURE = 1e-9  # share of a distance or time that is left to rounding


def push_of(curve, h, v, v1):
    """How fast (m/s^2) a step of h (s) from velocity v to v1 (m/s), and its curve, change the velocity."""
    return max(bend(curve, 0.0, h), norm(sub(v1, v)) / h)


def pushes_within(curve, h, v, v1, most):
    """Whether `push_of` is no more than `most` (m/s^2), but for rounding: of the squares, which take no root."""
    turn = sub(v1, v)
    return (bend_squared(curve, 0.0, h) <= most * most) & (dot(turn, turn) <= most * h * (most * h))


def free_time(features, search, x, v, push, radius, look):
    """A lower bound (s) of the time until a ball at x (m) with velocity v (m/s) touches anything; in a tree looked for no farther
    than `look` (m) around."""
    slack = radius + SURE * (abs(x[0]) + abs(x[1]) + abs(x[2]))
    if len(features.tree.items) == 0:
        return among(features, search.found, len(search.found), x, v, push, slack)
    gap = distance(features.tree, x, radius + look, search)
    soonest = stride(gap * (1.0 - SURE) - slack, -norm(v), push, 0.0) if gap > slack else 0.0
    return min(soonest * (1.0 - SURE), among(features, search.found, features.everywhere, x, v, push, slack))


def among(features, found, near, x, v, push, slack):
    """`free_time` from the first `near` features in `found`, which are to be farther than `slack` (m); of a face from its whole
    plane."""
    n, soonest, speed = len(features.faces), np.inf, norm(v)
    for c in range(near):
        i = found[c]
        if i < n:
            gap, rise = height(features.faces, i, x), dot(vector(features.faces, i, NORMAL), v)
            gap, rise = abs(gap), rise if gap > 0.0 else -rise
        else:
            gap, rise = norm(from_edge(features.edges, i - n, x)), -speed
        gap = gap * (1.0 - SURE) - slack
        # a bound like that, above zero now and then, is so in between, too: of most features no root is needed
        if gap > 0.0 and gap + soonest * (rise - 0.5 * push * soonest) > 0.0:
            continue
        soonest = min(soonest, stride(gap, rise, push, 0.0) if gap > 0.0 else 0.0)
    return soonest * (1.0 - SURE)


def region_free_time(x, v, push, forces):
    """A lower bound (s) of the time until a centre at x (m) with velocity v (m/s) crosses the face of any region."""
    soonest = np.inf
    for f in range(len(forces.selective)):
        for k in range(3):
            for limit in (LOW, HIGH):
                gap = x[k] - forces.selective[f, limit + k]
                if np.isfinite(gap):
                    rise = v[k] if gap > 0.0 else -v[k]
                    soonest = min(soonest, stride(abs(gap) * (1.0 - SURE), rise, push, 0.0))
    return soonest * (1.0 - SURE)
