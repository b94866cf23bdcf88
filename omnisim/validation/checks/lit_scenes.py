"""Lit scenes against a path tracer's images: direct light with shadows, and baked light."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from omnisim.core.arrays import Bools, Floats32
from omnisim.plots.style import gallery
from omnisim.rendering.baking.baked_files import bake_scene
from omnisim.rendering.baking.settings import FINE_TEXELS, BakeSettings
from omnisim.rendering.stage import open_sensor
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.scene import load_scene
from omnisim.scene.light.baked import with_baked_light
from omnisim.scene.model import Light, LightKind, Material, Scene
from omnisim.validation.fixture import BACKENDS, Fixture, linear_image
from omnisim.validation.image_differences import converged_psnr_db, psnr_db, ssim
from omnisim.validation.oracles.mitsuba_light import matte_on_both_sides
from omnisim.validation.reflective_rooms import window_room
from omnisim.validation.traced_light import beside, ray_counts, views

FOLDER = Path(__file__).parents[1] / "lit"
SCENES, QUICK_SCENES = ("soccer", "courtyard"), ("soccer",)
SIZE_PX, QUICK_SIZE_PX = 160, 128
# Squares, as Mitsuba's sampler requires, by camera: a texel of the fisheye is 1/16 of a pixel.
SAMPLES = {"mirror": 144, "fisheye": 9}
QUICK_SAMPLES = {"mirror": 36, "fisheye": 4}
BOUND_DB = 34.0
# Lamps whose shadow edges lie on floors: a low sun, and a lamp beside the field.
_WHITE = (1.0, 1.0, 1.0)
LOW_LAMPS = {
    "soccer": Light(LightKind.POINT, _WHITE, 1500.0, position_m=np.array([-4.0, -2.5, 1.6])),
    "courtyard": Light(
        LightKind.DIRECTIONAL, _WHITE, 1e5, direction=np.array([0.74, 0.395, -0.544])
    ),
}
EDGES_SIZE_PX, EDGES_SAMPLES = 200, 25
EDGES_BOUND_PX = 1.0
_HALF, _FINER = 0.5, 8  # share of light at an edge; subdivisions of a pixel
_MARGIN_PX = 2  # around the edges of objects, which are not edges of shadows
_GRAY = (0.5, 0.5, 0.5, 1.0)
_DARKEST = 0.02  # of white, in full light: noise hides darker shadows
BAKED_SIZE_PX, QUICK_BAKED_SIZE_PX = 128, 96
BAKED_SAMPLES = {"mirror": 400, "fisheye": 16}
QUICK_BAKED_SAMPLES = {"mirror": 256, "fisheye": 16}
SETTINGS = BakeSettings(samples=32, texels=FINE_TEXELS)
QUICK_SETTINGS = BakeSettings(texel_m=0.1, samples=32)
BAKED_BOUND_DB, BOUND_SSIM = 32.0, 0.95
# Mitsuba finds little of the light behind a window: its noise is taken from the difference.
WINDOW_SIZE_PX, QUICK_WINDOW_SIZE_PX = 64, 48
WINDOW_SAMPLES = {"mirror": 576, "fisheye": 36}  # of each of two images
WINDOW_SETTINGS = BakeSettings(texel_m=0.06, samples=64)


def check_shadows(fixture: Fixture, title: str) -> Section:
    """Trace lit scenes in a physical mirror and through a fisheye, and compare them with ours."""
    measures: list[Measure] = []
    images: dict[str, NDArray[np.generic]] = {}
    size_px = QUICK_SIZE_PX if fixture.is_quick else SIZE_PX
    samples = QUICK_SAMPLES if fixture.is_quick else SAMPLES
    for name in QUICK_SCENES if fixture.is_quick else SCENES:
        scene = matte_on_both_sides(load_scene(FOLDER / f"{name}.toml"))
        for view in views(scene, size_px):
            traced, ours = view.traced(samples[view.camera]), view.ours(fixture)
            level_db = psnr_db(traced, ours, view.inside)
            label = f"{name}, {view.camera}"
            measures.append(
                Measure(f"{label}: default quality", level_db, "dB", BOUND_DB, at_least=True)
            )
            images |= beside(label, traced, ours, view.inside)
        measures.append(_edges(fixture, name))
    measures += [Measure("size", size_px, "px"), *ray_counts(samples)]
    return Section(
        title,
        "Direct light with hard shadows, against Mitsuba's path tracer. Mitsuba traces rays from a "
        "real mirror to diffuse surfaces, and from these to every lamp. It has no fisheye: for the "
        "lens it traces the faces of a cube, and their texels are averaged by the lens's published "
        "formula. The scenes in `omnisim/validation/lit` are built-in scenes with lamps or the "
        "sun, at exposures of 0.001 and 0.00001 per lux. Shadow edges are measured with one low "
        f"lamp on gray surfaces, at {EDGES_SIZE_PX} px, at least two pixels from any other edge.",
        measures,
        figures=[CaptionedFigure("lit-scenes", gallery(images, 6, side_in=2.7),
                 "Lit scenes traced by Mitsuba in a mirror and through a fisheye, omnisim's "
                 "images, and their difference × 8.")],
    )  # fmt: skip


def _edges(fixture: Fixture, name: str) -> Measure:
    """Measure the mean distance in px between our edges of shadows and a path tracer's."""
    lit = matte_on_both_sides(load_scene(FOLDER / f"{name}.toml"))
    scene = gray_in_one_light(lit, LOW_LAMPS[name])
    bare = dataclasses.replace(scene, lighting=scene.lighting.with_shadows(False))
    (view,) = views(scene, EDGES_SIZE_PX, ["mirror"])
    with open_sensor(scene, view.sensor, device=fixture.device) as renderer:
        frame = renderer.render(view.pose, linear=True, also=("instance", "normals"))
    unshadowed, traced = view.ours(fixture, bare), view.traced(EDGES_SAMPLES)
    surfaces = frame.channels["instance"], frame.channels["normals"]
    counted = view.inside & inside_surfaces(*surfaces, unshadowed)
    ours, theirs = (lit_share(image, unshadowed) for image in (linear_image(frame), traced))
    distance_px = edge_distance_px(ours, theirs, counted)
    return Measure(f"{name}, edges of shadows, mean", distance_px, "px", EDGES_BOUND_PX)


