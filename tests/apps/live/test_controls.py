"""Controls: one for each key of the schemas, with its limits, unit and help."""

import pytest

from omnisim.apps.live.camera_document import CameraDocument, preset_lists, with_preset
from omnisim.apps.live.controls import control_groups
from omnisim.core.files.parameters import table_of
from omnisim.core.files.table_faults import table_in
from omnisim.rendering.camera.degradations.degradation_file import EFFECTS
from omnisim.rendering.camera.sensor_file import CameraTable, MirrorTable, VirtualCamerasTable

PRESETS = [(kind, name) for kind, names in preset_lists().items() for name in names]


def _controls(document):
    def inner(groups):
        for group in groups:
            yield from group["controls"]
            yield from inner(group["groups"])

    controls = inner(control_groups(document, document.camera()))
    return {control["path"]: control for control in controls}


@pytest.mark.parametrize(("kind", "name"), PRESETS)
def test_every_number_of_a_camera_has_a_control(kind, name):
    document = with_preset(CameraDocument(), kind, name)
    found = _controls(document)
    model = document.camera().model
    if kind == "lens" and name != "paper":
        few = {
            key
            for key, value in model.parameters().items()
            if not isinstance(value, list) or 0 < len(value) <= 12
        }
        assert few == {path.split(".")[-1] for path in found if ".lens." in path} & few
    for control in found.values():
        soft = control["soft"]
        if soft is not None:
            assert soft["low"] < soft["high"], control
            assert not soft["log"] or soft["low"] > 0.0, control


def test_every_key_of_a_sensor_file_has_a_control_with_help():
    found = _controls(CameraDocument())
    tables = {"mirror": MirrorTable, "camera": CameraTable, "virtual_cameras": VirtualCamerasTable}
    for key, table in tables.items():
        for name, field in table.model_fields.items():
            if table_in(field.annotation) is None:
                assert found[f"sensor.{key}.{name}"]["help"], name


def test_every_key_of_every_effect_has_a_control_with_help():
    tables = {name: {} for name in EFFECTS}
    tables["noise"] = {"full_well_e": 20000.0}
    tables["shutter"] = {"exposure_s": 0.01}
    tables["chromatic_aberration"] = {"red_offsets_px": [0.1, 0.2], "blue_offsets_px": [-0.1]}
    tables |= {"defocus": {"rim_defocus_px": 1.0}, "reflectance": {"reflectance": 0.9}}
    groups = control_groups(CameraDocument({"degradation": tables}), CameraDocument().camera())
    (effects,) = [group["groups"] for group in groups if group["title"] == "Degradation"]
    assert [group["on"] for group in effects] == [True] * len(EFFECTS)
    for group, (name, effect) in zip(effects, EFFECTS.items(), strict=True):
        labels = {control["label"] for control in group["controls"]}
        have_rows = {"widths_px", "curve"}
        assert labels == set(table_of(effect).model_fields) - have_rows, name
        assert all(control["help"] for control in group["controls"]), name


def test_limits_units_and_values_are_those_of_the_schema():
    found = _controls(CameraDocument().with_value("sensor.mirror.k", 8.0))
    k, rim = found["sensor.mirror.k"], found["sensor.mirror.rim_radius_m"]
    assert (k["low"], k["low_open"], k["high"]) == (2.0, False, 1e6)
    assert (k["value"], k["default"]) == (8.0, 11.546)
    assert (rim["unit"], rim["low"], rim["low_open"], rim["value"]) == ("m", 0.0, True, None)
    assert rim["effective"] == pytest.approx(CameraDocument().with_value(
        "sensor.mirror.k", 8.0).camera().model.mirror.rim_radius_m)  # fmt: skip
    assert found["sensor.camera.focal_length_px"]["choices"] == ["fit"]
    assert found["sensor.virtual_cameras.samples"]["choices"] == [1, 2, 4, 8]
    assert found["sensor.virtual_cameras.far_m"]["default"] == "inf"


def test_typical_values_of_the_help_are_the_sliders():
    document = CameraDocument({"degradation": {"dirt": {}}})
    assert _controls(document)["sensor.degradation.dirt.dust_count"]["soft"] == {
        "low": 0.0, "high": 300.0, "log": False,
    }  # fmt: skip
