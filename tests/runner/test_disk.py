"""A disk that is full, or closed, in the middle of a sweep: one line, nothing half-written, and the same command goes on."""

import ctypes
import os
import shutil
import subprocess
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import h5py
import pytest

from runner import store
from runner.disk import Disk

READ_ONLY, REMOUNT = 1, 32  # of mount(2)
TWELVE = f"duration: 40\nmatrix: {{balls.mass: {list(range(1, 13))}}}\n"  # of 238 kB each
SLOW = "repeats: 2\n"  # a quarter of a second a run, so that there is a middle on a busy machine, too


def attempt(*command) -> None:
    """Run a command that may not be there, or not be permitted here; the test is then skipped."""
    if not shutil.which(command[0]) or subprocess.run(command, capture_output=True).returncode:
        pytest.skip(f"{command[0]} is not permitted")


@pytest.fixture
def small(here):
    """The current folder, on a disk of 2 MB of its own."""
    attempt("mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", here)
    os.chdir(here)
    yield here
    os.chdir(here.parent)
    subprocess.run(["umount", "--lazy", here], check=True)


def whole(folder: Path) -> list[str]:
    """The ids of the runs that are there, each of which is held to be complete; and nothing else is there."""
    for report in store.read_runs(folder):
        assert report["status"] == "finished"
        with h5py.File(store.run_folder(folder, report["run_id"]) / "trajectory.h5") as file:
            assert len(file["particles/balls/position/value"]) == 4001
    assert not list(folder.rglob(".*"))
    return sorted(store.done(folder))


def test_a_full_disk_is_told_in_a_line_and_the_sweep_goes_on_when_there_is_space(small, carom, fall):
    Path("x.yaml").write_text(fall.replace("duration: 0.2\n", TWELVE))
    code, out, err = carom("sweep", "x.yaml", "--jobs", "2", "--quiet")
    assert (code, out) == (1, "") and err.count("\n") == 1 and "No space left on device" in err, err
    assert "outputs/x" in err
    before = whole(Path("outputs/x"))
    assert 3 <= len(before) < 9

    # full already when it starts
    filler = small / "filler"
    with pytest.raises(OSError, match="No space left"):
        filler.write_bytes(bytes(2**21))
    code, out, err = carom("sweep", "x.yaml", "--jobs", "2", "--quiet")
    assert (code, out) == (1, "") and err.count("\n") == 1 and "No space left on device" in err, err
    assert whole(Path("outputs/x")) == before
    filler.unlink()

    subprocess.run(["mount", "-o", "remount,size=20m", small], check=True)
    assert carom("sweep", "x.yaml", "--jobs", "2", "--quiet") == (0, "", "")
    after = whole(Path("outputs/x"))
    assert len(after) == 12 and set(before) < set(after)


@contextmanager
def closed(folder: Path):
    """Nothing may be put into the folder, or taken out of it; not by root either."""
    root = os.getuid() == 0
    subprocess.run(["chattr", "+i", folder], check=True) if root else folder.chmod(0o555)
    try:
        yield
    finally:
        subprocess.run(["chattr", "-i", folder], check=True) if root else folder.chmod(0o755)


@contextmanager
def read_only(disk: Path):
    """Nothing on the disk may be changed; it must have a moment in which nobody writes."""
    while remount(disk, READ_ONLY):
        time.sleep(0.0001)
    try:
        yield
    finally:
        assert remount(disk, 0) == 0


def remount(disk: Path, how: int) -> int:
    return ctypes.CDLL(None).mount(None, os.fsencode(disk), None, REMOUNT | how, None)


def ends_in_the_middle(carom, shut) -> None:
    """A sweep of twelve runs fails in a line when `shut`, a context, begins after three of them, and is completed after it."""
    runs, seen = Path("outputs/x/runs").absolute(), threading.Event()

    def shut_in_the_middle():
        while not seen.is_set() and len(store.done(runs.parent)) < 3:
            time.sleep(0.001)
        with shut:
            seen.wait(60)

    shutting = threading.Thread(target=shut_in_the_middle)
    shutting.start()
    code, out, err = carom("sweep", "x.yaml", "--jobs", "1", "--quiet")
    seen.set()
    shutting.join()
    assert (code, out) == (1, "") and err.count("\n") == 1, err
    assert err.startswith("cannot write outputs/x/runs/"), err
    assert any(told in err for told in ("not permitted", "Permission denied", "Read-only")), err
    done = store.done(runs.parent)
    assert 3 <= len(done) < 12
    assert {report["status"] for report in store.read_runs(runs.parent)} == {"finished"}
    assert carom("sweep", "x.yaml", "--jobs", "1", "--quiet") == (0, "", "")
    assert len(whole(Path("outputs/x"))) == 12


def test_a_folder_that_is_closed_in_the_middle_is_told_in_a_line(here, carom, fall):
    if os.getuid() == 0:
        attempt("chattr", "+i", here)
        attempt("chattr", "-i", here)
    Path("x.yaml").write_text(fall.replace("duration: 0.2\n", TWELVE + SLOW))
    ends_in_the_middle(carom, closed(here / "outputs/x/runs"))


def test_a_disk_that_becomes_read_only_in_the_middle_is_told_in_a_line(small, carom, fall):
    attempt("mount", "-o", "remount,size=20m", small)
    Path("x.yaml").write_text(fall.replace("duration: 0.2\n", TWELVE + SLOW))
    ends_in_the_middle(carom, read_only(small))


def test_the_first_error_of_a_file_is_raised_at_its_end(tmp_path):
    with pytest.raises(OSError, match="No space left"):
        with Disk(Path("/dev/full")) as file:
            assert file.write(b"abc") == 3
    with Disk(tmp_path / "x") as file:
        assert file.write(b"abc") == 3
    assert (tmp_path / "x").read_bytes() == b"abc"
