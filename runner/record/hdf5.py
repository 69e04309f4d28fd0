"""trajectory.h5: everything a run computed, in the layout of H5MD 1.1 (nongnu.org/h5md/h5md.html).

The same run gives the same bytes: nothing here depends on the time, the user or the machine. Nothing is compressed,
since gzip would cost thirty times the write and save a fifth of the bytes. A unit stands in an attribute `units`: where
H5MD's own `unit` is present MDAnalysis wants to convert it, and stops on metres.
"""

from __future__ import annotations

import json
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from runner import store
from runner.disk import Disk
from runner.errors import Damaged, one_line
from runner.result import Result

if TYPE_CHECKING:
    import h5py

FILE, PACKED = "trajectory.h5", "trajectories.h5"
VERSION = ("v110", "v110")  # of the format
SMALL = 4_000_000  # bytes of numbers in a file that is put together in memory
TEXT = 64  # bytes that a text takes, or a multiple

UNITS = {
    "time": "s",
    "ball": "index into /particles/balls",
    "surface": "index into the attribute surfaces",
    "position": "m",
    "velocity": "m/s",
    "mass": "kg",
    "radius": "m",
    "normal": "1",
    "speed_normal": "m/s",
    "speed_tangential": "m/s",
    **dict.fromkeys(("kinetic_energy", "potential_energy", "work", "energy_lost", "energy_supplied", "energy_residual"), "J"),
}

EVENTS = {
    "events/bounces": "Impacts in order of time: position is the ball's centre, normal points to the ball, speeds are before it.",
    "events/rests": "In order of time: a ball comes to rest on a surface, or begins to slide on it.",
}

Numbers = dict[str, np.ndarray]  # by their place in the file
Layout = tuple[tuple[str, tuple[int, ...], np.dtype], ...]  # place, shape and type of numbers
FRAMES = "particles/balls/position"  # the element whose step and time all others share


def write(result: Result, path: Path) -> None:
    """Write `result` to the new file `path`.

    Most of a small file's cost is making its objects, not its bytes. So what files have alike that hold as many numbers in
    each place is made once, and what is written of a run is its numbers, in between.

    Raises OSError where the file cannot be written.
    """
    import h5py

    often, own, surfaces = _frames(result), _own(result), tuple(result.surfaces)
    if sum(values.nbytes for values in (often | own).values()) > SMALL:
        with Disk(path) as disk, h5py.File(disk, "w", libver=VERSION) as file:
            _write_frames(file, often)
            _write_own(file.id, own, surfaces)
        return
    numbers = often | own
    between, places = _skeleton(_layout(often), _layout(own), surfaces)
    pieces = [np.ascontiguousarray(numbers[place]) for place in places]
    path.write_bytes(b"".join(chain(*zip(between, pieces), between[-1:])))


def join(files: dict[str, Path], path: Path) -> None:
    """Write what the runs' `files` hold to the new file `path`, each run's in a group named by its id."""
    import h5py

    with Disk(path) as disk, h5py.File(disk, "w", libver=VERSION) as packed:
        for run_id, file in files.items():
            with h5py.File(file) as one:
                packed.copy(one["/"], packed, name=run_id)


