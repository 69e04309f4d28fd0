"""What a worker process does: compile a kernel, or make a run and put it into the output folder."""

from __future__ import annotations

import gc
import json
import shutil
import signal
import time
import traceback
from collections.abc import Callable
from datetime import datetime, timezone
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from runner import store

if TYPE_CHECKING:
    from runner.result import Result


class Task(NamedTuple):
    """One run to make."""

    run_id: str
    parameters: dict[str, Any]
    source: Path  # folder that file names in the parameters are relative to
    aside: Path  # folder to make it in
    final: Path  # folder it becomes
    replace: bool  # a folder that is there already
    timeout: float | None  # s


def settle_in() -> None:
    """Start of a worker: Ctrl-C is the parent's to handle."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def compile_kernel(task: Task) -> None:
    """Have the kernel that the task's run needs compiled and on disk, for every worker."""
    from runner.config import resolve
    from runner.execute import prepare

    try:
        prepare(resolve(task.parameters, task.source))
    except Exception:  # the run itself will tell what is wrong with it
        pass


def perform(task: Task) -> str:
    """Make the run and publish its folder; returns its status. Raises OSError when it cannot be written."""
    from runner import record

    made = _empty_folder(task)
    clock, started = time.perf_counter(), datetime.now(timezone.utc).isoformat(timespec="milliseconds")
    deadline = None if task.timeout is None else time.monotonic() + task.timeout
    report = _report(task)
    try:
        result = _simulate(task, lambda: deadline is not None and time.monotonic() > deadline)
        for name in result.parameters["record"]["formats"]:
            writer = record.load(name)
            writer.write(result, made / writer.FILE)
        report |= {"status": result.status, "figures": result.summary}
        if result.status == "timeout":
            report["error"] = f"stopped after {task.timeout:g} s"
    except OSError:
        raise
    except Exception as error:
        report |= {"error": " ".join(f"{type(error).__name__}: {error}".split()), "traceback": traceback.format_exc()}
    report["timings"] = {"started": started, "wall_seconds": time.perf_counter() - clock}
    _leave_alone()
    return _publish(task, made, report)


@cache
def _leave_alone() -> None:
    """After the first run: the libraries stay, so that the collector need not look through them time and again."""
    gc.freeze()


_last = None  # the simulation before, whose geometry the next one mostly has, too


def _simulate(task: Task, stop: Callable[[], bool]) -> Result:
    global _last
    from runner.config import resolve
    from runner.execute import carry_out, prepare

    run = resolve(task.parameters, task.source)
    _last = prepare(run, _last)
    return carry_out(run, _last, stop)


def report_crash(task: Task, cause: str) -> str:
    """Publish the run as crashed, from the parent: it killed its worker twice. Returns the status."""
    return _publish(task, _empty_folder(task), _report(task) | {"status": "crashed", "error": cause})


def _report(task: Task) -> dict[str, Any]:
    return {"run_id": task.run_id, "status": "failed", "error": None, "parameters": task.parameters, "figures": {}}


def _empty_folder(task: Task) -> Path:
    made = task.aside / task.run_id
    shutil.rmtree(made, ignore_errors=True)  # of a worker that died in it
    made.mkdir()
    return made


def _publish(task: Task, made: Path, report: dict[str, Any]) -> str:
    (made / store.RUN).write_text(json.dumps(report, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    store.publish(made, task.final, task.replace)
    return report["status"]
