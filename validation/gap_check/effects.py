"""What the generator can switch on: the catalogue's effects with their ranges, and effects that are in no catalogue.

A strength between 0 (weak) and 1 (strong) moves all of an effect's parameters together, linearly. Below 0 it goes down
from weak to nothing at all, at -1.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .camera import (
    ALL_SEQUENCES,
    BITS,
    DOT_SEQUENCES,
    LASER_SEQUENCES,
    LIT_SEQUENCES,
    MOVING_LASER_SEQUENCES,
    STATIC_LASER_SEQUENCES,
    Camera,
    stream,
)

Setting = dict[str, float]
Effects = dict[str, Setting]


# Parameters whose effect is nothing at another value than 0; that have no such value; that only shape an effect.
_NOTHING = {"degree_of_polarization": 1.0, "f_number_ratio": 1.0, "gamma": 1.0, "axis_ratio": 1.0}
_WITHOUT_NOTHING = (("surface_boiling", "correlation_frames"), ("full_well", "level_dn"), ("adc_bits", "bits"))
_FIXED = ("scale_px", "mean_dn", "period_codes")


@dataclass(frozen=True)
class EffectInfo:
    """An effect: its stage, its parameters' weak and strong values, and where it can show."""

    id: str
    stage: str
    ranges: dict[str, tuple[float, float]]
    sequences: tuple[str, ...]
    # Stages beside its own whose statistics it may rightly move most: a lost grain is the surface's or the optics'.
    also: tuple[str, ...] = ()
    in_catalogue: bool = True
    integers: tuple[str, ...] = field(default=())
    # Parameters that no strength moves: between which values, of either sign, they lie.
    drawn: dict[str, tuple[float, float]] = field(default_factory=dict)

    def at(self, strength: float, seed: int = 0) -> Setting:
        """The parameters at a strength, those beside it as a seed draws them."""
        rng = stream(seed, self.id, "drawn")
        beside = {name: float(rng.choice((-1, 1)) * rng.uniform(*bounds)) for name, bounds in self.drawn.items()}
        if strength < 0:
            return {name: self._below_weak(name, 1 + strength) for name in self.ranges} | beside
        values = {name: weak + (strong - weak) * strength for name, (weak, strong) in self.ranges.items()}
        return {n: float(round(v)) if n in self.integers else float(v) for n, v in values.items()} | beside

    def _below_weak(self, name: str, part: float) -> float:
        """A parameter that is `part` of the way from nothing to weak."""
        weak, strong = self.ranges[name]
        if name in _FIXED and weak == strong:
            return weak
        if name in self.integers or (self.id, name) in _WITHOUT_NOTHING or not 0 <= part <= 1:
            raise ValueError(f"{name} of {self.id!r} has no values between nothing and weak")
        nothing = _NOTHING.get(name, 0.0)
        return nothing + part * (weak - nothing)

    @property
    def stages(self) -> tuple[str, ...]:
        return (self.stage, *self.also)


