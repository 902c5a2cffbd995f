"""Arrays that are valid and can hardly be meant: Python tells what the program tells, and each advice is followed."""

from __future__ import annotations

import json
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
    "nan_around_in_three_channels": ({"depth": np.dstack([half(DEPTH, np.nan)] * 3)}, []),
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
    advice = re.search(r"with exposure_gain_dn=(\S+ / float\(ideal\.max\(\)\)) the", told)
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


FULL: dict[str, tuple[Array, list[str], dict[str, Any], str]] = {
    "ambient light over nothing": (
        RAMP * 0, ["--effect", "ambient_light:level_dn=2000"], {"effects": {"ambient_light": {"level_dn": 2000.0}}},
        "at the top code",
    ),
    "ambient light over dim light": (
        RAMP * 1e-5, ["--effect", "ambient_light:level_dn=2000"], {"effects": {"ambient_light": {"level_dn": 2000.0}}},
        "at the top code",
    ),
    "little ambient light": (
        RAMP * 0, ["--effect", "ambient_light:level_dn=20"], {"effects": {"ambient_light": {"level_dn": 20.0}}}, ""
    ),
    "ambient light over light": (
        RAMP, ["--effect", "ambient_light:level_dn=2000"], {"effects": {"ambient_light": {"level_dn": 2000.0}}},
        "at the top code",
    ),
    "black level near the top": (RAMP * 1e-6, ["--black-level", "1000"], {"black_level_dn": 1000.0}, "half a code"),
    "black level beyond half": (RAMP * 1e-6, ["--black-level", "700"], {"black_level_dn": 700.0}, "half a code"),
    "a gain of nothing": (RAMP, ["--exposure-gain", "0"], {"exposure_gain_dn": 0.0}, ""),
}  # fmt: skip


@pytest.mark.parametrize("kind", FULL)
def test_what_fills_the_range_is_told_alike(tmp_path: Path, kind: str) -> None:
    ideal, options, parameters, words = FULL[kind]
    program = of_program(tmp_path, "ideal.npy", *options, ideal=ideal)
    python = of_ideal(ideal, **parameters)
    assert bool(program) == bool(words)
    assert len(python) == (1 if words else 0)
    assert words in program
    assert words in "".join(python)
    if "half a code" in words:  # what both advise leaves room, and is no more than that
        assert "--exposure-gain auto finds one" in program
        assert of_program(tmp_path, "ideal.npy", *options, "--exposure-gain", "auto", ideal=ideal) == ""
        advice = re.search(r"exposure_gain_dn=(\S+ / float\(ideal\.max\(\)\)) the", python[0])
        assert advice
        assert of_ideal(ideal, **parameters, exposure_gain_dn=eval(advice[1], {"ideal": ideal})) == []
    if "top code" in words:
        assert "--exposure-gain auto" not in program
        assert "exposure_gain_dn" not in python[0]


def test_empty_arrays_are_refused_alike(tmp_path: Path) -> None:
    for shape in ((0, 48, 64), (0, 64), (48, 0), (3, 48, 0), (48, 0, 3), (0, 48, 64, 3)):
        with pytest.raises(subprocess.CalledProcessError) as program:
            of_program(tmp_path, "ideal.npy", ideal=np.zeros(shape, np.float32))
        with pytest.raises(clspeckle.errors.ClspeckleError, match="no side may be 0"):
            clspeckle.simulate(np.zeros(shape, np.float32))
        assert "no side may be 0" in program.value.stderr


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
        advised = re.search(r"then give (.*)$", told[0])
        assert advised
        assert of_geometry(normal=eval(advised[1], {"normal": normal})) == []
    cut = (OBLIQUE * 0.9).astype(np.int8)
    assert "shorter than 0.5" in of_geometry(normal=cut)[0]
    position = np.dstack([*np.meshgrid(np.linspace(-0.4, 0.4, SHAPE[1]), np.linspace(-0.3, 0.3, SHAPE[0])), DEPTH])
    camera = pipeline()
    assert said(lambda: camera.render(clspeckle.Geometry(position=position, normal=OBLIQUE))) == []
    assert "face away" in said(lambda: camera.render(clspeckle.Geometry(position=position, normal=-OBLIQUE)))[0]


