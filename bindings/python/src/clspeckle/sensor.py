"""From intensity to codes: exposure, dark frame, hot and cold pixels, temporal noise, saturation, black level, ADC.

    signal = min(exposure_gain_dn * I, saturation_dn)     0 at cold pixels
    value  = signal + black_level_dn + dark_frame(x, y) + hot(x, y) + read_noise_dn * n
    code   = clip(round_half_to_even(value), 0, 2^bits - 1)

n is standard normal, independent for each pixel and frame. Equations: ``sensor.h``; thesis sections 3.2.1 to 3.2.3.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _library
from ._handle import Handle, create, exclusive
from ._interop import EventLike
from ._staging import DeviceImageLike, ImageLike, Operands, Staging, device_image, output
from .aperture import irradiance_image
from .runtime import FLOAT32, UINT16, Context, DeviceImage, Event, QueueLike, queue_pointer, resolve_context

__all__ = ["Sensor"]

_REALS = (
    "exposure_gain_dn",
    "saturation_dn",
    "black_level_dn",
    "read_noise_dn",
    "hot_pixel_fraction",
    "hot_pixel_mean_dn",
    "cold_pixel_fraction",
    "float_full_scale",
)

OUTPUT_DTYPES = (np.uint16, np.uint8, np.float32)
"""What a sensor writes; the first one is the default."""


class Sensor(Handle):
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
        quantize: False: a float32 output is only clipped, not quantized.
        context: None for :func:`default_context`.

    What is None has the C library's default, see :meth:`defaults`.

    Threads: calls on one object from several threads run one after the other; different objects run at the same time.
    """

    _release = "clspSensorRelease"

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
        context: Context | None = None,
    ) -> None:
        desc = _library.initialized(_library.ClspSensorDesc)
        desc.height, desc.width = _check.image_shape(shape)
        given: dict[str, Any] = {
            "bits": bits,
            "seed": seed,
            "exposure_gain_dn": exposure_gain_dn,
            "saturation_dn": saturation_dn,
            "black_level_dn": black_level_dn,
            "read_noise_dn": read_noise_dn,
            "hot_pixel_fraction": hot_pixel_fraction,
            "hot_pixel_mean_dn": hot_pixel_mean_dn,
            "cold_pixel_fraction": cold_pixel_fraction,
            "float_full_scale": float_full_scale,
        }
        _check.assign(desc, given, {"bits": 32, "seed": 64}, _REALS)
        if dark_frame_dn is not None:
            dark = _check.float_plane(dark_frame_dn, "dark_frame_dn", (desc.height, desc.width))
            _check.within(dark, "dark_frame_dn", -np.inf)
            desc.dark_frame_dn = dark.ctypes.data_as(ctypes.POINTER(ctypes.c_float))
        if quantize is not None:
            desc.quantize = _check.flag(quantize, "quantize")
        self.context = resolve_context(context)
        self._adopt(create("clspSensorCreate", self.context._get(), ctypes.byref(desc)))
        self.shape: tuple[int, int] = (desc.height, desc.width)
        self.bits: int = desc.bits
        self._exposure_gain_dn: float = desc.exposure_gain_dn
        self._staging = Staging(self.context)

    def _forget(self) -> None:
        self._staging.clear()

    @staticmethod
    def defaults() -> dict[str, Any]:
        """The C library's defaults of the keyword arguments."""
        desc = _library.initialized(_library.ClspSensorDesc)
        result = _check.defaults(desc, {}, ("bits", "seed", *_REALS, "quantize"))
        result["quantize"] = bool(result["quantize"])
        return result

    @property
    def exposure_gain_dn(self) -> float:
        """DN per unit of intensity, finite, >= 0; later frames use a new value."""
        return self._exposure_gain_dn

    @exposure_gain_dn.setter
    def exposure_gain_dn(self, value: float) -> None:
        gain = _check.real(value, "exposure_gain_dn")
        with exclusive(self):
            _library.call("clspSensorSetExposureGain", self._get(), gain)
            self._exposure_gain_dn = gain

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
            queue = self.context.queue if queue is None else queue
            target = output(out, "out", self.shape, OUTPUT_DTYPES, dtype, self._staging, self.context)
            operands = Operands()
            source = irradiance_image(intensity, "intensity", self.shape, self._staging, queue, operands)
            return target.finish(queue, self._enqueue(source, frame_index, target.image, operands, queue, None))

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
            source = device_image(intensity, "intensity", self.shape, FLOAT32, self.context)
            target = device_image(output, "output", self.shape, UINT16, self.context)
            return self._enqueue(source, frame_index, target, Operands(), queue, wait_for)

    def _enqueue(
        self,
        intensity: DeviceImage,
        frame_index: int,
        image: DeviceImage,
        operands: Operands,
        queue: QueueLike | None,
        wait_for: Sequence[EventLike] | None,
    ) -> Event:
        return operands.enqueue(
            "clspSensorEnqueueExpose",
            self._get(),
            queue_pointer(queue, self.context),
            ctypes.byref(operands.add(intensity)),
            frame_index,
            ctypes.byref(operands.add(image)),
            wait_for=wait_for,
        )
