"""Colors, faces and metadata of images of small scenes, and what renderers refuse."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.coordinate_frames import RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.cube import unfolded_cube
from omnisim.core.errors import GraphicsError, OmnisimError
from omnisim.core.poses import pose as make_pose
from omnisim.core.srgb import linear_from_srgb, srgb_from_linear
from omnisim.rendering.camera.degradations import Degradation, Noise
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl import gpu_textures
from omnisim.rendering.stage import open_sensor
from omnisim.scene.model import AlphaMode, Lighting, Material, Mesh, Texture, Wrap
from tests.rendering.frames import frame_of
from tests.scenes import room, scene_of, square

pytestmark = pytest.mark.usefixtures("needs_opengl")
RED, GREEN, BLUE = np.eye(3)
SMALL = OmniCamera(polygons=None).resized(91)


def quad(z_m, half_m=5.0, **options):
    return square(half_m, z_m, name=f"quad at {z_m}", **options)


def material(color, alpha=1.0, **options):
    return Material(base_color=(*color, alpha), **options)


def glass(color, alpha):
    return material(color, alpha, alpha_mode=AlphaMode.BLEND)


def assert_below(meshes, materials, color, atol=2e-3, **options):
    """The linear color straight below the viewpoint."""
    frame = frame_of(scene_of(meshes, materials, **options), SMALL, np.eye(4), linear=True)
    np.testing.assert_allclose(frame.linear[45, 45], color, atol=atol)


def test_directions_of_the_image():
    """+x is up, +y on the right, as in every image of a camera that looks up at its mirror."""
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
    materials = [material(color) for color in (RED, GREEN, BLUE, RED + GREEN)]
    sensor = OmniCamera(polygons=None)
    with open_sensor(scene_of(meshes, materials, poses), sensor) as renderer:
        ahead = renderer.render(np.eye(4)).rgb
        turned = renderer.render(sensor.base_pose((0, 0, 0), yaw_deg=90.0)).rgb
    middle, near, far = 180, 40, 319
    places = (near, middle), (middle, far), (far, middle), (middle, near)
    assert [ahead[at].tolist() for at in places] == [
        [255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0]
    ]  # fmt: skip
    # a vehicle that has turned left sees +y ahead, and -x on its left: the right of the image
    assert turned[near, middle].tolist() == [0, 255, 0]
    assert turned[middle, far].tolist() == [0, 0, 255]


def test_back_faces_are_culled_unless_double_sided():
    red = [material(RED)]
    assert_below([quad(-1.0)], red, RED)
    assert_below([quad(-1.0)], red, RED, poses=[np.diag([-1.0, 1.0, 1.0, 1.0])])  # mirrored
    turned = Mesh("t", quad(-1.0).positions, quad(-1.0).triangles[:, ::-1].copy(), 0)
    assert_below([turned], red, 0.0)
    assert_below([turned], [material(RED, double_sided=True)], RED)
    assert_below([quad(9.0)], red, (0.1, 0.2, 0.3), background=(0.1, 0.2, 0.3))


@pytest.mark.parametrize(("cutoff", "color"), [(0.5, BLUE), (0.3, RED)])
def test_alpha_mask(cutoff, color):
    mask = material(RED, 0.4, alpha_mode=AlphaMode.MASK, alpha_cutoff=cutoff)
    assert_below([quad(-1.0), quad(-2.0, material=1)], [mask, material(BLUE)], color)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_blended_panes_are_drawn_back_to_front(order):
    panes = [glass(RED, 0.25), glass(GREEN, 0.5), material(BLUE)]
    meshes = [quad(-1.0, material=0), quad(-2.0, material=1)]
    expected = 0.25 * RED + 0.75 * (0.5 * GREEN + 0.5 * BLUE)
    assert_below([*(meshes[i] for i in order), quad(-3.0, material=2)], panes, expected)


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
    half = dataclasses.replace(glass((1, 1, 1), 0.5), double_sided=True)
    upright, overhead = np.eye(4), np.diag([1.0, -1.0, -1.0, 1.0])
    upright[2, 3], overhead[2, 3] = -3.0, -3.0
    assert_below([mesh], [half], 0.5 * RED + 0.25 * GREEN, poses=[upright])  # red is nearer
    assert_below([mesh], [half], 0.25 * RED + 0.5 * GREEN, poses=[overhead])
    overhead[2, 3] = -9.0
    behind = 0.5 * GREEN + 0.25 * RED + 0.25 * BLUE
    assert_below(
        [mesh, mesh, quad(-20.0, half_m=50.0, material=1)],
        [half, material(BLUE)],
        0.5 * RED + 0.25 * GREEN + 0.25 * behind,
        poses=[upright, overhead, np.eye(4)],
    )


def test_blended_surfaces_write_no_depth():
    """The middle of the large pane is farther away, so it is drawn first, in front as it is."""
    large = quad(-1.0, half_m=3.0)
    aside = Mesh("aside", large.positions + np.array([2.5, 0, 0], np.float32), large.triangles, 0)
    assert_below([aside, quad(-1.5, half_m=0.5)], [glass(RED, 0.5)], 0.75 * RED)


def test_unlit_material_is_its_color_in_any_light():
    plain, color = Lighting((0.0, 0.0, 0.0), ()), (0.25, 0.5, 1.0)
    assert_below([quad(-1.0)], [material(color, unlit=True)], color, lighting=plain)


def test_near_and_far_planes_clip():
    sensor = dataclasses.replace(SMALL, near_m=0.5, far_m=2.0)
    for distance_m, seen in ((0.49, False), (0.51, True), (1.99, True), (2.01, False)):
        red = frame_of(scene_of([quad(-distance_m)], [material(RED)]), sensor, np.eye(4)).rgb
        assert (red[45, 45, 0] > 0) == seen, distance_m


@pytest.mark.parametrize(("distance_m", "gap_m"), [(50, 0.01), (10_000, 1.0)])
def test_far_surfaces_do_not_shine_through_each_other(distance_m, gap_m):
    half_m = 2.0 * distance_m
    meshes = [quad(0.0, half_m), quad(-gap_m, half_m, material=1)]
    tilt = make_pose((0.0, 0.0, -distance_m), roll_deg=7.0, pitch_deg=11.0)
    scene = scene_of(meshes, [material(GREEN), material(RED)], [tilt] * 2)
    rgb = frame_of(scene, OmniCamera(polygons=None, samples=1), np.eye(4)).rgb
    assert (rgb[..., 1] > 0).sum() > 10_000
    assert not rgb[..., 0].any()


@pytest.mark.parametrize("wrap", [Wrap.REPEAT, Wrap.CLAMP_TO_EDGE])
def test_textures_are_upright_and_wrap(wrap):
    """Four colors, the first row of the image at v = 0; beyond the edges by `wrap`."""
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], dtype=np.uint8)
    pixels = np.concatenate((pixels, np.full((2, 2, 1), 255, np.uint8)), axis=-1)
    pixels = pixels.repeat(64, axis=0).repeat(64, axis=1)
    # u runs along +x and v along −y, a texture in 4 m, from the viewpoint's foot
    coordinates = quad(0.0).positions[:, :2] * np.array([0.25, -0.25], np.float32)
    mesh = quad(-1.0, texture_coordinates=coordinates)
    sensor = OmniCamera(polygons=None, samples=1).resized(361)
    scene = scene_of([mesh], [Material(texture=Texture(pixels, wrap, wrap))])
    rgb = frame_of(scene, sensor, np.eye(4)).rgb.astype(int)

    def at(x, y):  # a point of the floor
        direction = RIG_FROM_OPTICAL_LOOKING_UP.T @ (x, y, -1.0)
        u, v = np.rint(sensor.model.pixel_from_ray(direction).positions_px).astype(int)
        return tuple(np.rint(rgb[v, u] / 255.0).astype(int).tolist())

    assert at(1.0, -1.0) == (1, 0, 0)  # u = v = 0.25
    assert at(3.0, -1.0) == (0, 1, 0)  # u = 0.75
    assert at(1.0, -3.0) == (0, 0, 1)  # v = 0.75
    assert at(3.0, -3.0) == (1, 1, 1)
    assert at(-1.0, -1.0) == ((0, 1, 0) if wrap is Wrap.REPEAT else (1, 0, 0))  # u = −0.25


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
        ({"supersampling": 0}, "supersampling: expected a number ≥ 1"),
        ({"supersampling": 9}, "supersampling: expected a number ≤ 8"),
        ({"supersampling": 1.5}, "supersampling: expected a whole number"),
        ({"texels_per_pixel": 0.0}, "texels_per_pixel: expected a number"),
        ({"texels_per_pixel": 9.0}, "texels_per_pixel: expected a number"),
    ],
)
def test_impossible_sensors_are_refused(options, words):
    with pytest.raises(OmnisimError, match=words):
        OmniCamera(**options)


def test_images_and_faces_may_be_written_to_and_matrices_that_are_no_poses_are_refused():
    with open_sensor(scene_of([room()]), OmniCamera().resized(60)) as renderer:
        with pytest.raises(GraphicsError, match="render a frame first"):
            renderer.faces()
        frame = renderer.render(np.eye(4), linear=True)
        frame.rgb[0, 0] = 1
        frame.linear[0, 0] = 1.0
        renderer.faces()["front"][0, 0] = 1
        for matrix in (np.eye(3), np.diag([2.0, 2, 2, 1]), np.diag([1.0, 1, -1, 1])):
            with pytest.raises(OmnisimError, match="pose: expected"):
                renderer.render(matrix)


def test_linear_and_encoded_image_agree():
    with open_sensor(scene_of([room()]), OmniCamera().resized(120)) as renderer:
        frame = renderer.render(np.eye(4), linear=True)
        assert renderer.render(np.eye(4)).linear is None
    expected = 255.0 * srgb_from_linear(frame.linear)
    # half floats hold 11 bits; the GPU's power function and rounding take the rest
    assert np.abs(frame.rgb[frame.valid] - expected[frame.valid]).max() <= 0.75
    assert frame.linear.dtype == np.float32
    values = np.linspace(0.0, 1.0, 1001)
    np.testing.assert_allclose(linear_from_srgb(srgb_from_linear(values)), values, atol=1e-7)


def test_faces_are_whole_and_their_unfolding_has_borders():
    with open_sensor(scene_of([room()]), OmniCamera(face_size_px=64)) as renderer:
        renderer.render(np.eye(4))
        faces = renderer.faces()
    assert list(faces) == ["front", "left", "back", "right", "down"]
    for pixels in faces.values():  # although a frame draws only tiles
        assert pixels.shape == (64, 64, 3)
        assert (pixels.max(axis=-1) > 0).all()
    # neighbors meet: the last column of front is the first of right, but for half a pixel
    assert np.abs(faces["front"][:, -1].astype(int) - faces["right"][:, 0]).max() <= 4
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
        with pytest.raises(GraphicsError, match="ground truth of 40 × 40 px: this GPU takes no"):
            frame_of(scene_of([room()]), OmniCamera().resized(40), np.eye(4), also=("range",))
    with pytest.raises(GraphicsError, match="device 99: there is no such device"):
        open_sensor(scene_of([room()]), device=99)


def test_metadata_describes_camera_and_pose():
    sensor = OmniCamera().resized(60)
    world_from_base = make_pose((1.0, 0.5, 0.0), yaw_deg=30.0)
    metadata = frame_of(scene_of([room()]), sensor, world_from_base).metadata
    assert metadata["camera"]["k"] == 11.546
    assert metadata["camera"]["focal_length_px"] == sensor.model.focal_length_px
    assert metadata["polygons"] == sensor.mesh_polygons
    world_from_optical = np.array(metadata["world_from_optical"])
    np.testing.assert_allclose(world_from_optical[:3, 3], (1.0, 0.5, 0.0))
    # the optical axis looks up, and the top of the image ahead
    np.testing.assert_allclose(world_from_optical[:3, 2], (0, 0, 1), atol=1e-15)
    ahead = (np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0)
    np.testing.assert_allclose(-world_from_optical[:3, 1], ahead, atol=1e-15)


def test_an_optical_pose_is_that_of_the_vehicle_whose_camera_is_there():
    base = make_pose((0.2, -0.1, 0.4), roll_deg=5.0, pitch_deg=-10.0, yaw_deg=30.0)
    with open_sensor(scene_of([room()]), OmniCamera().resized(40)) as renderer:
        optical = base @ renderer.camera.base_from_optical
        by_base, by_camera = renderer.render(base), renderer.render(optical=optical)
        for (state, other), got in (((None, None), "neither"), ((base, base), "both")):
            with pytest.raises(OmnisimError, match=f"expected either state or optical, got {got}"):
                renderer.render(state, optical=other)
        with pytest.raises(OmnisimError, match="expected"):
            renderer.render(optical=2.0 * np.eye(4))
    np.testing.assert_allclose(by_camera.metadata["world_from_optical"], optical, atol=1e-12)
    np.testing.assert_allclose(by_camera.metadata["world_from_base"], base, atol=1e-12)
    assert np.abs(by_base.rgb.astype(int) - by_camera.rgb).max() <= 1  # poses differ by rounding
    with pytest.raises(KeyError, match=r"range: not rendered: pass also=\('range',\) to render"):
        by_base.channels["range"]
    with pytest.raises(KeyError, match="rangs: there is no such channel; did you mean 'range'"):
        by_base.channels["rangs"]
    assert by_base.channels.get("range") is None


@pytest.mark.parametrize("polygons", [None, 64])
def test_supersampling_is_the_mean_of_a_finer_image(polygons):
    """Three samples to a side of a pixel, or an image three times as large: the same light."""
    # so few texels that neither asks for mip levels, which differ between one sample and many
    camera = OmniCamera(polygons=polygons, face_size_px=48)
    coarse = dataclasses.replace(camera, supersampling=3).resized(120)
    fine = dataclasses.replace(camera, supersampling=1).resized(360)
    mean, blocks = (
        frame_of(scene_of([room()]), one, np.eye(4), linear=True) for one in (coarse, fine)
    )
    colors = blocks.linear.reshape(120, 3, 120, 3, 3)
    covered = blocks.valid.reshape(120, 3, 120, 3).sum(axis=(1, 3))
    np.testing.assert_array_equal(mean.valid, covered >= 4.5)
    wanted = colors.sum(axis=(1, 3)) / np.maximum(covered, 1)[..., None]
    # half floats: 2⁻¹¹ of the value
    np.testing.assert_allclose(mean.linear[mean.valid], wanted[mean.valid], rtol=2.0**-10)
    assert not mean.linear[~mean.valid].any()
