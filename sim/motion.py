"""What moves a ball between two events: the fields that act on it, summed, and the surfaces it lies on.

Which selective fields act changes only where the ball crosses the face of a region, or at the age at which a field ends;
in between its acceleration is one affine function of position and velocity.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.curves.parabola import fall, project, start  # bound to the curve's own before they are compiled
from sim.forces import HIGH, LOW, UNTIL, W2, A, B
from sim.rest import Contacts, tangent
from sim.vector import axpy

NOWHERE = -1


class Motion(NamedTuple):
    """acceleration = pull - w2 x - b v, along the surfaces in contact; `drive` is the part of it without a potential."""

    pull: tuple  # m/s^2
    w2: float  # 1/s^2
    b: float  # 1/s
    drive: tuple  # m/s^2
    drive_w2: float
    drive_b: float
    contacts: Contacts


def motion(age, x, v, forces, contacts):
    """The Motion of a ball at age (s), position x (m), velocity v (m/s)."""
    s, d = forces.steady, forces.drive
    pull, w2, b = (s[A], s[A + 1], s[A + 2]), s[W2], s[B]
    drive, drive_w2, drive_b = (d[A], d[A + 1], d[A + 2]), d[W2], d[B]
    for f in range(len(forces.selective)):
        if acts_next(f, age, x, v, forces):
            rest = forces.selective
            mine = (rest[f, A], rest[f, A + 1], rest[f, A + 2])
            pull, w2, b = axpy(1.0, mine, pull), w2 + rest[f, W2], b + rest[f, B]
            drive, drive_w2, drive_b = axpy(1.0, mine, drive), drive_w2 + rest[f, W2], drive_b + rest[f, B]
    return Motion(pull, w2, b, drive, drive_w2, drive_b, contacts)


def lying_on(motion, contacts):
    """The motion with other contacts."""
    m = motion
    return Motion(m.pull, m.w2, m.b, m.drive, m.drive_w2, m.drive_b, contacts)


def acts_next(f, age, x, v, forces):
    """Whether selective field f acts from now on; on a face of its region it does if the ball is on its way in."""
    s = forces.selective
    inside = age < s[f, UNTIL]
    for axis in range(3):
        a = forces.steady[A + axis]
        inside &= beyond(x[axis], v[axis], a, s[f, LOW + axis]) and not beyond(x[axis], v[axis], a, s[f, HIGH + axis])
    return inside


def beyond(x, v, a, bound):
    """Whether a coordinate is above `bound`, or on it and about to be."""
    if x != bound:
        return x > bound
    return v > 0.0 or (v == 0.0 and a > 0.0)


def acceleration(t, x, v, motion):
    """m/s^2 at position x (m) and velocity v (m/s); takes the place of `sim.forces.acceleration` in a method's step."""
    return tangent(axpy(-motion.b, v, axpy(-motion.w2, x, motion.pull)), motion.contacts)


def rates(t, x, motion):
    """w2 (1/s^2) and b (1/s); takes the place of `sim.forces.rates`."""
    return motion.w2, motion.b


def next_end(age, forces):
    """The age (s) at which the next field ends."""
    soonest = np.inf
    for f in range(len(forces.selective)):
        until = forces.selective[f, UNTIL]
        if age < until < soonest:
            soonest = until
    return soonest


def next_crossing(curve, x, v, forces, end):
    """The first face of a region that the centre crosses within `end` (s): its axis, its place (m) and when, or NOWHERE."""
    axis, place, soonest = NOWHERE, 0.0, end
    for f in range(len(forces.selective)):
        for k in range(3):
            for limit in (LOW, HIGH):
                bound = forces.selective[f, limit + k]
                if not np.isfinite(bound):
                    continue
                side = 1.0 if beyond(x[k], v[k], forces.steady[A + k], bound) else -1.0
                n = (side if k == 0 else 0.0, side if k == 1 else 0.0, side if k == 2 else 0.0)
                p = (bound if k == 0 else 0.0, bound if k == 1 else 0.0, bound if k == 2 else 0.0)
                line = project(curve, n, p, 0.0)
                gap, speed, _ = start(line)
                if gap == 0.0 and x[k] != bound and speed < 0.0:
                    s = 0.0  # on the face to rounding, on its way across
                else:
                    s = fall(line, 0.0, soonest, False)
                if s < soonest or (s == soonest and axis == NOWHERE):
                    axis, place, soonest = k, bound, s
    return axis, place, soonest if axis != NOWHERE else np.inf


def snapped(x, axis, place):
    """x with the coordinate `axis` exactly at `place`."""
    return place if axis == 0 else x[0], place if axis == 1 else x[1], place if axis == 2 else x[2]
