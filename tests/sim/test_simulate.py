"""A run as a whole: its frames, how it can end, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from sim import engines, lanes, log
from sim.forces import Spring, Uniform
from sim.model import Invalid
from sim.shapes import Box, Heightfield, Plane, Rectangle
from sim.simulate import Scene, Simulation, Solver, frame_times
from tests.sim.helpers import FREE, balls, fly, random_balls, room, simulation

STIFF = Scene(gravity=FREE, forces={"spring": Spring(stiffness=100.0)})  # h omega = 1: |lambda|^2 = 2 in forward Euler


@pytest.mark.parametrize(
    "duration, every, times",
    [
        (1.0, 0.25, [0, 0.25, 0.5, 0.75, 1]),
        (1.0, 0.4, [0, 0.4, 0.8, 1]),
        (1.0, 5.0, [0, 1]),
        (0.3, 0.1, [0, 0.1, 0.2, 0.3]),  # 3 * 0.1 is a little more than 0.3
        (0.9, 0.3, [0, 0.3, 0.6, 0.9]),  # 3 * 0.3 is a little less than 0.9
        (0.7, 0.1, [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]),  # 0.7 / 0.1 is a little less than 7
    ],
)
def test_frame_times(duration, every, times):
    ours = frame_times(duration, every)
    assert ours == pytest.approx(times, rel=4e-16) and ours[-1] == duration  # a rounding of the product


@pytest.mark.parametrize("n", [7, 99, 100, 4999, 123_457])
def test_as_many_frames_as_fit(n):
    for every in (0.1, 0.01, 1 / 3, 1e-3):
        times = frame_times(n * every, every)
        assert len(times) == n + 1 and times[-1] == n * every and (np.diff(times) > 0).all()


def test_a_flight_in_numbers():
    start = balls(FREE, (1, 0, 0), released=[0.0, 0.25], lifetime=0.5)
    flight = fly(Scene(gravity=FREE), start, step=0.125, duration=1.0, every=0.25)
    assert flight.status == "finished"
    assert np.array_equal(flight.trajectory.step, [0, 2, 4, 6, 8])
    expected = [[0, np.nan], [0.25, 0], [np.nan, 0.25], [np.nan, np.nan], [np.nan, np.nan]]
    assert np.array_equal(flight.trajectory.position[..., 0], expected, equal_nan=True)
    assert (flight.steps, flight.ball_seconds) == (8, 1.0)
    assert (flight.energy_initial, flight.energy_final) == (1.0, 1.0)


def test_runs_repeat():
    ready = simulation(room(many=True), random_balls(1, 100), step=0.02)
    ready.warm()
    flights = [ready.run(), ready.run(), fly(room(many=True), random_balls(1, 100), step=0.02)]
    for flight in flights[1:]:
        assert np.array_equal(flight.bounces, flights[0].bounces)
        assert np.array_equal(flight.trajectory.position, flights[0].trajectory.position)
        assert (flight.steps, flight.penetrations) == (flights[0].steps, flights[0].penetrations)


def test_a_run_leaves_what_it_was_given():
    start = random_balls(1, 100)
    before = start.position.copy(), start.velocity.copy(), start.released.copy()
    fly(room(many=False), start, step=0.02)
    assert all(np.array_equal(a, b) for a, b in zip(before, (start.position, start.velocity, start.released)))


def first_too_fast():
    """The step n at which STIFF's ball, 1 m out at rest, is first above 1e8 m/s: v = 10 * 2^(n/2) |sin(n pi/4)|."""
    n = np.arange(100)
    return np.flatnonzero(10 * 2 ** (n / 2) * np.abs(np.sin(n * np.pi / 4)) > 1e8)[0]


