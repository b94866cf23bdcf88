"""Shards: tar files of samples in WebDataset's layout, functions of the plan and their number.

The names of a sample's files begin with its number: `000000012.png`, `000000012.range.png` and so
on, as from `Frame.save`, and `000000012.json` with its pose, camera and draw. A rig's images have
number and camera name, `000000012.left.png`. `shard-000003.json` has a shard's hash and statistics.
"""

from __future__ import annotations

import hashlib
import json
import tarfile
import tempfile
from collections import Counter, deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.core.errors import PlanError
from omnisim.core.files.atomic_file import atomic_write, write_text
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.datasets.generate.sample_renderer import RenderedSample, SampleRenderer
from omnisim.ground_truth.boxes import BoxLimits
from omnisim.ground_truth.channel_files import limit_boxes
from omnisim.ground_truth.frame import Frame

MAX_WAITING = 4  # samples rendered but not yet written
KEY_DIGITS = 9
# what a summary that was not written by `ShardSummary.to_json` may raise
_DAMAGE = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)


@dataclass(frozen=True, eq=False)
class ShardSummary:
    """Finished shard."""

    number: int  # number of the shard
    plan: str  # fingerprint of its plan
    sha256: str  # hash of its tar
    size_bytes: int  # size of its tar
    statistics: Statistics  # statistics of its samples

    @property
    def name(self) -> str:
        """Name of the tar."""
        return f"{shard_stem(self.number)}.tar"

    def to_json(self) -> dict[str, Any]:
        """Content of the summary, of JSON types."""
        return {
            "shard": self.number,
            "plan": self.plan,
            "sha256": self.sha256,
            "bytes": self.size_bytes,
            "statistics": self.statistics.to_json(),
        }


def shard_stem(number: int) -> str:
    """Name of a shard without its suffix."""
    return f"shard-{number:06d}"


def find_shard(folder: Path, number: int) -> ShardSummary | None:
    """Summary of a finished shard; None: the shard is missing or damaged.

    Compares the size of the tar, but not its hash: `omnisim dataset check` does.
    """
    stem = shard_stem(number)
    try:
        content = json.loads((folder / f"{stem}.json").read_text(encoding="utf-8"))
        summary = ShardSummary(
            int(content["shard"]),
            str(content["plan"]),
            str(content["sha256"]),
            int(content["bytes"]),
            Statistics.from_json(content["statistics"]),
        )
        is_whole = (folder / f"{stem}.tar").stat().st_size == summary.size_bytes
    except (OSError, *_DAMAGE):
        return None
    return summary if is_whole and summary.number == number else None


class ShardMaker:
    """Generator of a plan's shards in the folder of a data set."""

    def __init__(self, prepared: PreparedPlan, folder: Path, device: int | None = None):
        self._prepared, self._folder = prepared, folder
        self._renderer = SampleRenderer(prepared, device)

    def close(self) -> None:
        """Close the renderers."""
        self._renderer.close()

    def make(
        self, number: int, count: Callable[[], None] = lambda: None, samples: int | None = None
    ) -> None:
        """Generate a shard, see `steps`; call `count` after each sample."""
        for _ in self.steps(number, samples):
            count()

    def steps(self, number: int, samples: int | None = None) -> Iterator[int]:
        """Generate a shard, atomically; yield after each sample. An estimate takes fewer `samples`.

        Raises:
            OmnisimError: a sample that cannot be drawn, or a file that cannot be written.
        """
        plan = self._prepared.plan
        first = number * plan.images_per_shard
        numbers = range(first, first + (samples or plan.images_per_shard))
        statistics = Statistics()
        with tempfile.TemporaryDirectory(prefix="omnisim-shard-") as name:
            scratch = Path(name)
            with ThreadPoolExecutor(1) as writer:  # writes while the next sample is rendered
                waiting: deque[Future[None]] = deque()
                for sample in self._renderer.order(numbers):
                    rendered = self._renderer.render(sample)
                    waiting.append(writer.submit(self._write, scratch, rendered, statistics))
                    while len(waiting) > MAX_WAITING or (waiting and waiting[0].done()):
                        waiting.popleft().result()
                    yield sample
                for future in waiting:
                    future.result()
            tar = self._folder / f"{shard_stem(number)}.tar"
            sha256, size_bytes = write_tar(tar, scratch)
        summary = ShardSummary(number, self._prepared.fingerprint, sha256, size_bytes, statistics)
        text = json.dumps(summary.to_json(), indent=1) + "\n"
        write_text(self._folder / f"{shard_stem(number)}.json", text)

    def _write(self, scratch: Path, sample: RenderedSample, statistics: Statistics) -> None:
        """Write a sample's files, and count it."""
        plan, drawn, frames = self._prepared.plan, sample.drawn, sample.frames
        key = f"{drawn.number:0{KEY_DIGITS}d}"
        for name, frame in frames.items():
            stem = f"{key}.{name}" if name else key
            path = scratch / f"{stem}.{plan.image_format}"
            frame.save(path, channel_format=plan.channel_format)
            if plan.box_limits != BoxLimits():
                limit_boxes(path, plan.box_limits, sample.shares.get(name, {}))
            statistics.add_frame(frame)
        statistics.samples += 1
        statistics.redrawn += drawn.attempt
        scene = self._prepared.scene(drawn.indices.scene)
        rig = self._prepared.rigs[drawn.indices.rig]
        statistics.scenes[scene.name] += 1
        statistics.cameras[rig.title] += 1
        metadata = {name or "camera": frame.metadata for name, frame in frames.items()}
        content = {
            "number": drawn.number,
            "attempt": drawn.attempt,
            "scene": scene.name,
            "camera": rig.title,
            "time_s": drawn.time_s,
            "colors": {name: list(color) for name, color in drawn.colors.items()},
            "objects": {placed.name: placed.world_from_object.tolist() for placed in drawn.objects},
            **({"light": sample.light} if sample.light else {}),
            "images": metadata,
        }
        try:
            (scratch / f"{key}.json").write_text(json.dumps(content), encoding="utf-8")
        except OSError as reason:
            raise PlanError(f"{scratch}: cannot be written: {reason.strerror}") from None


