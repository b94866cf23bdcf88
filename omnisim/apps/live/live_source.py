"""Images of the live page: of an editable camera, coarse and fine, or of a recorded run; a film."""

from __future__ import annotations

import dataclasses
import math
import shlex
import tempfile
import time
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.apps.live.camera_document import (
    FILE_NAME,
    SCENE_FILE,
    CameraDocument,
    SceneInLight,
    scene_text,
    without_overridden,
)
from omnisim.apps.live.session import PageDraw, PageState
from omnisim.apps.live.view_maker import LiveFrame, ViewMaker
from omnisim.apps.live.viewpoint_motion import DIGITS_M, Place
from omnisim.cameras import NonCentralCamera
from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import OmnisimError, RunError, SceneError
from omnisim.core.files.image_files import image_bytes
from omnisim.core.poses import inverse, pose_from_rotation
from omnisim.core.trajectories import read_trajectory
from omnisim.core.world import WorldState
from omnisim.ground_truth import CHANNELS
from omnisim.ground_truth.channel_files import StoredChannels
from omnisim.ground_truth.frame import Frame
from omnisim.ground_truth.previews import preview
from omnisim.plots.video_file import check_video_target, write_video
from omnisim.rendering.camera.captured_image import read_captured_image
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.stage import Stage
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.ground import MAX_TRIANGLES
from omnisim.runs.run_folder import GROUND_TRUTH, RunFolder
from omnisim.scene import Scene

ADVANCE_M = 0.1  # motion to the next image for flow, as in `omnisim render`
SCALES = (1.0, 0.7, 0.5)  # sizes of coarse images relative to fine ones
SLOW_S, QUICK_S = 0.14, 0.035  # render times that make coarse images smaller or larger
COARSE = "fast"  # quality of coarse images
_NO_LIGHT = "scene: its light cannot be changed: the scene was not read from a file"
RATE_HZ, SECONDS, RADIUS_M = 20.0, 6.0, 0.6


@dataclass(frozen=True)
class LiveSettings:
    """Initial scene and camera of the live page."""

    scene: Scene  # scene to render
    document: CameraDocument  # document of the camera
    vehicle: Vehicle | None = None  # robot that carries the camera; None: free flight
    # name of the robot's camera, or of the one that the document replaces; None: the first
    camera_name: str | None = None
    scene_arguments: tuple[str, ...] = ()  # command-line arguments for scene and robot
    # command-line options of the initial camera; None: no options describe the camera, only a
    # sensor file
    camera_options: tuple[str, ...] | None = ()
    device: int | None = None  # index of the GPU; None: the first
    unlit: bool = False  # render plain base colors, without lights
    # scene that can be reloaded in another light; None: the light is fixed
    light: SceneInLight | None = None


