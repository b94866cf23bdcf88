import dataclasses

import numpy as np
import pytest

from omnisim.core.coordinate_frames import RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.cube import unfolded_cube
from omnisim.core.errors import GraphicsError, OmnisimError, OpticsError
from omnisim.core.poses import pose as make_pose
from omnisim.core.srgb import linear_from_srgb, srgb_from_linear
from omnisim.rendering.camera.degradations import Degradation, Noise
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl import gpu_textures
from omnisim.rendering.stage import open_sensor
from omnisim.scene.model import AlphaMode, Light, Lighting, LightKind, Material, Mesh, Texture, Wrap
from tests.scenes import NO_LIGHT, room, scene_of, square

pytestmark = pytest.mark.usefixtures("needs_opengl")


def quad(z_m, half_m=5.0, **options):
    return square(half_m, z_m, name=f"quad at {z_m}", **options)


def center_color(scene, viewpoint=(0.0, 0.0, 0.0), **options):
    """Linear color straight below the viewpoint."""
    sensor = OmniCamera(polygons=None).resized(91)
    with open_sensor(scene, sensor, **options) as renderer:
        frame = renderer.render(sensor.base_pose(viewpoint), linear=True)
    return frame.linear[45, 45]


def material(red, green, blue, alpha=1.0, **options):
    return Material(base_color=(red, green, blue, alpha), **options)


def test_directions_of_the_image():
    """+x is up, +y on the right, as in every image of a camera that looks up at its mirror."""
    colors = {"+x": (1, 0, 0), "+y": (0, 1, 0), "-x": (0, 0, 1), "-y": (1, 1, 0)}
    meshes, poses = [], []
    for index, (axis, sign) in enumerate([(0, 1), (1, 1), (0, -1), (1, -1)]):
        meshes.append(quad(0.0, half_m=1.0, material=index))
        pose = np.eye(4)
        normal = np.zeros(3)
        normal[axis] = -sign
        across = np.cross((0.0, 0.0, 1.0), normal)
        pose[:3, :3] = np.stack((across, np.cross(normal, across), normal), axis=1)
        pose[axis, 3] = 3.0 * sign
        poses.append(pose)
    materials = [material(*color) for color in colors.values()]
    sensor = OmniCamera(polygons=None)
    with open_sensor(scene_of(meshes, materials, poses), sensor) as renderer:
        ahead = renderer.render(np.eye(4)).rgb
        turned = renderer.render(sensor.base_pose((0, 0, 0), yaw_deg=90.0)).rgb
    middle, near, far = 180, 40, 319
    at = {"+x": (near, middle), "+y": (middle, far), "-x": (far, middle), "-y": (middle, near)}
    for name, (row, column) in at.items():
        assert ahead[row, column].tolist() == [255 * value for value in colors[name]], name
    # a vehicle that has turned left sees +y ahead, and -x on its left: the right of the image
    assert turned[near, middle].tolist() == [0, 255, 0]
    assert turned[middle, far].tolist() == [0, 0, 255]


def test_back_faces_are_culled_unless_double_sided():
    seen = scene_of([quad(-1.0)], [material(1, 0, 0)])
    np.testing.assert_allclose(center_color(seen), (1, 0, 0), atol=1e-3)
    from_behind = [quad(-1.0, half_m=-5.0)]  # still turns the same way: seen from above
    np.testing.assert_allclose(center_color(scene_of(from_behind, [material(1, 0, 0)])), (1, 0, 0))
    turned = Mesh("t", quad(-1.0).positions, quad(-1.0).triangles[:, ::-1].copy(), 0)
    np.testing.assert_allclose(center_color(scene_of([turned], [material(1, 0, 0)])), 0.0)
    both = scene_of([turned], [material(1, 0, 0, double_sided=True)])
    np.testing.assert_allclose(center_color(both), (1, 0, 0), atol=1e-3)


