"""The steps of many balls side by side while nothing can happen to them: nearly all that a method with a fixed step does.

A ball has an age up to which it cannot touch a surface, nor cross the face of a region, see `sim.clearance`. As long as its steps
stay within that, vector instructions take them for all balls at once, and the same numbers come out, bit for bit, as when `fly` of
`sim.travel` looks for events in each. A step in which something may happen is left to `fly`, and so are those after it until
the ball is free again.
"""

import numpy as np

from sim.clearance import AHEAD, FARTHEST, allowed, free_time, push_of, pushes_within, region_free_time
from sim.curves.parabola import flight  # bound to the curve's own before it is compiled
from sim.handing import CARRIES, carried  # bound to the method's own before they are compiled
from sim.integrators.symplectic_euler import interpolant  # bound to the method's own before it is compiled
from sim.lanes import LANES, empty_lanes, lane, put
from sim.model import FASTEST
from sim.motion import Motion, acceleration, motion, next_end
from sim.rest import no_contacts
from sim.solvers.stepping import steps_to_come
from sim.state import AGE, END, FRAME, LOST, PUSHED, RELEASED, STEP, STEPS, SURE, WORK, V, X, fill, work_done
from sim.touch import NONE
from sim.travel import DONE, PAUSED, READY, fly
from sim.vector import ROUNDING, dot, norm, within

# Rows of the lanes, as in `sim.lanes`; a 1 marks where the step under way leads.
PLACE, SPEED, PUSH, PLACE1, SPEED1, PUSH1 = (3 * k * LANES for k in range(6))  # m, m/s, m/s^2
PULL, DRIVE = 18 * LANES, 21 * LANES  # of the Motion, and the rest of it:
STIFF, DRAG, DRIVE_STIFF, DRIVE_DRAG = 24 * LANES, 25 * LANES, 26 * LANES, 27 * LANES
CLOCK = 28 * LANES  # s, age
GRID = 29 * LANES  # the age at which the step under way ends, in steps
LAST = 30 * LANES  # s, age before which it must end
DUE = 31 * LANES  # s, age at the next frame
SURE_TILL = 32 * LANES  # s, age up to which nothing can happen to it, if nothing pushes it harder than HARDEST
UNTIL = 33 * LANES  # s, no later than any of these three
LOOK = 34 * LANES  # ways of a step, how far to look around next
MOVES = 35 * LANES  # 1 where the step can be taken
BALL = 36 * LANES  # its row of the states; NONE in a lane without a ball
WORKED = 37 * LANES  # J, done on the ball since its release
SINCE = 38 * LANES  # GRID when it came into the lane
HARDEST = 39 * LANES  # m/s^2, along each axis
ROWS = 42

FEW = 8  # balls that are sooner moved one after the other than side by side
WIDE, GROUP = LANES, 16  # lanes, and those that march on together: 8 are slower, 32 LLVM is at for minutes; for few balls FEW and 1
AT_ONCE = 64  # steps that they do so, at most


def coast_room() -> np.ndarray:
    return empty_lanes(ROWS)


