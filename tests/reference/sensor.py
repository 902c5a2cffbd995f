"""From intensity to codes (sensor.h, its steps by number; thesis sections 3.2.1 to 3.2.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from . import philox

STREAM_READ_NOISE = 0x10
STREAM_HOT = 0x11
STREAM_HOT_OFFSET = 0x12
STREAM_COLD = 0x13
STREAM_PRNU = 0x14
STREAM_DSNU = 0x15
STREAM_COLUMN_OFFSET = 0x16
STREAM_ROW_NOISE = 0x17
STREAM_SHOT_NORMAL = 0x18
STREAM_SHOT_UNIFORM = 0x19
STREAM_READ_NOISE_SPREAD = 0x1A
STREAM_COLUMN_NOISE = 0x1B
STREAM_COLUMN_PRNU = 0x1C
STREAM_ROW_PRNU = 0x1D
STREAM_ROW_OFFSET = 0x1E
STREAM_DULL_PIXEL = 0x1F
STREAM_PERIODIC_PHASE = 0x36
STREAM_TELEGRAPH_PIXEL = 0x37
STREAM_TELEGRAPH_STATE = 0x38

POISSON_BY_UNIFORM_BELOW = 12.0
"""Mean from which the Poisson deviate takes a normal instead of a uniform."""


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
    gain_map: NDArray | None = None
    quantize: bool = True
    conversion_gain_dn_per_e: float = 0.0
    photons_per_unit: float = 0.0
    quantum_efficiency: float = 1.0
    full_well_e: float = 0.0
    crosstalk_fraction: float = 0.0
    prnu: float = 0.0
    column_prnu: float = 0.0
    row_prnu: float = 0.0
    mosaic_gain: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    dark_current_e_per_s: float = 0.0
    dark_current_reference_temperature_c: float = 25.0
    dark_current_doubling_k: float = 8.0
    temperature_c: float = 25.0
    exposure_time_s: float = 0.01
    lag_fraction: float = 0.0
    gamma: float = 1.0
    dsnu_dn: float = 0.0
    column_offset_dn: float = 0.0
    row_noise_dn: float = 0.0
    column_noise_dn: float = 0.0
    read_noise_spread: float = 0.0
    shot_noise: bool = False
    effective_bits: int = 0
    row_offset_dn: float = 0.0
    dull_pixel_fraction: float = 0.0
    cubic_nonlinearity: float = 0.0
    periodic_offset_dn: float = 0.0
    periodic_frequency_x: float = 0.0
    periodic_frequency_y: float = 0.0
    telegraph_fraction: float = 0.0
    telegraph_step_dn: float = 0.0
    telegraph_centered: bool = False
    code_width_wave: float = 0.0
    code_width_period: float = 4.0
    widest_code: float = 0.0
    nonlinearity_power: int = 3
    read_noise_correlation: float = 0.0

    def __post_init__(self) -> None:
        if self.photons_per_unit:
            self.exposure_gain_dn = self.conversion_gain_dn_per_e * self.quantum_efficiency * self.photons_per_unit
        if self.full_well_e:
            self.saturation_dn = self.conversion_gain_dn_per_e * self.full_well_e

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

    def _normal(self, stream: int, frame_index: int = 0) -> NDArray[np.float64]:
        return philox.image_normal(self.height, self.width, self.seed, frame_index, stream)

    def _row(self, stream: int, frame_index: int = 0) -> NDArray[np.float64]:
        """One normal for each column: an image one pixel high."""
        return philox.image_normal(1, self.width, self.seed, frame_index, stream)

    def _column(self, stream: int, frame_index: int = 0) -> NDArray[np.float64]:
        """One normal for each row: an image one pixel wide."""
        return philox.image_normal(self.height, 1, self.seed, frame_index, stream)

    def pixel_gain(self) -> NDArray[np.float64]:
        """Step 3: mosaic, PRNU, dull and cold pixels, gain map."""
        y, x = np.indices((self.height, self.width))
        gain = np.asarray(self.mosaic_gain, dtype=np.float64)[(x & 1) + 2 * (y & 1)]
        if self.gain_map is not None:
            gain = gain * np.asarray(self.gain_map, dtype=np.float64)
        gain = gain * np.maximum(1.0 + self.prnu * self._normal(STREAM_PRNU), 0.0)
        gain = gain * np.maximum(1.0 + self.column_prnu * self._row(STREAM_COLUMN_PRNU), 0.0)
        gain = gain * np.maximum(1.0 + self.row_prnu * self._column(STREAM_ROW_PRNU), 0.0)
        u = philox.image_uniform(self.height, self.width, self.seed, 0, STREAM_DULL_PIXEL)
        gain = gain * np.where(u < self.dull_pixel_fraction, 1.0 - 0.3 * u / max(self.dull_pixel_fraction, 1e-300), 1.0)
        return np.where(self.cold(), 0.0, gain)

    @property
    def dark_electrons(self) -> float:
        """Step 4: the mean of the dark current in an exposure."""
        doublings = (self.temperature_c - self.dark_current_reference_temperature_c) / self.dark_current_doubling_k
        return self.dark_current_e_per_s * self.exposure_time_s * 2.0**doublings

    def poisson(self, mean: NDArray[np.float64], frame_index: int) -> NDArray[np.float64]:
        """Step 5, exactly: the quantile of a uniform or of a normal."""
        u = philox.image_uniform(self.height, self.width, self.seed, frame_index, STREAM_SHOT_UNIFORM)
        w = self._normal(STREAM_SHOT_NORMAL, frame_index)
        few = np.minimum(mean, POISSON_BY_UNIFORM_BELOW)
        by_uniform = np.zeros(mean.shape)
        for k in range(60):
            by_uniform += u < scipy.stats.poisson.sf(k, few)
        return np.where(mean < POISSON_BY_UNIFORM_BELOW, by_uniform, poisson_of_normal(mean, w))

    def fixed_offset_dn(self) -> NDArray[np.float64]:
        """What step 9 adds in every frame."""
        dark = 0.0 if self.dark_frame_dn is None else np.asarray(self.dark_frame_dn, dtype=np.float64)
        return (
            self.black_level_dn
            + dark
            + self.hot_offset_dn()
            + self.dsnu_dn * self._normal(STREAM_DSNU)
            + self.column_offset_dn * self._row(STREAM_COLUMN_OFFSET)
            + self.row_offset_dn * self._column(STREAM_ROW_OFFSET)
            + self.periodic_offset_dn * np.sin(2 * np.pi * self._periodic_turns())
        )

    def _periodic_turns(self) -> NDArray[np.float64]:
        y, x = np.indices((self.height, self.width))
        phase = philox.image_words(1, 1, self.seed, 0, STREAM_PERIODIC_PHASE)[0, 0] / 2.0**32
        return self.periodic_frequency_x * x + self.periodic_frequency_y * y + phase

    def telegraph_dn(self, frame_index: int) -> NDArray[np.float64]:
        """The jumps of telegraph noise in a frame."""
        size = self.height, self.width
        jumps = philox.image_uniform(*size, self.seed, 0, STREAM_TELEGRAPH_PIXEL) < self.telegraph_fraction
        high = philox.image_words(*size, self.seed, frame_index, STREAM_TELEGRAPH_STATE) >= 2**31
        return self.telegraph_step_dn * jumps * (high - 0.5 * self.telegraph_centered)

    def read_noise_map_dn(self) -> NDArray[np.float64]:
        """Each pixel's standard deviation of the read noise."""
        spread = self.read_noise_spread
        return self.read_noise_dn * np.exp(spread * self._normal(STREAM_READ_NOISE_SPREAD) - spread**2)

    def read_normal(self, frame_index: int) -> NDArray[np.float64]:
        """The read noise of a frame, of variance 1."""
        r = self.read_noise_correlation
        size = self.height, self.width
        own = philox.image_pair_normal(*size, self.seed, frame_index, STREAM_READ_NOISE)
        if r == 0.0:
            return own
        w = (1.0 - np.sqrt(1.0 - 4.0 * r**2)) / (2.0 * r)
        left = philox.image_pair_normal(*size, self.seed, frame_index, STREAM_READ_NOISE, first_column=-1)
        return (own + w * left) / np.hypot(1.0, w)

    def noise_dn(self, frame_index: int) -> NDArray[np.float64]:
        """What step 9 adds anew in each frame."""
        return (
            self.read_noise_map_dn() * self.read_normal(frame_index)
            + self.row_noise_dn * self._column(STREAM_ROW_NOISE, frame_index)
            + self.column_noise_dn * self._row(STREAM_COLUMN_NOISE, frame_index)
            + self.telegraph_dn(frame_index)
        )

    def signal_dn(
        self, intensity: NDArray, frame_index: int, previous: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Steps 1 to 7; `previous` is the signal of the frame before, if there was one."""
        signal = np.maximum(self.exposure_gain_dn * np.asarray(intensity, dtype=np.float64), 0.0)
        around = np.pad(signal, 1, mode="edge")
        neighbours = around[:-2, 1:-1] + around[2:, 1:-1] + around[1:-1, :-2] + around[1:-1, 2:]
        signal = (1.0 - self.crosstalk_fraction) * signal + self.crosstalk_fraction / 4.0 * neighbours
        signal = signal * self.pixel_gain() + self.conversion_gain_dn_per_e * self.dark_electrons
        if self.shot_noise:
            gain = self.conversion_gain_dn_per_e
            signal = gain * self.poisson(signal / gain, frame_index)
        signal = np.minimum(signal, self.saturation_dn)
        if previous is None:
            return signal
        return (1.0 - self.lag_fraction) * signal + self.lag_fraction * previous

    def value_dn(
        self, intensity: NDArray, frame_index: int, previous: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Before clipping and rounding: steps 1 to 9, and what the converter's levels do."""
        signal = self.signal_dn(intensity, frame_index, previous)
        part = np.minimum(signal / self.top_code, 1.0)
        signal = signal * (1.0 - self.cubic_nonlinearity * part**self.nonlinearity_power)
        if self.gamma != 1.0:
            signal = self.top_code * (signal / self.top_code) ** self.gamma
        value = signal + self.fixed_offset_dn() + self.noise_dn(frame_index)
        if not self.quantize:
            return value
        rise = self.code_width_wave / (2.0 * np.sin(np.pi / self.code_width_period))
        even = codes = value / self.code_step
        for _ in range(100):  # what even levels would make the same codes of: even + wave(even) = codes
            even = codes - rise * np.sin(2 * np.pi * (even - self.widest_code) / self.code_width_period)
        return even * self.code_step

    @property
    def code_step(self) -> int:
        """Distance of neighbouring codes."""
        return 2 ** (self.bits - self.effective_bits) if self.effective_bits else 1

    def codes_of(self, value_dn: NDArray[np.float64]) -> NDArray[np.int64]:
        """Step 10: rounded half to even to a multiple of the code step, and clipped to what there is of them."""
        step = self.code_step
        return np.clip(np.rint(value_dn / step) * step, 0, 2**self.bits - step).astype(np.int64)

    def expose(self, intensity: NDArray, frame_index: int) -> NDArray[np.int64]:
        """Codes."""
        return self.codes_of(self.value_dn(intensity, frame_index))

    def expose_float(self, intensity: NDArray, frame_index: int) -> NDArray[np.float64]:
        """The FLOAT32 output: code / (2^bits - 1) float_full_scale; without quantization the clipped value in its
        place."""
        value = self.value_dn(intensity, frame_index)
        level = self.codes_of(value) if self.quantize else np.clip(value, 0, self.top_code)
        return level / self.top_code * self.float_full_scale


def poisson_of_normal(mean: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """The least n with P(Poisson <= n) >= Phi(normal), by the tail that is the smaller one."""
    low = scipy.stats.poisson.ppf(scipy.stats.norm.cdf(np.minimum(normal, 0.0)), mean)
    high = scipy.stats.poisson.isf(scipy.stats.norm.sf(np.maximum(normal, 0.0)), mean)
    return np.where(normal <= 0, low, high)


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
