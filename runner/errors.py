"""What goes wrong by the user's hand or the machine's, told in a line each."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import NamedTuple

from runner.limits import LONGEST_LINE, MOST_TOLD


class Fault(NamedTuple):
    """One mistake in an experiment file: where it is, the path of the setting, what is wrong with it."""

    place: str  # file:line:column, or the option that brought it in
    path: str
    reason: str

    def __str__(self) -> str:
        return one_line(": ".join(part for part in self if part))


def one_line(text: str) -> str:
    """`text` as a line of bearable length, on which nothing but what can be seen stands."""
    if len(text) > LONGEST_LINE:  # what is wrong stands at the end, often
        text = f"{text[: LONGEST_LINE - 203]}...{text[-200:]}"
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def _position(fault: Fault | str) -> tuple:
    """What to sort by, so that faults are told from the top of the file to its end."""
    parts = fault.place.rsplit(":", 2) if isinstance(fault, Fault) else []
    return tuple(int(part) if part.isdigit() else 0 for part in parts[1:])


class InputError(Exception):
    """The user's input is wrong; str() is a line for each fault. The command line exits with 2."""

    def __init__(self, *faults: Fault | str):
        self.faults = sorted(faults, key=_position)
        more = ["... and more mistakes"] if len(faults) > MOST_TOLD else []
        super().__init__("\n".join([one_line(str(fault)) for fault in self.faults[:MOST_TOLD]] + more))


class RunError(Exception):
    """A run or its files could not be completed; str() is one line. The command line exits with 1."""


class Damaged(RunError):
    """A file of a run, or of a pack of runs, is not as it was made; `path` is <output>/runs/<run or pack>/<file>."""

    def __init__(self, path: Path, reason: str):
        super().__init__(path, reason)  # what it is made of anew on its way from a worker
        self.path, self.reason = path, reason

    def __str__(self) -> str:
        return f"{self.path}: {self.reason}; `carom status {shlex.quote(str(self.path.parents[2]))} --repair` makes it again"
