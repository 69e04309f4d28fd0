"""Reading a summary: its columns, the rows a chart shows, and what there is to say about the others."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any

from runner.chart._names import SUMMARY, words
from runner.document import suggestion

if TYPE_CHECKING:
    import pyarrow

#: The type of an option that names a column of the summary.
Column = Annotated[str, "a column of the summary"]

WHOLE = ("finished", "rested")  # runs that went on to their end: only their figures compare
MOST = 32  # lines or panels a reader can still tell apart: 8 colours x 4 dashes


def column(table: pyarrow.Table, option: str, name: str) -> list[Any]:
    """The values of a column, None where empty, lists as text. Raises ValueError, naming `option`, if unknown."""
    if name not in table.column_names:
        raise ValueError(f"{option}: the summary has no column {name!r}{suggestion(name, table.column_names)}")
    values = table.column(name).to_pylist()
    return [None if v != v else str(v) if isinstance(v, (list, dict)) else v for v in values]


def numbers(table: pyarrow.Table, option: str, name: str) -> list[float | None]:
    """The values of a column of numbers. Raises ValueError where it holds something else."""
    values = column(table, option, name)
    if not numeric(values):
        raise ValueError(f"{option}: column {name!r} holds no numbers")
    return values


def split(table: pyarrow.Table, option: str, name: str | None) -> list[Any]:
    """What tells the rows apart: the values of a column, or None throughout when no column is named."""
    values = [None] * table.num_rows if name is None else column(table, option, name)
    if (count := len(set(values))) > MOST:
        raise ValueError(f"{option}: column {name!r} has {count} different values, a chart can tell {MOST} apart")
    return values


def numeric(values: Iterable[Any]) -> bool:
    """Whether all values but the empty ones are numbers; truth values are not."""
    return all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values if v is not None)


def distinct(values: Iterable[Any]) -> list[Any]:
    """The different values: numbers in order, others in the order of the table, as the experiment lists them."""
    found = list(dict.fromkeys(values))
    return sorted(found, key=lambda v: math.inf if v is None else v) if numeric(found) else found


def whole_runs(table: pyarrow.Table, **shown: str) -> tuple[list[int], list[str]]:
    """The rows of runs that went on to their end and are finite in the columns `shown`, and notes on the others."""
    status = column(table, "status", "status")
    columns = {name: column(table, option, name) for option, name in shown.items()}
    rows, missing = [], Counter()
    for row, state in enumerate(status):
        absent = [words(name) for name, values in columns.items() if not _present(values[row])]
        if state not in WHOLE:
            missing[f"{{}} {state} {{}} not shown"] += 1
        elif absent:
            missing[f"{{}} {{}} without {absent[0]} not shown"] += 1
        else:
            rows.append(row)
    return rows, told(missing)


def _present(value: Any) -> bool:
    return value is not None and (not isinstance(value, float) or math.isfinite(value))


def told(counted: Counter[str]) -> list[str]:
    """Notes, of a count for each text with places for the number and the word for runs."""
    return [text.format(count, "run" if count == 1 else "runs") for text, count in counted.items()]


def varying(table: pyarrow.Table, groups: Iterable[list[int]]) -> list[str]:
    """The matrix keys that differ inside a group of rows, in words."""
    groups = [rows for rows in groups if len(rows) > 1]
    keys = {name: column(table, "", name) for name in table.column_names if name not in SUMMARY}
    return [words(name) for name, values in keys.items() if any(len({values[r] for r in rows}) > 1 for rows in groups)]


def spread_note(table: pyarrow.Table, groups: Iterable[list[int]]) -> str:
    """What stands behind medians: "median and range of 9 runs each (damping and ball mass vary)"; empty if nothing."""
    groups = [rows for rows in groups if rows]
    if all(len(rows) == 1 for rows in groups):
        return ""
    sizes = sorted({len(rows) for rows in groups})
    count = f"{sizes[0]}" if len(sizes) == 1 else f"{sizes[0]} to {sizes[-1]}"
    note = f"median and range of {count} runs each"
    match varying(table, groups):
        case []:
            return note
        case [key]:
            return f"{note} ({key} varies)"
        case [*keys, last]:
            return f"{note} ({', '.join(keys)} and {last} vary)"
