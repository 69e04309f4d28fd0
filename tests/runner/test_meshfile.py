"""Mesh files by hand: what is read, where it is put, and what is refused."""

import base64
import json
import os
from pathlib import Path

import numpy as np
import pytest

from runner import config, meshfile
from sim.model import Invalid

pytestmark = pytest.mark.filterwarnings("error")

#: A triangle with corners (0, 0, 0), (1, 0, 0), (0, 2, 0) in three formats; {} is a coordinate.
TRIANGLE = {
    "obj": "v 0 0 0\nv {} 0 0\nv 0 2 0\nf 1 2 3\n",
    "off": "OFF\n3 1 0\n0 0 0\n{} 0 0\n0 2 0\n3 0 1 2\n",
    "stl": "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex {} 0 0\nvertex 0 2 0\n"
    "endloop\nendfacet\nendsolid s\n",
}
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 2, 0]]

NOT_MESHES = {
    "nothing.obj": "",
    "words.obj": "hello\n",
    "points.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
    "beyond.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
    "beyond.off": "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
    "broken.ply": "ply\nformat ascii 1.0\nend",
    "letter.txt": "Dear mesh",
    "none": "no ending",
}


def read(path, scale=1.0, translate=(0.0, 0.0, 0.0), rotate=(0.0, 0.0, 0.0)):
    return meshfile.read(path, meshfile.digest(path), scale, translate, rotate)


@pytest.mark.parametrize("kind", TRIANGLE)
def test_formats_give_the_same_triangle(tmp_path, kind):
    path = tmp_path / f"t.{kind}"
    path.write_text(TRIANGLE[kind].format(1))
    triangles = read(path)
    assert triangles.vertices[triangles.corners].tolist() == [CORNERS]


PENTAGON = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 2, 0], [0, 1, 0]]
PLACES = [" ".join(map(str, place)) for place in PENTAGON]
FAN = [[PENTAGON[0], PENTAGON[k], PENTAGON[k + 1]] for k in (1, 2, 3)]
FACETS = "".join("outer loop\nvertex {} {} {}\nvertex {} {} {}\nvertex {} {} {}\nendloop\n".format(*a, *b, *c) for a, b, c in FAN)

#: The same with much that makes no triangles: colours, normals, textures, lines, names that are no UTF-8.
RICH = {
    "obj": "# \u00e9\nmtllib a.mtl\no \u00e9\ng b\n" + "".join(f"v {place} 1 0.5 0\n" for place in PLACES)
    + "vt 0 0\nvn 0 0 1\nusemtl c\nf 1/1/1 2/1/1 3/1/1\ns 1\ng d\nf 1//1 3//1 4//1 5//1\nl 1 2\np 1\n",
    "off": "COFF # \u00e9\n\n5 2 0\n" + "".join(f"{place} 255 0 0\n" for place in PLACES) + "5 0 1 2 3 4 255 0 0\n2 0 1\n",
    "stl": f"solid \u00e9\nfacet normal 0 0 1\n{FACETS}endfacet\nendsolid \u00e9\nsolid none\nendsolid none\n",
    "ply": "ply\nformat ascii 1.0\ncomment \u00e9\nobj_info x\nelement vertex 5\nproperty float s\nproperty float t\nproperty float x\n"
    "property float y\nproperty float z\nproperty uchar red\nproperty float nx\nelement face 2\n"
    "property list uchar int vertex_indices\nproperty list uchar float texcoord\nelement edge 1\nproperty int vertex1\n"
    "property int vertex2\nend_header\n" + "".join(f"0 1 {place} 9 8\n" for place in PLACES) + "3 0 1 2 2 7 7\n4 0 2 3 4 2 7 7\n0 1\n",
}


@pytest.mark.parametrize("kind", RICH)
def test_polygons_are_read_without_what_makes_no_triangles(tmp_path, kind):
    path = tmp_path / f"t.{kind}"
    path.write_bytes(RICH[kind].encode("latin-1"))
    triangles = read(path)
    found = triangles.vertices[triangles.corners].tolist()
    assert sorted(min(each[k:] + each[:k] for k in range(3)) for each in found) == sorted(FAN)


