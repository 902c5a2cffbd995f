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
from ._staging import Command, ImageLike, Staging, device_image, on_device
from .runtime import FLOAT32, Buffer, Context, QueueLike, queue_pointer, resolve_context

__all__ = ["Histogram", "Moments", "autocovariance", "histogram", "moments"]


@dataclasses.dataclass(frozen=True)
class Moments:
    """First-order statistics of the pixels that count."""

    count: int
    """Pixels that count."""
    mean: float
    """Of their values."""
    standard_deviation: float
    """Divided by count - 1; 0 for one pixel."""
    contrast: float
    """standard_deviation / mean; NaN where the mean is 0."""
    skewness: float
    """Third central moment over the cube of the standard deviation; NaN where that is 0."""
    excess_kurtosis: float
    """Fourth central moment over the fourth power, less 3; NaN likewise."""
    minimum: float
    """Least value."""
    maximum: float
    """Greatest value."""


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


@contextlib.contextmanager
def _prepared(
    image: Any, mask: Any, context: Context | None, queue: QueueLike | None
) -> Iterator[tuple[tuple[int, int], list[Any]]]:
    """The size of the image, and what the arguments of the calls begin with; the mask is the last of them."""
    context = resolve_context(context, image, mask)
    staging = Staging(context)
    command = Command(staging, queue)
    try:
        if isinstance(image, Buffer) or is_pyopencl(image, "MemoryObjectHolder"):
            raise TypeError("image is a buffer without a shape; use DeviceImage.wrap(buffer, shape, dtype)")
        if on_device(image):
            view = device_image(image, "image", (0, 0), FLOAT32, context)
        else:
            view = command.upload("image", _check.number_plane(image, "image"))
        size = (view.height, view.width)
        masked = None if mask is None else command.mask(mask, "mask", size)
        structs = [None if each is None else ctypes.byref(command.add(each)) for each in (view, masked)]
        command.wait()  # these calls take no wait list
        yield size, [context._get(), queue_pointer(command.queue, context), *structs]
    finally:
        staging.clear()


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
    with _prepared(image, mask, context, queue) as (_, arguments):
        found = _library.fetched(_library.ClspMoments, "clspStatisticsMoments", *arguments)
    return _library.record(Moments, found)


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
    with _prepared(image, mask, context, queue) as (_, arguments):
        counts = np.zeros(bins + 2, np.uint64)
        _library.call("clspStatisticsHistogram", *arguments, low, high, bins, _check.pointer(counts))
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
    with _prepared(image, None, context, queue) as (shape, arguments):
        if lag >= min(shape):
            raise errors.InvalidArgumentError(
                f"max_lag is {lag}, expected less than the smaller side of the image, {min(shape)}"
            )
        result = np.empty((2 * lag + 1, 2 * lag + 1), np.float32)
        _library.call("clspStatisticsAutocovariance", *arguments[:-1], lag, _check.pointer(result))
    return result
