"""First touch: when a ball on a curve touches what first, against an oracle in many digits."""

import importlib
from functools import cache
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import trimesh

from sim import jit
from sim.curves import cubic, majorant, parabola
from sim.engines import CURVE
from sim.first_touch import first_touch
from sim.packed import ALONG, LENGTH, NORMAL, POINT, SIDES, START, Packed, axis_of, covers, pack, segments
from sim.reduction import NO_ROWS, features
from sim.rest import no_contacts
from sim.shapes import Box, Heightfield, Plane, Rectangle, Triangles
from sim.touch import NONE
from sim.tree import build
from sim.walk import search_room
from tests.sim import oracle
from tests.sim.helpers import FREE, soup

RADIUS, EPS = 0.06, np.finfo(float).eps
KINDS = "parabola", "oscillation", "cubic", "quintic", "quadratic"
POLYNOMIALS = {"parabola": 0, "quadratic": 0, "cubic": 1, "quintic": 3}  # coefficients from the third power on
STEPS = {"quadratic": parabola.as_quintic, "cubic": cubic.as_quintic}  # the curves of steps as the kernels of all methods see them


@cache
def kernel(kind):
    """`first_touch` as it is compiled for a curve."""
    own = vars(importlib.import_module(f"sim.curves.{'quintic' if kind in STEPS else kind}"))
    return jit.bind(first_touch, **{"fall": majorant.fall, "piece": majorant.chord} | {n: own[n] for n in CURVE if n in own})


class Case(NamedTuple):
    kind: str
    curve: tuple
    packed: Packed
    end: float

    def found(self):
        room = search_room(len(self.packed.faces) + len(self.packed.edges))
        curve = STEPS.get(self.kind, tuple)(self.curve)
        return kernel(self.kind)(curve, self.packed, room, RADIUS, self.end, no_contacts(), NONE)[:2]

    def expected(self):
        if self.kind == "oscillation":
            return oracle.touches_swinging(self.curve, self.packed, RADIUS, self.end)
        x, v, *rest = self.curve
        rest = [tuple(0.5 * c for c in rest[0])] if POLYNOMIALS[self.kind] == 0 else rest
        return oracle.touches([x, v, *rest], self.packed, RADIUS, self.end)


# Scenes.


def roof(angle):
    """Two triangles that meet at the z axis, with this angle (degrees) between their undersides."""
    x, y = np.sin(np.radians(angle / 2)), -np.cos(np.radians(angle / 2))
    vertices = np.array([(0, 0, -0.5), (0, 0, 0.6), (x, y, 0.1), (-x, y, -0.1)])
    return Triangles(vertices, np.array([[0, 1, 2], [1, 0, 3]]))


SCENES = {
    "plane": [Plane((0.1, -0.2, 0), (0.2, 1, -0.3))],
    "floor": [Plane()],
    "sheet": [Rectangle((0, 0.1, 0), (0.3, 1, 0.2), (1.1, 0.7))],
    "box": [Box((0.1, 0, 0), (0.9, 0.6, 0.7))],
    "room": [Box((0, 0, 0), (2, 1.5, 1.75), inside=True)],
    "knife": [roof(2.0)],
    "hill": [roof(178.0)],
    "needle": [Triangles(np.array([(0, 0, 0), (0.02, 0.8, 0), (0.01, 0.3, 0.6)]), np.array([[0, 1, 2]]))],
    "litter": [soup(1, 4)],
}


@cache
def scene(name, *origin) -> Packed:
    """The features of a scene, moved to `origin` (m) in the very numbers that are packed."""
    shapes = [_Moved(shape, np.array(origin)) for shape in SCENES[name]] if origin else SCENES[name]
    return pack(features(shapes, NO_ROWS)[0])


class _Moved:
    def __init__(self, shape, by):
        mesh = shape.mesh()
        self._mesh, self.two_sided, self.unbounded = mesh._replace(vertices=mesh.vertices + by), shape.two_sided, shape.unbounded

    def mesh(self):
        return self._mesh


# Flights, made from their touch backwards.


def unit(a):
    return a / np.linalg.norm(a)


def across(rng, n):
    """A random unit vector at a right angle to n."""
    return unit(np.cross(n, rng.normal(size=3)))


