"""The state of each ball as a row of numbers, from which its flight can be taken up at any time; and how it is recorded."""

from __future__ import annotations

import numpy as np

from sim.model import FASTEST
from sim.rest import Contacts
from sim.solvers.exact import squared_speed  # bound to the solver's own before it is compiled
from sim.touch import NONE
from sim.vector import ROUNDING, dot, sub

MOST_EVENTS = 1_000_000  # of a ball within a second; more is a pile-up that may never end

# Columns of a ball's state.
X, V, AGE, RELEASED, END, WORK, LOST, STEPS, CROSSED, FRAME = 0, 3, 6, 7, 8, 9, 10, 11, 12, 13
COUNT, HELD, ITEMS, NORMALS = 14, 15, 16, 19  # contacts
EVENTS, SINCE = 28, 29  # events since the age SINCE (s)
LEFT = 30  # the face that the ball has just slid off
STEP = 31  # s, to try next
FLOWN = 32  # the edge or corner that the ball has just flown off
SURE, PUSHED = 33, 34  # s, age up to which nothing can happen to it if nothing pushes harder (m/s^2, along each axis), as last seen
LATE = 37  # s, what AGE is too low by: over many events it would add up
WIDTH = 38


def work_done(curve, t, x, v, x1, v1, mover, mass):
    """Work (J) of the fields without a potential over t (s) from (x, v) to (x1, v1): of the constant and the spring's part by
    their primitives, of drag by the integral of v^2."""
    path = sub(x1, x)
    work = dot(mover.drive, path)
    if mover.drive_w2 > 0.0:
        work -= 0.5 * mover.drive_w2 * (dot(x1, x1) - dot(x, x))
    if mover.drive_b > 0.0:
        work -= mover.drive_b * squared_speed(curve, t, x, v, x1, v1, mover)
    return mass * work


def steady_work(x, x1, drive, mass):
    """The same (J) where that part is the constant acceleration `drive` (m/s^2) alone."""
    return mass * dot(drive, sub(x1, x))


def fill(record, frame, ball, x, v, work, lost):
    """Record a ball in a frame; returns whether it is good: finite, and not too fast."""
    for k in range(3):
        record.position[frame, ball, k], record.velocity[frame, ball, k] = x[k], v[k]
    record.work[frame, ball], record.lost[frame, ball] = work, lost
    # said as "is within", so that NaN is not good
    return dot(v, v) <= FASTEST * FASTEST and dot(x, x) < np.inf


def count_event(s, age):
    """Count an event of a ball at `age` (s); returns whether they are not too many."""
    s[EVENTS] += 1.0
    if age - s[SINCE] > 1.0:
        s[EVENTS], s[SINCE] = 0.0, age
    return s[EVENTS] <= MOST_EVENTS


def skip(record, frame, ball):
    """Record that a ball is not alive in a frame."""
    for k in range(3):
        record.position[frame, ball, k], record.velocity[frame, ball, k] = np.nan, np.nan
    record.work[frame, ball], record.lost[frame, ball] = 0.0, 0.0


def fill_rest(s, frame, ball, x, v, lifetime, record):
    """Record a ball whose flight is over, at x with velocity v, in all frames from number `frame` on: the first may be at its very end.

    Returns their number, or that of the first which is not good.
    """
    while frame < len(record.time):
        if record.time[frame] - s[RELEASED] < lifetime - ROUNDING * record.time[frame]:
            if not fill(record, frame, ball, x, v, s[WORK], s[LOST]):
                return frame
        else:
            skip(record, frame, ball)
            record.work[frame, ball], record.lost[frame, ball] = s[WORK], s[LOST]
        frame += 1
    return frame


def load_contacts(s):
    i, n = ITEMS, NORMALS
    return Contacts(
        int(s[COUNT]),
        s[HELD] > 0.0,
        (int(s[i]), int(s[i + 1]), int(s[i + 2])),
        ((s[n], s[n + 1], s[n + 2]), (s[n + 3], s[n + 4], s[n + 5]), (s[n + 6], s[n + 7], s[n + 8])),
    )


def save_contacts(s, contacts):
    s[COUNT], s[HELD] = contacts.count, 1.0 if contacts.held else 0.0
    for k in range(3):
        s[ITEMS + k] = contacts.items[k]
        for j in range(3):
            s[NORMALS + 3 * k + j] = contacts.normals[k][j]


def depart_states(balls, duration, dt):
    """The states (n, WIDTH) of all balls at their release, to go with steps dt (s)."""
    states = np.zeros((len(balls), WIDTH))
    states[:, X : X + 3], states[:, V : V + 3] = balls.position, balls.velocity
    states[:, RELEASED] = balls.released
    states[:, END] = np.minimum(balls.lifetime, duration - balls.released)
    states[:, ITEMS : ITEMS + 3], states[:, LEFT], states[:, FLOWN], states[:, STEP] = NONE, NONE, NONE, dt
    return states
