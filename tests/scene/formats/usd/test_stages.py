"""Stages: places, bounds and shapes, against usd-core's own and trimesh."""

import numpy as np
import pytest

from omnisim import load_scene
from omnisim.core.errors import SceneError
from omnisim.scene.space.start_pose import StartPose
from tests.scene.formats.usd.stages import (
    define_box,
    define_mesh,
    new_stage,
    random_ops,
    saved,
    stage_from_prim,
    world_bounds,
)
from tests.scene.world_corners import solid_of

from pxr import Gf, Sdf, Usd, UsdGeom  # isort: skip - after the tests are skipped without it

WORLD_FROM_Y_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def test_transforms_of_every_kind_are_usd_cores(stage):
    rng = np.random.default_rng(4)
    paths = []
    for parent in range(4):
        group = UsdGeom.Xform.Define(stage, f"/World/group_{parent}")
        random_ops(group, rng)
        box = define_box(stage, f"/World/group_{parent}/box")
        random_ops(box, rng)
        paths.append(str(box.GetPath()))
    UsdGeom.Xformable(box).SetResetXformStack(True)
    scene = saved(stage)
    assert scene.instance_names == tuple(path.removeprefix("/World/") for path in paths)
    for path, instance in zip(paths, scene.instances, strict=True):
        np.testing.assert_allclose(
            instance.world_from_mesh, stage_from_prim(stage, path), atol=1e-12
        )
        np.testing.assert_allclose(
            instance.world_from_node, stage_from_prim(stage, path), atol=1e-12
        )
    np.testing.assert_allclose(scene.bounds_m(), world_bounds(stage), rtol=1e-6)


def test_axes_and_unit_are_those_of_the_stage_unless_they_are_given(tmp_path):
    stage = new_stage(tmp_path / "a.usdc", up="Y", meters_per_unit=0.01)
    UsdGeom.XformCommonAPI(define_box(stage, "/World/box")).SetTranslate((10.0, 20.0, 30.0))
    stage.Save()
    (tmp_path / "scene.toml").write_text('file = "a.usdc"\nmeters_per_unit = 0.1\n')
    given = {"up_axis": "z", "meters_per_unit": 1.0}
    for file, options, expected in (
        ("a.usdc", {}, 0.01 * WORLD_FROM_Y_UP @ (10, 20, 30)),
        ("a.usdc", given, (10, 20, 30)),
        ("scene.toml", {}, 0.1 * WORLD_FROM_Y_UP @ (10, 20, 30)),
    ):
        middle = load_scene(tmp_path / file, **options).bounds_m().mean(axis=0)
        np.testing.assert_allclose(middle, expected)


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_shapes_have_the_bounds_that_usd_core_gives_them(tmp_path, axis):
    stage = new_stage(tmp_path / "a.usda", meters_per_unit=0.01)
    UsdGeom.Cube.Define(stage, "/World/cube").CreateSizeAttr(30.0)
    UsdGeom.Sphere.Define(stage, "/World/sphere").CreateRadiusAttr(20.0)
    for kind in (UsdGeom.Cylinder, UsdGeom.Cone, UsdGeom.Capsule):
        shape = kind.Define(stage, f"/World/{kind.__name__}")
        shape.CreateRadiusAttr(15.0)
        shape.CreateHeightAttr(50.0)
        shape.CreateAxisAttr(axis)
    plane = UsdGeom.Plane.Define(stage, "/World/plane")
    plane.CreateWidthAttr(40.0)
    plane.CreateLengthAttr(70.0)
    plane.CreateAxisAttr(axis)
    for prim in stage.GetPrimAtPath("/World").GetChildren():
        points = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), 0)
        UsdGeom.Boundable(prim).CreateExtentAttr(points)
    scene = saved(stage)
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"])
    for prim in stage.GetPrimAtPath("/World").GetChildren():
        box = cache.ComputeWorldBound(prim).ComputeAlignedRange()
        expected = 0.01 * np.array([box.GetMin(), box.GetMax()])
        bounds = scene.bounds_m(prim.GetName())
        # round ones are outside by as much as their triangles are inside: 2e-4 of the radius
        np.testing.assert_allclose(bounds, expected, atol=1e-4, err_msg=prim.GetName())
    assert solid_of(scene, "cube").volume == pytest.approx(0.3**3)
    assert solid_of(scene, "sphere").volume == pytest.approx(4 / 3 * np.pi * 0.2**3, rel=1e-3)
    cylinder, cone, capsule = (solid_of(scene, x) for x in ("Cylinder", "Cone", "Capsule"))
    assert cylinder.volume == pytest.approx(np.pi * 0.15**2 * 0.5, rel=1e-3)
    assert cone.volume == pytest.approx(np.pi * 0.15**2 * 0.5 / 3, rel=1e-3)
    assert capsule.volume == pytest.approx(np.pi * 0.15**2 * (0.5 + 4 / 3 * 0.15), rel=1e-3)
    normal = np.eye(3)["XYZ".index(axis)]
    np.testing.assert_allclose(solid_of(scene, "plane").face_normals, [normal, normal], atol=1e-6)


