"""Scales and ticks, and the marks for a range."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.ticker import FixedFormatter, FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator
from matplotlib.transforms import ScaledTranslation

from runner.chart._names import number_text

FEW = 8  # places along x: each gets a tick, and the series stand side by side
MOST_TICKS, LEAST_TICKS = 8, 4  # on one side of a logarithmic axis, of a whole figure and of a small multiple


def scale(values: Iterable[float]) -> str:
    """The scale that shows values apart: "linear", "log" or "symlog".

    Positive ones: log when they span two decades, unless they are five or more, evenly spaced. With zeros or both
    signs: symlog when a linear axis would press a quarter of them onto zero, below a hundredth of its length.
    """
    values = np.unique(np.asarray(list(values), dtype=float))
    sizes = np.unique(np.abs(values[values != 0]))
    if not len(sizes) or sizes[-1] < 99.9 * sizes[0]:  # 99.9: two decades, of numbers that are rounded
        return "linear"
    if values[0] > 0:
        gaps = np.diff(values)
        return "linear" if len(gaps) > 3 and np.allclose(gaps, gaps[0]) else "log"
    return "symlog" if np.quantile(sizes, 0.25, method="lower") <= sizes[-1] / 100 else "linear"


def set_scale(axes: Axes, which: str, values: Iterable[float], kind: str | None = None) -> None:
    """Give the "x" or "y" axis the scale for `values`, or the `kind` given, and ticks that read well.

    A symlog scale turns linear below the decade of the smallest size.
    """
    values = np.asarray(list(values), dtype=float)
    sizes = np.abs(values[values != 0])
    kind = kind or scale(values)
    low = math.floor(math.log10(sizes.min()) + 1e-9) if kind != "linear" else 0
    getattr(axes, f"set_{which}scale")(kind, **({"linthresh": 10.0**low} if kind == "symlog" else {}))
    axis = getattr(axes, f"{which}axis")
    powers = kind != "linear" and bool(sizes.min() < 1e-3 or sizes.max() >= 1e5)
    axis.set_major_formatter(FuncFormatter(lambda value, _: number_text(value, powers)))
    axis.set_minor_formatter(NullFormatter())
    if kind == "linear":
        return
    high = math.floor(math.log10(sizes.max()) + 1e-9)
    narrow = which == "x" and axes.get_position().width < 0.4 or kind == "symlog" and values.min() < 0 < values.max()
    every = max(1, math.ceil((high - low + 1) / (LEAST_TICKS if narrow else MOST_TICKS)))
    if kind == "symlog":  # which has one decade's length from zero to `low`
        ticks = [10.0**e for e in range(low, high + 1) if e % every == 0 and e - low + 1 >= every]
        axis.set_major_locator(FixedLocator([-tick for tick in reversed(ticks)] + [0] + ticks))
        axis.set_minor_locator(NullLocator())
        if values.min() >= 0:  # matplotlib's margin would reach far below zero
            room = 0.05 * (math.log10(sizes.max()) - low + 1)
            getattr(axes, f"set_{which}lim")(-room * 10.0**low, sizes.max() * 10.0**room)
    elif not narrow and sizes.max() < 100 * sizes.min():  # a single power of ten would tell little
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    elif every > 1:
        axis.set_major_locator(FixedLocator([10.0**e for e in range(low, high + 2) if e % every == 0]))
        axis.set_minor_locator(NullLocator())


def ticks_at(axes: Axes, values: Sequence[float]) -> None:
    """Put the ticks of the x axis at the values themselves, where they are few and stand apart."""
    if not 0 < len(values) <= FEW:
        return
    places = axes.transScale.transform([(v, 1) for v in values])[:, 0]
    if np.all(np.diff(places) > 0.08 * axes.get_gridspec().ncols * np.ptp(places)):
        axes.xaxis.set_major_locator(FixedLocator(values))
        axes.xaxis.set_minor_locator(NullLocator())


def name_ticks(axes: Axes, names: list[str]) -> None:
    """Write names along the x axis at 0, 1, 2, ..., broken after underscores or, where that is too wide, aslant."""
    room = 110 // axes.get_gridspec().ncols // max(len(names), 1)  # characters
    broken = [textwrap.fill(n.replace("_", "_ "), max(room, 1), break_long_words=False) for n in names]
    aslant = any(len(line) > room for name in broken for line in name.split("\n"))
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.xaxis.set_major_locator(FixedLocator(range(len(names))))
    axes.xaxis.set_major_formatter(FixedFormatter(names if aslant else [name.replace("_ ", "_") for name in broken]))
    for each in axes.figure.axes:
        each.tick_params(axis="x", length=0)
        each.grid(False, axis="x")
        for text in each.get_xticklabels() if aslant else ():
            text.set(rotation=30 if room > 4 else 90, horizontalalignment="right", rotation_mode="anchor")


def band(axes: Axes, along: Sequence[float], low: Sequence[float], high: Sequence[float], colour: object) -> None:
    """A light band from `low` to `high`."""
    axes.fill_between(along, low, high, color=colour, alpha=0.13, linewidth=0)


def bars(axes: Axes, along: Sequence[float], low: Sequence[float], high: Sequence[float], colour: object) -> Artist:
    """A light bar from `low` to `high` at each place: where bands would hide each other."""
    return axes.vlines(along, low, high, color=colour, alpha=0.35, linewidth=2.5)


def aside(number: int, count: int, width: float) -> float:
    """How far the `number`th of `count` series stands from its place, when all stand side by side."""
    return (number / (count - 1) - 0.5) * width if count > 1 else 0.0


def move(drawn: Iterable[Artist], points: float) -> None:
    """Draw lines some points further to the right; their data stay as they are."""
    for artist in drawn:
        figure = artist.axes.figure
        artist.set_transform(artist.axes.transData + ScaledTranslation(points / 72, 0, figure.dpi_scale_trans))
