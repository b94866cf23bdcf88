"""Table of a scene's TOML file that changes materials of its mesh file."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, model_validator

from omnisim.core.files.parameters import Fraction, Name, NotNegative, Number, Positive, Table

Shares = tuple[Fraction, Fraction, Fraction]
MAX_EMISSION = 65504.0  # largest half float, the precision of images
Emission = Annotated[Number, Field(ge=0.0, le=MAX_EMISSION)]


class MaterialTable(Table):
    """Change of materials of the mesh file or of the base scene.

    Values replace the file's factors, and multiply its maps and vertex colors, as in glTF. Of
    several tables that match a material, each is applied, in their order.
    """

    names: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Patterns of material names with the wildcards `*` and `?`."""
    base_color: Shares | None = None
    """Linear RGB; multiplied with the texture."""
    metallic: Fraction | None = None
    """1: metal; 0: dielectric."""
    roughness: Fraction | None = None
    """0: mirror; 1: diffuse. Glass rougher than 0.2 is frosted."""
    specular: Fraction | None = None
    """Strength of a dielectric's gloss; 1 is physical. The built-in matte materials have 0."""
    specular_color: Shares | None = None
    """Linear RGB tint of a dielectric's gloss."""
    ior: Annotated[Number, Field(ge=1.0, le=4.0)] | None = None
    """Refractive index of a dielectric."""
    clearcoat: Fraction | None = None
    """Strength of the clear coat."""
    clearcoat_roughness: Fraction | None = None
    """Roughness of the clear coat."""
    transmission: Fraction | None = None
    """Share of the light that passes a dielectric, of what is not reflected. A blended material
    with transmission becomes glass instead."""
    thickness_m: NotNegative | None = None
    """0: transmission is that of a thin pane; above: that of a closed body of glass."""
    attenuation_color: Shares | None = None
    """Linear RGB of white light after attenuation_distance_m in a body of glass."""
    attenuation_distance_m: Positive | None = None
    """Distance in a body of glass, m."""
    dispersion: NotNegative | None = None
    """20 over the Abbe number of a body of glass."""
    emissive: tuple[Emission, Emission, Emission] | None = None
    """Emitted light, linear RGB; 1 is white."""

    @property
    def changes(self) -> dict[str, Any]:
        """Values of the keys that are given, by the names of `Material`'s attributes."""
        return self.model_dump(exclude={"names"}, exclude_none=True)

    @model_validator(mode="after")
    def _has_changes(self) -> MaterialTable:
        if not self.changes:
            raise ValueError("expected a key besides names, such as roughness")
        return self
