"""A whole frame as one enqueued command: the laser's light (pattern, dots or an ideal image), motion, phase, aperture,
lens, sensor.

See ``pipeline.h`` for the order and what happens in between, and the modules of the stages for their equations.
"""

from __future__ import annotations

import collections
import contextlib
import ctypes
import dataclasses
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
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

from . import _check, _doubts, _library, errors
from ._handle import Handle, exclusive
from ._interop import EventLike
from ._staging import Command, DeviceImageLike, ImageLike, Output, Stage, Staging, device_image, on_device
from .aperture import Aperture
from .diagnosis import Hypothesis, hypothesis_struct, hypothesis_values
from .dots import Dots
from .effect import Effect, effect_values, find_effect
from .effect import effects as catalogue
from .lens import Lens
from .material import Material, MaterialTable
from .motion import Motion, MotionInput, material_plane, motion_struct
from .pattern import Geometry, Pattern, Scene, geometry_struct
from .phase import Phase
from .profile import Profile
from .runtime import FLOAT32, UINT8, UINT16, Context, DeviceImage, Event, QueueLike, queue_pointer, resolve_context
from .sensor import OUTPUT_DTYPES, Sensor

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["Frame", "Pipeline", "PipelineParameters", "simulate"]

Refresh = Union[ImageLike, None]
"""None: no new phases; "all": new phases everywhere; a mask: new phases where it is not 0."""

Target = TypeVar("Target")
Made = TypeVar("Made", bound=Handle)


@dataclasses.dataclass(eq=False)
class Frame:
    """One frame of :meth:`Pipeline.frames`, where it differs from the others."""

    scene: Scene | None
    """The ideal image, or a :class:`Geometry`; None with dots, or in the dark."""
    refresh: Refresh = None
    """Where new phases are drawn, as for :meth:`Pipeline.render`."""
    frame_index: int | None = None
    """None: one more than that of the last frame."""
    motion: MotionInput | None = None
    """How the scene moved since the last frame, with a motion stage; None: it rests."""
    material: ImageLike | None = None
    """(height, width) material ids, with a material table."""
    illumination: str | None = None
    """"laser" (None), "incoherent" or "dark"."""


class PipelineParameters(TypedDict, total=False):
    """Keyword arguments of :meth:`Pipeline.from_parameters` and :func:`simulate`: those of the stages, under their
    names.

    ``seed`` goes to phase, sensor and the pipeline itself, ``oversampling`` and ``guard_px`` to phase and aperture.
    ``field`` may be a field of the caller's own, as for :meth:`Phase.set_field`: frames have it until a refresh.
    There is a lens if one of its parameters is given. ``effects`` maps ids of :func:`effects` to their parameters by
    name, for example ``{"defocus": {"waves": 0.8}, "glare": {}}``; those that are left out take the middle. Effects of
    your own are set by :meth:`Pipeline.set_effect` alone. With "depolarization" a field of your own needs two
    polarizations: (2, height, width).
    """

    seed: int | None
    oversampling: int | None
    guard_px: int | None
    field: str | npt.ArrayLike | None
    polarization_count: int | None
    dynamics: str | None
    translate: bool | None
    f_number: float | None
    pixel_pitch_m: float | None
    wavelength_m: float | None
    relative_diameter: float | None
    degree_of_polarization: float | None
    normalization: str | None
    soft_rim: float | None
    pupil: str | npt.ArrayLike | None
    pupil_image: npt.ArrayLike | None
    blade_count: int | None
    blade_rotation_rad: float | None
    blade_curvature: float | None
    obstruction_ratio: float | None
    defocus_waves: float | None
    zernike_waves: Mapping[int, float] | Sequence[float] | npt.NDArray[Any] | None
    fill_factor: float | None
    k1: float | None
    k2: float | None
    k3: float | None
    p1: float | None
    p2: float | None
    radius_unit: str | None
    principal_point_px: tuple[float, float] | None
    focal_length_px: tuple[float, float] | None
    vignetting_corner_loss: float | None
    cos4_falloff: bool | None
    glare_fraction: float | None
    glare_scale_px: float | None
    ambient: float | None
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
    conversion_gain_dn_per_e: float | None
    photons_per_unit: float | None
    quantum_efficiency: float | None
    full_well_e: float | None
    crosstalk_fraction: float | None
    prnu: float | None
    column_prnu: float | None
    row_prnu: float | None
    mosaic_gain: npt.ArrayLike | None
    dark_current_e_per_s: float | None
    dark_current_reference_temperature_c: float | None
    dark_current_doubling_k: float | None
    temperature_c: float | None
    exposure_time_s: float | None
    lag_fraction: float | None
    gamma: float | None
    dsnu_dn: float | None
    column_offset_dn: float | None
    row_noise_dn: float | None
    column_noise_dn: float | None
    read_noise_spread: float | None
    shot_noise: bool | None
    effective_bits: int | None
    row_offset_dn: float | None
    dull_pixel_fraction: float | None
    cubic_nonlinearity: float | None
    periodic_offset_dn: float | None
    periodic_frequency_x: float | None
    periodic_frequency_y: float | None
    telegraph_fraction: float | None
    telegraph_step_dn: float | None
    telegraph_centered: bool | None
    code_width_wave: float | None
    code_width_period: float | None
    widest_code: float | None
    nonlinearity_power: int | None
    read_noise_correlation: float | None
    gain_map: npt.ArrayLike | None
    line_count: int | None
    sub_exposures: int | None
    dephasing_rad: float | None
    power_flicker: float | None
    coherent_fraction: float | None
    subsurface_length_px: float | None
    subsurface_fraction: float | None
    exposure_path: float | None
    boiling_correlation_frames: float | None
    airflow_rms_rad: float | None
    airflow_scale_px: float | None
    airflow_correlation_frames: float | None
    airflow_wind_px: float | None
    vibration_rms_px: float | None
    shutter_fraction: float | None
    exposure_correlation: str | None
    effects: Mapping[str, Mapping[str, float] | None] | None


