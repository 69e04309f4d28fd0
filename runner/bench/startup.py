"""How long the command line takes to answer, with kernels compiled before and without."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from runner.bench.command import carom, write_experiment
from runner.bench.figure import Figure

REPEATS = 3
SMOKE = Path(__file__).parents[2] / "configs" / "smoke.yaml"  # every method; only a checkout has it


def times(told: Callable[[str], None]) -> Iterator[Figure]:
    """Wall clock and CPU of each command; `told` hears of each figure."""
    for figure in _times():
        told(str(figure))
        yield figure


def _times() -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = write_experiment(folder / "one.yaml", 1)
        sweeps = {"a sweep of one run": file} | ({"the smoke sweep, all methods": SMOKE} if SMOKE.exists() else {})
        commands = {"carom --help": ["--help"], "carom sweep --dry-run": ["sweep", file, "--dry-run"]}
        for what, command in commands.items():
            yield from _told(what, *(carom(*command, cwd=folder) for _ in range(REPEATS)))
        for what, file in sweeps.items():
            cache = tempfile.mkdtemp(dir=folder)
            command = ["sweep", file, "--fresh", "--quiet"]
            yield from _told(f"{what}, cold", carom(*command, cwd=folder, XDG_CACHE_HOME=cache))
            warm = [carom(*command, cwd=folder, XDG_CACHE_HOME=cache) for _ in range(REPEATS)]
            yield from _told(f"{what}, warm", *warm)


def _told(what, *spent) -> Iterator[Figure]:
    yield Figure(f"{what}, wall clock", min(each.wall for each in spent), "s")
    yield Figure(f"{what}, CPU", min(each.cpu for each in spent), "s")
