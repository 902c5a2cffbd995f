"""Every step of the chain of sensor.h against the float64 reference, and what each effect must do to an image."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
import scipy.stats

from reference import philox, sensor

SHAPE = (101, 77)
FRAME = (5 << 33) + 11


def intensity_image(shape=SHAPE):
    return np.random.default_rng(51).exponential(1.0, shape).astype(np.float32)


def both(context, shape=SHAPE, **options):
    stage = clspeckle.Sensor(shape, context=context, **options)
    return stage, sensor.Sensor(shape[1], shape[0], **options)


def check_codes(codes, expected, value, measured, margin=1e-3):
    """Equal but for rounding: in float arithmetic a 12-bit value is right to 1e-3 DN, 5e-3 where a power is taken."""
    wanted = expected.codes_of(value)
    measured("share of codes one off", np.mean(codes != wanted))
    step = expected.code_step
    assert not sensor.disagreement(codes // step, value / step, wanted // step, np.full(value.shape, margin / step))
    assert np.all(codes % step == 0)


BASE = {"bits": 12, "seed": 0x123456789ABCDEF, "exposure_gain_dn": 900.0, "black_level_dn": 200.0, "read_noise_dn": 5.0}
EFFECTS = {
    "crosstalk": {"crosstalk_fraction": 0.17},
    "prnu": {"prnu": 0.02},
    "prnu_and_cold": {"prnu": 0.02, "cold_pixel_fraction": 0.05},
    "prnu_below_zero": {"prnu": 1.0},
    "column_prnu": {"column_prnu": 0.02},
    "row_prnu": {"row_prnu": 0.02},
    "line_gains_below_zero": {"column_prnu": 1.0, "row_prnu": 1.0, "cold_pixel_fraction": 0.05},
    "dull": {"dull_pixel_fraction": 0.05},
    "dull_and_cold": {"dull_pixel_fraction": 0.3, "cold_pixel_fraction": 0.05, "prnu": 0.02},
    "mosaic": {"mosaic_gain": (0.9, 1.05, 0.7, 1.2)},
    "dark_current": {
        "conversion_gain_dn_per_e": 0.3,
        "dark_current_e_per_s": 5000.0,
        "temperature_c": 41.0,
        "exposure_time_s": 0.02,
    },
    "full_well": {"conversion_gain_dn_per_e": 0.25, "full_well_e": 6000.0},
    "photons": {
        "conversion_gain_dn_per_e": 0.25,
        "quantum_efficiency": 0.4,
        "photons_per_unit": 7000.0,
        "exposure_gain_dn": 700.0,
    },
    "cubic": {"cubic_nonlinearity": 0.05},
    "cubic_upwards": {"cubic_nonlinearity": -0.05},
    "quadratic": {"cubic_nonlinearity": 0.05, "nonlinearity_power": 1},
    "second_power": {"cubic_nonlinearity": -0.05, "nonlinearity_power": 2},
    "gamma": {"gamma": 0.8},
    "gamma_above_one": {"gamma": 2.2},
    "dsnu": {"dsnu_dn": 4.0},
    "column_offset": {"column_offset_dn": 6.0},
    "row_offset": {"row_offset_dn": 6.0},
    "wave": {"periodic_offset_dn": 9.0, "periodic_frequency_x": 0.213, "periodic_frequency_y": -0.071},
    "fixed_pattern": {
        "dsnu_dn": 4.0,
        "column_offset_dn": 6.0,
        "hot_pixel_fraction": 0.02,
        "cold_pixel_fraction": 0.02,
        "prnu": 0.01,
    },
    "row_noise": {"row_noise_dn": 7.0},
    "column_noise": {"column_noise_dn": 7.0},
    "read_noise_spread": {"read_noise_spread": 0.4},
    "correlated_read_noise": {"read_noise_correlation": 0.3},
    "read_noise_of_most_correlation": {"read_noise_correlation": -0.5},
    "telegraph_noise": {"telegraph_fraction": 0.1, "telegraph_step_dn": 40.0},
    "centered_telegraph_noise": {"telegraph_fraction": 0.1, "telegraph_step_dn": 40.0, "telegraph_centered": True},
    "noise_without_read_noise": {"read_noise_dn": 0.0, "row_noise_dn": 3.0, "column_noise_dn": 2.0},
    "code_widths": {"code_width_wave": 0.3, "widest_code": 1.0},
    "code_widths_of_a_long_period": {"code_width_wave": 0.5, "code_width_period": 15.5, "widest_code": 400.0},
    "effective_bits": {"effective_bits": 7},
    "one_effective_bit": {"effective_bits": 1},
}
ALL = {
    "crosstalk_fraction": 0.1,
    "prnu": 0.02,
    "column_prnu": 0.02,
    "row_prnu": 0.02,
    "cold_pixel_fraction": 0.01,
    "hot_pixel_fraction": 0.01,
    "mosaic_gain": (0.9, 1.05, 0.95, 1.1),
    "conversion_gain_dn_per_e": 0.3,
    "dark_current_e_per_s": 3000.0,
    "saturation_dn": 3000.0,
    "gamma": 0.9,
    "dsnu_dn": 2.0,
    "column_offset_dn": 2.0,
    "row_noise_dn": 3.0,
    "column_noise_dn": 3.0,
    "read_noise_spread": 0.2,
    "effective_bits": 10,
    "row_offset_dn": 2.0,
    "dull_pixel_fraction": 0.02,
    "cubic_nonlinearity": 0.04,
    "nonlinearity_power": 2,
    "read_noise_correlation": -0.2,
    "periodic_offset_dn": 3.0,
    "periodic_frequency_x": -0.11,
    "telegraph_fraction": 0.02,
    "telegraph_step_dn": 20.0,
    "code_width_wave": 0.2,
    "code_width_period": 8.0,
}


@pytest.mark.parametrize("effect", [*EFFECTS, "all"])
def test_codes(context, measured, effect):
    options = BASE | (ALL if effect == "all" else EFFECTS[effect])
    stage, expected = both(context, **options)
    if effect == "all":
        dark = np.random.default_rng(52).normal(0, 3, SHAPE).astype(np.float32)
        gains = np.random.default_rng(53).normal(1, 0.02, SHAPE).astype(np.float32)
        stage.configure(dark_frame_dn=dark, gain_map=gains)
        expected.dark_frame_dn, expected.gain_map = dark, gains
    intensity = intensity_image()
    plain = clspeckle.Sensor(SHAPE, context=context, **BASE)
    for frame_index in (0, FRAME):
        codes = stage.expose(intensity, frame_index=frame_index, dtype=np.uint16)
        value = expected.value_dn(intensity, frame_index)
        check_codes(codes, expected, value, measured, 5e-3 if "gamma" in options else 1e-3)
        assert np.mean(codes != plain.expose(intensity, frame_index=frame_index, dtype=np.uint16)) > 0.01


@pytest.mark.parametrize("effect", ["crosstalk", "prnu", "row_noise", "gamma", "effective_bits"])
@pytest.mark.parametrize("dtype", [np.float32, np.uint8])
def test_other_outputs_hold_the_same_codes(context, effect, dtype):
    options = BASE | {"bits": 8, "exposure_gain_dn": 60.0, "black_level_dn": 10.0} | EFFECTS[effect]
    stage = clspeckle.Sensor(SHAPE, context=context, float_full_scale=255.0, **options)
    codes = stage.expose(intensity_image(), frame_index=3, dtype=np.uint16)
    other = stage.expose(intensity_image(), frame_index=3, dtype=dtype)
    assert np.allclose(other, codes, rtol=3e-7, atol=0)


def test_defaults_are_off(context):
    """Every new argument at its default gives the very codes of a sensor that was never told of it."""
    values = clspeckle.Sensor.defaults()
    plain = clspeckle.Sensor(SHAPE, context=context)
    told = clspeckle.Sensor(SHAPE, context=context, **values)
    image = intensity_image()
    assert np.array_equal(plain.expose(image, frame_index=9), told.expose(image, frame_index=9))


# --- Crosstalk ---


def test_crosstalk_spreads_a_point_and_loses_nothing(context):
    """One lit pixel: the four neighbours get a quarter of the fraction each, corners nothing. At the border the light
    of the neighbour outside is the pixel's own, so that a flat image stays flat."""
    options = {
        "black_level_dn": 0.0,
        "read_noise_dn": 0.0,
        "exposure_gain_dn": 1000.0,
        "bits": 16,
        "crosstalk_fraction": 0.4,
    }
    stage = clspeckle.Sensor((9, 11), context=context, **options)
    point = np.zeros((9, 11), np.float32)
    point[4, 6] = 1
    expected = np.zeros((9, 11))
    expected[4, 6] = 600
    for y, x in ((3, 6), (5, 6), (4, 5), (4, 7)):
        expected[y, x] = 100
    codes = stage.expose(point)
    assert np.array_equal(codes, expected)
    assert codes.sum() == 1000
    corner = np.zeros((9, 11), np.float32)
    corner[0, 0] = 1
    assert stage.expose(corner)[0, 0] == 600 + 2 * 100
    assert np.all(stage.expose(np.full((9, 11), 7, np.float32)) == 7000)
    for shape in ((1, 1), (1, 6), (6, 1)):
        thin = clspeckle.Sensor(shape, context=context, **options)
        assert np.all(thin.expose(np.full(shape, 3, np.float32)) == 3000)