def described(**parts) -> dict:
    """A triangle in glTF twice: its node's matrix and a child put it in other places."""
    numbers = np.array(CORNERS, "<f4").tobytes() + np.arange(3, dtype="<u2").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(numbers).decode()
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [
            {"mesh": 0, "children": [1], "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]},
            {"mesh": 0, "translation": [0, 0, 7], "scale": [2, 2, 2]},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": 42, "uri": uri}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
    } | parts  # fmt: skip


#: A quarter turn about z and 5 m along x; and before that to twice the size and 7 m along z.
TURNED = [[[5, 0, 0], [5, 1, 0], [3, 0, 0]], [[5, 0, 7], [5, 2, 7], [1, 0, 7]]]


def test_gltf_is_read_without_what_makes_no_triangles(tmp_path):
    rich = described()
    triangle = rich["meshes"][0]["primitives"][0]
    triangle["attributes"] |= {"NORMAL": 2, "COLOR_0": 2, "_X": 2}
    triangle |= {"material": 0, "extensions": {"X": {}}, "extras": [1]}
    for mode in (0, 1, 3):  # points and lines
        rich["meshes"][0]["primitives"].append({"mode": mode, "attributes": {"POSITION": 0}})
    rich["meshes"].append({"primitives": [{"mode": 1, "attributes": {"POSITION": 0}}]})
    rich["accessors"].append({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {}})
    rich["bufferViews"].append({"buffer": 0, "byteLength": 36, "extensions": {"X": {}}})
    rich |= {"cameras": [{}], "materials": [{}], "extras": {"a": 1}, "animations": [{}]}
    top, child = rich["nodes"]
    camera, lines = {"camera": 0, "children": [1], "name": "world"}, {"mesh": 1, "children": [3]}
    rich["nodes"] = [camera, top | {"children": [2]}, lines, child | {"extras": 1}]
    for name, tree in {"plain": described(), "rich": rich}.items():
        (tmp_path / f"{name}.gltf").write_text(json.dumps(tree))
        triangles = read(tmp_path / f"{name}.gltf")
        assert np.allclose(sorted(triangles.vertices[triangles.corners].tolist()), TURNED, atol=1e-15), name


@pytest.mark.parametrize("kind", ["obj", "off", "stl"])
def test_a_mesh_does_not_end_at_what_is_no_number(fault, kind):
    """numpy would read no further, and tell nobody."""
    Path(f"t.{kind}").write_text(RICH[kind].replace("2 1 0", "2 1,0 0").replace("\u00e9", "e"))
    assert fault(f"t.{kind}").startswith(f"{PLACE}t.{kind} is not a mesh that can be read")


def corners_of(triangles):
    """The three corners of the first triangle, in its own order."""
    return triangles.vertices[triangles.corners[0]]


def test_scaled_then_turned_about_x_y_z_then_moved(tmp_path):
    path = tmp_path / "t.obj"
    path.write_text(TRIANGLE["obj"].format(1))
    assert np.allclose(corners_of(read(path, 3.0)), 3 * np.array(CORNERS), rtol=1e-15)
    # a quarter turn is exact but for the rounding of cos(90 degrees), 6e-17
    for rotate, expected in {
        (90.0, 0.0, 0.0): [[0, 0, 0], [1, 0, 0], [0, 0, 2]],
        (0.0, 90.0, 0.0): [[0, 0, 0], [0, 0, -1], [0, 2, 0]],
        (0.0, 0.0, 90.0): [[0, 0, 0], [0, 1, 0], [-2, 0, 0]],
        (90.0, 90.0, 0.0): [[0, 0, 0], [0, 0, -1], [2, 0, 0]],  # about x first
    }.items():
        assert np.allclose(corners_of(read(path, rotate=rotate)), expected, atol=1e-15), rotate
    moved = read(path, 2.0, (1.0, 2.0, 3.0), (0.0, 0.0, 90.0))
    assert np.allclose(corners_of(moved), [[1, 2, 3], [1, 4, 3], [-3, 2, 3]], atol=1e-15)


@pytest.fixture
def fault(here, carom, fall):
    """The one fault that `carom check` tells of a file whose floor is the mesh `name`."""

    def told(name: str) -> str:
        Path("fall.yaml").write_text(fall.replace("{shape: plane}", f"{{shape: mesh, file: {name}}}"))
        code, out, err = carom("check", "fall.yaml")
        assert (code, out, err.count("\n")) == (2, "", 1)
        return err.strip()

    return told


PLACE = "fall.yaml:4:26: scene.surfaces.floor.file: "


@pytest.mark.parametrize("kind", TRIANGLE)
@pytest.mark.parametrize("number", ["nan", "inf"])
def test_vertices_that_are_no_numbers_are_refused(fault, kind, number):
    Path(f"t.{kind}").write_text(TRIANGLE[kind].format(number))
    assert fault(f"t.{kind}") == f"{PLACE}t.{kind}: 1 of 3 vertices are not finite"


@pytest.mark.parametrize("name", NOT_MESHES)
def test_what_is_no_mesh_is_refused(fault, name):
    Path(name).write_text(NOT_MESHES[name])
    told = fault(name)
    assert told.startswith(f"{PLACE}{name}") and (
        "has no triangles" in told or "is not a mesh that can be read" in told
    )


def test_binary_that_is_no_mesh_is_refused(fault):
    Path("b.stl").write_bytes(bytes(range(200)))
    assert fault("b.stl").startswith(f"{PLACE}b.stl is not a mesh that can be read")


def test_folders_and_pipes_are_no_files(fault):
    os.mkdir("d.obj")
    os.mkfifo("p.obj")  # opening it would wait for ever
    for name in ("d.obj", "p.obj", "/dev/zero", '""'):
        assert fault(name).startswith(PLACE) and fault(name).endswith("is not a file")


def test_a_file_is_found_beside_the_experiment_wherever_one_calls_from(tmp_path, monkeypatch, fall):
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    (tmp_path / "a" / "t.obj").write_text(TRIANGLE["obj"].format(1))
    (folder / "x.yaml").write_text(fall.replace("{shape: plane}", "{shape: mesh, file: ../t.obj}"))
    monkeypatch.chdir("/")
    found = config.load(folder / "x.yaml").base
    assert found.setup.scene.build(found.folder).surfaces["floor"].vertices.tolist() == CORNERS
    monkeypatch.chdir(folder)
    assert config.load("x.yaml").base.run_id == found.run_id


def test_another_content_under_the_same_name_is_another_run(here, fall):
    Path("x.yaml").write_text(fall.replace("{shape: plane}", "{shape: mesh, file: t.obj}"))

    def run_id(content):
        Path("t.obj").write_text(content)
        return config.load("x.yaml").base.run_id

    first, other = run_id(TRIANGLE["obj"].format(1)), run_id(TRIANGLE["obj"].format(2))
    assert first != other and first == run_id(TRIANGLE["obj"].format(1))


def test_a_file_changed_since_the_plan_is_noticed(here, fall):
    Path("x.yaml").write_text(fall.replace("{shape: plane}", "{shape: mesh, file: t.obj}"))
    Path("t.obj").write_text(TRIANGLE["obj"].format(1))
    run = config.load("x.yaml").base
    assert config.resolve(run.parameters, run.folder).run_id == run.run_id
    Path("t.obj").write_text(TRIANGLE["obj"].format(2))
    with pytest.raises(ValueError, match="not the file that it was when the run was planned"):
        config.resolve(run.parameters, run.folder)


def test_the_digest_of_what_is_not_there():
    with pytest.raises(Invalid, match="there is no file nowhere.obj"):
        meshfile.digest(Path("nowhere.obj"))
