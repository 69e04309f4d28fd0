"""The loop that moves balls from event to event and records frames, bounces and rests.

A ball flies along one curve until the next event: it touches a surface, crosses the face of a region, a field ends for it,
it slides off a face, or its flight ends. The exact solver's curve is the true one and lasts until the event. A method with
a fixed step goes step by step on its own interpolant, and an event cuts the step. Nothing else tells the two apart.
"""

from __future__ import annotations

import numpy as np

from sim.clearance import AHEAD, clearance, way
from sim.curves.parabola import flight, point, slope  # bound to the curve's own before they are compiled
from sim.forces import Forces
from sim.impact import energy_lost, rebound
from sim.log import REST, Record, note
from sim.model import FASTEST
from sim.motion import acceleration, lying_on, motion, next_crossing, next_end, snapped
from sim.packed import Search, bare, borrowed, facing, surface_of
from sim.penetration import count_passed
from sim.rest import (
    STILL,
    Contacts,
    add,
    comes_to_rest,
    no_contacts,
    only,
    parallel,
    pressed,
    replaced,
    still_touching,
    tangent,
    time_to_rest,
    without,
)
from sim.slide import arc, edge_contact, flies_off, slide_around, slides_off, turn
from sim.solvers.exact import (  # bound to the solver's own before they are compiled
    SMALL_STEPS,
    arrive,
    depart,
    goal,
    squared_speed,
)
from sim.touch import NONE, first_touch
from sim.vector import ROUNDING, dot, norm, row, sub

MOST_EVENTS = 1_000_000  # of a ball within a second; more is a pile-up that may never end

# Columns of a ball's state.
X, V, AGE, RELEASED, END, WORK, LOST, STEPS, CROSSED, FRAME = 0, 3, 6, 7, 8, 9, 10, 11, 12, 13
COUNT, HELD, ITEMS, NORMALS = 14, 15, 16, 19  # contacts
EVENTS, SINCE = 28, 29  # events since the age SINCE (s)
LEFT = 30  # the face that the ball has just slid off
WIDTH = 31

# How a call ends.
DONE, PAUSED, DIVERGED, STALLED = 0, 1, 2, 3

# What ends a piece of flight.
NOTHING, TOUCH, FACE, OFF = 0, 1, 2, 3


def travel(states, first, dt, blur, body, forces, features, search, record, log, budget):
    """Move balls, rows of `states` numbered from `first` on, through all frames of `record`, one after the other.

    Returns (how it ended, the ball's row, rows of `log` filled). PAUSED: the log is full or `budget` pieces of flight
    are done; call it again. DIVERGED: the ball's frames from its FRAME on are not good. STALLED: its events pile up.
    """
    rows = np.int64(0)
    features, search = borrowed(features), Search(bare(search.found), bare(search.times), bare(search.stack), bare(search.passed))
    states, log = bare(states), bare(log)
    forces = Forces(bare(forces.steady), bare(forces.drive), bare(forces.selective))
    record = Record(bare(record.time), bare(record.position), bare(record.velocity), bare(record.work), bare(record.lost))
    for i in range(len(states)):
        if states[i, FRAME] >= len(record.time):
            continue
        end, rows, budget = fly(states, i, first + i, dt, blur, body, forces, features, search, record, log, rows, budget)
        if end != DONE:
            return end, i, rows
    return DONE, len(states), rows


