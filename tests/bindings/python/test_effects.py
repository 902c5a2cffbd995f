"""The catalogue of effects: each changes the frame, is what its stage's parameters make, and goes without a trace."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import clspeckle
from clspeckle import errors

SHAPE = (64, 96)
"""Large enough that the grid holds a defocused point."""

KERNELS = Path(__file__).resolve().parents[3] / "kernels"

IDS = [effect.id for effect in clspeckle.effects()]
NEEDS_DOTS = [effect.id for effect in clspeckle.effects() if "stages/dots.cl" in effect.kernel]
NEEDS_A_SENSOR = [
    effect.id
    for effect in clspeckle.effects()
    if effect.stage == "sensor" and effect.kernel.startswith("stages/sensor")
]


def lattice(context: clspeckle.Context, **options: Any) -> clspeckle.Dots:
    y, x = np.mgrid[6 : SHAPE[0] : 12, 6 : SHAPE[1] : 12]
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    return clspeckle.Dots(SHAPE, points, sigma_px=2.0, scale=1.5, context=context, **options)


def make(context: clspeckle.Context, dots: clspeckle.Dots | None = None, **parameters: Any) -> clspeckle.Pipeline:
    options: dict[str, Any] = {"seed": 11, "exposure_gain_dn": 400.0, "normalization": "unit_mean", **parameters}
    return clspeckle.Pipeline.from_parameters(SHAPE, dots=dots or lattice(context), context=context, **options)


def frames(camera: clspeckle.Pipeline) -> npt.NDArray[Any]:
    """A frame drawn anew, two of a scene at rest, and another one drawn anew: each effect shows in one of them."""
    refresh = ("all", None, None, "all")
    assert camera.sensor is not None
    camera.sensor.reset_lag()
    return np.stack([camera.render(frame_index=index, refresh=kind) for index, kind in enumerate(refresh)])


@pytest.fixture(scope="module")
def camera(context: clspeckle.Context) -> Iterator[clspeckle.Pipeline]:
    with make(context) as made:
        yield made


@pytest.fixture(scope="module")
def plain(camera: clspeckle.Pipeline) -> npt.NDArray[Any]:
    result = frames(camera)
    np.testing.assert_array_equal(frames(camera), result)
    assert result.std() > 20, "an image without structure would agree with anything"
    return result


def assert_names_what_exists(kernel: str) -> None:
    """``file: function (OPTION), file`` of the kernels' folder: the file is there, and says the other two."""
    for part in kernel.split(", "):
        match = re.fullmatch(r"([\w/]+\.(?:cl|h))(?:: (\w+))?(?: \((\w+)\))?", part)
        assert match, kernel
        source = (KERNELS / match[1]).read_text(encoding="utf-8")
        for word in filter(None, match.groups()[1:]):
            assert re.search(rf"\b{word}\b", source), f"{match[1]} has no {word}"


def test_the_catalogue() -> None:
    catalogue = clspeckle.effects()
    assert len(catalogue) >= 30
    assert len(set(IDS)) == len(IDS)
    for effect in catalogue:
        assert re.fullmatch(r"[a-z_]+", effect.id)
        assert effect.stage in ("laser", "doe", "surface", "motion", "optics", "sensor")
        assert effect.summary
        assert_names_what_exists(effect.kernel)
        assert 1 <= len(effect.parameters) <= 4
        for parameter in effect.parameters:
            assert re.fullmatch(r"[a-z0-9_]+", parameter.name)
            assert parameter.unit
            for value in (parameter.weak, parameter.strong, parameter.middle):
                assert parameter.minimum <= value <= parameter.maximum, effect


def test_whole_numbers_are_those_that_take_no_fraction(camera: clspeckle.Pipeline) -> None:
    for effect in clspeckle.effects():
        for parameter in effect.parameters if effect.id not in NEEDS_DOTS else ():
            fraction = math.floor(parameter.middle) + 0.5
            if not parameter.minimum <= fraction <= parameter.maximum:
                continue
            if parameter.whole:
                with pytest.raises(errors.InvalidArgumentError, match="must be a whole number"):
                    camera.set_effect(effect.id, **{parameter.name: fraction})
            else:
                camera.set_effect(effect.id, **{parameter.name: fraction})
                camera.clear_effect()
    assert {p.name for e in clspeckle.effects() for p in e.parameters if p.whole} >= {"bits", "centered"}


