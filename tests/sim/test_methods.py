"""Every method against its formula and against what it claims; a new method is held to its claims by being there."""

import numpy as np
import pytest

from sim import engines, forces, integrators, jit
from sim.simulate import Scene
from tests.sim import plain
from tests.sim.helpers import AIR, CORRIDOR, FREE, LIFT, WELL, balls, fly, random_balls

SMOOTH = {
    "gravity": {},
    "drag": {"air": AIR},
    "spring": {"well": WELL},
    "both": {"air": AIR, "well": WELL},
    "switched": {"corridor": CORRIDOR, "lift": LIFT},
    "switched affine": {
        "well": forces.Spring(stiffness=40.0, region={"x": (-0.4, 0.6), "z": (-1, 1)}),
        "air": forces.Drag(coefficient=1.5, until=0.52),
    },
}


def largest_difference(flight, plain_flights):
    x = np.stack([p.position for p in plain_flights], axis=1)
    v = np.stack([p.velocity for p in plain_flights], axis=1)
    assert np.array_equal(np.isnan(flight.trajectory.position), np.isnan(x))
    return max(np.nanmax(np.abs(flight.trajectory.position - x)), np.nanmax(np.abs(flight.trajectory.velocity - v)))


@pytest.mark.parametrize("fields", SMOOTH)
@pytest.mark.parametrize("method", plain.METHODS)
def test_flight_is_the_formula(method, fields):
    """Frames inside steps, releases between steps, a lifetime and a duration that end inside a step."""
    scene = Scene(forces=SMOOTH[fields])
    start = random_balls(2, 8, speed=2.0, released=0.0237 * np.arange(8), mass=1.7, lifetime=0.6119)
    flight = fly(scene, start, method, step=0.01, duration=0.7077, every=0.0131)
    times = flight.trajectory.time
    assert times[-1] == 0.7077
    expected = [plain.Flight(scene, start, i, method, 0.01, times) for i in range(8)]
    # 70 steps that round values up to 10 by 1e-16 of them
    assert largest_difference(flight, expected) < 1e-12


def error(method, h, fields):
    """RMS over the frames of the error in (x, v), against the closed form by eigenvalues of each axis' equation."""
    mass, duration, scene = 1.3, 2.0, Scene(forces=fields)
    w2 = sum(f.stiffness for f in fields.values() if isinstance(f, forces.Spring)) / mass
    b = sum(f.coefficient for f in fields.values() if isinstance(f, forces.Drag)) / mass
    start = balls((1.0, -0.5, 0.3), (2.0, 3.0, -4.0), mass=mass)
    flight = fly(scene, start, method, step=h, duration=duration, every=duration / 8)
    # y = (x, v, 1), y' = A y on each axis
    center = np.array(WELL.center) if w2 else np.zeros(3)
    errors = []
    for k in range(3):
        a = np.array([[0, 1, 0], [-w2, -b, w2 * center[k] + scene.gravity[k]], [0, 0, 0]])
        values, vectors = np.linalg.eig(a)
        share = np.linalg.solve(vectors, [start.position[0, k], start.velocity[0, k], 1])
        exact = (vectors * share) @ np.exp(np.outer(values, flight.trajectory.time))
        measured = flight.trajectory.position[:, 0, k], flight.trajectory.velocity[:, 0, k]
        errors += [measured[0] - exact[0].real, measured[1] - exact[1].real]
    return np.sqrt(np.mean(np.square(errors)))


@pytest.mark.parametrize("fields", ["spring", "both"])
@pytest.mark.parametrize("method", integrators.fixed())
def test_order(method, fields):
    claim = integrators.load(method)[0].order
    # h omega = 0.04: the next term of the error moves the measured order by some hundredths; rounding is below 1e-13
    measured = np.log2(error(method, 1 / 128, SMOOTH[fields]) / error(method, 1 / 256, SMOOTH[fields]))
    assert measured == pytest.approx(claim, abs=0.15)


def amplification(method, z, w2, b):
    """The matrix of one step of length z on x'' = -w2 x - b x'."""
    step = integrators.load(method)[1]
    field = forces.Forces(np.array([0.0, 0, 0, w2, b]), np.zeros(5), np.zeros((0, forces.WIDTH)))
    columns = [step(z, 0.0, (x, 0.0, 0.0), (v, 0.0, 0.0), field) for x, v in ((1.0, 0.0), (0.0, 1.0))]
    return np.array([[x[0], v[0]] for x, v in columns]).T


