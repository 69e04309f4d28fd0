"""A YAML 1.2 file as plain data that still knows the line and column of everything in it."""

from __future__ import annotations

import difflib
import re
import stat
import sys
from collections.abc import Iterable
from copy import deepcopy
from itertools import islice
from pathlib import Path
from typing import Any

from ruamel.yaml.error import MarkedYAMLError, YAMLError

from runner import yamltext
from runner.errors import Fault, InputError
from runner.limits import DEEPEST, LARGEST_FILE, LONGEST_NAME, MOST_NAMES

Path_ = tuple[str | int, ...]

SPELLINGS = {"centre": "center"}  # keys that may be spelt both ways
INDEX = re.compile("[0-9]{1,9}")


class Document:
    """A file's content in `data` (dicts, lists, numbers, texts, None) and the place of each part of it.

    Raises InputError when it is not a YAML mapping, holds a duplicate key, a tag, or a number that is not finite.
    """

    def __init__(self, path: Path, folder: Path | None = None):
        self.path = path
        self.folder = folder or path.parent  # that file names in it are relative to
        self._places: dict[Path_, tuple[int, int]] = {}
        self._origins: dict[Path_, str] = {}
        self.size = 0  # how many parts it has
        self.tree = self._parse()
        self.data = self._plain(self.tree, ())
        if not isinstance(self.data, dict):
            raise InputError(Fault(f"{path}:1:1", "", "an experiment is a mapping of settings, `scene:` and the like"))

    def place(self, path: Path_) -> str:
        """file:line:column of what stands at `path`, or of the nearest thing around it."""
        for length in range(len(path), -1, -1):
            if path[:length] in self._origins:
                return self._origins[path[:length]]
            if path[:length] in self._places:
                line, column = self._places[path[:length]]
                return f"{self.path}:{line + 1}:{column + 1}"
        return f"{self.path}:1:1"

    def text(self) -> str:
        """The file, comments and all, with the overrides applied."""
        if not self._origins:
            return self._text
        try:
            return yamltext.write(self.tree)
        except ValueError:  # ruamel cannot write each number as it was spelt, -0e-7 for one
            return yamltext.write(self.data)

    def _parse(self) -> Any:
        try:
            self._text = _contents(self.path)
            return yamltext.read(self._text)
        except FileNotFoundError:
            raise InputError(f"{self.path}: no such file{_nearby(self.path)}") from None
        except UnicodeDecodeError:
            raise InputError(f"{self.path}: not a text file in UTF-8") from None
        except OSError as error:
            raise InputError(f"{self.path}: {error.strerror}") from None
        except MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            place = f"{self.path}:{mark.line + 1}:{mark.column + 1}" if mark else str(self.path)
            problem = (error.problem or str(error)).partition(" with value ")[0]  # of a duplicate key, which may be long
            raise InputError(Fault(place, "", " ".join(problem.split()))) from None
        except YAMLError as error:
            raise InputError(Fault(str(self.path), "", " ".join(str(error).split()))) from None

    def _plain(self, node: Any, path: Path_) -> Any:
        """`node` without YAML's own types; notes the place of each part on the way."""
        self.size += 1
        if len(path) > DEEPEST:  # by an override: the file's own depth is looked at as it is read
            raise InputError(Fault(self.place(path), "", "nested too deeply"))
        if isinstance(node, dict):
            out = {}
            for key, value in node.items():
                name = SPELLINGS.get(key, key) if isinstance(key, str) else key
                self._note(path + (name,), node, key)
                if not isinstance(key, str) or name in out:
                    reason = "given twice" if name in out else "a key must be a text"
                    raise InputError(Fault(self.place(path + (name,)), dotted(path + (name,)), reason))
                out[name] = self._plain(value, path + (name,))
            return out
        if isinstance(node, list):
            for index in range(len(node)):
                self._note(path + (index,), node, index)
            return [self._plain(value, path + (index,)) for index, value in enumerate(node)]
        if node is None or isinstance(node, bool):
            return node
        if isinstance(node, (int, float)):
            if not abs(node) <= sys.float_info.max:
                raise InputError(Fault(self.place(path), dotted(path), "must be a finite number"))
            return int(node) if isinstance(node, int) else float(node)
        if isinstance(node, str):
            return str(node)
        raise InputError(Fault(self.place(path), dotted(path), f"a {type(node).__name__} has no meaning here"))

    def _note(self, path: Path_, parent: Any, key: Any) -> None:
        try:
            # the key where it stands on the value's line or before: errors point at the name of a setting
            place = parent.lc.key(key) if isinstance(parent, dict) else parent.lc.item(key)
        except (KeyError, AttributeError, TypeError):
            place = None
        if place:  # what is merged in by `<<` may have none: that around it serves
            self._places[path] = place

    def override(self, path: Path_, value: Any, origin: str) -> None:
        """Put `value` at `path`, in the data and in the file's text; mistakes in it are told as at `origin`."""
        if len(path) > DEEPEST:
            raise InputError(Fault(origin, "", "nested too deeply"))
        node, plain = self.tree, self.data
        for depth, key in enumerate(path[:-1]):
            if isinstance(plain, dict) and plain.get(key) is None:
                plain[key], node[_spelt(node, key)] = {}, {}
                self._origins[path[: depth + 1]] = origin
            try:
                node, plain = _alone(node, _spelt(node, key)), plain[key]
            except (IndexError, TypeError):
                plain = None
            if not isinstance(plain, (dict, list)):
                raise InputError(Fault(origin, dotted(path[: depth + 1]), "is not a group of settings"))
        if isinstance(plain, list) and not (isinstance(path[-1], int) and path[-1] < len(plain)):
            raise InputError(Fault(origin, dotted(path), "there is no such item in the list"))
        self._origins[path] = origin
        plain[path[-1]] = self._plain(value, path)
        node[_spelt(node, path[-1])] = value


