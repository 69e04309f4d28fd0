"""Faces across an axis, two by two: of the walls of a slab a ball meets one or the other, so that it is looked for once."""

from __future__ import annotations

import numpy as np

from sim.packed import NORMAL, POINT, SIDES

# Columns of a slab: the axis, the coordinates (m) along it of the wall whose normal points up it and of the one whose normal points
# down, and their numbers among the faces. A wall that is none is FAR away, and has the number of any.
AXIS, LOW, HIGH, LOWER, UPPER, SLAB_WIDTH = 0, 1, 2, 3, 4, 5
FAR = 1e200  # m


def slabs(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The slabs (n, SLAB_WIDTH) between packed faces, and the numbers (m,) of the faces that are in none: across no axis, or with two
    sides to touch."""
    found, others = [], []
    for f, face in enumerate(faces.tolist()):
        normal = face[NORMAL : NORMAL + 3]
        if face[SIDES] > 1.0 or sorted(map(abs, normal)) != [0.0, 0.0, 1.0]:
            others.append(f)
            continue
        axis, down = (0 if normal[0] else 1 if normal[1] else 2), min(normal) < 0.0
        alone = (slab for slab in found if slab[AXIS] == axis and abs(slab[LOW + down]) == FAR)
        slab = next(alone, None)
        if slab is None:
            slab = [axis, -FAR, FAR, 0, 0]
            found.append(slab)
        slab[LOW + down], slab[LOWER + down] = face[POINT + axis], f
    return np.array(found, float).reshape(-1, SLAB_WIDTH), np.array(others, np.int64)


def walls(slabs, s):
    """The axis of slab s, where its walls are along it (m), and their numbers."""
    return int(slabs[s, AXIS]), slabs[s, LOW], slabs[s, HIGH], int(slabs[s, LOWER]), int(slabs[s, UPPER])
