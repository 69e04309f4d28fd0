"""How balls come into the scene. A new way is one dataclass here, in SOURCES."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le, MinLen

from sim.limits import MOST_BALLS
from sim.model import Invalid, NonNegative, Place, Positive, Vector, check, unit

Seed = Annotated[int, Ge(0), Le(2**64 - 1)]

Released = tuple[np.ndarray, np.ndarray, np.ndarray]  # time (n,) s, position (n, 3) m, velocity (n, 3) m/s


def draws(seed: int, count: int) -> np.ndarray:
    """(count, 4) numbers uniform in [0, 1); row i depends on (seed, i) alone.

    Philox (Salmon et al. 2011, doi:10.1145/2063384.2063405) turns counter i into four words; raw words, because numpy
    keeps those the same for ever and promises less for its distributions.
    """
    words = np.random.Philox(key=seed).random_raw(4 * count).reshape(count, 4)
    return (words >> np.uint64(11)) * 2.0**-53


def about(axis: np.ndarray, cosine: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """(n, 3) unit vectors at angle arccos(cosine) from the unit vector `axis`, turned by `azimuth` (rad) about it."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    side = np.cross(axis, helper)
    side /= np.linalg.norm(side)
    up = np.cross(axis, side)
    sine = np.sqrt(np.maximum(0.0, 1 - cosine**2))
    across = np.cos(azimuth)[:, None] * side + np.sin(azimuth)[:, None] * up
    return cosine[:, None] * axis + sine[:, None] * across


@dataclass(frozen=True)
class Emitter:
    """Ball i leaves `position` at time i/rate inside a cone of full opening angle `spread` about `direction`.

    The cosine of the angle to the axis is uniform in [cos(spread/2), 1], the azimuth uniform: even over the sphere.
    """

    position: Place  # m
    direction: Vector
    speed: NonNegative = 8.0  # m/s
    spread: Annotated[float, Ge(0), Le(360)] = 0.0  # degrees
    rate: Positive = 5.0  # balls/s
    seed: Seed = 0
    count: Annotated[int, Ge(1), Le(MOST_BALLS)] | None = None  # at most so many; as many as the duration lets out when absent

    def __post_init__(self) -> None:
        check(self)
        unit("direction", self.direction)

    def number(self, duration: float) -> int:
        """How many balls it may let out. Raises Invalid for too many."""
        most = min(duration * self.rate + 2, np.inf if self.count is None else self.count)
        if most > MOST_BALLS:
            raise Invalid("rate", f"lets out {most:.3g} balls; there may be {MOST_BALLS:,}")
        return int(most)

    def release(self, duration: float) -> Released:
        time = np.arange(self.number(duration)) / self.rate
        time = time[time < duration]
        u = draws(self.seed, len(time))
        cosine = 1 - u[:, 0] * (1 - np.cos(np.radians(self.spread) / 2))
        heading = about(unit("direction", self.direction), cosine, 2 * np.pi * u[:, 1])
        return time, np.tile(np.asarray(self.position, float), (len(time), 1)), self.speed * heading


@dataclass(frozen=True)
class Start:
    """One ball, released at time 0."""

    position: Place  # m
    velocity: Vector = (0.0, 0.0, 0.0)  # m/s

    __post_init__ = check


@dataclass(frozen=True)
class Listed:
    """Balls given one by one, all released at time 0."""

    released: Annotated[list[Start], MinLen(1)]

    def number(self, duration: float) -> int:
        return len(self.released)

    def release(self, duration: float) -> Released:
        position = np.array([ball.position for ball in self.released], float)
        velocity = np.array([ball.velocity for ball in self.released], float)
        return np.zeros(len(position)), position, velocity


@dataclass(frozen=True)
class Scatter:
    """`count` balls at time 0, evenly in a box, in every direction alike, speeds uniform up to `max_speed`."""

    count: Annotated[int, Ge(1), Le(MOST_BALLS)]
    box: tuple[Place, Place]  # m, two opposite corners
    max_speed: NonNegative = 0.0  # m/s
    seed: Seed = 0

    def __post_init__(self) -> None:
        check(self)
        if np.any(np.array(self.box[0]) > np.array(self.box[1])):
            raise Invalid("box", "the first corner must not lie beyond the second")

    def number(self, duration: float) -> int:
        return self.count

    def release(self, duration: float) -> Released:
        low, high = np.array(self.box, float)
        # two rows of draws a ball: place and speed, then direction
        u = draws(self.seed, 2 * self.count).reshape(self.count, 8)
        position = low + u[:, :3] * (high - low)
        heading = about(np.array([0.0, 1.0, 0.0]), 2 * u[:, 4] - 1, 2 * np.pi * u[:, 5])
        return np.zeros(self.count), position, self.max_speed * u[:, 3:4] * heading
