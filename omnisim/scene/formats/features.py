"""Features of scene formats: applied, omitted with a notice, ignored or refused.

`features.json` has the table of each format, the source of its notices, of its table in the
documentation and of its tests. A reader lists the parts of a file (elements, keys, properties), and
`part_notices` compares them with the table: parts that are left out or unknown become notices.

A row has names with one purpose, the support and its effect; for omitted parts also the noun that
is counted, and the test of their values. In XML a name is `tag`, `parent/tag`, `tag/*` (with all
that is in it), `parent/…` (its other children), `tag@attribute`, `@attribute`, or `@*`.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from omnisim.core.short_repr import counted

Parts = Iterable[tuple[str, str]]  # names of parts with their values
_SHOWN = 6  # unknown names in a notice
_TABLES = Path(__file__).with_suffix(".json")
_OFF = ("", "0", "false", "none", "off", "default", "inherited")


class Support(Enum):
    """Support level of a feature."""

    APPLIED = "applied"
    LEFT_OUT = "left out"
    IGNORED = "ignored"
    REFUSED = "refused"


@dataclass(frozen=True)
class Feature:
    """Part of a format, such as an element, a key or an extension."""

    name: str  # name in the file, or several names with one purpose
    support: Support  # level of support in omnisim
    effect: str  # notice for an omitted feature, also used in the documentation
    # noun of the counted parts in a notice. In glTF: key of `DrawnObjects` with the objects that
    # can have the feature; empty: an omitted extension is reported by name, and other features are
    # not reported
    group: str = ""
    # predicate for the values of parts that the feature would change
    is_used: Callable[[Any], bool] = lambda _: True

    @property
    def names(self) -> list[str]:
        """Names in the file."""
        return self.name.split(", ")

    @property
    def extensions(self) -> tuple[str, ...]:
        """Names of glTF extensions in `name`; empty: the feature is a property."""
        return tuple(name for name in self.names if re.match(r"[A-Z]+_[a-z]", name))


def _is_on(value: str) -> bool:
    return value.strip().lower() not in _OFF


def _is_nonzero(value: str) -> bool:
    """True for numbers other than 0, and for words that are no numbers, such as file names."""
    return any(word.strip("0.-+(),@") for word in value.split())


_TESTS: Mapping[str, Callable[[str], bool]] = {
    "": lambda _: True,
    "on": _is_on,
    "off": lambda value: not _is_on(value),
    "nonzero": _is_nonzero,
    "not one": lambda value: any(re.sub(r"\.0*$", "", word) != "1" for word in value.split()),
    "lit": lambda value: not value.strip() or _is_nonzero(" ".join(value.split()[:3])),
    "other format": lambda value: value.strip() not in ("R8G8B8", "RGB_INT8", "B8G8R8"),
}


@cache
def _tables() -> dict[str, list[list[str]]]:
    return json.loads(_TABLES.read_text(encoding="utf-8"))


TABLES = ("gltf", "sdf", "urdf", "mjcf", "usd", "obj", "mtl", "ply", "stl", "off", "dae")
ROBOT_TABLES = ("camera", "lidar", "imu", "drive")  # of Gazebo's models, also in URDF


@cache
def feature_table(table: str) -> tuple[Feature, ...]:
    """Features of a format."""
    return tuple(
        Feature(names, Support(support), effect, (*rest, "")[0], _TESTS["".join(rest[1:])])
        for names, support, effect, *rest in _tables()[table]
    )


@cache
def _features_by_name(table: str) -> dict[str, Feature]:
    return {name: feature for feature in feature_table(table) for name in feature.names}


def part_notices(table: str, parts: Parts) -> list[str]:
    """Notices for parts of a file that its reader leaves out or does not know, one line each."""
    counts: Counter[tuple[str, str]] = Counter()
    unknown: dict[str, None] = {}
    for name, value in parts:
        feature = _features_by_name(table).get(name)
        if feature is None:
            unknown[name] = None
        elif feature.support is Support.LEFT_OUT and feature.is_used(value):
            counts[feature.effect, feature.group or name.rpartition("/")[2]] += 1
    notices = [f"{effect} ({counted(count, noun)})" for (effect, noun), count in counts.items()]
    if unknown:
        more = ", …" if len(unknown) > _SHOWN else ""
        notices.append(f"not read: {', '.join([*unknown][:_SHOWN])}{more}")
    return notices


def xml_parts(root: Element, table: str, apart: Collection[str] = ()) -> Parts:
    """Elements and attributes of an XML tree, by their names in a table.

    Elements that are not applied are not looked into, and neither are those `apart`. Elements and
    attributes with a prefix, as in `drake:compliance`, are extensions unless the table has them.
    """
    known = {name: feature.support for name, feature in _features_by_name(table).items()}

    def parts(element: Element) -> Iterator[tuple[str, str]]:
        parent = element.tag.rpartition("}")[2]
        for attribute, value in element.attrib.items():
            own, shared = f"{parent}@{attribute}", f"@{attribute}"
            name = shared if shared in known and own not in known else own
            if name in known or not (":" in name or "@*" in known):
                yield name, value
        for child in element:
            tag = child.tag.rpartition("}")[2]
            names = f"{parent}/{tag}", f"{tag}/*", tag, f"{parent}/…"
            name = next((alias for alias in names if alias in known), tag)
            if tag in apart or (":" in tag and name not in known):
                continue
            yield name, " ".join(child.itertext()) if known.get(name) is Support.LEFT_OUT else ""
            if known.get(name) is Support.APPLIED and not name.endswith("/*"):
                yield from parts(child)

    return parts(root)
