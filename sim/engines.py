"""What moves the balls of a simulation: one engine for the original's contact rule, one for swept contact.

An engine splits the balls into parts, each of which is moved by itself:

    parts(hands) -> list                           all balls at their release, in parts that many hands can share
    rooms(hands) -> list                           what each hand needs to compute in
    move(part, frame, record, room, log) -> frame, rows, bad
        on from frame number `frame`; the next one to fill, rows of the log filled, and the first frame at which a ball of the
        part has diverged, or None. Call it again until all frames are filled. It writes into nothing but what it is given, and
        of the record only into the columns of the part's balls.
    stride(time) -> int                            frames to move all parts through before the next ones
    ends(parts) -> Ends                            where all balls are in the end
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from functools import cache, cached_property, partial
from math import ceil

import numpy as np

from sim import advance, coast, forces, integrators, jit, lanes, motion, rest, state, travel
from sim.curves import majorant
from sim.hop_lanes import hop_room, only_few_faces
from sim.solvers import stepping
from sim.walk import search_room

BUDGET = 4096  # steps of a block between two looks at `stop`: milliseconds
PIECES = 16384  # of flight, the same
PART = 1024  # balls that are moved on before the next ones


class Stalled(RuntimeError):
    """Events of a ball pile up without an end."""


@dataclass(frozen=True)
class Ends:
    """Where n balls are when their flight or the simulation ends."""

    position: np.ndarray  # (n, 3) m
    velocity: np.ndarray  # (n, 3) m/s
    at_rest: np.ndarray  # (n,) bool: on a surface, without speed
    steps: int  # of all balls together
    passed: int  # faces that a centre passed through, of all balls together


class Original:
    """Blocks of balls side by side, a step at a time, with the original's contact rule."""

    def __init__(self, solver, balls, duration, body, packed, features):
        self.dt, self.balls, self.duration = float(solver.step), balls, duration
        self.given = body, packed, features
        self.kernel = jit.bind(advance.advance, SELECTIVE=len(packed.selective), **steps(solver.method))

    def parts(self, hands: int) -> list:
        features = self.given[-1]
        return [lanes.fill_block(k, self.balls, self.duration, features) for k in range(0, len(self.balls), lanes.LANES)]

    def rooms(self, hands: int) -> list[tuple]:
        return [()] * hands  # each block has its own

    def move(self, block, frame, record, room, log):
        frame, rows, diverged = self.kernel(block, self.dt, *self.given, frame, record, log, BUDGET)
        return (len(record.time), rows, frame - 1) if diverged else (frame, rows, None)

    def stride(self, time):
        interval = time[1] - time[0] if len(time) > 1 else self.duration
        return max(1, int(BUDGET * self.dt / interval))

    def ends(self, blocks) -> Ends:
        def rows(start, count=1):
            return np.concatenate([b.s.reshape(-1, lanes.LANES)[start // lanes.LANES :][:count, : b.count].T for b in blocks])

        return Ends(
            position=rows(lanes.X, 3),
            velocity=rows(lanes.V, 3),
            at_rest=np.zeros(len(self.balls), bool),
            steps=int(rows(lanes.STEPS).sum()),
            passed=int(rows(lanes.CROSSED).sum()),
        )


class Swept:
    """Balls one by one from event to event: the exact solver, or a method with steps."""

    def __init__(self, solver, balls, duration, body, packed, features):
        self.solver, self.balls, self.duration = solver, balls, duration
        self.dt = float(solver.step) if solver.stepping else np.inf
        claims = integrators.load(solver.method)[0] if solver.method != "exact" else None
        # a method of first order cannot tell a hop of a few steps from rest
        blur = 4 * self.dt if claims and claims.order == 1 else 0.0
        self.given = float(solver.tolerance), blur, body, packed, features
        if solver.stepping:
            loop, self._lanes = coast.coast, coast.coast_room
        else:
            looked_at = features.faces if only_few_faces(features) else features.faces[:0]
            loop, self._lanes = travel.travel, partial(hop_room, looked_at, len(features.faces) + len(features.edges))
        self.kernel = jit.bind(loop, **bindings(solver.method, packed))
        self._rooms = []

    @cached_property
    def method(self) -> tuple:
        """What the kernel is handed of it, see `sim.solvers`."""
        return entries(self.solver.method, len(self.balls) <= coast.FEW) if self.solver.stepping else ()

    def parts(self, hands: int) -> list:
        states = state.depart_states(self.balls, self.duration, self.dt)
        rounds = ceil(len(states) / (hands * PART))
        size = ceil(len(states) / (hands * rounds))  # as many parts for each hand
        return [(k, states[k : k + size]) for k in range(0, len(states), size)]

    def rooms(self, hands: int) -> list[tuple]:
        features = self.given[-1]
        while len(self._rooms) < hands:
            self._rooms.append((search_room(len(features.faces) + len(features.edges)), self._lanes()))
        return self._rooms[:hands]

    def move(self, part, frame, record, room, log):
        first, states = part
        how, i, rows = self.kernel(states, first, self.method, *self.given, *room, record, log, PIECES)
        if how == travel.STALLED:
            x, age = states[i, state.X : state.X + 3], states[i, state.AGE]
            raise Stalled(
                f"ball {first + i} has had {state.MOST_EVENTS} events within a second, the last at age {age:.6g} s near "
                f"({', '.join(f'{c:.4g}' for c in x)}) m: its bounces pile up"
            )
        bad = None
        if how == travel.DIVERGED:
            bad = int(states[i, state.FRAME])
            states[i, state.FRAME] = len(record.time)
        return int(states[:, state.FRAME].min()), rows, bad

    def stride(self, time):
        return len(time)

    def ends(self, parts) -> Ends:
        states = np.concatenate([states for _, states in parts])
        velocity = states[:, state.V : state.V + 3]
        return Ends(
            position=states[:, state.X : state.X + 3],
            velocity=velocity,
            at_rest=(states[:, state.COUNT] > 0) & ~velocity.any(axis=1),
            steps=int(states[:, state.STEPS].sum()),
            passed=int(states[:, state.CROSSED].sum()),
        )


#: The names in the kernel `travel` that a curve, a solver and a method stand for.
CURVE = (
    *("flight", "point", "slope", "bend", "bends", "series", "project", "start", "seen_from", "seen_along", "piece", "fall"),
    *("value", "dip", "as_quintic"),
)
SOLVER = "SMALL_STEPS", "goal", "hands_on", "depart", "arrive", "squared_speed"
METHOD = "step", "carried", "embedded", "interpolant"


def steps(method: str) -> dict:
    """What the names stand for that are the method's own."""
    names = of_module(f"integrators.{method}", METHOD)
    return names | {"CARRIES": "carried" in names or "embedded" in names}


@cache
def entries(method: str, few: bool, compiled: bool = True, **names) -> stepping.Steps:
    """A fixed-step method's own functions, for few balls or many, `names` in them bound; with `compiled` False in plain Python."""
    own = steps(method) | of_module(f"curves.{integrators.load(method)[0].curve}", CURVE) | of_module("solvers.stepping", SOLVER)
    names = own | {"acceleration": motion.acceleration, "rates": motion.rates} | names
    names |= {"WIDE": coast.FEW, "GROUP": 1} if few else {}
    still, lane = (0.0, 0.0, 0.0), coast.coast_room()
    mover = motion.Motion(still, 0.0, 0.0, still, 0.0, 0.0, rest.no_contacts())

    def entry(function, *arguments):
        return jit.entry(function, arguments, **names) if compiled else jit.bind(function, compiled=False, **names)

    made = stepping.Steps(
        take=entry(stepping.take, 0.0, 0.0, still, still, still, mover),
        march=entry(coast.march, lane, 0.0, 0.0),
        step_in=entry(coast.step_in, lane, 0, 0.0),
        commit=entry(coast.commit, lane, 0.0),
        carries=names["CARRIES"],
    )
    return jit.typed(made) if compiled else made


def bindings(method: str, packed: forces.Forces) -> dict:
    """What the names in the kernel `travel` stand for with this method and these fields."""
    curve = curve_of(method, packed)
    solver = solver_of(method)
    names = steps(method) if solver == "adaptive" else {}
    names |= {"acceleration": motion.acceleration, "rates": motion.rates, "fall": majorant.fall, "piece": majorant.chord}
    names["HOPS"] = method == "exact" and curve == "parabola"
    return names | of_module(f"curves.{curve}", CURVE) | of_module(f"solvers.{solver}", SOLVER)


def of_module(name: str, wanted: tuple) -> dict:
    """Those of the names `wanted` that a module of `sim` has."""
    found = vars(importlib.import_module(f"sim.{name}"))
    return {name: found[name] for name in wanted if name in found}


def solver_of(method: str) -> str:
    """The module of `sim.solvers` that the method needs."""
    return method if method == "exact" else "adaptive" if integrators.load(method)[0].adaptive else "stepping"


def curve_of(method: str, packed: forces.Forces) -> str:
    """The module of `sim.curves` of the method's flights in these fields, as events are looked for on them: most of the kernel `travel`
    is the same for all methods with the same one, and compiled once."""
    if method != "exact":
        return "quintic"
    rows = np.vstack([packed.steady, packed.selective[:, : len(packed.steady)]])
    return "oscillation" if rows[:, [forces.W2, forces.B]].any() else "parabola"
