"""What is fuzzed, a function each: it takes bytes of any kind and fails when they make more of a mess than a line of refusal."""

from __future__ import annotations

import json
import math
import os
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from runner import config, meshfile, starts, yamltext
from runner.document import Document, read_values
from runner.errors import Fault, InputError
from sim.expression import evaluate
from sim.model import Invalid
from sim.shapes import Triangles

X, Z = np.meshgrid(np.linspace(-1, 1, 3), np.linspace(-2, 2, 3))
MOST_EXPANDED, MOST_CELLS = 200, 1000  # runs, and cells of a surface; more would be no other code
BASE = """\
scene:
  surfaces: {floor: {shape: plane}, hills: {shape: heightfield, size: [1, 1], cells: [2, 2], height: "0.1*x"}}
  forces: {wind: {type: uniform, direction: [1, 0, 0], magnitude: 1}}
balls: {mass: 1, released: [{position: [0, 1, 0]}]}
solver: {method: explicit_euler, step: 0.01}
duration: 0.2
"""
FILE = Path("x.yaml")


def prepare() -> None:
    """What experiments may find in the current folder: a mesh, a link to it, a pipe, a folder."""
    Path("mesh.obj").write_bytes(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    Path("link.obj").symlink_to("mesh.obj")
    Path("there").symlink_to(".")
    Path("folder.obj").mkdir()
    os.mkfifo("pipe.obj")


def expression(data: bytes) -> None:
    text = data.decode("utf-8", "replace")
    try:
        value = evaluate(text, x=X, z=Z)
    except ValueError as error:
        assert_line(str(error))
    else:
        assert value.shape == X.shape and value.dtype == float


def document(data: bytes) -> None:
    """The loader: a whole experiment file."""
    FILE.write_bytes(data)
    try:
        experiment = config.check(Document(FILE))
        expand(experiment)
    except InputError as error:
        assert_lines(error)
        return
    FILE.write_text(experiment.document.text(), encoding="utf-8")
    assert Document(FILE).data == experiment.document.data


class _Told(Document):
    """A document of a tree that is there: to read it takes most of the time of an input, which `document` takes."""

    def __init__(self, tree: Any):
        self._told = tree
        super().__init__(FILE)

    def _parse(self) -> Any:
        self._text = ""
        return self._told


def settings(data: bytes) -> None:
    """What an experiment holds, as JSON."""
    try:
        tree = json.loads(data)
        json.dumps(tree, ensure_ascii=False).encode()
    except (ValueError, RecursionError):  # half a character, too: reading refuses it
        return
    try:
        expand(config.check(_Told(tree)))
    except InputError as error:
        assert_lines(error)


def matrix(data: bytes) -> None:
    """What varies, as JSON, in an experiment that is right."""
    settings(json.dumps(_base().data)[:-1].encode() + b', "matrix": ' + data + b"}")


def option(data: bytes) -> None:
    """`-s key=values`."""
    key, _, text = data.decode("utf-8", "replace").partition("=")
    loaded = deepcopy(_base())
    try:
        config.vary(loaded, key, read_values(text, "-s"))
        experiment = config.check(loaded)
        expand(experiment)
    except InputError as error:
        assert_lines(error)
        return
    assert yamltext.read(experiment.document.text()) == experiment.document.data


@cache
def _base() -> Document:
    FILE.write_text(BASE)
    return Document(FILE)


def mesh(data: bytes) -> None:
    """A mesh file: its ending, a line feed, and its content."""
    kind, _, content = data.partition(b"\n")
    path = Path(f"t.{kind.decode() if kind in (b'obj', b'off', b'stl', b'ply', b'glb', b'gltf') else 'zip'}")
    path.write_bytes(content)
    try:
        triangles = meshfile.read(path, meshfile.digest(path), 1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        assert isinstance(triangles, Triangles) and np.isfinite(triangles.vertices).all()
    except Invalid as error:
        assert_line(str(Fault("x.yaml", error.field, error.reason)))


TARGETS = {each.__name__: each for each in (expression, document, settings, matrix, option, mesh)}


def expand(experiment: config.Experiment) -> None:
    """What is done with an experiment before anything runs: its runs, and whether balls start inside a surface."""
    name = experiment.name
    assert Path(name).name == name and name not in (".", "..")
    runs = experiment.runs() if experiment.matrix.size <= MOST_EXPANDED else [experiment.base]
    assert all(run.run_id.isprintable() and "/" not in run.run_id for run in runs)
    surfaces = experiment.base.setup.scene.surfaces.values()
    if all(math.prod(getattr(surface, "cells", ())) <= MOST_CELLS for surface in surfaces):
        if faults := starts.faults([experiment.base], experiment.document):
            raise InputError(*faults)


def assert_line(text: str) -> None:
    assert text and text.isprintable() and len(text) < 1000, text


def assert_lines(error: InputError) -> None:
    for line in str(error).split("\n"):
        assert_line(line)
