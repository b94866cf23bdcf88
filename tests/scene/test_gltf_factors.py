"""Material factors outside glTF's ranges: limited, and named in one notice of the file."""

import math

import pytest

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene
from tests.scene.gltf_builder import GltfBuilder

IN_RANGE = {
    "name": "Pane",
    "alphaCutoff": 1.5,  # all is a hole
    "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1.00000004},  # rounded
    "occlusionTexture": {"index": 0, "strength": 1},
    "emissiveFactor": [0, 1, 2],  # brighter than white
    "extensions": {
        "KHR_materials_ior": {"ior": 1},
        "KHR_materials_volume": {"thicknessFactor": 0, "attenuationDistance": 1e-9},
        "KHR_materials_dispersion": {"dispersion": 0},
        "KHR_materials_specular": {"specularColorFactor": [0, 5, 25]},
    },
}


def _load(folder, *materials):
    gltf = GltfBuilder()
    gltf.texture([[[255, 255, 255]]])
    gltf.tree["materials"] = list(materials)
    for index in range(len(materials)):
        gltf.node(mesh=gltf.triangle(material=index))
    return load_scene(gltf.write(folder / "a.glb"))


def _notice(folder, material):
    scene = _load(folder, material)
    (notice,) = scene.notices
    prefix = "a.glb: factors of materials out of range: "
    assert notice.startswith(prefix)
    return notice.removeprefix(prefix), scene.materials[0]


def _extension(name, **values):
    return {"extensions": {f"KHR_materials_{name}": values}}


def _metallic(**values):
    return {"pbrMetallicRoughness": values}


def _case(entry, label, value, used, attribute, expected=None):
    """Entry of a material, its notice, and the attribute with the value that is used."""
    text = f"{label} {value:g} (used: {used:g})"
    return entry, text, attribute, float(used) if expected is None else expected


def _factor(extension, key, value, used, attribute, expected=None):
    return _case(_extension(extension, **{key: value}), key, value, used, attribute, expected)


GLOW = _extension("emissive_strength", emissiveStrength=1e6)
DARK = _extension("emissive_strength", emissiveStrength=-2)
CASES = [
    _factor("volume", "thicknessFactor", -1, 0, "thickness_m"),
    _factor("volume", "attenuationDistance", 0, math.inf, "attenuation_distance_m"),
    _factor("dispersion", "dispersion", -0.1, 0, "dispersion"),
    _factor("ior", "ior", 0.9, 1, "ior"),
    _factor("transmission", "transmissionFactor", 2, 1, "transmission"),
    _factor("clearcoat", "clearcoatFactor", -3, 0, "clearcoat"),
    _factor("pbrSpecularGlossiness", "glossinessFactor", 1.5, 1, "roughness", 0.0),
    _case(_extension("volume", attenuationColor=[1, 1.5, 0]), "attenuationColor[1]", 1.5, 1,
          "attenuation_color", (1.0, 1.0, 0.0)),
    _case(_extension("specular", specularColorFactor=[-1, 0, 2]), "specularColorFactor[0]", -1, 0,
          "specular_color", (0.0, 0.0, 2.0)),
    _case(_metallic(roughnessFactor=-0.5), "roughnessFactor", -0.5, 0, "roughness"),
    _case(_metallic(metallicFactor=1.01), "metallicFactor", 1.01, 1, "metallic"),
    _case({"alphaCutoff": -0.5}, "alphaCutoff", -0.5, 0, "alpha_cutoff"),
    _case({"alphaCutoff": -1, **_extension("unlit")}, "alphaCutoff", -1, 0, "alpha_cutoff"),
    _case({"occlusionTexture": {"index": 0, "strength": 2}}, "occlusionTexture.strength", 2, 1,
          "occlusion_strength"),
    _case({"normalTexture": {"index": 0, "scale": -1e4}}, "normalTexture.scale", -1e4, -1e3,
          "normal_scale"),
    _case({"emissiveFactor": [1, 1, 1], **DARK}, "emissiveStrength", -2, 0, "emissive", (0.0,) * 3),
    _case({"emissiveFactor": [0, 0, 1], **GLOW}, "emissiveFactor · emissiveStrength", 1e6, 65504,
          "emissive", (0.0, 0.0, 65504.0)),
]  # fmt: skip


@pytest.mark.parametrize(
    ("entry", "text", "name", "used"), CASES, ids=[text for _, text, *_ in CASES]
)
def test_a_factor_out_of_range_is_named(tmp_path, entry, text, name, used):
    notice, material = _notice(tmp_path, {"name": "Pane", **entry})
    assert notice == f"'Pane' {text}"
    assert getattr(material, name) == used


def test_factors_in_range_are_not(tmp_path):
    scene = _load(tmp_path, IN_RANGE)
    assert scene.notices == ()
    material = scene.materials[0]
    assert (material.alpha_cutoff, material.roughness) == (1.5, 1.0)
    assert material.emissive == (0.0, 1.0, 2.0)
    assert material.attenuation_distance_m == 1e-9


def test_one_line_names_the_first_of_a_file(tmp_path):
    wrong = [{"name": f"m{index}", **_extension("ior", ior=0.5)} for index in range(7)]
    (notice,) = _load(tmp_path, *wrong).notices
    named = ", ".join(f"'m{index}' ior 0.5 (used: 1)" for index in range(5))
    assert notice == f"a.glb: factors of materials out of range: {named}, and 2 more"


def test_materials_that_are_not_drawn_are_not(tmp_path):
    gltf = GltfBuilder()
    gltf.tree["materials"] = [{}, _extension("ior", ior=0.5)]
    gltf.node(mesh=gltf.triangle(material=0))
    assert load_scene(gltf.write(tmp_path / "a.glb")).notices == ()


def test_no_number_is_an_error(tmp_path):
    with pytest.raises(SceneError, match=r"thicknessFactor: expected a finite number, got nan"):
        _load(tmp_path, _extension("volume", thicknessFactor=math.nan))


def test_an_index_of_zero_gives_the_reflectance_itself(tmp_path):
    """As `specularFactor` of KHR_materials_pbrSpecularGlossiness does; nothing is transmitted."""
    color = [0.5, 0.25, 1.0]
    of_zero = {
        "KHR_materials_ior": {"ior": 0},
        "KHR_materials_specular": {"specularColorFactor": color},
        "KHR_materials_transmission": {"transmissionFactor": 1},
    }
    metallic = {"metallicFactor": 0, "roughnessFactor": 0.25}
    glossy = {"specularFactor": color, "glossinessFactor": 0.75}
    scene = _load(
        tmp_path,
        {"name": "one", "pbrMetallicRoughness": metallic, "extensions": of_zero},
        {"name": "one", "extensions": {"KHR_materials_pbrSpecularGlossiness": glossy}},
    )
    assert scene.notices == ()
    found, expected, *_ = scene.materials
    assert vars(found) == vars(expected)
    at_normal = ((1.0 - found.ior) / (1.0 + found.ior)) ** 2
    assert [at_normal * one for one in found.specular_color] == pytest.approx(color)
