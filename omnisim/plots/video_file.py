"""Video files from images."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import numpy as np

from omnisim.core.arrays import Bytes
from omnisim.core.errors import OutputError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import atomic_write, check_target

FORMATS = {".mp4": "mp4", ".mkv": "matroska"}
# Constant quality, lower is better: 18 is hard to tell from the original.
QUALITY = 18


def check_video_target(path: Path) -> None:
    """Refuse a file that cannot be written, before the work is done.

    Raises:
        OutputError: an unknown format, PyAV is not installed, or a file that cannot be written.
    """
    if path.suffix.lower() not in FORMATS:
        raise OutputError(
            f"{path}: expected {' or '.join(FORMATS)}, got {path.suffix or 'no suffix'}"
        )
    require_extra("video", str(path), OutputError)
    check_target(path)


def write_video(path: Path, images: Iterable[Bytes], rate_hz: float) -> int:
    """Write images (height, width, 3) of one size as H.264; return their number.

    Odd sizes lose their last row or column, which the format does not support.

    Raises:
        OutputError: an unknown format, no images or too small ones, or the file cannot be
            written.
    """
    check_video_target(path)
    import av

    count = 0
    with atomic_write(path) as partial:
        try:
            with av.open(str(partial), "w", format=FORMATS[path.suffix.lower()]) as container:
                stream = container.add_stream(
                    "libx264", rate=Fraction(rate_hz).limit_denominator(1000)
                )
                stream.pix_fmt = "yuv420p"
                stream.options = {"crf": str(QUALITY)}
                for image in images:
                    height, width = (side // 2 * 2 for side in image.shape[:2])
                    if not (height and width):
                        raise OutputError(
                            f"{path}: expected images of at least 2 × 2 px, got "
                            f"{image.shape[1]} × {image.shape[0]} px"
                        )
                    if count == 0:
                        stream.width, stream.height = width, height
                    cut = np.ascontiguousarray(image[:height, :width, :3])
                    frame = av.VideoFrame.from_ndarray(cut, format="rgb24")
                    container.mux(stream.encode(frame))
                    count += 1
                if count == 0:
                    raise OutputError(f"{path}: expected at least one image, got none")
                container.mux(stream.encode())
        except av.FFmpegError as reason:
            raise OutputError(f"{path}: cannot be encoded: {reason}") from None
    return count
