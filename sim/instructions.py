"""What the processor can do at once: in plain Python here, in kernels `sim.compiler` knows the instructions."""

from fractions import Fraction
from math import isfinite


def prefetch(array, row):
    """Have the first 64 bytes of a row of an array (n, k) brought into the cache, to be there when they are read; any row will do."""


def lowest_bit(mask):
    """The number of the lowest bit that is set, of some."""
    return (int(mask) & -int(mask)).bit_length() - 1


def no_later(times):
    """Of 32 times a bit for each of the first 16 that is not after the one 16 places on."""
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
