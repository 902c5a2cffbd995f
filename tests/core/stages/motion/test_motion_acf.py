"""Speckle that moves: the experiments of the thesis (3.2.4 to 3.2.6, 3.2.8) repeated with Motion, Phase and Aperture,
and with real images."""

from __future__ import annotations

import os
from pathlib import Path

import clspeckle
import numpy as np
import pytest
import scipy.signal

from reference import motion, phase

# n = 2^17 independent samples: a field correlation has a standard error of at most 1 / sqrt(2 n) = 2e-3 per
# polarization. The slope of the bell where it is 1/e is 0.77 per correlation length, so the length is known to 0.3 %
# and BOUND (3.5 errors of the intensity's) is never reached by chance; a length that is off by 5 % would move the curve
# by 0.04.
SHAPE = (256, 512)
BOUND = 7e-3
INTRINSICS = (2e5, 2e5, 255.5, 127.5)  # narrow, so that all pixels look along the axis
LENGTHS = {"lateral": 0.5e-3, "axial": 3e-3, "rotation": np.deg2rad(0.25)}
SPARK = Path(os.environ.get("CLSPECKLE_TEST_DATA", "none")) / "spark_memory_effect"


def transform(kind, step):
    """The thesis's three experiments: the device moves by `step`."""
    pose = np.eye(4)
    if kind == "lateral":
        pose[0, 3] = step
    elif kind == "axial":
        pose[2, 3] = step
    else:  # the board turns about an axis in its own plane, at 1 m
        c, s = np.cos(step), np.sin(step)
        pose[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
        pose[:3, 3] = np.array([0, 0, 1]) - pose[:3, :3] @ [0, 0, 1]
    return pose


class Experiment:
    """A flat board at 1 m whose field and intensity follow a motion."""

    def __init__(self, context, seed=41, **materials):
        table = clspeckle.MaterialTable([clspeckle.Material(**materials)], context=context)
        self.motion = clspeckle.Motion(SHAPE, intrinsics=INTRINSICS, materials=table, context=context)
        self.phase = clspeckle.Phase(SHAPE, dynamics="continuous", polarization_count=1, seed=seed, context=context)
        self.depth = np.ones(SHAPE, np.float32)
        self.phase.refresh(0)
        self.index = 0

    def move(self, pose, frame_time_s=0.0):
        given = clspeckle.MotionInput(depth=self.depth, previous_from_current=pose, frame_time_s=frame_time_s)
        found = self.motion.compute(given, ("path", "correlation"))
        self.index += 1
        self.phase.advance(self.index, path=found["path"], correlation=found["correlation"])

    def field(self):
        return self.phase.field(0).astype(np.complex128)


def correlation(a, b):
    return float(np.mean((a * b.conj()).real))


@pytest.mark.parametrize("kind", LENGTHS)
def test_correlation_lengths_of_the_three_motions(context, measured, kind):
    """From the ACF of the field against displacement, each set length comes back within 1 % (asked: 5 %), and the curve
    is the bell."""
    experiment = Experiment(context)
    start = experiment.field()
    step = 0.1 * LENGTHS[kind]
    curve = [1.0]
    for _ in range(23):
        experiment.move(transform(kind, step))
        curve.append(correlation(experiment.field(), start))
    displacement = step * np.arange(len(curve))
    length = np.interp(-np.exp(-1), -np.array(curve), displacement)
    measured(f"relative error of the {kind} length", abs(length / LENGTHS[kind] - 1))
    assert abs(length / LENGTHS[kind] - 1) < 0.01
    # The board's edge is half a milliradian off the axis: a rotation about its centre moves it by up to 1.3 mm times
    # the angle.
    difference = np.abs(curve - phase.path_correlation(displacement / LENGTHS[kind])).max()
    measured("difference from the bell", difference)
    assert difference < BOUND


def test_seven_micrometre_steps_give_the_curve_of_large_ones(context, measured):
    """The thesis's step: 140 frames of 7 um against 7 of 140 um; the same autocorrelation within the statistical
    error."""
    fine, coarse = Experiment(context, seed=42), Experiment(context, seed=43)
    fine_start, coarse_start = fine.field(), coarse.field()
    for _ in range(7):
        for _ in range(20):
            fine.move(transform("lateral", 7e-6))
        coarse.move(transform("lateral", 140e-6))
        a, b = correlation(fine.field(), fine_start), correlation(coarse.field(), coarse_start)
        measured("difference of correlation", abs(a - b))
        assert abs(a - b) < BOUND


def test_a_surface_that_lives(context, measured):
    """Skin with tau = 80 ms at 30 frames a second, in a device that rests: exp(-k dt / tau)."""
    experiment = Experiment(context, seed=44, correlation_time_s=0.08)
    start = experiment.field()
    for frame in range(1, 9):
        experiment.move(np.eye(4), 1 / 30)
        found = correlation(experiment.field(), start)
        measured("difference of correlation", abs(found - np.exp(-frame / 30 / 0.08)))
        assert abs(found - np.exp(-frame / 30 / 0.08)) < BOUND


def test_intensity_behind_the_aperture(context, measured):
    """The intensity's autocorrelation is |R|^2 (Siegert). At D = 0.5 the 2^17 pixels hold about n = pi/16 * 2^17 =
    25700 independent speckles: a standard error of at most 2 / sqrt(n) = 0.0125; averaged over four boards 0.0062, the
    bound is 3.5 of them."""
    aperture = clspeckle.Aperture(SHAPE, relative_diameter=0.5, context=context)
    ideal = np.ones(SHAPE, np.float32)
    curves = []
    for seed in range(4):
        experiment = Experiment(context, seed=100 + seed)
        first = aperture.intensity(experiment.phase, ideal)
        curve = []
        for _ in range(6):
            experiment.move(transform("lateral", 0.35 * LENGTHS["lateral"]))
            curve.append(np.corrcoef(first.ravel(), aperture.intensity(experiment.phase, ideal).ravel())[0, 1])
        curves.append(curve)
    found = np.mean(curves, axis=0)
    expected = phase.path_correlation(0.35 * np.arange(1, 7)) ** 2
    measured("difference of correlation", np.abs(found - expected).max())
    assert np.abs(found - expected).max() < 0.022


def test_the_rule_of_the_thesis(context):
    """Kept below the threshold, replaced above it, whatever the path: (3.3) with a threshold of a tenth of a length."""
    motion = clspeckle.Motion(SHAPE, intrinsics=INTRINSICS, rule="replace", replace_threshold=0.1, context=context)
    state = clspeckle.Phase(SHAPE, field="unit_phasor", seed=5, context=context)
    state.refresh(0)
    start = state.field(0)
    depth = np.ones(SHAPE, np.float32)
    for index, (step, moves) in enumerate([(40e-6, False), (60e-6, True)], 1):
        given = clspeckle.MotionInput(depth=depth, previous_from_current=transform("lateral", step))
        state.advance(index, mask=motion.compute(given, ("mask",))["mask"])
        assert np.any(state.field(0) != start) == moves
        assert not moves or not np.any(state.field(0) == start)


# --- 41 images of speckle behind ground glass while a pinhole moves in steps of 0.05 mm: CONTRIBUTING.md says where
# they are. ---


def spark_image(index):
    """720 x 540 pixels of an 8-bit BMP with a palette of greys; its rows run upwards."""
    raw = np.fromfile(SPARK / f"{index}.bmp", np.uint8)
    return raw[1078:].reshape(540, 720)[::-1].astype(np.float64)


STEPS = np.arange(1, 16)
SPARK_SHAPE = (540, 720)
STEP_PX = 8  # 7.9 measured


@pytest.fixture(scope="module")
def spark():
    """The measured series, or none; of each statistic the mean over all pairs of images that many steps apart, and as
    its spread the standard deviation over these pairs (26 to 40)."""
    if not SPARK.is_dir():
        pytest.skip("CLSPECKLE_TEST_DATA names no folder of published images")
    series = motion.Series([spark_image(k) for k in range(-20, 21)])
    return series, {
        name: (np.array([v.mean() for v in values]), np.array([v.std() for v in values]))
        for name in ("registered", "maximum")
        for values in [[getattr(series, name)(step) for step in STEPS]]
    }


def noisy(intensity, fraction, rng):
    return intensity + rng.normal(0, np.sqrt(fraction / (1 - fraction)) * intensity.std(), intensity.shape)


class Translation:
    """A field around the images that moves with its surface by STEP_PX to the left, as theirs does. The border holds
    what reaches into the images from outside; the padding of the transform would be drawn anew with each step."""

    def __init__(self, context, border, seed):
        self.border = border
        self.shape = tuple(n + 2 * border for n in SPARK_SHAPE)
        self.phase = clspeckle.Phase(
            self.shape, dynamics="continuous", translate=True, polarization_count=1, seed=seed, context=context
        )
        self.phase.refresh(0)
        self.shift = np.zeros((*self.shape, 2), np.float32)
        self.shift[..., 0] = STEP_PX  # previous minus current
        self.index = 0

    def move(self, path):
        self.index += 1
        self.phase.advance(self.index, path=path, shift=self.shift)


def fading_series(context, length_steps, noise_fraction, seed, count=25):
    """Speckle of the images' width (ACF 7.1 px wide at half height: D = 1.03 / 7.1 of a circular pupil) that moves,
    fades and is noisy."""
    rng = np.random.default_rng(seed)
    scene = Translation(context, 4 * STEP_PX, seed)
    aperture = clspeckle.Aperture(scene.shape, relative_diameter=1.03 / 7.1, context=context)
    ideal = np.ones(scene.shape, np.float32)
    inside = slice(scene.border, -scene.border)
    images = []
    for _ in range(count):
        intensity = aperture.intensity(scene.phase, ideal)[inside, inside].astype(np.float64)
        images.append(noisy(intensity, noise_fraction, rng))
        scene.move(1 / length_steps)
    return motion.Series(images)


def pinhole_series(context, length_steps, noise_fraction, seed, count=25):
    """The experiment itself: a field that moves and does not fade, seen through the pinhole (100 um, two steps wide: 16
    px)."""
    rng = np.random.default_rng(seed)
    scene = Translation(context, STEP_PX, seed)
    images = []
    for index in range(count):
        kernel = motion.pinhole_kernel(2 * STEP_PX, STEP_PX, length_steps, index)
        field = scene.phase.field(0)[: scene.shape[0], : scene.shape[1]]
        field = scipy.signal.fftconvolve(field, kernel, mode="valid")
        images.append(noisy(np.abs(field) ** 2, noise_fraction, rng))
        scene.move(0.0)
    return motion.Series(images)


def means_of(simulate, statistic):
    """Of a statistic of simulated series, the mean over pairs and series."""
    return np.mean([[getattr(series, statistic)(step).mean() for step in STEPS] for series in simulate], axis=0)


def test_translation_series_of_real_speckle(context, measured, spark):
    """Correlation against step at the place to which the speckle has moved, with one fitted length: the field that
    fades as R^2 lies within two spreads of the measurement at all steps (0.014 to 0.024; a spread is 0.007 to 0.012).
    The two are not the same curve: the measured one is that of a pinhole (below), and R^2 with the best length differs
    from it by up to 0.017 (1.8 spreads), below it at steps 3 to 6 and above it at 9 to 13. Of a single series of about
    6000 speckles the simulation has an error of 0.01; two are averaged."""
    series, table = spark
    mean, spread = table["registered"]
    rate = -series.position[-1, 1] / (len(series.spectra) - 1)
    assert abs(rate - STEP_PX) < 0.2
    length, noise = motion.fitted(phase.path_correlation, STEPS, mean, spread, rate, SPARK_SHAPE[1])
    simulated = means_of([fading_series(context, length, noise, seed) for seed in (3, 4)], "registered")
    for step, found in zip(STEPS, (simulated - mean) / spread):
        measured(f"step {step}: spreads", abs(found))
    assert np.all(np.abs(simulated - mean) < 2 * spread)
    assert 8 < length < 12  # 0.4 to 0.6 mm: the thesis has 0.5 mm


def test_pinhole_explains_the_tail_of_the_peak(context, measured, spark):
    """The largest value anywhere, the usual measure, has a heavier tail than the value at the place of the speckle:
    from step 8 on the peak splits in two, 11 px apart at step 12. That is optics, not the surface: the glass is lit by
    the Airy pattern of the pinhole, which slides over it. Its curve, 2 J1(x) / x squared, meets the registered
    correlations within half a spread with one fitted length and white noise, and the field that Phase moves without
    fading, seen through that pinhole, follows both statistics."""
    series, table = spark
    mean, spread = table["registered"]
    rate = -series.position[-1, 1] / (len(series.spectra) - 1)
    length, noise = motion.fitted(motion.airy, STEPS, mean, spread, rate, SPARK_SHAPE[1])
    expected = (1 - noise) * (1 - rate * STEPS / SPARK_SHAPE[1]) * motion.airy(STEPS / length) ** 2
    measured("pinhole's curve: spreads", np.abs((expected - mean) / spread).max())
    assert np.all(np.abs(expected - mean) < 0.5 * spread)
    simulate = [pinhole_series(context, length, noise, seed) for seed in (3, 4, 5)]
    simulated = means_of(simulate, "registered")
    measured("registered: spreads", np.abs((simulated - mean) / spread).max())
    assert np.all(np.abs(simulated - mean) < spread)
    # Up to 0.022 too high. At steps 1 to 7, 0.01 is owed to the images' 7.9 px a step: their highest pixel misses the
    # peak by up to half a pixel. Of the 0.02 at steps 8 to 12, 0.01 is the chance of one measured series and the rest
    # is not explained. A field that only fades is 0.05 too low there.
    difference = means_of(simulate, "maximum") - table["maximum"][0]
    for step, found in zip(STEPS, difference):
        measured(f"maximum at step {step}: difference", abs(found))
    assert np.abs(difference).max() < 0.025
    # The measured peak at step 12 is two peaks, on both sides of the place of the speckle, with a valley between them.
    sides = np.array([-5.5, 0.0, 5.5])
    profile = np.zeros(3)
    for k in series.pairs(12):
        dy, dx = series.position[k + 12] - series.position[k]
        profile += series.at(series.spectra[k], series.spectra[k + 12], np.array([dy]), dx + sides)[0] / len(
            series.pairs(12)
        )
    measured("valley over the lower peak", profile[1] / min(profile[0], profile[2]))
    assert profile[1] < 0.5 * min(profile[0], profile[2])
