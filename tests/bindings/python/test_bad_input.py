"""Bad input at every entry point: a clear error of the right kind, and everything still works afterwards."""

from __future__ import annotations

import contextlib
import inspect
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

import clspeckle
from binding_common import SHAPE
from clspeckle import errors

OTHER = (SHAPE[0], SHAPE[1] + 1)


@dataclass
class World:
    """Valid objects of one context, and some of another one."""

    context: clspeckle.Context
    phase: clspeckle.Phase
    aperture: clspeckle.Aperture
    sensor: clspeckle.Sensor
    pattern: clspeckle.Pattern
    camera: clspeckle.Pipeline
    projector: clspeckle.Pipeline
    ideal: Any
    image: clspeckle.DeviceImage
    codes: clspeckle.DeviceImage
    buffer: clspeckle.Buffer
    geometry: dict[str, Any]
    foreign: clspeckle.Context
    foreign_image: clspeckle.DeviceImage
    foreign_phase: clspeckle.Phase
    foreign_event: clspeckle.Event


@pytest.fixture(scope="module")
def world(context: clspeckle.Context) -> Iterator[World]:
    ideal = np.ones(SHAPE, np.float32)
    phase = clspeckle.Phase(SHAPE, context=context)
    phase.refresh(0)
    aperture = clspeckle.Aperture(SHAPE, context=context)
    sensor = clspeckle.Sensor(SHAPE, context=context)
    pattern = clspeckle.Pattern(np.ones((4, 4)), context=context)
    # Contexts of our own on one device share a cl_context; this one is another.
    foreign = clspeckle.Context.from_opencl(cl.create_some_context(interactive=False))
    foreign_image = clspeckle.DeviceImage.from_array(ideal, context=foreign)
    made = World(
        context=context,
        phase=phase,
        aperture=aperture,
        sensor=sensor,
        pattern=pattern,
        camera=clspeckle.Pipeline(phase=phase, aperture=aperture, sensor=sensor),
        projector=clspeckle.Pipeline(phase=phase, aperture=aperture, sensor=sensor, pattern=pattern),
        ideal=ideal,
        image=clspeckle.DeviceImage.from_array(ideal, context=context),
        codes=clspeckle.DeviceImage(SHAPE, np.uint16, context=context),
        buffer=clspeckle.Buffer(64, context=context),
        geometry={"depth": ideal, "intrinsics": (50, 50, 24, 16)},
        foreign=foreign,
        foreign_image=foreign_image,
        foreign_phase=clspeckle.Phase(SHAPE, context=foreign),
        foreign_event=foreign_image.enqueue_write(ideal)[0],
    )
    yield made
    foreign.close()


def spoiled(value: float) -> Any:
    image = np.ones(SHAPE, np.float32)
    image[3, 5] = value
    return image


class MaskedOut:
    masked = np.ma.masked_array(np.ones(SHAPE), np.zeros(SHAPE, bool))


# What an image of real numbers, finite and not negative, may not be: for every argument of that kind.
BAD_IMAGES: list[tuple[str, Any, type[Exception], str]] = [
    ("none", None, TypeError, "must be an array, got None"),
    ("text", "image.png", TypeError, "must be an array, got str"),
    ("objects", np.full(SHAPE, None), TypeError, "array of numbers"),
    ("ragged", [[1.0], [1.0, 2.0]], TypeError, "cannot be made an array"),
    ("masked array", MaskedOut.masked, TypeError, "masked array"),
    ("complex", np.ones(SHAPE, np.complex64), errors.InvalidFormatError, "dtype complex64, expected"),
    ("empty", np.ones((0, SHAPE[1])), errors.InvalidArgumentError, "shape"),
    ("one axis", np.ones(SHAPE[1]), errors.InvalidArgumentError, "shape"),
    ("three axes", np.ones((2, *SHAPE)), errors.InvalidArgumentError, "shape"),
    ("large integers", np.full(SHAPE, 2**24 + 1), errors.InvalidFormatError, r"exactly only up to 2\^24"),
    ("too large for float32", np.full(SHAPE, 1e39), errors.InvalidDataError, r"1536 pixels \(the first at \[0, 0\]\)"),
]
GIVEN_IMAGES = [bad for bad in BAD_IMAGES if bad[1] is not None]
SIZED: list[tuple[str, Any, type[Exception], str]] = [
    ("other size", np.ones(OTHER), errors.InvalidArgumentError, r"\(32, 49\), expected \(32, 48\)"),
    ("transposed", np.ones(SHAPE[::-1]), errors.InvalidArgumentError, r"\(48, 32\), expected \(32, 48\)"),
]
NEGATIVE: list[tuple[str, Any, type[Exception], str]] = [
    ("negative", spoiled(-1), errors.InvalidDataError, r">= 0; 1 pixel \(the first at \[3, 5\]\), value -1.0"),
]
NOT_FINITE: list[tuple[str, Any, type[Exception], str]] = [
    ("nan", spoiled(math.nan), errors.InvalidDataError, r"1 pixel \(the first at \[3, 5\]\), value nan"),
    ("infinite", spoiled(math.inf), errors.InvalidDataError, r"1 pixel \(the first at \[3, 5\]\), value inf"),
]
BAD_MASKS: list[tuple[str, Any, type[Exception], str]] = [
    ("float mask", np.ones(SHAPE), errors.InvalidFormatError, "mask of bool or integers"),
    ("mask of another size", np.ones(OTHER, bool), errors.InvalidArgumentError, r"expected \(32, 48\)"),
    ("empty mask", np.ones((0, 0), bool), errors.InvalidArgumentError, "shape"),
    ("text mask", b"mask", TypeError, "must be an array"),
    ("masked mask", MaskedOut.masked, TypeError, "masked array"),
]
BAD_OUTPUTS: list[tuple[str, Any, type[Exception], str]] = [
    ("list", [[0]], TypeError, "NumPy array or an image in device memory"),
    ("wrong dtype", np.empty(SHAPE, np.int32), errors.InvalidFormatError, "dtype int32, expected"),
    ("wrong shape", np.empty(OTHER, np.float32), errors.InvalidArgumentError, r"expected \(32, 48\)"),
    ("read-only", np.broadcast_to(np.float32(0), SHAPE), errors.InvalidArgumentError, "read-only"),
]
BAD_INTEGERS: list[tuple[str, Any, type[Exception], str]] = [
    ("none", None, TypeError, "must be an integer, got None"),
    ("float", 1.0, TypeError, "must be an integer, got float 1.0"),
    ("text", "1", TypeError, "must be an integer"),
    ("negative", -1, errors.InvalidArgumentError, "-1, expected 0 to"),
    ("too large", 2**64, errors.InvalidArgumentError, "expected 0 to 2"),
]
BAD_SHAPES: list[tuple[str, Any, type[Exception], str]] = [
    ("none", None, TypeError, "height, width"),
    ("number", 5, TypeError, "height, width"),
    ("text", "ab", TypeError, "height, width"),
    ("three", (4, 4, 4), TypeError, "height, width"),
    ("zero height", (0, 8), errors.InvalidArgumentError, "at least 1"),
    ("zero width", (8, 0), errors.InvalidArgumentError, "at least 1"),
    ("negative", (8, -1), errors.InvalidArgumentError, "-1"),
    ("float", (8.0, 8.0), TypeError, "integer"),
    ("too large", (16385, 8), errors.InvalidArgumentError, "16384"),
]
BAD_CONTEXTS: list[tuple[str, Any, type[Exception], str]] = [
    ("text", "gpu", TypeError, "clspeckle.Context"),
    ("number", 5, TypeError, "clspeckle.Context"),
]

