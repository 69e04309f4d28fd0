"""The bench: what it measures is what it says, its peers do the same work, and its figures can be read."""

import importlib
import json
import os
import shutil
from collections import Counter
from contextlib import contextmanager
from importlib.util import find_spec
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Page
from rerun.chunk import RrdReader

from runner import bench, record
from runner.bench import apart, command, curves, kernels, layout, peers, plain_files, scaling, startup, sweeps, threads
from runner.bench.figure import Figure
from runner.bench.kernels import Case
from runner.bench.peers import _work
from runner.errors import RunError
from runner.execute import run
from sim import integrators
from sim.model import Balls
from sim.simulate import Simulation, Solver

COMPILERS = ("taichi", "warp")  # which take 10 s to start
PEERS = [
    pytest.param(name, k, marks=[pytest.mark.slow] * (name in COMPILERS), id=f"{name}-{k}")
    for name in peers.names()
    for k in range(len(importlib.import_module(f"runner.bench.peers.{name}").PEERS))
]


@pytest.fixture(scope="module", autouse=True)
def briefly():
    """Nothing is repeated for the sake of a steady figure."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "SPREAD", 0.0)
        yield


def test_what_is_short_is_repeated_for_longer_and_what_is_long_less_often(monkeypatch):
    monkeypatch.setattr(kernels, "SPREAD", 0.05)
    monkeypatch.setattr(kernels, "PATIENCE", 0.1)
    for seconds, count in ((0.001, 50), (0.04, 3)):
        calls = []
        monkeypatch.setattr(kernels, "time", SimpleNamespace(perf_counter=lambda: len(calls) * seconds))
        kernels.fastest(lambda: calls.append(None), clock=lambda: 0.0)
        assert len(calls) == count


@contextmanager
def directly():
    """Stands for `apart`, in this process."""
    yield lambda function, *arguments: function(*arguments)


def clocked(start, each, calls):
    """Stands for `carom`, with a cost by itself and one for each run that its workers share; keeps what it is called with."""

    def carom(*arguments, cwd, telling=False, **environment):
        calls.append((arguments, environment))
        runs = int(arguments[1].stem) if arguments[0] == "sweep" and arguments[1].stem.isdigit() else 0
        jobs = arguments[arguments.index("--jobs") + 1] if "--jobs" in arguments else 1
        return command.Spent(start + runs * each / jobs, start + runs * each, 100_000_000 + 1000 * runs)

    return carom


@pytest.mark.parametrize("scene", ["floor", "box", "baffles", "heightfield 5,000"])
def test_exact_is_measured_by_its_impacts(scene):
    speed = bench.measure(Case(scene, "exact", duration=3.0, balls=20))
    assert speed.unit == "events/s" and speed.rate == speed.events / speed.seconds
    assert speed.events >= 20, "every ball falls onto something within 3 s"


@pytest.mark.parametrize("contact", ["swept", "original"])
def test_a_method_with_steps_is_measured_by_its_steps(contact):
    speed = bench.measure(Case("box", "explicit_euler", contact, 0.5, 10))
    assert speed.unit == "ball-steps/s" and speed.rate == speed.steps / speed.seconds
    assert 10 * 500 <= speed.steps <= 10 * 500 + speed.events, "a swept step is cut at an impact"
    assert 0 < speed.seconds < 60 and speed.peak_memory > 10_000_000


def test_every_method_has_a_case_in_every_scene_with_walls():
    assert {"box", "baffles", "heightfield 5,000", "heightfield 80,000", "heightfield 1,000,000"} < set(kernels.SCENES)
    for scene in set(kernels.SCENES) - {"floor"}:
        assert {case.method for case in kernels.cases(scene) if case.contact == "swept"} == {"exact", *integrators.names()}
    assert {case.method for case in kernels.cases("box") if case.contact == "original"} == set(integrators.fixed())


@pytest.mark.parametrize("name, faces", [("heightfield 5,000", 5_000), ("heightfield 80,000", 80_000)])
def test_a_heightfield_has_the_faces_that_it_is_named_after(name, faces):
    (surface,) = kernels.SCENES[name].surfaces().values()
    assert len(surface.mesh().triangles) == faces


def test_a_table_and_json_of_the_kernels(here, carom, monkeypatch):
    monkeypatch.setattr(kernels, "apart", directly)
    monkeypatch.setattr(kernels, "cases", lambda scene: [Case(scene, "exact", duration=0.1, balls=5)] * (scene == "box"))
    code, out, err = carom("bench", "kernels", "--json", "x.json")
    written = json.loads((here / "x.json").read_text())
    assert code == 0 and "box, exact, swept: " in err and "measured in" in out
    assert written["machine"]["processor"] in out and written["seconds"] > 0 and "numba" in written["versions"]
    (row,) = written["kernels"]
    assert row["case"] == {"scene": "box", "method": "exact", "contact": "swept", "duration": 0.1, "balls": 5}
    assert row["unit"] == "events/s" and row["rate"] == pytest.approx(row["events"] / row["seconds"])


def test_a_part_that_is_none(here, carom):
    code, out, err = carom("bench", "kernel")
    assert (code, out) == (2, "") and "did you mean 'kernels'?" in err and len(err.splitlines()) == 1


@pytest.mark.parametrize(
    "options, told", [
        (["kernels", "--chart", "x.png"], "draws what the part scaling measures"),
        (["scaling", "--chart", "x.txt"], "is drawn as .png or .svg"),
        (["kernels", "--json", "nosuch/x.json"], "there is no folder nosuch"),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_written_is_told_before_anything_is_measured(here, carom, options, told):
    code, out, err = carom("bench", *options)
    assert (code, out) == (2, "") and told in err and len(err.splitlines()) == 1


# Sweeps and start-up


def test_the_cost_of_a_run_is_free_of_what_a_sweep_costs_by_itself(monkeypatch):
    calls = []
    monkeypatch.setattr(sweeps, "apart", directly)
    monkeypatch.setattr(sweeps, "writing", lambda *_: (command.Spent(0.004, 0.003, 0), command.Spent(0.01, 0.012, 0), 0.0005))
    monkeypatch.setattr(sweeps, "carom", clocked(2.0, 0.006, calls))
    figures = {figure.what: figure.value for figure in sweeps.costs(print, 10, 1000)}
    assert figures["a run, 1 worker, wall clock"] == pytest.approx(6.0)
    assert figures["runs, 2 workers"] == pytest.approx(1000 / 3)
    assert figures["a run of a worker against its files bare, 2 workers, wall clock"] == pytest.approx(1.5)
    assert figures["a run against its files bare, 1 worker, CPU of all processes"] == pytest.approx(2.0)
    assert figures["a run against plain calls, 1 worker, CPU of all processes"] == pytest.approx(0.5)
    assert figures["a run's simulation alone, in one process, CPU"] == pytest.approx(0.5)
    assert figures["efficiency of 2 workers"] == pytest.approx(1.0)
    assert figures["the parent's peak memory at 10,000 runs, reckoned from its growth"] == pytest.approx(110.0)
    assert {arguments[0] for arguments, _ in calls} == {"sweep"} and len(calls) == 4 * sweeps.REPEATS


def test_writing_bare_writes_both_files_of_each_run(tmp_path):
    file = command.write_experiment(tmp_path / "10.yaml", 10)
    spent, plain, simulating = sweeps.writing(file)
    written = sorted(path.relative_to(tmp_path).parts[1:] for path in tmp_path.glob("bare-*/*/*"))
    each = [(run.run_id, name) for run in sweeps.load(file).runs() for name in ("recording.rrd", "trajectory.h5")]
    assert written == sorted(each * (1 + sweeps.REPEATS))
    assert all(0 < each.wall < 10 and each.cpu > 0 for each in (spent, plain)) and 0 < simulating < 10


def test_plain_calls_write_the_numbers_that_carom_writes(tmp_path):
    result = run(next(iter(sweeps.load(command.write_experiment(tmp_path / "1.yaml", 1)).runs())))
    plain_files.write(result, tmp_path)
    for name in ("hdf5", "rrd"):
        record.load(name).write(result, tmp_path / record.load(name).FILE)
    with h5py.File(tmp_path / "plain.h5") as plain, h5py.File(tmp_path / "trajectory.h5") as ours:
        for name in ("position", "velocity"):
            assert np.array_equal(plain[f"particles/balls/{name}"][:], ours[f"particles/balls/{name}/value"][:], equal_nan=True)
        for name in ("bounces", "rests"):
            assert np.array_equal(plain[f"events/{name}"][:], ours[f"events/{name}"][:])
    for entity in ("/balls", "/bounces", "/energy", "/scene/floor", "/trails"):
        assert rows(tmp_path / "plain.rrd")[entity] == rows(tmp_path / "recording.rrd")[entity]


def rows(path):
    """How many of them an entity has that changes with time."""
    counts = Counter()
    for chunk in RrdReader(path).store().stream().to_chunks():
        counts[chunk.entity_path] = max(counts[chunk.entity_path], chunk.num_rows)
    return counts


@pytest.mark.parametrize("runs", [1, 10, 100])
def test_an_experiment_of_so_many_runs(tmp_path, runs):
    assert len(sweeps.load(command.write_experiment(tmp_path / "x.yaml", runs)).runs()) == runs


def test_cold_is_with_an_empty_folder_of_kernels_and_warm_with_the_same_one(monkeypatch):
    calls = []
    monkeypatch.setattr(startup, "carom", clocked(1.0, 0.0, calls))
    figures = list(startup.times(print))
    assert {figure.unit for figure in figures} == {"s"} and {figure.value for figure in figures} == {1.0}
    assert [figure.what for figure in figures if "cold, wall" in figure.what][0] == "a sweep of one run, cold, wall clock"
    kept = [environment["XDG_CACHE_HOME"] for _, environment in calls if environment]
    assert len(kept) == 2 * (1 + startup.REPEATS) and len(set(kept)) == 2


def test_a_command_is_timed_with_its_memory(tmp_path):
    spent = command.carom("methods", cwd=tmp_path, telling=True)
    assert 0 < spent.cpu < 60 and 10_000_000 < spent.peak_memory < 10**10 and spent.wall > 0


def test_a_command_that_fails_is_told(tmp_path):
    with pytest.raises(RunError, match="exit code 2: .*nosuch.yaml"):
        command.carom("check", "nosuch.yaml", cwd=tmp_path)


def test_the_gain_of_threads_is_the_time_of_one_over_theirs(monkeypatch):
    one, two = threads.seconds("exact", 0.1, 10)
    assert 0 < one < 10 and 0 < two < 10
    monkeypatch.setattr(threads, "apart", directly)
    monkeypatch.setattr(threads, "seconds", lambda *_: (3.0, 2.0))
    figures = list(threads.gains(print))
    assert [figure.value for figure in figures] == [1.5, 1.5] and all("2 threads" in figure.what for figure in figures)


# Peers


@pytest.mark.parametrize("name, index", PEERS)
def test_a_peer_does_the_same_work(name, index):
    module = importlib.import_module(f"runner.bench.peers.{name}")
    if not any(find_spec(needed) or shutil.which(needed) for needed in module.NEEDS):
        pytest.skip(f"{' or '.join(module.NEEDS)} is not installed")
    # two compilers of one kind in a process may not agree
    with (apart.apart if name in COMPILERS else directly)() as call:
        found = call(peers.compared, name, index, 10)
    assert found.right, f"off by {found.answer.error} m"
    assert found.answer.seconds > 0 and found.answer.count > 0
    if name == "mujoco":  # its walls are springs, so that it is late
        assert abs(found.answer.bounces - found.bounces) < 0.05 * found.bounces
    elif name != "embree":
        assert found.answer.bounces == found.bounces


def test_the_closed_form_in_a_box_is_where_exact_ends():
    """Balls up to the ceiling, below it, and one that moves along one axis only."""
    position = np.array([[0.1, 0.2, 0.3], [-0.4, 0.9, 0.5], [0.0, -0.9, 0.2], [0.6, 0.0, 0.0]])
    velocity = np.array([[1.0, 9.0, -2.0], [3.0, -8.0, 0.5], [-1.0, 2.0, 0.0], [0.0, 0.0, 0.0]])
    radius, where = 0.05, kernels.SCENES["box"]
    balls = Balls(1.0, radius, np.inf, np.zeros(4), position, velocity)
    for t in (0.05, 0.7, 5.0):
        flight = Simulation(where.scene(), balls, Solver("exact"), t, t).run()
        # some 50 bounces, each with the rounding of a place of 1 m and a speed of 10 m/s for 5 s
        assert np.abs(flight.trajectory.position[-1] - _work.in_a_box(position, velocity, radius, t)).max() < 1e-13


def test_a_peer_that_is_not_installed_is_listed(monkeypatch):
    monkeypatch.setattr(peers, "find_spec", lambda _: None)
    monkeypatch.setattr(shutil, "which", lambda _: None)
    rows = list(peers.compare(print))
    assert rows == [peers.Missing(name, "not installed") for name in peers.names()]


def test_a_peer_that_fails_takes_no_other_down(monkeypatch):
    def failing(name, index):
        raise RunError("the process\nof it died")

    monkeypatch.setattr(peers, "apart", directly)
    monkeypatch.setattr(peers, "compared", failing)
    monkeypatch.setattr(peers, "names", lambda: ["cpp"])
    monkeypatch.setattr(shutil, "which", lambda name: name)
    rows = list(peers.compare(print))
    assert len(rows) == 6 and {row.why for row in rows} == {"RunError: the process of it died"}


def test_a_process_apart_that_dies_is_told():
    with apart.apart() as call:
        assert call(os.path.basename, "a/b") == "b"
        assert call(os.getpid) == call(os.getpid) != os.getpid()
        with pytest.raises(RunError, match="posix died"):
            call(os._exit, 3)


def test_a_wrong_answer_is_told():
    answer = _work.Answer(seconds=2.0, count=100, error=0.2, bounces=7)
    row = peers.Comparison("peer", "box", answer, "events/s", 8, 0.1, "exact", 500.0, 1e-15, 10**8)
    assert not row.right and row.ratio == 10.0
    ((_, headings, lines),) = layout.tables("peers", [row, peers.Missing("other", "not installed")])
    assert "2.0e-01 WRONG" in lines[0] and "7 of 8" in lines[0] and lines[1][:2] == ["other", "not installed"]
    assert {len(line) for line in lines} == {len(headings)}
    with pytest.raises(ValueError, match="not finite"):
        _work.Answer(1.0, 1, np.nan)


# How the cost grows


@pytest.fixture(scope="module")
def grown():
    """The points of little work."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scaling, "apart", directly)
        patch.setattr(scaling, "CROWD", 10)
        patch.setattr(scaling, "carom", clocked(2.0, 0.01, []))
        return list(scaling.points(print, {"balls": [1, 4], "faces": [2, 50], "frames": [2, 31], "runs": [10, 1000]}))


