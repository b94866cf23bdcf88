"""`omnisim bake`: estimates, finished bakes, and other bakes in their place."""

import pytest

pytest.importorskip("embreex")
pytest.importorskip("xatlas")


@pytest.mark.slow
def test_the_command_says_how_long_it_takes_and_when_there_is_nothing_to_do(omnisim, tmp_path):
    bake = ["bake", "compass", "--texel-m", "1", "--samples", "2", "--bounces", "0"]
    status, out, _ = omnisim(*bake, "--estimate")
    assert (status, out[:15]) == (0, "compass: about ")
    assert not list(tmp_path.iterdir())
    status, out, error = omnisim(*bake, "-o", "a.baked")
    assert (status, out[:8], error[:12]) == (0, "a.baked:", "note: about ")
    status, out, _ = omnisim(*bake, "-o", "a.baked")
    assert (status, out) == (0, "a.baked: already baked; nothing to do\n")
    status, _, error = omnisim("bake", "rings", "-o", "a.baked")
    assert (status, "expected --force" in error) == (1, True)
    status, _, error = omnisim("render", "rings", "--baked", "a.baked", "-o", "a.png")
    assert (status, error.endswith("run `omnisim bake rings -o a.baked --force`\n")) == (1, True)
    status, _, error = omnisim("bake", "compass")
    assert (status, error) == (1, "error: -o: expected the folder of the bake\n")
