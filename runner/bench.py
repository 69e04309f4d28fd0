"""How fast the simulation is on this machine: each case on one core, warmed, the fastest of some repeats."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np

from sim import integrators
from sim.model import Balls
from sim.release import Scatter
from sim.shapes import Box, Heightfield, Plane
from sim.simulate import EXACT, Scene, Simulation, Solver

REPEATS = 5
STEP = 1e-3  # s

#: The scenes, elastic and under gravity: surfaces, where the balls start, their radius in m.
SCENES = {
    "floor": ({"floor": Plane()}, ((-5.0, 0.5, -5.0), (5.0, 3.0, 5.0)), 0.05),
    "box": ({"room": Box((0, 0, 0), (2, 2, 2), inside=True)}, ((-0.9, -0.9, -0.9), (0.9, 0.9, 0.9)), 0.05),
    "heightfield 80,000": (
        {"field": Heightfield((40, 40), (200, 200), "0.5*sin(x)*cos(z)")}, ((-10.0, 1.0, -10.0), (10.0, 2.5, 10.0)), 0.05,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """1000 balls (or fewer) in a scene, moved by a method for some simulated time."""

    scene: str
    method: str
    contact: str
    duration: float  # s
    balls: int = 1000


@dataclass(frozen=True)
class Speed:
    """What a case took."""

    case: Case
    seconds: float  # of the fastest repeat
    events: int  # impacts
    steps: int  # of all balls, or pieces of flight of the exact solver
    build_seconds: float  # geometry
    compile_seconds: float  # of the kernel, or to load it

    @property
    def rate(self) -> float:
        """Impacts a second of the exact solver, ball-steps a second of a method with steps."""
        return (self.events if self.case.method == EXACT else self.steps) / self.seconds

    @property
    def unit(self) -> str:
        return "events/s" if self.case.method == EXACT else "ball-steps/s"


def cases() -> list[Case]:
    exact = [Case(scene, EXACT, "swept", duration) for scene, duration in zip(SCENES, (600.0, 300.0, 20.0))]
    stepped = [Case("box", name, "swept", 1.0) for name in integrators.names()]
    stepped += [Case("box", name, "original", 1.0) for name in integrators.fixed()]
    return exact + stepped


def measure(case: Case) -> Speed:
    surfaces, where, radius = SCENES[case.scene]
    released, position, velocity = Scatter(case.balls, where, 5.0 if case.scene == "box" else 1.0).release(case.duration)
    balls = Balls(1.0, radius, np.inf, released, position, velocity)
    start = time.perf_counter()
    scene, solver = Scene(surfaces=surfaces, restitution=1.0, damping=0.0), Solver(case.method, STEP, contact=case.contact)
    simulation = Simulation(scene, balls, solver, case.duration, case.duration)
    built = time.perf_counter()
    simulation.warm()
    compiled, seconds = time.perf_counter(), np.inf
    for _ in range(REPEATS):
        begin = time.perf_counter()
        flight = simulation.run()
        seconds = min(seconds, time.perf_counter() - begin)
    return Speed(case, seconds, len(flight.bounces), flight.steps, built - start, compiled - built)


def speeds() -> Iterator[Speed]:
    """Every case, one after the other, as they come."""
    return map(measure, cases())


def record(speed: Speed) -> dict:
    """The figures as JSON can hold them."""
    return asdict(speed) | {"rate": speed.rate, "unit": speed.unit}
