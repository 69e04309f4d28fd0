"""Expectations: which runs they speak of, what they hold them to, and what `--check` makes of it."""

import math
from pathlib import Path

import pytest

from runner.expect import satisfies, verdicts
from runner.schema import Expectation


def report(run_id, status="finished", mass=1.0, method="rk4", gravity=(0.0, -9.8, 0.0), error=None, **figures):
    parameters = {
        "solver": {"method": method},
        "balls": {"mass": mass},
        "scene": {"gravity": list(gravity), "surfaces": {}},
    }
    return {"run_id": run_id, "status": status, "error": error, "parameters": parameters, "figures": figures}


RUNS = [
    report("a", bounces=3, energy_residual_rel=1e-12),
    report("b", bounces=5, energy_residual_rel=1e-3, mass=2.0),
    report("c", bounces=None, energy_residual_rel=math.nan, status="diverged", method="euler"),
    report("d", status="failed", error="MemoryError", method="euler", gravity=(0.0, 0.0, 0.0)),  # has no figures
]


def judged(**expectation):
    """(number of runs that it speaks of, ids of those that break it)."""
    (verdict,) = verdicts([Expectation(**expectation)], RUNS)
    assert verdict.holds == (verdict.runs > 0 and not verdict.broken)
    return verdict.runs, "".join(run_id for run_id, _ in verdict.broken)


@pytest.mark.parametrize(
    ("expectation", "outcome"),
    [
        (dict(column="bounces", min=3), (4, "cd")),  # nothing and NaN break a bound
        (dict(column="bounces", min=3, where={"status": "finished"}), (2, "")),
        (dict(column="bounces", min=4, where={"status": "finished"}), (2, "a")),
        (dict(column="bounces", min=3, max=4, where={"status": "finished"}), (2, "b")),
        (dict(column="bounces", equals=3, where={"balls.mass": 1, "status": "finished"}), (1, "")),
        (dict(column="energy_residual_rel", max=1e-9), (4, "bcd")),
        (dict(column="energy_residual_rel", max=1e-9, where={"solver.method": "rk4", "balls.mass": 1.0}), (1, "")),
        (dict(column="status", equals="finished"), (4, "cd")),
        (dict(column="status", equals="finished", where={"solver.method": "rk4"}), (2, "")),
        (dict(column="status", equals="diverged", where={"run_id": "c"}), (1, "")),
        (dict(column="error", equals="MemoryError", where={"status": "failed"}), (1, "")),
        (dict(column="balls.mass", max=1), (4, "b")),  # a setting is a column like any other
        (dict(column="status", equals="failed", where={"scene.gravity": [0, 0, 0]}), (1, "")),
        (dict(column="status", equals="finished", where={"balls.mass": 7}), (0, "")),
    ],
)
def test_verdicts(expectation, outcome):
    assert judged(**expectation) == outcome


def test_bounds_are_met_by_their_own_value_and_by_numbers_only():
    bounds = Expectation(column="x", min=1.0, max=2.0)
    assert [satisfies(value, bounds) for value in (1, 2.0, 0.999, 2.001)] == [True, True, False, False]
    assert not any(satisfies(value, bounds) for value in (None, math.nan, "1.5", math.inf))
    assert satisfies(-math.inf, Expectation(column="x", max=0.0)) and not satisfies(
        None, Expectation(column="x", equals="y")
    )
    both = Expectation(column="x", equals=1.0, max=0.5)
    assert not satisfies(1.0, both) and not satisfies(0.5, both)


EXPECT = "matrix: {balls.mass: [1, 2]}\nexpect:\n"
HOLDS = "  - {column: status, equals: finished}\n  - {column: bounces, max: 0}\n"
BREAKS = "  - {column: energy_residual_rel, max: 1e-9, where: {balls.mass: 2}}\n"
NO_RUN = "  - {column: bounces, max: 0, where: {balls.mass: 7}}\n"


@pytest.mark.parametrize(
    ("expectations", "code", "told"),
    [
        (HOLDS, 0, ["ok: status = finished (2 runs)", "ok: bounces <= 0 (2 runs)"]),
        (HOLDS + BREAKS, 1, ["BROKEN: energy_residual_rel <= 1e-09 where balls.mass = 2: 1 of 2 runs"]),
        (HOLDS + NO_RUN, 1, ["BROKEN: bounces <= 0 where balls.mass = 7: no run matches"]),
    ],
)
def test_check_exits_with_1_where_an_expectation_breaks(here, carom, inline, fall, expectations, code, told):
    Path("x.yaml").write_text(fall + EXPECT + expectations)
    assert carom("sweep", "x.yaml").code == 0  # not asked to check
    for options in (["--check"], ["--check", "--fresh"], ["--check", "--quiet"]):  # done already, and made again
        outcome = carom("sweep", "x.yaml", *options)
        assert outcome.code == code
        lines = [line for line in told if "--quiet" not in options or line.startswith("BROKEN")]
        assert all(line.split(": 1 of")[0] in outcome.err for line in lines), outcome.err
    shown = carom("summary", "outputs/x").out
    assert all(line.split(": 1 of")[0] in shown for line in told)


def test_quiet_says_nothing_when_all_is_well(here, carom, inline, fall):
    Path("x.yaml").write_text(fall + EXPECT + HOLDS)
    assert carom("sweep", "x.yaml", "--check", "--quiet") == (0, "", "")