def test_crosstalk_happens_before_shot_noise(context):
    """Crosstalk of charge blurs the light, not its noise: neighbouring pixels of a flat image stay uncorrelated. n =
    2^16 pixels, fixed seed; 4 standard errors (size 6e-5); blurred noise would have a correlation of 2 * 0.6 * 0.1 /
    0.4 = 0.3, 19 standard errors beyond."""
    stage = clspeckle.Sensor(
        (256, 256),
        context=context,
        bits=16,
        exposure_gain_dn=1000.0,
        black_level_dn=0.0,
        read_noise_dn=0.0,
        conversion_gain_dn_per_e=1.0,
        shot_noise=True,
        crosstalk_fraction=0.4,
    )
    noise = stage.expose(np.ones((256, 256), np.float32)).astype(float) - 1000
    for axis in (0, 1):
        correlation = np.mean(noise * np.roll(noise, 1, axis)) / noise.var()
        assert abs(correlation) < 4 / 256


# --- Mosaic ---


@pytest.mark.parametrize(("bayer", "sites"), [("RGGB", "rggb"), ("BGGR", "bggr"), ("GRBG", "grbg"), ("GBRG", "gbrg")])
def test_bayer_sites(context, bayer, sites):
    efficiency = {"r": 1.0, "g": 0.5, "b": 0.25}
    gains = clspeckle.sensor.mosaic_gain_from_bayer(bayer, 1.0, 0.5, 0.25)
    assert gains == [efficiency[site] for site in sites]
    stage = clspeckle.Sensor(
        (5, 7), context=context, black_level_dn=0.0, read_noise_dn=0.0, exposure_gain_dn=400.0, mosaic_gain=gains
    )
    codes = stage.expose(np.ones((5, 7), np.float32))
    for y in range(5):
        for x in range(7):
            assert codes[y, x] == 400 * efficiency[bayer[(x % 2) + 2 * (y % 2)].lower()]


