"""The engines for CPUs and GPUs against the float64 reference, and against clFFT for all that a frame can hold."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import clspeckle
import numpy as np
import pytest
from clspeckle import errors

from reference import aperture, phase, philox

BOUND = 2e-6
ROOT = Path(__file__).resolve().parents[4]
SMALL_GROUPS = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build")) / "lib" / "libsmall_groups.so"


# By day GPUs' shape meets the stage's own tests (pytest_aperture_gpu) alone: on a CPU its kernels take the longest to
# compile.
@pytest.fixture(params=["cpu", pytest.param("gpu", marks=pytest.mark.nightly)])
def own(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[clspeckle.Context]:
    """Both shapes of the engine, whatever the device."""
    monkeypatch.setenv("CLSPECKLE_FFT", request.param)
    with clspeckle.Context() as context:
        yield context


@pytest.fixture
def clfft(monkeypatch: pytest.MonkeyPatch) -> Iterator[clspeckle.Context]:
    monkeypatch.setenv("CLSPECKLE_FFT", "clfft")
    with clspeckle.Context() as context:
        yield context


def is_gpu(context: clspeckle.Context) -> bool:
    (kind,) = {device.type for device in clspeckle.devices() if device.name == context.info().device_name}
    return "gpu" in kind and "cpu" not in kind


def noise_image(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(31).exponential(1.0, (height, width)).astype(np.float32)


def relative_error(got: np.ndarray, expected: np.ndarray) -> float:
    return float(np.linalg.norm(np.asarray(got, float) - expected) / np.linalg.norm(expected))


@pytest.mark.parametrize(
    "case",
    [
        # height, width, oversampling, guard_px, D
        (192, 160, 1, 0, 0.5),
        (160, 128, 1, 0, 1.0),
        (512, 512, 1, 0, 0.39),
        (63, 250, 1, 0, 0.7),
        (2, 3, 1, 0, 0.9),
        (143, 26, 1, 0, 0.6),
        (90, 70, 1, 5, 0.5),
        (60, 51, 2, 0, 1.3),
        (33, 40, 3, 1, 2.2),
        (25, 31, 4, 0, 1.0),
        (15, 14, 8, 0, 0.4),
        # long lines of every kind, in images that are small nevertheless
        (1080, 12, 1, 0, 0.5),
        (9, 1280, 1, 0, 0.6),
        (720, 7, 1, 0, 0.4),
        (1001, 6, 1, 0, 0.5),
        (4, 2310, 1, 0, 0.3),
        (2048, 10, 1, 0, 0.2),
    ],
    ids=lambda case: "{}x{} s{} guard{} D{}".format(*case),
)
def test_intensity_against_the_reference(own, measured, case):
    """Relative L2 error below 2e-6; strips, column blocks and blocks that end anywhere; all ways to sum a pixel's
    samples."""
    height, width, oversampling, guard_px, diameter = case
    grid = phase.FieldGrid(width, height, oversampling, guard_px)
    irradiance = noise_image(height, width)
    shared = {"oversampling": oversampling, "guard_px": guard_px, "context": own}
    for field in ("circular_gaussian", "unit_phasor"):
        state = clspeckle.Phase((height, width), field=field, seed=5, **shared)
        state.refresh(0)
        fields = [state.field(k) for k in (0, 1)]
        pupil = aperture.circle_pupil(grid, diameter)
        for p in (0.0, 1.0):
            stage = clspeckle.Aperture((height, width), relative_diameter=diameter, degree_of_polarization=p, **shared)
            reason = stage.info().fft_reason
            if is_gpu(own) and "local memory" in reason:  # in lanes, which are for CPUs
                assert stage.info().fft_engine == "clfft"
            else:
                assert stage.info().fft_engine != "clfft" and not reason
            expected = aperture.intensity(grid, irradiance, fields, pupil, p)
            error = relative_error(stage.intensity(state, irradiance), expected)
            measured("relative L2 error", error)
            assert error < BOUND


FRAMES = {
    "plain": {},
    "unpolarized": {"degree_of_polarization": 0.0},
    "oversampled": {"oversampling": 2, "f_number": 2.8},
    "three samples": {"oversampling": 3, "f_number": 2.8},
    "fill factor": {"oversampling": 2, "f_number": 2.8, "fill_factor": 0.6},
    "points and their areas": {"fill_factor": 0.8},
    "fill factor of all fields": {
        "fill_factor": 0.8,
        "line_count": 3,
        "dephasing_rad": 0.7,
        "degree_of_polarization": 0.5,
        "exposure_path": 2.0,
    },
    "guard": {"guard_px": 9},
    "soft polygon": {"blade_count": 5, "soft_rim": 0.3, "pupil": "polygon"},
    "obstruction": {"obstruction_ratio": 0.4, "normalization": "unit_mean"},
    "aberrations": {"defocus_waves": 0.7, "zernike_waves": {7: 0.1}},
    "unit phasor": {"field": "unit_phasor"},
    "continuous": {"dynamics": "continuous"},
    "coherent part": {"coherent_fraction": 0.3},
    "laser lines": {"line_count": 3, "dephasing_rad": 0.7},
    "air": {"airflow_rms_rad": 0.6},
    "vibration": {"vibration_rms_px": 0.8},
    "vibration and aberrations": {"vibration_rms_px": 0.8, "defocus_waves": 0.5},
    "air and lines": {"airflow_rms_rad": 0.6, "line_count": 3, "dephasing_rad": 0.7, "degree_of_polarization": 0.5},
}


def frames_of(context: clspeckle.Context, parameters: dict, **stages) -> tuple[list[np.ndarray], str]:
    shape = (45, 70)
    camera = clspeckle.Pipeline.from_parameters(
        shape, output="intensity", seed=6, context=context, **stages, **parameters
    )
    light = {}
    if "materials" in stages:
        light["material"] = (np.indices(shape).sum(axis=0) % 2).astype(np.uint8)
    frames = [np.array(camera.render(noise_image(*shape), frame_index=i, **light), float) for i in range(2)]
    return frames, camera.aperture.info().fft_engine


@pytest.mark.parametrize("name", FRAMES)
def test_frames_of_both_engines_agree(own, clfft, measured, name):
    """Each is within 1e-6 or so of the truth; a wrong sign, weight or place anywhere makes the difference about 1."""
    new, new_engine = frames_of(own, FRAMES[name])
    old, old_engine = frames_of(clfft, FRAMES[name])
    assert new_engine != old_engine == "clfft"
    for a, b in zip(new, old, strict=True):
        error = relative_error(a, b)
        measured("relative L2 difference", error)
        assert error < BOUND


def test_materials_of_both_engines_agree(own, clfft, measured):
    materials = [
        clspeckle.Material(roughness_rms_m=1e-6),
        clspeckle.Material(roughness_rms_m=6e-8, degree_of_polarization=0.9),
    ]
    new, new_engine = frames_of(own, {"degree_of_polarization": 0.4}, materials=materials)
    old, _ = frames_of(clfft, {"degree_of_polarization": 0.4}, materials=materials)
    assert new_engine != "clfft"
    for a, b in zip(new, old, strict=True):
        error = relative_error(a, b)
        measured("relative L2 difference", error)
        assert error < BOUND


@pytest.mark.parametrize("engine", ["cpu", "gpu", "clfft"])
def test_laser_lines_against_the_reference(monkeypatch, measured, engine):
    """Each line turns the field by k s h: the heights stay until all of the surface is drawn anew, lines may change."""
    monkeypatch.setenv("CLSPECKLE_FFT", engine)
    shape, seed, p = (45, 70), 6, 0.4
    grid = phase.FieldGrid(shape[1], shape[0], 1, 0)
    pupil = aperture.circle_pupil(grid, 0.6)

    def expected_intensity(fields, heights, lines, spread):
        offsets = np.linspace(-2.0, 2.0, lines)
        weights = np.exp(-(offsets**2) / 2) / np.exp(-(offsets**2) / 2).sum()
        turned = [[u * np.exp(1j * k * spread * heights) for u in fields] for k in offsets]
        intensities = [aperture.intensity(grid, noise_image(*shape), u, pupil, p) for u in turned]
        return np.tensordot(weights, intensities, 1)

    some = np.zeros(shape, np.uint8)
    some[10:30, 20:50] = 1
    with clspeckle.Context() as context:
        camera = clspeckle.Pipeline.from_parameters(
            shape,
            output="intensity",
            seed=seed,
            context=context,
            line_count=3,
            dephasing_rad=0.7,
            relative_diameter=0.6,
            degree_of_polarization=p,
        )
        for frame_index, (refresh, drawn) in enumerate([("all", 0), (None, 0), (some, 0), ("all", 3), (None, 3)]):
            lines, spread = (5, 0.9) if frame_index == 4 else (3, 0.7)
            if frame_index == 4:
                camera.set_effect("linewidth", dephasing_rad=spread)
            got = camera.render(noise_image(*shape), frame_index=frame_index, refresh=refresh)
            heights = philox.image_normal(grid.grid_height, grid.grid_width, seed, drawn, 0x30)
            fields = [camera.phase.field(k) for k in (0, 1)]
            error = relative_error(got, expected_intensity(fields, heights, lines, spread))
            measured("relative L2 error", error)
            assert error < BOUND


CAMERAS = {
    "default": {},
    "8 bits": {"bits": 8},
    "no noise": {"read_noise_dn": 0.0},
    "coarse converter": {"effective_bits": 6, "conversion_gain_dn_per_e": 0.8, "dark_current_e_per_s": 900.0},
    "noise without read noise": {"read_noise_dn": 0.0, "row_noise_dn": 3.0, "column_noise_dn": 2.0},
    "column and row gains": {"column_prnu": 0.02, "row_prnu": 0.02},
    "telegraph noise": {"telegraph_fraction": 0.05, "telegraph_step_dn": 30.0},
    "code widths": {"code_width_wave": 0.3},
    "all": {
        "shot_noise": True,
        "conversion_gain_dn_per_e": 0.8,
        "prnu": 0.02,
        "column_prnu": 0.02,
        "row_prnu": 0.02,
        "cold_pixel_fraction": 0.01,
        "hot_pixel_fraction": 0.01,
        "mosaic_gain": (0.9, 1.05, 0.95, 1.1),
        "dark_current_e_per_s": 300.0,
        "saturation_dn": 900.0,
        "lag_fraction": 0.2,
        "gamma": 0.9,
        "dsnu_dn": 2.0,
        "column_offset_dn": 2.0,
        "row_noise_dn": 3.0,
        "column_noise_dn": 3.0,
        "read_noise_spread": 0.2,
        "effective_bits": 7,
        "cubic_nonlinearity": 0.04,
        "nonlinearity_power": 1,
        "read_noise_correlation": 0.2,
        "telegraph_fraction": 0.02,
        "telegraph_step_dn": 20.0,
        "code_width_wave": 0.2,
        "code_width_period": 8.0,
    },
}


OPTICS = {
    "plain": {},
    "unpolarized": {"degree_of_polarization": 0.3},
    "oversampled": {"oversampling": 2, "guard_px": 1},
}


@pytest.mark.parametrize(
    ("name", "optics"),
    [
        *[(name, "plain") for name in CAMERAS],
        ("default", "unpolarized"),
        ("all", "unpolarized"),
        ("all", "oversampled"),
    ],
)
def test_sensor_in_the_last_pass(own, name, optics):
    """Codes made with the intensity are those of the sensor behind it, bit for bit: also where the image's four
    quarters are not of one size, and where a frame remembers the last one."""
    shape = (48, 32) if name == "8 bits" else (45, 70)
    view = OPTICS[optics]
    grid = {key: value for key, value in view.items() if key != "degree_of_polarization"}
    sensors = [clspeckle.Sensor(shape, seed=4, context=own, **CAMERAS[name]) for _ in range(2)]
    stages = [
        {
            "phase": clspeckle.Phase(shape, seed=3, context=own, **grid),
            "aperture": clspeckle.Aperture(shape, relative_diameter=0.6, context=own, **view),
        }
        for _ in range(2)
    ]
    camera = clspeckle.Pipeline(sensor=sensors[0], **stages[0])
    for frame_index in range(3):
        codes = camera.render(noise_image(*shape), frame_index=frame_index, refresh="all")
        stages[1]["phase"].refresh(frame_index)
        intensity = stages[1]["aperture"].intensity(stages[1]["phase"], noise_image(*shape))
        assert np.array_equal(sensors[1].expose(intensity, frame_index=frame_index), codes)


@pytest.mark.parametrize(
    ("dtype", "height", "polarization"),
    [(np.uint16, 750, 1.0), (np.uint16, 750, 0.4), (np.float32, 375, 1.0), (np.uint8, 1500, 1.0)],
)
def test_large_codes_go_past_the_caches(own, dtype, height, polarization):
    """Images of more than 1 MiB: rows of 45 vectors of 16 that begin as pairs of vectors do, so that one vector is left
    over; rows that begin anywhere, and whose distance is not one of pairs. Bit for bit the sensor's behind the
    intensity, and nothing beside the image is written."""
    shape, step = (height, 720), np.dtype(dtype).itemsize
    bits = 8 if dtype == np.uint8 else 10
    camera = clspeckle.Pipeline.from_parameters(
        shape, seed=5, relative_diameter=0.6, bits=bits, degree_of_polarization=polarization, context=own
    )
    ideal = np.ones(shape, np.float32)
    camera.render(ideal, frame_index=0)
    intensity = camera.aperture.intensity(camera.phase, ideal)
    expected = clspeckle.Sensor(shape, seed=5, bits=bits, context=own).expose(intensity, frame_index=7, dtype=dtype)
    scene = clspeckle.DeviceImage.from_array(ideal, context=own)
    for offset, pitch in ((0, 736), (0, 720), (3, 736), (32, 768), (0, 727)):
        whole = np.full(offset + height * pitch + 64, 201, dtype)
        memory = clspeckle.DeviceImage.from_array(whole[None, :], context=own)
        view = clspeckle.DeviceImage.wrap(
            memory.memory, shape, dtype, offset_bytes=offset * step, pitch_bytes=pitch * step, context=own
        )
        camera.enqueue_frame(scene, view, frame_index=7).wait()
        codes = memory.read()[0]
        rows = codes[offset : offset + height * pitch].reshape(height, pitch)
        assert np.array_equal(rows[:, :720], expected)
        assert np.all(rows[:, 720:] == 201)
        assert np.all(codes[:offset] == 201)
        assert np.all(codes[offset + height * pitch :] == 201)


@pytest.mark.parametrize("p", [1.0, 0.0])
def test_lines_larger_than_the_last_cache(monkeypatch, measured, p):
    """Pupil columns of 34 MB for each polarization, more than most processors' last cache has: on CPUs they go past the
    caches in rows_forward and are asked for ahead in rows_inverse. A few rows are left over in both. Against the
    reference, and the sensor in the last pass bit for bit the one behind the intensity."""
    monkeypatch.setenv("CLSPECKLE_FFT", "auto")
    shape = (2100, 2048)
    with clspeckle.Context() as context:
        camera = clspeckle.Pipeline.from_parameters(
            shape, seed=5, relative_diameter=1.0, degree_of_polarization=p, context=context
        )
        assert camera.aperture.info().fft_engine != "clfft"
        irradiance = noise_image(*shape)
        codes = camera.render(irradiance, frame_index=0)
        intensity = camera.aperture.intensity(camera.phase, irradiance)
        assert np.array_equal(clspeckle.Sensor(shape, seed=5, context=context).expose(intensity, frame_index=0), codes)
        grid = phase.FieldGrid(shape[1], shape[0], 1, 0)
        fields = [camera.phase.field(k) for k in range(1 if p == 1.0 else 2)]
        expected = aperture.intensity(grid, irradiance, fields, aperture.circle_pupil(grid, 1.0), p)
    error = relative_error(intensity, expected)
    measured("relative L2 error", error)
    assert error < BOUND


def test_in_place(own):
    """Where the output is the irradiance itself, the first polarization waits elsewhere."""
    shape = (40, 52)
    state = clspeckle.Phase(shape, seed=3, context=own)
    state.refresh(0)
    stage = clspeckle.Aperture(shape, relative_diameter=0.6, degree_of_polarization=0.3, context=own)
    irradiance = noise_image(*shape)
    apart = stage.intensity(state, irradiance)
    image = clspeckle.DeviceImage.from_array(irradiance, context=own)
    stage.enqueue_intensity(state, image, image).wait()
    assert np.array_equal(image.read(), apart)


def test_bad_pixels_are_counted_once(own):
    """With padding, several samples of a pixel and two polarizations; and they count as dark."""
    shape = (19, 34)
    irradiance = noise_image(*shape)
    dark = irradiance.copy()
    for y, x, value in ((18, 33, np.nan), (0, 0, -1.0), (7, 20, np.inf), (7, 21, -3.0)):
        irradiance[y, x] = value
        dark[y, x] = 0
    camera = clspeckle.Pipeline.from_parameters(
        shape, output="intensity", seed=6, oversampling=2, guard_px=3, degree_of_polarization=0.0, context=own
    )
    expected = np.array(camera.render(dark))
    camera.check()
    image = clspeckle.DeviceImage.from_array(irradiance, context=own)
    assert np.array_equal(np.array(camera.render(image)), expected)
    with pytest.raises(errors.InvalidDataError) as caught:
        camera.check()
    assert "2 NaN or infinite and 2 negative" in str(caught.value)
    assert "x = 0, y = 0" in str(caught.value)


def test_only_pupil_columns_take_memory(own, clfft):
    shape = (512, 512)
    sizes = {
        diameter: clspeckle.Aperture(shape, relative_diameter=diameter, context=own).info().workspace_bytes
        for diameter in (0.25, 0.5, 1.0)
    }
    for diameter, size in sizes.items():
        assert size <= 8 * 512 * (512 * diameter + 16) + 4096
    assert sizes[1.0] < clspeckle.Aperture(shape, relative_diameter=1.0, context=clfft).info().workspace_bytes + 8192


def test_workspace_from_the_host_has_room_for_any_aperture(own):
    """An effect may open the aperture later; the host's memory must do for that."""
    shape = (64, 64)
    info = clspeckle.Aperture(shape, relative_diameter=0.1, workspace_from_host=True, context=own).info()
    assert info.workspace_bytes >= 64 * 64 * 8


