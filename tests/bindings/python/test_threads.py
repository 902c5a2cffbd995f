"""Objects in several threads, and the GIL."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np

import clspeckle
from binding_common import SHAPE, Runner

THREADS = 4
ROUNDS = 12


def in_threads(work: Callable[[int], Any]) -> list[Any]:
    """Runs work(0), work(1), ... at the same time; returns their results or raises the first error."""
    results: list[Any] = [None] * THREADS
    failures: list[BaseException] = []
    start = threading.Barrier(THREADS)

    def body(index: int) -> None:
        try:
            start.wait()
            results[index] = work(index)
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=body, args=(index,)) for index in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=300)
    assert not any(thread.is_alive() for thread in threads), "a thread hangs"
    if failures:
        raise failures[0]
    return results


def test_a_camera_and_a_queue_for_each_thread(context: clspeckle.Context, ideal: Any) -> None:
    def work(seed: int) -> Any:
        queue = clspeckle.Queue(context)
        camera = clspeckle.Pipeline.from_parameters(SHAPE, seed=seed, context=context)
        return [camera.render(ideal, refresh="all", queue=queue) for _ in range(ROUNDS)]

    serial = [work(seed) for seed in range(THREADS)]
    np.testing.assert_array_equal(in_threads(work), serial)


def test_a_camera_for_each_thread_on_one_queue(context: clspeckle.Context, ideal: Any) -> None:
    def work(seed: int) -> Any:
        camera = clspeckle.Pipeline.from_parameters(SHAPE, seed=seed, context=context)
        return camera.render_batch([ideal] * ROUNDS, refresh="all")

    serial = [work(seed) for seed in range(THREADS)]
    np.testing.assert_array_equal(in_threads(work), serial)


def test_one_camera_in_all_threads(camera: clspeckle.Pipeline, ideal: Any) -> None:
    """Every call refreshes all phases at its own index, so each frame tells which call it belongs to."""
    images = [ideal * (index + 1) for index in range(THREADS)]

    def work(index: int) -> Any:
        return [
            camera.render(images[index], frame_index=100 * index + round_, refresh="all") for round_ in range(ROUNDS)
        ]

    serial = [work(index) for index in range(THREADS)]
    np.testing.assert_array_equal(in_threads(work), serial)


def test_cameras_that_share_a_phase(context: clspeckle.Context, ideal: Any) -> None:
    phase = clspeckle.Phase(SHAPE, seed=1, context=context)
    aperture = clspeckle.Aperture(SHAPE, context=context)
    cameras = [
        clspeckle.Pipeline(phase=phase, aperture=aperture, sensor=clspeckle.Sensor(SHAPE, seed=i, context=context))
        for i in range(THREADS)
    ]

    def work(index: int) -> Any:
        return [cameras[index].render(ideal, frame_index=round_, refresh="all") for round_ in range(ROUNDS)]

    serial = [work(index) for index in range(THREADS)]
    np.testing.assert_array_equal(in_threads(work), serial)


def test_stages_of_one_camera_while_it_renders(camera: clspeckle.Pipeline, ideal: Any) -> None:
    camera.render(ideal, frame_index=0)
    sensor = camera.sensor
    assert sensor is not None
    field, exposed, frame = camera.phase.field(), sensor.expose(ideal), camera.render(ideal, frame_index=0)
    intensity = camera.aperture.intensity(camera.phase, ideal)

    def work(index: int) -> Any:
        for _ in range(ROUNDS):
            if index == 0:
                np.testing.assert_array_equal(camera.render(ideal, frame_index=0), frame)
            elif index == 1:
                np.testing.assert_array_equal(camera.phase.field(), field)
            elif index == 2:
                np.testing.assert_array_equal(sensor.expose(ideal), exposed)
            else:
                np.testing.assert_array_equal(camera.aperture.intensity(camera.phase, ideal), intensity)

    in_threads(work)


def test_simulate_and_functions_in_all_threads(context: clspeckle.Context, ideal: Any) -> None:
    def work(index: int) -> Any:
        for _ in range(ROUNDS):
            frame = clspeckle.simulate(ideal, seed=index % 2, context=context)
            moments = clspeckle.statistics.moments(frame, context=context)
            bits = clspeckle.philox.bits(SHAPE, seed=index, context=context)
        return frame.sum(), moments.mean, bits.sum()

    serial = [work(index) for index in range(THREADS)]
    assert in_threads(work) == serial


def test_closing_while_others_render(context: clspeckle.Context, ideal: Any) -> None:
    """close() waits for the call in progress; the next one says that the object is closed."""
    cameras = [clspeckle.Pipeline.from_parameters(SHAPE, seed=i, context=context) for i in range(2)]

    def work(index: int) -> int:
        camera, rendered = cameras[index % 2], 0
        if index < 2:
            for _ in range(5):
                camera.render(ideal)
            camera.close()
            return -1
        try:
            while True:
                camera.render(ideal)
                rendered += 1
        except clspeckle.errors.InvalidHandleError:
            return rendered

    assert in_threads(work)[:2] == [-1, -1]


def test_one_default_context_for_all_threads() -> None:
    clspeckle.default_context().close()
    contexts = in_threads(lambda _: clspeckle.default_context())
    assert len({id(context) for context in contexts}) == 1


def test_blocking_calls_release_the_gil(run_python: Runner) -> None:
    """Threads wait for an event that only the main thread can complete: with the GIL held, all would wait for ever."""
    result = run_python(
        """
import faulthandler, threading
faulthandler.dump_traceback_later(120, exit=True)
import clspeckle, pyopencl as cl

cl_context = cl.create_some_context(interactive=False)
context = clspeckle.Context.from_opencl(cl_context)
image = clspeckle.DeviceImage((8, 8), context=context)
gate = cl.UserEvent(cl_context)
event = clspeckle.philox.enqueue_fill(image, wait_for=[gate])
waits = [
    lambda: clspeckle.wait([gate]),
    event.wait,
    context.queue.finish,
    lambda: image.read(),
]
threads = [threading.Thread(target=wait) for wait in waits]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join(0.2)
    assert thread.is_alive()
gate.set_status(cl.command_execution_status.COMPLETE)
for thread in threads:
    thread.join()
print("done")
"""
    )
    assert result.stdout == "done\n", result.stderr


def test_one_device_image_looked_at_by_two_threads(run_python: Runner) -> None:
    """Views come and go in both, some of them when the garbage collector finds them. Drivers end the process where
    maps of one memory are not kept apart."""
    code = (
        "import gc, threading\n"
        "import numpy as np, clspeckle\n"
        "gc.set_threshold(5)\n"
        "image = clspeckle.DeviceImage((48, 64), np.uint16)\n"
        "np.asarray(image)[...] = 7\n"
        "def look(view_of):\n"
        "    for _ in range(1500):\n"
        "        view = view_of(image)\n"
        "        assert view[0, 0] == view[-1, -1] == 7\n"
        "        ring = [view]\n"
        "        ring.append(ring)\n"
        "        np.asarray(image)[5, 5]\n"
        "ways = np.asarray, np.from_dlpack\n"
        "threads = [threading.Thread(target=look, args=(way,)) for way in ways]\n"
        "for thread in threads:\n"
        "    thread.start()\n"
        "for thread in threads:\n"
        "    thread.join()\n"
        "gc.collect()\n"
        "print(image.read().mean())\n"
    )
    result = run_python(code)
    assert result.stdout == "7.0\n", (result.returncode, result.stderr)
