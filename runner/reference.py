"""`reference: exact`: how far a run ends from the exact solution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from runner.config import Run
from sim.simulate import EXACT, Crew, Flight, Simulation, Solver


def twin(run: Run) -> Run:
    """The run that solves the same exactly."""
    solver = run.setup.solver.model_copy(update={"method": EXACT, "contact": "swept"})
    return replace(run, setup=run.setup.model_copy(update={"solver": solver, "reference": None}))


def solve(simulation: Simulation, flight: Flight, stop: Callable[[], bool], crew: Crew = Crew()) -> Flight:
    """The exact flight of the simulation's balls up to the last frame of `flight`."""
    end = flight.trajectory.time[-1]
    if end == 0 or simulation.solver.method == EXACT:
        return flight
    return Simulation(simulation.scene, simulation.balls, Solver(EXACT), end, end, simulation).run(stop, crew)


def position_errors(flight: Flight, truth: Flight) -> dict[str, float]:
    """How far (m) the balls alive at the last frame of `flight` are from where they are in `truth`; nothing if it ends before."""
    ours, theirs = flight.trajectory, truth.trajectory
    error = np.linalg.norm(ours.position[-1] - theirs.position[-1], axis=1)
    error = error[~np.isnan(error)]
    if theirs.time[-1] != ours.time[-1] or len(error) == 0:
        return {}
    with np.errstate(over="ignore"):  # of what is about to diverge
        rms = np.sqrt(np.mean(error**2))
    return {"position_error_rms": float(rms), "position_error_max": float(np.max(error))}
