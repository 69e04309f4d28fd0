"""Flight under x'' = c - b x' - w2 x with constant b, w2 >= 0, in closed form: drag, a spring, or both.

    x(s) = x + v p(s) + k q(s),   k = c - w2 x

with the two functions of (b, w2) that all axes share, q'' = 1 - b q' - w2 q, q(0) = q'(0) = 0 and p = q'.
Without drag and spring p = s and q = s^2/2.
"""

import numpy as np

from sim.vector import across, axpy, dot, gap, norm, scale, sub

EPS = np.finfo(float).eps
SMALL = 0.5  # the series converges to rounding in TERMS terms up to here
TERMS = 17
INVERSE = np.array([0.0] + [1.0 / n for n in range(1, TERMS)])


def response(b, w2, s):
    """p, q and p' at s: the power series over a time so short that it converges at once, doubled until it is s.

    The doubling is the flow's group property: from the state p or q at s, the motion goes on for s more. It is as accurate
    near critical damping, for tiny and for huge b and w2 as elsewhere, which no formula with exponentials is.
    """
    size, doublings = (b + np.sqrt(w2)) * s, 0
    while size > SMALL and doublings < 1000:
        size, doublings = 0.5 * size, doublings + 1
    s = s * 0.5**doublings
    bs, w2s = b * s, w2 * s * s
    before, term = 0.0, 0.5 * s * s
    q, ps = term, 2.0 * term
    for n in range(3, TERMS):
        before, term = term, -INVERSE[n] * (bs * term + w2s * INVERSE[n - 1] * before)
        q += term
        ps += n * term
    p = ps / s if s > 0.0 else 0.0
    dp = 1.0 - b * p - w2 * q
    for _ in range(doublings):
        c = 1.0 - w2 * q if w2 * q < 0.5 else dp + b * p  # the same, whichever rounds less
        p, q, dp = p * (dp + c), q + p * p + c * q, dp * dp - w2 * p * p
    return p, q, dp


def flight(x, v, k, b, w2):
    """The curve from position x (m) at velocity v (m/s) under x'' = k - b x' - w2 (x - x(0))."""
    return x, v, k, b, w2


def point(curve, s):
    x, v, k, b, w2 = curve
    p, q, _ = response(b, w2, s)
    return axpy(q, k, axpy(p, v, x))


def slope(curve, s):
    x, v, k, b, w2 = curve
    p, _, dp = response(b, w2, s)
    return axpy(p, k, scale(dp, v))


def bend(curve, s, end):
    """|x''(s + t)| = |x''(s) p'(t) - w2 x'(s) p(t)|, where |p'| <= 1 and |p| <= min(t, 1/sqrt(w2)), as the energy
    p'^2 + w2 p^2 only falls."""
    x, v, k, b, w2 = curve
    p, q, dp = response(b, w2, s)
    v1 = axpy(p, k, scale(dp, v))
    a1 = axpy(-b, v1, axpy(-w2 * p, v, scale(1.0 - w2 * q, k)))
    return norm(a1) + w2 * norm(v1) * longest(w2, end - s)


def series(curve, s, t):
    """The `series` of the other curves, cut off. The n-th coefficient is at most b t/n times the last and w2 t^2/(n (n - 1)) times
    the one before. So while (b + sqrt(w2)) t <= 1/2, of the larger of the last two here the next is at most 1/16, all that follow
    make 1/12, and in the slope, n times each, 2/3."""
    x, v, k, b, w2 = curve
    p, q, _ = response(b, w2, s)
    one = scale(t, slope(curve, s))
    two = scale(0.5 * t, axpy(-b, one, scale(t, axpy(-w2, axpy(q, k, scale(p, v)), k))))
    bt, wt = -b * t, -w2 * t * t
    three = axpy(bt / 3.0, two, scale(wt / 6.0, one))
    four = axpy(bt / 4.0, three, scale(wt / 12.0, two))
    five = axpy(bt / 5.0, four, scale(wt / 20.0, three))
    six = axpy(bt / 6.0, five, scale(wt / 30.0, four))
    seven = axpy(bt / 7.0, six, scale(wt / 42.0, five))
    rest = max(norm(six), norm(seven)) if (b + np.sqrt(w2)) * t <= 0.5 else np.inf
    return (point(curve, s), one, two, three, four, five, six, seven), rest


def longest(w2, t):
    """The largest |p| up to the time t."""
    return min(t, 1.0 / np.sqrt(w2)) if w2 > 0.0 else t


def seen_from(curve, p):
    """The curve of x - p."""
    x, v, k, b, w2 = curve
    return sub(x, p), v, k, b, w2


def seen_along(curve, n):
    """The part of the curve across the unit vector n."""
    x, v, k, b, w2 = curve
    return across(n, x), across(n, v), across(n, k), b, w2


def project(curve, n, p, offset):
    x, v, k, b, w2 = curve
    return gap(n, x, p, offset), dot(n, v), dot(n, k), b, w2


def start(line):
    f, u, k, b, _ = line
    return f, u, k - b * u


def value(line, s):
    """f, f', f'' at s, and how well f is known."""
    f, u, k, b, w2 = line
    p, q, dp = response(b, w2, s)
    df = u * dp + k * p
    noise = (4.0 + (b + np.sqrt(w2)) * s) * EPS * (abs(f) + abs(u * p) + abs(k * q))
    return f + u * p + k * q, df, k - b * df - w2 * (u * p + k * q), noise


def dip(line, df, ddf, s, end):
    """m with f'' >= -m and (-f)'' >= -m on [s, end], see `bend`; where only drag acts f'' keeps its sign and dies away."""
    w2 = line[4]
    if w2 == 0.0:
        return max(-ddf, 0.0), max(ddf, 0.0)
    m = abs(ddf) + w2 * abs(df) * longest(w2, end - s)
    return m, m
