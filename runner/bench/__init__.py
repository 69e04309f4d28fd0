"""How fast carom is on this machine. A part measures one thing, in cases, and says of each when it is through."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from runner import machine
from runner.bench import curves, kernels, peers, scaling, startup, sweeps, threads
from runner.bench.kernels import Case, Speed, measure
from runner.document import suggestion
from runner.errors import InputError

__all__ = ["PARTS", "Case", "Speed", "checked", "document", "draw", "measure", "run"]

Told = Callable[[str], None]

#: name -> cases(told) -> rows, dataclasses, as they come
PARTS: dict[str, Callable[[Told], Iterator[Any]]] = {
    "kernels": kernels.speeds,
    "threads": threads.gains,
    "sweep": sweeps.costs,
    "startup": startup.times,
    "peers": peers.compare,
    "scaling": scaling.points,
}
DEFAULT = ("kernels", "threads", "sweep", "startup", "peers")

draw = curves.draw  # the points of scaling


def checked(parts: list[str] | None, json: Path | None = None, chart: Path | None = None) -> list[str]:
    """The parts to measure. Raises InputError for one that is none, and for files that could not be written in the end."""
    for part in parts or []:
        if part not in PARTS:
            raise InputError(f"{part}: no part of the bench, which has {', '.join(PARTS)}{suggestion(part, PARTS)}")
    for option, path in (("--json", json), ("--chart", chart)):
        if path and not path.parent.is_dir():
            raise InputError(f"{option} {path}: there is no folder {path.parent}")
    if chart and chart.suffix not in (".png", ".svg"):
        raise InputError(f"--chart {chart}: is drawn as .png or .svg")
    if chart and "scaling" not in (parts or ()):
        raise InputError("--chart: draws what the part scaling measures")
    return list(parts or DEFAULT)


def run(parts: list[str], told: Told) -> tuple[dict[str, list], float]:
    """The rows of each part, and the seconds it took; `told` hears of each case."""
    start = time.perf_counter()
    return {part: list(PARTS[part](told)) for part in parts}, time.perf_counter() - start


def document(found: dict[str, list], seconds: float) -> dict[str, Any]:
    """All of it as JSON can hold it."""
    rows = {part: [_record(row) for row in rows] for part, rows in found.items()}
    return {"machine": machine.machine(), "versions": machine.versions(), "seconds": seconds, **rows}


def _record(row: Any) -> dict[str, Any]:
    """A row with what it reckons."""
    reckoned = [name for name, value in vars(type(row)).items() if isinstance(value, property)]
    return asdict(row) | {name: getattr(row, name) for name in reckoned}
