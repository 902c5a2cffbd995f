"""Images that lie together in one buffer, and light that does not depend on how finely the field is sampled."""

from __future__ import annotations

import numpy as np
import pytest

import clspeckle
from clspeckle import DeviceImage, errors


@pytest.fixture
def ideal() -> np.ndarray:
    y, x = np.mgrid[:48, :64]
    return (1 + np.cos(x / 3) * np.sin(y / 5)).astype(np.float32)


def test_side_by_side_in_one_atlas(context, ideal):
    """Left half irradiance, right half output: rows interleave, no byte is shared."""
    height, width = ideal.shape
    camera = clspeckle.Pipeline.from_parameters(ideal.shape, output="intensity", seed=3, context=context)
    expected = camera.render(ideal, frame_index=0)
    atlas = clspeckle.Buffer(height * 2 * width * 4, context=context)
    pitch = 2 * width * 4
    left = DeviceImage.wrap(atlas, ideal.shape, np.float32, pitch_bytes=pitch, context=context)
    right = DeviceImage.wrap(atlas, ideal.shape, np.float32, offset_bytes=width * 4, pitch_bytes=pitch, context=context)
    left.write(ideal)
    camera.render(left, frame_index=0, out=right)
    assert np.array_equal(right.read(), expected)
    assert np.array_equal(left.read(), ideal), "the input must be left alone"


@pytest.mark.parametrize("columns", [1, 63])
def test_one_shared_column_is_refused(context, ideal, columns):
    height, width = ideal.shape
    camera = clspeckle.Pipeline.from_parameters(ideal.shape, output="intensity", context=context)
    atlas = clspeckle.Buffer(height * 2 * width * 4, context=context)
    pitch = 2 * width * 4
    left = DeviceImage.wrap(atlas, ideal.shape, np.float32, pitch_bytes=pitch, context=context)
    right = DeviceImage.wrap(
        atlas, ideal.shape, np.float32, offset_bytes=(width - columns) * 4, pitch_bytes=pitch, context=context
    )
    left.write(ideal)
    with pytest.raises(errors.OverlapError):
        camera.render(left, out=right)


@pytest.mark.parametrize("oversampling", [2, 4])
def test_oversampling_changes_no_light(context, oversampling):
    """Mean intensity of a flat image at D = 0.5 against pi D^2 / 4. 16 frames of 128 x 128 hold about 16 * 128^2 pi D^2
    / 4 = 51,000 independent speckles at p = 1, so the mean has a standard error of 0.44 %; an error of 1 /
    oversampling^2 is 170 of them, the bound is 4."""
    shape, diameter = (128, 128), 0.5
    camera = clspeckle.Pipeline.from_parameters(
        shape, output="intensity", relative_diameter=diameter, oversampling=oversampling, seed=1, context=context
    )
    flat = np.ones(shape, np.float32)
    mean = np.mean([camera.render(flat, frame_index=i, refresh="all").mean(dtype=float) for i in range(16)])
    assert mean == pytest.approx(np.pi * diameter**2 / 4, rel=0.0044 * 4 + 0.005)  # 0.5 %: the pupil's samples


def test_light_is_quadratic_across_nyquist(context):
    """f/2.8 needs oversampling and f/5.6 does not; the wider aperture passes four times the light (thesis Fig. 34)."""
    shape = (256, 256)
    wide = clspeckle.Aperture(shape, f_number=2.8, oversampling=2, context=context).info().mean_transmission
    narrow = clspeckle.Aperture(shape, f_number=5.6, context=context).info().mean_transmission
    assert wide / narrow == pytest.approx(4, rel=0.01)


def test_grids_that_the_transform_cannot_hold_are_refused():
    with pytest.raises(errors.ClspeckleError, match="8192|67108864"):
        clspeckle.field_grid((16384, 16384))


def test_nan_reaches_the_sensor_as_darkness(context):
    sensor = clspeckle.Sensor((1, 4), read_noise_dn=0, black_level_dn=64, exposure_gain_dn=100, context=context)
    source = DeviceImage.from_array(np.array([[np.nan, -1.0, 1.0, np.inf]], np.float32), context=context)
    assert sensor.expose(source).tolist() == [[64, 64, 164, 1023]]
