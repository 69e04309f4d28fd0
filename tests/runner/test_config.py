"""Every mistake in an experiment file: its place, its words, a line each, and nothing written."""

import re
from pathlib import Path

import pytest

from runner import config
from runner.errors import InputError

FILE = "fall.yaml"


@pytest.fixture
def faults(here, carom, fall):
    """The faults, as 'line:column: ...', of FALL with `old` replaced by `new`, or with `new` at its end."""

    def told(old: str | None, new: str | bytes, *options: str) -> list[str]:
        assert old is None or fall.count(old) == 1
        text = new if isinstance(new, bytes) else (fall + new if old is None else fall.replace(old, new)).encode()
        Path(FILE).write_bytes(text)
        code, out, err = carom("sweep", FILE, *options)
        assert (code, out) == (2, "")
        assert [path.name for path in here.rglob("*")] == [FILE], "nothing is written"
        return [line.removeprefix(f"{FILE}:") for line in err.splitlines()]

    return told


def matches(fault: str, start: str, words: str) -> bool:
    """Whether the fault begins with place and path, and has all the words (separated by |) in it."""
    return fault.startswith(start) and all(word in fault for word in words.split("|"))


SETTINGS = {
    # what: (old, new, place and path, essential words)
    "unknown": (
        "duration: 0.2", "duraton: 0.2\nduration: 1", "9:1: duraton: ", "unknown setting|did you mean 'duration'?",
    ),
    "unknown in a group": ("step: 0.01", "stp: 0.01", "8:34: solver.stp: ", "unknown setting|did you mean 'step'?"),
    "unknown in a shape": (
        "plane}", "plane, norml: [0, 1, 0]}", "4:27: scene.surfaces.floor.norml: ", "did you mean 'normal'?",
    ),
    "shape": ("plane", "plan", "4:5: scene.surfaces.floor: ", "not 'plan'|rectangle|did you mean 'plane'?"),
    "no shape": ("shape: plane", "normal: [0, 1, 0]", "4:5: scene.surfaces.floor: ", "needs 'shape'"),
    "method": (
        "explicit_euler", "explicit_eulr", "8:10: solver.method: ",
        "not 'explicit_eulr'|did you mean 'explicit_euler'?",
    ),
    "massless": ("mass: 1", "mass: 0", "6:3: balls.mass: ", "must be > 0, not 0"),
    "heavier than the wall": ("mass: 1", "mass: 201", "6:3: balls.mass: ", "must be <= scene.wall_mass = 200"),
    "damping": ("scene:", "scene:\n  damping: 2", "3:3: scene.damping: ", "must be <= 1, not 2"),
    "negative step": ("step: 0.01", "step: -0.01", "8:34: solver.step: ", "must be > 0, not -0.01"),
    "text for a number": ("step: 0.01", "step: fast", "8:34: solver.step: ", "must be a number, not 'fast'"),
    "quoted number": ("mass: 1", "mass: '1'", "6:3: balls.mass: ", "must be a number, not '1'"),
    "yes for a number": ("mass: 1", "mass: true", "6:3: balls.mass: ", "must be a number, not True"),
    "list for a number": ("duration: 0.2", "duration: [0.2]", "9:1: duration: ", "must be a number, not [0.2]"),
    "number for a list": (
        "position: [0, 1, 0]", "position: 1", "7:15: balls.released.0.position: ", "must be a list, not 1",
    ),
    "number for a group": ("solver: {", "solver: 3\n#", "8:1: solver: ", "must be a group of settings, not 3"),
    "fraction for a count": (None, "repeats: 1.5\n", "11:1: repeats: ", "must be a whole number, not 1.5"),
    "too few numbers": ("[0, 1, 0]", "[0, 1]", "7:15: balls.released.0.position.2: ", "is missing"),
    "no solver": ("solver: {", "#", "1:1: solver: ", "is missing"),
    "two sources": (
        "  mass: 1", "  scatter: {count: 1, box: [[0, 0, 0], [1, 1, 1]]}", "5:1: balls: ",
        "exactly one|released and scatter",
    ),
    "no source": ("  released: ", "  #", "5:1: balls: ", "exactly one of emitter, released, scatter|none"),
    "zero normal": ("plane}", "plane, normal: [0, 0, 0]}", "4:27: scene.surfaces.floor.normal: ", "zero vector"),
    "zero direction": (
        "scene:", "scene:\n  forces: {wind: {type: uniform, direction: [0, 0, 0], magnitude: 1}}",
        "3:34: scene.forces.wind.direction: ", "zero vector",
    ),
    "height is not run": (
        "{shape: plane}", "{shape: heightfield, size: [1, 1], cells: [1, 1], height: \"__import__('os')\"}",
        "4:62: scene.surfaces.floor.height: ", "unknown function '__import__'",
    ),
    "no mesh file": (
        "shape: plane", "shape: mesh, file: a/b.obj", "4:26: scene.surfaces.floor.file: ", "there is no file a/b.obj",
    ),
    "format": ("[hdf5]", "[hdf5, rrdd]", "10:26: record.formats.1: ", "must be one of|did you mean 'rrd'?"),
    "format twice": ("[hdf5]", "[hdf5, hdf5]", "10:10: record.formats: ", "twice"),
    "not a number": ("step: 0.01", "step: .nan", "8:34: solver.step: ", "must be a finite number"),
    "infinite": ("step: 0.01", "step: .inf", "8:34: solver.step: ", "must be a finite number"),
    "too large a number": ("duration: 0.2", "duration: 1e999", "9:1: duration: ", "must be a finite number"),
    "too large a whole number": ("duration: 0.2", f"duration: {10**400}", "9:1: duration: ", "must be a finite number"),
    "contact": (
        "contact: original", "contact: orignal", "8:46: solver.contact: ", "swept, original|did you mean 'original'?",
    ),
    "exact by the original's contact rule": (
        "explicit_euler", "exact", "8:37: solver.contact: ", "the method exact knows swept contact only",
    ),
    "adaptive by the original's contact rule": (
        "explicit_euler", "dopri5", "8:38: solver.contact: ", "the method dopri5 knows swept contact only",
    ),
    "reference": (None, "reference: exat\n", "11:1: reference: ", "must be one of exact|did you mean 'exact'?"),
    "name of a surface": ("floor:", "../floor:", "4:5: scene.surfaces.../floor: ", "not a name"),
}  # fmt: skip