@pytest.mark.parametrize("every", [0.1, 0.5, 200.0])
def test_divergence_keeps_the_good_frames(every):
    """Up to the last one before it. In 200 s the numbers overflow to NaN, which is no speed below 1e8 m/s either."""
    start = balls([(1, 0, 0)] * 70, FREE, lifetime=1e9)
    flight = fly(STIFF, start, "explicit_euler", step=0.1, duration=400.0, every=every)
    assert flight.status == "diverged"
    assert np.isfinite(flight.trajectory.position).all() and np.isfinite(flight.energy.residual).all()
    assert np.linalg.norm(flight.trajectory.velocity, axis=2).max() <= 1e8
    last = (0.1 * first_too_fast() - 1e-9) // every * every
    assert flight.trajectory.time[-1] == pytest.approx(last)
    assert len(flight.trajectory.time) == len(flight.trajectory.step) == len(flight.energy.residual)


def test_one_diverging_ball_ends_the_run_for_all_blocks():
    """Balls in other blocks are cut at the same frame, whether they fly before or after it."""
    for odd in (0, 70, 129):
        start = balls(np.zeros((130, 3)), (1, 0, 0))
        start.position[odd, 1] = 1e-3
        # at the centre at rest in y: only the odd one out is unstable there
        scene = Scene(gravity=FREE, forces={"a": Spring(stiffness=100.0, region={"y": (1e-9, np.inf)}),
                                            "b": Spring(stiffness=100.0, region={"y": (-np.inf, -1e-9)})})  # fmt: skip
        flight = fly(scene, start, "explicit_euler", step=0.1, duration=20.0, every=0.5)
        assert flight.status == "diverged" and 4 < flight.trajectory.time[-1] < 10
        others = np.delete(flight.trajectory.position, odd, axis=1)
        x = np.broadcast_to(flight.trajectory.time[:, None], others.shape[:2])
        assert np.allclose(others[..., 0], x, rtol=1e-13)  # a rounding a step


def test_a_ball_that_diverges_and_ends_between_frames_is_seen():
    start = balls((1, 0, 0), FREE, lifetime=15.0)
    flight = fly(STIFF, start, "explicit_euler", step=0.1, duration=200.0, every=20.0)
    assert flight.status == "diverged" and list(flight.trajectory.time) == [0]


def test_too_fast_from_the_start_keeps_the_release():
    start = balls(np.ones((130, 3)), FREE)
    start.velocity[70, 0] = 2e8
    flight = fly(Scene(), start, duration=1.0)
    assert flight.status == "diverged"
    assert np.array_equal(flight.trajectory.position, np.ones((1, 130, 3)))


def test_just_below_the_limit_is_no_divergence():
    assert fly(Scene(gravity=FREE), balls(FREE, (9.9e7, 0, 0)), duration=1.0).status == "finished"


@pytest.mark.parametrize("asked", [1, 2, 5])
def test_a_stopped_run_has_the_frames_that_all_balls_have(monkeypatch, asked):
    """Three blocks, looked at in turn; stopped at some question it has just the frames that are whole."""
    monkeypatch.setattr(engines, "BUDGET", 10)
    scene, start = room(many=False), random_balls(2, 130, released=0.0073 * np.arange(130))
    whole = fly(scene, start, step=0.01, duration=1.0, every=0.05)
    questions = []

    def stop():
        questions.append(1)
        return len(questions) == asked

    flight = simulation(scene, start, step=0.01, duration=1.0, every=0.05).run(stop)
    frames = len(flight.trajectory.time)
    assert flight.status == "timeout" and 1 <= frames < len(whole.trajectory.time)
    assert np.array_equal(flight.trajectory.position, whole.trajectory.position[:frames], equal_nan=True)
    assert np.array_equal(flight.energy.residual, whole.energy.residual[:frames])
    out = start.released <= flight.trajectory.time[-1]
    brought = np.sum(start.velocity**2, axis=1) / 2 + 9.8 * start.position[:, 1]
    assert flight.energy_initial == pytest.approx(brought[out].sum(), rel=1e-13)  # a sum of 130
    early = whole.bounces[whole.bounces["time"] <= flight.trajectory.time[-1]]
    assert np.array_equal(flight.bounces, early)