def test_mirrored_instances_keep_their_front():
    pose = np.diag([-1.0, 1.0, 1.0, 1.0])
    scene = scene_of([quad(-1.0)], [material(0, 1, 0)], [pose])
    np.testing.assert_allclose(center_color(scene), (0, 1, 0), atol=1e-3)


def test_alpha_mask_and_blend():
    masks = [
        material(1, 0, 0, alpha=0.4, alpha_mode=AlphaMode.MASK),
        material(0, 0, 1),
    ]
    scene = scene_of([quad(-1.0), quad(-2.0, material=1)], masks)
    np.testing.assert_allclose(center_color(scene), (0, 0, 1), atol=1e-3)
    masks[0] = dataclasses.replace(masks[0], alpha_cutoff=0.3)
    scene = scene_of([quad(-1.0), quad(-2.0, material=1)], masks)
    np.testing.assert_allclose(center_color(scene), (1, 0, 0), atol=1e-3)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_blended_panes_are_drawn_back_to_front(order):
    panes = [
        material(1, 0, 0, alpha=0.25, alpha_mode=AlphaMode.BLEND),
        material(0, 1, 0, alpha=0.5, alpha_mode=AlphaMode.BLEND),
        material(0, 0, 1),
    ]
    meshes = [quad(-1.0, material=0), quad(-2.0, material=1)]
    scene = scene_of([*(meshes[i] for i in order), quad(-3.0, material=2)], panes)
    expected = 0.25 * np.array([1, 0, 0]) + 0.75 * (0.5 * np.array([0, 1, 0]) + [0, 0, 0.5])
    np.testing.assert_allclose(center_color(scene), expected, atol=2e-3)


def test_triangles_of_one_blended_mesh_are_sorted_for_each_instance():
    """Two panes in one mesh, seen from both sides: two instances, one upside down."""
    one, other = quad(1.0), quad(-1.0)
    mesh = Mesh(
        "panes",
        np.concatenate((one.positions, other.positions)),
        np.concatenate((one.triangles, other.triangles + 4)),
        0,
        colors=np.repeat(np.array([[1, 0, 0, 1], [0, 1, 0, 1]], np.float32), 4, axis=0),
    )
    half = material(1, 1, 1, alpha=0.5, alpha_mode=AlphaMode.BLEND, double_sided=True)
    upright, overhead = np.eye(4), np.diag([1.0, -1.0, -1.0, 1.0])
    upright[2, 3], overhead[2, 3] = -3.0, -3.0
    upright_color = center_color(scene_of([mesh], [half], [upright]))
    np.testing.assert_allclose(upright_color, (0.5, 0.25, 0), atol=2e-3)  # red is nearer
    overhead_color = center_color(scene_of([mesh], [half], [overhead]))
    np.testing.assert_allclose(overhead_color, (0.25, 0.5, 0), atol=2e-3)
    overhead[2, 3] = -9.0
    scene = scene_of([mesh, quad(-20.0, half_m=50.0, material=1)], [half, material(0, 0, 1)])
    both = dataclasses.replace(
        scene,
        instances=(
            *scene_of([mesh], [half], [upright]).instances,
            *scene_of([mesh], [half], [overhead]).instances,
            scene.instances[1],
        ),
    )
    behind = 0.5 * np.array([0, 1, 0]) + 0.25 * np.array([1, 0, 0]) + 0.25 * np.array([0, 0, 1])
    expected = (0.5, 0, 0) + 0.25 * np.array([0, 1, 0]) + 0.25 * behind
    np.testing.assert_allclose(center_color(both), expected, atol=2e-3)


