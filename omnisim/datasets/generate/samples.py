"""Manifest of a data set, and its samples by number: as a `torch` data set or NumPy arrays."""

from __future__ import annotations

import bisect
import itertools
import json
import re
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omnisim.core.arrays import Bytes
from omnisim.core.errors import OutputError, PlanError
from omnisim.core.files.image_files import read_image
from omnisim.datasets.generate.shard import ShardSummary, Statistics, file_sha256, find_shard
from omnisim.ground_truth.channel_files import StoredChannels

MANIFEST = "manifest.json"
IMAGES = (".png", ".jpg")
_PREFIX = "omnisim-"  # of temporary folders


@dataclass(frozen=True, eq=False)
class SampleManifest:
    """Manifest of a finished data set."""

    title: str  # title of the data set
    license: str | None  # license of the data set; None: not stated
    plan: str  # fingerprint of the plan
    channels: tuple[str, ...]  # names of the channels of ground truth
    shards: tuple[ShardSummary, ...]  # summaries of the shards, by number

    @property
    def size_bytes(self) -> int:
        """Size of all shards."""
        return sum(shard.size_bytes for shard in self.shards)

    @property
    def statistics(self) -> Statistics:
        """Statistics of all shards."""
        total = Statistics()
        for shard in self.shards:
            total.update(shard.statistics)
        return total

    def to_json(self) -> dict[str, Any]:
        """Content of the manifest, of JSON types."""
        return {
            "title": self.title,
            "license": self.license,
            "plan": self.plan,
            "channels": list(self.channels),
            "bytes": self.size_bytes,
            "statistics": self.statistics.to_json(),
            "shards": [
                {
                    "file": shard.name,
                    "sha256": shard.sha256,
                    "bytes": shard.size_bytes,
                    "samples": shard.statistics.samples,
                }
                for shard in self.shards
            ],
        }


def read_manifest(folder: Path) -> SampleManifest:
    """Read the manifest of a data set and the summaries of its shards.

    Raises:
        PlanError: the manifest or a shard is missing or damaged.
    """
    path = folder / MANIFEST
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        title, license = str(content["title"]), content["license"]
        plan, channels = str(content["plan"]), tuple(map(str, content["channels"]))
        count = len(content["shards"])
        if not count:
            raise ValueError("no shard")
    except OSError as reason:
        raise PlanError(
            f"{path}: cannot be read: {reason.strerror}: expected a data set that `omnisim "
            "generate` has finished"
        ) from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise PlanError(f"{path}: is damaged: run `omnisim generate` to write it again") from None
    summaries = [find_shard(folder, number) for number in range(count)]
    for number, shard in enumerate(summaries):
        if shard is None or shard.plan != plan:
            raise PlanError(
                f"{folder}: shard {number} is missing or damaged: `omnisim generate` makes it again"
            )
    shards = tuple(shard for shard in summaries if shard is not None)
    return SampleManifest(title, None if license is None else str(license), plan, channels, shards)


def check_hashes(folder: Path, manifest: SampleManifest) -> Iterator[ShardSummary]:
    """Compare the hash of each shard with the manifest's; yield the shard if they agree.

    Raises:
        PlanError: the message names the first shard that differs, or that cannot be read.
    """
    for shard in manifest.shards:
        path = folder / shard.name
        try:
            sha256 = file_sha256(path)
        except OSError as reason:
            raise PlanError(f"{path}: cannot be read: {reason.strerror}") from None
        if sha256 != shard.sha256:
            raise PlanError(
                f"{path}: is damaged: expected SHA-256 {shard.sha256[:16]}…, got {sha256[:16]}…: "
                "remove it, and `omnisim generate` makes it again"
            )
        yield shard


