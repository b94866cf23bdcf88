"""Possible gain of levels of detail in a scene, and what its images would lose.

Run `python -m benchmarks.detail_gain [SCENE] [--size PX ...]`; default: the town of a million
triangles, 360 px. `SCENE` may be a built-in scene, a file, or a number of triangles of a town.
Simplified scenes, each made for one viewpoint, stand beside the whole one:

- simplified: meshoptimizer collapses edges until the surface is a bound of pixels away, and removes
  parts that are smaller. Its error is a mean: single vertices move three times as far. A mesh's
  bound is that of its nearest vertex.
- near: triangles beyond a distance are left out. It is no level of detail, but cheaper than any:
  everything farther away costs nothing, and is missing.

Frames with the fast setting, whole and simplified in turn, from a pose whose shadow maps are drawn.
Simplified meshes cast simplified shadows. Prints the number of triangles, those submitted for a
frame, the median ratio of processor times, and PSNR over the pixels of the mirror, at the fast and
the default setting. Needs `pip install meshoptimizer`.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.pipeline_parts import RepeatedFrame
from benchmarks.settings import SETTINGS, at_setting
from benchmarks.suites.scaling import SETTING, SIZE_PX, STREET
from benchmarks.town import build_town
from omnisim.core.errors import OmnisimError
from omnisim.core.extras import require_extra
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.stage import Stage
from omnisim.scene import load_scene
from omnisim.scene.model import Instance, Mesh, Scene
from omnisim.validation.image_differences import psnr_of_levels_db

ROUNDS, WARM_UP = 12, 3
SIMPLIFIED_PX = (0.125, 0.25, 0.5, 1.0)
NEAR_M = (160.0, 80.0, 40.0)
TOWN = "1e6"
_BEST_DB = 99.0  # of equal images


def px_per_rad(camera: OmniCamera, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels per radian (n,), along or across, in directions (n, 3) of a mirror's rig."""
    model = camera.model
    across_px = np.linspace(0.5, 0.5 * model.width_px - 0.5, 4 * model.width_px)
    center_px = np.array([0.5 * model.width_px - 0.5, 0.5 * model.height_px - 0.5])
    pixels = center_px + np.stack((across_px, np.zeros_like(across_px)), axis=-1)
    rays = model.ray_from_pixel(pixels)
    axis = model.ray_from_pixel(center_px).directions
    across_px, seen = across_px[rays.valid], rays.directions[rays.valid]
    angles_rad = np.arccos(np.clip(seen @ axis, -1.0, 1.0))
    along = np.gradient(across_px, angles_rad)
    densities = np.maximum(along, across_px / np.sin(angles_rad))
    cosines = directions @ (camera.model.rig_from_optical @ axis)
    own_rad = np.arccos(np.clip(cosines / np.linalg.norm(directions, axis=-1), -1.0, 1.0))
    found: NDArray[np.float64] = np.interp(own_rad, angles_rad, densities)
    return found


def simplify(mesh: Mesh, limit_m: float) -> Mesh | None:
    """Mesh whose surface moves by a limit at most, on average; None: nothing is left."""
    meshoptimizer: Any = import_module("meshoptimizer")
    corners = np.ascontiguousarray(mesh.triangles, dtype=np.uint32).reshape(-1)
    kept = np.empty_like(corners)
    count = meshoptimizer.simplify(
        kept,
        corners,
        np.ascontiguousarray(mesh.positions, dtype=np.float32),
        target_index_count=0,
        target_error=limit_m,
        options=meshoptimizer.SIMPLIFY_ERROR_ABSOLUTE | meshoptimizer.SIMPLIFY_PRUNE,
    )
    triangles = kept[:count].reshape(-1, 3).astype(mesh.triangles.dtype)
    return dataclasses.replace(mesh, triangles=triangles) if count else None


def _nearest(
    mesh: Mesh, from_viewpoint_m: NDArray[np.float64], scale: float, limit_m: float
) -> Mesh | None:
    """Mesh with the triangles that have a corner within a distance; None: no triangle is left."""
    is_near = np.linalg.norm(from_viewpoint_m, axis=1) < limit_m
    kept = mesh.triangles[is_near[mesh.triangles].any(axis=1)]
    return dataclasses.replace(mesh, triangles=kept) if len(kept) else None


def _simplified(
    mesh: Mesh, from_viewpoint_m: NDArray[np.float64], scale: float, limit_px: float,
    camera: OmniCamera, rig_from_world: NDArray[np.float64],
) -> Mesh | None:  # fmt: skip
    distances_m = np.maximum(np.linalg.norm(from_viewpoint_m, axis=1), 1e-3)
    densities = px_per_rad(camera, from_viewpoint_m @ rig_from_world.T)
    return simplify(mesh, float((limit_px * distances_m / densities).min()) / scale)