class LiveSource:
    """Renderers of the current camera; usable only by the thread that created them.

    Raises:
        OmnisimError: no OpenGL, or the scene exceeds its limits.
    """

    channel_names = tuple(CHANNELS)

    def __init__(self, settings: LiveSettings):
        self._settings, self.scene = settings, settings.scene
        self._light: Mapping[str, Any] = {}
        vehicle = settings.vehicle
        self._hidden = () if vehicle is None else tuple(vehicle.camera(settings.camera_name).hides)
        self.stage = self._open(settings.scene)
        self._document: CameraDocument | None = None
        self._camera = OmniCamera()
        self._renderers: dict[float | None, Renderer] = {}  # by coarse scale; None: fine
        self._scale, self._slow = 0, 0

    @property
    def camera(self) -> OmniCamera:
        """Camera of the last valid document."""
        return self._camera

    def use(self, document: CameraDocument) -> bool:
        """Switch to the camera and light of a document; return True if the document has changed.

        Raises:
            OmnisimError: the document is invalid; the previous camera stays in use.
        """
        if document == self._document:
            return False
        camera = document.camera()
        before = self._camera, self._renderers, self.stage, self.scene
        self._camera, self._renderers = camera, {}
        try:
            if document.light != self._light:
                light = self._settings.light
                if not document.light:
                    self.scene = self._settings.scene
                elif light is None:
                    raise SceneError(_NO_LIGHT)
                else:
                    self.scene = light.scene(document.light)
                self.stage = self._open(self.scene)
            self._renderer(self._coarse_scale)  # raises an error if the GPU cannot render it
        except OmnisimError:
            if self.stage is not before[2]:
                self.stage.close()
            self._camera, self._renderers, self.stage, self.scene = before
            raise
        for renderer in before[1].values():
            renderer.close()
        if self.stage is not before[2]:
            before[2].close()
        self._document, self._light = document, document.light
        return True

    def _open(self, scene: Scene) -> Stage:
        vehicle = self._settings.vehicle
        body = None if vehicle is None else vehicle.body
        return Stage(scene, body, device=self._settings.device)

    @property
    def has_light(self) -> bool:
        """True if the light of the scene can be changed and is rendered."""
        return self._settings.light is not None and not self._settings.unlit

    def scene_text(self, document: CameraDocument) -> str:
        """Text of a scene's TOML with the light of a document.

        Raises:
            SceneError: the scene was not read from a file.
        """
        if self._settings.light is None:
            raise SceneError(_NO_LIGHT)
        return scene_text(self._settings.light.source, document.light)

    def take(self, draw: PageDraw, channels: Collection[str]) -> LiveFrame:
        """Render the image of a state."""
        self.use(draw.state.document)
        begin_s = time.monotonic()
        scale = None if draw.is_fine else self._coarse_scale
        renderer = self._renderer(scale)
        frame = self._render(renderer, draw, channels)
        if scale is not None and not self._is_slow:  # there, a change costs more than it saves
            seconds = time.monotonic() - begin_s
            # smaller coarse images after two slow ones in a row; larger ones after a quick one
            self._slow = self._slow + 1 if seconds > SLOW_S else 0
            if self._slow >= 2 and self._scale + 1 < len(SCALES):
                self._scale, self._slow = self._scale + 1, 0
            elif seconds < QUICK_S and self._scale > 0:
                self._scale -= 1
        camera, base = renderer.camera, self._base(renderer, draw.state.place)
        png = image_bytes(Path("image.png"), frame.rgb, frame.metadata) if draw.is_fine else None
        rest = frame.rgb, png, frame.channels, frame.labels
        return LiveFrame(camera.model, camera.base_from_optical, base, *rest)

    def files(self, draw: PageDraw) -> dict[str, bytes]:
        """Image files with all channels, as `omnisim render --also all` writes them."""
        self.use(draw.state.document)
        frame = self._render(self._renderer(None), draw, tuple(CHANNELS))
        with tempfile.TemporaryDirectory() as folder:
            frame.save(Path(folder) / "image.png", previews=True)
            return {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir())}

    def statistics(self, draw: PageDraw) -> dict[str, Any]:
        """Numbers of triangles behind the fine image of a state: submitted, drawn, seen."""
        self.use(draw.state.document)
        renderer = self._renderer(None)
        base = self._base(renderer, draw.state.place)
        state = WorldState({renderer.vehicle: base}, draw.state.time_s)
        return renderer.statistics(state)._asdict()

    def command(self, state: PageState, frame: LiveFrame) -> str:
        """Shell commands that render the same image; they first write edited files."""
        document = state.document
        scene_arguments, lines = self._settings.scene_arguments, []
        if document.light:
            text = self.scene_text(document)
            lines.append(f"cat > {SCENE_FILE} <<'END'\n{text.rstrip()}\nEND\n")
            scene_arguments = (SCENE_FILE, *without_overridden(scene_arguments[1:], document.light))
        arguments = ["omnisim", "render", *scene_arguments]
        given = self._settings.camera_options
        if replace(document, light={}) == self._settings.document and given is not None:
            arguments += given
        else:
            lines.append(f"cat > {FILE_NAME} <<'END'\n{document.text.rstrip()}\nEND\n")
            arguments += ["--sensor", FILE_NAME]
            if document.size_px is not None:
                arguments += ["--size", str(document.size_px)]
        at = self._viewpoint(state.place)
        arguments += ["--at", *(f"{value!r}" for value in at.position_m)]
        angles = (("--yaw", at.yaw_deg), ("--pitch", at.pitch_deg), ("--roll", at.roll_deg))
        for option, angle in angles:
            if angle or option == "--yaw":
                arguments += [option, f"{angle!r}"]
        if state.time_s:
            arguments += ["--time", f"{state.time_s!r}"]
        arguments += ["-o", "image.png"]
        return "".join(lines) + shlex.join(arguments)

    def about(self) -> dict[str, Any]:
        """Names of scene and robot, and the robot's outline."""
        vehicle = self._settings.vehicle
        size = None if vehicle is None else vehicle.footprint
        return {
            "scene": self.scene.name,
            "robot": None if vehicle is None else vehicle.title,
            "outline_m": None if size is None else [size.length_m, size.width_m],
            "steps": None,
            "has_clock": bool(self.scene.objects) or self.scene.deforms,
            "has_walls": vehicle is None and self.scene.triangle_count <= MAX_TRIANGLES,
            "is_editable": True,
        }

    def close(self) -> None:
        """Free the GPU memory."""
        for renderer in self._renderers.values():
            renderer.close()
        self.stage.close()

    def _renderer(self, scale: float | None) -> Renderer:
        if scale not in self._renderers:
            camera = self._camera
            if scale is not None:
                camera = camera.with_quality(COARSE)
                if self._is_slow:
                    camera = dataclasses.replace(camera, supersampling=1)
                shorter_px = min(camera.model.width_px, camera.model.height_px)
                if scale < 1.0:
                    camera = camera.resized(max(1, round(shorter_px * scale)))
            hidden, unlit = self._hidden, self._settings.unlit
            self._renderers[scale] = self.stage.open(camera, hidden=hidden, unlit=unlit)
        return self._renderers[scale]

    @property
    def _is_slow(self) -> bool:
        """True for non-central cameras, whose samples each need a traced ray."""
        return isinstance(self._camera.model, NonCentralCamera)

    @property
    def _coarse_scale(self) -> float:
        return SCALES[-1] if self._is_slow else SCALES[self._scale]

    def _base(self, renderer: Renderer, place: Place) -> Any:
        at = self._viewpoint(place)
        return renderer.camera.base_pose(
            at.position_m, yaw_deg=at.yaw_deg, pitch_deg=at.pitch_deg, roll_deg=at.roll_deg
        )

    def _viewpoint(self, place: Place) -> Place:
        """Pose of the effective viewpoint for a pose of the base, rounded as on a command line."""
        if self._settings.vehicle is None:
            return place
        rig = place.pose @ self._camera.base_from_rig
        x, y, z = (round(float(value), DIGITS_M) + 0.0 for value in rig[:3, 3])
        return dataclasses.replace(place, position_m=(x, y, z))

    def _render(self, renderer: Renderer, draw: PageDraw, channels: Collection[str]) -> Frame:
        base, time_s = self._base(renderer, draw.state.place), draw.state.time_s
        states = {}
        for other, distance_m in (("next", ADVANCE_M), ("previous", -ADVANCE_M)):
            moved = base.copy()
            moved[:3, 3] += distance_m * base[:3, 0]
            states[other] = WorldState({renderer.vehicle: moved}, time_s)
        return renderer.render(
            WorldState({renderer.vehicle: base}, time_s),
            also=channels,
            next_state=states["next"],
            previous_state=states["previous"],
        )