IMAGE_ARGUMENTS: dict[str, tuple[Callable[[World, Any], Any], list[Any]]] = {
    "camera.render": (lambda w, v: w.camera.render(v), BAD_IMAGES + SIZED + NEGATIVE + NOT_FINITE),
    "camera.render_batch": (lambda w, v: w.camera.render_batch([v]), BAD_IMAGES + SIZED + NEGATIVE + NOT_FINITE),
    "camera.frames": (lambda w, v: list(w.camera.frames([v])), BAD_IMAGES + SIZED + NEGATIVE + NOT_FINITE),
    "camera.warm_up": (lambda w, v: w.camera.warm_up(v), GIVEN_IMAGES + SIZED + NEGATIVE),
    "aperture.intensity": (
        lambda w, v: w.aperture.intensity(w.phase, v),
        BAD_IMAGES + SIZED + NEGATIVE + NOT_FINITE,
    ),
    "sensor.expose": (lambda w, v: w.sensor.expose(v), BAD_IMAGES + SIZED + NEGATIVE + NOT_FINITE),
    "Pattern.texels": (lambda w, v: clspeckle.Pattern(v, context=w.context), BAD_IMAGES + NEGATIVE + NOT_FINITE),
    "Aperture.pupil_image": (
        lambda w, v: clspeckle.Aperture(SHAPE, pupil_image=v, context=w.context),
        [case for case in GIVEN_IMAGES if case[0] != "complex"]  # amplitudes may have a phase
        + NOT_FINITE
        + [
            ("above 1", spoiled(1.5), errors.InvalidDataError, "from 0 to 1"),
            ("negative", spoiled(-0.5), errors.InvalidDataError, "from 0 to 1"),
        ],
    ),
    "Sensor.dark_frame_dn": (
        lambda w, v: clspeckle.Sensor(SHAPE, dark_frame_dn=v, context=w.context),
        GIVEN_IMAGES + SIZED + NOT_FINITE,
    ),
    "Sensor.gain_map": (
        lambda w, v: clspeckle.Sensor(SHAPE, gain_map=v, context=w.context),
        GIVEN_IMAGES
        + SIZED
        + NOT_FINITE
        + NEGATIVE
        + [("mean 2", np.full(SHAPE, 2.0), errors.InvalidDataError, "0.9 to 1.1")],
    ),
    "geometry.depth": (
        lambda w, v: w.pattern.lookup(clspeckle.Geometry(depth=v, intrinsics=(1, 1, 0, 0))),
        [b for b in GIVEN_IMAGES if b[0] != "large integers"]
        + [
            ("int64", np.ones(SHAPE, np.int64), errors.InvalidFormatError, r"depth \* 0.001"),
            ("bool", np.ones(SHAPE, bool), errors.InvalidFormatError, "dtype bool, whose unit is not known"),
        ],
    ),
    "geometry.albedo": (
        lambda w, v: w.projector.render(clspeckle.Geometry(**w.geometry, albedo=v)),
        GIVEN_IMAGES + SIZED + NOT_FINITE,
    ),
    "geometry.visibility": (
        lambda w, v: w.projector.render(clspeckle.Geometry(**w.geometry, visibility=v)),
        [b for b in BAD_IMAGES if b[0] not in ("none", "large integers")]
        + SIZED
        + NOT_FINITE
        + [
            ("above 1", spoiled(1.5), errors.InvalidDataError, "from 0 to 1"),
            ("int64", 2 * np.ones(SHAPE, np.int64), errors.InvalidDataError, "from 0 to 1"),
        ],
    ),
    "geometry.position": (
        lambda w, v: w.pattern.lookup(clspeckle.Geometry(position=v)),
        [
            ("none", None, errors.InvalidArgumentError, "size of the geometry is not known"),
            ("text", "p", TypeError, "must be an array"),
            ("plane", np.ones(SHAPE), errors.InvalidArgumentError, "3 or 4"),
            ("two channels", np.ones((*SHAPE, 2)), errors.InvalidArgumentError, "3 or 4"),
            ("complex", np.ones((*SHAPE, 3), complex), errors.InvalidFormatError, "complex128"),
            ("empty", np.ones((0, 4, 3)), errors.InvalidArgumentError, "position.shape is"),
        ],
    ),
    "geometry.normal": (
        lambda w, v: w.projector.render(clspeckle.Geometry(**w.geometry, normal=v)),
        [
            ("plane", np.ones(SHAPE), errors.InvalidArgumentError, "3 or 4"),
            ("other size", np.ones((*OTHER, 3)), errors.InvalidArgumentError, r"expected \(32, 48, 3 or 4\)"),
        ],
    ),
    "statistics.moments": (
        lambda w, v: clspeckle.statistics.moments(v, context=w.context),
        BAD_IMAGES + NOT_FINITE,
    ),
    "statistics.histogram": (
        lambda w, v: clspeckle.statistics.histogram(v, 0, 1, 4, context=w.context),
        BAD_IMAGES + NOT_FINITE,
    ),
    "statistics.autocovariance": (
        lambda w, v: clspeckle.statistics.autocovariance(v, 2, context=w.context),
        BAD_IMAGES + NOT_FINITE,
    ),
    "DeviceImage.write": (
        lambda w, v: w.image.write(v),
        [
            ("none", None, TypeError, "must be an array"),
            ("wrong dtype", np.ones(SHAPE), errors.InvalidFormatError, "dtype float64, expected float32"),
            ("wrong shape", np.ones(OTHER, np.float32), errors.InvalidArgumentError, r"expected \(32, 48\)"),
        ],
    ),
    "DeviceImage.from_array": (
        lambda w, v: clspeckle.DeviceImage.from_array(v, context=w.context),
        [
            ("none", None, TypeError, "must be an array"),
            ("float64", np.ones(SHAPE), errors.InvalidFormatError, "dtype float64"),
            ("five channels", np.ones((2, 2, 5), np.float32), errors.InvalidFormatError, "2 to 4 channels"),
            ("uint8 channels", np.ones((2, 2, 3), np.uint8), errors.InvalidFormatError, "channels"),
            ("one axis", np.ones(4, np.float32), errors.InvalidFormatError, "height, width"),
            ("empty", np.ones((0, 4), np.float32), errors.InvalidArgumentError, "at least 1"),
        ],
    ),
    "simulate": (
        lambda w, v: clspeckle.simulate(v, context=w.context),
        [b for b in BAD_IMAGES if b[0] != "three axes"]
        + NEGATIVE
        + NOT_FINITE
        + [
            ("five axes", np.ones((1, 1, 2, *SHAPE)), errors.InvalidArgumentError, r"\(frames, height, width\)"),
            ("bad frame in a stack", np.stack([spoiled(1), spoiled(-1)]), errors.InvalidDataError, ">= 0"),
        ],
    ),
}

