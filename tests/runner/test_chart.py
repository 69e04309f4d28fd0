"""Charts against the tables and trajectories they are drawn from."""

import dataclasses
import itertools
import subprocess
import sys
from statistics import median

import h5py
import numpy as np
import pyarrow as pa
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from runner import chart
from runner.chart._axes import scale, set_scale
from runner.chart._names import SUMMARY, label, number_text
from runner.chart.work_precision import Point, front, slope
from runner.columns import COLUMNS
from sim import integrators

METHODS = ["explicit_euler", "symplectic_euler", "rk4_original"]
MASSES = [0.1, 1.0, 10.0, 100.0]
DAMPINGS = [0.0, 0.05, 0.5]
MASS, METHOD, DAMPING = "balls.mass", "solver.method", "scene.damping"
ERROR = dict(zip(METHODS, [1e-1, 1e-3, 1e-9]))
TIME = np.arange(6) * 0.1


def rows():
    """A run for each method, mass and damping, with numbers that tell which run they are of."""
    return [
        {
            "run_id": f"{method}-{mass:g}-{damping:g}",
            "status": "finished",
            METHOD: method,
            MASS: mass,
            DAMPING: damping,
            "bounces": 100 * METHODS.index(method) + int(10 * (1 - damping)) + MASSES.index(mass),
            "energy_residual": (-1) ** MASSES.index(mass) * mass * ERROR[method] * (1 + damping),
            "position_error_rms": None,
        }
        for method, mass, damping in itertools.product(METHODS, MASSES, DAMPINGS)
    ]


def table(runs):
    return pa.Table.from_pylist(runs)


def drawn(folder=".", runs=None, **options):
    return chart.draw(chart.parse(options), table(rows() if runs is None else runs), folder)


def lines(axes):
    """(x, y) of each line drawn through points, in the order of the legend."""
    points = [line for line in axes.get_lines() if line.get_markerfacecolor() != "white" and line.get_gid() != "zero"]
    return [line.get_xydata().T.tolist() for line in points]


def words(figure):
    """All that stands on the page outside the axes: title, notes and legend."""
    legends = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return " ".join([text.get_text() for text in figure.texts] + legends)


@pytest.fixture
def outputs(tmp_path):
    """A folder of trajectories whose residual is that of the table, growing from zero as the square of time."""

    def write(runs, time=TIME):
        for run in runs:
            folder = tmp_path / "runs" / run["run_id"]
            folder.mkdir(parents=True)
            with h5py.File(folder / "trajectory.h5", "w") as file:
                file["observables/energy_residual/time"] = time
                file["observables/energy_residual/value"] = run["energy_residual"] * (time / TIME[-1]) ** 2
        return tmp_path

    return write


def test_kinds_are_the_modules_without_an_underscore():
    assert {"energy", "lines"} <= set(chart.kinds())
    assert not any(kind.startswith("_") for kind in chart.kinds())


def test_neither_options_nor_drawing_load_pyplot_and_options_load_no_matplotlib(tmp_path):
    script = """
import sys, pyarrow
from runner import chart
for kind in chart.kinds():
    chart.kind_module(kind).Chart
assert "matplotlib" not in sys.modules, "options"
table = pyarrow.table({"a": [1], "status": ["finished"]})
chart.render([{"kind": "lines", "x": "a", "y": "a"}], table, sys.argv[1], "")
assert "matplotlib" in sys.modules and "matplotlib.pyplot" not in sys.modules, "drawing"
"""
    subprocess.run([sys.executable, "-c", script, tmp_path], check=True)


@pytest.mark.parametrize(
    "options, told",
    [
        ({}, "kind: missing"),
        ({"kind": "line"}, "did you mean 'lines'"),
        ({"kind": "lines", "x": MASS}, "y: missing"),
        ({"kind": "lines", "x": MASS, "y": 3}, "y: 3"),
        ({"kind": "energy", "serie": METHOD}, "serie: .*did you mean 'series'"),
    ],
)
def test_wrong_options_are_told(options, told):
    with pytest.raises(ValueError, match=told):
        chart.parse(options)