@pytest.mark.parametrize("effect", IDS)
def test_on_changes_the_frames_and_off_restores_them(
    camera: clspeckle.Pipeline, plain: npt.NDArray[Any], effect: str
) -> None:
    camera.set_effect(effect)
    assert list(camera.effects) == [effect]
    middle = frames(camera)
    assert not np.array_equal(middle, plain)
    (info,) = (entry for entry in clspeckle.effects() if entry.id == effect)
    camera.set_effect(info, **{parameter.name: parameter.middle for parameter in info.parameters})
    np.testing.assert_array_equal(frames(camera), middle)
    camera.clear_effect(effect)
    assert camera.effects == {}
    np.testing.assert_array_equal(frames(camera), plain)


SAME: list[tuple[str, dict[str, float], dict[str, Any]]] = [
    ("defocus", {"waves": 0.8}, {"defocus_waves": 0.8}),
    ("pupil_obstruction", {"radius_ratio": 0.4}, {"obstruction_ratio": 0.4}),
    ("aperture_mismatch", {"f_number_ratio": 1.25}, {"f_number": 5.6 * 1.25}),
    ("pixel_integration", {"fill_factor": 0.9}, {"fill_factor": 0.9}),
    ("depolarization", {"degree_of_polarization": 0.3}, {"degree_of_polarization": 0.3}),
    ("low_roughness", {"coherent_fraction": 0.3}, {"coherent_fraction": 0.3}),
    (
        "subsurface_scattering",
        {"length_px": 2.0, "fraction": 0.5},
        {"subsurface_length_px": 2.0, "subsurface_fraction": 0.5},
    ),
    ("power_flicker", {"sigma": 0.1}, {"power_flicker": 0.1}),
    ("motion_decorrelation", {"lags": 1.5, "correlation_law": 0.0}, {"exposure_path": 1.5}),
    (
        "motion_decorrelation",
        {"lags": 1.5, "correlation_law": 1.0},
        {"exposure_path": 1.5, "exposure_correlation": "gaussian"},
    ),
    ("surface_boiling", {"correlation_frames": 3.0}, {"boiling_correlation_frames": 3.0}),
    (
        "airflow",
        {"rms_rad": 0.7, "scale_px": 5.0, "correlation_frames": 8.0, "correlation_law": 0.0},
        {"airflow_rms_rad": 0.7, "airflow_scale_px": 5.0, "airflow_correlation_frames": 8.0},
    ),
    (
        "airflow",
        {"rms_rad": 0.7, "scale_px": 5.0, "correlation_frames": 8.0, "correlation_law": 1.0},
        {
            "airflow_rms_rad": 0.7,
            "airflow_scale_px": 5.0,
            "airflow_correlation_frames": math.inf,
            "airflow_wind_px": 0.625,
        },
    ),
    ("vibration", {"rms_px": 0.2}, {"vibration_rms_px": 0.2}),
    ("glare", {"fraction": 0.2, "scale_px": 4.0}, {"glare_fraction": 0.2, "glare_scale_px": 4.0}),
    ("vignetting", {"corner_loss": 0.4}, {"vignetting_corner_loss": 0.4}),
    ("lens_distortion", {"k1": 0.03}, {"k1": 0.03}),
    ("ambient_light", {"level_dn": 40.0}, {"ambient": 0.1}),
    ("shot_noise", {"dn_per_electron": 0.2}, {"shot_noise": True, "conversion_gain_dn_per_e": 0.2}),
    ("crosstalk", {"fraction": 0.2}, {"crosstalk_fraction": 0.2}),
    ("prnu", {"sigma": 0.03}, {"prnu": 0.03}),
    ("dsnu", {"sigma_dn": 4.0}, {"dsnu_dn": 4.0}),
    ("column_fpn", {"sigma_dn": 3.0}, {"column_offset_dn": 3.0}),
    ("row_noise", {"sigma_dn": 3.0}, {"row_noise_dn": 3.0}),
    ("row_fpn", {"sigma_dn": 3.0}, {"row_offset_dn": 3.0}),
    (
        "periodic_offset",
        {"amplitude_dn": 3.0, "frequency_x": 0.2, "frequency_y": -0.1},
        {"periodic_offset_dn": 3.0, "periodic_frequency_x": 0.2, "periodic_frequency_y": -0.1},
    ),
    ("pixel_dull", {"fraction": 0.01}, {"dull_pixel_fraction": 0.01}),
    (
        "telegraph_noise",
        {"fraction": 0.05, "step_dn": 40.0, "centered": 0.0},
        {"telegraph_fraction": 0.05, "telegraph_step_dn": 40.0},
    ),
    (
        "telegraph_noise",
        {"fraction": 0.05, "step_dn": 40.0, "centered": 1.0},
        {"telegraph_fraction": 0.05, "telegraph_step_dn": 40.0, "telegraph_centered": True},
    ),
    (
        "dark_current",
        {"rate_dn_per_ms": 0.5},
        {"conversion_gain_dn_per_e": 1.0, "dark_current_e_per_s": 500.0},
    ),
    ("column_noise", {"sigma_dn": 3.0}, {"column_noise_dn": 3.0}),
    ("correlated_read_noise", {"correlation": -0.2}, {"read_noise_correlation": -0.2}),
    ("nonlinearity", {"cubic": 0.05, "power": 3.0}, {"cubic_nonlinearity": 0.05}),
    ("nonlinearity", {"cubic": 0.05, "power": 1.0}, {"cubic_nonlinearity": 0.05, "nonlinearity_power": 1}),
    ("hot_pixels", {"fraction": 0.01, "mean_dn": 200.0}, {"hot_pixel_fraction": 0.01, "hot_pixel_mean_dn": 200.0}),
    ("full_well", {"level_dn": 500.0}, {"saturation_dn": 500.0}),
    ("adc_bits", {"bits": 6.0}, {"effective_bits": 6}),
    (
        "differential_nonlinearity",
        {"amplitude_lsb": 0.3, "period_codes": 8.0, "widest_code": 2.5},
        {"code_width_wave": 0.3, "code_width_period": 8.0, "widest_code": 2.5},
    ),
    ("gamma", {"gamma": 0.8}, {"gamma": 0.8}),
    ("image_lag", {"fraction": 0.2}, {"lag_fraction": 0.2}),
    ("bayer_mismatch", {"delta": 0.05, "green_diagonal": 0.0}, {"mosaic_gain": (1.0, 0.95, 1.05, 1.0)}),
    ("bayer_mismatch", {"delta": 0.05, "green_diagonal": 1.0}, {"mosaic_gain": (0.95, 1.0, 1.0, 1.05)}),
]


