"""report.html: a sweep on one page, which needs no network and opens from its file."""

from __future__ import annotations

import base64
import hashlib
import shlex
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from runner import expect, machine, store
from runner.chart._names import label
from runner.config import Experiment, Run
from runner.record.rrd import FILE as RECORDING
from runner.result import FAILURES
from runner.tables import text

if TYPE_CHECKING:
    import pyarrow
    from markupsafe import Markup

FILE = "report.html"
TEMPLATES = Path(__file__).parent / "templates"
ASIDE = ("error", "started")  # columns that the table leaves out
SVG, LINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"


def write(folder: Path, experiment: Experiment, runs: Sequence[Run], table: pyarrow.Table, charts: Iterable[Path]) -> Path:
    """Write the report of the sweep in `folder`: `runs` are those the experiment asks for, `charts` the files drawn."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    style, script = (Markup((TEMPLATES / f"report.{kind}").read_text(encoding="utf-8")) for kind in ("css", "js"))
    source = (folder / store.EXPERIMENT).read_text(encoding="utf-8")
    same, varied = columns(table)
    provenance = store.provenance(folder)
    status, recorded = table["status"].to_pylist(), store.holding(folder, RECORDING)
    page = environment.get_template(FILE).render(
        name=experiment.name,
        runs=table.num_rows,
        question=question(source),
        source=source,
        counts=Counter(status).most_common(),
        verdicts=expect.verdicts(experiment.expect, store.read_runs(folder, (run.run_id for run in runs))),
        describe=expect.describe,
        charts=[(path.stem, inline(path, f"c{place}-")) for place, path in enumerate(p for p in charts if p.suffix == ".svg")],
        same=[(label(name), text(value)) for name, value in same.items()],
        headings=[(name, label(name), _numeric(table[name])) for name in varied],
        data={
            "rows": list(zip(*([text(value) for value in table[name].to_pylist()] for name in varied))),
            "recorded": [run_id in recorded for run_id in table["run_id"].to_pylist()],
            "view": f"carom view {shlex.quote(str(folder))}",
        },
        failed=[row for row in table.select(["run_id", "status", "error"]).to_pylist() if row["status"] in FAILURES],
        versions=provenance.get("versions", {}),
        made=provenance.get("machine", {})
        | {name: provenance.get(name) for name in ("start", "end", "commit")}
        | {"command": shlex.join(provenance.get("command", []))},
        machine=machine.footer(),
        style=style,
        script=script,
        digest=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
    )
    store.write_text(folder / FILE, page)
    return folder / FILE


def question(source: str) -> str:
    """The comment at the top of an experiment file, which says what it asks."""
    lines = []
    for line in source.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.lstrip("#").strip())
    return " ".join(lines)


def columns(table: pyarrow.Table) -> tuple[dict[str, Any], list[str]]:
    """The columns that hold the same in all runs that have it, with what they hold; and those to show."""
    same, varied = {}, ["run_id", "status"]
    repeated = {name.removeprefix("solver.") for name in table.column_names if name.startswith("solver.")}
    for name in table.column_names:
        if name not in (*ASIDE, *varied, *repeated):
            values = {value for value in table[name].to_pylist() if value is not None}
            if len(values) > 1:
                varied.append(name)
            elif values:
                same[name] = values.pop()
    return same, varied


def inline(path: Path, prefix: str) -> Markup:
    """An SVG file as a part of a page: it fills the width it gets, and its ids begin with `prefix`, to clash with no other's."""
    from markupsafe import Markup

    for name, space in (("", SVG), ("xlink", LINK.removesuffix("href"))):
        ElementTree.register_namespace(name, space[1:-1])
    root = ElementTree.fromstring(path.read_bytes())
    for metadata in root.findall(f"{SVG}metadata"):
        root.remove(metadata)
    for size in ("width", "height"):
        root.attrib.pop(size, None)
    for element in root.iter():
        for name, value in element.attrib.items():
            if name == "id":
                element.set(name, prefix + value)
            elif name == LINK:
                element.set(name, value.replace("#", f"#{prefix}"))
            else:
                element.set(name, value.replace("url(#", f"url(#{prefix}"))
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _numeric(column: pyarrow.ChunkedArray) -> bool:
    import pyarrow

    return pyarrow.types.is_integer(column.type) or pyarrow.types.is_floating(column.type)
