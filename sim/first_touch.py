"""First touch: which of all features a ball moving on a curve touches first, and when.

A walk through the tree finds what the ball comes near, roughly in order of time, and `sim.touch` tells when each is touched.
"""

from __future__ import annotations

import numpy as np

from sim.curves.parabola import piece  # bound to the curve's own before it is compiled
from sim.instructions import prefetch
from sim.touch import NONE, SLACK, earliest
from sim.walk import cast, enter, onward, ray_size

ANEW = -1  # of a walk: as yet nothing is on the stack, not even the root
OFF = 2.0  # radii that a piece of the curve may be off the path looked along


def first_touch(curve, features, search, radius, end, contacts, left):
    """The first feature touched within `end` (s), and when: (item, s), or (NONE, inf).

    Of those touched at the same time a face comes before an edge, then the lowest number. What the ball lies on, by its
    `contacts`, is not looked at, and the face `left`, which it has just slid off, is not touched at once.

    Third comes how many of `search.found` are all that the ball comes near until then, NONE where they are not kept; last along how
    many chords of the curve was looked.
    """
    return finish_search(end, ANEW, features.everywhere, curve, features, search, radius, end, contacts, left)


def begin_search(curve, features, search, radius, end, contacts):
    """Look along the curve up to `end` (s) for the first features that the ball may touch, see `search_on`."""
    if len(features.tree.items) == 0:
        return end, 0, len(search.found)
    return search_on(ANEW, features.everywhere, curve, features, search, radius, 0.0, end, end, contacts)


def search_on(top, first, curve, features, search, radius, s, end, best, contacts):
    """Walk along a piece of the curve from s on, up to `end` (s), ANEW or with `top` groups left on the stack, to the next features that
    the ball may touch before `best` (s): they come to lie in `search.found` from place `first` on, and are on their way into the cache.

    Returns the length (s) of the piece, how many groups are left on the stack, and the place after those found.
    """
    length, path, margin = piece(curve, s, end, OFF * radius)
    ray = cast(path, length, radius * (1.0 + SLACK), margin * (1.0 + SLACK), contacts.count > 0, features.tree.extent)
    if top == ANEW:
        top = enter(features.tree, search, ray_size(ray))
    top, count = onward(features.tree, ray, min(length, best - s), search, top, first)
    announce(features, search.found, first, count)
    return length, top, count


def finish_search(length, top, count, curve, features, search, radius, end, contacts, left):
    """The `first_touch` of a search that has begun, or is to begin ANEW."""
    few = len(features.tree.items) == 0
    always = len(search.found) if few else features.everywhere
    for c in range(always):
        search.times[c], search.until[c] = 0.0, np.inf
    item, best = earliest(curve, features, search, 0, always, radius, 0.0, end, NONE, end, contacts, left)
    s, goal, near, chords = end if few else 0.0, end, always, 0
    while s < best:
        chords, done = chords + 1, always
        while top != 0 or done < count:
            first = count
            if top != 0:  # those found before are looked at while the next are on their way into the cache
                length, top, count = search_on(top, first, curve, features, search, radius, s, goal, best, contacts)
            item, best = earliest(curve, features, search, done, first, radius, s, s + length, item, best, contacts, left)
            done = first
        near = count if s == 0.0 else NONE
        s, top, count, goal = s + length, ANEW, always, best
    return item, best if item != NONE else np.inf, near, chords


def announce(features, found, first, last):
    """Have the features in places `first` to `last` - 1 brought into the cache, and the outlines of faces, if all are as long."""
    n = len(features.faces)
    rows = len(features.outline) // max(n, 1)
    for c in range(first, last):
        i = found[c]
        if i < n:
            prefetch(features.faces, i)
            for k in range(0, 4, 2):
                prefetch(features.outline, i * rows + k)
        else:
            prefetch(features.edges, i - n)
