"""Film of a drive in a circle from the start, with views of the live page; needs no browser."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.live.live_source import LiveSettings, LiveSource, start_place
from omnisim.apps.live.session import Draw, PageState
from omnisim.apps.live.view_maker import ViewMaker
from omnisim.apps.live.viewpoint_motion import Place
from omnisim.ground_truth.previews import preview
from omnisim.plots.video_file import check_video_target, write_video

RATE_HZ, SECONDS, RADIUS_M = 20.0, 6.0, 0.6


def record_film(path: Path, settings: LiveSettings, at: Place | None) -> int:
    """Write a film, and return the number of its images.

    Args:
        path: video file.
        settings: initial scene and camera.
        at: start pose; None: the scene's start.

    Raises:
        OmnisimError: the file cannot be written, or an error of `LiveSource`.
    """
    check_video_target(path)
    source = LiveSource(settings)
    try:
        return write_video(path, _images(source, settings, start_place(settings, at)), RATE_HZ)
    finally:
        source.close()


def _images(
    source: LiveSource, settings: LiveSettings, start: Place
) -> Iterator[NDArray[np.uint8]]:
    """Images of a circular drive: the camera with its range beside it, and the panorama below."""
    views, count = ViewMaker(), round(RATE_HZ * SECONDS)
    x, y, z = start.position_m
    yaw = math.radians(start.yaw_deg)
    middle = (x - RADIUS_M * math.sin(yaw), y + RADIUS_M * math.cos(yaw))
    for number in range(count):
        angle = 2.0 * math.pi * number / count
        position_m = (
            middle[0] + RADIUS_M * math.sin(yaw + angle),
            middle[1] - RADIUS_M * math.cos(yaw + angle),
            z,
        )
        place = Place(position_m, start.yaw_deg + math.degrees(angle)).rounded()
        draw = Draw(PageState(settings.document, place), True)
        frame = source.take(draw, ("range",))
        depth = preview("range", frame.channels["range"], frame.labels)
        top = np.concatenate((frame.rgb, depth), axis=1)
        panorama = views.image("panorama", frame, draw.state.gaze, z, True)
        yield np.concatenate((top, _fitted(panorama, top.shape[1])))


def _fitted(image: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """Pad an image with black on both sides to a width, or crop it on both sides if wider."""
    height, own = image.shape[:2]
    rows = np.zeros((height, width, 3), dtype=np.uint8)
    common = min(width, own)
    left, from_left = (width - common) // 2, (own - common) // 2
    rows[:, left : left + common] = image[:, from_left : from_left + common]
    return rows
