"""Slabs of glass: recognized as panes of a thickness, and drawn and measured as such."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.rendering.stage import open_sensor
from omnisim.scene.model import DynamicObject, Material, Mesh
from omnisim.scene.motion.object_motion import Rest
from omnisim.scene.slabs import normal_of_slabs
from omnisim.scene.surface_kind import SurfaceKind, kind_of, pane_transmission, transmitted
from omnisim.sensors import SpinningLidar
from omnisim.validation import reflective_rooms
from omnisim.validation.image_differences import psnr_of_levels_db
from omnisim.validation.material_chart import sphere
from tests.rendering.rays.test_panes import reflected_by_pane
from tests.scenes import room, scene_of
from tests.vehicles import box, scaled

GLASS = Material(
    base_color=(0.9, 0.95, 1.0, 1.0), roughness=0.0, specular=1.0, transmission=1.0,
    thickness_m=0.01, attenuation_color=(0.5, 0.9, 0.8), attenuation_distance_m=0.02,
)  # fmt: skip
BACKENDS = ["cube", "rays"]
LIDAR = dataclasses.replace(
    SpinningLidar.vlp16().without_errors(), firings=60, elevations_deg=(-20.0, 7.0),
    range_min_m=0.0,
)  # fmt: skip


def slab(size_m, center_m=(0.0, 0.0, 0.0), material=0):
    """Box of sizes (3,) without texture coordinates."""
    mesh = box("slab", material)
    positions = mesh.positions * np.array(size_m) + center_m
    return dataclasses.replace(
        mesh, positions=positions.astype(np.float32), texture_coordinates=None
    )


def joined(*meshes):
    """Mesh of several."""
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    triangles = [mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)]
    positions = np.concatenate([mesh.positions for mesh in meshes])
    return Mesh("joined", positions, np.concatenate(triangles).astype(np.uint32), 0)


WINDOW = slab((1.0, 0.006, 2.0))
# views of a slab whose rim is seen, and of one that is grazed
HARSH = pose((0.7, 0.2, 1.35), yaw_deg=20.0, pitch_deg=60.0), pose((0.4, -1.8, 0.3), yaw_deg=70.0)
TURNED = pose((1.0, 2.0, 3.0), roll_deg=30.0, pitch_deg=20.0, yaw_deg=10.0)


def is_slab(material):
    return SurfaceKind.SLAB in kind_of(material)


@pytest.mark.parametrize(
    ("mesh", "place", "slab_m"),
    [
        (WINDOW, np.eye(4), 0.006),
        (WINDOW, scaled(TURNED, 1.0, 2.0, -0.5), 0.012),
        (joined(WINDOW, slab((0.5, 0.006, 0.5), (2.0, 0.3, 0.0))), TURNED, 0.006),
        (slab((2.0, 1.5, 0.1)), np.eye(4), 0.1),
        (joined(WINDOW, slab((0.5, 0.009, 0.5), (2.0, 0.0, 0.0))), np.eye(4), None),
        (joined(WINDOW, slab((0.3, 0.3, 0.3), (2.0, 0.0, 0.0))), np.eye(4), None),
        (slab((0.5, 0.4, 0.3)), np.eye(4), None),
        (dataclasses.replace(WINDOW, triangles=WINDOW.triangles[:, ::-1]), np.eye(4), 0.006),
        (sphere(1.0, 8), np.eye(4), None),
    ],
)
def test_two_parallel_faces_that_look_away_from_each_other_are_a_pane(mesh, place, slab_m):
    inside_out = np.array_equal(mesh.triangles, WINDOW.triangles[:, ::-1])
    mesh = dataclasses.replace(mesh, material=0)
    (material,) = scene_of([mesh], [GLASS], [place]).materials
    if slab_m is None or inside_out:
        assert material is GLASS
    else:
        assert is_slab(material)
        assert pane_transmission(material) == pytest.approx(1.0)
        assert transmitted(material, SurfaceKind.GLASS) == 0.0
        assert material.slab_m == pytest.approx(slab_m, rel=1e-3)
        depths = -np.log(GLASS.attenuation_color) * slab_m / 0.02
        np.testing.assert_allclose(material.optical_depths, depths, rtol=1e-3, atol=1e-9)


def test_bodies_of_the_same_material_stay_bodies():
    scene = scene_of([WINDOW, sphere(1.0, 8)], [GLASS])
    assert [is_slab(scene.materials[mesh.material]) for mesh in scene.meshes] == [True, False]
    moved = scene.added("other", scene_of([WINDOW], [GLASS]), TURNED)
    assert [is_slab(moved.materials[mesh.material]) for mesh in moved.meshes] == [True, False, True]
    thin = dataclasses.replace(moved.materials[moved.meshes[0].material], thickness_m=0.0)
    assert not is_slab(thin)
    assert pane_transmission(thin) == GLASS.transmission
    matte = scene_of([WINDOW], [dataclasses.replace(GLASS, transmission=0.0)])
    assert not is_slab(matte.materials[0])


def _behind_a_slab(glass=True, moves=False):
    """A room with a slab of 10 mm between the origin and a post."""
    post = slab((0.3, 0.3, 3.0), (2.0, 0.4, 0.0), 1)
    window = slab((0.01, 3.0, 2.0), (1.0, 0.0, 0.0))
    walls = [Material(double_sided=True), Material(base_color=(0.8, 0.3, 0.1, 1.0))]
    scene = scene_of([room(), post], walls)
    window = scene_of([window], [GLASS])
    if not glass:
        return scene
    if moves:
        still = DynamicObject("window", window, Rest((0.0, 0.0, 0.0)))
        return dataclasses.replace(scene, objects=(still,))
    return scene.added("window", window)


def _images(camera, at):
    """Images of a slab by both back ends, and the mask of its pixels."""
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    images = []
    for backend in BACKENDS:
        with open_sensor(_behind_a_slab(), camera, backend=backend) as renderer:
            image = renderer.render(at, also=("instance",))
        images.append(image.rgba[..., :3])
    shown = image.channels["instance"] == 3
    return images[0][shown], images[1][shown], shown.mean()


@pytest.mark.parametrize(
    ("at", "size", "share", "least_db"),
    [
        (pose((-0.5, 0.2, 0.0)), (40, 2), 0.1, 36.0),
        (HARSH[0], (60, 3), 0.3, 39.0),
        (HARSH[1], (60, 3), 0.3, 39.0),
    ],
)
def test_the_cube_shows_what_rays_refract(at, size, share, least_db):
    """Measured of the harsh ones: 42.1 and 44.5 dB; 27.9 and 36.0 with a pane's rim and tint."""
    cube, rays, shown = _images(reflective_rooms.camera(*size), at)
    assert shown > share
    assert psnr_of_levels_db(cube, rays) >= least_db


