"""Hops of many balls side by side: the same flight, bit for bit, as ball by ball."""

import numpy as np
import pytest

from sim import engines, hop, vector
from sim.curves.parabola import fall_straight
from sim.lanes import LANES
from sim.shapes import Box, Plane, Rectangle
from sim.simulate import Scene, Simulation, Solver
from sim.touch import first_fall
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


def test_a_hop_behind_a_face_is_none():
    """Were a touch missed, it would be seen: a floor met from above, and a shelf met from both sides."""
    scene = Scene(surfaces={"floor": Plane(), "shelf": Rectangle((0, 3, 0), (0, 1, 0), (9, 9))})
    simulation = Simulation(scene, balls([[0, 1, 0]], [[0, 0, 0]]), Solver("exact"), 1.0, 0.5)
    lanes = hop.hop_room()
    height = hop.PLACE + LANES
    for i, (begin, end) in enumerate([(1.0, 0.5), (1.0, -0.5), (-1.0, 0.5), (2.0, 4.0), (4.0, 2.0), (3.0, 4.0)]):
        lanes[height + i], lanes[hop.KEPT + height + i], lanes[hop.PLAIN + i] = begin, end, 1.0
    hop.check(lanes, simulation.features.faces)
    assert list(lanes[hop.PLAIN :][:6]) == [1, 0, 1, 0, 0, 0]


def test_short_cuts_give_the_same():
    """A face across an axis, and one that nothing pulls toward, bit for bit: also where a ball is on it or behind it."""
    rng = np.random.default_rng(5)
    met = 0
    for _ in range(3000):
        k, radius = rng.integers(3), rng.uniform(0.01, 0.2)
        normal, place = tuple(rng.choice([-1.0, 1.0]) * np.eye(3)[k]), rng.normal(size=3)
        x, v = rng.normal(size=3), rng.normal(size=3) * rng.choice([0.0, 1.0, 1e-200], 3)
        if rng.integers(2):  # in touch, but for rounding
            x[k] = place[k] + normal[k] * radius * rng.choice([1.0, 1.0 + 1e-15, 0.5, -2.0])
        g = vector.gap(normal, x, place, radius)
        assert vector.gap_along(normal[k], x[k], place[k], radius) == g
        speed = vector.dot(normal, v)
        assert normal[k] * v[k] == speed
        t = first_fall((g, speed, 0.0), radius, np.inf)
        assert fall_straight(g, speed, radius) == t
        met += t < np.inf
    assert met > 500
