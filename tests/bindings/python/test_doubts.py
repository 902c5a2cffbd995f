"""Arrays that are valid and can hardly be meant: Python tells what the program tells, and each advice is followed."""

from __future__ import annotations

import os
import re
import subprocess
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Callable

import numpy as np
import numpy.typing as npt
import pytest

import clspeckle

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))
SHAPE = (24, 32)
Array = npt.NDArray[Any]
RAMP: Array = np.linspace(0.1, 0.9, SHAPE[0] * SHAPE[1]).reshape(SHAPE).astype(np.float32)
DEPTH: Array = (0.8 + 0.2 * RAMP).astype(np.float32)
INTRINSICS = (30.0, 30.0, 15.5, 11.5)
FACING: Array = np.zeros((*SHAPE, 3), np.float32)
FACING[..., 2] = -1
OBLIQUE = (FACING + np.array([0.3, 0.2, 0.0])).astype(np.float32)
OBLIQUE /= np.linalg.norm(OBLIQUE, axis=-1, keepdims=True)
TEXELS: Array = np.ones((16, 16), np.float32)


def half(one: Array, other: Any) -> Array:
    """The left quarter is of one."""
    result = np.array(np.broadcast_to(other, one.shape), np.float32)
    result[:, : SHAPE[1] // 4] = one[:, : SHAPE[1] // 4]
    return result


def said(call: Callable[[], Any]) -> list[str]:
    """All that is told."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        call()
    return [str(one.message) for one in told]


def pipeline(texels: Array = TEXELS, gain: float = 3000.0) -> clspeckle.Pipeline:
    pattern = clspeckle.Pattern(texels, half_extent_x=0.9, half_extent_y=0.9)
    return clspeckle.Pipeline.from_parameters(SHAPE, pattern=pattern, seed=3, exposure_gain_dn=gain)


def of_geometry(texels: Array = TEXELS, **planes: Any) -> list[str]:
    """What is told of a scene's frame."""
    given = {"depth": DEPTH, "intrinsics": INTRINSICS, **planes}
    return said(lambda: pipeline(texels).render(clspeckle.Geometry(**given)))


def of_program(folder: Path, *arguments: str, **arrays: Array) -> str:
    """What the program tells of the same arrays as NPY files."""
    for name, array in arrays.items():
        np.save(folder / f"{name}.npy", array)
    done = subprocess.run(
        [PROGRAM, "render", *arguments, "-o", "out", "--no-preview", "--seed", "3"],
        cwd=folder,
        check=True,
        capture_output=True,
        text=True,
    )
    return done.stderr


EXTENT = ["--pattern-half-extent-x", "0.9", "--pattern-half-extent-y", "0.9"]
SCENE = ["--pattern", "texels.npy", *EXTENT, "--exposure-gain", "3000"]
CAMERA = ["--fx", "30", "--fy", "30", "--cx", "15.5", "--cy", "11.5"]

# Of each plane: what both tell, in words of which the program and Python have the same.
SCENES: dict[str, tuple[dict[str, Array], list[str]]] = {
    "metres": ({}, []),
    "millimetres": ({"depth": DEPTH * 1000}, ["m away in the median", "has no light"]),
    "centimetres": ({"depth": DEPTH * 120}, ["m away in the median", "has no light"]),
    "micrometres": ({"depth": DEPTH * 1e6}, ["no pixel", "infinite or beyond 65504 m", "has no light"]),
    "far_but_lit": ({"depth": DEPTH * 3}, []),
    "behind": ({"depth": -DEPTH}, ["no pixel", "depths are negative", "has no light"]),
    "nothing": ({"depth": DEPTH * 0}, ["no pixel", "infinite or beyond 65504 m", "has no light"]),
    "some_is_nothing": ({"depth": half(DEPTH, -1)}, []),
    "zero_around": ({"depth": half(DEPTH, 0)}, []),
    "infinite_around": ({"depth": half(DEPTH, np.inf)}, []),
    "nan_around": ({"depth": half(DEPTH, np.nan)}, []),
    "largest_half_around": ({"depth": half(DEPTH, 65504)}, []),
    "1e10_around": ({"depth": half(DEPTH, 1e10)}, []),
    "wall_of_80_m": ({"depth": half(DEPTH, 80)}, []),
    "facing": ({"normal": FACING}, []),
    "oblique": ({"normal": OBLIQUE}, []),
    "away": ({"normal": OBLIQUE * [1, -1, -1]}, ["face away from the camera", "has no light"]),
    "away_on_a_quarter": ({"normal": half(-FACING, FACING)}, []),
    "away_where_nothing_is": ({"normal": half(FACING, -FACING), "depth": half(DEPTH, 0)}, []),
    "nan_where_nothing_is": ({"normal": half(FACING, np.nan), "depth": half(DEPTH, 0)}, []),
    "encoded": ({"normal": 0.5 + 0.5 * FACING}, ["look encoded as colors"]),
    "dark_pattern": ({"texels": TEXELS * 0}, ["0 everywhere", "has no light"]),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_program_and_python_tell_the_same_of_scenes(tmp_path: Path, name: str) -> None:
    changed, words = SCENES[name]
    planes: dict[str, Array] = {"depth": DEPTH, "texels": TEXELS, **changed}
    options = [word for plane in planes if plane != "texels" for word in (f"--{plane}", f"{plane}.npy")]
    program = of_program(tmp_path, *options, *SCENE, *CAMERA, **planes)
    python = "\n".join(of_geometry(**planes))
    for told, where in ((program, "the program"), (python, "Python")):
        for word in words:
            assert word in told, where
        if name != "encoded":  # normals that are not of unit length are another warning of the program
            assert bool(told) == bool(words), where


# Arrays, gain, what both tell.
IDEALS: dict[str, tuple[Array, float, str]] = {
    "fits": (RAMP, 300.0, ""),
    "zero": (RAMP * 0, 300.0, "0 everywhere"),
    "dim": (RAMP * 1e-4, 300.0, "less than half a code"),
    "dim_8_bits": ((RAMP * 10).astype(np.uint8), 5.0, "less than half a code"),
    "one_bright_pixel": ((np.arange(RAMP.size) == 400).reshape(SHAPE).astype(np.float32), 300.0, ""),
    "codes_as_floats": (np.rint(RAMP * 200 + 50), 300.0, "at the top code"),
    "codes_of_10_bits": (np.rint(RAMP * 1000 + 20), 300.0, "at the top code"),
    "high_dynamic_range": (np.where(RAMP > 0.85, 5000.0, RAMP), 300.0, ""),
    "free_scale": (RAMP * 40, 7.0, ""),
    "free_scale_that_is_lost": (RAMP * 1e5, 300.0, "at the top code"),
}


@pytest.mark.parametrize("name", IDEALS)
def test_the_program_and_python_tell_the_same_of_ideal_images(tmp_path: Path, name: str) -> None:
    array, gain, words = IDEALS[name]
    program = of_program(tmp_path, "ideal.npy", "--exposure-gain", str(gain), ideal=array)
    python = said(lambda: clspeckle.simulate(array, exposure_gain_dn=gain, seed=3))
    assert bool(program) == bool(python) == bool(words)
    if words:
        assert words in program
        assert len(python) == 1
        assert words in python[0]


@pytest.mark.parametrize("name", [name for name in IDEALS if "code" in IDEALS[name][2]])
def test_what_is_advised_of_an_exposure_helps(name: str) -> None:
    scene, gain, _ = IDEALS[name]
    (told,) = said(lambda: clspeckle.simulate(scene, exposure_gain_dn=gain, seed=3))
    advice = re.search(r"exposure_gain_dn=(\d+ / scene\.max\(\))", told)
    assert advice
    chosen = float(eval(advice[1], {"scene": scene}))
    assert said(lambda: clspeckle.simulate(scene, exposure_gain_dn=chosen, seed=3)) == []
    divided = re.search(r"(scene / \d+) makes", told)
    assert bool(divided) == name.startswith("codes")
    if divided:
        given = eval(divided[1], {"scene": scene})
        assert said(lambda: clspeckle.simulate(given, exposure_gain_dn=gain, seed=3)) == []


def test_darkness_that_is_meant_is_not_told() -> None:
    dark = np.zeros(SHAPE, np.float32)
    camera = clspeckle.Pipeline.from_parameters(SHAPE, seed=3)
    assert said(camera.warm_up) == []
    assert said(lambda: camera.render(illumination="dark")) == []
    assert len(said(lambda: camera.render(dark))) == 1
    assert len(said(lambda: camera.render(dark, illumination="incoherent"))) == 1


def test_what_is_advised_of_planes_helps() -> None:
    for factor, advice in ((1000, "depth * 0.001"), (100, "depth * 0.01")):
        depth = DEPTH * 1.2 * factor
        told = of_geometry(depth=depth)
        assert advice in told[0]
        assert of_geometry(depth=eval(advice, {"depth": depth})) == []
    for normal in (OBLIQUE * [1, -1, -1], 0.5 + 0.5 * FACING):
        told = of_geometry(normal=normal)
        advised = re.search(r"give ([^:]*)$", told[0])
        assert advised
        assert of_geometry(normal=eval(advised[1], {"normal": normal})) == []
    cut = (OBLIQUE * 0.9).astype(np.int8)
    assert "shorter than 0.5" in of_geometry(normal=cut)[0]
    position = np.dstack([*np.meshgrid(np.linspace(-0.4, 0.4, SHAPE[1]), np.linspace(-0.3, 0.3, SHAPE[0])), DEPTH])
    camera = pipeline()
    assert said(lambda: camera.render(clspeckle.Geometry(position=position, normal=OBLIQUE))) == []
    assert "face away" in said(lambda: camera.render(clspeckle.Geometry(position=position, normal=-OBLIQUE)))[0]


def test_positions_may_be_of_any_frame(tmp_path: Path) -> None:
    """A wall at z = -2 m of a world with z upwards, seen and lit from above it."""
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, SHAPE[1]), np.linspace(0.3, -0.3, SHAPE[0]))
    position = np.dstack([x, y, np.full(SHAPE, -2.0)]).astype(np.float32)
    pose = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, -1.0]])  # the laser is 1 m above it and looks down
    pattern = clspeckle.Pattern(TEXELS, half_extent_x=0.9, half_extent_y=0.9, laser_from_geometry=pose)
    for normal, words in ((-FACING, ""), (FACING, "face away from the laser")):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            pattern.lookup(clspeckle.Geometry(position, normal=normal))
        python = "".join(str(one.message) for one in told)
        given = ",".join(str(number) for number in pose.ravel())
        program = of_program(
            tmp_path, "--position", "position.npy", "--normal", "normal.npy", *SCENE,
            f"--pattern-laser-from-geometry={given}", position=position, normal=normal, texels=TEXELS,
        )  # fmt: skip
        assert bool(python) == bool(program) == bool(words)
        assert words in python
        assert words in program
    moved = clspeckle.Pattern(TEXELS, half_extent_x=0.9, half_extent_y=0.9)
    moved.set_pose(pose)
    assert said(lambda: moved.lookup(clspeckle.Geometry(position, normal=-FACING))) == []


