"""Fixtures shared by the tests."""

import os
import resource
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


class Outcome(NamedTuple):
    """What came of a command."""

    code: int
    out: str
    err: str


class Inline:
    """Stands for runner.pool.Workers, and does their work in this process."""

    def __init__(self, jobs):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

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
    monkeypatch.setattr("runner.pool.Workers", Inline)


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
