"""`omnisim video`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from numpy.typing import NDArray

from omnisim.cli.console import out, pluralize, print_note, track
from omnisim.cli.run_requests import VideoRequest
from omnisim.errors import OutputError, RunError
from omnisim.image_files import read_image
from omnisim.plots.video_file import check_video_target, write_video
from omnisim.simulation.run_folder import RunFolder


def run(request: VideoRequest) -> None:
    """Encode a camera's pictures as a video."""
    folder, output, rate_hz = request.run, request.output, request.rate_hz
    if not 0.1 <= rate_hz <= 240.0:
        raise OutputError(f"--fps: expected 0.1 to 240 frames per second, got {rate_hz:g}")
    recorded = RunFolder.read(folder)
    check_video_target(output)
    name = recorded.camera(request.camera_name)
    done = recorded.measurements_done(name)
    if done == 0:
        raise RunError(f"{folder}: has no pictures yet: run its command again to go on")

    if notice := recorded.unfinished():
        print_note(notice)

    def pictures() -> Iterator[NDArray[Any]]:
        for step in track(range(done), "encoding", done):
            yield read_image(recorded.file(name, step, ".png"))[0]

    count = write_video(output, pictures(), rate_hz)
    out.print(f"{output}: {pluralize(count, 'picture')}, {count / rate_hz:.1f} s", markup=False)
