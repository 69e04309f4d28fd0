"""One run, from its setup to its result; nothing is written."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from runner import reference, starts
from runner.columns import FIGURES
from runner.config import Experiment, Run
from runner.crew import crew
from runner.errors import InputError
from runner.result import Result
from sim.model import Mesh
from sim.simulate import Crew, Flight, Simulation

SPREAD = 0.25  # s, over which the repeats of a short flight are spread


def prepare(run: Run, like: Simulation | None = None) -> Simulation:
    """The run's simulation, its kernel compiled or loaded; both are taken from `like`, prepared before, where that has the same.

    Raises sim.model.Invalid when it cannot be built.
    """
    setup = run.setup
    scene, solver = setup.scene.build(run.folder), setup.solver.build(run.folder)
    balls = setup.balls.build(setup.duration, run.folder)
    simulation = Simulation(scene, balls, solver, setup.duration, setup.record.every, like)
    if like is None or simulation.engine.kernel is not like.engine.kernel:
        simulation.warm()
    return simulation


def run(what: Run | Experiment, stop: Callable[[], bool] = lambda: False) -> Result:
    """Simulate one run; of an experiment that of the file's own values. `stop` is asked now and then whether to give up.

    Raises InputError, for a Run sim.model.Invalid, where a ball starts inside a surface.
    """
    one = what
    if isinstance(what, Experiment):
        one = what.base
        if faults := starts.faults([one], what.document):
            raise InputError(*faults)
    return carry_out(one, prepare(one), stop)


def carry_out(one: Run, simulation: Simulation, stop: Callable[[], bool]) -> Result:
    """Simulate the run, whose simulation is prepared."""
    with crew(one.setup.solver.threads) as hands:
        flight, seconds = timed(simulation, one.setup.repeats, stop, hands)
        status, summary = flight.status, figures(simulation, flight, seconds)
        if one.setup.reference and status != "timeout":
            truth = reference.solve(simulation, flight, stop, hands)
            status = "timeout" if truth.status == "timeout" else status
            summary |= {name: _plain(value) for name, value in reference.position_errors(flight, truth).items()}
    return Result(
        run_id=one.run_id,
        parameters=one.parameters,
        status=status,
        balls=simulation.balls,
        trajectory=flight.trajectory,
        bounces=flight.bounces,
        rests=flight.rests,
        energy=flight.energy,
        surfaces={name: _mesh(shape) for name, shape in simulation.scene.surfaces.items()},
        summary=summary,
    )


@lru_cache(maxsize=8)  # most runs of a sweep have the same
def _mesh(shape: Any) -> Mesh:
    return shape.mesh()


def timed(simulation: Simulation, repeats: int, stop: Callable[[], bool], hands: Crew = Crew()) -> tuple[Flight, float]:
    """The flight and the least seconds of the processor that it took, whatever else the machine did meanwhile; with several
    threads those of the clock, as they are at it at the same time.

    What is repeated at all is so until SPREAD s are spent: a disturbance, as of memory and caches that others use too, may
    outlast a few repeats of a short flight.
    """
    taken, clock = [], time.thread_time if hands.size == 1 else time.perf_counter
    while len(taken) < repeats or 1 < len(taken) and sum(taken) < SPREAD:
        start = clock()
        flight = simulation.run(stop, hands)
        taken.append(clock() - start)
        if flight.status == "timeout":
            break
    return flight, min(taken)


def figures(simulation: Simulation, flight: Flight, seconds: float) -> dict[str, Any]:
    """The run's figures by column of the summary; None where there is nothing to tell."""
    energy, bounces = flight.energy, flight.bounces
    path = flight.trajectory
    position, velocity = (np.ascontiguousarray(each.reshape(-1, 3).T) for each in (path.position, path.velocity))
    with np.errstate(all="ignore"):
        residual = energy.residual[-1]
        scale = max(abs(flight.energy_initial), energy.kinetic.max())
        extent = {  # fmin and fmax pass over NaN, where a ball is not alive
            f"{axis}_{name}": reduce(values)
            for axis, values in zip("xyz", position)
            for name, reduce in (("min", np.fmin.reduce), ("max", np.fmax.reduce))
        }
        speed = np.sqrt(np.fmax.reduce(velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2))
    values = {
        "method": simulation.solver.method,
        "contact": simulation.solver.contact,
        "step": simulation.solver.step if simulation.solver.stepping else None,
        "balls": len(simulation.balls),
        "steps": flight.steps,
        "bounces": len(bounces),
        "bounces_per_ball_max": np.bincount(bounces["ball"], minlength=1).max(),
        "surfaces_hit": np.count_nonzero(np.bincount(bounces["surface"])),
        "rest_count": flight.resting,
        "penetrations": flight.penetrations,
        "energy_initial": flight.energy_initial,
        "energy_final": flight.energy_final,
        "energy_lost": energy.lost[-1],
        "work": energy.work[-1],
        "energy_residual": residual,
        "energy_residual_rel": abs(residual) / scale if scale > 0 else abs(residual),
        **extent,
        "speed_max": speed,
        "sim_seconds": seconds,
        "ball_steps_per_second": flight.steps / seconds,
        "ns_per_ball_second": seconds * 1e9 / flight.ball_seconds if flight.ball_seconds > 0 else None,
    }
    return {name: _plain(values.get(name)) for name in FIGURES}


def _plain(value: Any) -> Any:
    """A number as JSON can hold it; None for one that is not finite."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
