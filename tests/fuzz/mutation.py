"""Inputs made from others: bytes flipped, pieces cut out, doubled, moved and mixed, words and numbers put in that have caused
trouble; and where an input is a tree, as JSON or YAML are, its parts changed as such."""

from __future__ import annotations

import json
import re
import struct
from functools import cache
from pathlib import Path
from random import Random

from runner import yamltext
from tests.fuzz import trees

CORPUS = Path(__file__).parent / "corpus"
CONFIGS = Path(__file__).parents[2] / "configs"
LONGEST = 20_000  # bytes of an input

WORDS = [
    b"1e400", b"-1e400", b".inf", b".nan", b"9" * 400, b"0x" + b"f" * 300, b"1e-400", b"2**63", b"-0", b"~", b"null", b"<<: *a",
    b"&a ", b"*a", b"!!python/object ", b"!x ", b"? ", b": ", b"- ", b"[" * 60, b"{a: " * 60, b"---\n", b"%YAML 1.1\n", b"\\0",
    b"\0", b"\xff", "\ud800".encode("utf-8", "surrogatepass"), '"\\ud800"'.encode(), "\u00b2".encode(), b"../../x", b"/dev/zero",
    b"x.__class__", b"__import__('os')", b"9**9**9", b"lambda: 1", b"(" * 90, b"sin(", b"min(x, z)", b"zip: ", b"exclude: ",
    b"include: ", b"solver.step: [1, 2]", b"balls.mass: [1]", b"scene.surfaces: [{}]", b"usemtl a\n", b"mtllib /dev/zero\n",
    b"f 1 2 3\n", b"v 0 0 0\n", b"f -1 -2 -3\n", b"f 1/1/1 2/2 3//3 4\n", b"end_header\n", b"element face 1000000000\n",
    b"property list uint int a\n", b"OFF\n", b"solid\n", b"endsolid\n", b"vertex 0 0 0\n", b" endsolid solid ", b"comment ",
    b"element edge 2\n", b"vertex1 ", b"big_endian", b"\\\n", b"\r", b"\x0c", "\u2003".encode(), b"#", b"count: 1000000000000",
    b"cells: [4096, 4096]", b"name: ../x", b"+x*2+(", b"**x",
]  # fmt: skip
NUMBERS = [
    b"0", b"-1", b"1", b"2", b"255", b"65536", b"1000000000", b"4294967295", b"9223372036854775807", b"-9223372036854775808",
    b"1e9", b"0.5", b"nan", b"inf", b"1e308", b"-1e-320", b"1_0",
]  # fmt: skip
BINARY = [struct.pack(form, value) for form, value in (
    ("<I", 0), ("<I", 2**31), ("<I", 2**32 - 1), (">I", 1), ("<H", 2**16 - 1), ("<f", float("nan")), ("<f", float("inf")),
    ("<f", 3e38), ("<d", 1e308), ("<q", 2**62), ("<q", -1),
)]  # fmt: skip
TREES = {"settings", "matrix"}  # whose inputs are JSON, which is read in a thousandth of the time


@cache
def seeds(target: str) -> list[bytes]:
    """The corpus of a target: its file, inputs between lines of `====`; and of documents and settings the project's own."""
    found = (CORPUS / target).read_bytes().split(b"====\n")
    if target in ("document", "settings"):
        own = [path.read_bytes() for path in sorted(CONFIGS.rglob("*.yaml"))]
        found += own if target == "document" else [json.dumps(yamltext.read(text.decode())).encode() for text in own]
    return found


@cache
def parts(target: str) -> list[trees.Tree]:
    """The trees in the corpus of a target."""
    texts = seeds("settings") if target == "document" else seeds(target) if target in TREES else []
    return [json.loads(text) for text in texts] + [tree for data in seeds(target) if (tree := description(data)[0])]


def mutated(random: Random, target: str, data: bytes | None = None) -> bytes:
    """`data`, or one of the corpus, changed a few times."""
    data = random.choice(seeds(target)) if data is None else data
    if target in TREES and random.random() < 0.95:
        tree = found if (found := read(data)) is not None else random.choice(parts(target))
        return json.dumps(trees.mutated(random, trees.pruned(random, tree), parts(target))).encode()
    if target == "document" and random.random() < 0.6:
        tree = trees.mutated(random, trees.pruned(random, random.choice(parts(target))), parts(target))
        data = trees.yaml(random, tree).encode("utf-8", "surrogatepass")
        return data if random.random() < 0.7 else scrambled(random, data, seeds(target))
    tree, pack = description(data) if target == "mesh" else (None, None)
    if tree is not None and random.random() < 0.9:
        return pack(json.dumps(trees.mutated(random, tree, parts(target))).encode())
    return scrambled(random, data, seeds(target))


def read(data: bytes) -> trees.Tree:
    """The JSON in `data`, or None."""
    try:
        return json.loads(data)
    except (ValueError, RecursionError):
        return None


def description(data: bytes) -> tuple[trees.Tree, object]:
    """The description in a glTF file, and what puts another into its place; None where it is none."""
    kind, _, content = data.partition(b"\n")
    if kind == b"gltf":
        return read(content), lambda text: b"gltf\n" + text
    if kind == b"glb" and len(content) > 20:
        end = 20 + struct.unpack_from("<I", content, 12)[0]
        rest = content[end:]
        return read(content[20:end]), lambda text: b"glb\n" + b"".join(
            [struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A), text, rest]
        )
    return None, None


def scrambled(random: Random, data: bytes, corpus: list[bytes]) -> bytes:
    """`data` changed a few times as bytes."""
    data = bytearray(data)
    for _ in range(random.choice((1, 1, 2, 3, 5, 10))):
        start, length = random.randint(0, len(data)), random.choice((1, 1, 2, 4, 16, 64, 300))
        piece = data[start : start + length]
        match random.randrange(10):
            case 0 if data:
                data[start % len(data)] ^= 1 << random.randrange(8)
            case 1:
                del data[start : start + length]
            case 2:
                data[start:start] = piece * random.choice((1, 1, 2, 100))
            case 3:
                to = random.randint(0, len(data))
                data[to : to + length] = piece
            case 4:
                other = random.choice(corpus)
                cut = random.randint(0, len(other))
                data[start : start + length] = other[cut : cut + random.choice((4, 30, 300))]
            case 5 | 6:
                data[start : start + random.choice((0, 0, length))] = random.choice(WORDS)
            case 7 if numbers := list(re.finditer(rb"\d+", data)):
                begin, end = random.choice(numbers).span()
                data[begin:end] = random.choice(NUMBERS)
            case 8:
                value = random.choice(BINARY)
                data[start : start + len(value)] = value
            case 9 if random.random() < 0.1:
                del data[start:]
    return bytes(data[:LONGEST])
