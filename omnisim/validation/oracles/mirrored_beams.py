"""A lidar behind a pane and by a mirror: straight rays, mirrored geometry, Fresnel's equations.

Nothing here follows a beam: the pane is left out of the scene, and the scene behind the mirror is
mirrored. Embree finds the triangle, and its plane gives the range in float64.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats
from omnisim.rendering.rays.caster import NO_TRIANGLE, EmbreeMesh
from omnisim.rendering.stage import open_sensor
from omnisim.report.report import Measure
from omnisim.scene import Scene
from omnisim.scene.model import Material
from omnisim.sensors import SpinningLidar
from omnisim.sensors.lidar.spinning_lidar import PointCloud

MAX_OFF_MM, MAX_INTENSITY_OFF_PERCENT = 1.0, 1.0
SHARE = 99.9  # percent of the beams; others pass an edge within a rounding of float32
_PANEL = "panel"  # name of the pane or mirror


class _Found(NamedTuple):
    """Surfaces along rays (n,): ranges, +inf: none, cosines of incidence, and red colors."""

    ranges_m: Floats
    cosines: Floats
    reds: Floats


class _Triangles(NamedTuple):
    """Triangles of a scene: corners (m, 3, 3), world, and red base colors (m,)."""

    corners_m: Floats
    reds: Floats

    @classmethod
    def of(cls, scene: Scene) -> _Triangles:
        """Triangles of a scene whose meshes have one color per triangle."""
        corners, reds = [], []
        for instance in scene.instances:
            mesh = scene.meshes[instance.mesh]
            pose = instance.world_from_mesh
            positions_m = mesh.positions @ pose[:3, :3].T + pose[:3, 3]
            corners.append(positions_m[mesh.triangles].astype(np.float64))
            red = scene.materials[mesh.material].base_color[0]
            shares = np.ones(len(mesh.triangles))
            if mesh.colors is not None:
                shares = mesh.colors[mesh.triangles[:, 0], 0].astype(np.float64)
            reds.append(red * shares)
        return cls(np.concatenate(corners), np.concatenate(reds))

    def cast(self, origins_m: Floats, directions: Floats) -> _Found:
        """Surfaces along rays (n, 3)."""
        mesh = EmbreeMesh.of_corners(self.corners_m)
        single = origins_m.astype(np.float32), directions.astype(np.float32)
        triangles = mesh.hits(*single).triangles
        hit = np.flatnonzero(triangles != NO_TRIANGLE)
        a, b, c = np.moveaxis(self.corners_m[triangles[hit]], 1, 0)
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        along = np.einsum("nc,nc->n", normals, directions[hit])
        found = _Found(*(np.full(len(triangles), value) for value in (np.inf, 0.0, 0.0)))
        found.ranges_m[hit] = np.einsum("nc,nc->n", normals, a - origins_m[hit]) / along
        found.cosines[hit], found.reds[hit] = np.abs(along), self.reds[triangles[hit]]
        return found


def pane_reflectance_by_series(cosines: Floats, ior: float) -> Floats:
    """Reflectance (n,) of two interfaces: Fresnel's sines and tangents, and 60 reflections."""
    outside = np.arccos(np.clip(cosines, 0.0, 1.0 - 1e-9))
    inside = np.arcsin(np.sin(outside) / ior)
    across = (np.sin(outside - inside) / np.sin(outside + inside)) ** 2
    along = (np.tan(outside - inside) / np.tan(outside + inside)) ** 2
    once = 0.5 * (across + along)
    total: Floats = once.copy()
    inner = (1.0 - once) ** 2 * once
    for _ in range(60):
        total += inner
        inner *= once**2
    return total


