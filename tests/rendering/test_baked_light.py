"""Baked light whose value is known everywhere, by both back ends, on all that moves or does not."""

import dataclasses

import numpy as np
import pytest

from omnisim import Stage, open_sensor
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.rendering.opengl import scene_view
from omnisim.scene.labels import BODY
from omnisim.scene.light.baked import with_baked_light
from omnisim.scene.light.environment import Environment, map_directions
from omnisim.scene.model import AlphaMode, Instance, Material
from omnisim.validation.image_differences import psnr_of_levels_db
from tests.baked import add_backs, write_baked
from tests.rendering.frames import BACKENDS, assert_batch_is_frames, each_backend
from tests.rendering.opengl.surfaces.test_cluster_drawer import assert_same, reference_stage
from tests.scenes import room, room_color, scene_of, square
from tests.vehicles import CAMERA, body, box, surroundings

pytestmark = pytest.mark.usefixtures("needs_opengl")

HERE = pose((0.1, -0.2, 0.1), roll_deg=4.0, yaw_deg=10.0)
# Light is stored as half floats, and so is an image of the virtual cameras.
HALF_FLOATS = 2e-3
ALSO = ("range", "normals", "albedo", "instance", "semantic")


def baked(folder, scene, without=()):
    return with_baked_light(scene, write_baked(folder, scene, room_color, without))


@pytest.fixture
def furnished(tmp_path):
    """A room with lamps, a textured box and a pane of glass: the lamps count for nothing."""
    return baked(tmp_path / "furnished.baked", surroundings())


WHITE_ROOM = dataclasses.replace(room(), colors=None)
CRATE = box("crate", 0)


def _linear(scene, backend, state=HERE, **stage):
    with Stage(scene, backend=backend, **stage) as stage, stage.open(CAMERA) as renderer:
        return renderer.render(state, linear=True).linear


def _both_rgb(scene, body):
    """Images of a scene and a body by both back ends."""
    for backend in BACKENDS:
        with Stage(scene, body, backend=backend) as stage:
            yield stage.open(CAMERA).render(HERE).rgb


@each_backend
def test_a_white_room_has_the_colors_of_its_light(tmp_path, backend):
    colored = scene_of([room()])
    image = _linear(baked(tmp_path / "room.baked", scene_of([WHITE_ROOM])), backend)
    np.testing.assert_allclose(image, _linear(colored, backend), atol=HALF_FLOATS)


@pytest.mark.parametrize("backend", ["cube", "rays"])
def test_what_moves_has_the_light_of_the_probes(tmp_path, backend):
    """A box as a dynamic object looks as if it stood there, in the lightmap."""
    place = pose((0.9, 0.3, -0.4), roll_deg=10.0, pitch_deg=20.0, yaw_deg=30.0)
    whole = scene_of([WHITE_ROOM, CRATE], None, [np.eye(4), place])
    expected = _linear(baked(tmp_path / "all.baked", whole), backend)
    empty = baked(tmp_path / "room.baked", scene_of([WHITE_ROOM]))
    state = WorldState({BODY: HERE, "crate": place})
    image = _linear(empty, backend, state, dynamic_objects={"crate": scene_of([CRATE])})
    np.testing.assert_allclose(image, expected, atol=HALF_FLOATS)
    assert np.abs(image - _linear(empty, backend)).max() > 0.1


def test_back_ends_agree(furnished):
    """On matte and glossy surfaces, holes and glass, of the scene and of a moving vehicle."""
    assert psnr_of_levels_db(*_both_rgb(furnished, body())) >= 38.0


@pytest.mark.usefixtures("untraced_reflections")
@pytest.mark.parametrize("sky", [False, True])
def test_back_ends_agree_on_gloss(tmp_path, sky):
    """Metal, gloss and a coat take lamps' gloss, and surroundings as bright as the baked light."""
    scene = surroundings()
    glossy = [
        dataclasses.replace(material, **options)
        for material, options in zip(
            scene.materials,
            ({"metallic": 0.7, "roughness": 0.3}, {"specular": 1.0, "clearcoat": 0.8}, {}),
            strict=True,
        )
    ]
    lighting = scene.lighting
    if sky:
        directions, _ = map_directions(16, 32)
        radiance = (0.5 + 0.4 * directions).astype(np.float32)
        lighting = dataclasses.replace(lighting, environment=Environment(radiance))
    scene = dataclasses.replace(scene, materials=tuple(glossy), lighting=lighting)
    scene = baked(tmp_path / "gloss.baked", scene)
    metal = dataclasses.replace(body(), materials=tuple(
        dataclasses.replace(material, metallic=1.0, roughness=0.4) for material in body().materials
    ))  # fmt: skip
    assert psnr_of_levels_db(*_both_rgb(scene, metal)) >= 36.0


def test_clusters_draw_what_items_do(monkeypatch, furnished):
    """Also glass, which the reference sorts in Python."""
    with Stage(furnished, body()) as stage, reference_stage(monkeypatch, furnished, body()) as one:
        assert_same(*(each.open(CAMERA).render(HERE).rgba for each in (stage, one)))


def test_light_is_the_same_in_all_passes_of_culling(monkeypatch, furnished):
    """Later passes read the depth of those before: not in place of the lightmap."""
    images = []
    for least in ((10**9,) * 4, (0, 0, 0, 0)):
        monkeypatch.setattr(scene_view, "MIN_TRIANGLES_OF_PASSES", least)
        with Stage(furnished, body()) as stage, stage.open(CAMERA) as renderer:
            poses = np.stack([HERE, HERE])
            images.append((renderer.render(HERE).rgba, renderer.render_batch(poses)))
    np.testing.assert_array_equal(images[0][0], images[1][0])
    np.testing.assert_array_equal(images[0][1], images[1][1])


