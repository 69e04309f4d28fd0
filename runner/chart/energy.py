"""The energy residual against time: what each method gained or lost on its own account."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from runner.chart._table import WHOLE, Column, column, distinct, plural, split, spread_note

if TYPE_CHECKING:
    import pyarrow
    from matplotlib.figure import Figure

FAILED = ("failed", "crashed")
MOST_LINES = 12  # in one panel; above, each series shows the median of its runs and their range
BELOW = 1e-3  # of the best run's largest residual: where a logarithmic axis ends and what is smaller sinks to zero


@dataclass(frozen=True)
class Chart:
    """The energy residual of each run against time, coloured by `series`, in small multiples by `panel`.

    With many runs, the median of those of a series, in a band from the smallest to the largest. Sizes on a logarithmic
    axis where the runs' residuals lie decades apart, as methods' do; else with their sign.
    """

    series: Column | None = None
    panel: Column | None = None
    title: str | None = None


def draw(chart: Chart, table: pyarrow.Table, folder: Path) -> Figure:
    """Draw the chart from the runs' trajectory files; runs that failed or have none are left out and told.

    A run that diverged is drawn as far as it went, and may leave the chart.
    """
    from runner.chart import _page as page

    series, panel = split(table, "series", chart.series), split(table, "panel", chart.panel)
    status, run_ids = column(table, "status", "status"), column(table, "run_id", "run_id")
    curves, notes = {}, Counter()  # row -> (time, residual)
    for row, run_id in enumerate(run_ids):
        if status[row] in FAILED:
            notes[f"{{}} {status[row]} {{}} not shown"] += 1
        elif (curve := _residual(folder / "runs" / run_id)) is None:
            notes["{} {} without a trajectory not shown"] += 1
        else:
            curves[row] = curve
            if status[row] not in WHOLE:
                notes[f"{{}} {status[row]} {{}} drawn as far as they went"] += 1
    notes = [note.format(count, plural(count)) for note, count in notes.items()]

    groups = defaultdict(list)  # (panel, series) -> rows
    for row in curves:
        groups[panel[row], series[row]].append(row)
    many = max(Counter(panel[row] for row in curves).values(), default=0) > MOST_LINES
    if many:
        notes.insert(0, spread_note(table, groups.values()))

    steady = [row for row in curves if status[row] != "diverged"] or list(curves)
    peaks = [peak for row in steady if (peak := np.abs(curves[row][1]).max()) > 0] or [1.0]
    log = page.scale(peaks) == "log"
    if log:
        curves = {row: (time, np.abs(residual)) for row, (time, residual) in curves.items()}

    styles = {value: {**style, "marker": ""} for value, style in page.looks(distinct(series)).items()}
    figure, grid = page.panels(distinct(panel), chart.panel)
    for value, style in styles.items():
        for panel_value, axes in grid.items():
            rows = groups[panel_value, value]
            if rows and many:
                time, residuals = _together([(*curves[row], status[row] == "diverged") for row in rows])
                residuals = np.clip(residuals, -1e3 * max(peaks), 1e3 * max(peaks))  # outside, yet within what Agg can draw
                page.band(axes, time, np.nanmin(residuals, axis=0), np.nanmax(residuals, axis=0), style)
                axes.plot(time, np.nanmedian(residuals, axis=0), **style)
            else:
                for row in rows:
                    axes.plot(*curves[row], **style, linewidth=1)

    first = next(iter(grid.values()))
    page.set_scale(first, "x", [], "linear")
    page.set_scale(first, "y", [min(peaks) * BELOW], "symlog" if log else "linear")
    first.set_xlim(0)
    if log:
        first.set_ylim(0, 5 * max(peaks))
    elif "diverged" in status:
        first.set_ylim(-1.5 * max(peaks), 1.5 * max(peaks))
    what = "|energy residual| (J)" if log else "energy residual (J)"
    page.finish(figure, chart.title or "Energy residual against time", notes, ("time (s)", what), chart.series, styles)
    return figure


def _residual(run: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """Time and energy residual of a run at its finite frames; None where it has no trajectory that can be read."""
    import h5py

    try:
        with h5py.File(run / "trajectory.h5") as file:
            data = file["observables/energy_residual"]
            time, value = data["time"][:], data["value"][:]
    except (OSError, KeyError):
        return None
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
