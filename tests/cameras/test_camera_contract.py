"""Contract of all camera models; what their base classes do is tested once a class."""

import dataclasses
import json

import numpy as np
import pytest

from omnisim.cameras import camera_from_parameters, pixel_grid
from omnisim.cameras.parametric_camera import RadialCamera
from omnisim.core.errors import OpticsError
from tests.camera_examples import CAMERA_EXAMPLES, FIRST_EXAMPLES

examples = pytest.mark.parametrize("camera", CAMERA_EXAMPLES.values(), ids=CAMERA_EXAMPLES.keys())
FIRST = {name: camera for name, camera in CAMERA_EXAMPLES.items() if name in FIRST_EXAMPLES}
models = pytest.mark.parametrize("camera", FIRST.values(), ids=FIRST.keys())
DERIVED = {"model", "xi", "unified_focal_length_px"}  # parameters that are not read


def _check_round_trip(camera, pixels):
    rays = camera.ray_from_pixel(pixels)
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=-1), 1.0, atol=1e-12)
    again = camera.pixel_from_ray(3.7 * rays.directions[rays.valid])
    assert again.valid.all()
    assert np.abs(again.positions_px - pixels[rays.valid]).max() < 1e-9
    return rays


@examples
def test_pixel_to_ray_to_pixel(camera):
    pixels = pixel_grid(camera.width_px, camera.height_px)[::5, ::5]
    rays = _check_round_trip(camera, pixels)
    assert rays.directions.shape == (*pixels.shape[:-1], 3)
    assert rays.valid.any()


@examples
def test_pixels_that_it_sees_are_those_with_valid_rays(camera, monkeypatch):
    pixels = pixel_grid(camera.width_px + 60, camera.height_px + 60)[::3, ::3] - 30.0
    valid = camera.ray_from_pixel(pixels).valid
    if isinstance(camera, RadialCamera):  # the radius alone decides: nothing is inverted
        monkeypatch.setattr(type(camera), "_theta_from_radius", None)
    assert np.array_equal(camera.sees(pixels), valid)


@examples
def test_edges_of_the_domain_round_trip(camera):
    """The last valid pixels, to the last bit, on lines out of the domain's middle."""
    grid = pixel_grid(camera.width_px, camera.height_px)[::8, ::8].reshape(-1, 2)
    inside = grid[camera.ray_from_pixel(grid).valid]
    start = inside[np.argmin(np.linalg.norm(inside - inside.mean(axis=0), axis=1))]
    turn = np.linspace(0.0, 2.0 * np.pi, 33)
    unseen = start + 1e5 * np.stack((np.cos(turn), np.sin(turn)), axis=-1)
    unseen = unseen[~camera.ray_from_pixel(unseen).valid]
    seen = np.tile(start, (len(unseen), 1))
    each = np.arange(len(unseen))
    for _ in range(18):  # sixteenths: 1e5 px to the last bit of a pixel
        places = seen + np.linspace(0.0, 1.0, 17)[:, None, None] * (unseen - seen)
        places[0], places[-1] = seen, unseen
        valid = camera.ray_from_pixel(places[1:]).valid
        valid[-1] = False
        first = np.argmin(valid, axis=0)
        seen, unseen = places[first, each], places[first + 1, each]
    if len(seen):
        assert _check_round_trip(camera, seen).valid.all()


@examples
def test_no_two_rays_share_a_pixel(camera):
    """Every ray that is seen comes back from its pixel; so no other can have the same pixel."""
    axes = np.concatenate((np.eye(3), -np.eye(3)))
    rays = np.concatenate((axes, np.random.default_rng(2).normal(size=(20_000, 3))))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    pixels = camera.pixel_from_ray(rays)
    assert np.isfinite(pixels.positions_px).all()
    again = camera.ray_from_pixel(pixels.positions_px[pixels.valid])
    angles = np.linalg.norm(again.directions - rays[pixels.valid], axis=-1)
    assert angles.max() < 1e-7
    assert np.mean(again.valid) > 0.999  # but for rounding at the edge


@examples
def test_parameters_round_trip(camera):
    again = camera_from_parameters(json.loads(json.dumps(camera.parameters())))
    assert type(again) is type(camera)
    assert (again.width_px, again.height_px) == (camera.width_px, camera.height_px)
    pixels = pixel_grid(camera.width_px, camera.height_px)[::7, ::7]
    one, other = again.ray_from_pixel(pixels), camera.ray_from_pixel(pixels)
    np.testing.assert_allclose(one.directions, other.directions, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(one.valid, other.valid)


@models
def test_leading_axes_broadcast_and_other_shapes_are_refused(camera):
    one = camera.ray_from_pixel((10.0, 20.0))
    many = camera.ray_from_pixel(np.full((2, 3, 2), (10.0, 20.0)))
    assert (one.directions.shape, one.valid.shape) == ((3,), ())
    assert many.directions.shape == (2, 3, 3)
    np.testing.assert_array_equal(many.directions[1, 2], one.directions)
    for values in ((1.0, 2.0, 3.0, 4.0), 5.0, [[1.0], [2.0]], "ab", [[1], [1, 2]]):
        with pytest.raises(OpticsError, match=r"expected pixels \(\.\.\., 2\), got"):
            camera.ray_from_pixel(values)
        with pytest.raises(OpticsError, match=r"expected directions \(\.\.\., 3\), got"):
            camera.pixel_from_ray(values)


@models
def test_numpy_numbers_are_plain_parameters(camera):
    given = {field.name: getattr(camera, field.name) for field in dataclasses.fields(camera)}
    numbers = {name: np.array(one) for name, one in given.items() if isinstance(one, tuple)}
    numbers |= {name: np.float64(one) for name, one in given.items() if isinstance(one, float)}
    again = dataclasses.replace(camera, **numbers, width_px=np.int64(camera.width_px))
    assert again == camera
    assert json.dumps(again.parameters()) == json.dumps(camera.parameters())


@models
def test_bad_parameters_are_named(camera):
    for field in dataclasses.fields(camera):
        value = getattr(camera, field.name)
        for bad in (None, {}, [None, None]):
            with pytest.raises(OpticsError, match=rf"camera\.{field.name}(\.0)?: expected .* got"):
                dataclasses.replace(camera, **{field.name: bad})
        if isinstance(value, tuple) and "px" not in field.name:  # terms that overflow
            for bad in (1e300, -1e61):
                with pytest.raises(OpticsError, match=rf"{field.name}(\.\d+)?: expected "):
                    dataclasses.replace(camera, **{field.name: (*value[:-1], bad)})
    parameters = camera.parameters()
    for key in parameters.keys() - DERIVED:
        for bad in ("11", float("nan")):
            with pytest.raises(OpticsError, match=key):
                camera_from_parameters({**parameters, key: bad})
        others = {other: value for other, value in parameters.items() if other != key}
        name = key.removesuffix("_deg") + "_rad" if key.endswith("_deg") else key
        if name in camera.added_later:  # older images lack it
            assert getattr(camera_from_parameters(others), name) == type(camera).__dict__[name]
            continue
        with pytest.raises(OpticsError, match=key):
            camera_from_parameters(others)


def test_unknown_model_is_named():
    with pytest.raises(OpticsError, match=r"model: expected one of hyperbolic, .* got 'pinhole'"):
        camera_from_parameters({"model": "pinhole"})