_CATALOGUE = (
    EffectInfo("linewidth", "laser", {"dephasing_rad": (0.5, 1.2)}, LASER_SEQUENCES, ("surface",)),
    EffectInfo("power_flicker", "laser", {"sigma": (0.02, 0.1)}, LASER_SEQUENCES),
    EffectInfo("wavelength_shift", "laser", {"delta_nm": (4.0, 12.0)}, DOT_SEQUENCES, ("doe", "optics")),
    EffectInfo("beam_skew", "laser", {"skew": (0.5, 1.2)}, DOT_SEQUENCES, ("doe", "optics")),
    EffectInfo("beam_flat_top", "laser", {"flatness": (0.5, 1.0)}, DOT_SEQUENCES, ("doe", "optics")),
    EffectInfo("zero_order", "doe", {"relative_intensity": (4.0, 20.0)}, DOT_SEQUENCES),
    EffectInfo("ghost_dots", "doe", {"relative_intensity": (0.06, 0.25)}, DOT_SEQUENCES),
    EffectInfo("scatter_background", "doe", {"fraction": (0.06, 0.25)}, DOT_SEQUENCES),
    EffectInfo("depolarization", "surface", {"degree_of_polarization": (0.7, 0.0)}, LASER_SEQUENCES, ("laser",)),
    EffectInfo("low_roughness", "surface", {"coherent_fraction": (0.1, 0.5)}, LASER_SEQUENCES),
    EffectInfo(
        "subsurface_scattering",
        "surface",
        {"length_px": (1.5, 4.0), "fraction": (0.6, 0.6)},
        DOT_SEQUENCES,
        ("doe", "optics"),
    ),
    EffectInfo("motion_decorrelation", "motion", {"lags": (0.4, 2.5)}, MOVING_LASER_SEQUENCES, ("surface", "laser")),
    EffectInfo("surface_boiling", "motion", {"correlation_frames": (60.0, 6.0)}, STATIC_LASER_SEQUENCES),
    EffectInfo("airflow", "motion", {"rms_rad": (0.25, 0.8), "scale_px": (6.0, 6.0)}, STATIC_LASER_SEQUENCES),
    EffectInfo("vibration", "motion", {"rms_px": (0.05, 0.3)}, STATIC_LASER_SEQUENCES),
    EffectInfo("defocus", "optics", {"waves": (0.6, 1.5)}, DOT_SEQUENCES),
    EffectInfo("vignetting", "optics", {"corner_loss": (0.12, 0.45)}, LIT_SEQUENCES),
    EffectInfo("aperture_mismatch", "optics", {"f_number_ratio": (1.12, 1.45)}, LASER_SEQUENCES, ("surface",)),
    EffectInfo("pupil_obstruction", "optics", {"radius_ratio": (0.3, 0.6)}, LASER_SEQUENCES, ("surface",)),
    EffectInfo("glare", "optics", {"fraction": (0.05, 0.2), "scale_px": (6.0, 6.0)}, LASER_SEQUENCES),
    EffectInfo("ambient_light", "optics", {"level_dn": (6.0, 40.0)}, LASER_SEQUENCES),
    EffectInfo("lens_distortion", "optics", {"k1": (0.01, 0.05)}, DOT_SEQUENCES, ("doe", "laser")),
    EffectInfo("pixel_integration", "sensor", {"fill_factor": (1.0, 1.0)}, LASER_SEQUENCES, ("optics", "surface")),
    EffectInfo("crosstalk", "sensor", {"fraction": (0.06, 0.25)}, LASER_SEQUENCES, ("optics", "surface")),
    EffectInfo("shot_noise", "sensor", {"dn_per_electron": (0.08, 0.5)}, LIT_SEQUENCES),
    EffectInfo("prnu", "sensor", {"sigma": (0.006, 0.03)}, LIT_SEQUENCES),
    EffectInfo("column_gain", "sensor", {"sigma": (0.002, 0.01)}, LIT_SEQUENCES),
    EffectInfo("row_gain", "sensor", {"sigma": (0.002, 0.01)}, LIT_SEQUENCES),
    EffectInfo("dsnu", "sensor", {"sigma_dn": (1.0, 5.0)}, ALL_SEQUENCES),
    EffectInfo("column_fpn", "sensor", {"sigma_dn": (0.8, 4.0)}, ALL_SEQUENCES),
    EffectInfo("row_fpn", "sensor", {"sigma_dn": (0.8, 4.0)}, ALL_SEQUENCES),
    EffectInfo(
        "periodic_offset",
        "sensor",
        {"amplitude_dn": (1.0, 5.0)},
        ALL_SEQUENCES,
        # Neither shading nor a pattern of whole rows or columns.
        drawn={"frequency_x": (0.03, 0.5), "frequency_y": (0.03, 0.5)},
    ),
    EffectInfo("hot_pixels", "sensor", {"fraction": (0.001, 0.01), "mean_dn": (150.0, 150.0)}, ALL_SEQUENCES),
    EffectInfo("pixel_dull", "sensor", {"fraction": (0.0002, 0.002)}, LIT_SEQUENCES),
    EffectInfo("telegraph_noise", "sensor", {"fraction": (0.01, 0.04), "step_dn": (30.0, 60.0)}, ALL_SEQUENCES),
    EffectInfo("dark_current", "sensor", {"rate_dn_per_ms": (0.1, 1.0)}, ALL_SEQUENCES),
    EffectInfo("row_noise", "sensor", {"sigma_dn": (0.8, 4.0)}, ALL_SEQUENCES),
    EffectInfo("column_noise", "sensor", {"sigma_dn": (0.8, 4.0)}, ALL_SEQUENCES),
    EffectInfo("correlated_read_noise", "sensor", {"correlation": (0.04, 0.2)}, ALL_SEQUENCES),
    EffectInfo("gamma", "sensor", {"gamma": (0.93, 0.75)}, LIT_SEQUENCES),
    EffectInfo("nonlinearity", "sensor", {"cubic": (0.01, 0.05)}, LIT_SEQUENCES),
    EffectInfo("full_well", "sensor", {"level_dn": (650.0, 380.0)}, LIT_SEQUENCES),
    EffectInfo(
        "differential_nonlinearity",
        "sensor",
        {"amplitude_lsb": (0.1, 0.4), "period_codes": (4.0, 4.0)},
        ALL_SEQUENCES,
        integers=("period_codes",),
    ),
    EffectInfo("adc_bits", "sensor", {"bits": (8.0, 6.0)}, ALL_SEQUENCES, integers=("bits",)),
    EffectInfo("bayer_mismatch", "sensor", {"delta": (0.015, 0.06)}, LIT_SEQUENCES),
    EffectInfo("image_lag", "sensor", {"fraction": (0.03, 0.15)}, MOVING_LASER_SEQUENCES, ("motion",)),
)


