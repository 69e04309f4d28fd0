"""What an impact does to a ball: the law, and the energy it takes."""

from sim.vector import axpy, dot, scale


def restitution(mass: float, wall_mass: float) -> float:
    """The share of the normal speed that a ball of `mass` (kg) keeps: elastic collision with a free wall of `wall_mass`."""
    return (wall_mass - mass) / (wall_mass + mass)


def rebound(v, normal, e, damping):
    """Velocity after the impact, (1 - damping) v_t - e v_n, with the unit `normal` facing the ball; and v_n, v_t^2 before.

    Returns (velocity, normal speed, tangential speed squared) in m/s; the normal speed is positive into the surface.
    """
    vn = dot(v, normal) / dot(normal, normal)  # or a normal's rounding adds up over a million bounces
    vt = axpy(-vn, normal, v)
    return axpy(-e * vn, normal, scale(1.0 - damping, vt)), -vn, dot(vt, vt)


def energy_lost(mass, vn, vt_squared, e, damping):
    """m/2 (1 - e^2) v_n^2 + m/2 (1 - (1 - d)^2) v_t^2, in J."""
    keep = 1.0 - damping
    return 0.5 * mass * ((1.0 - e * e) * vn * vn + (1.0 - keep * keep) * vt_squared)