def test_columns_of_a_chart_are_told_by_option():
    given = {"x": MASS, "y": "bounces", "panel": METHOD}
    assert chart.columns(chart.parse({"kind": "lines", "title": "Masses", **given})) == given


@pytest.mark.parametrize("option", ["x", "y", "series", "panel"])
def test_an_unknown_column_is_told_with_those_like_it(option):
    with pytest.raises(ValueError, match=f"^{option}: .*'balls.mas' .*did you mean 'balls.mass'[^\n]*$"):
        drawn(**{"kind": "lines", "x": MASS, "y": "bounces", option: "balls.mas"})


def test_render_tells_which_chart_is_wrong(tmp_path):
    good = {"kind": "lines", "x": MASS, "y": "bounces"}
    with pytest.raises(ValueError, match=r"^charts\.1: y: "):
        chart.render([good, {**good, "y": "bouncs"}], table(rows()), tmp_path, "")


def test_an_empty_table_and_text_as_y_are_told():
    with pytest.raises(ValueError, match="no runs"):
        chart.draw(chart.parse({"kind": "energy"}), table(rows()).slice(0, 0), ".")
    with pytest.raises(ValueError, match="y: .*'solver.method' holds no numbers"):
        drawn(kind="lines", x=MASS, y=METHOD)
    with pytest.raises(ValueError, match="series: .*'run_id' has 36 different values"):
        drawn(kind="lines", x=MASS, y="bounces", series="run_id")


def test_one_run_a_point_is_drawn_as_it_is():
    runs = [run for run in rows() if run[DAMPING] == 0.05]
    figure = drawn(runs=runs, kind="lines", x=MASS, y="bounces", series=METHOD)
    expected = [[MASSES, [run["bounces"] for run in runs if run[METHOD] == method]] for method in METHODS]
    assert lines(figure.axes[0]) == expected
    assert "median" not in words(figure)


def test_runs_that_share_a_point_give_median_and_range():
    figure = drawn(kind="lines", x=MASS, y="bounces", series=METHOD)
    bars = [c for c in figure.axes[0].collections if isinstance(c, LineCollection)]
    for method, line, bar in zip(METHODS, lines(figure.axes[0]), bars, strict=True):
        sets = [[run["bounces"] for run in rows() if (run[METHOD], run[MASS]) == (method, mass)] for mass in MASSES]
        assert line == [MASSES, [median(values) for values in sets]]
        assert [segment[:, 1].tolist() for segment in bar.get_segments()] == [[min(s), max(s)] for s in sets]
    assert "median and range of 3 runs each (damping varies)" in words(figure)


def test_one_series_has_a_band():
    figure = drawn(kind="lines", x=MASS, y="bounces")
    (band,) = (c for c in figure.axes[0].collections if isinstance(c, PolyCollection))
    for mass in MASSES:
        values = [run["bounces"] for run in rows() if run[MASS] == mass]
        edges = {y for x, y in band.get_paths()[0].vertices if x == mass}
        assert edges == {min(values), max(values)}
    assert "median and range of 9 runs each (method and damping vary)" in words(figure)


def test_lines_that_coincide_stand_side_by_side():
    runs = [{**run, "bounces": 7} for run in rows()]
    axes = drawn(runs=runs, kind="lines", x=MASS, y="bounces", series=METHOD).axes[0]
    assert lines(axes) == [[MASSES, [7] * 4]] * 3
    places = [line.get_transform().transform(line.get_xydata())[0, 0] for line in axes.get_lines()]
    assert places[0] < places[1] - 2 < places[2] - 4


def test_names_along_x_stand_in_the_table_s_order():
    figure = drawn(kind="lines", x=METHOD, y="bounces", series=MASS)
    assert [text.get_text().replace("\n", "") for text in figure.axes[0].get_xticklabels()] == METHODS
    for mass, (x, y) in zip(MASSES, lines(figure.axes[0]), strict=True):
        assert np.round(x).tolist() == [0, 1, 2]
        assert y == [median(r["bounces"] for r in rows() if (r[METHOD], r[MASS]) == (m, mass)) for m in METHODS]
    assert "ball mass (kg):" in words(figure)


