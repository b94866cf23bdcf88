"""Rays beside virtual cameras: the same images, ground truth and scans, by either back end.

Neither is written with the other's code: what both agree on, OpenGL and Embree agree on.
"""

import dataclasses
import gc
import math
import weakref

import numpy as np
import pytest

from omnisim import LaserScanner, OmniCamera, Stage, load_scene, open_sensor
from omnisim.cameras import EquidistantCamera
from omnisim.core.errors import GraphicsError
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.ground_truth import CHANNELS
from omnisim.ground_truth.hits import NO_DETAILS
from omnisim.rendering.camera.degradations import preset
from omnisim.rendering.rays.geometry import build_geometry
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND
from omnisim.validation.image_differences import psnr_of_levels_db
from tests.ray_casting import opaque_part
from tests.rendering.frames import BACKENDS, by_both
from tests.rendering.rays.test_caster import rays_from, tried
from tests.scenes import room, scene_of, square
from tests.slow import slow_but
from tests.vehicles import CAMERA, body, box

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

FISHEYE = OmniCamera(EquidistantCamera(360, 360, 100.0, (179.5, 179.5), math.radians(100.0)))
SENSORS = {"mirror": OmniCamera(), "fisheye": FISHEYE}
# Edges of overexposed lamps count most: a fisheye in soccer has 35.1 dB, in even light 37.5.
MIN_DB = {"soccer": 34.5, "mapping": 36.0, "courtyard": 36.0}
# Share of pixels that show the same triangle, of all and of those around which there is no edge.
SAME = {"soccer": (0.995, 0.9995), "mapping": (0.999, 0.9995), "courtyard": (0.97, 0.998)}
NOW = pose((-1.0, 0.1, 0.05), roll_deg=4.0, yaw_deg=10.0)
AFTER = NOW @ pose((0.06, 0.02, 0.01), yaw_deg=2.0, pitch_deg=1.0)


def _start(sensor, scene):
    return sensor.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)


def _psnr_db(one, other):
    seen = one.valid & other.valid
    return psnr_of_levels_db(one.rgb[seen], other.rgb[seen])


def _difference(one, other):
    """Difference of channels, where both are finite; they are so at the same pixels."""
    known = np.isfinite(one) & np.isfinite(other)
    assert (np.isfinite(one) == np.isfinite(other)).mean() >= 0.999
    return np.abs(np.where(known, one, 0.0) - np.where(known, other, 0.0))


def _hits(scene, sensor, backend):
    """Name and number of the triangle in each pixel, and the pixels that have a ray."""
    with open_sensor(scene, sensor, backend=backend) as renderer, renderer._current() as camera:
        state = renderer._state(_start(sensor, scene))
        source = camera.hit_source(NO_DETAILS)
        hits = source.hits(renderer._poses_in(state))
        names = np.array(["", *(name for _, name in source.draws)])
        return names[hits.draw_ids], hits.triangles, source.has_ray


def _same_triangles(scene, sensor):
    """Share of the pixels with the same triangle, and of those with no edge around them."""
    (name, triangle, ray), (their_name, their_triangle, their_ray) = (
        _hits(scene, sensor, backend) for backend in ("rays", "cube")
    )
    np.testing.assert_array_equal(ray, their_ray)
    same = (name == their_name) & (triangle == their_triangle)
    inside = ray.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            inside &= np.roll(name, step, axis) == name
            inside &= np.roll(triangle, step, axis) == triangle
    return same[ray].mean(), same[inside].mean()


def _evenly_lit():
    """Rooms without overexposed lamps and sky, edges of which count more than all else."""
    scene = load_scene("mapping", baked="none")
    materials = tuple(
        dataclasses.replace(
            material, emissive=tuple(min(level, 1.0) for level in material.emissive)
        )
        for material in scene.materials
    )
    return dataclasses.replace(scene, materials=materials, background=DEFAULT_BACKGROUND)


