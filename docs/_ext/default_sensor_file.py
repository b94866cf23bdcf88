"""The default sensor file, `paper.toml`: every key with its help and its default."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import pydantic

from omnisim.core.files.file_keys import keys_of, summary
from omnisim.core.files.toml_file import toml_text
from omnisim.rendering.camera.sensor_file import SensorFile

_ABOUT = """\
# The omnidirectional camera of Schmits and Visser (2008), and every key of a sensor file.
# Each key may be left out: a value here is its default, a value behind a # is an example.
# Lengths are in meters, angles in degrees; pixels count from the center of the top left one.

"""
EXAMPLES: Mapping[str, Any] = {
    "extends": "other-camera.toml",
    "mirror": {"rim_radius_m": 0.012},
    "virtual_cameras": {"texels_per_pixel": 2.9},
    "camera": {"supersampling": 3},
    "lens": {
        "model": "equidistant",
        "width_px": 640,
        "height_px": 640,
        "focal_length_px": 190.0,
        "principal_point_px": [319.5, 319.5],
        "theta_max_deg": 95.0,
        "calibration": "camchain.yaml",
        "camera": "cam1",
    },
    "optics": {"file": "dome-port.toml"},
    "degradation": {"preset": "dragonfly2"},
}


def default_sensor_file() -> str:
    """Text of the default sensor file."""
    return _ABOUT + "\n".join(_documented(SensorFile, EXAMPLES)) + "\n"


def _documented(
    model: type[pydantic.BaseModel], examples: Mapping[str, Any], path: str = "", mark: str = ""
) -> Iterator[str]:
    """Lines with every key of a table: its help, and its default or, behind a #, its example.

    Args:
        model: schema of the table.
        examples: values of keys without a default, and further keys; tables for inner tables.
        path: key of the table in its file; empty: the file itself.
        mark: "# " in an optional table, of which all lines are comments.
    """
    keys = list(keys_of(model))
    inner = [key for key in keys if key.inner is not None or key.default == {}]
    for key in keys:
        if key not in inner:
            yield from _comment(key.help)
            begin, value = mark, key.default
            if value is None:
                begin, value = "# ", examples[key.name]
            yield begin + _line(key.name, value)
    for name in (name for name in examples if name not in model.model_fields):
        yield f"# {_line(name, examples[name])}"
    for key in inner:
        below = f"{path}.{key.name}" if path else key.name
        begin = mark or ("" if key.default else "# ")
        child = key.inner.model if key.inner else pydantic.BaseModel  # any keys
        yield from ("", *_comment(summary(child) if key.inner else key.help), f"{begin}[{below}]")
        yield from _documented(child, examples.get(key.name, {}), below, begin)


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, 98, initial_indent="# ", subsequent_indent="# ")


def _line(name: str, value: Any) -> str:
    return toml_text({name: value}).rstrip()
