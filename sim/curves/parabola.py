"""x(s) = x + v s + k s^2/2: flight under a constant acceleration k; a straight line where k = 0."""

import numpy as np

from sim.curves.majorant import chord
from sim.vector import across, dot, fused, gap, norm, scale, size, sub


def flight(x, v, k, b, w2):
    """The curve from position x (m) at velocity v (m/s) under x'' = k - b x' - w2 (x - x(0)); here b and w2 are zero."""
    return x, v, k


def as_quintic(curve):
    """It as a curve of `sim.curves.quintic`."""
    x, v, k = curve
    zero = (0.0, 0.0, 0.0)
    return x, v, scale(0.5, k), zero, zero, zero


def point(curve, s):
    x, v, k = curve
    return fused(s, fused(0.5 * s, k, v), x)


def slope(curve, s):
    return fused(s, curve[2], curve[1])


def bend(curve, s, end):
    return norm(curve[2])


def bends(curve, s, end):
    return size(curve[2])


def series(curve, s, t):
    """The coefficients (m) of x(s + u t) in powers of u, and how much (m) they leave out, of x and of its slope by u, where
    0 <= u <= 1."""
    return (point(curve, s), scale(t, slope(curve, s)), scale(0.5 * t * t, curve[2])), 0.0


def seen_from(curve, p):
    """The curve of x - p."""
    x, v, k = curve
    return sub(x, p), v, k


def seen_along(curve, n):
    """The part of the curve across the unit vector n."""
    x, v, k = curve
    return across(n, x), across(n, v), across(n, k)


def piece(curve, s, end, off):
    """A piece of the curve from s on: its length (s), the path x + v t + k t^2/2 it takes, and how near (m) to that it stays.

    The rest of the curve, if it is curved along one axis at most, as paths are; else a chord.
    """
    k = curve[2]
    if is_path(k):
        return end - s, (point(curve, s), slope(curve, s), k), 0.0
    return chord(curve, s, end, off)


def is_path(k):
    return int(k[0] != 0.0) + int(k[1] != 0.0) + int(k[2] != 0.0) <= 1  # numpy would add truths up to one


def project(curve, n, p, offset):
    x, v, k = curve
    return gap(n, x, p, offset), dot(n, v), dot(n, k)


def start(line):
    return line


def fall(line, s, end, below):
    """The one root of the quadratic at which it falls, (-u - sqrt(u^2 - 2 a f))/a, written so that nothing cancels."""
    f, u, a = line
    square = u * u - 2.0 * a * f
    root = np.sqrt(square) if square > 0.0 else 0.0
    falls = f > 0.0 if u < 0.0 else a < 0.0
    over, under = (2.0 * f, root - u) if u < 0.0 else (-(u + root), a)
    t = over / under if falls and square > 0.0 else np.inf
    return t if (s < t or s == 0.0) and t <= end else np.inf


def fall_straight(gap, speed, radius):
    """`first_fall` of `sim.touch` of a gap (m) that changes at one `speed` (m/s): the same, bit for bit, for less."""
    if gap > 0.0 or gap < -radius:
        return gap / -speed if gap > 0.0 and speed < 0.0 and speed * speed > 0.0 else np.inf
    return 0.0 if speed < 0.0 else np.inf
