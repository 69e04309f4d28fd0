"""The output folder of an experiment: what is where, and how a run gets there whole or not at all."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import socket
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from runner import claims, forms, seal
from runner.errors import Damaged

RUNS, EXPERIMENT, PROVENANCE, SUMMARY, RUN = "runs", "experiment.yaml", "provenance.json", "summary", "run.json"
ASIDE, CHARTS = ".aside", "charts"
#: Many runs may lie in one folder, a pack: runs/pack-3/ has a list of them, and their reports, a line each.
PACK, MEMBERS, REPORTS = re.compile(r"pack-(\d+)"), "pack.json", "runs.jsonl"


def run_folder(folder: Path, run_id: str) -> Path:
    """The folder that a run gets when it is made; `places` tells where it is now."""
    return folder / RUNS / run_id


def pack_folder(folder: Path, number: int) -> Path:
    return folder / RUNS / f"pack-{number}"


def pack_number(entry: Path) -> int:
    """Packs count from 1 in the order that they were made; 0 for the folder of a single run."""
    match = PACK.fullmatch(entry.name)
    return int(match[1]) if match else 0


def entries(folder: Path) -> list[Path]:
    """All that has its final name among the runs: packs, the oldest first, then folders of single runs."""
    runs = folder / RUNS
    try:
        found = [runs / name for name in sorted(os.listdir(runs)) if not name.startswith(".")]
    except (FileNotFoundError, NotADirectoryError):
        return []
    return sorted(found, key=lambda entry: pack_number(entry) or math.inf)


def places(folder: Path) -> dict[str, Path]:
    """The entry that each run lies in, of all runs that are done. Where it lies in several, the last one made counts.

    Raises Damaged for a pack that does not tell what it holds.
    """
    found = {}
    for entry in entries(folder):
        found |= dict.fromkeys(members(entry) if pack_number(entry) else [entry.name], entry)
    return found


def done(folder: Path) -> set[str]:
    """The ids of all runs that are done, whatever came of them."""
    return set(places(folder))


def members(pack: Path) -> dict[str, list[str]]:
    """The runs in a pack, and the files that each had. Raises Damaged."""
    return contents(pack)["runs"]


def holding(folder: Path, name: str) -> dict[str, Path]:
    """`places` of the runs that have a file of that name, in a folder of their own or packed."""
    found = places(folder)
    packed = {entry: members(entry) for entry in set(found.values()) if pack_number(entry)}
    return {
        run_id: entry
        for run_id, entry in found.items()
        if (name in packed[entry][run_id] if entry in packed else (entry / name).exists())
    }


def read_run(folder: Path, run_id: str) -> dict[str, Any]:
    (report,) = read_runs(folder, [run_id])
    return report


def read_runs(folder: Path, run_ids: Iterable[str] | None = None) -> Iterator[dict[str, Any]]:
    """The reports of those of the runs that are done, a pack after the other; without `run_ids` of all, in order of id.

    Raises Damaged.
    """
    found = places(folder)
    together: dict[Path, list[str]] = {}
    for run_id in sorted(found) if run_ids is None else run_ids:
        if run_id in found:
            together.setdefault(found[run_id], []).append(run_id)
    for entry, run_ids in together.items():
        try:
            reports = _reports(entry) if pack_number(entry) else {entry.name: contents(entry)}
        except Damaged:
            if entry.exists():
                raise
            yield from read_runs(folder, run_ids)  # another sweep has just packed it
        else:
            yield from (reports[run_id] for run_id in run_ids)


def _reports(pack: Path) -> dict[str, dict[str, Any]]:
    """The reports of the runs in a pack, by id."""
    path, told = pack / REPORTS, contents(pack)
    if wrong := seal.fault(path, told["files"].get(REPORTS, {})):
        raise Damaged(path, wrong)
    lines = path.read_bytes().splitlines()
    try:
        # at once: what is read together shares its keys, and takes half the memory
        reports = [forms.check(forms.Run, report) for report in forms.parse(b"[%b]" % b",".join(lines))]
    except ValueError as error:
        raise Damaged(path, str(error)) from None
    found = {report["run_id"]: report for report in reports}
    if missing := told["runs"].keys() - found.keys():
        raise Damaged(path, f"tells nothing of {min(missing)}")
    return found


def contents(entry: Path) -> dict[str, Any]:
    """What an entry tells of itself: a run's report, a pack's members and files. Raises Damaged."""
    name, form = (MEMBERS, forms.Pack) if pack_number(entry) else (RUN, forms.Run)
    path = entry / name
    if not path.is_file():
        raise Damaged(path, "missing")
    try:
        return forms.check(form, seal.unseal(path.read_bytes()))
    except FileNotFoundError:  # another sweep has just packed it
        raise Damaged(path, "missing") from None
    except ValueError as error:
        raise Damaged(path, str(error)) from None


def faults(entry: Path) -> Iterator[tuple[Path, str]]:
    """The files of a run, or of a pack, that are not as they were made, and what is wrong with each."""
    try:
        told = contents(entry)
    except Damaged as error:
        yield error.path, error.reason
        return
    path = entry / (MEMBERS if pack_number(entry) else RUN)
    if not {"files", "sha256"} <= told.keys():
        yield path, "has no checksums, as older versions made it"
    if told.get("run_id", entry.name) != entry.name:
        yield path, f"tells of another run, {told['run_id']}"
    for name, noted in told.get("files", {}).items():
        if wrong := seal.fault(entry / name, noted):
            yield entry / name, wrong


def write_contents(made: Path, name: str, data: dict[str, Any]) -> None:
    """Put run.json or pack.json into a folder that is otherwise complete, with the checksums of all its files."""
    files = {file: seal.checksum(made / file) for file in sorted(os.listdir(made))}
    (made / name).write_bytes(seal.seal(data | {"files": files}))


def write_text(path: Path, text: str) -> None:
    """Write aside, then rename: whoever reads sees the old text or the new one, whole."""
    write_with(path, lambda aside: aside.write_text(text, encoding="utf-8"))


def write_json(path: Path, data: Any) -> None:
    write_text(path, json.dumps(data, indent=1) + "\n")


def write_with(path: Path, write) -> None:
    """Let `write(aside)` make a file, then give it its name."""
    aside = path.with_name(f".{path.name}.{socket.gethostname()}-{os.getpid()}")
    try:
        write(aside)
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)


def clear(folder: Path) -> None:
    """Remove what sweeps that died left behind: runs that were being made, files that had not got their names."""
    claims.clear(folder / RUNS / ASIDE)
    mark = f".{socket.gethostname()}-"
    for left in [*folder.glob(f".*{mark}*"), *(folder / CHARTS).glob(f".*{mark}*")]:
        pid = left.name.rpartition("-")[2]
        if pid.isdigit() and not _alive(int(pid)):
            left.unlink(missing_ok=True)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def publish(made: Path, final: Path, replace: bool) -> None:
    """Give the finished folder `made` its final name. One already there, of another sweep, stays unless `replace`."""
    if replace and final.exists():
        old = made.with_name(made.name + ".old")
        os.rename(final, old)
        os.rename(made, final)
        shutil.rmtree(old, ignore_errors=True)
        return
    try:
        os.rename(made, final)
    except OSError:
        if not final.exists():
            raise
        shutil.rmtree(made, ignore_errors=True)


def discard(entry: Path) -> None:
    """Remove an entry at once: it loses its name before its files go. One that another sweep is at stays."""
    aside = entry.with_name(ASIDE)
    with claims.claim(aside, entry.name) as ours, suppress(FileNotFoundError):
        if ours:
            os.rename(entry, aside / f"{entry.name}.gone")
            shutil.rmtree(aside / f"{entry.name}.gone", ignore_errors=True)


def provenance(folder: Path) -> dict[str, Any]:
    """What is known of the last sweep into the folder; empty when nothing is."""
    try:
        return forms.check(forms.Provenance, forms.parse((folder / PROVENANCE).read_bytes()))
    except (FileNotFoundError, ValueError):
        return {}
