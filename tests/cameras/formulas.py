"""Published projections of lenses in plain arithmetic, which share no line with the models."""

import numpy as np


def _image(camera, x, y):
    return np.stack((x, y), axis=-1) * camera.focal_lengths_px + camera.principal_point_px


def kannala_brandt(camera, x, y, z):
    """Pixels (n, 2) of points by OpenCV's documentation of its module fisheye."""
    r = np.hypot(x, y)
    theta = np.arctan2(r, z)
    distorted = theta + sum(k * theta ** (2 * n + 3) for n, k in enumerate(camera.coefficients))
    return _image(camera, distorted * x / r, distorted * y / r)


def brown(camera, x, y, z):
    """Pixels (n, 2) of points on a normalized plane, z + ξ away, with radial and tangential terms.

    Source: KITTI-360's documentation, "2D fisheye images"; with ξ = 0 OpenCV's pinhole camera.
    """
    distance = z / np.sqrt(x * x + y * y + z * z) + camera.xi
    x, y = (one / np.sqrt(x * x + y * y + z * z) / distance for one in (x, y))
    k1, k2, p1, p2 = camera.distortion
    r2 = x * x + y * y
    radial = 1.0 + k1 * r2 + k2 * r2 * r2
    return _image(
        camera,
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )


def eucm(camera, x, y, z):
    """Pixels (n, 2) of points by Khomutenko, Garcia and Martinet."""
    distance = np.sqrt(camera.beta * (x * x + y * y) + z * z)
    scale = camera.alpha * distance + (1.0 - camera.alpha) * z
    return _image(camera, x / scale, y / scale)


def double_sphere(camera, x, y, z):
    """Pixels (n, 2) of points by Usenko, Demmel and Cremers, Eq. 40 to 42."""
    k = camera.xi * np.sqrt(x * x + y * y + z * z) + z
    scale = camera.alpha * np.sqrt(x * x + y * y + k * k) + (1.0 - camera.alpha) * k
    return _image(camera, x / scale, y / scale)


def woodscape(part, x, y, z):
    """Pixels (n, 2) of points by the projection example of WoodScape, from a file's `intrinsic`."""
    chi = np.hypot(x, y)
    theta = 0.5 * np.pi - np.arctan2(z, chi)
    rho = sum(part[f"k{n}"] * theta**n for n in (1, 2, 3, 4))
    u = rho * x / chi + part["cx_offset"] + part["width"] / 2 - 0.5
    return np.stack((u, rho * y / chi + part["cy_offset"] + part["height"] / 2 - 0.5), axis=-1)
