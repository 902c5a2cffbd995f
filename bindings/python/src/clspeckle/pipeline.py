"""A whole frame as one enqueued command: pattern (optional), phase refresh, aperture, sensor (optional).

See ``pipeline.h``, and the modules of the stages for their equations.
"""

from __future__ import annotations

import collections
import contextlib
import ctypes
import dataclasses
from collections.abc import Iterable, Iterator, Sequence
from typing import (
    TYPE_CHECKING,
    Any,
    Callable,
    TypedDict,
    TypeVar,
    Union,
    overload,
)

import numpy as np
import numpy.typing as npt

from . import _check, _library, errors
from ._handle import Handle, create, exclusive
from ._interop import EventLike
from ._staging import DeviceImageLike, ImageLike, Operands, Output, Staging, device_image, on_device, output
from .aperture import Aperture, irradiance_image
from .pattern import Geometry, Pattern, Scene, geometry_struct
from .phase import Phase, mask_image
from .runtime import (
    FLOAT32,
    UINT8,
    UINT16,
    Context,
    DeviceImage,
    Event,
    QueueLike,
    queue_pointer,
    resolve_context,
)
from .sensor import OUTPUT_DTYPES, Sensor

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["Frame", "Pipeline", "PipelineParameters", "simulate"]

Refresh = Union[ImageLike, None]
"""None: no new phases; "all": new phases everywhere; a mask: new phases where it is not 0."""

Target = TypeVar("Target")


@dataclasses.dataclass(eq=False)
class Frame:
    """One frame of :meth:`Pipeline.frames`, where it differs from the others."""

    scene: Scene
    refresh: Refresh = None
    frame_index: int | None = None
    """None: one more than that of the last frame."""


class PipelineParameters(TypedDict, total=False):
    """Keyword arguments of :meth:`Pipeline.from_parameters` and :func:`simulate`: those of the stages, under their
    names.

    ``seed`` goes to phase and sensor, ``oversampling`` and ``guard_px`` to phase and aperture.
    """

    seed: int | None
    oversampling: int | None
    guard_px: int | None
    field: str | None
    polarization_count: int | None
    f_number: float | None
    pixel_pitch_m: float | None
    wavelength_m: float | None
    relative_diameter: float | None
    degree_of_polarization: float | None
    normalization: str | None
    soft_rim: float | None
    pupil_image: npt.ArrayLike | None
    bits: int | None
    exposure_gain_dn: float | None
    saturation_dn: float | None
    black_level_dn: float | None
    read_noise_dn: float | None
    hot_pixel_fraction: float | None
    hot_pixel_mean_dn: float | None
    cold_pixel_fraction: float | None
    dark_frame_dn: npt.ArrayLike | None
    float_full_scale: float | None
    quantize: bool | None


_GRID = ("oversampling", "guard_px")
_PHASE = ("seed", "field", "polarization_count", *_GRID)
_APERTURE = (
    "f_number",
    "pixel_pitch_m",
    "wavelength_m",
    "relative_diameter",
    "degree_of_polarization",
    "normalization",
    "soft_rim",
    "pupil_image",
    *_GRID,
)
_SENSOR = (
    "seed",
    "bits",
    "exposure_gain_dn",
    "saturation_dn",
    "black_level_dn",
    "read_noise_dn",
    "hot_pixel_fraction",
    "hot_pixel_mean_dn",
    "cold_pixel_fraction",
    "dark_frame_dn",
    "float_full_scale",
    "quantize",
)