def test_mosaic_gain_takes_a_table(context):
    """[[1, 2], [3, 4]] is [y][x]."""
    image = intensity_image()
    flat = clspeckle.Sensor(SHAPE, context=context, mosaic_gain=[0.5, 1.0, 0.75, 0.25])
    table = clspeckle.Sensor(SHAPE, context=context, mosaic_gain=[[0.5, 1.0], [0.75, 0.25]])
    assert np.array_equal(flat.expose(image), table.expose(image))


def bilinear(raw, bayer):
    """Demosaicing by convolution: each colour's sites, spread with [1 2 1] x [1 2 1] / 4 and divided by the weights;
    an independent form of the same interpolation. Mirrored at the border."""
    height, width = raw.shape
    y, x = np.indices(raw.shape)
    colours = np.array([bayer[i] for i in range(4)])[(x & 1) + 2 * (y & 1)]
    out = np.empty((height, width, 3))
    for channel, colour in enumerate("RGB"):
        mask = np.pad((colours == colour).astype(float), 1, mode="reflect")
        values = np.pad(np.where(colours == colour, raw, 0.0), 1, mode="reflect")
        # At a green neighbour diagonal greens do not count: the cross for green, the square for red and blue.
        kernel = (
            np.array([[0, 1, 0], [1, 4, 1], [0, 1, 0]])
            if colour == "G"
            else np.array([[1, 2, 1], [2, 4, 2], [1, 2, 1]])
        )
        total, weight = np.zeros(raw.shape), np.zeros(raw.shape)
        for dy in range(3):
            for dx in range(3):
                total += kernel[dy, dx] * values[dy : dy + height, dx : dx + width]
                weight += kernel[dy, dx] * mask[dy : dy + height, dx : dx + width]
        interpolated = total / weight
        out[..., channel] = np.where(colours == colour, raw, interpolated)
    return out


