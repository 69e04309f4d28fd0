"""The methods: one module each, found by its name, with its claims in METHOD and its formula in `step`.

    step(h, t, x, v, forces) -> x, v

moves one ball from age t (s), position x (m) and velocity v (m/s), 3-tuples, over h (s), and

    interpolant(h, t, x, v, x1, v1, forces) -> curve

is the curve in between, of the method's own order, on which contacts are found: a curve of METHOD.curve that starts at x
with slope v and ends at x1. Both are plain Python of arithmetic, 3-tuples, `sim.forces.acceleration(t, x, v, forces)` and, for
what is implicit, `sim.forces.rates(t, x, forces)`; `sim.jit` compiles them into the loops over balls. A step knows nothing but
its arguments, so an event may cut it anywhere and nothing is left over from before a bounce. An adaptive method has besides

    embedded(h, t, x, v, forces) -> x, v, dx, dv

the step and an estimate of its error (m, m/s), by which `sim.solvers.adaptive` picks its length.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pkgutil import iter_modules


@dataclass(frozen=True)
class Method:
    """What a method claims; the tests hold every claim against what is measured."""

    curve: str  # module of sim.curves to which its interpolant belongs
    order: int  # of the global error on smooth flight
    oscillator_limit: float  # largest stable h * omega on x'' = -omega^2 x; 0: unstable at every step
    drag_limit: float  # largest stable h * b on v' = -b v
    evaluations: int  # of the acceleration, per step
    symplectic: bool
    reference: str
    reversible: bool = False  # a step back from where a step leads ends where that began
    adaptive: bool = False  # goes by the tolerance, not by a fixed step


def names() -> list[str]:
    """Every method, in alphabetical order."""
    return sorted(module.name for module in iter_modules(__path__))


def fixed() -> list[str]:
    """Those of them with a fixed step."""
    return [name for name in names() if not load(name)[0].adaptive]


def load(name: str) -> tuple[Method, Callable, str]:
    """The claims, the step and the description of the method `name`."""
    module = import_module(f"{__name__}.{name}")
    return module.METHOD, module.step, module.__doc__
