"""The steps of many balls side by side while nothing can happen to them: nearly all that a method with a fixed step does.

A ball has an age up to which it cannot touch a surface, nor cross the face of a region, see `sim.clearance`. As long as its steps
stay within that, vector instructions take them for all balls at once, and the same numbers come out, bit for bit, as when `fly` of
`sim.travel` looks for events in each. A step in which something may happen is left to `fly`, and so are those after it until
the ball is free again.
"""

import numpy as np

from sim.clearance import AHEAD, FARTHEST, SPARE, free_time, push_of, pushes_within, region_free_time
from sim.curves.parabola import flight  # bound to the curve's own before it is compiled
from sim.handing import CARRIES, carried  # bound to the method's own before they are compiled
from sim.integrators.symplectic_euler import interpolant  # bound to the method's own before it is compiled
from sim.lanes import LANES, lane, put
from sim.model import FASTEST
from sim.motion import Motion, acceleration, motion, next_end
from sim.rest import no_contacts
from sim.solvers.stepping import steps_to_come
from sim.state import AGE, END, FRAME, LOST, RELEASED, STEP, STEPS, WORK, V, X, fill, work_done
from sim.touch import NONE
from sim.travel import DONE, PAUSED, READY, fly
from sim.vector import ROUNDING, dot, norm

# Rows of the lanes, as in `sim.lanes`; a 1 marks where the step under way leads.
PLACE, SPEED, PUSH, PLACE1, SPEED1, PUSH1 = (3 * k * LANES for k in range(6))  # m, m/s, m/s^2
PULL, DRIVE = 18 * LANES, 21 * LANES  # of the Motion, and the rest of it:
STIFF, DRAG, DRIVE_STIFF, DRIVE_DRAG = 24 * LANES, 25 * LANES, 26 * LANES, 27 * LANES
CLOCK = 28 * LANES  # s, age
GRID = 29 * LANES  # the age at which the step under way ends, in steps
LAST = 30 * LANES  # s, age before which it must end
DUE = 31 * LANES  # s, age at the next frame
SURE_TILL = 32 * LANES  # s, age up to which nothing can happen to it
HARDEST = 33 * LANES  # m/s^2, if nothing pushes it harder
LOOK = 34 * LANES  # ways of a step, how far to look around next
MOVES = 35 * LANES  # 1 where the step can be taken
BALL = 36 * LANES  # its row of the states; NONE in a lane without a ball
WORKED = 37 * LANES  # J, done on the ball since its release
TAKEN = 38 * LANES  # steps since it came into the lane
ROWS = 39

FEW = 8  # balls that are sooner moved one after the other than side by side
AT_ONCE = 256  # steps of one of them


