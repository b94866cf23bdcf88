"""Orientation of the six sides of a room in images, compared with the physics of mirrors.

The physics, without any of our frames: the camera looks straight up, so with the vehicle's front
at the top of its image the right of the image is up × front, the vehicle's left. A mirror
above it shows the front toward the top, and the left toward the right.
"""

from __future__ import annotations

import math

import numpy as np

from omnisim.cameras import CentralCamera, CylindricalCamera, pixel_grid
from omnisim.core import coordinate_frames as frames
from omnisim.core import poses
from omnisim.core.arrays import Bytes, Floats, Floats32
from omnisim.core.bilinear import sample
from omnisim.core.srgb import linear_from_srgb
from omnisim.ground_truth.frame import Frame
from omnisim.perception.unwarping import Unwarping, View, cylinder_view, perspective_view
from omnisim.plots.style import BLUE, GRAY, gallery, plot
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.scene import Scene, load_scene
from omnisim.validation.fixture import Fixture, linear_image, max_abs, mirror_camera
from omnisim.validation.image_differences import psnr_db
from omnisim.validation.plain_scenes import WHITE, plain_scene, quads

# Where each side of the room shows nothing but its paint, between two lines: meters east, north
# and up from the viewpoint.
PLAIN_POINTS = {
    "east": (3.0, 0.25, -0.95),
    "north": (0.25, 3.0, -0.95),
    "west": (-3.0, 0.25, -0.95),
    "south": (0.25, -3.0, -0.95),
    "up": (0.25, 2.25, 1.8),
    "down": (0.25, 1.25, -1.2),
}
HEADINGS_DEG = (0.0, 90.0, 215.0)
RIM_DEG = 150.0
COLOR_BOUND = 0.02  # linear, below the difference of any two sides by far
READS_BOUND = 0.8  # correlation of a word with itself seen in a panorama


def check_orientation(fixture: Fixture, title: str) -> Section:
    """Find the six named sides in images at three headings, and recognize their words."""
    scene = load_scene("compass")
    table = {
        "mirror": {"theta_max_deg": RIM_DEG, "polygons": "exact"},
        "camera": {"supersampling": 1 if fixture.is_quick else 2},
    }
    sensor = OmniCamera.from_table(table).resized(480)
    worst, frames = 0.0, {}
    for heading_deg in HEADINGS_DEG:
        pose = sensor.base_pose(scene.start.position_m, yaw_deg=heading_deg)
        frames[heading_deg] = frame = fixture.render(scene, sensor, pose)
        worst = max(worst, _worst_color(scene, sensor, frame, heading_deg))
    normal, mirrored, panorama = _reading(fixture, scene)
    return Section(
        title,
        "Images of a room with labeled walls, from a camera that looks up at the mirror, at "
        f"{len(HEADINGS_DEG)} headings. Optics without omnisim's frames predict the position of "
        "each wall's color: the front wall at the top, the left wall on the right. The unwarped "
        "panorama reads from left to right, as a person turning to the right sees the walls.",
        (
            Measure("largest difference of a side's color from its paint", worst,
                    bound=COLOR_BOUND),
            Measure("lowest correlation of a panorama's word with the painted one", normal,
                    bound=READS_BOUND, at_least=True),
            Measure("highest correlation with the mirrored word", mirrored, bound=0.6),
        ),
        figures=[
            CaptionedFigure("orientation-mirror",
                    gallery({f"heading {h:.0f}°": f.rgb for h, f in frames.items()}, 3),
                    "The mirror's image at three headings (0° is east, 90° north): the front wall "
                    "is at the top, words are mirrored, and the dark outer ring is the ceiling."),
            CaptionedFigure("orientation-panorama", gallery({"": panorama}, 1, side_in=10.0),
                    "The panorama, facing east: north is on the left, south on the right, and "
                    "words read normally."),
        ],
    )  # fmt: skip


def _texture(scene: Scene, side: str) -> Bytes:
    """Texture (height, width, 3) of a side of the room."""
    mesh = next(mesh for mesh in scene.meshes if mesh.name == side)
    texture = scene.materials[mesh.material].texture
    assert texture is not None
    return texture.pixels[..., :3]


def _worst_color(scene: Scene, sensor: OmniCamera, frame: Frame, heading_deg: float) -> float:
    """Maximum difference in linear color between a side's paint and its pixels in the image."""
    camera, linear = mirror_camera(sensor), linear_image(frame)
    heading = math.radians(heading_deg)
    front = np.array([math.cos(heading), math.sin(heading), 0.0])
    image_right = np.cross([0.0, 0.0, 1.0], front)  # look × top, the camera looks up
    worst = 0.0
    for side, aim in PLAIN_POINTS.items():
        theta = math.acos(-aim[2] / np.linalg.norm(aim))
        level = np.array([aim[0], aim[1], 0.0]) / math.hypot(aim[0], aim[1])
        radius = float(camera.image_radius(theta).radii_px)
        u = camera.principal_point_px[0] + radius * (level @ image_right)
        v = camera.principal_point_px[1] - radius * (level @ front)
        around = np.stack(np.meshgrid(u + np.arange(-1, 2), v + np.arange(-1, 2)), axis=-1)
        seen = [np.median(sample(linear[..., channel], around)) for channel in range(3)]
        # the paint is the texture's most frequent color; a color as one number: three bytes
        packed = _texture(scene, side).astype(np.int64) @ [1 << 16, 1 << 8, 1]
        common = int(np.bincount(packed.ravel()).argmax())
        levels = np.array([common >> 16, common >> 8 & 255, common & 255])
        paint = linear_from_srgb(levels / 255.0)
        worst = max(worst, float(np.abs(np.array(seen) - paint).max()))
    return worst


