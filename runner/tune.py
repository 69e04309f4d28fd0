"""The cheapest method and step on a scene, found by measurement: how far each ends from the exact solution, and what it takes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from runner import ladder, reference, starts
from runner.config import Experiment
from runner.errors import InputError, RunError
from runner.ladder import Found, Ladder, Trial
from sim import integrators
from sim.engines import Stalled
from sim.model import Invalid
from sim.simulate import EXACT, Flight, Simulation, Solver

LEAST = 1e-11  # m; what the exact solution itself is tested to
BUDGET = 10.0  # s that a trial may take
DEARER = 10.0  # times the cheapest so far: a method that is expected to cost more is given up
UNNOTICED = 0.2  # s; whatever costs less is tried all the same
BRIEF = 0.02  # s; a trial that takes less is made again, a few times in all, and the fastest counts
RIVAL = 3.0  # times the cheapest: those below are timed against each other
FEWEST, MOST, ENOUGH = 3, 500, 3.0  # repeats to time, and s that are enough for them


class Timing(NamedTuple):
    """Repeats of one simulation, each beside one of every rival."""

    seconds: float  # of the processor, of the fastest
    spread: float  # how far the fastest of a third of the repeats may be above, relative
    repeats: int


@dataclass(frozen=True)
class Candidate:
    """A method, and what was found of it."""

    method: str
    contact: str
    knob: str  # step or tolerance
    order: float  # with which the error should fall with the knob
    found: Found
    best: Trial | None  # the cheapest below the target, whose finer ones are below it, too
    timing: Timing | None = None  # of the best, where it is among the cheapest

    @property
    def seconds(self) -> float:
        """What the method takes at its best; infinite where it has none."""
        return self.timing.seconds if self.timing else self.best.seconds if self.best else math.inf

    @property
    def closest(self) -> Trial:
        """The smallest error of all trials."""
        return min(self.found.trials, key=lambda trial: trial.error)

    @property
    def finer(self) -> list[Trial]:
        """The next finer trials than the best."""
        return [trial for trial in self.found.trials if self.best and trial.setting < self.best.setting][: ladder.GUARDS]

    @property
    def measured(self) -> float | None:
        """The order with which the error falls from the best to the finer; None where all is rounding, or there is no finer."""
        return _slope([self.best, *self.finer] if self.best else [])

    @property
    def erratic(self) -> bool:
        """Whether the error does not fall as it should from the best on: with half the order at least, and at each finer one."""
        errors = [max(each.error, LEAST) for each in (self.best, *self.finer) if each]
        return self.measured is not None and (self.measured < self.order / 2 or errors != sorted(errors, reverse=True))

    @property
    def flat(self) -> bool:
        """Whether the setting makes no difference to the error, by a tenth: something else, as bounces, cuts the steps."""
        errors = [each.error for each in (self.best, *self.finer) if each]
        return len(errors) > 1 and max(errors) <= 1.1 * min(errors)

    @property
    def stuck(self) -> bool:
        """Whether over all trials the error falls with less than half the order."""
        slope = _slope([trial for trial in self.found.trials if math.isfinite(trial.error)])
        return slope is not None and slope < self.order / 2


def _slope(trials: list[Trial]) -> float | None:
    """The order of the error in the setting, fitted to what is above rounding; None with less than two."""
    points = [(math.log(each.setting), math.log(each.error)) for each in trials if each.error > LEAST]
    return float(np.polyfit(*zip(*points), 1)[0]) if len(points) > 1 else None


@dataclass(frozen=True)
class Tuning:
    """What there is to choose from."""

    target: float  # m
    candidates: tuple[Candidate, ...]  # cheapest first, then those without a setting below the target
    exact: Timing
    duration: float  # s
    ball_seconds: float  # of flight, of all balls
    alive: int  # balls at the end, whose error counts
    bounces: int  # of the exact solution

    @property
    def best(self) -> Candidate | None:
        """The cheapest with steps whose error stays below the target."""
        return next((each for each in self.candidates if each.best), None)

    @property
    def closest(self) -> Candidate:
        """The one with the smallest error of all trials."""
        return min(self.candidates, key=lambda each: each.closest.error)

    def ns(self, seconds: float) -> float:
        """Seconds as ns per ball and simulated second."""
        return seconds * 1e9 / self.ball_seconds


def tune(
    experiment: Experiment,
    target: float,
    budget: float = BUDGET,
    methods: Sequence[str] | None = None,
    told: Callable[[str], None] = lambda text: None,
) -> Tuning:
    """Try the methods (all that know the contact rule) on the experiment's own values, whatever its matrix varies.

    The error (m) is that of `position_error_rms`: over the balls alive at the last frame. A trial takes `budget` s at most.
    `told` hears what is being done. Raises InputError for a target that is none and balls that start inside a surface, RunError
    where there is no exact solution to hold errors against.
    """
    if not LEAST <= target < math.inf:
        raise InputError(f"--error {target:g}: must be a length of {LEAST:g} m at least, to which the exact solution is known")
    if not 0 < budget < math.inf:
        raise InputError(f"--budget {budget:g}: must be a number of seconds > 0")
    checked = replace(experiment.base, setup=experiment.base.setup.model_copy(update={"reference": EXACT}))
    if faults := starts.faults([checked], experiment.document):
        raise InputError(*faults)
    told(EXACT)
    scene = _Scene(experiment, budget)
    known = integrators.names() if scene.contact == "swept" else integrators.fixed()
    candidates: list[Candidate] = []
    for method in sorted(methods or known, key=lambda name: (-integrators.load(name)[0].order, name)):
        told(method)
        cheapest = min((each.seconds for each in candidates), default=math.inf)
        candidates.append(scene.search(method, target, min(budget, max(UNNOTICED, DEARER * cheapest))))
    told("timing")
    exact, candidates = _contest(scene, candidates)
    truth = scene.truth
    return Tuning(
        target=target,
        candidates=tuple(sorted(candidates, key=lambda each: (not each.timing, each.seconds, each.closest.error))),
        exact=exact,
        duration=scene.duration,
        ball_seconds=truth.ball_seconds,
        alive=int(np.isfinite(truth.trajectory.position[-1, :, 0]).sum()),
        bounces=len(truth.bounces),
    )


class _Scene:
    """The scene with its balls, solved exactly, to try methods on. Only the first frame and the last are recorded."""

    def __init__(self, experiment: Experiment, budget: float):
        setup, folder = experiment.base.setup, experiment.base.folder
        self.duration, self.contact, self.budget = setup.duration, setup.solver.contact, budget
        self.scene, self.balls = setup.scene.build(folder), setup.balls.build(setup.duration, folder)
        try:
            self.exact = Simulation(self.scene, self.balls, Solver(EXACT), self.duration, self.duration)
            self.exact.warm()
            self.truth = self.exact.run(_deadline(budget))
        except (Invalid, Stalled) as error:
            raise RunError(f"no exact solution to hold errors against: {error}") from None
        if self.truth.status == "timeout":
            raise RunError(f"the exact solution takes more than {budget:g} s: --budget allows it more")
        if self.truth.status == "diverged":
            raise RunError(f"the exact solution diverges before {self.duration:g} s: there is none to hold errors against")
        if not np.isfinite(self.truth.trajectory.position[-1]).any():
            raise RunError(f"no ball is alive at the end, {self.duration:g} s: there is no error to measure")
        self.like = self.exact if self.contact == "swept" else None  # whose geometry serves all

    def simulation(self, method: str, setting: float) -> Simulation:
        """Ready to run, its kernel compiled."""
        solver = Solver(method, contact=self.contact, **{_knob(method): setting})
        made = Simulation(self.scene, self.balls, solver, self.duration, self.duration, self.like)
        self.like = self.like or made
        made.warm()
        return made

    def measure(self, method: str, setting: float) -> Trial:
        """One run, a short one a few times; what diverges, stalls or takes more than the budget has an infinite error."""
        simulation, taken = self.simulation(method, setting), []
        while len(taken) < FEWEST and sum(taken) < BRIEF:
            start = time.thread_time()
            try:
                flight, seconds = _timed(simulation, _deadline(self.budget))
            except Stalled:
                return Trial(setting, math.inf, time.thread_time() - start, "stalled")
            taken.append(seconds)
        whole = flight.status in ("finished", "rested")
        error = reference.position_errors(flight, self.truth).get("position_error_rms", math.inf) if whole else math.inf
        return Trial(setting, error, min(taken), flight.status)

    def search(self, method: str, target: float, budget: float) -> Candidate:
        """The method's coarsest setting, among those that should take at most `budget` s."""
        claims, flight = integrators.load(method)[0], min(self.duration, self.balls.lifetime)
        if claims.adaptive:  # the error goes with the tolerance; the steps are as its root of the order
            where = Ladder(ladder.rung_at(1e-4), ladder.rung_at(1e-3), ladder.rung_at(1e-15), 1.0, 1 / claims.order)
        else:
            where = Ladder(ladder.rung_at(flight / 20), ladder.rung_at(flight), ladder.rung_at(1e-15), claims.order, 1.0)
        found = ladder.search(lambda setting: self.measure(method, setting), where, target, budget)
        return Candidate(method, self.contact, _knob(method), where.order, found, found.best)


