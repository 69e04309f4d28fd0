"""What an experiment file may hold, as pydantic models.

The shapes, fields and ways to release balls are dataclasses of `sim` that state their own types and ranges; their models are
made from them here, so that a new one is written in one place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from functools import lru_cache, partial
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationInfo,
    create_model,
    model_validator,
)
from pydantic_core import PydanticCustomError

from runner import meshfile, record
from sim.forces import FIELDS
from sim.model import Balls, Invalid, Positive, Size, Vector
from sim.release import Emitter, Listed, Scatter, Start
from sim.shapes import SHAPES
from sim.simulate import METHODS, Scene, Solver, check_records

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_-]*$", max_length=64)]


class Model(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Built(Model):
    """A model that stands for a dataclass of `sim`, and lets it check the values."""

    @model_validator(mode="after")
    def _checks_itself(self, info: ValidationInfo):
        attempt(partial(self.build, folder(info)))
        return self

    def build(self, folder: Path) -> Any:
        """The dataclass with these values; file names in it are relative to `folder`. `model_of` puts each model's own here."""


def attempt(build, group: str = "") -> Any:
    """What `build()` returns, an Invalid told pydantic's way with the field it names, which stands in `group`."""
    try:
        return build()
    except Invalid as error:
        raise PydanticCustomError("invalid", "{reason}", {"reason": error.reason, "field": group + error.field}) from None


def folder(info: ValidationInfo) -> Path:
    """The folder that file names in the experiment are relative to."""
    return (info.context or {}).get("folder", Path())


def model_of(cls: type, tag: dict[str, str] | None = None, **instead: Any) -> type[Built]:
    """The model of the dataclass `cls`, with a discriminating `tag` and other types for the fields named."""
    hints, options = get_type_hints(cls, include_extras=True), {}
    for field in fields(cls):
        default = field.default if field.default is not MISSING else ...
        if field.default_factory is not MISSING:
            default = Field(default_factory=field.default_factory)
        options[field.name] = (instead.get(field.name, hints[field.name]), default)

    make = lru_cache(4096)(cls)  # most runs of a sweep hold the same shapes and fields, and each builds them a few times

    def build(self, folder: Path):
        values = {name: getattr(self, name) for name in options}
        values |= {name: built(values[name], folder) for name in instead}  # no other holds models
        return cls(**values) if any(isinstance(value, dict) for value in values.values()) else make(**values)

    tags = {key: (Literal[value], ...) for key, value in (tag or {}).items()}
    model = create_model(cls.__name__, __base__=Built, __doc__=cls.__doc__, **tags, **options)
    model.build = build
    return model


def built(value: Any, folder: Path) -> Any:
    """`value` with the models in it built."""
    if isinstance(value, Built):
        return value.build(folder)
    if isinstance(value, Mapping):
        return {key: built(each, folder) for key, each in value.items()}
    if isinstance(value, list):
        return [built(each, folder) for each in value]
    return value


class MeshFile(Built):
    """Triangles from a file that trimesh reads, two-sided: scaled, rotated about x, y, z in turn, then moved."""

    shape: Literal["mesh"]
    file: str  # relative to the experiment's file
    scale: Positive = 1.0
    translate: Vector = (0.0, 0.0, 0.0)  # m
    rotate: Vector = (0.0, 0.0, 0.0)  # degrees
    sha256: str = ""  # of the file's content, filled in when it is read

    @model_validator(mode="after")
    def _identify(self, info: ValidationInfo):
        found = attempt(partial(meshfile.digest, folder(info) / self.file))
        if self.sha256 not in ("", found):
            attempt(partial(_changed, self.file))
        object.__setattr__(self, "sha256", found)
        return self

    def build(self, folder: Path):
        path = folder / self.file
        return meshfile.read(path, meshfile.digest(path), self.scale, self.translate, self.rotate)


def _changed(file: str) -> None:
    raise Invalid("file", f"{file} is not the file that it was when the run was planned")


Shape = Annotated[
    Union[*(model_of(shape, {"shape": name}) for name, shape in SHAPES.items()), MeshFile], Field(discriminator="shape")
]
Force = Annotated[Union[*(model_of(kind, {"type": name}) for name, kind in FIELDS.items())], Field(discriminator="type")]

