"""Philox4x32-10 on the device: raw blocks, and images of bits, uniforms and normals.

Source: J. K. Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC'11; bit-exact with the Random123 library.
Image mapping, with Q = ceil(height / 4): pixel (x, y) takes word j = y // Q of the block with counter
(x, y mod Q, frame_index & 0xffffffff, stream | (frame_index >> 32) << 16) and key (seed & 0xffffffff, seed >> 32). The
integers are the same on every device and for any work-group size.

Threads: all functions may be called from any number of threads at once.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _interop, _library
from ._interop import EventLike, SupportsIntPtr, enqueue
from ._staging import Command, DeviceImageLike, Staging, device_image
from .runtime import FLOAT32, UINT32, Buffer, Context, Event, QueueLike, memory_pointer, queue_pointer
from .runtime import resolve_context as _resolve

__all__ = ["bits", "blocks", "enqueue_blocks", "enqueue_fill", "normal", "uniform"]

_DISTRIBUTION = _library.words("DISTRIBUTION")
_ARGUMENTS = _check.Arguments(_library.ClspPhiloxDesc, words={"distribution": _DISTRIBUTION})


def _key(key: Any) -> ctypes.Array[ctypes.c_uint32]:
    return (ctypes.c_uint32 * 2)(*_check.uint32_array(key, "key", (2,)).tolist())


def blocks(
    counters: npt.ArrayLike,
    key: npt.ArrayLike,
    *,
    local_size: int = 0,
    context: Context | None = None,
    queue: QueueLike | None = None,
) -> npt.NDArray[np.uint32]:
    """Runs Philox4x32-10 on an array of counters. Blocks.

    Args:
        counters: (n, 4) integers from 0 to 2^32 - 1.
        key: two such integers, the same for all counters.
        local_size: work-group size; 0 leaves it to the device. The result does not depend on it.

    Returns:
        (n, 4) uint32.
    """
    source = _check.uint32_array(counters, "counters", (None, 4))
    context = _resolve(context)
    with Buffer(source.nbytes, context=context) as memory:
        memory.write(source, queue=queue)
        enqueue_blocks(memory, key, source.shape[0], memory, local_size=local_size, context=context, queue=queue).wait()
        return memory.read(queue=queue).view(np.uint32).reshape(source.shape)


def enqueue_blocks(
    counters: Buffer | SupportsIntPtr | int,
    key: npt.ArrayLike,
    count: int,
    blocks: Buffer | SupportsIntPtr | int,
    *,
    counters_offset_bytes: int = 0,
    blocks_offset_bytes: int = 0,
    local_size: int = 0,
    context: Context | None = None,
    queue: QueueLike | None = None,
    wait_for: Sequence[EventLike] | None = None,
) -> Event:
    """Like :func:`blocks` in device memory, asynchronously.

    Args:
        counters: buffer (ours, PyOpenCL's or an integer cl_mem) of `count` x 4 uint32.
        key: two integers from 0 to 2^32 - 1.
        count: number of counters, at least 1.
        blocks: buffer for the result; may be the counters.
    """
    context = _resolve(context, counters, blocks)
    return enqueue(
        "clspPhiloxEnqueueBlocks",
        context._get(),
        queue_pointer(queue, context),
        memory_pointer(counters, "counters"),
        _check.integer(counters_offset_bytes, "counters_offset_bytes", 64),
        _key(key),
        _check.integer(count, "count", 64),
        _check.integer(local_size, "local_size", 64),
        memory_pointer(blocks, "blocks"),
        _check.integer(blocks_offset_bytes, "blocks_offset_bytes", 64),
        waiting=_interop.wait_list(wait_for),
    )


def enqueue_fill(
    image: DeviceImageLike,
    distribution: str = "uniform",
    *,
    seed: int | None = None,
    frame_index: int | None = None,
    stream: int | None = None,
    local_size: int | None = None,
    context: Context | None = None,
    queue: QueueLike | None = None,
    wait_for: Sequence[EventLike] | None = None,
) -> Event:
    """Fills an image in device memory with random numbers, asynchronously.

    Args:
        image: uint32 for "bits", float32 for "uniform" and "normal". A bare buffer has no shape: wrap it.
        distribution: "bits", "uniform" in (0, 1], or "normal" (mean 0, variance 1).
        seed: key, below 2^64.
        frame_index: below 2^48.
        stream: 0x8000 to 0xffff; lower ones are the library's own.
        local_size: work-group size; 0 leaves it to the device.

    What is None has the C library's default.
    """
    desc = _ARGUMENTS.describe(locals())
    desc.distribution = _check.choice(distribution, "distribution", _DISTRIBUTION)  # None is no choice
    context = _resolve(context, image)
    if _interop.is_pyopencl(image, "MemoryObjectHolder") or isinstance(image, Buffer):
        raise TypeError("image is a buffer without a shape; use DeviceImage.wrap(buffer, shape, dtype)")
    command = Command(Staging(context), queue, wait_for)
    view = device_image(image, "image", (0, 0), FLOAT32, context)
    return command.enqueue("clspPhiloxEnqueueFill", context._get(), desc, view)


def _fill(
    distribution: str,
    shape: tuple[int, int],
    out: Any,
    context: Context | None,
    queue: QueueLike | None,
    **numbers: Any,
) -> Any:
    """:func:`enqueue_fill` for the blocking functions below."""
    context = _resolve(context, out)
    staging = Staging(context)
    command = Command(staging, queue)
    try:
        target = command.output(
            out, _check.image_shape(shape), (UINT32.dtype if distribution == "bits" else np.float32,)
        )
        return target.finish(enqueue_fill(target.image, distribution, context=context, queue=command.queue, **numbers))
    finally:
        staging.clear()


def bits(
    shape: tuple[int, int],
    *,
    seed: int | None = None,
    frame_index: int | None = None,
    stream: int | None = None,
    local_size: int | None = None,
    out: Any = None,
    context: Context | None = None,
    queue: QueueLike | None = None,
) -> Any:
    """Random words as (height, width) uint32, or written to `out`, which is returned. Blocks.

    Arguments as for :func:`enqueue_fill`.
    """
    return _fill("bits", **locals())


def uniform(
    shape: tuple[int, int],
    *,
    seed: int | None = None,
    frame_index: int | None = None,
    stream: int | None = None,
    local_size: int | None = None,
    out: Any = None,
    context: Context | None = None,
    queue: QueueLike | None = None,
) -> Any:
    """Random numbers in (0, 1], fma(word, 2^-32, 2^-33), as (height, width) float32. Blocks.

    Arguments as for :func:`bits`.
    """
    return _fill("uniform", **locals())


def normal(
    shape: tuple[int, int],
    *,
    seed: int | None = None,
    frame_index: int | None = None,
    stream: int | None = None,
    local_size: int | None = None,
    out: Any = None,
    context: Context | None = None,
    queue: QueueLike | None = None,
) -> Any:
    """Standard normal numbers (Box-Muller on the words of a block) as (height, width) float32. Blocks.

    Arguments as for :func:`bits`.
    """
    return _fill("normal", **locals())
