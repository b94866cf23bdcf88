"""Cases beside those of `cases`: other lights, materials, sensors and cameras, so that every
shader is compiled and drawn by."""

import dataclasses
import math
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera, EquirectangularCamera, MirroredCamera, UnifiedCamera
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.ground_truth import CHANNELS
from omnisim.rendering.camera.degradations import Degradation, Encoding, Exposure, preset
from omnisim.rendering.camera.degradations.point_spread import PointSpread
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl import scene_view
from omnisim.rendering.opengl.capture import image_pass
from omnisim.rendering.opengl.world import geometry_store, scene_buffers
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.rendering.twist import Twist
from omnisim.robots.vehicle import Vehicle
from omnisim.scene import Scene, load_scene
from omnisim.scene.files.load import NO_BAKED_LIGHT
from omnisim.scene.light.environment import Environment
from omnisim.scene.model import Fog, Lighting, Texture
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar
from omnisim.validation import material_chart
from tests.camera_examples import CAMERA_EXAMPLES, FIRST_EXAMPLES, OWN, POLE
from tests.drivers.cases import (
    USUAL_CHANNELS,
    Cases,
    Channels,
    Drawings,
    channels_of,
    draw_frames,
    drawings,
    optics_sensor,
    poses_in,
)
from tests.rendering.opengl.sheets import LAMP, SUN, mixed_scene, with_mirrors
from tests.skinned_figure import Figure

EVERY_CHANNEL = tuple(CHANNELS)
PANORAMA = EquirectangularCamera(128, 64)
FISHEYE = EquidistantCamera(90, 90, 28.0, (44.5, 44.5), math.radians(95.0))
FOG = Fog((0.3, 0.5, 0.7), (0.3, 0.1, 0.05))


def sample_cases(size_px: int, poses: int) -> Cases:
    """The cases by name."""
    of = partial(partial, draw_frames, size_px=size_px, count=poses)
    by_lamps = partial(load_scene, "soccer", baked=NO_BAKED_LIGHT)
    mapping, body = partial(load_scene, "mapping"), Vehicle.load("p2at").body
    return {
        "soccer by its lamps": of(by_lamps, FISHEYE),
        "body in mapping": of(mapping, FISHEYE, body=body),
        "sheets": of(partial(mixed_scene, SUN, LAMP), PANORAMA, channels=EVERY_CHANNEL),
        "sheets in fog": of(_sheets_in_fog, PANORAMA),
        "optics in fog": of(
            _sheets_in_fog, optics_sensor("sphere"), size_px=size_px // 2, channels=EVERY_CHANNEL
        ),
        "mirrors": of(partial(_mirrors_in_fog, panes=False), PANORAMA),
        "panes": of(_mirrors_in_fog, PANORAMA),
        "materials": of(_materials, PANORAMA, channels=EVERY_CHANNEL),
        "bad day": partial(_degraded, preset("bad-day"), size_px, poses),
        "mean meter": partial(
            _degraded, Degradation(exposure=Exposure(auto=True, metering="mean")), size_px, poses
        ),
        "tone curve": partial(
            _degraded, Degradation(encoding=Encoding(tone_curve="neutral")), size_px, poses
        ),
        "point spread": partial(_degraded, Degradation(point_spread=PointSpread()), size_px, poses),
        "skin": partial(_skin, poses),
        "lidar": partial(_clouds, poses),
        "laser": partial(_scans, poses),
        "cameras": partial(_cameras, size_px),
        "samples": partial(_drawn_samples, size_px),
        "windows": partial(_windows, size_px, poses),
        "triangles": partial(_culled_triangles, size_px, poses),
    }


def _sheets_in_fog() -> Scene:
    scene = mixed_scene(SUN, LAMP)
    return dataclasses.replace(scene, lighting=dataclasses.replace(scene.lighting, fog=FOG))


def _mirrors_in_fog(panes: bool = True) -> Scene:
    """Mirrors, and panes: virgl's server 0.10.4 aborts on triangle IDs after their blending."""
    return with_mirrors(_sheets_in_fog(), panes)


def _materials() -> Scene:
    """Spheres with every map, by lamps and a sky, placed by both sets of coordinates."""
    generator = np.random.default_rng(2)

    def texture(**options) -> Texture:
        pixels = np.kron(generator.integers(60, 190, (4, 4, 4)), np.ones((4, 4, 1)))
        return Texture(pixels.astype(np.uint8), **options)

    values = [
        {"emissive": (0.2, 0.3, 0.1), "emissive_map": texture()},
        {"metallic_roughness_map": texture(is_linear=True), "roughness": 0.8},
        {"occlusion_map": texture(is_linear=True), "metallic": 0.5},
        {"normal_map": texture(is_linear=True, uv_set=1)},
        {"metallic": 0.0, "roughness": 0.1, "transmission": 0.9, "thickness_m": 0.2},
        {"specular": 0.9, "specular_color": (1.0, 2.0, 4.0), "specular_map": texture()},
        {
            "clearcoat": 0.9, "clearcoat_roughness": 0.7,
            "clearcoat_map": texture(is_linear=True),
            "clearcoat_normal_map": texture(is_linear=True),
        },
    ]  # fmt: skip
    sky = Environment(generator.uniform(0.2, 1.0, (16, 32, 3)).astype(np.float32))
    scene = material_chart.chart(Lighting((0.1, 0.1, 0.1), (SUN, LAMP), environment=sky))
    materials = [
        dataclasses.replace(material, **values[number % len(values)])
        for number, material in enumerate(scene.materials)
    ]
    meshes = [
        dataclasses.replace(mesh, second_texture_coordinates=mesh.texture_coordinates[:, ::-1])
        for mesh in scene.meshes
    ]
    return dataclasses.replace(scene, materials=tuple(materials), meshes=tuple(meshes))


