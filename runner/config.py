"""From an experiment file to an experiment: read, checked as a whole, every mistake told with its place."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache
from itertools import chain, islice
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError, create_model
from pydantic_core import PydanticCustomError, to_json, to_jsonable_python

import sim
from runner import chart
from runner.columns import COLUMNS
from runner.document import Document, Path_, dotted, split, suggestion
from runner.errors import Fault, InputError
from runner.expect import unknown_columns
from runner.faults import explain, misfit, outline
from runner.limits import MOST_LOOKED_AT, MOST_PLANNED, MOST_SEARCHED, MOST_TOLD
from runner.matrix import Matrix, Setting, Values, parse
from runner.schema import Expectation, File, Model, Setup
from runner.settings import canonical, leaves, with_value


#: Groups that may hold thousands of things, and have no say in what else their part may hold
GROUPS = {"surfaces", "forces", "released"}


class Parts:
    """The parts of setups as JSON holds them. Runs of a sweep have most in common: each part, and each group in one, is looked at
    once, and shared."""

    def __init__(self):
        self._known: dict[int, tuple[Any, Any, tuple[str, ...]]] = {}  # the part, too, so that its id stays its own

    def plain(self, part: Any) -> Any:
        """Not to be changed."""
        return self._looked_at(part)[1]

    def text(self, part: Any) -> tuple[str, ...]:
        """In pieces, so that long ones are shared."""
        return self._looked_at(part)[2]

    def share(self, part: Any, known: Parts) -> None:
        """Look at the part as `known` does, once for both."""
        self._known[id(part)] = known._looked_at(part)

    def _looked_at(self, part: Any) -> tuple[Any, Any, tuple[str, ...]]:
        if id(part) not in self._known:
            groups = groups_of(part)
            plain = to_jsonable_python(part, exclude=set(groups))
            if groups:
                plain |= {name: self.plain(each) for name, each in groups.items()}
                plain = {name: plain[name] for name, _ in part if name in plain}  # in its order
                pieces = ["{"]
                for name, each in sorted(plain.items()):
                    pieces += [f'"{name}":', *(self.text(groups[name]) if name in groups else [_compact(each)]), ","]
                pieces[-1] = "}"
            self._known[id(part)] = part, plain, tuple(pieces) if groups else (_compact(plain),)
        return self._known[id(part)]


def groups_of(part: Any) -> dict[str, Any]:
    """The GROUPS that a part of a setup has, if there is anything in them."""
    return {name: each for name, each in part if name in GROUPS and each} if isinstance(part, BaseModel) else {}


def _compact(plain: Any) -> str:
    return json.dumps(plain, sort_keys=True, separators=(",", ":"))


@dataclass(frozen=True)
class Run:
    """One run of an experiment."""

    setup: Setup
    folder: Path  # that file names in the setup are relative to
    origins: Mapping[Path_, Path_] = field(default_factory=dict)  # path of a setting that varies -> where in the document
    parts: Parts = field(default_factory=Parts, compare=False)

    @cached_property
    def parameters(self) -> dict[str, Any]:
        """The resolved configuration as JSON would hold it; not to be changed, as runs share parts of it."""
        return {name: self.parts.plain(part) for name, part in self.setup}

    @cached_property
    def run_id(self) -> str:
        """A readable prefix and a hash of everything that can change the result; the same on every machine."""
        setup = self.setup
        content = ",".join(f'"{name}":{"".join(self.parts.text(part))}' for name, part in sorted(setup))
        digest = hashlib.sha256(f"[{sim.ANSWERS},{{{content}}}]".encode()).hexdigest()
        return f"{setup.solver.method}-m{setup.balls.mass:g}-d{setup.scene.damping:g}-{digest[:12]}"


@dataclass(frozen=True)
class Experiment:
    """A checked experiment: `base` is the run of the file's own values, `matrix` what varies."""

    name: str
    document: Document
    base: Run
    matrix: Matrix
    expect: tuple[Expectation, ...]
    charts: tuple[dict[str, Any], ...]

    @property
    def columns(self) -> list[str]:
        """The settings that the summary has columns for: those that vary, and those that the charts read."""
        read = [name for options in self.charts for name in chart.columns(chart.parse(options)).values()]
        return list(dict.fromkeys(self.matrix.keys + [name for name in read if name not in COLUMNS]))

    def runs(self) -> list[Run]:
        """Every run of the matrix, equal ones once. Raises InputError with all that is wrong with any of them, or for too many."""
        if self.matrix.size > MOST_PLANNED:
            reason = f"makes {self.matrix.size:,} runs; one experiment may have {MOST_PLANNED:,}"
            raise InputError(Fault(self.document.place(("matrix",)), "matrix", reason))
        make, faults, runs = _Maker(self.document, self.base), {}, {}

        def made(combinations: Iterator[Values]) -> Iterator[Run]:
            for values in combinations:
                try:
                    yield make(values)
                except InputError as error:
                    faults.update(dict.fromkeys(error.faults))
                    if len(faults) > MOST_TOLD:
                        raise InputError(*faults) from None

        for _ in made(self.matrix.each_value(self.base.parameters)):
            pass  # what is wrong by itself is found before time goes into all combinations
        for run in made(islice(self.matrix.combinations(self.base.parameters), MOST_SEARCHED if faults else None)):
            runs.setdefault(run.run_id, run)
        if not (faults or runs):
            faults[Fault(self.document.place(("matrix", "exclude")), "matrix.exclude", "drops every run")] = None
        if faults:
            raise InputError(*faults)
        return list(runs.values())


