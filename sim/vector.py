"""Three-vectors as tuples: the compiler keeps them in registers, and formulas read as they are written."""


def axpy(a, x, y):
    """a x + y."""
    return a * x[0] + y[0], a * x[1] + y[1], a * x[2] + y[2]


def scale(a, x):
    return a * x[0], a * x[1], a * x[2]


def sub(x, y):
    return x[0] - y[0], x[1] - y[1], x[2] - y[2]


def dot(x, y):
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
