"""Balls that come to rest, slide, are lifted again, and go over edges: against formulas."""

from itertools import product

import numpy as np
import pytest

from sim import rest
from sim.forces import Drag, Uniform
from sim.shapes import Box, Heightfield, Plane, Rectangle, Triangles
from sim.simulate import METHODS, Scene
from tests.sim.helpers import ELASTIC, FREE, balls, last, moved, rotation, swept

G, R = 9.8, 0.06
FIRST_ORDER = [method for method in METHODS if "euler" in method]
FINE = [method for method in METHODS if method not in FIRST_ORDER]
FLOOR = {"floor": Plane()}


def energy(flight, mass=1.0, gravity=(0, -G, 0)):
    """Kinetic and potential energy of each ball at each frame, in J."""
    x, v = flight.trajectory.position, flight.trajectory.velocity
    return mass * (0.5 * (v**2).sum(axis=2) - x @ np.asarray(gravity, float))


def heavy(method, step):
    """The original's ball of 100 kg, e = 1/3, dropped from 1 m above the floor."""
    return swept(Scene(surfaces=FLOOR), balls((0, 1 + R, 0), (0.3, 0, 0), mass=100.0), method, step, duration=2.0)


LANDS = np.sqrt(2 / G)
RESTS = LANDS * (1 + 1 / 3) / (1 - 1 / 3)


@pytest.mark.parametrize("method", FINE)
def test_a_heavy_ball_comes_to_rest(method):
    flight = heavy(method, 0.013)
    assert (flight.status, flight.resting, flight.penetrations, len(flight.rests)) == ("rested", 1, 0, 1)
    # the heights of some twenty impacts are known to 1e-16 m, at speeds of down to 1e-5 m/s
    assert flight.rests["time"][0] == pytest.approx(RESTS, abs=1e-12)
    assert abs(last(flight)[0, 1] - R) < 1e-15 and not flight.trajectory.velocity[-1].any()
    # at the k-th impact the way along has lost 5 % k times: LANDS (1 + 0.95 * 2/3 * (1 + 0.95/3 + ...))
    assert last(flight)[0, 0] == pytest.approx(0.3 * LANDS * (1 + 0.95 * (2 / 3) / (1 - 0.95 / 3)), abs=1e-12)
    assert flight.energy.lost[-1] == pytest.approx(100 * (G + 0.3**2 / 2), rel=1e-12)


@pytest.mark.parametrize("method", FIRST_ORDER)
def test_a_heavy_ball_comes_to_rest_to_first_order(method):
    errors = []
    for step in (1e-2, 1e-3, 1e-4):
        flight = heavy(method, step)
        assert (flight.status, flight.penetrations, len(flight.rests)) == ("rested", 0, 1)
        errors.append(abs(flight.rests["time"][0] - RESTS))
        # some ten impacts until a hop takes four steps, each as late or early as a step or two
        assert errors[-1] < 20 * step
        assert abs(last(flight)[0, 1] - R) < 1e-15
    assert errors[2] < 0.1 * errors[0]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_without_restitution_it_rests_at_once(method, damping):
    """On the first impact; with d = 0 it slides on with the speed along the floor that it had."""
    scene = Scene(surfaces=FLOOR, restitution=0.0, damping=damping)
    flight = swept(scene, balls((0, 1 + R, 0), (0.5, 0, 0)), method, 1e-3, duration=1.0)
    assert len(flight.bounces) == len(flight.rests) == 1
    assert flight.rests["time"][0] == pytest.approx(LANDS, abs=2e-3 if method in FIRST_ORDER else 1e-14)
    assert abs(last(flight)[0, 1] - R) < 1e-15
    if damping:
        assert flight.status == "rested"
    else:
        assert flight.status == "finished" and last(flight)[0, 0] == pytest.approx(0.5, abs=1e-13)  # a thousand steps


