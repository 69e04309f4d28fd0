"""A method with a fixed step: one step of the grid at a time, or what is left of it after an event."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sim.curves.cubic import SHORT
from sim.curves.parabola import as_quintic  # bound to the curve's own before it is compiled
from sim.handing import carried  # bound to the method's own, where it has one, before it is compiled
from sim.integrators.symplectic_euler import interpolant  # bound to the method's own before they are compiled
from sim.motion import acceleration
from sim.vector import ROUNDING, axpy, dot, scale, sub

SMALL_STEPS = True  # most touch nothing


class Steps(NamedTuple):
    """What a method has of its own. The loops over balls are the same for all methods, and compiled once; these functions they are
    handed."""

    take: Callable  # of this module
    march: Callable  # of `sim.coast`, as are the next
    step_in: Callable
    commit: Callable
    carries: bool  # whether a step hands on an acceleration, see `sim.handing`


def take(h, age, x, v, a, motion):
    """The curve, a quintic, of a step of h (s) from position x (m), velocity v (m/s) and acceleration a (m/s^2), and these three at its
    end."""
    x1, v1, a1 = carried(h, age, x, v, a, motion)
    return as_quintic(interpolant(h, x, v, a, x1, v1)), x1, v1, a1


def goal(age, limit, dt):
    grid = steps_to_come(age, limit, dt) * dt
    return grid if grid < limit - ROUNDING * limit else limit


def steps_to_come(age, limit, dt):
    """The age at the end of the step that begins at `age` (s), in steps dt (s); what is but rounding of ages up to `limit` is none."""
    n = np.floor(age / dt)
    if (n + 1) * dt - age <= ROUNDING * limit:
        n += 1
    return n + 1


def hands_on(method):
    return method.carries


def depart(method, h, dt, tolerance, age, x, v, a, motion):
    curve, x1, v1, a1 = method.take(h, age, x, v, a, motion)
    return curve, x1, v1, a1, h, dt


def arrive(method, curve, s, h, x1, v1, age, x, v, motion):
    if s == h:
        return x1, v1
    _, x1, v1, _ = method.take(s, age, x, v, acceleration(age, x, v, motion), motion)
    return x1, v1


def squared_speed(curve, s, x, v, x1, v1, motion):
    """Simpson's rule, the velocity in the middle from the cubic through both ends; of order 4."""
    if s < SHORT:
        return s * dot(v, v)
    middle = axpy(1.5 / s, sub(x1, x), scale(-0.25, axpy(1.0, v, v1)))
    return s / 6.0 * (dot(v, v) + 4.0 * dot(middle, middle) + dot(v1, v1))
