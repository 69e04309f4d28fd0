"""The original's contact rule against a plain reading of it, and in cases whose numbers are known."""

import numpy as np
import pytest

from sim import reduction
from sim.shapes import Box, Heightfield, Plane, Rectangle, Triangles
from sim.simulate import Scene
from sim.tree import WIDE
from tests.sim import plain
from tests.sim.helpers import AIR, FREE, balls, fly, random_balls, room

FLOOR = {"floor": Plane()}
# A step whose contact counts is a shift along a ray and a reflection: some ten roundings of values below 100.
ROUNDING = 1e-12


@pytest.fixture(params=["with a tree", "without"])
def searched(request, monkeypatch):
    """The faces searched by a tree although they are few, and looked at one by one."""
    monkeypatch.setattr(reduction, "FEW", 0 if request.param == "with a tree" else 32)


def compare(scene, start, method, step, duration):
    """Hold a flight against the plain one: frames, impacts one by one, faces passed. Returns it."""
    flight = fly(scene, start, method, step=step, duration=duration)
    times = flight.trajectory.time
    expected = [plain.Flight(scene, start, i, method, step, times) for i in range(len(start))]
    impacts = sorted((start.released[i] + b[0], i, *b[1:]) for i, p in enumerate(expected) for b in p.bounces)
    assert len(flight.bounces) == len(impacts)
    for bounce, (time, ball, surface, position, normal, before, after) in zip(flight.bounces, impacts):
        assert (bounce["ball"], bounce["surface"]) == (ball, surface)
        vn, vt = before @ normal, before - (before @ normal) * normal
        lost = start.mass / 2 * (before @ before - after @ after)
        for name, value in {
            "time": time,
            "position": position,
            "normal": normal,
            "speed_normal": -vn,
            "speed_tangential": np.linalg.norm(vt),
            "energy_lost": lost,
        }.items():
            assert np.allclose(bounce[name], value, rtol=ROUNDING, atol=ROUNDING), name
    for name in ("position", "velocity"):
        plain_value = np.stack([getattr(p, name) for p in expected], axis=1)
        assert np.allclose(getattr(flight.trajectory, name), plain_value, rtol=0, atol=ROUNDING, equal_nan=True)
    assert flight.penetrations == sum(p.crossed for p in expected)
    return flight


@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_a_single_long_step(seed, many):
    """300 balls, anywhere and anyhow, fast enough to meet any of the faces, from any side."""
    scene = room(many, damping=0.3, wall_mass=10.0, forces={"air": AIR})
    flight = compare(scene, random_balls(seed, 300, speed=12.0, radius=0.1), "rk4_original", 0.1, 0.1)
    assert len(flight.bounces) > 100 and flight.penetrations > 5


@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("method", plain.METHODS)
def test_many_bounces(method, many):
    start = random_balls(7, 20, released=0.0173 * np.arange(20), lifetime=0.9119)
    flight = compare(room(many, damping=0.1), start, method, 0.01, 1.0033)
    assert len(flight.bounces) > 50


def test_a_hit_in_numbers(searched):
    """From 2 m above a floor at -3 m/s, r = 0.5: after 1.5 m, at half of the step of 1 s, and up for the other half."""
    scene = Scene(gravity=(0, -2, 0), surfaces=FLOOR, restitution=0.5, damping=0.25)
    flight = fly(scene, balls((0, 2, 0), (4, -3, 0), mass=2.0, radius=0.5), step=1.0, duration=1.0)
    (hit,) = flight.bounces
    # v' = (1 - d) v_t - e v_n = (3, 1.5), then g h on top; lost is 2/2 (25 - 9 - 2.25)
    exactly = {"rel": 1e-15, "abs": 1e-15}  # two roundings, as 3/5 is not a binary number
    assert hit["time"] == pytest.approx(0.5, **exactly)
    assert hit["position"] == pytest.approx((2, 0.5, 0), **exactly) and np.array_equal(hit["normal"], (0, 1, 0))
    assert (hit["speed_normal"], hit["speed_tangential"], hit["energy_lost"]) == (3, 4, 13.75)
    assert flight.trajectory.position[1, 0] == pytest.approx((2 + 3 / 2, 0.5 + 1.5 / 2, 0), **exactly)
    assert np.array_equal(flight.trajectory.velocity[1, 0], (3, 1.5 - 2, 0))


