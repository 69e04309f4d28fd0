"""Settings by their dotted paths, in the nested dicts and lists that files and runs hold them in."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from sys import intern
from typing import Any

from runner.document import Path_, dotted, split


def canonical(key: str) -> str:
    """A dotted path in the one spelling that settings have."""
    return dotted(split(key))


def value_at(parameters: Any, path: Path_) -> Any:
    """What stands at `path`. Raises KeyError, IndexError or TypeError where nothing does."""
    for part in path:
        parameters = parameters[part]
    return parameters


def with_value(parameters: Any, path: Path_, value: Any) -> Any:
    """A copy of `parameters` with `value` at `path`; what it shares with the original is not copied.

    What has no room for it, a number or a list where a group should be, gives way to a group.
    """
    if not path:
        return value
    key = path[0]
    item = isinstance(parameters, list) and isinstance(key, int) and key < len(parameters)
    copy = list(parameters) if item else dict(parameters) if isinstance(parameters, dict) else {}
    copy[key] = with_value(copy[key] if item else copy.get(key), path[1:], value)
    return copy


def leaves(parameters: Any, whole: Iterable[str] = ()) -> Iterator[tuple[str, Any]]:
    """Every setting by its dotted path: the values, lists of numbers as one, and the groups named in `whole`."""
    around = {name[:end] for name in whole for end, mark in enumerate(name) if mark == "."}

    def walk(value: Any, name: str) -> Iterator[tuple[str, Any]]:
        nested = isinstance(value, dict) or isinstance(value, list) and any(isinstance(v, (dict, list)) for v in value)
        if name in whole or not (nested or name in around) or value in ({}, []):
            yield intern(name), value  # the same in every run of a sweep, of which there may be many
        if nested or name in around:
            for key, each in value.items() if isinstance(value, dict) else enumerate(value if isinstance(value, list) else ()):
                yield from walk(each, f"{name}.{key}" if name else str(key))

    yield from walk(parameters, "")
