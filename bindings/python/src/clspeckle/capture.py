"""Capture sets: what a real camera recorded, sequence by sequence, for the diagnosis of the gap to the simulator.

A set is a folder with a capture.json and a .npy stack a sequence (``docs/guide/captures.md``), or arrays in memory.
"""

from __future__ import annotations

import ctypes
import dataclasses
import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _check, _doubts, _library, errors
from ._handle import Handle, create, exclusive
from ._progress import Call, Progress

__all__ = ["Capture", "CaptureSequence"]

_SCENES = _library.words("SCENE")
_MOTIONS = {"static": 0, "moving": 1}
_CAMERA = (
    "bits",
    "pixel_pitch_m",
    "f_number",
    "wavelength_m",
    "degree_of_polarization",
    "black_level_dn",
    "read_noise_dn",
    "field",
    "principal_point_px",
)
_FRAMES_FIRST = "np.moveaxis(codes, -1, 0)"
_ARGUMENTS = _check.Arguments(_library.ClspCaptureDesc, words={"field": _library.words("FIELD")})


@dataclasses.dataclass(frozen=True)
class CaptureSequence:
    """One sequence."""

    codes: npt.ArrayLike
    """(frames, height, width) raw codes up to 2^bits - 1, uint16 (or uint8, where `bits` is 8); (height, width) for a
    single frame."""
    scene: str
    """"dark", "flat", "board" or "dots"."""
    motion: str = "static"
    """"static": the speckle is the same in every frame; "moving": each frame's is independent of the last."""
    mask: npt.ArrayLike | None = None
    """(height, width), 0 where a pixel does not count."""
    f_number: float | None = None
    """Of this sequence; None: the camera's."""
    exposure_ms: float | None = None
    """Exposure time; None: not known."""


def _from_name(name: str, codes: npt.ArrayLike) -> CaptureSequence:
    """The usual names say what a sequence is: dark, flat_2, board_static, dots_moving."""
    words = name.split("_")
    scene = words[0]
    motions = [word for word in words[1:] if word in _MOTIONS]
    if scene not in _SCENES or len(motions) > 1 or (scene in ("board", "dots") and not motions):
        raise errors.InvalidArgumentError(
            f"the name {name!r} does not say what the sequence is (dark, flat, board_static, board_moving, "
            "dots_static, dots_moving, with more words behind); give a CaptureSequence with scene and motion instead"
        )
    return CaptureSequence(codes, scene, motions[0] if motions else "static")


def _codes(value: npt.ArrayLike, name: str, bits: object) -> npt.NDArray[np.uint16]:
    """As strict as the reader of files: what is written and opened again is what was taken here."""
    given = _check.array(value, name)
    if given.dtype.kind != "u" or given.dtype.itemsize != 2:
        narrow = given.dtype == np.uint8
        if not narrow or bits != 8:
            why = (
                "8-bit arrays hold 8-bit codes only (camera bits)"
                if narrow
                else "codes are whole numbers, as the converter gives them; fractions and NaN are none"
                if given.dtype.kind == "f"
                else "the codes as the converter gives them; numpy's astype(numpy.uint16) keeps them if they fit"
            )
            raise errors.InvalidFormatError(f"{name} has dtype {given.dtype}, expected uint16: {why}")
    if given.ndim in (3, 4) and _check.has_channels(given.shape):
        frames = _check.frames_of(given, name)
        given = frames[..., 0] if _check.has_channels(frames.shape) and frames.shape[-1] == 1 else frames
    if given.ndim == 2:
        given = given[np.newaxis]
    if given.ndim != 3 or given.size == 0:
        if given.ndim == 4:
            raise errors.InvalidArgumentError(
                f"{name} has shape {given.shape}, expected (frames, height, width); of channels that are alike give "
                "codes[..., 0]"
            )
        empty = "; it is empty, give at least one frame" if given.size == 0 else ""
        raise errors.InvalidArgumentError(f"{name} has shape {given.shape}, expected (frames, height, width){empty}")
    # The reader of files takes so short an axis for channels.
    if _check.has_channels(given.shape):
        raise errors.InvalidArgumentError(
            f"{name} has shape {given.shape}, expected (frames, height, width); if the last axis counts the frames, "
            f"give {_FRAMES_FIRST}, if it counts channels that are alike, codes[..., 0]"
        )
    _doubts.of_frames_behind(given.shape, "codes")
    return np.ascontiguousarray(given, dtype=np.uint16)


