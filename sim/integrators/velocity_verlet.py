"""Velocity Verlet. The acceleration at the end of a step is that at the start of the next, and carried there. With drag the new
velocity is in its own acceleration, and found in closed form (Brunger, Brooks, Karplus 1984, doi:10.1016/0009-2614(84)80098-6)."""

from sim.forces import acceleration, rates
from sim.integrators import Method
from sim.vector import axpy, scale

METHOD = Method(
    curve="parabola",
    order=2,
    oscillator_limit=2.0,
    drag_limit=float("inf"),
    evaluations=1,
    symplectic=True,
    reference="Swope, Andersen, Berens, Wilson 1982, doi:10.1063/1.442716",
    reversible=True,
)


def carried(h, t, x, v, a, forces):
    v = axpy(h / 2, a, v)
    x = axpy(h, v, x)
    _, b = rates(t + h, x, forces)
    a = acceleration(t + h, x, (0.0, 0.0, 0.0), forces)
    v = scale(1.0 / (1.0 + h / 2 * b), axpy(h / 2, a, v))
    return x, v, axpy(-b, v, a)


def step(h, t, x, v, forces):
    x, v, _ = carried(h, t, x, v, acceleration(t, x, v, forces), forces)
    return x, v


def interpolant(h, x, v, a, x1, v1):
    return x, v, a
