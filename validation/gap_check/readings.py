"""Where a line of the catalogue leaves a choice: the readings that a generator may take.

The first of each is the catalogue's line as we read it; the check's aims are stated for it. The others are what another
generator, or another camera, may as well have; a diagnosis that models the physics names the effect all the same,
though a parameter may mean something else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args, get_type_hints

import numpy as np


@dataclass(frozen=True)
class Readings:
    """One choice for each effect that leaves one."""

    # The field's correlation over the exposure: exp(-lags t), exp(-(lags t)^2).
    motion_decorrelation: Literal["exponential", "gaussian"] = "exponential"
    # Screens: correlation exp(-r^2 / (2 scale^2)) in space and exp(-1/5) from frame to frame; exp(-r^2 / (4 scale^2));
    # 0.5 from frame to frame; a frozen screen that the wind carries along, half a scale a frame.
    airflow: Literal["near", "wide", "fast", "wind"] = "near"
    # Where the faint lattice lies: half the spacing along both axes, along one.
    ghost_dots: Literal["both", "x", "y"] = "both"
    # The axis along which dots are lopsided.
    beam_skew: Literal["x", "y", "-x", "diagonal"] = "x"
    # Towards longer or shorter wavelengths.
    wavelength_shift: Literal["longer", "shorter"] = "longer"
    # The image is warped, or only the dots' centres move; away from the axis, or towards it.
    lens_distortion: Literal["image", "positions", "image_inward", "positions_inward"] = "image"
    # exp(-r / scale); the same, cut off at 4 scales; (1 + (r / scale)^2)^(-3/2), whose line spread is a Lorentzian.
    glare: Literal["exponential", "truncated", "lorentzian"] = "exponential"
    # exp(-r / L), or cut off at 4 L.
    subsurface_scattering: Literal["exponential", "truncated"] = "exponential"
    # The field is shifted before its modulus is taken, or the image interpolated by cubic splines or straight lines.
    vibration: Literal["field", "cubic", "linear"] = "field"
    # The pixel's area itself, or the mean of n x n points of it, the middles of n x n equal parts.
    pixel_integration: Literal["area", "points2", "points3"] = "area"
    # Photons come before or after the curve, and before or after the well.
    gamma: Literal["after_photons", "before_photons"] = "after_photons"
    full_well: Literal["after_photons", "before_photons"] = "after_photons"
    # The converter rounds to the nearest multiple, or cuts the lowest bits off.
    adc_bits: Literal["nearest", "down"] = "nearest"
    # y(t) = (1 - f) x(t) + f x(t - 1); (1 - f) x(t) + f y(t - 1); x(t) + f x(t - 1), which takes nothing away.
    image_lag: Literal["once", "recursive", "added"] = "once"
    # Poisson's law, or the Gaussian of the same variance.
    shot_noise: Literal["poisson", "gaussian"] = "poisson"
    # Offsets of hot pixels: exponential, all the same, uniform from 0 to twice the mean.
    hot_pixels: Literal["exponential", "constant", "uniform"] = "exponential"
    # On which diagonal the two green sites are, and which is the brighter one: odd row and even column, counted from 0;
    # even row and odd column; odd row and odd column.
    bayer_mismatch: Literal["odd_even", "even_odd", "main_diagonal"] = "odd_even"
    # Charge that would leave at the border comes back, or comes in from the other side.
    crosstalk: Literal["border", "periodic"] = "border"
    # The scattered light is taken from the dots, or comes on top of them.
    scatter_background: Literal["taken", "added"] = "taken"
    # The sign of the quadratic phase.
    defocus: Literal["far", "near"] = "far"
    # Gaussian fields go from one to the next, or keep their moduli while their phases diffuse.
    surface_boiling: Literal["autoregression", "phases"] = "autoregression"
    # All light has photon noise, or all but the ambient light.
    ambient_light: Literal["with_photons", "smooth"] = "with_photons"
    # The pixel gains the step in each second frame at random; half of it is lost and won; it stays for some frames.
    telegraph_noise: Literal["raised", "centered", "slow"] = "raised"
    # Photons come before or after the curve.
    nonlinearity: Literal["after_photons", "before_photons"] = "after_photons"

    def __post_init__(self) -> None:
        for name, choices in CHOICES.items():
            given = getattr(self, name)
            if given not in choices:
                raise ValueError(f"{name} has the readings {', '.join(choices)}, not {given!r}")


# Of each effect, the catalogue's first.
CHOICES: dict[str, tuple[str, ...]] = {name: get_args(hint) for name, hint in get_type_hints(Readings).items()}
AS_CATALOGUED = Readings()


def draw_readings(rng: np.random.Generator) -> Readings:
    """One of each, all equally likely."""
    drawn: dict[str, Any] = {name: str(rng.choice(choices)) for name, choices in CHOICES.items()}
    return Readings(**drawn)
