"""Files made to do harm: each is refused in a line with its place, before time or memory go into it, and nothing is written.

How long is not held against a clock; but what is not refused beforehand takes minutes here, or all memory there is.
"""

import base64
import bz2
import io
import json
import os
import shutil
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import runner

from tests.conftest import FALL

SCATTER = FALL.replace("released: [{position: [0, 1, 0]}]", "scatter: {count: 10, box: [[0, 1, 0], [1, 2, 1]]}")
EMITTER = FALL.replace("released: [{position: [0, 1, 0]}]", "emitter: {position: [0, 1, 0], direction: [0, 1, 0], rate: 5}")
AXIS = ", ".join(f"0.{n:04}" for n in range(1, 2001))
NINES = ", ".join(f"0.{n:04}" for n in range(1, 1000))
BILLIONS = FALL + f"matrix: {{balls.mass: [{AXIS}], balls.radius: [{AXIS}], solver.step: [{AXIS}]}}\n"


def field(cells, height):
    return FALL.replace("shape: plane", f"shape: heightfield, size: [1, 1], cells: {cells}, height: {json.dumps(height)}")


#: what: (file, place and path, words)
FILES = {
    "digits": (FALL + f"repeats: {'9' * 400_000}\n", "11:10: ", "longer than 4,096 characters"),
    "hexadecimal digits": (FALL + f"repeats: 0x{'f' * 4000}\n", "11:1: repeats: ", "must be a finite number"),
    "a text": (FALL + f"reference: {'x' * 400_000}\n", "11:12: ", "longer than 4,096 characters"),
    "a key": (FALL + f'? "{"x" * 400_000}"\n: 1\n', "11:3: ", "longer than 4,096 characters"),
    "half a character": (FALL + 'reference: "\\ud800"\n', "11:12: ", "holds half a character"),
    "many values": (FALL + f"charts: [{'1, ' * 30_000}]\n", "11:", "more than 20,000 values"),
    "a large file": (FALL + "#\n" * 300_000, "", "larger than 500 kB"),
    "lists in lists": ("- " * 200_000, "1:103: ", "nested too deeply"),
    "keys in keys": ("? " * 200_000, "1:3: ", "a key must be a text"),
    "groups as keys": (f"charts: {'{? ' * 45}a{'}' * 45}", "1:12: ", "a key must be a text"),
    "an alias of a list as a key": ("a: &a [1]\nb: {*a : 1}", "2:5: ", "a key must be a text"),
    "groups in groups": (FALL + f"charts: {'{a: ' * 90_000}", "11:", "nested too deeply"),
    "merged again and again": (
        f"a0: &a0 {{{', '.join(f'k{n}: 1' for n in range(2000))}}}\n" + "".join(f"a{n}: &a{n} {{<<: *a{n - 1}}}\n" for n in range(1, 300)),
        "5:14: ", "more than 20,000 values with its aliases",
    ),
    "a name that is no index": (FALL + "matrix: {balls.\u00b2: [1]}\n", "11:10: matrix.balls.\u00b2: ", "there is no setting"),
    "an index that is none": (FALL + f"matrix: {{balls.released.{'9' * 500}: [1]}}\n", "11:10: matrix.balls.released.999", "..."),
    "billions of runs": (BILLIONS, "11:1: matrix: ", "makes 8,000,000,000 runs; one experiment may have 1,000,000"),
    "a value late in a million runs": (
        FALL + f"matrix: {{balls.mass: [{NINES}, -1], solver.step: [{NINES}, 1]}}\n", "11:8015: balls.mass: ", "must be > 0, not -1"
    ),
    "two values late in a million runs": (
        FALL + f"matrix: {{balls.mass: [{NINES}, 199], scene.wall_mass: [{NINES.replace('0.', '200.')}, 198]}}\n",
        "11:8015: balls.mass: ", "must be <= scene.wall_mass = 198",
    ),
    "balls scattered": (SCATTER.replace("count: 10", "count: 1e12"), "7:13: balls.scatter.count: ", "must be <= 1e+07"),
    "balls emitted": (EMITTER.replace("rate: 5", "rate: 1e300"), "7:56: balls.emitter.rate: ", "lets out 2e+299 balls"),
    "frames": (FALL.replace("duration: 0.2", "duration: 1e9"), "10:1: record.every: ", "makes 1e+11 records"),
    "frames that cannot be counted": (
        FALL.replace("duration: 0.2", "duration: 1e308").replace("formats:", "every: 1e-308, formats:"),
        "10:10: record.every: ", "makes inf records",
    ),
    "frames of many balls": (SCATTER.replace("count: 10", "count: 1e7").replace("0.2", "2"), "10:1: record.every: ", "records"),
    "steps": (FALL.replace("step: 0.01", "step: 1e-300"), "8:34: solver.step: ", "makes 2e+299 steps"),
    "cells": (field([4096, 4096], "x"), "4:47: scene.surfaces.floor.cells: ", "make 33,554,432 triangles"),
    "a tower of powers": (field([2, 2], "9**9**9**9"), "4:62: scene.surfaces.floor.height: ", "not finite"),
    "powers at millions of points": (
        field([4096, 1220], "x**z" + "**x**z" * 160), "4:68: scene.surfaces.floor.height: ",
        "takes more than 50,000,000 operations at 5,002,437 points",
    ),
    "a place too far": (FALL.replace("[0, 1, 0]", "[0, 1e300, 0]"), "7:29: balls.released.0.position.1: ", "must be <= 1e+12"),
    "a size too large": (
        FALL.replace("plane", "box, center: [0, 0, 0], size: [1, 1e154, 1]"), "4:54: scene.surfaces.floor.size.1: ",
        "must be <= 1e+12",
    ),
    "heights too far": (field([2, 2], "1e13*x"), "4:62: scene.surfaces.floor.height: ", "not within 1e+12 m"),
    "a name of a file": (FALL.replace("shape: plane", f"shape: mesh, file: {'a/' * 2000}x.obj"), "4:26: scene.", "..."),
    "a nul in a name": (FALL.replace("shape: plane", 'shape: mesh, file: "a\\0.obj"'), "4:26: scene.surfaces.floor.file: ", "null"),
    "a line feed in a name": (FALL.replace("shape: plane", 'shape: mesh, file: "a\\n.obj"'), "4:26: scene.", "no file a\\n.obj"),
    "the system's own": (FALL.replace("shape: plane", "shape: mesh, file: /proc/self/stat"), "4:26: scene.", "is empty"),
}  # fmt: skip

