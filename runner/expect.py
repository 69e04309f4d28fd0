"""Expectations: what an experiment file says must come out, held against what did."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from runner.document import Document, dotted, suggestion
from runner.errors import Fault, one_line
from runner.schema import Expectation
from runner.settings import canonical, leaves


class Verdict(NamedTuple):
    """One expectation against all runs that its `where` names."""

    expectation: Expectation
    runs: int
    broken: tuple[tuple[str, Any], ...]  # run_id and value of the runs that break it

    @property
    def holds(self) -> bool:
        return self.runs > 0 and not self.broken

    def __str__(self) -> str:
        told = f"{'ok' if self.holds else 'BROKEN'}: {describe(self.expectation)}"
        if not self.runs:
            return f"{told}: no run matches"
        if not self.broken:
            return f"{told} ({self.runs} runs)"
        run_id, value = self.broken[0]
        return f"{told}: {len(self.broken)} of {self.runs} runs break it, {run_id} has {one_line(str(value))}"


def describe(expectation: Expectation) -> str:
    told = expectation.column
    if expectation.equals is not None:
        equals = expectation.equals
        told += f" = {equals:.12g}" if isinstance(equals, float) else f" = {equals}"
    if expectation.min is not None:
        told = f"{expectation.min:.12g} <= {told}"
    if expectation.max is not None:
        told += f" <= {expectation.max:.12g}"
    if expectation.where:
        told += " where " + ", ".join(f"{key} = {value}" for key, value in expectation.where.items())
    return told


def verdicts(expectations: Sequence[Expectation], reports: Iterable[dict[str, Any]]) -> list[Verdict]:
    """What became of each expectation in the runs of `reports`."""
    rows = [row(report) for report in reports] if expectations else []
    out = []
    for each in expectations:
        matching = [r for r in rows if all(r.get(canonical(key)) == value for key, value in each.where.items())]
        broken = tuple((r["run_id"], r.get(each.column)) for r in matching if not satisfies(r.get(each.column), each))
        out.append(Verdict(each, len(matching), broken))
    return out


def row(report: dict[str, Any]) -> dict[str, Any]:
    """All that an expectation can speak of: the run's settings, figures and status."""
    figures = {"run_id": report["run_id"], "status": report["status"], "error": report["error"], **report["figures"]}
    return dict(leaves(report["parameters"])) | figures


def satisfies(value: Any, expectation: Expectation) -> bool:
    """A bound holds for numbers only: nothing and NaN break it."""
    if expectation.equals is not None and value != expectation.equals:
        return False
    if expectation.min is None and expectation.max is None:
        return True
    if not isinstance(value, (int, float)) or math.isnan(value):
        return False
    low = -math.inf if expectation.min is None else expectation.min
    high = math.inf if expectation.max is None else expectation.max
    return low <= value <= high


def unknown_columns(document: Document, known: Collection[str]) -> Iterator[Fault]:
    """A fault for each column that an expectation of the document speaks of and no run has."""
    expectations = document.data.get("expect")
    for index, each in enumerate(expectations if isinstance(expectations, list) else []):
        each = each if isinstance(each, dict) else {}
        where = each.get("where") if isinstance(each.get("where"), dict) else {}
        for path, name in [(("column",), each.get("column")), *((("where", key), canonical(key)) for key in where)]:
            if isinstance(name, str) and name not in known:
                place = ("expect", index, *path)
                reason = f"no run has '{name}'{suggestion(name, known)}"
                yield Fault(document.place(place), dotted(place), reason)