@pytest.mark.parametrize("bayer", ["RGGB", "BGGR", "GRBG", "GBRG"])
@pytest.mark.parametrize("dtype", [np.uint16, np.uint8, np.float32])
def test_demosaic(context, bayer, dtype):
    for shape in ((2, 2), (7, 10), (12, 5)):
        stage = clspeckle.Sensor(shape, context=context)
        raw = np.random.default_rng(53).integers(0, 256, shape).astype(dtype)
        rgb = stage.demosaic(raw, bayer)
        assert rgb.shape == (*shape, 3)
        assert rgb.dtype == np.float32
        assert np.allclose(rgb, bilinear(raw.astype(float), bayer), rtol=1e-6, atol=0)
        assert np.all(stage.demosaic(np.full(shape, 77, dtype), bayer) == 77)


def test_demosaic_on_the_device(context):
    stage = clspeckle.Sensor((8, 6), context=context)
    raw = np.random.default_rng(54).integers(0, 1024, (8, 6)).astype(np.uint16)
    with (
        clspeckle.DeviceImage.from_array(raw, context=context) as source,
        clspeckle.DeviceImage((8, 6, 3), np.float32, context=context) as target,
    ):
        stage.enqueue_demosaic(source, "GRBG", target).wait()
        assert np.array_equal(target.read(), stage.demosaic(raw, "GRBG"))
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="RGGB"):
        stage.demosaic(raw, "rgbg")
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="2 x 2"):
        clspeckle.Sensor((1, 6), context=context).demosaic(np.zeros((1, 6), np.uint16), "RGGB")


# --- Electrons ---


def test_photons_and_full_well_are_views_of_the_same_sensor(context):
    """K QE N is the exposure gain, K times the full well the saturation: bit for bit."""
    image = intensity_image()
    common = {"bits": 12, "conversion_gain_dn_per_e": 0.5, "shot_noise": True}
    photons = clspeckle.Sensor(
        SHAPE, context=context, photons_per_unit=6000.0, quantum_efficiency=0.25, full_well_e=4000.0, **common
    )
    gain = clspeckle.Sensor(SHAPE, context=context, exposure_gain_dn=750.0, saturation_dn=2000.0, **common)
    assert photons.exposure_gain_dn == 750.0
    assert np.array_equal(photons.expose(image, frame_index=4), gain.expose(image, frame_index=4))
    photons.exposure_gain_dn = gain.exposure_gain_dn = 200.0
    assert np.array_equal(photons.expose(image, frame_index=4), gain.expose(image, frame_index=4))
    photons.configure(prnu=0.1)
    gain.configure(prnu=0.1)
    assert photons.exposure_gain_dn == 200.0
    assert np.array_equal(photons.expose(image, frame_index=4), gain.expose(image, frame_index=4))


def test_dark_current_doubles_with_temperature(context):
    """100 e/s at 25 C in 2 s are 200 e = 100 DN; 400 e at 33 C, 50 e at 9 C."""
    for temperature, dark in ((25.0, 100), (33.0, 200), (9.0, 25)):
        stage = clspeckle.Sensor(
            (4, 4),
            context=context,
            read_noise_dn=0.0,
            conversion_gain_dn_per_e=0.5,
            dark_current_e_per_s=100.0,
            exposure_time_s=2.0,
            temperature_c=temperature,
        )
        assert np.all(stage.expose(np.zeros((4, 4), np.float32)) == 64 + dark)


def test_shot_noise_of_the_dark_current(context):
    """Poisson of the 400 dark electrons: mean and variance 400. n = 2^16, fixed seed, 4 standard errors (0.02 % and
    2.2 %)."""
    electrons = clspeckle.Sensor(
        (256, 256),
        context=context,
        bits=14,
        read_noise_dn=0.0,
        conversion_gain_dn_per_e=1.0,
        dark_current_e_per_s=400.0,
        exposure_time_s=1.0,
        shot_noise=True,
    )
    counts = electrons.expose(np.zeros((256, 256), np.float32)).astype(float)
    assert abs(counts.mean() - 64 - 400) < 4 * 20 / 256
    assert abs(counts.var() / 400 - 1) < 4 * np.sqrt(2 / 65536)


