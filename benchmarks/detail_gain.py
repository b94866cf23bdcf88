"""Possible gain of levels of detail in the town, and what their images would lose.

Run `python -m benchmarks.detail_gain [TRIANGLES]`; default: 1 million. Two kinds of simplified
towns, each made for one viewpoint, stand beside the whole one:

- merged: vertices move to another one of their mesh in the same cell of a grid, whose diagonal is
  at most so many pixels wide. Triangles whose corners meet vanish. Nothing else moves farther.
- near: triangles beyond a distance are left out. It is no level of detail, but cheaper than any:
  everything farther away costs nothing, and is missing.

Frames of 360² with the fast setting, whole and simplified in turn, from a pose whose shadow maps
are drawn. Simplified meshes cast simplified shadows. Prints the number of triangles, those
submitted for a frame, the median ratio of processor times, and PSNR over the pixels of the mirror,
at the fast and the default setting.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.pipeline_parts import RepeatedFrame
from benchmarks.settings import SETTINGS, at_setting
from benchmarks.suites.scaling import SETTING, SIZE_PX, STREET
from benchmarks.town import build_town
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.stage import Stage
from omnisim.scene.model import Instance, Mesh, Scene
from omnisim.validation.psnr import psnr_of_levels_db

ROUNDS, WARM_UP = 12, 3
MERGED_PX = (0.125, 0.25, 0.5, 1.0)
NEAR_M = (160.0, 80.0, 40.0)
VIEWPOINTS = (0, 3)  # of the street's
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


def merge_vertices(
    mesh: Mesh, from_viewpoint_m: NDArray[np.float64], cells_m: NDArray[np.float64]
) -> Mesh | None:
    """Mesh with one vertex per cell; None: no triangle is left.

    Args:
        mesh: mesh to simplify.
        from_viewpoint_m: (n, 3) vertices.
        cells_m: (n,) largest diagonal of a vertex's cell, which is a power of two wide.
    """
    levels = np.floor(np.log2(cells_m / np.sqrt(3.0))).astype(np.int64)
    cells = np.floor(from_viewpoint_m / np.exp2(levels)[:, None]).astype(np.int64)
    keys = np.column_stack((levels, cells))
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    number = number.reshape(-1)
    a, b, c = number[mesh.triangles].T
    kept = mesh.triangles[(a != b) & (b != c) & (c != a)]
    if not len(kept):
        return None
    return dataclasses.replace(mesh, positions=mesh.positions[first[number]], triangles=kept)


def _nearest(mesh: Mesh, from_viewpoint_m: NDArray[np.float64], limit_m: float) -> Mesh | None:
    """Mesh with the triangles that have a corner within a distance; None: no triangle is left."""
    is_near = np.linalg.norm(from_viewpoint_m, axis=1) < limit_m
    kept = mesh.triangles[is_near[mesh.triangles].any(axis=1)]
    return dataclasses.replace(mesh, triangles=kept) if len(kept) else None


def _merged(
    mesh: Mesh, from_viewpoint_m: NDArray[np.float64], limit_px: float, camera: OmniCamera,
    rig_from_world: NDArray[np.float64],
) -> Mesh | None:  # fmt: skip
    distances_m = np.maximum(np.linalg.norm(from_viewpoint_m, axis=1), 1e-3)
    densities = px_per_rad(camera, from_viewpoint_m @ rig_from_world.T)
    return merge_vertices(mesh, from_viewpoint_m, limit_px * distances_m / densities)


def _simplified(
    scene: Scene,
    viewpoint_m: NDArray[np.float64],
    simplify: Callable[[Mesh, NDArray[np.float64]], Mesh | None],
) -> Scene:
    """Town, whose meshes have an instance each, with other meshes."""
    meshes: list[Mesh] = []
    instances: list[Instance] = []
    for instance in scene.instances:
        mesh, pose = scene.meshes[instance.mesh], instance.world_from_mesh
        from_viewpoint_m = mesh.positions @ pose[:3, :3].T + (pose[:3, 3] - viewpoint_m)
        changed = simplify(mesh, from_viewpoint_m)
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


def _compare(scene: Scene, pose: NDArray[np.float64]) -> None:
    """Print a row per simplified town."""
    camera = OmniCamera(polygons=None).resized(SIZE_PX)
    merge = partial(_merged, camera=camera, rig_from_world=pose[:3, :3].T)
    towns = {f"near {limit_m:g} m": partial(_nearest, limit_m=limit_m) for limit_m in NEAR_M}
    towns |= {f"merged {limit:g} px": partial(merge, limit_px=limit) for limit in MERGED_PX}
    with ExitStack() as opened:
        stage = opened.enter_context(Stage(scene))
        renderers = {
            name: opened.enter_context(stage.open(at_setting(camera, name))) for name in SETTINGS
        }
        images = {name: one.render(pose).rgba for name, one in renderers.items()}
        submitted = RepeatedFrame(renderers[SETTING], pose).count().virtual_cameras.triangles
        print(f"{'whole':14} {scene.triangle_count:9} triangles, {submitted:7} submitted")
        for title, simplify in towns.items():
            other = _simplified(scene, pose[:3, 3], simplify)
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
            of_settings = ", ".join(f"{name} {one:.1f} dB" for name, one in decibels.items())
            print(
                f"{title:14} {other.triangle_count:9} triangles, {submitted:7} submitted, "
                f"processor time × {ratio:.2f}, {of_settings}",
                flush=True,
            )


def _psnr_db(image: NDArray[np.uint8], reference: NDArray[np.uint8]) -> float:
    where = reference[..., 3] > 0
    return min(_BEST_DB, psnr_of_levels_db(image[where][:, :3], reference[where][:, :3]))


def main(triangles: int) -> None:
    """Print what simplified towns cost, and how their images differ."""
    scene = build_town(triangles)
    for number in VIEWPOINTS:
        print(f"viewpoint {number}")
        _compare(scene, STREET[number])


if __name__ == "__main__":
    main(int(float(sys.argv[1])) if len(sys.argv) > 1 else 1_000_000)