def lit_share(image: Floats32, unshadowed: Floats32) -> Floats32:
    """Share (height, width) of a lamp's light that reaches surfaces.

    Args:
        image, unshadowed: linear images (height, width, 3) with and without shadows.
    """
    light, full = image.sum(axis=-1), unshadowed.sum(axis=-1)
    return np.clip(light / np.maximum(full, 3.0 * _DARKEST), 0.0, 1.0)


def inside_surfaces(
    instances: NDArray[np.integer], normals: NDArray[np.floating], unshadowed: Floats32
) -> Bools:
    """Mask (height, width) of pixels away from edges of objects, and bright without shadows.

    Args:
        instances: (height, width) instance IDs.
        normals: (height, width, 3) unit normals.
        unshadowed: (height, width, 3) linear image without shadows.
    """
    breaks = np.zeros(instances.shape, bool)
    for axis in (0, 1):
        other = np.roll(instances, 1, axis) != instances
        other |= (np.roll(normals, 1, axis) * normals).sum(axis=-1) < 0.9  # 26°
        breaks |= other | np.roll(other, -1, axis)
    breaks = ndimage.binary_dilation(breaks, iterations=_MARGIN_PX)
    return np.asarray(~breaks & (unshadowed.mean(axis=-1) > _DARKEST), bool)


def edge_distance_px(first: Floats32, second: Floats32, where: Bools) -> float:
    """Mean distance in px from each edge, in either image, to the nearest edge in the other.

    An edge is where half of the light arrives, linearly interpolated between pixels.

    Args:
        first, second: (height, width) shares of light.
        where: (height, width) pixels with relevant edges; the result is NaN without edges.
    """
    finer = []  # masks of the edges
    for values in (first, second):
        is_lit = ndimage.zoom(values, _FINER, order=1, grid_mode=True, mode="nearest") > _HALF
        edges = np.zeros(is_lit.shape, bool)
        edges[1:] |= is_lit[1:] != is_lit[:-1]
        edges[:, 1:] |= is_lit[:, 1:] != is_lit[:, :-1]
        finer.append(edges)
    counted = ndimage.zoom(where, _FINER, order=0, grid_mode=True, mode="nearest")
    distances = []
    for edges, other_edges in (finer, finer[::-1]):
        away = ndimage.distance_transform_edt(~other_edges)
        distances.append(away[edges & counted] / _FINER)
    nearest_px = np.concatenate(distances)
    return float(nearest_px.mean()) if len(nearest_px) else float("nan")


