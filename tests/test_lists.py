"""Lists and links in READMEs against code and files, and keys that were renamed."""

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
ROOT = PACKAGE.parent
READMES = sorted(
    path
    for folder in (".", "benchmarks", "omnisim", "scenes", "shaders")
    for path in (ROOT / folder).glob("**/README.md" if folder != "." else "README.md")
)
# Random, of several images, or with an encoder: compared by tests of their own.
NOT_ONE_STEP = {"shutter", "exposure", "noise", "encoding", "jpeg"}


def test_readmes_name_as_many_models_and_formats_as_there_are():
    text = (PACKAGE / "cameras" / "calibration" / "README.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| \[?`(\w+)`", text, re.MULTILINE)) == sorted(FORMATS)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (models,) = re.findall(r"(\d+) camera models\*\*", text)
    (formats,) = re.findall(r"(\d+) \[calibration formats", text)
    assert 0 <= len(CAMERA_MODELS) - int(models) < 10
    assert 0 <= len(FORMATS) - int(formats) < 10


def test_each_degradation_has_its_export_and_its_example():
    kinds = {name: kind.__name__ for name, kind in EFFECT_CLASSES.items()}
    assert list(kinds) == [field.name for field in dataclasses.fields(Degradation)]
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


@pytest.mark.parametrize("path", READMES, ids=lambda path: str(path.parent.relative_to(ROOT)))
def test_links_and_paths_of_readmes_lead_to_files_and_headings(path):
    text = path.read_text(encoding="utf-8")
    for target, anchor in re.findall(r"\]\(([^)#\s]+)#?([^)\s]*)\)", text):
        if target.startswith("http"):
            continue
        file = path.parent / target
        assert file.exists(), target
        if anchor:
            headings = re.findall(r"^#+ (.+)$", file.read_text(encoding="utf-8"), re.MULTILINE)
            slugs = [
                re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings
            ]
            assert anchor in slugs, f"{target}#{anchor}"
    for name in re.findall(r"`((?:[\w.-]+/)+[\w.-]*)`", text):
        # in code, from the root or the package; `out` is what make writes
        known = any((root / name.split("/")[0]).is_dir() for root in (ROOT, PACKAGE))
        if known and not name.startswith("out/"):
            assert any((root / name).exists() for root in (path.parent, ROOT, PACKAGE)), name