class RunSource:
    """Images of a run's camera, with the recorded channels.

    Args:
        scene: file or name of the scene, if it has moved; None: the recorded one.
        camera_name: name of the run's camera; None: the first.
        device: index of the GPU, for the map.

    Raises:
        OmnisimError: no run, no camera, no images yet, or a damaged file.
    """

    def __init__(
        self,
        folder: Path,
        scene: str | None = None,
        camera_name: str | None = None,
        device: int | None = None,
    ):
        self._run = RunFolder.read(folder)
        self._camera_name = self._run.camera(camera_name)
        recorded = self._run.manifest.scene
        self.scene = recorded.load(scene)
        self.steps = self._run.measurements_done(self._camera_name)
        if self.steps == 0:
            raise RunError(f"{folder}: has no images yet: run its command again to resume it")
        first = read_captured_image(self._image(0))
        self.camera = OmniCamera(first.camera, polygons=None)
        self.channel_names = self._run.channels_at(0, self._camera_name)
        self.stage = Stage(self.scene, device=device)

    def take(self, draw: PageDraw, channels: Collection[str]) -> LiveFrame:
        """Read the image of a step, with the requested channels that were recorded."""
        path = self._image(min(draw.state.step, self.steps - 1))
        frame = read_captured_image(path)
        stored = StoredChannels(path, frame.metadata)
        names = [name for name in stored.names if name in set(channels)]
        base = np.eye(4) if frame.world_from_base is None else frame.world_from_base
        arm_m = np.zeros(3)
        if frame.world_from_optical is not None:
            arm_m = base[:3, :3].T @ (frame.world_from_optical[:3, 3] - base[:3, 3])
        base_from_optical = pose_from_rotation(frame.base_from_optical, arm_m)
        png = path.read_bytes() if draw.is_fine else None
        truth = (stored.read(tuple(names)), stored.labels) if names else ({}, None)
        return LiveFrame(self.camera.model, base_from_optical, base, frame.pixels, png, *truth)

    def files(self, draw: PageDraw) -> dict[str, bytes]:
        """Contents of the camera's files at a step, by file name."""
        stem = self._run.stem(self._camera_name, min(draw.state.step, self.steps - 1))
        return {path.name: path.read_bytes() for path in sorted(stem.parent.glob(f"{stem.name}.*"))}

    def statistics(self, draw: PageDraw) -> dict[str, Any]:
        """None, as nothing is drawn.

        Raises:
            RunError: always.
        """
        raise RunError("triangles are not counted in the images of a recorded run")

    def command(self, state: PageState, frame: LiveFrame) -> str:
        """Name of the image's file, as a shell comment."""
        return f"# {self._image(min(state.step, self.steps - 1))}"

    def about(self) -> dict[str, Any]:
        """Title, steps and driven path of the run."""
        path: list[list[float]] = []
        if self._run.has(GROUND_TRUTH):
            truth: Floats = read_trajectory(self._run.path / GROUND_TRUTH).positions_m
            path = np.round(truth[:, :2], 3).tolist()
        return {
            "scene": self.scene.name,
            "robot": self._run.manifest.title,
            "outline_m": None,
            "steps": self.steps,
            "driven_m": path,
            "has_clock": False,
            "is_editable": False,
        }

    def close(self) -> None:
        """Free the GPU memory."""
        self.stage.close()

    def _image(self, step: int) -> Path:
        return self._run.file(self._camera_name, step, ".png")


