"""[[materials]] of a scene file: other properties for named materials of a mesh file."""

import pytest
import trimesh
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals

from omnisim.core.errors import SceneError
from omnisim.scene import read_scene
from omnisim.scene.model import AlphaMode
from omnisim.scene.surface_kind import pane_transmission
from tests.docs.pages import ROOT

GLOSS = 'names = ["oak*"]\nspecular = 0.8\nroughness = 0.1\n'


@pytest.fixture(scope="module")
def mesh_file(tmp_path_factory):
    """Boxes of four materials, one of them blended."""
    path = tmp_path_factory.mktemp("boxes") / "boxes.glb"
    scene = trimesh.Scene()
    for number, name in enumerate(("oak light", "oak dark", "brass", "window")):
        material = PBRMaterial(
            name=name,
            baseColorFactor=(128, 128, 128, 64 if name == "window" else 255),
            metallicFactor=1.0 if name == "brass" else 0.0,
            roughnessFactor=0.6,
            alphaMode="BLEND" if name == "window" else "OPAQUE",
        )
        box = trimesh.creation.box((1.0, 1.0, 1.0))
        box.visual = TextureVisuals(material=material)
        box.apply_translation((2.0 * number, 0.0, 0.0))
        scene.add_geometry(box, node_name=name, geom_name=name)
    scene.export(path)
    return path


@pytest.fixture
def changed(mesh_file, tmp_path):
    """Read the boxes with a scene file that has some tables; by default none."""

    def read(*tables, head=""):
        path = tmp_path / "scene.toml"
        text = "".join(f"[[materials]]\n{table}" for table in tables)
        path.write_text(f'file = "{mesh_file.as_posix()}"\n{head}{text}')
        return read_scene(path)

    return read


def by_name(scene):
    return {material.name: material for material in scene.materials}


def test_patterns_change_the_given_properties_of_all_matching_materials(changed):
    before, after = by_name(changed()), by_name(changed(GLOSS))
    for name in ("oak light", "oak dark"):
        assert (after[name].specular, after[name].roughness) == (0.8, 0.1)
        assert after[name].base_color == before[name].base_color
    assert (after["brass"].specular, after["brass"].roughness) == (1.0, before["brass"].roughness)


def test_of_several_tables_the_last_one_decides_for_each_key(changed):
    materials = by_name(changed(GLOSS, 'names = ["oak dark"]\nroughness = 0.3\n'))
    assert (materials["oak light"].roughness, materials["oak dark"].roughness) == (0.1, 0.3)
    assert materials["oak dark"].specular == 0.8


def test_a_blended_material_that_transmits_becomes_a_pane(changed):
    table = 'names = ["window"]\ntransmission = 0.9\nroughness = 0.0\nbase_color = [1, 0.5, 0.2]\n'
    window = by_name(changed(table))["window"]
    assert (window.alpha_mode, window.base_color) == (AlphaMode.OPAQUE, (1.0, 0.5, 0.2, 1.0))
    assert pane_transmission(window) == 0.9
    tinted = by_name(changed('names = ["window"]\nbase_color = [1, 0.5, 0.2]\n'))["window"]
    assert tinted.alpha_mode is AlphaMode.BLEND
    assert tinted.base_color == (1.0, 0.5, 0.2, 64 / 255)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (
            'names = ["oka light"]\nroughness = 0.1\n',
            "scene.toml: materials.0.names: no material 'oka light'; did you mean 'oak light'?",
        ),
        (
            'names = ["x*"]\nroughness = 0.1\n',
            "names: no material 'x*'; the scene has oak light, oak dark, brass, window",
        ),
        ('names = ["brass"]\nroughness = 2\n', "0.roughness: expected a number ≤ 1, got 2"),
        ('names = ["brass"]\nroughnes = 0\n', "roughnes: unknown key; did you mean 'roughness'?"),
        ('names = ["brass"]\nior = 0.5\n', "materials.0.ior: expected a number ≥ 1, got 0.5"),
        ('names = ["brass"]\n', "materials.0: expected a key besides names, such as roughness"),
        ("names = []\nroughness = 0.5\n", "materials.0.names: expected at least 1 item"),
    ],
)
def test_a_faulty_table_is_one_line(changed, table, words):
    with pytest.raises(SceneError) as caught:
        changed(table)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("table", "head", "words"),
    [
        ('names = ["window"]\nior = 1.2\nspecular = 0.0\n', "",
         "scene.toml: materials: 'window': ior without effect, as it has no specular or metallic"),
        (GLOSS, '[light]\nshading = "matte"\n', "only base_color has an effect"),
    ],
)  # fmt: skip
def test_a_change_without_effect_is_a_note(changed, table, head, words):
    (notice,) = changed(table, head=head).notices
    assert words in notice


@pytest.mark.parametrize(
    ("values", "is_other_light"),
    [
        ("roughness = 0.2\nspecular = 0.3", False),
        ("clearcoat = 1.0\nclearcoat_roughness = 0.1", False),
        ("roughness = 0.0", True),
        ("clearcoat = 1.0\nclearcoat_roughness = 0.0", True),
        ("transmission = 0.5", True),
        ("base_color = [1, 0, 0]", True),
        ("emissive = [2, 2, 2]", True),
    ],
)
def test_only_what_changes_light_asks_for_another_bake(changed, values, is_other_light):
    before, after = changed().identity, changed(f'names = ["oak dark"]\n{values}\n').identity
    assert (after.light != before.light) == is_other_light
    assert after.content != before.content


def test_a_variant_keeps_the_bake_of_its_base_unless_light_changes():
    polished = read_scene(ROOT / "examples" / "soccer-polished.toml")
    assert by_name(polished)["floor"].roughness == 0.1
    assert polished.lighting.baked is not None
    assert polished.notices == ()
    glass = read_scene(ROOT / "examples" / "mapping-glass.toml")
    assert pane_transmission(by_name(glass)["glass"]) == 1.0
    assert glass.lighting.baked is None
    (notice,) = glass.notices
    assert notice == (
        "mapping-glass.toml: materials change the light: the base scene's baked light is not used"
    )
