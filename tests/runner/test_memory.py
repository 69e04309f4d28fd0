"""A million triangles: from the file to a simulation ready to run in less than a gigabyte."""

import subprocess
import sys

import numpy as np
import pytest
import trimesh

from sim.shapes import Heightfield

SCENE = """
scene: {{surfaces: {{ground: {{shape: {shape}}}}}}}
balls: {{radius: 0.05, released: [{{position: [0.1, 3, 0.2], velocity: [0, 0, 0]}}]}}
solver: {{method: symplectic_euler}}
reference: exact
duration: 0.01
"""
SCRIPT = """
import sys
from runner import load, machine, run
run(load(sys.argv[1]))
print(machine.peak_memory())
"""
CELLS, HEIGHT = 708, "0.3*sin(2*x)*cos(2*z) + 0.05*x*z"


def terrain():
    vertices, corners = Heightfield((4, 4), (CELLS, CELLS), HEIGHT).mesh()
    rough = np.random.default_rng(1).normal(0, 1e-3, len(vertices))
    return trimesh.Trimesh(vertices + np.outer(rough, (0, 1, 0)), corners, process=False)


def ball():
    return trimesh.creation.uv_sphere(radius=1, count=[501, 502])


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, mesh",
    [("heightfield", None), ("terrain.ply", terrain), ("terrain.stl", terrain), ("ball.ply", ball), ("ball.stl", ball)],
)
def test_a_million_triangles_in_a_gigabyte(tmp_path, name, mesh):
    shape = f"heightfield, size: [4, 4], cells: [{CELLS}, {CELLS}], height: '{HEIGHT}'"
    if mesh:
        made = mesh()
        assert len(made.faces) >= 1e6
        made.export(tmp_path / name)
        shape = f"mesh, file: {name}"
    (tmp_path / "large.yaml").write_text(SCENE.format(shape=shape))
    done = subprocess.run([sys.executable, "-c", SCRIPT, tmp_path / "large.yaml"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 1e9
