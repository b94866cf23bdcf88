"""Random scenes and sensors: both back ends show what own rays meet."""

import pytest

from tests.chance.run import KINDS, check_scenes

pytestmark = pytest.mark.usefixtures("needs_opengl")
pytest.importorskip("embreex", reason="embreex, which casts own rays, is missing")

SEED = 1


def _check(kind, numbers):
    counts, findings = check_scenes(kind, SEED, numbers)
    assert findings == []
    return counts


@pytest.mark.parametrize("number", range(3))
def test_lenses_show_what_own_rays_meet(number):
    """Three of nine kinds each."""
    assert _check("lenses", range(3 * number, 3 * number + 3))["pixels"] > 3000


def test_optics_show_what_own_rays_meet():
    assert _check("optics", range(2))["pixels"] > 1000


def test_lidars_meet_what_own_rays_meet():
    counts = _check("lidars", range(3))
    assert counts["beams"] > 300
    assert counts["moving objects"] > 0


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("part", range(2))
@pytest.mark.parametrize("kind", KINDS)
def test_many_scenes_show_what_own_rays_meet(kind, part):
    counts = _check(kind, range(100 + 20 * part, 120 + 20 * part))
    assert counts["pixels"] + counts["beams"] > 20_000
