"""`reference: exact`: the error in position at the last frame, and the kernels that it needs."""

from pathlib import Path

import numpy as np
import pytest

from runner import execute, load, reference, run, sweep, sweeping
from sim.simulate import Simulation

FALL = """\
# How far off is a fall?
balls: {balls}
solver: {{method: {method}, step: 0.01, contact: {contact}}}
duration: {duration}
record: {{every: {every}, formats: [hdf5]}}
reference: exact
"""
ONE = "{released: [{position: [0, 0, 0]}]}"
MANY = "{emitter: {position: [0, 0, 0], direction: [1, 2, 3], rate: 10, spread: 90}}"

SMOKE = Path(__file__).parents[2] / "configs/smoke.yaml"

EXACT = {"balls": ONE, "method": "exact", "contact": "swept", "duration": 1, "every": 0.1}


def errors(balls=ONE, method="explicit_euler", contact="swept", duration="1", every="0.1", scene="", stop=lambda: False):
    """The result of a run, and its (rms, largest) error."""
    text = FALL.format(balls=balls, method=method, contact=contact, duration=duration, every=every)
    Path("x.yaml").write_text(text + (f"scene: {scene}\n" if scene else ""))
    result = run(load("x.yaml"), stop)
    return result, (result.summary["position_error_rms"], result.summary["position_error_max"])


@pytest.mark.parametrize("contact", ["swept", "original"])
def test_forward_euler_falls_short_by_g_h_t_over_2(here, contact):
    _, (rms, largest) = errors(contact=contact)
    # 100 steps round numbers up to 4.9
    assert rms == largest == pytest.approx(9.8 * 0.01 * 1 / 2, rel=1e-11)


def test_each_ball_has_its_own_age(here):
    """Ten balls, 0.1 to 1 s old."""
    age = np.arange(1, 11) / 10
    _, told = errors(MANY)
    assert told == pytest.approx((9.8 * 0.005 * np.sqrt(np.mean(age**2)), 9.8 * 0.005), rel=1e-11)


@pytest.mark.parametrize("method, worst", [("symplectic_euler", 9.8 * 0.005), ("rk4_original", 0)])
def test_other_methods(here, method, worst):
    assert errors(method=method)[1] == pytest.approx((worst, worst), rel=1e-11, abs=1e-13)


def test_only_those_alive_count(here):
    """Of ten balls that live for 0.35 s, those of 0.1, 0.2 and 0.3 s are left."""
    age = np.arange(1, 4) / 10
    _, told = errors(MANY.replace("{emitter", "{lifetime: 0.35, emitter"))
    assert told == pytest.approx((9.8 * 0.005 * np.sqrt(np.mean(age**2)), 9.8 * 0.005 * 0.3), rel=1e-11)
    assert errors(ONE.replace("{released", "{lifetime: 0.35, released"))[1] == (None, None)


def test_a_run_that_diverged_is_held_against_the_truth_at_its_last_frame(here):
    """omega h = 10: forward Euler multiplies the energy by 101 a step."""
    spring = "{gravity: [0, 0, 0], forces: {well: {type: spring, stiffness: 1.0e+6}}}"
    result, told = errors("{released: [{position: [1, 0, 0]}]}", scene=spring, duration="2", every="0.01")
    end = result.trajectory.time[-1]
    assert result.status == "diverged" and 0.02 < end < 0.1
    expected = abs(result.trajectory.position[-1, 0, 0] - np.cos(1000 * end))
    assert told == pytest.approx((expected, expected), rel=1e-12)


def test_diverged_from_the_start(here):
    result, told = errors("{released: [{position: [1, 0, 0], velocity: [2.0e+8, 0, 0]}]}")
    assert (result.status, len(result.trajectory.time), told) == ("diverged", 1, (0, 0))


def test_exact_itself_has_no_error(here):
    _, told = errors(MANY, "exact", scene="{restitution: 0.5, surfaces: {floor: {shape: plane, point: [0, -1, 0]}}}")
    assert told == (0, 0)


def test_a_truth_that_ends_before_tells_nothing(here):
    """The first step leaps over a thin field that throws the ball out of the world."""
    jet = "{type: uniform, direction: [0, 1, 0], magnitude: 1.0e+30, region: {x: [5, 5.1]}}"
    scene = f"{{gravity: [0, 0, 0], forces: {{jet: {jet}}}}}"
    result, told = errors("{released: [{position: [4.5, 0, 0], velocity: [100, 0, 0]}]}", scene=scene, contact="original")
    assert (result.status, told) == ("finished", (None, None))