def curve_to(rng, kind, x, v, a, t):
    """The curve of this kind that after the time t (s) is at x (m) with the velocity v (m/s) and the acceleration a (m/s^2)."""
    if kind == "oscillation":
        which = rng.integers(4)
        w2 = [0.0, 10.0 ** rng.uniform(-3, 1), 10.0 ** rng.uniform(-3, 1), 4.0][which] / t**2
        b = [10.0 ** rng.uniform(-3, 0.5) / t, 0.0, 10.0 ** rng.uniform(-3, 0.5) / t, 2 * np.sqrt(w2)][which]
        p, q, dp = (float(c) for c in oracle.response(b, w2, t))
        c = a + b * v
        # the flow backwards: 0 = y0 (1 - w2 q) + v0 p + c q and v = -w2 p y0 + dp v0 + c p
        y0, v0 = np.linalg.solve([[1 - w2 * q, p], [-w2 * p, dp]], [-c * q, v - c * p])
        return tuple(map(tuple, ((x + y0).tolist(), v0.tolist(), (c - w2 * y0).tolist()))) + (b, w2)
    more = [0.3 * np.linalg.norm(v) / t ** (2 + k) * rng.normal(size=3) for k in range(POLYNOMIALS[kind])]
    c = 0.5 * a - sum((3 + k) * (2 + k) / 2 * t ** (1 + k) * d for k, d in enumerate(more))
    v0 = v - 2 * t * c - sum((3 + k) * t ** (2 + k) * d for k, d in enumerate(more))
    x0 = x - t * v0 - t**2 * c - sum(t ** (3 + k) * d for k, d in enumerate(more))
    rows = (x0, v0, 2 * c) if not more else (x0, v0, c, *more)
    return tuple(tuple(row.tolist()) for row in rows)


def others(rng, kind):
    """What a curve of this kind has besides position, velocity and acceleration."""
    if kind == "oscillation":
        return rng.uniform(0, 2), rng.uniform(0, 9)
    return tuple(tuple(rng.normal(size=3)) for _ in range(POLYNOMIALS[kind]))


def spot(rng, packed, edge=None, share=None):
    """A place (m) on a random face, or edge (at this share of it), and the unit normal there of a ball that touches it."""
    n, m = len(packed.faces), len(packed.edges)
    if edge is None:
        edge = rng.integers(n + m) >= n
    if not edge or m == 0:
        f = rng.integers(n)
        row, (first, last) = packed.faces[f], segments(packed.faces, packed.outline, f)
        point, normal = row[POINT : POINT + 3], row[NORMAL : NORMAL + 3]
        place, side = point + rng.uniform(-1, 1) * across(rng, normal), rng.choice([-1, 1]) if row[SIDES] > 1 else 1
        if first < last:
            a, b, c = (int(axis_of(packed.faces, packed.outline, f)) + k for k in (0, 1, 2))
            place[[b % 3, c % 3]] = rng.dirichlet(np.ones(last - first)) @ packed.outline[first:last, :2]
            place[a] -= normal @ (place - point) / normal[a]
        return place, side * normal
    row = packed.edges[rng.integers(m)]
    along = row[ALONG : ALONG + 3]
    share = rng.choice([0.0, 1.0, rng.uniform()]) if share is None else share
    place = row[START : START + 3] + share * row[LENGTH] * along
    ends = packed.edges[:, START : START + 3] + 0.5 * packed.edges[:, LENGTH : LENGTH + 1] * packed.edges[:, ALONG : ALONG + 3]
    out = place - ends.mean(axis=0) + 0.2 * rng.normal(size=3)
    sideways = unit(out - (out @ along) * along)
    if share == 0.0 or share == 1.0:
        return place, unit(sideways + rng.uniform(0, 1) * (2 * share - 1) * along)
    return place, sideways


