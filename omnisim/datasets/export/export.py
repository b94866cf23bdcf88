"""Export of a run, atomically."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

from omnisim.core.errors import OutputError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import atomic_folder, check_new_folder
from omnisim.datasets.export.export_format import ExportFormat, ExportSettings, PrintNote
from omnisim.datasets.export.export_formats import FORMATS, check_format, format_named
from omnisim.datasets.export.recording import Recording
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.sensors.sensor_registry import SENSOR_TYPES


def export_run(
    run: Path,
    format: str,
    output: Path,
    settings: ExportSettings | None = None,
    camera_name: str | None = None,
    print_note: PrintNote = lambda note: None,
) -> Iterator[int]:
    """Export a run to a new folder; yield the number of steps, then the number of finished steps.

    The folder appears when it is complete. If a format (key of `export_formats.FORMATS`) has no
    stamps per sensor, the steps are frames, see `Recording.in_frames`. With a camera's name, only
    that camera is exported; `print_note` takes notes on content that the format does not support.

    Raises:
        OmnisimError: an unknown format, a setting that the format does not use, an unfinished run,
            a missing extra, a camera without a model in the format, or a folder that cannot be
            written.
    """
    extra = FORMATS[check_format(format)].extra
    if extra is not None:
        require_extra(extra, f"--to {format}")
    recording = Recording.read(run, camera_name)
    check_new_folder(output)
    if run.resolve() in output.resolve().parents:
        raise OutputError(f"{output}: is inside the run: expected a folder elsewhere")
    form, settings = format_named(format), settings or ExportSettings()
    bags, is_laid_out = "ros2-mcap or ros2-sqlite", settings.cloud_layout != "generic"
    for option, is_given, is_used, others in (
        ("--compressed", settings.compressed, form.has_messages, bags),
        ("--points", settings.with_points, form.has_messages, bags),
        ("--cloud-layout", is_laid_out, form.has_messages, bags),
        ("--no-map", not settings.with_map, form.has_messages, bags),
        ("--start-time", settings.start_ns != 0, form.dates_stamps, "a format with stamps"),
    ):
        if is_given and not is_used:
            raise OutputError(f"{option}: requires --to {others}, got --to {form.name}")
    recording = for_format(recording, form, print_note)
    if form.dates_stamps and settings.start_ns == 0:
        print_note("times begin in 1970; --start-time sets another date")
    yield recording.steps
    with atomic_folder(output) as folder:
        yield from form.write(recording, folder, settings, print_note)


def for_format(recording: Recording, form: ExportFormat, print_note: PrintNote) -> Recording:
    """Recording with the cameras that a format supports; notes name the contents that are left out.

    If the format has no stamps per sensor, the steps are frames, see `Recording.in_frames`.

    Raises:
        OutputError: the format supports no sensor of the run.
    """
    manifest = recording.run.manifest
    held = form.sensors if recording.cameras else (*form.sensors, *form.lone_sensors)
    others = [name for name in manifest.sensors if name not in manifest.cameras]
    left_out = [name for name in others if not issubclass(manifest.sensor_class(name), held)]
    if not (recording.cameras or form.holds_motion or len(left_out) < len(others)):
        kinds = (OmniCamera, *held)
        types = [name for name, mount in SENSOR_TYPES.items() if mount.sensor_class in kinds]
        raise OutputError(
            f"{recording.run.path}: expected a sensor of type {' or '.join(types)} for "
            f"{form.name}, got {', '.join(others) or 'none'}"
        )
    cameras = form.supported_cameras(recording.cameras, print_note)
    recording = dataclasses.replace(recording, cameras=tuple(cameras))
    if not form.has_clocks:
        framed = [camera.name for camera in recording.cameras]
        for kind in held:
            framed += recording.sensors(kind)[:1]
        recording = recording.in_frames(framed, print_note)
    if left_out:
        print_note(f"{form.name} cannot hold {', '.join(left_out)}: left out")
    channels = [name for name in manifest.channels if name not in form.channels]
    if channels:
        print_note(f"{form.name} cannot hold the channels {', '.join(channels)}: left out")
    return recording
