"""recording.rrd: a run to look at, in the rerun viewer.

Written as chunks of columns, since a `RecordingStream` keeps two threads and half a megabyte for good. Such a file
cannot hold a blueprint; `runner.viewer` has the one for all recordings.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from runner.errors import Damaged, one_line
from runner.result import Result
from sim.model import Mesh

if TYPE_CHECKING:
    import rerun as rr
    from rerun.chunk import Chunk

FILE, PACKED = "recording.rrd", "recordings.rrd"
APPLICATION = "carom"

FLAT_TRIANGLES = 5_000  # a larger mesh shares its vertices and looks smooth: a third of the bytes
TRAILS = 30  # more of them hide the balls
TRAIL_VERTICES = 20_000
BOUNCE_MARKS = 20_000  # ten times as many and the viewer stutters
SERIES = {"kinetic": 0xFF6B5EFF, "potential": 0x5B9DFFFF, "total": 0xF0F0F0FF, "residual": 0xFFC84AFF}  # RGBA
ESCAPED = str.maketrans({mark: f"\\{mark}" for mark in "\\`*_|<["})  # what markdown would take for its own


def write(result: Result, path: Path) -> None:
    """Write `result` to the new file `path`; the recording id is the run id.

    Every ball stands in every frame. Trails are drawn for at most 30 balls, spread evenly over all of them, through
    20,000 of their frames, inside the scene and its surroundings; of more than 20,000 bounces every second, third ...
    counts. Raises OSError where the file cannot be written.
    """
    from rerun.chunk import ChunkStore

    frames = _frames(result.trajectory.time.tobytes())
    own = [*_balls(result, frames), _trails(result), _bounces(result), _energy(result, frames), _about(result)]
    chunks = [*_scene(result.surfaces), *_styles(result.balls.radius), *own]
    try:
        ChunkStore.from_chunks(chunks).write_rrd(path, application_id=APPLICATION, recording_id=result.run_id)
    except RuntimeError as error:
        raise OSError(f"{path}: {error}") from error


def join(files: dict[str, Path], path: Path) -> None:
    """Write the recordings in the runs' `files` to the new file `path`, where each keeps its recording id."""
    command = [sys.executable, "-m", "rerun_cli", "rrd", "merge", *map(str, files.values()), "-o", str(path)]
    # CI=1 keeps rerun from sending usage figures home
    done = subprocess.run(command, env=os.environ | {"CI": "1", "RUST_LOG": "error"}, capture_output=True, text=True)
    if done.returncode:
        raise OSError(f"{path}: {done.stderr.strip() or f'rerun ended with {done.returncode}'}")


def take(packed: Path, run_id: str, path: Path) -> None:
    """Write the run's recording out of the file `packed` to the new file `path`. Raises Damaged where it holds none."""
    from rerun.chunk import RrdReader

    try:
        reader = RrdReader(packed)
        (store,) = (each for each in reader.recordings() if each.recording_id == run_id)
        reader.store(store=store).write_rrd(path, application_id=APPLICATION, recording_id=run_id)
    except (RuntimeError, ValueError) as error:
        raise Damaged(packed, one_line(f"holds no recording of {run_id}: {error}")) from None


_drawn: dict[tuple, list[Chunk]] = {}  # the scene drawn last by its content: that of most runs of a sweep


def _scene(surfaces: dict[str, Mesh]) -> list[Chunk]:
    content = tuple((name, mesh.vertices.tobytes(), mesh.triangles.tobytes()) for name, mesh in surfaces.items())
    if content not in _drawn:
        _drawn.clear()
        _drawn[content] = list(_meshes(surfaces))
    return _drawn[content]


def _meshes(surfaces: dict[str, Mesh]) -> Iterator[Chunk]:
    import rerun as rr

    colors = _colors(len(surfaces), brightness=0.6, contrast=0.12, alpha=0.35)
    for (name, mesh), color in zip(surfaces.items(), colors):
        vertices, triangles, normals = _shaded(mesh)
        yield _static(
            f"/scene/{rr.escape_entity_path_part(name)}",
            rr.Mesh3D(
                vertex_positions=vertices, triangle_indices=triangles, vertex_normals=normals, albedo_factor=color
            ),
        )


