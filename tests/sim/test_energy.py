"""The ledger: zero where the method is exact, the method's own error where it is not, and always the same sum."""

import numpy as np
import pytest

from sim import integrators
from sim.forces import Drag, Spring, Uniform
from sim.shapes import Plane
from sim.simulate import Scene
from tests.sim.helpers import AIR, CORRIDOR, FREE, LIFT, WELL, balls, fly, random_balls, room, swept

MASSES = [0.1, 1.0, 10.0, 100.0, 200.0]
SPEEDS = [0.0, 1e-3, 1.0, 1e2, 1e5]
WIND = Uniform(direction=(1, 0.5, -2), magnitude=7.0)
ROUNDING = 1e-12  # of the energy turned over: sums over frames and balls of values rounded at 1e-16


def turnover(energy):
    parts = (energy.kinetic, energy.potential, energy.work, energy.lost, energy.supplied)
    return max(np.abs(part).max() for part in parts)


@pytest.mark.parametrize("mass", MASSES)
@pytest.mark.parametrize("speed", SPEEDS)
def test_no_residual_where_the_method_is_exact(mass, speed):
    """Constant acceleration under `rk4_original`: gravity and a uniform force."""
    start = random_balls(1, 7, mass=mass, speed=speed)
    flight = fly(Scene(forces={"wind": WIND}), start, "rk4_original", step=0.02, duration=2.0)
    assert np.abs(flight.energy.residual).max() <= ROUNDING * turnover(flight.energy)


@pytest.mark.parametrize("mass", MASSES)
@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("method", integrators.fixed())
def test_work_of_a_uniform_force_is_force_times_way(method, mass, speed):
    """Whatever the method makes of the flight, and through bounces too."""
    scene = Scene(forces={"wind": WIND}, surfaces={"floor": Plane(point=(0, -3, 0))})
    start = random_balls(2, 7, mass=mass, speed=speed)
    flight = fly(scene, start, method, step=0.02, duration=1.0)
    force = 7 * np.array((1, 0.5, -2)) / np.sqrt(5.25)
    work = ((flight.trajectory.position - start.position) @ force).sum(axis=1)
    assert np.allclose(flight.energy.work, work, rtol=0, atol=ROUNDING * turnover(flight.energy))
    assert len(flight.bounces) > 0 or speed < 10


def residual_of_drag(method, step):
    """The largest residual as a share of the energy, of a flight with nothing but drag."""
    start = random_balls(3, 5, speed=4.0, mass=0.8)
    energy = fly(Scene(gravity=FREE, forces={"air": AIR}), start, method, step=step, duration=1.0, every=0.25).energy
    return np.abs(energy.residual).max() / turnover(energy)


@pytest.mark.parametrize("method", integrators.fixed())
def test_work_of_drag_is_the_kinetic_loss_to_the_methods_accuracy(method):
    """kinetic - kinetic(0) - work falls with the method's order, or with Simpson's rule's four."""
    errors = [residual_of_drag(method, h) for h in (1 / 64, 1 / 128)]
    order = min(integrators.load(method)[0].order, 4)
    assert errors[1] < 1e-13 or np.log2(errors[0] / errors[1]) > order - 0.2  # the next term, some hundredths
    assert errors[1] < 10 * (1 / 128) ** order


def test_drag_takes_what_the_closed_form_says():
    """K(t) = K(0) exp(-2 c t / m) and nothing else, to the second order of the method."""
    start = random_balls(3, 5, speed=4.0, mass=0.8)
    flight = fly(Scene(gravity=FREE, forces={"air": AIR}), start, "rk4_original", step=1e-3, duration=1.0, every=0.1)
    kinetic = 0.4 * np.sum(start.velocity**2) * np.exp(-2 * flight.trajectory.time)
    assert np.allclose(flight.energy.work, kinetic - kinetic[0], rtol=0, atol=1e-6 * kinetic[0])
    assert np.array_equal(flight.energy.potential, np.zeros(11)) and np.array_equal(flight.energy.lost, np.zeros(11))


@pytest.mark.parametrize("stiffness", [0.0, 3.0, 1e3])
@pytest.mark.parametrize("rate", [1.0, 39.0, 41.0, 1e3, 1e10])
def test_the_exact_solver_knows_the_work_of_drag_however_strong(rate, stiffness):
    """A second is 1e10 time constants of the strongest: pieces of one each would take hours."""
    scene = Scene(forces={"air": Drag(rate), "well": Spring(stiffness)})
    energy = swept(scene, random_balls(3, 5, speed=4.0), every=0.1).energy
    assert np.abs(energy.residual).max() <= ROUNDING * turnover(energy)


