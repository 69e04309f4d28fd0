"""The command line. Each command imports what it needs when it runs, so that `carom --help` answers at once."""

from __future__ import annotations

import gc
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Optional

import typer

from runner.errors import InputError, RunError, one_line

app = typer.Typer(
    help="Sweeps of bouncing balls: a YAML grid becomes trajectories, recordings, a summary and charts.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)

File = Annotated[Path, typer.Argument(metavar="FILE", help="An experiment file (YAML).")]
Folder = Annotated[Path, typer.Argument(metavar="DIR", help="The output folder of a sweep, outputs/<name>.")]
Overrides = Annotated[
    Optional[list[str]],
    typer.Option("--set", "-s", metavar="KEY=V[,V2]", help="Replace a setting; several values make the matrix vary it."),
]


def main() -> None:
    """The `carom` command: expected failures are a line each and an exit code, never a traceback."""
    try:
        app()
    except (InputError, RunError, OSError, MemoryError, UnicodeEncodeError) as error:  # the last: of a name that is no text
        if "--debug" in sys.argv:
            raise
        print("not enough memory" if isinstance(error, MemoryError) else error, file=sys.stderr)
        sys.exit(2 if isinstance(error, InputError) else 1)
    finally:
        gc.freeze()  # or the interpreter looks for garbage in all there is before it ends: a third of a second after a sweep


@app.callback()
def options(debug: Annotated[bool, typer.Option(help="Show the traceback of an expected failure, too.")] = False) -> None:
    """Read by `main`."""


@app.command()
def sweep(
    file: File,
    set_: Overrides = None,
    out: Annotated[Path, typer.Option(help="Folder for the output; the sweep's own is <out>/<name>.")] = Path("outputs"),
    jobs: Annotated[Optional[int], typer.Option("--jobs", "-j", min=1, help="Worker processes. Default: cores / threads.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be run, and run nothing.")] = False,
    fresh: Annotated[bool, typer.Option("--fresh", help="Make all runs again, done or not.")] = False,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Make failed runs again.")] = False,
    fail_fast: Annotated[bool, typer.Option("--fail-fast", help="Stop at the first run that fails.")] = False,
    timeout: Annotated[Optional[float], typer.Option(min=0, help="Seconds that a run may take.")] = None,
    cluster: Annotated[
        Optional[str], typer.Option(metavar="ADDRESS", help="Run on the workers of this Dask scheduler, tcp://host:port.")
    ] = None,
    gather: Annotated[
        bool, typer.Option("--gather", help="Have the cluster send files back: it does not share the output folder.")
    ] = False,
    check: Annotated[bool, typer.Option("--check", help="Hold the runs against `expect`; exit 1 if one is broken.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Start more than 100,000 runs without asking.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Show no progress.")] = False,
) -> None:
    """Run what is not done yet of an experiment, then summarise and draw its charts."""
    from runner import sweeping, terminal
    from runner.plan import plan

    work = plan(_load(file, set_), out, fresh, retry_failed, yes)
    counts = f"{len(work.runs)} runs, {len(work.runs) - len(work.todo)} done, {len(work.todo)} to do"
    if dry_run:
        print(f"{work.folder}: {counts}")
        for run in work.todo:
            print(run.run_id)
        return
    if not quiet:
        print(f"{work.folder}: {counts}", file=sys.stderr)
    if sweeping.is_finished(work):
        raise typer.Exit(0 if _judge(work, check, quiet) else 1)
    stopped = None
    try:
        with _interruptible(work), terminal.progress(quiet) as progress:
            sweeping.carry_out(work, jobs, timeout, fresh or retry_failed, fail_fast, progress, cluster, gather)
    except sweeping.Stopped as error:
        stopped = str(error)
    sweeping.finish(work)
    if not _judge(work, check, quiet) or stopped:
        raise typer.Exit(1)


@app.command()
def status(
    folder: Folder,
    verify: Annotated[bool, typer.Option("--verify", help="Hold every file against its checksum; exit 1 if one differs.")] = False,
    repair: Annotated[bool, typer.Option("--repair", help="Make runs again that --verify finds damaged, and the summary.")] = False,
    jobs: Annotated[Optional[int], typer.Option("--jobs", "-j", min=1, help="Worker processes of --repair.")] = None,
) -> None:
    """How many runs are done, failed and to do; whether their files are as they were made."""
    from runner import store
    from runner.plan import existing, failed

    experiment = existing(folder)
    if verify or repair:
        _verify(folder, repair, jobs)
    runs = experiment.runs()
    reports = list(store.read_runs(folder, (run.run_id for run in runs)))
    bad = [report for report in reports if failed(report)]
    others = len(store.done(folder)) - len(reports)
    print(f"done {len(reports) - len(bad)}, failed {len(bad)}, todo {len(runs) - len(reports)}")
    if others:
        print(f"{others} more runs are there, of other settings")
    for report in bad:
        print(_failure(report))


@app.command()
def summary(
    folder: Folder,
    by: Annotated[Optional[str], typer.Option(metavar="KEY,KEY", help="Group the runs by these columns.")] = None,
    csv: Annotated[bool, typer.Option("--csv", help="Print comma-separated values.")] = False,
) -> None:
    """Print the table of runs, grouped: bounce counts, energy, speed; and the experiment's expectations."""
    from runner import tables

    tables.show(folder, by.split(",") if by else None, csv)


@app.command("chart")
def chart_(folder: Folder) -> None:
    """Draw the charts again from the table, and write the report."""
    from runner import aggregate, sweeping
    from runner.plan import existing

    experiment = existing(folder)
    if not experiment.charts:
        raise InputError(f"{folder}: the experiment has no charts: section")
    try:
        for path in sweeping.draw(folder, experiment, experiment.runs(), aggregate.read(folder)):
            print(path)
    except FileNotFoundError:
        raise InputError(f"{folder}: no summary yet; `carom sweep` makes it") from None
    except ValueError as error:
        raise InputError(f"{folder}: {error}") from None


@app.command()
def view(
    folder: Folder,
    runs: Annotated[Optional[list[str]], typer.Argument(metavar="[RUN]...", help="Run ids, or their beginnings.")] = None,
) -> None:
    """Open recordings in the rerun viewer: the scene beside the energy curves."""
    import os
    import subprocess
    import tempfile

    from runner import viewer

    with tempfile.TemporaryDirectory() as scratch:
        recordings = viewer.recordings(folder, runs or [], Path(scratch))
        blueprint = Path(scratch) / "carom.rbl"
        viewer.write_blueprint(blueprint)
        # CI=1 keeps the viewer from sending usage figures home
        environment = {"RUST_LOG": "error"} | os.environ | {"CI": "1"}
        raise typer.Exit(subprocess.run(viewer.viewer_command(recordings, blueprint), env=environment).returncode)


@app.command()
def compare(
    one: Annotated[Path, typer.Argument(metavar="DIR_A", help="The output folder of a sweep.")],
    other: Annotated[Path, typer.Argument(metavar="DIR_B", help="Another, of the same runs.")],
    rtol: Annotated[float, typer.Option(min=0, metavar="R", help="Relative difference that is none.")] = 0.0,
) -> None:
    """Compare two outputs run by run; exit 1 if any differ."""
    from runner import comparison

    found = list(comparison.differences(one, other, rtol))
    for line in found:
        print(line)
    if found:
        raise typer.Exit(1)
    print("no differences")


@app.command()
def explain(file: File, set_: Overrides = None) -> None:
    """What will be modelled, and what was dropped and why."""
    from runner import explanation

    for line in explanation.explain(_load(file, set_)):
        print(line)


@app.command()
def bench(
    parts: Annotated[
        Optional[list[str]],
        typer.Argument(metavar="[PART]...", help="kernels, threads, sweep, startup, peers or scaling. Default: all but scaling."),
    ] = None,
    json_: Annotated[Optional[Path], typer.Option("--json", metavar="FILE", help="Write the figures there, too.")] = None,
    chart: Annotated[Optional[Path], typer.Option(metavar="FILE", help="Draw there how the cost grows; needs scaling.")] = None,
) -> None:
    """How fast this is on this machine, beside other programs that are installed; how the cost grows with the work."""
    import json

    from runner import bench, tables

    parts = bench.checked(parts, json_, chart)
    figures, seconds = bench.run(parts, lambda line: print(line, file=sys.stderr, flush=True))
    tables.show_speeds(figures)
    print(f"measured in {seconds:.0f} s")
    if json_:
        json_.write_text(json.dumps(bench.document(figures, seconds), indent=1) + "\n", encoding="utf-8")
    if chart:
        bench.draw(figures["scaling"], chart)


@app.command()
def tune(
    file: File,
    error: Annotated[float, typer.Option(metavar="E", help="To stay below, in position: m, RMS over the balls at the end.")],
    set_: Overrides = None,
    budget: Annotated[float, typer.Option(metavar="S", help="Seconds that a trial may take.")] = 10.0,
    trials: Annotated[bool, typer.Option("--trials", help="List every setting that was tried.")] = False,
) -> None:
    """Find the cheapest method and step whose error stays below E on this scene, by trial; exit 1 if none does."""
    from runner import advice, tables, terminal
    from runner import tune as tuning

    experiment = _load(file, set_, "the matrix is not tuned")
    if experiment.matrix.keys:
        print(f"the matrix is left out: {file} is tuned with its own values", file=sys.stderr)
    with terminal.doing() as told:
        found = tuning.tune(experiment, error, budget, told=told)
    tables.print_rows(f"{experiment.name}: errors below {error:g} m", advice.HEADINGS, advice.table(found, trials))
    for line in advice.lines(found):
        print(line)
    if not found.best:
        raise typer.Exit(1)


@app.command()
def methods() -> None:
    """Every method: order, stability limits, evaluations per step, reference."""
    from runner import tables

    tables.show_methods()


@app.command()
def check(file: File, set_: Overrides = None) -> None:
    """Check an experiment file: its settings, its matrix, its charts and expectations."""
    from runner.plan import plan

    experiment = _load(file, set_)
    print(f"{file}: ok, {len(plan(experiment, Path('outputs'), fresh=True, yes=True).runs)} runs")


@app.command()
def schema() -> None:
    """Print the JSON schema of experiment files, for editors."""
    import json

    from runner.schema import File

    print(json.dumps(File.model_json_schema(), indent=2))


def _load(file: Path, overrides: list[str] | None, single: str = ""):
    """The experiment in the file, with the settings of `-s`; `single` is why they may have one value only."""
    from runner import config, document

    loaded = document.Document(file)
    for text in overrides or []:
        key, equals, value = text.partition("=")
        if not equals or not key:
            raise InputError(f"-s {text}: write it as key=value")
        values = document.read_values(value, f"-s {text}")
        if single and len(values) > 1:
            raise InputError(f"-s {text}: takes one value here: {single}")
        config.vary(loaded, key, values)
    return config.check(loaded)


def _verify(folder: Path, repair: bool, jobs: int | None) -> None:
    """Say what is damaged, and with `repair` make it again; exit 1 while something is."""
    from runner import sweeping, terminal, verification

    found = verification.damages(folder)
    for damage in found:
        print(damage)
    if repair:
        work, lost = verification.plan_repair(folder, found)
        for run_id in lost:
            print(f"{run_id}: cannot be made again: of settings that {folder} has no more, or of another version of carom")
        if work.todo:
            with _interruptible(work), terminal.progress(quiet=False) as progress:
                sweeping.carry_out(work, jobs, replace=True, progress=progress)
        if not lost:
            sweeping.finish(work)
        found = verification.damages(folder)
    if found:
        print(f"{len(found)} files are damaged" + ("" if repair else f"; `carom status {folder} --repair` makes their runs again"))
        raise typer.Exit(1)
    print("every file is as it was made")


@contextmanager
def _interruptible(work):
    """Around a sweep at work: Ctrl-C or SIGTERM ends it, and is told with what is kept."""
    try:
        _end_as_interrupt()
        yield
    except KeyboardInterrupt:
        print(f"interrupted: {_finished(work)} runs are kept; the same command goes on with the rest", file=sys.stderr)
        raise typer.Exit(130) from None


def _end_as_interrupt() -> None:
    """Let SIGTERM end the sweep as Ctrl-C does, and once only: a second one must not cut short what the first began."""
    import signal

    # one that is ignored already, as a shell's background jobs ignore Ctrl-C, stays so
    both = [each for each in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(each) != signal.SIG_IGN]

    def interrupt(*_):
        for each in both:
            signal.signal(each, signal.SIG_IGN)
        raise KeyboardInterrupt

    for each in both:
        signal.signal(each, interrupt)


def _finished(work) -> int:
    from runner import store

    return len(store.done(work.folder) & {run.run_id for run in work.runs})


def _judge(work, check: bool, quiet: bool) -> bool:
    """Say what came of the runs and of the expectations; whether all is well."""
    from collections import Counter

    from runner import expect, store, terminal
    from runner.plan import failed

    kept = ("run_id", "status", "error", *(("parameters", "figures") if work.experiment.expect else ()))
    reports = [{key: report[key] for key in kept} for report in store.read_runs(work.folder, (run.run_id for run in work.runs))]
    verdicts = expect.verdicts(work.experiment.expect, reports)
    broken = [verdict for verdict in verdicts if not verdict.holds]
    bad = [report for report in reports if failed(report)]
    for report in bad:
        print(_failure(report), file=sys.stderr)
    for verdict in verdicts if check else []:
        if not quiet or not verdict.holds:
            print(verdict, file=sys.stderr)
    if not quiet:
        told = f"{len(verdicts) - len(broken)} of {len(verdicts)} expectations hold" if verdicts else ""
        tally = terminal.tally(Counter(report["status"] for report in reports))
        print(", ".join(filter(None, [tally, told])) + f"; see `carom summary {work.folder}`", file=sys.stderr)
    return not bad and not (check and broken)


def _failure(report: dict) -> str:
    """What became of a failed run, on a line."""
    return one_line(f"{report['run_id']}: {report['status']}: {report['error']}")
