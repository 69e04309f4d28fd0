"""Triangles that pass through each other, counted."""

import numpy as np
import pytest

from sim import crossing
from sim.crossing import crossings
from sim.shapes import Box, Heightfield
from tests.sim.helpers import soup

UPRIGHT = np.array([(0, -1, -1), (0, -1, 1), (0, 2, 0)], float)  # in the plane x = 0, through the next one's middle
FLAT = np.array([(-1, 0, -0.5), (1, 0, -0.5), (0, 0, 1)], float)


def turned(triangles):
    """The triangles (n, 3, 3) so that nothing lies along an axis, and the coordinates round."""
    frame = np.linalg.qr([(1.0, 2, 3), (-2, 1, 1), (0.3, 0.2, -1)])[0]
    return np.asarray(triangles, float) @ frame.T + (0.3, 0.1, -0.7)


def count(*triangles):
    return crossings(turned(triangles).reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


@pytest.mark.parametrize(
    "shift, pairs",
    [
        ((0, 0, 0), 1),
        ((0, 0.999, 0), 1),
        ((0, 1 - 1e-9, 0), 1),
        ((0, 1.001, 0), 0),  # stands above
        ((0, 1, 0), 0),  # stands on it
        ((0.999, 0, -0.45), 1),
        ((1.001, 0, -0.5), 0),  # beside it
        ((0, 0, 1.66), 1),
        ((0, 0, 1.67), 0),  # before its tip
        ((0, -2, 0), 0),  # its tip touches from below
        ((0, -2 + 1e-6, 0), 1),
    ],
)
def test_two_triangles(shift, pairs):
    assert count(UPRIGHT + shift, FLAT) == count(FLAT, UPRIGHT + shift) == pairs


def test_what_only_touches_or_lies_in_one_plane_does_not_cross():
    assert count(FLAT, FLAT + (0.1, 0, 0.1)) == 0  # over each other in one plane
    assert count(FLAT, FLAT + (0, 1e-3, 0)) == 0
    # corner against face, side against side
    assert count(FLAT, [(0, 0, 0), (1, 1, 0), (-1, 1, 0)]) == 0
    assert count(FLAT, [(-1, 1, -0.5), (-1, -1, -0.5), (-1, 0, -2)]) == 0


def test_touching_does_not_cross_however_it_rounds():
    """Corners that stand on a face, to rounding, along a side of theirs."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        a, b, c, up = rng.normal(size=(4, 3))
        share = rng.dirichlet((1, 1, 1), 2)
        standing = np.stack([*(share @ [a, b, c]), up])
        assert crossings(np.concatenate([[a, b, c], standing]), np.arange(6).reshape(2, 3)) == 0


def test_sides_that_meet_sides_all_the_way_cross():
    """Both ends of the common stretch are on sides of both: neither has a side through the inside of the other."""
    one = [(-1, 0, 0), (1, 0, 0), (0, 1, 1)]
    other = [(-1, 0, 1), (1, 0, 1), (0, 1, 0)]
    assert count(one, other) == 1


def test_neighbours_do_not_count():
    """Two triangles that share a corner, and one passes through the other."""
    shared = [(0, 0, 1), (0.2, -1, -0.4), (-0.2, 1, -0.4)]
    assert count(FLAT, shared) == 0
    assert count(FLAT, np.array(shared) + (0, 0, 1e-3)) == 1


def passes(a, b):
    """Whether a side of a goes through the inside of b: by the signs of volumes."""

    def volume(p, q, r, s):
        return np.dot(np.cross(q - p, r - p), s - p)

    for p, q in zip(a, np.roll(a, -1, axis=0)):
        if volume(*b, p) * volume(*b, q) < 0:
            around = [volume(p, q, b[k], b[(k + 1) % 3]) > 0 for k in range(3)]
            if all(around) or not any(around):
                return True
    return False


@pytest.mark.parametrize("seed", range(3))
def test_against_every_pair(seed, monkeypatch):
    vertices, corners = soup(seed, 70).mesh()
    triangles = vertices[corners]
    expected = sum(
        passes(triangles[i], triangles[j]) or passes(triangles[j], triangles[i]) for i in range(70) for j in range(i)
    )
    assert expected > 10
    for pairs in (2**22, 700, 1):  # all at once, a few at a time, one by one
        monkeypatch.setattr(crossing, "PAIRS", pairs)
        assert crossings(vertices, corners) == expected


@pytest.mark.parametrize("shape", [Box((0, 0, 0), (1, 2, 3)), Heightfield((4, 3), (20, 30), "0.3*sin(2*x)*cos(2*z)")])
def test_what_is_well_made_does_not_cross(shape):
    vertices, corners = shape.mesh()
    assert crossings(turned(vertices[None])[0], corners) == 0


def test_two_boxes_in_each_other():
    """A bar through a plate: on two faces, each of two triangles, four sides of two triangles each go in."""
    bar, plate = (Box((0, 0, 0), size).mesh() for size in ((1, 4, 0.7), (3, 1, 3)))
    both = np.concatenate([bar.vertices, plate.vertices]), np.concatenate([bar.triangles, plate.triangles + 8])
    triangles = both[0][both[1]]
    expected = sum(passes(a, b) or passes(b, a) for i, a in enumerate(triangles) for b in triangles[:i])
    assert crossings(*both) == expected > 8


def test_a_large_mesh_is_not_looked_at(monkeypatch):
    monkeypatch.setattr(crossing, "MOST", 1)
    vertices = np.concatenate([UPRIGHT, FLAT])
    assert crossings(vertices, np.arange(6).reshape(2, 3)) is None
    monkeypatch.setattr(crossing, "MOST", 2)
    assert crossings(vertices, np.arange(6).reshape(2, 3)) == 1
