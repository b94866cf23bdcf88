"""TUM RGB-D: images of one camera, depths of a pinhole, poses of the camera.

    rgb.txt, rgb/<s>.png            stamps and images
    depth.txt, depth/<s>.png        depths along the axis, 5000 steps per meter in 16 bits, 0: none
    groundtruth.txt                 poses of the camera's optical frame, at the fastest rate
    calibration.json                omnisim's calibration: the format has none

Without a camera, the first depth camera is exported, without `rgb`.

Source: TUM RGB-D benchmark, file formats.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.image_files import write_numbers
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.formats import tum
from omnisim.datasets.export.export_format import (
    ExportSettings,
    FarDepths,
    OneCameraFormat,
    PrintNote,
    restamped,
    seconds_text,
)
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import Recording
from omnisim.sensors.depth_camera.depth_camera import DepthCamera

STEPS_PER_M = 5000.0


class Tum(OneCameraFormat):
    """TUM RGB-D data set."""

    name = "tum"
    lone_sensors = (DepthCamera,)
    channels = ("range",)

    def write(
        self, recording: Recording, folder: Path, settings: ExportSettings, print_note: PrintNote
    ) -> Iterator[int]:
        """Write the data set, image by image."""
        depth_cameras = recording.sensors(DepthCamera)
        recorded = (*recording.cameras, *map(recording.depth_camera, depth_cameras))[0]
        camera = LensCamera.of(recorded, print_note)
        has_images = bool(recording.cameras)
        has_ranges = has_images and camera.recorded.has("range")
        has_depths = not has_images or (has_ranges and camera.is_pinhole)
        if has_ranges and not has_depths:
            print_note(f"{camera.name}: no depth images: TUM's are those of a pinhole camera")
        if not has_images and len(depth_cameras) > 1:
            print_note(f"depth is that of {camera.name}: {', '.join(depth_cameras[1:])} left out")
        stamps_ns = settings.stamps_ns(recording.truth.times_s, recording.run.path)
        stamps = [seconds_text(stamp) for stamp in stamps_ns]
        times_s = recording.state_times_s
        poses = recording.states(times_s).world_from_base @ camera.base_from_lens
        lines = tum.lines(Trajectory(times_s, poses))
        own = map(seconds_text, settings.stamps_ns(times_s, recording.run.path))
        write_lines(folder / "groundtruth.txt", restamped(lines, own, " "))
        camera.save_calibration(folder / "calibration.json")
        if has_images:
            _write_list(folder, "rgb", "color images", stamps)
        if has_depths:
            _write_list(folder, "depth", "depth maps", stamps)
        far = FarDepths(camera.name, STEPS_PER_M)
        for step, stamp in enumerate(stamps):
            if has_images:
                camera.copy_image(step, folder / "rgb" / f"{stamp}.png")
            if has_depths:
                depths_m = camera.depths_m(step) if has_images else recorded.depths_m(step)
                write_numbers(folder / "depth" / f"{stamp}.png", far.encode(depths_m))
            yield step + 1
        far.note(print_note)


def write_lines(path: Path, lines: Iterator[str]) -> None:
    """Write lines to a text file; `OutputError` if it cannot be written."""
    write_text(path, "".join(f"{line}\n" for line in lines))


def _write_list(folder: Path, name: str, content: str, stamps: list[str]) -> None:
    (folder / name).mkdir()
    lines = [f"# {content}", "# timestamp filename"]
    lines += [f"{stamp} {name}/{stamp}.png" for stamp in stamps]
    write_lines(folder / f"{name}.txt", iter(lines))
