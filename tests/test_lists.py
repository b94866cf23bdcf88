"""Lists in documentation and on sheets, against the code: an addition that is left out is found."""

import dataclasses
import re
from pathlib import Path
from typing import get_args

import pytest

import omnisim
from omnisim.apps.cli.option_groups import Backend
from omnisim.cameras import CAMERA_MODELS
from omnisim.cameras.calibration import FORMATS
from omnisim.core.errors import PlanError
from omnisim.core.files.parameters import parse_table
from omnisim.datasets.generate import plan
from omnisim.rendering.camera import degradations
from omnisim.rendering.camera.degradations import Degradation
from omnisim.rendering.camera.degradations.degradation_file import EFFECTS as EFFECT_CLASSES
from omnisim.rendering.shared_scene import BackendName
from omnisim.robots import robot_file
from tests.rendering.camera.degradations.test_gpu_equals_reference import EXAMPLES

PACKAGE = Path(omnisim.__file__).parent
EFFECTS = [field.name for field in dataclasses.fields(Degradation)]
# Random, of several images, or with an encoder: compared by tests of their own.
NOT_ONE_STEP = {"shutter", "exposure", "noise", "encoding", "jpeg"}


def _rows(folder):
    """Names of the tables' rows in a package's README."""
    text = (PACKAGE / folder / "README.md").read_text(encoding="utf-8")
    return re.findall(r"^\| \[?`(\w+)`", text, re.MULTILINE)


def test_readmes_have_a_row_for_each_format_and_degradation():
    assert sorted(_rows("cameras/calibration")) == sorted(FORMATS)


def test_readme_promises_no_more_models_and_formats_than_there_are():
    text = (PACKAGE.parent / "README.md").read_text(encoding="utf-8")
    (models,) = re.findall(r"(\d+) camera models\*\*", text)
    (formats,) = re.findall(r"(\d+) \[calibration formats", text)
    assert 0 <= len(CAMERA_MODELS) - int(models) < 10
    assert 0 <= len(FORMATS) - int(formats) < 10


def test_each_degradation_has_its_export_and_its_example():
    kinds = {name: kind.__name__ for name, kind in EFFECT_CLASSES.items()}
    assert list(kinds) == EFFECTS
    assert set(kinds.values()) <= set(degradations.__all__)
    compared = {type(part).__name__ for part, _ in EXAMPLES.values()}
    assert {name for name, kind in kinds.items() if kind not in compared} == NOT_ONE_STEP


def test_the_command_has_each_back_end():
    assert get_args(Backend) == get_args(BackendName)


@pytest.mark.parametrize(
    ("table", "old", "new"),
    [
        (plan.Plan, "stand", "viewpoints"),
        (plan.Plan, "pictures_per_shard", "images_per_shard"),
        (plan.RejectTable, "least_hits", "min_hit_share"),
        (plan.RejectTable, "most_near", "max_near_share"),
        (robot_file.RobotFile, "kinematics.max_turn_rate_dps", "max_turn_rate_degps"),
        (robot_file.RobotFile, "physics.centre_height_m", "center_height_m"),
    ],
)
def test_a_key_that_was_renamed_is_refused_with_its_new_name(table, old, new):
    value = 1.0
    for part in reversed(old.split(".")):
        value = {part: value}
    with pytest.raises(PlanError, match=f"{old}: unknown key; (did you mean '{new}'|.*{new})"):
        parse_table(value, table, PlanError, "file.toml")
