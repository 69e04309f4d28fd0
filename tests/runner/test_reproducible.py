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
    "explicit_euler-m1-d0.05-4d54dd2f0032": "da5a8a4ffc3a220fab47c96a7075ec548e1165a38e36ab99224af0479e9a4d26",
    "implicit_euler-m1-d0.05-b2daa7de260e": "6e2c30a72c67e17538cc34936a2dcea30cf1153a4b3a4c29e9c5cd6d0db4d230",
    "symplectic_euler-m1-d0.05-eda036f236ad": "ff51f881ccfc64a7f214b708c51262c2be2cdcf597d55e64de7dbb8f66065ae1",
    "symplectic_euler_drift_first-m1-d0.05-49918a342783": "af8f2584abc1b40c022eae18711a80a47e03b3a22fe6a3507c955396ce5f5e14",
    "velocity_verlet-m1-d0.05-1855b1f77396": "37ac921fb14a50d7f8d47c04723d729f2676c3af0a773e90d53b08508f1e8aa7",
    "rk4_original-m1-d0.05-1785303dabc7": "c586600873f105aef4b89e5a320e4f842d2dcd158b2f66bd9510ca6684b97411",
    "rk4-m1-d0.05-f320069aeb31": "ed227d8c6ffa880b49c3627efb5f31eadf3cd7c1ce7c9bdaf06b6ba2099876c4",
    "pefrl-m1-d0.05-712d0e47976f": "2b8c6221b87d2481ebf11a85209f343664dcb929aa720b99a1a096a1a4cd6b79",
    "dopri5-m1-d0.05-b0b0ba8fa6ff": "b1f860b7535ff91f63f90582669b562ea3049bbe1d96983225024a95dd8f86ff",
    "exact-m1-d0.05-394b950bcb03": "06983ff4b596b894f03d0b2e082d9e6ede983ed8c71e8376822e7129737f3f43",
    "rk4_original-m1-d0.05-155a4c6dcd02": "f501f1854ca8f785d0e35a2a0bce9676f862f1070ea86ab97a25c1949cc24c5f",
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

    So it must be: there is no fastmath, numba lets nothing be fused, and what kernels do with lanes they do lane by lane.
    """
    result, digest = run(RUNS[run_id]), hashlib.sha256()
    bounces = [result.bounces[name] for name in result.bounces.dtype.names]
    for values in (result.trajectory.position, result.trajectory.velocity, *bounces):
        digest.update(values.tobytes())
    assert digest.hexdigest() == PINNED[run_id]
