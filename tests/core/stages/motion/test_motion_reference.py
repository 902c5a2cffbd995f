"""Paths, displacements and shifts against the float64 reference, for each way to say how points moved."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest

from reference import motion

SHAPE = (48, 64)
INTRINSICS = (200.0, 210.0, 31.2, 23.9)
# An axis and an angle, and a translation: the thesis's step of 7 um, a mixture, one far beyond the lengths.
MOTIONS = [
    ((0, 0, 1), 0.0, (7e-6, 0, 0)),
    ((0.2, 0.3, 1), 1e-3, (7e-6, -3e-6, 5e-6)),
    ((0, 1, 0), -2e-5, (0, 0, 1e-4)),
    ((1, 0, 0), 0.2, (0.05, -0.1, 0.2)),
]


def relief(shape=SHAPE):
    """A curved surface about 1 m away with a hole."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    depth = 1.0 + 0.1 * np.sin(0.1 * x) * np.cos(0.07 * y) + 1e-3 * x
    depth[10:14, 20:30] = [[0], [-1], [np.nan], [np.inf]]
    return depth.astype(np.float32)


def pose(axis, angle, translation):
    return np.c_[motion.rotation(axis, angle), translation]


@pytest.mark.parametrize("along_ray", [False, True])
@pytest.mark.parametrize("given", MOTIONS)
def test_rigid_motion_of_a_depth_image(context, measured, given, along_ray):
    """All outputs within 1e-6 relative; micrometres keep their digits at 1 m, where float32 positions have steps of
    0.06 um."""
    transform = pose(*given)
    depth = relief()
    kind = "along_ray" if along_ray else "along_axis"
    moving = clspeckle.Motion(SHAPE, intrinsics=INTRINSICS, depth_kind=kind, context=context)
    found = moving.compute(
        clspeckle.MotionInput(depth=depth, previous_from_current=transform), ("path", "shift", "displacement", "mask")
    )
    surface = np.isfinite(depth) & (depth > 0)
    now = motion.points(depth, INTRINSICS, along_ray)
    with np.errstate(invalid="ignore", divide="ignore"):
        before = now @ transform[:, :3].T + transform[:, 3]
        lateral, axial = motion.displacement(now, before)
        path = motion.path(lateral, axial, abs(given[1]))
        shift = motion.pixels(before, INTRINSICS) - motion.pixels(now, INTRINSICS)
        scale = np.abs(now - before)[surface].max()
    for name, got, want, size in (
        ("lateral", found["displacement"][..., 0], lateral, scale),
        ("axial", found["displacement"][..., 1], axial, scale),
        ("angle", found["displacement"][..., 2], np.full(SHAPE, abs(given[1])), max(abs(given[1]), 1e-9)),
        ("path", found["path"], path, path[surface].max()),
        ("shift x", found["shift"][..., 0], shift[..., 0], np.abs(shift[surface]).max()),
        ("shift y", found["shift"][..., 1], shift[..., 1], np.abs(shift[surface]).max()),
    ):
        error = np.abs(got - want)[surface].max() / size
        measured(f"relative error of {name}", error)
        assert error < 1e-6, name
        assert not np.any(got[~surface])
    assert np.array_equal(found["mask"] != 0, surface & (found["path"] > np.float32(0.01)))
    moving.check()


