"""Where each method stays bounded: measured over step and strength of a field, with theory's limit drawn over it."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from runner.chart._names import label, number_text, sentence, words
from runner.chart._table import WHOLE, Column, column, distinct, numbers, split, told, varying
from sim import integrators

if TYPE_CHECKING:
    import pyarrow
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNSTABLE = 10.0  # times the energy at the start
#: What a cell is coloured by: the largest energy at the end over that at the start.
CLASSES = {
    "energy fell below a tenth": 1 / UNSTABLE,
    "stayed within tenfold": UNSTABLE,
    "grew more than tenfold: unstable": np.finfo(float).max,
    "diverged: unstable": np.inf,
}
COLOURS = ["#4393C3", "#F1F1F1", "#E06A10", "#222222"]
LINE = {"color": "#222222", "linewidth": 1.4}


class Theory(NamedTuple):
    """A linear field: its rate in 1/s times the step decides, held against a claim of the method."""

    symbol: str
    meaning: str
    claim: str  # of sim.integrators.Method
    strength: Callable[[np.ndarray, float], np.ndarray]  # at which the rate is so many 1/s, for a mass in kg


#: By the last part of the setting's name.
THEORY = {
    "stiffness": Theory("hω", "step × √(stiffness/mass)", "oscillator_limit", lambda rate, mass: mass * rate**2),
    "coefficient": Theory("hb", "step × coefficient/mass", "drag_limit", lambda rate, mass: mass * rate),
}


@dataclass(frozen=True)
class Chart:
    """A cell for each step `x` and strength `y` of a spring or drag, coloured by what became of the energy; a panel a method.

    A run is unstable when it diverged or its energy grew more than tenfold from start to end. Where nothing else acts, a
    stable step keeps the energy of a spring's ball within a small factor and takes it from drag's, while an unstable one
    multiplies it again and again: after thousands of steps ten tells them apart. Of the runs in a cell the worst counts.
    """

    x: Column  # the step, s
    y: Column  # the stiffness of a spring or the coefficient of a drag
    panel: Column = "solver.method"
    mass: Column = "balls.mass"
    title: str | None = None

    def __post_init__(self) -> None:
        if self.y.rpartition(".")[2] not in THEORY:
            raise ValueError(f"y: {self.y!r} is neither a spring's stiffness nor a drag's coefficient")


def draw(chart: Chart, table: pyarrow.Table, folder: Path) -> Figure:
    """Draw the chart; runs that failed, and those that a cell cannot show, are left out and told."""
    from runner.chart import _page

    x, y, mass = numbers(table, "x", chart.x), numbers(table, "y", chart.y), numbers(table, "mass", chart.mass)
    panel, method = split(table, "panel", chart.panel), column(table, "method", "method")
    grown, notes = _growths(table, {chart.x: x, chart.y: y, chart.mass: mass})
    cells = defaultdict(list)  # (panel, x, y) -> rows
    for row in grown:
        cells[panel[row], x[row], y[row]].append(row)
    if any(len(rows) > 1 for rows in cells.values()):
        notes.insert(0, f"a cell shows the worst of its runs ({', '.join(varying(table, cells.values()))})")

    theory = THEORY[chart.y.rpartition(".")[2]]
    notes.append(f"{theory.symbol} = {theory.meaning}")
    places = distinct(x[row] for row in grown), distinct(y[row] for row in grown)
    panels = distinct(panel[row] for row in grown) or distinct(panel)
    figure, grid = _page.panels(panels, chart.panel, label(chart.x), label(chart.y))
    for value, axes in grid.items():
        rows = [row for row in grown if panel[row] == value]
        _map(axes, *places, {(x[row], y[row]): max(grown[r] for r in cells[value, x[row], y[row]]) for row in rows})
        limits = {name: limit(theory, name) for name in distinct(method[row] for row in rows)}
        _theory(axes, theory, limits, distinct(mass[row] for row in rows))
    square = {"linestyle": "", "marker": "s", "markersize": 9, "markeredgecolor": "#bbbbbb"}
    styles = {name: square | {"color": colour} for name, colour in zip(CLASSES, COLOURS)} | {"theory's limit": LINE}
    title = chart.title or sentence(f"stability by {words(chart.x)} and {words(chart.y)}: measured, and by theory")
    _page.finish(figure, title, notes, "energy", styles)
    return figure


def limit(theory: Theory, method: str) -> float | None:
    """The largest stable product of step and rate that the method claims; None for one that claims nothing."""
    return getattr(integrators.load(method)[0], theory.claim) if method in integrators.names() else None


def _growths(table: pyarrow.Table, needed: dict[str, list[float | None]]) -> tuple[dict[int, float], list[str]]:
    """For each row the energy at the end over that at the start, infinite where the run diverged; and notes on rows that lack
    a positive figure in a column of `needed`."""
    status = column(table, "status", "status")
    needed |= {"energy_initial": numbers(table, "y", "energy_initial")}
    final, grown, missing = numbers(table, "y", "energy_final"), {}, Counter()
    for row, state in enumerate(status):
        absent = [words(name) for name, values in needed.items() if not (values[row] or 0) > 0]
        if state not in (*WHOLE, "diverged"):
            missing[f"{{}} {state} {{}} not shown"] += 1
        elif absent:
            missing[f"{{}} {{}} without {absent[0]} not shown"] += 1
        elif state != "diverged" and final[row] is None:
            missing["{} {} without final energy not shown"] += 1
        else:
            grown[row] = math.inf if state == "diverged" else final[row] / needed["energy_initial"][row]
    return grown, told(missing)


def _map(axes: Axes, columns: list[float], rows: list[float], cells: dict[tuple[float, float], float]) -> None:
    """A coloured cell around each (x, y) of `cells`, on logarithmic axes."""
    from matplotlib.colors import ListedColormap

    from runner.chart import _axes

    if not cells:
        return
    classes = np.full((len(rows), len(columns)), np.nan)
    for (across, up), grown in cells.items():
        classes[rows.index(up), columns.index(across)] = np.searchsorted(list(CLASSES.values()), grown)
    look = {"cmap": ListedColormap(COLOURS), "vmin": -0.5, "vmax": len(COLOURS) - 0.5, "edgecolor": "white", "linewidth": 0.4}
    axes.pcolormesh(edges(columns), edges(rows), classes, **look)
    axes.grid(False)
    _axes.set_scale(axes, "x", columns, "log")
    _axes.set_scale(axes, "y", rows, "log")


def edges(places: list[float]) -> np.ndarray:
    """Where the cells around places on a logarithmic axis meet: halfway."""
    logs = np.log(places)
    middles = (logs[1:] + logs[:-1]) / 2
    if len(logs) == 1:
        return np.exp([logs[0] - 0.5, logs[0] + 0.5])
    return np.exp([2 * logs[0] - middles[0], *middles, 2 * logs[-1] - middles[-1]])


def _theory(axes: Axes, theory: Theory, limits: dict[str, float | None], masses: list[float]) -> None:
    """Draw the limits of the panel's methods as lines where they are finite, and tell them above."""
    from matplotlib.patheffects import withStroke

    from runner.chart._style import GREY

    steps, strengths = np.array(axes.get_xlim()), axes.get_ylim()
    claims = []
    for claim in dict.fromkeys(limits.values()):
        match claim:
            case None:
                continue
            case 0.0:
                claims.append("by theory unstable at any step")
            case math.inf:
                claims.append("by theory stable at any step")
            case _:
                claims.append(f"by theory stable up to {theory.symbol} = {number_text(claim)}")
                for mass in masses:
                    line = axes.plot(steps, theory.strength(claim / steps, mass), **LINE)
                    line[0].set_path_effects([withStroke(linewidth=4.5, foreground="white")])
    axes.set_xlim(steps)
    axes.set_ylim(strengths)
    axes.set_title(axes.get_title(loc="left"), loc="left", weight="bold", pad=15)
    axes.annotate("; ".join(claims), (0, 1), (0, 4), "axes fraction", "offset points", color=GREY, fontsize=8)
