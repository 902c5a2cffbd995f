"""The ideal image I0 before the speckle forms: the pattern and what the surface does to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from .camera import Camera, Sequence, stream
from .effects import Effects

Image = NDArray[np.float64]
Tails = Literal["exponential", "truncated", "lorentzian"]


def pixel_grid(camera: Camera) -> tuple[Image, Image]:
    """x and y of the pixel centres."""
    y, x = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float64)
    return x, y


def illumination(camera: Camera, light: Callable[[Image, Image], Image]) -> Image:
    """A lamp's or a beam's light on what is recorded, mean 1."""
    x, y = pixel_grid(camera)
    lit = light((x - camera.axis_px[0]) / camera.corner_px, (y - camera.axis_px[1]) / camera.corner_px)
    return np.asarray(lit / lit[camera.recorded].mean())


def periodic_radius(shape: tuple[int, int]) -> Image:
    """The distance from pixel (0, 0) of a periodic image."""
    y = np.minimum(np.arange(shape[0]), shape[0] - np.arange(shape[0]))
    x = np.minimum(np.arange(shape[1]), shape[1] - np.arange(shape[1]))
    return np.hypot(y[:, None], x[None, :])


def spread(image: Image, length_px: float, tails: Tails = "exponential") -> Image:
    """An image, or a stack of them, convolved with a kernel of unit sum. Periodic: no light is lost.

    exp(-r / length); the same, cut off at 4 lengths; or (1 + (r / length)^2)^(-3/2), whose line spread is a Lorentzian.
    """
    shape = (image.shape[-2], image.shape[-1])
    radius = periodic_radius(shape) / length_px
    kernel = (1 + radius**2) ** -1.5 if tails == "lorentzian" else np.exp(-radius)
    if tails == "truncated":
        kernel[radius > 4] = 0
    transfer = scipy.fft.rfft2(kernel / kernel.sum())
    return scipy.fft.irfft2(scipy.fft.rfft2(image, axes=(-2, -1)) * transfer, s=shape, axes=(-2, -1))


def smooth_noise(shape: tuple[int, int], scale_px: float, rng: np.random.Generator, count: int = 1) -> Image:
    """Periodic Gaussian images (count, height, width) of variance 1 and correlation exp(-r^2 / (2 scale^2))."""
    fy, fx = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :]
    transfer = np.exp(-((np.pi * scale_px) ** 2) * (fx * fx + fy * fy))  # its square is the correlation's spectrum
    full = np.exp(-2 * ((np.pi * scale_px) ** 2) * (np.fft.fftfreq(shape[1])[None, :] ** 2 + fy * fy))
    white = scipy.fft.rfft2(rng.standard_normal((count, *shape)), axes=(-2, -1))
    return scipy.fft.irfft2(white * transfer, s=shape, axes=(-2, -1)) / np.sqrt(full.mean())


def undistort(camera: Camera, k1: float) -> tuple[Image, Image]:
    """For each pixel the ideal point that x -> x (1 + k1 r^2) brings there; r = 1 in the corner. Newton's method."""
    x, y = pixel_grid(camera)
    cx, cy = camera.axis_px
    dx, dy = x - cx, y - cy
    distorted = np.hypot(dx, dy) / camera.corner_px
    r = distorted.copy()
    for _ in range(8):
        r -= (r * (1 + k1 * r * r) - distorted) / (1 + 3 * k1 * r * r)
    ratio = 1 / (1 + k1 * r * r)
    return cx + dx * ratio, cy + dy * ratio


def dot_profile(dx: Image, dy: Image, sigma: float, effects: Effects, skew_axis: str = "x") -> Image:
    """One dot of unit amplitude about (0, 0)."""
    r2 = (dx * dx + dy * dy) / (sigma * sigma)
    if "beam_flat_top" in effects:  # super-Gaussian
        r2 = r2 ** (1 + 2 * effects["beam_flat_top"]["flatness"])
    dot = np.exp(-r2 / 2)
    if "beam_skew" in effects:  # Gram-Charlier: 1 + s He3(u) / 6 has skewness s; light is not negative
        u = {"x": dx, "y": dy, "-x": -dx, "diagonal": (dx + dy) / np.sqrt(2)}[skew_axis] / sigma
        dot = dot * np.maximum(1 + effects["beam_skew"]["skew"] / 6 * (u**3 - 3 * u), 0)
    return dot


