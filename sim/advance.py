"""The loop that moves balls by a fixed step and records frames and bounces.

What a ball does depends on nothing but its own data: it keeps its own clock, its age, and takes a step of length zero when it
has nothing to do. A frame that lies inside a step is recorded by a shorter step that is then thrown away.
"""

from __future__ import annotations

import numpy as np

from sim.contact import MISS, count_crossed, first_hit
from sim.forces import B, acceleration, driving
from sim.impact import energy_lost, rebound
from sim.handing import CARRIES, carried  # bound to the method's own, where it has one, before they are compiled
from sim.lanes import (
    A1,
    AGE,
    CROSSED,
    CROSSED1,
    CROSSES,
    END,
    LANES,
    LOST,
    LOST1,
    RELEASED,
    STEPS,
    TOUCHES,
    V1,
    WORK,
    WORK1,
    X1,
    A,
    H,
    V,
    X,
    lane,
    put,
)  # fmt: skip
from sim.log import COLUMNS, ball_in, note
from sim.model import FASTEST
from sim.packed import NORMAL, POINT, SIDES, height, vector
from sim.vector import axpy, dot, scale, sub

ROUNDING = 8 * np.finfo(float).eps  # relative error of a time computed as a product or difference


def advance(block, dt, body, forces, features, frame, record, bounces, budget):
    """Move a block on from frame number `frame`, until all frames are filled, a ball has diverged, the buffer `bounces`
    (n, COLUMNS) has no room for another step, or `budget` steps are done; call it again then.

    Returns (next frame, rows of `bounces` filled, whether the last frame shows a diverged ball).
    """
    s, rows = block.s, np.int64(0)  # typed: a literal 0 would have `attempt` compiled twice
    if CARRIES and frame == 0:
        depart(block, forces)
    while frame < len(record.time):
        now = record.time[frame]
        slack = ROUNDING * now
        least, most = due(block, dt, now, slack)
        while most > 0:
            if budget <= 0 or rows + 2 * LANES > len(bounces):
                return frame, rows, False
            pace(block, dt, least > 0, now, slack)
            rows = attempt(block, body, forces, features, bounces, rows)
            commit(block)
            for i in range(LANES):
                moves = s[H + i] > 0.0  # else it may have ended, at an age that is no multiple of dt
                s[STEPS + i] += 1.0 if moves else 0.0
                s[AGE + i] = s[STEPS + i] * dt if moves else s[AGE + i]
            least, most, budget = least - 1, most - 1, budget - 1

        # What is left of a step: the frame lies inside it, or the flight ends there.
        tried = rows
        if pace_rest(block, now, slack):
            tried = attempt(block, body, forces, features, bounces, rows)
        else:
            settle(block)
        diverged = fill_frame(block, frame, now, slack, body.lifetime, record)
        pace_ended(block, now, slack)
        rows = keep_committed(block, bounces, rows, tried)
        commit(block)
        frame += 1
        if diverged:
            return frame, rows, True
    return frame, rows, False


def depart(block, forces):
    """The acceleration at the release, which the first step begins with."""
    s = block.s
    for i in range(LANES):
        put(s, A, i, acceleration(s[AGE + i], lane(s, X, i), lane(s, V, i), forces))


def limit(s, i, now):
    """The age (s) to which lane i flies when the simulated time is `now`; below 0 before its release."""
    return min(now - s[RELEASED + i], s[END + i])


def full_steps(age, dt, slack):
    """How many whole steps dt fit into `age`, where a rest within `slack` of a step is one."""
    n = np.floor(age / dt)
    if (n + 1) * dt - age <= slack:
        n += 1
    return max(n, 0.0)


def due(block, dt, now, slack):
    """The least and the most full steps that lanes have to take to come to the simulated time `now`."""
    least, most = np.inf, 0.0
    for i in range(block.count):
        n = full_steps(limit(block.s, i, now), dt, slack) - block.s[STEPS + i]
        least, most = min(least, n), max(most, n)
    return least, most


def pace(block, dt, everyone, now, slack):
    """A full step for the lanes that have one to take, none for the others."""
    s = block.s
    for i in range(block.count):
        s[H + i] = dt if everyone or s[STEPS + i] < full_steps(limit(s, i, now), dt, slack) else 0.0


def pace_rest(block, now, slack):
    """The rest of a step that leads to the simulated time `now`, or to the end of the flight; whether there is any."""
    s, some = block.s, False
    for i in range(block.count):
        rest = limit(s, i, now) - s[AGE + i]
        s[H + i] = rest if rest > slack else 0.0
        some |= rest > slack
    return some


