"""First touch as it must come out, in many digits, from the very numbers that a kernel gets.

Along a parabola or a cubic the gaps are polynomials whose coefficients are floats. Nothing here rounds: they are fractions, and
the roots are isolated in Bernstein form by Descartes' rule of signs (Lane and Riesenfeld 1981), to 21 digits. Along an oscillation
they are looked for on a fine grid, and in 120 digits wherever the grid tells that there may be one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from math import comb, inf, lcm
from operator import mul
from typing import NamedTuple

import gmpy2
import numpy as np
from gmpy2 import mpfr, mpq

from sim.geometry import EDGE
from sim.packed import ALONG, LENGTH, NORMAL, POINT, SIDES, START, axis_of, segments

gmpy2.get_context().precision = 400  # of every mpfr: 120 digits
EPS = np.finfo(float).eps
GRID = 1024


class Touch(NamedTuple):
    """A ball may touch a feature here, coming from where it does not."""

    time: float  # s
    item: int
    speed: float  # m/s, of approach
    push: float  # m/s^2, of approach
    sure: bool  # not so: beside the outline, or from contact at a speed, by what is rounding


def size_of(packed, x, radius) -> float:
    """How large (m) the numbers are that gaps are made of."""
    places = np.concatenate([packed.faces[:, POINT : POINT + 3], packed.edges[:, START : START + 3]])
    return float(np.abs(x).sum() + np.abs(places).sum(axis=1).max() + radius)


def inside(packed, f, x) -> tuple[bool, bool]:
    """Whether a point of the plane of face f is in its outline or on it; and whether it is so, or beside it by rounding only."""
    first, last = segments(packed.faces, packed.outline, f)
    axis = int(axis_of(packed.faces, packed.outline, f))
    u, v = mpq(x[(axis + 1) % 3]), mpq(x[(axis + 2) % 3])
    odd, close, near = first == last, first == last, 4 * EDGE * sum(abs(float(c)) for c in x)
    for u0, v0, u1, v1 in packed.outline[first:last].tolist():
        du, dv, a, b = u1 - u0, v1 - v0, u - u0, v - v0
        side = (mpq(u1) - u0) * b - (mpq(v1) - v0) * a
        if (v0 > v) != (v1 > v) and (side > 0) == (dv > 0):
            odd = not odd
        if side == 0 and min(u0, u1) <= u <= max(u0, u1) and min(v0, v1) <= v <= max(v0, v1):
            return True, True
        share = min(max((float(a) * du + float(b) * dv) / (du * du + dv * dv), 0.0), 1.0)
        close |= bool(np.hypot(float(a) - share * du, float(b) - share * dv) <= near)
    return odd, odd or close


# Polynomials: lists of coefficients, the constant first.


def at(p, s):
    total = p[-1]
    for c in p[-2::-1]:
        total = total * s + c
    return total


def times(p, q):
    return [sum(p[j] * q[i - j] for j in range(len(p)) if 0 <= i - j < len(q)) for i in range(len(p) + len(q) - 1)]


def plus(a, p, q):
    """a p + q, p no longer than q."""
    return [a * p[i] + c if i < len(p) else c for i, c in enumerate(q)]


def prime(p):
    return [i * c for i, c in enumerate(p)][1:] or [p[0] * 0]


@cache
def bernstein(n) -> tuple[tuple[int, ...], ...]:
    """What makes a multiple of the Bernstein coefficients of the coefficients of a polynomial of degree n."""
    common = lcm(*(comb(n, i) for i in range(n + 1)))
    return tuple(tuple(comb(j, i) * (common // comb(n, i)) for i in range(j + 1)) for j in range(n + 1))


def falls(p, end) -> Iterator:
    """All s in [0, end] at which p goes from >= 0 to below, in order."""
    parts = [c * end**i for i, c in enumerate(p)]
    most = max(c.denominator.bit_length() for c in parts)  # powers of two
    whole = [c.numerator << (most - c.denominator.bit_length()) for c in parts]
    n = len(p) - 1
    todo = [(0, 0, [sum(map(mul, row, whole)) for row in bernstein(n)])]
    while todo:
        k, depth, b = todo.pop()  # the part [k, k + 1] / 2^depth of the whole
        above = [c >= 0 for c in b]
        changes = sum(one != other for one, other in zip(above, above[1:]))
        if changes == 0 or (changes == 1 and not above[0]) or depth > 400:
            continue
        if changes == 1:
            while k.bit_length() <= 70 and depth <= 300:
                k, depth, value = 2 * k, depth + 1, 0
                for i, c in enumerate(reversed(whole)):
                    value = value * (k + 1) + (c << i * depth)
                k += value >= 0
            yield end * mpq(k, 1 << depth)
            continue
        left, right = [b[0] << n], [b[-1] << n]
        for j in range(1, n + 1):
            b = [one + other for one, other in zip(b, b[1:])]
            left.append(b[0] << (n - j))
            right.append(b[-1] << (n - j))
        todo += [(2 * k + 1, depth + 1, right[::-1]), (2 * k, depth + 1, left)]


def touches(curve, packed, radius, end, ignored=()) -> list[Touch]:
    """The touches up to `end` (s), the earliest first, of a ball on x(s) = curve[0] + curve[1] s + ..., three floats each."""
    # none that rounding could hide is told apart from contact at the start
    contact = 8 * EPS * size_of(packed, np.array(curve[0]), radius)
    fast = float(np.linalg.norm(curve[1]))
    x = [[mpq(c[k]) for c in curve] for k in range(3)]
    radius, end, found = mpq(radius), mpq(end), []

    def away(p):
        """The polynomials of x - p."""
        return [[x[k][0] - p[k], *x[k][1:]] for k in range(3)]

    def along(axis, off):
        return [sum(axis[k] * off[k][i] for k in range(3)) for i in range(len(curve))]

    def keep(item, g, scale, least, where: Callable):
        """Add the touches where g falls; `scale` g is the gap near its zeros, and g no less than `least` if not behind."""
        nonlocal end
        if abs(g[0]) * scale <= contact:
            g = [mpq(0), *g[1:]]
        dg = prime(g)
        sinks = dg[0] < 0 or (dg[0] == 0 and at(prime(dg), 0) < 0)
        for s in [*([mpq(0)] if least <= g[0] < 0 and sinks else []), *falls(g, end)]:
            sure, possible = where(s)
            if possible:
                speed, push = -scale * at(dg, s), -scale * at(prime(dg), s)
                sure &= s > 1e-14 * end or speed == 0 or bool(speed > 8 * EPS * fast)
                found.append(Touch(float(s), item, float(speed), float(push), sure))
            if sure:
                end = min(end, mpq(1.001 * float(s) + 1e-9))  # what comes later does not matter
                return

    n = len(packed.faces)
    for f in set(range(n)).difference(ignored):
        row = packed.faces[f].tolist()
        normal = [mpq(c) for c in row[NORMAL : NORMAL + 3]]
        height = along(normal, away([mpq(c) for c in row[POINT : POINT + 3]]))
        for side in (1, -1)[: int(row[SIDES])]:

            def foot(s, f=f, height=height, normal=normal):
                h = at(height, s)
                return inside(packed, f, [at(c, s) - h * m for c, m in zip(x, normal)])

            keep(f, plus(-1, [radius], [side * c for c in height]), 1, -radius, foot)
    for e in set(range(len(packed.edges))).difference(i - n for i in ignored):
        row = packed.edges[e].tolist()
        axis, length, off = [mpq(c) for c in row[ALONG : ALONG + 3]], mpq(row[LENGTH]), away([mpq(c) for c in row[START : START + 3]])
        share, unit = along(axis, off), sum(a * a for a in axis)
        square = plus(-radius, [radius], [sum(c) for c in zip(*(times(c, c) for c in off))])
        slack = mpq(1e-18) * (1 + end)
        for low, high, g in (
            (-inf, 0, square),
            (0, length, plus(unit - 2, times(share, share), square)),
            (length, inf, plus(length * length * unit, [mpq(1)], plus(-2 * length, share, square))),
        ):

            def there(s, low=low, high=high, share=share, slack=slack):
                return (low - slack <= at(share, s) <= high + slack,) * 2

            keep(n + e, g, 1 / (2 * radius), -inf, there)
    return sorted(found)


# Oscillations.


def response(b, w2, s):
    """p, q and p', see `sim.curves.oscillation`."""
    b, w2, s = mpfr(b), mpfr(w2), mpfr(s)
    h, square = b / 2, b * b / 4 - w2
    r = gmpy2.sqrt(abs(square))
    if square > 0:
        slow, fast = gmpy2.exp(-w2 / (h + r) * s), gmpy2.exp(-(h + r) * s)
        p, dp = (slow - fast) / (2 * r), ((h + r) * fast - w2 / (h + r) * slow) / (2 * r)
    else:
        decay, (w, c) = gmpy2.exp(-h * s), gmpy2.sin_cos(r * s)
        p = decay * (w / r if r else s)
        dp = decay * c - h * p
    return p, (1 - dp - b * p) / w2 if w2 else (s - p) / b if b else s * s / 2, dp


