"""Images against Mitsuba's path tracer: a physical mirror, rooms of glass, and the arcade."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera
from omnisim.core.arrays import Bools, Floats, Floats32
from omnisim.core.srgb import srgb_from_linear
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS, OmniCamera
from omnisim.rendering.rays.caster import NO_TRIANGLE, EmbreeMesh
from omnisim.rendering.shared_scene import BackendName
from omnisim.rendering.stage import open_sensor
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.scene import Scene, load_scene
from omnisim.scene.model import Material
from omnisim.sensors import SpinningLidar
from omnisim.sensors.lidar.spinning_lidar import PointCloud
from omnisim.validation import reflective_rooms
from omnisim.validation.fixture import (
    BACKENDS,
    Fixture,
    linear_image,
    max_abs,
    mean_abs,
    mirror_camera,
)
from omnisim.validation.image_differences import (
    converged_psnr_db,
    displacement_figure,
    displacements,
    noise_floor_db,
    psnr_db,
)
from omnisim.validation.oracles.mitsuba_optics import trace_mirror
from omnisim.validation.oracles.surfaces import opaque_only
from omnisim.validation.plain_scenes import Markers, world_from_looking_up
from omnisim.validation.traced_light import CAMERAS, beside, inside_rim, ray_counts, views

SIZE_PX, QUICK_SIZE_PX = 512, 256
SAMPLES, QUICK_SAMPLES = 144, 64  # squares, as its sampler wants
FINE = 4  # supersampling of the image that shows the share of antialiasing in the difference
MARKERS = 60
BOUND_DB, FINE_BOUND_DB = 32.0, 40.0
MARKER_BOUND_PX, SHIFT_BOUND_PX = 0.1, 0.1


def check_mirror(fixture: Fixture, title: str) -> Section:
    """Compare omnisim's images of the textured scene and of markers with Mitsuba's real mirror."""
    size = QUICK_SIZE_PX if fixture.is_quick else SIZE_PX
    samples = QUICK_SAMPLES if fixture.is_quick else SAMPLES
    sensor = OmniCamera().with_polygons(None).resized(size)
    scene, pose = opaque_only(fixture.scene), sensor.base_pose(fixture.viewpoint_m, yaw_deg=20.0)
    camera, world_from_optical = mirror_camera(sensor), world_from_looking_up(sensor, pose)
    traced, again = (
        trace_mirror(scene, camera, world_from_optical, samples, seed=seed) for seed in (0, 1)
    )
    inside = inside_rim(sensor)
    finer = dataclasses.replace(sensor, supersampling=FINE, texels_per_pixel=float(FINE))
    exact, mesh, fine = (
        linear_image(fixture.render(scene, each, pose))
        for each in (sensor, sensor.with_polygons(PAPER_POLYGONS), finer)
    )
    exact_db, mesh_db, fine_db = (psnr_db(traced, image, inside) for image in (exact, mesh, fine))
    theirs, ours = (255.0 * srgb_from_linear(image).mean(axis=-1) for image in (traced, fine))
    shifts = displacements(theirs, ours, inside)
    lengths = np.linalg.norm(shifts.shifts_px, axis=1)
    markers = _marker_distances(fixture, sensor.resized(SIZE_PX), pose)
    floor = noise_floor_db(traced, again, inside)
    return Section(
        title,
        f"omnisim's image against Mitsuba's path tracer, with {samples} rays per pixel from a real "
        "pinhole to a real mirror, a mesh of the hyperboloid with an error of 0.001 px, and into "
        "the textured scene, whose surfaces emit their base colors. Mitsuba uses neither omnisim's "
        f"rays nor ξ. Its noise is {floor:.1f} dB. The remaining difference from the default image "
        f"is antialiasing: with {FINE} × {FINE} samples per pixel it is smaller.",
        (
            Measure("exact capture, default quality", exact_db, "dB", BOUND_DB, at_least=True),
            Measure(f"exact capture, {FINE} × {FINE} samples per pixel", fine_db, "dB",
                    FINE_BOUND_DB, at_least=True),
            Measure("markers, mean distance", mean_abs(markers), "px", MARKER_BOUND_PX),
            Measure("markers, largest distance", max_abs(markers), "px", 2.0 * MARKER_BOUND_PX),
            Measure("shift of the texture's edges, mean", mean_abs(lengths), "px", SHIFT_BOUND_PX),
            Measure("size", size, "px"),
            Measure("samples per pixel", samples),
            Measure("noise floor", floor, "dB"),
            Measure("1024 polygons, default quality", mesh_db, "dB"),
            Measure("markers", len(markers)),
            Measure("patches with edges", len(lengths)),
            Measure("shift of the texture's edges, 95 %", float(np.percentile(lengths, 95)), "px"),
        ),
        figures=(
            CaptionedFigure("traced-mirror",
                    gallery(beside("", traced, exact, inside), 3, side_in=4.2),
                    "Traced mirror, omnisim's exact capture, and their difference × 8: differences "
                    "are at edges only, equally on both sides."),
            CaptionedFigure("traced-shifts",
                    displacement_figure("Traced mirror − ours", sensor.model, *shifts),
                    "Shifts of image patches between the two images, × 300."),
        ),
    )  # fmt: skip


def _marker_distances(fixture: Fixture, sensor: OmniCamera, pose: Floats) -> Floats:
    """Distances (n,) between the centers of markers in the traced image and in ours."""
    markers = Markers.around(sensor, pose, MARKERS)
    traced = trace_mirror(markers.scene, mirror_camera(sensor), markers.world_from_optical, 64)
    ours = linear_image(fixture.render(markers.scene, sensor, pose))
    return np.linalg.norm(markers.centers_px(traced) - markers.centers_px(ours), axis=1)


# Reflections of both back ends against Mitsuba's path tracer.


WIDTH_PX, QUICK_WIDTH_PX = 240, 120
SUPERSAMPLING = 4  # omnisim: 16 samples per pixel, with 8 rays each on glossy surfaces
ROOM_SAMPLES = 256  # Mitsuba: samples per pixel
MIN_DB = {
    "planar mirror": 36.0,
    "floor of roughness 0.1": 34.0,
    "floor of roughness 0.3": 34.0,
    "chrome ball": 32.0,
    "ball of roughness 0.3": 32.0,
    "thick glass ball": 32.0,
    "thin pane": 36.0,
}
BY_PROBES = ("chrome ball", "ball of roughness 0.3", "thick glass ball")  # by cube
MIN_BY_PROBES_DB = 28.0


def check_reflections(fixture: Fixture, title: str) -> Section:
    """Render each room with omnisim and Mitsuba, and compare the images."""
    images: dict[str, NDArray[np.generic]] = {}
    measures = []
    width_px = QUICK_WIDTH_PX if fixture.is_quick else WIDTH_PX
    rooms = reflective_rooms.rooms()
    for name, scene in rooms.items():
        traced = traced_paths(scene, width_px, ROOM_SAMPLES)
        everywhere = np.ones(traced.shape[:2], dtype=np.bool_)
        for backend in BACKENDS:
            label = name if backend == "rays" else f"{name}, back end cube"
            ours = rendered(scene, width_px, backend=backend)
            least = MIN_DB[name] if backend == "rays" else min_by_cube_db(name)
            value = psnr_db(ours, traced, everywhere)
            measures.append(Measure(f"{label}: PSNR", value, "dB", least, at_least=True))
            if backend == "rays" or name in BY_PROBES:
                caption = name if backend == "rays" else f"{name}, cube"
                images |= beside(caption, traced, ours, everywhere)
    pose = reflective_rooms.camera_pose()
    measures += beam_measures(rooms["thin pane"], rooms["planar mirror"], pose)
    return Section(
        title,
        "A room with luminous walls, reflected in a mirror, a glossy floor and metal balls, and "
        "seen through a pane and a glass ball, by `--backend rays` and by the default back end, "
        "`cube`, which approximates balls by probes. Mitsuba's paths are converged. Its shadowing "
        "and masking of facets are uncorrelated. A lidar at the camera's place is compared with "
        "straight rays behind the pane, and with the mirrored room.",
        measures,
        figures=[CaptionedFigure("reflections", gallery(images, 3),
                                 "Rooms by both renderers, and their difference × 8.")],
    )  # fmt: skip


def min_by_cube_db(name: str) -> float:
    """Least PSNR of a room by the back end of cubes."""
    return MIN_BY_PROBES_DB if name in BY_PROBES else MIN_DB[name]


def rendered(
    scene: Scene, width_px: int, supersampling: int = SUPERSAMPLING, backend: BackendName = "rays"
) -> Floats32:
    """Linear image (height, width, 3) of a room by omnisim, clipped to white."""
    camera = reflective_rooms.camera(width_px, supersampling)
    with open_sensor(scene, camera, backend=backend) as renderer:
        ours = renderer.render(reflective_rooms.camera_pose(), linear=True).linear
    assert ours is not None
    return np.clip(ours[..., :3], 0.0, 1.0)


def traced_paths(scene: Scene, width_px: int, samples: int) -> Floats32:
    """Linear image (height, width, 3) of a room by Mitsuba, clipped to white."""
    from omnisim.validation.oracles.mitsuba_light import trace_reflections  # of an extra

    camera, pose = reflective_rooms.camera(width_px, 1), reflective_rooms.camera_pose()
    assert isinstance(camera.model, PerspectiveCamera)
    return np.clip(trace_reflections(scene, camera.model, pose, samples), 0.0, 1.0)


# A scene of glass, mirrors, metal and polished stone against a path tracer.
#
# omnisim's image is compared with Mitsuba's converged one, estimated from two images with
# independent noise (`converged_psnr_db`).


SCENE = "arcade"
# The quick check has the mirror alone: at 48 px the fisheye's pixels hold whole signs and shops.
ARCADE_PX, QUICK_ARCADE_PX = 96, 48
# Squares, as Mitsuba's sampler requires, by camera: a texel of the fisheye is 1/16 of a pixel.
ARCADE_SAMPLES = {"mirror": 1024, "fisheye": 36}
ARCADE_SUPERSAMPLING = 8  # omnisim: 64 samples per pixel, as chips of stone are smaller than pixels
ARCADE_BOUND_DB = 32.0


def check_arcade(fixture: Fixture, title: str) -> Section:
    """Render the arcade with both back ends and with Mitsuba, and compare."""
    measures: list[Measure] = []
    images: dict[str, NDArray[np.generic]] = {}
    size_px = QUICK_ARCADE_PX if fixture.is_quick else ARCADE_PX
    scene = load_scene(SCENE)
    for view in views(scene, size_px, CAMERAS[:1] if fixture.is_quick else CAMERAS):
        camera, inside = view.camera, view.inside
        first, second = view.traced_twice(ARCADE_SAMPLES[camera])
        sensor = dataclasses.replace(view.sensor, supersampling=ARCADE_SUPERSAMPLING)
        fine = view._replace(sensor=sensor)
        rays, cube = (fine.ours(fixture, backend=backend) for backend in BACKENDS)
        rays_db, cube_db = (converged_psnr_db(x, first, second, inside) for x in (rays, cube))
        floor_db = noise_floor_db(first, second, inside)
        measures += [
            Measure(f"{camera}, back end rays", rays_db, "dB", ARCADE_BOUND_DB, at_least=True),
            Measure(f"{camera}, back end cube", cube_db, "dB"),
            Measure(f"{camera}: one of Mitsuba's images against the converged one", floor_db, "dB"),
        ]
        mean = (0.5 * (first + second)).astype(np.float32)
        images |= beside(f"{camera}, rays", mean, rays, inside)
        images |= beside(f"{camera}, cube", mean, cube, inside)
    measures += [Measure("size", size_px, "px"), *ray_counts(ARCADE_SAMPLES)]
    return Section(
        title,
        "The built-in scene `arcade` with its bake: panes, mirrors, a glossy floor, chrome "
        "and brushed metal, frosted and thick glass. Mitsuba traces all light, from a real mirror, "
        "or from the faces of a cube for the fisheye. The PSNR is that to Mitsuba's converged "
        "image, from two images with independent noise. Mitsuba's gloss takes no light from the "
        "color below.",
        measures,
        figures=[CaptionedFigure("arcade", gallery(images, 6, side_in=2.7),
                 "The arcade traced by Mitsuba, by both back ends of omnisim, and their difference "
                 "× 8.")],
    )  # fmt: skip


# A lidar behind a pane and by a mirror: straight rays, mirrored geometry, Fresnel's equations.
#
# Nothing here follows a beam: the pane is left out of the scene, and the scene behind the mirror is
# mirrored. Embree finds the triangle, and its plane gives the range in float64.


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