def load(path: str | Path, overrides: Mapping[str, Any] | None = None) -> Experiment:
    """Read the experiment file at `path`, its settings replaced by `overrides` (dotted path -> value).

    A setting that the matrix varies then takes the one value. Raises InputError, a line for each mistake.
    """
    document = Document(Path(path))
    for key, value in (overrides or {}).items():
        vary(document, key, [value])
    return check(document)


def vary(document: Document, key: str, values: list[Any]) -> None:
    """Give the setting `key` one value, or let the matrix vary it over several."""
    matrix = _group(document.data.get("matrix"))
    groups = matrix.get("zip")
    if any(canonical(key) in map(canonical, _group(group)) for group in (groups if isinstance(groups, list) else [])):
        raise InputError(Fault(f"-s {key}", "matrix.zip", "varies together with other settings, so it has no value of its own"))
    named = next((other for other in matrix if canonical(other) == canonical(key)), key)
    if len(values) > 1 or named in matrix:
        document.override(("matrix", named), values, f"-s {key}")
    if len(values) == 1:
        document.override(split(key), values[0], f"-s {key}")


def check(document: Document) -> Experiment:
    """The experiment in `document`. Raises InputError, a line for each mistake."""
    settings = outline(Setup, document.data)
    matrix, faults = parse(_group(document.data.get("matrix")), settings, document)
    known = [*COLUMNS, *matrix.keys, *(name for name, _ in leaves(settings))]
    faults += islice(chain(unknown_columns(document, known), _chart_faults(document, known)), MOST_TOLD + 1)
    try:
        file = _validate(File, document.data, document)
    except InputError as error:
        faults += error.faults
    if faults:
        raise InputError(*dict.fromkeys(faults + _value_faults(document, matrix)))
    name = file.name or "".join(filter(str.isprintable, document.path.stem)).strip(". ") or "experiment"
    return Experiment(name, document, _run(document, {}), matrix, tuple(file.expect), tuple(file.charts))


def resolve(parameters: dict[str, Any], folder: Path) -> Run:
    """The run of resolved `parameters`, as `Run.parameters` gave them; whether its parts go together a simulation of it tells.

    Raises ValueError for what is no run.
    """
    parts, together = {}, Parts()
    try:
        for name, data in parameters.items():
            text = to_json(data, inf_nan_mode="constants")
            checked = _checked.__wrapped__ if b'"file"' in text else _checked  # a file may be another the next time
            parts[name], known = checked(name, text, folder)
            together.share(parts[name], known)
        setup = Setup.model_construct(**{name: parts[name] for name in Setup.model_fields})  # each is checked
        return Run(setup, folder, parts=together)
    except (ValueError, KeyError):  # what is wrong is told from the whole
        return Run(Setup.model_validate_json(_json(parameters), context={"folder": folder}), folder)


@lru_cache(maxsize=256)  # the runs of a sweep combine a few parts
def _checked(name: str, text: bytes, folder: Path) -> tuple[Any, Parts]:
    """The part `name` of a setup, and it as JSON holds it. Raises ValidationError; KeyError when a setup has no such part."""
    whole = _only(name).model_validate_json(_json({name: json.loads(text)}), context={"folder": folder})
    return getattr(whole, name), Parts()


def _run(document: Document, values: Values) -> Run:
    """The run of the file's own settings with `values` instead, checked as a whole."""
    data = {key: value for key, value in document.data.items() if key in Setup.model_fields}
    for key, setting in values.items():
        data = with_value(data, split(key), setting.value)
    origins = {split(key): setting.origin for key, setting in values.items()}
    return Run(_validate(Setup, data, document, origins), document.folder, origins)


