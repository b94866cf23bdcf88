"""Scenes of a few plain shapes at exactly known positions, on black, and of chessboards."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras import CentralCamera
from omnisim.cameras.optics import OpticalSystem, ray_jacobians
from omnisim.core import coordinate_frames as frames
from omnisim.core.arrays import Bools, Bytes, Floats, Floats32
from omnisim.core.poses import rotation_from_roll_pitch_yaw
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene.model import Instance, Lighting, Material, Mesh, Scene, StartPose
from omnisim.validation.fixture import Fixture, mirror_camera
from omnisim.validation.oracles import omnidir

WHITE = (1.0, 1.0, 1.0, 1.0)
BLACK = (0.0, 0.0, 0.0, 1.0)
PATTERN = (8, 6)  # inner corners along a row, and rows
SQUARE_M = 0.08
_UNTURNED: Floats = np.eye(3)


def plain_scene(name: str, *colored: tuple[Mesh, tuple[float, float, float, float]]) -> Scene:
    """Scene of meshes in the world frame, each in one linear RGBA color, on black."""
    materials = [Material(base_color=color, double_sided=True, unlit=True) for _, color in colored]
    return scene_at_rest(name, [mesh for mesh, _ in colored], materials)


def scene_at_rest(
    name: str,
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    ambient: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> Scene:
    """Scene of meshes in the world frame, on black, without lamps."""
    rest, black = np.eye(4), (0.0, 0.0, 0.0)
    instances = tuple(Instance(mesh.name, number, rest, rest) for number, mesh in enumerate(meshes))
    lighting = Lighting(ambient, ())
    return Scene(
        name, tuple(meshes), tuple(materials), instances, lighting, black, StartPose(black)
    )


def discs(
    name: str,
    middles_m: Floats,
    viewpoint_m: ArrayLike,
    angular_radius_rad: float,
    corners: int = 24,
) -> Mesh:
    """Mesh of discs at points (n, 3), world frame, of equal angular size, facing the viewpoint."""
    toward = middles_m - np.asarray(viewpoint_m, dtype=np.float64)
    ranges = np.linalg.norm(toward, axis=1, keepdims=True)
    toward = toward / ranges
    helper = np.where(np.abs(toward[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    across = np.cross(helper, toward)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(toward, across)
    angles = 2.0 * np.pi * np.arange(corners) / corners
    circle = np.cos(angles)[:, None, None] * across + np.sin(angles)[:, None, None] * up
    rims = middles_m + circle * ranges * np.tan(angular_radius_rad)
    count = len(middles_m)
    positions = np.concatenate((middles_m, rims.reshape(-1, 3)))
    disc = np.arange(count)
    triangles = [
        np.stack((disc, count * (1 + k) + disc, count * (1 + (k + 1) % corners) + disc), axis=1)
        for k in range(corners)
    ]
    return Mesh(name, positions.astype("f4"), np.concatenate(triangles).astype("u4"), 0)


def quads(name: str, corners_m: ArrayLike, material: int = 0, colors: Floats | None = None) -> Mesh:
    """Mesh of quadrilaterals with corners (n, 4, 3) in the world frame, in order around each.

    `colors` (n, 4, 3) are linear RGB.
    """
    corners = np.asarray(corners_m, dtype=np.float64)
    first = 4 * np.arange(len(corners))[:, None, None]
    triangles = (first + np.array(((0, 1, 2), (0, 2, 3)))).reshape(-1, 3).astype("u4")
    rgba = None
    if colors is not None:
        rgba = np.column_stack((colors.reshape(-1, 3), np.ones(4 * len(corners)))).astype("f4")
    return Mesh(name, corners.reshape(-1, 3).astype("f4"), triangles, material, colors=rgba)


def board_corners_m() -> Floats:
    """Inner corners (n, 3) in the board's frame: x along a row, y along a column, z = 0."""
    columns, rows = PATTERN
    y, x = np.mgrid[:rows, :columns]
    middle = 0.5 * np.array([columns - 1, rows - 1])
    flat = (np.stack((x.ravel(), y.ravel()), axis=1) - middle) * SQUARE_M
    return np.concatenate((flat, np.zeros((len(flat), 1))), axis=1)