MASK_ARGUMENTS: dict[str, Callable[[World, Any], Any]] = {
    "phase.refresh": lambda w, v: w.phase.refresh(0, v),
    "camera.render": lambda w, v: w.camera.render(w.ideal, refresh=v),
    "camera.render_batch": lambda w, v: w.camera.render_batch([w.ideal], refresh=v),
    "camera.warm_up": lambda w, v: w.camera.warm_up(refresh=v),
    "statistics.moments": lambda w, v: clspeckle.statistics.moments(w.ideal, v, context=w.context),
    "statistics.histogram": lambda w, v: clspeckle.statistics.histogram(w.ideal, 0, 1, 4, v, context=w.context),
}

OUTPUT_ARGUMENTS: dict[str, Callable[[World, Any], Any]] = {
    "camera.render": lambda w, v: w.camera.render(w.ideal, out=v),
    "aperture.intensity": lambda w, v: w.aperture.intensity(w.phase, w.ideal, out=v),
    "sensor.expose": lambda w, v: w.sensor.expose(w.ideal, out=v),
    "pattern.lookup": lambda w, v: w.pattern.lookup(clspeckle.Geometry(**w.geometry), out=v),
    "philox.normal": lambda w, v: clspeckle.philox.normal(SHAPE, out=v, context=w.context),
    "DeviceImage.read": lambda w, v: w.image.read(v),
    "simulate": lambda w, v: clspeckle.simulate(w.ideal, out=v, context=w.context),
}

INTEGER_ARGUMENTS: dict[str, Callable[[World, Any], Any]] = {
    "phase.refresh": lambda w, v: w.phase.refresh(v),
    "phase.field": lambda w, v: w.phase.field(v),
    "sensor.expose frame_index": lambda w, v: w.sensor.expose(w.ideal, frame_index=v),
    "next_frame_index": lambda w, v: setattr(w.camera, "next_frame_index", v),
    "lookahead": lambda w, v: w.camera.frames([], lookahead=v),
    "philox.blocks local_size": lambda w, v: clspeckle.philox.blocks(
        [[0] * 4], (0, 0), local_size=v, context=w.context
    ),
    "philox.enqueue_blocks count": lambda w, v: clspeckle.philox.enqueue_blocks(w.buffer, (0, 0), v, w.buffer),
    "statistics.histogram bins": lambda w, v: clspeckle.statistics.histogram(w.ideal, 0, 1, v, context=w.context),
    "statistics.autocovariance": lambda w, v: clspeckle.statistics.autocovariance(w.ideal, v, context=w.context),
    "field_grid oversampling": lambda w, v: clspeckle.field_grid(SHAPE, oversampling=v),
    "field_grid guard_px": lambda w, v: clspeckle.field_grid(SHAPE, guard_px=v),
    "Buffer": lambda w, v: clspeckle.Buffer(v, context=w.context),
    "buffer.read offset": lambda w, v: w.buffer.read(4, offset_bytes=v),
    "buffer.write offset": lambda w, v: w.buffer.write(b"1234", offset_bytes=v),
    "aperture.set_workspace": lambda w, v: w.aperture.set_workspace(w.buffer, offset_bytes=v),
    "phase.enqueue_save": lambda w, v: w.phase.enqueue_save(w.buffer, offset_bytes=v),
}

SHAPE_ARGUMENTS: dict[str, Callable[[World, Any], Any]] = {
    "Phase": lambda w, v: clspeckle.Phase(v, context=w.context),
    "Aperture": lambda w, v: clspeckle.Aperture(v, context=w.context),
    "Sensor": lambda w, v: clspeckle.Sensor(v, context=w.context),
    "Pipeline.from_parameters": lambda w, v: clspeckle.Pipeline.from_parameters(v, context=w.context),
    "field_grid": lambda w, v: clspeckle.field_grid(v),
    "philox.bits": lambda w, v: clspeckle.philox.bits(v, context=w.context),
}

CONTEXT_ARGUMENTS: dict[str, Callable[[Any], Any]] = {
    "Phase": lambda v: clspeckle.Phase(SHAPE, context=v),
    "Aperture": lambda v: clspeckle.Aperture(SHAPE, context=v),
    "Sensor": lambda v: clspeckle.Sensor(SHAPE, context=v),
    "Pattern": lambda v: clspeckle.Pattern(np.ones((4, 4)), context=v),
    "Queue": lambda v: clspeckle.Queue(v),
    "Buffer": lambda v: clspeckle.Buffer(4, context=v),
    "DeviceImage": lambda v: clspeckle.DeviceImage((4, 4), context=v),
    "DeviceImage.wrap": lambda v: clspeckle.DeviceImage.wrap(1, (4, 4), np.uint8, context=v),
    "philox.blocks": lambda v: clspeckle.philox.blocks([[0] * 4], (0, 0), context=v),
    "philox.uniform": lambda v: clspeckle.philox.uniform(SHAPE, context=v),
    "statistics.moments": lambda v: clspeckle.statistics.moments(np.ones(SHAPE), context=v),
    "simulate": lambda v: clspeckle.simulate(np.ones(SHAPE), context=v),
    "Pipeline.from_parameters": lambda v: clspeckle.Pipeline.from_parameters(SHAPE, context=v),
}


def cases(arguments: dict[str, Any], values: list[Any] | None = None) -> list[Any]:
    result = []
    for name, entry in arguments.items():
        call, bad = (entry, values) if values is not None else entry
        for what, value, kind, message in bad:
            result.append(pytest.param(call, value, kind, message, id=f"{name}-{what}".replace(" ", "_")))
    return result


