"""PyOpenCL's contexts, queues, arrays, buffers and events, used without a copy. Without PyOpenCL these tests fail."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pyopencl as cl
import pyopencl.array
import pyopencl.cltypes
import pyopencl.tools
import pytest

import clspeckle
from binding_common import SHAPE
from clspeckle import errors


@pytest.fixture(scope="module")
def cl_context() -> Any:
    return cl.create_some_context(interactive=False)


@pytest.fixture(scope="module")
def cl_queue(cl_context: Any) -> Any:
    return cl.CommandQueue(cl_context)


@pytest.fixture(scope="module")
def shared(cl_context: Any) -> Iterator[clspeckle.Context]:
    with clspeckle.Context.from_opencl(cl_context) as context:
        yield context


@pytest.fixture
def device_camera(shared: clspeckle.Context) -> clspeckle.Pipeline:
    return clspeckle.Pipeline.from_parameters(SHAPE, seed=3, context=shared)


@pytest.fixture
def expected(shared: clspeckle.Context, ideal: Any) -> Any:
    return clspeckle.simulate(ideal, seed=3, context=shared)


def test_contexts_are_shared(cl_context: Any, shared: clspeckle.Context) -> None:
    info = shared.info()
    assert info.opencl_context == cl_context.int_ptr
    assert info.opencl_device == cl_context.devices[0].int_ptr
    for context, device in (
        (cl_context, cl_context.devices[0]),
        (cl_context.int_ptr, cl_context.devices[0].int_ptr),
    ):
        with clspeckle.Context.from_opencl(context, device) as other:
            assert other.info().opencl_context == cl_context.int_ptr


def test_the_cl_context_outlives_its_pyopencl_object(ideal: Any, expected: Any) -> None:
    context = clspeckle.Context.from_opencl(cl.create_some_context(interactive=False))
    np.testing.assert_array_equal(clspeckle.simulate(ideal, seed=3, context=context), expected)


def test_arrays_go_in_and_out(device_camera: Any, cl_queue: Any, ideal: Any, expected: Any) -> None:
    source = cl.array.to_device(cl_queue, ideal)
    target = cl.array.zeros(cl_queue, SHAPE, np.uint16)
    assert device_camera.render(source, out=target, frame_index=0, queue=cl_queue) is target
    np.testing.assert_array_equal(target.get(), expected)
    # and one side at a time
    np.testing.assert_array_equal(device_camera.render(source, frame_index=0), expected)
    target.fill(0)
    device_camera.render(ideal, out=target, frame_index=0)
    np.testing.assert_array_equal(target.get(), expected)


def test_nothing_is_copied(device_camera: Any, cl_queue: Any, ideal: Any, shared: clspeckle.Context) -> None:
    source: Any = cl.array.to_device(cl_queue, ideal)
    view = clspeckle.DeviceImage.wrap(source, context=shared)
    assert view.int_ptr == source.data.int_ptr
    assert view.memory is source.data
    view.write(np.full(SHAPE, 2, np.float32))
    assert (source.get() == 2).all()
    device_camera.enqueue_frame(source, cl.array.empty(cl_queue, SHAPE, np.uint16), queue=cl_queue).wait()
    assert device_camera._staging._images == {}


def test_offsets_and_pitches_of_slices(device_camera: Any, cl_queue: Any, ideal: Any, expected: Any) -> None:
    height, width = SHAPE
    large = cl.array.to_device(cl_queue, np.full((height + 7, width + 9), 99, np.float32))
    window = large[3 : 3 + height, 5 : 5 + width]
    assert window.offset > 0
    assert window.strides[0] > 4 * width
    clspeckle.DeviceImage.wrap(window, context=device_camera.context).write(ideal)
    codes = cl.array.to_device(cl_queue, np.full((height + 2, width + 4), 7, np.uint16))
    device_camera.render(window, out=codes[1:-1, 2:-2], frame_index=0)
    result = codes.get()
    np.testing.assert_array_equal(result[1:-1, 2:-2], expected)
    assert (result[0] == 7).all()
    assert (result[-1] == 7).all()
    assert (result[:, :2] == 7).all()
    assert (result[:, -2:] == 7).all()
    outside = large.get()
    outside[3 : 3 + height, 5 : 5 + width] = 99
    assert (outside == 99).all()
    np.testing.assert_array_equal(np.asarray(clspeckle.DeviceImage.wrap(window)), ideal)


def test_strides_that_no_image_has(cl_queue: Any, ideal: Any) -> None:
    array = cl.array.to_device(cl_queue, ideal)
    for wrong in (array[:, ::2], array.T, array[::-1]):
        with pytest.raises(errors.InvalidFormatError, match="strides"):
            clspeckle.DeviceImage.wrap(wrong)
    np.testing.assert_array_equal(clspeckle.DeviceImage.wrap(array[::2]).read(), ideal[::2])
    np.testing.assert_array_equal(clspeckle.DeviceImage.wrap(array[5:6]).read(), ideal[5:6])
    np.testing.assert_array_equal(clspeckle.DeviceImage.wrap(array[:, 4:5]).read(), ideal[:, 4:5])


def test_arrays_that_are_no_images(cl_queue: Any, device_camera: Any) -> None:
    for array in (
        cl.array.zeros(cl_queue, 8, np.float32),
        cl.array.zeros(cl_queue, SHAPE, np.float64),
        cl.array.zeros(cl_queue, (*SHAPE, 5), np.float32),
    ):
        with pytest.raises(errors.InvalidFormatError, match="expected"):
            clspeckle.DeviceImage.wrap(array)
        with pytest.raises(errors.InvalidFormatError, match="expected"):
            device_camera.render(array)
    with pytest.raises(TypeError, match="brings its own"):
        clspeckle.DeviceImage.wrap(cl.array.zeros(cl_queue, SHAPE, np.uint8), SHAPE, np.uint8)
    with pytest.raises(errors.InvalidArgumentError, match="49 x 32"):
        device_camera.render(cl.array.zeros(cl_queue, (SHAPE[0], SHAPE[1] + 1), np.float32))


def test_bare_buffers_have_the_size_of_the_argument(
    cl_context: Any, device_camera: Any, shared: clspeckle.Context, ideal: Any, expected: Any
) -> None:
    flags = cl.mem_flags
    for source in (
        cl.Buffer(cl_context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=ideal),
        clspeckle.DeviceImage.from_array(ideal, context=shared).memory,
    ):
        target = cl.Buffer(cl_context, flags.READ_WRITE, expected.nbytes)
        device_camera.enqueue_frame(source, target, frame_index=0).wait()
        view = clspeckle.DeviceImage.wrap(target, SHAPE, np.uint16, context=shared)
        np.testing.assert_array_equal(view.read(), expected)
        np.testing.assert_array_equal(device_camera.render(source, frame_index=0), expected)


def test_several_frames_in_one_call(cl_queue: Any, device_camera: Any, shared: clspeckle.Context, ideal: Any) -> None:
    mask = np.zeros(SHAPE, np.uint8)
    mask[4:9] = 1
    on_device = [clspeckle.DeviceImage.from_array(image, context=shared) for image in (ideal, 0.5 * ideal, ideal)]
    refresh = clspeckle.DeviceImage.from_array(mask, context=shared)
    scenes = [
        on_device[0],
        clspeckle.Frame(on_device[1], refresh="all"),
        clspeckle.Frame(on_device[2], refresh=refresh),
    ]
    given = [clspeckle.Frame(0.5 * ideal, "all"), clspeckle.Frame(ideal, mask)]
    expected = device_camera.render_batch([ideal, *given], first_frame_index=20, refresh="all")
    outputs = [cl.array.empty(cl_queue, SHAPE, np.uint16) for _ in scenes]
    device_camera.enqueue_frames(scenes, outputs, first_frame_index=20, refresh="all").wait()
    for index, result in enumerate(outputs):
        np.testing.assert_array_equal(result.get(cl_queue), expected[index], str(index))
    assert device_camera.next_frame_index == 23
    with pytest.raises(errors.OverlapError, match=r"frames\[1\].*overlap"):
        device_camera.enqueue_frames([on_device[0], on_device[1]], [outputs[0], on_device[1].memory])
    with pytest.raises(TypeError, match=r"frames\[1\]: .*image in device memory"):
        device_camera.enqueue_frames([on_device[0], ideal], outputs[:2])
    with pytest.raises(errors.InvalidArgumentError, match=r"frames\[1\]: illumination is 'blue'"):
        device_camera.enqueue_frames([on_device[0], clspeckle.Frame(on_device[1], illumination="blue")], outputs[:2])
    with pytest.raises(errors.InvalidArgumentError, match="2 scenes and 1 outputs"):
        device_camera.enqueue_frames(on_device[:2], outputs[:1])
    with pytest.raises(errors.InvalidArgumentError, match="0 scenes"):
        device_camera.enqueue_frames([], [])
    assert device_camera.next_frame_index == 23


def test_raw_handles(cl_context: Any, cl_queue: Any, device_camera: Any, ideal: Any, expected: Any) -> None:
    source = cl.Buffer(cl_context, cl.mem_flags.COPY_HOST_PTR, hostbuf=np.pad(ideal, ((0, 0), (2, 3))))
    target = cl.Buffer(cl_context, cl.mem_flags.READ_WRITE, expected.nbytes)
    wrap = clspeckle.DeviceImage.wrap
    camera_queue = cl_queue.int_ptr
    device_camera.enqueue_frame(
        wrap(source.int_ptr, SHAPE, np.float32, offset_bytes=8, pitch_bytes=4 * (SHAPE[1] + 5)),
        wrap(target.int_ptr, SHAPE, np.uint16),
        frame_index=0,
        queue=camera_queue,
    )
    result = np.empty_like(expected)
    cl.enqueue_copy(cl_queue, result, target)
    np.testing.assert_array_equal(result, expected)


def test_pooled_memory(cl_context: Any, cl_queue: Any, device_camera: Any, ideal: Any, expected: Any) -> None:
    pool = cl.tools.MemoryPool(cl.tools.ImmediateAllocator(cl_queue))
    source = cl.array.to_device(cl_queue, ideal, allocator=pool)
    target = cl.array.empty(cl_queue, SHAPE, np.uint16, allocator=pool)
    device_camera.render(source, out=target, frame_index=0)
    np.testing.assert_array_equal(target.get(), expected)


def test_vectors(cl_queue: Any, shared: clspeckle.Context) -> None:
    """OpenCL's float3 takes the room of a float4; float2 and float4 are themselves; so are trailing axes."""
    rng = np.random.default_rng(3)
    plain = rng.random((*SHAPE, 4), np.float32)
    plain[..., 2] += 1
    pattern = clspeckle.Pattern(rng.random((16, 16)), half_extent_x=2, half_extent_y=2, context=shared)
    expected = pattern.lookup(clspeckle.Geometry(position=plain[..., :3]))
    assert expected.any()
    as_float4 = plain.reshape(*SHAPE, 4).view(cl.cltypes.float4)[..., 0]
    as_float3 = plain.reshape(*SHAPE, 4).view(cl.cltypes.float3)[..., 0]
    for host in (plain, np.ascontiguousarray(plain[..., :3]), as_float4, as_float3):
        array = cl.array.to_device(cl_queue, np.ascontiguousarray(host))
        np.testing.assert_array_equal(pattern.lookup(clspeckle.Geometry(position=array)), expected)
    phase = clspeckle.Phase(SHAPE, context=shared)
    phase.refresh(0)
    field = phase.field()
    for dtype, shape in ((np.complex64, SHAPE), (np.float32, (*SHAPE, 2)), (cl.cltypes.float2, SHAPE)):
        target = cl.array.empty(cl_queue, shape, dtype)
        phase.enqueue_field(0, target).wait()
        np.testing.assert_array_equal(target.get().view(np.complex64).reshape(SHAPE), field)


