"""From the ideal image to the intensity on the sensor: fields, the pupil, polarization, lines, motion, the lens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.fft
import scipy.ndimage
from numpy.typing import NDArray

from .camera import Camera, Sequence, stream
from .effects import Effects
from .scene import Image, pixel_grid, smooth_noise, spread

Stack = NDArray[np.float64]
Field = NDArray[np.complex128]


def squared_modulus(v: Field) -> Stack:
    """|v|^2 without the square root that np.abs takes."""
    return v.real**2 + v.imag**2


LINES = np.arange(-2, 3)
LINE_WEIGHTS = np.exp(-(LINES**2) / 2) / np.exp(-(LINES**2) / 2).sum()
AIRFLOW_CORRELATION_FRAMES = 5.0


def pupil(camera: Camera, effects: Effects) -> Field:
    """P(fx, fy) in the order of the FFT, mean of |P|^2 = 1."""
    fy, fx = np.fft.fftfreq(camera.height)[:, None], np.fft.fftfreq(camera.width)[None, :]
    diameter = camera.diameter
    if "aperture_mismatch" in effects:
        diameter /= effects["aperture_mismatch"]["f_number_ratio"]
    along_x = effects["elliptical_pupil"]["axis_ratio"] if "elliptical_pupil" in effects else 1.0
    rho2 = ((fx / along_x) ** 2 + fy**2) / (diameter / 2) ** 2  # rho = 1 at the rim
    inside = rho2 < 1
    if "pupil_obstruction" in effects:
        inside &= rho2 >= effects["pupil_obstruction"]["radius_ratio"] ** 2
    amplitude = inside.astype(np.complex128)
    if "defocus" in effects:
        sign = 1 if camera.readings.defocus == "far" else -1
        amplitude *= np.exp(sign * 2j * np.pi * effects["defocus"]["waves"] * rho2)
    u = fx / along_x / (diameter / 2)  # rho cos(theta)
    if "coma" in effects:  # Zernike's: (3 rho^3 - 2 rho) cos(theta)
        amplitude *= np.exp(2j * np.pi * effects["coma"]["waves"] * (3 * rho2 - 2) * u)
    if "astigmatism" in effects:  # one of the two line foci is on the sensor; halfway, spots are nearly a defocus's
        amplitude *= np.exp(2j * np.pi * effects["astigmatism"]["waves"] * u * u)
    if "window_double_image" in effects:  # a window's second reflection: a coherent, displaced copy of the field
        dx, dy = 4.0, 1.5
        amplitude *= 1 + effects["window_double_image"]["amplitude"] * np.exp(-2j * np.pi * (fx * dx + fy * dy))
    return amplitude / np.sqrt(np.mean(np.abs(amplitude) ** 2))


def pixel_transfer(f: NDArray[Any], side_px: float, points: int | None) -> NDArray[Any]:
    """What a pixel's side does along one axis: its integral, or the mean of so many points of it."""
    if points is None:
        return np.asarray(np.sinc(side_px * f))
    offsets = side_px * ((np.arange(points) + 0.5) / points - 0.5)
    return np.asarray(np.cos(2 * np.pi * f[..., None] * offsets).mean(axis=-1))


