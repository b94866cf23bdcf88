"""UsdPreviewSurface, textures and primvars, by values and by an image of the scene as GLB."""

import zipfile

import numpy as np
import pytest

from omnisim import load_scene
from omnisim.scene.model import AlphaMode, Wrap
from omnisim.scene.surface_kind import pane_transmission
from tests.scene.formats.usd.stages import define_box, define_mesh, new_stage, saved
from tests.scene.gltf_builder import png

from pxr import Gf, Sdf, UsdGeom, UsdShade, UsdUtils  # isort: skip - skipped without it

QUAD = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]


_SCALARS = {str: Sdf.ValueTypeNames.Token, float: Sdf.ValueTypeNames.Float}
_VECTORS = {
    2: Sdf.ValueTypeNames.Float2, 3: Sdf.ValueTypeNames.Color3f, 4: Sdf.ValueTypeNames.Float4
}  # fmt: skip


def _shader(stage, path, kind, **inputs):
    shader = UsdShade.Shader.Define(stage, path)
    shader.CreateIdAttr(kind)
    types = Sdf.ValueTypeNames
    for name, value in inputs.items():
        if isinstance(value, tuple) and isinstance(value[0], UsdShade.Shader):
            shader.CreateInput(name, types.Float4).ConnectToSource(
                value[0].ConnectableAPI(), value[1]
            )
        elif isinstance(value, str) and name == "file":
            shader.CreateInput(name, types.Asset).Set(value)
        else:
            is_vector = isinstance(value, tuple)
            kind_of = _VECTORS[len(value)] if is_vector else _SCALARS[type(value)]
            shader.CreateInput(name, kind_of).Set(_gf(value) if is_vector else value)
    return shader


def _gf(values):
    return {2: Gf.Vec2f, 3: Gf.Vec3f, 4: Gf.Vec4f}[len(values)](*values)


def _material(stage, prim, **inputs):
    material = UsdShade.Material.Define(stage, f"/World/{prim.GetPrim().GetName()}_look")
    surface = _shader(stage, f"{material.GetPath()}/surface", "UsdPreviewSurface", **inputs)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)
    return material


def _quad(stage, path="/World/quad", st=((0, 0), (1, 0), (1, 1), (0, 1))):
    quad = define_mesh(stage, path, QUAD, [4], range(4))
    primvar = UsdGeom.PrimvarsAPI(quad).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying"
    )
    primvar.Set(np.asarray(st, dtype=np.float32))
    return quad


def _texture(stage, path, file, **inputs):
    reader = _shader(stage, f"{path}_st", "UsdPrimvarReader_float2", varname="st")
    return _shader(stage, path, "UsdUVTexture", file=file, st=(reader, "result"), **inputs)


def _load_only_material(stage):
    scene = saved(stage)
    (mesh,) = scene.meshes
    return scene, mesh, scene.materials[mesh.material]


def test_values_of_a_surface(stage):
    _material(
        stage, define_box(stage, "/World/box"),
        diffuseColor=(0.2, 0.4, 0.6), opacity=0.5, roughness=0.3, metallic=0.25, ior=1.4,
        clearcoat=0.7, clearcoatRoughness=0.2, emissiveColor=(3.0, 2.0, 1.0),
    )  # fmt: skip
    _, _, material = _load_only_material(stage)
    assert material.base_color == pytest.approx((0.2, 0.4, 0.6, 0.5))
    assert material.alpha_mode is AlphaMode.BLEND
    assert material.emissive == (3.0, 2.0, 1.0)
    values = [material.roughness, material.metallic, material.ior, material.clearcoat]
    assert values == pytest.approx([0.3, 0.25, 1.4, 0.7])
    assert (material.specular, material.clearcoat_roughness) == pytest.approx((1.0, 0.2))
    assert not material.double_sided


def _glass(folder, **inputs):
    stage = new_stage(folder / "glass.usda")
    values = {"diffuseColor": (0.2, 0.2, 0.2), "opacity": 0.1, "roughness": 0.0, "ior": 1.52}
    _material(stage, define_box(stage, "/World/box"), **{**values, **inputs})
    return _load_only_material(stage)[2]


