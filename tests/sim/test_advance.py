"""The clock: frames, releases, lifetimes and the end of a run, wherever they lie between steps."""

import numpy as np
import pytest

from sim import integrators
from sim.forces import Spring
from sim.shapes import Plane
from sim.simulate import Scene
from tests.sim import plain
from tests.sim.helpers import AIR, CORRIDOR, FREE, LIFT, WELL, balls, fly, random_balls, room

SMOOTH = Scene(forces={"well": WELL, "air": AIR})


@pytest.mark.parametrize("method", integrators.fixed())
def test_frames_do_not_change_a_flight(method):
    """A frame inside a step is looked at and thrown away. All times here are sums of powers of 2, so nothing rounds."""
    start = random_balls(4, 5, released=[0, 1 / 128, 1 / 64, 3 / 256, 3 / 8])
    coarse = fly(SMOOTH, start, method, step=1 / 64, duration=1.0, every=1 / 8)
    fine = fly(SMOOTH, start, method, step=1 / 64, duration=1.0, every=1 / 1024)
    assert np.array_equal(fine.trajectory.position[::128], coarse.trajectory.position, equal_nan=True)
    assert np.array_equal(fine.trajectory.velocity[::128], coarse.trajectory.velocity, equal_nan=True)
    assert fine.steps == coarse.steps


@pytest.mark.parametrize("method", integrators.fixed())
def test_release_time_only_shifts_a_flight(method):
    """Everything, an `until` too, goes by the ball's own age."""
    scene = Scene(forces={"corridor": CORRIDOR, "lift": LIFT})
    at = np.array([0, 1 / 4, 1 / 256, 3 / 8])
    start = random_balls(5, 1)
    flight = fly(scene, balls(start.position, start.velocity, at), method, step=1 / 64, duration=1.0, every=1 / 256)
    position = flight.trajectory.position
    for ball, frame in enumerate((at * 256).astype(int)):
        assert np.array_equal(position[frame:, ball], position[: len(position) - frame, 0])
        assert np.isnan(position[:frame, ball]).all()


def test_steps_are_whole_although_frames_round():
    """0.1 / 0.001 is not 100 in binary, nor is 3 * 0.1 = 0.3; 1e4 frames must not shift the clock."""
    flight = fly(Scene(), balls(FREE, (1, 0, 0), lifetime=1e6), "explicit_euler", step=0.1, duration=1000.0, every=0.3)
    assert flight.steps == 10_000
    # forward Euler falls by g h^2 n (n - 1) / 2 in n steps; 1e4 roundings of 1e-16
    n = np.rint(flight.trajectory.time / 0.1)
    assert np.allclose(flight.trajectory.position[:, 0, 1], -9.8 * 0.01 * n * (n - 1) / 2, rtol=1e-12)


@pytest.mark.parametrize("n", range(1, 30))
def test_a_flight_of_n_steps_makes_n(n):
    """n / 10 over 0.1 is less than n for 3, 6, 7, ..., and the rest is then a whole step."""
    assert fly(Scene(), balls(FREE, FREE), "explicit_euler", step=0.1, duration=n / 10).steps == n
    life = balls(FREE, FREE, released=[0.0, 0.4], lifetime=n / 10)
    assert fly(Scene(), life, "explicit_euler", step=0.1, duration=4.0).steps == 2 * n


@pytest.mark.parametrize("every", [0.1, 0.25, 3.0])
@pytest.mark.parametrize("step", [0.01, 0.07, 5.0])
def test_lifetime_cuts_a_flight_where_it_ends(step, every):
    """The state at its end is never recorded, but seen in the energy that the ball carries off."""
    start = balls((0, 1, 0), (3, 2, 1), released=[0.0, 0.33], mass=2.0, lifetime=0.7)
    flight = fly(Scene(forces={"air": AIR}), start, "rk4_original", step=step, duration=3.0, every=every)
    times = flight.trajectory.time
    age = times[:, None] - start.released
    # the last frame alive is before the lifetime, not at it
    assert np.array_equal(np.isfinite(flight.trajectory.position[..., 0]), (age >= 0) & (age < 0.7))
    ends = [plain.Flight(Scene(forces={"air": AIR}), start, i, "rk4_original", step, times).at_end for i in range(2)]
    carried_off = sum(v @ v + 2 * 9.8 * x[1] for x, v in ends)
    # rounding of some 100 J
    assert flight.energy_final == pytest.approx(carried_off, rel=1e-13)
    assert flight.ball_seconds == pytest.approx(1.4, rel=1e-14)


