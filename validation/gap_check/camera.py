"""The camera of a capture set, what is drawn for it, and independent random streams."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .conditions import EVEN, Conditions
from .readings import AS_CATALOGUED, Readings

F_NUMBERS = (5.6, 6.3, 8.0)  # D = pitch / (wavelength f/#) = 0.55, 0.49, 0.39 cycles per pixel
SPACING_PX = 15.0
MARGIN_PX = 10.0
JITTER_PX = 2.0
DOT_SIGMA_PX = 2.2
BITS = 10
EXPOSURE_MS = 10.0
LONG_EXPOSURE_MS = 40.0
# What other cameras have.
OTHER_BITS = (8, 10, 12)
OTHER_PITCHES_UM = (1.4, 2.2, 2.9, 3.45, 5.0)
OTHER_WAVELENGTHS_NM = (850.0, 905.0, 940.0)
OTHER_F_NUMBERS = (2.0, 2.8, 4.0, 5.6, 8.0, 11.0)
OTHER_DIAMETERS = (0.22, 0.9)  # cycles per pixel: spots of 5 px to 1 px
OTHER_SHEET_BLACKS_DN = (16.0, 32.0, 64.0)  # of ten bits


def stream(seed: int, *names: str) -> np.random.Generator:
    """A stream of random numbers of its own for every purpose: switching an effect on disturbs no other draw."""
    words = [seed, *(zlib.crc32(name.encode()) for name in names)]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))


@dataclass(frozen=True)
class Sequence:
    """One sequence of a set."""

    name: str
    scene: str  # dark, flat, board, dots
    moving: bool
    exposure_ms: float = EXPOSURE_MS


SEQUENCES = (
    Sequence("dark", "dark", False),
    Sequence("flat", "flat", False),
    Sequence("board_static", "board", False),
    Sequence("board_moving", "board", True),
    Sequence("dots_static", "dots", False),
    Sequence("dots_moving", "dots", True),
)
# What tells a dark signal that grows with the exposure from a black level.
LONG_DARK = Sequence("dark_long", "dark", False, LONG_EXPOSURE_MS)
LASER_SEQUENCES = tuple(s.name for s in SEQUENCES if s.scene in ("board", "dots"))
DOT_SEQUENCES = tuple(s.name for s in SEQUENCES if s.scene == "dots")
STATIC_LASER_SEQUENCES = tuple(s.name for s in SEQUENCES if s.scene in ("board", "dots") and not s.moving)
MOVING_LASER_SEQUENCES = tuple(s.name for s in SEQUENCES if s.scene in ("board", "dots") and s.moving)
ALL_SEQUENCES = tuple(s.name for s in SEQUENCES)
LIT_SEQUENCES = ALL_SEQUENCES[1:]


@dataclass(frozen=True)
class Camera:
    """What capture.json says of the camera, and the nuisances that it does not say.

    Everything is simulated on a periodic grid of width x height pixels. A camera's image ends where the world goes on:
    border_px of them on each side are simulated, but not recorded.
    """

    width: int
    height: int
    f_number: float
    positions_px: NDArray[np.float64]
    level_dn: float  # g of the boards
    dot_gain: float  # g of the dots over g of the boards
    flat_gain: float  # g of the flat over g of the boards
    black_dn: float
    read_noise_dn: float
    bits: int = BITS
    pixel_pitch_um: float = 2.9
    wavelength_nm: float = 940.0
    degree_of_polarization: float = 1.0
    field: str = "circular_gaussian"
    dot_sigma_px: float = DOT_SIGMA_PX
    spacing_px: float = SPACING_PX
    sheet_black_dn: float = 64.0
    sheet_read_noise_dn: float = 4.0
    readings: Readings = AS_CATALOGUED
    conditions: Conditions = EVEN
    border_px: int = 0

    @property
    def shape(self) -> tuple[int, int]:
        return self.height, self.width

    @property
    def recorded(self) -> tuple[slice, slice]:
        """Rows and columns that the image has."""
        return tuple(slice(self.border_px, side - self.border_px) for side in self.shape)  # type: ignore[return-value]

    @property
    def diameter(self) -> float:
        """The pupil's diameter D, cycles per pixel."""
        return self.pixel_pitch_um / (self.wavelength_nm * 1e-3 * self.f_number)

    @property
    def full_dn(self) -> float:
        """The converter's maximum code."""
        return float(2**self.bits - 1)

    @property
    def dn_scale(self) -> float:
        """What a DN of ten bits is in DN of this converter."""
        return self.full_dn / (2**BITS - 1)

    @property
    def axis_px(self) -> tuple[float, float]:
        """Where the optical axis meets the image: x, y."""
        return (self.width - 1) / 2, (self.height - 1) / 2

    @property
    def corner_px(self) -> float:
        """From the axis to the centre of the image's corner pixel."""
        return float(np.hypot(*(a - self.border_px for a in self.axis_px)))

    def gain_dn(self, sequence: Sequence) -> float:
        """g: DN per unit of intensity."""
        of_scene = {"dark": 0.0, "flat": self.flat_gain, "board": 1.0, "dots": self.dot_gain}[sequence.scene]
        return self.level_dn * of_scene * sequence.exposure_ms / EXPOSURE_MS

    def nuisance(self) -> dict[str, float]:
        return {
            "_level": self.level_dn,
            "_dot_gain": self.dot_gain,
            "_flat_gain": self.flat_gain,
            "_black": self.black_dn,
            "_read": self.read_noise_dn,
        }

    def metadata(self) -> dict[str, Any]:
        """capture.json without its sequences."""
        return {
            "format": "clspeckle-capture",
            "version": 1,
            "camera": {
                "width": self.width - 2 * self.border_px,
                "height": self.height - 2 * self.border_px,
                "bits": self.bits,
                "pixel_pitch_um": self.pixel_pitch_um,
                "f_number": self.f_number,
                "black_level_dn": self.sheet_black_dn,
                "read_noise_dn": self.sheet_read_noise_dn,
            },
            "laser": {"wavelength_nm": self.wavelength_nm, "degree_of_polarization": self.degree_of_polarization},
            "baseline": {"field": self.field},
            "dots": {
                "sigma_px": self.dot_sigma_px,
                "positions_px": np.round(self.positions_px - self.border_px, 3).tolist(),
            },
        }


