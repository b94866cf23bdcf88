"""Poses of image files: by the names in a file of poses, or one after another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError


def pose_indices(
    files: Sequence[Path], names: Sequence[str] | None, count: int, source: Path
) -> NDArray[np.intp]:
    """Index of the pose of each image (files,).

    Names are compared without their folders and suffixes. Without names, there must be as many
    poses as images, in the order of the images' names.

    Args:
        files: image files.
        names: name of each pose's image; None: not known.
        count: number of poses.
        source: file of the poses, for messages.

    Raises:
        MeasurementError: an image without a pose, a name twice, or another number of poses.
    """
    if names is None:
        if count != len(files):
            raise MeasurementError(
                f"{source}: {count} poses for {len(files)} images: expected one pose per image in "
                "the order of their names, or the images' names in the first column"
            )
        return np.arange(count)
    stems = [PurePosixPath(name.replace("\\", "/")).stem for name in names]
    repeated = [stem for stem, number in Counter(stems).items() if number > 1]
    index_of_stem = {stem: index for index, stem in enumerate(stems)}
    missing = [file for file in files if file.stem not in index_of_stem]
    if missing:
        more = f", nor of {len(missing) - 1} more images" if len(missing) > 1 else ""
        raise MeasurementError(f"{source}: no pose of {missing[0].name}{more}")
    for file in files:
        if file.stem in repeated:
            raise MeasurementError(f"{source}: several poses of {file.stem}: expected one")
    return np.array([index_of_stem[file.stem] for file in files])