@pytest.mark.parametrize("limit", [{"until": 99.0}, {"region": {"x": (-1e9, 1e9)}}])
def test_a_spring_with_limits_counts_as_work(limit):
    """It has no potential that holds always; the same spring without limits does, and moves the ball alike."""
    start = random_balls(4, 5, speed=4.0, mass=0.8)
    # twice, as kernels are made for 0 and for 2 fields with limits
    halves = {name: Spring(stiffness=15.0, center=WELL.center, **limit) for name in "ab"}
    free, limited = (
        fly(Scene(forces=fields), start, "rk4_original", step=1e-3, duration=1.0, every=0.1)
        for fields in ({"well": WELL}, halves)
    )
    stored = 15 * np.sum((free.trajectory.position - WELL.center) ** 2, axis=(1, 2))
    gravity = 0.8 * 9.8 * free.trajectory.position[:, :, 1].sum(axis=1)
    assert np.allclose(free.energy.potential, gravity + stored, rtol=1e-13)
    assert np.allclose(limited.energy.potential, gravity, rtol=1e-13)
    assert np.array_equal(free.energy.work, np.zeros(11))
    # Simpson's rule over steps of h omega = 6e-3: (6e-3)^4 / 180 of some 1e3 J
    assert np.allclose(limited.energy.work, stored[0] - stored, rtol=0, atol=1e-7)
    assert np.allclose(limited.energy.residual, free.energy.residual, rtol=0, atol=1e-7)


def test_a_field_that_acts_nowhere_near_does_no_work():
    scene = Scene(forces={"far": Uniform(direction=(1, 0, 0), magnitude=5.0, region={"x": (50, 60)}), "lift": LIFT})
    flight = fly(scene, balls(FREE, FREE, mass=2.0), "rk4_original", step=0.01, duration=1.0)
    # the lift alone, 14 N for the 32 steps that begin before 0.3137 s; a step that is left half way is not exact
    assert np.array_equal(flight.trajectory.position[:, 0, [0, 2]], np.zeros((101, 2)))
    assert flight.energy.work[31] == pytest.approx(14 * flight.trajectory.position[31, 0, 1], rel=1e-12)
    assert np.array_equal(flight.energy.work[33:], np.full(68, flight.energy.work[33]))


def test_births_and_deaths_keep_the_sum():
    """In free flight each ball carries off what it came with: what is supplied is what the balls alive came with."""
    start = random_balls(5, 90, released=0.0173 * np.arange(90), lifetime=0.6119, mass=3.0)
    flight = fly(Scene(), start, "rk4_original", step=0.01, duration=2.0, every=0.05)
    brought = 1.5 * np.sum(start.velocity**2, axis=1) + 3 * 9.8 * start.position[:, 1]
    alive = np.isfinite(flight.trajectory.position[..., 0])
    assert alive.any(axis=0).all() and not alive[-1, 0]
    assert np.allclose(flight.energy.supplied, alive @ brought, rtol=0, atol=ROUNDING * turnover(flight.energy))
    assert np.abs(flight.energy.residual).max() <= ROUNDING * turnover(flight.energy)
    assert flight.energy_initial == pytest.approx(brought.sum(), rel=1e-13)
    assert flight.energy_final == pytest.approx(brought.sum(), rel=1e-13)


