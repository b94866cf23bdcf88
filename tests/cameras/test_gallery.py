"""Galleries of camera models and of optics, against docstrings and files."""

import importlib.util
import sys
from pathlib import Path

import pytest
from PIL import Image

from omnisim.cameras import CAMERA_MODELS
from tests.cameras.optics.examples import EXAMPLES

SCRIPTS = Path(__file__).resolve().parents[2] / ".ci"
RENEW = "make gallery renews it"


def _script(name):
    if not (SCRIPTS / name).is_file():
        pytest.skip("the gallery is a part of the checkout, not of the package")
    spec = importlib.util.spec_from_file_location(Path(name).stem, SCRIPTS / name)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def models():
    return _script("make_gallery.py")


@pytest.fixture(scope="module")
def optics():
    return _script("make_optics_gallery.py")


def _page(maker):
    return (maker.FOLDER / "README.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_page_is_up_to_date(models):
    page = models.page(models.gallery_cameras())
    assert _page(models) == page, RENEW
    for part in ("\n\nDomain", "| parameter | meaning |", "Source:", "GLSL twin:"):
        assert page.count(part) == len(CAMERA_MODELS), part


@pytest.mark.slow
@pytest.mark.long
def test_page_of_optics_is_up_to_date(optics):
    assert _page(optics) == optics.page(*optics.mesh_errors()), RENEW


def _check_image(path, camera, max_bytes):
    assert path.stat().st_size <= max_bytes
    with Image.open(path) as image:
        assert image.size == (camera.width_px, camera.height_px), RENEW


def test_every_model_has_a_small_image(models):
    for model, camera in models.gallery_cameras().items():
        _check_image(models.FOLDER / f"{model}.jpg", camera, models.MAX_BYTES)


def test_every_example_of_optics_is_shown(optics):
    assert {path.stem for path in EXAMPLES} == set(optics.ORDER)
    for name in optics.ORDER:
        assert optics.title_of(name) in _page(optics), RENEW
        assert f"`examples/optics/{name}.toml`" in _page(optics), RENEW
        _check_image(optics.IMAGES / f"{name}.jpg", optics.system_of(name), optics.MAX_BYTES)
        assert (optics.IMAGES / f"{name}-plot.png").is_file()


def test_files_with_the_same_pixels_stay(models, tmp_path):
    """Whatever the encoder and the driver's roundings; others are written."""
    pages = sys.modules["pages"]
    path = tmp_path / "a.png"
    image = Image.new("RGB", (40, 30), (90, 80, 70))
    pages.save_jpeg(image, path, 10**6)
    first = path.read_bytes()
    image.putpixel((3, 4), (96, 80, 70))
    pages.save_jpeg(image, path, 10**6, max_quality=88)
    assert path.read_bytes() == first
    image.paste((150, 80, 70), (0, 0, 9, 9))
    pages.save_jpeg(image, path, 10**6)
    assert path.read_bytes() != first