def test_previous_positions_and_normals(context, measured):
    """Angles between normals of any length down to 1e-5 rad; a sheet that turns."""
    rng = np.random.default_rng(1)
    now = motion.points(relief(), INTRINSICS)
    angle = 10.0 ** rng.uniform(-5, 0.4, SHAPE)
    normal = rng.normal(size=(*SHAPE, 3))
    pivot = np.cross(normal, rng.normal(size=(*SHAPE, 3)))
    pivot /= np.linalg.norm(pivot, axis=-1, keepdims=True)
    turned = np.cos(angle)[..., None] * normal + np.sin(angle)[..., None] * np.cross(pivot, normal)
    before = now + rng.normal(scale=1e-3, size=now.shape)
    images = [image.astype(np.float32) for image in (now, before, normal, 0.7 * turned)]
    position, previous, normals, previous_normals = (image.astype(np.float64) for image in images)
    moving = clspeckle.Motion(SHAPE, context=context)
    found = moving.compute(
        clspeckle.MotionInput(
            position=images[0], previous_position=images[1], normal=images[2], previous_normal=images[3]
        ),
        ("path", "displacement"),
    )
    surface = np.isfinite(now).all(-1) & (now[..., 2] > 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        lateral, axial = motion.displacement(position, previous)
    want = motion.angle_between(normals, previous_normals)
    error = np.abs(found["displacement"][..., 2] - want)[surface]
    measured("error of the angle in rad", error.max())
    assert error.max() < 1e-6
    path = motion.path(lateral, axial, want)
    assert np.abs(found["path"][surface] / path[surface] - 1).max() < 1e-4
    assert not found["path"][~surface].any()
    moving.check()


def plane_scene(transform):
    """Depth images of a tilted plane before and after a rigid motion of the camera, and the exact motion vectors."""
    normal, offset = np.array([0.3, -0.2, -1.0]), -1.0  # n . X = offset in the current frame
    fx, fy, cx, cy = INTRINSICS
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float64)
    rays = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], -1)
    now = rays * (offset / (rays @ normal))[..., None]
    rotation, translation = transform[:, :3], transform[:, 3]
    before_normal = rotation @ normal
    before_depth = (offset + before_normal @ translation) / (rays @ before_normal)
    before = now @ rotation.T + translation
    vectors = motion.pixels(before, INTRINSICS) - np.stack([x, y], -1)
    return now, before, vectors, before_depth, before_normal, normal


@pytest.mark.parametrize("given", [((0.2, 0.3, 1), 1e-3, (3e-4, -2e-4, 5e-4)), ((0, 1, 0), 4e-3, (0, 0, 0))])
def test_motion_vectors_and_the_previous_depth(context, measured, given):
    """A tilted plane: depth interpolated between pixels finds the exact displacement, to what single-precision vectors
    allow."""
    transform = pose(*given)
    now, before, vectors, before_depth, before_normal, normal = plane_scene(transform)
    moving = clspeckle.Motion(SHAPE, intrinsics=INTRINSICS, context=context)
    normals, previous_normals = (np.broadcast_to(n, (*SHAPE, 3)).astype(np.float32) for n in (normal, before_normal))
    found = moving.compute(
        clspeckle.MotionInput(
            depth=now[..., 2].astype(np.float32),
            motion=vectors.astype(np.float32),
            previous_depth=before_depth.astype(np.float32),
            normal=normals,
            previous_normal=previous_normals,
        ),
        ("path", "displacement", "shift"),
    )
    target = np.stack(np.meshgrid(np.arange(SHAPE[1]), np.arange(SHAPE[0])), -1) + vectors
    inner = ((target >= 0) & (target <= np.array([SHAPE[1] - 1, SHAPE[0] - 1]))).all(-1)
    outside = ((target < -0.5) | (target >= np.array([SHAPE[1], SHAPE[0]]) - 0.5)).any(-1)
    lateral, axial = motion.displacement(now, before)
    for name, got, want in (("lateral", 0, lateral), ("axial", 1, axial)):
        error = np.abs(found["displacement"][..., got] - want)[inner].max()
        measured(f"error of {name} in m", error)
        assert error < 5e-7
    want = motion.angle_between(normals.astype(np.float64), previous_normals.astype(np.float64))
    assert np.abs(found["displacement"][..., 2] - want)[inner].max() < 1e-6
    assert np.isinf(found["path"][outside]).all() and np.isfinite(found["path"][inner]).all()
    assert not found["shift"][outside].any()
    assert np.array_equal(found["shift"][inner], vectors.astype(np.float32)[inner])
    moving.check()


