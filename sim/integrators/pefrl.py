"""Position-extended Forest-Ruth-like: symplectic, of order 4, with the coefficients of least error. Drag is part of the kicks,
which change v at a fixed place: by exp(-z), z = b h, taken as (1 - z/2 + z^2/12)/(1 + z/2 + z^2/12), of order 4 and symmetric."""

from sim.curves.cubic import hermite
from sim.forces import acceleration, rates
from sim.integrators import Method
from sim.vector import axpy

METHOD = Method(
    curve="cubic",
    order=4,
    oscillator_limit=2.9894,
    drag_limit=8.9069,
    evaluations=4,
    symplectic=True,
    reference="Omelyan, Mryglod, Folk 2002, doi:10.1016/S0010-4655(02)00451-4",
    reversible=True,
)

XI, LAMBDA, CHI = 0.1786178958448091, -0.2123418310626054, -0.06626458266981849


def kick(h, t, x, v, forces):
    """v after h (s) at the place x."""
    _, b = rates(t, x, forces)
    z = b * h
    return axpy(h / (1.0 + z * (0.5 + z / 12)), acceleration(t, x, v, forces), v)


def step(h, t, x, v, forces):
    x = axpy(XI * h, v, x)
    v = kick((0.5 - LAMBDA) * h, t + XI * h, x, v, forces)
    x = axpy(CHI * h, v, x)
    v = kick(LAMBDA * h, t + (XI + CHI) * h, x, v, forces)
    x = axpy((1.0 - 2.0 * (XI + CHI)) * h, v, x)
    v = kick(LAMBDA * h, t + (1.0 - XI - CHI) * h, x, v, forces)
    x = axpy(CHI * h, v, x)
    v = kick((0.5 - LAMBDA) * h, t + (1.0 - XI) * h, x, v, forces)
    return axpy(XI * h, v, x), v


def interpolant(h, x, v, a, x1, v1):
    return hermite(h, x, v, x1, v1)