def test_slabs_of_a_mesh_have_a_normal_if_they_are_parallel():
    other = slab((1.0, 0.006, 2.0), (3.0, 1.0, 0.0))
    np.testing.assert_allclose(np.abs(normal_of_slabs(joined(WINDOW, other))), (0, 1, 0))
    across = slab((0.006, 1.0, 2.0), (3.0, 1.0, 0.0))
    assert not normal_of_slabs(joined(WINDOW, across)).any()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("moves", [False, True])
def test_beams_and_depths_pass_a_slab_as_a_pane(backend, moves):
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    at = pose((0.2, 0.1, 0.0), yaw_deg=5.0)
    ranges, through = [], []
    for scene in (_behind_a_slab(moves=moves), _behind_a_slab(glass=False)):
        with open_sensor(scene, LIDAR, backend=backend) as renderer:
            ranges.append(renderer.scan(at).points["range"])
        with open_sensor(scene, reflective_rooms.camera(24, 1), backend=backend) as renderer:
            through.append(renderer.render(at, also=("range_through", "range")).channels)
    np.testing.assert_allclose(*ranges, atol=1e-3)
    np.testing.assert_allclose(through[0]["range_through"], through[1]["range"], atol=1e-3)
    assert np.mean(through[0]["range"] < through[1]["range"] - 0.1) > 0.05


def test_light_of_a_beam_is_left_by_two_faces_and_the_glass_between():
    pytest.importorskip("embreex", reason="embreex, which casts the beams, is missing")
    lidar = dataclasses.replace(LIDAR, firings=8, elevations_deg=(0.0,))
    with open_sensor(_behind_a_slab(), lidar, backend="rays") as renderer:
        points = renderer.scan(pose((0.5, -0.5, 0.2), yaw_deg=-20.0)).points
    slant = np.radians(20.0)
    (ahead,) = points[np.abs(points["azimuth"]) < 0.1]
    inside = np.arcsin(np.sin(slant) / GLASS.ior)
    passed = 1.0 - reflected_by_pane(np.degrees(slant), GLASS.ior)
    passed *= 0.9**2 * 0.5 ** (0.5 / np.cos(inside))
    assert ahead["range"] == pytest.approx(2.5 / np.cos(slant), abs=1e-3)
    assert ahead["intensity"] == pytest.approx(0.9 * np.cos(slant) * passed**2, rel=1e-3)