def test_lambert_with_and_without_normals():
    down = Light(LightKind.DIRECTIONAL, (1.0, 0.5, 0.0), 0.5, direction=np.array([0.0, 0.0, -1.0]))
    slanted = np.array([0.6, 0.0, -0.8])
    lighting = Lighting((0.1, 0.1, 0.1), (down,), exposure=2.0)
    meshes = [quad(-1.0)]
    flat = center_color(scene_of(meshes, [material(0.5, 0.5, 0.5)], lighting=lighting))
    np.testing.assert_allclose(flat, 0.5 * (0.1 + np.array([1.0, 0.5, 0.0])), atol=1e-3)
    lighting = Lighting((0.0,) * 3, (dataclasses.replace(down, direction=slanted),), exposure=2.0)
    normals = np.tile(np.array([[0, 0, 1]], np.float32), (4, 1))
    smooth = [dataclasses.replace(meshes[0], normals=normals)]
    color = center_color(scene_of(smooth, [material(1, 1, 1)], lighting=lighting))
    np.testing.assert_allclose(color, 0.8 * np.array([1.0, 0.5, 0.0]), atol=1e-3)
    unlit = center_color(scene_of(smooth, [material(1, 1, 1)], lighting=lighting), unlit=True)
    np.testing.assert_allclose(unlit, 1.0, atol=1e-3)


def test_point_and_spot_light_fall_off():
    for kind, cosines in ((LightKind.POINT, (1.0, 0.0)), (LightKind.SPOT, (0.9, 0.8))):
        lamp = Light(
            kind, (1.0, 1.0, 1.0), 2.0, position_m=np.array([0.0, 0.0, 1.0]), cone_cosines=cosines
        )
        lighting = Lighting((0.0, 0.0, 0.0), (lamp,))
        color = center_color(scene_of([quad(-1.0)], [material(1, 1, 1)], lighting=lighting))
        np.testing.assert_allclose(color, 2.0 / 2.0**2, rtol=2e-3)


def test_background_where_no_surface_is():
    color = center_color(scene_of([quad(+9.0)], [material(1, 0, 0)], background=(0.1, 0.2, 0.3)))
    np.testing.assert_allclose(color, (0.1, 0.2, 0.3), atol=1e-3)


def test_near_and_far_planes_clip():
    sensor = OmniCamera.from_table(
        {"mirror": {"polygons": "exact"}, "virtual_cameras": {"near_m": 0.5, "far_m": 2.0}}
    ).resized(91)
    for distance, seen in ((0.49, False), (0.51, True), (1.99, True), (2.01, False)):
        with open_sensor(scene_of([quad(-distance)], [material(1, 0, 0)]), sensor) as renderer:
            red = renderer.render(np.eye(4)).rgb[45, 45, 0]
        assert (red > 0) == seen, distance


@pytest.mark.parametrize(("distance_m", "gap_m"), [(50, 0.01), (500, 0.1), (10_000, 1.0)])
def test_far_surfaces_do_not_shine_through_each_other(distance_m, gap_m):
    materials = [material(0, 1, 0), material(1, 0, 0)]
    half_m = 2.0 * distance_m
    meshes = [quad(0.0, half_m), quad(-gap_m, half_m, material=1)]
    poses = [np.eye(4), np.eye(4)]
    tilt = make_pose((0.0, 0.0, -distance_m), roll_deg=7.0, pitch_deg=11.0)
    sensor = OmniCamera(polygons=None, samples=1)
    with open_sensor(
        scene_of(meshes, materials, [tilt @ pose for pose in poses]), sensor
    ) as renderer:
        rgb = renderer.render(np.eye(4)).rgb
    assert (rgb[..., 1] > 0).sum() > 10_000
    assert not rgb[..., 0].any()


def test_viewpoint_inside_a_wall_is_a_image():
    scene = scene_of([room()])
    sensor = OmniCamera()
    with open_sensor(scene, sensor) as renderer:
        frame = renderer.render(sensor.base_pose((3.0, 0.0, 0.0)))
    assert frame.rgb[frame.valid].std() > 1.0


