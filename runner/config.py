"""From an experiment file to an experiment: read, checked as a whole, every mistake told with its place."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import chain, islice
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, TypeAdapter, ValidationError

import sim
from runner import chart
from runner.columns import COLUMNS
from runner.document import Document, Path_, dotted, split, suggestion
from runner.errors import Fault, InputError
from runner.expect import unknown_columns
from runner.faults import explain, outline
from runner.limits import MOST_LOOKED_AT, MOST_PLANNED, MOST_TOLD
from runner.matrix import Matrix, Values, parse
from runner.schema import Expectation, File, Setup
from runner.settings import canonical, leaves, with_value


@dataclass(frozen=True)
class Run:
    """One run of an experiment."""

    setup: Setup
    folder: Path  # that file names in the setup are relative to
    origins: Mapping[Path_, Path_] = field(default_factory=dict)  # path of a setting that varies -> where in the document
    base: Run | None = None  # the run of the file's own values, with which it shares what does not vary

    @cached_property
    def parameters(self) -> dict[str, Any]:
        """The resolved configuration as JSON would hold it; not to be changed, as runs share parts of it."""
        shared = self.base.setup if self.base else None
        return {
            name: self.base.parameters[name] if shared and part is getattr(shared, name) else _plain(part)
            for name, part in self.setup
        }

    @cached_property
    def run_id(self) -> str:
        """A readable prefix and a hash of everything that can change the result; the same on every machine."""
        content = json.dumps([sim.ANSWERS, self.parameters], sort_keys=True, separators=(",", ":"))
        setup, digest = self.setup, hashlib.sha256(content.encode()).hexdigest()
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
        runs, faults = {}, {}
        for values in self.matrix.combinations(self.base.parameters):
            try:
                run = _run(self.document, values, self.base)
                runs.setdefault(run.run_id, run)
            except InputError as error:
                faults.update(dict.fromkeys(error.faults))
                if len(faults) > MOST_TOLD:
                    break
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
    name = file.name or document.path.stem.strip(".") or "experiment"
    return Experiment(name, document, _run(document, {}), matrix, tuple(file.expect), tuple(file.charts))


def resolve(parameters: dict[str, Any], folder: Path) -> Run:
    """The run of resolved `parameters`, as `Run.parameters` gave them."""
    return Run(Setup.model_validate_json(_json(parameters), context={"folder": folder}), folder)


def _run(document: Document, values: Values, base: Run | None = None) -> Run:
    """The run of the file's own settings with `values` instead. Of a sweep of many, only the parts with a value are checked
    anew; the others are those of `base`, the run without `values`."""
    data = {key: value for key, value in document.data.items() if key in Setup.model_fields}
    for key, setting in values.items():
        data = with_value(data, split(key), setting.value)
    origins = {split(key): setting.origin for key, setting in values.items()}
    if base:
        parts, context = dict(base.setup), {"folder": document.folder}
        try:
            for name in {path[0] for path in origins}:
                parts[name] = _part(name).validate_json(_json(data[name]), strict=True, context=context)
            return Run(Setup.model_validate(parts, context=context), document.folder, origins, base)
        except ValidationError:
            pass  # what is wrong is told from the whole
    return Run(_validate(Setup, data, document, origins), document.folder, origins)


@cache
def _part(name: str) -> TypeAdapter:
    """What checks the part `name` of a setup."""
    field = Setup.model_fields[name]
    return TypeAdapter(Annotated[field.annotation, field])


def _plain(part: Any) -> Any:
    """A part of a setup as JSON would hold it."""
    return part.model_dump(mode="json") if isinstance(part, BaseModel) else part


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
