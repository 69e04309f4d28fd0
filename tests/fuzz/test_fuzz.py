"""A short fuzz of all that reads what a user wrote; `python -m tests.fuzz` is the long one."""

import json
import warnings
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz import mutation
from tests.fuzz.targets import TARGETS

INPUTS = {"expression": 3000, "document": 15, "matrix": 60, "option": 60, "mesh": 100}  # a second each

words = st.sampled_from(["x", "z", "pi", "1", "1e308", ".5", "0", "sin", "min", "(", ")", ",", "+", "-", "*", "/", "**", " ", "y", "."])
brief = settings(derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck))


@pytest.mark.parametrize("target", TARGETS)
def test_whatever_is_read_is_refused_in_a_line_or_right(here, target):
    random, corpus = Random(0), mutation.seeds(target)
    with warnings.catch_warnings(action="error"):
        for data in (mutation.mutated(random, corpus) for _ in range(INPUTS[target])):
            TARGETS[target](data)


@settings(brief, max_examples=500)
@given(st.lists(words, max_size=40).map("".join))
def test_words_of_the_grammar_in_any_order(text):
    TARGETS["expression"](text.encode())


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
    TARGETS["document"](json.dumps(found).replace("NaN", ".nan").replace("Infinity", ".inf").encode())
