"""Oracle of ground truth: the pixels' exact rays, cast by Embree.

By hand, all lenses, ten poses in mapping and in the warehouse: python -m tests.embree_oracle
"""

import dataclasses
import math

import numpy as np

from omnisim import OmniCamera, load_scene, open_sensor
from omnisim.cameras import EquidistantCamera, EquirectangularCamera, pixel_grid
from omnisim.core.poses import pose
from omnisim.rendering.rays.shading.shading import Shading
from omnisim.rendering.truth import OCCLUDED, OUTSIDE, VISIBLE
from tests.ray_casting import RayCaster, opaque_part
from tests.scenes import WAREHOUSE

LENSES = {
    "mirror": OmniCamera(polygons=None),
    "fisheye": OmniCamera(
        EquidistantCamera(360, 360, 100.0, (179.5, 179.5), math.radians(100.0)), polygons=None
    ),
    "equirectangular": OmniCamera(EquirectangularCamera(480, 240), polygons=None),
}
# Where viewpoints are in scenes to compare in, from and to, in meters.
FREE_M = {
    "mapping": ((-3.0, -8.0, 0.4), (10.0, 12.0, 2.0)),
    WAREHOUSE: ((-3.0, -5.0, 0.4), (3.0, 5.0, 2.0)),
}


@dataclasses.dataclass
class Hits:
    """Hits of rays: range, +inf for nothing; instance, −1 for nothing; unit normal."""

    ranges_m: np.ndarray
    instances: np.ndarray
    normals: np.ndarray


class Oracle:
    """Casts rays at a scene's surfaces; those that are seen from behind are not there."""

    def __init__(self, scene):
        self._caster = RayCaster(scene)
        self._shading = Shading(self._caster.caster.geometry, scene.lighting)

    def hits(self, origin, directions):
        """Hits of rays from (3,) along unit directions (n, 3)."""
        exact, ranges_m, hit = self._caster.hits(origin, directions)
        found = Hits(ranges_m, np.full(len(directions), -1), np.zeros(directions.shape))
        found.instances[hit] = self._shading.surfaces(exact)
        found.normals[hit] = self._shading.normals(exact)
        return found


def compare(scene, oracle, renderer, now, after):
    """Shares of the valid pixels that agree, and errors of the flow, as a dictionary."""
    camera, to_rig = renderer.camera.model, renderer.camera.model.rig_from_optical
    frame = renderer.render(
        now, also=("range", "instance", "normals", "flow", "valid"), next_state=after
    )
    valid = frame.channels["valid"] > 0
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    assert np.array_equal(valid, rays.valid)
    directions = rays.directions[valid] @ to_rig.T @ now[:3, :3].T
    hits = oracle.hits(now[:3, 3], directions)
    mine_m = frame.channels["range"][valid].astype(np.float64)
    seen = np.isfinite(hits.ranges_m)
    error = np.full(len(mine_m), np.inf)
    error[~seen & ~np.isfinite(mine_m)] = 0.0
    both = seen & np.isfinite(mine_m)
    error[both] = np.abs(mine_m[both] / hits.ranges_m[both] - 1.0)
    names = ["", *(label.name for label in frame.labels.instances)]
    theirs = np.array([*(i.name for i in scene.instances), ""])[hits.instances]
    cosine = np.einsum("ij,ij->i", frame.channels["normals"][valid], hits.normals)
    turned = cosine < math.cos(math.radians(0.5))
    turned &= seen

    edge = _silhouettes(valid, hits)
    wrong = (error > 1e-3) | (np.array(names)[frame.channels["instance"][valid]] != theirs)

    points = now[:3, 3] + np.where(seen, hits.ranges_m, 1.0)[:, None] * directions
    offsets = np.where(seen[:, None], points - after[:3, 3], directions)
    there = camera.pixel_from_ray(offsets @ after[:3, :3] @ to_rig)
    flow = there.positions_px - pixel_grid(camera.width_px, camera.height_px)[valid]
    if isinstance(camera, EquirectangularCamera):
        flow[:, 0] -= camera.width_px * np.round(flow[:, 0] / camera.width_px)
    mine = frame.channels["flow"][valid]
    known = there.valid & np.isfinite(mine).all(axis=1)
    off_px = np.linalg.norm(mine[known] - flow[known], axis=1)

    distance_m = np.linalg.norm(offsets, axis=1)
    back = oracle.hits(after[:3, 3], offsets / distance_m[:, None])
    occluded = back.ranges_m < (1.0 - 1e-3) * np.where(seen, distance_m, np.inf)
    occlusion = frame.channels["occluded"][valid]
    judged = (occlusion != OUTSIDE) & seen
    reported, true = occlusion[judged] == OCCLUDED, occluded[judged]
    assert np.isin(occlusion, (VISIBLE, OCCLUDED, OUTSIDE)).all()
    both_occluded = (reported & true).sum()
    return {
        "range": float((error <= 1e-3).mean()),
        "instance": float((np.array(names)[frame.channels["instance"][valid]] == theirs).mean()),
        "normals": float(1.0 - turned.mean()),
        "wrong elsewhere": float((wrong & ~edge).mean()),
        "flow mean px": float(off_px.mean()),
        "flow 99 % px": float(np.percentile(off_px, 99.0)),
        "occlusion F1": float(2.0 * both_occluded / max(reported.sum() + true.sum(), 1)),
        "occluded": int(true.sum()),
    }


