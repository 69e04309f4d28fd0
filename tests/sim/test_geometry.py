"""From triangles to features: what merges, which edges stick out, what a face covers, how deep a ball is."""

import numpy as np
import pytest

from sim import packed, reduction
from sim.inside import distances, sunk
from sim.packed import pack
from sim.reduction import features
from sim.shapes import Box, Heightfield, Plane, Rectangle, Triangles
from sim.sheet import merge, sheet
from sim.tree import NORMAL, WIDE
from sim.tree import build as build_tree
from sim.walk import search_room
from tests.sim.helpers import soup

NOBODY = np.zeros((0, 3))
NO_TREE = build_tree(NOBODY, NOBODY)
HILLS = Heightfield(size=(4, 3), cells=(7, 6), height="0.3*sin(2*x)*cos(2*z) + 0.05*x*z")
CUBE, ROOM = Box((0, 0, 0), (2, 2, 2)), Box((0, 0, 0), (2, 2, 2), inside=True)


def mesh(vertices, corners):
    return Triangles(np.array(vertices, float), np.array(corners))


def moved(shape, by=(0, 0, 0), turn=True, scale=1.0):
    """The triangles of a shape, scaled, turned so that nothing lies along an axis, and moved."""
    vertices, corners = shape.mesh()
    frame = np.linalg.qr([(1.0, 2, 3), (-2, 1, 1), (0.3, 0.2, -1)])[0] if turn else np.eye(3)
    frame *= np.sign(np.linalg.det(frame))
    return Triangles(scale * vertices @ frame.T + np.array(by, float), np.array(corners))


def joined(*shapes):
    """One surface of the triangles of all."""
    vertices, corners = zip(*(shape.mesh() for shape in shapes))
    shift = np.cumsum([0] + [len(v) for v in vertices])
    return Triangles(np.concatenate(vertices), np.concatenate([c + s for c, s in zip(corners, shift)]))


def unshared(shape):
    """Every triangle with vertices of its own, as in an STL file."""
    vertices, corners = shape.mesh()
    return Triangles(vertices[corners].reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def extruded(outline, height=1.0):
    """A solid over an outline (k, 2) in the x-z plane that the first corner sees all of, from y = 0 up; normals out."""
    k = len(outline)
    low = np.stack([[x, 0, z] for x, z in outline]).astype(float)
    i = np.arange(k)
    j = (i + 1) % k
    fan = np.array([(0, n, n + 1) for n in range(1, k - 1)])
    walls = np.concatenate([np.stack([i, j, j + k], axis=1), np.stack([i, j + k, i + k], axis=1)])
    solid = Triangles(np.concatenate([low, low + (0, height, 0)]), np.concatenate([fan[:, ::-1], fan + k, walls]))
    return solid if volume(solid) > 0 else Triangles(solid.vertices, solid.corners[:, ::-1])


def volume(shape):
    a, b, c = shape.vertices[shape.corners].transpose(1, 0, 2)
    return np.sum(a * np.cross(b, c)) / 6


def sphere(subdivisions=2):
    """An icosahedron, its triangles divided in four, on the unit sphere; normals out."""
    g = (1 + 5**0.5) / 2
    corners = [(s * a, t * b, 0) for s in (1, -1) for t in (1, -1) for a, b in ((1, g),)]
    vertices = np.array([np.roll(c, k) for k in range(3) for c in corners], float)
    triangles = [
        (a, b, c)
        for a in range(12) for b in range(12) for c in range(12)
        if a < b and a < c and b != c
        and all(abs(np.linalg.norm(vertices[p] - vertices[q]) - 2) < 1e-9 for p, q in ((a, b), (b, c), (c, a)))
        and np.linalg.det(vertices[[a, b, c]]) > 0
    ]  # fmt: skip
    soup = vertices[np.array(triangles)]
    for _ in range(subdivisions):
        a, b, c = soup.transpose(1, 0, 2)
        d, e, f = ((p + q) / 2 for p, q in ((a, b), (b, c), (c, a)))
        soup = np.concatenate([np.stack(t, axis=1) for t in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])
    soup /= np.linalg.norm(soup, axis=2, keepdims=True)
    # a midpoint is computed alike from both sides, so that equal corners are equal to the last bit
    return Triangles(soup.reshape(-1, 3), np.arange(3 * len(soup)).reshape(-1, 3))


L_OUTLINE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 3), (0, 3)]
L_SOLID = extruded(L_OUTLINE)


