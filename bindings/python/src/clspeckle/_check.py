"""Checks of arguments on the host: numbers, choices, NumPy images. Each error says what was expected."""

from __future__ import annotations

import ctypes
import difflib
import functools
import math
import operator
import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _doubts, _library, _tensor, errors

FLOAT32_EXACT_INTEGER = 2**24
"""Integers up to here are exact in single precision."""


def integer(value: Any, name: str, bits: int = 32) -> int:
    """An unsigned integer that fits `bits`; ctypes would wrap it around."""
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} must be an integer, got {kind(value)}") from None
    if not 0 <= number < 2**bits:
        raise errors.InvalidArgumentError(f"{name} is {number}, expected 0 to 2^{bits} - 1")
    return number


def real(value: Any, name: str) -> float:
    """A real number; its range is checked by the C library."""
    if isinstance(value, (str, bytes)):
        raise TypeError(f"{name} must be a number, got {kind(value)}")
    try:
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be a number, got {kind(value)}") from None
    except OverflowError:
        raise errors.InvalidArgumentError(f"{name} is an integer that no float holds, it must be finite") from None


def range_error(name: str, value: Any, expected: str) -> errors.InvalidArgumentError:
    """An error about a number out of range."""
    return errors.InvalidArgumentError(f"{name} is {value}, expected {expected}")


