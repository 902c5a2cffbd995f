"""The statistics of a capture's sequence in float64, from the equations of docs/method/gap-statistics.md.

Frames in, a dictionary of (name, region) -> value out. Whatever the library finds with row sums, lag products and half
a Fourier transform is found here from whole arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri_exp

Array = NDArray[np.float64]
Values = dict[tuple[str, str], float]

ROUNDING_VARIANCE = 1 / 12
RING_BINS = {"8_to_12": (2, 3), "12_to_20": (3, 5), "20_to_32": (5, 8)}


@dataclass
class Sequence:
    """Codes (frames, height, width) and what is known of them. mask: True where a pixel counts."""

    codes: NDArray[np.uint16]
    scene: str
    moving: bool
    black: float
    read: float
    bits: int
    cutoff: float
    mask: NDArray[np.bool_]

    def __post_init__(self) -> None:
        self.signal = self.codes.astype(np.float64) - self.black
        self.frames, self.height, self.width = self.signal.shape
        self.frame_mean = self.signal[:, self.mask].mean(axis=1)
        self.mean_signal = self.frame_mean.mean()
        self.read_variance = max(self.read**2, ROUNDING_VARIANCE)
        self.light = (
            max(self.mean_signal, 0.5 * self.read_variance**0.5) if self.scene != "dark" else self.read_variance**0.5
        )
        level = self.frame_mean[:, None, None]
        clips = np.zeros(self.codes.shape, bool)
        if self.scene in ("board", "dots") and not self.moving:
            level_frames = self.signal * (self.mean_signal / level)  # flicker out
            clips = self.codes >= self.clipping_code()
        else:
            level_frames = self.signal - (level - self.mean_signal)
        # A code that clips tells nothing, unless there is nothing else.
        told = ~clips | clips.all(axis=0)
        self.mean = np.where(self.mask, level_frames.mean(axis=0, where=told), 0.0)
        self.residual = np.where(self.mask & ~clips, level_frames - self.mean, 0.0)
        self.variance = (self.residual**2).sum(axis=0) / (self.frames - 1)
        self.pixel_variance = self.variance[self.mask].mean()
        ys, xs = np.mgrid[: self.height, : self.width]
        corner = 0.5 * np.hypot(self.width - 1, self.height - 1)
        self.x, self.y = (xs - (self.width - 1) / 2) / corner, (ys - (self.height - 1) / 2) / corner
        self.region = 3 * (3 * ys // self.height) + 3 * xs // self.width

    def clipping_code(self) -> int:
        """The highest code that occurs, if the distance to the next one would carry it beyond the converter's range."""
        occurring = np.unique(self.codes[:, self.mask]).astype(int)
        gap = int(occurring[-1] - occurring[-2]) if len(occurring) > 1 else int(occurring[-1])
        return int(occurring[-1]) if occurring[-1] + gap >= 2**self.bits else 2**self.bits


def log_ratio(a: float, b: float, floor: float = 1e-6) -> float:
    return float(np.log((max(a, 0.0) + floor) / (max(b, 0.0) + floor)))


def shifted(image: NDArray, dx: int, dy: int) -> tuple[NDArray, NDArray]:
    """Views of an image (or stack) and of itself dx to the right and dy down."""
    height, width = image.shape[-2:]
    here = image[..., max(-dy, 0) : height - max(dy, 0), max(-dx, 0) : width - max(dx, 0)]
    there = image[..., max(dy, 0) : height + min(dy, 0), max(dx, 0) : width + min(dx, 0)]
    return here, there


def covariance(images: Array, mask: NDArray[np.bool_], dx: int, dy: int) -> float:
    """Mean product of pixels a lag apart over the pairs of unmasked pixels, of images that are 0 where masked."""
    here, there = shifted(images, dx, dy)
    here_used, there_used = shifted(mask, dx, dy)
    return float((here * there).sum() / ((here_used & there_used).sum() * (images.size / mask.size)))


