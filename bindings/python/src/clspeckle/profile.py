"""Camera profiles: a camera as a diagnosis found it, to be rendered again.

    clspeckle.diagnose("my-camera").profile().write("camera.json")
    profile = clspeckle.Profile.open("camera.json")
    camera = clspeckle.Pipeline.from_profile(profile, sequence="board_moving", seed=7)
    codes = camera.render(ideal, refresh="all")

What a profile holds: ``docs/reference/profile.md``; the C interface: ``profile.h``.
"""

from __future__ import annotations

import ctypes
import dataclasses
import json
import os
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _library, errors
from ._handle import Handle, create, exclusive

__all__ = ["Profile", "ProfileEffect", "ProfileMap", "ProfileSequence"]

_NORMALIZATIONS = {number: word for word, number in _library.words("NORMALIZATION").items()}
_FIELDS = {number: word for word, number in _library.words("FIELD").items()}
_DESCRIBED = (_library.ClspPhaseDesc, _library.ClspApertureDesc, _library.ClspLensDesc, _library.ClspSensorDesc)


@dataclasses.dataclass(frozen=True)
class ProfileEffect:
    """An effect of the camera."""

    effect: str
    """Its id in the catalogue."""
    parameters: dict[str, float]
    """All of its parameters by name."""
    intervals: dict[str, tuple[float, float]]
    """95 % intervals of those that were fitted."""
    named: bool
    """True: the verdict names it; False: it was fitted beside effects that it names."""
    conditional: bool
    """True: it rests on a scene in which something unknown remains."""


@dataclasses.dataclass(frozen=True)
class ProfileSequence:
    """The light of one sequence of the capture: a condition of the lab, not of the camera."""

    name: str
    """Its name."""
    scene: str
    """"dark", "flat", "board" or "dots"."""
    moving: bool
    """Whether the surface moves between frames."""
    f_number: float
    """Nominal, of this sequence."""
    exposure_ms: float | None
    """Exposure time; None: not known."""
    mean_dn: float
    """Of the camera's frames."""
    light_dn: float
    """Above black, of the simulator's; 0 in the dark."""
    gain_dn: float
    """DN per unit of an ideal image that is 1 on flat and board and at a dot's peak; 0 in the dark."""


@dataclasses.dataclass(frozen=True)
class ProfileMap:
    """A map of the camera's own pixels."""

    file: str
    """Name of its file, beside the profile's."""
    holds: tuple[str, ...]
    """Effects that it takes the place of."""
    sequences: tuple[str, ...]
    """Whose frames it is of."""
    frames: int
    """How many."""
    standard_error: float
    """Noise over time that was left in the mean of so many frames, of a pixel: DN, or relative."""


_MAPS = {"dark": 1, "gain": 2}