MANY = {
    "settings": FALL.replace("  mass: 1", "  mass: 1\n" + "".join(f"  mas{n}: 1\n" for n in range(5000))),
    "axes": FALL + "matrix:\n" + "".join(f"  balls.mas{n}: [1]\n" for n in range(5000)),
    "values": FALL + f"matrix: {{balls.mass: [{'-1, ' * 10_000}]}}\n",
    "expectations": FALL + "expect:\n" + "  - {column: bouces, max: 1}\n" * 3000,
    "charts": FALL + "charts:\n" + "  - {kind: lines, x: balls.mas, y: bounces}\n" * 2000,
}

OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
PLY = b"ply\nformat %s 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n%send_header\n0 0 0\n"
HIDDEN = b"ply\nformat binary_little_endian 1.0\ncomment an end_header\n" + b"element vertex 1\n" + b"".join(
    b"property list uchar int a%d\n" % n for n in range(400)
)
LAUGHS = "".join(f'<!ENTITY {chr(98 + n)} "{f"&{chr(97 + n)};" * 10}">' for n in range(9))
XML = f'<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "ha">{LAUGHS}]><model>&j;</model>'.encode()


def gltf(**parts) -> dict:
    """A triangle in glTF, with other `parts`."""
    numbers = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0) + struct.pack("<3I", 0, 1, 2)
    uri = "data:application/octet-stream;base64," + base64.b64encode(numbers).decode()
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": 48, "uri": uri}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
    } | parts  # fmt: skip


def glb(numbers=bytes(48), **parts) -> bytes:
    """The same triangle in the binary format, with its `numbers` in a chunk of their own."""
    text = json.dumps(gltf(buffers=[{"byteLength": len(numbers)}], **parts)).encode()
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(numbers), 0x4E4942) + numbers
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def strided(count, **view):
    """Vertices that overlap, in the first of its views."""
    views, accessors = gltf()["bufferViews"], gltf()["accessors"]
    return {"bufferViews": [views[0] | view, views[1]], "accessors": [accessors[0] | {"count": count}, accessors[1]]}


def zeros(count):
    return {"accessors": [{"componentType": 5126, "count": count, "type": "VEC3"}]}


def zipped(name, content) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return out.getvalue()


