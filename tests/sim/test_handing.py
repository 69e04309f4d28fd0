"""What a step hands on to the next: it spares one evaluation a step, and changes nothing."""

import numpy as np
import pytest

from sim import advance, engines, forces, integrators, jit, motion, travel
from sim.shapes import Plane
from sim.simulate import Scene, Simulation, Solver
from tests.sim.helpers import AIR, CORRIDOR, LIFT, WELL, balls

HANDING = [name for name in integrators.names() if engines.steps(name)["CARRIES"]]
CONTACTS = [(name, contact) for name in HANDING for contact in ("swept", "original") if Solver(name).stepping or contact == "swept"]
STEP = 1 / 64


def flown(scene, start, method, contact, duration, **names):
    """A flight by the plain kernel, some of its names bound to other things."""
    simulation = Simulation(scene, start, Solver(method, STEP, 1e-6, contact), duration, duration)
    packed = forces.pack(simulation.fields, scene.gravity, start.mass)
    if contact == "swept":
        kernel, bound = travel.travel, engines.bindings(method, packed)
    else:
        kernel, bound = advance.advance, engines.steps(method) | {"SELECTIVE": len(packed.selective)}
    simulation.engine.kernel = jit.bind(kernel, compiled=False, **bound | names)
    if contact == "swept" and simulation.solver.stepping:
        simulation.engine.method = engines.entries(method, few=True, compiled=False, **names)
    return simulation.run()


def test_velocity_verlet_and_dopri5_hand_on():
    assert HANDING == ["dopri5", "velocity_verlet"]


@pytest.mark.parametrize("method, contact", CONTACTS)
def test_evaluations_in_a_flight(method, contact):
    """For each step more, or each try of one, as many more as claimed."""
    engine = motion if contact == "swept" else forces
    tried = "embedded" if integrators.load(method)[0].adaptive else "carried"

    def count(duration):
        """Evaluations and tries that a flight takes."""
        calls, tries = [], []

        def counted(*args):
            calls.append(args)
            return engine.acceleration(*args)

        own = jit.bind(engines.steps(method)[tried], compiled=False, acceleration=counted, rates=engine.rates)
        names = {"acceleration": counted, tried: lambda *args: tries.append(args) or own(*args)}
        flown(Scene(forces={"well": WELL, "air": AIR}), balls((1, 2, 3), (1, 0, 0)), method, contact, duration, **names)
        return len(calls), len(tries)

    calls, tries = np.subtract(count(64 * STEP), count(32 * STEP))
    assert tries > 4 and calls == integrators.load(method)[0].evaluations * tries


@pytest.mark.parametrize("method, contact", CONTACTS)
def test_after_an_event_nothing_is_used_again(method, contact):
    """With bounces, faces of a region and a field's end on the way it is as if each step evaluated all of its own."""
    fields = {"corridor": CORRIDOR, "lift": LIFT, "air": AIR}
    scene = Scene(gravity=(0, -40, 0), surfaces={"floor": Plane()}, forces=fields, restitution=0.8)
    start = balls([(-0.7, 0.3, 0), (0.6, 0.2, 0.1)], [(1.5, -2, 0), (-2, 1, 1)], released=(0, 0.1))
    handed = flown(scene, start, method, contact, 1.0)
    engine = motion if contact == "swept" else forces
    step = jit.bind(integrators.load(method)[1], compiled=False, acceleration=engine.acceleration, rates=engine.rates, SELECTIVE=2)
    alone = {"CARRIES": False, "hands_on": lambda method: False, "carried": lambda h, t, x, v, a, forces: (*step(h, t, x, v, forces), a)}
    anew = flown(scene, start, method, contact, 1.0, **alone)
    assert len(handed.bounces) > 4 and handed.steps == anew.steps
    off = np.abs(handed.trajectory.position[-1] - anew.trajectory.position[-1]).max()
    # the original's kernel adds up the drag and the fields of a region in another order: 64 roundings
    assert off == 0.0 if contact == "swept" else off < 1e-13