def test_the_leak(searched):
    """Level flight 1 cm above contact: no ray meets the floor until gravity has taken the ball below r, and then none
    counts. In steps of 0.1 s it is at 0.061 m < r after one, at -0.086 m after two, and falls on."""
    flight = fly(Scene(surfaces=FLOOR), balls((0, 0.11, 0), (1, 0, 0), radius=0.1), step=0.1, duration=1.0)
    assert len(flight.bounces) == 0 and flight.penetrations == 1
    assert np.allclose(flight.trajectory.position[[1, 2, 10], 0, 1], (0.061, -0.086, 0.11 - 4.9), rtol=0, atol=1e-14)
    # 10 cm higher the floor is still ahead after the first step
    flight = fly(Scene(surfaces=FLOOR), balls((0, 0.21, 0), (1, 0, 0), radius=0.1), step=0.1, duration=0.2)
    assert flight.bounces["time"] == pytest.approx(0.1 + 0.061 / 0.98, rel=1e-14)
    assert flight.penetrations == 0


@pytest.mark.parametrize("length, hits", [(22.1, 1), (21.9, 0)])
def test_shallow_ray(searched, length, hits):
    """At 1 : 100 the moved face is met after 1 m, but counts only if the centre's ray meets the real one, at 11 m."""
    scene = Scene(gravity=FREE, surfaces={"floor": Rectangle(center=FREE, normal=(0, 1, 0), size=(length, 2))})
    flight = fly(scene, balls((0, 0.11, 0), (1, -0.01, 0), radius=0.1), step=2.0, duration=2.0)
    assert len(flight.bounces) == hits
    # 0.11 - 0.1 is known to 1e-17 only, and 0.01 of it
    assert flight.bounces["time"] == pytest.approx([1.0] * hits, rel=1e-14)


def test_the_centre_decides_not_the_sphere(searched):
    """A ball that overlaps the edge passes if its centre does."""
    scene = Scene(gravity=FREE, surfaces={"floor": Rectangle(center=FREE, normal=(0, 1, 0), size=(2, 2))})
    flight = fly(scene, balls([(0.999, 1, 0), (1.001, 1, 0)], (0, -4, 0), radius=0.5), step=0.25, duration=0.5)
    assert list(flight.bounces["ball"]) == [0] and flight.penetrations == 0


def test_two_sided_from_both_sides(searched):
    wall = Rectangle(center=FREE, normal=(1, 0, 0), size=(2, 2))
    scene = Scene(gravity=FREE, surfaces={"wall": wall}, restitution=1.0)
    flight = fly(scene, balls([(1, 0, 0), (-1, 0, 0)], [(-2, 0, 0), (2, 0, 0)], radius=0.5), step=0.5, duration=0.5)
    assert np.array_equal(flight.bounces["time"], [0.25, 0.25])
    assert np.array_equal(flight.bounces["normal"], [(1, 0, 0), (-1, 0, 0)])
    assert np.array_equal(flight.trajectory.position[-1], [(1, 0, 0), (-1, 0, 0)])


@pytest.mark.parametrize(
    "shape",
    [Plane(point=(0, 1, 0)), Box(center=(0, 0, 0), size=(4, 2, 4)), Box(center=(0, 2, 0), size=(4, 2, 4), inside=True)],
)
def test_one_sided_from_behind_is_no_hit(searched, shape):
    """Up through y = 1, from the solid side."""
    scene = Scene(gravity=FREE, surfaces={"it": shape})
    flight = fly(scene, balls(FREE, (0, 1, 0), radius=0.1), duration=1.5, step=0.5)
    assert len(flight.bounces) == 0 and flight.penetrations == 0
    assert flight.trajectory.position[-1, 0, 1] == 1.5


def test_moving_away_is_no_hit(searched):
    flight = fly(Scene(gravity=FREE, surfaces=FLOOR), balls((0, 0.5, 0), (1, 1, 0), radius=0.5), step=0.5, duration=1.0)
    assert len(flight.bounces) == 0


def test_hit_at_the_start_of_a_step(searched):
    """s = 0 is a hit: the whole step is flown with the velocity after it."""
    scene = Scene(gravity=FREE, surfaces=FLOOR, restitution=0.5)
    flight = fly(scene, balls((0, 0.5, 0), (0, -2, 0), radius=0.5), step=0.5, duration=1.0)
    assert np.array_equal(flight.bounces["time"], [0.0])
    assert np.array_equal(flight.trajectory.position[:, 0, 1], (0.5, 1.0, 1.5))


def test_a_hair_inside_is_no_hit(searched):
    scene = Scene(gravity=FREE, surfaces=FLOOR)
    flight = fly(scene, balls((0, np.nextafter(0.5, 0), 0), (0, -2, 0), radius=0.5), step=0.5, duration=1.0)
    assert len(flight.bounces) == 0 and flight.penetrations == 1


