"""A camera of the caller's own optics: a complex pupil and a field of their own, against NumPy's transforms."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import clspeckle
from binding_common import SHAPE

Image = npt.NDArray[Any]
DIAMETER = 0.6
GRID = (39, 54)
"""The field grid of SHAPE with a guard of 6 pixels: the next sizes without a prime factor above 13."""


def looked_up(pupil: Image, grid: tuple[int, int], oversampling: int = 1) -> Image:
    """The pupil on the grid's frequencies: the image on the square of side D, bilinearly; nothing on its boundary and
    beyond it. The oversampling is a factor."""
    v, u = np.meshgrid(*(2 * np.fft.fftfreq(n) * oversampling / DIAMETER for n in grid), indexing="ij")
    height, width = pupil.shape
    x = np.clip((u + 1) / 2 * width - 0.5, 0, width - 1)
    y = np.clip((v + 1) / 2 * height - 0.5, 0, height - 1)
    x0, y0 = x.astype(int), y.astype(int)
    x1, y1 = np.minimum(x0 + 1, width - 1), np.minimum(y0 + 1, height - 1)
    ax, ay = x - x0, y - y0
    upper = (1 - ax) * pupil[y0, x0] + ax * pupil[y0, x1]
    lower = (1 - ax) * pupil[y1, x0] + ax * pupil[y1, x1]
    inside = np.maximum(abs(u), abs(v)) < 1 - 1e-12
    return np.where(inside, ((1 - ay) * upper + ay * lower) * oversampling, 0)


def imaged(irradiance: Image, field: Image, pupil: Image) -> Image:
    """The intensity of one polarization: padding has the light of the nearest pixel, counted around the border."""
    height, width = irradiance.shape
    padded = irradiance
    for axis, (n, grid) in enumerate(zip((height, width), field.shape, strict=True)):
        place = np.arange(grid)
        nearest = np.where(place < n, place, np.where(place - n < (grid - n + 1) // 2, n - 1, 0))
        padded = np.take(padded, nearest, axis)
    light = np.fft.ifft2(np.fft.fft2(np.sqrt(padded) * field) * pupil)
    intensity: Image = abs(light[:height, :width]) ** 2
    return intensity


@pytest.fixture(scope="module")
def pupil() -> Image:
    """An apodized pupil with coma and more, 24 x 30 samples."""
    y, x = np.meshgrid(np.linspace(-1, 1, 24), np.linspace(-1, 1, 30), indexing="ij")
    made: Image = np.exp(2j * np.pi * (0.4 * x**3 - 0.3 * x * y + 0.25 * y**2) - 0.5 * (x**2 + y**2))
    return made


@pytest.fixture(scope="module")
def field() -> Image:
    """A field that nothing draws: a tilted wave with a dark stripe, and noise."""
    random = np.random.default_rng(9)
    y, x = np.meshgrid(*(np.arange(n) for n in GRID), indexing="ij")
    wave = np.exp(2j * np.pi * (0.06 * x - 0.11 * y)) * np.where(x % 9 == 4, 0, 1.3)
    return wave + 0.4 * (random.standard_normal(GRID) + 1j * random.standard_normal(GRID))


def error_of(got: Image, expected: Image) -> float:
    return float(np.linalg.norm(got - expected) / np.linalg.norm(expected))


def of_optics(context: clspeckle.Context, **more: Any) -> clspeckle.Pipeline:
    given: dict[str, Any] = {"guard_px": 6, "relative_diameter": DIAMETER, "output": "intensity", "context": context}
    return clspeckle.Pipeline.from_parameters(SHAPE, **{**given, **more})


@pytest.mark.parametrize("argument", ["pupil", "pupil_image"])
def test_a_complex_pupil_and_a_field_give_numpys_irradiance(
    context: clspeckle.Context, ideal: Image, pupil: Image, field: Image, argument: str
) -> None:
    """Relative L2 error below 2e-6, the bound of the engine (measured 3e-7); the same bits each time."""
    camera = of_optics(context, field=field, **{argument: pupil})
    assert camera.phase.grid_shape == GRID
    assert camera.phase.polarization_count == 1
    got = camera.render(ideal)
    assert error_of(got, imaged(ideal, field, looked_up(pupil, GRID))) < 2e-6
    assert np.array_equal(camera.render(ideal), got), "a field of the caller's own stays"
    assert np.array_equal(of_optics(context, field=field, pupil=pupil).render(ideal), got)
    # What the conjugate or the magnitude alone would give is far away: the test sees phases.
    for wrong in (np.conj(pupil), abs(pupil)):
        assert error_of(got, imaged(ideal, field, looked_up(wrong, GRID))) > 0.05
    assert not np.array_equal(camera.render(ideal, refresh="all"), got)
    assert np.allclose(camera.aperture.pupil(), looked_up(pupil, GRID), atol=1e-6)


def test_two_polarizations_and_oversampling(context: clspeckle.Context, ideal: Image, pupil: Image) -> None:
    grid = (77, 108)
    random = np.random.default_rng(10)
    fields = random.standard_normal((2, *grid)) + 1j * random.standard_normal((2, *grid))
    camera = of_optics(context, field=fields, pupil=pupil, oversampling=2, degree_of_polarization=0.3)
    assert camera.phase.grid_shape == grid
    each = []
    for z in fields:
        samples = imaged(np.repeat(np.repeat(ideal, 2, 0), 2, 1), z, looked_up(pupil, grid, 2))
        each.append(samples.reshape(SHAPE[0], 2, SHAPE[1], 2).mean(axis=(1, 3)))
    assert error_of(camera.render(ideal), 0.65 * each[0] + 0.35 * each[1]) < 2e-6


def test_a_complex_pupil_of_real_numbers_is_the_real_one(
    context: clspeckle.Context, ideal: Image, pupil: Image
) -> None:
    real = of_optics(context, seed=4, pupil=abs(pupil)).render(ideal)
    assert np.allclose(of_optics(context, seed=4, pupil=abs(pupil) + 0j).render(ideal), real, rtol=2e-5, atol=1e-6)


def test_aberrations_and_effects_add_to_it(context: clspeckle.Context, ideal: Image, pupil: Image) -> None:
    """The wavefront of defocus_waves over the same square, and the effect with as many waves."""
    v, u = np.meshgrid(*(2 * np.fft.fftfreq(n) / DIAMETER for n in GRID), indexing="ij")
    expected = looked_up(pupil, GRID) * np.exp(2j * np.pi * 0.4 * (u**2 + v**2))
    camera = of_optics(context, pupil=pupil, defocus_waves=0.4)
    assert np.allclose(camera.aperture.pupil(), expected, atol=2e-6)
    camera = of_optics(context, pupil=pupil)
    camera.set_effect("defocus", waves=0.4)
    assert np.allclose(camera.aperture.pupil(), expected, atol=2e-6)
    camera.clear_effect("defocus")
    assert np.allclose(camera.aperture.pupil(), looked_up(pupil, GRID), atol=1e-6)


def test_simulate_takes_both(context: clspeckle.Context, ideal: Image, pupil: Image, field: Image) -> None:
    given: dict[str, Any] = {"guard_px": 6, "relative_diameter": DIAMETER, "output": "intensity", "context": context}
    got = clspeckle.simulate(ideal, pupil=pupil, field=field, **given)
    assert error_of(got, imaged(ideal, field, looked_up(pupil, GRID))) < 2e-6
    both = clspeckle.simulate(np.stack([ideal, ideal]), pupil=pupil, field=field, **given)
    assert np.array_equal(both[0], got)
    assert np.array_equal(both[1], got)


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        ({"pupil": np.ones((3, 3)), "pupil_image": np.ones((3, 3))}, TypeError, "give one of them"),
        ({"pupil": np.full((4, 4), 0.8 + 0.8j)}, clspeckle.errors.InvalidDataError, "from 0 to 1; 16 pixels"),
        ({"pupil": np.full((4, 4), np.nan + 0j)}, clspeckle.errors.InvalidDataError, "magnitudes from 0 to 1"),
        ({"pupil": np.ones(4, complex)}, clspeckle.errors.InvalidArgumentError, r"expected \(height, width\)"),
        ({"pupil": np.full((4, 4), np.nan)}, clspeckle.errors.InvalidDataError, "^pupil must hold"),
        ({"pupil": []}, clspeckle.errors.InvalidArgumentError, "^pupil has shape"),
        ({"pupil_image": []}, clspeckle.errors.InvalidArgumentError, "^pupil_image has shape"),
        ({"pupil": np.zeros((4, 4), complex)}, clspeckle.errors.InvalidArgumentError, "passes nothing"),
        ({"field": np.ones(SHAPE)}, clspeckle.errors.InvalidArgumentError, r"shape \(32, 48\), expected \(39, 54\)"),
        ({"field": np.ones((3, *GRID))}, clspeckle.errors.InvalidArgumentError, "polarization_count"),
        ({"field": np.full(GRID, np.inf)}, clspeckle.errors.InvalidDataError, "finite numbers; 2106 pixels"),
        ({"field": np.full(GRID, "1")}, clspeckle.errors.InvalidFormatError, "expected complex64 or real numbers"),
        ({"field": np.ones(GRID), "dynamics": "continuous"}, clspeckle.errors.InvalidStateError, "make the phase so"),
        ({"field": np.ones(GRID), "degree_of_polarization": 0.5}, clspeckle.errors.InvalidArgumentError, "needs a ph"),
        ({"field": 3}, clspeckle.errors.InvalidArgumentError, "field has shape"),
    ],
)  # fmt: skip
def test_what_is_no_pupil_or_field(
    context: clspeckle.Context, arguments: dict[str, Any], kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=message):
        of_optics(context, **arguments)


def test_what_the_messages_advise_works(context: clspeckle.Context, ideal: Image, pupil: Image, field: Image) -> None:
    with pytest.raises(TypeError, match="and pupil_image was given, too; give one of them"):
        of_optics(context, pupil=pupil, pupil_image=pupil)
    of_optics(context, pupil=pupil).render(ideal)
    phase = clspeckle.Phase(SHAPE, guard_px=6, field="unit_phasor", polarization_count=1, context=context)
    with pytest.raises(clspeckle.errors.InvalidStateError, match="make the phase so"):
        phase.set_field(field)
    phase = clspeckle.Phase(
        SHAPE,
        guard_px=6,
        field="circular_gaussian",
        dynamics="replace",
        translate=False,
        polarization_count=1,
        context=context,
    )
    phase.set_field(field)
    assert np.array_equal(phase.field(0), field.astype(np.complex64))


def test_depolarization_keeps_a_field_or_is_refused(context: clspeckle.Context, ideal: Image, field: Image) -> None:
    """Before anything changes; with both polarizations the field is there before, with and after the effect."""
    effects: dict[str, Any] = {"depolarization": {"degree_of_polarization": 0.2}}
    advice = r"restored, of 1; make the phase with polarization_count 2 and restore a field of so many, or refresh the"
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match=advice):
        of_optics(context, field=field, effects=effects)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match=advice):
        clspeckle.simulate(ideal, guard_px=6, relative_diameter=DIAMETER, field=field, effects=effects, context=context)
    camera = of_optics(context, field=field)
    before = camera.render(ideal)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match=advice):
        camera.set_effect("depolarization")
    assert camera.effects == {}
    assert np.array_equal(camera.render(ideal), before)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match=advice):
        camera.set_effects({"defocus": {"waves": 0.8}, **effects})
    assert camera.effects == {}
    assert np.array_equal(camera.render(ideal), before)
    # A mask draws a part of it; the rest is the caller's.
    camera.render(ideal, refresh=np.eye(*SHAPE) > 0)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match=advice):
        camera.set_effect("depolarization")
    camera.phase.refresh(0)
    camera.set_effect("depolarization")
    camera = of_optics(context, field=field)
    camera.render(ideal, refresh="all")
    camera.set_effect("depolarization")

    both = np.stack([field, 1j * field[::-1]])
    each = [of_optics(context, field=z).render(ideal) for z in both]
    camera = of_optics(context, field=both, effects=effects)
    assert error_of(camera.render(ideal), 0.6 * each[0] + 0.4 * each[1]) < 2e-6
    camera.clear_effect()
    assert np.array_equal(camera.render(ideal), each[0])
    # Where the effect brought the second polarization, the first is left without it.
    camera = of_optics(context, polarization_count=1, effects=effects)
    camera.phase.set_field(both)
    assert error_of(camera.render(ideal), 0.6 * each[0] + 0.4 * each[1]) < 2e-6
    camera.clear_effect()
    assert np.array_equal(camera.render(ideal), each[0])


@pytest.mark.parametrize("drawn", [False, True], ids=["a field of one's own", "a drawn one"])
def test_what_save_gave_and_restore_took_stays(
    context: clspeckle.Context, ideal: Image, field: Image, drawn: bool
) -> None:
    """Effects do not lose it, warm_up() and frames neither; with a refresh of everything it is gone."""
    camera = of_optics(context, polarization_count=1)
    if drawn:
        camera.phase.refresh(5)
    else:
        camera.phase.set_field(field)
    kept, expected = camera.phase.save(), camera.render(ideal)

    other = of_optics(context, polarization_count=1)
    other.phase.restore(kept)
    for _ in range(2):
        with pytest.raises(clspeckle.errors.InvalidArgumentError, match="a field that was restored, of 1"):
            other.set_effect("depolarization")
        other.warm_up(refresh="all")
        assert np.array_equal(other.render(ideal), expected)
        other.phase.restore(other.phase.save())
    other.set_effect("defocus", waves=0)
    assert np.array_equal(other.render(ideal), expected)
    other.phase.refresh(5)
    other.set_effect("depolarization")
    assert other.phase.polarization_count == 2

    # Two of them: the effect shows them, and without it the first is there, as it was.
    both = of_optics(context)
    both.phase.refresh(5)
    two = both.phase.save()
    assert both.phase.polarization_count == 2
    third = of_optics(context, polarization_count=1, effects={"depolarization": {}})
    third.phase.restore(two)
    third.clear_effect()
    assert third.phase.polarization_count == 1
    assert np.array_equal(third.phase.save(), two[: two.size // 2])
    third.set_effect("depolarization")
    assert np.array_equal(third.phase.save(), two), "nothing has drawn meanwhile"
    third.clear_effect()
    third.phase.refresh(6, mask=np.eye(*SHAPE) > 0)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="of 1"):
        third.set_effect("depolarization")


def test_a_smooth_field_is_divided_by_the_oversampling(context: clspeckle.Context) -> None:
    """It passes the pupil whole. Whole numbers are a field, too."""
    for oversampling in (1, 2, 3):
        camera = of_optics(context, oversampling=oversampling, polarization_count=1)
        ones = np.ones(camera.phase.grid_shape, int)
        camera.phase.set_field(ones)
        flat = np.ones(SHAPE, np.float32)
        assert np.allclose(camera.render(flat), oversampling**2, rtol=1e-5)
        camera.phase.set_field(ones / oversampling)
        assert np.allclose(camera.render(flat), 1, rtol=1e-5)


def test_simulate_says_what_it_does_not_take(context: clspeckle.Context, ideal: Image) -> None:
    simulate: Any = clspeckle.simulate
    with pytest.raises(TypeError, match=r"effects must map ids to parameters.*got int 5"):
        simulate(ideal, effects=5, context=context)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="polarization_count is 0"):
        simulate(ideal, polarization_count=0, context=context)
    materials = [clspeckle.Material()]
    with pytest.raises(TypeError, match=r"without materials; use clspeckle.Pipeline.from_parameters\(shape, materials"):
        simulate(ideal, materials=materials, context=context)
    camera = clspeckle.Pipeline.from_parameters(SHAPE, materials=materials, context=context)
    assert camera.render(ideal, material=np.zeros(SHAPE, np.uint8)).any()


def own(
    body: str, point: str = "intensity", name: str = "own", weak_strong: tuple[float, ...] = (1, 3, -9, 9)
) -> clspeckle.Hypothesis:
    head = "float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y)"
    return clspeckle.Hypothesis(name, "optics", f"{head} {{ {body} }}", {"by": weak_strong}, point=point)


HALF = "return x < 24 ? 0.5f * hypothesis_pixel(frame, x, y) : values.by * hypothesis_pixel(frame, x, y);"


@pytest.mark.parametrize("lens", [{}, {"k1": -0.05}, {"glare_fraction": 0.2}], ids=["no lens", "distortion", "glare"])
def test_an_effect_on_the_ideal_image_is_an_ideal_image_so_changed(
    context: clspeckle.Context, ideal: Image, lens: dict[str, float]
) -> None:
    factor = np.where(np.arange(SHAPE[1]) < 24, 0.5, 2).astype(np.float32)
    for more in ({}, {"output": "codes", "exposure_gain_dn": 200}):
        expected = of_optics(context, seed=3, **lens, **more).render(ideal * factor)
        camera = of_optics(context, seed=3, **lens, **more)
        plain = camera.render(ideal, frame_index=0, refresh="all")
        camera.set_effect(own(HALF, "irradiance"))  # the middle of 1 and 3
        assert camera.effects == {"own": {"by": 2}}
        got = camera.render(ideal, frame_index=0, refresh="all")
        assert np.array_equal(got, expected)
        assert not np.array_equal(got, plain)
        led = camera.render(ideal, frame_index=0, illumination="incoherent")
        camera.clear_effect("own")
        assert np.array_equal(camera.render(ideal, frame_index=0, refresh="all"), plain)
        assert np.array_equal(camera.render(ideal * factor, frame_index=0, illumination="incoherent"), led)


def test_an_effect_behind_the_lens_and_one_on_codes(context: clspeckle.Context, ideal: Image) -> None:
    """Against NumPy: light without a sensor, the sensor's codes of that light, and codes changed and rounded."""
    sensor: dict[str, Any] = {"output": "codes", "exposure_gain_dn": 200, "read_noise_dn": 2, "seed": 3}
    ramp = own("return hypothesis_pixel(frame, x, y) * (1 + 0.25f * x) + values.by * y;", weak_strong=(0, 1))
    shift = own("return hypothesis_pixel(frame, x + 1, y) + values.by;", "codes", "shift", (7.4, 7.4, 0, 2000))
    rows, columns = (axis.astype(np.float32) for axis in np.mgrid[: SHAPE[0], : SHAPE[1]])
    light = of_optics(context, seed=3)
    plain = light.render(ideal)
    light.set_effect(ramp, by=0.5)
    changed = light.render(ideal, frame_index=0, refresh="all")
    assert np.allclose(changed, plain * (1 + 0.25 * columns) + 0.5 * rows, rtol=1e-6)
    for bits, dtype in ((10, np.uint16), (8, np.uint8)):
        camera = of_optics(context, **{**sensor, "bits": bits})
        before = camera.render(ideal, frame_index=0, refresh="all", dtype=dtype)
        camera.set_effect(ramp, by=0.5)
        assert camera.sensor is not None
        expected = camera.sensor.expose(changed, frame_index=0, dtype=dtype)
        lit = camera.render(ideal, frame_index=0, refresh="all", dtype=dtype)
        assert np.array_equal(lit, expected)
        camera.set_effect(shift)
        moved = np.concatenate([lit[:, 1:], lit[:, -1:]], axis=1).astype(np.float32)
        top = 2**bits - 1
        got = camera.render(ideal, frame_index=0, refresh="all", dtype=dtype)
        assert np.array_equal(got, np.clip(np.rint(moved + np.float32(7.4)), 0, top))
        assert (got == top).any()
        # In the dark light has nothing to change, codes have.
        dark = camera.render(frame_index=1, illumination="dark", dtype=dtype)
        camera.clear_effect(shift)
        darker = camera.render(frame_index=1, illumination="dark", dtype=dtype)
        assert np.array_equal(dark[:, :-1], np.rint(darker[:, 1:].astype(np.float32) + np.float32(7.4)))
        camera.clear_effect()
        assert camera.effects == {}
        assert np.array_equal(camera.render(ideal, frame_index=0, refresh="all", dtype=dtype), before)
    light.render(illumination="dark")
    assert not light.render(illumination="dark").any()