#: what: (ending, content, words)
MESHES = {
    "solids in a line of stl": ("stl", b"solid a\n" + b"vertex 0 0 0 endsolid solid\n" * 20_000 + b"endsolid\n", "a vertex is more"),
    "triangles in stl": ("stl", bytes(80) + struct.pack("<I", 10**9) + bytes(500), "tells of 1,000,000,000 triangles"),
    "vertices in binary ply": ("ply", PLY % (b"binary_little_endian", 10**9, b""), "tells of 1,000,000,000 elements"),
    "vertices in ply": ("ply", PLY % (b"ascii", 10**9, b""), "tells of 1,000,000,000 elements"),
    "lists in ply": ("ply", PLY % (b"binary_little_endian", 1, b"property list uchar int a\n" * 400), "more than 100 properties"),
    "a header behind its end in ply": ("ply", HIDDEN + b"end_header\n" + bytes(100_000), "more than 100 properties"),
    "lists of vertices in ply": ("ply", PLY.replace(b"float z", b"list uchar float z") % (b"ascii", 1, b""), "hold lists"),
    "a header of ply": ("ply", b"ply\nformat ascii 1.0\n" + b"comment\n" * 100_000, "its header has no end"),
    "vertices in off": ("off", b"OFF\n1000000000 1000000000 0\n0 0 0\n", "tells of 2,000,000,000 vertices and faces"),
    "numbers in gltf": ("gltf", gltf(**zeros(10**9)), "tells of 1,000,000,000 numbers"),
    "nodes in gltf": ("gltf", gltf(nodes=[{"mesh": 0, "children": [n + 1]} for n in range(5000)]), "more than 1000 nodes"),
    "a chain of nodes in gltf": ("gltf", gltf(nodes=[{"children": [n + 1]} for n in range(60)] + [{"mesh": 0}]), "nested too deeply"),
    "a ring of nodes in gltf": ("gltf", gltf(nodes=[{"mesh": 0, "children": [1]}, {"children": [0]}]), "nested too deeply"),
    "primitives in gltf": ("gltf", gltf(meshes=[{"primitives": gltf()["meshes"][0]["primitives"] * 20_000}]), "more than 1000"),
    "numbers that overlap in glb": (
        "glb", glb(bytes(10_000_000), **strided(9_000_000, byteLength=9_500_000, byteStride=1)), "numbers that it does not hold",
    ),
    "numbers beyond a view in glb": ("glb", glb(bytes(1000), **strided(3, byteStride=20)), "numbers that it does not hold"),
    "nodes that repeat in glb": (
        "glb", glb(bytes(3_600_048), nodes=[{"children": [*range(1, 100)]}] + [{"mesh": 0}] * 99, **strided(300_000, byteLength=3_600_000)),
        "repeat too many",
    ),
    "compressed in gltf": (
        "gltf", gltf(accessors=2 * zeros(3)["accessors"]), "compressed, or not at all",
    ),
    "sparse in gltf": ("gltf", gltf(accessors=[each | {"sparse": {}} for each in gltf()["accessors"]]), "compressed, or not"),
    "fans in gltf": ("gltf", gltf(meshes=[{"primitives": [{"mode": 6, "attributes": {"POSITION": 0}}]}]), "fans"),
    "nodes in nodes": ("gltf", gltf(nodes=[{"mesh": 0, "children": [n + 1, n + 1]} for n in range(40)]), "no trees"),
    "a device in gltf": ("gltf", gltf(buffers=[{"byteLength": 48, "uri": "/dev/zero"}]), "points to another file, '/dev/zero'"),
    "a file in gltf": ("gltf", gltf(buffers=[{"byteLength": 48, "uri": "../x.bin"}]), "points to another file, '../x.bin'"),
    "an address in gltf": ("gltf", gltf(images=[{"uri": "http://127.0.0.1/x"}]), "points to another file"),
    "brackets in gltf": ("gltf", b"[" * 100_000, "recursion"),
    "length of glb": ("glb", b"glTF" + struct.pack("<IIII", 2, 2**32 - 1, 2**32 - 1, 0x4E4F534A) + b"{}", "no description"),
    "an archive": ("zip", zipped("../../a.obj", OBJ + b"f 1 2 3\n"), "meshes are read from stl, obj, off, ply, glb, gltf files"),
    "a zip bomb": ("zip", zipped("a.obj", bytes(10_000_000)), "meshes are read from"),
    "a bzip2 bomb": ("bz2", bz2.compress(bytes(10_000_000)), "meshes are read from"),
    "entities in 3mf": ("3mf", zipped("3D/3dmodel.model", XML), "meshes are read from"),
    "entities in dae": ("dae", XML, "meshes are read from"),
    "entities in xaml": ("xaml", XML, "meshes are read from"),
}  # fmt: skip


