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
        ({"pupil": np.zeros((4, 4), complex)}, clspeckle.errors.InvalidArgumentError, "passes nothing"),
        ({"field": np.ones(SHAPE)}, clspeckle.errors.InvalidArgumentError, r"shape \(32, 48\), expected \(39, 54\)"),
        ({"field": np.ones((3, *GRID))}, clspeckle.errors.InvalidArgumentError, "polarization_count"),
        ({"field": np.full(GRID, np.inf)}, clspeckle.errors.InvalidDataError, "finite numbers; 2106 pixels"),
        ({"field": np.ones(GRID, int)}, clspeckle.errors.InvalidFormatError, "expected complex64 or real numbers"),
        ({"field": np.ones(GRID), "dynamics": "continuous"}, clspeckle.errors.InvalidStateError, "make the phase so"),
        ({"field": np.ones(GRID), "degree_of_polarization": 0.5}, clspeckle.errors.InvalidArgumentError, "needs a ph"),
        ({"field": 3}, clspeckle.errors.InvalidFormatError, "expected complex64 or real numbers"),
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