def test_panels_split_and_are_headed():
    figure = drawn(kind="lines", x=MASS, y="bounces", series=METHOD, panel=DAMPING)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["damping = 0", "damping = 0.05", "damping = 0.5"]
    for axes, damping in zip(figure.axes, DAMPINGS, strict=True):
        assert lines(axes)[2][1] == [r["bounces"] for r in rows() if (r[METHOD], r[DAMPING]) == (METHODS[2], damping)]


def test_diverged_and_failed_runs_are_left_out_and_told():
    runs = rows()
    runs[0].update(status="diverged", bounces=1e300)
    runs[1].update(status="diverged", bounces=np.inf)
    runs[2].update(status="failed", bounces=None)
    runs[3]["bounces"] = np.nan
    runs[6]["bounces"] = np.inf
    figure = drawn(runs=runs, kind="lines", x=MASS, y="bounces", series=METHOD)
    assert "2 diverged runs not shown" in words(figure)
    assert "1 failed run not shown" in words(figure)
    assert "2 runs without bounces not shown" in words(figure)
    assert lines(figure.axes[0])[0] == [[1, 10, 100], [median([10, 6]), median([11, 7]), 12]]
    assert figure.axes[0].get_ylim()[1] < 400


def test_a_point_that_lacks_runs_is_open():
    runs = rows()
    runs[0]["status"] = "diverged"
    figure = drawn(runs=runs, kind="lines", x=MASS, y="bounces", series=METHOD)
    (hollow,) = (line for line in figure.axes[0].get_lines() if line.get_markerfacecolor() == "white")
    assert hollow.get_xydata().tolist() == [[0.1, median([9, 5])]]
    assert "open markers" in words(figure)


def test_a_chart_without_any_figure_says_so():
    figure = drawn(kind="lines", x=MASS, y="position_error_rms", series=METHOD)
    assert "36 runs without RMS position error not shown" in words(figure)
    assert [text.get_text() for text in figure.axes[0].texts] == ["nothing to show"]


@pytest.mark.parametrize(
    "values, expected",
    [
        (MASSES, "log"),
        ([1e-4, 1e-2], "log"),
        ([1e-9, 5, 10], "log"),
        ([20, 100], "linear"),
        (range(1, 201), "linear"),
        (DAMPINGS, "linear"),
        ([0, *MASSES], "symlog"),
        ([-10, 1e-6, 1e-3, 3], "symlog"),
        (range(-100, 100), "linear"),
        ([0, 0], "linear"),
        ([], "linear"),
    ],
)
def test_scale_follows_the_values(values, expected):
    assert scale(values) == expected


def test_axes_have_the_scale_and_ticks_of_their_values():
    axes = drawn(kind="lines", x=MASS, y="bounces").axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0.1", "1", "10", "100"]
    assert drawn(kind="lines", x=DAMPING, y="bounces").axes[0].get_xscale() == "linear"


def test_a_logarithmic_axis_of_less_than_two_decades_has_more_ticks_than_powers_of_ten():
    axes = Figure().subplots()
    set_scale(axes, "y", [2500.0, 45000.0], "log")
    axes.set_ylim(2500.0, 45000.0)
    assert {text.get_text() for text in axes.get_yticklabels()} >= {"5000", "10000", "20000"}


def test_errors_decades_apart_are_compared_by_size():
    axes = drawn(kind="lines", x=MASS, y="energy_residual", series=METHOD).axes[0]
    assert axes.get_yscale() == "log"
    assert axes.get_ylabel() == "|energy residual| (J)"
    assert np.allclose(lines(axes)[2][1], [mass * 1e-9 * 1.05 for mass in MASSES], rtol=1e-12)


@pytest.mark.parametrize(
    "column, expected",
    [
        ("balls.mass", "ball mass (kg)"),
        ("scene.damping", "damping"),
        ("scene.wall_mass", "wall mass (kg)"),
        ("scene.forces.corridor.magnitude", "corridor magnitude (N)"),
        ("scene.forces.well.stiffness", "well stiffness (N/m)"),
        ("balls.emitter.max_speed", "emitter max speed (m/s)"),
        ("solver.method", "method"),
        ("step", "step (s)"),
        ("energy_residual_rel", "relative energy residual"),
        ("ball_steps_per_second", "simulation speed (ball-steps/s)"),
    ],
)
def test_labels_have_units(column, expected):
    assert label(column) == expected


