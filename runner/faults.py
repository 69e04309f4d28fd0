"""pydantic's errors as faults: in plain words, with the place in the file and the word that was meant."""

from __future__ import annotations

from collections.abc import Mapping
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from runner.document import Document, Path_, dotted, split, suggestion
from runner.errors import Fault
from runner.limits import MOST_TOLD

TYPES = {
    "int": "a whole number", "float": "a number", "string": "a text", "bool": "true or false",
    "tuple": "a list", "list": "a list",
    "dict": "a group of settings", "mapping": "a group of settings", "model": "a group of settings",
    "model_attributes": "a group of settings",
}  # fmt: skip
LIMITS = {
    "greater_than": (">", "gt"), "greater_than_equal": (">=", "ge"), "less_than": ("<", "lt"), "less_than_equal": ("<=", "le"),
}  # fmt: skip


def explain(
    error: ValidationError, model: type[BaseModel], data: Any, document: Document, origins: Mapping[Path_, Path_] = {}
) -> list[Fault]:
    """A fault for each thing wrong with `data`, checked as `model`.

    Of very many the first are enough. `origins` tells of settings that stand elsewhere in the document, as the matrix's do: path of the setting -> path there.
    """
    faults = []
    for each in error.errors(include_url=False)[: MOST_TOLD + 1]:
        path = _path(each["loc"], data, absent=each["type"] in ("missing", "extra_forbidden"))
        if "field" in each.get("ctx", {}):
            path += split(each["ctx"]["field"])
        reason = _reason(each, path, model)
        faults.append(Fault(document.place(origin(path, origins)), dotted(path), reason))
    return faults


def misfit(error: PydanticCustomError, document: Document, origins: Mapping[Path_, Path_]) -> Fault:
    """The fault of settings that are right, but do not go together."""
    path = split(error.context["field"])
    return Fault(document.place(origin(path, origins)), dotted(path), error.context["reason"])


def _path(loc: tuple, data: Any, absent: bool) -> Path_:
    """pydantic's location without the tags of unions that it puts in; `absent`: it ends with what is not in the data."""
    path = []
    for position, part in enumerate(loc):
        known = isinstance(data, dict) and part in data or isinstance(data, list) and isinstance(part, int) and part < len(data)
        if known or (absent and position == len(loc) - 1):
            path.append(part)
            data = data[part] if known else None
    return tuple(path)


def origin(path: Path_, origins: Mapping[Path_, Path_]) -> Path_:
    """Where in the document the setting at `path` stands."""
    for setting, place in origins.items():
        shared = min(len(setting), len(path))
        if setting[:shared] == path[:shared]:
            return place + path[shared:]
    return path


def _reason(error: dict, path: Path_, model: type[BaseModel]) -> str:
    kind, context, value = error["type"], error.get("ctx", {}), error["input"]
    if kind == "missing":
        return "is missing"
    if kind == "extra_forbidden":
        return f"unknown setting{suggestion(path[-1], _keys(model, error['loc'][:-1]))}"
    if kind == "invalid":
        return context["reason"]
    if kind in LIMITS:
        symbol, name = LIMITS[kind]
        return f"must be {symbol} {context[name]:g}, not {short(value)}"
    if kind in ("literal_error", "union_tag_invalid"):
        given = value if kind == "literal_error" else context["tag"]
        allowed = context.get("expected") or context["expected_tags"]
        words = [word.strip("' ") for word in allowed.replace(" or ", ",").split(",")]
        return f"must be one of {', '.join(words)}, not {short(given)}{suggestion(given, words)}"
    if kind == "union_tag_not_found":
        return f"needs {context['discriminator']}, to say what it is"
    if kind in ("too_short", "too_long"):
        limit = context["min_length"] if kind == "too_short" else context["max_length"]
        return f"must have at {'least' if kind == 'too_short' else 'most'} {limit} items, not {context['actual_length']}"
    if kind == "string_pattern_mismatch":
        return f"{short(value)} is not a name: letters, digits, '_' and '-', and a letter first"
    stem = kind.removesuffix("_type").removesuffix("_parsing").removesuffix("_from_float")
    if stem in TYPES:
        return f"must be {TYPES[stem]}, not {short(value)}"
    return error["msg"]


def short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def outline(kind: Any, data: Any) -> Any:
    """`data` with every setting of a run that its type `kind` knows, None where it is left out; what is wrong stays wrong."""
    group = _bare(kind)
    if get_origin(group) in (Union, UnionType) and isinstance(data, dict):
        group = _child(group, data.get("shape", data.get("type")))
    if isinstance(group, type) and issubclass(group, BaseModel) and not (data is None and type(None) in get_args(kind)):
        given = data if isinstance(data, dict) else {}
        return {name: outline(field.annotation, given.get(name)) for name, field in group.model_fields.items() if not field.exclude}
    if isinstance(data, dict):
        return {key: outline(_child(group, key), each) for key, each in data.items()}
    if isinstance(data, list):
        return [outline(_child(group, index), each) for index, each in enumerate(data)]
    return data


def _keys(kind: Any, loc: tuple) -> list[str]:
    """The settings that the group at pydantic's location `loc` below `kind` may hold."""
    for part in loc:
        kind = _child(kind, part)
    kind = _bare(kind)
    return [key for key in kind.model_fields] if isinstance(kind, type) and issubclass(kind, BaseModel) else []


def _child(kind: Any, part: str | int) -> Any:
    kind = _bare(kind)
    if get_origin(kind) in (Union, UnionType):  # the location names the member by its tag
        for member in get_args(kind):
            tags = [get_args(field.annotation) for name, field in member.model_fields.items() if name in ("shape", "type")]
            if (part,) in tags:
                return member
    if get_origin(kind) in (dict, Mapping, list, tuple):
        return get_args(kind)[-1]
    return kind.model_fields[part].annotation if isinstance(kind, type) and issubclass(kind, BaseModel) else None


def _bare(kind: Any) -> Any:
    """`kind` without Annotated and `| None`."""
    if get_origin(kind) is Annotated:
        return _bare(get_args(kind)[0])
    if get_origin(kind) in (Union, UnionType):
        members = [member for member in get_args(kind) if member is not type(None)]
        return _bare(members[0]) if len(members) == 1 else Union[tuple(members)]
    return kind
