"""Whatever is valid ends: in a status of its own, with numbers where balls are alive and nowhere else."""

import faulthandler

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from sim import integrators
from sim.engines import Stalled
from sim.forces import Drag, Spring, Uniform
from sim.model import FASTEST, Balls, Invalid
from sim.release import Emitter, Listed, Scatter, Start
from sim.shapes import Box, Heightfield, Plane, Rectangle, Triangles
from sim.simulate import METHODS, Scene, Simulation, Solver

SECONDS = 300  # after which a run that does not even ask whether to stop ends the tests; `pytest -s` shows where it is
MOST_ASKED = 2000  # times that a run may ask whether to stop; those here ask a few times
MOST_STEPS = 1_000_000  # of an adaptive method, which takes as many as its stability wants: a longer run ends by --timeout

places = st.one_of(st.floats(-2, 2), st.sampled_from([0.0, 1e-12, -0.5, 1e6]))
vectors = st.tuples(places, places, places)
directions = vectors.filter(any)
lengths = st.one_of(st.floats(0.05, 3), st.sampled_from([1e-6, 1.0, 1e4]))
strengths = st.one_of(st.floats(0, 50), st.sampled_from([0.0, 1e-9, 1e5]))
fractions = st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0, 1))
# one narrower than rounding may hold a ball for a million events, which is Stalled, after a minute each
intervals = st.tuples(places, places).filter(lambda ends: ends[1] - ends[0] > 1e-9)

shapes = st.one_of(
    st.builds(Plane, point=vectors, normal=directions),
    st.builds(Rectangle, center=vectors, normal=directions, size=st.tuples(lengths, lengths)),
    st.builds(Box, center=vectors, size=st.tuples(lengths, lengths, lengths), inside=st.booleans()),
    st.builds(
        Heightfield, size=st.tuples(lengths, lengths), cells=st.tuples(st.integers(1, 4), st.integers(1, 4)),
        height=st.sampled_from(["0", "0.3*sin(2*x)*cos(2*z)", "abs(x) - 1", "x**2*z"]),
    ),
    st.lists(vectors, min_size=3, max_size=9).map(lambda v: Triangles(np.array(v), np.arange(len(v) // 3 * 3).reshape(-1, 3))),
)  # fmt: skip
always = st.one_of(
    st.builds(Uniform, direction=directions, magnitude=strengths),
    st.builds(Drag, coefficient=strengths),
    st.builds(Spring, stiffness=strengths, center=vectors),
)
limits = {"region": st.dictionaries(st.sampled_from("xyz"), intervals, max_size=2), "until": st.none() | st.floats(0.01, 1)}
sometimes = st.builds(Uniform, direction=directions, magnitude=strengths, **limits)
sources = st.one_of(
    st.builds(Emitter, position=vectors, direction=directions, speed=strengths, spread=st.floats(0, 360), rate=st.floats(1, 8)),
    st.lists(st.builds(Start, position=vectors, velocity=vectors), min_size=1, max_size=4).map(Listed),
    st.builds(Scatter, count=st.integers(1, 5), box=st.just(((-1.0, 0.0, -1.0), (1.0, 2.0, 1.0))), max_speed=strengths),
)


@st.composite
def scenes(draw, fields):
    """A scene with surfaces and `fields`, and balls in it."""
    wall = draw(st.sampled_from([200.0, 1e-3, 1e6]))
    scene = Scene(
        gravity=draw(st.sampled_from([(0.0, -9.8, 0.0), (0.0, 0.0, 0.0)]) | vectors),
        surfaces={str(number): shape for number, shape in enumerate(draw(st.lists(shapes, max_size=3)))},
        wall_mass=wall, restitution=draw(st.none() | fractions), damping=draw(fractions),
        forces={str(number): field for number, field in enumerate(draw(fields))},
    )  # fmt: skip
    mass, radius, lifetime = wall * draw(st.sampled_from([0.005, 0.5, 1.0])), draw(st.floats(1e-3, 0.3)), draw(st.floats(0.05, 2))
    return scene, Balls(mass, radius, lifetime, *draw(sources).release(0.5))


def stiff(scene, balls, method):
    """Whether an adaptive method takes more than MOST_STEPS steps in half a second, as short as its stability limits ask for."""
    claims = method in integrators.names() and integrators.load(method)[0]
    if not (claims and claims.adaptive):
        return False
    rate = sum(force.coefficient for force in scene.forces.values() if isinstance(force, Drag)) / balls.mass
    squared = sum(force.stiffness for force in scene.forces.values() if isinstance(force, Spring)) / balls.mass
    return 0.5 * len(balls) * max(rate / claims.drag_limit, squared**0.5 / claims.oscillator_limit) > MOST_STEPS


def ends_well(found, method, contact, step=0.01):
    scene, balls = found
    endless, asked = stiff(scene, balls, method), 0

    def stop():
        nonlocal asked
        asked += 1
        faulthandler.dump_traceback_later(SECONDS, exit=True)
        return asked > (10 if endless else MOST_ASKED)

    try:
        simulation = Simulation(scene, balls, Solver(method, step=step, tolerance=1e-6, contact=contact), 0.5, 0.05)
    except Invalid:  # a ball starts inside a surface
        assume(False)
    simulation.warm()  # compiling takes as long on a busy machine
    faulthandler.dump_traceback_later(SECONDS, exit=True)
    try:
        flight = simulation.run(stop)
    except Stalled:
        return  # the run has failed, and says why
    finally:
        faulthandler.cancel_dump_traceback_later()
    assert flight.status in ("finished", "rested", "diverged") or endless and flight.status == "timeout"
    time, position, velocity = flight.trajectory.time, flight.trajectory.position, flight.trajectory.velocity
    age = time[:, None] - balls.released
    inside = (age >= 1e-9) & (age < balls.lifetime - 1e-9)
    outside = (age < -1e-9) | (age > balls.lifetime + 1e-9)
    for numbers in (position, velocity):
        assert np.isfinite(numbers[inside]).all() and np.isnan(numbers[outside]).all()
    assert np.nanmax(np.abs(velocity), initial=0) <= FASTEST
    for name in ("kinetic", "potential", "work", "lost", "supplied", "residual"):
        assert np.isfinite(getattr(flight.energy, name)).all(), name
    bounces = flight.bounces
    assert np.isfinite(bounces["position"]).all() and (np.diff(bounces["time"]) >= 0).all() and (bounces["energy_lost"] >= 0).all()


few = settings(max_examples=40, derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck))
many = settings(few, max_examples=400)


@few
@given(scenes(st.lists(st.builds(Uniform, direction=directions, magnitude=strengths), max_size=2)))
def test_the_exact_solver_ends(found):
    ends_well(found, "exact", "swept")


@pytest.mark.slow
@pytest.mark.parametrize("contact", ["swept", "original"])
@pytest.mark.parametrize("method", METHODS)
def test_every_method_ends(method, contact):
    if contact == "original" and method not in integrators.fixed():
        pytest.skip("knows swept contact only")
    for fields in (st.lists(always, max_size=2), st.tuples(always, sometimes)):
        many(given(scenes(fields))(lambda found: ends_well(found, method, contact)))()
