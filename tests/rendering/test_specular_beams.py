"""Lidars and laser scanners in scenes with panes and mirrors, by both back ends."""

import dataclasses
import json

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.datasets.export.recording import read_cloud
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.scene import load_scene
from omnisim.scene.model import Material
from omnisim.sensors import LaserScanner, SpinningLidar
from omnisim.sensors.lidar.point_files import PLAIN_POINT, POINT, write_points
from omnisim.sensors.lidar.spinning_lidar import MAX_PATH_M
from omnisim.validation.reflective_rooms import rooms
from tests.rendering.frames import BACKENDS, each_backend
from tests.scenes import ROOM_HALF_M, room, room_color, scene_of, square, upright

pytest.importorskip("embreex", reason="embreex, which casts the beams, is missing")
pytestmark = pytest.mark.usefixtures("needs_opengl")
LIDAR = dataclasses.replace(
    SpinningLidar.vlp16().without_errors(), firings=90, elevations_deg=(-20.0, 0.0, 10.0),
    range_min_m=0.0,
)  # fmt: skip
SCANNER = dataclasses.replace(
    LaserScanner.lms200(1.0).without_errors(), range_min_m=0.0, range_max_m=LIDAR.range_max_m
)
AT = pose((-1.5, 0.3, 0.1))
PANE, MIRROR = rooms()["thin pane"], rooms()["planar mirror"]
BEHIND_A_PANE = scene_of(
    [room(), upright((1.9, 1.33), 1.0, material=1)],
    [
        Material(double_sided=True),
        Material(roughness=0.0, specular=1.0, transmission=1.0, double_sided=True),
    ],
)


def without_panel(scene):
    """The room without its pane or mirror."""
    return scene.removed("panel")


def cloud_of(scene, lidar=LIDAR, backend="rays", at=AT):
    with open_sensor(scene, lidar, backend=backend) as renderer:
        return renderer.scan(at)


def grid(cloud, name, number=1, empty=np.inf):
    """Values (rings, firings) of the returns with a number."""
    points = cloud.points
    if "return" in points.dtype.names:
        points = points[points["return"] == number]
    values = np.full((cloud.lidar.rings, cloud.lidar.firings), empty)
    firing = np.rint(points["time"] / cloud.lidar.period_s * cloud.lidar.firings).astype(int)
    values[points["ring"], firing] = points[name]
    return values


@each_backend
def test_points_behind_a_pane_are_those_without_it(backend):
    behind = grid(cloud_of(PANE, backend=backend), "range")
    np.testing.assert_allclose(behind, grid(cloud_of(without_panel(PANE)), "range"), atol=1e-3)
    stops = grid(cloud_of(PANE, dataclasses.replace(LIDAR, specular=False), backend), "range")
    assert np.sum(behind - stops > 0.1) > 20


@each_backend
def test_points_behind_a_mirror_are_ghosts_of_the_room(backend):
    cloud = cloud_of(MIRROR, backend=backend)
    free = grid(cloud_of(MIRROR, dataclasses.replace(LIDAR, specular=False)), "range")
    ranges, instances = grid(cloud, "range"), grid(cloud, "instance")
    seen = np.isfinite(ranges) & (ranges > free + 0.1)
    assert seen.sum() > 10
    # the mirrored points, moved back, are on walls or the post
    panel = next(mesh for mesh in MIRROR.meshes if mesh.name == "panel")
    corners = panel.positions.astype(np.float64)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    rings, firings = np.nonzero(seen)
    ghosts = ranges[seen, None] * LIDAR.beams.directions[rings, firings] + AT[:3, 3]
    real = ghosts - 2.0 * ((ghosts - corners[0]) @ normal)[:, None] * normal
    on_wall = np.isclose(np.abs(real), (3.0, 2.5, 1.5), atol=1e-3).any(axis=1)
    names = [instance.name for instance in MIRROR.instances]
    is_post = instances[seen] == 1 + names.index("post")
    assert (on_wall | is_post).all()
    assert on_wall.sum() > 10