def test_every_column_of_a_summary_has_its_words():
    """Else it would pass for a parameter: in notes that tell what varies, and without its unit."""
    assert set(COLUMNS) == set(SUMMARY)


def test_labels_stand_at_the_axes_and_the_title_says_what_is_shown():
    figure = drawn(kind="lines", x=MASS, y="bounces")
    assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == ("ball mass (kg)", "bounces")
    assert "Bounces against ball mass" in words(figure)
    assert "Mine: 5 $" in words(drawn(kind="lines", x=MASS, y="bounces", title="Mine: 5 $"))


@pytest.mark.parametrize(
    "value, expected",
    [(0.1, "0.1"), (-20.0, "−20"), (1e-6, "10⁻⁶"), (2.5e7, "2.5×10⁷"), (-1e-4, "−10⁻⁴")],
)
def test_numbers_read_well(value, expected):
    assert number_text(value) == expected


def test_energy_draws_few_runs_as_they_are(outputs):
    runs = [run for run in rows() if run[DAMPING] == 0]
    figure = drawn(outputs(runs), runs, kind="energy", series=METHOD)
    expected = [run["energy_residual"] * (TIME / TIME[-1]) ** 2 for run in runs]
    assert [line[0] for line in lines(figure.axes[0])] == [TIME.tolist()] * len(runs)
    assert np.array_equal([line[1] for line in lines(figure.axes[0])], expected)
    assert figure.axes[0].get_yscale() == "symlog"
    assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == ("time (s)", "energy residual (J)")


@pytest.mark.parametrize("signs", [(1, 1), (-1, -1), (1, -1)], ids=["gains", "losses", "both"])
def test_energy_gained_stands_above_zero_and_lost_below(outputs, signs):
    runs = [{**run, "energy_residual": signs[i % 2] * 10.0**-i} for i, run in enumerate(rows()[:6])]
    figure = drawn(outputs(runs), runs, kind="energy")
    axes = figure.axes[0]
    zero, low, high = axes.transData.transform([(0, y) for y in (0, *axes.get_ylim())])[:, 1]
    ends = axes.transData.transform([(0, run["energy_residual"]) for run in runs])[:, 1] - zero
    assert np.sign(ends).tolist() == [signs[i % 2] for i in range(6)]
    assert low - zero < ends.min() and ends.max() < high - zero
    sizes = np.abs(ends)
    assert np.all(sizes[:-1] > sizes[1:] + 0.05 * (high - low)), "a decade is some 5 % of the height or more"
    assert "energy is gained above zero, lost below" in words(figure)


def test_energy_of_like_runs_keeps_its_sign(outputs):
    runs = [run for run in rows() if (run[METHOD], run[MASS]) == (METHODS[0], 1.0)]
    figure = drawn(outputs(runs), runs, kind="energy", series=DAMPING)
    assert figure.axes[0].get_yscale() == "linear"
    assert figure.axes[0].get_ylabel() == "energy residual (J)"
    assert [line[1][-1] for line in lines(figure.axes[0])] == [run["energy_residual"] for run in runs]


def test_energy_draws_many_runs_as_median_and_band(outputs):
    figure = drawn(outputs(rows()), kind="energy", series=METHOD)
    for method, line, band in zip(METHODS, lines(figure.axes[0]), figure.axes[0].collections, strict=True):
        ends = [run["energy_residual"] for run in rows() if run[METHOD] == method]
        assert line[0] == TIME.round(9).tolist()
        assert np.allclose(line[1], median(ends) * (TIME / TIME[-1]) ** 2, rtol=1e-12)
        edges = [y for x, y in band.get_paths()[0].vertices if x == line[0][-1]]
        assert (min(edges), max(edges)) == (min(ends), max(ends))
    assert "median and range of 12 runs each (ball mass and damping vary)" in words(figure)


