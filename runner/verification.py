"""What is damaged in an output: found by checksums, and the plan to make it again."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from runner import config, store
from runner.config import Run
from runner.errors import Damaged
from runner.plan import Plan, existing


class Damage(NamedTuple):
    """A file that is not as it was made."""

    path: Path
    reason: str
    runs: int  # that the file belongs to; 0 where a pack does not tell any more what it holds

    def __str__(self) -> str:
        return f"{self.path}: {self.reason}" + (f" (of {self.runs} runs)" if self.runs > 1 else "")


def damages(folder: Path) -> list[Damage]:
    """Every file of the runs that was cut, changed or removed; all are read."""
    return [Damage(path, reason, _count(entry)) for entry in store.entries(folder) for path, reason in store.faults(entry)]


def _count(entry: Path) -> int:
    try:
        return len(store.members(entry)) if store.pack_number(entry) else 1
    except Damaged:
        return 0


def plan_repair(folder: Path, found: list[Damage]) -> tuple[Plan, list[str]]:
    """The plan that makes the runs with damages again, and the ids of those that it cannot make.

    These are of settings that the experiment has no more, and do not tell them either, or of another version of carom.
    A pack that does not tell what it holds is removed: its runs count as not made.
    """
    unknown = [damage.path.parent for damage in found if not damage.runs]
    for pack in unknown:
        store.discard(pack)
    experiment, places = existing(folder), store.places(folder)
    runs = {run.run_id: run for run in experiment.runs()}
    broken = {damage.path.parent for damage in found}
    spoilt = {run_id: runs.get(run_id) or _told(folder, run_id, experiment.document.folder)
              for run_id, entry in places.items() if entry in broken}  # fmt: skip
    todo = [run for run in spoilt.values() if run]
    if unknown:
        todo += [run for run_id, run in runs.items() if run_id not in places]
    return Plan(experiment, folder, tuple(runs.values()), tuple(todo)), [run_id for run_id, run in spoilt.items() if not run]


def _told(folder: Path, run_id: str, source: Path) -> Run | None:
    """The run by its own report, where that can be read and its settings still make the same run."""
    try:
        run = config.resolve(store.read_run(folder, run_id)["parameters"], source)
    except (Damaged, ValueError):  # pydantic's ValidationError is one
        return None
    return run if run.run_id == run_id else None
