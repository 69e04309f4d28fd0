"""Values check themselves when they are built."""

import numpy as np
import pytest

from sim.model import Invalid, unit
from sim.simulate import Scene


def test_invalid_names_field_and_reason():
    with pytest.raises(Invalid) as error:
        Scene(damping=1.5)
    assert (error.value.field, error.value.reason) == ("damping", "must be <= 1")
    assert str(error.value) == "damping: must be <= 1"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 10**400])
def test_numbers_are_finite(value):
    with pytest.raises(Invalid, match="damping: must be finite"):
        Scene(damping=value)


def test_borders_are_inside():
    assert Scene(damping=0, restitution=0).damping == 0
    assert Scene(damping=1, restitution=1).restitution == 1


@pytest.mark.parametrize("size", [5e-324, 1e-200, 1.0, 1e200, 1.7e308])
def test_unit_of_any_length(size):
    assert np.array_equal(unit("normal", (0, -size, 0)), (0, -1, 0))
    assert np.linalg.norm(unit("normal", (size, size, -size))) == pytest.approx(1, rel=4e-16)  # two roundings