def first_unstable(grows):
    """The least z > 0 at which `grows(z)`; 0 if from the start, infinite if not up to 50."""
    scan = np.arange(1, 2501) * 0.02
    unstable = [z for z in scan if grows(z)]
    if not unstable:
        return np.inf
    if unstable[0] == scan[0]:
        return 0.0
    low, high = unstable[0] - 0.02, unstable[0]
    while high - low > 1e-6:
        middle = (low + high) / 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return high


@pytest.mark.parametrize("method", integrators.names())
def test_oscillator_limit(method):
    # 1e-7: two eigenvalues that meet on the unit circle are known to the root of the rounding only
    measured = first_unstable(lambda z: np.abs(np.linalg.eigvals(amplification(method, z, 1.0, 0.0))).max() > 1 + 1e-7)
    # 0.5 %: what a claim of four figures is good for
    assert measured == pytest.approx(integrators.load(method)[0].oscillator_limit, rel=5e-3)


@pytest.mark.parametrize("method", integrators.names())
def test_drag_limit(method):
    measured = first_unstable(lambda z: abs(amplification(method, z, 0.0, 1.0)[1, 1]) > 1 + 1e-12)
    assert measured == pytest.approx(integrators.load(method)[0].drag_limit, rel=5e-3)


@pytest.mark.parametrize("method", integrators.fixed())
def test_the_limit_holds_in_a_flight(method):
    """Just below the limit a ball in a spring stays for 4000 steps, just above it is thrown out."""
    limit = integrators.load(method)[0].oscillator_limit
    well = Scene(gravity=FREE, forces={"well": forces.Spring(stiffness=1.0)})
    start = balls((1, 0, 0), FREE, lifetime=1e9)
    if 0 < limit < np.inf:
        below = fly(well, start, method, step=0.99 * limit, duration=3960 * limit)
        # a symplectic orbit at 0.99 of 2 is an ellipse 1/sqrt(1 - 0.99^2) = 7.1 times as long as wide
        assert below.status == "finished" and np.abs(below.trajectory.position).max() < 7.1
    if limit < np.inf:
        h = max(1.01 * limit, 0.1)
        assert fly(well, start, method, step=h, duration=4000 * h).status == "diverged"


def test_explicit_euler_grows_at_every_step():
    """|lambda|^2 = 1 + z^2 exactly."""
    for z in (1e-3, 1e-2, 0.1, 1.0):
        size = np.abs(np.linalg.eigvals(amplification("explicit_euler", z, 1.0, 0.0)))
        assert size == pytest.approx(np.sqrt(1 + z * z), rel=1e-14)  # rounding of an eigenvalue


@pytest.mark.parametrize("method", integrators.names())
def test_symplectic_keeps_area(method):
    """In one dimension symplectic is: the determinant of a step is 1."""
    area = np.linalg.det(amplification(method, 0.5, 1.0, 0.0))
    # a method that is not of order <= 6 misses by at least 0.5^8/8! = 1e-7, far above rounding
    assert (abs(area - 1) < 1e-12) == integrators.load(method)[0].symplectic


@pytest.mark.parametrize("method", integrators.names())
def test_evaluations(method):
    calls = []

    def counted(*args):
        calls.append(args)
        return forces.acceleration(*args)

    claim, step, _ = integrators.load(method)
    field = forces.pack([WELL, AIR], (0.0, -9.8, 0.0), 1.0)
    jit.bind(step, compiled=False, acceleration=counted)(0.1, 0.0, (1.0, 2.0, 3.0), (1.0, 0.0, 0.0), field)
    # by itself it has none that the step before has left
    assert len(calls) == claim.evaluations + engines.steps(method)["CARRIES"]


def test_rk4_original_is_of_second_order_in_a_spring():
    """Not of fourth: the step's Taylor series leaves the exact one at h^3."""
    miss = [
        np.abs(amplification("rk4_original", h, 1.0, 0.0) - [[np.cos(h), np.sin(h)], [-np.sin(h), np.cos(h)]]).max()
        for h in (0.02, 0.01)
    ]
    assert np.log2(miss[0] / miss[1]) == pytest.approx(3, abs=0.02)  # the next term is 0.02 of this one


@pytest.mark.parametrize("method", integrators.names())
def test_every_method_says_what_it_is(method):
    claim, _, text = integrators.load(method)
    assert claim.reference and text and claim.order >= 1 and claim.evaluations >= 1