def grid(b, w2, step, n):
    """p, q and p' in doubles at 0, step, ..., n step, by the powers of the flow; n is a power of two."""
    p, q, dp = (float(c) for c in response(b, w2, step))
    flow = np.array([[1 - w2 * q, p, q], [-w2 * p, dp, p], [0, 0, 1]])
    state = np.array([[0.0, 0.0, 1.0]])
    while len(state) < n:
        state, flow = np.concatenate([state, state @ flow.T]), flow @ flow
    q, p, _ = np.concatenate([state, (flow @ state[0])[None]]).T
    return p, q, 1 - b * p - w2 * q


def between(f, low, high):
    """The root of f between, to 1e-36 of the way: by halving, as a gap may have a kink where the ball gets past an edge's end."""
    above = f(low) > 0
    for _ in range(120):
        middle = (low + high) / 2
        low, high = (middle, high) if (f(middle) > 0) == above else (low, middle)
    return low


def falls_along(gap, speed, g, dg, step, contact, least) -> Iterator:
    """The `falls` of the function `gap` with slope `speed`, which are `g` and `dg` on the grid."""
    sinks = dg[0] < 0 or (dg[0] == 0 and dg[1] < 0)
    if sinks and least <= g[0] <= contact:
        yield mpfr(0)
    if abs(g[0]) <= contact:
        g[0] = -1e-300 if sinks else 1e-300
    g0, g1, dg0, dg1 = g[:-1], g[1:], dg[:-1], dg[1:]
    through = (g0 > 0) & (g1 <= 0)
    reach = np.minimum(abs(g0), abs(g1)) <= step * np.maximum(abs(dg0), abs(dg1))
    dips = reach & (g0 > 0) & (g1 > 0) & (dg0 < 0) & (dg1 > 0)
    tops = reach & (g0 <= 0) & (g1 <= 0) & (dg0 > 0) & (dg1 < 0)
    for i in np.flatnonzero(through | dips | tops):
        low, high = mpfr(i * step), mpfr((i + 1) * step)
        if tops[i] or (through[i] and i == 0 and g[0] <= contact and dg[0] > 0):
            low = between(speed, low, high)
        elif dips[i]:
            high = between(speed, low, high)
        if gap(low) <= 0 or gap(high) >= 0:
            continue
        yield between(gap, low, high)