@pytest.mark.usefixtures("needs_opengl")
def test_images_and_channels_are_those_of_the_virtual_cameras():
    """In small; the next test has the numbers of the project's sizes."""
    scene, sensor = _evenly_lit(), FISHEYE.resized(120)
    now = _start(sensor, scene)
    after = now @ pose((0.2, 0.1, 0.0), yaw_deg=3.0)
    cube, rays = by_both(
        scene, sensor, now, next_state=after, previous_state=after, linear=True,
        also=tuple(CHANNELS),
    )  # fmt: skip
    np.testing.assert_array_equal(cube.valid, rays.valid)
    np.testing.assert_array_equal(cube.has_ray, rays.has_ray)
    assert _psnr_db(cube, rays) >= 36.0
    assert cube.labels == rays.labels
    assert rays.metadata == cube.metadata | {"backend": "rays"}
    assert rays.linear.dtype == np.float32
    for name in CHANNELS:
        mine, theirs = rays.channels[name], cube.channels[name]
        assert (mine.dtype, mine.shape) == (theirs.dtype, theirs.shape)
        if mine.dtype.kind == "u":
            assert (mine == theirs).mean() >= 0.995, name
            continue
        # albedo is filtered, by each its own way; the rest agrees but at edges
        limit = 0.2 if name == "albedo" else 1e-4
        assert np.quantile(_difference(mine, theirs)[rays.has_ray], 0.98) <= limit, name


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("lens", SENSORS)
@pytest.mark.parametrize("source", slow_but(SAME, long=["mapping", "courtyard"]))
def test_back_ends_agree_at_default_quality(source, lens):
    scene, sensor = load_scene(source), SENSORS[lens]
    assert _psnr_db(*by_both(scene, sensor, _start(sensor, scene))) >= MIN_DB[source]
    of_all, inside = _same_triangles(scene, sensor)
    assert of_all >= SAME[source][0]
    assert inside >= SAME[source][1]


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_where_back_ends_differ_rays_are_right():
    """Every triangle of the scene is tried in NumPy."""
    scene = opaque_part(load_scene("soccer"))
    sensor = OmniCamera(polygons=None)
    by_rays, by_cube = (_hits(scene, sensor, backend) for backend in ("rays", "cube"))
    differs = (by_rays[0] != by_cube[0]) | (by_rays[1] != by_cube[1])
    rows, columns = np.nonzero(differs & by_rays[2])
    assert len(rows) > 50
    model, base = sensor.model, _start(sensor, scene)
    rays = model.ray_from_pixel(np.stack((columns, rows), axis=1))
    directions = rays.directions @ model.rig_from_optical.T @ base[:3, :3].T
    geometry = build_geometry(scene)
    corners = geometry.corners_m(np.arange(len(geometry.corners), dtype=np.int32))
    solid = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).any(axis=1)
    sides = geometry.is_double_sided[geometry.surface_of_triangle]
    with np.errstate(all="ignore"):  # rays along planes
        found, _ = tried(corners[solid], sides[solid], rays_from(base[:3, 3], directions, 0.05))
    triangles = np.flatnonzero(solid)[found]
    surfaces = geometry.surface_of_triangle[triangles]
    names = np.array([geometry.surfaces[surface].name for surface in surfaces])
    numbers = triangles - geometry.first_of_surface[surfaces]

    def right(hits):
        return np.mean((hits[0][rows, columns] == names) & (hits[1][rows, columns] == numbers))

    assert right(by_rays) >= 0.95
    assert right(by_cube) <= 0.2


@pytest.mark.usefixtures("needs_opengl")
def test_degraded_images_are_those_of_the_gpu():
    """Electrons that fall on the other side differ, and edges."""
    sensor = FISHEYE.resized(90).with_degradation(preset("dragonfly2"))
    now, frames = _start(sensor, scene := _evenly_lit()), []
    for backend in BACKENDS:
        with open_sensor(scene, sensor, seed=4, backend=backend) as renderer:
            frames.append(
                renderer.render(
                    now, motion=lambda time_s: now @ pose((2.0 * time_s, 0.0, 0.0)), frame_number=3
                )
            )
    assert _psnr_db(*frames) >= 30.0
    theirs, ours = (frame.metadata["degradation"] for frame in frames)
    for key in ("parameters", "sub_frames", "noise"):
        assert ours[key] == theirs[key]
    np.testing.assert_allclose(ours["exposure"]["ev"], theirs["exposure"]["ev"], atol=0.01)


