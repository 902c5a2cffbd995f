"""Whole frames against the float64 reference, and what persists from frame to frame."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest

from reference import aperture, pattern, phase, pipeline, sensor

SHAPE = (48, 64)
BIG_FRAME = (5 << 32) + 6

SENSOR = {
    "bits": 10,
    "exposure_gain_dn": 400.0,
    "black_level_dn": 60.0,
    "read_noise_dn": 5.0,
    "saturation_dn": 900.0,
    "hot_pixel_fraction": 0.01,
    "hot_pixel_mean_dn": 100.0,
    "cold_pixel_fraction": 0.01,
}

# oversampling, guard_px, D, p, field, normalization
CAMERAS = [
    (1, 0, 0.5, 1.0, "circular_gaussian", "transmission"),
    (1, 0, 1.0, 0.0, "circular_gaussian", "unit_mean"),
    (1, 0, 0.5, 0.5, "unit_phasor", "unit_mean"),
    (2, 8, 1.2, 0.5, "circular_gaussian", "transmission"),
    (1, 5, 0.4, 0.0, "unit_phasor", "transmission"),
]


def ideal_image(shape=SHAPE):
    y, x = np.mgrid[: shape[0], : shape[1]]
    dots = 6 * np.exp(-(((x + 0.2 * y) % 12 - 6) ** 2 + (y % 12 - 6) ** 2) / (2 * 1.8**2))
    return (dots + 0.3 * x / shape[1] + 0.05).astype(np.float32)


def random_mask(seed, shape=SHAPE, share=0.3):
    return (np.random.default_rng(seed).random(shape) < share).astype(np.uint8)


def make(context, case=CAMERAS[0], shape=SHAPE, sensor_options=SENSOR, laser=None, seed=91):
    """A pipeline and its reference."""
    oversampling, guard_px, diameter, p, field, normalization = case
    grid = phase.FieldGrid(shape[1], shape[0], oversampling, guard_px)
    common = {"oversampling": oversampling, "guard_px": guard_px, "context": context}
    options = None
    if sensor_options is not None:
        dark = np.random.default_rng(92).random(shape).astype(np.float32) * 8
        gains = np.random.default_rng(93).normal(1, 0.02, shape).astype(np.float32)
        options = {**sensor_options, "seed": seed + 1, "dark_frame_dn": dark, "gain_map": gains}
    camera = clspeckle.Pipeline(
        phase=clspeckle.Phase(shape, field=field, seed=seed, **common),
        aperture=clspeckle.Aperture(
            shape, relative_diameter=diameter, degree_of_polarization=p, normalization=normalization, **common
        ),
        sensor=None if options is None else clspeckle.Sensor(shape, context=context, **options),
        pattern=laser,
    )
    pupil = aperture.circle_pupil(grid, diameter)
    expected = pipeline.Pipeline(
        phase.PhaseState(grid, field, 2, seed),
        aperture.unit_mean(pupil) if normalization == "unit_mean" else pupil,
        p,
        None if options is None else sensor.Sensor(shape[1], shape[0], **options),
    )
    return camera, expected


def refresh_of(step):
    """How the steps of a sequence refresh the phases: library's and reference's arguments."""
    if step == "none":
        return None, {}
    if step == "all":
        return "all", {"refresh_all": True}
    mask = random_mask(step)
    return mask, {"refresh_mask": mask}


def check_frame(codes, expected, ideal, frame_index, refresh, measured):
    """Within one code, and that only where single precision may round to the other side: the intensity is good to
    1e-6 of the brightest pixel, the sum to half a unit in its last place."""
    intensity = expected.intensity(ideal, frame_index, **refresh)
    value = expected.sensor.value_dn(intensity, frame_index)
    margin = np.full(value.shape, 1e-3 + 1e-6 * expected.sensor.exposure_gain_dn * intensity.max())
    expected_codes = expected.sensor.codes_of(value)
    measured("share of codes one off", np.mean(codes != expected_codes))
    assert np.unique(expected_codes).size > 100  # there is something to see
    assert not sensor.disagreement(codes, value, expected_codes, margin)


@pytest.mark.parametrize("case", CAMERAS, ids=[f"s{c[0]} guard{c[1]} D{c[2]} p{c[3]} {c[4]} {c[5]}" for c in CAMERAS])
def test_frames(context, measured, case):
    """A sequence with every kind of refresh, frame indices that jump and one beyond 32 bits: codes within one code."""
    camera, expected = make(context, case)
    ideal = ideal_image()
    for frame_index, step in (
        (3, 1),
        (4, "none"),
        (5, 2),
        (BIG_FRAME, 3),
        (BIG_FRAME + 1, "none"),
        (7, "all"),
        (2**48 - 1, 4),
    ):
        refresh, expected_refresh = refresh_of(step)
        codes = camera.render(ideal, frame_index=frame_index, refresh=refresh)
        assert codes.dtype == np.uint16
        check_frame(codes, expected, ideal, frame_index, expected_refresh, measured)


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_bit_depths(context, bits):
    scale = 2.0 ** (bits - 10)
    options = SENSOR | {name: value * scale for name, value in SENSOR.items() if name.endswith("_dn")} | {"bits": bits}
    camera, expected = make(context, sensor_options=options)
    codes = camera.render(ideal_image(), frame_index=1)
    intensity = expected.intensity(ideal_image(), 1)
    value = expected.sensor.value_dn(intensity, 1)
    margin = np.full(value.shape, 1e-3 + (1e-6 * intensity.max() * 400 + 2**-21 * 1024) * scale)
    assert not sensor.disagreement(codes, value, expected.sensor.codes_of(value), margin)


def test_intensity_output(context, measured):
    """Without a sensor a frame is the intensity: relative L2 error below 2e-6."""
    camera, expected = make(context, CAMERAS[3], sensor_options=None)
    for frame_index, step in ((0, "none"), (1, 5)):
        refresh, expected_refresh = refresh_of(step)
        got = camera.render(ideal_image(), frame_index=frame_index, refresh=refresh)
        reference = expected.intensity(ideal_image(), frame_index, **expected_refresh)
        error = np.linalg.norm(got - reference) / np.linalg.norm(reference)
        measured("relative L2 error", error)
        assert got.dtype == np.float32
        assert error < 2e-6


def test_frame_of_a_pattern_on_geometry(context, measured):
    """The whole line: pattern, phases, aperture, sensor, on a tilted plane seen by a camera beside the laser."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    intrinsics = (70.0, 70.0, 31.5, 23.5)
    depth = (1.2 + 0.004 * x - 0.003 * y).astype(np.float32)
    depth[5:9, 7:11] = 0  # no surface
    normal = np.broadcast_to(np.array([0.28, -0.21, -0.9367], np.float32), (*SHAPE, 3))
    normal = np.ascontiguousarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))
    albedo = np.random.default_rng(93).random(SHAPE).astype(np.float32)
    texels = ideal_image((96, 128))
    pose = np.eye(3, 4)
    pose[0, 3] = 0.05
    options = {"laser_from_geometry": pose, "half_extent_x": 0.6, "half_extent_y": 0.5, "power_scale": 8.0}
    camera, expected = make(context, CAMERAS[1], laser=clspeckle.Pattern(texels, context=context, **options))
    geometry = clspeckle.Geometry(depth=depth, intrinsics=intrinsics, normal=normal, albedo=albedo)
    position = pattern.positions_from_depth(depth, *intrinsics)
    ideal = pattern.lookup(texels, position, normal=normal, albedo=albedo, **options)
    assert ideal.max() > 1
    for frame_index in (0, 1):
        intensity = expected.intensity(ideal, frame_index)
        value = expected.sensor.value_dn(intensity, frame_index)
        # The lookup is good to 2e-5 of the brightest light.
        margin = np.full(value.shape, 1e-3 + 2e-5 * expected.sensor.exposure_gain_dn * intensity.max())
        codes = camera.render(geometry, frame_index=frame_index)
        measured("share of codes one off", np.mean(codes != expected.sensor.codes_of(value)))
        assert not sensor.disagreement(codes, value, expected.sensor.codes_of(value), margin)