def test_own_effects_work_one_after_the_other(context: clspeckle.Context, ideal: Image) -> None:
    camera = of_optics(context, seed=3)
    plain = camera.render(ideal)
    add = own("return hypothesis_pixel(frame, x, y) + values.by;", name="add")
    double = own("return values.by * hypothesis_pixel(frame, x, y);", name="double")
    for effect in (add, double):
        camera.set_effect(effect, by=2)
    assert np.array_equal(camera.render(ideal), np.float32(2) * (plain + np.float32(2)))
    camera.set_effect(add, by=3)  # keeps its place
    camera.set_effect("vignetting", corner_loss=0.3)
    with_both = camera.render(ideal)
    camera.clear_effect(add)
    camera.clear_effect(double)
    camera.clear_effect(double)
    assert np.array_equal(with_both, np.float32(2) * (camera.render(ideal) + np.float32(3)))
    assert list(camera.effects) == ["vignetting"]


def test_what_an_own_effect_draws(context: clspeckle.Context, ideal: Image) -> None:
    """Standard normal numbers: 40 frames of 1,536. By chance a mean beyond 5 standard errors, or a spread beyond 5 of
    its own, comes once in a million; numbers that were all the same, or uniform, would be far beyond."""
    new = own("return hypothesis_pixel(frame, x, y) + values.by * hypothesis_normal(frame, x, y, 0);")
    fixed = own("return hypothesis_pixel(frame, x, y) + values.by * hypothesis_fixed_normal(frame, x, y, 0);")
    cameras = [of_optics(context, seed=3) for _ in range(3)]
    for camera, effect in zip(cameras[1:], (new, fixed), strict=True):
        camera.set_effect(effect, by=1)
    plain = cameras[0].render(ideal)
    frames = [np.stack([camera.render(ideal, frame_index=i) - plain for i in range(40)]) for camera in cameras[1:]]
    count = frames[0].size
    assert abs(frames[0].mean()) < 5 / np.sqrt(count)
    assert abs(frames[0].std() - 1) < 5 / np.sqrt(2 * count)
    assert len(np.unique(frames[0])) > 0.9 * count
    assert np.ptp(frames[1], axis=0).max() < 1e-5
    assert abs(frames[1][0].std() - 1) < 5 / np.sqrt(2 * plain.size)
    again = of_optics(context, seed=3)
    again.set_effect(new, by=1)
    again.render(ideal, frame_index=0)
    assert np.array_equal(again.render(ideal, frame_index=17) - plain, frames[0][17])
    far = again.render(ideal, frame_index=2**32 + 17) - plain
    assert abs(np.corrcoef(far.ravel(), frames[0][17].ravel())[0, 1]) < 5 / np.sqrt(plain.size)
    other = of_optics(context, seed=4)
    without = other.render(ideal)
    other.set_effect(fixed, by=1)
    pattern = other.render(ideal) - without
    assert abs(np.corrcoef(pattern.ravel(), frames[1][0].ravel())[0, 1]) < 5 / np.sqrt(plain.size)


