"""How balls come in: when, where, and spread as said; distributions by the test of Kolmogorov and Smirnov."""

import numpy as np
import pytest

from sim.model import Invalid
from sim.release import Emitter, Listed, Scatter, Start, draws

MANY = 20_000
AXES = [(0, 1, 0), (0, -1, 0), (1, 0, 0), (0, 0, -2), (-0.72975, -0.68367, -0.00820), (1, 1, 1)]


def uniform(sample, low, high):
    """Whether the sample's distribution stays as near to the uniform one as it does for 999 in 1000 right generators.

    The seeds are fixed, so that a pass is one for ever.
    """
    u = np.sort((np.asarray(sample) - low) / (high - low))
    n = len(u)
    steps = np.arange(n + 1) / n
    distance = max(np.max(steps[1:] - u), np.max(u - steps[:-1]))
    return distance < 1.95 / np.sqrt(n)


def independent(a, b):
    """Whether the correlation of two samples is within 3.3 standard deviations, as of 999 in 1000 independent ones."""
    return abs(np.corrcoef(a, b)[0, 1]) < 3.3 / np.sqrt(len(a))


def turned(vectors, axis):
    """Cosine and azimuth (rad) of unit vectors about the axis."""
    axis = np.array(axis) / np.linalg.norm(axis)
    side = np.linalg.svd(axis[None])[2][1]
    return vectors @ axis, np.arctan2(vectors @ np.cross(axis, side), vectors @ side)


def emitter(**options):
    return Emitter(position=(1, 2, 3), **{"direction": (0, 1, 0), "rate": MANY} | options)


def test_draws_are_uniform_and_independent():
    u = draws(5, MANY)
    assert u.shape == (MANY, 4) and u.min() >= 0 and u.max() < 1
    for k in range(4):
        assert uniform(u[:, k], 0, 1)
        assert independent(u[1:, k], u[:-1, k]) and independent(u[:, k], u[:, k - 1])
    assert independent(u[:, 0], draws(6, MANY)[:, 0])


def test_a_draw_depends_on_seed_and_number_alone():
    assert np.array_equal(draws(5, 1000)[:7], draws(5, 7))
    assert not np.any(draws(5, 1000) == draws(6, 1000))
    assert not np.any(draws(2**64 - 1, 9) == draws(0, 9))


@pytest.mark.parametrize("direction", AXES)
@pytest.mark.parametrize("spread", [1.0, 17.78, 90.0, 180.0, 300.0, 360.0])
def test_cone(direction, spread):
    time, position, velocity = emitter(direction=direction, spread=spread, speed=5.0, seed=3).release(1.0)
    assert len(time) == MANY and np.array_equal(position, np.tile((1.0, 2.0, 3.0), (MANY, 1)))
    # unit vectors to a few roundings
    assert np.allclose(np.linalg.norm(velocity, axis=1), 5.0, rtol=1e-15, atol=0)
    cosine, azimuth = turned(velocity / 5, direction)
    rim = np.cos(np.radians(spread / 2))
    assert cosine.min() >= rim - 4e-16
    assert uniform(cosine, rim, 1) and uniform(azimuth, -np.pi, np.pi)
    assert independent(cosine, np.abs(azimuth))


def test_all_around_covers_the_sphere():
    heading = emitter(spread=360.0, speed=1.0, seed=4).release(1.0)[2]
    for axis in range(3):
        assert uniform(heading[:, axis], -1, 1)  # Archimedes: even on the sphere, even along each axis


@pytest.mark.parametrize("direction", AXES)
def test_no_spread_is_straight(direction):
    velocity = emitter(direction=direction, spread=0.0, speed=8.0, rate=50.0, seed=9).release(1.0)[2]
    # a few roundings of the normalisation, and all alike
    assert np.allclose(velocity[0], 8 * np.array(direction) / np.linalg.norm(direction), rtol=4e-16, atol=0)
    assert np.array_equal(velocity, np.tile(velocity[0], (50, 1)))


