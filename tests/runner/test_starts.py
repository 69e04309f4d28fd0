"""Balls that start inside a surface are told before anything is run, and nothing is written."""

from pathlib import Path

import pytest

from runner import execute, load, plan, run, starts, sweep
from runner.errors import InputError
from sim import reduction
from sim.inside import starts_inside
from sim.model import Invalid

FILE = "x.yaml"
#: A room of 2 m with a plate in it; the balls stand in line 6.
ROOM = """\
# Who starts inside?
scene:
  surfaces:
    room: {shape: box, center: [0, 0, 0], size: [2, 2, 2], inside: true}
    plate: {shape: rectangle, center: [0, 0.5, 0], normal: [0, 1, 0], size: [1, 1]}
balls: {radius: 0.1, released: [{position: [0, 0, 0]}]}
solver: {method: rk4_original, step: 0.01}
duration: 0.05
record: {every: 0.05, formats: [hdf5]}
"""
FREE, SUNK = "[0, 0, 0]", "[0, 0.43, 0]"  # 7 cm below the plate

COMMANDS = {"sweep": ["sweep"], "dry run": ["sweep", "--dry-run"], "check": ["check"]}


def written(text: str) -> Path:
    Path(FILE).write_text(text)
    return Path(FILE)


def released(*positions: str) -> str:
    return ROOM.replace("[{position: [0, 0, 0]}]", "[" + ", ".join(f"{{position: {each}}}" for each in positions) + "]")


def source(text: str) -> str:
    return ROOM.replace("released: [{position: [0, 0, 0]}]", text)


def told(text: str) -> list[str]:
    """What a plan refuses, without the file's name."""
    with pytest.raises(InputError) as error:
        plan.plan(load(written(text)), Path("outputs"))
    return [line.removeprefix(f"{FILE}:") for line in str(error.value).splitlines()]


PLATE = "starts 0.03 m inside the surface 'plate'"
CASES = {
    "released": (released(FREE, SUNK), f"6:57: balls.released.1.position: ball 1 {PLATE}"),
    "the deepest of several": (released(SUNK, "[0, 0.45, 0]"), "6:60: balls.released.1.position: ball 1 starts 0.05 m"),
    "the first of two alike": (released(FREE, SUNK, SUNK), f"6:57: balls.released.1.position: ball 1 {PLATE}"),
    "behind a wall": (released("[3, 0, 0]"), "6:34: balls.released.0.position: ball 0 starts 2.1 m inside the surface 'room'"),
    "emitter": (
        source(f"emitter: {{position: {SUNK}, direction: [0, 1, 0], rate: 1e3, spread: 20}}"),
        f"6:32: balls.emitter.position: ball 0 {PLATE}",
    ),
    "scatter": (
        source("scatter: {count: 100, box: [[0, 0, 0], [0, 0.43, 0]]}"),
        "6:44: balls.scatter.box: ball ",
    ),
    "in the matrix": (
        ROOM + f"matrix:\n  balls.released.0.position: [{FREE}, {SUNK}]\n",
        f"11:42: balls.released.0.position: ball 0 {PLATE}",
    ),
    "the radius in the matrix": (
        released("[0, 0.3, 0]") + "matrix: {balls.radius: [0.1, 0.23]}\n", f"6:34: balls.released.0.position: ball 0 {PLATE}"
    ),
    "the surface in the matrix": (
        ROOM + "matrix: {scene.surfaces.plate.center: [[0, 0.5, 0], [0, 0.07, 0]]}\n",
        f"6:34: balls.released.0.position: ball 0 {PLATE}",
    ),
    "the balls as a whole in the matrix": (
        ROOM + f"matrix:\n  balls.released: [[{{position: {SUNK}}}]]\n", f"11:22: balls.released.0.position: ball 0 {PLATE}"
    ),
}  # fmt: skip


