"""Scans of scenes: against arithmetic, and against another library's ray casting."""

import dataclasses
import json
import math

import numpy as np
import pytest

from omnisim import LaserScanner, open_sensor
from omnisim.core.errors import GraphicsError, OmnisimError, OutputError
from omnisim.core.poses import pose
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene import load_scene
from omnisim.scene.model import AlphaMode, Material, Mesh, Texture
from tests.ray_casting import RayCaster, opaque_part
from tests.scenes import WAREHOUSE, room, room_hit, scene_of, with_warehouse

pytestmark = pytest.mark.usefixtures("needs_opengl")

# no errors and no limits
EXACT = dataclasses.replace(LaserScanner().without_errors(), range_min_m=0.0, range_max_m=np.inf)
# Room ranges: floats of coordinates up to 4 m (2e-7 m), thrice, at slants of up to 80 degrees.
ROUNDING_M = 4e-6
AHEAD = 180  # beam of `EXACT`


def wall(x_m, half_m=1.0, material=0, **options):
    """A square across the x axis, its front towards the origin, texture upright."""
    corners = [(x_m, half_m, half_m), (x_m, -half_m, half_m)]
    corners += [(x_m, -half_m, -half_m), (x_m, half_m, -half_m)]
    return Mesh(
        f"wall at {x_m}",
        np.array(corners, dtype=np.float32),
        np.array([[0, 2, 1], [0, 3, 2]], dtype=np.uint32),
        material,
        texture_coordinates=np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=np.float32),
        **options,
    )


def scan_of(scene, scanner=EXACT, world_from_scanner=None):
    with open_sensor(scene, scanner) as renderer:
        return renderer.scan(np.eye(4) if world_from_scanner is None else world_from_scanner)


def world_directions(scan):
    angles = scan.angles_rad
    beams = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=-1)
    return beams @ scan.world_from_scanner[:3, :3].T


@pytest.mark.parametrize("field_of_view_deg", [180.0, 360.0])
@pytest.mark.parametrize("offset_m", [(0.0, 0.0, 0.0), (4e5, -3e6, 20.0)])
def test_ranges_in_a_box_are_analytic(field_of_view_deg, offset_m):
    scanner = dataclasses.replace(EXACT, field_of_view_deg=field_of_view_deg)
    world_from_room = pose(offset_m)
    with open_sensor(scene_of([room()], poses=[world_from_room]), scanner) as renderer:
        for yaw_deg in (0.0, 33.0, 200.0):
            room_from_scanner = pose(
                (0.4, -1.1, 0.3), roll_deg=12.0, pitch_deg=-25.0, yaw_deg=yaw_deg
            )
            scan = renderer.scan(world_from_room @ room_from_scanner)
            origin = room_from_scanner[:3, 3]
            expected = np.linalg.norm(room_hit(origin, world_directions(scan)) - origin, axis=-1)
            np.testing.assert_allclose(scan.ranges_m, expected, rtol=0.0, atol=ROUNDING_M)


def test_first_beam_is_the_rightmost():
    scan = scan_of(scene_of([wall(2.0)], poses=[pose((0, 0, 0), yaw_deg=90.0)]))
    assert np.all(np.isposinf(scan.ranges_m[:AHEAD]))  # nothing on the right
    np.testing.assert_allclose(scan.ranges_m[-1], 2.0, atol=ROUNDING_M)
    np.testing.assert_allclose(scan.points_m[-1], (0.0, 2.0, 0.0), atol=ROUNDING_M)
    assert scan.points_m.shape == (scan.hit.sum(), 3)


def test_both_sides_of_a_single_sided_surface_reflect():
    for yaw_deg in (0.0, 180.0):
        at = pose((2.0, 0.0, 0.0), yaw_deg=yaw_deg)
        scan = scan_of(scene_of([wall(0.0)], [Material()], [at]))
        assert scan.ranges_m[AHEAD] == pytest.approx(2.0, abs=ROUNDING_M)


