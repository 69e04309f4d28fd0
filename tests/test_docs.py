"""What the documents and the experiment files say is so, and the sources lie in the order that they should."""

import ast
import graphlib
import inspect
import re
from pathlib import Path

import pytest
import typer

import runner
from runner import cli, config, starts

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
CONFIGS = sorted((ROOT / "configs").rglob("*.yaml"))
COMMANDS = typer.main.get_command(cli.app).commands


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_and_stands_in_the_readme(name):
    command = COMMANDS[name]
    assert command.help and len(command.help) > 20
    assert all(option.help for option in command.params if option.name != "help"), "every option has help"
    assert f"carom {name}" in README


def test_the_readme_names_no_command_that_is_not_there():
    code = "\n".join(re.findall(r"```sh\n(.*?)```", README, re.S) + re.findall(r"`([^`\n]+)`", README))
    assert set(re.findall(r"\bcarom ([a-z]+)\b", code)) <= set(COMMANDS)


@pytest.mark.parametrize("option", sorted(set(re.findall(r"(?<=[ `(])--?[a-z][a-z-]*", README))))
def test_the_readme_names_no_option_that_is_not_there(option):
    known = {name for command in COMMANDS.values() for parameter in command.params for name in parameter.opts}
    of_others = {"-m", "-n", "-q", "-c", "--help"}  # python's, pytest's, pip's
    assert option in known | of_others


def test_there_are_configs():
    assert len(CONFIGS) >= 2


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_config_asks_a_question_and_its_runs_can_be_made(path):
    first = path.read_text(encoding="utf-8").splitlines()[0]
    assert re.fullmatch(r"# .*\?.*", first), "the first line is a comment that states the question"
    experiment = config.load(path)  # checks that expectations and charts speak of columns that there are
    assert experiment.name == path.stem
    runs = experiment.runs()
    assert len(runs) == len({run.run_id for run in runs}) > 0
    assert starts.faults(runs, experiment.document) == []
    for run in runs[:: max(1, len(runs) // 8)]:
        run.setup.scene.build(run.folder)
        assert len(run.setup.balls.build(run.setup.duration, run.folder)) > 0


@pytest.mark.parametrize("text", re.findall(r"```yaml\n(.*?)```", README, re.S))
def test_every_experiment_in_the_readme_loads(tmp_path, text):
    (tmp_path / "readme.yaml").write_text(text, encoding="utf-8")
    assert config.load(tmp_path / "readme.yaml").runs()


@pytest.mark.parametrize("text", re.findall(r"```python\n(.*?)```", README, re.S))
def test_the_python_in_the_readme_imports_what_there_is(text):
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.module.split(".")[0] in ("runner", "sim"):
            module = __import__(node.module, fromlist=["x"])
            assert all(hasattr(module, alias.name) for alias in node.names)


def test_the_files_to_start_a_cluster_with_can_be_read():
    from ruamel.yaml import YAML

    cluster, scaler = YAML(typ="safe").load_all((ROOT / "docs/kubernetes.yaml").read_text(encoding="utf-8"))
    assert (cluster["kind"], scaler["kind"]) == ("DaskCluster", "DaskAutoscaler")
    assert scaler["spec"]["cluster"] == cluster["metadata"]["name"]
    for name, options in (("scheduler", []), ("worker", ["--nthreads", "1"])):  # others with several threads are refused
        program, command, *arguments = cluster["spec"][name]["spec"]["containers"][0]["args"]
        assert (program, command) == ("dask", name)
        module = pytest.importorskip(f"distributed.cli.dask_{name}")
        module.main.make_context(command, list(arguments))  # raises where it has no such option
        assert " ".join(options) in " ".join(arguments)
    tree = ast.parse((ROOT / "docs/slurm.py").read_text(encoding="utf-8"))
    (sweep,) = (node for node in ast.walk(tree) if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "sweep")
    assert {keyword.arg for keyword in sweep.keywords} <= set(inspect.signature(runner.sweep).parameters)


# The sources

MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in (ROOT / "runner").rglob("*.py")
}


def imports(name: str) -> set[str]:
    """The modules of the runner that a module imports anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: imports are absolute"
            inside = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in MODULES else node.module for name in inside}
    return {module for module in found if module in MODULES} - {name}


FOUND_BY_NAME = ("runner.chart.", "runner.record.", "runner.bench.peers.")
IMPORTS = {name: imports(name) for name in MODULES}


def test_imports_go_one_way():
    graphlib.TopologicalSorter(IMPORTS).prepare()  # raises CycleError, with the circle


def test_every_module_of_the_runner_is_used_by_another_but_the_way_in():
    used = set().union(*IMPORTS.values())
    unused = {name for name in MODULES if name not in used and not name.startswith(FOUND_BY_NAME)}
    assert unused == {"runner", "runner.__main__"}
    assert [name for name in MODULES if "runner.cli" in IMPORTS[name]] == ["runner.__main__"]
