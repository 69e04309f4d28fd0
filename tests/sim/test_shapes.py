"""Shapes: where their facets lie, which way they face, and that what is drawn is what is hit."""

import numpy as np
import pytest

from sim.geometry import PARALLELOGRAM, PLANE, TRIANGLE
from sim.model import Invalid
from sim.shapes import SHAPES, Box, Heightfield, Plane, Rectangle, Triangles
from tests.sim.helpers import soup

HILLS = "0.3*sin(2*x)*cos(2*z)"
SOME = {
    "plane": Plane(point=(1, 2, 3), normal=(1, -2, 0.5)),
    "floor": Rectangle(center=(0, 0, 0), normal=(0, 1, 0), size=(2, 3)),
    "rectangle": Rectangle(center=(1, -2, 3), normal=(3, 1, -2), size=(0.7, 1.9), up=(1, 1, 1)),
    "box": Box(center=(1, 2, 3), size=(2, 3, 4)),
    "room": Box(center=(1, 2, 3), size=(2, 3, 4), inside=True),
    "heightfield": Heightfield(size=(4, 3), cells=(5, 4), height=HILLS),
    "triangles": soup(3, 20),
}
NEAR = {"rtol": 0, "atol": 1e-14}  # some roundings of values below 10


def edges(facets):
    """e1, e2 (n, 3) back from the coordinates `across` along them: their pseudo-inverse."""
    return np.linalg.pinv(facets.across).transpose(2, 0, 1)


def areas(facets):
    share = np.where(facets.outline == TRIANGLE, 0.5, 1.0)
    return share * np.linalg.norm(np.cross(*edges(facets)), axis=1)


def corners(facets, f):
    """The corners (k, 3) of facet f."""
    e1, e2 = (e[f] for e in edges(facets))
    p = facets.point[f]
    return np.array([p, p + e1, p + e2] + ([p + e1 + e2] if facets.outline[f] == PARALLELOGRAM else []))


def mesh_areas(mesh):
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize("name", SOME)
def test_normals_are_units_across_both_edges(name):
    facets = SOME[name].facets()
    e1, e2 = edges(facets)
    assert np.allclose(np.linalg.norm(facets.normal, axis=1), 1, **NEAR)
    for edge in (e1, e2):
        assert np.allclose(np.sum(facets.normal * edge, axis=1), 0, **NEAR)
    assert (np.sum(np.cross(e1, e2) * facets.normal, axis=1) > 0).all()


@pytest.mark.parametrize("name", [name for name in SOME if name != "plane"])
def test_drawn_is_what_is_hit(name):
    """The same corners, the same area, facing the same way."""
    facets, mesh = SOME[name].facets(), SOME[name].mesh()
    total = np.concatenate([corners(facets, f) for f in range(len(facets.point))])
    for one, other in ((total, mesh.vertices), (mesh.vertices, total)):
        assert all(np.abs(other - x).max(axis=1).min() < 1e-13 for x in one)  # some roundings of values below 10
    assert areas(facets).sum() == pytest.approx(np.linalg.norm(mesh_areas(mesh), axis=1).sum(), rel=1e-13)
    assert np.allclose(areas(facets) @ facets.normal, mesh_areas(mesh).sum(axis=0), rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", [name for name in SOME if name != "plane"])
def test_bounds_hold_every_corner_and_little_more(name):
    facets = SOME[name].facets()
    for f in range(len(facets.point)):
        c = corners(facets, f)
        assert (facets.low[f] <= c.min(axis=0)).all() and (c.max(axis=0) <= facets.high[f]).all()
        assert np.allclose((facets.low[f], facets.high[f]), (c.min(axis=0), c.max(axis=0)), rtol=0, atol=1e-9)


def test_plane():
    facets = SOME["plane"].facets()
    assert np.allclose(facets.normal, np.array([[1, -2, 0.5]]) / np.sqrt(5.25), **NEAR)
    assert facets.outline == PLANE and not facets.two_sided
    assert np.isinf(facets.low).all() and np.isinf(facets.high).all()
    mesh = SOME["plane"].mesh()
    assert np.allclose((mesh.vertices - (1, 2, 3)) @ facets.normal[0], 0, **NEAR)
    assert np.allclose(mesh.vertices.mean(axis=0), (1, 2, 3), **NEAR)
    assert (mesh_areas(mesh) @ facets.normal[0] > 0).all()


@pytest.mark.parametrize(
    "normal, up, second",
    [
        ((0, 1, 0), None, (0, 0, 1)),  # z where the normal is along y
        ((0, -3, 0), None, (0, 0, 1)),
        ((1, 0, 0), None, (0, 1, 0)),  # y elsewhere
        ((0, 0, -1), None, (0, 1, 0)),
        ((0, 0, 1), (1, 0, 0), (1, 0, 0)),
        ((0, 1, 0), (5, 7, 0), (1, 0, 0)),  # as far as it can: the part along the surface
        ((1, 1, 0), None, (-0.5**0.5, 0.5**0.5, 0)),
    ],
)
def test_up_gives_the_second_side(normal, up, second):
    rectangle = Rectangle(center=(1, 2, 3), normal=normal, size=(2, 3), up=up)
    facets = rectangle.facets()
    e1, e2 = (e[0] for e in edges(facets))
    n = np.array(normal) / np.linalg.norm(normal)
    assert np.allclose(e2, 3 * np.array(second), **NEAR)
    assert np.allclose(e1, 2 * np.cross(second, n), **NEAR)
    assert np.allclose(facets.normal[0], n, **NEAR) and facets.two_sided.all()
    assert np.allclose(facets.point[0] + (e1 + e2) / 2, (1, 2, 3), **NEAR)
    assert np.allclose(rectangle.mesh().vertices.mean(axis=0), (1, 2, 3), **NEAR)


@pytest.mark.parametrize("inside", [False, True])
def test_box_is_closed_and_faces_where_a_ball_can_be(inside):
    facets = SOME["room" if inside else "box"].facets()
    assert len(facets.point) == 6 and not facets.two_sided.any()
    assert sorted(areas(facets)) == pytest.approx([6, 6, 8, 8, 12, 12], rel=1e-14)
    # the divergence theorem, for a constant and for x / 3: nothing flows through, the volume does
    assert np.allclose(areas(facets) @ facets.normal, 0, **NEAR)
    middle = facets.point + sum(edges(facets)) / 2
    volume = areas(facets) @ np.sum(middle * facets.normal, axis=1) / 3
    assert volume == pytest.approx(-24 if inside else 24, rel=1e-13)
    outward = np.sum((middle - (1, 2, 3)) * facets.normal, axis=1)
    assert (outward < 0).all() if inside else (outward > 0).all()


def test_heightfield():
    field = SOME["heightfield"]
    x, y, z = field.mesh().vertices.T
    assert np.allclose(y, 0.3 * np.sin(2 * x) * np.cos(2 * z), **NEAR)
    assert sorted(set(x)) == pytest.approx(np.linspace(-2, 2, 6))
    assert sorted(set(z)) == pytest.approx(np.linspace(-1.5, 1.5, 5))
    facets = field.facets()
    assert len(facets.point) == 2 * 5 * 4 and (facets.normal[:, 1] > 0).all() and facets.two_sided.all()
    # seen from above the triangles cover the field once
    assert areas(facets) @ facets.normal[:, 1] == pytest.approx(12, rel=1e-13)


def test_heightfield_covers_each_place_once():
    """Random places seen from above are in one triangle each."""
    facets = SOME["heightfield"].facets()
    for x, z in np.random.default_rng(0).uniform((-2, -1.5), (2, 1.5), (200, 2)):
        p = facets.point
        y = p[:, 1] - (facets.normal[:, 0] * (x - p[:, 0]) + facets.normal[:, 2] * (z - p[:, 2])) / facets.normal[:, 1]
        place = np.stack([np.full_like(y, x), y, np.full_like(y, z)], axis=1)
        u, v = np.einsum("nkj,nj->kn", facets.across, place - p)
        assert np.sum((u >= 0) & (v >= 0) & (u + v <= 1)) == 1


def test_triangles_without_an_area_are_left_out():
    vertices = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)], float)
    shape = Triangles(vertices, np.array([(0, 1, 2), (0, 1, 3), (1, 1, 3)]))
    assert len(shape.facets().point) == 1 and len(shape.mesh().triangles) == 3