def _silhouettes(valid, hits):
    """Valid pixels (n,) next to another instance, or to a leap of the range by 1 %."""
    instances, ranges_m = np.full(valid.shape, -2), np.full(valid.shape, np.inf)
    instances[valid], ranges_m[valid] = hits.instances, hits.ranges_m
    near_m, far_m = np.full(valid.shape, np.inf), np.zeros(valid.shape)
    least, most = instances.copy(), instances.copy()
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            ranges = np.roll(ranges_m, (down, right), (0, 1))
            numbers = np.roll(instances, (down, right), (0, 1))
            near_m, far_m = np.minimum(near_m, ranges), np.maximum(far_m, ranges)
            least, most = np.minimum(least, numbers), np.maximum(most, numbers)
    return ((least != most) | ~(far_m <= 1.01 * near_m))[valid]


def free_poses(oracle, count, low_m, high_m, seed=1):
    """Poses between two corners (3,), a little tilted.

    Nothing is nearer than 0.3 m, there and at the next pose: the virtual cameras see nothing that
    is nearer than their near plane, Embree does.
    """
    random = np.random.default_rng(seed)
    directions = random.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    low, high = np.array([*low_m, -5, -5, 0]), np.array([*high_m, 5, 5, 360])
    poses = []
    while len(poses) < count:
        values = random.uniform(low, high)
        roll_deg, pitch_deg, yaw_deg = values[3:]
        now = pose(values[:3], roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg)
        viewpoints = (now[:3, 3], next_pose(now)[:3, 3])
        if all(oracle.hits(viewpoint, directions).ranges_m.min() > 0.3 for viewpoint in viewpoints):
            poses.append(now)
    return poses


def next_pose(now):
    """0.3 m ahead and to the left, turned by 4°, as a robot's next image may be."""
    return now @ pose((0.28, 0.1, 0.0), yaw_deg=4.0)


def print_comparison(source):
    """Print means and extremes of all lenses over ten poses in a scene."""
    scene = opaque_part(load_scene(source))
    oracle = Oracle(scene)
    poses = free_poses(oracle, 10, *FREE_M[source])
    for name, lens in LENSES.items():
        with open_sensor(scene, lens) as renderer:
            results = [compare(scene, oracle, renderer, now, next_pose(now)) for now in poses]
        for key in results[0]:
            values = np.array([result[key] for result in results])
            print(f"{name:16} {key:14} mean {values.mean():.5f}", end=" ")
            print(f"from {values.min():.5f} to {values.max():.5f}")


if __name__ == "__main__":
    for source in FREE_M:
        if source != WAREHOUSE or WAREHOUSE.is_file():
            print(source)
            print_comparison(source)
