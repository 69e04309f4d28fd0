"""A worker that dies costs the run that killed it, and no other."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from runner.errors import RunError
from runner import pool, worker
from runner.worker import Task


def task(name: str) -> Task:
    return Task(name, {}, Path(), Path(), Path(name), False, None)


def perform(task: Task) -> str:
    kind = task.run_id.split("-")[0]
    if kind == "killer":
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "exits":
        os._exit(3)
    if kind == "full":
        raise OSError(28, "No space left on device")
    if kind == "nap":
        time.sleep(1.5 * worker.SPELL)
    if kind == "slow":
        time.sleep(60)
    return "finished"


def carry_out(names: list[str], jobs: int = 2) -> tuple[list[str], dict[str, list[str]]]:
    """What was told, and how each died that did, at each of its tries; two are all."""
    told, deaths = [], {}

    def lost(task: Task, cause: str, count: int) -> bool:
        deaths.setdefault(task.run_id, []).append(cause)
        assert len(deaths[task.run_id]) == count
        return count == 2

    with pool.local(jobs) as workers:
        workers.carry_out(
            perform,
            map(task, names),
            lambda task, status: told.append(task.run_id),
            lost,
        )
    return told, deaths


def test_the_killers_are_lost_with_their_cause_and_all_others_are_told_once():
    names = [f"good-{i}" for i in range(20)]
    told, deaths = carry_out(names[:7] + ["killer"] + names[7:] + ["exits"])
    assert sorted(told) == sorted(names)
    assert deaths == {"killer": ["its worker died by SIGKILL"] * 2, "exits": ["its worker exited with 3"] * 2}


def test_among_many_that_are_handed_out_together_the_killer_is_known_and_a_long_one_holds_up_none():
    names = [f"nap-{i}" if i % 50 == 20 else f"good-{i}" for i in range(200)]
    told, deaths = carry_out(names[:40] + ["killer"] + names[40:])
    assert sorted(told) == sorted(names)
    assert deaths == {"killer": ["its worker died by SIGKILL"] * 2}


def test_a_call_ends_after_its_spell_and_at_what_cannot_be_written(monkeypatch):
    tasks = [task(name) for name in ("good-1", "full", "good-2")]
    outcomes = worker.each(perform, tasks)
    assert outcomes[0] == "finished" and isinstance(outcomes[1], OSError) and len(outcomes) == 2
    monkeypatch.setattr(worker, "SPELL", -1)
    assert worker.each(perform, tasks) == ["finished"]


def test_a_run_that_cannot_be_written_ends_the_sweep_in_one_line():
    with pytest.raises(RunError, match="^cannot write full: No space left on device$"):
        carry_out(["good-1", "full"])


def test_an_exception_leaves_no_worker_behind():
    def stop(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        with pool.local(2) as workers:
            workers.carry_out(perform, map(task, ["slow-1", "good-1", "slow-2"]), stop, stop)
    assert not [p for p in children() if "spawn_main" in p]


def children() -> list[str]:
    """The command lines of this process's living children."""
    pids = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()
    return [Path(f"/proc/{pid}/cmdline").read_text() for pid in pids]


@pytest.mark.parametrize("guise", ["file", "stdin"])
def test_a_script_needs_no_guard(tmp_path, guise):
    """Workers must not run the caller's script again, which would start a sweep in each of them."""
    text = "import runner.pool as p, tests.runner.test_pool as t; print('started')\nprint(t.carry_out(['good-1', 'good-2']))\n"
    script = tmp_path / "script.py"
    script.write_text(text)
    command = [sys.executable, script] if guise == "file" else [sys.executable]
    done = subprocess.run(
        command, input=text, capture_output=True, text=True, timeout=60, env=os.environ | {"PYTHONPATH": os.getcwd()}
    )
    assert done.stdout.count("started") == 1, done.stderr
    assert "good-2" in done.stdout
