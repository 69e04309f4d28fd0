"""A sweep, from its plan to its table and charts."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner import aggregate, chart, machine, pool, reference, report, store, worker
from runner.config import Experiment, Run, load
from runner.errors import InputError, RunError
from runner.plan import Plan, plan
from runner.result import FAILURES
from runner.worker import Task

if TYPE_CHECKING:
    import pyarrow


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
) -> pyarrow.Table:
    """Make all runs of an experiment file that `out`/<name> does not hold yet; its summary, a row per run in the folder.

    Raises InputError when the file is wrong, RunError when the runs cannot be written.
    """
    work = plan(load(path, overrides), Path(out), fresh)
    carry_out(work, jobs, timeout, fresh)
    return finish(work)


def carry_out(
    work: Plan,
    jobs: int | None = None,
    timeout: float | None = None,
    replace: bool = False,
    fail_fast: bool = False,
    progress: Progress = Progress(),
) -> None:
    """Make what is to do. Raises InputError when the folder cannot be written, RunError when a run cannot, Stopped at the first
    failure with `fail_fast`; whatever was finished stays."""
    start = datetime.now(timezone.utc).isoformat(timespec="seconds")
    source = work.experiment.document.folder
    try:
        (work.folder / store.RUNS).mkdir(parents=True, exist_ok=True)
        store.write_text(work.folder / store.EXPERIMENT, work.experiment.document.text())
        store.write_json(work.folder / store.PROVENANCE, machine.provenance(source, start, None))
    except OSError as error:
        raise InputError(f"{work.folder}: cannot be written: {error.strerror or error}") from None
    if work.todo:
        _make(work, source, jobs or os.cpu_count() or 1, timeout, replace, fail_fast, progress)
    end = datetime.now(timezone.utc).isoformat(timespec="seconds")
    store.write_json(work.folder / store.PROVENANCE, machine.provenance(source, start, end))


def _make(work: Plan, source: Path, jobs: int, timeout, replace: bool, fail_fast: bool, progress: Progress) -> None:
    with store.aside(work.folder) as aside:
        tasks = [
            Task(run.run_id, run.parameters, source, aside, store.run_folder(work.folder, run.run_id), replace, timeout)
            for run in work.todo
        ]
        jobs = min(jobs, len(tasks))

        def told(task: Task, status: str) -> None:
            progress.done(task.run_id, status)
            if fail_fast and status in FAILURES:
                raise Stopped(task.run_id)

        with pool.Workers(jobs) as workers:
            kernels = _kernels(work.todo, tasks)
            progress.compiling([_name(task) for task in kernels])
            # a kernel that cannot be compiled is told by the runs that need it
            workers.carry_out(worker.compile_kernel, kernels, lambda *_: None, lambda *_: None)
            progress.running(len(tasks))
            workers.carry_out(worker.perform, tasks, told, lambda task, cause: told(task, worker.report_crash(task, cause)))


def _kernels(runs: Sequence[Run], tasks: Sequence[Task]) -> list[Task]:
    """A task for each kernel that the runs, and their references, need."""
    kernels = {}
    for run, task in zip(runs, tasks):
        kernels.setdefault(kernel_key(run), task)
        if run.setup.reference:
            exact = reference.twin(run)
            kernels.setdefault(kernel_key(exact), task._replace(parameters=exact.parameters))
    return list(kernels.values())


def _name(kernel: Task) -> str:
    solver = kernel.parameters["solver"]
    return solver["method"] + (" (original contact)" if solver["contact"] == "original" else "")


def kernel_key(run: Run) -> tuple:
    """What kernel the run needs: runs with the same key share one."""
    from sim import engines, forces

    setup = run.setup
    fields = [field.build(run.folder) for field in setup.scene.forces.values()]
    packed, method = forces.pack(fields, setup.scene.gravity, setup.balls.mass), setup.solver.method
    if setup.solver.contact == "original":
        return method, len(packed.selective)
    return method, *engines.bindings(method, packed).values()


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
    try:
        same = (work.folder / store.EXPERIMENT).read_text(encoding="utf-8") == work.experiment.document.text()
        charts = len(os.listdir(work.folder / chart.FOLDER)) if work.experiment.charts else 0
    except (FileNotFoundError, NotADirectoryError):
        return False
    summaries = [work.folder / name for name in (f"{store.SUMMARY}.parquet", f"{store.SUMMARY}.csv", report.FILE)]
    # written last: a sweep that was stopped before has older ones, or none
    made = (work.folder / store.RUNS).stat().st_mtime
    fresh = all(path.exists() and path.stat().st_mtime >= made for path in summaries)
    return not work.todo and same and fresh and charts >= 2 * len(work.experiment.charts)  # PNG and SVG
