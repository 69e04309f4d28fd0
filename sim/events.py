"""What a simulation has written down of its balls, as tables: their impacts and their rests."""

from __future__ import annotations

import numpy as np

from sim import log, model
from sim.packed import ALONG, LENGTH, NORMAL, OF, OUTLINE, START, SURFACE, Packed

PLACE = slice(log.POSITION, log.POSITION + 3)


def bounces(rows: np.ndarray, end: float, features: Packed) -> np.ndarray:
    """The impacts in rows (n, log.COLUMNS) up to the time `end` (s): structured, BOUNCE, in order of time, then of ball."""
    rows = _in_order(rows[(rows[:, log.SPEED_NORMAL] != log.REST) & (rows[:, log.TIME] <= end)])
    out, what = _begun(rows, features, model.BOUNCE)
    out["position"], out["normal"] = rows[:, PLACE], _normals(features, what, rows[:, PLACE])
    out["speed_normal"], out["speed_tangential"] = rows[:, log.SPEED_NORMAL], rows[:, log.SPEED_TANGENTIAL]
    out["energy_lost"] = rows[:, log.ENERGY_LOST]
    return out


def rests(rows: np.ndarray, end: float, features: Packed) -> np.ndarray:
    """The same of each coming to rest, or to a slide, on a surface: structured, REST."""
    rows = _in_order(rows[(rows[:, log.SPEED_NORMAL] == log.REST) & (rows[:, log.TIME] <= end)])
    return _begun(rows, features, model.REST)[0]


def _in_order(rows: np.ndarray) -> np.ndarray:
    """The rows by time, then by ball."""
    order = np.argsort(rows[:, log.TIME])
    time = rows[order, log.TIME]
    if np.any(time[1:] == time[:-1]):  # rare, and slower by far
        order = np.lexsort((_who(rows) % log.BALLS, rows[:, log.TIME]))
    return rows[order]


def _begun(rows: np.ndarray, features: Packed, kind: np.dtype) -> tuple[np.ndarray, np.ndarray]:
    """A table with what all kinds have in common filled in; and what was touched (n,), as in the rows."""
    out, who = np.empty(len(rows), kind), _who(rows)
    what = who // log.BALLS
    out["time"], out["ball"], out["surface"] = rows[:, log.TIME], who % log.BALLS, _surfaces(features, what)
    return out, what


def _who(rows: np.ndarray) -> np.ndarray:
    return rows[:, log.WHO].astype(np.int64)


def _surfaces(features: Packed, what: np.ndarray) -> np.ndarray:
    """The numbers (n,) of the surfaces that were touched."""
    item, n, surfaces = np.where(what < 0, -1 - what, what), len(features.faces), np.empty(len(what))
    face = item < n
    surfaces[face] = features.outline[features.faces[item[face], OUTLINE].astype(np.int64), SURFACE]
    surfaces[~face] = features.edges[item[~face] - n, OF]
    return surfaces


def _normals(features: Packed, what: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The unit normals (n, 3) at the touches of balls at x (n, 3) m, from the surface to the ball."""
    n, normals = len(features.faces), np.empty(x.shape)
    over, under, at_edge = (what >= 0) & (what < n), what < 0, what >= n
    normals[over] = features.faces[what[over], NORMAL : NORMAL + 3]
    normals[under] = -features.faces[-1 - what[under], NORMAL : NORMAL + 3]
    if at_edge.any():
        edges = features.edges[what[at_edge] - n]
        along, off = edges[:, ALONG : ALONG + 3], x[at_edge] - edges[:, START : START + 3]
        off -= np.clip(_dot(off, along), 0.0, edges[:, LENGTH])[:, None] * along
        normals[at_edge] = (1.0 / np.sqrt(_dot(off, off)))[:, None] * off
    return normals


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The inner products of rows, summed in one order on every machine."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]
