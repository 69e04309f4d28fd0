"""Many runs in a few files: they hold what the runs' own did, and every command finds the runs in them."""

import shutil
import subprocess
import sys
from multiprocessing import get_context
from pathlib import Path

import h5py
import numpy as np
import pytest

from runner import aggregate, load, packing, plan, store, sweeping, viewer
from runner.columns import TIMED

PACK = {"trajectories.h5", "recordings.rrd", "runs.jsonl", "pack.json"}


def packs(folder) -> list[tuple[str, int]]:
    return [(entry.name, len(store.members(entry))) for entry in store.entries(Path(folder)) if store.pack_number(entry)]


def single(folder) -> list[str]:
    return [entry.name for entry in store.entries(Path(folder)) if not store.pack_number(entry)]


def tree(group: h5py.Group) -> dict:
    """All that a group holds: attributes, and the values of datasets."""
    found = {"": dict(group.attrs)}
    group.visititems(lambda name, item: found.update({name: (dict(item.attrs), getattr(item, "dtype", None), bytes_of(item))}))
    return found


def bytes_of(item) -> bytes:
    return np.asarray(item[()]).tobytes() if isinstance(item, h5py.Dataset) and item.dtype != object else b""


def sweep(carom, *options, out="packed"):
    return carom("sweep", "x.yaml", "--quiet", "--out", out, *options)


def test_a_pack_is_a_folder_with_a_file_of_each_kind(outputs):
    runs = outputs / "packed/x/runs"
    assert {path.relative_to(runs).as_posix() for path in runs.rglob("*") if path.is_file()} == {
        f"pack-{number}/{name}" for number in (1, 2) for name in PACK
    }
    assert packs(outputs / "packed/x") == [("pack-1", 2), ("pack-2", 2)]


def test_packed_runs_are_the_same_runs(outputs):
    one, other = (outputs / layout / "x" for layout in ("single", "packed"))
    assert store.done(one) == store.done(other)
    mine, theirs = (aggregate.read(folder) for folder in (one, other))
    kept = [name for name in mine.column_names if name not in (*TIMED, "wall_seconds", "started")]
    assert mine.select(kept).equals(theirs.select(kept))


def test_a_packed_trajectory_holds_all_that_its_file_did(outputs):
    for run_id, place in store.places(outputs / "packed/x").items():
        with h5py.File(outputs / "single/x/runs" / run_id / "trajectory.h5") as own, h5py.File(place / "trajectories.h5") as all_:
            one, other = tree(own), tree(all_[run_id])
            assert one.keys() == other.keys() and len(one) > 30
            for name in one:
                np.testing.assert_equal(other[name], one[name])
            assert all_[run_id]["parameters/run_id"][()].decode() == run_id
            # a frame's time is kept once for all that have frames
            times = [all_[run_id][f"particles/balls/{name}/time"] for name in ("position", "velocity")]
            assert times[0] == times[1]


def test_a_packed_recording_is_taken_out_whole(outputs, tmp_path):
    for run_id in store.members(outputs / "packed/x/runs/pack-1"):
        (path,) = viewer.recordings(outputs / "packed/x", [run_id], tmp_path)
        own = outputs / "single/x/runs" / run_id / "recording.rrd"
        compare = [sys.executable, "-m", "rerun_cli", "rrd", "compare", path, own]
        assert subprocess.run(compare, capture_output=True).returncode == 0
    assert len(viewer.recordings(outputs / "packed/x", [], tmp_path)) == 4


def test_charts_and_comparisons_read_packs(copied, carom):
    drawn = {}
    for layout in ("single", "packed"):
        with open(f"{layout}/x/experiment.yaml", "a") as file:
            file.write("charts: [{kind: energy}]\n")
        assert carom("chart", f"{layout}/x").code == 0
        drawn[layout] = Path(layout, "x/charts/energy.svg").read_bytes()
    assert drawn["single"] == drawn["packed"] and b"not shown" not in drawn["packed"]
    assert carom("compare", "single/x", "packed/x")[:2] == (0, "no differences\n")
    assert '"recorded":[true,true,true,true]' in Path("packed/x/report.html").read_text().replace(" ", "")


def test_only_whole_packs_are_made_and_the_rest_is_packed_when_there_is_more(copied, carom):
    before = {path: path.stat().st_ino for path in Path("packed/x/runs").rglob("*")}
    assert sweep(carom, "-s", "record.pack=2").code == 0
    assert {path: path.stat().st_ino for path in Path("packed/x/runs").rglob("*")} == before
    assert sweep(carom, "-s", "record.pack=2", "-s", "balls.mass=4,5").code == 0
    assert len(packs("packed/x")) == 2 and len(single("packed/x")) == 1
    assert sweep(carom, "-s", "record.pack=2", "-s", "balls.mass=5,6,7").code == 0
    assert packs("packed/x") == [("pack-1", 2), ("pack-2", 2), ("pack-3", 2)] and len(single("packed/x")) == 1
    assert aggregate.read(Path("packed/x")).num_rows == 7


def test_a_large_sweep_packs_on_its_way(here, fall, inline, monkeypatch):
    """After every four runs here."""
    monkeypatch.setattr(packing, "WAVE", 4)
    Path("x.yaml").write_text(fall + "matrix: {balls.mass: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]}\n")
    work, seen, progress = plan.plan(load("x.yaml", {"record.pack": 3}), Path()), [], sweeping.Progress()
    progress.done = lambda *_: seen.append(len(single("x")))
    sweeping.carry_out(work, progress=progress)
    assert seen == [1, 2, 3, 4, 2, 3, 4, 5, 3, 4] and packs("x") == [("pack-1", 3), ("pack-2", 3), ("pack-3", 3)]