@each_backend
def test_two_returns_of_a_pane(backend, tmp_path):
    """A perpendicular beam returns from the glass and from the wall, others from the wall."""
    lidar = dataclasses.replace(LIDAR, returns=2, min_intensity=0.01)
    cloud = cloud_of(BEHIND_A_PANE, lidar, backend, np.eye(4))
    ahead = LIDAR.firings // 2
    np.testing.assert_allclose(
        [grid(cloud, "range", number)[1, ahead] for number in (1, 2)], [1.0, 3.0], atol=1e-4
    )  # the wall behind the lidar, by the glass, is too faint
    inner = grid(cloud, "range")[1, ahead - 6]
    assert inner == pytest.approx(3.0 / np.cos(np.radians(24.0)), abs=1e-4)
    for suffix in (".ply", ".pcd"):
        path = tmp_path / f"cloud{suffix}"
        cloud.save(path)
        stored = read_cloud(path)
        np.testing.assert_array_equal(stored.points, cloud.points)
        assert stored.points.dtype == POINT
        np.testing.assert_array_equal(
            stored.reflectances, np.minimum(cloud.points["intensity"], 1.0)
        )
        assert stored.header.value("returns") == 2


@each_backend
def test_objects_behind_a_pane_are_where_a_slice_s_middle_has_them(backend):
    """A plate recedes at 2 m/s behind a pane: it moves 1 cm within a slice at most."""
    plate = scene_of([upright((1.9, 1.33))], [Material(double_sided=True)])

    def world(time_s):
        return WorldState({"body": np.eye(4), "plate": pose((1.5 + 2.0 * time_s, 0.0, 0.0))})

    lidar = dataclasses.replace(LIDAR, elevations_deg=(0.0,))
    with (
        Stage(BEHIND_A_PANE, dynamic_objects={"plate": plate}, backend=backend) as stage,
        stage.open(lidar) as renderer,
    ):
        cloud = renderer.scan(world, time_s=0.1)
    # the perpendicular beam returns from the pane
    azimuths_rad = np.abs(cloud.points["azimuth"])
    ahead = (azimuths_rad > 0.01) & (azimuths_rad < 0.3)
    times_s = cloud.points["time"][ahead]
    errors_m = cloud.points["x"][ahead] - (1.5 + 2.0 * times_s)
    assert ahead.sum() > 5
    assert np.abs(errors_m).max() < 0.5 * MAX_PATH_M + 1e-4


@each_backend
def test_scans_pass_panes_and_return_from_mirrors(backend):
    for scene in (PANE, MIRROR):
        with open_sensor(scene, SCANNER, backend=backend) as renderer:
            ranges_m = renderer.scan(AT).ranges_m
        lidar = dataclasses.replace(LIDAR, elevations_deg=(0.0,), firings=360)
        around = grid(cloud_of(scene, lidar), "range")[0]
        # the lidar turns clockwise from behind
        np.testing.assert_allclose(ranges_m, around[270:89:-1], atol=1e-3)


def test_a_mirror_that_is_added_later_is_followed():
    with Stage(without_panel(MIRROR)) as stage, stage.open(LIDAR) as renderer:
        plain = renderer.scan(AT)
        stage.scene = MIRROR
        ghosts = renderer.scan(AT)
        stage.scene = without_panel(MIRROR)
        again = renderer.scan(AT)
    assert not np.array_equal(ghosts.points["range"], plain.points["range"])
    np.testing.assert_array_equal(plain.points, again.points)