PARTS = {
    "varies nothing": ("matrix:\n  balls.mass: []\n", "12:3: matrix.balls.mass: ", "empty list"),
    "varies what is not there": (
        "matrix:\n  bals.mass: [1]\n", "12:3: matrix.bals.mass: ", "no setting|did you mean 'balls.mass'?",
    ),
    "varies an absent force": (
        "matrix:\n  scene.forces.wind.magnitude: [1]\n", "12:3: matrix.scene.forces.wind.magnitude: ", "no setting",
    ),
    "varies the name": ("matrix: {name: [a, b]}\n", "11:10: matrix.name: ", "no setting 'name'"),
    "varies by one value": ("matrix:\n  balls.mass: 2\n", "12:3: matrix.balls.mass: ", "must be a list"),
    "varies twice": (
        "matrix:\n  balls.mass: [1, 2]\n  zip: [{balls.mass: [3, 4]}]\n", "13:10: matrix.zip.0.balls.mass: ", "already",
    ),
    "matrix is a list": ("matrix: [balls.mass]\n", "11:1: matrix: ", "must be a group of settings"),
    "a value": ("matrix:\n  balls.mass: [1, 2, -1]\n", "12:22: balls.mass: ", "must be > 0, not -1"),
    "a value among vectors": (
        "matrix:\n  scene.gravity: [[0, 0, 0], [0, 1]]\n", "12:30: scene.gravity.2: ", "is missing",
    ),
    "zip of unequal lengths": (
        "matrix:\n  zip: [{solver.step: [0.01, 0.02], balls.mass: [1]}]\n",
        "12:9: matrix.zip.0: ", "solver.step has 2, balls.mass has 1",
    ),
    "zip without a list": ("matrix: {zip: {balls.mass: [1]}}\n", "11:10: matrix.zip: ", "must be a list of groups"),
    "a value in zip": ("matrix: {zip: [{balls.mass: [1, 0]}]}\n", "11:33: balls.mass: ", "must be > 0"),
    "a value in include": ("matrix: {include: [{balls.mass: 0}]}\n", "11:21: balls.mass: ", "must be > 0"),
    "excludes what is not there": (
        "matrix: {exclude: [{balls.mas: 1}]}\n", "11:21: matrix.exclude.0.balls.mas: ", "did you mean 'balls.mass'?",
    ),
    "excludes all": ("matrix: {balls.mass: [1], exclude: [{balls.mass: 1}]}\n", "11:27: matrix.exclude: ", "every run"),
    "expects an unknown column": (
        "expect: [{column: bouces, max: 1}]\n", "11:11: expect.0.column: ", "no run has|did you mean 'bounces'?",
    ),
    "expects where": (
        "expect: [{column: bounces, max: 1, where: {balls.mas: 1}}]\n",
        "11:44: expect.0.where.balls.mas: ", "did you mean 'balls.mass'?",
    ),
    "expects nothing": ("expect: [{column: bounces}]\n", "11:10: expect.0: ", "needs max, min or equals"),
    "chart of no kind": ("charts: [{x: balls.mass}]\n", "11:10: charts.0.kind: ", "missing"),
    "chart of an unknown kind": ("charts: [{kind: lnes}]\n", "11:11: charts.0.kind: ", "did you mean 'lines'?"),
    "chart's option": (
        "charts: [{kind: energy, serie: balls.mass}]\n", "11:25: charts.0.serie: ", "did you mean 'series'?",
    ),
    "chart's column": (
        "charts: [{kind: lines, x: balls.mas, y: bounces}]\n", "11:24: charts.0.x: ", "did you mean 'balls.mass'?",
    ),
    "charts are not a list": ("charts: {kind: energy}\n", "11:1: charts: ", "must be a list"),
    "duplicate": ("duration: 3\n", "11:1: ", 'duplicate key "duration"'),
    "duplicate group": ("solver: {method: explicit_euler}\n", "11:1: ", 'duplicate key "solver"'),
    "tag": ("charts: !!python/object/apply:os.system [ls]\n", "11:9: ", "tag !!python/object/apply:os.system"),
    "tag on a mapping": ("matrix: !x {balls.mass: [1]}\n", "11:9: ", "tag !x"),
    "tag on a number": ("repeats: !!int 3\n", "11:10: ", "tag !!int"),
    "date": ("expect: [{column: status, equals: 2020-01-01}]\n", "11:27: expect.0.equals: ", "a date has no meaning"),
    "key that is a number": ("3: 4\n", "11:1: 3: ", "a key must be a text"),
    "unclosed": ("charts: [\n", "12:1: ", "expected"),
    "tab": ("\tduration: 1\n", "11:1: ", "cannot start any token"),
    "two documents": ("---\nduration: 1\n", "11:1: ", "another document"),
    "deep": (f"charts: {'[' * 60}{']' * 60}\n", "11:59: ", "nested too deeply"),
    "very deep": (f"charts: {'[' * 200_000}\n", "11:59: ", "nested too deeply"),
    "itself": ("charts: &a [*a]\n", "11:13: ", "stands in itself"),
    "merged into itself": ("matrix: &a {<<: *a}\n", "11:17: ", "stands in itself"),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "start", "words"), SETTINGS.values(), ids=SETTINGS)