def _reading(fixture: Fixture, scene: Scene) -> tuple[float, float, Bytes]:
    """Correlations of the walls' painted words with the panorama, and the panorama.

    The first is the minimum over all walls; the second, of the mirrored panorama, the maximum.
    """
    sensor = OmniCamera().with_polygons(None).resized(720)
    position = scene.start.position_m
    frame = fixture.render(scene, sensor, sensor.base_pose(position))
    view = cylinder_view(1800, math.radians(-45.0), math.radians(14.0))
    cylinder = view.camera
    assert isinstance(cylinder, CylindricalCamera)
    base_from_optical = np.array(frame.metadata["world_from_optical"])[:3, :3]  # heading 0
    unwarp = Unwarping(sensor.model, cylinder, base_from_optical.T @ view.base_from_view)
    panorama = unwarp(frame.rgb)
    gray = panorama.astype(np.float64).mean(axis=2)
    normal, mirrored = 1.0, -1.0
    # reading order: a turn to the right leads from east to south, west and north
    for quarter, side in enumerate(("east", "south", "west", "north")):
        paint = _texture(scene, side).astype(np.float64).mean(axis=2)
        height, width = paint.shape
        # the middle of the wall, where its word is: ±0.4 rad, up to the rim's elevation
        azimuth = np.linspace(-0.4, 0.4, 241)
        tangent = np.linspace(-0.2, 0.2, 121)
        column = cylinder.focal_length_px * azimuth
        row = cylinder.principal_point_px[1] - cylinder.focal_length_px * tangent
        middle = cylinder.principal_point_px[0] + quarter * 0.25 * cylinder.width_px
        u = (middle + column) % cylinder.width_px
        seen = sample(gray, np.stack(np.meshgrid(u, row), axis=-1))
        # the same points on the wall, 3 m away, by plain trigonometry
        across_m = 3.0 * np.tan(azimuth)[None, :] * np.ones((121, 1))
        up_m = position[2] + 3.0 * tangent[:, None] / np.cos(azimuth)[None, :]
        column = (0.5 + across_m / 6.0) * width - 0.5
        row = (1.0 - up_m / 3.0) * height - 0.5
        pixel = np.stack((column, row), axis=-1)
        value = sample(paint, pixel)
        normal = min(normal, _correlation(seen, value))
        mirrored = max(mirrored, _correlation(seen[:, ::-1], value))
    return normal, mirrored, panorama


def _correlation(first: Floats, second: Floats) -> float:
    return float(np.corrcoef(first.ravel(), second.ravel())[0, 1])


# Unwarping: a view from the mirror's image against a pinhole camera's image; straight lines.


IMAGE_PX, VIEW_PX = 1440, 320
YAW_DEG, PITCH_DEG = 30.0, 20.0
PSNR_BOUND_DB, LINE_BOUND_PX = 30.0, 0.5
BARS = 7


def check_unwarping(fixture: Fixture, title: str) -> Section:
    """Unwarp an image of the textured scene, and one of straight bars."""
    supersampling = 1 if fixture.is_quick else 2
    sensor = OmniCamera(supersampling=supersampling).with_polygons(None).resized(IMAGE_PX)
    view = perspective_view(
        VIEW_PX, VIEW_PX, 0.5 * math.pi, math.radians(YAW_DEG), math.radians(PITCH_DEG)
    )
    unwarp = Unwarping(
        sensor.model, view.camera, frames.RIG_FROM_OPTICAL_LOOKING_UP.T @ view.base_from_view
    )
    frame = fixture.render(fixture.scene, sensor, sensor.base_pose(fixture.viewpoint_m))
    unwarped, pinhole = unwarp(linear_image(frame)), _pinhole(fixture)
    suffices = unwarp.valid & (_image_pixels_per_pixel(sensor, view) >= 1.0)
    psnr = psnr_db(unwarped, pinhole, suffices)
    bars = unwarp(_bars(fixture, sensor))
    lines = [_line(bars, view.camera, index) for index in range(BARS)]
    figure, axes = plot("Straight bars in the unwarped view", "u in pixels", "v − line in pixels")
    axes.set_ylim(-0.6, 0.6)
    bends = []
    for index, line in enumerate(lines):
        off = line[:, 1] - np.polyval(np.polyfit(line[:, 0], line[:, 1], 1), line[:, 0])
        bends.append(max_abs(off) if len(line) > 50 else math.nan)
        axes.plot(line[:, 0], off, color=BLUE if index % 2 else GRAY, linewidth=0.8)
    shown = {"unwarped": unwarped, "pinhole camera": pinhole}
    masked = {name: np.where(unwarp.valid[..., None], x, 0.0) for name, x in shown.items()}
    return Section(
        title,
        f"A 90° view of {VIEW_PX} px, unwarped from the mirror's image of {IMAGE_PX} px, against "
        "the image of a pinhole camera at the effective viewpoint, where the mirror's image has at "
        f"least the view's resolution ({100.0 * suffices.mean():.0f} % of the view). Then the "
        f"straightness of {BARS} straight bars in the view.",
        (
            Measure("unwarped view against the pinhole camera's", psnr, "dB", PSNR_BOUND_DB,
                    at_least=True),
            Measure("largest distance of a bar from a straight line", max(bends), "px",
                    LINE_BOUND_PX),
            Measure("columns that the bars were measured in", sum(len(line) for line in lines)),
        ),
        figures=(
            CaptionedFigure("unwarped", gallery(masked | {"bars, unwarped": bars}, 3),
                    "The view unwarped from the mirror's image, the image of a pinhole camera, and "
                    "unwarped straight bars."),
            CaptionedFigure("straight-bars", figure,
                    "Distance of each bar from its fitted straight line."),
        ),
    )  # fmt: skip