@dataclass
class Imaging:
    """The lens and the sampling of one sequence: field on the surface -> intensity at the pixels."""

    camera: Camera
    effects: Effects
    transfer: Field
    shifts_px: Stack | None  # (frames, 2): x, y by which each frame's image is displaced

    def spectrum(self, u: Field) -> Field:
        """FFT of the field behind the pupil; one field serves all frames when only the image moves."""
        v = scipy.fft.fft2(u, axes=(-2, -1)) * self.transfer
        if self.shifts_px is not None:
            fy, fx = np.fft.fftfreq(v.shape[-2])[:, None], np.fft.fftfreq(v.shape[-1])[None, :]
            dx, dy = self.shifts_px[:, 0, None, None], self.shifts_px[:, 1, None, None]
            v = v * (np.exp(-2j * np.pi * fx * dx) * np.exp(-2j * np.pi * fy * dy))
        return v

    def sample(self, v: Field) -> Stack:
        """|IFFT(v)|^2 at the pixels' centres, or its integral over the pixels' areas.

        The field's band ends at D / 2 < 0.5, so the intensity's ends below 1 cycle per pixel: on a grid of half a
        pixel it is not aliased, and its integral over a square of side a is exactly the product with
        sinc(a fx) sinc(a fy) in the frequency plane.
        """
        if "pixel_integration" not in self.effects:
            return squared_modulus(scipy.fft.ifft2(v, axes=(-2, -1)))
        height, width = v.shape[-2:]
        fine = np.zeros((*v.shape[:-2], 2 * height, 2 * width), complex)
        rows = np.r_[0 : height // 2, 2 * height - (height - height // 2) : 2 * height]
        columns = np.r_[0 : width // 2, 2 * width - (width - width // 2) : 2 * width]
        fine[..., rows[:, None], columns[None, :]] = 4 * v
        intensity = scipy.fft.rfft2(squared_modulus(scipy.fft.ifft2(fine, axes=(-2, -1))), axes=(-2, -1))
        side = np.sqrt(self.effects["pixel_integration"]["fill_factor"])
        fy, fx = np.fft.fftfreq(2 * height, 0.5)[:, None], np.fft.rfftfreq(2 * width, 0.5)[None, :]
        points = {"area": None, "points2": 2, "points3": 3}[self.camera.readings.pixel_integration]
        intensity *= pixel_transfer(fx, side, points) * pixel_transfer(fy, side, points)
        return scipy.fft.irfft2(intensity, s=(2 * height, 2 * width), axes=(-2, -1))[..., ::2, ::2]

    def tilted(self, v: Field) -> Stack:
        """A sensor turned about a vertical axis: the defocus w(x) grows from the axis to the right edge only.

        Column x is the transform with the phase 2 pi w(x) (fx^2 + fy^2) / R^2, which splits into a factor of fx and
        one of fy: a matrix product over fx, then an inverse FFT over fy.
        """
        camera = self.camera
        fy, fx = np.fft.fftfreq(camera.height), np.fft.fftfreq(camera.width)
        x = np.arange(camera.width)
        axis = camera.axis_px[0]
        waves = self.effects["tilt_blur"]["edge_waves"] * np.clip((x - axis) / (axis - camera.border_px), 0, 1)
        curvature = 2j * np.pi * waves / (camera.diameter / 2) ** 2
        along_x = np.exp(2j * np.pi * fx[:, None] * x + curvature * fx[:, None] ** 2) / camera.width
        field = scipy.fft.ifft(v @ along_x * np.exp(curvature * fy[:, None] ** 2), axis=-2)
        return self.sample(scipy.fft.fft2(field, axes=(-2, -1)))

    def intensity(self, u: Field) -> Stack:
        v = self.spectrum(u)
        return self.tilted(v) if "tilt_blur" in self.effects else self.sample(v)

    def mean_intensity(self, image: Image) -> Stack:
        """E |V|^2 of a delta-correlated field of variance `image`: the incoherent image."""
        spread_function = np.abs(scipy.fft.ifft2(self.transfer)) ** 2
        mean = scipy.fft.ifft2(scipy.fft.fft2(image) * scipy.fft.fft2(spread_function)).real
        return np.maximum(mean, 0.0)[None]


def draw_field(camera: Camera, count: int, rng: np.random.Generator) -> Field:
    """z: (count, height, width), E |z|^2 = 1."""
    shape = (count, *camera.shape)
    if camera.field == "unit_phasor":
        return np.exp(2j * np.pi * rng.random(shape))
    z = np.empty(shape, np.complex128)
    z.real = rng.standard_normal(shape)
    z.imag = rng.standard_normal(shape)
    z *= np.sqrt(0.5)
    return z


def boil(camera: Camera, count: int, tau: float, rng: np.random.Generator) -> Field:
    """Fields of count frames with correlation exp(-1 / tau) from each to the next.

    Gaussian fields: an autoregression. Unit phasors, and by another reading all fields, keep their moduli: their phases
    diffuse, E exp(i d) = exp(-var / 2).
    """
    if camera.field == "unit_phasor" or camera.readings.surface_boiling == "phases":
        phase = np.sqrt(2 / tau) * rng.standard_normal((count, *camera.shape))
        phase[0] = 2 * np.pi * rng.random(camera.shape)
        phasors = np.exp(1j * np.cumsum(phase, axis=0))
        return phasors if camera.field == "unit_phasor" else phasors * np.abs(draw_field(camera, 1, rng))
    keep = np.exp(-1 / tau)
    z = draw_field(camera, count, rng)
    for t in range(1, count):
        z[t] = keep * z[t - 1] + np.sqrt(1 - keep * keep) * z[t]
    return z


def exposure_modes(
    lags: float, count: int = 6, correlation: Literal["exponential", "gaussian"] = "exponential"
) -> tuple[Stack, Stack]:
    """The integral over the exposure of |V(t)|^2, where the field's correlation is exp(-|t - s| lags), t in (0, 1).

    Karhunen and Loeve: z(t) = sum_m sqrt(lambda_m) z_m phi_m(t), so the exposure is sum_m lambda_m |V_m|^2 with
    independent V_m. Returns lambda_m, largest first, and the integrals of phi_m (a constant's expansion); from 200
    intervals. K^2 = sum lambda_m^2 -> (exp(-2 a) - 1 + 2 a) / (2 a^2), Goodman's speckle contrast of an exponential.
    Another reading's correlation is exp(-(t - s)^2 lags^2).
    """
    steps = 200
    t = (np.arange(steps) + 0.5) / steps
    path = lags * np.abs(t[:, None] - t[None, :])
    if correlation == "exponential":
        kernel = np.exp(-path)
        a = lags / steps
        np.fill_diagonal(kernel, 2 * (a - 1 + np.exp(-a)) / (a * a))  # the mean over the interval itself
    else:
        kernel = np.exp(-(path**2))
    values, vectors = np.linalg.eigh(kernel / steps)
    order = np.argsort(values)[::-1][:count]
    return values[order], vectors[:, order].sum(axis=0) / np.sqrt(steps)


def phasor_step(
    camera: Camera, name: str, polarization: str, step: int, lags: float, shape: tuple[int, ...], seed: int
) -> Field:
    """What a step of the path does to unit phasors: their phases diffuse, E exp(i d) = exp(-lags).

    Another reading: each phase runs on at a speed of its own, and after n steps E exp(i d) = exp(-(n lags)^2).
    """
    if camera.readings.motion_decorrelation == "exponential":
        normal = stream(seed, name, "path", polarization, str(step)).standard_normal(shape)
        return np.asarray(np.exp(1j * np.sqrt(2 * lags) * normal))
    normal = stream(seed, name, "path", polarization).standard_normal(shape)
    return np.asarray(np.exp(1j * np.sqrt(2) * lags * normal))


def vibration_shifts(sequence: Sequence, effects: Effects, frames: int, seed: int) -> Stack | None:
    """By how much a shaking mount displaces each frame of a scene that rests, x and y in pixels."""
    if "vibration" not in effects or sequence.moving:
        return None
    normal: Stack = stream(seed, sequence.name, "vibration").standard_normal((frames, 2))
    return effects["vibration"]["rms_px"] * normal


def interpolated(light: Stack, shifts: Stack, order: int) -> Stack:
    """Each frame displaced, its light between the pixels found by splines of an order. Periodic."""
    stack = np.broadcast_to(light, (len(shifts), *light.shape[1:]))
    moved = [scipy.ndimage.shift(frame, (y, x), order=order, mode="grid-wrap")
             for frame, (x, y) in zip(stack, shifts, strict=True)]  # fmt: skip
    return np.maximum(np.stack(moved), 0.0)  # splines swing below 0


def field_shifts(camera: Camera, sequence: Sequence, effects: Effects, frames: int, seed: int) -> Stack | None:
    """By how much each frame's field is displaced before its modulus is taken, x and y in pixels."""
    shifts = np.zeros((frames, 2))
    shaken = vibration_shifts(sequence, effects, frames, seed)
    if shaken is not None and camera.readings.vibration == "field":
        shifts += shaken
    if "image_drift" in effects:  # the mount warms up
        speed, angle = effects["image_drift"]["px_per_frame"], 0.6
        shifts += speed * np.arange(frames)[:, None] * np.array([np.cos(angle), np.sin(angle)])
    return shifts if shifts.any() else None


def _stuck(z: Field, setting: dict[str, float], rng: np.random.Generator) -> Field:
    """A stage that sticks and slips: some frames see the surface exactly where it was."""
    for t in np.flatnonzero(rng.random(len(z)) < setting["stuck_fraction"]):
        if t:
            z[t] = z[t - 1]
    return z


def speckle(camera: Camera, sequence: Sequence, image: Image, effects: Effects, frames: int, seed: int) -> Stack:
    """Laser light behind the lens: (frames or 1, height, width)."""
    shifts = field_shifts(camera, sequence, effects, frames, seed)
    imaging = Imaging(camera, effects, pupil(camera, effects), shifts)
    air = "airflow" in effects and not sequence.moving
    boiling = "surface_boiling" in effects and not sequence.moving
    count = frames if sequence.moving or boiling else 1
    coherent = effects["low_roughness"]["coherent_fraction"] if "low_roughness" in effects else 0.0
    unmixed = effects["uncorrelated_speckle"]["fraction"] if "uncorrelated_speckle" in effects else 0.0
    modes, integrals = np.ones(1), np.ones(1)
    phasor_steps = 0
    if "motion_decorrelation" in effects and sequence.moving:
        lags = effects["motion_decorrelation"]["lags"]
        if camera.field == "unit_phasor":  # not Gaussian: no expansion; the path in steps
            phasor_steps = 16
            modes, integrals = np.full(phasor_steps, 1 / phasor_steps), np.full(phasor_steps, phasor_steps**-0.5)
        else:
            modes, integrals = exposure_modes(lags, correlation=camera.readings.motion_decorrelation)
    p = camera.degree_of_polarization
    if "depolarization" in effects:
        p = effects["depolarization"]["degree_of_polarization"]
    polarizations = [w for w in ((1 + p) / 2, (1 - p) / 2) if w > 0]

    amplitude = np.sqrt(image)
    if air:
        amplitude = amplitude * np.exp(1j * air_screens(camera, effects["airflow"], frames, seed, sequence.name))
    height_map = None
    if "linewidth" in effects:
        height_map = stream(seed, sequence.name, "height").standard_normal((count, *camera.shape))
        height_map *= effects["linewidth"]["dephasing_rad"]
    total: Stack = np.zeros((1, 1, 1))
    for polarization, share in enumerate(polarizations):
        z: Field = np.empty(0, np.complex128)
        for mode, (weight, integral) in enumerate(zip(modes, integrals, strict=True)):
            rng = stream(seed, sequence.name, "field", str(polarization), str(0 if phasor_steps else mode))
            if phasor_steps and mode:
                z = z * phasor_step(camera, sequence.name, str(polarization), mode, lags / phasor_steps, z.shape, seed)
            elif boiling:
                z = boil(camera, frames, effects["surface_boiling"]["correlation_frames"], rng)
            else:
                z = draw_field(camera, count, rng)
            if "stick_slip" in effects and sequence.moving:
                z = _stuck(z, effects["stick_slip"], stream(seed, sequence.name, "stick_slip"))
            # sqrt(lambda) z: the same surface for all lines, the same phase for the coherent part
            u = amplitude * (np.sqrt((1 - coherent) * weight) * z + np.sqrt(coherent) * integral)
            if height_map is None:
                total = total + share * imaging.intensity(u)
            else:
                for line, line_weight in zip(LINES, LINE_WEIGHTS, strict=True):
                    total = total + share * line_weight * imaging.intensity(u * np.exp(1j * line * height_map))
    # What the modes left out: so many independent patterns that only their mean remains.
    rest, coherent_rest = max(1 - modes.sum(), 0), max(1 - (integrals**2).sum(), 0)
    if len(modes) > 1 and not phasor_steps:
        total = total + (1 - coherent) * rest * imaging.mean_intensity(image)
        if coherent:
            total = total + coherent * coherent_rest * imaging.intensity(amplitude[None].astype(complex))
    if unmixed:
        # Speckle finer than a pixel's sampling, as three published simulators have it: an exponential law, no grain.
        white = stream(seed, sequence.name, "unmixed").standard_exponential((count, *camera.shape))
        total = (1 - unmixed) * total + unmixed * imaging.mean_intensity(image) * white
    return np.maximum(total, 0.0)  # the sinc of a pixel may ring by rounding


def air_screens(camera: Camera, setting: dict[str, float], frames: int, seed: int, name: str) -> Stack:
    """Phases of air close to the surface: smooth in space, correlation exp(-1 / 5) from frame to frame."""
    reading = camera.readings.airflow
    scale = setting["scale_px"] * (np.sqrt(2) if reading == "wide" else 1)
    screens = smooth_noise(camera.shape, scale, stream(seed, name, "airflow"), frames)
    if reading == "wind":  # half a scale a frame, in whole pixels
        step = round(scale / 2)
        return setting["rms_rad"] * np.stack([np.roll(screens[0], step * t, axis=-1) for t in range(frames)])
    keep = 0.5 if reading == "fast" else np.exp(-1 / AIRFLOW_CORRELATION_FRAMES)
    for t in range(1, frames):
        screens[t] = keep * screens[t - 1] + np.sqrt(1 - keep * keep) * screens[t]
    return setting["rms_rad"] * screens


def jitter_lines(camera: Camera, light: Stack, rms_px: float, name: str, frames: int, seed: int) -> Stack:
    """Every row of every frame displaced along x by an amount of its own, smooth over some ten rows."""
    rng = stream(seed, name, "line_jitter")
    shifts = scipy.ndimage.gaussian_filter1d(rng.standard_normal((frames, camera.height)), 4.0, axis=1, mode="wrap")
    shifts *= rms_px / shifts.std()
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(camera.width) * shifts[..., None])
    return scipy.fft.irfft(scipy.fft.rfft(light, axis=-1) * turn, n=camera.width, axis=-1)


def dust(camera: Camera, absorption: float, seed: int) -> Image:
    """Transmission with twelve grains of 2 to 5 px."""
    rng = stream(seed, "dust")
    x, y = pixel_grid(camera)
    transmission = np.ones(camera.shape)
    for _ in range(12):
        cx, cy, radius = rng.uniform(0, camera.width), rng.uniform(0, camera.height), rng.uniform(2, 5)
        transmission *= 1 - absorption * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * radius**2))
    return transmission