def test_a_wrong_setting_is_told_at_its_place(faults, old, new, start, words):
    (fault,) = faults(old, new)
    assert matches(fault, start, words), fault


@pytest.mark.parametrize(("new", "start", "words"), PARTS.values(), ids=PARTS)
def test_a_wrong_part_is_told_at_its_place(faults, new, start, words):
    (fault,) = faults(None, new)
    assert matches(fault, start, words), fault


def test_mistakes_in_what_is_no_more_than_merged_are_told(faults):
    told = faults("floor: {shape: plane}", "floor: &a {shape: plane, norml: 1}\n    other: {<<: *a}")
    assert len(told) == 2 and matches(told[0], "4:30: scene.surfaces.floor.norml: ", "did you mean 'normal'?")
    assert matches(told[1], "5:5: scene.surfaces.other.norml: ", "did you mean 'normal'?")


def test_settings_vary_in_what_is_no_group(faults):
    old = "solver: {method: explicit_euler, step: 0.01, contact: original}"
    for wrong in ("3", "[1]", "[{method: rk4}]"):
        told = faults(old, f"solver: {wrong}\nmatrix: {{solver.method: [rk4], solver.step: [0.1]}}")
        assert matches(told[0], "8:1: solver: ", "must be a group of settings")


@pytest.mark.parametrize("name", ["../x", "a/b", "..", ".", "/etc", ".hidden", "a b", "", "x" * 101, "x\\n", "x\\0"])
def test_a_name_cannot_lead_elsewhere(faults, name):
    (fault,) = faults(None, f'name: "{name}"\n')
    assert fault.startswith("11:1: name: ")