class Seen:
    """The faces of features as the kernels see them, numbered as there."""

    def __init__(self, found):
        self.packed = pack(found._replace(tree=NO_TREE))

    def height(self, f, x):
        return packed.height(self.packed.faces, f, x)

    def covers(self, f, x):
        return packed.covers(self.packed.faces, self.packed.outline, f, x)


def build(shape, starts=NOBODY, **options):
    found, (count,) = features([shape], starts, **options)
    assert (count.faces, count.edges) == (len(found.faces.axis), len(found.edges.length))
    return found, count


def check_layout(found):
    """What kernels rely on."""
    faces, edges = found.faces, found.edges
    n, m = len(faces.axis), len(edges.length)
    for array in (*faces, *edges):
        assert array.flags.c_contiguous and array.dtype in (np.float64, np.float32, np.int64, bool)
    assert faces.first[0] == 0 and faces.first[-1] == len(faces.outline) and len(faces.first) == n + 1
    assert np.array_equal(np.diff(faces.first) == 0, np.arange(n) < found.everywhere)
    assert faces.point.shape == faces.normal.shape == (n, 3) and edges.start.shape == edges.along.shape == (m, 3)
    assert np.allclose(np.linalg.norm(edges.along, axis=1), 1, rtol=0, atol=1e-15) and (edges.length > 0).all()
    items = found.tree.items
    if len(items):
        assert sorted(items[items >= 0]) == list(range(found.everywhere, n + m))
    else:
        assert n + reduction.EDGE_COUNTS * m <= reduction.FEW


# (faces, edges, flat, inner, boundary, nonmanifold, corners, closed)
@pytest.mark.parametrize("turn", [False, True])
@pytest.mark.parametrize(
    "shape, expected",
    [
        (CUBE, (6, 12, 6, 0, 0, 0, 8, True)),
        (L_SOLID, (8, 18, 12, 0, 0, 0, 12, True)),
        (Rectangle((1, 2, 3), (0, 0, 1), (2, 3)), (1, 4, 1, 0, 4, 0, 4, False)),
        (Heightfield((2, 2), (20, 30), "0"), (1, 4, 1750, 0, 100, 0, 4, False)),
        (Heightfield((2, 2), (20, 30), "3*x - 2*z"), (1, 4, 1750, 0, 100, 0, 4, False)),
        (sphere(1), (80, 120, 0, 0, 0, 0, 42, True)),
        (joined(CUBE, moved(CUBE, by=(9, 0, 0))), (12, 24, 12, 0, 0, 0, 16, True)),
        (joined(CUBE, Rectangle((9, 0, 0), (1, 0, 0), (1, 1))), (7, 16, 7, 0, 4, 0, 12, False)),
    ],
    ids=["cube", "L", "rectangle", "flat field", "slope", "sphere", "two cubes", "cube and sheet"],
)
def test_counts(shape, expected, turn):
    found, count = build(moved(shape, by=(0.1, -0.2, 5), turn=turn))
    check_layout(found)
    names = ("faces", "edges", "flat", "inner", "boundary", "nonmanifold", "corners", "closed")
    assert tuple(getattr(count, name) for name in names) == expected
    assert (count.degenerate, count.duplicate) == (0, 0)
    # a closed or open sheet: every edge is the side of two triangles, or of one
    assert 2 * (count.flat + count.inner) + 2 * count.boundary <= 3 * count.triangles + count.boundary


def test_a_fine_flat_grid_is_one_face():
    """However small its triangles, each known to rounding only, and even if some wind the other way."""
    grid = moved(Heightfield((2, 2), (300, 300), "0"), by=(1, 2, 3))
    corners = grid.corners.copy()
    some = np.random.default_rng(0).uniform(size=len(corners)) < 0.5
    corners[some] = corners[some, ::-1]
    for shape in (grid, Triangles(grid.vertices, corners)):
        _, count = build(shape)
        assert (count.faces, count.edges, count.corners, count.flat) == (1, 4, 4, 3 * 90_000 - 600)


def test_a_ridge_between_faces_that_wind_differently():
    """In any order of triangles all of it stays, in few pieces or many."""
    vertices, corners = Heightfield((2, 2), (4, 8), "1 - abs(x)").mesh()
    corners = corners.copy()
    beyond = vertices[corners, 0].mean(axis=1) > 0
    corners[beyond] = corners[beyond, ::-1]
    for seed in range(5):
        shape = Triangles(vertices, np.random.default_rng(seed).permutation(corners))
        found, count = build(shape)
        assert (count.faces, count.boundary) == (2, 24) and 7 <= count.edges <= 6 + 8
        assert found.edges.length.sum() == pytest.approx(2 * 3 + 4 * 2**0.5, rel=1e-14)


