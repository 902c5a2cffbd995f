"""From the intensity to the codes: gains, photons, lag, the converter, fixed patterns, and the camera's processing."""

from __future__ import annotations

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


def crosstalk(signal: Stack, fraction: float, border: str = "border") -> Stack:
    """A fraction goes to the four neighbours in equal parts; what would leave at the border comes back from there."""
    padded = np.pad(signal, ((0, 0), (1, 1), (1, 1)), mode="edge" if border == "border" else "wrap")
    neighbours = padded[:, :-2, 1:-1] + padded[:, 2:, 1:-1] + padded[:, 1:-1, :-2] + padded[:, 1:-1, 2:]
    return (1 - fraction) * signal + fraction / 4 * neighbours


def pixel_gain(camera: Camera, effects: Effects, seed: int) -> Image | None:
    """Factors on the signal, the same in all sequences."""
    gain = np.ones(camera.shape)
    if "prnu" in effects:
        gain = gain * (1 + effects["prnu"]["sigma"] * stream(seed, "prnu").standard_normal(camera.shape))
    if "bayer_mismatch" in effects:
        d = effects["bayer_mismatch"]["delta"]
        if camera.readings.bayer_mismatch == "main_diagonal":
            gain[0::2, 0::2] *= 1 - d
            gain[1::2, 1::2] *= 1 + d
        else:
            d = d if camera.readings.bayer_mismatch == "odd_even" else -d
            gain[0::2, 1::2] *= 1 - d
            gain[1::2, 0::2] *= 1 + d
    if "odd_even_row_gain" in effects:  # two read-out chains, one for the even, one for the odd rows
        gain[0::2] *= 1 - effects["odd_even_row_gain"]["delta"]
        gain[1::2] *= 1 + effects["odd_even_row_gain"]["delta"]
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
    if "hot_pixels" in effects:
        rng = stream(seed, "hot_pixels")
        hot = rng.random(camera.shape) < effects["hot_pixels"]["fraction"]
        height = {
            "exponential": rng.exponential(1.0, camera.shape),
            "constant": np.ones(camera.shape),
            "uniform": rng.uniform(0.0, 2.0, camera.shape),
        }[camera.readings.hot_pixels]
        offsets += hot * effects["hot_pixels"]["mean_dn"] * height
    if "dark_shading" in effects:  # the amplifier in a corner glows
        y, x = np.mgrid[0 : camera.height, 0 : camera.width]
        offsets += effects["dark_shading"]["corner_dn"] * np.exp(-np.hypot(x, y) / (0.4 * camera.corner_px))
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
    if "telegraph_noise" in effects:  # one trap: the pixel's offset jumps between two values, staying for some frames
        setting = effects["telegraph_noise"]
        where = np.flatnonzero(stream(seed, "telegraph_noise").random(camera.shape) < setting["fraction"])
        rng = stream(seed, name, "telegraph_noise")
        jumps = rng.random((frames, where.size)) < 0.3
        state = (np.cumsum(jumps, axis=0) + rng.integers(0, 2, where.size)) % 2
        telegraph = np.zeros((frames, camera.height * camera.width))
        telegraph[:, where] = setting["step_dn"] * (state - 0.5)
        offsets = offsets + telegraph.reshape(frames, *camera.shape)
    return offsets


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


def clip_at_well(signal: Stack, effects: Effects) -> Stack:
    return np.minimum(signal, effects["full_well"]["level_dn"]) if "full_well" in effects else signal


def bend(camera: Camera, signal: Stack, effects: Effects) -> Stack:
    """full (signal / full)^gamma."""
    if "gamma" not in effects:
        return signal
    return camera.full_dn * (np.maximum(signal, 0) / camera.full_dn) ** effects["gamma"]["gamma"]


