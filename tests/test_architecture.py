"""Imports: a layered, acyclic graph of modules, and one home for each library."""

import ast
from collections import Counter, defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter

import pytest

import omnisim
from tests.syntax import PACKAGE, syntax_nodes

# Top-down; a module imports from lower rooms and from its own.
ROOMS = (
    {"__main__"},
    {"apps"},
    {"validation"},
    {"report"},
    {"plots"},
    {"evaluation"},
    {"serve"},
    {"datasets", "measurement"},
    {"follow", "runs"},
    {"robots"},
    {"sensors"},
    {"perception", "rendering"},
    {"scene"},
    {"cameras", "ground_truth"},
    {"core"},
)
MAX_ROOMS, MAX_ROW = 18, 20  # rooms of the package, modules of a folder
# As measured; whoever merges or shortens modules lowers them: to 6 % and 30.
MAX_IMPORT_PERCENT = 7.8  # of the package's lines
MAX_SINGLE_USE = 35  # modules that only one other imports
MAX_LINES = 700  # of a file
# Formats that share parts of a file's anatomy, checks and commands that share what they are of.
SHARED_STEMS = {"formats", "checks", "cli"}
# Folders whose modules are named by a table or a list: one file for each entry.
REGISTRIES = {
    "formats",
    "protocols",
    "importers",
    "checks",
    "cli",
    "estimators",
    "experiments",
    "oracles",
}
OPENGL_LAYERS = (
    {"cube_backend"},
    {"parallax_camera"},
    {"opengl_camera"},
    {"frame_batches"},
    {"camera_frame", "hits"},
    {"reflect", "shadows"},
    {"scene_view"},
    {"surfaces"},
    {"world"},
    {"capture", "culling"},
    {"degradation"},
    {"gl"},
)
# What plans of the atlas import: they are arrays, of any back end and without one.
PLANNED_FROM = ("core", "cameras", "rendering.camera", "rendering.atlas")
HOMES = {
    "moderngl": {"rendering.opengl"},
    "mapbox_earcut": {"scene"},
    "trimesh": {"scene"},
    "PIL": {"scene", "plots"},  # textures; captions without matplotlib
    "OpenImageIO": {"core.files"},
    "click": {"apps.cli"},
    "rich": {"apps.cli"},
    "matplotlib": {"plots"},
    "jinja2": {"report"},
    "av": {"measurement", "plots"},
    "cv2": {"evaluation.estimators", "measurement", "validation"},
    "mitsuba": {"validation"},
    "pyrender": {"validation"},
    "pycolmap": {"evaluation.estimators", "validation"},
    "yaml": {"cameras.calibration"},
    "embreex": {"rendering.rays"},
    "xatlas": {"rendering.baking"},
    "mujoco": {"follow", "scene.formats.mjcf", "robots.importers", "runs"},
    "websockets": {"apps.live", "serve"},
    "foxglove": {"serve"},
    "pxr": {"scene.formats.usd"},
    "rosbags": {"core.files", "datasets.export", "serve"},
    "rawpy": {"measurement"},
}
# Outside of rendering.opengl, what draws by OpenGL: imported by functions that are asked to.
DRAWING = {f"omnisim.validation.checks.{name}" for name in ("optics", "paper_mirror")}
MODULES = {
    ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted(PACKAGE.rglob("*.py"))
}


@cache
def _import_nodes(module):
    """Import statements of a module, for type checking too."""
    nodes = syntax_nodes()[MODULES[module]]
    return [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]


@cache
def _imports(module):
    """Names of the modules that a module imports."""
    names = []
    for node in _import_nodes(module):
        for alias in node.names:
            if isinstance(node, ast.Import):
                names.append(alias.name)
            else:
                member = f"{node.module}.{alias.name}"
                names.append(member if member in MODULES else node.module)
    return names


def _imported_at_start(module):
    """Names of what a module imports when it is imported, with their packages."""
    for node in syntax_nodes()[MODULES[module]][0].body:
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            parts = name.split(".")
            yield from (".".join(parts[:count]) for count in range(1, len(parts) + 1))