@pytest.mark.parametrize(("effect", "values", "parameters"), SAME, ids=[case[0] for case in SAME])
def test_an_effect_is_what_its_stages_parameters_make(
    context: clspeckle.Context,
    camera: clspeckle.Pipeline,
    effect: str,
    values: dict[str, float],
    parameters: dict[str, Any],
) -> None:
    camera.set_effect(effect, **values)
    assert camera.effects == {effect: values}
    got = frames(camera)
    camera.clear_effect()
    with make(context, **parameters) as other:
        np.testing.assert_array_equal(got, frames(other))
    with make(context, effects={effect: values}) as another:
        np.testing.assert_array_equal(got, frames(another))


@pytest.mark.parametrize(("direction", "offset"), [(0, (6.0, 6.0)), (1, (6.0, 0.0)), (2, (0.0, 6.0))])
def test_ghosts_lie_half_way_along_the_lattice(
    context: clspeckle.Context, camera: clspeckle.Pipeline, direction: int, offset: tuple[float, float]
) -> None:
    camera.set_effect("ghost_dots", relative_intensity=0.2, lattice_direction=direction)
    got = frames(camera)
    camera.clear_effect()
    with (
        lattice(context, ghost_relative_intensity=0.2, ghost_offset_px=offset) as dots,
        make(context, dots) as other,
    ):
        np.testing.assert_array_equal(got, frames(other))