def test_batches_are_single_frames(furnished):
    poses = np.stack([HERE @ pose((0.1 * i, 0.0, 0.0), yaw_deg=40.0 * i) for i in range(3)])
    with Stage(furnished, body()) as stage, stage.open(CAMERA) as renderer:
        assert_batch_is_frames(renderer, poses)


def test_ground_truth_and_plain_colors_are_those_without_it(furnished):
    """Lamps and even light count for nothing where light is baked."""
    bright = dataclasses.replace(furnished.lighting, lights=(), ambient=(0.9, 0.1, 0.0))
    other = dataclasses.replace(furnished, lighting=bright)
    np.testing.assert_array_equal(_linear(other, "cube"), _linear(furnished, "cube"))
    plain = dataclasses.replace(furnished, lighting=surroundings().lighting)
    split = [dataclasses.replace(mesh, light_coordinates=None) for mesh in furnished.meshes]
    plain = dataclasses.replace(plain, meshes=tuple(split))
    frames = []
    for scene in (furnished, plain):
        with open_sensor(scene, CAMERA) as lit, open_sensor(scene, CAMERA, unlit=True) as unlit:
            frames.append((lit.render(HERE, also=ALSO), unlit.render(HERE)))
    for name in ALSO:
        np.testing.assert_array_equal(*(lit.channels[name] for lit, _ in frames), err_msg=name)
    np.testing.assert_array_equal(*(unlit.rgba for _, unlit in frames))
    assert not np.array_equal(*(lit.rgba for lit, _ in frames))


@each_backend
def test_edits_leave_the_light_of_all_else(tmp_path, backend):
    """Moved and added instances take the probes' light; recolored ones keep their own."""
    before, after = pose((0.9, 0.3, -0.4)), pose((-0.6, 0.5, 0.2), roll_deg=30.0, yaw_deg=20.0)
    scene, there = (
        baked(tmp_path / name, scene_of([WHITE_ROOM, CRATE], None, [np.eye(4), place]))
        for name, place in (("before.baked", before), ("after.baked", after))
    )
    empty = baked(tmp_path / "room.baked", scene_of([WHITE_ROOM]))
    expected = _linear(there, backend)
    with Stage(scene, backend=backend) as stage, stage.open(CAMERA) as renderer:
        renderer.render(HERE)
        renderer.scene = scene.moved("object 1", after @ np.linalg.inv(before))
        image = renderer.render(HERE, linear=True).linear
    np.testing.assert_allclose(image, expected, atol=HALF_FLOATS)
    added = empty.added("crate", scene_of([CRATE]), after)
    np.testing.assert_allclose(_linear(added, backend), expected, atol=HALF_FLOATS)
    red = scene.recolored("object 1", (1.0, 0.0, 0.0))
    difference = np.abs(_linear(red, backend) - _linear(scene, backend))
    assert difference[..., 0].max() <= HALF_FLOATS
    assert difference[..., 1].max() > 0.1


def test_an_instance_without_a_rectangle_has_the_light_of_the_probes(tmp_path):
    scene = surroundings()
    whole = baked(tmp_path / "whole.baked", scene)
    some = baked(tmp_path / "some.baked", scene, without=(1, 2))
    assert [instance.light_rectangle is None for instance in some.instances] == [False, True, True]
    np.testing.assert_allclose(_linear(some, "cube"), _linear(whole, "cube"), atol=HALF_FLOATS)


@pytest.mark.parametrize(
    ("backend", "flips", "alpha"),
    [("cube", False, 1.0), ("cube", True, 0.999), ("cube", True, 1.0), ("rays", True, 1.0)],
)
def test_the_sides_of_a_sheet_have_light_of_their_own(tmp_path, backend, flips, alpha):
    """Also of a mirror image, whose front is where it was, and of glass."""
    mode = AlphaMode.OPAQUE if alpha == 1.0 else AlphaMode.BLEND
    sheet = Material(base_color=(1, 1, 1, alpha), double_sided=True, alpha_mode=mode)
    place = np.diag([-1.0, 1.0, 1.0, 1.0]) if flips else np.eye(4)
    scene = scene_of([square(9.0)], [sheet], [place])
    folder = write_baked(tmp_path / "sheet.baked", scene, lambda p: 0.25 + 0.0 * p, spacing_m=9.0)
    add_backs(folder, 0.75)
    scene = with_baked_light(scene, folder)
    for height_m, level in ((0.8, 0.25), (-0.8, 0.75)):
        image = _linear(scene, backend, pose((0.0, 0.0, height_m)))
        seen = image[image > 0.0]
        assert len(seen) > 5000
        np.testing.assert_allclose(np.median(seen), alpha * level, atol=HALF_FLOATS)


def test_instances_of_one_mesh_have_light_of_their_own(tmp_path):
    """One of them is a mirror image, and of another size."""
    places = (
        pose((0.9, 0.3, -0.4)),
        pose((-0.9, 0.6, 0.5), roll_deg=20.0) @ np.diag([-0.5, 0.7, 0.6, 1.0]),
    )
    shared = scene_of([WHITE_ROOM, CRATE])
    crates = (Instance(f"{i}", 1, place) for i, place in enumerate(places))
    shared = dataclasses.replace(shared, instances=(shared.instances[0], *crates))
    apart = scene_of([WHITE_ROOM, CRATE, CRATE], None, [np.eye(4), *places])
    scenes = [baked(tmp_path / f"{i}.baked", one) for i, one in enumerate((shared, apart))]
    images = [_linear(scene, backend) for scene in scenes for backend in BACKENDS]
    for image in images[1:]:
        assert np.median(np.abs(image - images[0])) <= HALF_FLOATS
