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


def crosstalk(signal: Stack, fraction: float) -> Stack:
    """A fraction goes to the four neighbours in equal parts; what would leave at the border comes back from there."""
    padded = np.pad(signal, ((0, 0), (1, 1), (1, 1)), mode="edge")
    neighbours = padded[:, :-2, 1:-1] + padded[:, 2:, 1:-1] + padded[:, 1:-1, :-2] + padded[:, 1:-1, 2:]
    return (1 - fraction) * signal + fraction / 4 * neighbours


def pixel_gain(camera: Camera, effects: Effects, seed: int) -> Image | None:
    """Factors on the signal, the same in all sequences."""
    gain = np.ones(camera.shape)
    if "prnu" in effects:
        gain = gain * (1 + effects["prnu"]["sigma"] * stream(seed, "prnu").standard_normal(camera.shape))
    if "bayer_mismatch" in effects:
        gain[0::2, 1::2] *= 1 - effects["bayer_mismatch"]["delta"]
        gain[1::2, 0::2] *= 1 + effects["bayer_mismatch"]["delta"]
    if "odd_even_row_gain" in effects:  # two read-out chains, one for the even, one for the odd rows
        gain[0::2] *= 1 - effects["odd_even_row_gain"]["delta"]
        gain[1::2] *= 1 + effects["odd_even_row_gain"]["delta"]
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
        offsets += hot * rng.exponential(effects["hot_pixels"]["mean_dn"], camera.shape)
    return offsets


def temporal_offsets(camera: Camera, name: str, effects: Effects, frames: int, seed: int) -> Stack:
    """DN that are new in each frame, without the read noise: broadcasts to (frames, height, width)."""
    offsets: Stack = np.zeros((1, 1, 1))
    if "row_noise" in effects:
        rows = stream(seed, name, "row_noise").standard_normal((frames, camera.height, 1))
        offsets = offsets + effects["row_noise"]["sigma_dn"] * rows
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


def record(camera: Camera, sequence: Sequence, light: Stack, effects: Effects, frames: int, seed: int) -> Codes:
    """Codes (frames, height, width) of the light, which is (1 or frames or, with lag, frames + 1, height, width)."""
    name = sequence.name
    signal = camera.gain_dn(sequence.scene) * light
    if "ambient_light" in effects and sequence.scene != "dark":
        signal = signal + effects["ambient_light"]["level_dn"]
    if "crosstalk" in effects:
        signal = crosstalk(signal, effects["crosstalk"]["fraction"])
    gain = pixel_gain(camera, effects, seed)
    if gain is not None:
        signal = np.maximum(signal * gain, 0)
    if "shot_noise" in effects and sequence.scene != "dark":
        k = effects["shot_noise"]["dn_per_electron"]
        exposures = frames + ("image_lag" in effects)
        mean = np.broadcast_to(signal / k, (exposures, *camera.shape))
        signal = k * stream(seed, name, "shot_noise").poisson(mean)
    if "image_lag" in effects and len(signal) > 1:  # light[0] is what the sensor saw before the first frame
        f = effects["image_lag"]["fraction"]
        signal = (1 - f) * signal[1:] + f * signal[:-1]
    if "charge_transfer_smear" in effects:
        signal = transfer_smear(signal, effects["charge_transfer_smear"]["fraction"])
    if "column_smear" in effects:  # a frame-transfer sensor sees the scene while it shifts its columns
        signal = signal + effects["column_smear"]["fraction"] * signal.mean(axis=-2, keepdims=True)
    if "full_well" in effects:
        signal = np.minimum(signal, effects["full_well"]["level_dn"])
    if "gamma" in effects:
        signal = camera.full_dn * (np.maximum(signal, 0) / camera.full_dn) ** effects["gamma"]["gamma"]
    noise = camera.read_noise_dn * stream(seed, name, "read_noise").standard_normal((frames, *camera.shape))
    analog = signal + camera.black_dn + noise
    if effects.keys() & {"dsnu", "column_fpn", "hot_pixels"}:
        analog += fixed_offsets(camera, effects, seed)
    if effects.keys() & {"row_noise", "telegraph_noise"}:
        analog += temporal_offsets(camera, name, effects, frames, seed)
    if "adc_bits" in effects:
        step = 2.0 ** (camera.bits - effects["adc_bits"]["bits"])
        codes = np.clip(np.round(analog / step), 0, (camera.full_dn + 1) / step - 1) * step
    else:
        codes = np.clip(np.round(analog), 0, camera.full_dn)
    return process(camera, name, codes, effects, seed)


def process(camera: Camera, name: str, codes: Stack, effects: Effects, seed: int) -> Codes:
    """What the camera's processor does to finished codes."""
    if "median_denoising" in effects:
        weight = effects["median_denoising"]["weight"]
        codes = np.round((1 - weight) * codes + weight * scipy.ndimage.median_filter(codes, size=(1, 3, 3)))
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