def meeting(rng, kind, name, origin=(), edge=None, share=None, angle=None, depth=0.0, speed=None, time=None, pull=None, away=0.0):
    """A flight to a place of the scene where, after `time` (s), the ball has sunk in by `depth` (m), moving at `speed` (m/s) and
    an `angle` (rad) from straight down, accelerated by `pull` anywhere and by `away` from the surface (in speeds per time)."""
    packed = scene(name, *origin)
    place, normal = spot(rng, packed, edge, share)
    time = 10.0 ** rng.uniform(-1, 0.3) if time is None else time
    speed = 10.0 ** rng.uniform(-1, 1) if speed is None else speed
    angle = rng.uniform(0, 1.4) if angle is None else angle
    pull = rng.choice([0.0, 0.3]) if pull is None else pull
    v = speed * (np.sin(angle) * across(rng, normal) - np.cos(angle) * normal)
    a = speed / time * (pull * unit(rng.normal(size=3)) + away * normal)
    curve = curve_to(rng, kind, place + (RADIUS - depth) * normal, v, a, time)
    return Case(kind, curve, packed, time * rng.choice([1.5, 4.0]))


def overlaps(packed, x):
    """Whether a surface is in a ball at x, as none is at its release; where it sinks in more is no first touch. An edge may be by a
    little: the ball is told to touch it once it has been out."""
    off = x - packed.edges[:, START : START + 3]
    along, length = packed.edges[:, ALONG : ALONG + 3], packed.edges[:, LENGTH]
    off -= np.clip((off * along).sum(axis=1), 0, length)[:, None] * along
    if (np.linalg.norm(off, axis=1) < 0.999 * RADIUS).any():
        return True
    normal = packed.faces[:, NORMAL : NORMAL + 3]
    h = ((x - packed.faces[:, POINT : POINT + 3]) * normal).sum(axis=1)
    near = np.flatnonzero(abs(h) < RADIUS - 8 * EPS * oracle.size_of(packed, np.array(x), RADIUS))
    return any(covers(packed.faces, packed.outline, f, tuple(x - h[f] * normal[f])) for f in near)


def solid(rng):
    return rng.choice(["sheet", "box", "knife", "hill", "needle", "litter"])


def any_scene(rng):
    return rng.choice(list(SCENES))


def anywhere(rng, kind):
    v, a = rng.normal(0, 3, 3), rng.choice([0.0, 1.0, 9.81]) * unit(rng.normal(size=3))
    return Case(kind, curve_to(rng, kind, rng.uniform(-0.9, 0.9, 3), v, a, rng.uniform(0.1, 1)), scene(any_scene(rng)), 2.0)


def aimed(rng, kind):
    return meeting(rng, kind, any_scene(rng))


def graze(rng, kind):
    """Just touching, or just missing. 1e-10 of a radius is 6e-12 m; coordinates of 1 m are rounded by 1e-16."""
    depth = rng.choice([-1, 1]) * RADIUS * 10.0 ** rng.uniform(-10, -4)
    return meeting(rng, kind, solid(rng), angle=np.pi / 2, depth=depth, pull=0.0, away=rng.uniform(0.5, 3))


def straight_graze(rng, kind):
    """Past an edge or a corner."""
    depth = rng.choice([-1, 1]) * RADIUS * 10.0 ** rng.uniform(-10, -4)
    return meeting(rng, kind, solid(rng), edge=True, angle=np.pi / 2, depth=depth, pull=0.0)


def nearly_tangent(rng, kind):
    """Onto a surface all but along it."""
    return meeting(rng, kind, any_scene(rng), angle=np.pi / 2 - 10.0 ** rng.uniform(-5, -2), pull=0.0, away=rng.choice([0, 0.1]))


def into_corner(rng, kind):
    """Two or three walls of a room at the same time, to a rounding."""
    half = np.array([1.0, 0.75, 0.875]) - RADIUS
    corner = half * rng.choice([-1, 1], 3)
    if rng.integers(2):
        corner[rng.integers(3)] *= rng.uniform(-1, 1)
    v = rng.choice([1.0, rng.uniform(0.5, 1.5)]) * corner
    t = rng.uniform(0.1, 0.5)
    return Case(kind, curve_to(rng, kind, corner, v, rng.normal(size=3), t), scene("room"), 2.0)


def on_a_border(rng, kind):
    """Down on a face's border: face and edge at the same time, or nearly so."""
    packed = scene("sheet")
    row, normal = packed.edges[rng.integers(len(packed.edges))], packed.faces[0, NORMAL : NORMAL + 3]
    along = row[ALONG : ALONG + 3]
    beside = rng.choice([-1, 1]) * rng.choice([0.0, 10.0 ** rng.uniform(-13, -3)])
    place = row[START : START + 3] + rng.uniform(0.1, 0.9) * row[LENGTH] * along + beside * np.cross(along, normal)
    x, v, t = place + RADIUS * normal, rng.normal(size=3) - 4 * normal, rng.uniform(0.1, 0.5)
    return Case(kind, curve_to(rng, kind, x, v, rng.normal(size=3), t), packed, 2 * t)


