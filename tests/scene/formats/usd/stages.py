"""Stages that tests write with usd-core, and what usd-core says about them."""

import numpy as np
import pytest
import trimesh

pytest.importorskip("pxr", reason="usd-core is not installed")
from pxr import Gf, Usd, UsdGeom

from omnisim.scene import load_scene


def new_stage(path, up="Z", meters_per_unit=1.0):
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, meters_per_unit)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    return stage


def saved(stage):
    """Scene of a stage's file."""
    stage.Save()
    return load_scene(stage.GetRootLayer().realPath)


def define_mesh(stage, path, points, counts, vertices):
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(np.asarray(points, dtype=np.float32))
    mesh.CreateFaceVertexCountsAttr(np.asarray(counts, dtype=np.int32))
    mesh.CreateFaceVertexIndicesAttr(np.asarray(vertices, dtype=np.int32))
    mesh.CreateSubdivisionSchemeAttr("none")
    return mesh


def define_box(stage, path):
    """Box of quads from −0.5 to 0.5."""
    corners = trimesh.creation.box()
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return define_mesh(stage, path, corners.vertices, [4] * 6, np.ravel(quads))


def world_bounds(stage):
    """Bounds (2, 3) by usd-core, in the axes and units of the stage."""
    cache = UsdGeom.BBoxCache(Usd.TimeCode.EarliestTime(), ["default", "render"], False)
    box = cache.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    return np.array([box.GetMin(), box.GetMax()])


def stage_from_prim(stage, path):
    """Matrix (4, 4) by usd-core."""
    imageable = UsdGeom.Imageable(stage.GetPrimAtPath(path))
    return np.array(imageable.ComputeLocalToWorldTransform(Usd.TimeCode.EarliestTime())).T


def random_ops(prim, rng):
    """Transform operations of every kind, in a random order."""
    form = UsdGeom.Xformable(prim)

    def vector():
        return Gf.Vec3d(*rng.uniform(0.5, 2.0, 3))

    kinds = [
        lambda: form.AddTranslateOp().Set(vector()),
        lambda: form.AddScaleOp().Set(Gf.Vec3f(*rng.uniform(0.5, 2.0, 3))),
        lambda: form.AddRotateXYZOp().Set(Gf.Vec3f(*rng.uniform(-90, 90, 3))),
        lambda: form.AddRotateZYXOp(opSuffix="b").Set(Gf.Vec3f(*rng.uniform(-90, 90, 3))),
        lambda: form.AddRotateYOp().Set(float(rng.uniform(-90, 90))),
        lambda: form.AddOrientOp().Set(Gf.Quatf(0.5, *rng.uniform(-1, 1, 3)).GetNormalized()),
        lambda: form.AddTransformOp().Set(Gf.Matrix4d().SetTranslate(vector())),
        lambda: form.AddTranslateOp(opSuffix="pivot").Set(vector()),
    ]
    for index in rng.permutation(len(kinds)):
        kinds[index]()
    form.AddTranslateOp(opSuffix="pivot", isInverseOp=True)
