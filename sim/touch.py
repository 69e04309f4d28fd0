"""Touches of single features: the earliest time at which a ball moving on a curve touches a face or an edge.

A ball of radius r touches a face where its centre comes down on the face's plane moved by r, with its foot inside the
outline; and an edge, with the corners at its ends, where the centre comes as near as r to that segment. Both are first
zeros, approached from above, of a function whose second derivative is bounded below, and the first is found surely, see
`sim.curves.majorant`: for a face the gap n . (x - p) - r along a fixed direction; for an edge the distance to a convex set,
which along any curve has a second derivative of at least -|x''|, since it is convex along a line and changes by no more than one
moves.
"""

from __future__ import annotations

import numpy as np

from sim.curves.majorant import MOST, PATIENCE, polish, stride

# bound to the curve's own before they are compiled
from sim.curves.parabola import bend, fall, point, project, seen_along, seen_from, slope, start
from sim.curves.stays_off import stays_off
from sim.packed import ALONG, LENGTH, NORMAL, POINT, SIDES, START, covers, from_edge, height, vector
from sim.vector import across, axpy, cross, dot, norm, scale, sub

EPS = np.finfo(float).eps
NONE = -1
SLACK = 1e-6  # share of the radius by which more is looked at than can be touched: what bounds the times is rounded
FLAT = 1e-9  # sine of an angle, or share of a radius, that counts as none between an edge and a plane
LEVEL = 1e-12  # of the speed: a velocity toward an edge that is rounding
NEXT = 1e-6  # radii: of a ball that slides around a corner, how near to one place on it the nearest of two edges are
TIE = 1e-12  # of the time: an edge touched before a face by no more than this is taken for touched with it


def earliest(curve, features, search, first, last, radius, begin, end, item, best, contacts, left):
    """The earliest touch known, of `item` at `best` (s), or an earlier one of what `search` has found in places `first` to
    `last` - 1, each within its own times after `begin` and before `end` (s)."""
    item, best = earliest_face(curve, features, search, first, last, radius, begin, item, best, contacts, left)
    faces, edges = features.faces, features.edges
    n = len(faces)
    for c in range(first, last):
        i, since = search.found[c], begin + search.times[c]
        if i < n or since > best or (contacts.count > 0 and lies_on(point(curve, 0.0), faces, edges, i, radius, contacts)):
            continue
        s, till = -1.0, min(best, min(begin + search.until[c], end))
        if contacts.count > 0:
            s = beside(curve, faces, edges, features.outline, i, radius, best, contacts)
        elif passes_by(curve, edges, i - n, radius, since, till):
            continue
        if s < 0.0:
            s = touch_edge(curve, edges, i - n, radius, since, till)
        soonest = rank(best, item, n)
        if rank(s, i, n) < soonest or (rank(s, i, n) == soonest and (item == NONE or i < item)):
            item, best = i, s
    return item, best


def passes_by(curve, edges, e, radius, begin, end):
    """Whether it is plain that the ball does not touch edge e from `begin` to `end` (s): the curve's chord is too far away."""
    x, time = point(curve, begin), end - begin
    chord = sub(point(curve, end), x)
    # slack also for the angle below which the distance is that of parallel lines
    reach = radius + SLACK * (radius + norm(chord)) + 0.125 * bend(curve, begin, end) * time * time
    return distance_squared(edges, e, x, chord) > reach * reach


def distance_squared(edges, e, x, chord):
    """The square of the distance (m^2) between edge e and the segment x + t chord, 0 <= t <= 1 (Ericson 2005, section 5.1.9)."""
    axis, length = vector(edges, e, ALONG), edges[e, LENGTH]
    off = sub(x, vector(edges, e, START))
    a, b, c, f = dot(chord, chord), dot(chord, axis), dot(chord, off), dot(axis, off)
    t, slant = 0.0, a - b * b
    if slant > SLACK * SLACK * a:
        t = min(max((b * f - c) / slant, 0.0), 1.0)
    u = b * t + f
    if u < 0.0 or u > length:
        u = min(max(u, 0.0), length)
        t = min(max((b * u - c) / a, 0.0), 1.0) if a > 0.0 else 0.0
    gap = axpy(-u, axis, axpy(t, chord, off))
    return dot(gap, gap)


