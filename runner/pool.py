"""Worker processes: tasks go out, statuses come back, and none outlives the sweep."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice

from runner import worker
from runner.errors import RunError
from runner.worker import Task

AHEAD = 4  # tasks handed out per worker, so that none waits for the next


@contextmanager
def workers(jobs: int) -> Iterator[Executor]:
    """`jobs` fresh processes. However the block is left, they are gone after it."""
    executor = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), initializer=worker.settle_in)
    try:
        yield executor
        executor.shutdown()
    except BaseException:
        processes = list((executor._processes or {}).values())
        executor.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.terminate()
        for process in processes:
            process.join()
        raise


def carry_out(
    executor: Executor, jobs: int, function: Callable[[Task], str], tasks: list[Task], told: Callable[[Task, str], None]
) -> None:
    """Run `function` over the tasks and tell of each as it is done. Raises RunError when a worker dies or cannot write."""
    todo, under_way = iter(tasks), {}
    while True:
        for task in islice(todo, AHEAD * jobs - len(under_way)):
            under_way[executor.submit(function, task)] = task
        if not under_way:
            return
        for future in wait(under_way, return_when=FIRST_COMPLETED).done:
            task = under_way.pop(future)
            try:
                told(task, future.result())
            except BrokenProcessPool:
                raise RunError(
                    f"a worker process died while it made {task.run_id} or a run beside it; the same command goes on with the rest"
                ) from None
            except OSError as error:
                raise RunError(f"cannot write {task.final}: {error.strerror or error}") from None
