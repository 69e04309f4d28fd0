"""Shapes: where their faces lie, which way they face, and that what is drawn is what is hit."""

import numpy as np
import pytest

from sim.model import Invalid
from sim.reduction import features
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


def faces_of(shape):
    return features([shape], np.zeros((0, 3)))[0].faces


def loop(faces, f):
    """The segments (k, 2, 3) m of the outline of face f, back on its plane."""
    axis, n, p = faces.axis[f], faces.normal[f], faces.point[f]
    ends = faces.outline[faces.first[f] : faces.first[f + 1]].reshape(-1, 2, 2)
    out = np.empty((len(ends), 2, 3))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    out[..., u], out[..., v] = ends[..., 0], ends[..., 1]
    out[..., axis] = p[axis] - (n[u] * (out[..., u] - p[u]) + n[v] * (out[..., v] - p[v])) / n[axis]
    return out


def areas(faces):
    """Of faces in one piece, by their outlines, which here run all the same way."""
    around = [np.cross(*(loop(faces, f) - faces.point[f]).transpose(1, 0, 2)).sum(axis=0) / 2 for f in range(len(faces.axis))]
    return np.linalg.norm(around, axis=1)


def mesh_areas(mesh):
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize("name", SOME)
def test_normals_are_units_across_the_outline(name):
    faces = faces_of(SOME[name])
    assert np.allclose(np.linalg.norm(faces.normal, axis=1), 1, **NEAR)
    assert np.array_equal(np.abs(faces.normal).argmax(axis=1), faces.axis)
    vertices = SOME[name].mesh().vertices
    for f in range(len(faces.axis)):
        assert np.abs(vertices - faces.point[f]).max(axis=1).min() == 0
        for x in loop(faces, f).reshape(-1, 3):
            # lifted back onto the plane it must be a vertex of the mesh
            assert np.abs(vertices - x).max(axis=1).min() < 1e-13


@pytest.mark.parametrize("name", [name for name in SOME if name != "plane"])
def test_drawn_is_what_is_hit(name):
    """The same area, facing the same way."""
    faces, mesh = faces_of(SOME[name]), SOME[name].mesh()
    assert areas(faces).sum() == pytest.approx(np.linalg.norm(mesh_areas(mesh), axis=1).sum(), rel=1e-13)
    assert np.allclose(areas(faces) @ faces.normal, mesh_areas(mesh).sum(axis=0), rtol=0, atol=1e-13)
    assert np.array_equal(faces.two_sided, [SOME[name].two_sided] * len(faces.axis))


def test_plane():
    (found, _), mesh = features([SOME["plane"]], np.zeros((0, 3))), SOME["plane"].mesh()
    faces = found.faces
    assert np.allclose(faces.normal, np.array([[1, -2, 0.5]]) / np.sqrt(5.25), **NEAR)
    assert found.everywhere == 1 and not faces.two_sided and list(faces.first) == [0, 0] and len(faces.outline) == 0
    assert abs((faces.point[0] - (1, 2, 3)) @ faces.normal[0]) < 1e-14
    assert np.allclose((mesh.vertices - (1, 2, 3)) @ faces.normal[0], 0, **NEAR)
    assert np.allclose(mesh.vertices.mean(axis=0), (1, 2, 3), **NEAR)
    assert (mesh_areas(mesh) @ faces.normal[0] > 0).all()


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
    mesh = rectangle.mesh()
    corner, second_of_e1, _, second_of_e2 = mesh.vertices
    n = np.array(normal) / np.linalg.norm(normal)
    assert np.allclose(second_of_e2 - corner, 3 * np.array(second), **NEAR)
    assert np.allclose(second_of_e1 - corner, 2 * np.cross(second, n), **NEAR)
    assert np.allclose(faces_of(rectangle).normal[0], n, **NEAR)
    assert np.allclose(mesh.vertices.mean(axis=0), (1, 2, 3), **NEAR)


@pytest.mark.parametrize("inside", [False, True])
def test_box_is_closed_and_faces_where_a_ball_can_be(inside):
    faces = faces_of(SOME["room" if inside else "box"])
    assert len(faces.axis) == 6 and not faces.two_sided.any()
    assert sorted(areas(faces)) == pytest.approx([6, 6, 8, 8, 12, 12], rel=1e-14)
    # the divergence theorem, for a constant and for x / 3: nothing flows through, the volume does
    assert np.allclose(areas(faces) @ faces.normal, 0, **NEAR)
    volume = areas(faces) @ np.sum(faces.point * faces.normal, axis=1) / 3
    assert volume == pytest.approx(-24 if inside else 24, rel=1e-13)
    outward = np.sum((faces.point - (1, 2, 3)) * faces.normal, axis=1)
    assert (outward < 0).all() if inside else (outward > 0).all()


def test_heightfield():
    field = SOME["heightfield"]
    x, y, z = field.mesh().vertices.T
    assert np.allclose(y, 0.3 * np.sin(2 * x) * np.cos(2 * z), **NEAR)
    assert sorted(set(x)) == pytest.approx(np.linspace(-2, 2, 6))
    assert sorted(set(z)) == pytest.approx(np.linspace(-1.5, 1.5, 5))
    area = mesh_areas(field.mesh())
    assert len(area) == 2 * 5 * 4 and (area[:, 1] > 0).all()
    # seen from above the triangles cover the field once
    assert area[:, 1].sum() == pytest.approx(12, rel=1e-13)


def test_heightfield_covers_each_place_once():
    """Random places seen from above are over one triangle each."""
    a, b, c = SOME["heightfield"].mesh().vertices[SOME["heightfield"].mesh().triangles][:, :, [0, 2]].transpose(1, 0, 2)
    for x in np.random.default_rng(0).uniform((-2, -1.5), (2, 1.5), (200, 2)):
        u, v = np.linalg.solve(np.stack([b - a, c - a], axis=2), (x - a)[..., None])[..., 0].T
        assert np.sum((u >= 0) & (v >= 0) & (u + v <= 1)) == 1


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
