"""The command line by the clock, in processes of its own, and the experiment that it is given."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from runner.errors import RunError

#: One ball and 1500 frames besides the first: a run that costs hardly more than its files.
EXPERIMENT = """\
# What does a small run cost?
scene:
  surfaces:
    floor: {{shape: rectangle, center: [0, 0, 0], normal: [0, 1, 0], size: [2, 2]}}
balls:
  released: [{{position: [0, 1, 0], velocity: [0.01, 0, 0.02]}}]
solver: {{method: symplectic_euler, step: 1.0e-3}}
duration: 15
record: {{every: 0.01, formats: [hdf5, rrd]}}
matrix:
  balls.mass: {masses}
  scene.damping: {dampings}
"""

#: `carom`, which says last how much memory it took.
TELLING = """\
import atexit, sys
from runner import cli, machine
atexit.register(lambda: print(machine.peak_memory(), file=sys.stderr))
cli.main()
"""


class Spent(NamedTuple):
    """What a command took."""

    wall: float  # s
    cpu: float  # s, with all its processes
    peak_memory: int  # bytes, of the command's own process


def write_experiment(path: Path, runs: int) -> Path:
    """An experiment of so many runs, a power of ten, each of one ball."""
    masses = 10 ** (len(str(runs)) // 2)
    text = EXPERIMENT.format(
        masses=[1 + k / masses for k in range(masses)],
        dampings=[k / (runs // masses) for k in range(runs // masses)],
    )
    path.write_text(text, encoding="utf-8")
    return path


def carom(*arguments: object, cwd: Path, telling: bool = False, **environment: str) -> Spent:
    """Run `carom` with the arguments; its peak memory is 0 unless `telling`. Raises RunError when it fails."""
    command = [sys.executable, *(("-c", TELLING) if telling else ("-m", "runner")), *map(str, arguments)]
    with open(cwd / "stderr.txt", "w+b") as errors:
        start = time.perf_counter()
        process = subprocess.Popen(command, cwd=cwd, env=os.environ | environment, stdout=subprocess.DEVNULL, stderr=errors)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        errors.seek(0)
        last = errors.read().decode(errors="replace").strip().rpartition("\n")[2]
    if process.returncode:
        raise RunError(f"carom {' '.join(map(str, arguments))}: exit code {process.returncode}: {last}")
    return Spent(wall, usage.ru_utime + usage.ru_stime, int(last) if telling else 0)
