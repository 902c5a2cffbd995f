"""Tensors of other packages: what speaks DLPack goes in and out, without a copy where OpenCL's device is the CPU."""

from __future__ import annotations

import gc
import logging
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import clspeckle
from binding_common import SHAPE
from clspeckle import _tensor


class Tensor:
    """Speaks DLPack and nothing else, as a package that is not NumPy does."""

    def __init__(self, array: npt.NDArray[Any]) -> None:
        self._array = array

    def __dlpack_device__(self) -> tuple[int, int]:
        return 1, 0

    def __dlpack__(self, **options: Any) -> Any:
        return self._array.__dlpack__(**options)


class OnGpu(Tensor):
    """Its memory is another device's."""

    def __dlpack_device__(self) -> tuple[int, int]:
        return 2, 0

    def __dlpack__(self, **options: Any) -> Any:
        raise BufferError("this memory is a GPU's")


class OfPyTorch(OnGpu):
    def cpu(self) -> Tensor:
        return Tensor(self._array)


class OfCuPy(OnGpu):
    def get(self) -> npt.NDArray[Any]:
        return self._array


class OfJax(OnGpu):
    def __array__(self, dtype: Any = None, copy: Any = None) -> npt.NDArray[Any]:
        return self._array


def address(array: npt.NDArray[Any]) -> int:
    return array.ctypes.data


@pytest.fixture
def shares(context: clspeckle.Context) -> bool:
    """Whether the device's memory is the host's."""
    device = next(d for d in clspeckle.devices() if d.device_id == context.info().opencl_device)
    return "cpu" in device.type


@pytest.mark.parametrize("dtype", [np.float32, np.uint16, np.uint8, np.uint32, np.complex64])
def test_a_round_trip_copies_nothing(context: clspeckle.Context, shares: bool, dtype: Any) -> None:
    source = (np.arange(SHAPE[0] * SHAPE[1]).reshape(SHAPE) % 251).astype(dtype)
    image = clspeckle.DeviceImage.from_dlpack(Tensor(source), context=context)
    back = np.from_dlpack(image)
    assert np.array_equal(back, source)
    assert (address(back) == address(source)) is shares
    if shares:
        source[3, 5] = 77
        assert back[3, 5] == image.read()[3, 5] == 77
        image.write(np.ones(SHAPE, dtype))
        assert (source == 1).all()


def test_rows_that_lie_apart_and_channels(context: clspeckle.Context, shares: bool) -> None:
    whole = np.arange(6 * 10 * 3, dtype=np.float32).reshape(6, 10, 3)
    for part in (whole[:, 2:7], whole[1:5, :, :], whole[2:3]):
        image = clspeckle.DeviceImage.from_dlpack(part, context=context)
        back = np.from_dlpack(image)
        assert np.array_equal(back, part)
        assert (address(back) == address(part)) is shares


def test_frames_go_from_tensor_to_tensor(
    context: clspeckle.Context, camera: clspeckle.Pipeline, ideal: npt.NDArray[np.float32]
) -> None:
    """Into the caller's memory on a CPU; the same codes as by NumPy everywhere."""
    expected = camera.render(ideal, frame_index=0, refresh="all")
    source = clspeckle.DeviceImage.from_dlpack(Tensor(ideal.copy()), context=context)
    codes = np.zeros(SHAPE, np.uint16)
    target = clspeckle.DeviceImage.from_dlpack(Tensor(codes), context=context)
    camera.enqueue_frame(source, target, frame_index=0, refresh="all").wait()
    assert np.array_equal(np.from_dlpack(target), expected)
    assert np.array_equal(camera.render(Tensor(ideal.copy()), frame_index=0, refresh="all"), expected)


@pytest.mark.parametrize("kind", [OfPyTorch, OfCuPy, OfJax])
def test_a_tensor_on_another_device_is_copied_and_the_log_says_so(
    kind: type[OnGpu],
    context: clspeckle.Context,
    camera: clspeckle.Pipeline,
    ideal: npt.NDArray[np.float32],
    caplog: pytest.LogCaptureFixture,
) -> None:
    expected = camera.render(ideal, frame_index=0, refresh="all")
    tensor = kind(ideal.copy())
    with caplog.at_level(logging.INFO, "clspeckle"):
        assert np.array_equal(camera.render(tensor, frame_index=0, refresh="all"), expected)
    assert any("is a tensor on another device" in text and "is copied" in text for text in caplog.messages)
    caplog.clear()
    with caplog.at_level(logging.INFO, "clspeckle"):
        image = clspeckle.DeviceImage.from_dlpack(tensor, context=context)
    assert any(text.startswith("the tensor is copied") for text in caplog.messages)
    image.write(np.zeros(SHAPE, np.float32))
    assert np.array_equal(tensor._array, ideal), "what was copied must not be written to"