class _Maker:
    """Makes the runs of a matrix: `base` with other values. Each part that some of them have alike is checked once, and shared."""

    def __init__(self, document: Document, base: Run):
        self.document, self.base = document, base
        self.checked: dict[tuple, Any] = {}  # by its name and the values in it: the part, or what is wrong with it
        self.split = cache(split)

    def __call__(self, values: Values) -> Run:
        """Raises InputError with all that is wrong with the run."""
        origins, inside = {}, {}
        for key, setting in values.items():
            path = self.split(key)
            origins[path] = setting.origin
            inside.setdefault(path[0], {})[path] = setting
        parts = {name: self._part(name, settings) for name, settings in inside.items()}
        if wrong := [each for each in parts.values() if isinstance(each, InputError)]:
            raise InputError(*(fault for error in wrong for fault in error.faults))
        setup = self.base.setup.model_copy(update=parts)
        try:
            setup.fit(self.document.folder)
        except PydanticCustomError as error:
            raise InputError(misfit(error, self.document, origins)) from None
        return Run(setup, self.document.folder, origins, self.base.parts)

    def _part(self, name: str, settings: dict[Path_, Setting]) -> Any:
        key = name, *map(id, settings.values())
        if key not in self.checked:
            data = {name: self.document.data.get(name)}
            alike = {
                group: each
                for group, each in groups_of(getattr(self.base.setup, name)).items()
                if not any(path[:2] in ((name,), (name, group)) for path in settings)
            }
            for group in alike:  # it is checked already: the least that may be stands for it
                few = data[name][group][:1] if isinstance(data[name][group], list) else {}
                data = with_value(data, (name, group), few)
            for path, setting in settings.items():
                data = with_value(data, path, setting.value)
            try:
                origins = {path: setting.origin for path, setting in settings.items()}
                part = getattr(_validate(_only(name), data, self.document, origins), name)
                self.checked[key] = part.model_copy(update=alike) if alike else part
            except InputError as error:
                self.checked[key] = error
        return self.checked[key]


@cache
def _only(name: str) -> type[BaseModel]:
    """The model of a setup that has but this part."""
    field = Setup.model_fields[name]
    return create_model("Setup", __base__=Model, **{name: (field.annotation, field)})


def _validate(model: type[BaseModel], data: Any, document: Document, origins: Mapping[Path_, Path_] = {}) -> Any:
    try:
        return model.model_validate_json(_json(data), context={"folder": document.folder})
    except ValidationError as error:
        raise InputError(*explain(error, model, data, document, origins)) from None


def _json(data: Any) -> str:
    """JSON in which 1000.0 is 1000, so that `count: 1e3` is a whole number; pydantic is strict about that."""

    def whole(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: whole(each) for key, each in value.items()}
        if isinstance(value, list):
            return [whole(each) for each in value]
        return int(value) if isinstance(value, float) and value.is_integer() and abs(value) < 2**53 else value

    return json.dumps(whole(data))


def _value_faults(document: Document, matrix: Matrix) -> list[Fault]:
    """What is wrong with the file's own run, and with the values of the matrix, each alone in it; with the first, if many."""
    faults: dict[Fault, None] = {}
    for values in islice(chain([{}], *matrix.axes, matrix.include), 1 + MOST_LOOKED_AT // document.size):
        try:
            _run(document, values)
        except InputError as error:
            faults.update(dict.fromkeys(error.faults))
            if len(faults) > MOST_TOLD:
                break
    return list(faults)


def _chart_faults(document: Document, known: Collection[str]) -> Iterator[Fault]:
    """What is wrong with the charts' options, and columns they name that no run has."""
    charts = document.data.get("charts")
    for index, options in enumerate(charts if isinstance(charts, list) else []):
        if not isinstance(options, dict):
            continue  # told elsewhere
        try:
            columns = chart.columns(chart.parse(options)).items()
            wrong = {option: f"no run has '{name}'{suggestion(name, known)}" for option, name in columns if name not in known}
        except ValueError as error:
            option, _, reason = str(error).partition(": ")
            wrong = {option: reason}
        for option, reason in wrong.items():
            path = ("charts", index, option)
            yield Fault(document.place(path), dotted(path), reason)


def _group(data: Any) -> dict:
    """`data` where it is a group of settings, else an empty one: that it should be one is told elsewhere."""
    return data if isinstance(data, dict) else {}
