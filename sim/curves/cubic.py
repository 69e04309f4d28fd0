"""x(s) = x + v s + c s^2 + d s^3 for 0 <= s <= h: the interpolant of a method with fixed step."""

import numpy as np

from sim.vector import across, axpy, dot, gap, larger, scale, size, sub

EPS = np.finfo(float).eps
SHORT = 1e-60  # s; over less a curve is straight, and powers of it have no inverse


def hermite(h, x, v, x1, v1):
    """The cubic from position x (m) and velocity v (m/s) to x1 and v1 after h (s); within h^4/384 of the fourth derivative of
    what it interpolates, so good for methods up to order 4."""
    per, square = (1.0 / h, 1.0 / (h * h)) if h > SHORT else (0.0, 0.0)
    chord = scale(per, sub(x1, x))
    c = scale(per, axpy(3.0, chord, axpy(-2.0, v, scale(-1.0, v1))))
    d = scale(square, axpy(-2.0, chord, axpy(1.0, v, v1)))
    return x, v, c, d


def flight(x, v, k, b, w2):
    """The curve from position x (m) at velocity v (m/s) under the constant acceleration k (m/s^2)."""
    return x, v, scale(0.5, k), (0.0, 0.0, 0.0)


def point(curve, s):
    x, v, c, d = curve
    return axpy(s, axpy(s, axpy(s, d, c), v), x)


def slope(curve, s):
    _, v, c, d = curve
    return axpy(s, axpy(1.5 * s, scale(2.0, d), scale(2.0, c)), v)


def bend(curve, s, end):
    """|x''| is convex, so it is largest at an end."""
    first, last = at_ends(curve, s, end)
    return 2.0 * np.sqrt(max(dot(first, first), dot(last, last)))


def bends(curve, s, end):
    first, last = at_ends(curve, s, end)
    return scale(2.0, larger(size(first), size(last)))


def at_ends(curve, s, end):
    """x''/2 at s and at `end`."""
    _, _, c, d = curve
    return axpy(3.0 * s, d, c), axpy(3.0 * end, d, c)


def series(curve, s, t):
    """The coefficients (m) of x(s + u t) in powers of u, and how much (m) they leave out, of x and of its slope by u, where
    0 <= u <= 1."""
    _, _, c, d = curve
    second, third = scale(t * t, axpy(3.0 * s, d, c)), scale(t * t * t, d)
    return (point(curve, s), scale(t, slope(curve, s)), second, third), 0.0


def seen_from(curve, p):
    """The curve of x - p."""
    x, v, c, d = curve
    return sub(x, p), v, c, d


def seen_along(curve, n):
    """The part of the curve across the unit vector n."""
    x, v, c, d = curve
    return across(n, x), across(n, v), across(n, c), across(n, d)


def project(curve, n, p, offset):
    x, v, c, d = curve
    return gap(n, x, p, offset), dot(n, v), dot(n, c), dot(n, d)


def start(line):
    return line[0], line[1], 2.0 * line[2]


def value(line, s):
    """f, f', f'' at s, and how well f is known."""
    f, u, c, d = line
    noise = 4.0 * EPS * (abs(f) + s * (abs(u) + s * (abs(c) + s * abs(d))))
    return f + s * (u + s * (c + s * d)), u + s * (2.0 * c + 3.0 * s * d), 2.0 * c + 6.0 * s * d, noise


def dip(line, df, ddf, s, end):
    """m with f'' >= -m, and m with (-f)'' >= -m, on [s, end]: f'' is linear."""
    last = 2.0 * line[2] + 6.0 * end * line[3]
    return max(-min(ddf, last), 0.0), max(max(ddf, last), 0.0)
