"""Base of the file formats."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from omnisim.cameras import CentralCamera, RationalPolynomialCamera, UnifiedCamera
from omnisim.cameras.calibration.calibrated_camera import NamedPose
from omnisim.core.errors import CalibrationError, OpticsError

LensT = TypeVar("LensT", bound=CentralCamera)
LensT_co = TypeVar("LensT_co", bound=CentralCamera, covariant=True)
Fixed = Mapping[str, Any]
ANY: Fixed = {}
PINHOLE: Fixed = {"xi": 0.0}  # makes the unified model a pinhole camera with distortion
NO_SKEW: Fixed = {"skew_px": 0.0}  # leaves skew and k3 out, which most formats have not


class MetadataPlace(Enum):
    """Place for omnisim's own metadata in a format; see `omnisim.cameras.calibration.metadata`."""

    LINES = "# omnisim {…}"
    XML = "<!-- omnisim {…} -->"
    KEY = '"omnisim": […]'


@dataclass(frozen=True, eq=False)
class ParsedCamera(Generic[LensT_co]):
    """One camera as its file describes it.

    Attributes:
        name: of the camera in the file.
        lens: looks along +z of the file's frame.
        poses: of the camera.
        time_shift_s: from the camera's stamps to the times of the IMU.
    """

    name: str
    lens: LensT_co
    poses: tuple[NamedPose, ...] = ()
    time_shift_s: float = 0.0


class Format(ABC, Generic[LensT]):
    """A file format of lenses `LensT`.

    Attributes:
        name: on the command line.
        title: whose it is, for lists.
        suffix: of its files.
        models: models that it represents exactly.
        fits: models to fit other lenses by, each with the parameters that the format fixes.
        signature: pattern in the text by which a file of the format is known, a broken one too.
        metadata_place: of omnisim's own metadata.
        max_theta_rad: angle from the axis at which rays cannot be represented any more.
        caveat: for the reader of a file of a lens that sees further than caveat_theta_rad.
        centered: the axis is in the image's middle always.
        several: a file holds more than one camera.
        has_names: cameras have names in the file.
        unified_terms: those of "ξ", "skew", "k3" and "thin prism or tilt" that its unified or
            pinhole camera has.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    suffix: ClassVar[str]
    models: tuple[type[LensT], ...]
    fits: tuple[tuple[type[LensT], Fixed], ...]
    signature: ClassVar[re.Pattern[str]]
    metadata_place: ClassVar[MetadataPlace] = MetadataPlace.LINES
    max_theta_rad: ClassVar[float] = math.inf
    caveat: ClassVar[str] = ""
    caveat_theta_rad: ClassVar[float] = 0.5 * math.pi
    centered: ClassVar[bool] = False
    several: ClassVar[bool] = False
    has_names: ClassVar[bool] = True
    unified_terms: ClassVar[frozenset[str]] = frozenset({"k3"})

    def looks_like(self, text: str) -> bool:
        """True for the text of a file of the format."""
        return bool(self.signature.search(text))

    def ambiguity(self, text: str, source: str) -> str | None:
        """Reason why a text needs the user to name the format, or None."""
        return None

    @abstractmethod
    def read(self, text: str, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Cameras of a text; `source` names the file in messages.

        Raises:
            CalibrationError: naming file, key, the expected value and the one found.
        """

    @abstractmethod
    def encode(self, cameras: Sequence[ParsedCamera[LensT]]) -> str:
        """Text of a file of the cameras, which are one if the format holds no more."""

    def unsupported(self, lens: LensT) -> str | None:
        """Reason why the format cannot represent a lens of its models, or None."""
        if isinstance(lens, RationalPolynomialCamera):
            is_simple = not any(lens.distortion[8:]) or "thin prism or tilt" in self.unified_terms
            return None if is_simple else "it has no thin prism or tilt"
        if not isinstance(lens, UnifiedCamera):
            return None
        used = (("ξ", lens.xi), ("skew", lens.skew_px), ("k3", lens.k3))
        missing = (term for term, value in used if value and term not in self.unified_terms)
        return next((f"it has no {term}" for term in missing), None)

    def native(self, camera: CentralCamera) -> LensT | None:
        """The camera itself, where the format represents mirrors as mirrors, or None."""
        return None

    def camera_name(self, index: int, name: str) -> str:
        """Name in the file of a camera, by its index in the file and its name so far."""
        return name if self.has_names else "camera"


@contextmanager
def error_context(source: str) -> Iterator[None]:
    """Names the place in a file whose numbers make no camera.

    Raises:
        CalibrationError: the block's error, with `source` before it.
    """
    try:
        # squares of what is much too large are not worth a warning: what follows is refused
        with np.errstate(all="ignore"):
            yield
    except OpticsError as reason:
        words = str(reason).removeprefix("camera: ")
        raise CalibrationError(f"{source}: {words}") from None
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as reason:
        raise CalibrationError(f"{source}: expected numbers of a camera: {reason}") from None
