"""TOML as text: read back, it is the same table."""

import math
import tomllib

import pytest

from omnisim.core.files.toml_file import Comment, toml_text
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE

TABLES = (
    {},
    {"a": 1, "b": 1e-9, "c": [1.0, 2], "d": True, "e": 'quo"te\\ \n\x7f é', "f": []},
    {"far_m": math.inf, "near_m": -math.inf},
    {"lens": {"model": "eucm", "mounting": {"roll_deg": 1.0}}, "camera": {}},
    {"degradation": {"noise": {"seed": 1}}, "dotted.key": {"": 2}},
    {"surfaces": [{"shape": "plane", "position_m": [0.0, 0.0, 1.0]}, {"shape": "cone", "at": {}}]},
    {"points": [[{"x": 1}], [{"x": 2, "y": [3]}]]},
    tomllib.loads(DEFAULT_SENSOR_FILE.read_text(encoding="utf-8")),
)


@pytest.mark.parametrize("table", TABLES, ids=range(len(TABLES)))
def test_text_is_read_back_as_the_same_table(table):
    assert tomllib.loads(toml_text(table)) == table


def test_none_leaves_a_key_out():
    assert toml_text({"a": None, "b": 1}) == "b = 1\n"


def test_comments_are_lines_of_their_own():
    text = toml_text({"#": Comment("one\nline"), "b": [{"c": Comment("beside"), "d": 2}]})
    assert text == "# one line\n\n[[b]]\n# beside\nd = 2\n"
