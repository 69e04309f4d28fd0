"""What varies from run to run: every combination of the axes, less `exclude`, and `include` besides."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import and_, or_
from typing import Any, NamedTuple

from runner.document import Document, Path_, dotted, split, suggestion
from runner.errors import Fault, InputError
from runner.limits import MOST_TOLD
from runner.settings import canonical, leaves, value_at


class Setting(NamedTuple):
    """A value that a run takes instead of the file's own, and where in the document it stands."""

    value: Any
    origin: Path_


Values = dict[str, Setting]  # by dotted path
Marked = tuple[Values, int]  # and the patterns of `exclude` that they leave, a bit for each


@dataclass(frozen=True)
class Matrix:
    axes: tuple[tuple[Values, ...], ...]  # of each axis the alternatives; several keys where they vary together
    exclude: tuple[dict[str, Any], ...]  # a combination that matches one of these in part is dropped
    include: tuple[Values, ...]  # runs besides, over the file's own values

    @property
    def keys(self) -> list[str]:
        """Every setting that varies, in the order of the file."""
        alternatives = itertools.chain(*self.axes, self.include)
        return list(dict.fromkeys(key for values in alternatives for key in values))

    @property
    def size(self) -> int:
        """How many runs there are before `exclude`, and before equal ones become one."""
        return (math.prod(len(axis) for axis in self.axes) if self.axes else not self.include) + len(self.include)

    def combinations(self, parameters: dict[str, Any]) -> Iterator[Values]:
        """The values of each run; `parameters` are those of the file itself, for `exclude` to look at."""
        if self.axes or not self.include:
            axes, left = self._marked(parameters)
            yield from _kept(itertools.product(*axes), left)
        yield from self.include

    def each_value(self, parameters: dict[str, Any]) -> Iterator[Values]:
        """Those of the combinations that have each value with the first of all others, and with the last."""
        axes, left = self._marked(parameters)
        for end in (0, -1):
            others = [axis[end] for axis in axes]
            crossing = ([*others[:place], each, *others[place + 1 :]] for place, axis in enumerate(axes) for each in axis)
            yield from _kept(crossing, left)
        yield from self.include

    def _marked(self, parameters: dict[str, Any]) -> tuple[list[list[Marked]], int]:
        """The axes with the patterns of `exclude` that each alternative leaves, and those that the file's own values leave: a
        bit for each, so that thousands of patterns cost a run no more than a few."""
        patterns = dict[str, dict[Any, int]]()  # by key and value: those that ask for it
        for number, pattern in enumerate(self.exclude):
            for key, value in pattern.items():
                asking = patterns.setdefault(key, {})
                asking[_frozen(value)] = asking.get(_frozen(value), 0) | 1 << number
        every = (1 << len(self.exclude)) - 1
        indifferent = {key: every ^ reduce(or_, asking.values()) for key, asking in patterns.items()}

        def left(values: Iterable[tuple[str, Any]]) -> int:
            met = (indifferent[key] | patterns[key].get(_frozen(value), 0) for key, value in values if key in patterns)
            return reduce(and_, met, every)

        axes = [[(each, left((key, setting.value) for key, setting in each.items())) for each in axis] for axis in self.axes]
        varied = {key for axis in self.axes for key in axis[0]}
        return axes, left((key, value_at(parameters, split(key))) for key in patterns if key not in varied)


def _kept(combinations: Iterable[Sequence[Marked]], left: int) -> Iterator[Values]:
    """The values of the combinations that no pattern is left for."""
    for alternatives in combinations:
        if not reduce(and_, (each for _, each in alternatives), left):
            yield {key: setting for values, _ in alternatives for key, setting in values.items()}


def _frozen(value: Any) -> Any:
    """What is equal where values are, to look them up by."""
    if isinstance(value, dict):
        return frozenset((key, _frozen(each)) for key, each in value.items())
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def parse(raw: dict[str, Any], settings: dict[str, Any], document: Document) -> tuple[Matrix, list[Fault]]:
    """The matrix of the document, as far as it makes sense, and its mistakes. What is not in `settings` cannot vary.

    Raises InputError when the mistakes are very many.
    """
    faults: list[Fault] = []
    varied: set[str] = set()

    def fault(path: Path_, reason: str) -> None:
        faults.append(Fault(document.place(path), dotted(path), reason))
        if len(faults) > MOST_TOLD:
            raise InputError(*faults)

    def known(key: Any, path: Path_) -> bool:
        try:
            value_at(settings, split(key))
        except (KeyError, IndexError, TypeError):
            fault(path, f"there is no setting '{key}'{suggestion(key, (name for name, _ in leaves(settings)))}")
            return False
        return True

    def axis(group: Any, path: Path_) -> tuple[Values, ...]:
        """Settings that vary together: {key: [values]}."""
        lists = {}
        for key, values in group.items():
            here = path + (key,)
            if not known(key, here):
                continue
            if canonical(key) in varied:
                fault(here, "varies already")
            elif not isinstance(values, list):
                fault(here, "must be a list of values")
            elif not values:
                fault(here, "must not be an empty list")
            else:
                varied.add(canonical(key))
                lists[canonical(key)] = [Setting(value, here + (index,)) for index, value in enumerate(values)]
        if len({len(values) for values in lists.values()}) > 1:
            counts = ", ".join(f"{key} has {len(values)}" for key, values in lists.items())
            fault(path, f"lists that vary together must be equally long: {counts}")
            return ()
        return tuple(dict(zip(lists, row)) for row in zip(*lists.values()))

    def patterns(name: str) -> list[tuple[dict[str, Any], Path_]]:
        """The list of mappings under `name`, with their places."""
        entries = raw.get(name, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) and entry for entry in entries):
            fault(("matrix", name), "must be a list of groups, each {setting: value, ...}")
            return []
        return [(entry, ("matrix", name, index)) for index, entry in enumerate(entries)]

    axes = [axis({key: raw[key]}, ("matrix",)) for key in raw if key not in ("zip", "exclude", "include")]
    axes += [axis(group, path) for group, path in patterns("zip")]
    exclude = [
        {canonical(key): value for key, value in entry.items()}
        for entry, path in patterns("exclude")
        if all([known(key, path + (key,)) for key in entry])
    ]
    include = [
        {canonical(key): Setting(value, path + (key,)) for key, value in entry.items()}
        for entry, path in patterns("include")
        if all([known(key, path + (key,)) for key in entry])
    ]
    return Matrix(tuple(axes), tuple(exclude), tuple(include)), faults
