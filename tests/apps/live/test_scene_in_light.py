"""Light of the live page: tables of a scene's TOML, and the same image by the command line."""

import shlex

import numpy as np
import pytest

from omnisim.apps.cli.app import main
from omnisim.apps.live.camera_document import CameraDocument, SceneInLight, without_overridden
from omnisim.apps.live.live_source import LiveSource
from omnisim.apps.live.session import PageDraw, PageState
from omnisim.apps.live.viewpoint_motion import Place
from omnisim.core.errors import SceneError
from omnisim.core.files.image_files import read_image
from omnisim.scene import read_scene
from tests.apps.live.pages import live_settings


def _light():
    return SceneInLight("rings", lambda path, tables: read_scene(path))


def _take(source, document):
    return source.take(PageDraw(PageState(document, Place((0.0, 0.0, 0.5))), True), ())


def test_fog_begins_with_the_keys_that_it_must_have():
    document = CameraDocument().with_value("scene.fog", {})
    assert document.value("scene.fog.visibility_m") == 20.0
    document = document.with_value("scene.fog.attenuation_per_m", [0.1, 0.1, 0.1])
    assert document.value("scene.fog.visibility_m") is None
    assert not document.with_value("scene.fog", None).light


def test_light_without_a_value_is_the_scenes_own():
    document = CameraDocument().with_value("scene.light.exposure", 2.0)
    assert document.light == {"light": {"exposure": 2.0}}
    assert not document.with_value("scene.light.exposure", None).light


def test_a_value_that_cannot_be_names_its_key():
    with pytest.raises(SceneError, match=r"^scene\.sky\.turbidity: expected"):
        _light().scene({"sky": {"turbidity": 1.0}})


def test_options_give_way_to_tables():
    words = ("--sky", "clear", "--baked", "light", "--up-axis", "y")
    assert without_overridden(words, {"fog": {}}) == words
    assert without_overridden(words, {"light": {}}) == ("--sky", "clear", "--up-axis", "y")
    assert without_overridden(words, {"sky": {}}) == ("--up-axis", "y")


@pytest.mark.usefixtures("needs_opengl")
def test_the_command_renders_the_same_image(tmp_path, monkeypatch):
    settings = live_settings("rings", light=_light())
    own = settings.document
    document = own.with_value("scene.sky", {}).with_value("scene.sky.sun_elevation_deg", 30.0)
    document = document.with_value("scene.fog", {}).with_value("scene.fog.visibility_m", 8.0)
    source = LiveSource(settings)
    try:
        before = _take(source, own).rgb
        taken = _take(source, document)
        command = source.command(PageState(document, Place((0.0, 0.0, 0.5))), taken)
        with pytest.raises(SceneError):
            source.use(document.with_value("scene.fog.visibility_m", -1.0))
        np.testing.assert_array_equal(_take(source, document).rgb, taken.rgb)  # it stays
        np.testing.assert_array_equal(_take(source, own).rgb, before)
    finally:
        source.close()
    assert np.abs(taken.rgb.astype(int) - before).mean() > 5.0
    file, words = command.split("\nEND\n")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(file.partition("\n")[2] + "\n")
    monkeypatch.setattr("sys.argv", shlex.split(words))
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    np.testing.assert_array_equal(read_image(tmp_path / "image.png")[0], taken.rgb)
