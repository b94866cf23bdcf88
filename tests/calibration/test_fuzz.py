"""Randomly damaged files: one clear line, never another exception."""

import json
import random

import pytest

from omnisim.calibration import load_calibration
from omnisim.errors import OmnisimError
from tests.calibration.sample_files import EXACT_SAMPLES

VALUES = (
    "''", '"1"', "null", "true", "[]", "{}", "-1", "0", "1e308", "-1e308", "1e-308", "nan", ".inf",
    "99999999999999999999999", "abc", "[1, 2", "2026-99-99", "1.5", "!!python/object:os.system x",
    "*a", "&a [*a]", "1" * 5000, "\u2028", "<x/>", "1 2 3", "0.0.0", "- 5",
)  # fmt: skip


def _broken(text, generator):
    """Text with one random fault."""
    lines = text.splitlines(keepends=True)
    kind = generator.randrange(8)
    if kind == 0:
        return text[: generator.randrange(len(text))]
    if kind == 1:
        del lines[generator.randrange(len(lines))]
        return "".join(lines)
    if kind == 2:
        at = generator.randrange(len(lines))
        return "".join(lines[: at + 1] + lines[at:])
    if kind == 3:
        at, other = generator.randrange(len(lines)), generator.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
        return "".join(lines)
    words = [(at, word) for at, line in enumerate(lines) for word in line.split() if word]
    at, word = generator.choice(words)
    if kind == 4:
        lines[at] = lines[at].replace(word, "", 1)
    elif kind == 5:
        lines[at] = lines[at].replace(word, generator.choice(words)[1], 1)
    elif kind == 6:
        start = generator.randrange(len(text))
        return text[:start] + chr(generator.choice((0, 7, 34, 39, 123, 233, 8232))) + text[start:]
    else:
        trail = word[-1] if word[-1] in ",]:}" else ""
        lines[at] = lines[at].replace(word, generator.choice(VALUES) + trail, 1)
    return "".join(lines)


@pytest.mark.parametrize("path", EXACT_SAMPLES, ids=lambda path: path.name)
def test_broken_files_are_one_line(path, tmp_path):
    text = path.read_text()
    generator = random.Random(path.name)
    broken = tmp_path / path.name
    complaints = []
    for _ in range(60):
        broken.write_text(_broken(text, generator), errors="replace")
        complaints += _complaint(broken)
    assert len(complaints) > 10
    assert all(one.startswith(str(broken)) for one in complaints)
    assert all(len(line) < 700 for one in complaints for line in one.splitlines())


def _complaint(path):
    """Error message of a file in a list, empty without one."""
    try:
        load_calibration(path)
    except OmnisimError as reason:
        return [str(reason)]
    return []


def _swap(value, generator):
    """JSON value with one part of another type."""
    if isinstance(value, dict) and value and generator.random() < 0.8:
        key = generator.choice(list(value))
        return {**value, key: _swap(value[key], generator)}
    if isinstance(value, list) and value and generator.random() < 0.8:
        at = generator.randrange(len(value))
        return [*value[:at], _swap(value[at], generator), *value[at + 1 :]]
    return generator.choice([None, "x", "1.5", True, -1, 0, 1.5, 1e300, [], {}, [[]], [1.0] * 4])


@pytest.mark.parametrize(
    "path", [path for path in EXACT_SAMPLES if path.suffix == ".json"], ids=lambda path: path.name
)
def test_values_of_other_types_are_one_line(path, tmp_path):
    data = json.loads(path.read_text())
    generator = random.Random(path.name)
    broken = tmp_path / path.name
    for _ in range(150):
        broken.write_text(json.dumps(_swap(data, generator)))
        assert all(one.startswith(str(broken)) for one in _complaint(broken))