def _outside(
    id: str,
    stage: str,
    ranges: dict[str, tuple[float, float]],
    sequences: tuple[str, ...],
    also: tuple[str, ...] = (),
) -> EffectInfo:
    return EffectInfo(id, stage, ranges, sequences, also, in_catalogue=False)


# In no catalogue. What each does stands with its code in scene.py, light.py and sensor.py.
_OUTSIDE = (
    _outside("power_warm_up", "laser", {"droop": (0.06, 0.3)}, LASER_SEQUENCES, ("motion",)),
    _outside("row_band_flicker", "laser", {"modulation": (0.03, 0.15)}, LASER_SEQUENCES, ("sensor",)),
    _outside("missing_dots", "doe", {"fraction": (0.05, 0.25)}, DOT_SEQUENCES, ("laser",)),
    _outside("unequal_dots", "doe", {"sigma": (0.15, 0.5)}, DOT_SEQUENCES, ("laser",)),
    _outside("pattern_rotation", "doe", {"angle_deg": (0.4, 1.5)}, DOT_SEQUENCES, ("laser", "optics")),
    _outside("uncorrelated_speckle", "surface", {"fraction": (0.3, 1.0)}, LASER_SEQUENCES, ("optics",)),
    _outside("albedo_texture", "surface", {"sigma": (0.08, 0.3)}, LASER_SEQUENCES, ("optics", "sensor")),
    _outside("image_drift", "motion", {"px_per_frame": (0.01, 0.06)}, LASER_SEQUENCES),
    _outside("stick_slip", "motion", {"stuck_fraction": (0.15, 0.6)}, MOVING_LASER_SEQUENCES),
    _outside("mirror_ghost", "optics", {"fraction": (0.06, 0.25)}, LASER_SEQUENCES, ("doe",)),
    _outside("etalon_fringes", "optics", {"modulation": (0.06, 0.25)}, LASER_SEQUENCES, ("laser", "surface")),
    _outside("tilt_blur", "optics", {"edge_waves": (1.2, 2.5)}, DOT_SEQUENCES),
    _outside("elliptical_pupil", "optics", {"axis_ratio": (0.8, 0.5)}, LASER_SEQUENCES, ("surface",)),
    _outside("window_double_image", "optics", {"amplitude": (0.2, 0.5)}, LASER_SEQUENCES, ("surface", "doe")),
    _outside("block_compression", "sensor", {"step_dn": (8.0, 30.0)}, ALL_SEQUENCES),
    _outside("odd_even_row_gain", "sensor", {"delta": (0.01, 0.05)}, LIT_SEQUENCES),
    _outside("frame_repeats", "sensor", {"fraction": (0.1, 0.4)}, ALL_SEQUENCES, ("motion",)),
    _outside("charge_transfer_smear", "sensor", {"fraction": (0.06, 0.25)}, LASER_SEQUENCES, ("optics",)),
    _outside("column_smear", "sensor", {"fraction": (0.03, 0.15)}, LASER_SEQUENCES, ("optics",)),
    _outside("median_denoising", "sensor", {"weight": (0.35, 1.0)}, ALL_SEQUENCES),
    _outside("second_wavelength", "laser", {"fraction": (0.15, 0.4)}, DOT_SEQUENCES, ("doe", "optics")),
    _outside("uneven_illumination", "laser", {"slope": (0.08, 0.35)}, LASER_SEQUENCES, ("optics", "surface")),
    _outside("wide_outer_dots", "doe", {"growth": (0.3, 1.0)}, DOT_SEQUENCES, ("laser", "optics")),
    _outside("shutter_blur", "motion", {"path_px": (2.0, 6.0)}, ("dots_moving",), ("surface", "optics")),
    _outside("line_jitter", "motion", {"rms_px": (0.15, 0.6)}, LASER_SEQUENCES, ("sensor",)),
    _outside("coma", "optics", {"waves": (0.4, 1.2)}, DOT_SEQUENCES),
    _outside("astigmatism", "optics", {"waves": (0.6, 1.5)}, DOT_SEQUENCES),
    _outside("incoherent_double_image", "optics", {"fraction": (0.06, 0.25)}, LASER_SEQUENCES, ("doe",)),
    _outside("dust", "optics", {"absorption": (0.1, 0.5)}, LIT_SEQUENCES, ("sensor",)),
    _outside("sharpening", "sensor", {"amount": (0.2, 0.8)}, ALL_SEQUENCES),
    _outside("temporal_denoising", "sensor", {"weight": (0.15, 0.5)}, ALL_SEQUENCES, ("motion",)),
    _outside("dark_shading", "sensor", {"corner_dn": (4.0, 20.0)}, ALL_SEQUENCES),
    _outside("converter_ripple", "sensor", {"amplitude_dn": (2.0, 6.0)}, ALL_SEQUENCES),
    _outside("interference", "sensor", {"amplitude_dn": (1.5, 6.0)}, ALL_SEQUENCES),
    _outside("dead_pixels", "sensor", {"fraction": (0.002, 0.02)}, LIT_SEQUENCES),
    _outside("black_level_drift", "sensor", {"total_dn": (2.0, 10.0)}, ALL_SEQUENCES),
)


