"""Shards: tar files of samples in WebDataset's layout, functions of the plan and their number.

The names of a sample's files begin with its number: `000000012.png`, `000000012.range.png` and so
on, as from `Frame.save`, and `000000012.json` with its pose, camera and draw. A rig's images have
number and camera name, `000000012.left.png`. `shard-000003.json` has a shard's hash and statistics.
"""

from __future__ import annotations

import json
import tempfile
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omnisim.core.errors import PlanError
from omnisim.core.files.atomic_file import write_text
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.datasets.generate.sample_renderer import RenderedSample, SampleRenderer
from omnisim.datasets.statistics import Statistics
from omnisim.datasets.tar_file import write_tar
from omnisim.ground_truth.channel_files import limit_boxes
from omnisim.ground_truth.coco import BoxLimits

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
    """Generator of a plan's shards.

    Args:
        prepared: prepared plan.
        folder: folder of the data set.
        device: EGL index of the GPU; None: the first.
    """

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
        """Generate a shard, atomically; yield after each sample.

        Args:
            number: number of the shard.
            samples: reduced number of samples, for an estimate; None: the plan's.

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