FOLLOWED: dict[str, tuple[str, Array]] = {
    "albedo_above_one": ("albedo", 1.5 * RAMP / RAMP.max()),
    "albedo_as_codes": ("albedo", np.rint(RAMP * 255)),
    "normals_that_face_away": ("normal", OBLIQUE * np.array([1, -1, -1], np.float32)),
    "normals_as_colors": ("normal", 0.5 + 0.5 * OBLIQUE),
    "normals_as_codes": ("normal", np.rint(255 * (0.5 + 0.5 * OBLIQUE))),
    "normals_that_are_longer": ("normal", np.rint(127 * OBLIQUE)),
}


@pytest.mark.parametrize("four", [False, True])
@pytest.mark.parametrize("kind", FOLLOWED)
def test_what_the_program_advises_of_planes_helps(tmp_path: Path, kind: str, four: bool) -> None:
    plane, array = FOLLOWED[kind]
    if four and plane == "normal":
        array = np.dstack([array, np.ones(SHAPE)])
    files = ["--depth", "depth.npy", f"--{plane}", f"{plane}.npy"]
    given: dict[str, Array] = {"depth": DEPTH, "texels": TEXELS, plane: array.astype(np.float32)}
    told = of_program(tmp_path, *files, *SCENE, *CAMERA, **given)
    advice = re.search(r"save ((?:2 \* )?(?:normals\[|numpy\.minimum\().*?)(?:,? (?:if|which) .*)?$", told, re.M)
    if named := re.search(r"if 255 stands for 1, (\S+) divides them", told):
        files[-1] = named[1]
        assert of_program(tmp_path, *files, *SCENE, *CAMERA, **given) == ""
        return
    assert advice, told
    given[plane] = np.asarray(eval(advice[1], {"numpy": np, "normals": given[plane], "albedo": given[plane]}))
    assert of_program(tmp_path, *files, *SCENE, *CAMERA, **given) == ""


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


SEEN = RAMP / RAMP.max()


@pytest.mark.parametrize("plane", ["albedo", "visibility"])
@pytest.mark.parametrize(
    ("array", "words"),
    [
        (1.5 * SEEN, "np.minimum({}, 1)"),
        (1.05 + 0.25 * SEEN, "np.minimum({}, 1)"),
        (80 * SEEN, "{} / 100"),
        (255.5 * SEEN, "np.minimum({} / 255, 1)"),
        (900 * SEEN, "{} / 1023"),
        (np.rint(255 * SEEN), "{} / 255"),
        (np.rint(1023 * SEEN), "{} / 1023"),
        (np.rint(65535 * SEEN), "{} / 65535"),
    ],
)
def test_numbers_above_one_are_divided_where_cutting_makes_all_one(plane: str, array: Array, words: str) -> None:
    array = array.astype(np.float32)
    if plane == "visibility":
        with pytest.raises(clspeckle.errors.InvalidDataError) as refused:
            of_geometry(visibility=array)
        told = str(refused.value)
    else:
        told = of_geometry(albedo=array)[0]
    advice = words.format(plane)
    assert f"; {advice} " in told
    assert of_geometry(**{plane: eval(advice, {plane: array, "np": np})}) == []


def test_zeros_and_ones_as_integers(tmp_path: Path) -> None:
    """As masks are saved; the program says so, too."""
    for kind in (np.uint8, np.uint16):
        ones = (RAMP > 0.4).astype(kind)
        advice = re.search(r"if they are 0 and 1, (ideal / 1) makes 1 mean 1", of_ideal(ones)[0])
        assert advice
        assert of_ideal(eval(advice[1], {"ideal": ones})) == []
        assert "its largest number is 1 of" in of_program(tmp_path, "ideal.npy", ideal=ones)


def test_swapped_bytes_are_told_as_the_program_tells_them(tmp_path: Path) -> None:
    random = np.random.default_rng(4)
    for bits, words in ((10, "=u2"), (12, ">u2"), (14, "=u2")):
        codes = random.integers(1, 2**bits, SHAPE, dtype=np.uint16)
        codes[0, 0] = 2**bits - 1
        swapped = codes.byteswap().astype(np.dtype(words))
        (told,) = [one for one in of_ideal(swapped) if "bytes were swapped" in one]
        assert "bytes were swapped" in of_program(tmp_path, "ideal.npy", ideal=swapped)
        advice = re.search(r"if so, give (ideal\.byteswap\(\))$", told)
        assert advice
        given = eval(advice[1], {"ideal": swapped})
        assert not [one for one in of_ideal(given) if "swapped" in one]
        for clean in (codes << np.uint16(16 - bits), codes >> np.uint16(bits - 8) << np.uint16(8), codes & 3):
            assert not [one for one in of_ideal(clean) if "swapped" in one]
            assert "swapped" not in of_program(tmp_path, "ideal.npy", ideal=clean)


