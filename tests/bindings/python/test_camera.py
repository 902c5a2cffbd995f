"""The whole camera through the binding: materials, motion, dots, lens, illumination, the aperture's shapes."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl
import pytest

import clspeckle
from binding_common import SHAPE
from clspeckle import errors

HEIGHT, WIDTH = SHAPE
Image = npt.NDArray[np.float32]


def correlation(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> float:
    return float(np.corrcoef(a.ravel().astype(float), b.ravel().astype(float))[0, 1])


def intensity_camera(context: clspeckle.Context, **options: Any) -> clspeckle.Pipeline:
    return clspeckle.Pipeline.from_parameters(SHAPE, output="intensity", context=context, **{"seed": 5, **options})


# --- Dots ---


def test_dots_are_the_light_of_a_pipeline(context: clspeckle.Context) -> None:
    dots = clspeckle.Dots(SHAPE, [(10.0, 8.0), (30.5, 20.0)], sigma_px=3.0, context=context)
    light = dots.render()
    camera = intensity_camera(context, dots=dots)
    got = camera.render(frame_index=3, refresh="all")
    np.testing.assert_allclose(got, intensity_camera(context).render(light, frame_index=3, refresh="all"), rtol=1e-6)
    out = clspeckle.DeviceImage(SHAPE, context=context)
    camera.enqueue_frame(None, out, frame_index=3, refresh="all").wait()
    np.testing.assert_array_equal(out.read(), got)
    np.testing.assert_array_equal(
        camera.render_batch([clspeckle.Frame(None, "all", 3), clspeckle.Frame(None, "all", 3)]), [got, got]
    )
    camera.warm_up()
    with pytest.raises(TypeError, match="has dots; its frames take no scene"):
        camera.render(light)
    with pytest.raises(TypeError, match="Geometry"):
        camera.render(clspeckle.Geometry(depth=np.ones(SHAPE), intrinsics=(1, 1, 0, 0)))
    pattern = clspeckle.Pattern(np.ones((4, 4)), context=context)
    with pytest.raises(errors.InvalidArgumentError, match="pattern or dots, not both"):
        intensity_camera(context, dots=dots, pattern=pattern)
    other = clspeckle.Dots((8, 8), [(1.0, 1.0)], context=context)
    with pytest.raises(errors.InvalidArgumentError, match="dots has 8 x 8"):
        intensity_camera(context, dots=other)
    with pytest.raises(TypeError, match=r"dots must be a clspeckle\.Dots"):
        clspeckle.Pipeline(phase=camera.phase, aperture=camera.aperture, dots=light)


# --- Materials ---


def test_materials_set_the_contrast(context: clspeckle.Context) -> None:
    # Contrast of a polarized, fully developed speckle is 1, of an unpolarized one 1 / sqrt(2), of a mirror 0. A part of
    # 24 x 64 pixels holds about 400 independent speckles, so that a contrast of 1 is known to sqrt(2 / 400) = 0.07 at
    # most (one sigma); the seed is fixed.
    shape = (64, 128)
    materials = [
        clspeckle.Material(degree_of_polarization=1.0),
        clspeckle.Material(degree_of_polarization=0.0),
        clspeckle.Material(roughness_rms_m=0.0),
    ]
    ids = np.repeat(np.array([0, 1, 2, 2]), 32)[np.newaxis].repeat(64, 0)
    camera = clspeckle.Pipeline.from_parameters(
        shape, output="intensity", materials=materials, normalization="unit_mean", f_number=4.0, seed=8, context=context
    )
    assert camera.materials is not None
    assert len(camera.materials) == 3
    light = np.ones(shape, np.float32)
    frame = camera.render(light, material=ids, refresh="all")
    contrast = [float(part.std() / part.mean()) for part in (frame[:, 4:28], frame[:, 36:60], frame[:, 72:120])]
    assert contrast[0] == pytest.approx(1.0, abs=0.12)
    assert contrast[1] == pytest.approx(math.sqrt(0.5), abs=0.12)
    assert contrast[2] < 0.1
    on_device = clspeckle.DeviceImage.from_array(ids.astype(np.uint8), context=context)
    np.testing.assert_array_equal(camera.render(light, material=on_device, frame_index=0, refresh="all"), frame)
    camera.warm_up()
    camera.check()
    with pytest.raises(TypeError, match="each pixel's material id"):
        camera.render(light)
    with pytest.raises(errors.InvalidDataError, match="0 to 255"):
        camera.render(light, material=ids + 254)
    with pytest.raises(errors.InvalidFormatError, match="float64, expected integers"):
        camera.render(light, material=ids.astype(float))
    with pytest.raises(errors.InvalidArgumentError, match=r"\(3, 3\), expected \(64, 128\)"):
        camera.render(light, material=np.zeros((3, 3), np.uint8))
    camera.render(light, material=ids + 7, refresh="all")
    with pytest.raises(errors.InvalidDataError, match="ids outside the table"):
        camera.check()
    with pytest.raises(TypeError, match="no material table"):
        intensity_camera(context).render(np.ones(SHAPE), material=np.zeros(SHAPE, np.uint8))
    with pytest.raises(errors.InvalidArgumentError, match="polarization_count 2"):
        clspeckle.Pipeline.from_parameters(shape, materials=materials, polarization_count=1, context=context)


def test_materials_of_the_frame_are_the_motions(context: clspeckle.Context) -> None:
    # The left half loses its speckle at once, the right one keeps it; the motion's input does not say which is which.
    materials = [clspeckle.Material(correlation_time_s=0.0), clspeckle.Material()]
    camera = intensity_camera(
        context, materials=materials, motion={"intrinsics": (40.0, 40.0, 0.0, 0.0)}, polarization_count=2
    )
    half = WIDTH // 2
    ids = np.zeros(SHAPE, np.uint8)
    ids[:, half:] = 1
    light = np.ones(SHAPE, np.float32)
    rests = clspeckle.MotionInput(depth=light, previous_from_current=np.eye(4), frame_time_s=1 / 30)
    first = camera.render(light, material=ids)
    second = camera.render(light, material=ids, motion=rests)
    other = camera.render(light, material=ids, motion=dataclasses.replace(rests, material=1 - ids))
    edge = 6
    # The lens mixes what is near, around the rim, too.
    left, right = np.s_[:, edge : half - edge], np.s_[:, half + edge : -edge]
    assert np.corrcoef(first[right].ravel(), second[right].ravel())[0, 1] > 0.95
    assert abs(np.corrcoef(first[left].ravel(), second[left].ravel())[0, 1]) < 0.5
    # What the input says itself counts: now the right half is new.
    assert np.corrcoef(second[left].ravel(), other[left].ravel())[0, 1] > 0.95
    assert abs(np.corrcoef(second[right].ravel(), other[right].ravel())[0, 1]) < 0.5


# --- Motion ---

FOCAL = 40.0


def moved(step_m: float) -> npt.NDArray[np.float64]:
    """X' = X - step: the scene moves to the right."""
    pose = np.eye(4)
    pose[0, 3] = -step_m
    return pose


