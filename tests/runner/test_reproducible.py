"""The same configuration makes the same run, under the same id, to the last bit."""

import hashlib
import platform
from pathlib import Path

import pytest

from runner import load
from runner.execute import run

RUNS = {each.run_id: each for each in load(Path(__file__).parents[2] / "configs/smoke.yaml").runs()}

#: SHA-256 of all positions, velocities and bounces of the runs of configs/smoke.yaml. An id or a hash that changes needs a
#: reason: a setting more or a new sim.ANSWERS make new ids, and a kernel that comes to other numbers needs a new sim.ANSWERS.
PINNED = {
    "explicit_euler-m1-d0.05-14f1d1d5b9b0": "f41cda85cf61c86bfbbb5a94b8c19f028d0fb85666fb03154626b365bbcf9e9a",
    "implicit_euler-m1-d0.05-a9f6b9147fe5": "d42704d932ecfc94331623c54e332d6c67b8576a83cf4b384d5909315ca9ec86",
    "symplectic_euler-m1-d0.05-c4e6df10f4cb": "e7c4f0b80d830438d80aabd8f814cfc68520be92a29472e1ed41073c68c82c7c",
    "symplectic_euler_drift_first-m1-d0.05-3740c07ca8d7": "31a484c507469343df4803b99d896fb0711fb8f9f576086024bea0211fc7f68e",
    "velocity_verlet-m1-d0.05-4d01fe38af31": "1b96a466199df26da44b6af7c7d67ac734ef69b973de82e1e67cd1c1fc0aca2f",
    "rk4_original-m1-d0.05-6f3d9cc74e34": "0f97ec9bb8ce816c457d97eee1e4f8aec6bb7dafc59cb015414747b6fe3d7c1d",
    "rk4-m1-d0.05-720e56d622fb": "59a1fc6893c4f4509afffe632d3796651b83452cb0d87c5e1439217b90db0e4d",
    "pefrl-m1-d0.05-a2b9275b680c": "f7e269a4ec4817952ec6fce24201534fef00b68a1da0cf02b7264bc28cb7410c",
    "dopri5-m1-d0.05-c8ce3025dab5": "c61e2b8920f54988894eaf306ad8e0c53e8d59978fcd796278df0e316eee600a",
    "exact-m1-d0.05-6522b30e523f": "4d741b05535f4d762586f9372dad6868aaf775af729e5b0f5e340efaf254f9a9",
    "rk4_original-m1-d0.05-3e6822f28b83": "f501f1854ca8f785d0e35a2a0bce9676f862f1070ea86ab97a25c1949cc24c5f",
}


def test_run_ids_are_what_they_were():
    assert list(RUNS) == list(PINNED)


@pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64") or platform.libc_ver()[0] != "glibc",
    reason="another C library may differ in the last digit of pow, which dopri5 calls, and of sin and cos, which shape the scene",
)
@pytest.mark.parametrize("run_id", PINNED)
def test_every_method_comes_to_the_numbers_it_came_to(run_id):
    """They were the same with kernels for SSE2 and for AVX-512, with numpy's and glibc's for AVX-512 and for neither.

    So it must be: there is no fastmath, nothing is fused but where `sim.instructions` says so, which is then rounded once everywhere,
    and what kernels do with lanes they do lane by lane.
    """
    result, digest = run(RUNS[run_id]), hashlib.sha256()
    bounces = [result.bounces[name] for name in result.bounces.dtype.names]
    for values in (result.trajectory.position, result.trajectory.velocity, *bounces):
        digest.update(values.tobytes())
    assert digest.hexdigest() == PINNED[run_id]