def test_normals_of_another_length_have_a_way_out() -> None:
    """Also where some of them are 0, and of four channels."""
    longer = np.rint(OBLIQUE * 127).astype(np.int8)
    longer[0, :4] = 0
    for normal in (longer, np.dstack([longer, np.full(SHAPE, 9, np.int8)])):
        told = of_geometry(normal=normal)
        advice = re.search(r"give (normal\[.*np\.linalg\.norm.*)$", told[0])
        assert advice
        given = eval(advice[1], {"normal": normal, "np": np})
        assert np.isfinite(given).all()
        assert of_geometry(normal=given) == []
    one = OBLIQUE.copy()
    one[5, 7] *= 50
    assert "some normals are longer" in of_geometry(normal=one)[0]


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
    "normal": {
        "channels_first": np.moveaxis(OBLIQUE, -1, 0).copy(),
        "codes": np.rint((0.5 + 0.5 * OBLIQUE) * 255).astype(np.uint8),
    },
    "depth": {
        "one_of_several": np.stack([DEPTH] * 3),
        "whole_numbers": np.rint(DEPTH * 1000).astype(np.uint16),
        "channels": np.dstack([DEPTH, DEPTH * 2, DEPTH]),
    },
}
REFUSED["normal"]["codes_of_four_channels"] = np.dstack([REFUSED["normal"]["codes"], np.full(SHAPE, 255, np.uint8)])


@pytest.mark.parametrize(("plane", "kind"), [(plane, kind) for plane in REFUSED for kind in REFUSED[plane]])
def test_what_is_refused_has_a_way_out(plane: str, kind: str) -> None:
    array = REFUSED[plane][kind]
    with pytest.raises(clspeckle.errors.ClspeckleError) as refused:
        of_geometry(**{plane: array})
    advice = re.search(
        rf"(np\.moveaxis\({plane}, 0, -1\)|{plane}\[\.\.\., :3\] / 255 \* 2 - 1|{plane}\[0\]|{plane}\[\.\.\., 0\]"
        rf"|{plane} \* 0\.001)",
        str(refused.value),
    )
    assert advice, str(refused.value)
    assert of_geometry(**{plane: eval(advice[1], {plane: array, "np": np})}) == []


COLORS: dict[str, Array] = {
    "of_0_to_1": 0.5 - 0.5 * FACING,
    "of_0_to_1_facing": 0.5 + 0.5 * OBLIQUE,
    "of_8_bits": np.rint((0.5 + 0.5 * OBLIQUE) * 255),
}


@pytest.mark.parametrize("four", [False, True])
@pytest.mark.parametrize("kind", COLORS)
def test_normals_as_colors_have_a_way_out(kind: str, four: bool) -> None:
    normal = np.dstack([COLORS[kind], np.ones(SHAPE)]) if four else COLORS[kind]
    told = of_geometry(normal=normal)
    advice = re.search(r"then give (.*)$", told[0])
    assert advice
    assert "as colors" in told[0]
    again = of_geometry(normal=eval(advice[1], {"normal": normal}))
    if kind == "of_0_to_1":  # those of most renderers have y up and z towards the camera, too
        turned = re.search(r"then give (.*)$", again[0])
        assert turned
        assert "face away from the camera" in again[0]
        normal = eval(advice[1], {"normal": normal})
        assert of_geometry(normal=eval(turned[1], {"normal": normal})) == []
    else:
        assert again == []


