"""What a ball can touch: flat faces, and the edges that stick out where they meet or end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.tree import Tree

# How far beside its outline a face still counts, as a share of the outline's coordinates: neighbours share an edge without a
# crack. A foot point is known to some roundings (2e-16) of where its ball was, which may be far from a small face.
EDGE = 1e-12


class Faces(NamedTuple):
    """n flat pieces of surface, of triangles side by side in one plane. Unbounded planes come first."""

    point: np.ndarray  # (n, 3) m, of the plane; one of the face's own vertices
    normal: np.ndarray  # (n, 3) unit
    two_sided: np.ndarray  # (n,) bool; a one-sided face is met from the side its normal points to
    surface: np.ndarray  # (n,) index of the surface it belongs to
    axis: np.ndarray  # (n,) the coordinate in which the normal is largest, left out where outlines are compared
    first: np.ndarray  # (n + 1,) the outline of face f is rows first[f] to first[f + 1] - 1; no row: it is unbounded
    outline: np.ndarray  # (m, 4) m, segments u0, v0, u1, v1 in coordinates axis + 1 and axis + 2; holes alike, in any order


class Edges(NamedTuple):
    """m edges that stick out to where a ball can be. So does every corner that is the end of one, and no other."""

    start: np.ndarray  # (m, 3) m
    along: np.ndarray  # (m, 3) unit
    length: np.ndarray  # (m,) m
    surface: np.ndarray  # (m,) index of the surface it belongs to
    normal: np.ndarray  # (m, 3) float32 unit, to where it sticks out; zero where that is not known
    spread: np.ndarray  # (m,) float32, the sine of the largest angle between the normal and the direction of a touch


class Features(NamedTuple):
    """All that a ball can touch. Numbered through: n faces, then m edges, both in the order of their tree."""

    faces: Faces
    edges: Edges
    tree: Tree  # over the boxes of all that is bounded; empty where there is little
    everywhere: int  # so many faces, the first ones, are unbounded: in no tree, looked at always


def height(faces: Faces, f: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Signed distance (k,) m of points x (k, 3) m to the planes of faces f (k,), positive on the side their normals point to."""
    return np.sum(faces.normal[f] * (x - faces.point[f]), axis=1)