REFUSED: dict[str, dict[str, Array]] = {
    "normal": {"channels_first": np.moveaxis(OBLIQUE, -1, 0).copy(), "colors": 0.5 - 0.5 * FACING},
    "albedo": {"codes_as_floats": np.rint(RAMP * 255)},
    "depth": {"one_of_several": DEPTH[np.newaxis], "channels": np.stack([DEPTH] * 3)},
}
REFUSED["normal"]["codes"] = np.rint((0.5 + 0.5 * OBLIQUE) * 255).astype(np.uint8)
REFUSED["normal"]["codes_as_floats"] = REFUSED["normal"]["codes"].astype(np.float32)


@pytest.mark.parametrize(("plane", "kind"), [(plane, kind) for plane in REFUSED for kind in REFUSED[plane]])
def test_what_is_refused_has_a_way_out(plane: str, kind: str) -> None:
    array = REFUSED[plane][kind]
    with pytest.raises(clspeckle.errors.ClspeckleError) as refused:
        of_geometry(**{plane: array})
    advice = re.search(
        rf"((?:2 \* |np\.moveaxis\()?\b{plane}(?:, 0, -1\)|\[0\]| / 255)?(?: \* 2)?(?: - 1)?)(?: |$)(?!has|must)",
        str(refused.value),
    )
    assert advice
    told = of_geometry(**{plane: eval(advice[1], {plane: array, "np": np})})
    if kind == "colors":  # those of most renderers have y up and z towards the camera, too
        assert "face away from the camera" in told[0]
    else:
        assert told == []