def test_full_well_clips_signal_and_dark_current_together(context):
    stage = clspeckle.Sensor(
        (4, 4),
        context=context,
        bits=12,
        read_noise_dn=0.0,
        conversion_gain_dn_per_e=0.5,
        full_well_e=3000.0,
        dark_current_e_per_s=1000.0,
        exposure_time_s=1.0,
        exposure_gain_dn=1200.0,
    )
    assert np.all(stage.expose(np.ones((4, 4), np.float32)) == 64 + 1500)
    assert np.all(stage.expose(np.full((4, 4), 0.5, np.float32)) == 64 + 1100)


# --- Lag ---


def test_lag_is_a_recursion(context):
    """read_t = (1 - f) s_t + f read_(t-1), the first frame without; reset_lag() starts again; float output in single
    precision."""
    fraction, rng = 0.3, np.random.default_rng(55)
    stage = clspeckle.Sensor(
        SHAPE,
        context=context,
        bits=16,
        exposure_gain_dn=10000.0,
        read_noise_dn=0.0,
        lag_fraction=fraction,
        quantize=False,
        float_full_scale=65535.0,
    )
    for _ in range(2):
        previous = None
        for _ in range(5):
            image = rng.random(SHAPE).astype(np.float32)
            signal = 10000.0 * image.astype(float)
            previous = signal if previous is None else (1 - fraction) * signal + fraction * previous
            read = stage.expose(image, dtype=np.float32)
            assert np.abs(read - 64 - previous).max() < 0.02  # values up to 10064: 1e-3 spacing, five frames
        stage.reset_lag()


def test_lag_ends_after_a_flash(context):
    """A bright frame fades as f^t; codes of 16 bits."""
    stage = clspeckle.Sensor(
        (3, 3), context=context, bits=16, exposure_gain_dn=1.0, black_level_dn=0.0, read_noise_dn=0.0, lag_fraction=0.5
    )
    assert np.all(stage.expose(np.full((3, 3), 32768, np.float32)) == 32768)
    for frame in range(1, 15):
        assert np.all(stage.expose(np.zeros((3, 3), np.float32)) == 32768 >> frame)
    stage.reset_lag()
    assert np.all(stage.expose(np.zeros((3, 3), np.float32)) == 0)


def test_lag_works_in_place_and_without_lag_nothing_stays(context):
    image = np.full(SHAPE, 0.5, np.float32)
    with clspeckle.DeviceImage.from_array(image, context=context) as device:
        stage = clspeckle.Sensor(SHAPE, context=context, read_noise_dn=0.0, lag_fraction=0.25)
        stage.enqueue_expose(device, 0, device).wait()
        assert np.allclose(device.read(), (64 + 256) / 1023)
    without = clspeckle.Sensor(SHAPE, context=context, read_noise_dn=0.0)
    without.expose(image)
    without.reset_lag()  # allowed
    assert np.all(without.expose(np.zeros(SHAPE, np.float32)) == 64)


# --- Noise of rows, columns and pixels ---


def dark_values(context, shape, frame_index=0, **options):
    """Dark frame without quantization, less the black level."""
    stage = clspeckle.Sensor(
        shape,
        context=context,
        bits=16,
        black_level_dn=30000.0,
        quantize=False,
        float_full_scale=65535.0,
        **{"read_noise_dn": 0.0, "seed": 56, **options},
    )
    return stage.expose(np.zeros(shape, np.float32), frame_index=frame_index, dtype=np.float32).astype(float) - 30000


def test_row_and_column_noise(context):
    """One number for a row or a column, new in each frame, of the given deviation (1024 of them, fixed seed, 4
    standard errors: 9 %) and normal (Kolmogorov-Smirnov at 1e-3)."""
    shape = (1024, 40)
    for name, make in (("row_noise_dn", lambda image: image), ("column_noise_dn", lambda image: image.T)):
        size = shape if name == "row_noise_dn" else shape[::-1]
        frames = [make(dark_values(context, size, frame, **{name: 100.0})) for frame in (0, 1, FRAME)]
        for index, frame in enumerate(frames):
            assert np.ptp(frame, axis=1).max() == 0
            lines = frame[:, 0] / 100
            assert abs(lines.std() - 1) < 4 / np.sqrt(2 * 1024)
            assert scipy.stats.kstest(lines, "norm").pvalue > 1e-3
            assert abs(np.mean(lines * frames[index - 1][:, 0] / 100)) < 4 / 32


