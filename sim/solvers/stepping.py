"""A method with a fixed step: one step of the grid at a time, or what is left of it after an event."""

import numpy as np

from sim.curves.cubic import SHORT
from sim.handing import carried  # bound to the method's own, where it has one, before it is compiled
from sim.integrators.symplectic_euler import interpolant, step  # bound to the method's own before they are compiled
from sim.vector import ROUNDING, axpy, dot, scale, sub

SMALL_STEPS = True  # most touch nothing


def goal(age, limit, dt):
    grid = steps_to_come(age, limit, dt) * dt
    return grid if grid < limit - ROUNDING * limit else limit


def steps_to_come(age, limit, dt):
    """The age at the end of the step that begins at `age` (s), in steps dt (s); what is but rounding of ages up to `limit` is none."""
    n = np.floor(age / dt)
    if (n + 1) * dt - age <= ROUNDING * limit:
        n += 1
    return n + 1


def depart(h, dt, tolerance, age, x, v, a, motion):
    x1, v1, a1 = carried(h, age, x, v, a, motion)
    return interpolant(h, x, v, a, x1, v1), x1, v1, a1, h, dt


def arrive(curve, s, h, x1, v1, age, x, v, motion):
    if s == h:
        return x1, v1
    return step(s, age, x, v, motion)


def squared_speed(curve, s, x, v, x1, v1, motion):
    """Simpson's rule, the velocity in the middle from the cubic through both ends; of order 4."""
    if s < SHORT:
        return s * dot(v, v)
    middle = axpy(1.5 / s, sub(x1, x), scale(-0.25, axpy(1.0, v, v1)))
    return s / 6.0 * (dot(v, v) + 4.0 * dot(middle, middle) + dot(v1, v1))
