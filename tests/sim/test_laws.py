"""Laws that every method keeps, or breaks as theory says: order through events, energy in the long run, angular momentum,
reversal of time, and exactness. A new method is held to them by being there."""

from functools import cache
from importlib import import_module

import numpy as np
import pytest

from sim import forces, integrators
from sim.forces import Drag, Spring, Uniform
from sim.model import Invalid
from sim.shapes import Plane
from sim.simulate import Scene, Simulation, Solver
from tests.sim.helpers import FREE, balls, fly, last, swept
from tests.sim.test_methods import amplification

ADAPTIVE = [name for name in integrators.names() if name not in integrators.fixed()]
SPRING = forces.Forces(np.array([1.0, 2.0, 3.0, 4.0, 0.0]), np.zeros(5), np.zeros((0, forces.WIDTH)))
DAMPED = forces.Forces(np.array([1.0, 2.0, 3.0, 4.0, 0.7]), np.zeros(5), np.zeros((0, forces.WIDTH)))


def claims(method):
    return integrators.load(method)[0]


# Order.

AIR, WELL = Drag(0.5), Spring(stiffness=8.0, center=(0.3, 0.5, 0.2))
DURATION = 2.0
COURSES = {
    "smooth": Scene(forces={"air": AIR, "well": WELL}),
    "bounces": Scene(surfaces={"floor": Plane()}, forces={"air": AIR, "well": WELL}, restitution=0.9),
    "edges": Scene(
        gravity=(0, -2, 0),
        forces={
            "corridor": Uniform(direction=(0, 1, 2), magnitude=6.0, region={"x": (-0.5, 0.5)}),
            "well": Spring(stiffness=10.0, region={"y": (-0.4, 2), "z": (-1, 1)}),
            "air": Drag(1.0, until=0.71),
            "lift": Uniform(direction=(1, 2, 0), magnitude=3.0, until=1.3),
        },
    ),
}


def runners():
    rng = np.random.default_rng(3)
    return balls(rng.uniform((-1, 0.6, -1), (1, 1.4, 1), (200, 3)), rng.normal(0, 1.5, (200, 3)), mass=1.3, lifetime=99)


@cache
def finish(course, method, step=1.0, tolerance=1.0, contact="swept"):
    return Simulation(COURSES[course], runners(), Solver(method, step, tolerance, contact), DURATION, DURATION).run()


def error(course, method, **options):
    """The error of a ball in (x, v) at the end, the geometric mean over 200 of them.

    Where in a step an event falls makes the error of a ball some times larger or smaller, and one that just grazes a field's face
    is off by thousands of times as much; so many balls, and this mean."""
    end, truth = finish(course, method, **options).trajectory, finish(course, "exact").trajectory
    off = np.hstack([end.position[-1] - truth.position[-1], end.velocity[-1] - truth.velocity[-1]])
    return np.exp(np.mean(np.log(np.linalg.norm(off, axis=1))))


def test_the_courses_have_events():
    bounces = np.bincount(finish("bounces", "exact").bounces["ball"])
    assert len(bounces) == 200 and bounces.min() >= 2 and np.median(bounces) >= 3
    bare = Scene(gravity=(0, -2, 0), forces={"lift": COURSES["edges"].forces["lift"]})
    away = last(Simulation(bare, runners(), Solver("exact"), DURATION, DURATION).run()) - last(finish("edges", "exact"))
    assert (np.linalg.norm(away, axis=1) > 1e-3).mean() > 0.9


#: Steps at which the next term of the error is below 0.1 of it, and rounding as well.
FINE = {1: 1 / 2048, 2: 1 / 256, 4: 1 / 64}


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("method", integrators.fixed())
def test_order_through_events(method, course):
    """Swept contact, faces of regions and ends of fields cost no order."""
    order = claims(method).order
    errors = [error(course, method, step=FINE[order] / n) for n in (1, 4)]
    # 0.15: of 200 balls the mean is known to some 10 %, 0.07 over a factor of four in the step; and the next term
    assert np.log2(errors[0] / errors[1]) / 2 == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("method", ADAPTIVE)
