"""Live page from start to end: its source, the render thread and the server."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from omnisim.apps.live import live_messages as messages
from omnisim.apps.live.camera_document import CameraDocument, preset_lists
from omnisim.apps.live.engine import AnySource, Engine
from omnisim.apps.live.ground import Ground
from omnisim.apps.live.live_source import LiveSettings, LiveSource, start_place
from omnisim.apps.live.run_source import RunSource
from omnisim.apps.live.server import LiveServer, is_local, new_token
from omnisim.apps.live.session import Session
from omnisim.apps.live.viewpoint_motion import FreeFlight, Pilot, Place, WheelDrive
from omnisim.core.errors import OutputError
from omnisim.core.version import __version__
from omnisim.ground_truth import CHANNELS
from omnisim.robots.body_boxes import BodyBoxes

STOP_S = 1.0  # maximum time to finish the current image


class LivePage:
    """Live page being served: session, engine and server.

    Args:
        source: settings of a live camera, or a function that opens a recorded run.
        host, port: address to listen on; port 0: any free port.
        at: start pose of the camera; None: the scene's start.
        time_s: world time at the start.

    Raises:
        OmnisimError: no OpenGL, a scene beyond its limits, or a robot without kinematic limits.
    """

    def __init__(
        self,
        source: LiveSettings | Callable[[], RunSource],
        host: str = "localhost",
        port: int = 0,
        at: Place | None = None,
        time_s: float = 0.0,
    ):
        about: dict[str, Any] = {"version": __version__}
        last_step: int | None = None
        open_source: Callable[[], AnySource]
        pilot: Pilot
        if isinstance(source, LiveSettings):
            document, vehicle = source.document, source.vehicle
            place, ground = start_place(source, at), Ground(source.scene)
            if vehicle is None:
                pilot = FreeFlight(place, ground)
            elif vehicle.kinematics is None:
                expected = "expected [kinematics], to be driven by hand"
                raise OutputError(f"robot {vehicle.name!r}: {expected}")
            else:
                ground = Ground(source.scene, BodyBoxes.of(vehicle))
                pilot = WheelDrive(place, vehicle.kinematics, ground)
            open_source = partial(LiveSource, source)
        else:
            pilot, document = FreeFlight(Place((0.0, 0.0, 0.0))), CameraDocument()
            open_source = source
            last_step = 10**9  # the source itself limits the step
        self.session = Session(document, pilot, last_step, time_s)
        self.engine = Engine(self.session, open_source, self._publish)
        token = None if is_local(host) else new_token()
        self.server = LiveServer(self.session, about, host, port, token)
        self._about = about

    def _publish(self, kind: str, data: bytes, change: int) -> None:
        self.server.publish(kind, data, change)

    def open(self) -> None:
        """Start the render thread, and wait until the scene is on the GPU.

        Raises:
            OmnisimError: no OpenGL, or the scene exceeds its limits.
        """
        self.engine.start()
        self._about |= self.engine.about()
        self._about |= {
            "presets": preset_lists(),
            "channels": {name: CHANNELS[name].about for name in self.engine.channel_names},
            "views": [view for view in messages.VIEWS if view not in CHANNELS],
        }

    async def serve(self, until: asyncio.Event, is_open: Callable[[], None]) -> None:
        """Serve until an event is set.

        Args:
            until: event that ends the serving.
            is_open: function that is called when the page is available.

        Raises:
            OmnisimError: the port is taken, or an error of `open`.
        """
        try:
            await self.server.open()
            await asyncio.get_running_loop().run_in_executor(None, self.open)
            is_open()
            await until.wait()
        finally:
            await self.server.close()

    def stop(self) -> bool:
        """Stop the render thread; False if it does not stop in time."""
        return self.engine.stop(STOP_S)


def run(page: LivePage, is_open: Callable[[], None]) -> bool:
    """Serve a page until Ctrl-C or SIGTERM; False if the render thread did not stop in time.

    Raises:
        OmnisimError: see `LivePage.serve`.
    """

    async def serve() -> None:
        until, loop = asyncio.Event(), asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, until.set)
        await page.serve(until, is_open)

    try:
        asyncio.run(serve())
    finally:
        is_done = page.stop()
    return is_done


class BackgroundPage:
    """Page served by background threads, as in a notebook, until it is closed.

    Raises:
        OmnisimError: see `LivePage.serve`.
    """

    def __init__(self, page: LivePage):
        self._page = page
        self._loop = asyncio.new_event_loop()
        self._until = asyncio.Event()
        self._is_open = threading.Event()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="omnisim-live", daemon=True)
        self._thread.start()
        self._is_open.wait()
        if self._error is not None:
            raise self._error

    @property
    def url(self) -> str:
        """URL for a browser."""
        return self._page.server.url

    def close(self) -> None:
        """Stop serving and free the GPU memory; a second call does nothing."""
        with suppress(RuntimeError):  # the loop is already closed
            self._loop.call_soon_threadsafe(self._until.set)
        self._thread.join()

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._page.serve(self._until, self._is_open.set))
        except BaseException as error:  # the constructor raises it
            self._error = error
        finally:
            self._page.stop()
            self._is_open.set()
            self._loop.close()