def _layer(layers, part):
    return next((layer for layer, parts in enumerate(layers) if part in parts), None)


def _faults_of_layers(layers, package, module):
    part = module.removeprefix(package).split(".")[1]
    if _layer(layers, part) is None:
        yield f"{module}: {part} has no layer"
        return
    for name in _imports(module):
        if not name.startswith(f"{package}."):
            continue
        other = name.removeprefix(package).split(".")[1]
        below = _layer(layers, other)
        if other != part and (below is None or below <= _layer(layers, part)):
            yield f"{module} imports {name}, which is not below it"


def _check(faults):
    faults = list(faults)
    assert not faults, "\n".join(faults)


def test_imports_are_absolute_and_none_is_of_the_front_door():
    _check(
        f"{module}: relative import in line {node.lineno}"
        for module in MODULES
        for node in _import_nodes(module)
        if isinstance(node, ast.ImportFrom) and node.level
    )
    _check(f"{module} imports omnisim" for module in MODULES if "omnisim" in _imports(module))


@pytest.mark.parametrize(
    ("package", "layers"), [("omnisim", ROOMS), ("omnisim.rendering.opengl", OPENGL_LAYERS)]
)
def test_imports_point_down(package, layers):
    modules = [module for module in MODULES if module.startswith(f"{package}.")]
    assert len(modules) > 50
    _check(fault for module in modules for fault in _faults_of_layers(layers, package, module))


def test_plans_know_no_back_end():
    rooms = tuple(f"omnisim.{room}." for room in PLANNED_FROM)
    plans = [module for module in MODULES if module.startswith("omnisim.rendering.atlas.")]
    assert plans
    _check(
        f"{module} imports {name}"
        for module in plans
        for name in _imports(module)
        if name.startswith("omnisim.") and not f"{name}.".startswith(rooms)
    )


def test_each_library_has_one_home():
    _check(
        f"{module} imports {name}: home is {' or '.join(sorted(homes))}"
        for module in sorted(MODULES.keys() - {"omnisim"})
        for name in _imports(module)
        if (homes := HOMES.get(name.partition(".")[0]))
        and not any(module.startswith(f"omnisim.{home}") for home in homes)
    )


def test_imports_have_no_cycle():
    graph = {module: set(_imports(module)) & MODULES.keys() for module in MODULES}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as reason:
        pytest.fail(" → ".join(reason.args[1]))


def test_no_two_folders_import_each_other():
    """A folder may import from the folders within it, and they from it."""
    arrows = {
        (folder, other)
        for module in MODULES
        for name in _imports(module)
        if (folder := _folder(module)) != (other := _folder(name))
    }
    circles = {
        (folder, other)
        for folder, other in arrows
        if folder < other and (other, folder) in arrows and not _is_within(other, folder)
    }
    assert circles == set()


@pytest.mark.parametrize("side", ["opengl", "rays", "baking", "truth", "contract", "pixel_rays"])
def test_back_ends_know_nothing_of_each_other(side):
    """`shared_scene` hands OpenGL the contract's rays; what both need belongs to neither."""
    own = f"omnisim.rendering.{side}"
    others = {f"omnisim.rendering.{one}." for one in ("opengl", "rays", "baking")} - {f"{own}."}
    if side == "baking":  # casts the back end's rays
        others.remove("omnisim.rendering.rays.")
    modules = [module for module in MODULES if f"{module}.".startswith(f"{own}.")]
    assert modules
    _check(
        f"{module} imports {name}"
        for module in modules
        for name in _imports(module)
        if f"{name}.".startswith(tuple(others))
    )


def test_only_the_checks_import_the_validation():
    users = {
        _folder(module)
        for module in MODULES
        if any(f"{name}.".startswith("omnisim.validation.") for name in _imports(module))
    }
    assert {user for user in users if user.split(".")[0] != "validation"} == {"apps.cli.checks"}


def _is_within(folder, other):
    return not other or folder.startswith(f"{other}.")


def _folder(module):
    """Folder of a module below the package; empty: no module of a folder."""
    if module not in MODULES:
        return ""
    return ".".join(MODULES[module].parent.relative_to(PACKAGE).parts)