class Pipeline(Handle):
    """A camera: its stages, run as one command per frame.

    Args:
        phase: the surface's random field.
        aperture: the lens; same shape, oversampling and guard_px as the phase.
        sensor: None: frames are the float32 intensity.
        pattern: the projected pattern, then frames bring a :class:`Geometry`; None: frames bring an ideal image.
        context: None: the phase's.

    All stages must come from the same context and have the same shape. The pipeline keeps them alive. Device memory for
    NumPy input and output is allocated once and reused.

    Threads: calls on one object from several threads run one after the other, also those on its stages; different
        pipelines
    with stages of their own run at the same time.
    """

    _release = "clspPipelineRelease"
    _pickle_advice = "make it in the process that uses it; phase.save() gives the state of the speckle"

    def __init__(
        self,
        *,
        phase: Phase,
        aperture: Aperture,
        sensor: Sensor | None = None,
        pattern: Pattern | None = None,
        context: Context | None = None,
    ) -> None:
        for name, stage, kind in (
            ("phase", phase, Phase),
            ("aperture", aperture, Aperture),
            ("sensor", sensor, Sensor),
            ("pattern", pattern, Pattern),
        ):
            if not isinstance(stage, kind) and not (stage is None and name in ("sensor", "pattern")):
                raise TypeError(f"{name} must be a clspeckle.{kind.__name__}, got {_check.kind(stage)}")
        stages = [stage for stage in (phase, aperture, sensor, pattern) if stage is not None]
        desc = _library.initialized(_library.ClspPipelineDesc)
        with exclusive(*stages):
            desc.phase = phase._get()
            desc.aperture = aperture._get()
            desc.sensor = None if sensor is None else sensor._get()
            desc.pattern = None if pattern is None else pattern._get()
            self.context = phase.context if context is None else resolve_context(context)
            self._adopt(create("clspPipelineCreate", self.context._get(), ctypes.byref(desc)))
        self.phase = phase
        self.aperture = aperture
        self.sensor = sensor
        self.pattern = pattern
        self.shape: tuple[int, int] = phase.shape
        self._stages: tuple[Handle, ...] = tuple(stages)
        self._staging = Staging(self.context)
        self._spare: list[Staging] = []
        self._last: Event | None = None
        self._next_frame_index = 0

    @classmethod
    def from_parameters(
        cls,
        shape: tuple[int, int],
        *,
        pattern: Pattern | None = None,
        output: str = "codes",
        context: Context | None = None,
        **parameters: Unpack[PipelineParameters],
    ) -> Pipeline:
        """A pipeline with stages made from keyword arguments.

        Args:
            shape: (height, width) in pixels.
            pattern: as for the class.
            output: "codes": with a sensor; "intensity": without one, frames are the float32 intensity.
            context: None for the pattern's, or :func:`default_context`.
            **parameters: :class:`PipelineParameters`, those of :class:`Phase`, :class:`Aperture` and :class:`Sensor`.
        """
        _check.known_names(parameters, PipelineParameters.__annotations__, "a pipeline")
        with_sensor = _check.choice(output, "output", {"codes": 1, "intensity": 0})
        given: dict[str, Any] = {name: value for name, value in parameters.items() if value is not None}
        if not with_sensor:
            idle = [name for name in given if name in _SENSOR and name not in _PHASE]
            if idle:
                raise TypeError(f'{idle[0]} belongs to the sensor, which output="intensity" leaves out')
        if context is None and pattern is not None:
            context = pattern.context
        context = resolve_context(context)
        with contextlib.ExitStack() as undo:
            phase = Phase(shape, context=context, **{name: given[name] for name in _PHASE if name in given})
            undo.callback(phase.close)
            aperture = Aperture(shape, context=context, **{name: given[name] for name in _APERTURE if name in given})
            undo.callback(aperture.close)
            sensor = None
            if with_sensor:
                sensor = Sensor(shape, context=context, **{name: given[name] for name in _SENSOR if name in given})
                undo.callback(sensor.close)
            made = cls(phase=phase, aperture=aperture, sensor=sensor, pattern=pattern, context=context)
            undo.pop_all()
            return made

    def _forget(self) -> None:
        for staging in (self._staging, *self._spare):
            staging.clear()

    @property
    def output_dtypes(self) -> tuple[Any, ...]:
        """dtypes that frames may have; the first one is the default."""
        return (np.float32,) if self.sensor is None else OUTPUT_DTYPES

    @property
    def next_frame_index(self) -> int:
        """The frame index of a frame that names none: one more than that of the last frame, at first 0."""
        return self._next_frame_index

    @next_frame_index.setter
    def next_frame_index(self, value: int) -> None:
        self._next_frame_index = _check.integer(value, "next_frame_index", 48)

    @overload
    def render(
        self,
        scene: Scene,
        *,
        frame_index: int | None = None,
        refresh: Refresh = None,
        dtype: npt.DTypeLike | None = None,
        out: None = None,
        queue: QueueLike | None = None,
    ) -> npt.NDArray[Any]: ...

    @overload
    def render(
        self,
        scene: Scene,
        *,
        frame_index: int | None = None,
        refresh: Refresh = None,
        dtype: npt.DTypeLike | None = None,
        out: Target,
        queue: QueueLike | None = None,
    ) -> Target: ...

    def render(
        self,
        scene: Scene,
        *,
        frame_index: int | None = None,
        refresh: Refresh = None,
        dtype: npt.DTypeLike | None = None,
        out: Any = None,
        queue: QueueLike | None = None,
    ) -> Any:
        """Renders one frame. Blocks.

        Args:
            scene: the ideal image I0, (height, width), finite, >= 0; or, with a pattern, a :class:`Geometry`. Device
                images are used without a copy; their NaN, infinite and negative pixels count as 0, see :meth:`check`.
            frame_index: counter of the noise and of refreshed phases, below 2^48; None: :attr:`next_frame_index`.
            refresh: None: the speckle stays; "all": new phases everywhere; a (height, width) mask of bool or
                integers, or a uint8 device image: new phases where it is not 0. The first frame always draws all
                phases.
            dtype: uint16 codes (default), uint8 codes (bits = 8 only) or float32; without a sensor float32.
            out: array or device image to write to; None: a new array.
            queue: None for the context's.

        Returns:
            `out`, or a new (height, width) array.

        Raises:
            InvalidDataError: NaN, infinite or negative pixels in a NumPy image.
            InvalidArgumentError, InvalidFormatError: another shape or dtype.
        """
        with exclusive(self, also=self._stages):
            queue = self.context.queue if queue is None else queue
            target = output(out, "out", self.shape, self.output_dtypes, dtype, self._staging, self.context)
            event = self._enqueue(scene, frame_index, refresh, target.image, self._staging, queue, None)
            try:
                return target.finish(queue, event)
            finally:
                if self._last is event:
                    self._last = None

    def enqueue_frame(
        self,
        scene: DeviceImageLike | Geometry,
        output: DeviceImageLike,
        *,
        frame_index: int | None = None,
        refresh: str | DeviceImageLike | None = None,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`render` from device memory into device memory, asynchronously.

        A frame waits for the one before it by itself, on any queue. The output must not overlap an input.
        """
        with exclusive(self, also=self._stages):
            if not isinstance(scene, Geometry):
                scene = device_image(scene, "scene", self.shape, FLOAT32, self.context)
            if refresh is not None and not isinstance(refresh, str):
                refresh = device_image(refresh, "refresh", self.shape, UINT8, self.context)
            default = UINT16 if self.sensor is not None else FLOAT32
            image = device_image(output, "output", self.shape, default, self.context)
            return self._enqueue(scene, frame_index, refresh, image, self._staging, queue, wait_for, device_only=True)

    def _frame(
        self,
        scene: Any,
        frame_index: int | None,
        refresh: Any,
        image: DeviceImage,
        staging: Staging,
        queue: QueueLike | None,
        operands: Operands,
        device_only: bool = False,
    ) -> _library.ClspFrame:
        frame = _library.initialized(_library.ClspFrame)
        index = self._next_frame_index if frame_index is None else _check.integer(frame_index, "frame_index", 64)
        frame.frame_index = index
        if isinstance(refresh, str):
            frame.refresh = _check.choice(refresh, "refresh", {"all": _library.CLSP_REFRESH_ALL})
        elif refresh is not None:
            frame.refresh = _library.CLSP_REFRESH_MASK
            frame.refresh_mask = operands.add(mask_image(refresh, "refresh", self.shape, staging, queue, operands))
        if isinstance(scene, Geometry):
            if self.pattern is None:
                raise TypeError("this pipeline has no pattern; its frames need an ideal image, not a Geometry")
            geometry = geometry_struct(scene, self.shape, staging, queue, operands, device_only)
            frame.geometry = ctypes.pointer(geometry)
        elif self.pattern is not None:
            raise TypeError(f"this pipeline has a pattern; its frames need a Geometry, got {_check.kind(scene)}")
        else:
            frame.irradiance = operands.add(irradiance_image(scene, "scene", self.shape, staging, queue, operands))
        frame.output = operands.add(image)
        return frame

    def _enqueue(
        self,
        scene: Any,
        frame_index: int | None,
        refresh: Any,
        image: DeviceImage,
        staging: Staging,
        queue: QueueLike | None,
        wait_for: Sequence[EventLike] | None,
        device_only: bool = False,
    ) -> Event:
        operands = Operands()
        frame = self._frame(scene, frame_index, refresh, image, staging, queue, operands, device_only)
        event = operands.enqueue(
            "clspPipelineEnqueueFrame",
            self._get(),
            queue_pointer(queue, self.context),
            ctypes.byref(frame),
            wait_for=wait_for,
            after=self._last,
        )
        self._last = event
        self._next_frame_index = min(frame.frame_index + 1, 2**48 - 1)
        return event

    def _settle(self) -> None:
        """Waits for the last frame; its own event has told the caller if it failed."""
        if self._last is not None:
            with contextlib.suppress(errors.OpenCLError):
                self._last.wait()
            self._last = None

    def frames(
        self,
        scenes: Iterable[Scene | Frame],
        *,
        refresh: Refresh = None,
        first_frame_index: int | None = None,
        dtype: npt.DTypeLike | None = None,
        lookahead: int = 1,
        queue: QueueLike | None = None,
    ) -> Iterator[npt.NDArray[Any]]:
        """Renders one frame after the other, each a new array; while one is computed the next scene is taken and
        checked.

        Args:
            scenes: ideal images, geometries, or :class:`Frame` where a frame has a refresh or an index of its own. A
                host image must not be changed before its frame has come out.
            refresh: of frames that bring none, as for :meth:`render`.
            first_frame_index: None: :attr:`next_frame_index`; the following ones count up.
            dtype: as for :meth:`render`.
            lookahead: how many scenes are taken before the first frame comes out, beyond the first; 0 if a scene
                depends on the frame before it. Each costs a set of device buffers.
            queue: None for the context's.
        """
        if first_frame_index is not None:
            self.next_frame_index = first_frame_index
        depth = 1 + _check.integer(lookahead, "lookahead", 8)
        shape, wanted = self.shape, _dtype(dtype, self.output_dtypes)
        return self._stream(scenes, refresh, depth, queue, lambda _: np.empty(shape, wanted))

    def render_batch(
        self,
        scenes: npt.ArrayLike | Sequence[Scene | Frame],
        *,
        refresh: Refresh = None,
        first_frame_index: int | None = None,
        dtype: npt.DTypeLike | None = None,
        out: npt.NDArray[Any] | None = None,
        queue: QueueLike | None = None,
    ) -> npt.NDArray[Any]:
        """Renders a stack of frames into one array, with device buffers that are reused from frame to frame. Blocks.

        Args:
            scenes: (frames, height, width) ideal images, or a sequence as for :meth:`frames`.
            out: (frames, height, width) array to write to; None: a new one.

        The others are those of :meth:`frames`.

        Returns:
            `out`, or a new (frames, height, width) array.
        """
        if isinstance(scenes, (str, bytes)) or not hasattr(scenes, "__len__"):
            raise TypeError(f"scenes must be an array (frames, height, width) or a sequence, got {_check.kind(scenes)}")
        if isinstance(scenes, np.ndarray) and scenes.ndim != 3:
            raise errors.InvalidArgumentError(f"scenes has shape {scenes.shape}, expected (frames, height, width)")
        sequence: Any = scenes
        shape, dtypes = (len(sequence), *self.shape), self.output_dtypes
        if out is None:
            out = np.empty(shape, _dtype(dtype, dtypes))
        else:
            _check.host_output(out, "out", shape, dtypes if dtype is None else (dtype,))
        if first_frame_index is not None:
            self.next_frame_index = first_frame_index
        stack = out
        for _ in self._stream(sequence, refresh, 2, queue, lambda index: stack[index]):
            pass
        return out

    def _stream(
        self,
        scenes: Iterable[Any],
        refresh: Refresh,
        depth: int,
        queue: QueueLike | None,
        target_of: Callable[[int], npt.NDArray[Any]],
    ) -> Iterator[npt.NDArray[Any]]:
        pending: collections.deque[tuple[Output, Event]] = collections.deque()
        with exclusive(self):
            # Taken out while in use: two streams of one pipeline may be interleaved.
            slots = [self._spare.pop() if self._spare else Staging(self.context) for _ in range(depth)]

        def finish() -> npt.NDArray[Any]:
            target, read = pending.popleft()
            read.wait()
            if target.host is not target.given:
                target.given[...] = target.host
            result: npt.NDArray[Any] = target.given
            return result

        try:
            for index, item in enumerate(scenes):
                if len(pending) == depth:
                    yield finish()
                frame = item if isinstance(item, Frame) else Frame(item)
                with exclusive(self, also=self._stages):
                    used = self.context.queue if queue is None else queue
                    given, staging = target_of(index), slots[index % depth]
                    target = output(given, "out", self.shape, (given.dtype,), None, staging, self.context)
                    target.host = given if given.flags.c_contiguous else np.empty(given.shape, given.dtype)
                    wanted = refresh if frame.refresh is None else frame.refresh
                    event = self._enqueue(frame.scene, frame.frame_index, wanted, target.image, staging, used, None)
                    pending.append((target, target.image.enqueue_read(target.host, queue=used, wait_for=[event])))
            while pending:
                yield finish()
        finally:
            # Left early: what was begun still writes to memory that is about to be reused.
            for _, read in pending:
                with contextlib.suppress(errors.ClspeckleError):
                    read.wait()
            if not self.closed:
                with exclusive(self):
                    self._settle()
                    self._spare += slots

    def warm_up(
        self,
        scene: Scene | None = None,
        *,
        refresh: Refresh = None,
        dtype: npt.DTypeLike | None = None,
        queue: QueueLike | None = None,
    ) -> None:
        """Renders a frame like the ones to come and drops it: programs and FFT plans are made, so that the next such
        frame starts without a delay. Blocks. The state of the speckle and :attr:`next_frame_index` stay as they are.

        Args:
            scene: like the scenes to come: which images it has, and in which formats, is what counts. None: a dark
                NumPy image; with a pattern a geometry is needed.
            refresh: like that of the frames to come.
            dtype: of the frames to come; None: the default.
            queue: None for the context's.
        """
        wanted = _dtype(dtype, self.output_dtypes)
        if scene is None:
            if self.pattern is not None:
                raise TypeError("this pipeline has a pattern; warm_up() needs a Geometry like those of its frames")
            scene = np.zeros(self.shape, np.float32)
        with exclusive(self, also=self._stages):
            queue = self.context.queue if queue is None else queue
            self._settle()
            operands = Operands()
            image = self._staging.image("out", self.shape, wanted)
            frame = self._frame(scene, 0, refresh, image, self._staging, queue, operands)
            operands.wait()  # the call takes no wait list
            _library.call("clspPipelineWarmUp", self._get(), queue_pointer(queue, self.context), ctypes.byref(frame))

    def check(self, *, queue: QueueLike | None = None) -> None:
        """Waits for the queue and reports bad pixels (NaN, infinite or negative) of all frames since the last check.

        NumPy images are checked before each frame anyway; this is for device images.

        Raises:
            InvalidDataError: there were some; the message says how many and where the first one was.
        """
        with exclusive(self, also=self._stages):
            self._settle()
            _library.call("clspPipelineCheck", self._get(), queue_pointer(queue, self.context))

    def timings(self) -> dict[str, float]:
        """Device time of each stage of the last frame in milliseconds, in order. Waits for it.

        The frame's queue must have profiling on: ``Context(profiling=True)`` or ``Queue(profiling=True)``.

        Raises:
            InvalidStateError: no profiling, or no frame yet.
        """
        with exclusive(self, also=self._stages):
            count = ctypes.c_uint32()
            _library.call("clspPipelineGetTimings", self._get(), 0, None, ctypes.byref(count))
            if count.value == 0:
                return {}
            timings = (_library.ClspStageTiming * count.value)()
            _library.call("clspPipelineGetTimings", self._get(), len(timings), timings, ctypes.byref(count))
        result: dict[str, float] = {}
        for timing in timings:
            name = _library.text(timing.stage)
            result[name] = result.get(name, 0.0) + timing.milliseconds
        return result


def _dtype(dtype: npt.DTypeLike | None, dtypes: Sequence[Any]) -> np.dtype[Any]:
    wanted = np.dtype(dtypes[0] if dtype is None else dtype)
    if wanted not in [np.dtype(d) for d in dtypes]:
        raise _check.format_error("dtype", wanted, dtypes)
    return wanted


def simulate(
    ideal: ImageLike,
    *,
    frame_index: int = 0,
    refresh: Refresh = None,
    output: str = "codes",
    dtype: npt.DTypeLike | None = None,
    out: npt.NDArray[Any] | None = None,
    context: Context | None = None,
    queue: QueueLike | None = None,
    **parameters: Unpack[PipelineParameters],
) -> npt.NDArray[Any]:
    """What a camera records of an ideal infrared image, in one line. Blocks.

    The result depends on the arguments alone. The context keeps the last camera, so a loop of calls with the same
    parameters pays the set-up once; for control over the state of the speckle use :class:`Pipeline`.

    Args:
        ideal: (height, width), finite, >= 0: one frame; or (frames, height, width): a sequence with frame indices
            counting up.
        frame_index: counter of the speckle and the noise of the first frame, below 2^48.
        refresh: for a sequence: None: all frames have the same speckle; "all": each has its own; a mask: new speckle
            there.
        output: "codes": a sensor's uint16 codes; "intensity": the float32 intensity before it.
        dtype: uint8 (with bits=8) or float32 instead of uint16.
        out: array to write to; None: a new one.
        context: None for :func:`default_context`.
        queue: None for the context's.
        **parameters: :class:`PipelineParameters`, for example ``f_number=2.8, seed=7, read_noise_dn=3``.

    Returns:
        An array of the shape of `ideal`.

    Threads: may be called from any number of threads at once.
    """
    context = resolve_context(context, ideal)
    shape: tuple[int, ...] = getattr(ideal, "shape", ())
    if not on_device(ideal):
        ideal = _check.array(ideal, "ideal")
        shape = ideal.shape
    if len(shape) not in (2, 3):
        raise errors.InvalidArgumentError(
            f"ideal has shape {tuple(shape)}, expected (height, width) or (frames, height, width)"
        )
    size = _check.image_shape(shape[-2:], "ideal.shape")
    key: Any = (size, output, tuple(sorted(parameters.items(), key=lambda item: item[0])))
    try:
        hash(key)
    except TypeError:  # an array among the parameters
        key = None
    camera = None if key is None else context._take_camera(key)
    if camera is None:
        camera = Pipeline.from_parameters(size, output=output, context=context, **parameters)
    try:
        if len(shape) == 2:
            target: Any = out
            result: npt.NDArray[Any] = camera.render(
                ideal, frame_index=frame_index, refresh="all", dtype=dtype, out=target, queue=queue
            )
        else:
            # The camera may have been used before: the first frame draws everything anew.
            scenes = [Frame(scene, "all" if i == 0 else refresh) for i, scene in enumerate(np.asarray(ideal))]
            result = camera.render_batch(scenes, first_frame_index=frame_index, dtype=dtype, out=out, queue=queue)
    except BaseException:
        camera.close()
        raise
    if key is None:
        camera.close()
    else:
        context._keep_camera(key, camera)
    return result
