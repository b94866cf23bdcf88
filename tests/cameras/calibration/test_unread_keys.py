"""Each key of each format changes the camera, is named in a notice, or is known to be harmless.

The tables of the formats state their keys, and README.md lists them. A new format fails here until
each of its tables is in a sample, and each key without effect that sounds like geometry has a
reason.
"""

import copy
import json
import re
from itertools import chain
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pydantic
import pytest

from omnisim.cameras import KannalaBrandtCamera, UnifiedCamera, calibration
from omnisim.cameras.calibration import (
    FORMATS,
    CalibratedCamera,
    Calibration,
    NamedPose,
    calibration_text,
)
from omnisim.cameras.calibration.calibration_formats import detect_format
from omnisim.cameras.calibration.documents import ForeignTable, read_text
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
    "MaxSolidAngle": 1.0,
}  # fmt: skip
REPLACED = {
    "lens/custom_function/f", "lens/scale_to_hfov",  # by field of view or intrinsics
    "apiSchemas",  # by model
    "DeviceClassInfo", "DeviceClass",  # by ConfigData; see test_photogrammetry.py
}  # fmt: skip

TURNED = [[0.0, -1.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.3], [0.0, 0.0, 0.0, 1.0]]
FISHEYE = KannalaBrandtCamera(640, 480, (300.0, 301.0), (319.5, 240.5), (0.01, 0.002, 1e-3, 1e-4))
PINHOLE = UnifiedCamera(640, 480, (400.0, 401.0), (319.5, 240.5), 0.0, (0.1, 0.02, 1e-3, 2e-3))


def written(form, lens):
    """Text that omnisim writes of a lens with a pose."""
    camera = CalibratedCamera("cam0", lens, (NamedPose("imu", "cam0", np.array(TURNED)),))
    return calibration_text(Calibration((camera,)), form)[0]


# Texts by name: the samples, what omnisim writes, and kinds of files that both lack.
TEXTS = {path.name: read_text(path) for path in EXACT_SAMPLES} | {
    f"{name}-{lens.model_name}": written(name, lens)
    for name, form in FORMATS.items()
    for lens in (FISHEYE, PINHOLE)
    if isinstance(lens, tuple(form.models)) and form.unsupported(lens) is None
}
TEXTS["run"] = json.dumps({"camera": PINHOLE.parameters(), "base_from_optical": POSE})
TEXTS["vins"] = TEXTS["kitti360_image_02.yaml"] + "".join(
    f"\n{key}: !!opencv-matrix\n  rows: 1\n  cols: {len(data)}\n  dt: d\n  data: {data}\n"
    for key, data in (
        ("extrinsicRotation", np.ravel(np.array(TURNED)[:3, :3]).tolist()),
        ("extrinsicTranslation", [0.1, 0.2, 0.3]),
        ("body_T_cam0", np.ravel(TURNED).tolist()),
    )
)
TEXTS["newton"] = """#usda 1.0
def Camera "cam0" (
    prepend apiSchemas = ["OmniLensDistortionKannalaBrandtK3API"]
)
{
    token omni:lensdistortion:model = "kannalaBrandtK3"
    float omni:lensdistortion:kannalaBrandtK3:k0 = 500
    float omni:lensdistortion:kannalaBrandtK3:k1 = 20
    matrix4d xformOp:transform = ( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 2, 3, 1) )
}
"""
TEXTS["metashape-sensor"] = """<calibration><projection>fisheye</projection>
<resolution width="640" height="480"/><f>300</f></calibration>"""
TEXTS["matlab-parameters"] = f'{{"Intrinsics": {TEXTS["matlab_pinhole.json"]}}}'
OPENSFM = {"projection_type": "fisheye", "width": 64, "height": 48, "focal": 0.3}
AT = {"rotation": [0.1, 0.2, 0.3], "translation": [1.0, 2.0, 3.0]}
TEXTS["reconstruction"] = json.dumps([{
    "cameras": {"a": OPENSFM},
    "shots": {"1.jpg": {"camera": "a", **AT}, "2.jpg": {"camera": "a", **AT}},
    "rig_cameras": {"front": AT, "back": AT},
    "rig_instances": {"0": {**AT, "rig_camera_ids": {"1.jpg": "front", "2.jpg": "back"}}},
}])  # fmt: skip
FRAME = {"file_path": "a", "transform_matrix": POSE}
PANORAMA = {"camera_model": "EQUIRECTANGULAR", "w": 8, "h": 4, "fl_x": 4.0}
TEXTS["panorama"] = json.dumps({**PANORAMA, "frames": [FRAME]})
TEXTS["nerf-synthetic"] = json.dumps({"camera_angle_x": 0.7, "w": 8, "h": 6, "frames": [FRAME]})


def changed(value):
    """Another value of the same kind."""
    match value:
        case bool():
            return not value
        case int():
            return value + 1
        case float():
            return value * 1.01 + 0.0123
        case str():
            return value + "x"
        case [first, *others]:
            return [changed(first), *others]
        case dict() if value:
            return {key: changed(inner) for key, inner in value.items()}
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


