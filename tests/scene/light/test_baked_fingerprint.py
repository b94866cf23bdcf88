"""Fingerprint of baked light: what it depends on, and what it does not."""

import dataclasses

import numpy as np
import pytest

from omnisim.scene import Scene


@pytest.fixture
def scene():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    return Scene.from_arrays("sheet", corners, [[0, 1, 2]], base_color=(0.5, 0.4, 0.3))


def test_equal_scenes_have_one_fingerprint(scene):
    copy = dataclasses.replace(
        scene,
        meshes=tuple(dataclasses.replace(m, positions=m.positions.copy()) for m in scene.meshes),
    )
    assert copy.identity.light == scene.identity.light
    assert len(scene.identity.light) == 64


def test_names_fog_and_starts_count_for_nothing(scene):
    (instance,), (mesh,) = scene.instances, scene.meshes
    other = dataclasses.replace(
        scene,
        name="other",
        instances=(dataclasses.replace(instance, name="other"),),
        meshes=(dataclasses.replace(mesh, name="other"),),
        background=(0.0, 0.0, 0.0),
    )
    assert other.identity.light == scene.identity.light


def _with_vertex(scene):
    positions = scene.meshes[0].positions.copy()
    positions[0, 0] += 1e-3
    return dataclasses.replace(
        scene, meshes=(dataclasses.replace(scene.meshes[0], positions=positions),)
    )


def _with_light(**changes):
    return lambda scene: dataclasses.replace(
        scene, lighting=dataclasses.replace(scene.lighting, **changes)
    )


@pytest.mark.parametrize(
    "change",
    [
        _with_vertex,
        lambda scene: scene.moved("sheet", np.diag([1.0, 1, 1, 1]) + np.eye(4, k=3)),
        lambda scene: scene.recolored("sheet", (0.1, 0.1, 0.1)),
        _with_light(exposure=2.0),
        _with_light(ambient=(0.0, 0.0, 0.1)),
        _with_light(lights=()),
        _with_light(is_matte=True),
    ],
)
def test_what_light_depends_on_changes_it(scene, change):
    assert change(scene).identity.light != scene.identity.light
