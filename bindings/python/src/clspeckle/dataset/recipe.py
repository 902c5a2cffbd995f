"""What pairs are drawn from."""

from __future__ import annotations

import dataclasses
import glob
import hashlib
import io
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from .. import _check, _json_file, errors
from ..effect import effects as catalogue
from ..effect import find_effect
from ..pipeline import Pipeline, PipelineParameters, of_one_frame
from ..runtime import Context

Scene = Union[str, "os.PathLike[str]", npt.NDArray[Any]]
_WORDS_OF_PAIR = 1024  # of a counter-based stream; more than any recipe draws


def npy_bytes(array: npt.NDArray[Any]) -> bytes:
    """A .npy file's. numpy.save() would copy the pixels three times."""
    header, pixels = io.BytesIO(), np.ascontiguousarray(array)
    np.lib.format.write_array_header_1_0(header, np.lib.format.header_data_from_array_1_0(pixels))
    return b"".join((header.getvalue(), bytes_of(pixels)))


def bytes_of(array: npt.NDArray[Any]) -> memoryview:
    """An array's own, row by row."""
    return np.ascontiguousarray(array).data.cast("B")


@dataclasses.dataclass(frozen=True)
class Draw:
    """What pair `index` is made of."""

    index: int
    """Of the pair, from 0."""
    scene: int
    """Place in the recipe's scenes."""
    camera: int
    """Place in the recipe's cameras."""
    parameters: dict[str, Any]
    """Of the camera, as :meth:`clspeckle.Pipeline.from_parameters` takes them."""
    effects: dict[str, dict[str, float]]
    """By id, their parameters by name."""
    seed: int
    """Of speckle, fixed pattern and noise."""


@dataclasses.dataclass(frozen=True)
class Pair:
    """One pair."""

    ideal: npt.NDArray[Any]
    """(height, width) float32: the scene."""
    codes: npt.NDArray[Any]
    """(height, width) uint16: what the camera records."""
    draw: Draw
    """What it is made of."""


