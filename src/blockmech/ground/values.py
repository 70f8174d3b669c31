"""Numbers and places as users write them, validated once at the border."""

from __future__ import annotations

import cmath
import math
import sys
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from itertools import filterfalse
from numbers import Integral, Real
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Generic,
    Literal,
    NamedTuple,
    NoReturn,
    Optional,
    Self,
    TypeAlias,
    TypeVar,
)

from pydantic import (
    AfterValidator,
    AllowInfNan,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Strict,
    ValidationError,
    model_validator,
)
from pydantic.functional_validators import ModelWrapValidatorHandler
from pydantic_core import PydanticCustomError, core_schema

from blockmech.ground.errors import GraphError, Problem, listed, shown, unknown_key
from blockmech.ground.plane import apply
from blockmech.ground.signatures import Signed
from blockmech.ground.texts import in_metres, read_texts
from blockmech.ground.units import NoQuantity
from blockmech.ground.validation_errors import mistake, problems_of
from blockmech.typing import Array, Data, Quantity, Record


def no_boolean(low: int, high: int) -> BeforeValidator:
    """Refuse true and false for one of two numbers."""

    def checked(raw: Any) -> Any:
        if isinstance(raw, bool):  # in Python True equals 1, in a file it is a slip
            raise mistake("wrong-value", f"must be {low} or {high}, got {shown(raw)}")
        return raw

    return BeforeValidator(checked)


Finite = Annotated[float, Strict(), AllowInfNan(False)]
"""A finite number; booleans are refused."""

if TYPE_CHECKING:
    Read = TypeVar("Read", covariant=True)
    Said = TypeVar("Said", contravariant=True)
    Kind = TypeVar("Kind")

    class Given(Generic[Read, Said]):
        """What type checkers see of a field that may be given in several spellings."""

        def __get__(self, instance: object, owner: type | None = None) -> Read: ...
        def __set__(self, instance: object, value: Said) -> None: ...

    class Maybe(Generic[Kind]):
        """A number that may be left out."""

        def __get__(self, instance: object, owner: type | None = None) -> float | None: ...
        def __set__(self, instance: object, value: Quantity | None) -> None: ...

    Number = Given[float, Quantity]
else:
    Number, Maybe = Finite, Optional


def in_unit(unit: str) -> Any:
    """What a field's annotation says of its unit: for messages, the schema and addresses."""
    return Field(json_schema_extra={"unit": unit})


Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Length = Annotated[Number, Field(gt=0, json_schema_extra={"unit": "m"})]
Distance = Annotated[Number, Field(json_schema_extra={"unit": "m"})]
Angle = Annotated[Number, Field(json_schema_extra={"unit": "rad"})]
Direction = Annotated[Finite, Field(json_schema_extra={"unit": "rad"})]
"""One of several angles."""
Clearance = Annotated[NotNegative, Field(json_schema_extra={"unit": "m"})]
Play = Annotated[Finite, Field(ge=0), Field(json_schema_extra={"unit": "m"})]
"""One of several clearances."""
Mass = Annotated[NotNegative, Field(json_schema_extra={"unit": "kg"})]
Inertia = Annotated[NotNegative, Field(json_schema_extra={"unit": "kg m2"})]
Branch = Annotated[Literal[-1, 1], Field(description="assembly mode"), no_boolean(-1, 1)]
Sign = Annotated[
    Literal[-1, 1], Field(description="which way the driver counts"), no_boolean(-1, 1)
]


MILLI = {1e3: "1000 times as large", 1e-3: "1000 times smaller"}
"""What puts a length in mm, or in m among mm, right."""


def is_number(x: object) -> bool:
    """Whether ``x`` is a finite real number and not a boolean."""
    size: Any = x
    if not isinstance(x, int | float | Real) or isinstance(x, bool):
        return False
    return bool(abs(size) <= sys.float_info.max)  # whole numbers may be too large for a float


def is_count(x: object) -> bool:
    """Whether ``x`` is a whole number, at least 1, and not a boolean."""
    return isinstance(x, Integral) and not isinstance(x, bool) and int(x) >= 1


