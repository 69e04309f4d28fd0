"""Forward Euler, the original's method 0."""

from sim.forces import acceleration
from sim.integrators import Method
from sim.vector import axpy

METHOD = Method(
    curve="parabola",
    order=1,
    oscillator_limit=0.0,
    drag_limit=2.0,
    evaluations=1,
    symplectic=False,
    reference="Hairer, Norsett, Wanner 1993, Solving Ordinary Differential Equations I, eq. I.7.3",
)


def step(h, t, x, v, forces):
    a = acceleration(t, x, v, forces)
    return axpy(h, v, x), axpy(h, a, v)


def interpolant(h, x, v, a, x1, v1):
    return x, v, (0.0, 0.0, 0.0)