def _pinhole(fixture: Fixture) -> Floats32:
    """Image of a pinhole camera: the front face of a rig with the yaw and pitch of the view."""
    fine = 4  # its pixels are averages, too
    sensor = OmniCamera(face_size_px=fine * VIEW_PX)
    pose = poses.pose(fixture.viewpoint_m, pitch_deg=PITCH_DEG, yaw_deg=YAW_DEG)
    with open_sensor(fixture.scene, sensor, unlit=True, device=fixture.device) as renderer:
        renderer.render(pose)
        face = linear_from_srgb(renderer.faces()["front"] / 255.0)
    averaged: Floats = face.reshape(VIEW_PX, fine, VIEW_PX, fine, 3).mean(axis=(1, 3))
    return averaged.astype(np.float32)


def _image_pixels_per_pixel(sensor: OmniCamera, view: View) -> Floats:
    """Pixels of the mirror's image per pixel of the view, along the coarser direction."""
    grid = pixel_grid(view.camera.width_px, view.camera.height_px)
    rotation = frames.RIG_FROM_OPTICAL_LOOKING_UP.T @ view.base_from_view

    def project(step: tuple[float, float]) -> Floats:
        directions = view.camera.ray_from_pixel(grid + step).directions @ rotation.T
        return sensor.model.pixel_from_ray(directions).positions_px

    u, v = ((0.5, 0.0), (0.0, 0.5))
    steps = [project(step) - project((-step[0], -step[1])) for step in (u, v)]
    # NumPy's stubs give singular values any precision
    singular = np.linalg.svd(np.stack(steps, axis=-1), compute_uv=False)
    return np.asarray(singular[..., 1], dtype=np.float64)


def _bars(fixture: Fixture, sensor: OmniCamera) -> Floats32:
    """Image (height, width, 3) of white bars on black: long, slightly inclined, stacked."""
    forward = np.array([math.cos(math.radians(YAW_DEG)), math.sin(math.radians(YAW_DEG)), 0.0])
    side = np.array([-forward[1], forward[0], 0.0])
    corners = []
    for index in range(BARS):
        # at equal steps down the view, slightly inclined, 2 m ahead
        slope = 0.04 * (index - 3)
        down = math.tan(math.radians(PITCH_DEG - 30.0 + 10.0 * index))
        middle = 2.0 * forward - np.array([0.0, 0.0, 2.0 * down])
        along = 4.0 * (side + np.array([0.0, 0.0, slope]))
        half = np.array([0.0, 0.0, 0.016])
        corners.append([middle - along - half, middle + along - half,
                        middle + along + half, middle - along + half])  # fmt: skip
    scene = plain_scene("bars", (quads("bars", corners), WHITE))
    return linear_image(fixture.render(scene, sensor, np.eye(4)))


def _line(bars: Floats32, camera: CentralCamera, index: int) -> Floats:
    """Positions (n, 2) of a bar in the columns of the view that show it completely."""
    directions = math.radians(PITCH_DEG - 30.0 + 10.0 * index)
    gray = bars[..., 1].astype(np.float64)
    focal, middle = 0.5 * camera.width_px, 0.5 * (camera.height_px - 1)
    expected = middle + focal * math.tan(directions - math.radians(PITCH_DEG))
    rows_by_column: dict[int, float] = {}
    start = camera.width_px // 2
    for columns in (range(start, camera.width_px - 8), range(start - 1, 7, -1)):
        near = expected if not rows_by_column else rows_by_column[start]
        for u in columns:
            rows = np.arange(round(near) - 7, round(near) + 8)
            if rows[0] < 0 or rows[-1] >= camera.height_px:
                break
            column = gray[rows, u]
            if column.sum() > 0.5 and max(column[0], column[-1]) < 0.01:
                near = rows_by_column[u] = float((column * rows).sum() / column.sum())
    return np.array(sorted(rows_by_column.items()))
