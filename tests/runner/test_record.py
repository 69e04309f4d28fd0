"""What the recorders write, read back with h5py and rerun."""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace

import h5py
import numpy as np
import psutil
import pytest
from rerun.chunk import RrdReader

from runner import record, viewer
from runner.record import hdf5, rrd
from runner.result import Result
from sim.model import BOUNCE, REST, Balls, Energy, Mesh, Trajectory

# Without `strict`, rerun turns what it cannot write into a warning and leaves it out.
pytestmark = pytest.mark.filterwarnings("error")

RUN_ID = "rk4-m0.5-9f86d081884c"
RADIUS = 0.06
STEP, EVERY = 1e-3, 0.01
SQUARE = np.array([[0, 1, 2], [0, 2, 3]])
FLOOR = Mesh(np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], float), SQUARE)
WALL = Mesh(np.array([[-0.466, 0, -1], [-0.466, 2, -1], [-0.466, 2, 1], [-0.466, 0, 1]], float), SQUARE)
SURFACES = {"floor": FLOOR, "left wall": WALL}


def run(released=(0.0, 0.05, 0.2), lifetime=0.3, frames=61, surfaces=SURFACES) -> Result:
    """Balls that fall from 0.4 m and bounce off the floor once, without loss; ball 1 is said to touch the wall too."""
    start = np.array([[0.1 * ball, 0.4, 0.0] for ball in range(len(released))]).reshape(-1, 3)
    frame_time = np.arange(frames) * EVERY
    position = np.full((frames, len(released), 3), np.nan)
    velocity = position.copy()
    touch = np.sqrt(2 * (0.4 - RADIUS) / 9.8)
    bounces = []
    for ball, birth in enumerate(released):
        age = frame_time - birth
        alive = (age >= 0) & (age < lifetime)
        fall = touch - np.abs(age[alive] - touch)  # the flight up mirrors the flight down
        position[alive, ball] = start[ball] + np.outer(fall**2, [0, -4.9, 0])
        velocity[alive, ball] = np.outer(np.sign(age[alive] - touch) * fall, [0, 9.8, 0])
        if touch < lifetime and birth + touch <= frame_time[-1] and surfaces:
            centre = start[ball] - [0, 0.4 - RADIUS, 0]
            bounces.append((birth + touch, ball, 0, centre, [0, 1, 0], 9.8 * touch, 0.0, 0.01))
            if ball == 1:
                bounces.append((birth + touch, ball, 1, [-0.406, 0.06, 0], [1, 0, 0], 0.5, 0.1, 0.02))
    bounces = np.array(sorted(bounces, key=lambda bounce: bounce[0]), BOUNCE)
    kinetic = 0.25 * np.nansum(velocity**2, axis=(1, 2))
    potential = 4.9 * np.nansum(position[:, :, 1], axis=1)
    return Result(
        run_id=RUN_ID,
        parameters={"name": "fall", "scene": {"damping": 0.05, "restitution": None, "height": "2*x*z|a"}},
        status="finished",
        balls=Balls(0.5, RADIUS, lifetime, np.array(released), start, np.zeros_like(start)),
        trajectory=Trajectory(frame_time, 10 * np.arange(frames), position, velocity),
        bounces=bounces,
        rests=np.array([(0.5, 0, 0), (0.55, 2, 0)] if len(bounces) > 2 else [], REST),
        energy=Energy(kinetic, potential, *(np.linspace(0, end, frames) for end in (1, 2, 3)), np.full(frames, 1e-12)),
        surfaces=surfaces,
        summary={
            "run_id": RUN_ID,
            "status": "finished",
            "error": "two\nlines",
            "bounces": len(bounces),
            "energy_residual_rel": 1.25e-13,
        },
    )


RUNS = {
    "several balls": run(),
    "no bounces": run(lifetime=0.1),
    "no surfaces": run(surfaces={}),
    "one ball": run(released=(0.0,)),
    "one frame": run(frames=1),
    "nobody yet": run(released=(0.3,), frames=3),
    "no balls": run(released=()),
}


@pytest.fixture(params=RUNS)
def result(request):
    return RUNS[request.param]


def test_formats_are_named_without_importing_their_libraries():
    code = (
        "import sys; from runner import record, viewer; print([(n, record.load(n).FILE) for n in record.names()]);"
        "sys.exit(any(name in sys.modules for name in ('h5py', 'rerun', 'pyarrow')))"
    )
    printed = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert printed.strip() == "[('hdf5', 'trajectory.h5'), ('rrd', 'recording.rrd')]"


