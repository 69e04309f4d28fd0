"""Binding names in a call tree, and the code kept on disk."""

import os
import shutil
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from sim import advance, forces, integrators, jit, simulate, vector
from sim.simulate import EXACT, Scene, Simulation, Solver
from tests.sim.helpers import FREE, LIFT, balls

ROOT = Path(simulate.__file__).parents[1]


def python(code, root=ROOT, **environment):
    environment = {**os.environ, "PYTHONPATH": str(root), **environment}
    done = subprocess.run([sys.executable, "-c", code], env=environment, cwd=root, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def kernel(method, fields, contact="original"):
    """The kernel of a simulation with so many fields that end."""
    scene = Scene(forces={str(k): LIFT for k in range(fields)})
    return Simulation(scene, balls(FREE, FREE), Solver(method, contact=contact), 1.0, 1.0).engine.kernel


def test_bind_reaches_down_the_call_tree():
    """`acceleration` does not know SELECTIVE, what it calls does."""
    field = forces.Uniform(direction=(1, 0, 0), magnitude=3.0, until=1.0)
    packed = forces.pack([field], (0.0, 0.0, 0.0), 1.0)
    zero = (0.0, 0.0, 0.0)
    for n in (0, 1):
        bound = jit.bind(forces.acceleration, compiled=False, SELECTIVE=n)
        assert bound(0.0, zero, zero, packed) == (3.0 * n, 0.0, 0.0)


def test_bind_leaves_the_original_alone():
    before = dict(advance.__dict__), dict(forces.__dict__)
    for method in integrators.names():
        jit.bind(advance.advance, compiled=False, step=integrators.load(method)[1], SELECTIVE=2)
    assert (advance.__dict__, forces.__dict__) == before
    assert forces.SELECTIVE == 0


def test_equal_bindings_are_one_kernel():
    names = integrators.names()
    assert kernel("rk4", 0) is kernel("rk4", 0)
    kernels = [kernel(name, n, "original") for name in integrators.fixed() for n in (0, 1, 2)]
    # the methods with a fixed step share one
    kernels += {kernel(name, 0, "swept") for name in (*names, EXACT)}
    assert len(kernels) == 3 * len(integrators.fixed()) + 3
    assert kernel(EXACT, 0, "swept") is kernel(EXACT, 2, "swept")
    assert len({kernel.__qualname__ for kernel in kernels}) == len(kernels)


def test_what_a_name_does_not_reach_is_shared():
    """The contact rule is compiled once for all methods."""
    first, second = (kernel(name, n) for name, n in zip(integrators.fixed(), (0, 2)))
    shared = [k.py_func.__globals__["attempt"].py_func.__globals__["first_hit"] for k in (first, second)]
    assert shared[0] is shared[1]


def test_plain_is_plain():
    assert not hasattr(jit.bind(advance.advance, compiled=False, SELECTIVE=1), "py_func")


KEPT = """
from sim import forces, impact, jit
packed = forces.pack([forces.Uniform(direction=(1, 0, 0), magnitude=3.0, until=1.0)], (0.0, 0.0, 0.0), 1.0)
zero = (0.0, 0.0, 0.0)
for n in (0, 1):
    kernel = jit.bind(forces.acceleration, SELECTIVE=n)
    print(kernel(0.0, zero, zero, packed)[0], sum(kernel.stats.cache_hits.values()))
kernel = jit.bind(impact.rebound)
print(kernel((0.0, -3.0, 0.0), (0.0, 1.0, 0.0), 0.5, 0.0)[1], sum(kernel.stats.cache_hits.values()))
"""


@pytest.fixture
def copied(tmp_path):
    shutil.copytree(ROOT / "sim", tmp_path / "tree/sim", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "tree"


def test_disk_serves_each_its_own_code_until_a_source_changes(tmp_path, copied):
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    assert python(KEPT, copied, **cache).split() == ["0.0", "0", "3.0", "0", "3.0", "0"]
    assert python(KEPT, copied, **cache).split() == ["0.0", "1", "3.0", "1", "3.0", "1"]
    # `rebound` calls it from another file: numba alone would not notice
    source = copied / "sim/vector.py"
    source.write_text(source.read_text().replace("return x[0] * y[0] +", "return 1.0 +"))
    assert python(KEPT, copied, **cache).split() == ["0.0", "0", "3.0", "0", "1.0", "0"]


APART = """
from sim import jit, probe
kernel = jit.bind(probe.outer)
print(kernel(2.0), sum(kernel.stats.cache_hits.values()))
"""


def test_code_from_disk_finds_what_it_calls_even_where_that_was_lost(tmp_path, copied):
    """`turn` stays a function apart, so that its code is not in that of `outer`."""
    (copied / "sim/probe.py").write_text("def turn(x):\n    return 3.0 * x\n\n\ndef outer(x):\n    return turn(x) + 1.0\n")
    cache = tmp_path / "cache"
    assert python(APART, copied, XDG_CACHE_HOME=str(cache)).split() == ["7.0", "0"]
    assert python(APART, copied, XDG_CACHE_HOME=str(cache)).split() == ["7.0", "1"]
    lost = [file for file in cache.rglob("*") if "turn" in file.name]
    assert lost
    for file in lost:
        file.unlink()
    assert python(APART, copied, XDG_CACHE_HOME=str(cache)).split() == ["7.0", "1"]


MELTS = """
from sim import jit, probe
kernel = jit.bind(probe.{name})
print(kernel(2.0), sum(kernel.py_func.__globals__["middle"].stats.cache_hits.values()))
"""
MIDDLE = """
def turn(x):
    return 3.0 * x

def middle(x):
    return turn(x) + 1.0

def one(x):
    return 2.0 * middle(x)

def other(x):
    return 5.0 * middle(x)
"""


@pytest.mark.parametrize("lose", ["", "turn"])
def test_what_vanishes_into_one_function_is_on_disk_for_another(tmp_path, copied, lose):
    """`middle` does so, and calls `turn`, which stays apart: also where that was lost."""
    (copied / "sim/probe.py").write_text(MIDDLE)
    cache = tmp_path / "cache"
    assert python(MELTS.format(name="one"), copied, XDG_CACHE_HOME=str(cache)).split() == ["14.0", "0"]
    for file in cache.rglob(f"*{lose}*.nb?") if lose else ():
        file.unlink()
    assert python(MELTS.format(name="other"), copied, XDG_CACHE_HOME=str(cache)).split() == ["35.0", "1"]
    assert python(MELTS.format(name="other"), copied, XDG_CACHE_HOME=str(cache)).split() == ["35.0", "0"]  # all of it is


HANDED = """
from sim import jit, probe
kernel = jit.bind(probe.outer)
handed = [jit.typed(probe.Handed(jit.entry(each, (0.0,)))) for each in (probe.turn, probe.take)]
print(*(kernel(each, 2.0) for each in handed), len(kernel.signatures), sum(kernel.stats.cache_hits.values()))
"""
PROBE = """
from collections.abc import Callable
from typing import NamedTuple

class Handed(NamedTuple):
    function: Callable

def turn(x):
    return 3.0 * x

def take(x):
    return 5.0 * x

def outer(handed, x):
    return handed.function(x) + 1.0
"""


def test_a_kernel_calls_what_it_is_handed(tmp_path, copied):
    """Compiled once, for all functions of a signature; also where kernel and functions are from disk."""
    (copied / "sim/probe.py").write_text(PROBE)
    for hits in "01":
        assert python(HANDED, copied, XDG_CACHE_HOME=str(tmp_path / "cache")).split() == ["7.0", "11.0", "1", hits]


def test_what_is_fused_is_rounded_once():
    """As exact arithmetic tells, in kernels and in plain Python, where a product and a sum are rounded twice; also beyond numbers."""
    rng, twice = np.random.default_rng(9), 0
    kernel, plain = (jit.bind(vector.fused, compiled=compiled) for compiled in (True, False))
    for _ in range(300):
        a, (x, y) = rng.normal(), rng.normal(size=(2, 3))
        y -= rng.choice([0.0, 1.0]) * a * x  # where most cancels
        exact = tuple(float(Fraction(a) * Fraction(u) + Fraction(v)) for u, v in zip(x, y))
        assert kernel(a, tuple(x), tuple(y)) == plain(a, tuple(x), tuple(y)) == exact
        twice += exact != tuple(a * x + y)
    assert twice > 100
    beyond = 1e200, (1e200, np.inf, -np.inf), (1.0, -np.inf, np.nan)
    assert np.array_equal(kernel(*beyond), (np.inf, np.nan, np.nan), equal_nan=True)
    assert np.array_equal(plain(*beyond), (np.inf, np.nan, np.nan), equal_nan=True)


ARRAYS = """
import numpy as np
from sim import jit, probe
jit.LARGE.add("told")
row, slab = np.arange(12.0), np.arange(24, dtype=np.int32).reshape(2, 3, 4)
for array in (row, row[::3], row > 5, slab, slab[:, ::2, 1:], slab.T, slab[:, 1]):
    told = jit.bind(probe.outer)(array)
    assert told == (array.shape, array.strides, array.size, array.itemsize, array.sum()), (told, array)
"""
ASKED = """
def told(array):
    total = 0
    for k in array.flat:
        total += k
    return array.shape, array.strides, array.size, array.itemsize, total

def outer(array):
    return told(array)
"""


def test_a_function_that_stays_apart_is_handed_whole_arrays(tmp_path, copied):
    """Of any number of dimensions, side by side or not."""
    (copied / "sim/probe.py").write_text(ASKED)
    python(ARRAYS, copied, XDG_CACHE_HOME=str(tmp_path / "cache"))


def test_a_cache_that_cannot_be_written_is_replaced(tmp_path):
    (tmp_path / "file").write_text("")
    code = "from sim.jit import numba; print(numba().config.CACHE_DIR)"
    folder = python(code, XDG_CACHE_HOME=str(tmp_path / "file"), TMPDIR=str(tmp_path))
    assert folder.startswith(str(tmp_path / "carom-"))


def test_no_fast_math():
    """It would reorder sums and drop NaN checks."""
    assert not kernel("rk4", 0).targetoptions.get("fastmath", False)