def test_each_surface_has_its_own_holes():
    """Layers of one texture array, a texture of another size, none, and what is opaque."""
    fences = []
    for column, size in ((0, 4), (1, 4), (2, 4), (3, 8), (None, 4)):
        pixels = np.full((size, size, 4), 255, dtype=np.uint8)
        if column is not None:  # an eighth of the wall is left, from left to right
            pixels[..., 3] = 0
            pixels[:, column * size // 4, 3] = 255
        fences.append(Material(texture=Texture(pixels), alpha_mode=AlphaMode.MASK))
    glass = Material(base_color=(1.0, 1.0, 1.0, 0.3), alpha_mode=AlphaMode.MASK)
    walls = [wall(2.0 + 0.1 * number, material=number) for number in range(4)]
    walls += [wall(1.5, material=5), wall(3.0, half_m=9.0, material=6)]
    with open_sensor(scene_of(walls, [*fences, glass, Material()]), EXACT) as renderer:
        for pose_m in ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0)):
            scan = renderer.scan(pose(pose_m))
            x_m = scan.ranges_m * np.cos(scan.angles_rad)
            for number in range(4):
                distance_m = 2.0 + 0.1 * number - pose_m[0]
                left_m = 0.9 - 0.5 * number  # in a part of the wall
                beam = AHEAD + round(math.degrees(math.atan2(left_m, distance_m)) * 2)
                assert x_m[beam] == pytest.approx(distance_m, abs=ROUNDING_M)


@pytest.mark.parametrize(
    ("alpha", "mode", "stops"),
    [
        (0.3, AlphaMode.OPAQUE, True),
        (0.3, AlphaMode.MASK, False),
        (0.7, AlphaMode.MASK, True),
        (0.3, AlphaMode.BLEND, False),  # glass
        (0.7, AlphaMode.BLEND, True),
    ],
)
def test_alpha_modes_that_stop_a_beam(alpha, mode, stops):
    in_the_material = Material(base_color=(1.0, 1.0, 1.0, alpha), alpha_mode=mode)
    in_the_vertices = np.ones((4, 4), dtype=np.float32)
    in_the_vertices[:, 3] = alpha
    for pane, material in (
        (wall(2.0), in_the_material),
        (wall(2.0, colors=in_the_vertices), Material(alpha_mode=mode)),
    ):
        scan = scan_of(scene_of([pane, wall(3.0, material=1)], [material, Material()]))
        expected = 2.0 if stops else 3.0
        assert scan.ranges_m[AHEAD] == pytest.approx(expected, abs=ROUNDING_M)


def test_beams_hit_shared_edges():
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=5, radius=2.0)
    mesh = Mesh("ball", ball.vertices.astype("f4"), ball.faces.astype("u4"), 0)
    scanner = dataclasses.replace(EXACT, field_of_view_deg=360.0, resolution_deg=0.05)
    generator = np.random.default_rng(4)
    with open_sensor(scene_of([mesh]), scanner) as renderer:
        # level ones run along the ball's own symmetry: through corners and along edges
        angles_deg = ((0, 0, 0), (90, 0, 0), *generator.uniform(-180, 180, (6, 3)))
        for roll_deg, pitch_deg, yaw_deg in angles_deg:
            at = pose(roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg)
            scan = renderer.scan(at)
            assert scan.ranges_m.max() <= 2.0 + ROUNDING_M
            assert scan.ranges_m.min() > 1.99


def test_many_triangles_take_several_rows_of_work_groups(monkeypatch):
    scene = load_scene("rings")
    at = pose(scene.start.position_m, roll_deg=20.0, pitch_deg=30.0, yaw_deg=40.0)
    expected = scan_of(scene, EXACT, at)
    monkeypatch.setattr("omnisim.rendering.opengl.hits.range_pass._MAX_GROUPS", 7)
    np.testing.assert_array_equal(scan_of(scene, EXACT, at).ranges_m, expected.ranges_m)


@pytest.mark.parametrize("count", [1, 33, 256, 513])
def test_the_last_triangle_counts(count):
    mesh = wall(2.0)
    flat = np.zeros((count - 1, 3), dtype=np.uint32)
    mesh = dataclasses.replace(mesh, triangles=np.concatenate((flat, mesh.triangles[:1])))
    scan = scan_of(scene_of([mesh]))
    right = AHEAD - 20  # 10 degrees
    assert scan.points_m[0, 0] == pytest.approx(2.0, abs=ROUNDING_M)
    assert scan.hit[right]