def record(camera: Camera, sequence: Sequence, light: Stack, effects: Effects, frames: int, seed: int) -> Codes:
    """Codes (frames, height, width) of the light, which is (1 or frames or, with lag, frames + 1, height, width)."""
    name = sequence.name
    signal = camera.gain_dn(sequence.scene) * light
    readings = camera.readings
    if "ambient_light" in effects and sequence.scene != "dark":
        signal = signal + effects["ambient_light"]["level_dn"]
    if "crosstalk" in effects:
        signal = crosstalk(signal, effects["crosstalk"]["fraction"], readings.crosstalk)
    gain = pixel_gain(camera, effects, seed)
    if gain is not None:
        signal = np.maximum(signal * gain, 0)
    if readings.full_well == "before_photons":
        signal = clip_at_well(signal, effects)
    if readings.gamma == "before_photons":
        signal = bend(camera, signal, effects)
    if "shot_noise" in effects and sequence.scene != "dark":
        k = effects["shot_noise"]["dn_per_electron"]
        exposures = frames + ("image_lag" in effects)
        smooth = 0.0
        if "ambient_light" in effects and readings.ambient_light == "smooth":
            smooth = effects["ambient_light"]["level_dn"]
        mean = np.broadcast_to(np.maximum(signal - smooth, 0) / k, (exposures, *camera.shape))
        rng = stream(seed, name, "shot_noise")
        if readings.shot_noise == "poisson":
            signal = k * rng.poisson(mean) + smooth
        else:
            signal = k * np.maximum(mean + np.sqrt(mean) * rng.standard_normal(mean.shape), 0) + smooth
    if "image_lag" in effects and len(signal) > 1:  # light[0] is what the sensor saw before the first frame
        f = effects["image_lag"]["fraction"]
        if readings.image_lag == "recursive":
            signal = signal.copy()
            for t in range(1, len(signal)):
                signal[t] = (1 - f) * signal[t] + f * signal[t - 1]
            signal = signal[1:]
        else:
            signal = (1.0 if readings.image_lag == "added" else 1 - f) * signal[1:] + f * signal[:-1]
    if "charge_transfer_smear" in effects:
        signal = transfer_smear(signal, effects["charge_transfer_smear"]["fraction"])
    if "column_smear" in effects:  # a frame-transfer sensor sees the scene while it shifts its columns
        signal = signal + effects["column_smear"]["fraction"] * signal.mean(axis=-2, keepdims=True)
    if readings.full_well == "after_photons":
        signal = clip_at_well(signal, effects)
    if readings.gamma == "after_photons":
        signal = bend(camera, signal, effects)
    noise = camera.read_noise_dn * stream(seed, name, "read_noise").standard_normal((frames, *camera.shape))
    analog = signal + camera.black_dn + noise
    if effects.keys() & {"dsnu", "column_fpn", "hot_pixels", "dark_shading"}:
        analog += fixed_offsets(camera, effects, seed)
    if effects.keys() & {"row_noise", "telegraph_noise", "column_noise", "interference", "black_level_drift"}:
        analog += temporal_offsets(camera, name, effects, frames, seed)
    if "converter_ripple" in effects:  # integral nonlinearity of a folding converter
        analog += effects["converter_ripple"]["amplitude_dn"] * np.sin(2 * np.pi * analog / 96)
    if "adc_bits" in effects:
        step = 2.0 ** (camera.bits - effects["adc_bits"]["bits"])
        multiple = np.round(analog / step) if readings.adc_bits == "nearest" else np.floor(np.round(analog) / step)
        codes = np.clip(multiple, 0, (camera.full_dn + 1) / step - 1) * step
    else:
        codes = np.clip(np.round(analog), 0, camera.full_dn)
    return process(camera, name, codes, effects, seed)


def process(camera: Camera, name: str, codes: Stack, effects: Effects, seed: int) -> Codes:
    """What the camera's processor does to finished codes."""
    if "median_denoising" in effects:
        weight = effects["median_denoising"]["weight"]
        codes = np.round((1 - weight) * codes + weight * scipy.ndimage.median_filter(codes, size=(1, 3, 3)))
    if "sharpening" in effects:
        blurred = scipy.ndimage.uniform_filter(codes, size=(1, 3, 3))
        codes = np.round(codes + effects["sharpening"]["amount"] * (codes - blurred))
    if "temporal_denoising" in effects:
        weight = effects["temporal_denoising"]["weight"]
        for t in range(1, len(codes)):
            codes[t] = np.round((1 - weight) * codes[t] + weight * codes[t - 1])
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
