"""Other programs at the same work, each in a process of its own, beside carom in the same process.

A peer is a module of this folder whose name has no leading underscore: `NEEDS`, what must be installed (one of them), and
`PEERS`, its ways to do the work.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import find_spec
from pkgutil import iter_modules

from runner.bench.apart import apart
from runner.bench.kernels import Case, measure
from runner.bench.peers._work import Answer, rms, solved, work
from runner.machine import peak_memory

CROWD = 1000  # balls of carom, where a peer is given fewer for being slow


@dataclass(frozen=True)
class Comparison:
    """A peer at a work, and carom at the same."""

    peer: str
    scene: str
    answer: Answer
    unit: str  # what the peer counts a second
    bounces: int  # that the exact solver counts
    within: float  # m, the error with which it still does the same work
    method: str  # carom's
    rate: float  # carom's, ball-steps a second or events a second
    error: float  # m, carom's
    peak_memory: int  # bytes, of the process

    @property
    def ratio(self) -> float:
        """How many times as fast carom is."""
        return self.rate / (self.answer.count / self.answer.seconds)

    @property
    def right(self) -> bool:
        """Whether the peer's answer is near enough to speak of the same work."""
        return self.answer.error <= self.within


@dataclass(frozen=True)
class Missing:
    """A peer that could not be asked."""

    peer: str
    why: str


def names() -> list[str]:
    return sorted(module.name for module in iter_modules(__path__) if not module.name.startswith("_"))


def compare(told: Callable[[str], None]) -> Iterator[Comparison | Missing]:
    """Every peer; `told` hears of each."""
    for name in names():
        module = import_module(f"{__name__}.{name}")
        if not any(find_spec(needed) or shutil.which(needed) for needed in module.NEEDS):
            yield Missing(name, "not installed")
            told(f"{name}: not installed")
            continue
        for index, peer in enumerate(module.PEERS):
            try:
                with apart() as call:
                    found = call(compared, name, index)
                told(f"{peer.name}, {peer.scene}: {found.answer.count / found.answer.seconds:.3g} {peer.unit}")
            except Exception as error:  # whatever a library may raise
                found = Missing(peer.name, " ".join(f"{type(error).__name__}: {error}".split()))
                told(f"{peer.name}: {found.why}")
            yield found


def compared(name: str, index: int, balls: int | None = None) -> Comparison:
    """The peer number `index` of a module, at its work, or it and carom with so many balls."""
    peer = import_module(f"{__name__}.{name}").PEERS[index]
    peer = replace(peer, balls=balls or peer.balls)
    same = Case(peer.scene, peer.versus, duration=peer.duration, balls=peer.balls)
    todo = work(peer.scene, peer.balls, peer.duration)
    place, _ = solved(same)
    ours = measure(replace(same, balls=balls or CROWD))
    answer = peer.solve(todo)
    theirs = peer.name, peer.scene, answer, peer.unit, todo.bounces, peer.within
    return Comparison(*theirs, peer.versus, ours.rate, rms(place - todo.truth), peak_memory())
