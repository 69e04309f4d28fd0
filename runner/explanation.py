"""What an experiment models, in plain words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from runner import starts
from runner.config import Experiment
from sim import crossing, forces, impact, integrators
from sim.geometry import Features
from sim.model import Balls
from sim.reduction import Reduction, features
from sim.shapes import Triangles
from sim.simulate import EXACT, Scene, frame_count


def explain(experiment: Experiment) -> Iterator[str]:
    """Lines on the scene, the flight, the balls and the runs; of settings that the matrix varies, the file's own value."""
    setup, folder = experiment.base.setup, experiment.base.folder
    scene, balls = setup.scene.build(folder), setup.balls.build(setup.duration, folder)
    swept = setup.solver.contact == "swept"
    yield f"{experiment.name}: {len(experiment.runs())} runs" + (
        f", varying {', '.join(experiment.matrix.keys)}" if experiment.matrix.keys else ""
    )
    # what a Simulation looks at
    found, reductions = features(list(scene.surfaces.values()), balls.position if swept else np.zeros((0, 3)), edges=swept)
    yield from _surfaces(scene, found, reductions, swept)
    packed = forces.pack(list(scene.forces.values()), scene.gravity, balls.mass)
    yield from _fields(scene, packed)
    yield f"events: {', '.join(_events(scene, balls, found, swept))}"
    if scene.surfaces and swept:
        yield f"rest: {_rest(scene, balls, packed)}"
    start, end = balls.released[0], balls.released[-1]
    yield f"balls: {len(balls)}, released from {start:g} to {end:g} s, each living {balls.lifetime:g} s"
    yield from (f"refused: {fault}" for fault in starts.faults([experiment.base], experiment.document))
    frames = frame_count(setup.duration, setup.record.every)
    yield f"solver: {_solver(setup.solver)}; {setup.duration:g} s in {frames:.0f} recorded frames"
    if setup.reference:
        yield "reference: solved exactly besides, for the columns position_error_rms and position_error_max"


def _surfaces(scene: Scene, found: Features, reductions: list[Reduction], swept: bool) -> Iterator[str]:
    if not scene.surfaces:
        yield "surfaces: none, free space: no contact is looked for"
        return
    for (name, shape), reduction in zip(scene.surfaces.items(), reductions):
        kind = "mesh" if isinstance(shape, Triangles) else type(shape).__name__.lower()
        if shape.unbounded:
            yield f"surface {name}: {kind}, infinite, touched from the side of its normal"
            continue
        kept = [_count(reduction.faces, "face")]
        kept += [_count(reduction.edges, "edge"), _count(reduction.corners, "corner")] if swept else []
        told = [f"{kind}, {_count(reduction.triangles, 'triangle')} -> {', '.join(kept)}", _sides(reduction, shape.two_sided)]
        if dropped := ", ".join(_dropped(reduction, swept)):
            told.append(f"dropped: {dropped}")
        if swept and reduction.room:
            told.append("part of one convex room with all balls inside: its faces need no outlines")
        pairs = crossing.crossings(*shape.mesh())
        if pairs is None:
            told.append(f"whether its triangles pass through each other is not looked for, being more than {crossing.MOST:,}")
        elif pairs:
            told.append(f"{_count(pairs, 'pair')} of its triangles {'passes' if pairs == 1 else 'pass'} through each other")
        yield f"surface {name}: " + "; ".join(told)
    count = _count(len(found.faces.axis), "face") + (f" and {_count(len(found.edges.length), 'edge')}" if swept else "")
    how = "found by a tree" if len(found.tree.items) else "looked at one by one"
    if swept:
        yield f"contact: swept, the first touch of a ball's whole sphere with {count}, {how}"
    else:
        yield (
            f"contact: original, a ray from a ball's centre along its velocity against {count}, {how}; edges and corners are not "
            "modelled, a ball nearer to a face than its radius passes through it, and none comes to rest"
        )