def temporal_lags(sequence: Sequence) -> list[int]:
    lags = [1, 2, 4, 8] if sequence.scene in ("board", "dots") and not sequence.moving else [1, 2]
    lags.append(sequence.frames // 2)
    return [lag for i, lag in enumerate(lags) if 1 <= lag < sequence.frames and lag not in lags[:i]]


def temporal_noise(s: Sequence) -> Values:
    values: Values = {}
    used_rows, used_columns = s.mask.sum(axis=1), s.mask.sum(axis=0)
    e = s.residual
    variance = float((e**2).sum() / (s.frames * s.mask.sum()))
    rows = np.divide(e.sum(axis=2) ** 2, used_rows, out=np.zeros((s.frames, s.height)), where=used_rows > 0)
    columns = np.divide(e.sum(axis=1) ** 2, used_columns, out=np.zeros((s.frames, s.width)), where=used_columns > 0)
    values["row_noise", "all"] = log_ratio(float(rows.mean()), variance)
    values["column_noise", "all"] = log_ratio(float(columns.mean()), variance)
    values["frame_mean_fluctuation", "all"] = float(np.log((s.frame_mean.std(ddof=1) + 1e-4) / s.light))
    others = s.frame_mean[1:]
    error = (others.std(ddof=1) + 1e-4) * np.sqrt(1 + 1 / others.size)
    values["first_frame", "all"] = float(np.arcsinh((s.frame_mean[0] - others.mean()) / error))
    time = np.arange(s.frames) - (s.frames - 1) / 2
    slope, offset = np.polyfit(time, s.frame_mean, 1)
    scatter = np.sqrt(((s.frame_mean - offset - slope * time) ** 2).sum() / (s.frames - 2))
    values["frame_mean_drift", "all"] = float(np.arcsinh(slope * np.sqrt((time**2).sum()) / (scatter + 1e-4)))
    weight = np.ones_like(s.mean)
    if s.scene in ("board", "dots") and not s.moving:
        bright = np.maximum(s.mean, 0.0)
        weight = bright / (bright + s.light)
    g = e * weight
    for lag in temporal_lags(s):
        product = (g[:-lag] * g[lag:]).sum() / (s.frames - lag)
        values[f"temporal_correlation_{lag}", "all"] = float(product / ((g**2).sum() / s.frames))
    if s.moving:
        return values
    samples = e[:, s.mask]
    values["noise_skewness", "all"] = float((samples**3).mean() / (variance + 1e-6) ** 1.5)
    values["noise_kurtosis", "all"] = float(np.log(((samples**4).mean() + 1e-6) / (variance**2 + 1e-6)))
    rho = {lag: covariance(e, s.mask, *lag) / variance for lag in ((1, 0), (0, 1), (1, 1), (-1, 1), (2, 0), (0, 2))}
    values["noise_correlation_x1", "all"] = rho[1, 0]
    values["noise_correlation_y1", "all"] = rho[0, 1]
    values["noise_correlation_diagonal", "all"] = (rho[1, 1] + rho[-1, 1]) / 2
    values["noise_correlation_2", "all"] = (rho[2, 0] + rho[0, 2]) / 2
    return values


def repetition(s: Sequence) -> Values:
    rows = s.residual[:, ::8]
    pairs = [
        float(((rows[i] - rows[j]) ** 2).sum()) for i in range(s.frames) for j in range(i + 1, min(i + 9, s.frames))
    ]
    differences = np.array(pairs)
    mean = differences.mean()
    return {("repeated_frames", "all"): float(np.log(np.mean(mean / (differences + 1e-3 * mean))))}


def code_lattice(s: Sequence) -> Values:
    codes = s.codes[:, s.mask].astype(np.int64)
    values: Values = {}
    for step in (2, 4, 8):
        values[f"codes_multiple_of_{step}", "all"] = float((codes % step == 0).mean() - 1 / step)
    values["codes_multiple_of_4_plus_1", "all"] = float((codes % 4 == 1).mean() - 1 / 4)
    counts = np.bincount(codes.ravel(), minlength=2**s.bits).astype(np.float64)
    kernel = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
    fourth = np.convolve(counts, kernel, mode="same")[5:-5]
    noise = np.convolve(counts, kernel**2, mode="same")[5:-5]
    values["histogram_roughness", "all"] = float(np.log(((fourth**2).sum() + 70) / (noise.sum() + 70)))
    return values


def blocks(s: Sequence) -> Values:
    codes = s.codes.astype(np.float64)
    values: Values = {}
    for period in (4, 8, 16):
        total = 0.0
        for axis, size in ((2, s.width), (1, s.height)):
            steps = np.abs(np.diff(codes, axis=axis))
            here, there = shifted(s.mask, int(axis == 2), int(axis == 1))
            pairs = np.broadcast_to(here & there, steps.shape)
            edge = np.arange(1, size) % period == 0
            on, off = (
                np.compress(which, steps, axis=axis)[np.compress(which, pairs, axis=axis)].mean()
                for which in (edge, ~edge)
            )
            total += log_ratio(float(on), float(off), 1e-3) / 2
        values[f"block_edges_{period}", "all"] = total
    return values


def fit_field(s: Sequence, image: Array, terms: int) -> tuple[Array, Array]:
    squared = s.x**2 + s.y**2
    basis = np.stack([np.ones_like(s.x), s.x, s.y, squared, squared**2][:terms], axis=-1)
    coefficients = np.linalg.lstsq(basis[s.mask], image[s.mask], rcond=None)[0]
    return coefficients, np.where(s.mask, image - basis @ coefficients, 0.0)


def laser_mosaic(s: Sequence) -> Values:
    """Contrasts of laser light within smooth windows of 16 x 16 pixels inside the image; one pattern's in standard
    errors."""
    taper = np.sin(np.pi * (np.arange(16) + 0.5) / 16) ** 2
    weight = np.outer(taper, taper)
    parts, weights = [], []
    for top in range(0, s.mean.shape[0] - 15, 8):
        for left in range(0, s.mean.shape[1] - 15, 8):
            inside = slice(top, top + 16), slice(left, left + 16)
            used = weight * s.mask[inside]
            site = np.array([(used[i::2, j::2] * s.mean[inside][i::2, j::2]).sum() for i in (0, 1) for j in (0, 1)])
            share = np.array([used[i::2, j::2].sum() for i in (0, 1) for j in (0, 1)])
            if share.min() > 0:
                signs = np.array([[1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]])
                parts.append(signs @ (site / share) / 2 * share.sum())
                weights.append(share.sum())
    total, square = np.sum(parts, axis=0), np.sum(np.square(parts), axis=0)
    contrasts = total / (np.sum(weights) * s.light) if s.moving else total / np.sqrt(square)
    return {
        (f"mosaic_{name}", "all"): float(c) for name, c in zip(("rows", "columns", "checker"), contrasts, strict=True)
    }


def field(s: Sequence) -> Values:
    values: Values = {}
    light = s.light if s.scene != "dark" else 1.0
    site = [[s.mean[i::2, j::2][s.mask[i::2, j::2]].mean() for j in (0, 1)] for i in (0, 1)]
    values["mosaic_rows", "all"] = (site[0][0] + site[0][1] - site[1][0] - site[1][1]) / 2 / light
    values["mosaic_columns", "all"] = (site[0][0] - site[0][1] + site[1][0] - site[1][1]) / 2 / light
    values["mosaic_checker", "all"] = (site[0][0] - site[0][1] - site[1][0] + site[1][1]) / 2 / light
    if s.scene in ("board", "dots"):
        values |= laser_mosaic(s)
    if s.scene == "dots":
        return values
    coefficients, _ = fit_field(s, s.mean, 4)
    for name, value in zip(("gradient_x", "gradient_y", "radial_falloff"), coefficients[1:], strict=True):
        values[name, "all"] = float(value / light)
    if s.scene == "flat":
        values["radial_falloff_4", "all"] = float(fit_field(s, s.mean, 5)[0][4] / light)
    if s.scene == "flat" or s.moving:
        for k in (0, 1, 2, 3, 5, 6, 7, 8):
            part = s.mean[(s.region == k) & s.mask].mean()
            values["region_mean", f"r{k // 3}c{k % 3}"] = float((part - s.mean[s.mask].mean()) / light)
    return values


def fixed_pattern(s: Sequence) -> Values:
    _, pattern = fit_field(s, s.mean, 5)
    used = pattern[s.mask]
    deviation = np.quantile(np.abs(used), 0.68)
    for _ in range(5):
        weight = np.exp(-((used / deviation) ** 2) / 18)
        deviation = np.sqrt((weight * used**2).sum() / weight.sum() / 0.9)
    _, pattern = fit_field(
        s, np.where(np.abs(pattern) > 6 * deviation, 0, pattern), 5
    )  # pixels far out are counted beside
    bulk = pattern[s.mask]
    variance = float((bulk**2).mean())
    values: Values = {}
    if s.scene == "flat":
        e, n = s.residual, s.mask.sum()
        whole = (e**2).sum() / (s.frames * n)
        excess = 0.0  # what rows and columns have in common
        for axis, size in ((2, s.height), (1, s.width)):
            count = s.mask.sum(axis=axis - 1)
            lines = np.divide(e.sum(axis=axis) ** 2, count, out=np.zeros((s.frames, size)), where=count > 0)
            excess += (lines.mean() - whole) * size / n
        values["temporal_variance", "all"] = log_ratio(s.pixel_variance * max(1 - excess / whole, 0.0), s.read_variance)
    values["fixed_pattern", "all"] = log_ratio(variance, s.pixel_variance / s.frames)
    for name, axis in (("fixed_pattern_columns", 0), ("fixed_pattern_rows", 1)):
        count = s.mask.sum(axis=axis)
        lines = np.divide(pattern.sum(axis=axis) ** 2, count, out=np.zeros(count.shape), where=count > 0)
        values[name, "all"] = log_ratio(float(lines.mean()), variance)
    values["fixed_pattern_skewness", "all"] = float(np.arcsinh((bulk**3).mean() / (variance + 1e-6) ** 1.5))
    values["fixed_pattern_kurtosis", "all"] = float(np.log(((bulk**4).mean() + 1e-6) / (variance**2 + 1e-6)))

    def soft_count(sign: int, threshold: float, step: float) -> float:
        count = (1 / (1 + np.exp(-(sign * used / deviation - threshold) / step))).sum()
        return float(np.sqrt(count + 0.375))

    values["hot_pixels_6_sigma", "all"] = soft_count(1, 6.0, 0.5)
    values["hot_pixels_12_sigma", "all"] = soft_count(1, 12.0, 1.0)
    values["hot_pixels_48_sigma", "all"] = soft_count(1, 48.0, 4.0)
    if s.scene == "flat":
        values["cold_pixels_6_sigma", "all"] = soft_count(-1, 6.0, 0.5)
    values["fixed_pattern_correlation_x1", "all"] = covariance(pattern, s.mask, 1, 0) / variance
    values["fixed_pattern_correlation_y1", "all"] = covariance(pattern, s.mask, 0, 1) / variance
    values["fixed_pattern_wave", "all"] = prominence_of_strongest_wave(pattern)
    return values


def transform_size(size: int) -> int:
    """The largest even size with no prime factor above 5."""
    return max(
        2 * 2**a * 3**b * 5**c for a in range(13) for b in range(9) for c in range(6) if 2 * 2**a * 3**b * 5**c <= size
    )


def middle_power(images: Array) -> Array:
    """|F|^2 under a Hann window, of the middle of images whose sides are transform_size of theirs."""
    height, width = (transform_size(n) for n in images.shape[-2:])
    y, x = ((whole - part) // 2 for whole, part in zip(images.shape[-2:], (height, width), strict=True))
    windows = [0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(n) + 0.5) / n) for n in (height, width)]
    return np.abs(np.fft.fft2(images[..., y : y + height, x : x + width] * np.outer(*windows))) ** 2


