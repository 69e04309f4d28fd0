"""What a small run costs in a sweep, beside the bare cost of writing its two files."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path

from runner import machine, record
from runner.bench import plain_files
from runner.bench.apart import apart
from runner.bench.command import Spent, carom, write_experiment
from runner.bench.figure import Figure
from runner.config import load
from runner.execute import run
from runner.result import Result

FEW, MANY = 100, 1000  # runs of two sweeps, whose difference is free of what a sweep costs by itself
JOBS = 1, 2
REPEATS = 3
MANY_RUNS = 10_000  # to which the parent's memory is reckoned


def costs(told: Callable[[str], None], few: int = FEW, many: int = MANY) -> Iterator[Figure]:
    """`told` hears of each figure."""
    for figure in _costs(few, many):
        told(str(figure))
        yield figure


def _costs(few: int, many: int) -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with apart() as call:
            writers, plain, simulating = call(writing, write_experiment(folder / "bare.yaml", few))
        yield Figure("a run's two files written bare, in one process, wall clock", 1e3 * writers.wall, "ms")
        yield Figure("a run's two files written bare, in one process, CPU", 1e3 * writers.cpu, "ms")
        yield Figure("the same numbers written by plain calls of h5py and rerun, CPU", 1e3 * plain.cpu, "ms")
        yield Figure("a run's simulation alone, in one process, CPU", 1e3 * simulating, "ms")
        sizes = list(product(JOBS, (few, many)))
        taken = {size: [] for size in sizes}
        for repeat, (jobs, runs) in product(range(REPEATS), sizes):  # in turns: a machine that others share is slow now and then
            taken[jobs, runs].append(_sweep(folder, runs, jobs, repeat))
        spent = {}
        for jobs in JOBS:
            sweeps = [min(taken[jobs, runs]) for runs in (few, many)]
            spent[jobs] = Spent(*((b - a) / (many - few) for a, b in zip(*sweeps)))
            workers = f"{jobs} worker{'s' * (jobs > 1)}"
            yield Figure(f"runs, {workers}", 1 / spent[jobs].wall, "runs/s")
            yield Figure(f"a run, {workers}, wall clock", 1e3 * spent[jobs].wall, "ms")
            yield Figure(f"a run, {workers}, CPU of all processes", 1e3 * spent[jobs].cpu, "ms")
            against = jobs * spent[jobs].wall / writers.wall, spent[jobs].cpu / writers.cpu
            yield Figure(f"a run of a worker against its files bare, {workers}, wall clock", against[0], "")
            yield Figure(f"a run against its files bare, {workers}, CPU of all processes", against[1], "")
            yield Figure(f"a run against plain calls, {workers}, CPU of all processes", spent[jobs].cpu / plain.cpu, "")
        yield Figure("efficiency of 2 workers", spent[1].wall / spent[2].wall / 2, "")
        parent = sweeps[1].peak_memory
        yield Figure(f"the parent's peak memory at {many:,} runs", parent / 1e6, "MB")
        reckoned = parent + (MANY_RUNS - many) * spent[2].peak_memory
        yield Figure(f"the parent's peak memory at {MANY_RUNS:,} runs, reckoned from its growth", reckoned / 1e6, "MB")


def _sweep(folder: Path, runs: int, jobs: int, repeat: int) -> Spent:
    """A sweep into a folder of its own: nothing is deleted meanwhile, which slows a disk down for seconds."""
    file = write_experiment(folder / f"{runs}.yaml", runs)
    return carom("sweep", file, "--jobs", jobs, "--quiet", "--out", f"{jobs}-{repeat}", cwd=folder, telling=True)


def writing(file: Path) -> tuple[Spent, Spent, float]:
    """What it takes to write the two files of a run, carom's and plainly, and to simulate it (s, CPU): means over the runs of the
    experiment.

    They are simulated first, and written one after the other, as in a sweep none is written twice: what a writer has just seen
    costs it less. That again and again; the least of some means.
    """
    results = [run(each) for each in load(file).runs()]
    writers = [record.load(name) for name in results[0].parameters["record"]["formats"]]

    def bare(result: Result, made: Path) -> None:
        for writer in writers:
            writer.write(result, made / writer.FILE)

    simulating = sum(result.summary["sim_seconds"] for result in results) / len(results)
    return *(_least(write, results, file.parent) for write in (bare, plain_files.write)), simulating


def _least(write: Callable[[Result, Path], None], results: list[Result], folder: Path) -> Spent:
    means = []
    for repeat in range(1 + REPEATS):
        wall, cpu = time.perf_counter(), time.process_time()
        for result in results:
            made = folder / f"{write.__name__}-{repeat}" / result.run_id
            made.mkdir(parents=True)
            write(result, made)
        spent = (each / len(results) for each in (time.perf_counter() - wall, time.process_time() - cpu))
        means.append(Spent(*spent, machine.peak_memory()))
    return min(means)
