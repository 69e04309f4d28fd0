"""The map of `configs/stability.yaml`: what is measured borders on what theory says."""

import math
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from runner.chart.stability import THEORY, UNSTABLE, limit
from runner.config import load
from runner.execute import run
from sim import integrators
from tests.sim.test_methods import amplification

FILE = Path(__file__).parent.parent / "configs" / "stability.yaml"
FIELDS = {"well": "stiffness", "air": "coefficient"}
RATES = {"stiffness": math.sqrt, "coefficient": float}  # 1/s, for a ball of 1 kg


@pytest.fixture(scope="module")
def rows():
    """The runs by method and field, a list for each of its strengths from the shortest step to the longest."""
    found = defaultdict(lambda: defaultdict(list))
    for each in load(FILE).runs():
        (name, field) = max(each.setup.scene.forces.items(), key=lambda pair: getattr(pair[1], FIELDS[pair[0]]))
        found[each.setup.solver.method, FIELDS[name]][getattr(field, FIELDS[name])].append(each)
    return {
        key: {strength: sorted(runs, key=lambda each: each.setup.solver.step) for strength, runs in by_strength.items()}
        for key, by_strength in found.items()
    }


def unstable(one):
    """Whether the chart shows the run as unstable."""
    result = run(one)
    return result.status == "diverged" or result.summary["energy_final"] > UNSTABLE * result.summary["energy_initial"]


@pytest.mark.parametrize("field", THEORY)
@pytest.mark.parametrize("method", integrators.fixed())
def test_the_border_is_that_of_theory(rows, method, field):
    """To the cell: the last cell below the claimed limit is stable and the first above it is not; but for pefrl, where one may lie
    on an island of stability that theory has there, too."""
    claim, told = limit(THEORY[field], method), []
    for strength, runs in rows[method, field].items():
        products = [each.setup.solver.step * RATES[field](strength) for each in runs]
        beyond = sum(z <= claim for z in products)
        for z, each in list(zip(products, runs))[max(beyond - 1, 0) : beyond + 1]:
            # on the limit itself it is a matter of rounding, or of growth in proportion to time
            if not math.isclose(z, claim, rel_tol=0.01):
                told.append((z, unstable(each)))
    assert len(told) >= len(rows[method, field])
    w2, b = (1.0, 0.0) if field == "stiffness" else (0.0, 1.0)
    wrong = [z for z, grows in told if grows != (z > claim)]
    # 1e-7: two eigenvalues that meet on the unit circle are known to the root of the rounding only
    assert [z for z in wrong if z < claim or np.abs(np.linalg.eigvals(amplification(method, z, w2, b))).max() > 1 + 1e-7] == []
    assert len(wrong) <= (1 if method == "pefrl" else 0)
