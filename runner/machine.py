"""What the figures were made with: versions, machine, command."""

from __future__ import annotations

import os
import platform
import resource
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

LIBRARIES = (
    "numpy", "numba", "trimesh", "h5py", "rerun-sdk", "pydantic", "ruamel.yaml", "pyarrow", "matplotlib", "typer", "rich",
)  # fmt: skip


def versions() -> dict[str, str]:
    """carom's version, Python's, and those of the libraries installed."""
    found = {"carom": carom_version(), "python": platform.python_version()}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            pass
    return found


def carom_version() -> str:
    try:
        return version("carom")
    except PackageNotFoundError:
        return "0+source"


def machine() -> dict[str, Any]:
    return {"system": platform.platform(), "processor": _processor(), "cores": os.cpu_count()}


def footer() -> str:
    """A line for the foot of a chart."""
    known = versions()
    told = ", ".join(f"{name} {known[name]}" for name in ("carom", "numpy", "numba", "python"))
    return f"{told}; {_processor()}, {os.cpu_count()} cores"


def provenance(source: Path, start: str, end: str | None) -> dict[str, Any]:
    """Everything about a sweep that is not its input: `source` is the folder of the experiment file."""
    return {
        "versions": versions(),
        "machine": machine(),
        "command": sys.argv,
        "commit": _commit(source),
        "source": str(source.resolve()),
        "start": start,
        "end": end,
    }


def peak_memory() -> int:
    """Bytes that this process has had in memory at most."""
    try:
        with open("/proc/self/status") as lines:
            return next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
    except (OSError, StopIteration):  # not Linux; there, this one counts the parent's, too
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _processor() -> str:
    try:
        with open("/proc/cpuinfo") as lines:
            return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _commit(folder: Path) -> str | None:
    """The git commit of the experiment file's folder, if it is in a repository."""
    try:
        done = subprocess.run(["git", "-C", folder, "rev-parse", "HEAD"], capture_output=True, text=True, timeout=5)
        return done.stdout.strip() if done.returncode == 0 else None
    except (OSError, subprocess.TimeoutExpired):
        return None