# a hop of Euler's has a least length: more than the step for such e, and the ball hops on
@pytest.mark.parametrize("method, e", [*product(METHODS, [0.0, 1 / 3]), *product(FINE, [0.8])])
@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_it_is_lifted_when_what_pushes_ends(method, e, damping):
    # a hundred steps that round numbers below 4; or half a step of the way
    step, tolerance = (0.017, 1e-13) if method in FINE else (1e-3, 0.51e-3 * (15 - G))
    fields = {"push": Uniform(direction=(0, -1, 0), magnitude=20, until=3.0), "lift": Uniform(direction=(0, 1, 0), magnitude=15)}
    scene = Scene(surfaces=FLOOR, forces=fields, restitution=e, damping=damping)
    flight = swept(scene, balls((0, 0.5, 0), FREE), method, step, duration=4.0, every=0.25)
    assert flight.status == "finished" and len(flight.rests) == 1 and flight.rests["time"][0] < 3
    t = flight.trajectory.time
    late = t >= 3
    assert np.abs(flight.trajectory.position[late, 0, 1] - R - (15 - G) * (t[late] - 3) ** 2 / 2).max() < tolerance


@pytest.mark.parametrize("method", FINE)
def test_it_slides_into_what_lifts_it(method):
    """At x = 0.5; behind x = 1 it falls back from there, and lands where a parabola ends."""
    fields = {"lift": Uniform(direction=(0, 1, 0), magnitude=15, region={"x": (0.5, 1.0)})}
    scene = Scene(surfaces=FLOOR, forces=fields, restitution=0.0, damping=0.0)
    flight = swept(scene, balls((0, R, 0), (2, 0, 0)), method, 0.017, duration=1.0, every=0.01)
    t = flight.trajectory.time
    up = 15 - G
    rise, speed = up * 0.25**2 / 2, up * 0.25  # after the quarter of a second inside
    lands = 0.5 + (speed + np.sqrt(speed**2 + 2 * G * rise)) / G
    y = np.select(
        [t < 0.25, t < 0.5, t < lands],
        [0, up * (t - 0.25) ** 2 / 2, rise + speed * (t - 0.5) - G * (t - 0.5) ** 2 / 2],
    )
    # a hundred steps, with faces and edges of the field in between
    assert np.abs(flight.trajectory.position[:, 0, 1] - R - y).max() < 1e-13
    assert np.abs(flight.trajectory.position[:, 0, 0] - 2 * t).max() < 1e-13


def slope(angle):
    """The normal of a plane that falls along x, and its direction downhill."""
    return np.array([np.sin(angle), np.cos(angle), 0]), np.array([np.cos(angle), -np.sin(angle), 0])


