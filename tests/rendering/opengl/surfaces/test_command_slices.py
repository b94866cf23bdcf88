"""Draw commands that do not fit into their buffer at once: the same to the last bit."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl import scene_view
from omnisim.rendering.opengl.culling import cluster_culling
from omnisim.rendering.opengl.culling.cluster_culling import BANDS, command_slices
from omnisim.rendering.stage import Stage
from omnisim.scene import load_scene
from tests.rendering.opengl.sheets import LAMP, dynamic_object, mixed_scene

CAMERA = OmniCamera().with_quality("fast").resized(100)
CHANNELS = ("range", "instance", "normals", "albedo")
FEW_BYTES = 40_000  # of commands: of a few groups of clusters in all views
SHADOWED = dataclasses.replace(LAMP, casts_shadow=True)
POSES = np.stack(
    [
        pose((0.3 * number, -0.2 * number, 0.8), yaw_deg=40.0 * number)
        @ np.linalg.inv(CAMERA.base_from_rig)
        for number in range(3)
    ]
)


@pytest.mark.parametrize("max_commands", [10**9, 4000, 640, 1])
def test_slices_are_of_whole_groups_and_fit(max_commands):
    generator = np.random.default_rng(4)
    clusters, of_batch, views = generator.integers(1, 33, 60), np.array([20, 1, 39]), 3
    slices, table, most = command_slices(clusters, of_batch, views, max_commands)
    assert [one.number for ranges in slices for one in ranges] == list(range(len(table)))
    covered = [np.arange(row["first_group"], row["first_group"] + row["groups"]) for row in table]
    assert np.array_equal(np.concatenate(covered), np.arange(60))
    batch_of_group = np.repeat(np.arange(3), of_batch)
    largest = BANDS * views * clusters.max()
    assert most <= max(max_commands, largest)
    for ranges in slices:
        first = 0
        for one in ranges:
            own = covered[one.number]
            assert np.all(batch_of_group[own] == one.batch)
            assert (one.first, one.max_count) == (first, views * clusters[own].sum())
            first += BANDS * one.max_count
        assert first <= most
    if max_commands == 10**9:
        assert len(slices) == 1
        assert [part.batch for part in slices[0]] == [0, 1, 2]


def _everything(stage):
    """Images, ground truth and batches of both; and the most slices of a frame."""
    with stage.open(CAMERA) as renderer:
        frames = [renderer.render(one, also=CHANNELS) for one in POSES]
        batch = renderer.render_batch(POSES, channels=("rgb", *CHANNELS))
        slices = len(renderer._passes.cube.tiles.culler.slices)
    images = [np.stack([frame.rgba for frame in frames]), batch["rgb"]]
    for name in CHANNELS:
        images += [np.stack([frame.channels[name] for frame in frames]), batch[name]]
    return images, slices


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize(
    ("scenes", "passes"),
    [
        pytest.param(
            scenes,
            passes,
            id=f"{name} in {passes}",
            marks=pytest.mark.slow if passes in slow else (),
        )
        for name, scenes, slow in (
            ("mixed", lambda: (mixed_scene(SHADOWED), dynamic_object()), (1, 4)),
            ("soccer", lambda: (load_scene("soccer"),), (1,)),
        )
        for passes in (1, 4)
    ],
)
def test_slices_show_the_same(scenes, passes, monkeypatch):
    monkeypatch.setattr(
        scene_view, "MIN_TRIANGLES_OF_PASSES", ((0, 0, 0, 0) if passes == 4 else (10**9,) * 4)
    )
    with Stage(*scenes()) as stage:
        whole, slices = _everything(stage)
        assert slices == 1
    monkeypatch.setattr(cluster_culling, "MAX_COMMAND_BYTES", FEW_BYTES)
    with Stage(*scenes()) as stage:
        sliced, slices = _everything(stage)
        assert slices > 3
    for one, other in zip(sliced, whole, strict=True):
        assert np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    assert whole[0][..., :3].std() > 20.0