def flag(value: Any, name: str) -> int:
    """A bool as 0 or 1."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be True or False, got {kind(value)}")
    return int(value)


def choice(value: Any, name: str, choices: Mapping[str, int]) -> int:
    """The number behind one of a few words."""
    if not isinstance(value, str):
        raise TypeError(f"{name} must be {one_of(choices)}, got {kind(value)}")
    if value not in choices:
        raise errors.InvalidArgumentError(f"{name} is {value!r}, expected {one_of(choices)}{nearest(value, choices)}")
    return choices[value]


def one_of(words: Iterable[str]) -> str:
    """ "a", "b" or "c"."""
    quoted = [f'"{word}"' for word in words]
    return " or ".join(filter(None, (", ".join(quoted[:-1]), quoted[-1])))


def nearest(word: str, words: Iterable[str]) -> str:
    """A hint at the word that was meant, or nothing."""
    close = difflib.get_close_matches(word, list(words), 1)
    return f'; did you mean "{close[0]}"?' if close else ""


def known_names(given: Iterable[str], known: Iterable[str], function: str) -> None:
    """Refuses unknown keyword arguments, with the nearest known one."""
    known = list(known)
    for name in given:
        if name not in known:
            raise TypeError(f"{function} has no argument {name!r}{nearest(name, known)}")


def path(value: Any, name: str) -> bytes:
    """A file name as bytes."""
    try:
        encoded = os.fsencode(value)
    except TypeError:
        raise TypeError(f"{name} must be a path, got {kind(value)}") from None
    return no_null(encoded, name)


def no_null(value: bytes, name: str) -> bytes:
    """A C string ends at its first null character."""
    if b"\0" in value:
        raise errors.InvalidArgumentError(f"{name} holds a null character")
    return value


def image_shape(value: Any, name: str = "shape") -> tuple[int, int]:
    """(height, width), as of a NumPy array."""
    try:
        height, width = value
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be (height, width), got {kind(value)}") from None
    if isinstance(value, (str, bytes)):
        raise TypeError(f"{name} must be (height, width), got {kind(value)}")
    height, width = integer(height, f"{name}[0]"), integer(width, f"{name}[1]")
    if height == 0 or width == 0:
        raise errors.InvalidArgumentError(f"{name} is ({height}, {width}), expected a height and a width of at least 1")
    return height, width


def kind(value: Any) -> str:
    """What a wrong argument is, in a few words."""
    if value is None:
        return "None"
    if isinstance(value, np.ndarray):
        return f"an array of dtype {value.dtype} and shape {value.shape}"
    text = repr(value)
    return f"{type(value).__name__} {text}" if len(text) < 60 else f"an object of type {type(value).__name__}"


def array(value: Any, name: str) -> npt.NDArray[Any]:
    """Anything that NumPy takes for an array, but neither None nor text nor objects."""
    if value is None or isinstance(value, (str, bytes, dict, set)):
        raise TypeError(f"{name} must be an array, got {kind(value)}")
    if isinstance(value, np.ma.MaskedArray):
        raise TypeError(f"{name} is a masked array, whose mask would be lost; fill it first (value.filled(0))")
    try:
        result = _tensor.as_array(value, name) if _tensor.is_tensor(value) else np.asarray(value)
    except (TypeError, ValueError, BufferError, RuntimeError) as error:
        raise TypeError(f"{name} cannot be made an array: {error}") from None
    if result.dtype.hasobject:
        raise TypeError(f"{name} must be an array of numbers, got {kind(value)}")
    return result


def _fits(given: tuple[int, ...], expected: tuple[int | None, ...]) -> bool:
    return len(given) == len(expected) and all(e is None or e == g for g, e in zip(given, expected))


def shape_text(expected: tuple[int | None, ...]) -> str:
    """(height, width) with what is known filled in."""
    axes = ("height", "width", "channels")
    return "(" + ", ".join(axes[i] if e is None else str(e) for i, e in enumerate(expected)) + ")"


def has_channels(shape: tuple[int, ...]) -> bool:
    """Whether the last axis of an array is one of channels, 1 to 4: frames that are so narrow make no sense. The
    program has the same rule for NPY files."""
    return len(shape) == 4 or (len(shape) == 3 and shape[2] <= 4 < shape[1])


def refuse_empty(given: npt.NDArray[Any], name: str) -> None:
    """Refuses an array without numbers."""
    if given.size == 0:
        raise errors.InvalidArgumentError(f"{name} is an empty array of shape {given.shape}; no side may be 0")


def frames_of(given: npt.NDArray[Any], name: str) -> npt.NDArray[Any]:
    """An array of (height, width) or (frames, height, width), either with channels behind; (frames, 1, height, width)
    is taken, too."""
    shape = given.shape
    refuse_empty(given, name)
    if len(shape) == 4 and shape[1] <= 4 < shape[3]:
        if shape[1] > 1:
            raise errors.InvalidArgumentError(
                f"{name} has shape {shape}, with {shape[1]} channels before height and width; expected are channels "
                f"behind: np.moveaxis({name}, 1, -1)"
            )
        return given[:, 0]
    if len(shape) not in (2, 3, 4) or (len(shape) == 4 and shape[3] > 4):
        raise errors.InvalidArgumentError(
            f"{name} has shape {shape}, expected (height, width) or (frames, height, width), with 1 to 4 channels "
            "behind or none"
        )
    return given


def _alike(given: npt.NDArray[Any]) -> bool:
    """Whether the color channels of (..., channels) are the same; NaN is NaN."""
    colors, first = given[..., 1:3], given[..., :1]
    same = colors == first
    if given.dtype.kind == "f" and not same.all():
        same |= np.isnan(colors) & np.isnan(first)
    return bool(same.all())


def one_image(
    given: npt.NDArray[Any], name: str, *, mean: bool = False, tell: bool = True, check: bool = True
) -> npt.NDArray[Any]:
    """One number for each pixel of one image, as the program takes it from a file: the first of 1 to 4 channels, of
    which 2 and 4 end with an opacity. Where R, G and B differ their mean is taken, or they are refused.

    Args:
        mean: of light.
        tell: warns of what is left out.
        check: looks at whether channels differ.
    """
    if given.ndim < 3:
        return given
    if given.ndim > 4:
        return given  # no image at all: the check of the shape says so
    given = frames_of(given, name)
    channels = given.shape[-1] if has_channels(given.shape) else 0
    if given.ndim == (4 if channels else 3):
        if len(given) != 1:
            return given
        given = given[0]
    if channels == 0:
        return given
    first = given[..., 0]
    if tell and channels in (2, 4) and bool((given[..., -1] != (full_scale(given.dtype) or 1)).any()):
        _doubts.warn(
            f"the last of the {channels} channels of {name} is taken as opacity and ignored; other channels are "
            f"{name}[..., 0] and the like"
        )
    if channels < 3 or not check or _alike(given):
        return first
    if not mean:
        raise errors.InvalidArgumentError(
            f"{name} has shape {given.shape}, and its channels differ; one number for each pixel is needed: "
            f"{name}[..., 0] is one of them"
        )
    if tell:
        _doubts.warn(
            f"the 3 color channels of {name} differ; their mean is taken (luminance weights mean nothing in the "
            f"infrared); {name}[..., 0] is one of them"
        )
    return np.asarray(given[..., :3].mean(axis=-1, dtype=np.float64))


def check_shape(given: npt.NDArray[Any], name: str, expected: tuple[int | None, ...]) -> None:
    """Refuses another shape, and an empty array."""
    if not _fits(given.shape, expected):
        advice = ""
        if _fits(given.shape[1:], expected):
            advice = f"; one of {given.shape[0]} is {name}[0]"
        raise errors.InvalidArgumentError(f"{name} has shape {given.shape}, expected {shape_text(expected)}{advice}")
    refuse_empty(given, name)


def float_plane(
    value: Any, name: str, shape: tuple[int | None, ...] = (None, None), what: str = "an image of real numbers"
) -> npt.NDArray[np.float32]:
    """An image of real numbers as contiguous float32; integers only where float32 holds them exactly. A bool is 0 or
    1, as the program takes it."""
    given = array(value, name)
    if given.dtype.kind not in "fiub":
        raise errors.InvalidFormatError(
            f"{name} has dtype {given.dtype}, expected {what}: float32 (other real dtypes are converted)"
        )
    if len(shape) == 2:
        given = one_image(given, name)
    check_shape(given, name, shape)
    if given.dtype.kind in "iu" and given.dtype.itemsize > 2:
        low, high = int(given.min()), int(given.max())
        if max(-low, high) > FLOAT32_EXACT_INTEGER:
            raise errors.InvalidFormatError(
                f"{name} has integers from {low} to {high}; float32 holds them exactly only up to 2^24, convert them "
                "yourself"
            )
    with np.errstate(over="ignore"):
        converted = np.ascontiguousarray(given, dtype=np.float32)
    if given.dtype.kind == "f" and given.dtype.itemsize > 4:
        lost = np.isinf(converted) & np.isfinite(given)
        if lost.any():
            raise errors.InvalidDataError(f"{name} has {places(lost)} too large for float32")
    return converted


def vector2_plane(value: Any, name: str, shape: tuple[int, int]) -> npt.NDArray[np.float32]:
    """An image of (x, y) pairs."""
    given = array(value, name)
    if given.ndim != 3 or given.shape[2] != 2:
        raise errors.InvalidArgumentError(f"{name} has shape {given.shape}, expected {shape_text(shape)[:-1]}, 2)")
    return float_plane(given, name, (*shape, 2), "an image of (x, y) pairs")


def places(bad: npt.NDArray[np.bool_]) -> str:
    """How many pixels are bad and where the first one is."""
    count = int(np.count_nonzero(bad))
    first = np.unravel_index(int(np.argmax(bad)), bad.shape)
    where = ", ".join(str(int(i)) for i in first)
    return f"{count} pixel{'s' if count > 1 else ''} (the first at [{where}])"


def within(image: npt.NDArray[np.float32], name: str, low: float = 0.0, high: float = math.inf) -> float:
    """Refuses NaN, infinite values, and values outside [low, high]; gives the largest."""
    # Two fast passes while all is well: NaN makes both comparisons false.
    smallest, largest = float(image.min()), float(image.max())
    if smallest >= low and largest <= high and largest < math.inf and smallest > -math.inf:
        return largest
    bad = ~((image >= low) & (image <= high) & np.isfinite(image))
    if low == -math.inf:
        expected = "finite values"
    elif high == math.inf:
        expected = f"finite values >= {low:g}"
    else:
        expected = f"values from {low:g} to {high:g}"
    value = image[np.unravel_index(int(np.argmax(bad)), bad.shape)]
    advice = ""
    if high == 1.0 and low <= smallest and largest < math.inf:
        advice = f"; {_doubts.way_to_parts(image, name)}"
    elif (image < low).any() and low == 0.0:
        advice = f"; np.maximum({name}, 0) sets negative numbers to 0"
    if not np.isfinite(image).all():
        advice += f"; np.where(np.isfinite({name}), {name}, 0) sets NaN and infinite ones to 0"
    raise errors.InvalidDataError(f"{name} must hold {expected}; {places(bad)}, value {value}, out of that{advice}")


@functools.lru_cache(maxsize=64)
def full_scale(dtype: np.dtype[Any]) -> int:
    """The number that means 1 in an image of light; 0: 1 does."""
    return int(np.iinfo(dtype).max) if dtype.kind == "u" and dtype.itemsize <= 2 else 0


def light_plane(
    value: Any, name: str, shape: tuple[int | None, int | None] = (None, None), *, mean: bool = True
) -> npt.NDArray[np.float32]:
    """An image of light or parts of it. Whole numbers are what the program makes of them in a file: uint8 and uint16
    are divided by their top code; others have none, and are taken as they are."""
    given = array(value, name)
    image = one_image(given, name, mean=mean) if given.dtype.kind in "fiub" else given
    plane = float_plane(image, name, shape)
    if given.dtype.kind not in "iu":
        return plane
    top, full = int(np.iinfo(given.dtype).max), full_scale(given.dtype)
    largest = int(image.max())
    # One of the bits of signed numbers is the sign. The text is that of all frames.
    all_bits = sorted({min(bits, top.bit_length()) for bits in (8, 10, 12, 14, 16)} - {16 if full else 0})
    advice = ", ".join(f"{name} / {2**bits - 1} makes the top code of {bits} bits 1" for bits in all_bits)
    if full > 1 and largest == 1:
        _doubts.warn(f"{name} has integers, the largest is 1 of {full}; if they are 0 and 1, {name} / 1 makes 1 mean 1")
    elif full == 65535 and image.dtype == given.dtype and _doubts.look_swapped(image):
        _doubts.warn(
            f"{name} looks as if its bytes were swapped: in the other order its numbers lie close "
            f"together; if so, give {name}.byteswap()"
        )
    elif full == 0 and largest > 1:
        _doubts.warn(
            f"{name} has integers of type {given.dtype}, which tells no full scale; they are taken as they are. "
            f"{advice}"
        )
    elif full == 65535 and 1 < largest < 2**14:
        _doubts.warn(f"{name} has integers of 16 bits, of which the largest needs fewer; if its codes have: {advice}")
    return plane if full == 0 else (image / full).astype(np.float32)


def unit_error(dtype: np.dtype[Any], name: str) -> errors.InvalidFormatError:
    """An error about whole numbers where metres are needed."""
    return errors.InvalidFormatError(
        f"{name} has dtype {dtype}, whose unit is not known; expected floating-point metres: {name} * 0.001 if it is "
        "in millimetres"
    )


def depth_plane(value: Any, name: str, shape: tuple[int | None, int | None] = (None, None)) -> npt.NDArray[np.float32]:
    """Depths in metres; of whole numbers the unit is not known."""
    given = array(value, name)
    if given.dtype.kind in "iub":
        raise unit_error(given.dtype, name)
    plane = float_plane(given, name, shape)
    _doubts.of_depth(plane, name)
    return plane


def irradiance_plane(
    value: Any, name: str, shape: tuple[int | None, int | None] = (None, None)
) -> npt.NDArray[np.float32]:
    """An ideal image: finite, not negative."""
    image = light_plane(value, name, shape)
    within(image, name)
    return image


def number_plane(value: Any, name: str, shape: tuple[int | None, int | None] = (None, None)) -> npt.NDArray[Any]:
    """An image of finite numbers: uint8 and uint16 as they are, others as float32."""
    given = array(value, name)
    if given.dtype in (np.uint8, np.uint16):
        given = one_image(given, name)
        check_shape(given, name, shape)
        return np.ascontiguousarray(given)
    plane = float_plane(given, name, shape)
    within(plane, name, -math.inf)
    return plane


def mask_plane(value: Any, name: str, shape: tuple[int | None, int | None]) -> npt.NDArray[np.uint8]:
    """A mask of bool or integers as uint8, 1 where it is not 0."""
    given = array(value, name)
    if given.dtype.kind not in "biu":
        raise errors.InvalidFormatError(
            f"{name} has dtype {given.dtype}, expected a mask of bool or integers; give mask != 0, or mask > 0.5"
        )
    given = one_image(given, name)
    check_shape(given, name, shape)
    _doubts.of_mask(given, name)
    if given.dtype == np.uint8:
        return np.ascontiguousarray(given)
    return np.ascontiguousarray(given != 0).view(np.uint8)


def uint32_array(value: Any, name: str, shape: tuple[int | None, ...]) -> npt.NDArray[np.uint32]:
    """Integers that fit 32 bits without a sign."""
    given = array(value, name)
    if given.dtype.kind not in "iu":
        raise errors.InvalidFormatError(f"{name} has dtype {given.dtype}, expected uint32")
    if not _fits(given.shape, shape) or given.size == 0:
        expected = ", ".join("n" if e is None else str(e) for e in shape) + ("," if len(shape) == 1 else "")
        raise errors.InvalidArgumentError(f"{name} has shape {given.shape}, expected ({expected})")
    if given.dtype != np.uint32 and (int(given.min()) < 0 or int(given.max()) >= 2**32):
        raise errors.InvalidDataError(f"{name} must hold integers from 0 to 2^32 - 1")
    return np.ascontiguousarray(given, dtype=np.uint32)


def pose(value: Any, name: str) -> ctypes.Array[ctypes.c_double]:
    """[R|t] as 12 doubles from a 3 x 4 or a homogeneous 4 x 4 matrix."""
    given = array(value, name)
    if given.dtype.kind not in "fiu":
        raise errors.InvalidFormatError(f"{name} has dtype {given.dtype}, expected real numbers")
    matrix = np.asarray(given, dtype=np.float64)
    if matrix.shape == (4, 4):
        if not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0)):
            raise errors.InvalidArgumentError(f"the last row of {name} is {matrix[3].tolist()}, expected [0, 0, 0, 1]")
    elif matrix.shape not in ((3, 4), (12,)):
        raise errors.InvalidArgumentError(f"{name} has shape {matrix.shape}, expected (3, 4) or (4, 4)")
    return (ctypes.c_double * 12)(*matrix.reshape(-1)[:12].tolist())


def format_error(name: str, given: npt.DTypeLike, accepted: Iterable[npt.DTypeLike]) -> errors.InvalidFormatError:
    """An error about a dtype."""
    expected = " or ".join(str(np.dtype(dtype)) for dtype in accepted)
    return errors.InvalidFormatError(f"{name} has dtype {np.dtype(given)}, expected {expected}")


def host_output(value: Any, name: str, shape: tuple[int, ...], dtypes: Iterable[npt.DTypeLike]) -> npt.NDArray[Any]:
    """A NumPy array that a result can be written to."""
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{name} must be a NumPy array or an image in device memory, got {kind(value)}")
    accepted = [np.dtype(dtype) for dtype in dtypes]
    if value.dtype not in accepted:
        raise format_error(name, value.dtype, accepted)
    if value.shape != shape:
        raise errors.InvalidArgumentError(f"{name} has shape {value.shape}, expected {shape}")
    if not value.flags.writeable:
        raise errors.InvalidArgumentError(f"{name} is read-only")
    return value


def pair(value: Any, name: str) -> tuple[float, float]:
    """Two numbers (x, y)."""
    try:
        x, y = value
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be (x, y), two numbers, got {kind(value)}") from None
    return real(x, f"{name}[0]"), real(y, f"{name}[1]")


def pointer(values: npt.NDArray[Any]) -> Any:
    """The C pointer to an array; keeps the array alive."""
    return values.ctypes.data_as(ctypes.POINTER(np.ctypeslib.as_ctypes_type(values.dtype)))


_BITS = {ctypes.c_uint32: 32, ctypes.c_uint64: 64}


class Arguments:
    """How keyword arguments become the members of a C struct that have their names, and back.

    What a number must be follows from the member's C type. `words` are choices and `flags` bools. A pair NAME_px goes
    to NAME_x_px and NAME_y_px. All other arguments are left to the caller.
    """

    def __init__(
        self,
        struct: type[ctypes.Structure],
        words: Mapping[str, Mapping[str, int]] | None = None,
        flags: Iterable[str] = (),
    ) -> None:
        self.struct = struct
        self.words = words or {}
        self.flags = frozenset(flags)
        self.members = {field[0]: field[1] for field in struct._fields_}

    def describe(self, given: Mapping[str, Any]) -> Any:
        """A struct with the C library's defaults but for what is given."""
        desc = _library.initialized(self.struct)
        self.assign(desc, given)
        return desc

    def describe_image(self, shape: Any, given: Mapping[str, Any]) -> Any:
        """The same of a struct with a width and a height."""
        height, width = image_shape(shape)
        desc = self.describe(given)
        desc.height, desc.width = height, width
        return desc

    def assign(self, desc: ctypes.Structure, given: Mapping[str, Any]) -> None:
        """Writes the arguments that were given; what is None keeps the C library's default."""
        for name, value in given.items():
            if value is None:
                continue
            member = self.members.get(name)
            if name in self.words:
                setattr(desc, name, choice(value, name, self.words[name]))
            elif name in self.flags:
                setattr(desc, name, flag(value, name))
            elif member is ctypes.c_double:
                setattr(desc, name, real(value, name))
            elif member in _BITS:
                setattr(desc, name, integer(value, name, _BITS[member]))
            elif member is None and f"{name[:-3]}_x_px" in self.members:
                x, y = pair(value, name)
                setattr(desc, f"{name[:-3]}_x_px", x)
                setattr(desc, f"{name[:-3]}_y_px", y)
                if f"{name[:-3]}_given" in self.members:
                    setattr(desc, f"{name[:-3]}_given", 1)

    def values(self, desc: ctypes.Structure, names: Iterable[str]) -> dict[str, Any]:
        """The members of a struct as arguments; names that it has no number for are left out."""
        result: dict[str, Any] = {}
        for name in names:
            value = getattr(desc, name, None)
            if name in self.words:
                value = next(word for word, number in self.words[name].items() if number == value)
            elif name in self.flags:
                value = bool(value)
            elif self.members.get(name) is not ctypes.c_double and self.members.get(name) not in _BITS:
                continue
            result[name] = value
        return result


def optional(function: Any) -> list[str]:
    """The keyword arguments of a function that may be None, without its context."""
    return [name for name, value in function.__kwdefaults__.items() if value is None and name != "context"]
