"""`omnisim live`."""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.apps.cli.console import out, print_note
from omnisim.apps.cli.images.live_requests import LiveRequest
from omnisim.apps.cli.inputs import check_calibration_path, check_seconds, read_camera
from omnisim.apps.live.camera_document import CameraDocument
from omnisim.apps.live.live import LivePage, run_source
from omnisim.apps.live.live import run as run_page
from omnisim.apps.live.live_source import LiveSettings
from omnisim.apps.live.scene_in_light import SceneInLight
from omnisim.apps.live.viewpoint_motion import Place
from omnisim.core.errors import OutputError
from omnisim.robots.vehicle import Vehicle
from omnisim.scene import Scene, read_scene

SCENE, SIZE_PX = "soccer", 400
RUN_REFUSES = {
    "--robot": "robot", "--sensor": "sensor", "--optics": "optics", "--camera": "camera",
    "--preset": "preset", "--size": "size_px", "--at": "at", "--yaw": "yaw_deg",
    "--pitch": "pitch_deg", "--quality": "quality", "--record": "record", "--unlit": "unlit",
    "--sky": "sky", "--baked": "baked",
}  # fmt: skip
ROBOT_REFUSES = {"--sensor": "sensor", "--optics": "optics", "--camera": "camera"}
DRIVEN_REFUSES = {"--pitch": "pitch_deg"}


def run(request: LiveRequest) -> None:
    """Serve the page until Ctrl-C."""
    time_s = check_seconds("--time", request.time_s)
    if request.run is not None:
        _refuse(request, RUN_REFUSES, "a run has its own: expected none with --run")
        source = run_source(request.run, request.scene, request.camera_name, request.device)
        _serve(LivePage(source, request.host, request.port), request)
        return
    scene = read_scene(
        request.scene or SCENE,
        request.up_axis,
        request.meters_per_unit,
        request.resources or (),
        sky=request.sky,
        baked=request.baked,
    )
    for notice in scene.notices:
        print_note(notice)
    settings, place = _settings(request, scene), _place(request, scene)
    if request.record is not None:
        from omnisim.apps.live.record import record_film

        count = record_film(request.record, settings, place)
        out.print(f"{request.record}: {count} images", markup=False)
        return
    _serve(LivePage(settings, request.host, request.port, place, time_s), request)


def _serve(page: LivePage, request: LiveRequest) -> None:
    def is_open() -> None:
        out.print(f"Open {page.server.url} in a browser; Ctrl-C ends it.", markup=False)
        sys.stdout.flush()
        if request.open:
            import webbrowser

            webbrowser.open(page.server.url)

    is_done = run_page(page, is_open)
    out.print("stopped")
    if not is_done:  # an image of a large scene is in the way: its thread would hold the exit up
        sys.stdout.flush()
        os._exit(0)


def _settings(request: LiveRequest, scene: Scene) -> LiveSettings:
    vehicle = None
    if request.robot is not None:
        _refuse(request, ROBOT_REFUSES, "a robot has its own: expected none with --robot")
        _refuse(request, DRIVEN_REFUSES, "a robot stands on the floor: expected none with --robot")
        vehicle = Vehicle.load(request.robot)
        document = CameraDocument.of_camera(vehicle.camera(request.camera_name).sensor)
        words: tuple[str, ...] | None = _robot_words(request, vehicle, document)
    else:
        document, words = _document(request)
    if request.preset is not None:
        document = document.with_degradation(request.preset)
        words = None if words is None else (*words, "--preset", request.preset)
    size_px = request.size_px or SIZE_PX
    document = dataclasses.replace(document.with_value("size_px", size_px))
    words = None if words is None else (*words, "--size", str(size_px))
    if request.quality is not None:
        document = document.with_value("sensor.camera.quality", request.quality)
        document.camera()  # or there is no such quality
        words = None if words is None else (*words, "--quality", request.quality)
    scene_words: list[str] = [request.scene or SCENE]
    if request.up_axis is not None:
        scene_words += ["--up-axis", request.up_axis]
    if request.meters_per_unit is not None:
        scene_words += ["--meters-per-unit", repr(request.meters_per_unit)]
    if request.sky is not None:
        scene_words += ["--sky", request.sky]
    if request.unlit:
        scene_words += ["--unlit"]
    if request.baked is not None:
        scene_words += ["--baked", str(request.baked)]
    for folder in request.resources or ():
        scene_words += ["--resources", str(folder)]
    if request.robot is not None:
        scene_words += ["--robot", request.robot]
    return LiveSettings(
        scene, document, vehicle, request.camera_name, tuple(scene_words), words, request.device,
        request.unlit, SceneInLight(request.scene or SCENE, partial(_read_in_light, request)),
    )  # fmt: skip


def _read_in_light(request: LiveRequest, path: Path, tables: Mapping[str, Any]) -> Scene:
    """Read a TOML that extends the scene, with those of its options that tables leave."""
    own_sky, own_light = "sky" in tables, bool({"sky", "light"} & tables.keys())
    return read_scene(
        path,
        request.up_axis,
        request.meters_per_unit,
        request.resources or (),
        sky=None if own_sky else request.sky,
        baked=None if own_light else request.baked,
    )


def _robot_words(
    request: LiveRequest, vehicle: Vehicle, document: CameraDocument
) -> tuple[str, ...] | None:
    """Options of the robot's camera; None where its document is another one by rounding."""
    own, camera = vehicle.camera(request.camera_name).sensor, document.camera()
    if camera.model.parameters() != own.model.parameters():
        return None
    if not np.array_equal(camera.base_from_rig, own.base_from_rig):
        return None
    return () if request.camera_name is None else ("--camera-name", request.camera_name)


def _document(request: LiveRequest) -> tuple[CameraDocument, tuple[str, ...] | None]:
    """Document of the camera that the options name, and these options; None: its file says all."""
    given = {
        option: path
        for option, path in (
            ("--sensor", request.sensor), ("--optics", request.optics), ("--camera", request.camera)
        )
        if path is not None
    }  # fmt: skip
    if len(given) > 1:
        raise OutputError(f"{', '.join(given)}: expected one of them, got {len(given)}")
    if request.camera is not None:
        check_calibration_path(request.camera, None)
        camera = read_camera(None, request.camera, request.camera_name, request.mirrored)
        words = ["--camera", str(request.camera)]
        if request.camera_name is not None:
            words += ["--camera-name", request.camera_name]
        if request.mirrored is not None:
            words += ["--mirrored" if request.mirrored else "--not-mirrored"]
        return CameraDocument.of_camera(camera), tuple(words)
    _refuse(
        request, {"--camera-name": "camera_name", "--mirrored": "mirrored"}, "requires --camera"
    )
    if request.optics is not None:
        return CameraDocument.of_optics_file(request.optics), None
    if request.sensor is not None:
        return CameraDocument.of_sensor_file(request.sensor), ("--sensor", str(request.sensor))
    return CameraDocument(), ()


def _place(request: LiveRequest, scene: Scene) -> Place | None:
    if request.at is None and request.yaw_deg is None and not request.pitch_deg:
        return None
    at = scene.start.position_m if request.at is None else request.at
    yaw_deg = scene.start.yaw_deg if request.yaw_deg is None else request.yaw_deg
    return Place(at, yaw_deg, request.pitch_deg)


def _refuse(request: LiveRequest, options: dict[str, str], reason: str) -> None:
    for option, name in options.items():
        if getattr(request, name) != getattr(LiveRequest, name):  # its default
            raise OutputError(f"{option}: {reason}")
