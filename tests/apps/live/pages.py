"""Pages that are served to tests, and clients of their stream."""

import json
import time
from contextlib import contextmanager

from websockets.sync.client import connect

from omnisim.apps.live.camera_document import CameraDocument
from omnisim.apps.live.live import BackgroundPage, LivePage
from omnisim.apps.live.live_source import LiveSettings
from omnisim.scene import load_scene

SIZE_PX = 96
REST_WITHIN_S = 120.0


@contextmanager
def served(settings=None, **options):
    """A page that is served in the background, by default of the smallest scene."""
    page = LivePage(settings or live_settings(), **options)
    background = BackgroundPage(page)
    try:
        yield page
    finally:
        background.close()


def live_settings(scene="rings", **changes):
    document = CameraDocument().with_value("size_px", SIZE_PX)
    words = ("--size", str(SIZE_PX))
    found = {"document": document, "scene_arguments": (scene,), "camera_options": words} | changes
    return LiveSettings(load_scene(scene), **found)


class Client:
    """A page without a browser."""

    def __init__(self, page, token="", **options):
        port = page.server.port
        self._connection = connect(
            f"ws://localhost:{port}/stream{token}", max_size=None, proxy=None, **options
        )
        self.socket = self._connection.__enter__()

    def send(self, message_type, /, **content):
        self.socket.send(json.dumps({"type": message_type, **content}))

    def receive(self, kind, timeout=120.0):
        """The next message of a kind; others before it are skipped."""
        while True:
            message = unpack(self.socket.recv(timeout))
            if message["type"] == kind:
                return message

    def frame(self):
        self.send("ask")
        return self.receive("frame")

    def fine_frame(self):
        """The image at rest, after all that was sent."""
        end_s = time.monotonic() + REST_WITHIN_S
        while time.monotonic() < end_s:
            frame = self.frame()
            if frame["is_fine"]:
                return frame
        raise AssertionError(f"never at rest: {frame['place']}, {frame['times_ms']}")

    def __enter__(self):
        return self

    def __exit__(self, *reason):
        self.close()

    def close(self):
        self._connection.__exit__(None, None, None)


def unpack(data):
    length = int.from_bytes(data[:4], "little")
    message, at = json.loads(data[4 : 4 + length]), 4 + length
    message["data"] = {}
    for part in message["parts"]:
        message["data"][part["name"]] = data[at : at + part["size"]]
        at += part["size"]
    assert at == len(data)
    return message