def test_several_effects_in_any_order(camera: clspeckle.Pipeline, plain: npt.NDArray[Any]) -> None:
    effects = {"glare": {"fraction": 0.1}, "defocus": {"waves": 0.4}, "prnu": {"sigma": 0.02}}
    for effect, values in effects.items():
        camera.set_effect(effect, **values)
    all_of_them = frames(camera)
    assert camera.effects["glare"] == {"fraction": 0.1, "scale_px": 6.0}, "what is left out takes the middle"
    camera.clear_effect("prnu")
    without = frames(camera)
    assert not np.array_equal(without, all_of_them)
    camera.clear_effect()
    np.testing.assert_array_equal(frames(camera), plain)
    for effect in reversed(effects):
        camera.set_effect(effect, **effects[effect])
    np.testing.assert_array_equal(frames(camera), all_of_them)
    camera.clear_effect("prnu")
    camera.clear_effect("prnu")  # one that is off stays off
    np.testing.assert_array_equal(frames(camera), without)
    camera.clear_effect()
    np.testing.assert_array_equal(frames(camera), plain)


@pytest.mark.parametrize(
    ("options", "refused"),
    [
        ({"polarization_count": 1}, {"depolarization": {}, "aperture_mismatch": {"f_number_ratio": 0.1}}),
        ({"field": "unit_phasor"}, {"row_noise": {}, "surface_boiling": {}}),
        ({"field": "unit_phasor", "polarization_count": 1}, {"depolarization": {}, "surface_boiling": {}}),
    ],
)
def test_a_refusal_leaves_what_frames_remember(
    context: clspeckle.Context, options: dict[str, Any], refused: dict[str, Any]
) -> None:
    """The surface's state, and what a frame leaves behind for the next one."""
    light = np.full((48, 64), 0.3, np.float32)

    def begun() -> clspeckle.Pipeline:
        made = clspeckle.Pipeline.from_parameters(light.shape, seed=3, read_noise_dn=0.0, context=context, **options)
        made.set_effect("image_lag", fraction=0.5)
        made.render(light, frame_index=0)
        return made

    one, other = begun(), begun()
    state = one.phase.save()
    with pytest.raises(errors.InvalidArgumentError):
        one.set_effects(refused)
    np.testing.assert_array_equal(one.phase.save(), state)
    for level in (0.2, 0.5):
        np.testing.assert_array_equal(one.render(level * light), other.render(level * light))


def test_a_warm_up_leaves_a_restored_state(context: clspeckle.Context) -> None:
    """Of which depolarization takes the second polarization up again."""
    light = np.full((48, 64), 0.3, np.float32)
    camera = clspeckle.Pipeline.from_parameters(light.shape, seed=3, polarization_count=1, context=context)
    camera.set_effect("depolarization")
    camera.render(light)
    state = camera.phase.save()
    camera.phase.restore(state)
    camera.clear_effect("depolarization")
    camera.warm_up(light)
    camera.set_effect("depolarization")
    np.testing.assert_array_equal(camera.phase.save(), state)


