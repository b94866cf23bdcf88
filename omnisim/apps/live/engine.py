"""Render thread: owns OpenGL and draws the latest requested state."""

from __future__ import annotations

import io
import math
import threading
import time
import traceback
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from omnisim.apps.live import view_maker
from omnisim.apps.live.camera_document import FILE_NAME, SCENE_FILE
from omnisim.apps.live.controls import control_groups
from omnisim.apps.live.live_messages import MessagePart, ProbePoint, RequestStatistics, Save, pack
from omnisim.apps.live.live_source import LiveSource, RunSource
from omnisim.apps.live.session import PageDraw, PageJob, Session
from omnisim.core.arrays import Bytes
from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import image_bytes, png_bytes
from omnisim.ground_truth import CHANNELS
from omnisim.ground_truth.previews import legend, preview

COARSE_JPEG, VIEW_JPEG = 85, 90  # JPEG qualities
PROBED = ("range", "position", "semantic", "instance")  # channels for a probe
SEEN_BINS = 120  # number of directions in the outline of the visible area on the map
MAP_INSIDE = 0.02  # margin as a share of the map; a viewpoint within it renews the map
Publish = Callable[[str, bytes, int], None]  # kind, message, and number of the state it shows
AnySource = LiveSource | RunSource
T = TypeVar("T")


