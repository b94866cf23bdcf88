"""`omnisim render`."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from omnisim.apps.cli import inputs
from omnisim.apps.cli.console import out, pluralize, print_note
from omnisim.apps.cli.images.requests import FlowOptions, RenderRequest
from omnisim.cameras import NonCentralCamera, check_central
from omnisim.core.arrays import Bytes, Floats
from omnisim.core.cube import FACE_NAMES, unfolded_cube
from omnisim.core.errors import OutputError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import check_distinct, check_target
from omnisim.core.files.image_files import is_float_format, write_image
from omnisim.core.world import WorldState
from omnisim.ground_truth import CHANNELS, parse_channels
from omnisim.ground_truth.channel_files import (
    BOXES_3D,
    FINEST_RANGE_STEPS_PER_M,
    OVERLAY,
    ChannelFormat,
    is_sidecar_name,
    range_steps_per_m,
    sidecar_path,
)
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.missed_surfaces import viewpoint_notes
from omnisim.rendering.stage import open_sensor
from omnisim.rendering.twist import Twist

if TYPE_CHECKING:  # slow to import, and seldom needed
    from omnisim.cameras.calibration import Calibration

SIGNS = {"next": 1.0, "previous": -1.0}  # signs of the time intervals
OVERLAID = {"boxes": "instance", "labels": "semantic"}  # channels that overlays need
DEFAULT_ADVANCE_M = 0.1  # forward motion between frames for flow without --next


def run(request: RenderRequest) -> None:
    """Render one frame and print a summary."""
    backend = inputs.checked_backend(request.gpu)
    if backend == "rays" and request.files.faces is not None:
        raise OutputError("--faces: expected --backend cube, got --backend rays")
    is_float = is_float_format(request.output)
    channels = _check_outputs(request)
    mounted, body, files = None, None, request.camera
    has_own = (files.sensor or files.calibration_file or files.optics) is not None
    if request.robot is not None:
        from omnisim.robots.vehicle import Vehicle  # needed by few images

        vehicle = Vehicle.load(request.robot)
        mounted, body = vehicle.camera(None if has_own else files.camera_name), vehicle.body
    own = inputs.read_camera(files) if mounted is None or has_own else mounted.sensor
    camera = _adjusted(request, own)
    _check_channel_options(request.flow, channels)
    channel_format = inputs.parse_channel_format(request.truth.channel_format, channels)
    overlay = request.flow.overlay
    rendered = channels if overlay is None else tuple(dict.fromkeys((*channels, OVERLAID[overlay])))
    scene = inputs.load_labeled_scene(request.world, request.light, request.truth, rendered)
    viewpoint = inputs.Viewpoint.in_scene(scene, request.viewpoint)
    if mounted is None and not has_own and request.viewpoint.at_camera is not None:
        name = request.viewpoint.at_camera
        lens = next(each.lens for each in scene.cameras if each.name == name)
        if lens is None:
            print_note(f"--at-camera {name!r}: has no lens; the default camera is used")
        else:
            selected = f"its own lens, {lens.model_name}, is used; --sensor selects another"
            print_note(f"--at-camera {name!r}: {selected}")
            camera = _adjusted(request, OmniCamera(lens, polygons=None))
    base = viewpoint.base_of(camera)
    others = _other_viewpoints(request.flow, viewpoint, channels)
    speed_mps, turn_rate_degps = request.motion.speed_mps, request.motion.turn_rate_degps
    shutter = camera.degradation.shutter
    if (speed_mps or turn_rate_degps) and not (shutter and shutter.duration_s):
        print_note("this camera's exposure is instantaneous: motion has no effect")
    turn_rate_radps = math.radians(turn_rate_degps)
    twist = Twist((speed_mps, 0.0, 0.0), (0.0, 0.0, turn_rate_radps)).through(base)
    time_s, interval_s = request.viewpoint.time_s, request.flow.interval_s
    with open_sensor(
        scene,
        camera,
        body=body,
        hidden=() if mounted is None else mounted.hides,
        unlit=request.light.unlit,
        device=request.gpu.device,
        seed=request.motion.seed,
        backend=backend,
    ) as renderer:
        if renderer.camera.near_m < camera.near_m:
            print_note(
                f"{request.world.scene}: small scene: the near plane is at "
                f"{renderer.camera.near_m:.3g} m instead of {camera.near_m:g} m "
                "(virtual_cameras.near_m of a sensor file)"
            )
        for note in viewpoint_notes(scene, camera, base):
            print_note(f"{request.world.scene}: {note}")
        if not request.light.unlit:
            inputs.note_lighting(request.world.scene, scene, backend, [camera])
        own_name = renderer.vehicle
        states = {
            other: WorldState({own_name: at.base_of(camera)}, time_s + SIGNS[other] * interval_s)
            for other, at in others.items()
        }
        state = WorldState({own_name: base}, time_s)
        frame = renderer.render(
            state,
            linear=is_float,
            also=rendered,
            boxes_3d=request.truth.boxes_3d,
            next_state=states.get("next"),
            previous_state=states.get("previous"),
            motion=lambda now_s: twist(now_s - time_s),
        )
        faces = {} if request.files.faces is None else renderer.faces()
        counted = renderer.statistics(state) if request.statistics else None
    kept = {name: values for name, values in frame.channels.items() if name in channels}
    saved = frame if overlay is None else dataclasses.replace(frame, channels=kept)
    saved.save(request.output, request.flow.preview, channel_format)
    size = f"{camera.model.width_px} × {camera.model.height_px} px"
    out.print(f"{request.output}: {size}, {camera.mesh_summary}, from {viewpoint}")
    if counted is not None:
        rest = f"{counted.drawn:,} drawn by the virtual cameras, {counted.seen:,} seen"
        if backend == "rays":
            rest = f"{counted.seen:,} seen; drawn: not available, as --backend rays draws none"
        out.print(f"{request.output}: triangles: {counted.submitted:,} submitted, {rest}")
    _write_other_files(request, camera, frame, base, faces)
    _print_truth(request, frame, channels, others, None if is_float else channel_format)


def _print_truth(
    request: RenderRequest,
    frame: Frame,
    channels: Collection[str],
    others: Mapping[str, inputs.Viewpoint],
    channel_format: ChannelFormat | None,
) -> None:
    """Print what was written of ground truth; `channel_format` is None if it is in an EXR."""
    if channels:
        flows = ""
        for other, at in others.items():
            flow, side = ("flow", "ahead") if other == "next" else ("backward flow", "behind")
            flows += f"; {flow} to {at}"
            if all(value is None for value in _other_frames(request.flow)[other].values()):
                flows += f", assuming {DEFAULT_ADVANCE_M:g} m {side} (set --{other})"
        out.print(f"{request.output}: also {', '.join(channels)}{flows}")
    if request.truth.boxes_3d and frame.boxes_3d is not None:
        boxes = pluralize(len(frame.boxes_3d), "instance")
        out.print(f"{sidecar_path(request.output, BOXES_3D)}: 3-D boxes of {boxes}")
    if "range" in channels and channel_format not in (None, ChannelFormat.NPY):
        steps_per_m = range_steps_per_m(frame.channels["range"])
        if steps_per_m < FINEST_RANGE_STEPS_PER_M:
            print_note(
                f"{sidecar_path(request.output, 'range.png')}: {1000 / steps_per_m:g} mm per step "
                "instead of 1, to hold ranges beyond 65.534 m"
            )


def _adjusted(request: RenderRequest, camera: OmniCamera) -> OmniCamera:
    image, truth = request.image, request.truth
    if request.files.faces is not None:
        check_central(camera.model, "--faces")
    needs_hits = truth.also or truth.boxes_3d or request.statistics
    if isinstance(camera.model, NonCentralCamera) and needs_hits:
        require_extra("rays", "ground truth of an optical system")
    degradation = inputs.read_preset(image.preset)
    if degradation is not None:
        camera = camera.with_degradation(degradation)
    if image.exposure_ev is not None:
        camera = camera.with_exposure(image.exposure_ev)
    if image.size_px is not None:
        camera = camera.resized(image.size_px)
    if image.quality is not None:
        camera = camera.with_quality(image.quality)
    if image.polygons is not None:
        camera = camera.with_polygons(inputs.parse_polygons(image.polygons))
    return camera


def _other_frames(options: FlowOptions) -> dict[str, dict[str, Any]]:
    """Viewpoint and heading of the next and the previous frame, by option; None: not set."""
    return {
        "next": {"--next": options.next_at, "--next-yaw": options.next_yaw_deg},
        "previous": {"--previous": options.previous_at, "--previous-yaw": options.previous_yaw_deg},
    }


def _check_channel_options(options: FlowOptions, channels: Collection[str]) -> None:
    others = {CHANNELS[name].other for name in channels}
    for other, channel in (("next", "flow"), ("previous", "flow_backward")):
        for option, value in _other_frames(options)[other].items():
            if value is not None and other not in others:
                raise OutputError(f"{option}: requires --also {channel}")
    if options.preview and not channels:
        raise OutputError("--preview: requires --also")


def _other_viewpoints(
    options: FlowOptions, current: inputs.Viewpoint, channels: Collection[str]
) -> dict[str, inputs.Viewpoint]:
    """Viewpoints of the "next" and "previous" frames that the channels require.

    They follow from the options; without them, they are displaced along the heading.
    """
    viewpoints = {}
    for other, given in _other_frames(options).items():
        at, yaw_deg = given.values()
        if other not in {CHANNELS[name].other for name in channels}:
            continue
        ahead_m = DEFAULT_ADVANCE_M if at is None and yaw_deg is None else 0.0
        x, y, z = (current.position_m + SIGNS[other] * ahead_m * current.pose[:3, 0]).tolist()
        viewpoints[other] = dataclasses.replace(
            current,
            position_m=at or (x, y, z),
            yaw_deg=current.yaw_deg if yaw_deg is None else yaw_deg,
        )
    return viewpoints


def _check_outputs(request: RenderRequest) -> tuple[str, ...]:
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
            "the calibration file": request.camera.calibration_file,
            "the sensor file": request.camera.sensor,
            "the optics file": request.camera.optics,
            "the label file": request.truth.labels,
            "the sky": None if request.light.sky is None else Path(request.light.sky),
        },
    )
    channels = () if request.truth.also is None else parse_channels(request.truth.also)
    has_sidecars = channels or request.truth.boxes_3d or request.flow.overlay
    for option, path in extra.items():
        if has_sidecars and path is not None and is_sidecar_name(request.output, path):
            raise OutputError(f"{option}: expected a name other than a channel's, got {path}")
    if files.calibration is not None:
        from omnisim.cameras.calibration import check_calibration_suffix

        check_calibration_suffix(files.calibration, "omnisim")
    if files.rays is not None and files.rays.suffix.lower() != ".exr":
        raise OutputError(f"--rays: expected an .exr file, got {files.rays}")
    if files.faces is not None:
        faces = [files.faces / f"{name}.png" for name in (*FACE_NAMES, "unfolded")]
        check_target(faces[0])
        written = {f"the face {face.stem}": face for face in faces}
        check_distinct(written, {"the image": request.output})
    return channels


def _write_other_files(
    request: RenderRequest, camera: OmniCamera, frame: Frame, base: Floats, faces: dict[str, Bytes]
) -> None:
    files = request.files
    if files.rays is not None:
        from omnisim.cameras.calibration.ray_table import write_ray_table

        write_ray_table(files.rays, camera.model, frame.metadata)
        out.print(f"{files.rays}: the ray of each pixel")
    if files.calibration is not None:
        calibration = _calibration(camera, base)
        calibration.save(files.calibration, "omnisim")
        out.print(f"{files.calibration}: camera and pose")
        for note in calibration.notes:
            print_note(f"{files.calibration}: {note}")
    if files.faces is not None:
        try:
            files.faces.mkdir(parents=True, exist_ok=True)
        except OSError as reason:
            raise OutputError(f"{files.faces}: cannot be created: {reason.strerror}") from None
        for name, pixels in {**faces, "unfolded": unfolded_cube(faces)}.items():
            write_image(files.faces / f"{name}.png", pixels)
        out.print(f"{files.faces}: {', '.join(faces)}, unfolded")
    if (overlay := request.flow.overlay) is not None:
        from omnisim.plots.overlays import boxes_overlay, labels_overlay

        assert frame.labels is not None
        draw = boxes_overlay if overlay == "boxes" else labels_overlay
        path = sidecar_path(request.output, OVERLAY)
        write_image(path, draw(frame.rgb, frame.channels[OVERLAID[overlay]], frame.labels))
        out.print(f"{path}: the image with {overlay}")


def _calibration(sensor: OmniCamera, world_from_base: Floats) -> Calibration:
    """Calibration of the camera, with its pose on the vehicle and the vehicle's in the world."""
    from omnisim.cameras.calibration import CalibratedCamera, Calibration, NamedPose
    from omnisim.cameras.calibration.calibrated_camera import OPTICS

    poses = (
        NamedPose("base", "camera", sensor.base_from_optical),
        NamedPose("world", "base", world_from_base),
    )
    if not isinstance(sensor.model, NonCentralCamera):
        return Calibration((CalibratedCamera("camera", sensor.model, poses),))
    from omnisim.cameras.optics.centrality import fit_central
    from omnisim.cameras.optics.system import OpticalSystem

    assert isinstance(sensor.model, OpticalSystem)
    camera = fit_central(sensor.model).cameras[0]
    optics = dataclasses.replace(poses[0], source=OPTICS)
    return Calibration((dataclasses.replace(camera, poses=(*camera.poses, optics, poses[1])),))