def test_cl_images_go_in_and_out(shared: Any, cl_queue: Any, device_camera: Any, ideal: Any, expected: Any) -> None:
    cl_context = cl_queue.context
    order, kind, flags = cl.channel_order, cl.channel_type, cl.mem_flags
    texels = np.zeros((*SHAPE, 4), np.float32)
    texels[..., 2] = ideal
    picture = cl.create_image(cl_context, flags.READ_ONLY, cl.ImageFormat(order.RGBA, kind.FLOAT), shape=SHAPE[::-1])
    codes = cl.create_image(
        cl_context, flags.WRITE_ONLY, cl.ImageFormat(order.R, kind.UNSIGNED_INT16), shape=SHAPE[::-1]
    )
    written = cl.enqueue_copy(cl_queue, picture, texels, origin=(0, 0), region=SHAPE[::-1], is_blocking=False)
    source = clspeckle.DeviceImage(SHAPE, context=shared)
    target = clspeckle.DeviceImage(SHAPE, np.uint16, context=shared)
    queue = clspeckle.Queue(shared, out_of_order=True)
    imported = source.enqueue_import(picture, 2, queue=queue, wait_for=[written])
    rendered = device_camera.enqueue_frame(source, target, frame_index=0, queue=queue, wait_for=[imported])
    target.enqueue_export(codes.int_ptr, queue=queue, wait_for=[rendered]).wait()
    result = np.empty(SHAPE, np.uint16)
    cl.enqueue_copy(cl_queue, result, codes, origin=(0, 0), region=SHAPE[::-1])
    np.testing.assert_array_equal(result, expected)

    with pytest.raises(errors.InvalidFormatError, match="use CL_FLOAT"):
        source.enqueue_export(codes)
    with pytest.raises(errors.InvalidFormatError, match="first_channel is 4"):
        source.enqueue_import(picture, 4)
    with pytest.raises(TypeError, match=r"cl_image must be a pyopencl\.Image"):
        source.enqueue_import(ideal)
    foreign = clspeckle.DeviceImage.wrap(cl.Buffer(cl_context, flags.READ_WRITE, 4 * ideal.size), SHAPE, np.float32)
    with pytest.raises(errors.InvalidArgumentError, match="give context="):
        foreign.enqueue_import(picture, queue=cl_queue)