def pace_ended(block, now, slack):
    """Of the lanes' rests, keep those whose flight has ended, and set their clock to the end."""
    s = block.s
    for i in range(block.count):
        if now - s[RELEASED + i] >= s[END + i] - slack:
            s[AGE + i] = s[END + i]
        else:
            s[H + i] = 0.0


def attempt(block, body, forces, features, bounces, rows):
    """Write into the scratch where the lanes' steps lead, and their bounces into the buffer from `rows` on.

    Returns the end of the rows used.
    """
    s, search = block.s, block.search
    mark_touches(block, features, body.radius)
    for i in range(LANES):
        x1, v1, a1 = carried(s[H + i], s[AGE + i], lane(s, X, i), lane(s, V, i), lane(s, A, i), forces)
        put(s, X1, i, x1)
        put(s, V1, i, v1)
        if CARRIES:
            put(s, A1, i, a1)
    for i in range(LANES):
        s[LOST1 + i], s[CROSSED1 + i] = 0.0, 0.0
    if len(forces.selective) > 0 or dot(forces.drive, forces.drive) > 0.0 or forces.drive[B] > 0.0:
        add_work(s, body.mass, forces)
    mark_crosses(block, features)
    if len(features.faces) == 0:
        return rows
    for i in range(block.count):
        if s[H + i] == 0.0:
            continue
        if s[TOUCHES + i] > 0.0:
            f, distance = first_hit(features, lane(s, X, i), lane(s, V, i), body.radius, s[H + i], search)
            if f != MISS:
                bounce(block, i, f, distance, body, forces, features, bounces, rows)
                rows += 1
                continue
        if s[CROSSES + i] > 0.0:
            s[CROSSED1 + i] = count_crossed(features, lane(s, X, i), lane(s, X1, i), search)
    return rows