def test_tolerance_through_events(method, course):
    """The error falls in proportion to the tolerance, and is not far from it: of 10 to 200 steps, some events, and 2 s."""
    tolerances = 10.0 ** -np.arange(4, 12)
    errors = np.array([error(course, method, tolerance=each) for each in tolerances])
    assert np.log10(errors[0] / errors[-1]) / 7 == pytest.approx(1, abs=0.05)
    assert (errors < 10 * tolerances).all() and (errors > 0.1 * tolerances).all()


@pytest.mark.parametrize("method", integrators.fixed())
def test_the_original_contact_rule_is_of_first_order_at_best(method):
    """After the hit it goes straight on for the rest of the step and adds h a of its start: an error of h^2 each in place, and
    of h in velocity, whatever the method; a ball that it lets through is off by metres."""
    h = 1 / 256  # so that even a first-order method errs by less than the course is long
    errors = [error("bounces", method, step=h / n, contact="original") for n in (1, 8)]
    assert np.log2(errors[0] / errors[1]) / 3 < 1.3  # 1, and what the phases of 600 hits add
    if claims(method).order > 1:
        assert errors[1] > 30 * error("bounces", method, step=h / 8)


# Exactness.


@pytest.mark.parametrize("method", integrators.names())
def test_exact_on_constant_acceleration_from_the_second_order_on(method):
    """By its units the error of a step is a number times h^2 a in place and times h a in velocity: of second order is exact."""
    scene = Scene(forces={"wind": Uniform(direction=(1, 2, 3), magnitude=5.0)})
    start = balls([(1, -2, 0.5), (0, 1, 2)], [(3, 1, -2), (-40, 7, 0)])
    flight = swept(scene, start, method, step=0.5, duration=10.0, every=0.3)
    t, a = flight.trajectory.time[:, None, None], np.array(scene.gravity) + 5 * np.array([1, 2, 3]) / np.sqrt(14)
    position = np.abs(flight.trajectory.position - start.position - t * start.velocity - t**2 / 2 * a).max()
    velocity = np.abs(flight.trajectory.velocity - start.velocity - t * a).max()
    if claims(method).order > 1:
        assert position < 1e-11 and velocity < 1e-12  # 20 steps that round values of up to 600 m
    else:
        assert position > 1.0  # h T |a| / 2 = 25 m
    if claims(method).adaptive:
        assert flight.steps == 2  # one for each ball: nothing makes it shorter


# Energy, angular momentum and time.

#: What a step z = h omega makes of the area in phase space, and so of an oscillator's energy in the mean: the determinant of its
#: matrix. For a Runge-Kutta method |R(iz)|^2 with R its stability function.
AREA = {
    "explicit_euler": lambda z: 1 + z**2,
    "implicit_euler": lambda z: 1 / (1 + z**2),
    "rk4": lambda z: 1 - z**6 / 72 + z**8 / 576,
    "rk4_original": lambda z: 1 - z**4 / 24 + z**6 / 288 - z**8 / 576,
    "dopri5": lambda z: 1 - z**6 / 1800 + z**8 / 1600 - z**10 / 14400 + z**12 / 360000,
}


def area(method, z):
    return AREA[method](z) if method in AREA else 1.0


@pytest.mark.parametrize("z", [0.1, 0.5, 1.3])
@pytest.mark.parametrize("method", integrators.names())
def test_area(method, z):
    """By its formula; one for a symplectic method."""
    assert claims(method).symplectic != (method in AREA)
    assert np.linalg.det(amplification(method, z, 1.0, 0.0)) == pytest.approx(area(method, z), rel=1e-14)  # some roundings


