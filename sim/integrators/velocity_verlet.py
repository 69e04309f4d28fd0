"""Velocity Verlet. With drag the new velocity is in its own acceleration, and found in closed form (Brunger, Brooks, Karplus
1984, doi:10.1016/0009-2614(84)80098-6). The last acceleration is evaluated anew: to carry it along costs as much as a field that
is affine, and after a bounce or the edge of a field it would be wrong."""

from sim.forces import acceleration, rates
from sim.integrators import Method
from sim.vector import axpy, scale

METHOD = Method(
    curve="parabola",
    order=2,
    oscillator_limit=2.0,
    drag_limit=float("inf"),
    evaluations=2,
    symplectic=True,
    reference="Swope, Andersen, Berens, Wilson 1982, doi:10.1063/1.442716",
    reversible=True,
)


def step(h, t, x, v, forces):
    v = axpy(h / 2, acceleration(t, x, v, forces), v)
    x = axpy(h, v, x)
    _, b = rates(t + h, x, forces)
    v = axpy(h / 2, acceleration(t + h, x, (0.0, 0.0, 0.0), forces), v)
    return x, scale(1.0 / (1.0 + h / 2 * b), v)


def interpolant(h, t, x, v, x1, v1, forces):
    return x, v, acceleration(t, x, v, forces)
