"""One simulation: a scene, its balls and a solver become a flight."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from sim import advance, forces, impact, integrators, jit, lanes
from sim.energy import ledger, total_energy
from sim.geometry import gather
from sim.model import BOUNCE, Balls, Energy, Fraction, Invalid, Positive, Trajectory, Vector, check

CONTACTS = ("original",)

BUDGET = 4096  # steps of a block between two looks at `stop`: milliseconds
ROOM = 4096  # bounces of a block between two looks


@dataclass(frozen=True)
class Scene:
    gravity: Vector = (0.0, -9.8, 0.0)  # m/s^2
    surfaces: Mapping[str, object] = field(default_factory=dict)  # name -> a shape of sim.shapes
    wall_mass: Positive = 200.0  # kg
    restitution: Fraction | None = None  # instead of the law of masses
    damping: Fraction = 0.05  # share of the tangential speed lost per impact
    forces: Mapping[str, forces.Field] = field(default_factory=dict)

    __post_init__ = check


@dataclass(frozen=True)
class Solver:
    method: str
    step: Positive = 1e-3  # s, of the methods with a fixed step
    tolerance: Positive = 1e-9  # of the adaptive methods
    contact: str = "swept"

    def __post_init__(self) -> None:
        check(self)
        if self.method not in integrators.names():
            state = "is not built yet" if self.method == "exact" else "is unknown"
            raise Invalid("method", f"'{self.method}' {state}; there are {', '.join(integrators.names())}")
        if self.contact not in CONTACTS:
            state = "is not built yet" if self.contact == "swept" else "is unknown"
            raise Invalid("contact", f"'{self.contact}' {state}; write contact: {' or '.join(CONTACTS)}")


@dataclass(frozen=True)
class Flight:
    """What came out of a simulation."""

    status: str  # finished or diverged, or timeout where it was stopped
    trajectory: Trajectory
    bounces: np.ndarray  # structured, BOUNCE, in order of time
    energy: Energy
    energy_initial: float  # J, of all balls released, at their release
    energy_final: float  # J, of the same balls, at the last frame or when their flight ended
    steps: int  # of all balls together
    ball_seconds: float  # s of flight of all balls together
    penetrations: int  # facets that a ball's centre passed through


def frame_times(duration: float, every: float) -> np.ndarray:
    """The recorded times in s: every multiple of `every` up to `duration`, and `duration` itself."""
    n = int(np.floor(duration / every * (1 + 1e-12)))
    times = np.arange(n + 1) * every
    times[-1] = min(times[-1], duration)
    if duration - times[-1] > 1e-9 * every:
        return np.append(times, duration)
    times[-1] = duration
    return times


class Simulation:
    """A simulation ready to run: geometry built, kernel compiled. `run` may be repeated, and gives the same each time."""

    def __init__(self, scene: Scene, balls: Balls, solver: Solver, duration: float, every: float):
        if len(balls) == 0:
            raise Invalid("balls", "none is released within the duration")
        if balls.mass > scene.wall_mass:
            raise Invalid("mass", f"must be <= wall_mass = {scene.wall_mass:g}")
        self.scene, self.balls, self.solver, self.duration = scene, balls, solver, duration
        self.time = frame_times(duration, every)
        self.facets, self.tree = gather([shape.facets() for shape in scene.surfaces.values()])
        self.fields = list(scene.forces.values())
        self.forces = forces.pack(self.fields, scene.gravity, balls.mass)
        e = scene.restitution if scene.restitution is not None else impact.restitution(balls.mass, scene.wall_mass)
        self.body = advance.Body(
            float(balls.mass), float(balls.radius), float(balls.lifetime), float(e), float(scene.damping)
        )
        self.kernel = kernel(solver.method, len(self.forces.selective))

    def warm(self) -> None:
        """Compile the kernel, or load it from disk, without moving a ball."""
        block = lanes.fill_block(0, self.balls, self.duration, self.facets)
        self._advance(block, 0, self._record(0), np.empty((ROOM, advance.COLUMNS)))

    def run(self, stop: Callable[[], bool] = lambda: False) -> Flight:
        """Move all balls through all frames; `stop` is asked now and then whether to end early, as `timeout`.

        A diverged or stopped run keeps the frames up to the last that is good for all balls.
        """
        record = self._record(len(self.time))
        starts = range(0, len(self.balls), lanes.LANES)
        blocks = [lanes.fill_block(first, self.balls, self.duration, self.facets) for first in starts]
        buffer, batches = np.empty((ROOM, advance.COLUMNS)), []
        status, done, kept = "finished", 0, len(self.time)
        interval = self.time[1] - self.time[0] if len(self.time) > 1 else self.duration
        stride = max(1, int(BUDGET * self.solver.step / interval))
        while done < kept:
            # the release is a part of its own, so that a flight has it for all balls, whatever ends it
            part = advance.Record(*(a[: min(done + stride, kept) if done else 1] for a in record))
            for block in blocks:
                frame = done
                while frame < min(len(part.time), kept):
                    frame, rows, diverged = self._advance(block, frame, part, buffer)
                    batches.append(buffer[:rows].copy())
                    if diverged:
                        status, kept = "diverged", max(frame - 1, 1)
                    if done and stop():
                        return self._flight("timeout", done, record, blocks, batches)
            done = len(part.time)
        return self._flight(status, kept, record, blocks, batches)

    def _record(self, frames: int) -> advance.Record:
        n = len(self.balls)
        return advance.Record(self.time[:frames], *(np.empty((frames, n, *k)) for k in ((3,), (3,), (), ())))

    def _advance(self, block, frame, record, buffer):
        return self.kernel(
            block, self.solver.step, self.body, self.forces, self.facets, self.tree, frame, record, buffer, BUDGET
        )

    def _flight(self, status, kept, record, blocks, batches) -> Flight:
        time, position, velocity, work, lost = (a[:kept] for a in record)
        balls, mass = self.balls, self.balls.mass

        def potential(x):
            return forces.potential(self.fields, self.scene.gravity, mass, x)

        def rows(start, count=1):
            return np.concatenate([b.s.reshape(-1, lanes.LANES)[start // lanes.LANES :][:count, : b.count].T for b in blocks])

        at_release = total_energy(mass, balls.velocity, potential(balls.position))
        with np.errstate(all="ignore"):  # a ball that diverged may be anywhere by now
            at_end = total_energy(mass, rows(lanes.V, 3), potential(rows(lanes.X, 3)))
        flew = np.clip(time[-1] - balls.released, 0, balls.lifetime)
        energy = ledger(
            time, balls.released, total_energy(mass, velocity, 0.0), potential(position), at_release, at_end, work, lost
        )
        initial = float(at_release[balls.released <= time[-1]].sum())
        return Flight(
            status=status,
            trajectory=Trajectory(time, np.rint(time / self.solver.step).astype(np.int64), position, velocity),
            # of a finished flight all: the time of one at the very end may round to after it
            bounces=bounces(np.concatenate(batches), np.inf if status == "finished" else time[-1]),
            energy=energy,
            energy_initial=initial,
            energy_final=initial + float(energy.residual[-1] + energy.work[-1] - energy.lost[-1]),
            steps=int(rows(lanes.STEPS).sum()),
            ball_seconds=float(flew.sum()),
            penetrations=int(rows(lanes.CROSSED).sum()),
        )


def bounces(rows: np.ndarray, end: float) -> np.ndarray:
    """The rows (n, advance.COLUMNS) up to the time `end` (s) as BOUNCE records, in order of time, then of ball."""
    rows = rows[rows[:, advance.TIME] <= end]
    rows = rows[np.lexsort((rows[:, advance.BALL], rows[:, advance.TIME]))]
    out, column = np.empty(len(rows), BOUNCE), 0
    for name in BOUNCE.names:
        width = int(np.prod(BOUNCE[name].shape, dtype=int))
        out[name] = rows[:, column : column + width].reshape(len(rows), *BOUNCE[name].shape)
        column += width
    return out


def kernel(method: str, selective: int) -> Callable:
    """The loop for one method and a number of selective fields; compiled at its first call, or loaded from disk."""
    return jit.bind(advance.advance, step=integrators.load(method)[1], SELECTIVE=selective)
