"""Balls that slide: off a face past its outline, and around edges and corners.

A ball that lies on an edge or a corner, and on a face or two beside that, goes a curved way: with the unit normals n_k of its
contacts, from the surface to the ball, its acceleration has n_k . a = -|around|^2 / distance at an edge or corner, by the part
of the velocity around it, and n_k . a = 0 at a face, and differs from that of a free ball by a vector of the normals alone.
"""

from __future__ import annotations

import numpy as np

from sim.curves.parabola import fall, point, project, slope, start  # bound to the curve's own before they are compiled
from sim.motion import acceleration, lying_on
from sim.packed import (
    ALONG,
    LENGTH,
    NORMAL,
    POINT,
    START,
    across_edge,
    axis_of,
    covers,
    facing,
    from_edge,
    segments,
    vector,
)
from sim.rest import PARALLEL, TOUCHING, add, no_contacts, parallel, replaced, tangent, without
from sim.touch import NONE, lift
from sim.vector import across, axpy, cross, dot, norm, scale, sub

PAST = 1e-9  # of a segment's length: how far past its ends a crossing still counts
ARC = 2e-3  # a step on a curved way, in units of the shortest time in which something changes
END = 1e-9  # m from an end of an edge within which a ball is no longer bound to go straight along it
SHORT = 1e-9  # of a step: less is not worth one of its own
STRAIGHT = 1e-12  # sine of the angle between lines that count as parallel
ALIKE = 2e-6  # sine of the angle between normals that count as one on a curved way: to keep them apart would magnify rounding
GRAZING = 1e-2  # of a step: a touch that is farther off than this is too flat for Newton's method


def slides_off(curve, features, contacts, radius, end):
    """When (s) a ball slides off one of the faces it lies on, and which of its contacts that is: (contact, s), or (NONE, inf)."""
    which, soonest = NONE, end
    for k in range(contacts.count):
        f, faces = contacts.items[k], features.faces
        if f >= len(faces):
            continue
        foot = scale(radius, contacts.normals[k])
        first, last = segments(faces, features.outline, f)
        for o in range(first, last):
            s = passes_out(curve, faces, features.outline, f, o, foot, soonest)
            if s < soonest or (s == soonest and which == NONE):
                which, soonest = k, s
    return which, soonest if which != NONE else np.inf


def passes_out(curve, faces, outline, f, o, foot, end):
    """When (s) the foot of a ball, `foot` (m) below its centre, passes out of face f over segment o of the outline, or inf."""
    a, b = corner(faces, outline, f, outline[o, 0], outline[o, 1]), corner(faces, outline, f, outline[o, 2], outline[o, 3])
    side = sub(b, a)
    length = norm(side)
    if length == 0.0:
        return np.inf
    side = scale(1.0 / length, side)
    inward = cross(vector(faces, f, NORMAL), side)
    if not covers(faces, outline, f, axpy(1e-6 * length, inward, axpy(0.5 * length, side, a))):
        inward = scale(-1.0, inward)
    line = project(curve, inward, axpy(1.0, foot, a), 0.0)
    gap, speed, push = start(line)
    s = 0.0
    if gap != 0.0 or speed > 0.0 or (speed == 0.0 and push >= 0.0):
        s = fall(line, 0.0, end, gap < 0.0)
    if s < np.inf:
        place = dot(sub(sub(point(curve, s), foot), a), side)
        if -PAST * length <= place <= (1.0 + PAST) * length:
            return s
    return np.inf


def corner(faces, outline, f, u, v):
    """The point (m) of face f with the outline's coordinates u and v."""
    n, p, axis = vector(faces, f, NORMAL), vector(faces, f, POINT), axis_of(faces, outline, f)
    if axis == 0.0:
        return p[0] - (n[1] * (u - p[1]) + n[2] * (v - p[2])) / n[0], u, v
    if axis == 1.0:
        return v, p[1] - (n[2] * (u - p[2]) + n[0] * (v - p[0])) / n[1], u
    return u, v, p[2] - (n[0] * (u - p[0]) + n[1] * (v - p[1])) / n[2]


def on_edge(faces, contacts):
    """Whether one of the contacts is one with an edge or a corner."""
    return max(contacts.items[0], contacts.items[1], contacts.items[2]) >= len(faces)


