"""Parsing of untrusted XML files: no entities, limited depth.

Gazebo's parser is lenient, and Gazebo's own worlds depend on it: they contain comments with double
hyphens, undeclared namespace prefixes and unescaped ampersands.
"""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element
from xml.parsers import expat

from omnisim.core.errors import SceneError

MAX_BYTES = 1 << 28
MAX_DEPTH = 128
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_LONE_AMPERSAND = re.compile(rb"&(?!(?:#\d{1,7}|#x[0-9a-fA-F]{1,6}|lt|gt|amp|quot|apos);)")


class _Builder:
    """Builder of an element tree; it rejects entity declarations, which could grow without bound.

    Attributes:
        root: root element; None: no element yet.
    """

    def __init__(self) -> None:
        self.root: Element | None = None
        self._open: list[Element] = []

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Open an element."""
        element = Element(tag, attributes)
        if self._open:
            self._open[-1].append(element)
        elif self.root is None:
            self.root = element
        if len(self._open) >= MAX_DEPTH:
            raise SceneError(f"expected at most {MAX_DEPTH} elements in each other, got more")
        self._open.append(element)

    def end(self, _: str) -> None:
        """Close the element."""
        self._open.pop()

    def text(self, text: str) -> None:
        """Append text that precedes all children, the only text in SDF."""
        if self._open and not len(self._open[-1]):
            self._open[-1].text = (self._open[-1].text or "") + text

    def refuse(self, *_: object) -> None:
        """Reject a declaration of entities."""
        raise SceneError("expected XML without entities of its own, got a DOCTYPE")


def parse_xml(data: bytes) -> Element:
    """Root of an XML file.

    Raises:
        SceneError: invalid XML, a file that is too large or too deep, or declared entities.
    """
    if len(data) > MAX_BYTES:
        raise SceneError(f"expected at most {MAX_BYTES >> 20} MiB, got {len(data) >> 20} MiB")
    plain = _COMMENT.sub(lambda comment: re.sub(rb"[^\n]", b" ", comment[0]), data).lstrip()
    builder, parser = _Builder(), expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.text
    parser.StartDoctypeDeclHandler = builder.refuse
    try:
        parser.Parse(_LONE_AMPERSAND.sub(b"&amp;", plain), True)
    except expat.ExpatError as reason:
        line = reason.lineno + data[: len(data) - len(plain)].count(b"\n")
        message = expat.ErrorString(reason.code)
        raise SceneError(f"not XML in line {line}, column {reason.offset + 1}: {message}") from None
    except (ValueError, LookupError) as reason:  # a damaged or unknown encoding
        raise SceneError(f"not XML: {reason}") from None
    if builder.root is None:
        raise SceneError("not XML: no element found")
    return builder.root