def test_energy_takes_medians_at_times_all_runs_have(outputs):
    runs = rows()
    outputs(runs[1:])
    figure = drawn(outputs(runs[:1], np.arange(11) * 0.05), runs, kind="energy")
    assert lines(figure.axes[0])[0][0] == TIME.round(9).tolist()


def test_energy_median_does_not_fall_when_a_diverged_run_ends(outputs):
    runs = [run for run in rows() if run[METHOD] == METHODS[0]]
    runs += [{**run, "run_id": run["run_id"] + "-b", "status": "diverged", "energy_residual": 1e12} for run in runs]
    outputs(runs[:12])
    folder = outputs(runs[12:], TIME[:4])
    figure = drawn(folder, runs, kind="energy")
    (line,) = lines(figure.axes[0])
    assert np.all(np.diff(line[1]) >= 0)
    assert figure.axes[0].get_ylim()[1] < 1e3
    assert "12 diverged runs stopped early" in words(figure)


def test_energy_leaves_out_and_tells_runs_without_a_trajectory(outputs):
    runs = [run for run in rows() if run[DAMPING] == 0]
    folder = outputs(runs[2:])
    (folder / "runs" / runs[1]["run_id"]).mkdir()
    runs[2]["status"] = "failed"
    figure = drawn(folder, runs, kind="energy", series=METHOD, panel=MASS)
    assert sum(len(lines(axes)) for axes in figure.axes) == len(runs) - 3
    assert "2 runs without a trajectory not shown" in words(figure)
    assert "1 failed run not shown" in words(figure)


def test_files_are_named_by_their_options_signed_and_the_same_each_time(outputs):
    folder = outputs(rows())
    charts = [
        {"kind": "lines", "x": MASS, "y": "bounces", "series": METHOD},
        {"kind": "lines", "x": MASS, "y": "bounces"},
        {"kind": "energy", "series": METHOD},
        {"kind": "energy"},
    ]
    names = ["lines-bounces-by-balls.mass", "lines-bounces-by-balls.mass-2", "energy-by-solver.method", "energy"]
    written = chart.render(charts, table(rows()), folder, "carom 1.2, a machine")
    assert written == [folder / "charts" / (name + suffix) for name in names for suffix in (".png", ".svg")]
    assert sorted(folder.joinpath("charts").iterdir()) == sorted(written)
    first = [path.read_bytes() for path in written]
    for svg in first[1::2]:
        assert b"carom 1.2, a machine" in svg
        assert b"<text" in svg
    chart.render(charts, table(rows()), folder, "carom 1.2, a machine")
    assert [path.read_bytes() for path in written] == first


def test_a_name_cannot_leave_the_folder_or_break_the_text(tmp_path):
    odd = "scene.forces.../$a$_{b}.magnitude"
    runs = [{**run, odd: run[MASS]} for run in rows()]
    written = chart.render([{"kind": "lines", "x": odd, "y": "bounces"}], table(runs), tmp_path, "$5 & <b>")
    assert {path.parent for path in written} == {tmp_path / "charts"}
    assert "$a$ {b} magnitude (N)</text>" in written[1].read_text()


STEPS = [1e-1, 5e-2, 2e-2, 1e-2, 5e-3, 2e-3, 1e-3]
ORDERS = {"explicit_euler": 1, "rk4_original": 2, "rk4": 4}


def work(contacts=("swept",)):
    """Errors of exactly each method's order, down to rounding, that grow no further at coarse steps; with exact."""
    runs = [
        {
            "run_id": f"{method}-{step:g}-{contact}",
            "status": "finished",
            METHOD: method,
            "contact": contact,
            "step": step,
            "position_error_rms": max(min(0.3, 10 * step**order), 1e-12) if contact == "swept" else step**0.5,
            "ns_per_ball_second": order * 100 / step,
        }
        for (method, order), contact, step in itertools.product(ORDERS.items(), contacts, STEPS)
    ]
    exact = {METHOD: "exact", "contact": "swept", "step": None, "position_error_rms": 0.0, "ns_per_ball_second": 5e4}
    return [{"run_id": "exact", "status": "finished", **exact}, *runs]