def earliest_face(curve, features, search, first, last, radius, begin, item, best, contacts, left):
    """The same for the faces among them, up to whatever time."""
    faces, found, times = features.faces, search.found, search.times
    n = len(faces)
    for c in range(first, last):
        i = found[c]
        if i >= n:
            continue
        since, till = begin + times[c], begin + search.until[c]
        if contacts.count > 0 and lies_on(point(curve, 0.0), faces, features.edges, i, radius, contacts):
            times[c] = np.inf
            continue
        if contacts.count > 0:
            times[c] = beside(curve, faces, features.edges, features.outline, i, radius, best, contacts)
            if times[c] >= 0.0:
                continue
        times[c] = touch_plane(curve, faces, i, radius, since, best, i == left)
        if times[c] < since:  # on the face's plane, but not on it yet
            times[c] = falls_again(curve, faces, i, radius, times[c], best)
        if times[c] > till:  # or no more
            times[c] = np.inf
    while True:
        soonest, upcoming = rank(best, item, n), NONE
        for c in range(first, last):
            i = found[c]
            lowest = item if upcoming == NONE else found[upcoming]
            if i < n and (times[c] < soonest or (times[c] == soonest and (lowest == NONE or i < lowest))):
                upcoming, soonest = c, times[c]
        if upcoming == NONE:
            return item, best
        i, s = found[upcoming], times[upcoming]
        if lands(curve, faces, features.outline, i, s):
            return i, s
        times[upcoming] = falls_again(curve, faces, i, radius, s, best)  # it comes down beside the face


def falls_again(curve, faces, f, radius, s, end):
    """When (s) a ball that comes down on the plane of face f at s does so again."""
    again = fall(plane_gap(curve, faces, f, 1.0, radius), s, end, True)
    if faces[f, SIDES] > 1.0:
        again = min(again, fall(plane_gap(curve, faces, f, -1.0, radius), s, end, True))
    return again


def lies_on(x, faces, edges, i, radius, contacts):
    """Whether feature i is one that a ball at x lies on, or an edge in the plane of one: that is touched only where the ball,
    sliding, leaves the face."""
    for k in range(contacts.count):
        if i == contacts.items[k]:
            return True
        e, n = i - len(faces), contacts.normals[k]
        if e >= 0 and contacts.items[k] < len(faces) and abs(dot(n, vector(edges, e, ALONG))) <= FLAT:
            if abs(dot(n, sub(vector(edges, e, START), x)) + radius) <= FLAT * radius:
                return True
    return False


def beside(curve, faces, edges, outline, i, radius, end, contacts):
    """When (s) a ball that slides around an edge comes from there onto feature i beside it, inf if not within `end`; below zero
    where i is beside no edge that it lies on."""
    n, s = len(faces), -1.0
    for k in range(contacts.count):
        e = contacts.items[k] - n
        if e >= 0 and s < 0.0 and i < n:
            s = onto_face(curve, faces, edges, outline, i, e, radius, end)
        elif e >= 0 and s < 0.0:
            s = onto_edge(curve, edges, i - n, e, radius, end)
    return s


def onto_face(curve, faces, edges, outline, f, e, radius, end):
    """When (s) a ball that slides around edge e comes onto face f beside it: where its centre gets straight over the edge, seen
    from the face. Below zero if f is not beside it."""
    axis, begin, length = vector(edges, e, ALONG), vector(edges, e, START), edges[e, LENGTH]
    normal = vector(faces, f, NORMAL)
    if abs(dot(normal, axis)) > FLAT or abs(height(faces, f, begin)) > FLAT * radius:
        return -1.0
    inward, middle = cross(normal, axis), axpy(0.5 * length, axis, begin)
    if not covers(faces, outline, f, axpy(1e-6 * length, inward, middle)):
        inward = scale(-1.0, inward)
        if not covers(faces, outline, f, axpy(1e-6 * length, inward, middle)):
            return -1.0
    if faces[f, SIDES] == 1.0 and height(faces, f, point(curve, 0.0)) < 0.0:
        return np.inf
    return first_fall(project(curve, scale(-1.0, inward), begin, 0.0), radius, end)


def onto_edge(curve, edges, i, e, radius, end):
    """When (s) a ball that slides around the corner at an end of edge e comes from there onto edge i, which ends there too: where
    its centre passes straight over that end, more toward i than toward e. Below zero if they share no corner under the ball."""
    x = point(curve, 0.0)
    if norm(sub(from_edge(edges, e, x), from_edge(edges, i, x))) > NEXT * radius:
        return -1.0
    corner, way = nearer_end(edges, i, x)
    other, back = nearer_end(edges, e, x)
    if norm(sub(corner, other)) > FLAT * radius or dot(sub(x, corner), way) > NEXT * radius:
        return -1.0
    s = first_fall(project(curve, scale(-1.0, way), corner, 0.0), radius, end)
    if s < np.inf:
        v = slope(curve, s)
        if dot(v, way) <= dot(v, back):
            return np.inf
    return s


def nearer_end(edges, e, x):
    """The end of edge e that is nearer to x, and the direction from there along the edge."""
    axis, begin, length = vector(edges, e, ALONG), vector(edges, e, START), edges[e, LENGTH]
    if dot(sub(x, begin), axis) <= 0.5 * length:
        return begin, axis
    return axpy(length, axis, begin), scale(-1.0, axis)


def rank(s, i, n):
    """By what touches are put in order: the time, but an edge gives way to a face."""
    return s * (1.0 + TIE) if i >= n else s