def curves(features, contacts, x):
    """Whether the way of a ball that slides may be curved: it lies on an edge or corner, is not wedged in by three contacts, and
    is not bound to go straight, along all the edges that it lies on and clear of their ends."""
    n0, n1, n2 = contacts.normals
    line = cross(n0, n1)
    if not on_edge(features.faces, contacts) or (contacts.count == 3 and abs(dot(line, n2)) > PARALLEL):
        return False
    bound = contacts.count == 2 and norm(line) > PARALLEL
    for k in range(contacts.count):
        e = contacts.items[k] - len(features.faces)
        if e >= 0:
            along = dot(sub(x, vector(features.edges, e, START)), vector(features.edges, e, ALONG))
            bound &= min(along, features.edges[e, LENGTH] - along) > END
            bound &= norm(cross(line, vector(features.edges, e, ALONG))) <= STRAIGHT * norm(line)
    return not bound


def reaches_end(curve, features, contacts, curved, end):
    """When (s) a ball that slides around edges passes an end of one, where its way bends anew, or that slides straight
    along them comes near one; at most `end`."""
    margin, least = (0.0, SHORT * end) if curved else (0.5 * END, 0.0)
    for k in range(contacts.count):
        e = contacts.items[k] - len(features.faces)
        if e >= 0:
            start, axis = vector(features.edges, e, START), vector(features.edges, e, ALONG)
            far = axpy(features.edges[e, LENGTH], axis, start)
            for side in (1.0, -1.0):
                way = scale(side, axis)
                for p in (start, far):
                    s = fall(project(curve, way, p, margin), 0.0, end, False)
                    end = s if least < s < end else end
    return end


def renewed(features, contacts, x):
    """The contacts with the normals that those with edges have where the ball is at x."""
    for k in range(contacts.count):
        if contacts.items[k] >= len(features.faces):
            contacts = replaced(contacts, k, contacts.items[k], facing(features, contacts.items[k], x))
    return contacts


def bending(features, item, x, v):
    """How a ball that goes straight on is accelerated (m/s^2) away from `item`: by |around|^2 / distance for an edge or corner,
    not at all for a face."""
    e = item - len(features.faces)
    if e < 0:
        return 0.0
    around = across_edge(features.edges, e, x, v)
    return dot(around, around) / norm(from_edge(features.edges, e, x))


def departing(features, contacts, k, x, v, a):
    """How a ball with the acceleration a gets away (m/s^2) from its k-th contact; zero if there is none."""
    return dot(contacts.normals[k], a) + bending(features, contacts.items[k], x, v) if k < contacts.count else 0.0


def lack(features, contacts, k, x, radius):
    """How much (m) a ball at x is too near to its k-th contact, zero if there is none."""
    f, n = contacts.items[k], len(features.faces)
    if k >= contacts.count:
        return 0.0
    if f >= n:
        return radius - norm(from_edge(features.edges, f - n, x))
    return radius - dot(contacts.normals[k], sub(x, vector(features.faces, f, POINT)))


def reaction(contacts, wanted):
    """The shortest vector that has the parts `wanted`, three numbers, along the normals of the contacts. A normal that
    depends on those before it has no say."""
    zero = (0.0, 0.0, 0.0)
    total, one, other = zero, zero, zero
    for k in range(contacts.count):
        n = contacts.normals[k]
        free = across(other, across(one, n))
        size = norm(free)
        if size > ALIKE:
            free = scale(1.0 / size, free)
            total = axpy((wanted[k] - dot(n, total)) / size, free, total)
            one, other = free, one
    return total


def turn(features, x, v, mover):
    """The acceleration (m/s^2) of a ball that slides on all its contacts."""
    contacts = renewed(features, mover.contacts, x)
    a = acceleration(0.0, x, v, lying_on(mover, no_contacts()))
    d0, d1 = departing(features, contacts, 0, x, v, a), departing(features, contacts, 1, x, v, a)
    return axpy(-1.0, reaction(contacts, (d0, d1, departing(features, contacts, 2, x, v, a))), a)


