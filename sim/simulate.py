"""One simulation: a scene, its balls and a solver become a flight."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from sim import engines, events, forces, impact, inside, integrators, log, reduction
from sim.energy import ledger, total_energy
from sim.limits import MOST_RECORDED, MOST_STEPS
from sim.model import Balls, Body, Energy, Fraction, Invalid, Positive, Trajectory, Vector, check
from sim.packed import Packed, pack

CONTACTS = ("swept", "original")
EXACT = "exact"
METHODS = (*integrators.names(), EXACT)


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
        for name, known in (("method", METHODS), ("contact", CONTACTS)):
            if getattr(self, name) not in known:
                raise Invalid(name, f"'{getattr(self, name)}' is unknown; there are {', '.join(known)}")
        if not self.stepping and self.contact != "swept":
            raise Invalid("contact", f"the method {self.method} knows swept contact only")

    @property
    def adaptive(self) -> bool:
        """Whether the method goes by `tolerance`."""
        return self.method != EXACT and integrators.load(self.method)[0].adaptive

    @property
    def stepping(self) -> bool:
        """Whether the method goes by `step`."""
        return self.method != EXACT and not self.adaptive

    def check_steps(self, duration: float) -> None:
        """Raises Invalid where there would be too many."""
        if self.stepping and not duration / self.step <= MOST_STEPS:
            raise Invalid("step", f"makes {duration / self.step:.3g} steps; there may be {MOST_STEPS:,}")


@dataclass(frozen=True)
class Flight:
    """What came out of a simulation."""

    status: str  # finished, rested, diverged, or timeout where it was stopped
    trajectory: Trajectory
    logs: list[log.Log]  # all impacts and rests; those of a ball in one of them, in their order
    features: Packed  # what they speak of
    end: float  # s, up to which they count
    energy: Energy
    energy_initial: float  # J, of all balls released, at their release
    energy_final: float  # J, of the same balls, at the last frame or when their flight ended
    steps: int  # of all balls together
    ball_seconds: float  # s of flight of all balls together
    resting: int  # balls at rest on a surface when their flight or the simulation ends
    penetrations: int  # faces that a ball's centre passed through

    @cached_property
    def bounces(self) -> np.ndarray:
        """Impacts: structured, BOUNCE, in order of time, then of ball."""
        return events.bounces(log.rows(self.logs), self.end, self.features)

    @cached_property
    def rests(self) -> np.ndarray:
        """Each coming to rest, or to a slide, on a surface: structured, REST, in order of time, then of ball."""
        return events.rests(log.rows(self.logs), self.end, self.features)


def frame_count(duration: float, every: float) -> float:
    """How many times are recorded; infinity where they cannot be counted."""
    n = float(np.floor(duration / every * (1 + 1e-12)))
    return n + 1 + (duration - n * every > 1e-9 * every)


def check_records(balls: int, duration: float, every: float) -> None:
    """Raises Invalid where there would be too many."""
    records = balls * frame_count(duration, every)
    if not records <= MOST_RECORDED:
        raise Invalid("every", f"makes {records:.3g} records, of each ball in each frame; there may be {MOST_RECORDED:,}")


def frame_times(duration: float, every: float) -> np.ndarray:
    """The recorded times in s: every multiple of `every` up to `duration`, and `duration` itself."""
    times = np.arange(int(frame_count(duration, every))) * every
    times[-1] = duration
    return times


class Crew(NamedTuple):
    """Who moves the balls: so many at once as `size` tells.

    each(function, hands) calls the function with each of the hands, and gives what they return, in any order. What one of the
    calls raises it raises when all have ended.
    """

    size: int = 1
    each: Callable = map


class Hand(NamedTuple):
    """What one of a crew has to itself: whatever is written by a kernel, but for the balls' own columns in the record."""

    parts: list  # of the engine's, the balls
    room: tuple  # to compute in
    log: log.Log


