"""The original's method 3, which it calls RK4. Each stage's velocity comes from its own acceleration instead of the last
one's: fourth order where the acceleration is constant (it is exact there), second order in every other field."""

from sim.curves.cubic import hermite
from sim.forces import acceleration
from sim.integrators import Method
from sim.vector import axpy

METHOD = Method(
    curve="cubic",
    order=2,
    oscillator_limit=2.0707,
    drag_limit=2.7853,
    evaluations=4,
    symplectic=False,
    reference="the course project that carom grew from",
)


def step(h, t, x, v, forces):
    a1 = acceleration(t, x, v, forces)
    a2 = acceleration(t + h / 2, axpy(h / 2, v, x), axpy(h / 2, a1, v), forces)
    v2 = axpy(h / 2, a2, v)
    a3 = acceleration(t + h / 2, axpy(h / 2, v2, x), v2, forces)
    v3 = axpy(h / 2, a3, v)
    a4 = acceleration(t + h, axpy(h, v3, x), axpy(h, a3, v), forces)
    v4 = axpy(h, a4, v)
    return (
        axpy(h / 6, axpy(2.0, axpy(1.0, v2, v3), axpy(1.0, v, v4)), x),
        axpy(h / 6, axpy(2.0, axpy(1.0, a2, a3), axpy(1.0, a1, a4)), v),
    )


def interpolant(h, x, v, a, x1, v1):
    return hermite(h, x, v, x1, v1)