def test_a_plane_holds_the_corners_of_a_sliver():
    """Its normal is mostly rounding, but not across its length."""
    rng = np.random.default_rng(0)
    for _ in range(100):
        a, b, c = rng.normal(size=(3, 3))
        sliver = np.array([a, b, 0.4 * a + 0.6 * b + 1e-10 * c])
        found, count = build(Triangles(sliver, np.array([(0, 1, 2)])))
        assert count.faces == 1 and max(abs(Seen(found).height(0, x)) for x in sliver) < 1e-14


@pytest.mark.parametrize("shape, edges, corners, side", [(CUBE, 12, 8, "outside"), (ROOM, 0, 0, "inside")])
def test_box(shape, edges, corners, side):
    for starts in (NOBODY, np.array([(0, 0, 0), (5, 5, 5)])):  # its own sides count, wherever balls are
        found, count = build(shape, starts)
        check_layout(found)
        assert (count.triangles, count.faces, count.edges, count.inner) == (12, 6, edges, 12 - edges)
        assert (count.corners, count.closed, count.side) == (corners, True, side)
        assert not found.faces.two_sided.any()


def test_bumps_stay():
    found, count = build(HILLS)
    check_layout(found)
    assert (count.faces, count.flat, count.boundary, count.closed, count.side) == (84, 0, 26, False, "both")
    assert count.edges == (3 * 84 + 26) // 2 and count.corners == 8 * 7
    assert found.faces.two_sided.all()


@pytest.mark.parametrize("turned_in", [False, True])
@pytest.mark.parametrize(
    "starts, side",
    [
        ([], "both"),
        ([(0, 0, 0)], "inside"),
        ([(0, 0, 0), (0.5, 0.3, -0.2)], "inside"),
        ([(0, 2, 0)], "outside"),
        ([(-3, 0, 0)], "outside"),  # the ray goes through
        ([(-3, 0, 0), (0, 0, 1.2), (-3, 0, 0)], "outside"),
        ([(-3, 0, 0), (0, 0, 0.9)], "both"),
    ],
)
def test_closed_sphere(starts, side, turned_in):
    """The winding of the file does not matter, only where balls start."""
    ball = unshared(sphere())
    if turned_in:
        ball = Triangles(ball.vertices, ball.corners[:, ::-1])
    found, count = build(ball, np.array(starts, float).reshape(-1, 3))
    check_layout(found)
    assert (count.faces, count.closed, count.side) == (320, True, side)
    assert (count.edges, count.inner, count.corners) == ((0, 480, 0) if side == "inside" else (480, 0, 162))
    outward = np.sum(found.faces.normal * found.faces.point, axis=1)
    assert found.faces.two_sided.all() if side == "both" else not found.faces.two_sided.any()
    if side != "both":
        assert (outward > 0).all() if side == "outside" else (outward < 0).all()


def test_parts_have_sides_of_their_own():
    """Balls between two spheres are in the one and out of the other."""
    shell = joined(sphere(), moved(sphere(), turn=False, scale=0.3))
    for starts, edges, sides in (([(0.6, 0, 0)], 480, (False, True)), ([(0, 0, 0)], 0, (False, False))):
        found, count = build(shell, np.array(starts, float))
        assert count.edges == edges and count.side == ("both" if edges else "inside") and not found.faces.two_sided.any()
        outward = np.sum(found.faces.normal * found.faces.point, axis=1)
        outer = np.linalg.norm(found.faces.point, axis=1) > 0.5
        assert outer.sum() == 320 and tuple((outward[half] > 0).all() for half in (outer, ~outer)) == sides


def test_a_ray_through_an_edge_counts_it_once():
    """Along the diagonals and corners of the cube's sides, and beside it in the planes of its sides."""
    cube = Triangles(*CUBE.mesh())
    for y in (-1, -0.5, 0, 0.5, 1):
        for z in (-1, -0.5, 0, 0.5, 1):
            _, count = build(cube, np.array([(-3.0, y, z)]))
            assert count.side == "outside"
            if abs(y) < 1 and abs(z) < 1:
                assert build(cube, np.array([(0.0, y, z)]))[1].side == "inside"


