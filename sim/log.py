"""What happens to balls, written down by the kernels: a row for each impact and each coming to rest."""

from typing import NamedTuple

import numpy as np

# Columns, the first in the order of sim.model.BOUNCE. A rest has a normal speed of -1.
TIME, BALL, SURFACE, POSITION, NORMAL, SPEED_NORMAL, SPEED_TANGENTIAL, ENERGY_LOST, COLUMNS = 0, 1, 2, 3, 6, 9, 10, 11, 12
REST = -1.0


ROOM = 65536  # rows made at once: larger pieces of memory come cheaper
LEAST = 4096  # rows worth a call of a kernel


class Log:
    """All rows so far."""

    def __init__(self):
        self._full, self._rows, self._used = [], np.empty((ROOM, COLUMNS)), 0

    def room(self) -> np.ndarray:
        """Rows (n, COLUMNS) to be written next, at least LEAST of them."""
        if self._used + LEAST > ROOM:
            self._full.append(self._rows[: self._used])
            self._rows, self._used = np.empty((ROOM, COLUMNS)), 0
        return self._rows[self._used :]

    def keep(self, count: int) -> None:
        """Of the room given last, `count` rows are written."""
        self._used += count

    def pieces(self) -> list[np.ndarray]:
        """All rows, in their order."""
        return [*self._full, self._rows[: self._used]]


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


def note(log, row, time, ball, surface, x, normal, speed_normal, speed_tangential, lost):
    """Write row `row` of the log."""
    log[row, TIME], log[row, BALL], log[row, SURFACE] = time, ball, surface
    for k in range(3):
        log[row, POSITION + k], log[row, NORMAL + k] = x[k], normal[k]
    log[row, SPEED_NORMAL], log[row, SPEED_TANGENTIAL], log[row, ENERGY_LOST] = speed_normal, speed_tangential, lost
