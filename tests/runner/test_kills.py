"""Two hundred kills, at any moment, of workers and of the sweep itself; one more sweep then makes good for all of them."""

import os
import random
import signal
import time
from contextlib import suppress

import pytest

from runner import store
from tests.runner.test_workers import left_behind, members, seeds, start, trajectories

RUNS, KILLS = 300, 200


@pytest.mark.slow
def test_after_two_hundred_kills_one_sweep_completes_the_same_bytes(tmp_path, carom_process):
    chance = random.Random(6)
    for name in ("killed", "calm"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "x.yaml").write_text(seeds(RUNS))
    folder = tmp_path / "killed" / "outputs" / "x"
    hit = {"sweep": 0, "worker": 0}
    sweep = None
    try:
        while sum(hit.values()) < KILLS:
            if sweep is None or sweep.poll() is not None:
                sweep = start(tmp_path / "killed", "x.yaml", "--jobs", "2", "--quiet", "--retry-failed")
            # a kill for each run or so, so that there are runs left for the last; or sooner, before a worker has begun
            goal, patience = len(store.done(folder)) + chance.randint(0, 2), time.monotonic() + chance.uniform(0, 10)
            while sweep.poll() is None and len(store.done(folder)) < goal and time.monotonic() < patience:
                time.sleep(0.002)
            time.sleep(chance.uniform(0, 0.05))
            alive = sorted(members(sweep.pid) - {sweep.pid})
            victim = chance.choice(alive) if alive and chance.random() < 0.85 else sweep.pid
            with suppress(ProcessLookupError):
                os.kill(victim, signal.SIGKILL)
                hit["sweep" if victim == sweep.pid else "worker"] += 1
            if victim == sweep.pid:
                sweep.communicate()
    finally:
        if sweep:
            with suppress(ProcessLookupError):
                os.killpg(sweep.pid, signal.SIGKILL)
            sweep.communicate()
    before = [report["status"] for report in store.read_runs(folder)]
    assert set(before) <= {"finished", "crashed"}
    print(f"killed: {hit}; {len(before)} runs were done by then, {before.count('crashed')} of them crashed")

    assert carom_process("sweep", "x.yaml", "--quiet", "--retry-failed", cwd=tmp_path / "killed") == (0, "", "")
    assert carom_process("sweep", "x.yaml", "--quiet", cwd=tmp_path / "calm") == (0, "", "")
    assert {report["status"] for report in store.read_runs(folder)} == {"finished"}
    assert len(trajectories(tmp_path / "killed")) == RUNS
    assert trajectories(tmp_path / "killed") == trajectories(tmp_path / "calm")
    assert left_behind(tmp_path) == []