def plane_gap(curve, faces, f, side, radius):
    """The gap (m) between the ball and one side of the plane of face f, along the curve."""
    return project(curve, scale(side, vector(faces, f, NORMAL)), vector(faces, f, POINT), radius)


def touch_plane(curve, faces, f, radius, since, end, left):
    """When (s) the ball first comes down on the plane of face f; not at once if it has just `left` the face.

    The back is left out where the ball is off the front at `since`: before it comes to the back it comes down on the front's plane.
    """
    s = touch_side(curve, faces, f, 1.0, radius, end, left)
    if faces[f, SIDES] > 1.0 and not height(faces, f, point(curve, since)) > radius:
        s = min(s, touch_side(curve, faces, f, -1.0, radius, end, left))
    return s


def touch_side(curve, faces, f, side, radius, end, left):
    """The same for one side."""
    line = plane_gap(curve, faces, f, side, radius)
    s = first_fall(line, radius, end)
    if left and s * norm(slope(curve, 0.0)) <= FLAT * radius:
        s = fall(line, s, end, True)
    return s


def first_fall(line, radius, end):
    """When (s) the gap first falls through zero; at once where the ball is in touch, or by rounding a little further."""
    gap, speed, push = start(line)
    sinks = speed < 0.0 or (speed == 0.0 and push < 0.0)
    if gap > 0.0 or (gap == 0.0 and not sinks):
        return fall(line, 0.0, end, False)
    if sinks and gap >= -radius:
        return 0.0
    return fall(line, 0.0, end, True)


def lands(curve, faces, outline, f, s):
    """Whether the foot of a ball that meets the plane of face f after the time s (s) is on the face."""
    x = point(curve, s)
    return covers(faces, outline, f, axpy(-height(faces, f, x), vector(faces, f, NORMAL), x))


def touch_edge(curve, edges, e, radius, begin, end):
    """When (s) the ball first touches edge e or a corner at its ends, from `begin` on; inf if not within `end`.

    The distance to the edge's whole line is no more than that to the edge, and bent only by what happens across it: of the
    two ways to go on without missing a touch the longer is taken; after PATIENCE steps of three, see `sim.curves.stays_off`. A
    ball that for MOST steps is no farther off than rounding can tell counts as touching.
    """
    axis, length = vector(edges, e, ALONG), edges[e, LENGTH]
    near = seen_from(curve, vector(edges, e, START))
    flat = seen_along(near, axis)
    s = begin
    for k in range(MOST):
        x, v = point(near, s), slope(near, s)
        along, line = dot(x, axis), across(axis, x)
        off = axpy(-min(max(along, 0.0), length), axis, x)
        distance, wide = norm(off), norm(line)
        gap, speed = distance - radius, dot(off, v) / distance
        # of the place at the start and here, and of the time
        noise = 4.0 * EPS * (norm(near[0]) + norm(x) + norm(v) * s)
        m = bend(near, s, end)
        if s == 0.0 and abs(gap) <= start_noise(curve, edges, e, distance):
            rise = lift(curve, edges, e, off, along)
            if abs(speed) <= LEVEL * norm(v) and rise >= 0.0:
                speed = 0.0
            elif speed > 0.0 and speed * speed < -2.0 * rise * noise:  # a hop too low to see
                return -2.0 * speed / rise if -2.0 * speed / rise <= end else np.inf
        if gap <= noise and speed < 0.0:
            t = polish(s, gap, speed, m, noise)
            # of a hop too low to see, not back to where it still rises; nor back where it was in touch from another side all along
            return t if begin < t and dot(off, slope(near, t)) < 0.0 else s
        step = stride(gap, speed, m, noise)
        if wide > radius:
            step = max(step, stride(wide - radius, dot(line, v) / wide, bend(flat, s, end), noise))
        if k >= PATIENCE:
            step = max(step, stays_off(near, axis, length, radius, s, end, step, noise))
        s += step
        if not s <= end:
            return np.inf
    return s


def start_noise(curve, edges, e, distance):
    """How well (m) the distance of a ball from an edge is known at its start."""
    x, p = point(curve, 0.0), vector(edges, e, START)
    return 16.0 * EPS * (abs(x[0]) + abs(x[1]) + abs(x[2]) + abs(p[0]) + abs(p[1]) + abs(p[2]) + distance)


def lift(curve, edges, e, off, along):
    """The second derivative (m/s^2) of the distance to an edge from which the ball is `off` (m) at the start of the curve, while
    it moves along its surface: n . x'' + (speed around)^2/distance."""
    distance = norm(off)
    v, n = slope(curve, 0.0), scale(1.0 / distance, off)
    _, _, push = start(project(curve, n, point(curve, 0.0), 0.0))
    around = across(vector(edges, e, ALONG), v) if 0.0 < along < edges[e, LENGTH] else v
    return push + dot(around, around) / distance
