"""Partition of the clusters into slices whose draw commands fit into one buffer."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

BANDS = 2  # distance bands, in shaders/culling/views.glsl
RANGE = np.dtype(  # as in shaders/culling/commands.comp
    [("first_group", "<u4"), ("groups", "<u4"), ("first_command", "<u4"), ("max_count", "<u4")]
)


class CommandRange(NamedTuple):
    """Draw commands of one batch in a slice, near band and far band.

    Attributes:
        number: index over all slices.
        batch: batch of buckets that one draw call draws.
        first: offset of the near band in the command buffer; the far band begins `max_count` later.
        max_count: maximum number of commands per band.
    """

    number: int
    batch: int
    first: int
    max_count: int


class CommandSlices(NamedTuple):
    """Slices that use the same command buffer in turn.

    Attributes:
        slices: ranges of each slice, batch by batch.
        table: (ranges,) rows of type `RANGE`.
        max_commands: maximum number per slice.
    """

    slices: tuple[tuple[CommandRange, ...], ...]
    table: NDArray[np.void]
    max_commands: int


def command_slices(
    clusters_of_group: NDArray[np.integer],
    groups_of_batch: NDArray[np.integer],
    views: int,
    max_commands: int,
) -> CommandSlices:
    """Split the groups into as few slices as possible; each group stays whole.

    Args:
        clusters_of_group: (groups,) number of clusters, batch by batch.
        groups_of_batch: (batches,) number of groups.
        views: number of views; each may show every cluster, in either band.
        max_commands: maximum number per slice; a single group may exceed it.
    """
    clusters = np.concatenate(([0], np.cumsum(clusters_of_group)))
    of_batch = np.concatenate(([0], np.cumsum(groups_of_batch)))
    max_clusters = max_commands // (BANDS * views)
    slices, rows, most_used = [], list[tuple[int, int, int, int]](), 0
    start = 0
    while start < len(clusters) - 1:
        end = int(np.searchsorted(clusters, clusters[start] + max_clusters, side="right")) - 1
        end = max(end, start + 1)
        slices.append(tuple(_ranges(clusters, of_batch, (start, end), views, rows)))
        most_used = max(most_used, BANDS * views * int(clusters[end] - clusters[start]))
        start = end
    return CommandSlices(tuple(slices), np.array(rows, dtype=RANGE), most_used)


def _ranges(
    clusters: NDArray[np.integer],
    of_batch: NDArray[np.integer],
    groups: tuple[int, int],
    views: int,
    rows: list[tuple[int, int, int, int]],
) -> list[CommandRange]:
    """Ranges of the groups in the interval `groups`; appends their rows to the table."""
    ranges = []
    start, end = groups
    first = 0
    batch = int(np.searchsorted(of_batch, start, side="right")) - 1
    while start < end:
        last = min(end, int(of_batch[batch + 1]))
        max_count = views * int(clusters[last] - clusters[start])
        ranges.append(CommandRange(len(rows), batch, first, max_count))
        rows.append((start, last - start, first, max_count))
        first += BANDS * max_count
        start, batch = last, batch + 1
    return ranges