@each_backend
def test_walls_return_their_red_by_the_cosine_at_any_range(backend):
    walls = Material(base_color=(0.4, 0.9, 0.9, 1.0), double_sided=True)
    at = pose((0.7, -0.4, 0.3), yaw_deg=20.0, roll_deg=5.0)
    points = cloud_of(scene_of([room()], [walls]), LIDAR, backend, at).points
    local = np.stack([points[axis] for axis in "xyz"], axis=1).astype(np.float64)
    rays = local @ at[:3, :3].T
    places = rays + at[:3, 3]
    gaps_m = ROOM_HALF_M - np.abs(places)  # distances to the walls along each axis
    ranges_m = np.linalg.norm(rays, axis=1)
    cosines = np.abs(rays / ranges_m[:, None])[np.arange(len(rays)), gaps_m.argmin(axis=1)]
    inside = np.sort(gaps_m, axis=1)[:, 1] > 0.01  # not at an edge of the room
    assert inside.sum() > 0.9 * LIDAR.rings * LIDAR.firings
    expected = 0.4 * room_color(places)[:, 0] * cosines
    np.testing.assert_allclose(points["intensity"][inside], expected[inside], rtol=1e-4)
    assert set(points["return"]) == {1}


@pytest.mark.parametrize("scene", ["mapping", pytest.param("arcade", marks=pytest.mark.slow)])
def test_both_back_ends_return_the_same_intensities(scene):
    """Textures, vertex colors, gloss and instances of several meshes; a robot's body moves by."""
    lidar = dataclasses.replace(LIDAR, specular=False)
    body = scene_of([square(half_m=0.5)], [Material(base_color=(0.7, 0, 0, 1), double_sided=True)])
    clouds = []
    start = load_scene(scene).start

    def world(time_s):
        base = pose(start.position_m, yaw_deg=start.yaw_deg)
        moved = base @ pose((1.5, 4.0 * time_s, 0.0), pitch_deg=60.0, yaw_deg=900.0 * time_s)
        return WorldState({"body": base, "plate": moved})

    for backend in BACKENDS:
        with (
            Stage(load_scene(scene), dynamic_objects={"plate": body}, backend=backend) as stage,
            stage.open(lidar) as renderer,
        ):
            clouds.append(renderer.scan(world, time_s=0.1))
    ranges, instances, intensities = (
        [grid(cloud, name, empty=0.0) for cloud in clouds]
        for name in ("range", "instance", "intensity")
    )
    same = (instances[0] == instances[1]) & np.isclose(*ranges, rtol=0.0, atol=1e-3)
    assert same.mean() > 0.97
    assert len(np.unique(np.round(intensities[0][same], 3))) > 50
    off = np.abs(intensities[0] - intensities[1])[same]
    assert np.quantile(off, 0.99) < 1e-4
    plate = same & (instances[0] == instances[0].max())
    assert plate.sum() > 10
    assert intensities[0][plate].max() <= 0.7
    assert np.ptp(intensities[0][plate]) > 0.1


def test_clouds_of_older_runs_are_read_without_intensities(tmp_path):
    points = np.zeros(3, dtype=PLAIN_POINT)
    points["range"] = 1.0, 2.0, 3.0
    for suffix in (".ply", ".pcd"):
        write_points(tmp_path / f"old{suffix}", points, np.eye(4), {"omnisim": "0.1"})
        stored = read_cloud(tmp_path / f"old{suffix}")
        np.testing.assert_array_equal(stored.points, points)
        np.testing.assert_array_equal(stored.reflectances, 0.0)


@each_backend
def test_files_of_matte_scenes_are_as_without_the_keys(backend, tmp_path):
    scene = scene_of([room()])
    for index, lidar in enumerate((LIDAR, dataclasses.replace(LIDAR, specular=False))):
        cloud_of(scene, lidar, backend, AT).save(tmp_path / f"{index}.ply")
    files = [(tmp_path / f"{index}.ply").read_bytes() for index in (0, 1)]
    assert files[0] == files[1].replace(b"comment specular: false\n", b"")
    assert b"property float intensity\nproperty ushort return\n" in files[0]
    with open_sensor(scene, SCANNER, backend=backend) as renderer:
        renderer.scan(AT).save_csv(tmp_path / "scan.csv")
    comments = [
        line[2:].split(": ", 1)
        for line in (tmp_path / "scan.csv").read_text(encoding="utf-8").splitlines()
        if line.startswith("#")
    ]
    keys = {key: json.loads(value) for key, value in comments}
    assert not {"specular", "min_intensity"} & keys.keys()
