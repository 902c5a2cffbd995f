"""One exception class per status, and what failing calls carry."""

from __future__ import annotations

import pickle
import re
import threading
from pathlib import Path

import pytest

import clspeckle
from clspeckle import _library, errors

BUILT_IN = {
    "InvalidArgumentError": ValueError,
    "InvalidStructSizeError": ValueError,
    "InvalidHandleError": ValueError,
    "BufferTooSmallError": ValueError,
    "WrongContextError": ValueError,
    "InvalidFormatError": ValueError,
    "OverlapError": ValueError,
    "InvalidDataError": ValueError,
    "NoDeviceError": RuntimeError,
    "OpenCLError": RuntimeError,
    "BuildError": RuntimeError,
    "OutOfMemoryError": MemoryError,
    "UnsupportedError": NotImplementedError,
    "InputOutputError": OSError,
    "InvalidStateError": RuntimeError,
    "InternalError": RuntimeError,
    "CancelledError": RuntimeError,
}


def test_every_status_of_the_headers_has_its_class(headers: Path) -> None:
    text = (headers / "clspeckle" / "types.h").read_text(encoding="utf-8")
    statuses = {int(value): name for name, value in re.findall(r"#define (CLSP_ERROR_\w+) \((-\d+)\)", text)}
    assert set(errors.BY_STATUS) == set(statuses)
    for status, kind in errors.BY_STATUS.items():
        assert kind.status == status
        assert _library.status_string(status) == statuses[status]
        special = {"IO": "InputOutput", "OPENCL": "OpenCL"}
        name = statuses[status][len("CLSP_ERROR_") :]
        assert kind.__name__ == special.get(name, "".join(w.capitalize() for w in name.split("_"))) + "Error"
    assert len(set(errors.BY_STATUS.values())) == len(statuses)


@pytest.mark.parametrize(("name", "built_in"), BUILT_IN.items())
def test_classes_are_built_in_exceptions_too(name: str, built_in: type[Exception]) -> None:
    kind = getattr(errors, name)
    assert issubclass(kind, errors.ClspeckleError)
    with pytest.raises(built_in) as caught:
        raise kind("message", function="clspX", opencl_code=-5, build_log="log")
    assert str(caught.value) == "clspX: message (OpenCL code -5)\nlog"


def test_all_classes_are_listed() -> None:
    assert set(errors.__all__) == {*BUILT_IN, "ClspeckleError", "LibraryLoadError"}


@pytest.mark.parametrize("name", sorted(errors.__all__))
def test_errors_survive_pickling(name: str) -> None:
    error = getattr(errors, name)("what", function="clspX", opencl_code=-9, build_log="log")
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert (copy.message, copy.function, copy.opencl_code, copy.build_log) == ("what", "clspX", -9, "log")
    assert str(copy) == str(error)


def test_an_unknown_status_is_still_an_error() -> None:
    error = errors.from_status(-4711, "new")
    assert type(error) is errors.ClspeckleError
    assert "-4711" in str(error)


def test_details_come_from_the_c_library(context: clspeckle.Context) -> None:
    with pytest.raises(errors.InvalidArgumentError) as caught:
        clspeckle.Phase((8, 8), oversampling=9, context=context)
    assert caught.value.function == "clspPhaseCreate"
    assert "oversampling" in caught.value.message
    assert caught.value.opencl_code == 0
    assert caught.value.build_log == ""


def test_no_device_says_what_was_seen() -> None:
    with pytest.raises(errors.NoDeviceError) as caught:
        clspeckle.Context("no such device")
    assert "no such device" in caught.value.message
    assert clspeckle.devices()[0].platform_name in caught.value.message


def test_a_broken_kernel_brings_the_build_log(tmp_path: Path) -> None:
    (tmp_path / "stages").mkdir()
    (tmp_path / "stages" / "phase_state.h").write_text("this is not OpenCL C;\n")  # of all phase kernels
    with clspeckle.Context(kernel_dir=tmp_path) as context, pytest.raises(errors.BuildError) as caught:
        clspeckle.Phase((8, 8), context=context).refresh(0)
    assert caught.value.build_log
    assert "error" in caught.value.build_log


def test_too_much_memory_is_a_memory_error(context: clspeckle.Context) -> None:
    with pytest.raises((errors.OutOfMemoryError, errors.InvalidArgumentError)) as caught:
        clspeckle.Buffer(2**62, context=context)
    assert caught.value.opencl_code != 0 or "bytes" in caught.value.message


def test_each_thread_gets_its_own_message(context: clspeckle.Context) -> None:
    wrong: list[str] = []

    def provoke(oversampling: int) -> None:
        for _ in range(200):
            try:
                clspeckle.Phase((8, 8), oversampling=oversampling, context=context)
            except errors.InvalidArgumentError as error:
                if str(oversampling) not in error.message:
                    wrong.append(error.message)
            else:
                wrong.append("no error")

    threads = [threading.Thread(target=provoke, args=(oversampling,)) for oversampling in (1001, 2002, 3003, 4004)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
