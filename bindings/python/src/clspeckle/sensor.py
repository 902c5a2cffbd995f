"""From intensity to codes: exposure, crosstalk, pixel gain, dark current, shot noise, full well, lag, non-linearity,
offsets, ADC.

    signal = min(exposure_gain_dn * I, saturation_dn)     0 at cold pixels
    value  = signal + black_level_dn + dark_frame(x, y) + hot(x, y) + read_noise_dn * n
    code   = clip(round_half_to_even(value), 0, 2^bits - 1)

n is standard normal, independent for each pixel and frame. These are the steps that are on by default; the whole chain
with its equations is in ``sensor.h``. Thesis sections 3.2.1 to 3.2.3.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _doubts, _library, errors
from ._handle import exclusive
from ._interop import EventLike
from ._staging import DeviceImageLike, ImageLike, Stage
from .runtime import FLOAT32X3, UINT16, Context, Event, QueueLike

__all__ = ["Sensor", "dark_frame_from_captures", "mosaic_gain_from_bayer"]

BAYER = {"RGGB": 1, "BGGR": 2, "GRBG": 3, "GBRG": 4}
"""Colour filters, by the colours of the sites (0, 0) (1, 0) and (0, 1) (1, 1)."""

OUTPUT_DTYPES = (np.uint16, np.uint8, np.float32)
"""What a sensor writes; the first one is the default."""


def mosaic_gain_from_bayer(bayer: str, red: float, green: float, blue: float) -> list[float]:
    """The ``mosaic_gain`` of a colour filter.

    Args:
        bayer: "RGGB", "BGGR", "GRBG" or "GBRG".
        red: relative efficiency of red at the wavelength of the light, finite, >= 0; `green` and `blue` likewise.
    """
    gains = (ctypes.c_double * 4)()
    _library.call(
        "clspSensorMosaicFromBayer",
        _check.choice(bayer, "bayer", BAYER),
        _check.real(red, "red"),
        _check.real(green, "green"),
        _check.real(blue, "blue"),
        gains,
    )
    return list(gains)


def dark_frame_from_captures(
    frames: npt.ArrayLike, black_level_dn: float
) -> tuple[npt.NDArray[np.float32], float | None]:
    """The dark frame of a camera, from its own captures in the dark.

    Args:
        frames: (frames, height, width) uint16 codes.
        black_level_dn: taken off the mean.

    Returns:
        The mean over the frames less the black level, float32 of (height, width), for ``Sensor(dark_frame_dn=...)``;
        and the root mean square over the pixels of the temporal standard deviation, for ``read_noise_dn`` (None for a
        single frame). The rounding to codes is in it (variance 1/12).
    """
    given = _check.array(frames, "frames")
    if given.dtype != np.uint16:
        raise _check.format_error("frames", given.dtype, (np.uint16,))
    _check.check_shape(given, "frames", (None, None, None))
    codes = np.ascontiguousarray(given)
    count, height, width = codes.shape
    dark = np.empty((height, width), np.float32)
    noise = ctypes.c_double()
    _library.call(
        "clspSensorDarkFrameFromCaptures",
        _check.pointer(codes),
        _check.integer(count, "frame count"),
        _check.integer(width, "width"),
        _check.integer(height, "height"),
        0,
        0,
        _check.real(black_level_dn, "black_level_dn"),
        _check.pointer(dark),
        ctypes.byref(noise) if count > 1 else None,
    )
    return dark, noise.value if count > 1 else None


def _mosaic(value: Any) -> ctypes.Array[ctypes.c_double]:
    """Four gains from a sequence of four or a 2 x 2 array [y][x]."""
    given = _check.array(value, "mosaic_gain")
    if given.dtype.kind not in "fiu":
        raise _check.format_error("mosaic_gain", given.dtype, (np.float64,))
    if given.shape not in ((4,), (2, 2)):
        raise errors.InvalidArgumentError(f"mosaic_gain has shape {given.shape}, expected (4,) or (2, 2)")
    return (ctypes.c_double * 4)(*np.asarray(given, dtype=np.float64).reshape(-1).tolist())


class Sensor(Stage):
    """An image sensor. `_dn` is digital numbers (codes).

    Args:
        shape: (height, width) in pixels, each 1 to 16384.
        bits: of the ADC, 8 to 16.
        seed: below 2^64.
        exposure_gain_dn: DN per unit of intensity, >= 0.
        saturation_dn: the signal stops here, > 0; infinity: only the ADC clips.
        black_level_dn: DN.
        read_noise_dn: standard deviation of the temporal noise, >= 0.
        hot_pixel_fraction: 0 to 1.
        hot_pixel_mean_dn: mean offset of hot pixels, >= 0.
        cold_pixel_fraction: 0 to 1.
        dark_frame_dn: (height, width) mean dark signal above the black level; finite; copied.
        float_full_scale: value of the top code in a float32 output, > 0.
        conversion_gain_dn_per_e: DN per electron (EMVA 1288's system gain K); 0: no electrons.
        photons_per_unit: photons per pixel and exposure for a unit of intensity; above 0 it takes the place of
            exposure_gain_dn, which becomes K * quantum_efficiency * photons_per_unit.
        quantum_efficiency: electrons per photon, above 0 to 1; used with photons_per_unit only.
        full_well_e: electrons that a pixel holds; above 0 it takes the place of saturation_dn. Needs K.
        crosstalk_fraction: part of a pixel's signal that its four neighbours get, 0 to 1.
        prnu: relative standard deviation of the pixels' gain, 0 to 1.
        column_prnu: relative standard deviation of the columns' gain, 0 to 1; `row_prnu` likewise of the rows'.
        mosaic_gain: gains of the sites (x & 1, y & 1) = (0, 0), (1, 0), (0, 1), (1, 1); see
            :func:`mosaic_gain_from_bayer`.
        dark_current_e_per_s: electrons per pixel and second at the reference temperature. Needs K.
        dark_current_reference_temperature_c: degrees Celsius.
        dark_current_doubling_k: temperature step that doubles the dark current.
        temperature_c: of the sensor, degrees Celsius.
        exposure_time_s: for the dark current only.
        lag_fraction: part of the frame before that remains, 0 to below 1; see :meth:`reset_lag`.
        gamma: exponent of the non-linearity, 0.1 to 10; 1: linear.
        dsnu_dn: standard deviation of the pixels' offsets, constant in time.
        column_offset_dn: standard deviation of the columns' offsets, constant in time.
        row_noise_dn: standard deviation of the rows' offsets, new in each frame.
        column_noise_dn: standard deviation of the columns' offsets, new in each frame.
        read_noise_spread: standard deviation of the logarithm of the pixels' read noise, 0 to 2.
        shot_noise: Poisson noise of the electrons. Needs K.
        effective_bits: that the ADC resolves, 1 to bits; 0: all of them.
        row_offset_dn: standard deviation of the rows' offsets, constant in time.
        dull_pixel_fraction: part of the pixels whose gain is only 0.7 to 1 times what it would be, 0 to 1.
        cubic_nonlinearity: part of the signal that the response lacks at full scale, -1 to 0.25; below, it goes with
            the signal to the power of `nonlinearity_power`.
        periodic_offset_dn: amplitude of a wave of offsets, constant in time.
        periodic_frequency_x: of the wave, cycles per pixel, -0.5 to 0.5; `periodic_frequency_y` likewise downwards.
        telegraph_fraction: part of the pixels whose offset jumps in half of the frames, 0 to 1.
        telegraph_step_dn: by how much, >= 0.
        telegraph_centered: they jump by half of it up or down, and not up or not at all.
        code_width_wave: differential nonlinearity of the ADC, the amplitude of a wave of code widths in codes, 0 to
            0.5. A float32 output without quantization has none.
        code_width_period: of the wave, in codes, 2 to 16.
        widest_code: a code where the wave is highest, 0 to 65536.
        nonlinearity_power: of `cubic_nonlinearity`, 1, 2 or 3. With 1 the response is quadratic.
        read_noise_correlation: of the read noise of neighbours in a row, -0.5 to 0.5.
        gain_map: (height, width) relative gains of the pixels (a PRNU map), >= 0, their mean 0.9 to 1.1; copied.
        quantize: False: a float32 output is only clipped, not quantized.
        context: None for :func:`default_context`.

    What is None has the C library's default, see :meth:`defaults`.

    Threads: calls on one object from several threads run one after the other; different objects run at the same time.
    """

    _c_name = "clspSensor"
    _arguments = _check.Arguments(_library.ClspSensorDesc, flags=("quantize", "shot_noise", "telegraph_centered"))

    def __init__(
        self,
        shape: tuple[int, int],
        *,
        bits: int | None = None,
        seed: int | None = None,
        exposure_gain_dn: float | None = None,
        saturation_dn: float | None = None,
        black_level_dn: float | None = None,
        read_noise_dn: float | None = None,
        hot_pixel_fraction: float | None = None,
        hot_pixel_mean_dn: float | None = None,
        cold_pixel_fraction: float | None = None,
        dark_frame_dn: npt.ArrayLike | None = None,
        float_full_scale: float | None = None,
        quantize: bool | None = None,
        conversion_gain_dn_per_e: float | None = None,
        photons_per_unit: float | None = None,
        quantum_efficiency: float | None = None,
        full_well_e: float | None = None,
        crosstalk_fraction: float | None = None,
        prnu: float | None = None,
        column_prnu: float | None = None,
        row_prnu: float | None = None,
        mosaic_gain: npt.ArrayLike | None = None,
        dark_current_e_per_s: float | None = None,
        dark_current_reference_temperature_c: float | None = None,
        dark_current_doubling_k: float | None = None,
        temperature_c: float | None = None,
        exposure_time_s: float | None = None,
        lag_fraction: float | None = None,
        gamma: float | None = None,
        dsnu_dn: float | None = None,
        column_offset_dn: float | None = None,
        row_noise_dn: float | None = None,
        column_noise_dn: float | None = None,
        read_noise_spread: float | None = None,
        shot_noise: bool | None = None,
        effective_bits: int | None = None,
        row_offset_dn: float | None = None,
        dull_pixel_fraction: float | None = None,
        cubic_nonlinearity: float | None = None,
        periodic_offset_dn: float | None = None,
        periodic_frequency_x: float | None = None,
        periodic_frequency_y: float | None = None,
        telegraph_fraction: float | None = None,
        telegraph_step_dn: float | None = None,
        telegraph_centered: bool | None = None,
        code_width_wave: float | None = None,
        code_width_period: float | None = None,
        widest_code: float | None = None,
        nonlinearity_power: int | None = None,
        read_noise_correlation: float | None = None,
        gain_map: npt.ArrayLike | None = None,
        context: Context | None = None,
    ) -> None:
        given = {name: value for name, value in locals().items() if name in _OPTIONS}
        desc, self._options = _description(shape, given)
        self._create(desc, context)
        self.shape: tuple[int, int] = (desc.height, desc.width)
        self.bits: int = desc.bits
        self._exposure_gain_dn: float = _exposure_gain(desc)
        self._dn_per_photon = _dn_per_photon(desc)
        self._converter = _converter(desc, self._options)

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """The C library's defaults of the keyword arguments."""
        return _values(_library.initialized(_library.ClspSensorDesc))

    @staticmethod
    def profile(name: str) -> dict[str, Any]:
        """The settings of a known camera as arguments: ``Sensor(**Sensor.profile("OS04A10"))``.

        All of them, `shape` too; change what you know better. An unknown name is answered with the known ones.
        Which values are public and which are assumptions: docs/method/sensor.md.
        """
        if not isinstance(name, str):
            raise TypeError(f"name must be the name of a camera, got {_check.kind(name)}")
        desc = _library.ClspSensorDesc()
        size = ctypes.sizeof(desc)
        encoded = _check.no_null(name.encode(), "name")
        _library.call("clspSensorDescFromProfile", ctypes.byref(desc), size, encoded)
        return {"shape": (desc.height, desc.width), **_values(desc)}

    @property
    def exposure_gain_dn(self) -> float:
        """DN per unit of intensity, finite, >= 0; later frames use a new value."""
        return self._exposure_gain_dn

    @exposure_gain_dn.setter
    def exposure_gain_dn(self, value: float) -> None:
        gain = _check.real(value, "exposure_gain_dn")
        with exclusive(self):
            _library.call("clspSensorSetExposureGain", self._get(), gain)
            self._exposure_gain_dn, self._dn_per_photon = gain, 0.0
            self._options.update(exposure_gain_dn=gain, photons_per_unit=None)

    def configure(self, **changes: Any) -> None:
        """Changes settings of the sensor, by the names of the constructor's arguments; what is not named stays.

        Draws the fixed pattern again and forgets the frame before. Blocks. If it fails, the sensor is as it was.
        ``None`` puts a setting back to its default.
        """
        _check.known_names(changes, self._options, "configure()")
        with exclusive(self):
            given = {**self._options, **changes}
            desc, options = _description(self.shape, given)
            _library.call("clspSensorConfigure", self._get(), ctypes.byref(desc))
            self._options = options
            self.bits = desc.bits
            self._exposure_gain_dn = _exposure_gain(desc)
            self._dn_per_photon = _dn_per_photon(desc)
            self._converter = _converter(desc, options)

    def reset_lag(self) -> None:
        """Forgets the frame before: the next one has no lag."""
        with exclusive(self):
            _library.call("clspSensorResetLag", self._get())

    def expose(
        self,
        intensity: ImageLike,
        *,
        frame_index: int = 0,
        dtype: npt.DTypeLike | None = None,
        out: Any = None,
        queue: QueueLike | None = None,
    ) -> Any:
        """Exposes one frame. Blocks.

        Args:
            intensity: (height, width), finite, >= 0.
            frame_index: counter of the temporal noise, below 2^48.
            dtype: uint16 codes (default), uint8 codes (bits = 8 only), or float32 (code / (2^bits - 1) *
                float_full_scale).
            out: array or device image to write to; None: a new array.

        Returns:
            `out`, or a new (height, width) array.
        """
        frame_index = _check.integer(frame_index, "frame_index", 64)
        with exclusive(self):
            command = self._command(queue)
            target = command.output(out, self.shape, OUTPUT_DTYPES, dtype)
            source = command.image(intensity, "intensity", self.shape)
            return target.finish(self._enqueue(command, "Expose", source, frame_index, target.image))

    def enqueue_expose(
        self,
        intensity: DeviceImageLike,
        frame_index: int,
        output: DeviceImageLike,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`expose` from a float32 device image into a uint16, uint8 or float32 one, asynchronously.

        The output must not overlap the intensity, except that a float32 output may be the intensity itself.
        """
        frame_index = _check.integer(frame_index, "frame_index", 64)
        with exclusive(self):
            command = self._asynchronous(queue, wait_for)
            source = command.image(intensity, "intensity", self.shape)
            target = command.image(output, "output", self.shape, UINT16)
            return self._enqueue(command, "Expose", source, frame_index, target)

    def demosaic(self, raw: ImageLike, bayer: str, *, out: Any = None, queue: QueueLike | None = None) -> Any:
        """Three colours for each pixel of a frame, by bilinear interpolation. Blocks.

        The black level is not taken off, and a flat grey stays flat.

        Args:
            raw: (height, width) uint16 or uint8 codes, or float32.
            bayer: "RGGB", "BGGR", "GRBG" or "GBRG".
            out: float32 array of (height, width, 3) or device image to write to; None: a new array.

        Returns:
            `out`, or a new (height, width, 3) array.
        """
        pattern = _check.choice(bayer, "bayer", BAYER)
        with exclusive(self):
            command = self._command(queue)
            source = command.image(raw, "raw", self.shape, UINT16, _raw)
            target = command.output(out, (*self.shape, 3))
            return target.finish(self._enqueue(command, "Demosaic", source, pattern, target.image))

    def enqueue_demosaic(
        self,
        raw: DeviceImageLike,
        bayer: str,
        rgb: DeviceImageLike,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`demosaic` from a uint16, uint8 or float32 device image into a float32 x 3 one, asynchronously."""
        pattern = _check.choice(bayer, "bayer", BAYER)
        with exclusive(self):
            command = self._asynchronous(queue, wait_for)
            source = command.image(raw, "raw", self.shape, UINT16)
            target = command.image(rgb, "rgb", self.shape, FLOAT32X3)
            return self._enqueue(command, "Demosaic", source, pattern, target)


_OPTIONS = _check.optional(Sensor.__init__)


def _raw(value: Any, name: str, shape: tuple[int, int]) -> npt.NDArray[Any]:
    given = _check.array(value, name)
    if given.dtype not in [np.dtype(dtype) for dtype in OUTPUT_DTYPES]:
        raise _check.format_error(name, given.dtype, OUTPUT_DTYPES)
    _check.check_shape(given, name, shape)
    return np.ascontiguousarray(given)


def _description(shape: tuple[int, int], given: dict[str, Any]) -> tuple[_library.ClspSensorDesc, dict[str, Any]]:
    """A description, and the options that it was made of with maps of our own."""
    options = dict(given)
    desc = Sensor._arguments.describe_image(shape, options)
    if options["mosaic_gain"] is not None:
        desc.mosaic_gain = _mosaic(options["mosaic_gain"])
    for name, low in (("dark_frame_dn", -np.inf), ("gain_map", 0.0)):
        if options[name] is not None:
            image = np.array(_check.float_plane(options[name], name, (desc.height, desc.width)))
            _check.within(image, name, low)
            setattr(desc, name, _check.pointer(image))
            options[name] = image
    return desc, options


def _exposure_gain(desc: _library.ClspSensorDesc) -> float:
    """In DN per unit of intensity, also where it was given in photons."""
    if desc.photons_per_unit > 0:
        return _dn_per_photon(desc) * float(desc.photons_per_unit)
    return float(desc.exposure_gain_dn)


def _dn_per_photon(desc: _library.ClspSensorDesc) -> float:
    """0: the exposure is not given in photons."""
    if desc.photons_per_unit > 0:
        return float(desc.conversion_gain_dn_per_e * desc.quantum_efficiency)
    return 0.0


def _converter(desc: _library.ClspSensorDesc, options: Mapping[str, Any]) -> _doubts.Converter:
    dark = options["dark_frame_dn"]
    return _doubts.Converter(
        bits=desc.bits,
        saturation_dn=desc.conversion_gain_dn_per_e * desc.full_well_e if desc.full_well_e > 0 else desc.saturation_dn,
        offset_dn=desc.black_level_dn + (0.0 if dark is None else float(dark.mean())),
        noise_dn=desc.read_noise_dn,
        effective_bits=desc.effective_bits or desc.bits,
        gamma=desc.gamma,
        cubic_nonlinearity=desc.cubic_nonlinearity,
        nonlinearity_power=desc.nonlinearity_power,
        float_full_scale=desc.float_full_scale,
    )


def _values(desc: _library.ClspSensorDesc) -> dict[str, Any]:
    """A description as keyword arguments."""
    return {**Sensor._arguments.values(desc, _OPTIONS), "mosaic_gain": list(desc.mosaic_gain)}