def test_two_renderers_side_by_side():
    """Each has its own context; neither disturbs the other, nor does one that is closed."""
    sensor = OmniCamera(polygons=None).resized(91)
    one = open_sensor(scene_of([quad(-1.0)], [material(1, 0, 0)]), sensor)
    other = open_sensor(scene_of([quad(-1.0)], [material(0, 1, 0)]), sensor)
    pose = np.eye(4)
    assert one.render(pose).rgb[45, 45].tolist() == [255, 0, 0]
    assert other.render(pose).rgb[45, 45].tolist() == [0, 255, 0]
    assert one.render(pose).rgb[45, 45].tolist() == [255, 0, 0]
    other.close()
    assert one.render(pose).rgb[45, 45].tolist() == [255, 0, 0]
    one.close()


def test_unlit_material_is_its_color_in_any_light():
    dark = Lighting((0.0, 0.0, 0.0), ())
    plain = dataclasses.replace(material(0.25, 0.5, 1.0), unlit=True)
    color = center_color(scene_of([quad(-1.0)], [plain], lighting=dark))
    np.testing.assert_allclose(color, (0.25, 0.5, 1.0), atol=1e-3)


@pytest.mark.parametrize("wrap", [Wrap.REPEAT, Wrap.CLAMP_TO_EDGE])
def test_textures_are_upright_and_wrap(wrap):
    """Four colors, the first row of the image at v = 0; beyond the edges by `wrap`."""
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], dtype=np.uint8)
    pixels = np.concatenate((pixels, np.full((2, 2, 1), 255, np.uint8)), axis=-1)
    pixels = pixels.repeat(64, axis=0).repeat(64, axis=1)
    # u runs along +x and v along −y, a texture in 4 m, from the viewpoint's foot
    coordinates = quad(0.0).positions[:, :2] * np.array([0.25, -0.25], np.float32)
    mesh = quad(-1.0, texture_coordinates=coordinates)
    textured = Material(texture=Texture(pixels, wrap, wrap))
    sensor = OmniCamera(polygons=None, samples=1).resized(361)
    with open_sensor(scene_of([mesh], [textured]), sensor) as renderer:
        rgb = renderer.render(np.eye(4)).rgb.astype(int)

    def at(x, y):  # a point of the floor
        direction = RIG_FROM_OPTICAL_LOOKING_UP.T @ (x, y, -1.0)
        u, v = np.rint(sensor.model.pixel_from_ray(direction).positions_px).astype(int)
        return tuple(np.rint(rgb[v, u] / 255.0).astype(int).tolist())

    assert at(1.0, -1.0) == (1, 0, 0)  # u = v = 0.25
    assert at(3.0, -1.0) == (0, 1, 0)  # u = 0.75
    assert at(1.0, -3.0) == (0, 0, 1)  # v = 0.75
    assert at(3.0, -3.0) == (1, 1, 1)
    assert at(-1.0, -1.0) == ((0, 1, 0) if wrap is Wrap.REPEAT else (1, 0, 0))  # u = −0.25


def test_blended_surfaces_write_no_depth():
    """The middle of the large pane is farther away, so it is drawn first, in front as it is."""
    pane = material(1, 0, 0, alpha=0.5, alpha_mode=AlphaMode.BLEND)
    large = quad(-1.0, half_m=3.0)
    aside = Mesh("aside", large.positions + np.array([2.5, 0, 0], np.float32), large.triangles, 0)
    color = center_color(scene_of([aside, quad(-1.5, half_m=0.5)], [pane]))
    np.testing.assert_allclose(color, (0.75, 0, 0), atol=2e-3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"near_m": 0.0}, "near_m: expected a number > 0, got 0"),
        ({"near_m": float("nan")}, "near_m: expected a finite number, got nan"),
        ({"near_m": 2.0, "far_m": 1.0}, "far_m: expected more than near_m = 2, got 1"),
        ({"face_size_px": 0}, "face_size_px: expected at least 1, or None, got 0"),
        ({"samples": 3}, "samples: expected 1, 2, 4 or 8, got 3"),
        ({"polygons": "exact"}, "polygons: expected a whole number, 'auto' or None, got 'exact'"),
        ({"base_from_rig": np.diag([2.0, 2, 2, 1])}, "no scale"),
        ({"base_from_rig": np.eye(3)}, "expected a finite 4 × 4 matrix"),
    ],
)
def test_impossible_sensors_are_refused(options, words):
    with pytest.raises(OmnisimError, match=words):
        OmniCamera(**options)


