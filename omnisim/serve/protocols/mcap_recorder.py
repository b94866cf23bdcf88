"""Recordings of served robots: MCAP files with Foxglove's schemas."""

from __future__ import annotations

import threading
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from omnisim.core.errors import NoticeWarning, OutputError, ServeError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import check_suffix, check_target, make_folder
from omnisim.serve.protocols.foxglove_messages import Channels
from omnisim.serve.publisher import Controls, Publisher, Topic

require_extra("serve", "a recording of served robots", ServeError)
import foxglove  # noqa: E402  # after the message of what is missing
from foxglove.mcap import MCAPCompression, MCAPWriteOptions, MCAPWriter  # noqa: E402

FLUSH_S = 1.0  # time whose messages are lost if the process is killed


class McapRecorder(Publisher):
    """Recording of all topics in an MCAP file; log times are stamps.

    Until it is closed, NAME.mcap is called NAME.partial.mcap; `mcap recover` repairs what a killed
    process leaves. A reset of the simulation begins another file, NAME-2.mcap and so on.

    Args:
        path: file to write.
    """

    protocol = "mcap"

    def __init__(self, path: Path):
        self._given, self._lock, self._count = path, threading.Lock(), 0
        self._clock_ns, self._flushed_s = 0, 0.0
        self._writer: MCAPWriter | None = None

    def open(self, topics: Sequence[Topic], controls: Controls) -> str:
        """Begin to record; returns the file's name.

        Raises:
            OutputError: the file exists already, or cannot be written.
        """
        check_suffix(self._given, ".mcap")
        self._channels = Channels(topics)
        self._begin()
        return f"Recording: {self._given}"

    def wants(self, topic: str) -> bool:
        """True for all topics."""
        return self._writer is not None

    def publish(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Write a message, stamped in ns; a notice tells of a full disk."""
        with self._lock:
            if self._writer is None:
                return
            try:
                if self._channels.is_clock(topic):
                    if stamp_ns < self._clock_ns:
                        self._finish()
                        self._begin()
                        self._channels.repeat(at_ns=stamp_ns)
                    self._clock_ns = stamp_ns
                    return
                self._channels.log(topic, stamp_ns, message)
                if time.monotonic() > self._flushed_s + FLUSH_S:
                    self._flushed_s = time.monotonic()
                    self._writer.flush()
            except (OutputError, RuntimeError) as reason:
                self._writer = None
                text = f"{self._partial}: the recording ends here: {reason}"
                warnings.warn(text, NoticeWarning, stacklevel=2)

    def close(self) -> None:
        """Finish the file; a second call does nothing.

        Raises:
            OutputError: the file cannot be written.
        """
        with self._lock:
            if self._writer is not None:
                self._finish()

    def _begin(self) -> None:
        """Begin a file."""
        self._count += 1
        end = f"-{self._count}" if self._count > 1 else ""
        self._path = self._given.with_stem(self._given.stem + end)
        self._partial = self._path.with_suffix(".partial.mcap")
        for path in (self._path, self._partial):
            if path.exists():
                raise OutputError(f"{path}: already exists; choose a new name for the recording")
        make_folder(self._path.parent)
        check_target(self._path)
        self._writer = foxglove.open_mcap(
            self._partial,
            context=self._channels.context,
            writer_options=MCAPWriteOptions(compression=MCAPCompression.Lz4),
        )

    def _finish(self) -> None:
        """Finish the file, and give it its name."""
        writer, self._writer = self._writer, None
        try:
            if writer is not None:
                writer.close()
            self._partial.rename(self._path)
        except (RuntimeError, OSError) as reason:
            raise OutputError(f"{self._partial}: cannot be written: {reason}") from None