def test_column_offset_stays(context):
    first = dark_values(context, (16, 1024), 0, column_offset_dn=50.0)
    assert np.array_equal(first, dark_values(context, (16, 1024), FRAME, column_offset_dn=50.0))
    assert np.ptp(first, axis=0).max() == 0
    assert abs(first[0].std() / 50 - 1) < 4 / np.sqrt(2 * 1024)
    noise = dark_values(context, (16, 1024), 0, column_noise_dn=50.0)
    assert abs(np.corrcoef(first[0], noise[0])[0, 1]) < 4 / 32  # another stream


def test_read_noise_spread_keeps_the_mean_square(context):
    """Pixels differ: ln of their deviation has the given deviation s; the root mean square over all is read_noise_dn.
    64 frames of n = 128 x 128, fixed seed: the standard error of the mean square is sqrt((exp(4 s^2) - 1) / n) = 1 %;
    without the factor exp(-s^2) it would be off by 65 %. ln of a deviation measured in 64 frames has the variance s^2
    + 1/128."""
    spread = 0.5
    frames = np.stack(
        [dark_values(context, (128, 128), t, read_noise_dn=40.0, read_noise_spread=spread) for t in range(64)]
    )
    assert abs(np.mean(frames**2) / 1600 - 1) < 0.05
    logarithm = np.log(np.sqrt(np.mean(frames**2, axis=0)))
    assert abs(logarithm.std() - np.sqrt(spread**2 + 1 / 128)) < 0.02
    expected = sensor.Sensor(128, 128, seed=56, read_noise_dn=40.0, read_noise_spread=spread).read_noise_map_dn()
    normal = philox.image_pair_normal(128, 128, 56, 7, 0x10)
    big = np.abs(normal) > 0.1
    assert np.abs(frames[7] / normal / expected - 1)[big].max() < 2e-3


# --- ADC ---


@pytest.mark.parametrize("bits", [8, 10, 16])
def test_effective_bits_leave_only_multiples(context, bits):
    for effective in range(1, bits + 1):
        stage = clspeckle.Sensor(
            SHAPE,
            context=context,
            bits=bits,
            effective_bits=effective,
            exposure_gain_dn=2.0**bits / 4,
            black_level_dn=2.0**bits / 32,  # so low that dark pixels reach code 0 in any draw
            read_noise_dn=2.0**bits / 50,
        )
        codes = stage.expose(intensity_image())
        step = 2 ** (bits - effective)
        assert np.all(codes % step == 0)
        assert codes.max() == 2**bits - step  # some pixels saturate
        if effective <= 6:
            assert np.array_equal(np.unique(codes), np.arange(0, 2**bits, step))


def test_effective_bits_round_to_the_nearest_multiple(context):
    stage = clspeckle.Sensor(
        (1, 6), context=context, effective_bits=8, exposure_gain_dn=1.0, black_level_dn=0.0, read_noise_dn=0.0
    )
    image = np.array([[1.9, 2, 2.1, 6, 1021.9, 5000]], np.float32)
    assert stage.expose(image).tolist() == [[0, 0, 4, 8, 1020, 1020]]  # 2 and 6 lie between: to the even multiple


# --- Changing a sensor ---


def test_configure_makes_the_same_sensor_as_a_new_one(context):
    dark = np.random.default_rng(57).normal(0, 3, SHAPE).astype(np.float32)
    image = intensity_image()
    gains = np.random.default_rng(58).normal(1, 0.02, SHAPE).astype(np.float32)
    stage = clspeckle.Sensor(
        SHAPE, context=context, bits=12, seed=3, dark_frame_dn=dark, gain_map=gains, exposure_gain_dn=800.0
    )
    before = stage.expose(image, frame_index=2)
    for changes in ({"prnu": 0.1}, {"row_noise_dn": 4.0, "prnu": 0.0}, {"lag_fraction": 0.5}, {"bits": 10}, {}):
        stage.configure(**changes)
        options = {name: value for name, value in stage._options.items() if value is not None}
        fresh = clspeckle.Sensor(SHAPE, context=context, **options)
        assert np.array_equal(stage.expose(image, frame_index=2), fresh.expose(image, frame_index=2))
        assert stage.bits == fresh.bits
    stage.configure(bits=12, row_noise_dn=None, lag_fraction=None)
    assert np.array_equal(stage.expose(image, frame_index=2), before)


