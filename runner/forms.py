"""What an output's own JSON files hold, checked as they are read: somebody may have changed one, and sealed it anew."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, create_model
from pydantic_core import from_json

from runner.columns import FIGURES, TEXTS, WHOLE
from runner.errors import one_line

Status = Literal["finished", "rested", "diverged", "timeout", "crashed", "failed"]
STATUSES = set(get_args(Status))

#: Of a file or a run: it never leads out of its folder.
Name = Annotated[str, Field(pattern=r"^[^/\x00-\x1f]+$", max_length=255)]
Count = Annotated[int, Field(ge=-(2**63), lt=2**63)]  # as the summary can hold it
Number = FiniteFloat | None


class Form(BaseModel):
    """Other versions tell more."""

    model_config = ConfigDict(extra="allow", strict=True)


class Anything(Form):
    """Figures that are no columns, too, are no more than numbers and texts."""

    __pydantic_extra__: dict[str, str | Count | FiniteFloat | None]


_columns = {name: str | None if name in TEXTS else Count | None if name in WHOLE else Number for name in FIGURES}
Figures = create_model("Figures", __base__=Anything, **{name: (kind, None) for name, kind in _columns.items()})


class Timings(Form):
    started: str | None = None
    wall_seconds: Number = None


class Run(Form):
    """run.json, and a line of a pack's runs.jsonl."""

    run_id: Name
    status: Status
    error: str | None
    parameters: dict[str, Any]
    figures: Figures
    timings: Timings = Timings()
    files: dict[Name, dict[str, Any]] = {}


class Pack(Form):
    """pack.json"""

    runs: dict[Name, list[Name]]
    files: dict[Name, dict[str, Any]]


class Provenance(Form):
    """provenance.json"""

    versions: dict[str, Any] = {}
    machine: dict[str, Any] = {}
    command: list[str] = []
    source: str = ""


def parse(text: bytes) -> Any:
    """What the JSON tells. Raises ValueError, also for NaN, half a character and what is nested 200 times."""
    return from_json(text, allow_inf_nan=False)


def check(form: type[Form], data: Any) -> Any:
    """`data`, if it is of that form. Raises ValueError, in a few words, if not."""
    try:
        form.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"][:2]))
        raise ValueError(one_line(f"tells nothing {'' if first['type'] == 'missing' else 'sensible '}of {place or 'itself'}")) from None
    return data
