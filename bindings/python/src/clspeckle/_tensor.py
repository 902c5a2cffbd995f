"""Tensors of other packages, by DLPack: host memory as an OpenCL buffer, and a CPU's buffer as an array, not copied.

OpenCL's functions are found through the library, which is linked with its loader. No package of tensors is imported.
"""

from __future__ import annotations

import collections
import ctypes
import logging
import threading
import weakref
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _library, errors

# dlpack.h: kDLCPU, kDLCUDAHost, kDLROCMHost, kDLCUDAManaged
CPU = 1
_HOST = (CPU, 3, 11, 13)
# cl.h
_CL_DEVICE_TYPE, _CL_DEVICE_TYPE_CPU = 0x1000, 1 << 1
_CL_MEM_READ_WRITE, _CL_MEM_USE_HOST_PTR = 1 << 0, 1 << 3
_CL_MAP_READ_WRITE = 3

# What DLPack says of writing since its version 1.
TELLS_READ_ONLY = tuple(int(n) for n in np.__version__.split(".")[:2]) >= (2, 1)

_log = logging.getLogger("clspeckle")


def is_tensor(value: Any) -> bool:
    """True for an object of another package than NumPy that speaks DLPack."""
    return hasattr(value, "__dlpack_device__") and not isinstance(value, (np.ndarray, np.generic))


def as_array(value: Any, name: str) -> npt.NDArray[Any]:
    """A tensor as NumPy sees it; one in the memory of a GPU is copied to the host's, which the log says."""
    device = value.__dlpack_device__()
    try:
        kind, number = (int(part) for part in device)
    except (TypeError, ValueError):
        raise TypeError(f"its __dlpack_device__() gives {device!r}, where DLPack has a type and a number") from None
    if kind in _HOST:
        array = np.from_dlpack(value)
        # Before 2.1 NumPy takes all tensors as read-only. PyTorch has none that are, and a way of its own.
        if not array.flags.writeable and hasattr(value, "data_ptr"):
            return np.asarray(value.numpy())
        return array
    _log.info(
        "%s is a tensor on another device (DLPack's type %d, number %d), whose memory OpenCL does not share: it is "
        "copied by way of the host",
        name,
        kind,
        number,
    )
    if hasattr(value, "cpu"):  # PyTorch
        return np.from_dlpack(value.cpu())
    if hasattr(value, "get"):  # CuPy
        return np.asarray(value.get())
    array = np.asarray(value)  # JAX
    if array.dtype.hasobject:
        raise TypeError(
            f"it lies on another device (DLPack's type {kind}, number {number}), whose memory OpenCL does not share, "
            "and has neither cpu(), get() nor __array__(); copy it to the host's memory first"
        )
    return array


def on_cpu(device: int) -> bool:
    """True for a cl_device_id whose memory is the host's."""
    kind = ctypes.c_uint64()
    function = _library.library().clGetDeviceInfo
    arguments = ctypes.c_void_p(device), _CL_DEVICE_TYPE, ctypes.c_size_t(8), ctypes.byref(kind), None
    return function(*arguments) == 0 and bool(kind.value & _CL_DEVICE_TYPE_CPU)


# Arrays whose memory a buffer uses, by their addresses, until OpenCL is done with the buffer.
_used: dict[int, Any] = {}


def _forget(_memory: int | None, key: int | None) -> None:
    _used.pop(key or 0, None)


# Never freed: a driver may call it at any time.
_FORGET = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(_forget)


def host_buffer(context: int, array: npt.NDArray[Any], size_bytes: int) -> int:
    """A cl_mem on an array's own memory, which lives as long as OpenCL uses the buffer."""
    library = _library.library()
    library.clCreateBuffer.restype = ctypes.c_void_p
    code = ctypes.c_int32()
    flags = ctypes.c_uint64(_CL_MEM_READ_WRITE | _CL_MEM_USE_HOST_PTR)
    size, address = ctypes.c_size_t(size_bytes), ctypes.c_void_p(array.ctypes.data)
    made = library.clCreateBuffer(ctypes.c_void_p(context), flags, size, address, ctypes.byref(code))
    _succeeded(code.value, "clCreateBuffer")
    holder = array[...]  # an object of its own: one array may be used by two buffers
    _used[id(holder)] = holder
    code.value = library.clSetMemObjectDestructorCallback(ctypes.c_void_p(made), _FORGET, ctypes.c_void_p(id(holder)))
    _succeeded(code.value, "clSetMemObjectDestructorCallback")
    return int(made)


# Drivers end a process in which two threads map and unmap one cl_mem at the same time.
_mapping = threading.Lock()
# Views that are gone, with a reference each. A finalizer may run while its own thread maps, so that it must not wait:
# whoever holds the lock unmaps for it.
_ended: collections.deque[Any] = collections.deque()


def mapped(queue: int, memory: Any, offset_bytes: int, size_bytes: int) -> Any:
    """The bytes of a cl_mem of a CPU, where they lie; it is kept while they are used, also if `memory` is closed."""
    library = _library.library()
    library.clEnqueueMapBuffer.restype = ctypes.c_void_p
    code, event, pointer = ctypes.c_int32(), ctypes.c_void_p(), int(memory.int_ptr)
    region = ctypes.c_size_t(offset_bytes), ctypes.c_size_t(size_bytes)
    pointers = ctypes.c_void_p(queue), ctypes.c_void_p(pointer)
    flags = 0, ctypes.c_uint64(_CL_MAP_READ_WRITE)
    after = 0, None, ctypes.byref(event), ctypes.byref(code)
    _succeeded(library.clRetainMemObject(ctypes.c_void_p(pointer)), "clRetainMemObject")
    with _mapping:
        address = library.clEnqueueMapBuffer(*pointers, *flags, *region, *after)
    _unmap_ended()
    if code.value != 0:
        library.clReleaseMemObject(ctypes.c_void_p(pointer))
    _succeeded(code.value, "clEnqueueMapBuffer")
    view = (ctypes.c_uint8 * size_bytes).from_address(address)
    weakref.finalize(view, _unmap, queue, pointer, address, memory).atexit = False
    # Not in the lock: what the queue waits for may need another thread, which may map, too.
    code.value = library.clWaitForEvents(1, ctypes.byref(event))
    library.clReleaseEvent(event)
    _succeeded(code.value, "clWaitForEvents")
    return view


def _unmap(*view: Any) -> None:
    if not _library.was_forked():
        _ended.append(view)
        _unmap_ended()


def _unmap_ended() -> None:
    """Unmaps the views that are gone, or leaves it to the thread that holds the lock, which looks after it."""
    library = _library.library()
    while _ended and _mapping.acquire(blocking=False):
        try:
            while _ended:
                queue, pointer, address, _memory = _ended.popleft()  # the memory keeps the queue
                pointers = ctypes.c_void_p(queue), ctypes.c_void_p(pointer), ctypes.c_void_p(address)
                library.clEnqueueUnmapMemObject(*pointers, 0, None, None)
                library.clReleaseMemObject(pointers[1])
        finally:
            _mapping.release()


def _succeeded(code: int, function: str) -> None:
    if code != 0:
        raise errors.OpenCLError(f"OpenCL gave the error code {code}", function=function, opencl_code=code)