def orbit(method, z, steps):
    """An orbit about a spring's centre with omega = 1 s^-1, not a circle, a frame a step."""
    scene = Scene(gravity=FREE, forces={"well": Spring(stiffness=1.0)})
    start = balls((1, 0.2, 0), (0, 0.5, 0.7), lifetime=1e9)
    return fly(scene, start, method, step=z, duration=z * steps).trajectory


Z = 0.5


def many(method):
    """Steps after which area(Z) is e^2 or e^-2, or 100,000, 8000 times around."""
    rate = abs(np.log(area(method, Z)))
    return int(min(max(2 / rate, 100), 1e5)) if rate else 100_000


@pytest.mark.parametrize("method", integrators.fixed())
def test_energy_in_the_long_run(method):
    """A symplectic method's swings about a value that stays, any other's grows or falls by its area each step."""
    n = many(method)
    flight = orbit(method, Z, n)
    energy = (0.5 * (flight.position**2 + flight.velocity**2)).sum(axis=(1, 2))
    around = 63  # steps, 5.01 times around
    change = energy[-around:].mean() / np.mean(energy[:around] * area(method, Z) ** (n + 1 - around))
    # 63 steps are 0.014 of a turn more than five, or less, as the method turns; of a swing of 0.5 that is 0.5 * 0.014 / 5 / 2
    assert change == pytest.approx(1, abs=2e-3)
    if claims(method).symplectic:
        # an ellipse: at most (1 + z/2)/(1 - z/2) for first order, see test_methods
        assert energy.max() / energy.min() < (1 + Z / 2) / (1 - Z / 2)


@pytest.mark.parametrize("method", integrators.fixed())
def test_angular_momentum(method):
    """It goes by the area too, as all axes share one matrix; so the symplectic methods keep it: their kicks are along x, which
    turns no x x v, and their drifts along v."""
    n = many(method)
    flight = orbit(method, Z, n)
    x, v = flight.position[[0, -1], 0], flight.velocity[[0, -1], 0]
    before, after = np.cross(x, v)
    # up to 1e5 steps, each with some roundings of 1e-16, most of them at random
    assert np.linalg.norm(after / area(method, Z) ** n - before) < 1e-11 * np.linalg.norm(before)


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("tolerance", [1e-5, 1e-8])
def test_steps_and_energy_of_an_adaptive_method(method, tolerance):
    """On a circle every step is alike, so the control settles where it asks for no change, and the area tells the energy."""
    scene = Scene(gravity=FREE, forces={"well": Spring(stiffness=1.0)})
    start = balls((1, 0, 0), (0, 1, 0), lifetime=1e9)
    flight = swept(scene, start, method, duration=1000.0, tolerance=tolerance)
    embedded = import_module(f"sim.integrators.{method}").embedded
    spring = forces.Forces(np.array([0, 0, 0, 1.0, 0]), np.zeros(5), np.zeros((0, forces.WIDTH)))
    low, high = 1e-3, 1.0
    while high - low > 1e-9:
        h = (low + high) / 2
        _, _, _, dx, dv = embedded(h, 0.0, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), spring)
        error = max(np.linalg.norm(dx), np.linalg.norm(dv)) / 2  # 1 + |x| = 2
        low, high = (low, h) if error > 0.9**5 * tolerance else (h, high)
    assert flight.steps == pytest.approx(1000 / low, rel=0.01)
    energy = flight.energy.kinetic[-1] + flight.energy.potential[-1]
    assert np.log(energy) == pytest.approx(flight.steps * np.log(area(method, low)), rel=0.05)