def test_an_unwritable_path_is_an_oserror(tmp_path):
    for name in record.names():
        with pytest.raises(OSError, match="nowhere"):
            record.load(name).write(run(), tmp_path / "nowhere" / "file")


# --- trajectory.h5 ---


@pytest.fixture
def trajectory(result, tmp_path):
    hdf5.write(result, tmp_path / hdf5.FILE)
    with h5py.File(tmp_path / hdf5.FILE) as file:
        yield file


def test_h5_says_it_is_h5md(trajectory):
    header = trajectory["h5md"]
    assert header.attrs["version"].tolist() == [1, 1] and header.attrs["version"].dtype.kind == "i"
    assert header["author"].attrs["name"] == header["creator"].attrs["name"] == "carom"
    assert isinstance(header["creator"].attrs["version"], str)
    box = trajectory["particles/balls/box"]
    assert box.attrs["dimension"] == 3 and box.attrs["boundary"].tolist() == [b"none"] * 3 and "edges" not in box


def test_h5_holds_every_ball_in_every_frame(trajectory, result):
    balls, given = trajectory["particles/balls"], result.trajectory
    for name, values in (("position", given.position), ("velocity", given.velocity)):
        assert balls[name]["value"].dtype == np.float64
        np.testing.assert_array_equal(balls[name]["value"], values)  # NaN where not alive
        np.testing.assert_array_equal(balls[name]["time"], given.time)
        np.testing.assert_array_equal(balls[name]["step"], given.step)
        assert balls[name]["step"].dtype == np.int64
    assert balls["id"][:].tolist() == list(range(len(result.balls)))
    assert set(balls["mass"][:]) <= {0.5} and set(balls["radius"][:]) <= {RADIUS}
    assert len(balls["mass"]) == len(balls["radius"]) == len(result.balls)


def test_h5_holds_the_energy_ledger(trajectory, result):
    observables, energy = trajectory["observables"], result.energy
    assert set(observables) == {
        "kinetic_energy", "potential_energy", "work", "energy_lost", "energy_supplied", "energy_residual",
    }  # fmt: skip
    for name, values in (
        ("kinetic_energy", energy.kinetic),
        ("potential_energy", energy.potential),
        ("work", energy.work),
        ("energy_lost", energy.lost),
        ("energy_supplied", energy.supplied),
        ("energy_residual", energy.residual),
    ):
        assert set(observables[name]) == {"step", "time", "value"}
        np.testing.assert_array_equal(observables[name]["value"], values)
        assert observables[name]["time"] == trajectory["particles/balls/position/time"]  # the same object in the file
        assert observables[name]["step"] == trajectory["particles/balls/position/step"]


def test_some_run_has_rests():
    assert any(len(each.rests) for each in RUNS.values())


def test_h5_holds_the_bounces(trajectory, result):
    bounces = trajectory["events/bounces"]
    assert bounces.dtype == BOUNCE
    np.testing.assert_array_equal(bounces[:], result.bounces)
    assert bounces.attrs["surfaces"].tolist() == list(result.surfaces)
    assert set(json.loads(bounces.attrs["units"])) == set(BOUNCE.names)
    assert "centre" in bounces.attrs["description"]


def test_h5_holds_the_rests(trajectory, result):
    rests = trajectory["events/rests"]
    assert rests.dtype == REST
    np.testing.assert_array_equal(rests[:], result.rests)
    assert rests.attrs["surfaces"].tolist() == list(result.surfaces)
    assert set(json.loads(rests.attrs["units"])) == set(REST.names)
    assert "rest" in rests.attrs["description"]


def test_h5_names_its_parameters_and_units(trajectory, result):
    parameters = trajectory["parameters"]
    assert parameters["run_id"].asstr()[()] == RUN_ID
    assert json.loads(parameters["configuration"][()]) == result.parameters
    versions = json.loads(parameters["versions"][()])
    assert versions["numpy"] == np.__version__ and versions["h5py"] == h5py.__version__
    assert {"carom", "numba"} < set(versions)

    units = {}
    trajectory.visititems(lambda name, item: units.update({name: item.attrs.get("units")}))
    assert units["particles/balls/position/value"] == "m" and units["particles/balls/velocity/value"] == "m/s"
    assert units["particles/balls/mass"] == "kg" and units["particles/balls/radius"] == "m"
    assert trajectory["observables"]["work"]["value"].attrs["units"] == "J"
    assert trajectory["particles/balls/velocity/time"].attrs["units"] == "s"
    trajectory.visititems(lambda name, item: pytest.fail(name) if "unit" in item.attrs else None)


