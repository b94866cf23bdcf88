"""Safe parsing of untrusted calibration files in YAML, JSON or XML.

Every fault is a `CalibrationError` of one line that names file, key, actual and expected value.
YAML numbers follow version 1.2 (1e-3 is a number). The loader knows OpenCV's matrices and
constructs no Python objects.
"""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar
from xml.etree import ElementTree

import numpy as np
import pydantic
import yaml
from pydantic import BeforeValidator, ConfigDict

from omnisim.core.arrays import Floats
from omnisim.core.errors import CalibrationError, OmnisimError, did_you_mean
from omnisim.core.files.parameters import Number, Table, parse_table
from omnisim.core.files.sources import note_bytes
from omnisim.core.poses import POSE_TOLERANCE, check_pose, nearest_rotation

MAX_BYTES = 1 << 26
MAX_ROUNDING = 2e-3  # of a rotation's squares: its numbers have three decimals or more
MAX_GROWTH = 100_000  # nodes that the aliases of a YAML text may add
_MATLAB = (
    "MATLAB's data without a structure of numbers: write it as JSON, with "
    "fprintf(fopen('camera.json', 'w'), '%s', jsonencode(params.Intrinsics)), or toStruct(params)"
)
_BINARY = {b"MATLAB": _MATLAB, b"\x89HDF": _MATLAB}  # by the files' first bytes
_BINARY |= dict.fromkeys((b"glTF", b"PXR-USDC", b"ply"), "a scene: pass it as the scene")
_IMAGE = "an image: `omnisim calibration convert` writes the calibration of one by omnisim"
_BINARY |= dict.fromkeys(
    (b"\x1f\x8b", b"PK\3\4"), "an archive: extract it, and pass the file or folder"
)
_BINARY |= dict.fromkeys((b"\x89PNG", b"\xff\xd8\xff"), _IMAGE)
_HEADER = re.compile(r"\A\s*%YAML[ :][^\n]*\n?")
# OpenCV's files (%YAML:1.0) may have no space after a key
_NO_SPACE = re.compile(r"^([ \t]*[A-Za-z_][\w.]*):(?=[-+.\w\[!])", re.M)


class _Loader(yaml.SafeLoader):
    """YAML loader for calibration files: knows OpenCV's matrices and rejects duplicate keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Mapping of a node; a duplicate key is an error."""
        seen = set()
        for key, _ in node.value:
            if key.value in seen and isinstance(key, yaml.ScalarNode):
                raise yaml.MarkedYAMLError(
                    problem=f"duplicate key {key.value!r}", problem_mark=key.start_mark
                )
            if isinstance(key, yaml.ScalarNode):
                seen.add(key.value)
        return super().construct_mapping(node, deep=deep)


def _opencv_matrix(loader: _Loader, node: yaml.Node) -> dict[Any, Any]:
    if not isinstance(node, yaml.MappingNode):
        raise yaml.MarkedYAMLError(problem="expected a matrix", problem_mark=node.start_mark)
    return loader.construct_mapping(node, deep=True)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+\Z"),
    list("-+0123456789."),
)
_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _opencv_matrix)


def _mat_as_json(data: bytes) -> bytes | None:
    """First structure of numbers in a MAT-file of version 5, as JSON; None: it has none."""
    from scipy.io import loadmat  # used by no other file

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: plain(inner) for key, inner in value.items()}
        return value.tolist() if isinstance(value, np.ndarray | np.generic) else value

    try:
        file: Any = io.BytesIO(data)
        variables = loadmat(file, simplify_cells=True)
        structures = (plain(value) for value in variables.values() if isinstance(value, dict))
        return json.dumps(next(structures)).encode()
    except Exception:  # of a damaged file, any
        return None