def dot_list(camera: Camera, effects: Effects, seed: int) -> tuple[Image, Image]:
    """Positions (n, 2) and powers (n) of all dots that the projector makes."""
    axis = np.asarray(camera.axis_px)
    positions = camera.positions_px
    powers = np.ones(len(positions))
    if "missing_dots" in effects:  # orders that the element's fabrication lost
        count = max(1, round(effects["missing_dots"]["fraction"] * len(powers)))
        powers[stream(seed, "missing_dots").choice(len(powers), count, replace=False)] = 0.0
    if "unequal_dots" in effects:  # the element's non-uniformity: log-normal powers of mean 1
        sigma = effects["unequal_dots"]["sigma"]
        powers = powers * np.exp(sigma * stream(seed, "unequal_dots").standard_normal(len(powers)) - sigma**2 / 2)
    if "ghost_dots" in effects:  # the faint lattice lies in the middle of the dots' squares
        along = {"both": (0.5, 0.5), "x": (0.5, 0.0), "y": (0.0, 0.5)}[camera.readings.ghost_dots]
        positions = np.concatenate([positions, positions + camera.spacing_px * np.array(along)])
        powers = np.concatenate([powers, powers * effects["ghost_dots"]["relative_intensity"]])
    if "wavelength_shift" in effects:  # sin(angle) of an order is proportional to the wavelength
        sign = 1 if camera.readings.wavelength_shift == "longer" else -1
        shift = sign * effects["wavelength_shift"]["delta_nm"] / camera.wavelength_nm
        positions = axis + (positions - axis) * (1 + shift)
    if "pattern_rotation" in effects:  # the element is turned in its mount
        angle = np.deg2rad(effects["pattern_rotation"]["angle_deg"])
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        positions = axis + (positions - axis) @ turn
    if "zero_order" in effects:
        positions = np.concatenate([positions, axis[None]])
        powers = np.append(powers, effects["zero_order"]["relative_intensity"])
    if "second_wavelength" in effects:  # part of the light has a wavelength 3 % longer: each order has a neighbour
        fraction = effects["second_wavelength"]["fraction"]
        positions = np.concatenate([positions, axis + 1.03 * (positions - axis)])
        powers = np.concatenate([(1 - fraction) * powers, fraction * powers])
    k1 = distortion(camera, effects, of="positions")
    if k1:
        positions = axis + (positions - axis) * (1 + k1 * axis_distance2(camera, positions)[:, None])
    return positions, powers


def axis_distance2(camera: Camera, positions: Image) -> Image:
    """(n): squared distances of points (n, 2) from the axis, 1 in the image's corner."""
    return np.asarray(np.sum((positions - camera.axis_px) ** 2, axis=1) / camera.corner_px**2)


def distortion(camera: Camera, effects: Effects, of: Literal["image", "positions"]) -> float:
    """k1 with its sign where it warps the whole image, or where it moves the dots' centres alone; else 0."""
    reading = camera.readings.lens_distortion
    if "lens_distortion" not in effects or not reading.startswith(of):
        return 0.0
    return effects["lens_distortion"]["k1"] * (-1 if reading.endswith("inward") else 1)


def dot_image(camera: Camera, effects: Effects, seed: int) -> Image:
    """The pattern on the surface as the lens images it."""
    k1 = distortion(camera, effects, of="image")
    x, y = undistort(camera, k1) if k1 else pixel_grid(camera)
    positions, powers = dot_list(camera, effects, seed)
    sigmas = np.full(len(positions), camera.dot_sigma_px)
    reach = 8 * camera.dot_sigma_px
    if "wide_outer_dots" in effects:  # the projector's lens is sharp on its axis alone; the dots' powers stay
        growth = effects["wide_outer_dots"]["growth"]
        sigmas *= 1 + growth * axis_distance2(camera, positions)
        reach *= 1 + growth
    if "lens_distortion" in effects:
        reach += 0.1 * camera.corner_px
    peaks = powers * (camera.dot_sigma_px / sigmas) ** 2
    image = np.zeros(camera.shape)
    for (px, py), sigma, peak in zip(positions, sigmas, peaks, strict=True):
        rows = slice(max(0, int(py - reach)), max(0, int(py + reach) + 2))
        columns = slice(max(0, int(px - reach)), max(0, int(px + reach) + 2))
        if peak > 0 and image[rows, columns].size:
            image[rows, columns] += peak * dot_profile(
                x[rows, columns] - px, y[rows, columns] - py, sigma, effects, camera.readings.beam_skew
            )
    return image


def ideal_image(camera: Camera, sequence: Sequence, effects: Effects, seed: int) -> Image:
    """I0 of a sequence."""
    if sequence.scene == "dark":
        return np.zeros(camera.shape)
    if sequence.scene == "flat":
        return illumination(camera, camera.conditions.lamp)
    if sequence.scene == "board":
        image = np.ones(camera.shape)
    else:
        image = dot_image(camera, effects, seed)
        if "scatter_background" in effects:
            fraction = effects["scatter_background"]["fraction"]
            kept = 1 - fraction if camera.readings.scatter_background == "taken" else 1.0
            image = kept * image + fraction * image[camera.recorded].mean()
        if "subsurface_scattering" in effects:
            setting = effects["subsurface_scattering"]
            wide = spread(image, setting["length_px"], camera.readings.subsurface_scattering)
            image = (1 - setting["fraction"]) * image + setting["fraction"] * wide
        if "shutter_blur" in effects and sequence.moving:  # the projector moves while the shutter is open
            path = effects["shutter_blur"]["path_px"]
            smear = np.sinc(path * np.fft.rfftfreq(camera.width))
            image = scipy.fft.irfft(scipy.fft.rfft(image, axis=-1) * smear, n=camera.width, axis=-1)
    image = image * illumination(camera, camera.conditions.beam)
    if "uneven_illumination" in effects:  # the beam's centre is off the axis
        x, _ = pixel_grid(camera)
        image = image * (
            1
            + effects["uneven_illumination"]["slope"]
            * ((x - camera.axis_px[0]) / (camera.axis_px[0] - camera.border_px))
        )
    if "albedo_texture" in effects:  # the surface's own reflectance: woven cloth, print; moves far less than a pixel
        texture = smooth_noise(camera.shape, 3.0, stream(seed, "albedo_texture"))[0]
        image = image * np.maximum(1 + effects["albedo_texture"]["sigma"] * texture, 0.05)
    return np.maximum(image, 0.0)