@pytest.mark.parametrize(("call", "value", "kind", "message"), cases(IMAGE_ARGUMENTS))
def test_images(world: World, call: Any, value: Any, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        call(world, value)


@pytest.mark.parametrize(("call", "value", "kind", "message"), cases(MASK_ARGUMENTS, BAD_MASKS))
def test_masks(world: World, call: Any, value: Any, kind: type[Exception], message: str) -> None:
    if isinstance(value, bytes) and "camera" in inspect.getsource(call):
        value = np.array(["all"])  # text is a choice there, see test_choices
        kind, message = errors.InvalidFormatError, "mask of bool or integers"
    with pytest.raises(kind, match=message):
        call(world, value)


@pytest.mark.parametrize(("call", "value", "kind", "message"), cases(OUTPUT_ARGUMENTS, BAD_OUTPUTS))
def test_outputs(world: World, call: Any, value: Any, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        call(world, value)


@pytest.mark.parametrize(("call", "value", "kind", "message"), cases(INTEGER_ARGUMENTS, BAD_INTEGERS))
def test_integers(world: World, call: Any, value: Any, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        call(world, value)


@pytest.mark.parametrize(("call", "value", "kind", "message"), cases(SHAPE_ARGUMENTS, BAD_SHAPES))
def test_shapes(world: World, call: Any, value: Any, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        call(world, value)


@pytest.mark.parametrize(
    ("call", "value", "kind", "message"),
    cases({k: (lambda w, v, f=f: f(v)) for k, f in CONTEXT_ARGUMENTS.items()}, BAD_CONTEXTS),
)
def test_contexts(world: World, call: Any, value: Any, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        call(world, value)


@pytest.mark.parametrize("name", CONTEXT_ARGUMENTS)
def test_closed_contexts(name: str) -> None:
    context = clspeckle.Context()
    context.close()
    with pytest.raises(errors.InvalidHandleError, match="this Context is closed"):
        CONTEXT_ARGUMENTS[name](context)


# --- Numbers of the stages ---

PARAMETERS: list[tuple[str, dict[str, Any], str]] = [
    ("Phase", {"oversampling": 0}, "oversampling"),
    ("Phase", {"oversampling": 9}, "oversampling"),
    ("Phase", {"guard_px": 20000}, "guard_px|grid|pixels"),
    ("Phase", {"polarization_count": 0}, "polarization_count"),
    ("Phase", {"polarization_count": 3}, "polarization_count"),
    ("Phase", {"seed": -1}, "seed"),
    ("Phase", {"seed": 2**64}, "seed"),
    ("Aperture", {"f_number": 0}, "f_number"),
    ("Aperture", {"f_number": -1}, "f_number"),
    ("Aperture", {"f_number": math.nan}, "f_number"),
    ("Aperture", {"f_number": math.inf}, "f_number|diameter"),
    ("Aperture", {"pixel_pitch_m": 0}, "pixel_pitch_m"),
    ("Aperture", {"wavelength_m": -1e-6}, "wavelength_m"),
    ("Aperture", {"relative_diameter": 0}, "relative_diameter"),
    ("Aperture", {"relative_diameter": -0.5}, "relative_diameter"),
    ("Aperture", {"relative_diameter": math.nan}, "relative_diameter"),
    ("Aperture", {"relative_diameter": 1.01}, "oversampling"),
    ("Aperture", {"relative_diameter": 1.01, "oversampling": 1}, "oversampling"),
    ("Aperture", {"f_number": 1.4}, "oversampling"),
    ("Aperture", {"soft_rim": 1.5}, "soft_rim"),
    ("Aperture", {"soft_rim": -0.1}, "soft_rim"),
    ("Aperture", {"degree_of_polarization": 1.1}, "degree_of_polarization"),
    ("Aperture", {"degree_of_polarization": math.nan}, "degree_of_polarization"),
    ("Aperture", {"oversampling": 0}, "oversampling"),
    ("Sensor", {"bits": 7}, "bits"),
    ("Sensor", {"bits": 17}, "bits"),
    ("Sensor", {"exposure_gain_dn": -1}, "exposure_gain_dn"),
    ("Sensor", {"exposure_gain_dn": math.nan}, "exposure_gain_dn"),
    ("Sensor", {"exposure_gain_dn": math.inf}, "exposure_gain_dn"),
    ("Sensor", {"saturation_dn": 0}, "saturation_dn"),
    ("Sensor", {"saturation_dn": math.nan}, "saturation_dn"),
    ("Sensor", {"black_level_dn": math.nan}, "black_level_dn"),
    ("Sensor", {"read_noise_dn": -1}, "read_noise_dn"),
    ("Sensor", {"hot_pixel_fraction": 1.5}, "hot_pixel_fraction"),
    ("Sensor", {"hot_pixel_mean_dn": -1}, "hot_pixel_mean_dn"),
    ("Sensor", {"cold_pixel_fraction": -0.5}, "cold_pixel_fraction"),
    ("Sensor", {"float_full_scale": 0}, "float_full_scale"),
]


@pytest.mark.parametrize(("stage", "arguments", "message"), PARAMETERS, ids=str)
def test_numbers_out_of_range(world: World, stage: str, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises((errors.InvalidArgumentError, errors.UnsupportedError), match=message):
        getattr(clspeckle, stage)(SHAPE, context=world.context, **arguments)
    with pytest.raises((errors.InvalidArgumentError, errors.UnsupportedError), match=message):
        clspeckle.Pipeline.from_parameters(SHAPE, context=world.context, **arguments)


@pytest.mark.parametrize(
    ("stage", "arguments"),
    [
        ("Phase", {"seed": 1.5}),
        ("Phase", {"oversampling": "2"}),
        ("Aperture", {"f_number": "f/4"}),
        ("Aperture", {"f_number": [4]}),
        ("Aperture", {"workspace_from_host": 1}),
        ("Sensor", {"read_noise_dn": object()}),
        ("Sensor", {"quantize": 1}),
        ("Sensor", {"bits": 10.0}),
        ("Sensor", {"f_number": 4}),
    ],
    ids=str,
)
def test_arguments_of_the_wrong_type(world: World, stage: str, arguments: dict[str, Any]) -> None:
    with pytest.raises(TypeError, match=next(iter(arguments))):
        getattr(clspeckle, stage)(SHAPE, context=world.context, **arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"half_extent_x": 0}, "half_extent_x"),
        ({"half_extent_y": math.nan}, "half_extent_y"),
        ({"power_scale": -1}, "power_scale"),
        ({"power_scale": math.inf}, "power_scale"),
        ({"laser_from_geometry": np.eye(3)}, r"\(3, 3\), expected \(3, 4\)"),
        ({"laser_from_geometry": 2 * np.eye(4)[:3]}, "rotation"),
        ({"laser_from_geometry": np.full((3, 4), np.nan)}, "laser_from_geometry|rotation"),
        ({"laser_from_geometry": np.ones((4, 4))}, "last row"),
        ({"laser_from_geometry": np.diag([1, 1, -1, 1])}, "rotation"),
    ],
)
def test_pattern_parameters(world: World, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(errors.InvalidArgumentError, match=message):
        clspeckle.Pattern(np.ones((4, 4)), context=world.context, **arguments)
    if "laser_from_geometry" in arguments:
        with pytest.raises(errors.InvalidArgumentError, match=message):
            world.pattern.set_pose(arguments["laser_from_geometry"])


def test_pattern_of_one_texel(world: World) -> None:
    with pytest.raises(errors.InvalidArgumentError, match="2"):
        clspeckle.Pattern([[1.0]], context=world.context)


CHOICES: dict[str, tuple[Callable[[World, Any], Any], str]] = {
    "field": (lambda w, v: clspeckle.Phase(SHAPE, field=v, context=w.context), "unit_phasor"),
    "normalization": (lambda w, v: clspeckle.Aperture(SHAPE, normalization=v, context=w.context), "unit_mean"),
    "projection": (lambda w, v: clspeckle.Pattern(np.ones((4, 4)), projection=v, context=w.context), "tangent_plane"),
    "quantity": (lambda w, v: clspeckle.Pattern(np.ones((4, 4)), quantity=v, context=w.context), "plane_irradiance"),
    "depth_kind": (lambda w, v: w.pattern.lookup(clspeckle.Geometry(**w.geometry, depth_kind=v)), "along_ray"),
    "output": (lambda w, v: clspeckle.Pipeline.from_parameters(SHAPE, output=v, context=w.context), "intensity"),
    "disk_cache": (lambda w, v: clspeckle.Context(disk_cache=v), "auto"),
    "distribution": (lambda w, v: clspeckle.philox.enqueue_fill(w.image, v), "uniform"),
}


@pytest.mark.parametrize("name", CHOICES)
def test_choices(world: World, name: str) -> None:
    call, known = CHOICES[name]
    misspelt = known[:-1] + "#"
    with pytest.raises(errors.InvalidArgumentError, match=f'{name} is .*expected .*did you mean "{known}"'):
        call(world, misspelt)
    with pytest.raises(TypeError, match=name):
        call(world, 1)


def test_refresh_is_a_mask_or_all(world: World) -> None:
    with pytest.raises(errors.InvalidArgumentError, match='expected "all"'):
        world.camera.render(world.ideal, refresh="everything")


def test_unknown_parameters_name_the_nearest(world: World) -> None:
    unknown: dict[str, Any] = {"f_numer": 4}
    with pytest.raises(TypeError, match=r'f_numer.*did you mean "f_number"'):
        clspeckle.simulate(world.ideal, context=world.context, **unknown)
    with pytest.raises(TypeError, match="read_noise_dn belongs to the sensor"):
        clspeckle.simulate(world.ideal, output="intensity", read_noise_dn=3, context=world.context)


def test_frame_index_has_48_bits(world: World) -> None:
    for call in (
        lambda: world.phase.refresh(2**48),
        lambda: world.camera.render(world.ideal, frame_index=2**48),
        lambda: world.sensor.expose(world.ideal, frame_index=2**48),
        lambda: clspeckle.philox.bits(SHAPE, frame_index=2**48, context=world.context),
    ):
        with pytest.raises(errors.InvalidArgumentError, match="frame_index"):
            call()


# --- Devices, queues, events ---


@pytest.mark.parametrize("device", [5, b"gpu", 1.5])
def test_device_choice_of_the_wrong_type(device: Any) -> None:
    with pytest.raises(TypeError, match="device must be"):
        clspeckle.Context(device)
    with pytest.raises(TypeError, match="device must be"):
        clspeckle.explain_devices(device)


def test_paths(tmp_path: Any) -> None:
    with pytest.raises(TypeError, match="kernel_dir must be a path"):
        clspeckle.Context(kernel_dir=5)  # type: ignore[arg-type]
    with pytest.raises(errors.InvalidArgumentError, match="null character"):
        clspeckle.Context(cache_dir="a\0b")
    with pytest.raises(errors.InvalidArgumentError, match="null character"):
        clspeckle.Context("a\0b")
    with pytest.raises(errors.ClspeckleError, match="nowhere"):
        clspeckle.Phase(SHAPE, context=clspeckle.Context(kernel_dir=tmp_path / "nowhere")).refresh(0)


@pytest.mark.parametrize("value", ["queue", object(), True, 1.5])
def test_queues_of_the_wrong_type(world: World, value: Any) -> None:
    with pytest.raises(TypeError, match="queue must be"):
        world.camera.render(world.ideal, queue=value)


@pytest.mark.parametrize("value", [0, -1, 2**64])
def test_handles_that_cannot_be(world: World, value: int) -> None:
    for call in (
        lambda: world.camera.render(world.ideal, queue=value),
        lambda: clspeckle.wait([value]),
        lambda: clspeckle.DeviceImage.wrap(value, SHAPE, np.float32),
        lambda: clspeckle.Context.from_opencl(value, value),
    ):
        with pytest.raises(errors.InvalidHandleError, match="no OpenCL handle"):
            call()


@pytest.mark.parametrize("value", ["event", 5.0, [None], ["x"], object()])
def test_wait_lists_of_the_wrong_type(world: World, value: Any) -> None:
    with pytest.raises(TypeError, match="wait_for"):
        world.camera.enqueue_frame(world.image, world.codes, wait_for=value)
    with pytest.raises(TypeError, match="wait_for"):
        clspeckle.wait(value)


def test_events_and_device_are_not_made_by_hand() -> None:
    with pytest.raises(TypeError, match="enqueue_"):
        clspeckle.Event()
    with pytest.raises(TypeError, match="device is needed"):
        clspeckle.Context.from_opencl(1)
    with pytest.raises(TypeError, match=r"pyopencl\.Context"):
        clspeckle.Context.from_opencl("context", 1)  # type: ignore[arg-type]


# --- Device images ---


def enqueue_calls(w: World) -> dict[str, Callable[[Any], Any]]:
    """Every enqueue method, with one of its images left open."""
    g = clspeckle.Geometry
    return {
        "camera scene": lambda v: w.camera.enqueue_frame(v, w.codes),
        "camera output": lambda v: w.camera.enqueue_frame(w.image, v),
        "camera scenes": lambda v: w.camera.enqueue_frames([w.image, v], [w.codes, w.codes]),
        "camera outputs": lambda v: w.camera.enqueue_frames([w.image, w.image], [w.codes, v]),
        "camera refresh": lambda v: w.camera.enqueue_frame(w.image, w.codes, refresh=v),
        "phase mask": lambda v: w.phase.enqueue_refresh(0, v),
        "phase field": lambda v: w.phase.enqueue_field(0, v),
        "aperture pupil": lambda v: w.aperture.enqueue_pupil(v),
        "aperture irradiance": lambda v: w.aperture.enqueue_intensity(w.phase, v, w.image),
        "aperture intensity": lambda v: w.aperture.enqueue_intensity(w.phase, w.image, v),
        "sensor intensity": lambda v: w.sensor.enqueue_expose(v, 0, w.codes),
        "sensor output": lambda v: w.sensor.enqueue_expose(w.image, 0, v),
        "pattern depth": lambda v: w.pattern.enqueue_lookup(
            g(depth=v, intrinsics=(1, 1, 0, 0), albedo=w.image), w.image
        ),
        "pattern albedo": lambda v: w.pattern.enqueue_lookup(
            g(depth=w.image, intrinsics=(1, 1, 0, 0), albedo=v),
            clspeckle.DeviceImage(SHAPE, context=w.context),
        ),
        "pattern irradiance": lambda v: w.pattern.enqueue_lookup(
            g(depth=w.image, intrinsics=(1, 1, 0, 0), albedo=w.image), v
        ),
        "philox image": lambda v: clspeckle.philox.enqueue_fill(v, context=w.context),
    }


ENQUEUE_CALLS = [
    "camera scene",
    "camera output",
    "camera scenes",
    "camera outputs",
    "camera refresh",
    "phase mask",
    "phase field",
    "aperture pupil",
    "aperture irradiance",
    "aperture intensity",
    "sensor intensity",
    "sensor output",
    "pattern depth",
    "pattern albedo",
    "pattern irradiance",
    "philox image",
]


def test_the_list_of_enqueue_calls_is_whole(world: World) -> None:
    assert list(enqueue_calls(world)) == ENQUEUE_CALLS


@pytest.mark.parametrize("name", ENQUEUE_CALLS)
def test_enqueue_takes_no_host_array(world: World, name: str) -> None:
    with pytest.raises(TypeError, match="image in device memory"):
        enqueue_calls(world)[name](np.ones(SHAPE, np.float32))


@pytest.mark.parametrize("name", ENQUEUE_CALLS)
def test_enqueue_takes_no_bare_handle(world: World, name: str) -> None:
    with pytest.raises(TypeError, match=r"DeviceImage\.wrap"):
        enqueue_calls(world)[name](world.image.int_ptr)


@pytest.mark.parametrize("name", ENQUEUE_CALLS)
def test_enqueue_refuses_a_format(world: World, name: str) -> None:
    wrong = clspeckle.DeviceImage(SHAPE, np.uint32, context=world.context)
    with pytest.raises(errors.InvalidFormatError, match="uint32"):
        enqueue_calls(world)[name](wrong)


@pytest.mark.parametrize("name", [name for name in ENQUEUE_CALLS if name != "philox image"])
def test_enqueue_refuses_a_size(world: World, name: str) -> None:
    dtype: Any = np.float32
    if name in ("camera refresh", "phase mask"):
        dtype = np.uint8
    elif name == "phase field":
        dtype = np.complex64
    with pytest.raises(errors.InvalidArgumentError, match=r"49 x 32|48 x 32"):
        enqueue_calls(world)[name](clspeckle.DeviceImage(OTHER, dtype, context=world.context))


@pytest.mark.parametrize("name", ENQUEUE_CALLS)
def test_enqueue_refuses_closed_images(world: World, name: str) -> None:
    image = clspeckle.DeviceImage(SHAPE, np.float32, context=world.context)
    image.close()
    with pytest.raises(errors.InvalidHandleError, match="closed"):
        enqueue_calls(world)[name](image)


@pytest.mark.parametrize("name", ENQUEUE_CALLS)
def test_enqueue_refuses_images_of_another_context(world: World, name: str) -> None:
    dtype: Any = np.float32
    if name in ("camera refresh", "phase mask"):
        dtype = np.uint8
    elif name == "phase field":
        dtype = np.complex64
    image = clspeckle.DeviceImage(SHAPE, dtype, context=world.foreign)
    with pytest.raises(errors.WrongContextError):
        enqueue_calls(world)[name](image)


@pytest.mark.parametrize("name", ENQUEUE_CALLS)
def test_enqueue_refuses_a_buffer_that_is_too_small(world: World, name: str) -> None:
    with pytest.raises((errors.BufferTooSmallError, TypeError), match=r"needs \d+ bytes|buffer without a shape"):
        enqueue_calls(world)[name](world.buffer)


def test_overlap(world: World) -> None:
    with pytest.raises(errors.OverlapError):
        world.camera.enqueue_frame(world.image, world.image)
    shifted = clspeckle.DeviceImage.wrap(
        clspeckle.Buffer(2 * world.ideal.nbytes, context=world.context), SHAPE, np.float32, offset_bytes=400
    )
    below = clspeckle.DeviceImage.wrap(shifted.memory, SHAPE, np.float32)
    with pytest.raises(errors.OverlapError):
        world.aperture.enqueue_intensity(world.phase, below, shifted)


def test_views_that_cannot_be(world: World) -> None:
    wrap = clspeckle.DeviceImage.wrap
    with pytest.raises(TypeError, match="shape and dtype"):
        wrap(world.buffer)
    with pytest.raises(TypeError, match="cl_mem"):
        wrap("memory", (2, 2), np.uint8)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="cl_mem"):
        wrap(None, (2, 2), np.uint8)  # type: ignore[arg-type]
    with pytest.raises(errors.BufferTooSmallError, match="pitch_bytes is 3"):
        wrap(world.buffer, (2, 4), np.uint8, pitch_bytes=3)
    with pytest.raises(errors.InvalidFormatError, match="int32"):
        wrap(world.buffer, (2, 4), np.int32)
    with pytest.raises(errors.InvalidArgumentError, match="at least 1"):
        wrap(world.buffer, (0, 4), np.uint8)
    with pytest.raises(TypeError, match="shape must be"):
        wrap(world.buffer, 4, np.uint8)  # type: ignore[arg-type]
    odd = wrap(world.buffer, (2, 2), np.float32, offset_bytes=3)
    with pytest.raises(errors.InvalidArgumentError, match="multiple"):
        clspeckle.philox.enqueue_fill(odd)
    small = wrap(world.buffer, (5, 4), np.float32)
    with pytest.raises(errors.ClspeckleError):
        small.read()
    with pytest.raises(errors.ClspeckleError):
        small.write(np.ones((5, 4), np.float32))
    with pytest.raises(errors.InvalidArgumentError, match="tightly packed"):
        world.image.enqueue_read(np.empty((SHAPE[0], 2 * SHAPE[1]), np.float32)[:, ::2])
    with pytest.raises(ValueError, match="copy"):
        world.image.__array__(copy=False)


def test_buffers(world: World) -> None:
    with pytest.raises(errors.InvalidArgumentError):
        clspeckle.Buffer(0, context=world.context)
    with pytest.raises(errors.BufferTooSmallError):
        world.buffer.read(65)
    with pytest.raises(errors.BufferTooSmallError):
        world.buffer.read(offset_bytes=64)
    with pytest.raises(errors.ClspeckleError):
        world.buffer.write(bytes(65))
    with pytest.raises(errors.ClspeckleError):
        world.buffer.write(b"")
    with pytest.raises(TypeError, match="must be an array"):
        world.buffer.write(None)
    with pytest.raises(TypeError, match="C-contiguous"):
        world.buffer.enqueue_read(np.empty((4, 4), np.uint8)[:, ::2])
    with pytest.raises(TypeError, match="C-contiguous"):
        world.buffer.enqueue_read(None)  # type: ignore[arg-type]


# --- Other contexts and closed objects ---


def test_stages_of_another_context(world: World) -> None:
    with pytest.raises(errors.WrongContextError):
        clspeckle.Pipeline(phase=world.foreign_phase, aperture=world.aperture, sensor=world.sensor)
    with pytest.raises(errors.WrongContextError):
        clspeckle.Pipeline(phase=world.phase, aperture=world.aperture, context=world.foreign)
    world.foreign_phase.refresh(0)
    with pytest.raises(errors.WrongContextError):
        world.aperture.intensity(world.foreign_phase, world.ideal)


def test_queues_and_events_of_another_context(world: World) -> None:
    with pytest.raises(errors.WrongContextError):
        world.camera.render(world.ideal, queue=world.foreign.queue)
    with pytest.raises(errors.WrongContextError):
        world.phase.enqueue_refresh(0, queue=world.foreign.queue)
    with pytest.raises(errors.WrongContextError):
        world.camera.enqueue_frame(world.image, world.codes, wait_for=[world.foreign_event])
    with pytest.raises(errors.WrongContextError):
        clspeckle.statistics.moments(world.image, context=world.foreign)


def test_stages_that_do_not_fit(world: World) -> None:
    context = world.context
    with pytest.raises(TypeError, match=r"phase must be a clspeckle\.Phase, got None"):
        clspeckle.Pipeline(phase=None, aperture=world.aperture)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"aperture must be a clspeckle\.Aperture, got Phase"):
        clspeckle.Pipeline(phase=world.phase, aperture=world.phase)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="sensor must be"):
        clspeckle.Pipeline(phase=world.phase, aperture=world.aperture, sensor=5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"phase must be a clspeckle\.Phase"):
        world.aperture.intensity(None, world.ideal)  # type: ignore[arg-type]
    with pytest.raises(errors.InvalidArgumentError, match="x"):
        clspeckle.Pipeline(phase=clspeckle.Phase(OTHER, context=context), aperture=world.aperture)
    with pytest.raises(errors.InvalidArgumentError, match="x"):
        clspeckle.Pipeline(phase=world.phase, aperture=world.aperture, sensor=clspeckle.Sensor(OTHER, context=context))
    with pytest.raises(errors.InvalidArgumentError):
        clspeckle.Pipeline(phase=clspeckle.Phase(SHAPE, oversampling=2, context=context), aperture=world.aperture)
    one = clspeckle.Phase(SHAPE, polarization_count=1, context=context)
    both = clspeckle.Aperture(SHAPE, degree_of_polarization=0.5, context=context)
    with pytest.raises(errors.InvalidArgumentError, match="polarization"):
        clspeckle.Pipeline(phase=one, aperture=both)
    one.refresh(0)
    with pytest.raises(errors.InvalidArgumentError, match="polarization"):
        one.field(1)


def test_scenes_of_the_wrong_kind(world: World) -> None:
    with pytest.raises(TypeError, match="has a pattern"):
        world.projector.render(world.ideal)
    with pytest.raises(TypeError, match="has no pattern"):
        world.camera.render(clspeckle.Geometry(**world.geometry))
    with pytest.raises(TypeError, match="needs a Geometry"):
        world.projector.warm_up()
    with pytest.raises(TypeError, match=r"clspeckle\.Geometry"):
        world.pattern.lookup(world.ideal)
    with pytest.raises(TypeError, match="scenes must be"):
        world.camera.render_batch(iter([world.ideal]))  # type: ignore[arg-type]
    with pytest.raises(errors.InvalidArgumentError, match=r"expected \(frames, height, width\)"):
        world.camera.render_batch(world.ideal)
    with pytest.raises(errors.InvalidArgumentError, match=r"expected \(1, 32, 48\)"):
        world.camera.render_batch([world.ideal], out=np.empty((2, *SHAPE), np.uint16))
    with pytest.raises(errors.InvalidFormatError, match="int16"):
        world.camera.render(world.ideal, dtype=np.int16)
    with pytest.raises(errors.InvalidFormatError, match="int16"):
        world.camera.warm_up(dtype=np.int16)


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ({}, "size of the geometry"),
        ({"depth": np.ones(SHAPE)}, "needs intrinsics"),
        ({"depth": np.ones(SHAPE), "position": np.ones((*SHAPE, 3)), "intrinsics": (1, 1, 0, 0)}, "both given"),
        ({"albedo": np.ones(SHAPE)}, "neither given"),
        ({"depth": np.ones(SHAPE), "intrinsics": (1, 1, 0)}, r"\(3,\), expected \(4,\)"),
        ({"depth": np.ones(SHAPE), "intrinsics": (0, 1, 0, 0)}, "fx and fy not 0"),
        ({"depth": np.ones(SHAPE), "intrinsics": (1, math.nan, 0, 0)}, "finite"),
        ({"depth": np.ones(SHAPE), "intrinsics": np.ones((3, 3))}, "no skew"),
        ({"position": np.ones((*SHAPE, 3)), "albedo": np.ones(OTHER)}, r"expected \(32, 48\)"),
    ],
    ids=str,
)
def test_geometries(world: World, geometry: dict[str, Any], message: str) -> None:
    with pytest.raises(errors.InvalidArgumentError, match=message):
        world.pattern.lookup(clspeckle.Geometry(**geometry))


