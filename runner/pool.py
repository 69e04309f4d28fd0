"""Worker processes: tasks go out, statuses come back; a worker that dies costs the run that killed it and no other."""

from __future__ import annotations

import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType

from runner import worker
from runner.errors import RunError
from runner.worker import Task

AHEAD = 4  # tasks handed out per worker, so that none waits for the next

Told = Callable[[Task, str], None]


class _Process(SpawnProcess):
    """A process that does not run the caller's script again: a worker has no use for it, and a script seldom expects it."""

    @staticmethod
    def _Popen(process):
        main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
        try:
            return SpawnProcess._Popen(process)
        finally:
            sys.modules["__main__"] = main


class _Context(SpawnContext):
    """Starts such processes, and keeps them: the executor forgets its own when one dies."""

    def __init__(self):
        super().__init__()
        self.started: list[_Process] = []

    def Process(self, *args, **kwargs) -> _Process:
        self.started.append(_Process(*args, **kwargs))
        return self.started[-1]


class Workers:
    """`jobs` processes, for a `with` block; however that is left, they are gone after it."""

    def __init__(self, jobs: int):
        self.jobs = jobs

    def __enter__(self) -> Workers:
        self._start(self.jobs)
        return self

    def __exit__(self, kind, *_) -> None:
        if kind is None:
            self._executor.shutdown()
        else:
            self._end()

    def carry_out(self, function: Callable[[Task], str], tasks: Iterable[Task], told: Told, lost: Told) -> None:
        """Run `function` over the tasks; `told` hears of each with the status it returns, as they come.

        When a worker dies, every task under way is suspect and is tried again alone; of one that kills its worker then, too,
        `lost` hears, with how the worker died. Raises RunError when a run cannot be written.
        """
        todo, under_way = deque(tasks), {}
        while todo or under_way:
            try:
                while todo and len(under_way) < AHEAD * self.jobs:
                    under_way[self._executor.submit(function, todo[0])] = todo[0]
                    todo.popleft()
                for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                    told(under_way[future], _status(under_way[future], future))
                    del under_way[future]
            except BrokenProcessPool:
                self._end()
                for task in under_way.values():
                    self._try_alone(function, task, told, lost)
                under_way = {}
                self._start(self.jobs)

    def _try_alone(self, function: Callable[[Task], str], task: Task, told: Told, lost: Told) -> None:
        self._start(1)
        try:
            status = _status(task, self._executor.submit(function, task))
        except BrokenProcessPool:
            lost(task, self._end())
        else:
            self._executor.shutdown()
            told(task, status)

    def _start(self, jobs: int) -> None:
        self._context = _Context()
        self._executor = ProcessPoolExecutor(jobs, self._context, initializer=worker.settle_in)

    def _end(self) -> str:
        """End the processes at once; returns how one died that was not ended."""
        processes = [process for process in self._context.started if process.pid is not None]
        for process in processes:
            process.terminate()
        # the executor's own thread reaps them: only after it do their exit codes hold
        self._executor.shutdown(cancel_futures=True)
        died = [process.exitcode for process in processes if process.exitcode not in (None, 0, -signal.SIGTERM)]
        return _cause(died[0] if died else None)


def _status(task: Task, future: Future) -> str:
    try:
        return future.result()
    except OSError as error:
        raise RunError(f"cannot write {task.final}: {error.strerror or error}") from None


def _cause(exitcode: int | None) -> str:
    if exitcode is None:
        return "its worker died"
    return f"its worker died by {signal.Signals(-exitcode).name}" if exitcode < 0 else f"its worker exited with {exitcode}"