def test_what_grows_is_all_that_does(grown):
    seen = {(point.grows, point.what) for point in grown}
    assert {grows for grows, _ in seen} == {"balls", "faces", "frames", "runs"}
    assert {("faces", "geometry"), ("balls", "exact"), ("frames", "trajectory.h5"), ("runs", "sweep")} < seen
    assert len(grown) == 2 * len(seen) and all(point.seconds > 0 and point.each > 0 for point in grown)
    per_ball = {point.size: point.seconds / point.each for point in grown if (point.grows, point.what) == ("balls", "exact")}
    assert per_ball == pytest.approx({1: scaling.IN_THE_BOX, 4: 4 * scaling.IN_THE_BOX})


def test_the_last_runs_are_reckoned_from_the_slope(grown):
    sweeps_ = [point for point in grown if point.what == "sweep"]
    reckoned = curves._reckoned(*sweeps_)
    assert reckoned.size == 100_000 and reckoned.seconds == pytest.approx(2.0 + 1000.0)


def test_the_chart_is_drawn(grown, tmp_path):
    curves.draw(grown, tmp_path / "x.svg")
    text = (tmp_path / "x.svg").read_text()
    assert all(panel.title in text for panel in curves.PANELS.values()) and "16.7 min" in text
    assert "libraries and workers" in text and "fresh memory" not in text, "it is written at points that are there"


