"""Folders that ship with omnisim, in the installed package or in the checkout."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def _folder(name: str) -> Path:
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


PRESETS = _PACKAGE / "rendering" / "camera" / "presets"  # presets of degradations
LENSES = _PACKAGE / "cameras" / "catalog" / "lenses.tsv.xz"  # catalog of measured cameras
SWEEPS = _PACKAGE / "evaluation" / "sweeps"  # plans of the benchmark set
# The package's own omnisim/sensors is code; only these two folders are at the top level.
SHADERS = _folder("shaders")
SCENES = _folder("scenes")


def preset_names() -> list[str]:
    """Sorted names of the built-in degradation presets."""
    return sorted(path.stem for path in PRESETS.glob("*.toml"))


def sweep_names() -> list[str]:
    """Sorted names of the plans of sweeps that ship."""
    return sorted(path.stem for path in SWEEPS.glob("*.toml"))


def built_in(file: str) -> list[str]:
    """Sorted names of the folders in `SCENES` that have a file, such as scene.toml."""
    return sorted(path.parent.name for path in SCENES.glob(f"*/{file}"))
