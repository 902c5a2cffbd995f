"""From the intensity to the codes: gains, photons, lag, the converter, fixed patterns, and the camera's processing."""

from __future__ import annotations

from typing import Literal

import numpy as np
import scipy.fft
import scipy.ndimage
from numpy.typing import NDArray

from .camera import Camera, Sequence, stream
from .effects import Effects
from .light import Stack
from .scene import Image

Codes = NDArray[np.uint16]

# The luminance table of JPEG (ITU-T T.81, table K.1), whose shape block compression scales.
JPEG_LUMINANCE = np.array(
    [
        [16, 11, 10, 16, 24, 40, 51, 61],
        [12, 12, 14, 19, 26, 58, 60, 55],
        [14, 13, 16, 24, 40, 57, 69, 56],
        [14, 17, 22, 29, 51, 87, 80, 62],
        [18, 22, 37, 56, 68, 109, 103, 77],
        [24, 35, 55, 64, 81, 104, 113, 92],
        [49, 64, 78, 87, 103, 121, 120, 101],
        [72, 92, 95, 98, 112, 100, 103, 99],
    ],
    float,
)

# Row and column of the brighter one of two sites on a diagonal, in each 2 x 2 pixels.
BRIGHTER_SITE = {"odd_even": (1, 0), "even_odd": (0, 1), "main_diagonal": (1, 1)}


def crosstalk(signal: Stack, fraction: float, leaving: Literal["border", "periodic"] = "border") -> Stack:
    """A fraction goes to the four neighbours in equal parts; what would leave at the border comes back from there.

    Another reading: it comes in from the other side.
    """
    padded = np.pad(signal, ((0, 0), (1, 1), (1, 1)), mode="edge" if leaving == "border" else "wrap")
    neighbours = padded[:, :-2, 1:-1] + padded[:, 2:, 1:-1] + padded[:, 1:-1, :-2] + padded[:, 1:-1, 2:]
    return (1 - fraction) * signal + fraction / 4 * neighbours


def pixel_gain(camera: Camera, effects: Effects, seed: int) -> Image | None:
    """Factors on the signal, the same in all sequences."""
    gain = np.ones(camera.shape)
    if "prnu" in effects:
        gain = gain * (1 + effects["prnu"]["sigma"] * stream(seed, "prnu").standard_normal(camera.shape))
    if "column_gain" in effects:
        columns = stream(seed, "column_gain").standard_normal(camera.width)
        gain = gain * (1 + effects["column_gain"]["sigma"] * columns)
    if "row_gain" in effects:
        rows = stream(seed, "row_gain").standard_normal((camera.height, 1))
        gain = gain * (1 + effects["row_gain"]["sigma"] * rows)
    if "bayer_mismatch" in effects:
        row, column = BRIGHTER_SITE[camera.readings.bayer_mismatch]
        gain[row::2, column::2] *= 1 + effects["bayer_mismatch"]["delta"]
        gain[1 - row :: 2, 1 - column :: 2] *= 1 - effects["bayer_mismatch"]["delta"]
    if "odd_even_row_gain" in effects:  # two read-out chains, one for the even, one for the odd rows
        gain[0::2] *= 1 - effects["odd_even_row_gain"]["delta"]
        gain[1::2] *= 1 + effects["odd_even_row_gain"]["delta"]
    if "pixel_dull" in effects:  # at least one of them
        rng = stream(seed, "pixel_dull")
        count = max(1, round(effects["pixel_dull"]["fraction"] * gain.size))
        gain.flat[rng.choice(gain.size, count, replace=False)] *= rng.uniform(0.7, 1.0, count)
    if "dead_pixels" in effects:  # they see nothing
        gain[stream(seed, "dead_pixels").random(camera.shape) < effects["dead_pixels"]["fraction"]] = 0.0
    return None if np.all(gain == 1) else gain