def legend(figure):
    return [text.get_text() for each in figure.legends for text in each.get_texts()]


def test_work_precision_runs_through_the_steps_and_tells_the_order():
    figure = drawn(runs=work()[::-1], kind="work_precision")
    runs = [run for run in work() if run[METHOD] == "explicit_euler"]
    expected = [[run["position_error_rms"] for run in runs], [run["ns_per_ball_second"] for run in runs]]
    assert expected in lines(figure.axes[0]), "from the coarsest step to the finest"
    assert figure.axes[0].get_xscale() == figure.axes[0].get_yscale() == "log"
    assert legend(figure) == ["rk4 order 4.0", "rk4_original order 2.0", "explicit_euler order 1.0", "exact", "Pareto front"]


def test_a_slope_leaves_out_coarse_steps_and_rounding():
    points = [Point(step, min(0.1, 50 * step**2), 1 / step) for step in STEPS]
    assert slope(points) == ("order", pytest.approx(2))
    assert slope([*points, Point(1e-6, 1e-12, 1e6)]) == ("order", pytest.approx(2))
    assert slope(points[-2:]) is None
    assert slope([Point(step, 1e-12, 1 / step) for step in STEPS]) is None


def test_the_slope_of_methods_that_choose_their_steps_is_that_of_cost():
    assert slope([Point(None, error, error**-0.2) for error in (1e-2, 1e-4, 1e-6, 1e-8)]) == ("cost slope", pytest.approx(-0.2))


def test_the_front_is_what_nothing_beats_in_both():
    assert front([(3, 1), (1, 3), (2, 2), (2, 4), (3, 2), (1, 5)]) == [(1, 3), (2, 2), (3, 1)]
    assert front([(0, 1), (1, 1), (2, 3)]) == [(0, 1)], "an exact solution that costs less than all ends it"


def test_a_run_without_error_stands_at_the_left_edge_with_its_name():
    axes = drawn(runs=work(), kind="work_precision").axes[0]
    (star,) = (line for line in axes.get_lines() if line.get_marker() == "*")
    assert star.get_xydata().tolist() == [[axes.get_xlim()[0], 5e4]]
    assert axes.get_xlim()[0] < min(run["position_error_rms"] for run in work()[1:])
    assert [text.get_text() for text in axes.texts] == ["exact"]


def test_contact_rules_are_told_apart_where_both_occur():
    figure = drawn(runs=work(("swept", "original")), kind="work_precision")
    assert "rk4_original order 2.0, dashed 0.5" in legend(figure)
    assert "original contact" in legend(figure)
    dashed = [line for line in figure.axes[0].get_lines() if line.is_dashed()]
    assert len(dashed) == len(ORDERS)
    assert not any(line.is_dashed() for line in drawn(runs=work(("original",)), kind="work_precision").axes[0].get_lines())


def test_work_precision_takes_medians_and_splits_into_panels():
    runs = [
        {**run, "scene": scene, "position_error_rms": run["position_error_rms"] * factor * size, MASS: factor}
        for run in work()
        for (scene, size), factor in itertools.product({"box": 1, "baffles": 5}.items(), (1.0, 2.0, 7.0))
    ]
    figure = drawn(runs=runs, kind="work_precision", panel="scene")
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["box", "baffles"]
    assert "median of 3 runs each (ball mass varies)" in words(figure)
    ends = [{line[0][-1] for line in lines(axes) if len(line[0]) == len(STEPS)} for axes in figure.axes]
    assert [max(found) for found in ends] == [2 * 0.01, 5 * 2 * 0.01], "twice the error of the finest step"


def test_work_precision_without_a_reference_says_so():
    figure = drawn(runs=[{**run, "position_error_rms": None} for run in work()], kind="work_precision")
    assert "22 runs without RMS position error not shown" in words(figure)
    assert [text.get_text() for text in figure.axes[0].texts] == ["nothing to show"]


