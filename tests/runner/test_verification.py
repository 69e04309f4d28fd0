"""Damage to an output: noticed, told in a line, and made again without touching anything else."""

import os
import pickle
import random
from pathlib import Path

import h5py
import pytest

from runner import seal, store
from runner.errors import Damaged

FILES = {"single": ["trajectory.h5", "recording.rrd", "run.json"],
         "packed": ["trajectories.h5", "recordings.rrd", "runs.jsonl", "pack.json"]}  # fmt: skip


def flip(path: Path, place: int | None = None) -> None:
    """Change a bit, somewhere in the middle unless told where."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2 if place is None else place] ^= 1
    path.write_bytes(data)


def cut(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


def entry(layout: str) -> Path:
    """The second folder in the output."""
    return store.entries(Path(layout, "x"))[1]


def trajectories(layout: str) -> dict[str, bytes | dict]:
    """What each run's trajectory is: its bytes, or what it holds where it is packed."""
    found = {}
    for run_id, place in store.places(Path(layout, "x")).items():
        if store.pack_number(place):
            with h5py.File(place / "trajectories.h5") as file:
                found[run_id] = {}
                file[run_id].visititems(
                    lambda name, item: found[run_id].update({name: item[()].tobytes()}) if hasattr(item, "shape") and item.shape
                    else None
                )  # fmt: skip
        else:
            found[run_id] = (place / "trajectory.h5").read_bytes()
    return found


