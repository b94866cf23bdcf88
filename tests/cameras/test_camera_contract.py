"""Contract of all camera models."""

import dataclasses
import json

import numpy as np
import pytest

from omnisim.cameras import camera_from_parameters, pixel_grid
from omnisim.core.errors import OpticsError
from tests.camera_examples import CAMERA_EXAMPLES

examples = pytest.mark.parametrize("camera", CAMERA_EXAMPLES.values(), ids=CAMERA_EXAMPLES.keys())


@examples
def test_pixel_to_ray_to_pixel(camera):
    pixels = pixel_grid(camera.width_px, camera.height_px)
    rays = camera.ray_from_pixel(pixels)
    assert rays.directions.shape == (*pixels.shape[:-1], 3)
    assert rays.valid.any()
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=-1), 1.0, atol=1e-12)
    again = camera.pixel_from_ray(3.7 * rays.directions[rays.valid])
    assert again.valid.all()
    assert np.abs(again.positions_px - pixels[rays.valid]).max() < 1e-9


@examples
def test_unseen_directions_are_not_valid_and_finite(camera):
    axes = np.concatenate((np.eye(3), -np.eye(3)))
    directions = np.concatenate((axes, np.random.default_rng(1).normal(size=(5000, 3))))
    pixels = camera.pixel_from_ray(directions)
    assert pixels.valid.any()
    assert np.isfinite(pixels.positions_px).all()


@examples
def test_leading_axes_broadcast(camera):
    one = camera.ray_from_pixel((10.0, 20.0))
    many = camera.ray_from_pixel(np.full((2, 3, 2), (10.0, 20.0)))
    assert one.directions.shape == (3,)
    assert one.valid.shape == ()
    assert many.directions.shape == (2, 3, 3)
    np.testing.assert_array_equal(many.directions[1, 2], one.directions)


@examples
@pytest.mark.parametrize("values", [(1.0, 2.0, 3.0, 4.0), 5.0, [[1.0], [2.0]], "ab", [[1], [1, 2]]])
def test_other_shapes_say_what_was_expected(camera, values):
    with pytest.raises(OpticsError, match=r"expected pixels \(\.\.\., 2\), got"):
        camera.ray_from_pixel(values)
    with pytest.raises(OpticsError, match=r"expected directions \(\.\.\., 3\), got"):
        camera.pixel_from_ray(values)


@examples
@pytest.mark.parametrize("value", [None, {}, [None, None]], ids=["none", "mapping", "list"])
def test_parameters_of_other_types_say_what_was_expected(camera, value):
    for field in dataclasses.fields(camera):
        with pytest.raises(OpticsError, match=rf"camera\.{field.name}(\.0)?: expected .* got"):
            dataclasses.replace(camera, **{field.name: value})


@pytest.mark.parametrize("value", [1e300, -1e61])
def test_coefficients_whose_terms_overflow_are_refused(value):
    for camera in CAMERA_EXAMPLES.values():
        for field in dataclasses.fields(camera):
            if isinstance(getattr(camera, field.name), tuple) and "px" not in field.name:
                changed = {field.name: (*getattr(camera, field.name)[:-1], value)}
                with pytest.raises(OpticsError, match=rf"{field.name}(\.\d+)?: expected "):
                    dataclasses.replace(camera, **changed)


@examples
def test_numpy_numbers_are_plain_parameters(camera):
    given = {field.name: getattr(camera, field.name) for field in dataclasses.fields(camera)}
    numbers = {name: np.array(one) for name, one in given.items() if isinstance(one, tuple)}
    numbers |= {name: np.float64(one) for name, one in given.items() if isinstance(one, float)}
    again = dataclasses.replace(camera, **numbers, width_px=np.int64(camera.width_px))
    assert again == camera
    assert json.dumps(again.parameters()) == json.dumps(camera.parameters())


@examples
def test_parameters_round_trip(camera):
    as_json = json.loads(json.dumps(camera.parameters()))
    again = camera_from_parameters(as_json)
    assert type(again) is type(camera)
    pixels = pixel_grid(camera.width_px, camera.height_px)[::7, ::7]
    one, other = again.ray_from_pixel(pixels), camera.ray_from_pixel(pixels)
    np.testing.assert_allclose(one.directions, other.directions, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(one.valid, other.valid)
    assert (again.width_px, again.height_px) == (camera.width_px, camera.height_px)


def _edge_pixels(camera):
    """The last valid pixels, to the last bit, on lines out of the domain's middle."""
    grid = pixel_grid(camera.width_px, camera.height_px).reshape(-1, 2)
    inside = grid[camera.ray_from_pixel(grid).valid]
    start = inside[np.argmin(np.linalg.norm(inside - inside.mean(axis=0), axis=1))]
    turn = np.linspace(0.0, 2.0 * np.pi, 97)
    seen = np.tile(start, (len(turn), 1))
    unseen = start + 1e5 * np.stack((np.cos(turn), np.sin(turn)), axis=-1)
    ends = ~camera.ray_from_pixel(unseen).valid
    seen, unseen = seen[ends], unseen[ends]
    for _ in range(80):
        middle = 0.5 * (seen + unseen)
        if np.all((middle == seen) | (middle == unseen)):
            break
        valid = camera.ray_from_pixel(middle).valid[:, None]
        seen, unseen = np.where(valid, middle, seen), np.where(valid, unseen, middle)
    return seen


@examples
def test_edges_of_the_domain_round_trip(camera):
    pixels = _edge_pixels(camera)
    rays = camera.ray_from_pixel(pixels)
    assert rays.valid.all()
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=-1), 1.0, atol=1e-12)
    again = camera.pixel_from_ray(rays.directions)
    assert again.valid.all()
    assert np.all(np.abs(again.positions_px - pixels) < 1e-9)


@examples
def test_no_two_rays_share_a_pixel(camera):
    """Every ray that is seen comes back from its pixel; so no other can have the same pixel."""
    generator = np.random.default_rng(2)
    rays = generator.normal(size=(200_000, 3))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    pixels = camera.pixel_from_ray(rays)
    again = camera.ray_from_pixel(pixels.positions_px[pixels.valid])
    angles = np.linalg.norm(again.directions - rays[pixels.valid], axis=-1)
    assert angles.max() < 1e-7
    assert np.mean(again.valid) > 0.999  # but for rounding at the edge


DERIVED = {"model", "xi", "unified_focal_length_px"}


@examples
@pytest.mark.parametrize("bad", ["missing", "word", "nan"])
def test_bad_parameters_are_named(camera, bad):
    keys = camera.parameters().keys() - DERIVED
    for key in keys - camera.added_later if bad == "missing" else keys:
        parameters = camera.parameters()
        if bad == "missing":
            del parameters[key]
        else:
            parameters[key] = "11" if bad == "word" else float("nan")
        with pytest.raises(OpticsError, match=key):
            camera_from_parameters(parameters)


def test_parameters_that_older_images_lack_have_their_default():
    for camera in CAMERA_EXAMPLES.values():
        older = {k: v for k, v in camera.parameters().items() if k not in camera.added_later}
        fields = {one.name: one.default for one in dataclasses.fields(camera)}
        read = camera_from_parameters(older)
        assert all(getattr(read, name) == fields[name] for name in camera.added_later)


def test_unknown_model_is_named():
    with pytest.raises(OpticsError, match=r"model: expected one of hyperbolic, .* got 'pinhole'"):
        camera_from_parameters({"model": "pinhole"})
