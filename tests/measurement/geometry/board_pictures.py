"""Images of boards through a lens, sampled by the rays of its pixels."""

from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from omnisim.cameras import KannalaBrandtCamera
from omnisim.measurement.geometry import BoardView

LENS = KannalaBrandtCamera(400, 300, (130.0, 131.0), (203.0, 148.5), (0.02, -0.012, 0.004, -0.001))


def board_pose(azimuth_deg=0.0, angle_deg=30.0, distance_m=0.4, tilt=(0.3, -0.2, 0.4)):
    """Pose (4, 4) optical_from_board of a board that faces the camera, tilted."""
    azimuth, angle = np.radians((azimuth_deg, angle_deg))
    across = np.sin(angle)
    outward = np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.cos(angle)])
    side = np.cross([0.0, 1.0, 0.0], outward)
    side /= np.linalg.norm(side)
    pose = np.eye(4)
    pose[:3, :3] = np.stack((side, np.cross(outward, side), outward), axis=1)
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(tilt).as_matrix()
    pose[:3, 3] = distance_m * outward
    return pose


def varied_poses(count, seed=3, distance_m=0.4, widest_deg=60.0):
    """Poses all over the field, tilted."""
    random = np.random.default_rng(seed)
    return [
        board_pose(
            137.5 * index,
            widest_deg * np.sqrt((index + 0.5) / count),
            distance_m * random.uniform(0.8, 1.3),
            random.uniform(-0.5, 0.5, 3),
        )
        for index in range(count)
    ]


def corner_grid(columns=8, rows=6, square_m=0.03):
    """Inner corners (n, 2) of a chessboard, along its rows."""
    y, x = np.mgrid[:rows, :columns]
    return np.stack((x.ravel(), y.ravel()), axis=1) * square_m


def seen_view(camera, pose, points_m, name="image", offsets_m=0.0):
    """Exact corners of a board in an image."""
    points = np.column_stack((points_m, np.zeros(len(points_m)))) + offsets_m
    seen = camera.pixel_from_ray(points @ pose[:3, :3].T + pose[:3, 3])
    assert seen.valid.all()
    return BoardView(name, points_m, seen.positions_px)


def noisy_views(camera, poses, points_m, sigma_px, seed=0, offsets_m=0.0):
    """Corners with Gaussian errors."""
    random = np.random.default_rng(seed)
    views = []
    for index, pose in enumerate(poses):
        exact_px = seen_view(camera, pose, points_m, offsets_m=offsets_m).pixels_px
        noisy_px = exact_px + sigma_px * random.normal(size=exact_px.shape)
        views.append(BoardView(f"{index}.png", points_m, noisy_px))
    return views


def board_image(camera, pose, brightness, samples=4):
    """Gray image uint8 of a board.

    Args:
        camera: lens.
        pose: (4, 4) optical_from_board.
        brightness: function of positions x, y on the board, m; NaN beside it.
        samples: samples per side of a pixel.
    """
    levels = np.zeros((camera.height_px, camera.width_px))
    origin, normal = pose[:3, 3], pose[:3, 2]
    for rays in _rays_of_samples(camera, samples):
        slopes = rays.directions @ normal
        with np.errstate(all="ignore"):
            distance = (origin @ normal) / slopes
            points = (rays.directions * distance[..., None] - origin) @ pose[:3, :3]
        seen = brightness(points[..., 0], points[..., 1])
        hit = rays.valid & (distance > 0.0) & np.isfinite(seen)
        levels += np.where(hit, np.nan_to_num(seen), 0.35)
    levels /= samples**2
    return np.rint(20.0 + 215.0 * levels).astype(np.uint8)


@lru_cache(maxsize=1)  # tests take several images with a lens
def _rays_of_samples(camera, samples):
    """Rays through a sample of each pixel, by sample."""
    v, u = np.mgrid[: camera.height_px, : camera.width_px].astype(np.float64)
    steps = (np.arange(samples) + 0.5) / samples - 0.5
    return [
        camera.ray_from_pixel(np.stack((u + du, v + dv), axis=-1)) for dv in steps for du in steps
    ]


def chessboard_texture(columns=8, rows=6, square_m=0.03):
    """Brightness of a chessboard by its inner corners, with a white border."""

    def brightness(x, y):
        column, row = np.floor(x / square_m) + 1, np.floor(y / square_m) + 1
        inside = (column >= 0) & (column <= columns) & (row >= 0) & (row <= rows)
        on_paper = (column >= -1) & (column <= columns + 1) & (row >= -1) & (row <= rows + 1)
        black = inside & ((column + row) % 2 == 0)
        return np.where(on_paper, 1.0 - black, np.nan)

    return brightness


def printed_texture(print_, width_m, height_m, origin_m=(0.0, 0.0), border_m=0.02):
    """Brightness of a printed image, whose upper left corner lies at `origin_m` on the board."""
    height, width = print_.shape

    def brightness(x, y):
        column = np.floor((x - origin_m[0]) / width_m * width).astype(np.int64, copy=False)
        row = np.floor((y - origin_m[1]) / height_m * height).astype(np.int64, copy=False)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        shown = print_[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)] / 255.0
        beyond_m = np.stack((origin_m[0] - x, x - width_m - origin_m[0],
                             origin_m[1] - y, y - height_m - origin_m[1]))  # fmt: skip
        on_paper = (beyond_m < border_m).all(axis=0)
        return np.where(inside, shown, np.where(on_paper, 1.0, np.nan))

    return brightness


def charuco_texture(columns=7, rows=5, square_m=0.03, marker_m=0.022):
    """Brightness of OpenCV's print of a ChArUco board with markers of 5X5_100."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    board = cv2.aruco.CharucoBoard((columns, rows), square_m, marker_m, dictionary)
    printed = board.generateImage((300 * columns, 300 * rows))
    return printed_texture(printed, columns * square_m, rows * square_m)


def april_grid_texture(quarter_turns=0, columns=3, rows=2, tag_m=0.06):
    """Brightness of Kalibr's grid with a spacing of 0.3, from the lower left corner of tag 0."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    pixels = 200
    gap = int(0.3 * pixels)
    height, width = (count * (pixels + gap) - gap for count in (rows, columns))
    printed = np.full((height + 2 * gap, width + 2 * gap), 255, np.uint8)
    for row in range(rows + 1):  # black squares between the tags' corners
        for column in range(columns + 1):
            v, u = row * (pixels + gap), column * (pixels + gap)
            printed[v : v + gap, u : u + gap] = 0
    for number in range(rows * columns):
        row, column = rows - 1 - number // columns, number % columns
        tag = cv2.aruco.generateImageMarker(dictionary, number, pixels, borderBits=2)
        v, u = gap + row * (pixels + gap), gap + column * (pixels + gap)
        printed[v : v + pixels, u : u + pixels] = np.rot90(tag, quarter_turns)
    scale = tag_m / pixels
    origin = -gap * scale, -(height + gap) * scale
    return printed_texture(printed, printed.shape[1] * scale, printed.shape[0] * scale, origin)