@pytest.mark.parametrize("method", FINE)
@pytest.mark.parametrize("e", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("height", [0.0, 0.2])
def test_down_a_frictionless_slope(method, e, height):
    """Along the slope g sin(angle) acts, whether the ball bounces or slides; across it bounces under g cos(angle)."""
    normal, down = slope(0.4)
    scene = Scene(surfaces={"slope": Plane(normal=tuple(normal))}, restitution=e, damping=0.0)
    flight = swept(scene, balls((R + height) * normal, FREE, lifetime=99), method, 0.031, duration=5.0, every=0.25)
    t = flight.trajectory.time
    x = flight.trajectory.position[:, 0]
    # a hundred steps or more that round numbers below 50
    assert np.abs(x @ down - G * np.sin(0.4) * t**2 / 2).max() < 1e-12
    end = np.sqrt(2 * height / (G * np.cos(0.4))) * (1 + e) / (1 - e)
    assert len(flight.rests) == 1 and flight.rests["time"][0] == pytest.approx(end, abs=1e-9)  # some 10 m down a height is
    # known to 1e-15 m only, at speeds of down to 1e-6 m/s
    assert np.abs(x[t > end] @ normal - R).max() < 1e-13
    assert flight.status == "finished" and flight.penetrations == 0
    assert np.abs(flight.energy.residual).max() < 1e-12 * 50 * G


@pytest.mark.parametrize("method", FIRST_ORDER)
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_down_a_frictionless_slope_to_first_order(method, e):
    normal, down = slope(0.4)
    scene = Scene(surfaces={"slope": Plane(normal=tuple(normal))}, restitution=e, damping=0.0)
    for step in (1e-2, 1e-3):
        flight = swept(scene, balls((R + 0.2) * normal, FREE, lifetime=99), method, step, duration=5.0, every=0.25)
        t, x = flight.trajectory.time, flight.trajectory.position[:, 0]
        # half a step of the way
        assert (np.abs(x @ down - G * np.sin(0.4) * t**2 / 2) <= 0.51 * step * G * np.sin(0.4) * t + 1e-12).all()
        # 5000 steps that round numbers below 50, by up to 4e-15
        assert len(flight.rests) == 1 and np.abs(x[t > flight.rests["time"][0]] @ normal - R).max() < 5e-12
        assert flight.status == "finished" and flight.penetrations == 0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("e", [0.0, 0.3, 0.6])
def test_held_on_a_slope(method, e):
    normal, _ = slope(0.4)
    scene = Scene(surfaces={"slope": Plane(normal=tuple(normal))}, restitution=e, damping=0.05)
    flight = swept(scene, balls((R + 0.2) * normal, (0, 0, 1)), method, 1e-2, duration=12.0, every=0.5)
    assert flight.status == "rested" and len(flight.rests) == 1
    after = flight.trajectory.position[flight.trajectory.time > flight.rests["time"][0], 0]
    assert len(after) > 2 and (after == after[0]).all() and abs(after[0] @ normal - R) < 1e-14


@pytest.mark.parametrize("method", FINE)
def test_it_slides_with_drag(method):
    scene = Scene(surfaces=FLOOR, forces={"air": Drag(0.8)}, restitution=0.5, damping=0.0)
    flight = swept(scene, balls((0, R, 0), (2, 0, 1)), method, 1e-3, duration=2.0, every=0.1)
    way = (1 - np.exp(-0.8 * flight.trajectory.time)) / 0.8
    # rk4_original is of second order in drag: 2 (b h)^2/6
    tolerance = 1e-14 if method == "exact" else 1e-6
    assert np.abs(flight.trajectory.position[:, 0] - np.stack([2 * way, 0 * way + R, way], axis=1)).max() < tolerance


TABLE = {"table": Rectangle(center=(0, 1, 0), normal=(0, 1, 0), size=(2, 2))}


@pytest.mark.parametrize("method", FINE)
@pytest.mark.parametrize("direction", [0.0, 0.3, np.pi / 4, 2.0])
def test_it_slides_off_a_table_and_falls(method, direction):
    """With v^2/r > g it leaves the edge at once."""
    velocity = 1.5 * np.array([np.cos(direction), 0, np.sin(direction)])
    scene = Scene(surfaces=TABLE, restitution=0.5, damping=0.0)
    flight = swept(scene, balls((0, 1 + R, 0), velocity), method, 0.013, duration=1.5, every=0.05)
    t, leaves = flight.trajectory.time, 1 / np.abs(velocity).max()
    y = 1 + R - G * np.maximum(t - leaves, 0) ** 2 / 2
    wanted = np.stack([velocity[0] * t, y, velocity[2] * t], axis=1)
    assert np.abs(flight.trajectory.position[:, 0] - wanted).max() < 1e-13  # a hundred steps
    assert flight.penetrations == 0


@pytest.mark.parametrize("method", FINE)
@pytest.mark.parametrize("speed", [1e-3, 0.1, 0.5, 0.75])
def test_slowly_over_the_edge(method, speed):
    """Around the edge to the angle at which cos = (2 + v^2/(g r))/3, where gravity no longer bends its way enough."""
    scene = Scene(surfaces=TABLE, restitution=0.5, damping=0.0)
    flight = swept(scene, balls((0.99, 1 + R, 0), (speed, 0, 0), lifetime=99), method, 0.001, duration=0.01 / speed + 1.0)
    cosine = (2 + speed**2 / (G * R)) / 3
    leaves = np.sqrt(G * R * cosine)
    assert flight.penetrations == 0
    # the energy by the order of the steps around the edge, (2e-3)^4 of it; the leaving by a step, 2e-3, squared
    assert np.abs(energy(flight)[-1] - energy(flight)[0]).max() < 1e-11 * G * R
    assert flight.trajectory.velocity[-1, 0, 0] == pytest.approx(leaves * cosine, rel=1e-5)


@pytest.mark.parametrize("side", [0.0, 1e-3, 0.02])
@pytest.mark.parametrize("damping", [0.0, 0.05])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_onto_an_edge(e, damping, side):
    """Dropped with its centre over the edge of a table, or up to a third of its radius beside it."""
    scene = Scene(surfaces=TABLE, restitution=e, damping=damping)
    flight = swept(scene, balls((1 + side, 1.5, 0), FREE), duration=3.0, every=0.1)
    assert flight.penetrations == 0
    e0, e1 = energy(flight)[0, 0], energy(flight)[-1, 0]
    lost = flight.energy.lost[-1]
    assert e1 + lost == pytest.approx(e0, abs=1e-11 * (abs(e1) + abs(e0)))
    # frames on the way around the edge are on a parabola of 2e-3 of the time scale: its cube
    assert np.abs(flight.energy.residual).max() < 1e-8 * (abs(e1) + abs(e0))


def strip(begin, end, across):
    """A flat strip whose one side is the edge from `begin` to `end`, and the other that moved by `across`."""
    a, b = np.asarray(begin, float), np.asarray(end, float)
    return Triangles(np.array([a, b, b + across, a + across]), np.array([[0, 1, 2], [0, 2, 3]]))


WALL = {"wall": Plane(normal=(1, 0, 0))}
#: Down an edge in the plane of the wall, and the direction upward from it.
DOWNHILL, UPWARD = np.array([0, -0.6, 0.8]), np.array([0, 0.8, 0.6])
#: From the edge to the centre of a ball that leans on the wall, or on another edge.
LEANING = R * (0.8 * UPWARD - 0.6 * np.array([1, 0, 0]))


@pytest.mark.parametrize("method", FINE)
@pytest.mark.parametrize("partner", ["wall", "edge"])
def test_straight_between_an_edge_and_another_surface(method, partner):
    """Down an edge that goes along a wall, or another edge: with g sin(angle), in some few steps; then it falls off their end."""
    along = strip((1.6 * R, 0, 0), np.array([1.6 * R, 0, 0]) + 4 * DOWNHILL, (1, 0, 0))
    other = strip((0.4 * R, 0, 0), np.array([0.4 * R, 0, 0]) + 4 * DOWNHILL, (-1, 0, 0))
    surfaces = {"shelf": along, **(WALL if partner == "wall" else {"twin": other})}
    begin = (1.6 * R, 0, 0) + LEANING + 0.5 * DOWNHILL
    flight = swept(Scene(surfaces=surfaces, restitution=0.5, damping=0.0), balls(begin, FREE), method, 0.01, 1.5, 0.01)
    t, x = flight.trajectory.time, flight.trajectory.position[:, 0]
    on = 0.5 + G * 0.6 * t**2 / 2 < 4
    wanted = begin + np.outer(G * 0.6 * t**2 / 2, DOWNHILL)
    assert np.abs(x - wanted)[on].max() < 1e-12 and np.abs(x - wanted)[-1].max() > 0.1
    assert np.abs(energy(flight) - energy(flight)[0]).max() < 1e-11 and flight.penetrations == 0
    if method == "exact":
        assert simulated(surfaces, begin, 1.0).steps < 30


def simulated(surfaces, begin, duration, velocity=FREE, gravity=(0, -G, 0), every=None):
    """An exact flight without damping."""
    scene = Scene(gravity=gravity, surfaces=surfaces, restitution=0.5, damping=0.0)
    return swept(scene, balls(begin, velocity, lifetime=99), duration=duration, every=every)


@pytest.mark.parametrize("speed", [1e-3, 0.1, 0.5])
def test_over_an_edge_while_it_leans_on_a_wall(speed):
    """The wall goes across the edge: nothing changes, but that the ball is pressed against it."""
    surfaces = {**TABLE, "wall": Plane(point=(0, 0, -0.5), normal=(0, 0, 1))}
    begin, gravity = (0.99, 1 + R, -0.5 + R), (0, -G, -3)
    flight = simulated(surfaces, begin, 0.01 / speed + 0.6, (speed, 0, 0), gravity, every=0.01)
    cosine = (2 + speed**2 / (G * R)) / 3
    assert flight.trajectory.velocity[-1, 0, 0] == pytest.approx(np.sqrt(G * R * cosine) * cosine, rel=1e-5)
    assert np.abs(flight.trajectory.position[:, 0, 2] - begin[2]).max() < 1e-15
    moves = energy(flight, gravity=gravity)
    assert np.abs(moves - moves[0]).max() < 1e-11 * G * R and flight.penetrations == 0


def test_an_edge_that_leads_away_from_a_wall():
    """The ball sinks between the two on a curved way, at last through; it is always on both, or off the edge."""
    begin, end = np.array([1.2 * R, 0, 0]), np.array([1.2 * R + 0.1, -0.2, 1.5])
    way = (end - begin) / np.linalg.norm(end - begin)
    one = np.array([1, 0, 0]) - way[0] * way  # across the edge, as are `other` and the ball's way from there to its centre
    other = np.cross(one, way) / np.linalg.norm(one)
    place = begin + 0.05 * way
    aside = (R - place[0]) / one[0]
    start = place + aside * one + np.sqrt(R**2 - aside**2 * (one @ one)) * np.sign(other[1]) * other
    flight = simulated({"shelf": strip(begin, end, (1, 0, 0)), **WALL}, start, 1.5, every=0.005)
    x = flight.trajectory.position[:, 0]
    off = x - begin - np.outer((x - begin) @ way, way)
    gap, wall = np.linalg.norm(off, axis=1) - R, x[:, 0] - R
    assert min(gap.min(), wall.min()) > -1e-12 and flight.penetrations == 0
    leaves = np.flatnonzero(gap > 1e-9)[0]
    assert leaves > 20 and max(np.abs(gap[:leaves]).max(), np.abs(wall[:leaves]).max()) < 1e-12
    assert (np.diff(gap[leaves:]) > 0).all() and x[-1, 1] < -1
    assert np.abs(flight.energy.residual).max() < 1e-9 * G * R


@pytest.mark.parametrize("speed", [0.05, 0.3])
@pytest.mark.parametrize("side", [0.0, 1e-7, 1e-4, 0.005])
def test_slowly_over_a_corner(speed, side):
    """Straight over it as over an edge; else over the edge beside it, and maybe around the corner then."""
    way = speed * np.sqrt([0.5, 0, 0.5])
    flight = simulated(TABLE, (0.99, 1 + R, 0.99 - side), 0.02 / speed + 1.0, way, every=0.01)
    assert np.abs(energy(flight) - energy(flight)[0]).max() < 1e-11 * G * R and flight.penetrations == 0
    corner = flight.trajectory.position[:, 0] - np.array([1, 1, 1])
    outside = np.maximum(corner, [0, 0, 0]) + np.minimum(corner, 0) * [0, 1, 0]
    assert np.linalg.norm(outside, axis=1).min() > R - 1e-12
    if side == 0.0:
        cosine = (2 + speed**2 / (G * R)) / 3
        leaves = np.sqrt(G * R * cosine) * cosine * np.sqrt([0.5, 0.5])
        assert flight.trajectory.velocity[-1, 0, [0, 2]] == pytest.approx(leaves, rel=1e-5)


@pytest.mark.parametrize("wall", [False, True])
@pytest.mark.parametrize("share, over", [(0.5, False), (0.98, False), (1.02, True), (1.5, True)])
def test_over_a_ridge_or_back(share, over, wall):
    """Up a slope with a share of the speed with which it gets over the ridge: around that and down the other slope, or back."""
    angle = 0.2
    down, normal = np.array([np.cos(angle), -np.sin(angle), 0]), np.array([np.sin(angle), np.cos(angle), 0])
    left, mirror = strip((0, 0, -3), (0, 0, 3), -2 * down * [1, -1, 1]), np.array([-1, 1, 1])
    roof = Triangles(
        np.concatenate([left.vertices, strip((0, 0, 3), (0, 0, -3), 2 * down).vertices]),
        np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]),
    )
    begin = mirror * (R * normal + 0.001 * down)
    rise = R - begin[1]
    speed = share * np.sqrt(2 * G * rise)
    surfaces = {"roof": roof, **({"wall": Plane(normal=(0, 0, 1))} if wall else {})}
    gravity = (0, -G, -2) if wall else (0, -G, 0)
    flight = simulated(surfaces, begin + (0, 0, R), 1.0, -speed * mirror * down, gravity, every=0.01)
    x, moves = flight.trajectory.position[:, 0], energy(flight, gravity=gravity)
    assert (x[-1, 0] > 0) == over and flight.penetrations == 0
    assert np.abs(x[-1] @ (normal if over else mirror * normal) - R) < 1e-12
    assert np.abs(x[:, 2] - R).max() < 1e-15
    assert np.abs(moves - moves[0]).max() < 1e-11 * G * R