class Axis(NamedTuple):
    """Units of a coordinate and of the effort along it: of a turn, unless it is a way.

    ``known`` are the axes of drivers by name, and of a document's joints as ``"joint.name"``.
    """

    coordinate: str = "rad"
    effort: str = "N m"
    known: Mapping[str, Axis] = {}

    @classmethod
    def of(cls, kind: str) -> Axis:
        """That of a pair, "R" or "P"."""
        return cls("m", "N") if kind == "P" else cls()

    @property
    def coordinates(self) -> Mapping[str, str]:
        """Units of the coordinates that are known, by name."""
        return {name: axis.coordinate for name, axis in self.known.items()}

    def argument(self, of: str, power: str = "") -> str:
        """Unit of an argument of a law: "coordinate", "rate" or "time"; or of a power of it."""
        above, _, below = {"rate": f"{self.coordinate}/s", "time": "s"}.get(
            of, self.coordinate
        ).partition("/")
        return above + power + (f"/{below}{power}" if below else "")

    def coefficient(self, of: str, power: int = 1) -> str:
        """Unit of the effort over a power of an argument: "N m s2/rad2" over a rate squared."""
        below, _, above = self.argument(of, str(power) if power > 1 else "").partition("/")
        return f"{self.effort} {above}".rstrip() + f"/{below}" if power else self.effort


Units: TypeAlias = Record
"""Field -> unit of its numbers, or one for each place or name in it."""
POSE = ("m", "m", "rad")


class Pair:
    """Two numbers [x, y] with the author's spelling kept; the base of `Place` and `Vector`.

    ``z`` is the value as a complex number, ``written`` what the file says.
    """

    __slots__ = ("written", "z")
    phrase = "a vector"
    polar = False
    unit: ClassVar[str] = ""  # of its components, where the field says none

    def __init__(self, z: complex, written: Any = None) -> None:
        self.z = z
        self.written = [z.real, z.imag] if written is None else written

    @classmethod
    def parse(cls, raw: Any) -> Pair:
        """Read ``[x, y]``, a complex number or ``{"polar": [r, angle]}``."""
        if isinstance(raw, cls):
            return raw
        with suppress(NoQuantity):
            raw = in_metres(raw) if cls.unit else raw
        if isinstance(raw, complex) and cmath.isfinite(raw):
            return cls(raw)
        if isinstance(raw, list | tuple) and len(raw) == 2 and all(map(is_number, raw)):
            return cls(complex(*raw), [float(x) for x in raw])
        if cls.polar and isinstance(raw, dict) and set(raw) == {"polar"}:
            r = raw["polar"]
            if isinstance(r, list | tuple) and len(r) == 2 and all(map(is_number, r)):
                z = complex(r[0] * math.cos(r[1]), r[0] * math.sin(r[1]))
                return cls(z, {"polar": [float(x) for x in r]})
        spelling = ' or {"polar": [r, angle]}' if cls.polar else ""
        raise PydanticCustomError(
            "bad-place",
            "must be {what} [x, y]{spelling} of finite numbers, got {got}",
            {"what": cls.phrase, "spelling": spelling, "got": shown(raw)},
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Pair) and self.z == other.z

    def __hash__(self) -> int:
        return hash(self.z)

    def __repr__(self) -> str:
        return f"{self.z.real:g}{self.z.imag:+g}j"

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(
            cls.parse,
            serialization=core_schema.plain_serializer_function_ser_schema(lambda p: p.written),
        )

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> Data:
        two = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
        if not cls.polar:
            return two
        polar = {
            "type": "object",
            "properties": {"polar": two},
            "required": ["polar"],
            "additionalProperties": False,
        }
        return {"anyOf": [two, polar]}


class Place(Pair):
    """A place on a link [m], in the link's frame."""

    __slots__ = ()
    phrase = "a place in m,"
    polar = True
    unit = "m"


class Vector(Pair):
    """A vector in the plane, e.g. a force [N]."""

    __slots__ = ()
    phrase = "a vector"


def check_direction(key: str, *vectors: Vector | None) -> None:
    """Raise pydantic's error where a direction of a key has no length."""
    if any(vector is not None and vector.z == 0 for vector in vectors):
        raise mistake("bad-direction", f'"{key}" must not be [0, 0]')


def _with_length(direction: Vector | None) -> Vector | None:
    check_direction("direction", direction)
    return direction


DIRECTED = AfterValidator(_with_length)  # of a field of the name


def xy(z: complex) -> list[float]:
    """Two numbers as they stand in a file, without -0."""
    return [z.real + 0.0, z.imag + 0.0]