def test_a_frame_at_the_lifetime_shows_no_ball():
    released = np.arange(10) / 10
    for n in range(1, 8):
        flight = fly(Scene(), balls(FREE, FREE, released, lifetime=n / 10), step=0.1, duration=2.0)
        # 0.5 - 0.4 is less than 0.1, 0.3 - 0.2 is not
        assert np.array_equal(np.isfinite(flight.trajectory.position[:, :, 0]).sum(axis=0), [n] * 10)


@pytest.mark.parametrize("method", plain.METHODS)
def test_bounces_between_frames_and_steps_are_counted_once(method):
    """Frames inside steps see the bounces of the step to come; only the step itself may record them."""
    scene = room(many=False)
    start = random_balls(6, 20, released=0.0173 * np.arange(20), lifetime=0.611)
    flights = [fly(scene, start, method, step=0.01, duration=0.8033, every=every) for every in (0.01, 0.0009, 0.8033)]
    assert len(flights[0].bounces) > 50
    for flight in flights[1:]:
        assert np.array_equal(flight.bounces, flights[0].bounces)
        assert flight.penetrations == flights[0].penetrations
        assert flight.steps == flights[0].steps


def test_a_ball_that_waits_at_a_wall_bounces_once():
    """Exactly at r, moving in, is a hit at s = 0: at each ball's own first step, not while others fly."""
    start = balls([(0, 5, 0), (0, 0.25, 0)], [(0, 0, 0), (0, -1, 0)], released=[0.0, 0.5], radius=0.25)
    scene = Scene(gravity=FREE, surfaces={"floor": Plane()}, restitution=0.5)
    flight = fly(scene, start, "explicit_euler", step=0.1, duration=1.0, every=0.25)
    assert np.array_equal(flight.bounces["time"], [0.5])
    assert np.array_equal(flight.trajectory.velocity[2:, 1, 1], [-1, 0.5, 0.5])
    assert np.array_equal(flight.energy.lost, [0, 0, 0, 0.375, 0.375])


def test_a_frame_does_not_show_the_bounce_of_the_next_step():
    """The second ball is released at the wall, moving in, at a frame for which the first makes a part of a step."""
    scene = Scene(gravity=FREE, surfaces={"floor": Plane()}, restitution=0.5)
    start = balls([(0, 5, 0), (0, 0.25, 0)], [(0, 0, 0), (0, -1, 0)], released=[0.0625, 0.5], radius=0.25)
    flight = fly(scene, start, "explicit_euler", step=0.125, duration=1.0, every=0.5)
    assert np.array_equal(flight.trajectory.velocity[1:, 1, 1], [-1, 0.5])


def test_the_bounce_at_the_very_end_is_listed():
    """Its time may round to after the end, and its loss is in the ledger all the same."""
    scene = Scene(gravity=FREE, surfaces={"floor": Plane()}, restitution=0.5)
    speed = np.random.default_rng(0).uniform(0.1, 3, 640)
    latest = 0.0
    for step, n in ((0.1, 11), (0.1, 13), (0.03, 10), (0.01, 6)):
        way = 0.25 + n * step * speed
        fall = balls(np.outer(way, (0, 1, 0)), np.outer(-speed, (0, 1, 0)), radius=0.25)
        flight = fly(scene, fall, "explicit_euler", step=step, duration=n * step)
        assert 100 < len(flight.bounces) < 640  # rounding decides for each ball
        # rounding of a sum of 640
        assert flight.bounces["energy_lost"].sum() == pytest.approx(flight.energy.lost[-1], rel=1e-12)
        latest = max(latest, flight.bounces["time"].max() - n * step)
    assert 0 < latest < 1e-15


def test_a_spring_at_its_centre_does_nothing():
    scene = Scene(gravity=FREE, forces={"well": Spring(stiffness=10.0, center=(1, 2, 3))})
    flight = fly(scene, balls((1, 2, 3), FREE), duration=1.0)
    assert np.array_equal(flight.trajectory.position, np.broadcast_to([1.0, 2.0, 3.0], (101, 1, 3)))