def test_configure_that_fails_changes_nothing(context):
    image = intensity_image()
    stage = clspeckle.Sensor(SHAPE, context=context, prnu=0.05, lag_fraction=0.2, read_noise_dn=0.0)
    twin = clspeckle.Sensor(SHAPE, context=context, prnu=0.05, lag_fraction=0.2, read_noise_dn=0.0)
    assert np.array_equal(stage.expose(image), twin.expose(image))
    for bad in ({"prnu": -1.0}, {"bits": 99}, {"shot_noise": True}, {"gamma": 0.0}):
        with pytest.raises(clspeckle.errors.InvalidArgumentError):
            stage.configure(**bad)
    with pytest.raises(TypeError, match="prnu"):
        stage.configure(prun=0.1)
    dim = image * np.float32(0.1)
    assert np.array_equal(stage.expose(dim), twin.expose(dim))  # the frame before is not forgotten either


def test_configure_keeps_no_memory_of_what_is_off(context):
    """Maps and the lag's frame are there only while their effect is on."""
    empty = context.info().allocated_bytes
    with clspeckle.Sensor((64, 100), context=context) as stage:
        assert context.info().allocated_bytes == empty
        for option, size in (
            ({"prnu": 0.1}, 4),
            ({"dsnu_dn": 1.0}, 4),
            ({"column_offset_dn": 1.0}, 4),
            ({"row_offset_dn": 1.0}, 4),
            ({"periodic_offset_dn": 1.0}, 4),
            ({"dull_pixel_fraction": 0.1}, 4),
            ({"hot_pixel_fraction": 0.1}, 4),
            ({"cold_pixel_fraction": 0.1}, 1),
            ({"read_noise_spread": 0.1}, 4),
            ({"lag_fraction": 0.1}, 8),  # the frame before, and this one
            ({"shot_noise": True, "conversion_gain_dn_per_e": 1.0}, 0),
            ({"telegraph_fraction": 0.1, "telegraph_step_dn": 9.0, "cubic_nonlinearity": 0.1}, 0),
            ({"code_width_wave": 0.1}, 0),
            ({"read_noise_correlation": 0.1}, 0),
            ({"row_noise_dn": 1.0, "column_noise_dn": 1.0, "gamma": 0.9, "crosstalk_fraction": 0.1}, 0),
        ):
            stage.configure(**option)
            assert context.info().allocated_bytes - empty == size * 6400, option
            stage.configure(**dict.fromkeys(option))
            assert context.info().allocated_bytes == empty


# --- Impossible cameras ---


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"shot_noise": True}, "conversion_gain_dn_per_e"),
        ({"dark_current_e_per_s": 1.0}, "conversion_gain_dn_per_e"),
        ({"full_well_e": 1000.0}, "conversion_gain_dn_per_e"),
        ({"photons_per_unit": 1000.0}, "conversion_gain_dn_per_e"),
        ({"conversion_gain_dn_per_e": 0.1, "full_well_e": 600.0}, "black level"),
        ({"conversion_gain_dn_per_e": 0.1, "full_well_e": 6000.0, "saturation_dn": 500.0}, "saturation_dn"),
        ({"conversion_gain_dn_per_e": 0.1, "photons_per_unit": 600.0, "exposure_gain_dn": 500.0}, "exposure_gain_dn"),
        ({"conversion_gain_dn_per_e": 0.1, "photons_per_unit": 600.0, "quantum_efficiency": 1.5}, "quantum_efficiency"),
        (
            {
                "conversion_gain_dn_per_e": 0.1,
                "full_well_e": 5000.0,
                "dark_current_e_per_s": 6000.0,
                "exposure_time_s": 1.0,
            },
            "dark current alone",
        ),
        ({"black_level_dn": 1023.0}, "white"),
        ({"effective_bits": 11}, "effective_bits"),
        ({"mosaic_gain": [0, 0, 0, 0]}, "mosaic_gain"),
        ({"mosaic_gain": [1, 1, -1, 1]}, "mosaic_gain"),
        ({"lag_fraction": 1.0}, "lag_fraction"),
        ({"gamma": 0.0}, "gamma"),
        ({"temperature_c": -300.0}, "temperature_c"),
        ({"dark_current_doubling_k": 0.0}, "dark_current_doubling_k"),
        ({"crosstalk_fraction": 1.01}, "crosstalk_fraction"),
        ({"prnu": float("nan")}, "prnu"),
        ({"row_noise_dn": float("inf")}, "row_noise_dn"),
    ],
)
def test_impossible_cameras_are_refused(context, options, words):
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match=words):
        clspeckle.Sensor((8, 8), context=context, **options)


