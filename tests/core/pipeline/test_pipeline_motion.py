"""Whole frames of scenes that move: speckle that travels with its surface, decorrelates along its path, blurs while the
shutter is open; and what is wrong with a frame's motion or materials.

A plane at 0.5 m; a shift of the surface by one pixel is 0.5 / 500 = 1 mm. 256 x 256 pixels at D = 0.386 hold 7,600
independent speckles: a correlation of intensities has a standard error of about 0.015 in one pair of frames.
"""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest

SIZE = 256
SHAPE = (SIZE, SIZE)
FOCAL = 500.0
DEPTH = 0.5
FLAT = np.ones(SHAPE, np.float32)


def camera(context, motion=None, **parameters):
    options = {"f_number": 8.0, "normalization": "unit_mean", "output": "intensity", "seed": 6} | parameters
    stage = {"intrinsics": (FOCAL, FOCAL, (SIZE - 1) / 2, (SIZE - 1) / 2)} | (motion or {})
    return clspeckle.Pipeline.from_parameters(SHAPE, context=context, motion=stage, **options)


def moved_by(x=0.0, y=0.0, z=0.0, **parameters):
    """The plane was (x, y, z) metres away from where it is."""
    transform = np.eye(3, 4)
    transform[:, 3] = x, y, z
    return clspeckle.MotionInput(depth=np.full(SHAPE, DEPTH, np.float32), previous_from_current=transform, **parameters)


def steady(**lengths):
    """A surface that keeps its speckle, but for the lengths given."""
    infinite = dict.fromkeys(
        ("lateral_correlation_length_m", "axial_correlation_length_m", "rotation_correlation_angle_rad"), np.inf
    )
    return clspeckle.Material(**infinite | lengths)


def correlation(a, b):
    return np.mean((a - 1) * (b - 1))


def law(path):
    d = min(0.9386677132131623 * path, 2.0)
    return (1 - d / 2) * np.cos(np.pi * d / 2) + np.sin(np.pi * d / 2) / np.pi


def test_speckle_travels_with_its_surface(context, measured):
    pipeline = camera(context, {"translate": True}, materials=[steady()])
    material = np.zeros(SHAPE, np.uint8)
    pixel = DEPTH / FOCAL
    first = pipeline.render(FLAT, refresh="all", material=material).astype(np.float64)
    for k in range(1, 4):
        # Three pixels to the right, two up, in each frame.
        frame = pipeline.render(FLAT, motion=moved_by(-3 * pixel, 2 * pixel), material=material).astype(np.float64)
        dx, dy = 3 * k, 2 * k
        margin = 24  # the lens's point spread at the edge that comes in
        here = frame[margin : SIZE - dy - margin, dx + margin : SIZE - margin]
        there = first[dy + margin : SIZE - margin, margin : SIZE - dx - margin]
        measured("correlation lost", 1 - np.corrcoef(here.ravel(), there.ravel())[0, 1])
        assert np.corrcoef(here.ravel(), there.ravel())[0, 1] > 0.995
        assert abs(np.corrcoef(frame.ravel(), first.ravel())[0, 1]) < 0.5


@pytest.mark.parametrize("steps", [1, 5])
def test_correlation_along_the_path(context, measured, steps):
    """0.4 mm sideways of a 0.5 mm length, in one step or five: the same correlation R(0.8)^2."""
    pipeline = camera(context, materials=[steady(lateral_correlation_length_m=0.5e-3)])
    material = np.zeros(SHAPE, np.uint8)
    values = []
    for _ in range(6):
        first = pipeline.render(FLAT, refresh="all", material=material).astype(np.float64)
        for _ in range(steps):
            last = pipeline.render(FLAT, motion=moved_by(x=0.4e-3 / steps), material=material).astype(np.float64)
        values.append(correlation(first, last))
    measured("error", abs(np.mean(values) - law(0.8) ** 2))
    # The standard error of six pairs is 0.006; four of them.
    assert np.mean(values) == pytest.approx(law(0.8) ** 2, abs=0.025)


def test_open_shutter(context, measured):
    """A path of 1.2 a frame, all of it while the shutter is open, in eight parts."""
    path, count = 1.2, 8
    pipeline = camera(
        context, materials=[steady(axial_correlation_length_m=3e-3)], shutter_fraction=1.0, sub_exposures=count
    )
    material = np.zeros(SHAPE, np.uint8)
    pipeline.render(FLAT, refresh="all", material=material)
    frames = np.stack(
        [pipeline.render(FLAT, motion=moved_by(z=path * 3e-3), material=material) for _ in range(12)]
    ).astype(np.float64)
    lags = np.arange(count)
    squared = sum((count - k) * (2 if k else 1) * law(k * path / count) ** 2 for k in lags) / count**2
    contrast = frames.std() / frames.mean()
    measured("relative error", abs(contrast / np.sqrt(squared) - 1))
    assert contrast == pytest.approx(np.sqrt(squared), rel=0.025)
    assert contrast < 0.9
    assert frames.mean() == pytest.approx(1, abs=0.02)