def fixed_offsets(camera: Camera, effects: Effects, seed: int) -> Image:
    """DN on every frame of all sequences."""
    offsets = np.zeros(camera.shape)
    if "dsnu" in effects:
        offsets += effects["dsnu"]["sigma_dn"] * stream(seed, "dsnu").standard_normal(camera.shape)
    if "column_fpn" in effects:
        offsets += effects["column_fpn"]["sigma_dn"] * stream(seed, "column_fpn").standard_normal(camera.width)
    if "row_fpn" in effects:
        offsets += effects["row_fpn"]["sigma_dn"] * stream(seed, "row_fpn").standard_normal((camera.height, 1))
    if "periodic_offset" in effects:
        wave = effects["periodic_offset"]
        y, x = np.mgrid[0 : camera.height, 0 : camera.width]
        turns = wave["frequency_x"] * x + wave["frequency_y"] * y
        phase = stream(seed, "periodic_offset").uniform(0, 2 * np.pi)
        offsets += wave["amplitude_dn"] * np.sin(2 * np.pi * turns + phase)
    if "hot_pixels" in effects:
        rng = stream(seed, "hot_pixels")
        hot = rng.random(camera.shape) < effects["hot_pixels"]["fraction"]
        height = np.ones(camera.shape)
        if camera.readings.hot_pixels == "exponential":
            height = rng.exponential(1.0, camera.shape)
        elif camera.readings.hot_pixels == "uniform":
            height = rng.uniform(0.0, 2.0, camera.shape)
        offsets += hot * effects["hot_pixels"]["mean_dn"] * height
    if "dark_shading" in effects:  # the amplifier in a corner glows
        y, x = np.mgrid[0 : camera.height, 0 : camera.width]
        offsets += effects["dark_shading"]["corner_dn"] * np.exp(
            -np.hypot(x - camera.border_px, y - camera.border_px) / (0.4 * camera.corner_px)
        )
    return offsets


def temporal_offsets(camera: Camera, name: str, effects: Effects, frames: int, seed: int) -> Stack:
    """DN that are new in each frame, without the read noise: broadcasts to (frames, height, width)."""
    offsets: Stack = np.zeros((1, 1, 1))
    if "row_noise" in effects:
        rows = stream(seed, name, "row_noise").standard_normal((frames, camera.height, 1))
        offsets = offsets + effects["row_noise"]["sigma_dn"] * rows
    if "column_noise" in effects:  # the column amplifiers' noise is sampled once a frame
        columns = stream(seed, name, "column_noise").standard_normal((frames, 1, camera.width))
        offsets = offsets + effects["column_noise"]["sigma_dn"] * columns
    if "interference" in effects:  # a switching regulator couples in: a wave whose phase is new in each frame
        phase = stream(seed, name, "interference").uniform(0, 2 * np.pi, (frames, 1, 1))
        y, x = np.mgrid[0 : camera.height, 0 : camera.width]
        wave = np.sin(2 * np.pi * (0.061 * x + 0.013 * y) + phase)
        offsets = offsets + effects["interference"]["amplitude_dn"] * wave
    if "black_level_drift" in effects:  # the sensor warms up
        t = np.arange(frames)[:, None, None] / max(frames - 1, 1) - 0.5
        offsets = offsets + effects["black_level_drift"]["total_dn"] * t
    if "telegraph_noise" in effects:  # one trap: the pixel's offset jumps between two values
        setting = effects["telegraph_noise"]
        where = np.flatnonzero(stream(seed, "telegraph_noise").random(camera.shape) < setting["fraction"])
        rng = stream(seed, name, "telegraph_noise")
        reading = camera.readings.telegraph_noise
        jumps = rng.random((frames, where.size)) < (0.3 if reading == "slow" else 0.5)
        state = (np.cumsum(jumps, axis=0) + rng.integers(0, 2, where.size)) % 2
        telegraph = np.zeros((frames, camera.height * camera.width))
        telegraph[:, where] = setting["step_dn"] * (state - (0.5 if reading == "centered" else 0.0))
        offsets = offsets + telegraph.reshape(frames, *camera.shape)
    return offsets


def read_noise(camera: Camera, name: str, effects: Effects, frames: int, seed: int) -> Stack:
    """Gaussian noise of variance 1 (frames, height, width).

    A correlation r is that of neighbours in a row alone: white noise with the spectrum 1 + 2 r cos(2 pi f).
    """
    rng = stream(seed, name, "read_noise")
    if "correlated_read_noise" not in effects:
        return rng.standard_normal((frames, *camera.shape))
    # One column more, so that the spectrum's period joins none of the image's borders.
    white = rng.standard_normal((frames, camera.height, camera.width + 1))
    turns = np.fft.rfftfreq(camera.width + 1)
    spectrum = 1 + 2 * effects["correlated_read_noise"]["correlation"] * np.cos(2 * np.pi * turns)
    colored = np.fft.irfft(np.fft.rfft(white) * np.sqrt(np.maximum(spectrum, 0)), camera.width + 1)
    return colored[..., :-1]


def transfer_smear(signal: Stack, fraction: float) -> Stack:
    """Charge left behind at each transfer trails to the right: y[x] = (1 - f) s[x] + f y[x - 1]."""
    trailed = np.empty_like(signal)
    trailed[..., 0] = signal[..., 0]
    for x in range(1, signal.shape[-1]):
        trailed[..., x] = (1 - fraction) * signal[..., x] + fraction * trailed[..., x - 1]
    return trailed


