"""What is told of arrays that are valid and can hardly be meant, as the program tells it of files.

A frame is not looked at where the largest number of its ideal image, which its check tells, makes it
neither dark nor brighter than half of the range, and a frame of the same camera was looked at before.
Else each check looks at a thousand numbers of an image, unless these look odd. They lie in runs, as one
of them alone costs as much time as its neighbours in memory do. The texts of one cause are the same for
all frames of a series, so that Python shows one of them for a line that calls."""

from __future__ import annotations

import dataclasses
import functools
import math
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

FAR_M = 100.0
"""Far beyond what a laser lights up; millimetres that are taken as metres come out above it."""
NO_SURFACE_M = 65504.0
"""Renderers write the largest half or 1e10 where they see nothing."""
SATURATED = math.exp(-1)
"""Part of the pixels with light that is at the top code, where the mean of speckle is at full scale."""
MOST_GAIN_DN = 1e30
"""That a sensor takes."""
_UNIT = 0.02  # by which half precision or 8-bit steps never change the length of a normal
_RUNS, _RUN = 8, 128
"""How many runs of how many numbers are looked at."""
_PACKAGE = os.path.dirname(__file__) + os.sep


def warn(text: str) -> None:
    """Warns of the line outside of this package that called it."""
    level, frame = 2, sys._getframe(1)
    while frame.f_code.co_filename.startswith(_PACKAGE) and frame.f_back is not None:
        frame = frame.f_back
        level += 1
    warnings.warn(text, stacklevel=level)


@functools.lru_cache(maxsize=64)
def _runs(height: int, width: int) -> tuple[int, int, int]:
    """How many runs, how far from each other in row-major order, and how long they are. The columns take turns: from
    run to run they move by the golden section of a row."""
    rows = height // _RUNS
    if rows < 2 or width <= _RUN:
        return 1, height * width, height * width
    return _RUNS, rows * width - round(0.382 * width), _RUN


