"""NPY in many variants: the array that NumPy loads, or a refusal with words."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from test_variants import Dump

Array = np.ndarray
TYPES = ["?", "u1", "i1", "f2", *(f"{order}{kind}" for kind in ("u2", "u4", "u8", "i2", "i4", "i8", "f4", "f8", "f2")
                                  for order in "<>")]  # fmt: skip
SHAPES = {"image": (9, 14), "stack": (5, 9, 14), "one": (1, 9, 14), "column": (9, 1), "row": (1, 14)}


def values(dtype: str, shape: tuple[int, ...]) -> Array:
    random = np.random.default_rng(len(shape))
    kind = np.dtype(dtype).kind
    if kind == "f":
        return random.normal(size=shape).astype(dtype)
    top = {"b": 1, "u": 200, "i": 100}[kind]
    return random.integers(-top if kind == "i" else 0, top + 1, shape).astype(dtype)


@pytest.mark.parametrize("shape", SHAPES)
def test_types_orders_and_versions(tmp_path: Path, shape: str) -> None:
    for index, dtype in enumerate(TYPES):
        array = values(dtype, SHAPES[shape])
        path = tmp_path / "a.npy"
        with path.open("wb") as stream:
            fortran = np.asfortranarray(array) if index % 2 else array
            np.lib.format.write_array(stream, fortran, version=((1, 0), (2, 0), (3, 0))[index % 3])
        Dump(path).check(np.load(path), {"u1": 255, "u2": 65535}.get(np.dtype(dtype).str[1:], 0))


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_channels(tmp_path: Path, channels: int) -> None:
    for dtype in ("u1", "<u2", "<f4", ">f8"):
        for shape in ((9, 14, channels), (5, 9, 14, channels)):
            array = values(dtype, shape)
            np.save(tmp_path / "a.npy", array)
            given = Dump(tmp_path / "a.npy")
            assert given.channels == channels and given.frames == (5 if len(shape) == 4 else 1)
            np.testing.assert_array_equal(given.values.reshape(shape), array.astype(np.float32))


def test_one_channel_before_height_and_width(tmp_path: Path) -> None:
    array = values("<f4", (5, 1, 9, 14))
    np.save(tmp_path / "a.npy", array)
    Dump(tmp_path / "a.npy").check(array[:, 0], 0)


REFUSED = {
    "channels_first": (values("<f4", (2, 3, 9, 14)), "numpy.moveaxis(array, 1, -1)"),
    "frames_behind": (values("<u2", (48, 64, 9)), "numpy.moveaxis(array, -1, 0)"),
    "swapped": ((values("<u2", (9, 140)) * np.uint16(5)).astype("<u2").byteswap(), "array.byteswap()"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_doubts_have_a_way_out(tmp_path: Path, name: str) -> None:
    array, advice = REFUSED[name]
    np.save(tmp_path / "a.npy", array)
    first = Dump(tmp_path / "a.npy")
    assert advice in (first.error or first.warnings[0])
    again = eval(advice, {"array": array, "numpy": np})
    np.save(tmp_path / "a.npy", again)
    given = Dump(tmp_path / "a.npy")
    assert not given.error and given.warnings == []
    np.testing.assert_array_equal(np.squeeze(given.values), again.astype(np.float32))


def test_words_in_the_other_order_are_no_doubt(tmp_path: Path) -> None:
    """Big-endian arrays, codes of 16 bits, and codes in upper bits."""
    codes = np.random.default_rng(1).integers(0, 1024, (9, 140))
    for array in (
        codes.astype(">u2"),
        (codes * 64).astype("<u2"),
        (codes * 63).astype(">u2"),
        (codes // 8).astype("<u2"),
    ):
        np.save(tmp_path / "a.npy", array)
        assert Dump(tmp_path / "a.npy").warnings == []


def light(shape: tuple[int, ...] = (40, 60)) -> Array:
    y, x = np.mgrid[: shape[0], : shape[1]]
    image = np.exp(-((x - 20.0) ** 2 + (y - 18.0) ** 2) / 200)
    image[: shape[0] // 3] = 0  # a black border tells nothing
    return image


REALS = {
    "light": light(),
    "few steps": np.rint(8 * light()) / 8,
    "codes": np.rint(1000 * light()),
    "depth": np.where(light() > 0.01, 1 + light(), np.inf),
    "metres and none": np.where(light() > 0.01, 1.5, np.nan),
    "bright": 1e5 * light(),
    "normals": np.random.default_rng(4).normal(size=(40, 60)),
}


@pytest.mark.parametrize("name", REALS)
@pytest.mark.parametrize("size", [2, 4, 8])
def test_reals_with_swapped_bytes_are_told_and_the_advice_reads_them(tmp_path: Path, name: str, size: int) -> None:
    if size == 2 and name in ("normals", "bright"):
        return  # of 16 bits signed numbers look alike in both orders
    for order in "<>":
        array = REALS[name].astype(f"{order}f{size}")
        np.save(tmp_path / "a.npy", array)
        good = Dump(tmp_path / "a.npy")
        assert not good.error and good.warnings == []
        np.testing.assert_array_equal(good.values[0], array.astype(np.float32))
        np.save(tmp_path / "a.npy", array.byteswap())
        error = Dump(tmp_path / "a.npy").error
        advice = re.search(r"swapped bytes. Save (array\.byteswap\(\))", error)
        assert advice and "% of its numbers are such as no image has" in error
        np.save(tmp_path / "a.npy", eval(advice[1], {"array": np.load(tmp_path / "a.npy")}))
        np.testing.assert_array_equal(Dump(tmp_path / "a.npy").values, good.values)


@pytest.mark.parametrize("size", [2, 4, 8])
def test_odd_reals_in_their_own_order_are_taken(tmp_path: Path, size: int) -> None:
    """Dim light, the largest number as background, noise around 0, and numbers of another type."""
    random = np.random.default_rng(5)
    top = np.finfo(f"f{size}").max
    for array in (
        light() * 1e-4,
        np.where(light() > 0.5, light(), top),
        random.normal(size=(40, 60)),
        np.frombuffer(random.integers(300, 60000, 2400).astype(f"<i{size}").tobytes(), f"<f{size}").reshape(40, 60),
        np.full((40, 60), np.inf),
        np.zeros((40, 60)),
    ):
        for order in "<>":
            np.save(tmp_path / "a.npy", array.astype(f"{order}f{size}"))
            assert not Dump(tmp_path / "a.npy").error


@pytest.mark.parametrize("dtype", ["i2", "u2", "i4", "u4", "i8", "u8"])
def test_integers_with_swapped_bytes(tmp_path: Path, dtype: str) -> None:
    millimetres = (500 + 900 * light()).astype(f"<{dtype}")
    np.save(tmp_path / "a.npy", millimetres)
    assert Dump(tmp_path / "a.npy").warnings == []
    np.save(tmp_path / "a.npy", millimetres.byteswap())
    assert "none needs more than 12 bits. If so, save array.byteswap()" in Dump(tmp_path / "a.npy").warnings[0]


def test_archives_and_pickles(tmp_path: Path) -> None:
    array = values("<u2", (9, 14))
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "a.npz", frames=array, other=array)
        error = Dump(tmp_path / "a.npz").error
        advice = re.search(r"numpy\.save\((.*)\)$", error.strip())
        assert "is an NPZ archive of arrays" in error and advice
        name, loaded = eval(f"({advice[1]})", {"numpy": np})
        np.save(tmp_path / name, loaded)
        Dump(tmp_path / name).check(array, 65535)
    records = np.zeros((9, 14), [("a", "<f4"), ("b", "<f4")])
    np.save(tmp_path / "records.npy", records)
    assert "a plain array of numbers is needed" in Dump(tmp_path / "records.npy").error
    np.save(tmp_path / "records.npy", records["a"])
    Dump(tmp_path / "records.npy").check(records["a"], 0)
    frames = np.empty(2, object)
    frames[:] = [array, array]
    np.save(tmp_path / "objects.npy", frames, allow_pickle=True)
    advice = re.search(r"save (numpy\.stack\(frames\))", Dump(tmp_path / "objects.npy").error)
    assert advice
    np.save(tmp_path / "objects.npy", eval(advice[1], {"numpy": np, "frames": frames}))
    Dump(tmp_path / "objects.npy").check(np.stack([array] * 2), 65535)


@pytest.mark.parametrize("dtype", ["<c8", "<f16", "S4", "<M8[s]"])
def test_types_that_are_no_numbers_here(tmp_path: Path, dtype: str) -> None:
    np.save(tmp_path / "a.npy", np.zeros((9, 14), dtype))
    error = Dump(tmp_path / "a.npy").error
    assert "bool, integers of 8 to 64 bits and float16, 32 and 64 are taken" in error
    advice = re.search(r": save (.*)$", error)
    assert advice
    for way in advice[1].strip().split(", or "):
        np.save(
            tmp_path / "b.npy", eval(way, {"numpy": np, "array": np.ones((9, 14), dtype if dtype != "S4" else "f8")})
        )
        Dump(tmp_path / "b.npy").check(np.ones((9, 14)), 0)


def test_records_have_a_way_out(tmp_path: Path) -> None:
    array = np.zeros((9, 14), [("z", "<f4"), ("w", "<u2")])
    array["z"] = 3
    np.save(tmp_path / "a.npy", array)
    advice = re.search(r"save one field, (array\[.*\])$", Dump(tmp_path / "a.npy").error.strip())
    assert advice
    np.save(tmp_path / "b.npy", eval(advice[1], {"array": array}))
    Dump(tmp_path / "b.npy").check(np.full((9, 14), 3), 0)


@pytest.mark.parametrize("text", ["1 2 3\n4 5 6\n", "1.5,2,3\n4,5e-1,6\n", "-1;2\n3;4\n"])
def test_numbers_in_a_text_have_a_way_out(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text)
    advice = re.search(
        r"save its array as NPY: numpy\.save\(\"image\.npy\", (numpy\.loadtxt\(.*\))\)$", Dump(path).error.strip()
    )
    assert advice
    array = eval(advice[1], {"numpy": np})
    np.save(tmp_path / "image.npy", array)
    Dump(tmp_path / "image.npy").check(array, 0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<!DOCTYPE html><p>404", "a page came in place of the file: download it again"),
        ("<html><p>404", "a page came in place of the file: download it again"),
        ("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3\n", "git lfs pull"),
    ],
)
def test_what_came_in_place_of_an_image_is_named(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "a.png").write_text(text)
    assert says in Dump(tmp_path / "a.png").error
