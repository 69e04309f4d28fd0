"""What a run's cost is: the least time of the processor over its repeats."""

import time
from types import SimpleNamespace

import pytest

from runner import execute
from sim.simulate import Crew


@pytest.fixture
def flights(monkeypatch):
    """A simulation whose runs take the given seconds of the processor, one after the other, the last of them for ever."""

    def simulation(*seconds, status="finished"):
        clock, made = SimpleNamespace(now=0.0), []

        def run(stop, crew):
            clock.now += seconds[min(len(made), len(seconds) - 1)]
            made.append(SimpleNamespace(status=status))
            return made[-1]

        monkeypatch.setattr(execute.time, "thread_time", lambda: clock.now)
        return SimpleNamespace(run=run, made=made)

    return simulation


@pytest.mark.parametrize(
    "repeats, seconds, runs, least",
    [
        (1, [1e-3], 1, 1e-3),  # nobody asked for more
        (3, [0.5, 0.4, 0.6], 3, 0.4),
        (2, [0.01, 0.02, 0.005, 0.1], 6, 0.005),  # 0.235 s after five: not yet 0.25
        (30, [0.1], 30, 0.1),
    ],
)
def test_the_fastest_counts_and_short_flights_are_made_more_often(flights, repeats, seconds, runs, least):
    simulation = flights(*seconds)
    flight, taken = execute.timed(simulation, repeats, lambda: False)
    assert flight is simulation.made[-1] and len(simulation.made) == runs
    assert taken == pytest.approx(least, rel=1e-9)  # a difference of clock readings of some s


def test_a_flight_that_was_stopped_is_not_repeated(flights):
    simulation = flights(0.01, status="timeout")
    execute.timed(simulation, 5, lambda: True)
    assert len(simulation.made) == 1


def test_what_others_do_meanwhile_costs_nothing():
    waiting = SimpleNamespace(run=lambda stop, crew: time.sleep(0.2) or SimpleNamespace(status="finished"))
    assert execute.timed(waiting, 1, lambda: False)[1] < 0.1


def test_of_several_threads_the_clock_counts():
    """Each has a processor, and the one that waits for them takes none."""
    waiting = SimpleNamespace(run=lambda stop, crew: time.sleep(0.1) or SimpleNamespace(status="finished"))
    assert execute.timed(waiting, 1, lambda: False, Crew(2))[1] >= 0.1
