"""The tree only spares work: it finds whatever looking at every box finds."""

import numpy as np
import pytest

import sim.walk
from sim import jit, reduction
from sim.inside import distances
from sim.shapes import Box, Heightfield, Rectangle, Triangles
from sim.tree import ANY, NORMAL, ROWS, WIDE, build, overlapping
from sim.walk import ABREAST, along, cast, distance, enter, meet, onward, search_room, sieve
from tests.sim.helpers import CORRIDOR, LIFT, fly, moved, random_balls, room, rotation, soup

pytestmark = pytest.mark.filterwarnings("error")

STILL = (0.0, 0.0, 0.0)


def boxes(kind, n, rng):
    low = rng.uniform(-5, 5, (n, 3))
    size = rng.uniform(0, 2, (n, 3))
    if kind == "flat":
        size[np.arange(n), rng.integers(0, 3, n)] = 0
    if kind == "points":
        size[:] = 0
    if kind == "coincident":
        low[:], size[:] = low[0], size[0]
    if kind == "in a row":
        low[:, 1:], size[:] = 0, 0.1
    high = low + size
    return low, high


def search(tree, n, x, direction, reach=np.inf, margin=0.0, bend=STILL, compiled=True):
    """The items found, and for each from when to when."""
    room = search_room(n)
    path = tuple(tuple(map(float, part)) for part in (x, direction, bend))
    with np.errstate(invalid="ignore", over="ignore"):  # at the empty places of a group
        count = (jit.bind(along) if compiled else along)(tree, path, float(reach), 0.0, float(margin), room, 0)
    found = room.found[:count]
    return list(tree.items[found] if len(tree.items) else found), room.times[:count], room.until[:count]


def brute(low, high, x, direction, reach, margin=0.0):
    """The boxes that share a point with the segment, by the slabs."""
    low, high = low - margin, high + margin
    with np.errstate(all="ignore"):
        a, b = (low - x) / direction, (high - x) / direction
    still = direction == 0
    near = np.where(still, -np.inf, np.minimum(a, b))
    far = np.where(still, np.inf, np.maximum(a, b))
    outside = (still & ((x < low) | (x > high))).any(axis=1)
    return set(np.flatnonzero(~outside & (np.maximum(near.max(axis=1), 0) <= np.minimum(far.min(axis=1), reach))))


@pytest.mark.parametrize("kind", ["solid", "flat", "points", "coincident", "in a row"])
@pytest.mark.parametrize("n", [1, 2, WIDE, WIDE + 1, 33, 100])
def test_finds_all_that_brute_force_finds(kind, n):
    rng = np.random.default_rng(n)
    low, high = boxes(kind, n, rng)
    tree = build(low, high)
    hits = 0
    for k in range(100):
        x, direction = rng.uniform(-6, 6, 3), rng.normal(size=3)
        if k % 4 == 0:  # along the axes, from a corner: onto the very border of boxes
            x = low[k % n].copy()
            direction[rng.integers(0, 3)] = 0.0
        if k % 8 == 0:
            direction = np.eye(3)[rng.integers(0, 3)] * rng.choice([-1, 1])
        if k % 4 == 1:  # at a box
            direction = (low[k % n] + high[k % n]) / 2 - x
        reach = rng.choice([np.inf, 1.0, 7.0])
        margin = rng.choice([0.0, 0.3])
        found, _, _ = search(tree, n, x, direction, reach, margin)
        assert len(found) == len(set(found))
        expected = brute(low, high, x, direction, reach, margin)
        assert expected <= set(found)
        hits += len(expected)
    assert hits >= 20


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_finds_what_a_parabola_meets_and_when(axis):
    """Against the path at many times: whenever it is within the margin of a box, the box is found and that time is in its span;
    and seldom is a box found that it does not meet."""
    rng = np.random.default_rng(axis)
    found_in_all, met_in_all = 0, 0
    for _ in range(30):
        low, high = boxes("solid", 500, rng)
        x, v, bend = rng.uniform(-6, 6, 3), rng.normal(0, 4, 3), np.zeros(3)
        bend[axis] = rng.normal(0, 10)
        v[(axis + 1) % 3] *= rng.choice([0, 1])
        margin, reach = rng.choice([0.0, 0.3]), 1.5
        found, since, until = search(build(low, high), 500, x, v, reach, margin, bend)
        t = np.linspace(0, reach, 5001)[:, None]
        path = (x + v * t + bend * t**2 / 2)[:, None]
        inside = ((path >= low - margin) & (path <= high + margin)).all(axis=2)
        met = np.flatnonzero(inside.any(axis=0))
        assert set(met) <= set(found)
        for item, begin, end in zip(found, since, until):
            times = t[inside[:, item], 0]
            assert len(times) == 0 or (begin <= times[0] and times[-1] <= end)
        found_in_all, met_in_all = found_in_all + len(found), met_in_all + len(met)
    assert met_in_all > 100 and found_in_all < 1.02 * met_in_all  # those met between two of the times