@pytest.mark.parametrize("angle", [1e-3, -4e-3, 0.1])
def test_roll_from_the_curl_of_motion_vectors(context, angle):
    """A wall that spins about the viewing axis: its normals stay, the curl of the vectors does not. Within 1e-6 rad, or
    1e-5 of it."""
    depth = np.ones(SHAPE, np.float32)
    fx, _, cx, cy = INTRINSICS
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float64)
    c, s = np.cos(angle), np.sin(angle)
    vectors = np.stack([c * (x - cx) - s * (y - cy) + cx - x, s * (x - cx) + c * (y - cy) + cy - y], -1)
    given = clspeckle.MotionInput(depth=depth, motion=vectors.astype(np.float32), previous_depth=depth)
    moving = clspeckle.Motion(SHAPE, intrinsics=(fx, fx, cx, cy), context=context)
    without = moving.compute(given, ("displacement",))["displacement"][..., 2]
    given.roll_from_motion = True
    found = moving.compute(given, ("displacement",))["displacement"][..., 2]
    known = np.isfinite(found)
    assert known.mean() > 0.8
    assert not without[known].any()
    assert np.abs(found[known] - abs(angle)).max() < max(1e-6, 1e-5 * abs(angle))


def test_what_was_hidden_is_new(context):
    """A box in front of a wall moves five pixels to the right: where it was, wall appears. Another material at the same
    depth is new, too."""
    depth, previous = (np.full(SHAPE, 2.0, np.float32) for _ in range(2))
    depth[10:30, 25:35] = previous[10:30, 20:30] = 1.0
    vectors = np.zeros((*SHAPE, 2), np.float32)
    vectors[10:30, 25:35, 0] = -5
    ids, previous_ids = np.zeros(SHAPE, np.uint8), np.zeros(SHAPE, np.uint8)
    previous_ids[40, 50] = 1
    moving = clspeckle.Motion(SHAPE, intrinsics=INTRINSICS, context=context)
    expected = np.zeros(SHAPE, bool)
    expected[10:30, 20:25] = True
    by_vectors = {"motion": vectors, "previous_depth": previous}
    found = moving.compute(clspeckle.MotionInput(depth=depth, **by_vectors))
    assert np.array_equal(np.isinf(found["path"]), expected)
    materials = {"material": ids, "previous_material": previous_ids}
    expected[40, 50] = True
    found = moving.compute(clspeckle.MotionInput(depth=depth, **by_vectors, **materials))
    assert np.array_equal(np.isinf(found["path"]), expected)
    # The same with transforms: the wall rests, the box has gone five pixels in its own plane.
    table = clspeckle.MaterialTable([clspeckle.Material()] * 2, context=context)
    ids = (depth == 1).astype(np.uint8)
    transforms = np.array([np.eye(4)] * 2)
    transforms[1, 0, 3] = -5 / INTRINSICS[0]
    bodies = clspeckle.Motion(SHAPE, intrinsics=INTRINSICS, materials=table, context=context)
    found = bodies.compute(
        clspeckle.MotionInput(depth=depth, material=ids, previous_from_current=transforms, previous_depth=previous),
        ("path", "shift"),
    )
    expected[40, 50] = False
    assert np.array_equal(np.isinf(found["path"]), expected)
    assert np.abs(found["shift"][15, 30] - (-5, 0)).max() < 1e-5
    moving.check()
    bodies.check()


