"""One rendered picture and all that is known about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import OutputError
from omnisim.ground_truth import Labels
from omnisim.image_files import is_float_format, write_image


@dataclass(frozen=True, eq=False)
class Frame:
    """A picture, first row at the top.

    Attributes:
        rgba: (height, width, 4) uint8, sRGB; alpha is 255 where the camera sees something.
        linear: (height, width, 3) float32 linear RGB, where it was asked for.
        metadata: camera, mirror, scene and pose, as JSON can hold them.
        channels: ground truth by name, (height, width) or (height, width, n), where it was asked
            for; `omnisim.ground_truth.CHANNELS` says what each holds.
        labels: what the numbers of its classes and instances mean, or None: no channels.
    """

    rgba: NDArray[np.uint8]
    linear: NDArray[np.float32] | None
    metadata: dict[str, Any]
    channels: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    labels: Labels | None = None

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """Colours (height, width, 3) uint8, sRGB; black where the camera sees nothing."""
        return self.rgba[..., :3]

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Mask (height, width): the pixel shows the scene, with at least half of its captures."""
        return self.rgba[..., 3] > 0

    def save(self, path: str | Path) -> None:
        """Write PNG, JPEG or TIFF (sRGB), or EXR (linear float), with the metadata inside.

        Raises:
            OutputError: an unknown format, EXR without a linear picture, or a file that cannot
                be written.
        """
        path = Path(path)
        if not is_float_format(path):
            write_image(path, self.rgb, self.metadata)
        elif self.linear is None:
            raise OutputError(f"{path}: EXR holds linear colours: render with linear=True")
        else:
            write_image(path, self.linear, self.metadata)