def _sides(reduction: Reduction, two_sided: bool) -> str:
    """Whether the surface is closed, and from where it is touched."""
    if reduction.closed:
        state = "closed"
    else:
        holes = [f"{_count(reduction.boundary, 'edge')} of one triangle"] if reduction.boundary else []
        holes += [f"{_count(reduction.nonmanifold, 'edge')} of more than two"] if reduction.nonmanifold else []
        state = f"open ({' and '.join(holes) or 'its triangles do not wind alike'})"
    if not two_sided:
        return f"{state}, solid behind"
    return f"{state}, balls {'on both sides' if reduction.side == 'both' else reduction.side}"


def _dropped(reduction: Reduction, swept: bool) -> Iterator[str]:
    """What of the triangles and their edges is not kept, and why."""
    for count, what, why in (
        (reduction.degenerate, "triangle", "without an area"),
        (reduction.duplicate, "triangle", "there already"),
        (reduction.flat * swept, "edge", "inside flat faces"),
        (reduction.inner * swept, "edge", "sticking out only to where no ball can be"),
    ):
        if count:
            yield f"{_count(count, what)} {why}"


def _fields(scene: Scene, packed: forces.Forces) -> Iterator[str]:
    for name, field in scene.forces.items():
        if not acts(field):
            yield f"force {name}: of no strength, dropped"
            continue
        limits = [f"{low:g} < {axis} < {high:g} m" for axis, (low, high) in field.region.items()]
        limits += [f"age < {field.until:g} s"] if field.until is not None else []
        yield f"force {name}: {type(field).__name__.lower()}, acts " + (" and ".join(limits) or "always and everywhere")
    rows = [packed.steady, *packed.selective]
    spring, drag = any(row[forces.W2] for row in rows), any(row[forces.B] for row in rows)
    if spring or drag:
        form = " and ".join(word for word, present in (("oscillating", spring), ("damped", drag)) if present)
    else:
        form = "a parabola" if any(np.any(row[:3]) for row in rows) else "straight"
    yield f"flight between events: {form}; {_count(len(packed.selective), 'field')} looked at in each evaluation"


def acts(field: forces.Field) -> bool:
    """Whether the field has any strength."""
    return bool(np.any(np.hstack(field.affine())))


def _events(scene: Scene, balls: Balls, found: Features, swept: bool) -> Iterator[str]:
    """What can end a piece of flight."""
    if scene.surfaces:
        yield "touch of a face" + (", of an edge or a corner" if len(found.edges.length) else "")
    for name, field in scene.forces.items():
        if swept and acts(field) and field.region:
            yield f"crossing a face of the region of {name}"
        if swept and acts(field) and field.until is not None:
            yield f"end of {name} at an age of {field.until:g} s"
    yield f"end of a ball's life at {balls.lifetime:g} s"


def _rest(scene: Scene, balls: Balls, packed: forces.Forces) -> str:
    """Whether balls can come to rest."""
    e = impact.restitution(balls.mass, scene.wall_mass) if scene.restitution is None else scene.restitution
    if e == 1:
        return "never, since impacts keep all of the normal speed"
    if not any(np.any(row[: forces.B]) for row in (packed.steady, *packed.selective)):
        return "never, since nothing presses a ball onto a surface"
    then = "stays where it is" if scene.damping > 0 else "slides on without friction, as impacts are not damped"
    return f"once the bounces, each with {e:.4g} of the normal speed, have become negligible; the ball then {then}"


def _solver(solver) -> str:
    if solver.method == EXACT:
        return "exact, in closed form from event to event, without a step"
    method = integrators.load(solver.method)[0]
    touch = ", events on its own interpolant of the same order" if solver.contact == "swept" else ""
    pace = f"steps to the tolerance {solver.tolerance:g}" if method.adaptive else f"step {solver.step:g} s"
    return f"{solver.method} of order {method.order}, {pace}{touch}"


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'s' * (n != 1)}"
