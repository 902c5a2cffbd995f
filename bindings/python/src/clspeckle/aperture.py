"""The lens's aperture: field, FFT, pupil, inverse FFT, intensity, both polarizations.

    U_k = sqrt(I0) z_k              on the field grid
    V_k = IFFT2( FFT2(U_k) P )      P the amplitude of the pupil, radius D/2 cycles per pixel
    I   = (1 + p)/2 |V_1|^2 + (1 - p)/2 |V_2|^2                                         (thesis eq. 32 and 40)

and with oversampling the mean of I over the samples of each pixel, or with a fill factor its integral over the
light-sensitive square. D = pixel_pitch_m / (wavelength_m * f_number) is the
relative diameter in cycles per pixel; D <= oversampling is needed. Equations: ``aperture.h``.
"""

from __future__ import annotations

import ctypes
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _library, errors
from ._handle import exclusive
from ._interop import EventLike, SupportsIntPtr
from ._staging import DeviceImageLike, ImageLike, Stage
from .phase import Phase
from .runtime import Buffer, Context, Event, QueueLike, memory_pointer

__all__ = ["Aperture", "ApertureInfo"]

_PUPIL = _library.words("PUPIL")
_FIRST_ZERNIKE, _ZERNIKE_COUNT = 4, 12


@dataclasses.dataclass(frozen=True)
class ApertureInfo:
    """What an aperture turned out to be."""

    grid_width: int
    """Size of the FFT; larger than oversampling * width where padding was needed."""
    grid_height: int
    """Likewise along y."""
    pupil_samples: int
    """Grid frequencies with a transmission above 0."""
    relative_diameter: float
    """D in cycles per pixel."""
    mean_transmission: float
    """Mean of abs(P)^2 over the grid's frequencies before any normalization: E[I] / I0 of a flat image."""
    workspace_bytes: int
    """Work memory that a frame needs."""
    fft_engine: str
    """"cpu", "gpu" or "clfft", the names of CLSPECKLE_FFT."""
    fft_reason: str
    """Why it is "clfft"; empty if it is not."""
    fft_source: str
    """Whose choice it was: CLSPECKLE_FFT, a tuning record with its size (:func:`tune`), a default."""
    column_group: tuple[int, int] | None
    """With "gpu": columns in a work-group, and work-items for each of them."""
    row_group: tuple[int, int] | None
    """With "gpu": rows in a work-group, and work-items for each of them."""