def test_scenes_past_the_limit_of_the_gpu_are_refused(context, monkeypatch):
    from types import SimpleNamespace

    from omnisim.rendering.opengl.hits.range_pass import RangePass

    small = SimpleNamespace(info={"GL_MAX_SHADER_STORAGE_BLOCK_SIZE": 100})
    buffers = SceneBuffers(context, scene_of([room()]))
    monkeypatch.setattr(buffers, "context", small)
    with pytest.raises(GraphicsError, match="320 bytes: this GPU allows 192 to scan them"):
        RangePass(buffers, np.zeros(1))


def test_noisy_scan_is_rounded_and_repeatable():
    single = dataclasses.replace(EXACT, field_of_view_deg=0.5, resolution_deg=1.0)
    assert scan_of(scene_of([room()]), single).ranges_m == pytest.approx([3.0], abs=1e-4)
    scene, at = scene_of([room()]), pose((0.5, 0.2, 0.0))
    true_m = scan_of(scene, EXACT, at).ranges_m
    with open_sensor(scene, LaserScanner()) as renderer:
        scans = [renderer.scan(at, number) for number in (0, 1, 1)]
    np.testing.assert_array_equal(scans[1].ranges_m, scans[2].ranges_m)
    assert np.any(scans[0].ranges_m != scans[1].ranges_m)
    np.testing.assert_array_equal(scans[0].ranges_m, LaserScanner().measure(true_m, 0))
    assert scans[1].metadata["scan_number"] == 1


def test_scan_file_round_trip(tmp_path):
    scene = scene_of([wall(2.0), wall(0.05, half_m=0.01)])
    scanner = LaserScanner.lms200(1.0, seed=9)
    scan = scan_of(scene, scanner, pose((0.0, 0.0, 0.005), yaw_deg=10.0))
    path = tmp_path / "scan.csv"
    scan.save_csv(path)
    lines = path.read_text(encoding="utf-8").splitlines()
    comments = dict(line[2:].split(": ", 1) for line in lines if line.startswith("#"))
    header = {key: json.loads(value) for key, value in comments.items()}
    assert header["scene"] == "test"
    assert header["scan_number"] == 0
    stated = dataclasses.asdict(scanner).keys() - {"specular", "min_intensity"}
    parameters = {key: header[key] for key in stated}
    assert LaserScanner(**parameters) == scanner
    np.testing.assert_array_equal(header["world_from_scanner"], scan.world_from_scanner)
    assert lines[len(comments)] == "beam,angle_deg,range_m"
    beams, angles_deg, ranges_m = np.loadtxt(path, delimiter=",", skiprows=len(comments) + 1).T
    np.testing.assert_array_equal(beams, np.arange(181))
    np.testing.assert_allclose(angles_deg, np.arange(-90, 91), atol=1e-6)
    np.testing.assert_allclose(ranges_m, scan.ranges_m, atol=1e-6)
    for kind in (np.isposinf, np.isneginf, np.isfinite):
        assert kind(ranges_m).any()
    with pytest.raises(OutputError, match="cannot be written"):
        scan.save_csv(path / "scan.csv")
    assert [file.name for file in tmp_path.iterdir()] == ["scan.csv"]


def test_invalid_arguments_are_refused():
    renderer = open_sensor(scene_of([room()]), LaserScanner())
    with pytest.raises(OmnisimError, match="expected a rotation and a translation"):
        renderer.scan(2.0 * np.eye(4))
    with pytest.raises(OmnisimError, match=r"scan_number: expected .*, got 0\.5"):
        renderer.scan(np.eye(4), 0.5)
    renderer.close()
    renderer.close()
    with pytest.raises(GraphicsError, match="closed"):
        renderer.scan(np.eye(4))


