"""The output folder of an experiment: what is where, and how a run gets there whole or not at all."""

from __future__ import annotations

import json
import os
import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

RUNS, EXPERIMENT, PROVENANCE, SUMMARY, RUN = "runs", "experiment.yaml", "provenance.json", "summary", "run.json"
ASIDE = ".aside-"


def run_folder(folder: Path, run_id: str) -> Path:
    return folder / RUNS / run_id


def done(folder: Path) -> set[str]:
    """The ids of all runs that are done, whatever came of them: those whose folder has its final name."""
    try:
        return {entry.name for entry in os.scandir(folder / RUNS) if not entry.name.startswith(".")}
    except (FileNotFoundError, NotADirectoryError):
        return set()


def read_run(folder: Path, run_id: str) -> dict[str, Any]:
    return json.loads((run_folder(folder, run_id) / RUN).read_text())


def read_runs(folder: Path) -> list[dict[str, Any]]:
    """The run.json of every run that is done, in order of id."""
    return [read_run(folder, run_id) for run_id in sorted(done(folder))]


def write_text(path: Path, text: str) -> None:
    """Write aside, then rename: whoever reads sees the old text or the new one, whole."""
    write_with(path, lambda aside: aside.write_text(text, encoding="utf-8"))


def write_json(path: Path, data: Any) -> None:
    write_text(path, json.dumps(data, indent=1) + "\n")


def write_with(path: Path, write) -> None:
    """Let `write(aside)` make a file, then give it its name."""
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        write(aside)
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)


@contextmanager
def aside(folder: Path) -> Iterator[Path]:
    """A folder beside the runs, for those being made; it is gone afterwards, with whatever was not finished in it.

    What sweeps that died on this machine left behind goes too.
    """
    runs = folder / RUNS
    runs.mkdir(parents=True, exist_ok=True)
    prefix = f"{ASIDE}{socket.gethostname()}-"
    for left in runs.glob(f"{prefix}*"):
        if not _alive(int(left.name.removeprefix(prefix))):
            shutil.rmtree(left, ignore_errors=True)
    own = runs / f"{prefix}{os.getpid()}"
    own.mkdir(exist_ok=True)
    try:
        yield own
    finally:
        shutil.rmtree(own, ignore_errors=True)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def publish(made: Path, final: Path, replace: bool) -> None:
    """Give the finished folder `made` its final name. One already there, of another sweep, stays unless `replace`."""
    if replace and final.exists():
        old = made.with_name(made.name + ".old")
        os.rename(final, old)
        os.rename(made, final)
        shutil.rmtree(old, ignore_errors=True)
        return
    try:
        os.rename(made, final)
    except OSError:
        if not final.exists():
            raise
        shutil.rmtree(made, ignore_errors=True)


def provenance(folder: Path) -> dict[str, Any]:
    """What is known of the last sweep into the folder; empty when nothing is."""
    try:
        found = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}