def test_images_can_be_written_to():
    with open_sensor(scene_of([room()])) as renderer:
        frame = renderer.render(np.eye(4), linear=True)
        frame.rgb[0, 0] = 1
        frame.linear[0, 0] = 1.0
        renderer.faces()["front"][0, 0] = 1


def test_closed_renderers_refuse_to_render():
    renderer = open_sensor(scene_of([room()]))
    with pytest.raises(GraphicsError, match="render a frame first"):
        renderer.faces()
    renderer.close()
    renderer.close()
    with pytest.raises(GraphicsError, match="this renderer is closed"):
        renderer.render(np.eye(4))
    with pytest.raises(GraphicsError, match="this renderer is closed"):
        renderer.faces()


def test_frames_of_a_loop_do_not_depend_on_each_other():
    sensor = OmniCamera()
    poses = [sensor.base_pose((x, 0.0, 0.0), yaw_deg=40.0 * x) for x in (0.0, 0.5, 1.0)]
    with open_sensor(scene_of([room()]), sensor) as renderer:
        forth = [renderer.render(pose).rgba for pose in poses]
        back = [renderer.render(pose).rgba for pose in reversed(poses)]
    for one, other in zip(forth, reversed(back), strict=True):
        np.testing.assert_array_equal(one, other)


def test_linear_and_encoded_image_agree():
    sensor = OmniCamera()
    with open_sensor(scene_of([room()]), sensor) as renderer:
        frame = renderer.render(np.eye(4), linear=True)
        assert renderer.render(np.eye(4)).linear is None
    expected = 255.0 * srgb_from_linear(frame.linear)
    # half floats hold 11 bits; the GPU's power function and rounding take the rest
    assert np.abs(frame.rgb[frame.valid] - expected[frame.valid]).max() <= 0.75
    assert frame.linear.dtype == np.float32


def test_srgb_reference_is_its_own_inverse():
    values = np.linspace(0.0, 1.0, 1001)
    np.testing.assert_allclose(linear_from_srgb(srgb_from_linear(values)), values, atol=1e-7)


def test_faces_and_their_unfolding():
    sensor = OmniCamera(face_size_px=64)
    with open_sensor(scene_of([room()]), sensor) as renderer:
        renderer.render(np.eye(4))
        faces = renderer.faces()
    assert list(faces) == ["front", "left", "back", "right", "down"]
    assert all(face.shape == (64, 64, 3) for face in faces.values())
    # neighbors meet: the last column of front is the first of right, but for half a pixel
    step = np.abs(faces["front"][:, -1].astype(int) - faces["right"][:, 0]).max()
    assert step <= 4
    unfolded = unfolded_cube(faces)
    cell = 66  # with a border of one pixel, a 32nd of the face's half
    assert unfolded.shape == (2 * cell, 3 * cell, 3)
    np.testing.assert_array_equal(unfolded[67:131, 67:131], faces["down"])
    np.testing.assert_array_equal(unfolded[66, 67:131], faces["down"][0])
    assert not unfolded[cell:, 2 * cell :].any()  # there is no up face


def test_limits_of_the_gpu_are_named(monkeypatch):
    with pytest.raises(GraphicsError, match="an image of 30000 × 30000 px: this GPU takes at most"):
        open_sensor(scene_of([room()]), OmniCamera().resized(30000))
    with monkeypatch.context() as patch:
        patch.setattr(gpu_textures, "fits_texture", lambda size, has_half_floats: has_half_floats)
        degraded = OmniCamera(degradation=Degradation(noise=Noise())).resized(4096)
        with pytest.raises(GraphicsError, match=r"a degraded .* no texture of 256 MiB; make"):
            open_sensor(scene_of([room()]), degraded)
        with (
            open_sensor(scene_of([room()]), OmniCamera().resized(40)) as renderer,
            pytest.raises(GraphicsError, match="ground truth of 40 × 40 px: this GPU takes no"),
        ):
            renderer.render(np.eye(4), also=("range",))
    with pytest.raises(GraphicsError, match="device 99: there is no such device"):
        open_sensor(scene_of([room()]), device=99)


