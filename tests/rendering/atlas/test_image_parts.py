"""Parts of images: each holds all that its pixels look up, and all parts together are the image."""

import math

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera, HyperbolicCamera, OrthographicCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.cube import face_index, face_tangents
from omnisim.core.errors import GraphicsError
from omnisim.rendering.atlas import image_parts as parts_of_images
from omnisim.rendering.atlas.image_parts import image_parts
from omnisim.rendering.atlas.tile_plan import plan_tiles
from tests.camera_examples import camera_examples

SIDE_PX = 16384
FISHEYE = EquidistantCamera(4000, 3000, 950.0, (1999.5, 1499.5), theta_max_rad=math.radians(95.0))
MIRROR = HyperbolicCamera.framed_on_rim(HyperbolicMirror(), 4000, 3000)


@pytest.fixture
def small_parts(monkeypatch):
    monkeypatch.setattr(parts_of_images, "MAX_TEXELS", 1 << 12)
    monkeypatch.setattr(parts_of_images, "PART_PX", 1024)


def _parts(camera, texels_per_pixel=1.0, **options):
    plan = plan_tiles(camera, camera.rig_from_optical, texels_per_pixel, subdivide=True, **options)
    return plan, image_parts(camera, plan, SIDE_PX)


def _places(camera, plan, rectangle_px):
    """Tile of the whole plan, and tangents on its face, of the rays of all pixels' corners."""
    left, top, width, height = rectangle_px
    rays = camera.ray_from_pixel(pixel_grid(width + 1, height + 1) + (left - 0.5, top - 0.5))
    directions = rays.directions[rays.valid] @ camera.rig_from_optical.T
    faces = face_index(directions)
    tangents = face_tangents(directions, faces)
    tiles = np.full(len(faces), -1)
    for number, tile in enumerate(plan.tiles):
        first, last = np.array(tile.region)
        inside = np.all((tangents >= first) & (tangents <= last), axis=-1)
        tiles[inside & (faces == tile.face)] = number
    return tiles, tangents


def _inside_texels(tile, tangents):
    """Least distance of tangents from a tile's edges, texels."""
    first, last = tile.padded_region
    return 0.5 * tile.face_size_px * np.minimum(tangents - first, last - tangents).min()


def _cut_tiles(camera, plan, part):
    """Tiles of the whole plan that a part's pixels see, with the part's own of the same region.

    Each holds what its pixels look up: with a texel of the coarsest level around it.
    """
    held = {(tile.face, tile.region): tile for tile in part.plan.tiles}
    tiles, tangents = _places(camera, plan, part.rectangle_px)
    for number in np.unique(tiles[tiles >= 0]).tolist():
        whole = plan.tiles[number]
        cut = held[whole.face, whole.region]
        seen = tangents[tiles == number]
        needed = min(1 << plan.max_level, _inside_texels(whole, seen))
        assert _inside_texels(cut, seen) >= needed - 1e-6
        yield whole, cut


@camera_examples
@pytest.mark.usefixtures("small_parts")
def test_atlases_of_parts_hold_what_their_pixels_look_up(camera):
    plan, parts = _parts(camera, 2.0, level_bias=-0.5)
    assert parts
    drawn = np.zeros((camera.height_px, camera.width_px), dtype=int)
    for part in parts:
        left, top, width, height = part.rectangle_px
        drawn[top : top + height, left : left + width] += 1
        assert max(part.plan.width_px, part.plan.height_px) <= parts_of_images.PART_PX
        assert part.plan.max_level == plan.max_level
        for whole, cut in _cut_tiles(camera, plan, part):  # the same texels
            assert cut.face_size_px == whole.face_size_px
            for axis in (0, 1):
                moved = cut.face_corner_px[axis] - whole.face_corner_px[axis]
                assert moved % 8 == moved % (1 << plan.max_level) == 0
    assert drawn.max() == 1
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    assert (drawn[rays.valid] == 1).all()


def test_usual_images_are_a_single_part():
    camera = EquidistantCamera(1400, 1050, 330.0, (699.5, 524.5), theta_max_rad=math.pi / 2)
    plan, parts = _parts(camera, 2.9)
    assert parts == [((0, 0, 1400, 1050), plan)]
    assert parts[0].plan is plan


@pytest.mark.parametrize(("camera", "scale"), [(FISHEYE, 2.04), (MIRROR, 1.0)])
def test_images_of_many_megapixels_are_few_parts_of_hardly_more_texels(camera, scale):
    """50 and 12 megapixels, at default quality."""
    camera = camera.scaled(scale)
    plan, parts = _parts(camera, 2.9)
    texels = sum(part.plan.texels for part in parts)
    assert texels < (1.05 if scale == 1.0 else 1.4) * plan.texels
    assert len(parts) <= (4 if scale == 1.0 else 30)
    tiles = [len(part.plan.tiles) for part in parts]
    assert max(tiles) == tiles[0] <= len(plan.tiles)
    assert len({(part.plan.width_px, part.plan.height_px) for part in parts}) == 1


@pytest.mark.usefixtures("small_parts")
def test_the_rim_of_a_flat_lens_is_held():
    """Beyond the last whole cell of pixels, its rays turn by more than within the cell."""
    camera = OrthographicCamera(600, 600, 288.0, (299.5, 299.5))
    plan, parts = _parts(camera, 0.8)
    assert len(parts) > 1
    assert all(list(_cut_tiles(camera, plan, part)) for part in parts)


def test_faces_too_fine_for_any_part_are_refused():
    camera = FISHEYE.scaled(0.1)
    plan = plan_tiles(camera, camera.rig_from_optical, face_size_px=10**7)
    with pytest.raises(GraphicsError, match=r"^an atlas of \d+ × \d+ texels: expected .* smaller$"):
        image_parts(camera, plan, SIDE_PX)
