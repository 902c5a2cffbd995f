"""Where a line of the catalogue leaves a choice: the readings that a generator may take.

The first of each is the one of the catalogue's words as we read them; the check's aims are stated for it. The others are what
another generator, or another camera, may as well have; a diagnosis that models the physics names the effect all the same,
though a parameter may mean something else.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

CHOICES: dict[str, tuple[str, ...]] = {
    # the field's correlation over the exposure: exp(-d), exp(-d^2)
    "motion_decorrelation": ("exponential", "gaussian"),
    # screens: correlation exp(-r^2 / (2 scale^2)) or exp(-r^2 / (4 scale^2)), exp(-1/5) from frame to frame; faster air; a frozen
    # screen that the wind carries along
    "airflow": ("near", "wide", "fast", "wind"),
    # where the faint lattice lies: half the spacing along both axes, one axis
    "ghost_dots": ("both", "x", "y"),
    # the axis along which dots are lopsided
    "beam_skew": ("x", "y", "-x", "diagonal"),
    # towards longer or shorter wavelengths
    "wavelength_shift": ("longer", "shorter"),
    # the image is warped, or only the dots' centres move; barrel or pincushion
    "lens_distortion": ("image", "positions", "image_inward", "positions_inward"),
    # the tails of glare: exp(-r / scale), the same cut off at 4 scales, a Lorentzian's, (1 + (r / scale)^2)^(-3/2)
    "glare": ("exponential", "truncated", "lorentzian"),
    # exp(-r / L), or cut off at 4 L
    "subsurface_scattering": ("exponential", "truncated"),
    # the image is shifted before its modulus is taken, or interpolated, by cubic splines or in straight lines
    "vibration": ("field", "cubic", "linear"),
    # the area itself, or the mean of n x n points of it
    "pixel_integration": ("area", "points2", "points3"),
    # photons before or after the curve and the well
    "gamma": ("after_photons", "before_photons"),
    "full_well": ("after_photons", "before_photons"),
    # the converter rounds to the nearest multiple, or cuts off
    "adc_bits": ("nearest", "down"),
    # y(t) = (1 - f) x(t) + f x(t - 1); what remained holds what had remained in it; a fraction more, which takes nothing away
    "image_lag": ("once", "recursive", "added"),
    # Poisson's law, or the Gaussian of the same variance
    "shot_noise": ("poisson", "gaussian"),
    # offsets of hot pixels: exponential, all the same, uniform from 0 to twice the mean
    "hot_pixels": ("exponential", "constant", "uniform"),
    # which of the two green sites is the brighter one, and on which diagonal they are
    "bayer_mismatch": ("odd_even", "even_odd", "main_diagonal"),
    # charge that would leave at the border comes back, or comes in from the other side
    "crosstalk": ("border", "periodic"),
    # the scattered light is taken from the dots, or comes on top of them
    "scatter_background": ("taken", "added"),
    # the sign of the quadratic phase
    "defocus": ("far", "near"),
    # Gaussian fields go from one to the next, or their phases diffuse
    "surface_boiling": ("autoregression", "phases"),
    # photon noise comes from all light, or from the laser's and the flat's alone
    "ambient_light": ("with_photons", "smooth"),
}


@dataclass(frozen=True)
class Readings:
    """One choice for each effect that leaves one."""

    motion_decorrelation: str = "exponential"
    airflow: str = "near"
    ghost_dots: str = "both"
    beam_skew: str = "x"
    wavelength_shift: str = "longer"
    lens_distortion: str = "image"
    glare: str = "exponential"
    subsurface_scattering: str = "exponential"
    vibration: str = "field"
    pixel_integration: str = "area"
    gamma: str = "after_photons"
    full_well: str = "after_photons"
    adc_bits: str = "nearest"
    image_lag: str = "once"
    shot_noise: str = "poisson"
    hot_pixels: str = "exponential"
    bayer_mismatch: str = "odd_even"
    crosstalk: str = "border"
    scatter_background: str = "taken"
    defocus: str = "far"
    surface_boiling: str = "autoregression"
    ambient_light: str = "with_photons"

    def __post_init__(self) -> None:
        for choice in fields(self):
            if getattr(self, choice.name) not in CHOICES[choice.name]:
                raise ValueError(f"{choice.name} has the readings {', '.join(CHOICES[choice.name])}, not {getattr(self, choice.name)!r}")


def draw_readings(rng: np.random.Generator) -> Readings:
    """One of each, all equally likely."""
    return Readings(**{name: str(rng.choice(choices)) for name, choices in CHOICES.items()})