# Where to stand in scenes to compare in, from and to, in meters.
COMPARED = {
    WAREHOUSE: ((-6.0, -9.0, 0.2), (6.0, 9.0, 2.0)),
    "courtyard": ((-9.0, -9.0, 0.2), (9.0, 9.0, 2.0)),
    "soccer": ((-5.5, -4.0, 0.2), (5.5, 4.0, 2.0)),
    "mapping": ((-3.5, -8.5, 0.2), (10.5, 12.5, 2.0)),
}
POSES = 20
NEAREST_M = 0.25  # that the scanner may come to a surface
# A tenth of 2 mm or 0.05 %, which would do; measured: less than 0.1 mm, and less than 1 µm for half
# of the beams.
TOLERANCE_M, TOLERANCE_SHARE = 2e-4, 5e-5
# How far from a silhouette two answers may differ: Embree works in float32 on a scene scaled to
# 100 units, the GPU in float32 from the scanner; at 1 m that is some 1e-5 rad each.
SILHOUETTE_RAD = 3e-5


def free_poses(caster, low, high, generator):
    """Random poses in free space; every second one is rolled and pitched."""
    around = generator.standard_normal((200, 3))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    poses = []
    while len(poses) < POSES:
        at = generator.uniform(low, high)
        if caster.ranges(at, around).min() > NEAREST_M:
            roll_deg, pitch_deg = generator.uniform(-20.0, 20.0, 2) * (len(poses) % 2)
            yaw_deg = generator.uniform(-180.0, 180.0)
            poses.append(pose(at, roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg))
    return poses


def is_close(ranges, expected):
    """Within tolerance, or both out of range."""
    both = np.isposinf(ranges) & np.isposinf(expected)
    finite = np.isfinite(ranges) & np.isfinite(expected)
    close = both.copy()
    off = np.abs(ranges[finite] - expected[finite])
    close[finite] = off <= np.maximum(TOLERANCE_M, TOLERANCE_SHARE * expected[finite])
    return close


def is_at_silhouette(caster, scan, beams):
    """Mask of beams whose range is between those of rays cast slightly beside them."""
    directions = world_directions(scan)[beams]
    up = scan.world_from_scanner[:3, 2]
    beside = []
    for across in (np.cross(up, directions), np.broadcast_to(up, directions.shape)):
        for sign in (-1.0, 1.0):
            turned = directions + sign * SILHOUETTE_RAD * across
            turned /= np.linalg.norm(turned, axis=1, keepdims=True)
            beside.append(caster.ranges(scan.world_from_scanner[:3, 3], turned))
    ranges = scan.ranges_m[beams]
    low, high = np.min(beside, axis=0), np.max(beside, axis=0)
    tolerance = np.maximum(TOLERANCE_M, TOLERANCE_SHARE * np.where(np.isfinite(low), low, 0.0))
    return (low - tolerance <= ranges) & (ranges <= high + tolerance)


@with_warehouse("courtyard", "soccer", "mapping")
def test_ranges_match_ray_casting(source):
    scene = opaque_part(load_scene(source))
    caster = RayCaster(scene)
    poses = free_poses(caster, *COMPARED[source], np.random.default_rng(20))
    close_beams = beams = 0
    with open_sensor(scene, EXACT) as renderer:
        for world_from_scanner in poses:
            scan = renderer.scan(world_from_scanner)
            expected = caster.ranges(world_from_scanner[:3, 3], world_directions(scan))
            close = is_close(scan.ranges_m, expected)
            assert np.all(is_at_silhouette(caster, scan, np.flatnonzero(~close)))
            close_beams += close.sum()
            beams += close.size
    assert beams == POSES * 361
    assert close_beams >= 0.995 * beams


def test_comparison_detects_another_pose():
    scene = opaque_part(load_scene("courtyard"))
    caster = RayCaster(scene)
    scan = scan_of(scene, EXACT, pose(scene.start.position_m, yaw_deg=15.0))
    moved_m = pose((0.002, 0.002, 0.0)) @ scan.world_from_scanner
    moved = dataclasses.replace(scan, world_from_scanner=moved_m)
    close = is_close(scan.ranges_m, caster.ranges(moved_m[:3, 3], world_directions(moved)))
    assert close.mean() < 0.5
    assert is_at_silhouette(caster, moved, np.flatnonzero(~close)).mean() < 0.1
    close = is_close(
        scan.ranges_m, caster.ranges(scan.world_from_scanner[:3, 3], world_directions(scan))
    )
    assert close.mean() > 0.99
