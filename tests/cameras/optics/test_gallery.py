"""Gallery of the examples, against their files."""

import importlib.util
from pathlib import Path

import pytest
from PIL import Image

from tests.cameras.optics.examples import EXAMPLES

MAKER = Path(__file__).resolve().parents[3] / ".ci" / "make_optics_gallery.py"
RENEW = "make gallery renews it"


@pytest.fixture(scope="module")
def maker():
    if not MAKER.is_file():
        pytest.skip("the gallery is a part of the checkout, not of the package")
    spec = importlib.util.spec_from_file_location("make_optics_gallery", MAKER)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_example_is_shown(maker):
    assert {path.stem for path in EXAMPLES} == set(maker.ORDER)
    page = (maker.FOLDER / "README.md").read_text(encoding="utf-8")
    for name in maker.ORDER:
        assert maker.title_of(name) in page, RENEW
        assert f"`examples/optics/{name}.toml`" in page, RENEW
        system = maker.system_of(name)
        with Image.open(maker.IMAGES / f"{name}.jpg") as image:
            assert image.size == (system.width_px, system.height_px), RENEW
        assert (maker.IMAGES / f"{name}.jpg").stat().st_size <= maker.MAX_BYTES
        assert (maker.IMAGES / f"{name}-plot.png").is_file()


@pytest.mark.slow
@pytest.mark.long
def test_page_is_up_to_date(maker):
    errors, chosen = maker.mesh_errors()
    page = (maker.FOLDER / "README.md").read_text(encoding="utf-8")
    assert page == maker.page(errors, chosen), RENEW
