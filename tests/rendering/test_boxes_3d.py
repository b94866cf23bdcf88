"""3-D boxes of instances: those of trimesh, in the world and through the camera."""

import dataclasses
import json

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from omnisim import OmniCamera, Stage, load_scene
from omnisim.cameras import EquirectangularCamera
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.scene.model import Instance, Mesh
from tests.rendering.frames import BACKENDS, frame_of, opened
from tests.scenes import room, scene_of
from tests.vehicles import box

NOW = pose((-1.0, 0.1, 0.05), roll_deg=4.0, yaw_deg=10.0)
SPHERE = OmniCamera(EquirectangularCamera(240, 120), polygons=None, supersampling=1)
# Points are float32 from the viewpoint, some meters away.
CLOSE_M = 1e-5


def _same_box(found, transform, extents):
    """Same corners: the axes of a box may have another order and other signs."""
    theirs = trimesh.primitives.Box(extents=extents, transform=transform).vertices
    apart = np.linalg.norm(found.corners_m[:, None] - theirs[None], axis=-1)
    assert apart.min(axis=0).max() < 1e-9
    assert apart.min(axis=1).max() < 1e-9


def _framed(meshes, poses):
    """Scene whose instances have the frames of their meshes."""
    scene = scene_of(meshes, poses=poses)
    instances = [
        dataclasses.replace(instance, world_from_node=instance.world_from_mesh)
        for instance in scene.instances
    ]
    return dataclasses.replace(scene, instances=tuple(instances))


def _matrix(scale=(1.0, 1.0, 1.0)):
    return pose((3.0, -2.0, 1.0), roll_deg=20.0, pitch_deg=-30.0, yaw_deg=50.0) @ np.diag(
        [*scale, 1.0]
    )


@pytest.mark.parametrize("scale", [(1, 1, 1), (0.5, 2.0, 3.0), (-1.5, 1.0, 0.3)])
def test_boxes_are_the_bounds_in_the_frame_of_the_instance(scale):
    """By trimesh: bounds of the mesh, scaled in its own frame, then turned and moved."""
    random = np.random.default_rng(4)
    points = random.normal(size=(40, 3)).astype(np.float32)
    triangles = random.permutation(40)[:39].reshape(13, 3).astype(np.uint32)
    mesh = Mesh("cloud", points, triangles, 0)
    scene = _framed([mesh], [_matrix(scale)])
    (found,) = scene.instance_boxes.values()
    theirs = trimesh.Trimesh(points * np.array(scale), triangles, process=False)
    low, high = theirs.triangles.reshape(-1, 3).min(0), theirs.triangles.reshape(-1, 3).max(0)
    centered = _matrix() @ trimesh.transformations.translation_matrix(0.5 * (low + high))
    _same_box(found, centered, high - low)


def test_parts_of_one_name_have_one_box_along_the_axes_of_the_first():
    scene = _framed([box("a", 0, half_m=0.5)], [_matrix()])
    moved = _matrix() @ pose((2.0, 0.0, 0.0), yaw_deg=90.0)
    twin = Instance(scene.instances[0].name, 0, moved)
    scene = dataclasses.replace(scene, instances=(*scene.instances, twin))
    (found,) = scene.instance_boxes.values()
    _same_box(found, _matrix() @ pose((1.0, 0.0, 0.0)), (3.0, 1.0, 1.0))


@pytest.fixture
def frame(needs_opengl):
    crate = scene_of([box("crate", 0, half_m=0.25)])
    there = pose((0.3, 0.2, 0.1), roll_deg=15.0, yaw_deg=30.0)
    stage = Stage(scene_of([room()]), dynamic_objects={"crate": crate})
    with stage, stage.open(SPHERE) as renderer:
        state = WorldState({renderer.vehicle: NOW, "crate": there})
        frame = renderer.render(state, also=("position", "instance"), boxes_3d=True)
        assert not renderer.render(state).channels
        alone = renderer.render(state, boxes_3d=True)
    assert not alone.channels
    assert [one.pixels for one in alone.boxes_3d] == [one.pixels for one in frame.boxes_3d]
    return frame, there


