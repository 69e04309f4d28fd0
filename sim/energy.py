"""The energy ledger: what a flight has, against what was put in and taken out."""

from __future__ import annotations

import numpy as np

from sim.model import Energy


def ledger(time, released, kinetic, potential, at_release, at_end, work, lost) -> Energy:
    """The ledger at each frame.

    time (frames,) s; released (n,) s; kinetic, potential (frames, n) J, NaN where a ball is not alive; at_release, at_end (n,) J,
    kinetic plus potential when its flight begins and ends; work, lost (frames, n) J since the release.
    """
    alive = np.isfinite(kinetic)
    ended = (time[:, None] >= released) & ~alive

    def total(values, where):
        return np.sum(np.where(where, values, 0.0), axis=1)

    supplied = total(at_release, alive | ended) - total(at_end, ended)
    kinetic, potential, work, lost = total(kinetic, alive), total(potential, alive), work.sum(axis=1), lost.sum(axis=1)
    return Energy(kinetic, potential, work, lost, supplied, kinetic + potential - supplied - work + lost)


def total_energy(mass: float, velocity: np.ndarray, potential: np.ndarray) -> np.ndarray:
    """m/2 v^2 + potential in J, for velocity (..., 3) m/s and potential (...) J."""
    x, y, z = velocity[..., 0], velocity[..., 1], velocity[..., 2]  # numpy sums three numbers of each row three times as slowly
    return 0.5 * mass * (x**2 + y**2 + z**2) + potential
