"""Swept contact for every method: nothing gets through, and nothing but the scene decides what happens."""

import numpy as np
import pytest
import trimesh

from sim import engines, reduction
from sim.forces import Drag, Spring, Uniform
from sim.model import Invalid
from sim.packed import pack
from sim.shapes import Box, Heightfield, Plane, Rectangle, Triangles
from sim.simulate import METHODS, Scene, Simulation, Solver
from tests.sim.helpers import ELASTIC, FREE, balls, last, moved, rotation, soup, swept

R = 0.05


def ico(subdivisions):
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Triangles(np.array(sphere.vertices), np.array(sphere.faces))


def cube(size):
    return Box(center=(0, 0, 0), size=(size,) * 3)


def l_shaped():
    """A room of the cells [0, 2] x [0, 1] and [0, 1] x [1, 2], 1 m high; its walls stick in at x = z = 1."""
    outline = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], float)
    n = len(outline)
    low, high = (np.insert(outline, 1, y, axis=1) for y in (0.0, 1.0))
    walls = [(k, (k + 1) % n, n + (k + 1) % n) for k in range(n)] + [(k, n + (k + 1) % n, n + k) for k in range(n)]
    floor = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    return Triangles(np.concatenate([low, high]), np.array(walls + floor + [tuple(n + i for i in t) for t in floor]))


def in_cube(x, size):
    """How far (m) points are inside a cube about the origin."""
    return (size / 2 - np.abs(x)).min(axis=1)


