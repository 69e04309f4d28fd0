"""From the runs' reports to one table: summary.parquet and summary.csv, a row per run in the folder."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner import store
from runner.columns import COLUMNS, TEXTS, WHOLE
from runner.errors import RunError
from runner.forms import STATUSES
from runner.settings import leaves

if TYPE_CHECKING:
    import pyarrow


def summarise(folder: Path, keys: list[str]) -> pyarrow.Table:
    """Build the table of all runs in the folder and write it as parquet and CSV.

    `keys` are the settings that the matrix varies; any other in which runs of the folder differ gets a column too, so that
    no two rows look alike that are not.
    """
    import pyarrow.csv
    import pyarrow.parquet

    table = build(store.read_runs(folder), keys)
    parquet = partial(pyarrow.parquet.write_table, table, write_page_checksum=True)
    store.write_with(folder / f"{store.SUMMARY}.parquet", parquet)
    store.write_with(folder / f"{store.SUMMARY}.csv", lambda path: pyarrow.csv.write_csv(table, path))
    return table


def read(folder: Path) -> pyarrow.Table:
    """The summary as last written. Raises FileNotFoundError when there is none, RunError when it is damaged."""
    import pyarrow.parquet

    path = folder / f"{store.SUMMARY}.parquet"
    try:
        table = pyarrow.parquet.read_table(path, page_checksum_verification=True)
        table.validate(full=True)
        reason = None if _is_summary(table) else "not a summary, or of another version"
    except (pyarrow.ArrowException, OSError) as error:
        if isinstance(error, FileNotFoundError):
            raise
        reason = "cut or changed"
    if reason:
        raise RunError(f"{path}: {reason}; `carom status {shlex.quote(str(folder))} --repair` makes it again")
    return table


def _is_summary(table: pyarrow.Table) -> bool:
    """Whether the table has all columns that `build` makes, and none but of their types."""
    import pyarrow

    types = dict(zip(table.column_names, table.schema.types))
    return (
        len(types) == table.num_columns
        and all(types.get(name) == _kind(name) for name in COLUMNS)
        and {pyarrow.string(), pyarrow.int64(), pyarrow.float64(), pyarrow.bool_()} >= set(types.values())
        and table["run_id"].null_count == 0
        and STATUSES >= set(table["status"].unique().to_pylist())
    )


def build(reports: Iterable[dict[str, Any]], keys: list[str]) -> pyarrow.Table:
    """The table of run reports, in the order of the varied settings."""
    import pyarrow

    rows, settings = [], []  # less than the reports: of ten thousand those take a hundred megabytes
    for report in reports:
        told = {**report["figures"], **report.get("timings", {}), **{k: report[k] for k in ("run_id", "status", "error")}}
        rows.append([told.get(name) for name in COLUMNS])
        settings.append(dict(leaves(report["parameters"], keys)))
    varied = keys + [key for key in differing(settings) if key not in keys]
    order = sorted(range(len(rows)), key=lambda number: [_rank(settings[number].get(key)) for key in varied])
    columns = {name: _typed(name, [rows[number][place] for number in order]) for place, name in enumerate(COLUMNS)}
    added = {key: _typed(key, [settings[number].get(key) for number in order], setting=True) for key in varied}
    first = {name: columns[name] for name in COLUMNS[:3]}
    return pyarrow.table({**first, **added, **columns})


def differing(settings: list[dict[str, Any]]) -> list[str]:
    """The settings in which the runs differ, in the order of the first run's; the recorder's aside."""
    names = dict.fromkeys(name for each in settings for name in each)
    return [
        name
        for name in names
        if not name.startswith("record.") and any(each.get(name) != settings[0].get(name) for each in settings)
    ]


def _kind(name: str) -> pyarrow.DataType:
    """The type of one of COLUMNS."""
    import pyarrow

    return pyarrow.string() if name in TEXTS else pyarrow.int64() if name in WHOLE else pyarrow.float64()


def _typed(name: str, values: list, setting: bool = False):
    import pyarrow

    if not setting:
        return pyarrow.array(values, _kind(name))
    if all(v is None or _is_float(v) for v in values):
        return pyarrow.array(values, pyarrow.float64())
    if all(v is None or isinstance(v, bool) for v in values):
        return pyarrow.array(values, pyarrow.bool_())
    return pyarrow.array([v if v is None or isinstance(v, str) else json.dumps(v) for v in values], pyarrow.string())


def _is_float(value: Any) -> bool:
    """Whether it is a number that a column of numbers can hold; a seed may have more digits than they have."""
    return isinstance(value, float) or isinstance(value, int) and not isinstance(value, bool) and abs(value) <= 2**53


def _rank(value: Any) -> tuple:
    """A key to sort mixed values by: numbers, then everything else as text, then nothing."""
    if isinstance(value, (int, float)):
        return (0, value, "")
    return (2, 0, "") if value is None else (1, 0, json.dumps(value))