def test_several_effects_at_once_or_none(camera: clspeckle.Pipeline, plain: npt.NDArray[Any]) -> None:
    effects: dict[str, Any] = {"glare": {"fraction": 0.1}, "defocus": None, "prnu": {"sigma": 0.02}}
    camera.set_effect("vignetting")
    camera.set_effects(effects)
    assert camera.effects["glare"] == {"fraction": 0.1, "scale_px": 6.0}, "what is left out takes the middle"
    assert list(camera.effects) == ["vignetting", *effects]
    together = frames(camera)
    for refused, kind in [
        ({"defocus": {"waves": 0.1}, "glare": {"fraction": -1}}, errors.InvalidArgumentError),
        ({"defocus": {"waves": 0.1}, "smear": {}}, errors.InvalidArgumentError),
        ({"defocus": {"waves": 0.1}, "glare": {"fractions": 1}}, TypeError),
        ({"defocus": {"waves": 0.1}, "glare": 0.1}, TypeError),
        ({"defocus": {"waves": 0.1}, "aperture_mismatch": {"f_number_ratio": 0.1}}, errors.InvalidArgumentError),
        (["defocus"], TypeError),
    ]:
        before = camera.effects
        with pytest.raises(kind):
            camera.set_effects(refused)  # type: ignore[arg-type]
        assert camera.effects == before
    np.testing.assert_array_equal(frames(camera), together)
    camera.set_effects({})
    camera.clear_effect()
    np.testing.assert_array_equal(frames(camera), plain)
    for effect, values in reversed(effects.items()):
        camera.set_effect(effect, **(values or {}))
    camera.set_effect("vignetting")
    np.testing.assert_array_equal(frames(camera), together)
    camera.clear_effect()


def test_the_exposure_may_change_under_an_effect(camera: clspeckle.Pipeline, plain: npt.NDArray[Any]) -> None:
    assert camera.sensor is not None
    camera.set_effect("vignetting")
    camera.sensor.exposure_gain_dn = 200.0
    camera.clear_effect()
    assert frames(camera).mean() < plain.mean() - 5
    camera.sensor.exposure_gain_dn = 400.0
    np.testing.assert_array_equal(frames(camera), plain)


def test_pupil_and_polarizations_follow_the_effects(context: clspeckle.Context) -> None:
    camera = make(context, polarization_count=1)
    assert camera.aperture.pupil().dtype == np.float32
    camera.set_effect("defocus", waves=0.5)
    pupil = camera.aperture.pupil()
    assert pupil.dtype == np.complex64
    assert np.abs(pupil.imag).max() > 0.1
    camera.set_effect("depolarization", degree_of_polarization=0.0)
    assert camera.phase.polarization_count == 2
    camera.render()
    camera.clear_effect()
    assert camera.aperture.pupil().dtype == np.float32
    assert camera.phase.polarization_count == 1
    camera.render()


@pytest.mark.parametrize("effect", ["image_lag", "airflow", "surface_boiling"])
def test_a_warm_up_leaves_nothing(context: clspeckle.Context, effect: str) -> None:
    with make(context, effects={effect: None}) as cold, make(context, effects={effect: None}) as warm:
        warm.warm_up()
        refresh = (None, None, "all")
        for index, kind in enumerate(refresh):
            expected = cold.render(frame_index=index, refresh=kind)
            np.testing.assert_array_equal(warm.render(frame_index=index, refresh=kind), expected)


def test_simulate_takes_effects(context: clspeckle.Context) -> None:
    ideal = np.random.default_rng(3).random((3, *SHAPE), np.float32)
    options: dict[str, Any] = {"seed": 2, "context": context}
    plain = clspeckle.simulate(ideal, **options)
    for effect in ("defocus", "image_lag", "airflow", "surface_boiling"):
        first = clspeckle.simulate(ideal, effects={effect: {}}, **options)
        assert not np.array_equal(first, plain)
        # The second call may get the camera of the first one, with all that it remembers.
        np.testing.assert_array_equal(clspeckle.simulate(ideal, effects={effect: {}}, **options), first)
    np.testing.assert_array_equal(clspeckle.simulate(ideal, **options), plain)


# --- Bad input ---


