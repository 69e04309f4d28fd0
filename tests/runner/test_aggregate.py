"""The table of runs: its columns, their types, and the order of its rows."""

import pytest

from runner import aggregate
from runner.columns import COLUMNS, FIGURES, TEXTS, WHOLE


def report(run_id, parameters, status="finished", error=None, **figures):
    timings = {"started": "2020-01-01T00:00:00.000+00:00", "wall_seconds": 0.5}
    figures = dict.fromkeys(FIGURES) | figures if status != "failed" else {}
    return {
        "run_id": run_id,
        "status": status,
        "error": error,
        "parameters": parameters,
        "figures": figures,
        "timings": timings,
    }


def settings(mass=1.0, method="a", gravity=(0.0, -9.8, 0.0), every=0.01, **more):
    return {
        "balls": {"mass": mass, **more},
        "solver": {"method": method},
        "scene": {"gravity": list(gravity)},
        "record": {"every": every},
    }


def test_without_runs_there_are_columns():
    table = aggregate.build([], ["balls.mass"])
    assert table.column_names == COLUMNS[:3] + ["balls.mass"] + COLUMNS[3:] and table.num_rows == 0


def test_columns_of_the_matrix_stand_after_the_first_three():
    table = aggregate.build([report("x", settings())], ["solver.method", "balls.mass"])
    assert table.column_names == ["run_id", "status", "error", "solver.method", "balls.mass", *COLUMNS[3:]]


def test_figures_keep_their_types_and_what_is_missing_is_empty():
    runs = [
        report("x", settings(), bounces=3, energy_lost=1, method="a"),
        report("y", settings(mass=2.0), "failed", "oh"),
    ]
    table = aggregate.build(runs, ["balls.mass"])
    for name in COLUMNS:
        kind = "string" if name in TEXTS else "int64" if name in WHOLE else "double"
        assert str(table.schema.field(name).type) == kind, name
    assert table["bounces"].to_pylist() == [3, None] and table["error"].to_pylist() == [None, "oh"]
    assert table["wall_seconds"].to_pylist() == [0.5, 0.5]


def test_settings_in_which_runs_differ_get_a_column_too_but_not_the_recorders():
    runs = [report("x", settings()), report("y", settings(method="b", every=0.1))]
    assert aggregate.build(runs, ["balls.mass"]).column_names[3:5] == ["balls.mass", "solver.method"]
    assert "record.every" not in aggregate.build(runs, []).column_names
    assert "record.every" in aggregate.build(runs, ["record.every"]).column_names


def test_rows_stand_in_the_order_of_the_varied_settings():
    masses = [10.0, 2.0, None, 1.0]
    runs = [report(f"{mass}{method}", settings(mass, method)) for method in "ba" for mass in masses]
    table = aggregate.build(runs, ["solver.method", "balls.mass"])
    assert table["run_id"].to_pylist() == ["1.0a", "2.0a", "10.0a", "Nonea", "1.0b", "2.0b", "10.0b", "Noneb"]


@pytest.mark.parametrize(
    ("values", "kind", "written"),
    [
        ([1.0, 2, None], "double", [1.0, 2.0, None]),
        ([True, False, None], "bool", [False, True, None]),
        (["a", None, "b"], "string", ["a", "b", None]),
        ([[0, 1], [0, 2]], "string", ["[0, 1]", "[0, 2]"]),
        ([1.0, "a"], "string", ["1.0", "a"]),
        ([{"shape": "plane"}, None], "string", ['{"shape": "plane"}', None]),
    ],
)
def test_settings_of_every_kind(values, kind, written):
    runs = [report(str(n), settings(thing=value)) for n, value in enumerate(values)]
    table = aggregate.build(runs, ["balls.thing"])
    assert str(table.schema.field("balls.thing").type) == kind
    assert table["balls.thing"].to_pylist() == written


def test_written_as_parquet_and_csv_and_read_back(tmp_path):
    (tmp_path / "runs").mkdir()
    table = aggregate.summarise(tmp_path, ["balls.mass"])
    assert aggregate.read(tmp_path).equals(table)
    assert (tmp_path / "summary.csv").read_text().splitlines() == [",".join(f'"{name}"' for name in table.column_names)]
    assert {path.name for path in tmp_path.iterdir()} == {"runs", "summary.csv", "summary.parquet"}
