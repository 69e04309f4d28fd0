"""When a ball meets a surface: the original's contact rule, and centres that pass through a facet.

`original` casts a ray from the centre along the velocity. A facet counts when that ray hits it, and is taken as moved
against the ray so that it stands one radius nearer along its normal: with the gap D of the centre to the facet's plane
and c the cosine of the ray to its normal, the hit is at s = (D - r)/c along the ray. A hit with s < 0 is no hit.
"""

import numpy as np

from sim.geometry import covers, height
from sim.tree import along
from sim.vector import axpy, dot, scale, sub

MISS = -1


def hit_distance(facets, f, x, heading, radius, reach):
    """Distance (m) along the unit `heading` at which the original's rule sees facet f within `reach` m, or -1.0."""
    gap = height(facets, f, x)
    n = facets.normal
    closing = -(heading[0] * n[f, 0] + heading[1] * n[f, 1] + heading[2] * n[f, 2])
    if facets.two_sided[f] and gap < 0.0:
        gap, closing = -gap, -closing
    if gap < 0.0 or closing <= 0.0:
        return -1.0
    s = (gap - radius) / closing
    if 0.0 <= s <= reach and covers(facets, f, axpy(gap / closing, heading, x)):
        return s
    return -1.0


def crosses(facets, f, x0, x1):
    """Whether a centre going straight from x0 to x1 passes through facet f: to its back, where it is one-sided."""
    before, after = height(facets, f, x0), height(facets, f, x1)
    if before >= 0.0 > after or (facets.two_sided[f] and before < 0.0 <= after):
        return covers(facets, f, axpy(before / (before - after), sub(x1, x0), x0))
    return False


def first_hit(facets, tree, x, v, radius, h, found):
    """The facet that the original's rule hits first within a step h (s), or MISS, and the distance to it (m).

    `found` is room for a facet's number each, holding 0, 1, 2, ... where there is no tree.
    """
    speed = np.sqrt(dot(v, v))
    best, nearest = MISS, speed * h
    if not 0.0 < speed < np.inf:
        return best, nearest
    heading = scale(1.0 / speed, v)
    # A shallow ray meets its facet far behind the hit, so the ray has no end.
    for k in range(along(tree, x, heading, np.inf, found)):
        s = hit_distance(facets, found[k], x, heading, radius, nearest)
        # the lowest number wins a tie, whatever the order of the tree
        if s >= 0.0 and (best == MISS or s < nearest or (s == nearest and found[k] < best)):
            best, nearest = found[k], s
    return best, nearest


def count_crossed(facets, tree, x0, x1, found):
    """How many facets a centre going straight from x0 to x1 passes through; `found` as above."""
    count = 0
    for k in range(along(tree, x0, sub(x1, x0), 1.0, found)):
        if crosses(facets, found[k], x0, x1):
            count += 1
    return count
