"""Packs: many runs in a few files, as `record.pack` asks for, where a million folders would be too many.

A run is made as ever, in a folder of its own, so that what dies costs one run. Packs are made of runs that are done: written
aside, renamed, and only then the runs' own folders go. Stopped at any moment, each run is in one place or in both.
"""

from __future__ import annotations

import json
import os
import shutil
from itertools import count
from pathlib import Path
from typing import NamedTuple

from runner import claims, record, store
from runner.errors import Damaged


WAVE = 20_000  # runs to make before what can be packed of them is: as many folders there are at most


class Pack(NamedTuple):
    """Runs to be packed."""

    final: Path  # folder of the runs
    run_ids: tuple[str, ...]

    @property
    def run_id(self) -> str:
        """What it is known by while it is made: its number is not known before."""
        return f"pack-of-{self.run_ids[0]}"


def batches(folder: Path, size: int | None) -> list[tuple[str, ...]]:
    """The runs with a folder of their own, `size` at a time; what is left over stays as it is, as all do without a size."""
    if size is None:
        return []
    single = [entry.name for entry in store.entries(folder) if not store.pack_number(entry)]
    return [tuple(single[start : start + size]) for start in range(0, len(single) - size + 1, size)]


def pack(task: Pack) -> str:
    """Make the pack, unless a run is damaged, which must not get a new checksum, or another sweep has just packed it.

    Returns what came of it. Raises OSError when the pack cannot be written.
    """
    runs = {run_id: task.final / run_id for run_id in task.run_ids}
    with claims.claim(task.final / store.ASIDE, task.run_id) as ours:
        if not ours or any(any(store.faults(place)) for place in runs.values()):
            return "left"
        made = task.final / store.ASIDE / f"{task.run_id}.made"
        shutil.rmtree(made, ignore_errors=True)  # where the file system has no locks, of a worker that died over it
        made.mkdir()
        try:
            _fill(made, runs)
        except (FileNotFoundError, Damaged):  # it is gone meanwhile
            shutil.rmtree(made, ignore_errors=True)
            return "left"
        _publish(made, task.final.parent)
    for place in runs.values():
        store.discard(place)
    return "packed"


def _fill(made: Path, runs: dict[str, Path]) -> None:
    """Write all that the `runs` hold into the folder `made`."""
    reports = [store.contents(place) for place in runs.values()]
    for module in map(record.load, record.names()):
        if files := {run_id: place / module.FILE for run_id, place in runs.items() if (place / module.FILE).exists()}:
            module.join(files, made / module.PACKED)
    with open(made / store.REPORTS, "w", encoding="utf-8") as lines:
        for report in reports:
            lines.write(json.dumps({key: report[key] for key in report if key not in ("files", "sha256")}) + "\n")
    held = {report["run_id"]: list(report["files"]) for report in reports}
    store.write_contents(made, store.MEMBERS, {"runs": held})


def _publish(made: Path, folder: Path) -> None:
    """Give the pack the next number that is free."""
    for number in count(1 + max(map(store.pack_number, store.entries(folder)))):
        final = store.pack_folder(folder, number)
        try:
            return os.rename(made, final)
        except OSError:
            if not final.exists():
                raise


def tidy(folder: Path) -> None:
    """Remove packs whose runs have all been made again since."""
    current = set(store.places(folder).values())
    for entry in store.entries(folder):
        if store.pack_number(entry) and entry not in current:
            store.discard(entry)