def touches_swinging(curve, packed, radius, end) -> list[Touch]:
    """The first touches of each feature on the oscillation (x, v, k, b, w2)."""
    x, v, k, b, w2 = curve
    step, found = end / (GRID - 0.5137), []  # so that no touch is on the grid but by accident
    contact = 8 * EPS * size_of(packed, np.array(x), radius)
    p, q, dp = (column[:, None] for column in grid(b, w2, step, GRID))
    xs, vs = np.array(x) + p * v + q * k, dp * v + p * k
    exact = [[mpfr(c) for c in row] for row in (x, v, k)]

    def state(s):
        p, q, dp = response(b, w2, s)
        return [a + p * u + q * c for a, u, c in zip(*exact)], [dp * u + p * c for _, u, c in zip(*exact)]

    def keep(item, gap_to, gs, dgs, least, where):
        """`gap_to`(x, v) is the gap and its slope."""
        for s in falls_along(lambda s: gap_to(*state(s))[0], lambda s: gap_to(*state(s))[1], gs, dgs, step, contact, least):
            sure, possible = where(state(s)[0])
            if possible and s <= end:
                speed = -gap_to(*state(s))[1]
                sure &= s > 0 or speed == 0 or bool(speed > 8 * EPS * np.linalg.norm(v))
                found.append(Touch(float(s), item, float(speed), float(speed + gap_to(*state(s + step))[1]) / step, sure))
                return

    def dot(a, c):
        return sum(i * j for i, j in zip(a, c))

    n = len(packed.faces)
    for f in range(n):
        normal, point = ([mpfr(c) for c in packed.faces[f, i : i + 3]] for i in (NORMAL, POINT))

        def foot(x, f=f, normal=normal, point=point):
            h = dot(normal, [c - a for c, a in zip(x, point)])
            return inside(packed, f, [c - h * m for c, m in zip(x, normal)])

        for side in (1, -1)[: int(packed.faces[f, SIDES])]:

            def gap(x, v, side=side, normal=normal, point=point):
                return side * dot(normal, [c - a for c, a in zip(x, point)]) - radius, side * dot(normal, v)

            m = side * packed.faces[f, NORMAL : NORMAL + 3]
            keep(f, gap, (xs - packed.faces[f, POINT : POINT + 3]) @ m - radius, vs @ m, -radius, foot)
    for e in range(len(packed.edges)):
        row = packed.edges[e]
        start, axis = ([mpfr(c) for c in row[i : i + 3]] for i in (START, ALONG))

        def gap(x, v, start=start, axis=axis, length=mpfr(row[LENGTH])):
            off = [c - a for c, a in zip(x, start)]
            share = min(max(dot(off, axis), 0), length)
            off = [c - share * a for c, a in zip(off, axis)]
            distance = gmpy2.sqrt(dot(off, off))
            return distance - radius, dot(off, v) / distance

        off = xs - row[START : START + 3]
        off -= np.clip(off @ row[ALONG : ALONG + 3], 0, row[LENGTH])[:, None] * row[ALONG : ALONG + 3]
        distance = np.linalg.norm(off, axis=1)
        keep(n + e, gap, distance - radius, (off * vs).sum(axis=1) / distance, -inf, lambda x: (True, True))
    return sorted(found)
