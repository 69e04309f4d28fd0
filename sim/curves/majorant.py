"""The first fall of a function through zero, found without missing one.

Let g >= 0 at s and g'' >= -m on [s, end]. By Taylor's theorem g(s + d) >= g + g' d - m d^2/2, so g has no zero before the
parabola on the right has its first one, and the search may go there at once; on the way to a zero it converges from
the left, quadratically where g' < 0, linearly to a double one. A step never passes a zero, so none is missed. In
floating point g is known up to some `noise`; the step is taken from g + noise instead, so that it has a least length and the
search ends, and what it may pass is a dip less deep than the noise.
"""

import numpy as np

from sim.curves.oscillation import bend, dip, point, value  # bound to the curve's own before they are compiled
from sim.vector import scale, sub

EPS = np.finfo(float).eps
MOST = 10_000  # steps of a search; some ten is usual, a double zero takes a hundred
PATIENCE = 100  # steps after which it may be from a triple zero, or along a surface, and other bounds are tried
LEAST = 1e-4  # of a curve, the shortest chord; most are a hundredth and more


def stride(g, dg, m, noise):
    """How far (s) the search may go from where the function is g with slope dg, its second derivative at least -m."""
    g = max(g, 0.0) + noise
    root = np.sqrt(dg * dg + 2.0 * m * g)
    if dg < 0.0:
        return 2.0 * g / (root - dg)
    return (dg + root) / m if m > 0.0 else np.inf


def polish(t, g, dg, m, noise):
    """A zero near t, where the function is g, no more than `noise` from it, with slope dg < 0: one step of Newton's method,
    no longer than such a g can be from a zero."""
    longest = 2.0 * np.sqrt(2.0 * noise / m) if m > 0.0 else np.inf
    return t + min(max(g / -dg, -longest), longest)


def fall(line, s, end, below):
    """The `fall` of curves without a formula for it: search for the rise where the function is below zero, then for the fall."""
    for k in range(MOST):
        g, dg, ddg, noise = value(line, s)
        down, up = dip(line, dg, ddg, s, end)
        f, df, m = (-g, -dg, up) if below else (g, dg, down)
        if f <= noise and df < 0.0:
            if not below:
                return polish(s, f, df, m, noise)
            below = False
            continue
        step = max(stride(f, df, m, noise), EPS * end)  # from a double zero on, there is no noise to step over
        if k >= PATIENCE:  # from a triple one it would hardly get away
            step = max(step, nearer(line, g, dg, ddg, noise, below, s, end))
        s += step
        if not s <= end:
            return np.inf
    return s


def nearer(line, g, dg, ddg, noise, below, s, end):
    """The longest step by bounds of the second derivative that hold over a half of what is left, over a quarter, and so on."""
    longest, reach = 0.0, 0.5 * (end - s)
    while reach > max(longest, EPS * end):
        down, up = dip(line, dg, ddg, s, s + reach)
        step = stride(-g, -dg, up, noise) if below else stride(g, dg, down, noise)
        longest, reach = max(longest, min(step, reach)), 0.5 * reach
    return longest


def chord(curve, s, end, off):
    """The `piece` of curves in general: a chord that the curve leaves by no more than `off` (m), since that is at most
    max |x''| length^2 / 8; by more, where it would have no LEAST part of the curve: a step that diverges bends without a bound."""
    length = end - s
    least = LEAST * end
    sagitta = 0.125 * bend(curve, s, end) * length * length
    while sagitta > off and length > least:
        length *= max(0.1, 0.99 * np.sqrt(off / sagitta))
        sagitta = 0.125 * bend(curve, s, s + length) * length * length
    x = point(curve, s)
    v = scale(1.0 / length, sub(point(curve, s + length), x))
    return length, (x, v, (0.0, 0.0, 0.0)), sagitta
