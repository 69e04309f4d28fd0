"""What an experiment models, in plain words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from runner.config import Experiment
from sim import forces, integrators
from sim.geometry import FEW, gather
from sim.simulate import frame_times


def explain(experiment: Experiment) -> Iterator[str]:
    """Lines on the scene, the flight, the balls and the runs; of settings that the matrix varies, the file's own value."""
    setup, folder = experiment.base.setup, experiment.base.folder
    scene, balls = setup.scene.build(folder), setup.balls.build(setup.duration, folder)
    yield f"{experiment.name}: {len(experiment.runs())} runs" + (
        f", varying {', '.join(experiment.matrix.keys)}" if experiment.matrix.keys else ""
    )
    yield from _surfaces(scene)
    yield from _fields(scene, balls.mass)
    start, end = balls.released[0], balls.released[-1]
    yield f"balls: {len(balls)}, released from {start:g} to {end:g} s, each living {balls.lifetime:g} s"
    method = integrators.load(setup.solver.method)[0]
    frames = len(frame_times(setup.duration, setup.record.every))
    yield (
        f"solver: {setup.solver.method} of order {method.order}, step {setup.solver.step:g} s; "
        f"{setup.duration:g} s in {frames} recorded frames"
    )


def _surfaces(scene) -> Iterator[str]:
    if not scene.surfaces:
        yield "surfaces: none, free space: no contact is looked for"
        return
    parts = {name: (shape.facets(), shape.mesh()) for name, shape in scene.surfaces.items()}
    for name, (facets, mesh) in parts.items():
        kind = type(scene.surfaces[name]).__name__.lower()
        sides = "both sides" if facets.two_sided.all() else "one side"
        dropped = len(mesh.triangles) - len(facets.point) if kind in ("triangles", "heightfield") else 0
        yield f"surface {name}: {kind}, {_count(len(facets.point), 'facet')} hit from {sides}" + (
            f"; {_count(dropped, 'triangle')} without an area dropped" if dropped else ""
        )
    count = len(gather([facets for facets, _ in parts.values()])[0].point)
    how = "looked at one by one" if count <= FEW else f"found by a tree, being more than {FEW}"
    yield f"contact: {_count(count, 'facet')}, {how}"


def _fields(scene, mass: float) -> Iterator[str]:
    for name, field in scene.forces.items():
        if not np.any(np.hstack(field.affine())):
            yield f"force {name}: of no strength, dropped"
            continue
        limits = [f"{low:g} < {axis} < {high:g} m" for axis, (low, high) in field.region.items()]
        limits += [f"age < {field.until:g} s"] if field.until is not None else []
        yield f"force {name}: {type(field).__name__.lower()}, acts " + (" and ".join(limits) or "always and everywhere")
    packed = forces.pack(list(scene.forces.values()), scene.gravity, mass)
    rows = [packed.steady, *packed.selective]
    spring, drag = any(row[forces.W2] for row in rows), any(row[forces.B] for row in rows)
    if spring or drag:
        form = " and ".join(word for word, present in (("oscillating", spring), ("damped", drag)) if present)
    else:
        form = "a parabola" if any(np.any(row[:3]) for row in rows) else "straight"
    yield f"flight between events: {form}; {_count(len(packed.selective), 'field')} looked at in each evaluation"


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'s' * (n != 1)}"
