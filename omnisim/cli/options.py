"""From the words of options to what they mean, and from counts to words."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from pathlib import Path

from rich.console import Console

from omnisim.errors import CalibrationError, OpticsError, OutputError
from omnisim.scene import Scene, load_scene
from omnisim.scene.labels import find_labels, read_label_file
from omnisim.sensors import OmniCamera
from omnisim.sensors.degradations import Degradation, preset

LABELLED = frozenset(("semantic", "instance"))  # channels whose files have classes in them


def read_sensor(path: Path | None) -> OmniCamera:
    """The sensor of a file, or the paper's.

    Raises:
        SensorFileError: naming file, key, value and what was wanted.
    """
    return OmniCamera() if path is None else OmniCamera.from_file(path)


def read_camera(
    sensor: Path | None,
    calibration: Path | None,
    camera_name: str | None,
    mirrored: bool | None,
    err: Console,
) -> OmniCamera:
    """The sensor of a file, or a camera of a calibration file as a sensor, or the paper's.

    Args:
        sensor: a sensor file.
        calibration: a calibration file.
        camera_name: a camera of the calibration file; by default the first.
        mirrored: whether it looks into a mirror; by default what the file's remarks say.
        err: for notices.

    Raises:
        OmnisimError: both, or what is wrong with either.
    """
    if calibration is None:
        if camera_name is not None:
            raise CalibrationError(f"--camera-name {camera_name}: is for --camera: want that too")
        if mirrored is not None:
            raise CalibrationError("--mirrored: is for --camera: want that too")
        return read_sensor(sensor)
    if sensor is not None:
        raise CalibrationError("--sensor and --camera both say what camera it is: want one")
    if calibration.suffix.lower() == ".toml":
        raise CalibrationError(f"--camera {calibration}: is a sensor file: pass it as --sensor")
    # formats and fits are worth their time only to those who ask for them
    from omnisim.cli.calibration_source import first_camera, read_calibration

    found = first_camera(
        read_calibration(calibration, camera_name, None, mirrored, err), camera_name, err
    )
    return OmniCamera(found.cameras[0].camera, polygons=None)


def load_labelled_scene(
    source: str,
    up_axis: str | None,
    labels: Path | None,
    channels: Collection[str],
    err: Console,
) -> Scene:
    """Load a scene with its labels, or those of a file; its notices go to `err`.

    Args:
        source: path or built-in name.
        up_axis: see `load_scene`.
        labels: a label file, or None: the scene's own.
        channels: what is asked for; where labels are in it, what they lack is told, too.
        err: for notices.

    Raises:
        OutputError: a label file that no channel needs.
        SceneError: from the scene, or from the label file.
    """
    is_labelled = not LABELLED.isdisjoint(channels)
    if labels is not None and not is_labelled:
        raise OutputError("--labels: is for the channel semantic: want --also semantic")
    scene = load_scene(source, up_axis)
    if labels is not None:
        scene = dataclasses.replace(scene, labels=read_label_file(labels))
    told = find_labels(scene).notices() if is_labelled else ()
    for notice in (*scene.notices, *told):
        err.print("note: ", notice, sep="", markup=False)
    return scene


def read_preset(name: str | None) -> Degradation | None:
    """The degradations of a preset, or None: as the sensor file says.

    Raises:
        SensorFileError: there is no such preset, or its file has a fault.
    """
    return None if name is None else preset(name)


def parse_polygons(text: str) -> int | None:
    """A polygon count, or None for "exact".

    Raises:
        OpticsError: neither a whole number nor "exact".
    """
    if text.lower() == "exact":
        return None
    try:
        return int(text)
    except ValueError:
        raise OpticsError(f"-n {text}: want a number of polygons or 'exact'") from None


def counted(count: int, thing: str) -> str:
    """A count with its noun: 1 step, 2 steps."""
    return f"{count} {thing}{'' if count == 1 else 's'}"