def end_of_an_edge(rng, kind):
    share = rng.choice([0, 1]) + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-14, -2)
    return meeting(rng, kind, solid(rng), edge=True, share=share)


def any_speed(rng, kind):
    """1e-8 to 1e6 m/s, over some 0.3 m."""
    speed = 10.0 ** rng.uniform(-8, 6)
    return meeting(rng, kind, any_scene(rng), speed=speed, time=0.3 / speed)


def far(rng, kind):
    return meeting(rng, kind, any_scene(rng), tuple(10.0 ** rng.integers(3, 7) * rng.choice([-1, 1], 3)))


def beside_first(rng, kind):
    """From below, up beside a sheet, and down on it: its plane is crossed twice, and touched from the other side."""
    packed = scene("sheet")
    place, normal = spot(rng, packed, edge=False)
    v = -2 * normal + rng.uniform(1.5, 4) * across(rng, normal)
    return Case(kind, curve_to(rng, kind, place + RADIUS * normal, v, -8 * normal, rng.uniform(0.55, 0.9)), packed, 2.0)


def along_it(rng, kind):
    """Close to an edge and all but along it: staying a hair above, or coming in slowly."""
    packed = scene(rng.choice(["box", "knife", "hill"]))
    row = packed.edges[rng.integers(len(packed.edges))]
    along, (place, normal) = row[ALONG : ALONG + 3], spot(rng, packed, edge=True, share=0.5)
    height = 10.0 ** rng.uniform(-11, -3)
    v = rng.uniform(0.5, 3) * along - rng.choice([0.0, 10.0 ** rng.uniform(-9, -3)]) * normal
    a = rng.choice([0.0, 5.0]) * along
    return Case(kind, curve_to(rng, kind, place + (RADIUS + height) * normal, v, a, 0.1), packed, 0.5)


def around_it(rng, kind):
    """Close to an edge or corner and around it: as curved as the ball there, and on a spring from it in an ellipse, all the way."""
    packed = scene(solid(rng))
    place, normal = spot(rng, packed, edge=True)
    height, turn, time = RADIUS * 10.0 ** rng.uniform(-8, -3), rng.uniform(0.1, 3), 10.0 ** rng.uniform(-1, 1)
    x, v = place + (RADIUS + height) * normal, (RADIUS + height) * turn / time * across(rng, normal)
    if kind == "oscillation":
        v *= 1 - rng.choice([0.0, rng.uniform(0, 2)]) * height / RADIUS  # so that it comes down by as much
        b, w2 = rng.choice([0.0, height / time]), (turn / time) ** 2
        return Case(kind, (tuple(x), tuple(v), tuple(-b * v - w2 * (x - place)), b, w2), packed, 3 * time)
    a = -(v @ v) / (RADIUS + rng.choice([-1, 0, 1]) * height) * normal
    return Case(kind, curve_to(rng, kind, x, v, a, time), packed, 2 * time)


def from_contact(rng, kind):
    """The ball lies on a face or an edge at first: it leaves and comes back, or goes on into it."""
    place, normal = spot(rng, packed := scene(solid(rng)))
    v, a = rng.normal(size=3), 5 * rng.normal(size=3)
    return Case(kind, (tuple(place + RADIUS * normal), tuple(v), tuple(a), *others(rng, kind)), packed, 2.0)


def from_rest(rng, kind):
    """On the floor to the last digit: pressed on it, drawn off, or sliding along it."""
    lift = rng.choice([0.0, 1e-9, 1.0, -1e-9, -1.0])
    v = (rng.normal(), lift, rng.normal())
    a = (rng.normal(), rng.choice([-9.81, 9.81, -1e-3, 0.0]), rng.normal())
    return Case(kind, ((rng.normal(), RADIUS, rng.normal()), v, a, *others(rng, kind)), scene("floor"), 2.0)