def coast_room() -> np.ndarray:
    """The lanes, from the beginning of a line of the cache on, which vector instructions had better not straddle."""
    room, line = np.zeros((ROWS + 1) * LANES), 64
    return room[-room.ctypes.data % line // room.itemsize :][: ROWS * LANES]


def coast(states, first, method, tolerance, blur, body, forces, features, search, lanes, record, log, budget):
    """Move balls as `travel` of `sim.travel` does, by a method with a fixed step. `budget` is of steps of all balls together, and of
    pieces of flight of one."""
    dt, rows, heft = states[0, STEP], 0, body.mass if does_work(forces) else 0.0
    width, upcoming, how = min(len(states), LANES), 0, DONE
    for i in range(LANES):
        lanes[BALL + i], lanes[SURE_TILL + i] = NONE, -1.0
    while True:
        moving, aboard = method.march(lanes, dt, heft), 0
        for i in range(width if moving < width else 0):
            if lanes[MOVES + i] > 0.0 or is_free(lanes, i, method, dt, states, first, body, forces, features, search, record):
                aboard += 1
                continue
            ball = int(lanes[BALL + i])
            if ball != NONE:
                leave(states, lanes, i)
            else:
                ball, upcoming = upcoming, upcoming + 1
            lanes[BALL + i] = NONE
            while ball < len(states):
                how, rows, budget = fly(
                    states, ball, first + ball, True, method, tolerance, blur, body, forces, features, search, record, log, rows, budget
                )
                if how != DONE:
                    break
                ball, upcoming = upcoming, upcoming + 1
            if how == READY:
                board(states, lanes, i, ball, dt, forces, record)
                aboard += 1
            elif how != DONE:
                return ashore(states, lanes, width, how, ball, rows)
            how = DONE
        if moving < width and aboard == 0:
            return DONE, len(states), rows
        for i in range(width if heft > 0.0 else 0):
            if lanes[MOVES + i] > 0.0:
                work(lanes, i, dt, heft)
        method.commit(lanes, dt)
        budget -= 1
        if budget <= 0:
            return ashore(states, lanes, width, PAUSED, 0, rows)


def does_work(forces):
    """Whether any field may do work that is not in a potential."""
    some = len(forces.selective) > 0
    for k in range(len(forces.drive)):
        some |= forces.drive[k] != 0.0
    return some


def march(lanes, dt, mass):
    """Try a step in all lanes; returns how many balls may take theirs."""
    moving = 0
    for i in range(LANES):  # a constant, so that the compiler knows that no row overlaps another
        moving += 1 if tried(lanes, i, dt) else 0
    return moving


def march_each(lanes, dt, mass):
    """Try a step in the FEW first lanes, after as many, AT_ONCE at most, as each ball may take; returns how many may go on."""
    moving = 0
    for i in range(FEW):
        taken = 0
        while tried(lanes, i, dt) and taken < AT_ONCE:
            if mass > 0.0:
                work(lanes, i, dt, mass)
            settle(lanes, i, dt)
            taken += 1
        moving += 1 if lanes[MOVES + i] > 0.0 else 0
    return moving


def tried(lanes, i, dt):
    """Write where a step leads into the scratch of lane i; returns whether the ball may go that far as things are."""
    x, v, mover, age = lane(lanes, PLACE, i), lane(lanes, SPEED, i), mover_in(lanes, i), lanes[CLOCK + i]
    aim = lanes[GRID + i] * dt
    h = aim - age
    a = lane(lanes, PUSH, i) if CARRIES else acceleration(age, x, v, mover)
    x1, v1, a1 = carried(h, age, x, v, a, mover)
    put(lanes, PLACE1, i, x1)
    put(lanes, SPEED1, i, v1)
    if CARRIES:
        put(lanes, PUSH1, i, a1)
    curve = interpolant(h, x, v, a, x1, v1)
    known = (aim <= lanes[SURE_TILL + i]) & pushes_within(curve, h, v, v1, lanes[HARDEST + i])
    moves = known & (aim < lanes[LAST + i]) & (aim <= lanes[DUE + i]) & sane(x1, v1)
    lanes[MOVES + i] = 1.0 if moves else 0.0
    return moves


def step_in(lanes, i, h):
    """How hard (m/s^2) a step of h (s) pushes the ball in lane i, and its position (m) and velocity (m/s) then."""
    x, v, mover, age = lane(lanes, PLACE, i), lane(lanes, SPEED, i), mover_in(lanes, i), lanes[CLOCK + i]
    a = acceleration(age, x, v, mover)
    x1, v1, _ = carried(h, age, x, v, a, mover)
    return push_of(interpolant(h, x, v, a, x1, v1), h, v, v1), x1, v1


def sane(x, v):
    """Whether a ball has not diverged; said so that one whose place is not a number has."""
    return (dot(v, v) <= FASTEST * FASTEST) & (dot(x, x) < np.inf)


def commit(lanes, dt):
    """Move the balls that may to the end of their step."""
    for i in range(LANES):
        settle(lanes, i, dt)


def settle(lanes, i, dt):
    """Move the ball in lane i to the end of its step, if it may."""
    moves = lanes[MOVES + i] > 0.0
    for k in range(9 if CARRIES else 6):
        row = PLACE + k * LANES + i
        lanes[row] = lanes[row + PLACE1 - PLACE] if moves else lanes[row]
    lanes[CLOCK + i] = lanes[GRID + i] * dt if moves else lanes[CLOCK + i]
    lanes[GRID + i] += 1.0 if moves else 0.0
    lanes[TAKEN + i] += 1.0 if moves else 0.0


def work(lanes, i, dt, mass):
    """Add the work that the step does on the ball in lane i."""
    h = lanes[GRID + i] * dt - lanes[CLOCK + i]
    lanes[WORKED + i] += work_in(lanes, i, h, lane(lanes, PLACE1, i), lane(lanes, SPEED1, i), mass)


def work_in(lanes, i, h, x1, v1, mass):
    """Work (J) on the ball in lane i in h (s), at the end of which it is at x1 (m) with velocity v1 (m/s)."""
    x, v = lane(lanes, PLACE, i), lane(lanes, SPEED, i)
    line = flight(x, v, (0.0, 0.0, 0.0), 0.0, 0.0)  # the work of a method with steps is told by their ends
    return work_done(line, h, x, v, x1, v1, mover_in(lanes, i), mass)


def is_free(lanes, i, method, dt, states, first, body, forces, features, search, record):
    """Whether the ball in lane i, if there is one, may take its step after all: it is farther from everything than it was known to be,
    and frames on the way are recorded."""
    aim, age = lanes[GRID + i] * dt, lanes[CLOCK + i]
    x, v, x1, v1 = lane(lanes, PLACE, i), lane(lanes, SPEED, i), lane(lanes, PLACE1, i), lane(lanes, SPEED1, i)
    if lanes[BALL + i] == NONE or not aim < lanes[LAST + i] or not sane(x1, v1):
        return False
    h = aim - age
    push, _, _ = method.step_in(lanes, i, h)
    if not (aim <= lanes[SURE_TILL + i] and push <= lanes[HARDEST + i]):
        push *= SPARE
        look = lanes[LOOK + i] * h * (norm(v) + push * h)
        aside, time = region_free_time(x, v, push, forces), free_time(features, search, x, v, push, body.radius, look)
        lanes[LOOK + i] = min(2.0 * lanes[LOOK + i], FARTHEST) if time > 0.25 * lanes[LOOK + i] * h else AHEAD
        lanes[SURE_TILL + i], lanes[HARDEST + i] = age + min(time, aside), push
        if not aim <= lanes[SURE_TILL + i]:
            return False
    s = states[int(lanes[BALL + i])]
    while lanes[DUE + i] < aim:
        t = max(lanes[DUE + i] - age, 0.0)
        _, xt, vt = method.step_in(lanes, i, t)
        done = lanes[WORKED + i] + work_in(lanes, i, t, xt, vt, body.mass)
        if not fill(record, int(s[FRAME]), first + int(lanes[BALL + i]), xt, vt, done, s[LOST]):
            return False
        s[FRAME] += 1.0
        lanes[DUE + i] = next_frame(s, record)
        if lanes[DUE + i] == np.inf:  # that was the last one
            return False
    lanes[MOVES + i] = 1.0
    return True


def next_frame(s, record):
    """The age (s) of a ball at the next frame, infinite if there is none."""
    frame = int(s[FRAME])
    return record.time[frame] - s[RELEASED] if frame < len(record.time) else np.inf


def board(states, lanes, i, ball, dt, forces, record):
    """Take a ball that flies freely into lane i."""
    s = states[ball]
    x, v, age = (s[X], s[X + 1], s[X + 2]), (s[V], s[V + 1], s[V + 2]), s[AGE]
    mover = motion(age, x, v, forces, no_contacts())
    limit = min(s[END], next_end(age, forces))
    put(lanes, PLACE, i, x)
    put(lanes, SPEED, i, v)
    put(lanes, PUSH, i, acceleration(age, x, v, mover))
    put(lanes, PULL, i, mover.pull)
    put(lanes, DRIVE, i, mover.drive)
    lanes[STIFF + i], lanes[DRAG + i], lanes[DRIVE_STIFF + i], lanes[DRIVE_DRAG + i] = mover.w2, mover.b, mover.drive_w2, mover.drive_b
    lanes[CLOCK + i], lanes[GRID + i] = age, steps_to_come(age, limit, dt)
    lanes[LAST + i], lanes[DUE + i] = limit - ROUNDING * limit, next_frame(s, record)
    lanes[SURE_TILL + i], lanes[LOOK + i], lanes[MOVES + i] = -1.0, AHEAD, 0.0
    lanes[BALL + i], lanes[WORKED + i], lanes[TAKEN + i] = ball, s[WORK], 0.0


def mover_in(lanes, i):
    """The Motion of the ball in lane i."""
    return Motion(
        lane(lanes, PULL, i),
        lanes[STIFF + i],
        lanes[DRAG + i],
        lane(lanes, DRIVE, i),
        lanes[DRIVE_STIFF + i],
        lanes[DRIVE_DRAG + i],
        no_contacts(),
    )


def leave(states, lanes, i):
    """Take the ball in lane i out of it."""
    s = states[int(lanes[BALL + i])]
    for k in range(6):
        s[X + k] = lanes[PLACE + k * LANES + i]
    s[AGE] = lanes[CLOCK + i]
    s[WORK] = lanes[WORKED + i]
    s[STEPS] += lanes[TAKEN + i]


def ashore(states, lanes, width, how, ball, rows):
    """Take all balls out of their lanes; returns what it is given, as the kernel does."""
    for i in range(width):
        if lanes[BALL + i] != NONE:
            leave(states, lanes, i)
    return how, ball, rows
