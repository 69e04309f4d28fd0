"""Each failure of the gallery still fails as its file says, and its cure still cures."""

from pathlib import Path

import pytest

from runner import expect, starts
from runner.config import load
from runner.execute import run

GALLERY = sorted((Path(__file__).parent.parent / "configs" / "failures").glob("*.yaml"))


def test_there_is_a_gallery():
    assert len(GALLERY) >= 13


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_the_failure_and_its_cure_are_as_the_file_says(path):
    experiment = load(path)
    runs = experiment.runs()
    assert starts.faults(runs, experiment.document) == []
    reports = []
    for one in runs:
        result = run(one)
        reports.append(
            {
                "run_id": one.run_id,
                "parameters": one.parameters,
                "status": result.status,
                "error": None,
                "figures": result.summary,
            }
        )
    verdicts = expect.verdicts(experiment.expect, reports)
    assert len(verdicts) >= 3, "it pins the failure and the cure"
    assert [str(verdict) for verdict in verdicts if not verdict.holds] == []