def test_cl_images_and_shared_virtual_memory_are_refused(cl_context: Any, device_camera: Any) -> None:
    image = cl.create_image(
        cl_context,
        cl.mem_flags.READ_WRITE,
        cl.ImageFormat(cl.channel_order.R, cl.channel_type.FLOAT),
        shape=SHAPE[::-1],
    )
    with pytest.raises(errors.InvalidArgumentError, match="cl_image; copy it into a buffer"):
        device_camera.render(image)
    dtype: Any = np.float32
    allocation: Any = cl.SVM(cl.csvm_empty(cl_context, SHAPE, dtype))
    with pytest.raises(TypeError, match="shared virtual memory"):
        clspeckle.DeviceImage.wrap(allocation, SHAPE, np.float32)


def test_objects_of_another_kind_are_refused(cl_context: Any, cl_queue: Any, device_camera: Any, ideal: Any) -> None:
    buffer = cl.Buffer(cl_context, cl.mem_flags.READ_WRITE, 64)
    with pytest.raises(TypeError, match=r"queue must be a pyopencl\.CommandQueue"):
        device_camera.render(ideal, queue=buffer)
    with pytest.raises(TypeError, match=r"wait_for\[0\] must be a pyopencl\.Event"):
        clspeckle.wait([cl_queue])
    with pytest.raises(TypeError, match=r"context must be a pyopencl\.Context"):
        clspeckle.Context.from_opencl(cl_queue)
    with pytest.raises(TypeError, match=r"device must be a pyopencl\.Device"):
        clspeckle.Context.from_opencl(cl_context, cl_context)
    with pytest.raises(TypeError, match="from_opencl"):
        clspeckle.Phase(SHAPE, context=cl_context)
    with pytest.raises(TypeError, match="from_opencl"):
        clspeckle.Context(cl_context.devices[0])