_PHASE, _APERTURE, _LENS, _SENSOR = (_check.optional(stage.__init__) for stage in (Phase, Aperture, Lens, Sensor))
_ILLUMINATION = _library.words("ILLUMINATION")


class Pipeline(Stage):
    """A camera: its stages, run as one command per frame.

    Args:
        phase: the surface's random field.
        aperture: the lens; same shape, oversampling and guard_px as the phase.
        sensor: None: frames are the float32 intensity.
        pattern: the projected pattern, then frames bring a :class:`Geometry`; None: frames bring an ideal image.
        dots: ideal dots instead of a pattern; frames bring neither.
        materials: what surfaces are made of; frames bring material ids. Needs a phase with polarization_count 2.
        motion: None: frames bring no motion.
        lens: None: one without distortion, glare, ambient light and vignetting.
        seed: of flicker, vibration, surface heights and airflow, below 2^64.
        line_count: lines of the laser, 1 to 63.
        sub_exposures: parts of an exposure, at most 127; 0: as many as exposure_path takes.
        dephasing_rad: standard deviation over the surface of the phase by which a line at k = 1 differs from that at 0.
        power_flicker: relative standard deviation of the laser's power from frame to frame.
        coherent_fraction: part of the field that keeps its phase, 0 to 1; with materials theirs counts.
        subsurface_length_px: length of exp(-r / L) by which light spreads below the surface.
        subsurface_fraction: of the light that does, 0 to 1; with materials theirs counts.
        exposure_path: path of the surface in correlation lengths while the shutter is open, in frames with refresh
            "all".
        boiling_correlation_frames: frames after which a resting surface's field correlation is 1/e; infinity: never.
        airflow_rms_rad: standard deviation of the air's phase screen.
        airflow_scale_px: distance at which its correlation is 1/e.
        airflow_correlation_frames: frames after which its correlation is 1/e, where the wind has carried it; infinity:
            it stays as it is.
        airflow_wind_px: how far the wind carries it in a frame, to the right; it comes back after the field's width.
        vibration_rms_px: standard deviation of the picture's shift along each axis.
        shutter_fraction: part of the time between two frames that the shutter is open, 0 to 1; of the motion between
            them so much happens in the exposure.
        exposure_correlation: of the field over an exposure_path: "field": its own, exp(-path) unless it is continuous;
            "gaussian": exp(-path^2).
        context: None: the phase's.

    What is None has the C library's default, see :meth:`defaults`. All stages must come from the same context and have
    the same shape. The pipeline keeps them alive. Device memory for NumPy input and output is allocated once and
    reused.

    Threads: calls on one object from several threads run one after the other, also those on its stages; different
        pipelines with stages of their own run at the same time.
    """

    _c_name = "clspPipeline"
    _arguments = _check.Arguments(
        _library.ClspPipelineDesc, words={"exposure_correlation": _library.words("EXPOSURE_CORRELATION")}
    )
    _pickle_advice = "make it in the process that uses it; phase.save() gives the state of the speckle"

    def __init__(
        self,
        *,
        phase: Phase,
        aperture: Aperture,
        sensor: Sensor | None = None,
        pattern: Pattern | None = None,
        dots: Dots | None = None,
        materials: MaterialTable | None = None,
        motion: Motion | None = None,
        lens: Lens | None = None,
        seed: int | None = None,
        line_count: int | None = None,
        sub_exposures: int | None = None,
        dephasing_rad: float | None = None,
        power_flicker: float | None = None,
        coherent_fraction: float | None = None,
        subsurface_length_px: float | None = None,
        subsurface_fraction: float | None = None,
        exposure_path: float | None = None,
        boiling_correlation_frames: float | None = None,
        airflow_rms_rad: float | None = None,
        airflow_scale_px: float | None = None,
        airflow_correlation_frames: float | None = None,
        airflow_wind_px: float | None = None,
        vibration_rms_px: float | None = None,
        shutter_fraction: float | None = None,
        exposure_correlation: str | None = None,
        context: Context | None = None,
    ) -> None:
        desc = self._arguments.describe(locals())
        parts: dict[str, tuple[Any, type[Handle]]] = {
            "phase": (phase, Phase),
            "aperture": (aperture, Aperture),
            "sensor": (sensor, Sensor),
            "pattern": (pattern, Pattern),
            "dots": (dots, Dots),
            "materials": (materials, MaterialTable),
            "motion": (motion, Motion),
            "lens": (lens, Lens),
        }
        for name, (stage, kind) in parts.items():
            if not isinstance(stage, kind) and not (stage is None and name not in ("phase", "aperture")):
                raise TypeError(f"{name} must be a clspeckle.{kind.__name__}, got {_check.kind(stage)}")
        stages: list[Handle] = [stage for stage, _ in parts.values() if stage is not None]
        with exclusive(*stages):
            for name, (stage, _) in parts.items():
                setattr(desc, name, None if stage is None else stage._get())
            self._create(desc, phase.context if context is None else context)
        self.phase = phase
        self.aperture = aperture
        self.sensor = sensor
        self.pattern = pattern
        self.dots = dots
        self.materials = materials
        self.motion = motion
        self.lens = lens
        self.shape: tuple[int, int] = phase.shape
        self._stages: tuple[Handle, ...] = tuple(stages)
        self._spare: list[Staging] = []
        self._last: Event | None = None
        self._next_frame_index = 0
        # Mean signal of the frame whose ideal image was last looked up, and the largest since.
        self._looked_up: tuple[float, float] | None = None
        self._judged_by: tuple[Any, _doubts.Exposure] | None = None
        self._scene_name = "scene"  # of the caller's argument
        self._effects: dict[str, dict[str, float]] = {}
        self._own: set[str] = set()  # of them, those of the caller's own
        self._polarization_count = phase.polarization_count

    @classmethod
    def from_parameters(
        cls,
        shape: tuple[int, int],
        *,
        pattern: Pattern | None = None,
        dots: Dots | None = None,
        materials: MaterialTable | Iterable[Material] | None = None,
        motion: Motion | Mapping[str, Any] | None = None,
        lens: Lens | None = None,
        output: str = "codes",
        context: Context | None = None,
        **parameters: Unpack[PipelineParameters],
    ) -> Pipeline:
        """A pipeline with stages made from keyword arguments.

        Args:
            shape: (height, width) in pixels.
            pattern: as for the class; `dots` likewise.
            materials: a table, or the materials of a new one.
            motion: a stage, or keyword arguments of a new :class:`Motion`, for example ``{"intrinsics": (fx, fy, cx,
                cy)}``; it gets the materials, and the phase what the motion's rule and `translate` need.
            lens: a stage; None: from the lens's parameters, if there are any.
            output: "codes": with a sensor; "intensity": without one, frames are the float32 intensity.
            context: None for the pattern's, that of another stage that is given, or :func:`default_context`.
            **parameters: :class:`PipelineParameters`, those of :class:`Phase`, :class:`Aperture`, :class:`Lens`,
                :class:`Sensor`, the pipeline's own, and ``effects``.
        """
        _check.known_names(parameters, PipelineParameters.__annotations__, "a pipeline")
        with_sensor = _check.choice(output, "output", {"codes": 1, "intensity": 0})
        given: dict[str, Any] = {name: value for name, value in parameters.items() if value is not None}
        if not with_sensor:
            idle = [name for name in given if name in _SENSOR and name not in _PHASE]
            if idle:
                raise TypeError(f'{idle[0]} belongs to the sensor, which output="intensity" leaves out')
        own_field = None
        if not isinstance(given.get("field", ""), str):
            own_field = _check.array(given.pop("field"), "field")
            given.setdefault("polarization_count", own_field.shape[0] if own_field.ndim == 3 else 1)
        wanted = _effects(given.get("effects"))
        of_lens = {name: given[name] for name in _LENS if name in given}
        if lens is not None and of_lens:
            raise TypeError(f"{next(iter(of_lens))} belongs to the lens, which was given; give one or the other")
        for stage in (pattern, dots, lens, materials, motion):
            if context is None and isinstance(stage, (Pattern, Dots, Lens, MaterialTable, Motion)):
                context = stage.context
        context = resolve_context(context)
        with contextlib.ExitStack() as undo:

            def own(stage: Made) -> Made:
                undo.callback(stage.close)
                return stage

            table = materials
            if table is not None and not isinstance(table, MaterialTable):
                table = own(MaterialTable(table, context=context))
            if isinstance(motion, Mapping):
                # What the phase does with the path and the shift that this motion gives it.
                if motion.get("rule") != "replace" and given.get("field") != "unit_phasor" and own_field is None:
                    given.setdefault("dynamics", "continuous")
                if motion.get("translate"):
                    given.setdefault("translate", True)
                motion = own(Motion(shape, **{"materials": table, "context": context, **motion}))

            def of(names: Iterable[str]) -> dict[str, Any]:
                return {name: given[name] for name in names if name in given}

            if of_lens:
                lens = own(Lens(shape, context=context, **of_lens))
            phase = own(Phase(shape, context=context, **of(_PHASE)))
            if own_field is not None:
                phase.set_field(own_field)
            aperture = own(Aperture(shape, context=context, **of(_APERTURE)))
            sensor = own(Sensor(shape, context=context, **of(_SENSOR))) if with_sensor else None
            made = own(
                cls(
                    phase=phase,
                    aperture=aperture,
                    sensor=sensor,
                    pattern=pattern,
                    dots=dots,
                    materials=table,
                    motion=motion,
                    lens=lens,
                    context=context,
                    **of(_PIPELINE),
                )
            )
            made.set_effects(wanted)
            undo.pop_all()
            return made

    @classmethod
    def from_profile(
        cls,
        profile: Profile,
        *,
        sequence: str | None = None,
        maps: bool = True,
        pattern: Pattern | None = None,
        dots: Dots | None = None,
        materials: MaterialTable | Iterable[Material] | None = None,
        motion: Motion | Mapping[str, Any] | None = None,
        context: Context | None = None,
        **parameters: Unpack[PipelineParameters],
    ) -> Pipeline:
        """A pipeline that is a profile's camera, with its maps and effects.

        Args:
            profile: the camera.
            sequence: name of one of the profile's, whose light it gets; None: the default exposure.
            maps: as for :meth:`set_profile`.
            pattern, dots, materials, motion, context: as for :meth:`from_parameters`. Effects on dots are left out of
                a camera that draws none.
            **parameters: :class:`PipelineParameters` beside the profile's or in their place; `effects` likewise.

        Raises:
            InvalidArgumentError: no such sequence; or parameters of another camera: bits, pixel pitch or wavelength.
        """
        if not isinstance(profile, Profile):
            raise TypeError(f"profile must be a clspeckle.Profile, got {_check.kind(profile)}")
        _check.known_names(parameters, PipelineParameters.__annotations__, "a pipeline")
        given: dict[str, Any] = {**profile.parameters(sequence), **parameters}
        wanted = _effects(given.pop("effects", None))
        made = cls.from_parameters(
            profile.shape, pattern=pattern, dots=dots, materials=materials, motion=motion, context=context, **given
        )
        try:
            made.set_profile(profile, maps=maps)
            made.set_effects(wanted)
        except BaseException:
            made.close()
            raise
        return made

    def _forget(self) -> None:
        super()._forget()
        for staging in self._spare:
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
        scene: Scene | None = None,
        *,
        frame_index: int | None = None,
        refresh: Refresh = None,
        motion: MotionInput | None = None,
        material: ImageLike | None = None,
        illumination: str | None = None,
        dtype: npt.DTypeLike | None = None,
        out: None = None,
        queue: QueueLike | None = None,
    ) -> npt.NDArray[Any]: ...

    @overload
    def render(
        self,
        scene: Scene | None = None,
        *,
        frame_index: int | None = None,
        refresh: Refresh = None,
        motion: MotionInput | None = None,
        material: ImageLike | None = None,
        illumination: str | None = None,
        dtype: npt.DTypeLike | None = None,
        out: Target,
        queue: QueueLike | None = None,
    ) -> Target: ...

    def render(
        self,
        scene: Scene | None = None,
        *,
        frame_index: int | None = None,
        refresh: Refresh = None,
        motion: MotionInput | None = None,
        material: ImageLike | None = None,
        illumination: str | None = None,
        dtype: npt.DTypeLike | None = None,
        out: Any = None,
        queue: QueueLike | None = None,
    ) -> Any:
        """Renders one frame. Blocks.

        Args:
            scene: the ideal image I0, (height, width), finite, >= 0; or, with a pattern, a :class:`Geometry`. Device
                images are used without a copy; their NaN, infinite and negative pixels count as 0, see :meth:`check`.
                None with dots, or in the dark.
            frame_index: counter of the noise and of refreshed phases, below 2^48; None: :attr:`next_frame_index`.
            refresh: None: the speckle stays; "all": new phases everywhere; a (height, width) mask of bool or
                integers, or a uint8 device image: new phases where it is not 0. The first frame always draws all
                phases.
            motion: how the scene moved since the last frame, with a motion stage; None: it rests.
            material: (height, width) ids of the material table, integers 0 to 255 or a uint8 device image; those of the
                motion, too, where it brings none.
            illumination: "laser" (None): speckle; "incoherent": an LED or a lamp, no speckle, the scene is an ideal
                image whatever the pattern or the dots; "dark": a covered lens, no scene is looked at.
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
            command = self._command(queue)
            target = command.output(out, self.shape, self.output_dtypes, dtype)
            given = Frame(scene, refresh, frame_index, motion, material, illumination)
            event = self._enqueue_frame(command, given, target.image)
            try:
                result = target.finish(event)
            finally:
                if self._last is event:
                    self._last = None
            self._doubt(given, target.host, self._staging)
            return result

    def _exposure(self) -> _doubts.Exposure:
        """By which frames are judged, made anew where the camera changed."""
        sensor, ambient = self.sensor, 0.0 if self.lens is None else self.lens._ambient
        camera = (
            ambient,
            None if sensor is None else (sensor._converter, sensor._exposure_gain_dn, sensor._dn_per_photon),
        )
        if self._judged_by is None or self._judged_by[0] != camera:
            passed = 1.0 if self.aperture._keeps_mean else self.aperture.info().mean_transmission
            if sensor is None:
                made = _doubts.Exposure(None, 0.0, 0.0, passed, ambient)
            else:
                gain, converter = sensor._exposure_gain_dn, sensor._converter
                if self._effects:
                    traits = self._traits(self._effects, converter, ambient * gain)
                    ambient = traits.ambient_dn / gain if gain > 0 else ambient
                    converter = converter.with_traits(traits)
                made = _doubts.Exposure(converter, gain, sensor._dn_per_photon, passed, ambient)
            self._judged_by = (camera, made)
        return self._judged_by[1]

    def _doubt(self, frame: Frame, output: npt.NDArray[Any] | None, staging: Staging) -> None:
        """Tells a frame without light, and one with nothing but the top code."""
        if frame.illumination == "dark" or self._own:  # nobody knows what an effect of the caller's own does to light
            return
        exposure, scene = self._exposure(), frame.scene
        if scene is None or isinstance(scene, Geometry) or on_device(scene):
            if output is not None:
                self._doubt_signal(exposure, frame, output, staging)
            elif isinstance(scene, Geometry) and self.pattern is not None and self._looked_up is None:
                self._looked_up = 0.0, 0.0
                exposure.of_pattern(_light_on(scene, self.pattern, staging))
            return
        if exposure.fits(staging.brightest):
            return
        name = self._scene_name
        ideal = _check.array(scene, name)
        full = _check.full_scale(ideal.dtype)
        if ideal.ndim > 2:
            ideal = _check.one_image(ideal, name, mean=True, tell=False)
        if ideal.dtype.kind in "iu" and not full and ideal.max() > 1:
            return  # that no full scale is known has been told
        if_meant = 'illumination="dark"'
        if name == "ideal":  # of simulate(), which has no illumination
            if_meant = 'clspeckle.Pipeline.from_parameters(ideal.shape[-2:]).render(illumination="dark")'
        if not exposure.of_scene(ideal, name, full, if_meant) and output is not None:
            exposure.of_frame(output, ideal, name, full)

    def _doubt_signal(
        self, exposure: _doubts.Exposure, frame: Frame, output: npt.NDArray[Any], staging: Staging
    ) -> None:
        """The same of a frame whose ideal image is not on the host. It is looked up again where less than half of the
        signal is left that there was, or more than twice that of the last time."""
        signal, light = max(exposure.signal_of(output), 0.0), None
        at_look, largest = self._looked_up or (math.inf, math.inf)
        if signal < largest / 2 or signal > 2 * at_look:
            if isinstance(frame.scene, Geometry) and self.pattern is not None:
                light = _light_on(frame.scene, self.pattern, staging)
                exposure.of_pattern(light)
            elif frame.scene is None and self.dots is not None:
                light = self.dots.render()
                self.dots._staging.clear()
                exposure.of_dots(light)
            self._looked_up = signal, signal
        else:
            self._looked_up = at_look, max(signal, largest)
        if light is not None or exposure.may_be_saturated(output, signal):
            exposure.of_frame(output, light, "", 0)

    def enqueue_frame(
        self,
        scene: DeviceImageLike | Geometry | None,
        output: DeviceImageLike,
        *,
        frame_index: int | None = None,
        refresh: str | DeviceImageLike | None = None,
        motion: MotionInput | None = None,
        material: DeviceImageLike | None = None,
        illumination: str | None = None,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """:meth:`render` from device memory into device memory, asynchronously.

        A frame waits for the one before it by itself, on any queue. The output must not overlap an input.
        """
        with exclusive(self, also=self._stages):
            given = Frame(scene, refresh, frame_index, motion, material, illumination)
            return self._enqueue_frame(self._asynchronous(queue, wait_for), given, output)

    def enqueue_frames(
        self,
        scenes: Sequence[DeviceImageLike | Geometry | Frame | None],
        outputs: Sequence[DeviceImageLike],
        *,
        refresh: str | DeviceImageLike | None = None,
        first_frame_index: int | None = None,
        queue: QueueLike | None = None,
        wait_for: Sequence[EventLike] | None = None,
    ) -> Event:
        """Several :meth:`enqueue_frame` in one call, one frame after the other, each into an output of its own.

        If one of them is refused, none is enqueued, and the message says which.

        Args:
            scenes: device images, geometries, or :class:`Frame` of device memory where a frame brings more.
            outputs: as many.
            refresh: of frames that bring none.
            first_frame_index: None: :attr:`next_frame_index`; the following ones count up.

        Returns:
            The event of the last frame.
        """
        if len(scenes) != len(outputs) or not len(scenes):
            raise errors.InvalidArgumentError(
                f"{len(scenes)} scenes and {len(outputs)} outputs were given, expected as many of each, one at least"
            )
        with exclusive(self, also=self._stages):
            before = self._next_frame_index
            if first_frame_index is not None:
                self._next_frame_index = _check.integer(first_frame_index, "first_frame_index", 48)
            command, structs = self._asynchronous(queue, wait_for), []
            try:
                for index, (scene, output) in enumerate(zip(scenes, outputs, strict=True)):
                    frame = scene if isinstance(scene, Frame) else Frame(scene)
                    if frame.refresh is None:
                        frame = dataclasses.replace(frame, refresh=refresh)
                    try:
                        structs.append(self._frame(command, frame, output))
                    except errors.ClspeckleError as error:
                        error.message = f"frames[{index}]: {error.message}"
                        raise
                    except TypeError as error:
                        raise TypeError(f"frames[{index}]: {error}") from None
                    self._next_frame_index = min(structs[-1].frame_index + 1, 2**48 - 1)
                array = (_library.ClspFrame * len(structs))(*structs)
                event = command.enqueue("clspPipelineEnqueueFrames", self._get(), len(structs), array, after=self._last)
            except BaseException:
                self._next_frame_index = before
                raise
            self._last = event
            return event

    def _frame(self, command: Command, given: Frame, output: DeviceImageLike) -> _library.ClspFrame:
        frame = _library.initialized(_library.ClspFrame)
        scene, refresh = given.scene, given.refresh
        index = given.frame_index
        frame.frame_index = self._next_frame_index if index is None else _check.integer(index, "frame_index", 64)
        if given.illumination is not None:
            frame.illumination = _check.choice(given.illumination, "illumination", _ILLUMINATION)
        laser = frame.illumination == _library.CLSP_ILLUMINATION_LASER
        if isinstance(refresh, str):
            frame.refresh = _check.choice(refresh, "refresh", {"all": _library.CLSP_REFRESH_ALL})
        elif refresh is not None:
            frame.refresh = _library.CLSP_REFRESH_MASK
            frame.refresh_mask = command.add(command.mask(refresh, "refresh", self.shape))
        if laser and given.motion is not None:
            if self.motion is None:
                raise TypeError("this pipeline has no motion stage; make it with one, or leave motion out")
            motion, transforms = motion_struct(given.motion, self.shape, command)
            frame.motion = ctypes.pointer(motion)
            frame._transforms = transforms  # the C struct points into it
        if laser and self.materials is not None:
            if given.material is None:
                raise TypeError("this pipeline has a material table; its frames need each pixel's material id")
            material = command.image(given.material, "material", self.shape, UINT8, material_plane)
            frame.material = command.add(material)
        elif laser and given.material is not None:
            raise TypeError("this pipeline has no material table; make it with materials, or leave material out")
        if frame.illumination == _library.CLSP_ILLUMINATION_DARK:
            pass  # nothing is seen
        elif not laser:
            if scene is None or isinstance(scene, Geometry):
                raise TypeError(f'frames with illumination "incoherent" need an ideal image, got {_check.kind(scene)}')
            frame.irradiance = command.add(self._ideal(command, scene))
        elif self.dots is not None:
            if scene is not None:
                raise TypeError(f"this pipeline has dots; its frames take no scene (None), got {_check.kind(scene)}")
        elif isinstance(scene, Geometry):
            if self.pattern is None:
                raise TypeError("this pipeline has no pattern; its frames need an ideal image, not a Geometry")
            geometry = geometry_struct(scene, self.shape, command, self.pattern._place)
            frame.geometry = ctypes.pointer(geometry)
        elif self.pattern is not None:
            raise TypeError(f"this pipeline has a pattern; its frames need a Geometry, got {_check.kind(scene)}")
        else:
            frame.irradiance = command.add(self._ideal(command, scene))
        default = FLOAT32 if self.sensor is None else UINT16
        frame.output = command.add(device_image(output, "output", self.shape, default, self.context))
        return frame

    def _ideal(self, command: Command, scene: Any) -> DeviceImage:
        """The device image of an ideal image."""

        def check(value: Any, name: str, shape: tuple[int, int]) -> npt.NDArray[np.float32]:
            plane = _check.light_plane(value, name, shape)
            command.staging.brightest = _check.within(plane, name)
            return plane

        return command.image(scene, self._scene_name, self.shape, check=check)

    def _enqueue_frame(self, command: Command, given: Frame, output: DeviceImageLike) -> Event:
        frame = self._frame(command, given, output)
        event = command.enqueue("clspPipelineEnqueueFrame", self._get(), frame, after=self._last)
        self._last = event
        self._next_frame_index = min(frame.frame_index + 1, 2**48 - 1)
        return event

    def set_effect(self, effect: str | Effect | Hypothesis, /, **parameters: float | None) -> None:
        """Switches an effect on, or changes its parameters; later frames have it. Blocks, and builds programs.

        Args:
            effect: the id of one of :func:`effects`, or the effect itself; or a :class:`Hypothesis` with OpenCL source,
                an effect of your own. Those at one point work one after the other, as they were first set.
            **parameters: its parameters by name; those that are left out take the middle between weak and strong.

        Sensors draw their fixed patterns again, and a phase whose state changes its layout draws all phases in the next
        frame; a state that was restored, such as a field of the caller's own, stays. After an error everything is as it
        was. The stages are changed, also for other pipelines that share them.

        Raises:
            InvalidArgumentError: no such effect, a value out of range, or the pipeline has not the stage that the
                effect belongs to (dots, a sensor); or the effect needs two polarizations, and a state that was restored
                has one.
            TypeError: the effect has no parameter of that name.
            BuildError: the source of an effect of your own does not build; the message has the compiler's log.
        """
        if isinstance(effect, Hypothesis):
            self._set_own(effect, parameters)
        else:
            found = find_effect(effect)
            self.set_effects({found.id: parameters})

    def set_effects(self, effects: Mapping[str, Mapping[str, float | None] | None]) -> None:
        """Switches several effects of the catalogue on, beside those that are on, as :meth:`set_effect` one of them.
        Blocks, and makes each stage anew once.

        Args:
            effects: parameters by name, by id: ``{"defocus": {"waves": 0.8}, "glare": {}}``.

        Raises:
            InvalidArgumentError, TypeError: as for :meth:`set_effect`. Then none of them is on that was not.
        """
        wanted = _effects(effects)
        if not wanted:
            return
        settings = (_library.ClspEffectSetting * len(wanted))()
        for setting, (found, values) in zip(settings, wanted.items(), strict=True):
            setting.id, setting.count = found.encode(), len(values)
            setting.values = (ctypes.c_double * len(values))(*values.values())
        with exclusive(self, also=self._stages):
            self._settle()
            with self._changing({**self._effects, **wanted}):
                _library.call("clspPipelineSetEffects", self._get(), len(settings), settings)

    def _set_own(self, effect: Hypothesis, parameters: Mapping[str, Any]) -> None:
        if not isinstance(effect.apply, str):
            raise TypeError(
                f"the hypothesis {effect.id!r} has a function of Python's, for which frames on the device do not wait; "
                "give it OpenCL source, or call the function on the frames"
            )
        struct, values = hypothesis_struct(effect), hypothesis_values(effect, parameters)
        numbers = (ctypes.c_double * len(values))(*values.values())
        with exclusive(self, also=self._stages):
            self._settle()
            _library.call("clspPipelineSetHypothesis", self._get(), ctypes.byref(struct), numbers, len(values))
            self._effects[effect.id] = values
            self._own.add(effect.id)
            self._judged_by = self._looked_up = None

    def set_profile(self, profile: Profile, *, maps: bool = True) -> None:
        """Switches a profile's effects on, beside those that are on. Blocks, and builds programs.

        Effects on dots are left out of a pipeline that draws none, as its frames bring their own pattern.

        Args:
            profile: the camera.
            maps: True: the profile's maps, where it has any, become the sensor's dark frame and gain map, in the place
                of the effects that they hold; they stay when effects are cleared. False: fixed patterns are drawn anew.
                Maps that an earlier call brought go.

        Raises:
            InvalidArgumentError: the pipeline is another camera: size, bits, pixel pitch or wavelength differ, or it
                has no sensor, or a dark frame or gain map of its own; or a state as for :meth:`set_effect`.
            InputOutputError, InvalidDataError: a map cannot be read or is not as it was written.
        """
        used = _check.flag(maps, "maps")
        if not isinstance(profile, Profile):
            raise TypeError(f"profile must be a clspeckle.Profile, got {_check.kind(profile)}")
        with exclusive(self, profile, also=self._stages):
            self._settle()
            held = {name for one in profile.maps.values() for name in one.holds if used}
            effects = {name: values for name, values in self._effects.items() if name not in held}
            for effect in profile.effects:
                if effect.effect in held:
                    continue
                if self.dots is not None or "stages/dots.cl" not in find_effect(effect.effect).kernel:
                    effects[effect.effect] = dict(effect.parameters)
            with self._changing(effects):
                _library.call("clspPipelineSetProfileMaps", self._get(), profile._get(), 3 * used)

    def clear_effect(self, effect: str | Effect | Hypothesis | None = None) -> None:
        """Switches an effect off, or all of them (None); one that is off stays off. Blocks.

        Args:
            effect: as for :meth:`set_effect`; one of your own is named by its :class:`Hypothesis`, or by its id.
        """
        found = effect.id if isinstance(effect, Hypothesis) else effect
        if isinstance(effect, Hypothesis) and effect.id not in self._own:
            return
        if found is not None and found not in self._own:
            found = find_effect(found).id
        with exclusive(self, also=self._stages):
            self._settle()
            left = {} if found is None else {name: v for name, v in self._effects.items() if name != found}
            with self._changing(left):
                _library.call("clspPipelineClearEffect", self._get(), None if found is None else found.encode())
            self._own &= left.keys()

    @contextlib.contextmanager
    def _changing(self, effects: dict[str, dict[str, float]]) -> Iterator[None]:
        """Around the call that makes these the effects. Then what the stages' objects remember of their descriptions,
        and how frames are judged, is changed, too."""
        yield
        self._effects = effects
        self._judged_by = self._looked_up = None
        self.phase.polarization_count = self._traits(effects).polarization_count

    def _traits(
        self,
        effects: Mapping[str, Mapping[str, float]],
        converter: _doubts.Converter | None = None,
        ambient_dn: float = 0.0,
    ) -> Any:
        """What effects make of the camera, as far as it is asked for."""
        traits = _library.initialized(_library.ClspCameraTraits)
        traits.polarization_count, traits.ambient_dn = self._polarization_count, ambient_dn
        traits.bits = traits.effective_bits = 16 if converter is None else converter.bits
        if converter is not None:
            for name in ("effective_bits", "saturation_dn", "gamma", "cubic_nonlinearity", "nonlinearity_power"):
                setattr(traits, name, getattr(converter, name))
        catalogued = {effect: list(v.values()) for effect, v in effects.items() if effect not in self._own}
        return _changed_by(traits, catalogued)

    @property
    def effects(self) -> dict[str, dict[str, float]]:
        """The effects that are on, by id, with their parameters; those of your own, too.

        :meth:`from_parameters` takes them all but those of your own, which :meth:`set_effect` alone sets: an id does
        not tell their source.
        """
        return {effect: dict(values) for effect, values in self._effects.items()}

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
        sequence: Any = scenes
        if isinstance(scenes, np.ndarray):
            if scenes.ndim not in (3, 4):
                raise errors.InvalidArgumentError(f"scenes has shape {scenes.shape}, expected (frames, height, width)")
            sequence = _check.frames_of(scenes, "scenes")
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
        pending: collections.deque[tuple[Frame, Staging, Output, Event]] = collections.deque()
        with exclusive(self):
            # Taken out while in use: two streams of one pipeline may be interleaved.
            slots = [self._spare.pop() if self._spare else Staging(self.context) for _ in range(depth)]

        def finish() -> npt.NDArray[Any]:
            frame, staging, target, read = pending.popleft()
            read.wait()
            if target.host is not target.given:
                target.given[...] = target.host
            self._doubt(frame, target.host, staging)
            result: npt.NDArray[Any] = target.given
            return result

        try:
            for index, item in enumerate(scenes):
                if len(pending) == depth:
                    yield finish()
                frame = item if isinstance(item, Frame) else Frame(item)
                with exclusive(self, also=self._stages):
                    given, command = target_of(index), Command(slots[index % depth], queue)
                    target = command.output(given, self.shape, (given.dtype,))
                    target.host = given if given.flags.c_contiguous else np.empty(given.shape, given.dtype)
                    if frame.refresh is None:
                        frame = dataclasses.replace(frame, refresh=refresh)
                    event = self._enqueue_frame(command, frame, target.image)
                    read = target.image.enqueue_read(target.host, queue=command.queue, wait_for=[event])
                    pending.append((frame, command.staging, target, read))
            while pending:
                yield finish()
        finally:
            # Left early: what was begun still writes to memory that is about to be reused.
            for *_, read in pending:
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
        motion: MotionInput | None = None,
        material: ImageLike | None = None,
        illumination: str | None = None,
        dtype: npt.DTypeLike | None = None,
        queue: QueueLike | None = None,
    ) -> None:
        """Renders a frame like the ones to come and drops it: programs and FFT plans are made, so that the next such
        frame starts without a delay. Blocks. The state of the speckle and :attr:`next_frame_index` stay as they are.

        Args:
            scene: like the scenes to come: which images it has, and in which formats, is what counts. None: a dark
                NumPy image, or with dots none; with a pattern a geometry is needed.
            refresh: like that of the frames to come; `motion` and `illumination` likewise.
            material: likewise; None: the first material everywhere.
            dtype: of the frames to come; None: the default.
            queue: None for the context's.
        """
        wanted = _dtype(dtype, self.output_dtypes)
        if scene is None and illumination == "incoherent":
            scene = np.zeros(self.shape, np.float32)
        elif scene is None and illumination != "dark" and self.dots is None:
            if self.pattern is not None:
                raise TypeError("this pipeline has a pattern; warm_up() needs a Geometry like those of its frames")
            scene = np.zeros(self.shape, np.float32)
        if material is None and self.materials is not None:
            material = np.zeros(self.shape, np.uint8)
        with exclusive(self, also=self._stages):
            self._settle()
            command = self._command(queue)
            image = self._staging.image("out", self.shape, wanted)
            frame = self._frame(command, Frame(scene, refresh, 0, motion, material, illumination), image)
            command.wait()  # the call takes no wait list
            pointer = queue_pointer(command.queue, self.context)
            _library.call("clspPipelineWarmUp", self._get(), pointer, ctypes.byref(frame))

    def check(self, *, queue: QueueLike | None = None) -> None:
        """Waits for the queue and reports bad pixels (NaN, infinite or negative) of all frames since the last check.

        NumPy images are checked before each frame anyway; this is for device images.

        Raises:
            InvalidDataError: there were some; the message says how many and where the first one was.
        """
        with exclusive(self, also=self._stages):
            self._settle()
            self._wait_and_check(queue)

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


_PIPELINE = [name for name in _check.optional(Pipeline.__init__) if name in PipelineParameters.__annotations__]


def _light_on(geometry: Geometry, pattern: Pattern, staging: Staging) -> npt.NDArray[np.float32]:
    """The ideal image of a geometry whose host images have just been copied to `staging`."""
    kept: dict[str, Any] = {
        field.name: staging.kept(field.name)
        for field in dataclasses.fields(geometry)
        if getattr(geometry, field.name) is not None
    }
    kept = {name: image for name, image in kept.items() if image is not None and not on_device(getattr(geometry, name))}
    with exclusive(pattern):
        light: npt.NDArray[np.float32] = pattern.lookup(dataclasses.replace(geometry, **kept))
        pattern._staging.clear()
    return light


def _effects(given: Any) -> dict[str, dict[str, float]]:
    """Effects by id, with all their parameters, checked."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise TypeError(
            f'effects must map ids to parameters, as {{"defocus": {{"waves": 0.8}}}}, got {_check.kind(given)}'
        )
    result = {}
    for name, values in given.items():
        effect = find_effect(name)
        if values is not None and not isinstance(values, Mapping):
            raise TypeError(f"effects[{name!r}] must map parameters to numbers, got {_check.kind(values)}")
        result[effect.id] = effect_values(effect, values or {})
    return result


