"""Worker processes: the same bytes however many there are, and none left behind."""

import ctypes
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import h5py
import pytest

from runner import config, plan, store, sweeping, worker

TAKE, PERFORM = worker.take, worker.perform
EIGHT = """\
matrix:
  solver.method: [explicit_euler, rk4_original]
  balls.mass: [1, 2]
  scene.surfaces.floor.point: [[0, 0, 0], [0, 0.5, 0]]
"""
MANY = 60


def seeds(count: int) -> str:
    """An experiment whose runs take some 50 ms each, so that a signal finds the sweep at work."""
    return f"""\
# Does it stop when it is told to?
scene: {{surfaces: {{room: {{shape: box, center: [0, 0, 0], size: [2, 2, 2], inside: true}}}}}}
balls: {{scatter: {{count: 100, box: [[-0.9, -0.9, -0.9], [0.9, 0.9, 0.9]], max_speed: 5}}}}
solver: {{method: explicit_euler, step: 1.0e-4, contact: original}}
duration: 1
record: {{formats: [hdf5], every: 0.1}}
matrix: {{balls.scatter.seed: {list(range(count))}}}
"""


def trajectories(folder: Path) -> dict[str, bytes]:
    return {path.parent.name: path.read_bytes() for path in folder.glob("outputs/*/runs/*/trajectory.h5")}


def test_the_same_bytes_with_one_worker_with_two_and_again(tmp_path, carom_process, carom, inline, monkeypatch, fall):
    found = []
    for jobs, name in ((1, "a"), (2, "b")):
        folder = tmp_path / name  # its own folder: where a sweep runs must not matter either
        folder.mkdir()
        (folder / "x.yaml").write_text(fall + EIGHT)
        assert carom_process("sweep", "x.yaml", "--jobs", jobs, cwd=folder).code == 0
        found.append(trajectories(folder))
    monkeypatch.chdir(folder)
    assert carom("sweep", "x.yaml", "--fresh").code == 0  # in this process
    assert len(found[0]) == 8 and found[0] == found[1] == trajectories(folder)


def test_the_same_bytes_in_another_order_and_resumed(here, carom, inline, fall):
    """What a worker keeps from one run to the next must not show."""
    Path("x.yaml").write_text(fall + EIGHT)
    assert carom("sweep", "x.yaml", "--out", "a").code == 0
    backwards = "scene.surfaces.floor.point=[0, 0.5, 0],[0, 0, 0]"
    assert carom("sweep", "x.yaml", "--out", "b", "-s", "balls.mass=2", "-s", backwards).code == 0
    assert carom("sweep", "x.yaml", "--out", "b").code == 0
    one, other = ({path.parent.name: path.read_bytes() for path in Path(out).rglob("trajectory.h5")} for out in "ab")
    assert len(one) == 8 and one == other


NOTED = """\
from runner import sweeping, worker
from tests.runner.test_workers import noted
worker.take = noted
print(len(sweeping.sweep("x.yaml", jobs=2)))
"""


def noted(task: worker.Task) -> str:
    """Take the task; each run that is really made is a line of a file, and in it the process."""

    def perform(task):
        with open("made.txt", "a") as made:
            made.write(f"{task.run_id} {os.getpid()}\n")
        return PERFORM(task)

    worker.perform = perform
    return TAKE(task)


