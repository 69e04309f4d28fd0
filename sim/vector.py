"""Three-vectors as tuples: the compiler keeps them in registers, and formulas read as they are written."""

import numpy as np

from sim.instructions import fma

ROUNDING = 4 * np.finfo(float).eps


def axpy(a, x, y):
    """a x + y."""
    return a * x[0] + y[0], a * x[1] + y[1], a * x[2] + y[2]


def fused(a, x, y):
    """a x + y, each part rounded once."""
    return fma(a, x[0], y[0]), fma(a, x[1], y[1]), fma(a, x[2], y[2])


def two_sum(a, b):
    """a + b, and what it is too low by (Knuth 1997, The Art of Computer Programming, volume 2, section 4.2.2)."""
    total = a + b
    share = total - a
    return total, (a - (total - share)) + (b - share)


def scale(a, x):
    return a * x[0], a * x[1], a * x[2]


def sub(x, y):
    return x[0] - y[0], x[1] - y[1], x[2] - y[2]


def dot(x, y):
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


def across(n, x):
    """The part of x across the unit vector n."""
    return axpy(-dot(n, x), n, x)


def norm(x):
    return np.sqrt(dot(x, x))


def cross(x, y):
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]


def row(array, i):
    """Row i of an (n, 3) array."""
    return array[i, 0], array[i, 1], array[i, 2]


def gap(n, x, p, offset):
    """n . (x - p) - offset, and exactly zero where it is no more than the rounding of the coordinates."""
    d = sub(x, p)
    g = dot(n, d) - offset
    # in two sums: that of the plane is the same for all balls
    x, p, n = size(x), size(p), size(n)
    return g if abs(g) > ROUNDING * (dot(n, x) + (dot(n, p) + offset)) else 0.0


def gap_along(n, x, p, offset):
    """`gap` along one axis, the same bit for bit."""
    g = n * (x - p) - offset
    return g if abs(g) > ROUNDING * (abs(n) * abs(x) + (abs(n) * abs(p) + offset)) else 0.0


def size(x):
    """The absolute values of a vector's parts."""
    return abs(x[0]), abs(x[1]), abs(x[2])


def larger(x, y):
    """Of each part the larger one."""
    return max(x[0], y[0]), max(x[1], y[1]), max(x[2], y[2])


def within(x, y):
    """Whether no part of x is larger than that of y."""
    return (x[0] <= y[0]) & (x[1] <= y[1]) & (x[2] <= y[2])
