"""Settings: frozen dataclasses; annotation and help are the only statement of each setting.

`Parameters` is their base. A field is stated once: its annotation has type, limits and usual range,
the string below it is its help, and its name has the unit:

    @dataclass(frozen=True)
    class Lamp(Parameters, name="lamp"):
        cone_rad: Annotated[Number, Field(ge=0.0, le=math.pi), Typical(0.3, 1.0)] = 0.5
        "Opening angle."
        near_m: NotNegative = 0.1
        "Nearest surface."
        far_m: Positive = 8.0
        "Farthest surface."

        def _check(self) -> None:  # rules that single annotations cannot express
            if not self.near_m < self.far_m:
                raise self._error("near_m", f"less than far_m = {self.far_m:g}")

    Lamp(near_m=-1)  # OpticsError: lamp.near_m: expected a number ≥ 0, got -1

Files have degrees: the key of `cone_rad` is `cone_deg`, of `turn_radps` `turn_degps`, with limits
and default converted. A field may have settings itself, a table in the table, or be a list of them.
All else is derived: `parse_table` reads settings, `to_table` writes them, `file_keys` lists their
keys for the reference, JSON Schema and the live page.

    parse_table({"cone_deg": 400}, Lamp, SensorFileError, "a.toml")  # a.toml: cone_deg: expected …

A `Table` is a table in a file without a class of its own, and is validated in the same way.
A subclass inherits the prefix of messages, and extends `_check` through `super()._check()`.
Numbers are stored as floats and lists as tuples.
"""  # fmt: skip

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import Enum
from typing import Annotated, Any, ClassVar, TypeVar, cast, get_args, get_origin, get_type_hints

import annotated_types
import numpy as np
import pydantic
from pydantic import Field
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, core_schema

from omnisim.core.errors import OmnisimError, OpticsError
from omnisim.core.files.table_faults import MIN_POSITIVE, fault_lines

_LIMITS = annotated_types.Ge, annotated_types.Gt, annotated_types.Le, annotated_types.Lt
MAX_NUMBER = 1e9  # products and quotients of a few such numbers fit in float32, as on the GPU

Number = Annotated[float, Field(strict=True)]  # rejects "11" and true; integers are accepted
IntOrFloat = pydantic.StrictInt | pydantic.StrictFloat  # keeps the type as written
NotNegative = Annotated[Number, Field(ge=0.0, le=MAX_NUMBER)]
Positive = Annotated[Number, Field(ge=MIN_POSITIVE, le=MAX_NUMBER)]
Signed = Annotated[Number, Field(ge=-MAX_NUMBER, le=MAX_NUMBER)]
Fraction = Annotated[Number, Field(ge=0.0, le=1.0)]
AboveZero = Annotated[Number, Field(gt=0.0)]
Level = Annotated[Number, Field(ge=0.0)]
Coordinate = Annotated[Number, Field(ge=-1000.0, le=1000.0)]
Length = Annotated[Number, Field(gt=0.0, le=1000.0)]
Flag = Annotated[bool, Field(strict=True)]
Name = Annotated[str, Field(min_length=1, strict=True)]
Point = tuple[Signed, Signed, Signed]
Seed = Annotated[int, Field(ge=0, le=2**32 - 1, strict=True)]  # one word of a NumPy seed
LongSeed = Annotated[int, Field(ge=0, lt=2**63, strict=True)]


NOT_IN_FILES = {"in_files": False}  # metadata of a field that is no setting, such as an array


@dataclasses.dataclass(frozen=True)
class Typical:
    """Usual range of a number, in the unit of its field: a slider's, and the reference's."""

    # low, high: ends of the range
    low: float
    high: float
    # of_low, of_high: kinds of devices at the ends; empty: not stated
    of_low: str = ""
    of_high: str = ""

    def __str__(self) -> str:
        ends = ((self.low, self.of_low), (self.high, self.of_high))
        words = (f"{end:,g}".replace(",", " ") + (kind and f" ({kind})") for end, kind in ends)
        return f"typically {' to '.join(words)}"


T = TypeVar("T")


