"""Imports: a layered, acyclic graph of modules, and one home for each library."""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import omnisim

PACKAGE = Path(omnisim.__file__).parent
# Top-down; a module imports from lower layers and from its own folder.
LAYERS = (
    {"__main__"},
    {"cli"},
    {"browser"},
    {"validation", "experiments"},
    {"reports"},
    {"plots"},
    {"datasets"},
    {"exporting"},
    {"simulation"},
    {"localization", "mujoco"},
    {"sensors", "perception", "robot"},
    {"baking"},
    {"gpu", "rays"},
    {"optics"},
    {"calibration"},
    {"scene", "cameras"},
    {"mirrors"},
    {"frame"},
    {"ground_truth"},
    {"image_files", "trajectories"},
    {"world"},
    {"poses"},
    {
        "atomic_file",
        "frames",
        "cube",
        "srgb",
        "bilinear",
        "resources",
        "toml_file",
        "file_keys",
        "npz_file",
    },
    {"parameters", "extras"},
    {"errors", "short_repr", "version"},
)
GPU_LAYERS = (
    {"hit_batches"},
    {"batch_pipeline", "parallax_pipeline"},
    {"cuda_buffer", "pipeline", "readback_ring"},
    {"ground_truth"},
    {"capture", "degradation", "shadows"},
    {"scene"},
    {"culling"},
    {"atlas"},
    {"context", "layer_targets", "shader_files", "uniforms", "memory"},
    {"gl_state"},
    {"gl_functions"},
)
HOMES = {
    "moderngl": {"gpu"},
    "cuda": {"gpu"},
    "trimesh": {"scene"},
    "PIL": {"scene", "plots"},  # textures; captions without matplotlib
    "OpenImageIO": {"image_files"},
    "typer": {"cli"},
    "rich": {"cli"},
    "matplotlib": {"plots"},
    "jinja2": {"reports"},
    "av": {"plots"},
    "cv2": {"validation"},
    "mitsuba": {"validation"},
    "pyrender": {"validation"},
    "pycolmap": {"validation"},
    "yaml": {"calibration"},
    "embreex": {"rays"},
    "xatlas": {"baking"},
    "mujoco": {"scene", "mujoco", "simulation"},
    "websockets": {"browser"},
    "pxr": {"scene"},
    "rosbags": {"exporting"},
}
MODULES = {
    ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted(PACKAGE.rglob("*.py"))
}


def _imports(module):
    """Names of the modules that a module imports, for type checking too."""
    for node in ast.walk(ast.parse(MODULES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            for alias in node.names:
                member = f"{node.module}.{alias.name}"
                yield member if member in MODULES else node.module


def _layer(layers, part):
    return next((layer for layer, parts in enumerate(layers) if part in parts), None)


def _check_layers(layers, package, module):
    part = module.removeprefix(package).split(".")[1]
    assert _layer(layers, part) is not None, f"{part} has no layer"
    for name in _imports(module):
        if not name.startswith(f"{package}."):
            continue
        other = name.removeprefix(package).split(".")[1]
        if other != part:
            assert _layer(layers, other) > _layer(layers, part), (
                f"{module} imports {name}, above it"
            )


@pytest.mark.parametrize("module", sorted(MODULES.keys() - {"omnisim"}))
def test_imports_point_down(module):
    _check_layers(LAYERS, "omnisim", module)
    if module.startswith("omnisim.gpu."):
        _check_layers(GPU_LAYERS, "omnisim.gpu", module)


@pytest.mark.parametrize("module", sorted(MODULES.keys() - {"omnisim"}))
def test_each_library_has_one_home(module):
    part = module.split(".")[1]
    for name in _imports(module):
        root = name.partition(".")[0]
        assert part in HOMES.get(root, {part}), f"{module} imports {root}: home is {HOMES[root]}"
        assert name != "omnisim", f"{module} imports the front door"


def test_imports_have_no_cycle():
    graph = {module: set(_imports(module)) & MODULES.keys() for module in MODULES}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as reason:
        pytest.fail(" → ".join(reason.args[1]))


def test_every_layer_is_there():
    parts = {module.split(".")[1] for module in MODULES if "." in module}
    assert parts == set().union(*LAYERS)


def test_every_camera_model_is_a_triple():
    from omnisim.resources import SHADERS
    from tests.camera_examples import CAMERA_EXAMPLES

    stems = {path.stem for path in (SHADERS / "camera").glob("*.glsl")}
    classes = {type(camera) for camera in CAMERA_EXAMPLES.values()}
    assert {kind.model_name for kind in classes} == stems
    assert {kind.__module__.rpartition(".")[2] for kind in classes} == stems


def test_public_names_are_importable():
    assert all(hasattr(omnisim, name) for name in omnisim.__all__)