class OfNoDevice(Tensor):
    def __dlpack_device__(self) -> Any:
        return "cpu"


def test_a_tensor_that_nothing_brings_to_the_host_is_told_so(
    context: clspeckle.Context, camera: clspeckle.Pipeline, ideal: npt.NDArray[np.float32]
) -> None:
    nowhere = OnGpu(ideal)
    takers: list[Any] = [camera.render, lambda tensor: clspeckle.DeviceImage.from_dlpack(tensor, context=context)]
    for take in takers:
        with pytest.raises(TypeError, match=r"lies on another device \(DLPack's type 2, number 0\).*; copy it to the"):
            take(nowhere)
        with pytest.raises(TypeError, match=r"its __dlpack_device__\(\) gives 'cpu', where DLPack has a type and a"):
            take(OfNoDevice(ideal))
        take(Tensor(nowhere._array.copy()))
    # Also one so dim that it is looked at twice.
    with pytest.warns(UserWarning, match="no light"):
        camera.render(Tensor(np.full_like(ideal, 1e-9)))


def test_what_cannot_be_shared_is_copied_and_the_log_says_why(
    context: clspeckle.Context, ideal: npt.NDArray[np.float32], shares: bool, caplog: pytest.LogCaptureFixture
) -> None:
    turned = np.asfortranarray(np.arange(12, dtype=np.float32).reshape(3, 4))
    for given, why in ((ideal, "read-only"), (turned, "next to each other"), (turned[::-1], "next to each other")):
        caplog.clear()
        with caplog.at_level(logging.INFO, "clspeckle"):
            image = clspeckle.DeviceImage.from_dlpack(given, context=context)
        assert (why in caplog.text) is shares or "no CPU" in caplog.text
        assert np.array_equal(np.from_dlpack(image), given)


def test_numbers_mean_what_those_of_numpy_mean(camera: clspeckle.Pipeline) -> None:
    """uint8 and uint16 are divided by their top code; what NumPy's arrays are refused for, tensors are."""
    codes = np.random.default_rng(1).integers(0, 256, SHAPE).astype(np.uint8)
    expected = camera.render(codes / 255, frame_index=0, refresh="all")
    for same in (codes, codes.astype(np.uint16) * 257):
        assert np.array_equal(camera.render(Tensor(same), frame_index=0, refresh="all"), expected)
    colors = np.random.default_rng(2).random((*SHAPE, 3))
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="shape"):
        camera.render(codes / 255, refresh=Tensor(colors > 0.5))
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match=r"np\.moveaxis"):
        camera.render(Tensor(np.moveaxis(colors, -1, 0)[None]))
    with pytest.raises(TypeError, match="this memory is a GPU's"):
        camera.render(type("Mute", (Tensor,), {"__dlpack__": OnGpu.__dlpack__})(codes))


def test_images_of_codes_are_no_light(context: clspeckle.Context, camera: clspeckle.Pipeline) -> None:
    """Device memory has no full scale: it is refused, and not divided."""
    for dtype in (np.uint8, np.uint16):
        image = clspeckle.DeviceImage.from_dlpack(np.ones(SHAPE, dtype), context=context)
        with pytest.raises(clspeckle.errors.InvalidFormatError):
            camera.render(image)
    for wrong in (np.ones((*SHAPE, 3), np.uint8), np.ones(SHAPE, np.float64)):
        with pytest.raises(clspeckle.errors.InvalidFormatError, match="expected bool, uint8"):
            clspeckle.DeviceImage.from_dlpack(Tensor(wrong), context=context)


def test_asynchronous_calls_say_how_a_tensor_goes_in(
    context: clspeckle.Context, camera: clspeckle.Pipeline, ideal: npt.NDArray[np.float32]
) -> None:
    target = clspeckle.DeviceImage(SHAPE, np.uint16, context=context)
    with pytest.raises(TypeError, match=r"DeviceImage\.from_dlpack\(\) takes a tensor"):
        camera.enqueue_frame(Tensor(ideal.copy()), target)  # type: ignore[arg-type]


def test_what_is_exported_lives_as_long_as_it_is_used(context: clspeckle.Context, shares: bool) -> None:
    before = len(_tensor._used)
    image = clspeckle.DeviceImage.from_dlpack(np.full(SHAPE, 3, np.float32), context=context)
    assert len(_tensor._used) == before + shares
    view = np.from_dlpack(image)
    del image
    gc.collect()
    assert (view == 3).all()
    del view
    gc.collect()
    context.queue.finish()
    assert len(_tensor._used) == before, "the memory is kept for ever"