WEDGE = {"left": Plane(normal=(1, 1.3, 0)), "right": Plane(normal=(-0.7, 1, 0))}
CORNER = {"room": Box(center=(1, 1, 1), size=(2, 2, 2), inside=True)}
TILTED = Scene(gravity=(-3, -9.8, -2)).gravity


def lowest():
    """The place of a ball in the WEDGE: R from both planes."""
    a = np.array([[1, 1.3], [-0.7, 1]])
    return np.linalg.solve(a, R * np.linalg.norm(a, axis=1))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("damping", [0.0, 0.05])
@pytest.mark.parametrize("e", [0.0, 1 / 3, 0.9])
def test_in_a_wedge(method, e, damping):
    """With friction it is held where it came to rest; without it ends at the bottom, or still slides to and fro."""
    scene = Scene(surfaces=WEDGE, restitution=e, damping=damping)
    start = balls([(0, 1, 0), (0.1, 0.8, 0), (-0.3, 1, 0.0)], (0.2, 0, 0), lifetime=1e9)
    flight = swept(scene, start, method, 1e-3, duration=40.0, every=1.0)
    assert flight.penetrations == 0
    for normal in ((1, 1.3, 0), (-0.7, 1, 0)):
        heights = flight.trajectory.position @ np.divide(normal, np.linalg.norm(normal))
        assert heights.min() > R - 1e-12
    if damping:
        assert flight.status == "rested"
    else:
        assert np.abs(last(flight)[:, :2] - lowest()).max() < 1e-3
    if method == "exact":
        assert np.abs(flight.energy.residual).max() < 1e-11 * 3 * G


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("damping", [0.0, 0.05])
@pytest.mark.parametrize("e", [0.0, 1 / 3, 0.6])
def test_in_a_corner_of_three_walls(method, e, damping):
    scene = Scene(gravity=TILTED, surfaces=CORNER, restitution=e, damping=damping)
    rng = np.random.default_rng(1)
    start = balls(rng.uniform(0.3, 1.7, (10, 3)), rng.normal(0, 2, (10, 3)), lifetime=1e9)
    flight = swept(scene, start, method, 1e-3, duration=60.0, every=1.0)
    assert flight.penetrations == 0
    if damping:
        assert flight.status == "rested"  # each on a wall at least
        assert (np.abs(last(flight) - R).min(axis=1) < 1e-14).all()
    else:
        assert np.abs(last(flight) - R).max() < 1e-12
        assert flight.status == "rested"