def prominence_of_strongest_wave(pattern: Array) -> float:
    """How far the wave stands out that stands out most from its ring of |f|, or from the frequencies of whole rows or
    columns, under a Hann window: the normal score of the rarest of so many powers over their surroundings' means."""
    power = middle_power(pattern)
    height, width = power.shape
    row, column = (np.rint(np.fft.fftfreq(n) * n).astype(int) for n in (height, width))
    ky, kx = np.meshgrid(row, column, indexing="ij")
    ring = np.minimum(np.floor(np.hypot(ky / height, kx / width) / 0.7072 * 48), 47) // 4
    for k in (0, 1):
        ring[np.abs(ky) == k] = 14 + k
    for k in (0, 1):
        ring[np.abs(kx) == k] = 12 + k
    half = (kx > 0) | (kx == -width / 2) | ((kx == 0) & ((ky >= 0) | (ky == -height / 2)))
    usable = half & ((np.abs(kx) > 1) | (np.abs(ky) > 1))
    rarest = 0.0
    for k in range(16):
        part = power[usable & (ring == k)] + 1e-12
        if part.size:
            likely = np.exp(np.log(part).mean() + np.euler_gamma)
            others = part.size / (np.pi**2 / 6 * (35 / 18) ** (2 if k < 12 else 1))
            rarest = max(rarest, others * np.log1p(part.max() / likely / others))
    above = usable.sum() / 2.25 * np.exp(-rarest)  # of how many are expected so far out
    return -float(ndtri_exp(np.log(above) if above < 1e-12 else np.log(-np.expm1(-above))))


