"""A sweep on a Dask cluster, of real processes on 127.0.0.1."""

import asyncio
import json
import os
import shutil
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from threading import Event, Thread
from types import SimpleNamespace

import pytest

from runner import config, plan, store, sweeping, worker
from runner.errors import RunError
from tests.runner.test_workers import EIGHT, hurt, left_behind, noted, seeds, trajectories, until

cluster = pytest.importorskip("runner.cluster", exc_type=ModuleNotFoundError)


class Dask:
    """A scheduler without a dashboard, and its workers."""

    def __init__(self, folder: Path, stack: ExitStack, **settings):
        self.folder, self.stack, self.workers = folder, stack, []
        self.settings = {"DASK_LOGGING__DISTRIBUTED": "critical", **settings}
        note = folder / "scheduler.json"
        self.start("scheduler", "--port", "0", "--scheduler-file", note)
        until(lambda: note.exists() and note.read_text().endswith("}"))
        self.address = json.loads(note.read_text())["address"]

    def start(self, kind: str, *arguments) -> subprocess.Popen:
        alone = ["--host", "127.0.0.1", "--no-dashboard", "--dashboard-address", "127.0.0.1:0"]
        command = [sys.executable, "-m", "dask", kind, *map(str, arguments), *alone]
        # tasks go by the names of functions, some of them in tests
        environment = os.environ | self.settings | {"PYTHONPATH": str(Path(__file__).parents[2])}
        process = subprocess.Popen(command, cwd=self.folder, env=environment, stderr=subprocess.DEVNULL)
        self.stack.callback(self.stop, process)
        return process

    def join(self, nanny: bool = False) -> subprocess.Popen:
        """A worker joins; with a nanny it is started again when it dies."""
        options = ["--nthreads", "1", "--local-directory", self.folder, "--nanny" if nanny else "--no-nanny"]
        self.workers.append(self.start("worker", self.address, *options))
        return self.workers[-1]

    @staticmethod
    def stop(process: subprocess.Popen) -> None:
        process.terminate()
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@pytest.fixture
def dask(tmp_path):
    with ExitStack() as stack:
        yield Dask(tmp_path, stack)


