"""Features of USD: types of prims, their properties, and applied schemas."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pxr import Usd

from omnisim.scene.formats.features import Feature, Support

_APPLIED, _LEFT_OUT, _IGNORED = Support.APPLIED, Support.LEFT_OUT, Support.IGNORED
_LIGHTS = ("SphereLight", "DiskLight", "RectLight", "CylinderLight", "DistantLight", "DomeLight")
_READ_TYPES = ("Mesh", "Camera", *_LIGHTS)  # types whose properties are looked at


def _has_cards(value: Any) -> bool:
    return str(value) in ("cards", "bounds", "origin")


USD_FEATURES = (
    Feature("Xform, Scope, visibility, purpose", _APPLIED, "invisible prims, guides and proxies are left out: noted"),
    Feature("references, payloads, sublayers, variants", _APPLIED, "composed by usd-core, nothing is fetched from the net; other units and up axes in them are noted, and not converted"),
    Feature("metersPerUnit, upAxis", _APPLIED, "of the stage; `--meters-per-unit` and `--up` overrule them"),
    Feature("Mesh, points, faceVertexCounts, faceVertexIndices, holeIndices, orientation, doubleSided, normals", _APPLIED, "polygons as triangles, concave ones too; normals, texture coordinates and colors of every interpolation"),
    Feature("subdivisionScheme, interpolateBoundary, faceVaryingLinearInterpolation, triangleSubdivisionRule, cornerIndices, cornerSharpnesses, creaseIndices, creaseLengths, creaseSharpnesses", _APPLIED, "the control mesh, smooth where it has no normals: noted"),
    Feature("Cube, Sphere, Cylinder, Cylinder_1, Cone, Capsule, Capsule_1, Plane", _APPLIED, "triangles, as fine as ranges need"),
    Feature("GeomSubset", _APPLIED, "a material each"),
    Feature("PointInstancer, instances", _APPLIED, "one mesh, many poses"),
    Feature("BasisCurves, HermiteCurves, NurbsCurves, NurbsPatch, Points, TetMesh, Volume, ParticleField, ParticleField3DGaussianSplat", _APPLIED, "not drawn: noted"),
    Feature("Material, Shader, NodeGraph, MaterialBindingAPI", _APPLIED, "UsdPreviewSurface and OmniPBR; the others, and MaterialX, in the prims' display color: noted"),
    Feature("UsdPreviewSurface", _APPLIED, "base color, opacity and its threshold; a constant opacity of a smooth surface (roughness up to 0.2, no metal, no textures) is a thin pane, unless `opacityMode` is `presence`; metal, roughness, normals, occlusion, emission and clear coat; textures with `UsdTransform2d`, wrap modes, scale and bias, also from within `.usdz`; `<UDIM>`: the first tile"),
    Feature("OmniPBR", _APPLIED, "color, opacity, metal, roughness, emission, textures of color and normals; other maps are noted"),
    Feature(f"{', '.join(_LIGHTS)}, DomeLight_1, LightAPI, inputs", _APPLIED, "suns, lamps and spots by their luminous intensity; a dome's color, or its texture where it is `latlong`, is the light from everywhere and the background"),
    Feature("inputs:specular", _LEFT_OUT, "highlights of lights follow their intensity, not `specular`", "light", lambda value: value != 1.0),
    Feature("inputs:shaping:focus", _LEFT_OUT, "the focus of lights is not applied", "light", bool),
    Feature("inputs:shaping:ies:file", _LEFT_OUT, "IES profiles are not applied", "light", lambda value: bool(getattr(value, "path", ""))),
    Feature("inputs:shadow:enable", _LEFT_OUT, "lights have shadows, though `shadow:enable` is false", "light", lambda value: value is False),
    Feature("inputs:shadow:color", _LEFT_OUT, "colors of shadows are not drawn", "light", lambda value: bool(value) and any(value)),
    Feature("light:filters, collection:lightLink:includes, collection:lightLink:excludes, collection:shadowLink:excludes, collection:shadowLink:includes", _LEFT_OUT, "lights shine on everything, without filters and links", "light", bool),
    Feature("GeometryLight, PluginLight, PortalLight, MeshLightAPI, VolumeLightAPI", _LEFT_OUT, "other lights do not shine", "light"),
    Feature("Camera, lenses, cameraProjectionType, fthetaWidth, fthetaHeight, fthetaCx, fthetaCy, fthetaMaxFov, fthetaPolyA, fthetaPolyB, fthetaPolyC, fthetaPolyD, fthetaPolyE, horizontalAperture, verticalAperture, horizontalApertureOffset, verticalApertureOffset, focalLength, projection", _APPLIED, "viewpoints with lenses: `--at-camera`; pinholes, `opencvPinhole`, `opencvFisheye`, `kannalaBrandtK3`, `ftheta` of k1 to k4; `radTanThinPrism` and tables are noted; images start at the first"),
    Feature("fStop, focusDistance, exposure, exposure:fStop, exposure:iso, exposure:responsivity, exposure:time, shutter:open, shutter:close, clippingRange, clippingPlanes, stereoRole", _IGNORED, "of a sensor file, not of a lens"),
    Feature("model:drawMode", _LEFT_OUT, "cards and bounds stand for geometry, which is drawn", "prim", _has_cards),
    Feature("SemanticsLabelsAPI", _APPLIED, "classes; a prim with a class is one instance, and so is a component"),
    Feature("time samples", _APPLIED, "as they are at the stage's start: noted"),
    Feature("SkelRoot, Skeleton, SkelAnimation, BlendShape, SkelBindingAPI", _APPLIED, "the mesh is drawn as it is stored: noted"),
    Feature("GenerativeProcedural, Field3DAsset, OpenVDBAsset", _LEFT_OUT, "procedurals and fields are not drawn", "prim"),
    Feature("velocities, accelerations, extent, proxyPrim, xformOpOrder, SpatialAudio, Backdrop, RenderSettings, RenderProduct, RenderVar, RenderPass, LODDistanceHeuristic, LODScreenSizeHeuristic, LightFilter, PluginLightFilter, PhysicsScene, PhysicsJoint, PhysicsCollisionGroup, PhysicsDistanceJoint, PhysicsFixedJoint, PhysicsPrismaticJoint, PhysicsRevoluteJoint, PhysicsSphericalJoint, collection, light:shaderId, light:materialSyncMode, portals, guideRadius", _IGNORED, "they show nothing"),
)  # fmt: skip


def stage_parts(stage: Usd.Stage, time: Usd.TimeCode) -> Iterator[tuple[str, Any]]:
    """Types of the prims of a stage and its prototypes, and the properties of those that are read."""
    known = {name for feature in USD_FEATURES for name in feature.names}
    roots = (stage.GetPseudoRoot(), *stage.GetPrototypes())
    for prim in (one for root in roots for one in Usd.PrimRange(root)):
        kind = str(prim.GetTypeName())
        if kind:
            yield kind, prim
        for schema in prim.GetAppliedSchemas():
            if schema in known:
                yield schema, prim
        for attribute in prim.GetAuthoredProperties():
            name = str(attribute.GetName())
            is_own = kind in _READ_TYPES and ":" not in name
            if name in known or is_own:
                yield name, attribute.Get(time) if isinstance(attribute, Usd.Attribute) else True
