"""Tables of the scene formats: features of glTF, and conversions of what is not read."""

from __future__ import annotations

from pathlib import Path

from omnisim.scene.files.conversions import CONVERSIONS
from omnisim.scene.formats.gltf.features import FEATURES


def gltf_features() -> str:
    """Markdown table of the features of glTF."""
    rows = [
        f"| `{feature.name}` | {feature.support.value} | {feature.effect} |" for feature in FEATURES
    ]
    return "\n".join(["| property or extension | support | effect |", "| --- | --- | --- |", *rows])


def conversions() -> str:
    """Markdown table of the formats that are not read."""
    rows = []
    for conversion in CONVERSIONS:
        command = conversion.command_for(Path("scene").with_suffix(conversion.suffixes[0]))
        advice = conversion.advice.replace("<", "&lt;") + (f": `{command}`" if command else "")
        suffixes = " ".join(f"`{suffix}`" for suffix in conversion.suffixes)
        rows.append(f"| {suffixes} | {conversion.format} | {advice} |")
    return "\n".join(["| files | format | conversion |", "| --- | --- | --- |", *rows])


def scene_format_pages() -> dict[str, str]:
    """Markdown of the tables, by the names of their files."""
    return {"gltf-features": gltf_features() + "\n", "scene-conversions": conversions() + "\n"}
