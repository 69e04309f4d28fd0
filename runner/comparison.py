"""Two outputs side by side: the same runs, made by another version or on another machine."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from runner import config, store
from runner.columns import TIMED
from runner.errors import InputError, one_line
from runner.record import hdf5

UNITS = {"position": "m", "velocity": "m/s"}


class Difference(NamedTuple):
    """Of one run, in one thing."""

    name: str  # a column of the summary, position or velocity
    told: str
    size: float = 0.0  # relative of a column's, else m or m/s; 0 where it is none that can be measured


def differences(a: Path, b: Path, rtol: float) -> Iterator[str]:
    """A line for each run that differs, then for each that one folder holds alone, then the sum of it; none without a difference.

    Runs are the same when their parameters are, whatever their ids. Figures may differ by `rtol` of the larger, places and
    velocities by `rtol` of the largest number among them; with 0 they must be equal. Raises InputError when a folder holds no
    runs, Damaged when it holds one that cannot be read.
    """
    ours, theirs = _runs(a), _runs(b)
    _meet(ours, theirs, a, b)
    both, trajectories = ours.keys() & theirs.keys(), [store.holding(folder, hdf5.FILE) for folder in (a, b)]
    differing, largest = 0, {}
    for key in sorted(both, key=lambda key: ours[key]["run_id"]):
        x, y = ours[key], theirs[key]
        places = [(held.get(run["run_id"]), run["run_id"]) for held, run in zip(trajectories, (x, y))]
        found = [*_figures(x, y, rtol), *(_trajectories(*places, rtol) if all(place for place, _ in places) else ())]
        if found:
            differing += 1
            yield f"{x['run_id']}: " + "; ".join(each.told for each in found)
        for each in found:
            largest[each.name] = max(largest.get(each.name, (0.0, "")), (each.size, x["run_id"]))
    alone = {folder: _only(mine, other) for folder, mine, other in ((a, ours, theirs), (b, theirs, ours))}
    for folder, run_ids in alone.items():
        yield from (f"{run_id}: only in {folder}" for run_id in run_ids)
    if differing or any(alone.values()):
        told = [f"{differing} of {len(both)} runs differ"]
        told += [f"{len(run_ids)} only in {folder}" for folder, run_ids in alone.items() if run_ids]
        told += [f"{name} by up to {_size(name, size)} in {run_id}" for name, (size, run_id) in largest.items() if size]
        yield "; ".join(told)


def _runs(folder: Path) -> dict[str, dict[str, Any]]:
    """The folder's runs by their parameters as text."""
    runs = {json.dumps(report["parameters"], sort_keys=True): report for report in store.read_runs(folder)}
    if not runs:
        raise InputError(f"{folder}: holds no runs")
    return runs


def _meet(ours: dict[str, Any], theirs: dict[str, Any], a: Path, b: Path) -> None:
    """Give runs without a partner the parameters that this version makes of theirs: another may have had fewer settings."""
    for mine, others, folder in ((ours, theirs, a), (theirs, ours, b)):
        source = Path(store.provenance(folder).get("source", ""))
        for key in mine.keys() - others.keys():
            try:
                resolved = config.resolve(mine[key]["parameters"], source).parameters
            except ValueError:  # a setting that is no more, or a mesh that is not there
                continue
            mine[json.dumps(resolved, sort_keys=True)] = mine.pop(key)


def _only(mine: dict[str, Any], others: dict[str, Any]) -> list[str]:
    return sorted(mine[key]["run_id"] for key in mine.keys() - others.keys())


def _size(name: str, size: float) -> str:
    return f"{size:.3g} {UNITS[name]}" if name in UNITS else f"{size:.3g} (relative)"


def _figures(ours: dict, theirs: dict, rtol: float) -> Iterator[Difference]:
    if ours["status"] != theirs["status"]:
        yield Difference("status", f"status {ours['status']} and {theirs['status']}")
    for name in dict.fromkeys([*ours["figures"], *theirs["figures"]]):
        x, y = ours["figures"].get(name), theirs["figures"].get(name)
        if name in TIMED or x == y:
            continue
        if not all(isinstance(value, (int, float)) for value in (x, y)):
            yield Difference(name, one_line(f"{name} {x} and {y}"))
        elif (size := abs(x - y) / max(abs(x), abs(y))) > rtol:
            yield Difference(name, f"{name} {x} and {y} (relative {size:.2g})", size)


def _trajectories(ours: tuple[Path, str], theirs: tuple[Path, str], rtol: float) -> Iterator[Difference]:
    """Where the recorded trajectories differ; each is told by the entry that it lies in and its run."""
    both = [hdf5.read(*run, *(f"particles/balls/{name}" for name in UNITS)) for run in (ours, theirs)]
    for (name, unit), (time, x), (_, y) in zip(UNITS.items(), *both):
        if x.shape != y.shape:
            yield Difference(name, f"{name} of shape {x.shape} and {y.shape}")
            continue
        if (np.isnan(x) != np.isnan(y)).any():
            yield Difference(name, f"{name}: other balls are alive")
            continue
        size = np.linalg.norm(np.nan_to_num(x - y), axis=-1)
        beyond = size > rtol * np.nanmax(np.abs(x), initial=0.0)
        if beyond.any():
            since = time[np.flatnonzero(beyond.any(axis=1))[0]]
            told = f"{name} differs by up to {size.max():.3g} {unit}, of {beyond.any(axis=0).sum()} balls, from {since:g} s on"
            yield Difference(name, told, float(size.max()))
