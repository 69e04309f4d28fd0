"""A run's two files as a script would write them that nobody has made fast: a call of h5py for each dataset, of rerun for each entity.

They hold the same numbers as carom's own, and the scene, but none of the units, links and styles.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from runner.result import Result

ENERGIES = "kinetic", "potential", "work", "lost", "supplied", "residual"
SHOWN = "kinetic", "potential", "residual"


def write(result: Result, folder: Path) -> None:
    write_hdf5(result, folder / "plain.h5")
    write_rrd(result, folder / "plain.rrd")


def write_hdf5(result: Result, path: Path) -> None:
    import h5py

    path_, energy = result.trajectory, result.energy
    with h5py.File(path, "w") as file:
        for name in ("step", "time", "position", "velocity"):
            file[f"particles/balls/{name}"] = getattr(path_, name)
        for name in ENERGIES:
            file[f"observables/{name}"] = getattr(energy, name)
        file["particles/balls/mass"] = np.full(len(result.balls), result.balls.mass)
        file["particles/balls/radius"] = np.full(len(result.balls), result.balls.radius)
        file["events/bounces"], file["events/rests"] = result.bounces, result.rests
        file["parameters/run_id"] = result.run_id
        file["parameters/configuration"] = json.dumps(result.parameters)


def write_rrd(result: Result, path: Path) -> None:
    import rerun as rr

    time, position = result.trajectory.time, result.trajectory.position
    with rr.RecordingStream("carom", recording_id=result.run_id) as recording:
        recording.save(path)
        for name, mesh in result.surfaces.items():
            recording.log(f"scene/{name}", rr.Mesh3D(vertex_positions=mesh.vertices, triangle_indices=mesh.triangles), static=True)
        recording.log("trails", rr.LineStrips3D(list(np.moveaxis(position, 1, 0))), static=True)
        recording.log("about", rr.TextDocument(json.dumps(result.summary)), static=True)
        frames = [rr.TimeColumn("time", duration=time)]
        points = rr.Points3D.columns(positions=position.reshape(-1, 3)).partition(np.full(len(time), position.shape[1]))
        recording.send_columns("balls", frames, points)
        bounces = [rr.TimeColumn("time", duration=result.bounces["time"])]
        recording.send_columns("bounces", bounces, rr.Points3D.columns(positions=result.bounces["position"]))
        shown = np.stack([getattr(result.energy, name) for name in SHOWN], axis=1)
        scalars = rr.Scalars.columns(scalars=shown.ravel()).partition(np.full(len(time), len(SHOWN)))
        recording.send_columns("energy", frames, scalars)
    rr.bindings.flush_and_cleanup_orphaned_recordings()
