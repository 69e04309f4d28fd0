"""What of a glTF description makes triangles, and nothing else of it: no names, materials, cameras, extras or extensions.

trimesh copies what is besides with every node, decodes views as often as they are named, and takes a square of the time for
nodes in nodes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from runner.limits import DEEPEST, MOST_NODES, MOST_REPEATED
from sim.limits import MOST_TRIANGLES

TRIANGLES, STRIP = 4, 5  # modes of primitives; those below are points and lines, that above are fans
BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}  # of a number, by its componentType
NUMBERS = {"VEC3": 3, "SCALAR": 1}
UNUSED_VIEW = {"buffer": 0, "byteLength": 0}
UNUSED_NUMBERS = {"componentType": 5121, "count": 0, "type": "SCALAR"}

Tree = dict[str, Any]


def triangles_of(tree: Tree, size: int) -> Tree:
    """The description of a file of `size` bytes with only what makes triangles.

    Raises ValueError where it names other files, tells of more than there is, or parts recur; KeyError and the like where it
    is none.
    """
    for part in (*tree.get("buffers", []), *tree.get("images", [])):
        if not part.get("uri", "data:").startswith("data:"):
            raise ValueError(f"it points to another file, {part['uri'][:100]!r}; it must hold all of it itself")
    meshes = [[_only(part, "mode", "attributes", "indices") for part in mesh["primitives"]] for mesh in tree.get("meshes", [])]
    meshes = [[part for part in mesh if part.get("mode", TRIANGLES) >= TRIANGLES] for mesh in meshes]
    parts = [part for mesh in meshes for part in mesh]
    accessors, nodes = tree.get("accessors", []), tree.get("nodes", [])
    if max(len(accessors), len(nodes), len(parts)) > MOST_NODES:
        raise ValueError(f"it has more than {MOST_NODES} nodes, accessors or primitives")
    if any(part.get("mode", TRIANGLES) > STRIP for part in parts):
        raise ValueError("it has fans of triangles, which are not read")
    for part in parts:
        part["attributes"] = {"POSITION": part["attributes"]["POSITION"]}
    places, corners = {part["attributes"]["POSITION"] for part in parts}, {part["indices"] for part in parts if "indices" in part}
    views = tree.get("bufferViews", [])
    _check_numbers([accessors[index] for index in places], "VEC3", views, size)
    _check_numbers([accessors[index] for index in corners], "SCALAR", views, size)
    used = {accessors[index]["bufferView"] for index in places | corners}
    if sum(views[index]["byteLength"] for index in used) > size:
        raise ValueError("its views hold more than it does")
    counts = [sum(accessors[index]["count"] for index in _named(mesh)) for mesh in meshes]
    nodes = [_only(node, "children", "mesh", "matrix", "translation", "rotation", "scale") for node in nodes]
    for node in nodes:
        if "mesh" in node and not meshes[node["mesh"]]:
            del node["mesh"]
    _check_nodes(nodes)
    if sum(counts[node["mesh"]] for node in nodes if "mesh" in node) > min(size + MOST_REPEATED, 6 * MOST_TRIANGLES):
        raise ValueError("its nodes repeat too many triangles")
    return _only(tree, "asset", "scene") | {
        "scenes": [_only(scene, "nodes") for scene in tree.get("scenes", [])],
        "nodes": nodes,
        "meshes": [{"primitives": mesh} for mesh in meshes],
        "accessors": [
            _only(each, "bufferView", "byteOffset", "componentType", "count", "type")
            if index in places | corners else UNUSED_NUMBERS
            for index, each in enumerate(accessors)
        ],
        "bufferViews": [
            _only(each, "buffer", "byteOffset", "byteLength", "byteStride") if index in used else UNUSED_VIEW
            for index, each in enumerate(views)
        ],
        "buffers": [_only(buffer, "uri", "byteLength") for buffer in tree.get("buffers", [])],
    }  # fmt: skip


def _only(part: Tree, *names: str) -> Tree:
    return {name: part[name] for name in names if name in part}


def _named(mesh: list[Tree]) -> Iterable[int]:
    """The accessors that the primitives of a mesh name, each as often as it is named."""
    for part in mesh:
        yield part["attributes"]["POSITION"]
        if "indices" in part:
            yield part["indices"]


def _check_numbers(accessors: list[Tree], kind: str, views: list[Tree], size: int) -> None:
    """Raises ValueError for accessors that are of another kind, tell of more than there is, or hold their numbers otherwise."""
    total = 0
    for each in accessors:
        if not isinstance(each["count"], int) or not 0 <= each["count"] <= size:
            raise ValueError(f"it tells of {each['count']:,} numbers, and {size:,} bytes do not hold so many")
        if "bufferView" not in each or "sparse" in each or views[each["bufferView"]].get("extensions"):
            raise ValueError("it holds numbers compressed, or not at all")
        if each["type"] != kind:
            raise ValueError(f"an accessor is {str(each['type'])[:20]!r} where it must be {kind!r}")
        width, view = NUMBERS[kind] * BYTES[each["componentType"]], views[each["bufferView"]]
        start, stride = each.get("byteOffset", 0), view.get("byteStride", width)
        total += each["count"] * width
        # some share what they hold
        if not (0 <= start <= view["byteLength"] - stride * (each["count"] - 1) - width and width <= stride and total <= 2 * size):
            raise ValueError("it tells of numbers that it does not hold")


def _check_nodes(nodes: list[Tree]) -> None:
    """Raises ValueError where they are no trees, or go too deep."""
    children = [child for node in nodes for child in node.get("children", [])]
    parent = {child: number for number, node in enumerate(nodes) for child in node.get("children", [])}
    if len(parent) < len(children):
        raise ValueError("its nodes are no trees")
    for number in range(len(nodes)):
        for _ in range(DEEPEST):
            number = parent.get(number)
            if number is None:
                break
        else:
            raise ValueError("its nodes are nested too deeply")