def test_smooth_clear_surfaces_are_panes(tmp_path):
    """Light passes by 1 − opacity, and the body has opacity · color, as the specification says."""
    glass = _glass(tmp_path)
    assert glass.alpha_mode is AlphaMode.OPAQUE
    assert (glass.ior, glass.roughness) == (pytest.approx(1.52), 0.0)
    color = np.array(glass.base_color[:3])
    np.testing.assert_allclose(pane_transmission(glass) * color, 0.9, rtol=1e-6)
    np.testing.assert_allclose((1.0 - pane_transmission(glass)) * color, 0.1 * 0.2, rtol=1e-5)
    assert pane_transmission(_glass(tmp_path, opacity=0.0)) == 1.0
    # a colored body tints the light a little: on average it is the same
    tinted = _glass(tmp_path, diffuseColor=(0.0, 1.0, 0.2), opacity=0.2)
    color = np.array(tinted.base_color[:3])
    assert np.mean(pane_transmission(tinted) * color) == pytest.approx(0.8)
    np.testing.assert_allclose(pane_transmission(tinted) * color, 0.8, rtol=0.15)


@pytest.mark.parametrize(
    ("inputs", "mode"),
    [
        ({"roughness": 0.3}, AlphaMode.BLEND),
        ({"metallic": 0.5}, AlphaMode.BLEND),
        ({"opacityMode": "presence"}, AlphaMode.BLEND),
        ({"opacityThreshold": 0.05}, AlphaMode.MASK),
        ({"opacity": 1.0}, AlphaMode.OPAQUE),
    ],
)
def test_other_surfaces_are_no_panes(tmp_path, inputs, mode):
    surface = _glass(tmp_path, **inputs)
    assert surface.alpha_mode is mode
    assert surface.base_color == pytest.approx((0.2, 0.2, 0.2, inputs.get("opacity", 0.1)))
    assert pane_transmission(surface) == 0.0


def test_a_texture_with_scale_wrap_and_transform(tmp_path, stage):
    pixels = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    (tmp_path / "a.png").write_bytes(png(pixels))
    reader = _shader(stage, "/World/st", "UsdPrimvarReader_float2", varname="st")
    turn = _shader(
        stage, "/World/turn", "UsdTransform2d",
        scale=(2.0, 3.0), rotation=90.0, translation=(0.25, 0.5), **{"in": (reader, "result")},
    )  # fmt: skip
    texture = _shader(
        stage, "/World/texture", "UsdUVTexture", file="./a.png", st=(turn, "result"),
        wrapS="clamp", wrapT="repeat", scale=(0.5, 0.6, 0.7, 1.0),
    )  # fmt: skip
    _material(stage, _quad(stage), diffuseColor=(texture, "rgb"))
    _, mesh, material = _load_only_material(stage)
    np.testing.assert_array_equal(material.texture.pixels[..., :3], pixels)
    assert (material.texture.wrap_u, material.texture.wrap_v) == (Wrap.CLAMP_TO_EDGE, Wrap.REPEAT)
    assert material.base_color == pytest.approx((0.5, 0.6, 0.7, 1.0))
    # (s, t) · (2, 3), turned by 90° to (−3 t, 2 s), moved; v down
    order = [int(np.argmin(np.abs(mesh.positions - (p - np.array([0.5, 0.5, 0.0]))).sum(axis=1)))
             for p in np.array(QUAD, dtype=float)]  # fmt: skip
    expected = [(-3 * t + 0.25, 1.0 - (2 * s + 0.5)) for s, t, _ in QUAD]
    np.testing.assert_allclose(mesh.texture_coordinates[order], expected, atol=1e-6)


def test_channels_of_textures_are_packed_as_gltf_has_them(tmp_path, stage):
    pixels = np.random.default_rng(0).integers(0, 256, (4, 4, 3), dtype=np.uint8)
    (tmp_path / "orm.png").write_bytes(png(pixels))
    texture = _texture(stage, "/World/orm", "orm.png")
    _material(
        stage, _quad(stage),
        occlusion=(texture, "r"), roughness=(texture, "b"), metallic=(texture, "g"),
    )  # fmt: skip
    _, _, material = _load_only_material(stage)
    packed = material.metallic_roughness_map
    np.testing.assert_array_equal(packed.pixels[..., 1], pixels[..., 2])
    np.testing.assert_array_equal(packed.pixels[..., 2], pixels[..., 1])
    np.testing.assert_array_equal(material.occlusion_map.pixels[..., 0], pixels[..., 0])
    assert packed.is_linear
    assert (material.metallic, material.roughness) == (1.0, 1.0)