def test_random_starts_are_told_apart():
    ball, starts = moved(L_SOLID, turn=False), np.random.default_rng(0).uniform(-0.5, 3.5, (300, 3))
    x, y, z = starts.T
    within = (y > 0) & (y < 1) & (((x > 0) & (x < 2) & (z > 0) & (z < 1)) | ((x > 0) & (x < 1) & (z > 0) & (z < 3)))
    assert 10 < within.sum() < 290
    for start, is_within in zip(starts, within):
        assert build(ball, start[None])[1].side == ("inside" if is_within else "outside")
    assert build(ball, starts)[1].side == "both"
    assert build(ball, starts[within])[1].side == "inside"
    assert build(ball, starts[~within])[1].side == "outside"


def test_valleys_go_where_balls_are_on_one_side():
    """The L has one edge that sticks in, the others stick out."""
    for by in ((0, 0, 0), (0.3, 0.2, -5)):
        solid = moved(L_SOLID, by)
        outside, within = solid.vertices.mean(axis=0) + 9, solid.vertices[0] * 0.9 + solid.vertices[9] * 0.1
        assert build(solid, outside[None])[1].edges == 17
        _, count = build(solid, within[None])
        assert (count.side, count.edges, count.inner, count.corners) == ("inside", 1, 17, 2)


def test_a_fold_stays():
    """Two triangles folded onto each other in one plane: three edges, the fold among them, and no merging."""
    flap = mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.3, 0.4, 0)], [(0, 1, 2), (1, 0, 3)])
    _, count = build(flap)
    assert (count.faces, count.edges, count.flat, count.boundary) == (2, 5, 0, 4)
    open_flap = mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.3, -0.4, 0)], [(0, 1, 2), (1, 0, 3)])
    _, count = build(open_flap)
    assert (count.faces, count.edges, count.flat, count.boundary) == (1, 4, 1, 4)


def test_duplicates_and_triangles_without_an_area_go():
    vertices = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 0, 0), (0.5, 1e-17, 0), (1, 1, 0.5)]
    corners = [(0, 1, 2), (0, 1, 3), (1, 1, 3), (4, 1, 3), (3, 0, 4), (1, 0, 3), (0, 5, 1), (1, 6, 3)]
    found, count = build(mesh(vertices, corners))
    assert (count.triangles, count.degenerate, count.duplicate, count.faces) == (8, 4, 2, 2)
    assert (count.edges, count.boundary, count.nonmanifold) == (5, 4, 0)
    found, count = build(mesh(vertices, corners), reduce=False)
    assert (count.degenerate, count.duplicate, count.faces) == (4, 0, 4)
    _, count = build(mesh(vertices, [(0, 1, 2)]))
    assert (count.faces, count.edges, count.degenerate, count.closed) == (0, 0, 1, False)


def test_a_fin_stays():
    """Three triangles at an edge, two of them in one plane."""
    fin = mesh([(0, 0, 0), (1, 0, 0), (0.5, 1, 0), (0.5, -1, 0), (0.5, 0, 1)], [(0, 1, 2), (1, 0, 3), (0, 1, 4)])
    _, count = build(fin)
    assert (count.faces, count.edges, count.flat, count.boundary, count.nonmanifold) == (3, 7, 0, 6, 1)
    assert not count.closed


def test_mixed_winding_keeps_both_sides():
    solid = moved(L_SOLID)
    corners = solid.corners.copy()
    corners[::3] = corners[::3, ::-1]
    mixed = Triangles(solid.vertices, corners)
    found, count = build(mixed, np.array([(9.0, 9, 9)]))
    assert (count.faces, count.edges, count.inner, count.closed, count.side) == (8, 18, 0, False, "both")
    assert found.faces.two_sided.all()


def test_vertices_that_no_triangle_shares_are_one():
    for shape, starts in ((L_SOLID, [(9, 9, 9)]), (HILLS, [(0, 9, 0)])):
        shared, apart = (build(s, np.array(starts, float)) for s in (shape, unshared(shape)))
        assert shared[1] == apart[1]
        assert np.array_equal(shared[0].faces.normal, apart[0].faces.normal)
    # 0.0 and -0.0 are one place
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (-0.0, 0, 0), (1, -0.0, 0), (0, -1, 0)]
    assert build(mesh(vertices, [(0, 1, 2), (4, 3, 5)]))[1].faces == 1