def _alone(node: Any, key: str | int) -> Any:
    """What stands at `key`, made a copy of its own, so that a change in it leaves aliases of it alone."""
    node[key] = copy = deepcopy(node[key])
    if hasattr(copy, "yaml_set_anchor"):
        copy.yaml_set_anchor(None)
    return copy


def _spelt(node: Any, key: str | int) -> str | int:
    """`key` as `node` spells it."""
    return next((other for other, name in SPELLINGS.items() if name == key and isinstance(node, dict) and other in node), key)


def split(name: str) -> Path_:
    """A dotted path as a tuple; numbers count the items of a list."""
    return tuple(int(part) if INDEX.fullmatch(part) else SPELLINGS.get(part, part) for part in name.split("."))


def dotted(path: Iterable[str | int]) -> str:
    return ".".join(str(part) for part in path)


def read_values(text: str, origin: str) -> list[Any]:
    """The YAML values in a piece of text with commas between, as in `-s balls.mass=1,1e1`. Raises InputError told at `origin`."""
    try:
        values = yamltext.read(f"[{text}]")
    except YAMLError:
        raise InputError(Fault(origin, "", "not a value in YAML")) from None
    if not values:
        raise InputError(Fault(origin, "", "has no value"))
    return list(values)


def suggestion(word: str, known: Iterable[str]) -> str:
    """` (did you mean 'x'?)` for the known word nearest to `word`, else nothing."""
    near = difflib.get_close_matches(str(word)[:LONGEST_NAME], [str(k)[:LONGEST_NAME] for k in islice(known, MOST_NAMES)], 1)
    return f" (did you mean '{near[0]}'?)" if near else ""


def _contents(path: Path) -> str:
    """The text of the file. Raises InputError when it is no file, or too large: a pipe or a device may never end."""
    state = path.stat()
    if not stat.S_ISREG(state.st_mode):
        raise InputError(f"{path}: is {'a directory' if stat.S_ISDIR(state.st_mode) else 'not a file'}")
    if state.st_size > LARGEST_FILE:
        raise InputError(f"{path}: larger than {LARGEST_FILE // 1000} kB, not an experiment")
    return path.read_text(encoding="utf-8") if state.st_size else ""  # the system's own files have no size, and may not end


def _nearby(path: Path) -> str:
    if not path.parent.is_dir():
        return ""
    return suggestion(path.name, [p.name for p in path.parent.glob("*.y*ml")])
