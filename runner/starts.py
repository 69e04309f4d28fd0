"""Balls that start inside a surface: told before anything is run."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from runner.config import Run
from runner.document import Document, Path_, dotted
from runner.errors import Fault
from runner.faults import origin
from sim import reduction
from sim.inside import starts_inside


def faults(runs: Iterable[Run], document: Document) -> list[Fault]:
    """A fault for each distinct start of balls inside a surface; the original's contact rule lets them be there.

    The geometry is built once for each distinct set of surfaces.
    """
    scenes: dict[tuple[str, ...], dict[tuple, Run]] = {}
    for run in runs:
        setup, text = run.setup, run.parts.text
        if setup.solver.contact == "swept" or setup.reference:
            balls = setup.balls
            where = balls.emitter.position if balls.emitter else (text(balls.released), text(balls.scatter))
            scenes.setdefault(text(setup.scene.surfaces), {}).setdefault((where, balls.radius), run)
    found = {}
    for surfaces, starts in scenes.items():
        if surfaces != ("{}",):
            found.update(dict.fromkeys(_faults(list(starts.values()), document)))
    return list(found)


def _faults(runs: list[Run], document: Document) -> Iterable[Fault]:
    """Those of runs with the same surfaces."""
    scene = runs[0].setup.scene.build(runs[0].folder)
    # edges bound faces, so the depth in a surface needs none; nor does it depend on the side that balls are on
    features, _ = reduction.features(list(scene.surfaces.values()), np.zeros((0, 3)), edges=False)
    for run in runs:
        inside = starts_inside(scene.surfaces, features, run.setup.balls.build(run.setup.duration, run.folder))
        if inside:
            ball, reason = inside
            path = _place(run, ball)
            yield Fault(document.place(origin(path, run.origins)), dotted(path), reason)


def _place(run: Run, ball: int) -> Path_:
    """The setting that says where the ball starts."""
    balls = run.setup.balls
    if balls.emitter:
        return ("balls", "emitter", "position")
    return ("balls", "scatter", "box") if balls.scatter else ("balls", "released", ball, "position")