def test_normals_have_their_scale_and_bias(tmp_path):
    """A map whose green is turned over, with the scale that turns it back."""
    pixels = np.random.default_rng(0).integers(0, 256, (4, 4, 3), dtype=np.uint8)
    (tmp_path / "a.png").write_bytes(png(pixels))
    (tmp_path / "b.png").write_bytes(png(pixels * [1, 0, 1] + [0, 255, 0] - pixels * [0, 1, 0]))
    maps = []
    usual = {"scale": (2.0, 2.0, 2.0, 1.0), "bias": (-1.0, -1.0, -1.0, 0.0)}
    turned = {"scale": (2.0, -2.0, 2.0, 1.0), "bias": (-1.0, 1.0, -1.0, 0.0)}
    for name, values in (("a.png", usual), ("b.png", turned), ("a.png", {})):
        (tmp_path / "a.usda").unlink(missing_ok=True)
        stage = new_stage(tmp_path / "a.usda")
        _material(stage, _quad(stage), normal=(_texture(stage, "/World/t", name, **values), "rgb"))
        maps.append(_load_only_material(stage)[2].normal_map)
        del stage
    for one in maps:
        np.testing.assert_array_equal(one.pixels[..., :3], pixels)
        assert one.is_linear


@pytest.mark.parametrize(("threshold", "mode"), [(0.0, AlphaMode.BLEND), (0.4, AlphaMode.MASK)])
def test_opacity_of_another_texture_is_the_alpha(tmp_path, stage, threshold, mode):
    (tmp_path / "color.png").write_bytes(png(np.full((4, 4, 3), 90, dtype=np.uint8)))
    levels = np.random.default_rng(0).integers(0, 256, (8, 8), dtype=np.uint8)
    (tmp_path / "holes.png").write_bytes(png(np.stack([levels] * 3, axis=2)))
    color = _texture(stage, "/World/color", "color.png")
    holes = _texture(stage, "/World/holes", "holes.png")
    _material(
        stage, _quad(stage), diffuseColor=(color, "rgb"), opacity=(holes, "r"),
        opacityThreshold=threshold,
    )  # fmt: skip
    _, _, material = _load_only_material(stage)
    np.testing.assert_array_equal(material.texture.pixels[..., 3], levels)
    assert (material.texture.pixels[..., :3] == 90).all()
    assert material.alpha_mode is mode
    assert material.alpha_cutoff == pytest.approx(threshold or 0.5)


def test_textures_of_a_package_are_read_from_it(tmp_path):
    pixels = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    (tmp_path / "a.png").write_bytes(png(pixels))
    stage = new_stage(tmp_path / "a.usdc")
    _material(stage, _quad(stage), diffuseColor=(_texture(stage, "/World/t", "./a.png"), "rgb"))
    stage.Save()
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usdc"), str(tmp_path / "b.usdz"))
    (tmp_path / "a.png").unlink()
    assert "a.png" in zipfile.ZipFile(tmp_path / "b.usdz").namelist()
    scene = load_scene(tmp_path / "b.usdz")
    np.testing.assert_array_equal(scene.materials[0].texture.pixels[..., :3], pixels)
    assert scene.notices == ()


def test_a_texture_that_is_missing_is_noted_and_its_fallback_drawn(stage):
    texture = _texture(
        stage, "/World/t", "https://example.org/a.png", fallback=(0.1, 0.2, 0.3, 1.0)
    )
    _material(stage, _quad(stage), diffuseColor=(texture, "rgb"))
    scene, _, material = _load_only_material(stage)
    assert material.base_color == pytest.approx((0.1, 0.2, 0.3, 1.0))
    (notice,) = scene.notices
    assert notice.endswith("is missing: drawn without it")