class Table(pydantic.BaseModel):
    """A table in a file: accepts only its own keys, and is immutable once read."""

    synonyms: ClassVar[Mapping[str, str]] = {}  # names of keys in other programs
    fields_of: ClassVar[type | None] = None  # class from whose fields the keys were made

    model_config = pydantic.ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        str_strip_whitespace=True,
        defer_build=True,  # until a file is read; most kinds of tables are never needed
    )

    def build(self, kind: type[T], /, **others: Any) -> T:
        """Object of a dataclass whose fields are keys of this table, see `overriding`.

        The class's defaults stand for keys without a value; `others` are fields that the table
        lacks, or has in another form.
        """
        file_key = getattr(kind, "file_key", str)
        for field in dataclasses.fields(cast("Any", kind)):
            key = file_key(field.name)
            if field.name not in others and (value := getattr(self, key, None)) is not None:
                others[field.name] = value if key == field.name else mapped(math.radians, value)
        return kind(**others)


TableT = TypeVar("TableT", bound=Table)
Model = TypeVar("Model", bound="pydantic.BaseModel | Parameters")


class Parameters:
    """Base of frozen dataclasses that validate their fields against the annotations.

    A subclass may state in its class line the prefix of messages, `name`; the class of errors,
    `error`; and, if its keys are in radians in files as well, `in_radians`.

    Raises:
        OpticsError: one line per error, naming the key, the expected value and the actual one.
    """

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]
    _name: ClassVar[str] = ""
    _raises: ClassVar[type[OmnisimError]] = OpticsError
    _in_radians: ClassVar[bool] = False
    synonyms: ClassVar[Mapping[str, str]] = {}  # as those of a table

    def __init_subclass__(
        cls,
        name: str | None = None,
        error: type[OmnisimError] | None = None,
        in_radians: bool | None = None,
    ):
        cls._name = cls._name if name is None else name
        cls._raises = error or cls._raises
        cls._in_radians = cls._in_radians if in_radians is None else in_radians

    def __post_init__(self) -> None:
        given = {key.name: _plain(getattr(self, key.name)) for key in _settings(type(self))}
        checked = parse_table(
            given, _checks_of(type(self)), self._raises, at=self._name, in_python=True
        )
        for key in given:
            object.__setattr__(self, key, getattr(checked, key))
        self._check()

    def _check(self) -> None:
        """Reject values that do not fit each other."""

    def _error(self, key: str, expected: str) -> OmnisimError:
        value = getattr(self, key)
        got = f"{value:g}" if isinstance(value, float) else repr(value)
        name = f"{self._name}.{key}" if self._name else key
        return self._raises(f"{name}: expected {expected}, got {got}")

    @classmethod
    def file_key(cls, name: str) -> str:
        """Key of a field in files: angles are in degrees there."""
        words = name.split("_")
        for place, word in enumerate(words):
            if word in _IN_FILES and not cls._in_radians:
                return "_".join((*words[:place], _IN_FILES[word], *words[place + 1 :]))
        return name

    def to_table(self, *, full: bool = False) -> dict[str, Any]:
        """Table of a file, read back as equal parameters; defaults only if `full`, None never."""
        written: dict[str, Any] = {}
        for field in _settings(type(self)):
            value, key = getattr(self, field.name), self.file_key(field.name)
            if value is None or (not full and value == _default(field)):
                continue
            written[key] = _written(mapped(in_degrees, value) if key != field.name else value, full)
        return written

    @classmethod
    def file_table(cls) -> type[Table]:
        """Schema of the table that has these settings in a file, see `table_of`."""
        return table_of(cls)

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: pydantic.GetCoreSchemaHandler
    ) -> CoreSchema:
        # so that a field of another class or table may have settings, in a file as a table
        return core_schema.with_info_wrap_validator_function(
            cls._read,
            handler(table_of(cls)),
            serialization=core_schema.plain_serializer_function_ser_schema(cls.to_table),
        )

    @classmethod
    def _read(
        cls,
        value: Any,
        parse: pydantic.ValidatorFunctionWrapHandler,
        info: pydantic.ValidationInfo[Any],
    ) -> Any:
        if isinstance(value, cls):
            return value
        if info.context:  # in Python
            raise ValueError(f"expected {cls.__name__}, got {value!r}")
        table, given = parse(value), {}
        for field in _settings(cls):
            key = cls.file_key(field.name)
            if key in table.model_fields_set:  # a default needs no conversion
                read = getattr(table, key)
                given[field.name] = mapped(math.radians, read) if key != field.name else read
        try:
            return cls(**given)
        except OmnisimError as reason:
            lines = [line.removeprefix(f"{cls._name}.") for line in str(reason).splitlines()]
            text = "\n".join(lines)
            for name in given:
                text = text.replace(name, cls.file_key(name))
            raise ValueError(text) from None