def test_what_the_engine_does_not_take_goes_to_clfft(own):
    info = clspeckle.Aperture((1, 40), relative_diameter=0.5, context=own).info()
    assert info.fft_engine == "clfft"
    assert "40 x 1" in info.fft_reason


def test_both_shapes_keep_the_same_lines(monkeypatch):
    """Both fill up the 255 lines of 512 inside the pupil: lanes their last column block, work-groups the last cache
    line of a row."""
    sizes = {}
    for choice in ("cpu", "gpu"):
        monkeypatch.setenv("CLSPECKLE_FFT", choice)
        with clspeckle.Context() as context:
            info = clspeckle.Aperture((512, 512), relative_diameter=0.5, context=context).info()
            sizes[choice] = info.workspace_bytes
    assert sizes["gpu"] == 8 * 512 * 256
    assert 8 * 512 * 255 < sizes["cpu"] <= 8 * 512 * (255 + 15)


SMALL_DEVICE = """
import sys, clspeckle
info = clspeckle.Aperture((int(sys.argv[1]), int(sys.argv[2])), relative_diameter=0.5).info()
print(info.fft_engine, info.fft_reason, sep="|")
"""


@pytest.mark.parametrize(
    ("engine", "shape", "options", "expected"),
    [
        (
            "gpu",
            (2, 8192),
            ["--local-mem-size", "16384"],
            "clfft|lines of 8192 points need 34816 bytes of local memory, the device has 16384",
        ),
        ("gpu", (4, 1080), ["--local-mem-size", "16384"], "gpu|"),
        ("gpu", (64, 64), ["--max-wgsize", "16"], "gpu|"),
        (
            "cpu",
            (2, 2048),
            ["--local-mem-size", "16384"],
            "clfft|rows of 2048 points need 65568 bytes of local memory, the device has 16384",
        ),
        ("cpu", (2048, 2), ["--local-mem-size", "16384"], "cpu|"),
    ],
    ids=["no room for a line", "room for fewer lines", "few work-items", "no room for a row", "columns need no room"],
)
def test_lines_fit_the_device_or_are_left_to_clfft(engine, shape, options, expected):
    """On oclgrind's device with less local memory and smaller work-groups. In lanes columns are transformed where they
    lie."""
    done = subprocess.run(
        ["oclgrind", *options, sys.executable, "-c", SMALL_DEVICE, *map(str, shape)],
        env={**os.environ, "CLSPECKLE_FFT": engine, "CLSPECKLE_DEVICE": "oclgrind"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert expected in done.stdout.splitlines(), done.stdout + done.stderr


SMALL_CAMERA = """
import sys, clspeckle, numpy as np
shape, oversampling = (int(sys.argv[1]), int(sys.argv[2])), int(sys.argv[3])
phase = clspeckle.Phase(shape, oversampling=oversampling, seed=3)
aperture = clspeckle.Aperture(shape, oversampling=oversampling, relative_diameter=0.6)
sensors = [clspeckle.Sensor(shape, seed=4, read_noise_dn=20.0, bits=12) for _ in range(2)]
ideal = np.random.default_rng(5).exponential(20.0, shape).astype(np.float32)
codes = clspeckle.Pipeline(phase=phase, aperture=aperture, sensor=sensors[0]).render(ideal, frame_index=7)
intensity = clspeckle.Pipeline(phase=phase, aperture=aperture).render(ideal, frame_index=7)
same = np.array_equal(codes, sensors[1].expose(intensity, frame_index=7))
print(aperture.info().fft_engine, same, codes.std() > 100)
"""


@pytest.mark.parametrize(("height", "oversampling"), [(6, 1), (5, 2)])
def test_the_sensor_takes_rows_alone_where_four_do_not_fit(height, oversampling):
    """Rows of all four quarters share random numbers if local memory has room for them; the codes are the same
    without."""
    for bytes_of_local in ("32768", "16384"):
        done = subprocess.run(
            ["oclgrind", "--local-mem-size", bytes_of_local, sys.executable, "-c", SMALL_CAMERA]
            + [str(height), str(1024 // oversampling), str(oversampling)],
            env={**os.environ, "CLSPECKLE_FFT": "gpu", "CLSPECKLE_DEVICE": "oclgrind"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert "gpu True True" in done.stdout.splitlines(), done.stdout + done.stderr


SMALL_KERNELS = """
import logging, sys, zlib
logging.basicConfig(level=logging.INFO)
import clspeckle, numpy as np
shape = int(sys.argv[1]), int(sys.argv[2])
aperture = clspeckle.Aperture(shape, relative_diameter=0.5)
sensor = clspeckle.Sensor(shape, seed=4, read_noise_dn=20.0, bits=12)
ideal = np.random.default_rng(5).exponential(50.0, shape).astype(np.float32)
codes = clspeckle.Pipeline(phase=clspeckle.Phase(shape, seed=3), aperture=aperture, sensor=sensor).render(ideal)
print(zlib.crc32(codes.tobytes()))
"""


@pytest.mark.parametrize(
    ("shape", "engines"),
    [
        ((1080, 8), {1024: "columns 4 x 45", 256: "columns 4 x 45", 128: "columns 4 x 30", 64: "columns 2 x 30"}),
        ((8, 1920), {1024: "rows 1 x 192", 256: "rows 1 x 192", 128: "rows 1 x 80", 64: "rows 1 x 64"}),
    ],
    ids=["columns", "rows"],
)
def test_a_driver_may_give_kernels_less_than_its_device_has(tmp_path, shape, engines):
    """NVIDIA's gives them 256 work-items of 1024. All points of a line once went to one work-item there, for which
    compilers took minutes."""
    codes = set()
    for items, engine in engines.items():
        done = subprocess.run(
            [sys.executable, "-c", SMALL_KERNELS, *map(str, shape)],
            env={
                **os.environ,
                "CLSPECKLE_FFT": "gpu",
                "CLSPECKLE_CACHE_DIR": str(tmp_path),
                "CLSP_KERNEL_WORK_GROUP_SIZE": str(items),
                "LD_PRELOAD": str(SMALL_GROUPS),
            },
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        (used,) = (line for line in done.stderr.splitlines() if "is used for a field grid" in line)
        assert engine in used
        assert ("instead of" in done.stderr) == (items < 256)
        codes.add(done.stdout)
    assert len(codes) == 1  # any work-groups make the same picture


@pytest.mark.parametrize("choice", ["auto", ""])
def test_cpus_and_gpus_take_the_engine_unless_told_otherwise(monkeypatch, choice):
    monkeypatch.setenv("CLSPECKLE_FFT", choice)
    with clspeckle.Context() as context:
        info = clspeckle.Aperture((32, 32), relative_diameter=0.5, context=context).info()
        (device,) = {d.type for d in clspeckle.devices() if d.name == context.info().device_name}
        if "cpu" in device or "gpu" in device:
            assert (info.fft_engine, info.fft_reason) == ("cpu" if "cpu" in device else "gpu", "")
        else:
            assert info.fft_engine == "clfft"
            assert "neither CPU nor GPU" in info.fft_reason


@pytest.mark.parametrize(("old", "kind"), [("fused-lanes", "cpu"), ("fused-groups", "gpu"), ("fused", "")])
def test_old_names_are_read_with_a_warning(monkeypatch, caplog, old, kind):
    monkeypatch.setenv("CLSPECKLE_FFT", old)
    with clspeckle.Context() as context:
        info = clspeckle.Aperture((32, 32), relative_diameter=0.5, context=context).info()
    assert info.fft_engine == (kind or info.fft_engine) != "clfft"
    (warning,) = [line.getMessage() for line in caplog.records if line.levelno == logging.WARNING]
    assert warning.startswith(f"CLSPECKLE_FFT is {old}, an old name; the engine is called {kind}")


def test_the_choice_must_be_one(monkeypatch):
    monkeypatch.setenv("CLSPECKLE_FFT", "fftw")
    with pytest.raises(errors.InvalidArgumentError, match=r"fftw.*auto, cpu, gpu or clfft"):
        clspeckle.Context()


def test_the_choice_is_the_contexts(own, clfft):
    for context, reason in ((own, ""), (clfft, "CLSPECKLE_FFT is clfft")):
        info = clspeckle.Aperture((32, 32), relative_diameter=0.5, context=context).info()
        assert (info.fft_engine == "clfft", info.fft_reason) == (context is clfft, reason)
