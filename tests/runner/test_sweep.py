"""A sweep, its folder, and what the same sweep does again."""

import csv
import json
import os
import shutil
from pathlib import Path

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest

from runner import aggregate, columns, config, plan, store, sweeping

MATRIX = """\
matrix:
  solver.method: [explicit_euler, rk4_original]
  balls.mass: [1, 2]
"""
TINY = MATRIX + "charts: [{kind: lines, x: balls.mass, y: energy_residual, series: solver.method}]\n"
TWO = "matrix: {balls.mass: [1, 2]}\n"
CHART = "lines-energy_residual-by-balls.mass"
RUN_FILES = {"trajectory.h5", "recording.rrd", "run.json"}


@pytest.fixture(scope="module")
def swept(tmp_path_factory, carom_process, fall):
    """The folder of a sweep of four runs, made by the command as users have it. It is only looked at."""
    folder = tmp_path_factory.mktemp("swept")
    (folder / "tiny.yaml").write_text(fall.replace("[hdf5]", "[hdf5, rrd]") + TINY)
    code, out, err = carom_process("sweep", "tiny.yaml", "-s", "balls.radius=0.1", "--jobs", "2", cwd=folder)
    assert (code, out) == (0, ""), err
    assert "tiny: 4 runs, 0 done, 4 to do" in err and "4 finished" in err
    return folder


@pytest.fixture
def again(here, swept):
    """A copy of that sweep, and the current folder."""
    shutil.copytree(swept, here, dirs_exist_ok=True)
    return here


def sweep_again(carom, *options):
    return carom("sweep", "tiny.yaml", "-s", "balls.radius=0.1", *options)


def stamps(folder):
    """When and under which inode each file and folder was last written."""
    return {path: (path.stat().st_mtime_ns, path.stat().st_ino) for path in sorted(folder.rglob("*"))}


def runs_in(folder):
    return {path.name: path for path in (folder / "runs").iterdir()}


def changed(before, after):
    return {path for path in before.keys() | after.keys() if before.get(path) != after.get(path)}


# What a sweep leaves


def test_the_folder_holds_what_the_readme_says_and_nothing_else(swept):
    folder = swept / "outputs" / "tiny"
    ids = {run.run_id for run in plan.existing(folder).runs()}
    assert {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()} == {
        "experiment.yaml", "provenance.json", "summary.parquet", "summary.csv", "report.html",
        f"charts/{CHART}.png", f"charts/{CHART}.svg",
        *(f"runs/{run_id}/{name}" for run_id in ids for name in RUN_FILES),
    }  # fmt: skip
    assert len(ids) == 4 and {path.name for path in swept.iterdir()} == {"tiny.yaml", "outputs"}


def test_run_json_tells_all_of_a_run(swept):
    for run_id, folder in runs_in(swept / "outputs" / "tiny").items():
        report = json.loads((folder / "run.json").read_text())
        assert set(report) == {"run_id", "status", "error", "parameters", "figures", "timings", "files", "sha256"}
        assert report["files"].keys() == RUN_FILES - {"run.json"}
        assert (report["run_id"], report["status"], report["error"]) == (run_id, "finished", None)
        assert config.resolve(report["parameters"], swept).run_id == run_id
        assert list(report["figures"]) == list(columns.FIGURES)
        assert report["figures"]["balls"] == 1 and report["figures"]["steps"] == 20
        assert report["figures"]["energy_lost"] == 0 and report["figures"]["sim_seconds"] > 0
        assert report["timings"]["wall_seconds"] > report["figures"]["sim_seconds"]


def test_the_summary_has_a_row_per_run_and_all_columns(swept):
    folder = swept / "outputs" / "tiny"
    table = pq.read_table(folder / "summary.parquet")
    fixed = """run_id status error solver.method balls.mass method contact step balls steps bounces bounces_per_ball_max
        rest_count penetrations energy_initial energy_final energy_lost work energy_residual energy_residual_rel
        position_error_rms
        position_error_max sim_seconds ball_steps_per_second ns_per_ball_second wall_seconds started""".split()
    assert [name for name in table.column_names if name in fixed] == fixed
    assert table.column_names[:5] == fixed[:5] and table.column_names[-2:] == fixed[-2:]
    assert [tuple(row.values()) for row in table.select(["method", "balls.mass"]).to_pylist()] == [
        ("explicit_euler", 1), ("explicit_euler", 2), ("rk4_original", 1), ("rk4_original", 2)
    ]  # fmt: skip
    for row in table.to_pylist():
        report = store.read_run(folder, row["run_id"])
        assert {name: row[name] for name in columns.FIGURES} == report["figures"]
        assert row["started"] == report["timings"]["started"]

    with open(folder / "summary.csv", newline="") as file:
        header, *rows = csv.reader(file)
    assert header == table.column_names
    for written, row in zip(rows, table.to_pylist(), strict=True):
        for text, value in zip(written, row.values()):
            assert text == "" if value is None else type(value)(text) == value


