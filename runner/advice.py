"""What a tuning comes to, in plain words: which setting, how sure that is, and the line to paste."""

from __future__ import annotations

import math
from collections.abc import Iterator

from runner.ladder import Trial
from runner.tune import LEAST, Candidate, Timing, Tuning
from sim.simulate import EXACT

HEADINGS = ["method", "setting", "error (m)", "ns/ball-s", "met", "note"]
CLOSE = 0.03  # a difference in time that is none, relative, whatever the spread
SHOWN = 3  # ties that are told


def table(tuning: Tuning, every: bool = False) -> list[list[str]]:
    """A row for exact and for each method at its best, or else at its smallest error; or for `every` trial."""
    rows = [[EXACT, "", "0", f"{tuning.ns(tuning.exact.seconds):.0f}", "yes", ""]]
    for each in tuning.candidates:
        best = each.best or each.closest
        for trial in each.found.trials if every else [best]:
            seconds = each.seconds if trial is each.best else trial.seconds
            error = f"{trial.error:.2g}" if math.isfinite(trial.error) else trial.status
            met = "no" if trial.error >= tuning.target else "by luck" if _lucky(each, trial) else "yes"
            note = _note(each) if trial is best else ""
            rows.append([each.method, f"{each.knob} {trial.setting:g}", error, f"{tuning.ns(seconds):.0f}", met, note])
    return rows


def _lucky(each: Candidate, trial: Trial) -> bool:
    """Whether a trial below the target is coarser than one that is not, and so not to be trusted."""
    return each.found.best is None or trial.setting > each.found.best.setting


def _note(each: Candidate) -> str:
    """Why there is no best."""
    if each.best:
        return ""
    if each.stuck:
        return f"hardly falls down to {each.found.trials[-1].setting:g}"
    setting, seconds = each.found.needed
    if math.isinf(seconds):
        return "no finer one is left"
    return f"{setting:g} may do, in {seconds:.2g} s"


def solver(each: Candidate) -> str:
    """The line of an experiment file."""
    return f"solver: {{method: {each.method}, {each.knob}: {each.best.setting:g}, contact: {each.contact}}}"


def lines(tuning: Tuning) -> Iterator[str]:
    """The verdict: what to take and how sure that is."""
    best, exact, exact_line = tuning.best, tuning.exact, f"solver: {{method: {EXACT}}}"
    yield f"errors are over {tuning.alive} balls at {tuning.duration:g} s, after {tuning.bounces} bounces"
    if best is None:
        yield f"no method with steps is known to stay below {tuning.target:g} m"
        each, trial = tuning.closest, tuning.closest.closest
        luck = ", by luck: a finer one is not below" if trial.error < tuning.target else ""
        yield f"the best found: {each.method} with {each.knob} {trial.setting:g}, {trial.error:.2g} m{luck}"
        yield f"{EXACT} has no such error and takes {tuning.ns(exact.seconds):.0f} ns/ball-s:"
        yield exact_line
        return
    times = best.seconds / exact.seconds
    if times > 1 or _tie(best.timing, exact):
        yield f"take {EXACT}: it has no such error, and nothing with steps that stays below {tuning.target:g} m is cheaper:"
        yield exact_line
        yield f"the cheapest with steps is {best.method}, {_times(times)} the cost{_tied(best.timing, exact)}:"
    else:
        yield f"take {best.method}, the cheapest below {tuning.target:g} m; {EXACT} is {_times(1 / times)} the cost:"
    yield solver(best)
    yield from _sureness(tuning, best)


def _sureness(tuning: Tuning, best: Candidate) -> Iterator[str]:
    margin, timing = tuning.target / max(best.best.error, LEAST), best.timing
    less = f", {_times(margin)} below" if best.best.error > LEAST else ", as good as rounding allows"
    yield f"error: {best.best.error:.2g} m{less}" + ("; balls that start otherwise may be above" if margin < 2 else "")
    finer = ", ".join(f"{each.error:.2g} m at {each.setting:g}" for each in best.finer)
    yield f"finer {best.knob}s: " + (finer or "none tried, they would have taken longer than --budget allows")
    if best.measured is not None:
        what = "order" if best.knob == "step" else "power of the tolerance"
        yield f"{what}: {best.measured:.1f} measured there, {best.order:g} expected"
    if best.flat and best.erratic:
        yield f"the {best.knob} makes no difference there: events, as bounces, cut the steps shorter than it does"
    elif best.erratic:
        yield f"warning: the error does not fall with the {best.knob} as it should: chaos, or balls that just hit or miss"
    yield f"timing: the fastest of {timing.repeats}; of a third of them alone up to {timing.spread:.0%} slower"
    others = [each for each in tuning.candidates if each is not best and each.best]
    ties = [solver(each).removeprefix("solver: ") for each in others if each.timing and _tie(timing, each.timing)]
    if ties:
        more = f" and {len(ties) - SHOWN} more" if len(ties) > SHOWN else ""
        yield f"as fast, within the spread of the timing: {'; '.join(ties[:SHOWN])}{more}"
    elif others:
        yield f"next: {others[0].method}, {_times(others[0].seconds / best.seconds)} the cost"


def _tie(one: Timing, other: Timing) -> bool:
    """Whether the spread of either covers the difference."""
    slow, fast = max(one.seconds, other.seconds), min(one.seconds, other.seconds)
    return slow <= fast * (1 + max(one.spread, other.spread, CLOSE))


def _tied(one: Timing, other: Timing) -> str:
    return ", a tie within the spread of the timing" if _tie(one, other) else ""


def _times(ratio: float) -> str:
    digits = 2 if ratio < 2 else 1
    return f"{ratio:.{digits}f} times" if ratio < 10 else f"{ratio:.0f} times" if ratio < 1000 else f"{ratio:.0e} times"