def test_speckle_follows_and_forgets_a_motion(context: clspeckle.Context) -> None:
    depth = np.ones(SHAPE, np.float32)
    light = np.ones(SHAPE, np.float32)
    intrinsics = (FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    pixel = 1.0 / FOCAL  # metres that one pixel sees at 1 m
    # A surface whose speckle outlives the way: it moves by whole pixels.
    lasting = clspeckle.Material(lateral_correlation_length_m=math.inf, axial_correlation_length_m=math.inf)
    camera = intensity_camera(context, motion={"intrinsics": intrinsics, "translate": True})
    assert camera.motion is not None
    table = clspeckle.MaterialTable([lasting], context=context)
    moving = intensity_camera(context, motion={"intrinsics": intrinsics, "translate": True, "materials": table})
    still = clspeckle.MotionInput(depth=depth, previous_from_current=np.eye(4))
    step = clspeckle.MotionInput(depth=depth, previous_from_current=moved(pixel))
    first = moving.render(light)
    np.testing.assert_array_equal(moving.render(light, motion=still), first)
    second = moving.render(light, motion=step)
    inside = np.s_[4:-4, 6:-4]
    assert correlation(second[inside], np.roll(first, 1, axis=1)[inside]) > 0.99
    assert correlation(second[inside], first[inside]) < 0.9
    # The default material forgets after 0.5 mm: a step of one pixel, 25 mm, leaves nothing.
    first = camera.render(light)
    second = camera.render(light, motion=step)
    assert correlation(second[inside], np.roll(first, 1, axis=1)[inside]) < 0.3
    # 0.1 mm, a fifth of the length: the field's correlation is R(0.19) = 0.96 (phase.h), the intensity's its square.
    first = camera.render(light, refresh="all")
    small = clspeckle.MotionInput(depth=depth, previous_from_current=moved(1e-4))
    second = camera.render(light, motion=small)
    assert 0.8 < correlation(second, first) < 0.99
    batch = camera.render_batch([clspeckle.Frame(light, "all", 50), clspeckle.Frame(light, None, 51, motion=small)])
    assert 0.8 < correlation(batch[1], batch[0]) < 0.99
    camera.check()


def test_motion_in_device_memory_and_the_thesis_rule(context: clspeckle.Context) -> None:
    light = clspeckle.DeviceImage.from_array(np.ones(SHAPE, np.float32), context=context)
    depth = clspeckle.DeviceImage.from_array(np.ones(SHAPE, np.float32), context=context)
    camera = intensity_camera(context, motion={"rule": "replace", "intrinsics": (FOCAL, FOCAL, 0, 0)})
    out = clspeckle.DeviceImage(SHAPE, context=context)

    def frame(motion: clspeckle.MotionInput | None) -> Image:
        camera.enqueue_frame(light, out, motion=motion).wait()
        return out.read()

    first = frame(None)
    np.testing.assert_array_equal(frame(None), first)
    np.testing.assert_array_equal(frame(clspeckle.MotionInput(depth=depth, previous_from_current=moved(1e-9))), first)
    assert correlation(frame(clspeckle.MotionInput(depth=depth, previous_from_current=moved(1e-4))), first) < 0.3


def test_bad_motion(context: clspeckle.Context) -> None:
    light = np.ones(SHAPE, np.float32)
    given = clspeckle.MotionInput(depth=light, previous_from_current=np.eye(4))
    with pytest.raises(TypeError, match="no motion stage"):
        intensity_camera(context).render(light, motion=given)
    camera = intensity_camera(context, motion={"intrinsics": (FOCAL, FOCAL, 0, 0)})
    with pytest.raises(TypeError, match=r"motion must be a clspeckle\.MotionInput, got dict"):
        camera.render(light, motion={})  # type: ignore[call-overload]
    before = camera.render(light, refresh="all")
    with pytest.raises(errors.InvalidArgumentError):
        camera.render(light, motion=clspeckle.MotionInput(depth=light))
    with pytest.raises(errors.InvalidArgumentError, match="expected"):
        camera.render(light, motion=clspeckle.MotionInput(depth=light[:4], previous_from_current=np.eye(4)))
    np.testing.assert_array_equal(camera.render(light, motion=given), before)
    with pytest.raises(TypeError, match="unexpected keyword argument"):
        intensity_camera(context, motion={"rul": "replace"})


# --- Lens ---


def test_the_lens_of_a_pipeline_is_the_stage(context: clspeckle.Context, ideal: Image) -> None:
    options: dict[str, Any] = {"glare_fraction": 0.2, "vignetting_corner_loss": 0.5, "ambient": 0.25}
    camera = intensity_camera(context, **options)
    assert isinstance(camera.lens, clspeckle.Lens)
    plain = intensity_camera(context).render(ideal, refresh="all")
    np.testing.assert_allclose(camera.render(ideal, refresh="all"), camera.lens.finish(plain), rtol=2e-6)
    lens = clspeckle.Lens(SHAPE, context=context, **options)
    with pytest.raises(TypeError, match="k1 belongs to the lens, which was given"):
        intensity_camera(context, lens=lens, k1=0.1)
    again = clspeckle.Pipeline(phase=camera.phase, aperture=camera.aperture, lens=lens)
    np.testing.assert_array_equal(
        again.render(ideal, frame_index=0, refresh="all"), camera.render(ideal, frame_index=0, refresh="all")
    )


# --- Illumination ---


def test_illumination(context: clspeckle.Context, ideal: Image) -> None:
    dots = clspeckle.Dots(SHAPE, [(20.0, 16.0)], sigma_px=3.0, context=context)
    camera = intensity_camera(context, dots=dots, ambient=0.5)
    assert camera.aperture.info().mean_transmission > 0
    lamp = camera.render(ideal, illumination="incoherent")
    np.testing.assert_allclose(lamp, camera.aperture.info().mean_transmission * ideal + 0.5, rtol=1e-5)
    np.testing.assert_array_equal(camera.render(illumination="dark"), np.zeros(SHAPE))
    assert camera.render(illumination="laser").std() > 0
    assert camera.next_frame_index == 3
    frames = list(camera.frames([clspeckle.Frame(ideal, illumination="incoherent"), clspeckle.Frame(None)]))
    np.testing.assert_array_equal(frames[0], lamp)
    for kind in (None, "laser", "incoherent", "dark"):
        camera.warm_up(illumination=kind)
    with pytest.raises(errors.InvalidArgumentError, match=r'illumination is .*did you mean "incoherent"'):
        camera.render(ideal, illumination="incoheren")
    with pytest.raises(TypeError, match="illumination must be"):
        camera.render(ideal, illumination=1)  # type: ignore[call-overload]
    with pytest.raises(TypeError, match="need an ideal image, got None"):
        camera.render(illumination="incoherent")
    sensor = clspeckle.Pipeline.from_parameters(SHAPE, read_noise_dn=0, ambient=0.5, context=context)
    assert (sensor.render(illumination="dark") == 64).all()
    with pytest.raises(TypeError, match="scene"):
        sensor.render()


# --- Stages that cannot be used ---


def stages(context: clspeckle.Context) -> dict[str, Any]:
    return {
        "dots": clspeckle.Dots(SHAPE, [(1.0, 1.0)], context=context),
        "materials": clspeckle.MaterialTable([clspeckle.Material()], context=context),
        "motion": clspeckle.Motion(SHAPE, rule="replace", context=context),
        "lens": clspeckle.Lens(SHAPE, k1=0.01, context=context),
    }


@pytest.mark.parametrize("name", ["dots", "materials", "motion", "lens"])
def test_closed_foreign_and_wrong_stages(context: clspeckle.Context, name: str) -> None:
    phase, aperture = clspeckle.Phase(SHAPE, context=context), clspeckle.Aperture(SHAPE, context=context)
    stage = stages(context)[name]
    with clspeckle.Pipeline(phase=phase, aperture=aperture, **{name: stage}) as camera:
        assert getattr(camera, name) is stage
        stage.close()  # the pipeline keeps what it needs
        camera.warm_up()
    with pytest.raises(errors.InvalidHandleError, match=f"this {type(stage).__name__} is closed"):
        clspeckle.Pipeline(phase=phase, aperture=aperture, **{name: stage})
    other = clspeckle.Context.from_opencl(cl.create_some_context(interactive=False))
    with other as foreign, pytest.raises(errors.WrongContextError, match=name):
        clspeckle.Pipeline(phase=phase, aperture=aperture, **{name: stages(foreign)[name]})
    wrong: dict[str, Any] = {name: phase}
    with pytest.raises(TypeError, match=rf"{name} must be a clspeckle\.{type(stage).__name__}, got Phase"):
        clspeckle.Pipeline(phase=phase, aperture=aperture, **wrong)


# --- The pipeline's own numbers ---


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"line_count": 0}, "line"),
        ({"line_count": 64}, "line"),
        ({"sub_exposures": 128}, "sub_exposures"),
        ({"seed": -1}, "seed"),
        ({"dephasing_rad": -1.0}, "dephasing"),
        ({"dephasing_rad": math.nan}, "dephasing"),
        ({"power_flicker": -0.1}, "power_flicker"),
        ({"coherent_fraction": 1.5}, "coherent_fraction"),
        ({"subsurface_length_px": math.inf}, "subsurface_length_px"),
        ({"subsurface_fraction": 2.0}, "subsurface_fraction"),
        ({"subsurface_fraction": 0.5}, "subsurface_length_px"),
        ({"exposure_path": -1.0}, "exposure_path"),
        ({"exposure_path": 1.0, "exposure_correlation": "gaussian", "sub_exposures": 3}, "sub_exposures is 3"),
        ({"exposure_path": 33.0, "exposure_correlation": "gaussian"}, "exposure_path is 33"),
        ({"boiling_correlation_frames": 0.0}, "boiling_correlation_frames"),
        ({"airflow_rms_rad": -1.0}, "airflow"),
        ({"airflow_rms_rad": 1.0, "airflow_scale_px": 0.0}, "airflow"),
        ({"airflow_rms_rad": 1.0, "airflow_correlation_frames": 0.0}, "airflow"),
        ({"airflow_rms_rad": 1.0, "airflow_wind_px": math.nan}, "airflow wind_px"),
        ({"vibration_rms_px": math.inf}, "vibration_rms_px"),
    ],
    ids=str,
)
def test_numbers_out_of_range(context: clspeckle.Context, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(errors.InvalidArgumentError, match=message):
        intensity_camera(context, **arguments)


def test_defaults_and_types(context: clspeckle.Context) -> None:
    defaults = clspeckle.Pipeline.defaults()
    assert defaults["line_count"] == 1
    assert defaults["boiling_correlation_frames"] == math.inf
    ideal = np.ones(SHAPE, np.float32)
    plain = intensity_camera(context).render(ideal, refresh="all")
    given = {name: value for name, value in defaults.items() if name != "seed"}
    np.testing.assert_array_equal(intensity_camera(context, **given).render(ideal, refresh="all"), plain)
    for name in defaults:
        with pytest.raises(TypeError, match=name):
            intensity_camera(context, **{name: b"1"})
    with pytest.raises(
        errors.InvalidArgumentError, match='exposure_correlation is \'linear\', expected "field" or "gaussian"'
    ):
        intensity_camera(context, exposure_correlation="linear")


# --- The aperture's shapes ---


def test_pupils(context: clspeckle.Context) -> None:
    def pupil(**options: Any) -> npt.NDArray[Any]:
        return np.fft.fftshift(clspeckle.Aperture(SHAPE, context=context, f_number=3.2, **options).pupil())

    circle = pupil()
    polygon = pupil(blade_count=5)
    assert circle.dtype == polygon.dtype == np.float32
    np.testing.assert_array_equal(polygon, pupil(pupil="polygon", blade_count=5))
    assert 0.5 * np.pi * circle.sum() < np.pi * polygon.sum() < np.pi * circle.sum()
    assert not np.array_equal(polygon, pupil(blade_count=5, blade_rotation_rad=0.3))
    assert polygon.sum() < pupil(blade_count=5, blade_curvature=0.5).sum() <= circle.sum()
    # A blocked centre takes ratio^2 of the area; the 32 x 48 grid resolves it to a few per cent.
    ring = pupil(pupil="ring", obstruction_ratio=0.5)
    np.testing.assert_array_equal(ring, pupil(obstruction_ratio=0.5))
    assert ring.sum() / circle.sum() == pytest.approx(0.75, abs=0.05)
    blurred = pupil(defocus_waves=0.5)
    assert blurred.dtype == np.complex64
    np.testing.assert_allclose(np.abs(blurred), circle, atol=1e-6)
    # Pupil phase 2 pi w rho^2 (aperture.h), rho = 1 at the rim D / 2.
    fx, fy = np.meshgrid(np.fft.fftshift(np.fft.fftfreq(WIDTH)), np.fft.fftshift(np.fft.fftfreq(HEIGHT)))
    diameter = clspeckle.Aperture(SHAPE, context=context, f_number=3.2).info().relative_diameter
    expected = circle * np.exp(2j * np.pi * 0.5 * (fx**2 + fy**2) / (diameter / 2) ** 2)
    np.testing.assert_allclose(blurred, expected, atol=1e-5)
    # Noll's polynomial 4 is sqrt(3) (2 rho^2 - 1): the same defocus up to a constant phase.
    noll = pupil(zernike_waves={4: 0.5 / (2 * math.sqrt(3))})
    np.testing.assert_allclose(noll, expected * np.exp(-2j * np.pi * 0.25), atol=1e-5)
    np.testing.assert_array_equal(noll, pupil(zernike_waves=[0.5 / (2 * math.sqrt(3))]))
    assert not np.array_equal(pupil(zernike_waves={7: 0.1}), pupil(zernike_waves={8: 0.1}))


def test_the_pupil_in_device_memory(context: clspeckle.Context) -> None:
    aperture = clspeckle.Aperture(SHAPE, defocus_waves=0.3, context=context)
    target = clspeckle.DeviceImage((*SHAPE, 2), np.float32, context=context)
    aperture.enqueue_pupil(target).wait()
    parts = target.read()
    np.testing.assert_array_equal(parts[..., 0] + 1j * parts[..., 1], aperture.pupil())
    with pytest.raises(errors.InvalidFormatError):
        aperture.enqueue_pupil(clspeckle.DeviceImage(SHAPE, context=context))


def test_fill_factor(context: clspeckle.Context, ideal: Image) -> None:
    phase = clspeckle.Phase(SHAPE, context=context)
    phase.refresh(0)
    point = clspeckle.Aperture(SHAPE, context=context).intensity(phase, ideal)
    filled = clspeckle.Aperture(SHAPE, fill_factor=1.0, context=context).intensity(phase, ideal)
    assert filled.std() < point.std()
    assert filled.mean() == pytest.approx(point.mean(), rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        ({"pupil": "hexagon"}, errors.InvalidArgumentError, 'pupil is .*expected "circle"'),
        ({"pupil": 2}, TypeError, "pupil must be"),
        ({"pupil": "image"}, errors.InvalidArgumentError, "pupil_image is missing"),
        ({"pupil": "ring"}, errors.InvalidArgumentError, "obstruction_ratio"),
        ({"pupil": "circle", "blade_count": 6}, errors.InvalidArgumentError, "blade_count was given"),
        ({"pupil": "ring", "pupil_image": np.ones((4, 4))}, errors.InvalidArgumentError, "pupil_image was given"),
        ({"blade_count": 2}, errors.InvalidArgumentError, "blade_count is 2, it must be 3 to 32"),
        ({"blade_count": 33}, errors.InvalidArgumentError, "blade_count"),
        ({"blade_count": 5.5}, TypeError, "blade_count"),
        ({"blade_count": 5, "blade_rotation_rad": math.nan}, errors.InvalidArgumentError, "blade_rotation_rad"),
        ({"blade_count": 5, "blade_curvature": 1.5}, errors.InvalidArgumentError, "blade_curvature"),
        ({"obstruction_ratio": 1.0}, errors.InvalidArgumentError, "obstruction_ratio"),
        ({"defocus_waves": math.inf}, errors.InvalidArgumentError, "defocus_waves"),
        ({"defocus_waves": 1e4}, errors.InvalidArgumentError, "waves"),
        ({"fill_factor": 1.5}, errors.InvalidArgumentError, "fill_factor"),
        ({"zernike_waves": {3: 0.1}}, errors.InvalidArgumentError, "3, expected 4 to 15"),
        ({"zernike_waves": {16: 0.1}}, errors.InvalidArgumentError, "16, expected 4 to 15"),
        ({"zernike_waves": {4: "0.1"}}, TypeError, r"zernike_waves\[4\]"),
        ({"zernike_waves": {4.5: 0.1}}, TypeError, "zernike_waves"),
        ({"zernike_waves": np.zeros(13)}, errors.InvalidArgumentError, r"\(13,\), expected 1 to 12"),
        ({"zernike_waves": np.zeros((2, 2))}, errors.InvalidArgumentError, r"\(2, 2\), expected"),
        ({"zernike_waves": [1j]}, errors.InvalidFormatError, "complex128"),
        ({"zernike_waves": [math.nan]}, errors.InvalidArgumentError, "zernike_waves"),
    ],
    ids=str,
)
def test_bad_pupils(context: clspeckle.Context, arguments: dict[str, Any], kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        clspeckle.Aperture(SHAPE, context=context, **arguments)
    with pytest.raises(kind, match=message):
        intensity_camera(context, **arguments)
