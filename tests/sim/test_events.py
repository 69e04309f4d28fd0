"""What is told of an impact: where the ball is then, and which way the surface faces it."""

import numpy as np
import pytest

from sim.shapes import Box, Rectangle
from sim.simulate import Scene, Simulation, Solver
from tests.sim.helpers import FREE, balls

RADIUS = 0.06
HALF = np.array([0.4, 0.3, 0.5])


@pytest.mark.parametrize("method", ["exact", "rk4"])
def test_a_ball_is_off_what_it_touches_by_its_radius_along_the_normal(method):
    """A block, of which it touches faces, edges and corners, and a sheet in the middle of the room, from both sides."""
    surfaces = {
        "room": Box((0, 0, 0), (4, 4, 4), inside=True),
        "block": Box((0, 0, 0), tuple(2 * HALF)),
        "sheet": Rectangle((0, 1.2, 0), (0, 1, 0), (3, 3)),
    }
    rng = np.random.default_rng(7)
    start = balls(rng.uniform((-1.8, -1.8, -1.8), (1.8, -0.5, 1.8), (60, 3)), rng.normal(0.0, 6.0, (60, 3)))
    scene = Scene(gravity=FREE, surfaces=surfaces, restitution=1.0, damping=0.0)
    bounces = Simulation(scene, start, Solver(method, 0.01), 8.0, 8.0).run().bounces
    normal, foot = bounces["normal"], bounces["position"] - RADIUS * bounces["normal"]
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1, rel=1e-15)
    room, block, sheet = (bounces["surface"] == k for k in range(3))
    # a step's own interpolant and its roots are good to some 1e-12 m, all else to rounding
    assert np.abs(foot[room]).max(axis=1) == pytest.approx(2, abs=1e-11) and (np.sum(normal[room] * foot[room], axis=1) < 0).all()
    outside = np.abs(foot[block]) - HALF
    assert np.abs(outside.max(axis=1)).max() < 1e-11
    edges = (np.abs(outside) < 1e-11).sum(axis=1) >= 2
    assert edges.sum() >= 5 and (~edges).sum() >= 50
    assert (np.sum(normal[block] * foot[block], axis=1) > 0).all()
    assert np.abs(foot[sheet, 1] - 1.2).max() < 1e-11
    assert (normal[sheet, 1] > 0.99).sum() >= 5 and (normal[sheet, 1] < -0.99).sum() >= 5
