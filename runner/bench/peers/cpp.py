"""C++ written by hand: in steps with a ray at every triangle, and from event to event in a box that it knows beforehand."""

import shutil
import subprocess
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from runner.bench.kernels import EVENTS, STEPS
from runner.bench.peers._work import REPEATS, Answer, Peer, Work, judged

NEEDS = ("g++", "clang++")
FLAGS = ("-O3", "-march=native", "-std=c++17")
TIMEOUT = 120  # s


def in_steps(verlet: bool, prepared: bool, work: Work) -> Answer:
    """With Moller and Trumbore's test of a ray and a triangle or, `prepared`, with planes worked out beforehand."""
    how = [work.radius, work.step, work.steps, int(verlet), int(prepared), REPEATS]
    sizes = [len(work.position), len(work.triangles), *how]
    return _run("fixed_step.cpp", work, sizes, STEPS)


def by_events(work: Work) -> Answer:
    return _run("events.cpp", work, [len(work.position), work.half, work.duration, REPEATS], EVENTS)


def _run(source: str, work: Work, sizes: list, unit: str) -> Answer:
    compiler = next(filter(None, map(shutil.which, NEEDS)))
    with tempfile.TemporaryDirectory() as folder:
        program, given, made = (Path(folder) / name for name in ("program", "in", "out"))
        subprocess.run([compiler, *FLAGS, "-o", program, Path(__file__).with_name(source)], check=True)
        given.write_bytes(b"".join(a.tobytes() for a in (work.position, work.velocity, work.vertices[work.triangles])))
        command = [program, given, made, *map(repr, sizes)]
        told = subprocess.run(command, check=True, capture_output=True, text=True, timeout=TIMEOUT).stdout.split()
        return judged(work, float(told[0]), np.fromfile(made).reshape(-1, 3), int(told[1]), unit)


EULER, VERLET = ("symplectic_euler", STEPS, 0.1), ("velocity_verlet", STEPS, 1e-3)
PEERS = [
    Peer("C++, a ray every step, symplectic Euler", partial(in_steps, False, False), *EULER),
    Peer("C++, the same, planes prepared", partial(in_steps, False, True), *EULER),
    Peer("C++, a ray every step, Verlet", partial(in_steps, True, False), *VERLET),
    Peer("C++, the same, planes prepared", partial(in_steps, True, True), *VERLET),
    Peer("C++, event-driven, this box only", by_events, "exact", EVENTS, within=1e-12),
    Peer("C++, event-driven, this box only, 300 s", by_events, "exact", EVENTS, within=1e-11, duration=300.0),
]
