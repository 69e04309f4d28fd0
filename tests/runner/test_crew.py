"""The balls of one run, moved by several threads: the same run to the last bit, and what ends one ends all."""

import os
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from runner import config, plan, pool, store, sweeping
from runner.crew import crew
from runner.errors import RunError
from sim import coast, engines, jit, travel
from sim.release import Emitter
from sim.shapes import Box, Heightfield, Plane
from sim.simulate import Crew, Scene, Simulation, Solver
from tests.sim.helpers import balls, random_balls

ROOM = {"room": Box((0, 0, 0), (3.2, 3.2, 3.2), inside=True)}
HILLS = {"hills": Heightfield((8, 8), (6, 6), "0.2*sin(2*x)*cos(z) - 1.7")}
SIZES = [2, 3, 7, 300]
METHODS = [("exact", "swept"), ("symplectic_euler", "swept"), ("symplectic_euler", "original")]


def simulation(scene, start, method="exact", contact="swept", duration=1.0, every=0.1, step=0.01) -> Simulation:
    return Simulation(scene, start, Solver(method, step, contact=contact), duration, every)


def moved(ready, threads, stop=lambda: False):
    with crew(threads) as several:
        return ready.run(stop, several)


def told(flight) -> dict:
    """All that a flight tells, numbers as bytes."""
    values = {name: getattr(flight, name) for name in ("bounces", "rests", "energy_initial", "energy_final", "end")}
    values |= vars(flight.trajectory) | vars(flight.energy)
    counts = {name: getattr(flight, name) for name in ("status", "steps", "ball_seconds", "resting", "penetrations")}
    return {name: np.asarray(value).tobytes() for name, value in values.items()} | counts


@pytest.fixture
def small_parts(monkeypatch):
    """Parts of a few balls, and calls of a kernel that end soon: each thread has several of them."""
    monkeypatch.setattr(engines, "PART", 24)
    monkeypatch.setattr(engines, "PIECES", 300)
    monkeypatch.setattr(engines, "BUDGET", 7)


def emitted(count=200, **options) -> Emitter:
    released, position, velocity = Emitter((0, 0, 0), (0, -1, 0), 6.0, 120.0, rate=400.0, seed=3, count=count).release(9.0)
    return balls(position, velocity, released, radius=0.05, **options)


@pytest.mark.parametrize("method, contact", METHODS)
@pytest.mark.parametrize("surfaces", [ROOM, HILLS], ids=["few faces", "a tree"])
def test_any_number_of_threads_gives_the_same_flight(small_parts, method, contact, surfaces):
    """Balls that an emitter lets out, that bounce, come to rest and die."""
    ready = simulation(Scene(surfaces=surfaces, restitution=0.6), emitted(lifetime=0.83), method, contact)
    one = ready.run()
    assert len(one.bounces) > 100 and np.isnan(one.trajectory.position[-1]).all(axis=1).any()
    assert all(told(moved(ready, threads)) == told(one) for threads in SIZES)


@pytest.mark.parametrize("method, contact", METHODS)
def test_a_ball_that_diverges_ends_the_run_at_the_same_frame(small_parts, method, contact):
    """Some do, in whatever order they are moved; what they and the others did by then is counted alike."""
    start = random_balls(4, 200, released=np.linspace(0.0, 0.3, 200), lifetime=0.9)
    start.velocity[[30, 110, 180]] = (7e7, 0, 0), (9e7, 0, 0), (8e7, 0, 0)
    ready = simulation(Scene(gravity=(1e8, 0, 0), restitution=0.6), start, method, contact)
    one = ready.run()
    assert one.status == "diverged" and 0.1 < one.trajectory.time[-1] < 0.5
    assert all(told(moved(ready, threads)) == told(one) for threads in SIZES)


def test_balls_that_come_to_rest_are_told_alike(small_parts):
    start = random_balls(5, 60, speed=0.2)
    ready = simulation(Scene(surfaces={"floor": Plane((0, -2, 0))}, restitution=0.3, damping=0.4), start, duration=3.0)
    one = ready.run()
    assert one.status == "rested" and len(one.rests) == 60
    assert all(told(moved(ready, threads)) == told(one) for threads in SIZES)


