"""What one run gives back; the recorders write it, the aggregator reads what they wrote."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.model import Balls, Energy, Mesh, Trajectory

#: Statuses of a run that came to no result of its own; a diverged run did.
FAILURES = ("failed", "crashed", "timeout")


@dataclass(frozen=True)
class Result:
    """One run, finished or stopped: what was simulated, what came out."""

    run_id: str
    parameters: dict[str, Any]  # the resolved configuration, as JSON would hold it
    status: str  # finished, rested, diverged, timeout
    balls: Balls
    trajectory: Trajectory
    bounces: np.ndarray  # structured, sim.model.BOUNCE, in order of time
    rests: np.ndarray  # structured, sim.model.REST, in order of time
    energy: Energy
    surfaces: dict[str, Mesh]  # name -> triangles to look at, in the order that bounces["surface"] counts
    summary: dict[str, Any]  # the run's row of the summary, without the matrix columns