def share_above(s: Sequence, level: float, reach: float = np.inf) -> float:
    """Share of the codes above black + level, by a smooth step from 0.9 to 1.1 of the level, or `reach` to either side.

    Each code is spread evenly over its width: midpoints of 4,000 slices of each code that occurs.
    """
    reach = max(min(0.1 * level, reach), 0.5)
    codes, counts = np.unique(s.codes[:, s.mask], return_counts=True)
    places = codes.astype(np.float64)[:, None] - 0.5 + (np.arange(4000) + 0.5) / 4000
    t = np.clip((places - (s.black + level - reach)) / (2 * reach), 0.0, 1.0)
    return float((t**2 * (3 - 2 * t)).mean(axis=1) @ counts / counts.sum())


def levels(s: Sequence) -> Values:
    full = 2**s.bits - 1 - s.black
    values: Values = {}
    for percent in (25, 50, 75, 95):
        level = full * percent / 100
        values[f"share_above_{percent}_percent", "all"] = float(np.sqrt(share_above(s, level, full - level)))
    signal = np.maximum(s.signal[:, s.mask], 0.0) / full
    if s.scene == "flat" or s.moving:
        values["bright_end", "all"] = float(np.log((signal**16).mean() / (signal**8).mean()) / 8)
    return values


def intensity_law(s: Sequence) -> Values:
    u = (s.signal[:, s.mask] - s.mean_signal) / s.light
    second = (u**2).mean()
    values: Values = {
        ("intensity_skewness", "all"): float((u**3).mean() / (second + 1e-6) ** 1.5),
        ("intensity_kurtosis", "all"): float(np.log(((u**4).mean() + 1e-9) / (second**2 + 1e-9))),
    }
    for percent in (5, 10, 25, 50, 100, 200, 300, 400):
        values[f"intensity_below_{percent}_percent", "all"] = 1 - share_above(s, percent / 100 * s.light)
    return values


