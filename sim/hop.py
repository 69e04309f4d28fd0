"""Hops from touch to touch, many balls side by side: nearly all that the exact solver does under a constant acceleration.

A hop is a flight that ends with a plain impact, or with the ball's life. `fly` of `sim.travel` would take a ball over it in the
same way, bit for bit; here vector instructions reckon what comes of the touches of all balls at once, see also `sim.look`. Whatever
is not plain, say a ball that may come to rest, is left to `fly`.
"""

import numpy as np

from sim.curves.parabola import point, slope
from sim.hop_lanes import (
    BALL,
    BEHIND,
    BORN,
    CLOCK,
    COUNTED,
    COUNTED_FROM,
    DUE,
    ENDS,
    GONE,
    HIT,
    INTO,
    KEPT,
    LEAST,
    LOSS,
    NORMALS,
    NOTHING,
    PAST,
    PLACE,
    PLAIN,
    SPEED,
    TAKEN,
    WORKED,
    curve_in,
    left_in,
    only_few_faces,
)
from sim.impact import energy_lost, rebound
from sim.lanes import LANES, lane, put
from sim.log import note
from sim.look import look, seek
from sim.model import FASTEST
from sim.motion import motion
from sim.packed import SIDES, height
from sim.rest import STILL, comes_to_rest, no_contacts
from sim.slabs import walls
from sim.state import (
    AGE,
    COUNT,
    END,
    EVENTS,
    FLOWN,
    FRAME,
    LATE,
    LEFT,
    LOST,
    MOST_EVENTS,
    RELEASED,
    SINCE,
    STEPS,
    WORK,
    V,
    X,
    fill,
    fill_rest,
    steady_work,
)
from sim.touch import NONE, lands
from sim.vector import dot, two_sum


def hop(states, first, body, forces, features, search, room, record, log, rows, budget):
    """Take the balls, rows of `states` numbered from `first` on, over hops as long as any has a plain one.

    A ball keeps a lane until it has none, then the next one gets it. Returns (rows of `log` filled, what is left of `budget`);
    it ends sooner where the log is full or the budget spent.
    """
    lanes, still = room.lanes, (0.0, 0.0, 0.0)
    mover = motion(0.0, still, still, forces, no_contacts())
    few = only_few_faces(features)
    outlines = few and len(features.outline) > len(features.faces)
    upcoming, aboard = 0, 0
    for i in range(LANES):
        upcoming = board(states, upcoming, lanes, i, record)
        aboard += lanes[BALL + i] != NONE
    while aboard > 0 and budget > 0 and rows + LANES <= len(log):
        if few:
            look(room, features.faces, body.radius, mover.pull)
        else:
            budget -= seek(room, features, search, body.radius, mover.pull)
        reckon(lanes, body, mover)
        if body.restitution < 1.0:
            calm(lanes, body, mover.pull)
        check(room, features.faces)
        aboard = 0
        for i in range(LANES):
            if lanes[BALL + i] == NONE:
                continue
            last, state = lanes[HIT + i] == NOTHING, 0
            if lanes[PLAIN + i] > 0.0 and (last or not outlines or lands_in(lanes, i, features, mover.pull)):
                if lanes[DUE + i] >= lanes[KEPT + CLOCK + i] or show(states, first, lanes, i, mover, body.mass, record):
                    budget -= 1
                    lanes[TAKEN + i] += 1.0
                    if not last:
                        tell(lanes, i, first, features, log, rows)
                        rows += 1
                        aboard += 1
                        continue
                    state = KEPT
            leave(states, lanes, i, state)
            if state == KEPT:
                finish(states, first, lanes, i, body, record)
            upcoming = board(states, upcoming, lanes, i, record)
            aboard += lanes[BALL + i] != NONE
        for j in range(KEPT):
            lanes[j] = lanes[KEPT + j]
    for i in range(LANES):
        if lanes[BALL + i] != NONE:
            leave(states, lanes, i, 0)
    return rows, budget


