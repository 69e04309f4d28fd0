"""The layout of a block of balls: LANES side by side, one flat array of rows.

The offsets are constants and the array is one, so the compiler sees that no row overlaps another and turns a loop over the
lanes into vector instructions; with an array per quantity it does not (measured: 9 ns a step instead of 3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.memory import aligned
from sim.packed import height
from sim.walk import Search, search_room

LANES = 64

# Where each row starts. Three rows for a vector. A 1 marks scratch: what the step under way leads to.
X, V, X1, V1 = 0 * LANES, 3 * LANES, 6 * LANES, 9 * LANES  # m, m/s
WORK, WORK1 = 12 * LANES, 13 * LANES  # J, done on the ball by fields without a potential; in the step
LOST, LOST1 = 14 * LANES, 15 * LANES  # J, at impacts; in the step
CROSSED, CROSSED1 = 16 * LANES, 17 * LANES  # faces that the centre passed through; in the step
RELEASED = 18 * LANES  # s of simulated time
END = 19 * LANES  # s of age at which the flight ends; 0 in a lane without a ball
STEPS = 20 * LANES  # full steps taken
AGE = 21 * LANES  # s, at the start of the step
H = 22 * LANES  # s, length of the step; 0 in a lane that has nothing to do
TOUCHES, CROSSES = 23 * LANES, 24 * LANES  # 1 where a contact, a crossing is possible in the step
A, A1 = 25 * LANES, 28 * LANES  # m/s^2, where the method hands it on
ROWS = 31


class Block(NamedTuple):
    """Up to LANES balls under way."""

    first: int  # number of the ball in lane 0
    count: int  # lanes in use
    s: np.ndarray  # (ROWS * LANES,) the rows above
    gap: np.ndarray  # (faces * LANES,) m from each face's plane, where there is no tree
    gap1: np.ndarray  # the same after the step
    search: Search  # room to search in


def empty_lanes(rows: int) -> np.ndarray:
    """So many rows (rows * LANES,) of zeros, from the beginning of a line of the cache on, which vector instructions had better not
    straddle."""
    room = aligned((rows * LANES,))
    room[:] = 0.0
    return room


def fill_block(first: int, balls, duration: float, features) -> Block:
    """The block of the balls from number `first` on, at their release."""
    count = min(LANES, len(balls) - first)
    mine = slice(first, first + count)
    s = empty_lanes(ROWS)
    s[RELEASED : RELEASED + count] = balls.released[mine]
    s[END : END + count] = np.minimum(balls.lifetime, duration - balls.released[mine])
    for k in range(3):
        s[X + k * LANES : X + k * LANES + count] = balls.position[mine, k]
        s[V + k * LANES : V + k * LANES + count] = balls.velocity[mine, k]
    faces, tree = features.faces, features.tree
    n = len(faces)
    x = s[X : X + 3 * LANES].reshape(3, LANES)
    gap = np.concatenate([height(faces, f, x) for f in range(0 if len(tree.items) else n)] or [np.zeros(0)])
    return Block(first, count, s, gap, gap.copy(), search_room(len(features.faces) + len(features.edges)))


def lane(s, row, i):
    """The vector whose three rows start at `row`, in lane i."""
    return s[row + i], s[row + LANES + i], s[row + 2 * LANES + i]


def put(s, row, i, vector):
    s[row + i], s[row + LANES + i], s[row + 2 * LANES + i] = vector
