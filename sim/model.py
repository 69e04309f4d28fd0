"""What things are: the values that pass between the parts of `sim`, in SI units."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import numpy as np
from annotated_types import Ge, Gt, Le

from sim.limits import FARTHEST

#: One impact. `position` is the ball's centre at the impact, `normal` points from the surface to the ball, the speeds
#: are those before the impact, `surface` counts the scene's surfaces in their order. The contact point is
#: position - radius * normal.
BOUNCE = np.dtype(
    [
        ("time", "f8"),  # s
        ("ball", "i8"),
        ("surface", "i4"),
        ("position", "f8", (3,)),  # m
        ("normal", "f8", (3,)),
        ("speed_normal", "f8"),  # m/s
        ("speed_tangential", "f8"),  # m/s
        ("energy_lost", "f8"),  # J
    ]
)

#: A ball comes to rest, or to a slide, on a surface: the first columns of BOUNCE.
REST = np.dtype(BOUNCE.descr[:3])

#: m/s; beyond this a ball counts as diverged.
FASTEST = 1e8


#: Types that say their own range; `check` and the YAML schema both read it.
Vector = tuple[float, float, float]
Place = tuple[*[Annotated[float, Ge(-FARTHEST), Le(FARTHEST)]] * 3]  # m
Positive = Annotated[float, Gt(0)]
Size = Annotated[float, Gt(0), Le(FARTHEST)]  # m
NonNegative = Annotated[float, Ge(0)]
Fraction = Annotated[float, Ge(0), Le(1)]


class Invalid(ValueError):
    """A value that cannot be part of a scene. `field` names the parameter, `reason` says what is wrong with it."""

    def __init__(self, field: str, reason: str):
        super().__init__(f"{field}: {reason}")
        self.field, self.reason = field, reason


def check(self) -> None:
    """The `__post_init__` of a dataclass whose annotations carry ranges: finite numbers, inside their range.

    Raises Invalid naming the field.
    """
    for name, ranges in _ranges(type(self)).items():
        value = getattr(self, name)
        if isinstance(value, (int, float, tuple)) and not finite(value):
            raise Invalid(name, "must be finite")
        for symbol, holds, bound in ranges if value is not None else ():
            if not all(holds(number, bound) for number in numbers(value)):
                raise Invalid(name, f"must be {symbol} {bound}")


@cache
def _ranges(kind: type) -> dict[str, list[tuple[str, Callable, float]]]:
    """Of each field of a dataclass the ranges that its annotation tells."""
    return {
        name: [
            (symbol, holds, bound)
            for part in dict.fromkeys(_parts(hint))
            for limit in getattr(part, "__metadata__", ())
            for symbol, holds, key in ((">", operator.gt, "gt"), (">=", operator.ge, "ge"), ("<=", operator.le, "le"))
            if (bound := getattr(limit, key, None)) is not None
        ]
        for name, hint in get_type_hints(kind, include_extras=True).items()
    }


def _parts(hint: Any) -> Iterator[Any]:
    """The type `hint` and the types in it."""
    yield hint
    for inner in get_args(hint):
        yield from _parts(inner)


def finite(value: float | tuple) -> bool:
    """Whether all numbers in `value` are finite; an integer too large for a float is not."""
    try:
        return all(map(math.isfinite, numbers(value)))
    except OverflowError:
        return False


def numbers(value: float | tuple) -> Iterator[float]:
    """Those in nested tuples, or the one that it is."""
    if isinstance(value, tuple):
        for each in value:
            yield from numbers(each)
    else:
        yield value


def unit(field: str, vector: Vector) -> np.ndarray:
    """`vector` scaled to length 1. Raises Invalid naming `field` when it has no direction."""
    largest = np.max(np.abs(vector))
    if largest == 0:
        raise Invalid(field, "must not be the zero vector")
    scaled = np.asarray(vector, float) / largest  # so that no square overflows or vanishes
    return scaled / np.linalg.norm(scaled)


class Mesh(NamedTuple):
    """Triangles to look at: vertices (n, 3) in m, triangles (m, 3) indices into them."""

    vertices: np.ndarray
    triangles: np.ndarray


@dataclass(frozen=True)
class Balls:
    """n balls of one kind at their release, in order of release time."""

    mass: float  # kg
    radius: float  # m
    lifetime: float  # s
    released: np.ndarray  # (n,) s, simulated time of the release
    position: np.ndarray  # (n, 3) m
    velocity: np.ndarray  # (n, 3) m/s

    def __len__(self) -> int:
        return len(self.released)


class Body(NamedTuple):
    """What all balls of a run have in common, as the kernels take it."""

    mass: float  # kg
    radius: float  # m
    lifetime: float  # s
    restitution: float
    damping: float


@dataclass(frozen=True)
class Trajectory:
    """Where n balls were at each recorded frame; NaN where a ball is not alive."""

    time: np.ndarray  # (frames,) s
    step: np.ndarray  # (frames,) steps of the method since time 0
    position: np.ndarray  # (frames, n, 3) m
    velocity: np.ndarray  # (frames, n, 3) m/s


@dataclass(frozen=True)
class Energy:
    """The ledger at each recorded frame, summed over the balls, in J; every array is (frames,).

    residual = kinetic + potential - supplied - work + lost: what the method itself gained or lost.
    """

    kinetic: np.ndarray  # of the balls alive
    potential: np.ndarray  # of the balls alive, in gravity and in springs that act always and everywhere
    work: np.ndarray  # done by all other fields since time 0
    lost: np.ndarray  # at impacts since time 0
    supplied: np.ndarray  # brought in by balls released, less what was carried off by balls that ended
    residual: np.ndarray