class Engine:
    """Render thread, which draws the states of a session until the thread is stopped.

    Args:
        session: session with the requested states.
        open_source: function that opens the source of images, called in the render thread.
        publish: function that sends a message to all pages, called in the render thread.

    Attributes:
        source: source of images, once the thread has started.
    """

    source: AnySource

    def __init__(self, session: Session, open_source: Callable[[], AnySource], publish: Publish):
        self._session, self._open_source, self._publish = session, open_source, publish
        self._views = view_maker.ViewMaker()
        self._map: view_maker.FloorMap | None = None
        self._truth: tuple[int, view_maker.LiveFrame] | None = (
            None  # number and image of the last fine state
        )
        self._last: view_maker.LiveFrame | None = None
        self._times_ms: dict[str, float] = {}
        self._thread = threading.Thread(target=self._run, name="omnisim-engine", daemon=True)
        self._error: BaseException | None = None
        self._is_open = threading.Event()

    def start(self) -> None:
        """Start the thread, and wait until the scene is on the GPU.

        Raises:
            OmnisimError: no OpenGL, or the scene exceeds its limits.
        """
        self._thread.start()
        self._is_open.wait()
        if self._error is not None:
            raise self._error

    def stop(self, timeout_s: float) -> bool:
        """Stop after the current image; False if the thread still runs after `timeout_s`."""
        self._session.stop()
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            self.source = self._open_source()
        except BaseException as error:  # `start` raises it
            self._error = error
            return
        finally:
            self._is_open.set()
        try:
            while (work := self._session.next_work()) is not None:
                try:
                    if isinstance(work, PageDraw):
                        self._draw(work)
                    else:
                        self._answer(work)
                except OmnisimError as error:
                    self._fail(work, error)
                except Exception as error:  # a bug must not end the page
                    traceback.print_exc()
                    self._fail(work, OmnisimError(f"{type(error).__name__}: {error}"))
        finally:
            self.source.close()

    def _fail(self, work: PageDraw | PageJob, error: OmnisimError) -> None:
        message = pack("error", {"text": str(error)})
        if isinstance(work, PageJob):
            work.reply(message)
            return
        self._publish("error", message, 0)
        if not work.is_fine:  # if only the fine image fails, the camera is kept
            self._session.reject(work.state.document)
        self._session.drawn(work)
        self._session.ask()  # the page that asked has received no image

    def _draw(self, draw: PageDraw) -> None:
        self._times_ms, begin_s, is_new = {}, time.perf_counter(), False
        source, state = self.source, draw.state
        use = partial(source.use, state.document) if isinstance(source, LiveSource) else None
        if use is not None and self._timed("camera", use):
            self._session.accept(state.document)
            is_new = True
        channels = [name for name in state.views if name in source.channel_names]
        if draw.is_fine and "map" in state.views and "position" in source.channel_names:
            channels.append("position")
        frame = self._timed("render", lambda: source.take(draw, tuple(dict.fromkeys(channels))))
        self._last = frame
        parts = self._parts(draw, frame)
        shows_map = draw.is_fine and "map" in state.views
        self._truth = (state.change, frame) if draw.is_fine else None
        content = {
            "change": state.change,
            "is_fine": draw.is_fine,
            "place": _place(state.place),
            "viewpoint": _place(frame.viewpoint),
            "time_s": state.time_s,
            "step": state.step,
            "look": dict(state.gaze),
            "seen_m": _seen(frame) if shows_map else None,
            "blocked_by": self._session.blocked_by,
            "walls": self._session.has_walls,
            "history": self._session.history,
            "times_ms": {name: round(ms, 1) for name, ms in self._times_ms.items()},
        }
        if draw.is_fine:
            content["command"] = source.command(state, frame)
        self._publish("frame", pack("frame", content, parts), state.change)
        self._session.drawn(draw, time.perf_counter() - begin_s)
        if is_new:  # after the image, which the page is waiting for
            self._publish_camera(draw)
        if shows_map:
            self._renew_map(frame)

    def _parts(self, draw: PageDraw, frame: view_maker.LiveFrame) -> list[MessagePart]:
        """Parts of a message: the camera's image and the views; a failed view has the reason."""
        if frame.png is not None:
            parts = [MessagePart("camera", "image/png", frame.png, {})]
        else:
            parts = [self._timed("encode", lambda: _jpeg("camera", frame.rgb, COARSE_JPEG))]
        gaze, height_m = draw.state.gaze, frame.viewpoint.position_m[2] - self._ground_m

        def view(name: str) -> MessagePart:
            unwarped = self._views.image(name, frame, gaze, height_m, draw.is_fine)
            return _jpeg(name, unwarped, VIEW_JPEG)

        for name in draw.state.views:
            try:
                if name in view_maker.UNWARPED:
                    parts.append(self._timed(name, partial(view, name)))
                elif name in CHANNELS:
                    parts.append(self._timed(name, partial(_channel, name, draw, frame)))
            except OmnisimError as reason:
                parts.append(MessagePart(name, "", b"", {"reason": str(reason)}))
        return parts

    @property
    def _ground_m(self) -> float:
        return 0.0 if self._map is None else self._map.ground_m

    def _renew_map(self, frame: view_maker.LiveFrame) -> None:
        """Draw and publish the map if there is none yet, or if the viewpoint is near its edge."""
        position_m = frame.viewpoint.position_m
        at = np.array(position_m[:2])
        if (old := self._map) is not None:
            margin = MAP_INSIDE * (old.high_m - old.low_m)
            if np.all((at >= old.low_m + margin) & (at <= old.high_m - margin)):
                return
        self._map = new = view_maker.draw_floor_map(self.source.stage, position_m)
        about = {
            "low_m": new.low_m.tolist(), "high_m": new.high_m.tolist(), "ground_m": new.ground_m,
        }  # fmt: skip
        self._publish("map", pack("map", about, [_jpeg("map", new.rgb, VIEW_JPEG)]), 0)

    def _publish_camera(self, draw: PageDraw) -> None:
        source = self.source
        assert isinstance(source, LiveSource)
        model, scene = source.camera.model, source.scene if source.has_light else None
        content = {
            "groups": control_groups(draw.state.document, source.camera, scene),
            "profile": view_maker.profile(model),
            "text": draw.state.document.text,
            "width_px": model.width_px,
            "height_px": model.height_px,
            "model": model.model_name,
            "mesh": source.camera.mesh_summary,
        }
        self._publish("camera", pack("camera", content), 0)

    def _answer(self, job: PageJob) -> None:
        source, draw = self.source, PageDraw(job.state, True)
        if isinstance(job.message, RequestStatistics):
            counted = source.statistics(draw)
            job.reply(pack("statistics", {"change": job.state.change, **counted}))
            return
        if isinstance(job.message, Save):
            if job.message.what == "toml":
                files = {FILE_NAME: job.state.document.checked_text().encode()}
                if isinstance(source, LiveSource) and job.state.document.light:
                    files[SCENE_FILE] = source.scene_text(job.state.document).encode()
            else:
                files = source.files(draw)
            name, media_type, data = "omnisim.zip", "application/zip", b""
            if len(files) == 1:
                ((name, data),) = files.items()
                media_type = "application/octet-stream"
            else:
                archive = io.BytesIO()
                with zipfile.ZipFile(archive, "w", zipfile.ZIP_STORED) as target:
                    for file, content in files.items():
                        target.writestr(zipfile.ZipInfo(file), content)
                data = archive.getvalue()
            job.reply(pack("saved", {"name": name}, [MessagePart(name, media_type, data, {})]))
            return
        assert isinstance(job.message, ProbePoint)
        # the fine state's image, with the needed channels; else the last image
        frame = self._last
        if self._truth is not None and self._truth[0] == job.state.change:
            change, frame = self._truth
            names = [name for name in PROBED if name in source.channel_names]
            if not set(names) <= set(frame.channels):
                frame = source.take(draw, (*names, *frame.channels))
                self._truth = (change, frame)
        if frame is None:  # no image yet
            return
        height_m = frame.viewpoint.position_m[2] - self._ground_m
        answer = view_maker.probe(job.message, frame, self._views, job.state.gaze, height_m)
        job.reply(pack("probe", answer))
        if job.message.follow and "yaw_deg" in answer and job.message.view != "perspective":
            self._session.look_at(answer["yaw_deg"], answer["pitch_deg"])

    def _timed(self, name: str, work: Callable[[], T]) -> T:
        begin_s = time.perf_counter()
        try:
            return work()
        finally:
            self._times_ms[name] = 1e3 * (time.perf_counter() - begin_s)