def test_the_experiment_is_kept_as_it_was_run(swept):
    folder = swept / "outputs" / "tiny"
    text = (folder / "experiment.yaml").read_text()
    assert text.startswith("# How does a ball fall?\n") and "radius: 0.1" in text
    assert {run.run_id for run in config.load(folder / "experiment.yaml").runs()} == set(runs_in(folder))
    assert plan.existing(folder).name == "tiny"


def test_provenance(swept):
    told = json.loads((swept / "outputs" / "tiny" / "provenance.json").read_text())
    assert {"carom", "python", "numpy", "numba", "h5py", "rerun-sdk", "pydantic"} <= set(told["versions"])
    assert told["machine"]["cores"] == os.cpu_count() and told["machine"]["processor"] and told["machine"]["system"]
    assert told["command"][1:] == ["sweep", "tiny.yaml", "-s", "balls.radius=0.1", "--jobs", "2"]
    assert told["source"] == str(swept) and told["commit"] is None
    assert told["start"] <= told["end"]


def test_the_commit_of_the_experiments_folder(here, inline, carom, fall):
    Path("x.yaml").write_text(fall)
    os.system("git init -q . && git -c user.name=a -c user.email=b commit -q --allow-empty -m x")
    assert carom("sweep", "x.yaml").code == 0
    assert len(json.loads(Path("outputs/x/provenance.json").read_text())["commit"]) == 40


# The same again


def test_the_same_sweep_again_touches_nothing(again, carom):
    before = stamps(again)
    code, _, err = sweep_again(carom)
    assert code == 0 and "4 runs, 4 done, 0 to do" in err
    assert stamps(again) == before


def test_a_missing_run_is_made_again_and_only_that(again, carom, inline):
    folder = again / "outputs" / "tiny"
    gone = sorted(runs_in(folder))[1]
    shutil.rmtree(folder / "runs" / gone)
    before, summary = stamps(folder / "runs"), (folder / "summary.csv").read_text()
    assert sweep_again(carom).code == 0
    assert changed(before, stamps(folder / "runs")) == {folder / "runs" / gone, *(folder / "runs" / gone).iterdir()}
    assert len(runs_in(folder)) == 4 and not list(folder.rglob(".*"))
    assert [line.split(",")[0] for line in (folder / "summary.csv").read_text().splitlines()] == [
        line.split(",")[0] for line in summary.splitlines()
    ]


@pytest.mark.parametrize("lost", ["summary.csv", "summary.parquet", "report.html", "charts", f"charts/{CHART}.svg"])
def test_a_missing_summary_or_chart_is_made_again_without_a_run(again, carom, lost):
    folder = again / "outputs" / "tiny"
    path = folder / lost
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    before = stamps(folder / "runs")
    assert sweep_again(carom).code == 0
    assert path.exists() and stamps(folder / "runs") == before


def test_an_override_adds_its_own_runs_and_only_those(again, carom, inline):
    folder = again / "outputs" / "tiny"
    before = stamps(folder / "runs")
    code, _, err = sweep_again(carom, "-s", "balls.mass=2,3")
    assert code == 0 and "4 runs, 2 done, 2 to do" in err
    new = runs_in(folder).keys() - {path.name for path in before}
    assert len(new) == 2 and all("-m3-" in run_id for run_id in new)
    assert {path for path in changed(before, stamps(folder / "runs")) if path in before} == set()
    assert sorted(aggregate.read(folder)["balls.mass"].to_pylist()) == [1, 1, 2, 2, 3, 3]
    assert carom("status", folder).out == "done 4, failed 0, todo 0\n2 more runs are there, of other settings\n"


def test_rows_of_other_settings_are_told_apart(again, carom, inline):
    """A setting that the matrix does not vary gets a column once runs of the folder differ in it."""
    assert sweep_again(carom, "-s", "balls.radius=0.2", "-s", "record.every=0.02").code == 0
    table = aggregate.read(again / "outputs" / "tiny")
    assert sorted(table["balls.radius"].to_pylist()) == [0.1] * 4 + [0.2] * 4
    assert "record.every" not in table.column_names