def test_another_context_is_refused(device_camera: Any, ideal: Any) -> None:
    other = cl.CommandQueue(cl.create_some_context(interactive=False))
    with pytest.raises(errors.WrongContextError):
        device_camera.render(cl.array.to_device(other, ideal))
    with pytest.raises(errors.WrongContextError):
        device_camera.render(ideal, queue=other)


# --- Events ---


def test_wait_lists_of_both_kinds(cl_context: Any, cl_queue: Any, shared: clspeckle.Context, ideal: Any) -> None:
    image = clspeckle.DeviceImage((4, 4), np.float32, context=shared)
    gate = cl.UserEvent(cl_context)
    queue = clspeckle.Queue(shared, out_of_order=True)
    first = image.enqueue_write(np.ones((4, 4), np.float32), queue=queue, wait_for=[gate])[0]
    fill = clspeckle.philox.enqueue_fill(image, "uniform", queue=queue, wait_for=[gate, first, first.int_ptr])
    status = cl.command_execution_status
    marker: Any = cl.Event.from_int_ptr(fill.int_ptr)
    assert marker.command_execution_status != status.COMPLETE
    gate.set_status(status.COMPLETE)
    clspeckle.wait([marker, fill])
    assert marker.command_execution_status == status.COMPLETE
    np.testing.assert_array_equal(image.read(), clspeckle.philox.uniform((4, 4), context=shared))


