"""Words that options take."""

from enum import StrEnum


class ViewKind(StrEnum):
    """What a picture is unwarped to."""

    CYLINDER = "cylinder"
    PERSPECTIVE = "perspective"
    BIRDSEYE = "birdseye"


class RangeMode(StrEnum):
    """How far an LMS200 measures, and in which steps."""

    MM = "mm"
    CM = "cm"
