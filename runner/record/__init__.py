"""Output formats: one module each, found by its name.

A format has `FILE`, the name of its file inside a run's folder, and `write(result, path)`; `PACKED`, the name of the file
that holds those of many runs, and `join(files, path)`, which makes it. It imports its library when it writes, so that naming
formats and files costs nothing.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType


def names() -> list[str]:
    """Every format, in alphabetical order."""
    return sorted(module.name for module in iter_modules(__path__))


@cache
def load(name: str) -> ModuleType:
    """The module of the format `name`; ModuleNotFoundError where there is none."""
    return import_module(f"{__name__}.{name}")
