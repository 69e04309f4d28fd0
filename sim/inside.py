"""On which side of closed surfaces balls start, and how deep they are in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sim.geometry import Faces, Features, height
from sim.sheet import PORTION, Sheet, areas, components
from sim.tree import build, overlapping

SUNK = 1e-9  # of the coordinates: a ball that starts this deep in a surface touches it


def sides(whole: Sheet, alike: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, bool]:
    """Where balls can be, for each triangle (m,): 1 on the side of its normal, -1 on the other, 0 on both; and whether the whole
    sheet is closed. `alike` (p,) tells which pairs of sides wind alike; `starts` (k, 3) m, all different.

    Each connected part that is closed has an outside, around which no ray winds, and an inside.
    """
    m = len(whole.corners)
    a, b = (whole.pairs // 3).T
    part = components(m, a, b)
    paired = np.zeros(3 * m, bool)
    paired[whole.pairs[alike]] = True
    shut = np.ones(m, bool)
    shut[part[~paired.reshape(m, 3).all(axis=1)]] = False
    shut = shut[part]
    side = np.zeros(m, np.int64)
    if len(starts) and shut.any():
        which = np.flatnonzero(shut)
        start, of, turns = windings(whole.vertices, whole.corners[which], whole.area[which], part[which], starts)
        from_first = whole.vertices[whole.start[::3]] - whole.vertices[whole.start[3 * part]]
        volume = np.bincount(part, np.sum(from_first * whole.area, axis=1), m)
        out = np.where(volume > 0, 1, -1)  # the side that the normals are on
        within = np.bincount(of, minlength=m)
        strange = np.bincount(of, turns != out[of], m) > 0  # passes through itself
        side = np.where(within == 0, out, np.where((within == len(starts)) & ~strange, -out, 0))[part] * shut
    return side, bool(shut.all()) and m > 0


def windings(vertices, corners, area, part, starts) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How often parts wind around starts: rows (start, part, turns) with turns != 0.

    A ray runs from each start along x and counts the triangles it leaves through less those it enters through. A triangle's
    sides are looked at in a way that both its neighbours share, so that a ray through an edge counts one of them.
    """
    low, high = (join.reduce([vertices[corners[:, k]] for k in range(3)]) for join in (np.minimum, np.maximum))
    to = starts.copy()
    to[:, 0] = np.inf
    start, triangle = overlapping(build(low, high), starts, to)
    x, turns = starts[start], np.zeros(len(start), np.int64)
    for k in range(3):
        p, q = corners[triangle, k], corners[triangle, (k + 1) % 3]
        a, b = vertices[np.minimum(p, q)], vertices[np.maximum(p, q)]
        left = (b[:, 1] - a[:, 1]) * (x[:, 2] - a[:, 2]) - (b[:, 2] - a[:, 2]) * (x[:, 1] - a[:, 1])
        rises = b[:, 2] > a[:, 2]
        met = ((a[:, 2] > x[:, 2]) != (b[:, 2] > x[:, 2])) & ((left > 0) == rises)
        turns += met * np.where(rises == (p < q), 1, -1)
    # whether the triangle's plane is ahead: the height of x over it against the part of the normal along the ray
    over = np.sum(area[triangle] * (x - vertices[corners[triangle, 0]]), axis=1)
    turns *= over * area[triangle, 0] < 0
    hit, parts = turns != 0, part.max(initial=0) + 1
    key, number = np.unique(start[hit] * parts + part[triangle[hit]], return_inverse=True)
    total = np.bincount(number, turns[hit], len(key)).astype(np.int64)
    some = total != 0
    return key[some] // parts, key[some] % parts, total[some]


def starts_inside(surfaces: Mapping[str, object], features: Features, balls) -> tuple[int, str] | None:
    """The ball that starts deepest inside one of the `surfaces`, whose features are given, and what is wrong with it in words;
    None when all start outside, but for rounding."""
    first = np.sort(np.unique(balls.position, axis=0, return_index=True)[1])
    x = balls.position[first]
    place, surface, depth = sunk(list(surfaces.values()), features, x, balls.radius)
    if place < 0 or depth <= SUNK * (balls.radius + np.max(np.abs(x[place]))):
        return None
    ball = int(first[place])
    return ball, f"ball {ball} starts {depth:.3g} m inside the surface '{list(surfaces)[surface]}'"