def test_unknown_effects_and_parameters(camera: clspeckle.Pipeline, plain: npt.NDArray[Any]) -> None:
    with pytest.raises(errors.InvalidArgumentError, match=r"no effect 'defocsu'.*did you mean \"defocus\""):
        camera.set_effect("defocsu")
    with pytest.raises(errors.InvalidArgumentError, match=r"no effect 'xyzzy'; the effects are linewidth"):
        camera.set_effect("xyzzy")
    with pytest.raises(errors.InvalidArgumentError, match="no effect"):
        camera.clear_effect("glar")
    with pytest.raises(errors.InvalidArgumentError, match="no effect ''"):
        camera.clear_effect("")
    with pytest.raises(TypeError, match=r"defocus has no parameter 'wave'; did you mean \"waves\""):
        camera.set_effect("defocus", wave=1)
    with pytest.raises(TypeError, match="waves must be a number"):
        camera.set_effect("defocus", waves="0.5")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="effect must be the id"):
        camera.set_effect(7)  # type: ignore[arg-type]
    assert camera.effects == {}
    np.testing.assert_array_equal(frames(camera), plain)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300, -1e300])
@pytest.mark.parametrize("effect", IDS)
def test_values_out_of_range(camera: clspeckle.Pipeline, effect: str, value: float) -> None:
    (info,) = (entry for entry in clspeckle.effects() if entry.id == effect)
    for parameter in info.parameters:
        with pytest.raises(errors.InvalidArgumentError, match=f"{parameter.name} of the effect {effect} .* it must be"):
            camera.set_effect(effect, **{parameter.name: value})
    assert camera.effects == {}


def test_after_refused_effects_everything_is_as_it_was(camera: clspeckle.Pipeline, plain: npt.NDArray[Any]) -> None:
    camera.set_effect("gamma", gamma=0.8)
    with_gamma = frames(camera)
    # In range, but the grid does not hold so wide a point.
    with pytest.raises(errors.InvalidArgumentError, match="waves"):
        camera.set_effect("defocus", waves=90.0)
    assert camera.effects == {"gamma": {"gamma": 0.8}}
    np.testing.assert_array_equal(frames(camera), with_gamma)
    camera.clear_effect()
    np.testing.assert_array_equal(frames(camera), plain)


def test_effects_without_their_stage(context: clspeckle.Context) -> None:
    camera = clspeckle.Pipeline.from_parameters(SHAPE, output="intensity", context=context)
    ideal = np.ones(SHAPE, np.float32)
    before = camera.render(ideal, frame_index=0, refresh="all")
    assert NEEDS_DOTS
    for effect in NEEDS_DOTS:
        with pytest.raises(errors.InvalidArgumentError, match=f"the effect {effect} needs a pipeline with dots"):
            camera.set_effect(effect)
    assert len(NEEDS_A_SENSOR) > 8
    for effect in (*NEEDS_A_SENSOR, "ambient_light"):
        with pytest.raises(errors.InvalidArgumentError, match=f"the effect {effect} needs a pipeline with a sensor"):
            camera.set_effect(effect)
    np.testing.assert_array_equal(camera.render(ideal, frame_index=0, refresh="all"), before)


def test_effects_of_a_new_pipeline(context: clspeckle.Context) -> None:
    with pytest.raises(TypeError, match="effects must map ids"):
        make(context, effects=["defocus"])
    with pytest.raises(TypeError, match=r"effects\['defocus'\] must map"):
        make(context, effects={"defocus": 0.5})
    with pytest.raises(errors.InvalidArgumentError, match="did you mean"):
        make(context, effects={"defokus": {}})
    with pytest.raises(errors.InvalidArgumentError, match="it must be"):
        make(context, effects={"defocus": {"waves": 1e9}})
    with make(context, effects={"defocus": None, "glare": {"fraction": 0.1}}) as camera:
        assert camera.effects == {"defocus": {"waves": 1.05}, "glare": {"fraction": 0.1, "scale_px": 6.0}}


def test_closed_pipelines_say_so(context: clspeckle.Context) -> None:
    camera = make(context)
    camera.close()
    with pytest.raises(errors.InvalidHandleError, match="this Pipeline is closed"):
        camera.set_effect("defocus")
    with pytest.raises(errors.InvalidHandleError, match="this Pipeline is closed"):
        camera.clear_effect()
