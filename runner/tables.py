"""Tables for a terminal."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner import aggregate, expect, store
from runner.document import suggestion
from runner.errors import InputError, one_line
from runner.plan import existing

if TYPE_CHECKING:
    import pyarrow

MOST_ROWS = 40  # one for each run, before they are grouped unasked

#: What a group of runs is summed up by: heading -> (column, aggregation).
GROUPED = {
    "runs": ("run_id", "count"),
    "bounces": ("bounces", "mean"),
    "penetrations": ("penetrations", "sum"),
    "energy lost (J)": ("energy_lost", "mean"),
    "work (J)": ("work", "mean"),
    "residual, worst": ("energy_residual_rel", "max"),
    "ns/ball-s": ("ns_per_ball_second", "approximate_median"),
}


def show(folder: Path, by: list[str] | None, csv: bool) -> None:
    """Print the summary of the folder, grouped by the columns `by`. Raises InputError for a folder or column that is none."""
    experiment = existing(folder)
    try:
        table = aggregate.read(folder)
    except FileNotFoundError:
        raise InputError(f"{folder}: no summary yet; `carom sweep` makes it") from None
    for name in by or []:
        if name not in table.column_names:
            raise InputError(f"--by {name}: no such column{suggestion(name, table.column_names)}")
    keys = experiment.matrix.keys
    if by is None and not csv and table.num_rows > MOST_ROWS:
        by = next((few for few in (keys[:2], keys[:1]) if few and _groups(table, few) <= MOST_ROWS), ["method"])
    rows = grouped(table, by) if by else table
    if csv:
        import pyarrow.csv

        pyarrow.csv.write_csv(rows, sys.stdout.buffer)
        return
    if not by:
        rows = rows.select([name for name in ["run_id", "status", *keys] if name in rows.column_names] + _figures(GROUPED))
    print_table(f"{experiment.name}: {table.num_rows} runs" + (f" by {', '.join(by)}" if by else ""), rows)
    reports = store.read_runs(folder, sorted(run.run_id for run in experiment.runs()))
    for verdict in expect.verdicts(experiment.expect, reports):
        print(verdict)


def grouped(table: pyarrow.Table, by: list[str]) -> pyarrow.Table:
    """The table summed up over all runs alike in the columns `by`, with a count of each status that is not `finished`."""
    import pyarrow
    import pyarrow.compute as pc

    others = sorted(set(table["status"].to_pylist()) - {"finished"})
    for status in others:
        table = table.append_column(f"is {status}", pc.equal(table["status"], status).cast(pyarrow.int64()))
    aims = {**GROUPED, **{status: (f"is {status}", "sum") for status in others}}
    result = table.group_by(by, use_threads=False).aggregate(list(aims.values()))
    names = {f"{column}_{how}": heading for heading, (column, how) in aims.items()}
    result = result.rename_columns([names.get(name, name) for name in result.column_names])
    return result.select(by + list(aims)).sort_by([(name, "ascending") for name in by])


def _groups(table: pyarrow.Table, by: list[str]) -> int:
    return table.group_by(by).aggregate([]).num_rows


def _figures(headings: dict[str, tuple[str, str]]) -> list[str]:
    return [column for column, _ in headings.values() if column != "run_id"]


def print_table(title: str, table: pyarrow.Table) -> None:
    names = table.column_names
    print_rows(title, names, [[text(row[name]) for name in names] for row in table.to_pylist()])


def print_rows(title: str, headings: list[str], rows: list[list[str]]) -> None:
    """Print rows of text under headings; numbers to the right. A log gets all of it, however wide."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    shown = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    for index, heading in enumerate(headings):
        numeric = all(_is_number(row[index]) for row in rows)
        shown.add_column(heading, justify="right" if numeric else "left", overflow="fold")
    for row in rows:
        shown.add_row(*row)
    # square brackets are text, not markup
    Console(width=None if sys.stdout.isatty() else 200, markup=False).print(shown)


def text(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else one_line(str(value))


def _is_number(word: str) -> bool:
    try:
        float(word or 0)
    except ValueError:
        return False
    return True


def show_speeds(found: dict[str, list]) -> None:
    """Print what `runner.bench` measured, a part after the other."""
    from runner.bench import layout
    from runner.machine import footer

    for part, rows in found.items():
        for title, headings, lines in layout.tables(part, rows):
            print_rows(title, headings, lines)
    print(footer())


def show_methods() -> None:
    """Print what every method claims."""
    from sim import integrators
    from sim.solvers import exact

    rows = [["exact", "exact", *("-" * 5), " ".join(exact.__doc__.split())]]
    for name in integrators.names():
        method, _, description = integrators.load(name)
        limit = f"{method.oscillator_limit:g}" if method.oscillator_limit else "none stable"
        claims = [method.order, limit, f"{method.drag_limit:g}", method.evaluations]
        claims += ["yes" if claim else "no" for claim in (method.symplectic, method.reversible)]
        rows.append([name, *map(str, claims), f"{' '.join(description.split())} [{method.reference}]"])
    headings = ["method", "order", "h omega limit", "h b limit", "evaluations/step", "symplectic", "reversible", "what it is"]
    print_rows("Methods", headings, rows)