def test_display_colors_of_every_interpolation(stage):
    colors = np.random.default_rng(1).random((24, 3)).astype(np.float32)
    counts = {"constant": 1, "uniform": 6, "vertex": 8, "faceVarying": 24}
    for name, count in counts.items():
        box = define_box(stage, f"/World/{name}")
        primvar = UsdGeom.Gprim(box).CreateDisplayColorPrimvar(name)
        primvar.Set(colors[:count])
    scene = saved(stage)
    by_name = dict(zip(scene.instance_names, scene.meshes, strict=True))
    constant = scene.materials[by_name["constant"].material]
    assert constant.base_color == pytest.approx((*colors[0], 1.0))
    uniform = by_name["uniform"]
    for triangle in range(12):  # both triangles of a quad
        found = uniform.colors[uniform.triangles[triangle], :3]
        np.testing.assert_allclose(found, [colors[triangle // 2]] * 3)
    assert len(by_name["vertex"].positions) == 8
    assert len(uniform.positions) == len(by_name["faceVarying"].positions) == 24
    assert {tuple(row) for row in by_name["faceVarying"].colors[:, :3]} == {
        tuple(row) for row in colors
    }


def test_subsets_have_materials_of_their_own(stage):
    box = define_box(stage, "/World/box")
    _material(stage, box, diffuseColor=(0.1, 0.1, 0.1))
    subset = UsdShade.MaterialBindingAPI(box).CreateMaterialBindSubset("lid", [0, 2])
    _material(stage, subset, diffuseColor=(0.9, 0.1, 0.1))
    scene = saved(stage)
    reds = [round(scene.materials[mesh.material].base_color[0], 6) for mesh in scene.meshes]
    assert dict(zip(reds, (len(mesh.triangles) for mesh in scene.meshes), strict=True)) == {
        0.9: 4, 0.1: 8
    }  # fmt: skip
    assert scene.instance_names == ("box",)


def test_a_material_of_another_kind_is_noted(stage):
    box = define_box(stage, "/World/box")
    UsdGeom.Gprim(box).CreateDisplayColorAttr([(0.3, 0.5, 0.7)])
    material = UsdShade.Material.Define(stage, "/World/look")
    other = _shader(stage, "/World/look/surface", "SomebodysShader")
    material.CreateSurfaceOutput().ConnectToSource(other.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(box.GetPrim()).Bind(material)
    scene, _, drawn = _load_only_material(stage)
    assert drawn.base_color == pytest.approx((0.3, 0.5, 0.7, 1.0))
    assert "material 'look' has no UsdPreviewSurface" in scene.notices[0]


def test_the_material_of_omniverse(tmp_path, stage):
    pixels = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    (tmp_path / "a.png").write_bytes(png(pixels))
    quad = _quad(stage)
    material = UsdShade.Material.Define(stage, "/World/look")
    shader = UsdShade.Shader.Define(stage, "/World/look/shader")
    shader.SetSourceAsset("OmniPBR.mdl", "mdl")
    shader.SetSourceAssetSubIdentifier("OmniPBR", "mdl")
    types = Sdf.ValueTypeNames
    shader.CreateInput("diffuse_tint", types.Color3f).Set(Gf.Vec3f(0.5, 1.0, 0.25))
    shader.CreateInput("diffuse_texture", types.Asset).Set("a.png")
    shader.CreateInput("texture_scale", types.Float2).Set(Gf.Vec2f(2.0, 3.0))
    shader.CreateInput("metallic_constant", types.Float).Set(0.5)
    shader.CreateInput("ORM_texture", types.Asset).Set("a.png")
    material.CreateSurfaceOutput("mdl").ConnectToSource(shader.ConnectableAPI(), "out")
    UsdShade.MaterialBindingAPI.Apply(quad.GetPrim()).Bind(material)
    scene, mesh, drawn = _load_only_material(stage)
    assert drawn.base_color == pytest.approx((0.5, 1.0, 0.25, 1.0))
    assert (drawn.metallic, drawn.roughness) == pytest.approx((0.5, 0.5))
    np.testing.assert_array_equal(drawn.texture.pixels[..., :3], pixels)
    np.testing.assert_allclose(np.ptp(mesh.texture_coordinates, axis=0), (2.0, 3.0))
    assert scene.notices == ("a.usda: ORM_texture of OmniPBR is not drawn (1 material)",)
