"""Hops of many balls side by side: the same flight, bit for bit, as ball by ball."""

import collections

import numpy as np
import pytest

from sim import engines, hop, hop_lanes, look, reduction, state, vector
from sim.lanes import LANES
from sim.log import Record
from sim.motion import motion
from sim.packed import ALONG, FACE_WIDTH, NORMAL, POINT, START, pack
from sim.rest import no_contacts
from sim.shapes import Box, Heightfield, Plane, Rectangle
from sim.simulate import Scene, Simulation, Solver
from sim.touch import NONE, first_fall
from tests.sim.helpers import CORRIDOR, ELASTIC, balls
from tests.sim.test_swept import any_scene, free_balls

ROOM = Box((0, 0, 0), (4, 3, 3.5), inside=True)
FLOOR, WALL, ROOF = Plane((0, -1.4, 0), (0.1, 1, 0.05)), Plane((-1.9, 0, 0), (1, 0.2, 0)), Plane((0, 2, 0), (0, -1, 0))
TILTED = {"floor": FLOOR, "wall": WALL, "roof": ROOF}
HILLS = Heightfield((4, 4), (8, 8), "0.3*sin(3*x)*cos(2*z)")
ABOVE = np.random.default_rng(4).uniform((-1.5, 0.5, -1.5), (1.5, 1.0, 1.5), (70, 3))
TABLE = {"table": Rectangle((0, 0.5, 0), (0, 1, 0), (1, 1)), "floor": Plane(), "wall": Plane((1.5, 0, 0), (-1, 0, 0))}
ON_TABLE = (0, 0.56, 0)
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
        (Scene(surfaces={"room": ROOM}, gravity=(0.7, 9.0, 0.0)), start(70)),
        (Scene(surfaces=TILTED, gravity=(1.0, -9.0, 2.0)), start(70)),
        (Scene(surfaces={"room": ROOM}, restitution=0.3, damping=0.2), start(70, speed=1.0)),  # most come to rest
        (Scene(surfaces={"room": ROOM}, restitution=0.3, damping=0.0), start(70, speed=1.0)),  # or slide
        (Scene(surfaces={"room": ROOM, "shelf": Rectangle((0, -1.45, 0), (0, 1, 0), (1, 1))}), start(70)),
        (Scene(surfaces={"room": ROOM}, forces={"corridor": CORRIDOR}), start(70)),
        (Scene(), start(70)),
        (Scene(surfaces={"hills": HILLS}, restitution=0.5, damping=0.0), balls(ABOVE, [0, 0, 0])),
        (Scene(surfaces=TABLE, restitution=0.7, damping=0.0), balls(ON_TABLE, np.linspace((1, 0, 0), (5, 0, 0.3), 70))),
        (Scene(surfaces={"hills": HILLS}, gravity=(3.0, -9.0, 1.0), **ELASTIC), balls(ABOVE, [0, 0, 0], released=0.01 * np.arange(70))),
    ],
    ids=["elastic", "emitted", "pulled two ways", "tilted", "resting", "sliding", "edges", "fields", "nothing to touch"]
    + ["in a tree", "off an edge", "pulled three ways in a tree"],
)
def test_hops_change_nothing(monkeypatch, scene, start):
    check_same(*flights(monkeypatch, scene, start))


@pytest.mark.parametrize("seed", range(0, 20, 2))  # whose winds blow everywhere
def test_hops_change_nothing_anywhere(monkeypatch, seed):
    scene = any_scene(seed)
    check_same(*flights(monkeypatch, scene, free_balls(scene, seed, 20)))


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
    """Were a touch missed, it would be seen: a floor met from above, a roof from below, and a shelf from both sides."""
    roof, shelf = Plane((0, 5, 0), (0, -1, 0)), Rectangle((0, 3, 0), (0, 1, 0), (9, 9))
    scene = Scene(surfaces={"floor": Plane(), "roof": roof, "shelf": shelf})
    simulation = Simulation(scene, balls([[0, 1, 0]], [[0, 0, 0]]), Solver("exact"), 1.0, 0.5)
    faces = simulation.features.faces
    room = hop_lanes.hop_room(faces)
    lanes = room.lanes
    height = hop_lanes.PLACE + LANES
    for i, (begin, end) in enumerate([(1.0, 0.5), (1.0, -0.5), (-1.0, 0.5), (2.0, 4.0), (4.0, 2.0), (3.0, 4.0), (4.0, 6.0)]):
        lanes[height + i], lanes[hop_lanes.KEPT + height + i], lanes[hop_lanes.PLAIN + i] = begin, end, 1.0
    hop.check(room, faces)
    assert list(lanes[hop_lanes.PLAIN :][:7]) == [1, 0, 1, 0, 0, 0, 0]


