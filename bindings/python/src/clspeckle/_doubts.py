"""What is told of arrays that are valid and can hardly be meant, as the program tells it of files.

Each check looks at a thousand numbers of an image, unless these look odd. The texts of one cause are
the same for all frames of a series, so that Python shows one of them for a line that calls."""

from __future__ import annotations

import functools
import math
import os
import sys
import warnings
from collections.abc import Sequence
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
_SAMPLES = 1000
_PACKAGE = os.path.dirname(__file__) + os.sep


def warn(text: str) -> None:
    """Warns of the line outside of this package that called it."""
    level, frame = 2, sys._getframe(1)
    while frame.f_code.co_filename.startswith(_PACKAGE) and frame.f_back is not None:
        frame = frame.f_back
        level += 1
    warnings.warn(text, stacklevel=level)


@functools.lru_cache(maxsize=64)
def _sampled(shape: tuple[int, ...]) -> slice:
    """A thousand of all pixels, in row-major order, whose columns take turns."""
    height, width = shape[:2]
    step = max(1, height * width // _SAMPLES)
    while math.gcd(step, width) > 1:
        step += 1
    return slice(None, None, step)


def of_depth(depth: npt.NDArray[np.float32], name: str) -> None:
    """Depths that are in another unit than metres, or no surface anywhere."""
    flat = depth.reshape(-1)

    def surfaces(of: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        return of[(of > 0) & (of < NO_SURFACE_M)]

    some = surfaces(flat[_sampled(depth.shape)])
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


def of_normals(
    given: Any, depth: Any, position: Any, numbers: tuple[float, ...] | None, laser: Sequence[float]
) -> None:
    """Normals that face away, are encoded as colors, or were cut to whole numbers. Those of what a camera sees face it;
    where positions are, the camera may be anywhere, and those that are lit face the laser.

    Args:
        given: the normals.
        depth: or None, with a position.
        position: or None.
        numbers: fx, fy, cx, cy; needed with depth.
        laser: the laser's place.
    """
    normals = np.asarray(given)
    width = normals.shape[1]
    of = _sampled(normals.shape)

    def pixels(value: Any) -> npt.NDArray[Any]:
        plane = np.asarray(value)
        some: npt.NDArray[Any] = plane.reshape(-1, *plane.shape[2:])[of]
        return some

    normal = pixels(normals)[:, :3].astype(np.float32)
    if position is not None:
        towards = pixels(position)[:, :3]
        # Renderers write 0 or 1e10 where they see nothing.
        surface = (np.abs(towards) < NO_SURFACE_M).all(axis=-1) & (towards != 0).any(axis=-1)
        facing = np.einsum("ni,ni->n", normal, np.where(surface[:, np.newaxis], towards - laser, 0))
    else:
        away_m = pixels(depth)
        surface = (away_m > 0) & (away_m < NO_SURFACE_M)
        y, x = np.divmod(np.arange(0, normals.shape[0] * width, of.step), width)
        fx, fy, cx, cy = numbers or (1.0, 1.0, 0.0, 0.0)
        facing = normal[:, 0] * ((x - cx) / fx) + normal[:, 1] * ((y - cy) / fy) + normal[:, 2]
    half = np.count_nonzero(surface) / 2
    square = np.einsum("ni,ni->n", normal, normal)
    odd = ~(np.abs(square - 1.0) < 2 * _UNIT) & surface
    away = np.count_nonzero((facing > 0) & surface) > half
    if not away and np.count_nonzero(odd) <= half:
        return
    # A mean over a pixel's samples is shorter than 1, but hardly by half on most of a surface.
    if np.count_nonzero(look_encoded(normal) & odd) > half:
        warn("most normals look encoded as colors, 0 to 1 for -1 to 1: then give 2 * normal - 1")
    elif away:
        warn(
            f"most normals face away from the {'camera' if position is None else 'laser'}, so that there is no light "
            "there; normals point out of the surface, x to the right, y down, z away from the camera. Many renderers "
            "have y up and z towards the camera: then give normal * [1, -1, -1]"
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


class Exposure:
    """What a frame's exposure is judged by."""

    def __init__(self, bits: int, gain: float, dn_per_photon: float, top: float, ambient: float) -> None:
        """
        Args:
            bits: of the sensor; 0: there is none.
            gain: DN per unit of light.
            dn_per_photon: 0: the sensor counts no photons.
            top: what the output has where the converter is at its end, or a little less.
            ambient: constant light, in units of light.
        """
        self.bits, self.gain, self.dn_per_photon, self.top = bits, gain, dn_per_photon, top
        self.ambient = self._is_light(ambient)

    def _is_light(self, light: float) -> bool:
        return light * self.gain >= 0.5 if self.bits and self.gain > 0 else light > 0

    def _advice(self, name: str, largest: float, full: int) -> str:
        """How the brightest number comes to half of full scale."""
        half = 2 ** (self.bits - 1)
        if half * (full or 1) > MOST_GAIN_DN * largest:
            return f"{name} / float({name}.max()) makes the brightest number 1"
        gain = f"exposure_gain_dn={half * (full or 1)}"
        if self.dn_per_photon > 0:
            gain = f"photons_per_unit={half * (full or 1) / self.dn_per_photon:.6g}"
        return f"with {gain} / float({name}.max()) the brightest number times the gain is half of full scale"

    def of_scene(self, scene: npt.NDArray[Any], name: str, full: int, if_meant: str) -> bool:
        """Tells an ideal image that gives no light; true if it did.

        Args:
            full: the number that means 1; 0: 1 does.
            if_meant: what says that no light is meant.
        """
        # A double, as half precision may not hold it.
        least = np.float64(0.5 / self.gain * (full or 1) if self.bits and self.gain > 0 else 0.0)
        flat = scene.reshape(-1)

        def dark(of: npt.NDArray[Any]) -> bool:
            return not (of >= least if least > 0 else of > 0).any()

        if self.ambient or not (dark(flat[_sampled(scene.shape)]) and dark(flat)):
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
                f"the frame has no light: the brightest number of {name} times the gain, {self.gain:g} dn, is less "
                f"than half a code; {self._advice(name, float(flat.max()), full)}"
            )
        return True

    def of_pattern(self, light: npt.NDArray[np.float32]) -> None:
        """Tells a scene that the pattern brings no light to."""
        if not self._is_light(float(light.max())):
            warn(
                f"the {'pattern brings' if self.ambient else 'frame has'} no light: the brightest point of the scene "
                "gets less than half a code. Check the pattern's pose and extent (laser_from_geometry, half_extent_x, "
                "half_extent_y), the unit of depth and position, which is metres, and exposure_gain_dn"
            )

    def of_frame(self, frame: npt.NDArray[Any], light: npt.NDArray[Any] | None, name: str, full: int) -> None:
        """Tells a frame that is saturated.

        Args:
            light: the ideal image, None if it is not known.
            name: of the argument that is the ideal image; empty: none is.
        """
        if not self.bits:
            return
        shape, flat = frame.shape, frame.reshape(-1)
        lit = None if light is None or self.ambient or self.gain <= 0 else light.reshape(-1)
        least = np.float64(0.5 / self.gain * (full or 1) if self.gain > 0 else 0.0)

        def saturated(of: slice) -> bool:
            pixels = flat[of].size if lit is None else np.count_nonzero(lit[of] >= least)
            at_top = np.count_nonzero(flat[of] >= self.top)
            return bool(at_top > 0 and at_top >= SATURATED * pixels)

        if not (saturated(_sampled(shape)) and saturated(slice(None))):
            return
        told = "more than a third of the pixels with light are at the top code"
        if not name or light is None:
            warn(f"{told}: the gain is {self.gain:g} dn for light of 1; a smaller one helps")
            return
        largest = float(light.max())
        if largest * self.gain <= 2 ** (self.bits - 1) * (full or 1):
            warn(
                f"{told}, though the brightest number of {name} times the gain, {self.gain:g} dn, is no more than half "
                "of full scale; black_level_dn, dark_frame_dn or other light fills the rest"
            )
            return
        scale = ""
        if full == 0 and largest > 1:
            scale = (
                f"{name} / N makes N the number that means 1 (255 for codes of 8 bits, 1023 of 10, 4095 of 12), and "
            )
        warn(f"{told}: the gain is {self.gain:g} dn for light of 1; {scale}{self._advice(name, largest, full)}")
