"""What a sweep shows: a bar on a terminal, plain lines in a log."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

from runner.result import FAILURES
from runner.sweeping import Progress

EVERY = 5.0  # s between lines in a log


def progress(quiet: bool):
    """A context manager that yields the Progress to use."""
    if quiet:
        return nullcontext(Progress())
    return Bar() if sys.stderr.isatty() else Lines()


@contextmanager
def doing() -> Iterator[Callable[[str], None]]:
    """Yields what to tell each thing that is begun: on a terminal a line that changes, in a log one for each."""
    if not sys.stderr.isatty():
        yield lambda what: print(f"{what} ...", file=sys.stderr, flush=True)
        return
    from rich.console import Console

    with Console(stderr=True).status("") as status:
        yield lambda what: status.update(f"{what} (a kernel is compiled at its first use)")


def tally(statuses: Counter) -> str:
    return ", ".join(f"{count} {status}" for status, count in sorted(statuses.items())) or "nothing"


def _named(kernels: list[str]) -> str:
    """How many kernels there are and what for; two of a method differ in the scene's fields."""
    names = list(dict.fromkeys(kernels))
    return f"{len(kernels)} kernel{'s' * (len(kernels) != 1)} ({', '.join(names[:4] + ['...'] * (len(names) > 4))})"


class Lines(Progress):
    """For a log: a line at the start, one every few seconds, one at the end, and one for each run that failed."""

    def __enter__(self) -> Lines:
        self.statuses, self.total, self.last = Counter(), 0, time.monotonic()
        return self

    def __exit__(self, *exc) -> None:
        if self.total:
            self._say()

    def compiling(self, kernels: list[str]) -> None:
        if kernels:
            print(f"preparing {_named(kernels)}, compiled at the first use on a machine", file=sys.stderr)

    def running(self, runs: int) -> None:
        self.total, self.last = runs, time.monotonic()

    def done(self, run_id: str, status: str) -> None:
        self.statuses[status] += 1
        if status in FAILURES:
            print(f"{run_id}: {status}", file=sys.stderr)
        if time.monotonic() - self.last > EVERY:
            self._say()

    def _say(self) -> None:
        self.last = time.monotonic()
        print(f"{sum(self.statuses.values())} of {self.total} runs: {tally(self.statuses)}", file=sys.stderr, flush=True)


class Bar(Progress):
    """For a terminal."""

    def __enter__(self) -> Bar:
        from rich import progress as p
        from rich.console import Console

        self.statuses = Counter()
        self.bar = p.Progress(
            p.TextColumn("{task.description}"), p.BarColumn(), p.MofNCompleteColumn(), p.TimeElapsedColumn(),
            p.TimeRemainingColumn(), p.TextColumn("{task.fields[tally]}"), console=Console(stderr=True),
        )  # fmt: skip
        self.bar.start()
        self.task = None
        return self

    def __exit__(self, *exc) -> None:
        self.bar.stop()

    def compiling(self, kernels: list[str]) -> None:
        self.task = self.bar.add_task(f"preparing {_named(kernels)}", total=None, tally="compiled at the first use")

    def running(self, runs: int) -> None:
        self.bar.reset(self.task, description="runs", total=runs, tally="")

    def done(self, run_id: str, status: str) -> None:
        self.statuses[status] += 1
        self.bar.update(self.task, advance=1, tally=tally(self.statuses))
        if status in FAILURES:
            self.bar.console.print(f"{run_id}: {status}")
