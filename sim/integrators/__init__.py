"""The methods: one module each, found by its name, with its claims in METHOD and its formula in `step`.

    step(h, t, x, v, forces) -> x, v

moves one ball from age t (s), position x (m) and velocity v (m/s), 3-tuples, over h (s), and

    interpolant(h, x, v, a, x1, v1) -> curve

is the curve in between, of the method's own order, on which contacts are found: a curve of METHOD.curve that starts at x
with slope v and ends at x1; a is the acceleration (m/s^2) at the start. Both are plain Python of arithmetic, 3-tuples and, in
a step, `sim.forces.acceleration(t, x, v, forces)` and, for what is implicit, `sim.forces.rates(t, x, forces)`; `sim.jit`
compiles them into the loops over balls. A step knows nothing but its arguments, so an event may cut it anywhere and nothing is
left over from before a bounce. A method whose last evaluation is the first of its next step has besides

    carried(h, t, x, v, a, forces) -> x, v, a

the same step, from the acceleration a at its start to that at its end, which the loops hand on to the next step, unless an
event is in between. An adaptive method has instead

    embedded(h, t, x, v, a, forces) -> x, v, a, dx, dv

with an estimate of the step's error (m, m/s), by which `sim.solvers.adaptive` picks its length; its interpolant takes, last,
the acceleration at the end as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pkgutil import iter_modules


@dataclass(frozen=True)
class Method:
    """What a method claims; the tests hold every claim against what is measured."""

    curve: str  # module of sim.curves to which its interpolant belongs
    order: int  # of the global error on smooth flight
    oscillator_limit: float  # largest stable h * omega on x'' = -omega^2 x; 0: unstable at every step
    drag_limit: float  # largest stable h * b on v' = -b v
    evaluations: int  # of the acceleration, new ones per step where one follows another
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


@cache
def load(name: str) -> tuple[Method, Callable, str]:
    """The claims, the step and the description of the method `name`."""
    module = import_module(f"{__name__}.{name}")
    return module.METHOD, module.step, module.__doc__