@pytest.mark.parametrize("kind", ["channels_first", "whole_numbers"])
def test_positions_that_are_refused_have_a_way_out(kind: str) -> None:
    """Of a look-up, which knows the size by the positions alone, and of a frame."""
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, SHAPE[1]), np.linspace(-0.3, 0.3, SHAPE[0]))
    meant = np.dstack([x, y, DEPTH]).astype(np.float32)
    position = {"channels_first": np.moveaxis(meant, -1, 0).copy(), "whole_numbers": np.rint(meant * 1000).astype(int)}
    pattern = clspeckle.Pattern(TEXELS, half_extent_x=0.9, half_extent_y=0.9)
    for call in (pattern.lookup, pipeline().render):
        with pytest.raises(clspeckle.errors.ClspeckleError) as refused:
            call(clspeckle.Geometry(position[kind]))
        advice = re.search(r"(np\.moveaxis\(position, 0, -1\)|position \* 0\.001)", str(refused.value))
        assert advice
        given = eval(advice[1], {"position": position[kind], "np": np})
        assert np.allclose(given, meant, atol=1e-3)
        assert said(lambda: call(clspeckle.Geometry(given))) == []  # noqa: B023


def test_light_that_a_small_aperture_keeps_away(tmp_path: Path) -> None:
    dim = RAMP * np.float32(0.03)
    (told,) = of_ideal(dim, f_number=16.0)
    assert "the part that the aperture passes" in told
    advice = re.search(r"with exposure_gain_dn=(\S+ / float\(ideal\.max\(\)\)) the", told)
    assert advice
    assert of_ideal(dim, f_number=16.0, exposure_gain_dn=eval(advice[1], {"ideal": dim})) == []
    assert of_ideal(dim, f_number=4.0) == []
    assert of_ideal(dim, f_number=16.0, normalization="unit_mean") == []
    assert "of which the aperture passes" in of_program(tmp_path, "ideal.npy", "--f-number", "16", ideal=dim)
    assert of_program(tmp_path, "ideal.npy", "--f-number", "4", ideal=dim) == ""
    auto = of_program(tmp_path, "ideal.npy", "--f-number", "16", "--exposure-gain", "auto", ideal=dim)
    assert "has no light" not in auto


def test_dots_without_light() -> None:
    outside = clspeckle.Dots(SHAPE, np.array([[500.0, 500.0], [-90.0, 3.0]]), sigma_px=2)
    inside = clspeckle.Dots(SHAPE, np.array([[10.0, 12.0], [20.0, 8.0]]), sigma_px=2)
    told = said(clspeckle.Pipeline.from_parameters(SHAPE, dots=outside, seed=3).render)
    assert len(told) == 1
    assert "inside the image" in told[0]
    camera = clspeckle.Pipeline.from_parameters(SHAPE, dots=inside, seed=3, exposure_gain_dn=2000.0)
    assert said(camera.render) == []
    assert camera.sensor is not None
    camera.sensor.exposure_gain_dn = 1e-3
    assert len(said(camera.render)) == 1
    camera.sensor.exposure_gain_dn = 2000.0
    inside.configure(np.array([[500.0, 500.0]]), sigma_px=2)
    assert len(said(camera.render)) == 1


def test_a_later_frame_without_light(tmp_path: Path) -> None:
    lit = clspeckle.Geometry(depth=DEPTH, intrinsics=INTRINSICS)
    for dark in ({"depth": DEPTH * 0 + 30}, {"visibility": RAMP * 0}, {"normal": FACING * 0}):
        planes: dict[str, Any] = {"depth": DEPTH, **dark}
        camera = pipeline()
        assert said(lambda: camera.render(lit)) == []  # noqa: B023
        assert said(lambda: camera.render(lit)) == []  # noqa: B023
        unlit = clspeckle.Geometry(intrinsics=INTRINSICS, **planes)
        assert "has no light" in said(lambda: camera.render(unlit))[-1]  # noqa: B023
        assert said(lambda: camera.render(lit)) == []  # noqa: B023
        assert "has no light" in said(lambda: camera.render_batch([lit, unlit]))[-1]  # noqa: B023
    stack = np.stack([DEPTH, DEPTH, DEPTH * 0 + 30])
    program = of_program(tmp_path, "--depth", "depth.npy", *SCENE, *CAMERA, depth=stack, texels=TEXELS)
    assert program.count("has no light") == 1
    ideal = np.stack([RAMP, RAMP, RAMP * 0, RAMP * 0])
    program = of_program(tmp_path, "ideal.npy", ideal=ideal)
    assert program.count("has no light") == 1
    assert "ideal.npy[2]" in program
    assert of_program(tmp_path, "ideal.npy", ideal=ideal[:2]) == ""
    assert "has no light" in said(lambda: clspeckle.simulate(ideal))[0]


