"""What one step of a method hands on to the next: the acceleration that it evaluated last, where the next begins with it."""

from sim.integrators.symplectic_euler import step  # bound to the method's own before it is compiled

CARRIES = False  # bound to whether the method has a `carried` of its own


def carried(h, t, x, v, a, forces):
    """The step of a method that hands nothing on; bound to the method's own where it has one."""
    x, v = step(h, t, x, v, forces)
    return x, v, a