def test_each_cause_is_told_once_for_a_line_of_code() -> None:
    camera = pipeline()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("default")
        for frame in range(4):
            camera.render(clspeckle.Geometry(depth=DEPTH * (1000 + frame), intrinsics=INTRINSICS))
            clspeckle.simulate(RAMP * (1e5 + frame), exposure_gain_dn=300.0, seed=3)
            clspeckle.simulate((RAMP * (500 + 9 * frame)).astype(np.uint16), exposure_gain_dn=300.0, seed=3)
    assert len(told) == 4
    assert {one.filename for one in told} == {__file__}


def frames(count: int = 8) -> Array:
    return np.random.default_rng(1).integers(60, 70, (count, 48, 64)).astype(np.uint16)


def test_frames_behind_height_and_width() -> None:
    stack = np.moveaxis(frames(), 0, -1)
    camera = {"bits": 10}
    (told,) = said(lambda: clspeckle.Capture.from_arrays({"dark": stack}, camera=camera))
    assert "is taken as 48 frames, 64 pixels high and 8 wide" in told

    def opened(message: str, codes: Array, **more: Array) -> None:
        advice = re.search(r"(np\.moveaxis\(codes, -1, 0\))", message)
        assert advice
        given = eval(advice[1], {"codes": codes, "np": np})
        assert said(lambda: clspeckle.Capture.from_arrays({"dark": given, **more}, camera=camera)) == []

    opened(told, stack)
    ideal = np.resize(RAMP, (6, 48, 64))
    (told,) = said(lambda: clspeckle.simulate(np.moveaxis(ideal, 0, -1)))
    assert "np.moveaxis(ideal, -1, 0)" in told
    assert said(lambda: clspeckle.simulate(ideal)) == []

    refusals: Iterator[dict[str, Array]] = iter(
        ({"dark": stack, "flat": frames()}, {"flat": frames(), "dark": stack}, {"dark": stack[..., :3]})
    )
    for given in refusals:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with pytest.raises(clspeckle.errors.InvalidArgumentError) as refused:
                clspeckle.Capture.from_arrays(given, camera=camera)
        opened(str(refused.value), given["dark"])
    for shape in ((8, 48, 64), (200, 48, 64), (1, 48, 64)):
        given = {"dark": np.resize(frames(), shape)}
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            clspeckle.Capture.from_arrays(given, camera=camera)
