"""Parsing of XML files from anywhere: no entities, no endless depth."""

from __future__ import annotations

from xml.etree.ElementTree import Element, ParseError, TreeBuilder, XMLParser

from omnisim.errors import SceneError

LARGEST_BYTES = 1 << 28
DEEPEST = 128


class _Builder(TreeBuilder):
    """Builder of a tree without entities of its own, which could grow without bound."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = 0

    def start(self, tag: str, attrs: dict[str, str], /) -> Element:
        """Open an element."""
        self._depth += 1
        if self._depth > DEEPEST:
            raise SceneError(f"expected at most {DEEPEST} elements in each other, got more")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> Element:
        """Close an element."""
        self._depth -= 1
        return super().end(tag)

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Refuse a declaration of entities."""
        raise SceneError("expected XML without entities of its own, got a DOCTYPE")


def parse_xml(data: bytes) -> Element:
    """Root of an XML file.

    Raises:
        SceneError: it is none, is too large or too deep, or declares entities.
    """
    if len(data) > LARGEST_BYTES:
        raise SceneError(f"expected at most {LARGEST_BYTES >> 20} MiB, got {len(data) >> 20} MiB")
    parser = XMLParser(target=_Builder())
    try:
        parser.feed(data)
        root: Element = parser.close()
    except ParseError as reason:
        line, column = reason.position
        words = str(reason).partition(":")[0]
        raise SceneError(f"not XML in line {line}, column {column + 1}: {words}") from None
    except (ValueError, LookupError) as reason:  # a damaged or unknown encoding
        raise SceneError(f"not XML: {reason}") from None
    return root