@pytest.mark.parametrize("surfaces, gravity", [(WEDGE, (0, -G, 0)), (CORNER, TILTED)])
def test_an_elastic_ball_never_rests(surfaces, gravity):
    scene = Scene(gravity=gravity, surfaces=surfaces, **ELASTIC)
    start = balls([(0.3, 1, 0.5), (0.1, 1.2, 0.7)], (0.2, 0, 0), lifetime=1e9)
    flight = swept(scene, start, duration=1000.0)
    assert len(flight.rests) == 0 and flight.penetrations == 0 and len(flight.bounces) > 1000
    after, before = energy(flight, gravity=gravity)[[-1, 0]]
    assert np.abs(after - before).max() < 1e-11 * np.abs(before).max()  # some thousand bounces of 1e-15


@pytest.mark.parametrize("angle", [0.5, 0.1, 0.01, 0.001])
@pytest.mark.parametrize("impact", [0.3, 1e-3, 1e-6])
def test_an_elastic_ball_in_an_acute_wedge(angle, impact):
    """Unfolded its way is a straight line, and an impact where that crosses a multiple of the angle; `impact` is how near it
    comes to the apex of the wedge that its centre moves in."""
    other = np.array([np.sin(angle), -np.cos(angle), 0])
    apex = R / np.sin(angle / 2) * np.array([np.cos(angle / 2), np.sin(angle / 2), 0])
    scene = Scene(gravity=FREE, surfaces={"floor": Plane(), "lid": Plane(normal=tuple(other))}, **ELASTIC)
    begin = 0.4 * angle
    place = 2.0 * np.array([np.cos(begin), np.sin(begin)])
    # toward the apex but past it, turning to larger angles
    heading = begin + np.pi - np.arcsin(impact / 2)
    flight = swept(scene, balls(apex + [*place, 0], (np.cos(heading), np.sin(heading), 0)), duration=4.0)
    straight = place + 4.0 * np.array([np.cos(heading), np.sin(heading)])
    end = np.arctan2(straight[1], straight[0]) % (2 * np.pi)
    assert len(flight.bounces) == int(end / angle) and flight.penetrations == 0
    folded = end % angle if int(end / angle) % 2 == 0 else angle - end % angle
    wanted = apex[:2] + np.linalg.norm(straight) * np.array([np.cos(folded), np.sin(folded)])
    # the apex, at 2 R/angle, is known as well as the angle is, 1e-16; and pi/angle impacts turn the velocity by as much each
    tolerance = 1e-14 / angle + 1e-15 / angle**2
    assert np.abs(last(flight)[0, :2] - wanted).max() < tolerance
    assert np.linalg.norm(flight.trajectory.velocity[-1, 0]) == pytest.approx(1, abs=3e-15 / angle)


