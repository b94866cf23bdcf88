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
from omnisim.serve.foxglove_messages import Channels
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
        self._given = self._path = path
        self._writer: MCAPWriter | None = None
        self._lock = threading.Lock()

    def open(self, topics: Sequence[Topic], controls: Controls) -> str:
        """Begin to record; returns the file's name.

        Raises:
            OutputError: the file exists already, or cannot be written.
        """
        check_suffix(self._given, ".mcap")
        self._channels = Channels(topics)
        self._begin(self._given)
        return f"Recording: {self._given}"

    def wants(self, topic: str) -> bool:
        """True for all topics."""
        return self._writer is not None

    def publish(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Write a message, stamped in ns."""
        with self._lock:
            try:
                if self._channels.is_clock(topic):
                    if stamp_ns < self._clock_ns and self._writer is not None:
                        self._finish()
                        self._begin(self._next_path())
                    self._clock_ns = stamp_ns
                elif self._writer is not None:
                    self._channels.log(topic, stamp_ns, message)
                    if time.monotonic() > self._flushed_s + FLUSH_S:
                        self._flush(self._writer)
            except OutputError as reason:
                self._writer = None
                warnings.warn(f"{reason}; the recording ends here", NoticeWarning, stacklevel=2)

    def close(self) -> None:
        """Finish the file; a second call does nothing.

        Raises:
            OutputError: the file cannot be written.
        """
        with self._lock:
            if self._writer is not None:
                self._finish()

    @property
    def _partial(self) -> Path:
        return self._path.with_suffix(".partial.mcap")

    def _begin(self, path: Path) -> None:
        """Begin a file, with the last messages of latched topics."""
        self._path, self._clock_ns, self._flushed_s = path, 0, time.monotonic()
        for name in (path, self._partial):
            if name.exists():
                raise OutputError(f"{name}: already exists; choose a new name for the recording")
        make_folder(path.parent)
        check_target(path)
        options = MCAPWriteOptions(compression=MCAPCompression.Lz4)
        context = self._channels.context
        self._writer = foxglove.open_mcap(self._partial, context=context, writer_options=options)
        self._channels.repeat()

    def _next_path(self) -> Path:
        stem, number = self._given.stem, 2
        while (path := self._given.with_stem(f"{stem}-{number}")).exists():
            number += 1
        return path

    def _flush(self, writer: MCAPWriter) -> None:
        self._flushed_s = time.monotonic()
        try:
            writer.flush()
        except RuntimeError as reason:  # the disk is full
            raise self._failure(reason) from None

    def _finish(self) -> None:
        writer, self._writer = self._writer, None
        try:
            if writer is not None:
                writer.close()
            self._partial.rename(self._path)
        except (RuntimeError, OSError) as reason:
            raise self._failure(reason) from None

    def _failure(self, reason: Exception) -> OutputError:
        return OutputError(f"{self._partial}: cannot be written: {reason}")