def test_wrong_python_arguments(context):
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="mosaic_gain"):
        clspeckle.Sensor((8, 8), context=context, mosaic_gain=[1, 2, 3])
    with pytest.raises(TypeError, match="shot_noise"):
        clspeckle.Sensor((8, 8), context=context, shot_noise=1)
    stage = clspeckle.Sensor((8, 8), context=context)
    with pytest.raises(clspeckle.errors.InvalidFormatError, match="raw"):
        stage.demosaic(np.zeros((8, 8)), "RGGB")
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="raw"):
        stage.demosaic(np.zeros((8, 9), np.uint16), "RGGB")


# --- What a user has of a camera ---


def test_dark_frame_from_captures(context):
    """Mean and unbiased variance as NumPy's; the noise of 30 frames of 64 x 48 pixels within 4 standard errors."""
    rng = np.random.default_rng(58)
    pattern = rng.normal(70, 5, (48, 64))
    frames = np.rint(rng.normal(pattern, 3.0, (30, 48, 64))).astype(np.uint16)
    dark, noise = clspeckle.sensor.dark_frame_from_captures(frames, 64.0)
    assert np.allclose(dark, frames.mean(axis=0) - 64, rtol=0, atol=1e-5)
    assert noise == pytest.approx(np.sqrt(frames.var(axis=0, ddof=1).mean()), rel=1e-12)
    assert abs(noise / np.sqrt(9 + 1 / 12) - 1) < 4 / np.sqrt(2 * 29 * 48 * 64)
    single, none = clspeckle.sensor.dark_frame_from_captures(frames[:1], 64.0)
    assert none is None
    assert np.array_equal(single, frames[0].astype(np.float32) - 64)
    strided, _ = clspeckle.sensor.dark_frame_from_captures(frames[:, ::2, ::-1], 0.0)
    assert np.allclose(strided, frames[:, ::2, ::-1].mean(axis=0), rtol=0, atol=1e-4)
    extremes = np.full((1000, 2, 2), 65535, np.uint16)
    extremes[::2, 0, 0] = 0
    dark, noise = clspeckle.sensor.dark_frame_from_captures(extremes, 0.0)
    assert dark[0, 0] == 32767.5
    assert dark[1, 1] == 65535
    assert noise == pytest.approx(65535 / 2 * np.sqrt(1000 / 999) / 2, rel=1e-12)
    # The camera that has this dark frame gives it back.
    stage = clspeckle.Sensor((48, 64), context=context, read_noise_dn=0.0, dark_frame_dn=frames.mean(axis=0) - 64)
    assert np.abs(stage.expose(np.zeros((48, 64), np.float32)) - frames.mean(axis=0)).max() <= 0.5001
    for bad in (frames.astype(np.int32), frames[0], np.zeros((0, 4, 4), np.uint16)):
        with pytest.raises(clspeckle.errors.ClspeckleError, match="frames"):
            clspeckle.sensor.dark_frame_from_captures(bad, 64.0)


def test_profile(context):
    values = clspeckle.Sensor.profile("os04a10")
    assert values["shape"] == (1520, 2688)
    assert values["bits"] == 10
    assert values["black_level_dn"] == 64
    assert values["read_noise_dn"] == pytest.approx(0.015 * 1023)
    shape = (64, 48)
    stage = clspeckle.Sensor(**{**values, "shape": shape}, context=context)
    noise = np.stack([stage.expose(np.full(shape, 0.5, np.float32), frame_index=t).astype(float) for t in range(8)])
    assert noise.std(axis=0, ddof=1).mean() / 1023 == pytest.approx(0.015, rel=0.05)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="OS04A10"):
        clspeckle.Sensor.profile("IMX999")
    with pytest.raises(TypeError, match="name"):
        clspeckle.Sensor.profile(4)
