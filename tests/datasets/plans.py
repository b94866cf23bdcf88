"""Plans of the tests."""

from pathlib import Path

SCENE = "rings"  # the smallest


def write_plan(folder: Path, text: str = "", scene: str = SCENE, camera: str = "", **keys) -> Path:
    """Write a plan of small images; `text` follows its tables, `camera` the camera's keys."""
    values = {"images_per_shard": 3, "shards": 2, "channels": ["range"]} | keys
    lines = [f"{key} = {value!r}".replace("'", '"') for key, value in values.items()]
    tables = (
        f'[[scenes]]\nfile = "{scene}"\n[[cameras]]\nsize_px = 32\nquality = "fast"\n{camera}\n'
    )
    path = folder / "plan.toml"
    path.write_text("\n".join(lines) + f"\n{tables}{text}\n", encoding="utf-8")
    return path
