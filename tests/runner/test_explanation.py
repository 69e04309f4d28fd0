"""`carom explain`: what is modelled, what was dropped and why."""

from pathlib import Path

import pytest

from runner import load
from runner.explanation import explain

BALL = "balls: {radius: 0.1, lifetime: 3, released: [{position: [0, 0.5, 0], velocity: [1, 0, 0]}]}\n"
REST = "solver: {method: rk4_original, step: 0.01}\nduration: 2\nrecord: {every: 0.1}\n"
OFF = "OFF\n{} {} 0\n{}\n"


def told(scene: str, more: str = "") -> dict[str, str]:
    """The explanation of a scene (in flow style), by what its lines begin with."""
    text = f"# What is it?\nscene: {scene}\n{BALL}{REST}"
    for key, value in (line.split(" -> ") for line in more.splitlines()):
        assert text.count(key) == 1
        text = text.replace(key, value.replace("\\n", "\n"))
    Path("x.yaml").write_text(text)
    lines = [line.split(": ", 1) for line in explain(load("x.yaml"))]
    assert len(dict(lines)) == len(lines)
    return dict(lines)


def off(name: str, vertices: list, triangles: list) -> str:
    rows = [" ".join(map(str, v)) for v in vertices] + ["3 " + " ".join(map(str, t)) for t in triangles]
    Path(name).write_text(OFF.format(len(vertices), len(triangles), "\n".join(rows)))
    return f"{{surfaces: {{it: {{shape: mesh, file: {name}}}}}}}"


CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
TETRAHEDRON = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


@pytest.mark.parametrize(
    "shape, expected",
    [
        ("plane}", "plane, infinite, touched from the side of its normal"),
        (
            "rectangle, center: [0, 0, 0], normal: [0, 1, 0], size: [2, 2]}",
            "rectangle, 2 triangles -> 1 face, 4 edges, 4 corners; open (4 edges of one triangle), balls on both sides; "
            "dropped: 1 edge inside flat faces",
        ),
        (
            "box, center: [0, 5, 0], size: [1, 1, 1]}",
            "box, 12 triangles -> 6 faces, 12 edges, 8 corners; closed, solid behind; dropped: 6 edges inside flat faces",
        ),
        (
            "box, center: [0, 0, 0], size: [2, 2, 2], inside: true}",
            "box, 12 triangles -> 6 faces, 0 edges, 0 corners; closed, solid behind; dropped: 6 edges inside flat faces, "
            "12 edges sticking out only to where no ball can be; part of one convex room with all balls inside: its faces "
            "need no outlines",
        ),
        (
            'heightfield, size: [1, 1], cells: [2, 1], height: "-9*x*x"}',
            "heightfield, 4 triangles -> 2 faces, 7 edges, 6 corners; open (6 edges of one triangle), balls on both sides; "
            "dropped: 2 edges inside flat faces",
        ),
    ],
)
def test_a_surface(here, shape, expected):
    assert told(f"{{surfaces: {{it: {{shape: {shape}}}}}")["surface it"] == expected


@pytest.mark.parametrize(
    "triangles, expected",
    [
        (TETRAHEDRON, "mesh, 4 triangles -> 4 faces, 6 edges, 4 corners; closed, balls outside"),
        (
            TETRAHEDRON[:3],
            "mesh, 3 triangles -> 3 faces, 6 edges, 4 corners; open (3 edges of one triangle), balls on both sides",
        ),
        (
            TETRAHEDRON + [(0, 0, 1), (3, 1, 2), (1, 2, 3)],
            "mesh, 7 triangles -> 4 faces, 6 edges, 4 corners; closed, balls outside; "
            "dropped: 1 triangle without an area, 2 triangles there already",
        ),
        (
            [TETRAHEDRON[0][::-1], *TETRAHEDRON[1:]],
            "mesh, 4 triangles -> 4 faces, 6 edges, 4 corners; open (its triangles do not wind alike), balls on both sides",
        ),
        (
            [(0, 1, 2), (0, 1, 3), (0, 1, 4)],
            "mesh, 3 triangles -> 3 faces, 7 edges, 5 corners; open (6 edges of one triangle and 1 edge of more than two), "
            "balls on both sides",
        ),
        (
            [(0, 1, 2), (5, 6, 7)],
            "mesh, 2 triangles -> 2 faces, 6 edges, 6 corners; open (6 edges of one triangle), balls on both sides; "
            "1 pair of its triangles passes through each other",
        ),
    ],
)
def test_a_mesh_is_taken_as_it_is_and_told(here, triangles, expected):
    vertices = [(x, y - 3, z) for x, y, z in [*CORNERS, (0, -1, -1), (0.2, 0.2, -1), (0.3, 0.2, 1), (0.2, 0.3, 1)]]
    assert told(off("m.off", vertices, triangles))["surface it"] == expected


def test_balls_inside_a_mesh(here):
    around = [(20 * x - 5, 20 * y - 5, 20 * z - 5) for x, y, z in CORNERS]
    line = told(off("m.off", around, TETRAHEDRON))["surface it"]
    assert line == (
        "mesh, 4 triangles -> 4 faces, 0 edges, 0 corners; closed, balls inside; "
        "dropped: 6 edges sticking out only to where no ball can be; "
        "part of one convex room with all balls inside: its faces need no outlines"
    )


def test_too_many_triangles_are_not_held_against_each_other(here, monkeypatch):
    monkeypatch.setattr("sim.crossing.MOST", 3)
    line = told(off("m.off", [(x, y - 3, z) for x, y, z in CORNERS], TETRAHEDRON))["surface it"]
    assert line.endswith("; whether its triangles pass through each other is not looked for, being more than 3")