@pytest.fixture(scope="module")
def steady(tmp_path_factory):
    """A cluster of one worker, which is started again whenever it dies; one death is enough to blame a task."""
    with ExitStack() as stack:
        dask = Dask(tmp_path_factory.mktemp("dask"), stack, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0")
        dask.join(nanny=True)
        yield dask


class Disturbed(sweeping.Progress):
    """Has one worker killed after a tenth of the runs, and one join."""

    def __init__(self, dask: Dask):
        self.dask, self.statuses = dask, []

    def running(self, runs):
        self.runs = runs

    def done(self, run_id, status):
        self.statuses.append(status)
        if len(self.statuses) == self.runs // 10:
            self.dask.workers[0].kill()
            self.dask.join()


def sweep(path, out, overrides=None, **options):
    work = plan.plan(config.load(path, overrides), Path(out))
    sweeping.carry_out(work, **options)
    return work


@pytest.mark.parametrize("runs", [30, pytest.param(300, marks=pytest.mark.slow)])
def test_a_cluster_that_loses_a_worker_and_wins_one_makes_the_same_bytes(here, dask, runs, monkeypatch):
    Path("long.yaml").write_text(seeds(runs))
    for _ in range(3):
        dask.join()
    progress = Disturbed(dask)
    with monkeypatch.context() as patch:
        patch.setattr(worker, "take", noted)
        sweep("long.yaml", "far/outputs", cluster=dask.address, progress=progress)
    assert progress.statuses == ["finished"] * runs
    assert dask.workers[0].wait(10) == -signal.SIGKILL and [each.poll() for each in dask.workers[1:]] == [None] * 3
    made = dict(line.split() for line in (here / "made.txt").read_text().splitlines())
    joined = dask.workers[1:] if runs > 100 else dask.workers[1:3]  # a few are done before the last has come
    assert len(made) == runs and set(made.values()) >= {str(each.pid) for each in joined}
    sweep("long.yaml", "near/outputs", jobs=2)
    far, near = trajectories(here / "far"), trajectories(here / "near")
    assert len(far) == runs and far == near
    assert left_behind(here) == []


def test_files_are_sent_back(here, steady, fall):
    Path("x.yaml").write_text(fall + EIGHT)
    work = sweep("x.yaml", "far/outputs", cluster=steady.address, gather=True)
    sweep("x.yaml", "near/outputs", jobs=1)
    assert len(trajectories(here / "far")) == 8 and trajectories(here / "far") == trajectories(here / "near")
    assert {report["status"] for report in store.read_runs(work.folder)} == {"finished"}
    assert left_behind(here) == []


def test_a_run_that_kills_its_worker_or_hangs_is_told_and_costs_no_other(here, steady, fall, monkeypatch):
    Path("x.yaml").write_text(fall + "matrix: {balls.mass: [1, 2, 4, 5]}\n")
    with monkeypatch.context() as patch:
        patch.setattr(worker, "take", hurt)
        work = sweep("x.yaml", "outputs", cluster=steady.address, timeout=60)
    reports = {report["parameters"]["balls"]["mass"]: report for report in store.read_runs(work.folder)}
    assert {mass: report["status"] for mass, report in reports.items()} == {
        1: "finished", 2: "crashed", 4: "timeout", 5: "finished"
    }  # fmt: skip
    assert "1 workers died that had it, the last on 127.0.0.1: Fatal Python error: Seg" in reports[2]["error"]
    assert left_behind(here) == []


def forgotten(task: worker.Task) -> str:
    return "finished"  # in a folder that we do not see


def test_runs_that_the_folder_does_not_show_are_waited_for_and_then_told(here, steady, fall, monkeypatch):
    Path("x.yaml").write_text(fall)
    made = sweep("x.yaml", "near/outputs", jobs=1).folder / store.RUNS
    late = Thread(target=lambda: (shown.wait(), shutil.copytree(made, "far/outputs/x/runs", dirs_exist_ok=True)), daemon=True)
    shown, progress = Event(), sweeping.Progress()
    progress.done = lambda *_: shown.set()
    monkeypatch.setattr(worker, "take", forgotten)
    late.start()
    work = sweep("x.yaml", "far/outputs", cluster=steady.address, progress=progress)
    assert work.todo[0].run_id in store.done(work.folder)
    late.join()
    monkeypatch.setattr(sweeping, "SHOWN", 0)
    with pytest.raises(RunError, match=f"^{here}/far/outputs/x: 1 runs were made but are not there: .*--gather"):
        sweep("x.yaml", "far/outputs", {"balls.mass": 2}, cluster=steady.address)


def test_without_a_scheduler_it_is_a_line(here, carom, fall, monkeypatch):
    monkeypatch.setattr(cluster, "WITHIN", 0.5)
    Path("x.yaml").write_text(fall)
    code, out, err = carom("sweep", "x.yaml", "--quiet", "--cluster", "tcp://127.0.0.1:9")
    assert (code, out) == (2, "") and err.startswith("--cluster tcp://127.0.0.1:9: ") and err.count("\n") == 1, err


@pytest.mark.parametrize(
    ("threads", "shared", "versions", "told"),
    [
        (2, None, {}, "has 2 threads; it must be started with --nthreads 1"),
        (1, Path("/not/there"), {}, "does not see /not/there; --gather sends files back instead"),
        (1, None, {"numba": "0.1"}, "not 0.1"),
    ],
)
def test_a_worker_that_is_of_no_use_is_refused(threads, shared, versions, told):
    preparation = cluster._Preparation([], shared)
    preparation.versions |= versions
    joining = SimpleNamespace(address="tcp://there:1", state=SimpleNamespace(nthreads=threads))
    with pytest.raises(cluster.Unfit, match=f"^worker tcp://there:1 .*{told}"):
        asyncio.run(preparation.setup(joining))
