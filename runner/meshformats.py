"""The formats of mesh files, and what of a file goes on to trimesh: triangles, and nothing that points to other files.

trimesh opens what a file names (materials, textures, buffers), unpacks archives whole, and takes a square of the time for
many groups or list properties. So a file is looked at before, and is refused when it announces more than it holds.
"""

from __future__ import annotations

import io
import json
import re
import struct
from collections import Counter
from typing import Any

from runner.limits import LONGEST_HEADER, LONGEST_JSON, MOST_NODES, MOST_PROPERTIES
from sim.limits import MOST_TRIANGLES

STL_HEADER, STL_FACET = 84, 50  # bytes
GLB_HEADER, GLB_CHUNK, GLB_JSON = "<4sII", "<II", 0x4E4F534A


def check_head(kind: str, head: bytes, size: int) -> None:
    """Raises ValueError where a file that begins with `head`, of `size` bytes, is none of the format `kind`."""
    if not size:  # so say the system's own files, too, some of which never end
        raise ValueError("it is empty")
    if kind not in FORMATS:
        raise ValueError(f"meshes are read from {', '.join(FORMATS)} files")
    if kind == "stl" and not _is_text(head, b"solid"):
        count = int.from_bytes(head[80:84], "little")
        if size != STL_HEADER + STL_FACET * count:
            raise ValueError(f"its header tells of {count:,} triangles, and {size:,} bytes do not hold so many")
    elif kind == "ply" and not head.startswith(b"ply") or kind == "glb" and not head.startswith(b"glTF"):
        raise ValueError("it does not begin as one")
    elif kind in ("obj", "off", "gltf") and b"\0" in head:
        raise ValueError("it is not a text")


def stl(data: bytes) -> bytes:
    if not _is_text(data, b"solid"):
        return data
    # one solid of all of them
    return b"solid\n%s\nendsolid" % b"\n".join(re.findall(rb"(?i)vertex[ \t][^\n]*", data))


def obj(data: bytes) -> bytes:
    """Vertices and faces: no materials, no groups."""
    joined = data.replace(b"\r\n", b"\n").replace(b"\\\n", b" ")
    return b"\n".join(re.findall(rb"^[ \t]*[vf][ \t][^\n]*", joined, re.MULTILINE))


def off(data: bytes) -> bytes:
    """Without comments, and a line at a time: all at once they take 50 times their size."""
    return b"\n".join(filter(None, (line.partition(b"#")[0].strip() for line in io.BytesIO(data))))


def ply(data: bytes) -> bytes:
    end = data.find(b"end_header", 0, LONGEST_HEADER)
    if end < 0:
        raise ValueError("its header has no end")
    lines = data[:end].splitlines()
    if len([line for line in lines if line.split()[:1] == [b"property"]]) > MOST_PROPERTIES:
        raise ValueError(f"its elements have more than {MOST_PROPERTIES} properties")
    for line in lines:
        words = line.split()
        if words[:1] == [b"element"] and not 0 <= int(words[-1]) <= len(data):
            raise ValueError(f"its header tells of {int(words[-1]):,} elements, and {len(data):,} bytes do not hold so many")
    return data


def gltf(data: bytes) -> bytes:
    _check_tree(json.loads(data[:LONGEST_JSON]), len(data))
    return data


def glb(data: bytes) -> bytes:
    length, kind = struct.unpack_from(GLB_CHUNK, data, 12)
    if kind != GLB_JSON or length > min(len(data), LONGEST_JSON):
        raise ValueError(f"it has no description of at most {LONGEST_JSON:,} bytes")
    _check_tree(json.loads(data[20 : 20 + length]), len(data))
    return data


FORMATS = {"stl": stl, "obj": obj, "off": off, "ply": ply, "glb": glb, "gltf": gltf}


def _is_text(data: bytes, start: bytes) -> bool:
    return data[:1000].lstrip()[: len(start)].lower() == start and b"\0" not in data[:1000]


def _check_tree(tree: dict[str, Any], size: int) -> None:
    """Raises ValueError for a description that names other files, tells of more than there is, or in which parts recur."""
    for part in (*tree.get("buffers", []), *tree.get("images", [])):
        if not part.get("uri", "data:").startswith("data:"):
            raise ValueError(f"it points to another file, {part['uri'][:100]!r}; it must hold all of it itself")
    accessors, nodes, meshes = (tree.get(name, []) for name in ("accessors", "nodes", "meshes"))
    if max(len(accessors), len(nodes)) > MOST_NODES:
        raise ValueError(f"it has more than {MOST_NODES} nodes or accessors")
    counts = [each["count"] for each in accessors]
    if not all(isinstance(count, int) and 0 <= count <= size for count in counts):
        raise ValueError(f"it tells of {max(counts):,} numbers, and {size:,} bytes do not hold so many")
    if sum(count for count, each in zip(counts, accessors) if "bufferView" not in each) > size:
        raise ValueError("it tells of numbers that it does not hold")
    parents = Counter(child for node in nodes for child in node.get("children", []))
    if max(parents.values(), default=0) > 1:
        raise ValueError("its nodes are no trees")
    corners = [sum(counts[part["indices"]] for part in mesh["primitives"] if "indices" in part) for mesh in meshes]
    if sum(corners[node["mesh"]] for node in nodes if "mesh" in node) > 3 * MOST_TRIANGLES:
        raise ValueError(f"it has more than {MOST_TRIANGLES:,} triangles")
