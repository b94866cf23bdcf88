"""Folders of baked light whose light is known: the same formula in all texels and probes."""

import json

import numpy as np

from omnisim.core.files.image_files import read_radiance, write_image

CELL_PX = 8  # of a triangle's chart, which its cell holds with a texel to spare


def write_baked(folder, scene, light, without=(), spacing_m=0.5):
    """Write light (n, 3) at points (n, 3), linear in them, as the baked light of a scene.

    Each triangle is a chart of its own, and each instance has a page, but for those without.
    """
    folder.mkdir()
    numbers = [i for i in range(len(scene.instances)) if i not in without]
    meshes = sorted({scene.instances[i].mesh for i in numbers})
    side = max(_cells(scene.meshes[i]) for i in meshes) * CELL_PX
    pages = int(np.ceil(np.sqrt(len(numbers))))
    texels = np.zeros((pages * side, pages * side, 3))
    rects = {}
    for page, number in enumerate(numbers):
        top, left = (side * place for place in divmod(page, pages))
        instance = scene.instances[number]
        mesh = scene.meshes[instance.mesh]
        texels[top : top + side, left : left + side] = _page(instance, mesh, side, light)
        scale = 1.0 / (pages * side)
        rects[str(number)] = [left * scale, top * scale, side * scale, side * scale]
    shapes = [scene.meshes[number] for number in meshes]
    counts = np.array([len(mesh.triangles) for mesh in shapes])
    charts = {
        "meshes": np.stack((meshes, 3 * counts, counts), axis=1).astype(np.int32),
        "vertex_of": np.concatenate([mesh.triangles.ravel() for mesh in shapes]).astype(np.int32),
        "triangles": np.concatenate([np.arange(3 * n).reshape(-1, 3) for n in counts]),
        "uv": np.concatenate([_corners_px(mesh).reshape(-1, 2) / side for mesh in shapes]),
    }
    write_image(folder / "irradiance.exr", texels.astype(np.float32))
    np.savez(folder / "unwrapping.npz", **charts)
    low, high = scene.bounds_m()
    shape = tuple(int(n) for n in np.ceil((high - low) / spacing_m) + 1)
    points = low + spacing_m * np.stack(np.indices(shape), axis=-1)
    factors = np.zeros((*shape, 9, 3), dtype=np.float32)
    factors[..., 0, :] = light(points.reshape(-1, 3)).reshape(*shape, 3)
    np.savez(folder / "probes.npz", sh=factors, valid=np.ones(shape, dtype=np.bool_))
    contents = {
        "version": 1,
        "fingerprint": scene.identity.light,
        "rects": rects,
        "probes": {
            "origin_m": low.tolist(), "spacing_m": [spacing_m] * 3, "shape": list(shape)
        },
    }  # fmt: skip
    (folder / "baked.json").write_text(json.dumps(contents))
    return folder


def add_backs(folder, level):
    """Give all instances backs of one level of light, below the fronts in the lightmap."""
    path = folder / "baked.json"
    contents = json.loads(path.read_text())
    texels = read_radiance(folder / "irradiance.exr")
    texels = np.concatenate((texels, np.full_like(texels, level)))
    write_image(folder / "irradiance.exr", texels)
    fronts = {
        name: [left, 0.5 * top, width, 0.5 * height]
        for name, (left, top, width, height) in contents["rects"].items()
    }
    contents["rects"] = fronts
    contents["back_rects"] = {name: [u, v + 0.5, *size] for name, (u, v, *size) in fronts.items()}
    path.write_text(json.dumps(contents))


def _cells(mesh):
    return int(np.ceil(np.sqrt(len(mesh.triangles))))


def _corners_px(mesh):
    """Corners (m, 3, 2) of the triangles' charts."""
    cells = np.stack(np.divmod(np.arange(len(mesh.triangles)), _cells(mesh))[::-1], axis=1)
    corners = np.array([[1.5, 1.5], [CELL_PX - 1.5, 1.5], [1.5, CELL_PX - 1.5]])
    return CELL_PX * cells[:, None] + corners


def _page(instance, mesh, side, light):
    """Texels (side, side, 3): each cell has its triangle's plane, past its edges too."""
    matrix = instance.world_from_mesh
    points = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    page = np.zeros((side, side, 3))
    at = (np.arange(CELL_PX) + 0.5 - 1.5) / (CELL_PX - 3.0)
    v, u = np.meshgrid(at, at, indexing="ij")
    for (a, b, c), corners in zip(mesh.triangles, _corners_px(mesh), strict=True):
        left, top = (corners[0] - 1.5).astype(int)
        plane = points[a] + u[..., None] * (points[b] - points[a])
        plane = plane + v[..., None] * (points[c] - points[a])
        page[top : top + CELL_PX, left : left + CELL_PX] = light(plane.reshape(-1, 3)).reshape(
            CELL_PX, CELL_PX, 3
        )
    return np.maximum(page, 0.0)
