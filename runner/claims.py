"""Who makes which run: a lock on a file beside the runs, which ends with the process that holds it, however that ends.

Several sweeps may work in one folder, on one machine or, where the file system shares its locks, on many. Where it has none
every claim succeeds: a run may then be made twice, and the first that is finished stays.
"""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import FileIO
from pathlib import Path

SUFFIX = ".claim"
NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP}


@contextmanager
def claim(aside: Path, run_id: str, wait: bool = False) -> Iterator[FileIO | None]:
    """The right to make the run, for a `with` block: a new file for what its process has to say, None while another has it.

    With `wait` it is waited for. What a process that died left of the run is removed, and at the end the file is, too.
    Raises OSError when the folder beside `aside` cannot be written.
    """
    path = aside / f"{run_id}{SUFFIX}"
    file, alone = _locked(path, wait)
    if file is None:
        yield None
        return
    with file:
        if alone:
            _clear(aside, run_id)
        file.truncate(0)
        yield file
        path.unlink(missing_ok=True)  # after an exception it stays, for what else was left to be found by


def last_words(aside: Path, run_id: str) -> str:
    """What a process had to say that died while it made the run."""
    try:
        return (aside / f"{run_id}{SUFFIX}").read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return ""


def clear(aside: Path) -> None:
    """Remove what processes that died have left behind, and the folder when nobody works in it."""
    for path in aside.glob(f"*{SUFFIX}"):
        with suppress(OSError):  # its owner was faster, or the disk bears no change
            file, alone = _locked(path, wait=False, mode="r+")
            if file is not None:
                with file:
                    if alone:
                        _clear(aside, path.name.removesuffix(SUFFIX))
                        path.unlink(missing_ok=True)
    with suppress(OSError):
        aside.rmdir()


def _clear(aside: Path, run_id: str) -> None:
    for name in os.listdir(aside):
        if name.startswith(f"{run_id}.") and not name.endswith(SUFFIX):
            shutil.rmtree(aside / name, ignore_errors=True)


def _locked(path: Path, wait: bool, mode: str = "a+") -> tuple[FileIO | None, bool]:
    """The file, and whether nobody else has it; no file while another process does."""
    while True:
        try:
            file = FileIO(path, mode)
        except FileNotFoundError:
            if mode != "a+":
                raise
            path.parent.mkdir(exist_ok=True)  # another sweep, at its end, has removed the folder
            continue
        try:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            file.close()
            return None, False
        except OSError as error:
            if error.errno in NO_LOCKS:
                return file, False
            file.close()
            raise
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file, True
        file.close()  # its last owner has removed it