def test_materials_have_their_own_lengths_and_times(context, measured):
    materials = [
        clspeckle.Material(),
        clspeckle.Material(
            lateral_correlation_length_m=np.inf, axial_correlation_length_m=1e-3, correlation_time_s=0.1
        ),
        clspeckle.Material(rotation_correlation_angle_rad=np.inf, correlation_time_s=0.0),
        clspeckle.Material(
            lateral_correlation_length_m=1e-4, rotation_correlation_angle_rad=0.1, correlation_time_s=3.0
        ),
    ]
    table = clspeckle.MaterialTable(materials, context=context)
    moving = clspeckle.Motion(SHAPE, intrinsics=INTRINSICS, materials=table, context=context)
    ids = (np.arange(SHAPE[0] * SHAPE[1]).reshape(SHAPE) % 4).astype(np.uint8)
    given = MOTIONS[1]
    found = moving.compute(
        clspeckle.MotionInput(
            depth=np.ones(SHAPE, np.float32), material=ids, previous_from_current=pose(*given), frame_time_s=1 / 30
        ),
        ("path", "correlation", "mask"),
    )
    now = motion.points(np.ones(SHAPE), INTRINSICS)
    transform = pose(*given)
    lateral, axial = motion.displacement(now, now @ transform[:, :3].T + transform[:, 3])
    lateral_length = np.array([0.5e-3, np.inf, 0.5e-3, 1e-4])[ids]
    axial_length = np.array([3e-3, 1e-3, 3e-3, 3e-3])[ids]
    rotation_length = np.array([np.deg2rad(0.25), np.deg2rad(0.25), np.inf, 0.1])[ids]
    path = motion.path(lateral, axial, given[1], (lateral_length, axial_length, rotation_length))
    error = np.abs(found["path"] / path - 1).max()
    measured("relative error of the path", error)
    assert error < 2e-6
    correlation = np.array([1.0, np.exp(-1 / 3), 0.0, np.exp(-1 / 90)])[ids]
    assert np.abs(found["correlation"] - correlation).max() < 2e-7
    assert np.array_equal(found["mask"] != 0, (path > 0.01) | (1 - correlation > 0.01))


def test_nothing_moves_and_the_path_is_exactly_zero(context):
    """By each way, also between pixels whose depth is rounded."""
    depth = relief()
    now = motion.points(depth, INTRINSICS).astype(np.float32)
    normal = np.random.default_rng(2).normal(size=now.shape).astype(np.float32)
    moving = clspeckle.Motion(SHAPE, intrinsics=INTRINSICS, context=context)
    for given in (
        clspeckle.MotionInput(position=now, previous_position=now, normal=normal, previous_normal=normal),
        clspeckle.MotionInput(depth=depth, previous_from_current=np.eye(4), previous_depth=depth),
        clspeckle.MotionInput(
            depth=depth, motion=np.zeros((*SHAPE, 2)), previous_depth=depth, normal=normal, previous_normal=normal
        ),
        clspeckle.MotionInput(position=now, motion=np.zeros((*SHAPE, 2)), previous_position=now, roll_from_motion=True),
    ):
        found = moving.compute(given, ("path", "shift", "mask", "correlation"))
        assert not found["path"].any() and not found["shift"].any() and not found["mask"].any()
        assert (found["correlation"] == 1).all()
    moving.check()


def test_behind_the_camera_and_wrong_numbers(context):
    depth = np.ones((2, 3), np.float32)
    moving = clspeckle.Motion((2, 3), intrinsics=(10, 10, 1, 0.5), context=context)
    backwards = np.eye(4)
    backwards[2, 3] = -2
    found = moving.compute(clspeckle.MotionInput(depth=depth, previous_from_current=backwards), ("path", "shift"))
    assert np.isinf(found["path"]).all() and not found["shift"].any()
    moving.check()
    vectors = np.zeros((2, 3, 2), np.float32)
    vectors[0, 1, 1], vectors[1, 2, 0] = np.nan, np.inf
    found = moving.compute(clspeckle.MotionInput(depth=depth, motion=vectors, previous_depth=depth))
    assert np.array_equal(np.isinf(found["path"]), [[False, True, False], [False, False, True]])
    with pytest.raises(clspeckle.errors.InvalidDataError, match=r"2 surface pixels.* x = 1, y = 0"):
        moving.check()
    normal = np.ones((2, 3, 3), np.float32)
    wrong = normal.copy()
    wrong[1, 0] = 0
    given = clspeckle.MotionInput(
        depth=depth, motion=np.zeros((2, 3, 2)), previous_depth=depth, normal=normal, previous_normal=wrong
    )
    assert np.array_equal(np.isinf(moving.compute(given)["path"]), [[False] * 3, [True, False, False]])
    with pytest.raises(clspeckle.errors.InvalidDataError, match=r"1 surface pixels.* x = 0, y = 1"):
        moving.check()