@pytest.mark.parametrize("e", [0.0, 0.3, 0.99])
def test_a_wedge_without_gravity_ends(e):
    """Many impacts that lose speed across and keep it along; nothing may hang."""
    other = np.array([np.sin(0.01), -np.cos(0.01), 0])
    scene = Scene(gravity=FREE, surfaces={"floor": Plane(), "lid": Plane(normal=tuple(other))}, restitution=e, damping=0.0)
    flight = swept(scene, balls((14.0, 0.07, 0), (-1, 0.01, 0)), duration=10.0)
    assert flight.penetrations == 0 and flight.status in ("finished", "rested")


HILLS = Heightfield(size=(2, 2), cells=(6, 5), height="0.2*sin(4*x)*cos(3*z)")
HALL = Box(center=(0, 0.9, 0), size=(1.9, 2.2, 1.9), inside=True)


def dropped(seed, low, high):
    """Twelve balls between two places."""
    return balls(np.random.default_rng(seed).uniform(low, high, (12, 3)), FREE, lifetime=1e9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("damping", [0.0, 0.05])
@pytest.mark.parametrize("e", [0.0, 0.5, 0.95])
def test_on_hills(method, e, damping):
    """Faces, ridges and valleys of a heightfield in a room: sliding from one to the next, and over edges."""
    room, start = HALL, dropped(3, (-0.8, 0.4, -0.8), (0.8, 1.5, 0.8))
    scene = Scene(surfaces={"hills": HILLS, "room": room}, restitution=e, damping=damping)
    flight = swept(scene, start, method, 2e-3, duration=20.0, every=0.5)
    assert flight.penetrations == 0 and flight.status in ("finished", "rested")
    inside = last(flight) - room.center
    assert (np.abs(inside) <= np.array(room.size) / 2 - R + 1e-12).all()
    if damping and (method in FINE or e < 0.6):  # a hop of Euler's has a least length, more than the step for such e
        assert flight.resting == 12
    if method in FINE:
        assert np.diff(flight.energy.kinetic + flight.energy.potential).max() < 1e-11 * 12 * G
        assert np.abs(flight.energy.residual).max() < 1e-9 * 12 * G


@pytest.mark.parametrize("method", FIRST_ORDER)
@pytest.mark.parametrize("speed", [0.75, 0.78, 0.9, 1.05, 1.3])
def test_over_an_edge_to_first_order(method, speed):
    """It flies off where v^2/r > g, at 0.77 m/s. The curve of a step may start with 2 g, and would take it back up to 1.08 m/s."""
    scene, start = Scene(surfaces=TABLE, restitution=0.5, damping=0.0), balls((0.99, 1 + R, 0), (speed, 0, 0), lifetime=99)
    duration = 0.01 / speed + 0.3
    exact = swept(scene, start, duration=duration)
    for step in (1e-2, 1e-3, 1e-4):
        flight = swept(scene, start, method, step, duration)
        assert flight.penetrations == 0 and len(flight.bounces) <= 2 and len(flight.rests) <= 2
        # in a fall of t its place is off by g t h/2 = 1.5 h, twice that where a step begins before the edge, and its energy by
        # that times g
        assert np.abs(last(flight) - last(exact)).max() < 3 * step
        assert abs(energy(flight)[-1, 0] - energy(flight)[0, 0]) < 1.6 * G * step


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("step", [2e-3, 1e-2, 0.05])
def test_no_flight_stalls_over_edges(method, step):
    """Without damping, on hills and among plates and blocks: 12 balls slide off edges and around them, at any speed."""
    plates = {f"plate{k}": Rectangle((0.3 * k - 0.6, -0.15 * k, 0), (0.2, 1, 0.1 * k), (0.5, 0.9)) for k in range(4)}
    block = Box(center=(0.3, -0.6, -0.3), size=(0.6, 0.5, 0.7))
    yard = Box(center=(0, 0, 0), size=(2.2, 2.4, 2.2), inside=True)
    for surfaces, start in (
        ({"hills": HILLS, "room": HALL}, dropped(4, (-0.8, 0.4, -0.8), (0.8, 1.5, 0.8))),
        (plates | {"block": block, "room": yard}, dropped(5, (-0.8, 0.5, -0.6), (0.8, 1.0, 0.6))),
    ):
        for e in (0.0, 0.5, 0.95):
            flight = swept(Scene(surfaces=surfaces, restitution=e, damping=0.0), start, method, step, duration=3.0, every=0.5)
            assert flight.penetrations == 0 and flight.status in ("finished", "rested")
            if method in FINE:
                assert np.abs(flight.energy.residual).max() < 1e-9 * 12 * G


def test_rest_on_triangles_turned_any_way():
    """A slide down a slope of many triangles in one plane is one slide."""
    plane = [Rectangle(center=(x, 0, z), normal=(0, 1, 0), size=(1, 1)) for x in range(-2, 3) for z in range(-2, 3)]
    turn = rotation(3)
    scene = Scene(gravity=tuple(turn @ (2.0, -9.0, 1.0)), surfaces={"slope": moved(plane, turn)}, restitution=0.0, damping=0.0)
    flight = swept(scene, balls(turn @ (-1.5, R, -1.5), FREE), duration=1.5)
    wanted = turn @ (-1.5 + 2.0 * 1.5**2 / 2, R, -1.5 + 1.0 * 1.5**2 / 2)
    assert np.abs(last(flight)[0] - wanted).max() < 1e-13 and len(flight.rests) == 1


@pytest.mark.parametrize("angle", [1e-5, 1e-3, 0.05, 1.0])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_an_impact_in_a_flat_valley_is_along_the_face_that_the_ball_stays_on(angle, e):
    """To reach the other face is to leave this one by no more than rounding; else it would be hit again at once, without end."""
    floor, wall = (0.0, 1.0, 0.0), (-np.sin(angle), np.cos(angle), 0.0)
    contacts = rest.add(rest.no_contacts(), 0, floor, False)
    v = rest.turned_back((0.3, 0.0, 0.4), wall, e, contacts)
    assert np.allclose(v, (-e * 0.3, 0.0, 0.4), rtol=0, atol=1e-15 / angle)  # as the wall's slope is known
    assert rest.turned_back((-0.3, 0.0, 0.4), wall, e, contacts) == (-0.3, 0.0, 0.4)  # on its way out
