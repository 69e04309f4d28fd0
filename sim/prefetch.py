"""What a kernel may tell the processor's cache."""


def prefetch(array, row):
    """Have the first 64 bytes of a row of an array (n, k) brought into the cache, to be there when they are read; any row will do.

    In plain Python nothing; `sim.compiler` knows the instruction.
    """