@pytest.mark.parametrize("rate", [0.3, 1.0, 5.0, 7.0, 10 / 3, 1000.0])
@pytest.mark.parametrize("duration", [0.1, 1.0, 2.0, 3.0, 9.999])
def test_timing(rate, duration):
    """Ball i at i / rate, the last one strictly before the end."""
    time, position, velocity = emitter(rate=rate).release(duration)
    assert len(time) == len(position) == len(velocity)
    assert np.array_equal(time, [i / rate for i in range(len(time))])
    assert time[-1] < duration <= len(time) / rate


def test_five_a_second_for_two_seconds_are_ten():
    assert len(emitter(rate=5.0).release(2.0)[0]) == 10


def test_count_caps():
    assert len(emitter(rate=5.0, count=3).release(2.0)[0]) == 3
    assert len(emitter(rate=5.0, count=99).release(2.0)[0]) == 10


def test_more_balls_change_none():
    few = emitter(spread=30.0, rate=5.0, seed=1, count=3).release(2.0)
    many = emitter(spread=30.0, rate=5.0, seed=1).release(200.0)
    other = emitter(spread=30.0, rate=5.0, seed=2).release(200.0)
    for a, b in zip(few, many):
        assert np.array_equal(a, b[:3])
    assert not np.any(many[2] == other[2])


def test_scatter():
    low, high = np.array((-1.0, 0.0, 2.0)), np.array((1.0, 5.0, 2.0))
    time, position, velocity = Scatter(count=MANY, box=(tuple(low), tuple(high)), max_speed=5.0, seed=2).release(1.0)
    assert np.array_equal(time, np.zeros(MANY)) and np.array_equal(position[:, 2], np.full(MANY, 2.0))
    assert uniform(position[:, 0], -1, 1) and uniform(position[:, 1], 0, 5)
    speed = np.linalg.norm(velocity, axis=1)
    assert uniform(speed, 0, 5)
    for axis in range(3):
        assert uniform(velocity[:, axis] / speed, -1, 1)
        assert independent(velocity[:, axis], position[:, 0]) and independent(velocity[:, axis] / speed, speed)


def test_scatter_more_balls_change_none():
    box = ((-1, -1, -1), (1, 1, 1))
    few, many = (Scatter(count=n, box=box, max_speed=5.0, seed=2).release(1.0) for n in (10, 1000))
    for a, b in zip(few, many):
        assert np.array_equal(a, b[:10])
    assert np.array_equal(Scatter(count=10, box=box, seed=2).release(1.0)[2], np.zeros((10, 3)))


def test_listed():
    time, position, velocity = Listed([Start((0, 1, 0)), Start((1, 2, 3), (4, 5, 6))]).release(1.0)
    assert np.array_equal(time, (0, 0))
    assert np.array_equal(position, ((0, 1, 0), (1, 2, 3))) and np.array_equal(velocity, ((0, 0, 0), (4, 5, 6)))


@pytest.mark.parametrize(
    "make, field",
    [
        (lambda: emitter(direction=(0, 0, 0)), "direction"),
        (lambda: emitter(direction=(0, np.inf, 0)), "direction"),
        (lambda: emitter(speed=-1.0), "speed"),
        (lambda: emitter(spread=-1e-9), "spread"),
        (lambda: emitter(spread=360.1), "spread"),
        (lambda: emitter(rate=0.0), "rate"),
        (lambda: emitter(seed=-1), "seed"),
        (lambda: emitter(seed=2**64), "seed"),
        (lambda: emitter(seed=10**400), "seed"),
        (lambda: emitter(count=0), "count"),
        (lambda: Scatter(count=0, box=((0, 0, 0), (1, 1, 1))), "count"),
        (lambda: Scatter(count=1, box=((0, 2, 0), (1, 1, 1))), "box"),
        (lambda: Scatter(count=1, box=((0, 0, 0), (1, np.nan, 1))), "box"),
        (lambda: Scatter(count=1, box=((0, 0, 0), (1, 1, 1)), max_speed=-1.0), "max_speed"),
        (lambda: Start((0, np.nan, 0)), "position"),
        (lambda: Start((0, 0, 0), (0, np.inf, 0)), "velocity"),
    ],
)
def test_invalid_sources_say_which_parameter(make, field):
    with pytest.raises(Invalid) as error:
        make()
    assert error.value.field == field and "\n" not in str(error.value)
