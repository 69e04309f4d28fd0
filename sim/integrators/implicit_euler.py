"""Backward Euler, the real one: x1 = x + h v1, v1 = v + h a(t1, x1, v1). The acceleration is affine in place and velocity, so
this has a closed form. Which fields act is told by the time of the step's end and the place of its start."""

from sim.forces import acceleration, rates
from sim.integrators import Method
from sim.vector import axpy, scale, sub

METHOD = Method(
    curve="parabola",
    order=1,
    oscillator_limit=float("inf"),
    drag_limit=float("inf"),
    evaluations=1,
    symplectic=False,
    reference="Hairer, Wanner 1996, doi:10.1007/978-3-642-05221-7, section IV.3",
)


def step(h, t, x, v, forces):
    w2, b = rates(t + h, x, forces)
    v = scale(1.0 / (1.0 + h * (b + h * w2)), axpy(h, acceleration(t + h, x, (0.0, 0.0, 0.0), forces), v))
    return axpy(h, v, x), v


def interpolant(h, x, v, a, x1, v1):
    return x, v, scale(2.0 / h, sub(v1, v))