@pytest.mark.parametrize("lifetime", [15.0, 0.6119])
@pytest.mark.parametrize("method", integrators.fixed())
def test_the_sum(method, lifetime):
    """All of it at once: every part but the residual is known from elsewhere, so the residual is what it says."""
    scene = room(many=False, damping=0.2, forces={"well": WELL, "air": AIR})
    start = random_balls(6, 30, released=0.0173 * np.arange(30), mass=2.0, lifetime=lifetime)
    flight = fly(scene, start, method, step=0.01, duration=1.5, every=0.05)
    energy, x, v = flight.energy, flight.trajectory.position, flight.trajectory.velocity
    kinetic, potential = v**2, 15 * np.sum((x - WELL.center) ** 2, axis=2) + 2 * 9.8 * x[..., 1]
    near = {"rtol": 1e-13, "atol": ROUNDING * turnover(energy)}
    assert np.allclose(energy.kinetic, np.nansum(kinetic, axis=(1, 2)), **near)
    assert np.allclose(energy.potential, np.nansum(potential, axis=1), **near)
    for time, lost in zip(flight.trajectory.time, energy.lost):
        assert lost == pytest.approx(flight.bounces["energy_lost"][flight.bounces["time"] <= time].sum(), rel=1e-12)
    total = energy.kinetic + energy.potential - energy.supplied - energy.work + energy.lost
    assert np.allclose(energy.residual, total, **near)
    change = flight.energy_final - flight.energy_initial
    assert change - energy.work[-1] + energy.lost[-1] == pytest.approx(energy.residual[-1], abs=near["atol"])
    if lifetime == 15.0:
        assert flight.energy_final == pytest.approx(energy.kinetic[-1] + energy.potential[-1], rel=1e-12)


@pytest.mark.parametrize("mass", MASSES)
def test_constant_gravity_errs_at_bounces_only(mass):
    """With `rk4_original` every bit of the error comes from the contact rule."""
    start = balls((0, 1, 0), (1, 0, 0), mass=mass)
    flight = fly(Scene(surfaces={"floor": Plane()}), start, "rk4_original", step=0.01, duration=3.0)
    jumps = np.abs(np.diff(flight.energy.residual))
    bounced = np.histogram(flight.bounces["time"], flight.trajectory.time)[0] > 0
    assert bounced.sum() >= 1
    assert jumps[~bounced].max() <= ROUNDING * turnover(flight.energy)
    # h g against a speed of 4.4 m/s is 2 %; what of it is an error depends on where in its step the bounce falls
    jumps /= flight.energy_initial
    assert jumps[bounced].min() > 1e-6 and jumps[bounced].max() > 5e-3


def test_what_a_forward_euler_step_adds_in_a_bounce():
    """The bounce in numbers: the fall within the step is not made, the speed of all of it is put on."""
    scene = Scene(gravity=(0, -2, 0), surfaces={"floor": Plane()}, restitution=0.5, damping=0.25)
    flight = fly(scene, balls((0, 2, 0), (4, -3, 0), mass=2.0, radius=0.5), step=1.0, duration=1.0)
    # before: 25 + 8 J; lost: 13.75; after: at 1.25 m with (3, -0.5) m/s: 9.25 + 5 J
    assert np.allclose(flight.energy.residual, (0, 9.25 + 5 - 33 + 13.75), rtol=0, atol=1e-14)


def test_a_corridor_gains_what_the_way_through_it_gives():
    """Across the slab at constant speed, with steps that meet its faces: 20 N along the way made inside."""
    scene = Scene(gravity=FREE, forces={"corridor": CORRIDOR, "none": Drag(coefficient=1e-300, until=1.0)})
    flight = fly(scene, balls((-1, 0, 0), (2, 0, 0)), "rk4_original", step=1 / 64, duration=1.0)
    z = flight.trajectory.position[:, 0, 2]
    inside = np.abs(flight.trajectory.position[:, 0, 0]) < 0.5
    assert inside.sum() == 31
    # a step across a face makes a share of its way inside: at most 20 N over 1/64 of some 5 m at each
    assert flight.energy.work[-1] == pytest.approx(20 * (z[48] - z[16]), abs=2.0)
    within = np.flatnonzero(inside)
    assert np.allclose(np.diff(flight.energy.work[within]), 20 * np.diff(z[within]), rtol=1e-12)


@pytest.mark.parametrize("method", [*integrators.names(), "exact"])
def test_pieces_too_short_to_divide_by(method):
    """A ball that starts as near to a region's face as numbers go, under a field that ends as soon as time goes."""
    drag, kick = Drag(1.0), Uniform((0, 0, 1), 1.0, until=1e-200)
    forces = {"drag": drag, "kick": kick, "push": Uniform((0, 0, 1), 1.0, region={"y": (-1, 0)})}
    start = balls([[0, -2.22507386e-309, 0]], [[0, 1.0, 0]])
    flight = swept(Scene(forces=forces), start, method, every=0.05)
    ledger = flight.energy
    for values in (flight.trajectory.position, flight.trajectory.velocity, ledger.work, ledger.residual):
        assert np.isfinite(values).all()
