"""The chart of how the cost grows: what each ball, face, frame or run takes, over how many there are.

A level line is a cost in proportion to the work. What bends it stands where it does.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from runner import store
from runner.bench.scaling import CROWD, IN_THE_BOX, OVER_HILLS, RECORDED, Point
from runner.machine import footer

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REACH = 100_000  # runs, reckoned from the slope between the two largest sweeps


class Panel(NamedTuple):
    title: str
    x: str
    y: str
    unit: float  # s


PANELS = {
    "balls": Panel(f"Balls, {IN_THE_BOX:g} s in a box", "balls", "µs a ball and simulated second", 1e-6),
    "faces": Panel(f"Faces of hills, {CROWD} balls, {OVER_HILLS:g} s", "faces", "µs a ball and simulated second; a face", 1e-6),
    "frames": Panel(f"Frames of one ball in {RECORDED:g} s", "frames", "µs a frame", 1e-6),
    "runs": Panel("Runs of a sweep, one ball, 1501 frames each", "runs", "ms a run", 1e-3),
}


class Note(NamedTuple):
    """What bends a curve, at one of its points."""

    grows: str
    what: str
    size: int
    text: str
    right: float  # of the point, in points, the text's left end
    up: float


NOTES: list[Note] = []


def draw(points: list[Point], path: Path) -> None:
    """Draw the chart and write it to `path`, PNG or SVG by its suffix."""
    from matplotlib import style
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from runner.chart import _page
    from runner.chart._style import STYLE

    with style.context(["default", STYLE]):
        figure = Figure(figsize=(_page.WIDTH, 6.4), layout="constrained")
        FigureCanvasAgg(figure)
        for (grows, panel), axes in zip(PANELS.items(), figure.subplots(2, 2).ravel()):
            _draw_panel(axes, grows, panel, [point for point in points if point.grows == grows])
        notes = ["level: in proportion to the work", "small figures: the time of all", "dotted: reckoned from the slope"]
        _page.finish(figure, "What bends the cost as the work grows", notes, None, {})
        _page.sign(figure, footer())
        store.write_with(path, partial(figure.savefig, format=path.suffix[1:] or "png"))


def _draw_panel(axes: Axes, grows: str, panel: Panel, points: list[Point]) -> None:
    from runner.chart._style import GREY, looks

    styles = looks(dict.fromkeys(point.what for point in points))
    axes.set(xscale="log", yscale="log", xlabel=panel.x, ylabel=panel.y)
    axes.set_title(panel.title, loc="left", weight="bold")
    axes.margins(x=0.12, y=0.22)
    for what, style in styles.items():
        line = [point for point in points if point.what == what]
        axes.plot([p.size for p in line], [p.each / panel.unit for p in line], label=what, **style | {"markersize": 3})
        if what == "sweep" and len(line) > 1:
            line.append(_reckoned(*line[-2:]))
            axes.plot([p.size for p in line[-2:]], [p.each / panel.unit for p in line[-2:]], color=style["color"], linestyle=":")
        for point in (line[0], line[-1]):
            axes.annotate(
                _time(point.seconds), (point.size, point.each / panel.unit), (0, 4), textcoords="offset points",
                ha="center", fontsize=6.5, color=style["color"],
            )  # fmt: skip
        for note in NOTES:
            if (note.grows, note.what) == (grows, what):
                point = min(line, key=lambda p: abs(p.size - note.size))
                axes.annotate(
                    note.text, (point.size, point.each / panel.unit), (note.right, note.up), textcoords="offset points",
                    fontsize=7, color=GREY, arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.5},
                )  # fmt: skip
    axes.legend(fontsize=7.5)


def _reckoned(few: Point, many: Point) -> Point:
    """A sweep of REACH runs, as the cost grew between two."""
    seconds = many.seconds + (REACH - many.size) * (many.seconds - few.seconds) / (many.size - few.size)
    return Point(many.grows, many.what, REACH, seconds, seconds / REACH)


def _time(seconds: float) -> str:
    for unit, size in (("min", 60), ("s", 1), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size * (3 if unit == "min" else 1):
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
