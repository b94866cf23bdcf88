"""Classes and instances: from names, from tables, and from tables that are wrong."""

import dataclasses

import numpy as np
import pytest

from omnisim import load_scene
from omnisim.core.errors import SceneError
from omnisim.scene.files.scene_file import LabelTable
from omnisim.scene.labels import class_name, find_labels, label_rules, read_label_file
from tests.scenes import room, scene_of


def test_a_class_is_the_name_without_its_numbers():
    for name in ("chair_01", "chair.002", "chair-3", "chair 4", "chair5", "chair/leg_2"):
        assert class_name(name) == "chair"
    for name in ("wall_east", "lamp_01_tubes", "12", ""):
        assert class_name(name) == name


def _named(*names, labels=()):
    scene = scene_of([room()] * len(names))
    instances = tuple(
        dataclasses.replace(instance, name=name)
        for instance, name in zip(scene.instances, names, strict=True)
    )
    return dataclasses.replace(scene, instances=instances, labels=labels)


def test_parts_of_one_name_are_one_instance_and_the_body_is_the_vehicle():
    scene = _named("shelf_01", "shelf_01", "ball", "shelf_02")
    labels = find_labels(scene, {"body": _named("shelf_01"), "cart": _named("ball", "ghost")})
    classes = {label.id: label.name for label in labels.classes}
    found = [(label.object_name, label.name, classes[label.class_id]) for label in labels.instances]
    assert found == [
        (None, "shelf_01", "shelf"),
        (None, "ball", "ball"),
        (None, "shelf_02", "shelf"),
        ("body", "shelf_01", "vehicle"),
        ("cart", "ball", "ball"),
        ("cart", "ghost", "ghost"),
    ]
    assert [label.id for label in labels.instances] == [1, 2, 3, 4, 5, 6]
    assert "the scene has no labels" in labels.notices()[0]
    # the same numbers with and without a vehicle
    alone, driven = find_labels(scene), find_labels(scene, {"body": _named("hull", "aerial")})
    assert alone.classes == driven.classes
    assert alone.instances == driven.instances[:3]


def test_the_first_table_that_matches_a_name_has_it():
    rules = label_rules(
        (
            LabelTable(name="goal", nodes=("goal_*",), id=7, color=(1, 2, 3)),
            LabelTable(name="thing", nodes=("goal_blue", "ball")),
        )
    )
    labels = find_labels(_named("goal_blue", "ball", "kite", labels=rules))
    assert labels.class_of_instance.tolist() == [0, 7, 1, 9]
    assert [(label.id, label.name) for label in labels.classes] == [
        (1, "thing"), (7, "goal"), (8, "vehicle"), (9, "unlabeled"),
    ]  # fmt: skip
    assert labels.class_colors[7].tolist() == [1, 2, 3]
    assert labels.notices() == ("no label for 1 instances, such as 'kite': they are 'unlabeled'",)


@pytest.mark.parametrize("name", ["arcade", "courtyard", "mapping", "soccer"])
def test_built_in_scenes_label_everything_and_every_label_is_used(name):
    labels = find_labels(load_scene(name))
    assert labels.source == "table"
    assert labels.unlabeled == ()
    used = set(labels.class_of_instance[1:].tolist())
    unused = {label.name for label in labels.classes if label.id not in used}
    assert unused == {"vehicle", "unlabeled"}
    colors = np.array([label.color for label in labels.classes])
    assert len(np.unique(colors, axis=0)) == len(colors)


def test_soccers_landmarks_have_a_class_for_each_color():
    """Beacons are split in their bands; a goal is of one color."""
    scene = load_scene("soccer")
    labels = find_labels(scene)
    classes = {label.id: label.name for label in labels.classes}
    of_instance = {label.name: classes[label.class_id] for label in labels.instances}
    for landmark in scene.landmarks:
        for band in landmark.bands:
            if landmark.name.startswith("goal"):
                assert of_instance[landmark.name] == landmark.name
            else:
                assert of_instance[f"{landmark.name}_{band.color}"] == f"beacon_{band.color}"


TABLE = '[[labels]]\nname = "a"\nnodes = ["x"]\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[[labels]]\nname = "a"\n', "labels.0.nodes: missing"),
        ('[[labels]]\nname = "a"\nnodes = []\n', "nodes"),
        (TABLE + "id = 0\n", "labels.0.id: expected a number ≥ 1, got 0"),
        (TABLE + "color = [0, 0, 256]\n", "color.2: expected a number ≤ 255, got 256"),
        (TABLE.replace("nodes", "node"), "did you mean 'nodes'?"),
        (TABLE + TABLE, "name = 'a': expected each name once"),
        ("", "labels: missing"),
    ],
)
def test_faults_of_label_files_are_named(tmp_path, text, words):
    path = tmp_path / "labels.toml"
    path.write_text(text)
    with pytest.raises(SceneError) as refused:
        read_label_file(path)
    assert words in str(refused.value)
    assert all(line.startswith(f"{path}: ") for line in str(refused.value).splitlines())


def test_brackets_in_a_name_are_letters():
    rules = label_rules((LabelTable(name="crate", nodes=("crate[?]",)),))
    labels = find_labels(_named("crate[1]", "crate1", labels=rules))
    classes = {label.id: label.name for label in labels.classes}
    assert [classes[label.class_id] for label in labels.instances] == ["crate", "unlabeled"]