@pytest.mark.parametrize("height, hits", [(1.5, 1), (np.nextafter(1.5, 2), 0)])
def test_hit_at_the_end_of_a_step(searched, height, hits):
    """s = |v| h is a hit, the next number is one only in the next step."""
    scene = Scene(gravity=FREE, surfaces=FLOOR, restitution=0.5)
    start = balls((0, height, 0), (0, -2, 0), radius=0.5)
    flight = fly(scene, start, step=0.5, duration=0.5)
    assert len(flight.bounces) == hits
    assert flight.trajectory.velocity[-1, 0, 1] == (1 if hits else -2)
    assert len(fly(scene, start, step=0.5, duration=1.0).bounces) == 1


@pytest.mark.parametrize("order", [("floor", "wall"), ("wall", "floor")])
def test_the_first_named_wins_a_tie(searched, order):
    """Into the edge along the bisector: floor and wall are equally far, whatever the order of a tree."""
    both = {
        "floor": Rectangle(center=(2, 0, 0), normal=(0, 1, 0), size=(4, 4)),
        "wall": Rectangle(center=(0, 2, 0), normal=(1, 0, 0), size=(4, 4)),
    }
    scene = Scene(gravity=FREE, surfaces={name: both[name] for name in order}, restitution=1.0, damping=0.0)
    flight = fly(scene, balls((1, 1, 0), (-1, -1, 0), radius=0.5), step=0.75, duration=0.75)
    assert list(flight.bounces["surface"]) == [0]
    assert np.array_equal(flight.bounces["normal"][0], both[order[0]].normal)


def square(n):
    """A unit square of n x n cells of two triangles each, in the plane y = 0."""
    return Heightfield(size=(1, 1), cells=(n, n), height="0")


@pytest.mark.parametrize("cells", [1, 2, 10])  # 10: with a tree
@pytest.mark.parametrize("heading", [(0, -1, 0), (0.25, -1, 0.25), (0.3, -1, -0.2)])
def test_a_ray_through_an_edge_hits_once(cells, heading):
    """The centre's ray goes to points of the shared edges, and to corners where six triangles meet."""
    ends = np.array([(k / 8, 0.0, k / 8) for k in range(-3, 4)] + [(0.0, 0.0, k / 7) for k in range(-3, 4)])
    start = balls(ends - np.array(heading), heading, radius=0.25)
    flight = fly(Scene(gravity=FREE, surfaces={"square": square(cells)}), start, step=1.0, duration=2.0)
    assert np.array_equal(np.sort(flight.bounces["ball"]), np.arange(len(start)))
    assert flight.penetrations == 0


def test_no_crack_at_any_grid_line():
    """Straight down onto the line that two triangles share, at two-digit places: their far corners are computed from
    their near ones, and round. Four of each fill a leaf, so that in the tree neighbours do not share one."""
    rng = np.random.default_rng(8)
    line = np.sort(rng.choice(np.arange(-99, 100) / 100, (200, 3)), axis=1)
    line = line[(line[:, 0] < line[:, 1]) & (line[:, 1] < line[:, 2])]
    n = len(line)
    z = 10.0 * np.arange(n)
    west, near, far, east = (
        np.column_stack([line[:, k], 0 * z, z + dz]) for k, dz in ((0, -1), (1, -1), (1, 2), (2, -1))
    )
    pair = np.arange(n)[:, None, None] + n * np.array([(0, 1, 2), (3, 2, 1)])
    strip = Triangles(np.concatenate([west, near, far, east]), np.repeat(pair, WIDE, axis=1).reshape(-1, 3))
    start = balls(np.column_stack([line[:, 1], 0 * z + 1, z]), (0, -1, 0), radius=0.25)
    flight = fly(Scene(gravity=FREE, surfaces={"strip": strip}), start, step=0.5, duration=2.0)
    assert len(flight.bounces) == n and flight.penetrations == 0


def test_a_ball_without_velocity_hits_nothing(searched):
    flight = fly(Scene(gravity=FREE, surfaces=FLOOR), balls((0, 0.5, 0), FREE, radius=0.5), step=0.5, duration=1.0)
    assert len(flight.bounces) == 0
    assert np.array_equal(flight.trajectory.position[:, 0], [(0, 0.5, 0)] * 3)


def test_penetrations_count_faces(searched):
    """Through a wall of two sides and back by a spring: twice; through a one-sided plane only to its back."""
    wall = {"wall": Rectangle(center=FREE, normal=(0, 1, 0), size=(2, 2))}
    for surfaces, passed in ((wall, 2), (FLOOR, 1)):
        # so large that every s is below 0
        start = balls((0, 0.5, 0), (0, -4, 0), radius=10.0)
        flight = fly(Scene(gravity=(0, 4, 0), surfaces=surfaces), start, step=0.125, duration=2.0)
        assert flight.trajectory.position[-1, 0, 1] == 0.5
        assert (len(flight.bounces), flight.penetrations) == (0, passed)
