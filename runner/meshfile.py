"""Mesh files become triangles."""

from __future__ import annotations

import gc
import hashlib
import io
import logging
import stat
import warnings
from functools import lru_cache
from pathlib import Path

import numpy as np

from runner.errors import one_line
from runner.limits import LARGEST_MESH, SEEN_FIRST
from runner.meshformats import FORMATS, check_head
from sim.model import Invalid, Vector
from sim.shapes import Triangles
from sim.sheet import weld


def digest(path: Path) -> str:
    """The SHA-256 of the file. Raises Invalid when it cannot be read, or does not begin as a mesh."""
    try:
        state = path.stat()
        if not stat.S_ISREG(state.st_mode):  # a pipe or a device may never end
            raise Invalid("file", f"{path} is not a file")
        if state.st_size > LARGEST_MESH:
            raise Invalid("file", f"{path.name} is larger than {LARGEST_MESH // 10**6} MB")
        return _digest(path, state.st_size, state.st_mtime_ns)
    except FileNotFoundError:
        raise Invalid("file", f"there is no file {path}") from None
    except OSError as error:
        raise Invalid("file", f"{path}: {error.strerror}") from None
    except Invalid:
        raise
    except ValueError as error:  # of a name that no file can have
        raise Invalid("file", f"{path}: {error}") from None


@lru_cache
def _digest(path: Path, size: int, changed: int) -> str:
    with path.open("rb") as file:
        try:
            check_head(_kind(path), file.read(SEEN_FIRST), size)
        except ValueError as error:
            raise _no_mesh(path, error) from None
        file.seek(0)
        return hashlib.file_digest(file, "sha256").hexdigest()


def _kind(path: Path) -> str:
    return path.suffix.removeprefix(".").lower()


def _no_mesh(path: Path, error: Exception) -> Invalid:
    return Invalid("file", f"{path.name} is not a mesh that can be read: {one_line(str(error) or type(error).__name__)}")


@lru_cache(maxsize=8)
def read(path: Path, sha256: str, scale: float, translate: Vector, rotate: Vector) -> Triangles:
    """The triangles of the file, scaled, rotated (degrees about x, then y, then z) and moved (m), in this order.

    `sha256` is the file's digest: another content under the same name is read anew. Raises Invalid when it is not a mesh.
    """
    import trimesh

    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # what it can do without, it would tell on the terminal
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            # numpy would leave out all that follows what is no number
            warnings.filterwarnings("error", "string or file could not be read", DeprecationWarning)
            mesh = trimesh.load(
                io.BytesIO(FORMATS[_kind(path)](path.read_bytes())), _kind(path), _Nothing(), force="mesh", process=False,
                skip_materials=True,
            )  # fmt: skip
        vertices, corners = np.array(mesh.vertices, float).reshape(-1, 3), np.array(mesh.faces, np.int64).reshape(-1, 3)
        del mesh
        gc.collect()  # what it holds, several times the mesh, is in circles of references
    except Exception as error:  # trimesh's readers raise whatever their formats' parsers do
        raise _no_mesh(path, error) from None
    turn = np.eye(3)
    for angle, (a, b) in zip(np.radians(rotate), ((1, 2), (2, 0), (0, 1))):
        about_axis = np.eye(3)
        about_axis[[a, b], [a, b]] = np.cos(angle)
        about_axis[a, b], about_axis[b, a] = -np.sin(angle), np.sin(angle)
        turn = about_axis @ turn
    try:
        triangles = Triangles(vertices, corners)
        with np.errstate(all="ignore"):  # what is not finite then is told
            placed = scale * triangles.vertices @ turn.T + np.asarray(translate, float)
        # formats without shared vertices give each triangle three of its own
        return Triangles(*weld(Triangles(placed, triangles.corners).vertices, triangles.corners))
    except Invalid as error:
        raise Invalid("file", f"{path.name}: {error.reason}") from None


class _Nothing(dict):
    """Stands for the files beside a mesh, of which none is read: a run's id knows the one file."""

    get = dict.__getitem__
