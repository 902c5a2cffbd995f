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


def of_ideal(ideal: Array, **parameters: Any) -> list[str]:
    """What is told of an ideal image's frame."""
    return said(lambda: clspeckle.simulate(ideal, **parameters, seed=3))


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
    "far_plane": ({"depth": half(DEPTH, 1000)}, []),
    "far_plane_of_millimetres": ({"depth": half(DEPTH * 1000, 5000)}, ["m away in the median", "has no light"]),
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
    "high_dynamic_range": (np.where(RAMP > 0.85, 500.0, RAMP), 300.0, ""),
    "dark_photograph": (np.rint(30 * RAMP**2), 512.0, "at the top code"),
    "sparse_photograph": (np.where(RAMP > 0.8, np.rint(200 * RAMP), 0), 512.0, "at the top code"),
    "small_highlight": (np.where(RAMP > 0.85, 200.0, 0.3), 512.0, ""),
    "all_at_half_of_full_scale": (np.ones(SHAPE, np.float32), 512.0, ""),
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
    advice = re.search(r"with exposure_gain_dn=(\d+ / float\(ideal\.max\(\)\)) the", told)
    assert advice
    chosen = float(eval(advice[1], {"ideal": scene}))
    assert said(lambda: clspeckle.simulate(scene, exposure_gain_dn=chosen, seed=3)) == []
    divided = re.search(r"(ideal / N) makes N the number that means 1 \((.*)\)", told)
    assert bool(divided) == (scene.dtype.kind == "f" and scene.max() > 1)
    if divided and "lost" not in name:
        tops = map(int, re.findall(r"\b\d{3,}\b", divided[2]))
        largest = next(top for top in tops if top >= scene.max())
        given = eval(divided[1], {"ideal": scene, "N": largest})
        assert said(lambda: clspeckle.simulate(given, exposure_gain_dn=gain, seed=3)) == []


ELECTRONS = {"photons_per_unit": 4000.0, "quantum_efficiency": 0.4, "conversion_gain_dn_per_e": 0.25}


@pytest.mark.parametrize("factor", [1e-4, 1e4])
def test_the_exposure_of_a_sensor_that_counts_photons(factor: float) -> None:
    ideal = RAMP * factor
    (told,) = of_ideal(ideal, **ELECTRONS)
    advice = re.search(r"with photons_per_unit=(\S+ / float\(ideal\.max\(\)\)) the", told)
    assert advice
    assert "exposure_gain_dn" not in told
    given = {**ELECTRONS, "photons_per_unit": eval(advice[1], {"ideal": ideal})}
    assert of_ideal(ideal, **given) == []


@pytest.mark.parametrize("bits", [10, 16])
def test_the_exposure_of_numbers_near_the_end_of_their_type(bits: int) -> None:
    for ideal in ((RAMP * 1e-6).astype(np.float16), (RAMP * 1e-5).astype(np.float16)):
        (told,) = of_ideal(ideal, bits=bits, exposure_gain_dn=100.0)
        advice = re.search(r"exposure_gain_dn=(.*max\(\)\))", told)
        assert advice
        gain = eval(advice[1], {"ideal": ideal})
        assert of_ideal(ideal, bits=bits, exposure_gain_dn=gain) == []
    denormal = RAMP * np.float32(1e-42)
    (told,) = of_ideal(denormal)
    advice = re.search(r"(ideal / float\(ideal\.max\(\)\)) makes", told)
    assert advice
    assert of_ideal(eval(advice[1], {"ideal": denormal})) == []


def test_what_else_fills_a_frame_is_not_the_exposure() -> None:
    (told,) = of_ideal(RAMP, dark_frame_dn=np.full(SHAPE, 1023.0))
    assert "dark_frame_dn" in told
    assert "exposure_gain_dn" not in told