def board_poses(count: int, seed: int = 11) -> list[Floats]:
    """Random poses (4, 4) rig_from_board of tilted boards, 10° to 65° below the horizon."""
    random = np.random.default_rng(seed)
    poses = []
    for index in range(count):
        azimuth = 2.0 * math.pi * (index * 0.381966 + 0.03 * random.normal())
        outward = _outward(math.pi - math.radians(random.uniform(25.0, 80.0)), azimuth)
        side = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
        roll, pitch, yaw = random.uniform(-0.6, 0.6, 3)
        tilt = rotation_from_roll_pitch_yaw(roll, pitch, 2.0 * yaw)
        poses.append(_facing(outward, side, tilt, random.uniform(0.55, 0.9)))
    return poses


def board_poses_in_front(
    count: int, max_rad: float, rig_from_optical: Floats = _UNTURNED
) -> list[Floats]:
    """Random poses (4, 4) rig_from_board of tilted boards, up to `max_rad` off the optical axis."""
    random = np.random.default_rng(7)
    rig_from_camera = np.eye(4)
    rig_from_camera[:3, :3] = rig_from_optical
    poses = []
    for index in range(count):
        azimuth = 2.0 * math.pi * (index * 0.381966 + 0.03 * random.normal())
        outward = _outward(max_rad * math.sqrt((index + 0.5) / count), azimuth)
        side = np.cross([0.0, 1.0, 0.0], outward)
        tilt = rotation_from_roll_pitch_yaw(*random.uniform(-0.5, 0.5, 3))
        distance_m = random.uniform(0.9, 1.4)
        pose = _facing(outward, side / np.linalg.norm(side), tilt, distance_m)
        poses.append(rig_from_camera @ pose)
    return poses


def _outward(theta_rad: float, azimuth_rad: float) -> Floats:
    across, up = math.sin(theta_rad), math.cos(theta_rad)
    return np.array([across * math.cos(azimuth_rad), across * math.sin(azimuth_rad), up])


def _facing(outward: Floats, side: Floats, tilt: Floats, distance_m: float) -> Floats:
    """Pose (4, 4) of a board that is turned to the origin, and then tilted."""
    pose = np.eye(4)
    pose[:3, :3] = np.stack((side, np.cross(outward, side), outward), axis=1) @ tilt
    pose[:3, 3] = outward * distance_m
    return pose


def board_images(
    fixture: Fixture, sensor: OmniCamera, rig_from_boards: Sequence[Floats]
) -> Iterator[Bytes]:
    """Images (height, width, 3) of the board at each pose (4, 4)."""
    with open_sensor(board_scene(), sensor, unlit=True, device=fixture.device) as renderer:
        for number, rig_from_board in enumerate(rig_from_boards):
            yield renderer.render(np.linalg.inv(rig_from_board), frame_number=number).rgb


class DetectedBoards(NamedTuple):
    """Images (height, width, 3) with a detected board, and the corners (n, 2) in each."""

    images: list[Bytes]
    corners: list[Floats]


def detected_boards(fixture: Fixture, sensor: OmniCamera, count: int) -> DetectedBoards:
    """Render boards at random poses, and detect their corners by OpenCV."""
    detected = DetectedBoards([], [])
    for image in board_images(fixture, sensor, board_poses(count)):
        corners = omnidir.find_corners(np.ascontiguousarray(image[..., 1]), PATTERN)
        if corners is not None:
            detected.images.append(image)
            detected.corners.append(corners)
    return detected


def board_scene() -> Scene:
    """Scene of an unlit chessboard with a white border, in the board's frame, on black."""
    columns, rows = PATTERN[0] + 1, PATTERN[1] + 1
    white, black = list[Floats](), list[Floats]()
    for row in range(-1, rows + 1):
        for column in range(-1, columns + 1):
            corner = np.array([column - 0.5 * columns, row - 0.5 * rows])
            square = SQUARE_M * (corner + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]))
            inside = 0 <= row < rows and 0 <= column < columns
            (black if inside and (row + column) % 2 else white).append(square)

    def mesh(name: str, squares: list[Floats], material: int) -> Mesh:
        return quads(name, np.pad(np.stack(squares), ((0, 0), (0, 0), (0, 1))), material)

    return plain_scene(
        "chessboard", (mesh("white", white, 0), WHITE), (mesh("black", black, 1), BLACK)
    )


# Markers: small discs around the viewpoint or on rays, and their centroids in images.


# About 12 pixels wide in an image of 1024: sampling errors at the edge average out.
MARKER_RADIUS_RAD = math.radians(0.8)
WINDOW_PX = 12
RADIUS_PX = 6.0  # longer half axis of a marker in the image
STRETCH = 3.0  # maximum ratio of a marker's axes in the image
_MIN_M, _MAX_M = 0.4, 8.0
_CORNERS = 96


