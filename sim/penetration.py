"""Centres that pass through a face, which a swept contact never lets happen: looked for apart from the contact itself."""

import numpy as np

from sim.curves.parabola import fall, piece, point  # bound to the curve's own before they are compiled
from sim.packed import NORMAL, POINT, SIDES, vector
from sim.touch import NONE, lands, plane_gap
from sim.vector import dot, sub
from sim.walk import along

WIDE = 64.0  # radii that the curve may be off its path: few faces are between the two


def count_passed(curve, features, search, radius, end, near):
    """How many faces the centre gets behind in the time `end` (s) along the curve, through them and not around them.

    The first `near` of what `search` has found are all that it comes near; with NONE that is found here.
    """
    if near == NONE and len(features.tree.items) > 0:
        return count_along(curve, features, search, radius, end)
    near = len(search.found) if near == NONE else near
    return count_among(curve, features.faces, features.outline, search.found, near, point(curve, end), end)


def count_along(curve, features, search, radius, end):
    """The same, found piece by piece."""
    always, x1 = features.everywhere, point(curve, end)
    count = count_among(curve, features.faces, features.outline, search.found, always, x1, end)
    s = 0.0
    while s < end:
        length, path, margin = piece(curve, s, end, WIDE * radius)
        s += length
        near = along(features.tree, path, length, 0.0, margin, search, always) - always
        # a face that two pieces come near is counted in the one that gets behind it
        count += count_among(curve, features.faces, features.outline, search.found[always:], near, point(curve, s), s)
    return count


def count_among(curve, faces, outline, found, near, x1, end):
    """How many of the first `near` features in `found` are faces that the centre goes through until `end` (s), at x1 (m)."""
    count, x = 0, point(curve, 0.0)
    for c in range(near):
        f = found[c]
        if f >= len(faces):
            continue
        normal, place = vector(faces, f, NORMAL), vector(faces, f, POINT)
        h1, two_sided = dot(normal, sub(x1, place)), faces[f, SIDES] > 1.0
        if h1 > 0.0 and not two_sided:
            continue
        h = dot(normal, sub(x, place))
        if h > 0.0 > h1 or (two_sided and h < 0.0 < h1):
            side = 1.0 if h > 0.0 else -1.0
            s = fall(plane_gap(curve, faces, f, side, 0.0), 0.0, end, False)
            if s < np.inf and lands(curve, faces, outline, f, s):
                count += 1
    return count