def test_pipeline_is_its_stages_in_a_row(context):
    """Bit for bit what the stages give when called one by one."""
    camera, _ = make(context, CAMERAS[3])
    codes = [camera.render(ideal_image(), frame_index=i, refresh=random_mask(i)) for i in range(3)]
    alone, _ = make(context, CAMERAS[3])
    for frame_index in range(3):
        alone.phase.refresh(frame_index, random_mask(frame_index))
        intensity = alone.aperture.intensity(alone.phase, ideal_image())
        assert np.array_equal(alone.sensor.expose(intensity, frame_index=frame_index), codes[frame_index])


def test_static_scene_has_the_same_speckle_and_new_noise(context):
    """Without a refresh the intensity keeps its bits and the phases theirs; codes differ by the read noise alone.

    64 frames of 48 x 64 pixels: differences of frames have the variance 2 (sigma^2 + 1/12) of noise and rounding
    (within 1.2 %, 3.3 standard errors, for 63 differences of 3072 pixels), and frames are uncorrelated to the same
    precision.
    """
    camera, _ = make(context, CAMERAS[0], sensor_options=None)
    first = camera.render(ideal_image(), frame_index=0)
    field = camera.phase.field(0)
    for frame_index in (1, 2, BIG_FRAME):
        assert np.array_equal(camera.render(ideal_image(), frame_index=frame_index), first)
    assert np.array_equal(camera.phase.field(0), field)

    options = SENSOR | {"bits": 16, "black_level_dn": 1000.0, "saturation_dn": float("inf")}
    camera, _ = make(context, CAMERAS[0], sensor_options=options)
    codes = np.array([camera.render(ideal_image(), frame_index=i) for i in range(64)], np.int64)
    assert all(not np.array_equal(codes[0], frame) for frame in codes[1:])
    steps = np.diff(codes, axis=0)
    n = steps.size
    variance = 2 * (5.0**2 + 1 / 12)
    # Successive differences share a frame: the variance of the mean square is 3/2 that of independent ones.
    assert abs(np.mean(steps**2.0) / variance - 1) < 3.3 * np.sqrt(2 * 1.5 / n)
    assert abs(np.mean(steps)) < 3.3 * np.sqrt(variance / n)
    noise = codes - codes.mean(axis=0)
    assert abs(np.mean(noise[1:] * noise[:-1]) / np.mean(noise**2) + 1 / 63) < 3.3 / np.sqrt(n)
    assert np.array_equal(camera.render(ideal_image(), frame_index=17), codes[17])


