"""What a matrix means, against a plain reference; and the ids of runs."""

import itertools
import json
from pathlib import Path
from random import Random

import pytest

from runner import config, document, execute
from runner.errors import InputError
from runner.record import hdf5
from runner.settings import leaves, value_at, with_value

METHODS = ["explicit_euler", "rk4_original"]


@pytest.fixture
def runs(here, fall):
    """`runs(matrix, key, ..., options=[...])`: the values of the keys in each run of FALL with a matrix and -s."""

    def expanded(matrix: str, *keys: str, options=()) -> list:
        Path("fall.yaml").write_text(fall + matrix)
        loaded = document.Document(Path("fall.yaml"))
        for option in options:
            key, _, text = option.partition("=")
            config.vary(loaded, key, document.read_values(text, option))
        return [values(run, *keys) for run in config.check(loaded).runs()]

    return expanded


def values(run, *keys):
    found = tuple(value_at(run.parameters, document.split(key)) for key in keys)
    return found if len(found) > 1 else found[0]


def test_without_a_matrix_there_is_one_run(runs):
    assert runs("", "balls.mass") == [1]
    assert runs("matrix: {}\n", "balls.mass") == [1]


def test_every_combination_the_last_key_fastest(runs):
    matrix = f"matrix:\n  solver.method: {METHODS}\n  balls.mass: [3, 1, 2]\n  scene.damping: [0, 0.5]\n"
    expected = [(method, mass, damping) for method in METHODS for mass in (3, 1, 2) for damping in (0, 0.5)]
    assert runs(matrix, "solver.method", "balls.mass", "scene.damping") == expected


def test_zipped_settings_vary_together(runs):
    first, second = "{solver.step: [0.1, 0.2], record.every: [0.01, 0.02]}", "{balls.radius: [1, 2]}"
    matrix = f"matrix:\n  zip: [{first}, {second}]\n  balls.mass: [1, 2]\n"
    together = list(zip([0.1, 0.2], [0.01, 0.02]))
    expected = [(mass, *pair, radius) for mass, pair, radius in itertools.product([1, 2], together, [1, 2])]
    assert runs(matrix, "balls.mass", "solver.step", "record.every", "balls.radius") == expected


def test_exclude_drops_what_matches_in_part(runs):
    axes = "matrix:\n  balls.mass: [1, 2]\n  scene.damping: [0, 0.5]\n  solver.step: [0.1, 0.01]\n"
    combinations = list(itertools.product([1, 2], [0, 0.5], [0.1, 0.01]))
    for exclude, dropped in (
        ("{balls.mass: 2}", lambda mass, damping, step: mass == 2),
        ("{balls.mass: 2, scene.damping: 0.5}", lambda mass, damping, step: mass == 2 and damping == 0.5),
        ("{balls.mass: 2}, {solver.step: 0.1}", lambda mass, damping, step: mass == 2 or step == 0.1),
        (
            "{balls.mass: 2.0, solver.method: explicit_euler}",
            lambda mass, damping, step: mass == 2,
        ),  # the file's own value
        ("{balls.mass: 2, solver.method: rk4_original}", lambda mass, damping, step: False),
        ("{balls.mass: 7}", lambda mass, damping, step: False),
    ):
        kept = [each for each in combinations if not dropped(*each)]
        assert runs(f"{axes}  exclude: [{exclude}]\n", "balls.mass", "scene.damping", "solver.step") == kept, exclude


def test_exclude_looks_at_vectors_as_a_whole(runs):
    matrix = "matrix: {scene.gravity: [[0, -1, 0], [0, -2, 0]], exclude: [{scene.gravity: [0, -2, 0]}]}\n"
    assert runs(matrix, "scene.gravity") == [[0, -1, 0]]


def test_many_patterns_drop_what_a_plain_comparison_does(runs):
    axes = {"balls.mass": [1, 2, 3], "scene.damping": [0, 0.5, 1], "scene.gravity": [[0, -1, 0], [0, -2, 0]]}
    axes |= {"scene.restitution": [None, 1]}
    fixed = {"repeats": 1, "balls.radius": 0.06}
    choices, random = axes | {key: [value, 7] for key, value in fixed.items()}, Random(1)
    patterns = [{key: random.choice(choices[key]) for key in random.sample([*choices], random.choice([2, 3]))} for _ in range(12)]
    combinations = [dict(zip(axes, each)) for each in itertools.product(*axes.values())]
    kept = [each for each in combinations if not any((fixed | each | pattern) == (fixed | each) for pattern in patterns)]
    assert 5 < len(kept) < len(combinations) - 5
    told = runs(f"matrix: {json.dumps(axes | {'exclude': patterns})}\n", *axes)
    assert told == [tuple(each.values()) for each in kept]


