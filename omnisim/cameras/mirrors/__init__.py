"""Mirror shapes of revolution and their meshes, in the mirror frame.

Mirror frame, for every shape: origin at the effective viewpoint, z from there toward the camera
that looks at the mirror, meters. Azimuth turns from +x to +y.
"""

from omnisim.cameras.mirrors.hyperbolic_mirror import HyperbolicMirror, SurfacePoints
from omnisim.cameras.mirrors.mirror_mesh import MirrorMesh, tessellate

__all__ = ["HyperbolicMirror", "MirrorMesh", "SurfacePoints", "tessellate"]
