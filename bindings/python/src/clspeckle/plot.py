"""Figures of images and of their speckle, for notebooks and files. Need matplotlib.

Every function returns a ``matplotlib.figure.Figure``, which a notebook shows and ``savefig`` writes, as
:meth:`clspeckle.Diagnosis.plot` does.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _show, errors, statistics
from ._staging import ImageLike
from .runtime import Context, resolve_context

__all__ = ["image", "speckle"]


def _plane(image: Any) -> npt.NDArray[Any]:
    return _check.number_plane(np.asarray(image), "image")


def _show_image(figure: Any, axis: Any, plane: npt.NDArray[Any], low: float, high: float, unit: str) -> None:
    shown = axis.imshow(plane, cmap="gray", vmin=low, vmax=high, interpolation="nearest")
    beyond = (bool(plane.min() < low), bool(plane.max() > high))
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get(beyond, "neither")
    figure.colorbar(shown, ax=axis, label=unit, extend=extend)
    axis.set(xlabel="x, px", ylabel="y, px")


def image(
    image: ImageLike, *, title: str = "", low: float | None = None, high: float | None = None, unit: str = "DN"
) -> Any:
    """An image with a color bar.

    Args:
        image: (height, width), codes or intensities, in host or device memory.
        title: above it.
        low: value that is black; None: the smallest.
        high: value that is white; None: the 99.9th percentile. The bar has a point where values lie beyond.
        unit: of the values.

    Returns:
        a matplotlib.figure.Figure.

    Raises:
        ImportError: matplotlib is not installed.
        InvalidArgumentError, InvalidDataError: no image of finite numbers; or `low` is not below `high`.
    """
    plane = _plane(image)
    dark = float(plane.min()) if low is None else _check.real(low, "low")
    bright = float(np.percentile(plane, 99.9)) if high is None else _check.real(high, "high")
    if not dark < bright:
        if low is not None and high is not None:
            raise errors.InvalidArgumentError(f"low is {low}, high {high}; expected low below high")
        dark, bright = (bright - 1, bright) if low is None else (dark, dark + 1)  # of one value
    figure = _show.optional("matplotlib.figure", "clspeckle.plot").Figure(figsize=(6.4, 4.8), layout="tight")
    axis = figure.subplots()
    _show_image(figure, axis, plane, dark, bright, unit)
    axis.set_title(title)
    return figure


def _bessel_j1(x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """J1 by its integral, whose midpoint rule is exact to float64 below |x| = 400."""
    angle = (np.arange(512) + 0.5) * (math.pi / 512)
    result: npt.NDArray[np.float64] = np.cos(angle - x[..., None] * np.sin(angle)).mean(axis=-1)
    return result


def _airy(distance_px: npt.NDArray[np.float64], relative_diameter: float) -> npt.NDArray[np.float64]:
    """(2 J1(pi D r) / (pi D r))^2: autocovariance of the intensity behind a circular pupil (Goodman, chapter 4)."""
    x = math.pi * relative_diameter * distance_px
    safe = np.where(x == 0, 1.0, x)
    result: npt.NDArray[np.float64] = np.where(x == 0, 1.0, (2 * _bessel_j1(safe) / safe) ** 2)
    return result


def _of_pixels(lags: npt.NDArray[np.float64], relative_diameter: float, side: float) -> npt.NDArray[np.float64]:
    """That of light which square pixels of a side integrate, along x: the mean over pairs of their points."""
    if side == 0:
        return _airy(np.abs(lags), relative_diameter)
    apart = (np.arange(32) + 0.5) / 16 - 1  # distances of two points, in sides; -1 to 1
    weight = 1 - np.abs(apart)
    weight /= weight.sum()
    distance = np.hypot(lags[:, None, None] + side * apart[:, None], side * apart)
    table = np.linspace(0, distance.max(), 4097)
    airy = np.interp(distance, table, _airy(table, relative_diameter))
    result: npt.NDArray[np.float64] = np.einsum("lxy,x,y->l", airy, weight, weight)
    return result


def speckle(
    image: ImageLike,
    *,
    relative_diameter: float | None = None,
    degree_of_polarization: float = 1.0,
    fill_factor: float = 0.0,
    black_level_dn: float = 0.0,
    max_lag: int = 12,
    title: str = "",
    context: Context | None = None,
) -> Any:
    """Speckle of an evenly lit image beside theory: the image, its histogram, its autocovariance.

    Theory is that of fully developed speckle behind a circular pupil (J. W. Goodman, Speckle Phenomena in Optics, 2nd
    ed., chapters 3 and 4): the contrast C is sqrt((1 + P^2) / 2), less by the pixels' area; the histogram a Gamma law
    of order 1 / C^2; the autocovariance along x and y (2 J1(pi D r) / (pi D r))^2, averaged over the pixels' area.
    Noise, saturation and uneven light are not in it.

    Args:
        image: (height, width), of even light, in host or device memory.
        relative_diameter: D of the pupil, above 0, as ``Aperture.info().relative_diameter`` has it; None: the
            autocovariance is shown without theory, and contrast and histogram with that of points.
        degree_of_polarization: P, 0 to 1.
        fill_factor: light-sensitive part of a pixel's area, 0 to 1; 0: points.
        black_level_dn: what the image has without light.
        max_lag: of the autocovariance, at least 1, below the smaller side of the image.
        title: above all.
        context: None: the image's, else :func:`clspeckle.default_context`.

    Returns:
        a matplotlib.figure.Figure with three axes and that of the color bar.

    Raises:
        ImportError: matplotlib is not installed.
        InvalidArgumentError, InvalidDataError: a number out of its range, no image of finite numbers, or one without
            light above the black level.
    """
    black = _check.real(black_level_dn, "black_level_dn")
    polarization = _check.real(degree_of_polarization, "degree_of_polarization")
    fill = _check.real(fill_factor, "fill_factor")
    for name, value in (("degree_of_polarization", polarization), ("fill_factor", fill)):
        if not 0 <= value <= 1:
            raise _check.range_error(name, value, "0 to 1")
    diameter = None if relative_diameter is None else _check.real(relative_diameter, "relative_diameter")
    if diameter is not None and not diameter > 0:
        raise _check.range_error("relative_diameter", diameter, "above 0")
    if max_lag == 0:
        raise _check.range_error("max_lag", max_lag, "at least 1")
    context = resolve_context(context, image)  # before the copy to the host, which has none
    plane = _plane(image)
    autocovariance = statistics.autocovariance(plane, max_lag, context=context)
    moments = statistics.moments(plane, context=context)
    mean = moments.mean - black
    if not mean > 0:
        raise errors.InvalidArgumentError(
            f"the image's mean is {moments.mean:.6g}, black_level_dn {black:g}; expected light above it"
        )
    lags = np.arange(-max_lag, max_lag + 1, dtype=np.float64)
    side = 0.0 if diameter is None else math.sqrt(fill)
    covered = np.ones(1) if diameter is None else _of_pixels(np.zeros(1), diameter, side)
    contrast, expected = moments.standard_deviation / mean, math.sqrt((1 + polarization**2) / 2 * covered[0])

    figure = _show.optional("matplotlib.figure", "clspeckle.plot").Figure(figsize=(13, 3.6), layout="tight")
    left, middle, right = figure.subplots(1, 3)
    figure.suptitle(title)
    _show_image(figure, left, plane, black, black + 4 * mean, "DN")
    left.set_title(f"contrast {contrast:.3f}, theory {expected:.3f}")

    # Codes are whole: bins of whole numbers of them, or some bins would have more codes than others.
    width = 6 * mean / 60
    width = max(1.0, float(math.ceil(width))) if plane.dtype.kind == "u" else width
    low = black - width * max(0, math.ceil((black - moments.minimum) / width))
    bins = max(1, math.ceil((black + 6 * mean - low) / width))
    shift = 0.5 if plane.dtype.kind == "u" else 0.0  # a code stands for what rounds to it
    counts = statistics.histogram(plane, low, low + bins * width, bins, context=context)
    edges = (counts.edges - shift - black) / mean
    density = counts.counts / (moments.count * np.diff(edges))
    middle.stairs(density, edges, color="#D55E00", fill=True, alpha=0.5, label="image")
    order = 1 / expected**2
    light = np.linspace(0, 6, 301)[1:]
    law = np.exp(order * math.log(order) + (order - 1) * np.log(light) - order * light - math.lgamma(order))
    middle.plot(light, law, color="#0072B2", label=f"Gamma law of order {order:.2f}")
    middle.set(xlabel="light over its mean", ylabel="probability density", xlim=(min(0.0, float(edges[0])), 6))
    middle.legend()

    right.plot(lags, autocovariance[max_lag], "o", color="#D55E00", markersize=4, label="along x")
    right.plot(lags, autocovariance[:, max_lag], "x", color="#D55E00", markersize=5, label="along y")
    if diameter is not None:
        fine = np.linspace(-max_lag, max_lag, 16 * max_lag + 1)
        curve = _of_pixels(fine, diameter, side) / covered[0]
        right.plot(fine, curve, color="#0072B2", label=f"Airy, D = {diameter:.3f}")
    right.set(xlabel="lag, px", ylabel="autocovariance")
    right.legend()
    return figure
