"""Symplectic Euler, position first; the original's method 2, which it calls "semi-implicit"."""

from sim.forces import acceleration
from sim.integrators import Method
from sim.vector import axpy

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
    x = axpy(h, v, x)
    return x, axpy(h, acceleration(t, x, v, forces), v)


def interpolant(h, x, v, a, x1, v1):
    return x, v, (0.0, 0.0, 0.0)