@pytest.mark.parametrize("field", [SPRING, DAMPED], ids=["spring", "damped"])
@pytest.mark.parametrize("method", integrators.names())
def test_reversal(method, field):
    """A step of -h undoes one of h, drag or none, where the method says so."""
    step = integrators.load(method)[1]
    x, v = (0.3, -1.0, 2.0), (1.0, 0.5, -0.7)
    x1, v1 = step(0.3, 0.0, x, v, field)
    x2, v2 = step(-0.3, 0.3, x1, v1, field)
    miss = np.abs(np.subtract(x2, x)).max() + np.abs(np.subtract(v2, v)).max()
    # h omega = 0.6: what a method that is not symmetric misses by is 0.6^6/720 = 6e-5 of it at least for order 5
    assert miss < 1e-14 if claims(method).reversible else miss > 1e-6


@pytest.mark.parametrize("method", [name for name in integrators.fixed() if claims(name).reversible])
def test_a_flight_back(method):
    """With its velocity turned around a ball flies back to where it came from, as in nature."""
    scene, h, n = Scene(gravity=(1, -2, 0.5), forces={"well": Spring(stiffness=4.0)}), 0.1, 1000
    there = fly(scene, balls((0.3, -1, 2), (1, 0.5, -0.7), lifetime=1e9), method, step=h, duration=n * h).trajectory
    back = fly(scene, balls(there.position[-1], -there.velocity[-1], lifetime=1e9), method, step=h, duration=n * h).trajectory
    # thousands of roundings; and every step by itself, not the end alone
    assert np.abs(back.position - there.position[::-1]).max() < 1e-12
    assert np.abs(back.velocity + there.velocity[::-1]).max() < 1e-12


def test_backward_euler_is_implicit():
    """The acceleration of its step is that at the end, which is what it is solved for."""
    step = integrators.load("implicit_euler")[1]
    for h in (1e-3, 0.1, 10.0, 1e6):
        x, v = (0.3, -1.0, 2.0), (1.0, 0.5, -0.7)
        x1, v1 = step(h, 0.0, x, v, DAMPED)
        a1 = forces.acceleration(h, x1, v1, DAMPED)
        # what a1 is the sum of, up to 10, rounds
        assert np.allclose(np.subtract(v1, v), np.multiply(h, a1), rtol=0, atol=1e-15 * (10 + 10 * h))
        assert np.allclose(np.subtract(x1, x), np.multiply(h, v1), rtol=0, atol=1e-15 * (3 + h))


# Adaptive methods: what they go by, and what not.


@pytest.mark.parametrize("method", ADAPTIVE)
def test_an_adaptive_method_knows_swept_contact_only(method):
    with pytest.raises(Invalid, match=f"the method {method} knows swept contact only"):
        Solver(method, contact="original")


@pytest.mark.parametrize("method", ADAPTIVE)
def test_neither_frames_nor_the_step_change_an_adaptive_flight(method):
    scene, start = COURSES["bounces"], runners()
    few = Simulation(scene, start, Solver(method, 1.0), 2.0, 2.0).run()
    more = Simulation(scene, start, Solver(method, 1e-5), 2.0, 0.01).run()
    assert np.array_equal(last(few), last(more)) and np.array_equal(few.bounces, more.bounces)
    assert few.steps == more.steps and np.array_equal(more.trajectory.step, np.arange(201))


@pytest.mark.parametrize("method", ADAPTIVE)
def test_frames_within_a_step_are_as_good_as_its_ends(method):
    """Those of the interpolant: place, speed, and the work of drag that the ledger needs."""
    tolerance, start = 1e-8, runners()
    solvers = Solver(method, tolerance=tolerance), Solver("exact")
    flight, truth = (Simulation(COURSES["smooth"], start, solver, 2.0, 0.01).run() for solver in solvers)
    for name in ("position", "velocity"):
        off = np.abs(getattr(flight.trajectory, name) - getattr(truth.trajectory, name))
        assert off.max() < 30 * tolerance  # the largest of 120,000; the mean at the end is 2 of it, see above
    # 200 balls, each m v = 10 kg m/s times the error of v, all of one sign as the method damps
    assert np.abs(flight.energy.residual).max() < 100 * tolerance * 200