def board(states, upcoming, lanes, i, record):
    """Give lane i to the first ball from number `upcoming` on that flies freely; returns the number after it."""
    lanes[BALL + i], lanes[ENDS + i] = NONE, -1.0
    for ball in range(upcoming, len(states)):
        s = states[ball]
        frame = int(s[FRAME])
        flies = frame < len(record.time) and record.time[frame] >= s[RELEASED] and s[AGE] < s[END]
        if flies and s[COUNT] == 0.0 and s[LEFT] == NONE and s[FLOWN] == NONE:
            for side in (0, KEPT):
                put(lanes, side + PLACE, i, (s[X], s[X + 1], s[X + 2]))
                put(lanes, side + SPEED, i, (s[V], s[V + 1], s[V + 2]))
                lanes[side + CLOCK + i], lanes[side + WORKED + i], lanes[side + GONE + i] = s[AGE], s[WORK], s[LOST]
                lanes[side + COUNTED + i], lanes[side + COUNTED_FROM + i] = s[EVENTS], s[SINCE]
                lanes[side + BEHIND + i] = s[LATE]
            lanes[BALL + i], lanes[ENDS + i], lanes[BORN + i], lanes[TAKEN + i] = ball, s[END], s[RELEASED], 0.0
            lanes[DUE + i] = record.time[frame] - s[RELEASED]
            return ball + 1
    return len(states)


def leave(states, lanes, i, state):
    """Take the ball in lane i out of it, as it is in rows `state`: 0, or KEPT where it has taken its hop."""
    s = states[int(lanes[BALL + i])]
    for k in range(3):
        s[X + k], s[V + k] = lanes[state + PLACE + k * LANES + i], lanes[state + SPEED + k * LANES + i]
    s[AGE], s[WORK], s[LOST] = lanes[state + CLOCK + i], lanes[state + WORKED + i], lanes[state + GONE + i]
    s[EVENTS], s[SINCE] = lanes[state + COUNTED + i], lanes[state + COUNTED_FROM + i]
    s[LATE] = lanes[state + BEHIND + i]
    s[STEPS] += lanes[TAKEN + i]


def finish(states, first, lanes, i, body, record):
    """Record the ball that was in lane i up to the end of its flight in the frames from there on; where one is not good, `fly` is to
    tell."""
    ball = int(lanes[BALL + i])
    s = states[ball]
    place, speed = lane(lanes, KEPT + PLACE, i), lane(lanes, KEPT + SPEED, i)
    frame = fill_rest(s, int(s[FRAME]), first + ball, place, speed, body.lifetime, record)
    if frame == len(record.time):
        s[FRAME] = frame


def reckon(lanes, body, mover):
    """Reckon the hops of all balls and the impacts at their ends, and mark those that are plain."""
    e, damping = body.restitution, body.damping
    for i in range(LANES):
        t, normal, last = lanes[LEAST + i], lane(lanes, NORMALS, i), lanes[HIT + i] == NOTHING
        x, curve = lane(lanes, PLACE, i), curve_in(lanes, i, mover.pull)
        x1, v1 = point(curve, t), slope(curve, t)
        v2, vn, squared = rebound(v1, normal, e, damping)
        sound = (dot(v1, v1) <= FASTEST * FASTEST) & (dot(x1, x1) < np.inf)
        age, behind = two_sum(lanes[CLOCK + i], t + lanes[BEHIND + i])
        age, behind = lanes[ENDS + i] if last else age, 0.0 if last else behind
        anew = age - lanes[COUNTED_FROM + i] > 1.0
        count = 0.0 if anew else lanes[COUNTED + i] + 1.0
        hits = (t < left_in(lanes, i)) & (dot(v1, normal) < 0.0)
        leaves = (dot(v2, normal) > 0.0) & (dot(v2, v2) > STILL * STILL)
        plain = last | (hits & leaves & (count <= MOST_EVENTS))
        lanes[PLAIN + i] = 1.0 if plain & sound else 0.0
        lost = 0.0 if last else energy_lost(body.mass, vn, squared, e, damping)
        put(lanes, KEPT + PLACE, i, x1)
        for k in range(3):
            lanes[KEPT + SPEED + k * LANES + i] = v1[k] if last else v2[k]
        lanes[INTO + i], lanes[PAST + i], lanes[LOSS + i] = vn, np.sqrt(squared), lost
        lanes[KEPT + CLOCK + i], lanes[KEPT + BEHIND + i] = age, behind
        lanes[KEPT + WORKED + i] = lanes[WORKED + i] + steady_work(x, x1, mover.drive, body.mass)
        lanes[KEPT + GONE + i] = lanes[GONE + i] + lost
        lanes[KEPT + COUNTED + i], lanes[KEPT + COUNTED_FROM + i] = count, age if anew else lanes[COUNTED_FROM + i]


