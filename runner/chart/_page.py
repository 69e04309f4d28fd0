"""The page a chart is drawn on: small multiples, colours, scales, legend, title, notes and footer."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedFormatter, FixedLocator, FuncFormatter, NullFormatter, NullLocator
from matplotlib.transforms import ScaledTranslation, Transform

from runner.chart import _names
from runner.chart._table import distinct, numeric

INK, GREY, GRID = "#222222", "#666666", "#e4e4e4"

STYLE = {
    "font.size": 9,
    "text.color": INK,
    "text.parse_math": False,  # a name may hold a $
    "axes.edgecolor": "#999999",
    "axes.labelcolor": INK,
    "axes.labelsize": 9,
    "axes.titlesize": 9,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "xtick.color": "#999999",
    "ytick.color": "#999999",
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
    "savefig.dpi": 200,
    "svg.fonttype": "none",  # text stays text: to be searched, selected and read aloud
    "svg.hashsalt": "carom",  # the same chart gives the same bytes
}

#: Okabe and Ito's colours for all kinds of colour vision, without the yellow, which is too light for a line on white.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#555555"]
DASHES = ["-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (5, 1.2, 1.2, 1.2))]
MARKERS = "osD^vPX"

FEW = 8  # places along x: each gets its tick and markers
WIDTH = 8.0  # inches: 800 px in a README
MARGIN = 0.12
NUMERIC_COLOURS = (0.0, 0.85)  # of viridis; its end is too light


def panels(values: Iterable[Any], column: str | None) -> tuple[Figure, dict[Any, Axes]]:
    """A page with one pair of axes for each of the values, headed by it unless `column`, theirs, is None."""
    values = list(values)
    columns = {1: 1, 2: 2, 4: 2}.get(len(values), 3)
    rows = -(-len(values) // columns)
    figure = Figure(figsize=(WIDTH, 4.6 if len(values) == 1 else 1.4 + 2.4 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes in grid[len(values) :]:
        axes.remove()
    for axes in grid[max(0, len(values) - columns) : len(values)]:
        axes.tick_params(labelbottom=True)  # nothing stands below
    if column:
        for value, axes in zip(values, grid):
            axes.set_title(_names.heading(column, value), loc="left")
    return figure, dict(zip(values, grid))


def looks(values: Iterable[Any]) -> dict[Any, dict[str, Any]]:
    """Colour, dash and marker of each of the values; numbers run through a scale of colours, names stand apart."""
    values = list(values)
    if numeric(values) and len(values) > 1:
        colours = [tuple(c) for c in colormaps["viridis"](np.linspace(*NUMERIC_COLOURS, len(values)))]
    else:
        colours = [COLOURS[i % len(COLOURS)] for i in range(len(values))]
    dashes = [DASHES[i // len(COLOURS) % len(DASHES)] for i in range(len(values))]
    markers = [MARKERS[i % len(MARKERS)] for i in range(len(values))]
    return {v: {"color": c, "linestyle": d, "marker": m} for v, c, d, m in zip(values, colours, dashes, markers)}


def scale(values: Iterable[float]) -> str:
    """The scale that shows values apart.

    Positive ones: log when they span two decades, unless they are evenly spaced. With zeros or both signs: symlog when
    a linear axis would press a quarter of them onto zero, below a hundredth of its length. Otherwise linear.
    """
    values = np.unique(np.asarray(list(values), dtype=float))
    sizes = np.unique(np.abs(values[values != 0]))
    if not len(sizes) or sizes[-1] < 99.9 * sizes[0]:
        return "linear"
    if values[0] > 0:
        gaps = np.diff(values)
        return "linear" if len(gaps) > 1 and np.allclose(gaps, gaps[0]) else "log"
    return "symlog" if np.quantile(sizes, 0.25, method="lower") <= sizes[-1] / 100 else "linear"


def set_scale(axes: Axes, which: str, values: Iterable[float], kind: str | None = None) -> None:
    """Give the "x" or "y" axis the scale for `values`, or the `kind` given, and ticks with plain numbers.

    A symlog scale turns linear below the smallest size in `values`.
    """
    values = np.asarray(list(values), dtype=float)
    kind = kind or scale(values)
    options = {"linthresh": np.abs(values[values != 0]).min(), "linscale": 0.5} if kind == "symlog" else {}
    getattr(axes, f"set_{which}scale")(kind, **options)
    axis = getattr(axes, f"{which}axis")
    axis.set_major_formatter(FuncFormatter(lambda value, _: _names.number_text(value)))
    axis.set_minor_formatter(NullFormatter())


def band(axes: Axes, along: Sequence[float], low: Sequence[float], high: Sequence[float], style: dict[str, Any]) -> None:
    """A light band from `low` to `high`, in the colour of the line that goes with it."""
    axes.fill_between(along, low, high, color=style["color"], alpha=0.13, linewidth=0)


def shift(number: int, count: int, width: float) -> float:
    """How far the `number`th of `count` series stands from its place, so that all stand side by side."""
    return (number / (count - 1) - 0.5) * width if count > 1 else 0.0


def beside(axes: Axes, points: float) -> Transform:
    """The axes' data moved to the right by some points."""
    return axes.transData + ScaledTranslation(points / 72, 0, axes.figure.dpi_scale_trans)