def stamps(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_ino for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("layout", FILES)
def test_what_is_whole_is_told_so(copied, carom, layout):
    before = stamps(Path(layout))
    assert carom("status", f"{layout}/x", "--verify") == (0, "every file is as it was made\ndone 4, failed 0, todo 0\n", "")
    assert stamps(Path(layout)) == before


@pytest.mark.parametrize("harm", [flip, cut, Path.unlink])
@pytest.mark.parametrize(("layout", "name"), [(layout, name) for layout in FILES for name in FILES[layout]])
def test_damage_is_told_in_a_line(copied, carom, layout, name, harm):
    path = entry(layout) / name
    harm(path)
    code, out, err = carom("status", f"{layout}/x", "--verify")
    first, last = out.splitlines()
    assert (code, last, err) == (1, f"1 files are damaged; `carom status {layout}/x --repair` makes their runs again", "")
    words = {flip: ("changed, ", "cut or changed"), cut: ("bytes instead of", "cut or changed"), Path.unlink: ("missing",)}[harm]
    assert first.startswith(f"{path}: ") and any(word in first for word in words)
    assert ("of 2 runs" in first) == (layout == "packed" and name != "pack.json")


@pytest.mark.parametrize(
    ("layout", "name", "harm"),
    [
        ("single", "trajectory.h5", flip), ("single", "recording.rrd", cut), ("single", "run.json", Path.unlink),
        ("packed", "trajectories.h5", flip), ("packed", "recordings.rrd", Path.unlink), ("packed", "pack.json", flip),
    ],
)  # fmt: skip
def test_what_is_damaged_is_made_again_and_nothing_else(copied, carom, layout, name, harm):
    before, made, path = stamps(Path(layout, "x/runs")), trajectories(layout), entry(layout) / name
    harm(path)
    code, out, err = carom("status", f"{layout}/x", "--repair")
    assert code == 0 and out.splitlines()[1:] == ["every file is as it was made", "done 4, failed 0, todo 0"]
    assert f"{2 if layout == 'packed' else 1} finished" in err
    after = stamps(Path(layout, "x/runs"))
    assert {file for file in before if after.get(file) != before[file]} == {file for file in before if path.parent in file.parents}
    assert trajectories(layout) == made and not list(Path(layout).rglob(".*"))
    assert [len(store.members(each)) for each in store.entries(Path(layout, "x")) if store.pack_number(each)] == (
        [2, 2] if layout == "packed" else []
    )


def test_any_changed_bit_of_a_report_is_noticed(outputs):
    path = next((outputs / "single/x/runs").glob("*/run.json"))
    text, dice = path.read_bytes(), random.Random(1)
    for place in range(len(text)):
        changed = bytearray(text)
        changed[place] ^= 1 << dice.randrange(8)
        if seal.MARK in changed:  # without it a report is like those of older versions, which --verify tells
            with pytest.raises(ValueError, match="changed"):
                seal.unseal(bytes(changed))
    for length in range(len(text)):
        with pytest.raises(ValueError, match="changed"):
            seal.unseal(text[:length])


def test_a_report_without_its_checksum_is_told(copied, carom):
    path = entry("single") / "run.json"
    path.write_bytes(path.read_bytes().replace(b'"sha256": "', b'"sha25v": "'))
    code, out, _ = carom("status", "single/x", "--verify")
    assert code == 1 and out.startswith(f"{path}: has no checksums, as older versions made it\n")
    assert carom("summary", "single/x").code == 0


def test_what_a_worker_finds_damaged_is_told_by_the_parent():
    error = Damaged(Path("outputs/x/runs/a/run.json"), "missing")
    told = pickle.loads(pickle.dumps(error))
    assert str(told) == "outputs/x/runs/a/run.json: missing; `carom status outputs/x --repair` makes it again"


@pytest.mark.parametrize("layout", FILES)
@pytest.mark.parametrize("command", ["status", "summary", "chart", "compare", "sweep", "view"])
def test_every_command_that_meets_a_damaged_report_says_so(copied, carom, layout, command):
    reports = "pack.json" if command == "view" else "runs.jsonl"  # a viewer needs no reports
    path = entry(layout) / {"single": "run.json", "packed": reports}[layout]
    cut(path)
    options = {"compare": ["packed/x"], "sweep": ["-s", "balls.mass=1,2,3,4", "--quiet", "--out", layout]}.get(command, [])
    if command == "chart":
        with open(f"{layout}/x/experiment.yaml", "a") as file:
            file.write("charts: [{kind: energy}]\n")
    code, _, err = carom(command, "x.yaml" if command == "sweep" else f"{layout}/x", *options)
    assert code == 1 and err.startswith(f"{path}: ") and err.count("\n") == 1
    assert err.endswith(f"; `carom status {layout}/x --repair` makes it again\n")


@pytest.mark.parametrize(("layout", "name"), [("single", "trajectory.h5"), ("packed", "trajectories.h5")])
def test_a_chart_that_cannot_read_a_trajectory_says_so(copied, carom, layout, name):
    cut(entry(layout) / name)
    with open(f"{layout}/x/experiment.yaml", "a") as file:
        file.write("charts: [{kind: energy}]\n")
    code, _, err = carom("chart", f"{layout}/x")
    assert code == 1 and err.startswith(f"{entry(layout) / name}: cannot be read: ") and err.count("\n") == 1
    assert "--repair` makes it again" in err


@pytest.mark.parametrize(("layout", "name"), [("single", "recording.rrd"), ("packed", "recordings.rrd")])
def test_a_damaged_recording_is_not_opened(copied, carom, layout, name):
    flip(entry(layout) / name)
    code, _, err = carom("view", f"{layout}/x")
    assert code == 1 and err.startswith(f"{entry(layout) / name}: changed, ") and err.count("\n") == 1


@pytest.mark.parametrize("harm", [lambda path: flip(path, path.read_bytes().index(b"explicit")), cut])
def test_a_damaged_summary_is_told_and_written_again(copied, carom, harm):
    path = Path("single/x/summary.parquet")
    table = carom("summary", "single/x", "--csv").out
    harm(path)
    code, _, err = carom("summary", "single/x")
    assert (code, err) == (1, f"{path}: cut or changed; `carom status single/x --repair` makes it again\n")
    assert carom("status", "single/x", "--repair").code == 0
    assert carom("summary", "single/x", "--csv").out == table


def test_runs_of_other_settings_are_made_again_from_their_own_report(copied, carom):
    """The experiment has only two of the four masses now; a run that tells its mass no more is lost."""
    experiment = Path("single/x/experiment.yaml")
    experiment.write_text(experiment.read_text().replace("[1, 2, 3, 4]", "[1, 2]"))
    third, fourth = (next(Path("single/x/runs").glob(f"*-m{mass}-*")) for mass in (3, 4))
    made = trajectories("single")
    flip(third / "trajectory.h5")
    cut(fourth / "run.json")
    code, out, _ = carom("status", "single/x", "--repair")
    assert code == 1 and f"{fourth.name}: cannot be made again: " in out and "1 files are damaged" in out
    assert trajectories("single") == made
