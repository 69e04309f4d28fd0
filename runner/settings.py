"""Settings by their dotted paths, in the nested dicts and lists that files and runs hold them in."""

from __future__ import annotations

from collections.abc import Iterator
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
    """A copy of `parameters` with `value` at `path`; what it shares with the original is not copied."""
    if not path:
        return value
    copy = list(parameters) if isinstance(parameters, list) else dict(parameters) if isinstance(parameters, dict) else {}
    inner = copy[path[0]] if isinstance(copy, list) else copy.get(path[0])
    copy[path[0]] = with_value(inner, path[1:], value)
    return copy


def leaves(parameters: Any, whole: list[str] = [], path: tuple = ()) -> Iterator[tuple[str, Any]]:
    """Every setting by its dotted path: the values, lists of numbers as one, and the groups named in `whole`."""
    name = dotted(path)
    nested = isinstance(parameters, dict) or isinstance(parameters, list) and any(isinstance(v, (dict, list)) for v in parameters)
    deeper = any(key.startswith(f"{name}.") for key in whole)
    if name in whole or not (nested or deeper) or parameters in ({}, []):
        yield name, parameters
    if nested or deeper:
        for key, value in parameters.items() if isinstance(parameters, dict) else enumerate(parameters or []):
            yield from leaves(value, whole, path + (key,))