@pytest.mark.parametrize("column, value", [(state.COUNT, 1.0), (state.LEFT, 0.0), (state.FLOWN, 0.0)])
def test_a_ball_on_a_surface_or_just_off_it_does_not_hop(column, value):
    room = hop_lanes.hop_room(np.zeros((0, FACE_WIDTH)))
    record = Record(np.linspace(0.0, 1.0, 3), *[np.zeros(0)] * 4)
    states = state.depart_states(balls([[0, 1, 0]] * 2, [[0, 0, 0]]), 1.0, np.inf)
    states[0, column] = value
    assert hop.board(states, 0, room.lanes, 0, record) == 2
    assert room.lanes[hop_lanes.BALL] == 1.0


def test_what_a_search_finds(monkeypatch):
    """Touches of faces and edges. Not those of an edge that a ball runs along, nor one on whose way it passes through a face: these
    are for `fly` to tell."""
    shelf = Scene(surfaces={"shelf": Rectangle((0, 0, 0), (0, 1, 0), (2, 2))}, gravity=(0, 0, 0))
    features = Simulation(shelf, balls([0, 1, 0], [0, 0, 0]), Solver("exact"), 1.0, 1.0).features
    e = next(k for k, edge in enumerate(features.edges) if abs(edge[START] - 1) < 1e-15 and abs(edge[ALONG + 2]) == 1)  # at x = 1
    edge, r = len(features.faces) + e, 0.25
    beside, across, grazing = (2, 0, 0), (-1, 0, 0), (-1e-13, 0, 1)
    cases = [  # place, velocity; touched, after what time; faces passed through; whether it is a hop
        ((0, 1, 0), (0, -1, 0), 0, 0.75, 0, True),
        ((0, 1, 0), (0, -1, 0), 0, 0.75, 1, False),
        (beside, across, edge, 0.75, 0, True),
        ((1 + r, 0, 0), grazing, edge, 0.0, 0, False),
        ((0, 1, 0), (0, 1, 0), NONE, np.inf, 0, True),
        ((0, 1, 0), (0, 1, 0), NONE, np.inf, 1, False),
    ]
    room = hop_lanes.hop_room(features.faces[:0])
    rows = room.lanes.reshape(-1, LANES)
    rows[hop_lanes.BALL // LANES], rows[hop_lanes.ENDS // LANES] = NONE, 2.0
    for i, (x, v, *_) in enumerate(cases):
        rows[:3, i], rows[3:6, i], rows[hop_lanes.BALL // LANES, i] = x, v, i
    told, passed = iter([(item, t, 0, 1) for _, _, item, t, _, _ in cases]), iter([passed for *_, passed, _ in cases])
    monkeypatch.setattr(look, "finish_search", lambda *_: next(told))
    monkeypatch.setattr(look, "count_passed", lambda *given: next(passed))
    look.seek(room, features, room.spare, r, (0.0, 0.0, 0.0))
    for i, (_, _, item, t, _, is_hop) in enumerate(cases):
        expected = (2.0, hop_lanes.NOTHING) if item == NONE else (t, item)
        assert ((rows[hop_lanes.LEAST // LANES, i], rows[hop_lanes.HIT // LANES, i]) == expected) == is_hop
        if not is_hop:
            assert rows[hop_lanes.LEAST // LANES, i] > 2.0 and rows[hop_lanes.HIT // LANES, i] != hop_lanes.NOTHING  # so later than it flies
    assert rows[hop_lanes.NORMALS // LANES :][:3, 2] == pytest.approx([1, 0, 0], abs=1e-15)


def test_a_bounce_lost_in_rounding_is_no_hop():
    """A ball that skims a face may come off it by less than its velocity is rounded by: whether it rests is not for hops to say."""
    rng = np.random.default_rng(7)
    room = hop_lanes.hop_room(np.zeros((0, FACE_WIDTH)))
    rows = room.lanes.reshape(-1, LANES)
    normals = rng.normal(size=(LANES, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    speeds = [vector.across(n, rng.normal(size=3)) for n in normals]
    rows[3:6], rows[hop_lanes.NORMALS // LANES :][:3], rows[hop_lanes.ENDS // LANES] = np.transpose(speeds), normals.T, 1.0
    simulation = Simulation(Scene(restitution=1.0, damping=0.0), start(1), Solver("exact"), 1.0, 0.5)
    _, _, body, forces, _ = simulation.engine.given
    still = (0.0, 0.0, 0.0)
    hop.reckon(room.lanes, body, motion(0.0, still, still, forces, no_contacts()))
    comes = np.array([vector.dot(v, n) < 0.0 for v, n in zip(speeds, normals)])
    goes = np.array([vector.dot(v, n) > 0.0 for v, n in zip(rows[hop_lanes.KEPT // LANES + 3 :][:3].T, normals)])
    assert list(rows[hop_lanes.PLAIN // LANES]) == list(comes & goes)
    assert np.any(comes & goes) and np.any(comes & ~goes)


def test_a_look_at_slabs_is_one_at_every_face():
    """Pulled along them either way, even beyond measure, or not at all, with one wall or both, these even back to back: also where a
    ball is on one or behind, or comes to several at once."""
    rng = np.random.default_rng(5)
    met = collections.Counter()
    for _ in range(300):
        radius, pull = rng.uniform(0.01, 0.2), rng.normal(size=3) * rng.choice([-1e210, -1.0, 0.0, 1.0, 1e210], 3)
        count, axes = rng.integers(1, 7), rng.integers(1, 4)
        normals = rng.choice([-1.0, 1.0], (count, 1)) * np.eye(3)[rng.integers(0, axes, count)]
        planes = [Plane(tuple(rng.normal(size=3).round()), tuple(normal)) for normal in normals]
        faces = pack(reduction.features(planes, np.zeros((0, 3)))[0]).faces
        normal, place = faces[:, NORMAL : NORMAL + 3], faces[:, POINT : POINT + 3]
        x, v = rng.normal(size=(3, LANES)).round(rng.integers(0, 9)), rng.choice([-1.0, 0.0, 1.0, 1e-200, 0.3], (3, LANES))
        for i in np.flatnonzero(rng.integers(0, 2, LANES)):  # in touch, but for rounding
            f = rng.integers(len(faces))
            k = np.abs(normal[f]).argmax()
            x[k, i] = place[f, k] + normal[f, k] * radius * rng.choice([1.0, 1.0 + 1e-15, 0.5, -2.0])
        room = hop_lanes.hop_room(faces)
        rows = room.lanes.reshape(-1, LANES)
        rows[:3], rows[3:6], rows[hop_lanes.ENDS // LANES] = x, v, 10.0
        with np.errstate(over="ignore"):
            look.look(room, faces, radius, tuple(pull))
        for i in range(LANES):
            gaps = [vector.gap(n, x[:, i], p, radius) for n, p in zip(normal, place)]
            lines = [(gap, vector.dot(n, v[:, i]), vector.dot(n, pull)) for gap, n in zip(gaps, normal)]
            times = [first_fall(line, radius, np.inf) for line in lines]
            f = int(np.argmin(times))
            if times[f] >= 10.0:
                assert rows[hop_lanes.HIT // LANES, i] == hop_lanes.NOTHING
                continue
            assert (rows[hop_lanes.HIT // LANES, i], rows[hop_lanes.LEAST // LANES, i]) == (f, times[f])
            assert tuple(rows[hop_lanes.NORMALS // LANES :][:3, i]) == tuple(normal[f])
            met[np.sign(lines[f][2])] += 1
            met["at once"] += 0.0 < times[f] == np.delete(times, f).min(initial=np.inf)
    assert min(met[kind] for kind in (-1, 0, 1, "at once")) > 200
