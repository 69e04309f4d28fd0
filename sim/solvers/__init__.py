"""How a ball gets along a curve: one module for the exact solver, one for all methods with a fixed step.

    depart(h, age, x, v, motion) -> curve, x1, v1      the curve over the time h (s), and where it leads if that is known
    arrive(curve, s, h, x1, v1, age, x, v, motion)     position (m) and velocity (m/s) after the time s (s) of it
    goal(age, limit, dt)                               the age (s) to go for at once, at most `limit`
    squared_speed(curve, s, x, v, x1, v1)              the integral of v^2 over s, from (x, v) to (x1, v1)
"""
