"""Live page from start to end: its source, the render thread, and the server of its messages."""

from __future__ import annotations

import asyncio
import functools
import itertools
import signal
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from omnisim.apps.live import live_messages as messages
from omnisim.apps.live.camera_document import CameraDocument, found_cameras, preset_lists
from omnisim.apps.live.engine import AnySource, Engine
from omnisim.apps.live.live_source import LiveSettings, LiveSource, RunSource, start_place
from omnisim.apps.live.session import Session
from omnisim.apps.live.viewpoint_motion import FreeFlight, Pilot, Place, ViewpointDrive
from omnisim.core.errors import OmnisimError, OutputError
from omnisim.core.version import __version__
from omnisim.ground_truth import CHANNELS
from omnisim.robots.vehicle import BodyBoxes
from omnisim.runs.ground import Ground
from omnisim.serve.access import LOCAL, Access, new_token
from omnisim.serve.page_files import PageFiles

PAGE = Path(__file__).with_name("page")
PAGE_FILES = PageFiles(PAGE)
STREAM = "/stream"
IDLE_S = 3.0  # idle time of the driving page before another page may take control
MAX_PAGES = 64
KEPT = ("camera", "map", "frame")  # kinds of messages that a new page receives at once
STOP_S = 1.0  # maximum time to finish the current image


class _Page:
    """Connection to an open page."""

    _numbers = itertools.count(1)

    def __init__(self, connection: ServerConnection):
        self.connection, self.number = connection, next(self._numbers)
        self.is_ready, self.has_seen = False, 0
        self.sending = asyncio.Lock()