def test_fresh_makes_all_runs_again(again, carom, inline):
    folder = again / "outputs" / "tiny"
    before = stamps(folder / "runs")
    assert sweep_again(carom, "--fresh").code == 0
    after = stamps(folder / "runs")
    assert before.keys() == after.keys() == changed(before, after)


def test_a_dry_run_writes_nothing_and_lists_what_is_to_do(again, carom):
    before = stamps(again)
    code, out, _ = sweep_again(carom, "-s", "balls.mass=2,3", "--dry-run")
    heading, *ids = out.splitlines()
    assert code == 0 and heading == "outputs/tiny: 4 runs, 2 done, 2 to do"
    assert len(ids) == 2 and all("-m3-" in run_id for run_id in ids)
    assert stamps(again) == before


def test_what_a_sweep_that_died_left_behind_is_cleared(again, carom, inline):
    folder = again / "outputs" / "tiny"
    aside = folder / "runs" / store.ASIDE
    dead = f"{os.uname().nodename}-{2**22 + 1}"  # above the largest process id
    (aside / f"half-m1.{dead}").mkdir(parents=True)
    (aside / "half-m1.claim").write_text("Fatal Python error")
    for unnamed in (folder / f".summary.csv.{dead}", folder / "charts" / f".a.png.{dead}"):
        unnamed.write_text("half")
    assert carom("status", folder).out == "done 4, failed 0, todo 0\n"
    assert sweep_again(carom, "-s", "balls.mass=3").code == 0
    assert not list(folder.rglob(".*"))


# Runs that go wrong


@pytest.fixture
def with_mesh(here, fall):
    """x.yaml: a run over a plane, one over a mesh."""
    triangle = "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n"
    Path("t.obj").write_text(triangle)
    Path("x.yaml").write_text(fall + "matrix: {scene.surfaces.floor: [{shape: mesh, file: t.obj}, {shape: plane}]}\n")
    return triangle


def test_a_run_that_fails_is_told_and_the_others_finish(with_mesh, inline, carom):
    work = plan.plan(config.load("x.yaml"), Path("outputs"))
    Path("t.obj").unlink()
    sweeping.carry_out(work)
    table = {row["status"]: row for row in sweeping.finish(work).to_pylist()}
    assert set(table) == {"failed", "finished"}
    assert "there is no file t.obj" in table["failed"]["error"] and "\n" not in table["failed"]["error"]
    assert table["failed"]["bounces"] is None and table["finished"]["steps"] == 20
    report = store.read_run(work.folder, table["failed"]["run_id"])
    assert "Traceback" in report["traceback"] and report["figures"] == {}

    Path("t.obj").write_text(with_mesh)
    before = stamps(work.folder / "runs")
    code, _, err = carom("sweep", "x.yaml", "--quiet")
    assert code == 1 and err.count("\n") == 1 and err.startswith(f"{report['run_id']}: failed: ")
    assert changed(before, stamps(work.folder / "runs")) == set()
    assert carom("status", work.folder).out.splitlines()[0] == "done 1, failed 1, todo 0"

    assert carom("sweep", "x.yaml", "--retry-failed", "--quiet") == (0, "", "")
    good = work.folder / "runs" / table["finished"]["run_id"]
    assert good not in changed(before, stamps(work.folder / "runs"))
    assert aggregate.read(work.folder)["status"].to_pylist() == ["finished", "finished"]


MEMORY, TOO_OFTEN = 4_000_000_000, 4e-9  # bytes, and s between frames that take 3.6 GB


def test_a_run_larger_than_the_memory_fails_alone(here, carom_process, fall):
    Path("x.yaml").write_text(fall)
    code, _, err = carom_process("sweep", "x.yaml", "-s", f"record.every={TOO_OFTEN},0.01", "--quiet", cwd=here, memory=MEMORY)
    assert code == 1 and "Traceback" not in err and "failed: MemoryError: Unable to allocate" in err.splitlines()[-1]
    reports = store.read_runs(here / "outputs" / "x")
    assert sorted(report["status"] for report in reports) == ["failed", "finished"]


def test_a_log_names_what_is_compiled(here, carom, inline, fall):
    Path("x.yaml").write_text(fall)
    code, _, err = carom("sweep", "x.yaml", "-s", "balls.mass=1,2")
    assert code == 0 and "\npreparing 1 kernel (explicit_euler (original contact)), compiled at the first use" in err