def test_what_comes_first_is_found_first():
    """In a row of boxes, given in any order, those far beyond the reach of the search are never looked at, though it only
    shrinks on the way."""
    n = 4096
    low = np.outer(np.random.default_rng(0).permutation(n), (1.0, 0.0, 0.0))
    tree, room = build(low, low + 0.5), search_room(n)
    with np.errstate(invalid="ignore"):
        ray, top = cast(((-1.0, 0.2, 0.2), (1.0, 0.0, 0.0), STILL), 1e4, 0.0, 0.0, False, tree.extent), enter(tree, room, 1.0)
        top, count = onward(tree, ray, 1e4, room, top, 0)
        nearest = room.times[:count].min()
        assert 1.0 - 5e-6 <= nearest <= 1.0  # in single precision, and not too late
        while top > 0:
            top, count = onward(tree, ray, nearest, room, top, count)
    assert count <= ABREAST * WIDE


@pytest.mark.parametrize("n", [WIDE + 1, 300])  # so that groups have empty places
@pytest.mark.parametrize("bad", [np.inf, -np.inf, np.nan, 1e300])
def test_a_ball_that_has_diverged_meets_nothing(n, bad):
    """In plain Python, which tells where a search is led out of the tree."""
    tree, x, way = build(*boxes("any", n, np.random.default_rng(5))), (0.1, 0.2, 0.3), (1.0, 0.5, 0.2)
    assert len(search(tree, n, x, way, margin=3.0, compiled=False)[0]) > 0
    for k in range(3):
        wrong = [tuple(bad if j == k else c for j, c in enumerate(vector)) for vector in (x, way, STILL)]
        for given in ((wrong[0], way), (x, wrong[1])):
            assert len(search(tree, n, *given, compiled=False)[0]) == 0
        assert len(search(tree, n, x, way, 1.0, bend=wrong[2], compiled=False)[0]) == 0
        with np.errstate(invalid="ignore", over="ignore"):
            assert distance(tree, wrong[0], 2.0, search_room(n)) == 2.0
    assert len(search(tree, n, x, way, margin=abs(bad), compiled=False)[0]) == 0


def test_every_box_is_in_the_tree_once():
    for n in range(1, 70):
        low, high = boxes("solid", n, np.random.default_rng(n))
        assert sorted(build(low, high).items) == list(range(n))


def test_no_boxes_no_tree():
    tree = build(np.zeros((0, 3)), np.zeros((0, 3)))
    assert len(tree.items) == 0
    assert search(tree, 3, STILL, (1.0, 0.0, 0.0))[0] == [0, 1, 2]


