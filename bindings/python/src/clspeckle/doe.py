"""The pattern of a diffractive optical element (DOE): from its phase and the laser's beam to texels of a pattern.

    design = clspeckle.DoeElement.load("design.npy")
    doe = clspeckle.DoePattern(design, beam=clspeckle.Beam(covariance_m2=(6e-8, 6e-8)))
    pattern = doe.pattern(laser_from_geometry=pose)

Equations and defects: ``doe.h``; thesis sections 2.6 and 3.3.
"""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import json
import os
import secrets
import sys
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from . import _check, _json_file, _library, errors
from ._handle import Handle, create
from ._progress import Call, Progress
from .pattern import Pattern
from .runtime import Context, resolve_context

if sys.platform != "win32":
    import fcntl

__all__ = ["Beam", "DoeDefects", "DoeElement", "DoePattern", "DoePatternInfo"]

_BEAM = _check.Arguments(_library.ClspBeamProfile)
_DEFECTS = _check.Arguments(_library.ClspDoeDefects)
_DOE = _check.Arguments(
    _library.ClspDoePatternDesc, words={"evaluation": _library.words("DOE_EVALUATION")}, flags=("pixel_envelope",)
)
_SPOTS = _check.Arguments(_library.ClspSpotPatternDesc)
_BEAMS = _library.words("BEAM")
_SOURCES = {number: word for word, number in _library.words("DOE_SOURCE").items()}


@dataclasses.dataclass(eq=False)
class Beam:
    """The laser's beam at the DOE. What is None has the C library's default: a Gaussian, 1 mm between 1/e^2 points."""

    kind: str | None = None
    """"gaussian", "flat_circle", "flat_square", "super_gaussian", "skewed" or "image"."""
    covariance_m2: Any | None = None
    """Of the intensity, for "gaussian" and "skewed": (xx, yy), (xx, xy, yy) or a 2 x 2 matrix."""
    width_m: float | None = None
    """Full width of the other kinds."""
    height_m: float | None = None
    """None: the width."""
    order: float | None = None
    """Of "super_gaussian"."""
    skew: tuple[float, float] | None = None
    """(along x, along y), shape parameters of the skew-normal law, for "skewed"."""
    m_squared: float | None = None
    """Beam quality, 1 or more."""
    image: npt.ArrayLike | None = None
    """(height, width) intensities, for "image"."""


@dataclasses.dataclass(eq=False)
class DoeDefects:
    """What manufacture does to a design; see ``doe.h``. What is None has the C library's default: no defect."""

    levels: int | None = None
    """Levels that manufacture has, 2 to 65536; 0: no limit."""
    relative_depth_error: float | None = None
    """e, -1 to 1: all depths are (1 + e) times as deep."""
    rounding_sigma_m: float | None = None
    """Rounding of features, 0 to 64 pixels."""
    etch_noise_rms_m: float | None = None
    """RMS error of a pixel's depth, 0 or more."""
    refractive_index: float | None = None
    """At the design's wavelength, above 1 to 10."""
    dispersion_per_m: float | None = None
    """Its slope over the wavelength."""
    seed: int | None = None
    """Of the etch noise of a whole aperture."""
    feature_samples: int | None = None
    """Samples of a pixel along each side while features are rounded, 1 to 16."""


