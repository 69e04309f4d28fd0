"""A sweep, from its plan to its table and charts."""

from __future__ import annotations

import dataclasses
import errno
import os
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner import aggregate, chart, machine, packing, pool, reference, report, store, worker
from runner.config import Experiment, Run, load
from runner.errors import InputError, RunError
from runner.plan import Plan, plan
from runner.result import FAILURES
from runner.worker import Task

if TYPE_CHECKING:
    import pyarrow


STEPS = "steps"  # what kernels of the original's contact rule have in common
SHOWN = 90  # s that a network's file system may take to show what was made elsewhere


class Progress:
    """Hears how a sweep goes on; this one says nothing of it."""

    def compiling(self, kernels: list[str]) -> None: ...

    def running(self, runs: int) -> None: ...

    def done(self, run_id: str, status: str) -> None: ...


class Stopped(Exception):
    """The sweep ended at its first failure, as it was asked to."""


def sweep(
    path: str | Path,
    overrides: Mapping[str, Any] | None = None,
    out: str | Path = "outputs",
    jobs: int | None = None,
    timeout: float | None = None,
    fresh: bool = False,
    cluster: str | None = None,
    gather: bool = False,
) -> pyarrow.Table:
    """Make all runs of an experiment file that `out`/<name> does not hold yet; its summary, a row per run in the folder.

    They are made by `jobs` processes, or as many as have `solver.threads` cores each; or by the workers of the Dask scheduler at
    the address `cluster`, which put them into the folder, or with `gather` send them back. Raises InputError when the file is
    wrong or the cluster cannot be reached, RunError when the runs cannot be written.
    """
    work = plan(load(path, overrides), Path(out), fresh)
    carry_out(work, jobs, timeout, fresh, cluster=cluster, gather=gather)
    return finish(work)


