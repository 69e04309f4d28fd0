"""The chart of how the cost grows: what each ball, face, frame or run takes, over how many there are.

A level line is a cost in proportion to the work. What bends it stands where it does.
"""

from __future__ import annotations

import math
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from runner import store
from runner.bench.scaling import CROWD, IN_THE_BOX, OVER_HILLS, RECORDED, Point
from runner.machine import footer

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

REACH = 100_000  # runs, reckoned from the slope between the two largest sweeps
SMALL = 6.5  # points, of what is written among the curves
GAP = 4  # pixels around it
#: Places to write at, points to the right of another and above, the nearest first for a text of common width.
AROUND = sorted(product(range(-120, 121, 8), range(-96, 97, 6)), key=lambda at: math.hypot(max(abs(at[0]) - 40, 0), at[1]))


class Panel(NamedTuple):
    title: str
    x: str
    y: str
    unit: float  # s


PANELS = {
    "balls": Panel(f"Balls, {IN_THE_BOX:g} s in a box", "balls", "time per ball-second (µs)", 1e-6),
    "faces": Panel(f"Faces of hills, {CROWD} balls, {OVER_HILLS:g} s", "faces", "time per ball-second, or face (µs)", 1e-6),
    "frames": Panel(f"Frames of one ball in {RECORDED:g} s", "frames", "time per frame (µs)", 1e-6),
    "runs": Panel("Runs of one ball and 1501 frames", "runs", "time per run (ms)", 1e-3),
}


WHAT = ("exact", "symplectic_euler", "geometry", "trajectory.h5", "recording.rrd", "sweep", "dry run")


class Note(NamedTuple):
    """What bends a curve, at the point of one size."""

    grows: str
    what: str
    size: int
    text: str


