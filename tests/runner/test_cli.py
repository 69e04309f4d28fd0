"""The command line: what it imports, what its commands say."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = {"numpy", "numba", "rerun", "matplotlib", "pydantic", "pyarrow", "h5py", "trimesh", "ruamel"}


def imported(*arguments, cwd) -> set[str]:
    """The packages that are imported when the command is through."""
    code = (
        "import json, sys\n"
        "from runner import cli\n"
        "try: cli.main()\n"
        "except SystemExit as end: assert not end.code, end.code\n"
        "print(json.dumps(sorted({name.partition('.')[0] for name in sys.modules})))"
    )
    done = subprocess.run([sys.executable, "-c", code, *arguments], cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_help_imports_nothing_heavy(tmp_path):
    assert imported("--help", cwd=tmp_path) & HEAVY == set()


def test_help_of_a_command_imports_nothing_heavy(tmp_path):
    assert imported("sweep", "--help", cwd=tmp_path) & HEAVY <= {"pydantic"}  # typer's own, in some versions


def test_a_dry_run_imports_what_reads_the_file_and_no_more(tmp_path, fall):
    """With swept contact it looks, too, whether balls start inside a surface."""
    charts = "charts: [{kind: energy, series: solver.method}]\n"
    fall = fall.replace(", contact: original", "")
    (tmp_path / "x.yaml").write_text(fall + "matrix: {balls.mass: [1, 2]}\nreference: exact\n" + charts)
    assert imported("sweep", "x.yaml", "--dry-run", cwd=tmp_path) & HEAVY == {"numpy", "pydantic", "ruamel"}


def test_looking_at_a_sweep_compiles_and_draws_nothing(here, carom, inline, fall):
    Path("x.yaml").write_text(fall)
    assert carom("sweep", "x.yaml").code == 0
    for command in (
        ["status", "outputs/x"],
        ["summary", "outputs/x"],
        ["sweep", "x.yaml", "--check"],
        ["explain", "x.yaml"],
    ):
        assert imported(*command, cwd=here) & {"numba", "rerun", "matplotlib", "h5py", "trimesh"} == set(), command


def test_check_counts_the_runs(here, carom, fall):
    Path("x.yaml").write_text(fall + "matrix: {balls.mass: [1, 2, 3], exclude: [{balls.mass: 2}]}\n")
    assert carom("check", "x.yaml") == (0, "x.yaml: ok, 2 runs\n", "")
    assert carom("check", "x.yaml", "-s", "solver.step=0.1,0.2") == (0, "x.yaml: ok, 4 runs\n", "")
    assert [path.name for path in here.iterdir()] == ["x.yaml"]


def test_the_schema_is_json_that_knows_the_settings(carom):
    code, out, _ = carom("schema")
    schema = json.loads(out)
    assert code == 0 and {"scene", "balls", "solver", "matrix", "expect", "charts"} <= set(schema["properties"])
    assert "explicit_euler" in out and "heightfield" in out and schema["additionalProperties"] is False


def test_methods_are_listed_with_what_they_claim(carom):
    from sim import integrators

    code, out, _ = carom("methods")
    assert code == 0 and all(name in out for name in integrators.names())
    (exact,) = (line.split(maxsplit=7) for line in out.splitlines() if line.split()[:2] == ["exact", "exact"])
    assert exact[1:7] == ["exact", *"-----"] and exact[7].startswith("The exact solver: the true flight in closed form")


@pytest.mark.parametrize(
    "arguments", [["nosuch"], ["sweep"], ["sweep", "x.yaml", "--jobs", "0"], ["sweep", "x.yaml", "--fast"]]
)
def test_wrong_usage_exits_with_2(here, carom, arguments):
    code, out, err = carom(*arguments)
    assert code == 2 and out == "" and "Traceback" not in err


def test_a_disk_error_is_a_line(here, carom, inline, fall, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device", "outputs/x/summary.csv")

    Path("x.yaml").write_text(fall)
    monkeypatch.setattr("runner.aggregate.summarise", full)
    code, _, err = carom("sweep", "x.yaml", "--quiet")
    assert code == 1 and err == "[Errno 28] No space left on device: 'outputs/x/summary.csv'\n"