def test_without_a_reference_there_is_none(here):
    Path("x.yaml").write_text(FALL.format(**EXACT).replace("reference: exact", ""))
    summary = run(load("x.yaml")).summary
    assert (summary["position_error_rms"], summary["position_error_max"]) == (None, None)


def test_a_run_out_of_time_has_none(here):
    result, told = errors(stop=lambda: True)
    assert (result.status, told) == ("timeout", (None, None))


def test_the_reference_may_run_out_of_time_too(here, monkeypatch):
    made = []
    monkeypatch.setattr(reference, "Simulation", lambda *args: made.append(1) or Simulation(*args))
    result, told = errors(stop=lambda: bool(made))
    assert made and (result.status, told) == ("timeout", (None, None))


def test_the_balls_come_to_rest_alike(here):
    """The only error left is that of the way along the floor before."""
    floor = "{restitution: 0.3, damping: 0, surfaces: {floor: {shape: plane, point: [0, -1, 0]}}}"
    _, (rms, largest) = errors(scene=floor, method="rk4_original", duration="2")
    assert largest < 1e-12


# Kernels

KERNELS = """\
# Which kernels are there?
scene:
  forces:
    wind: {type: uniform, direction: [1, 0, 0], magnitude: 0, until: 1}
    air: {type: drag, coefficient: 0}
balls: {released: [{position: [0, 1, 0]}]}
solver: {method: exact}
matrix:
  solver.method: [explicit_euler, symplectic_euler, rk4_original, exact]
  solver.contact: [swept, original]
  scene.forces.wind.magnitude: [0, 1]
  scene.forces.air.coefficient: [0, 1]
  balls.mass: [1, 2]
  exclude: [{solver.method: exact, solver.contact: original}]
"""


def test_runs_with_the_same_key_share_a_kernel_and_no_others(here):
    Path("x.yaml").write_text(KERNELS)
    keys, kernels = {}, {}
    for each in load("x.yaml").runs():
        setup = each.setup
        scene, solver = setup.scene.build(each.folder), setup.solver.build(each.folder)
        balls = setup.balls.build(setup.duration, each.folder)
        # the methods' own functions are besides the kernel
        kernel = Simulation(scene, balls, solver, setup.duration, setup.record.every).engine.kernel, solver.method
        keys.setdefault(sweeping.kernel_key(each), set()).add(kernel)
        kernels.setdefault(kernel, set()).add(sweeping.kernel_key(each))
    assert all(len(each) == 1 for each in (*keys.values(), *kernels.values()))
    # three methods: swept, and the original's rule with and without a field to look at; and exact with and without drag
    assert len(keys) == 3 + 3 * 2 + 2


def test_kernels_with_little_in_common_are_compiled_first():
    runs = list(load(SMOKE, {"reference": None}).runs())
    keys = [sweeping.kernel_key(run) for run in sweeping._kernels(runs, runs)]
    assert keys[0][0] == sweeping.STEPS
    for shared in (1, 2):  # the curve, and the loop over balls
        kinds = len({key[:shared] for key in keys})
        assert len(keys) == len(runs) > kinds == len({key[:shared] for key in keys[:kinds]})


def test_the_references_kernel_is_compiled_beforehand(here, inline, monkeypatch):
    compiled = []
    monkeypatch.setattr("runner.worker.compile_kernel", lambda task: compiled.append(task.parameters))
    text = FALL.format(**EXACT | {"method": "explicit_euler", "contact": "original"})
    Path("x.yaml").write_text(text + "matrix: {solver.method: [explicit_euler, rk4_original], balls.mass: [1, 2]}\n")
    sweep("x.yaml", jobs=1)
    solvers = [(parameters["solver"]["method"], parameters["solver"]["contact"]) for parameters in compiled]
    assert sorted(solvers) == [("exact", "swept"), ("explicit_euler", "original"), ("rk4_original", "original")]


def test_the_twin_solves_the_same_exactly(here):
    Path("x.yaml").write_text(FALL.format(**EXACT | {"balls": MANY, "method": "explicit_euler", "contact": "original"}))
    one = load("x.yaml").base
    twin = reference.twin(one)
    assert (twin.setup.solver.method, twin.setup.solver.contact, twin.setup.reference) == ("exact", "swept", None)
    assert execute.run(twin).trajectory.position[-1] == pytest.approx(
        reference.solve(execute.prepare(one), execute.run(one), lambda: False).trajectory.position[-1], nan_ok=True, abs=1e-14
    )
    same = {**twin.parameters, "solver": one.parameters["solver"], "reference": "exact"}
    assert same == one.parameters
