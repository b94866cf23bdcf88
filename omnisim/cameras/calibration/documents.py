"""Safe parsing of untrusted calibration files in YAML, JSON or XML.

Every error is one line that names the file. YAML numbers follow version 1.2 (1e-3 is a number).
The loader knows OpenCV's matrices and constructs no Python objects.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import yaml

from omnisim.core.errors import CalibrationError
from omnisim.core.files.sources import note_bytes

MAX_BYTES = 1 << 26
MAX_GROWTH = 100_000  # nodes that the aliases of a YAML text may add
_MATLAB = "MATLAB's data: export it with OCamCalib's Export Data, or as an opencv_pinhole file"
_BINARY = {b"MATLAB": _MATLAB, b"\x89HDF": _MATLAB}  # by the files' first bytes
_BINARY |= dict.fromkeys((b"glTF", b"PXR-USDC", b"ply"), "a scene: pass it as the scene")
_IMAGE = "an image: `omnisim calibration convert` writes the calibration of one by omnisim"
_BINARY |= dict.fromkeys((b"\x89PNG", b"\xff\xd8\xff"), _IMAGE)
_HEADER = re.compile(r"\A\s*%YAML[ :][^\n]*\n?")


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


def read_text(path: Path) -> str:
    """Read a text file.

    Raises:
        CalibrationError: the file cannot be read, is empty or too large, or is not text.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as reason:
        message = getattr(reason, "strerror", None) or str(reason)
        raise CalibrationError(f"{path}: cannot be read: {message}") from None
    note_bytes(path, data)
    if len(data) > MAX_BYTES:
        raise CalibrationError(f"{path}: expected a calibration file, got more than 64 MiB")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        got = "COLMAP's binary model: convert it with colmap model_converter --output_type TXT"
        if path.suffix != ".bin":
            kinds = (kind for start, kind in _BINARY.items() if data.startswith(start))
            got = next(kinds, "no text in UTF-8")
        raise CalibrationError(f"{path}: expected a calibration file, got {got}")
    if not text.strip():
        raise CalibrationError(f"{path}: expected a calibration file, got an empty one")
    return text


def parse_yaml(text: str, source: str) -> dict[str, Any]:
    """Mapping in a YAML text.

    Raises:
        CalibrationError: the text is not YAML, or not a mapping.
    """
    try:
        data = _load_yaml(_HEADER.sub("", text))
    except yaml.MarkedYAMLError as reason:
        mark = reason.problem_mark
        where = f" in line {mark.line + 1}" if mark else ""
        problem = reason.problem
        if "'\\t'" in str(problem):
            problem = "expected spaces, got a tab, with which YAML cannot indent"
        raise CalibrationError(f"{source}: not YAML{where}: {problem}") from None
    except yaml.YAMLError as reason:
        raise CalibrationError(f"{source}: not YAML: {_reason(reason)}") from None
    except (ValueError, TypeError, RecursionError, OverflowError) as reason:  # 2026-99-99, [[[[[…
        raise CalibrationError(f"{source}: not YAML: {_reason(reason)}") from None
    return _mapping(data, source, "YAML keys with values")


def parse_json(text: str, source: str) -> dict[str, Any]:
    """Object in a JSON text.

    Raises:
        CalibrationError: the text is not JSON, or not an object.
    """

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
    """Root element of an XML text.

    Raises:
        CalibrationError: the text is not XML, or declares entities, which could grow without bound.
    """
    if re.search(r"<!\s*(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise CalibrationError(f"{source}: expected XML without entities of its own, got a DOCTYPE")
    try:
        return ElementTree.fromstring(re.sub(r"\A\s*<\?xml[^>]*\?>", "", text))
    except (ElementTree.ParseError, ValueError, RecursionError) as reason:
        raise CalibrationError(f"{source}: not XML: {_reason(reason)}") from None


def _load_yaml(text: str) -> Any:
    """Value of a YAML text, unless its aliases (*name) expand it too far.

    Raises:
        yaml.YAMLError: the text is not YAML, or expands too far.
    """
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
        parts = (part for one in inner for part in (one if isinstance(one, tuple) else (one,)))
        sizes[id(node)] = 1 + sum(_size(part, sizes) for part in parts)
    return sizes[id(node)]


def _mapping(data: Any, source: str, expected: str) -> dict[str, Any]:
    if not isinstance(data, dict):
        raise CalibrationError(f"{source}: expected {expected}, got a {type(data).__name__}")
    return {str(key): value for key, value in data.items()}


def _reason(reason: Exception) -> str:
    """Parser's reason in one line, without Python's terms."""
    if isinstance(reason, RecursionError):
        return "expected plain values, got too deep a nesting"
    if "integer string conversion" in str(reason):
        return "expected a camera's numbers, got one of thousands of digits"
    return (str(reason).splitlines() or [type(reason).__name__])[0]