def mark_touches(block, features, radius):
    """Mark the lanes that may touch a face in the step: none that does is left out, some are marked in vain."""
    s, gaps, faces = block.s, block.gap, features.faces
    ask_tree = len(features.tree.items) > 0
    for i in range(LANES):
        s[TOUCHES + i] = 1.0 if ask_tree and s[H + i] > 0.0 else 0.0
    for f in range(len(gaps) // LANES):
        n0, n1, n2 = vector(faces, f, NORMAL)
        two_sided = faces[f, SIDES] > 1.0
        for i in range(LANES):
            gap = gaps[f * LANES + i]
            closing = -(n0 * s[V + i] + n1 * s[V + LANES + i] + n2 * s[V + 2 * LANES + i]) * s[H + i]
            side = -1.0 if two_sided and gap < 0.0 else 1.0
            room, closing = side * gap - radius, side * closing
            spare = 1e-12 * (abs(gap) + radius + abs(closing))  # for the rounding that first_hit does otherwise
            s[TOUCHES + i] = 1.0 if (room >= -spare) & (room <= closing + spare) else s[TOUCHES + i]


def mark_crosses(block, features):
    """Mark the lanes whose centre changes sides of a face's plane in the step."""
    s, gaps, gaps1, faces = block.s, block.gap, block.gap1, features.faces
    ask_tree = len(features.tree.items) > 0
    for i in range(LANES):
        s[CROSSES + i] = 1.0 if ask_tree and s[H + i] > 0.0 else 0.0
    for f in range(len(gaps) // LANES):
        n0, n1, n2 = vector(faces, f, NORMAL)
        p0, p1, p2 = vector(faces, f, POINT)
        for i in range(LANES):
            gap1 = n0 * (s[X1 + i] - p0) + n1 * (s[X1 + LANES + i] - p1) + n2 * (s[X1 + 2 * LANES + i] - p2)
            gaps1[f * LANES + i] = gap1
            s[CROSSES + i] = 1.0 if (gaps[f * LANES + i] >= 0.0) != (gap1 >= 0.0) else s[CROSSES + i]


def bounce(block, i, f, distance, body, forces, features, bounces, row):
    """The original's step with an impact in it: to the hit on face f at `distance` (m), on with the velocity after it for
    the rest of the step, and last a forward Euler change of the velocity over the whole step."""
    s, search, faces = block.s, block.search, features.faces
    x, v, h, t = lane(s, X, i), lane(s, V, i), s[H + i], s[AGE + i]
    delay = distance / np.sqrt(dot(v, v))
    touch = axpy(delay, v, x)
    normal = vector(faces, f, NORMAL)
    if height(faces, f, x) < 0.0:
        normal = scale(-1.0, normal)
    after, vn, vt_squared = rebound(v, normal, body.restitution, body.damping)
    x1 = axpy(h - delay, after, touch)
    put(s, X1, i, x1)
    v1 = axpy(h, acceleration(t, x, v, forces), after)
    put(s, V1, i, v1)
    if CARRIES:  # what the step has left is of where it would have led
        put(s, A1, i, acceleration(t + h, x1, v1, forces))
    for g in range(len(block.gap) // LANES):
        block.gap1[g * LANES + i] = height(faces, g, x1)

    lost = energy_lost(body.mass, vn, vt_squared, body.restitution, body.damping)
    s[LOST1 + i] = lost
    before_hit = dot(driving(t, x, v, forces), sub(touch, x))
    s[WORK1 + i] = body.mass * (before_hit + dot(driving(t, touch, after, forces), sub(x1, touch)))
    s[CROSSED1 + i] = count_crossed(features, x, touch, search) + count_crossed(features, touch, x1, search)

    time, vt = s[RELEASED + i] + t + delay, np.sqrt(vt_squared)
    note(bounces, row, time, block.first + i, features, f, touch, normal, vn, vt, lost)


def add_work(s, mass, forces):
    """Work (J) done in the step by the fields without a potential: the integral of force times velocity by Simpson's rule,
    its middle taken from the cubic through both ends. Exact for a uniform field, of order 4 for drag."""
    for i in range(LANES):
        x, v, x1, v1, h, t = lane(s, X, i), lane(s, V, i), lane(s, X1, i), lane(s, V1, i), s[H + i], s[AGE + i]
        xm = axpy(h / 8, sub(v, v1), scale(0.5, axpy(1.0, x, x1)))
        path = axpy(-h / 4, axpy(1.0, v, v1), scale(1.5, sub(x1, x)))  # h times the velocity in the middle
        vm = scale(1.0 / h if h > 0.0 else 0.0, path)
        ends = dot(driving(t, x, v, forces), v) + dot(driving(t + h, x1, v1, forces), v1)
        s[WORK1 + i] = mass * (h * ends + 4 * dot(driving(t + h / 2, xm, vm, forces), path)) / 6


def settle(block):
    """Make the scratch what steps of length zero lead to."""
    s = block.s
    for i in range(LANES):
        put(s, X1, i, lane(s, X, i))
        put(s, V1, i, lane(s, V, i))
        s[WORK1 + i], s[LOST1 + i], s[CROSSED1 + i] = 0.0, 0.0, 0.0
    for k in range(len(block.gap)):
        block.gap1[k] = block.gap[k]


def commit(block):
    """Make the scratch the state, in the lanes whose step has a length."""
    s = block.s
    for i in range(LANES):
        moves = s[H + i] > 0.0
        for row, row1 in ((X, X1), (V, V1), (A, A1)):
            if CARRIES or row != A:
                for k in range(0, 3 * LANES, LANES):
                    s[row + k + i] = s[row1 + k + i] if moves else s[row + k + i]
        s[WORK + i] += s[WORK1 + i] if moves else 0.0
        s[LOST + i] += s[LOST1 + i] if moves else 0.0
        s[CROSSED + i] += s[CROSSED1 + i] if moves else 0.0
    for f in range(0, len(block.gap), LANES):
        for i in range(LANES):
            block.gap[f + i] = block.gap1[f + i] if s[H + i] > 0.0 else block.gap[f + i]


def keep_committed(block, bounces, rows, tried):
    """Of the bounces in rows `rows` to `tried`, keep those of lanes that commit their step; returns the new end."""
    for row in range(rows, tried):
        if block.s[H + ball_in(bounces, row) - block.first] > 0.0:
            for column in range(COLUMNS):
                bounces[rows, column] = bounces[row, column]
            rows += 1
    return rows


def fill_frame(block, frame, now, slack, lifetime, record):
    """Record the frame from the scratch; returns whether a ball has diverged, even if its flight is over by then."""
    s, diverged = block.s, False
    for i in range(block.count):
        ball, age = block.first + i, now - s[RELEASED + i]
        record.work[frame, ball] = s[WORK + i] + s[WORK1 + i]
        record.lost[frame, ball] = s[LOST + i] + s[LOST1 + i]
        alive = age >= 0.0 and age < lifetime - slack
        x, v = lane(s, X1, i), lane(s, V1, i)
        for k in range(3):
            record.position[frame, ball, k] = x[k] if alive else np.nan
            record.velocity[frame, ball, k] = v[k] if alive else np.nan
        # said as "not within", so that NaN counts too
        diverged |= not (dot(v, v) <= FASTEST * FASTEST and dot(x, x) < np.inf)
    return diverged
