"""A stage's instruments have their own types, without casts: as mypy sees them."""

from pathlib import Path

import pytest

from tests.rendering import opened_types

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
@pytest.mark.long
def test_each_sensor_opens_as_its_own_instrument(monkeypatch):
    """`make lint` checks the same file, with the package."""
    api = pytest.importorskip("mypy.api")
    monkeypatch.chdir(ROOT)
    output, errors, status = api.run([str(Path(opened_types.__file__).relative_to(ROOT))])
    assert status == 0, output + errors


def test_no_type_is_asserted_by_hand_between_a_sensor_and_its_instrument():
    for name in ("stage", "sensor", "instrument", "renderer"):
        text = (ROOT / "omnisim" / "rendering" / f"{name}.py").read_text(encoding="utf-8")
        assert "cast(" not in text, name
        assert "hasattr(" not in text, name
