"""Who lives how long: reference counts, garbage, interpreter exit, fork, pickling."""

from __future__ import annotations

import copy
import gc
import pickle
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import clspeckle
from binding_common import SHAPE, Runner
from clspeckle import errors


@pytest.fixture
def small() -> Any:
    with clspeckle.Context() as context:
        yield context


def test_memory_comes_back_without_the_garbage_collector(small: clspeckle.Context, ideal: Any) -> None:
    gc.collect()
    gc.disable()
    try:
        before = small.info()
        camera = clspeckle.Pipeline.from_parameters(SHAPE, context=small)
        camera.render(ideal, refresh=np.ones(SHAPE, bool))
        list(camera.frames([ideal, ideal]))
        stages = [weakref.ref(stage) for stage in (camera, camera.phase, camera.aperture, camera.sensor)]
        assert small.info().allocated_bytes > before.allocated_bytes
        del camera
        assert [stage() for stage in stages] == [None] * 4
        after = small.info()
        assert (after.allocation_count, after.allocated_bytes) == (before.allocation_count, before.allocated_bytes)
    finally:
        gc.enable()


def test_a_thousand_frames_allocate_nothing(small: clspeckle.Context, ideal: Any) -> None:
    camera = clspeckle.Pipeline.from_parameters(SHAPE, context=small)
    out = np.empty(SHAPE, np.uint16)
    mask = np.ones(SHAPE, np.uint8)
    camera.render(ideal, refresh=mask, out=out)
    before = small.info()
    images = {name: image.int_ptr for name, image in camera._staging._images.items()}
    for _ in range(1000):
        camera.render(ideal, refresh=mask, out=out)
    assert small.info() == before
    assert {name: image.int_ptr for name, image in camera._staging._images.items()} == images


def test_children_keep_what_they_need(ideal: Any) -> None:
    context = clspeckle.Context()
    camera = clspeckle.Pipeline.from_parameters(SHAPE, seed=1, context=context)
    expected = camera.render(ideal, frame_index=0)
    image = clspeckle.DeviceImage.from_array(ideal, context=context)
    queue = clspeckle.Queue(context)
    camera.phase.close()
    camera.aperture.close()
    assert camera.sensor is not None
    camera.sensor.close()
    # The pipeline keeps its stages, whatever becomes of their Python objects.
    np.testing.assert_array_equal(camera.render(ideal, frame_index=0), expected)
    context.close()
    # Without its context there is no queue of the context's any more, but one's own will do.
    with pytest.raises(errors.InvalidHandleError, match="this Context is closed"):
        camera.render(ideal)
    codes = clspeckle.DeviceImage.wrap(clspeckle.Buffer(expected.nbytes), SHAPE, np.uint16)
    del codes
    np.testing.assert_array_equal(image.read(queue=queue), ideal)
    camera.close()


def test_dropping_things_while_commands_run(context: clspeckle.Context, ideal: Any) -> None:
    expected = clspeckle.simulate(ideal, seed=1, context=context)
    for _ in range(20):
        camera = clspeckle.Pipeline.from_parameters(SHAPE, seed=1, context=context)
        source = clspeckle.DeviceImage.from_array(ideal, context=context)
        target = clspeckle.DeviceImage(SHAPE, np.uint16, context=context)
        out = np.empty(SHAPE, np.uint16)
        event = camera.enqueue_frame(source, target)
        read = target.enqueue_read(out, wait_for=[event])
        del camera, source, target, event
        read.wait()
        np.testing.assert_array_equal(out, expected)


def test_host_memory_lives_until_its_copy_is_done(context: clspeckle.Context) -> None:
    image = clspeckle.DeviceImage((512, 512), np.float32, context=context)
    for value in range(10):
        temporary = np.full((512, 512), value, np.float32)
        alive = weakref.ref(temporary)
        events = image.enqueue_write(temporary)
        del temporary
        assert alive() is not None
        del events  # waits
        assert alive() is None
        assert (image.read() == value).all()


def test_contexts_with_a_kept_camera_are_collected(ideal: Any) -> None:
    context = clspeckle.Context()
    clspeckle.simulate(ideal, context=context)
    gone = weakref.ref(context)
    del context
    gc.collect()
    assert gone() is None


