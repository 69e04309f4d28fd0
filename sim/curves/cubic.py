"""x(s) = x + v s + c s^2 + d s^3 for 0 <= s <= h: the interpolant of a method of order 4."""

from sim.vector import axpy, larger, scale, size, sub

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


def as_quintic(curve):
    """It as a curve of `sim.curves.quintic`."""
    x, v, c, d = curve
    zero = (0.0, 0.0, 0.0)
    return x, v, c, d, zero, zero


def bends(curve, s, end):
    """x'' is linear, so each part of it is largest at an end."""
    _, _, c, d = curve
    return scale(2.0, larger(size(axpy(3.0 * s, d, c)), size(axpy(3.0 * end, d, c))))
