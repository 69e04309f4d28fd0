"""Text in YAML 1.2 to ruamel's tree and back, with comments and places; what no experiment needs is refused on the way."""

from __future__ import annotations

import re
from io import StringIO
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent, ScalarEvent
from ruamel.yaml.nodes import MappingNode, ScalarNode

from runner.limits import DEEPEST, LONGEST_TEXT, MOST_VALUES


SURROGATE = re.compile(r"[\ud800-\udfff]")  # as "\ud800" in quotes gives it, which no file or terminal takes


def read(text: str) -> Any:
    """The tree of `text`. Raises YAMLError, also for tags, and for what is too long, too deep, too much or stands in itself."""
    try:
        return _yaml().load(text)
    except YAMLError:
        raise
    except Exception as error:  # ruamel's own slips, on text that is odd enough
        raise YAMLError(f"not YAML that can be read: {error}") from None


def write(tree: Any) -> str:
    out = StringIO()
    _yaml().dump(tree, out)
    return out.getvalue()


class _Sparing(Composer):
    """Makes nodes of what is read, counting them: an alias counts as all that it stands for, and is never written out."""

    _values = _depth = 0

    def compose_document(self) -> Any:
        self._sizes: dict[str, int | None] = {}  # of anchors; None while what stands there is being read
        return super().compose_document()

    def compose_node(self, parent: Any, index: Any) -> Any:
        event, before = self.parser.peek_event(), self._values
        if isinstance(parent, MappingNode) and index is None:  # a key; groups as keys of groups take twice the time a level
            of = self.anchors.get(event.anchor) if isinstance(event, AliasEvent) else event
            if not isinstance(of, (ScalarEvent, ScalarNode)):
                _refuse("a key must be a text", event)
        if isinstance(event, AliasEvent):
            size = self._sizes.get(event.anchor, 1)
            if size is None:
                _refuse("stands in itself", event)
            self._values += size
        else:
            if event.tag:
                _refuse(f"the tag {str(event.tag).replace('tag:yaml.org,2002:', '!!')} has no meaning here", event)
            if isinstance(event, ScalarEvent):
                if len(event.value) > LONGEST_TEXT:
                    _refuse(f"longer than {LONGEST_TEXT:,} characters", event)
                if SURROGATE.search(event.value):
                    _refuse("holds half a character", event)
            if self._depth > DEEPEST:
                _refuse("nested too deeply", event)
            self._values += 1
        if self._values > MOST_VALUES:
            _refuse(f"more than {MOST_VALUES:,} values with its aliases", event)
        anchor = None if isinstance(event, AliasEvent) else event.anchor
        if anchor:
            self._sizes[anchor] = None
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        if anchor:
            self._sizes[anchor] = self._values - before
        return node


def _refuse(reason: str, event: Any) -> None:
    raise MarkedYAMLError(problem=reason, problem_mark=event.start_mark)


def _yaml() -> YAML:
    yaml = YAML(typ="rt", pure=True)
    yaml.Composer = _Sparing
    yaml.allow_duplicate_keys = False
    yaml.width = 1000
    return yaml
