# mypy: disable-error-code="func-returns-value"
"""Messages of the library that say what to do: each is provoked, and followed.

tests/house/advice.txt names the fragments; tests/house/test_advice.py keeps it complete."""

from __future__ import annotations

import ctypes
import math
import pickle
import re
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
import pyopencl.array as cl_array
import pytest

import clspeckle
from binding_common import ROOT, SHAPE, Runner
from clspeckle import _interop, _library
from clspeckle._handle import create

# What is said, what is done, what is done instead.
Case = tuple[str, Callable[[], Any], Callable[[], Any]]
ONES = np.ones(SHAPE, np.float32)


def follow(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    with pytest.raises(Exception, match=re.escape(says)):
        bad()
    good()


def named(cases: list[Case]) -> list[Any]:
    return [pytest.param(*case, id=case[0][:50].replace(" ", "_")) for case in cases]


# --- Elements and layouts of dots ---


def element(size: int = 16, **given: Any) -> clspeckle.DoeElement:
    phase = np.zeros((size, size), np.float32)
    phase[:, ::2] = math.pi
    return clspeckle.DoeElement(phase, **{"pixel_pitch_m": 0.5e-6, **given})


def beam(width_m: float) -> clspeckle.Beam:
    return clspeckle.Beam(kind="flat_circle", width_m=width_m)


def pattern(made: clspeckle.DoeElement | None = None, **given: Any) -> Any:
    image = {"image_shape": (64, 64), "beam": beam(100e-6)}
    return clspeckle.DoePattern(made or element(), **{**image, **given})


def design(orders: Any = ((1, 0), (0, 1)), weights: Any = None, **given: Any) -> Any:
    return clspeckle.design_doe(orders, weights, **{"shape": (16, 16), "iterations": 2, **given})


def layout(count: int = 100, **given: Any) -> Any:
    return clspeckle.dot_layout(count, **{"shape": (192, 192), **given})


def snapped(directions: Any, **given: Any) -> Any:
    return clspeckle.snap_directions(directions, **{"shape": (64, 64), **given})


STEPS = np.tile(np.array([0, 1, 2, 3], np.float32), (4, 1))
WIDE = beam(2e-3)

ELEMENTS: list[Case] = [
    (
        "give the levels that the design has, or 0 for a continuous one",
        lambda: clspeckle.evaluate_doe(STEPS, [(1, 0), (-1, 0)], levels=2),
        lambda: clspeckle.evaluate_doe(STEPS, [(1, 0), (-1, 0)], levels=0),
    ),
    (
        "so it has no orders; use APERTURE or AUTO",
        lambda: pattern(element(256, periodic=False), evaluation="orders"),
        lambda: [pattern(element(256, periodic=False), evaluation=word) for word in ("aperture", "auto")],
    ),
    (
        "check doe_width_m, doe_height_m and pixel_pitch_m",
        lambda: pattern(doe_size_m=(1e-6, 1e-6)),
        lambda: pattern(doe_size_m=(1e-3, 1e-3)),
    ),
    (
        "correct design_levels, or set it to 0",
        lambda: pattern(clspeckle.DoeElement(STEPS, 0.5e-6, levels=2)),
        lambda: pattern(clspeckle.DoeElement(STEPS, 0.5e-6, levels=0)),
    ),
    (
        "at most 8192 along a side are taken; lower feature_samples",
        lambda: pattern(
            element(1024), beam=beam(5e-3), defects=clspeckle.DoeDefects(rounding_sigma_m=1e-7, feature_samples=16)
        ),
        lambda: pattern(defects=clspeckle.DoeDefects(rounding_sigma_m=1e-7, feature_samples=2)),
    ),
    (
        "the next one that has none is 18. Use that, or evaluation APERTURE",
        lambda: pattern(element(17), evaluation="orders"),
        lambda: [pattern(element(18), evaluation="orders"), pattern(element(17), evaluation="aperture")],
    ),
    (
        "Use evaluation ORDERS, a smaller beam or fewer feature_samples",
        lambda: pattern(beam=beam(20e-3), evaluation="aperture"),
        lambda: [pattern(beam=WIDE, evaluation="orders"), pattern(evaluation="aperture")],
    ),
    (
        "lower feature_samples or the image's size, or take a smaller design",
        lambda: pattern(max_memory_bytes=20_000),
        lambda: pattern(element(8), image_shape=(8, 8), max_memory_bytes=20_000, evaluation="orders"),
    ),
    ("leave out orders that are not wanted", lambda: design(weights=(1, 0)), lambda: design([(1, 0)])),
    (
        "take smaller pixels or a smaller field of view",
        lambda: design([(9, 0)]),
        lambda: design([(9, 0)], shape=(32, 32)),
    ),
    (
        "add their weights, or take a larger cell",
        lambda: design([(1, 0), (1, 0)]),
        lambda: [design([(1, 0)], (2,)), design([(2, 0), (3, 0)], shape=(32, 32))],
    ),
    (
        "widen the beam or take a smaller cell",
        lambda: design(beam_diameter_m=5e-6),
        lambda: [design(beam_diameter_m=50e-6), design(shape=(4, 4), beam_diameter_m=5e-6)],
    ),
    (
        "widen the beam or the spacing",
        lambda: design([(1, 0), (2, 0)], beam_diameter_m=7e-6),
        lambda: [design([(1, 0), (2, 0)], beam_diameter_m=70e-6), design([(-4, 0), (4, 0)], beam_diameter_m=7e-6)],
    ),
    (
        "give them the same weight, or take more levels",
        lambda: design([(1, 0), (-1, 0)], (1, 2), levels=2),
        lambda: [design([(1, 0), (-1, 0)], (1, 1), levels=2), design([(1, 0), (-1, 0)], (1, 2), levels=4)],
    ),
    (
        "set levels to 2 or more, or search_sweeps to 0",
        lambda: design(levels=0, search_sweeps=1),
        lambda: [design(levels=4, search_sweeps=1), design(levels=0, search_sweeps=0)],
    ),
    (
        "list the mirrored orders if you want them",
        lambda: design(levels=4, mirror_orders=True),
        lambda: design([(1, 0), (-1, 0), (0, 1), (0, -1)], levels=4),
    ),
    (
        "they reach direction cosines of 0.5875; take smaller pixels",
        lambda: snapped([(0.8, 0)], pixel_pitch_m=0.8e-6),
        lambda: snapped([(0.8, 0)], pixel_pitch_m=0.4e-6),
    ),
    (
        "take a cell of more pixels",
        lambda: snapped([(0.1, 0), (0.101, 0)]),
        lambda: snapped([(0.1, 0), (0.101, 0)], shape=(8192, 8192)),
    ),
    (
        "take a narrower beam or a larger DOE",
        lambda: pattern(beam=WIDE, doe_size_m=(1e-3, 1e-3)),
        lambda: [pattern(doe_size_m=(1e-3, 1e-3)), pattern(beam=WIDE, doe_size_m=(4e-3, 4e-3))],
    ),
    (
        "which evaluation APERTURE, a coherent transform, cannot show; use evaluation ORDERS",
        lambda: pattern(beam=clspeckle.Beam(m_squared=2), evaluation="aperture"),
        lambda: pattern(beam=clspeckle.Beam(m_squared=2), evaluation="orders"),
    ),
    (
        "take a smaller cell, a smaller extent, or evaluation APERTURE",
        lambda: pattern(element(512, pixel_pitch_m=500e-6), beam=beam(1.6), evaluation="orders", half_extent=1.0),
        lambda: [
            pattern(element(512, pixel_pitch_m=500e-6), beam=beam(1.6), evaluation="orders", half_extent=0.01),
            pattern(evaluation="orders", half_extent=1.0),
            pattern(evaluation="aperture", half_extent=1.0),
        ],
    ),
    (
        "take a wider beam, a smaller cell, or evaluation APERTURE",
        lambda: pattern(element(256), evaluation="orders"),
        lambda: [
            pattern(element(256), evaluation="orders", beam=WIDE),
            pattern(element(16), evaluation="orders"),
            pattern(element(256), evaluation="aperture"),
        ],
    ),
    (
        "lie beyond 90 degrees; take smaller angles",
        lambda: layout(half_angle_x_rad=0.9, half_angle_y_rad=0.9),
        lambda: layout(half_angle_x_rad=0.5, half_angle_y_rad=0.5),
    ),
    (
        "take smaller pixels or angles",
        lambda: layout(pixel_pitch_m=2e-6),
        lambda: [
            layout(pixel_pitch_m=0.4e-6),
            layout(20, pixel_pitch_m=2e-6, half_angle_x_rad=0.2, half_angle_y_rad=0.2),
        ],
    ),
    (
        "orders within the field of view; take a cell of more pixels",
        lambda: layout(50_000),
        lambda: layout(3000, shape=(512, 512)),
    ),
    (
        "widen the beam or the distance",
        lambda: layout(min_distance=0.005, beam_diameter_m=100e-6),
        lambda: [
            layout(min_distance=0.005, beam_diameter_m=1e-3),
            layout(20, min_distance=0.02, beam_diameter_m=100e-6),
        ],
    ),
    (
        "widen the beam or the field of view",
        lambda: layout(2000, shape=(512, 512), beam_diameter_m=30e-6),
        lambda: layout(2000, shape=(512, 512), beam_diameter_m=3e-3),
    ),
    (
        "take a smaller radius, some three times the dots' spacing",
        lambda: layout(8000, lattice=False, neighborhood_radius=2.0),
        lambda: layout(2000, lattice=False, neighborhood_radius=0.05),
    ),
]


@pytest.mark.parametrize(("says", "bad", "good"), named(ELEMENTS))
def test_elements(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    follow(says, bad, good)


@pytest.mark.parametrize("given", [{}, {"lattice": False}, {"point_symmetric": True}, {"half_angle_x_rad": 0.2}])
def test_a_distance_that_is_possible(given: dict[str, Any]) -> None:
    with pytest.raises(clspeckle.errors.InvalidArgumentError) as refused:
        layout(400, min_distance=0.1, **given)
    said = re.search(r"take ([\d.e-]+), which is possible here, or 0 to have it chosen", str(refused.value))
    assert said
    for distance in (float(said[1]), 0.0):
        assert len(layout(400, min_distance=distance, **given).directions) == 400


# --- The sensor ---


def sensor(**given: Any) -> clspeckle.Sensor:
    return clspeckle.Sensor(SHAPE, **given)


SENSORS: list[Case] = [
    (
        "shot_noise needs to know what an electron is: set conversion_gain_dn_per_e",
        lambda: sensor(shot_noise=True),
        lambda: sensor(shot_noise=True, conversion_gain_dn_per_e=0.5),
    ),
    (
        "dark_current_e_per_s needs to know what an electron is: set conversion_gain_dn_per_e",
        lambda: sensor(dark_current_e_per_s=5, exposure_time_s=0.01),
        lambda: sensor(dark_current_e_per_s=5, exposure_time_s=0.01, conversion_gain_dn_per_e=0.5),
    ),
    (
        "fills the well of saturation_dn = 500; lower dark_current_e_per_s, temperature_c or exposure_time_s",
        lambda: sensor(dark_current_e_per_s=1e4, exposure_time_s=1, conversion_gain_dn_per_e=1, saturation_dn=500),
        lambda: [
            sensor(dark_current_e_per_s=1e2, exposure_time_s=1, conversion_gain_dn_per_e=1, saturation_dn=500),
            sensor(dark_current_e_per_s=1e4, exposure_time_s=0.01, conversion_gain_dn_per_e=1, saturation_dn=500),
            sensor(
                dark_current_e_per_s=1e4,
                exposure_time_s=1,
                conversion_gain_dn_per_e=1,
                saturation_dn=500,
                temperature_c=-60,
            ),
        ],
    ),
    (
        "give a dark signal of",
        lambda: sensor(dark_current_e_per_s=1e30, exposure_time_s=1e30, conversion_gain_dn_per_e=1, temperature_c=100),
        lambda: sensor(dark_current_e_per_s=10, exposure_time_s=0.1, conversion_gain_dn_per_e=1, temperature_c=40),
    ),
    (
        "divide it by its mean, and multiply exposure_gain_dn by that",
        lambda: sensor(gain_map=2 * ONES),
        lambda: sensor(gain_map=2 * ONES / 2, exposure_gain_dn=200),
    ),
    (
        "output.format is uint8, but the sensor has 10 bits; use uint16",
        lambda: sensor(bits=10).expose(ONES, out=clspeckle.DeviceImage(SHAPE, np.uint8)),
        lambda: sensor(bits=10).expose(ONES, out=clspeckle.DeviceImage(SHAPE, np.uint16)),
    ),
    (
        "photons_per_unit needs to know what an electron is: set conversion_gain_dn_per_e",
        lambda: sensor(photons_per_unit=100),
        lambda: sensor(photons_per_unit=100, conversion_gain_dn_per_e=0.5),
    ),
    (
        "quantum_efficiency and conversion_gain_dn_per_e make it 25; give the one or the other",
        lambda: sensor(photons_per_unit=100, conversion_gain_dn_per_e=0.5, quantum_efficiency=0.5, exposure_gain_dn=7),
        lambda: [
            sensor(photons_per_unit=100, conversion_gain_dn_per_e=0.5, quantum_efficiency=0.5),
            sensor(exposure_gain_dn=7),
        ],
    ),
    (
        "full_well_e needs to know what an electron is: set conversion_gain_dn_per_e",
        lambda: sensor(full_well_e=1000),
        lambda: sensor(full_well_e=1000, conversion_gain_dn_per_e=0.5),
    ),
    (
        "full_well_e and conversion_gain_dn_per_e make it 500; give the one or the other",
        lambda: sensor(full_well_e=1000, conversion_gain_dn_per_e=0.5, saturation_dn=7),
        lambda: [sensor(full_well_e=1000, conversion_gain_dn_per_e=0.5), sensor(saturation_dn=7)],
    ),
]


@pytest.mark.parametrize(("says", "bad", "good"), named(SENSORS))
def test_sensors(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    follow(says, bad, good)


def test_an_output_of_its_own() -> None:
    made = sensor(crosstalk_fraction=0.1)
    light, codes = clspeckle.DeviceImage.from_array(ONES), clspeckle.DeviceImage(SHAPE, np.float32)
    follow(
        "each pixel also reads its neighbours: give an output of its own",
        lambda: made.enqueue_expose(light, 0, light).wait(),
        lambda: made.enqueue_expose(light, 0, codes).wait(),
    )


def raw(name: str, struct: Any, **members: Any) -> None:
    """A stage by the C interface, which takes what this binding does not let through."""
    desc = _library.initialized(struct)
    for member, value in {"width": SHAPE[1], "height": SHAPE[0], **members}.items():
        setattr(desc, member, value)
    pointer = create(name, clspeckle.default_context()._get(), ctypes.byref(desc))
    _library.release(name.replace("Create", "Release"), pointer or 0)


# --- Light: surface, aperture, lens, dots ---


def phase(refreshed: bool = True, **given: Any) -> clspeckle.Phase:
    made = clspeckle.Phase(SHAPE, **given)
    if refreshed:
        made.refresh(0)
    return made


def aperture(**given: Any) -> clspeckle.Aperture:
    return clspeckle.Aperture(SHAPE, **given)


def lens(**given: Any) -> clspeckle.Lens:
    return clspeckle.Lens(SHAPE, **given)


def overlapping() -> tuple[clspeckle.DeviceImage, clspeckle.DeviceImage]:
    buffer = clspeckle.Buffer(2 * ONES.nbytes)
    return tuple(
        clspeckle.DeviceImage.wrap(buffer, SHAPE, np.float32, offset_bytes=offset) for offset in (0, ONES.nbytes // 2)
    )  # type: ignore[return-value]


def workspace(made: clspeckle.Aperture) -> clspeckle.Buffer:
    return clspeckle.Buffer(made.info().workspace_bytes)


def given_workspace() -> clspeckle.Aperture:
    made = aperture(workspace_from_host=True)
    made.set_workspace(workspace(made))
    return made


LIGHT: list[Case] = [
    (
        "the phase holds no values yet; refresh it or restore a state first",
        lambda: phase(refreshed=False).field(),
        lambda: [phase().field(), phase(refreshed=False).restore(phase().save())],
    ),
    (
        "make it with dynamics continuous, or give a mask (a motion with the rule replace makes one)",
        lambda: phase().advance(1, path=0.5),
        lambda: [phase(dynamics="continuous").advance(1, path=0.5), phase().advance(1, mask=ONES > 0)],
    ),
    (
        "make it with a circular Gaussian field, or give a mask",
        lambda: phase(field="unit_phasor").advance(1, correlation=0.5),
        lambda: [
            phase(dynamics="continuous").advance(1, correlation=0.5),
            phase(field="unit_phasor").advance(1, mask=ONES > 0),
        ],
    ),
    (
        "make it with translate = 1, or give no shift",
        lambda: phase(dynamics="continuous").advance(1, path=0.5, shift=np.zeros((*SHAPE, 2), np.float32)),
        lambda: phase(dynamics="continuous", translate=True).advance(
            1, path=0.5, shift=np.zeros((*SHAPE, 2), np.float32)
        ),
    ),
    (
        "set oversampling to",
        lambda: aperture(relative_diameter=1.8),
        lambda: aperture(relative_diameter=1.8, oversampling=2),
    ),
    (
        "use a larger f_number, or a smaller pixel pitch",
        lambda: aperture(f_number=0.1, pixel_pitch_m=2.9e-6),
        lambda: [aperture(f_number=8, pixel_pitch_m=2.9e-6), aperture(f_number=0.7, pixel_pitch_m=0.5e-6)],
    ),
    (
        "create it with workspace_from_host = 1 to give it yours",
        lambda: aperture().set_workspace(workspace(aperture())),
        given_workspace,
    ),
    (
        "the aperture was created with workspace_from_host = 1; give it work memory first",
        lambda: aperture(workspace_from_host=True).intensity(phase(), ONES),
        lambda: given_workspace().intensity(phase(), ONES),
    ),
    (
        "irradiance and intensity overlap without being the same image; use one image for both, or two apart",
        lambda: aperture().enqueue_intensity(phase(), *overlapping()),
        lambda: [
            aperture().enqueue_intensity(phase(), overlapping()[0], overlapping()[1]).wait(),
            aperture().enqueue_intensity(phase(), *[overlapping()[0]] * 2).wait(),
        ],
    ),
    (
        "use a smaller obstruction_ratio, a larger image or a larger guard_px",
        lambda: aperture(pupil="ring", obstruction_ratio=0.99, relative_diameter=0.05),
        lambda: [aperture(pupil="ring", obstruction_ratio=0.5, relative_diameter=0.2)],
    ),
    (
        "use fewer waves, a larger guard_px or a larger image",
        lambda: aperture(defocus_waves=30),
        lambda: [
            aperture(defocus_waves=0.5),
            aperture(defocus_waves=3, guard_px=64),
            clspeckle.Aperture((512, 512), defocus_waves=3),
        ],
    ),
    (
        "use a smaller image or less oversampling",
        lambda: clspeckle.Phase((16384, 16384), oversampling=8),
        lambda: [clspeckle.Phase((64, 64), oversampling=8), clspeckle.field_grid((1024, 1024), oversampling=1)],
    ),
    (
        "use smaller k1, k2, k3, p1, p2, or check their radius_unit",
        lambda: lens(k1=-5),
        lambda: [lens(k1=-0.1), lens(k1=-5, radius_unit="focal_length", focal_length_px=(900, 900))],
    ),
    (
        "has no values between its own; use nearest",
        lambda: lens(k1=0.1).distort(np.zeros(SHAPE, np.uint8), interpolation="linear"),
        lambda: lens(k1=0.1).distort(np.zeros(SHAPE, np.uint8), interpolation="nearest"),
    ),
    (
        "light and output overlap without being the same image; use one image for both, or two apart",
        lambda: lens().enqueue_finish(*overlapping()),
        lambda: [
            lens().enqueue_finish(overlapping()[0], overlapping()[1]).wait(),
            lens().enqueue_finish(*[overlapping()[0]] * 2).wait(),
        ],
    ),
]


@pytest.mark.parametrize(("says", "bad", "good"), named(LIGHT))
def test_light(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    follow(says, bad, good)


def many_dots(count: int, sigma_px: float) -> clspeckle.Dots:
    return clspeckle.Dots((4096, 4096), np.tile([[2000.0, 1000.0]], (count, 1)), sigma_px=sigma_px)


POSITIONS = (ctypes.c_double * 6)(20, 10, 30, 10, 20, 20)
DOTS = {"count": 3, "positions_px": POSITIONS, "sigma_px": 1.5}
RAW: list[Case] = [
    (
        "but desc->principal_point_given is 0; set it to 1, or leave the point at 0",
        lambda: raw("clspDotsCreate", _library.ClspDotsDesc, **DOTS, principal_point_x_px=9),
        lambda: [
            raw("clspDotsCreate", _library.ClspDotsDesc, **DOTS, principal_point_x_px=9, principal_point_given=1),
            raw("clspDotsCreate", _library.ClspDotsDesc, **DOTS),
        ],
    ),
    (
        "but principal_point_given is 0; set it to 1",
        lambda: raw("clspLensCreate", _library.ClspLensDesc, principal_point_x_px=9),
        lambda: raw("clspLensCreate", _library.ClspLensDesc, principal_point_x_px=9, principal_point_given=1),
    ),
    (
        "give ghost_offset_x_px and ghost_offset_y_px, and set ghost_offset_given to 1",
        lambda: raw(
            "clspDotsCreate",
            _library.ClspDotsDesc,
            count=1,
            positions_px=POSITIONS,
            sigma_px=1.5,
            ghost_relative_intensity=0.1,
        ),
        lambda: raw(
            "clspDotsCreate",
            _library.ClspDotsDesc,
            count=1,
            positions_px=POSITIONS,
            sigma_px=1.5,
            ghost_relative_intensity=0.1,
            ghost_offset_given=1,
            ghost_offset_x_px=5,
            ghost_offset_y_px=5,
        ),
    ),
    (
        "use fewer or narrower dots",
        lambda: many_dots(100_000, 2000.0),
        lambda: [many_dots(10, 2000.0), many_dots(100_000, 2.0)],
    ),
    (
        "pupil_image was given, but pupil is",
        lambda: raw(
            "clspApertureCreate",
            _library.ClspApertureDesc,
            pupil_image=(ctypes.c_float * 4)(1, 1, 1, 1),
            pupil_width=2,
            pupil_height=2,
        ),
        lambda: raw(
            "clspApertureCreate",
            _library.ClspApertureDesc,
            pupil_image=(ctypes.c_float * 4)(1, 1, 1, 1),
            pupil_width=2,
            pupil_height=2,
            pupil=_library.CLSP_PUPIL_IMAGE,
        ),
    ),
]


@pytest.mark.parametrize(("says", "bad", "good"), named(RAW))
def test_structs(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    follow(says, bad, good)


# --- Depth ---


def depth(**given: Any) -> clspeckle.Depth:
    pose = np.eye(3, 4)
    pose[0, 3] = given.pop("baseline", -0.075)
    return clspeckle.Depth((64, 96), [[0.0, 0.0], [0.1, 0.05]], pose, (560, 560, 48, 32), **given)


def spots(count: int, size: int = 64) -> Any:
    grid = np.stack(np.meshgrid(np.arange(8, size - 8, 8.0), np.arange(8, size - 8, 8.0)), -1).reshape(-1, 2)[:count]
    return 500 * clspeckle.Dots((size, size), grid, sigma_px=1.2).render()


DEPTHS: list[Case] = [
    (
        "it must be 0.5 to 5 px; scale the image for other dots",
        lambda: clspeckle.Depth((64, 64), dot_sigma_px=9).measure(spots(4)),
        lambda: clspeckle.Depth((64, 64), dot_sigma_px=4.5).measure(spots(4)),
    ),
    (
        "raise it, or min_amplitude_dn, or tell the detector the noise (read_noise_dn)",
        lambda: clspeckle.Depth((64, 64), dot_sigma_px=1.2, max_dots=10).measure(spots(30)),
        lambda: clspeckle.Depth((64, 64), dot_sigma_px=1.2, max_dots=100).measure(spots(30)),
    ),
    (
        "check the translation of laser_from_camera (metres)",
        lambda: depth(baseline=-1e-7),
        lambda: depth(baseline=-0.075),
    ),
    (
        "give both, or neither for a detector alone",
        lambda: raw("clspDepthCreate", _library.ClspDepthDesc, direction_count=3),
        lambda: raw("clspDepthCreate", _library.ClspDepthDesc),
    ),
]


@pytest.mark.parametrize(("says", "bad", "good"), named(DEPTHS))
def test_depth(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    follow(says, bad, good)


# --- Motion ---


def motion_of(desc: dict[str, Any] | None = None, outputs: tuple[str, ...] = ("path",), **members: Any) -> Any:
    """clspMotionEnqueueCompute() with these images, by the C interface."""
    stage = clspeckle.Motion(SHAPE, intrinsics=(50, 50, 24, 16), **(desc or {}))
    queue = clspeckle.Queue(stage.context)
    given, result, kept = (
        _library.initialized(_library.ClspMotionInput),
        _library.initialized(_library.ClspMotionOutput),
        [],
    )

    def image(kind: str) -> Any:
        pixel = {"position": (np.float32, 3), "material": (np.uint8, 1), "motion": (np.float32, 2)}.get(
            kind, (np.float32, 1)
        )
        shape = SHAPE if pixel[1] == 1 else (*SHAPE, pixel[1])
        kept.append(clspeckle.DeviceImage.from_array(np.ones(shape, pixel[0]), context=stage.context))
        return kept[-1].struct()

    for name, value in members.items():
        setattr(given, name, image(name.replace("previous_", "")) if value is True else value)
    for name in outputs:
        setattr(result, name, image(name))
    _library.call(
        "clspMotionEnqueueCompute", stage._get(), queue._get(), ctypes.byref(given), ctypes.byref(result), 0, None, None
    )
    queue.finish()


POSE = (ctypes.c_double * 12)(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0)
MOTIONS: list[Case] = [
    (
        "input has both position and depth; give one of them",
        lambda: motion_of(position=True, depth=True, previous_position=True),
        lambda: motion_of(position=True, previous_position=True),
    ),
    (
        "input has both previous_position and previous_depth; give one of them",
        lambda: motion_of(depth=True, motion=True, previous_position=True, previous_depth=True),
        lambda: motion_of(depth=True, motion=True, previous_depth=True),
    ),
    (
        "transform_count is 0 but previous_from_current is not NULL; give both or neither",
        lambda: motion_of(position=True, previous_from_current=POSE),
        lambda: motion_of(position=True, previous_from_current=POSE, transform_count=1),
    ),
    (
        "previous_from_current is NULL but transform_count is not 0; give both or neither",
        lambda: motion_of(position=True, transform_count=1, previous_position=True),
        lambda: motion_of(position=True, previous_position=True),
    ),
    (
        "input has both previous_from_current and motion; give one of them",
        lambda: motion_of(position=True, previous_from_current=POSE, transform_count=1, motion=True),
        lambda: motion_of(position=True, previous_from_current=POSE, transform_count=1),
    ),
    (
        "previous_normal; leave out the latter",
        lambda: motion_of(
            position=True, previous_from_current=POSE, transform_count=1, normal=True, previous_normal=True
        ),
        lambda: motion_of(position=True, previous_from_current=POSE, transform_count=1),
    ),
    (
        "previous_position without motion goes with the point; leave it out",
        lambda: motion_of(position=True, material=True, previous_position=True, previous_material=True),
        lambda: motion_of(position=True, material=True, previous_position=True),
    ),
    (
        "give previous_position, previous_from_current, or motion with the previous frame's depth",
        lambda: motion_of(position=True),
        lambda: [
            motion_of(position=True, previous_position=True),
            motion_of(position=True, previous_from_current=POSE, transform_count=1),
            motion_of(depth=True, motion=True, previous_depth=True),
        ],
    ),
    (
        "output has no image; give at least one of path, correlation, shift, displacement and mask",
        lambda: motion_of(outputs=(), position=True, previous_position=True),
        lambda: [motion_of(outputs=(name,), position=True, previous_position=True) for name in ("path", "correlation")],
    ),
]


@pytest.mark.parametrize(("says", "bad", "good"), named(MOTIONS))
def test_motion(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    follow(says, bad, good)


# --- Pipelines ---


def camera(sensor: bool = True, **given: Any) -> clspeckle.Pipeline:
    return clspeckle.Pipeline.from_parameters(SHAPE, output="codes" if sensor else "intensity", **given)


def frame(made: clspeckle.Pipeline, **members: Any) -> None:
    """A frame by the C interface, into an output of its own."""
    desc = _library.initialized(_library.ClspFrame)
    dtype = np.uint16 if made.sensor else np.float32
    image, kept = clspeckle.DeviceImage(SHAPE, dtype), [clspeckle.DeviceImage.from_array(ONES)]
    for name in ("irradiance", "output"):
        if name == "output" or members.pop(name, False):
            setattr(desc, name, (image if name == "output" else kept[0]).struct())
    for name, value in members.items():
        setattr(desc, name, value)
    queue = clspeckle.Queue()
    _library.call("clspPipelineEnqueueFrame", made._get(), queue._get(), ctypes.byref(desc), 0, None, None)
    queue.finish()


def geometry() -> Any:
    desc = _library.initialized(_library.ClspGeometry)
    desc.fx_px, desc.fy_px, desc.cx_px, desc.cy_px = 50, 50, 24, 16
    desc.depth = DEPTH.struct()
    return ctypes.pointer(desc)


def both_places() -> Any:
    desc = geometry()
    desc.contents.position = POSITION.struct()
    return desc


DEPTH = clspeckle.DeviceImage.from_array(ONES)
POSITION = clspeckle.DeviceImage.from_array(np.ones((*SHAPE, 3), np.float32))
ROUGH = clspeckle.Material(subsurface_fraction=0.5)


def projector() -> clspeckle.Pattern:
    return clspeckle.Pattern(np.ones((4, 4), np.float32))


def moved() -> Any:
    return ctypes.pointer(_library.initialized(_library.ClspMotionInput))


def timed(profiling: bool) -> None:
    queue = clspeckle.Queue(profiling=profiling)
    made = camera()
    made.render(ONES, queue=queue)
    assert made.timings()


def two_polarizations(**given: Any) -> clspeckle.Pipeline:
    return camera(polarization_count=2, **given)


def known_sensor(name: bytes) -> None:
    desc = _library.ClspSensorDesc()
    _library.call("clspSensorDescFromProfile", ctypes.byref(desc), ctypes.sizeof(desc), name)


PIPELINES: list[Case] = [
    (
        "says itself how many there are; leave it 0",
        lambda: camera(exposure_path=1, exposure_correlation="gaussian", sub_exposures=5),
        lambda: camera(exposure_path=1, exposure_correlation="gaussian", sub_exposures=0),
    ),
    (
        "but subsurface_length_px is 0; set it above 0",
        lambda: camera(subsurface_fraction=0.5),
        lambda: camera(subsurface_fraction=0.5, subsurface_length_px=2),
    ),
    (
        "but the pipeline's subsurface_length_px is 0; set it above 0",
        lambda: two_polarizations(materials=[ROUGH]),
        lambda: two_polarizations(materials=[ROUGH], subsurface_length_px=2),
    ),
    (
        "which needs a phase with dynamics continuous; or make the motion with the rule replace",
        lambda: clspeckle.Pipeline(phase=phase(), aperture=aperture(), motion=clspeckle.Motion(SHAPE)),
        lambda: [
            clspeckle.Pipeline(phase=phase(dynamics="continuous"), aperture=aperture(), motion=clspeckle.Motion(SHAPE)),
            clspeckle.Pipeline(phase=phase(), aperture=aperture(), motion=clspeckle.Motion(SHAPE, rule="replace")),
        ],
    ),
    (
        "was given to a pipeline with a material table; set subsurface_fraction of the materials",
        lambda: two_polarizations(materials=[clspeckle.Material()], subsurface_fraction=0.5, subsurface_length_px=2),
        lambda: two_polarizations(materials=[ROUGH], subsurface_length_px=2),
    ),
    (
        "motion was given to a pipeline without a motion stage; make the pipeline with one",
        lambda: frame(camera(), irradiance=True, motion=moved()),
        lambda: camera(motion={"intrinsics": (50, 50, 24, 16)}).render(
            ONES, motion=clspeckle.MotionInput(depth=ONES, previous_from_current=np.eye(4))
        ),
    ),
    (
        "geometry was given to a pipeline without a pattern; give irradiance, or make the pipeline with a pattern",
        lambda: frame(camera(), geometry=geometry()),
        lambda: [frame(camera(), irradiance=True), frame(camera(pattern=projector()), geometry=geometry())],
    ),
    (
        "irradiance was given to a pipeline with a pattern; give geometry alone, or make the pipeline without",
        lambda: frame(camera(pattern=projector()), geometry=geometry(), irradiance=True),
        lambda: [frame(camera(pattern=projector()), geometry=geometry()), frame(camera(), irradiance=True)],
    ),
    (
        "geometry has both position and depth; give one of them",
        lambda: frame(camera(pattern=projector()), geometry=both_places()),
        lambda: frame(camera(pattern=projector()), geometry=geometry()),
    ),
    ("had no profiling; make one with profiling", lambda: timed(False), lambda: timed(True)),
    (
        "needs a pipeline with a sensor; make it with one",
        lambda: camera(sensor=False).set_effect("prnu"),
        lambda: camera().set_effect("prnu"),
    ),
    (
        'expected one of "OS04A10"',
        lambda: known_sensor(b"OS04A1O"),
        lambda: known_sensor(b"OS04A10"),
    ),
]


@pytest.mark.parametrize(("says", "bad", "good"), named(PIPELINES))
def test_pipelines(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    follow(says, bad, good)


# --- What only C can ask for ---


def advanced(made: clspeckle.Phase, **members: Any) -> None:
    desc = _library.initialized(_library.ClspPhaseAdvance)
    for name, value in members.items():
        setattr(desc, name, value)
    queue = clspeckle.Queue()
    _library.call("clspPhaseEnqueueAdvance", made._get(), queue._get(), 1, ctypes.byref(desc), 0, None, None)
    queue.finish()


def configured(kind: str, width: int) -> None:
    desc = _library.initialized(getattr(_library, f"Clsp{kind}Desc"))
    desc.width, desc.height = width, SHAPE[0]
    if kind == "Dots":
        desc.count, desc.positions_px, desc.sigma_px = 3, POSITIONS, 1.5
    made = sensor() if kind == "Sensor" else clspeckle.Dots(SHAPE, [[1.0, 1.0]], sigma_px=1.0)
    _library.call(f"clsp{kind}Configure", made._get(), ctypes.byref(desc))


def dark_frame(frames: int, noise: bool) -> None:
    codes = (ctypes.c_uint16 * (4 * frames))()
    told = ctypes.byref(ctypes.c_double()) if noise else None
    _library.call("clspSensorDarkFrameFromCaptures", codes, frames, 2, 2, 0, 0, 0.0, (ctypes.c_float * 4)(), told)


def waits(count: int, events: Any) -> None:
    queue, made = clspeckle.Queue(), phase()
    _library.call("clspPhaseEnqueueRefresh", made._get(), queue._get(), 1, None, count, events, None)
    queue.finish()


def event_list() -> Any:
    event = phase().enqueue_refresh(1)
    event.wait()
    EVENTS.append(event)
    return (ctypes.c_void_p * 1)(event.int_ptr)


EVENTS: list[Any] = []


def refreshed_on(queue: Any) -> None:
    made = phase()
    _library.call("clspPhaseEnqueueRefresh", made._get(), queue, 1, None, 0, None, None)
    made.check()


def blocks(apart: int) -> None:
    buffer = clspeckle.Buffer(1024)
    key = (ctypes.c_uint32 * 2)(0, 0)
    queue = clspeckle.Queue()
    context = clspeckle.default_context()._get()
    pointer = buffer.int_ptr
    arguments = (context, queue._get(), pointer, 0, key, 16, 0, pointer, apart, 0, None, None)
    _library.call("clspPhiloxEnqueueBlocks", *arguments)
    queue.finish()


QUEUE = clspeckle.Queue()
HANDLES: list[Case] = [
    (
        "both path and uniform_path were given; give one of them",
        lambda: advanced(phase(dynamics="continuous"), uniform_path=0.5, path=DEPTH.struct()),
        lambda: [
            advanced(phase(dynamics="continuous"), uniform_path=0.5),
            advanced(phase(dynamics="continuous"), path=DEPTH.struct()),
        ],
    ),
    (
        "both correlation and uniform_correlation were given; give one of them",
        lambda: advanced(phase(dynamics="continuous"), uniform_correlation=0.5, correlation=DEPTH.struct()),
        lambda: [
            advanced(phase(dynamics="continuous"), uniform_correlation=0.5),
            advanced(phase(dynamics="continuous"), correlation=DEPTH.struct()),
        ],
    ),
    (
        "make a new sensor for another size",
        lambda: configured("Sensor", 9),
        lambda: [configured("Sensor", SHAPE[1]), clspeckle.Sensor((SHAPE[0], 9))],
    ),
    (
        "make new dots for another size",
        lambda: configured("Dots", 9),
        lambda: [configured("Dots", SHAPE[1]), clspeckle.Dots((SHAPE[0], 9), [[1.0, 1.0]], sigma_px=1.0)],
    ),
    (
        "give more frames, or NULL for temporal_noise_dn",
        lambda: dark_frame(1, True),
        lambda: [dark_frame(2, True), dark_frame(1, False)],
    ),
    (
        "num_events_in_wait_list is 0 but event_wait_list is not NULL; give both or neither",
        lambda: waits(0, event_list()),
        lambda: [waits(1, event_list()), waits(0, None)],
    ),
    (
        "queue is NULL; make one with",
        lambda: refreshed_on(None),
        lambda: refreshed_on(QUEUE._get()),
    ),
    (
        "counters and blocks overlap without being the same; use one place for both, or two apart",
        lambda: blocks(64),
        lambda: [blocks(0), blocks(512)],
    ),
]


@pytest.mark.parametrize(("says", "bad", "good"), named(HANDLES))
def test_handles(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    follow(says, bad, good)


# --- The process ---

SCRIPT = """
import ctypes, clspeckle
from clspeckle import _library
made = ctypes.c_void_p()
desc = _library.initialized(_library.ClspContextDesc)
_library.call("clspContextCreate", ctypes.byref(desc), ctypes.byref(made))
with clspeckle.Context() as context:
    clspeckle.Aperture((64, 64), relative_diameter=0.5, context=context).info()
"""
WORDS = {
    "CLSPECKLE_FFT": ("auto", "cpu", "gpu", "clfft"),
    "CLSPECKLE_DISK_CACHE": ("auto", "off", "on"),
    "CLSPECKLE_LOG": ("off", "warning", "info"),
}


@pytest.mark.parametrize("variable", WORDS)
def test_the_environment(run_python: Runner, tmp_path: Path, variable: str) -> None:
    *words, last = WORDS[variable]
    refused = run_python(SCRIPT, **{variable: "no-such-word"})
    assert f"set it to {', '.join(words)} or {last}, or unset it" in refused.stderr
    for word in WORDS[variable]:
        done = run_python(SCRIPT, **{variable: word, "CLSPECKLE_CACHE_DIR": str(tmp_path / "cache")})
        assert done.returncode == 0, done.stderr


def test_a_kernel_at_another_place(tmp_path: Path) -> None:
    source = (ROOT / "kernels" / "stages" / "phase.cl").read_bytes()
    (tmp_path / "phase.cl").write_bytes(source)
    with pytest.raises(clspeckle.errors.ClspeckleError, match=r"the built-in kernel is stages/phase\.cl; put it there"):
        clspeckle.Context(kernel_dir=tmp_path)
    (tmp_path / "stages").mkdir()
    (tmp_path / "phase.cl").rename(tmp_path / "stages" / "phase.cl")
    with clspeckle.Context(kernel_dir=tmp_path):
        pass


def contexts(device: bool) -> None:
    info = clspeckle.default_context().info()
    made, desc = ctypes.c_void_p(), _library.initialized(_library.ClspContextDesc)
    queue = cl.CommandQueue(cl.create_some_context(interactive=False))
    desc.cl_context_handle = queue.context.int_ptr
    desc.cl_device = queue.device.int_ptr if device else None
    assert info
    _library.call("clspContextCreate", ctypes.byref(desc), ctypes.byref(made))
    _library.release("clspContextRelease", made.value or 0)


def divided(parent: bool) -> None:
    opencl = cl.create_some_context(interactive=False)
    context = clspeckle.Context.from_opencl(opencl)
    made = clspeckle.Aperture(SHAPE, workspace_from_host=True, context=context)
    size = made.info().workspace_bytes
    whole = cl.Buffer(opencl, cl.mem_flags.READ_WRITE, size + 4096)
    if parent:
        made.set_workspace(whole, offset_bytes=4096, size_bytes=size)
    else:
        made.set_workspace(whole[4096 : 4096 + size], size_bytes=size)


MORE_HANDLES: list[Case] = [
    ("name the device of that context which clSpeckle is to use", lambda: contexts(False), lambda: contexts(True)),
    ("which cannot be divided again; give its parent and an offset", lambda: divided(False), lambda: divided(True)),
]


@pytest.mark.parametrize(("says", "bad", "good"), named(MORE_HANDLES))
def test_more_handles(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    follow(says, bad, good)


def tuned(path: Path | None) -> None:
    clspeckle.tune([(32, 48)], frames=1, path=path)


def test_tuning_records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    follow(
        "name a file in a folder that can be written to",
        lambda: tuned(tmp_path / "file" / "a.json"),
        lambda: tuned(tmp_path / "a.json"),
    )
    monkeypatch.setenv("CLSPECKLE_TUNING", "off")
    follow("or there is no cache folder; name a file", lambda: tuned(None), lambda: tuned(tmp_path / "b.json"))


LARGE_CELL = """
import clspeckle
clspeckle.design_doe([(1, 0)], shape=({side}, {side}), iterations=1)
"""


def test_a_cell_that_fits_the_device(run_python: Runner) -> None:
    """A device of a gigabyte."""
    memory = {"POCL_MEMORY_LIMIT": "1"}
    refused = run_python(LARGE_CELL.replace("{side}", "8192"), **memory)
    assert "take a smaller cell" in refused.stderr
    done = run_python(LARGE_CELL.replace("{side}", "512"), **memory)
    assert done.returncode == 0, done.stderr


def ghosts(direction: int, positions: Any) -> None:
    made = camera(
        dots=clspeckle.Dots(SHAPE, positions, sigma_px=1.5), effects={"ghost_dots": {"lattice_direction": direction}}
    )
    made.render()


@pytest.mark.parametrize(("direction", "other", "step"), [(1, 2, (0, 8)), (2, 1, (8, 0))])
def test_ghosts_of_a_row_of_dots(direction: int, other: int, step: tuple[int, int]) -> None:
    positions = np.array([[8.0, 4.0]]) + np.arange(3)[:, np.newaxis] * np.array(step)
    follow(
        "but no dot has a neighbour there; take the other direction, or both",
        lambda: ghosts(direction, positions),
        lambda: [ghosts(way, positions) for way in (other, 0)],
    )


# --- The package ---


def closed() -> clspeckle.Buffer:
    made = clspeckle.Buffer(64)
    made.close()
    return made


def wrapped(**given: Any) -> clspeckle.DeviceImage:
    return clspeckle.DeviceImage.wrap(cl_buffer(), SHAPE, np.float32, **given)


def cl_buffer() -> Any:
    pointer = clspeckle.default_context().info().opencl_context
    return cl.Buffer(cl.Context.from_int_ptr(pointer), cl.mem_flags.READ_WRITE, ONES.nbytes)


def gathered(array: Any) -> None:
    image = clspeckle.DeviceImage.from_array(np.ascontiguousarray(array.map_to_host()))
    camera().enqueue_frame(image, clspeckle.DeviceImage(SHAPE, np.uint16)).wait()


def spread() -> Any:
    pointer = clspeckle.default_context().info().opencl_context
    queue = cl.CommandQueue(cl.Context.from_int_ptr(pointer))
    return cl_array.to_device(queue, np.ones((SHAPE[0], 2 * SHAPE[1]), np.float32))[:, ::2]


def exported(image: clspeckle.DeviceImage) -> None:
    opencl = cl.Context.from_int_ptr(clspeckle.default_context().info().opencl_context)
    kind = cl.ImageFormat(cl.channel_order.R, cl.channel_type.FLOAT)
    image.enqueue_export(cl.Image(opencl, cl.mem_flags.READ_WRITE, kind, shape=SHAPE[::-1])).wait()


MOVING = clspeckle.MotionInput(depth=ONES, previous_from_current=np.eye(4))
PACKAGE: list[Case] = [
    (
        "whose mask would be lost; fill it first (value.filled(0))",
        lambda: camera().render(np.ma.masked_array(ONES, ONES > 2)),
        lambda: camera().render(np.ma.masked_array(ONES, ONES > 2).filled(0)),
    ),
    (
        "give mask != 0, or mask > 0.5",
        lambda: camera().render(ONES, refresh=ONES / 2),
        lambda: [camera().render(ONES, refresh=ONES / 2 != 0), camera().render(ONES, refresh=ONES > 0.5)],
    ),
    ("this Buffer is closed; make a new one", lambda: closed().read(), lambda: clspeckle.Buffer(64).read()),
    (
        "belongs to the lens, which was given; give one or the other",
        lambda: camera(lens=lens(), k1=0.01),
        lambda: [camera(lens=lens()), camera(k1=0.01)],
    ),
    (
        "this pipeline has no motion stage; make it with one, or leave motion out",
        lambda: camera().render(ONES, motion=MOVING),
        lambda: [camera().render(ONES), camera(motion={"intrinsics": (50, 50, 24, 16)}).render(ONES, motion=MOVING)],
    ),
    (
        "this pipeline has no material table; make it with materials, or leave material out",
        lambda: camera().render(ONES, material=np.zeros(SHAPE, np.uint8)),
        lambda: [
            camera().render(ONES),
            two_polarizations(materials=[clspeckle.Material()]).render(ONES, material=np.zeros(SHAPE, np.uint8)),
        ],
    ),
    (
        "effect must be the id of one (see clspeckle.effects())",
        lambda: camera().set_effect(5),  # type: ignore[arg-type]
        lambda: camera().set_effect(next(e.id for e in clspeckle.effects() if e.id == "prnu")),
    ),
    (
        "give position or depth as an array, a DeviceImage or a pyopencl array",
        lambda: projector().lookup(clspeckle.Geometry()),
        lambda: [
            projector().lookup(clspeckle.Geometry(depth=depths, intrinsics=(50, 50, 24, 16)))
            for depths in (ONES, DEPTH)
        ],
    ),
    (
        "image is a buffer without a shape; use DeviceImage.wrap(buffer, shape, dtype)",
        lambda: clspeckle.statistics.moments(clspeckle.Buffer(ONES.nbytes)),
        lambda: clspeckle.statistics.moments(
            clspeckle.DeviceImage.wrap(clspeckle.Buffer(ONES.nbytes), SHAPE, np.float32)
        ),
    ),
    (
        "image is a buffer without a shape; use DeviceImage.wrap(buffer, shape, dtype)",
        lambda: clspeckle.philox.enqueue_fill(clspeckle.Buffer(ONES.nbytes)),
        lambda: clspeckle.philox.enqueue_fill(
            clspeckle.DeviceImage.wrap(clspeckle.Buffer(ONES.nbytes), SHAPE, np.float32)
        ).wait(),
    ),
    (
        "use DeviceImage.from_array(numpy.ascontiguousarray(array.map_to_host()))",
        lambda: camera().enqueue_frame(spread(), clspeckle.DeviceImage(SHAPE, np.uint16)),
        lambda: gathered(spread()),
    ),
    (
        "give queue=, or context= to wrap()",
        lambda: wrapped().read(),
        lambda: [wrapped(context=clspeckle.default_context()).read(), wrapped().read(queue=clspeckle.Queue())],
    ),
    (
        "this image looks at foreign memory; give context= to wrap()",
        lambda: exported(wrapped()),
        lambda: exported(wrapped(context=clspeckle.default_context())),
    ),
    (
        "shapes is empty; give at least one (height, width), or None",
        lambda: clspeckle.tune([], keep=False),
        lambda: clspeckle.tune([(32, 48)], frames=1, keep=False),
    ),
    (
        "give a CaptureSequence with scene and motion instead",
        lambda: capture_named("bright"),
        lambda: [capture_named("flat"), capture_named("bright", scene="flat")],
    ),
    (
        "without must be a list of ids",
        lambda: clspeckle.diagnose(capture_named("dark"), without="prnu"),
        lambda: clspeckle.diagnose(capture_named("dark"), without=["prnu"], null_replicates=12),
    ),
]


def capture_named(name: str, scene: str | None = None) -> clspeckle.Capture:
    codes = np.random.default_rng(1).integers(64, 80, (3, 16, 16), dtype=np.uint16)
    given: Any = codes if scene is None else clspeckle.CaptureSequence(codes, scene=scene)
    numbers = {"bits": 10, "pixel_pitch_m": 2.9e-6, "f_number": 5.6, "wavelength_m": 940e-9}
    return clspeckle.Capture.from_arrays({name: given}, camera={**numbers, "black_level_dn": 64, "read_noise_dn": 3})


@pytest.mark.parametrize(("says", "bad", "good"), named(PACKAGE))
def test_the_package(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    follow(says, bad, good)


def test_what_belongs_to_a_process_goes_another_way(tmp_path: Path) -> None:
    """A phase by its state, an image by its pixels, a capture by its folder."""
    first, image, capture = phase(), clspeckle.DeviceImage.from_array(ONES), capture_named("dark")
    for made, says in (
        (first, "save() gives its state as an array, restore() takes it in the process that uses it"),
        (aperture(), "make it in the process that uses it"),
        (camera(), "make it in the process that uses it; phase.save() gives the state of the speckle"),
        (image, "read() gives its content"),
        (capture, "write it to a folder and open that"),
    ):
        with pytest.raises(TypeError, match=re.escape(says)):
            pickle.dumps(made)
    other = phase(refreshed=False)
    other.restore(pickle.loads(pickle.dumps(first.save())))
    np.testing.assert_array_equal(other.field(), first.field())
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(image.read())), ONES)
    capture.write(tmp_path / "set")
    assert clspeckle.Capture.open(tmp_path / "set").shape == capture.shape


# --- More that only C can ask for ---


def frames_of(count: int, size: int = 0) -> None:
    made, array = camera(), (_library.ClspFrame * 2)()
    images = [clspeckle.DeviceImage.from_array(ONES), clspeckle.DeviceImage(SHAPE, np.uint16)]
    images.append(clspeckle.DeviceImage(SHAPE, np.uint16))
    for index, entry in enumerate(array):
        _library.call("clspFrameInit", ctypes.byref(entry), ctypes.sizeof(entry))
        entry.irradiance, entry.output, entry.frame_index = images[0].struct(), images[1 + index].struct(), index
    if size:
        array[0].struct_size = size
    queue = clspeckle.Queue()
    _library.call("clspPipelineEnqueueFrames", made._get(), queue._get(), count, array, 0, None, None)
    queue.finish()


def material_table(size: int) -> None:
    array, made = (_library.ClspMaterial * 2)(), ctypes.c_void_p()
    for entry in array:
        _library.call("clspMaterialInit", ctypes.byref(entry), ctypes.sizeof(entry))
    array[1].struct_size = size or array[1].struct_size
    context = clspeckle.default_context()._get()
    _library.call("clspMaterialTableCreate", context, array, 2, ctypes.byref(made))
    _library.release("clspMaterialTableRelease", made.value or 0)


def sized(size: int) -> None:
    desc, made = _library.initialized(_library.ClspSensorDesc), ctypes.c_void_p()
    desc.width, desc.height = SHAPE[::-1]
    desc.struct_size = size or desc.struct_size
    context = clspeckle.default_context()._get()
    _library.call("clspSensorCreate", context, ctypes.byref(desc), ctypes.byref(made))
    _library.release("clspSensorRelease", made.value or 0)


def free_layout(orders: bool) -> None:
    desc = _library.initialized(_library.ClspDotLayoutDesc)
    desc.count, desc.lattice = 20, 0
    _library.call(
        "clspDotLayoutCreate",
        ctypes.byref(desc),
        (ctypes.c_double * 40)(),
        (ctypes.c_int32 * 40)() if orders else None,
        None,
    )


def described(given: int) -> None:
    desc, made = _library.initialized(_library.ClspCaptureDesc), ctypes.c_void_p()
    desc.width, desc.height, desc.bits = 16, 16, 10
    desc.pixel_pitch_m, desc.f_number, desc.wavelength_m = 2.9e-6, 5.6, 940e-9
    desc.principal_point_x_px, desc.principal_point_given = 5.0, given
    _library.call("clspCaptureCreate", ctypes.byref(desc), ctypes.byref(made))
    _library.release("clspCaptureRelease", made.value or 0)


def waited(count: int) -> None:
    event = phase().enqueue_refresh(1)
    _library.call("clspEventWait", count, (ctypes.c_void_p * 1)(event.int_ptr))


def dots_into(array: Any) -> None:
    made, count = clspeckle.Depth((64, 64), dot_sigma_px=1.2), ctypes.c_uint64()
    made.measure(spots(4))
    _library.call("clspDepthGetPatternDots", made._get(), 4, array, ctypes.byref(count))


def judged(**members: Any) -> None:
    """A diagnosis of a few frames."""
    desc, made = _library.initialized(_library.ClspDiagnoseDesc), ctypes.c_void_p()
    for member, value in {"null_replicates": 12, "max_effects": 1, **members}.items():
        setattr(desc, member, value)
    context, capture = clspeckle.default_context()._get(), capture_named("dark")
    _library.call("clspDiagnose", context, capture._get(), ctypes.byref(desc), ctypes.byref(made))
    _library.release("clspDiagnosisRelease", made.value or 0)


def with_a_profile() -> None:
    profile = clspeckle.diagnose(capture_named("dark"), null_replicates=12, max_effects=1).profile()
    judged(profile=profile._get())


def hypothesis_by(with_function: bool, source: bytes | None) -> Any:
    """By a function of the host, by OpenCL source, both or neither."""
    parameter, hypothesis = _library.ClspEffectParameter(), _library.initialized(_library.ClspHypothesis)
    parameter.name, parameter.unit = b"shift", b"DN"
    parameter.minimum, parameter.maximum, parameter.weak, parameter.strong = -5.0, 5.0, 0.5, 2.0
    hypothesis.id, hypothesis.stage, hypothesis.summary, hypothesis.point = b"own", b"sensor", b"a shift", 2
    hypothesis.parameters, hypothesis.parameter_count = ctypes.pointer(parameter), 1
    function: Any = next(kind for name, kind, *_ in _library.ClspHypothesis._fields_ if name == "apply")
    hypothesis.apply = function(lambda *_: 0) if with_function else function()
    hypothesis.opencl_source = source
    return hypothesis


def supposed(with_function: bool, source: bytes | None) -> None:
    hypothesis = hypothesis_by(with_function, source)
    listed = (ctypes.POINTER(_library.ClspHypothesis) * 1)(ctypes.pointer(hypothesis))
    judged(hypotheses=listed, hypothesis_count=1)


def own_effect(with_function: bool, source: bytes | None) -> None:
    hypothesis, made = hypothesis_by(with_function, source), camera()
    _library.call("clspPipelineSetHypothesis", made._get(), ctypes.byref(hypothesis), (ctypes.c_double * 1)(2.0), 1)
    made.render(ONES)


SOURCE = b"""
float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y) {
    return hypothesis_pixel(frame, x, y) + values.shift;
}
"""


def newer(byte: int) -> None:
    """A struct with eight bytes behind those that this library knows."""
    size, made = ctypes.sizeof(_library.ClspSensorDesc), ctypes.c_void_p()
    room = (ctypes.c_ubyte * (size + 8))()
    desc = _library.ClspSensorDesc.from_buffer(room)
    _library.call("clspSensorDescInit", ctypes.byref(desc), size)
    desc.width, desc.height, desc.struct_size = SHAPE[1], SHAPE[0], size + 8
    room[size] = byte
    _library.call("clspSensorCreate", clspeckle.default_context()._get(), ctypes.byref(desc), ctypes.byref(made))
    _library.release("clspSensorRelease", made.value or 0)


def lit(width: int) -> None:
    aperture = _library.initialized(_library.ClspApertureDesc)
    aperture.width = width
    codes = np.zeros(SHAPE, np.uint16)
    _library.call(
        "clspSimulate", clspeckle.default_context()._get(), SHAPE[1], SHAPE[0],
        ONES.ctypes.data_as(ctypes.POINTER(ctypes.c_float)),
        ctypes.byref(aperture), None, 1, 0, codes.ctypes.data_as(ctypes.POINTER(ctypes.c_uint16)),
    )  # fmt: skip


OF_C: list[Case] = [
    (
        "dots is NULL but capacity is 4; give room for so many dots, or 0",
        lambda: dots_into(None),
        lambda: dots_into((_library.ClspDepthPatternDot * 4)()),
    ),
    (
        "but desc->window is 0; set it to CLSP_WINDOW_GIVEN, or leave them at 0",
        lambda: judged(window_width=16),
        lambda: [judged(window=2, window_width=16, window_height=16), judged(window_width=0)],
    ),
    (
        "desc->tolerance_file is empty; name a file, or leave it NULL",
        lambda: judged(tolerance_file=b""),
        lambda: judged(tolerance_file=None),
    ),
    (
        "a diagnosis makes a profile, it takes none: leave it at NULL",
        with_a_profile,
        lambda: judged(profile=None),
    ),
    (
        "are both given; give one of them",
        lambda: supposed(True, SOURCE),
        lambda: [supposed(True, None), supposed(False, SOURCE)],
    ),
    (
        "is NULL; give the function that changes the pixels, or opencl_source",
        lambda: supposed(False, None),
        lambda: [supposed(True, None), supposed(False, SOURCE)],
    ),
    (
        "desc->principal_point is (3, 0), but desc->principal_point_given is 0; set it to 1, or leave the point at 0",
        lambda: raw("clspDotsCreate", _library.ClspDotsDesc, principal_point_x_px=3),
        lambda: clspeckle.Dots(SHAPE, [[8.0, 8.0]], principal_point_px=(3, 0)),
    ),
    (
        "for which a pipeline's frames do not wait; give opencl_source",
        lambda: own_effect(True, None),
        lambda: own_effect(False, SOURCE),
    ),
    ("that this library does not know; update the library", lambda: newer(1), lambda: newer(0)),
    ("aperture->width is 31, but the image's width is", lambda: lit(31), lambda: [lit(0), lit(SHAPE[1])]),
    ("count is 0; give at least one frame", lambda: frames_of(0), lambda: frames_of(2)),
    (
        "it must be a multiple of 8; call clspFrameInit() on each element",
        lambda: frames_of(1, 145),
        lambda: frames_of(1),
    ),
    (
        "call clspFrameInit() on each element",
        lambda: frames_of(2, ctypes.sizeof(_library.ClspFrame) - 8),
        lambda: frames_of(2),
    ),
    ("fill every entry by clspMaterialInit()", lambda: material_table(1000), lambda: material_table(0)),
    ("set it by the struct's Init function or to sizeof", lambda: sized(4), lambda: sized(0)),
    ("free directions are no orders; pass NULL", lambda: free_layout(True), lambda: free_layout(False)),
    (
        "but desc->principal_point_given is 0; set it to 1, or leave the point at 0",
        lambda: described(0),
        lambda: described(1),
    ),
    ("num_events is 0 or events is NULL; give at least one event", lambda: waited(0), lambda: waited(1)),
]


@pytest.mark.parametrize(("says", "bad", "good"), named(OF_C))
def test_the_c_interface(says: str, bad: Callable[[], Any], good: Callable[[], Any]) -> None:
    follow(says, bad, good)


def test_a_report_goes_into_a_file(tmp_path: Path) -> None:
    made = clspeckle.diagnose(capture_named("dark"), null_replicates=12, max_effects=1)

    def written(path: bytes) -> None:
        _library.call("clspDiagnosisWriteReport", made._get(), path)

    named = bytes(tmp_path / "report.json")
    follow("path is empty; name a file", lambda: written(b""), lambda: written(named))
    follow("is no regular file; name another one", lambda: written(b"/dev/null"), lambda: written(named))


def test_one_device_of_several(monkeypatch: pytest.MonkeyPatch) -> None:
    """PoCL makes one device of those of a context: another one is told to have two."""
    opencl = cl.create_some_context(interactive=False)
    with monkeypatch.context() as patch:
        patch.setattr(_interop, "handle", lambda *_: opencl.int_ptr)
        patch.setattr(_interop, "is_pyopencl", lambda *_: True)
        with pytest.raises(clspeckle.errors.InvalidArgumentError, match="has 2 devices; say which one with device="):
            clspeckle.Context.from_opencl(types.SimpleNamespace(devices=[opencl.devices[0]] * 2))
    clspeckle.Context.from_opencl(opencl, device=opencl.devices[0]).close()