def test_states(world: World) -> None:
    phase = clspeckle.Phase(SHAPE, context=world.context)
    with pytest.raises(errors.InvalidStateError):
        phase.field()
    with pytest.raises(errors.InvalidStateError):
        phase.save()
    state = world.phase.save()
    with pytest.raises(errors.InvalidArgumentError, match="expected"):
        phase.restore(state[:-1])
    with pytest.raises(errors.InvalidArgumentError, match="expected"):
        phase.restore(b"")
    with pytest.raises(errors.InvalidFormatError, match="flat uint8"):
        phase.restore(state.astype(np.float32))
    with pytest.raises(TypeError, match="must be an array"):
        phase.restore(None)  # type: ignore[arg-type]
    with pytest.raises(errors.BufferTooSmallError):
        world.phase.enqueue_save(world.buffer)
    with pytest.raises(errors.BufferTooSmallError):
        world.phase.enqueue_restore(world.buffer)
    with pytest.raises(TypeError, match="memory must be"):
        world.phase.enqueue_save(state)  # type: ignore[arg-type]


def test_workspaces(world: World) -> None:
    guest = clspeckle.Aperture(SHAPE, workspace_from_host=True, context=world.context)
    with pytest.raises(errors.BufferTooSmallError):
        guest.set_workspace(world.buffer)
    with pytest.raises(TypeError, match="size_bytes is needed"):
        guest.set_workspace(world.buffer.int_ptr)
    large = clspeckle.Buffer(guest.info().workspace_bytes + 8192, context=world.context)
    with pytest.raises(errors.InvalidArgumentError, match="4096"):
        guest.set_workspace(large, offset_bytes=8)
    foreign = clspeckle.Buffer(guest.info().workspace_bytes, context=world.foreign)
    with pytest.raises(errors.WrongContextError):
        guest.set_workspace(foreign)


