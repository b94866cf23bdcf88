"""Tables of the scene formats: their features, and conversions of what is not read."""

from __future__ import annotations

from pathlib import Path

from omnisim.scene.formats.features import ROBOT_TABLES, TABLES, feature_table
from omnisim.scene.formats.mesh.other_formats import CONVERSIONS


def features(table: str) -> str:
    """Markdown table of the features of a format."""
    first = "property or extension" if table == "gltf" else "part"
    rows = [
        f"| `{one.name}` | {one.support.value} | {one.effect.replace('<', '&lt;')} |"
        for one in feature_table(table)
    ]
    return "\n".join([f"| {first} | support | effect |", "| --- | --- | --- |", *rows])


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
    tables = {f"{table}-features": features(table) + "\n" for table in (*TABLES, *ROBOT_TABLES)}
    return {**tables, "scene-conversions": conversions() + "\n"}