def content(mesh) -> bytes:
    return json.dumps(mesh).encode() if isinstance(mesh, dict) else mesh


@pytest.mark.parametrize("what", FILES)
def test_a_hostile_file_is_refused_in_a_line(here, carom, what):
    text, place, words = FILES[what]
    Path("x.yaml").write_text(text)
    code, out, err = carom("check", "x.yaml")
    assert (code, out, err.count("\n"), os.listdir()) == (2, "", 1, ["x.yaml"])
    assert err.startswith(f"x.yaml:{place}") if place else True
    assert words in err and len(err) < 600, err


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("command", ["check", "explain"])
def test_what_is_as_large_or_small_as_may_be_is_looked_at_in_silence(here, carom, command):
    """Numbers overflow, and faces vanish, where what is looked at knows no bounds."""
    for size in ("1e-320", "1e-160", "1e12"):
        Path("m.obj").write_text(f"v 0 0 0\nv {size} 0 0\nv 0 {size} 0\nv 0 0 {size}\nf 1 2 3\nf 1 2 4\nf 2 3 4\n")
        shapes = [
            "mesh, file: m.obj", f"plane, point: [{size}, 0, {size}], normal: [{size}, 0, -{size}]",
            f"rectangle, center: [0, 0, 0], normal: [0, 1, {size}], size: [1, {size}], up: [1, 0, 0]",
            f"box, center: [{size}, 0, 0], size: [{size}, 1, {size}]",
            f"box, center: [0, 0, {size}], size: [{size}, {size}, 1], inside: true",
            f"heightfield, size: [{size}, 1], cells: [3, 2], height: '{size}*x*z/({size}+1)'",
        ]  # fmt: skip
        for shape, radius in zip(shapes * 2, ["1.0e-320"] * 6 + ["1.0e+12"] * 6):
            text = FALL.replace("original", "swept").replace("plane", shape)
            Path("x.yaml").write_text(text.replace("mass: 1", f"mass: 1\n  radius: {radius}"))
            code, out, err = carom(command, "x.yaml")
            assert (code, err) == (0, "") or (code, err.count("\n")) == (2, 1) and "inside the surface" in err, (shape, radius, err)


@pytest.mark.parametrize("command", ["explain", "sweep --dry-run --yes", "tune --error 1e-3"])
@pytest.mark.parametrize("what", ["billions of runs", "balls emitted", "frames"])
def test_every_command_refuses(here, carom, command, what):
    if (command, what) == ("tune --error 1e-3", "billions of runs"):
        return  # the matrix is not tuned
    text, place, words = FILES[what]
    Path("x.yaml").write_text(text)
    name, *options = command.split()
    code, out, err = carom(name, "x.yaml", *options)
    assert (code, out, err.count("\n")) == (2, "", 1) and err.startswith(f"x.yaml:{place}") and words in err


@pytest.mark.parametrize("what", MANY)
def test_of_very_many_mistakes_the_first_are_told(here, carom, what):
    Path("x.yaml").write_text(MANY[what])
    code, out, err = carom("check", "x.yaml")
    lines = err.splitlines()
    assert (code, out, len(lines), lines[-1]) == (2, "", 101, "... and more mistakes")
    assert all(line.startswith("x.yaml:") for line in lines[:-1])


@pytest.mark.parametrize("what", MESHES)
def test_a_hostile_mesh_is_refused_in_a_line(here, carom, what):
    ending, mesh, words = MESHES[what]
    Path(f"m.{ending}").write_bytes(content(mesh))
    Path("x.yaml").write_text(FALL.replace("shape: plane", f"shape: mesh, file: m.{ending}"))
    code, out, err = carom("check", "x.yaml")
    assert (code, out, err.count("\n")) == (2, "", 1) and len(os.listdir()) == 2
    assert err.startswith(f"x.yaml:4:26: scene.surfaces.floor.file: m.{ending} is not a mesh that can be read: ")
    assert words in err and len(err) < 600, err