@pytest.mark.parametrize(
    "matrix",
    [np.eye(3), np.full((4, 4), np.nan), np.diag([2.0, 2, 2, 1]), np.diag([1.0, 1, -1, 1])],
)
def test_matrices_that_are_no_poses_are_refused(matrix):
    with (
        open_sensor(scene_of([room()], lighting=NO_LIGHT)) as renderer,
        pytest.raises(OmnisimError, match="pose: expected"),
    ):
        renderer.render(matrix)


def test_metadata_describes_camera_and_pose():
    sensor = OmniCamera()
    with open_sensor(scene_of([room()]), sensor) as renderer:
        metadata = renderer.render(make_pose((1.0, 0.5, 0.0), yaw_deg=30.0)).metadata
    assert metadata["camera"]["k"] == 11.546
    assert metadata["camera"]["focal_length_px"] == sensor.model.focal_length_px
    assert metadata["polygons"] == sensor.mesh_polygons == 3600
    world_from_optical = np.array(metadata["world_from_optical"])
    np.testing.assert_allclose(world_from_optical[:3, 3], (1.0, 0.5, 0.0))
    # the optical axis looks up, and the top of the image ahead
    np.testing.assert_allclose(world_from_optical[:3, 2], (0, 0, 1), atol=1e-15)
    ahead = (np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0)
    np.testing.assert_allclose(-world_from_optical[:3, 1], ahead, atol=1e-15)


@pytest.mark.parametrize("polygons", [None, 64])
def test_supersampling_is_the_mean_of_a_finer_image(polygons):
    """Three samples to a side of a pixel, or an image three times as large: the same light."""
    scene = scene_of([room()])
    # so few texels that neither asks for mip levels, which differ between one sample and many
    coarse = OmniCamera(polygons=polygons, supersampling=3, face_size_px=48).resized(120)
    fine = OmniCamera(polygons=polygons, supersampling=1, face_size_px=48).resized(360)
    with open_sensor(scene, coarse) as one, open_sensor(scene, fine) as other:
        mean = one.render(np.eye(4), linear=True)
        blocks = other.render(np.eye(4), linear=True)
    colors = blocks.linear.reshape(120, 3, 120, 3, 3)
    covered = blocks.valid.reshape(120, 3, 120, 3).sum(axis=(1, 3))
    np.testing.assert_array_equal(mean.valid, covered >= 4.5)
    wanted = colors.sum(axis=(1, 3)) / np.maximum(covered, 1)[..., None]
    # half floats: 2⁻¹¹ of the value
    np.testing.assert_allclose(mean.linear[mean.valid], wanted[mean.valid], rtol=2.0**-10)
    assert not mean.linear[~mean.valid].any()


@pytest.mark.parametrize("supersampling", [0, 9, 1.5])
def test_supersampling_has_bounds(supersampling):
    with pytest.raises(OpticsError, match=r"supersampling: expected a (whole )?number"):
        OmniCamera(supersampling=supersampling)


@pytest.mark.parametrize("texels_per_pixel", [0.0, 9.0, float("nan")])
def test_texels_per_pixel_have_bounds(texels_per_pixel):
    with pytest.raises(OpticsError, match=r"texels_per_pixel: expected a (finite )?number"):
        OmniCamera(texels_per_pixel=texels_per_pixel)


def test_faces_are_whole_although_a_frame_draws_only_tiles():
    scene = scene_of([room()])
    with open_sensor(scene, OmniCamera().resized(120)) as renderer:
        renderer.render(np.eye(4))
        faces = renderer.faces()
    for pixels in faces.values():
        assert (pixels.max(axis=-1) > 0).all()