def test_a_file_name_cannot_lead_elsewhere(here, fall):
    Path("...yaml").write_text(fall)  # its stem is `..`
    assert config.load("...yaml").name == "experiment"


@pytest.mark.parametrize(
    ("content", "words"),
    {
        "empty": (b"", "mapping"),
        "only a comment": (b"# nothing\n", "mapping"),
        "list": (b"- duration: 3\n", "mapping"),
        "text": (b"hello\n", "mapping"),
        "binary": (bytes(range(256)), "UTF-8"),
        "zeros": (b"\0\0\0", "unacceptable character"),
        "other encoding": ("scène: 1".encode("latin-1"), "UTF-8"),
    }.values(),
)
def test_what_is_not_an_experiment_at_all(faults, content, words):
    (fault,) = faults(None, content)
    assert words in fault


def test_no_file_and_no_folder(here, carom, fall):
    Path("falling.yaml").write_text(fall)
    assert carom("sweep", "faling.yaml") == (2, "", "faling.yaml: no such file (did you mean 'falling.yaml'?)\n")
    assert carom("sweep", "there/fall.yaml") == (2, "", "there/fall.yaml: no such file\n")
    code, _, err = carom("check", ".")
    assert code == 2 and err.count("\n") == 1 and "directory" in err


def test_aliases_cannot_blow_up(faults):
    """Ten lines that would be 10**10 values; they are counted, not written out."""
    bomb = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
    bomb += "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 10))
    (fault,) = faults(None, bomb)
    assert matches(fault, "15:", "more than 20,000 values with its aliases"), fault


def test_aliases_and_merges_are_plain_values(here, fall):
    Path(FILE).write_text(
        fall.replace("{shape: plane}", "&floor {shape: plane}\n    other: {<<: *floor, point: [0, -1, 0]}")
    )
    surfaces = config.load(FILE).base.parameters["scene"]["surfaces"]
    assert surfaces["other"] == surfaces["floor"] | {"point": [0, -1, 0]}


def test_centre_and_center_are_one_setting(here, faults, fall):
    def box(spelling, at):
        return f"box, {spelling}: [0, {at}, 0], size: [1, 1, 1]}}"

    def loaded(spelling, matrix=""):
        Path(FILE).write_text(fall.replace("plane}", box(spelling, 3)) + matrix)
        return config.load(FILE)

    assert loaded("centre").base.run_id == loaded("center").base.run_id
    ways = [(a, b) for a in ("centre", "center") for b in ("centre", "center")]
    ids = [
        [r.run_id for r in loaded(a, f"matrix: {{scene.surfaces.floor.{b}: [[0, 4, 0]]}}\n").runs()] for a, b in ways
    ]
    assert ids == [[config.load(FILE, {f"scene.surfaces.floor.{ways[0][0]}": [0, 4, 0]}).base.run_id]] * 4

    (fault,) = faults("plane}", box("centre: [0, 3, 0], center", 3))
    assert matches(fault, "4:44: scene.surfaces.floor.center: ", "given twice")


def test_all_faults_are_told_at_once_from_top_to_bottom(faults):
    told = faults(
        "scene:",
        """\
duraton: 3
expect: [{column: bouces, max: 1}, {column: bounces}]
matrix:
  bals.mass: [1]
  balls.radius: []
  solver.step: [0.01, -1]
  include: [{solver.method: exat}]
charts:
  - {kind: lnes}
  - {kind: lines, x: balls.mas, y: bouncs}
scene:
  damping: 2
  gravity: [0, down, 0]""",
    )
    places = "2:1 3:11 3:36 5:3 6:3 7:23 8:14 10:6 11:19 11:33 13:3 14:16"
    assert [re.match(r"\d+:\d+", fault).group() for fault in told] == places.split()


def test_all_faults_of_the_matrix_are_told_at_once(faults):
    told = faults(
        None, "matrix:\n  balls.mass: [1, 0, -1]\n  solver.method: [exat, explicit_euler]\n  solver.step: [0.1, 0]\n"
    )
    assert [fault.split(": ")[:2] for fault in told] == [
        ["12:19", "balls.mass"],
        ["12:22", "balls.mass"],
        ["13:19", "solver.method"],
        ["14:22", "solver.step"],
    ]


def test_a_matrix_may_mend_what_no_single_value_can(here, fall):
    """Values are judged as they come together, not each over the file's own: 300 kg needs the wall of 400."""
    matrix = "matrix: {zip: [{balls.mass: [1, 300], scene.wall_mass: [200, 400]}]}\n"
    Path(FILE).write_text(fall + matrix)
    assert len(config.load(FILE).runs()) == 2


