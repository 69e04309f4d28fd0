"""`carom tune`: the search for a step, the choice among methods, and what is said of it."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from runner import execute, ladder, load, tune
from runner.advice import lines, table
from runner.ladder import Found, Ladder, Trial
from runner.tune import Candidate, Timing, Tuning
from sim.engines import Stalled
from sim.simulate import Simulation

SPRING = """\
# Which step does a spring need?
scene:
  gravity: [0, 0, 0]
  forces: {spring: {type: spring, stiffness: 100}}
balls: {released: [{position: [1, 0, 0]}, {position: [0, 2, 0], velocity: [1, 0, 3]}]}
solver: {method: exact}
duration: 1.0
record: {every: 0.01, formats: []}
"""
TWO = ["rk4_original", "symplectic_euler"]  # of order 2 and 1 here


# The search

STEPS = Ladder(start=ladder.rung_at(0.05), coarsest=ladder.rung_at(1.0), finest=ladder.rung_at(1e-15), order=2, work=1)
GRID = [ladder.setting(rung) for rung in range(45)]


def searched(error, target, budget=1e9, where=STEPS, cost=1e-6):
    """What the search finds, and the settings that it measured, in turn; the cost is cost / h."""
    asked = []

    def measure(h):
        asked.append(h)
        return Trial(h, error(h), cost / h)

    return ladder.search(measure, where, target, budget), asked


def test_the_rungs_are_1_2_5():
    assert [ladder.setting(rung) for rung in range(-2, 8)] == [5, 2, 1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005]
    for limit in (3, 1, 0.99, 0.5, 0.2, 0.19, 0.1, 1e-3, 2e-7):
        rung = ladder.rung_at(limit)
        assert ladder.setting(rung) <= limit < ladder.setting(rung - 1)


@pytest.mark.parametrize("claimed", [1, 2, 4])
@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("target", [10, 1e-1, 3.1e-4, 1e-6])
def test_the_coarsest_step_below_the_target_is_found(order, claimed, target):
    found, asked = searched(lambda h: 7 * h**order, target, where=STEPS._replace(order=claimed))
    assert found.best.setting == next(h for h in GRID if 7 * h**order < target)
    assert [each.setting for each in found.guards] == [h for h in GRID if h < found.best.setting][: ladder.GUARDS]
    assert len(asked) == len(set(asked)) == len(found.trials)
    assert [each.setting for each in found.trials] == sorted(asked, reverse=True)


def test_a_leap_saves_trials():
    """From 0.05 to 1e-6 there are 15 rungs."""
    found, asked = searched(lambda h: h, 1.1e-6, where=STEPS._replace(order=1))
    assert found.best.setting == 1e-6 and len(asked) <= 6


@pytest.mark.parametrize("lucky", [[0.05], [0.05, 0.02], [0.01]])
def test_a_small_error_between_large_ones_is_not_trusted(lucky):
    found, _ = searched(lambda h: 1e-9 if h in lucky else h**2, 1e-5)
    assert found.best.setting == 2e-3


def test_an_error_that_comes_back_is_not_trusted():
    found, _ = searched(lambda h: 1.0 if 1e-4 < h < 4e-3 else h**2, 1e-3)
    assert found.best.setting == 1e-4


def test_steps_that_fail_are_passed_over():
    found, _ = searched(lambda h: math.inf if h > 3e-3 else h**2, 1.0)
    assert found.best.setting == 2e-3
    found, _ = searched(lambda h: 2.0 if h > 0.02 else math.inf if h > 3e-3 else h**2, 1.0)
    assert found.best.setting == 2e-3


@pytest.mark.parametrize("error", [lambda h: 1.0, lambda h: h, lambda h: math.inf, lambda h: 1 + math.sin(1e9 * h)])
def test_the_budget_is_kept(error):
    found, asked = searched(error, 1e-7, budget=1.0)
    assert min(asked) >= 1e-6  # 1 s
    assert found.best is None and found.guards == ()
    step, seconds = found.needed
    assert step < 1e-6 and seconds == pytest.approx(1e-6 / step)


def test_guards_that_cost_too_much_are_left_out():
    found, asked = searched(lambda h: h**2, 1.1e-10, budget=0.15)
    assert found.best.setting == 1e-5 and found.guards == () and min(asked) == 1e-5


def test_the_ladder_ends():
    ends = STEPS._replace(start=4, coarsest=3, finest=6)
    found, asked = searched(lambda h: 0.0, 1.0, where=ends)
    assert found.best.setting == max(asked) == 0.1
    found, asked = searched(lambda h: 2.0, 1.0, where=ends)
    assert found.best is None and min(asked) >= 0.01 and found.needed[1] == math.inf


# The choice, on a scene


@pytest.fixture(autouse=True)
def hasty(monkeypatch):
    """Few repeats."""
    monkeypatch.setattr(tune, "ENOUGH", 0.02)


@pytest.fixture
def counted(monkeypatch):
    """Time told by the number of steps, so that a choice is the same each time: 10 ns a step, 100 ns a piece of exact flight. That is
    what they take; none is cut short by the clock."""

    def timed(simulation, stop=lambda: False):
        flight = simulation.run(stop)
        return flight, flight.steps * (1e-8 if simulation.solver.stepping else 1e-7)

    monkeypatch.setattr(tune, "_timed", timed)
    monkeypatch.setattr(tune, "_deadline", lambda seconds: lambda: False)


@pytest.fixture
def two(monkeypatch):
    """As if there were two methods."""
    for each in ("names", "fixed"):
        monkeypatch.setattr(f"sim.integrators.{each}", lambda: TWO)


def spring(text=SPRING):
    Path("x.yaml").write_text(text)
    return load("x.yaml")


@pytest.mark.parametrize("target", [1e-2, 1e-5])
def test_what_is_recommended_meets_the_target_and_nothing_cheaper_does(here, counted, carom, two, target):
    found = tune.tune(spring(), target)
    best = found.best
    line = next(each for each in lines(found) if "rk4_original" in each and each.startswith("solver:"))
    result = execute.run(spring(SPRING.replace("solver: {method: exact}", line) + "reference: exact\n"))
    error = result.summary["position_error_rms"]
    assert error < target and error == pytest.approx(best.best.error, rel=1e-9)
    assert result.summary["step"] == best.best.setting
    assert [each.method for each in found.candidates] == TWO
    for each in found.candidates:
        steps = [trial.setting for trial in each.found.trials if trial.error < target]
        if each.found.best:
            assert max(steps) == each.found.best.setting and each.seconds >= best.seconds
    assert best.measured == pytest.approx(2, abs=0.1) and not best.erratic
    assert (found.alive, found.bounces, found.ball_seconds) == (2, 0, 2.0)


@pytest.mark.slow
@pytest.mark.parametrize("target", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("scene", ["corridor", "baffles", "box"])
def test_on_the_three_scenes_the_recommendation_holds(scene, target):
    """Run by itself it ends where it was said to, and no coarser setting, nor another method for less, stays below the target."""
    file = Path(__file__).parents[2] / "configs" / f"work_precision_{scene}.yaml"
    found = tune.tune(load(file), target)
    best = found.best
    knobs = {"solver.method": best.method, f"solver.{best.knob}": best.best.setting, "solver.contact": best.contact}
    error = execute.run(load(file, knobs | {"repeats": 1})).summary["position_error_rms"]
    assert error == best.best.error < target
    assert len(found.candidates) == 9
    for each in found.candidates:
        assert each.seconds >= best.seconds
        # what is coarser than the coarsest trusted one misses the target, or met it by luck: a finer one misses it
        trusted = [t for t in each.found.trials if all(u.error < target for u in each.found.trials if u.setting <= t.setting)]
        assert each.found.best is None or each.found.best == trusted[0]


def test_a_longer_step_that_costs_more_is_not_taken(here, monkeypatch):
    """As where it makes the search for a touch harder."""
    monkeypatch.setattr(tune, "_seconds", lambda simulation: 1.0 if simulation.solver.step < 0.02 else 2.0)
    (each,) = tune.tune(spring(), 0.1, methods=["rk4_original"]).candidates
    assert each.found.best.setting == 0.02 and each.best is each.found.guards[0] and each.timing.seconds == 1.0
    assert [trial.setting for trial in each.finer] == [5e-3, 2e-3]


def test_the_spread_of_the_timing_is_that_of_thirds():
    assert tune._timing([3, 1, 2, 5, 4, 1.5]) == (1, 2.0, 6)


def test_a_method_that_costs_far_more_is_given_up(here, counted, monkeypatch):
    monkeypatch.setattr(tune, "UNNOTICED", 1e-4)
    _, euler = tune.tune(spring(), 1e-6, methods=TWO).candidates
    assert euler.found.best is None and euler.found.needed[0] < 1e-6
    assert euler.found.trials[-1].setting > 1e-5


def test_a_step_that_diverges_is_passed_over(here):
    stiff = SPRING.replace("stiffness: 100", "stiffness: 1.0e+6")
    (each,) = tune.tune(spring(stiff), 0.1, methods=["rk4_original"]).candidates
    assert each.found.trials[0].status == "diverged" and each.found.trials[0].error == math.inf
    assert each.found.best.setting < 2e-3


def test_a_scene_where_balls_come_to_rest(here):
    floor = "surfaces: {floor: {shape: plane}}\n  restitution: 0.2"
    text = SPRING.replace("forces: {spring: {type: spring, stiffness: 100}}", floor)
    text = text.replace("gravity: [0, 0, 0]", "gravity: [0, -9.8, 0]").replace("duration: 1.0", "duration: 3.0")
    text = text.replace("released: [{position: [1, 0, 0]}, ", "released: [{position: [1, 1, 0]}, ")
    (each,) = tune.tune(spring(text), 1e-6, methods=["rk4_original"]).candidates
    assert each.found.best and {trial.status for trial in each.found.trials} == {"rested"}


def test_contact_is_the_files_own(here, monkeypatch):
    timed = []
    monkeypatch.setattr(tune, "_seconds", lambda simulation: timed.append(simulation.solver.contact) or 1.0)
    monkeypatch.setattr("sim.integrators.fixed", lambda: ["explicit_euler"])
    text = SPRING.replace("solver: {method: exact}", "solver: {method: rk4_original, contact: original}")
    found = tune.tune(spring(text), 1e-2)
    assert {each.contact for each in found.candidates} == {"original"} and timed[:2] == ["swept", "original"]
    assert any(line.startswith("solver: {method: explicit_euler, ") and "contact: original}" in line for line in lines(found))


# What is said


def told(*candidates, exact=1.0, target=1e-3, every=False):
    tuning = Tuning(target, candidates, Timing(exact, 0.02, 5), 1.0, 1.0, 1, 0)
    return "\n".join(lines(tuning)), table(tuning, every)


def candidate(*errors, seconds=1.0, method="rk4", spread=0.02, coarser=()):
    """With a best of error errors[0] at step 0.1 and guards of the others, at half the step each."""
    trials = [Trial(0.1 / 2**k, error, 0.1) for k, error in enumerate(errors)]
    found = Found((*coarser, *trials), trials[0], tuple(trials[1:]))
    return Candidate(method, "swept", "step", 4, found, trials[0], Timing(seconds, spread, 5))


def test_the_cheaper_of_exact_and_the_best_with_steps_comes_first():
    good = candidate(1.6e-4, 1e-5, 6.25e-7)
    text, _ = told(good, exact=2.0)
    assert "take rk4" in text and "exact is 2.0 times the cost" in text and "tie" not in text
    text, _ = told(good, exact=0.5)
    assert "take exact" in text and "2.0 times the cost" in text
    assert text.index("solver: {method: exact}") < text.index("solver: {method: rk4, step: 0.1, contact: swept}")
    assert "a tie" in told(good, exact=0.99)[0] and "take exact" in told(good, exact=1.01)[0]
    assert "6.2 times below" in text and "order: 4.0 measured there, 4 expected" in text and "warning" not in text


def test_a_tie_of_two_methods_is_said():
    one = candidate(1e-4, 1e-5, 1e-6)
    for seconds, said in ((1.01, "as fast, within the spread of the timing: {method: pefrl"), (1.2, "next: pefrl, 1.20 times")):
        assert said in told(one, candidate(1e-4, 1e-5, 1e-6, seconds=seconds, method="pefrl"))[0]


@pytest.mark.parametrize("errors", [(1e-4, 2e-4, 3e-5), (4e-4, 2e-4, 1e-4), (1e-6, 5e-4, 4e-4), (9e-4, 1e-7, 2e-7)])
def test_chaos_is_warned_of(errors):
    assert "warning: the error does not fall with the step" in told(candidate(*errors))[0]


def test_errors_of_rounding_are_no_chaos():
    text, _ = told(candidate(1e-13, 3e-13, 2e-12))
    assert "warning" not in text and "as good as rounding allows" in text


def test_a_step_without_effect_is_no_chaos():
    text, _ = told(candidate(5e-4, 5e-4, 5e-4))
    assert "warning" not in text and "makes no difference" in text


def test_too_few_guards_are_told():
    assert "longer than --budget" in told(candidate(5e-4))[0]


def test_little_margin_is_told():
    assert "may be above" in told(candidate(9e-4, 5e-5))[0] and "may be above" not in told(candidate(4e-4, 5e-5))[0]


def test_a_step_that_no_error_falls_with_is_not_promised():
    trials = Trial(0.1, 1.0, 0.1), Trial(0.01, 0.9, 0.1)
    each = Candidate("rk4", "swept", "step", 4, Found(trials, None, (), (1e-5, 20.0)), None)
    text, rows = told(each)
    assert "hardly falls down to 0.01" in rows[1][-1]
    assert "the best found: rk4 with step 0.01, 0.9 m" in text
    better = replace(each, found=Found((trials[0], Trial(0.01, 1e-3, 0.1)), None, (), (1e-5, 20.0)))
    assert rows != told(better)[1] and "1e-05 may do, in 20 s" in told(better)[1][1][-1]


def test_what_was_met_by_luck_is_marked():
    lucky = [Trial(0.5, 1e-4, 0.1), Trial(0.2, 2e-3, 0.1)]
    _, rows = told(candidate(1e-4, 1e-5, 1e-6, coarser=lucky), every=True)
    assert [row[-2] for row in rows] == ["yes", "by luck", "no", "yes", "yes", "yes"]


# The command


def test_the_command(here, counted, carom, two):
    Path("x.yaml").write_text(SPRING + "matrix: {balls.mass: [1, 2]}\n")
    code, out, err = carom("tune", "x.yaml", "--error", "1e-3")
    assert code == 0 and "rk4_original" in out and "errors are over 2 balls at 1 s, after 0 bounces" in out
    assert [line for line in out.splitlines() if line.startswith("solver: {method: ")]
    assert err.splitlines()[0] == "the matrix is left out: x.yaml is tuned with its own values" and "rk4_original ..." in err
    assert [path.name for path in here.iterdir()] == ["x.yaml"], "nothing is written"
    assert len(carom("tune", "x.yaml", "--error", "1e-3", "--trials").out.splitlines()) > len(out.splitlines())
    # a heavier ball swings slower: a coarser step will do
    heavy = carom("tune", "x.yaml", "--error", "1e-3", "-s", "balls.mass=100")
    assert heavy.code == 0 and step(heavy.out) > 2 * step(out)


def step(out):
    (line,) = [line for line in out.splitlines() if line.startswith("solver: {method: ") and "step" in line]
    return float(line.split("step: ")[1].split(",")[0])


def test_an_error_that_none_meets_exits_with_1_and_the_best_found(here, counted, carom, two):
    Path("x.yaml").write_text(SPRING)
    code, out, _ = carom("tune", "x.yaml", "--error", "1e-11", "--budget", "0.01")
    assert code == 1 and "no method with steps is known to stay below 1e-11 m" in out
    assert "the best found: rk4_original with step " in out and "solver: {method: exact}" in out


@pytest.mark.parametrize("error", ["0", "-1", "nan", "inf", "1e-15"])
def test_a_target_that_is_none_is_a_line(here, carom, error):
    Path("x.yaml").write_text(SPRING)
    code, out, err = carom("tune", "x.yaml", "--error", error)
    assert (code, out, len(err.splitlines())) == (2, "", 1) and err.startswith(f"--error {error}: must be")


@pytest.mark.parametrize(
    "options, said",
    [
        (["--budget", "0"], "--budget 0: must be"),
        (["--budget", "nan"], "--budget nan: must be"),
        (["-s", "balls.mass=1,2"], "-s balls.mass=1,2: takes one value here"),
        (["-s", "balls.mas=1"], "-s balls.mas: balls.mas: unknown"),
        (["-s", "scene.surfaces.floor={shape: plane}"], "x.yaml:5:21: balls.released.0.position: "),
    ],
)
def test_wrong_input_is_a_line(here, carom, options, said):
    Path("x.yaml").write_text(SPRING)
    code, out, err = carom("tune", "x.yaml", "--error", "1e-3", *options)
    assert (code, out, len(err.splitlines())) == (2, "", 1) and err.startswith(said)


@pytest.mark.parametrize(
    "old, new, said",
    [
        ("duration: 1.0", "duration: 1.0", "the exact solution takes more than 1e-09 s: --budget"),
        ("balls: {", "balls: {lifetime: 0.5, ", "no ball is alive at the end, 1 s"),
        ("velocity: [1, 0, 3]", "velocity: [2.0e+8, 0, 0]", "the exact solution diverges before 1 s"),
    ],
)
def test_without_an_exact_solution_there_is_a_line(here, carom, old, new, said):
    Path("x.yaml").write_text(SPRING.replace(old, new))
    budget = ["--budget", "1e-9"] if old == new else []
    code, out, err = carom("tune", "x.yaml", "--error", "1e-3", *budget)
    last = err.splitlines()[-1]
    assert (code, out) == (1, "") and last.startswith(said) and "Traceback" not in err


def stalling(monkeypatch, methods):
    """As if the bounces of these methods piled up."""

    class Stalling(Simulation):
        def run(self, stop=lambda: False):
            if self.solver.method in methods:
                raise Stalled("ball 0: its bounces pile up")
            return super().run(stop)

    monkeypatch.setattr(tune, "Simulation", Stalling)


def test_an_exact_solution_that_stalls_is_a_line(here, carom, monkeypatch):
    stalling(monkeypatch, ["exact"])
    Path("x.yaml").write_text(SPRING)
    code, out, err = carom("tune", "x.yaml", "--error", "1e-3")
    assert (code, out) == (1, "") and err.splitlines()[-1].startswith("no exact solution to hold errors against: ball 0")


def test_a_method_that_stalls_meets_nothing(here, monkeypatch):
    stalling(monkeypatch, ["symplectic_euler"])
    rk4, euler = tune.tune(spring(), 1e-2, methods=TWO).candidates
    assert rk4.best and euler.best is None and {trial.status for trial in euler.found.trials} == {"stalled"}


def test_no_balls_are_a_line(here, carom):
    emitter = "balls: {emitter: {position: [0, 0, 0], direction: [1, 0, 0], rate: 1, count: 0}}"
    lines = [emitter if line.startswith("balls:") else line for line in SPRING.splitlines()]
    Path("x.yaml").write_text("\n".join(lines) + "\n")
    code, out, err = carom("tune", "x.yaml", "--error", "1e-3")
    assert (code, out, len(err.splitlines())) == (2, "", 1)
