"""Devices, contexts, queues, events, buffers and images in device memory."""

from __future__ import annotations

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest

import clspeckle
from clspeckle import errors

DTYPES: list[tuple[Any, tuple[int, ...]]] = [
    (np.bool_, (5, 7)),
    (np.uint8, (5, 7)),
    (np.uint16, (5, 7)),
    (np.uint32, (5, 7)),
    (np.float32, (5, 7)),
    (np.complex64, (5, 7)),
    (np.float32, (5, 7, 2)),
    (np.float32, (5, 7, 3)),
    (np.float32, (5, 7, 4)),
    (np.float32, (1, 1)),
    (np.uint8, (1, 9)),
    (np.uint8, (9, 1)),
]


def sample(dtype: Any, shape: tuple[int, ...]) -> Any:
    values = np.random.default_rng(1).integers(0, 200, shape)
    return (values % 2).astype(dtype) if dtype == np.bool_ else values.astype(dtype)


def test_devices_are_listed_best_first() -> None:
    devices = clspeckle.devices()
    assert devices
    assert [device.rank for device in devices] == list(range(len(devices)))
    first = devices[0]
    assert first.usable
    assert first.reason == ""
    assert first.compute_units > 0
    assert first.global_memory_bytes >= first.max_allocation_bytes > 0
    assert set(first.type) & {"cpu", "gpu", "accelerator", "custom"}
    assert first.device_id != 0
    assert first.platform_id != 0
    assert pickle.loads(pickle.dumps(first)) == first
    with pytest.raises(dataclasses.FrozenInstanceError):
        first.name = "other"  # type: ignore[misc]


def test_devices_are_explained() -> None:
    first = clspeckle.devices()[0]
    text = clspeckle.explain_devices()
    assert first.name in text
    assert first.platform_name in text
    assert "\0" not in text
    assert first.name in clspeckle.explain_devices(first)
    assert "no such device" in clspeckle.explain_devices("no such device")


def test_context_by_device_and_by_selector() -> None:
    first = clspeckle.devices()[0]
    for choice in (first, first.selector, first.name[:12].upper(), None):
        with clspeckle.Context(choice, disk_cache="off") as context:
            info = context.info()
            assert info.device_name == first.name
            assert info.platform_name == first.platform_name
            assert info.opencl_device == first.device_id
            assert first.name in repr(context)
    assert context.closed
    assert repr(context) == "<clspeckle.Context closed>"


def test_context_on_foreign_handles(context: clspeckle.Context) -> None:
    info = context.info()
    with clspeckle.Context.from_opencl(info.opencl_context, info.opencl_device) as shared:
        assert shared.info().opencl_context == info.opencl_context
        image = clspeckle.DeviceImage.from_array(np.ones((4, 4), np.float32), context=shared)
        assert clspeckle.statistics.moments(image, context=context).mean == 1


def test_default_context_is_one_and_comes_back_after_close() -> None:
    first = clspeckle.default_context()
    assert clspeckle.default_context() is first
    assert clspeckle.Phase((8, 8)).context is first
    first.close()
    second = clspeckle.default_context()
    assert second is not first
    assert not second.closed


def test_context_keeps_one_queue(context: clspeckle.Context) -> None:
    assert context.queue is context.queue
    context.queue.finish()
    context.queue.close()
    assert not context.queue.closed


def test_programs_and_memory_are_counted() -> None:
    with clspeckle.Context(disk_cache="off") as context:
        before = context.info()
        phase = clspeckle.Phase((16, 16), context=context)
        phase.refresh(0)
        after = context.info()
        assert after.programs_built > before.programs_built
        assert after.allocated_bytes > before.allocated_bytes
        phase.close()
        assert context.info().allocated_bytes == before.allocated_bytes


def test_disk_cache_is_used_and_found_again(tmp_path: Any) -> None:
    def built() -> tuple[int, int]:
        with clspeckle.Context(cache_dir=tmp_path, disk_cache="on") as context:
            clspeckle.Phase((16, 16), context=context).refresh(0)
            info = context.info()
            return info.programs_built, info.programs_from_cache

    cold, warm = built(), built()
    assert cold[0] > 0
    assert cold[1] == 0
    assert warm == (0, cold[0])


def test_buffer_holds_bytes(context: clspeckle.Context) -> None:
    with clspeckle.Buffer(16, context=context) as buffer:
        assert buffer.size_bytes == 16
        buffer.write(bytes(range(16)))
        buffer.write(np.array([1000], "<u4"), offset_bytes=4)
        expected = np.arange(16, dtype=np.uint8)
        expected[4:8] = np.frombuffer(np.array([1000], "<u4").tobytes(), np.uint8)
        np.testing.assert_array_equal(buffer.read(), expected)
        np.testing.assert_array_equal(buffer.read(3, offset_bytes=13), [13, 14, 15])
        out = np.zeros(4, np.uint32)
        written = buffer.enqueue_write(np.arange(4, dtype=np.uint32))
        buffer.enqueue_read(out, wait_for=[written]).wait()
        np.testing.assert_array_equal(out, np.arange(4))