def test_ambient_light_is_light(tmp_path: Path) -> None:
    dark = RAMP * 0
    several: tuple[dict[str, Any], ...] = ({"ambient": 0.05}, {"effects": {"ambient_light": {}}})
    for ambient in several:
        assert of_ideal(dark, **ambient) == []
    assert len(of_ideal(dark, ambient=1e-6)) == 1
    assert of_program(tmp_path, "ideal.npy", "--effect", "ambient_light", ideal=dark) == ""
    assert "has no light" in of_program(tmp_path, "ideal.npy", ideal=dark)
    unlit = clspeckle.Pattern(TEXELS, half_extent_x=0.9, half_extent_y=0.9)
    camera = clspeckle.Pipeline.from_parameters(SHAPE, pattern=unlit, seed=3, ambient=0.05)
    told = said(lambda: camera.render(clspeckle.Geometry(depth=-DEPTH, intrinsics=INTRINSICS)))
    assert "the pattern brings no light" in told[1]
    program = of_program(tmp_path, "--depth", "depth.npy", *SCENE, *CAMERA, "--effect", "ambient_light",
                         depth=-DEPTH, texels=TEXELS)  # fmt: skip
    assert "the pattern brings no light" in program


def test_darkness_that_simulate_is_given_has_a_way_out() -> None:
    for ideal in (RAMP * 0, np.zeros((2, *SHAPE), np.float32)):
        told = of_ideal(ideal)
        advice = re.search(r"If no light is meant, (clspeckle\.\S+) says so", told[0])
        assert advice
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert eval(advice[1], {"clspeckle": clspeckle, "ideal": ideal}).shape == SHAPE


def test_all_columns_are_looked_at() -> None:
    """Where the columns are 1 m away, the first one is what a stride of a row would meet."""
    for width in (33, 999, 1000, 1001, 1280):
        depth = np.linspace(1400, 1600, (width - 1) * width, dtype=np.float32).reshape(-1, width)
        depth[:, 0] = 1.0
        assert "m away in the median" in "".join(
            said(lambda: clspeckle._check.depth_plane(depth, "depth"))  # noqa: B023
        )


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


def test_sky_of_the_largest_half_is_no_surface_in_another_unit() -> None:
    for sky in (65504, 1e10):
        depth = half(DEPTH * 1000, sky)
        (told, *_) = of_geometry(depth=half(np.full(SHAPE, sky), DEPTH * 1000))
        advice = re.search(r"lights up; (.*) makes metres of millimetres", told)
        assert advice
        metres = eval(advice[1], {"depth": depth, "np": np})
        assert np.isinf(metres[depth == np.float32(sky)]).all()
        assert of_geometry(depth=metres) == []


@pytest.mark.parametrize("nothing", [0.0, 1e10, np.nan, np.inf])
def test_normals_count_where_positions_are(tmp_path: Path, nothing: float) -> None:
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, SHAPE[1]), np.linspace(-0.3, 0.3, SHAPE[0]))
    position = half(np.dstack([x, y, DEPTH]), nothing)
    normal = half(FACING, 0)
    camera = pipeline()
    assert said(lambda: camera.render(clspeckle.Geometry(position=position, normal=normal))) == []
    files = ["--position", "position.npy", "--normal", "normal.npy"]
    planes = {"position": position, "texels": TEXELS}
    assert of_program(tmp_path, *files, *SCENE, normal=normal, **planes) == ""
    normal[:, 0] = 0  # where there is a surface
    assert "not of unit length" in of_program(tmp_path, *files, *SCENE, normal=normal, **planes)


def test_an_albedo_above_one_is_no_code() -> None:
    albedo = 1.5 * RAMP / RAMP.max()
    with pytest.raises(clspeckle.errors.InvalidDataError) as refused:
        of_geometry(albedo=albedo)
    assert "/ 255" not in str(refused.value)
    advice = re.search(r"; (np\.minimum\(albedo, 1\)) cuts", str(refused.value))
    assert advice
    assert of_geometry(albedo=eval(advice[1], {"albedo": albedo, "np": np})) == []


def test_normals_of_another_length_have_a_way_out() -> None:
    normal = np.rint(OBLIQUE * 127).astype(np.int8)
    with pytest.raises(clspeckle.errors.InvalidDataError) as refused:
        of_geometry(normal=normal)
    advice = re.search(r"give (normal / np\.linalg\.norm\(normal, axis=-1, keepdims=True\))", str(refused.value))
    assert advice
    assert of_geometry(normal=eval(advice[1], {"normal": normal, "np": np})) == []


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
            clspeckle.simulate((RAMP * 200 * 2**frame).astype(np.uint16), exposure_gain_dn=3e5, seed=3)
            clspeckle.simulate((RAMP * 200 * 2**frame).astype(np.int32), exposure_gain_dn=300.0, seed=3)
            clspeckle.simulate(np.rint(RAMP * 200 * 2**frame), exposure_gain_dn=300.0, seed=3)
    assert len(told) == 6
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