# Words of a field's name for angles, and of its key in files.
_IN_FILES = {"rad": "deg", "radps": "degps", "radps2": "degps2", "radpm": "deg_per_m"}


def in_degrees(angle_rad: float) -> float:
    """Angle in degrees with the fewest digits that `math.radians` turns into the same angle."""
    exact_deg = math.degrees(angle_rad)
    shortened = (float(f"{exact_deg:.{digits}g}") for digits in range(1, 18))
    return next((degrees for degrees in shortened if math.radians(degrees) == angle_rad), exact_deg)


def mapped(convert: Callable[[float], float], value: Any) -> Any:
    """Number, or numbers in a tuple, converted; words and None stay as they are."""
    if isinstance(value, tuple):
        return tuple(mapped(convert, item) for item in value)
    return convert(value) if isinstance(value, int | float) else value


def _plain(value: Any) -> Any:
    """NumPy's arrays and numbers as tuples and numbers of Python, also within a list or tuple."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    return tuple(map(_plain, value)) if isinstance(value, list | tuple) else value


def _written(value: Any, full: bool) -> Any:
    if isinstance(value, Parameters):
        return value.to_table(full=full)
    if isinstance(value, tuple):
        return [_written(item, full) for item in value]
    return value.value if isinstance(value, Enum) else value


def _settings(kind: type) -> list[dataclasses.Field[Any]]:
    """Fields of a dataclass that are settings."""
    return [field for field in dataclasses.fields(kind) if field.metadata.get("in_files", True)]


def _default(field: dataclasses.Field[Any]) -> Any:
    """Default of a field; `dataclasses.MISSING`: it is required."""
    made = field.default_factory
    return field.default if made is dataclasses.MISSING else made()


_TABLES: dict[type, type[Table]] = {}  # schemas of tables in files
_CHECKS: dict[type, type[Table]] = {}  # schemas of fields in Python
_ADAPTERS: dict[type, pydantic.TypeAdapter[Any]] = {}  # readers of files' tables


def table_of(kind: type) -> type[Table]:
    """Schema of a file's table with the fields of a class, without its `_check`."""
    if kind not in _TABLES:
        _TABLES[kind] = _make_table(kind, getattr(kind, "file_key", str))
    return _TABLES[kind]


def _checks_of(kind: type[Parameters]) -> type[Table]:
    """Schema of the fields as they are in Python: angles in radians."""
    if kind not in _CHECKS:
        is_same = all(kind.file_key(setting.name) == setting.name for setting in _settings(kind))
        _CHECKS[kind] = table_of(kind) if is_same else _make_table(kind, str)
    return _CHECKS[kind]


def _make_table(kind: type, file_key: Callable[[str], str]) -> type[Table]:
    fields: dict[str, Any] = {
        key: (hint, default) for key, hint, default in _file_fields(kind, file_key)
    }
    made = pydantic.create_model(kind.__name__, __base__=Table, __doc__=kind.__doc__, **fields)
    # a field's name in Python hints at its key
    names = {setting.name: file_key(setting.name) for setting in _settings(kind)}
    made.fields_of, made.synonyms = kind, names | dict(getattr(kind, "synonyms", {}))
    return made


def _file_fields(kind: type, file_key: Callable[[str], str]) -> Iterator[tuple[str, Any, Any]]:
    """Key, annotation and default of each field of a dataclass."""
    hints = get_type_hints(kind, include_extras=True)
    for field in _settings(kind):
        key, hint, default = file_key(field.name), hints[field.name], _default(field)
        if key != field.name:
            hint, default = _in_degrees(hint), mapped(in_degrees, default)
        yield key, hint, ... if default is dataclasses.MISSING else default


