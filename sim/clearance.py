"""How far a ball may go for sure before it can touch anything: what spares a method with small steps most of its searches."""

import numpy as np

from sim.curves.parabola import bend, slope  # bound to the curve's own before they are compiled
from sim.forces import HIGH, LOW
from sim.packed import from_edge, height
from sim.tree import along
from sim.vector import norm

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