def _changed(
    scene: Scene,
    viewpoint_m: NDArray[np.float64],
    change: Callable[[Mesh, NDArray[np.float64], float], Mesh | None],
) -> Scene:
    """Scene with a changed mesh for each instance, given its vertices and its scale."""
    meshes: list[Mesh] = []
    instances: list[Instance] = []
    for instance in scene.instances:
        mesh, pose = scene.meshes[instance.mesh], instance.world_from_mesh
        from_viewpoint_m = mesh.positions @ pose[:3, :3].T + (pose[:3, 3] - viewpoint_m)
        changed = change(mesh, from_viewpoint_m, float(np.linalg.norm(pose[:3, :3], 2)))
        if changed is not None:
            instances.append(dataclasses.replace(instance, mesh=len(meshes)))
            meshes.append(changed)
    return dataclasses.replace(scene, meshes=tuple(meshes), instances=tuple(instances))


def _ratio(
    whole: tuple[Stage, Renderer], other: tuple[Stage, Renderer], pose: NDArray[np.float64]
) -> float:
    """Median ratio of the processor time of frames, in turn."""
    times_s = np.zeros((WARM_UP + ROUNDS, 2))
    for times in times_s:
        for number, (stage, renderer) in enumerate((whole, other)):
            start_s = time.process_time()
            renderer.render(pose)
            with stage.current():
                stage.context.finish()
            times[number] = time.process_time() - start_s
    return float(np.median(times_s[WARM_UP:, 1] / times_s[WARM_UP:, 0]))


def _compare(scene: Scene, pose: NDArray[np.float64], size_px: int) -> None:
    """Print a row per simplified scene."""
    camera = OmniCamera(polygons=None).resized(size_px)
    simplified = partial(_simplified, camera=camera, rig_from_world=pose[:3, :3].T)
    changes = {f"simplified {one:g} px": partial(simplified, limit_px=one) for one in SIMPLIFIED_PX}
    changes |= {f"near {limit_m:g} m": partial(_nearest, limit_m=limit_m) for limit_m in NEAR_M}
    with ExitStack() as opened:
        stage = opened.enter_context(Stage(scene))
        renderers = {
            name: opened.enter_context(stage.open(at_setting(camera, name))) for name in SETTINGS
        }
        images = {name: renderer.render(pose).rgba for name, renderer in renderers.items()}
        submitted = RepeatedFrame(renderers[SETTING], pose).count().virtual_cameras.triangles
        print(f"{'whole':19} {scene.triangle_count:9} triangles, {submitted:7} submitted")
        for title, change in changes.items():
            other = _changed(scene, pose[:3, 3], change)
            with Stage(other) as second, ExitStack() as seconds:
                others = {
                    name: seconds.enter_context(second.open(at_setting(camera, name)))
                    for name in SETTINGS
                }
                decibels = {
                    name: _psnr_db(one.render(pose).rgba, images[name])
                    for name, one in others.items()
                }
                ours = others[SETTING]
                submitted = RepeatedFrame(ours, pose).count().virtual_cameras.triangles
                ratio = _ratio((stage, renderers[SETTING]), (second, ours), pose)
            of_settings = ", ".join(
                f"{name} {decibel:.1f} dB" for name, decibel in decibels.items()
            )
            print(
                f"{title:19} {other.triangle_count:9} triangles, {submitted:7} submitted, "
                f"processor time × {ratio:.2f}, {of_settings}",
                flush=True,
            )


def _psnr_db(image: NDArray[np.uint8], reference: NDArray[np.uint8]) -> float:
    where = reference[..., 3] > 0
    return min(_BEST_DB, psnr_of_levels_db(image[where][:, :3], reference[where][:, :3]))


def main() -> None:
    """Print what simplified scenes cost, and how their images differ."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", default=TOWN, metavar="SCENE")
    parser.add_argument("--size", nargs="+", type=int, default=[SIZE_PX], metavar="PX")
    arguments = parser.parse_args()
    try:
        require_extra("meshopt", "levels of detail")
        scene, pose = _scene_and_pose(arguments.scene)
        for size_px in arguments.size:
            print(f"{arguments.scene}, {size_px} px")
            _compare(scene, pose, size_px)
    except OmnisimError as reason:
        sys.exit(f"error: {reason}")


def _scene_and_pose(name: str) -> tuple[Scene, NDArray[np.float64]]:
    """Town of so many triangles, or scene, and the pose (4, 4) of the camera in it."""
    try:
        triangles = int(float(name))
    except (ValueError, OverflowError):
        scene = load_scene(name)
        start = scene.start
        return scene, OmniCamera().base_pose(start.position_m, yaw_deg=start.yaw_deg)
    return build_town(triangles), STREET[0]


if __name__ == "__main__":
    main()
