"""Bags of ROS 1 and ROS 2, read without ROS; needs the extra `ros`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from omnisim.core.errors import OmnisimError
from omnisim.core.extras import require_extra

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader


@contextmanager
def open_bag(bag: Path, error: type[OmnisimError]) -> Iterator[AnyReader]:
    """Open a bag, by its folder or its only file, for a `with` block.

    Raises:
        OmnisimError: of type `error`: the extra is missing, or the bag is missing or damaged.
    """
    require_extra("ros", str(bag), error)
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.rosbag1 import ReaderError as OldReaderError
    from rosbags.rosbag2 import ReaderError
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, get_typestore

    if not bag.exists():
        raise error(f"{bag}: no such file or folder")
    is_part = bag.suffix.lower() in (".mcap", ".db3") and (bag.parent / "metadata.yaml").is_file()
    whole = bag.parent if is_part else bag
    try:
        store = get_typestore(Stores.ROS2_HUMBLE)
        with AnyReader([whole], default_typestore=store) as reader:
            yield reader
    except (AnyReaderError, OldReaderError, ReaderError, SerdeError, OSError, ValueError) as reason:
        raise error(f"{bag}: cannot be read as a bag: {reason}") from None
