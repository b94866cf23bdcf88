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
from omnisim.apps.cli.images.requests import LiveRequest, LiveSceneOptions
from omnisim.apps.cli.inputs import check_calibration_path, read_camera
from omnisim.apps.cli.option_groups import CameraFileOptions, LightOptions
from omnisim.apps.cli.options import flag_of, refuse_given, words_of
from omnisim.apps.live.camera_document import CameraDocument, SceneInLight
from omnisim.apps.live.live import LivePage
from omnisim.apps.live.live import run as run_page
from omnisim.apps.live.live_source import LiveSettings, RunSource
from omnisim.apps.live.viewpoint_motion import Place
from omnisim.core.errors import OutputError
from omnisim.robots.vehicle import Vehicle
from omnisim.scene import Scene, read_scene

SCENE, SIZE_PX = "soccer", 400


def run(request: LiveRequest) -> None:
    """Serve the page until Ctrl-C."""
    if request.run is not None:
        reason = "expected none with --run, as a run has its own"
        refuse_given(request, reason, "robot")
        refuse_given(request.camera, reason, "sensor", "optics", "calibration_file")
        refuse_given(request.viewpoint, reason, "at", "yaw_deg", "pitch_deg")
        refuse_given(request.page, reason, "record")
        refuse_given(request.image, reason)
        refuse_given(request.light, reason)
        where = request.run, request.world.scene, request.camera.camera_name, request.gpu.device
        replayed = LivePage(partial(RunSource, *where), request.page.host, request.page.port)
        _serve(replayed, request)
        return
    scene = _read(request.world, request.light, request.world.scene or SCENE, {})
    for notice in scene.notices:
        print_note(notice)
    settings, place, at = _settings(request, scene), None, request.viewpoint
    if at.at is not None or at.yaw_deg is not None or at.pitch_deg:
        yaw_deg = scene.start.yaw_deg if at.yaw_deg is None else at.yaw_deg
        place = Place(scene.start.position_m if at.at is None else at.at, yaw_deg, at.pitch_deg)
    if request.page.record is not None:
        from omnisim.apps.live.live_source import record_film

        count = record_film(request.page.record, settings, place)
        out.print(f"{request.page.record}: {count} images")
        return
    page = request.page
    _serve(LivePage(settings, page.host, page.port, place, at.time_s), request)


def _serve(page: LivePage, request: LiveRequest) -> None:
    def is_open() -> None:
        out.print(f"Open {page.server.url} in a browser; Ctrl-C ends it.")
        sys.stdout.flush()
        if request.page.open:
            import webbrowser

            webbrowser.open(page.server.url)

    is_done = run_page(page, is_open)
    out.print("stopped")
    if not is_done:  # the thread that renders a large scene would delay the exit
        sys.stdout.flush()
        os._exit(0)


def _settings(request: LiveRequest, scene: Scene) -> LiveSettings:
    vehicle = None
    if request.robot is not None:
        reason = "expected none with --robot, as a robot stands on the floor"
        refuse_given(request.viewpoint, reason, "pitch_deg")
        vehicle = Vehicle.load(request.robot)
    files = request.camera
    has_own = (files.sensor or files.optics or files.calibration_file) is not None
    camera_name = None if has_own else files.camera_name
    if vehicle is None or has_own:
        document, camera_options = _document(files)
    else:
        own = vehicle.camera(camera_name).sensor
        document = CameraDocument.of_camera(own)
        camera_options = () if camera_name is None else ("--camera-name", camera_name)
        camera = document.camera()
        is_same = camera.model.parameters() == own.model.parameters()
        if not (is_same and np.array_equal(camera.base_from_rig, own.base_from_rig)):
            camera_options = None  # rounding has changed the document
    image = dataclasses.replace(request.image, size_px=request.image.size_px or SIZE_PX)
    if image.preset is not None:
        document = document.with_degradation(image.preset)
    if image.exposure_ev is not None:
        document = document.with_exposure(image.exposure_ev)
    document = document.with_value("size_px", image.size_px)
    if image.quality is not None:
        document = document.with_value("sensor.camera.quality", image.quality)
    if camera_options is not None:
        camera_options = (*camera_options, *words_of(image))
    name = request.world.scene or SCENE
    same_scene = (*words_of(request.world), *words_of(request.light), *words_of(request, "robot"))
    in_light = SceneInLight(name, partial(_read, request.world, request.light))
    return LiveSettings(
        scene, document, vehicle, camera_name, (name, *same_scene),
        camera_options, request.gpu.device, request.light.unlit, in_light,
    )  # fmt: skip


def _read(
    world: LiveSceneOptions, light: LightOptions, scene: str | Path, tables: Mapping[str, Any]
) -> Scene:
    """Read a scene; the sky and light of a TOML file with such tables override the options."""
    units = world.up_axis, world.meters_per_unit, world.resources or ()
    sky = None if "sky" in tables else light.sky
    baked = None if {"sky", "light"} & tables.keys() else light.baked
    return read_scene(scene, *units, sky=sky, baked=baked)


def _document(files: CameraFileOptions) -> tuple[CameraDocument, tuple[str, ...] | None]:
    """Document of the camera, and its options; None: no options describe the camera."""
    given = {
        flag_of(CameraFileOptions, name): getattr(files, name)
        for name in ("sensor", "optics", "calibration_file")
        if getattr(files, name) is not None
    }
    if len(given) > 1:
        raise OutputError(f"{', '.join(given)}: expected one of them, got {len(given)}")
    if files.calibration_file is not None:
        check_calibration_path(files.calibration_file, None)
        return CameraDocument.of_camera(read_camera(files)), words_of(files)
    refuse_given(files, "requires --camera", "camera_name", "mirrored")
    if files.optics is not None:
        return CameraDocument.of_optics_file(files.optics), None
    if files.sensor is not None:
        return CameraDocument.of_sensor_file(files.sensor), words_of(files)
    return CameraDocument(), ()