# Statistics of a shard's images, for a data set's card.


BRIGHTNESS_BINS = 16
# Edges of the histogram of ranges, meters: ten per decade, 0.1 m to 1 km.
RANGE_EDGES_M = np.logspace(-1.0, 3.0, 41)


@dataclass
class Statistics:
    """Counts over samples and pixels."""

    samples: int = 0  # number of samples
    redrawn: int = 0  # number of rejected attempts
    # scenes, cameras: number of samples by name
    scenes: Counter[str] = field(default_factory=Counter)
    cameras: Counter[str] = field(default_factory=Counter)
    # number of pixels by class; requires the channel semantic
    classes: Counter[str] = field(default_factory=Counter)
    # number of valid pixels by mean sRGB value, 16 bins from black to white
    brightness: Counter[int] = field(default_factory=Counter)
    # number of pixels by bin between `RANGE_EDGES_M`, end bins with all ranges beyond; requires the
    # channel range
    ranges: Counter[int] = field(default_factory=Counter)

    def add_frame(self, frame: Frame) -> None:
        """Count the pixels of an image."""
        levels = frame.rgb[frame.valid].mean(axis=1).astype(np.intp) * BRIGHTNESS_BINS // 256
        self.brightness.update(_counts(levels, BRIGHTNESS_BINS))
        if "range" in frame.channels:
            ranges = np.asarray(frame.channels["range"])
            hit = ranges[np.isfinite(ranges) & (ranges > 0.0)]
            bins = np.clip(np.digitize(hit, RANGE_EDGES_M) - 1, 0, len(RANGE_EDGES_M) - 2)
            self.ranges.update(_counts(bins, len(RANGE_EDGES_M) - 1))
        if "semantic" in frame.channels and frame.labels is not None:
            ids = np.asarray(frame.channels["semantic"])
            counts = np.bincount(ids.ravel().astype(np.intp))
            for label in frame.labels.classes:
                if label.id < len(counts) and counts[label.id]:
                    self.classes[label.name] += int(counts[label.id])

    def update(self, other: Statistics) -> None:
        """Add other counts."""
        self.samples += other.samples
        self.redrawn += other.redrawn
        for name in ("scenes", "cameras", "classes", "brightness", "ranges"):
            getattr(self, name).update(getattr(other, name))

    def to_json(self) -> dict[str, Any]:
        """Counts, of JSON types."""
        return {
            "samples": self.samples,
            "redrawn": self.redrawn,
            **{name: dict(sorted(getattr(self, name).items())) for name in _NAMED},
            "brightness": [self.brightness[k] for k in range(BRIGHTNESS_BINS)],
            "range_edges_m": [round(edge, 6) for edge in RANGE_EDGES_M.tolist()],
            "ranges": [self.ranges[k] for k in range(len(RANGE_EDGES_M) - 1)],
        }

    @classmethod
    def from_json(cls, content: Any) -> Statistics:
        """Counts from the output of `to_json`.

        Raises:
            KeyError, TypeError, ValueError, AttributeError: the content is invalid.
        """
        counts = cls(int(content["samples"]), int(content["redrawn"]))
        for name in _NAMED:
            getattr(counts, name).update({str(k): int(v) for k, v in content[name].items()})
        counts.brightness.update(dict(enumerate(map(int, content["brightness"]))))
        counts.ranges.update(dict(enumerate(map(int, content["ranges"]))))
        return counts


_NAMED = ("scenes", "cameras", "classes")


def _counts(values: Any, size: int) -> dict[int, int]:
    return dict(enumerate(np.bincount(values, minlength=size).tolist()))


# Tar files that depend only on their members: no times, no owners, sorted by name.


def write_tar(path: Path, folder: Path) -> tuple[str, int]:
    """Write all files of a folder to a tar, atomically.

    Returns:
        SHA-256 of the tar, hexadecimal, and its size in bytes.

    Raises:
        OutputError: the file cannot be written.
    """
    with atomic_write(path) as partial:
        with tarfile.open(partial, "w", format=tarfile.USTAR_FORMAT) as tar:
            for file in sorted(folder.iterdir()):
                member = tarfile.TarInfo(file.name)
                member.size, member.mode = file.stat().st_size, 0o644
                with file.open("rb") as content:
                    tar.addfile(member, content)
        return file_sha256(partial), partial.stat().st_size


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
