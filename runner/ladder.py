"""The coarsest setting whose error stays below a target, searched for on a ladder: 1, 0.5, 0.2, 0.1, ... from coarse to fine."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

GUARDS = 2  # next finer rungs that must stay below the target too: one small error alone may be luck
RUNGS = 3  # a decade
CLOSER = 0.1  # of the budget: a trial that costs as much before a search is given up


class Trial(NamedTuple):
    """One setting, tried."""

    setting: float  # a step in s, or a tolerance
    error: float  # m; infinite where the trial came to no end
    seconds: float  # that it took
    status: str = "finished"


class Ladder(NamedTuple):
    """Where to search, and what a method claims: that its error falls as setting**order, its cost grows as setting**-work."""

    start: int  # rungs, the coarsest the smallest
    coarsest: int
    finest: int
    order: float
    work: float


class Found(NamedTuple):
    """What a search came to."""

    trials: tuple[Trial, ...]  # from coarse to fine
    best: Trial | None  # the coarsest below the target whose guards are below it, too
    guards: tuple[Trial, ...] = ()  # the next finer ones; fewer than GUARDS where they would have cost too much
    needed: tuple[float, float] | None = None  # the setting that the search did not go on to, and the seconds it would take


def setting(rung: int) -> float:
    """1, 0.5, 0.2, 0.1, ... for 0, 1, 2, 3, ..."""
    decade, place = divmod(rung, RUNGS)
    return float(f"{(10, 5, 2)[place]}e{-decade - 1}")


def rung_at(limit: float) -> int:
    """The coarsest rung that is not above `limit`."""
    rung = math.floor(-RUNGS * math.log10(limit)) - 1
    while setting(rung) > limit:
        rung += 1
    return rung


def search(measure: Callable[[float], Trial], ladder: Ladder, target: float, budget: float) -> Found:
    """Try settings until the coarsest is found whose error is below `target`, or none that should take at most `budget` s can be.

    `budget` must be finite. It leaps by the order that is claimed or measured, whichever is higher, and so rather too short than
    too far; then it goes back, rung by rung, to the last before one that is not below. It looks closer before it gives up: at a
    coarse step much of the cost is not of steps, so what a fine one costs is overestimated.
    """
    tried: dict[int, Trial] = {}

    def met(rung: int) -> bool:
        if rung not in tried:
            tried[rung] = measure(setting(rung))
        return tried[rung].error < target

    def cost(rung: int, known: int) -> float:
        """The seconds to expect, from those of a rung that is known."""
        if rung > ladder.finest:
            return math.inf
        return tried[known].seconds * (setting(known) / setting(rung)) ** ladder.work

    def unmet(rung: int) -> int | None:
        """The first of the rung and its guards that is not below the target."""
        for each in range(rung, rung + GUARDS + 1):
            if each > rung and cost(each, each - 1) > budget:
                break
            if not met(each):
                return each
        return None

    def found(best: int | None, needed: tuple[float, float] | None = None) -> Found:
        guards = () if best is None else tuple(tried[best + k] for k in range(1, GUARDS + 1) if best + k in tried)
        return Found(tuple(tried[rung] for rung in sorted(tried)), tried.get(best), guards, needed)

    rung = ladder.start
    while (failed := unmet(rung)) is not None:
        rung = _finer(tried, failed, ladder.order, target)
        if cost(rung, failed) > budget:
            closer = failed
            while cost(closer + 1, failed) <= CLOSER * budget:
                closer += 1
            if closer == failed:
                return found(None, (setting(rung), cost(rung, failed)))
            rung = closer
    while rung > ladder.coarsest and met(rung - 1):
        rung -= 1
    return found(rung)


def _finer(tried: dict[int, Trial], failed: int, order: float, target: float) -> int:
    """The rung to try after `failed`: two further on until two errors are known, then where their order leads."""
    here = tried[failed]
    before = [trial for rung, trial in sorted(tried.items()) if rung < failed and math.isfinite(trial.error)]
    if not before or not math.isfinite(here.error):
        return failed + 2
    coarser = before[-1]
    measured = math.log(coarser.error / here.error) / math.log(coarser.setting / here.setting) if coarser.error else 0.0
    aim = here.setting * (target / here.error) ** (1 / max(order, measured))
    return max(failed + 1, rung_at(aim))