@pytest.mark.parametrize("case", [CAMERAS[0], CAMERAS[3], CAMERAS[4]], ids=["plain", "oversampled", "guard"])
def test_masked_pixels_alone_get_new_phases(context, case):
    """The field changes at samples of masked pixels (and padding nearest to them), nowhere else, in both
    polarizations; the image changes within the aperture's blur around them most."""
    camera, expected = make(context, case, sensor_options=None)
    before_image = camera.render(ideal_image(), frame_index=0)
    before = [camera.phase.field(k) for k in (0, 1)]
    mask = np.zeros(SHAPE, np.uint8)
    mask[20:28, 30:40] = 1
    after_image = camera.render(ideal_image(), frame_index=1, refresh=mask)
    drawn = expected.phase.grid.expand(mask) != 0
    fresh = [phase.draw(expected.phase.grid, case[4], 91, 1, k) for k in (0, 1)]
    for k in (0, 1):
        after = camera.phase.field(k)
        assert np.array_equal(after != before[k], drawn)
        assert np.abs(after - fresh[k])[drawn].max() < 1e-6
    change = np.abs(after_image - before_image) / before_image.mean()
    assert change[20:28, 30:40].mean() > 10 * change[:, :20].mean()


def test_first_frame_draws_everything(context):
    """Whatever its refresh says, the first frame's phases are those of its index."""
    images = []
    for refresh in (None, "all", np.zeros(SHAPE, np.uint8), random_mask(6)):
        camera, _ = make(context, sensor_options=None)
        images.append(camera.render(ideal_image(), frame_index=9, refresh=refresh))
    for image in images[1:]:
        assert np.array_equal(image, images[0])


def test_refresh_all_makes_frames_independent(context):
    camera, expected = make(context, sensor_options=None)
    camera.render(ideal_image(), frame_index=0)
    again = camera.render(ideal_image(), frame_index=8, refresh="all")
    fresh, _ = make(context, sensor_options=None)
    assert np.array_equal(again, fresh.render(ideal_image(), frame_index=8))
    assert expected.phase.grid.shape == camera.phase.grid_shape


def test_frame_index_counts_beyond_32_bits(context, measured):
    """Noise and phases of frames 2^32 apart differ, and are the reference's up to 2^48 - 1; more is refused."""
    camera, expected = make(context)
    ideal = ideal_image()
    images = {}
    for frame_index in (5, 2**32 + 5, 2**33 + 5, 2**47 + 5, 2**48 - 1):
        images[frame_index] = camera.render(ideal, frame_index=frame_index, refresh="all")
        check_frame(images[frame_index], expected, ideal, frame_index, {"refresh_all": True}, measured)
    values = list(images.values())
    for i, first in enumerate(values):
        for second in values[i + 1 :]:
            assert np.mean(first != second) > 0.9
    with pytest.raises(clspeckle.errors.InvalidArgumentError):
        camera.render(ideal, frame_index=2**48)


def sequence(camera, context, queue, count=6):
    """Frames enqueued without a wait between them, chained by events; read at the end."""
    ideal = clspeckle.DeviceImage.from_array(ideal_image(), context=context)
    masks = [clspeckle.DeviceImage.from_array(random_mask(i), context=context) for i in range(count)]
    outputs = [clspeckle.DeviceImage(SHAPE, np.uint16, context=context) for _ in range(count)]
    event = None
    for i in range(count):
        event = camera.enqueue_frame(
            ideal,
            outputs[i],
            frame_index=i,
            refresh=masks[i] if i % 2 else None,
            queue=queue,
            wait_for=[] if event is None else [event],
        )
    event.wait()
    return [output.read() for output in outputs]


