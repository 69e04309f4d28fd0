"""Charts of an experiment, drawn from its summary table and trajectories.

A kind of chart is a module of this folder whose name has no leading underscore. It declares a dataclass `Chart`, whose
fields are the kind's options, and `draw(chart, table, folder) -> Figure`. Nothing else needs to know about it.
Importing this package, or a kind to look at its options, does not import matplotlib: drawing does.
"""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
import re
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

from runner import store
from runner.chart._table import Column
from runner.document import suggestion

if TYPE_CHECKING:
    import pyarrow
    from matplotlib.figure import Figure

FOLDER = store.CHARTS  # of a sweep's output


def kinds() -> list[str]:
    """The names of all kinds of chart, sorted."""
    return sorted(module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_"))


def kind_module(kind: str) -> ModuleType:
    """The module of a kind; its `Chart` holds the options. Raises ValueError for an unknown kind."""
    if kind not in kinds():
        raise ValueError(f"kind: {kind!r} is none of {', '.join(kinds())}{suggestion(kind, kinds())}")
    return importlib.import_module(f"{__name__}.{kind}")


def parse(options: dict[str, Any]) -> Any:
    """The `Chart` of `{kind: ..., option: ...}`.

    Raises ValueError, beginning with the option's name, for an unknown kind and an option unknown, missing or mistyped.
    """
    options = dict(options)
    if "kind" not in options:
        raise ValueError(f"kind: missing, one of {', '.join(kinds())}")
    kind = options.pop("kind")
    chart = kind_module(kind).Chart
    fields = {field.name: field for field in dataclasses.fields(chart)}
    types = get_type_hints(chart)
    for name, value in options.items():
        if name not in fields:
            raise ValueError(f"{name}: a chart of kind {kind} has no such option{suggestion(name, fields)}")
        if not isinstance(value, types[name]):
            raise ValueError(f"{name}: {value!r} is of the wrong type")
    for name, field in fields.items():
        if name not in options and field.default is field.default_factory is dataclasses.MISSING:
            raise ValueError(f"{name}: missing, a chart of kind {kind} needs it")
    return chart(**options)


def columns(chart: Any) -> dict[str, str]:
    """The columns of the summary that a `Chart` reads, by the option that names them."""
    types = get_type_hints(type(chart), include_extras=True)
    named = {name: getattr(chart, name) for name, type_ in types.items() if Column in (type_, *get_args(type_))}
    return {name: column for name, column in named.items() if column is not None}


def load() -> None:
    """Import what drawing needs."""
    for name in ("matplotlib.style", f"{__name__}._page", f"{__name__}._style"):
        importlib.import_module(name)


def draw(chart: Any, table: pyarrow.Table, folder: Path) -> Figure:
    """Draw a `Chart` from the summary `table` and the runs in `folder` (outputs/<name>/).

    Raises ValueError, in one line, when the table is empty or lacks a column.
    """
    from matplotlib import style

    from runner.chart._style import STYLE

    if not table.num_rows:
        raise ValueError("the summary has no runs to draw")
    with style.context(["default", STYLE]):
        return importlib.import_module(type(chart).__module__).draw(chart, table, Path(folder))


def render(charts: list[dict[str, Any]], table: pyarrow.Table, folder: Path, footer: str) -> list[Path]:
    """Draw `charts`, as an experiment file lists them, into folder/charts/ as PNG and SVG; the files written.

    `footer`, versions and machine, stands small at the foot of each. The names follow from the options.
    Raises ValueError as `draw` does, told by the chart's place in the list.
    """
    from matplotlib import style

    from runner.chart._page import sign
    from runner.chart._style import STYLE

    written: list[Path] = []
    taken: set[str] = set()
    for place, options in enumerate(charts):
        try:
            chart = parse(options)
            figure = draw(chart, table, folder)
        except ValueError as error:
            raise ValueError(f"charts.{place}: {error}") from error
        name = _unique(_stem(options["kind"], chart), taken)
        with style.context(["default", STYLE]):
            sign(figure, footer)
            for suffix, metadata in {".png": {}, ".svg": {"Date": None}}.items():
                path = Path(folder) / FOLDER / (name + suffix)
                path.parent.mkdir(parents=True, exist_ok=True)
                store.write_with(path, partial(figure.savefig, format=suffix[1:], metadata=metadata))
                written.append(path)
    return written


def _stem(kind: str, chart: Any) -> str:
    """lines-bounces-by-balls.mass, energy-by-solver.method: the same options always give the same name."""
    what = getattr(chart, "y", None)
    by = getattr(chart, "x", None) or getattr(chart, "series", None) or getattr(chart, "panel", None)
    name = "-by-".join(filter(None, ["-".join(filter(None, [kind, what])), by]))
    return re.sub(r"[^\w.-]+", "_", name)[:100]


def _unique(stem: str, taken: set[str]) -> str:
    """`stem`, or `stem`-2, -3, ... where it is taken already; case does not tell files apart everywhere."""
    name, count = stem, 1
    while name.casefold() in taken:
        count += 1
        name = f"{stem}-{count}"
    taken.add(name.casefold())
    return name
