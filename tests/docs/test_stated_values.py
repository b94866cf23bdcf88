"""Numbers of the code that pages repeat, and the pages' words on built-in scenes."""

import json
import math
import re
import tomllib
from typing import get_args

import pytest

from omnisim.cameras.calibration.calibrated_camera import MAX_GAP_M, MAX_GAP_RAD
from omnisim.cameras.mirrors.hyperbolic_mirror import DEFAULT_RIM_RAD, PAPER_METERS_PER_UNIT
from omnisim.cameras.mirrors.mirror_mesh import MAX_POLYGONS
from omnisim.core.package_files import preset_names
from omnisim.datasets.export.export_formats import FORMATS as EXPORTS
from omnisim.datasets.export.export_formats import LAYOUTS
from omnisim.datasets.export.ros2 import bag_format
from omnisim.datasets.generate.plan import VaryTable
from omnisim.rendering.baking.settings import DEFAULT_SAMPLES, DEFAULT_TEXELS
from omnisim.rendering.camera.quality import MAX_ERROR_PX, NEAR_PER_SIZE
from omnisim.rendering.opengl.cube_backend import LIDAR_NEAR_M
from omnisim.rendering.opengl.culling.cluster_culling import MAX_COMMAND_BYTES
from omnisim.rendering.shared_scene import BackendName
from omnisim.robots.robot_file import DEFAULT_CLEARANCE_M, Chassis
from omnisim.runs.physics.rover import CASTER, CASTER_LOAD
from omnisim.runs.physics.simulation import FRICTION, ROLLING_RESISTANCE
from omnisim.scene.files.scene_file import ObjectTable
from omnisim.scene.parts import BLENDED_CUTOFF
from omnisim.sensors import DepthCamera, LaserScanner
from omnisim.sensors.lidar.spinning_lidar import MAX_PATH_M, MAX_SKEW_M, MAX_TURN_RAD, SLICES
from omnisim.sensors.range_sensor.range_sensor import InfraredTable, RangeSensor
from omnisim.validation.check_registry import CHECKS
from tests.docs.pages import HOW_TO, ROOT, WHY, half_unit, numbers_of, text_of, words_of

KINECT, D435, SCANNER, SONAR = (
    DepthCamera.kinect_v1(), DepthCamera.d435(), LaserScanner(), RangeSensor()
)  # fmt: skip
ASSUMPTIONS, SENSORS, BAKED = WHY + "assumptions.md", WHY + "sensors.md", WHY + "baked-light.md"
TRAJECTORIES = "docs/reference/trajectories.md"
# Page, pattern with `#` for each number, and the values.
VALUES = (
    (ASSUMPTIONS, r"`meters_per_unit = #`", (PAPER_METERS_PER_UNIT,)),
    (ASSUMPTIONS, r"`theta_max_deg = #`", (math.degrees(DEFAULT_RIM_RAD),)),
    (ASSUMPTIONS, r"cameras, #° and #°", (KINECT.max_incidence_deg, D435.max_incidence_deg)),
    (ASSUMPTIONS, r"is # for tires and # for every", (Chassis().friction, FRICTION[0])),
    (ASSUMPTIONS, r"resistance of balls is #\. ", (ROLLING_RESISTANCE,)),
    (ASSUMPTIONS, r"caster is # of the length .* carries # of", (CASTER, CASTER_LOAD)),
    (ASSUMPTIONS, r"Lidars see nothing within # m", (LIDAR_NEAR_M,)),
    (WHY + "physics.md", r"clearance, # cm by default", (100.0 * DEFAULT_CLEARANCE_M,)),
    (TRAJECTORIES, r"`\[footprint\]` at most, # cm", (100 * DEFAULT_CLEARANCE_M,)),
    (WHY + "optics.md", r"the image below # px\. The distance", (MAX_ERROR_PX,)),
    (WHY + "non-central-optics.md", r"the largest error below # px", (MAX_ERROR_PX,)),
    (HOW_TO + "choose.md", r"error is below # px in every", (MAX_ERROR_PX,)),
    (HOW_TO + "rigs.md", r"by more than # mm or # mrad", (1e3 * MAX_GAP_M, 1e3 * MAX_GAP_RAD)),
    (HOW_TO + "laser-scanner.md", r"# beams over #°, one every #°", (
        SCANNER.beams, SCANNER.field_of_view_deg, SCANNER.resolution_deg)),
    (HOW_TO + "robots.md", r"cone of #° about x, up to # m", (
        SONAR.beam_angle_deg, SONAR.range_max_m)),
    (HOW_TO + "robots.md", r"has one ray, up to # m", (
        InfraredTable.model_fields["range_max_m"].default,)),
    (HOW_TO + "data-sets.md", r"# successive samples share", (
        VaryTable.model_fields["images_per_setup"].default,)),
    (HOW_TO + "ground-truth.md", r"alpha below #\. ", (BLENDED_CUTOFF,)),
    (SENSORS, r"It is # mm at 1 m and # mm at 5 m", [1e3 * KINECT.sigma_m(z) for z in (1, 5)]),
    (SENSORS, r"# mm at 1 m and # mm at 2 m for the D435", [1e3 * D435.sigma_m(z) for z in (1, 2)]),
    (SENSORS, r"at most #, in which the motion is straight and even to # mm", (
        max(SLICES), 1e3 * MAX_SKEW_M)),
    (SENSORS, r"more than # rad in the shortest slice", (MAX_TURN_RAD,)),
    (SENSORS, r"points move by # cm at most", (100.0 * MAX_PATH_M,)),
    (BAKED, r"atlas has # million texels", (1e-6 * DEFAULT_TEXELS,)),
    (BAKED, r"casts # rays", (DEFAULT_SAMPLES,)),
    (WHY + "performance.md", r"take at most # MiB per camera", (MAX_COMMAND_BYTES >> 20,)),
)  # fmt: skip