@dataclasses.dataclass(eq=False)
class DoeElement:
    """The phase of a DOE."""

    phase: npt.ArrayLike
    """(height, width) radians at `wavelength_m`, row 0 first, y down."""
    pixel_pitch_m: float
    """Side of a pixel of the design."""
    wavelength_m: float = 940e-9
    """For which the phase is."""
    periodic: bool = True
    """The phase is a cell that repeats; False: it is the whole aperture."""
    levels: int = 0
    """Levels on which the phase lies, 0: any."""
    orders: npt.ArrayLike | None = None
    """(n, 2) or (n, 3): wanted orders m, n, and weights, of a periodic design."""
    directions: npt.ArrayLike | None = None
    """(n, 2) or (n, 3): wanted direction cosines u, v, and weights, of a whole aperture."""

    @staticmethod
    def load(path: str | os.PathLike[str]) -> DoeElement:
        """Reads NAME.npy (the phase) and NAME.json beside it."""
        name = os.fspath(path)
        stem = name[:-4] if name.endswith(".npy") else name
        try:
            phase = np.load(stem + ".npy", allow_pickle=False)
            about = _json_file.read_json(stem + ".json")
        except OSError as error:
            raise errors.InputOutputError(f"{stem}.npy with {stem}.json cannot be read: {error}") from error
        except (EOFError, ValueError) as error:
            raise errors.InvalidDataError(f"{stem}.npy with {stem}.json is no DOE design: {error}") from error
        try:
            return _stored(phase, about)
        except (TypeError, ValueError) as error:
            raise errors.InvalidDataError(f"{stem}.npy with {stem}.json is no DOE design: {error}") from error

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes NAME.npy and NAME.json; both are complete before either gets its name."""
        name = os.fspath(path)
        stem = name[:-4] if name.endswith(".npy") else name
        phase = _check.float_plane(self.phase, "phase", (None, None))
        about: dict[str, Any] = {
            "pixel_pitch_m": _check.real(self.pixel_pitch_m, "pixel_pitch_m"),
            "wavelength_m": _check.real(self.wavelength_m, "wavelength_m"),
            "periodic": bool(_check.flag(self.periodic, "periodic")),
            "levels": _check.integer(self.levels, "levels"),
        }
        for key, value in (("orders", self.orders), ("directions", self.directions)):
            if value is not None:
                about[key] = _check.array(value, key).tolist()
        try:
            text = json.dumps(about, allow_nan=False)
            with contextlib.ExitStack() as files:
                parts = {suffix: files.enter_context(_unfinished(stem + suffix)) for suffix in (".npy", ".json")}
                np.save(parts[".npy"], phase)
                parts[".json"].write(text.encode())
                for suffix, part in parts.items():
                    part.flush()
                    if os.path.isdir(stem + suffix):
                        raise IsADirectoryError(f"{stem}{suffix} is a folder")
                for suffix, part in parts.items():
                    os.replace(part.name, stem + suffix)
        except OSError as error:
            raise errors.InputOutputError(f"{stem}.npy with {stem}.json cannot be written: {error}") from error
        except (TypeError, ValueError) as error:
            raise errors.InvalidDataError(f"the design cannot be written: {error}") from error


@contextlib.contextmanager
def _unfinished(path: str) -> Iterator[BinaryIO]:
    """A file beside `path`, removed unless it is renamed. Named and locked as the C library's are: what nobody locks
    any more is removed by others."""
    name = os.path.join(os.path.dirname(path), f".clspeckle-{secrets.token_hex(8)}.part{os.path.splitext(path)[1]}")
    with open(name, "xb") as file:
        if sys.platform != "win32":
            fcntl.flock(file, fcntl.LOCK_EX)
        try:
            yield file
        finally:
            if os.path.exists(name):
                os.remove(name)


def _stored(phase: npt.NDArray[Any], about: Any) -> DoeElement:
    """The design of the two files, by the rules of ``clspeckle doe``."""
    if not isinstance(phase, np.ndarray) or phase.dtype.kind != "f" or phase.ndim != 2:
        raise ValueError(f"the phase is {_check.kind(phase)}, expected floating-point numbers, height x width")
    if not isinstance(about, dict):
        raise ValueError('the JSON must be an object with "pixel_pitch_m" and "wavelength_m"')
    for name in ("pixel_pitch_m", "wavelength_m"):
        if name not in about:
            raise ValueError(f'"{name}" is missing')
        if isinstance(about[name], bool) or not isinstance(about[name], (int, float)):
            raise ValueError(f'"{name}" is {about[name]!r}, a number is needed')
    periodic, levels = about.get("periodic", True), about.get("levels", 0)
    if not isinstance(periodic, bool):
        raise ValueError(f'"periodic" is {periodic!r}, expected true or false')
    if isinstance(levels, bool) or not isinstance(levels, int) or not 0 <= levels < 2**32:
        raise ValueError(f'"levels" is {levels!r}, expected an integer, 0 or above')
    key, other = ("orders", "directions") if periodic else ("directions", "orders")
    if other in about:
        raise ValueError(f'has "{other}", but a design with "periodic": {str(periodic).lower()} has "{key}"')
    dots = about.get(key, [])
    if not isinstance(dots, list):
        raise ValueError(f'"{key}" is no list; [[number, number, weight], ...] is needed')
    table = [_entry(entry, f"{key}[{k}]", periodic) for k, entry in enumerate(dots)] or None
    return DoeElement(
        phase,
        pixel_pitch_m=float(about["pixel_pitch_m"]),
        wavelength_m=float(about["wavelength_m"]),
        periodic=periodic,
        levels=levels,
        orders=table if periodic else None,
        directions=None if periodic else table,
    )


def _entry(entry: Any, where: str, order: bool) -> list[float]:
    """Two numbers and a weight."""
    if not isinstance(entry, list) or len(entry) not in (2, 3):
        raise ValueError(f"{where} is {entry!r}; two numbers and an optional weight are needed")
    for k, number in enumerate(entry):
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            raise ValueError(f"{where}[{k}] is {number!r}, a number is needed")
        if order and k < 2 and (number != int(number) or abs(number) > 1e6):
            raise ValueError(f"{where}[{k}] is {number!r}, an order is an integer")
    return [*map(float, entry[:2]), float(entry[2]) if len(entry) == 3 else 1.0]


def _numbers(value: Any, name: str) -> npt.NDArray[np.float64]:
    """An array of real numbers."""
    given = _check.array(value, name)
    if given.dtype.kind not in "fiu":
        raise errors.InvalidFormatError(f"{name} has dtype {given.dtype}, expected real numbers")
    return np.asarray(given, np.float64)


def _pair(value: Any, name: str, expected: str) -> tuple[float, float]:
    """Two numbers."""
    given = _numbers(value, name)
    if given.shape != (2,):
        raise errors.InvalidArgumentError(f"{name} has shape {given.shape}, expected {expected}")
    return float(given[0]), float(given[1])


@dataclasses.dataclass(frozen=True)
class DoePatternInfo:
    """What is known of a pattern; shares are of the power that passes the DOE. See ClspDoePatternInfo."""

    source: str
    """"computed", "memory" or "disk"."""
    image_width: int
    """Texels along u."""
    image_height: int
    """Texels along v."""
    half_extent_x: float
    """The image covers [-half_extent_x, half_extent_x] in u."""
    half_extent_y: float
    """Likewise in v."""
    power_w: float
    """Of the beam."""
    dots: float
    """Share in the wanted dots."""
    zero_order: float
    """Share that goes straight on, unless that is wanted."""
    ghosts: float
    """Share in orders that are not wanted; of a whole aperture around the twins of wanted dots."""
    scatter: float
    """Share of etch noise; of a whole aperture all the rest."""
    inside_image: float
    """Share that the texels hold."""
    uniformity_rms: float
    """RMS of the dots' power over the wanted power, relative to its mean, less 1."""
    divergence_x_rad: float
    """Half-angle along x that holds 95.45 % of a spot's light."""
    divergence_y_rad: float
    """Likewise along y."""
    m_squared: float
    """Of the beam, as given."""
    order_spacing_x: float
    """Between orders in u; 0 if the design does not repeat."""
    order_spacing_y: float
    """Likewise in v."""
    dot_count: int
    """Wanted dots."""
    device_memory_bytes: int
    """Taken while it was computed."""