class Capture(Handle):
    """A capture set; made by :meth:`from_arrays` or :meth:`open`.

    Threads: calls on one object from several threads run one after the other.
    """

    _c_name = "clspCapture"
    _pickle_advice = "write it to a folder and open that"

    def __init__(self) -> None:
        raise TypeError("a Capture is made by Capture.from_arrays() or Capture.open()")

    @classmethod
    def _of(cls, pointer: int | None) -> Capture:
        made = cls.__new__(cls)
        made._adopt(pointer)
        return made

    @classmethod
    def from_arrays(
        cls,
        sequences: Mapping[str, npt.ArrayLike | CaptureSequence],
        *,
        camera: Mapping[str, Any] | None = None,
        dots_px: npt.ArrayLike | None = None,
        dots_sigma_px: float | None = None,
    ) -> Capture:
        """From arrays in memory, which are copied.

        Args:
            sequences: by name: a :class:`CaptureSequence`, or its codes alone where the name says the rest ("dark",
                "flat_2", "board_static", "dots_moving").
            camera: `bits`, `pixel_pitch_m`, `f_number`, `wavelength_m`, `degree_of_polarization`, `black_level_dn`,
                `read_noise_dn`, `field` ("circular_gaussian" or "unit_phasor"), `principal_point_px` (x, y). What
                is not given has the C library's default, see :meth:`defaults`.
            dots_px: (n, 2), x and y of the ideal dots; needed by dots sequences.
            dots_sigma_px: their width.
        """
        if not isinstance(sequences, Mapping):
            raise TypeError(f"sequences must be a dict of name to array, got {_check.kind(sequences)}")
        entries: dict[str, tuple[CaptureSequence, npt.NDArray[np.uint16]]] = {}
        bits = (camera or {}).get("bits")
        for name, value in sequences.items():
            if not isinstance(name, str):
                raise TypeError(f"the names of sequences must be text, got {_check.kind(name)}")
            sequence = value if isinstance(value, CaptureSequence) else _from_name(name, value)
            entries[name] = (sequence, _codes(sequence.codes, f"sequences[{name!r}]", bits))
        if not entries:
            raise errors.InvalidArgumentError("sequences is empty; a capture has at least one sequence")
        first = next(iter(entries.values()))[1].shape
        made = cls._of(create("clspCaptureCreate", ctypes.byref(cls._desc(first[1:], dict(camera or {})))))
        if dots_px is not None:
            made._set_dots(dots_px, dots_sigma_px)
        elif dots_sigma_px is not None:
            raise errors.InvalidArgumentError("dots_sigma_px needs dots_px")
        for name, (sequence, codes) in entries.items():
            made._add(name, sequence, codes, first)
        _library.call("clspCaptureValidate", made._get())
        return made

    @staticmethod
    def _desc(shape: tuple[int, ...], camera: dict[str, Any]) -> Any:
        _check.known_names(camera, _CAMERA, "camera")
        desc = _ARGUMENTS.describe(camera)
        desc.height, desc.width = shape
        return desc

    def _set_dots(self, dots_px: npt.ArrayLike, sigma_px: float | None) -> None:
        positions = _check.array(dots_px, "dots_px")
        if positions.dtype.kind not in "fiu" or positions.ndim != 2 or positions.shape[1] != 2 or positions.size == 0:
            raise errors.InvalidArgumentError(
                f"dots_px has dtype {positions.dtype} and shape {positions.shape}, expected real numbers, (n, 2)"
            )
        if sigma_px is None:
            raise errors.InvalidArgumentError("dots_px needs dots_sigma_px, the width of the dots")
        doubles = np.ascontiguousarray(positions, dtype=np.float64)
        sigma = _check.real(sigma_px, "dots_sigma_px")
        _library.call("clspCaptureSetDots", self._get(), sigma, doubles.shape[0], _check.pointer(doubles))

    def _add(self, name: str, sequence: CaptureSequence, codes: npt.NDArray[np.uint16], first: tuple[int, ...]) -> None:
        shape = first[1:]
        if codes.shape[1:] != shape:
            advice = ""
            if codes.shape[:2] == shape:
                advice = f"; if the last axis of {codes.shape} counts the frames, give {_FRAMES_FIRST}"
            elif codes.shape[1:] == first[:2]:
                advice = f"; if the last axis of the first one, {first}, counts its frames, give {_FRAMES_FIRST}"
            raise errors.InvalidArgumentError(
                f"sequences[{name!r}] has frames of shape {codes.shape[1:]}, the first sequence has {shape}{advice}"
            )
        struct = _library.initialized(_library.ClspCaptureSequence)
        struct.name = _check.no_null(name.encode(), "name")
        struct.scene = _check.choice(sequence.scene, f"scene of {name!r}", _SCENES)
        struct.moving = _check.choice(sequence.motion, f"motion of {name!r}", _MOTIONS)
        struct.frame_count = codes.shape[0]
        struct.codes = _check.pointer(codes)
        if sequence.mask is not None:
            mask = _check.mask_plane(sequence.mask, f"mask of {name!r}", (shape[0], shape[1]))
            struct.mask = _check.pointer(mask)
        for member in ("f_number", "exposure_ms"):
            value = getattr(sequence, member)
            if value is not None:
                number = _check.real(value, f"{member} of {name!r}")
                if number == 0:  # means "not given" to the C library
                    raise _check.range_error(f"{member} of {name!r}", number, "a number above 0")
                setattr(struct, member, number)
        _library.call("clspCaptureAddSequence", self._get(), ctypes.byref(struct))

    @staticmethod
    def defaults() -> dict[str, Any]:
        """The C library's defaults of `camera`."""
        return _ARGUMENTS.values(_ARGUMENTS.describe({}), _CAMERA)

    @classmethod
    def open(cls, path: str | os.PathLike[str], *, progress: Progress | None = None) -> Capture:
        """Reads the set in a folder; everything is checked, and errors name file, frame and field. Ctrl-C cancels.

        Codes of more than 256 MB stay in their files, which must not change while the capture is used.

        Args:
            path: the folder, or its capture.json.
            progress: a function of (what is being done, fraction done), which cancels by returning False.
        """
        call = Call()
        told = call.progress(progress)
        with call.running():
            return cls._of(create("clspCaptureOpenWithProgress", _check.path(path, "path"), told, None))

    def write(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Writes a folder with capture.json and .npy stacks, which appears only when it is complete.

        Args:
            path: a folder that does not exist.
            overwrite: replace a folder that holds nothing but a written set.
        """
        with exclusive(self):
            _library.call(
                "clspCaptureWrite", self._get(), _check.path(path, "path"), _check.flag(overwrite, "overwrite")
            )

    def validate(self) -> None:
        """Raises if the set is not complete and in order."""
        with exclusive(self):
            _library.call("clspCaptureValidate", self._get())

    def _camera_desc(self) -> _library.ClspCaptureDesc:
        return _library.fetched(_library.ClspCaptureDesc, "clspCaptureGetDesc", self._get())

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width)."""
        with exclusive(self):
            desc = self._camera_desc()
            return desc.height, desc.width

    @property
    def camera(self) -> dict[str, Any]:
        """What is known of the camera, as :meth:`from_arrays` takes it."""
        with exclusive(self):
            desc = self._camera_desc()
            point = (desc.principal_point_x_px, desc.principal_point_y_px)
            return {**_ARGUMENTS.values(desc, _CAMERA), "principal_point_px": point}

    @property
    def dots_px(self) -> npt.NDArray[np.float64]:
        """(n, 2), x and y of the ideal dots; n is 0 without dots."""
        with exclusive(self):
            count = ctypes.c_uint64()
            _library.call("clspCaptureGetDots", self._get(), None, 0, None, ctypes.byref(count))
            positions = np.empty((count.value, 2), np.float64)
            _library.call("clspCaptureGetDots", self._get(), None, count.value, _check.pointer(positions), None)
            return positions

    @property
    def dots_sigma_px(self) -> float:
        """Width of the ideal dots; 0 without dots."""
        with exclusive(self):
            sigma = ctypes.c_double()
            _library.call("clspCaptureGetDots", self._get(), ctypes.byref(sigma), 0, None, None)
            return sigma.value

    @property
    def sequences(self) -> dict[str, CaptureSequence]:
        """All sequences by name, in order, with copies of their codes as uint16 arrays of (frames, height, width)."""
        with exclusive(self):
            desc = self._camera_desc()
            count = ctypes.c_uint32()
            _library.call("clspCaptureGetSequenceCount", self._get(), ctypes.byref(count))
            result = {}
            for index in range(count.value):
                info = _library.fetched(_library.ClspCaptureSequenceInfo, "clspCaptureGetSequence", self._get(), index)
                codes = np.empty((info.frame_count, desc.height, desc.width), np.uint16)
                _library.call("clspCaptureGetCodes", self._get(), index, codes.size, _check.pointer(codes))
                mask = None
                if info.has_mask:
                    mask = np.empty((desc.height, desc.width), np.uint8)
                    _library.call("clspCaptureGetMask", self._get(), index, mask.size, _check.pointer(mask))
                result[_library.text(info.name)] = CaptureSequence(
                    codes=codes,
                    scene=next(word for word, number in _SCENES.items() if number == info.scene),
                    motion="moving" if info.moving else "static",
                    mask=mask,
                    f_number=info.f_number,
                    exposure_ms=info.exposure_ms or None,
                )
            return result

    def summary(self) -> dict[str, Any]:
        """What is in the set and what it can and cannot tell apart, as `clspeckle capture check --json` writes it."""
        with exclusive(self):
            result: dict[str, Any] = json.loads(_library.text_of("clspCaptureGetSummaryJson", self._get()))
            return result

    def emva1288(self) -> dict[str, Any]:
        """EMVA 1288's numbers of the dark and flat frames, as `clspeckle capture emva --json` writes them.

        ``emva1288()["values"]["system_gain"]`` has `value`, `interval` (95 %) and `unit`, or why it is `unknown`;
        the list: ``docs/method/emva1288.md``. No device is needed.
        """
        with exclusive(self):
            result: dict[str, Any] = json.loads(_library.text_of("clspCaptureGetEmva1288Json", self._get()))
            return result

    def emva1288_xml(self) -> str:
        """The same as XML, with the element names of the Python package emva1288."""
        with exclusive(self):
            return _library.text_of("clspCaptureGetEmva1288Xml", self._get())
