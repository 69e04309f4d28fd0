"""The loop that moves balls from event to event and records frames, bounces and rests.

A ball flies along one curve until the next event: it touches a surface, crosses the face of a region, a field ends for it,
it slides off a face, or its flight ends. The exact solver's curve is the true one and lasts until the event. A method with
steps goes step by step on its own interpolant, and an event cuts the step. Nothing else tells the two apart.
"""

from __future__ import annotations

import numpy as np

from sim.clearance import AHEAD, allowed, free_time, push_of
from sim.curves.parabola import flight, point, slope  # bound to the curve's own before they are compiled
from sim.first_touch import first_touch
from sim.hop import hop
from sim.impact import energy_lost, rebound
from sim.log import REST, note
from sim.model import FASTEST
from sim.motion import acceleration, lying_on, motion, next_crossing, next_end, snapped
from sim.packed import facing
from sim.penetration import count_passed
from sim.rest import (
    STILL,
    TOUCHING,
    add,
    comes_to_rest,
    no_contacts,
    parallel,
    pressed,
    replaced,
    still_touching,
    tangent,
    time_to_rest,
    turned_back,
    without,
)
from sim.slide import (
    arc,
    curves,
    falls_back,
    flies_off,
    meets,
    on_edge,
    pressing,
    put_on,
    reaches_end,
    slide_around,
    slides_off,
    turn,
)
from sim.solvers.exact import (  # bound to the solver's own before they are compiled
    SMALL_STEPS,
    arrive,
    depart,
    goal,
    hands_on,
)
from sim.state import (
    AGE,
    CROSSED,
    END,
    FLOWN,
    FRAME,
    LATE,
    LEFT,
    LOST,
    PUSHED,
    RELEASED,
    STEP,
    STEPS,
    SURE,
    WORK,
    V,
    X,
    count_event,
    fill,
    fill_rest,
    load_contacts,
    save_contacts,
    skip,
    work_done,
)
from sim.touch import NONE
from sim.vector import ROUNDING, axpy, dot, norm, row, two_sum, within

# How a call ends.
DONE, PAUSED, DIVERGED, STALLED, READY = 0, 1, 2, 3, 4

HOPS = True  # bound to whether flights are such that balls may hop

# What ends a piece of flight.
NOTHING, TOUCH, FACE, OFF = 0, 1, 2, 3


def travel(states, first, method, tolerance, blur, body, forces, features, search, room, record, log, budget):
    """Move balls, rows of `states` numbered from `first` on, through all frames of `record`: side by side while they only
    hop, else one after the other.

    Returns (how it ended, the ball's row, rows of `log` filled). PAUSED: the log is full or the budget spent, a piece of
    flight or a chord of it at a time; call it again. DIVERGED: the ball's frames from its FRAME on are not good. STALLED: its
    events pile up.
    """
    hopping = HOPS and len(forces.selective) == 0
    rows = 0
    while True:
        if HOPS and hopping:
            rows, budget = hop(states, first, body, forces, features, search, room, record, log, rows, budget)
        end, ready = DONE, 0
        for i in range(len(states)):
            if states[i, FRAME] >= len(record.time):
                continue
            end, rows, budget = fly(
                states, i, first + i, hopping, method, tolerance, blur, body, forces, features, search, record, log, rows, budget
            )
            if end == READY:
                ready += 1
            elif end != DONE:
                return end, i, rows
        if ready == 0:
            return DONE, len(states), rows


