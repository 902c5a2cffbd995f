"""A lens that distorts, and a surface that moves: path, correlation, shift and masks are taken where the lens shows
them.

A pipeline's phase is compared with a second one of the same seed, which is advanced by hand: with what a motion stage
says about the ideal image (tests/core/stages/motion checks that), warped by the float64 reference of the lens. The two
are equal bit for bit, but for pixels whose source lies within 0.001 px of the border between two ideal pixels, where
single and double precision may take different ones.
"""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest

from reference import lens as reference

SHAPE = HEIGHT, WIDTH = 60, 96
FOCAL, DEPTH = 200.0, 0.5
INTRINSICS = (FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
LENS = reference.Distortion(WIDTH, HEIGHT, k1=0.12, k2=0.03, p1=0.01, p2=-0.015)
SOURCES = LENS.sources()
# Pixels whose nearest source is the same in single and in double precision.
CLEAR = (np.abs(SOURCES - np.floor(SOURCES) - 0.5) > 1e-3).all(-1)
FLAT = np.ones(SHAPE, np.float32)
Y, X = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
STILL = dict.fromkeys(
    ("lateral_correlation_length_m", "axial_correlation_length_m", "rotation_correlation_angle_rad"), np.inf
)


def distorted(image):
    return reference.warp(image, SOURCES, "nearest")


class Twins:
    """A pipeline with a lens, and a phase of the same seed that no pipeline touches; both drawn in frame 0."""

    def __init__(self, context, materials=(), **motion):
        options = {"seed": 3, "context": context}
        if motion.get("rule") != "replace":
            options["dynamics"] = "continuous"
        options["translate"] = motion.get("translate", False)
        self.phase, self.alone = (clspeckle.Phase(SHAPE, **options) for _ in range(2))
        table = clspeckle.MaterialTable(materials, context=context) if materials else None
        self.motion = clspeckle.Motion(SHAPE, intrinsics=INTRINSICS, materials=table, context=context, **motion)
        self.pipeline = clspeckle.Pipeline(
            phase=self.phase,
            aperture=clspeckle.Aperture(SHAPE, f_number=8.0, context=context),
            motion=self.motion,
            lens=clspeckle.Lens(SHAPE, k1=LENS.k1, k2=LENS.k2, p1=LENS.p1, p2=LENS.p2, context=context),
        )
        self.pipeline.render(FLAT, refresh="all", frame_index=0)
        self.alone.refresh(0)
        assert np.array_equal(self.phase.field(), self.alone.field())

    def check(self):
        """The same field at all clear pixels."""
        same = self.phase.field() == self.alone.field()
        assert CLEAR.mean() > 0.99
        assert same[CLEAR].all(), f"{np.count_nonzero(~same & CLEAR)} of {CLEAR.sum()} samples differ"


def differ_much(given):
    """Whether an image tells distorted from ideal: it differs at a tenth of the pixels or more."""
    return np.mean(distorted(given) != given) > 0.1


def test_the_lens_bends_what_these_tests_look_at():
    corner = np.abs(SOURCES[-1, -1] - (WIDTH - 1, HEIGHT - 1)).max()
    assert corner > 3
    assert np.linalg.norm(LENS.slope(SOURCES[-1, -1]) - np.eye(2), 2) > 0.2


def test_path(context):
    twins = Twins(context)
    now = np.stack(
        [(X - INTRINSICS[2]) * DEPTH / FOCAL, (Y - INTRINSICS[3]) * DEPTH / FOCAL, np.full(SHAPE, DEPTH)], -1
    )
    before = now.copy()
    before[..., 0] += np.random.default_rng(1).uniform(0, 1e-3, SHAPE)  # other paths at neighbours, up to 2 lengths
    given = clspeckle.MotionInput(position=now.astype(np.float32), previous_position=before.astype(np.float32))
    path = twins.motion.compute(given, ["path"])["path"]
    assert differ_much(path)
    assert path.max() > 1
    twins.pipeline.render(FLAT, motion=given, frame_index=1)
    twins.alone.advance(1, path=distorted(path))
    twins.check()


def test_correlation(context):
    materials = [clspeckle.Material(**STILL), clspeckle.Material(**STILL, correlation_time_s=0.05)]
    twins = Twins(context, materials)
    ids = np.random.default_rng(2).integers(0, 2, SHAPE).astype(np.uint8)
    given = clspeckle.MotionInput(
        depth=np.full(SHAPE, DEPTH, np.float32), material=ids, previous_from_current=np.eye(3, 4), frame_time_s=1 / 30
    )
    correlation = twins.motion.compute(given, ["correlation"])["correlation"]
    assert differ_much(correlation)
    twins.pipeline.render(FLAT, motion=given, frame_index=1)
    # Sources outside of the image: no surface, so nothing of the old field is left.
    twins.alone.advance(1, path=0.0, correlation=distorted(correlation))
    twins.check()


def test_motion_mask(context):
    twins = Twins(context, rule="replace")
    now = np.stack(
        [(X - INTRINSICS[2]) * DEPTH / FOCAL, (Y - INTRINSICS[3]) * DEPTH / FOCAL, np.full(SHAPE, DEPTH)], -1
    )
    before = now.copy()
    before[..., 0] += 1e-3 * np.random.default_rng(3).integers(0, 2, SHAPE)
    given = clspeckle.MotionInput(position=now.astype(np.float32), previous_position=before.astype(np.float32))
    mask = twins.motion.compute(given, ["mask"])["mask"]
    assert differ_much(mask)
    twins.pipeline.render(FLAT, motion=given, frame_index=1)
    twins.alone.advance(1, mask=distorted(mask))
    twins.check()


@pytest.mark.parametrize("with_motion", [False, True])
def test_refresh_mask(context, with_motion):
    """The frame's own mask, alone and along with a motion that keeps everything."""
    twins = Twins(context)
    mask = np.random.default_rng(4).integers(0, 2, SHAPE).astype(np.uint8)
    assert differ_much(mask)
    given = None
    if with_motion:
        given = clspeckle.MotionInput(depth=np.full(SHAPE, DEPTH, np.float32), previous_from_current=np.eye(3, 4))
    twins.pipeline.render(FLAT, refresh=mask, motion=given, frame_index=1)
    if with_motion:
        twins.alone.advance(1, path=0.0, mask=distorted(mask))
    else:
        twins.alone.refresh(1, distorted(mask))
    twins.check()


def whole(shift):
    return np.rint(shift).astype(int)


@pytest.mark.parametrize("uniform", [(7.0, -4.0), (-6.0, 5.0), (0.0, 9.0)])
def test_shift_is_stretched_and_turned(context, measured, uniform):
    """Vectors of up to 9 px under a slope of up to 1.5: samples of the field come from where the reference's slope
    says.

    A sample is compared where the shift is clear of a half by 0.02 px (central differences of the lens's map have an
    error of 1e-3 at the border, times 9 px) and where no sample that is not could have claimed the same place.
    """
    twins = Twins(context, [clspeckle.Material(**STILL)], translate=True)
    vectors = np.empty((*SHAPE, 2), np.float32)
    vectors[...] = uniform
    given = clspeckle.MotionInput(
        depth=np.full(SHAPE, DEPTH, np.float32), motion=vectors, previous_depth=np.full(SHAPE, DEPTH, np.float32)
    )
    ideal = twins.motion.compute(given, ["path", "shift"])
    shift = LENS.distort_shift(ideal["shift"])
    twins.pipeline.render(FLAT, motion=given, frame_index=1)
    twins.alone.advance(1, path=distorted(ideal["path"]), shift=shift.astype(np.float32))

    clear = CLEAR & (np.abs(shift - np.floor(shift) - 0.5) > 0.02).all(-1)
    claimed = np.zeros(SHAPE, bool)  # places that an unclear sample may come from
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            columns, rows = (X + whole(shift[..., 0]) + dx)[~clear], (Y + whole(shift[..., 1]) + dy)[~clear]
            inside = (columns >= 0) & (columns < WIDTH) & (rows >= 0) & (rows < HEIGHT)
            claimed[rows[inside].astype(int), columns[inside].astype(int)] = True
    columns = (X + whole(shift[..., 0])).astype(int).clip(0, WIDTH - 1)
    rows = (Y + whole(shift[..., 1])).astype(int).clip(0, HEIGHT - 1)
    compared = clear & ~claimed[rows, columns]
    same = twins.phase.field() == twins.alone.field()
    measured("compared", compared.mean())
    measured("differ", np.mean(~same[compared]))
    assert compared.mean() > 0.5
    assert same[compared].all()
    # What is compared would tell a shift that is not stretched: it comes from elsewhere at a fifth of these samples.
    plain = whole(distorted(ideal["shift"]))
    assert np.mean((plain != whole(shift)).any(-1)[compared]) > 0.2