@pytest.mark.parametrize(("text", "start"), CASES.values(), ids=CASES)
def test_it_is_told_at_the_place_of_the_start(here, text, start):
    (fault,) = told(text)
    assert fault.startswith(start), fault


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_every_command_refuses_and_writes_nothing(here, carom, command):
    written(released(SUNK))
    told = f"{FILE}:6:34: balls.released.0.position: ball 0 {PLATE}\n"
    assert carom(*command, FILE) == (2, "", told)
    assert [path.name for path in here.rglob("*")] == [FILE]


def test_an_option_is_told_as_the_option_it_is(here, carom):
    written(ROOM)
    code, out, err = carom("sweep", FILE, "-s", f"balls.released.0.position={SUNK}")
    assert (code, out) == (2, "") and err.startswith("-s balls.released.0.position: balls.released.0.position: ball 0 ")


def test_the_python_interface_refuses_too(here):
    written(released(SUNK))
    for act in (sweep, lambda path: run(load(path))):
        with pytest.raises(InputError, match=f"^{FILE}:6:34: balls.released.0.position: ball 0 {PLATE}$"):
            act(FILE)
    with pytest.raises(Invalid, match=PLATE):
        run(load(FILE).runs()[0])
    assert [path.name for path in here.rglob("*")] == [FILE]


def test_each_distinct_start_is_looked_at_and_told_once(here, monkeypatch):
    """Not again for each mass and step."""
    looked = []
    monkeypatch.setattr(starts, "starts_inside", lambda *args: looked.append(args) or starts_inside(*args))
    text = released(SUNK) + "matrix: {balls.mass: [1, 2], solver.step: [0.1, 0.01], balls.radius: [0.1, 0.11, 0.01]}\n"
    assert [fault.split("starts ")[1][:4] for fault in told(text)] == ["0.03", "0.04"]
    assert len(looked) == 3


def test_only_what_is_to_do_is_looked_at(here, carom, inline, monkeypatch):
    written(ROOM)
    assert carom("sweep", FILE).code == 0
    with monkeypatch.context() as patch:
        patch.setattr(starts, "starts_inside", lambda *_: pytest.fail("looked again at what is done"))
        assert carom("sweep", FILE).code == 0
    written(ROOM + f"matrix: {{balls.released.0.position: [{FREE}, {SUNK}]}}\n")
    assert carom("sweep", FILE).code == 2


def test_the_originals_rule_lets_balls_start_anywhere(here):
    text = released(SUNK).replace("step: 0.01", "step: 0.01, contact: original")
    assert execute.run(load(written(text))).status == "finished"
    assert plan.plan(load(FILE), Path("outputs")).todo
    # but what it is held against does not
    assert len(told(text + "reference: exact\n")) == 1


@pytest.mark.parametrize("height", ["0.4", "0.40000000001", "-0.9", "-0.90000000001", "0.6"])
def test_a_ball_that_touches_is_not_inside(here, height):
    written(released(f"[0, {height}, 0]"))
    assert plan.plan(load(FILE), Path("outputs")).todo
    assert run(load(FILE)).status in ("finished", "rested")


def test_the_geometry_is_built_once_for_each_set_of_surfaces(here, monkeypatch):
    built = []

    def counted(shapes, *args, **options):
        built.append(shapes)
        return features(shapes, *args, **options)

    features = reduction.features
    monkeypatch.setattr(reduction, "features", counted)
    matrix = "matrix: {balls.radius: [0.1, 0.2], scene.surfaces.plate.center: [[0, 0.5, 0], [0, 0.7, 0]], duration: [1, 2]}\n"
    assert len(plan.plan(load(written(ROOM + matrix)), Path("outputs")).todo) == 8
    assert len(built) == 2


def test_without_surfaces_nobody_is_inside(here):
    text = ROOM.replace("  surfaces:\n", "").replace("scene:", "scene: {}")
    lines = [line for line in text.splitlines() if not line.startswith("    ")]
    assert plan.plan(load(written("\n".join(lines))), Path("outputs")).todo
