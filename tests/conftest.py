"""Fixtures shared by the tests."""

import os
import resource
import shutil
import signal
import subprocess
import sys
from typing import NamedTuple

import pytest

FALL = """\
# How does a ball fall?
scene:
  surfaces:
    floor: {shape: plane}
balls:
  mass: 1
  released: [{position: [0, 1, 0]}]
solver: {method: explicit_euler, step: 0.01, contact: original}
duration: 0.2
record: {formats: [hdf5]}
"""


def pytest_configure():
    """A shell has what it starts in the background ignore Ctrl-C, which tests send."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


class Outcome(NamedTuple):
    """What came of a command."""

    code: int
    out: str
    err: str


class Inline:
    """Stands for runner.pool.Workers, and does their work in this process."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def prepare(self, kernels):
        from runner import worker

        for task in kernels:
            worker.compile_kernel(task)

    def carry_out(self, function, tasks, told, lost):
        for task in tasks:
            told(task, function(task))


@pytest.fixture(scope="session")
def fall() -> str:
    """The text of an experiment file: one ball falls for 0.2 s."""
    return FALL


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder, and the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def carom(monkeypatch, capsys):
    """The command line in this process: `carom("check", "x.yaml")` -> Outcome."""
    from runner import cli

    def call(*arguments) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["carom", *map(str, arguments)])
        before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)}
        try:
            with pytest.raises(SystemExit) as end:
                cli.main()
        finally:
            for each, handler in before.items():
                signal.signal(each, handler)
        return Outcome(end.value.code or 0, *capsys.readouterr())

    return call


@pytest.fixture
def inline(monkeypatch):
    """Runs are made in this process instead of in workers."""
    monkeypatch.setattr("runner.pool.local", lambda jobs: Inline())


@pytest.fixture(scope="session")
def outputs(tmp_path_factory, fall):
    """Two outputs of four runs: in single/x each has a folder, in packed/x there are two packs. They are only looked at."""
    from runner.sweeping import sweep

    folder = tmp_path_factory.mktemp("outputs")
    runs = "matrix: {balls.mass: [1, 2, 3, 4]}\nexpect: [{column: status, equals: finished}]\n"
    (folder / "x.yaml").write_text(fall.replace("[hdf5]", "[hdf5, rrd]") + runs)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("runner.pool.local", lambda jobs: Inline())
        sweep(folder / "x.yaml", out=folder / "single")
        sweep(folder / "x.yaml", {"record.pack": 2}, out=folder / "packed")
    return folder


@pytest.fixture
def copied(here, outputs, inline):
    """A copy of both in the current folder."""
    shutil.copytree(outputs, here, dirs_exist_ok=True)


@pytest.fixture(scope="session")
def carom_process():
    """The command line in a process of its own: `carom_process("check", "x.yaml", cwd=...)` -> Outcome.

    It, and each process that it starts, has `memory` bytes of addresses, where that is given.
    """

    def call(*arguments, cwd, memory=None, **environment) -> Outcome:
        done = subprocess.run(
            [sys.executable, "-m", "runner", *map(str, arguments)],
            cwd=cwd, env=os.environ | environment, capture_output=True, text=True, timeout=300,
            preexec_fn=memory and (lambda: resource.setrlimit(resource.RLIMIT_AS, (memory, memory))),
        )  # fmt: skip
        return Outcome(done.returncode, done.stdout, done.stderr)

    return call