@pytest.mark.parametrize(("dtype", "shape"), DTYPES)
def test_images_of_every_format_go_there_and_back(
    dtype: Any, shape: tuple[int, ...], context: clspeckle.Context
) -> None:
    array = sample(dtype, shape)
    image = clspeckle.DeviceImage.from_array(array, context=context)
    assert (image.height, image.width) == shape[:2]
    assert image.shape == shape
    assert image.dtype == array.dtype
    np.testing.assert_array_equal(image.read(), array)
    np.testing.assert_array_equal(np.asarray(image), array)
    assert np.asarray(image, dtype=np.complex128).dtype == np.complex128
    out = np.empty_like(array)
    assert image.read(out) is out
    np.testing.assert_array_equal(out, array)


@pytest.mark.parametrize(("dtype", "shape"), DTYPES)
def test_pitched_images_leave_what_lies_between_their_rows(
    dtype: Any, shape: tuple[int, ...], context: clspeckle.Context
) -> None:
    array = sample(dtype, shape)
    row = array[0].nbytes
    component = 4 if array.dtype == np.complex64 else array.dtype.itemsize
    pitch, offset = row + 3 * component, 5 * component
    size = offset + pitch * (shape[0] - 1) + row
    with clspeckle.Buffer(size, context=context) as memory:
        memory.write(np.full(size, 0xA5, np.uint8))
        image = clspeckle.DeviceImage.wrap(memory, shape, dtype, offset_bytes=offset, pitch_bytes=pitch)
        image.write(array)
        np.testing.assert_array_equal(image.read(), array)
        expected = np.full(size, 0xA5, np.uint8)
        for y in range(shape[0]):
            start = offset + y * pitch
            expected[start : start + row] = np.frombuffer(array[y].tobytes(), np.uint8)
        np.testing.assert_array_equal(memory.read(), expected)


def test_reading_into_a_strided_array(context: clspeckle.Context) -> None:
    array = sample(np.uint16, (6, 8))
    image = clspeckle.DeviceImage.from_array(array, context=context)
    large = np.zeros((12, 16), np.uint16)
    image.read(large[::2, ::2])
    np.testing.assert_array_equal(large[::2, ::2], array)
    assert not large[1::2].any()


def test_writing_any_strides_and_read_only_arrays(context: clspeckle.Context) -> None:
    large = sample(np.float32, (12, 16))
    large.flags.writeable = False
    image = clspeckle.DeviceImage((6, 8), np.float32, context=context)
    for view in (large[::2, ::2], large[5::-1, 7::-1], np.asfortranarray(large[:6, :8])):
        image.write(view)
        np.testing.assert_array_equal(image.read(), view)


def test_big_endian_numbers_keep_their_value(camera: clspeckle.Pipeline, ideal: Any) -> None:
    np.testing.assert_array_equal(
        camera.render(ideal.astype(">f4"), frame_index=0), camera.render(ideal, frame_index=0)
    )


def test_events_order_commands_on_an_out_of_order_queue(context: clspeckle.Context) -> None:
    queue = clspeckle.Queue(context, out_of_order=True)
    image = clspeckle.DeviceImage((64, 64), np.float32, context=context)
    for value in range(20):
        written = image.enqueue_write(np.full((64, 64), value, np.float32), queue=queue)
        out = np.empty((64, 64), np.float32)
        image.enqueue_read(out, queue=queue, wait_for=written).wait()
        assert (out == value).all()


def test_waiting(context: clspeckle.Context) -> None:
    image = clspeckle.DeviceImage((8, 8), np.float32, context=context)
    events = [event for _ in range(3) for event in image.enqueue_write(np.ones((8, 8), np.float32))]
    clspeckle.wait(events)
    clspeckle.wait([events[0], events[1].int_ptr])
    clspeckle.wait([])
    events[2].wait()
    events[2].wait()


def test_views_own_nothing(context: clspeckle.Context) -> None:
    memory = clspeckle.Buffer(64, context=context)
    view = clspeckle.DeviceImage.wrap(memory, (4, 4), np.float32)
    view.close()
    assert not memory.closed
    view.write(np.ones((4, 4), np.float32))
    assert memory.read().any()
    memory.close()
    assert view.closed
    with pytest.raises(errors.InvalidHandleError, match="closed"):
        view.read()


def test_images_close_their_own_memory(context: clspeckle.Context) -> None:
    with clspeckle.DeviceImage((4, 4), context=context) as image:
        assert not image.closed
        assert "open" in repr(image)
    assert image.closed
    assert "closed" in repr(image)
    with pytest.raises(errors.InvalidHandleError, match="closed"):
        np.asarray(image)


def test_a_view_without_a_context_needs_a_queue(context: clspeckle.Context) -> None:
    memory = clspeckle.Buffer(64, context=context)
    memory.write(np.ones(16, np.float32))
    view = clspeckle.DeviceImage.wrap(memory.int_ptr, (4, 4), np.float32)
    with pytest.raises(errors.InvalidArgumentError, match="queue="):
        view.read()
    assert (view.read(queue=context.queue) == 1).all()
    assert (clspeckle.DeviceImage.wrap(memory.int_ptr, (4, 4), np.float32, context=context).read() == 1).all()
