"""Hops of many balls side by side: the same flight, bit for bit, as ball by ball."""

import numpy as np
import pytest

from sim import engines, jit
from sim.shapes import Box, Plane, Rectangle
from sim.simulate import Scene, Simulation, Solver
from tests.sim.helpers import CORRIDOR, balls

ROOM = Box((0, 0, 0), (4, 3, 3.5), inside=True)
FLOOR, WALL, ROOF = Plane((0, -1.4, 0), (0.1, 1, 0.05)), Plane((-1.9, 0, 0), (1, 0.2, 0)), Plane((0, 2, 0), (0, -1, 0))
TILTED = {"floor": FLOOR, "wall": WALL, "roof": ROOF}
MANY = 1100  # more than are moved together, and no multiple of the lanes


def flights(monkeypatch, scene, start, duration=2.0, every=0.05):
    """The flight with hops, and without."""
    made = []
    bindings = engines.bindings
    for hops in (True, False):
        monkeypatch.setattr(engines, "bindings", lambda *given: bindings(*given) | {"HOPS": hops})
        made.append(Simulation(scene, start, Solver("exact"), duration, every).run())
    return made


def start(n, speed=5.0, **options):
    rng = np.random.default_rng(3)
    return balls(rng.uniform(-1.2, 1.2, (n, 3)), rng.normal(0, speed, (n, 3)), **options)


@pytest.mark.parametrize(
    "scene, start",
    [
        (Scene(surfaces={"room": ROOM}, restitution=1.0, damping=0.0), start(MANY)),
        (Scene(surfaces={"room": ROOM}), start(MANY, released=0.0173 * (np.arange(MANY) % 40), lifetime=1.31)),
        (Scene(surfaces=TILTED, gravity=(1.0, -9.0, 2.0)), start(70)),
        (Scene(surfaces={"room": ROOM}, restitution=0.3, damping=0.2), start(70, speed=1.0)),  # most come to rest
        (Scene(surfaces={"room": ROOM}, restitution=0.3, damping=0.0), start(70, speed=1.0)),  # or slide
        (Scene(surfaces={"room": ROOM, "shelf": Rectangle((0, -1.45, 0), (0, 1, 0), (1, 1))}), start(70)),
        (Scene(surfaces={"room": ROOM}, forces={"corridor": CORRIDOR}), start(70)),
        (Scene(), start(70)),
    ],
    ids=["elastic", "emitted", "tilted", "resting", "sliding", "edges", "fields", "nothing to touch"],
)
def test_hops_change_nothing(monkeypatch, scene, start):
    check_same(*flights(monkeypatch, scene, start))


def check_same(one, other):
    """That two flights are the same, bit for bit."""
    for name in ("position", "velocity"):
        assert np.array_equal(getattr(one.trajectory, name), getattr(other.trajectory, name), equal_nan=True)
    for name in ("bounces", "rests"):
        assert np.array_equal(getattr(one, name), getattr(other, name))
    for name in ("kinetic", "potential", "work", "lost", "supplied"):
        assert np.array_equal(getattr(one.energy, name), getattr(other.energy, name))
    assert (one.status, one.penetrations) == (other.status, other.penetrations)
    if one.status != "diverged":  # then the others' flights end wherever they are
        assert one.steps == other.steps


def test_a_centre_behind_a_face_is_counted(monkeypatch):
    """Were a touch missed, it would be seen: with balls as large as nothing, and a search that finds nothing."""
    from sim import hop

    scene = Scene(surfaces={"floor": Plane()})
    simulation = Simulation(scene, balls([[0, 1, 0]] * 3, [[0, 0, 0]] * 3), Solver("exact"), 1.0, 0.5)
    faces = simulation.features.faces
    lanes = hop.hop_room()
    for i in range(3):
        lanes[hop.PLACE + 64 + i], lanes[hop.PLACE1 + 64 + i] = 1.0, (0.5, -0.5, 0.0)[i]
    jit.bind(hop.check, compiled=False)(lanes, faces)
    assert list(lanes[hop.THROUGH :][:3]) == [0, 1, 0]