def test_a_cylinder_of_two_radii_is_a_frustum(stage):
    shape = UsdGeom.Cylinder_1.Define(stage, "/World/cup")
    shape.CreateRadiusBottomAttr(0.3)
    shape.CreateRadiusTopAttr(0.6)
    shape.CreateHeightAttr(2.0)
    shape.CreateAxisAttr("Z")
    cup = solid_of(saved(stage))
    assert cup.volume == pytest.approx(np.pi * 2.0 / 3.0 * (0.09 + 0.18 + 0.36), rel=1e-3)


def test_triangles_of_a_mesh_have_its_area_and_look_outwards(stage):
    define_box(stage, "/World/box")
    left = define_box(stage, "/World/left")
    left.CreateOrientationAttr("leftHanded")
    mirrored = define_box(stage, "/World/mirrored")
    UsdGeom.XformCommonAPI(mirrored).SetScale(Gf.Vec3f(-2.0, 1.0, 1.0))
    scene = saved(stage)
    assert solid_of(scene, "box").volume == pytest.approx(1.0)
    assert solid_of(scene, "box").area == pytest.approx(6.0)
    assert solid_of(scene, "left").volume == pytest.approx(-1.0)
    # the front stays where the renderer has it: winding flips with the determinant
    (one,) = (each for each in scene.instances if each.name == "mirrored")
    assert np.linalg.det(one.world_from_mesh[:3, :3]) == pytest.approx(-2.0)


def test_holes_and_faces_of_two_corners_are_left_out(stage):
    box = define_box(stage, "/World/box")
    box.CreateHoleIndicesAttr([0, 3])
    points = [(5, 0, 0), (6, 0, 0), (6, 1, 0)]
    define_mesh(stage, "/World/thin", points, [2, 3], [0, 1, 0, 1, 2])
    scene = saved(stage)
    assert solid_of(scene, "box").area == pytest.approx(4.0)
    assert solid_of(scene, "thin").area == pytest.approx(0.5)


def test_invisible_and_guiding_prims_are_left_out_with_a_notice(stage):
    define_box(stage, "/World/box")
    hidden = UsdGeom.Xform.Define(stage, "/World/hidden")
    hidden.MakeInvisible()
    define_box(stage, "/World/hidden/inner")
    guide = UsdGeom.Xform.Define(stage, "/World/guide")
    guide.CreatePurposeAttr("guide")
    define_box(stage, "/World/guide/bone")
    shown = define_box(stage, "/World/guide/render")
    shown.CreatePurposeAttr("render")
    stage.DefinePrim("/World/curve", "BasisCurves")
    stage.CreateClassPrim("/class_of_prims")
    define_box(stage, "/class_of_prims/abstract")
    scene = saved(stage)
    assert scene.instance_names == ("box", "guide/render")
    assert scene.notices == (
        "a.usda: invisible prims are not drawn (1 prim)",
        "a.usda: geometry for the purpose guide is not drawn (1 prim)",
        "a.usda: BasisCurves is not drawn (1 prim)",
    )


def test_native_instances_share_meshes(tmp_path):
    chair = new_stage(tmp_path / "chair.usda")
    define_box(chair, "/World/seat")
    define_box(chair, "/World/leg")
    chair.Save()
    stage = new_stage(tmp_path / "a.usda")
    for number in range(3):
        prim = UsdGeom.Xform.Define(stage, f"/World/chair_{number}").GetPrim()
        prim.GetReferences().AddReference("./chair.usda")
        prim.SetInstanceable(True)
        UsdGeom.XformCommonAPI(prim).SetTranslate((2.0 * number, 0.0, 0.0))
    scene = saved(stage)
    assert len(scene.meshes) == 2
    assert scene.instance_names == tuple(
        f"chair_{number}/{part}" for number in range(3) for part in ("seat", "leg")
    )
    np.testing.assert_allclose(scene.bounds_m(), world_bounds(stage))


def test_copies_of_a_point_instancer_are_where_usd_core_puts_them(stage):
    rng = np.random.default_rng(2)
    instancer = UsdGeom.PointInstancer.Define(stage, "/World/forest")
    UsdGeom.XformCommonAPI(instancer).SetTranslate((0.0, 5.0, 0.0))
    tree = UsdGeom.Xform.Define(stage, "/World/forest/tree")
    UsdGeom.XformCommonAPI(tree).SetScale((0.5, 0.5, 2.0))
    define_box(stage, "/World/forest/tree/trunk")
    define_box(stage, "/World/forest/tree/top")
    define_box(stage, "/World/forest/bush")
    instancer.CreatePrototypesRel().SetTargets([tree.GetPath(), Sdf.Path("/World/forest/bush")])
    count = 20
    instancer.CreateProtoIndicesAttr(np.arange(count, dtype=np.int32) % 2)
    instancer.CreatePositionsAttr(rng.uniform(-9, 9, (count, 3)).astype(np.float32))
    instancer.CreateScalesAttr(rng.uniform(0.5, 2, (count, 3)).astype(np.float32))
    turns = [Gf.Quath(0.5, *rng.uniform(-1, 1, 3)).GetNormalized() for _ in range(count)]
    instancer.CreateOrientationsAttr(turns)
    instancer.CreateInvisibleIdsAttr([4])
    scene = saved(stage)
    assert len(scene.meshes) == 3
    assert len(scene.instance_names) == count - 1
    assert {"tree_0", "bush_1"} <= set(scene.instance_names)
    assert "tree_4" not in scene.instance_names
    assert sum(instance.name == "tree_0" for instance in scene.instances) == 2
    np.testing.assert_allclose(scene.bounds_m(), world_bounds(stage), rtol=1e-5)


