"""What a second thread gains in one big run, by the clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from runner.bench.apart import apart
from runner.bench.figure import Figure
from runner.bench.kernels import REPEATS, STEP
from runner.bench.scenes import SCENES
from runner.crew import crew
from sim.simulate import EXACT, Simulation, Solver

BALLS, THREADS = 100_000, 2
WORK = {EXACT: 10.0, "symplectic_euler": 0.2}  # s to simulate: some tenths of a second of work


def gains(told: Callable[[str], None]) -> Iterator[Figure]:
    """`told` hears of each figure."""
    with apart() as call:
        for method, duration in WORK.items():
            one, several = call(seconds, method, duration)
            figure = Figure(f"{BALLS:,} balls in a box, {method}, {THREADS} threads: times as fast as one", one / several, "")
            told(str(figure))
            yield figure


def seconds(method: str, duration: float, balls: int = BALLS) -> tuple[float, float]:
    """The least that the run took with one thread, and with THREADS, in turn."""
    place, least = SCENES["box"], [np.inf, np.inf]
    simulation = Simulation(place.scene(), place.balls(balls), Solver(method, STEP), duration, duration)
    simulation.warm()
    with crew(1) as one, crew(THREADS) as several:
        for _ in range(REPEATS):
            for k, hands in enumerate((one, several)):
                start = time.perf_counter()
                simulation.run(crew=hands)
                least[k] = min(least[k], time.perf_counter() - start)
    return tuple(least)