def overriding(
    kind: type, *names: str, defaults: Mapping[str, Any] | None = None, order: Sequence[str] = ()
) -> Callable[[type[TableT]], type[TableT]]:
    """Decorator that adds the fields of a class to the keys of a table.

    Args:
        kind: dataclass. Keys that the table has itself are left out.
        names: keys of the fields to add; empty: all.
        defaults: defaults that differ from the class's; None: each key is optional, as a value that
            is given takes the place of that of a device.
        order: keys that come first, of the class or of the table; others follow as they are.
    """

    def add(base: type[TableT]) -> type[TableT]:
        fields: dict[str, Any] = {
            key: (hint | None, None) if defaults is None else (hint, defaults.get(key, default))
            for key, hint, default in _file_fields(kind, getattr(kind, "file_key", str))
            if key not in base.model_fields and (not names or key in names)
        }
        made: type[TableT] = pydantic.create_model(
            base.__name__, __base__=base, __doc__=base.__doc__, __module__=base.__module__, **fields
        )
        made.fields_of = kind
        if order:
            own = made.model_fields
            made.__pydantic_fields__ = {key: own[key] for key in dict.fromkeys((*order, *own))}
        return made

    return add


def _in_degrees(annotation: Any) -> Any:
    """Annotation of an angle in radians with its limits in degrees."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        rules = [
            rule
            for part in parts[1:]
            for rule in (part.metadata if isinstance(part, FieldInfo) else [part])
        ]
        return Annotated[_in_degrees(parts[0]), *map(_rule_in_degrees, rules)]
    if origin in (typing.Union, types.UnionType):
        return typing.Union[tuple(map(_in_degrees, parts))]  # noqa: UP007
    if origin is tuple:
        return tuple[tuple(map(_in_degrees, parts))]  # type: ignore[misc]
    return annotation


def _rule_in_degrees(rule: Any) -> Any:
    if isinstance(rule, Typical):
        low, high = in_degrees(rule.low), in_degrees(rule.high)
        return dataclasses.replace(rule, low=low, high=high)
    if isinstance(rule, _LIMITS):
        (limit,) = dataclasses.astuple(rule)
        if MIN_POSITIVE < abs(limit) < MAX_NUMBER:  # these two stand for 0 and for no limit
            return type(rule)(in_degrees(limit))
    return rule


def described(expected: str) -> pydantic.WrapValidator:
    """Validator of a union, such as `Literal["auto"] | Number`, with one message for all errors."""

    def check(value: Any, parse: pydantic.ValidatorFunctionWrapHandler) -> Any:
        try:
            return parse(value)
        except pydantic.ValidationError:
            raise ValueError(f"expected {expected}") from None

    return pydantic.WrapValidator(check)


def parse_table(
    data: Mapping[str, Any],
    model: type[Model],
    error: type[OmnisimError],
    source: str = "",
    at: str = "",
    in_python: bool = False,
) -> Model:
    """Validate `data` against `model`.

    Args:
        data: keys and values.
        model: schema, or a class of `Parameters`.
        error: exception class to raise for invalid data.
        source: file name, for messages.
        at: key of the table in its file; empty: the file itself.
        in_python: fields with settings have to be of their classes, not tables.

    Raises:
        error: one line per error in the data.
    """
    schema: Any = table_of(model) if issubclass(model, Parameters) else model
    try:
        if issubclass(model, Parameters):
            if model not in _ADAPTERS:
                _ADAPTERS[model] = pydantic.TypeAdapter(model)
            return _ADAPTERS[model].validate_python(data)
        return model.model_validate(data, context=in_python)
    except pydantic.ValidationError as reason:
        faults = reason.errors()

    def is_list_at_fault(outer: tuple[int | str, ...]) -> bool:
        inner = (fault["loc"] for fault in faults if len(fault["loc"]) > len(outer))
        return any(key[: len(outer)] == outer for key in inner)

    raise error(
        "\n".join(
            (f"{source}: " if source else "") + line
            for fault in faults
            for line in fault_lines(fault, schema, at)
            # invalid items of a list are not counted as items
            if not (fault["type"] == "too_short" and is_list_at_fault(fault["loc"]))
        )
    )
