"""Every step on the GPU against its reference, at every pixel."""

import numpy as np
import pytest

from omnisim.core.errors import OpticsError
from omnisim.core.package_files import SHADERS
from omnisim.core.random_numbers import key_of, normal, pcg4d, uniform
from omnisim.rendering.camera.degradations import (
    Bayer,
    ChromaticAberration,
    Defocus,
    Degradation,
    Dirt,
    Encoding,
    Noise,
    PointSpread,
    Reflectance,
    Shutter,
    Vignetting,
    WhiteBalance,
    preset,
)
from omnisim.rendering.camera.degradations.effect import Shot
from omnisim.rendering.camera.degradations.encoding import neutral
from omnisim.rendering.camera.degradations.image_geometry import Metering
from omnisim.rendering.opengl.degradation.degradation_pass import DegradationPass
from omnisim.rendering.opengl.gl.pixel_readback import read_once
from tests.rendering.camera.degradations.images import GEOMETRY, on_gpu, random_image, read

ULP = 2.0**-23
# The bounds, relative to 1: light is at most 1.3 here. One rounding for each product or sum, and
# as many more as it takes a compiler to fuse them or not.
EXAMPLES = {
    "reflectance": (Reflectance(0.87, (1.0, 0.95, 0.8)), 1 * ULP),
    "dirt": (Dirt(dust_count=40, scratch_count=5, scratch_length_px=40.0), 2 * ULP),
    "vignetting": (Vignetting((-0.5, 0.2, -0.1, 0.02, -0.01, 0.001)), 4 * ULP),
    "vignetting that goes dark": (Vignetting((-1.5, 0.0, 0.0)), 4 * ULP),
    # a place of 100 px has 2⁻¹⁷ px of rounding, and neighbors differ by up to 1
    "chromatic_aberration": (ChromaticAberration(1.01, 0.985), 4 * 2.0**-17),
    "chromatic_aberration by polynomials": (
        ChromaticAberration(1.002, 1.0, (0.0, 1.1, -0.7), (-0.4, 0.0, 0.0, 0.9)),
        4 * 2.0**-17,
    ),
    # exponentials of distances over widths, and sums over the kernel
    "point_spread": (PointSpread(((0.0, 0.4, 0.4), (20.0, 0.6, 0.9), (45.0, 2.1, 0.8))), 64 * ULP),
    # square roots of radii, and sums over the disc
    "defocus": (Defocus(0.2, 4.3), 16 * ULP),
    "defocus towards the middle": (Defocus(3.1, 0.7), 16 * ULP),
    "bayer malvar": (Bayer("GRBG", "malvar"), 8 * ULP),
    "bayer bilinear": (Bayer("BGGR", "bilinear"), 4 * ULP),
    "bayer mosaic": (Bayer("GBRG", "none"), 0.0),
    "white balance": (WhiteBalance((0.5, 1.0, 0.7)), 2 * ULP),
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_step_equals_its_reference(context, name):
    part, bound = EXAMPLES[name]
    image = random_image()
    drawn = on_gpu(context, [image], sensor=part.steps(GEOMETRY))
    expected = part.apply(image, GEOMETRY)
    np.testing.assert_array_equal(drawn[..., 3], image[..., 3])
    assert np.abs(drawn - expected).max() <= bound
    assert not drawn[image[..., 3] < 0.5].any()  # nothing shows where nothing is seen
    assert np.abs(expected - image).max() > 0.01  # it does something


def test_vignetting_and_reflectance_of_white_are_their_formulas(context):
    white = np.ones((GEOMETRY.height_px, GEOMETRY.width_px, 4), dtype=np.float32)
    steps = Reflectance(0.8, (1.0, 0.9, 0.7)).steps(GEOMETRY)
    drawn = on_gpu(context, [white], optics=steps)
    assert np.abs(drawn[..., :3] - np.array([0.8, 0.72, 0.56])).max() <= ULP
    drawn = on_gpu(context, [white], optics=Vignetting.cos4(0.5).steps(GEOMETRY))
    squared = GEOMETRY.squared_radii().astype(np.float64)
    factor = 1.0 - 0.5 * squared + 0.1875 * squared**2 - 0.0625 * squared**3
    assert np.abs(drawn[..., 0] - factor).max() <= 4 * ULP
    cos4 = np.cos(np.arctan(0.5 * np.sqrt(squared))) ** 4
    inside = squared <= 1.0
    assert np.abs(factor - cos4)[inside].max() < 0.02  # what the series leaves out: 5 t⁸
    with pytest.raises(OpticsError, match=r"expected a tangent of 0 to 0\.6"):
        Vignetting.cos4(0.7)


def test_random_numbers_have_the_same_bits(context):
    """As 23-bit numbers in colors, for coordinates and keys of all sizes."""
    height, width = 40, 50
    text = (
        "#version 430 core\nuniform uint u_key; uniform uint u_frame; out vec4 out_value;\n"
        + (SHADERS / "common" / "random.glsl").read_text(encoding="utf-8")
        + "void main() { uvec4 h = pcg4d(uvec4(gl_FragCoord.xy, u_frame, u_key));\n"
        "out_value = vec4(uniform_number(h.x), uniform_number(h.y), uniform_number(h.z),\n"
        "normal_number(h.z, h.w)); }"
    )
    vertex = (SHADERS / "common" / "full_screen.vert").read_text(encoding="utf-8")
    gl = context.program(vertex_shader=vertex, fragment_shader=text)
    gl["u_key"], gl["u_frame"] = 0xDEADBEEF, 4_000_000_000
    target = context.framebuffer([context.renderbuffer((width, height), 4, dtype="f4")])
    target.use()
    context.vertex_array(gl, []).render(vertices=3)
    drawn = np.frombuffer(target.read(components=4, dtype="f4"), np.float32)
    drawn = drawn.reshape(height, width, 4)
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    hashes = pcg4d(column, row, 4_000_000_000, 0xDEADBEEF)
    for channel in range(3):
        np.testing.assert_array_equal(drawn[..., channel], uniform(hashes[channel]))
    assert np.abs(drawn[..., 3] - normal(hashes[2], hashes[3])).max() < 2e-5


@pytest.mark.parametrize("full_well_e", [40.0, 3000.0])
def test_noise_equals_its_reference_but_for_ties(context, full_well_e):
    """Whole electrons: a last bit decides one in thousands otherwise, by one step."""
    noise = Noise(
        full_well_e=full_well_e,
        read_noise_e=1.7,
        dark_current_e_per_s=30.0,
        black_level_dn=5.0,
        bit_depth=10,
    )
    image, key = random_image(), key_of("noise", 3)
    shot = Shot(exposure_s=0.02, noise_key=key, frame_number=7)
    steps = noise.steps(GEOMETRY, shot)
    drawn = on_gpu(context, [image], sensor=steps, uniforms={"u_frame": 7})
    expected = noise.apply(image, GEOMETRY, shot)
    step = noise.gain / noise.white_e
    differs = np.abs(drawn - expected) > 1e-5
    assert np.mean(differs) < 1e-3
    assert np.abs(drawn - expected).max() <= (1.0 + 1.0 / noise.gain) * step + 1e-5
    other = on_gpu(context, [image], sensor=steps, uniforms={"u_frame": 8})
    seen = image[..., 3] > 0.5
    assert np.mean((other == drawn)[seen, :3]) < 0.5


def test_sub_frames_add_up_by_rows(context):
    shutter = Shutter(exposure_s=0.01, readout_s=0.02)
    images = [random_image(seed=seed) for seed in range(5)]
    weights = shutter.row_weights(5, GEOMETRY.height_px)
    drawn = on_gpu(context, images, weights=weights)
    expected = Degradation().exposed(zip(images, weights, strict=True), GEOMETRY)
    assert np.abs(drawn - expected).max() <= 5 * ULP
    np.testing.assert_allclose(weights.sum(axis=0), 1.0, atol=4 * ULP)


def test_next_frame_starts_from_zero(context):
    height, width = GEOMETRY.height_px, GEOMETRY.width_px
    chain = DegradationPass(context, (width, height), (), ())
    weights = Shutter(exposure_s=0.01).row_weights(2, height)
    image = random_image()
    texture = context.texture((width, height), 4, image, dtype="f4")
    seen = []
    for _ in range(2):
        for weight in weights:
            chain.add(texture, weight)
        chain.finish({})
        seen.append(read(chain.finished))
    np.testing.assert_array_equal(*seen)
    assert np.abs(seen[0] - image).max() <= 2 * ULP


@pytest.mark.parametrize("name", ["dragonfly2", "webcam", "bad-day"])
def test_whole_chain_of_a_preset_equals_the_reference(context, name):
    degradation = preset(name)
    image, key = random_image(), key_of("noise", 0)
    drawn = on_gpu(
        context,
        [image],
        optics=degradation.optics_steps(GEOMETRY),
        sensor=degradation.sensor_steps(GEOMETRY, key),
        uniforms={"u_frame": 2, "u_exposure_factors": degradation.exposure_factors(-0.3)},
    )
    light = degradation.exposed([(image, None)], GEOMETRY)
    expected = degradation.developed(light, GEOMETRY, degradation.exposure_factors(-0.3), key, 2)
    # electrons that fall on the other side reach 5 × 5 pixels through demosaicking
    assert np.mean(np.abs(drawn - expected) > 2e-5) < 0.02
    assert np.sqrt(np.mean((drawn - expected) ** 2)) < 1e-3


@pytest.mark.parametrize(
    "encoding",
    [
        Encoding(),
        Encoding(2.2, 5),
        Encoding(1.0, 1),
        Encoding("srgb", 8, "neutral"),
        Encoding(curve=((0.01, 0.1), (0.2, 0.5), (0.7, 0.9), (1.5, 0.95))),
    ],
)
def test_encoding_equals_its_reference(context, encoding):
    image = random_image()
    height, width = image.shape[:2]
    chain = DegradationPass(context, (width, height), (), (), encoding.step())
    chain.add(context.texture((width, height), 4, image, dtype="f4"))
    chain.finish({})
    target = context.framebuffer([context.renderbuffer((width, height), 4)])
    chain.encode(target)
    drawn = np.frombuffer(target.read(components=4), np.uint8).reshape(height, width, 4)
    expected = np.rint(255.0 * encoding.apply(image)).astype(int)
    step = round(255 / (2**encoding.bit_depth - 1))
    assert np.mean(drawn != expected) < 1e-3  # ties
    assert np.abs(drawn.astype(int) - expected).max() <= step + 1
    assert len(np.unique(drawn[..., :3])) <= 2**encoding.bit_depth


def test_the_neutral_curve_is_khronos_s():
    """By the specification's own values: base colors less the gloss's 4 %, then a shoulder."""
    gray = np.array([0.0, 0.02, 0.08, 0.5, 0.8, 1.0, 3.0, 1e4])
    expected = [0.0, 6.25 * 0.02**2, 0.04, 0.46, 0.76]
    expected += [1.0 - 0.24**2 / (level - 0.04 + 0.24 - 0.76) for level in (1.0, 3.0, 1e4)]
    found = neutral(np.repeat(gray[:, None], 3, axis=1))
    np.testing.assert_allclose(found, np.repeat(np.array(expected)[:, None], 3, axis=1), atol=1e-12)
    red = neutral(np.array([[0.7, 0.3, 0.1], [9.0, 0.3, 0.1]]))
    np.testing.assert_allclose(red[0], [0.66, 0.26, 0.06])  # keeps its hue
    assert red[1, 0] > 0.99  # a bright one pales
    assert red[1, 1] == pytest.approx(red[1, 2], abs=0.02)
    assert red[1, 1] > 0.5
    levels = neutral(np.linspace(0.0, 5.0, 5001)[:, None] * (1.0, 0.6, 0.3))
    assert (np.diff(levels, axis=0) > 0.0).all()
    assert np.abs(np.diff(levels, axis=0)).max() < 2e-3  # and has no step


def _luminance(chain, meter):
    read, luminance = chain.draw_meter(meter)
    read_once(chain.finished.ctx, read)
    return luminance()


@pytest.mark.parametrize("percentile", [None, 50.0, 97.5])
def test_meter_is_its_reference(context, percentile):
    image, meter = random_image(), Metering(percentile)
    image[:5, :, 3] = 0.0  # pixels that see nothing do not count
    height, width = image.shape[:2]
    chain = DegradationPass(context, (width, height), (), ())
    chain.add(context.texture((width, height), 4, image, dtype="f4"))
    assert _luminance(chain, meter) == pytest.approx(meter.of_image(image), rel=1e-6)
    chain.add(context.texture((width, height), 4, 0.0 * image, dtype="f4"))
    assert _luminance(chain, meter) == 0.0
    image[..., 3] = 0.0
    chain.add(context.texture((width, height), 4, image, dtype="f4"))
    assert _luminance(chain, meter) == meter.of_image(image) == 0.0
