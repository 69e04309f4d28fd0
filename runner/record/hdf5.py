"""trajectory.h5: everything a run computed, in the layout of H5MD 1.1 (nongnu.org/h5md/h5md.html).

The same run gives the same bytes: nothing here depends on the time, the user or the machine. Nothing is compressed,
since gzip would cost thirty times the write and save a fifth of the bytes. A unit stands in an attribute `units`: where
H5MD's own `unit` is present MDAnalysis wants to convert it, and stops on metres.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from runner import store
from runner.errors import Damaged
from runner.result import Result

if TYPE_CHECKING:
    import h5py

FILE, PACKED = "trajectory.h5", "trajectories.h5"

UNITS = {
    "time": "s",
    "ball": "index into /particles/balls",
    "surface": "index into the attribute surfaces",
    "position": "m",
    "normal": "1",
    "speed_normal": "m/s",
    "speed_tangential": "m/s",
    "energy_lost": "J",
}


def write(result: Result, path: Path) -> None:
    """Write `result` to the new file `path`.

    Raises OSError where the file cannot be written.
    """
    import h5py

    with h5py.File(path, "w", libver=("v110", "v110")) as file:
        _write_header(file)
        frames = _write_balls(file, result)
        _write_energy(file, result, frames)
        _write_events(file, result)
        _write_parameters(file, result)


def join(files: dict[str, Path], path: Path) -> None:
    """Write what the runs' `files` hold to the new file `path`, each run's in a group named by its id."""
    import h5py

    with h5py.File(path, "w", libver=("v110", "v110")) as packed:
        for run_id, file in files.items():
            with h5py.File(file) as one:
                packed.copy(one["/"], packed, name=run_id)


@contextmanager
def read(entry: Path, run_id: str) -> Iterator[h5py.Group]:
    """What the run's file holds, in a folder of its own or packed. Raises Damaged where it cannot be read."""
    import h5py

    packed = store.pack_number(entry)
    path = entry / (PACKED if packed else FILE)
    try:
        with h5py.File(path) as file:
            yield file[run_id] if packed else file
    except FileNotFoundError:
        raise Damaged(path, "missing") from None
    except (OSError, KeyError, RuntimeError) as error:
        raise Damaged(path, f"cannot be read: {error}".replace("\n", " ")) from None


def _write_header(file: h5py.File) -> None:
    header = file.create_group("h5md")
    header.attrs["version"] = np.array([1, 1], "i4")
    header.create_group("author").attrs["name"] = "carom"
    creator = header.create_group("creator")
    creator.attrs["name"] = "carom"
    creator.attrs["version"] = _versions()["carom"]


def _write_balls(file: h5py.File, result: Result) -> h5py.Group:
    """/particles/balls; the element whose `step` and `time` all others share."""
    balls, trajectory = result.balls, result.trajectory
    group = file.create_group("particles/balls")
    box = group.create_group("box")
    box.attrs["dimension"] = 3
    box.attrs["boundary"] = np.array([b"none"] * 3)

    frames = group.create_group("position")
    _write_dataset(frames, "step", trajectory.step.astype("i8"))
    _write_dataset(frames, "time", trajectory.time, "s")
    _write_dataset(frames, "value", trajectory.position, "m")
    _write_element(group, "velocity", frames, trajectory.velocity, "m/s")

    _write_dataset(group, "id", np.arange(len(balls)))
    _write_dataset(group, "mass", np.full(len(balls), balls.mass), "kg")
    _write_dataset(group, "radius", np.full(len(balls), balls.radius), "m")
    return frames


def _write_energy(file: h5py.File, result: Result, frames: h5py.Group) -> None:
    energy, observables = result.energy, file.create_group("observables")
    _write_element(observables, "kinetic_energy", frames, energy.kinetic, "J")
    _write_element(observables, "potential_energy", frames, energy.potential, "J")
    _write_element(observables, "work", frames, energy.work, "J")
    _write_element(observables, "energy_lost", frames, energy.lost, "J")
    _write_element(observables, "energy_supplied", frames, energy.supplied, "J")
    _write_element(observables, "energy_residual", frames, energy.residual, "J")


def _write_element(parent: h5py.Group, name: str, frames: h5py.Group, values: np.ndarray, units: str) -> None:
    """What changes with time, one value a frame; `step` and `time` are hard links, as H5MD allows."""
    group = parent.create_group(name)
    group["step"], group["time"] = frames["step"], frames["time"]
    _write_dataset(group, "value", values, units)


def _write_dataset(parent: h5py.Group, name: str, values: np.ndarray, units: str | None = None) -> None:
    dataset = parent.create_dataset(name, data=values)
    if units:
        dataset.attrs["units"] = units


def _write_events(file: h5py.File, result: Result) -> None:
    """/events: impacts, and where balls came to rest."""
    import h5py

    for name, events, description in (
        ("bounces", result.bounces, "Impacts in order of time: position is the ball's centre, normal points to the ball, "
         "speeds are before it."),
        ("rests", result.rests, "In order of time: a ball comes to rest on a surface, or begins to slide on it."),
    ):  # fmt: skip
        dataset = file.create_dataset(f"events/{name}", data=events)
        dataset.attrs["description"] = description
        dataset.attrs["units"] = json.dumps({column: UNITS[column] for column in events.dtype.names})
        dataset.attrs.create("surfaces", list(result.surfaces), dtype=h5py.string_dtype())


def _write_parameters(file: h5py.File, result: Result) -> None:
    group = file.create_group("parameters")
    group["run_id"] = result.run_id
    group["configuration"] = json.dumps(result.parameters, sort_keys=True)
    group["versions"] = json.dumps(_versions())


@cache
def _versions() -> dict[str, str]:
    """Of what computed and wrote the numbers."""

    def installed(name: str) -> str:
        try:
            return version(name)
        except PackageNotFoundError:  # run from a checkout
            return "unknown"

    return {name: installed(name) for name in ("carom", "numpy", "numba", "h5py")}
