"""How a ball gets along a curve: one module for the exact solver, one for the methods with a fixed step, one for adaptive ones.

    depart(method, h, dt, tolerance, age, x, v, a, motion) -> curve, x1, v1, a1, h, dt
        the curve over the time h (s), or as much of it as the tolerance allows; where it leads, and the acceleration there, if
        that is known; how long it is; and the step dt (s) to go on with
    arrive(method, curve, s, h, x1, v1, age, x, v, motion)  position (m) and velocity (m/s) after the time s (s) of it
    hands_on(method)                                        whether a1 is that acceleration, else it is to be evaluated
    goal(age, limit, dt)                                    the age (s) to go for at once, at most `limit`, with steps dt
    squared_speed(curve, s, x, v, x1, v1)                   the integral of v^2 over s, from (x, v) to (x1, v1)

`method` is what a method with a fixed step has of its own, see `sim.solvers.stepping`; else empty.
"""
