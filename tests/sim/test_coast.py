"""Steps of many balls side by side: the same flight, bit for bit, as ball by ball with a look for events in each step."""

import numpy as np
import pytest

from sim import coast, engines, forces, jit, travel
from sim.forces import Drag, Spring, Uniform
from sim.shapes import Heightfield, Rectangle
from sim.simulate import Scene, Simulation, Solver
from tests.sim.helpers import CORRIDOR, LIFT, balls, soup
from tests.sim.test_hop import MANY, ROOM, check_same, start

HILLS = Heightfield((8, 8), (20, 20), "-2.5+0.4*sin(2*x)*cos(2*z)")
AIR = {"air": Drag(0.3), "well": Spring(4.0, (0.0, 0.5, 0.0))}
GUST = {"gust": Drag(0.5, region={"y": (-0.5, 0.5)}), "pull": Spring(3.0, until=0.7), "corridor": CORRIDOR, "lift": LIFT}

CORNERED = balls(np.full((70, 3), -1.3), start(70).velocity)  # where there are no plates
SCENES = {
    "elastic": (Scene(surfaces={"room": ROOM}, restitution=1.0, damping=0.0), start(MANY)),
    "emitted": (Scene(surfaces={"room": ROOM}), start(MANY, released=0.0173 * (np.arange(MANY) % 40), lifetime=1.31)),
    "resting": (Scene(surfaces={"room": ROOM}, restitution=0.3, damping=0.2), start(70, speed=1.0)),
    "edges": (Scene(surfaces={"room": ROOM, "shelf": Rectangle((0, -1.45, 0), (0, 1, 0), (1, 1))}), start(70)),
    "plates": (Scene(surfaces={"room": ROOM, "plates": soup(4, 6)}, restitution=1.0, damping=0.0), CORNERED),
    "tree": (Scene(surfaces={"hills": HILLS}), start(70)),
    "everywhere": (Scene(surfaces={"room": ROOM}, forces=AIR), start(70)),
    "somewhere": (Scene(surfaces={"room": ROOM}, forces=GUST), start(70)),
    "nothing": (Scene(forces={"push": Uniform((1, 0, 0), 2.0)}), start(70)),
    "diverging": (Scene(forces={"well": Spring(1e6)}), start(70)),
}


@pytest.mark.parametrize("method", ["symplectic_euler", "rk4", "velocity_verlet"])  # a parabola, a cubic, one that hands on
@pytest.mark.parametrize("name", SCENES)
def test_coasting_changes_nothing(name, method):
    scene, start = SCENES[name]
    # frames on the grid of steps and off it
    simulation = Simulation(scene, start, Solver(method, 0.01), 2.0, 0.033)
    flight = simulation.run()
    check_same(flight, one_by_one(simulation))
    assert flight.status == ("diverged" if name == "diverging" else "finished" if name != "resting" else flight.status)


def one_by_one(simulation):
    """The flight with a look for events in each step."""
    packed = forces.pack(simulation.fields, simulation.scene.gravity, simulation.balls.mass)
    names = engines.bindings(simulation.solver.method, packed) | {"SMALL_STEPS": False}
    simulation.engine.kernel = jit.bind(travel.travel, **names)
    return simulation.run()


def test_pauses_change_nothing(monkeypatch):
    """Nor do the lanes of the calls before."""
    scene, start = SCENES["elastic"]
    simulation = Simulation(scene, start, Solver("symplectic_euler", 0.01), 2.0, 0.033)
    flight = simulation.run()
    monkeypatch.setattr(engines, "PIECES", 200)
    check_same(simulation.run(), flight)


@pytest.mark.parametrize("method", ["symplectic_euler", "rk4", "velocity_verlet"])
@pytest.mark.parametrize("name", SCENES)
def test_so_do_few_that_take_many_steps_at_once(name, method):
    scene, start = SCENES[name]
    few = balls(start.position[: coast.FEW], start.velocity[: coast.FEW])
    simulation = Simulation(scene, few, Solver(method, 0.01), 2.0, 0.033)
    flight = simulation.run()
    check_same(flight, one_by_one(simulation))


def test_most_steps_are_taken_side_by_side():
    """Of the steps of balls in a room few are left to a look at each: about two a bounce."""
    scene, start = SCENES["elastic"]
    simulation = Simulation(scene, balls(start.position[:70], start.velocity[:70]), Solver("symplectic_euler", 1e-3), 0.3, 0.3)
    names = engines.bindings("symplectic_euler", forces.pack([], scene.gravity, 1.0))
    kernel, calls = jit.bind(coast.coast, compiled=False, **names), []
    fly = kernel.__globals__["fly"]
    kernel.__globals__["fly"] = lambda *given: calls.append(1) or fly(*given)
    simulation.engine.kernel = kernel
    flight = simulation.run()
    # each ball besides when it comes into its lane and when it leaves it
    assert len(flight.bounces) > 20 and len(calls) <= 5 * 70 + 2 * len(flight.bounces) < 0.1 * flight.steps