class _Kept(list[Any]):
    """Arrays and structs that a description points to."""

    def pointer(self, value: Any, dtype: npt.DTypeLike, name: str, shape: tuple[int | None, ...]) -> Any:
        given = _check.array(value, name)
        if given.dtype.kind not in "fiu":
            raise errors.InvalidFormatError(f"{name} has dtype {given.dtype}, expected real numbers")
        _check.check_shape(given, name, shape)
        array = np.ascontiguousarray(given, dtype=dtype)
        self.append(array)
        return _check.pointer(array)

    def struct(self, value: ctypes.Structure) -> Any:
        self.append(value)
        return ctypes.pointer(value)


def _plane(value: npt.ArrayLike, name: str, kept: _Kept) -> tuple[Any, int, int]:
    plane = _check.float_plane(value, name, (None, None))
    kept.append(plane)
    return _check.pointer(plane), plane.shape[1], plane.shape[0]


def _beam(beam: Beam, kept: _Kept) -> Any:
    if not isinstance(beam, Beam):
        raise TypeError(f"beam must be a clspeckle.Beam, got {_check.kind(beam)}")
    struct = _library.initialized(_library.ClspBeamProfile)
    if beam.kind is not None:
        struct.kind = _check.choice(beam.kind, "beam.kind", _BEAMS)
    elif beam.image is not None:
        struct.kind = _library.CLSP_BEAM_IMAGE
    if beam.covariance_m2 is not None:
        given = _numbers(beam.covariance_m2, "beam.covariance_m2")
        if given.shape == (2, 2) and given[0, 1] == given[1, 0]:
            xx, xy, yy = given[0, 0], given[0, 1], given[1, 1]
        elif given.shape == (2,):
            xx, xy, yy = given[0], 0.0, given[1]
        elif given.shape == (3,):
            xx, xy, yy = given
        else:
            raise errors.InvalidArgumentError(
                f"beam.covariance_m2 has shape {given.shape}, "
                "expected (xx, yy), (xx, xy, yy) or a symmetric 2 x 2 matrix"
            )
        struct.covariance_xx_m2, struct.covariance_xy_m2, struct.covariance_yy_m2 = float(xx), float(xy), float(yy)
    height = beam.width_m if beam.height_m is None else beam.height_m
    reals = {"width_m": beam.width_m, "height_m": height, "order": beam.order, "m_squared": beam.m_squared}
    if beam.skew is not None:
        reals["skew_x"], reals["skew_y"] = _pair(beam.skew, "beam.skew", "(along x, along y)")
    _BEAM.assign(struct, reals)
    if beam.image is not None:
        struct.image, struct.image_width, struct.image_height = _plane(beam.image, "beam.image", kept)
    return kept.struct(struct)


