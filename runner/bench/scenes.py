"""What the bench moves balls in: elastic scenes under gravity, from a floor to a million faces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim.model import Balls
from sim.release import Emitter, Scatter
from sim.shapes import Box, Heightfield, Plane, Rectangle
from sim.simulate import Scene

SIDE = 2.0  # m, of the room


@dataclass(frozen=True)
class Place:
    """Surfaces, made when asked for, and how so many balls come between them."""

    surfaces: Callable[[], dict]
    release: Callable[[int], Emitter | Scatter]
    radius: float  # m
    exact: float  # s to simulate exactly: up to 1e5 events of 1000 balls
    stepped: float  # s to simulate in steps

    def scene(self) -> Scene:
        return Scene(surfaces=self.surfaces(), restitution=1.0, damping=0.0)

    def balls(self, count: int) -> Balls:
        """So many balls; the first are the same in any number of them."""
        return Balls(1.0, self.radius, np.inf, *self.release(count).release(1e6))


def hills(cells: int, exact: float = 20.0) -> Place:
    """A field 40 m wide of 2 cells^2 faces, with balls that fall and jump about over its middle."""
    return Place(
        surfaces=lambda: {"field": Heightfield((40, 40), (cells, cells), "0.5*sin(x)*cos(z)")},
        release=lambda count: Scatter(count, ((-10, 1, -10), (10, 2.5, 10)), 1.0),
        radius=0.05,
        exact=exact,
        stepped=1.0,
    )


def baffles() -> dict:
    """The surfaces of the original's scene."""
    wall = {"normal": (1, 0, 0), "size": (2, 2)}
    return {
        "floor": Rectangle((0, 0, 0), (0, 1, 0), (2, 2)),
        "left": Rectangle((-0.466, 1, 0), **wall),
        "right": Rectangle((0.466, 1, 0), **wall),
    }


SCENES = {
    "floor": Place(
        surfaces=lambda: {"floor": Plane()},
        release=lambda count: Scatter(count, ((-5, 0.5, -5), (5, 3, 5)), 1.0),
        radius=0.05,
        exact=600.0,
        stepped=1.0,
    ),
    "box": Place(  # 12 triangles
        surfaces=lambda: {"room": Box((0, 0, 0), (SIDE, SIDE, SIDE), inside=True)},
        release=lambda count: Scatter(count, ((-0.9, -0.9, -0.9), (0.9, 0.9, 0.9)), 5.0),
        radius=0.05,
        exact=300.0,
        stepped=1.0,
    ),
    "baffles": Place(
        surfaces=baffles,
        release=lambda count: Emitter((1.1266, 3.2557, 0), (-0.72975, -0.68367, -0.0082), 5.0, 17.78, 1000.0, count=count),
        radius=0.04,
        exact=3.0,
        stepped=2.0,
    ),
    "heightfield 5,000": hills(50),
    "heightfield 80,000": hills(200),
    "heightfield 1,000,000": hills(708),
}