def test_boxes_of_a_dynamic_object(frame):
    frame, there = frame
    crate = next(one for one in frame.boxes_3d if one.label.object_name == "crate")
    _same_box(crate.full, there, (0.5, 0.5, 0.5))
    on_crate = frame.channels["instance"] == crate.label.id
    assert crate.pixels == on_crate.sum()
    points = frame.channels["position"][on_crate]
    along = (points - crate.full.center_m) @ crate.full.rotation
    assert np.abs(along).max() < 0.25 + CLOSE_M
    # the viewpoint sees three sides or fewer: the visible box reaches them, but for a pixel's width
    visible = (points - crate.visible.center_m) @ crate.full.rotation
    np.testing.assert_allclose(visible.max(axis=0), 0.5 * crate.visible.size_m, atol=CLOSE_M)
    np.testing.assert_allclose(visible.min(axis=0), -0.5 * crate.visible.size_m, atol=CLOSE_M)
    assert (crate.visible.size_m > 0.45).all()
    for one in frame.boxes_3d:  # visible boxes are inside of the full ones
        corners = (one.visible.corners_m - one.full.center_m) @ one.full.rotation
        assert (np.abs(corners) <= 0.5 * one.full.size_m + 1e-12).all()


def test_json_has_both_frames(frame, tmp_path):
    frame, _ = frame
    frame.save(tmp_path / "a.png")
    content = json.loads((tmp_path / "a.boxes_3d.json").read_text())
    assert [one["instance_id"] for one in content["boxes"]] == [1, 2]
    world_from_optical = np.array(content["world_from_optical"])
    for found, one in zip(content["boxes"], frame.boxes_3d, strict=True):
        for kind in ("full", "visible"):
            entry = found[kind]
            half = 0.5 * np.array(entry["size_m"])
            for name, into_world in (("world", np.eye(4)), ("camera", world_from_optical)):
                turned = Rotation.from_quat(entry[name]["quaternion_xyzw"]).apply(half)
                corner = turned + entry[name]["center_m"]
                corner = into_world[:3, :3] @ corner + into_world[:3, 3]
                expected = getattr(one, kind).corners_m[-1]
                np.testing.assert_allclose(corner, expected, atol=1e-9)


@pytest.mark.usefixtures("needs_opengl")
def test_boxes_hold_all_that_is_seen_of_their_instances():
    """Pixels of the soccer field's hall."""
    outside_m, ranges_m = [], []
    frame = frame_of(
        load_scene("soccer"), OmniCamera().resized(160), pose((0.3, -0.4, 0.6)),
        also=("position", "instance", "range"), boxes_3d=True,
    )  # fmt: skip
    assert len(frame.boxes_3d) > 100
    ids = np.unique(frame.channels["instance"])
    assert [one.label.id for one in frame.boxes_3d] == ids[ids > 0].tolist()
    for one in frame.boxes_3d:
        mine = frame.channels["instance"] == one.label.id
        along = (frame.channels["position"][mine] - one.full.center_m) @ one.full.rotation
        outside_m += (np.abs(along) - 0.5 * one.full.size_m).max(axis=1).tolist()
        ranges_m += frame.channels["range"][mine].tolist()
    outside_m, ranges_m = np.array(outside_m), np.array(ranges_m)
    # rays that narrowly miss an edge, and count as hits beside it: 0.2 % were measured
    assert (outside_m <= CLOSE_M).mean() > 0.995
    # by less than a pixel, of some 0.015 rad: 0.002 were measured
    assert (outside_m / ranges_m).max() < 0.005


@pytest.mark.usefixtures("needs_opengl")
def test_boxes_follow_an_edit_and_are_those_of_cast_rays():
    meshes = [room(), box("crate", 0, half_m=0.25)]
    scene = _framed(meshes, [pose(), pose((0.5, 0.3, 0.0), yaw_deg=30.0)])
    there = pose((0.2, -0.6, 0.3), roll_deg=20.0, yaw_deg=40.0)
    found = {}
    for backend in BACKENDS:
        with opened(scene, SPHERE, backend) as renderer:
            renderer.move("object 1", there)
            found[backend] = renderer.render(NOW, boxes_3d=True).boxes_3d
        assert [one.label.name for one in found[backend]] == ["object 0", "object 1"]
        _same_box(found[backend][1].full, there, (0.5, 0.5, 0.5))
    for cube, rays in zip(*found.values(), strict=True):
        np.testing.assert_allclose(cube.visible.size_m, rays.visible.size_m, atol=1e-3)
