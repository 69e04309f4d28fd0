"""What accuracy costs: the error of each method against the time that it takes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from runner.chart._names import label, sentence, value_text, words
from runner.chart._table import Column, column, distinct, numbers, split, spread_note, whole_runs

if TYPE_CHECKING:
    import pyarrow
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EXACT = "exact"
ROUNDING = 1e-12  # below, an error is of rounding, not of the method
FEWEST = 3  # points to fit a line to
FRONT = {"color": "#d4d4d4", "linewidth": 5, "solid_capstyle": "butt", "solid_joinstyle": "miter"}
DASHED = {"linestyle": (0, (3, 1.5)), "markerfacecolor": "white"}


class Point(NamedTuple):
    """A method at one step, or one tolerance."""

    step: float | None  # s; None for methods that choose it
    error: float
    cost: float


@dataclass(frozen=True)
class Chart:
    """Error `x` against cost `y`, both logarithmic: a line through the steps of each of `series`, small multiples by `panel`.

    With each name stands its order, the slope of log error against log step; or, where a method chooses its steps, the slope
    of log cost against log error. Either is a least squares fit to the finer half of the points whose error is above 1e-12,
    where rounding takes over: three or more, else none is told. At coarse steps errors grow no further.
    A run without any error, as of the method exact, stands at the left edge. The front joins the points that no other beats
    in error and cost. Where both contact rules occur the original's lines are dashed. Runs alike in all that: the median.
    """

    x: Column = "position_error_rms"
    y: Column = "ns_per_ball_second"
    series: Column = "solver.method"
    panel: Column | None = None
    title: str | None = None


def draw(chart: Chart, table: pyarrow.Table, folder: Path) -> Figure:
    """Draw the chart; runs that did not go on to their end, or have no error or cost, are left out and told."""
    from runner.chart import _axes, _page, _style

    panel, series = split(table, "panel", chart.panel), split(table, "series", chart.series)
    rows, notes = whole_runs(table, x=chart.x, y=chart.y)
    curves, groups = _curves(table, rows, chart, panel, series)
    if note := spread_note(table, groups):
        notes.insert(0, note.replace("median and range", "median"))
    names = sorted(distinct(series), key=lambda name: name == EXACT)
    looks = _style.looks([name for name in names if name != EXACT])
    for look in looks.values():
        look["linestyle"] = "-"  # dashes tell the contact rule
    looks[EXACT] = {"color": _style.INK, "linestyle": "", "marker": "*", "markersize": 11}
    figure, grid = _page.panels(distinct(panel), chart.panel, label(chart.x), label(chart.y))
    contacts = {contact for _, name, contact in curves if name != EXACT}
    dashed = contacts - {"swept"} if len(contacts) > 1 else set()
    errors = [point.error for points in curves.values() for point in points if point.error > 0]
    edge = min(errors, default=1.0) / 5
    slopes = defaultdict(list)  # (series, contact) -> one for each panel
    for value, axes in grid.items():
        here = {key[1:]: points for key, points in curves.items() if key[0] == value}
        _front(axes, [(max(point.error, edge), point.cost) for points in here.values() for point in points])
        for (name, contact), points in here.items():
            _line(axes, points, edge, looks[name] | (DASHED if contact in dashed else {}), value_text(name))
            slopes[name, contact].append(slope(points))

    first = next(iter(grid.values()))
    styles = {_told(name, slopes, dashed): looks[name] for name in names}
    if curves:
        _axes.set_scale(first, "x", [*errors, edge], "log")
        _axes.set_scale(first, "y", [point.cost for points in curves.values() for point in points], "log")
        first.set_xlim(left=edge)
        styles |= {f"{contact} contact": {"color": _style.GREY, "marker": "o"} | DASHED for contact in dashed}
        styles["Pareto front"] = FRONT
        notes.append("order: slope of the error against the step, over the finer half of the steps")
    title = chart.title or sentence(f"{words(chart.y)} against {words(chart.x)}")
    _page.finish(figure, title, notes, "method", styles)
    return figure


def _curves(
    table: pyarrow.Table, rows: list[int], chart: Chart, panel: list, series: list
) -> tuple[dict[tuple, list[Point]], list[list[int]]]:
    """For each (panel, series, contact) its points from coarse to fine; and the rows behind each point."""
    x, y, step = numbers(table, "x", chart.x), numbers(table, "y", chart.y), column(table, "step", "step")
    contact, tolerance = column(table, "contact", "contact"), [None] * table.num_rows
    if "solver.tolerance" in table.column_names:
        tolerance = column(table, "tolerance", "solver.tolerance")
    alike = defaultdict(lambda: defaultdict(list))
    for row in rows:
        knob = step[row] if step[row] is not None else tolerance[row]
        alike[panel[row], series[row], contact[row]][knob].append(row)
    curves = {
        key: [
            Point(step[few[0]], median(abs(x[row]) for row in few), median(y[row] for row in few))
            for _, few in sorted(knobs.items(), key=lambda pair: -(pair[0] or 0))
        ]
        for key, knobs in alike.items()
    }
    return curves, [few for knobs in alike.values() for few in knobs.values()]


def slope(points: list[Point]) -> tuple[str, float] | None:
    """What is fitted, and the slope: of log error against log step, or of log cost against log error. None with too few."""
    sound = [point for point in points if point.error > ROUNDING]
    fitted = sound[-max(FEWEST, -(-len(sound) // 2)) :]
    if len(fitted) < FEWEST:
        return None
    step, error, cost = zip(*fitted)
    if None in step:
        return "cost slope", float(np.polyfit(np.log(error), np.log(cost), 1)[0])
    return "order", float(np.polyfit(np.log(step), np.log(error), 1)[0])


def front(points: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """The (error, cost) that no other beats in both, from the smallest error on."""
    found = []
    for error, cost in sorted(points):
        if not found or cost < found[-1][1]:
            found.append((error, cost))
    return found


def _front(axes: Axes, points: list[tuple[float, float]]) -> None:
    """The least cost for an error of at most x, as steps."""
    best = front(points)
    if best:
        reach = 3 * max(error for error, _ in points)
        axes.plot(*zip(*best, (reach, best[-1][1])), **FRONT, drawstyle="steps-post", zorder=1)


def _line(axes: Axes, points: list[Point], edge: float, style: dict, name: str) -> None:
    """A line through points; what has no error stands at the edge, with its name."""
    axes.plot([max(point.error, edge) for point in points], [point.cost for point in points], **style, clip_on=False)
    if all(point.error == 0 for point in points):
        at = (edge, points[0].cost)
        axes.annotate(name, at, (9, 0), textcoords="offset points", va="center", color=style["color"], weight="bold")


def _told(name: Any, slopes: dict[tuple[Any, str], list[tuple[str, float] | None]], dashed: Collection[str]) -> str:
    """A name of the legend with its slopes: rk4 order 4.0, dashed 0.9; from the smallest to the largest where panels differ."""
    told = {}
    for (_, contact), found in ((key, list(filter(None, each))) for key, each in slopes.items() if key[0] == name):
        if found:
            low, high = (f"{round(pick(value for _, value in found), 1) + 0.0:.1f}".replace("-", "−") for pick in (min, max))
            told["dashed" if contact in dashed else found[0][0]] = low if low == high else f"{low} to {high}"
    slopes_told = ", ".join(f"{what} {told[what]}" for what in sorted(told, key="dashed".__eq__))
    return f"{value_text(name)} {slopes_told}".rstrip()