ENDS: dict[str, tuple[dict[str, Any], list[str], bool]] = {
    "saturation_dn": ({"saturation_dn": 300.0}, ["--saturation-dn", "300"], True),
    "full_well": ({"effects": {"full_well": {"level_dn": 300.0}}}, ["--effect", "full_well:level_dn=300"], True),
    "full_well_and_gamma": (
        {"effects": {"full_well": {"level_dn": 300.0}, "gamma": {"gamma": 0.8}}},
        ["--effect", "full_well:level_dn=300", "--effect", "gamma:gamma=0.8"],
        True,
    ),
    "adc_bits": ({"effects": {"adc_bits": {"bits": 6}}}, ["--effect", "adc_bits:bits=6"], False),
    "full_well_e": ({"photons_per_unit": 4e3, "quantum_efficiency": 0.4, "conversion_gain_dn_per_e": 0.25,
                     "full_well_e": 1200.0}, [], True),
    "effective_bits": ({"bits": 16, "effective_bits": 10, "exposure_gain_dn": 3e4}, [], False),
}  # fmt: skip


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
@pytest.mark.parametrize("kind", ENDS)
def test_a_signal_that_ends_below_the_top_code(tmp_path: Path, kind: str, dtype: type) -> None:
    parameters, options, below = ENDS[kind]
    bright = RAMP * np.float32(300)
    (told,) = said(lambda: clspeckle.simulate(bright, dtype=dtype, seed=3, **parameters))
    assert ("ends below the top code" in told) == below
    advice = re.search(r"with (exposure_gain_dn|photons_per_unit)=(\S+ / float\(ideal\.max\(\)\)) the", told)
    assert advice
    given = {**parameters, advice[1]: eval(advice[2], {"ideal": bright})}
    assert said(lambda: clspeckle.simulate(bright, dtype=dtype, seed=3, **given)) == []
    assert said(lambda: clspeckle.simulate(RAMP * np.float32(0.2), dtype=dtype, seed=3, **parameters)) == []
    if options:
        out = ["--format", "float-npy"] if dtype == np.float32 else []
        program = of_program(tmp_path, "ideal.npy", *options, *out, ideal=bright)
        assert ("ends below the top code" in program) == below
        assert "--exposure-gain auto finds one" in program
        assert of_program(tmp_path, "ideal.npy", *options, *out, ideal=RAMP * np.float32(0.2)) == ""
        auto = of_program(tmp_path, "ideal.npy", *options, *out, "--exposure-gain", "auto", ideal=bright)
        assert "of the frame is" not in auto


# Of an image, arrays that may be meant as it; of which the program and Python make the same, or refuse both.
LAYOUTS: dict[str, Callable[[Array], Array]] = {
    "height_width": lambda a: a,
    "one_channel": lambda a: a[..., np.newaxis],
    "full_opacity": lambda a: np.stack([a, np.full_like(a, opaque(a))], -1),
    "opacity": lambda a: np.stack([a, a], -1),
    "alike_colors": lambda a: np.stack([a] * 3, -1),
    "colors": lambda a: np.stack([a, a[::-1], a], -1),
    "alike_colors_and_opacity": lambda a: np.stack([a, a, a, np.full_like(a, opaque(a))], -1),
    "colors_and_opacity": lambda a: np.stack([a, a[::-1], a, a], -1),
    "one_frame": lambda a: a[np.newaxis],
    "one_frame_one_channel": lambda a: a[np.newaxis, ..., np.newaxis],
    "one_frame_colors": lambda a: np.stack([a, a[::-1], a], -1)[np.newaxis],
    "one_frame_channel_first": lambda a: a[np.newaxis, np.newaxis],
    "channels_first": lambda a: np.stack([a] * 3)[np.newaxis],
    "five_axes": lambda a: a[np.newaxis, np.newaxis, np.newaxis],
}
FRAMES: dict[str, Callable[[Array], Array]] = {
    "frames": lambda a: np.stack([a, a[::-1]]),
    "frames_of_one_channel": lambda a: np.stack([a, a[::-1]])[..., np.newaxis],
    "frames_of_colors": lambda a: np.stack([np.stack([a, a[::-1], a], -1)] * 2),
    "frames_channel_first": lambda a: np.stack([a, a[::-1]])[:, np.newaxis],
    "frames_behind": lambda a: np.stack([a] * 6, -1),
    "channels_behind_channels": lambda a: np.stack([np.stack([a] * 6, -1)] * 2),
}