def test_a_mesh_is_read_without_what_it_points_to(here, carom):
    """Materials and textures may be pipes, on which a reader would wait for ever."""
    os.mkfifo("pipe")
    Path("m.obj").write_bytes(b"mtllib pipe\n" + OBJ + b"usemtl a\nf 1 2 3\n")
    Path("m.ply").write_bytes(
        (PLY % (b"ascii", 3, b"element face 1\nproperty list uchar int vertex_indices\ncomment TextureFile pipe\n")) + b"1 0 0\n0 1 0\n3 0 1 2\n"
    )
    Path("m.gltf").write_bytes(content(gltf()))
    for name in ("m.obj", "m.ply", "m.gltf"):
        Path("x.yaml").write_text(FALL.replace("shape: plane", f"shape: mesh, file: {name}"))
        assert carom("check", "x.yaml") == (0, "x.yaml: ok, 1 runs\n", "")


def test_many_groups_are_read_as_one(here, carom):
    """Each a mesh of its own, they take the square of the time."""
    Path("m.obj").write_bytes(OBJ + b"".join(b"usemtl a%d\nf 1 2 3\n" % n for n in range(50_000)))
    facet = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"
    Path("m.stl").write_bytes(facet * 20_000)
    for name in ("m.obj", "m.stl"):
        Path("x.yaml").write_text(FALL.replace("shape: plane", f"shape: mesh, file: {name}"))
        assert carom("check", "x.yaml").code == 0


def test_an_experiment_in_a_file_whose_name_is_no_text(here, carom_process):
    """It may come from another system; what is made of it has a name that can be written."""
    Path("f\udcffll\n.yaml").write_text(FALL.replace("[hdf5]", "[]"))
    done = carom_process("sweep", "f\udcffll\n.yaml", "--dry-run", cwd=here)
    assert (done.code, done.out.split("\n")[0], done.err) == (0, "outputs/fll: 1 runs, 0 done, 1 to do", "")
    done = carom_process("check", "f\udcffll\n.yaml", cwd=here, PYTHONIOENCODING="utf-8:strict")
    assert (done.code, done.out, done.err.count("\n")) == (1, "", 1)
    done = carom_process("check", "g\udcffll\n.yaml", cwd=here)
    assert (done.code, done.out, done.err) == (2, "", "g\\udcffll\\n.yaml: no such file (did you mean 'f\\udcffll\\n.yaml'?)\n")


def test_pipes_are_no_experiments(here, carom):
    os.mkfifo("x.yaml")
    assert carom("check", "x.yaml") == (2, "", "x.yaml: is not a file\n")
    assert carom("check", "/dev/zero") == (2, "", "/dev/zero: is not a file\n")


MEMORY = """
from pathlib import Path
from runner import config, machine
from runner.errors import InputError
for path in sorted(Path().glob("*.yaml")):
    try:
        config.load(path).runs()
    except InputError:
        pass
print(machine.peak_memory() // 2**20)
"""


def test_all_of_them_take_little_memory(here):
    texts = [text for text, _, _ in FILES.values()]
    for number, (ending, mesh, _) in enumerate(MESHES.values()):
        Path(f"{number}.{ending}").write_bytes(content(mesh))
        texts.append(FALL.replace("shape: plane", f"shape: mesh, file: {number}.{ending}"))
    for number, text in enumerate(texts):
        Path(f"{number}.yaml").write_text(text)
    done = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 500


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """The output of a sweep of one run."""
    folder = tmp_path_factory.mktemp("swept")
    (folder / "fall.yaml").write_text(FALL.replace("[hdf5]", "[]"))
    runner.sweep(folder / "fall.yaml", out=folder, jobs=1)
    return folder / "fall"


DOCTORED = {
    "a list": ("provenance.json", b"[]", None),
    "a source that is none": ("provenance.json", b'{"source": 3}', None),
    "brackets": ("provenance.json", b"[" * 100_000, None),
    "a bomb": ("experiment.yaml", b"a: &a [1]\nb: &b [*a, *b]\n", "experiment.yaml:2:12: stands in itself"),
    "not the experiment": ("experiment.yaml", b"\xff\xfe", "experiment.yaml: not a text file in UTF-8"),
}


@pytest.mark.parametrize("what", DOCTORED)
def test_a_doctored_output_is_refused_in_a_line(here, carom, swept, what):
    name, content, words = DOCTORED[what]
    shutil.copytree(swept, "out")
    Path("out", name).write_bytes(content)
    code, out, err = carom("summary", "out")
    if words:
        assert (code, out, err.count("\n")) == (2, "", 1) and words in err
    else:  # what is lost is not needed here
        assert (code, err) == (0, "")