def laser_power(camera: Camera, name: str, effects: Effects, frames: int, seed: int) -> Stack | None:
    """Factors on all laser light: (frames, 1 or height, 1)."""
    power = np.ones((frames, 1, 1))
    if "power_flicker" in effects:
        noise = stream(seed, name, "power_flicker").standard_normal((frames, 1, 1))
        power = power * np.maximum(1 + effects["power_flicker"]["sigma"] * noise, 0)
    if "power_warm_up" in effects:  # the diode warms and droops, with a time constant of a third of the sequence
        t = np.arange(frames)[:, None, None] / max(frames - 1, 1)
        power = power * (1 - effects["power_warm_up"]["droop"] * (1 - np.exp(-3 * t)))
    if "row_band_flicker" in effects:  # a driver's ripple under a rolling shutter: bands whose phase runs on
        phase = stream(seed, name, "row_band_flicker").uniform(0, 2 * np.pi)
        rows = 2 * np.pi * np.arange(camera.height)[None, :, None] / 37.0
        turn = 2 * np.pi * 0.381966 * np.arange(frames)[:, None, None]
        power = power * (1 + effects["row_band_flicker"]["modulation"] * np.cos(rows + turn + phase))
    return None if np.all(power == 1) else power


def intensity(camera: Camera, sequence: Sequence, image: Image, effects: Effects, frames: int, seed: int) -> Stack:
    """Light on the sensor, 1 = the mean of flat and board: (frames or 1, height, width), without ambient light."""
    if sequence.scene == "dark":
        return np.zeros((1, *camera.shape))
    if sequence.scene == "flat":
        light: Stack = image[None]
    else:
        light = speckle(camera, sequence, image, effects, frames, seed)
        shaken = vibration_shifts(sequence, effects, frames, seed)
        if shaken is not None and camera.readings.vibration != "field":
            light = interpolated(light, shaken, order=3 if camera.readings.vibration == "cubic" else 1)
        power = laser_power(camera, sequence.name, effects, frames, seed)
        if power is not None:
            light = light * power
        if "etalon_fringes" in effects:  # two faces of a filter: fixed fringes in laser light, none in an LED's
            x, y = pixel_grid(camera)
            fringes = np.cos(2 * np.pi * (x * 0.043 + y * 0.021) + 0.7)
            light = light * (1 + effects["etalon_fringes"]["modulation"] * fringes)
        if "incoherent_double_image" in effects:  # a reflection on a path beyond the laser's coherence length
            fraction = effects["incoherent_double_image"]["fraction"]
            light = (1 - fraction) * light + fraction * np.roll(light, (2, 5), axis=(-2, -1))
        if "line_jitter" in effects:  # a shaking mount under a rolling shutter
            light = jitter_lines(camera, light, effects["line_jitter"]["rms_px"], sequence.name, frames, seed)
    if "dust" in effects:  # grains on the cover glass: soft round shadows that stay
        light = light * dust(camera, effects["dust"]["absorption"], seed)
    if "vignetting" in effects:
        x, y = pixel_grid(camera)
        r2 = ((x - camera.axis_px[0]) ** 2 + (y - camera.axis_px[1]) ** 2) / camera.corner_px**2
        light = light * (1 - effects["vignetting"]["corner_loss"] * r2)
    if "mirror_ghost" in effects:  # light reflected by the sensor and the lens comes back turned about the axis
        light = light + effects["mirror_ghost"]["fraction"] * light[..., ::-1, ::-1]
    if "glare" in effects:
        setting = effects["glare"]
        tails = spread(light, setting["scale_px"], camera.readings.glare)
        light = (1 - setting["fraction"]) * light + setting["fraction"] * tails
    return np.maximum(light, 0.0)
