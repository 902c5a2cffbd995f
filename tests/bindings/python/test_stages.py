"""Each stage through the binding: shapes, dtypes, defaults; results are those of the equations and of each other."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import clspeckle
from binding_common import SHAPE
from clspeckle import errors

Image = npt.NDArray[np.float32]


def relative_error(value: Any, reference: Any) -> float:
    return float(np.linalg.norm(np.asarray(value) - reference) / np.linalg.norm(reference))


# --- Philox ---


def test_philox_known_answers(context: clspeckle.Context) -> None:
    # kat_vectors of the Random123 library, philox4x32 with 10 rounds.
    ones = 0xFFFFFFFF
    counters = [(0, 0, 0, 0), (ones, ones, ones, ones), (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344)]
    keys = [(0, 0), (ones, ones), (0xA4093822, 0x299F31D0)]
    expected = [
        (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8),
        (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ]
    for counter, key, answer in zip(counters, keys, expected):
        result = clspeckle.philox.blocks([counter], key, context=context)
        assert result.dtype == np.uint32
        assert tuple(result[0]) == answer


def test_philox_images_follow_the_documented_mapping(context: clspeckle.Context) -> None:
    shape, seed, frame, stream = (9, 5), 0x123456789ABCDEF, 7 + (3 << 32), 0x9001
    quarter = -(-shape[0] // 4)
    counters = np.array(
        [(x, y % quarter, frame & 0xFFFFFFFF, stream | (frame >> 32) << 16) for y in range(9) for x in range(5)]
    )
    blocks = clspeckle.philox.blocks(counters, (seed & 0xFFFFFFFF, seed >> 32), context=context).reshape(9, 5, 4)
    expected = np.array([[blocks[y, x, y // quarter] for x in range(5)] for y in range(9)])
    options: dict[str, Any] = {"seed": seed, "frame_index": frame, "stream": stream, "context": context}
    bits = clspeckle.philox.bits(shape, **options)
    np.testing.assert_array_equal(bits, expected)
    np.testing.assert_array_equal(clspeckle.philox.bits(shape, local_size=3, **options), expected)
    uniform = clspeckle.philox.uniform(shape, **options)
    np.testing.assert_allclose(uniform, (expected + 0.5) / 2.0**32, rtol=1e-7)
    assert uniform.dtype == np.float32


def test_philox_normals_are_box_mullers(context: clspeckle.Context) -> None:
    shape = (64, 16)
    words = clspeckle.philox.bits(shape, seed=5, context=context).astype(np.float64).reshape(4, 16, 16)
    radius = [np.sqrt(-2 * np.log((words[j] + 0.5) / 2**32)) for j in (0, 2)]
    angle = [2 * np.pi * words[j] / 2**32 for j in (1, 3)]
    expected = np.concatenate([radius[i] * part(angle[i]) for i in range(2) for part in (np.cos, np.sin)])
    out = np.empty(shape, np.float32)
    assert clspeckle.philox.normal(shape, seed=5, out=out, context=context) is out
    np.testing.assert_allclose(out, expected, atol=2e-6)


# --- Phase ---


@pytest.mark.parametrize("field", ["circular_gaussian", "unit_phasor"])
def test_phase_refresh_field_save_restore(field: str, context: clspeckle.Context) -> None:
    phase = clspeckle.Phase(SHAPE, field=field, seed=9, context=context)
    assert phase.grid_shape == SHAPE
    phase.refresh(4)
    before = [phase.field(polarization) for polarization in (0, 1)]
    assert all(z.dtype == np.complex64 and z.shape == SHAPE for z in before)
    assert not np.array_equal(before[0], before[1])
    if field == "unit_phasor":
        np.testing.assert_allclose(np.abs(before[0]), 1, atol=1e-6)
    state = phase.save()
    assert state.dtype == np.uint8
    assert state.nbytes == phase.state_size

    mask = np.zeros(SHAPE, bool)
    mask[3:9, 5:20] = True
    phase.refresh(5, mask)
    after = phase.field(0)
    np.testing.assert_array_equal(after[~mask], before[0][~mask])
    assert (after[mask] != before[0][mask]).all()

    for form in (state, state.tobytes(), bytearray(state.tobytes()), memoryview(state.tobytes())):
        phase.refresh(6)
        phase.restore(form)
        np.testing.assert_array_equal(phase.field(0), before[0])
        np.testing.assert_array_equal(phase.field(1), before[1])

    other = clspeckle.Phase(SHAPE, field=field, seed=10, context=context)
    other.restore(state)
    np.testing.assert_array_equal(other.field(1), before[1])


@pytest.mark.parametrize("dtype", [np.bool_, np.uint8, np.int64])
def test_masks_of_any_integer_mean_not_zero(dtype: Any, context: clspeckle.Context) -> None:
    mask = np.zeros(SHAPE, dtype)
    mask[2, 3] = 1 if dtype is np.bool_ else -1 if dtype is np.int64 else 200
    phase = clspeckle.Phase(SHAPE, context=context)
    phase.refresh(0)
    before = phase.field()
    phase.refresh(1, mask)
    assert np.argwhere(phase.field() != before).tolist() == [[2, 3]]
    phase.refresh(2, clspeckle.DeviceImage.from_array(mask.astype(np.uint8), context=context))
    assert np.argwhere(phase.field() != before).tolist() == [[2, 3]]


def test_field_grid_is_padded(context: clspeckle.Context) -> None:
    grid = clspeckle.field_grid((31, 47), oversampling=2, guard_px=3)
    assert grid.shape == (70, 100)  # 68 = 4 * 17 and 17 > 13: the next is 70; 100 = 2 * (47 + 3)
    phase = clspeckle.Phase((31, 47), oversampling=2, guard_px=3, context=context)
    assert phase.grid == grid
    phase.refresh(0)
    assert phase.field().shape == (70, 100)


# --- Aperture ---


def test_intensity_is_that_of_the_equations(context: clspeckle.Context, ideal: Image) -> None:
    p = 0.25
    phase = clspeckle.Phase(SHAPE, seed=2, context=context)
    aperture = clspeckle.Aperture(SHAPE, relative_diameter=0.4, degree_of_polarization=p, context=context)
    with pytest.raises(errors.InvalidStateError):
        aperture.intensity(phase, ideal)
    phase.refresh(0)
    pupil = aperture.pupil()
    assert pupil.dtype == np.float32
    assert np.count_nonzero(pupil) == aperture.info().pupil_samples
    fields = [np.fft.ifft2(np.fft.fft2(np.sqrt(ideal.astype(float)) * phase.field(k)) * pupil) for k in (0, 1)]
    expected = (1 + p) / 2 * np.abs(fields[0]) ** 2 + (1 - p) / 2 * np.abs(fields[1]) ** 2
    result = aperture.intensity(phase, ideal)
    assert result.dtype == np.float32
    assert relative_error(result, expected) < 2e-6
    # Lists, doubles and integers without a top code say the same as float32.
    np.testing.assert_array_equal(aperture.intensity(phase, ideal.astype(np.float64)), result)
    np.testing.assert_array_equal(aperture.intensity(phase, ideal.tolist()), result)
    ones = aperture.intensity(phase, np.ones(SHAPE, np.float32))
    for dtype in (np.uint32, np.int64, np.float16):
        np.testing.assert_array_equal(aperture.intensity(phase, np.ones(SHAPE, dtype)), ones)


def test_aperture_parameters_reach_the_library(context: clspeckle.Context) -> None:
    info = clspeckle.Aperture(
        SHAPE, f_number=8, pixel_pitch_m=3e-6, wavelength_m=850e-9, oversampling=2, guard_px=2, context=context
    ).info()
    assert info.relative_diameter == pytest.approx(3e-6 / (850e-9 * 8), rel=1e-12)
    grid = clspeckle.field_grid(SHAPE, oversampling=2, guard_px=2)
    assert (info.grid_height, info.grid_width) == grid.shape
    assert info.workspace_bytes > 0
    assert info.fft_engine in ("cpu", "gpu", "clfft")
    assert (info.fft_engine == "clfft") == bool(info.fft_reason)
    unit = clspeckle.Aperture(SHAPE, relative_diameter=0.5, normalization="unit_mean", soft_rim=0.3, context=context)
    assert np.mean(unit.pupil().astype(float) ** 2) == pytest.approx(1, rel=1e-5)
    square = clspeckle.Aperture(SHAPE, relative_diameter=0.5, pupil_image=np.ones((8, 8)), context=context)
    circle = clspeckle.Aperture(SHAPE, relative_diameter=0.5, context=context)
    assert square.info().pupil_samples > circle.info().pupil_samples


def test_workspace_from_the_host(context: clspeckle.Context, ideal: Image) -> None:
    phase = clspeckle.Phase(SHAPE, seed=2, context=context)
    phase.refresh(0)
    own = clspeckle.Aperture(SHAPE, context=context)
    guest = clspeckle.Aperture(SHAPE, workspace_from_host=True, context=context)
    with pytest.raises(errors.InvalidStateError):
        guest.intensity(phase, ideal)
    memory = clspeckle.Buffer(guest.info().workspace_bytes + 4096, context=context)
    guest.set_workspace(memory, offset_bytes=4096)
    memory.close()  # the library retains it
    np.testing.assert_array_equal(guest.intensity(phase, ideal), own.intensity(phase, ideal))


# --- Sensor ---


def test_codes_are_those_of_the_equation(context: clspeckle.Context, ideal: Image) -> None:
    dark = np.linspace(0, 5, ideal.size, dtype=np.float32).reshape(SHAPE)
    sensor = clspeckle.Sensor(
        SHAPE,
        bits=12,
        read_noise_dn=0,
        exposure_gain_dn=1000,
        black_level_dn=100,
        saturation_dn=1100,
        dark_frame_dn=dark,
        context=context,
    )
    value = np.minimum(1000 * ideal.astype(float), 1100) + 100 + dark
    expected = np.clip(np.rint(value), 0, 4095)
    codes = sensor.expose(ideal)
    assert codes.dtype == np.uint16
    assert np.abs(codes - expected).max() <= 1  # a tie may round the other way in single precision
    assert np.mean(codes != expected) < 0.01
    normalized = sensor.expose(ideal, dtype=np.float32)
    np.testing.assert_allclose(normalized, codes / 4095, rtol=1e-6)
    sensor.exposure_gain_dn = 0
    assert sensor.exposure_gain_dn == 0
    np.testing.assert_array_equal(sensor.expose(ideal), np.rint(100 + dark))


def test_noise_depends_on_frame_and_seed(context: clspeckle.Context, ideal: Image) -> None:
    a, b = (clspeckle.Sensor(SHAPE, seed=seed, context=context) for seed in (1, 2))
    np.testing.assert_array_equal(a.expose(ideal, frame_index=3), a.expose(ideal, frame_index=3))
    assert not np.array_equal(a.expose(ideal, frame_index=3), a.expose(ideal, frame_index=4))
    assert not np.array_equal(a.expose(ideal, frame_index=3), b.expose(ideal, frame_index=3))


def test_eight_bits_and_unquantized(context: clspeckle.Context, ideal: Image) -> None:
    sensor = clspeckle.Sensor(SHAPE, bits=8, exposure_gain_dn=150, black_level_dn=10, context=context)
    bytes_ = sensor.expose(ideal, dtype=np.uint8)
    assert bytes_.dtype == np.uint8
    np.testing.assert_array_equal(bytes_, sensor.expose(ideal))
    with pytest.raises(errors.ClspeckleError, match="8"):
        clspeckle.Sensor(SHAPE, bits=10, context=context).expose(ideal, dtype=np.uint8)
    smooth = clspeckle.Sensor(
        SHAPE, bits=8, exposure_gain_dn=150, black_level_dn=10, quantize=False, float_full_scale=255, context=context
    )
    difference = smooth.expose(ideal, dtype=np.float32) - bytes_
    assert 0 < np.abs(difference).max() <= 0.5 + 1e-4


# --- Pattern ---


def lookup_reference(depth: npt.NDArray[Any], intrinsics: tuple[float, ...]) -> npt.NDArray[Any]:
    """I0 of a pattern of ones with the laser in the camera, without normals."""
    fx, fy, cx, cy = intrinsics
    y, x = np.mgrid[0 : depth.shape[0], 0 : depth.shape[1]]
    point = np.stack([(x - cx) / fx * depth, (y - cy) / fy * depth, depth])
    result: npt.NDArray[Any] = 1 / np.sum(point**2, axis=0) / np.pi
    return result


def test_pattern_lookup_of_a_plane(context: clspeckle.Context) -> None:
    pattern = clspeckle.Pattern(np.ones((16, 16)), half_extent_x=2, half_extent_y=2, context=context)
    intrinsics = (40.0, 40.0, 23.5, 15.5)
    depth = np.full(SHAPE, 1.5)
    expected = lookup_reference(depth, intrinsics)
    matrix = [[40, 0, 23.5], [0, 40, 15.5], [0, 0, 1]]
    for given in (intrinsics, matrix):
        result = pattern.lookup(clspeckle.Geometry(depth=depth, intrinsics=given))
        assert result.dtype == np.float32
        np.testing.assert_allclose(result, expected, rtol=1e-5)

    y, x = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]]
    position = np.stack([(x - 23.5) / 40 * 1.5, (y - 15.5) / 40 * 1.5, depth], axis=-1)
    np.testing.assert_allclose(pattern.lookup(clspeckle.Geometry(position=position)), expected, rtol=1e-5)

    ray = depth * np.linalg.norm(np.stack([(x - 23.5) / 40, (y - 15.5) / 40, np.ones(SHAPE)]), axis=0)
    along_ray = clspeckle.Geometry(depth=ray, intrinsics=intrinsics, depth_kind="along_ray")
    np.testing.assert_allclose(pattern.lookup(along_ray), expected, rtol=1e-5)

    # Albedo, a normal that faces the camera, three kinds of visibility, and no surface at all.
    cosine = 1.5 / np.linalg.norm(position, axis=-1)
    normal = np.broadcast_to(np.array([0, 0, -1], np.float32), (*SHAPE, 3))
    seen = np.zeros(SHAPE, bool)
    seen[:, 20:] = True
    hole = depth.copy()
    hole[0, 0], hole[1, 1], hole[2, 2] = np.nan, np.inf, 0
    for visibility in (seen, seen * np.uint8(255), seen.astype(np.float32)):
        result = pattern.lookup(
            clspeckle.Geometry(
                depth=depth, intrinsics=intrinsics, normal=normal, albedo=np.full(SHAPE, 0.5), visibility=visibility
            )
        )
        np.testing.assert_allclose(result, expected * cosine * 0.5 * seen, rtol=1e-5)
    result = pattern.lookup(clspeckle.Geometry(depth=hole, intrinsics=intrinsics))
    assert np.argwhere(result == 0).tolist() == [[0, 0], [1, 1], [2, 2]]


def test_pattern_pose(context: clspeckle.Context) -> None:
    shifted: Any = [[1, 0, 0, -0.5], [0, 1, 0, 0], [0, 0, 1, 0]]
    given = clspeckle.Pattern(np.eye(32), laser_from_geometry=shifted, context=context)
    moved = clspeckle.Pattern(np.eye(32), context=context)
    scene = clspeckle.Geometry(depth=np.ones(SHAPE), intrinsics=(60, 60, 20, 16))
    before = moved.lookup(scene)
    moved.set_pose(np.array([*shifted, [0, 0, 0, 1]]))
    np.testing.assert_array_equal(moved.lookup(scene), given.lookup(scene))
    assert not np.array_equal(moved.lookup(scene), before)
    np.testing.assert_array_equal(clspeckle.Pattern.defaults()["laser_from_geometry"], np.eye(4)[:3])


# --- Pipeline ---


def test_a_frame_is_its_stages_one_by_one(camera: clspeckle.Pipeline, ideal: Image) -> None:
    frame = camera.render(ideal, frame_index=6)
    assert frame.dtype == np.uint16
    assert frame.shape == SHAPE
    phase, sensor = camera.phase, camera.sensor
    assert sensor is not None
    intensity = camera.aperture.intensity(phase, ideal)
    np.testing.assert_array_equal(sensor.expose(intensity, frame_index=6), frame)
    fresh = clspeckle.Phase(SHAPE, seed=3, context=phase.context)
    fresh.refresh(6)
    np.testing.assert_array_equal(fresh.field(), phase.field())


def test_refresh_and_frame_index(camera: clspeckle.Pipeline, ideal: Image) -> None:
    assert camera.next_frame_index == 0
    camera.render(ideal)
    first = camera.phase.field()
    camera.render(ideal)
    assert camera.next_frame_index == 2
    np.testing.assert_array_equal(camera.phase.field(), first)
    mask = np.zeros(SHAPE, bool)
    mask[:, :10] = True
    camera.render(ideal, refresh=mask)
    assert ((camera.phase.field() != first) == mask).all()
    camera.render(ideal, refresh="all", frame_index=2**48 - 1)
    assert (camera.phase.field() != first).all()
    camera.next_frame_index = 0
    camera.render(ideal, refresh="all")
    np.testing.assert_array_equal(camera.phase.field(), first)
    assert camera.next_frame_index == 1


def test_output_arrays_and_dtypes(camera: clspeckle.Pipeline, ideal: Image) -> None:
    expected = camera.render(ideal, frame_index=1)
    out = np.zeros(SHAPE, np.uint16)
    assert camera.render(ideal, frame_index=1, out=out) is out
    np.testing.assert_array_equal(out, expected)
    wide = np.zeros((SHAPE[0], 2 * SHAPE[1]), np.uint16)
    camera.render(ideal, frame_index=1, out=wide[:, ::2])
    np.testing.assert_array_equal(wide[:, ::2], expected)
    assert not wide[:, 1::2].any()
    np.testing.assert_allclose(camera.render(ideal, frame_index=1, dtype=np.float32), expected / 1023, rtol=1e-6)
    normalized = np.zeros(SHAPE, np.float32)
    camera.render(ideal, frame_index=1, out=normalized)
    np.testing.assert_allclose(normalized, expected / 1023, rtol=1e-6)


def test_without_a_sensor_frames_are_the_intensity(context: clspeckle.Context, ideal: Image) -> None:
    camera = clspeckle.Pipeline.from_parameters(SHAPE, seed=3, output="intensity", context=context)
    frame = camera.render(ideal)
    assert frame.dtype == np.float32
    np.testing.assert_array_equal(frame, camera.aperture.intensity(camera.phase, ideal))
    with pytest.raises(errors.InvalidFormatError, match="float32"):
        camera.render(ideal, dtype=np.uint16)


def test_pattern_and_pipeline_agree(context: clspeckle.Context) -> None:
    pattern = clspeckle.Pattern(np.eye(64) + 0.1, context=context)
    scene = clspeckle.Geometry(depth=np.full(SHAPE, 1.2), intrinsics=(50, 50, 24, 16), albedo=np.full(SHAPE, 0.7))
    camera = clspeckle.Pipeline.from_parameters(SHAPE, pattern=pattern, seed=4, context=context)
    plain = clspeckle.Pipeline.from_parameters(SHAPE, seed=4, context=context)
    np.testing.assert_array_equal(camera.render(scene), plain.render(pattern.lookup(scene)))
    camera.check()


def test_batch_frames_and_render_agree(camera: clspeckle.Pipeline, ideal: Image) -> None:
    stack = np.stack([ideal * (i + 1) for i in range(5)])
    expected = []
    for index, image in enumerate(stack):
        expected.append(camera.render(image, frame_index=index, refresh="all"))
    batch = camera.render_batch(stack, refresh="all", first_frame_index=0)
    np.testing.assert_array_equal(batch, expected)
    assert camera.next_frame_index == 5
    out = np.zeros((5, SHAPE[0], 2 * SHAPE[1]), np.uint16)[..., ::2]
    assert camera.render_batch(stack, refresh="all", first_frame_index=0, out=out) is out
    np.testing.assert_array_equal(out, expected)
    for lookahead in (0, 1, 3):
        frames = list(camera.frames(iter(stack), refresh="all", first_frame_index=0, lookahead=lookahead))
        np.testing.assert_array_equal(frames, expected)
    as_float = camera.render_batch(list(stack), refresh="all", first_frame_index=0, dtype=np.float32)
    np.testing.assert_allclose(as_float, np.array(expected) / 1023, rtol=1e-6)
    assert camera.render_batch([]).shape == (0, *SHAPE)
    assert list(camera.frames([])) == []


def test_frames_with_settings_of_their_own(camera: clspeckle.Pipeline, ideal: Image) -> None:
    mask = np.zeros(SHAPE, np.uint8)
    mask[:4] = 1
    plan: list[Any] = [
        clspeckle.Frame(ideal, frame_index=10),
        clspeckle.Frame(ideal, refresh=mask),
        clspeckle.Frame(ideal, refresh="all", frame_index=3),
        ideal,
    ]
    result = list(camera.frames(plan))
    assert camera.next_frame_index == 5
    camera.phase.refresh(10)
    expected = [
        camera.render(ideal, frame_index=10),
        camera.render(ideal, frame_index=11, refresh=mask),
        camera.render(ideal, frame_index=3, refresh="all"),
        camera.render(ideal, frame_index=4),
    ]
    np.testing.assert_array_equal(result, expected)


def test_interleaved_and_abandoned_streams(camera: clspeckle.Pipeline, ideal: Image) -> None:
    stack = np.stack([ideal, ideal * 2, ideal * 3])
    expected = camera.render_batch([clspeckle.Frame(s, frame_index=1) for s in stack])
    frames = [clspeckle.Frame(s, frame_index=1) for s in stack]
    for a, b, reference in zip(camera.frames(frames), camera.frames(frames), expected):
        np.testing.assert_array_equal(a, reference)
        np.testing.assert_array_equal(b, reference)
    abandoned = camera.frames(frames)
    next(abandoned)
    del abandoned
    np.testing.assert_array_equal(camera.render(stack[2], frame_index=1), expected[2])


def test_a_bad_frame_in_a_stream_leaves_the_camera_usable(camera: clspeckle.Pipeline, ideal: Image) -> None:
    expected = camera.render(ideal, frame_index=1)
    with pytest.raises(errors.InvalidDataError, match="scene"):
        camera.render_batch([ideal, ideal, -ideal])
    np.testing.assert_array_equal(camera.render(ideal, frame_index=1), expected)


def test_simulate_depends_on_its_arguments_alone(context: clspeckle.Context, ideal: Image) -> None:
    options: dict[str, Any] = {"seed": 3, "f_number": 4.0, "degree_of_polarization": 0.5, "context": context}
    one = clspeckle.simulate(ideal, **options)
    camera = clspeckle.Pipeline.from_parameters(
        SHAPE, seed=3, f_number=4.0, degree_of_polarization=0.5, context=context
    )
    np.testing.assert_array_equal(camera.render(ideal), one)
    clspeckle.simulate(ideal * 2, frame_index=9, **options)  # the same camera, used otherwise
    np.testing.assert_array_equal(clspeckle.simulate(ideal, **options), one)
    out = np.zeros(SHAPE, np.uint16)
    assert clspeckle.simulate(ideal, out=out, **options) is out
    np.testing.assert_array_equal(out, one)

    stack = np.stack([ideal] * 3)
    same = clspeckle.simulate(stack, frame_index=5, **options)
    fresh = clspeckle.simulate(stack, frame_index=5, refresh="all", **options)
    np.testing.assert_array_equal(same[0], clspeckle.simulate(ideal, frame_index=5, **options))
    np.testing.assert_array_equal(fresh[2], clspeckle.simulate(ideal, frame_index=7, **options))
    assert np.corrcoef(same[0].ravel(), same[2].ravel())[0, 1] > 0.95
    assert np.corrcoef(fresh[0].ravel(), fresh[2].ravel())[0, 1] < 0.5

    intensity = clspeckle.simulate(ideal, output="intensity", **options)
    assert intensity.dtype == np.float32
    dark = clspeckle.simulate(ideal, dark_frame_dn=np.full(SHAPE, 20.0), read_noise_dn=0, **options)
    assert np.median(dark.astype(int) - clspeckle.simulate(ideal, read_noise_dn=0, **options)) == 20
    half_dark = np.where(np.arange(SHAPE[1]) % 2, 1.5, 0.5) * np.ones(SHAPE)
    striped = clspeckle.simulate(ideal, gain_map=half_dark, read_noise_dn=0, black_level_dn=0, **options).astype(float)
    assert striped[:, 1::2].mean() == pytest.approx(3 * striped[:, ::2].mean(), rel=0.1)


def test_simulate_keeps_one_camera(context: clspeckle.Context, ideal: Image) -> None:
    clspeckle.simulate(ideal, seed=3, context=context)
    held = context.info().allocation_count
    for _ in range(3):
        clspeckle.simulate(ideal, seed=3, context=context)
    assert context.info().allocation_count == held


def test_parameters_are_those_of_the_stages() -> None:
    taken: dict[str, set[str]] = {}
    parts = {"phase", "aperture", "sensor", "pattern", "dots", "materials", "motion", "lens"}
    for stage in (clspeckle.Phase, clspeckle.Aperture, clspeckle.Lens, clspeckle.Sensor, clspeckle.Pipeline):
        names = set(inspect.signature(stage.__init__).parameters)
        taken[stage.__name__] = names - {"self", "shape", "context", "workspace_from_host", *parts}
    assert set(clspeckle.PipelineParameters.__annotations__) == set.union(*taken.values(), {"effects"})
    described_stages: list[Any] = [clspeckle.Phase, clspeckle.Aperture, clspeckle.Sensor, clspeckle.Pattern]
    described_stages += [clspeckle.Dots, clspeckle.Lens, clspeckle.Motion, clspeckle.Pipeline]
    for described in described_stages:
        names = set(inspect.signature(described.__init__).parameters)
        assert set(described.defaults()) <= names, described
        assert all(
            value is None or isinstance(value, (int, float, str, list, np.ndarray))
            for value in described.defaults().values()
        )


def test_timings(ideal: Image) -> None:
    with clspeckle.Context(profiling=True) as context:
        camera = clspeckle.Pipeline.from_parameters(SHAPE, context=context)
        with pytest.raises(errors.InvalidStateError):
            camera.timings()
        camera.render(ideal)
        timings = camera.timings()
        # The device's own engine makes the field in its forward transform, and the intensity in the inverse one; in
        # lanes the codes, too.
        lanes = ["phase", "fft", "pupil", "inverse_fft"]
        assert list(timings) in (
            lanes,
            [*lanes, "sensor"],
            ["phase", "field", "fft", "pupil", "inverse_fft", "intensity", "sensor"],
        )
        assert all(milliseconds >= 0 for milliseconds in timings.values())
        assert sum(timings.values()) > 0
        camera.render(ideal)
        assert "phase" not in camera.timings()
        camera.render(ideal, queue=clspeckle.Queue(context))
        with pytest.raises(errors.InvalidStateError, match="profiling"):
            camera.timings()


def test_warm_up_changes_nothing(context: clspeckle.Context, ideal: Image) -> None:
    cold, warm = (clspeckle.Pipeline.from_parameters(SHAPE, seed=6, context=context) for _ in range(2))
    warm.warm_up()
    warm.warm_up(ideal, refresh="all", dtype=np.float32)
    assert warm.next_frame_index == 0
    np.testing.assert_array_equal(warm.render(ideal), cold.render(ideal))
    warm.warm_up(ideal, refresh=np.ones(SHAPE, bool))
    np.testing.assert_array_equal(warm.render(ideal), cold.render(ideal))


def test_check_reports_bad_pixels_of_device_images(camera: clspeckle.Pipeline, ideal: Image) -> None:
    bad = ideal.copy()
    bad[3, 5], bad[4, 6], bad[7, 7] = np.nan, -1, np.inf
    image = clspeckle.DeviceImage.from_array(bad, context=camera.context)
    frame = camera.render(image, frame_index=0)
    with pytest.raises(errors.InvalidDataError, match=r"x = 5, y = 3"):
        camera.check()
    camera.check()
    clean = np.where((bad > 0) & np.isfinite(bad), bad, 0)
    np.testing.assert_array_equal(camera.render(clean, frame_index=0), frame)
    camera.check()


# --- Statistics ---


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64, np.int32])
def test_moments_are_numpys(dtype: Any, context: clspeckle.Context) -> None:
    rng = np.random.default_rng(8)
    image = rng.gamma(3, 20, SHAPE).clip(0, 255).astype(dtype)
    mask = rng.random(SHAPE) > 0.3
    for given in (None, mask):
        values = image.astype(float).ravel() if given is None else image[mask].astype(float)
        result = clspeckle.statistics.moments(image, given, context=context)
        centred = values - values.mean()
        sigma = values.std()
        assert result.count == values.size
        assert result.mean == pytest.approx(values.mean(), rel=1e-6)
        assert result.standard_deviation == pytest.approx(values.std(ddof=1), rel=1e-6)
        assert result.contrast == pytest.approx(values.std(ddof=1) / values.mean(), rel=1e-6)
        assert result.skewness == pytest.approx(np.mean(centred**3) / sigma**3, rel=5e-3)
        assert result.excess_kurtosis == pytest.approx(np.mean(centred**4) / sigma**4 - 3, rel=2e-2)
        assert (result.minimum, result.maximum) == tuple(values[[values.argmin(), values.argmax()]].astype(np.float32))


def test_histogram_is_numpys(context: clspeckle.Context) -> None:
    image = np.random.default_rng(8).integers(0, 200, SHAPE).astype(np.uint16)
    mask = image % 3 != 0
    result = clspeckle.statistics.histogram(image, 20, 180, 16, mask, context=context)
    values = image[mask]
    expected, edges = np.histogram(values[(values >= 20) & (values < 180)], 16, (20, 180))
    np.testing.assert_array_equal(result.counts, expected)
    np.testing.assert_allclose(result.edges, edges)
    assert result.below == np.count_nonzero(values < 20)
    assert result.above == np.count_nonzero(values >= 180)


def test_autocovariance_is_numpys(context: clspeckle.Context) -> None:
    image = np.random.default_rng(8).random(SHAPE).astype(np.float32)
    lag = 3
    result = clspeckle.statistics.autocovariance(image, lag, context=context)
    assert result.shape == (2 * lag + 1, 2 * lag + 1)
    centred = image.astype(float) - image.mean(dtype=float)
    expected = np.empty_like(result)
    for dy in range(-lag, lag + 1):
        for dx in range(-lag, lag + 1):
            a = centred[max(0, dy) : SHAPE[0] + min(0, dy), max(0, dx) : SHAPE[1] + min(0, dx)]
            b = centred[max(0, -dy) : SHAPE[0] + min(0, -dy), max(0, -dx) : SHAPE[1] + min(0, -dx)]
            expected[lag + dy, lag + dx] = np.mean(a * b)
    np.testing.assert_allclose(result, expected / expected[lag, lag], atol=1e-5)
    assert result[lag, lag] == pytest.approx(1)


def test_statistics_of_device_images(context: clspeckle.Context, ideal: Image) -> None:
    image = clspeckle.DeviceImage.from_array(ideal, context=context)
    assert clspeckle.statistics.moments(image) == clspeckle.statistics.moments(ideal, context=context)
    mask = clspeckle.DeviceImage.from_array((ideal > 0.5).astype(np.uint8), context=context)
    assert clspeckle.statistics.moments(image, mask).count == np.count_nonzero(ideal > 0.5)