def coast(states, first, method, tolerance, blur, body, forces, features, search, lanes, record, log, budget):
    """Move balls as `travel` of `sim.travel` does, by a method with a fixed step. `budget` is of marches of all balls together, and of
    pieces of flight of one and chords of them."""
    dt, rows, heft = states[0, STEP], 0, body.mass if does_work(forces) else 0.0
    width, aboard, upcoming, how = min(len(states), LANES), 0, 0, DONE
    for i in range(LANES):
        vacate(lanes, i)
    while True:
        held = method.march(lanes, dt, heft) > 0 or aboard == 0
        aboard = 0 if held else aboard
        for i in range(width if held else 0):
            if lanes[MOVES + i] > 0.0 or is_free(lanes, i, method, dt, states, first, body, forces, features, search, record):
                aboard += 1
                continue
            ball = int(lanes[BALL + i])
            if ball != NONE:
                leave(states, lanes, i)
            else:
                ball, upcoming = upcoming, upcoming + 1
            vacate(lanes, i)
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
        if aboard == 0:
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
    """In each group of lanes take steps as long as all of its balls may, and try the next; returns how many may not take that."""
    held = 0
    for first in range(0, WIDE, GROUP):
        group = range(first, first + GROUP)
        balls, able, taken = 0, 0, 0
        for i in group:
            balls += 1 if lanes[BALL + i] != NONE else 0
        while balls > 0:
            able = 0
            for i in group:
                able += 1 if tried(lanes, i, dt) else 0
            if able < balls or taken == AT_ONCE:
                break
            for i in range(first, first + GROUP if mass > 0.0 else first):
                work(lanes, i, dt, mass)
            for i in group:
                settle(lanes, i, dt, True)
            taken += 1
        held += balls - able
    return held


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
    moves = (aim <= lanes[UNTIL + i]) & pushes_within(curve, h, v, v1, lane(lanes, HARDEST, i))
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
    for i in range(WIDE):
        settle(lanes, i, dt, lanes[MOVES + i] > 0.0)


def settle(lanes, i, dt, moves):
    """Move the ball in lane i to the end of its step, if it `moves`."""
    for k in range(9 if CARRIES else 6):
        row = PLACE + k * LANES + i
        lanes[row] = lanes[row + PLACE1 - PLACE] if moves else lanes[row]
    lanes[CLOCK + i] = lanes[GRID + i] * dt if moves else lanes[CLOCK + i]
    lanes[GRID + i] += 1.0 if moves else 0.0


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
    if not (aim <= lanes[SURE_TILL + i] and within(push, lane(lanes, HARDEST, i))):
        push = allowed(push)
        look = lanes[LOOK + i] * h * (norm(v) + norm(push) * h)
        aside, time = region_free_time(x, v, push, forces), free_time(features, search, x, v, push, body.radius, look)
        lanes[LOOK + i] = min(2.0 * lanes[LOOK + i], FARTHEST) if time > 0.25 * lanes[LOOK + i] * h else AHEAD
        lanes[SURE_TILL + i] = age + min(time, aside)
        put(lanes, HARDEST, i, push)
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
    lanes[UNTIL + i] = soonest(lanes, i)
    lanes[MOVES + i] = 1.0
    return True


def soonest(lanes, i):
    """The age (s) up to which the ball in lane i may march on."""
    return min(lanes[SURE_TILL + i], min(lanes[DUE + i], lanes[LAST + i] * (1.0 - ROUNDING)))


def next_frame(s, record):
    """The age (s) of a ball at the next frame, infinite if there is none."""
    frame = int(s[FRAME])
    return record.time[frame] - s[RELEASED] if frame < len(record.time) else np.inf


def vacate(lanes, i):
    """Have no ball in lane i."""
    lanes[BALL + i], lanes[UNTIL + i], lanes[MOVES + i] = NONE, -1.0, 0.0


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
    sure = s[SURE] if len(forces.selective) == 0 else -1.0  # which knows of no regions
    lanes[SURE_TILL + i], lanes[LOOK + i] = sure, AHEAD
    put(lanes, HARDEST, i, (s[PUSHED], s[PUSHED + 1], s[PUSHED + 2]))
    lanes[UNTIL + i] = soonest(lanes, i)
    lanes[BALL + i], lanes[WORKED + i], lanes[SINCE + i] = ball, s[WORK], lanes[GRID + i]


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
    for k in range(3):
        s[PUSHED + k] = lanes[HARDEST + k * LANES + i]
    s[AGE], s[SURE], s[WORK] = lanes[CLOCK + i], lanes[SURE_TILL + i], lanes[WORKED + i]
    s[STEPS] += lanes[GRID + i] - lanes[SINCE + i]


def ashore(states, lanes, width, how, ball, rows):
    """Take all balls out of their lanes; returns what it is given, as the kernel does."""
    for i in range(width):
        if lanes[BALL + i] != NONE:
            leave(states, lanes, i)
    return how, ball, rows
