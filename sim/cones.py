"""How edges stick out: the directions in which a ball can be that touches one.

A ball touches an edge, or a corner at its ends, in a direction that is a mean of the normals of the faces there. So an edge has
a normal, the mean of its two faces', and a largest angle between that and such a direction. That of a corner where edges stick
out to both sides holds as well: its directions are bounded by normals of the faces beside edges that stick out the same way.
"""

from __future__ import annotations

import numpy as np

from sim.sheet import Sheet
from sim.tree import ANY

ROUNDED = 1e-6  # by which cosines of single precision are taken for less


def corner_cones(whole: Sheet, normal: np.ndarray, strange: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each vertex (n,) of triangles with the unit normals (m, 3): their mean direction (n, 3), and the least cosine between that
    and one of them (n,), -1 at the ends of the sides `strange`, where not all of them are known to look to the same side."""
    n = len(whole.vertices)
    mean = np.stack([np.bincount(whole.start, np.repeat(normal[:, k], 3), n) for k in range(3)], axis=1).astype(np.float32)
    size = np.linalg.norm(mean, axis=1)
    mean /= np.where(size > 0, size, 1)[:, None]
    least = np.ones(n, np.float32)
    for k in range(3):
        corner = whole.corners[:, k]
        np.minimum.at(least, corner, np.einsum("ij,ij->i", mean[corner], normal))
    least -= ROUNDED
    least[whole.start[strange]] = least[whole.end[strange]] = -1.0
    return mean, least


def edge_normals(one: np.ndarray, other: np.ndarray, convex: np.ndarray) -> np.ndarray:
    """Unit normals (k, 3) of edges between triangles with normals `one` and `other` (k, 3), to where the edge sticks out, which is
    where the normals point if `convex` (k,)."""
    mean = one + other
    size = np.linalg.norm(mean, axis=1)
    return mean * (np.where(convex, 1.0, -1.0) / np.where(size > 0, size, 1.0)).astype(np.float32)[:, None]


def spreads(normal: np.ndarray, ends: tuple[np.ndarray, np.ndarray], cones: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """For edges with the unit `normal` (k, 3) between the vertices `ends`: the sine of the largest angle between it and the direction
    of a touch, or ANY. That is at most the angle from the normal to a corner's mean and on from there."""
    mean, least = cones
    cosine, known = np.ones(len(normal), np.float32), np.ones(len(normal), bool)
    for end in ends:
        a, b = np.abs(np.einsum("ij,ij->i", normal, mean[end])) - ROUNDED, least[end]
        both = a * b - np.sqrt(np.maximum(1 - a * a, 0) * np.maximum(1 - b * b, 0))
        known &= (a > 0) & (b > 0) & (both > 0)
        cosine = np.minimum(cosine, both)
    return np.where(known, np.sqrt(1 - cosine * cosine), ANY)
