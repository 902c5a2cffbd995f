"""Philox on the device against Random123's vectors, randomgen and the float64 reference."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
import randomgen
import scipy.stats

from reference import philox

LOCAL_SIZES = [0, 1, 2, 7, 32, 64, 100, 128, 256]
SEED = 0xFEDCBA9876543210


def test_known_answers(context):
    """Random123's kat_vectors, bit for bit."""
    for counter, key, block in philox.KNOWN_ANSWERS:
        got = clspeckle.philox.blocks([counter], key, context=context)
        assert got.tolist() == [list(block)]


@pytest.mark.parametrize("local_size", LOCAL_SIZES)
def test_blocks_do_not_depend_on_the_work_group_size(context, local_size):
    """1501 counters (no multiple of any of the sizes), the same integers as the reference's and randomgen's."""
    rng = np.random.default_rng(11)
    counters = rng.integers(0, 2**32, (1501, 4), dtype=np.uint32)
    key = (0x9E3779B9, 0xFFFFFFFE)
    got = clspeckle.philox.blocks(counters, key, local_size=local_size, context=context)
    assert np.array_equal(got, philox.philox4x32_10(counters, key))
    for counter, block in zip(counters[:20], got[:20], strict=True):
        # randomgen counts up before it draws.
        start = (sum(int(word) << (32 * i) for i, word in enumerate(counter)) - 1) % 2**128
        generator = randomgen.Philox(counter=start, key=key[0] | key[1] << 32, number=4, width=32)
        assert block.tolist() == generator.random_raw(4).tolist()


@pytest.mark.parametrize("local_size", LOCAL_SIZES)
@pytest.mark.parametrize("shape", [(1, 1), (2, 300), (33, 55), (64, 64)])
def test_image_bits(context, shape, local_size):
    got = clspeckle.philox.bits(shape, seed=SEED, frame_index=3, stream=0xFFFF, local_size=local_size, context=context)
    assert np.array_equal(got, philox.image_words(*shape, SEED, 3, 0xFFFF))


@pytest.mark.parametrize("frame_index", [0, 2**32 - 1, 2**32, 2**48 - 1])
@pytest.mark.parametrize("seed", [0, 1, 2**32, 2**64 - 1])
def test_frame_index_and_seed_use_all_their_bits(context, frame_index, seed):
    got = clspeckle.philox.bits((9, 10), seed=seed, frame_index=frame_index, stream=0x8000, context=context)
    assert np.array_equal(got, philox.image_words(9, 10, seed, frame_index, 0x8000))


def test_uniform(context, measured):
    """The single-precision definition bit for bit; within 2^-24 (half a unit in the last place at 1) of (w + 1/2) /
    2^32."""
    shape = (1024, 1024)
    got = clspeckle.philox.uniform(shape, seed=SEED, context=context)
    words = philox.image_words(*shape, SEED, 0, 0x8000)
    assert np.array_equal(got.astype(np.float64), philox.uniform(words))
    error = np.abs(got - philox.uniform_exact(words)).max()
    measured("error of the uniform", error)
    assert error <= 2.0**-24 < 1e-6


def test_normal(context, measured):
    """Within 1e-6 of float64 (measured 5.1e-7 on PoCL) over 4 million normals, the largest of them above 5.

    The reference starts from the single-precision uniform, which is the definition; where u is near 1, sqrt(-2 ln u)
    magnifies that rounding, so against (w + 1/2) / 2^32 the bound is sqrt(2^-23) = 3.5e-4.
    """
    shape = (2048, 2048)
    got = clspeckle.philox.normal(shape, seed=SEED, context=context).astype(np.float64)
    error = np.abs(got - philox.image_normal(*shape, SEED, 0, 0x8000)).max()
    measured("error of the normal", error)
    assert np.abs(got).max() > 5
    assert error < 1e-6
    exact = np.abs(got - philox.image_normal(*shape, SEED, 0, 0x8000, exact=True)).max()
    measured("error of the normal against an unrounded uniform", exact)
    assert exact < 2.0**-11.5


def test_phasor(context, measured):
    """exp(2 pi i w / 2^32) as the unit phasor field shows it: within 1e-6 of float64 (measured 1.0e-7 on PoCL)."""
    state = clspeckle.Phase((1024, 1024), field="unit_phasor", polarization_count=1, seed=SEED, context=context)
    state.refresh(0)
    error = np.abs(state.field(0) - philox.phasor(philox.image_words(1024, 1024, SEED, 0, 1))).max()
    measured("error of the phasor", error)
    assert error < 1e-6


def test_uniform_law(context):
    """n = 2^20, fixed seed. Kolmogorov-Smirnov at level 1e-3: critical distance 1.9e-3. Mean and variance within 3.5
    standard errors (2.8e-4 and 7.5e-5): a mean off by 1.4e-3 would fail with probability above 0.999."""
    n = 1 << 20
    u = clspeckle.philox.uniform((1024, 1024), seed=5, context=context).astype(np.float64).ravel()
    assert scipy.stats.kstest(u, "uniform").pvalue > 1e-3
    assert abs(u.mean() - 0.5) < 3.5 * np.sqrt(1 / 12 / n)
    assert abs(u.var() - 1 / 12) < 3.5 * np.sqrt(1 / 180 / n)


def test_normal_law(context):
    """n = 2^20, fixed seed. Kolmogorov-Smirnov at level 1e-3: critical distance 1.9e-3, so a standard deviation of
    1.01 (distance 2.4e-3) would be rejected with probability about 0.9. Moments within 3.5 standard errors: the
    variance finds an error of 0.7 % in the standard deviation with probability above 0.999. Neighbours, and the two
    normals of a Box-Muller pair (a quarter of the image apart), uncorrelated to 3.5 standard errors."""
    n = 1 << 20
    image = clspeckle.philox.normal((1024, 1024), seed=6, context=context).astype(np.float64)
    normals = image.ravel()
    assert scipy.stats.kstest(normals, "norm").pvalue > 1e-3
    for power, moment, variance in ((1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96)):
        assert abs(np.mean(normals**power) - moment) < 3.5 * np.sqrt(variance / n)
    assert abs(np.mean(image[:, 1:] * image[:, :-1])) < 3.5 / np.sqrt(n)
    assert abs(np.mean(image[1:] * image[:-1])) < 3.5 / np.sqrt(n)
    assert abs(np.mean(image[256:512] * image[:256])) < 3.5 / np.sqrt(n / 4)


def test_streams_and_frames_are_independent(context):
    """n = 2^18 normals each; correlation within 3.5 standard errors, fixed seed."""
    shape = (512, 512)
    first = clspeckle.philox.normal(shape, seed=7, context=context).astype(np.float64)
    for change in ({"frame_index": 1}, {"stream": 0x8001}, {"frame_index": 2**32}):
        other = clspeckle.philox.normal(shape, seed=7, context=context, **change)
        assert abs(np.mean(first * other)) < 3.5 / np.sqrt(first.size)
