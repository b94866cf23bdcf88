"""Images of a real camera for measurements: image and raw files, frames of videos and ROS bags."""

from omnisim.measurement.inputs.recorded_frames import (
    IMAGE_SUFFIXES,
    RAW_SUFFIXES,
    frame_numbers,
    is_lossy,
    is_recording,
    read_mosaic,
    read_photo,
    recorded_frames,
    without_topic,
)

__all__ = [
    "IMAGE_SUFFIXES",
    "RAW_SUFFIXES",
    "frame_numbers",
    "is_lossy",
    "is_recording",
    "read_mosaic",
    "read_photo",
    "recorded_frames",
    "without_topic",
]
