"""The shapes of surfaces: each is triangles, and says from which side they are met, and whether it may have an inside.

A new shape is one dataclass here, in SHAPES.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Le

from sim.expression import evaluate
from sim.limits import FARTHEST, MOST_CELLS, MOST_TRIANGLES
from sim.model import Invalid, Mesh, Place, Size, Vector, check, unit

SHOWN = 10.0  # m, side of the patch drawn of an infinite plane

Cells = Annotated[int, Ge(1), Le(MOST_CELLS)]


def frame(normal: np.ndarray, up: Vector | None) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors e1, e2 in the plane of `normal` with e1 x e2 along it; e2 points along `up` as far as it can."""
    if up is None:
        up = (0.0, 0.0, 1.0) if abs(normal[1]) > 1 - 1e-9 else (0.0, 1.0, 0.0)
    e2 = np.asarray(up, float) - np.dot(up, normal) * normal
    if np.linalg.norm(e2) <= 1e-9 * np.linalg.norm(up):
        raise Invalid("up", "must not be parallel to the normal")
    e2 /= np.linalg.norm(e2)
    e2 -= np.dot(e2, normal) * normal  # again, as most of `up` may have cancelled
    e2 /= np.linalg.norm(e2)
    return np.cross(e2, normal), e2


def quads(corner: np.ndarray, e1: np.ndarray, e2: np.ndarray) -> Mesh:
    """The triangles of parallelograms given by a corner and two edges, all (n, 3) m."""
    vertices = np.stack([corner, corner + e1, corner + e1 + e2, corner + e2], axis=1).reshape(-1, 3)
    start = 4 * np.arange(len(corner))[:, None, None]
    return Mesh(vertices, (start + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3))


def _beyond(lengths: np.ndarray) -> str:
    """What `lengths` (m) should be and some are not: finite, and no farther than things may be."""
    with np.errstate(invalid="ignore"):
        low, high = lengths.min(), lengths.max()
    if not (np.isfinite(low) and np.isfinite(high)):
        return "finite"
    return "" if -FARTHEST <= low and high <= FARTHEST else f"within {FARTHEST:g} m"


@dataclass(frozen=True)
class Plane:
    """Infinite and one-sided: solid behind the normal."""

    two_sided: ClassVar[bool] = False
    unbounded: ClassVar[bool] = True
    solid: ClassVar[bool] = True

    point: Place = (0.0, 0.0, 0.0)  # m
    normal: Vector = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        check(self)
        unit("normal", self.normal)

    def mesh(self) -> Mesh:
        e1, e2 = (SHOWN * e for e in frame(unit("normal", self.normal), None))
        return quads(np.atleast_2d(np.asarray(self.point, float) - (e1 + e2) / 2), e1, e2)


