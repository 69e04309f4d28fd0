"""What the processor can do at once: in plain Python here, in kernels `sim.compiler` knows the instructions."""

from fractions import Fraction
from math import isfinite


def prefetch(array, place):
    """Have 64 bytes of an array brought into the cache, from a place along its first axis on, to be there when they are read; any place
    will do."""


def lowest_bit(mask):
    """The number of the lowest bit that is set, of some."""
    return (int(mask) & -int(mask)).bit_length() - 1


def no_later(times):
    """Of the times (2 WIDE,) float32, see `sim.tree`, a bit for each of the first half that is not after its like in the second."""
    half = len(times) // 2
    return sum(1 << c for c in range(half) if times[c] <= times[half + c])


def fma(a, b, c):
    """a b + c, rounded once."""
    if not (isfinite(a) and isfinite(b) and isfinite(c)):
        return a * b + c
    try:
        return float(Fraction(a) * Fraction(b) + Fraction(c))
    except OverflowError:
        return a * b + c
