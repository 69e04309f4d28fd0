"""Curves by themselves: their series, the motion of a damped spring, and the search for the first fall of a function."""

import importlib

import gmpy2
import numpy as np
import pytest
from gmpy2 import mpfr

from sim import jit
from sim.curves import majorant
from sim.curves.oscillation import response
from sim.engines import CURVE
from tests.sim import oracle
from tests.sim.test_touch import others


@pytest.mark.parametrize("kind", ["parabola", "oscillation", "quintic"])
def test_series(kind):
    """It gives the curve, and its slope, but for what it says it leaves out."""
    own, rng = vars(importlib.import_module(f"sim.curves.{kind}")), np.random.default_rng(11)
    names = {name: own[name] for name in CURVE if name in own}
    series, point, slope = (jit.bind(own[name], compiled=False, **names) for name in ("series", "point", "slope"))
    told = 0
    for _ in range(200):
        curve = (*(tuple(row) for row in rng.normal(size=(3, 3))), *others(rng, kind))
        s, t = rng.uniform(0, 2), 10.0 ** rng.uniform(-3, 0)
        x, rest = series(curve, s, t)
        told += rest < 1e-4
        for u in (0.1, 0.5, 1.0):
            place = sum(np.multiply(u**k, c) for k, c in enumerate(x))
            way = sum(np.multiply(k * u ** (k - 1), c) for k, c in enumerate(x) if k)
            # rounding of numbers below 1000
            assert np.linalg.norm(place - point(curve, s + u * t)) <= rest + 1e-12
            assert np.linalg.norm(way - np.multiply(t, slope(curve, s + u * t))) <= rest + 1e-12
    assert told > 100


@pytest.mark.parametrize("damping", ["any", "none", "critical", "nearly critical", "no spring", "neither"])
def test_response(damping):
    """Of b and sqrt(w2) from 1e-12 to 1e6, over 1e-9 to 1e3 s. Errors in terms of what p, q and p' are at most in a swing: where
    one passes through zero there are no more digits."""
    rng, compiled, worst = np.random.default_rng(9), jit.bind(response), 0.0
    for _ in range(400):
        root, b, s = 10.0 ** rng.uniform(-12, 6), 10.0 ** rng.uniform(-12, 6), 10.0 ** rng.uniform(-9, 3)
        w2 = 0.0 if damping in ("no spring", "neither") else root * root
        if damping in ("none", "neither"):
            b = 0.0
        elif "critical" in damping:
            b = 2 * root * (1 if damping == "critical" else 1 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-15, -3))
        p, q, dp = oracle.response(b, w2, s)
        largest = (
            gmpy2.sqrt(p * p + dp * dp / w2) if w2 else p,
            q if not w2 or b > 2 * root or root * s < np.pi else max(q, 1 / mpfr(w2)),
            gmpy2.sqrt(dp * dp + w2 * p * p),
        )
        # the phase (b + sqrt(w2)) s is itself rounded; what is below 1e-300 is nothing
        bound = 1e-14 * (1 + (b + np.sqrt(w2)) * s)
        for got, want, size in zip(compiled(b, w2, s), (p, q, dp), largest):
            worst = max(worst, float(abs(got - want) / (bound * size + mpfr(1e-300))))
    assert worst <= 1


@pytest.mark.parametrize("kind", ["oscillation", "quintic"])
def test_fall_passes_no_root(kind):
    """Against many samples in many digits: where it tells, the function is zero and falls; and before, it did not fall."""
    own, rng = vars(importlib.import_module(f"sim.curves.{kind}")), np.random.default_rng(10)
    fall, told = jit.bind(majorant.fall, **{name: own[name] for name in ("value", "dip")}), 0
    for _ in range(300):
        f, u, k, rest = rng.choice([1.0, 1e-3]) * rng.normal(), rng.normal(), 3 * rng.normal(), tuple(rng.uniform(0, 6, 2))
        line = (f, u, k, *(rest if kind == "oscillation" else rng.normal(size=3) * (6, 3, 1)))
        end = rng.uniform(0.5, 8)
        s = np.linspace(0, end, 120)
        if kind == "oscillation":
            states = [oracle.response(*line[3:], t) for t in s]
            value, slope = (lambda p, q, dp: f + u * p + k * q), (lambda p, q, dp: u * dp + k * p)
        else:
            states = [(mpfr(t),) for t in s]
            value, slope = (lambda t: oracle.at(line, t)), (lambda t: oracle.at(oracle.prime(line), t))
        above = np.array([float(value(*state)) for state in states]) > 0
        t = fall(line, 0.0, end, f < 0)
        falls = np.flatnonzero(above[:-1] & ~above[1:])
        assert t <= (s[falls[0] + 1] if len(falls) else np.inf)
        if t < np.inf:
            told += 1
            state = oracle.response(*line[3:], t) if kind == "oscillation" else (mpfr(t),)
            sizes = (f, u, k, 6.0) if kind == "oscillation" else line
            size = sum(abs(c) * t**n for n, c in enumerate(sizes))
            assert abs(value(*state)) <= 1e-14 * size and slope(*state) < 0
    assert told > 100
