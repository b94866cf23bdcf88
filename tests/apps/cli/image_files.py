"""Images as `omnisim render` writes them, without rendering, and some with a fault."""

import numpy as np

from omnisim.core.files.image_files import write_image
from omnisim.rendering.camera.omnicamera import OmniCamera


def metadata():
    """Camera and poses of an image by the paper's camera."""
    camera = OmniCamera()
    base = camera.base_pose((1.0, 2.0, 0.8), yaw_deg=30.0)
    optical = base.copy()
    optical[:3, :3] = base[:3, :3] @ [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    return {
        "camera": camera.model.parameters(),
        "polygons": 1024,
        "scene": "none",
        "world_from_base": base.tolist(),
        "world_from_optical": optical.tolist(),
    }


def write_images(folder):
    """Write a.png, and some of another size, without k, without a pose, below the ground."""
    good = metadata()
    gray = np.full((360, 360, 3), 128, dtype=np.uint8)
    below = np.array(good["world_from_optical"])
    below[2, 3] = -1.0
    odd = {key: value for key, value in good["camera"].items() if key != "k"}
    write_image(folder / "a.png", gray, good)
    (folder / "image.ini").write_bytes((folder / "a.png").read_bytes())
    write_image(folder / "small.png", gray[:9, :9], good)
    write_image(folder / "odd.png", gray, good | {"camera": odd})
    write_image(folder / "lost.png", gray, good | {"world_from_base": [1, "x"]})
    write_image(folder / "below.png", gray, good | {"world_from_optical": below.tolist()})
