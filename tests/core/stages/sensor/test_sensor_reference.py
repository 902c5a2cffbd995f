"""The sensor against the float64 reference."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
import scipy.stats

from reference import philox, sensor

SHAPE = (101, 77)
FRAME = (7 << 33) + 5


def intensity_image(shape=SHAPE):
    return np.random.default_rng(41).exponential(1.0, shape).astype(np.float32)


def both(context, shape=SHAPE, **options):
    stage = clspeckle.Sensor(shape, context=context, **options)
    return stage, sensor.Sensor(shape[1], shape[0], **options)


def full_options(bits):
    """Everything on, in proportion to full scale."""
    scale = 2.0**bits
    return {
        "bits": bits,
        "seed": 0xABCDEF0123456789,
        "exposure_gain_dn": 0.4 * scale,
        "black_level_dn": 0.0625 * scale,
        "read_noise_dn": 0.015 * scale,
        "saturation_dn": 0.9 * scale,
        "hot_pixel_fraction": 0.02,
        "hot_pixel_mean_dn": 0.2 * scale,
        "cold_pixel_fraction": 0.03,
        "dark_frame_dn": (np.random.default_rng(42).random(SHAPE) * 0.01 * scale).astype(np.float32),
    }


def margin_dn(value):
    """How near to a rounding boundary a single-precision value may come to fall on its other side: 1e-3 DN, and where
    the value has fewer bits behind the point than that (from 13 bits on) eight units of its last place."""
    return np.maximum(1e-3, 8 * np.spacing(np.abs(value).astype(np.float32)).astype(np.float64))


def check_codes(codes, value, expected, measured):
    """Equal to the reference's but for rounding, see reference.sensor.disagreement()."""
    measured("share of codes one off", np.mean(codes != expected))
    assert not sensor.disagreement(codes, value, expected, margin_dn(value))


@pytest.mark.parametrize("bits", range(8, 17))
def test_codes(context, measured, bits):
    """Measured shares of codes one off on PoCL: at most 1 of 7777 pixels up to 13 bits, 0.15 % at 16."""
    options = full_options(bits)
    stage, expected = both(context, **options)
    intensity = intensity_image()
    for frame_index in (0, FRAME):
        value = expected.value_dn(intensity, frame_index)
        check_codes(
            stage.expose(intensity, frame_index=frame_index, dtype=np.uint16), value, expected.codes_of(value), measured
        )


def test_uint8_codes(context, measured):
    stage, expected = both(context, **full_options(8))
    value = expected.value_dn(intensity_image(), 3)
    codes = stage.expose(intensity_image(), frame_index=3, dtype=np.uint8)
    assert codes.dtype == np.uint8
    check_codes(codes, value, expected.codes_of(value), measured)
    assert np.array_equal(codes, stage.expose(intensity_image(), frame_index=3, dtype=np.uint16))


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_float_output_holds_the_same_codes(context, bits):
    """code / (2^bits - 1) float_full_scale, to single precision."""
    options = full_options(bits) | {"float_full_scale": 2.5}
    stage, _ = both(context, **options)
    codes = stage.expose(intensity_image(), frame_index=FRAME, dtype=np.uint16)
    image = stage.expose(intensity_image(), frame_index=FRAME, dtype=np.float32)
    assert np.allclose(image, codes / (2.0**bits - 1) * 2.5, rtol=3e-7, atol=0)


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_without_quantization(context, measured, bits):
    """The clipped value, continuous: within 1e-6 of full scale (measured 1.5e-7 on PoCL)."""
    options = full_options(bits) | {"float_full_scale": 2.5, "quantize": False}
    stage, expected = both(context, **options)
    image = stage.expose(intensity_image(), frame_index=FRAME, dtype=np.float32)
    error = np.abs(image - expected.expose_float(intensity_image(), FRAME)).max() / 2.5
    measured("error over full scale", error)
    assert error < 1e-6
    assert image.min() >= 0
    assert image.max() == np.float32(2.5)  # some pixels clip
    inside = image[(image > 0) & (image < 2.5)]
    assert np.unique(inside).size > 0.99 * inside.size  # bits 8 would leave at most 256 levels


@pytest.mark.parametrize("fraction", [0.0, 1e-3, 0.1, 1.0])
def test_hot_and_cold_pixels_are_exactly_the_same_sets(context, fraction):
    """Without noise and light a pixel above the black level is hot, and in light without offset a pixel at it is
    cold. The mean of the hot offsets is hot_pixel_mean_dn (checked to 3.5 standard errors, fixed seed)."""
    shape = (200, 300)
    common = {
        "bits": 16,
        "seed": 43,
        "read_noise_dn": 0.0,
        "black_level_dn": 100.0,
        "quantize": False,
        "float_full_scale": 65535.0,
    }
    dark = np.zeros(shape, np.float32)
    hot, expected = both(context, shape, hot_pixel_fraction=fraction, hot_pixel_mean_dn=1000.0, **common)
    image = hot.expose(dark, dtype=np.float32).astype(np.float64)
    offset = expected.hot_offset_dn()
    # An offset below the resolution of 100 in single precision does not show.
    assert np.array_equal(image > 100.01, offset > 0.01)
    assert np.array_equal(image, hot.expose(dark, frame_index=12345, dtype=np.float32))
    assert np.abs(image - 100 - offset).max() < 65535 * 2.0**-22
    assert abs(np.mean(expected.hot()) - fraction) <= 3.5 * np.sqrt(fraction * (1 - fraction) / dark.size) + 1e-6
    if fraction > 0:
        values = offset[expected.hot()]
        assert abs(values.mean() - 1000) < 3.5 * 1000 / np.sqrt(values.size)

    cold, expected = both(context, shape, cold_pixel_fraction=fraction, exposure_gain_dn=1000.0, **common)
    image = cold.expose(np.ones(shape, np.float32), dtype=np.float32)
    assert np.array_equal(image == 100, expected.cold())
    assert np.array_equal(image == 1100, ~expected.cold())