def test_philox(world: World) -> None:
    blocks = clspeckle.philox.blocks
    for counters in ([[0, 0, 0]], [0, 0, 0, 0], np.zeros((0, 4), int)):
        with pytest.raises(errors.InvalidArgumentError, match=r"expected \(n, 4\)"):
            blocks(counters, (0, 0), context=world.context)
    with pytest.raises(errors.InvalidFormatError, match="expected uint32"):
        blocks(np.zeros((1, 4)), (0, 0), context=world.context)
    with pytest.raises(errors.InvalidDataError, match="2\\^32"):
        blocks([[0, 0, 0, -1]], (0, 0), context=world.context)
    with pytest.raises(errors.InvalidDataError, match="key"):
        blocks([[0] * 4], (0, 2**32), context=world.context)
    with pytest.raises(errors.InvalidArgumentError, match=r"key has shape \(3,\)"):
        blocks([[0] * 4], (0, 0, 0), context=world.context)
    with pytest.raises(TypeError, match="key"):
        blocks([[0] * 4], None, context=world.context)  # type: ignore[arg-type]
    with pytest.raises(errors.BufferTooSmallError):
        clspeckle.philox.enqueue_blocks(world.buffer, (0, 0), 5, world.buffer)
    with pytest.raises(errors.InvalidArgumentError):
        clspeckle.philox.bits(SHAPE, stream=0x7FFF, context=world.context)
    with pytest.raises(errors.InvalidArgumentError):
        clspeckle.philox.bits(SHAPE, stream=0x10000, context=world.context)


