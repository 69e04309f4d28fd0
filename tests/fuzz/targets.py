"""What is fuzzed, a function each: it takes bytes of any kind and fails when they make more of a mess than a line of refusal."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from runner import config, meshfile
from runner.document import Document, read_values
from runner.errors import Fault, InputError
from sim.expression import evaluate
from sim.model import Invalid
from sim.shapes import Triangles

X, Z = np.meshgrid(np.linspace(-1, 1, 3), np.linspace(-2, 2, 3))
MOST_EXPANDED = 200  # runs; more would be no other code
BASE = """\
scene:
  surfaces: {floor: {shape: plane}, hills: {shape: heightfield, size: [1, 1], cells: [2, 2], height: "0.1*x"}}
  forces: {wind: {type: uniform, direction: [1, 0, 0], magnitude: 1}}
balls: {mass: 1, released: [{position: [0, 1, 0]}]}
solver: {method: explicit_euler, step: 0.01}
duration: 0.2
"""


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
    path = Path("x.yaml")
    path.write_bytes(data)
    try:
        experiment = config.check(Document(path))
        if experiment.matrix.size <= MOST_EXPANDED:
            assert all(run.run_id.isprintable() and "/" not in run.run_id for run in experiment.runs())
        name = experiment.name
    except InputError as error:
        assert_lines(error)
        return
    assert Path(name).name == name and name not in (".", "..")
    path.write_text(experiment.document.text(), encoding="utf-8")
    assert Document(path).data == experiment.document.data


def matrix(data: bytes) -> None:
    """What varies, in an experiment that is right."""
    document(BASE.encode() + b"matrix:\n  " + data.replace(b"\n", b"\n  "))


def option(data: bytes) -> None:
    """`-s key=values`."""
    key, _, text = data.decode("utf-8", "replace").partition("=")
    Path("x.yaml").write_text(BASE)
    try:
        loaded = Document(Path("x.yaml"))
        config.vary(loaded, key, read_values(text, "-s"))
        config.check(loaded)
    except InputError as error:
        assert_lines(error)


def mesh(data: bytes) -> None:
    """A mesh file: its ending, a line feed, and its content."""
    kind, _, content = data.partition(b"\n")
    path = Path(f"t.{kind.decode('ascii', 'replace')[:5].replace('/', '').replace(chr(0), '') or 'obj'}")
    path.write_bytes(content)
    try:
        triangles = meshfile.read(path, meshfile.digest(path), 1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        assert isinstance(triangles, Triangles) and np.isfinite(triangles.vertices).all()
    except Invalid as error:
        assert_line(str(Fault("x.yaml", error.field, error.reason)))
    finally:
        path.unlink()


TARGETS = {each.__name__: each for each in (expression, document, matrix, option, mesh)}


def assert_line(text: str) -> None:
    assert text and text.isprintable() and len(text) < 1000, text


def assert_lines(error: InputError) -> None:
    for line in str(error).split("\n"):
        assert_line(line)
    assert set(os.listdir()) <= {"x.yaml"}, "nothing is written"
