"""Which class and which instance each surface belongs to.

Classes come from the `[[labels]]` tables of a scene's TOML, or of a label file of its own:

    [[labels]]
    name = "goal"
    color = [250, 210, 0]       # 8-bit sRGB, for pictures; one is made up where it is missing
    nodes = ["goal_*"]          # names of nodes, * and ? stand for any letters
    id = 3                      # 1 and up; the table's place among the others where it is missing

The first table that claims a name has it. The vehicle's body is "vehicle", and what no table claims
"unlabelled"; their numbers are the next two after the largest, unless a table has that name.

Where there are no tables, an instance's class is its name: up to the first "/", without numbers at
its end, whatever joins them: chair_01, chair.002, chair-3 and "chair 4" are all chairs. Those
classes are numbered in the order of the alphabet.
"""  # fmt: skip

from __future__ import annotations

import re
from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path

from omnisim.errors import SceneError
from omnisim.ground_truth.labels import ClassLabel, InstanceLabel, Labels, distinct_color
from omnisim.scene.model import LabelRule, Scene
from omnisim.scene.scene_file import LabelFile, LabelTable
from omnisim.toml_file import read_toml

VEHICLE, UNLABELLED = "vehicle", "unlabelled"
BODY = "body"  # name of the dynamic object that is the vehicle's body
_NUMBERS = re.compile(r"(?<=\D)(?:[ ._-]?\d+)+$")


def class_name(instance: str) -> str:
    """The class that an instance's name tells: `shelf_02` is a shelf."""
    return _NUMBERS.sub("", instance.partition("/")[0]).rstrip(" ._-") or instance


def read_label_file(path: Path) -> tuple[LabelRule, ...]:
    """The labels of a TOML file that has nothing but `[[labels]]`.

    Raises:
        SceneError: naming file, key, value and what was wanted.
    """
    return label_rules(read_toml(path, LabelFile, SceneError).labels)


def label_rules(tables: tuple[LabelTable, ...]) -> tuple[LabelRule, ...]:
    """Rules of the tables, with the numbers and colours that are not written."""
    taken = {table.id for table in tables if table.id is not None}
    rules, free = [], 1
    for table in tables:
        number = table.id
        if number is None:
            while free in taken:
                free += 1
            number = free
            taken.add(number)
        rules.append(
            LabelRule(number, table.name, table.color or distinct_color(number), table.nodes)
        )
    return tuple(rules)


def find_labels(scene: Scene, dynamic_objects: Mapping[str, Scene] | None = None) -> Labels:
    """Number all instances of a scene and what moves in it, and give each its class.

    Args:
        scene: whose labels hold for the dynamic objects, too.
        dynamic_objects: by name; `BODY` is the vehicle's.
    """
    keys = {(None, instance.name): None for instance in scene.instances}
    for object_name, part in (dynamic_objects or {}).items():
        keys |= {(object_name, instance.name): None for instance in part.instances}
    names = list(keys)
    if scene.labels:
        rules = scene.labels
        claimed = [_claimed(rules, name, object_name) for object_name, name in names]
    else:
        by_name = sorted(
            {class_name(name) for object_name, name in names if object_name != BODY} - {VEHICLE}
        )
        rules = tuple(
            LabelRule(number, name, distinct_color(number), ())
            for number, name in enumerate(by_name, start=1)
        )
        ids = {rule.name: rule.id for rule in rules}
        claimed = [
            None if object_name == BODY else ids.get(class_name(name))
            for object_name, name in names
        ]
    classes = {rule.id: ClassLabel(rule.id, rule.name, rule.color) for rule in rules}
    ids = {rule.name: rule.id for rule in rules}
    for name in (VEHICLE, UNLABELLED):
        if name not in ids:
            ids[name] = max(classes, default=0) + 1
            classes[ids[name]] = ClassLabel(ids[name], name, distinct_color(ids[name]))
    instances, unlabelled = [], []
    for number, ((object_name, name), found) in enumerate(
        zip(names, claimed, strict=True), start=1
    ):
        if found is None:
            is_vehicle = object_name == BODY or (not scene.labels and class_name(name) == VEHICLE)
            found = ids[VEHICLE] if is_vehicle else ids[UNLABELLED]
            if not is_vehicle:
                unlabelled.append(name)
        instances.append(InstanceLabel(number, name, found, object_name))
    return Labels(
        tuple(classes[number] for number in sorted(classes)),
        tuple(instances),
        "table" if scene.labels else "names",
        tuple(unlabelled),
    )


def _claimed(rules: tuple[LabelRule, ...], name: str, object_name: str | None) -> int | None:
    """The first rule's number that claims a name; the body is the vehicle's, whatever its names."""
    if object_name == BODY:
        return None
    for rule in rules:
        if any(_fits(name, pattern) for pattern in rule.nodes):
            return rule.id
    return None


def _fits(name: str, pattern: str) -> bool:
    """Whether a name is like a pattern, in which only * and ? mean more than themselves."""
    return fnmatchcase(name, pattern.replace("[", "[[]"))