def _defects(defects: DoeDefects, kept: _Kept) -> Any:
    if not isinstance(defects, DoeDefects):
        raise TypeError(f"defects must be a clspeckle.DoeDefects, got {_check.kind(defects)}")
    return kept.struct(_DEFECTS.describe(vars(defects)))


def _design(design: DoeElement, desc: _library.ClspDoePatternDesc, kept: _Kept) -> None:
    if not isinstance(design, DoeElement):
        raise TypeError(f"design must be a clspeckle.DoeElement, got {_check.kind(design)}")
    desc.phase, desc.width, desc.height = _plane(design.phase, "design.phase", kept)
    desc.pixel_pitch_m = _check.real(design.pixel_pitch_m, "design.pixel_pitch_m")
    desc.wavelength_m = _check.real(design.wavelength_m, "design.wavelength_m")
    desc.periodic = _check.flag(design.periodic, "design.periodic")
    desc.design_levels = _check.integer(design.levels, "design.levels")
    name, value = ("orders", design.orders) if design.periodic else ("directions", design.directions)
    other = design.directions if design.periodic else design.orders
    if other is not None:
        raise errors.InvalidArgumentError("a periodic design has orders, a whole aperture has directions")
    if value is None:
        return
    table = _numbers(value, f"design.{name}")
    if table.ndim != 2 or table.shape[1] not in (2, 3) or len(table) == 0:
        raise errors.InvalidArgumentError(
            f"design.{name} has shape {table.shape}, expected (n, 2) or (n, 3), n at least 1"
        )
    desc.dot_count = len(table)
    if design.periodic:
        if not np.array_equal(table[:, :2], np.rint(table[:, :2])) or np.abs(table[:, :2]).max() > 2**30:
            raise errors.InvalidDataError("design.orders must hold integers")
        desc.dot_orders = kept.pointer(table[:, :2], np.int32, "design.orders", (None, 2))
    else:
        desc.dot_directions = kept.pointer(table[:, :2], np.float64, "design.directions", (None, 2))
    if table.shape[1] == 3:
        desc.dot_weights = kept.pointer(table[:, 2], np.float64, f"design.{name}", (None,))


def _image(desc: Any, image_shape: tuple[int, int] | None, half_extent: Any) -> None:
    if image_shape is not None:
        desc.image_height, desc.image_width = _check.image_shape(image_shape, "image_shape")
    if half_extent is not None:
        given = _numbers(half_extent, "half_extent")
        pair = (half_extent, half_extent) if given.ndim == 0 else half_extent
        desc.half_extent_x, desc.half_extent_y = _pair(pair, "half_extent", "a number or (x, y)")


