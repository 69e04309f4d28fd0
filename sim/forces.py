"""Force fields, the acceleration they give, and the potential that goes with it.

Every field is affine in position and velocity, force = f0 - k x - c v, so all that act always and everywhere add up to
one; only those with a `region` or an `until` are evaluated one by one. A new field is one dataclass here, in FIELDS.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Gt

from sim.model import Invalid, NonNegative, Place, Vector, check, unit

Interval = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Field:
    """What every field may carry: where and until when it acts."""

    region: Mapping[Literal["x", "y", "z"], Interval] = field(default_factory=dict)  # m, open intervals
    until: Annotated[float, Gt(0)] | None = None  # s of the ball's age
    conservative: ClassVar[bool] = False  # has a potential where it acts always and everywhere

    def __post_init__(self) -> None:
        check(self)
        for axis, (low, high) in self.region.items():
            if not low < high:
                raise Invalid("region", f"{axis}: the lower end must be below the upper one")

    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner (3,) of the region in m, infinite where an axis is left out."""
        sides = np.array([self.region.get(axis, (-np.inf, np.inf)) for axis in "xyz"], float)
        return sides[:, 0], sides[:, 1]


@dataclass(frozen=True)
class Uniform(Field):
    """force = magnitude * direction (direction is normalised)."""

    direction: Vector
    magnitude: float  # N, any sign

    def __post_init__(self) -> None:
        super().__post_init__()
        unit("direction", self.direction)

    def affine(self) -> tuple[np.ndarray, float, float]:
        return self.magnitude * unit("direction", self.direction), 0.0, 0.0


@dataclass(frozen=True)
class Drag(Field):
    """force = -coefficient * velocity."""

    coefficient: NonNegative  # N s/m

    def affine(self) -> tuple[np.ndarray, float, float]:
        return np.zeros(3), 0.0, self.coefficient


@dataclass(frozen=True)
class Spring(Field):
    """force = -stiffness * (position - center)."""

    stiffness: NonNegative  # N/m
    center: Place = (0.0, 0.0, 0.0)  # m
    conservative: ClassVar[bool] = True

    def affine(self) -> tuple[np.ndarray, float, float]:
        return self.stiffness * np.asarray(self.center, float), self.stiffness, 0.0


#: The name in `type:` -> the field.
FIELDS = {"uniform": Uniform, "drag": Drag, "spring": Spring}

# Columns of a row of coefficients, per unit mass: acceleration = A - w2 x - b v (- and, for selective rows, their limits)
A, W2, B, LOW, HIGH, UNTIL, WIDTH = 0, 3, 4, 5, 8, 11, 12


class Forces(NamedTuple):
    """All fields of a scene as coefficients for a ball of one mass; rows as laid out above."""

    steady: np.ndarray  # (5,) gravity and every field that acts always and everywhere
    drive: np.ndarray  # (5,) the part of `steady` that has no potential
    selective: np.ndarray  # (n, 12) fields with a region or an until


def pack(fields: list[Field], gravity: Vector, mass: float) -> Forces:
    """Coefficients of `fields` (N) and `gravity` (m/s^2) for balls of `mass` (kg); fields of no strength vanish."""
    steady, drive, selective = np.zeros(5), np.zeros(5), []
    steady[:3] = gravity
    for each in fields:
        f0, k, c = each.affine()
        row = np.array([*f0, k, c]) / mass
        if not row.any():
            continue
        if each.region or each.until is not None:
            low, high = each.box()
            selective.append([*row, *low, *high, np.inf if each.until is None else each.until])
        else:
            steady += row
            if not each.conservative:
                drive += row
    return Forces(steady, drive, np.array(selective, float).reshape(-1, WIDTH))


# The number of selective fields; the compiled kernels bind it to a constant so that the loop unrolls.
SELECTIVE = 0


def acts(f, t, x, forces):
    """Whether selective field `f` acts at age t (s) and position x (m)."""
    s = forces.selective
    return (
        (t < s[f, UNTIL])
        & (s[f, LOW] < x[0]) & (x[0] < s[f, HIGH])
        & (s[f, LOW + 1] < x[1]) & (x[1] < s[f, HIGH + 1])
        & (s[f, LOW + 2] < x[2]) & (x[2] < s[f, HIGH + 2])
    )  # fmt: skip


def add_selective(a, t, x, v, forces):
    """a plus the acceleration by the selective fields that act; a select, not a branch, so that lanes vectorise."""
    s = forces.selective
    ax, ay, az = a
    for f in range(SELECTIVE):
        on = 1.0 if acts(f, t, x, forces) else 0.0
        w2, b = s[f, W2], s[f, B]
        ax += on * (s[f, A] - w2 * x[0] - b * v[0])
        ay += on * (s[f, A + 1] - w2 * x[1] - b * v[1])
        az += on * (s[f, A + 2] - w2 * x[2] - b * v[2])
    return ax, ay, az


def affine(s, x, v):
    """The acceleration (m/s^2) that the coefficients `s` (5,) give at position x (m) and velocity v (m/s)."""
    return s[A] - s[W2] * x[0] - s[B] * v[0], s[A + 1] - s[W2] * x[1] - s[B] * v[1], s[A + 2] - s[W2] * x[2] - s[B] * v[2]


def acceleration(t, x, v, forces):
    """a(t, x, v) in m/s^2 at age t (s), position x (m), velocity v (m/s): gravity plus all fields over the mass."""
    return add_selective(affine(forces.steady, x, v), t, x, v, forces)


def rates(t, x, forces):
    """w2 (1/s^2) and b (1/s) at age t (s) and position x (m): by how much the acceleration falls with each metre and each m/s."""
    s, w2, b = forces.selective, forces.steady[W2], forces.steady[B]
    for f in range(SELECTIVE):
        on = 1.0 if acts(f, t, x, forces) else 0.0
        w2 += on * s[f, W2]
        b += on * s[f, B]
    return w2, b


def driving(t, x, v, forces):
    """The part of the acceleration without a potential: its product with m v is the power that `work` adds up."""
    return add_selective(affine(forces.drive, x, v), t, x, v, forces)


def potential(fields: list[Field], gravity: Vector, mass: float, position: np.ndarray) -> np.ndarray:
    """Potential energy in J at `position` (..., 3) m, of gravity and of the springs that act always and everywhere."""
    energy = -mass * position @ np.asarray(gravity, float)
    for each in fields:
        if each.conservative and not each.region and each.until is None:
            f0, k, _ = each.affine()
            centre = f0 / k if k else f0
            energy = energy + 0.5 * k * np.sum((position - centre) ** 2, axis=-1)
    return energy
