"""The page a chart is drawn on: small multiples, below a title, notes and a legend, above a footer."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation, Transform

from runner.chart._names import heading, label, value_text
from runner.chart._style import GREY
from runner.chart._table import numeric

WIDTH = 8.0  # inches: 800 px in a README
MARGIN = 0.12  # inches, as all sizes here
FOOT = 0.26  # two lines of footer


def panels(values: Iterable[Any], column: str | None, x_label: str, y_label: str) -> tuple[Figure, dict[Any, Axes]]:
    """A page with one pair of axes for each of the values, headed by it unless `column`, theirs, is None."""
    values = list(values)
    columns = {1: 1, 2: 2, 4: 2}.get(len(values), 3)
    rows = -(-len(values) // columns)
    figure = Figure(figsize=(WIDTH, 3.9 if len(values) == 1 else 0.2 + 2.5 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for place, axes in enumerate(grid):
        if place >= len(values):
            axes.remove()
            continue
        if place + columns >= len(values):  # nothing stands below
            axes.set_xlabel(x_label)
            axes.tick_params(labelbottom=True)
        if place % columns == 0:
            axes.set_ylabel(y_label)
        if column:
            axes.set_title(heading(column, values[place]), loc="left", weight="bold")
    return figure, dict(zip(values, grid))


def finish(figure: Figure, title: str, notes: list[str], series: str | None, styles: dict[Any, dict[str, Any]]) -> None:
    """Add title, notes and the legend of the column `series` above the axes, and room for the footer below them."""
    for axes in figure.axes:
        if not axes.has_data():
            axes.text(0.5, 0.5, "nothing to show", transform=axes.transAxes, ha="center", va="center", color=GREY)
    if not any(axes.has_data() for axes in figure.axes):
        figure.axes[0].set(xticks=[], yticks=[])
    _write(figure, 0.1, title, size=12, weight="bold")
    head = 0.38
    for line in textwrap.wrap("; ".join(notes), 132):
        _write(figure, head, line, size=8, color=GREY)
        head += 0.16
    if series:
        head += 0.06 + _legend(figure, head + 0.06, series, styles)
    head += 0.06
    height = round(figure.get_figheight() + head + FOOT, 2)
    figure.set_figheight(height)
    figure.get_layout_engine().set(rect=(0, FOOT / height, 1, 1 - (head + FOOT) / height), w_pad=0.08, h_pad=0.06)


def sign(figure: Figure, footer: str) -> None:
    """Write the footer, small, at the foot of the page."""
    text = "\n".join(textwrap.wrap(footer, 160, max_lines=2, placeholder=" ..."))
    _write(figure, figure.get_figheight() - 0.06, text, size=6.5, color=GREY, va="bottom", linespacing=1.1)


def _write(figure: Figure, down: float, text: str, **look: Any) -> float:
    """Write text from the left margin, so far down from the top of the page; where it ends."""
    written = figure.text(MARGIN, -down, text, transform=_from_top(figure), **{"va": "top", **look})
    return written.get_window_extent(figure.canvas.get_renderer()).x1 / figure.dpi


def _legend(figure: Figure, down: float, column: str, styles: dict[Any, dict[str, Any]]) -> float:
    """A legend in as few lines as fit the page's width; its height."""
    left = MARGIN
    if numeric(styles):  # a bare number must be told what it is
        left = 0.15 + _write(figure, down - 0.01, label(column) + ":")
    handles = [Line2D([], [], label=value_text(value), **style) for value, style in styles.items()]
    for columns in range(len(handles), 0, -1):
        legend = figure.legend(
            handles=handles,
            ncols=columns,
            loc="upper left",
            bbox_to_anchor=(left, -down),
            bbox_transform=_from_top(figure),
            borderpad=0,
            borderaxespad=0,
            columnspacing=1.6,
            handlelength=2.2,
        )
        box = legend.get_window_extent(figure.canvas.get_renderer())
        if columns == 1 or box.width < (WIDTH - MARGIN - left) * figure.dpi:
            break
        legend.remove()
    return box.height / figure.dpi


def _from_top(figure: Figure) -> Transform:
    """Inches from the upper left corner, whatever height the page gets."""
    return figure.dpi_scale_trans + ScaledTranslation(0, 1, figure.transFigure)
