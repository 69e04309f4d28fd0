"""Worker processes: tasks go out, statuses come back; a worker that dies costs the run that killed it and no other."""

from __future__ import annotations

import math
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from itertools import chain, islice
from multiprocessing.context import SpawnContext, SpawnProcess
from queue import Empty, SimpleQueue
from types import ModuleType
from typing import Protocol

from runner import worker
from runner.errors import RunError
from runner.worker import Task

FEW = 8  # tasks a place
LOOK = 1.0  # s between two looks whether a process stands still

Told = Callable[[Task, str], None]
Lost = Callable[[Task, str, int], bool]


class Place(Protocol):
    """Where tasks are carried out: an executor, and what it was handed and has not brought back, in that order."""

    executor: Executor
    ahead: int  # calls to have it make at once, so that none of its processes waits for the next
    most: int  # tasks a call
    deaths: type[Exception]  # what a call raises whose process died
    handed: dict[Future, list[Task]]

    def done(self) -> int:
        """Of the tasks of the call that its process died over, how many were done."""

    def renew(self, future: Future | None) -> tuple[list[Future], str]:
        """Make good for a process that died: what fell with it, first what it was at, and how it died."""

    def end_hung(self) -> None:
        """Have a process die that is behind its deadline, and cannot end itself."""

    def end(self) -> None:
        """End it at once."""


class Workers:
    """Places that carry out tasks, for a `with` block; however that is left, no process of theirs is there after it."""

    def __init__(self, places: Sequence[Place]):
        self.places = places

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_) -> None:
        for place in self.places:
            place.end()
        for place in self.places:
            place.executor.shutdown()

    def prepare(self, kernels: Sequence[Task]) -> None:
        """Have a kernel for each of the tasks. One that cannot be compiled is told by the runs that need it."""
        self.carry_out(worker.compile_kernel, kernels, lambda *_: None, lambda *_: True)

    def carry_out(self, function: Callable[[Task], str], tasks: Iterable[Task], told: Told, lost: Lost) -> None:
        """Run `function` over the tasks; `told` hears of each with the status it returns, as they come.

        When a process dies, `lost` hears of the task that it was at, how it died, and how often the task's process has died;
        unless it says that this was all, the task is tried again when no other is left, alone. Raises RunError when a run
        cannot be written, or the cluster goes away.
        """
        todo, suspects, deaths = deque(tasks), deque(), dict[str, int]()
        back: SimpleQueue[tuple[Place, Future]] = SimpleQueue()

        def fall(place: Place, future: Future | None = None) -> None:
            done = place.done()
            fallen, cause = place.renew(future)
            first, *behind = [place.handed.pop(each) for each in fallen] or [[]]
            at = first.pop(done) if done < len(first) else None
            todo.extendleft(reversed([*first, *chain(*behind)]))  # what was done is found so
            if at:
                deaths[at.run_id] = deaths.get(at.run_id, 0) + 1
                if not lost(at, cause, deaths[at.run_id]):
                    suspects.append(at._replace(wait=True))  # until what it held is free

        while True:
            if not todo and not any(place.handed for place in self.places):
                if not suspects:
                    return
                todo.append(suspects.popleft())
            while todo and (place := self._next(len(todo))):
                tasks = list(islice(todo, max(1, min(place.most, len(todo) // (FEW * len(self.places))))))
                try:
                    future = place.executor.submit(worker.each, function, tasks)
                except place.deaths:
                    fall(place)
                    continue
                place.handed[future] = [todo.popleft() for _ in tasks]
                future.add_done_callback(lambda future, place=place: back.put((place, future)))
            for place in self.places:
                place.end_hung()
            try:
                place, future = back.get(timeout=LOOK)
            except Empty:
                continue
            if future not in place.handed:
                continue  # it fell with another
            try:
                outcomes = future.result()
            except place.deaths:
                fall(place, future)
                continue
            except CancelledError:
                raise RunError("the cluster is gone; the same command goes on with the rest") from None
            tasks = place.handed.pop(future)
            todo.extendleft(reversed(tasks[len(outcomes) :]))
            for task, outcome in zip(tasks, outcomes):
                if isinstance(outcome, OSError):
                    raise RunError(f"cannot write {task.final}: {outcome.strerror or outcome}")
                told(task, outcome)

    def _next(self, left: int) -> Place | None:
        """The place that is to get the next task: the one with the least to do. At the end, when few tasks are left, none waits
        behind another, that a long one holds up none."""
        place = min(self.places, key=lambda each: len(each.handed) / each.ahead)
        room = place.ahead if left > FEW * len(self.places) else max(1, place.ahead // 2)
        return place if len(place.handed) < room else None


def local(jobs: int) -> Workers:
    """`jobs` processes on this machine."""
    return Workers([_Own() for _ in range(jobs)])


class _Own:
    """A process of our own. Each has its executor: a process that dies breaks its executor, with all that this has."""

    ahead, most = 2, 16
    deaths = BrokenProcessPool

    def __init__(self):
        self.handed: dict[Future, list[Task]] = {}
        self._start()

    def _start(self) -> None:
        self.context, self.stood_still = _Context(), False
        # in shared memory
        self.deadline, self.count = self.context.Value("d", math.inf, lock=False), self.context.Value("i", 0, lock=False)
        told = self.deadline, self.count
        self.executor = ProcessPoolExecutor(1, self.context, initializer=worker.settle_in, initargs=told)

    def done(self) -> int:
        return self.count.value

    def renew(self, future: Future | None) -> tuple[list[Future], str]:
        self.executor.shutdown()  # after it all that it was handed has an outcome, and the process its exit code
        cause = worker.STOPPED if self.stood_still else _cause(self.context.process.exitcode)
        self._start()
        return [each for each in self.handed if isinstance(each.exception(), self.deaths)], cause

    def end_hung(self) -> None:
        if time.monotonic() > self.deadline.value:
            self.stood_still = True
            self.end()

    def end(self) -> None:
        if self.context.process and self.context.process.pid:
            self.context.process.kill()  # SIGTERM is nothing to one that is stopped


class _Context(SpawnContext):
    """Starts one process, and keeps it: the executor forgets its own when it dies."""

    process: _Process | None = None

    def Process(self, *args, **kwargs) -> _Process:
        self.process = _Process(*args, **kwargs)
        return self.process


class _Process(SpawnProcess):
    """A process that does not run the caller's script again: a worker has no use for it, and a script seldom expects it."""

    @staticmethod
    def _Popen(process):
        main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which it inherits: Ctrl-C is not for it from the start
        try:
            return SpawnProcess._Popen(process)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            sys.modules["__main__"] = main


def _cause(exitcode: int | None) -> str:
    if exitcode is None:
        return "its worker died"
    return f"its worker died by {signal.Signals(-exitcode).name}" if exitcode < 0 else f"its worker exited with {exitcode}"