def test_close_in_any_order(ideal: Any) -> None:
    for order in ((0, 1, 2, 3, 4), (4, 3, 2, 1, 0), (2, 0, 4, 1, 3)):
        context = clspeckle.Context()
        camera = clspeckle.Pipeline.from_parameters(SHAPE, context=context)
        camera.render(ideal)
        things: list[Any] = [context, camera.phase, camera.aperture, camera.sensor, camera]
        for index in order:
            things[index].close()
            things[index].close()


def test_failed_constructors_leave_nothing(small: clspeckle.Context) -> None:
    before = small.info()
    for _ in range(3):
        with pytest.raises(errors.InvalidArgumentError):
            clspeckle.Pipeline.from_parameters(SHAPE, bits=99, context=small)
        with pytest.raises(errors.InvalidArgumentError):
            clspeckle.Aperture(SHAPE, f_number=-1, context=small)
    assert small.info().allocated_bytes == before.allocated_bytes
    unmade = clspeckle.Phase.__new__(clspeckle.Phase)
    assert unmade.closed
    unmade.close()
    with pytest.raises(errors.InvalidHandleError):
        unmade.field()
    del unmade


UNPICKLABLE: dict[str, Callable[[clspeckle.Context], Any]] = {
    "Context": lambda c: c,
    "Queue": lambda c: c.queue,
    "Buffer": lambda c: clspeckle.Buffer(4, context=c),
    "DeviceImage": lambda c: clspeckle.DeviceImage((2, 2), context=c),
    "Event": lambda c: clspeckle.DeviceImage((2, 2), context=c).enqueue_write(np.zeros((2, 2), np.float32))[0],
    "Phase": lambda c: clspeckle.Phase(SHAPE, context=c),
    "Aperture": lambda c: clspeckle.Aperture(SHAPE, context=c),
    "Sensor": lambda c: clspeckle.Sensor(SHAPE, context=c),
    "Pattern": lambda c: clspeckle.Pattern(np.ones((2, 2)), context=c),
    "Pipeline": lambda c: clspeckle.Pipeline.from_parameters(SHAPE, context=c),
}


@pytest.mark.parametrize("name", UNPICKLABLE)
def test_pickling_and_copying_are_refused_clearly(name: str, context: clspeckle.Context) -> None:
    thing = UNPICKLABLE[name](context)
    for attempt in (pickle.dumps, copy.copy, copy.deepcopy):
        with pytest.raises(TypeError, match=rf"an? {name} belongs to one process .* cannot be pickled or copied"):
            attempt(thing)


def test_plain_results_can_be_pickled(context: clspeckle.Context, ideal: Any) -> None:
    for value in (
        context.info(),
        clspeckle.version(),
        clspeckle.field_grid(SHAPE),
        clspeckle.statistics.moments(ideal, context=context),
        clspeckle.Aperture(SHAPE, context=context).info(),
    ):
        assert pickle.loads(pickle.dumps(value)) == value
    histogram = clspeckle.statistics.histogram(ideal, 0, 2, 4, context=context)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(histogram)).counts, histogram.counts)


PREPARE = """
import gc, sys, threading
import numpy as np
import clspeckle
ideal = np.ones((32, 48), np.float32)
camera = clspeckle.Pipeline.from_parameters(ideal.shape, seed=1)
camera.render(ideal)
"""

