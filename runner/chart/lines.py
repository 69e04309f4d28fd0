"""One figure of the runs against another: a line for each value of `series`."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from runner.chart._names import label, sentence, value_text, words
from runner.chart._table import Column, column, distinct, numbers, numeric, split, spread_note, whole_runs

if TYPE_CHECKING:
    import pyarrow
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Chart:
    """Lines of `y` against `x`, one for each value of `series`, in small multiples by `panel`.

    Where several runs share x, series and panel: their median, in a band from the smallest to the largest.
    """

    x: Column  # numbers or names
    y: Column  # numbers
    series: Column | None = None
    panel: Column | None = None
    title: str | None = None


def draw(chart: Chart, table: pyarrow.Table, folder: Path) -> Figure:
    """Draw the chart; runs that did not go on to their end, or have no finite figure, are left out and told."""
    from runner.chart import _page as page

    x, y = column(table, "x", chart.x), numbers(table, "y", chart.y)
    series, panel = split(table, "series", chart.series), split(table, "panel", chart.panel)
    rows, notes = whole_runs(table, x=chart.x, y=chart.y)
    places = distinct(x[row] for row in rows)
    named = not numeric(places)

    groups = defaultdict(lambda: defaultdict(list))  # (panel, series) -> place along x -> rows
    for row in rows:
        groups[panel[row], series[row]][places.index(x[row]) if named else x[row]].append(row)
    if note := spread_note(table, [members for line in groups.values() for members in line.values()]):
        notes.insert(0, note)

    left_out = {(panel[row], series[row], x[row]) for row in set(range(len(x))).difference(rows)}
    styles = page.looks(distinct(series))
    figure, grid = page.panels(distinct(panel), chart.panel)
    few = len(places) <= page.FEW
    for number, (value, style) in enumerate(styles.items()):
        for panel_value, axes in grid.items():
            line = sorted(groups[panel_value, value].items())
            if not line:
                continue
            along = np.array([place for place, _ in line], dtype=float)
            low, middle, high = np.array([(min(v), median(v), max(v)) for v in ([y[r] for r in rs] for _, rs in line)]).T
            beside = {}
            if named:  # names have no order to run a line through
                along += page.shift(number, len(styles), 0.5)
                style = style | {"linestyle": "none"}
            elif few:  # lines that coincide are seen side by side
                beside = {"transform": page.beside(axes, page.shift(number, len(styles), 14))}
            if named or few and len(styles) > 1:
                axes.vlines(along, low, high, color=style["color"], alpha=0.35, linewidth=3.5, **beside)
            else:
                page.band(axes, along, low, high, style)
            axes.plot(along, middle, **style | ({} if few or named else {"marker": ""}), **beside)

    first = next(iter(grid.values()))
    if named:
        page.name_ticks(first, [value_text(place) for place in places])
    else:
        page.set_scale(first, "x", places)
        page.ticks_at(first, places)
    page.set_scale(first, "y", [y[row] for row in rows])
    title = chart.title or sentence(f"{words(chart.y)} against {words(chart.x)}")
    page.finish(figure, title, notes, (label(chart.x), label(chart.y)), chart.series, styles)
    return figure