def test_components_and_prims_with_a_class_are_objects(stage):
    for name in ("left", "right"):
        path = f"/World/{name}/chair"
        Usd.ModelAPI(UsdGeom.Xform.Define(stage, path).GetPrim()).SetKind("component")
        define_box(stage, f"{path}/seat")
        define_box(stage, f"{path}/leg")
    cup = UsdGeom.Xform.Define(stage, "/World/cup_07").GetPrim()
    cup.AddAppliedSchema("SemanticsLabelsAPI:class")
    cup.CreateAttribute("semantics:labels:class", Sdf.ValueTypeNames.TokenArray).Set(["mug"])
    define_box(stage, "/World/cup_07/handle")
    define_box(stage, "/World/cup_07/body")
    scene = saved(stage)
    assert scene.instance_names == ("chair", "chair_1", "cup_07")
    assert [(rule.name, rule.nodes) for rule in scene.labels] == [("mug", ("cup_07",))]


def test_animations_rest_at_their_first_frame(stage):
    stage.SetStartTimeCode(3.0)
    stage.SetEndTimeCode(9.0)
    move = UsdGeom.Xformable(define_box(stage, "/World/box")).AddTranslateOp()
    move.Set((1.0, 0.0, 0.0), 1.0)
    move.Set((7.0, 0.0, 0.0), 7.0)
    scene = saved(stage)
    assert scene.bounds_m().mean(axis=0)[0] == pytest.approx(3.0)
    assert scene.notices == ("a.usda: animation: rests at its first frame (1 prim)",)


def test_a_camera_is_where_a_image_starts(stage):
    define_box(stage, "/World/box")
    camera = UsdGeom.Camera.Define(stage, "/World/camera")
    api = UsdGeom.XformCommonAPI(camera)
    api.SetTranslate((3.0, 4.0, 1.5))
    api.SetRotate((90.0, 0.0, 30.0))  # level, its y up; −z was −z: it looks along y, turned by 30°
    start = saved(stage).start
    assert isinstance(start, StartPose)
    assert start.position_m == pytest.approx((3.0, 4.0, 1.5))
    assert start.yaw_deg == pytest.approx(120.0)


MESH = (
    '#usda 1.0\ndef Mesh "a" {{\npoint3f[] points = [(0, 0, 0)]\n'
    "int[] faceVertexCounts = [{}]\nint[] faceVertexIndices = [0, 0, {}]\n}}\n"
)


def _fault(folder, text):
    """Message about a stage's text."""
    path = folder / "a.usda"
    path.write_text(f"#usda 1.0\n{text}" if text.startswith(("def", "(")) else text)
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < len(str(path)) + 300
    return str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing", "is not a valid usda layer"),
        ("def Xform World {}\n", "a.usda:2:1: syntax error at"),
        ("def Mesh 'm' { int[] a = [3, 3\n", "syntax error at"),
        ("#usda 1.0\n", "has no triangles to draw"),
        ('def "a" (references = @b.usda@) {\n}\n', "Could not open asset @b.usda@"),
        ('(metersPerUnit = 0)\ndef Cube "a" {\n}\n', "metersPerUnit = 0: expected"),
        ('def Cube "a" {\ndouble size = nan\n}\n', "/a.size = nan: expected a number"),
        (MESH.format(3, 7), "/a.faceVertexIndices: expected points below 1, got 7"),
        (MESH.format(4, 0), "/a.faceVertexCounts: expected a sum of 3"),
    ],
)
def test_faults_are_one_line(tmp_path, text, message):
    fault = _fault(tmp_path, text)
    assert message in fault
    assert "pegtl" not in fault  # types of usd-core's parser


def test_usd_core_ends_and_prints_in_a_process_of_its_own(tmp_path, capfd, own_process):
    assert "cannot be read as USD: a.usda:2:" in _fault(tmp_path, "def Mesh (")
    assert capfd.readouterr() == ("", "")  # usd-core writes to standard error by itself


def test_other_units_and_axes_of_a_reference_are_noted_and_not_converted(tmp_path):
    part = new_stage(tmp_path / "part.usda", up="Y", meters_per_unit=0.01)
    define_box(part, "/World/box")
    part.Save()
    stage = new_stage(tmp_path / "a.usda")
    stage.DefinePrim("/World/part").GetReferences().AddReference("part.usda")
    scene = saved(stage)
    np.testing.assert_allclose(scene.bounds_m(), [[-0.5] * 3, [0.5] * 3])
    assert scene.notices == (
        "a.usda: part.usda: metersPerUnit = 0.01 instead of 1.0, upAxis = Y instead of Z in the "
        "stage: USD does not convert it",
    )