def read(entry: Path, run_id: str, *elements: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Time (frames,) and value (frames, ...) of each of the `elements` of the run's file, in a folder of its own or packed.

    Raises Damaged where the file cannot be read, or holds something else there.
    """
    import h5py

    packed = store.pack_number(entry)
    path = entry / (PACKED if packed else FILE)
    try:
        with h5py.File(path) as file:
            tree = file[run_id] if packed else file
            found = [
                tuple(np.array(tree[f"{element}/{name}"], dtype=float) for name in ("time", "value")) for element in elements
            ]
    except FileNotFoundError:
        raise Damaged(path, "missing") from None
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        raise Damaged(path, one_line(f"cannot be read: {error}")) from None
    for element, (time, value) in zip(elements, found):
        if time.ndim != 1 or value.shape[:1] != time.shape:
            raise Damaged(path, f"holds no times with a value each at {element}")
    return found


def _frames(result: Result) -> Numbers:
    """All that there is a number of for each ball or frame."""
    balls, trajectory, energy = result.balls, result.trajectory, result.energy
    observables = {
        "kinetic_energy": energy.kinetic,
        "potential_energy": energy.potential,
        "work": energy.work,
        "energy_lost": energy.lost,
        "energy_supplied": energy.supplied,
        "energy_residual": energy.residual,
    }
    return {
        f"{FRAMES}/step": trajectory.step.astype("i8"),
        f"{FRAMES}/time": trajectory.time,
        f"{FRAMES}/value": trajectory.position,
        "particles/balls/velocity/value": trajectory.velocity,
        "particles/balls/id": np.arange(len(balls)),
        "particles/balls/mass": np.full(len(balls), balls.mass),
        "particles/balls/radius": np.full(len(balls), balls.radius),
        **{f"observables/{name}/value": values for name, values in observables.items()},
    }


def _own(result: Result) -> Numbers:
    """Events and parameters: what runs of as many frames and balls have more or less of."""
    return {
        "events/bounces": result.bounces,
        "events/rests": result.rests,
        "parameters/run_id": _text(result.run_id),
        "parameters/configuration": _text(json.dumps(result.parameters, sort_keys=True)),
        "parameters/versions": _text(json.dumps(_versions())),
    }


def _text(text: str) -> np.ndarray:
    """It as UTF-8, with zeros after it up to a multiple of TEXT, so that texts of nearly the same length take the same place."""
    content = text.encode()
    return np.array(content, f"S{-(-len(content) // TEXT) * TEXT}")


def _layout(numbers: Numbers) -> Layout:
    return tuple((place, values.shape, values.dtype) for place, values in numbers.items())


def _zeros(layout: Layout) -> Numbers:
    return {place: np.zeros(shape, dtype) for place, shape, dtype in layout}


@lru_cache(maxsize=256)  # of some 20 kB each
def _skeleton(often: Layout, own: Layout, surfaces: tuple[str, ...]) -> tuple[list[bytes], list[str]]:
    """What a file has before, between and after its numbers, and the places of the numbers in that order."""
    import h5py

    access = _access()
    access.set_file_image(_image(often))
    file = h5py.h5f.open(FILE.encode(), h5py.h5f.ACC_RDWR, access)
    _write_own(file, _zeros(own), surfaces)
    h5py.h5f.flush(file)
    image = file.get_file_image()
    places = sorted((offset, place) for place, *_ in often + own if (offset := _offset(file, place)) is not None)
    sizes = {place: int(np.prod(shape)) * dtype.itemsize for place, shape, dtype in often + own}
    starts = [0, *(offset + sizes[place] for offset, place in places)]
    ends = [*(offset for offset, _ in places), len(image)]
    return [image[start:end] for start, end in zip(starts, ends)], [place for _, place in places]


@lru_cache(maxsize=4)
def _image(layout: Layout) -> bytes:
    """A file with zeros for the numbers of each ball or frame, and nothing else yet."""
    import h5py

    with h5py.File(FILE, "w", libver=VERSION, driver="core", backing_store=False) as file:
        _write_frames(file, _zeros(layout))
        file.flush()
        return file.id.get_file_image()


def _access() -> h5py.h5p.PropFAID:
    """How to open a file in memory."""
    import h5py

    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_libver_bounds(h5py.h5f.LIBVER_V110, h5py.h5f.LIBVER_V110)
    access.set_fapl_core(block_size=65536, backing_store=False)
    return access


def _offset(file: h5py.h5f.FileID, place: str) -> int | None:
    """Where in the file the numbers of a place begin; None where there are none."""
    import h5py

    return h5py.h5d.open(file, place.encode()).get_offset()


def _write_frames(file: h5py.File, numbers: Numbers) -> None:
    """What runs of as many frames and balls have alike, but for the numbers."""
    header = file.create_group("h5md")
    header.attrs["version"] = np.array([1, 1], "i4")
    header.create_group("author").attrs["name"] = "carom"
    creator = header.create_group("creator")
    creator.attrs["name"] = "carom"
    creator.attrs["version"] = _versions()["carom"]
    file.create_group("events")
    file.create_group("parameters")
    box = file.create_group("particles/balls/box")
    box.attrs["dimension"] = 3
    box.attrs["boundary"] = np.array([b"none"] * 3)
    for place, values in numbers.items():
        dataset = file.create_dataset(place, data=values)
        element, _, last = place.rpartition("/")
        units = UNITS.get(element.rpartition("/")[2] if last == "value" else last)
        if units:
            dataset.attrs["units"] = units
        if last == "value" and element != FRAMES:
            for name in ("step", "time"):  # hard links, as H5MD allows
                file[f"{element}/{name}"] = file[f"{FRAMES}/{name}"]


def _write_own(file: h5py.h5f.FileID, numbers: Numbers, surfaces: tuple[str, ...]) -> None:
    """Impacts, where balls came to rest, and parameters: by the C library's own calls, which cost a third of h5py's."""
    for place, values in numbers.items():
        dataset = _add_dataset(file, place, values)
        if place in EVENTS:
            _add_attribute(dataset, "description", EVENTS[place])
            _add_attribute(dataset, "units", json.dumps({column: UNITS[column] for column in values.dtype.names}))
            _add_attribute(dataset, "surfaces", list(surfaces))


def _add_dataset(file: h5py.h5f.FileID, place: str, values: np.ndarray) -> h5py.h5d.DatasetID:
    from h5py import h5d, h5p, h5s

    untimed = h5p.create(h5p.DATASET_CREATE)
    untimed.set_obj_track_times(False)
    dataset = h5d.create(file, place.encode(), _type(values.dtype), h5s.create_simple(values.shape), untimed)
    if values.size:
        dataset.write(h5s.ALL, h5s.ALL, values)
    return dataset


def _add_attribute(dataset: h5py.h5d.DatasetID, name: str, value: str | list[str]) -> None:
    import h5py
    from h5py import h5a, h5s

    values = np.array(value, h5py.string_dtype())
    h5a.create(dataset, name.encode(), _type(values.dtype), h5s.create_simple(values.shape)).write(values)


@cache
def _type(dtype: np.dtype) -> h5py.h5t.TypeID:
    from h5py import h5t

    return h5t.py_create(dtype, logical=True)


@cache
def _versions() -> dict[str, str]:
    """Of what computed and wrote the numbers."""

    def installed(name: str) -> str:
        try:
            return version(name)
        except PackageNotFoundError:  # run from a checkout
            return "unknown"

    return {name: installed(name) for name in ("carom", "numpy", "numba", "h5py")}
