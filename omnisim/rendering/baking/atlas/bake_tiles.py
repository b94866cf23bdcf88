"""Tiles of unfinished bakes, as files: an interrupted bake resumes from them."""

from __future__ import annotations

import io
import json
import os
import shutil
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import atomic_write, write_text
from omnisim.core.files.number_files import read_arrays

Arrays = dict[str, NDArray[Any]]
Progress = Callable[[str, int], Callable[[Iterable[int]], Iterable[int]]]


def no_progress(description: str, total: int) -> Callable[[Iterable[int]], Iterable[int]]:
    """Progress without display."""
    return lambda steps: steps


def write_arrays(file: IO[bytes], arrays: Arrays, is_compressed: bool = False) -> None:
    """Write arrays as NumPy's .npz; equal arrays make equal bytes."""
    kind = zipfile.ZIP_DEFLATED if is_compressed else zipfile.ZIP_STORED
    with zipfile.ZipFile(file, "w", kind) as archive:
        for name, values in arrays.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.ascontiguousarray(values), allow_pickle=False)
            info = zipfile.ZipInfo(f"{name}.npy")
            info.compress_type = kind
            archive.writestr(info, buffer.getvalue())


class TileFolder:
    """Folder of the finished tiles, beside the bake.

    Args:
        output: folder of the bake.
        plan: everything that determines the tiles; tiles of another plan are removed.

    Raises:
        OutputError: the folder cannot be written.
    """

    def __init__(self, output: Path, plan: Mapping[str, object]):
        self.path = output.resolve().with_name(f".{output.name}.unfinished")
        text = json.dumps(plan, sort_keys=True) + "\n"
        plan_path = self.path / "plan.json"
        try:
            if not plan_path.is_file() or plan_path.read_text(encoding="utf-8") != text:
                self.remove()
                self.path.mkdir(parents=True)
                write_text(plan_path, text)
        except OSError as reason:
            raise OutputError(f"{self.path}: cannot be written: {reason.strerror}") from None

    def remove(self) -> None:
        """Remove all tiles."""
        shutil.rmtree(self.path, ignore_errors=True)

    def load(self, name: str) -> Arrays | None:
        """Arrays of a tile; None: not computed yet."""
        path = self.path / f"{name}.npz"
        if not path.is_file():
            return None
        return read_arrays(path, OutputError, "tile of a bake", f"remove {self.path}")

    def store(self, name: str, arrays: Arrays) -> None:
        """Store the arrays of a tile.

        Raises:
            OutputError: the file cannot be written.
        """
        with atomic_write(self.path / f"{name}.npz") as partial, partial.open("wb") as file:
            write_arrays(file, arrays)


def in_tiles(
    folder: TileFolder,
    stage: str,
    compute: Callable[[int], Arrays],
    count: int,
    jobs: int | None,
    progress: Progress,
) -> Iterator[Arrays]:
    """Arrays of tiles, in order: loaded if finished, otherwise computed in threads."""

    def one(number: int) -> Arrays:
        name = f"{stage}-{number:05d}"
        arrays = folder.load(name)
        if arrays is None:
            arrays = compute(number)
            folder.store(name, arrays)
        return arrays

    pool = ThreadPoolExecutor(jobs or os.cpu_count() or 1)
    try:
        results = pool.map(one, range(count))
        for _ in progress(stage, count)(range(count)):
            yield next(results)
    finally:
        pool.shutdown(cancel_futures=True)