def of_one_frame(parameters: PipelineParameters) -> PipelineParameters:
    """The same with one polarization where the second has no light: it would be drawn in vain. The frame's bits stay
    the same, as each polarization has numbers of its own."""
    polarized = parameters.get("degree_of_polarization") in (None, 1) and parameters.get("polarization_count") is None
    effects = parameters.get("effects") or {}
    known: dict[str, list[float]] = {effect.id: [] for effect in catalogue() if effect.id in effects}
    traits = _library.initialized(_library.ClspCameraTraits)
    traits.polarization_count = 1
    _changed_by(traits, known)
    if not polarized or traits.polarization_count > 1 or "field" in parameters:
        return parameters
    return {**parameters, "polarization_count": 1}


def _changed_by(traits: Any, effects: Mapping[str, Sequence[float]]) -> Any:
    """What effects make of a camera's traits. No values: those between weak and strong."""
    for effect, values in effects.items():
        given = (ctypes.c_double * len(values))(*values) if values else None
        _library.call("clspEffectChangeTraits", effect.encode(), given, len(values), ctypes.byref(traits))
    return traits


def _hashable(value: Any) -> Any:
    """A dictionary as something that can be part of a key."""
    if isinstance(value, Mapping):
        return tuple(sorted((name, _hashable(part)) for name, part in value.items()))
    return value


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
            counting up; with 1 to 4 channels behind or none. uint8 and uint16 are divided by their top code.
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
        An array of the shape of `ideal`, without its channels.

    Threads: may be called from any number of threads at once.
    """
    for name in ("pattern", "dots", "materials"):
        if parameters.get(name) is not None:
            raise TypeError(
                f"simulate() takes ideal images alone, without {name}; use clspeckle.Pipeline.from_parameters(shape, "
                f"{name}=...) and its render()"
            )
    _effects(parameters.get("effects"))
    context = resolve_context(context, ideal)
    shape: tuple[int, ...] = getattr(ideal, "shape", ())
    if not on_device(ideal):
        ideal = _check.frames_of(_check.array(ideal, "ideal"), "ideal")
        shape = ideal.shape[:-1] if _check.has_channels(ideal.shape) else ideal.shape
    if len(shape) not in (2, 3):
        raise errors.InvalidArgumentError(
            f"ideal has shape {tuple(shape)}, expected (height, width) or (frames, height, width)"
        )
    size = _check.image_shape(shape[-2:], "ideal.shape")
    if len(shape) == 3:
        _doubts.of_frames_behind(shape, "ideal")
    key: Any = (size, output, _hashable(parameters))
    # What has moved on would make the next result depend on this one.
    given = parameters.get("effects") or {}
    if parameters.get("airflow_rms_rad") or any(e.stage == "motion" and e.id in given for e in catalogue()):
        key = None
    try:
        hash(key)
    except TypeError:  # an array among the parameters
        key = None
    camera: Pipeline | None = None if key is None else context._take_camera(key)
    if camera is None:
        camera = Pipeline.from_parameters(size, output=output, context=context, **of_one_frame(parameters))
    elif camera.sensor is not None:
        camera.sensor.reset_lag()
    camera._scene_name = "ideal"
    # A field of the caller's own stays; else the camera may have been used before: the first frame draws it anew.
    first = None if not isinstance(parameters.get("field", ""), (str, type(None))) else "all"
    try:
        if len(shape) == 2:
            target: Any = out
            result: npt.NDArray[Any] = camera.render(
                ideal, frame_index=frame_index, refresh=first, dtype=dtype, out=target, queue=queue
            )
        else:
            scenes = [Frame(scene, first if i == 0 else refresh) for i, scene in enumerate(np.asarray(ideal))]
            result = camera.render_batch(scenes, first_frame_index=frame_index, dtype=dtype, out=out, queue=queue)
    except BaseException:
        camera.close()
        raise
    if key is None:
        camera.close()
    else:
        context._keep_camera(key, camera)
    return result
