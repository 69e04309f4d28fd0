"""An adaptive method: steps as long as the estimate of their error allows, cut by nothing but events.

The local error of a step is held below `tolerance` times 1 + the size of what it changes, in m for the position and in m/s for
the velocity (Hairer, Norsett, Wanner 1993, Solving Ordinary Differential Equations I, section II.4). A ball keeps the step to
try next, dt; it begins with one without end, and the first tries bring it down.
"""

import numpy as np

from sim.curves.quintic import point, slope  # bound to the curve's own before they are compiled
from sim.integrators.dopri5 import embedded, interpolant  # bound to the method's own before they are compiled
from sim.vector import ROUNDING, dot, norm

SMALL_STEPS = False  # they cross a room in a few
SAFETY, LEAST, MOST = 0.9, 0.2, 10.0  # of the step that the estimate asks for; of the change from step to step
POWER = 0.2  # one over the order in which the error of a step falls, 5

# Gauss-Legendre on [0, 1]: exact for the square of the velocity, of degree 8 in time.
NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(5)[0]
WEIGHTS = 0.5 * np.polynomial.legendre.leggauss(5)[1]


def goal(age, limit, dt):
    return age + dt if age + 1.01 * dt < limit else limit  # no short rest


def hands_on(method):
    return True


def depart(method, h, dt, tolerance, age, x, v, a, motion):
    shortest, tolerance, most, aim = ROUNDING * (age + h), max(tolerance, ROUNDING), MOST, h
    while True:
        x1, v1, a1, dx, dv = embedded(h, age, x, v, a, motion)
        error = max(norm(dx) / (1.0 + max(norm(x), norm(x1))), norm(dv) / (1.0 + max(norm(v), norm(v1)))) / tolerance
        good = error <= 1.0  # NaN is not
        change = max(SAFETY * error**-POWER, LEAST) if error > 0.0 else (most if good else LEAST)
        if good or h <= shortest:
            break
        h, most = h * min(change, SAFETY), 1.0
    following = h * min(change, most)
    if h == aim and h < 0.99 * dt:  # it was short only because the flight or a field ends
        following = max(following, dt)
    return interpolant(h, x, v, a, x1, v1, a1), x1, v1, a1, h, following


def arrive(method, curve, s, h, x1, v1, age, x, v, motion):
    if s == h:
        return x1, v1
    return point(curve, s), slope(curve, s)


def squared_speed(curve, s, x, v, x1, v1, motion):
    total = 0.0
    for k in range(len(NODES)):
        u = slope(curve, NODES[k] * s)
        total += WEIGHTS[k] * dot(u, u)
    return total * s
