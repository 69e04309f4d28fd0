"""What each of the balls that hop side by side touches first, and when.

Where there are but a few faces vector instructions hold all balls against each; else each is searched for by itself, as `fly` of
`sim.travel` does.
"""

import numpy as np

from sim.curves.parabola import fall_straight, point, slope
from sim.first_touch import begin_search, finish_search
from sim.hop_lanes import BALL, HIT, LEAST, NORMALS, NOTHING, PLACE, SPEED, curve_in, left_in
from sim.lanes import LANES, lane, put
from sim.packed import NORMAL, POINT, SIDES, facing, vector
from sim.penetration import count_passed
from sim.rest import TOUCHING, no_contacts
from sim.slabs import AXIS, FAR, walls
from sim.touch import NONE, first_fall
from sim.vector import dot, gap, gap_along, norm, scale


def look(room, faces, radius, pull):
    """Find the first touch of all balls within their flights."""
    lanes, slabs, others, _ = room
    for i in range(LANES):
        lanes[LEAST + i], lanes[HIT + i] = left_in(lanes, i), NOTHING
    for s in range(len(slabs)):
        if pull[int(slabs[s, AXIS])] == 0.0:
            look_ahead(lanes, slabs, s, faces, radius)
        else:
            look_about(lanes, slabs, s, faces, radius, pull)
    for j in range(len(others)):
        look_at(lanes, faces, others[j], 1.0, radius, pull)
        if faces[others[j], SIDES] > 1.0:
            look_at(lanes, faces, others[j], -1.0, radius, pull)


def look_ahead(lanes, slabs, s, faces, radius):
    """The same between the walls of slab s, where nothing pulls toward them: a ball can but meet the one that it moves to."""
    k, low, high, lower, upper = walls(slabs, s)
    up, down = vector(faces, lower, NORMAL), vector(faces, upper, NORMAL)
    for i in range(LANES):
        x, v = lanes[PLACE + k * LANES + i], lanes[SPEED + k * LANES + i]
        rises = v > 0.0
        n, place = (-1.0, high) if rises else (1.0, low)
        t = fall_straight(gap_along(n, x, place, radius), n * v, radius)
        keep_first(lanes, i, upper if rises else lower, choose(rises, down, up), t if abs(place) < FAR else np.inf)


def look_about(lanes, slabs, s, faces, radius, pull):
    """The same where something pulls: on its way against that a ball meets the wall there, if it comes so far, else the other."""
    k, low, high, lower, upper = walls(slabs, s)
    turned = pull[k] > 0.0
    n, push = (-1.0, -pull[k]) if turned else (1.0, pull[k])  # of the wall that it falls on
    floor, roof = (high, low) if turned else (low, high)
    floor_face, roof_face = (upper, lower) if turned else (lower, upper)
    below, above = vector(faces, floor_face, NORMAL), vector(faces, roof_face, NORMAL)
    for i in range(LANES):
        x, v = lanes[PLACE + k * LANES + i], lanes[SPEED + k * LANES + i]
        gap_floor, gap_roof, u = gap_along(n, x, floor, radius), gap_along(-n, x, roof, radius), n * v
        rises = (u > 0.0) & (gap_roof >= -radius) & ((gap_roof <= 0.0) | (u * u - 2.0 * -push * gap_roof > 0.0))
        place, f, line = (roof, roof_face, (gap_roof, -u, -push)) if rises else (floor, floor_face, (gap_floor, u, push))
        t = first_fall(line, radius, np.inf)
        keep_first(lanes, i, f, choose(rises, above, below), t if abs(place) < FAR else np.inf)


def choose(which, one, other):
    return one[0] if which else other[0], one[1] if which else other[1], one[2] if which else other[2]


def look_at(lanes, faces, f, side, radius, pull):
    """The same for one side of any face."""
    normal, place = scale(side, vector(faces, f, NORMAL)), vector(faces, f, POINT)
    push = dot(normal, pull)
    for i in range(LANES):
        x, v = lane(lanes, PLACE, i), lane(lanes, SPEED, i)
        line = gap(normal, x, place, radius), dot(normal, v), push
        keep_first(lanes, i, f, normal, first_fall(line, radius, np.inf))


def keep_first(lanes, i, f, normal, t):
    """Note that the ball in lane i touches face f, with that normal, after t (s), if none sooner, and of those touched with it none
    of a lower number."""
    sooner = (t < lanes[LEAST + i]) | ((t == lanes[LEAST + i]) & (f < lanes[HIT + i]))
    lanes[LEAST + i] = t if sooner else lanes[LEAST + i]
    lanes[HIT + i] = f if sooner else lanes[HIT + i]
    for k in range(3):
        row = NORMALS + k * LANES + i
        lanes[row] = normal[k] if sooner else lanes[row]


def seek(room, features, search, radius, pull):
    """The same, searched for each ball by itself; returns along how many chords of curves. The search for a ball begins before that for
    the one before it is finished: so what it has found is in the cache by then."""
    lanes, spare = room.lanes, room.spare
    chords, begun, length, top, count = 0, NONE, 0.0, 0, 0
    for i in range(LANES + 1):
        if i < LANES and lanes[BALL + i] == NONE:
            continue
        far, left, found = 0.0, 0, 0
        if i < LANES:
            far, left, found = begin_search(curve_in(lanes, i, pull), features, search, radius, left_in(lanes, i), no_contacts())
        if begun != NONE:
            chords += find(lanes, begun, length, top, count, features, spare, radius, pull)
        begun, length, top, count = i, far, left, found
        search, spare = spare, search
    return chords


def find(lanes, i, length, top, count, features, search, radius, pull):
    """The same for the ball in lane i, by a search that has begun. A ball that runs along an edge, or passes through a face, is left to
    `fly`."""
    curve, end = curve_in(lanes, i, pull), left_in(lanes, i)
    item, t, near, chords = finish_search(length, top, count, curve, features, search, radius, end, no_contacts(), NONE)
    last = end if item == NONE else t
    plain = count_passed(curve, features, search, radius, last, near) == 0
    lanes[LEAST + i], lanes[HIT + i] = last, NOTHING if item == NONE else item
    if item != NONE:
        x, v = point(curve, t), slope(curve, t)
        normal = facing(features, item, x)
        plain &= item < len(features.faces) or dot(v, normal) < -TOUCHING * norm(v)
        put(lanes, NORMALS, i, normal)
    if not plain:
        lanes[LEAST + i], lanes[HIT + i] = np.inf, 0.0
    return chords