def test_rounds_half_to_even(context):
    stage = clspeckle.Sensor(
        (1, 8), bits=8, exposure_gain_dn=1.0, black_level_dn=0.0, read_noise_dn=0.0, context=context
    )
    intensity = np.array([[0.5, 1.5, 2.5, 3.5, 253.5, 254.5, 255.5, 0.4999]], np.float32)
    assert stage.expose(intensity, dtype=np.uint16).tolist() == [[0, 2, 2, 4, 254, 254, 255, 0]]


@pytest.mark.parametrize("bits", range(8, 17))
def test_clips_at_both_ends(context, bits):
    stage = clspeckle.Sensor((2, 3), bits=bits, black_level_dn=-10.0, read_noise_dn=0.0, context=context)
    intensity = np.array([[0, 1e-3, 1e9], [0, 0, 3e38]], np.float32)
    top = 2**bits - 1
    assert stage.expose(intensity, dtype=np.uint16).tolist() == [[0, 0, top], [0, 0, top]]


def test_saturation_stops_the_signal_before_the_offsets(context):
    """A saturated pixel reads saturation + black level + dark frame, below the top code."""
    dark_frame = np.full((4, 4), 7, np.float32)
    stage = clspeckle.Sensor(
        (4, 4),
        bits=12,
        exposure_gain_dn=100.0,
        saturation_dn=3000.0,
        black_level_dn=50.0,
        read_noise_dn=0.0,
        dark_frame_dn=dark_frame,
        context=context,
    )
    assert np.all(stage.expose(np.full((4, 4), 1000, np.float32), dtype=np.uint16) == 3057)
    assert np.all(stage.expose(np.full((4, 4), 29, np.float32), dtype=np.uint16) == 2957)


def test_dark_frame_is_a_map(context):
    """Each pixel has its own, rows and columns not swapped."""
    dark_frame = np.arange(15, dtype=np.float32).reshape(3, 5) * 10
    stage = clspeckle.Sensor(
        (3, 5), bits=10, black_level_dn=64.0, read_noise_dn=0.0, dark_frame_dn=dark_frame, context=context
    )
    assert np.array_equal(stage.expose(np.zeros((3, 5), np.float32), dtype=np.uint16), 64 + dark_frame)


def test_exposure_gain_can_change(context):
    stage, expected = both(context, **full_options(12))
    stage.exposure_gain_dn = 1234.5
    expected.exposure_gain_dn = 1234.5
    value = expected.value_dn(intensity_image(), 1)
    difference = stage.expose(intensity_image(), frame_index=1, dtype=np.uint16).astype(int) - expected.codes_of(value)
    assert np.count_nonzero(difference) < 5
    assert np.abs(difference).max() <= 1


@pytest.mark.parametrize("shape", [(64, 48), (37, 53), (5, 7), (1, 1), (2, 40)])
def test_read_noise_is_the_reference_s(context, shape):
    """Every normal to 3e-6 of its pair's radius, which float64 knows: a deviation of 4000 DN in 16 bits without a
    converter, whose single precision is 5e-7 deviations here. Odd rows and quarters included."""
    stage = clspeckle.Sensor(
        shape,
        bits=16,
        seed=45,
        black_level_dn=32768.0,
        read_noise_dn=4000.0,
        quantize=False,
        float_full_scale=65535.0,
        context=context,
    )
    values = stage.expose(np.zeros(shape, np.float32), frame_index=2**32 + 3, dtype=np.float32).astype(np.float64)
    expected = philox.image_pair_normal(*shape, 45, 2**32 + 3, 0x10)
    assert np.abs((values - 32768) / 4000 - expected).max() < 3e-6 * 6 + 1e-6


def test_noise_is_new_in_each_frame(context):
    """n = 2^18 pixels, fixed seed: normal (Kolmogorov-Smirnov at 1e-3, which rejects a standard deviation off by 2 %),
    standard deviation within 3.5 standard errors (0.5 %), frames uncorrelated, the same frame index gives the same
    noise."""
    shape = (512, 512)
    stage = clspeckle.Sensor(
        shape,
        bits=16,
        seed=44,
        black_level_dn=30000.0,
        read_noise_dn=40.0,
        quantize=False,
        float_full_scale=65535.0,
        context=context,
    )
    dark = np.zeros(shape, np.float32)
    noise = [
        (stage.expose(dark, frame_index=frame, dtype=np.float32).astype(np.float64) - 30000) / 40
        for frame in (0, 1, 2**32)
    ]
    n = noise[0].size
    for index, frame in enumerate(noise):
        assert scipy.stats.kstest(frame.ravel(), "norm").pvalue > 1e-3
        assert abs(frame.std() - 1) < 3.5 / np.sqrt(2 * n)
        assert abs(np.mean(frame * noise[index - 1])) < 3.5 / np.sqrt(n)
    again = (stage.expose(dark, frame_index=1, dtype=np.float32).astype(np.float64) - 30000) / 40
    assert np.array_equal(again, noise[1])
    # The library's normals themselves, stream 0x10.
    assert np.abs(noise[0] - philox.image_pair_normal(*shape, 44, 0, 0x10)).max() < 3e-4
