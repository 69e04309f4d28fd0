"""One figure of the runs against another: a line for each value of `series`."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from runner.chart._names import SIGNED_ERRORS, label, sentence, value_text, words
from runner.chart._table import Column, column, distinct, numbers, numeric, split, spread_note, whole_runs

if TYPE_CHECKING:
    import pyarrow
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKED = 20  # points of a line that each get a marker


@dataclass(frozen=True)
class Chart:
    """Lines of `y` against `x`, one for each value of `series`, in small multiples by `panel`.

    Where several runs share x, series and panel: their median, with the range from the smallest to the largest.
    """

    x: Column  # numbers or names
    y: Column  # numbers
    series: Column | None = None
    panel: Column | None = None
    title: str | None = None


def draw(chart: Chart, table: pyarrow.Table, folder: Path) -> Figure:
    """Draw the chart; runs that did not go on to their end, or have no finite figure, are left out and told."""
    from runner.chart import _axes, _page, _style

    x, y = column(table, "x", chart.x), numbers(table, "y", chart.y)
    series, panel = split(table, "series", chart.series), split(table, "panel", chart.panel)
    rows, notes = whole_runs(table, x=chart.x, y=chart.y)
    shown, scale = {row: y[row] for row in rows}, None
    if chart.y in SIGNED_ERRORS and _axes.scale(abs(value) for value in shown.values() if value) == "log":
        shown = {row: abs(value) for row, value in shown.items()}
        scale = "log" if all(shown.values()) else "symlog"

    points = defaultdict(list)  # (panel, series, x) -> rows
    for row in rows:
        points[panel[row], series[row], x[row]].append(row)
    partial = points.keys() & {(panel[row], series[row], x[row]) for row in range(len(x)) if row not in shown}
    if partial:
        notes[-1] += " (open markers lack them)"
    if note := spread_note(table, points.values()):
        notes.insert(0, note)

    places = distinct(x[row] for row in rows)
    named = not numeric(places)
    few = named or len(places) <= _axes.FEW
    styles = _style.looks(distinct(series))
    if named:  # names have no order to run a line through
        styles = {value: {**style, "linestyle": "none"} for value, style in styles.items()}
    figure, grid = _page.panels(distinct(panel), chart.panel, label(chart.x), label(chart.y, size=scale is not None))
    for number, (value, style) in enumerate(styles.items()):
        for panel_value, axes in grid.items():
            keys = [key for place in places if (key := (panel_value, value, place)) in points]
            if not keys:
                continue
            along = np.array([places.index(place) if named else place for _, _, place in keys], dtype=float)
            along += _axes.aside(number, len(styles), 0.5) if named else 0
            sets = [[shown[row] for row in points[key]] for key in keys]
            bars = named or few and len(styles) > 1
            drawn = _line(axes, along, sets, [key in partial for key in keys], style, bars)
            if few and not named:  # lines that coincide are seen side by side
                _axes.move(drawn, _axes.aside(number, len(styles), 11))

    first = next(iter(grid.values()))
    if named:
        _axes.name_ticks(first, [value_text(place) for place in places])
    else:
        first.margins(x=0.07 if few else 0.02)
        _axes.set_scale(first, "x", places)
        _axes.ticks_at(first, places)
    _axes.set_scale(first, "y", shown.values(), scale)
    title = chart.title or sentence(f"{words(chart.y)} against {words(chart.x)}")
    _page.finish(figure, title, notes, chart.series, styles)
    return figure


def _line(
    axes: Axes, along: np.ndarray, sets: list[list[float]], partial: list[bool], style: dict[str, Any], bars: bool
) -> list[Artist]:
    """Draw the median of each of the sets, with an open marker where it is partial, and their ranges."""
    from runner.chart import _axes

    low, middle, high = (np.array([pick(values) for values in sets]) for pick in (min, median, max))
    drawn = axes.plot(along, middle, **style | ({} if len(sets) <= MARKED else {"marker": ""}))
    if any(partial):
        hollow = {**style, "linestyle": "none", "markerfacecolor": "white", "zorder": 2.1}
        drawn += axes.plot(along[partial], middle[partial], **hollow)
    if bars:
        drawn.append(_axes.bars(axes, along, low, high, style["color"]))
    else:
        _axes.band(axes, along, low, high, style["color"])
    return drawn
