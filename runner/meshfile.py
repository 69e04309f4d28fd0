"""Mesh files: anything trimesh reads becomes triangles."""

from __future__ import annotations

import gc
import hashlib
import stat
from functools import lru_cache
from pathlib import Path

import numpy as np

from sim.model import Invalid, Vector
from sim.shapes import Triangles
from sim.sheet import weld

LARGEST = 1_000_000_000  # bytes


def digest(path: Path) -> str:
    """The SHA-256 of the file. Raises Invalid when it cannot be read."""
    try:
        state = path.stat()
        if not stat.S_ISREG(state.st_mode):
            raise Invalid("file", f"{path} is not a file")
        if state.st_size > LARGEST:
            raise Invalid("file", f"{path.name} is larger than {LARGEST // 10**9} GB")
        return _digest(path, state.st_size, state.st_mtime_ns)
    except FileNotFoundError:
        raise Invalid("file", f"there is no file {path}") from None
    except OSError as error:
        raise Invalid("file", f"{path}: {error.strerror}") from None


@lru_cache
def _digest(path: Path, size: int, changed: int) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@lru_cache(maxsize=8)
def read(path: Path, sha256: str, scale: float, translate: Vector, rotate: Vector) -> Triangles:
    """The triangles of the file, scaled, rotated (degrees about x, then y, then z) and moved (m), in this order.

    `sha256` is the file's digest: another content under the same name is read anew. Raises Invalid when it is not a mesh.
    """
    import trimesh

    try:
        with np.errstate(all="ignore"):
            mesh = trimesh.load(path, force="mesh", process=False)
        vertices, corners = np.array(mesh.vertices, float), np.array(mesh.faces, np.int64)
        del mesh
        gc.collect()  # what it holds, several times the mesh, is in circles of references
    except Exception as error:  # trimesh's readers raise whatever their formats' parsers do
        reason = " ".join(str(error).split()) or type(error).__name__
        raise Invalid("file", f"{path.name} is not a mesh that can be read: {reason[:120]}") from None
    try:
        triangles = Triangles(vertices.reshape(-1, 3), corners.reshape(-1, 3))
    except Invalid as error:
        raise Invalid("file", f"{path.name}: {error.reason}") from None
    turn = np.eye(3)
    for angle, (a, b) in zip(np.radians(rotate), ((1, 2), (2, 0), (0, 1))):
        about_axis = np.eye(3)
        about_axis[[a, b], [a, b]] = np.cos(angle)
        about_axis[a, b], about_axis[b, a] = -np.sin(angle), np.sin(angle)
        turn = about_axis @ turn
    # formats without shared vertices give each triangle three of its own
    return Triangles(*weld(scale * triangles.vertices @ turn.T + np.asarray(translate, float), triangles.corners))