def test_an_own_effect_knows_its_camera(context: clspeckle.Context, ideal: Image) -> None:
    body = """
        const float facts[] = {frame.width, frame.height, frame.bits, frame.scene, frame.frame_index, frame.f_number,
                               1e6f * frame.pixel_pitch_m, 1e9f * frame.wavelength_m, values.by};
        return facts[x % 9];
    """
    dots = clspeckle.Dots(SHAPE, [(20, 16)], context=context)
    for of_dots, scene in ((None, 1), (dots, 3)):
        camera = clspeckle.Pipeline.from_parameters(
            SHAPE, dots=of_dots, f_number=4, pixel_pitch_m=3e-6, wavelength_m=850e-9, bits=10, context=context
        )
        camera.set_effect(own(body, "codes"), by=5)
        told = camera.render(None if of_dots else ideal, frame_index=7)[0, :9]
        assert told.tolist() == [48, 32, 10, scene, 7, 4, 3, 850, 5]


def test_what_is_no_effect_for_a_pipeline(context: clspeckle.Context, ideal: Image) -> None:
    camera = of_optics(context, seed=3)
    plain = camera.render(ideal)
    good = own("return values.by * hypothesis_pixel(frame, x, y);")
    function = clspeckle.Hypothesis("own", "optics", lambda pixels, **_: pixels, {"by": (1, 3)})
    with pytest.raises(TypeError, match="give it OpenCL source, or call the function on the frames"):
        camera.set_effect(function)
    with pytest.raises(TypeError, match="the effect own has no parameter 'bye'; did you mean"):
        camera.set_effect(good, bye=1)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match='by of the hypothesis "own" is 10, it must be -9'):
        camera.set_effect(good, by=10)
    with pytest.raises(clspeckle.errors.BuildError, match="does not build") as told:
        camera.set_effect(own("return no_such_name;"))
    assert "no_such_name" in str(told.value.build_log)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="has no sensor; make it with one"):
        camera.set_effect(own("return 1;", "codes"))
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="#include"):
        camera.set_effect(own('return 1; }\n#include "x"\nfloat f(void) { return 1;'))
    defocus = own("return 1;", name="defocus")
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="has the id of an effect of the catalogue"):
        camera.set_effect(defocus)
    assert camera.effects == {}
    assert np.array_equal(camera.render(ideal), plain)
    coded = of_optics(context, output="codes")
    coded.set_effect(own("return 1;", "codes"))
    with pytest.raises(clspeckle.errors.InvalidFormatError, match="use uint16, or uint8"):
        coded.render(ideal, dtype=np.float32)
    assert (coded.render(ideal, dtype=np.uint16) == 1).all(), "the advice works"
    dim = of_optics(context, seed=3)
    dim.set_effect(own("return x == 5 ? -1.0f : hypothesis_pixel(frame, x, y);", "irradiance"))
    dim.render(ideal)
    with pytest.raises(clspeckle.errors.InvalidDataError, match="irradiance: 0 NaN or infinite and 32 negative"):
        dim.check()
