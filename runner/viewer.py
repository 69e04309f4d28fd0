"""The rerun viewer: how it lays out carom's recordings, and the command that opens them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from runner import seal, store
from runner.document import suggestion
from runner.errors import Damaged, InputError
from runner.record.rrd import APPLICATION, FILE, PACKED, SERIES, take

if TYPE_CHECKING:
    import rerun.blueprint as rrb


def blueprint() -> rrb.Blueprint:
    """The scene beside the energies and the residual, which is too small to share their axis, and the parameters."""
    import rerun as rr
    import rerun.blueprint as rrb

    def until_now(timeline: str) -> rrb.VisibleTimeRange:
        return rrb.VisibleTimeRange(
            timeline, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative()
        )

    def curves(name: str, *series: str, legend: bool) -> rrb.TimeSeriesView:
        visible = rr.SeriesLines.from_fields(visible_series=[each in series for each in SERIES])
        return rrb.TimeSeriesView(
            origin="/energy",
            name=name,
            overrides={"/energy": visible},
            plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=legend),
        )

    scene = rrb.Spatial3DView(
        origin="/",
        contents=["/scene/**", "/balls", "/trails", "/bounces"],
        name="scene",
        overrides={"/bounces": rrb.VisibleTimeRanges([until_now("time"), until_now("frame")])},
    )
    figures = rrb.Vertical(
        curves("energy (J)", "kinetic", "potential", "total", legend=True),
        curves("energy residual (J)", "residual", legend=False),
        rrb.TextDocumentView(origin="/about", name="about"),
        row_shares=[3, 2, 3],
    )
    return rrb.Blueprint(
        rrb.Horizontal(scene, figures, column_shares=[3, 2]),
        rrb.TimePanel(timeline="time", state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def write_blueprint(path: Path) -> None:
    """Write the layout for all of carom's recordings to `path`, a `.rbl` file."""
    import rerun as rr

    blueprint().save(APPLICATION, path)
    rr.bindings.flush_and_cleanup_orphaned_recordings()  # or its stream would keep two threads


def viewer_command(recordings: list[Path], blueprint: Path) -> list[str]:
    """The command that opens `recordings` in a viewer of their own; it listens on this machine alone."""
    files = [str(path) for path in (*recordings, blueprint)]
    return [sys.executable, "-m", "rerun_cli", "--bind", "127.0.0.1", "--new", *files]


MOST_OPENED = 12  # recordings at once, when none is named


def recordings(folder: Path, runs: list[str], scratch: Path) -> list[Path]:
    """The recordings of the runs whose ids begin with one of `runs`; the first few of all when none is named.

    Those of packed runs are copied into the folder `scratch`. Raises InputError when there are none, Damaged for one that is.
    """
    found = dict(sorted(store.holding(folder, FILE).items()))
    if not found:
        raise InputError(f"{folder}: holds no recordings; put rrd into record.formats")
    for run in runs:
        if not any(name.startswith(run) for name in found):
            raise InputError(f"{folder}: no recording of a run {run}{suggestion(run, found)}")
    opened = [name for name in found if name.startswith(tuple(runs))] if runs else list(found)[:MOST_OPENED]
    for entry in {found[name] for name in opened}:
        path = entry / (PACKED if store.pack_number(entry) else FILE)
        noted = store.contents(entry).get("files", {}).get(path.name)
        if noted and (wrong := seal.fault(path, noted)):
            raise Damaged(path, wrong)
    return [_recording(found[name], name, scratch) for name in opened]


def _recording(entry: Path, run_id: str, scratch: Path) -> Path:
    """The file with the run's recording alone."""
    if not store.pack_number(entry):
        return entry / FILE
    take(entry / PACKED, run_id, scratch / f"{run_id}.rrd")
    return scratch / f"{run_id}.rrd"
