"""Designs on disk and the arguments of DOE patterns: what is no design is refused, with the library's errors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clspeckle
from clspeckle import errors

ABOUT: dict[str, Any] = {"pixel_pitch_m": 1.5e-6, "wavelength_m": 940e-9, "levels": 2, "orders": [[1, 0, 2], [-1, 0]]}
PHASE = np.where(np.arange(16) < 8, 0, np.pi).astype(np.float32)[None, :].repeat(16, axis=0)


def write(folder: Path, about: object = ABOUT, phase: Any = PHASE) -> Path:
    np.save(folder / "cell.npy", phase)
    (folder / "cell.json").write_text(about if isinstance(about, str) else json.dumps(about))
    return folder / "cell.npy"


def test_round_trip(tmp_path: Path) -> None:
    design = clspeckle.DoeElement.load(write(tmp_path))
    assert design.orders == [[1, 0, 2], [-1, 0, 1]]
    assert (design.periodic, design.levels, design.directions) == (True, 2, None)
    design.save(tmp_path / "again")
    again = clspeckle.DoeElement.load(tmp_path / "again.npy")
    assert again.orders == design.orders
    np.testing.assert_array_equal(np.asarray(again.phase), PHASE)
    assert len(list(tmp_path.iterdir())) == 4


@pytest.mark.parametrize(
    ("about", "message"),
    [
        (ABOUT | {"periodic": "false"}, "expected true or false"),
        (ABOUT | {"directions": [[0.1, 0.1]]}, 'has "directions", but'),
        (ABOUT | {"periodic": False}, 'has "orders", but'),
        (ABOUT | {"levels": 2.5}, '"levels" is 2.5'),
        (ABOUT | {"levels": -2}, '"levels" is -2'),
        (ABOUT | {"levels": 2**32 + 2}, '"levels" is 4294967298'),
        (ABOUT | {"levels": True}, '"levels" is True'),
        (ABOUT | {"pixel_pitch_m": "1e-6"}, '"pixel_pitch_m" is'),
        (ABOUT | {"orders": [[1]]}, "two numbers"),
        (ABOUT | {"orders": [[0.5, 1]]}, "an integer"),
        (ABOUT | {"orders": 3}, "no list"),
        ({"wavelength_m": 1e-6}, '"pixel_pitch_m" is missing'),
        ('{"pixel_pitch_m": 1e-6, "pixel_pitch_m": 2e-6}', "given twice"),
        ('{"pixel_pitch_m": NaN, "wavelength_m": 1e-6}', "no JSON number"),
        ("{" + ", ".join(f'"{key}": 1' for key in [*range(100000), 7]) + "}", '"7" is given twice'),
        ("[" * 80000, "nested more than 100 levels"),
        ("[]", "an object"),
        ("{", "no DOE design"),
    ],
)
def test_wrong_files_are_refused_as_the_program_does(tmp_path: Path, about: object, message: str) -> None:
    with pytest.raises(errors.InvalidDataError, match=message.replace("[", r"\[")):
        clspeckle.DoeElement.load(write(tmp_path, about))


def test_wrong_arrays_are_refused(tmp_path: Path) -> None:
    for phase in (PHASE[None], PHASE.astype(np.uint16), PHASE.astype(complex)):
        with pytest.raises(errors.InvalidDataError, match="floating-point"):
            clspeckle.DoeElement.load(write(tmp_path, phase=phase))
    write(tmp_path)
    for content in (b"", b"\x93NUMPY"):
        (tmp_path / "cell.npy").write_bytes(content)
        with pytest.raises(errors.InvalidDataError, match="no DOE design"):
            clspeckle.DoeElement.load(tmp_path / "cell.npy")
    with pytest.raises(errors.InputOutputError, match=r"none\.npy"):
        clspeckle.DoeElement.load(tmp_path / "none")


def test_what_cannot_be_saved_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(errors.InputOutputError, match="cannot be written"):
        clspeckle.DoeElement(PHASE, 1e-6).save(tmp_path / "nowhere" / "cell")
    (tmp_path / "cell.json").mkdir()
    with pytest.raises(errors.InputOutputError, match="cannot be written"):
        clspeckle.DoeElement(PHASE, 1e-6).save(tmp_path / "cell")
    for element in (
        clspeckle.DoeElement(np.stack([PHASE] * 2), 1e-6),
        clspeckle.DoeElement(PHASE, "1e-6"),  # type: ignore[arg-type]
        clspeckle.DoeElement(PHASE, float("nan")),
        clspeckle.DoeElement(PHASE, 1e-6, orders={}),  # type: ignore[arg-type]
    ):
        with pytest.raises((TypeError, ValueError)):
            element.save(tmp_path / "other")
    assert [path.name for path in tmp_path.iterdir()] == ["cell.json"]


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"beam": clspeckle.Beam(skew=1)}, errors.InvalidArgumentError, r"beam\.skew has shape \(\)"),  # type: ignore[arg-type]
        ({"beam": clspeckle.Beam(skew="ab")}, TypeError, r"beam\.skew must be an array"),  # type: ignore[arg-type]
        ({"beam": clspeckle.Beam(covariance_m2="wide")}, TypeError, r"beam\.covariance_m2 must be an array"),
        ({"beam": clspeckle.Beam(covariance_m2=["1", "2"])}, errors.InvalidFormatError, r"beam\.covariance_m2 has"),
        ({"doe_size_m": 1e-3}, errors.InvalidArgumentError, r"doe_size_m has shape \(\)"),
        ({"doe_size_m": (1e-3, 1e-3, 1)}, errors.InvalidArgumentError, r"doe_size_m has shape \(3,\)"),
        ({"half_extent": (1, 2, 3)}, errors.InvalidArgumentError, r"half_extent has shape \(3,\)"),
        ({"half_extent": "wide"}, TypeError, "half_extent must be an array"),
        ({"lines": "940 nm"}, TypeError, "lines must be an array"),
        ({"lines": ["940e-9"]}, errors.InvalidFormatError, "lines has dtype"),
    ],
)
def test_wrong_arguments(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        clspeckle.DoePattern(clspeckle.DoeElement(PHASE, 1.5e-6), **arguments)


@pytest.mark.parametrize("name", ["orders", "directions"])
def test_lists_of_words_are_refused(name: str) -> None:
    design = clspeckle.DoeElement(PHASE, 1.5e-6, periodic=name == "orders")
    setattr(design, name, [["1", "2"]])
    with pytest.raises(errors.InvalidFormatError, match=rf"design\.{name} has dtype"):
        clspeckle.DoePattern(design)