@lru_cache
def _styles(radius: float) -> list[Chunk]:
    """What is the same in all recordings of balls of this radius (m)."""
    import rerun as rr

    return [
        _static("/", rr.ViewCoordinates.RIGHT_HAND_Y_UP),
        _static("/balls", rr.Points3D.from_fields(radii=radius)),
        _static(
            "/bounces", rr.Points3D.from_fields(radii=rr.Radius.ui_points(1.8), colors=0xFFFFFFFF, point_shading="Flat")
        ),
        _static("/energy", rr.SeriesLines(names=list(SERIES), colors=np.array(list(SERIES.values()), "u4"))),
    ]


def _balls(result: Result, frames: list[rr.TimeColumn]) -> Iterator[Chunk]:
    """One entity whose number of points changes as balls are born and die."""
    import rerun as rr

    position = result.trajectory.position
    alive = ~np.isnan(position[:, :, 0])
    points = rr.components.Position3DBatch(position.astype("f4")[alive])
    yield _columns("/balls", frames, rr.Points3D.descriptor_positions(), points, alive.sum(axis=1))

    # A point is known by its place among those alive, so that its color need only be told where that changes.
    changed = np.flatnonzero(np.append(True, (alive[1:] != alive[:-1]).any(axis=1)))
    times = result.trajectory.time[changed]
    yield _painted(times.tobytes(), changed.tobytes(), alive[changed].tobytes(), len(result.balls))