def pressing(features, x, v, mover):
    """Those contacts that a ball that slides presses on. One that would have to pull is given up, and that first which would have
    to pull most."""
    contacts = renewed(features, mover.contacts, x)
    size = norm(acceleration(0.0, x, v, lying_on(mover, no_contacts())))
    while True:
        which, most = NONE, 0.0
        for k in range(contacts.count):
            others = without(contacts, k)
            away = departing(features, contacts, k, x, v, turn(features, x, v, lying_on(mover, others)))
            free = norm(tangent(contacts.normals[k], others))
            pull = away / (free * free) if free > ALIKE else away
            if away > TOUCHING * (size + bending(features, contacts.items[k], x, v)) and pull > most:
                which, most = k, pull
        if which == NONE:
            return contacts
        contacts = without(contacts, which)


def flies_off(features, item, x, v, mover, normal):
    """Whether a ball that runs along an edge or corner `item` is too fast for its acceleration to hold it there."""
    if item < len(features.faces):
        return False
    a = turn(features, x, v, mover)
    return dot(a, normal) + bending(features, item, x, axpy(-dot(v, normal), normal, v)) >= 0.0


def falls_back(curve, features, item, radius, h):
    """Whether the curve takes a ball that flies off an edge or corner `item` back onto it within h (s). The acceleration does not,
    but that of a curve may be twice as large: of a step of first order, whose place is that of the velocity at its end."""
    e, x = item - len(features.faces), point(curve, 0.0)
    off = from_edge(features.edges, e, x)
    along = dot(sub(x, vector(features.edges, e, START)), vector(features.edges, e, ALONG))
    speed = dot(off, slope(curve, 0.0)) / norm(off)
    return norm(off) - radius + h * (speed + 0.5 * h * lift(curve, features.edges, e, off, along)) < 0.0


def arc(features, x, v, mover, radius):
    """How long (s) a step on a curved way may be: a share of the shortest time in which something changes."""
    speed, a = norm(v), norm(acceleration(0.0, x, v, lying_on(mover, no_contacts())))
    bow = norm(turn(features, x, v, mover)) / (speed * speed + radius * a) if speed + a > 0.0 else 0.0
    bow = max(bow, 1.0 / radius)
    return ARC / np.sqrt(bow * (a + bow * speed * speed) + mover.w2 + mover.b * mover.b)


def put_on(features, contacts, x, radius):
    """The place (m) nearest to x, which is near, where the ball lies on its contacts, and these with their normals there."""
    for _ in range(2):
        contacts = renewed(features, contacts, x)
        l0, l1 = lack(features, contacts, 0, x, radius), lack(features, contacts, 1, x, radius)
        x = axpy(1.0, reaction(contacts, (l0, l1, lack(features, contacts, 2, x, radius))), x)
    return x, renewed(features, contacts, x)


def slide_around(features, h, x, v, mover, radius):
    """Position (m), velocity (m/s) and contacts after sliding for h (s) on a curved way: a step of the classical Runge-Kutta
    method, put back onto the surfaces."""
    a1 = turn(features, x, v, mover)
    v2 = axpy(0.5 * h, a1, v)
    a2 = turn(features, axpy(0.5 * h, v, x), v2, mover)
    v3 = axpy(0.5 * h, a2, v)
    a3 = turn(features, axpy(0.5 * h, v2, x), v3, mover)
    v4 = axpy(h, a3, v)
    a4 = turn(features, axpy(h, v3, x), v4, mover)
    x1 = axpy(h / 6.0, axpy(2.0, axpy(1.0, v2, v3), axpy(1.0, v, v4)), x)
    v1 = axpy(h / 6.0, axpy(2.0, axpy(1.0, a2, a3), axpy(1.0, a1, a4)), v)
    x1, contacts = put_on(features, mover.contacts, x1, radius)
    n0, n1, n2 = contacts.normals
    return x1, axpy(-1.0, reaction(contacts, (dot(n0, v1), dot(n1, v1), dot(n2, v1))), v1), contacts


def meets(features, item, s, h, x, v, mover, radius):
    """When (s) a ball on a curved way of h (s) touches `item`: near s, where the parabola does that is close to that way."""
    touched = add(no_contacts(), item, (0.0, 0.0, 0.0), False)
    for _ in range(3):
        x1, v1, contacts = slide_around(features, s, x, v, mover, radius)
        normal = facing(features, item, x1)
        gap, speed = -lack(features, replaced(touched, 0, item, normal), 0, x1, radius), dot(v1, normal)
        if parallel(contacts, normal) != NONE or not abs(gap) < GRAZING * h * abs(speed):
            break
        s = min(max(s - gap / speed, 0.0), h)
    return s