def fly(states, i, ball, hopping, method, tolerance, blur, body, forces, features, search, record, log, rows, budget):
    """Move ball i through all frames; with `hopping` only until it may hop again, or coast, which is READY.

    Returns (how it ended, rows of the log filled, what is left of the budget).
    """
    s = states[i]
    x, v, age, late = row(states, i), (s[V], s[V + 1], s[V + 2]), s[AGE], s[LATE]
    frame, frames = int(s[FRAME]), len(record.time)
    released, end_of_flight = s[RELEASED], s[END]
    while frame < frames and record.time[frame] < released:
        skip(record, frame, ball)
        frame += 1
    contacts = load_contacts(s)
    mover = motion(age, x, v, forces, contacts)
    how, left, flown, dt = DONE, int(s[LEFT]), int(s[FLOWN]), s[STEP]
    # m/s^2, s: up to that age nothing can happen if nothing pushes harder, as was seen just now, at the age it came with
    push, sure, came = (s[PUSHED], s[PUSHED + 1], s[PUSHED + 2]), s[SURE], age
    a, known = (0.0, 0.0, 0.0), False  # m/s^2, here, and whether it is left from the last step
    while frame < frames and age < end_of_flight:
        if budget <= 0 or rows + 2 > len(log):
            how = PAUSED
            break
        budget -= 1

        # the piece: as far as nothing is known to happen before
        switch = next_end(age, forces)
        limit = min(end_of_flight, switch)
        aim, curved = limit, False
        if not contacts.held:
            aim = goal(age, limit, dt)
            if contacts.count > 0:
                contacts = pressing(features, x, v, mover)
                mover = lying_on(mover, contacts)
                curved = curves(features, contacts, x)
            if flown != NONE and not curved:  # it goes on as one that slides, until a step of the method gets it away
                ahead = depart(method, aim - age, dt, tolerance, age, x, v, acceleration(age, x, v, mover), mover)[0]
                curved = falls_back(ahead, features, flown, body.radius, dt)
                flown = flown if curved else NONE
        if curved:
            aim = min(limit, age + arc(features, x, v, mover, body.radius))
        h, beyond = aim - age - late, 0.0
        if contacts.held:
            curve, x1, v1 = flight(x, v, (0.0, 0.0, 0.0), 0.0, 0.0), x, v
        elif curved:
            curve, x1, v1 = flight(x, v, turn(features, x, v, mover), 0.0, 0.0), x, v
        else:
            if not known:
                a = acceleration(age, x, v, mover)
            curve, x1, v1, a, got, dt = depart(method, h, dt, tolerance, age, x, v, a, mover)
            if got < h:
                h = got
                aim, beyond = two_sum(age, h + late)

        # the first event on it
        what, item, place, length, near = NOTHING, NONE, 0.0, h, 0
        if contacts.count > 0 and not contacts.held:
            length = reaches_end(curve, features, contacts, curved, h)
        free = contacts.held
        if SMALL_STEPS and contacts.count == 0:
            needed = push_of(curve, h, v, v1)
            if (aim > sure and age != came) or not within(needed, push):
                push = allowed(needed)
                sure = age + free_time(features, search, x, v, push, body.radius, AHEAD * h * (norm(v) + norm(push) * h))
            free = aim <= sure
        if len(forces.selective) > 0 and not contacts.held:
            axis, at, t = next_crossing(curve, x, v, forces, length)
            if t <= length:
                what, item, place, length = FACE, axis, at, t
        if not free:
            touched, t, near, chords = first_touch(curve, features, search, body.radius, length, contacts, left)
            budget -= chords
            if touched != NONE:
                what, item, length = TOUCH, touched, t
        if contacts.count > 0 and not contacts.held:
            k, t = slides_off(curve, features, contacts, body.radius, length)
            if t < length:
                what, item, length = OFF, k, t
        if curved and what == TOUCH and length > 0.0:
            length = meets(features, item, length, h, x, v, mover, body.radius)
        arrival, beyond = (aim, beyond) if length == h else two_sum(age, length + late)

        # frames on the way
        while frame < frames and record.time[frame] - released < arrival:
            t = max(record.time[frame] - released - age - late, 0.0)
            if contacts.held:
                xt, vt = x, v
            elif curved:
                xt, vt, _ = slide_around(features, t, x, v, mover, body.radius)
            else:
                xt, vt = arrive(method, curve, t, h, x1, v1, age, x, v, mover)
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
        elif curved:
            x1, v1, contacts = slide_around(features, length, x, v, mover, body.radius)
        else:
            x1, v1 = arrive(method, curve, length, h, x1, v1, age, x, v, mover)
            if what == TOUCH:
                x1 = point(curve, length)
        s[WORK] += work_done(curve, length, x, v, x1, v1, mover, body.mass)
        if not free:
            s[CROSSED] += count_passed(curve, features, search, body.radius, length, near)
        s[STEPS] += 1.0
        x, v, age, late = x1, v1, arrival, beyond
        if not (dot(v, v) <= FASTEST * FASTEST and dot(x, x) < np.inf):
            how = DIVERGED
            break

        # what the event does
        known = hands_on(method) and what == NOTHING and contacts.count == 0 and not curved and age != switch
        if what == TOUCH:
            course = slope(curve, length)
            x, v, contacts, flown, rows = strike(
                s, ball, course, length, curved, item, age, x, v, mover, contacts, flown, blur, body, features, log, rows
            )
        elif what == FACE:
            x = snapped(x, item, place)
        elif what == OFF:
            contacts, item = without(contacts, item), contacts.items[item]
        changed = what == FACE or age == switch
        if what == NOTHING and not curved and not changed:
            if SMALL_STEPS and hopping and free and contacts.count == 0:
                how = READY
                break
            continue
        if what == OFF:
            left = item
        elif flown == NONE and not on_edge(features.faces, contacts):
            left = NONE
        sure = -1.0
        if len(forces.selective) > 0:
            mover = motion(age, x, v, forces, contacts)
        if changed:
            contacts = pressed(acceleration(age, x, v, lying_on(mover, no_contacts())), contacts)
        mover = lying_on(mover, contacts)

        if not count_event(s, age):
            how = STALLED
            break
        if HOPS and hopping and contacts.count == 0 and left == NONE and flown == NONE:
            how = READY
            break

    if how == DONE and frame < frames:  # the flight is over
        frame = fill_rest(s, frame, ball, x, v, body.lifetime, record)
        how = DONE if frame == frames else DIVERGED
    for k in range(3):
        s[X + k], s[V + k], s[PUSHED + k] = x[k], v[k], push[k]
    s[AGE], s[LATE], s[FRAME], s[LEFT], s[FLOWN], s[STEP], s[SURE] = age, late, frame, left, flown, dt, sure
    save_contacts(s, contacts)
    return how, rows, budget


