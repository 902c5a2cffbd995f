"""From intensity to codes (sensor.h; thesis sections 3.2.1 to 3.2.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import philox

STREAM_READ_NOISE = 0x10
STREAM_HOT = 0x11
STREAM_HOT_OFFSET = 0x12
STREAM_COLD = 0x13


@dataclass
class Sensor:
    """A sensor; the members are those of ClspSensorDesc."""

    width: int
    height: int
    bits: int = 10
    seed: int = 0
    exposure_gain_dn: float = 512.0
    saturation_dn: float = float("inf")
    black_level_dn: float = 64.0
    read_noise_dn: float = 4.0
    hot_pixel_fraction: float = 0.0
    hot_pixel_mean_dn: float = 150.0
    cold_pixel_fraction: float = 0.0
    float_full_scale: float = 1.0
    dark_frame_dn: NDArray | None = None
    quantize: bool = True

    @property
    def top_code(self) -> int:
        return 2**self.bits - 1

    def hot_offset_dn(self) -> NDArray[np.float64]:
        """Offset of the hot pixels, 0 at the others: exponential with mean hot_pixel_mean_dn."""
        chance = philox.image_uniform(self.height, self.width, self.seed, 0, STREAM_HOT)
        u = philox.image_uniform(self.height, self.width, self.seed, 0, STREAM_HOT_OFFSET)
        return np.where(chance < self.hot_pixel_fraction, -self.hot_pixel_mean_dn * np.log(u), 0.0)

    def hot(self) -> NDArray[np.bool_]:
        """The hot pixels."""
        return philox.image_uniform(self.height, self.width, self.seed, 0, STREAM_HOT) < self.hot_pixel_fraction

    def cold(self) -> NDArray[np.bool_]:
        """The cold pixels."""
        return philox.image_uniform(self.height, self.width, self.seed, 0, STREAM_COLD) < self.cold_pixel_fraction

    def value_dn(self, intensity: NDArray, frame_index: int) -> NDArray[np.float64]:
        """Before clipping and rounding: signal + black level + dark frame + hot + read noise."""
        signal = np.minimum(self.exposure_gain_dn * np.asarray(intensity, dtype=np.float64), self.saturation_dn)
        signal = np.where(self.cold(), 0.0, signal)
        noise = philox.image_normal(self.height, self.width, self.seed, frame_index, STREAM_READ_NOISE)
        dark = 0.0 if self.dark_frame_dn is None else np.asarray(self.dark_frame_dn, dtype=np.float64)
        return signal + self.black_level_dn + dark + self.hot_offset_dn() + self.read_noise_dn * noise

    def codes_of(self, value_dn: NDArray[np.float64]) -> NDArray[np.int64]:
        """Rounded half to even and clipped to 0 .. 2^bits - 1."""
        return np.clip(np.rint(value_dn), 0, self.top_code).astype(np.int64)

    def expose(self, intensity: NDArray, frame_index: int) -> NDArray[np.int64]:
        """Codes."""
        return self.codes_of(self.value_dn(intensity, frame_index))

    def expose_float(self, intensity: NDArray, frame_index: int) -> NDArray[np.float64]:
        """The FLOAT32 output: code / (2^bits - 1) float_full_scale; without quantization the clipped value in its
        place."""
        value = self.value_dn(intensity, frame_index)
        level = self.codes_of(value) if self.quantize else np.clip(value, 0, self.top_code)
        return level / self.top_code * self.float_full_scale


def disagreement(
    codes: NDArray, value_dn: NDArray[np.float64], expected: NDArray[np.int64], margin_dn: NDArray[np.float64]
) -> str:
    """What is wrong with codes that single precision made of value_dn; "" if nothing is.

    They may be one code off where the value lies within margin_dn of a rounding boundary. A value is that near with
    probability 2 margin, so a larger share of different codes (with 3.5 standard errors to spare) is an error too.
    """
    difference = codes.astype(np.int64) - expected
    differs = difference != 0
    if np.abs(difference).max() > 1:
        place = np.unravel_index(np.argmax(np.abs(difference)), difference.shape)
        return f"code {codes[place]} at {place}, expected {expected[place]} for {value_dn[place]}"
    to_boundary = np.abs(value_dn - np.floor(value_dn) - 0.5)
    wrong = differs & (to_boundary >= margin_dn)
    if np.any(wrong):
        place = np.unravel_index(np.argmax(wrong), wrong.shape)
        return f"code {codes[place]} at {place} for {value_dn[place]}, further than {margin_dn[place]} from a boundary"
    allowed = float(np.mean(2 * margin_dn))
    if differs.mean() > allowed + 3.5 * np.sqrt(allowed / codes.size):
        return f"a share of {differs.mean()} of the codes differs, expected at most {allowed}"
    return ""