@pytest.mark.parametrize("n", [WIDE**k + 1 for k in range(1, 4)])
def test_a_search_looks_at_few_groups(n, monkeypatch):
    """In a row of boxes, given in any order. One more than a full tree holds adds a level: a ray near the end of the row must not
    walk the empty places."""
    low = np.outer(np.random.default_rng(0).permutation(n), (1.0, 0.0, 0.0))
    tree = build(low, low + 0.5)
    for x in (0.2, n // 2 + 0.2, n - 0.8):
        asked = []
        monkeypatch.setattr(sim.walk, "meet", lambda *args: (asked.append(args[1]), meet(*args)))
        found, _, _ = search(tree, n, (x, -1.0, -1.0), (0.01, 0.8, 0.6), compiled=False)
        assert 1 <= len(found) <= 3
        # a group a level on the way down, plus some neighbours
        assert 0 < len(asked) <= 3 * (len(tree.level) - 1)


def test_a_search_in_a_grid_looks_at_few_nodes():
    """Neighbours in any direction are neighbours in the tree."""
    low = np.stack(np.meshgrid(*[np.arange(12.0)] * 3), axis=-1).reshape(-1, 3)
    tree = build(low, low + 0.5)
    query, item = overlapping(tree, low + 0.1, low + 0.4)
    # a leaf each, and often some of the next: a box is not a power of two wide here
    assert set(zip(query[query == item], item[query == item])) == {(i, i) for i in range(len(low))}
    assert len(item) < 4 * len(low)


@pytest.mark.parametrize("selective", [False, True])
def test_a_scene_flies_the_same_with_and_without(monkeypatch, selective):
    forces = {"corridor": CORRIDOR, "lift": LIFT} if selective else {}
    start = random_balls(9, 80, released=0.0173 * np.arange(80), radius=0.1)
    flights = {}
    for few in (0, 10**6):
        monkeypatch.setattr(reduction, "FEW", few)
        for many in (False, True):
            flights[few, many] = fly(room(many, forces=forces), start, step=0.02, duration=2.0)
    for many in (False, True):
        tree, none = flights[0, many], flights[10**6, many]
        assert len(tree.bounces) > 300 and tree.penetrations > 5
        assert np.array_equal(tree.bounces, none.bounces)
        assert np.array_equal(tree.trajectory.position, none.trajectory.position, equal_nan=True)
        assert np.array_equal(tree.trajectory.velocity, none.trajectory.velocity, equal_nan=True)
        assert tree.penetrations == none.penetrations


def test_few_faces_need_no_tree():
    """The scenes above are on either side of the border."""
    for many in (False, True):
        features, _ = reduction.features(list(room(many).surfaces.values()), np.zeros((0, 3)), edges=False)
        assert (len(features.tree.items) > 0) == many


def test_a_margin_is_around_each_box():
    tree = build(np.zeros((1, 3)), np.ones((1, 3)))
    for distance, margin, found in ((0.5, 0.0, []), (0.5, 0.4, []), (0.5, 0.6, [0])):
        assert search(tree, 1, (-1.0, 1 + distance, 0.5), (1.0, 0.0, 0.0), margin=margin)[0] == found


@pytest.mark.parametrize("kind", ["solid", "flat", "points", "coincident", "in a row"])
@pytest.mark.parametrize("n", [1, WIDE + 1, 33, 100])
def test_overlapping_finds_all_that_brute_force_finds(kind, n):
    rng = np.random.default_rng(n)
    low, high = boxes(kind, n, rng)
    at = rng.uniform(-6, 6, (50, 3))
    at[:10] = high[rng.integers(0, n, 10)]  # touching at a corner
    to = at + rng.uniform(0, 3, (50, 3))
    to[10:20, 0] = np.inf
    query, item = overlapping(build(low, high), at, to)
    pairs = set(zip(query, item))
    assert len(pairs) == len(query)
    meet = ((low <= to[:, None]) & (at[:, None] <= high)).all(axis=2)
    assert 0 < meet.sum() and set(zip(*np.nonzero(meet))) <= pairs


def test_overlapping_looks_at_few():
    low = np.outer(np.random.default_rng(0).permutation(1000), (1.0, 0.0, 0.0))
    query, item = overlapping(build(low, low + 0.5), np.zeros((3, 3)), np.ones((3, 3)))
    assert len(item) <= 3 * 2
    assert all(len(a) == 0 for a in overlapping(build(low[:0], low[:0]), np.zeros((3, 3)), np.ones((3, 3))))


SPAR = Rectangle((0, 0, 0), (0.3, 1.0, 0.2), (4000.0, 0.01))  # far longer than it is away


@pytest.mark.parametrize("shape", [Heightfield((4, 4), (15, 15), "0.5*sin(2*x)*cos(3*z)"), SPAR], ids=["hills", "spar"])
@pytest.mark.parametrize("far", [0.0, 1e3])
def test_nothing_is_nearer_than_the_distance_says(monkeypatch, shape, far):
    """Against the distance to each face, near and far from the origin; and of small faces it is not much less than that."""
    monkeypatch.setattr(reduction, "FEW", 0)
    features, _ = reduction.features([moved(shape, np.eye(3), np.full(3, far))], np.zeros((0, 3)))
    rng, room, shares = np.random.default_rng(1), search_room(len(features.faces.axis) + len(features.edges.length)), []
    faces = np.arange(len(features.faces.axis))
    for _ in range(300):
        x = far + rng.uniform(-2, 2, 3) * (1, rng.choice([0.1, 1.0]), 1)
        nearest = distances(features.faces, faces, np.broadcast_to(x, (len(faces), 3))).min()
        for reach in (10.0, 0.2):
            least = jit.bind(distance)(features.tree, tuple(map(float, x)), reach, room)
            assert least <= min(nearest, reach)
            shares.append(least / min(nearest, reach))
    if shape is not SPAR:  # of small items a box and a plane tell most of it
        assert np.mean(shares) > 0.8


HILLS = Heightfield((4, 4), (40, 40), "0.2*sin(2*x)*cos(3*z)")


@pytest.mark.parametrize("shape", [HILLS, soup(5, 200), Box((0, 0, 0), (1, 2, 3))], ids=["hills", "litter", "box"])
def test_lids_are_over_all_that_is_under_them(monkeypatch, shape):
    """Its corners are no higher, and a ball touches it in a direction that is no farther from the lid's normal, or its opposite."""
    monkeypatch.setattr(reduction, "FEW", 0)
    features, _ = reduction.features([shape], np.zeros((0, 3)))
    faces, edges, tree = features.faces, features.edges, features.tree
    n, rows = len(faces.axis), tree.groups.reshape(-1, ROWS, WIDE)
    planes = np.moveaxis(rows[tree.level[1] : tree.level[2], NORMAL:], 1, 2).reshape(-1, 5).astype(float)
    known = 0
    for k, (*normal, offset, sine) in enumerate(planes[: tree.level[1]]):
        assert np.linalg.norm(normal) == pytest.approx(1, abs=1e-6)
        for item in tree.items[WIDE * k : WIDE * (k + 1)]:
            if item < n:
                square, spread, axis = faces.normal[item], 0.0, faces.axis[item]
                u, v = (axis + 1) % 3, (axis + 2) % 3
                outline = faces.outline[faces.first[item] : faces.first[item + 1]]
                corners = np.tile(faces.point[item], (len(outline), 1))
                corners[:, [u, v]] = outline[:, :2]
                corners[:, axis] -= (corners - faces.point[item]) @ square / square[axis]
            else:
                e = item - n
                corners = edges.start[e] + np.outer((0.0, edges.length[e]), edges.along[e])
                square, spread = edges.normal[e], edges.spread[e]
            assert (corners @ normal <= offset + 1e-5).all()  # coordinates of some metres, in single precision
            if sine < ANY:
                assert spread <= 1 and np.arcsin(sine) >= np.arccos(min(abs(square @ normal), 1.0)) + np.arcsin(spread)
                known += 1
    assert known > 0.8 * len(tree.items) or shape is not HILLS  # but at the rim


def test_a_ball_that_leaves_hills_looks_at_few_of_their_faces(monkeypatch):
    """What is around a ball that bounces off gentle hills is mostly under lids from which it flies away."""
    monkeypatch.setattr(reduction, "FEW", 0)
    features, _ = reduction.features([HILLS], np.zeros((0, 3)))
    rng, tree, lids, flights = np.random.default_rng(2), features.tree, [], 50
    monkeypatch.setattr(sim.walk, "sieve", lambda *args: (lids.append(args[4]), sieve(*args)))
    place, normal = features.faces.point, features.faces.normal
    for f in rng.choice(np.flatnonzero((abs(place[:, [0, 2]]) < 1.8).all(axis=1)), flights):
        path = tuple(tuple(part) for part in (place[f] + 0.05 * normal[f], 3 * normal[f], (0.0, -9.81, 0.0)))
        room, ray = search_room(len(tree.items)), cast(path, 0.1, 0.05, 0.0, False, tree.extent)
        top, count = enter(tree, room, 1.0), 0
        with np.errstate(invalid="ignore", over="ignore"):
            while top > 0:
                top, count = onward(tree, ray, 0.1, room, top, count)
        assert count <= WIDE
    assert lids.count(True) >= flights > 5 * lids.count(False)


def test_an_edge_lies_in_its_plane_all_along():
    """The ridge of a roof, where it passes the origin, though its ends are far away and a normal in single precision is not quite
    across it."""
    ridge, down = 2e3 * rotation(4)[0], rotation(4)[1:]
    roof = Triangles(np.array([-ridge, ridge, *down]), np.array([[0, 1, 2], [1, 0, 3]]))
    features, _ = reduction.features([roof], np.zeros((0, 3)))
    edges, n = features.edges, len(features.faces.axis)
    (e,) = np.flatnonzero(edges.length > 3e3)
    plane = reduction._planes(features.faces, edges)[n + e].astype(float)
    nearest = edges.start[e] - edges.start[e] @ edges.along[e] * edges.along[e]
    assert np.linalg.norm(plane[:3]) == pytest.approx(1, abs=1e-6)
    # coordinates of kilometres, in double precision: a hundred thousandth of what a normal in single precision makes of them
    assert abs(plane[:3] @ nearest - plane[3]) <= 4e3 * 8 * np.finfo(float).eps