def form_and_document(name):
    form = detect_format(TEXTS[name], name)
    return form, form.document(TEXTS[name], name)


@pytest.fixture(params=TEXTS)
def sample(request):
    """Format, outcome, tables, and outcome with another key."""
    form, document = form_and_document(request.param)

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
        if key not in REPLACED | SWITCHES and outcome_with(number, key, VALUES.get(key)) == before
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


# What makes silent keys impossible in formats to come, too.


KEYLESS = {
    "colmap",
    "ocamcalib",
    "insta360",
    "blender_osl",
}  # formats whose numbers stand in a fixed order, without keys
# Tables that tell by themselves which of their keys are cameras.
OWN_READS = {
    "kalibr._Chain", "gazebo._Cameras", "opensfm._ByName", "opensfm._OpensfmCamera",
    "openmvg._ByName", "euroc._Chain", "nurec._Calibrations",
    "metashape._File",  # a project's document, whose sensors have calibrations
}  # fmt: skip
# Keys of which one value says what holds without them.
SWITCHES = {"is_fisheye", "latlong", "omnisim_poses_not_known"}
# Keys that say something about what another states, and nothing without it.
ABOUT = {
    "file_path": "transform_matrix", "prim:parent": "xformOp:transform",
    "rig_cameras": "rig_instances shots", "rig_instances": "shots",
}  # fmt: skip
# Values of keys without a sample: those that a key takes are tried.
ANY_VALUES = (0.37, 7, True, "other", [0.1] * 4, POSE, {"rows": 1}, [[600, 400]])
# Words of keys that change rays, poses or times, unless a reason says why they do not.
GEOMETRY = re.compile(
    r"foc|fov|f[xy]$|c[xy]$|angle|theta|lens|dist|fish|(?<!pur)pose|transf|rotat|transl|posit|orient|ax[ie]s"
    r"|^up$|skew|crop|roi|matrix|intrin|extrin|offset|scale|center|princip|resol|size|dim|width"
    r"|height|aspect|aperture|shutter|rolling|time|baseline|stretch|radial|mirror|flip|k\d$|p\d$"
    r"|^T_|^R$|lens/.*/t[xy]$|stereo|bf$",
    re.I,
)
# Keys that sound so and have no effect, by their formats, and why.
REASONS = {
    "ros foxglove": {
        "R rectification_matrix": "turns rectified images, not the camera's",
        "timestamp": "when it was calibrated",
    },
    "opencv_omnidir opencv_fisheye opencv_pinhole": {
        "Board_Height Board_Width Square_Size board_height board_size board_width square_size "
        "Extrinsic_Parameters extrinsic_parameters": "the board, and its poses",
        "aspectRatio fixed_aspectRatio": "constraint of the calibration; the matrix is its result",
        "calibration_time": "when it was calibrated",
    },
    "basalt": {
        "T_imu_marker T_mocap_world mocap_time_offset_ns mocap_to_imu_offset_ns": "motion capture",
    },
    "nerfstudio": {
        "aabb_scale scale offset up render_aabb": "the volume of instant-ngp around the cameras",
        "applied_transform auto_scale_poses_override orientation_override": "poses are the file's",
        "integer_depth_scale n_extra_learnable_dims": "depth images, and learned appearance",
        "rotation time timestamp": "of instant-ngp's volume; when an image was taken",
    },
    "gyroflow": {
        "crop_factor focal_length": "in millimeters; the matrix is in pixels",
        "global_shutter": "no rolling shutter, as of any camera in omnisim without one",
        "orig_dimension output_dimension": "the matrix is of images of calib_dimension",
        "radial_distortion_limit": "the fold, which follows from the coefficients",
        "use_opencv_fisheye": "the lens that is read",
    },
    "gazebo": {
        "distortion/center": "of a distortion, which is refused",
        "lens/env_texture_size": "resolution of the cube map",
        "lens/projection/p_cx lens/projection/p_cy lens/projection/p_fx lens/projection/p_fy "
        "lens/projection/tx lens/projection/ty": "of the CameraInfo, not of the image",
    },
    "opensfm": {
        "capture_time gps_position orientation scale": "of an image, and of a mesh",
        "focal_prior focal_x_prior focal_y_prior": "where the bundle adjustment started",
        "rotation translation": "of an instance of a rig, whose shots have their own",
    },
    "orbslam3": {
        "Frequency": "of the IMU",
        "bFishEye": "of earlier examples; ORB-SLAM3 does not read it",
        "imageScale newHeight newWidth": "images that it scales, with their camera",
    },
    "nurec": {"T_world_base": "of trajectories, which are not read"},
    "aria": {"tracking_timestamp_us utc_timestamp_ns": "when it was calibrated"},
    "matlab": {
        "FocalLength PrincipalPoint Skew": "K states them, and is required",
        "EstimateSkew EstimateTangentialDistortion NumRadialDistortionCoefficients": "options",
        "PatternExtrinsics RotationMatrices RotationVectors TranslationVectors": "of the board",
    },
    "isaac": {
        "focalLength focusDistance horizontalAperture horizontalApertureOffset verticalAperture "
        "verticalApertureOffset": "USD's own pinhole camera, which the lens's schema replaces",
        "xformOp:scale": "moves no ray of a camera",
    },
}


