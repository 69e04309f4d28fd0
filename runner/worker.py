"""What a worker process does: compile a kernel, or make a run and put it into the output folder."""

from __future__ import annotations

import ctypes
import faulthandler
import gc
import math
import multiprocessing
import os
import shutil
import signal
import socket
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime, timezone
from functools import cache
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from runner import claims, store

ELSEWHERE = "elsewhere"  # what comes of a run that another sweep is making
STOPPED = "its worker stood still"
TRIES = 2  # of a run whose worker dies
GRACE = 5.0  # s after the timeout, for a run to stop by itself and to write what it has
PATIENCE = 15.0  # s after the timeout, for a process that cannot end itself, since it is stopped
SPELL = 0.1  # s that tasks are worked off before the parent hears of them
LINES = 200  # of last words

if TYPE_CHECKING:
    from ctypes import c_double, c_int

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
    threads: int = 1  # at work on it
    wait: bool = False  # for another sweep that is making the run


_deadline = _count = None  # shared with the parent, if that looks at them


def settle_in(deadline: c_double | None = None, count: c_int | None = None) -> None:
    """Start of a worker: Ctrl-C is the parent's to handle, and when the parent dies it is the end of the worker, too.

    Up to the `deadline`, in time.monotonic(), the parent waits for what it is at; `count` tells it how many tasks of the call
    are done.
    """
    global _deadline, _count
    _deadline, _count = deadline, count
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: also where a kernel lets no thread run
    threading.Thread(target=_end_with, args=[multiprocessing.parent_process()], daemon=True).start()


def _end_with(parent: multiprocessing.Process) -> None:
    parent.join()
    os._exit(1)


def each(function: Callable[[Task], Any], tasks: list[Task]) -> list:
    """What `function` returns for each of the tasks, or of the first of them: no more are begun after SPELL s, or after an
    OSError, which then is the last."""
    end, outcomes = time.monotonic() + SPELL, []
    for task in tasks:
        _tell(len(outcomes))
        try:
            outcomes.append(function(task))
        except OSError as error:
            return [*outcomes, error]
        if time.monotonic() > end:
            break
    _tell(len(outcomes))
    return outcomes


def _tell(done: int) -> None:
    if _count is not None:  # zero is false
        _count.value = done


def compile_kernel(task: Task) -> None:
    """Have the kernel that the task's run needs compiled and on disk, for every worker."""
    from runner.config import resolve
    from runner.execute import prepare

    try:
        prepare(resolve(task.parameters, task.source))
    except Exception:  # the run itself will tell what is wrong with it
        pass


def take(task: Task) -> str:
    """Make the run unless another sweep has made it, or is at it; returns its status, or ELSEWHERE. Raises OSError."""
    with claims.claim(task.aside, task.run_id, task.wait) as words:
        if words is None:
            return ELSEWHERE
        if task.final.exists() and not task.replace:
            return store.contents(task.final)["status"]
        with _heard(words, task.timeout):
            return perform(task)


def send(task: Task) -> tuple[str, dict[str, bytes]]:
    """Make the run in a folder of this machine's own; its status and its files, by name."""
    with tempfile.TemporaryDirectory() as scratch:
        final = Path(scratch) / store.RUNS / task.run_id
        final.parent.mkdir()
        status = take(task._replace(aside=final.parent / store.ASIDE, final=final))
        return status, {path.name: path.read_bytes() for path in final.iterdir()}


def keep(task: Task, files: dict[str, bytes]) -> None:
    """Publish a run by the files that were sent. Raises OSError."""
    with claims.claim(task.aside, task.run_id, wait=True):
        made = _empty_folder(task)
        for name, content in files.items():
            (made / name).write_bytes(content)
        store.publish(made, task.final, task.replace)


@contextmanager
def _heard(words: FileIO, timeout: float | None) -> Iterator[None]:
    """Errors of the process go to `words`; code that nobody can stop any more ends it GRACE after the timeout."""
    ours = os.dup(2)
    os.dup2(words.fileno(), 2)
    if not faulthandler.is_enabled():
        faulthandler.enable(2)
    if timeout is not None:
        faulthandler.dump_traceback_later(timeout + GRACE, exit=True, file=2)
        _have_until(time.monotonic() + timeout + PATIENCE)
    try:
        yield
    finally:
        _have_until(math.inf)
        faulthandler.cancel_dump_traceback_later()
        os.dup2(ours, 2)
        os.close(ours)


def _have_until(deadline: float) -> None:
    if _deadline:
        _deadline.value = deadline


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
        told = {"error": " ".join(f"{type(error).__name__}: {error}".split()), "traceback": traceback.format_exc()}
        # a file's name may hold what is no text
        report |= {name: text.encode(errors="backslashreplace").decode() for name, text in told.items()}
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
    from runner.settings import with_value

    run = resolve(with_value(task.parameters, ("solver", "threads"), task.threads), task.source)
    _last = prepare(run, _last)
    return carry_out(run, _last, stop)


def report_death(task: Task, cause: str, tries: int) -> str | None:
    """Publish, from the parent, a run whose worker died by it; returns its status, None where it is to be tried again."""
    words = claims.last_words(task.aside, task.run_id).splitlines()[-LINES:]
    if any(line.startswith("Timeout (") for line in words):  # faulthandler's
        told = {"status": "timeout", "error": f"hung, and was ended after {task.timeout + GRACE:g} s"}
    elif cause == STOPPED:
        told = {"status": "timeout", "error": f"{STOPPED}, and was ended after {task.timeout + PATIENCE:g} s"}
    elif tries < TRIES:
        return None
    else:
        told = {"status": "crashed", "error": f"{cause}: {words[0]}" if words else cause}
    with claims.claim(task.aside, task.run_id, wait=True):
        return _publish(task, _empty_folder(task), _report(task) | told | {"last_words": words})


def _report(task: Task) -> dict[str, Any]:
    return {"run_id": task.run_id, "status": "failed", "error": None, "parameters": task.parameters, "figures": {}}


def _empty_folder(task: Task) -> Path:
    made = task.aside / f"{task.run_id}.{socket.gethostname()}-{os.getpid()}"
    try:
        made.mkdir(parents=True)
    except FileExistsError:
        shutil.rmtree(made, ignore_errors=True)
        made.mkdir()
    return made


def _publish(task: Task, made: Path, report: dict[str, Any]) -> str:
    store.write_contents(made, store.RUN, report)
    store.publish(made, task.final, task.replace)
    return report["status"]
