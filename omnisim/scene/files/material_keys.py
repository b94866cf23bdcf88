"""Table of a scene's TOML file that changes materials of its mesh file."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, model_validator

from omnisim.core.files.parameters import Name, Table, overriding
from omnisim.scene.parts import Material, Shares

KEYS = (
    "metallic", "roughness", "specular", "specular_color", "ior", "clearcoat",
    "clearcoat_roughness", "transmission", "thickness_m", "attenuation_color",
    "attenuation_distance_m", "dispersion", "emissive",
)  # fmt: skip


@overriding(Material, *KEYS)
class MaterialTable(Table):
    """Change of materials of the mesh file or of the base scene.

    Values replace the file's factors, and multiply its maps and vertex colors, as in glTF. Of
    several tables that match a material, each is applied, in their order.
    """

    names: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Patterns of material names with the wildcards `*` and `?`."""
    base_color: Shares | None = None
    """Linear RGB; multiplied with the texture."""

    @property
    def changes(self) -> dict[str, Any]:
        """Values of the keys that are given, by the names of `Material`'s attributes."""
        return self.model_dump(exclude={"names"}, exclude_none=True)

    @model_validator(mode="after")
    def _has_changes(self) -> MaterialTable:
        if not self.changes:
            raise ValueError("expected a key besides names, such as roughness")
        return self
