"""Keys of TOML files: each has its help, where the schema has the key."""

import importlib
from pathlib import Path

import pytest

from omnisim.cameras.optics.system_file import OpticsFile, shape_schemas
from omnisim.core.files.file_keys import keys_of
from omnisim.core.files.parameters import Table, table_of
from omnisim.perception.localization.filter import FilterParameters
from omnisim.rendering.camera.degradations.degradation_file import EFFECTS
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.sensor_file import SensorFile
from omnisim.robots.robot_file import RobotFile
from omnisim.scene.files.scene_file import LabelFile, SceneFile
from omnisim.sensors.sensor_registry import SENSOR_TYPES

EXTENSION = Path(__file__).resolve().parents[2] / "docs" / "_ext"
FILES = (
    table_of(FilterParameters), LabelFile, OpticsFile, RobotFile, SceneFile, SensorFile,
    *SENSOR_TYPES.values(), *map(table_of, EFFECTS.values()), *shape_schemas().values(),
)  # fmt: skip


def _without_help(model):
    for key in keys_of(model):
        if key.inner is None:
            if not key.help:
                yield f"{model.__name__}.{key.name}"
        else:
            child, _ = key.inner
            if not child.__doc__ or child.__doc__ == Table.__doc__:
                yield child.__name__
            yield from _without_help(child)


@pytest.mark.parametrize("model", FILES, ids=lambda model: model.__name__)
def test_every_key_of_a_file_a_degradation_and_a_shape_has_its_help(model):
    assert model.__doc__
    assert not list(_without_help(model))


def test_pages_have_a_row_for_each_key(monkeypatch):
    monkeypatch.syspath_prepend(str(EXTENSION))
    pages = importlib.import_module("file_keys").key_pages()
    assert "## `[degradation.noise]`" in pages["degradation-keys"]
    assert "| `read_noise_e` | number, ≥ 0 | `5.0` |" in pages["degradation-keys"]
    assert '## `[[sensors]]`, `type = "lms200"`' in pages["robot-file-keys"]
    assert "| `gate` | " in pages["filter-file-keys"]


def test_examples_in_the_default_sensor_file_are_valid(monkeypatch):
    monkeypatch.syspath_prepend(str(EXTENSION))
    examples = dict(importlib.import_module("default_sensor_file").EXAMPLES)
    of_calibration = ("calibration", "camera")
    lens = {key: example for key, example in examples["lens"].items() if key not in of_calibration}
    assert OmniCamera.from_table({"lens": lens}).model.model_name == lens["model"]
    for name in ("mirror", "virtual_cameras", "camera", "degradation"):
        assert OmniCamera.from_table({name: examples[name]}) != OmniCamera()


def test_pages_are_as_the_code_has_them(monkeypatch):
    monkeypatch.syspath_prepend(str(EXTENSION))
    stale = [
        path.name
        for path, text in importlib.import_module("reference_pages").reference_pages()
        if path.read_text(encoding="utf-8") != text
    ]
    assert not stale, "run `python docs/_ext/reference_pages.py`"