def test_a_pile_up_is_told_of_the_same_ball(small_parts):
    """Whichever thread comes upon one first: here each part has one, and tells of its last ball."""

    def move(part, *_):
        raise engines.Stalled(f"ball {part[0] + len(part[1]) - 1}")

    ready = simulation(Scene(), random_balls(1, 96))
    ready.engine.move = move
    for threads in (1, 2, 9):
        with pytest.raises(engines.Stalled, match="^ball 23$"):
            moved(ready, threads)


# Stopped


def long() -> Simulation:
    """It would take some thousand calls of the kernel."""
    start = emitted(lifetime=1e9)
    return simulation(Scene(surfaces=ROOM), start, "symplectic_euler", "swept", duration=1e4, every=1e3, step=1e-4)


def left(before) -> list:
    """Threads that go on; one that was being started as the interruption came may take a moment to end."""
    new = [thread for thread in threading.enumerate() if thread not in before]
    for thread in new:
        thread.join(5)
    return [thread for thread in new if thread.is_alive()]


@pytest.mark.parametrize("method, contact", METHODS)
def test_a_stopped_run_keeps_whole_frames_and_no_thread(small_parts, method, contact):
    ready, questions, before = simulation(Scene(surfaces=ROOM), emitted(), method, contact), [], threading.enumerate()
    whole = ready.run()
    flight = moved(ready, 3, lambda: bool(questions.append(1)) or len(questions) > 4)
    frames = len(flight.trajectory.time)
    assert flight.status == "timeout" and 1 <= frames < len(whole.trajectory.time)
    assert np.array_equal(flight.trajectory.position, whole.trajectory.position[:frames], equal_nan=True)
    assert len(questions) <= 4 + 3, "nobody goes on"
    assert left(before) == []


@pytest.mark.parametrize("raised", [ZeroDivisionError, KeyboardInterrupt])
def test_an_error_in_one_thread_or_an_interruption_ends_all(raised):
    """An interruption is heard by the main thread, which moves no balls."""
    before, once, asked = threading.enumerate(), threading.Lock(), []

    def stop():
        asked.append(1)
        if once.acquire(blocking=False):
            if raised is not KeyboardInterrupt:
                raise raised
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
        return False

    with pytest.raises(raised):
        moved(long(), 3, stop)
    assert left(before) == [] and len(asked) < 1000


# Apart from each other


@pytest.mark.parametrize("surfaces", [ROOM, HILLS], ids=["few faces", "a tree"])
@pytest.mark.parametrize("method, loop", [("exact", travel.travel), ("symplectic_euler", coast.coast)])
def test_what_threads_share_is_only_read(method, loop, surfaces):
    """The kernel as plain Python, with all that it is given but what is a thread's own closed to writing."""
    ready = simulation(Scene(surfaces=surfaces), random_balls(6, 7), method, duration=0.4, step=0.02)
    ready.engine.kernel = jit.bind(loop, compiled=False, **engines.bindings(method, ready.engine.given[3]))
    arrays = [*_arrays(ready.engine.given), ready.time]
    assert len(arrays) >= 5
    for array in arrays:
        array.flags.writeable = False
    with np.errstate(all="ignore"):  # as in a kernel
        one, other = ready.run(), ready.run(crew=Crew(3))
    assert len(one.bounces) > 0 and told(one) == told(other)


def test_each_thread_computes_in_a_room_of_its_own(small_parts):
    engine = simulation(Scene(surfaces=HILLS), random_balls(6, 50)).engine
    own = [[*_arrays(room), *_arrays(engine.parts(3)[k])] for k, room in enumerate(engine.rooms(3))]
    assert not any(np.shares_memory(a, b) for k in range(3) for j in range(k) for a in own[k] for b in own[j])


def _arrays(things) -> list:
    if isinstance(things, np.ndarray):
        return [things] if things.size else []
    return [array for each in things for array in _arrays(each)] if isinstance(things, tuple) else []


