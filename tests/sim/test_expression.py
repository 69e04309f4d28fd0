"""The grammar of `height`: arithmetic and nothing else."""

import numpy as np
import pytest

from sim.expression import PORTION, evaluate

X, Z = np.random.default_rng(0).uniform(0.1, 2, (2, 50))

VALUES = {
    "0.3*sin(2*x)*cos(2*z)": 0.3 * np.sin(2 * X) * np.cos(2 * Z),
    "x + z - 1": X + Z - 1,
    "x - z - 1": (X - Z) - 1,
    "x / z / 2": X / Z / 2,
    "-x**2": -(X**2),
    "2**x**0.5": 2 ** (X**0.5),
    "(-x)**2 + +z": X**2 + Z,
    "exp(-x) + log(z) + tan(x)": np.exp(-X) + np.log(Z) + np.tan(X),
    "sqrt(abs(x - z))": np.sqrt(np.abs(X - Z)),
    "min(x, z) * max(x, 1)": np.minimum(X, Z) * np.maximum(X, 1),
    "sin(pi * x)": np.sin(np.pi * X),
    "1e-3 + .5 + 3": np.full(50, 3.501),
    "  x ": X,
    "x" + " + x" * 240: 241 * X,
}

HOSTILE = [
    "__import__('os')", "__import__('os').system('true')", "x.real", "x.__class__", "().__class__", "x[0]", "x < 1",
    "x == z", "lambda: 1", "(lambda: x)()", "'a'", "'a' * 9", "f'{x}'", "b'a'", "[1, 2]", "(1, 2)", "{1: 2}", "{1}",
    "[i for i in x]", "(i for i in x)", "(y := 1)", "y = 1", "x; z", "import os", "x if z else 1", "x and z", "not x",
    "x // 2", "x % 2", "x @ z", "x << 1", "~x", "x | 1", "sin(x=1)", "sin(x, y=1)", "sin(*x)", "sin(**x)", "sin()",
    "sin(x, z)", "min(x)", "min(x, z, 1)", "sin", "sin + 1", "pi(x)", "x(1)", "x x", "2x", "", " ", "#", "y", "eval",
    "print(x)", "open('a')", "sin(x)(z)", "True", "None", "...", "1j", "await x", "yield x", "*x", "\0", "x\nz",
    "(" * 300 + "1" + ")" * 300, "x" + " + x" * 250, "1" + "0" * 400, "abs(" * 200 + "x" + ")" * 200,
]  # fmt: skip


@pytest.mark.parametrize("text", VALUES)
def test_values(text):
    # the same operations in the same order, but for sums written as products here
    assert np.allclose(evaluate(text, x=X, z=Z), VALUES[text], rtol=1e-14, atol=0)


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_text_is_refused_in_one_line(text):
    with pytest.raises(ValueError) as error:
        evaluate(text, x=X, z=Z)
    assert str(error.value) and "\n" not in str(error.value) and len(str(error.value)) < 200


def test_nothing_is_executed(tmp_path):
    target = tmp_path / "made"
    with pytest.raises(ValueError):
        evaluate(f"open({str(target)!r}, 'w')", x=X, z=Z)
    assert not target.exists()


def test_deep_nesting_is_refused_or_computed():
    """Whatever the depth of the stack it is called from, no other error leaves."""
    for depth in (10, 100, 400, 990):
        try:
            assert np.array_equal(evaluate("-" * depth + "x", x=X, z=Z), X)
        except ValueError as error:
            assert "too deeply" in str(error)


def test_values_that_are_not_finite_are_values():
    for text in ("9**9**9", "10**400", "1e999", "log(-x)", "1/(x - x)"):
        assert not np.isfinite(evaluate(text, x=X, z=Z)).any()


def test_many_points_are_computed_a_portion_at_a_time():
    x, z = np.random.default_rng(1).uniform(0.1, 2, (2, 6, PORTION - 5))
    assert np.array_equal(evaluate("x**z - sin(z)", x=x, z=z), x**z - np.sin(z))
    with pytest.raises(ValueError, match="takes more than 50,000,000 operations at 98,274 points"):
        evaluate("x" + "+-x" * 300, x=x, z=z)


def test_a_constant_takes_the_shape_of_the_variables():
    assert evaluate("1", x=np.zeros((2, 3)), z=np.zeros((2, 3))).shape == (2, 3)


def test_refusals_name_what_is_known():
    with pytest.raises(ValueError, match="unknown name 'y'; known are pi, x, z"):
        evaluate("y", x=X, z=Z)
    with pytest.raises(ValueError, match="unknown function 'sinh'; known are abs, cos"):
        evaluate("sinh(x)", x=X, z=Z)