def world_from_looking_up(sensor: OmniCamera, world_from_base: Floats) -> Floats:
    """Pose (4, 4) of the optical frame of a camera that looks up at its mirror.

    It has nothing of the camera model, which is under test.
    """
    world_from_optical = world_from_base @ sensor.base_from_rig
    world_from_optical[:3, :3] = world_from_optical[:3, :3] @ frames.RIG_FROM_OPTICAL_LOOKING_UP
    return world_from_optical


class Markers(NamedTuple):
    """Discs around a camera with a mirror, all inside its image."""

    world_from_optical: Floats  # (4, 4)
    positions_m: Floats  # (n, 3), world
    near_px: Floats  # (n, 2) the camera model's projections of the positions
    scene: Scene

    @classmethod
    def around(cls, sensor: OmniCamera, world_from_base: Floats, count: int) -> Markers:
        """At most `count` markers in all directions of the mirror's image."""
        camera, pose = mirror_camera(sensor), world_from_looking_up(sensor, world_from_base)
        viewpoint_m, axis = pose[:3, 3], -pose[:3, 2]  # from the mirror toward the pinhole
        positions = marker_positions(viewpoint_m, axis, camera.mirror.theta_max_rad, count)
        near_px = camera.pixel_from_ray((positions - viewpoint_m) @ pose[:3, :3]).positions_px
        clear = inside_valid_area(camera, near_px)
        scene = marker_scene(positions[clear], viewpoint_m)
        return cls(pose, positions[clear], near_px[clear], scene)

    def centers_px(self, image: Floats32) -> Floats:
        """Centers (n, 2) of the markers in a linear image (height, width, 3)."""
        return centroids(image[..., 1].astype(np.float64), self.near_px)


def marker_positions(viewpoint_m: ArrayLike, axis: ArrayLike, max_rad: float, count: int) -> Floats:
    """Points (count, 3) in directions up to `max_rad` from an axis (3,), 0.6 to 12 m away.

    Source: a spiral by the golden angle, so that no two directions are close together.
    """
    index = np.arange(count) + 0.5
    cosines = 1.0 - index / count * (1.0 - math.cos(max_rad))
    azimuths = index * math.pi * (3.0 - math.sqrt(5.0))
    sines = np.sqrt(1.0 - cosines**2)
    local = np.stack((sines * np.cos(azimuths), sines * np.sin(azimuths), cosines), axis=1)
    z = np.asarray(axis, dtype=np.float64)
    x = np.cross(z, [0.3, 0.9, 0.1])
    x /= np.linalg.norm(x)
    directions = local @ np.stack((x, np.cross(z, x), z))
    ranges = 0.6 * 20.0 ** np.random.default_rng(7).random(count)
    return np.asarray(viewpoint_m) + directions * ranges[:, None]


def marker_scene(positions_m: Floats, viewpoint_m: ArrayLike) -> Scene:
    """Scene of white discs on black, at points (n, 3) of the world frame, facing the viewpoint."""
    mesh = discs("markers", positions_m, viewpoint_m, MARKER_RADIUS_RAD, corners=_CORNERS)
    return plain_scene("markers", (mesh, WHITE))


def marker_rims(positions_m: Floats, viewpoint_m: ArrayLike) -> Floats:
    """Points (n, 96, 3), world, around the rim of each marker."""
    mesh = discs("rims", positions_m, viewpoint_m, MARKER_RADIUS_RAD, corners=_CORNERS)
    rims = mesh.positions[len(positions_m) :].astype(np.float64)
    return rims.reshape(_CORNERS, len(positions_m), 3).swapaxes(0, 1)


def rim_centroids_px(rims_px: Floats) -> Floats:
    """Centroids (n, 2) of the areas inside closed polygons (n, corners, 2) in the image.

    The centroid of a disc's image is not the image of the disc's center: for markers, the two
    differ by 0.03 px.
    """
    start = rims_px.mean(axis=1, keepdims=True)
    local = rims_px - start
    following = np.roll(local, -1, axis=1)
    areas = local[..., 0] * following[..., 1] - local[..., 1] * following[..., 0]
    moments = ((local + following) * areas[..., None]).sum(axis=1)
    return start[:, 0] + moments / (3.0 * areas.sum(axis=1))[:, None]