class Simulation:
    """A simulation ready to run: geometry built, kernel compiled. `run` may be repeated, and gives the same each time.

    The geometry is taken from `like` where that has the same: then none looks again whether a ball starts inside a surface.
    """

    def __init__(
        self, scene: Scene, balls: Balls, solver: Solver, duration: float, every: float, like: Simulation | None = None
    ):
        if len(balls) == 0:
            raise Invalid("balls", "none is released within the duration")
        if balls.mass > scene.wall_mass:
            raise Invalid("mass", f"must be <= wall_mass = {scene.wall_mass:g}")
        check_records(len(balls), duration, every)
        solver.check_steps(duration)
        self.scene, self.balls, self.solver = scene, balls, solver
        self.time = frame_times(duration, every)
        self.fields = list(scene.forces.values())
        e = scene.restitution if scene.restitution is not None else impact.restitution(balls.mass, scene.wall_mass)
        body = Body(float(balls.mass), float(balls.radius), float(balls.lifetime), float(e), float(scene.damping))
        packed = forces.pack(self.fields, scene.gravity, balls.mass)
        shared = like is not None and like.shares_geometry(scene, balls, solver)
        self.features, self.reductions = (like.features, like.reductions) if shared else self._geometry()
        engine = engines.Swept if solver.contact == "swept" else engines.Original
        self.engine = engine(solver, balls, duration, body, packed, self.features)

    def shares_geometry(self, scene: Scene, balls: Balls, solver: Solver) -> bool:
        """Whether balls in a scene can touch what they can here. Where they start matters to surfaces that may have an inside."""
        surfaces, others = list(self.scene.surfaces.items()), list(scene.surfaces.items())
        starts = not any(shape.solid for _, shape in surfaces) or np.array_equal(self.balls.position, balls.position)
        return surfaces == others and self.solver.contact == solver.contact and starts

    def _geometry(self) -> tuple[Packed, list[reduction.Reduction]]:
        """What the balls can touch, and what was reduced. Raises Invalid when one starts inside a surface."""
        swept, surfaces = self.solver.contact == "swept", self.scene.surfaces
        # the original's rule knows no edges, and lets balls through to where they did not start
        starts = self.balls.position if swept else np.zeros((0, 3))
        features, reductions = reduction.features(list(surfaces.values()), starts, edges=swept)
        if swept and (sunk := inside.starts_inside(surfaces, features, self.balls)):
            raise Invalid("balls", sunk[1])
        return pack(features), reductions

    def warm(self) -> None:
        """Compile the kernel, or load it from disk, without moving a ball."""
        (room,) = self.engine.rooms(1)
        self.engine.move(self.engine.parts(1)[0], 0, self._record(0), room, log.Log().room())

    def run(self, stop: Callable[[], bool] = lambda: False, crew: Crew = Crew()) -> Flight:
        """Move all balls through all frames; `stop` is asked now and then whether to end early, as `timeout`.

        A diverged or stopped run keeps the frames up to the last that is good for all balls. Whatever the size of the crew, the
        flight is the same to the last bit. Raises engines.Stalled.
        """
        try:
            return self._run(stop, crew)
        except engines.Stalled:
            if crew.size == 1:
                raise
        return self._run(stop, Crew())  # so that it is told of the same ball

    def _run(self, stop: Callable[[], bool], crew: Crew) -> Flight:
        record, parts = self._record(len(self.time)), self.engine.parts(crew.size)
        size = min(crew.size, len(parts))
        hands = [Hand(parts[k::size], room, log.Log()) for k, room in enumerate(self.engine.rooms(size))]
        done, kept, over = 0, len(self.time), []
        while done < kept and not over:
            # the release is a stage of its own, so that a flight has it for all balls, whatever ends it
            stage = log.Record(*(a[: done + self.engine.stride(self.time) if done else 1] for a in record))
            try:
                kept = min(kept, *crew.each(partial(self._move, stage, done, stop, over), hands))
            except BaseException:
                over.append(True)  # an interruption is heard by one alone
                raise
            done = done if over else len(stage.time)
        status = "timeout" if over else "finished" if kept == len(self.time) else "diverged"
        return self._flight(status, done if over else kept, record, self.engine.ends(parts), [hand.log for hand in hands])

    def _move(self, stage: log.Record, done: int, stop: Callable[[], bool], over: list, hand: Hand) -> int:
        """Move the balls of a hand through the frames of `stage` from number `done` on, unless it is `over`; returns how many
        frames are good for them, of all there are."""
        good = len(self.time)
        try:
            for part in hand.parts:
                frame = done
                while frame < len(stage.time) and not over:
                    frame, count, bad = self.engine.move(part, frame, stage, hand.room, hand.log.room())
                    hand.log.keep(count)
                    if bad is not None:
                        good = min(good, max(bad, 1))
                    if done and stop():
                        over.append(True)
        except BaseException:
            over.append(True)
            raise
        return good

    def _steps(self, time: np.ndarray) -> np.ndarray:
        """The steps (frames,) of the method since time 0; where they are not of one length, the frames count."""
        return np.rint(time / self.solver.step).astype(np.int64) if self.solver.stepping else np.arange(len(time))

    def _record(self, frames: int) -> log.Record:
        n = len(self.balls)
        return log.Record(self.time[:frames], *(np.empty((frames, n, *k)) for k in ((3,), (3,), (), ())))

    def _flight(self, status, kept, record, ends, logs) -> Flight:
        time, position, velocity, work, lost = (a[:kept] for a in record)
        balls, mass = self.balls, self.balls.mass

        def potential(x):
            return forces.potential(self.fields, self.scene.gravity, mass, x)

        at_release = total_energy(mass, balls.velocity, potential(balls.position))
        with np.errstate(all="ignore"):  # a ball that diverged may be anywhere by now
            at_end = total_energy(mass, ends.velocity, potential(ends.position))
        if status == "finished" and ends.at_rest.all():
            status = "rested"
        flew = np.clip(time[-1] - balls.released, 0, balls.lifetime)
        energy = ledger(
            time, balls.released, total_energy(mass, velocity, 0.0), potential(position), at_release, at_end, work, lost
        )
        initial = float(at_release[balls.released <= time[-1]].sum())
        return Flight(
            status=status,
            trajectory=Trajectory(time, self._steps(time), position, velocity),
            logs=logs,
            features=self.features,
            # of a finished flight all: the time of one at the very end may round to after it
            end=time[-1] if status in ("diverged", "timeout") else np.inf,
            energy=energy,
            energy_initial=initial,
            energy_final=initial + float(energy.residual[-1] + energy.work[-1] - energy.lost[-1]),
            steps=ends.steps,
            ball_seconds=float(flew.sum()),
            resting=int(ends.at_rest.sum()),
            penetrations=ends.passed,
        )