class Aperture(Stage):
    """A lens's aperture. Give `relative_diameter`, or `f_number`, `pixel_pitch_m` and `wavelength_m`.

    Args:
        shape: (height, width) of the image in pixels, each 1 to 16384.
        f_number: > 0.
        pixel_pitch_m: > 0, metres.
        wavelength_m: > 0, metres.
        relative_diameter: D in cycles per pixel, > 0; None: from the three above.
        degree_of_polarization: p, 0 to 1.
        normalization: "transmission" (a smaller aperture passes less light, ~ D^2) or "unit_mean" (mean of I = mean
            of I0).
        oversampling: field samples per pixel and axis, 1 to 8; as that of the phase.
        guard_px: pixels of padding at least; as that of the phase.
        soft_rim: part of the radius, 0 to 1, over which the pupil falls from 1 to 0 by a raised cosine.
        pupil: "circle", "polygon" (a diaphragm of blades, corners on the rim), "ring" (a circle with its centre
            blocked) or "image"; None: what pupil_image or blade_count ask for, else a circle. An array is a
            pupil_image.
        pupil_image: (height, width) amplitude transmissions instead of a circle, real ones in [0, 1] or complex ones of
            magnitudes up to 1; covers the square of side D around the axis, and is looked up bilinearly.
        blade_count: of a polygon, 3 to 32.
        blade_rotation_rad: turns the polygon; 0: a corner points along +x.
        blade_curvature: 0: straight edges, 1: the circle through the corners.
        obstruction_ratio: radius of the blocked centre over the pupil's, 0 to below 1; of any shape.
        defocus_waves: w of the pupil phase 2 pi w rho^2, rho = 1 at the rim.
        zernike_waves: RMS waves of Noll's Zernike polynomials: {index: waves} with indices 4 to 15, or a sequence of up
            to 12 for the indices from 4 on.
        fill_factor: light-sensitive part of a pixel's area, above 0 to 1; 0: the mean over the pixel's own samples.
        workspace_from_host: True: the application gives the work memory by :meth:`set_workspace`.
        context: None for :func:`default_context`.

    What is None has the C library's default, see :meth:`defaults`.

    Threads: calls on one object from several threads run one after the other; different objects run at the same time.
    """

    _c_name = "clspAperture"
    _arguments = _check.Arguments(
        _library.ClspApertureDesc,
        words={"normalization": _library.words("NORMALIZATION"), "pupil": _PUPIL},
    )

    def __init__(
        self,
        shape: tuple[int, int],
        *,
        f_number: float | None = None,
        pixel_pitch_m: float | None = None,
        wavelength_m: float | None = None,
        relative_diameter: float | None = None,
        degree_of_polarization: float | None = None,
        normalization: str | None = None,
        oversampling: int | None = None,
        guard_px: int | None = None,
        soft_rim: float | None = None,
        pupil: str | npt.ArrayLike | None = None,
        pupil_image: npt.ArrayLike | None = None,
        blade_count: int | None = None,
        blade_rotation_rad: float | None = None,
        blade_curvature: float | None = None,
        obstruction_ratio: float | None = None,
        defocus_waves: float | None = None,
        zernike_waves: Mapping[int, float] | Sequence[float] | npt.NDArray[Any] | None = None,
        fill_factor: float | None = None,
        workspace_from_host: bool = False,
        context: Context | None = None,
    ) -> None:
        workspace_from_host = bool(_check.flag(workspace_from_host, "workspace_from_host"))  # None is no choice
        name = "pupil_image"
        if hasattr(pupil, "__len__") and not isinstance(pupil, (str, bytes)):
            if pupil_image is not None:
                raise TypeError("pupil is an array, and pupil_image was given, too; give one of them")
            pupil, pupil_image, name = None, _check.array(pupil, "pupil"), "pupil"
        desc = self._arguments.describe_image(shape, locals())
        if relative_diameter is not None and desc.relative_diameter == 0:
            # For C a 0 means "not given"; here None does.
            raise _check.range_error("relative_diameter", relative_diameter, "> 0 (None: from f_number)")
        desc.pupil = _shape_of_pupil(pupil, pupil_image, blade_count)
        if zernike_waves is not None:
            desc.zernike_waves = _zernike(zernike_waves)
        if pupil_image is not None:
            image, imaginary = _amplitudes(pupil_image, name)
            desc.pupil_image = _check.pointer(image)
            desc.pupil_height, desc.pupil_width = image.shape
            if imaginary is not None:
                desc.pupil_image_imaginary = _check.pointer(imaginary)
        self._create(desc, context)
        self.shape: tuple[int, int] = (desc.height, desc.width)
        self._keeps_mean = desc.normalization == _library.CLSP_NORMALIZATION_UNIT_MEAN

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """The C library's defaults of the keyword arguments."""
        result = super().defaults()
        result["zernike_waves"] = np.array(_library.initialized(_library.ClspApertureDesc).zernike_waves)
        result["relative_diameter"] = result["relative_diameter"] or None
        return result

    def info(self) -> ApertureInfo:
        """Grid, diameter, transmission, work memory."""
        info = _library.fetched(_library.ClspApertureInfo, "clspApertureGetInfo", self._get())
        return _library.record(
            ApertureInfo,
            info,
            column_group=(info.column_lines, info.column_work_items) if info.column_lines else None,
            row_group=(info.row_lines, info.row_work_items) if info.row_lines else None,
        )

    def set_workspace(
        self,
        memory: Buffer | SupportsIntPtr | int,
        *,
        offset_bytes: int = 0,
        size_bytes: int | None = None,
    ) -> None:
        """Gives the work memory of ``workspace_from_host=True``; it is retained.

        Args:
            memory: a :class:`Buffer`, a ``pyopencl.Buffer`` or an integer cl_mem.
            offset_bytes: a multiple of 4096.
            size_bytes: at least ``info().workspace_bytes``; None: all from the offset on (not with an integer).

        The content is undefined after each frame: apertures that never run at the same time may share it.
        """
        offset = _check.integer(offset_bytes, "offset_bytes", 64)
        pointer = memory_pointer(memory, "memory")
        if size_bytes is None:
            whole = memory.size_bytes if isinstance(memory, Buffer) else getattr(memory, "size", None)
            if whole is None:
                raise TypeError("size_bytes is needed with an integer handle")
            size_bytes = max(0, int(whole) - offset)
        with exclusive(self):
            size = _check.integer(size_bytes, "size_bytes", 64)
            _library.call("clspApertureSetWorkspace", self._get(), pointer, offset, size)

    def pupil(self, *, queue: QueueLike | None = None) -> npt.NDArray[Any]:
        """P after normalization, (grid_height, grid_width), FFT order (frequency 0 first): float32, or with defocus,
        aberrations or a complex image complex64. Blocks."""
        info = self.info()
        shape = (info.grid_height, info.grid_width)
        with exclusive(self):
            image = self._staging.image("pupil", shape, np.float32)
            try:
                event = self.enqueue_pupil(image, queue=queue)
            except errors.InvalidFormatError:  # an effect of a pipeline may have made it complex, so nobody but C knows
                image = self._staging.image("pupil", (*shape, 2), np.float32)
                event = self.enqueue_pupil(image, queue=queue)
                parts = image.read(queue=queue, wait_for=[event])
                return np.ascontiguousarray(parts).view(np.complex64)[..., 0]
            return image.read(queue=queue, wait_for=[event])

    def enqueue_pupil(
        self,
        pupil: DeviceImageLike,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`pupil` into a float32 device image of (grid_height, grid_width), asynchronously; with defocus,
        aberrations or a complex image of (grid_height, grid_width, 2), real and imaginary part."""
        info = self.info()
        with exclusive(self):
            command = self._asynchronous(queue, wait_for)
            return self._enqueue(command, "Pupil", command.image(pupil, "pupil", (info.grid_height, info.grid_width)))

    def intensity(self, phase: Phase, irradiance: ImageLike, *, out: Any = None, queue: QueueLike | None = None) -> Any:
        """Speckles an image. Blocks.

        Args:
            phase: same shape, oversampling and guard_px; two polarizations if p < 1. Must have been refreshed once.
            irradiance: ideal image I0, (height, width), finite, >= 0. In a float32 device image NaN, infinite and
                negative pixels count as 0.
            out: float32 array, or a float32 device image, which may be the irradiance itself; None: a new array.

        Returns:
            `out`, or a new (height, width) float32 array: the intensity I.
        """
        _require_phase(phase)
        with exclusive(self, phase):
            command = self._command(queue)
            target = command.output(out, self.shape)
            source = command.image(irradiance, "irradiance", self.shape)
            return target.finish(self._enqueue(command, "Intensity", phase._get(), source, target.image))

    def enqueue_intensity(
        self,
        phase: Phase,
        irradiance: DeviceImageLike,
        intensity: DeviceImageLike,
        *,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`intensity` from one float32 device image into another, asynchronously."""
        _require_phase(phase)
        with exclusive(self, phase):
            command = self._asynchronous(queue, wait_for)
            source = command.image(irradiance, "irradiance", self.shape)
            target = command.image(intensity, "intensity", self.shape)
            return self._enqueue(command, "Intensity", phase._get(), source, target)


def _shape_of_pupil(pupil: Any, pupil_image: Any, blade_count: Any) -> int:
    """CLSP_PUPIL_* from the arguments that belong to one shape."""
    implied = "image" if pupil_image is not None else "polygon" if blade_count is not None else None
    if pupil is None:
        return _PUPIL[implied or "circle"]
    shape = _check.choice(pupil, "pupil", _PUPIL)
    if pupil == "image" and pupil_image is None:
        raise errors.InvalidArgumentError('pupil is "image", but pupil_image is missing')
    if pupil_image is not None and pupil != "image":
        raise errors.InvalidArgumentError(f'pupil is "{pupil}", but pupil_image was given, which is for "image"')
    if blade_count is not None and pupil != "polygon":
        raise errors.InvalidArgumentError(f'pupil is "{pupil}", but blade_count was given, which is for "polygon"')
    return shape


def _amplitudes(value: Any, name: str) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32] | None]:
    """The real and, if there are any, imaginary parts of a pupil's transmissions."""
    given = _check.array(value, name)
    if given.dtype.kind != "c":
        image = _check.light_plane(given, name, mean=False)
        _check.within(image, name, 0.0, 1.0)
        return image, None
    _check.check_shape(given, name, (None, None))
    magnitude = np.abs(given)
    bad = ~(magnitude <= 1 + 1e-6)
    if bad.any():
        raise errors.InvalidDataError(
            f"{name} must hold complex numbers of magnitudes from 0 to 1; {_check.places(bad)}, value "
            f"{given[np.unravel_index(int(np.argmax(bad)), bad.shape)]}, out of that"
        )
    parts = (np.clip(np.ascontiguousarray(part, np.float32), -1, 1) for part in (given.real, given.imag))
    return next(parts), next(parts)