def read_text(path: Path) -> str:
    """Read a text file."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as reason:
        message = getattr(reason, "strerror", None) or str(reason)
        raise CalibrationError(f"{path}: cannot be read: {message}") from None
    note_bytes(path, data)
    if data.startswith(b"MATLAB 5.0"):
        data = _mat_as_json(data) or data
    if len(data) > MAX_BYTES:
        raise CalibrationError(f"{path}: expected a calibration file, got more than 64 MiB")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        got = "COLMAP's binary model: convert it with colmap model_converter --output_type TXT"
        if path.suffix.lower() in (".insv", ".insp"):
            got = "Insta360's recording: write the offset_v3 of its metadata as a text file"
        elif path.suffix != ".bin":
            kinds = (kind for start, kind in _BINARY.items() if data.startswith(start))
            got = next(kinds, "no text in UTF-8")
        raise CalibrationError(f"{path}: expected a calibration file, got {got}")
    if not text.strip():
        raise CalibrationError(f"{path}: expected a calibration file, got an empty one")
    return text


class Joined(dict[str, Any]):
    """Documents of several files or messages, by the names of their cameras."""


def read_beside(source: str, key: str, name: str) -> tuple[str, Path]:
    """Text and path of a file that another one names by a key."""
    path = Path(source).parent / name
    try:
        return read_text(path), path
    except CalibrationError as reason:
        raise CalibrationError(f"{source}: {key}: {reason}") from None


def parse_yaml(text: str, source: str) -> dict[str, Any]:
    """Mapping in a YAML text."""
    try:
        if text.lstrip().startswith("%YAML:"):
            text = _NO_SPACE.sub(r"\1: ", text)
        data = _load_yaml(_HEADER.sub("", text))
    except yaml.MarkedYAMLError as reason:
        mark = reason.problem_mark
        where = f" in line {mark.line + 1}" if mark else ""
        problem = reason.problem
        if "'\\t'" in str(problem):
            problem = "expected spaces, got a tab, which YAML does not allow as indentation"
        raise CalibrationError(f"{source}: not YAML{where}: {problem}") from None
    except yaml.YAMLError as reason:
        raise CalibrationError(f"{source}: not YAML: {_reason(reason)}") from None
    except (ValueError, TypeError, RecursionError, OverflowError) as reason:  # 2026-99-99, [[[[[…
        raise CalibrationError(f"{source}: not YAML: {_reason(reason)}") from None
    return _mapping(data, source, "YAML keys with values")


def parse_json(text: str, source: str) -> dict[str, Any]:
    """Object in a JSON text."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        fields: dict[str, Any] = {}
        for key, value in pairs:
            if key in fields:
                raise CalibrationError(f"{source}: not JSON: duplicate key {key!r}")
            fields[key] = value
        return fields

    try:
        data = json.loads(text, object_pairs_hook=unique)
    except json.JSONDecodeError as reason:
        raise CalibrationError(
            f"{source}: not JSON in line {reason.lineno}: {reason.msg}"
        ) from None
    except (ValueError, RecursionError) as reason:
        raise CalibrationError(f"{source}: not JSON: {_reason(reason)}") from None
    return _mapping(data, source, "a JSON object")


