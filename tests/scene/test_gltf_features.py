"""Every feature of the table: a small GLB that uses it, and what becomes of it."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.errors import SceneError, printable
from omnisim.core.files.sources import fingerprint
from omnisim.scene import load_scene
from omnisim.scene.formats.gltf.reader import FEATURES, SUPPORTED_EXTENSIONS, Support
from omnisim.scene.formats.gltf.writer import write_glb
from omnisim.scene.surface_kind import SurfaceKind, transmitted
from tests.scene.gltf_builder import GltfBuilder

OTHER_IMAGES = ("EXT_texture_astc", "EXT_texture_avif", "MSFT_texture_dds")
IGNORED = [one.name for one in FEATURES if one.support is Support.IGNORED]
LEFT_OUT = [
    one.name
    for one in FEATURES
    if one.support is Support.LEFT_OUT and not one.group and one.extensions
]
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
IMAGE = [[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [9, 9, 9]]]


class Plain:
    """A triangle with a matt white material and texture coordinates, to be changed."""

    def __init__(self):
        self.gltf = gltf = GltfBuilder()
        uv = gltf.accessor(np.array([[0, 0], [1.5, 0], [0, 1.5]], "<f4"), "VEC2")
        self.material = {"pbrMetallicRoughness": {"metallicFactor": 0.0}}
        gltf.tree["materials"] = [self.material]
        gltf.node(mesh=gltf.triangle(material=0, TEXCOORD_0=uv))
        (self.node,), (self.mesh,) = gltf.tree["nodes"], gltf.tree["meshes"]
        (self.primitive,) = self.mesh["primitives"]
        self.pbr = self.material["pbrMetallicRoughness"]

    def attribute(self, name, values, kind, **options):
        self.primitive["attributes"][name] = self.gltf.accessor(values, kind, **options)

    def extend(self, holder, name, **values):
        holder.setdefault("extensions", {})[name] = values
        self.gltf.tree.setdefault("extensionsUsed", []).append(name)

    def textured(self, pixels=IMAGE, **sampler):
        self.pbr["baseColorTexture"] = {"index": self.gltf.texture(pixels, **sampler)}
        return self.gltf.tree["textures"][0]

    def skin(self):
        self.attribute("JOINTS_0", np.zeros((3, 4), "u1"), "VEC4")
        self.attribute("WEIGHTS_0", np.array([[1, 0, 0, 0]] * 3, "<f4"), "VEC4")
        self.gltf.tree["skins"] = [{"joints": [1]}]
        self.node["skin"] = 0
        self.gltf.node(translation=[0, 0, 3])

    def require(self, name):
        self.gltf.tree.setdefault("extensionsRequired", []).append(name)


def _animate(plain):
    times = plain.gltf.accessor(np.array([0, 1], "<f4"), "SCALAR")
    moves = plain.gltf.accessor(np.array([[0, 0, 0], [0, 5, 0]], "<f4"), "VEC3")
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    samplers = [{"input": times, "output": moves}]
    animation = {"channels": [channel], "samplers": samplers}
    plain.gltf.tree["animations"] = [animation]
    return animation


def _animate_twice(plain):
    plain.gltf.tree["animations"] = [_animate(plain), {"channels": [], "samplers": []}]


def _animate_also(**target):
    def change(plain):
        _animate(plain)["channels"].append({"sampler": 0, "target": target})

    return change


def _lamp_beside(plain, **target):
    animation = _animate(plain)
    plain.extend(plain.gltf.tree, "KHR_lights_punctual", lights=[{"type": "point"}])
    plain.gltf.node(extensions={"KHR_lights_punctual": {"light": 0}})
    if target:
        animation["channels"].append({"sampler": 0, "target": target})


def _webp(plain):
    texture = plain.textured()
    plain.extend(texture, "EXT_texture_webp", source=texture.pop("source"))


def _glossy(plain, **values):
    plain.extend(plain.material, "KHR_materials_pbrSpecularGlossiness", **values)


def _emitting_strongly(plain):
    plain.material["emissiveFactor"] = [1, 1, 1]
    plain.extend(plain.material, "KHR_materials_emissive_strength", emissiveStrength=3)


def _map(name, **values):
    def change(plain):
        index = plain.gltf.texture(IMAGE)
        plain.material[name] = {"index": index, **values}

    return change


def _extension_map(extension, name):
    def change(plain):
        index = plain.gltf.texture(IMAGE)
        plain.extend(plain.material, extension, **{name: {"index": index}})

    return change


def _extension(name, **values):
    return lambda plain: plain.extend(plain.material, name, **values)


def _requiring(name):
    return lambda plain: plain.require(name)


def _quantized(plain):
    corners = np.array([[0, 0, 0], [32767, 0, 0], [0, 16384, 0]], "<i2")
    plain.attribute("POSITION", corners, "VEC3", normalized=True)
    plain.require("KHR_mesh_quantization")


def _pane(plain):
    plain.pbr.update(roughnessFactor=0.0)
    plain.extend(plain.material, "KHR_materials_transmission", transmissionFactor=0.9)


def _mapped_pane(plain):
    texture = {"index": plain.gltf.texture(IMAGE)}
    plain.extend(
        plain.material, "KHR_materials_transmission", transmissionFactor=0.9,
        transmissionTexture=texture,
    )  # fmt: skip


USES = {
    "translation, rotation, scale, matrix": lambda p: p.node.update(translation=[1, 2, 3]),
    "mode: 4, 5, 6": lambda p: (
        p.attribute("POSITION", np.concatenate((CORNERS, [[1, 1, 0]])).astype("<f4"), "VEC3"),
        p.attribute("TEXCOORD_0", np.zeros((4, 2), "<f4"), "VEC2"),
        p.primitive.update(mode=5),
    ),
    "mode: 0, 1, 2, 3": lambda p: p.mesh["primitives"].append({**p.primitive, "mode": 1}),
    "NORMAL": lambda p: p.attribute("NORMAL", np.array([[0, 0, 1]] * 3, "<f4"), "VEC3"),
    "COLOR_0": lambda p: p.attribute("COLOR_0", np.array([[1, 0, 0]] * 3, "<f4"), "VEC3"),
    "JOINTS_2": lambda p: (
        p.skin(),
        p.attribute("JOINTS_2", np.zeros((3, 4), "u1"), "VEC4"),
    ),
    "further animations": _animate_twice,
    "target: lights": lambda p: _lamp_beside(p, node=1, path="translation"),
    "KHR_animation_pointer": _animate_also(path="pointer"),
    "baseColorFactor": lambda p: p.pbr.update(baseColorFactor=[1, 0, 0, 1]),
    "baseColorTexture": Plain.textured,
    "magFilter: 9728": lambda p: p.textured(magFilter=9728),
    "alphaMode, alphaCutoff": lambda p: p.material.update(alphaMode="BLEND"),
    "doubleSided": lambda p: p.material.update(doubleSided=True),
    "metallicFactor, roughnessFactor": lambda p: p.pbr.update(metallicFactor=0.5),
    "metallicRoughnessTexture": lambda p: p.pbr.update(
        metallicRoughnessTexture={"index": p.gltf.texture(IMAGE)}
    ),
    "normalTexture": _map("normalTexture"),
    "TANGENT": lambda p: p.attribute("TANGENT", np.array([[1, 0, 0, 1]] * 3, "<f4"), "VEC4"),
    "occlusionTexture": _map("occlusionTexture"),
    "emissiveFactor, emissiveTexture": lambda p: p.material.update(emissiveFactor=[0, 1, 0]),
    "EXT_texture_webp": _webp,
    "KHR_texture_basisu": lambda p: p.require("KHR_texture_basisu"),
    "KHR_mesh_quantization": _quantized,
    "KHR_node_visibility": lambda p: p.extend(p.node, "KHR_node_visibility", visible=False),
    "KHR_materials_unlit": _extension("KHR_materials_unlit"),
    "KHR_materials_pbrSpecularGlossiness": lambda p: _glossy(
        p, diffuseFactor=[1, 0, 0, 1], specularFactor=[0, 0, 0]
    ),
    "specularGlossinessTexture": _extension_map(
        "KHR_materials_pbrSpecularGlossiness", "specularGlossinessTexture"
    ),
    "KHR_materials_anisotropy": _extension("KHR_materials_anisotropy", anisotropyStrength=1),
    "KHR_materials_clearcoat": _extension("KHR_materials_clearcoat", clearcoatFactor=1),
    "KHR_materials_diffuse_transmission": _extension(
        "KHR_materials_diffuse_transmission", diffuseTransmissionFactor=1
    ),
    "KHR_materials_dispersion": _extension("KHR_materials_dispersion", dispersion=1),
    "KHR_materials_emissive_strength": _emitting_strongly,
    "KHR_materials_ior": _extension("KHR_materials_ior", ior=1.33),
    "KHR_materials_iridescence": _extension("KHR_materials_iridescence", iridescenceFactor=1),
    "KHR_materials_sheen": _extension("KHR_materials_sheen", sheenColorFactor=[1, 0, 0]),
    "KHR_materials_specular": _extension("KHR_materials_specular", specularFactor=0),
    "KHR_materials_transmission": _pane,
    "transmissionTexture": _mapped_pane,
    "KHR_materials_volume": _extension("KHR_materials_volume", thicknessFactor=1),
    "KHR_materials_variants": lambda p: p.extend(p.primitive, "KHR_materials_variants"),
    **{name: _requiring(name) for name in OTHER_IMAGES},
    **{name: _extension(name.split(", ")[-1]) for name in (*LEFT_OUT, *IGNORED)},
}
# What a feature's use is compared with, where that is not the plain triangle.
WITHOUT = {
    "magFilter: 9728": Plain.textured,
    "further animations": _animate,
    "JOINTS_2": Plain.skin,
    "target: lights": _lamp_beside,
    "KHR_animation_pointer": _animate,
    "specularGlossinessTexture": _glossy,
}
# What these change is tested exactly: by other tests of glTF's skins, animations, lights and so on.
EXACT = {
    "sparse", "skins", "JOINTS_1", "weights", "animations", "interpolation", "camera",
    "target: translation, rotation", "target: scale", "target: weights", "wrapS, wrapT",
    "KHR_texture_transform", "KHR_draco_mesh_compression", "EXT_meshopt_compression",
    "KHR_meshopt_compression", "EXT_mesh_gpu_instancing", "KHR_lights_punctual",
}  # fmt: skip
SILENT = {
    "normalTexture": _map("normalTexture", scale=0),
    "occlusionTexture": _map("occlusionTexture", strength=0),
    "emissiveFactor, emissiveTexture": _map("emissiveTexture"),  # times a factor of 0
    "weights": lambda p: p.mesh.update(weights=[0.0]),
    "KHR_node_visibility": lambda p: p.extend(p.node, "KHR_node_visibility", visible=True),
    "KHR_materials_clearcoat": _extension("KHR_materials_clearcoat"),
    "KHR_materials_ior": _extension("KHR_materials_ior", ior=1.5),
    "KHR_materials_emissive_strength": _extension(
        "KHR_materials_emissive_strength", emissiveStrength=3
    ),
    "KHR_materials_sheen": _extension("KHR_materials_sheen"),
    "KHR_materials_specular": _extension("KHR_materials_specular", specularFactor=1),
    "unlit": lambda p: (
        p.pbr.update(metallicFactor=1.0),
        p.extend(p.material, "KHR_materials_unlit"),
    ),
    "metadata": lambda p: p.extend(p.gltf.tree, "KHR_xmp_json_ld"),
}


def _load(folder, change):
    plain = Plain()
    change(plain)
    return load_scene(plain.gltf.write(folder / "a.glb"))


def _contents(scene):
    return fingerprint(dataclasses.replace(scene, notices=()))


def test_every_feature_has_a_file():
    assert [*USES] == [feature.name for feature in FEATURES if feature.name not in EXACT]
    assert {"KHR_materials_variants", *", ".join(IGNORED).split(", ")} <= SUPPORTED_EXTENSIONS


def test_a_file_may_require_what_only_changes_its_look(tmp_path):
    def use(plain):
        USES["transmissionTexture"](plain)
        plain.require("KHR_materials_transmission")

    assert _load(tmp_path, use).notices == (
        "a.glb: maps of transmission are not drawn: glass is opaque (1 material)",
    )


def test_glass_transmits_unless_it_has_a_map(tmp_path):
    def thick(plain):
        _pane(plain)
        plain.extend(
            plain.material, "KHR_materials_volume", thicknessFactor=0.01,
            attenuationDistance=0.2, attenuationColor=[0.5, 0.25, 1.0],
        )  # fmt: skip
        plain.extend(plain.material, "KHR_materials_dispersion", dispersion=0.5)

    def frost(plain):
        _pane(plain)
        plain.pbr.update(roughnessFactor=0.5)

    pane, frosted, glass = (_load(tmp_path, use) for use in (_pane, frost, thick))
    for scene in (pane, frosted, glass):
        write_glb(scene, tmp_path / "written.glb")
        material = scene.materials[0]
        written = load_scene(tmp_path / "written.glb").materials[0]
        assert (material.transmission, scene.notices) == (0.9, ())
        assert fingerprint(material) == fingerprint(written)
    assert (material.thickness_m, material.dispersion) == (0.01, 0.5)
    assert material.attenuation_distance_m == 0.2
    assert material.attenuation_color == (0.5, 0.25, 1.0)
    kinds = SurfaceKind.PANE, SurfaceKind.GLASS, SurfaceKind.FROSTED
    shares = [
        tuple(transmitted(scene.materials[0], kind) for kind in kinds)
        for scene in (pane, frosted, glass)
    ]
    assert shares == [(0.9, 0.0, 0.0), (0.0, 0.0, 0.9), (0.0, 0.9, 0.0)]
    mapped = _load(tmp_path, USES["transmissionTexture"])
    assert mapped.materials[0].transmission == 0.0
    assert any("glass is opaque (1 material)" in notice for notice in mapped.notices)


@pytest.mark.parametrize("name", ["KHR_node_visibility", "KHR_gaussian_splatting", "EXT\na"])
def test_a_file_may_not_require_other_shapes(tmp_path, name):
    with pytest.raises(
        SceneError,
        match=f"requires the glTF extension {printable(name)}, which".replace("\\", r"\\"),
    ):
        _load(tmp_path, lambda plain: plain.require(name))


@pytest.mark.parametrize(
    "feature", [one for one in FEATURES if one.name in USES], ids=lambda feature: feature.name
)
def test_feature(feature, tmp_path):
    use = USES[feature.name]
    if feature.support is Support.REFUSED:
        with pytest.raises(SceneError, match=f"requires the glTF extension {feature.name}"):
            _load(tmp_path, use)
        return
    scene, without = _load(tmp_path, use), _load(tmp_path, WITHOUT.get(feature.name, id))
    assert without.notices == ()
    is_applied = feature.support is Support.APPLIED
    assert (_contents(scene) != _contents(without)) == is_applied
    notice = f"a.glb: {feature.effect} (1 "
    if feature.name in LEFT_OUT:
        assert scene.notices == (f"a.glb: {feature.extensions[-1]} is not read",)
    elif is_applied or not feature.group:
        assert scene.notices == ()
    else:
        assert [line[: len(notice)] for line in scene.notices].count(notice) == 1
        assert len(scene.notices) == 1 + (feature.name == "KHR_materials_emissive_strength")


@pytest.mark.parametrize("name", SILENT)
def test_values_that_change_nothing_are_not_noticed(name, tmp_path):
    assert _load(tmp_path, SILENT[name]).notices == ()


def test_notices_count_what_the_scene_draws(tmp_path):
    plain = Plain()
    sheen = {"KHR_materials_sheen": {"sheenColorFactor": [1.0, 0.0, 0.0]}}
    plain.gltf.tree["materials"] += [{"extensions": sheen} for _ in range(3)]
    for material in (1, 2):
        plain.gltf.node(mesh=plain.gltf.triangle(material=material))
    plain.gltf.triangle(material=3)  # of no node
    scene = load_scene(plain.gltf.write(tmp_path / "a.glb"))
    assert scene.notices == ("a.glb: sheen is not drawn (2 materials)",)


def test_unknown_extensions_are_noticed(tmp_path):
    scene = _load(tmp_path, _extension("ACME_materials_glitter", glitter=1))
    assert scene.notices == ("a.glb: ACME_materials_glitter is not read",)


def test_a_damaged_value_of_a_feature_that_is_left_out_is_no_error(tmp_path):
    scene = _load(tmp_path, _extension("KHR_materials_sheen", sheenColorFactor="much"))
    assert scene.notices == ("a.glb: sheen is not drawn (1 material)",)


def test_maps_of_gloss_and_clear_coats_are_packed(tmp_path):
    """One image or several, of other sizes; the rest of a texture is 1."""
    small = np.random.default_rng(1).integers(0, 256, (2, 2, 4)).astype(np.uint8)
    large = np.random.default_rng(2).integers(0, 256, (4, 4, 4)).astype(np.uint8)

    def material(extension, **values):
        plain = Plain()
        first, second = plain.gltf.texture(small), plain.gltf.texture(large)
        places = {"small": {"index": first}, "large": {"index": second}}
        places["moved"] = {
            "index": first,
            "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.0]}},
        }
        content = {
            key: places[value] if isinstance(value, str) else value for key, value in values.items()
        }
        plain.attribute("TEXCOORD_0", np.array([[0, 0], [1, 0], [0, 1]], "<f4"), "VEC2")
        plain.extend(plain.material, extension, **content)
        scene = load_scene(plain.gltf.write(tmp_path / "a.glb"))
        return scene.materials[0], scene.notices

    found, _ = material("KHR_materials_specular", specularTexture="small")
    np.testing.assert_array_equal(found.specular_map.pixels[..., 3], small[..., 3])
    assert (found.specular_map.pixels[..., :3] == 255).all()
    found, _ = material("KHR_materials_specular", specularColorTexture="small")
    np.testing.assert_array_equal(found.specular_map.pixels[..., :3], small[..., :3])
    assert (found.specular_map.pixels[..., 3] == 255).all()
    assert not found.specular_map.is_linear
    both = {"specularTexture": "large", "specularColorTexture": "small"}
    found, notices = material("KHR_materials_specular", **both)
    np.testing.assert_array_equal(found.specular_map.pixels[..., 3], large[..., 3])
    np.testing.assert_array_equal(found.specular_map.pixels[::3, ::3, :3], small[..., :3])
    assert notices == ()
    coat = {"clearcoatTexture": "large", "clearcoatRoughnessTexture": "large"}
    found, _ = material("KHR_materials_clearcoat", clearcoatFactor=0.5, **coat)
    np.testing.assert_array_equal(found.clearcoat_map.pixels, large)
    assert found.clearcoat_map.is_linear
    found, _ = material("KHR_materials_clearcoat", **coat, clearcoatNormalTexture="small")
    assert found.maps == (None,) * 7  # of no coat
    apart = {"specularTexture": "moved", "specularColorTexture": "small"}
    found, notices = material("KHR_materials_specular", **apart)
    assert found.specular_map is None
    name = repr(found.name)
    assert notices == (f"a.glb: specular maps of {name} are placed differently: not drawn",)
