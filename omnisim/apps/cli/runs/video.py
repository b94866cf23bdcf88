"""`omnisim video`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.runs.requests import VideoRequest
from omnisim.core.errors import RunError
from omnisim.core.files.image_files import read_image
from omnisim.plots.video_file import check_video_target, write_video
from omnisim.runs.run_folder import RunFolder


def run(request: VideoRequest) -> None:
    """Encode a camera's images as a video; robots that drove together appear side by side."""
    folder, output, rate_hz = request.run, request.output, request.rate_hz
    runs = RunFolder.read_each(folder)
    check_video_target(output)
    for recorded in runs:
        if recorded.measurements_done(recorded.camera(request.camera_name)) == 0:
            raise RunError(
                f"{recorded.path}: has no images yet: run its command again to resume it"
            )
        if notice := recorded.unfinished():
            print_note(notice)
    views = [_View.of(recorded, request.camera_name) for recorded in runs]
    longest = max(views, key=lambda view: len(view.times_s))
    times_s = longest.times_s.tolist()

    def images() -> Iterator[NDArray[np.uint8]]:
        for time_s in track(times_s, "encoding"):
            yield side_by_side([view.at(time_s) for view in views])

    count = write_video(output, images(), rate_hz)
    out.print(f"{output}: {pluralize(count, 'image')}, {count / rate_hz:.1f} s")


@dataclass(frozen=True, eq=False)
class _View:
    """Images of a camera of a run.

    Attributes:
        run: folder of the run.
        camera: name of the camera.
        times_s: (n,) times of the recorded images.
    """

    run: RunFolder
    camera: str
    times_s: NDArray[np.float64]

    @classmethod
    def of(cls, run: RunFolder, camera: str | None) -> _View:
        """View of the named camera; None: the first camera.

        Raises:
            RunError: no such camera.
        """
        name = run.camera(camera)
        return cls(run, name, run.times_s(name)[: run.measurements_done(name)])

    def at(self, time_s: float) -> NDArray[np.uint8]:
        """Latest image (height, width, 3) at `time_s` seconds; the first one if none is earlier."""
        step = max(0, int(np.searchsorted(self.times_s, time_s, side="right")) - 1)
        image: NDArray[np.uint8] = read_image(self.run.file(self.camera, step, ".png"))[0]
        return image


def side_by_side(images: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Join images (height, width, 3) horizontally, with black below the lower ones."""
    if len(images) == 1:
        return images[0]
    height = max(image.shape[0] for image in images)
    below = (((0, height - image.shape[0]), (0, 0), (0, 0)) for image in images)
    colors = (image[..., :3] for image in images)
    return np.concatenate(
        [np.pad(color, margin) for color, margin in zip(colors, below, strict=True)], axis=1
    )