@pytest.mark.parametrize("contact", ["swept", "original"])
def test_a_kernel_lets_python_go_on(monkeypatch, contact):
    """While it is in one call, of a tenth of a second at least, another thread looks up every millisecond."""
    monkeypatch.setattr(engines, "PIECES", 10**9)
    monkeypatch.setattr(engines, "BUDGET", 10**9)
    looks, calls, elastic = [], [], Scene(surfaces=ROOM, restitution=1.0, damping=0.0)
    ready = simulation(elastic, random_balls(6, 64), "symplectic_euler", contact, duration=30.0, every=30.0, step=2e-5)
    ready.warm()
    move = ready.engine.move
    ready.engine.move = lambda *given: (calls.append(len(looks)), move(*given), calls.append(len(looks)))[1]
    at_work = threading.Thread(target=ready.run)
    at_work.start()
    while at_work.is_alive():
        looks.append(1)
        time.sleep(1e-3)
    assert max(after - before for before, after in zip(calls[::2], calls[1::2])) > 20


# In experiments

FILE = """\
scene: {surfaces: {room: {shape: box, center: [0, 0, 0], size: [3, 3, 3], inside: true}}}
balls: {emitter: {position: [0, 0, 0], direction: [0, 1, 0], speed: 5, spread: 90, rate: 300}, lifetime: 0.5}
solver: {method: symplectic_euler, step: 1.0e-2}
duration: 1
reference: exact
record: {every: 0.1, formats: [hdf5]}
"""


@pytest.fixture
def file(here):
    Path("x.yaml").write_text(FILE)
    return here / "x.yaml"


def test_threads_are_no_part_of_a_run(file):
    """Its id, its parameters and its bytes are the same: what is done with one number of threads is done."""
    work = [config.load(file, {"solver.threads": threads}).base for threads in (1, 5)]
    assert work[0].run_id == work[1].run_id and work[0].parameters == work[1].parameters
    assert work[1].setup.solver.threads == 5


def test_a_sweep_with_threads_writes_the_same_bytes(file, inline, monkeypatch):
    sizes, run = [], Simulation.run
    monkeypatch.setattr(Simulation, "run", lambda self, stop, crew: sizes.append(crew.size) or run(self, stop, crew))
    written = []
    for threads in (1, 3):
        sweeping.sweep(file, {"solver.threads": threads}, out=f"out{threads}")
        (folder,) = Path(f"out{threads}/x/runs").iterdir()
        report = store.contents(folder)
        timed = {"sim_seconds", "ball_steps_per_second", "ns_per_ball_second"}
        figures = {name: value for name, value in report["figures"].items() if name not in timed}
        written.append(((folder / "trajectory.h5").read_bytes(), figures, report["parameters"]))
        assert report["status"] == "finished" and report["figures"]["position_error_max"] is not None
    assert written[0] == written[1] and sizes == [1, 1, 3, 3], "the run, and its reference"


def test_a_run_with_threads_ends_at_the_timeout(file, carom_process):
    """It would take an hour."""
    settings = {"solver.threads": 2, "duration": 1e5, "solver.step": 1e-4, "balls.lifetime": 1e5, "record.every": 1e4}
    options = [word for key, value in settings.items() for word in ("-s", f"{key}={value}")]
    options += ["-s", "balls.emitter.count=1000", "--timeout", "1"]
    code, _, err = carom_process("sweep", "x.yaml", *options, cwd=file.parent)
    assert code == 1 and "Traceback" not in err
    (report,) = store.read_runs(file.parent / "outputs/x")
    assert report["status"] == "timeout" and report["error"] == "stopped after 1 s", "it stopped by itself"


@pytest.mark.parametrize("threads, jobs, processes", [(1, None, 8), (3, None, 2), (8, None, 1), (20, None, 1), (3, 5, 5)])
def test_threads_and_processes_fill_the_cores_unless_told_otherwise(file, monkeypatch, threads, jobs, processes):
    asked = []

    def local(jobs):
        asked.append(jobs)
        raise RunError("that was all to see")

    monkeypatch.setattr(os, "cpu_count", lambda: 8)
    monkeypatch.setattr(pool, "local", local)
    file.write_text(FILE + "matrix: {balls.mass: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]}\n")
    with pytest.raises(RunError):
        sweeping.carry_out(plan.plan(config.load(file, {"solver.threads": threads}), Path("out")), jobs)
    assert asked == [processes]
