"""Output formats: each module of this package is one, found by its name.

A format has `FILE`, the name of its file inside a run's folder, and `write(result, path)`. Its library is imported when
it writes, so that naming the files costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType


def formats() -> list[str]:
    """The names that `record.formats` may hold."""
    return sorted(module.name for module in iter_modules(__path__))


def format(name: str) -> ModuleType:
    """The module that writes the format `name`; KeyError where there is none."""
    if name not in formats():
        raise KeyError(name)
    return import_module(f"{__name__}.{name}")
