"""Outputs that somebody has changed on purpose, and sealed anew: every command ends in lines, never in a traceback."""

import json
import os
import shutil
from pathlib import Path

import h5py
import pyarrow
import pyarrow.parquet
import pytest

from runner import seal, store

COMMANDS = (
    ("sweep", "x.yaml", "--quiet"), ("status",), ("status", "--verify"), ("summary",), ("summary", "--by", "status"), ("compare",),
    ("view",), ("chart",), ("status", "--repair"),
)  # fmt: skip


def deep(levels: int):
    return json.loads("[" * levels + "]" * levels)


#: what: (what a run's report tells instead)
REPORTS = {
    "nested": {"parameters": {"balls": deep(190)}},
    "no figures": {"figures": [1]},
    "an id that is a list": {"run_id": ["a"]},
    "an id that leads out": {"run_id": "../../a"},
    "many digits": {"figures": {"bounces": 10**400, "work": 10**400, "other": 10**400}},
    "a figure of another type": {"figures": {"bounces": "many", "method": 3}},
    "a status that is none": {"status": "runs"},
    "a group that is a number": {"parameters": {"balls": 5}},
    "files elsewhere": {"files": {"/dev/zero": {"bytes": 0, "sha256": ""}}},
    "files that are none": {"files": [1]},
    "timings": {"timings": {"wall_seconds": "long", "started": 5}},
}
TEXTS = {"nested too deeply": b"[" * 100_000, "half a character": b'{"run_id": "\\ud800"}', "no number": b'{"figures": {"bounces": NaN}}'}
PROVENANCE = {"machine": [], "versions": 3, "command": "x", "source": ["a"]}


def ends_in_lines(carom, layout):
    for command, *options in COMMANDS:
        target = {"sweep": ["--out", layout], "compare": [f"{layout}/x", "whole/x"]}.get(command, [f"{layout}/x"])
        outcome = carom(command, *options, *target)  # anything but SystemExit fails
        assert outcome.code in (0, 1, 2) and "Traceback" not in outcome.err
        assert all(len(line) < 1000 for line in outcome.err.splitlines())


@pytest.fixture
def harmed(copied, monkeypatch):
    """A copy of the outputs, and one in whole/ that stays; no viewer opens."""

    shutil.copytree("single", "whole")
    monkeypatch.setattr("runner.viewer.viewer_command", lambda *_: ["true"])


def reseal(path: Path, **values) -> None:
    told = {name: value for name, value in json.loads(path.read_text()).items() if name != "sha256"}
    path.write_bytes(seal.seal(told | values))


def first(layout: str) -> Path:
    return store.entries(Path(layout, "x"))[0]


@pytest.mark.parametrize("values", REPORTS.values(), ids=REPORTS)
def test_a_report_sealed_anew(harmed, carom, values):
    reseal(first("single") / "run.json", **values)
    ends_in_lines(carom, "single")


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
@pytest.mark.parametrize("name", [store.RUN, store.PROVENANCE])
def test_json_that_is_none(harmed, carom, name, text):
    (first("single") / name if name == store.RUN else Path("single/x", name)).write_bytes(text)
    ends_in_lines(carom, "single")


@pytest.mark.parametrize("name", PROVENANCE)
def test_provenance_of_other_types(harmed, carom, name):
    Path("single/x", store.PROVENANCE).write_text(json.dumps({name: PROVENANCE[name]}))
    ends_in_lines(carom, "single")


@pytest.mark.parametrize("table", [{"a": [1]}, {"run_id": [3]}], ids=["other columns", "other types"])
def test_a_table_of_others(harmed, carom, table):
    path = Path("single/x/summary.parquet")
    whole = pyarrow.parquet.read_table(path)
    changed = pyarrow.table(table) if "a" in table else whole.set_column(0, "run_id", pyarrow.array(range(len(whole))))
    pyarrow.parquet.write_table(changed, path)
    code, _, err = carom("summary", "single/x")
    assert code == 1 and err.startswith(f"{path}: not a summary")
    ends_in_lines(carom, "single")


@pytest.mark.parametrize("content", [{}, {"particles": 1.0}, {"particles/balls/position/value": b"a"}], ids=["empty", "a number", "text"])
@pytest.mark.parametrize("layout", ["single", "packed"])
def test_a_trajectory_that_is_another_file(harmed, carom, layout, content):
    entry = first(layout)
    name, told = ("trajectories.h5", store.MEMBERS) if layout == "packed" else ("trajectory.h5", store.RUN)
    with h5py.File(entry / name, "w") as file:
        for place, value in content.items():
            file[place] = value
    files = json.loads((entry / told).read_text())["files"]
    reseal(entry / told, files=files | {name: seal.checksum(entry / name)})
    ends_in_lines(carom, layout)


@pytest.mark.parametrize("values", [{"runs": {"../a": []}}, {"runs": [1]}, {"files": {}}, {"runs": {"unheard": ["recording.rrd"]}}])
def test_a_pack_sealed_anew(harmed, carom, values):
    reseal(first("packed") / store.MEMBERS, **values)
    ends_in_lines(carom, "packed")


def test_a_packed_recording_that_is_another(harmed, carom):
    entry = first("packed")
    (entry / "recordings.rrd").write_bytes((first("single") / "recording.rrd").read_bytes()[:50])
    files = json.loads((entry / store.MEMBERS).read_text())["files"]
    reseal(entry / store.MEMBERS, files=files | {"recordings.rrd": seal.checksum(entry / "recordings.rrd")})
    ends_in_lines(carom, "packed")


def test_a_report_that_tells_of_lines_is_told_on_one(harmed, carom):
    report, lines = first("single") / "run.json", "a\nb\x1b[31m"
    told = json.loads(report.read_text())
    settings = told["parameters"] | {"balls": told["parameters"]["balls"] | {"mass": lines}}
    reseal(report, status="failed", error=lines, figures=told["figures"] | {"method": lines}, parameters=settings)
    Path("single/x/summary.parquet").unlink()

    code, _, err = carom("sweep", "x.yaml", "--out", "single", "--quiet", "--check")
    assert (code, err.splitlines()[0]) == (1, f"{told['run_id']}: failed: a\\nb\\x1b[31m") and err.count("\n") == 2
    _, out, _ = carom("status", "single/x")
    assert out.splitlines() == ["done 3, failed 1, todo 0", err.splitlines()[0]]
    _, out, _ = carom("summary", "single/x")
    assert [line for line in out.splitlines() if "failed" in line and "a\\nb\\x1b[31m" in line] and "\nb" not in out
    reseal(report, parameters=told["parameters"])
    _, out, _ = carom("compare", "single/x", "whole/x")
    assert len(out.splitlines()) == 2 and "method a\\nb\\x1b[31m and explicit_euler" in out


@pytest.mark.parametrize("text", [b"\xff\xfe", None], ids=["other bytes", "a pipe"])
def test_an_experiment_that_is_no_text_is_written_again(harmed, carom, text):
    path = Path("single/x", store.EXPERIMENT)
    path.unlink()
    path.write_bytes(text) if text else os.mkfifo(path)
    code, _, err = carom("status", "single/x")
    assert code == 2 and err.count("\n") == 1 and "single/x" in err
    assert carom("sweep", "x.yaml", "--out", "single", "--quiet") == (0, "", "")
    assert path.read_bytes() == Path("whole/x", store.EXPERIMENT).read_bytes()