def on_camera(effects: Effects, camera: Camera) -> Effects:
    """The same effects by the camera's data sheet: DN of its converter, polarization beside that of its laser."""

    def value(name: str, parameter: str, of_ten_bits: float) -> float:
        if parameter.endswith("_dn") or parameter in ("dn_per_electron", "rate_dn_per_ms"):
            return of_ten_bits * camera.dn_scale
        if (name, parameter) == ("adc_bits", "bits"):
            return of_ten_bits + camera.bits - BITS
        if parameter == "degree_of_polarization":
            return of_ten_bits * camera.degree_of_polarization
        return of_ten_bits

    return {name: {p: value(name, p, v) for p, v in setting.items()} for name, setting in effects.items()}


CATALOGUE: dict[str, EffectInfo] = {e.id: e for e in _CATALOGUE}
OUTSIDE: dict[str, EffectInfo] = {e.id: e for e in _OUTSIDE}
EFFECTS: dict[str, EffectInfo] = {**CATALOGUE, **OUTSIDE}


def validate(effects: Effects) -> None:
    """Raises ValueError for an effect or a parameter that does not exist."""
    for name, setting in effects.items():
        if name not in EFFECTS:
            raise ValueError(f"no effect is called {name!r}; there are: {', '.join(EFFECTS)}")
        known = EFFECTS[name].ranges | EFFECTS[name].drawn
        wrong = set(setting) ^ set(known)
        if wrong:
            raise ValueError(f"effect {name!r} takes the parameters {', '.join(known)}, not {', '.join(setting)}")