class _Words:
    """Numbers of a pair: Philox4x64-10 as NumPy has it, whose words, unlike its distributions, never change."""

    def __init__(self, seed: int, index: int) -> None:
        # 256 bits: the block that the stream begins with, four words each.
        self._stream = np.random.Philox(key=seed, counter=index * (_WORDS_OF_PAIR // 4))

    def word(self) -> int:
        return int(self._stream.random_raw())

    def uniform(self) -> float:
        """In [0, 1), 53 bits."""
        return (self.word() >> 11) * 2.0**-53

    def below(self, count: int) -> int:
        return self.word() * count >> 64


class _Range:
    """What a number of a recipe is drawn from."""

    def __init__(self, given: Any, name: str, whole: bool = False, is_number: bool = True) -> None:
        given = given.tolist() if isinstance(given, (np.generic, np.ndarray)) else given
        self.kind, self.values, self.whole, self.name = "choice", [given], whole, name
        if isinstance(given, Mapping):
            if len(given) != 1 or next(iter(given)) not in ("uniform", "log", "choice"):
                raise errors.InvalidArgumentError(
                    f'{name} has the members {list(given)}; expected one of {{"uniform": [low, high]}}, '
                    '{"log": [low, high]} and {"choice": [values]}'
                )
            self.kind, values = next(iter(given.items()))
            if isinstance(values, (str, bytes)) or not isinstance(values, Sequence) or not values:
                raise errors.InvalidArgumentError(f"{name}.{self.kind} is {values!r}; expected a list of values")
            self.values = list(values)
        elif isinstance(given, (list, tuple)) and is_number:
            self.kind, self.values = "uniform", list(given)
        if self.kind == "choice":
            return
        numbers = [isinstance(v, (int, float)) and not isinstance(v, bool) and math.isfinite(v) for v in self.values]
        if len(self.values) != 2 or not all(numbers) or self.values[0] > self.values[1]:
            raise errors.InvalidArgumentError(
                f'{name} is {given!r}; expected [low, high] with low <= high, a value, or {{"choice": [values]}}'
            )
        if whole and (self.kind == "log" or any(value != int(value) for value in self.values)):
            raise errors.InvalidArgumentError(f"{name} is {given!r}; expected [low, high] of whole numbers")
        if self.kind == "log" and self.values[0] <= 0:
            raise errors.InvalidArgumentError(f"{name}.log is {self.values}; logarithms need numbers above 0")

    def within(self, low: float, high: float) -> _Range:
        """Itself, unless it has a number that is not from low to high, or no whole one where it must be."""
        for value in self.values:
            if not isinstance(value, (int, float)) or not low <= value <= high or (self.whole and value % 1):
                kind = "whole numbers" if self.whole else "numbers"
                raise errors.InvalidArgumentError(
                    f"{self.name} has {value!r}; expected {kind} from {low:g} to {high:g}"
                )
        return self

    def at(self, words: _Words) -> Any:
        if self.kind == "choice":
            place = words.below(len(self.values))
            return self.values[place]
        low, high = self.values
        share = words.uniform()
        if self.whole:
            return int(low) + math.floor((int(high) - int(low) + 1) * share)
        if self.kind == "log":
            return float(low * (high / low) ** share)
        return float(low + (high - low) * share)


def _kinds() -> dict[str, str]:
    """The types of a camera's parameters as they are written, by name: "int | None"."""
    kinds = PipelineParameters.__annotations__
    return {key: getattr(kind, "__forward_arg__", str(kind)) for key, kind in kinds.items()}


class Recipe:
    """What a set of pairs is drawn from.

    A range is ``[low, high]`` (uniform), ``{"log": [low, high]}`` (uniform in the logarithm) or
    ``{"choice": [values]}``; anything else is a value that all have.

    Args:
        scenes: ideal images, as :func:`clspeckle.simulate` takes them: arrays, or .npy files. Each is as likely.
        cameras: :class:`PipelineParameters <clspeckle.PipelineParameters>` with ranges, without seed and effects. Each
            is as likely.
        effects: ids of :func:`clspeckle.effects` with ranges of their parameters; those left out are drawn from weak
            to strong. A single image shows neither what moves nor what a frame leaves for the next one.
        effects_per_image: how many effects a pair has, from and to; each number is as likely.
        seed: below 2^64.

    Raises:
        InvalidArgumentError: a name that there is not, a range that is none, a scene that cannot be read.

    Threads: may be shared; nothing changes after it is made. May be pickled.
    """

    def __init__(
        self,
        *,
        scenes: Sequence[Scene],
        cameras: Sequence[Mapping[str, Any]] = ({},),
        effects: Mapping[str, Mapping[str, Any]] | Sequence[str],
        effects_per_image: tuple[int, int] | Sequence[int] = (1, 3),
        seed: int = 0,
    ) -> None:
        self.seed: int = _check.integer(seed, "seed", 64)
        if isinstance(scenes, (str, os.PathLike, np.ndarray)) or not scenes:
            raise errors.InvalidArgumentError("scenes is empty or no list; expected a list of arrays or .npy files")
        # Arrays are copied: nothing that is done to them later changes a pair.
        self.scenes: list[Scene] = [
            scene if isinstance(scene, (str, os.PathLike)) else self._ideal(np.array(scene), f"scenes[{number}]")
            for number, scene in enumerate(scenes)
        ]
        for scene in self.scenes:
            if isinstance(scene, np.ndarray):
                scene.setflags(write=False)
        self._seen: dict[int, tuple[int, int]] = {}
        if isinstance(cameras, Mapping) or not cameras:
            raise errors.InvalidArgumentError("cameras is empty or no list; expected a list of parameters by name")
        self.cameras = [self._camera(camera, f"cameras[{number}]") for number, camera in enumerate(cameras)]
        self.effects = self._effects(effects)
        counts = [_check.integer(count, "effects_per_image", 32) for count in effects_per_image]
        if len(counts) != 2 or counts[0] > counts[1] or counts[1] > len(self.effects):
            raise errors.InvalidArgumentError(
                f"effects_per_image is {list(effects_per_image)}; expected two numbers, the first no more than the "
                f"second, the second no more than the {len(self.effects)} effects of the recipe"
            )
        self.effects_per_image = (counts[0], counts[1])

    @staticmethod
    def _camera(given: Mapping[str, Any], name: str) -> dict[str, _Range]:
        known = [key for key in _kinds() if key not in ("seed", "effects")]
        for key in given:
            if key in ("seed", "effects"):
                raise errors.InvalidArgumentError(f"{name} has {key}, which the recipe draws for each pair")
            if key not in known:
                hint = _check.nearest(key, known) or ""
                raise errors.InvalidArgumentError(f"{name} has no parameter {key!r}{hint}")
        return {
            key: _Range(given[key], f"{name}.{key}", kind.startswith("int"), kind.startswith(("int", "float")))
            for key, kind in _kinds().items()
            if key in given
        }

    @staticmethod
    def _effects(given: Mapping[str, Mapping[str, Any]] | Sequence[str]) -> dict[str, dict[str, _Range]]:
        if isinstance(given, (str, bytes)):
            raise errors.InvalidArgumentError(f"effects is {given!r}; expected ids with ranges, or a list of ids")
        wanted = given if isinstance(given, Mapping) else {key: {} for key in given}
        result: dict[str, dict[str, _Range]] = {}
        for effect in catalogue():  # in one order, whatever that of the recipe
            if effect.id not in wanted:
                continue
            if "stages/dots.cl" in effect.kernel:
                raise errors.InvalidArgumentError(f"the effect {effect.id} is of ideal dots, which an image has not")
            ranges: Mapping[str, Any] = wanted[effect.id] or {}
            names = [parameter.name for parameter in effect.parameters]
            for key in ranges:
                if key not in names:
                    hint = _check.nearest(key, names) or f"; it has {', '.join(names)}"
                    raise errors.InvalidArgumentError(f"the effect {effect.id} has no parameter {key!r}{hint}")
            result[effect.id] = {
                parameter.name: _Range(
                    ranges.get(parameter.name, sorted((parameter.weak, parameter.strong))),
                    f"effects.{effect.id}.{parameter.name}",
                    parameter.whole,
                ).within(parameter.minimum, parameter.maximum)
                for parameter in effect.parameters
            }
        for key in wanted:
            if key not in result:
                find_effect(key)  # says which there are
        return result

    @classmethod
    def from_file(cls, path: str | os.PathLike[str]) -> Recipe:
        """A recipe of a JSON file with the arguments as members. Scenes are files beside it; * and ? stand for names.

        Raises:
            InvalidArgumentError: no JSON, members that there are not, scenes that are not there.
        """
        path = Path(path)
        try:
            given = _json_file.read_json(path)
        except (OSError, ValueError) as error:
            raise errors.InvalidArgumentError(f"{path}: {error}") from None
        if not isinstance(given, dict):
            raise errors.InvalidArgumentError(f"{path}: expected an object with the members of a recipe")
        members = ("scenes", "cameras", "effects", "effects_per_image", "seed")
        for key in given:
            if key not in members:
                raise errors.InvalidArgumentError(
                    f"{path} has no member {key!r}{_check.nearest(key, members) or '; there are ' + ', '.join(members)}"
                )
        patterns = given.get("scenes")
        if not isinstance(patterns, list) or not all(isinstance(pattern, str) for pattern in patterns):
            raise errors.InvalidArgumentError(f"{path}: scenes is {patterns!r}; expected a list of names of files")
        scenes: list[str] = []
        for pattern in patterns:
            name = os.path.join(path.parent, pattern)
            found = sorted(glob.glob(name.replace("[", "[[]"))) if any(c in pattern for c in "*?") else [name]
            if not found:
                raise errors.InvalidArgumentError(f"{path}: no file is called {pattern!r} in {path.parent}")
            scenes += found
        if "effects" not in given:
            raise errors.InvalidArgumentError(f"{path}: effects is missing; expected ids of effects with ranges")
        return cls(**{**given, "scenes": scenes})

    def described(self) -> dict[str, Any]:
        """What the pairs depend on, for JSON: scenes by their contents."""
        return {
            "seed": self.seed,
            "scenes": [hashlib.sha256(npy_bytes(self.ideal(i))).hexdigest() for i in range(len(self.scenes))],
            "cameras": [{key: {r.kind: r.values} for key, r in camera.items()} for camera in self.cameras],
            "effects": {
                effect: {key: {r.kind: r.values} for key, r in ranges.items()}
                for effect, ranges in self.effects.items()
            },
            "effects_per_image": list(self.effects_per_image),
        }

    @staticmethod
    def _ideal(given: Any, name: str) -> npt.NDArray[np.float32]:
        image = np.asarray(given)
        if image.ndim != 2 or image.size == 0:
            raise errors.InvalidArgumentError(f"{name} has shape {image.shape}, expected (height, width)")
        if image.dtype.kind == "u" and image.dtype.itemsize <= 2:
            return (image / np.float32(np.iinfo(image.dtype).max)).astype(np.float32)
        if image.dtype.kind != "f":
            raise errors.InvalidArgumentError(
                f"{name} has dtype {image.dtype}; expected float32, or uint8 or uint16, whose top code is 1"
            )
        image = np.ascontiguousarray(image, dtype=np.float32)
        if not np.isfinite(image).all() or (image < 0).any():
            raise errors.InvalidArgumentError(f"{name} has values that are negative or not finite; light is neither")
        return image

    def ideal(self, scene: int) -> npt.NDArray[np.float32]:
        """Scene number `scene` as (height, width) float32."""
        given = self.scenes[scene]
        if not isinstance(given, (str, os.PathLike)):
            return self._ideal(given, f"scenes[{scene}]")
        try:
            now = os.stat(given)
            seen = self._seen.setdefault(scene, (now.st_size, now.st_mtime_ns))
            if seen != (now.st_size, now.st_mtime_ns):
                raise ValueError("it has changed since the recipe read it first; make a new recipe, and another folder")
            return self._ideal(np.load(given, allow_pickle=False), os.fspath(given))
        except (OSError, ValueError, EOFError) as error:
            raise errors.InvalidArgumentError(f"{os.fspath(given)}: {error}; expected an image as .npy") from None

    def draw(self, index: int) -> Draw:
        """What pair `index` is made of. Needs no device."""
        index = _check.integer(index, "index", 48)
        words = _Words(self.seed, index)
        seed, scene, camera = words.word(), words.below(len(self.scenes)), words.below(len(self.cameras))
        low, high = self.effects_per_image
        count = low + words.below(high - low + 1)
        ranks = {effect: words.word() for effect in self.effects}
        chosen = sorted(self.effects, key=ranks.__getitem__)[:count]
        parameters = {key: given.at(words) for key, given in self.cameras[camera].items()}
        drawn = {effect: {key: given.at(words) for key, given in self.effects[effect].items()} for effect in chosen}
        return Draw(index, scene, camera, parameters, drawn, seed)

    def render(self, index: int, *, context: Context | None = None) -> Pair:
        """Pair `index`. Blocks.

        Args:
            index: below 2^48.
            context: None: :func:`clspeckle.default_context`.

        Raises:
            InvalidArgumentError: parameters that do not go together; the message has the pair's number.
        """
        drawn = self.draw(index)
        ideal = self.ideal(drawn.scene)
        try:
            given: Any = {"seed": drawn.seed, "effects": drawn.effects, **drawn.parameters}
            with Pipeline.from_parameters(ideal.shape, context=context, **of_one_frame(given)) as camera:
                return Pair(ideal, camera.render(ideal, frame_index=0, refresh="all"), drawn)
        except errors.InvalidArgumentError as error:
            raise errors.InvalidArgumentError(f"pair {index} ({drawn}): {error}") from None
