"""The impact law, over decades of mass and speed."""

import numpy as np
import pytest

from sim.impact import energy_lost, rebound, restitution
from sim.shapes import Plane
from sim.simulate import Scene
from tests.sim.helpers import FREE, balls, fly

WALL = 200.0  # kg
MASSES = [0.1, 1.0, 10.0, 100.0, 200.0]
SPEEDS = [1e-3, 1.0, 1e2, 1e5]
DAMPINGS = [0.0, 0.05, 0.5, 1.0]


def impacts(speed, count=20):
    """Random (velocity, normal) with the velocity into the surface."""
    rng = np.random.default_rng(0)
    for _ in range(count):
        n, v = rng.normal(size=(2, 3))
        n, v = n / np.linalg.norm(n), speed * v / np.linalg.norm(v)
        yield (v if v @ n < 0 else -v), n


@pytest.mark.parametrize("mass", MASSES)
@pytest.mark.parametrize("speed", SPEEDS)
def test_conservation_with_a_free_wall(mass, speed):
    """The wall takes up the momentum the ball loses, and then has just the energy that the ball lost."""
    e = restitution(mass, WALL)
    for v, n in impacts(speed):
        after = np.array(rebound(tuple(v), tuple(n), e, 0.0)[0])
        wall = mass * (v - after) / WALL
        turnover = mass * v @ v  # what roundings are relative to
        assert mass * (v @ v) == pytest.approx(mass * (after @ after) + WALL * (wall @ wall), abs=4e-15 * turnover)
        # elastic: they part as fast as they met
        assert (after - wall) @ n == pytest.approx(-v @ n, abs=4e-15 * speed)


def test_restitution_in_numbers():
    assert restitution(100.0, 200.0) == 1 / 3  # a 100 kg ball keeps a third
    assert restitution(200.0, 200.0) == 0.0


@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("mass", MASSES)
@pytest.mark.parametrize("speed", SPEEDS)
def test_law(mass, speed, damping):
    for e in (restitution(mass, WALL), 0.0, 0.3, 1.0):
        for v, n in impacts(speed):
            after, vn, vt_squared = rebound(tuple(v), tuple(n), e, damping)
            after, t = np.array(after), v - (v @ n) * n
            rounding = 4e-16 * speed
            assert after @ n == pytest.approx(-e * (v @ n), abs=4 * rounding)
            assert after @ n >= -4 * rounding  # never into the surface
            assert (after - (after @ n) * n) @ t >= -4 * rounding * speed  # sliding slows down but never turns
            left = np.linalg.norm(after - (after @ n) * n)
            assert left == pytest.approx((1 - damping) * np.linalg.norm(t), abs=4 * rounding)
            assert vn == pytest.approx(-v @ n, abs=rounding)
            assert vt_squared == pytest.approx(t @ t, abs=4 * rounding * speed)
            lost = energy_lost(mass, vn, vt_squared, e, damping)
            kinetic = mass / 2 * (v @ v)
            assert lost == pytest.approx(kinetic - mass / 2 * (after @ after), abs=4e-15 * kinetic)
            assert 0 <= lost <= (1 + 4e-16) * kinetic


@pytest.mark.parametrize("mass", MASSES)
@pytest.mark.parametrize("speed", SPEEDS)
def test_law_in_flight(mass, speed):
    """The same law, out of a simulation: the override in force where given, the ledger equal to what the ball lost."""
    for e in (None, 0.0, 0.3, 1.0):
        scene = Scene(gravity=FREE, surfaces={"floor": Plane(normal=(0, 0, 1))}, restitution=e, damping=0.2)
        start = balls((0, 0, 0.25 + 0.6 * speed), (0.8 * speed, 0, -0.6 * speed), mass=mass, radius=0.25)
        flight = fly(scene, start, step=0.3, duration=1.5)
        kept = (200 - mass) / (200 + mass) if e is None else e
        after = flight.trajectory.velocity[-1, 0]
        assert after == pytest.approx((0.64 * speed, 0, 0.6 * kept * speed), rel=1e-14, abs=1e-16 * speed)
        kinetic = mass / 2 * np.array([speed**2, after @ after])
        lost = kinetic[0] - kinetic[1]
        assert flight.energy.lost[-1] == flight.bounces["energy_lost"].sum()
        assert flight.energy.lost[-1] == pytest.approx(lost, abs=4e-15 * kinetic[0])
        assert flight.energy.residual[-1] == pytest.approx(0, abs=4e-15 * kinetic[0])
