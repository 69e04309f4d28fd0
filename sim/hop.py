"""Hops from face to face, many balls side by side: nearly all that the exact solver does in a scene of a few faces.

A hop is a flight under a constant acceleration that ends with a plain impact on a face. `fly` of `sim.travel` would take a ball
over it in the same way, bit for bit; here vector instructions look for the touches of all balls at once. Whatever is not plain,
say a ball that may come to rest, or the end of its flight, is left to `fly`.
"""

import numpy as np

from sim.curves.parabola import flight, point, slope
from sim.impact import energy_lost, rebound
from sim.lanes import LANES, lane, put
from sim.log import note
from sim.model import FASTEST
from sim.motion import motion
from sim.packed import SIDES, facing, height, surface_of
from sim.penetration import count_passed
from sim.rest import STILL, comes_to_rest, no_contacts
from sim.state import AGE, COUNT, CROSSED, END, FRAME, LEFT, LOST, RELEASED, STEPS, WORK, X, count_event, fill, work_done
from sim.touch import NONE, first_fall, lands, plane_gap
from sim.vector import dot

# Rows of the lanes, as in `sim.lanes`.
PLACE, SPEED, PLACE1, SPEED1 = 0 * LANES, 3 * LANES, 6 * LANES, 9 * LANES  # m, m/s; 1: at the end of the hop
BALL = 12 * LANES  # its row of the states
LIMIT = 13 * LANES  # s, to the end of the flight; -1 in a lane without a ball
LEAST = 14 * LANES  # s, to the first touch
HIT = 15 * LANES  # the face touched
THROUGH = 16 * LANES  # 1 where the centre gets behind a face
ROWS = 17


def hop_room() -> np.ndarray:
    return np.zeros(ROWS * LANES)


def hop(states, first, blur, body, forces, features, search, lanes, record, log, rows, budget):
    """Take the balls, rows of `states` numbered from `first` on, over hops as long as any has a plain one.

    A ball keeps a lane until it has none, then the next one gets it. Returns (rows of `log` filled, what is left of `budget`);
    it ends sooner where the log is full or the budget spent.
    """
    still = (0.0, 0.0, 0.0)
    mover = motion(0.0, still, still, forces, no_contacts())
    upcoming, aboard = 0, 0
    for i in range(LANES):
        upcoming = board(states, upcoming, lanes, i, record)
        aboard += lanes[BALL + i] != NONE
    while aboard > 0 and budget > 0 and rows + LANES <= len(log):
        look(lanes, features, body.radius, mover.pull)
        aboard = 0
        for i in range(LANES):
            if lanes[BALL + i] != NONE:
                if bounce(states, first, lanes, i, blur, body, mover, features, record, log, rows):
                    rows += 1
                    budget -= 1
                else:
                    leave(states, lanes, i)
                    upcoming = board(states, upcoming, lanes, i, record)
                aboard += lanes[BALL + i] != NONE
        check(lanes, features.faces)
        for i in range(LANES):
            if lanes[THROUGH + i] > 0.0:
                curve = flight(lane(lanes, PLACE, i), lane(lanes, SPEED, i), mover.pull, 0.0, 0.0)
                states[int(lanes[BALL + i]), CROSSED] += count_passed(curve, features, search, body.radius, lanes[LEAST + i], NONE)
        for j in range(6 * LANES):
            lanes[PLACE + j] = lanes[PLACE1 + j]
    for i in range(LANES):
        if lanes[BALL + i] != NONE:
            leave(states, lanes, i)
    return rows, budget


def board(states, upcoming, lanes, i, record):
    """Give lane i to the first ball from number `upcoming` on that flies freely; returns the number after it."""
    lanes[BALL + i], lanes[LIMIT + i] = NONE, -1.0
    for ball in range(upcoming, len(states)):
        frame = int(states[ball, FRAME])
        if frame < len(record.time) and record.time[frame] >= states[ball, RELEASED]:
            if states[ball, COUNT] == 0.0 and states[ball, LEFT] == NONE:
                lanes[BALL + i], lanes[LIMIT + i] = ball, states[ball, END] - states[ball, AGE]
                for k in range(6):
                    lanes[PLACE + k * LANES + i] = lanes[PLACE1 + k * LANES + i] = states[ball, X + k]
                return ball + 1
    return len(states)


