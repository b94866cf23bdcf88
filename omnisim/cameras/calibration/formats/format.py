"""Base of the calibration file formats."""

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
from omnisim.cameras.calibration.documents import (
    ForeignTable,
    parse_json,
    parse_yaml,
    short,
    unread_keys,
)
from omnisim.cameras.camera import without_prefix
from omnisim.core.errors import CalibrationError, OpticsError

LensT = TypeVar("LensT", bound=CentralCamera)
LensT_co = TypeVar("LensT_co", bound=CentralCamera, covariant=True)
Fixed = Mapping[str, Any]
ANY: Fixed = {}
PINHOLE: Fixed = {"xi": 0.0}  # makes the unified model a pinhole camera with distortion
SHOWN_KEYS = 8  # unknown keys that a notice names
NO_SKEW: Fixed = {"skew_px": 0.0}  # drops skew and k3, which most formats lack


class MetadataPlace(Enum):
    """Location of omnisim's metadata in a format; see `omnisim.cameras.calibration.metadata`."""

    LINES = "# omnisim {…}"
    XML = "<!-- omnisim {…} -->"
    KEY = '"omnisim": […]'


@dataclass(frozen=True, eq=False)
class ParsedCamera(Generic[LensT_co]):
    """One camera as its file describes it."""

    name: str
    lens: LensT_co  # camera model that looks along +z of the file frame
    # poses, time_shift_s: camera poses in the file, and offset from camera timestamps to IMU
    # timestamps
    poses: tuple[NamedPose, ...] = ()
    time_shift_s: float = 0.0
    notes: tuple[str, ...] = ()  # contradictions in the file, one sentence each


class Format(ABC, Generic[LensT]):
    """File format for lenses of the models `LensT`.

    Attributes:
        name: name on the command line.
        title: tool and file, for lists.
        suffix: file suffix.
        models: models that the format represents exactly.
        fits: models to fit to other lenses, each with the parameters that the format fixes.
        signature: text pattern that identifies the format, even in a broken file.
        metadata_place: location of omnisim's metadata in a file.
        max_theta_rad: angle from the axis at and beyond which rays cannot be represented.
        caveat: note for the user about a lens that sees farther than caveat_theta_rad.
        centered: True if the axis is always at the image center.
        several: True if a file can hold several cameras.
        tables: schemas of its kinds of files; empty: files without keys.
        has_names: True if cameras have names in the file.
        unified_terms: terms among "ξ", "skew", "k3" and "thin prism or tilt" that the format's
            unified or pinhole camera has.
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
    tables: ClassVar[tuple[type[ForeignTable], ...]] = ()
    has_names: ClassVar[bool] = True
    unified_terms: ClassVar[frozenset[str]] = frozenset({"k3"})

    def looks_like(self, text: str) -> bool:
        """True if the text looks like a file of this format."""
        return bool(self.signature.search(text))

    def ambiguity(self, text: str, source: str) -> str | None:
        """Reason why the user has to name the format, or None."""
        return None

    def document(self, text: str, source: str) -> Any:
        """Content of a file: keys with values, or the text itself if the format has no keys.

        Raises:
            CalibrationError: a fault of the syntax; names the file and the line.
        """
        if not self.tables:
            return text
        return {".yaml": parse_yaml, ".json": parse_json}[self.suffix](text, source)

    @abstractmethod
    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the cameras of a document; `source` names the file in messages.

        Raises:
            CalibrationError: the file is invalid; names file, key, actual and expected value.
        """

    def table_of(self, document: Any) -> type[ForeignTable] | None:
        """Schema of a document."""
        return self.tables[0] if self.tables else None

    def notices(self, document: Any, source: str) -> list[str]:
        """Notes on keys in a document that are not read, one sentence each.

        Raises:
            CalibrationError: the camera would be wrong without one of the keys.
        """
        table = self.table_of(document)
        known: dict[str, str] = {}
        unknown: list[str] = []
        for path, value, meaning in () if table is None else unread_keys(document, table):
            if path == "omnisim":  # metadata, read for all formats
                continue
            same = re.sub(r"\.\d+(?=\.)", ".*", path)  # the key in one of many equal tables
            if meaning is None:
                unknown.append(same)
            elif meaning.is_fault:
                raise CalibrationError(f"{source}: {path} = {short(value)}: {meaning.effect}")
            else:
                known.setdefault(same, f"{path} = {short(value)} is not read: {meaning.effect}")
        unknown = list(dict.fromkeys(unknown))
        notes = list(known.values())
        if unknown:
            more = f" and {len(unknown) - SHOWN_KEYS} more" if len(unknown) > SHOWN_KEYS else ""
            keys = ", ".join(unknown[:SHOWN_KEYS]) + more
            notes.append(f"unknown keys of a {self.name} file are not read: {keys}")
        return notes

    def lens_caveats(self, lens: CentralCamera) -> tuple[str, ...]:
        """Notes on what the format's own tools make of a lens."""
        return ()

    @abstractmethod
    def encode(self, cameras: Sequence[ParsedCamera[LensT]]) -> str:
        """Text of a file with the cameras; only one if the format holds no more."""

    def unsupported(self, lens: LensT) -> str | None:
        """Reason why the format cannot represent a lens of one of its models, or None."""
        if isinstance(lens, RationalPolynomialCamera):
            is_simple = not any(lens.distortion[8:]) or "thin prism or tilt" in self.unified_terms
            return None if is_simple else "it has no thin prism or tilt"
        if not isinstance(lens, UnifiedCamera):
            return None
        used = (("ξ", lens.xi), ("skew", lens.skew_px), ("k3", lens.k3))
        missing = (term for term, value in used if value and term not in self.unified_terms)
        return next((f"it has no {term}" for term in missing), None)

    def native(self, camera: CentralCamera) -> LensT | None:
        """The camera itself if the format represents mirrors as mirrors, or None."""
        return None

    def camera_name(self, index: int, name: str) -> str:
        """Camera name in the file, from its index there and its previous name."""
        return name if self.has_names else "camera"


@contextmanager
def error_context(source: str) -> Iterator[None]:
    """Prefix errors about invalid camera numbers with their place in a file.

    Raises:
        CalibrationError: the error raised in the block, prefixed with `source`.
    """
    try:
        # squares of far too large numbers need no warning: the camera is rejected below
        with np.errstate(all="ignore"):
            yield
    except OpticsError as reason:
        message = without_prefix(reason).partition("\n")[0]
        raise CalibrationError(f"{source}: {message}") from None
    except (ArithmeticError, ValueError, RecursionError, np.linalg.LinAlgError) as reason:
        raise CalibrationError(f"{source}: expected numbers of a camera: {reason}") from None