def _degraded(degradation: Degradation, size_px: int, count: int) -> Drawings:
    """Frames of a degraded camera in motion, which batches do not have."""
    with open_sensor("soccer", OmniCamera(degradation=degradation).resized(size_px)) as renderer:
        poses = poses_in(renderer.scene, count)
        turn = Twist(angular_radps=(0.0, 0.0, 0.5))

        def single(number: int) -> Channels:
            frame = renderer.render(
                poses[number], also=USUAL_CHANNELS, motion=turn.through(poses[number])
            )
            return channels_of(frame)

        return drawings(count, single)


def _skin(count: int) -> Drawings:
    """A figure that walks: its frames, and its scans by a lidar, at as many times."""
    with TemporaryDirectory() as folder:
        scene = load_scene(Figure().write(Path(folder) / "figure.glb"))
    here = pose((-0.7, -1.1, 1.0), yaw_deg=8.0)
    with Stage(scene) as stage, stage.open(PANORAMA) as camera:

        def single(number: int) -> Channels:
            state = WorldState({camera.vehicle: here}, 0.1 * number)
            frame = camera.render(state, also=USUAL_CHANNELS)
            return channels_of(frame)

        return drawings(count, single)


def _clouds(count: int) -> Drawings:
    lidar = SpinningLidar().without_errors()
    turn = Twist((1.0, 0.0, 0.0), (0.0, 0.0, 0.5))
    with open_sensor("courtyard", lidar) as renderer:
        poses = poses_in(renderer.scene, count)

        def single(number: int) -> Channels:
            points = renderer.scan(turn.through(poses[number])).points
            firing = np.rint(points["time"] / lidar.period_s * lidar.firings).astype(int)
            ranges = np.full((lidar.rings, lidar.firings), np.inf)
            instances = np.zeros(ranges.shape, int)
            ranges[points["ring"], firing] = points["range"]
            instances[points["ring"], firing] = points["instance"]
            return {"range": ranges, "instance": instances}

        return drawings(count, single)


def _scans(count: int) -> Drawings:
    with open_sensor(mixed_scene(), LaserScanner().without_errors()) as renderer:
        poses = poses_in(renderer.scene, count)

        def single(number: int) -> Channels:
            ranges = renderer.scan(poses[number]).ranges_m
            return {"range": ranges, "instance": np.isfinite(ranges)}

        return drawings(count, single)


def _cameras(size_px: int) -> Drawings:
    """One image by each camera model."""
    cameras = [example for name, example in CAMERA_EXAMPLES.items() if name in FIRST_EXAMPLES]
    lens = next(camera for camera in cameras if isinstance(camera, UnifiedCamera))
    mirror = OmniCamera(polygons=None)  # the others are lenses, without a mesh
    return _by_each([*cameras, POLE, OWN, MirroredCamera(lens), mirror], size_px)


def _drawn_samples(size_px: int) -> Drawings:
    """Images whose samples are drawn, as those too large for a table of them are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(image_pass, "fits_table", lambda sample_count: False)
        iterated = CAMERA_EXAMPLES["kannala-brandt-tum-vi"]
        return _by_each([OmniCamera(), iterated, POLE, PANORAMA], size_px)


def _windows(size_px: int, count: int) -> Drawings:
    """Hits and scans where vertices and indices are larger than a binding."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (geometry_store, scene_buffers):
            patch.setattr(module, "window_bytes", lambda context: 1 << 17)
        _scans(count)
        return draw_frames(mixed_scene, PANORAMA, size_px, count, channels=EVERY_CHANNEL)


def _culled_triangles(size_px: int, count: int) -> Drawings:
    """Images whose triangles are culled one by one, as those of large scenes are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scene_view, "MIN_CULLED_TRIANGLES", 0)
        patch.setattr(scene_view, "MIN_TRIANGLES_OF_PASSES", (0,))
        return draw_frames(mixed_scene, OmniCamera(), size_px, count)


def _by_each(cameras: list, size_px: int) -> Drawings:
    """One image by each camera, pixel after pixel."""
    with Stage("compass") as stage:
        parts = [_by_one(stage, OmniCamera.of(camera).resized(size_px)) for camera in cameras]
    sums = ("images", "unlike itself")
    return {
        name: sum(part[name] for part in parts)
        if name in sums
        else np.concatenate([part[name].reshape(-1, *part[name].shape[3:]) for part in parts])
        for name in parts[0]
    }


def _by_one(stage: Stage, camera: OmniCamera) -> Drawings:
    with stage.open(camera) as renderer:
        poses = poses_in(stage.scene, 1)

        def single(number: int) -> Channels:
            frame = renderer.render(poses[number], also=USUAL_CHANNELS)
            return channels_of(frame)

        return drawings(1, single)
