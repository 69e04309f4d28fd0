"""Blocks of lanes: what a ball does depends on its own data and nothing else."""

from functools import partial

import numpy as np
import pytest

from sim import integrators, jit
from sim.model import Balls
from tests.sim.helpers import CORRIDOR, LIFT, fly, random_balls, room

MANY = 200  # four blocks, the last one not full
FIELDS = {"corridor": CORRIDOR, "lift": LIFT}


def start():
    return random_balls(1, MANY, released=0.0173 * (np.arange(MANY) % 40), lifetime=0.7119, radius=0.1)


def some(balls, which):
    return Balls(
        balls.mass, balls.radius, balls.lifetime, balls.released[which], balls.position[which], balls.velocity[which]
    )


def of(bounces, ball):
    """The impacts of one ball without its number."""
    mine = bounces[bounces["ball"] == ball]
    return mine[[name for name in mine.dtype.names if name != "ball"]]


@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize(
    "which",
    [[0], [199], np.arange(63), np.arange(64), np.arange(65), np.arange(MANY)[::-1], np.arange(5, MANY, 3), [7] * 70],
    ids=["first", "last", "63", "64", "65", "backwards", "every third", "one 70 times"],
)
@pytest.mark.parametrize("fields", [{}, FIELDS], ids=["free", "fields"])
def test_company_changes_nothing(which, many, fields):
    options = {"method": "rk4_original", "step": 0.01, "duration": 1.3033, "every": 0.0131}
    scene = room(many, forces=fields)
    all_of_them, few = fly(scene, start(), **options), fly(scene, some(start(), which), **options)
    for name in ("position", "velocity"):
        whole, part = getattr(all_of_them.trajectory, name), getattr(few.trajectory, name)
        assert np.array_equal(whole[:, which], part, equal_nan=True)
    for here, there in enumerate(which):
        assert np.array_equal(of(few.bounces, here), of(all_of_them.bounces, there))


def test_counts_are_sums_over_balls():
    scene = room(many=False, forces=FIELDS)
    options = {"method": "rk4_original", "step": 0.01, "duration": 1.3033, "every": 0.0131}
    whole = fly(scene, start(), **options)
    parts = [fly(scene, some(start(), slice(k, k + 50)), **options) for k in range(0, MANY, 50)]
    for name in ("steps", "penetrations"):
        assert getattr(whole, name) == sum(getattr(part, name) for part in parts)
    for name in ("kinetic", "potential", "work", "lost", "supplied"):
        total = sum(getattr(part.energy, name) for part in parts)
        # sums of 200 in another order
        assert np.allclose(getattr(whole.energy, name), total, rtol=0, atol=1e-12 * np.abs(total).max())


@pytest.mark.parametrize("fields", [{}, FIELDS], ids=["free", "fields"])
@pytest.mark.parametrize("method", integrators.fixed())
def test_compiled_is_what_the_plain_functions_compute(monkeypatch, method, fields):
    """Bit for bit: no fused or reordered arithmetic."""
    scene, balls = room(many=False, forces=fields), random_balls(2, 12, speed=20.0, released=0.0173 * np.arange(12))
    options = {"method": method, "step": 0.02, "duration": 0.4033, "every": 0.05}
    compiled = fly(scene, balls, **options)
    monkeypatch.setattr(jit, "bind", partial(jit.bind, compiled=False))
    plain = fly(scene, balls, **options)
    assert len(plain.bounces) > 20
    assert np.array_equal(plain.bounces, compiled.bounces)
    for name in ("position", "velocity"):
        expected = getattr(plain.trajectory, name)
        assert np.array_equal(getattr(compiled.trajectory, name), expected, equal_nan=True)
    for name in ("work", "lost", "residual"):
        assert np.array_equal(getattr(compiled.energy, name), getattr(plain.energy, name))
    assert (compiled.steps, compiled.penetrations) == (plain.steps, plain.penetrations)


def test_compiled_walks_the_tree_as_the_plain_functions_do(monkeypatch):
    scene, balls = room(many=True), random_balls(2, 12, speed=20.0)
    compiled = fly(scene, balls, step=0.02, duration=0.2)
    monkeypatch.setattr(jit, "bind", partial(jit.bind, compiled=False))
    plain = fly(scene, balls, step=0.02, duration=0.2)
    assert len(plain.bounces) > 10
    assert np.array_equal(plain.bounces, compiled.bounces)
    assert np.array_equal(plain.trajectory.position, compiled.trajectory.position)
