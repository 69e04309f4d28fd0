"""How long a ball is free: no longer than it is, however it is pushed meanwhile, and long enough to be of use."""

import itertools

import numpy as np
import pytest

from sim import jit
from sim.clearance import FEW, free_time, off_face
from sim.engines import CURVE, of_module
from sim.first_touch import first_touch
from sim.packed import NORMAL, POINT, axis_of, facing, pack
from sim.reduction import features
from sim.rest import no_contacts
from sim.shapes import Box, Plane
from sim.touch import NONE
from sim.walk import search_room
from tests.sim.helpers import soup

RADIUS, LOOK = 0.06, 0.5  # m
SURFACES = {
    "plates": lambda seed: [soup(seed, 5)],
    "block": lambda seed: [Box((0, 0, 0), (0.7, 0.5, 0.9)), Plane((0, -1, 0), (0.1, 1, 0.2))],
    "litter": lambda seed: [soup(seed, 30)],  # in a tree
}
touch = jit.bind(first_touch, **of_module("curves.parabola", CURVE))


def first(packed, room, x, v, a, end):
    """The item that a ball at x with velocity v touches first under the acceleration a, and when."""
    curve = tuple(map(tuple, (x.tolist(), v.tolist(), a.tolist())))
    return touch(curve, packed, room, RADIUS, float(end), no_contacts(), NONE)[:2]


@pytest.mark.parametrize("name", SURFACES)
def test_nothing_is_touched_while_a_ball_is_free(name):
    free, rng, told = jit.bind(free_time), np.random.default_rng(2), []
    for seed in range(40):
        packed = pack(features(SURFACES[name](seed), np.zeros((0, 3)), edges=True)[0])
        room = search_room(len(packed.faces) + len(packed.edges))
        for _ in range(15):
            # somewhere on the way to a touch, or just thrown back by it
            x, push = rng.uniform(-1.5, 1.5, 3), 10.0 ** rng.uniform(-2, 1.5, 3)
            v = 3 * (packed.faces[rng.integers(len(packed.faces)), POINT : POINT + 3] - x) + 0.5 * rng.normal(size=3)
            item, s = first(packed, room, x, v, np.zeros(3), 5.0)
            if item != NONE and s > 0.0:
                share = rng.choice([rng.uniform(), 1 - 10.0 ** rng.uniform(-6, -1), 1.0])
                x = x + share * s * v
                if share == 1.0:
                    n = np.array(facing(packed, item, tuple(x)))
                    v = v - (1 + rng.uniform()) * (v @ n) * n
                time = free(packed, room, tuple(x.tolist()), tuple(v.tolist()), tuple(push.tolist()), RADIUS, LOOK)
                told.append(time)
                for signs in itertools.product((-1.0, 0.0, 1.0), repeat=3):
                    found, when = first(packed, room, x, v, push * signs, time)
                    assert found == NONE, (seed, time, when)
    assert len(told) > 100 and np.mean(np.array(told) > 0.01) > (0.1 if len(packed.tree.items) > FEW else 0.4)


def test_a_foot_stays_beside_a_face_that_long():
    """Edges mostly tell sooner that a ball comes to a face, so what tells of the face is asked by itself."""
    off, rng, told = jit.bind(off_face), np.random.default_rng(3), 0
    for seed in range(200):
        packed = pack(features([soup(seed, 1)], np.zeros((0, 3)), edges=True)[0])
        n, p = packed.faces[0, NORMAL : NORMAL + 3], packed.faces[0, POINT : POINT + 3]
        corners = packed.outline[1:, :2]
        which = (int(axis_of(packed.faces, packed.outline, 0)) + np.array([1, 2])) % 3
        x, push = rng.uniform(-1.5, 1.5, 3), 10.0 ** rng.uniform(-2, 1.5, 3)
        v = 3 * (p - x) + rng.normal(size=3)
        time = off(packed, 0, tuple(x.tolist()), tuple(v.tolist()), tuple(push.tolist()), 1e-9)
        told += 0.01 < time < 10.0
        t = min(time, 10.0) * np.linspace(0, 1, 50)[:, None]
        for signs in itertools.product((-1.0, 1.0), repeat=3):
            path = x + t * v + t**2 / 2 * push * signs
            foot = (path - ((path - p) @ n)[:, None] * n)[:, which]
            assert time == 0.0 or ((foot < corners.min(axis=0)) | (foot > corners.max(axis=0))).any(axis=1).all()
    assert told > 100
