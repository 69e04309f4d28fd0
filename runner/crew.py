"""Threads that move the balls of one run at the same time: the kernels let Python's lock go, so each has a core."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Any

from sim.simulate import Crew


@contextmanager
def crew(threads: int) -> Iterator[Crew]:
    """So many threads; one is the caller's own."""
    if threads == 1:
        yield Crew()
        return
    with ThreadPoolExecutor(threads) as pool:

        def each(function: Callable, hands: Sequence) -> list[Any]:
            at_work = [pool.submit(function, hand) for hand in hands]
            wait(at_work)
            return [future.result() for future in at_work]

        yield Crew(threads, each)