def start_place(settings: LiveSettings, at: Place | None) -> Place:
    """Start pose: of the viewpoint, or of the base of the robot that carries the camera.

    Args:
        settings: initial scene and camera.
        at: pose of the viewpoint; None: the scene's start.
    """
    scene = settings.scene
    if settings.vehicle is None:
        start = scene.start
        return at or Place(start.position_m, start.yaw_deg)
    if at is None:
        if scene.starts:
            first = scene.starts[0]
            return Place(first.position_m, first.yaw_deg)
        start = scene.start
        x, y, _ = start.position_m
        return Place((x, y, 0.0), start.yaw_deg)
    base = at.pose @ inverse(settings.document.camera().base_from_rig)
    x, y, z = base[:3, 3].tolist()
    yaw_deg = math.degrees(math.atan2(base[1, 0], base[0, 0]))
    return Place((x, y, z), yaw_deg)


def record_film(path: Path, settings: LiveSettings, at: Place | None) -> int:
    """Write a film, and return the number of its images.

    Args:
        path: video file.
        settings: initial scene and camera.
        at: start pose; None: the scene's start.

    Raises:
        OmnisimError: the file cannot be written, or an error of `LiveSource`.
    """
    check_video_target(path)
    source, start = LiveSource(settings), start_place(settings, at)
    try:
        return write_video(path, _images(source, settings.document, start), RATE_HZ)
    finally:
        source.close()


def circle(start: Place, count: int) -> Iterator[Place]:
    """Places along a circle to the left of the start, and once around it, looking ahead."""
    x, y, z = start.position_m
    yaw = math.radians(start.yaw_deg)
    for number in range(count):
        angle = 2.0 * math.pi * number / count
        ahead = math.sin(yaw + angle) - math.sin(yaw)
        left = math.cos(yaw) - math.cos(yaw + angle)
        position_m = x + RADIUS_M * ahead, y + RADIUS_M * left, z
        yield Place(position_m, start.yaw_deg + math.degrees(angle)).rounded()


def _images(source: LiveSource, document: CameraDocument, start: Place) -> Iterator[Bytes]:
    """Images of a circular drive: the camera with its range beside it, and the panorama below."""
    views = ViewMaker()
    for place in circle(start, round(RATE_HZ * SECONDS)):
        draw = PageDraw(PageState(document, place), True)
        frame = source.take(draw, ("range",))
        depth = preview("range", frame.channels["range"], frame.labels)
        top = np.concatenate((frame.rgb, depth), axis=1)
        panorama = views.image("panorama", frame, draw.state.gaze, start.position_m[2], True)
        height, own = panorama.shape[:2]  # padded or cropped on both sides
        width = top.shape[1]
        below, common = np.zeros((height, width, 3), dtype=np.uint8), min(width, own)
        left, from_left = (width - common) // 2, (own - common) // 2
        below[:, left : left + common] = panorama[:, from_left : from_left + common]
        yield np.concatenate((top, below))