@dataclass(frozen=True)
class Rectangle:
    """Two-sided; its second side of length size[1] lies along `up` (default y, or z where the normal is along y)."""

    two_sided: ClassVar[bool] = True
    unbounded: ClassVar[bool] = False
    solid: ClassVar[bool] = False

    center: Place  # m
    normal: Vector
    size: tuple[Size, Size]  # m
    up: Place | None = None

    def __post_init__(self) -> None:
        check(self)
        self._edges()

    def _edges(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A corner and the two edges, (1, 3) m each."""
        e1, e2 = frame(unit("normal", self.normal), self.up)
        e1, e2 = self.size[0] * e1, self.size[1] * e2
        return tuple(np.atleast_2d(a) for a in (np.asarray(self.center, float) - (e1 + e2) / 2, e1, e2))

    def mesh(self) -> Mesh:
        return quads(*self._edges())


@dataclass(frozen=True)
class Box:
    """A solid box, or with `inside` a room whose walls are seen from within."""

    two_sided: ClassVar[bool] = False
    unbounded: ClassVar[bool] = False
    solid: ClassVar[bool] = True

    center: Place  # m
    size: tuple[Size, Size, Size]  # m
    inside: bool = False

    __post_init__ = check

    def mesh(self) -> Mesh:
        center, half = np.asarray(self.center, float), 0.5 * np.asarray(self.size, float)
        # corner number n is on the high side of axis k where bit k of n is set
        high = np.arange(8)[:, None] >> np.arange(3) & 1 == 1
        sides = []
        for k in range(3):
            a, b, c = 1 << (k + 1) % 3, 1 << (k + 2) % 3, 1 << k
            # counter-clockwise seen from outside
            sides += [(c, c + a, c + a + b), (c, c + a + b, c + b), (0, a + b, a), (0, b, a + b)]
        triangles = np.array(sides)
        return Mesh(np.where(high, center + half, center - half), triangles[:, ::-1] if self.inside else triangles)


@dataclass(frozen=True)
class Heightfield:
    """Triangles over the x-z plane, two to a cell, at y = height(x, z); centred on the origin."""

    two_sided: ClassVar[bool] = True
    unbounded: ClassVar[bool] = False
    solid: ClassVar[bool] = False

    size: tuple[Size, Size]  # m, along x and z
    cells: tuple[Cells, Cells]  # along x and z
    height: str  # m, an expression in x and z

    def __post_init__(self) -> None:
        check(self)
        if 2 * self.cells[0] * self.cells[1] > MOST_TRIANGLES:
            raise Invalid("cells", f"make {2 * self.cells[0] * self.cells[1]:,} triangles; there may be {MOST_TRIANGLES:,}")
        try:
            heights = self._heights()
        except ValueError as error:
            raise Invalid("height", str(error)) from None
        if wrong := _beyond(heights):
            raise Invalid("height", f"is not {wrong} everywhere on the field")

    def _points(self) -> tuple[np.ndarray, np.ndarray]:
        """x and z of the corners of cells (n + 1, m + 1) m."""
        return np.meshgrid(*(np.linspace(-s / 2, s / 2, c + 1) for s, c in zip(self.size, self.cells)), indexing="ij")

    @lru_cache(maxsize=4)  # noqa: B019 - asked for again by every run of a sweep
    def _heights(self) -> np.ndarray:
        """y there."""
        x, z = self._points()
        return evaluate(self.height, x=x, z=z)

    @lru_cache(maxsize=4)  # noqa: B019 - as well
    def mesh(self) -> Mesh:
        n, m = self.cells
        x, z = self._points()
        corner = (np.arange(n)[:, None] * (m + 1) + np.arange(m)).reshape(-1, 1, 1)
        # counter-clockwise seen from above: normals up
        cell = np.array([[0, 1, m + 2], [0, m + 2, m + 1]])
        return Mesh(np.stack([x, self._heights(), z], axis=-1).reshape(-1, 3), (corner + cell).reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class Triangles:
    """Any triangles, two-sided: vertices (n, 3) m, corners (m, 3) indices."""

    two_sided: ClassVar[bool] = True
    unbounded: ClassVar[bool] = False
    solid: ClassVar[bool] = True

    vertices: np.ndarray = field(repr=False)
    corners: np.ndarray = field(repr=False)

    def __post_init__(self) -> None:
        if len(self.corners) == 0:
            raise Invalid("mesh", "has no triangles")
        if len(self.corners) > MOST_TRIANGLES:
            raise Invalid("mesh", f"has {len(self.corners):,} triangles; there may be {MOST_TRIANGLES:,}")
        if self.corners.min() < 0 or self.corners.max() >= len(self.vertices):
            raise Invalid("mesh", f"a triangle has a corner that is none of the {len(self.vertices)} vertices")
        if wrong := _beyond(self.vertices):
            bad = int(np.sum(~(np.abs(self.vertices) <= FARTHEST).all(axis=1)))
            raise Invalid("mesh", f"{bad} of {len(self.vertices)} vertices are not {wrong}")

    def mesh(self) -> Mesh:
        return Mesh(self.vertices, self.corners)


#: The name in `shape:` -> the shape. A mesh file becomes Triangles once it is read.
SHAPES = {"plane": Plane, "rectangle": Rectangle, "box": Box, "heightfield": Heightfield}