#: Families, how many cases of each for a parabola, and whether their times are ill-conditioned.
FAMILIES = {
    anywhere: (1000, False),
    aimed: (1000, False),
    into_corner: (90, False),
    on_a_border: (90, False),
    end_of_an_edge: (90, False),
    any_speed: (90, False),
    beside_first: (90, False),
    from_contact: (90, False),
    from_rest: (90, False),
    graze: (120, True),
    straight_graze: (120, True),
    nearly_tangent: (90, True),
    far: (90, True),
    along_it: (150, True),
    around_it: (150, True),
}


def wrong(case, ill) -> str | None:
    """What is wrong about the first touch that is found."""
    (item, s), expected = case.found(), case.expected()
    first = next((touch for touch in expected if touch.sure), None)
    if item == NONE:
        return f"{first} missed" if first else None
    size = oracle.size_of(case.packed, np.array(case.curve[0]), RADIUS)

    def off(touch):
        """The error in tolerances: 1e-10 of the time, or 1e-12 s."""
        error, least = abs(s - touch.time), max(1e-10 * touch.time, 1e-12)
        # The gap is known to some roundings of the coordinates it is made of, and the time to that divided by the speed at
        # which it closes. So it is far off, or for a graze, which is slow.
        return min(error / least, error * touch.speed / (16 * EPS * size) if ill else np.inf)

    mine = [touch for touch in expected if touch.item == item and off(touch) <= 1]
    if not mine:
        return f"found {item} at {s}, not one of {expected[:3]}"
    # one that is only just beside an outline may be left out, but one that is there for sure may not
    return f"found {mine[0]}, after {first}" if first and off(first) > 1 and first.time < s else None


def check(family, kind, n, seed):
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    drawn = (family(rng, kind) for _ in iter(int, 1))
    cases = islice((case for case in drawn if not overlaps(case.packed, case.curve[0])), n)
    faults = {k: fault for k, case in enumerate(cases) if (fault := wrong(case, FAMILIES[family][1]))}
    assert not faults, f"{len(faults)} of {n}, first number {next(iter(faults.items()))}"


FLIGHTS = [pytest.param(kind, each, id=f"{kind}-{each.__name__}") for kind in KINDS for each in FAMILIES]


@pytest.mark.parametrize("kind, family", FLIGHTS)
def test_first_touch(kind, family):
    n = FAMILIES[family][0]
    check(family, kind, n if kind == "parabola" else 150 if family in (along_it, around_it) else 30, seed=5)


