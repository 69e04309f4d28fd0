"""Balls that slide: off a face past its outline, and around an edge or a corner."""

from __future__ import annotations

import numpy as np

from sim.curves.parabola import fall, point, project, start  # bound to the curve's own before they are compiled
from sim.motion import acceleration, lying_on
from sim.packed import AXIS, FIRST, LAST, NORMAL, POINT, across_edge, covers, from_edge, vector
from sim.rest import without
from sim.touch import NONE
from sim.vector import axpy, cross, dot, norm, scale, sub

PAST = 1e-9  # of a segment's length: how far past its ends a crossing still counts
ARC = 2e-3  # a step around an edge, in units of sqrt(radius / acceleration)


def slides_off(curve, features, contacts, radius, end):
    """When (s) a ball slides off one of the faces it lies on, and which of its contacts that is: (contact, s), or (NONE, inf)."""
    which, soonest = NONE, end
    for k in range(contacts.count):
        f, faces = contacts.items[k], features.faces
        if f >= len(faces):
            continue
        foot = scale(radius, contacts.normals[k])
        for o in range(int(faces[f, FIRST]), int(faces[f, LAST])):
            s = passes_out(curve, faces, features.outline, f, o, foot, soonest)
            if s < soonest or (s == soonest and which == NONE):
                which, soonest = k, s
    return which, soonest if which != NONE else np.inf


def passes_out(curve, faces, outline, f, o, foot, end):
    """When (s) the foot of a ball, `foot` (m) below its centre, passes out of face f over segment o of the outline, or inf."""
    a, b = corner(faces, f, outline[o, 0], outline[o, 1]), corner(faces, f, outline[o, 2], outline[o, 3])
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


def corner(faces, f, u, v):
    """The point (m) of face f with the outline's coordinates u and v."""
    n, p, axis = vector(faces, f, NORMAL), vector(faces, f, POINT), faces[f, AXIS]
    if axis == 0.0:
        return p[0] - (n[1] * (u - p[1]) + n[2] * (v - p[2])) / n[0], u, v
    if axis == 1.0:
        return v, p[1] - (n[2] * (u - p[2]) + n[0] * (v - p[0])) / n[1], u
    return u, v, p[2] - (n[0] * (u - p[0]) + n[1] * (v - p[1])) / n[2]


def edge_contact(faces, contacts):
    """Which contact is one with an edge or a corner, or NONE."""
    for k in range(contacts.count):
        if contacts.items[k] >= len(faces):
            return k
    return NONE


def turn(features, k, x, v, mover):
    """The acceleration (m/s^2) of a ball that slides around an edge or corner, its k-th contact; and the part of it that the
    surface would have to pull: above zero the ball flies off."""
    edges = features.edges
    e = mover.contacts.items[k] - len(features.faces)
    off = from_edge(edges, e, x)
    distance = norm(off)
    n = scale(1.0 / distance, off)
    around = across_edge(edges, e, x, v)
    a = acceleration(0.0, x, v, lying_on(mover, without(mover.contacts, k)))
    inward = dot(around, around) / distance
    pull = dot(a, n) + inward
    return axpy(-pull, n, a), pull


def flies_off(features, item, x, v, a, normal):
    """Whether a ball that runs along an edge or corner `item` is too fast for its acceleration a to hold it there."""
    e = item - len(features.faces)
    if e < 0:
        return False
    around = across_edge(features.edges, e, x, axpy(-dot(v, normal), normal, v))
    return dot(a, normal) + dot(around, around) / norm(from_edge(features.edges, e, x)) >= 0.0


def arc(features, k, x, v, mover, radius):
    """How long (s) a step around an edge may be."""
    a, _ = turn(features, k, x, v, mover)
    return ARC * np.sqrt(radius / (norm(a) + dot(v, v) / radius))


def slide_around(features, k, h, x, v, mover, radius):
    """Position (m), velocity (m/s) and contact normal after sliding for h (s) around an edge or corner: a step of the classical
    Runge-Kutta method, put back onto the surface."""
    a1, _ = turn(features, k, x, v, mover)
    v2 = axpy(0.5 * h, a1, v)
    a2, _ = turn(features, k, axpy(0.5 * h, v, x), v2, mover)
    v3 = axpy(0.5 * h, a2, v)
    a3, _ = turn(features, k, axpy(0.5 * h, v2, x), v3, mover)
    v4 = axpy(h, a3, v)
    a4, _ = turn(features, k, axpy(h, v3, x), v4, mover)
    x1 = axpy(h / 6.0, axpy(2.0, axpy(1.0, v2, v3), axpy(1.0, v, v4)), x)
    v1 = axpy(h / 6.0, axpy(2.0, axpy(1.0, a2, a3), axpy(1.0, a1, a4)), v)
    off = from_edge(features.edges, mover.contacts.items[k] - len(features.faces), x1)
    n = scale(1.0 / norm(off), off)
    x1 = axpy(radius - norm(off), n, x1)
    return x1, axpy(-dot(v1, n), n, v1), n