@pytest.mark.parametrize("steps, merged", [(1e-20, True), (1e-13, False), (1e-6, False)])
def test_a_gentle_curve_stays(steps, merged):
    """A strip 1000 cells long, bent by `steps` rad at each: flat for rounding at each edge, but not as a whole."""
    strip = Heightfield(size=(1, 0.01), cells=(1000, 1), height=f"{500 * steps:.17g}*x*x")
    found, count = build(strip)
    if merged:
        assert (count.faces, count.edges) == (1, 4)
        return
    assert count.faces >= 1000 and count.edges >= count.faces
    seen, x = Seen(found), np.linspace(-0.499, 0.4987, 50)
    places = np.stack([x, 500 * steps * x * x, 0 * x], axis=1)
    for x in places:
        gaps = [abs(seen.height(f, x)) for f in range(count.faces) if seen.covers(f, x)]
        # a chord is below its arc by s h / 8, with rounding
        assert gaps and min(gaps) < steps * 1e-3 / 8 + 1e-15


def test_a_gentle_curve_is_not_merged_at_once():
    """For `features` looks again whether a face covers its triangles."""
    whole, _, _ = sheet(*Heightfield(size=(1, 0.01), cells=(1000, 1), height="5e-11*x*x").mesh())
    first, _, face, _ = merge(whole, np.ones(len(whole.pairs), bool))
    assert len(first) == 2000 and np.array_equal(face, np.arange(2000))


def test_a_gentle_turn_of_an_outline_stays():
    """A flat strip whose one border is a curve: 1000 steps, straight for rounding at each joint, but not as a whole."""
    x = np.linspace(-0.5, 0.5, 1001)
    for bend, straight in ((0.0, True), (5e-11, False)):
        vertices = np.concatenate([np.stack([x, 0 * x, z], axis=1) for z in (0 * x, 0.01 + bend * x * x)])
        i = np.arange(1000)
        corners = np.concatenate([np.stack([i, i + 1, i + 1002], axis=1), np.stack([i, i + 1002, i + 1001], axis=1)])
        found, count = build(Triangles(vertices, corners))
        assert count.faces == 1 and (count.edges == 4) == straight
        ends = found.edges.start + found.edges.length[:, None] * found.edges.along
        for z, y in vertices[1001:, [2, 0]]:
            on = (found.edges.start[:, 2] > 0.005) & (np.abs(found.edges.along[:, 0]) > 0.5)
            share = (y - found.edges.start[on, 0]) / (ends - found.edges.start)[on, 0]
            here = found.edges.start[on, 2] + share * (ends - found.edges.start)[on, 2]
            assert np.abs(here - z)[(share > -1e-9) & (share < 1 + 1e-9)].min() < 1e-16


def test_a_slit_keeps_its_end():
    """From A to B, with a vertex C on one side of it only: the way turns back at B, though all is on one line."""
    a, b, c, top, low, right = (0, 0, 0), (1, 0, 0), (0.5, 0, 0), (0.5, 1, 0), (0.5, -1, 0), (2, 0, 0)
    slit = mesh([a, b, c, top, low, right], [(0, 2, 3), (2, 1, 3), (1, 5, 3), (0, 4, 1), (1, 4, 5)])
    found, count = build(slit)
    assert (count.faces, count.edges, count.corners) == (1, 6, 5)
    assert np.sort(found.edges.length) == pytest.approx(np.sort([1, 1, 5**0.5 / 2, 5**0.5 / 2, 3.25**0.5, 3.25**0.5]))


def test_what_passes_through_itself_keeps_both_sides():
    """A prism over a bow tie: the rays wind around its two halves in different ways."""
    tie = extruded([(0, 0), (3, 1), (3, 0), (0, 0.5)])
    for start, side in (((0.2, 0.5, 0.3), "both"), ((2.5, 0.5, 0.4), "inside"), ((1, 0.5, 0.9), "outside")):
        assert build(tie, np.array([start]))[1].side == side


def test_far_away_and_large_and_small():
    """Rounding grows with the coordinates, not with the size."""
    for scale, by in ((1, (1e5, -3e5, 2e5)), (1e-6, (0, 0, 0)), (1e9, (0, 0, 0)), (1e-3, (10, 20, 30))):
        _, count = build(moved(L_SOLID, by, scale=scale))
        assert (count.faces, count.edges, count.corners, count.closed) == (8, 18, 12, True)