def test_an_output_is_packed_later(copied, carom):
    assert sweep(carom, "-s", "record.pack=3", out="single").code == 0
    assert packs("single/x") == [("pack-1", 3)] and len(single("single/x")) == 1
    assert carom("status", "single/x", "--verify").code == 0


def test_of_two_copies_the_newest_counts(copied, carom):
    """A sweep that was killed after it made a pack, before it removed the runs' own folders, leaves both."""
    run_id = min(store.done(Path("packed/x")))
    shutil.copytree(f"single/x/runs/{run_id}", f"packed/x/runs/{run_id}")
    assert store.places(Path("packed/x"))[run_id].name == run_id and len(list(store.read_runs(Path("packed/x")))) == 4
    assert sweep(carom, "--fresh", "-s", "record.pack=2").code == 0
    assert packs("packed/x") == [("pack-3", 2), ("pack-4", 2)] and single("packed/x") == []


def test_a_run_that_is_packed_while_it_is_looked_for(copied, monkeypatch):
    """Another sweep does so between the look at what there is and the reading."""
    folder, look = Path("single/x"), store.places
    with monkeypatch.context() as patch:

        def places(folder):
            found = look(folder)
            patch.setattr(store, "places", look)
            for run_ids in packing.batches(folder, 2):
                packing.pack(packing.Pack(folder / "runs", run_ids))
            return found

        patch.setattr(store, "places", places)
        assert len(list(store.read_runs(folder))) == 4
    assert single(folder) == []


def test_a_damaged_run_is_not_packed(copied, carom):
    """It would get a checksum that holds."""
    run_id = single("single/x")[1]
    path = Path("single/x/runs", run_id, "trajectory.h5")
    path.write_bytes(path.read_bytes()[:-1] + b"?")
    assert sweep(carom, "-s", "record.pack=2", "-s", "balls.mass=1,2,3,4,5", out="single").code == 0
    assert run_id in single("single/x") and len(single("single/x")) == 3 and packs("single/x") == [("pack-1", 2)]
    assert carom("status", "single/x", "--verify").out.startswith(f"{path}: changed")


@pytest.mark.parametrize("step", ["runner.record.rrd.join", "runner.store.write_contents", "runner.packing._publish"])
def test_a_pack_that_cannot_be_written_costs_no_run(copied, monkeypatch, step):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(step, full)
    folder = Path("single/x")
    (run_ids,) = packing.batches(folder, 4)
    with pytest.raises(OSError, match="No space"):
        packing.pack(packing.Pack(folder / "runs", run_ids))
    store.clear(folder)
    assert len(single(folder)) == 4 and packs(folder) == [] and not list(folder.rglob(".*"))
    assert not any(any(store.faults(entry)) for entry in store.entries(folder))


def test_a_kill_while_packing_loses_no_run(copied):
    """At ten moments of it: every run is in one place or in both, and whole."""
    folder, whole = Path("single/x"), list(store.read_runs(Path("single/x")))
    told = [{name: value for name, value in report.items() if name not in ("files", "sha256")} for report in whole]
    for moment in range(10):
        for run_ids in packing.batches(folder, 2):
            process = get_context("fork").Process(target=packing.pack, args=[packing.Pack(folder / "runs", run_ids)])
            process.start()
            process.join(0.03 * moment)
            process.kill()
            process.join()
        found = sorted(store.read_runs(folder), key=lambda report: report["run_id"])
        assert [{name: value for name, value in report.items() if name in told[0]} for report in found] == told
        assert not any(any(store.faults(entry)) for entry in store.entries(folder))
    for run_ids in packing.batches(folder, 2):
        packing.pack(packing.Pack(folder / "runs", run_ids))
    packing.tidy(folder)
    store.clear(folder)
    assert len(single(folder)) < 2 and len(store.done(folder)) == 4 and not list(folder.rglob(".*"))


def test_two_sweeps_that_pack_at_once(copied, monkeypatch):
    """What one has packed the other finds gone, and leaves at that."""
    folder = Path("single/x")
    first, second = packing.batches(folder, 2)
    told = [packing.pack(packing.Pack(folder / "runs", run_ids)) for run_ids in (first, first + second, second)]
    assert told == ["packed", "left", "packed"]
    assert packs(folder) == [("pack-1", 2), ("pack-2", 2)] and single(folder) == []


def test_workers_pack(tmp_path, carom_process, fall):
    """Eight runs by two workers; they have no recordings."""
    (tmp_path / "x.yaml").write_text(fall + "matrix: {balls.mass: [1, 2, 3, 4, 5, 6, 7, 8]}\n")
    code, _, err = carom_process("sweep", "x.yaml", "--jobs", "2", "-s", "record.pack=3", cwd=tmp_path)
    assert code == 0 and "8 finished" in err
    folder = tmp_path / "outputs/x"
    assert packs(folder) == [("pack-1", 3), ("pack-2", 3)] and len(single(folder)) == 2
    assert {path.name for path in (folder / "runs/pack-1").iterdir()} == PACK - {"recordings.rrd"}
    assert len(store.done(folder)) == 8 and not list(folder.rglob(".*"))


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("record.pack=1", "record.pack: must be >= 2, not 1"),
        ("record.pack=2,3", "record.pack: there is no setting 'record.pack'"),
    ],
)
def test_it_is_one_number_for_all_runs(here, fall, carom, text, error):
    Path("x.yaml").write_text(fall)
    code, _, err = carom("check", "x.yaml", "-s", text)
    assert code == 2 and error in err
