"""How far a ball may go for sure before it can touch anything: what spares a method with small steps most of its searches."""

import numpy as np

from sim.curves.parabola import bend, point, slope  # bound to the curve's own before they are compiled
from sim.forces import HIGH, LOW
from sim.packed import NORMAL, from_edge, height, vector
from sim.tree import along
from sim.vector import dot, norm

AHEAD = 16.0  # times the way of a step: how far around to look
SURE = 1e-9  # share of a distance that is left to rounding


def way(curve, end):
    """An upper bound (m) of how far the curve goes from its start within `end` (s): |v| t + max |x''| t^2/2."""
    return end * (norm(slope(curve, 0.0)) + 0.5 * end * bend(curve, 0.0, end))


def clearance(features, search, x, radius, far):
    """A lower bound (m), at most `far`, of the distance between a ball at x (m) and all surfaces."""
    always = features.everywhere
    if len(features.tree.items) == 0:
        return min(far, among(features, search.found, len(search.found), x, radius, far))
    nearest = among(features, search.found, always, x, radius, far)
    still = (0.0, 0.0, 0.0)
    count = along(features.tree, (x, still, still), 0.0, radius + far, 0.0, search, always)
    return min(nearest, among(features, search.found[always:], count - always, x, radius, far))


def region_clearance(x, forces):
    """A lower bound (m) of the distance of a centre at x (m) to all faces of regions, inf if there is none."""
    nearest = np.inf
    for f in range(len(forces.selective)):
        for k in range(3):
            for limit in (LOW, HIGH):
                distance = abs(x[k] - forces.selective[f, limit + k]) * (1.0 - SURE)
                nearest = min(nearest, distance)
    return nearest


def keeps_off(curve, end, features, found, radius):
    """Whether it is plain that a ball touches none of the features `found` on a curve of the length `end` (s): it comes no nearer to
    a face than its speed toward that and its largest acceleration bring it, and no nearer to an edge than it can go."""
    x, v, n = point(curve, 0.0), slope(curve, 0.0), len(features.faces)
    bow = 0.5 * bend(curve, 0.0, end) * end * end
    reach = end * norm(v) + bow
    rounded = radius + SURE * (abs(x[0]) + abs(x[1]) + abs(x[2]) + reach)
    for c in range(len(found)):
        i = found[c]
        if i < n:
            gap, rise = height(features.faces, i, x), end * dot(vector(features.faces, i, NORMAL), v)
            nearest = abs(gap) + min(rise if gap > 0.0 else -rise, 0.0) - bow
        else:
            nearest = norm(from_edge(features.edges, i - n, x)) - reach
        if not nearest > rounded:
            return False
    return True


def among(features, found, near, x, radius, far):
    """`clearance` from the first `near` features in `found`; from a face's whole plane."""
    n, nearest = len(features.faces), far
    for c in range(near):
        i = found[c]
        if i < n:
            distance = abs(height(features.faces, i, x))
        else:
            distance = norm(from_edge(features.edges, i - n, x))
        nearest = min(nearest, distance * (1.0 - SURE) - radius)
    return nearest - SURE * (abs(x[0]) + abs(x[1]) + abs(x[2]))