def ring(n=12):
    """A flat ring of triangles in the plane z = x / 2, its hole of radius 0.5."""
    angle = np.arange(n) * 2 * np.pi / n
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    flat = np.concatenate([0.5 * circle, circle])
    i = np.arange(n)
    j = (i + 1) % n
    corners = np.concatenate([np.stack([i, i + n, j + n], axis=1), np.stack([i, j + n, j], axis=1)])
    return Triangles(np.column_stack([flat, flat[:, 0] / 2]), corners)


def test_a_hole_is_not_covered():
    found, count = build(ring())
    assert (count.faces, count.edges, len(found.faces.outline)) == (1, 24, 24)
    for radius, inside in ((0.0, False), (0.45, False), (0.55, True), (0.9, True), (1.1, False)):
        for angle in np.linspace(0, 6, 17):
            x, y = radius * np.cos(angle), radius * np.sin(angle)
            assert Seen(found).covers(0, (x, y, x / 2)) == inside


def test_a_flat_ramp_over_itself_is_not_merged():
    """A strip that goes one and a half times around in a plane: what it covers twice is no hole."""
    angle = np.arange(19) * np.pi / 6
    circle = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    wide = np.linspace(0, 0.3, 19)[:, None]  # so that the second round has vertices of its own
    i = np.arange(18)
    corners = np.concatenate([np.stack([i, i + 19, i + 20], axis=1), np.stack([i, i + 20, i + 1], axis=1)])
    once = Triangles(np.concatenate([circle, (2 + wide) * circle]), corners[np.tile(i < 12, 2)])
    twice = Triangles(np.concatenate([circle * (1 + wide), (2 + wide) * circle]), corners)
    for ramp, merged in ((once, True), (twice, False)):
        found, count = build(ramp)
        assert (count.faces == 1) == merged
        for x in ramp.vertices[ramp.corners].mean(axis=1):
            assert any(Seen(found).covers(f, tuple(x)) for f in range(count.faces))


def inside_triangle(a, b, c, x):
    u, v = np.linalg.lstsq(np.stack([b - a, c - a], axis=1), x - a, rcond=None)[0]
    return min(u, v, 1 - u - v)


@pytest.mark.parametrize(
    "shape", [moved(L_SOLID), moved(ring()), moved(Heightfield((2, 2), (9, 7), "x")), soup(5, 6), moved(CUBE, (3, 1, 2))]
)
def test_a_face_covers_what_its_triangles_cover(shape):
    """Random points of every face's plane, and points on sides that triangles share."""
    found, count = build(shape)
    seen, normal, triangles = Seen(found), found.faces.normal, shape.vertices[shape.corners]
    rng = np.random.default_rng(0)
    covered = 0
    for f in range(count.faces):
        mine = [t for t in triangles if max(abs(seen.height(f, x)) for x in t) < 1e-12]
        assert mine
        ends = np.concatenate(mine)
        for _ in range(100):
            x = rng.uniform(ends.min(axis=0) - 0.1, ends.max(axis=0) + 0.1)
            x -= seen.height(f, x) * normal[f]
            share = max(inside_triangle(*t, x) for t in mine)
            if abs(share) > 1e-9:
                assert seen.covers(f, tuple(x)) == (share > 0)
                covered += share > 0
        for t in mine:
            for x in (*t, (t[0] + t[1]) / 2, 0.3 * t[1] + 0.7 * t[2]):
                assert seen.covers(f, tuple(x))
    assert covered > 10


def test_neighbours_leave_no_crack():
    """Points on shared sides, off them by rounding, are covered by a face."""
    rng = np.random.default_rng(1)
    found, count = build(HILLS)
    seen, (vertices, corners) = Seen(found), HILLS.mesh()
    for a, b in vertices[corners[:, :2]]:
        x = a + rng.uniform() * (b - a)
        near = [f for f in range(count.faces) if abs(seen.height(f, x)) < 1e-14]
        hits = sum(seen.covers(f, tuple(x + rng.normal(0, 1e-16, 3))) for f in near)
        assert hits >= 2 or np.any(np.abs(x[[0, 2]]) >= (2 - 1e-9, 1.5 - 1e-9))


def test_the_slack_is_small():
    square = Seen(build(Rectangle((0, 0, 0), (0, 1, 0), (2, 2)))[0])
    for off, inside in ((0.0, True), (1e-13, True), (1e-10, False)):
        for x in ((1 + off, 0, 0.3), (0.2, 0, -1 - off), (-1 - off, 0, -1), (-1, 0, 1 + off)):
            assert square.covers(0, x) == inside
    plane = Seen(build(Plane())[0])
    assert plane.covers(0, (1e9, 0, -1e9))


