"""Settings of a bake."""

from __future__ import annotations

from dataclasses import dataclass

DEFAULT_SAMPLES = 128
DEFAULT_BOUNCES = 16


@dataclass(frozen=True)
class BakeSettings:
    """Settings of a bake; equal ones of equal scenes make equal bytes.

    Attributes:
        texel_m: width of a texel near the vehicles' places; None: by the scene's size.
        samples: rays that gather light in each texel.
        bounces: reflections of light between lamps and the texel; 0: direct light alone.
        seed: of the random numbers.
    """

    texel_m: float | None = None
    samples: int = DEFAULT_SAMPLES
    bounces: int = DEFAULT_BOUNCES
    seed: int = 0
