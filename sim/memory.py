"""Where numbers lie in memory."""

import numpy as np

LINE = 64  # bytes, of the processor's cache


def aligned(shape: tuple[int, ...], kind: type = float) -> np.ndarray:
    """An empty array that begins with a line of the cache: what is as long as some lines is in no more than these."""
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    raw = np.empty(size + LINE, np.uint8)
    first = -raw.ctypes.data % LINE
    return raw[first : first + size].view(kind).reshape(shape)