def test_contact(here):
    plate = "{shape: rectangle, center: [0, 0, 0], normal: [0, 1, 0], size: [2, 2]}"
    hills = '{shape: heightfield, size: [1, 1], cells: [8, 8], height: "0.1*sin(9*x)*z"}'
    sphere = "swept, the first touch of a ball's whole sphere with"
    assert told(f"{{surfaces: {{a: {plate}}}}}")["contact"] == f"{sphere} 1 face and 4 edges, looked at one by one"
    assert told(f"{{surfaces: {{a: {hills}}}}}")["contact"] == f"{sphere} 128 faces and 208 edges, found by a tree"
    original = told(f"{{surfaces: {{a: {plate}}}}}", "step: 0.01 -> step: 0.01, contact: original")
    assert original["contact"] == (
        "original, a ray from a ball's centre along its velocity against 1 face, looked at one by one; edges and corners are not "
        "modelled, a ball nearer to a face than its radius passes through it, and none comes to rest"
    )
    assert original["surface a"] == "rectangle, 2 triangles -> 1 face; open (4 edges of one triangle), balls on both sides"
    assert "rest" not in original and original["events"] == "touch of a face, end of a ball's life at 3 s"
    jet = "{type: uniform, direction: [0, 0, 1], magnitude: 3, region: {x: [-1, 1]}, until: 0.5}"
    blown = told(f"{{surfaces: {{a: {plate}}}, forces: {{jet: {jet}}}}}", "step: 0.01 -> step: 0.01, contact: original")
    assert blown["events"] == original["events"]
    free = told("{}")
    assert free["surfaces"] == "none, free space: no contact is looked for" and not {"contact", "rest"} & free.keys()


FIELDS = {
    "straight": "gravity: [0, 0, 0]",
    "a parabola": "gravity: [0, -9.8, 0]",
    "damped": "forces: {air: {type: drag, coefficient: 1}}",
    "oscillating": "forces: {well: {type: spring, stiffness: 1}}",
    "oscillating and damped": "forces: {well: {type: spring, stiffness: 1, until: 1}, air: {type: drag, coefficient: 1}}",
}


@pytest.mark.parametrize("form", FIELDS)
def test_the_form_of_the_flight(here, form):
    fields = 1 if "until" in FIELDS[form] else 0
    line = told(f"{{{FIELDS[form]}}}")["flight between events"]
    assert line == f"{form}; {fields} field{'s' * (fields != 1)} looked at in each evaluation"


def test_events_name_the_fields(here):
    wind = "{type: uniform, direction: [0, 0, 1], magnitude: 3, region: {x: [-1, 1]}, until: 0.5}"
    scene = f"{{surfaces: {{floor: {{shape: plane}}}}, forces: {{wind: {wind}, none: {wind.replace(': 3', ': 0')}}}}}"
    lines = told(scene)
    assert lines["events"] == (
        "touch of a face, crossing a face of the region of wind, end of wind at an age of 0.5 s, end of a ball's life at 3 s"
    )
    assert lines["force wind"] == "uniform, acts -1 < x < 1 m and age < 0.5 s"
    assert lines["force none"] == "of no strength, dropped"
    block = "{shape: box, center: [0, -1, 0], size: [1, 1, 1]}"
    assert told(f"{{surfaces: {{it: {block}}}}}")["events"] == (
        "touch of a face, of an edge or a corner, end of a ball's life at 3 s"
    )


@pytest.mark.parametrize(
    "scene, expected",
    [
        ("restitution: 1", "never, since impacts keep all of the normal speed"),
        ("gravity: [0, 0, 0]", "never, since nothing presses a ball onto a surface"),
        (
            "restitution: 0.5",
            "once the bounces, each with 0.5 of the normal speed, have become negligible; the ball then stays where it is",
        ),
        (
            "wall_mass: 3, damping: 0",
            "once the bounces, each with 0.5 of the normal speed, have become negligible; the ball then slides on without "
            "friction, as impacts are not damped",
        ),
    ],
)
def test_rest(here, scene, expected):
    assert told(f"{{surfaces: {{floor: {{shape: plane}}}}, {scene}}}")["rest"] == expected


def test_the_solver_and_the_runs(here):
    lines = told("{}")
    assert lines["solver"] == (
        "rk4_original of order 2, step 0.01 s, events on its own interpolant of the same order; 2 s in 21 recorded frames"
    )
    assert lines["balls"] == "1, released from 0 to 0 s, each living 3 s" and lines["x"] == "1 runs"
    original = told("{}", "step: 0.01 -> step: 0.01, contact: original")
    assert original["solver"] == "rk4_original of order 2, step 0.01 s; 2 s in 21 recorded frames"
    assert told("{}", "rk4_original -> dopri5")["solver"].startswith("dopri5 of order 5, steps to the tolerance 1e-09, events on")
    lines = told("{}", "rk4_original -> exact\nduration: 2 -> reference: exact\\nmatrix: {balls.mass: [1, 2]}\\nduration: 2")
    assert lines["solver"] == "exact, in closed form from event to event, without a step; 2 s in 21 recorded frames"
    assert lines["reference"].startswith("solved exactly besides") and lines["x"] == "2 runs, varying balls.mass"


def test_what_would_be_refused_is_told(here):
    assert told("{surfaces: {floor: {shape: plane, point: [0, 0.43, 0]}}}")["refused"] == (
        "x.yaml:3:47: balls.released.0.position: ball 0 starts 0.03 m inside the surface 'floor'"
    )
