"""Who may import whom: imports point down only, and each library has one home."""

import ast
from pathlib import Path

import pytest

import omnisim

PACKAGE = Path(omnisim.__file__).parent
# From the top down; a module may import from layers below its own, and from its own folder.
LAYERS = (
    {"cli"},
    {"validation", "experiments"},
    {"plots"},
    {"simulation"},
    {"sensors", "perception", "localization", "robot"},
    {"gpu"},
    {"calibration"},
    {"scene", "cameras"},
    {"mirrors"},
    {"frame"},
    {"ground_truth"},
    {"image_files"},
    {"atomic_file", "frames", "cube", "srgb", "resources", "toml_file"},
    {"errors"},
)
HOMES = {
    "moderngl": {"gpu"},
    "trimesh": {"scene"},
    "PIL": {"scene"},
    "OpenImageIO": {"image_files"},
    "typer": {"cli"},
    "rich": {"cli"},
    "matplotlib": {"plots", "validation"},
    "jinja2": {"validation", "experiments"},
    "av": {"plots"},
    "cv2": {"validation"},
    "mitsuba": {"validation"},
    "pyrender": {"validation"},
    "pycolmap": {"validation"},
    "yaml": {"calibration"},
}
MODULES = sorted(PACKAGE.rglob("*.py"))


def _imports(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            if node.module == "omnisim":
                yield from (f"omnisim.{alias.name}" for alias in node.names)
            else:
                yield node.module or ""


def _level(part):
    return next((level for level, parts in enumerate(LAYERS) if part in parts), None)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_down(path):
    part = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if part == "__init__":
        return  # the front door opens on everything
    assert _level(part) is not None, f"{part} has no layer: add it to LAYERS"
    for name in _imports(path):
        root, _, rest = name.partition(".")
        if root in HOMES:
            assert part in HOMES[root], f"{part} imports {root}, whose home is {HOMES[root]}"
        other = rest.partition(".")[0]
        if root != "omnisim" or other in ("", part, "__version__"):
            continue
        assert _level(other) > _level(part), f"{part} imports {other}, which is not below it"


def test_every_layer_is_there():
    parts = {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in MODULES}
    assert parts - {"__init__"} == set().union(*LAYERS)


def test_every_camera_model_is_a_triple():
    from omnisim.resources import SHADERS
    from tests.camera_examples import CAMERA_EXAMPLES

    stems = {path.stem for path in (SHADERS / "camera").glob("*.glsl")}
    classes = {type(camera) for camera in CAMERA_EXAMPLES.values()}
    assert {kind.model for kind in classes} == stems
    assert {kind.__module__.rpartition(".")[2] for kind in classes} == stems