def test_pyopencl_waits_for_our_events(cl_context: Any, shared: clspeckle.Context) -> None:
    gate = cl.UserEvent(cl_context)
    other_queue = cl.CommandQueue(cl_context)
    target = cl.array.zeros(other_queue, (64, 64), np.float32)
    target.finish()
    event = clspeckle.philox.enqueue_fill(target, "uniform", context=shared, wait_for=[gate])
    # The array knows of the fill: its next operation, on another queue, waits for it.
    assert any(known.int_ptr == event.int_ptr for known in target.events)
    doubled = target * 2
    gate.set_status(cl.command_execution_status.COMPLETE)
    np.testing.assert_array_equal(
        doubled.get(), 2 * clspeckle.philox.uniform((64, 64), context=shared).astype(np.float32)
    )


def test_we_wait_for_the_events_of_arrays(cl_context: Any, shared: clspeckle.Context) -> None:
    gate = cl.UserEvent(cl_context)
    other_queue = cl.CommandQueue(cl_context)
    array: Any = cl.array.zeros(other_queue, (8, 8), np.float32)
    array.finish()
    value = np.full((8, 8), 5, np.float32)
    array.add_event(cl.enqueue_copy(other_queue, array.base_data, value, is_blocking=False, wait_for=[gate]))
    event = clspeckle.DeviceImage.wrap(array, context=shared)
    out = np.zeros((8, 8), np.float32)
    pending = event.enqueue_read(out, queue=shared.queue)
    assert not out.any()
    gate.set_status(cl.command_execution_status.COMPLETE)
    pending.wait()
    assert (out == 5).all()


def test_frames_wait_for_each_other_on_any_queue(
    cl_context: Any, shared: clspeckle.Context, ideal: Any, device_camera: Any
) -> None:
    gate = cl.UserEvent(cl_context)
    complete = cl.command_execution_status.COMPLETE
    source = clspeckle.DeviceImage.from_array(ideal, context=shared)
    targets = [clspeckle.DeviceImage(SHAPE, np.uint16, context=shared) for _ in range(4)]
    queues = [shared.queue, cl.CommandQueue(cl_context), clspeckle.Queue(shared, out_of_order=True), None]
    events = [
        device_camera.enqueue_frame(source, target, refresh="all", queue=queue, wait_for=[gate] if index == 0 else None)
        for index, (target, queue) in enumerate(zip(targets, queues))
    ]
    # Only the first one is held back by the gate; the others by the frame before them.
    time.sleep(0.3)
    for event in events:
        status: Any = cl.Event.from_int_ptr(event.int_ptr).command_execution_status
        assert status != complete
    gate.set_status(complete)
    clspeckle.wait(events)
    reference = clspeckle.Pipeline.from_parameters(SHAPE, seed=3, context=shared)
    for target in targets:
        np.testing.assert_array_equal(target.read(), reference.render(ideal, refresh="all"))


