"""Work in a process of its own: the memory that it takes is its own, and it takes no other down when it dies."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

from runner.errors import RunError


@contextmanager
def apart() -> Iterator[Callable]:
    """Yields call(function, *arguments), which returns what that returns in one new process, whatever else it prints there.

    Raises RunError when the process dies.
    """
    with ProcessPoolExecutor(1, get_context("spawn"), initializer=_hush) as one:

        def call(function: Callable, *arguments: Any) -> Any:
            try:
                return one.submit(function, *arguments).result()
            except BrokenProcessPool:
                raise RunError(f"the process of {function.__module__} died") from None

        yield call


def _hush() -> None:
    """Let nothing that libraries print reach the output, not even from C."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