#: In each panel first those that have few places to stand at.
NOTES = [
    Note("balls", "symplectic_euler", 4, "few: to start a run\nis most of it"),
    Note("balls", "symplectic_euler", 4096, "level: as the balls"),
    Note("balls", "exact", 262_144, "states, log and frames:\nfresh memory, out of the cache"),
    Note("faces", "exact", 524_288, "faces smaller than a ball,\nand out of the cache"),
    Note("faces", "symplectic_euler", 8192, "many faces, a tree:\nwith their logarithm"),
    Note("faces", "geometry", 18, "many small steps,\nhowever few the faces"),
    Note("frames", "recording.rrd", 101, "a file's objects,\nhowever little is in them"),
    Note("frames", "recording.rrd", 10_001, "then its bytes"),
    Note("frames", "exact", 11, "the flight itself, however\noften it is recorded"),
    Note("runs", "sweep", 10, "start-up of Python,\nlibraries and workers"),
    Note("runs", "sweep", 1000, "then each run and its files"),
    Note("runs", "dry run", 100, "start-up of Python,\nthen each run's settings"),
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
        drawn = [
            (axes, panel, grows, _draw_lines(axes, panel, [point for point in points if point.grows == grows]))
            for (grows, panel), axes in zip(PANELS.items(), figure.subplots(2, 2).ravel())
        ]
        notes = ["level: in proportion to the work", "small figures: the whole time", "dotted: reckoned from the slope"]
        _page.finish(figure, "What bends the cost as the work grows", notes, None, {})
        _page.sign(figure, footer())
        figure.canvas.draw()
        figure.set_layout_engine("none")  # from here on things stay where they are, so that it is known what is free
        for axes, panel, grows, lines in drawn:
            _write_among(axes, panel, lines, [note for note in NOTES if note.grows == grows])
        store.write_with(path, partial(figure.savefig, format=path.suffix[1:]))


def _draw_lines(axes: Axes, panel: Panel, points: list[Point]) -> dict[str, list[Point]]:
    """Draw what the points are of, a line each; these, with what is reckoned in the end of those of runs."""
    from runner.chart import _axes
    from runner.chart._style import looks

    lines = {what: line for what in WHAT if (line := [point for point in points if point.what == what])}
    axes.set(xlabel=panel.x, ylabel=panel.y)
    axes.set_title(panel.title, loc="left", weight="bold")
    axes.margins(x=0.2, y=0.22)
    for what, style in looks(WHAT).items():
        if line := lines.get(what):
            axes.plot(*zip(*_places(line, panel)), label=what, **style | {"markersize": 3})
            if line[0].grows == "runs":
                line.append(_reckoned(*line[-2:]))
                axes.plot(*zip(*_places(line[-2:], panel)), color=style["color"], linestyle=":")
    for which, values in zip("xy", zip(*_places([point for line in lines.values() for point in line], panel))):
        _axes.set_scale(axes, which, values, "log")
    axes.legend(fontsize=7.5, loc="upper right")
    return lines


def _places(line: list[Point], panel: Panel) -> list[tuple[float, float]]:
    return [(point.size, point.each / panel.unit) for point in line]


def _write_among(axes: Axes, panel: Panel, lines: dict[str, list[Point]], notes: list[Note]) -> None:
    """Write each line's time at both of its ends, in its colour, and the notes where there is room near their points."""
    from runner.chart._style import looks

    colours = {what: style["color"] for what, style in looks(WHAT).items()}
    taken = [axes.get_legend().get_window_extent()]
    for end, right, align in ((0, -4, "right"), (-1, 4, "left")):
        foot = -math.inf
        for what, line in sorted(lines.items(), key=lambda item: item[1][end].each):
            (place,) = _places([line[end]], panel)
            height = axes.transData.transform(place)[1] * 72 / axes.figure.dpi
            foot = max(height - 2.5, foot + 7)  # none over another
            written = _write(axes, _time(line[end].seconds), place, (right, foot - height), color=colours[what], ha=align)
            taken.append(_box(written))
    for note in notes:
        for place in _places([point for point in lines[note.what] if point.size == note.size], panel):
            taken.append(_write_near(axes, note.text, place, taken))


def _write(axes: Axes, text: str, place: tuple[float, float], offset: tuple[float, float], **look: Any) -> Annotation:
    """Write so many points to the right of a place and above it."""
    return axes.annotate(text, place, offset, textcoords="offset points", fontsize=SMALL, **look)


def _box(written: Annotation) -> Bbox:
    """What the text takes, in pixels, without its stroke."""
    from matplotlib.text import Text

    written.update_positions(written.figure.canvas.get_renderer())
    return Text.get_window_extent(written)


def _write_near(axes: Axes, text: str, place: tuple[float, float], taken: list[Bbox]) -> Bbox:
    """Write where the axes have room nearest to the place, on no line and no box that is taken, with a stroke to the place that,
    if it can be, crosses no line; the box that it takes."""
    from matplotlib.path import Path as Stroke

    from runner.chart._style import GREY

    look = {"arrowstyle": "-", "color": GREY, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 3}
    written = _write(axes, text, place, (0, 0), color=GREY, ha="center", va="center", arrowprops=look)
    room, start = axes.get_window_extent(), axes.transData.transform(place)
    lines = [line.get_transform().transform_path(line.get_path()) for line in axes.lines]
    for strict, offset in product((True, False), AROUND):
        written.set_position(offset)
        box = _box(written).padded(GAP)
        way = (box.p0 + box.p1) / 2 - start
        stroke = Stroke([start + 0.2 * way, start + way])  # it begins on a line
        if (
            (box.p0 > room.p0).all()
            and (box.p1 < room.p1).all()
            and not any(line.intersects_bbox(box, False) or strict and line.intersects_path(stroke) for line in lines)
            and not any(box.overlaps(other) or stroke.intersects_bbox(other) for other in taken)
        ):
            break
    return box


def _reckoned(few: Point, many: Point) -> Point:
    """What REACH runs take, as the cost grew between two numbers of them."""
    seconds = many.seconds + (REACH - many.size) * (many.seconds - few.seconds) / (many.size - few.size)
    return Point(many.grows, many.what, REACH, seconds, seconds / REACH)


def _time(seconds: float) -> str:
    for unit, size in (("min", 60), ("s", 1), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size * (3 if unit == "min" else 1):
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