def _knob(method: str) -> str:
    return "tolerance" if integrators.load(method)[0].adaptive else "step"


def _deadline(seconds: float) -> Callable[[], bool]:
    end = time.monotonic() + seconds
    return lambda: time.monotonic() > end


def _contest(scene: _Scene, candidates: list[Candidate]) -> tuple[Timing, list[Candidate]]:
    """Time the cheapest candidates, and exact, against each other.

    A longer step may cost more, where it makes the search for a touch harder: so the guards take part, all but the last.
    """
    limit = RIVAL * min((each.seconds for each in candidates), default=math.inf)
    entries = [(each, trial) for each in candidates if each.seconds <= limit < math.inf for trial in _trusted(each.found)]
    exact, *timings = _time([scene.exact, *(scene.simulation(each.method, trial.setting) for each, trial in entries)])
    fastest: dict[str, tuple[Timing, Trial]] = {}
    for (each, trial), timing in zip(entries, timings):
        if each.method not in fastest or timing.seconds < fastest[each.method][0].seconds:
            fastest[each.method] = timing, trial
    for method, (timing, trial) in fastest.items():
        candidates = [replace(each, timing=timing, best=trial) if each.method == method else each for each in candidates]
    return exact, candidates


def _trusted(found: Found) -> list[Trial]:
    """The best, and its guards that have one themselves."""
    return [found.best, *found.guards[:-1]]


def _time(simulations: list[Simulation]) -> list[Timing]:
    """Run them in turn, again and again, so that whatever else the machine does strikes all alike."""
    rounds, begin = [], time.perf_counter()
    while len(rounds) < FEWEST or len(rounds) < MOST and time.perf_counter() - begin < ENOUGH:
        rounds.append([_seconds(simulation) for simulation in simulations])
    return [_timing(each) for each in zip(*rounds)]


def _timing(seconds: Sequence[float]) -> Timing:
    return Timing(min(seconds), max(min(seconds[k::3]) for k in range(3)) / min(seconds) - 1, len(seconds))


def _seconds(simulation: Simulation) -> float:
    return _timed(simulation)[1]


def _timed(simulation: Simulation, stop: Callable[[], bool] = lambda: False) -> tuple[Flight, float]:
    """The flight, and the seconds it took."""
    start = time.thread_time()
    flight = simulation.run(stop)
    return flight, time.thread_time() - start
