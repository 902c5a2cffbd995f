"""Images of whole numbers: the same array means the same to the program, as an NPY file, and to Python."""

from __future__ import annotations

import os
import re
import subprocess
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import clspeckle

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))
SHAPE = (24, 32)
CODES = np.random.default_rng(1).integers(0, 256, SHAPE)
KINDS: dict[str, tuple[npt.NDArray[Any], str]] = {
    "uint8": (CODES.astype(np.uint8), ""),
    "uint16": (CODES.astype(np.uint16) * 257, ""),
    "big_endian": ((CODES * 257).astype(">u2"), ""),
    "ten_bits": (CODES.astype(np.uint16) * 4, "10 bits"),
    "int32": (CODES.astype(np.int32), "tells no full scale"),
    "int16": (CODES.astype(np.int16) * 4, "tells no full scale"),
    "int8": ((CODES // 2).astype(np.int8), "of 7 bits"),
    "int16_filled": ((CODES * 128).astype(np.int16), "of 15 bits"),
    "bool": (CODES > 128, ""),
    "zeros_and_ones": ((CODES > 128).astype(np.int64), ""),
    "float64": (CODES / 255, ""),
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_program_and_python_agree(tmp_path: Path, kind: str) -> None:
    array, words = KINDS[kind]
    np.save(tmp_path / "ideal.npy", array)
    options = ["--exposure-gain", "300", "--seed", "5", "--format", "npy", "--no-preview", "--save-ideal"]
    done = subprocess.run(
        [PROGRAM, "render", "ideal.npy", "-o", "out", *options],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    ideal = np.load(tmp_path / "out" / "ideal_000000.npy")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        given = clspeckle.simulate(array, exposure_gain_dn=300.0, seed=5)
    np.testing.assert_array_equal(given, clspeckle.simulate(ideal, exposure_gain_dn=300.0, seed=5))
    np.testing.assert_array_equal(given, np.load(tmp_path / "out" / "frame_000000.npy"))
    said = [str(one.message) for one in told]
    assert len(said) == (1 if words else 0)
    assert words in "".join(said)
    assert words in done.stderr if words else "full scale" not in done.stderr
    if words:
        # That of the codes' bits; the text is the same for all frames.
        advice = [one for one in re.findall(r"(ideal / (\d+)) makes", said[0]) if int(one[1]) >= array.max()]
        assert advice
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            clspeckle.simulate(eval(advice[0][0], {"ideal": array}))


@pytest.mark.parametrize("top", [1, 255])
def test_visibilities_of_a_scene_agree(tmp_path: Path, top: int) -> None:
    """Signed numbers tell no full scale: up to 1 they are taken as they are, and others are refused with a way out."""
    arrays: dict[str, npt.NDArray[Any]] = {
        "depth": np.full(SHAPE, 1.0),
        "texels": np.ones((8, 8)),
        "visibility": np.where(CODES > 128, top, 0).astype(np.int32),
    }
    for name, array in arrays.items():
        np.save(tmp_path / f"{name}.npy", array)
    camera = ["--fx", "30", "--fy", "30", "--cx", "15.5", "--cy", "11.5", "--pattern", "texels.npy"]
    extent = ["--pattern-half-extent-x", "0.9", "--pattern-half-extent-y", "0.9"]

    def render(visibility: str) -> subprocess.CompletedProcess[str]:
        command = [
            str(PROGRAM),
            "render",
            "--depth",
            "depth.npy",
            "--visibility",
            visibility,
            *camera,
            *extent,
            "-o",
            "out",
        ]
        options = ["--exposure-gain", "3000", "--seed", "5", "--format", "npy", "--no-preview"]
        return subprocess.run([*command, *options], cwd=tmp_path, check=False, capture_output=True, text=True)

    def python(visibility: npt.NDArray[Any]) -> npt.NDArray[Any]:
        pattern = clspeckle.Pattern(arrays["texels"], half_extent_x=0.9, half_extent_y=0.9)
        pipeline = clspeckle.Pipeline.from_parameters(SHAPE, pattern=pattern, seed=5, exposure_gain_dn=3000.0)
        lens = (30.0, 30.0, 15.5, 11.5)
        return pipeline.render(clspeckle.Geometry(depth=arrays["depth"], visibility=visibility, intrinsics=lens))

    done = render("visibility.npy")
    if top > 1:
        assert done.returncode != 0
        assert "tells no full scale" in done.stderr
        assert "visibility.npy:full_scale=255 divides its whole numbers" in done.stderr
        with (
            pytest.warns(UserWarning, match="tells no full scale"),
            pytest.raises(clspeckle.errors.InvalidDataError, match="visibility / 255"),
        ):
            python(arrays["visibility"])
        done = render("visibility.npy:full_scale=255")
    assert done.returncode == 0, done.stderr
    given = python(arrays["visibility"] / top)
    np.testing.assert_array_equal(given, np.load(tmp_path / "out" / "frame_000000.npy"))


def test_planes_of_a_scene() -> None:
    depth = np.full(SHAPE, 1.0)
    pattern = clspeckle.Pattern(np.ones((8, 8)))

    def ideal(**planes: Any) -> npt.NDArray[Any]:
        given: dict[str, Any] = {"depth": depth, "intrinsics": (30.0, 30.0, 15.5, 11.5), **planes}
        return np.asarray(pattern.lookup(clspeckle.Geometry(**given)))

    np.testing.assert_array_equal(ideal(), ideal(albedo=np.ones(SHAPE, bool), visibility=np.ones(SHAPE, bool)))
    for name in ("albedo", "visibility"):
        expected = ideal(**{name: (CODES / 255).astype(np.float32)})
        for array in (CODES.astype(np.uint8), CODES.astype(np.uint16) * 257):
            np.testing.assert_allclose(ideal(**{name: array}), expected, rtol=1e-6)
    ones = np.ones(SHAPE, np.int32)
    np.testing.assert_array_equal(ideal(visibility=ones), ideal())
    with (
        pytest.warns(UserWarning, match="tells no full scale") as doubts,
        pytest.raises(clspeckle.errors.InvalidDataError, match=r"values from 0 to 1; .*visibility / 255 brings them"),
    ):
        ideal(visibility=CODES.astype(np.int32))
    assert len(doubts) == 1
    with pytest.warns(UserWarning, match=r"tells no full scale|above 1") as told:
        ideal(albedo=CODES.astype(np.int32))
    assert len(told) == 2
    with pytest.raises(
        clspeckle.errors.InvalidFormatError, match="normal has dtype uint8, expected an image of vectors"
    ):
        ideal(normal=np.full((*SHAPE, 3), 128, np.uint8))
    with pytest.raises(clspeckle.errors.InvalidFormatError, match=r"depth \* 0.001") as refused:
        ideal(depth=(1000 * depth).astype(np.uint16))
    advice = re.search(r"(depth \* 0.001)", str(refused.value))
    assert advice
    np.testing.assert_array_equal(ideal(depth=eval(advice[1], {"depth": (1000 * depth).astype(np.uint16)})), ideal())