def test_fail_fast_stops_at_the_first_failure(here, carom_process, fall):
    Path("x.yaml").write_text(fall)
    masses = ",".join(str(mass) for mass in range(1, 101))
    options = ["-s", f"record.every={TOO_OFTEN},0.01", "-s", f"balls.mass={masses}", "--jobs", "1", "--fail-fast"]
    code, _, err = carom_process("sweep", "x.yaml", *options, cwd=here, memory=MEMORY)
    made = list(store.read_runs(here / "outputs" / "x"))
    assert code == 1 and "200 to do" in err
    assert 1 <= len(made) < 50 and {report["status"] for report in made} == {"failed"}
    assert not list((here / "outputs").rglob(".*"))
    code, _, err = carom_process("status", "outputs/x", cwd=here)
    assert code == 0


def test_a_run_that_takes_too_long_keeps_what_it_has(here, carom, inline, fall):
    Path("x.yaml").write_text(fall)
    code, _, err = carom("sweep", "x.yaml", "--timeout", "0")
    assert code == 1 and ": timeout: stopped after 0 s" in err
    (report,) = store.read_runs(here / "outputs" / "x")
    assert (report["status"], report["error"], report["figures"]["balls"]) == ("timeout", "stopped after 0 s", 1)
    with h5py.File(here / "outputs" / "x" / "runs" / report["run_id"] / "trajectory.h5") as file:
        frames = file["particles/balls/position/value"][:]
    assert 1 <= len(frames) < 21 and np.isfinite(frames).all()
    assert carom("sweep", "x.yaml", "--retry-failed", "--timeout", "60").code == 0


def test_a_diverged_run_is_a_result(here, carom, inline, fall):
    """omega h = 1000 * 0.01 = 10: every step multiplies the energy by 101, so 1e8 m/s are passed at the 8th."""
    Path("x.yaml").write_text(fall.replace("scene:", "scene:\n  forces: {well: {type: spring, stiffness: 1.0e+6}}"))
    code, _, err = carom("sweep", "x.yaml")
    assert code == 0 and "1 diverged" in err
    (report,) = store.read_runs(here / "outputs" / "x")
    assert report["status"] == "diverged" and report["error"] is None
    with h5py.File(here / "outputs" / "x" / "runs" / report["run_id"] / "trajectory.h5") as file:
        speed = np.linalg.norm(file["particles/balls/velocity/value"][:, 0], axis=-1)
    assert 2 < len(speed) < 21 and np.isfinite(speed).all() and 1e4 < speed[-1] <= 1e8


@pytest.mark.parametrize(("others", "tally"), [("", "1 rested"), (", {position: [0, 9, 0]}", "1 finished")])
@pytest.mark.parametrize("method", ["exact", "rk4_original"])
def test_a_run_whose_balls_all_rest_is_rested(here, carom, inline, fall, method, others, tally):
    """One falls from 0.94 m over the floor; another is still on its way down at the end."""
    for old, new in {
        "scene:": "scene:\n  restitution: 0.1",
        "duration: 0.2": "duration: 1.2",
        ", contact: original": "",
        "explicit_euler": method,
        "[0, 1, 0]}": "[0, 1, 0]}" + others,
    }.items():
        fall = fall.replace(old, new)
    Path("x.yaml").write_text(fall)
    code, _, err = carom("sweep", "x.yaml")
    assert code == 0 and tally in err
    (report,) = store.read_runs(here / "outputs" / "x")
    assert (report["status"], report["error"], report["figures"]["rest_count"]) == (tally[2:], None, 1)
    assert (report["figures"]["step"] is None) == (method == "exact")
    assert carom("status", "outputs/x").out == "done 1, failed 0, todo 0\n"
    row = aggregate.read(here / "outputs" / "x").to_pylist()[0]
    assert row["status"] == tally[2:] and row["rest_count"] == 1 and (row["step"] is None) == (method == "exact")
    with h5py.File(here / "outputs" / "x" / "runs" / report["run_id"] / "trajectory.h5") as file:
        (rest,) = file["events/rests"][:]
        position, velocity = (file[f"particles/balls/{name}/value"][-1, 0] for name in ("position", "velocity"))
    # the fall takes 0.44 s, the hops after it, with 0.1, 0.01, ... of the speed, 2/9 of that
    assert rest["time"] == pytest.approx((0.94 / 4.9) ** 0.5 * (1 + 2 / 9), rel=1e-6)
    assert (rest["ball"], rest["surface"]) == (0, 0)
    assert position == pytest.approx([0, 0.06, 0], abs=1e-12) and not velocity.any()


# Looking at it


def test_status_counts_what_is_to_do(again, carom):
    folder = again / "outputs" / "tiny"
    shutil.rmtree(folder / "runs" / min(runs_in(folder)))
    assert carom("status", folder) == (0, "done 3, failed 0, todo 1\n", "")


