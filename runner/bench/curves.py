"""The chart of how the cost grows: what each ball, face, frame or run takes, over how many there are.

A level line is a cost in proportion to the work. What bends it stands where it does.
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from runner import store
from runner.bench.scaling import CROWD, IN_THE_BOX, OVER_HILLS, RECORDED, Point
from runner.machine import footer

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REACH = 100_000  # runs, reckoned from the slope between the two largest sweeps
HEIGHT = 150  # points, of a pair of axes


class Panel(NamedTuple):
    title: str
    x: str
    y: str
    unit: float  # s


PANELS = {
    "balls": Panel(f"Balls, {IN_THE_BOX:g} s in a box", "balls", "µs a ball and simulated second", 1e-6),
    "faces": Panel(f"Faces of hills, {CROWD} balls, {OVER_HILLS:g} s", "faces", "µs a ball and simulated second; a face", 1e-6),
    "frames": Panel(f"Frames of one ball in {RECORDED:g} s", "frames", "µs a frame", 1e-6),
    "runs": Panel("Runs of one ball and 1501 frames", "runs", "ms a run", 1e-3),
}


WHAT = ("exact", "symplectic_euler", "geometry", "trajectory.h5", "recording.rrd", "sweep", "planning")


class Note(NamedTuple):
    """What bends a curve, at the point of one size."""

    grows: str
    what: str
    size: int
    text: str
    right: float  # from the point to the text's left end and foot, in points
    up: float


NOTES = [
    Note("balls", "symplectic_euler", 4, "few: to start a run\nis most of it", 12, 16),
    Note("balls", "symplectic_euler", 4096, "level: as the balls", -20, 18),
    Note("balls", "exact", 16384, "states, log and frames\noutgrow the cache", -46, 20),
    Note("faces", "geometry", 18, "many small steps,\nhowever few the faces", 14, 14),
    Note("faces", "symplectic_euler", 8192, "beyond 32 faces a tree:\nwith their logarithm", -30, 20),
    Note("faces", "exact", 524_288, "faces smaller than a ball,\nand out of the cache", -66, -42),
    Note("frames", "trajectory.h5", 101, "a file's objects,\nhowever little is in them", 14, 6),
    Note("frames", "recording.rrd", 10_001, "then its bytes", -20, 18),
    Note("frames", "symplectic_euler", 11, "the flight itself, however\noften it is recorded", -44, -66),
    Note("runs", "sweep", 10, "start-up of Python,\nlibraries and workers", 14, 10),
    Note("runs", "sweep", 1000, "then each run and its files", -10, 22),
    Note("runs", "planning", 100, "reading the file,\nthen each run's settings", -76, -22),
]


def draw(points: list[Point], path: Path) -> None:
    """Draw the chart and write it to `path`, PNG or SVG by its suffix; of the sweeps there must be two or more."""
    from matplotlib import style
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from runner.chart import _page
    from runner.chart._style import STYLE

    with style.context(["default", STYLE]):
        figure = Figure(figsize=(_page.WIDTH, 6.8), layout="constrained")
        FigureCanvasAgg(figure)
        for (grows, panel), axes in zip(PANELS.items(), figure.subplots(2, 2).ravel()):
            _draw_panel(axes, grows, panel, [point for point in points if point.grows == grows])
        notes = ["level: in proportion to the work", "small figures: the time of all", "dotted: reckoned from the slope"]
        _page.finish(figure, "What bends the cost as the work grows", notes, None, {})
        _page.sign(figure, footer())
        store.write_with(path, partial(figure.savefig, format=path.suffix[1:]))


def _draw_panel(axes: Axes, grows: str, panel: Panel, points: list[Point]) -> None:
    from runner.chart import _axes
    from runner.chart._style import looks

    lines = {what: [point for point in points if point.what == what] for what in WHAT}
    reckoned = {"sweep": _reckoned(*lines["sweep"][-2:])} if lines["sweep"] else {}
    axes.set(xlabel=panel.x, ylabel=panel.y)
    axes.set_title(panel.title, loc="left", weight="bold")
    axes.margins(x=0.2, y=0.22)
    for which, values in zip("xy", _places([*points, *reckoned.values()], panel)):
        _axes.set_scale(axes, which, values, "log")
    starts, ends = {}, {}
    for what, style in looks(WHAT).items():
        if line := lines[what]:
            axes.plot(*_places(line, panel), label=what, **style | {"markersize": 3})
            last = reckoned.get(what, line[-1])
            axes.plot(*_places([line[-1], last], panel), color=style["color"], linestyle=":")
            starts[line[0]], ends[last] = style["color"], style["color"]
    _write_apart(axes, starts, panel, -4, "right")
    _write_apart(axes, ends, panel, 4, "left")
    for note in NOTES:
        for point in lines[note.what]:
            if (note.grows, note.size) == (grows, point.size):
                _write(axes, point, panel, note.text, note.right, note.up)
    axes.legend(fontsize=7.5)


def _places(line: list[Point], panel: Panel) -> tuple[list[float], list[float]]:
    return [point.size for point in line], [point.each / panel.unit for point in line]


def _write(
    axes: Axes, point: Point, panel: Panel, text: str, right: float, up: float, colour: str = "", align: str = "left"
) -> None:
    """Write at a point, in its line's colour, or as a note with a stroke to it."""
    from runner.chart._style import GREY

    stroke = None if colour else {"arrowstyle": "-", "color": GREY, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 3}
    axes.annotate(
        text, (point.size, point.each / panel.unit), (right, up), textcoords="offset points", fontsize=6.5,
        color=colour or GREY, ha=align, arrowprops=stroke,
    )  # fmt: skip


def _write_apart(axes: Axes, points: dict[Point, str], panel: Panel, right: float, align: str) -> None:
    """Write each point's time beside it in its colour, none over another."""
    low, high = axes.get_ylim()
    per_decade = HEIGHT / math.log10(high / low)
    foot = -math.inf
    for point, colour in sorted(points.items(), key=lambda item: item[0].each):
        at = per_decade * math.log10(point.each / panel.unit)
        foot = max(at - 2.5, foot + 7)
        _write(axes, point, panel, _time(point.seconds), right, foot - at, colour, align)


def _reckoned(few: Point, many: Point) -> Point:
    """A sweep of REACH runs, as the cost grew between two."""
    seconds = many.seconds + (REACH - many.size) * (many.seconds - few.seconds) / (many.size - few.size)
    return Point(many.grows, many.what, REACH, seconds, seconds / REACH)


def _time(seconds: float) -> str:
    for unit, size in (("min", 60), ("s", 1), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size * (3 if unit == "min" else 1):
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
