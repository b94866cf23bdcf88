"""User input and the render thread's next job.

Nothing queues: only the newest state is drawn, coarse during motion, fine at rest.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from omnisim.apps.live import live_messages as messages
from omnisim.apps.live.camera_document import MODEL_PATHS, CameraDocument, with_model, with_preset
from omnisim.apps.live.viewpoint_motion import MotionCommand, Pilot, Place
from omnisim.core.errors import OutputError, SceneError

REST_S, MAX_REST_S = 0.12, 1.5  # delay from the last change to the fine image
HELD_S = 1.0  # keys count as released after this time, as the page repeats them
SAME_EDIT_S = 1.5  # changes of one key within this time form a single undo step
UNDO_STEPS = 200
MAX_JOBS = 8


@dataclass(frozen=True)
class PageState:
    """Settings on the page that determine an image."""

    document: CameraDocument  # document of the camera
    place: Place  # pose of the viewpoint, or of the robot's base
    views: tuple[str, ...] = ()  # names of the views beside the camera
    # direction of the perspective view
    gaze: messages.Gaze = field(default_factory=lambda: messages.Gaze(yaw_deg=0.0, pitch_deg=10.0))
    time_s: float = 0.0  # world time
    step: int = 0  # step of a replayed run
    change: int = 0  # number of this state


@dataclass(frozen=True)
class PageDraw:
    """Image to draw: coarse during motion, or fine."""

    state: PageState
    is_fine: bool


@dataclass(frozen=True)
class PageJob:
    """Pending request of a page: files, or a probe."""

    message: messages.Message
    state: PageState
    reply: Callable[[bytes], None]


class Session:
    """State of the page, shared by the server thread and the render thread.

    Args:
        document: document of the camera.
        pilot: motion of the viewpoint or the robot.
        last_step: last step of a replayed run; None: no run.
        time_s: world time at the start.
    """

    def __init__(
        self,
        document: CameraDocument,
        pilot: Pilot,
        last_step: int | None = None,
        time_s: float = 0.0,
    ):
        self._condition = threading.Condition()
        self._first = self._good = document
        self._start = self._state = PageState(document, pilot.place.rounded(), time_s=time_s)
        pilot.place = self._state.place
        self._pilot, self._last_step = pilot, last_step
        self._is_running = False
        self._undo: deque[CameraDocument] = deque(maxlen=UNDO_STEPS)
        self._redo: list[CameraDocument] = []
        self._edit = ("", 0.0)  # key and time of the last edit
        self._jobs: deque[PageJob] = deque()
        self._probe: PageJob | None = None
        self._coarse = self._fine = -1  # numbers of the last drawn states
        self._rest_s = REST_S
        self._changed_s = self._advanced_s = self._driven_s = time.monotonic()
        self._is_requested = self._is_stopping = False

    @property
    def state(self) -> PageState:
        """Current state."""
        with self._condition:
            return self._state

    @property
    def history(self) -> tuple[int, int]:
        """Numbers of edits that can be undone and redone."""
        with self._condition:
            return len(self._undo), len(self._redo)

    @property
    def blocked_by(self) -> str:
        """Instance that blocks the motion; empty: none."""
        return self._pilot.blocked_by

    @property
    def has_walls(self) -> bool:
        """True if surfaces stop free flight."""
        return self._pilot.has_walls

    def ask(self) -> None:
        """Request the next image for a page that has displayed the last one."""
        with self._condition:
            self._is_requested = True
            self._condition.notify()

    def rest(self) -> None:
        """Release all keys, because no page is driving."""
        with self._condition:
            self._pilot.stop()
            self._is_running = False

    def stop(self) -> None:
        """End the session: `next_work` returns None."""
        with self._condition:
            self._is_stopping = True
            self._condition.notify()

    def apply(self, message: messages.Message) -> None:
        """Apply a message from the driving page.

        Raises:
            OmnisimError: an invalid value; the state is unchanged.
        """
        with self._condition:
            self._apply(message)
            self._condition.notify()

    def look_up(
        self,
        message: messages.ProbePoint | messages.Save | messages.RequestStatistics,
        reply: Callable[[bytes], None],
    ) -> None:
        """Queue a question about the current state; any page may ask.

        Raises:
            OutputError: too many requests are waiting.
        """
        with self._condition:
            job = PageJob(message, self._state, reply)
            if isinstance(message, messages.ProbePoint):
                self._probe = job  # replaces the previous one, as the mouse has moved
            elif len(self._jobs) >= MAX_JOBS:
                raise OutputError("too many requests at once: others are still being answered")
            else:
                self._jobs.append(job)
            self._condition.notify()

    def accept(self, document: CameraDocument) -> None:
        """Record that the camera of a document works."""
        with self._condition:
            self._good = document

    def reject(self, document: CameraDocument) -> None:
        """Revert to the last working document, as the camera of this one failed."""
        with self._condition:
            if self._undo and self._undo[-1] == self._good:
                self._undo.pop()
            if self._state.document == document:
                self._change(document=self._good)

    def next_work(self) -> PageDraw | PageJob | None:
        """Wait for work; None: the session has ended."""
        with self._condition:
            while not self._is_stopping:
                work, wait_s = self._work(time.monotonic())
                if work is not None:
                    return work
                self._condition.wait(wait_s)
            return None

    def drawn(self, draw: PageDraw, seconds: float = 0.0) -> None:
        """Record a drawn image; slow fine images delay the start of the next one."""
        with self._condition:
            if draw.is_fine:
                self._rest_s = min(max(REST_S, 0.3 * seconds), MAX_REST_S)
            self._coarse = max(self._coarse, draw.state.change)
            if draw.is_fine:
                self._fine = draw.state.change

    def look_at(self, yaw_deg: float, pitch_deg: float) -> None:
        """Turn the perspective view, which follows the mouse."""
        with self._condition:
            old = self._state.gaze
            angles = {"yaw_deg": round(yaw_deg, 2), "pitch_deg": round(pitch_deg, 2)}
            if (gaze := messages.Gaze(**angles, fov_deg=old.fov_deg)) != old:
                self._change(gaze=gaze)

    def _work(self, now_s: float) -> tuple[PageDraw | PageJob | None, float | None]:
        """Next piece of work, or the seconds to wait for it; None: wait for an event."""
        if self._jobs:
            return self._jobs.popleft(), None
        if now_s - self._driven_s > HELD_S and not self._pilot.command.is_rest:
            self._pilot.command = MotionCommand()
        is_moving = self._pilot.is_moving or self._is_running
        if self._is_requested and (is_moving or self._coarse < self._state.change):
            self._advance(now_s, is_moving)
            self._is_requested = False
            return PageDraw(self._state, False), None
        if not is_moving:
            self._advanced_s = now_s
        wait_s: float | None = None
        if not is_moving and self._is_requested and self._fine < self._state.change:
            wait_s = self._changed_s + self._rest_s - now_s
            if wait_s <= 0.0:
                self._is_requested = False
                return PageDraw(self._state, True), None
        if self._probe is not None and (self._fine == self._state.change or is_moving):
            job, self._probe = self._probe, None
            return replace(job, state=self._state), None
        return None, wait_s

    def _advance(self, now_s: float, is_moving: bool) -> None:
        seconds = now_s - self._advanced_s
        self._advanced_s = now_s
        if not is_moving:
            return
        self._pilot.advance(seconds)
        time_s = self._state.time_s
        if self._is_running:
            time_s = round(time_s + min(seconds, 0.2), 3)
        if self._pilot.place != self._state.place or time_s != self._state.time_s:
            self._change(place=self._pilot.place, time_s=time_s)
        else:
            self._change()  # a robot that pushes against a wall

    def _change(self, **changes: object) -> None:
        self._state = replace(self._state, change=self._state.change + 1, **changes)  # type: ignore[arg-type]
        self._changed_s = time.monotonic()

    def _apply(self, message: messages.Message) -> None:  # noqa: C901 - a list of cases
        pilot, state = self._pilot, self._state
        match message:
            case messages.SetMotion():
                # a key that is pressed and released during a single image has an effect as well
                self._advance(time.monotonic(), pilot.is_moving)
                self._driven_s = time.monotonic()
                pilot.command = MotionCommand(**dict(message))
            case messages.Go():
                pilot.goal_m = (message.x, message.y)
                self._advanced_s = time.monotonic()
            case messages.Turn():
                pilot.turn(message.yaw_deg, message.pitch_deg)
                self._change(place=pilot.place)
            case messages.SetPlace():
                pilot.stop()
                at = (message.x, message.y, message.z)
                angles = message.yaw_deg, message.pitch_deg, message.roll_deg
                pilot.place = Place(at, *angles).rounded()
                self._change(place=pilot.place)
            case messages.ToStart():
                pilot.stop()
                start = self._start
                pilot.place = start.place
                self._change(place=start.place, gaze=start.gaze, time_s=start.time_s)
            case messages.Walls():
                pilot.stop()
                pilot.has_walls, pilot.blocked_by = message.on, ""
                self._change()
            case messages.SetValue():
                edit = with_model if message.path in MODEL_PATHS else CameraDocument.with_value
                self._edit_camera(edit(state.document, message.path, message.value), message.path)
            case messages.Preset():
                self._edit_camera(with_preset(state.document, message.kind, message.name), "")
            case messages.Reset():
                self._edit_camera(self._first, "")
            case messages.Undo():
                self._take_back(self._undo, self._redo)
            case messages.Redo():
                self._take_back(self._redo, self._undo)
            case messages.SetViews():
                if unknown := set(message.names) - set(messages.VIEWS):
                    raise OutputError(f"views: unknown view {min(unknown)!r}")
                self._change(views=tuple(dict.fromkeys(message.names)))
            case messages.Gaze():
                self._change(gaze=message)
            case messages.Replay():
                if self._last_step is None:
                    raise OutputError("replay: expected a run, see --run")
                self._change(step=min(message.step, self._last_step))
            case messages.Clock():
                self._is_running = message.running
                self._advanced_s = time.monotonic()
                if message.time_s is not None:
                    self._change(time_s=message.time_s)
            case _:
                raise SceneError(f"{type(message).__name__}: not a message of the driver")

    def _edit_camera(self, document: CameraDocument, key: str) -> None:
        old = self._state.document
        if document == old:
            return
        now_s = time.monotonic()
        is_same = key and key == self._edit[0] and now_s - self._edit[1] < SAME_EDIT_S
        self._edit = (key, now_s)
        if not is_same:
            self._undo.append(self._good)
        self._redo.clear()
        self._change(document=document)

    def _take_back(
        self,
        taken: deque[CameraDocument] | list[CameraDocument],
        kept: deque[CameraDocument] | list[CameraDocument],
    ) -> None:
        if not taken:
            return
        kept.append(self._state.document)
        self._edit = ("", 0.0)
        self._change(document=taken.pop())