def test_the_summary_as_a_table_and_as_text(again, carom):
    code, out, _ = carom("summary", "outputs/tiny", "--csv")
    assert code == 0 and out.splitlines() == (again / "outputs/tiny/summary.csv").read_text().splitlines()

    code, out, _ = carom("summary", "outputs/tiny", "--by", "balls.mass,status", "--csv")
    heading, *rows = list(csv.reader(out.splitlines()))
    assert code == 0 and heading[:3] == ["balls.mass", "status", "runs"]
    assert [row[:3] for row in rows] == [["1", "finished", "2"], ["2", "finished", "2"]]

    code, out, _ = carom("summary", "outputs/tiny")
    assert (
        code == 0
        and out.startswith("tiny: 4 runs")
        and all(run_id in out for run_id in runs_in(again / "outputs" / "tiny"))
    )


@pytest.mark.parametrize(("most", "heading"), [(4, "4 runs"), (3, "4 runs by solver.method"), (1, "4 runs by method")])
def test_a_long_summary_is_grouped_unasked_until_it_is_short(again, carom, monkeypatch, most, heading):
    monkeypatch.setattr("runner.tables.MOST_ROWS", most)
    assert carom("summary", "outputs/tiny").out.splitlines()[0].strip() == f"tiny: {heading}"


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (
            ["summary", "outputs/tiny", "--by", "balls.mas"],
            "--by balls.mas: no such column (did you mean 'balls.mass'?)\n",
        ),
        (["summary", "."], ".: not the output of a sweep, it has no experiment.yaml\n"),
        (["status", "nowhere"], "nowhere: not the output of a sweep, it has no experiment.yaml\n"),
        (["chart", "nowhere"], "nowhere: not the output of a sweep, it has no experiment.yaml\n"),
        (["view", "nowhere"], "nowhere: holds no recordings; put rrd into record.formats\n"),
        (["view", "outputs/tiny", "zzz"], "outputs/tiny: no recording of a run zzz\n"),
    ],
)
def test_a_wrong_question_is_told_in_a_line(again, carom, arguments, error):
    assert carom(*arguments) == (2, "", error)


def test_charts_are_drawn_again_from_the_table(again, carom):
    charts = again / "outputs" / "tiny" / "charts"
    drawn = {path.name: path.read_bytes() for path in charts.iterdir()}
    shutil.rmtree(charts)
    code, out, _ = carom("chart", "outputs/tiny")
    assert code == 0 and out.split() == [*(f"outputs/tiny/charts/{name}" for name in sorted(drawn)), "outputs/tiny/report.html"]
    assert {path.name: path.read_bytes() for path in charts.iterdir()} == drawn


def test_a_chart_may_read_a_setting_that_does_not_vary(here, carom, inline, fall):
    Path("x.yaml").write_text(fall + "charts: [{kind: lines, x: balls.mass, y: bounces, series: solver.method}]\n")
    assert carom("sweep", "x.yaml").code == 0
    assert aggregate.read(here / "outputs" / "x")["solver.method"].to_pylist() == ["explicit_euler"]
    assert list((here / "outputs/x/charts").glob("*.png"))


def test_seeds_that_no_float_can_hold_stay_what_they_are(here, carom, inline, fall):
    """In the experiment's YAML, in JSON, in HDF5, and in the table."""
    seeds = [2**53, 2**53 + 1, 2**64 - 2, 2**64 - 1]
    start = "scatter: {count: 2, box: [[0, 1, 0], [1, 2, 1]]}"
    Path("x.yaml").write_text(fall.replace("released: [{position: [0, 1, 0]}]", start))
    assert carom("sweep", "x.yaml", "--quiet", "-s", f"balls.scatter.seed={','.join(map(str, seeds))}").code == 0
    again = {run.run_id: run.setup.balls.scatter.seed for run in config.load("outputs/x/experiment.yaml").runs()}
    told = {report["run_id"]: report["parameters"]["balls"]["scatter"]["seed"] for report in store.read_runs(Path("outputs/x"))}
    written = {}
    for run_id in told:
        with h5py.File(f"outputs/x/runs/{run_id}/trajectory.h5") as file:
            settings = json.loads(file["parameters/configuration"][()])
        written[run_id] = config.resolve(settings, Path()).setup.balls.scatter.seed
        assert config.resolve(settings, Path()).run_id == run_id
    assert sorted(again.values()) == seeds and again == told == written
    assert aggregate.read(Path("outputs/x"))["balls.scatter.seed"].to_pylist() == list(map(str, seeds))
