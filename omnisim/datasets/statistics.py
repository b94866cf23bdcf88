"""Statistics of a shard's images, for a data set's card."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from omnisim.ground_truth.frame import Frame

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
