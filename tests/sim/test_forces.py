"""Fields: the force they say, where and until when they act, and the potential that goes with it."""

import numpy as np
import pytest

from sim import forces, jit
from sim.forces import Drag, Spring, Uniform, pack
from sim.model import Invalid
from sim.simulate import Scene
from tests.sim import plain
from tests.sim.helpers import AIR, CORRIDOR, FREE, LIFT, WELL, balls, fly


def acceleration(fields, gravity=FREE, mass=1.0):
    packed = pack(fields, gravity, mass)
    bound = jit.bind(forces.acceleration, compiled=False, SELECTIVE=len(packed.selective))
    return lambda t, x, v: np.array(bound(t, tuple(x), tuple(v), packed))


@pytest.mark.parametrize("mass", [0.1, 1.0, 200.0])
def test_the_sum_of_all(mass):
    limited = Spring(stiffness=3.0, center=(1, 0, 0), region={"y": (-0.3, 2), "z": (-1, 0.4)}, until=0.8)
    fields = [AIR, WELL, CORRIDOR, LIFT, limited, Drag(coefficient=2.0, region={"x": (0, 9)})]
    gravity = (0.1, -9.8, 0.3)
    ours = acceleration(fields, gravity, mass)
    theirs = plain.acceleration(Scene(gravity=gravity, forces=dict(enumerate(fields))), mass)
    for row in np.random.default_rng(0).normal(size=(200, 7)):
        t, x, v = abs(row[0]), row[1:4], 3 * row[4:]
        # some ten roundings of 30 N/m on 3 m
        assert np.allclose(ours(t, x, v), theirs(t, x, v), rtol=0, atol=1e-13 * (1 + 1 / mass))


def test_regions_are_open_and_until_is_exclusive():
    inside = Uniform(direction=(1, 0, 0), magnitude=1.0, region={"x": (-0.5, 0.5), "z": (0, 1)}, until=2.0)
    a = acceleration([inside])
    assert a(0.0, (0, 99, 0.5), FREE)[0] == 1
    for t, x in ((2.0, (0, 0, 0.5)), (0, (0.5, 0, 0.5)), (0, (-0.5, 0, 0.5)), (0, (0, 0, 0.0)), (0, (0, 0, 1.0))):
        assert a(t, x, FREE)[0] == 0
    assert a(np.nextafter(2.0, 0), (np.nextafter(0.5, 0), 0, np.nextafter(0, 1)), FREE)[0] == 1


def test_direction_is_normalised_whatever_its_length():
    for length in (1e-200, 1.0, 7.0, 1e200):
        force = Uniform(direction=(3 * length, 0, -4 * length), magnitude=-10.0)
        assert acceleration([force])(0, FREE, FREE) == pytest.approx((-6, 0, 8), rel=1e-15)


@pytest.mark.parametrize("mass", [0.1, 1.0, 100.0])
def test_a_force_of_the_weight_lets_it_hover(mass):
    """The original's force 2 at balance: no fall at all while it lasts, the parabola after it."""
    lift = Uniform(direction=(0, 1, 0), magnitude=9.8 * mass, until=0.5)
    scene = Scene(forces={"lift": lift, "corridor": CORRIDOR})
    flight = fly(scene, balls((2, 1, 0), (1, 0, 0), mass=mass), "explicit_euler", step=0.0625, duration=1.0)
    height = flight.trajectory.position[:, 0, 1]
    # rounding of 9.8 m / m; forward Euler falls by g h^2 n (n - 1) / 2
    assert height[:9] == pytest.approx(np.ones(9), abs=1e-14)
    n = np.arange(9)
    assert height[8:] == pytest.approx(1 - 9.8 * 0.0625**2 * n * (n - 1) / 2, abs=1e-13)


def test_force_is_minus_the_gradient_of_the_potential():
    """Of a quadratic the central difference is exact; 1e-16 of some 100 J over a difference of 0.2 m is left."""
    fields, gravity, mass = [WELL, Spring(stiffness=4.0)], (0.5, -9.8, 1.0), 1.7
    a = acceleration(fields, gravity, mass)
    for x in np.random.default_rng(0).normal(size=(20, 3)):
        offsets = 0.1 * np.eye(3)
        up, down = (forces.potential(fields, gravity, mass, x + sign * offsets) for sign in (1, -1))
        assert -(up - down) / 0.2 == pytest.approx(mass * a(0.0, x, FREE), abs=1e-12)


def test_a_spring_has_no_energy_at_its_centre():
    assert forces.potential([WELL], FREE, 1.0, np.array(WELL.center)) == pytest.approx(0, abs=1e-30)
    assert forces.potential([Spring(stiffness=0.0, center=(1, 2, 3))], FREE, 1.0, np.ones(3)) == 0


def test_fields_of_no_strength_vanish():
    idle = [
        Uniform(direction=(1, 0, 0), magnitude=0.0, until=1.0),
        Drag(coefficient=0.0, region={"x": (0, 1)}),
        Spring(stiffness=0.0, center=(1, 2, 3), until=2.0),
    ]
    packed = pack(idle, FREE, 1.0)
    assert len(packed.selective) == 0 and not packed.steady.any()


def test_all_that_acts_always_is_one_field():
    packed = pack([AIR, WELL, Drag(coefficient=0.5), CORRIDOR], FREE, 2.0)
    assert packed.selective.shape == (1, forces.WIDTH)
    assert packed.steady[forces.B] == pytest.approx((AIR.coefficient + 0.5) / 2)
    assert packed.drive[forces.W2] == 0  # a spring has a potential


@pytest.mark.parametrize(
    "make, field",
    [
        (lambda: Uniform(direction=(0, 0, 0), magnitude=1.0), "direction"),
        (lambda: Uniform(direction=(0, np.nan, 0), magnitude=1.0), "direction"),
        (lambda: Uniform(direction=(0, 1, 0), magnitude=np.inf), "magnitude"),
        (lambda: Drag(coefficient=-1e-9), "coefficient"),
        (lambda: Drag(coefficient=np.nan), "coefficient"),
        (lambda: Spring(stiffness=-1.0), "stiffness"),
        (lambda: Spring(stiffness=1.0, center=(0, 0, np.inf)), "center"),
        (lambda: Drag(coefficient=1.0, until=0.0), "until"),
        (lambda: Drag(coefficient=1.0, region={"x": (1, 1)}), "region"),
        (lambda: Drag(coefficient=1.0, region={"y": (2, 1)}), "region"),
        (lambda: Drag(coefficient=1.0, region={"y": (np.nan, 1)}), "region"),
    ],
)
def test_invalid_fields_say_which_parameter(make, field):
    with pytest.raises(Invalid) as error:
        make()
    assert error.value.field == field and "\n" not in str(error.value)
