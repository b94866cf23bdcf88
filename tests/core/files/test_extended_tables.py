"""Files that extend another: keys, tables and named tables are merged; files keep their place."""

import pytest

from omnisim.core.errors import RobotFileError
from omnisim.core.files.toml_file import extended, read_tables, toml_text

BASE = {
    "name": "base",
    "body": "body.obj",
    "resources": ["models"],
    "limits": {"speed": 1, "turn": 2},
    "lens": {"model": "a", "k1": 1, "k2": 2},
    "corners": [1, 2, 3],
    "sensors": [{"name": "eye", "file": "eye.toml", "yaw": 0}, {"name": "ear", "yaw": 1}],
}


@pytest.fixture
def read(tmp_path):
    (tmp_path / "base" / "models").mkdir(parents=True)
    for name in ("body.obj", "eye.toml"):
        (tmp_path / "base" / name).touch()
    (tmp_path / "base" / "base.toml").write_text(toml_text(BASE))

    def read(table, name="own.toml", **options):
        table = {"extends": "base/base.toml"} | table
        (tmp_path / name).write_text(toml_text(table))
        path = tmp_path / name
        return extended(read_tables(path, RobotFileError), str(path), RobotFileError, **options)

    return read


def test_what_is_not_stated_is_that_of_the_base(read, tmp_path):
    folder = tmp_path / "base"
    assert read({}) == BASE | {
        "body": str(folder / "body.obj"),
        "resources": [str(folder / "models")],
        "sensors": [BASE["sensors"][0] | {"file": str(folder / "eye.toml")}, BASE["sensors"][1]],
    }


@pytest.mark.parametrize(
    ("own", "merged"),
    [
        ({"name": "own", "body": "other.obj", "corners": [4]}, None),
        ({"limits": {"turn": 3}}, {"limits": {"speed": 1, "turn": 3}}),
        ({"lens": {"k1": 3}}, {"lens": {"model": "a", "k1": 3, "k2": 2}}),
        ({"lens": {"model": "b", "k1": 3}}, None),  # another model has none of the parameters
    ],
)
def test_keys_replace_and_tables_are_merged(read, own, merged):
    expected = own if merged is None else merged
    assert {key: value for key, value in read(own).items() if key in own} == expected


def test_named_tables_are_changed_or_added(read):
    sensors = read({"sensors": [{"name": "ear", "yaw": 5}, {"name": "nose"}]})["sensors"]
    assert [sensor["name"] for sensor in sensors] == ["eye", "ear", "nose"]
    assert [sensor.get("yaw") for sensor in sensors] == [0, 5, None]


def test_a_key_excludes_its_rivals_in_the_base(read):
    assert "lens" not in read({"mirror": {}}, rivals={"mirror": ("lens",)})
    assert "lens" in read({"lens": {}}, rivals={"lens": ("lens", "limits")})


def test_long_texts_are_no_files(read):
    assert read({"extends": "base/base.toml", "title": "a." * 5000})["title"] == "a." * 5000
    read({"title": "a." * 5000}, "middle.toml")
    assert read({"extends": "middle.toml"}, "last.toml")["title"] == "a." * 5000


def test_files_extend_files_that_extend(read):
    read({"name": "middle"}, "middle.toml")
    last = read({"extends": "middle.toml", "limits": {"speed": 9}}, "last.toml")
    assert (last["name"], last["limits"]) == ("middle", {"speed": 9, "turn": 2})


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("own.toml", "extends = 'own.toml': .*own.toml extends itself"),
        ("base/../own.toml", ".*own.toml extends itself"),
        ("none.toml", "extends = 'none.toml': .*none.toml: cannot be read: No such file"),
        (3, "extends: expected text, got 3"),
    ],
)
def test_errors_name_both_files(read, tmp_path, name, message):
    with pytest.raises(RobotFileError, match=f"^{tmp_path}/own.toml: {message}"):
        read({"extends": name})