def beam_measures(
    pane_room: Scene, mirror_room: Scene, at: Floats, firings: int = 512
) -> list[Measure]:
    """Measures of a lidar in a room with a pane, and in one with a mirror.

    Args:
        pane_room, mirror_room: rooms whose instance "panel" is the pane or the mirror.
        at: (4, 4) pose of the lidar.
        firings: number of firings.
    """
    lidar = dataclasses.replace(
        SpinningLidar.hdl64e().without_errors(), range_min_m=0.0, firings=firings
    )
    metal = _panel_material(mirror_room)
    tinted = dataclasses.replace(metal, base_color=(0.8, 0.7, 0.6, 1.0))
    materials = tuple(tinted if each is metal else each for each in mirror_room.materials)
    rooms = {"pane": pane_room, "mirror": dataclasses.replace(mirror_room, materials=materials)}
    measures = []
    for name, room in rooms.items():
        with open_sensor(room, lidar, backend="rays") as renderer:
            cloud = renderer.scan(at)
        beams, panel = _beams(room, lidar, at), _panel_material(room)
        triangles, cosines = _Triangles.of(room.removed(_PANEL)), beams.to_panel.cosines
        if name == "pane":  # the room without the pane, less Fresnel's shares
            seen = triangles.cast(beams.origins_m, beams.directions)
            ranges_m = seen.ranges_m
            reflected = pane_reflectance_by_series(cosines, panel.ior)
            once = (1.0 - reflected) * panel.transmission * panel.base_color[0]
        else:  # the room mirrored at the panel, less Schlick's shares
            heights_m = (triangles.corners_m - beams.point_m) @ beams.normal
            mirrored_m = triangles.corners_m - 2.0 * heights_m[..., None] * beams.normal
            to_panel_m = np.where(beams.meets_panel, beams.to_panel.ranges_m, 0.0)
            # from the mirror on, behind which the mirrored room begins
            starts_m = beams.origins_m + to_panel_m[:, None] * beams.directions
            seen = triangles._replace(corners_m=mirrored_m).cast(starts_m, beams.directions)
            ranges_m = to_panel_m + seen.ranges_m
            f0 = panel.base_color[0]
            once = f0 + (1.0 - f0) * (1.0 - cosines) ** 5
        intensities = once**2 * seen.reds * seen.cosines
        off_mm, off_percent = _deviations(cloud, ranges_m, intensities, beams)
        start = f"lidar, {name}: {SHARE} % of the"
        measures += [
            Measure(f"{start} points within", off_mm, "mm", MAX_OFF_MM),
            Measure(f"{start} intensities within", off_percent, "%", MAX_INTENSITY_OFF_PERCENT),
        ]
    return measures


def _panel_material(room: Scene) -> Material:
    mesh = next(mesh for mesh in room.meshes if mesh.name == _PANEL)
    return room.materials[mesh.material]


class _Beams(NamedTuple):
    """All beams of a lidar (n,), world, and those that meet the panel first."""

    origins_m: Floats
    directions: Floats
    meets_panel: Bools
    to_panel: _Found
    normal: Floats  # (3,) of the panel
    point_m: Floats  # (3,) on the panel


def _beams(room: Scene, lidar: SpinningLidar, at: Floats) -> _Beams:
    directions = lidar.beams.directions.reshape(-1, 3) @ at[:3, :3].T
    origins_m = np.tile(at[:3, 3], (len(directions), 1))
    others = _Triangles.of(room.removed(_PANEL)).cast(origins_m, directions)
    panels = tuple(each for each in room.instances if each.name == _PANEL)
    panel = _Triangles.of(dataclasses.replace(room, instances=panels))
    met = panel.cast(origins_m, directions)
    a, b, c = panel.corners_m[0]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    return _Beams(origins_m, directions, met.ranges_m < others.ranges_m, met, normal, a)


def _deviations(
    cloud: PointCloud, ranges_m: Floats, intensities: Floats, beams: _Beams
) -> tuple[float, float]:
    """Deviations of ranges in mm and of intensities in percent that `SHARE` of the beams keep.

    Beams that meet the panel count, unless they return from it.
    """
    lidar, points = cloud.lidar, cloud.points
    firings = np.rint(points["time"] / lidar.period_s * lidar.firings).astype(int)
    numbers = points["ring"].astype(int) * lidar.firings + firings
    is_behind = beams.meets_panel[numbers]
    is_behind &= points["range"] > beams.to_panel.ranges_m[numbers] + 1e-3
    points, numbers = points[is_behind], numbers[is_behind]
    if len(numbers) < 100:
        return float("nan"), float("nan")
    off_mm = 1e3 * np.abs(points["range"] - ranges_m[numbers])
    off_percent = 100.0 * np.abs(points["intensity"] / intensities[numbers] - 1.0)
    return float(np.percentile(off_mm, SHARE)), float(np.percentile(off_percent, SHARE))