def test_notes_stand_where_there_is_room():
    """On neither of the lines, nor on each other, and wholly within the axes; near their point for all that."""
    axes = Page(figsize=(4, 3)).subplots()
    FigureCanvasAgg(axes.figure)
    lines = [axes.plot([0, 10], ys)[0] for ys in ([0, 10], [4, 4])]
    axes.figure.canvas.draw()
    room, point = axes.get_window_extent(), axes.transData.transform((9, 9))
    one = curves._write_near(axes, "what bends it,\nin two lines", (9, 9), [])
    other = curves._write_near(axes, "what bends it,\nin two lines", (9, 9), [one])
    assert not one.overlaps(other)
    for box in (one, other):
        assert all(room.contains(*corner) for corner in (box.p0, box.p1))
        assert not any(line.get_path().transformed(line.get_transform()).intersects_bbox(box, False) for line in lines)
        assert np.hypot(*(box.p0 + box.p1) / 2 - point) < 120


def test_figures_are_rounded_to_be_read():
    assert str(Figure("a run", 12.3456, "ms")) == "a run: 12.35 ms"
    ((title, _, rows),) = layout.tables("sweep", [Figure("a run", 12.3456, "ms")])
    assert title == "Sweep" and rows == [["a run", "12.3", "ms"]]