class FrozenDict(dict[Any, Any]):
    """A mapping inside a model, which does not change either."""

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        message, remedy = "it does not change once it is made", "make a new one"
        raise GraphError(Problem("frozen", "mapping of a model", message, "", remedy))

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[object, ...]:
        return FrozenDict, (dict(self),)


class StrictModel(Signed):
    """Base class of all models: immutable, with known keys and finite numbers only.

    A model that is built in Python raises `GraphError`, with one problem per mistake.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        arbitrary_types_allowed=True,
        defer_build=True,  # importing the package builds no validators
    )

    kind_key: ClassVar[str] = ""  # the key by which a file tells this kind from others
    plain_kind: ClassVar[str] = ""  # the kind of data without that key
    remade: ClassVar[str] = ""  # what to do instead of setting a field, if not copying the model
    spoken: ClassVar[bool] = False  # whether any model was made with numbers as texts
    refers: ClassVar[tuple[str, ...]] = ()  # fields that name, or are keyed by, drivers or markers

    if not TYPE_CHECKING:  # type checkers read the fields instead

        def __init__(self, /, *nameless: object, **values: object) -> None:
            if nameless:
                name, fields = type(self).__name__, type(self).model_fields
                needed = ", ".join(f"{n}=..." for n, field in fields.items() if field.is_required())
                message, valid = "its numbers have names", f"names: {listed(fields)}"
                remedy = f"write {name}({needed})" if needed else "say which is meant"
                raise GraphError(Problem("wrong-type", name, message, valid, remedy))
            raw = _without_numpy(values)
            try:
                super().__init__(**raw)
            except ValidationError as error:
                raise GraphError(problems_of(error, type(self), raw)) from None

        __init__.__pydantic_base_init__ = True  # what is inside a model is validated without it

        def __setattr__(self, name: str, value: object) -> None:
            try:
                super().__setattr__(name, value)
            except ValidationError:
                where, message = f"{type(self).__name__}.{name}", "a model does not change"
                remedy = f'put in its place its .model_copy(update={{"{name}": {shown(value)}}})'
                raise GraphError(
                    Problem("frozen", where, message, "", self.remade or remedy)
                ) from None

    @model_validator(mode="wrap")
    @classmethod
    def _read_quantities(cls, raw: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        try:
            return handler(raw)
        except ValidationError:  # numbers are not read twice: few are written as texts
            if type(raw) is not dict:
                raise
            numbers, texts = read_texts(cls, raw, cls.units is not StrictModel.units)
            if not texts:
                raise
        model = handler(numbers)
        StrictModel.spoken = True
        vars(model)["texts"] = texts
        return model

    def model_post_init(self, context: object) -> None:
        """Close the mappings."""
        for name, x in vars(self).items():
            if type(x) is dict:
                vars(self)[name] = FrozenDict(x)

    def model_copy(self, *, update: Record | None = None, deep: bool = False) -> Self:
        """A copy with some fields replaced, unchecked; see pydantic.

        Raises `GraphError` for fields that there are not.
        """
        fields = type(self).model_fields
        for name in filterfalse(fields.__contains__, update or ()):
            raise GraphError(unknown_key(type(self).__name__, type(self).__name__, name, fields))
        copied = super().model_copy(update=update, deep=deep)
        copied.model_post_init(None)
        copied.keep_texts(self, update or ())
        return copied

    def keep_texts(self, source: StrictModel, replaced: Collection[str]) -> None:
        """Remember which numbers of another model were texts, but for replaced fields."""
        keys = {type(self).model_fields[name].alias or name for name in replaced}
        texts = vars(source).get("texts", {}).items()
        texts = {path: text for path, text in texts if path[0] not in keys}
        if texts:
            vars(self)["texts"] = texts | vars(self).get("texts", {})

    def axis(self, outside: Axis) -> Axis:
        """Units along the coordinate of this model and of the models inside it."""
        return outside

    def units(self, axis: Axis) -> Units:
        """Units of the fields whose unit depends on the owner; other fields declare their unit."""
        return {}

    def __getstate__(self) -> dict[Any, Any]:
        """What was given; what was found from it, kernels perhaps, is found again."""
        stored = {name: x for name, x in vars(self).items() if name in type(self).model_fields}
        return super().__getstate__() | {"__dict__": stored}

    def __copy__(self) -> Self:
        copied = super().__copy__()
        for name in vars(copied).keys() - type(self).model_fields.keys():
            del vars(copied)[name]
        return copied


def _without_numpy(raw: Any, name: str = "") -> Any:
    """Numbers and arrays of NumPy as Python's, pairs for markers as tuples; all else as it is."""
    if hasattr(raw, "tolist"):
        items = raw.tolist()
        return tuple(items) if isinstance(items, list) else items
    if isinstance(raw, dict):
        fields = {key: _without_numpy(item, key) for key, item in raw.items()}
        return {k: _pair(item) for k, item in fields.items()} if name == "markers" else fields
    return type(raw)(map(_without_numpy, raw)) if type(raw) in (list, tuple) else raw


