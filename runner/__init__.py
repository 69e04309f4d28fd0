"""Experiments with `sim`: files, sweeps, outputs.

    from runner import load, run, sweep
"""

from importlib import import_module

_HOMES = {"load": "runner.config", "run": "runner.execute", "sweep": "runner.sweeping"}

__all__ = ["load", "run", "sweep"]


def __getattr__(name: str):
    # late, so that the command line starts without what it does not need
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'runner' has no attribute {name!r}")