def carry_out(
    work: Plan,
    jobs: int | None = None,
    timeout: float | None = None,
    replace: bool = False,
    fail_fast: bool = False,
    progress: Progress = Progress(),
    cluster: str | None = None,
    gather: bool = False,
) -> None:
    """Make what is to do. Raises InputError when the folder cannot be written, RunError when the disk is full or a run cannot be
    written, Stopped at the first failure with `fail_fast`; whatever was finished stays."""
    start = datetime.now(timezone.utc).isoformat(timespec="seconds")
    source = work.experiment.document.folder
    try:
        (work.folder / store.RUNS).mkdir(parents=True, exist_ok=True)
        store.clear(work.folder)
        store.write_text(work.folder / store.EXPERIMENT, work.experiment.document.text())
        store.write_json(work.folder / store.PROVENANCE, machine.provenance(source, start, None))
    except OSError as error:
        kind = RunError if error.errno in (errno.ENOSPC, errno.EDQUOT) else InputError
        raise kind(f"{work.folder}: cannot be written: {error.strerror or error}") from None
    if cluster:  # its workers are not where we are
        work, source = dataclasses.replace(work, folder=work.folder.absolute()), source.absolute()
    if work.todo or packing.batches(work.folder, work.pack):
        try:
            if work.experiment.charts:  # while others work
                threading.Thread(target=chart.load).start()
            with _workers(work, jobs or (os.cpu_count() or 1) // work.threads, cluster, gather) as workers:
                _make(work, source, workers, gather, timeout, replace, fail_fast, progress)
            if cluster:
                _see(work)
        finally:
            store.clear(work.folder)
    end = datetime.now(timezone.utc).isoformat(timespec="seconds")
    store.write_json(work.folder / store.PROVENANCE, machine.provenance(source, start, end))


def _workers(work: Plan, jobs: int, cluster: str | None, gather: bool) -> pool.Workers:
    if not cluster:
        if gather:
            raise InputError("--gather needs --cluster")
        return pool.local(max(1, min(jobs, len(work.todo))))
    try:
        from runner.cluster import Cluster
    except ModuleNotFoundError:
        raise InputError("--cluster needs the package distributed: pip install 'carom[cluster]'") from None
    return Cluster(cluster, None if gather else work.folder / store.RUNS)


def _make(work: Plan, source: Path, workers: pool.Workers, gather: bool, timeout, replace, fail_fast, progress) -> None:
    aside = work.folder / store.RUNS / store.ASIDE
    tasks = [
        Task(run.run_id, run.parameters, source, aside, aside.with_name(run.run_id), replace, timeout, work.threads)
        for run in work.todo
    ]
    elsewhere = []

    def told(task: Task, status: str | None) -> bool:
        if status == worker.ELSEWHERE:
            elsewhere.append(task._replace(wait=True))
        elif status is not None:
            progress.done(task.run_id, status)
            if fail_fast and status in FAILURES:
                raise Stopped(task.run_id)
        return status is not None

    def sent(task: Task, back: tuple[str, dict[str, bytes]]) -> None:
        status, files = back
        worker.keep(task, files)
        told(task, status)

    def lost(task: Task, cause: str, deaths: int) -> bool:
        return told(task, worker.report_death(task, cause, deaths))

    def pack() -> None:
        packs = [packing.Pack(aside.parent, run_ids) for run_ids in packing.batches(work.folder, work.pack)]
        if gather:  # the runs are here
            for each in packs:
                packing.pack(each)
        else:
            workers.carry_out(packing.pack, packs, lambda *_: None, lambda *_: True)  # what is not packed stays as it is

    kernels = _kernels(work.todo, tasks)
    progress.compiling([_name(task) for task in kernels])
    workers.prepare(kernels)
    progress.running(len(tasks))
    for first in range(0, len(tasks), packing.WAVE):
        part = tasks[first : first + packing.WAVE]
        pack()
        if gather:
            workers.carry_out(worker.send, part, sent, lost)
        else:
            workers.carry_out(worker.take, part, told, lost)
    workers.carry_out(worker.take, elsewhere, told, lost)
    pack()
    packing.tidy(work.folder)


def _see(work: Plan) -> None:
    """Wait until the folder shows what other machines have put into it. Raises RunError when it does not."""
    end = time.monotonic() + SHOWN
    while missing := {run.run_id for run in work.todo} - store.done(work.folder):
        if time.monotonic() > end:
            raise RunError(
                f"{work.folder}: {len(missing)} runs were made but are not there: the workers write to another folder of this name; "
                "--gather sends files back instead"
            )
        time.sleep(1)


def _kernels(runs: Sequence[Run], tasks: Sequence[Task]) -> list[Task]:
    """A task for each kernel that the runs, and their references, need: first those that have little in common, so that workers
    do not compile the same at the same time. The original's is first of all: what the others have in common, another worker has
    compiled by when it is done."""
    kernels, alike, akin = {}, Counter(), Counter()
    for run, task in zip(runs, tasks):
        kernels.setdefault(kernel_key(run), task)
        if run.setup.reference:
            exact = reference.twin(run)
            kernels.setdefault(kernel_key(exact), task._replace(parameters=exact.parameters))

    def rank(key: tuple) -> tuple:
        curve, loop = key[0], key[:2]
        alike[loop] += 1
        akin[curve] += alike[loop] == 1
        return alike[loop], akin[curve], curve != STEPS

    return [kernels[key] for key in sorted(kernels, key=rank)]


def _name(kernel: Task) -> str:
    solver = kernel.parameters["solver"]
    return solver["method"] + (" (original contact)" if solver["contact"] == "original" else "")


def kernel_key(run: Run) -> tuple:
    """What kernel the run needs: runs with the same key share one, those that have the first two parts of it in common share nearly
    all, those that have the first, much."""
    from sim import engines, forces

    setup = run.setup
    fields = [field.build(run.folder) for field in setup.scene.forces.values()]
    packed, method = forces.pack(fields, setup.scene.gravity, setup.balls.mass), setup.solver.method
    if setup.solver.contact == "original":
        return STEPS, STEPS, method, len(packed.selective)
    return engines.curve_of(method, packed), engines.solver_of(method), method, *engines.bindings(method, packed).values()


def finish(work: Plan) -> pyarrow.Table:
    """Write the summary of all runs in the folder, the charts and the report; the summary."""
    table = aggregate.summarise(work.folder, work.experiment.columns)
    try:
        draw(work.folder, work.experiment, work.runs, table)
    except ValueError as error:
        raise RunError(f"{work.folder}: {error}") from None
    return table


def draw(folder: Path, experiment: Experiment, runs: Sequence[Run], table: pyarrow.Table) -> list[Path]:
    """Draw the charts and write the report; the files. Raises ValueError for a chart that cannot be drawn."""
    charts = chart.render(list(experiment.charts), table, folder, machine.footer()) if experiment.charts else []
    return [*charts, report.write(folder, experiment, runs, table, charts)]


def is_finished(work: Plan) -> bool:
    """Whether the folder holds all of the plan already, summary, charts and report made from the same file."""
    made_from = work.folder / store.EXPERIMENT
    if work.todo or not made_from.is_file() or made_from.read_bytes() != work.experiment.document.text().encode():
        return False
    try:
        charts = len(os.listdir(work.folder / chart.FOLDER)) if work.experiment.charts else 0
    except (FileNotFoundError, NotADirectoryError):
        return False
    summaries = [work.folder / name for name in (f"{store.SUMMARY}.parquet", f"{store.SUMMARY}.csv", report.FILE)]
    # written last: a sweep that was stopped before has older ones, or none
    made = (work.folder / store.RUNS).stat().st_mtime
    fresh = all(path.exists() and path.stat().st_mtime >= made for path in summaries)
    return fresh and charts >= 2 * len(work.experiment.charts)  # PNG and SVG