def test_what_no_exporter_can_do_is_refused(context: clspeckle.Context) -> None:
    image = clspeckle.DeviceImage.from_array(np.ones(SHAPE, np.float32), context=context)
    assert image.__dlpack_device__() == (1, 0)
    with pytest.raises(BufferError, match=r"the device \(1, 0\)"):
        image.__dlpack__(dl_device=(2, 0))
    with pytest.raises(BufferError, match="no stream"):
        image.__dlpack__(stream=1)
    copied = np.from_dlpack(type("Copied", (), {
        "__dlpack_device__": image.__dlpack_device__, "__dlpack__": lambda self, **o: image.__dlpack__(copy=True)
    })())  # fmt: skip
    image.write(np.zeros(SHAPE, np.float32))
    assert (copied == 1).all()


def test_an_array_interface_is_enough(camera: clspeckle.Pipeline, ideal: npt.NDArray[np.float32]) -> None:
    interface = type("Interface", (), {"__array_interface__": ideal.__array_interface__})()
    expected = camera.render(ideal, frame_index=0, refresh="all")
    assert np.array_equal(camera.render(interface, frame_index=0, refresh="all"), expected)


class TorchLike(Tensor):
    """A tensor of PyTorch in host memory, as far as the package looks."""

    def data_ptr(self) -> int:
        return address(self._array)

    def numpy(self) -> npt.NDArray[Any]:
        return self._array


def test_numpy_before_2_1_takes_tensors_as_read_only(
    context: clspeckle.Context, shares: bool, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Those of PyTorch are shared all the same; others are copied, and a warning says so."""
    take = np.from_dlpack

    def read_only(value: Any) -> npt.NDArray[Any]:
        array = take(value).view()
        array.flags.writeable = False
        return array

    monkeypatch.setattr(np, "from_dlpack", read_only)
    monkeypatch.setattr(_tensor, "TELLS_READ_ONLY", False)
    given = np.zeros(SHAPE, np.float32)
    with caplog.at_level(logging.WARNING, "clspeckle"):
        image = clspeckle.DeviceImage.from_dlpack(TorchLike(given), context=context)
        image.write(np.ones(SHAPE, np.float32))
        assert bool(given.all()) is shares
        caplog.clear()
        clspeckle.DeviceImage.from_dlpack(Tensor(given), context=context)
    assert "as all tensors are for NumPy before 2.1" in caplog.text or not shares


class Interface:
    """Memory that is told of by NumPy's array protocol alone."""

    def __init__(self, array: npt.NDArray[Any]) -> None:
        self._array = array

    @property
    def __array_interface__(self) -> dict[str, Any]:
        return self._array.__array_interface__


@pytest.mark.parametrize("dtype", [np.float32, np.uint16, np.uint8, np.complex64])
def test_array_interfaces_go_in_and_out_without_a_copy(context: clspeckle.Context, shares: bool, dtype: Any) -> None:
    whole = (np.arange(12 * 20).reshape(12, 20) % 251).astype(dtype)
    for source in (whole, whole[:, 3:15], whole[4:5]):
        image = clspeckle.DeviceImage.from_dlpack(Interface(source), context=context)
        back = np.asarray(image)
        assert np.array_equal(back, source)
        assert back.dtype == dtype
        assert (address(back) == address(source)) is shares
        if shares:
            source[0, 5] = 77
            assert back[0, 5] == image.read()[0, 5] == 77
            assert address(np.array(image)) != address(source)
        else:
            assert not hasattr(image, "__array_interface__")
    channels = clspeckle.DeviceImage.from_array(np.ones((4, 5, 3), np.float32), context=context)
    assert np.asarray(channels).shape == (4, 5, 3)


def test_an_array_outlives_the_image_that_it_looks_at(context: clspeckle.Context) -> None:
    with clspeckle.DeviceImage.from_array(np.full(SHAPE, 5, np.float32), context=context) as image:
        arrays = np.asarray(image), np.from_dlpack(image)
    for _ in range(20):  # memory that is free would be taken
        clspeckle.DeviceImage.from_array(np.zeros(SHAPE, np.float32), context=context)
    assert all((array == 5).all() for array in arrays)
    foreign = clspeckle.DeviceImage.wrap(clspeckle.Buffer(64, context=context).int_ptr, (4, 4), np.float32)
    assert not hasattr(foreign, "__array_interface__")


def test_a_tensor_that_would_be_copied_is_told_or_refused(caplog: pytest.LogCaptureFixture) -> None:
    """Frames that are written to a copy do not reach the tensor."""
    apart = np.zeros((32, 96), np.float32)[:, ::2]
    with caplog.at_level("WARNING", "clspeckle"):
        clspeckle.DeviceImage.from_dlpack(apart).close()
    assert "does not reach it" in caplog.text
    with pytest.raises(BufferError, match="its pixels do not lie next to each other; without copy=False it is copied"):
        clspeckle.DeviceImage.from_dlpack(apart, copy=False)
    caplog.clear()
    own = np.zeros((32, 48), np.float32)
    with clspeckle.DeviceImage.from_dlpack(own, copy=True) as image:
        own[:] = 1
        assert not image.read().any()
    assert not caplog.text
