"""Images of classes and instances, as in KITTI-360.

Source: kitti360scripts: annotation.py; a global number is 1000 times the class, plus the instance.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import RunError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.image_files import write_numbers
from omnisim.core.short_repr import counted, short_repr
from omnisim.datasets.export.export_format import PrintNote
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.ground_truth.label_names import Labels
from omnisim.runs.run_folder import LABELS

SEMANTIC, INSTANCE = "semantic", "instance"
MAX_N = 1000  # maximum number of instances per class
MAX_ID = {SEMANTIC: 2**8 - 1, INSTANCE: 2**16 - 1}


@dataclass(frozen=True, eq=False)
class LabelImages:
    """Writer of the labels of all cameras.

    Attributes:
        folder: folder of the drive.
        cameras: cameras by their names in KITTI-360.
        numbers: by kind (semantic or instance), the number in the images for each ID of the run.
    """

    folder: Path
    cameras: Mapping[str, LensCamera]
    numbers: Mapping[str, NDArray[np.int64]]

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.cameras), "camera"), *self.numbers)

    @classmethod
    def of(
        cls,
        folder: Path,
        cameras: Mapping[str, LensCamera],
        print_note: PrintNote,
    ) -> LabelImages | None:
        """Create the folders and the table of labels; None: the run has no labels.

        Raises:
            OutputError: the table of labels is damaged.
        """
        recorded = next(iter(cameras.values())).recorded
        kinds = [kind for kind in (SEMANTIC, INSTANCE) if recorded.has(kind)]
        labels = recorded.labels(0) if kinds else None
        if labels is None:
            return None
        largest_class = max((one.id for one in labels.classes), default=0)
        every = {SEMANTIC: np.arange(largest_class + 1), INSTANCE: _instances(labels)}
        numbers = {}
        for kind in kinds:
            if every[kind].max(initial=0) > MAX_ID[kind]:
                print_note(f"no images of {kind}: {len(every[kind]) - 1} do not fit into them")
            else:
                numbers[kind] = every[kind]
        for name in cameras if numbers else ():
            for kind in numbers:
                (folder / name / kind).mkdir(parents=True)
        if numbers:
            write_text(folder / LABELS, json.dumps(labels.to_json(), indent=2) + "\n")
            print_note(f"classes are the run's own, not those of KITTI-360: {LABELS} names them")
        return cls(folder, cameras, numbers)

    def write(self, step: int) -> None:
        """Write the images of a step.

        Raises:
            RunError: a channel has a number that is not in the table of labels.
            OutputError: a file cannot be read or written.
        """
        for name, camera in self.cameras.items():
            for kind, numbers in self.numbers.items():
                values = camera.recorded.channel(step, kind)
                if values.max(initial=0) >= len(numbers):
                    raise RunError(
                        f"{camera.recorded.image_file(step)}: channel {kind!r}: expected "
                        f"numbers of {LABELS}, got {values.max()}"
                    )
                dtype = np.uint8 if kind == SEMANTIC else np.uint16
                path = self.folder / name / kind / f"{step:010d}.png"
                write_numbers(path, camera.flip(numbers[values]).astype(dtype))


def _instances(labels: Labels) -> NDArray[np.int64]:
    """KITTI-360's global number of each instance ID (n + 1,), starting with 0 for no instance.

    Beyond 999 instances of a class, the number is 65536, which fits in no image.
    """
    numbers, counts = [0], dict[int, int]()
    for one in labels.instances:
        counts[one.class_id] = number = counts.get(one.class_id, 0) + 1
        # further instances have no valid number
        numbers.append(one.class_id * MAX_N + number if number < MAX_N else 1 << 16)
    return np.array(numbers, dtype=np.int64)
