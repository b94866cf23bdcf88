"""The wheel: it has shaders and scenes, and works without the checkout."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    pytest.importorskip("hatchling", reason="hatchling, which builds the wheel, is not installed")
    code = f"from hatchling.build import build_wheel; print(build_wheel({str(folder)!r}))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder / done.stdout.split()[-1]


def test_wheel_has_every_shader_and_scene_and_is_small(wheel):
    assert wheel.stat().st_size < 10.5e6
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    shipped = [path for path in (ROOT / "shaders").rglob("*") if path.is_file()]
    kinds = ".glb", ".toml", ".exr", ".npz", ".json"  # the latter three of baked light
    shipped += [path for path in (ROOT / "scenes").rglob("*") if path.suffix in kinds]
    shipped += [path for path in (ROOT / "omnisim").rglob("*.toml")]
    shipped += [ROOT / "omnisim" / "apps" / "live" / "presets.json"]
    shipped += [path for path in (ROOT / "omnisim" / "apps" / "live" / "page").iterdir()]
    assert len(shipped) > 10
    for path in shipped:
        relative = path.relative_to(ROOT).as_posix().removeprefix("omnisim/")
        assert f"omnisim/{relative}" in names


@pytest.mark.slow
def test_installed_wheel_renders_without_the_checkout(wheel, tmp_path, needs_opengl):
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    code = (
        "import sys; sys.path.insert(0, 'site')\n"
        "import omnisim; assert 'site' in omnisim.__file__, omnisim.__file__\n"
        "scene = omnisim.load_scene('courtyard')\n"
        "with omnisim.open_sensor(scene, omnisim.OmniCamera().resized(64)) as renderer:\n"
        "    renderer.render(omnisim.pose((0, 0, 1))).save('a.png')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.png").stat().st_size > 1000
