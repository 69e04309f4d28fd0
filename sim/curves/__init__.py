"""The curves that a ball's centre follows between two events: one module each, with the same functions.

    point(curve, s) -> x             position (m) after s (s)
    slope(curve, s) -> v             its derivative (m/s)
    bend(curve, s, end)              an upper bound of |x''| (m/s^2) on [s, end]
    project(curve, n, p, offset)     the scalar curve f(s) = n . (x(s) - p) - offset
    start(line)                      f, f' and f'' at s = 0
    fall(line, s, end, below)        the first time after s and up to `end` at which f goes from above zero to below, or inf
    bends(curve, s, end)             an upper bound of |x''| (m/s^2) along each axis on [s, end]; of the curves of steps, which have
    as_quintic(curve)                it as a curve of `sim.curves.quintic`, so that what looks for events is the same for all of them

A curve is a tuple, s runs from 0. `fall` is where a ball can come down on a plane or leave a region; `below` says that f is
below zero at s, so that it has to rise before it can fall.
"""
