"""Examples of every camera model, for the contract test and the GLSL comparison."""

import math

from omnisim.cameras import HyperbolicCamera
from omnisim.mirrors import HyperbolicMirror


def _framed(width, height, **mirror):
    return HyperbolicCamera.framed_on_rim(HyperbolicMirror(**mirror), width, height)


CAMERA_EXAMPLES = {
    "hyperbolic-paper": _framed(360, 360),
    "hyperbolic-wide-picture": _framed(640, 480),
    "hyperbolic-up-face": _framed(401, 401, theta_max_rad=math.radians(150.0)),
    "hyperbolic-nearly-parabolic": _framed(512, 512, k=400.0, theta_max_rad=math.radians(120.0)),
    "hyperbolic-nearly-plane": _framed(300, 200, k=2.02, theta_max_rad=math.radians(70.0)),
    "hyperbolic-plane": _framed(300, 200, k=2.0, theta_max_rad=math.radians(60.0)),
    "hyperbolic-off-centre": HyperbolicCamera(
        HyperbolicMirror(), 480, 360, focal_length_px=1300.0, principal_point_px=(200.25, 150.75)
    ),
}