def test_a_long_run_stops_soon_although_frames_are_far_apart(monkeypatch):
    monkeypatch.setattr(engines, "BUDGET", 10)
    questions = []
    simulation(Scene(), balls(FREE, FREE), step=1e-3, duration=1.0, every=1.0).run(lambda: bool(questions.append(1)))
    assert len(questions) >= 100


def over_hills(w, count, duration, **forces):
    """Balls on a spring of w rad/s above many faces, and how often it is asked whether to stop when they move exactly."""
    hills = Heightfield(size=(9, 9), cells=(10, 10), height="-2 + 0.1*sin(x)")
    start = balls([(0.4, 0.01 * k, 0) for k in range(count)], np.zeros((count, 3)))
    scene, questions = Scene(gravity=FREE, surfaces={"hills": hills}, forces={"spring": Spring(stiffness=w * w), **forces}), []
    ready = Simulation(scene, start, Solver("exact"), duration, duration)
    flight = ready.run(lambda: bool(questions.append(1)))
    assert flight.status == "finished"
    return flight.steps, len(questions)


def test_a_long_piece_of_flight_counts_for_what_is_looked_at(monkeypatch):
    """Each ball has one, of some hundred swings, and each of those is looked at by itself."""
    monkeypatch.setattr(engines, "PIECES", 100)
    steps, questions = over_hills(w=1e3, count=5, duration=0.6)
    assert steps == 5 and questions >= 5


def test_beyond_the_face_of_a_region_nothing_is_looked_at(monkeypatch):
    """Every half swing crosses one, so takes a fixed number of looks, however many swings there are to come."""
    monkeypatch.setattr(engines, "PIECES", 100)
    gust = Uniform((0, 0, 1), 1.0, region={"x": (0, 9)})
    steps, questions = over_hills(w=1e3, count=1, duration=0.6, gust=gust)
    assert steps > 150 and questions < 0.2 * steps


def test_blocks_are_not_seen(monkeypatch):
    """Small rooms for bounces, small budgets: the same bits."""
    scene, start = room(many=False), random_balls(3, 130, speed=20.0, released=0.0017 * np.arange(130))
    whole = fly(scene, start, step=0.01, duration=1.0, every=0.25)
    assert len(whole.bounces) > 10 * lanes.LANES
    for size, budget in ((3 * lanes.LANES, 4096), (log.FIRST, 1), (3 * lanes.LANES, 7)):
        monkeypatch.setattr(log, "FIRST", size)
        monkeypatch.setattr(log, "MOST", size)
        monkeypatch.setattr(log, "LEAST", 2 * lanes.LANES)
        monkeypatch.setattr(engines, "BUDGET", budget)
        flight = fly(scene, start, step=0.01, duration=1.0, every=0.25)
        assert np.array_equal(flight.bounces, whole.bounces)
        assert np.array_equal(flight.trajectory.position, whole.trajectory.position, equal_nan=True)
        assert np.array_equal(flight.energy.residual, whole.energy.residual)
        assert (flight.steps, flight.penetrations) == (whole.steps, whole.penetrations)


def test_bounces_are_in_order():
    bounces = fly(room(many=False), random_balls(3, 130, speed=20.0), step=0.01).bounces
    keys = list(zip(bounces["time"], bounces["ball"]))
    assert keys == sorted(keys) and len(set(bounces["ball"])) > lanes.LANES


def test_surfaces_are_numbered_in_their_order():
    """However many faces each has."""
    surfaces = {"block": Box(center=(0, 11, 0), size=(4, 4, 4)), "floor": Plane()}
    scene = Scene(gravity=FREE, surfaces=surfaces, restitution=1)
    bounces = fly(scene, balls((0, 5, 0), (0, -10, 0)), step=0.1, duration=2.0).bounces
    assert list(bounces["surface"]) == [1, 0]