# in the order of their names: another order would be the same run, and come out otherwise in the last digits
by_name = AfterValidator(lambda things: dict(sorted(things.items())))

SceneModel = model_of(
    Scene, surfaces=Annotated[dict[Name, Shape], by_name], forces=Annotated[dict[Name, Force], by_name]
)


class SolverModel(model_of(Solver, method=Literal[*METHODS], contact=Literal["swept", "original"])):
    #: that the balls of a run are divided among; no part of a run, whose result they cannot change
    threads: Annotated[int, Field(ge=1, le=256)] = Field(1, exclude=True)


class BallsModel(Model):
    """The balls of a run, all of one kind; exactly one of `emitter`, `released` and `scatter` says how they start."""

    mass: Positive = 1.0  # kg
    radius: Size = 0.06  # m
    lifetime: Positive = 15.0  # s
    emitter: model_of(Emitter) | None = None
    released: Annotated[list[model_of(Start)], Field(min_length=1)] | None = None
    scatter: model_of(Scatter) | None = None

    @model_validator(mode="after")
    def _one_source(self):
        given = [name for name in ("emitter", "released", "scatter") if getattr(self, name) is not None]
        if len(given) != 1:
            reason = f"needs exactly one of emitter, released, scatter; it has {' and '.join(given) or 'none'}"
            raise PydanticCustomError("invalid", "{reason}", {"reason": reason})
        return self

    def source(self, folder: Path) -> Emitter | Scatter | Listed:
        return built(self.emitter or self.scatter, folder) or Listed(built(self.released, folder))

    def build(self, duration: float, folder: Path) -> Balls:
        return Balls(self.mass, self.radius, self.lifetime, *self.source(folder).release(duration))


class RecordModel(Model):
    every: Positive = 0.01  # s between recorded frames
    formats: list[Literal[*record.names()]] = record.names()
    #: runs that share a folder once they are made, and a file of each format; no part of a run, whose result it cannot change
    pack: Annotated[int, Field(ge=2, le=10_000)] | None = Field(None, exclude=True)

    @model_validator(mode="after")
    def _once_each(self):
        if len(set(self.formats)) < len(self.formats):
            raise PydanticCustomError("invalid", "{reason}", {"reason": "names a format twice", "field": "formats"})
        return self


class Setup(Model):
    """Everything that one run is made of."""

    scene: SceneModel = SceneModel()
    balls: BallsModel
    solver: SolverModel
    duration: Positive = 5.0  # s of simulated time
    record: RecordModel = RecordModel()
    reference: Literal["exact"] | None = None  # also solve exactly, and report the errors in position
    repeats: Annotated[int, Field(ge=1, le=1000)] = 1

    @model_validator(mode="after")
    def _fits(self, info: ValidationInfo):
        self.fit(folder(info))
        return self

    def fit(self, folder: Path) -> None:
        """Raises PydanticCustomError for parts that are right, but do not go together."""
        if self.balls.mass > self.scene.wall_mass:
            reason = f"must be <= scene.wall_mass = {self.scene.wall_mass:g}"
            raise PydanticCustomError("invalid", "{reason}", {"reason": reason, "field": "balls.mass"})
        count = attempt(partial(self.balls.source(folder).number, self.duration), "balls.emitter.")
        attempt(partial(check_records, count, self.duration, self.record.every), "record.")
        attempt(partial(self.solver.build(folder).check_steps, self.duration), "solver.")


class Expectation(Model):
    """What must hold for a column of the summary, in the rows that match `where`."""

    column: str
    max: float | None = None
    min: float | None = None
    equals: float | bool | str | None = None
    where: dict[str, Any] = {}

    @model_validator(mode="after")
    def _says_something(self):
        if self.max is None and self.min is None and self.equals is None:
            raise PydanticCustomError("invalid", "{reason}", {"reason": "needs max, min or equals"})
        return self


class File(Setup):
    """An experiment file."""

    name: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=100)] | None = None
    matrix: dict[str, Any] = {}
    expect: list[Expectation] = []
    charts: list[dict[str, Any]] = []
