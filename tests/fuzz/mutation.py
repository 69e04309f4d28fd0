"""Inputs made from others: bytes flipped, pieces cut out, doubled, moved and mixed, words put in that have caused trouble."""

from __future__ import annotations

import struct
from pathlib import Path
from random import Random

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
    b"property list uint int a\n", b"OFF\n", b"solid\n", b"endsolid\n", b"vertex 0 0 0\n", struct.pack("<I", 2**32 - 1),
    b'"count": 1000000000', b'"uri": "x"', b'"children": [0]', b"count: 1000000000000", b"cells: [4096, 4096]", b"name: ../x",
]  # fmt: skip


def seeds(target: str) -> list[bytes]:
    """The corpus of a target: its file, inputs between lines of `====`; and for documents the project's own."""
    found = (CORPUS / target).read_bytes().split(b"====\n")
    if target == "document":
        found += [path.read_bytes() for path in sorted(CONFIGS.rglob("*.yaml"))]
    return found


def mutated(random: Random, corpus: list[bytes]) -> bytes:
    """One of the corpus, changed a few times."""
    data = bytearray(random.choice(corpus))
    for _ in range(random.choice((1, 1, 2, 3, 5, 10))):
        start, length = random.randint(0, len(data)), random.choice((1, 1, 2, 4, 16, 64, 300))
        piece = data[start : start + length]
        match random.randrange(7):
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
    return bytes(data[:LONGEST])
