"""How fast balls are moved: each method in each scene, on one core, warmed, the fastest of some repeats, nothing recorded."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from runner.bench.apart import apart
from runner.bench.scenes import SCENES
from runner.machine import peak_memory
from sim import integrators, jit
from sim.simulate import EXACT, Simulation, Solver

REPEATS = 5
SPREAD, PATIENCE = 0.6, 2.0  # s, over which repeats are spread, more of them if need be, and after which a case is not repeated again
STEP = 1e-3  # s
EVENTS, STEPS = "events/s", "ball-steps/s"


@dataclass(frozen=True)
class Case:
    """Balls in a scene, moved by a method for some simulated time."""

    scene: str
    method: str
    contact: str = "swept"
    duration: float | None = None  # s; the scene's own
    balls: int = 1000


@dataclass(frozen=True)
class Speed:
    """What a case took."""

    case: Case
    seconds: float  # of the processor, in the fastest repeat
    events: int  # impacts
    steps: int  # of all balls, or pieces of flight of the exact solver
    build_seconds: float  # geometry, of the processor
    compile_seconds: float  # of the kernel, or to load it; the same
    peak_memory: int  # bytes, of the process up to the end of the case

    @property
    def rate(self) -> float:
        """Impacts a second of the exact solver, ball-steps a second of a method with steps."""
        return (self.events if self.case.method == EXACT else self.steps) / self.seconds

    @property
    def unit(self) -> str:
        return EVENTS if self.case.method == EXACT else STEPS


def cases(scene: str) -> list[Case]:
    """All that is measured in a scene: on a floor the exact solver alone, in the box the original's contact rule besides."""
    named = [Case(scene, EXACT)]
    if scene != "floor":
        named += [Case(scene, name) for name in integrators.names()]
    if scene == "box":
        named += [Case(scene, name, "original") for name in integrators.fixed()]
    return named


def simulation(case: Case) -> Simulation:
    """The case ready to run but for its kernel; only its first and last frames are kept."""
    place = SCENES[case.scene]
    duration = case.duration or (place.exact if case.method == EXACT else place.stepped)
    first, _ = built(case.scene, case.contact, case.balls)
    solver = Solver(case.method, STEP, contact=case.contact)
    return Simulation(first.scene, first.balls, solver, duration, duration, like=first)


@lru_cache(maxsize=2)
def built(scene: str, contact: str, balls: int) -> tuple[Simulation, float]:
    """A simulation whose geometry others share, and the processor's seconds to build it."""
    place, method = SCENES[scene], EXACT if contact == "swept" else integrators.fixed()[0]
    jit.numba()  # imported before the clock runs
    start = time.process_time()
    first = Simulation(place.scene(), place.balls(balls), Solver(method, contact=contact), 1.0, 1.0)
    return first, time.process_time() - start


def measure(case: Case) -> Speed:
    """Raises KeyError for a scene that is none."""
    ready, (_, build_seconds) = simulation(case), built(case.scene, case.contact, case.balls)
    start = time.process_time()
    ready.warm()
    compile_seconds = time.process_time() - start
    flight, seconds = fastest(ready.run)
    return Speed(case, seconds, len(flight.bounces), flight.steps, build_seconds, compile_seconds, peak_memory())


def fastest(run: Callable[[], Any], clock: Callable[[], float] = time.process_time) -> tuple[Any, float]:
    """What run() gives, and the seconds of the fastest of some calls: of the processor, which others at work disturb less; since they
    do so for longer than a short call takes, there are more of those."""
    taken, start, spent = [], time.perf_counter(), 0.0
    while spent < PATIENCE and (len(taken) < REPEATS or spent < SPREAD):
        begin = clock()
        result = run()
        taken.append(clock() - begin)
        spent = time.perf_counter() - start
    return result, min(taken)


def speeds(told: Callable[[str], None]) -> Iterator[Speed]:
    """Every case, each scene in a process of its own; `told` hears of each."""
    for scene in SCENES:
        with apart() as call:
            for case in cases(scene):
                speed = call(measure, case)
                told(f"{scene}, {case.method}, {case.contact}: {speed.rate:.3g} {speed.unit}")
                yield speed
