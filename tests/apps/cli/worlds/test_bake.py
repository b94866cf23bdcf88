"""`omnisim bake`: estimates, finished bakes, and other bakes in their place."""

import pytest

pytest.importorskip("embreex")
pytest.importorskip("xatlas")


@pytest.mark.slow
def test_the_command_says_how_long_it_takes_and_when_there_is_nothing_to_do(
    ran, quiet, refused, tmp_path
):
    bake = ["bake", "compass", "--texel-m", "1", "--samples", "2", "--bounces", "0"]
    assert ran(*bake, "--estimate")[0].startswith("compass: about ")
    assert not list(tmp_path.iterdir())
    out, error = ran(*bake, "-o", "a.baked")
    assert (out[:8], error[:12]) == ("a.baked:", "note: about ")
    assert quiet(*bake, "-o", "a.baked") == "a.baked: already baked; nothing to do\n"
    assert "pass --force" in refused("bake", "rings", "-o", "a.baked")
    line = refused("render", "rings", "--baked", "a.baked", "-o", "a.png")
    assert line.endswith("run `omnisim bake rings -o a.baked --force`")
    assert refused("bake", "compass") == "-o: missing: expected the folder of the bake"