def sunk(shapes: Sequence, features: Features, x: np.ndarray, radius: float) -> tuple[int, int, float]:
    """The ball at x (k, 3) m that is deepest in a surface: its number, the surface's and the depth (m); (-1, -1, 0.0) if none is.

    A ball whose centre is off a surface reaches into it by what its radius is more than the distance. A surface that is met
    from one side only has a solid behind it, and the depth of a centre in there counts on top.
    """
    faces = features.faces
    n, k = len(faces.axis), len(x)
    everywhere = np.arange(features.everywhere if len(features.tree.items) else n)
    ball, face = np.repeat(np.arange(k), len(everywhere)), np.tile(everywhere, k)
    near, item = overlapping(features.tree, x - radius, x + radius)
    ball, face = np.append(ball, near[item < n]), np.append(face, item[item < n])
    depth = radius - distances(faces, face, x[ball])
    for number, shape in enumerate(shapes):
        mine = np.flatnonzero(faces.surface == number)
        if shape.two_sided or len(mine) == 0:  # it may be too small to have a face
            continue
        behind = np.flatnonzero(_behind(shape, faces, mine, x))
        balls, walls = np.repeat(behind, len(mine)), np.tile(mine, len(behind))
        nearest = distances(faces, walls, x[balls]).reshape(-1, len(mine)).min(axis=1, initial=np.inf)
        ball, face = np.append(ball, behind), np.append(face, np.repeat(mine[:1], len(behind)))
        depth = np.append(depth, radius + nearest)
    if len(depth) == 0 or not depth.max() > 0:
        return -1, -1, 0.0
    worst = int(np.argmax(depth))
    return int(ball[worst]), int(faces.surface[face[worst]]), float(depth[worst])


def _behind(shape, faces: Faces, mine: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Which centres x (k, 3) m are in the solid behind a one-sided shape, whose faces are `mine`."""
    if shape.unbounded:
        return height(faces, mine[:1], x) < 0
    vertices, corners = shape.mesh()
    area, _ = areas(vertices, corners)
    start, _, _ = windings(vertices, corners, area, np.zeros(len(corners), int), x)
    within = np.isin(np.arange(len(x)), start)
    return within if np.sum((vertices[corners[:, 0]] - vertices[0]) * area) > 0 else ~within


def distances(faces: Faces, f: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The distance (m) of each point x (k, 3) m to the face f (k,): to its plane over its outline, to the outline elsewhere."""
    out = np.empty(len(f))
    rows = np.cumsum(np.diff(faces.first)[f])
    begin = 0
    while begin < len(f):  # in portions, as outlines may be long
        done = rows[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(rows, done + PORTION, side="right")))
        here, place = f[begin:end], x[begin:end]
        gap = height(faces, here, place)
        out[begin:end] = np.abs(gap)
        off = np.flatnonzero(~_over(faces, here, place - gap[:, None] * faces.normal[here]))
        out[begin + off] = _to_outline(faces, here[off], place[off])
        begin = end
    return out


def _segments(faces: Faces, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The outlines of faces f (k,), one after the other: the number in f (m,) and the segment (m, 4) of each row."""
    count = np.diff(faces.first)[f]
    row = np.repeat(np.arange(len(f)), count)
    return row, faces.outline[np.arange(len(row)) + np.repeat(faces.first[f] - (np.cumsum(count) - count), count)]


def _over(faces: Faces, f: np.ndarray, foot: np.ndarray) -> np.ndarray:
    """Whether points (k, 3) m of the planes of faces f (k,) are inside their outlines, without the slack of `covers`."""
    row, segment = _segments(faces, f)
    pairs, axis = np.arange(len(f)), faces.axis[f]
    u, v = foot[pairs, (axis + 1) % 3][row], foot[pairs, (axis + 2) % 3][row]
    u0, v0, u1, v1 = segment.T
    left = (u1 - u0) * (v - v0) - (v1 - v0) * (u - u0) > 0
    met = ((v0 > v) != (v1 > v)) & (left == (v1 > v0))
    return (np.bincount(row[met], minlength=len(f)) % 2 == 1) | (faces.first[f] == faces.first[f + 1])


def _to_outline(faces: Faces, f: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The distance (m) of each point x (k, 3) m to the outline of face f (k,)."""
    row, segment = _segments(faces, f)
    turn = (faces.axis[f][:, None] + np.arange(3)) % 3  # the axis left out, u, v
    normal, point, place = (np.take_along_axis(a, turn, axis=1)[row] for a in (faces.normal[f], faces.point[f], x))
    ends = []
    for u, v in (segment[:, :2].T, segment[:, 2:].T):  # back onto the plane
        w = point[:, 0] - (normal[:, 1] * (u - point[:, 1]) + normal[:, 2] * (v - point[:, 2])) / normal[:, 0]
        ends.append(np.stack([w, u, v], axis=1))
    along, here = ends[1] - ends[0], place - ends[0]
    share = np.clip(np.sum(here * along, axis=1) / np.sum(along**2, axis=1), 0, 1)
    nearest = np.full(len(f), np.inf)
    np.minimum.at(nearest, row, np.linalg.norm(here - share[:, None] * along, axis=1))
    return nearest