def fly(states, i, ball, dt, blur, body, forces, features, search, record, log, rows, budget):
    """Move ball i through all frames. Returns (how it ended, rows of the log filled, what is left of the budget)."""
    s = states[i]
    x, v, age = row(states, i), (s[V], s[V + 1], s[V + 2]), s[AGE]
    frame, frames = int(s[FRAME]), len(record.time)
    released, end_of_flight = s[RELEASED], s[END]
    while frame < frames and record.time[frame] < released:
        skip(record, frame, ball)
        frame += 1
    contacts = load_contacts(s)
    mover = motion(age, x, v, forces, contacts)
    how, clear, left = DONE, 0.0, int(s[LEFT])
    while frame < frames and age < end_of_flight:
        if budget <= 0 or rows + 2 > len(log):
            how = PAUSED
            break
        budget -= 1

        # the piece: as far as nothing is known to happen before
        switch = next_end(age, forces)
        limit = min(end_of_flight, switch)
        around = edge_contact(features.faces, contacts) if contacts.count > 0 and not contacts.held else NONE
        aim = limit if contacts.held else goal(age, limit, dt)
        if around != NONE and contacts.count > 1:
            # on its way around the ball keeps no other contact, and meets again what it leans on
            contacts, around = only(contacts, around), 0
            mover = lying_on(mover, contacts)
        if around != NONE:
            aim = min(limit, age + arc(features, around, x, v, mover, body.radius))
        h = aim - age
        if contacts.held:
            curve, x1, v1 = flight(x, v, (0.0, 0.0, 0.0), 0.0, 0.0), x, v
        elif around != NONE:
            curve, x1, v1 = flight(x, v, turn(features, around, x, v, mover)[0], 0.0, 0.0), x, v
        else:
            curve, x1, v1 = depart(h, age, x, v, mover)

        # the first event on it
        what, item, place, length = NOTHING, NONE, 0.0, h
        free = contacts.held
        if SMALL_STEPS and contacts.count == 0:
            reach = way(curve, h)
            if reach >= clear:
                clear = clearance(features, search, x, body.radius, AHEAD * reach)
            free = reach < clear
            clear -= reach
        if not free:
            touched, t = first_touch(curve, features, search, body.radius, h, contacts, left)
            if touched != NONE:
                what, item, length = TOUCH, touched, t
        if not contacts.held:
            if len(forces.selective) > 0:
                axis, at, t = next_crossing(curve, x, v, forces, length)
                if t < length or (t == length and what == NOTHING):
                    what, item, place, length = FACE, axis, at, t
            if contacts.count > 0 and around == NONE:
                k, t = slides_off(curve, features, contacts, body.radius, length)
                if t < length:
                    what, item, length = OFF, k, t
        arrival = aim if length == h else age + length

        # frames on the way
        while frame < frames and record.time[frame] - released < arrival:
            t = max(record.time[frame] - released - age, 0.0)
            if contacts.held:
                xt, vt = x, v
            elif around != NONE:
                xt, vt, _ = slide_around(features, around, t, x, v, mover, body.radius)
            else:
                xt, vt = arrive(curve, t, h, x1, v1, age, x, v, mover)
            work = s[WORK] + work_done(curve, t, x, v, xt, vt, mover, body.mass)
            if not fill(record, frame, ball, xt, vt, work, s[LOST]):
                how = DIVERGED
                break
            frame += 1
        if frame == frames or how == DIVERGED:
            break

        # move to the end of it
        if contacts.held:
            x1, v1 = x, v
        elif around != NONE:
            x1, v1, normal = slide_around(features, around, length, x, v, mover, body.radius)
            contacts = replaced(contacts, around, contacts.items[around], normal)
        else:
            x1, v1 = arrive(curve, length, h, x1, v1, age, x, v, mover)
            if what == TOUCH:
                x1 = point(curve, length)
        s[WORK] += work_done(curve, length, x, v, x1, v1, mover, body.mass)
        if not free:
            s[CROSSED] += count_passed(curve, features, search, body.radius, length)
        s[STEPS] += 1.0
        x, v, age = x1, v1, arrival
        if not (dot(v, v) <= FASTEST * FASTEST and dot(x, x) < np.inf):
            how = DIVERGED
            break

        # what the event does
        if what == TOUCH:
            surface = surface_of(features, item)
            normal = facing(features, item, x)
            same = parallel(contacts, normal)
            if same != NONE:  # from an edge onto the face beside it, or the other way: no impact
                contacts = replaced(contacts, same, item, normal)
                v = tangent(v, contacts)
                mover = lying_on(mover, contacts)
            else:
                if dot(v, normal) >= 0.0:
                    v = slope(curve, length)  # a step's own velocity may differ from that of its interpolant
                if dot(v, normal) < 0.0:
                    v, vn, squared = rebound(v, normal, body.restitution, body.damping)
                    lost = energy_lost(body.mass, vn, squared, body.restitution, body.damping)
                    s[LOST] += lost
                    note(log, rows, released + age, ball, surface, x, normal, vn, np.sqrt(squared), lost)
                    rows += 1
                if dot(v, v) <= STILL * STILL:
                    v = (0.0, 0.0, 0.0)
                contacts = still_touching(v, acceleration(age, x, v, lying_on(mover, no_contacts())), contacts)
                mover = lying_on(mover, contacts)
                v = tangent(v, contacts)
                a = acceleration(age, x, v, mover)
                stays = comes_to_rest(v, a, normal, body.restitution, body.damping, blur)
                if stays and not flies_off(features, item, x, v, a, normal):
                    settled = released + age + time_to_rest(v, a, normal, body.restitution)
                    contacts = add(contacts, item, normal, body.damping > 0.0)
                    v1 = tangent(v, contacts)
                    if contacts.held or dot(v1, v1) <= STILL * STILL:
                        v1 = (0.0, 0.0, 0.0)
                    lost = 0.5 * body.mass * (dot(v, v) - dot(v1, v1))
                    s[LOST] += lost
                    note(log, rows, settled, ball, surface, x, normal, REST, norm(v1), lost)
                    rows += 1
                    v = v1
        elif what == FACE:
            x = snapped(x, item, place)
        elif what == OFF:
            contacts, item = without(contacts, item), contacts.items[item]
        if around != NONE and what == NOTHING and turn(features, around, x, v, lying_on(mover, contacts))[1] >= 0.0:
            contacts = without(contacts, around)  # it flies off the edge
        changed = what == FACE or age == switch
        if what == NOTHING and around == NONE and not changed:
            continue
        if what == OFF:
            left = item
        elif edge_contact(features.faces, contacts) == NONE:
            left = NONE
        clear = 0.0
        if len(forces.selective) > 0:
            mover = motion(age, x, v, forces, contacts)
        if changed:
            contacts = pressed(acceleration(age, x, v, lying_on(mover, no_contacts())), contacts)
        mover = lying_on(mover, contacts)

        s[EVENTS] += 1.0
        if age - s[SINCE] > 1.0:
            s[EVENTS], s[SINCE] = 0.0, age
        elif s[EVENTS] > MOST_EVENTS:
            how = STALLED
            break

    # the flight is over: the last frame may be at its very end
    while how == DONE and frame < frames:
        if record.time[frame] - released < body.lifetime - ROUNDING * record.time[frame]:
            if not fill(record, frame, ball, x, v, s[WORK], s[LOST]):
                how = DIVERGED
                break
        else:
            skip(record, frame, ball)
            record.work[frame, ball], record.lost[frame, ball] = s[WORK], s[LOST]
        frame += 1
    for k in range(3):
        s[X + k], s[V + k] = x[k], v[k]
    s[AGE], s[FRAME], s[LEFT] = age, frame, left
    save_contacts(s, contacts)
    return how, rows, budget


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


def fill(record, frame, ball, x, v, work, lost):
    """Record a ball in a frame; returns whether it is good: finite, and not too fast."""
    for k in range(3):
        record.position[frame, ball, k], record.velocity[frame, ball, k] = x[k], v[k]
    record.work[frame, ball], record.lost[frame, ball] = work, lost
    # said as "is within", so that NaN is not good
    return dot(v, v) <= FASTEST * FASTEST and dot(x, x) < np.inf


def skip(record, frame, ball):
    """Record that a ball is not alive in a frame."""
    for k in range(3):
        record.position[frame, ball, k], record.velocity[frame, ball, k] = np.nan, np.nan
    record.work[frame, ball], record.lost[frame, ball] = 0.0, 0.0


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


def depart_states(balls, duration):
    """The states (n, WIDTH) of all balls at their release."""
    states = np.zeros((len(balls), WIDTH))
    states[:, X : X + 3], states[:, V : V + 3] = balls.position, balls.velocity
    states[:, RELEASED] = balls.released
    states[:, END] = np.minimum(balls.lifetime, duration - balls.released)
    states[:, ITEMS : ITEMS + 3], states[:, LEFT] = NONE, NONE
    return states
