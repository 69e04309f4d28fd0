"""Steps of many balls side by side: the same flight, bit for bit, as ball by ball with a look for events in each step."""

import numpy as np
import pytest

from sim import coast, engines
from sim.forces import Drag, Spring, Uniform
from sim.shapes import Box, Heightfield, Plane, Rectangle
from sim.simulate import Scene, Simulation, Solver
from tests.sim.helpers import CORRIDOR, LIFT
from tests.sim.test_hop import MANY, ROOM, check_same, start

HILLS = Heightfield((8, 8), (20, 20), "-2.5+0.4*sin(2*x)*cos(2*z)")
AIR = {"air": Drag(0.3), "well": Spring(4.0, (0.0, 0.5, 0.0))}
GUST = {"gust": Drag(0.5, region={"y": (-0.5, 0.5)}), "pull": Spring(3.0, until=0.7), "corridor": CORRIDOR, "lift": LIFT}

SCENES = {
    "elastic": (Scene(surfaces={"room": ROOM}, restitution=1.0, damping=0.0), start(MANY)),
    "emitted": (Scene(surfaces={"room": ROOM}), start(MANY, released=0.0173 * (np.arange(MANY) % 40), lifetime=1.31)),
    "resting": (Scene(surfaces={"room": ROOM}, restitution=0.3, damping=0.2), start(70, speed=1.0)),
    "edges": (Scene(surfaces={"room": ROOM, "shelf": Rectangle((0, -1.45, 0), (0, 1, 0), (1, 1))}), start(70)),
    "tree": (Scene(surfaces={"hills": HILLS}), start(70)),
    "everywhere": (Scene(surfaces={"room": ROOM}, forces=AIR), start(70)),
    "somewhere": (Scene(surfaces={"room": ROOM}, forces=GUST), start(70)),
    "nothing": (Scene(forces={"push": Uniform((1, 0, 0), 2.0)}), start(70)),
    "diverging": (Scene(forces={"well": Spring(1e6)}), start(70)),
}


@pytest.mark.parametrize("method", ["symplectic_euler", "rk4", "velocity_verlet"])  # a parabola, a cubic, one that hands on
@pytest.mark.parametrize("name", SCENES)
def test_coasting_changes_nothing(monkeypatch, name, method):
    scene, start = SCENES[name]
    made, bindings = [], engines.bindings
    for few in (coast.FEW, 10**6):
        monkeypatch.setattr(engines, "bindings", lambda *given: bindings(*given) | {"FEW": few})
        # frames on the grid of steps and off it
        made.append(Simulation(scene, start, Solver(method, 0.01), 2.0, 0.033).run())
    check_same(*made)
    assert made[0].status == ("diverged" if name == "diverging" else "finished" if name != "resting" else made[1].status)


def test_most_steps_are_taken_side_by_side(monkeypatch):
    """Of a hundred balls in a room a few in a hundred are close to a wall."""
    calls = []
    scene, start = Scene(surfaces={"room": Box((0, 0, 0), (4, 3, 3.5), inside=True)}), SCENES["edges"][1]
    simulation = Simulation(scene, start, Solver("symplectic_euler", 1e-3), 0.05, 0.05)
    monkeypatch.setattr(coast, "fly", counted(coast.fly, calls))
    simulation.engine.kernel = coast.coast
    flight = simulation.run()
    assert flight.steps == 70 * 50 + len(flight.bounces) and 70 <= len(calls) < 0.1 * flight.steps


def counted(function, calls):
    def call(*given):
        calls.append(1)
        return function(*given)

    return call
