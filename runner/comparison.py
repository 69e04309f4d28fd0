"""Two outputs side by side: the same runs, made by another version or on another machine."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from runner import record, store
from runner.columns import TIMED
from runner.errors import InputError


def differences(a: Path, b: Path, rtol: float) -> Iterator[str]:
    """A line for each run that differs, or that one folder holds alone.

    Runs are the same when their parameters are, whatever their ids. Figures may differ by `rtol` of the larger, a trajectory by
    `rtol` of its largest number; with 0 they must be equal. Raises InputError when a folder holds no runs.
    """
    ours, theirs = _runs(a), _runs(b)
    for key in sorted(ours.keys() | theirs.keys()):
        if key not in theirs or key not in ours:
            only, report = (a, ours[key]) if key in ours else (b, theirs[key])
            yield f"{report['run_id']}: only in {only}"
            continue
        found = [*_figures(ours[key], theirs[key], rtol), *_trajectories(a, ours[key], b, theirs[key], rtol)]
        if found:
            yield f"{ours[key]['run_id']}: " + "; ".join(found)


def _runs(folder: Path) -> dict[str, dict[str, Any]]:
    """The folder's runs by their parameters as text."""
    reports = list(store.read_runs(folder))
    if not reports:
        raise InputError(f"{folder}: holds no runs")
    return {json.dumps(report["parameters"], sort_keys=True): report for report in reports}


def _figures(ours: dict, theirs: dict, rtol: float) -> Iterator[str]:
    if ours["status"] != theirs["status"]:
        yield f"status {ours['status']} and {theirs['status']}"
    for name in dict.fromkeys([*ours["figures"], *theirs["figures"]]):
        x, y = ours["figures"].get(name), theirs["figures"].get(name)
        if name not in TIMED and x != y and not _near(x, y, rtol):
            yield f"{name} {x} and {y}"


def _near(x: Any, y: Any, rtol: float) -> bool:
    return all(isinstance(v, (int, float)) for v in (x, y)) and abs(x - y) <= rtol * max(abs(x), abs(y))


def _trajectories(a: Path, ours: dict, b: Path, theirs: dict, rtol: float) -> Iterator[str]:
    """Where the recorded trajectories differ; nothing when one of the runs recorded none."""
    import h5py

    paths = [store.run_folder(folder, run["run_id"]) / record.load("hdf5").FILE for folder, run in ((a, ours), (b, theirs))]
    if not all(path.exists() for path in paths):
        return
    with h5py.File(paths[0]) as one, h5py.File(paths[1]) as other:
        for name in ("position", "velocity"):
            x, y = (file[f"particles/balls/{name}/value"][:] for file in (one, other))
            if x.shape != y.shape:
                yield f"{name} of shape {x.shape} and {y.shape}"
            elif not np.allclose(x, y, rtol=0, atol=rtol * np.nanmax(np.abs(x), initial=0.0), equal_nan=True):
                yield f"{name} differs by up to {np.nanmax(np.abs(x - y)):.3g}"