def draw_lattice(
    width: int, height: int, rng: np.random.Generator, spacing_px: float = SPACING_PX
) -> NDArray[np.float64]:
    """A square lattice, each dot moved by up to 2 px along each axis; rounded as capture.json holds it."""
    x = np.arange(MARGIN_PX, width - MARGIN_PX + JITTER_PX, spacing_px)
    y = np.arange(MARGIN_PX, height - MARGIN_PX + JITTER_PX, spacing_px)
    centres = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    offset = rng.uniform(0.0, 2.0, 2)  # where the lattice begins
    moved = centres + offset + rng.uniform(-JITTER_PX, JITTER_PX, centres.shape)
    # capture.json keeps three decimals: the true lattice is the rounded one.
    return np.round(moved, 3)


def draw_camera(
    seed: int,
    width: int = 192,
    height: int = 160,
    field: str = "circular_gaussian",
    border_px: int = 0,
    *,
    other: bool = False,
    **fixed: Any,
) -> Camera:
    """A camera with its nuisances: what calibration has to find before a gap is spoken of. width, height: of its image.

    other: of another data sheet (of_other_data_sheet()).
    """
    rng = stream(seed, "camera")
    camera = Camera(
        width=width + 2 * border_px,
        height=height + 2 * border_px,
        f_number=float(rng.choice(F_NUMBERS)),
        level_dn=float(rng.uniform(95.0, 145.0)),
        dot_gain=float(rng.uniform(1.9, 2.5)),
        flat_gain=float(rng.uniform(2.6, 3.4)),
        black_dn=float(64.0 + np.clip(rng.normal(0.0, 1.5), -3.0, 3.0)),
        read_noise_dn=float(4.0 * (1.0 + np.clip(rng.normal(0.0, 0.1), -0.2, 0.2))),
        positions_px=draw_lattice(width, height, stream(seed, "lattice")) + border_px,
        field=field,
        border_px=border_px,
    )
    return replace(of_other_data_sheet(camera, seed) if other else camera, **fixed)


def of_other_data_sheet(usual: Camera, seed: int) -> Camera:
    """The camera with another converter, pixel, laser, lens, lattice and black level.

    Levels, black level and read noise go with the converter's range; read noise is 1/3 to 3/2 of the usual.
    """
    rng = stream(seed, "other camera")
    bits = int(rng.choice(OTHER_BITS))
    pitch, wavelength = float(rng.choice(OTHER_PITCHES_UM)), float(rng.choice(OTHER_WAVELENGTHS_NM))
    low, high = (pitch / (wavelength * 1e-3 * diameter) for diameter in reversed(OTHER_DIAMETERS))
    f_number = float(rng.choice([f for f in OTHER_F_NUMBERS if low <= f <= high]))
    scale = (2**bits - 1) / usual.full_dn
    black = float(np.round(rng.choice(OTHER_SHEET_BLACKS_DN) * scale))
    noisier = float(rng.uniform(1 / 3, 1.5))
    spacing = float(rng.uniform(11.0, 22.0))
    width, height = (side - 2 * usual.border_px for side in (usual.width, usual.height))
    return replace(
        usual,
        bits=bits,
        pixel_pitch_um=pitch,
        wavelength_nm=wavelength,
        f_number=f_number,
        degree_of_polarization=float(rng.choice((1.0, 1.0, 0.6))),
        level_dn=usual.level_dn * scale,
        black_dn=black + (usual.black_dn - usual.sheet_black_dn) * scale,
        sheet_black_dn=black,
        read_noise_dn=usual.read_noise_dn * scale * noisier,
        sheet_read_noise_dn=float(np.round(usual.sheet_read_noise_dn * scale * noisier, 2)),
        dot_sigma_px=float(np.round(rng.uniform(1.4, 3.0), 2)),
        spacing_px=spacing,
        positions_px=draw_lattice(width, height, stream(seed, "other lattice"), spacing) + usual.border_px,
    )
