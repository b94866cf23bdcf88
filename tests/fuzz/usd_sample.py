"""Stage of USD with all that is read of one, for the fuzzer."""

from pathlib import Path

TEXT = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 0.5
    upAxis = "Z"
    startTimeCode = 1
    endTimeCode = 2
)
def Xform "World" ( kind = "group" ) {
    def Mesh "floor" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
        uniform token subdivisionScheme = "none"
        uniform bool doubleSided = 1
        point3f[] points = [(-9, -9, 0), (9, -9, 0), (2, 0, 0), (9, 9, 0), (-9, 9, 0)]
        int[] faceVertexCounts = [5]
        int[] faceVertexIndices = [0, 1, 2, 3, 4]
        normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (0.5, 0.5), (1, 1), (0, 1)] (
            interpolation = "faceVarying" )
        int[] primvars:st:indices = [0, 1, 2, 3, 4]
        color3f[] primvars:displayColor = [(1, 0, 0)]
        rel material:binding = </World/look>
        def GeomSubset "part" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [0]
            rel material:binding = </World/look>
        }
    }
    def Material "look" {
        token outputs:surface.connect = </World/look/surface.outputs:surface>
        def Shader "surface" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </World/look/texture.outputs:rgb>
            float inputs:opacity.connect = </World/look/texture.outputs:a>
            float inputs:opacityThreshold = 0.5
            float inputs:roughness.connect = </World/look/texture.outputs:g>
            normal3f inputs:normal.connect = </World/look/texture.outputs:rgb>
            color3f inputs:emissiveColor = (1, 2, 0)
            token outputs:surface
        }
        def Shader "texture" {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @wood.png@
            token inputs:wrapS = "mirror"
            float4 inputs:scale = (1, 0.5, 1, 1)
            float2 inputs:st.connect = </World/look/turn.outputs:result>
            float outputs:a
            float outputs:g
            float3 outputs:rgb
        }
        def Shader "turn" {
            uniform token info:id = "UsdTransform2d"
            float2 inputs:in.connect = </World/look/st.outputs:result>
            float inputs:rotation = 30
            float2 inputs:scale = (2, 2)
            float2 outputs:result
        }
        def Shader "st" {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }
    }
    def Xform "chair" (
        kind = "component"
        variants = {
            string shape = "round"
        }
        prepend variantSets = "shape"
    ) {
        float3 xformOp:rotateXYZ.timeSamples = {
            1: (0, 0, 30),
            2: (0, 0, 60),
        }
        double3 xformOp:translate = (4, 1, 1)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
        variantSet "shape" = {
            "round" {
                def Cylinder "seat" {
                    double radius = 0.5
                }
            }
            "square" {
                def Cube "seat" {}
            }
        }
    }
    def Xform "copy" (
        instanceable = true
        references = </World/chair>
    ) {}
    def PointInstancer "trees" {
        rel prototypes = [</World/trees/cone>]
        int[] protoIndices = [0, 0]
        point3f[] positions = [(3, 3, 1), (3, -3, 1)]
        quath[] orientations = [(1, 0, 0, 0), (0, 0, 0, 1)]
        float3[] scales = [(1, 1, 1), (1, 2, 1)]
        int64[] invisibleIds = [1]
        def Cone "cone" {}
    }
    def Mesh "lump" ( prepend apiSchemas = ["SemanticsLabelsAPI:class"] ) {
        token[] semantics:labels:class = ["stone"]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
        int[] faceVertexCounts = [3, 3, 3, 3]
        int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3]
        int[] holeIndices = [0]
    }
    def SphereLight "lamp" ( prepend apiSchemas = ["ShapingAPI"] ) {
        float inputs:intensity = 30
        float inputs:exposure = 1
        float inputs:shaping:cone:angle = 40
        double3 xformOp:translate = (0, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DomeLight "sky" {
        color3f inputs:color = (0.5, 0.6, 0.7)
    }
    def Camera "camera" {
        double3 xformOp:translate = (0, 0, 2)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


def write_sample(path: Path) -> None:
    """Write the stage, as text or in usd-core's binary format."""
    if path.suffix == ".usda":
        path.write_text(TEXT)
        return
    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(TEXT)
    layer.Export(str(path))