STIFFNESS, DRAG = "scene.forces.well.stiffness", "scene.forces.air.coefficient"
RATES = [1.0, 2.0, 5.0, 10.0, 20.0]


def oscillators(key=STIFFNESS, limit=2.0, mass=4.0):
    """Runs on a grid that keep their energy up to `limit` of the step times the rate, then grow twentyfold, then diverge."""
    runs = []
    for step, rate in itertools.product([0.05, 0.1, 0.2, 0.5, 1.0], RATES):
        product = step * rate
        runs.append(
            {
                "status": "diverged" if product > 2 * limit else "finished",
                METHOD: "symplectic_euler",
                "method": "symplectic_euler",
                "solver.step": step,
                key: mass * (rate**2 if key == STIFFNESS else rate),
                "balls.mass": mass,
                "energy_initial": 2.0,
                "energy_final": 40.0 if product > limit else 2.0,
            }
        )
    return runs


def unstable(axes):
    """For each cell whether it is shown as unstable; rows are strengths."""
    (mesh,) = (each for each in axes.collections if each.get_array() is not None)
    return mesh.get_array().reshape(len(RATES), -1) >= 2


@pytest.mark.parametrize("key", [STIFFNESS, DRAG])
def test_the_measured_border_lies_along_theory_s_line(key):
    axes = drawn(runs=oscillators(key), kind="stability", x="solver.step", y=key).axes[0]
    (line,) = axes.get_lines()
    for step, strength in line.get_xydata():
        rate = (strength / 4) ** 0.5 if key == STIFFNESS else strength / 4
        assert step * rate == pytest.approx(2.0)
    expected = [[step * rate > 2 for step in [0.05, 0.1, 0.2, 0.5, 1.0]] for rate in RATES]
    assert unstable(axes).tolist() == expected
    assert "by theory stable up to" in axes.texts[0].get_text()


@pytest.mark.parametrize(
    "change, shown",
    [
        ({"status": "diverged", "energy_final": 2.0}, 3),
        ({"energy_final": 20.1}, 2),
        ({"energy_final": 19.9}, 1),
        ({"energy_final": 0.19}, 0),
        ({"energy_final": -1e-18}, 0),
    ],
)
def test_a_cell_tells_what_became_of_the_energy(change, shown):
    run = {**oscillators()[0], **change}
    axes = drawn(runs=[run], kind="stability", x="solver.step", y=STIFFNESS).axes[0]
    assert axes.collections[0].get_array().ravel().tolist() == [shown]


def test_the_worst_run_of_a_cell_counts_and_others_are_told():
    good = oscillators()[0]
    runs = [{**good, "balls.radius": 1.0}, {**good, "status": "diverged", "balls.radius": 2.0}]
    runs += [{**good, "status": "failed"}, {**good, STIFFNESS: 0.0}, {**good, "energy_initial": None}]
    figure = drawn(runs=runs, kind="stability", x="solver.step", y=STIFFNESS)
    assert figure.axes[0].collections[0].get_array().ravel().tolist() == [3]
    for told in ("worst of its runs (ball radius)", "1 failed run", "without well stiffness", "without initial energy"):
        assert told in words(figure)


def test_methods_without_a_limit_say_so_and_draw_none(monkeypatch):
    method = integrators.load("explicit_euler")[0]
    runs = oscillators()
    for claim, told in ((0.0, "by theory unstable at any step"), (np.inf, "by theory stable at any step")):
        claims = dataclasses.replace(method, oscillator_limit=claim)
        monkeypatch.setattr(integrators, "load", lambda name, claims=claims: (claims, None, ""))
        axes = drawn(runs=runs, kind="stability", x="solver.step", y=STIFFNESS).axes[0]
        assert [text.get_text() for text in axes.texts] == [told]
        assert not axes.get_lines()


def test_a_stability_chart_needs_a_spring_or_drag():
    with pytest.raises(ValueError, match="^y: 'balls.mass' is neither"):
        chart.parse({"kind": "stability", "x": "solver.step", "y": "balls.mass"})
    assert chart.columns(chart.parse({"kind": "stability", "x": "solver.step", "y": STIFFNESS}))["mass"] == "balls.mass"
