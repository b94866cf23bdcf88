"""Image of a board by the twin of a camera: the board as a scene, and its light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.measurement.comparison.board_light import (
    MIN_PATCHES,
    BoardLight,
    fit_light,
    patch_levels,
    patch_samples_px,
)
from omnisim.measurement.comparison.printed_pattern import Patches, PrintedPattern
from omnisim.measurement.geometry.board_images import LUMA
from omnisim.measurement.geometry.placed_board import PlacedBoard
from omnisim.rendering.camera.degradations import Encoding
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene.model import Instance, Lighting, Material, Mesh, Scene, StartPose

Floats = NDArray[np.float64]
_CLIPPED = 254.0
_MIN_FALLOFF = 0.05  # share of the light; less of it is not divided out


def render_twin(
    sensor: OmniCamera,
    board: PlacedBoard,
    pattern: PrintedPattern,
    patches: Patches,
    image: NDArray[np.uint8],
) -> NDArray[np.uint8]:
    """Gray image (height, width) of a board by the twin, under light that fits a camera's image.

    Args:
        sensor: twin of the camera.
        board: the board in the image.
        pattern: printed pattern.
        patches: patches to which the light is fitted.
        image: (height, width) gray image of the camera.
    """
    light = _seen_light(sensor, board, patches, image)
    background = float(_encoding(sensor).linearized(np.array(np.median(image) / 255.0)))
    scene = board_scene(board, pattern, light, background)
    rig_from_board = np.eye(4)
    rig_from_board[:3] = sensor.model.rig_from_optical @ board.pose[:3]
    base_from_board = sensor.base_from_rig @ rig_from_board
    with open_sensor(scene, sensor, unlit=True) as renderer:
        frame = renderer.render(np.linalg.inv(base_from_board))
    gray: NDArray[np.uint8] = np.rint(frame.rgba[..., :3] @ LUMA).astype(np.uint8)
    return gray


def board_scene(
    board: PlacedBoard, pattern: PrintedPattern, light: BoardLight, background: float
) -> Scene:
    """Scene of a board in its own frame.

    Args:
        board: board, whose shape is used.
        pattern: printed pattern.
        light: linear light on the board.
        background: linear light of the background.
    """
    lines = np.stack(np.meshgrid(pattern.x_m, pattern.y_m), axis=-1)
    corners = (np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, 1:], np.s_[1:, :-1])
    points = board.surface.points(lines)
    quads = np.stack([points[corner] for corner in corners], axis=2).reshape(-1, 3)
    levels = np.stack([light.at(lines[corner], pattern.is_black) for corner in corners], axis=2)
    first = np.arange(0, len(quads), 4)[:, None]
    triangles = np.concatenate((first + [0, 1, 2], first + [0, 2, 3])).astype("u4")
    colors = np.ones((len(quads), 4), dtype=np.float32)
    colors[:, :3] = levels.reshape(-1, 1)
    mesh = Mesh("board", quads.astype("f4"), triangles, 0, colors=colors)
    return Scene(
        name="board",
        meshes=(mesh,),
        materials=(Material(base_color=(1.0,) * 4, double_sided=True, unlit=True),),
        instances=(Instance("board", 0, np.eye(4)),),
        lighting=Lighting((1.0, 1.0, 1.0), ()),
        background=(background,) * 3,
        start=StartPose((0.0, 0.0, 0.0)),
    )


def _seen_light(
    sensor: OmniCamera, board: PlacedBoard, patches: Patches, image: NDArray[np.uint8]
) -> BoardLight:
    """Smooth light on a board, without the twin's own vignetting, which is rendered again."""
    pixels = patch_samples_px(patches, board)
    levels = patch_levels(image, pixels)
    light = _encoding(sensor).linearized(levels / 255.0)
    light /= np.maximum(patch_levels(_falloff(sensor), pixels), _MIN_FALLOFF)
    is_used = levels < _CLIPPED  # the light of clipped paper is unknown
    if (is_used & ~patches.is_black).sum() < MIN_PATCHES:
        is_used[:] = True
    return fit_light(patches, light, is_used)


def _encoding(sensor: OmniCamera) -> Encoding:
    """Transfer function of a camera; sRGB if it has none."""
    return sensor.degradation.encoding or Encoding()


def _falloff(sensor: OmniCamera) -> NDArray[np.float32]:
    """Share (height, width) of the light that vignetting leaves."""
    geometry = ImageGeometry.of_camera(sensor.model)
    light = np.ones((geometry.height_px, geometry.width_px, 4), dtype=np.float32)
    vignetting = sensor.degradation.vignetting
    return light[..., 1] if vignetting is None else vignetting.apply(light, geometry)[..., 1]
