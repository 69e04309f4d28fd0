"""What the processor can do at once: in plain Python here, in kernels `sim.compiler` knows the instructions."""

from fractions import Fraction
from math import isfinite

import numpy as np

from sim.tree import WIDE


def prefetch(array, place):
    """Have 64 bytes of an array brought into the cache, from a place along its first axis on, to be there when they are read; any place
    will do."""


def lowest_bit(mask):
    """The number of the lowest bit that is set, of some."""
    return (int(mask) & -int(mask)).bit_length() - 1


def no_later(times, place):
    """Of WIDE times from `place` on a bit for each that is not after its like among the next WIDE, see `sim.tree`."""
    return sum(1 << c for c in range(WIDE) if times[place + c] <= times[place + WIDE + c])


def fma(a, b, c):
    """a b + c, rounded once; in single precision of three in it, which plain Python very seldom rounds twice."""
    if isinstance(a, np.float32):
        with np.errstate(over="ignore", invalid="ignore"):
            return np.float32(np.float64(a) * np.float64(b) + np.float64(c))
    if not (isfinite(a) and isfinite(b) and isfinite(c)):
        return a * b + c
    try:
        return float(Fraction(a) * Fraction(b) + Fraction(c))
    except OverflowError:
        return a * b + c
