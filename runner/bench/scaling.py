"""How the cost grows with the work: with balls, faces, frames and runs, each from little to much, all else the same."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from runner import record
from runner.bench.apart import apart
from runner.bench.command import carom, write_experiment
from runner.bench.kernels import REPEATS, STEP, fastest
from runner.bench.scenes import SCENES, Place, hills
from runner.config import load
from runner.execute import run
from sim.simulate import EXACT, Simulation, Solver

METHODS = (EXACT, "symplectic_euler")
IN_THE_BOX, OVER_HILLS, RECORDED = 0.5, 2.0, 15.0  # s to simulate
CROWD = 1000  # balls over hills

SIZES = {
    "balls": [1, 4, 16, 64, 256, 1024, 4096, 16384, 65536, 262144, 1_000_000],
    "faces": [2 * cells**2 for cells in (1, 3, 4, 5, 8, 16, 32, 64, 128, 256, 512, 708)],
    "frames": [2, 5, 11, 31, 101, 301, 1001, 3001, 10_001, 30_001, 100_001],
    "runs": [1, 10, 100, 1000],
}


@dataclass(frozen=True)
class Point:
    """What some work took."""

    grows: str  # balls, faces, frames or runs
    what: str  # was done with them
    size: int  # how many they are
    seconds: float
    each: float  # s, of the unit of work

    def __str__(self) -> str:
        return f"{self.size:,} {self.grows}, {self.what}: {self.seconds:.3g} s"


def points(told: Callable[[str], None], sizes: dict[str, list[int]] = SIZES) -> Iterator[Point]:
    """Every point, those of each kind in a process of its own; `told` hears of each."""
    for grows, measured in (("balls", over_balls), ("faces", over_faces), ("frames", over_frames), ("runs", over_runs)):
        with apart() as call:
            call(measured, sizes[grows][0])  # imports and compiles
            for size in sizes[grows]:
                for point in call(measured, size):
                    told(str(point))
                    yield point


def over_balls(balls: int) -> list[Point]:
    """In the box; a unit is a second of one ball."""
    return list(_flights("balls", balls, SCENES["box"], balls, IN_THE_BOX))


def over_faces(faces: int) -> list[Point]:
    """Balls over hills; a unit is a second of one ball, and a face of the geometry."""
    return list(_flights("faces", faces, hills(round((faces / 2) ** 0.5)), CROWD, OVER_HILLS))


def _flights(grows: str, size: int, place: Place, balls: int, duration: float) -> Iterator[Point]:
    """The geometry built, and each method with it."""
    scene, released = place.scene(), place.balls(balls)

    def ready(method: str, like: Simulation | None = None) -> Simulation:
        return Simulation(scene, released, Solver(method, STEP), duration, duration, like)

    first, seconds = fastest(lambda: ready(EXACT))
    if grows == "faces":
        yield Point(grows, "geometry", size, seconds, seconds / size)
    for method in METHODS:
        simulation = ready(method, first)
        simulation.warm()
        _, seconds = fastest(simulation.run)
        yield Point(grows, method, size, seconds, seconds / (balls * duration))


def over_frames(frames: int) -> list[Point]:
    """One ball recorded so often, and its files; a unit is a frame."""
    found = {}
    with tempfile.TemporaryDirectory() as name:
        file = write_experiment(Path(name) / "frames.yaml", 1)
        for method in METHODS:
            often = {"record.every": RECORDED / (frames - 1), "solver.method": method, "repeats": REPEATS}
            result = run(load(file, often))
            found[method] = result.summary["sim_seconds"]
        for form in result.parameters["record"]["formats"]:
            writer = record.load(form)
            _, found[writer.FILE] = fastest(partial(writer.write, result, Path(name) / writer.FILE))
    return [Point("frames", what, frames, seconds, seconds / frames) for what, seconds in found.items()]


def over_runs(runs: int) -> list[Point]:
    """Sweeps of one ball and 1501 frames on all cores, from the command to its end; a unit is a run."""
    found = {}
    with tempfile.TemporaryDirectory() as name:
        file = write_experiment(Path(name) / f"{runs}.yaml", runs)
        for what, options in (("dry run", ["--dry-run"]), ("sweep", ["--quiet"])):
            found[what] = carom("sweep", file, *options, cwd=Path(name)).wall
    return [Point("runs", what, runs, seconds, seconds / runs) for what, seconds in found.items()]