def speckle(s: Sequence) -> Values:
    if s.moving:
        images, gain, noise = s.residual, s.frames / (s.frames - 1), s.read_variance
    else:
        images, gain, noise = fit_field(s, s.mean, 4)[1][None], 1.0, s.read_variance / s.frames
    count = len(images)
    variance = float((images**2).sum() / (count * s.mask.sum()))
    values: Values = {("contrast", "all"): 0.5 * log_ratio((gain * variance - noise) / s.light**2, 1.0)}
    for lag in (1, 2, 3, 6):
        values[f"speckle_correlation_x{lag}", "all"] = covariance(images, s.mask, lag, 0) / variance
        values[f"speckle_correlation_y{lag}", "all"] = covariance(images, s.mask, 0, lag) / variance
    for lag in (1, 2):
        both = covariance(images, s.mask, lag, lag) + covariance(images, s.mask, -lag, lag)
        values[f"speckle_correlation_diagonal{lag}", "all"] = both / 2 / variance
    bins_y, bins_x = s.height // 4, s.width // 4

    def binned(array: NDArray) -> Array:
        cut = array[..., : 4 * bins_y, : 4 * bins_x].astype(np.float64)
        return cut.reshape(*array.shape[:-2], bins_y, 4, bins_x, 4).sum(axis=(-3, -1))

    sums, used = binned(images), binned(s.mask)
    for name, (low, high) in RING_BINS.items():
        product = pairs = 0.0
        for dy in range(-high, high + 1):
            for dx in range(-high, high + 1):
                if low**2 < dx**2 + dy**2 <= high**2:
                    here, there = shifted(sums, dx, dy)
                    product += float((here * there).sum()) / count
                    here, there = shifted(used, dx, dy)
                    pairs += float((here * there).sum())
        values[f"speckle_correlation_{name}", "all"] = product / pairs / variance
    for name, lag in (("speckle_lopsided_x", (1, 0)), ("speckle_lopsided_y", (0, 1))):
        a, b = shifted(images, *lag)
        here, there = shifted(s.mask, *lag)
        values[name, "all"] = float((a * b * (a - b)).sum() / (count * (here & there).sum()) / variance**1.5)
    values["speckle_binned_skewness", "all"] = float((sums**3).mean() / (sums**2).mean() ** 1.5)
    values.update(spectrum(s, images))
    if not s.moving:
        for name, axis in (("column_means", 0), ("row_means", 1)):
            used_lines = s.mask.sum(axis=axis)
            lines = np.divide(
                images[0].sum(axis=axis) ** 2, used_lines, out=np.zeros(used_lines.shape), where=used_lines > 0
            )
            values[name, "all"] = log_ratio(float(lines.mean()), variance)
        return values
    neighbours = {"centre": [], "edges": [], "corners": []}
    for k in range(9):
        inside = (s.region == k) & s.mask
        local = max(s.mean[inside].mean(), 0.1 * s.light)
        square = (images[:, inside] ** 2).sum()
        own = square / (count * inside.sum())
        values["contrast", f"r{k // 3}c{k % 3}"] = 0.5 * log_ratio(own / local**2, variance / s.light**2)
        right, down = (shifted(images, *lag) for lag in ((1, 0), (0, 1)))
        same, upper = (shifted(s.region == k, *lag) for lag in ((1, 0), (0, 1)))
        # Pairs along a row lie in the region with both pixels, pairs down a column with the upper one.
        product = (right[0] * right[1])[:, same[0] & same[1]].sum() + (down[0] * down[1])[:, upper[0]].sum()
        zone = "centre" if k == 4 else "edges" if k % 2 else "corners"
        neighbours[zone].append(product / 2 / square)
    for zone, own_values in neighbours.items():
        values["speckle_neighbour_correlation", zone] = float(np.mean(own_values))
    return values