def test_every_stage_on_the_device(cl_queue: Any, shared: clspeckle.Context, ideal: Any) -> None:
    """Pattern, phase, aperture and sensor one by one in PyOpenCL's memory, against the pipeline with NumPy."""
    rng = np.random.default_rng(4)
    depth, albedo = (rng.random(SHAPE, np.float32) + np.float32(0.1) for _ in range(2))
    albedo = albedo.clip(0, 1)
    normal = np.broadcast_to(np.array([0, 0, -1], np.float32), (*SHAPE, 3)).copy()
    visibility = (rng.random(SHAPE) > 0.2).astype(np.uint8) * 255
    mask = (rng.random(SHAPE) > 0.5).astype(np.uint8)
    pattern = clspeckle.Pattern(rng.random((32, 32)), context=shared)
    intrinsics = (40.0, 40.0, 24.0, 16.0)

    def dev(array: Any) -> Any:
        return cl.array.to_device(cl_queue, array)

    on_device = clspeckle.Geometry(
        depth=dev(depth), intrinsics=intrinsics, normal=dev(normal), albedo=dev(albedo), visibility=dev(visibility)
    )
    on_host = clspeckle.Geometry(
        depth=depth, intrinsics=intrinsics, normal=normal, albedo=albedo, visibility=visibility
    )
    irradiance, intensity = (cl.array.empty(cl_queue, SHAPE, np.float32) for _ in range(2))
    codes = cl.array.empty(cl_queue, SHAPE, np.uint16)
    phase = clspeckle.Phase(SHAPE, seed=1, context=shared)
    aperture = clspeckle.Aperture(SHAPE, degree_of_polarization=0.5, context=shared)
    sensor = clspeckle.Sensor(SHAPE, seed=1, context=shared)
    pattern.enqueue_lookup(on_device, irradiance, queue=cl_queue)
    phase.enqueue_refresh(0, queue=cl_queue)
    phase.enqueue_refresh(1, dev(mask), queue=cl_queue)
    aperture.enqueue_intensity(phase, irradiance, intensity, queue=cl_queue)
    sensor.enqueue_expose(intensity, 1, codes, queue=cl_queue)

    camera = clspeckle.Pipeline.from_parameters(
        SHAPE, pattern=pattern, seed=1, degree_of_polarization=0.5, context=shared
    )
    camera.render(on_host)
    expected = camera.render(on_host, refresh=mask)
    np.testing.assert_array_equal(codes.get(), expected)
    target = cl.array.empty(cl_queue, SHAPE, np.uint16)
    fresh = clspeckle.Pipeline.from_parameters(
        SHAPE, pattern=pattern, seed=1, degree_of_polarization=0.5, context=shared
    )
    fresh.enqueue_frame(on_device, target, queue=cl_queue)
    fresh.enqueue_frame(on_device, target, refresh=dev(mask), queue=cl_queue)
    np.testing.assert_array_equal(target.get(), expected)
    assert clspeckle.statistics.moments(target, context=shared).mean == pytest.approx(expected.mean())
    assert clspeckle.statistics.histogram(target, 0, 1024, 8, dev(mask), context=shared).counts.sum() == mask.sum()


def test_philox_in_place(cl_queue: Any, shared: clspeckle.Context) -> None:
    counters = np.arange(64, dtype=np.uint32).reshape(16, 4)
    expected = clspeckle.philox.blocks(counters, (1, 2), context=shared)
    array: Any = cl.array.to_device(cl_queue, counters)
    clspeckle.philox.enqueue_blocks(array.data, (1, 2), 16, array.data, context=shared, queue=cl_queue).wait()
    np.testing.assert_array_equal(array.get(), expected)
    half: Any = cl.array.to_device(cl_queue, counters)
    clspeckle.philox.enqueue_blocks(
        half.data.int_ptr,
        (1, 2),
        8,
        half.data.int_ptr,
        counters_offset_bytes=128,
        blocks_offset_bytes=128,
        context=shared,
        queue=cl_queue.int_ptr,
    ).wait()
    np.testing.assert_array_equal(half.get()[8:], expected[8:])
    np.testing.assert_array_equal(half.get()[:8], counters[:8])


def test_phase_state_in_foreign_memory(cl_context: Any, cl_queue: Any, shared: clspeckle.Context) -> None:
    phase = clspeckle.Phase(SHAPE, context=shared)
    phase.refresh(0)
    memory = cl.Buffer(cl_context, cl.mem_flags.READ_WRITE, phase.state_size + 256)
    phase.enqueue_save(memory, offset_bytes=256, queue=cl_queue).wait()
    before = phase.field()
    phase.refresh(1)
    phase.enqueue_restore(memory, offset_bytes=256, queue=cl_queue).wait()
    np.testing.assert_array_equal(phase.field(), before)


def test_workspace_in_foreign_memory(cl_context: Any, shared: clspeckle.Context, ideal: Any) -> None:
    phase = clspeckle.Phase(SHAPE, context=shared)
    phase.refresh(0)
    guest = clspeckle.Aperture(SHAPE, workspace_from_host=True, context=shared)
    size = guest.info().workspace_bytes
    memory = cl.Buffer(cl_context, cl.mem_flags.READ_WRITE, size + 8192)
    guest.set_workspace(memory, offset_bytes=4096)
    expected = clspeckle.Aperture(SHAPE, context=shared).intensity(phase, ideal)
    np.testing.assert_array_equal(guest.intensity(phase, ideal), expected)
    guest.set_workspace(memory.int_ptr, size_bytes=size)
    np.testing.assert_array_equal(guest.intensity(phase, ideal), expected)
    array = cl.array.to_device(cl.CommandQueue(cl_context), ideal)
    assert guest.intensity(phase, array, out=array) is array
    np.testing.assert_array_equal(array.get(), expected)