SLOPE = {"slope": Rectangle(center=(0, 0, 0), normal=(0.3, 1, 0), size=(4, 4))}
CRATE = {"crate": Box(center=(0, 0, 0), size=(2, 2, 2))}
ABOVE, ASIDE = balls((0, 3, 0), (0.1, 0, 0)), balls((3, 3, 0), (-1, 0, 0))


@pytest.mark.parametrize(
    "surfaces, start, method, shared",
    [
        (SLOPE, ABOVE, "rk4", True),
        (SLOPE, ASIDE, "exact", True),  # a ball anywhere can touch both its sides
        (CRATE, ABOVE, "rk4", True),
        (CRATE, ASIDE, "exact", False),  # of a box the side on which balls start
        (SLOPE | CRATE, ABOVE, "exact", False),
        ({"slope": replace(SLOPE["slope"], size=(4, 5))}, ABOVE, "exact", False),
        ({"another": SLOPE["slope"]}, ABOVE, "exact", False),
    ],
)
def test_geometry_is_shared_where_it_is_the_same(surfaces, start, method, shared):
    before = SLOPE if "crate" not in surfaces else CRATE
    like = Simulation(Scene(surfaces=before), ABOVE, Solver("exact"), 1.0, 0.1)
    other = Simulation(Scene(surfaces=surfaces), start, Solver(method), 1.0, 0.1, like)
    assert (other.features is like.features) == shared
    alone = Simulation(Scene(surfaces=surfaces), start, Solver(method), 1.0, 0.1)
    for ours, theirs in zip(other.features[:3], alone.features[:3]):
        assert np.array_equal(ours, theirs)


def test_the_geometry_of_another_contact_rule_is_another():
    like = Simulation(Scene(surfaces=SLOPE), ABOVE, Solver("rk4"), 1.0, 0.1)
    other = Simulation(Scene(surfaces=SLOPE), ABOVE, Solver("rk4", contact="original"), 1.0, 0.1, like)
    assert len(other.features.edges) == 0 < len(like.features.edges)


@pytest.mark.parametrize(
    "make, field",
    [
        (lambda: Solver("rk5"), "method"),
        (lambda: Solver("rk4_original", step=0.0), "step"),
        (lambda: Solver("rk4_original", step=np.nan), "step"),
        (lambda: Solver("rk4_original", contact="soft"), "contact"),
        (lambda: Scene(gravity=(0, np.inf, 0)), "gravity"),
        (lambda: Scene(wall_mass=0.0), "wall_mass"),
        (lambda: Scene(restitution=1.01), "restitution"),
        (lambda: Scene(damping=-0.01), "damping"),
        (lambda: simulation(Scene(), balls(np.zeros((0, 3)), np.zeros((0, 3)), released=np.zeros(0))), "balls"),
        (lambda: simulation(Scene(wall_mass=5.0), balls(FREE, FREE, mass=5.1)), "mass"),
    ],
)
def test_invalid_runs_say_which_parameter(make, field):
    with pytest.raises(Invalid) as error:
        make()
    assert error.value.field == field and "\n" not in str(error.value)


def test_a_ball_as_heavy_as_the_wall_is_allowed():
    assert isinstance(simulation(Scene(wall_mass=5.0), balls(FREE, FREE, mass=5.0)), Simulation)


def test_a_flight_keeps_what_it_wrote_down_until_it_is_no_more():
    """Then the memory of it is written on anew."""
    scene = Scene(surfaces={"floor": Plane()}, restitution=1.0)
    first, second = (Simulation(scene, balls((0, y, 0), (0, 0, 0)), Solver("exact"), 9.0, 9.0) for y in (1.0, 2.0))
    flight, place = first.run(), log.Log().room().ctypes.data
    for _ in range(3):
        second.run()
    assert log.Log().room().ctypes.data == place
    assert len(flight.bounces) > 5 and np.array_equal(flight.bounces, first.run().bounces)