def gray_in_one_light(scene: Scene, light: Light) -> Scene:
    """Copy of the scene with plain gray surfaces, lit by one lamp."""
    return dataclasses.replace(
        scene,
        meshes=tuple(dataclasses.replace(mesh, colors=None) for mesh in scene.meshes),
        materials=tuple(
            Material(material.name, _GRAY, double_sided=material.double_sided)
            for material in scene.materials
        ),
        lighting=dataclasses.replace(scene.lighting, lights=(light,)),
    )


def check_baked(fixture: Fixture, title: str) -> Section:
    """Bake scenes lit by lamps, trace them in a real mirror and a fisheye, and compare."""
    measures: list[Measure] = []
    images: dict[str, NDArray[np.generic]] = {}
    size_px = QUICK_BAKED_SIZE_PX if fixture.is_quick else BAKED_SIZE_PX
    samples = QUICK_BAKED_SAMPLES if fixture.is_quick else BAKED_SAMPLES
    settings = QUICK_SETTINGS if fixture.is_quick else SETTINGS
    for name in QUICK_SCENES if fixture.is_quick else SCENES:
        scene = matte_on_both_sides(load_scene(FOLDER / f"{name}.toml"))
        lit = in_baked_light(scene, settings)
        for view in views(scene, size_px):
            both = view.traced(samples[view.camera], bounces=True), view.ours(fixture, lit)
            level_db, likeness = psnr_db(*both, view.inside), ssim(*both, view.inside)
            label = f"{name}, {view.camera}"
            measures += [
                Measure(f"{label}: baked", level_db, "dB", BAKED_BOUND_DB, at_least=True),
                Measure(f"{label}: structural similarity", likeness, "", BOUND_SSIM, at_least=True),
            ]
            images |= beside(label, *both, view.inside)
    scene = window_room()
    lit = in_baked_light(scene, WINDOW_SETTINGS)
    for view in views(scene, QUICK_WINDOW_SIZE_PX if fixture.is_quick else WINDOW_SIZE_PX):
        first, second = view.traced_twice(WINDOW_SAMPLES[view.camera])
        label = f"window, {view.camera}"
        for backend in BACKENDS:
            ours = view.ours(fixture, lit, backend)
            value = converged_psnr_db(ours, first, second, view.inside)
            name = f"{label}, back end {backend}: baked"
            measures.append(Measure(name, value, "dB", BAKED_BOUND_DB, at_least=True))
        mean = (0.5 * (first + second)).astype(np.float32)
        images |= beside(label, mean, ours, view.inside)
    measures += [
        Measure("size", size_px, "px"),
        *ray_counts(samples),
        Measure("rays from a texel", settings.samples),
    ]
    return Section(
        title,
        "Images with light from `omnisim bake`, against Mitsuba's path tracer. Mitsuba traces rays "
        "from a real mirror, or from the faces of a cube for the fisheye, over all bounces off "
        "diffuse surfaces to the lamps. The scenes are the lit scenes of the check of shadows, and "
        "a room in the light of a window, a mirror and a lamp behind frosted glass, by both back "
        "ends.",
        measures,
        figures=[CaptionedFigure("baked-scenes", gallery(images, 6, side_in=2.7),
                 "Lit scenes traced by Mitsuba in a mirror and through a fisheye, omnisim's images "
                 "in baked light, and their difference × 8.")],
    )  # fmt: skip


def in_baked_light(scene: Scene, settings: BakeSettings) -> Scene:
    """Scene with its light baked, in a temporary folder."""
    with tempfile.TemporaryDirectory(prefix="omnisim-baked-") as folder:
        baked = Path(folder) / "scene.baked"
        bake_scene(scene, baked, settings)
        return with_baked_light(scene, baked)
