"""When a ball meets a surface: the original's contact rule, and centres that pass through a face.

`original` casts a ray from the centre along the velocity. A face counts when that ray hits it, and is taken as moved
against the ray so that it stands one radius nearer along its normal: with the gap D of the centre to the face's plane
and c the cosine of the ray to its normal, the hit is at s = (D - r)/c along the ray. A hit with s < 0 is no hit.
"""

import numpy as np

from sim.packed import NORMAL, SIDES, ahead, covers, height, surface_of, vector
from sim.vector import axpy, dot, scale, sub

MISS = -1


def hit_distance(faces, outline, f, x, heading, radius, reach):
    """Distance (m) along the unit `heading` at which the original's rule sees face f within `reach` m, or -1.0."""
    gap = height(faces, f, x)
    closing = -dot(heading, vector(faces, f, NORMAL))
    if faces[f, SIDES] > 1.0 and gap < 0.0:
        gap, closing = -gap, -closing
    if gap < 0.0 or closing <= 0.0:
        return -1.0
    s = (gap - radius) / closing
    if 0.0 <= s <= reach and covers(faces, outline, f, axpy(gap / closing, heading, x)):
        return s
    return -1.0


def crosses(faces, outline, f, x0, x1):
    """Whether a centre going straight from x0 to x1 passes through face f: to its back, where it is one-sided."""
    before, after = height(faces, f, x0), height(faces, f, x1)
    if before >= 0.0 > after or (faces[f, SIDES] > 1.0 and before < 0.0 <= after):
        return covers(faces, outline, f, axpy(before / (before - after), sub(x1, x0), x0))
    return False


def first_hit(features, x, v, radius, h, search):
    """The face that the original's rule hits first within a step h (s), or MISS, and the distance to it (m)."""
    faces, found = features.faces, search.found
    speed = np.sqrt(dot(v, v))
    best, nearest = MISS, speed * h
    if not 0.0 < speed < np.inf:
        return best, nearest
    heading = scale(1.0 / speed, v)
    # A shallow ray meets its face far behind the hit, so the ray has no end.
    for k in range(ahead(features, x, heading, np.inf, search)):
        f = found[k]
        if f >= len(faces):  # an edge, of which the rule knows nothing
            continue
        s = hit_distance(faces, features.outline, f, x, heading, radius, nearest)
        # the first surface wins a tie, and in it the lowest number, whatever the order of the tree
        if s >= 0.0 and (best == MISS or s < nearest or (surface_of(features, f), f) < (surface_of(features, best), best)):
            best, nearest = f, s
    return best, nearest


def count_crossed(features, x0, x1, search):
    """How many faces a centre going straight from x0 to x1 passes through."""
    faces, found, count = features.faces, search.found, 0
    for k in range(ahead(features, x0, sub(x1, x0), 1.0, search)):
        if found[k] < len(faces) and crosses(faces, features.outline, found[k], x0, x1):
            count += 1
    return count
