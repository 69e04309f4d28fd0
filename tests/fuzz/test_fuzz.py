"""A short fuzz of all that reads what a user wrote; `python -m tests.fuzz` is the long one."""

import gc
import json
import os
import subprocess
import sys
import warnings
from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz import mutation, targets
from tests.fuzz.watch import Watched

# a second each
INPUTS = {"expression": 3000, "document": 80, "settings": 300, "matrix": 300, "option": 200, "mesh": 200}

words = st.sampled_from(["x", "z", "pi", "1", "1e308", ".5", "0", "sin", "min", "(", ")", ",", "+", "-", "*", "/", "**", " ", "y", "."])
brief = settings(derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck))


@pytest.fixture
def frozen():
    """What is there already is no garbage: to look through it takes ten times as long as to read a mesh."""
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.parametrize("target", targets.TARGETS)
def test_whatever_is_read_is_refused_in_a_line_or_right(here, frozen, target):
    targets.prepare()
    random, tried = Random(0), Watched(targets.TARGETS[target])
    with warnings.catch_warnings(action="error"):
        warnings.simplefilter("ignore", DeprecationWarning)
        for data in mutation.seeds(target):
            tried(data)
        for _ in range(INPUTS[target]):
            tried(mutation.mutated(random, target))


def burn(_):
    while True:
        pass


WRONG = {
    "writes": (lambda _: Path("y").write_text("")),
    "writes in a folder": (lambda _: os.open("../y", os.O_CREAT)),
    "moves": (lambda _: os.rename("folder.obj", "y")),
    "starts a program": (lambda _: subprocess.run(["true"])),
    "tells": (lambda _: sys.stderr.write("more")),
    "takes long": burn,
}


@pytest.mark.parametrize("what", WRONG)
def test_the_fuzz_notices_what_an_input_must_not_do(here, what):
    targets.prepare()
    with pytest.raises((AssertionError, TimeoutError)):
        Watched(WRONG[what], seconds=0.1)(b"")


def test_the_fuzz_notices_memory():
    """In a process of its own, which then is the only one to have had so much."""
    code = 'from tests.fuzz.watch import Watched; Watched(lambda _: bytes(b"x" * 600_000_000))(b"")'
    done = subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[2], capture_output=True, text=True)
    assert done.returncode == 1 and " kB" in done.stderr


@settings(brief, max_examples=500)
@given(st.lists(words, max_size=40).map("".join))
def test_words_of_the_grammar_in_any_order(text):
    targets.expression(text.encode())


# what YAML can hold, as JSON, which is YAML too
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=10), inner, max_size=4),
    max_leaves=12,
)
SETTINGS = ["scene", "balls", "solver", "duration", "record", "matrix", "expect", "charts", "name", "reference", "repeats"]


@settings(brief, max_examples=60)
@given(st.dictionaries(st.sampled_from(SETTINGS) | st.text(max_size=10), values, max_size=6))
def test_settings_of_any_kind(here, found):
    targets.document(json.dumps(found).replace("NaN", ".nan").replace("Infinity", ".inf").encode())
