"""Mirror shapes of revolution and their meshes, in the mirror frame.

Mirror frame, for every shape: origin at the effective viewpoint, z from there towards the camera
that looks at the mirror, metres. Azimuth turns from +x to +y.
"""

from omnisim.mirrors.hyperbolic import HyperbolicMirror, SurfacePoints
from omnisim.mirrors.mirror_mesh import MirrorMesh
from omnisim.mirrors.tessellation import tessellate

__all__ = ["HyperbolicMirror", "MirrorMesh", "SurfacePoints", "tessellate"]
