"""How long a curve surely keeps away from a segment, or moves away from it: told by its power series.

The bound by the second derivative, see `sim.curves.majorant`, is poor where a curve goes along a surface: its second derivative
is large, but that of the distance is not. The square of the distance to a line or point has a power series of its own, the
product of the curve's with itself, and no more than its negative coefficients can take it down.
"""

from sim.curves.parabola import seen_along, seen_from, series  # bound to the curve's own before they are compiled
from sim.vector import dot, norm, scale


def stays_off(near, axis, length, radius, s, end, least, noise):
    """How long (s) from s on the curve, `end` at most, surely does not come down to `radius` (m) from the segment of `length` (m)
    along the unit vector `axis` from the origin, to `noise` (m); zero if for no longer than `least`.

    While its foot stays beyond an end of the segment, the distance is that to the end; else no less than that to the line.
    """
    t = end - s
    while t > least:
        x, rest = series(near, s, t)
        low = high = dot(x[0], axis)
        for k in range(1, len(x)):
            a = dot(x[k], axis)
            low, high = low + min(a, 0.0), high + max(a, 0.0)
        low, high = low - rest, high + rest
        alone = True  # and the distance is that, throughout
        if low >= length:
            x, rest = series(seen_from(near, scale(length, axis)), s, t)
        elif high > 0.0:
            x, rest = series(seen_along(near, axis), s, t)
            alone = low >= 0.0 and high <= length
        if keeps_off(x, rest, radius, noise, alone):
            return t
        t *= 0.5
    return 0.0


def keeps_off(x, rest, radius, noise, alone):
    """Whether |x| stays above `radius` (m), to `noise`, or, if it is all there is, rises throughout: x by its `series`."""
    n, sizes, fall, rise = len(x), 0.0, 0.0, 0.0
    for k in range(n):
        sizes += (1 + k) * norm(x[k])
    for k in range(1, 2 * n - 1):
        c = 0.0
        for i in range(max(0, k - n + 1), min(k, n - 1) + 1):
            c += dot(x[i], x[k - i])
        fall += min(c, 0.0)
        rise += k * (c if k == 1 else min(c, 0.0))
    distance, missing = norm(x[0]), 2.0 * rest * (sizes + rest)
    return (distance - radius + noise) * (distance + radius) + fall >= missing or (alone and rise > missing)
