"""What a sweep has to do: the runs of an experiment that its output folder does not hold yet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from runner import starts, store
from runner.config import Experiment, Run
from runner.document import Document
from runner.errors import InputError
from runner.result import FAILURES

MOST_RUNS = 100_000  # without being asked


@dataclass(frozen=True)
class Plan:
    experiment: Experiment
    folder: Path  # outputs/<name>
    runs: tuple[Run, ...]
    todo: tuple[Run, ...]

    @property
    def pack(self) -> int | None:
        """How many runs share a folder once they are made; None where each keeps its own."""
        return self.experiment.base.setup.record.pack

    @property
    def threads(self) -> int:
        """How many are at work on one run."""
        return self.experiment.base.setup.solver.threads


def plan(experiment: Experiment, out: Path, fresh: bool = False, retry_failed: bool = False, yes: bool = False) -> Plan:
    """The plan of a sweep into `out`/<name>.

    Raises InputError for a matrix that is wrong, or makes more than 100,000 runs without `yes`, and for balls that start inside
    a surface in what is to do.
    """
    size = experiment.matrix.size
    if size > MOST_RUNS and not yes:
        raise InputError(f"{experiment.document.path}: the matrix makes {size:,} runs; --yes starts more than {MOST_RUNS:,}")
    runs = tuple(experiment.runs())
    folder = out / experiment.name
    finished = set() if fresh else store.done(folder)
    if retry_failed:
        finished -= {report["run_id"] for report in store.read_runs(folder, (run.run_id for run in runs)) if failed(report)}
    todo = tuple(run for run in runs if run.run_id not in finished)
    if faults := starts.faults(todo, experiment.document):
        raise InputError(*faults)
    return Plan(experiment, folder, runs, todo)


def failed(report: dict) -> bool:
    return report["status"] in FAILURES


def existing(folder: Path) -> Experiment:
    """The experiment that the output folder was made from. Raises InputError when it is none."""
    from runner.config import check

    path = folder / store.EXPERIMENT
    if not path.is_file():
        raise InputError(f"{folder}: not the output of a sweep, it has no {store.EXPERIMENT}")
    source = store.provenance(folder).get("source")
    return replace(check(Document(path, Path(source) if source else None)), name=folder.resolve().name)