def test_too_many_runs_are_counted_not_made(here, carom, fall):
    axis = ", ".join(f"0.{n:03}" for n in range(1, 101))
    Path(FILE).write_text(fall + f"matrix: {{balls.mass: [{axis}], balls.radius: [{axis}], solver.step: [{axis}]}}\n")
    code, out, err = carom("sweep", FILE, "--dry-run")
    assert (code, out) == (2, "")
    assert err == f"{FILE}: the matrix makes 1,000,000 runs; --yes starts more than 100,000\n"


def test_yes_lets_more_runs_start(here, monkeypatch, carom, fall):
    monkeypatch.setattr("runner.plan.MOST_RUNS", 1)
    Path(FILE).write_text(fall + "matrix: {balls.mass: [1, 2]}\n")
    assert carom("sweep", FILE, "--dry-run").code == 2
    assert carom("sweep", FILE, "--dry-run", "--yes").code == 0


@pytest.mark.parametrize(
    ("option", "start", "words"),
    [
        ("balls.mass", "-s balls.mass: ", "key=value"),
        ("=3", "-s =3: ", "key=value"),
        ("balls.mass=", "-s balls.mass=: ", "no value"),
        ("balls.mass=[1", "-s balls.mass=[1: ", "not a value in YAML"),
        ("balls.mass=1]", "-s balls.mass=1]: ", "not a value in YAML"),
        ("balls.mass=!!int 1", "-s balls.mass=!!int 1: ", "not a value in YAML"),
        ("balls.mass=x", "-s balls.mass: balls.mass: ", "must be a number, not 'x'"),
        ("balls.mass=1,0", "-s balls.mass: balls.mass: ", "must be > 0, not 0"),
        ("balls.mass=.nan", "-s balls.mass: balls.mass: ", "finite"),
        ("balls.mass=.inf,1", "-s balls.mass: matrix.balls.mass.0: ", "finite"),
        ("bals.mass=1", "-s bals.mass: bals: ", "unknown setting|did you mean 'balls'?"),
        ("bals.mass=1,2", "-s bals.mass: matrix.bals.mass: ", "no setting|did you mean 'balls.mass'?"),
        ("balls.mass.x=1", "-s balls.mass.x: balls.mass: ", "is not a group of settings"),
        ("balls.radius.x=1", "-s balls.radius.x: balls.radius: ", "must be a number"),
        ("balls.released.7.velocity=[0,0,0]", "-s balls.released.7.velocity: balls.released.7: ", "is not a group"),
        ("balls.released.x=1", "-s balls.released.x: balls.released.x: ", "no such item"),
        ("name=../x", "-s name: name: ", "not a name"),
        ("solver.contact=soft", "-s solver.contact: solver.contact: ", "must be one of swept, original"),
    ],
)
def test_a_wrong_option_is_told_as_the_option_it_is(faults, option, start, words):
    (fault,) = faults("# How", "# What", "-s", option)
    assert matches(fault, start, words), fault


def test_zipped_settings_have_no_value_of_their_own(faults):
    (fault,) = faults(None, "matrix: {zip: [{solver.step: [0.01, 0.02], balls.mass: [1, 2]}]}\n", "-s", "balls.mass=3")
    assert matches(fault, "-s balls.mass: matrix.zip: ", "varies together")


@pytest.mark.parametrize("way", ["out is a file", "folder is a file", "runs is a file", "/proc"])
def test_an_output_folder_that_cannot_be_written(here, carom, fall, way):
    Path(FILE).write_text(fall)
    out = Path("/proc/carom" if way == "/proc" else "out")
    obstacle = {"out is a file": out, "folder is a file": out / "fall", "runs is a file": out / "fall" / "runs"}.get(
        way
    )
    if obstacle:
        obstacle.parent.mkdir(parents=True, exist_ok=True)
        obstacle.write_text("mine")
    code, out_, err = carom("sweep", FILE, "--out", out, "--quiet")
    assert (code, out_) == (2, "")
    assert err.startswith(f"{out}/fall: cannot be written: ") and err.count("\n") == 1
    assert obstacle is None or obstacle.read_text() == "mine"


def test_debug_shows_where_a_fault_was_raised(here, carom):
    with pytest.raises(InputError):
        carom("--debug", "check", "none.yaml")