def opaque(array: Array) -> int:
    return int(np.iinfo(array.dtype).max) if array.dtype.kind == "u" else 1


def program_frame(folder: Path, *arguments: str, **arrays: Array) -> tuple[Array | None, str]:
    """The first frame, None if the program refuses; and what it tells."""
    for name, array in arrays.items():
        np.save(folder / f"{name}.npy", array)
    done = subprocess.run(
        [PROGRAM, "render", *arguments, "-o", "out", "--no-preview", "--seed", "3", "--format", "npy"],
        cwd=folder,
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode in (0, 1), done.stderr
    return (None if done.returncode else np.load(folder / "out" / "frame_000000.npy")), done.stderr


def python_frame(call: Callable[[], Array]) -> tuple[Array | None, str]:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            frame: Array | None = call()
        except (clspeckle.errors.ClspeckleError, TypeError) as error:
            frame = None
            warnings.warn(str(error), stacklevel=1)
    return frame, "\n".join(str(one.message) for one in told)


@pytest.mark.parametrize("dtype", [np.float32, np.uint8, np.uint16])
@pytest.mark.parametrize("layout", [*LAYOUTS, *FRAMES])
def test_the_program_and_python_take_the_same_arrays_as_ideal_images(tmp_path: Path, layout: str, dtype: type) -> None:
    image: Array = (RAMP * (np.iinfo(dtype).max if dtype != np.float32 else 1)).astype(dtype)
    array = {**LAYOUTS, **FRAMES}[layout](image)
    program, said_by_program = program_frame(tmp_path, "ideal.npy", ideal=array)
    python, said_by_python = python_frame(lambda: clspeckle.simulate(array, seed=3))
    assert (program is None) == (python is None), (said_by_program, said_by_python)
    if program is not None and python is not None:
        assert np.array_equal(program, python if python.ndim == 2 else python[0])
        assert bool(said_by_program) == bool(said_by_python), (said_by_program, said_by_python)
        for words in ("opacity", "color channels", "frames, 32 pixels high"):
            assert (words in said_by_program) == (words in said_by_python), words


PLANES: dict[str, Array] = {
    "depth": DEPTH,
    "albedo": RAMP,
    "visibility": RAMP,
    "texels": RAMP,
    "refresh": (RAMP > 0.5).astype(np.uint8),
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("plane", PLANES)
def test_the_program_and_python_take_the_same_arrays_as_planes(tmp_path: Path, plane: str, layout: str) -> None:
    array = LAYOUTS[layout](PLANES[plane])
    planes: dict[str, Any] = {"depth": DEPTH, "texels": TEXELS, plane: array}
    option = {"refresh": "refresh-mask"}
    files = [word for name in planes if name != "texels" for word in (f"--{option.get(name, name)}", f"{name}.npy")]
    program, said_by_program = program_frame(tmp_path, *files, *SCENE, *CAMERA, **planes)

    def render() -> Array:
        refresh = planes.pop("refresh", None)
        camera = pipeline(planes.pop("texels"))
        frame: Array = camera.render(clspeckle.Geometry(intrinsics=INTRINSICS, **planes), refresh=refresh)
        return frame

    python, said_by_python = python_frame(render)
    assert (program is None) == (python is None), (said_by_program, said_by_python)
    if program is not None and python is not None:
        assert np.array_equal(program, python)
        assert bool(said_by_program) == bool(said_by_python), (said_by_program, said_by_python)


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("kind", ["floats", "one_frame", "whole_numbers", "channels_first", "longer", "zero"])
@pytest.mark.parametrize("plane", ["normal", "position"])
def test_the_program_and_python_take_the_same_vectors(tmp_path: Path, plane: str, kind: str, channels: int) -> None:
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, SHAPE[1]), np.linspace(-0.3, 0.3, SHAPE[0]))
    position = np.dstack([x, y, DEPTH]).astype(np.float32)
    meant = OBLIQUE if plane == "normal" else position
    full = np.concatenate([meant, np.ones((*SHAPE, channels - 3), np.float32)], -1)
    array = {
        "floats": full,
        "one_frame": full[np.newaxis],
        "whole_numbers": np.rint(full * 1000).astype(np.int16),
        "channels_first": np.moveaxis(full, -1, 0).copy(),
        "longer": full * np.float32(1.5),
        "zero": full * np.float32(0),
    }[kind]
    planes: dict[str, Any] = {plane: array}
    if plane == "normal":
        planes["position"] = position
    files = [word for name in planes for word in (f"--{name}", f"{name}.npy")]
    program, said_by_program = program_frame(tmp_path, *files, *SCENE, texels=TEXELS, **planes)
    python, said_by_python = python_frame(lambda: pipeline().render(clspeckle.Geometry(**planes)))
    assert (program is None) == (python is None), (said_by_program, said_by_python)
    if program is not None and python is not None:
        assert np.array_equal(program, python)
        assert bool(said_by_program) == bool(said_by_python), (said_by_program, said_by_python)


