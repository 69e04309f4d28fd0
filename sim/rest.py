"""Balls that lie on surfaces: what holds them, and when bounces have become so small that they count as rest.

A ball may lie on up to three features at once. It moves on as it would in flight, with velocity and acceleration projected
on the directions left to it (frictionless), or is held where it is, if its impacts are damped.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.touch import NONE
from sim.vector import across, axpy, cross, dot, norm, scale

STILL = 1e-12  # m/s that count as none after an impact: impacts in a wedge end so
NEGLIGIBLE = 1e-13  # m that a ball would still move in bounces that are left out
TOUCHING = 1e-12  # of the speed: a velocity away from a surface, or into it, that is rounding
SAME = 1e-12  # less the cosine of an angle between normals of one support
PARALLEL = 1e-9  # sine of the angle between normals that count as one


class Contacts(NamedTuple):
    """The features that a ball lies on."""

    count: int
    held: bool  # so that it does not slide
    items: tuple  # three numbers of features, NONE where there is none
    normals: tuple  # three unit vectors, from the surface to the ball


def no_contacts():
    zero = (0.0, 0.0, 0.0)
    return Contacts(0, False, (NONE, NONE, NONE), (zero, zero, zero))


def add(contacts, item, normal, held):
    """The contacts and one more; the oldest goes when there are three."""
    i, n = contacts.items, contacts.normals
    if contacts.count == 0:
        return Contacts(1, held, (item, NONE, NONE), (normal, n[1], n[2]))
    if contacts.count == 1:
        return Contacts(2, held, (i[0], item, NONE), (n[0], normal, n[2]))
    if contacts.count == 2:
        return Contacts(3, held, (i[0], i[1], item), (n[0], n[1], normal))
    return Contacts(3, held, (i[1], i[2], item), (n[1], n[2], normal))


def without(contacts, k):
    """The contacts but the k-th."""
    i, n, count = contacts.items, contacts.normals, contacts.count - 1
    held = contacts.held and count > 0
    if k == 0:
        return Contacts(count, held, (i[1], i[2], NONE), (n[1], n[2], n[0]))
    if k == 1:
        return Contacts(count, held, (i[0], i[2], NONE), (n[0], n[2], n[1]))
    return Contacts(count, held, (i[0], i[1], NONE), n)


def parallel(contacts, normal):
    """Which contact has the same normal but for a small angle, or NONE."""
    for k in range(contacts.count):
        if dot(contacts.normals[k], normal) > 1.0 - SAME:
            return k
    return NONE


def replaced(contacts, k, item, normal):
    """The contacts, the k-th by another."""
    i, n = contacts.items, contacts.normals
    items = (item if k == 0 else i[0], item if k == 1 else i[1], item if k == 2 else i[2])
    normals = (normal if k == 0 else n[0], normal if k == 1 else n[1], normal if k == 2 else n[2])
    return Contacts(contacts.count, contacts.held, items, normals)


def tangent(a, contacts):
    """The part of the vector a along all surfaces in contact."""
    if contacts.count == 0:
        return a
    n0, n1, n2 = contacts.normals
    if contacts.count == 1:
        return across(n0, a)
    line = cross(n0, n1)
    if contacts.count == 3:
        other, third = cross(n1, n2), cross(n2, n0)
        if abs(dot(line, n2)) > PARALLEL:
            return 0.0, 0.0, 0.0
        if norm(other) > norm(line):
            line = other
        if norm(third) > norm(line):
            line = third
    size = norm(line)
    if size <= PARALLEL:
        return across(n0, a)
    line = scale(1.0 / size, line)
    return scale(dot(a, line), line)


def pressed(a, contacts):
    """Those contacts that a ball with acceleration a presses on: without any one of them it would move into it."""
    k = 0
    while k < contacts.count:
        others = without(contacts, k)
        push = a if contacts.held else tangent(a, others)
        if dot(push, contacts.normals[k]) >= 0.0:
            contacts, k = others, 0
        else:
            k += 1
    return contacts


def still_touching(v, a, contacts):
    """Those contacts along which the velocity v runs, but for rounding, or for what the acceleration a ends at once."""
    k = 0
    while k < contacts.count:
        off, pull = dot(v, contacts.normals[k]), -dot(a, contacts.normals[k])
        if abs(off) > TOUCHING * norm(v) and off * off > 2.0 * max(pull, 0.0) * NEGLIGIBLE:
            contacts, k = without(contacts, k), 0
        else:
            k += 1
    return contacts


def turned_back(v, normal, e, contacts):
    """The velocity v (m/s) along all surfaces in contact, after the impact on one more that it still runs into.

    These have taken back what the impact gave, as they do where their normals are nearly that one: so it is along them. With e = 1
    its speed stays.
    """
    way, into = tangent(normal, contacts), dot(v, normal)
    if into >= 0.0 or norm(way) <= PARALLEL:
        return v
    return axpy(-(1.0 + e) * into / dot(way, way), way, v)


def time_to_rest(v, a, normal, e):
    """How long (s) the bounces go on: the hops 2 u/|a_n| (1 + e + e^2 + ...) after an impact that the ball leaves at the normal
    speed u, under a constant acceleration a_n toward the surface; inf if they do not end."""
    u, pull = dot(v, normal), -dot(a, normal)
    if pull <= 0.0:
        return np.inf
    if u <= 0.0:
        return 0.0
    return 2.0 * u / (pull * (1.0 - e)) if e < 1.0 else np.inf


def comes_to_rest(v, a, normal, e, damping, blur):
    """Whether what is left of the bounces is negligible: the height of the hop, and, as damping stops the ball, the way along the
    surface, are at most NEGLIGIBLE; or the hop takes no longer than `blur` (s), which a method of first order cannot resolve."""
    u, pull = max(dot(v, normal), 0.0), -dot(a, normal)
    if pull <= 0.0:
        return False
    if 2.0 * u <= pull * blur:
        return True
    left = time_to_rest(v, a, normal, e)
    if left == np.inf:
        return False
    along = norm(axpy(-u, normal, v)) + norm(a) * left if damping > 0.0 else 0.0
    return u * u <= 2.0 * pull * NEGLIGIBLE and along * left <= NEGLIGIBLE
