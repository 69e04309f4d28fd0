"""Processes on other machines: the workers of a Dask cluster take tasks through its executor, as a pool of our own does.

Importing this needs `distributed`, the extra `cluster`.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence
from concurrent.futures import Future
from pathlib import Path

from distributed import Client, KilledWorker, WorkerPlugin

from runner import machine, worker
from runner.errors import InputError
from runner.pool import Workers
from runner.worker import Task

WITHIN = 10  # s for the scheduler to answer
ALIKE = ("carom", "numpy", "numba", "h5py")  # packages that can change a trajectory's bytes


class Cluster(Workers):
    """The workers that a scheduler has, and those that it will have, for a `with` block; they stay after it.

    They must see the folder `shared`, where there is one. Raises InputError when the scheduler does not answer.
    """

    def __init__(self, address: str, shared: Path | None):
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what it has to say comes as exceptions, too
        try:
            self.client = Client(address, timeout=WITHIN, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            told = str(error).splitlines()[0] if str(error) else "no answer"
            raise InputError(f"--cluster {address}: {told}") from None
        super().__init__([_Scheduled(self.client)])
        self.shared = shared

    def prepare(self, kernels: Sequence[Task]) -> None:
        """Compile each kernel once, for workers that share a home; then have every worker load, or compile, all of them before
        its first run. Raises InputError when a worker is of no use."""
        super().prepare(kernels)
        try:
            self.client.register_plugin(_Preparation(kernels, self.shared))
        except Unfit as error:
            raise InputError(f"--cluster {self.client.scheduler.address}: {error}") from None

    def __exit__(self, *exc) -> None:
        super().__exit__(*exc)
        try:
            self.client.unregister_worker_plugin(_Preparation.name)
        except (OSError, ValueError, TimeoutError):
            pass  # it never was, or the scheduler is gone
        self.client.close()


class _Scheduled:
    """All that the scheduler has: it makes good for workers that die, until a task has cost several of them."""

    most = 1
    ahead = 10_000  # enough for 2500 workers, and for a scheduler that adapts their number to see what there is to do
    deaths = KilledWorker

    def __init__(self, client: Client):
        self.handed: dict[Future, list[Task]] = {}
        self.executor = client.get_executor(pure=False)

    def done(self) -> int:
        return 0

    def renew(self, future: Future) -> tuple[list[Future], str]:
        error = future.exception()
        return [future], f"{error.allowed_failures + 1} workers died that had it, the last on {error.last_worker.host}"

    def end_hung(self) -> None:
        """The scheduler gives up a worker that says nothing for long (`distributed.scheduler.worker-ttl`), as one that died."""

    def end(self) -> None:
        self.executor.shutdown(wait=False)


class Unfit(Exception):
    """A worker cannot take part; str() says why."""


class _Preparation(WorkerPlugin):
    """What a worker does when it joins."""

    name = "carom"

    def __init__(self, kernels: Sequence[Task], shared: Path | None):
        self.kernels, self.shared, self.versions = kernels, shared, machine.versions()

    async def setup(self, worker) -> None:
        ours = machine.versions()
        for name in ALIKE:
            if ours.get(name) != self.versions.get(name):
                raise Unfit(f"worker {worker.address} has {name} {ours.get(name)}, not {self.versions.get(name)}")
        if worker.state.nthreads != 1:
            raise Unfit(f"worker {worker.address} has {worker.state.nthreads} threads; it must be started with --nthreads 1")
        if self.shared and not self.shared.is_dir():
            raise Unfit(f"worker {worker.address} does not see {self.shared}; --gather sends files back instead")
        await asyncio.to_thread(self._compile)

    def _compile(self) -> None:
        for task in self.kernels:
            worker.compile_kernel(task)