def parse_xml(text: str, source: str) -> ElementTree.Element:
    """Root element of an XML text without entities, which could grow without bound."""
    if re.search(r"<!\s*(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise CalibrationError(f"{source}: expected XML without entities of its own, got a DOCTYPE")
    try:
        return ElementTree.fromstring(re.sub(r"\A\s*<\?xml[^>]*\?>", "", text))
    except (ElementTree.ParseError, ValueError, RecursionError) as reason:
        raise CalibrationError(f"{source}: not XML: {_reason(reason)}") from None


def _load_yaml(text: str) -> Any:
    """Value of a YAML text, unless its aliases (*name) expand it too far."""
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        sizes: dict[int, float] = {}
        if node is None:
            return None
        if _size(node, sizes) - len(sizes) > MAX_GROWTH:
            raise yaml.YAMLError("expected plain values, got aliases that grow without bound")
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _size(node: yaml.Node, sizes: dict[int, float]) -> float:
    """Number of nodes in a subtree, aliases expanded; infinite if a node contains itself."""
    if id(node) not in sizes:
        sizes[id(node)] = math.inf
        inner = node.value if isinstance(node, yaml.CollectionNode) else ()
        parts = (part for item in inner for part in (item if isinstance(item, tuple) else (item,)))
        sizes[id(node)] = 1 + sum(_size(part, sizes) for part in parts)
    return sizes[id(node)]


def _mapping(data: Any, source: str, expected: str) -> dict[str, Any]:
    if not isinstance(data, dict):
        raise CalibrationError(f"{source}: expected {expected}, got a {type(data).__name__}")
    return {str(key): value for key, value in data.items()}


def _reason(reason: Exception) -> str:
    """Parser's reason in one line, without Python's terms."""
    if isinstance(reason, RecursionError):
        return "expected plain values, got values nested too deeply"
    if "integer string conversion" in str(reason):
        return "expected a camera's numbers, got one of thousands of digits"
    return (str(reason).splitlines() or [type(reason).__name__])[0]


# Fields of calibration files: numbers, sizes, and lists of a known length.


MAX_SIZE_PX = 32768
SIZE = f"a whole number from 1 to {MAX_SIZE_PX}"
TableT = TypeVar("TableT", bound=pydantic.BaseModel)


def unexpected(place: str, expected: str, got: object) -> CalibrationError:
    """Error about an unexpected value; `place` names file and key."""
    return CalibrationError(f"{place}: expected {expected}, got {short(got)}")


def check_choice(
    value: str, choices: Iterable[str], place: str, others: Mapping[str, str] | None = None
) -> None:
    """Reject a word that is not among the choices; `others` are remedies for words of formats."""
    choices = list(choices)
    if value in choices:
        return
    error = unexpected(place, f"one of {', '.join(choices)}", value)
    hint = (others or {}).get(value) or did_you_mean(value, choices)
    raise error if hint.startswith("expected") else CalibrationError(f"{error}: {hint}")


def _whole_size(value: Any) -> int:
    """Integer number of pixels; some formats write it with a decimal point, as 1280.0."""
    if type(value) in (int, float) and 1 <= value <= MAX_SIZE_PX and value == int(value):
        return int(value)
    raise ValueError(f"expected {SIZE}")


Size = Annotated[int, BeforeValidator(_whole_size)]
Numbers = list[Number]
Matrix = list[list[Number]]


class Unread(NamedTuple):
    """Key of a format that omnisim does not use although it changes an image or a pose."""

    effect: str  # meaning of the key, and what to do about it
    neutral: tuple[Any, ...] = ()  # values without effect, besides nothing and zeros
    # True if the camera would be wrong without it: an error instead of a notice
    is_fault: bool = False


ROLLING_SHUTTER = Unread("rolling shutter: [degradation.shutter] of a sensor file")


class ForeignTable(Table):
    """Table of another tool's file: its fields are read, and notices name other keys.

    A subclass states further keys of its format, in addition to its base's.

    Attributes:
        also_read, harmless: keys that are read without a field, and keys without effect.
        unread: keys that change an image or a pose, and are not read; given in words.
        inner: tables in this one by their keys, in lists or alone; "*": of all other keys.
    """

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
    also_read: ClassVar[frozenset[str]] = frozenset()
    unread: ClassVar[Mapping[str, Unread]] = {}
    harmless: ClassVar[frozenset[str]] = frozenset()
    inner: ClassVar[Mapping[str, type[ForeignTable]]] = {}

    def __init_subclass__(
        cls,
        also_read: str = "",
        unread: Mapping[str, Unread] | None = None,
        harmless: str = "",
        inner: Mapping[str, type[ForeignTable]] | None = None,
        **settings: Any,
    ) -> None:
        super().__init_subclass__(**settings)
        cls.also_read = cls.also_read.union(also_read.split())
        own = {key: meaning for keys, meaning in (unread or {}).items() for key in keys.split()}
        cls.unread = {**cls.unread, **own}
        cls.harmless = cls.harmless.union(harmless.split())
        cls.inner = {**cls.inner, **(inner or {})}

    @classmethod
    def reads(cls, key: str, value: Any) -> bool:
        """True for a key that is read."""
        return key in cls.model_fields or key in cls.also_read or key in cls.inner


class MatrixTable(ForeignTable, harmless="rows cols dt"):
    """Matrix under a key, as OpenCV and ROS write it; `data` is its rows."""

    data: Numbers


def unread_keys(
    data: Any, table: type[ForeignTable], path: str = ""
) -> Iterator[tuple[str, Any, Unread | None]]:
    """Paths and values of keys that are not read nor harmless, and their meanings if known."""
    if isinstance(data, list):
        for index, item in enumerate(data):
            yield from unread_keys(item, table, f"{path}.{index}")
    if not isinstance(data, Mapping):
        return
    for key, value in data.items():
        where = f"{path}.{key}" if path else str(key)
        meaning = table.unread.get(key)
        if table.reads(key, value):
            inner = table.inner.get(key, table.inner.get("*"))
            if inner is not None:
                yield from unread_keys(value, inner, where)
        elif key not in table.harmless and not (meaning and _is_neutral(value, meaning.neutral)):
            yield where, value, meaning


def _is_neutral(value: Any, neutral: tuple[Any, ...]) -> bool:
    """True for a neutral value, nothing or zeros."""
    if isinstance(value, Mapping):
        return all(_is_neutral(inner, neutral) for inner in value.values())
    if value in neutral:
        return True
    if isinstance(value, list):
        return all(_is_neutral(item, neutral) for item in value)
    if isinstance(value, str):
        return all(word.strip("0.") in ("", "false", "none") for word in value.lower().split())
    return not value


def parse(data: Any, model: type[TableT], source: str) -> TableT:
    """Validate `data` against `model`; `source` names file and place in messages."""
    if not isinstance(data, Mapping):
        raise unexpected(source, "keys with values", data)
    try:
        return parse_table(dict(data), model, CalibrationError, source)
    except CalibrationError as reason:  # values can be long
        lines = (line if len(line) < 400 else line[:400] + " …" for line in str(reason).split("\n"))
        raise CalibrationError("\n".join(lines)) from None
    except (RecursionError, OverflowError) as reason:
        raise unexpected(source, "plain values", type(reason).__name__) from None


def numbers_by_name(fields: Mapping[str, Any], names: str, place: str) -> dict[str, float]:
    """Finite numbers by their space-separated names; a name is required before a `|`, else 0."""
    required, _, optional = names.rpartition("|")
    given: dict[str, Any] = {name: fields.get(name) for name in required.split()}
    given |= {name: fields.get(name, 0.0) for name in optional.split()}
    for name, value in given.items():
        if value is None:
            raise CalibrationError(f"{place}: {name}: missing")
        if type(value) not in (int, float) or not math.isfinite(value):
            raise unexpected(f"{place}: {name}", "a number", value)
    return given


def parse_number(word: str, place: str) -> float:
    """Parse a finite number in a text file."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise unexpected(place, "a number", word)
    return value


def parse_size(word: str, place: str) -> int:
    """Parse a number of pixels in a text file."""
    try:
        return _whole_size(parse_number(word, place))
    except ValueError:
        raise unexpected(place, SIZE, word) from None


def counted(values: Sequence[float], names: str, source: str) -> list[float]:
    """Check that there is one value per space-separated name, and return the values."""
    expected = names.split()
    if len(values) != len(expected):
        numbers = f"{len(expected)} numbers: {', '.join(expected)}"
        raise unexpected(source, numbers, list(values))
    return [float(value) for value in values]


def pose(matrix: Sequence[Sequence[float]], source: str) -> Floats:
    """Pose (4, 4) from rows; a fourth row is added to three.

    A rotation of rounded numbers becomes the nearest rotation.
    """
    rows = [list(row) for row in matrix]
    if len(rows) == 3:
        rows.append([0.0, 0.0, 0.0, 1.0])
    try:
        if len(rows) != 4 or any(len(row) != 4 for row in rows):
            raise CalibrationError("expected 4 × 4 numbers")
        rotation = np.clip(np.array(rows)[:3, :3], -2.0, 2.0)
        gap = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if POSE_TOLERANCE < gap < MAX_ROUNDING:
            for row, nearest in zip(rows, nearest_rotation(rotation).tolist(), strict=False):
                row[:3] = nearest
        return check_pose(rows)
    except OmnisimError as reason:
        message = str(reason).removeprefix("pose: ")
        raise CalibrationError(f"{source}: {message}, got {short(rows)}") from None


def flat_pose(numbers: Sequence[float], source: str) -> Floats:
    """Pose (4, 4) from the numbers of three or four rows."""
    return pose([numbers[at : at + 4] for at in range(0, len(numbers), 4)], source)


def pose_of(rotation: Sequence[float], position_m: Sequence[float], source: str) -> Floats:
    """Pose (4, 4) from the nine numbers of a rotation's rows and a position."""
    r = counted(rotation, "r11 r12 r13 r21 r22 r23 r31 r32 r33", source)
    xyz = counted(position_m, "x y z", source)
    return pose([[*r[3 * row : 3 * row + 3], xyz[row]] for row in range(3)], source)


def rows(matrix: Floats) -> list[list[float]]:
    """Rows of a matrix as nested lists of floats, with −0 replaced by 0."""
    return (np.asarray(matrix) + 0.0).tolist()


def short(value: object) -> str:
    """Text of a value for a message, truncated if long."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
