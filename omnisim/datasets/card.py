"""Card of a data set: `README.md` with counts and histograms, and `example.jpg`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.image_files import write_image
from omnisim.core.version import __version__
from omnisim.datasets.dataset_manifest import MANIFEST, Manifest
from omnisim.datasets.generate.samples import Shards
from omnisim.datasets.statistics import RANGE_EDGES_M, Statistics

EXAMPLE = "example.jpg"
EXAMPLES, EXAMPLE_COLUMNS, GAP_PX = 8, 4, 4
BAR = 30  # characters of the longest bar
MAX_CLASSES = 60


def write_card(folder: Path, manifest: Manifest) -> None:
    """Write README.md and example.jpg of a data set.

    Raises:
        OmnisimError: a file cannot be written, or a shard cannot be read.
    """
    samples = Shards(folder, manifest)
    step = max(1, len(samples) // EXAMPLES)
    images = [samples.image(row) for row in range(0, len(samples), step)[:EXAMPLES]]
    height = max(one.shape[0] for one in images) + GAP_PX
    width = max(one.shape[1] for one in images) + GAP_PX
    rows = -(-len(images) // EXAMPLE_COLUMNS)
    columns = min(EXAMPLE_COLUMNS, len(images))
    sheet = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
    for index, image in enumerate(images):
        row, column = divmod(index, columns)
        top, left = row * height, column * width
        sheet[top : top + image.shape[0], left : left + image.shape[1]] = image[..., :3]
    write_image(folder / EXAMPLE, sheet)
    write_text(folder / "README.md", _text(manifest))


def _text(manifest: Manifest) -> str:
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