@pytest.mark.parametrize("kind", ["cubic", "quintic"])
def test_a_flight_from_a_triple_zero(kind):
    """On the floor with neither a speed nor an acceleration off it, only the change of that: up, and down again later."""
    back = {"cubic": [], "quintic": [(0.3, -0.1, -0.2), (0.1, -0.5, 0.4)]}[kind]
    for rise in (0.08, 1e-3, -0.1):
        curve = ((0.3, RADIUS, -0.5), (1.99, 0.0, -1.6), (-1.7, 0.0, 0.7), (-0.6, rise, 1.1), *back)
        case = Case(kind, curve, scene("floor"), 2.0)
        assert wrong(case, False) is None
        assert (case.found()[0] == NONE) == (kind == "cubic" and rise > 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("kind, family", FLIGHTS)
def test_first_touch_often(kind, family):
    check(family, kind, 300 if kind == "oscillation" else 1000, seed=6)


def test_a_fall_along_an_edge_touches_nothing():
    """A tenth of a nanometre off an upright edge of a block: the acceleration is not towards it."""
    x = 0.5 + (RADIUS + 1e-10) * np.sqrt(0.5)
    packed = pack(features([Box((0, 0, 0), (1, 4, 1))], NO_ROWS)[0])
    assert Case("parabola", ((x, 1.9, x), FREE, (0.0, -9.81, 0.0)), packed, 0.8).found() == (NONE, np.inf)


@pytest.mark.parametrize("gap", [1e-6, 1e-9, 1e-12, 1e-13, -1e-13, -1e-12, -1e-9, -1e-6])
@pytest.mark.parametrize("wide", [1e-13, 1e-10, 1e-5])
def test_around_an_edge_on_a_spring(gap, wide):
    """From below a sheet to above it around its edge, in an ellipse that comes as near as `gap` to touching it, and is at most
    `wide` farther off. The coordinates round by 1e-17 m, and the search goes by twenty times that."""
    packed = pack(features([Rectangle((-0.5, 0, 0), (0, 1, 0), (1, 1))], NO_ROWS)[0])
    a, b, turn = RADIUS + gap, RADIUS + max(gap, 0.0) + wide, 1.4
    curve = (a * np.cos(turn), -b * np.sin(turn), 0.1), (a * np.sin(turn), b * np.cos(turn), 0.0)
    case = Case("oscillation", (*curve, tuple(-c for c in curve[0][:2]) + (0.0,), 0.0, 1.0), packed, 2 * turn)
    touched = gap < 0
    assert (case.found()[0] != NONE) == bool(case.expected()) == touched
    assert not touched or not wrong(case, True)


# With a tree.

HILLS = Heightfield(size=(3, 3), cells=(9, 8), height="0.3*sin(4*x)*cos(3*z)")
BALL = trimesh.load_mesh(Path(__file__).parents[2] / "configs/meshes/icosphere.off")
MANY = {
    "hills": [HILLS, Plane((0, -0.5, 0))],
    "ball": [Triangles(np.array(BALL.vertices), np.array(BALL.faces)), Plane((0, -1.5, 0))],
    "litter": [soup(2, 40)],
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", MANY)
@pytest.mark.parametrize("origin", [0.0, 1e5])
def test_a_tree_changes_nothing(kind, name, origin):
    shapes = [_Moved(shape, np.full(3, origin)) for shape in MANY[name]]
    packed = pack(features(shapes, NO_ROWS)[0])
    assert len(packed.tree.items) > 32
    rng = np.random.default_rng(8)
    for k in range(1000):
        speed = 10.0 ** rng.uniform(-2, 3)
        x, v = origin + rng.uniform(-1.3, 1.3, 3), speed * unit(rng.normal(size=3))
        a = rng.choice([0.0, 1.0, 5.0]) * rng.normal(size=3) * speed
        if k % 2:  # a graze
            place, normal = spot(rng, packed)
            x, v = place + RADIUS * (1 - 10.0 ** rng.uniform(-5, -1)) * normal, speed * across(rng, normal)
            a = rng.uniform(0, 5) * speed**2 * normal
        curve = curve_to(rng, kind, x, v, a, rng.uniform(0.1, 1) / speed)
        case = Case(kind, curve, packed, 3 / speed)
        if overlaps(packed, curve[0]):
            continue
        bare = case._replace(packed=packed._replace(tree=build(NO_ROWS, NO_ROWS)))
        (item, s), (item0, s0) = case.found(), bare.found()
        # A face of a parabola is a formula; all else is searched for, from other times on, and what is found may round otherwise.
        # So of edges that end in one corner it may be another. Where the touch is a slow one the oracle has to decide.
        if kind == "parabola" and max(item, item0) < len(packed.faces):
            assert (item, s) == (item0, s0)
        elif item != item0 or s != s0:
            tie = abs(s - s0) <= 1e-12 * s0 + 64 * EPS * oracle.size_of(packed, np.array(curve[0]), RADIUS) / speed
            assert tie or not (wrong(case, True) or wrong(bare, True)), (curve, item, s, item0, s0)


FINE = Heightfield(size=(3, 3), cells=(30, 30), height="0.2*sin(3*x)*cos(2*z)")
ROUGH = Heightfield(size=(3, 3), cells=(24, 24), height="0.05*sin(40*x)*cos(31*z)+0.1*x")
FLOWN_OVER = {"fine": [FINE], "rough": [ROUGH], **MANY, "much litter": [soup(3, 300)]}


def pulled(rng, packed, origin):
    """A flight under gravity along an axis, or none: from anywhere, off a surface, onto one, or past it."""
    speed = 10.0 ** rng.uniform(-1, 1.5)
    a = np.zeros(3)
    a[rng.integers(3)] = rng.choice([0.0, 1.0, 1.0]) * rng.normal() * speed**2 * 10.0 ** rng.uniform(-1, 1)
    (place, normal), t = spot(rng, packed), rng.uniform(0.05, 1) / speed
    match rng.integers(4):
        case 0:
            x, v = origin + rng.uniform(-1.3, 1.3, 3), speed * unit(rng.normal(size=3))
        case 1:
            x = place + RADIUS * (1 + rng.choice([0.0, 1e-12, 1e-6])) * normal
            v = speed * unit(unit(rng.normal(size=3)) + rng.uniform(0.1, 1.2) * normal)
        case how:
            way = across(rng, normal)
            end = speed * (unit(rng.uniform(0, 3) * way - normal) if how == 2 else way)
            depth = RADIUS * 10.0 ** (rng.uniform(-9, -2) if how == 2 else rng.uniform(-5, -1))
            v = end - a * t
            x = place + (RADIUS - depth) * normal - v * t - 0.5 * a * t**2
    curve = tuple(tuple(row.tolist()) for row in (x, v, a))
    return Case("parabola", curve, packed, rng.choice([3.0, 30.0]) / speed), speed


@pytest.mark.parametrize("name", FLOWN_OVER)
@pytest.mark.parametrize("origin", [0.0, 1e3])
def test_a_tree_changes_nothing_under_gravity(name, origin):
    """Of such flights the tree knows most: which way they go by what is in it."""
    packed = pack(features([_Moved(shape, np.full(3, origin)) for shape in FLOWN_OVER[name]], NO_ROWS)[0])
    rng, touched = np.random.default_rng(9), 0
    for _ in range(600):
        case, speed = pulled(rng, packed, origin)
        if overlaps(packed, case.curve[0]):
            continue
        bare = case._replace(packed=packed._replace(tree=build(NO_ROWS, NO_ROWS)))
        (item, s), (item0, s0) = case.found(), bare.found()
        touched += item0 != NONE
        if item != item0 or s != s0:  # see above
            tie = abs(s - s0) <= 1e-12 * s0 + 64 * EPS * oracle.size_of(packed, np.array(case.curve[0]), RADIUS) / speed
            assert tie or not wrong(case, True), (case.curve, item, s, item0, s0)
    assert touched > 150


def test_an_edge_in_touch_when_the_search_for_it_begins():
    """A flight without end comes through the hills, so that an edge is inside the ball where it first may be touched, were there not
    another before: no touch earlier than that may come of it."""
    curve = (-1.2351576701889462, -0.5798072560544554, 0.6072196060782308), (0.15771685256487275, 0.1853539551613168, 0.057177350203171204)
    case = Case("parabola", (*curve, (0.0, 0.0, 0.0)), pack(features([ROUGH], NO_ROWS)[0]), 12.0)
    assert not wrong(case, True)


@pytest.mark.parametrize("depth", [1e-9, 1e-3, 0.3, 0.9])
def test_a_ball_that_begins_in_a_face_and_sinks_touches_it_at_once(depth):
    """Of a part of the radius, and a tree does not take it for too low."""
    packed, rng = pack(features([FINE], NO_ROWS)[0]), np.random.default_rng(3)
    for _ in range(50):
        place, normal = spot(rng, packed, edge=False)
        curve = tuple(place + RADIUS * (1 - depth) * normal), tuple(-normal), (0.0, -9.81, 0.0)
        item, s = Case("parabola", curve, packed, 1.0).found()
        assert s == 0.0 and item < len(packed.faces)


@pytest.mark.parametrize("kind", ["cubic", "quintic"])
@pytest.mark.parametrize("side", [-1, 1])
def test_around_an_edge_to_the_other_side(kind, side):
    """Beside a sheet a ball rises, but not as high as it would touch that, then goes through its plane and comes back from beyond."""
    packed = pack(features([Rectangle((0.5, 0, 0), (0, 1, 0), (1, 1))], NO_ROWS)[0])
    height = np.array([0.03, 0.1, -2.375, 3.75])  # to 31 mm, to -70 mm after 0.4 s, and back; by then the edge is straight above
    curve = [(x, side * y, 0.0) for x, y in zip((-0.3, 0.75, 0.0, 0.0), height)] + [(0.0, 0.0, 0.0)] * (POLYNOMIALS[kind] - 1)
    item, s = Case(kind, tuple(curve), packed, 1.0).found()
    comes_back = np.roots((height + (RADIUS, 0, 0, 0))[::-1]).real.max()
    assert item == 0 and s == pytest.approx(comes_back, abs=1e-12)
