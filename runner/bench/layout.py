"""The tables of the bench: title, headings and rows of text."""

from __future__ import annotations

from collections.abc import Iterator

from runner.bench.figure import Figure
from runner.bench.kernels import EVENTS, Speed
from runner.bench.peers import Comparison, Missing
from runner.bench.scaling import Point

Table = tuple[str, list[str], list[list[str]]]


def tables(part: str, rows: list) -> Iterator[Table]:
    """What the part's rows, dataclasses, are shown as."""
    if part == "kernels":
        yield _exact([row for row in rows if row.unit == EVENTS])
        yield _stepped([row for row in rows if row.unit != EVENTS])
    elif part == "peers":
        yield _peers(rows)
    elif part == "scaling":
        yield _points(rows)
    else:
        yield _figures(part, rows)


def _exact(speeds: list[Speed]) -> Table:
    headings = ["scene", "events/s", "ns each", "geometry (s)", "peak memory (MB)"]
    rows = [
        [
            each.case.scene, f"{each.rate:.3g}", f"{1e9 / each.rate:.3g}", f"{each.build_seconds:.2g}",
            f"{each.peak_memory / 1e6:.0f}",
        ]
        for each in speeds
    ]  # fmt: skip
    return "exact, elastic balls, one core", headings, rows


def _stepped(speeds: list[Speed]) -> Table:
    """Methods downward, scenes across."""
    columns = list(dict.fromkeys((each.case.scene, each.case.contact) for each in speeds))
    rates = {(each.case.method, each.case.scene, each.case.contact): f"{each.rate:.3g}" for each in speeds}
    headings = ["method"] + [scene if contact == "swept" else f"{scene}, {contact}" for scene, contact in columns]
    methods = dict.fromkeys(each.case.method for each in speeds)
    rows = [[method, *(rates.get((method, *column), "") for column in columns)] for method in methods]
    return "Ball-steps/s, steps of 1 ms but for dopri5, elastic balls, swept contact where not told, one core", headings, rows


def _figures(part: str, figures: list[Figure]) -> Table:
    return part.capitalize(), ["", "", ""], [[each.what, f"{each.value:.3g}", each.unit] for each in figures]


def _points(points: list[Point]) -> Table:
    rows = [[each.what, f"{each.size:,}", each.grows, f"{each.seconds:.3g}", f"{each.each * 1e6:.3g}"] for each in points]
    return "How the cost grows", ["", "so many", "", "seconds", "us each"], rows


def _peers(rows: list[Comparison | Missing]) -> Table:
    headings = ["peer", "scene", "a second", "", "error (m)", "bounces", "carom", "a second", "error (m)", "times as fast"]
    return "Others at the same work, one core", headings, [_peer(row) for row in rows]


def _peer(row: Comparison | Missing) -> list[str]:
    if isinstance(row, Missing):
        return [row.peer, row.why] + [""] * 8
    answer = row.answer
    counted = "" if answer.bounces is None else f"{answer.bounces} of {row.bounces}"
    error = f"{answer.error:.1e}" + ("" if row.right else " WRONG")
    ours = [row.method, f"{row.rate:.3g}", f"{row.error:.1e}", f"{row.ratio:.3g}"]
    return [row.peer, row.scene, f"{answer.count / answer.seconds:.3g}", row.unit, error, counted, *ours]
