"""What the processor can do at once: in plain Python here, in kernels `sim.compiler` knows the instructions."""


def prefetch(array, row):
    """Have the first 64 bytes of a row of an array (n, k) brought into the cache, to be there when they are read; any row will do."""


def lowest_bit(mask):
    """The number of the lowest bit that is set, of some."""
    return (int(mask) & -int(mask)).bit_length() - 1
