"""The Python interface, as the README shows it."""

from pathlib import Path

import numpy as np
import pyarrow
import pytest

import runner
from runner import load, run, sweep
from runner.errors import InputError

MATRIX = "matrix: {balls.mass: [1, 2]}\n"


@pytest.fixture
def file(here, fall) -> Path:
    Path("x.yaml").write_text(fall + MATRIX)
    return Path("x.yaml")


def test_load_and_run_one(file):
    experiment = load("x.yaml", {"balls.mass": 10})
    result = run(experiment)
    assert result.status == "finished"
    assert result.trajectory.time.shape == (21,)
    assert result.trajectory.position.shape == result.trajectory.velocity.shape == (21, 1, 3)
    assert result.trajectory.position[0].tolist() == [[0, 1, 0]]
    # forward Euler falls by g h^2 (0 + 1 + ... + 19) in 20 steps; 190 sums of numbers near 1 round by 190 * 1e-16
    assert np.isclose(result.trajectory.position[-1, 0, 1], 1 - 9.8 * 0.01**2 * 190, rtol=0, atol=2e-14)
    assert len(result.bounces) == 0 and "speed_normal" in result.bounces.dtype.names
    assert result.energy.kinetic.shape == result.energy.residual.shape == (21,)
    assert result.summary["bounces"] == 0 and result.parameters["balls"]["mass"] == 10
    assert result.run_id == experiment.base.run_id
    assert [path.name for path in Path().iterdir()] == ["x.yaml"], "nothing is written"


def test_runs_of_the_matrix_one_by_one(file):
    lost = [run(each).summary["energy_initial"] for each in load(file).runs()]
    assert np.allclose(lost, [9.8, 19.6], rtol=1e-15)


def test_sweep_gives_the_table(file):
    table = sweep("x.yaml", out="there", jobs=2)
    assert isinstance(table, pyarrow.Table) and table["balls.mass"].to_pylist() == [1, 2]
    assert Path("there/x/summary.parquet").exists()
    assert sweep("x.yaml", out=Path("there")).equals(table), "what is done is not done again"


def test_sweep_with_other_settings(file, inline):
    assert sweep(file, {"balls.mass": 5}, out="there")["balls.mass"].to_pylist() == [5]


def test_faults_are_exceptions_with_all_of_them(file):
    with pytest.raises(InputError) as error:
        load("x.yaml", {"balls.radius": -1, "solver.step": 0})
    assert len(error.value.faults) == 2 and "balls.radius" in str(error.value)


def test_names_that_are_not_there():
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        runner.nothing