def test_h5_is_not_compressed(trajectory):
    def check(name, item):
        assert not isinstance(item, h5py.Dataset) or item.compression is None

    trajectory.visititems(check)


def test_h5_has_the_same_bytes_each_time(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    hdf5.write(run(), first)
    time.sleep(1.1)  # HDF5 can note the second in which an object was made
    hdf5.write(run(), second)
    assert first.read_bytes() == second.read_bytes()


def test_h5_keeps_nothing_of_the_run_before(tmp_path):
    """Runs of as many frames and balls share the objects of their files."""
    other = run(released=(0.1, 0.15, 0.25))
    hdf5.write(run(), tmp_path / "before")
    hdf5.write(other, tmp_path / "after")
    assert hdf5._skeleton.cache_info().hits
    hdf5._skeleton.cache_clear()
    hdf5._image.cache_clear()
    hdf5.write(other, tmp_path / "alone")
    assert (tmp_path / "after").read_bytes() == (tmp_path / "alone").read_bytes()


def test_h5_of_a_large_run_is_the_same_tree(result, tmp_path, monkeypatch):
    hdf5.write(result, tmp_path / "small")
    monkeypatch.setattr(hdf5, "SMALL", -1)
    hdf5.write(result, tmp_path / "large")
    with h5py.File(tmp_path / "small") as small, h5py.File(tmp_path / "large") as large:
        assert list(tree(small)) == list(tree(large))


def tree(group):
    """Every object below the group by its path, with its attributes and what it holds; what has two names, twice."""
    for name, item in group.items():
        held = None
        if isinstance(item, h5py.Dataset):
            held = item.dtype, item.shape, item.chunks, item.asstr()[()] if item.dtype == object else item[()].tobytes()
        yield item.name, held, [(key, str(value), item.attrs.get_id(key).dtype) for key, value in item.attrs.items()]
        if isinstance(item, h5py.Group):
            yield from tree(item)


# --- recording.rrd ---


@pytest.fixture
def recording(result, tmp_path):
    """{entity: {column: list of rows}}; a static column has one row."""
    rrd.write(result, tmp_path / rrd.FILE)
    return read(tmp_path / rrd.FILE)


def read(path):
    entities = {}
    for chunk in RrdReader(path).store().stream().to_chunks():
        batch, columns = chunk.to_record_batch(), entities.setdefault(chunk.entity_path, {})
        index = {name: batch.column(name) for name in batch.schema.names if name in ("frame", "time")}
        for name in batch.schema.names:
            if ":" in name:
                assert name not in columns
                columns[name] = batch.column(name).to_pylist()
                columns[name + "@frame"] = index["frame"].to_pylist() if index else None
                columns[name + "@time"] = index["time"].cast("int64").to_pylist() if index else None
    return entities


def nanoseconds(seconds):
    return [round(1e9 * each) for each in seconds]


def test_rrd_is_valid_and_bears_the_run_id(result, tmp_path):
    rrd.write(result, tmp_path / rrd.FILE)
    command = [sys.executable, "-m", "rerun_cli", "rrd", "verify", str(tmp_path / rrd.FILE)]
    subprocess.run(command, check=True, capture_output=True, env=os.environ | {"CI": "1"})  # CI: sends no statistics
    [store] = RrdReader(tmp_path / rrd.FILE).recordings()
    assert (store.kind, store.application_id, store.recording_id) == ("recording", "carom", RUN_ID)


def test_rrd_has_the_entities_of_a_recording(recording, result):
    assert recording["/"] == {
        "ViewCoordinates:xyz": [[[3, 1, 6]]],  # right, up, back
        "ViewCoordinates:xyz@frame": None,
        "ViewCoordinates:xyz@time": None,
    }
    scene = {"floor": "/scene/floor", "left wall": r"/scene/left\ wall"}
    assert set(recording) == {"/", "/balls", "/trails", "/bounces", "/energy", "/about"} | {
        scene[name] for name in result.surfaces
    }


def test_rrd_holds_every_ball_in_every_frame(recording, result):
    balls, given = recording["/balls"], result.trajectory
    assert balls["Points3D:radii"] == [[np.float32(RADIUS)]] and balls["Points3D:radii@frame"] is None
    assert balls["Points3D:positions@frame"] == list(range(len(given.time)))
    assert balls["Points3D:positions@time"] == nanoseconds(given.time)
    for row, expected in zip(balls["Points3D:positions"], given.position.astype("f4"), strict=True):
        assert row == expected[~np.isnan(expected[:, 0])].tolist()


def test_rrd_keeps_each_ball_in_its_color(recording, result):
    balls, seen = recording["/balls"], {}
    rows = dict(zip(balls["Points3D:colors@frame"], balls["Points3D:colors"]))
    assert balls["Points3D:colors@time"] == nanoseconds(result.trajectory.time[list(rows)])
    for frame, position in enumerate(result.trajectory.position):
        latest = rows[max(row for row in rows if row <= frame)]
        alive = np.flatnonzero(~np.isnan(position[:, 0])).tolist()
        for ball, color in zip(alive, latest, strict=True):
            assert seen.setdefault(ball, color) == color
    assert len(set(seen.values())) == len(seen)


def test_rrd_shows_surfaces_flat_and_translucent(recording, result):
    for name, mesh in zip((r"/scene/floor", r"/scene/left\ wall"), result.surfaces.values()):
        columns = recording[name]
        assert columns["Mesh3D:vertex_positions@frame"] is None
        [vertices], [triangles] = columns["Mesh3D:vertex_positions"], columns["Mesh3D:triangle_indices"]
        np.testing.assert_array_equal(np.array(vertices)[triangles], mesh.vertices[mesh.triangles].astype("f4"))
        assert {tuple(normal) for normal in columns["Mesh3D:vertex_normals"][0]} == (
            {(0, 1, 0)} if mesh is FLOOR else {(1, 0, 0)}
        )
        assert 0 < columns["Mesh3D:albedo_factor"][0][0] & 0xFF < 255


def test_rrd_shows_its_own_surfaces_whatever_was_drawn_before(tmp_path):
    moved = {name: Mesh(mesh.vertices + 0.5, mesh.triangles) for name, mesh in SURFACES.items()}
    for surfaces in (SURFACES, moved, SURFACES):
        rrd.write(run(surfaces=surfaces), tmp_path / rrd.FILE)
        columns = read(tmp_path / rrd.FILE)[r"/scene/floor"]
        [vertices], [triangles] = columns["Mesh3D:vertex_positions"], columns["Mesh3D:triangle_indices"]
        mesh = surfaces["floor"]
        np.testing.assert_array_equal(np.array(vertices)[triangles], mesh.vertices[mesh.triangles].astype("f4"))


def test_rrd_marks_each_contact_when_it_happens(recording, result):
    marks, bounces = recording["/bounces"], result.bounces
    if not len(bounces):
        assert "Points3D:positions" not in marks
        return
    contact = (bounces["position"] - RADIUS * bounces["normal"]).astype("f4")
    assert marks["Points3D:positions"] == [[point] for point in contact.tolist()]
    assert marks["Points3D:positions@time"] == nanoseconds(bounces["time"])
    for frame, moment in zip(marks["Points3D:positions@frame"], bounces["time"], strict=True):
        assert (frame - 1) * EVERY < moment <= frame * EVERY  # the first frame not earlier
    if result is RUNS["several balls"]:
        assert [point[1] for point in contact[:3]] == pytest.approx([0, 0, 0.06], abs=1e-7)  # two floors, one wall


def test_rrd_holds_the_energies(recording, result):
    columns, energy = recording["/energy"], result.energy
    assert columns["SeriesLines:names"] == [["kinetic", "potential", "total", "residual"]]
    values = np.array(columns["Scalars:scalars"])
    np.testing.assert_array_equal(values[:, 0], energy.kinetic)
    np.testing.assert_array_equal(values[:, 1], energy.potential)
    np.testing.assert_array_equal(values[:, 2], energy.kinetic + energy.potential)
    np.testing.assert_array_equal(values[:, 3], energy.residual)
    assert columns["Scalars:scalars@time"] == nanoseconds(result.trajectory.time)
    assert columns["Scalars:scalars@frame"] == list(range(len(values)))


def test_rrd_tells_what_it_is_about(recording, result):
    about = recording["/about"]
    assert about["TextDocument:media_type"] == [["text/markdown"]]
    [[text]] = about["TextDocument:text"]
    assert text.startswith(f"**{RUN_ID}** finished")
    assert r"| energy\_residual\_rel | 1.25e-13 |" in text and "| scene.damping | 0.05 |" in text
    assert f"| bounces | {len(result.bounces)} |" in text and "| scene.restitution | null |" in text
    assert r"2\*x\*z\|a" in text and "| error | two lines |" in text


def strips(result, path):
    rrd.write(result, path)
    return [np.array(strip) for strip in read(path)["/trails"]["LineStrips3D:strips"][0]]


def test_a_trail_goes_through_frames_and_bounces_of_its_ball(tmp_path):
    result = run()
    trails = strips(result, tmp_path / rrd.FILE)
    assert len(trails) == len(result.balls)
    for ball, trail in enumerate(trails):
        lived = result.trajectory.position[:, ball].astype("f4")
        mine = result.bounces[result.bounces["ball"] == ball]
        assert len(trail) == np.isfinite(lived[:, 0]).sum() + len(mine)
        assert trail[0].tolist() == lived[np.isfinite(lived[:, 0])][0].tolist()
        assert mine["position"].astype("f4")[0].tolist() in trail.tolist()
        assert np.abs(np.diff(trail[trail[:, 0] > -0.4][:, 1])).max() < 0.03  # in order of time: no jumps


def test_a_trail_is_cut_far_from_the_scene_and_drawn_again_on_return(tmp_path):
    result = run(released=(0.0,))
    result.trajectory.position[10:20, 0, 1] = 1e3
    assert [len(trail) for trail in strips(result, tmp_path / rrd.FILE)] == [10, 10 + len(result.bounces)]
    assert sum(map(len, strips(replace(result, surfaces={}), tmp_path / rrd.FILE))) == 30 + len(result.bounces)


def test_what_is_drawn_of_many_balls_and_bounces_is_limited(tmp_path):
    result = run(released=np.arange(95) * 1e-3, lifetime=30.0, frames=2_000)
    result = replace(result, surfaces={}, bounces=np.tile(result.bounces, 300))
    trails = strips(result, tmp_path / rrd.FILE)
    assert 20 <= len(trails) <= 30
    assert 10_000 < sum(len(trail) for trail in trails) < 25_000  # some 4,000 are bounces
    marks = read(tmp_path / rrd.FILE)["/bounces"]["Points3D:positions"]
    assert 10_000 < len(marks) <= 20_000
    balls = read(tmp_path / rrd.FILE)["/balls"]["Points3D:positions"]
    assert len(balls) == 2_000 and len(balls[-1]) == 95


def test_a_mesh_of_many_triangles_shares_its_vertices(tmp_path):
    corner = np.arange(99 * 100).reshape(99, 100)[:, :-1].ravel()[:, None]
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 100), [0.0], np.linspace(-1, 1, 100)), axis=-1).reshape(-1, 3)
    mesh = Mesh(grid, np.concatenate([corner + [0, 1, 100], corner + [1, 101, 100]]))
    rrd.write(run(surfaces={"hills": mesh}), tmp_path / rrd.FILE)
    columns = read(tmp_path / rrd.FILE)["/scene/hills"]
    assert len(columns["Mesh3D:vertex_positions"][0]) == 10_000
    np.testing.assert_allclose(np.abs(columns["Mesh3D:vertex_normals"][0]), np.tile([0, 1, 0], (10_000, 1)), atol=1e-6)


