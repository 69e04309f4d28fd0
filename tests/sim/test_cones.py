"""What is known of the directions in which a ball touches an edge holds for every touch."""

import numpy as np
import pytest

from sim import reduction
from sim.shapes import Heightfield
from sim.tree import ANY
from tests.sim.test_geometry import sphere

SHAPES = {
    "few": sphere(1),
    "many": sphere(2),
    "hills": Heightfield((4, 4), (12, 12), "0.5*sin(2*x)*cos(3*z)"),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_ball_touches_an_edge_within_its_spread(name):
    """The nearest point of the surface, by brute force over all faces and edges, to points around it: where it is on an edge, or a
    corner at its end, the direction to it is within the spread of the normal of one of the edges there."""
    found, _ = reduction.features([SHAPES[name]], np.zeros((0, 3)))
    edges, faces = found.edges, found.faces
    known = edges.spread < ANY
    assert known.sum() > 0.7 * len(known)
    np.testing.assert_allclose(np.linalg.norm(edges.normal[known], axis=1), 1, atol=1e-6)
    rng = np.random.default_rng(1)
    e = rng.choice(np.flatnonzero(known), 2000)
    way = rng.normal(size=(2000, 3))
    x = edges.start[e] + rng.choice([0.0, 0.5, 1.0], 2000)[:, None] * edges.length[e, None] * edges.along[e]
    x += 1e-3 * (edges.normal[e] + 2.0 * way / np.linalg.norm(way, axis=1, keepdims=True) * edges.spread[e, None])  # and beyond it
    touched = 0
    for place in x:
        off = place - edges.start
        off -= np.clip(np.sum(off * edges.along, axis=1), 0, edges.length)[:, None] * edges.along
        distance = np.linalg.norm(off, axis=1)
        alike = np.flatnonzero(distance < distance.min() * (1 + 1e-9))
        if nearest_face(faces, place) < distance.min() * (1 - 1e-9):
            continue
        sine = np.linalg.norm(np.cross(edges.normal[alike], off[alike] / distance[alike, None]), axis=1)
        toward = np.sum(edges.normal[alike] * off[alike], axis=1) > 0
        assert ((toward & (sine <= edges.spread[alike])) | (edges.spread[alike] == ANY)).any()
        touched += 1
    assert touched > 200


def nearest_face(faces, x):
    """How far (m) it is to the nearest face that x is straight over."""
    from sim.inside import _over

    n = np.arange(len(faces.axis))
    gap = np.sum(faces.normal * (x - faces.point), axis=1)
    over = _over(faces, n, x - gap[:, None] * faces.normal)
    return np.abs(gap[over]).min(initial=np.inf)