def inside_valid_area(
    camera: CentralCamera, positions_px: Floats, margin_px: float = WINDOW_PX + 2.0
) -> Bools:
    """Mask (n,) of positions (n, 2) surrounded by valid pixels only."""
    around = positions_px[:, None] + margin_px * _circle(16)
    inside = (around >= 0.0) & (around <= (camera.width_px - 1, camera.height_px - 1))
    clear = camera.ray_from_pixel(around).valid & inside.all(axis=2)
    return np.all(clear, axis=1)


def centroids(brightness: Floats, near_px: Floats) -> Floats:
    """Centroids (n, 2) of brightness in windows around positions (n, 2); NaN for a dark window.

    Args:
        brightness: image (height, width).
        near_px: centers of the windows.
    """
    positions_px = np.full(near_px.shape, np.nan)
    for index, (u, v) in enumerate(np.rint(near_px).astype(int)):
        rows = slice(v - WINDOW_PX, v + WINDOW_PX + 1)
        columns = slice(u - WINDOW_PX, u + WINDOW_PX + 1)
        window = brightness[rows, columns]
        total = float(window.sum())
        if total > 1.0:  # in pixels: a marker has dozens
            down, right = np.mgrid[rows, columns]
            positions_px[index] = (window * right).sum() / total, (window * down).sum() / total
    return positions_px


def marker_pixels(system: OpticalSystem, spacing_px: int) -> Floats:
    """Evenly spaced pixels (n, 2), amid valid rays, at which a marker's stretch is small enough."""
    half = 0.5 * spacing_px
    u, v = (np.arange(half, size, spacing_px) for size in (system.width_px, system.height_px))
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    around = pixels[:, None] + (WINDOW_PX + 3.0) * _circle(16)
    inside = (around >= 0.0) & (around <= (system.width_px - 1, system.height_px - 1))
    valid = system.rays(around).valid & inside.all(axis=2)
    kept = pixels[valid.all(axis=1) & system.rays(pixels).valid]
    sizes = _sizes(system, kept, np.ones(len(kept)))
    return kept[sizes[:, 0] < STRETCH * sizes[:, 1]]


def markers_on_rays(system: OpticalSystem, pixels_px: Floats, world_from_optical: Floats) -> Scene:
    """Scene of white discs on black, perpendicular to the rays of pixels (n, 2), at 0.4 to 8 m."""
    rays = system.rays(pixels_px)
    share = np.random.default_rng(7).random(len(pixels_px))
    ranges_m = _MIN_M * (_MAX_M / _MIN_M) ** share
    radii_m = RADIUS_PX * _sizes(system, pixels_px, ranges_m)[:, 1]
    middles_m = rays.origins_m + ranges_m[:, None] * rays.directions
    frames = _frames(rays.directions)
    circle = _circle(_CORNERS)
    rims_m = middles_m[:, None] + radii_m[:, None, None] * np.einsum("kc,nic->nki", circle, frames)
    places_m = np.concatenate((middles_m, rims_m.reshape(-1, 3)))
    places_m = places_m @ world_from_optical[:3, :3].T + world_from_optical[:3, 3]
    count = len(pixels_px)
    corner = np.arange(_CORNERS)
    first = count + _CORNERS * np.arange(count)[:, None]
    disc = np.broadcast_to(np.arange(count)[:, None], (count, _CORNERS))
    triangles = np.stack((disc, first + corner, first + (corner + 1) % _CORNERS), axis=-1)
    mesh = Mesh("markers", places_m.astype("f4"), triangles.reshape(-1, 3).astype("u4"), 0)
    return plain_scene("markers", (mesh, WHITE))


def _sizes(system: OpticalSystem, pixels_px: Floats, ranges_m: Floats) -> Floats:
    """Maximum and minimum meters per pixel (n, 2), perpendicular to the rays at ranges (n,)."""
    by_pixel = ray_jacobians(system, pixels_px)
    moved = by_pixel.origins_m + ranges_m[:, None, None] * by_pixel.directions
    frames = _frames(system.rays(pixels_px).directions)
    return np.linalg.svd(np.einsum("nic,nij->ncj", frames, moved), compute_uv=False)


def _circle(count: int) -> Floats:
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.stack((np.cos(angles), np.sin(angles)), axis=1)


def _frames(directions: Floats) -> Floats:
    """Orthonormal bases (n, 3, 2) of the planes perpendicular to directions (n, 3)."""
    smallest = np.eye(3)[np.abs(directions).argmin(axis=1)]
    first = np.cross(directions, smallest)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack((first, np.cross(directions, first)), axis=2)
