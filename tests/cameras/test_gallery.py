"""Gallery page, against the models' docstrings."""

import importlib.util
import sys
from pathlib import Path

import pytest
from PIL import Image

from omnisim.cameras import CAMERA_MODELS

ROOT = Path(__file__).resolve().parents[2]
MAKER = ROOT / ".ci" / "make_gallery.py"


@pytest.fixture(scope="module")
def maker():
    if not MAKER.is_file():
        pytest.skip("the gallery is a part of the checkout, not of the package")
    spec = importlib.util.spec_from_file_location("make_gallery", MAKER)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_page_is_up_to_date(maker):
    page = maker.page(maker.gallery_cameras())
    renew = "make gallery renews it"
    assert (maker.FOLDER / "README.md").read_text(encoding="utf-8") == page, renew
    for part in ("\n\nDomain", "| parameter | meaning |", "Source:", "GLSL twin:"):
        assert page.count(part) == len(CAMERA_MODELS), part


def test_every_model_has_a_small_image(maker):
    for model, camera in maker.gallery_cameras().items():
        path = maker.FOLDER / f"{model}.jpg"
        assert path.stat().st_size <= maker.MAX_BYTES
        with Image.open(path) as image:
            assert image.size == (camera.width_px, camera.height_px)


def test_files_with_the_same_pixels_stay(maker, tmp_path):
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