def test_only_drawing_needs_opengl():
    """Rays, files and calibrations work where moderngl cannot be imported."""
    imported = {module: set(_imported_at_start(module)) for module in MODULES}
    needing = {"moderngl"}
    while more := {one for one in imported if imported[one] & needing} - needing:
        needing |= more
    outside = {one for one in needing if not one.startswith("omnisim.rendering.opengl.")}
    assert outside == DRAWING | {"moderngl"}


def _lines_of(module):
    return len(MODULES[module].read_text(encoding="utf-8").splitlines())


def test_files_are_read_at_once_and_imports_are_few():
    lines = {module: _lines_of(module) for module in MODULES}
    _check(f"{module}: {count} lines" for module, count in lines.items() if count > MAX_LINES)
    imports = sum(
        node.end_lineno - node.lineno + 1 for module in MODULES for node in _import_nodes(module)
    )
    assert 100.0 * imports / sum(lines.values()) <= MAX_IMPORT_PERCENT


def test_few_modules_have_one_importer():
    """Such a module may be a part of the one that imports it."""
    importers = defaultdict(set)
    for module in MODULES:
        for name in set(_imports(module)) - {module}:
            importers[name].add(module)
    single = [
        f"{module}, {_lines_of(module)} lines, by {user}"
        for module, path in MODULES.items()
        if path.stem != "__init__" and not REGISTRIES & set(module.split("."))
        for user in (importers[module] if len(importers[module]) == 1 else ())
        if MODULES[user].stem != "__init__"
    ]
    assert len(single) <= MAX_SINGLE_USE, "\n".join(single)


def test_every_room_is_there():
    parts = {module.split(".")[1] for module in MODULES if "." in module}
    assert parts == set().union(*ROOMS)
    assert len(parts - {"__main__"}) <= MAX_ROOMS


def test_rows_are_short():
    rows = Counter(path.parent for path in MODULES.values() if path.stem != "__init__")
    _check(
        f"{folder.relative_to(PACKAGE)}: {count} modules in a row"
        for folder, count in rows.items()
        if count > MAX_ROW and folder.name not in REGISTRIES
    )


def test_a_stem_has_one_module():
    """Whoever looks for a file finds one of its name."""
    stems = defaultdict(list)
    for module in MODULES:
        *folders, stem = module.split(".")
        if not SHARED_STEMS & {*folders, stem} and MODULES[module].stem != "__init__":
            stems[stem].append(module)
    _check(" and ".join(modules) for modules in stems.values() if len(modules) > 1)


def test_every_camera_model_is_a_triple():
    from omnisim.core.package_files import SHADERS
    from tests.camera_examples import CAMERA_EXAMPLES

    stems = {path.stem for path in (SHADERS / "camera").glob("*.glsl")}
    classes = {type(camera) for camera in CAMERA_EXAMPLES.values()}
    assert {kind.model_name for kind in classes} == stems
    assert {kind.__module__.rpartition(".")[2] for kind in classes} == stems


def test_a_public_name_is_there_and_means_one_thing():
    """A name that several packages export is the same thing in each."""
    assert all(hasattr(omnisim, name) for name in omnisim.__all__)
    sources = defaultdict(set)
    for module, path in MODULES.items():
        if path.stem == "__init__":
            for node in _import_nodes(module):
                for alias in node.names if isinstance(node, ast.ImportFrom) else ():
                    if alias.name != "*":
                        sources[alias.asname or alias.name].add(_source(node.module, alias.name))
    assert len(sources) > 100
    _check(
        f"{name}: {', '.join(sorted(found))}" for name, found in sources.items() if len(found) > 1
    )


def _source(module, name):
    """Module that defines what a package exports by a name."""
    if module in MODULES and MODULES[module].stem == "__init__":
        imports = [
            node
            for node in _import_nodes(module)
            if isinstance(node, ast.ImportFrom) and node.module != module
        ]
        for exported in (name, "*"):
            for node in imports:
                if exported in {alias.name for alias in node.names}:
                    return _source(node.module, name)
    return module