def called(form, table):
    return f"{form.name}.{table.__name__}"


def lines(items):
    return "\n".join(sorted(map(str, items)))


def test_a_format_without_keys_is_known():
    assert {form.name for form in FORMATS.values() if not form.tables} <= KEYLESS


def test_a_table_that_decides_by_itself_is_known():
    own = {
        called(form, table)
        for form in FORMATS.values()
        for table in all_tables(form.tables)
        if table.reads.__func__ is not ForeignTable.reads.__func__
    }
    assert own <= OWN_READS


def test_each_table_of_each_format_is_in_a_sample():
    tried = set(OWN_READS)
    for name in TEXTS:
        form, document = form_and_document(name)
        tried |= {called(form, table) for _, table in places(form, document) if form.tables}
    tables = {called(form, table) for form in FORMATS.values() for table in all_tables(form.tables)}
    assert lines(tables - tried) == ""


@pytest.mark.parametrize("form", FORMATS.values(), ids=FORMATS)
def test_a_key_that_sounds_like_geometry_has_a_reason_to_be_harmless(form):
    given = (keys for names, keys in REASONS.items() if form.name in names.split())
    reasons = set(" ".join(" ".join(keys) for keys in given).split())
    harmless = {key for table in all_tables(form.tables) for key in table.harmless}
    read = {key for table in all_tables(form.tables) for key in table.model_fields}
    suspicious = {key for key in harmless - read if GEOMETRY.search(key)}
    assert lines(suspicious - reasons) == ""


def values_of(table, key, current):
    """Values to try in place of the current one, or of none."""
    if key in SWITCHES:
        return [True, False]
    if key in VALUES and VALUES[key] != current:
        return [VALUES[key]]
    field = table.model_fields.get(key)
    if current is not None or field is None:
        return [changed(current)]
    adapter = pydantic.TypeAdapter(table)
    known = {name: None for name in table.model_fields}
    found = []
    for value in ANY_VALUES:
        try:
            adapter.validate_python({**known, key: value})
        except pydantic.ValidationError as error:
            if any(part["loc"][0] == key for part in error.errors()):
                continue
        if value != field.default:
            found.append(value)
    return found or [changed(None)]


def test_a_key_is_read_or_named_where_others_are_left_out(sample_document):
    """As `camera_angle_y` is in a file with `camera_angle_x` and without focal lengths."""
    form, document = sample_document
    tables = [table for _, table in places(form, document)]
    ignored = set()
    for number, table in enumerate(tables):
        keys = sorted((table.model_fields.keys() | table.also_read) - REPLACED)
        here = places(form, document)[number][0]
        bases = [document]
        for left_out in (key for key in keys if key in here):
            less = copy.deepcopy(document)
            del places(form, less)[number][0][left_out]
            if outcome(form, less)[0] != "error":
                bases.append(less)
                continue
            for instead in (key for key in keys if key not in here):
                other = copy.deepcopy(less)
                value = values_of(table, instead, None)[0]
                value = 1.5 * value if isinstance(value, float) else value  # as no other has
                with_key(places(form, other)[number][0], instead, value)
                if outcome(form, other)[0] != "error":
                    bases.append(other)
        for base in bases:
            before, at = outcome(form, base), places(form, base)[number][0]
            for key in keys:
                if not at.keys() >= set(ABOUT.get(key, "").split()):
                    continue
                effects = []
                for value in values_of(table, key, at.get(key)):
                    other = copy.deepcopy(base)
                    with_key(places(form, other)[number][0], key, value)
                    effects.append(outcome(form, other) != before)
                if not effects or not (any if key in SWITCHES else all)(effects):
                    ignored.add((called(form, table), key, *sorted(here.keys() - at.keys())))
    assert lines(ignored) == ""


@pytest.fixture(params=TEXTS)
def sample_document(request):
    form, document = form_and_document(request.param)
    if not isinstance(document, dict):
        pytest.skip("without keys, or of elements, which are tried one by one")
    return form, document


@pytest.mark.parametrize("name", TEXTS)
def test_a_number_without_a_key_changes_the_camera(name):
    form, document = form_and_document(name)
    if form.tables or name.startswith("blender_osl"):
        pytest.skip("with keys, or a program")
    before, ignored = outcome(form, document), []
    for found in re.finditer(r"(?<![\w.+-])[-+]?\d[\d.]*(e[-+]?\d+)?(?![\w.])", document):
        line = document[document.rfind("\n", 0, found.start()) + 1 : found.start()]
        number = float(found[0])
        other = str(int(number) + 1) if found[0].isdecimal() else repr(2.0 * number + 1.0)
        text = f"{document[: found.start()]}{other}{document[found.end() :]}"
        if "#" not in line and outcome(form, text) == before:
            ignored.append((found.start(), found[0]))
    assert ignored == []


def test_an_unknown_key_among_cameras_is_named_or_refused(sample):
    _, before, tables, outcome_with = sample
    for number, table in enumerate(tables):
        if "*" in table.inner:
            assert outcome_with(number, "no_such_key", 1) != before
