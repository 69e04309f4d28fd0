"""The energy residual against time: what each method gained or lost on its own account."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from runner import store
from runner.chart._names import label
from runner.chart._table import WHOLE, Column, column, distinct, split, spread_note, told
from runner.record import hdf5

if TYPE_CHECKING:
    import pyarrow
    from matplotlib.figure import Figure

FAILED = ("failed", "crashed")
MOST_LINES = 12  # in one panel; above, each series shows the median of its runs and their range
BELOW = 0.1  # of the best run's largest residual: where a logarithmic axis ends and what is smaller sinks to zero


@dataclass(frozen=True)
class Chart:
    """The energy residual of each run against time, coloured by `series`, in small multiples by `panel`.

    With many runs, the median of those of a series, in a band from the smallest to the largest. What is gained stands above
    zero, what is lost below; where the runs' residuals lie decades apart, as methods' do, on an axis that is logarithmic
    either way.
    """

    series: Column | None = None
    panel: Column | None = None
    title: str | None = None


def draw(chart: Chart, table: pyarrow.Table, folder: Path) -> Figure:
    """Draw the chart from the runs' trajectory files; runs that failed or have none are left out and told.

    A run that diverged is drawn as far as it went, and may leave the chart.
    """
    from runner.chart import _axes, _page, _style

    series, panel = split(table, "series", chart.series), split(table, "panel", chart.panel)
    status = column(table, "status", "status")
    curves, notes = _curves(table, folder)
    groups = defaultdict(list)  # (panel, series) -> rows
    for row in curves:
        groups[panel[row], series[row]].append(row)
    diverged = any(status[row] == "diverged" for row in curves)
    many = max(Counter(panel[row] for row in curves).values(), default=0) > MOST_LINES
    notes.append("energy is gained above zero, lost below")
    if many and (note := spread_note(table, groups.values())):
        notes.insert(0, note)
        if diverged:
            notes.append("a diverged run counts as infinite after its end")

    steady = [row for row in curves if status[row] != "diverged"] or list(curves)
    peaks = [peak for row in steady if (peak := np.abs(curves[row][1]).max()) > 0] or [1.0]
    log = _axes.scale(peaks) == "log"
    styles = {value: {**style, "marker": ""} for value, style in _style.looks(distinct(series)).items()}
    figure, grid = _page.panels(distinct(panel), chart.panel, "time (s)", label("energy_residual"))
    for value, style in styles.items():
        for panel_value, axes in grid.items():
            rows = groups[panel_value, value]
            if rows and many:
                time, residuals = _together([(*curves[row], status[row] == "diverged") for row in rows])
                far = 1e3 * max(peaks)  # outside the chart, yet within what can be drawn
                residuals = np.clip(residuals, -far, far)
                _axes.band(axes, time, np.nanmin(residuals, axis=0), np.nanmax(residuals, axis=0), style["color"])
                axes.plot(time, np.nanmedian(residuals, axis=0), **style)
            else:
                for row in rows:
                    axes.plot(*curves[row], **style, linewidth=1)

    for axes in grid.values():
        if axes.has_data():
            axes.axhline(0, color=_style.PALE, linewidth=0.8, zorder=1, gid="zero")
    first = next(iter(grid.values()))
    first.set_xlim(0, max((time[-1] for time, _ in curves.values()), default=1))
    _axes.set_scale(first, "x", [], "linear")
    if log:
        least = min(peaks) * BELOW
        low, high = (reach(reach(curves[row][1]) for row in steady) for reach in (min, max))
        low, high = min(low, -least), max(high, least)
        _axes.set_scale(first, "y", [low, -least, least, high], "symlog")
        first.set_ylim(5 * low, 5 * high)
    else:
        _axes.set_scale(first, "y", [], "linear")
        if diverged:
            first.set_ylim(-1.5 * max(peaks), 1.5 * max(peaks))
    _page.finish(figure, chart.title or "Energy residual against time", notes, chart.series, styles)
    return figure


def _curves(table: pyarrow.Table, folder: Path) -> tuple[dict[int, tuple[np.ndarray, np.ndarray]], list[str]]:
    """Time and residual for each row of the table that has them, and notes on the others."""
    curves, notes, recorded = {}, Counter(), store.holding(folder, hdf5.FILE)
    for row, (run_id, status) in enumerate(zip(column(table, "run_id", "run_id"), column(table, "status", "status"))):
        if status in FAILED:
            notes[f"{{}} {status} {{}} not shown"] += 1
        elif run_id not in recorded or (curve := _residual(recorded[run_id], run_id)) is None:
            notes["{} {} without a trajectory not shown"] += 1
        else:
            curves[row] = curve
            if status not in WHOLE:
                notes[f"{{}} {status} {{}} stopped early"] += 1
    return curves, told(notes)


def _residual(entry: Path, run_id: str) -> tuple[np.ndarray, np.ndarray] | None:
    """Time and energy residual of a run at its finite frames; None where it has none. Raises Damaged."""
    ((time, value),) = hdf5.read(entry, run_id, "observables/energy_residual")
    finite = np.isfinite(value)
    return (time[finite], value[finite]) if finite.any() else None


def _together(curves: list[tuple[np.ndarray, np.ndarray, bool]]) -> tuple[np.ndarray, np.ndarray]:
    """The residuals of runs at equal times, of (time, residual, diverged) each: times (n,), residuals (runs, n).

    Only times at which every run still going has a frame, so that the same runs stand behind each median. After its
    end a run is NaN, one that diverged infinite: a median must not fall because the worst run is gone.
    """
    grids = [np.round(time, 9) for time, _, _ in curves]  # 3 x 0.1 s is 30 x 0.01 s
    times = np.unique(np.concatenate(grids))
    values = np.full((len(curves), len(times)), np.nan)
    known = np.zeros(values.shape, dtype=bool)
    for row, (time, (_, residual, diverged)) in enumerate(zip(grids, curves)):
        ended = times > time[-1]
        values[row, ended] = np.copysign(np.inf, residual[-1]) if diverged else np.nan
        values[row, np.searchsorted(times, time)] = residual
        known[row] = np.isin(times, time) | ended
    common = known.all(axis=0)
    return times[common], values[:, common]
