"""Symplectic Euler, velocity first; the original's method 1, which it calls "backward Euler"."""

from sim.forces import acceleration
from sim.integrators import Method
from sim.vector import axpy, scale

METHOD = Method(
    curve="parabola",
    order=1,
    oscillator_limit=2.0,
    drag_limit=2.0,
    evaluations=1,
    symplectic=True,
    reference="Hairer, Lubich, Wanner 2003, doi:10.1017/S0962492902000144, eq. 1.9",
)


def step(h, t, x, v, forces):
    v = axpy(h, acceleration(t, x, v, forces), v)
    return axpy(h, v, x), v


def interpolant(h, x, v, a, x1, v1):
    return x, v, scale(2.0, a)