def spectrum(s: Sequence, images: Array) -> Values:
    """Shares of the power in bands of |f| / cutoff, of at most four frames, under a Hann window."""
    count = min(len(images), 4)
    chosen = images[[k * len(images) // count for k in range(count)]]
    power = middle_power(chosen)
    height, width = power.shape[1:]
    fy, fx = np.abs(np.fft.fftfreq(height))[:, None], np.abs(np.fft.fftfreq(width))[None]
    usable = (fx * width > 1.5) | (fy * height > 1.5)
    band = np.minimum(np.floor(np.hypot(fx, fy) / s.cutoff * 6), 6)
    whole = power[:, usable].mean()
    values: Values = {}
    for k in (0, 1, 3, 4, 5):
        values[f"power_band_{k}", "all"] = float(np.log(power[:, usable & (band == k)].mean() / whole + 1e-6))
    if s.cutoff < 0.68:
        values["power_beyond_cutoff", "all"] = float(np.log(power[:, usable & (band == 6)].mean() / whole + 1e-6))
    direction = power[:, usable & (fx > fy)].sum() / power[:, usable & (fx < fy)].sum()
    values["power_direction", "all"] = float(np.log(direction))
    peaks, modes = 0.0, 0
    ring = np.minimum(np.floor(np.hypot(fx, fy) / 0.7072 * 48), 47)
    for k in range(48):
        part = power[:, usable & (ring == k)]
        if part.size:
            peaks += (part**2).sum() / part.mean() ** 2 / 2
            modes += part.size
    values["power_lines", "all"] = float(np.log(peaks / modes))
    return values


def static_scene(s: Sequence) -> Values:
    values: Values = {}
    level = s.mean / s.light
    edges = [-np.inf, 0.3, 1.0, 2.5, np.inf]
    names = ("below_0.3_mean", "0.3_to_1_mean", "1_to_2.5_mean", "above_2.5_mean")
    for name, low, high in zip(names, edges[:-1], edges[1:], strict=True):
        inside = s.mask & (level >= low) & (level < high)
        values["temporal_variance", name] = log_ratio(float(s.variance[inside].mean()), s.read_variance)
    right, down = np.zeros_like(level), np.zeros_like(level)
    right[:, 1:-1] = (level[:, 2:] - level[:, :-2]) / 2
    down[1:-1] = (level[2:] - level[:-2]) / 2
    inner = np.zeros_like(s.mask)
    inner[1:-1, 1:-1] = s.mask[1:-1, 1:-1] & s.mask[1:-1, 2:] & s.mask[1:-1, :-2] & s.mask[2:, 1:-1] & s.mask[:-2, 1:-1]
    root = 1 / (1 + np.maximum(level[inner], 0.0)) ** 2
    terms = np.stack([np.ones_like(level), level, level**2, right**2 + down**2], axis=-1)[inner]
    fit = np.linalg.lstsq(terms * root[:, None], s.variance[inner] * root, rcond=None)[0] / s.read_variance
    for name, value in zip(("linear", "square", "gradient"), fit[1:], strict=True):
        values[f"temporal_variance_{name}", "all"] = float(np.arcsinh(value))
    right, down = right * s.light, down * s.light
    motions = {
        "image_shift_x": right,
        "image_shift_y": down,
        "image_turn": s.x * down - s.y * right,
        "image_breathing": s.x * right + s.y * down,
    }
    for name, derivative in motions.items():
        shape = np.where(inner, derivative, 0.0)
        information = (shape**2).sum()
        amount = (s.residual * shape).sum(axis=(1, 2)) / information
        values[name, "all"] = log_ratio(float((amount**2).mean() * information), s.pixel_variance)
    return values


def sequence_level(codes: NDArray[np.uint16]) -> tuple[float, float]:
    """Mean and temporal noise of the pixels, rows, columns and frames taken out; of Gaussian frames."""
    e = codes.astype(np.float64)
    mean = e.mean()
    e = e - e.mean(axis=0)
    e = e - e.mean(axis=2, keepdims=True) - e.mean(axis=1, keepdims=True) + e.mean(axis=(1, 2), keepdims=True)
    frames, height, width = e.shape
    return float(mean), float(np.sqrt((e**2).sum() / ((frames - 1) * (height - 1) * (width - 1))))


def compute(s: Sequence) -> Values:
    """All of them but those of the dots' shape."""
    values = temporal_noise(s) | repetition(s) | code_lattice(s) | blocks(s) | field(s)
    if s.scene in ("dark", "flat"):
        return values | fixed_pattern(s)
    values |= levels(s)
    if s.scene == "board":
        values |= intensity_law(s) | speckle(s)
    return values | (static_scene(s) if not s.moving else {})
