"""The tree only spares work: it finds whatever looking at every box finds."""

import numpy as np
import pytest

from sim import geometry, jit, lanes
from sim.tree import LEAF, along, build, passes
from tests.sim.helpers import CORRIDOR, LIFT, fly, random_balls, room

pytestmark = pytest.mark.filterwarnings("error")


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
    if kind == "with planes":
        low[::3], high[::3] = -np.inf, np.inf
    return low, high


def search(tree, n, x, direction, reach=np.inf):
    found = np.full(n, -1)
    with np.errstate(all="ignore"):  # unbounded boxes, in plain Python
        count = along(tree, tuple(x), tuple(direction), reach, found)
    return list(found[:count])


def brute(low, high, x, direction, reach):
    """The boxes that share a point with the segment, by the slabs."""
    with np.errstate(all="ignore"):
        a, b = (low - x) / direction, (high - x) / direction
    still = direction == 0
    near = np.where(still, -np.inf, np.minimum(a, b))
    far = np.where(still, np.inf, np.maximum(a, b))
    outside = (still & ((x < low) | (x > high))).any(axis=1)
    return set(np.flatnonzero(~outside & (np.maximum(near.max(axis=1), 0) <= np.minimum(far.min(axis=1), reach))))


@pytest.mark.parametrize("kind", ["solid", "flat", "points", "coincident", "in a row", "with planes"])
@pytest.mark.parametrize("n", [1, 2, LEAF, LEAF + 1, 33, 100])
def test_finds_all_that_brute_force_finds(kind, n):
    rng = np.random.default_rng(n)
    low, high = boxes(kind, n, rng)
    tree = build(low, high)
    hits = 0
    for k in range(100):
        x, direction = rng.uniform(-6, 6, 3), rng.normal(size=3)
        if k % 4 == 0:  # along the axes, from a corner: onto the very border of boxes
            x = np.where(np.isfinite(low[k % n]), low[k % n], x)
            direction[rng.integers(0, 3)] = 0.0
        if k % 8 == 0:
            direction = np.eye(3)[rng.integers(0, 3)] * rng.choice([-1, 1])
        if k % 4 == 1 and np.isfinite(low[k % n]).all():  # at a box
            direction = (low[k % n] + high[k % n]) / 2 - x
        reach = rng.choice([np.inf, 1.0, 7.0])
        found = search(tree, n, x, direction, reach)
        assert len(found) == len(set(found))
        expected = brute(low, high, x, direction, reach)
        assert expected <= set(found)
        hits += len(expected)
    assert hits >= 20


def test_every_box_is_in_the_tree_once():
    for n in range(1, 70):
        low, high = boxes("solid", n, np.random.default_rng(n))
        items = build(low, high).items
        assert sorted(items[items >= 0]) == list(range(n))


def test_no_boxes_no_tree():
    tree = build(np.zeros((0, 3)), np.zeros((0, 3)))
    assert len(tree.items) == 0
    found = np.arange(3)
    assert along(tree, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0, found) == 3 and list(found) == [0, 1, 2]


@pytest.mark.parametrize("n", [LEAF * 2**k + 1 for k in range(3, 9)])
def test_a_search_looks_at_few_nodes(n):
    """In a row of boxes, given in any order. One more than a full tree holds doubles the leaves: a ray near the end of
    the row must not walk the empty ones."""
    visited = []

    def counted(tree, node, *ray):
        visited.append(node)
        return passes(tree, node, *ray)

    walk = jit.bind(along, compiled=False, passes=counted)
    low = np.outer(np.random.default_rng(0).permutation(n), (1.0, 0.0, 0.0))
    tree = build(low, low + 0.5)
    for x in (0.2, n / 2 + 0.2, n - 0.8):
        visited.clear()
        count = walk(tree, (x, -1.0, -1.0), (0.01, 0.8, 0.6), np.inf, np.empty(n, int))
        assert 1 <= count <= 3 * LEAF
        # two children a level on the way down, plus some neighbours
        assert len(visited) <= 4 * np.log2(n)


@pytest.mark.parametrize("selective", [False, True])
def test_a_scene_flies_the_same_with_and_without(monkeypatch, selective):
    forces = {"corridor": CORRIDOR, "lift": LIFT} if selective else {}
    start = random_balls(9, 80, released=0.0173 * np.arange(80), radius=0.1)
    flights = {}
    for few in (0, 10**6):
        for module in (geometry, lanes):
            monkeypatch.setattr(module, "FEW", few)
        for many in (False, True):
            flights[few, many] = fly(room(many, forces=forces), start, step=0.02, duration=2.0)
    for many in (False, True):
        tree, none = flights[0, many], flights[10**6, many]
        assert len(tree.bounces) > 300 and tree.penetrations > 5
        assert np.array_equal(tree.bounces, none.bounces)
        assert np.array_equal(tree.trajectory.position, none.trajectory.position, equal_nan=True)
        assert np.array_equal(tree.trajectory.velocity, none.trajectory.velocity, equal_nan=True)
        assert tree.penetrations == none.penetrations


def test_few_facets_need_no_tree():
    """The scenes above are on either side of the border."""
    assert len(geometry.gather([s.facets() for s in room(False).surfaces.values()])[1].items) == 0
    assert len(geometry.gather([s.facets() for s in room(True).surfaces.values()])[1].items) > 0
