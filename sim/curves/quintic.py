"""x(s) = x + v s + c s^2 + d s^3 + e s^4 + f s^5 for 0 <= s <= h: the interpolant of a method of order 5, and as which that of any
other is handed on."""

import numpy as np

from sim.curves.cubic import SHORT
from sim.curves.majorant import chord
from sim.curves.majorant import fall as search
from sim.curves.parabola import fall as formula
from sim.curves.parabola import is_path
from sim.vector import across, axpy, dot, gap, larger, scale, size, sub

EPS = np.finfo(float).eps


def hermite(h, x, v, a, x1, v1, a1):
    """The quintic from position x (m), velocity v (m/s) and acceleration a (m/s^2) to x1, v1 and a1 after h (s); within
    h^6/46080 of the sixth derivative of what it interpolates, its slope within about h^5/13400."""
    # how far the end is from where constant acceleration leads, in units of m: the three conditions at s = h
    p = sub(x1, axpy(h, axpy(0.5 * h, a, v), x))
    q = scale(h, sub(v1, axpy(h, a, v)))
    r = scale(0.5 * h * h, sub(a1, a))
    d = axpy(10.0, p, axpy(-4.0, q, r))
    e = axpy(-15.0, p, axpy(7.0, q, scale(-2.0, r)))
    f = axpy(6.0, p, axpy(-3.0, q, r))
    if not h > SHORT:
        return flight(x, v, a, 0.0, 0.0)
    cube = 1.0 / (h * h * h)
    return x, v, scale(0.5, a), scale(cube, d), scale(cube / h, e), scale(cube / (h * h), f)


def flight(x, v, k, b, w2):
    """The curve from position x (m) at velocity v (m/s) under the constant acceleration k (m/s^2)."""
    zero = (0.0, 0.0, 0.0)
    return x, v, scale(0.5, k), zero, zero, zero


def as_quintic(curve):
    return curve


def point(curve, s):
    x, v, c, d, e, f = curve
    return axpy(s, axpy(s, axpy(s, axpy(s, axpy(s, f, e), d), c), v), x)


def slope(curve, s):
    _, v, c, d, e, f = curve
    return axpy(s, axpy(s, axpy(s, axpy(1.25 * s, scale(4.0, f), scale(4.0, e)), scale(3.0, d)), scale(2.0, c)), v)


def bend(curve, s, end):
    first, second, third, last = hull(curve, s, end)
    return np.sqrt(max(max(dot(first, first), dot(second, second)), max(dot(third, third), dot(last, last))))


def bends(curve, s, end):
    first, second, third, last = hull(curve, s, end)
    return larger(larger(size(first), size(second)), larger(size(third), size(last)))


def hull(curve, s, end):
    """x'' is a cubic, which stays in the hull of these four control points on [s, end]."""
    _, _, c, d, e, f = curve
    t = end - s
    first = scale(2.0, axpy(s, axpy(s, axpy(s, scale(10.0, f), scale(6.0, e)), scale(3.0, d)), c))
    rise = scale(2.0 * t, axpy(s, axpy(s, scale(10.0, f), scale(4.0, e)), d))  # a third of the first derivative
    turn = scale(4.0 * t * t, axpy(5.0 * s, f, e))  # a sixth of the second
    second = axpy(1.0, first, rise)
    third = axpy(1.0, second, axpy(1.0, rise, turn))
    last = axpy(20.0 * t * t * t, f, axpy(3.0, turn, axpy(3.0, rise, first)))
    return first, second, third, last


def series(curve, s, t):
    """The coefficients (m) of x(s + u t) in powers of u, and how much (m) they leave out, of x and of its slope by u, where
    0 <= u <= 1."""
    _, _, c, d, e, f = curve
    second = scale(t * t, axpy(s, axpy(s, axpy(s, scale(10.0, f), scale(6.0, e)), scale(3.0, d)), c))
    third = scale(t * t * t, axpy(s, axpy(s, scale(10.0, f), scale(4.0, e)), d))
    fourth, fifth = scale(t * t * t * t, axpy(5.0 * s, f, e)), scale(t * t * t * t * t, f)
    return (point(curve, s), scale(t, slope(curve, s)), second, third, fourth, fifth), 0.0


def seen_from(curve, p):
    """The curve of x - p."""
    x, v, c, d, e, f = curve
    return sub(x, p), v, c, d, e, f


def seen_along(curve, n):
    """The part of the curve across the unit vector n."""
    x, v, c, d, e, f = curve
    return across(n, x), across(n, v), across(n, c), across(n, d), across(n, e), across(n, f)


def piece(curve, s, end, off):
    """As of a parabola where it is one, else a chord."""
    _, _, c, d, e, f = curve
    if dot(d, d) + dot(e, e) + dot(f, f) == 0.0 and is_path(c):
        return end - s, (point(curve, s), slope(curve, s), scale(2.0, c)), 0.0
    return chord(curve, s, end, off)


def project(curve, n, p, offset):
    x, v, c, d, e, f = curve
    return gap(n, x, p, offset), dot(n, v), dot(n, c), dot(n, d), dot(n, e), dot(n, f)


def start(line):
    return line[0], line[1], 2.0 * line[2]


def fall(line, s, end, below):
    """By the formula where it is a parabola's."""
    g, u, c, d, e, f = line
    if abs(d) + abs(e) + abs(f) == 0.0:
        return formula((g, u, 2.0 * c), s, end, below)
    return search(line, s, end, below)


def value(line, s):
    """f, f', f'' at s, and how well f is known."""
    g, u, c, d, e, f = line
    sizes = abs(g) + s * (abs(u) + s * (abs(c) + s * (abs(d) + s * (abs(e) + s * abs(f)))))
    return (
        g + s * (u + s * (c + s * (d + s * (e + s * f)))),
        u + s * (2.0 * c + s * (3.0 * d + s * (4.0 * e + s * 5.0 * f))),
        2.0 * c + s * (6.0 * d + s * (12.0 * e + s * 20.0 * f)),
        6.0 * EPS * sizes,
    )


def dip(line, df, ddf, s, end):
    """m with f'' >= -m, and m with (-f)'' >= -m, on [s, end]: by the control points of f'', as in `bend`."""
    _, _, _, d, e, f = line
    t = end - s
    rise = 2.0 * t * (d + s * (4.0 * e + s * 10.0 * f))
    turn = 4.0 * t * t * (e + 5.0 * s * f)
    second, third = ddf + rise, ddf + 2.0 * rise + turn
    last = ddf + 3.0 * rise + 3.0 * turn + 20.0 * t * t * t * f
    return max(-min(min(ddf, second), min(third, last)), 0.0), max(max(max(ddf, second), max(third, last)), 0.0)
