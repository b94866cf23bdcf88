"""Further output files of `omnisim render`: checks before rendering, and writing."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.cli.console import out, print_note
from omnisim.apps.cli.images.requests import (
    FileOptions,
    MotionOptions,
    OverlayKind,
    RenderRequest,
)
from omnisim.cameras import NonCentralCamera
from omnisim.core.cube import FACE_NAMES, unfolded_cube
from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import check_distinct, check_target
from omnisim.core.files.image_files import write_image
from omnisim.ground_truth import parse_channels
from omnisim.ground_truth.channel_files import OVERLAY, is_sidecar_name, sidecar_path
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.twist import MAX_MPS, MAX_RADPS

if TYPE_CHECKING:  # slow to import, and seldom needed
    from omnisim.cameras.calibration import Calibration


def check_motion(options: MotionOptions) -> None:
    """Raise an error if a speed or turn rate exceeds the limits of `Twist`.

    Raises:
        OutputError: names the option.
    """
    for option, value, limit in (
        ("--speed", options.speed_mps, MAX_MPS),
        ("--turn-rate", options.turn_rate_degps, math.floor(math.degrees(MAX_RADPS))),
    ):
        if not abs(value) <= limit:  # also true for NaN
            raise OutputError(
                f"{option}: expected a number from −{limit:g} to {limit:g}, got {value:g}"
            )


def check_outputs(request: RenderRequest) -> tuple[str, ...]:
    """Check all output paths, and return the requested channels.

    Raises:
        OutputError: a file cannot be written, or would overwrite another.
    """
    files = request.files
    check_target(request.output)
    extra = {"--rays": files.rays, "--calibration": files.calibration}
    for path in extra.values():
        if path is not None:
            check_target(path)
    check_distinct(
        {"the image": request.output, **extra},
        {
            "the scene": Path(request.world.scene),
            "the camera's file": request.camera.calibration_file,
            "the sensor file": request.camera.sensor,
            "the optics file": request.camera.optics,
            "the labels' file": request.truth.labels,
            "the sky": None if request.light.sky is None else Path(request.light.sky),
        },
    )
    channels = () if request.truth.also is None else parse_channels(request.truth.also)
    for option, path in extra.items():
        if (
            (channels or request.truth.boxes_3d or request.flow.overlay)
            and path is not None
            and is_sidecar_name(request.output, path)
        ):
            raise OutputError(f"{option}: expected another name than a channel's file, got {path}")
    if files.calibration is not None:
        from omnisim.cameras.calibration import check_calibration_suffix

        check_calibration_suffix(files.calibration, "omnisim")
    if files.rays is not None and files.rays.suffix.lower() != ".exr":
        raise OutputError(f"--rays: expected an .exr file, got {files.rays}")
    if files.faces is not None:
        faces = [files.faces / f"{name}.png" for name in (*FACE_NAMES, "unfolded")]
        check_target(faces[0])
        check_distinct(
            {f"the face {face.stem}": face for face in faces}, {"the image": request.output}
        )
    return channels


def write_other_files(
    files: FileOptions,
    camera: OmniCamera,
    frame: Frame,
    base: NDArray[np.float64],
    faces: dict[str, NDArray[np.uint8]],
) -> None:
    """Write the requested rays, calibration and faces, and print their names.

    Args:
        files: output files of the request.
        camera: camera of the frame.
        frame: rendered frame, for its metadata.
        base: pose (4, 4) world_from_base.
        faces: images of the virtual cameras, by name.
    """
    if files.rays is not None:
        from omnisim.cameras.calibration.ray_table import write_ray_table

        write_ray_table(files.rays, camera.model, frame.metadata)
        out.print(f"{files.rays}: a ray of each pixel", markup=False)
    if files.calibration is not None:
        calibration = _calibration(camera, base)
        calibration.save(files.calibration, "omnisim")
        out.print(f"{files.calibration}: camera and pose", markup=False)
        for note in calibration.notes:
            print_note(f"{files.calibration}: {note}")
    if files.faces is not None:
        _write_faces(files.faces, faces)


def write_overlay(image: Path, frame: Frame, kind: OverlayKind) -> None:
    """Write the image with boxes or masks next to it, and print its name."""
    from omnisim.plots.overlays import boxes_overlay, labels_overlay

    assert frame.labels is not None
    draw = boxes_overlay if kind is OverlayKind.BOXES else labels_overlay
    path = sidecar_path(image, OVERLAY)
    write_image(path, draw(frame.rgb, frame.channels[kind.channel], frame.labels))
    out.print(f"{path}: the image with {kind}", markup=False)


def _calibration(sensor: OmniCamera, world_from_base: NDArray[np.float64]) -> Calibration:
    """Calibration of the camera, with its pose on the vehicle and the vehicle's in the world."""
    from omnisim.cameras.calibration import CalibratedCamera, Calibration, NamedPose
    from omnisim.cameras.calibration.calibrated_camera import OPTICS

    poses = (
        NamedPose("base", "camera", sensor.base_from_optical),
        NamedPose("world", "base", world_from_base),
    )
    if not isinstance(sensor.model, NonCentralCamera):
        return Calibration((CalibratedCamera("camera", sensor.model, poses),))
    from omnisim.cameras.optics.central_view import fit_central
    from omnisim.cameras.optics.system import OpticalSystem

    assert isinstance(sensor.model, OpticalSystem)
    camera = fit_central(sensor.model).cameras[0]
    optics = dataclasses.replace(poses[0], source=OPTICS)
    return Calibration((dataclasses.replace(camera, poses=(*camera.poses, optics, poses[1])),))


def _write_faces(folder: Path, faces: dict[str, NDArray[np.uint8]]) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        raise OutputError(f"{folder}: this folder cannot be made: {reason.strerror}") from None
    for name, pixels in faces.items():
        write_image(folder / f"{name}.png", pixels)
    write_image(folder / "unfolded.png", unfolded_cube(faces))
    out.print(f"{folder}: {', '.join(faces)}, unfolded", markup=False)