def test_include_comes_after_exclude_over_the_files_own_values(runs):
    matrix = (
        "matrix:\n  balls.mass: [2, 3]\n  solver.step: [0.1]\n  exclude: [{balls.mass: 3}]\n"
        "  include: [{balls.mass: 3}, {scene.damping: 0.5}]\n"
    )
    expected = [(2, 0.1, 0.05), (3, 0.01, 0.05), (1, 0.01, 0.5)]
    assert runs(matrix, "balls.mass", "solver.step", "scene.damping") == expected


def test_include_alone_makes_just_these_runs(runs):
    assert runs("matrix: {include: [{balls.mass: 3}, {balls.mass: 4}]}\n", "balls.mass") == [3, 4]


@pytest.mark.parametrize(
    ("key", "given", "found"),
    [
        ("scene.gravity", "[[0, 0, 0], [1, 2, 3]]", [[0, 0, 0], [1, 2, 3]]),
        ("balls.released.0.velocity", "[[1, 0, 0], [2, 0, 0]]", [[1, 0, 0], [2, 0, 0]]),
        ("balls.released.0.position.1", "[2, 3]", [2, 3]),
        ("scene.restitution", "[null, 0.5]", [None, 0.5]),
        ("scene.surfaces.floor.point", "[[0, 0, 0], [0, 1, 0]]", [[0, 0, 0], [0, 1, 0]]),
        ("scene.surfaces", "[{}]", [{}]),
        ("record.formats", "[[hdf5], [rrd], []]", [["hdf5"], ["rrd"], []]),
        ("repeats", "[1, 2e0]", [1, 2]),
    ],
)
def test_any_leaf_may_vary(runs, key, given, found):
    assert runs(f"matrix: {{{key}: {given}}}\n", key) == found


def test_a_whole_group_may_vary(runs):
    matrix = "matrix: {scene.surfaces.floor: [{shape: plane}, {shape: box, center: [0, -1, 0], size: [1, 1, 1]}]}\n"
    assert runs(matrix, "scene.surfaces.floor.shape") == ["plane", "box"]


def test_equal_combinations_become_one_run(runs):
    assert runs(
        "matrix: {balls.mass: [1, 1.0, 2, 1e0], include: [{balls.mass: 2}, {}]}\n".replace(", {}", ""), "balls.mass"
    ) == [1, 2]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["balls.mass=7"], [(7, 0.1), (7, 0.2)]),  # a key of the matrix takes the one value
        (["balls.mass=7,8"], [(7, 0.1), (7, 0.2), (8, 0.1), (8, 0.2)]),
        (["solver.step=0.5"], [(1, 0.5), (2, 0.5)]),
        (["balls.mass=7", "balls.mass=8"], [(8, 0.1), (8, 0.2)]),  # the last one counts
        (["balls.mass=7,8", "balls.mass=9"], [(9, 0.1), (9, 0.2)]),
        (["balls.radius=0.5"], [(1, 0.1), (1, 0.2), (2, 0.1), (2, 0.2)]),
        (["balls.radius=0.5,0.6"], [(m, s) for m in (1, 2) for s in (0.1, 0.2) for _ in range(2)]),
    ],
)
def test_options_replace_settings_and_vary_them(runs, options, expected):
    matrix = "matrix:\n  balls.mass: [1, 2]\n  solver.step: [0.1, 0.2]\n"
    assert runs(matrix, "balls.mass", "solver.step", options=options) == expected


def test_an_option_reaches_what_the_file_leaves_out(runs):
    assert runs(
        "",
        "scene.forces.wind.magnitude",
        options=["scene.forces={wind: {type: uniform, direction: [1, 0, 0], magnitude: 3}}"],
    ) == [3]
    assert runs("", "balls.released.0.velocity", options=["balls.released.0.velocity=[1, 2, 3]"]) == [[1, 2, 3]]
    assert runs("", "scene.gravity", options=["scene.gravity=[0, 0, 0],[0, 1, 0]"]) == [[0, 0, 0], [0, 1, 0]]


