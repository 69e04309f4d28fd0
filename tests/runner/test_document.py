"""A YAML file as plain data with places, and the options that change it."""

from pathlib import Path

import pytest
from ruamel.yaml import YAML

from runner.document import Document, dotted, read_values, split, suggestion
from runner.errors import InputError

TEXT = """\
# why
balls: {mass: 1.50, list: [1, {a: 2}]}   # kg
scene:
  gravity:
    - 0
    - 1e1
other: &other {centre: [1, 2]}
again: *other
"""


@pytest.fixture
def document(here):
    Path("x.yaml").write_text(TEXT)
    return Document(Path("x.yaml"))


def test_data_is_plain(document):
    group = {"center": [1, 2]}
    assert document.data == {
        "balls": {"mass": 1.5, "list": [1, {"a": 2}]}, "scene": {"gravity": [0, 10.0]}, "other": group, "again": group,
    }  # fmt: skip
    assert type(document.data["balls"]["mass"]) is float and type(document.data["balls"]["list"][0]) is int


@pytest.mark.parametrize(
    ("path", "place"),
    [
        ("balls", "2:1"),
        ("balls.mass", "2:9"),
        ("balls.list.1.a", "2:32"),
        ("scene.gravity.1", "6:7"),
        ("other.center", "7:16"),
        ("balls.missing", "2:1"),  # the nearest thing around it
        ("scene.gravity.7", "4:3"),
        ("nowhere", "1:1"),
    ],
)
def test_places(document, path, place):
    assert document.place(split(path)) == f"x.yaml:{place}"


@pytest.mark.parametrize(
    ("text", "number"), [("1e-3", 1e-3), ("1.0e-3", 1e-3), ("0x10", 16), ("0o10", 8), ("010", 10), ("1_000", 1000)]
)
def test_numbers_are_those_of_yaml_1_2(here, text, number):
    Path("n.yaml").write_text(f"a: {text}\nb: yes\n")
    assert Document(Path("n.yaml")).data == {"a": number, "b": "yes"}


def test_an_override_is_in_the_data_and_in_the_text_which_keeps_its_comments(document, here):
    document.override(("balls", "mass"), 7, "-s balls.mass")
    document.override(("scene", "new", "deep"), [1, 2], "-s scene.new.deep")
    document.override(("scene", "gravity", 1), 3, "-s scene.gravity.1")
    document.override(("other", "center"), 5, "-s other.center")
    text = document.text()
    assert "# why\n" in text and "# kg\n" in text
    Path("y.yaml").write_text(text)
    again = Document(Path("y.yaml"))
    assert again.data["balls"] == document.data["balls"] == {"mass": 7, "list": [1, {"a": 2}]}
    assert again.data["scene"] == document.data["scene"] == {"gravity": [0, 3], "new": {"deep": [1, 2]}}
    assert again.data["other"] == document.data["other"] == {"center": 5}
    assert "centre: 5" in text  # as it was spelt


def test_an_override_leaves_aliases_alone(here):
    Path("x.yaml").write_text("a: &a {b: {c: 1}}  # one\nd: *a\ne: {<<: *a, f: 2}\n")
    document = Document(Path("x.yaml"))
    document.override(("a", "b", "c"), 7, "")
    document.override(("e", "b", "c"), 8, "")
    Path("y.yaml").write_text(document.text())
    assert document.data == Document(Path("y.yaml")).data
    assert document.data == {"a": {"b": {"c": 7}}, "d": {"b": {"c": 1}}, "e": {"b": {"c": 8}, "f": 2}}
    assert "# one" in document.text()


def test_what_an_override_brought_in_is_told_as_the_option(document):
    document.override(("balls", "mass"), 7, "-s balls.mass")
    document.override(("scene", "new", "deep"), [1, 2], "-s deep")
    assert document.place(("balls", "mass")) == "-s balls.mass"
    assert document.place(("scene", "new", "deep", 1)) == "-s deep"
    assert document.place(("scene", "new")) == "-s deep"  # which made the group, too
    assert document.place(("balls", "list")) == "x.yaml:2:21"


def test_without_an_override_the_text_is_the_file(here):
    text = "a:   -0e-7   # a number that ruamel does not write\n"
    Path("x.yaml").write_text(text)
    document = Document(Path("x.yaml"))
    assert document.text() == text
    document.override(("b",), 1, "")
    Path("y.yaml").write_text(document.text())
    assert Document(Path("y.yaml")).data == {"a": 0.0, "b": 1}


def test_the_text_holds_what_it_says_it_holds(document):
    assert YAML(typ="safe").load(document.text())["balls"] == document.data["balls"]


def test_values_of_an_option():
    assert read_values("1,1e1, x,[1, 2],{a: 1}", "") == [1, 10.0, "x", [1, 2], {"a": 1}]
    assert read_values("null", "") == [None]
    with pytest.raises(InputError, match="^-s a=: has no value$"):
        read_values("", "-s a=")


def test_dotted_paths():
    assert split("balls.released.0.centre") == ("balls", "released", 0, "center")
    assert dotted(("balls", 0, "a")) == "balls.0.a"


def test_suggestions():
    assert suggestion("dampng", ["damping", "mass"]) == " (did you mean 'damping'?)"
    assert suggestion("zzz", ["damping", "mass"]) == ""
