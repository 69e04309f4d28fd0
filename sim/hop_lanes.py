"""The lanes in which balls hop side by side."""

from typing import NamedTuple

import numpy as np

from sim.curves.parabola import flight
from sim.lanes import LANES, empty_lanes, lane
from sim.slabs import slabs
from sim.walk import Search, search_room

# Rows of the lanes, as in `sim.lanes`. First the state, then where the hop leads, in the same order.
PLACE, SPEED = 0 * LANES, 3 * LANES  # m, m/s
CLOCK, BEHIND = 6 * LANES, 7 * LANES  # s, age, and what that is too low by
WORKED, GONE = 8 * LANES, 9 * LANES  # J, done on the ball and lost at impacts since its release
COUNTED, COUNTED_FROM = 10 * LANES, 11 * LANES  # events since that age (s)
KEPT = 12 * LANES  # all of these
ENDS = 2 * KEPT  # s, age at the end of the flight; below 0 in a lane without a ball
BALL = ENDS + LANES  # its row of the states; NONE in a lane without a ball
BORN = BALL + LANES  # s, of its release
DUE = BORN + LANES  # s, age at the next frame
TAKEN = DUE + LANES  # hops since it came into the lane
LEAST, HIT = TAKEN + LANES, TAKEN + 2 * LANES  # s, to the first touch, and the face touched; NOTHING if none
NORMALS = HIT + LANES  # of that, from the surface to the ball
INTO, PAST = NORMALS + 3 * LANES, NORMALS + 4 * LANES  # m/s, normal and tangential speed of the impact
LOSS = PAST + LANES  # J, at the impact
PLAIN = LOSS + LANES  # 1 where the hop is plain
ROWS = PLAIN // LANES + 1
NOTHING = np.inf  # comes after all faces


class Room(NamedTuple):
    """What hops need."""

    lanes: np.ndarray  # (ROWS * LANES,) the rows above, to reckon in
    slabs: np.ndarray  # the faces, as `sim.slabs` has them
    others: np.ndarray
    spare: Search  # room to search in for one ball while another does


def hop_room(faces: np.ndarray, items: int = 0) -> Room:
    """Room for hops between packed faces, or with searches among so many items."""
    return Room(empty_lanes(ROWS), *slabs(faces), search_room(items))


def only_few_faces(features):
    """Whether a ball can touch but a few faces, so that all balls are held against each."""
    return len(features.tree.items) == 0 and len(features.edges) == 0


def left_in(lanes, i):
    """How long (s) the flight of the ball in lane i may last."""
    return lanes[ENDS + i] - lanes[CLOCK + i] - lanes[BEHIND + i]


def curve_in(lanes, i, pull):
    """The flight of the ball in lane i."""
    return flight(lane(lanes, PLACE, i), lane(lanes, SPEED, i), pull, 0.0, 0.0)
