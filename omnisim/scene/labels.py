"""Semantic classes and instance labels of a scene.

Classes come from the `[[labels]]` tables of a scene's TOML file or of a label file:

    [[labels]]
    name = "goal"
    color = [250, 210, 0]       # 8-bit sRGB, for images; by default chosen automatically
    nodes = ["goal_*"]          # patterns of node names with the wildcards * and ?
    id = 3                      # at least 1; default: the next free ID

The first table that matches a name decides. The vehicle's body is "vehicle", and names without a
match are "unlabeled". Their IDs follow the largest one, unless a table defines that class.

Without tables, the class is derived from the instance's name: the part before the first "/",
without trailing numbers and their separator. So chair_01, chair.002, chair-3 and "chair 4" are all
chairs. The IDs of these classes follow alphabetical order.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Mapping
from fnmatch import fnmatchcase
from pathlib import Path

from omnisim.core.errors import SceneError
from omnisim.core.files.toml_file import read_toml
from omnisim.ground_truth.label_names import ClassLabel, InstanceLabel, Labels, distinct_color
from omnisim.scene.files.scene_file import LabelFile, LabelTable
from omnisim.scene.model import LabelRule, Scene

VEHICLE, UNLABELED = "vehicle", "unlabeled"
BODY = "body"  # name of the vehicle's body among the dynamic objects
_NUMBERS = re.compile(r"(?<=\D)(?:[ ._-]?\d+)+$")


def class_name(instance: str) -> str:
    """Class derived from an instance's name: `shelf_02` is a shelf."""
    return _NUMBERS.sub("", instance.partition("/")[0]).rstrip(" ._-") or instance


def read_label_file(path: Path) -> tuple[LabelRule, ...]:
    """Read the label rules of a TOML file that contains only `[[labels]]`.

    Raises:
        SceneError: the file is invalid; names file, key, actual and expected value.
    """
    return label_rules(read_toml(path, LabelFile, SceneError).labels)


def label_rules(tables: tuple[LabelTable, ...]) -> tuple[LabelRule, ...]:
    """Label rules of the tables, with missing IDs and colors assigned."""
    used_ids = {table.id for table in tables}
    free = (number for number in itertools.count(1) if number not in used_ids)
    ids = [next(free) if table.id is None else table.id for table in tables]
    return tuple(
        table.build(LabelRule, id=number, color=table.color or distinct_color(number))
        for number, table in zip(ids, tables, strict=True)
    )


def find_labels(
    scene: Scene,
    dynamic_objects: Mapping[str, Scene] | None = None,
    vehicles: Collection[str] = (BODY,),
) -> Labels:
    """Label all instances of a scene and its dynamic objects.

    Args:
        scene: scene whose label rules also apply to the dynamic objects.
        dynamic_objects: scenes of the dynamic objects, by name.
        vehicles: names of the dynamic objects that are vehicle bodies.
    """
    named: list[tuple[str | None, str]] = [(None, each.name) for each in scene.instances]
    for key, part in (dynamic_objects or {}).items():
        named += [(key, each.name) for each in part.instances]
    names = dict.fromkeys(named)
    rules = scene.labels
    if not rules:  # without patterns, one for each class derived from the instances' names
        derived = {class_name(name) for owner, name in names if owner not in vehicles} - {VEHICLE}
        numbered = enumerate(sorted(derived), start=1)
        rules = tuple(LabelRule(i, name, distinct_color(i), ()) for i, name in numbered)
    classes = {rule.id: ClassLabel(rule.id, rule.name, rule.color) for rule in rules}
    ids = {rule.name: rule.id for rule in rules}
    for name in (VEHICLE, UNLABELED):
        if name not in ids:
            ids[name] = max(classes, default=0) + 1
            classes[ids[name]] = ClassLabel(ids[name], name, distinct_color(ids[name]))
    instances, unlabeled = [], []
    for number, (owner, name) in enumerate(names, start=1):
        # patterns know only the wildcards * and ?
        patterns = (
            (rule.id, node.replace("[", "[[]")) for rule in scene.labels for node in rule.nodes
        )
        matches = (number for number, pattern in patterns if fnmatchcase(name, pattern))
        class_id = next(matches, None) if scene.labels else ids.get(class_name(name))
        if owner in vehicles:
            class_id = ids[VEHICLE]
        elif class_id is None:
            class_id = ids[UNLABELED]
            unlabeled.append(name)
        instances.append(InstanceLabel(number, name, class_id, owner))
    return Labels(
        tuple(classes[number] for number in sorted(classes)),
        tuple(instances),
        "table" if scene.labels else "names",
        tuple(unlabeled),
    )