class Profile(Handle):
    """A camera profile; made by :meth:`Diagnosis.profile <clspeckle.Diagnosis.profile>` or :meth:`open`.

    Threads: a profile never changes; any number of threads may use it.
    """

    _c_name = "clspProfile"
    _pickle_advice = "write it to a file and open that"

    def __init__(self) -> None:
        raise TypeError("a Profile is made by Diagnosis.profile() or Profile.open()")

    @classmethod
    def _of(cls, pointer: int | None) -> Profile:
        made = cls.__new__(cls)
        made._adopt(pointer)
        made._read()
        return made

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Profile:
        """Reads a file that :meth:`write` or `clspeckle diagnose --profile` wrote.

        Raises:
            InputOutputError: it cannot be read.
            InvalidArgumentError: it is no profile, or one of a later format; the message names file, key, value and
                what was expected.
        """
        return cls._of(create("clspProfileOpen", _check.path(path, "path")))

    def _read(self) -> None:
        self._json = _library.text_of("clspProfileGetJson", self._get())
        data = self.data
        camera, provenance = data["camera"], data["provenance"]
        self.shape: tuple[int, int] = (camera["height"], camera["width"])
        self.bits: int = camera["bits"]
        self.black_level_dn: float = camera["black_level_dn"]
        self.read_noise_dn: float = camera["read_noise_dn"]
        self.effects = tuple(
            ProfileEffect(
                entry["effect"],
                entry["parameters"],
                {name: (low, high) for name, (low, high) in entry["intervals"].items()},
                entry["named"],
                entry["conditional"],
            )
            for entry in data["effects"]
        )
        self.sequences = tuple(ProfileSequence(**{"exposure_ms": None, **entry}) for entry in data["lab"]["sequences"])
        self.maps = {
            name: ProfileMap(
                entry["file"],
                tuple(entry["holds"]),
                tuple(entry["sequences"]),
                entry["frames"],
                entry["standard_error_dn" if name == "dark" else "standard_error"],
            )
            for name, entry in data.get("maps", {}).items()
            if name in _MAPS
        }
        self.capture: str = provenance["capture"]
        self.verdict: str = provenance["verdict"]

    @property
    def data(self) -> dict[str, Any]:
        """The whole profile, as :meth:`write` writes it; a new dict each time."""
        result: dict[str, Any] = json.loads(self._json)
        return result

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the profile to a JSON file, and its maps beside it: NAME.json, NAME.dark.npy, NAME.gain.npy.

        They appear, or replace older ones, only when all are complete.
        """
        with exclusive(self):
            _library.call("clspProfileWrite", self._get(), _check.path(path, "path"))

    def map_values(self, name: str) -> npt.NDArray[np.float32]:
        """A map that the profile has, (height, width): "dark", offsets in DN above the black level, or "gain", gains
        over the image's mean.

        Raises:
            InputOutputError: its file cannot be read.
            InvalidDataError: its file is not as it was written; the message says what to do.
        """
        if name not in self.maps:
            raise errors.InvalidArgumentError(
                f"name is {name!r}; the profile has {', '.join(map(repr, self.maps)) or 'no map'}"
            )
        values = np.empty(self.shape, np.float32)
        with exclusive(self):
            _library.call("clspProfileGetMap", self._get(), _MAPS[name], None, _check.pointer(values))
        return values

    def parameters(self, sequence: str | None = None) -> dict[str, Any]:
        """The camera's settings as keyword arguments of :meth:`Pipeline.from_parameters
        <clspeckle.Pipeline.from_parameters>`; effects are none of them.

        Args:
            sequence: one of the profile's by name, whose gain, exposure time and f-number are in it, too; None: no
                light is chosen.
        """
        name = None
        if sequence is not None:
            if not isinstance(sequence, str):
                raise TypeError(f"sequence must be the name of one of the profile's, got {_check.kind(sequence)}")
            name = _check.no_null(sequence.encode(), "sequence")
        descs = [_library.initialized(struct) for struct in _DESCRIBED]
        with exclusive(self):
            _library.call("clspProfileDescribe", self._get(), name, *map(ctypes.byref, descs))
        phase, aperture, lens, sensor = descs
        members: list[tuple[Any, tuple[str, ...]]] = [
            (phase, ("oversampling", "polarization_count")),
            (aperture, ("f_number", "pixel_pitch_m", "wavelength_m", "degree_of_polarization", "fill_factor")),
            (sensor, ("bits", "black_level_dn", "read_noise_dn")),
        ]
        result = {name: getattr(desc, name) for desc, names in members for name in names}
        if not result["fill_factor"]:
            del result["fill_factor"]
        result["field"] = _FIELDS[phase.field]
        result["normalization"] = _NORMALIZATIONS[aperture.normalization]
        height, width = self.shape
        axis = (lens.principal_point_x_px, lens.principal_point_y_px)
        if axis != ((width - 1) / 2, (height - 1) / 2):
            result["principal_point_px"] = axis
        if sequence is not None:
            result["exposure_gain_dn"] = sensor.exposure_gain_dn
            result["exposure_time_s"] = sensor.exposure_time_s
        return result

    def _state(self) -> str:
        return f"of {self.capture!r}" if not self.closed else "closed"