def in_convex(shape, x):
    vertices, corners = shape.mesh()
    a, b, c = (vertices[corners[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    offset = (normal * a).sum(axis=1)
    return np.concatenate([(offset - part @ normal.T).min(axis=1) for part in np.array_split(x, 1 + len(x) // 500)])


def in_l(x):
    wide = np.minimum(x, (2, 1, 1) - x).min(axis=1)
    long = np.minimum(x, (1, 1, 2) - x).min(axis=1)
    block = np.minimum(x, (2, 1, 2) - x).min(axis=1)
    corner = np.linalg.norm(np.maximum(1 - x[:, ::2], 0), axis=1)  # from the edge that sticks in
    return np.where((x[:, 0] > 1) & (x[:, 2] > 1), -1, np.maximum(np.maximum(wide, long), np.minimum(block, corner)))


THIN = {"walls": moved([cube(2), cube(2.002)])}
BALL20480 = ico(5)
BALL1280 = ico(3)

#: A closed room: its surfaces, where balls start in it, and how far (m) points are from its walls.
ROOMS = {
    "box": ({"room": Box(center=(0, 0, 0), size=(2, 2, 2), inside=True)}, cube(1.8), lambda x: in_cube(x, 2)),
    "turned box": ({"room": moved(cube(2), rotation(1))}, cube(0.9), lambda x: in_cube(x @ rotation(1), 2)),
    "icosphere 1280": ({"room": BALL1280}, cube(1.0), lambda x: in_convex(BALL1280, x)),
    "icosphere 20480": ({"room": BALL20480}, cube(1.0), lambda x: in_convex(BALL20480, x)),
    "L": ({"room": l_shaped()}, Box(center=(0.5, 0.5, 0.5), size=(0.8, 0.8, 0.8)), in_l),
    "thin walls": (THIN, cube(1.8), lambda x: in_cube(x, 2)),
    "around thin walls": (
        THIN | {"yard": Box(center=(0, 0, 0), size=(3, 3, 3), inside=True)},
        Box(center=(0, 1.25, 0), size=(2.8, 0.3, 2.8)),
        lambda x: np.minimum(in_cube(x, 3), np.linalg.norm(np.maximum(np.abs(x) - 1.001, 0), axis=1)),
    ),
}


def shoot(name, count, method="exact", step=1.0, seed=0, most=3e5, **scene):
    """Shoot `count` balls of log-uniform speeds, 1e-2 to 1e5 m/s, in any direction; a decade flies for as long as its balls need
    to cross the room some ten times, or 5 s, and so many of them as take `most` steps together. Asserts that none is out at the
    end; returns the shots and the bounces."""
    surfaces, inside, room = ROOMS[name]
    rng = np.random.default_rng(seed)
    speed = 10 ** rng.uniform(-2, 5, count)
    way = rng.normal(size=(count, 3))
    way *= (speed / np.linalg.norm(way, axis=1))[:, None]
    place = inside.center + (rng.uniform(-0.5, 0.5, (count, 3)) * inside.size)
    shots, bounces, like = 0, 0, None
    for decade in range(-2, 5):
        mine = np.flatnonzero(np.floor(np.log10(speed)) == decade)
        duration = min(20 / 10.0**decade, 5.0)
        if method != "exact":
            mine = mine[: int(most * step / duration)]
        if len(mine) == 0:
            continue
        start = balls(place[mine], way[mine], radius=R, lifetime=1e9)
        like = Simulation(Scene(surfaces=surfaces, **scene), start, Solver(method, step), duration, duration, like)
        flight = like.run()
        assert flight.penetrations == 0
        # a method of first order may gain energy without end: up to its last good frame it has not got through
        if flight.status != "diverged":
            # a touch is found to rounding, and at 1e5 m/s and more the place is known by the time's 1e-16
            fastest = np.linalg.norm(flight.trajectory.velocity[-1], axis=1).max()
            assert room(last(flight)).min() > R - 1e-12 - 1e-15 * duration * fastest
        shots, bounces = shots + len(mine), bounces + len(flight.bounces)
    return shots, bounces


@pytest.mark.parametrize("name", ROOMS)
def test_none_escapes(name):
    shots, bounces = shoot(name, 2000, restitution=0.9)
    assert shots == 2000 and bounces > 10 * shots


@pytest.mark.slow
@pytest.mark.parametrize("name", ROOMS)
def test_none_of_a_hundred_thousand_escapes(name):
    """Summed over the rooms, elastic and not."""
    for seed, options in enumerate([ELASTIC, {}, {"damping": 0.0, "restitution": 0.5}]):
        shots, _ = shoot(name, 5000, seed=seed, **options)
        assert shots == 5000


@pytest.mark.parametrize("step", [1e-5, 1e-3, 0.1, 10.0])
@pytest.mark.parametrize("method", [method for method in METHODS if method != "exact"])
@pytest.mark.parametrize("name", ["box", "icosphere 1280", "L", "thin walls", "around thin walls"])
def test_none_escapes_at_any_step(name, method, step):
    shots, _ = shoot(name, 100, method, step)
    assert shots > 10


@pytest.mark.slow
@pytest.mark.parametrize("step", [1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0])
@pytest.mark.parametrize("method", [method for method in METHODS if method != "exact"])
@pytest.mark.parametrize("name", ROOMS)
def test_none_escapes_at_any_step_often(name, method, step):
    for seed, options in enumerate([ELASTIC, {}]):
        shots, _ = shoot(name, 1000, method, step, seed, most=1e6, **options)
        assert shots > 200


def test_a_slide_over_concave_facets_goes_on():
    """Steps so long that every hop is too short to be told from rest: the ball slides to and fro from facet to facet. It came to run
    along two of them that are nearly parallel, and was thrown from one onto the other without end."""
    place = (0.40683810056008896, 0.2872656561273732, -0.3831935382530103)
    velocity = (0.050849662177697166, 0.028321203469681616, -0.01674992173748977)
    start = balls(place, velocity, radius=R, lifetime=1e9)
    flight = swept(Scene(surfaces=ROOMS["icosphere 20480"][0], **ELASTIC), start, "symplectic_euler", 1.0, 5.0)
    assert flight.status == "finished" and 100 < len(flight.bounces) < 1000
    assert in_convex(BALL20480, last(flight)).min() > R - 1e-12


def with_features(simulation, features):
    """The simulation with other features for the same surfaces."""
    _, _, body, forces, *_ = simulation.engine.given
    s, s.features = simulation, pack(features)
    s.engine = engines.Swept(s.solver, s.balls, s.time[-1], body, forces, s.features)
    return s


def any_scene(seed):
    """A room with things in it, and fields."""
    rng = np.random.default_rng(seed)
    surfaces = {"room": Box(center=(0, 0, 0), size=(4, 4, 4), inside=True)}
    for k in range(rng.integers(0, 3)):
        surfaces[f"box{k}"] = Box(center=tuple(rng.uniform(-1, 1, 3)), size=tuple(rng.uniform(0.2, 0.8, 3)))
    for k in range(rng.integers(0, 4)):
        center, normal, up = rng.uniform(-1.5, 1.5, 3), rng.normal(size=3), rng.normal(size=3)
        size = tuple(rng.uniform(0.3, 1.2, 2))
        surfaces[f"plate{k}"] = Rectangle(center=tuple(center), normal=tuple(normal), size=size, up=tuple(up))
    if rng.random() < 0.5:
        surfaces["soup"] = soup(seed, int(rng.integers(1, 15)))
    if rng.random() < 0.5:
        surfaces["ground"] = Heightfield(size=(3.9, 3.9), cells=(5, 6), height="0.2*sin(3*x)*cos(2*z) - 1.6")
    if rng.random() < 0.5:
        surfaces["stone"] = moved(ico(1), 0.3 * rotation(seed), rng.uniform(-1, 1, 3))
    region = {"x": (-0.7, 0.4), "y": (-1.2, 1.1)} if seed % 2 else {}
    forces = {"wind": Uniform(direction=tuple(rng.normal(size=3)), magnitude=8.0, region=region)}
    return Scene(surfaces=surfaces, forces=forces, restitution=0.9, damping=0.0)


def free_balls(scene, seed, n):
    """Up to n balls that start outside of everything."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < n:
        place, velocity = rng.uniform(-1.9, 1.9, 3), rng.normal(0, 4, 3)
        try:
            Simulation(scene, balls(place, velocity, radius=R), Solver("exact"), 1.0, 1.0)
        except Invalid:
            continue
        found.append((place, velocity))
    return balls(*map(np.array, zip(*found)), radius=R)


@pytest.mark.parametrize("seed", range(50))
def test_reduction_and_tree_change_nothing(seed, monkeypatch):
    """Merged faces, dropped edges, a tree or none: four ways to the same bounces."""
    scene, flights = any_scene(seed), []
    start = free_balls(scene, seed, 4)
    for reduce in (True, False):
        for few in (0, 10**9):
            monkeypatch.setattr(reduction, "FEW", few)
            features, _ = reduction.features(list(scene.surfaces.values()), start.position, reduce=reduce)
            assert (len(features.tree.items) > 0) == (few == 0)
            simulation = with_features(Simulation(scene, start, Solver("exact"), 0.6, 0.05), features)
            flights.append(simulation.run())
    for flight in flights[1:]:
        for ball in range(len(start)):
            first, other = (f.bounces[f.bounces["ball"] == ball] for f in (flights[0], flight))
            # a rounding of 1e-15 grows at a bounce off a wall by no more than 1 + way/r = 40, off an edge or corner likewise
            growth = 1e-15 * 40.0 ** np.arange(7)
            n = min(len(first), len(other), 7)
            assert np.array_equal(first["surface"][:n], other["surface"][:n])
            assert (np.abs(first["position"][:n] - other["position"][:n]).max(axis=1) < growth[:n]).all()
            if len(first) < 6:
                assert len(first) == len(other)
                assert np.abs(last(flight)[ball] - last(flights[0])[ball]).max() < growth[n]


def transformed(seed, matrix, shift, n=8, duration=0.5):
    """A flight among triangles, all of it turned and shifted."""
    room, things = [cube(4)], [soup(seed, 10), moved(ico(1), 0.4 * rotation(seed), (0.5, -0.5, 0.8))]
    surfaces = {"room": moved(room, matrix, shift), "things": moved(things, matrix, shift)}
    plain = Scene(surfaces={"room": moved(room), "things": moved(things)}, restitution=0.9, damping=0.05)
    start = free_balls(plain, seed, n)
    wind = Uniform(direction=tuple(matrix @ (1, 2, -1)), magnitude=5.0)
    well = Spring(3.0, center=tuple(matrix @ (0.2, 0.1, -0.3) + shift))
    forces = {"wind": wind, "well": well, "air": Drag(0.3)}
    scene = Scene(gravity=tuple(matrix @ (0, -9.8, 0)), surfaces=surfaces, forces=forces, restitution=0.9, damping=0.05)
    turned = balls(start.position @ matrix.T + shift, start.velocity @ matrix.T, radius=R)
    return swept(scene, turned, duration=duration)


MIRROR = np.diag([1.0, 1.0, -1.0])


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(
    "matrix, shift",
    [(np.eye(3), (10.0, -20.0, 30.0)), (rotation(1), 0.0), (MIRROR, 0.0), (rotation(2) @ MIRROR, (1.0, 2.0, 3.0))],
    ids=["shift", "rotation", "mirror", "all"],
)
def test_symmetry(seed, matrix, shift):
    plain, other = transformed(seed, np.eye(3), 0.0), transformed(seed, matrix, np.asarray(shift))
    size = 4 + np.abs(shift).max()
    for ball in range(8):
        first, second = (f.bounces[f.bounces["ball"] == ball] for f in (plain, other))
        n = min(len(first), len(second), 5)
        assert np.array_equal(first["surface"][:n], second["surface"][:n])
        # as above; the coordinates round by 1e-16 of their size
        growth = 1e-15 * size * 40.0 ** np.arange(6)
        wanted = first["position"] @ matrix.T + shift
        assert (np.abs(wanted[:n] - second["position"][:n]).max(axis=1) < growth[:n]).all()
        assert (np.abs(first["normal"][:n] @ matrix.T - second["normal"][:n]).max(axis=1) < growth[:n] / R).all()
        if len(first) < 5:
            assert len(first) == len(second)
            assert np.abs(last(plain)[ball] @ matrix.T + shift - last(other)[ball]).max() < growth[n]


REGIONS = {
    "wind": Uniform(direction=(1, 1, -1), magnitude=6.0, region={"x": (-0.5, 0.3), "z": (-0.9, 0.8)}),
}


@pytest.mark.parametrize("step", [1e-3, 0.0137])
def test_rk4_original_is_exact_with_regions_and_bounces(step):
    """In uniform fields, so that only rounding tells it from the exact solver."""
    scene = Scene(surfaces=ROOMS["box"][0], forces=REGIONS, restitution=0.9)
    rng = np.random.default_rng(6)
    start = balls(rng.uniform(-0.9, 0.9, (20, 3)), rng.normal(0, 3, (20, 3)), radius=R)
    exact, rk4 = (swept(scene, start, method, step, 1.0, every=0.05) for method in ("exact", "rk4_original"))
    assert np.array_equal(exact.bounces["surface"], rk4.bounces["surface"]) and len(exact.bounces) > 20
    assert np.array_equal(np.bincount(exact.bounces["ball"]), np.bincount(rk4.bounces["ball"]))
    # up to a thousand steps, and faces of a region met at a slant
    assert np.abs(exact.trajectory.position - rk4.trajectory.position).max() < 1e-11


def test_a_pile_up_of_bounces_ends():
    """A gap of a tenth of a millimetre at 1 km/s: ten million bounces a second."""
    roof = Plane(point=(0, 2 * R + 1e-4, 0), normal=(0, -1, 0))
    scene = Scene(surfaces={"floor": Plane(), "roof": roof}, **ELASTIC)
    with pytest.raises(engines.Stalled, match="1000000 events within a second.*bounces pile up"):
        swept(scene, balls((0, R + 5e-5, 0), (0, 1000, 0), radius=R), duration=10.0)


def test_a_pile_up_about_the_face_of_a_region_ends():
    """Gravity down above y = 1, more push up below: drag takes the hops across the face, ever shorter, toward none."""
    lift = Uniform(direction=(0, 1, 0), magnitude=30.0, region={"y": (-5, 1)})
    with pytest.raises(engines.Stalled):
        swept(Scene(forces={"lift": lift, "air": Drag(3.0)}), balls((0, 2, 0), FREE, lifetime=99), duration=60.0)


def test_starts_inside_are_refused():
    table = Rectangle(center=(0, 1, 0), normal=(0, 1, 0), size=(2, 2))
    surfaces = {"floor": Plane(), "table": table, "block": Box(center=(3, 1, 0), size=(1, 1, 1))}

    def start(*places):
        return swept(Scene(surfaces=surfaces), balls(places, FREE, radius=R), duration=0.01)

    start((0, R, 0), (0, 1 + R, 0), (0, 1 - R, 0), (3, 1.5 + R, 0), (1 + R, 1, 0))  # touching exactly
    for place, name, depth in [
        ((0, R - 1e-6, 0), "floor", 1e-6),
        ((0, -1, 0), "floor", 1 + R),
        ((0, 1 + 0.6 * R, 0), "table", 0.4 * R),
        ((1 + 0.5 * R, 1, 0), "table", 0.5 * R),
        ((3, 1.5 - 0.25, 0), "block", 0.25 + R),
        ((3.5 + 0.8 * R, 1, 0), "block", 0.2 * R),
    ]:
        with pytest.raises(Invalid, match=f"ball 1 starts {depth:.3g} m inside the surface '{name}'"):
            start((0, 0.5, 0), place)


def test_a_start_outside_of_a_room_is_refused():
    room = {"room": Box(center=(0, 0, 0), size=(2, 2, 2), inside=True)}
    with pytest.raises(Invalid, match="inside the surface 'room'"):
        swept(Scene(surfaces=room), balls((1.5, 0, 0), FREE))


def test_a_step_that_diverges_beside_many_faces_ends():
    """In one step of 10 ms the ball gets 1e12 m far: chords that leave it by no more than its radius are 1e11."""
    hills = Heightfield(size=(1e4, 1e4), cells=(4, 3), height="0.3*sin(2*x)*cos(2*z)")
    start = balls((1.0, -1.4, 1e6), (4e-5, 0, 0))
    assert swept(Scene(surfaces={"hills": hills}, forces={"air": Drag(2e8)}), start, "rk4_original").status == "diverged"
