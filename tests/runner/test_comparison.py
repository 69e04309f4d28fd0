"""Two outputs of the same runs, compared."""

import json
from pathlib import Path

import h5py
import pytest

from runner import seal

RUNS = "matrix: {balls.mass: [1, 2]}\n"


@pytest.fixture
def two(here, fall, carom, inline):
    """Two outputs, a/x and b/x, of the same two runs."""
    Path("x.yaml").write_text(fall + RUNS)
    for out in "ab":
        assert carom("sweep", "x.yaml", "--out", out, "--quiet").code == 0


def report(folder: str) -> Path:
    return next(Path(folder, "x", "runs").glob("*-m1-*/run.json"))


def change(folder: str, **values) -> None:
    path = report(folder)
    told = {name: value for name, value in json.loads(path.read_text()).items() if name != "sha256"}
    path.write_bytes(seal.seal(told | values))


def test_the_same_runs_do_not_differ(two, carom):
    assert carom("compare", "a/x", "b/x")[:2] == (0, "no differences\n")


def test_a_run_is_known_by_its_parameters(two, carom):
    path = report("b").parent
    path.rename(path.with_name("another-id"))
    assert carom("compare", "a/x", "b/x").code == 0


def test_a_run_that_one_side_lacks(two, carom):
    path = report("b").parent
    path.rename("elsewhere")
    code, out, _ = carom("compare", "a/x", "b/x")
    assert (code, out) == (1, f"{path.name}: only in a/x\n0 of 1 runs differ; 1 only in a/x\n")


def test_status_and_figures(two, carom):
    figures = json.loads(report("b").read_text())["figures"]
    was = figures["energy_final"]
    change("b", status="diverged", figures=figures | {"energy_final": was * 1.002, "sim_seconds": 99.0})
    code, out, _ = carom("compare", "a/x", "b/x", "--rtol", "1e-4")
    run_id = report("b").parent.name
    assert code == 1 and "sim_seconds" not in out
    assert out.splitlines() == [
        f"{run_id}: status finished and diverged; energy_final {was} and {was * 1.002} (relative 0.002)",
        f"1 of 2 runs differ; energy_final by up to 0.002 (relative) in {run_id}",
    ]
    change("b", status="finished")
    assert carom("compare", "a/x", "b/x", "--rtol", "1e-2").code == 0


def test_trajectories(two, carom):
    with h5py.File(report("b").with_name("trajectory.h5"), "r+") as file:
        file["particles/balls/position/value"][-1, 0, 0] += 1e-6
    code, out, _ = carom("compare", "a/x", "b/x")
    assert code == 1 and "position differs by up to 1e-06 m, of 1 balls, from 0.2 s on" in out and "velocity" not in out
    assert "1 of 2 runs differ; position by up to 1e-06 m in " in out
    assert carom("compare", "a/x", "b/x", "--rtol", "1e-5").code == 0


def test_a_ball_that_only_one_side_has(two, carom):
    with h5py.File(report("b").with_name("trajectory.h5"), "r+") as file:
        file["particles/balls/position/value"][-1, 0] = float("nan")
    code, out, _ = carom("compare", "a/x", "b/x", "--rtol", "1")
    assert code == 1 and "position: other balls are alive" in out


def test_a_setting_that_the_older_version_did_not_have(two, carom):
    """Left at its default it makes no other run."""
    older = json.loads(report("b").read_text())["parameters"]
    del older["repeats"]
    change("b", parameters=older)
    assert carom("compare", "a/x", "b/x")[:2] == (0, "no differences\n")
    assert carom("compare", "b/x", "a/x")[:2] == (0, "no differences\n")


def test_no_runs(here, carom):
    Path("empty").mkdir()
    code, _, err = carom("compare", "empty", "empty")
    assert (code, err) == (2, "empty: holds no runs\n")
