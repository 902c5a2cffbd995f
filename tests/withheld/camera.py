"""The camera of a capture set, what is drawn for it, and independent random streams."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .readings import AS_CATALOGUED, Readings

F_NUMBERS = (5.6, 6.3, 8.0)  # D = pitch / (wavelength f/#) = 0.55, 0.49, 0.39 cycles per pixel
SPACING_PX = 15.0
MARGIN_PX = 10.0
JITTER_PX = 2.0
DOT_SIGMA_PX = 2.2


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


SEQUENCES = (
    Sequence("dark", "dark", False),
    Sequence("flat", "flat", False),
    Sequence("board_static", "board", False),
    Sequence("board_moving", "board", True),
    Sequence("dots_static", "dots", False),
    Sequence("dots_moving", "dots", True),
)
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
    bits: int = 10
    pixel_pitch_um: float = 2.9
    wavelength_nm: float = 940.0
    degree_of_polarization: float = 1.0
    field: str = "circular_gaussian"
    dot_sigma_px: float = DOT_SIGMA_PX
    spacing_px: float = SPACING_PX
    sheet_black_dn: float = 64.0
    sheet_read_noise_dn: float = 4.0
    readings: Readings = AS_CATALOGUED
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
    def axis_px(self) -> tuple[float, float]:
        """Where the optical axis meets the image: x, y."""
        return (self.width - 1) / 2, (self.height - 1) / 2

    @property
    def corner_px(self) -> float:
        """From the axis to the centre of the image's corner pixel."""
        return float(np.hypot(*(a - self.border_px for a in self.axis_px)))

    def gain_dn(self, scene: str) -> float:
        """g: DN per unit of intensity."""
        return self.level_dn * {"dark": 0.0, "flat": self.flat_gain, "board": 1.0, "dots": self.dot_gain}[scene]

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


def draw_lattice(width: int, height: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """A lattice of 15 px, each dot moved by up to 2 px along each axis; rounded as capture.json holds it."""
    x = np.arange(MARGIN_PX, width - MARGIN_PX + JITTER_PX, SPACING_PX)
    y = np.arange(MARGIN_PX, height - MARGIN_PX + JITTER_PX, SPACING_PX)
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
    **fixed: Any,
) -> Camera:
    """A camera with its nuisances: what calibration has to find before a gap is spoken of. width, height: of its image."""
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
    return replace(camera, **fixed)
