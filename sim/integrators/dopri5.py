"""Dormand and Prince's pair of orders 5 and 4: steps of order 5, as long as the tolerance allows by their difference."""

from sim.curves.quintic import hermite
from sim.forces import acceleration
from sim.integrators import Method
from sim.vector import axpy

METHOD = Method(
    curve="quintic",
    order=5,
    oscillator_limit=0.9972,
    drag_limit=3.3066,
    evaluations=6,
    symplectic=False,
    reference="Dormand, Prince 1980, doi:10.1016/0771-050X(80)90013-3, table 2",
    adaptive=True,
)

TWO = (1 / 5,)
THREE = 3 / 40, 9 / 40
FOUR = 44 / 45, -56 / 15, 32 / 9
FIVE = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
SIX = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
END = 35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
ERROR = 71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40


def along(h, y, weights, slopes):
    """y after h (s) at the weighted sum of the slopes."""
    for k in range(len(weights)):
        y = axpy(h * weights[k], slopes[k], y)
    return y


def embedded(h, t, x, v, a, forces):
    v2 = along(h, v, TWO, (a,))
    a2 = acceleration(t + h / 5, along(h, x, TWO, (v,)), v2, forces)
    v3 = along(h, v, THREE, (a, a2))
    a3 = acceleration(t + 3 * h / 10, along(h, x, THREE, (v, v2)), v3, forces)
    v4 = along(h, v, FOUR, (a, a2, a3))
    a4 = acceleration(t + 4 * h / 5, along(h, x, FOUR, (v, v2, v3)), v4, forces)
    v5 = along(h, v, FIVE, (a, a2, a3, a4))
    a5 = acceleration(t + 8 * h / 9, along(h, x, FIVE, (v, v2, v3, v4)), v5, forces)
    v6 = along(h, v, SIX, (a, a2, a3, a4, a5))
    a6 = acceleration(t + h, along(h, x, SIX, (v, v2, v3, v4, v5)), v6, forces)
    x1, v1 = along(h, x, END, (v, v2, v3, v4, v5, v6)), along(h, v, END, (a, a2, a3, a4, a5, a6))
    a1 = acceleration(t + h, x1, v1, forces)
    zero = (0.0, 0.0, 0.0)
    dx, dv = along(h, zero, ERROR, (v, v2, v3, v4, v5, v6, v1)), along(h, zero, ERROR, (a, a2, a3, a4, a5, a6, a1))
    return x1, v1, a1, dx, dv


def step(h, t, x, v, forces):
    x1, v1, _, _, _ = embedded(h, t, x, v, acceleration(t, x, v, forces), forces)
    return x1, v1


def interpolant(h, x, v, a, x1, v1, a1):
    """Of the method's own order, and its slope is as good as the tolerance asks; the dense output of Dormand and Prince (Hairer,
    Norsett, Wanner 1993, section II.6) is of one order less."""
    return hermite(h, x, v, a, x1, v1, a1)