def test_two_sweeps_into_one_folder_make_no_run_twice_and_both_have_them_all(tmp_path):
    few = 20
    (tmp_path / "x.yaml").write_text(seeds(few))
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    both = [
        subprocess.Popen([sys.executable, "-c", NOTED], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    assert [each.communicate(timeout=200)[0] for each in both] == [f"{few}\n"] * 2
    made = [line.split()[0] for line in (tmp_path / "made.txt").read_text().splitlines()]
    assert sorted(made) == sorted(trajectories(tmp_path)) and len(made) == few
    assert left_behind(tmp_path) == []


# Runs that end their process


def hurt(task: worker.Task) -> str:
    """Take the task; what mass its ball has tells what its run does to the process."""

    def perform(task):
        match task.parameters["balls"]["mass"]:
            case 2:
                ctypes.string_at(0)
            case 3:
                os.kill(os.getpid(), signal.SIGKILL)
            case 4:
                ctypes.PyDLL(None).sleep(100)  # in C, and no other thread can run
            case 9:
                os.kill(os.getpid(), signal.SIGSTOP)  # no thread runs
        return PERFORM(task)

    worker.perform = perform
    if task.parameters["balls"]["mass"] in (4, 9):
        worker.GRACE, worker.PATIENCE, task = 0.2, 2.0, task._replace(timeout=0.1)
    return TAKE(task)


def test_a_run_that_crashes_or_hangs_costs_no_other(here, fall, monkeypatch):
    Path("x.yaml").write_text(fall + "matrix: {balls.mass: [1, 2, 3, 4, 5, 6, 7, 8, 9]}\n")
    work, heard = plan.plan(config.load("x.yaml"), Path("outputs")), []
    progress = sweeping.Progress()
    progress.done = lambda run_id, status: heard.append(status)
    with monkeypatch.context() as patch:
        patch.setattr(worker, "take", hurt)
        sweeping.carry_out(work, jobs=2, timeout=60, progress=progress)

    assert sorted(heard) == ["crashed"] * 2 + ["finished"] * 5 + ["timeout"] * 2 and left_behind(here) == []
    reports = {report["parameters"]["balls"]["mass"]: report for report in store.read_runs(work.folder)}
    assert [reports[mass]["status"] for mass in range(1, 9)] == ["finished", "crashed", "crashed", "timeout"] + ["finished"] * 4
    assert (reports[9]["status"], reports[9]["error"]) == ("timeout", "its worker stood still, and was ended after 75 s")
    assert reports[2]["error"] == "its worker died by SIGSEGV: Fatal Python error: Segmentation fault"
    assert any("in string_at" in line for line in reports[2]["last_words"])
    assert (reports[3]["error"], reports[3]["last_words"]) == ("its worker died by SIGKILL", [])
    assert reports[4]["error"] == "hung, and was ended after 65 s"
    assert any("in perform" in line for line in reports[4]["last_words"])

    again = plan.plan(config.load("x.yaml"), Path("outputs"), retry_failed=True)
    assert {run.setup.balls.mass for run in again.todo} == {2, 3, 4, 9}


# Stopped from outside


def test_an_error_that_is_no_text_is_told(tmp_path, monkeypatch):
    def fail(*_):
        raise ValueError("no mesh: \udcff.stl")

    monkeypatch.setattr(worker, "_simulate", fail)
    task = worker.Task("x", {}, tmp_path, tmp_path / ".aside", tmp_path / "x", False, None)
    assert worker.perform(task) == "failed"
    assert store.contents(task.final)["error"] == "ValueError: no mesh: \\udcff.stl"


def start(folder, *arguments):
    """A sweep that leads a process group of its own."""
    command = [sys.executable, "-m", "runner", "sweep", *arguments]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def processes() -> dict[int, tuple[int, str]]:
    """Every process: its session and its start time, which tells it from a later one of the same number."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with suppress(OSError):
                state, _, _, session, *rest = (entry / "stat").read_text().rpartition(")")[2].split()
                if state != "Z":
                    found[int(entry.name)] = int(session), rest[15]
    return found


def members(session: int) -> set[int]:
    return {pid for pid, (of, _) in processes().items() if of == session}


def left_behind(folder: Path) -> list[str]:
    return [path.name for path in folder.rglob(".*")]


def until(condition, seconds=60):
    """Wait until the condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


@pytest.fixture
def at_work(tmp_path):
    """A sweep under way, with two workers and some runs done; whatever is left of it is ended."""
    (tmp_path / "long.yaml").write_text(seeds(MANY))
    sweep = start(tmp_path, "long.yaml", "--jobs", "2")
    try:
        until(lambda: sweep.poll() is not None or len(trajectories(tmp_path)) >= 4)
        assert sweep.poll() is None, sweep.communicate()
        assert len(members(sweep.pid)) >= 3
        yield sweep
    finally:
        with suppress(ProcessLookupError):
            os.killpg(sweep.pid, signal.SIGKILL)
        sweep.communicate()


@pytest.mark.parametrize("way", ["Ctrl-C", "Ctrl-C twice", "SIGTERM", "SIGTERM, and a worker is stopped"])
def test_an_interrupted_sweep_keeps_what_is_done_and_goes_on_later(tmp_path, at_work, carom_process, way):
    if way.startswith("SIGTERM"):
        if "stopped" in way:
            victim = workers(at_work)[0]
            os.kill(victim, signal.SIGSTOP)
            until(lambda: ") T " in Path(f"/proc/{victim}/stat").read_text())
        at_work.terminate()
    else:
        os.killpg(at_work.pid, signal.SIGINT)  # as a terminal does
        if way == "Ctrl-C twice":
            time.sleep(0.02)
            with suppress(ProcessLookupError):
                os.killpg(at_work.pid, signal.SIGINT)
    out, err = at_work.communicate(timeout=20)
    assert at_work.returncode == 130 and out == "" and "Traceback" not in err, err
    until(
        lambda: not members(at_work.pid), seconds=5
    )  # the resource tracker of multiprocessing leaves when its pipe closes

    done = trajectories(tmp_path)
    assert 4 <= len(done) < MANY and left_behind(tmp_path) == []
    assert f"interrupted: {len(done)} runs are kept" in err
    for run_id in done:
        folder = tmp_path / "outputs/long/runs" / run_id
        assert json.loads((folder / "run.json").read_text())["status"] == "finished"
        with h5py.File(folder / "trajectory.h5") as file:
            assert len(file["particles/balls/position/value"]) == 11

    if way == "Ctrl-C":
        code, _, err = carom_process("sweep", "long.yaml", cwd=tmp_path)
        assert code == 0 and f"{MANY} runs, {len(done)} done, {MANY - len(done)} to do" in err
        finished = trajectories(tmp_path)
        assert len(finished) == MANY and done.items() <= finished.items()


def test_a_worker_that_is_killed_costs_no_run(tmp_path, at_work):
    victim = workers(at_work)[0]
    os.kill(victim, signal.SIGKILL)
    _, err = at_work.communicate(timeout=60)
    assert at_work.returncode == 0 and "Traceback" not in err, err
    until(lambda: not members(at_work.pid), seconds=5)
    assert len(trajectories(tmp_path)) == MANY and left_behind(tmp_path) == []


def test_a_sweep_that_is_killed_leaves_no_worker_and_no_half_run(tmp_path, at_work, carom_process):
    assert len(workers(at_work)) == 2
    at_work.kill()
    at_work.wait()
    until(lambda: not members(at_work.pid), seconds=5)
    done = trajectories(tmp_path)
    for run_id in done:
        assert store.read_run(tmp_path / "outputs/long", run_id)["status"] == "finished"
    code, _, err = carom_process("sweep", "long.yaml", cwd=tmp_path)
    assert code == 0 and f"{MANY} runs, {len(done)} done" in err
    assert done.items() <= trajectories(tmp_path).items() and left_behind(tmp_path) == []


def workers(sweep) -> list[int]:
    return [pid for pid in members(sweep.pid) if "spawn_main" in Path(f"/proc/{pid}/cmdline").read_text()]


# Over many runs

MEASURED = """\
import json, os, sys
from pathlib import Path
from runner import config, worker

def now():
    status = dict(line.split(":", 1) for line in open("/proc/self/status"))
    return int(status["VmRSS"].split()[0]) / 1024, int(status["Threads"])

experiment, aside, marks = config.load(sys.argv[1]), Path(sys.argv[2]), [int(a) for a in sys.argv[3:]]
worker.settle_in()
told = []
for n, run in enumerate(experiment.runs(), 1):
    task = worker.Task(run.run_id, run.parameters, Path(), aside, aside / "runs" / run.run_id, False, None)
    assert worker.perform(task) == "finished"
    if n in marks:
        told.append(now())
print(json.dumps(told))
"""


@pytest.mark.slow
def test_memory_and_threads_stay_flat_over_many_runs(tmp_path, fall):
    """rerun's streams, left open, would leak 2 threads and 0.5 MB a run: 1000 threads and 250 MB here.

    A run holds some 10 kB here, so what is left after the first hundred is the allocator's: 10 MB, 20 kB a run.
    """
    (tmp_path / "runs").mkdir()
    (tmp_path / "x.yaml").write_text(
        fall.replace("[hdf5]", "[hdf5, rrd]")
        + f"matrix: {{balls.mass: {list(range(1, 121))}, solver.step: [0.01, 0.02, 0.04, 0.05, 0.1]}}\n"
    )
    command = [sys.executable, "-c", MEASURED, str(tmp_path / "x.yaml"), str(tmp_path), "100", "600"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    (early, threads_early), (late, threads_late) = json.loads(done.stdout)
    assert threads_late == threads_early
    assert late - early < 10, f"{early:.0f} MB after 100 runs, {late:.0f} MB after 600"