def _zernike(value: Any) -> ctypes.Array[ctypes.c_double]:
    """The twelve coefficients from {Noll index: waves} or a sequence that begins with index 4."""
    last = _FIRST_ZERNIKE + _ZERNIKE_COUNT - 1
    waves = [0.0] * _ZERNIKE_COUNT
    if isinstance(value, Mapping):
        for index, wave in value.items():
            number = _check.integer(index, "an index of zernike_waves")
            if not _FIRST_ZERNIKE <= number <= last:
                raise _check.range_error("an index of zernike_waves", number, f"{_FIRST_ZERNIKE} to {last} (Noll)")
            waves[number - _FIRST_ZERNIKE] = _check.real(wave, f"zernike_waves[{number}]")
    else:
        given = _check.array(value, "zernike_waves")
        if given.dtype.kind not in "fiu":
            raise _check.format_error("zernike_waves", given.dtype, (np.float64,))
        if given.ndim != 1 or not 1 <= given.size <= _ZERNIKE_COUNT:
            raise errors.InvalidArgumentError(
                f"zernike_waves has shape {given.shape}, expected 1 to {_ZERNIKE_COUNT} numbers (Noll indices from "
                f"{_FIRST_ZERNIKE} on) or a dictionary of them"
            )
        waves[: given.size] = given.tolist()
    return (ctypes.c_double * _ZERNIKE_COUNT)(*waves)


def _require_phase(value: Any) -> None:
    if not isinstance(value, Phase):
        raise TypeError(f"phase must be a clspeckle.Phase, got {_check.kind(value)}")