@lru_cache(maxsize=4)  # balls that all live from first to last are painted alike in all recordings
def _painted(times: bytes, frames: bytes, alive: bytes, balls: int) -> Chunk:
    import rerun as rr

    index = _index(np.frombuffer(times), np.frombuffer(frames, int))
    shown = np.frombuffer(alive, bool).reshape(-1 if balls else len(times) // 8, balls)
    colors = rr.components.ColorBatch(_colors(balls)[np.nonzero(shown)[1]])
    return _columns("/balls", index, rr.Points3D.descriptor_colors(), colors, shown.sum(axis=1))


def _trails(result: Result) -> Chunk:
    """The paths of some balls through frames and bounces, cut where a ball is not alive or far from the scene."""
    import rerun as rr

    shown = np.arange(0, len(result.balls), max(1, -(-len(result.balls) // TRAILS)))
    every = max(1, -(-len(shown) * len(result.trajectory.time) // TRAIL_VERTICES))
    times, positions = result.trajectory.time[::every], result.trajectory.position[::every]
    bounces = _thinned(result.bounces, TRAIL_VERTICES)
    low, high = _surroundings(result)

    strips, owners = [], []
    for ball in shown:
        corners = bounces[bounces["ball"] == ball]
        after = np.searchsorted(times, corners["time"], "right")
        path = np.insert(positions[:, ball], after, corners["position"], axis=0)
        x, y, z = ((path >= low) & (path <= high)).T  # false where NaN
        near = x & y & z
        for start, stop in np.flatnonzero(np.diff(near, prepend=False, append=False)).reshape(-1, 2):
            strips.append(path[start:stop].astype("f4"))
            owners.append(ball)

    colors = _colors(len(result.balls), brightness=0.3, contrast=0.12)[owners]
    return _static("/trails", rr.LineStrips3D(strips, colors=colors, radii=rr.Radius.ui_points(0.6)))


def _bounces(result: Result) -> Chunk:
    """A mark where the ball touched the surface, at that time; the blueprint keeps the earlier ones in sight."""
    import rerun as rr

    bounces = _thinned(result.bounces, BOUNCE_MARKS)
    contact = bounces["position"] - result.balls.radius * bounces["normal"]
    index = _index(bounces["time"], np.searchsorted(result.trajectory.time, bounces["time"]))
    points = rr.components.Position3DBatch(contact.astype("f4"))
    return _columns("/bounces", index, rr.Points3D.descriptor_positions(), points)


def _energy(result: Result, frames: list[rr.TimeColumn]) -> Chunk:
    import rerun as rr

    energy = result.energy
    values = np.stack([energy.kinetic, energy.potential, energy.kinetic + energy.potential, energy.residual], axis=1)
    scalars = rr.components.ScalarBatch(values.ravel())
    return _columns("/energy", frames, rr.Scalars.descriptor_scalars(), scalars, np.full(len(values), len(SERIES)))


def _about(result: Result) -> Chunk:
    import rerun as rr

    figures = {name: value for name, value in result.summary.items() if name not in ("run_id", "status")}
    parameters = dict(_leaves(result.parameters))
    text = f"**{_plain(result.run_id)}** {result.status}", _table("result", figures), _table("parameters", parameters)
    return _static("/about", rr.TextDocument("\n\n".join(text), media_type=rr.MediaType.MARKDOWN))


def _table(title: str, values: dict[str, Any]) -> str:
    """Markdown of two columns; long values are cut."""
    rows = [f"| {title} | |", "|---|---|"]
    for name, value in values.items():
        text = f"{value:.6g}" if isinstance(value, float) else value if isinstance(value, str) else _json(value)
        rows.append(f"| {_plain(name)} | {_plain(text if len(text) <= 80 else text[:77] + '...')} |")
    return "\n".join(rows)


_json = json.JSONEncoder(default=str).encode


@lru_cache(maxsize=1000)  # much of it stands in every recording
def _plain(text: str) -> str:
    """Markdown that shows `text` on one line and as it is: a height of 2*x*z has no italics."""
    return " ".join(text.split()).translate(ESCAPED)


def _leaves(tree: dict[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """The values of nested dictionaries with their dotted paths, as the keys of a matrix name them."""
    for key, value in tree.items():
        if isinstance(value, dict) and value:
            yield from _leaves(value, f"{path}{key}.")
        else:
            yield path + key, value


def _static(entity: str, archetype: rr.AsComponents) -> Chunk:
    """What holds at all times."""
    from rerun.chunk import Chunk

    batches = archetype.as_component_batches()
    return Chunk.from_columns(entity, [], [batch.partition([len(batch.as_arrow_array())]) for batch in batches])


def _columns(
    entity: str,
    index: list[rr.TimeColumn],
    component: rr.ComponentDescriptor,
    values: rr.ComponentBatchLike,
    counts: np.ndarray | None = None,
) -> Chunk:
    """As many `values` as `counts` (rows,) tells, or one, for each of `index`."""
    import rerun as rr
    from rerun.chunk import Chunk

    return Chunk.from_columns(entity, index, [rr.ComponentColumn(component, values, lengths=counts)])


@lru_cache(maxsize=4)
def _frames(time: bytes) -> list[rr.TimeColumn]:
    """The timelines of the frames at `time`: those of most runs of a sweep."""
    times = np.frombuffer(time)
    return _index(times, np.arange(len(times)))


def _index(time: np.ndarray, frame: np.ndarray) -> list[rr.TimeColumn]:
    """The timelines, from a `time` (rows,) in s and the number of a frame (rows,)."""
    import rerun as rr

    nanoseconds = np.rint(time * 1e9).astype("timedelta64[ns]")  # rerun would round 0.29 s down to 289999999 ns
    return [rr.TimeColumn("time", duration=nanoseconds), rr.TimeColumn("frame", sequence=frame)]


def _thinned(values: np.ndarray, limit: int) -> np.ndarray:
    return values[:: max(1, -(-len(values) // limit))]


def _surroundings(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """Opposite corners (3,) in m of the scene and half its size around it; without surfaces everywhere."""
    if not result.surfaces:
        return np.full(3, -np.inf), np.full(3, np.inf)
    points = np.concatenate([result.balls.position, *(mesh.vertices for mesh in result.surfaces.values())])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = (high - low).max() / 2
    return low - margin, high + margin


def _shaded(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, triangles and vertex normals, each (n, 3); flat unless there are many triangles."""
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if len(corners) <= FLAT_TRIANGLES:
        vertices, normals = corners.reshape(-1, 3), np.repeat(normals, 3, axis=0)
        triangles = np.arange(len(vertices)).reshape(-1, 3)
    else:
        vertices, triangles, areas = mesh.vertices, mesh.triangles, normals
        normals = np.zeros_like(vertices)
        for corner in triangles.T:
            np.add.at(normals, corner, areas)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return vertices, triangles, normals / np.where(length > 0, length, 1)


@lru_cache(maxsize=8)
def _colors(count: int, brightness: float = 0.65, contrast: float = 0.35, alpha: float = 1.0) -> np.ndarray:
    """(count, 4) RGBA bytes; neighbours differ, since their hues are a golden ratio of the circle apart."""
    hue = 0.6180339887 * np.arange(count)[:, None] + [0, 1 / 3, 2 / 3]
    rgb = brightness + contrast * np.cos(2 * np.pi * (hue - 0.08))
    return (255 * np.column_stack([rgb, np.full(count, alpha)])).astype("u1")
