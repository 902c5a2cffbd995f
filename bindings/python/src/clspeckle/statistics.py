"""First-order statistics, histogram and autocovariance of an image, computed on the device. All calls block.

Images are uint8, uint16 or float32 (other real dtypes are converted to float32), finite, in host or device memory. See
``statistics.h``.

Threads: all functions may be called from any number of threads at once.
"""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _library, errors
from ._interop import is_pyopencl
from ._staging import ImageLike, Operands, Staging, device_image, on_device
from .phase import mask_image
from .runtime import FLOAT32, Buffer, Context, QueueLike, queue_pointer, resolve_context

__all__ = ["Histogram", "Moments", "autocovariance", "histogram", "moments"]


@dataclasses.dataclass(frozen=True)
class Moments:
    """First-order statistics of the pixels that count."""

    count: int
    mean: float
    standard_deviation: float
    """Divided by count - 1; 0 for one pixel."""
    contrast: float
    """standard_deviation / mean; NaN where the mean is 0."""
    skewness: float
    """Third central moment over the cube of the standard deviation; NaN where that is 0."""
    excess_kurtosis: float
    """Fourth central moment over the fourth power, less 3; NaN likewise."""
    minimum: float
    maximum: float


@dataclasses.dataclass(frozen=True, eq=False)
class Histogram:
    """Counts of pixels."""

    counts: npt.NDArray[np.uint64]
    """Pixels in each bin of [low, high)."""
    edges: npt.NDArray[np.float64]
    """The bins' edges, one more than bins."""
    below: int
    """Pixels below low."""
    above: int
    """Pixels at or above high."""


@dataclasses.dataclass
class _Call:
    context: Context
    queue: int
    image: _library.ClspImage
    mask: Any
    shape: tuple[int, int]


@contextlib.contextmanager
def _prepared(image: Any, mask: Any, context: Context | None, queue: QueueLike | None) -> Iterator[_Call]:
    context = resolve_context(context, image, mask)
    queue = context.queue if queue is None else queue
    staging, operands = Staging(context), Operands()
    try:
        if on_device(image):
            if isinstance(image, Buffer) or is_pyopencl(image, "MemoryObjectHolder"):
                raise TypeError("image is a buffer without a shape; use DeviceImage.wrap(buffer, shape, dtype)")
            view = device_image(image, "image", (0, 0), FLOAT32, context)
        else:
            view = staging.upload("image", _pixels(image), queue, operands)
        size = (view.height, view.width)
        struct = operands.add(view)
        mask_struct = None
        if mask is not None:
            mask_struct = ctypes.byref(operands.add(mask_image(mask, "mask", size, staging, queue, operands)))
        operands.wait()  # these calls take no wait list
        yield _Call(context, queue_pointer(queue, context), struct, mask_struct, size)
    finally:
        staging.clear()


def _pixels(image: Any) -> npt.NDArray[Any]:
    given = _check.array(image, "image")
    if given.dtype in (np.uint8, np.uint16):
        _check.check_shape(given, "image", (None, None))
        return given
    plane = _check.float_plane(given, "image")
    _check.within(plane, "image", -np.inf)
    return plane


def moments(
    image: ImageLike,
    mask: ImageLike | None = None,
    *,
    context: Context | None = None,
    queue: QueueLike | None = None,
) -> Moments:
    """Mean, standard deviation, contrast, skewness, excess kurtosis, range.

    Args:
        image: (height, width).
        mask: (height, width) of bool or integers, or a uint8 device image: pixels that are not 0 count. None: all.
        context: None: the image's, else :func:`default_context`.
        queue: None for the context's.

    Raises:
        InvalidDataError: NaN or infinite pixels.
        InvalidArgumentError: no pixel counts.
    """
    result = _library.initialized(_library.ClspMoments)
    with _prepared(image, mask, context, queue) as call:
        _library.call(
            "clspStatisticsMoments",
            call.context._get(),
            call.queue,
            ctypes.byref(call.image),
            call.mask,
            ctypes.byref(result),
        )
    return Moments(
        count=result.count,
        mean=result.mean,
        standard_deviation=result.standard_deviation,
        contrast=result.contrast,
        skewness=result.skewness,
        excess_kurtosis=result.excess_kurtosis,
        minimum=result.minimum,
        maximum=result.maximum,
    )


def histogram(
    image: ImageLike,
    low: float,
    high: float,
    bins: int,
    mask: ImageLike | None = None,
    *,
    context: Context | None = None,
    queue: QueueLike | None = None,
) -> Histogram:
    """Counts pixels in `bins` equal bins of [low, high).

    Args:
        image: (height, width).
        low: finite.
        high: finite, above low.
        bins: at least 1.
        mask: as for :func:`moments`.
    """
    low, high = _check.real(low, "low"), _check.real(high, "high")
    bins = _check.integer(bins, "bins", 31)
    if bins == 0:
        raise errors.InvalidArgumentError("bins is 0, expected at least 1")
    with _prepared(image, mask, context, queue) as call:
        counts = np.zeros(bins + 2, np.uint64)
        _library.call(
            "clspStatisticsHistogram",
            call.context._get(),
            call.queue,
            ctypes.byref(call.image),
            call.mask,
            low,
            high,
            bins,
            counts.ctypes.data_as(ctypes.POINTER(ctypes.c_uint64)),
        )
    return Histogram(counts[1:-1], np.linspace(low, high, bins + 1), int(counts[0]), int(counts[-1]))


def autocovariance(
    image: ImageLike, max_lag: int, *, context: Context | None = None, queue: QueueLike | None = None
) -> npt.NDArray[np.float32]:
    """Autocovariance of the image less its mean, 1 at lag 0, not periodic, each lag divided by its number of pairs.

    Args:
        image: (height, width).
        max_lag: largest lag in pixels along each axis, below the smaller side of the image.

    Returns:
        (2 max_lag + 1, 2 max_lag + 1) float32, lag (0, 0) in the centre.
    """
    lag = _check.integer(max_lag, "max_lag")
    with _prepared(image, None, context, queue) as call:
        if lag >= min(call.shape):
            raise errors.InvalidArgumentError(
                f"max_lag is {lag}, expected less than the smaller side of the image, {min(call.shape)}"
            )
        result = np.empty((2 * lag + 1, 2 * lag + 1), np.float32)
        _library.call(
            "clspStatisticsAutocovariance",
            call.context._get(),
            call.queue,
            ctypes.byref(call.image),
            lag,
            result.ctypes.data_as(ctypes.POINTER(ctypes.c_float)),
        )
    return result