def test_load_takes_overrides_as_the_command_line_does(here, fall):
    Path("fall.yaml").write_text(fall + "matrix: {balls.mass: [2, 3]}\n")
    experiment = config.load("fall.yaml", {"balls.mass": 5, "scene.gravity": [0, 0, 0]})
    assert [values(run, "balls.mass", "scene.gravity") for run in (*experiment.runs(), experiment.base)] == [
        (5, [0, 0, 0])
    ] * 2


# Ids

#: Every kind of thing that a run can be made of. The id is written out because it must never change by accident:
#: outputs of earlier versions are found by it. It does change, on purpose, with sim.ANSWERS.
EVERYTHING = """\
scene:
  gravity: [0, -9.8, 0.5]
  surfaces:
    floor: {shape: rectangle, center: [0, 0, 0], normal: [0, 1, 0], size: [2, 3], up: [0, 0, 1]}
    ground: {shape: plane, point: [0, -1, 0]}
    room: {shape: box, center: [0, 1, 0], size: [2, 2, 2], inside: true}
    hills: {shape: heightfield, size: [1, 1], cells: [2, 3], height: "0.1*x"}
  restitution: 0.5
  forces:
    wind: {type: uniform, direction: [0, 0, 1], magnitude: 20, region: {x: [-0.5, 0.5], y: [-1, 4]}, until: 0.5}
    air: {type: drag, coefficient: 0.1}
    well: {type: spring, stiffness: 3, center: [0, 1, 0]}
balls:
  emitter: {position: [0, 2, 0], direction: [0, 1, 0], speed: 8, spread: 10, rate: 5, seed: 1, count: 3}
solver: {method: explicit_euler, step: 0.01, tolerance: 1.0e-8, contact: original}
duration: 2
record: {every: 0.1, formats: [hdf5]}
repeats: 2
"""
PINNED = "explicit_euler-m1-d0.05-d9f8ae463729"


def load(text, folder=Path(), name="x.yaml", **overrides):
    (folder / name).write_text(text)
    return config.load(folder / name, {key.replace("__", "."): value for key, value in overrides.items()})


def test_an_id_that_is_pinned(here):
    assert load(EVERYTHING).base.run_id == PINNED


def test_ids_are_the_same_in_every_process(here, carom_process):
    Path("x.yaml").write_text(EVERYTHING + "matrix: {balls.mass: [1, 2], solver.step: [0.1, 0.01]}\n")
    told = [carom_process("sweep", "x.yaml", "--dry-run", cwd=here, PYTHONHASHSEED=seed).out for seed in ("1", "2")]
    assert told[0] == told[1]
    assert told[0].splitlines()[1:] == [run.run_id for run in config.load("x.yaml").runs()]


def reversed_keys(data):
    if isinstance(data, dict):
        return {key: reversed_keys(data[key]) for key in reversed(data)}
    return [reversed_keys(each) for each in data] if isinstance(data, list) else data


def test_what_cannot_change_a_result_does_not_change_the_id(here, tmp_path):
    base = load(EVERYTHING)
    data = base.document.data
    others = {
        "order of keys": json.dumps(reversed_keys(data)),
        "spelling of numbers": EVERYTHING.replace("[0, 1, 0]", "[0.0, 1e0, -0.0]").replace("0.01", "1.0e-2"),
        "defaults written out": EVERYTHING + "reference: null\n",
        "name, expectations, charts, matrix": EVERYTHING
        + "name: other\nexpect: [{column: bounces, min: 1}]\ncharts: [{kind: energy}]\nmatrix: {balls.mass: [1, 2]}\n",
    }
    for what, text in others.items():
        assert load(text).base.run_id == base.base.run_id, what
    (tmp_path / "elsewhere").mkdir()
    assert load(EVERYTHING, tmp_path / "elsewhere").base.run_id == base.base.run_id


OTHER = {  # of the texts and switches; numbers are changed by rule
    "method": "rk4_original", "height": "0.2*x", "inside": False, "formats": ["rrd"], "cells": [3, 3], "up": [0, 1, 1],
    "seed": 2, "contact": "swept", "reference": "exact",
    "region": {"y": [-0.5, 0.5]}, "x": [-0.5, 0.6], "count": 2, "repeats": 3, "until": 0.25,
}  # fmt: skip
FIXED = {"shape", "type", "released", "scatter"}  # have no other value that fits