class DoePattern(Handle):
    """The pattern of a DOE as texels over direction cosines.

    Args:
        design: the phase.
        beam: the laser's beam; None: a Gaussian of 1 mm.
        defects: of manufacture; None: none.
        lines: laser lines, (wavelength in m, power) each, or wavelengths alone; None: one at the design's wavelength.
        evaluation: "orders", "aperture" or "auto".
        oversampling: directions per pixel of "aperture".
        doe_size_m: (width, height) of the DOE; None: without limit, or the size of a whole aperture.
        power_w: of the beam.
        image_shape: (height, width) in texels.
        half_extent: the image covers +-half_extent in direction cosines: a number or (x, y); None: all that the design
            can reach.
        pixel_envelope: pixels are squares; False: the phase is smooth.
        max_memory_bytes: of the device; None: what it has.
        cache_dir: a folder in which patterns are kept between runs; None: none.
        progress: called with what is being done and the fraction that is done; returning False cancels.
        context: None for :func:`default_context`.

    What is None has the C library's default.
    """

    _c_name = "clspDoePattern"

    def __init__(
        self,
        design: DoeElement,
        *,
        beam: Beam | None = None,
        defects: DoeDefects | None = None,
        lines: npt.ArrayLike | None = None,
        evaluation: str | None = None,
        oversampling: int | None = None,
        doe_size_m: tuple[float, float] | None = None,
        power_w: float | None = None,
        image_shape: tuple[int, int] | None = None,
        half_extent: Any | None = None,
        pixel_envelope: bool | None = None,
        max_memory_bytes: int | None = None,
        cache_dir: str | os.PathLike[str] | None = None,
        progress: Progress | None = None,
        context: Context | None = None,
    ) -> None:
        desc, kept = _DOE.describe(locals()), _Kept()
        _design(design, desc, kept)
        if beam is not None:
            desc.beam = _beam(beam, kept)
        if defects is not None:
            desc.defects = _defects(defects, kept)
        if lines is not None:
            table = _numbers(lines, "lines")
            if table.ndim not in (1, 2) or len(table) == 0 or (table.ndim == 2 and table.shape[1] != 2):
                raise errors.InvalidArgumentError(
                    f"lines has shape {table.shape}, "
                    "expected (n,) wavelengths or (n, 2) wavelengths and powers, n at least 1"
                )
            desc.line_count = len(table)
            wavelengths = table if table.ndim == 1 else table[:, 0]
            desc.line_wavelengths_m = kept.pointer(wavelengths, np.float64, "lines", (None,))
            if table.ndim == 2:
                desc.line_powers = kept.pointer(table[:, 1], np.float64, "lines", (None,))
        if doe_size_m is not None:
            desc.doe_width_m, desc.doe_height_m = _pair(doe_size_m, "doe_size_m", "(width, height) in m")
        _image(desc, image_shape, half_extent)
        if cache_dir is not None:
            desc.cache_dir = _check.path(cache_dir, "cache_dir")
        self.context = resolve_context(context)
        call = Call()
        desc.progress = call.progress(progress)
        with call.running():
            self._adopt(create("clspDoePatternCreate", self.context._get(), ctypes.byref(desc)))

    @classmethod
    def ideal(
        cls,
        directions: npt.ArrayLike,
        *,
        powers: npt.ArrayLike | None = None,
        beam: Beam | None = None,
        wavelength_m: float | None = None,
        power_w: float | None = None,
        image_shape: tuple[int, int] | None = None,
        half_extent: Any | None = None,
        context: Context | None = None,
    ) -> DoePattern:
        """Ideal dots: the beam's far field at (n, 2) direction cosines u, v, looked up at the cost of a DOE's pattern.

        Args:
            powers: (n,) in any unit; None: all equal.
            power_w: of all dots together.
        """
        desc, kept = _SPOTS.describe(locals()), _Kept()
        desc.directions = kept.pointer(directions, np.float64, "directions", (None, 2))
        desc.count = len(kept[-1])
        if powers is not None:
            desc.powers = kept.pointer(powers, np.float64, "powers", (desc.count,))
        if beam is not None:
            desc.beam = _beam(beam, kept)
        _image(desc, image_shape, half_extent)
        pattern = cls.__new__(cls)
        pattern.context = resolve_context(context)
        pattern._adopt(create("clspSpotPatternCreate", pattern.context._get(), ctypes.byref(desc)))
        return pattern

    @property
    def info(self) -> DoePatternInfo:
        """The power budget, the extent, the spots' size."""
        struct = _library.fetched(_library.ClspDoePatternInfo, "clspDoePatternGetInfo", self._get())
        return _library.record(DoePatternInfo, struct, source=_SOURCES[struct.source])

    @property
    def texels(self) -> npt.NDArray[np.float32]:
        """(height, width) radiant intensity in W/sr; a new array."""
        info = self.info
        texels = np.empty((info.image_height, info.image_width), np.float32)
        _library.call("clspDoePatternGetTexels", self._get(), texels.size, _check.pointer(texels))
        return texels

    @property
    def dot_shares(self) -> npt.NDArray[np.float64]:
        """The share of the power in each wanted dot."""
        shares = np.empty(self.info.dot_count, np.float64)
        _library.call("clspDoePatternGetDotShares", self._get(), shares.size, _check.pointer(shares))
        return shares

    def pattern(self, **options: Any) -> Pattern:
        """A :class:`Pattern` of these texels; `options` are its other arguments: filter, laser_from_geometry, ..."""
        info = self.info
        return Pattern(
            self.texels,
            projection="direction_cosines",
            quantity="radiant_intensity",
            half_extent_x=info.half_extent_x,
            half_extent_y=info.half_extent_y,
            context=self.context,
            **options,
        )
