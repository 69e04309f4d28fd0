"""The exact solver: the true flight in closed form, as far as the next event."""

import numpy as np

from sim.curves.parabola import flight, point, slope  # bound to the curve's own before they are compiled
from sim.rest import tangent
from sim.vector import axpy, dot

# Gauss-Legendre nodes and weights on [0, 1]: for pieces of half a time constant the error is rounding.
NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(8)[0]
WEIGHTS = 0.5 * np.polynomial.legendre.leggauss(8)[1]
GONE, GROWTH = 40.0, 1.25  # time constants of the drag, after which e^-40 of a start is left; then pieces grow with the time

SMALL_STEPS = False  # a piece of flight is as long as it can be


def goal(age, limit, dt):
    return limit


def hands_on(method):
    return False


def depart(method, h, dt, tolerance, age, x, v, a, motion):
    k = tangent(axpy(-motion.w2, x, motion.pull), motion.contacts)
    return flight(x, v, k, motion.b, motion.w2), x, v, a, h, dt


def arrive(method, curve, s, h, x1, v1, age, x, v, motion):
    return point(curve, s), slope(curve, s)


def squared_speed(curve, s, x, v, x1, v1, motion):
    early = min(s, GONE / motion.b)
    total = squared_slope(curve, 0.0, early, int(np.ceil(2.0 * (motion.b + np.sqrt(motion.w2)) * early)) + 1)
    while early < s:
        late = min(s, GROWTH * early)
        total += squared_slope(curve, early, late, 1)
        early = late
    return total


def squared_slope(curve, start, end, pieces):
    """The integral of the slope squared, in equal pieces."""
    s, total = end - start, 0.0
    for i in range(pieces):
        for k in range(len(NODES)):
            u = slope(curve, start + (i + NODES[k]) * s / pieces)
            total += WEIGHTS[k] * dot(u, u)
    return total * s / pieces
