"""Imports go one way: the simulator knows numbers and nothing of experiments."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted((ROOT / "sim").rglob("*.py"))
ALLOWED = {"sim", "numpy", "annotated_types"}
# clocks, chance that numpy does not seed, processes, output
BARRED = {"time", "datetime", "timeit", "calendar", "random", "secrets", "subprocess", "multiprocessing", "threading"}
BARRED |= {"concurrent", "asyncio", "socket", "logging", "warnings", "pprint", "sys"}
SPOKEN = {"print", "open", "input", "breakpoint", "eval", "exec", "compile"}


def imports(tree):
    """The modules imported anywhere in a file, in functions too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield "." * node.level + (node.module or "")


def parse(source):
    return ast.parse(source.read_text(), str(source))


def test_there_is_something_to_look_at():
    assert len(SOURCES) > 10


@pytest.mark.parametrize("source", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_sim_imports_numpy_and_itself(source):
    allowed = ALLOWED | ({"numba", "llvmlite"} if source.name in ("jit.py", "compiler.py") else set())
    for name in imports(parse(source)):
        top = name.split(".")[0]
        assert top in allowed or top in sys.stdlib_module_names - BARRED, name


@pytest.mark.parametrize("source", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_sim_neither_prints_nor_reads_files_or_clocks(source):
    called = {node.id for node in ast.walk(parse(source)) if isinstance(node, ast.Name)}
    assert not called & SPOKEN


def test_kernels_are_numbers_in_numbers_out():
    """Of the standard library, files and the environment are for the cache in jit.py only."""
    for source in SOURCES:
        if source.name != "jit.py":
            assert not {"os", "pathlib", "tempfile", "io", "shutil"} & {n.split(".")[0] for n in imports(parse(source))}


def test_sim_imports_each_other_one_way():
    """No circle at the top of the files; an import inside a function is not one."""
    above = {}
    for source in SOURCES:
        name = ".".join(source.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        nodes = [node for node in parse(source).body if isinstance(node, (ast.Import, ast.ImportFrom))]
        names = {a.name for n in nodes if isinstance(n, ast.Import) for a in n.names}
        for n in (n for n in nodes if isinstance(n, ast.ImportFrom)):
            names |= {n.module} | {f"{n.module}.{a.name}" for a in n.names}
        above[name] = names
    above = {name: {other for other in names if other in above and other != name} for name, names in above.items()}
    for name in ("sim", "sim.integrators"):  # a package is imported with its parts, whatever it holds
        for names in above.values():
            names.discard(name)
    while above:
        free = {name for name, names in above.items() if not names & above.keys()}
        assert free, f"a circle among {sorted(above)}"
        above = {name: names for name, names in above.items() if name not in free}


@pytest.mark.parametrize("module", ["numba", "runner", "pydantic", "h5py"])
def test_importing_the_simulator_is_cheap(module):
    code = f"import sim.simulate, sys; print({module!r} in sys.modules)"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code]
    assert subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout == "False\n"
