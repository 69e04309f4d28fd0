"""The work that every peer does, and how its answer is judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from runner.bench.kernels import EVENTS, STEP, Case, built, simulation
from runner.bench.scenes import SIDE
from sim.simulate import Flight

GRAVITY = 9.8  # m/s^2, along -y
REPEATS = 12


@dataclass(frozen=True)
class Work:
    """n elastic balls among triangles, from time 0 to `duration`."""

    position: np.ndarray  # (n, 3) m
    velocity: np.ndarray  # (n, 3) m/s
    radius: float  # m
    vertices: np.ndarray  # (k, 3) m
    triangles: np.ndarray  # (m, 3) indices
    duration: float  # s
    truth: np.ndarray  # (n, 3) m, where the balls are in the end: in the box in closed form, else by carom's exact solver
    bounces: int  # that the exact solver counts
    step: float = STEP  # s

    @property
    def steps(self) -> int:
        return round(self.duration / self.step)

    @property
    def half(self) -> float:
        """m, how far from the middle of the box a ball's centre can be along each axis."""
        return SIDE / 2 - self.radius

    @cached_property
    def planes(self) -> np.ndarray:
        """(m, 3, 3) each triangle's unit normal, and two vectors (1/m) for its points' coordinates u, v >= 0, u + v <= 1."""
        a, b, c = np.moveaxis(self.vertices[self.triangles], 1, 0)
        n = np.cross(b - a, c - a)
        square = np.sum(n * n, axis=1, keepdims=True)
        return np.stack([n / np.sqrt(square), np.cross(c - a, n) / square, np.cross(n, b - a) / square], axis=1)

    @cached_property
    def shifts(self) -> np.ndarray:
        """(m, 3) their products with where a touching ball's centre can be (m), and with the corner that has u = v = 0."""
        corner = self.vertices[self.triangles[:, 0]]
        return np.einsum("mki,mi->mk", self.planes, corner) + (self.radius, 0, 0)


@dataclass(frozen=True)
class Answer:
    """What came out."""

    seconds: float  # of the processor, in the fastest repeat, without compiling
    count: int  # ball-steps, events or rays
    error: float  # m, RMS over the balls at the end, or over what rays found
    bounces: int | None = None

    def __post_init__(self) -> None:
        if not np.isfinite(self.error):
            raise ValueError("its answer is not finite")


@dataclass(frozen=True)
class Peer:
    """One way to do the work."""

    name: str
    solve: Callable[[Work], Answer]
    versus: str  # carom's method for the same
    unit: str  # what is counted a second
    within: float  # m, how far it may be off and still do the same work
    scene: str = "box"
    duration: float = 5.0  # s
    balls: int = 1000


@lru_cache(maxsize=4)
def work(scene: str, balls: int, duration: float) -> Work:
    position, flight = solved(Case(scene, "exact", duration=duration, balls=balls))
    first, _ = built(scene, "swept", balls)
    (surface,), start = first.scene.surfaces.values(), first.balls
    if scene == "box":
        position = in_a_box(start.position, start.velocity, start.radius, duration)
    given = start.position, start.velocity, start.radius, *surface.mesh()
    return Work(*given, duration, truth=position, bounces=len(flight.bounces))


def solved(case: Case) -> tuple[np.ndarray, Flight]:
    """Where carom has the balls in the end (n, 3) m, and their flight."""
    flight = simulation(case).run()
    return flight.trajectory.position[-1], flight


def in_a_box(position: np.ndarray, velocity: np.ndarray, radius: float, t: float) -> np.ndarray:
    """Where balls (n, 3) m of a radius (m) are at time t (s) in the box.

    Each axis goes to and fro by itself: its place is that of a phase, the time since the last turn at its lower wall, in
    numbers of more digits than those that are judged.
    """
    x, v, half = position.T.astype(np.longdouble), velocity.T.astype(np.longdouble), SIDE / 2 - np.longdouble(radius)
    with np.errstate(divide="ignore", invalid="ignore"):
        across = 2 * half / abs(v)  # s, from wall to wall at constant speed
        phase = np.where(v < 0, 2 * across - (x + half) / -v, (x + half) / v)
        end = np.where(v == 0, x, abs(v) * _fold(phase + t, across) - half)
    y, v = x[1], v[1]
    floor = np.sqrt(v * v + 2 * GRAVITY * (y + half))  # m/s, there
    ceiling = np.sqrt(np.maximum(floor**2 - 4 * GRAVITY * half, 0))  # m/s there, or none at the top of a flight
    up = (floor - ceiling) / GRAVITY  # s
    phase = np.where(v < 0, 2 * up - (floor + v) / GRAVITY, (floor - v) / GRAVITY)
    rise = _fold(phase + t, up)
    end[1] = floor * rise - GRAVITY / 2 * rise**2 - half
    return end.T.astype(float)


def _fold(phase: np.ndarray, across: np.ndarray) -> np.ndarray:
    """The time since the lower wall, were it always on the way up."""
    phase = np.mod(phase, 2 * across)
    return np.minimum(phase, 2 * across - phase)


def judged(work: Work, seconds: float, position: np.ndarray, bounces: int, unit: str) -> Answer:
    """The answer of a peer that moved balls to `position` (n, 3) m."""
    count = bounces if unit == EVENTS else work.steps * len(position)
    return Answer(seconds, count, rms(np.asarray(position, float) - work.truth), bounces)


def rms(off: np.ndarray) -> float:
    """Of vectors (n, 3) the root of their mean square."""
    return float(np.sqrt(np.mean(np.sum(off**2, axis=-1))))
