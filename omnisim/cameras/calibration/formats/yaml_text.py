"""Numbers and matrices in YAML, so that every reader takes them for floats of the same bits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def yaml_float(value: float) -> str:
    """Float with a point always, as YAML 1.1 takes 1e-05 for a word."""
    text = repr(float(value))
    return text if "." in text else text.replace("e", ".0e")


def yaml_floats(values: Iterable[float]) -> str:
    """List of floats on one line."""
    return "[" + ", ".join(map(yaml_float, values)) + "]"


def yaml_matrix(
    key: str, rows: int, columns: int, values: Sequence[float], opencv: bool = False
) -> str:
    """Matrix under a key, row by row; `opencv`: as `cv2.FileStorage` writes it."""
    tag, indent, kind = (" !!opencv-matrix", "   ", "   dt: d\n") if opencv else ("", "  ", "")
    return (
        f"{key}:{tag}\n{indent}rows: {rows}\n{indent}cols: {columns}\n{kind}"
        f"{indent}data: {yaml_floats(values)}\n"
    )
