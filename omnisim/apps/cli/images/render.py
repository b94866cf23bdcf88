"""`omnisim render`."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.cli.console import out, pluralize, print_note
from omnisim.apps.cli.images.flow_viewpoints import (
    check_channel_options,
    flow_summary,
    other_viewpoints,
)
from omnisim.apps.cli.images.output_files import (
    check_motion,
    check_outputs,
    write_other_files,
    write_overlay,
)
from omnisim.apps.cli.images.requests import MotionOptions, RenderRequest, RigCameraOptions
from omnisim.apps.cli.inputs import (
    Viewpoint,
    check_seconds,
    checked_backend,
    load_labeled_scene,
    note_lighting,
    parse_channel_format,
    parse_exposure,
    parse_polygons,
    read_camera,
    read_preset,
    refuse_given,
)
from omnisim.apps.cli.option_groups import CameraFileOptions
from omnisim.cameras import NonCentralCamera, check_central
from omnisim.core.errors import OutputError
from omnisim.core.extras import require_extra
from omnisim.core.files.image_files import is_float_format
from omnisim.core.world import WorldState
from omnisim.ground_truth.channel_files import (
    BOXES_3D,
    FINEST_RANGE_STEPS_PER_M,
    range_steps_per_m,
    sidecar_path,
)
from omnisim.ground_truth.npy import ChannelFormat
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.missed_surfaces import viewpoint_notes
from omnisim.rendering.stage import open_sensor
from omnisim.rendering.twist import Twist
from omnisim.scene import Scene

if TYPE_CHECKING:  # slow to import, and seldom needed
    from omnisim.robots.vehicle import Vehicle

SIGNS = {"next": 1.0, "previous": -1.0}  # signs of the time intervals


def run(request: RenderRequest) -> None:
    """Render one frame, or a rig along a trajectory, and print a summary."""
    if request.poses.trajectory is not None:
        from omnisim.apps.cli.images.trajectory import run as run_trajectory

        run_trajectory(request, request.poses.trajectory)
        return
    refuse_given(request.poses, "requires --trajectory", "trajectory_frame", "axes", "rate_hz")
    refuse_given(request, "requires --trajectory", "force")
    backend = checked_backend(request.gpu)
    if backend == "rays" and request.files.faces is not None:
        raise OutputError("--faces: expected --backend cube, got --backend rays")
    check_motion(request.motion)
    is_float = is_float_format(request.output)
    channels = check_outputs(request)
    vehicle = _vehicle(request.camera)
    camera = _camera(request, vehicle)
    check_channel_options(request.flow, channels)
    channel_format = parse_channel_format(request.truth.channel_format, channels)
    overlay = request.flow.overlay
    rendered = channels if overlay is None else tuple(dict.fromkeys((*channels, overlay.channel)))
    scene = load_labeled_scene(request.world, request.light, request.truth, rendered)
    viewpoint = Viewpoint.in_scene(scene, request.viewpoint)
    if vehicle is None and not _has_own_camera(request.camera):
        camera = _of_file(request, scene) or camera
    base = viewpoint.base_of(camera)
    others = other_viewpoints(request.flow, viewpoint, channels)
    twist = _twist(request.motion, camera).through(base)
    time_s = check_seconds("--time", request.viewpoint.time_s)
    interval_s = check_seconds("--interval", request.flow.interval_s)
    with open_sensor(
        scene,
        camera,
        body=None if vehicle is None else vehicle.body,
        hidden=_hidden(request.camera, vehicle),
        unlit=request.light.unlit,
        device=request.gpu.device,
        seed=request.motion.seed,
        backend=backend,
    ) as renderer:
        _note_viewpoint(request.world.scene, scene, camera, renderer.camera, base)
        if not request.light.unlit:
            note_lighting(request.world.scene, scene, backend, [camera])
        states = {
            other: WorldState(
                {renderer.vehicle: other_viewpoint.base_of(camera)},
                time_s + SIGNS[other] * interval_s,
            )
            for other, other_viewpoint in others.items()
        }
        frame = renderer.render(
            WorldState({renderer.vehicle: base}, time_s),
            linear=is_float,
            also=rendered,
            boxes_3d=request.truth.boxes_3d,
            next_state=states.get("next"),
            previous_state=states.get("previous"),
            motion=lambda now_s: twist(now_s - time_s),
        )
        faces = {} if request.files.faces is None else renderer.faces()
    kept = {name: values for name, values in frame.channels.items() if name in channels}
    saved = frame if overlay is None else dataclasses.replace(frame, channels=kept)
    saved.save(request.output, request.flow.preview, channel_format)
    size = f"{camera.model.width_px} × {camera.model.height_px} px"
    out.print(f"{request.output}: {size}, {camera.mesh_summary}, from {viewpoint}", markup=False)
    write_other_files(request.files, camera, frame, base, faces)
    if overlay is not None:
        write_overlay(request.output, frame, overlay)
    if channels:
        flows = "".join(flow_summary(request.flow, *other) for other in others.items())
        out.print(f"{request.output}: also {', '.join(channels)}{flows}", markup=False)
    if request.truth.boxes_3d and frame.boxes_3d is not None:
        boxes = pluralize(len(frame.boxes_3d), "instance")
        out.print(f"{sidecar_path(request.output, BOXES_3D)}: 3-D boxes of {boxes}", markup=False)
    if "range" in channels and not is_float and channel_format is not ChannelFormat.NPY:
        _note_coarse_ranges(request.output, frame.channels["range"])


def _note_viewpoint(
    name: str, scene: Scene, camera: OmniCamera, rendered: OmniCamera, base: NDArray[np.float64]
) -> None:
    if rendered.near_m < camera.near_m:
        print_note(
            f"{name}: is small: the near plane is at {rendered.near_m:.3g} m instead of "
            f"{camera.near_m:g} m (virtual_cameras.near_m of a sensor file)"
        )
    for note in viewpoint_notes(scene, camera, base):
        print_note(f"{name}: {note}")


def _vehicle(options: RigCameraOptions) -> Vehicle | None:
    if options.robot is None:
        return None
    from omnisim.robots.vehicle import Vehicle  # needed by few images

    return Vehicle.load(options.robot)


def _has_own_camera(options: CameraFileOptions) -> bool:
    return (options.sensor or options.calibration_file or options.optics) is not None


def _hidden(options: RigCameraOptions, vehicle: Vehicle | None) -> tuple[str, ...]:
    """Parts of the robot that are hidden from its camera, or from the camera in its place."""
    if vehicle is None:
        return ()
    return vehicle.camera(None if _has_own_camera(options) else options.camera_name).hides


def _camera(request: RenderRequest, vehicle: Vehicle | None) -> OmniCamera:
    options = request.camera
    if vehicle is not None and not _has_own_camera(options):
        camera = vehicle.camera(options.camera_name).sensor
    else:
        camera = read_camera(options)
    return _adjusted(request, camera)


def _of_file(request: RenderRequest, scene: Scene) -> OmniCamera | None:
    """Camera with the lens of --at-camera; None: another viewpoint, or no lens in the file."""
    name = request.viewpoint.at_camera
    lens = next((one.lens for one in scene.cameras if one.name == name), None)
    if name is None:
        return None
    if lens is None:
        print_note(f"--at-camera {name!r}: without a lens of its own: the default camera is drawn")
        return None
    print_note(
        f"--at-camera {name!r}: with its own lens, {lens.model_name}; --sensor takes another"
    )
    return _adjusted(request, OmniCamera(lens, polygons=None))


def _adjusted(request: RenderRequest, camera: OmniCamera) -> OmniCamera:
    """Camera with the options of the image."""
    image, truth = request.image, request.truth
    if request.files.faces is not None:
        check_central(camera.model, "--faces")
    if isinstance(camera.model, NonCentralCamera) and (truth.also or truth.boxes_3d):
        require_extra("rays", "ground truth of an optical system")
    degradation = read_preset(image.preset)
    if degradation is not None:
        camera = camera.with_degradation(degradation)
    exposure = parse_exposure(image.exposure_ev)
    if exposure is not None:
        camera = camera.with_exposure(exposure)
    if image.size_px is not None:
        camera = camera.resized(image.size_px)
    if image.quality is not None:
        camera = camera.with_quality(image.quality)
    if image.polygons is not None:
        camera = camera.with_polygons(parse_polygons(image.polygons))
    return camera


def _twist(options: MotionOptions, camera: OmniCamera) -> Twist:
    turn_rate_radps = math.radians(options.turn_rate_degps)
    shutter = camera.degradation.shutter
    if (options.speed_mps or turn_rate_radps) and not (shutter and shutter.duration_s):
        print_note("this camera's shutter takes no time: no motion shows")
    return Twist((options.speed_mps, 0.0, 0.0), (0.0, 0.0, turn_rate_radps))


def _note_coarse_ranges(image: Path, ranges_m: NDArray[np.float32]) -> None:
    steps_per_m = range_steps_per_m(ranges_m)
    if steps_per_m < FINEST_RANGE_STEPS_PER_M:
        print_note(
            f"{sidecar_path(image, 'range.png')}: {1000 / steps_per_m:g} mm per step instead "
            "of 1, to hold ranges beyond 65.534 m"
        )