def _seen(frame: view_maker.LiveFrame) -> list[list[float]]:
    """Outline (x, y), m, for the map: the farthest visible point in each direction."""
    points = frame.channels.get("position")
    if points is None:
        return []
    eye = np.array(frame.viewpoint.position_m)
    offsets = points[::2, ::2].reshape(-1, 3) - eye
    offsets = offsets[np.isfinite(offsets).all(axis=1)]
    distances = np.hypot(offsets[:, 0], offsets[:, 1])
    share = np.arctan2(offsets[:, 1], offsets[:, 0]) / (2.0 * math.pi) % 1.0
    farthest = np.zeros(SEEN_BINS)
    np.maximum.at(farthest, (share * SEEN_BINS).astype(np.intp) % SEEN_BINS, distances)
    angles = (np.arange(SEEN_BINS) + 0.5) * (2.0 * math.pi / SEEN_BINS)
    outline = eye[:2] + farthest[:, None] * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    return np.round(outline, 2).tolist()


def _place(place: Any) -> dict[str, Any]:
    return {
        "position_m": [round(value, 6) for value in place.position_m],
        "yaw_deg": round(place.yaw_deg, 6),
        "pitch_deg": round(place.pitch_deg, 6),
        "roll_deg": round(place.roll_deg, 6),
    }


def _jpeg(name: str, rgb: Bytes, quality: int) -> MessagePart:
    return MessagePart(name, "image/jpeg", image_bytes(Path("a.jpg"), rgb, None, quality), {})


def _channel(name: str, draw: PageDraw, frame: view_maker.LiveFrame) -> MessagePart:
    """Part with a channel's preview and legend: PNG for fine images, else JPEG."""
    if name not in frame.channels:
        return MessagePart(name, "", b"", {"reason": "not recorded at this step"})
    values = frame.channels[name]
    colors = preview(name, values, frame.labels)
    about = {"legend": legend(name, values, frame.labels)}
    if draw.is_fine:
        return MessagePart(name, "image/png", png_bytes(colors), about)
    return MessagePart(
        name, "image/jpeg", image_bytes(Path("a.jpg"), colors, None, VIEW_JPEG), about
    )