def ticks_at(axes: Axes, values: Sequence[float]) -> None:
    """Put the ticks of the x axis at the values measured, where they are few and stand apart."""
    if not 1 < len(values) <= FEW:
        return
    places = axes.transScale.transform([(v, 1) for v in values])[:, 0]
    if np.diff(places).min() > 0.08 * np.ptp(places):
        axes.xaxis.set_major_locator(FixedLocator(values))
        axes.xaxis.set_minor_locator(NullLocator())


def name_ticks(axes: Axes, names: list[str]) -> None:
    """Write names along the x axis at 0, 1, 2, ..., broken after underscores to stand side by side."""
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.xaxis.set_major_locator(FixedLocator(range(len(names))))
    axes.xaxis.set_major_formatter(FixedFormatter([textwrap.fill(n.replace("_", "_ "), 14).replace("_ ", "_") for n in names]))
    axes.tick_params(axis="x", length=0)
    axes.grid(False, axis="x")


def finish(
    figure: Figure, title: str, notes: list[str], labels: tuple[str, str], series: str | None, styles: dict[Any, dict]
) -> None:
    """Write the labels of both axes, and above them title, notes and a legend of `series`; keep room for the footer."""
    for axes in figure.axes:
        place = axes.get_subplotspec()
        below = any(other.get_subplotspec().rowspan.start > place.rowspan.start
                    and other.get_subplotspec().colspan.start == place.colspan.start for other in figure.axes)
        axes.set_xlabel("" if below else labels[0])
        axes.set_ylabel(labels[1] if place.is_first_col() else "")
        if not axes.has_data():
            axes.text(0.5, 0.5, "nothing to show", transform=axes.transAxes, ha="center", color=GREY)
    _, height = figure.get_size_inches()
    left, y = MARGIN / WIDTH, height - 0.1
    figure.text(left, y / height, title, size=12, weight="bold", va="top")
    y -= 0.28
    for line in textwrap.wrap("; ".join(notes), 125):
        figure.text(left, y / height, line, size=8, color=GREY, va="top")
        y -= 0.16
    if series and styles:
        y -= 0.04 + _legend(figure, left, y / height - 0.04 / height, series, styles)
    bottom = 0.3 / height
    figure.get_layout_engine().set(rect=(0, bottom, 1, y / height - bottom), w_pad=0.08, h_pad=0.06)


def _legend(figure: Figure, left: float, top: float, column: str, styles: dict[Any, dict[str, Any]]) -> float:
    """A legend in as few lines as fit into the page's width; its height in inches."""
    handles = [Line2D([], [], label=_names.value_text(value), **style) for value, style in styles.items()]
    if numeric(styles):  # a bare number needs to be told what it is
        handles.insert(0, Line2D([], [], linestyle="none", label=_names.label(column) + ":"))
    for columns in range(len(handles), 0, -1):
        legend = figure.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(left, top), ncols=columns,
            borderpad=0, borderaxespad=0, columnspacing=1.6, handlelength=2.2,
        )  # fmt: skip
        box = legend.get_window_extent(figure.canvas.get_renderer())
        if columns == 1 or box.width < (WIDTH - 2 * MARGIN) * figure.dpi:
            return box.height / figure.dpi
        legend.remove()
    raise AssertionError("unreachable")


def sign(figure: Figure, footer: str) -> None:
    """Write the footer, small, on the page's last lines."""
    _, height = figure.get_size_inches()
    text = "\n".join(textwrap.wrap(footer, 160))
    figure.text(MARGIN / WIDTH, 0.06 / height, text, size=6.5, color=GREY, va="bottom", linespacing=1.1)