def leave(states, lanes, i):
    """Take the ball in lane i out of it."""
    for k in range(6):
        states[int(lanes[BALL + i]), X + k] = lanes[PLACE + k * LANES + i]


def look(lanes, features, radius, pull):
    """Find the first touch of all balls."""
    for i in range(LANES):
        lanes[LEAST + i], lanes[HIT + i] = lanes[LIMIT + i], NONE
    for f in range(len(features.faces)):
        look_at(lanes, features.faces, f, 1.0, radius, pull)
        if features.faces[f, SIDES] > 1.0:
            look_at(lanes, features.faces, f, -1.0, radius, pull)


def look_at(lanes, faces, f, side, radius, pull):
    """The same for one side of a face."""
    for i in range(LANES):
        curve = flight(lane(lanes, PLACE, i), lane(lanes, SPEED, i), pull, 0.0, 0.0)
        t = first_fall(plane_gap(curve, faces, f, side, radius), radius, lanes[LIMIT + i])
        sooner = (t < lanes[LEAST + i]) | ((t == lanes[LEAST + i]) & (lanes[HIT + i] == NONE))
        lanes[LEAST + i] = t if sooner else lanes[LEAST + i]
        lanes[HIT + i] = f if sooner else lanes[HIT + i]


def bounce(states, first, lanes, i, blur, body, mover, features, record, log, row):
    """Take the ball in lane i to the end of its hop, if it has one and that is plain; returns whether it is."""
    t, f, ball = lanes[LEAST + i], int(lanes[HIT + i]), int(lanes[BALL + i])
    if f == NONE or t >= lanes[LIMIT + i]:
        return False
    s = states[ball]
    x, v = lane(lanes, PLACE, i), lane(lanes, SPEED, i)
    curve = flight(x, v, mover.pull, 0.0, 0.0)
    x1, v1 = point(curve, t), slope(curve, t)
    normal = facing(features, f, x1)
    if not lands(curve, features.faces, features.outline, f, t) or not dot(v1, normal) < 0.0:
        return False
    v2, vn, squared = rebound(v1, normal, body.restitution, body.damping)
    if comes_to_rest(v2, mover.pull, normal, body.restitution, body.damping, blur):
        return False
    if not STILL * STILL < dot(v2, v2) or not dot(v1, v1) <= FASTEST * FASTEST:
        return False
    age = s[AGE] + t
    frame, frames = int(s[FRAME]), len(record.time)
    while frame < frames and record.time[frame] - s[RELEASED] < age:
        u = max(record.time[frame] - s[RELEASED] - s[AGE], 0.0)
        xu, vu = point(curve, u), slope(curve, u)
        if not fill(record, frame, first + ball, xu, vu, s[WORK] + work_done(curve, u, x, v, xu, vu, mover, body.mass), s[LOST]):
            return False
        frame += 1
    if frame == frames or not count_event(s, age):
        return False
    s[WORK] += work_done(curve, t, x, v, x1, v1, mover, body.mass)
    lost = energy_lost(body.mass, vn, squared, body.restitution, body.damping)
    s[LOST] += lost
    s[STEPS] += 1.0
    s[AGE], s[FRAME] = age, frame
    note(log, row, s[RELEASED] + age, first + ball, surface_of(features, f), x1, normal, vn, np.sqrt(squared), lost)
    put(lanes, PLACE1, i, x1)
    put(lanes, SPEED1, i, v2)
    lanes[LIMIT + i] = s[END] - age
    return True


def check(lanes, faces):
    """Mark the balls whose centre gets behind a face, which a touch never lets happen: looked for apart from it."""
    for i in range(LANES):
        lanes[THROUGH + i] = 0.0
    for f in range(len(faces)):
        two_sided = faces[f, SIDES] > 1.0
        for i in range(LANES):
            h, h1 = height(faces, f, lane(lanes, PLACE, i)), height(faces, f, lane(lanes, PLACE1, i))
            through = ((h > 0.0) & (h1 < 0.0)) | (two_sided & (h < 0.0) & (h1 > 0.0))
            lanes[THROUGH + i] = 1.0 if through else lanes[THROUGH + i]