EXITS = {
    "objects at module level": "",
    "a cycle": "camera.me = camera\n",
    "in a class": "class Holder:\n    kept = camera\ndel camera\n",
    "in sys.modules": "sys.camera = camera\n",
    "a generator half way": "frames = camera.frames([ideal] * 5)\nnext(frames)\n",
    "pending copies": (
        "image = clspeckle.DeviceImage((2048, 2048))\n"
        "out = np.empty((2048, 2048), np.float32)\n"
        "events = image.enqueue_write(np.ones((2048, 2048), np.float32)) + [image.enqueue_read(out)]\n"
    ),
    "copies that never run": (
        "import pyopencl as cl\n"
        "cl_context = cl.create_some_context(interactive=False)\n"
        "image = clspeckle.DeviceImage((8, 8), context=clspeckle.Context.from_opencl(cl_context))\n"
        "out = np.empty((8, 8), np.float32)\n"
        "kept = image.enqueue_read(out, wait_for=[cl.UserEvent(cl_context)])\n"
    ),
    "pending frames": (
        "source = clspeckle.DeviceImage.from_array(ideal)\n"
        "target = clspeckle.DeviceImage(ideal.shape, np.uint16)\n"
        "events = [camera.enqueue_frame(source, target) for _ in range(50)]\n"
    ),
    "a closed context": "clspeckle.default_context().close()\n",
    "use in __del__": (
        "class Late:\n    def __del__(self):\n        camera.close()\n        del camera.phase\n"
        "late = Late()\nlate.me = late\n"
    ),
    "a daemon thread": (
        "def forever():\n    while True:\n        camera.render(ideal)\n"
        "threading.Thread(target=forever, daemon=True).start()\n"
    ),
    "an error": "raise SystemExit(0)\n",
}


@pytest.mark.parametrize("name", EXITS)
def test_exit_is_quiet(name: str, run_python: Runner) -> None:
    result = run_python(PREPARE + EXITS[name], PYTHONWARNINGS="ignore")  # those of PyOpenCL's dependencies
    assert result.returncode == 0, result.stderr
    # clFFT, the library behind the transforms, says at the end of every process that it was not torn down.
    own = [line for line in result.stderr.splitlines() if "clFFT" not in line and "clfftTeardown" not in line]
    assert own == []
    assert result.stdout == ""


FORK = """
import os, sys
import numpy as np
import clspeckle
{before}
child = os.fork()
if child == 0:
    code = 1
    try:
        {inside}
        code = 0
    except clspeckle.errors.InvalidStateError as error:
        code = 7 if "spawn" in str(error) else 1
    finally:
        os._exit(code)
code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
{after}
print(code)
"""
IDEAL = "ideal = np.ones((32, 48), np.float32)\n"
CAMERA = IDEAL + "camera = clspeckle.Pipeline.from_parameters((32, 48), seed=1)\ncamera.render(ideal)"


@pytest.mark.parametrize(
    ("before", "inside", "after", "code"),
    [
        # The parent has used OpenCL: every way to go on says so, instead of hanging.
        (CAMERA, "camera.render(ideal)", "camera.render(ideal)", 7),
        (CAMERA, "clspeckle.simulate(ideal)", "camera.render(ideal)", 7),
        (CAMERA, "clspeckle.Context()", "camera.render(ideal)", 7),
        (CAMERA, "clspeckle.default_context()", "", 7),
        (CAMERA, "list(camera.frames([ideal]))", "", 7),
        (CAMERA, "clspeckle.devices()", "", 7),
        ("clspeckle.devices()", "clspeckle.devices()", "", 7),
        # Dropping what was inherited is silent, and takes nothing from the parent.
        (CAMERA, "camera.close(); clspeckle.default_context", "camera.render(ideal)", 0),
        (CAMERA, "del camera; import gc; gc.collect()", "camera.render(ideal)", 0),
        # Without OpenCL in the parent the child is free.
        (IDEAL + "clspeckle.version(); clspeckle.Sensor.defaults()", "clspeckle.simulate(ideal)", "", 0),
    ],
)
def test_fork(before: str, inside: str, after: str, code: int, run_python: Runner) -> None:
    result = run_python(FORK.format(before=before, inside=inside, after=after))
    assert result.stdout == f"{code}\n", result.stderr


def test_workers_with_spawn(run_python: Runner) -> None:
    result = run_python(
        """
import multiprocessing
import numpy as np
import clspeckle

def work(seed):
    return clspeckle.simulate(np.ones((32, 48), np.float32), seed=seed)

def fail(_):
    clspeckle.Sensor((8, 8), bits=99)

if __name__ == "__main__":
    here = [work(seed) for seed in (1, 2)]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        there = pool.map(work, (1, 2))
        np.testing.assert_array_equal(there, here)
        try:
            pool.map(fail, [0])
        except clspeckle.errors.InvalidArgumentError as error:
            print(error.function)
"""
    )
    assert result.stdout == "clspSensorCreate\n", result.stderr