def test_statistics(world: World) -> None:
    statistics = clspeckle.statistics
    with pytest.raises(errors.InvalidArgumentError):
        statistics.moments(world.ideal, np.zeros(SHAPE, bool), context=world.context)
    for low, high in ((1, 0), (0, 0), (math.nan, 1), (0, math.inf)):
        with pytest.raises(errors.InvalidArgumentError):
            statistics.histogram(world.ideal, low, high, 4, context=world.context)
    with pytest.raises(errors.InvalidArgumentError, match="bins is 0"):
        statistics.histogram(world.ideal, 0, 1, 0, context=world.context)
    with pytest.raises(errors.InvalidArgumentError, match="32"):
        statistics.autocovariance(world.ideal, 32, context=world.context)
    bad = clspeckle.DeviceImage.from_array(spoiled(math.nan), context=world.context)
    with pytest.raises(errors.InvalidDataError):
        statistics.moments(bad)
    with pytest.raises(TypeError, match="buffer without a shape"):
        statistics.moments(world.buffer)


CLOSED: dict[str, Callable[[World], tuple[Any, list[Callable[[Any], Any]]]]] = {
    "Phase": lambda w: (
        clspeckle.Phase(SHAPE, context=w.context),
        [
            lambda x: x.refresh(0),
            lambda x: x.enqueue_refresh(0),
            lambda x: x.field(),
            lambda x: x.save(),
            lambda x: x.restore(b"1"),
            lambda x: x.state_size,
            lambda x: x.handle,
            lambda x: w.aperture.intensity(x, w.ideal),
            lambda x: clspeckle.Pipeline(phase=x, aperture=w.aperture),
        ],
    ),
    "Aperture": lambda w: (
        clspeckle.Aperture(SHAPE, context=w.context),
        [
            lambda x: x.info(),
            lambda x: x.pupil(),
            lambda x: x.intensity(w.phase, w.ideal),
            lambda x: x.set_workspace(w.buffer),
            lambda x: clspeckle.Pipeline(phase=w.phase, aperture=x),
        ],
    ),
    "Sensor": lambda w: (
        clspeckle.Sensor(SHAPE, context=w.context),
        [
            lambda x: x.expose(w.ideal),
            lambda x: x.enqueue_expose(w.image, 0, w.codes),
            lambda x: setattr(x, "exposure_gain_dn", 1.0),
            lambda x: clspeckle.Pipeline(phase=w.phase, aperture=w.aperture, sensor=x),
        ],
    ),
    "Pattern": lambda w: (
        clspeckle.Pattern(np.ones((4, 4)), context=w.context),
        [
            lambda x: x.lookup(clspeckle.Geometry(**w.geometry)),
            lambda x: x.set_pose(np.eye(4)),
            lambda x: clspeckle.Pipeline(phase=w.phase, aperture=w.aperture, pattern=x),
        ],
    ),
    "Pipeline": lambda w: (
        clspeckle.Pipeline(phase=w.phase, aperture=w.aperture, sensor=w.sensor),
        [
            lambda x: x.render(w.ideal),
            lambda x: x.render_batch([w.ideal]),
            lambda x: list(x.frames([w.ideal])),
            lambda x: x.enqueue_frame(w.image, w.codes),
            lambda x: x.warm_up(),
            lambda x: x.check(),
            lambda x: x.timings(),
        ],
    ),
    "Queue": lambda w: (
        clspeckle.Queue(w.context),
        [lambda x: x.finish(), lambda x: x.int_ptr, lambda x: w.camera.render(w.ideal, queue=x)],
    ),
    "Buffer": lambda w: (
        clspeckle.Buffer(16, context=w.context),
        [
            lambda x: x.read(),
            lambda x: x.write(b"1"),
            lambda x: x.enqueue_write(b"1"),
            lambda x: x.enqueue_read(np.empty(1)),
            lambda x: x.int_ptr,
            lambda x: clspeckle.DeviceImage.wrap(x, (2, 2), np.float32),
            lambda x: w.phase.enqueue_save(x),
        ],
    ),
    "Context": lambda w: (clspeckle.Context(), [lambda x: x.info(), lambda x: x.queue]),
}