@pytest.mark.parametrize("layout", [*LAYOUTS, *FRAMES])
def test_the_program_and_python_take_the_same_arrays_as_codes(tmp_path: Path, layout: str) -> None:
    array = {**LAYOUTS, **FRAMES}[layout](np.random.default_rng(2).integers(60, 70, SHAPE).astype(np.uint16))
    np.save(tmp_path / "dark.npy", array)
    text = {"format": "clspeckle-capture", "version": 1, "laser": {"wavelength_nm": 940.0},
            "camera": {"width": SHAPE[1], "height": SHAPE[0], "bits": 10, "pixel_pitch_um": 3.0, "f_number": 4.0,
                       "black_level_dn": 64, "read_noise_dn": 3},
            "sequences": [{"name": "dark", "file": "dark.npy", "scene": "dark"}]}  # fmt: skip
    if layout == "frames_behind":
        text["camera"].update(width=6, height=32)  # type: ignore[attr-defined]
    (tmp_path / "capture.json").write_text(json.dumps(text))
    done = subprocess.run([PROGRAM, "capture", "check", "."], cwd=tmp_path, check=False, capture_output=True, text=True)

    def opened() -> Array:
        clspeckle.Capture.from_arrays({"dark": array}, camera={"bits": 10})
        return array

    python, said_by_python = python_frame(opened)
    assert (done.returncode == 0) == (python is not None), (done.stderr, said_by_python)


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


@pytest.mark.parametrize("dtype", [np.uint8, np.int64, np.float32])
def test_soft_masks(dtype: Any) -> None:
    """All that is not 0 counts. Floating-point masks are refused."""
    soft = (np.clip(np.arange(SHAPE[1]) - 9, 0, 12) * 10).astype(dtype)[None, :].repeat(SHAPE[0], axis=0)
    camera = clspeckle.Pipeline.from_parameters(SHAPE, seed=3, exposure_gain_dn=300)
    calls: dict[str, Callable[[Array], Any]] = {
        "refresh": lambda mask: camera.render(RAMP, refresh=mask),
        "mask": lambda mask: clspeckle.statistics.moments(RAMP, mask),
        "mask of 'dark'": lambda mask: clspeckle.Capture.from_arrays(
            {"dark": clspeckle.CaptureSequence(frames(), "dark", mask=np.resize(mask, (48, 64)))}, camera={"bits": 10}
        ),
    }
    for name, call in calls.items():
        if dtype is np.float32:
            with pytest.raises(clspeckle.errors.InvalidFormatError, match=re.escape("; give mask != 0, or mask > 0.5")):
                call(soft)
        else:
            (told,) = said(lambda call=call: call(soft))  # type: ignore[misc]
            assert told.startswith(f"{name} has other values than 0 and 120")
            assert told.endswith("give mask > 65")
        for mask in (soft > 65, soft != 0, (soft != 0) * np.int8(-1)):
            assert said(lambda call=call, mask=mask: call(mask)) == []  # type: ignore[misc]


@pytest.mark.parametrize("bad", [-0.5, np.nan, np.inf, -np.inf])
def test_numbers_that_are_no_light_have_a_way_out(bad: float) -> None:
    ideal = half(np.full(SHAPE, bad, np.float32), RAMP)
    ideal[-1, -1] = -1
    for _ in range(2):
        with pytest.raises(clspeckle.errors.InvalidDataError) as refused:
            clspeckle.simulate(ideal)
        advice = re.search(r"; (np\.\w+\(.*?\)) sets", str(refused.value))
        assert advice
        ideal = eval(advice[1], {"np": np, "ideal": ideal})
        if np.isfinite(ideal).all() and (ideal >= 0).all():
            break
    assert said(lambda: clspeckle.simulate(ideal, exposure_gain_dn=300.0)) == []
