"""Generation of a data set: the missing shards, then manifest and card."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from omnisim.core.errors import OutputError, PlanError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.image_files import write_image
from omnisim.core.version import __version__
from omnisim.datasets.free_space import PATTERN
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.datasets.generate.samples import MANIFEST, SampleManifest, Shards
from omnisim.datasets.generate.shard import (
    RANGE_EDGES_M,
    ShardMaker,
    ShardSummary,
    Statistics,
    find_shard,
)
from omnisim.datasets.generate.workers import SampleJob, ShardProgress, make_shards, threads_shared

PLAN, SHARDS = "plan.json", "shard-*.tar"
PROBED_SAMPLES = 12  # per worker, for an estimate


@dataclass(frozen=True)
class TimeEstimate:
    """Size of a data set, and the time to generate it."""

    samples: int  # number of samples in all shards
    sample_bytes: float  # mean size of a sample in its shard
    samples_per_s: float  # rate of all workers together
    start_s: float  # time until a worker's first sample

    @property
    def seconds(self) -> float:
        """Time for all shards in seconds."""
        return self.start_s + self.samples / self.samples_per_s


class Generation:
    """Generation of all shards of a plan, or of some, in a folder, by this or other processes.

    Raises:
        OmnisimError: a faulty plan, a faulty file that the plan names, shards that the plan does
            not have, or a folder of another plan.
    """

    def __init__(
        self,
        path: Path,
        folder: Path,
        shards: range | None = None,
        workers: int = 1,
        device: int | None = None,
    ):
        self.prepared = PreparedPlan.read(path, folder)
        self.job, self._workers = SampleJob(path, folder, device), workers  # 1: this process
        count = self.prepared.plan.shards
        self.shards = range(count) if shards is None else shards
        if not self.shards or self.shards[0] < 0 or self.shards[-1] >= count:
            raise PlanError(
                f"--shards: expected a range in 0:{count}, as the plan has shards = {count}, got "
                f"{self.shards.start}:{self.shards.stop}"
            )
        self.prepared.check_setups()
        self._own_folder()
        self.missing = [number for number in self.shards if self._found(number) is None]

    def run(self) -> Iterator[ShardProgress]:
        """Generate the missing shards; yield after each sample and each shard.

        Raises:
            OmnisimError: a sample that cannot be drawn, or a file that cannot be written.
        """
        if not self.missing:
            return
        self._keep_folder()
        if self._workers > 1:
            for number in range(len(self.prepared.plan.scenes)):
                self.prepared.find_free_space(number)  # once for all workers
            with threads_shared(self._workers):
                for progress in make_shards(self.job, self.missing, self._workers):
                    self._keep_folder()
                    yield progress
            return
        maker = ShardMaker(self.prepared, self.job.folder, self.job.device)
        try:
            for number in self.missing:
                for _ in maker.steps(number):
                    yield ShardProgress(number, False)
                self._keep_folder()
                yield ShardProgress(number, True)
        finally:
            maker.close()

    def _keep_folder(self) -> None:
        """Claim the folder again if another process has released it."""
        if not (self.job.folder / PLAN).is_file():
            self.job.folder.mkdir(exist_ok=True)
            write_text(self.job.folder / PLAN, self._claim)

    def finish(self) -> SampleManifest | None:
        """Write manifest and card if all shards of the plan exist; else return None.

        Raises:
            OutputError: a file cannot be written.
        """
        finished = [self._found(number) for number in range(self.prepared.plan.shards)]
        summaries = tuple(summary for summary in finished if summary is not None)
        if len(summaries) < len(finished):
            return None
        manifest = SampleManifest(
            self.prepared.plan.title or self.job.plan.stem,
            self.prepared.plan.license,
            self.prepared.fingerprint,
            self.prepared.plan.channels,
            summaries,
        )
        content = json.dumps(manifest.to_json(), indent=1) + "\n"
        target = self.job.folder / MANIFEST
        if not target.is_file() or target.read_text(encoding="utf-8") != content:
            write_card(self.job.folder, manifest)
            write_text(target, content)
        for free_space in self.job.folder.glob(PATTERN):
            free_space.unlink(missing_ok=True)
        return manifest

    def give_up(self) -> None:
        """Release the folder that this process has claimed, unless the folder has a shard.

        Another process that generates the same plan there claims the folder again.
        """
        folder = self.job.folder
        if not self._has_taken_folder or any(folder.glob(SHARDS)):
            return
        for path in (folder / PLAN, *folder.glob(PATTERN)):
            path.unlink(missing_ok=True)
        if self._is_new_folder and not any(folder.iterdir()):
            folder.rmdir()

    def _found(self, number: int) -> ShardSummary | None:
        summary = find_shard(self.job.folder, number)
        is_own = summary is not None and summary.plan == self.prepared.fingerprint
        return summary if is_own else None

    def _own_folder(self) -> None:
        """Claim the folder for this plan."""
        folder = self.job.folder
        content = {"plan": self.prepared.fingerprint, "content": self.prepared.plan.content()}
        text = self._claim = json.dumps(content, indent=1) + "\n"
        self._is_new_folder, self._has_taken_folder = not folder.exists(), False
        try:
            folder.mkdir(parents=True, exist_ok=True)
            names = sorted(file.name for file in folder.iterdir() if not file.name.startswith("."))
            before = (folder / PLAN).read_text(encoding="utf-8") if PLAN in names else None
        except OSError as reason:
            raise OutputError(f"{folder}: cannot be written: {reason.strerror}") from None
        except UnicodeDecodeError:
            before = ""
        if before == text:
            return
        is_abandoned = names == [PLAN] and before is not None and before.startswith(text[:10])
        if names and not is_abandoned:  # a plan without a shard has no claim
            expected = "expected a new folder, or that of this plan"
            what = "belongs to another plan or other scenes" if before else "is not a data set"
            raise OutputError(f"{folder}: {what}: {expected}")
        write_text(folder / PLAN, text)
        self._has_taken_folder = True


def estimate(path: Path, workers: int = 1, device: int | None = None) -> TimeEstimate:
    """Estimate size and time of a data set from some rendered samples, which are discarded.

    Raises:
        OmnisimError: a faulty plan, a faulty file that the plan names, or a sample that cannot be
            drawn.
    """
    begin_s = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="omnisim-") as name:
        folder = Path(name)
        prepared = PreparedPlan.read(path, folder)
        prepared.check()
        read_s = time.perf_counter() - begin_s
        samples = min(PROBED_SAMPLES, prepared.plan.images_per_shard)
        job = SampleJob(path, folder, device, samples)
        times_s: dict[int, list[float]] = {number: [] for number in range(workers)}
        if workers > 1:
            with threads_shared(workers):
                for progress in make_shards(job, list(times_s), workers):
                    if not progress.is_whole:
                        times_s[progress.shard].append(time.perf_counter() - begin_s)
        else:
            maker = ShardMaker(prepared, folder, device)
            try:
                for _ in maker.steps(0, samples):
                    times_s[0].append(time.perf_counter() - begin_s)
            finally:
                maker.close()
        sizes = sum(file.stat().st_size for file in folder.glob("*.tar"))
    rate = sum((len(own) - 1) / (own[-1] - own[0]) for own in times_s.values() if len(own) > 1)
    start_s = max(own[0] for own in times_s.values())
    count = samples * workers
    if not rate:
        rate = 1.0 / max(start_s - read_s, 1e-3)
    return TimeEstimate(prepared.plan.images, sizes / count, rate, start_s)


# Card of a data set: `README.md` with counts and histograms, and `example.jpg`.


EXAMPLE = "example.jpg"
EXAMPLES, EXAMPLE_COLUMNS, GAP_PX = 8, 4, 4
BAR = 30  # characters of the longest bar
MAX_CLASSES = 60


def write_card(folder: Path, manifest: SampleManifest) -> None:
    """Write README.md and example.jpg of a data set.

    Raises:
        OmnisimError: a file cannot be written, or a shard cannot be read.
    """
    samples = Shards(folder, manifest)
    step = max(1, len(samples) // EXAMPLES)
    images = [samples.image(row) for row in range(0, len(samples), step)[:EXAMPLES]]
    height = max(image.shape[0] for image in images) + GAP_PX
    width = max(image.shape[1] for image in images) + GAP_PX
    rows = -(-len(images) // EXAMPLE_COLUMNS)
    columns = min(EXAMPLE_COLUMNS, len(images))
    sheet = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
    for index, image in enumerate(images):
        row, column = divmod(index, columns)
        top, left = row * height, column * width
        sheet[top : top + image.shape[0], left : left + image.shape[1]] = image[..., :3]
    write_image(folder / EXAMPLE, sheet)
    write_text(folder / "README.md", _text(manifest))


def _text(manifest: SampleManifest) -> str:
    statistics = manifest.statistics
    license = manifest.license or "unknown"
    channels = ", ".join(manifest.channels) or "none"
    parts = [
        f"---\nlicense: {license}\npretty_name: {manifest.title}\n---\n",
        f"# {manifest.title}\n",
        f"{statistics.samples} samples in {len(manifest.shards)} shards, "
        f"{manifest.size_bytes / 1e6:.1f} MB. Rendered by omnisim {__version__}.\n",
        f"![Examples]({EXAMPLE})\n",
        f"License: {license}. Channels of ground truth: {channels}. Samples drawn again: "
        f"{statistics.redrawn}.\n",
        "Each `shard-*.tar` has the samples one after the other, in WebDataset's layout: files of "
        "one sample begin with its number. `NUMBER.json` has camera, calibration and pose, "
        "`NUMBER.channels.json` the scales and labels of the channels. "
        f"`{MANIFEST}` has the shards' hashes.\n",
        _table("Samples by scene", statistics.scenes),
        _table("Samples by camera", statistics.cameras),
        _ranges(statistics),
        _table("Pixels by class", dict(statistics.classes.most_common(MAX_CLASSES))),
    ]
    return "\n".join(part for part in parts if part)


def _table(title: str, counts: dict[str, int]) -> str:
    if not counts:
        return ""
    rows = [(name.replace("|", "\\|"), count) for name, count in counts.items()]
    return _histogram(title, rows)


def _ranges(statistics: Statistics) -> str:
    edges, total = RANGE_EDGES_M, statistics.ranges
    rows = [(f"{edges[k]:.3g} to {edges[k + 1]:.3g} m", total[k]) for k in range(len(edges) - 1)]
    while rows and not rows[0][1]:
        rows.pop(0)
    while rows and not rows[-1][1]:
        rows.pop()
    return _histogram("Pixels by range", rows) if rows else ""


def _histogram(title: str, rows: Sequence[tuple[str, int]]) -> str:
    most = max(max(count for _, count in rows), 1)
    lines = [f"## {title}\n", "| | count | |", "| --- | ---: | --- |"]
    lines += [f"| {name} | {count} | {'█' * round(BAR * count / most)} |" for name, count in rows]
    return "\n".join(lines) + "\n"