@pytest.mark.parametrize(("page", "pattern", "values"), VALUES, ids=lambda one: str(one)[:60])
def test_pages_state_the_values_of_the_code(page, pattern, values):
    for stated, true in zip(numbers_of(page, pattern), values, strict=True):
        assert abs(float(stated) - true) <= half_unit(stated) + 1e-9, f"{stated}, {true}"


def test_small_scenes_and_large_meshes():
    assert "a twentieth of its longest side" in words_of(ASSUMPTIONS)
    assert pytest.approx(1 / 20) == NEAR_PER_SIZE
    assert f"If {MAX_POLYGONS:_} polygons".replace("_", " ") in words_of(WHY + "optics.md")


def _materials(path):
    """Materials of a GLB file, from the JSON at its head."""
    data = path.read_bytes()
    return json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])["materials"]


def _has_gloss(material):
    extensions = material.get("extensions", {})
    specular = extensions.get("KHR_materials_specular", {}).get("specularFactor", 1.0)
    return specular > 0.0 and "KHR_materials_unlit" not in extensions


def test_words_on_built_in_scenes_are_those_of_their_files():
    page = dict(re.findall(r"\| (`[^|]*) \| ([^|]*) \|", words_of(HOW_TO + "light.md")))
    rendering = words_of(WHY + "rendering.md")
    glossy, by_key, by_materials = re.search(
        r"built-in scenes but (.*) are matte: (.*) by this key, (.*) because", rendering
    ).groups()
    assert f"surfaces are all matte, except in {glossy}" in words_of(HOW_TO + "light.md")
    assert f"Built-in scenes but {glossy} are matte" in words_of(HOW_TO + "troubleshooting.md")
    for path in sorted((ROOT / "scenes").glob("*/scene.toml")):
        scene = tomllib.loads(path.read_text(encoding="utf-8"))
        light, name = scene.get("light", {}), path.parent.name
        (stated,) = (words for names, words in page.items() if f"`{name}`" in names)
        assert ("baked with all bounces" in stated) == ("baked" in light), name
        assert ("`--sky none`" in stated) == ("sky" in scene), name
        has_key = light.get("shading") == "matte"
        has_gloss = any(map(_has_gloss, _materials(path.parent / scene["file"])))
        stated_names = by_key if has_key else glossy if has_gloss else by_materials
        assert f"`{name}`" in stated_names, name


GOALS = ("pyrender", "the paper's way", "Gazebo's way", "Embree, geometry")


def test_missed_goals_are_counted():
    """The words on the four goals of speed, against the benchmark's table below them."""
    page, reached = words_of("benchmarks/README.md"), []
    for name in GOALS:
        line = (
            rf"\| \w+: {name} to omnisim, [^|]*\|[^|]*\|[^|]*\| ≥ [\d.]+: (reached|[\d.]+ × off) \|"
        )
        goals = re.findall(line, page)
        assert len(goals) == 3
        reached.append(goals.count("reached"))
    assert reached == [2, 0, 0, 0]
    assert "20 times pyrender's speed is reached in two scenes of three. 4 times that of" in page
    assert "rays without colors are reached in none" in page


def _quoted(page, pattern):
    """Names in backticks within the first match of a pattern."""
    return set(re.findall(r"`([\w-]+)`", re.search(pattern, words_of(page)).group()))


def test_lists_in_pages_are_those_of_the_code():
    presets = _quoted(HOW_TO + "imperfect-cameras.md", r"The presets are .*?\. Your own TOML")
    assert presets == set(preset_names())
    assert _quoted(HOW_TO + "data-sets.md", r"(?<=`--to` writes).*?, the last") == set(LAYOUTS)
    assert set(EXPORTS) <= set(re.findall(r"[\w-]+", words_of(HOW_TO + "use-with.md")))
    back_ends = re.findall(r"^\| `(\w+)`, \w+ \|", text_of(HOW_TO + "choose.md"), re.MULTILINE)
    assert back_ends == list(get_args(BackendName))
    motions = re.findall(r"^\| `(\w+)` \|", text_of(HOW_TO + "moving-objects.md"), re.MULTILINE)
    assert set(motions) < set(ObjectTable.model_fields)


def test_checks_of_the_validation_are_listed():
    rows = re.findall(r"^\| `([\w-]+)` \| (.+) \|$", text_of(HOW_TO + "validate.md"), re.MULTILINE)
    assert rows == [(check.key, check.title) for check in CHECKS]


def test_topics_of_bags_are_listed():
    known = set(re.findall(r"`(/[^`]+)`", bag_format.__doc__))
    assert known <= set(re.findall(r"`(/[^`]+)`", text_of(HOW_TO + "use-with.md")))


def test_extras_in_the_table_are_those_of_the_package():
    table = tomllib.loads(text_of("pyproject.toml"))["project"]["optional-dependencies"]
    rows = re.findall(r"^\| `([\w-]+)` \|", text_of(HOW_TO + "install.md"), re.MULTILINE)
    assert set(rows) == set(table)
    (all_of,) = table["all"]
    assert set(rows[: rows.index("all")]) == set(re.findall(r"\w+", all_of.partition("[")[2]))