@pytest.mark.parametrize("name", CLOSED)
def test_closed_objects_say_so(world: World, name: str) -> None:
    thing, calls = CLOSED[name](world)
    assert not thing.closed
    with thing as same:
        assert same is thing
    assert thing.closed
    thing.close()
    assert repr(thing).endswith("closed>")
    for call in calls:
        with pytest.raises(errors.InvalidHandleError, match=f"this {name} is closed"):
            call(thing)
    with pytest.raises(errors.InvalidHandleError), thing:
        pass


def test_after_all_that_the_world_still_works(world: World) -> None:
    with contextlib.suppress(errors.InvalidDataError):
        world.camera.check()  # some calls above rendered memory of undefined content
    expected = clspeckle.Pipeline.from_parameters(SHAPE, context=world.context)
    expected.render(world.ideal, frame_index=4)
    world.camera.render(world.ideal, frame_index=4, refresh="all")
    np.testing.assert_array_equal(
        world.camera.render(world.ideal, frame_index=5), expected.render(world.ideal, frame_index=5)
    )
    world.camera.check()


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_colors_are_no_frames(world: World, channels: int) -> None:
    """As Pillow and OpenCV read them: where colors differ their mean is taken, as the program does."""
    image = np.ones((*SHAPE, channels), np.float32)
    for told in (clspeckle.simulate(image, context=world.context), world.camera.render(image)):
        assert told.shape == SHAPE
    if channels > 2:
        image[..., 1] = 0.25
        with pytest.warns(UserWarning, match=r"their mean is taken .*; ideal\[\.\.\., 0\] is one of them$"):
            mean = clspeckle.simulate(image, context=world.context)
        assert np.array_equal(mean, clspeckle.simulate(image[..., :3].mean(axis=-1), context=world.context))
        assert np.array_equal(
            clspeckle.simulate(image[..., 0], context=world.context),
            clspeckle.simulate(np.ones(SHAPE), context=world.context),
        )