def test_what_was_hidden_is_drawn_once_for_the_exposure(context):
    """The right half was behind something nearer: its speckle is new, and as full of contrast as ever."""
    pipeline = camera(context, shutter_fraction=0.5)
    pipeline.render(FLAT, refresh="all")
    previous = np.full(SHAPE, DEPTH, np.float32)
    previous[:, SIZE // 2 :] = 0.8 * DEPTH
    motion = clspeckle.MotionInput(
        depth=np.full(SHAPE, DEPTH, np.float32), motion=np.zeros((*SHAPE, 2), np.float32), previous_depth=previous
    )
    frame = pipeline.render(FLAT, motion=motion)
    for half in (np.s_[:, : SIZE // 2 - 8], np.s_[:, SIZE // 2 + 8 :]):
        # 3,500 speckles: a standard error of 2.5 %.
        assert frame[half].std() / frame[half].mean() == pytest.approx(1, rel=0.1)


def test_thesis_rule_replaces_what_moves(context):
    pipeline = camera(context, {"rule": "replace"})
    first = pipeline.render(FLAT, refresh="all").astype(np.float64)
    still = pipeline.render(FLAT, motion=moved_by()).astype(np.float64)
    np.testing.assert_array_equal(still, first)
    moved = pipeline.render(FLAT, motion=moved_by(x=0.1e-3)).astype(np.float64)
    assert abs(np.corrcoef(moved.ravel(), first.ravel())[0, 1]) < 0.06


def test_skin_lives_and_wood_does_not(context):
    tau, dt = 0.1, 1 / 30
    pipeline = camera(context, materials=[steady(), clspeckle.Material(correlation_time_s=tau)])
    material = np.zeros(SHAPE, np.uint8)
    material[:, SIZE // 2 :] = 1
    values = []
    for _ in range(8):
        first = pipeline.render(FLAT, refresh="all", material=material).astype(np.float64)
        motion = moved_by(frame_time_s=dt, material=material)
        second = pipeline.render(FLAT, motion=motion, material=material).astype(np.float64)
        # Away from the borders between them, of which one lies around the periodic edge; rings of the point spread
        # reach on.
        wood, skin = np.s_[:, 16 : SIZE // 2 - 16], np.s_[:, SIZE // 2 + 16 : -16]
        assert np.corrcoef(first[wood].ravel(), second[wood].ravel())[0, 1] > 0.99
        values.append(correlation(first[skin], second[skin]))
    # Eight pairs of 3,400 speckles each: a standard error of 0.008.
    assert np.mean(values) == pytest.approx(np.exp(-2 * dt / tau), abs=0.032)


def test_bad_motion_is_taken_as_moved_and_reported(context):
    pipeline = camera(context)
    first = pipeline.render(FLAT, refresh="all")
    previous = np.zeros((*SHAPE, 3), np.float32)
    x, y = np.meshgrid(np.arange(SIZE) - (SIZE - 1) / 2, np.arange(SIZE) - (SIZE - 1) / 2)
    previous[..., 0], previous[..., 1], previous[..., 2] = x * DEPTH / FOCAL, y * DEPTH / FOCAL, DEPTH
    position = previous.copy()
    same = pipeline.render(FLAT, motion=clspeckle.MotionInput(position=position, previous_position=previous))
    np.testing.assert_array_equal(same, first)
    pipeline.check()
    previous[100:140, 60:100] = np.nan
    frame = pipeline.render(FLAT, motion=clspeckle.MotionInput(position=position, previous_position=previous))
    assert np.isfinite(frame).all()
    moved = np.s_[104:136, 64:96]
    assert abs(np.corrcoef(first[moved].ravel(), frame[moved].ravel())[0, 1]) < 0.4
    kept = np.s_[:80]
    assert np.corrcoef(first[kept].ravel(), frame[kept].ravel())[0, 1] > 0.999
    with pytest.raises(clspeckle.errors.InvalidDataError, match=r"motion: 1600 pixels NaN .* x = 60, y = 100"):
        pipeline.check()
    pipeline.check()


def test_material_ids_outside_the_table_are_reported(context):
    pipeline = clspeckle.Pipeline.from_parameters(
        SHAPE, context=context, output="intensity", materials=[clspeckle.Material(), clspeckle.Material()]
    )
    material = np.zeros(SHAPE, np.uint8)
    expected = pipeline.render(FLAT, refresh="all", material=material, frame_index=0)
    material[7, 11:14] = 2
    np.testing.assert_array_equal(pipeline.render(FLAT, refresh="all", material=material, frame_index=0), expected)
    with pytest.raises(
        clspeckle.errors.InvalidDataError, match=r"material: 3 pixels with ids outside .* x = 11, y = 7"
    ):
        pipeline.check()


def test_stages_that_do_not_fit_are_refused(context):
    size = {"context": context}
    phase = clspeckle.Phase(SHAPE, **size)
    aperture = clspeckle.Aperture(SHAPE, **size)
    motion = clspeckle.Motion(SHAPE, intrinsics=(500.0, 500.0, 128.0, 128.0), **size)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="dynamics continuous"):
        clspeckle.Pipeline(phase=phase, aperture=aperture, motion=motion)
    living = clspeckle.Phase(SHAPE, dynamics="continuous", **size)
    travelling = clspeckle.Motion(SHAPE, intrinsics=(500.0, 500.0, 128.0, 128.0), translate=True, **size)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="translate"):
        clspeckle.Pipeline(phase=living, aperture=aperture, motion=travelling)
    one = clspeckle.Phase(SHAPE, polarization_count=1, **size)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="polarization_count 2"):
        clspeckle.Pipeline(
            phase=one, aperture=aperture, materials=clspeckle.MaterialTable([clspeckle.Material()], context=context)
        )
    plain = clspeckle.Pipeline(phase=phase, aperture=aperture)
    with pytest.raises(TypeError, match="motion stage"):
        plain.render(FLAT, motion=moved_by())