def _pair(raw: Any) -> Any:
    return tuple(raw) if isinstance(raw, list) else raw


if TYPE_CHECKING:
    Two: TypeAlias = tuple[Quantity, Quantity] | list[float] | Array | complex
    AnyMarker: TypeAlias = "Marker | tuple[Quantity, Quantity] | list[float] | complex"
    AnyPlace: TypeAlias = Place | Two | dict[str, tuple[Quantity, Quantity]]
    PlaceGiven = Given[Place, AnyPlace]
    VectorGiven = Given[Vector, Vector | Two]
    VectorOrNoneGiven = Given[Vector | None, Vector | Two | None]
    NumbersGiven = Given[list[float], Sequence[Quantity] | Array]
    Lengths = Given[tuple[float, float], tuple[Quantity, Quantity]]
    Pose = Given[tuple[float, float, float] | None, Sequence[Quantity] | None]
    MarkersGiven = Given[dict[str, "Marker"], Mapping[str, AnyMarker]]
else:
    PlaceGiven, VectorGiven, VectorOrNoneGiven = Place, Vector, Vector | None
    NumbersGiven, MarkersGiven = list[Finite], dict[str, "Marker"]
    Lengths, Pose = tuple[Length, Length], tuple[Finite, Finite, Finite] | None


def default(value: Any) -> Any:
    """The default of such a field."""
    return value


class Marker(StrictModel):
    """A named place and direction on a link.

    ``at`` is in the link's frame; a guide adds ``angle`` [rad] or, exact for
    vertical guides, ``dir`` [dx, dy]. The default direction is the link's x axis.

    >>> complex(bm.Marker(at=(0.4, 0.0), angle="90deg").direction).imag
    1.0
    """

    at: PlaceGiven
    angle: Maybe[Angle] = default(None)
    dir: VectorOrNoneGiven = default(None)

    @model_validator(mode="before")
    @classmethod
    def _from_place(cls, raw: Any) -> Any:
        # A bare (x, y), complex number or {"polar": ...} is a marker without direction.
        if isinstance(raw, list):  # only a file has these here
            is_point = len(raw) == 2 and all(map(is_number, raw))
            remedy = f'write {{"at": {shown(raw)}}}' if is_point else ""
            raise mistake("wrong-type", f"must be an object {{...}}, got {shown(raw)}", "", remedy)
        polar = isinstance(raw, Mapping) and "polar" in raw
        return {"at": raw} if polar or isinstance(raw, tuple | complex) else raw

    @model_validator(mode="after")
    def _check_direction(self) -> Marker:
        if self.angle is not None and self.dir is not None:
            raise mistake(
                "bad-direction", "the direction is given twice", "", 'keep "angle" or "dir"'
            )
        check_direction("dir", self.dir)
        return self

    @property
    def direction(self) -> complex:
        """Unit direction in the link's frame [-]."""
        if self.dir is not None:
            z = self.dir.z
            r = abs(z)
            unit: complex = apply("planar", z.real / r, z.imag / r)
            return unit
        unit_vector: complex = 1 + 0j if self.angle is None else apply("expi", self.angle)
        return unit_vector


class Link(StrictModel):
    """Mass properties of a link, and its markers.

    mass [kg], inertia [kg m2] about the centre of mass, cm [m] in the link's frame.

    >>> bm.Link(mass=2.0, inertia="0.1 kg m2", cm=(0.5, 0.0)).mass
    2.0
    """

    mass: Mass = default(0.0)
    inertia: Inertia = default(0.0)
    cm: PlaceGiven = default(Place(0j))
    markers: MarkersGiven = default({})

    @property
    def massive(self) -> bool:
        """Whether the link has mass or inertia."""
        return self.mass > 0 or self.inertia > 0