def _some(plane: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A thousand pixels of an image, (runs, pixels) or (runs, pixels, channels); all of a small one."""
    plane = np.ascontiguousarray(plane)
    shape, strides = plane.shape, plane.strides
    count, step, length = _runs(shape[0], shape[1])
    return np.ndarray(
        (count, length, *shape[2:]), plane.dtype, plane, strides=(step * strides[1], strides[1], *strides[2:])
    )


def _grid(plane: npt.NDArray[Any]) -> list[list[float]]:
    """Some sixty numbers."""
    height, width = plane.shape
    numbers: list[list[float]] = plane[:: height // 8 + 1, :: width // 8 + 1].tolist()
    return numbers


def of_mask(mask: npt.NDArray[Any], name: str) -> None:
    """Masks with several values beside 0, as soft edges have them: all of them count."""
    if mask.dtype.kind == "b" or mask.size == 0:
        return
    most = mask.max() or mask.min()
    if not ((mask == 0) | (mask == most)).all():
        half = (int(mask[mask != 0].min()) + int(most)) / 2
        warn(
            f"{name} has other values than 0 and {most}, as of a soft edge: all but 0 count; if they are not to, give "
            f"mask > {half:g}"
        )


def of_depth(depth: npt.NDArray[np.float32], name: str) -> None:
    """Depths that are in another unit than metres, or no surface anywhere."""
    flat = depth.reshape(-1)

    def surfaces(of: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        return of[(of > 0) & (of < NO_SURFACE_M)]

    near = [0 < number <= FAR_M for row in _grid(depth) for number in row]
    if 4 * sum(near) > 3 * len(near):
        return
    some = surfaces(_some(depth))
    if some.size == 0:
        some = surfaces(flat)
    if some.size == 0:
        why = (
            "depths are negative; they count from the camera into the scene"
            if (flat < 0).any()
            else f"all of them are 0, infinite or beyond 65504 m; {name} * 0.001 makes metres of millimetres"
        )
        warn(f"no pixel of {name} has a surface: {why}")
        return
    middle, last = np.median(some), some.max()
    # What most share and nothing is beyond is a far plane, not a surface.
    if middle == last and middle > FAR_M and (some < last).any():
        middle = np.median(some[some < last])
    if middle > FAR_M:
        # As metres the numbers of no surface would be one.
        nothing = ((flat >= NO_SURFACE_M) & np.isfinite(flat)).any()
        metres = f"np.where({name} < {NO_SURFACE_M:g}, {name}, np.inf)" if nothing else name
        warn(
            f"the surfaces of {name} are more than {FAR_M:g} m away in the median, which no laser lights up; "
            f"{metres} * 0.001 makes metres of millimetres, {metres} * 0.01 of centimetres"
        )


def look_encoded(normals: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """Which of (n, 3) are numbers of -1 to 1 as colors of 0 to 1."""
    length = np.linalg.norm(2.0 * normals - 1.0, axis=-1)
    encoded: npt.NDArray[np.bool_] = (np.abs(length - 1.0) < _UNIT) & (normals >= 0).all(axis=-1)
    return encoded


@functools.lru_cache(maxsize=8)
def _rays(height: int, width: int, numbers: tuple[float, ...]) -> npt.NDArray[np.float32]:
    """Directions of view of the pixels that are looked at; numbers: fx, fy, cx, cy."""
    y, x = np.divmod(_some(np.arange(height * width).reshape(height, width)), width)
    fx, fy, cx, cy = numbers
    return np.stack([(x - cx) / fx, (y - cy) / fy, np.ones(x.shape)], axis=-1).astype(np.float32)


def of_normals(
    normals: npt.NDArray[Any],
    depth: npt.NDArray[Any] | None,
    position: npt.NDArray[Any] | None,
    numbers: tuple[float, ...] | None,
    laser: Sequence[float],
) -> None:
    """Normals that face away, are encoded as colors, are too long, or were cut to whole numbers. Those of what a camera
    sees face it; where positions are, the camera may be anywhere, and those that are lit face the laser.

    Args:
        normals: (height, width, 3 or 4).
        depth: or None, with a position.
        position: or None.
        numbers: fx, fy, cx, cy; needed with depth.
        laser: the laser's place.
    """

    def surface_of(part: Callable[[Any], Any]) -> npt.NDArray[np.bool_]:
        if position is None:
            away_m = part(depth)
            return np.asarray((away_m > 0) & (away_m < NO_SURFACE_M))
        # Renderers write 0 or 1e10 where they see nothing.
        xyz = part(position)[..., :3]
        return np.asarray((np.abs(xyz) < NO_SURFACE_M).all(axis=-1) & (xyz != 0).any(axis=-1))

    def squares_of(vectors: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
        xyz = vectors[..., :3].astype(np.float32, copy=False)
        return np.asarray(np.einsum("...i,...i->...", xyz, xyz))

    normal = _some(normals)[..., :3].astype(np.float32)
    surface = surface_of(_some)
    if position is not None:
        ray = np.where(surface[..., np.newaxis], _some(position)[..., :3] - laser, 0)
    else:
        ray = _rays(normals.shape[0], normals.shape[1], numbers or (1.0, 1.0, 0.0, 0.0))
    facing = np.einsum("...i,...i->...", normal, ray)
    square = squares_of(normal)
    half = np.count_nonzero(surface) / 2
    odd = ~(np.abs(square - 1.0) < 2 * _UNIT) & surface
    # A mean over a pixel's samples is shorter than 1, never longer, and hardly by half on most of a surface.
    if np.count_nonzero(odd) > half:
        if np.count_nonzero(look_encoded(normal) & odd) > half:
            warn("most normals look encoded as colors, 0 to 1 for -1 to 1: then give 2 * normal[..., :3] - 1")
            return
        if np.count_nonzero(look_encoded(normal / np.float32(255)) & odd) > half:
            warn("most normals look encoded as colors of 8 bits: then give normal[..., :3] / 255 * 2 - 1")
            return
    if np.count_nonzero((facing > 0) & surface) > half:
        warn(
            f"most normals face away from the {'camera' if position is None else 'laser'}, so that there is no light "
            "there; normals point out of the surface, x to the right, y down, z away from the camera. Many renderers "
            "have y up and z towards the camera: then give normal[..., :3] * [1, -1, -1]"
        )
    with np.errstate(invalid="ignore", over="ignore"):
        too_long = squares_of(normals) > (1.0 + _UNIT) ** 2
    if too_long.any() and (too_long & surface_of(lambda plane: plane)).any():
        warn(
            "some normals are longer than 1, and the light there is stronger by that: give normal[..., :3] / "
            "np.maximum(np.linalg.norm(normal[..., :3], axis=-1, keepdims=True), 1)"
        )
    elif np.count_nonzero(~(square >= 0.25) & surface) > half:
        warn(
            "most normals are shorter than 0.5, and the light there is weaker by that; if whole numbers were made of "
            "them, keep the floating-point ones"
        )


def of_frames_behind(shape: tuple[int, ...], name: str) -> None:
    """An array of frames that looks like (height, width, frames)."""
    frames, height, width = shape
    if frames > width and height > 2 * width:
        warn(
            f"{name} of shape {shape} is taken as {frames} frames, {height} pixels high and {width} wide; if it is "
            f"(height, width, frames), give np.moveaxis({name}, -1, 0)"
        )


def look_swapped(words: npt.NDArray[np.uint16]) -> bool:
    """Whether codes lie three times as close in the other order of bytes, by their middle half; the program's rule."""

    def middle(numbers: npt.NDArray[np.uint16]) -> int:
        return int(numbers[3 * numbers.size // 4]) - int(numbers[numbers.size // 4])

    numbers = np.unique(_some(words))
    if numbers.size < 16:
        return False
    other = np.unique(numbers.byteswap())
    lower = numbers & 255
    # Codes of 8 bits that were multiplied by 256, with or without an offset.
    shifted = lower[0] >= 64 and bool((lower == lower[0]).all())
    return middle(numbers) >= 3 * middle(other) and not shifted and int(other[-1]) > 255


def way_to_parts(image: npt.NDArray[np.float32], name: str) -> str:
    """How parts of light that are above 1 come below it; the program's rule."""
    largest = float(image.max())
    whole = bool((image == np.floor(image)).all())
    # Filters of renderers go a little beyond the top; a quarter of it is what dark scenes have.
    beyond, percent = 1.02, 100
    top = percent if (largest == percent if whole else largest <= beyond * percent) else 255
    while top < largest and (whole or beyond * top < largest):
        top = 4 * top + 3
    most = 2 * np.count_nonzero(image > 1) > np.count_nonzero(image > 0)
    if not (most and (whole or 4 * largest > top)):
        return f"np.minimum({name}, 1) cuts them at 1"
    divided = f"np.minimum({name} / {top}, 1)" if largest > top else f"{name} / {top}"
    return f"{divided} brings them there, if {top} stands for 1"


def of_albedo(albedo: npt.NDArray[np.float32], name: str) -> None:
    """Albedos above 1, which give more light than there is."""
    if albedo.max() > 1:
        warn(
            f"{name} is above 1 somewhere, so that more light leaves the surface than falls on it; "
            f"{way_to_parts(albedo, name)}"
        )


@dataclasses.dataclass(frozen=True)
class Converter:
    """Where a sensor's codes end."""

    bits: int
    saturation_dn: float
    offset_dn: float
    """Black level and mean of the dark frame."""
    noise_dn: float
    effective_bits: int
    gamma: float
    cubic_nonlinearity: float
    nonlinearity_power: int
    float_full_scale: float

    def with_traits(self, traits: Any) -> Converter:
        """As the effects of a pipeline change it."""
        return dataclasses.replace(
            self,
            saturation_dn=traits.saturation_dn,
            effective_bits=traits.effective_bits,
            gamma=traits.gamma,
            cubic_nonlinearity=traits.cubic_nonlinearity,
            nonlinearity_power=traits.nonlinearity_power,
        )

    @property
    def top_dn(self) -> float:
        """The top code."""
        return 2.0**self.bits - 2.0 ** (self.bits - self.effective_bits)

    @property
    def signal_dn(self) -> float:
        """Where the signal of a pixel ends; infinite: at the top code only."""
        full = 2.0**self.bits - 1
        signal = self.saturation_dn
        if math.isfinite(signal):
            signal *= 1 - self.cubic_nonlinearity * min(signal / full, 1.0) ** self.nonlinearity_power
            signal = full * (signal / full) ** self.gamma
        return signal

    @property
    def ends_below_top(self) -> bool:
        """Whether pixels end before the top code."""
        return self.offset_dn + self.signal_dn < self.top_dn

    @property
    def end_dn(self) -> float:
        """A code that pixels at their end have: the top one, or what the noise leaves of the largest signal."""
        if not self.ends_below_top:
            return self.top_dn
        return self.offset_dn + max(self.signal_dn - 3 * self.noise_dn, self.signal_dn / 2)


class Exposure:
    """What a frame's exposure is judged by."""

    def __init__(
        self, converter: Converter | None, gain: float, dn_per_photon: float, passed: float, ambient: float
    ) -> None:
        """
        Args:
            converter: None: there is no sensor.
            gain: DN per unit of light behind the lens.
            dn_per_photon: 0: the sensor counts no photons.
            passed: part of the light that the aperture passes, in the mean.
            ambient: constant light, in units of light behind the lens.
        """
        self.converter, self.dn_per_photon, self.passed, self.sensor_gain = converter, dn_per_photon, passed, gain
        self.bits = 0 if converter is None else converter.bits
        self.gain = gain * passed
        self.least = 0.5 if self.bits and gain > 0 else 5e-324
        self.ambient_dn = ambient * gain if self.bits else ambient
        self.ambient = self.ambient_dn >= self.least
        self.looked = False
        """Whether a frame was looked at that is not saturated."""
        self.half = self.room = math.inf
        self.black, self.ends = (0.0, 0.0), (math.inf, math.inf)
        """Of codes, and of floating-point numbers."""
        if converter is not None:
            self.half = min(2.0 ** (self.bits - 1), converter.signal_dn / 2)
            self.room = min(converter.top_dn - converter.offset_dn, converter.signal_dn) - self.ambient_dn
            unit = converter.float_full_scale / (2.0**self.bits - 1)
            self.black = (converter.offset_dn, converter.offset_dn * unit)
            # Half a code below the top, against rounding.
            self.ends = (converter.end_dn, (converter.end_dn - 0.5) * unit)

    def fits(self, brightest: float) -> bool:
        """Whether a frame is neither dark nor saturated, by the largest number of its ideal image."""
        return self.looked and self.least <= brightest * (self.gain if self.bits else 1.0) <= self.half

    def signal_of(self, frame: npt.NDArray[Any]) -> float:
        """The mean of a thousand pixels of a frame, above the black level and ambient light, in its own unit."""
        is_float = frame.dtype.kind == "f"
        ambient = self.ambient_dn
        if is_float and self.converter is not None:
            ambient *= self.converter.float_full_scale / (2.0**self.bits - 1)
        return float(_some(frame).mean(dtype=np.float64)) - self.black[is_float] - ambient

    def may_be_saturated(self, frame: npt.NDArray[Any], signal: float) -> bool:
        """Whether a frame of that mean signal may have so many pixels at their end as to be told."""
        is_float = frame.dtype.kind == "f"
        return not self.looked or signal >= SATURATED * (self.ends[is_float] - self.black[is_float])

    def _no_room(self) -> str:
        """What fills the range."""
        if self.ambient_dn > 0:
            fill, lower = f"and ambient light of {self.ambient_dn:g} dn leave", "them"
        else:
            fill, lower = "leaves", "it"
        code = 0.0 if self.converter is None else self.converter.offset_dn
        return (
            f"no gain helps: the code without light, {code:g} (black_level_dn and dark_frame_dn), {fill} nothing of "
            f"the range; lower {lower}"
        )

    def _numbers(self) -> str:
        part = "" if self.passed == 1 else f", and the part that the aperture passes, {self.passed:.3g}"
        return f"the gain, {self.sensor_gain:g} dn{part}"

    def _advice(self, name: str, largest: float, full: int) -> str:
        """How the brightest number comes to half of full scale, or of what is left of it."""
        if self.room <= 0:
            return self._no_room()
        gain = min(self.half, self.room / 2) * (full or 1) / self.passed
        if gain > MOST_GAIN_DN * largest:
            return f"{name} / float({name}.max()) makes the brightest number 1"
        words = f"exposure_gain_dn={gain:.6g}"
        if self.dn_per_photon > 0:
            words = f"photons_per_unit={gain / self.dn_per_photon:.6g}"
        return (
            f"with {words} / float({name}.max()) the light of the brightest number has half of the range, in the mean"
        )

    def of_scene(self, scene: npt.NDArray[Any], name: str, full: int, if_meant: str) -> bool:
        """Tells an ideal image that gives no light; true if it did.

        Args:
            full: the number that means 1; 0: 1 does.
            if_meant: what says that no light is meant.
        """
        # A double, as half precision may not hold it.
        least = np.float64(0.5 / self.gain * (full or 1) if self.bits and self.gain > 0 else 0.0)
        flat = scene.reshape(-1)
        if self.ambient or (flat >= least if least > 0 else flat > 0).any():
            return False
        if self.bits == 0 or self.gain <= 0 or not (flat > 0).any():
            if (flat > 0).any():
                return False  # a gain of 0 is meant
            warn(
                f"{name} is 0 everywhere, so that the frame has no light: is it another image than meant, or one that "
                f"was never drawn? If no light is meant, {if_meant} says so"
            )
        else:
            warn(
                f"the frame has no light: the brightest number of {name} times {self._numbers()}, is less than half a "
                f"code; {self._advice(name, float(flat.max()), full)}"
            )
        return True

    def _is_dark(self, light: npt.NDArray[np.float32]) -> bool:
        return float(light.max()) * (self.gain if self.bits else 1.0) < self.least

    def of_pattern(self, light: npt.NDArray[np.float32]) -> None:
        """Tells a scene that the pattern brings no light to."""
        if self._is_dark(light):
            warn(
                f"the {'pattern brings' if self.ambient else 'frame has'} no light: the brightest point of the scene "
                "gets less than half a code. Check the pattern's pose and extent (laser_from_geometry, half_extent_x, "
                "half_extent_y), the unit of depth and position, which is metres, and exposure_gain_dn"
            )

    def of_dots(self, light: npt.NDArray[np.float32]) -> None:
        """Tells dots that bring no light."""
        if self._is_dark(light):
            warn(
                f"the {'dots bring' if self.ambient else 'frame has'} no light: the brightest pixel gets less than "
                "half a code. Check that positions_px are (x, y) in pixels, inside the image, peaks, scale and "
                "exposure_gain_dn"
            )

    def of_frame(self, frame: npt.NDArray[Any], light: npt.NDArray[Any] | None, name: str, full: int) -> None:
        """Tells a frame that is saturated.

        Args:
            light: the ideal image, None if it is not known.
            name: of the argument that is the ideal image; empty: none is.
        """
        if self.converter is None or (light is not None and not name and not self.ambient and self._is_dark(light)):
            return
        end = self.ends[frame.dtype.kind == "f"]
        lit = None if light is None or self.ambient or self.gain <= 0 else light
        least = np.float64(0.5 / self.gain * (full or 1) if self.gain > 0 else 0.0)

        def saturated(part: Callable[[Any], Any]) -> bool:
            codes = part(frame)
            pixels = codes.size if lit is None else np.count_nonzero(part(lit) >= least)
            at_end = np.count_nonzero(codes >= end)
            return bool(at_end > 0 and at_end >= SATURATED * pixels)

        if not (saturated(_some) and saturated(lambda plane: plane)):
            self.looked = True
            return
        told = "more than a third of the pixels with light are at the top code"
        if self.converter.ends_below_top:
            told = (
                f"more than a third of the pixels with light are at {self.converter.offset_dn:g} + "
                f"{self.converter.signal_dn:g} dn, where their signal ends below the top code (saturation_dn, "
                "full_well_e or the effect full_well)"
            )
        if self.room <= 0:
            warn(f"{told}: {self._no_room()}")
            return
        if not name or light is None:
            warn(f"{told}: the gain is {self.sensor_gain:g} dn for light of 1; a smaller one helps")
            return
        largest = float(light.max())
        if largest * self.gain <= self.half * (full or 1):
            warn(
                f"{told}, though the brightest number of {name} times {self._numbers()}, is no more than half of the "
                "range; black_level_dn, dark_frame_dn or other light fills the rest"
            )
            return
        scale = ""
        if full == 0 and largest > 1:
            scale = (
                f"{name} / N makes N the number that means 1 (255 for codes of 8 bits, 1023 of 10, 4095 of 12), and "
            )
        warn(f"{told}: the gain is {self.sensor_gain:g} dn for light of 1; {scale}{self._advice(name, largest, full)}")
