"""Texts of calibration files: read, and taken apart as YAML, JSON or XML, without surprises.

Whatever is wrong with a file is one line that names it. YAML is that of its version 1.2 where
numbers are concerned (1e-3 is one), knows OpenCV's matrices, and makes no objects.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import yaml

from omnisim.errors import CalibrationError

LARGEST_BYTES = 1 << 26
LARGEST_GROWTH = 100_000  # nodes that a YAML text's aliases may add
_HEADER = re.compile(r"\A\s*%YAML[ :][^\n]*\n?")


class _Loader(yaml.SafeLoader):
    """YAML as calibration files use it: OpenCV's matrices, and keys that come once."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """The mapping, unless a key is there twice."""
        seen = set()
        for key, _ in node.value:
            if key.value in seen and isinstance(key, yaml.ScalarNode):
                raise yaml.MarkedYAMLError(
                    problem=f"key {key.value!r} is there twice", problem_mark=key.start_mark
                )
            if isinstance(key, yaml.ScalarNode):
                seen.add(key.value)
        return super().construct_mapping(node, deep=deep)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+\Z"),
    list("-+0123456789."),
)
_Loader.add_constructor(
    "tag:yaml.org,2002:opencv-matrix",
    lambda loader, node: loader.construct_mapping(node, deep=True),
)


def read_text(path: Path) -> str:
    """The text of a file.

    Raises:
        CalibrationError: it cannot be read, is empty, too large, or no text.
    """
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES + 1)
    except (OSError, ValueError) as reason:
        words = getattr(reason, "strerror", None) or str(reason)
        raise CalibrationError(f"{path}: cannot be read: {words}") from None
    if len(data) > LARGEST_BYTES:
        raise CalibrationError(f"{path}: larger than 64 MiB: want a calibration file")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise CalibrationError(f"{path}: not a text file in UTF-8: want a calibration file")
    if not text.strip():
        raise CalibrationError(f"{path}: is an empty file: want a calibration file")
    return text


def parse_yaml(text: str, source: str) -> dict[str, Any]:
    """The mapping that a YAML text is.

    Raises:
        CalibrationError: it is none.
    """
    try:
        data = _load_yaml(_HEADER.sub("", text))
    except yaml.MarkedYAMLError as reason:
        mark = reason.problem_mark
        where = f" in line {mark.line + 1}" if mark else ""
        raise CalibrationError(f"{source}: not YAML{where}: {reason.problem}") from None
    except yaml.YAMLError as reason:
        raise CalibrationError(f"{source}: not YAML: {_words(reason)}") from None
    except (ValueError, TypeError, RecursionError, OverflowError) as reason:  # 2026-99-99, [[[[[…
        raise CalibrationError(f"{source}: not YAML: {_words(reason)}") from None
    return _mapping(data, source, "YAML keys with values")


def parse_json(text: str, source: str) -> dict[str, Any]:
    """The object that a JSON text is.

    Raises:
        CalibrationError: it is none.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key, value in pairs:
            if key in found:
                raise CalibrationError(f"{source}: not JSON: key {key!r} is there twice")
            found[key] = value
        return found

    try:
        data = json.loads(text, object_pairs_hook=once)
    except json.JSONDecodeError as reason:
        raise CalibrationError(
            f"{source}: not JSON in line {reason.lineno}: {reason.msg}"
        ) from None
    except (ValueError, RecursionError) as reason:
        raise CalibrationError(f"{source}: not JSON: {_words(reason)}") from None
    return _mapping(data, source, "a JSON object")


def parse_xml(text: str, source: str) -> ElementTree.Element:
    """The root of an XML text.

    Raises:
        CalibrationError: it is none, or declares entities, which could grow without bound.
    """
    if re.search(r"<!\s*(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise CalibrationError(f"{source}: has a DOCTYPE: want XML without entities of its own")
    try:
        return ElementTree.fromstring(re.sub(r"\A\s*<\?xml[^>]*\?>", "", text))
    except (ElementTree.ParseError, ValueError, RecursionError) as reason:
        raise CalibrationError(f"{source}: not XML: {_words(reason)}") from None


def _load_yaml(text: str) -> Any:
    """What a YAML text is, unless its aliases (*name) make it much larger than it is.

    Raises:
        yaml.YAMLError: the text is none, or grows.
    """
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        sizes: dict[int, float] = {}
        if node is None:
            return None
        if _size(node, sizes) - len(sizes) > LARGEST_GROWTH:
            raise yaml.YAMLError("its aliases make it grow without bound: want plain values")
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _size(node: yaml.Node, sizes: dict[int, float]) -> float:
    """Number of nodes in a node, aliases as often as they are there; infinite in itself."""
    if id(node) not in sizes:
        sizes[id(node)] = math.inf
        inner = node.value if isinstance(node, yaml.CollectionNode) else ()
        parts = (part for one in inner for part in (one if isinstance(one, tuple) else (one,)))
        sizes[id(node)] = 1 + sum(_size(part, sizes) for part in parts)
    return sizes[id(node)]


def _mapping(data: Any, source: str, wanted: str) -> dict[str, Any]:
    if not isinstance(data, dict):
        raise CalibrationError(f"{source}: is a {type(data).__name__}: want {wanted}")
    return {str(key): value for key, value in data.items()}


def _words(reason: Exception) -> str:
    """A parser's reason in one line, in words that do not speak of Python."""
    if isinstance(reason, RecursionError):
        return "nested too deeply: want plain values"
    if "integer string conversion" in str(reason):
        return "a number of thousands of digits: want one that a camera has"
    return (str(reason).splitlines() or [type(reason).__name__])[0]