@pytest.mark.usefixtures("needs_opengl")
def test_objects_and_hidden_parts_are_where_they_are():
    """Body, hidden part and a moved crate: labels, ranges, flow and occlusion agree."""
    crate = scene_of([box("crate", 0, half_m=0.25)])
    also = ("range", "instance", "normals", "flow", "scene_flow", "scene_flow_camera")
    also += ("flow_backward",)
    found = []
    for backend in BACKENDS:
        stage = Stage(scene_of([room()]), body(), dynamic_objects={"crate": crate}, backend=backend)
        with stage, stage.open(CAMERA, hidden=("box",)) as renderer:
            now, after = (
                WorldState({renderer.vehicle: base, "crate": pose((1.0, 0.3 * step, 0.8))})
                for step, base in enumerate((NOW, AFTER))
            )
            found.append(renderer.render(now, also=also, next_state=after, previous_state=after))
    cube, rays = found
    seen = cube.has_ray
    assert len(np.unique(cube.channels["instance"])) > 2
    assert (cube.channels["occluded"] == 1).any()
    assert _psnr_db(cube, rays) >= 30.0
    for name in cube.channels:
        mine, theirs = rays.channels[name], cube.channels[name]
        if mine.dtype.kind == "u":
            assert (mine == theirs)[seen].mean() >= 0.995, name
        else:
            assert np.quantile(_difference(mine, theirs)[seen], 0.98) <= 1e-4, name


@pytest.mark.usefixtures("needs_opengl")
def test_scans_are_those_of_the_gpu():
    scans = []
    for backend in BACKENDS:
        with open_sensor("courtyard", LaserScanner().without_errors(), backend=backend) as renderer:
            scans.append(renderer.scan(pose((1.0, 0.5, 0.4), roll_deg=3.0, yaw_deg=50.0)).ranges_m)
    cube, rays = scans
    assert np.isfinite(cube).sum() > 100
    same = np.isclose(cube, rays, rtol=1e-5, atol=2e-3) | (np.isinf(cube) & np.isinf(rays))
    assert same.mean() >= 0.99


def test_rays_need_no_opengl(monkeypatch):
    """No context is opened, for images, degraded ones, ground truth and scans."""

    def refuse(device=None):
        raise AssertionError("OpenGL was opened")

    monkeypatch.setattr("omnisim.rendering.opengl.cube_backend.open_context", refuse)
    sensor = FISHEYE.resized(60).with_degradation(preset("webcam"))
    with Stage(scene_of([room()]), backend="rays") as stage:
        with stage.open(sensor) as renderer:
            frame = renderer.render(np.eye(4), also=("range", "flow"), next_state=AFTER)
            assert np.isfinite(frame.channels["range"][frame.has_ray]).all()
        with stage.open(LaserScanner()) as scanner:
            assert np.isfinite(scanner.scan(np.eye(4)).ranges_m).all()


def test_what_rays_cannot_do_is_refused_by_name():
    scene = scene_of([square()])
    with Stage(scene, backend="rays") as stage:
        with stage.open(CAMERA) as renderer:
            renderer.render(np.eye(4))
            with pytest.raises(GraphicsError, match="faces: back end 'rays' has none"):
                renderer.faces()
        with pytest.raises(GraphicsError, match="back end draws nothing by OpenGL"):
            _ = stage.context
    with pytest.raises(GraphicsError, match="this stage is closed"):
        stage.open(CAMERA)
    with pytest.raises(GraphicsError, match="device 0: back end 'rays' needs no GPU"):
        open_sensor(scene, CAMERA, backend="rays", device=0)
    with pytest.raises(GraphicsError, match="backend 'ray': did you mean 'rays'"):
        open_sensor(scene, CAMERA, backend="ray")


def test_memory_is_freed_when_a_renderer_is_closed():
    """At once, by counting references: no cycle waits for the collector."""
    gc.collect()
    gc.disable()
    try:
        with open_sensor(scene_of([room()]), CAMERA, backend="rays") as renderer:
            renderer.render(np.eye(4), also=("range",))
            scene = weakref.ref(renderer._stage.backend.rays)
        assert scene() is None
    finally:
        gc.enable()