class LiveServer:
    """Serves the page to browsers, and passes their input to a session.

    Args:
        session: session that receives the input.
        about: content of the first message to each page.
        host: address to listen on.
        port: port to listen on; 0: any free port.
        token: token that a page must present; None: no token is required.
    """

    def __init__(
        self,
        session: Session,
        about: dict[str, Any],
        host: str = "localhost",
        port: int = 0,
        token: str | None = None,
    ):
        self._session, self._about = session, about
        self._host, self._port, self._token = host, port, token
        self._pages: list[_Page] = []
        self._driver: _Page | None = None
        self._driven_s = 0.0
        self._kept: dict[str, bytes] = {}
        self._frames = 0
        self._change = -1  # number of the state in the last frame
        self._loop: asyncio.AbstractEventLoop | None = None
        self._server: Server | None = None

    @property
    def port(self) -> int:
        """Port of the server."""
        return self._port

    @property
    def url(self) -> str:
        """URL for a browser, including the token."""
        host = "localhost" if self._host in ("", "0.0.0.0", "::") else self._host
        address = f"[{host}]" if ":" in host else host
        token = "" if self._token is None else f"?token={self._token}"
        return f"http://{address}:{self._port}/{token}"

    async def open(self) -> None:
        """Start listening.

        Raises:
            OutputError: the port is taken, or the address does not belong to this machine.
        """
        self._loop = asyncio.get_running_loop()
        try:
            self._server = await serve(
                self._serve_page, self._host, self._port,
                process_request=self._serve_file, max_size=messages.MAX_MESSAGE_BYTES,
                compression=None, ping_interval=20.0, ping_timeout=60.0, close_timeout=0.2,
                server_header=None,
            )  # fmt: skip
        except (OSError, OverflowError) as reason:
            cause = getattr(reason, "strerror", None) or str(reason)
            text = f"--port {self._port}: cannot listen on {self._host}: {cause}"
            raise OutputError(text) from None
        first: socket.socket = next(iter(self._server.sockets))
        self._port = int(first.getsockname()[1])

    async def close(self) -> None:
        """Close all pages and stop listening."""
        if self._server is not None:
            self._server.close()
            await asyncio.wait([asyncio.ensure_future(self._server.wait_closed())], timeout=0.5)

    def publish(self, kind: str, data: bytes, change: int = 0) -> None:
        """Send a message to all pages, from any thread; `change` is a frame's state number."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._spread, kind, data, change)

    def _spread(self, kind: str, data: bytes, change: int) -> None:
        if kind in KEPT:
            self._kept[kind] = data
        if kind != "frame":
            for page in self._pages:
                self._send(page, data)
            return
        self._frames += 1
        self._change = change
        for page in self._pages:
            if page.is_ready:
                self._send_frame(page)

    def _send_frame(self, page: _Page) -> None:
        page.is_ready, page.has_seen = False, self._frames
        self._send(page, self._kept["frame"])

    def _send(self, page: _Page, data: bytes) -> None:
        task = asyncio.ensure_future(self._send_in_order(page, data))
        task.add_done_callback(lambda done: done.exception())

    async def _send_in_order(self, page: _Page, data: bytes) -> None:
        async with page.sending:
            try:
                await page.connection.send(data)
            except ConnectionClosed:
                return

    def _serve_file(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for a file of the page; None accepts a stream."""
        access = Access(self._token, None, "omnisim live")
        if request.path.partition("?")[0] != STREAM:
            answer = access.check_host(connection, request) or PAGE_FILES.answer(request)
            return answer or access.refuse(connection, 404, "no such file")
        if (refusal := access.check(connection, request)) is not None:
            return refusal
        if len(self._pages) >= MAX_PAGES:
            return access.refuse(connection, 503, "too many pages are open")
        return None

    async def _serve_page(self, connection: ServerConnection) -> None:
        page = _Page(connection)
        self._pages.append(page)
        if self._driver is None:
            self._driver = page
        self._send(page, messages.pack("hello", {**self._about, "page": page.number}))
        for kind in ("camera", "map"):
            if kind in self._kept:
                self._send(page, self._kept[kind])
        self._tell_roles()
        try:
            async for text in connection:
                self._take(page, text)
        except ConnectionClosed:
            pass
        finally:
            self._pages.remove(page)
            if self._driver is page:
                self._session.rest()
                self._driver = self._pages[0] if self._pages else None
            self._tell_roles()

    def _take(self, page: _Page, text: str | bytes) -> None:
        """Handle a message from a page, with an error message as the answer to an invalid one."""
        try:
            message = messages.parse_message(text)
            reply = functools.partial(self._reply, page)
            if isinstance(message, messages.Ask):
                if page.has_seen < self._frames and self._change == self._session.state.change:
                    self._send_frame(page)
                else:
                    page.is_ready = True
                    self._session.ask()
            elif isinstance(message, messages.RequestControl):
                if self._driver is page:
                    return
                if self._driver is not None and time.monotonic() - self._driven_s < IDLE_S:
                    raise OutputError("another browser is in control right now")
                self._session.rest()
                self._driver = page
                self._tell_roles()
            elif isinstance(message, messages.SearchCatalog):
                words, loop = message.words, asyncio.get_running_loop()
                loop.run_in_executor(  # a search takes a while
                    None, lambda: reply(messages.pack("found", found_cameras(words)))
                )
            elif isinstance(message, messages.Save | messages.RequestStatistics):
                self._session.look_up(message, reply)
            elif isinstance(message, messages.ProbePoint):
                if page is not self._driver:
                    message = message.model_copy(update={"follow": False})
                self._session.look_up(message, reply)
            elif page is not self._driver:
                raise OutputError("another browser is in control: press “Take control”")
            else:
                self._driven_s = time.monotonic()
                self._session.apply(message)
        except OmnisimError as error:
            self._send(page, messages.pack("error", {"text": str(error)}))

    def _reply(self, page: _Page, data: bytes) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._send, page, data)

    def _tell_roles(self) -> None:
        for page in self._pages:
            content = {"drives": page is self._driver, "pages": len(self._pages)}
            self._send(page, messages.pack("roles", content))


def page_bytes() -> int:
    """Total size of the page's files, uncompressed."""
    return sum(map(len, PAGE_FILES.contents.values()))


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
                pilot = ViewpointDrive(place, vehicle.kinematics, ground)
            open_source = partial(LiveSource, source)
        else:
            pilot, document = FreeFlight(Place((0.0, 0.0, 0.0))), CameraDocument()
            open_source = source
            last_step = 10**9  # the source itself limits the step
        self.session = Session(document, pilot, last_step, time_s)
        token = None if host in LOCAL else new_token()
        self.server = LiveServer(self.session, about, host, port, token)
        self.engine = Engine(self.session, open_source, self.server.publish)
        self._about = about

    def open(self) -> None:
        """Start the render thread, and wait until the scene is on the GPU.

        Raises:
            OmnisimError: no OpenGL, or the scene exceeds its limits.
        """
        self.engine.start()
        source = self.engine.source
        self._about |= source.about() | {
            "presets": preset_lists(),
            "channels": {name: CHANNELS[name].about for name in source.channel_names},
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