def compress_blocks(codes: Stack, step_dn: float) -> Stack:
    """8 x 8 cosine transform, coefficients rounded to multiples of JPEG's table scaled to a mean step, back."""
    frames, height, width = codes.shape
    padded = np.pad(codes, ((0, 0), (0, -height % 8), (0, -width % 8)), mode="edge")
    blocks = padded.reshape(frames, padded.shape[1] // 8, 8, padded.shape[2] // 8, 8)
    steps = (step_dn * JPEG_LUMINANCE / JPEG_LUMINANCE.mean())[:, None, :]
    coefficients = scipy.fft.dctn(blocks, axes=(2, 4), norm="ortho")
    blocks = scipy.fft.idctn(np.round(coefficients / steps) * steps, axes=(2, 4), norm="ortho")
    return np.round(blocks.reshape(padded.shape)[:, :height, :width])


def respond(camera: Camera, signal: Stack, effects: Effects, when: Literal["before_photons", "after_photons"]) -> Stack:
    """The well, min(signal, level), and the curves, full (signal / full)^gamma and signal (1 - c (signal / full)^3).

    They stand where their readings have them. What the converter clips bends no further.
    """
    if "full_well" in effects and camera.readings.full_well == when:
        signal = np.minimum(signal, effects["full_well"]["level_dn"])
    if "nonlinearity" in effects and camera.readings.nonlinearity == when:
        bend = np.clip(signal / camera.full_dn, 0, 1) ** 3
        signal = signal * (1 - effects["nonlinearity"]["cubic"] * bend)
    if "gamma" in effects and camera.readings.gamma == when:
        signal = camera.full_dn * (np.maximum(signal, 0) / camera.full_dn) ** effects["gamma"]["gamma"]
    return signal


def photon_noise(camera: Camera, mean: Stack, dn_per_electron: float, rng: np.random.Generator) -> Stack:
    """Signals in DN whose electrons have Poisson's law, or by another reading the Gaussian one of the same variance."""
    electrons = mean / dn_per_electron
    drawn: Stack
    if camera.readings.shot_noise == "poisson":
        drawn = rng.poisson(electrons).astype(np.float64)
    else:
        drawn = electrons + np.sqrt(electrons) * rng.standard_normal(electrons.shape)
        drawn[drawn < 0] = 0
    return dn_per_electron * drawn


def lagged(camera: Camera, signal: Stack, fraction: float) -> Stack:
    """y(t) = (1 - f) x(t) + f x(t - 1), and other readings; signal[0] is what was seen before the first frame.

    A scene that rests has one frame, which is its own past.
    """
    reading = camera.readings.image_lag
    if len(signal) == 1:
        return (1 + fraction) * signal if reading == "added" else signal
    if reading == "recursive":
        kept = signal.copy()
        for t in range(1, len(kept)):
            kept[t] = (1 - fraction) * kept[t] + fraction * kept[t - 1]
        return kept[1:]
    return (1.0 if reading == "added" else 1 - fraction) * signal[1:] + fraction * signal[:-1]


def between_levels(analog: Stack, wave: dict[str, float], seed: int) -> Stack:
    """What a converter with even levels would round to the codes of one whose code n is 1 + a cos(2 pi (n - m) / p)
    wide.

    Its levels are the sums of the widths; between two of them a value keeps its share of the way.
    """
    widest = stream(seed, "differential_nonlinearity").uniform(0, wave["period_codes"])
    codes = np.arange(int(np.floor(analog.min())) - 2, int(np.ceil(analog.max())) + 3)
    turns = (codes - widest) / wave["period_codes"]
    width = 1 + wave["amplitude_lsb"] * np.cos(2 * np.pi * turns)
    levels = codes[0] - 0.5 + np.concatenate([[0.0], np.cumsum(width)])
    levels += np.mean(codes - 0.5 - levels[:-1])  # no offset of its own
    return np.interp(analog, levels, np.append(codes - 0.5, codes[-1] + 0.5))


def record(camera: Camera, sequence: Sequence, light: Stack, effects: Effects, frames: int, seed: int) -> Codes:
    """Codes (frames, height, width) of the light, which is (1 or frames or, with lag, frames + 1, height, width)."""
    name = sequence.name
    signal = camera.gain_dn(sequence) * light
    ambient = effects["ambient_light"]["level_dn"] if "ambient_light" in effects and sequence.scene != "dark" else 0.0
    if ambient:
        signal = signal + ambient
    if "crosstalk" in effects:
        signal = crosstalk(signal, effects["crosstalk"]["fraction"], camera.readings.crosstalk)
    noisy: Stack | float = 1.0  # the part of the signal that has photon noise
    if ambient and camera.readings.ambient_light == "smooth":
        noisy = np.maximum(1 - ambient / signal, 0)
    gain = pixel_gain(camera, effects, seed)
    if gain is not None:
        signal = np.maximum(signal * gain, 0)
    signal = respond(camera, signal, effects, "before_photons")
    if "shot_noise" in effects and sequence.scene != "dark":
        exposures = frames + ("image_lag" in effects)
        mean = np.broadcast_to(signal * noisy, (exposures, *camera.shape))
        k = effects["shot_noise"]["dn_per_electron"]
        signal = photon_noise(camera, mean, k, stream(seed, name, "shot_noise")) + signal * (1 - noisy)
    if "image_lag" in effects:
        signal = lagged(camera, signal, effects["image_lag"]["fraction"])
    if "charge_transfer_smear" in effects:
        signal = transfer_smear(signal, effects["charge_transfer_smear"]["fraction"])
    if "column_smear" in effects:  # a frame-transfer sensor sees the scene while it shifts its columns
        signal = signal + effects["column_smear"]["fraction"] * signal.mean(axis=-2, keepdims=True)
    if "dark_current" in effects:  # electrons that no light made; what one of them is in DN, photon noise says
        charge = effects["dark_current"]["rate_dn_per_ms"] * sequence.exposure_ms
        if "shot_noise" in effects:
            mean = np.full((frames, *camera.shape), charge)
            k = effects["shot_noise"]["dn_per_electron"]
            signal = signal + photon_noise(camera, mean, k, stream(seed, name, "dark_current"))
        else:
            signal = signal + charge
    signal = respond(camera, signal, effects, "after_photons")
    noise = camera.read_noise_dn * read_noise(camera, name, effects, frames, seed)
    analog = signal + camera.black_dn + noise
    if effects.keys() & {"dsnu", "column_fpn", "row_fpn", "periodic_offset", "hot_pixels", "dark_shading"}:
        analog += fixed_offsets(camera, effects, seed)
    if effects.keys() & {"row_noise", "telegraph_noise", "column_noise", "interference", "black_level_drift"}:
        analog += temporal_offsets(camera, name, effects, frames, seed)
    if "converter_ripple" in effects:  # integral nonlinearity of a folding converter
        analog += effects["converter_ripple"]["amplitude_dn"] * np.sin(2 * np.pi * analog / 96)
    if "differential_nonlinearity" in effects:  # the levels at which the code changes lie off by a wave
        analog = between_levels(analog, effects["differential_nonlinearity"], seed)
    if "adc_bits" in effects:
        step = 2.0 ** (camera.bits - effects["adc_bits"]["bits"])
        down = camera.readings.adc_bits == "down"
        multiple = np.floor(np.round(analog) / step) if down else np.round(analog / step)
        codes = np.clip(multiple, 0, (camera.full_dn + 1) / step - 1) * step
    else:
        codes = np.clip(np.round(analog), 0, camera.full_dn)
    return process(camera, name, codes, effects, seed)


def process(camera: Camera, name: str, codes: Stack, effects: Effects, seed: int) -> Codes:
    """What the camera's processor does to finished codes."""
    if "median_denoising" in effects:
        weight = effects["median_denoising"]["weight"]
        codes = np.round((1 - weight) * codes + weight * scipy.ndimage.median_filter(codes, size=(1, 3, 3)))
    if "sharpening" in effects:  # an unsharp mask
        blurred = scipy.ndimage.uniform_filter(codes, size=(1, 3, 3))
        codes = np.round(codes + effects["sharpening"]["amount"] * (codes - blurred))
    if "temporal_denoising" in effects:  # what is shown is blended with what was shown before
        weight = effects["temporal_denoising"]["weight"]
        codes = codes.copy()
        for frame in range(1, len(codes)):
            codes[frame] = np.round((1 - weight) * codes[frame] + weight * codes[frame - 1])
    if "block_compression" in effects:
        codes = compress_blocks(codes, effects["block_compression"]["step_dn"])
    result = np.clip(codes, 0, camera.full_dn).astype(np.uint16)
    if "frame_repeats" in effects:  # a full buffer: the driver hands out the frame before again
        late = stream(seed, name, "frame_repeats").random(len(result)) < effects["frame_repeats"]["fraction"]
        if len(late) > 1 and not late[1:].any():
            late[len(late) // 2] = True
        for t in np.flatnonzero(late):
            if t:
                result[t] = result[t - 1]
    return result