def strike(s, ball, course, length, curved, item, age, x, v, mover, contacts, flown, blur, body, features, log, rows):
    """What becomes of a ball that has touched `item` at x after `length` (s), on a curve that has the slope `course` (m/s) there: an
    impact, or rest.

    Returns its place, velocity and contacts, the edge that it flies off if any, and the rows of the log filled.
    """
    normal = facing(features, item, x)
    same = parallel(contacts, normal)
    if same != NONE:  # from an edge onto the face beside it, or the other way: no impact
        contacts = replaced(contacts, same, item, normal)
        if curved:
            x, contacts = put_on(features, contacts, x, body.radius)
        v = tangent(v, contacts)
        mover = lying_on(mover, contacts)
    else:
        if curved:
            x, _ = put_on(features, add(contacts, item, normal, False), x, body.radius)
        flown = NONE
        if dot(v, normal) >= -TOUCHING * norm(v) and flies_off(features, item, x, v, mover, normal):
            flown = item
        elif dot(v, normal) >= 0.0 and not curved:
            # a step's own velocity may differ from that of its interpolant, which over a short step is known less well
            v = axpy(dot(course, normal) - dot(v, normal), normal, v)
        if flown == NONE and dot(v, normal) < 0.0:
            v, vn, squared = rebound(v, normal, body.restitution, body.damping)
            lost = energy_lost(body.mass, vn, squared, body.restitution, body.damping)
            s[LOST] += lost
            note(log, rows, s[RELEASED] + age, ball, features, item, x, normal, vn, np.sqrt(squared), lost)
            rows += 1
        if dot(v, v) <= STILL * STILL:
            v = (0.0, 0.0, 0.0)
        contacts = still_touching(v, acceleration(age, x, v, lying_on(mover, no_contacts())), contacts)
        mover = lying_on(mover, contacts)
        v0 = tangent(v, contacts)
        v = turned_back(v0, normal, body.restitution, contacts)
        s[LOST] += 0.5 * body.mass * (dot(v0, v0) - dot(v, v))
        a = turn(features, x, v, mover)
        stays = comes_to_rest(v, a, normal, body.restitution, body.damping, blur)
        if stays and not flies_off(features, item, x, v, mover, normal):
            ends = time_to_rest(v, a, normal, body.restitution)
            settled = s[RELEASED] + age + (ends if ends < np.inf else 0.0)
            contacts = add(contacts, item, normal, body.damping > 0.0)
            v1 = tangent(v, contacts)
            if contacts.held or dot(v1, v1) <= STILL * STILL:
                v1 = (0.0, 0.0, 0.0)
            lost = 0.5 * body.mass * (dot(v, v) - dot(v1, v1))
            s[LOST] += lost
            note(log, rows, settled, ball, features, item, x, normal, REST, norm(v1), lost)
            rows += 1
            v = v1
        elif length == 0.0 and -4.0 * ROUNDING * norm(v) <= dot(v, normal) <= 0.0:
            v = axpy(4.0 * ROUNDING * norm(v), normal, v)  # else it might touch again at once, and again
    return x, v, contacts, flown, rows