@pytest.mark.parametrize(
    "make, field",
    [
        (lambda: Plane(normal=(0, 0, 0)), "normal"),
        (lambda: Plane(point=(0, np.nan, 0)), "point"),
        (lambda: Rectangle(center=(0, 0, 0), normal=(0, 0, 0), size=(1, 1)), "normal"),
        (lambda: Rectangle(center=(0, 0, np.inf), normal=(0, 1, 0), size=(1, 1)), "center"),
        (lambda: Rectangle(center=(0, 0, 0), normal=(0, 1, 0), size=(1, 0)), "size"),
        (lambda: Rectangle(center=(0, 0, 0), normal=(0, 1, 0), size=(-1, 1)), "size"),
        (lambda: Rectangle(center=(0, 0, 0), normal=(0, 1, 0), size=(1, 1), up=(0, 2, 0)), "up"),
        (lambda: Rectangle(center=(0, 0, 0), normal=(0, 1, 0), size=(1, 1), up=(0, 0, 0)), "up"),
        (lambda: Box(center=(0, 0, 0), size=(1, 1, 0)), "size"),
        (lambda: Box(center=(0, np.nan, 0), size=(1, 1, 1)), "center"),
        (lambda: Heightfield(size=(1, 1), cells=(0, 1), height="0"), "cells"),
        (lambda: Heightfield(size=(1, 1), cells=(1, 4097), height="0"), "cells"),
        (lambda: Heightfield(size=(0, 1), cells=(1, 1), height="0"), "size"),
        (lambda: Heightfield(size=(1, 1), cells=(2, 2), height="1/x"), "height"),
        (lambda: Heightfield(size=(1, 1), cells=(1, 1), height="9**9**9"), "height"),
        (lambda: Heightfield(size=(1, 1), cells=(1, 1), height="y"), "height"),
        (lambda: Heightfield(size=(1, 1), cells=(1, 1), height="1" + "0" * 400), "height"),
        (lambda: Triangles(np.zeros((3, 3)), np.zeros((0, 3), int)), "mesh"),
        (lambda: Triangles(np.full((3, 3), np.nan), np.array([(0, 1, 2)])), "mesh"),
        (lambda: Triangles(np.eye(3), np.array([(0, 1, 3)])), "mesh"),
        (lambda: Triangles(np.eye(3), np.array([(0, 1, -1)])), "mesh"),
    ],
)
def test_invalid_shapes_say_which_parameter(make, field):
    with pytest.raises(Invalid) as error:
        make()
    assert error.value.field == field and "\n" not in str(error.value)


def test_every_shape_is_tested_here():
    assert set(SHAPES.values()) <= {type(shape) for shape in SOME.values()}