def calm(lanes, body, pull):
    """Leave those hops to `fly` after which a ball may rest; nothing is blurred by a step here."""
    for i in range(LANES):
        v, normal, last = lane(lanes, KEPT + SPEED, i), lane(lanes, NORMALS, i), lanes[HIT + i] == NOTHING
        rests = comes_to_rest(v, pull, normal, body.restitution, body.damping, 0.0)
        lanes[PLAIN + i] = lanes[PLAIN + i] if last or not rests else 0.0


def lands_in(lanes, i, features, pull):
    """Whether the ball in lane i meets the plane of the face it touches on the face."""
    return lands(curve_in(lanes, i, pull), features.faces, features.outline, int(lanes[HIT + i]), lanes[LEAST + i])


def show(states, first, lanes, i, mover, mass, record):
    """Record the frames on the way of the ball in lane i; returns whether all are good, and there are more to come."""
    ball = int(lanes[BALL + i])
    frame, frames, released = int(states[ball, FRAME]), len(record.time), lanes[BORN + i]
    x, curve = lane(lanes, PLACE, i), curve_in(lanes, i, mover.pull)
    while frame < frames and record.time[frame] - released < lanes[KEPT + CLOCK + i]:
        u = max(record.time[frame] - released - lanes[CLOCK + i] - lanes[BEHIND + i], 0.0)
        xu, vu = point(curve, u), slope(curve, u)
        worked = lanes[WORKED + i] + steady_work(x, xu, mover.drive, mass)
        if not fill(record, frame, first + ball, xu, vu, worked, lanes[GONE + i]):
            return False
        frame += 1
    states[ball, FRAME] = frame
    if frame == frames:
        return False
    lanes[DUE + i] = record.time[frame] - released
    return True


def tell(lanes, i, first, features, log, row):
    """Write down the impact of the ball in lane i."""
    time, ball = lanes[BORN + i] + lanes[KEPT + CLOCK + i], first + int(lanes[BALL + i])
    x, normal = lane(lanes, KEPT + PLACE, i), lane(lanes, NORMALS, i)
    note(log, row, time, ball, features, int(lanes[HIT + i]), x, normal, lanes[INTO + i], lanes[PAST + i], lanes[LOSS + i])


def check(room, faces):
    """Leave those hops to `fly` whose end is behind a face, or too near to tell: a touch never lets that happen, so it is looked
    for apart from it."""
    lanes, slabs, others, _ = room
    for s in range(len(slabs)):
        k, low, high, _, _ = walls(slabs, s)
        row = PLACE + k * LANES
        for i in range(LANES):
            x, x1 = lanes[row + i], lanes[KEPT + row + i]
            keep_plain(lanes, i, ((x > low) & (x1 < low)) | ((x < high) & (x1 > high)))
    for j in range(len(others)):
        f = others[j]
        two_sided = faces[f, SIDES] > 1.0
        for i in range(LANES):
            h, h1 = height(faces, f, lane(lanes, PLACE, i)), height(faces, f, lane(lanes, KEPT + PLACE, i))
            keep_plain(lanes, i, ((h > 0.0) & (h1 < 0.0)) | (two_sided & (h <= 0.0) & (h1 >= 0.0)))


def keep_plain(lanes, i, through):
    """Have the hop in lane i be plain no more if it leads through a face."""
    lanes[PLAIN + i] = 0.0 if through else lanes[PLAIN + i]