def test_without_reduction_all_stays():
    found, count = build(moved(L_SOLID), np.array([(9.0, 9, 9)]), reduce=False)
    check_layout(found)
    assert (count.faces, count.edges, count.flat, count.inner, count.corners) == (20, 30, 0, 0, 12)
    assert found.faces.two_sided.all()
    found, count = build(ROOM, reduce=False)
    assert (count.faces, count.edges) == (12, 18) and not found.faces.two_sided.any()
    assert build(L_SOLID, edges=False)[1].edges == 0


@pytest.mark.parametrize("shape", [moved(L_SOLID), HILLS, moved(ring()), joined(sphere(1), soup(2, 9)), sphere(1)])
@pytest.mark.parametrize("spread", [0.5, 3.0])
def test_reduction_changes_no_distance(shape, spread):
    """The distance of points on their side to the surface is the distance to its triangles, by faces and kept edges alone."""
    rng = np.random.default_rng(3)
    x = rng.normal(0, spread, (60, 3))
    whole = build(shape, reduce=False)[0].faces
    n = len(whole.axis)
    expected = distances(whole, np.tile(np.arange(n), len(x)), np.repeat(x, n, axis=0)).reshape(-1, n).min(axis=1)
    for ball, distance in zip(x, expected):
        found, count = build(shape, ball[None])
        seen, faces, edges = Seen(found), found.faces, found.edges
        near = [np.inf]
        for f in range(count.faces):
            gap = seen.height(f, ball)
            if (gap >= 0 or faces.two_sided[f]) and seen.covers(f, tuple(ball - gap * faces.normal[f])):
                near.append(abs(gap))
        here = ball - edges.start
        along = np.clip(np.sum(here * edges.along, axis=1), 0, edges.length)
        near += list(np.linalg.norm(here - along[:, None] * edges.along, axis=1))
        assert min(near) == pytest.approx(distance, rel=0, abs=1e-13)


LID = Rectangle((0, 1, 0), (0, 1, 0), (2, 2))
OTHER = Box((5, 0, 0), (2, 2, 2), inside=True)


@pytest.mark.parametrize(
    "shapes, x, room",
    [
        ([ROOM], [(0, 0, 0), (0.99, 0.99, 0.99)], True),
        ([moved(ROOM, (1, 2, 3))], [(1, 2, 3)], True),
        ([ROOM, Plane((0, -3, 0))], [(0, 0, 0)], True),  # a floor that nothing reaches
        ([ROOM, Plane((0, 0, 0))], [(0, 0.5, 0)], False),  # half the room is behind it
        ([ROOM], [(0, 0, 0), (3, 0, 0)], False),
        ([ROOM], [], False),
        ([ROOM, OTHER], [(0, 0, 0)], False),
        ([ROOM, Box((0, 0, 0), (0.5, 0.5, 0.5))], [(0.5, 0.5, 0.5)], False),
        ([ROOM, LID], [(0, 0, 0)], False),
        ([CUBE], [(0, 3, 0)], False),
        ([Plane((0, 0, 0)), Plane((1, 0, 0), (-1, 0, 0))], [(0, 1, 0)], True),
    ],
)
def test_only_a_convex_room_needs_no_outlines(shapes, x, room):
    found, counts = features(shapes, np.reshape(x, (-1, 3)))
    assert all(count.room == room for count in counts)
    assert (len(found.faces.outline) == 0) == room and found.faces.first[-1] == len(found.faces.outline)
    kept, _ = features(shapes, np.reshape(x, (-1, 3)), reduce=False)
    assert room <= (len(kept.faces.outline) > 0 or all(shape.unbounded for shape in shapes))


def test_unbounded_planes_come_first_and_stay_out_of_the_tree():
    shapes = [HILLS, Plane(point=(0, -2, 0)), CUBE, Plane(normal=(1, 0, 0))]
    found, counts = features(shapes, NOBODY)
    check_layout(found)
    assert found.everywhere == 2 and list(found.faces.surface[:2]) == [1, 3]
    assert sorted(found.faces.surface[2:]) == [0] * counts[0].faces + [2] * 6
    assert sorted(found.edges.surface) == [0] * counts[0].edges + [2] * 12
    assert np.isfinite(found.tree.groups[: NORMAL * WIDE]).all()  # the boxes of the first group
    search = search_room(len(found.faces.axis) + len(found.edges.length))
    count = packed.ahead(pack(found), (0.0, 5.0, 0.0), (0.0, 1.0, 0.0), np.inf, search)
    assert list(search.found[:count]) == [0, 1]
    few, _ = features([Rectangle((0, 1, 0), (0, 1, 0), (2, 2)), Plane()], NOBODY)
    search = search_room(len(few.faces.axis) + len(few.edges.length))
    assert few.everywhere == 1 and packed.ahead(pack(few), (0.0, 9.0, 0.0), (0.0, 1.0, 0.0), 1.0, search) == 6
    assert list(search.found) == list(range(6))