def test_writing_leaves_no_threads_behind(tmp_path):
    def threads_after_writing():
        rrd.write(run(), tmp_path / rrd.FILE)
        viewer.write_blueprint(tmp_path / "carom.rbl")
        return psutil.Process().num_threads()

    before = threads_after_writing()
    assert [threads_after_writing() for _ in range(5)][-1] == before


# --- the viewer ---


def test_the_blueprint_is_for_carom_and_shows_every_entity(tmp_path):
    viewer.write_blueprint(tmp_path / "carom.rbl")
    reader = RrdReader(tmp_path / "carom.rbl")
    [store] = reader.blueprints()
    assert store.application_id == "carom"
    shown = set()
    for chunk in reader.store(store=store).stream().to_chunks():
        batch = chunk.to_record_batch()
        for name in {"ViewBlueprint:space_origin", "ViewContents:query"} & set(batch.schema.names):
            shown |= {entity for row in batch.column(name).to_pylist() for entity in row}
    assert {"/balls", "/scene/**", "/trails", "/bounces", "/energy", "/about"} < shown


def test_the_viewer_command_works_and_binds_to_this_machine_only(tmp_path):
    command = viewer.viewer_command([tmp_path / "a.rrd", tmp_path / "b.rrd"], tmp_path / "carom.rbl")
    assert command[-3:] == [str(tmp_path / name) for name in ("a.rrd", "b.rrd", "carom.rbl")]
    assert command[command.index("--bind") + 1] == "127.0.0.1"
    options = command[:-3] + ["--version"]
    assert "rerun" in subprocess.run(options, check=True, capture_output=True, text=True).stdout
