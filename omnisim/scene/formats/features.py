"""Features of scene formats: applied, omitted with a notice, ignored or refused.

Each format has a table of its features, the source of its notices, of its table in the
documentation and of its tests. A reader lists the parts of a file (elements, keys, properties), and
`part_notices` compares them with the table: parts that are left out or unknown become notices.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any
from xml.etree.ElementTree import Element

from omnisim.core.short_repr import counted

Parts = Iterable[tuple[str, Any]]  # names of parts, each with the object that it is tested on
_SHOWN = 6  # unknown names in a notice


class Support(Enum):
    """Support level of a feature."""

    APPLIED = "applied"
    LEFT_OUT = "left out"
    IGNORED = "ignored"
    REFUSED = "refused"


@dataclass(frozen=True)
class Feature:
    """Part of a format, such as an element, a key or an extension.

    Attributes:
        name: name in the file, or several names with one purpose. In XML: `tag`, `parent/tag`,
            `tag/*` for an element with all that is in it, `tag@attribute` or `@attribute`.
        support: level of support in omnisim.
        effect: notice for an omitted feature, also used in the documentation.
        group: noun of the counted parts in a notice. In glTF: field of `DrawnObjects` with the
            objects that can have the feature; empty: an omitted extension is reported by name, and
            other features are not reported.
        is_used: predicate for parts that the feature would change.
    """

    name: str
    support: Support
    effect: str
    group: str = ""
    is_used: Callable[[Any], bool] = lambda _: True

    @property
    def names(self) -> list[str]:
        """Names in the file."""
        return self.name.split(", ")

    @property
    def extensions(self) -> tuple[str, ...]:
        """Names of glTF extensions in `name`; empty: the feature is a property."""
        return tuple(name for name in self.names if re.match(r"[A-Z]+_[a-z]", name))


def part_notices(features: Sequence[Feature], parts: Parts) -> list[str]:
    """Notices for parts of a file that its reader leaves out or does not know, one line each."""
    feature_of = {name: feature for feature in features for name in feature.names}
    counts: Counter[str] = Counter()
    unknown: dict[str, None] = {}
    for name, part in parts:
        feature = feature_of.get(name)
        if feature is None:
            unknown[name] = None
        elif feature.support is Support.LEFT_OUT and feature.is_used(part):
            counts[feature.effect, feature.group or name.rpartition("/")[2]] += 1
    notices = [
        f"{effect} ({counted(count, noun, 'meshes' if noun == 'mesh' else '')})"
        for (effect, noun), count in counts.items()
    ]
    if unknown:
        more = ", …" if len(unknown) > _SHOWN else ""
        notices.append(f"not read: {', '.join([*unknown][:_SHOWN])}{more}")
    return notices


def xml_parts(
    root: Element, features: Sequence[Feature], apart: Collection[str] = ()
) -> Iterator[tuple[str, Element]]:
    """Elements and attributes of an XML tree, by their names in a table.

    Elements that are not applied are not looked into, and neither are those `apart`. Elements and
    attributes with a prefix, as in `drake:compliance`, are extensions unless the table has them.
    """
    known = {name: feature.support for feature in features for name in feature.names}
    waiting = [root]
    while waiting:
        element = waiting.pop()
        parent = element.tag.rpartition("}")[2]
        for attribute in element.attrib:
            names = f"{parent}@{attribute}", f"@{attribute}"
            name = next((one for one in names if one in known), names[0])
            if name in known or not (":" in name or "@*" in known):
                yield name, element
        for child in reversed(element):
            tag = child.tag.rpartition("}")[2]
            names = f"{parent}/{tag}", f"{tag}/*", tag
            name = next((one for one in names if one in known), tag)
            if tag in apart or (":" in tag and name not in known):
                continue
            yield name, child
            if known.get(name) is Support.APPLIED and not name.endswith("/*"):
                waiting.append(child)
