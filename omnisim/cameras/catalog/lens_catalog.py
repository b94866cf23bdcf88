"""Lenses of real cameras by maker, model and mode, as measured by the users of Gyroflow.

`lenses.tsv.xz` has a line for each profile; `.ci/make_lens_catalog.py` makes it from a checkout of
gyroflow/lens_profiles (CC0). An entry's name is `maker/model/lens-setting-WIDTHxHEIGHT`; of several
with one name the best is first, and the others end in `~2`, `~3`, ….
"""

from __future__ import annotations

import lzma
import re
import unicodedata
from functools import cached_property, lru_cache
from importlib import resources
from typing import NamedTuple

from omnisim.cameras.models.kannala_brandt import KannalaBrandtCamera
from omnisim.core.errors import CalibrationError

PREFIX = "catalog:"
FILE = "lenses.tsv.xz"
SHOWN = 5  # names in a message


class CatalogFields(NamedTuple):
    """Columns of the file."""

    maker: str
    model: str
    lens: str
    setting: str
    note: str
    width_px: str  # of the calibrated images
    height_px: str
    stretch: str  # horizontal and vertical, of anamorphic lenses; empty: none
    fx: str
    fy: str
    cx: str
    cy: str
    k1: str
    k2: str
    k3: str
    k4: str
    error_px: str  # root mean square of the calibration's reprojection
    images: str  # number of images of the calibration
    readout_ms: str  # from the first row to the last; empty: not measured
    shutter: str  # "global", or empty
    official: str  # "official", or empty
    date: str


class CatalogEntry:
    """One lens of a camera in one mode.

    Attributes:
        name: unique name in the catalog.
        fields: columns of the file, as text.
    """

    def __init__(self, fields: CatalogFields, name: str):
        self.fields, self.name = fields, name

    def __repr__(self) -> str:
        return f"CatalogEntry({self.name!r})"

    @property
    def title(self) -> str:
        """Maker, model, lens and setting, in their own spelling."""
        stated = self.fields.maker, self.fields.model, self.fields.lens, self.fields.setting
        return " ".join(filter(None, stated))

    @cached_property
    def lens(self) -> KannalaBrandtCamera:
        """The lens, of images of the calibrated size.

        Raises:
            OpticsError: its numbers are those of no lens.
        """
        of = self.fields
        focal_lengths = float(of.fx), float(of.fy)
        center = float(of.cx), float(of.cy)
        coefficients = tuple(map(float, (of.k1, of.k2, of.k3, of.k4)))
        size = int(of.width_px), int(of.height_px)
        return KannalaBrandtCamera(*size, focal_lengths, center, coefficients)

    @cached_property
    def words(self) -> list[str]:
        """Words by which a search finds it: its name, lens, setting and image size."""
        of, width = self.fields, int(self.fields.width_px)
        sizes = f"{round(width / 100) / 10:g}k {_NAMED_WIDTHS.get(width, '')} {of.height_px}p"
        return _words(f"{self.name.partition('~')[0]} {of.lens} {of.setting} {sizes}")

    @property
    def error_px(self) -> float:
        """Reprojection error of its calibration, root mean square."""
        return float(self.fields.error_px)

    @property
    def readout_s(self) -> float | None:
        """Time from the first row to the last one; 0: global shutter; None: not measured."""
        if self.fields.shutter:
            return 0.0
        return float(self.fields.readout_ms) / 1e3 if self.fields.readout_ms else None

    @property
    def notes(self) -> list[str]:
        """One sentence for each thing that a user should know."""
        of, notes = self.fields, []
        if of.note:
            notes.append(f"its author notes: {of.note}")
        if of.stretch:
            notes.append(f"its images were stretched by {of.stretch} (anamorphic lens)")
        return notes


def slug(text: str) -> str:
    """Lower-case words of a text, joined by hyphens."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9.+]+", "-", plain).strip("-") or "other"


def rank(fields: CatalogFields) -> tuple[bool, bool, float, str]:
    """Order of profiles with one name: official ones, those with a readout, small errors."""
    return not fields.official, not fields.readout_ms, float(fields.error_px), fields.date


@lru_cache(maxsize=1)
def catalog() -> dict[str, CatalogEntry]:
    """All entries by name, in alphabetical order; read at the first call."""
    packed = resources.files(__package__).joinpath(FILE).read_bytes()
    entries: dict[str, CatalogEntry] = {}
    for line in lzma.decompress(packed).decode().splitlines():
        name, *columns = line.split("\t")
        entries[name] = CatalogEntry(CatalogFields(*columns), name)
    return entries


def search(words: str, limit: int | None = None) -> list[CatalogEntry]:
    """Entries whose name or title has all words, the closest first.

    A word is the beginning of one of theirs; letters and digits are words apart, so that `hero 11`
    and `hero11` find the same. 4k, 2.7k, 1080p and the like are image sizes.
    """
    wanted = _words(words)
    found = []
    for entry in catalog().values():
        have = entry.words
        if all(any(one.startswith(word) for one in have) for word in wanted):
            exact = sum(word in have for word in wanted)
            found.append(((-exact, "~" in entry.name, len(have)), entry))
    found.sort(key=lambda item: item[0])
    return [entry for _, entry in found[:limit]]


_NAMED_WIDTHS = {3840: "4k", 4096: "4k", 2704: "2.7k", 5312: "5.3k"}
_WORD = re.compile(r"[0-9.]+[kp](?![a-z])|[a-z]+|[0-9.]+|[+]")


def _words(text: str) -> list[str]:
    return _WORD.findall(text.lower())


def find(name: str) -> CatalogEntry:
    """Entry by its name, with or without `catalog:`, or by words that only its name has.

    Raises:
        CalibrationError: no entry of this name, or several.
    """
    wanted, entries = name.removeprefix(PREFIX), catalog()
    if wanted in entries:
        return entries[wanted]
    inside = [key for key in entries if wanted and wanted in key and "~" not in key]
    inside = inside or [entry.name for entry in search(wanted) if "~" not in entry.name]
    if len(inside) == 1:
        return entries[inside[0]]
    if not wanted or not inside:
        raise CalibrationError(
            f'{PREFIX}{wanted}: no such camera: omnisim calibration search "maker model" lists them'
        )
    shown = ", ".join(inside[:SHOWN])
    more = f" and {len(inside) - SHOWN} more" if len(inside) > SHOWN else ""
    raise CalibrationError(f"{PREFIX}{wanted}: expected the name of one, such as {shown}{more}")