class Shards:
    """Samples of a data set, in order: `len(shards)`, `shards[0]["rgb"]`.

    A map-style data set for `torch.utils.data.DataLoader`, without torch; it can be pickled. The
    manifest is read from the folder unless it is given.

    Raises:
        PlanError: the data set is missing, unfinished or damaged.
    """

    def __init__(self, folder: str | Path, manifest: SampleManifest | None = None):
        self.folder = Path(folder)
        self.manifest = read_manifest(self.folder) if manifest is None else manifest
        counts = (shard.statistics.samples for shard in self.manifest.shards)
        self._ends = list(itertools.accumulate(counts))
        self._members: dict[int, dict[str, list[tarfile.TarInfo]]] = {}

    def __len__(self) -> int:
        return self._ends[-1]

    def __getitem__(self, row: int) -> dict[str, Any]:
        """Sample: `rgb` (height, width, 3) uint8, channels by name, and `metadata`.

        For a rig, each camera has a dictionary of image and channels: `sample["left"]["rgb"]`.

        Raises:
            IndexError: beyond the last sample.
            PlanError: a faulty shard.
        """
        with self.naming_shard(row), self.files(row) as folder:
            content = _metadata(folder)
            parts = {}
            for path in self.images(folder):
                camera = path.stem.partition(".")[2] or "camera"
                pixels, metadata = read_image(path)
                stored = StoredChannels(path, metadata or {})
                parts[camera] = {"rgb": pixels[..., :3], **stored.read(self.manifest.channels)}
        if set(parts) == {"camera"}:
            return {**parts["camera"], "metadata": content}
        return {**parts, "metadata": content}

    def image(self, row: int) -> Bytes:
        """Image (height, width, 3) of a sample's first camera."""
        with self.naming_shard(row), self.files(row) as folder:
            return read_image(self.images(folder)[0])[0]

    def metadata(self, row: int) -> dict[str, Any]:
        """Camera, pose and draw of a sample.

        Raises:
            IndexError: beyond the last sample.
            PlanError: a faulty shard.
        """
        with self.naming_shard(row), tempfile.TemporaryDirectory(prefix=_PREFIX) as name:
            return _metadata(self.extract(row, Path(name), only=".json"))

    @contextmanager
    def naming_shard(self, row: int) -> Iterator[None]:
        """Name the shard of a sample in errors about its files.

        Raises:
            PlanError: unexpected content of a file, within the block.
        """
        try:
            yield
        except OutputError as reason:  # about a file in a temporary folder
            raise PlanError(f"{self._shard_of(row)[1]}: {without_folder(str(reason))}") from None
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            raise self._damaged(row, "a sample's files as they were written, got others") from None

    def _damaged(self, row: int, expected: str) -> PlanError:
        return PlanError(
            f"{self._shard_of(row)[1]}: is damaged: expected {expected}: `omnisim dataset check` "
            "finds what to remove and make again"
        )

    def _shard_of(self, row: int) -> tuple[int, Path]:
        """Number and path of the shard of a sample."""
        if not -len(self) <= row < len(self):
            raise IndexError(f"sample {row}: expected one of {len(self)}")
        shard = bisect.bisect_right(self._ends, row % len(self))
        return shard, self.folder / self.manifest.shards[shard].name

    @contextmanager
    def files(self, row: int) -> Iterator[Path]:
        """Temporary folder with a sample's files, for a `with` block.

        Raises:
            IndexError: beyond the last sample.
            PlanError: a faulty shard.
        """
        with tempfile.TemporaryDirectory(prefix=_PREFIX) as name:
            yield self.extract(row, Path(name))

    def images(self, folder: Path) -> list[Path]:
        """Paths of the cameras' images in a folder of a sample's files, without its channels."""
        metadata = _metadata(folder)
        key = f"{metadata['number']:09d}"
        cameras = list(metadata["images"])
        stems = [key if name == "camera" else f"{key}.{name}" for name in cameras]
        paths = [folder / f"{stem}{suffix}" for stem in stems for suffix in IMAGES]
        return [path for path in paths if path.is_file()]

    def extract(self, row: int, folder: Path, only: str = "") -> Path:
        """Write a sample's files into a folder, or the `only` one of a suffix; return the folder.

        Raises:
            IndexError: beyond the last sample.
            PlanError: a faulty shard.
        """
        shard, path = self._shard_of(row)
        row %= len(self)
        try:
            with tarfile.open(path) as tar:
                if shard not in self._members:
                    found = self._members[shard] = {}  # by number, the start of their names
                    for member in filter(tarfile.TarInfo.isfile, tar.getmembers()):
                        found.setdefault(member.name.partition(".")[0], []).append(member)
                keys = list(self._members[shard])
                count = self.manifest.shards[shard].statistics.samples
                if len(keys) != count:
                    raise self._damaged(row, f"{count} samples, got {len(keys)}")
                key = keys[row - self._ends[shard]]  # negative: from the shard's last sample
                for member in self._members[shard][key]:
                    if only and member.name != key + only:
                        continue
                    content = tar.extractfile(member)
                    assert content is not None
                    (folder / Path(member.name).name).write_bytes(content.read())
        except (OSError, tarfile.TarError) as reason:
            fault = str(reason).partition("\n")[0]
            raise PlanError(f"{path}: cannot be read: {fault}") from None
        return folder


def without_folder(message: str) -> str:
    """Error message that names a sample's file by its place in the shard."""
    return re.sub(rf"{re.escape(tempfile.gettempdir())}/{_PREFIX}\w+/(sample/)?", "", message)


def _metadata(folder: Path) -> dict[str, Any]:
    """Camera, pose and draw of the sample whose files are in a folder."""
    (path,) = folder.glob("?????????.json")
    return json.loads(path.read_text(encoding="utf-8"))
