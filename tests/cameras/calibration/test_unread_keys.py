"""Each key of each format changes the camera, is named in a notice, or is known to be harmless."""

import copy
import re
from itertools import chain
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import pytest

from omnisim.cameras import calibration
from omnisim.cameras.calibration import FORMATS
from omnisim.cameras.calibration.calibration_formats import detect_format
from omnisim.cameras.calibration.documents import read_text
from omnisim.core.errors import CalibrationError
from tests.cameras.calibration.sample_files import EXACT_SAMPLES

POSE = [[1.0, 0.0, 0.0, 0.1], [0.0, 1.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.3], [0.0, 0.0, 0.0, 1.0]]
STEREO = [400.0, 0.0, 320.0, -50.0, 0.0, 400.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
# Valid values of read keys; others are changed, or get a number, which may be an error.
VALUES = {
    "camera_angle_x": 1.0, "camera_angle_y": 1.0, "x_fov": 50.0, "y_fov": 50.0, "is_fisheye": False,
    "p1": 0.1, "p2": 0.1, "T_cn_cnm1": POSE, "T_imu_cam": POSE,
    "T_cam_imu": POSE, "timeshift_cam_imu": 0.01, "camera_name": "other", "frame_id": "other",
    "header": {"frame_id": "other"}, "P": STEREO, "projection_matrix": {"data": STEREO},
    "omnisim_poses_not_known": True, "distortion_coeffs": [0.1] * 4, "lens/cutoff_angle": "0.3",
    "fisheye_params": {"camera_matrix": [[9, 0, 3], [0, 9, 3], [0, 0, 1]],
                       "distortion_coeffs": [0.1] * 4},
    "lens/type": "equisolid_angle", "lens/scale_to_hfov": "false", "image_size": [7, 7],
}  # fmt: skip
REPLACED = {
    "lens/custom_function/f", "lens/scale_to_hfov",  # by field of view or intrinsics
    "apiSchemas",  # by model
    "Camera", "Stereo", "IMU",  # tables, whose keys are changed one by one
}  # fmt: skip


def changed(value):
    """Another value of the same kind."""
    match value:
        case bool():
            return not value
        case int():
            return value + 1
        case float():
            return value * 1.01 + 0.01
        case str():
            return value + "x"
        case [first, *others]:
            return [changed(first), *others]
        case dict() if value:
            *_, key = value
            return {**value, key: changed(value[key])}
    return [9.0]


def places(form, document):
    """Mappings or elements of a document that have keys, and their tables."""
    if isinstance(document, Element):
        table = form.tables[0].inner["*"]
        cameras = document.iter("camera")
        return [(camera, table) for camera in cameras if camera.find("horizontal_fov") is not None]
    return list(_mappings(document, form.table_of(document)))


def _mappings(data, table):
    if isinstance(data, list):
        data = data[0] if data else None
    if isinstance(data, dict) and table is not None:
        yield data, table
        for key, value in data.items():
            inner = table.inner.get(key, table.inner.get("*"))
            if inner is not None and table.reads(key, value):
                yield from _mappings(value, inner)


def with_key(place, key, value=None):
    """Set a key; without a value, to another one than it has."""
    if isinstance(place, dict):
        place[key] = changed(place.get(key)) if value is None else value
        return
    for tag in key.split("/"):
        child = place.find(tag)
        place = SubElement(place, tag) if child is None else child
    text = (place.text or "").strip()
    number = float(text) if text.replace(".", "").isdecimal() else 0.5
    place.text = str(changed(number) if value is None else value)


def outcome(form, document):
    """Cameras and notices of a document, or its error."""
    document = copy.deepcopy(document)
    try:
        cameras = form.read(document, "file")
        notices = form.notices(document, "file")
    except CalibrationError as error:
        return "error", [str(error)]
    described = [
        (camera.name, camera.lens.parameters(), camera.time_shift_s, camera.notes,
         [(pose.target, pose.source, pose.target_from_source.tolist()) for pose in camera.poses])
        for camera in cameras
    ]  # fmt: skip
    return described, notices


@pytest.fixture(params=EXACT_SAMPLES, ids=lambda path: path.name)
def sample(request):
    """Format, document, and outcome of the document with another key."""
    text = read_text(request.param)
    form = detect_format(text, str(request.param))
    document = form.document(text, str(request.param))

    def outcome_with(number, key, value=None):
        other = copy.deepcopy(document)
        with_key(places(form, other)[number][0], key, value)
        return outcome(form, other)

    tables = places(form, document) if form.tables else []
    return form, outcome(form, document), [table for _, table in tables], outcome_with


def test_a_key_that_is_read_changes_the_camera_or_is_named(sample):
    _, before, tables, outcome_with = sample
    assert before[0] != "error"
    ignored = [
        (number, key)
        for number, table in enumerate(tables)
        for key in table.model_fields.keys() | table.also_read
        if key not in REPLACED and outcome_with(number, key, VALUES.get(key)) == before
    ]
    assert ignored == []


def test_a_key_that_is_not_read_is_named(sample):
    form, before, tables, outcome_with = sample
    for number, table in enumerate(tables):
        names = {key: meaning for key, meaning in table.unread.items() if not table.reads(key, 0)}
        for key, meaning in names.items():
            cameras, notes = outcome_with(number, key, 7.5)
            assert (cameras == "error") == meaning.is_fault, key
            assert any(key in note and meaning.effect in note for note in notes), key
            if not any(key in note for note in before[1]):
                assert outcome_with(number, key, 0) == before, key
        if "*" not in table.inner:
            cameras, notes = outcome_with(number, "no_such_key", 1)
            assert cameras == before[0]
            assert any("no_such_key" in note and form.name in note for note in notes)


def test_a_harmless_key_is_harmless(sample):
    _, before, tables, outcome_with = sample
    for number, table in enumerate(tables):
        for key in table.harmless:
            if not table.reads(key, 0):
                assert outcome_with(number, key, 7.5) == before, (number, key)


def all_tables(roots):
    """Schemas of a format, inner ones too."""
    return chain.from_iterable((root, *all_tables(root.inner.values())) for root in roots)


def test_readme_lists_the_keys_of_each_format():
    readme = Path(calibration.__file__).with_name("README.md").read_text(encoding="utf-8")
    rows = dict[str, list[set[str]]]()
    for line in re.findall(r"^\| \w.*`.* \|$", readme.partition("## Keys")[2], re.M):
        names, *cells = line.strip("| ").split(" | ")
        for name in names.split():
            rows[name] = [set(re.findall("`(.*?)`", cell)) for cell in cells]
    assert rows.keys() == {name for name, form in FORMATS.items() if form.tables}
    for name, documented in rows.items():
        family = [form for other, form in FORMATS.items() if rows.get(other) == documented]
        tables = [table for form in family for table in all_tables(form.tables)]
        read = {key for one in tables for key in (*one.model_fields, *one.also_read, *one.inner)}
        unread = [one.unread.items() for one in tables]
        expected = [
            {key for items in unread for key, one in items if not one.is_fault} - read,
            {key for items in unread for key, one in items if one.is_fault} - read,
            {key for one in tables for key in one.harmless} - read,
        ]
        assert documented == [read - {"*"}, *expected], name
