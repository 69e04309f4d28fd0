"""What the tests of the simulator share: balls and scenes made in a line."""

from __future__ import annotations

import numpy as np

from sim import shapes
from sim.forces import Drag, Spring, Uniform
from sim.model import Balls
from sim.simulate import Scene, Simulation, Solver

FREE = (0.0, 0.0, 0.0)  # no gravity


def balls(position, velocity, released=0.0, mass=1.0, radius=0.06, lifetime=15.0) -> Balls:
    position, velocity = (np.atleast_2d(np.asarray(a, float)) for a in (position, velocity))
    released = np.atleast_1d(np.asarray(released, float))
    n = max(len(position), len(velocity), len(released))
    each = (np.array(np.broadcast_to(a, (n, *a.shape[1:]))) for a in (released, position, velocity))
    return Balls(mass, radius, lifetime, *each)


def simulation(scene, balls, method="rk4_original", step=0.01, duration=1.0, every=None) -> Simulation:
    return Simulation(scene, balls, Solver(method, step, contact="original"), duration, every or step)


def fly(*args, **options):
    return simulation(*args, **options).run()


def random_balls(seed, n, speed=5.0, released=0.0, **options) -> Balls:
    rng = np.random.default_rng(seed)
    return balls(rng.uniform(-1.4, 1.4, (n, 3)), rng.normal(0.0, speed, (n, 3)), released, **options)


def soup(seed, n) -> shapes.Triangles:
    """n triangles of some 0.5 m, anywhere in the room below."""
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-1.4, 1.4, (n, 1, 3)) + rng.normal(0.0, 0.4, (n, 3, 3))
    return shapes.Triangles(vertices.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3))


def room(many: bool, **scene) -> Scene:
    """A room with every shape in it; with `many` so many faces that a tree is built."""
    surfaces = {
        "room": shapes.Box(center=(0, 0, 0), size=(4, 3, 3.5), inside=True),
        "slope": shapes.Plane(point=(0, -1.3, 0), normal=(0.2, 1, -0.1)),
        "shelf": shapes.Rectangle(center=(0.5, 0.2, -0.3), normal=(0.3, 1, 0.4), size=(1.1, 0.7)),
        "baffle": shapes.Rectangle(center=(-0.6, 0, 0.2), normal=(1, 0.1, 0), size=(0.9, 1.6), up=(0.2, 1, 0.5)),
        "block": shapes.Box(center=(0.9, -0.8, 0.7), size=(0.5, 0.6, 0.7)),
        "litter": soup(1, 12),
    }
    if many:
        hills = "0.2*sin(3*x)*cos(2*z) - 1.1"
        surfaces["ground"] = shapes.Heightfield(size=(3.8, 3.3), cells=(7, 6), height=hills)
    return Scene(surfaces=surfaces, **scene)


CORRIDOR = Uniform(direction=(0, 0, 1), magnitude=20.0, region={"x": (-0.5, 0.5)})
LIFT = Uniform(direction=(0, 2, 0), magnitude=14.0, until=0.3137)
WELL = Spring(stiffness=30.0, center=(0.3, -0.2, 0.5))
AIR = Drag(coefficient=0.8)

ELASTIC = {"restitution": 1.0, "damping": 0.0}


def swept(scene, balls, method="exact", step=0.01, duration=1.0, every=None, tolerance=1e-9):
    """A flight with swept contact."""
    return Simulation(scene, balls, Solver(method, step, tolerance), duration, every or duration).run()


def last(flight):
    """Where the balls are in the last frame (n, 3) m."""
    return flight.trajectory.position[-1]


def rotation(seed) -> np.ndarray:
    """A rotation matrix, any one."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.linalg.det(q)


def moved(shape, matrix=np.eye(3), shift=0.0) -> shapes.Triangles:
    """The triangles of a shape, or of several, turned (or mirrored) and shifted."""
    meshes = [each.mesh() for each in (shape if isinstance(shape, (list, tuple)) else [shape])]
    first = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    corners = np.concatenate([mesh.triangles + n for mesh, n in zip(meshes, first)])
    return shapes.Triangles(np.concatenate([mesh.vertices for mesh in meshes]) @ np.transpose(matrix) + shift, corners)