def test_every_leaf_changes_the_id(here):
    run = load(EVERYTHING).base
    ids, seen = {run.run_id: "nothing"}, set()
    for name, value in leaves(run.parameters):
        path = document.split(name)
        if path[-1] in FIXED:
            continue
        if path[-1] in OTHER:
            other = OTHER[path[-1]]
        elif isinstance(value, list):
            other = [each * 1.25 + 0.125 for each in value]
        else:
            other = value * 0.75
        changed = config.resolve(with_value(run.parameters, path, other), run.folder).run_id
        assert changed not in ids, f"{name} and {ids.get(changed)}"
        ids[changed] = name
        seen.add(path[-1])
    assert {
        "gravity",
        "size",
        "point",
        "magnitude",
        "until",
        "stiffness",
        "coefficient",
        "mass",
        "tolerance",
        "every",
    } <= seen
    assert len(ids) > 40


def test_the_order_in_the_file_does_not_change_a_byte(here):
    """Not of surfaces, which bounces count, nor of forces, whose sum rounds otherwise in another order."""
    again = json.dumps(reversed_keys(load(EVERYTHING).document.data))
    for number, text in enumerate((EVERYTHING, again)):
        hdf5.write(execute.run(load(text)), Path(f"{number}.h5"))
    assert Path("0.h5").read_bytes() == Path("1.h5").read_bytes()


def test_the_readable_part_tells_method_mass_and_damping(here):
    run = load(EVERYTHING, balls__mass=0.1, scene__damping=1e-3, solver__method="rk4_original").base
    assert run.run_id.startswith("rk4_original-m0.1-d0.001-") and len(run.run_id.rsplit("-")[-1]) == 12


MISTAKES = """\
matrix:
  balls.mass: [1, 150, -1, 300]
  zip: [{scene.wall_mass: [200, 100, -2], scene.damping: [0, 0.6, 2]}, {balls.radius: [1, x], solver.step: [0.1, 0]}]
  duration: [1, 1e300]
  include: [{balls.mass: 250}, {scene.surfaces: {floor: {shape: bal}}}, {solver.step: 1e-300, duration: 2}]
"""


def test_what_is_wrong_with_any_run_is_told_as_each_alone_would(here, fall):
    experiment, alone = load(fall + MISTAKES), set()
    for values in experiment.matrix.combinations(experiment.base.parameters):
        try:
            config._run(experiment.document, values)
        except InputError as error:
            alone.update(error.faults)
    with pytest.raises(InputError) as together:
        experiment.runs()
    assert set(together.value.faults) == alone and len(alone) == len(together.value.faults) == 12


@pytest.mark.parametrize("name", ["smoke", "baffles"])
def test_runs_checked_in_parts_are_those_checked_whole(name):
    experiment = config.load(Path(__file__).parents[2] / "configs" / f"{name}.yaml")
    for run in experiment.runs():
        whole = config.resolve(run.parameters, run.folder)
        assert (run.setup, run.parameters, run.run_id) == (whole.setup, whole.parameters, whole.run_id)
    assert run.parameters["record"] is experiment.base.parameters["record"], "what does not vary is shared"


def test_what_does_not_vary_of_a_part_is_checked_once_and_shared(here, fall):
    runs = load(fall + "matrix: {scene.damping: [0, 0.5], balls.mass: [1, 2], scene.gravity: [[0, -1, 0], [0, -2, 0]]}\n").runs()
    assert len({id(run.setup.scene) for run in runs}) == 4 and len({id(run.setup.balls) for run in runs}) == 2
    for group in ("scene.surfaces", "balls.released"):
        part, name = group.split(".")
        assert len({id(getattr(getattr(run.setup, part), name)) for run in runs}) == 1, group
        assert len({id(run.parameters[part][name]) for run in runs}) == 1, group
    for run in runs:
        whole = config.resolve(run.parameters, run.folder)
        assert (run.setup, run.run_id) == (whole.setup, whole.run_id)
        assert json.dumps(run.parameters) == json.dumps(whole.setup.model_dump(mode="json"))