def test_the_tree_opens_no_crack(monkeypatch):
    """What an outline lets pass beside it is found by a ray that stays beside it."""
    monkeypatch.setattr(reduction, "FEW", 0)
    found, _ = features([Rectangle((0, 0, 0), (0, 1, 0), (2, 2))], NOBODY, edges=False)
    for off, within in ((0.0, 1), (1e-13, 1), (1e-4, 0)):  # the tree is in single precision
        search = search_room(len(found.faces.axis) + len(found.edges.length))
        assert packed.ahead(pack(found), (1 + off, 1.0, 0.0), (0.0, -1.0, 0.0), np.inf, search) == within
        assert Seen(found).covers(0, (1 + off, 0.0, 0.0)) == within


@pytest.mark.parametrize(
    "shapes, x, expected",
    [
        ([CUBE], [(3, 0, 0), (0, 0.5, 0)], (1, 0, 0.6)),
        ([CUBE], [(1.05, 0, 0)], (0, 0, 0.05)),
        ([CUBE], [(1.05, 1.05, 0)], (0, 0, 0.1 - 0.05 * 2**0.5)),
        ([CUBE], [(1.05, 1.05, 1.05)], (0, 0, 0.1 - 0.05 * 3**0.5)),
        ([CUBE], [(1.11, 0, 0)], (-1, -1, 0)),
        ([CUBE], [(-0.2, 0.9999, 0)], (0, 0, 0.1001)),
        ([ROOM], [(0, 0, 0), (0.89, 0.89, 0.89)], (-1, -1, 0)),
        ([ROOM], [(0, 0, 0), (0.95, 0, 0)], (1, 0, 0.05)),
        ([ROOM], [(0, 4, 5)], (0, 0, 0.1 + 5)),
        ([Plane(), CUBE], [(4, 0.2, 0), (4, -2, 0)], (1, 0, 2.1)),
        ([CUBE, Plane(point=(0, -3, 0))], [(4, -2.96, 0), (4, 0, 0)], (0, 1, 0.06)),
        ([Rectangle((0, 0, 0), (0, 1, 0), (2, 2))], [(0.9, -0.07, 0)], (0, 0, 0.03)),
        ([Rectangle((0, 0, 0), (0, 1, 0), (2, 2))], [(1.06, 0.08, 0)], (-1, -1, 0)),
        ([], [(0, 0, 0)], (-1, -1, 0)),
    ],
)
def test_sunk(monkeypatch, shapes, x, expected):
    x = np.array(x, float)
    for few in (0, 32):
        monkeypatch.setattr(reduction, "FEW", few)
        ball, surface, depth = sunk(shapes, features(shapes, x)[0], x, 0.1)
        assert (ball, surface) == expected[:2] and depth == pytest.approx(expected[2], rel=0, abs=1e-14)


def test_sunk_in_a_mesh():
    """The nearest of all triangles, for many balls at once; no tolerance for the sides of the ring's hole."""
    rng = np.random.default_rng(4)
    for shape in (HILLS, ring(), soup(1, 30), sphere()):
        vertices, corners = shape.mesh()
        x = rng.uniform(vertices.min(axis=0), vertices.max(axis=0), (40, 3))
        points = rng.dirichlet((1, 1, 1), (len(corners), 4000)) @ vertices[corners]
        nearest = np.array([np.linalg.norm(points.reshape(-1, 3) - y, axis=1).min() for y in x])
        found, _ = features([shape], x)
        for radius in (0.05, 0.3):
            ball, surface, depth = sunk([shape], found, x, radius)
            # sampled points are a little farther than the nearest
            assert (ball, surface) == (np.argmin(nearest), 0) or depth > radius - nearest.min()
            assert radius - nearest.min() - 1e-12 <= depth <= radius - nearest.min() + 0.03
