"""The classical Runge-Kutta method of fourth order, for position and velocity as one system of first order."""

from sim.curves.cubic import hermite
from sim.forces import acceleration
from sim.integrators import Method
from sim.vector import axpy

METHOD = Method(
    curve="cubic",
    order=4,
    oscillator_limit=2.8284,
    drag_limit=2.7853,
    evaluations=4,
    symplectic=False,
    reference="Hairer, Norsett, Wanner 1993, doi:10.1007/978-3-540-78862-1, table II.1.2",
)


def step(h, t, x, v, forces):
    a = acceleration(t, x, v, forces)
    v2 = axpy(h / 2, a, v)
    a2 = acceleration(t + h / 2, axpy(h / 2, v, x), v2, forces)
    v3 = axpy(h / 2, a2, v)
    a3 = acceleration(t + h / 2, axpy(h / 2, v2, x), v3, forces)
    v4 = axpy(h, a3, v)
    a4 = acceleration(t + h, axpy(h, v3, x), v4, forces)
    return (
        axpy(h / 6, axpy(2.0, axpy(1.0, v2, v3), axpy(1.0, v, v4)), x),
        axpy(h / 6, axpy(2.0, axpy(1.0, a2, a3), axpy(1.0, a, a4)), v),
    )


def interpolant(h, x, v, a, x1, v1):
    return hermite(h, x, v, x1, v1)
