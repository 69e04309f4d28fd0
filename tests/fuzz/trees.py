"""Trees of settings, as JSON and YAML hold them, changed part by part; and written as YAML with all that it knows besides."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from copy import deepcopy
from random import Random
from typing import Any

Tree = Any
LARGEST = 2000  # parts of a tree: more would be no other code

ODD = [
    None, True, False, 0, 1, -1, 2, 0.5, -0.0, 1e-320, 1e-9, 1e9, 1e12, -1e12, 1e-12, 1e300, -1e300, 1e308, sys.float_info.max,
    float("nan"), float("inf"), -float("inf"), 2**31, 2**53 + 1, 2**63, 2**64, -(2**63), 10**308, 10**400, "", " ", "0", "nan",
    "1e3", "~", "x", "z", "a" * 65, "a" * 300, "a" * 5000, ".", "..", "../x", "../../../../x", "/", "/dev/zero", "/dev/null",
    "/proc/self/mem", "~/x", "C:\\x", "x/../../y", "mesh.obj", "link.obj", "pipe.obj", "folder.obj", "there/mesh.obj",
    "mesh.obj/x", "a\0b", "a\nb", "a\u2028b", "\u202ea", "\x1b[31m", "\u00e9", "\U0001f3b1", "\ufeff", "\u00b2", "\ud800",
    "<script>", "{{7*7}}", "%s", "{0}", "$(id)", "`id`", "0x10", "2020-01-01", "=", "<<", "9**9**9", "x**x**x", "1/0", "1/x",
    "x if x else z", "__import__('os')", "(" * 90, "min(x, z)", "sqrt(-1)", "scene.damping", "balls.mass",
    "balls.released.0.position.1", "solver", "matrix", "scene.surfaces.floor", "solver.method", "", [], {}, [[]], [{}], {"": 1},
    {"shape": "plane"}, {"shape": "mesh", "file": "mesh.obj"}, {"type": "drag", "coefficient": 1}, [0, 0, 0], [0, 1],
    [1e308, 1e308, 1e308], ["rk4", "exact"], [1, 2], "exact", "original", "swept",
]  # fmt: skip


def places(tree: Tree) -> Iterator[tuple[Tree, Any]]:
    """Each group or list in the tree with each of its keys."""
    for key in list(tree) if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ():
        yield tree, key
        yield from places(tree[key])


def pruned(random: Random, tree: Tree) -> Tree:
    """The tree with few of its larger lists and groups' parts: it is read the sooner."""
    if isinstance(tree, dict):
        kept = [key for key in tree if random.random() < 0.8 or key in ("balls", "solver", "shape", "type", "method")]
        return {key: pruned(random, tree[key]) for key in kept}
    return [pruned(random, part) for part in tree[:3]] if isinstance(tree, list) else tree


def mutated(random: Random, tree: Tree, others: list[Tree]) -> Tree:
    """A copy of `tree`, changed a few times; parts may come from the `others`."""
    root = [deepcopy(tree)]
    for _ in range(random.choice((1, 1, 1, 2, 3, 6))):
        found = list(places(root))
        if len(found) > LARGEST:
            break
        group, key = random.choice(found)
        change(random, group, key, root, others)
    return root[0]


def change(random: Random, group: Tree, key: Any, root: Tree, others: list[Tree]) -> None:
    """Change what stands at `key` in `group`."""
    value = group[key]
    match random.randrange(10):
        case 0 | 1 | 2:
            group[key] = deepcopy(random.choice(ODD))
        case 3:
            group[key] = near(random, value)
        case 4:
            inner, other = random.choice(list(places([random.choice(others)])))
            group[key] = deepcopy(inner[other])
        case 5:
            inner, other = random.choice(list(places(root)))
            group[key] = deepcopy(inner[other])
        case 6:
            del group[key]
            if not group and not root:
                root.append({})
        case 7 if isinstance(group, list):
            group[key:key] = [deepcopy(value)] * random.choice((1, 1, 2, 30))
        case 7 | 8 if isinstance(group, dict):
            inner, other = random.choice(list(places([random.choice(others)])))
            name = random.choice([str(other), str(key) + random.choice("x.0 "), str(key)[:-1], str(random.choice(ODD))[:300]])
            group[name] = deepcopy(value) if random.random() < 0.5 else group.pop(key)
        case _:
            for _ in range(random.choice((1, 1, 2, 60))):
                value = [value] if random.random() < 0.5 else {"a": value}
            group[key] = value


def near(random: Random, value: Tree) -> Tree:
    """Another value of the kind of `value`."""
    if isinstance(value, str):
        cut = random.randint(0, len(value))
        odd = random.choice([each for each in ODD if isinstance(each, str)])
        return value[:cut] + odd + value[cut + random.randint(0, 3) :]
    if isinstance(value, (int, float)):
        if not abs(value) < 1e300:
            return 1
        return random.choice([-value, value + 1, value - 1, value * 10, value / 1e3, float(value), value * 1e300, str(value)])
    if isinstance(value, list):
        return random.choice([value[::-1], value[1:], value * 2, value + [None]])
    return [value]


def yaml(random: Random, tree: Tree) -> str:
    """`tree` as YAML, in groups over lines or in braces, here and there with an anchor, an alias, a tag, a comment or a merge."""
    anchors: list[str] = []

    def oddity() -> str:
        return random.choice(["!!str ", "!x ", "!!python/object:os.system ", "!!binary ", "? ", "*a ", "&b &c ", "| ", ">- "])

    def flow(value: Tree) -> str:
        if anchors and random.random() < 0.01:
            return "*" + random.choice(anchors) + " "
        mark = ""
        if random.random() < 0.02:
            anchors.append(f"a{len(anchors)}" if random.random() < 0.9 else "a0")
            mark = f"&{anchors[-1]} "
        elif random.random() < 0.01:
            mark = oddity()
        if isinstance(value, dict):
            merge = [f"<<: *{random.choice(anchors)} "] if anchors and random.random() < 0.05 else []
            return mark + "{" + ", ".join(merge + [f"{word(key)}: {flow(each)}" for key, each in value.items()]) + "}"
        if isinstance(value, list):
            return mark + "[" + ", ".join(map(flow, value)) + "]"
        return mark + word(value)

    def word(value: Tree) -> str:
        if isinstance(value, str) and (not value.isidentifier() or random.random() < 0.1):
            return json.dumps(value, ensure_ascii=random.random() < 0.5)
        if isinstance(value, float) and value != value or value in (float("inf"), -float("inf")):
            return {"inf": ".inf", "-inf": "-.inf"}.get(str(value), ".nan")
        if isinstance(value, (bool, type(None))):
            return json.dumps(value)
        return random.choice(["0{}", "+{}", "{}_0", "{}:30"]).format(value) if random.random() < 0.01 else str(value)

    def block(value: Tree, depth: int) -> str:
        if depth < 3 and value and isinstance(value, dict) and random.random() < 0.9:
            lines = [f"{'  ' * depth}{word(key)}:{block(each, depth + 1)}" for key, each in value.items()]
            return ("\n" if depth else "") + "".join(lines)
        if depth < 3 and value and isinstance(value, list) and random.random() < 0.5:
            return "\n" + "".join(f"{'  ' * depth}- {flow(each)}\n" for each in value)
        return f" {flow(value)}{random.choice(['', '', '', '  # one'])}\n"

    return block(tree, 0)
