import numpy as np

from omnisim.core.srgb import linear_from_srgb
from omnisim.validation.image_differences import converged_psnr_db, noise_floor_db, psnr_db

EVERYWHERE = np.ones((200, 200), dtype=bool)


def _image(levels):
    return linear_from_srgb(np.broadcast_to(levels, (200, 200, 3)) / 255.0)


def test_a_difference_of_one_level():
    assert np.isclose(psnr_db(_image(100.0), _image(101.0), EVERYWHERE), 48.1308, atol=1e-4)
    assert psnr_db(_image(100.0), _image(100.0), EVERYWHERE) == np.inf


def test_only_the_chosen_pixels_count():
    other = _image(100.0).copy()
    other[:, :50] = 1.0
    where = EVERYWHERE.copy()
    where[:, :50] = False
    assert psnr_db(_image(100.0), other, where) == np.inf


def test_noise_floor_is_the_distance_from_the_truth():
    random = np.random.default_rng(0)
    first, second = (_image(128.0 + random.normal(0.0, 8.0, (200, 200, 3))) for _ in range(2))
    floor = noise_floor_db(first, second, EVERYWHERE)
    # the mean of 120000 squares has a standard deviation of 0.4 %, 0.02 dB
    assert abs(floor - psnr_db(first, _image(128.0), EVERYWHERE)) < 0.1


def test_noise_does_not_hide_the_distance_from_a_converged_image():
    """At two levels off, noise of 8 levels in each image limits the plain PSNR to 30 dB."""
    random = np.random.default_rng(0)
    noisy = [_image(128.0 + random.normal(0.0, 8.0, (200, 200, 3))) for _ in range(2)]
    off = _image(130.0)
    expected = psnr_db(off, _image(128.0), EVERYWHERE)
    # 120 000 products with a standard deviation of 66 levels² about 4
    assert abs(converged_psnr_db(off, *noisy, EVERYWHERE) - expected) < 0.7
    assert psnr_db(off, noisy[0], EVERYWHERE) < 31.0
