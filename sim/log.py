"""What happens to balls, written down by the kernels: a row for each impact and each coming to rest."""

import weakref
from collections import defaultdict
from typing import NamedTuple

import numpy as np

from sim.packed import NORMAL, SIDES, vector
from sim.vector import dot

# Columns, as few as make a line of the processor's cache. A rest has a normal speed of -1.
TIME, WHO, POSITION, SPEED_NORMAL, SPEED_TANGENTIAL, ENERGY_LOST, COLUMNS = 0, 1, 2, 5, 6, 7, 8
REST = -1.0

# WHO is BALLS * what + ball, where what is the number of the feature touched, -1 - that on the side of a face that its normal points
# away from. There are fewer balls than BALLS, and no more features than such a number can tell apart.
BALLS = 2**24

LEAST = 4096  # rows worth a call of a kernel
FIRST, MOST = 2 * LEAST, 2**18  # rows made at once: larger pieces of memory come cheaper, if they are needed
SPARE = 4  # pieces of a size that are kept for the next logs: fresh memory costs up to a sixth of the time to hop

_spare: dict[int, list[np.ndarray]] = defaultdict(list)


class Log:
    """All rows so far."""

    def __init__(self):
        self._pieces, self._ends = [], []
        self._begin(FIRST)
        weakref.finalize(self, _put_by, self._pieces).atexit = False

    def room(self) -> np.ndarray:
        """Rows (n, COLUMNS) to be written next, at least LEAST of them."""
        if self._used + LEAST > len(self._pieces[-1]):
            self._ends.append(self._used)
            self._begin(min(4 * len(self._pieces[-1]), MOST))
        return self._pieces[-1][self._used :]

    def keep(self, count: int) -> None:
        """Of the room given last, `count` rows are written."""
        self._used += count

    def pieces(self) -> list[np.ndarray]:
        """All rows, in their order."""
        return [rows[:end] for rows, end in zip(self._pieces, [*self._ends, self._used])]

    def _begin(self, rows: int) -> None:
        """Go on in a new piece of so many rows."""
        try:
            piece = _spare[rows].pop()
        except IndexError:
            piece = np.empty((rows, COLUMNS))
        self._pieces.append(piece)
        self._used = 0


def _put_by(pieces: list[np.ndarray]) -> None:
    """Keep the memory of a log that is no more."""
    for piece in pieces:
        if len(_spare[len(piece)]) < SPARE:
            _spare[len(piece)].append(piece)


def rows(logs: list[Log]) -> np.ndarray:
    """All rows (n, COLUMNS) of the logs, one after the other."""
    return np.concatenate([piece for log in logs for piece in log.pieces()])


class Record(NamedTuple):
    """Where the frames go."""

    time: np.ndarray  # (frames,) s
    position: np.ndarray  # (frames, balls, 3) m
    velocity: np.ndarray  # (frames, balls, 3) m/s
    work: np.ndarray  # (frames, balls) J, since the release
    lost: np.ndarray  # (frames, balls) J, since the release


def note(log, row, time, ball, features, item, x, normal, speed_normal, speed_tangential, lost):
    """Write row `row` of the log: a ball at x (m) touches feature `item`, whose `normal` there points to it."""
    faces, what = features.faces, item
    if item < len(faces) and faces[item, SIDES] > 1.0 and dot(normal, vector(faces, item, NORMAL)) < 0.0:
        what = -1 - item
    log[row, TIME], log[row, WHO] = time, BALLS * float(what) + ball
    for k in range(3):
        log[row, POSITION + k] = x[k]
    log[row, SPEED_NORMAL], log[row, SPEED_TANGENTIAL], log[row, ENERGY_LOST] = speed_normal, speed_tangential, lost


def ball_in(log, row):
    """The ball that row `row` of the log is of."""
    return int(log[row, WHO]) & (BALLS - 1)
