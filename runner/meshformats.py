"""The formats of mesh files, and what of a file goes on to trimesh: triangles, and nothing that points to other files.

trimesh opens what a file names (materials, textures, buffers), unpacks archives whole, and takes a square of the time for
many groups or list properties. So a file is looked at before, goes on without all that makes no triangles, and is refused
when it announces more than it holds.
"""

from __future__ import annotations

import io
import json
import re
import struct

from runner.gltf import triangles_of
from runner.limits import LONGEST_HEADER, LONGEST_JSON, MOST_PROPERTIES

STL_HEADER, STL_FACET = 84, 50  # bytes
PLY_LINES = {b"ply", b"format", b"element", b"property"}
PLY_NAMES = {b"x", b"y", b"z", b"vertex_index", b"vertex_indices"}
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
    vertices = b"\n".join(re.findall(rb"(?i)vertex[ \t][^\n]*", data))
    if re.search(rb"(?i)solid|normal", vertices):
        raise ValueError("a vertex is more than its numbers")
    return b"solid\n%s\nendsolid" % _numbers(vertices)


def obj(data: bytes) -> bytes:
    """Vertices and faces: no materials, no groups, of a corner no more than its vertex."""
    joined = data.replace(b"\r\n", b"\n").replace(b"\\\n", b" ")
    lines = b"\n".join(re.findall(rb"^[ \t]*([vf][ \t][^\n]*)", joined, re.MULTILINE))
    return _numbers(re.sub(rb"/[^ \t\n]*", b"", lines))


def off(data: bytes) -> bytes:
    """Without comments, a line at a time: all at once they take 50 times their size. Polygons become triangles here."""
    text = _numbers(b"\n".join(filter(None, (line.partition(b"#")[0].strip() for line in io.BytesIO(data)))))
    head = re.match(rb"[A-Z]*OFF\s+(\d+)\s+(\d+)[^\n]*\n", text)
    if not head:
        raise ValueError("its header tells of no vertices and faces")
    vertices, faces = map(int, head.groups())
    lines = text[head.end() :].split(b"\n")
    if vertices + faces > len(lines):
        raise ValueError(f"its header tells of {vertices + faces:,} vertices and faces, and it has {len(lines):,} lines")
    polygons = []
    for line in lines[vertices : vertices + faces]:
        count, *corners = line.split()
        corners = corners[: int(count)]
        fan = len(corners) > 4  # with which trimesh fails
        polygons += [b"3 %s %s %s" % (corners[0], *pair) for pair in zip(corners[1:], corners[2:])] if fan else [line]
    return b"\n".join([b"OFF", b"%d %d 0" % (vertices, len(polygons)), *lines[:vertices], *polygons])


def ply(data: bytes) -> bytes:
    """With a header of those lines, and by those names, that make triangles."""
    end = re.search(rb"^[ \t]*end_header[ \t]*\r?\n", data[:LONGEST_HEADER], re.MULTILINE)
    if not end:
        raise ValueError("its header has no end")
    lines = [words for line in data[: end.start()].splitlines() if (words := line.split())[:1] and words[0] in PLY_LINES]
    if len([words for words in lines if words[0] == b"property"]) > MOST_PROPERTIES:
        raise ValueError(f"its elements have more than {MOST_PROPERTIES} properties")
    element = b""
    for number, words in enumerate(lines):
        if words[0] == b"element":
            element, count = words[1:]
            if not 0 <= int(count) <= len(data):
                raise ValueError(f"its header tells of {int(count):,} elements, and {len(data):,} bytes do not hold so many")
        elif words[0] == b"property" and words[-1] not in PLY_NAMES:
            words[-1] = b"other%d" % number
        if words[:2] == [b"property", b"list"] and element == b"vertex":
            raise ValueError("its vertices hold lists")
        if words[:2] == [b"element", b"edge"]:
            words[1] = b"other"
    return b"\n".join([*map(b" ".join, lines), b"end_header\n"]) + data[end.end() :]


def gltf(data: bytes) -> bytes:
    return json.dumps(triangles_of(json.loads(data[:LONGEST_JSON]), len(data))).encode()


def glb(data: bytes) -> bytes:
    length, kind = struct.unpack_from(GLB_CHUNK, data, 12)
    if kind != GLB_JSON or length > min(len(data), LONGEST_JSON):
        raise ValueError(f"it has no description of at most {LONGEST_JSON:,} bytes")
    text = json.dumps(triangles_of(json.loads(data[20 : 20 + length]), len(data))).encode()
    rest = data[20 + length :]
    rest = rest[: 8 + int.from_bytes(rest[:4], "little")]  # the chunk of its numbers; there are no others that mean anything
    head = struct.pack(GLB_HEADER, b"glTF", 2, 20 + len(text) + len(rest))
    return head + struct.pack(GLB_CHUNK, len(text), GLB_JSON) + text + rest


FORMATS = {"stl": stl, "obj": obj, "off": off, "ply": ply, "glb": glb, "gltf": gltf}


def _numbers(text: bytes) -> bytes:
    """`text`. Raises ValueError for what is in no number: trimesh would look for a coding that it makes sense in."""
    if not text.isascii():
        raise ValueError("there is more than numbers in a line of them")
    return text


def _is_text(data: bytes, start: bytes) -> bool:
    return data[:1000].lstrip()[: len(start)].lower() == start and b"\0" not in data[:1000]
