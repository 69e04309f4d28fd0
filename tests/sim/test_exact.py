"""The exact solver against closed forms: flights, bounces, regions, and what a million bounces leave of the energy."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest

from sim import engines
from sim.forces import Drag, Spring, Uniform
from sim.shapes import Box, Plane
from sim.simulate import Scene
from tests.sim.helpers import ELASTIC, FREE, balls, moved, random_balls, rotation, swept

G, R = 9.8, 0.06
LONG = np.longdouble


def rises(x, v, g, size, t):
    """A point that falls with g >= 0 and bounces elastically between 0 and `size`: its place after the times t, and how often it
    has bounced; all in long double. Every bounce of its period, from floor to floor, is at a known time."""
    x, v, g, size, t = (np.asarray(a, LONG) for a in (x, v, g, size, t))
    bottom = np.sqrt(v * v + 2 * g * x)  # its speed at the floor
    left = bottom * bottom - 2 * g * size
    reaches = left > 0
    top = np.sqrt(np.where(reaches, left, 0))  # its speed at the ceiling
    up = 2 * size / (bottom + top) if not g else (bottom - top) / g
    phase = 2 * x / (bottom + np.abs(v))  # from the floor to here, or from here to the floor
    phase = np.where(v >= 0, phase, 2 * up - phase)
    period, now = 2 * up, phase + t
    s = now - period * np.floor(now / period)
    s = np.where(s > up, period - s, s)
    count = np.floor(now / period) + np.where(reaches, np.floor((now + up) / period) - np.floor((phase + up) / period), 0)
    return s * (bottom - g * s / 2), count.astype(int)


def test_one_ball_on_a_plane():
    flight = swept(Scene(surfaces={"floor": Plane()}, **ELASTIC), balls((0, 1, 0), (1, 0.3, -2)), duration=10.0, every=0.01)
    height, count = rises(LONG(1) - LONG(R), 0.3, 9.8, 1e3, flight.trajectory.time)
    # 11 bounces, each known in time to some 1e-16 of 10 s, times the speed
    assert np.abs(flight.trajectory.position[:, 0, 1] - LONG(R) - height).max() < 1e-13
    assert len(flight.bounces) == count[-1] == 11
    t = flight.trajectory.time[:, None]
    assert np.abs(flight.trajectory.position[:, 0, ::2] - t * [1, -2]).max() < 1e-13


@pytest.mark.parametrize("hops", [True, False])
def test_times_do_not_add_up_their_rounding(hops, monkeypatch):
    """A hop that takes 0.7 s to the last digit, with a speed of 0.7 m/s under 2 m/s^2, is the same ten thousand times."""
    bindings = engines.bindings
    monkeypatch.setattr(engines, "bindings", lambda *given: bindings(*given) | {"HOPS": hops})
    scene = Scene(surfaces={"floor": Plane()}, gravity=(0, -2, 0), **ELASTIC)
    flight = swept(scene, balls((0, R, 0), (0, 0.7, 0), radius=R, lifetime=1e9), duration=7001.0)
    times = [float(n * Fraction(0.7)) for n in range(1, 10_001)]
    assert np.abs(np.diff(times) - 0.7).max() > 1e-13  # they do not all have room for its digits
    assert np.array_equal(flight.bounces["time"][:10_000], times)


@pytest.mark.parametrize("every", [0.01, 0.0137, 1.0])
def test_a_thousand_balls_in_a_box(every):
    """Every axis for itself is a point between two walls; y falls. Some 30,000 bounces."""
    size = np.array([3.0, 2.0, 2.5])
    scene = Scene(surfaces={"room": Box(center=(0, 0, 0), size=tuple(size), inside=True)}, **ELASTIC)
    rng = np.random.default_rng(4)
    start = balls(rng.uniform(-0.9, 0.9, (1000, 3)), rng.normal(0, 5, (1000, 3)))
    flight = swept(scene, start, duration=5.0, every=every)
    assert flight.penetrations == 0 and flight.status == "finished"

    low = R - size.astype(LONG) / 2
    time = flight.trajectory.time[:: max(1, len(flight.trajectory.time) // 20)]
    time = np.append(time, flight.trajectory.time[-1])
    frames = np.searchsorted(flight.trajectory.time, time)
    for axis, g in enumerate((0, G, 0)):
        x, v = start.position[:, axis].astype(LONG) - low[axis], start.velocity[:, axis]
        place, _ = rises(x, v, g, -2 * low[axis], time[:, None])
        # some 50 bounces, each with a rounding of 1e-16 of the time (5 s) times the speed (15 m/s)
        assert np.abs(flight.trajectory.position[frames, :, axis] - low[axis] - place).max() < 1e-12
        count = rises(x, v, g, -2 * low[axis], 5.0)[1]
        hits = np.abs(flight.bounces["normal"][:, axis]) == 1
        assert np.array_equal(np.bincount(flight.bounces["ball"][hits], minlength=1000), count)


def test_frames_change_nothing():
    """Bit by bit: a frame is looked up on the way, it does not cut the way."""
    scene = Scene(surfaces={"room": Box(center=(0, 0, 0), size=(3, 3, 3), inside=True)}, forces={"air": Drag(0.1)})
    fly = [swept(scene, random_balls(5, 20), duration=5.0, every=every) for every in (0.01, 0.0137, 1.0, 5.0)]
    for other in fly[1:]:
        assert np.array_equal(fly[0].bounces, other.bounces)
        assert np.array_equal(fly[0].trajectory.position[-1], other.trajectory.position[-1])
        common = np.isin(other.trajectory.time, fly[0].trajectory.time)
        same = np.isin(fly[0].trajectory.time, other.trajectory.time)
        assert common.sum() >= 2
        assert np.array_equal(fly[0].trajectory.position[same], other.trajectory.position[common])


@pytest.mark.parametrize("damping", [0.0, 0.05])
@pytest.mark.parametrize("e", [0.1, 0.3, 0.5, 0.7, 0.9, 0.95, 0.99])
def test_bounces_pile_up_in_time(e, damping):
    """Dropped from h it first lands at t = sqrt(2 h/g) with speed g t; hops of 2 e^k t end at t (1 + e)/(1 - e)."""
    h = LONG(1) - LONG(R)
    first = np.sqrt(2 * h / LONG(G))
    end = first * (1 + LONG(e)) / (1 - LONG(e))
    scene = Scene(surfaces={"floor": Plane()}, restitution=e, damping=damping)
    flight = swept(scene, balls((0, 1, 0), FREE, lifetime=1e9), duration=float(end) + 1)
    assert flight.status == "rested" and len(flight.rests) == 1
    # as wanted; a height is known to 1e-17 m, and the hops left out are known by formula
    assert abs(flight.rests["time"][0] / end - 1) < 1e-12
    # n bounces are over at t (1 + 2 (e + ... + e^(n-1))), or end - 2 t e^n/(1 - e)
    n = np.arange(1, len(flight.bounces) + 1)
    assert np.abs(flight.bounces["time"] - (end - 2 * first * LONG(e) ** n / (1 - LONG(e)))).max() < 1e-12 * end
    # it goes on until a hop rises 1e-13 m, and longer where rest takes the way along the surface
    rise = h * LONG(e) ** (2 * n)
    assert rise[-1] <= 1.001e-13 and (rise[-2] > 0.999e-13 or damping > 0)
    # a gap counts as none within a rounding of twice the radius
    assert abs(flight.trajectory.position[-1, 0, 1] - R) < 1e-16 and not flight.trajectory.velocity[-1].any()


FIELDS = {
    "nothing": {},
    "drag": {"air": Drag(0.8)},
    "strong drag": {"air": Drag(1e4)},
    "spring": {"well": Spring(30.0, center=(0.3, -0.2, 0.5))},
    "stiff spring": {"well": Spring(1e6, center=(0.3, -0.2, 0.5))},
    "underdamped": {"air": Drag(0.8), "well": Spring(30.0, center=(0.3, -0.2, 0.5))},
    "critical": {"air": Drag(2.6), "well": Spring(1.3, center=(0.3, -0.2, 0.5))},
    "overdamped": {"air": Drag(9.0), "well": Spring(2.0), "wind": Uniform(direction=(1, 2, 3), magnitude=5.0)},
}


def formula(scene, mass, x, v, times):
    """Position (times, 3) m, from the exponential of the matrix of (x, v, 1), to 40 digits."""
    fields = scene.forces.values()
    w2 = sum((mpmath.mpf(f.stiffness) for f in fields if isinstance(f, Spring)), mpmath.mpf(0)) / mass
    b = sum((mpmath.mpf(f.coefficient) for f in fields if isinstance(f, Drag)), mpmath.mpf(0)) / mass
    out = np.empty((len(times), 3))
    for k in range(3):
        push = mpmath.mpf(scene.gravity[k]) + sum(mpmath.mpf(float(f.affine()[0][k])) for f in fields) / mass
        a = mpmath.matrix([[0, 1, 0], [-w2, -b, push], [0, 0, 0]])
        start = mpmath.matrix([x[k], v[k], 1])
        out[:, k] = [float((mpmath.expm(a * t) * start)[0]) for t in times]
    return out


@pytest.mark.parametrize("name", FIELDS)
def test_flights(name):
    scene, mass = Scene(forces=FIELDS[name]), 1.3
    start = balls((1.0, -0.5, 0.3), (2.0, 3.0, -4.0), mass=mass)
    flight = swept(scene, start, duration=10.0, every=0.625)
    with mpmath.workdps(40):
        wanted = formula(scene, mass, start.position[0], start.velocity[0], flight.trajectory.time)
    # rounding of the coordinates, and of the phase: omega t rounds by 1e-16 of it, and a period turns that into metres
    w2 = sum(f.stiffness for f in scene.forces.values() if isinstance(f, Spring)) / mass
    tolerance = 1e-15 * np.abs(wanted).max() * (4 + 10 * np.sqrt(w2))
    assert np.abs(flight.trajectory.position[:, 0] - wanted).max() < tolerance


def test_a_million_bounces_keep_the_energy():
    """In a room turned any way, so that no normal is along an axis."""
    scene = Scene(surfaces={"room": moved(Box(center=(0, 0, 0), size=(1, 1.2, 0.9)), rotation(1))}, **ELASTIC)
    rng = np.random.default_rng(2)
    start = balls(rng.uniform(-0.2, 0.2, (100, 3)), rng.normal(0, 60, (100, 3)), radius=0.02, lifetime=1e9)
    flight = swept(scene, start, duration=75.0)
    assert len(flight.bounces) > 1_000_000 and flight.penetrations == 0
    energy = 0.5 * (flight.trajectory.velocity**2).sum(axis=2) + G * flight.trajectory.position[..., 1]
    # a normal is of length 1 to 1e-16, and a bounce off it changes the energy by up to four times that; a ball meets the same
    # six normals 10,000 times
    assert np.abs(energy[-1] / energy[0] - 1).max() < 1e-11
    assert np.abs(flight.energy.lost).max() == 0


def test_hops_down_a_slope():
    """A ball that hops down a slope: in coordinates along it and across, each is a parabola with its own gravity."""
    normal = np.array([0.3, 1.0, 0.2]) / np.linalg.norm([0.3, 1.0, 0.2])
    scene = Scene(surfaces={"slope": Plane(normal=tuple(normal))}, **ELASTIC)
    start = balls((normal * 0.06 + normal * np.array([[0.01], [0.013], [0.02]])), FREE, lifetime=1e9)
    flight = swept(scene, start, duration=10.0)
    across = G * normal[1]
    height = start.position @ normal - R
    period = np.sqrt(2 * height / across)
    assert np.array_equal(np.bincount(flight.bounces["ball"]), np.floor((10 / period + 1) / 2))
    energy = 0.5 * (flight.trajectory.velocity**2).sum(axis=2) + G * flight.trajectory.position[..., 1]
    assert np.abs(energy[-1] - energy[0]).max() < 1e-11 * 0.5 * (G * 10) ** 2


def through_a_slab(x, v, g, push, low, high, t):
    """x at the time t of a point with acceleration g, and g + push where low < x < high; v > 0 and it never turns back."""
    x, v, g, push, low, high, t = (LONG(a) for a in (x, v, g, push, low, high, t))
    for end, a in ((low, g), (high, g + push), (np.inf, g)):
        speed = np.sqrt(v * v + 2 * a * (end - x)) if np.isfinite(end) else np.inf
        lasts = 2 * (end - x) / (v + speed) if np.isfinite(end) else np.inf
        if lasts >= t:
            return x + v * t + a * t * t / 2
        x, v, t = end, speed, t - lasts
    raise AssertionError


@pytest.mark.parametrize("method, step", [("exact", 1.0), ("rk4_original", 0.01), ("rk4_original", 0.0937)])
@pytest.mark.parametrize("push", [3.0, -3.0])
def test_through_a_slab(method, step, push):
    """The faces of a region are events; rk4_original is exact where the acceleration is constant, so it is here."""
    slab = Uniform(direction=(1, 0, 0), magnitude=push * 1.3, region={"x": (0.5, 1.25)})
    scene = Scene(gravity=(0.4, 0, 0), forces={"slab": slab})
    flight = swept(scene, balls((0, 0.2, 0), (3, 0, 0), mass=1.3), method, step, duration=1.0, every=0.03)
    x = [through_a_slab(0, 3, 0.4, push, 0.5, 1.25, t) for t in flight.trajectory.time]
    # a hundred steps, each with a rounding of 1e-16 of 4 m
    assert np.abs(flight.trajectory.position[:, 0, 0] - x).max() < (1e-14 if method == "exact" else 1e-13)


def test_it_turns_back_in_a_slab():
    """And comes out where it went in, with the speed it had: at t = 2 v/a after it."""
    slab = Uniform(direction=(1, 0, 0), magnitude=-4.0, region={"x": (0.5, 9)})
    flight = swept(Scene(gravity=FREE, forces={"slab": slab}), balls(FREE, (2, 1, 0)), duration=3.0, every=0.25)
    t = flight.trajectory.time
    inside = 2 * (t - 0.25) - 2 * (t - 0.25) ** 2 + 0.5
    x = np.where(t < 0.25, 2 * t, np.where(t < 1.25, inside, 0.5 - 2 * (t - 1.25)))
    assert np.abs(flight.trajectory.position[:, 0, 0] - x).max() < 1e-15 * 4
    assert np.abs(flight.trajectory.velocity[-1, 0] - (-2, 1, 0)).max() < 1e-15 * 4


@pytest.mark.parametrize("dip", [1e-3, 1e-6, 1e-9, 0.0, -1e-6])
def test_it_grazes_a_region(dip):
    """A thrown ball whose vertex reaches `dip` into a region that slows its drift: v_x is less by a times the time inside."""
    top = 0.7 - dip
    roof = Uniform(direction=(1, 0, 0), magnitude=-2.0, region={"y": (top, 5)})
    up = np.sqrt(2 * G * 0.7)
    flight = swept(Scene(forces={"roof": roof}), balls(FREE, (1, up, 0)), duration=0.7)
    within = 2 * np.sqrt(2 * max(dip, 0.0) / G)
    # the vertex is known to 1e-16 m, which is in the root 1e-8 s; deeper it is 1e-16/sqrt(dip)
    slack = 2 * min(np.sqrt(1e-15), 1e-15 / np.sqrt(dip) if dip > 0 else 1)
    assert abs(flight.trajectory.velocity[-1, 0, 0] - (1 - 2 * within)) < slack + 1e-15
    assert flight.trajectory.velocity[-1, 0, 1] == pytest.approx(up - G * 0.7, abs=1e-14)


def test_fields_end():
    """`until` is an event: two parabolas, and the second begins at the age 0.3 of each ball."""
    lift = Uniform(direction=(0, 1, 0), magnitude=14.0, until=0.3)
    start = balls(FREE, (1, 2, 0), released=[0.0, 0.11])
    flight = swept(Scene(forces={"lift": lift}), start, duration=1.0)
    age = 1.0 - start.released
    y = 2 * age - G * age**2 / 2 + 14 * (0.3 * age - 0.3**2 / 2)
    assert np.abs(flight.trajectory.position[-1, :, 1] - y).max() < 1e-14  # a few roundings of 5 m
