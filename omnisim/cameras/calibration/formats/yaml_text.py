"""Numbers and matrices in YAML that every reader parses as identical floats."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def yaml_float(value: float) -> str:
    """Float that always has a decimal point: YAML 1.1 parses 1e-05 as a string."""
    text = repr(float(value))
    return text if "." in text else text.replace("e", ".0e")


def yaml_floats(values: Iterable[float]) -> str:
    """List of floats on one line."""
    return "[" + ", ".join(map(yaml_float, values)) + "]"


def yaml_matrix(
    key: str, rows: int, columns: int, values: Sequence[float], opencv: bool = False
) -> str:
    """Row-major matrix under a key; `opencv`: in the format of `cv2.FileStorage`."""
    tag, indent, kind = (" !!opencv-matrix", "   ", "   dt: d\n") if opencv else ("", "  ", "")
    return (
        f"{key}:{tag}\n{indent}rows: {rows}\n{indent}cols: {columns}\n{kind}"
        f"{indent}data: {yaml_floats(values)}\n"
    )