@pytest.mark.parametrize("case", [CAMERAS[0], CAMERAS[3]], ids=["polarized", "two polarizations"])
def test_same_frames_on_in_order_and_out_of_order_queues(context, case):
    results = []
    for out_of_order in (False, True):
        for profiling in (False, True):
            camera, _ = make(context, case)
            with clspeckle.Queue(context, out_of_order=out_of_order, profiling=profiling) as queue:
                results.append(sequence(camera, context, queue))
    blocking, _ = make(context, case)
    one_by_one = [
        blocking.render(ideal_image(), frame_index=i, refresh=random_mask(i) if i % 2 else None) for i in range(6)
    ]
    for frames in results:
        for got, expected in zip(frames, one_by_one, strict=True):
            assert np.array_equal(got, expected)


def test_frames_of_two_pipelines_on_one_out_of_order_queue(context):
    """Two cameras enqueue in turns: neither disturbs the other."""
    alone = [sequence(make(context, case)[0], context, context.queue) for case in (CAMERAS[0], CAMERAS[3])]
    cameras = [make(context, case)[0] for case in (CAMERAS[0], CAMERAS[3])]
    ideal = clspeckle.DeviceImage.from_array(ideal_image(), context=context)
    masks = [clspeckle.DeviceImage.from_array(random_mask(i), context=context) for i in range(6)]
    outputs = [[clspeckle.DeviceImage(SHAPE, np.uint16, context=context) for _ in range(6)] for _ in cameras]
    with clspeckle.Queue(context, out_of_order=True) as queue:
        events = [None, None]
        for i in range(6):
            for k, camera in enumerate(cameras):
                events[k] = camera.enqueue_frame(
                    ideal,
                    outputs[k][i],
                    frame_index=i,
                    refresh=masks[i] if i % 2 else None,
                    queue=queue,
                    wait_for=[] if events[k] is None else [events[k]],
                )
        clspeckle.wait(events)
        for k in (0, 1):
            for i in range(6):
                assert np.array_equal(outputs[k][i].read(), alone[k][i])


@pytest.mark.parametrize("drawn", [False, True])
def test_warm_up_leaves_the_phases(context, drawn):
    camera, _ = make(context)
    plain, _ = make(context)
    if drawn:
        assert np.array_equal(camera.render(ideal_image(), frame_index=1), plain.render(ideal_image(), frame_index=1))
    camera.warm_up()
    # The frame below is still the first one of a camera that has drawn nothing.
    zeros = np.zeros(SHAPE, np.uint8)
    assert np.array_equal(
        camera.render(ideal_image(), frame_index=2, refresh=zeros),
        plain.render(ideal_image(), frame_index=2, refresh=zeros),
    )


def test_camera_size_frame(context, measured):
    """One frame of 480 x 848 (padded to 858), unpolarized, 10 bits."""
    shape = (480, 848)
    camera, expected = make(context, (1, 0, 0.5, 0.0, "circular_gaussian", "unit_mean"), shape=shape)
    ideal = ideal_image(shape)
    check_frame(camera.render(ideal, frame_index=0), expected, ideal, 0, {}, measured)


def test_views_with_offset_and_pitch(context):
    """Image, mask and codes as parts of larger buffers: the same bytes as tightly packed, and nothing written around
    them."""
    camera, _ = make(context)
    plain, _ = make(context)
    height, width = SHAPE
    mask = random_mask(7)

    def view(array, offset, pitch):
        memory = clspeckle.Buffer(offset + pitch * height + 64, context=context)
        memory.write(np.full(memory.size_bytes, 0xA5, np.uint8))
        image = clspeckle.DeviceImage.wrap(
            memory, SHAPE, array.dtype, offset_bytes=offset, pitch_bytes=pitch, context=context
        )
        image.write(array)
        return image, memory

    ideal, ideal_memory = view(ideal_image(), 36, 4 * (width + 5))
    refresh, _ = view(mask, 13, width + 7)
    output, memory = view(np.zeros(SHAPE, np.uint16), 18, 2 * (width + 3))
    before = ideal_memory.read()
    for frame_index in (0, 1):
        camera.enqueue_frame(ideal, output, frame_index=frame_index, refresh=refresh).wait()
        expected = plain.render(ideal_image(), frame_index=frame_index, refresh=mask)
        assert np.array_equal(output.read(), expected)
    written = memory.read()
    inside = np.zeros(written.size, bool)
    for y in range(height):
        start = 18 + y * 2 * (width + 3)
        inside[start : start + 2 * width] = True
    assert np.all(written[~inside] == 0xA5)
    assert np.array_equal(ideal_memory.read(), before)
