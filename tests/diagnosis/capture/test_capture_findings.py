"""What `capture check` finds in codes: stretched and missing ones, odd pixels, mosaics, frames apart, and that it finds
nothing in clean sets.

Sets are made with NumPy alone. Every advice that a message gives is followed here."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
import numpy.typing as npt
import pytest

Cli = Callable[..., subprocess.CompletedProcess[str]]
Array = npt.NDArray[Any]
SHAPE = (48, 64)


def speckle(random: np.random.Generator, shape: tuple[int, int] = SHAPE) -> Array:
    """Intensity of mean 1 behind a round pupil 0.55 cycles per pixel wide."""
    field = random.normal(size=shape) + 1j * random.normal(size=shape)
    radius = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.fftfreq(shape[1])[None, :])
    intensity = np.abs(np.fft.ifft2(np.fft.fft2(field) * (radius < 0.275))) ** 2
    return np.asarray(intensity / intensity.mean())


def recorded(
    seed: int,
    bits: int = 10,
    frames: int = 8,
    noise: float | None = None,
    prnu: float = 0.0,
    falloff: float = 0.0,
    shape: tuple[int, int] = SHAPE,
) -> tuple[dict[str, Array], dict[str, Any]]:
    """Codes of a camera without a fault, and what capture.json says of it. Levels are those of ten bits."""
    random = np.random.default_rng(seed)
    scale = 2.0 ** (bits - 10)
    noise = 4.0 * scale if noise is None else noise
    y, x = np.mgrid[: shape[0], : shape[1]]
    gains = 1 - falloff * ((2 * x / shape[1] - 1) ** 2 + (2 * y / shape[0] - 1) ** 2) / 2
    gains = gains * (1 + prnu * random.normal(size=shape))

    def codes(lights: list[Array]) -> Array:
        electrons = [scale * light * gains for light in lights]
        frames = [64 * scale + e + random.normal(size=shape) * np.sqrt(noise**2 + 0.2 * scale * e) for e in electrons]
        return np.clip(np.rint(frames), 0, 2**bits - 1).astype(np.uint16)

    still = speckle(random, shape)
    arrays = {
        "dark": codes([np.zeros(shape)] * frames),
        "flat": codes([np.full(shape, 400.0)] * frames),
        "board_static": codes([130 * still] * frames),
        "board_moving": codes([130 * speckle(random, shape) for _ in range(frames)]),
    }
    return arrays, {"bits": bits, "black_level_dn": 64 * scale, "read_noise_dn": noise}


def write(folder: Path, arrays: dict[str, Array], camera: dict[str, Any], mask: str = "") -> None:
    folder.mkdir(exist_ok=True)
    sequences = []
    for name, codes in arrays.items():
        np.save(folder / f"{name}.npy", codes.astype(np.uint16))
        scene, _, motion = name.partition("_")
        entry = {"name": name, "file": f"{name}.npy", "scene": scene, **({"motion": motion} if motion else {})}
        sequences.append({**entry, **({"mask": mask} if mask else {})})
    height, width = next(iter(arrays.values())).shape[1:]
    camera = {"width": width, "height": height, "pixel_pitch_um": 2.9, "f_number": 5.6, **camera}
    text = {"format": "clspeckle-capture", "version": 1, "camera": camera, "laser": {"wavelength_nm": 940.0}}
    (folder / "capture.json").write_text(json.dumps({**text, "sequences": sequences}))


@pytest.fixture
def found(cli: Cli, tmp_path: Path) -> Callable[..., list[dict[str, Any]]]:
    def check(arrays: dict[str, Array], camera: dict[str, Any], mask: str = "") -> list[dict[str, Any]]:
        write(tmp_path / "set", arrays, camera, mask)
        return json.loads(cli("capture", "check", "set", "--json", "-").stdout)["warnings"]  # type: ignore[no-any-return]

    return check


def kinds(warnings: list[dict[str, Any]]) -> list[str]:
    return [warning["kind"] for warning in warnings]


# --- Nothing in clean sets ---


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_clean_sets_have_no_finding(found, bits: int) -> None:
    """100 sets in all: bits of the converter, one to forty frames, noise from a third of a code on, fixed patterns,
    fall-off."""
    for seed in range(25):
        random = np.random.default_rng(1000 * bits + seed)
        scale = 2.0 ** (bits - 10)
        arrays, camera = recorded(
            seed=int(random.integers(1 << 30)),
            bits=bits,
            frames=int(random.choice([2, 3, 4, 8, 16, 40])),
            noise=float(random.choice([0.35, 1.0, 4 * scale, 8 * scale])),
            prnu=float(random.choice([0, 0.01, 0.03])),
            falloff=float(random.choice([0, 0.2, 0.5])),
        )
        assert [w for w in found(arrays, camera) if w["kind"] != "read_noise"] == [], (bits, seed)


def test_few_gray_levels_are_not_stretched_ones(found) -> None:
    """Levels here and there, without noise, and frames of a converter that noise hardly moves."""
    random = np.random.default_rng(4)
    for count in (3, 6, 12, 18):
        levels = np.sort(random.choice(np.arange(100, 900), count, replace=False))
        steps = np.broadcast_to(levels[random.integers(0, count, SHAPE)], (4, *SHAPE))
        assert not {"stretched_codes", "missing_codes", "upper_bits"} & set(kinds(found({"flat": steps}, {
            "bits": 10, "black_level_dn": 64, "read_noise_dn": 0})))  # fmt: skip
    quiet = np.where(random.random((8, *SHAPE)) < 0.02, 66, 64)
    assert not {"stretched_codes", "missing_codes", "upper_bits"} & set(kinds(found({"dark": quiet}, {
        "bits": 10, "black_level_dn": 64, "read_noise_dn": 0.3})))  # fmt: skip


# --- Embedded data ---


@pytest.mark.parametrize("where", [np.s_[0, :20], np.s_[-1], np.s_[5:8, 10:30]])
def test_what_embedded_data_do_is_no_change_of_the_scene(found, where: Any) -> None:
    """Counters and time stamps change from frame to frame as they like; a true change is told beside them."""
    arrays, camera = recorded(11, frames=16)
    random = np.random.default_rng(3)
    for codes in arrays.values():
        place = codes[(slice(None), *(where if isinstance(where, tuple) else (where,)))]
        place[1:] = random.integers(0, 1024, place[1:].shape)
        place[0] = random.integers(0, 3, place[0].shape)
    assert set(kinds(found(arrays, camera))) <= {"odd_block", "odd_pixels"}
    arrays["board_static"][8:] = np.roll(arrays["board_static"][8:], 9, axis=2)
    assert "scene_changes" in kinds(found(arrays, camera))


# --- Codes that never occur ---


def replicated(codes: Array, bits: int, to: int) -> Array:
    return (codes.astype(np.int64) << (to - bits)) | (codes >> (2 * bits - to))


STRETCHES: dict[str, tuple[int, int, Callable[[Array], Array]]] = {
    "10 bits replicated to 16": (10, 16, lambda c: replicated(c, 10, 16)),
    "12 bits replicated to 16": (12, 16, lambda c: replicated(c, 12, 16)),
    "8 bits times 257": (8, 16, lambda c: c.astype(np.int64) * 257),
    "8 bits in the middle of 256 codes": (8, 16, lambda c: c.astype(np.int64) * 256 + 128),
    "8 bits at the end of 256 codes": (8, 16, lambda c: c.astype(np.int64) * 256 + 255),
    "8 bits to 10 by full scale": (8, 10, lambda c: np.rint(c * (1023 / 255))),
    "10 bits to 12 by full scale, rounded down": (10, 12, lambda c: np.floor(c * (4095 / 1023))),
    "10 bits times 3.7": (10, 12, lambda c: np.rint(c * 3.7)),
    "10 bits times 6, less an offset": (10, 14, lambda c: np.maximum(c.astype(np.int64) * 6 - 97, 0)),
    "10 bits times 1.5": (10, 12, lambda c: np.rint(c * 1.5)),
    "12 bits times 1.37": (12, 16, lambda c: np.rint(c * 1.37)),
}


@pytest.mark.parametrize("described", [True, False])
@pytest.mark.parametrize("kind", STRETCHES)
def test_stretched_codes_are_told_and_taken_back(found, kind: str, described: bool) -> None:
    """What the codes tell of the dark is advised, whatever capture.json says: the advice gives a clean set."""
    bits, to, stretch = STRETCHES[kind]
    arrays, camera = recorded(7, bits=bits, frames=16)
    scale = 2**to / 2**bits if described else 0.01
    given = {"bits": to, "black_level_dn": camera["black_level_dn"] * scale,
             "read_noise_dn": camera["read_noise_dn"] * scale}  # fmt: skip
    stretched = {name: stretch(codes) for name, codes in arrays.items()}
    warnings = [w for w in found(stretched, given) if w["kind"] != "unused_bits"]
    assert kinds(warnings) == ["stretched_codes"], warnings
    text = warnings[0]["text"]
    assert re.search(r"\d+ of \d+ codes (from \d+ to \d+ )?never occur", text)
    advice = re.search(
        r"numpy\.rint\((.*)\)\.astype\(numpy\.uint16\), bits (\d+), black_level_dn (\S+) and read_noise_dn (\S+)$", text
    )
    assert advice, text
    back = {name: np.rint(eval(advice[1], {"codes": codes})) for name, codes in stretched.items()}
    for name, codes in back.items():
        unclipped = (stretched[name] > 0) & (stretched[name] < 2**to - 1)
        shift = np.unique(codes[unclipped] - arrays[name][unclipped])
        assert len(shift) == 1, "the converter's codes, but for a constant"
    again = found(back, {"bits": int(advice[2]), "black_level_dn": float(advice[3]), "read_noise_dn": float(advice[4])})
    assert again == []
    shift = float(np.mean(back["dark"]) - np.mean(arrays["dark"]))
    assert float(advice[3]) == pytest.approx(camera["black_level_dn"] + shift, abs=0.1)
    assert float(advice[4]) == pytest.approx(camera["read_noise_dn"], rel=0.05)


GAINS: dict[str, tuple[int, Callable[[Array], Array]]] = {
    **{f"times {gain}": (12, lambda c, g=gain: np.rint(c * g)) for gain in (2.1, 2.25, 2.4, 2.5, 2.7, 2.9)},
    "times 3 above the black level": (12, lambda c: (c - 64.0) * 3 + 64),
    "times 3 above another level": (12, lambda c: (c - 60.0) * 3 + 60),
    "times 2 above the black level": (12, lambda c: (c - 64.0) * 2 + 64),
    "times 1.3 above the black level": (12, lambda c: np.rint((c - 64.0) * 1.3 + 64)),
    "times 1.5, less 50": (12, lambda c: np.rint(c * 1.5) - 50),
    "times 3 and 200": (12, lambda c: c * 3.0 + 200),
    "times 2.5 above the black level": (12, lambda c: np.floor((c - 64.0) * 2.5 + 64.5)),
}


@pytest.mark.parametrize("kind", GAINS)
@pytest.mark.parametrize("light", [1.0, 2.5])
def test_gains_about_any_code_are_taken_back(found, kind: str, light: float) -> None:
    """Where light is clipped the code is the converter's top one: that tells the offset, which steps do not."""
    bits, stretch = GAINS[kind]
    arrays, camera = recorded(7, frames=16)
    random = np.random.default_rng(5)
    for name in ("board_static", "board_moving") if light > 1 else ():
        codes = arrays[name].astype(np.float64)
        brighter = 64 + (codes - 64) * light + random.uniform(-1.5, 1.5, codes.shape)
        arrays[name] = np.minimum(np.where(codes > 64, np.rint(brighter), codes), 1023).astype(np.uint16)
    stretched = {name: np.clip(stretch(codes), 0, 2**bits - 1) for name, codes in arrays.items()}
    told = [w for w in found(stretched, {"bits": bits, "black_level_dn": 100.0, "read_noise_dn": 5.0})
            if w["kind"] not in ("unused_bits", "saturated")]  # fmt: skip
    (text,) = [w["text"] for w in told]
    advice = re.search(
        r"numpy\.rint\((.*)\)\.astype\(numpy\.uint16\), bits (\d+), black_level_dn (\S+) and read_noise_dn (\S+)$", text
    ) or re.search(
        r"ivide the (codes) by \d+.* bits to (\d+), black_level_dn to (\S+) and read_noise_dn to (\S+)$", text
    )
    assert advice, text
    divide = re.search(r"ivide the codes by (\d+)", text)
    back = {name: np.rint(eval(advice[1], {"codes": codes}) / int(divide[1] if divide else 1))
            for name, codes in stretched.items()}  # fmt: skip
    assert min(codes.min() for codes in back.values()) >= 0
    again = {"bits": int(advice[2]), "black_level_dn": float(advice[3]), "read_noise_dn": float(advice[4])}
    assert [w for w in found(back, again) if w["kind"] != "saturated"] == []
    if (arrays["board_static"] == 1023).sum() > 100:
        assert int(advice[2]) == 10
        assert all(np.array_equal(back[name], arrays[name]) for name in arrays), "the converter's own codes"


@pytest.mark.parametrize("gain", [1.3, 1.9, 2.0, 2.2, 3.0, 4.0])
@pytest.mark.parametrize("end", [600, 900, 1000])
def test_a_full_well_below_the_top_code_is_no_offset(found, gain: float, end: int) -> None:
    """A gain alone explains such codes; that their light is clipped below the top code is told once they are taken
    back."""
    arrays, camera = recorded(7, frames=16)
    random = np.random.default_rng(5)
    for name in ("board_static", "board_moving"):
        codes = arrays[name].astype(np.float64)
        brighter = 64 + (codes - 64) * 2.5 + random.uniform(-1.5, 1.5, codes.shape)
        arrays[name] = np.minimum(np.where(codes > 64, np.rint(brighter), codes), end).astype(np.uint16)
    stretched = {name: np.rint(codes * gain) for name, codes in arrays.items()}
    (text,) = [w["text"] for w in found(stretched, {"bits": 12, "black_level_dn": 64 * gain, "read_noise_dn": 4 * gain})
               if w["kind"] in ("stretched_codes", "upper_bits")]  # fmt: skip
    advice = re.search(
        r"numpy\.rint\((.*)\)\.astype\(numpy\.uint16\), bits (\d+), black_level_dn (\S+) and read_noise_dn (\S+)$", text
    ) or re.search(
        r"ivide the (codes) by \d+.* bits to (\d+), black_level_dn to (\S+) and read_noise_dn to (\S+)$", text
    )
    assert advice, text
    divide = re.search(r"ivide the codes by (\d+)", text)
    for name, codes in stretched.items():
        back = np.rint(eval(advice[1], {"codes": codes}) / int(divide[1] if divide else 1))
        np.testing.assert_array_equal(back, arrays[name], text)
    assert int(advice[2]) == (11 if divide and gain == 2 else 10), "words of 12 bits have so many left"
    assert float(advice[3]) == pytest.approx(64, abs=0.2)
    again = {"bits": int(advice[2]), "black_level_dn": float(advice[3]), "read_noise_dn": float(advice[4])}
    assert "clipped_below_top" in kinds(found(arrays, again))


@pytest.mark.parametrize("gain", [1.5, 2.5, 3.0])
def test_where_storage_clips_no_code_is_the_converters_top(found, gain: float) -> None:
    """A camera of 12 bits, its codes amplified: what is clipped there may be any code of the converter."""
    arrays, camera = recorded(7, frames=16)
    random = np.random.default_rng(5)
    for name in ("board_static", "board_moving"):
        codes = arrays[name].astype(np.float64)
        arrays[name] = np.rint(64 + 10 * (codes - 64) + random.uniform(-5, 5, codes.shape)).clip(0, 4095)
    amplified = {name: np.minimum(np.rint(codes * gain), 4095) for name, codes in arrays.items()}
    assert (amplified["board_static"] == 4095).sum() > 100
    told = found(amplified, {"bits": 12, "black_level_dn": 100.0, "read_noise_dn": 5.0})
    (text,) = [w["text"] for w in told if "numpy.rint" in w["text"]]
    assert f"numpy.rint(codes / {gain:g})" in text


def test_multiples_of_a_power_of_two_that_end_elsewhere(found) -> None:
    """In words of 16 bits codes may stand in the upper bits: that light is clipped below the top code is told
    beside."""
    arrays, camera = recorded(7, frames=16)
    bright = {name: np.minimum(codes * (2 if name.startswith("board") else 1), 900) for name, codes in arrays.items()}
    given = {"bits": 16, "black_level_dn": 64 * 64, "read_noise_dn": 256}
    told = kinds(found({name: codes * 64 for name, codes in bright.items()}, given))
    assert told[:1] == ["upper_bits"]
    assert "clipped_below_top" in told
    full = {name: np.minimum(codes * 2, 1023) if name.startswith("board") else codes for name, codes in arrays.items()}
    assert "clipped_below_top" not in kinds(found({name: codes * 64 for name, codes in full.items()}, given))


UPPER_BITS = re.compile(
    r"ivide the codes by (\d+).* bits to (\d+), black_level_dn to (\S+) and read_noise_dn to (\S+)$"
)


@pytest.mark.parametrize(("bits", "words"), [(10, 16), (12, 16), (10, 12)])
def test_upper_bits_are_told_with_numbers_that_give_a_clean_set(found, bits: int, words: int) -> None:
    arrays, camera = recorded(8, bits=bits, frames=16)
    upper = {name: codes << (words - bits) for name, codes in arrays.items()}
    told = found(upper, {"bits": words, "black_level_dn": 1.0, "read_noise_dn": 1.0})
    assert kinds(told) == ["upper_bits"], "one cause, one warning"
    text = told[0]["text"]
    advice = UPPER_BITS.search(text)
    assert advice, text
    numbers = {"bits": int(advice[2]), "black_level_dn": float(advice[3]), "read_noise_dn": float(advice[4])}
    assert numbers["read_noise_dn"] == pytest.approx(camera["read_noise_dn"], rel=0.05)
    assert found({name: codes // int(advice[1]) for name, codes in upper.items()}, numbers) == []
    if words == 16:
        assert "set /camera/msb_aligned to true" in text
        assert found(upper, {**numbers, "msb_aligned": True}) == []


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
@pytest.mark.parametrize("which", ["all", "dark", "flat", "board_moving", "dark flat"])
def test_swapped_bytes_are_told_alone(found, bits: int, which: str) -> None:
    """Whatever else such codes show follows from that: stretched codes, light that is missing, other noise."""
    arrays, camera = recorded(9, bits=bits, frames=4)
    names = list(arrays) if which == "all" else which.split()
    swapped = {name: codes.byteswap() if name in names else codes for name, codes in arrays.items()}
    told = found(swapped, camera | {"bits": 16})
    assert kinds(told) == ["swapped_bytes"]
    assert told[0]["sequence"] == (names[0] if len(names) == 1 else "")
    if which == "dark flat":
        assert "the codes of dark, flat look as if" in told[0]["text"]
    advice = re.search(r"save (codes\.byteswap\(\)) and set bits to (\d+);", told[0]["text"])
    assert advice and int(advice[2]) == bits
    back = {name: eval(advice[1], {"codes": codes}) if name in names else codes for name, codes in swapped.items()}
    assert found(back, camera | {"bits": int(advice[2])}) == []


@pytest.mark.parametrize("noise", [0.5, 1.0, 3.0])
def test_codes_of_8_bits_in_upper_halves_are_no_swapped_ones(found, noise: float) -> None:
    """Nor do dark pixels whose few codes lie far apart look as if they never changed."""
    arrays, camera = recorded(9, bits=8, frames=12, noise=noise)
    given = {"bits": 16, "black_level_dn": camera["black_level_dn"] * 256, "read_noise_dn": noise * 256}
    for lower, kind in ((0, "upper_bits"), (64, "stretched_codes"), (128, "stretched_codes")):
        told = found({name: codes * 256 + lower for name, codes in arrays.items()}, given)
        assert kinds(told) == [kind], lower


@pytest.mark.parametrize("level", [300, 700])
def test_few_swapped_codes_are_not_stretched_ones(found, level: int) -> None:
    codes = np.rint(np.random.default_rng(3).normal(level, 4, (4, *SHAPE))).astype(np.uint16)
    camera = {"bits": 16, "black_level_dn": level, "read_noise_dn": 4}
    assert kinds(found({"dark": codes.byteswap()}, camera)) == ["swapped_bytes"]
    assert found({"dark": codes}, camera | {"bits": 10}) == []


@pytest.mark.parametrize("level", [255, 256, 8192, 32788, 64 * 256 + 3])
def test_codes_of_16_bits_are_not_taken_for_swapped_ones(found, level: int) -> None:
    codes = np.rint(np.random.default_rng(3).normal(level, 4, (4, *SHAPE))).astype(np.uint16)
    assert found({"dark": codes}, {"bits": 16, "black_level_dn": level, "read_noise_dn": 4}) == []


@pytest.mark.parametrize("gain", [1.05, 1.1, 1.25, 4 / 3])
def test_a_formula_takes_a_small_gain_back_or_is_not_given(found, gain: float) -> None:
    """np.rint() rounds halves to even, so that codes of such gains may lie on no lattice."""
    arrays, camera = recorded(7, bits=10, frames=16)
    stretched = {name: np.rint(codes * gain) for name, codes in arrays.items()}
    warnings = found(stretched, camera | {"bits": 12})
    assert {"stretched_codes", "missing_codes"} & set(kinds(warnings))
    for warning in warnings:
        advice = re.search(r"numpy\.rint\((.*)\)\.astype", warning["text"])
        for name, codes in stretched.items() if advice else ():
            shift = np.unique(np.rint(eval(advice[1], {"codes": codes})) - arrays[name])
            assert len(shift) == 1, warning["text"]


def test_codes_in_upper_bits(found) -> None:
    arrays, _ = recorded(3)
    shifted = {name: codes * 64 for name, codes in arrays.items()}
    warnings = found(shifted, {"bits": 16, "black_level_dn": 4096, "read_noise_dn": 256})
    assert kinds(warnings) == ["upper_bits"]
    assert "set /camera/msb_aligned to true (or divide the codes by 64), bits to 10" in warnings[0]["text"]
    assert found(shifted, {"bits": 10, "msb_aligned": True, "black_level_dn": 64, "read_noise_dn": 4}) == []


@pytest.mark.parametrize("bits", [10, 12])
def test_lowest_bits_that_are_empty(found, bits: int) -> None:
    """Codes of 8 bits in 10 stand in no upper bits of a word."""
    arrays, camera = recorded(3, bits=bits - 2)
    shifted = {name: codes * 4 for name, codes in arrays.items()}
    given = {"bits": bits, **{key: 4 * camera[key] for key in ("black_level_dn", "read_noise_dn")}}
    warnings = found(shifted, given)
    assert kinds(warnings) == ["upper_bits"]
    advice = UPPER_BITS.search(warnings[0]["text"])
    assert advice and "to true" not in warnings[0]["text"]
    assert "leave them where /camera/msb_aligned is true already" in warnings[0]["text"]
    step = int(advice[1])
    again = {"bits": int(advice[2]), "black_level_dn": float(advice[3]), "read_noise_dn": float(advice[4])}
    assert found({name: codes // step for name, codes in shifted.items()}, again) == []
    # The same under msb_aligned.
    words = {name: codes << (16 - bits) for name, codes in shifted.items()}
    assert kinds(found(words, {**given, "msb_aligned": True})) == ["upper_bits"]
    assert found(words, {**again, "msb_aligned": True}) == []


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.2, 0.3, 0.5])
def test_noise_below_half_a_code_is_no_denoising(found, noise: float) -> None:
    """Rounding hides it, or adds to it, by where the black level lies."""
    for seed, level in enumerate((64.0, 64.2, 64.5)):
        random = np.random.default_rng(seed)
        dark = np.rint(random.normal(level, noise, (8, *SHAPE)))
        assert "read_noise" not in kinds(
            found({"dark": dark}, {"bits": 10, "black_level_dn": 64, "read_noise_dn": noise})
        )
    for wrong in (4 * max(noise, 0.5), 8.0) if noise > 0 else ():
        told = found({"dark": np.rint(np.random.default_rng(9).normal(64.5, noise, (8, *SHAPE)))}, {
            "bits": 10, "black_level_dn": 64, "read_noise_dn": wrong})  # fmt: skip
        assert "read_noise" in kinds(told) and "denoised" in next(w["text"] for w in told if w["kind"] == "read_noise")


def test_a_gamma_table_and_codes_that_a_converter_misses(found) -> None:
    arrays, camera = recorded(5, frames=16)
    table = np.rint(1023 * (np.arange(1024) / 1023) ** (1 / 2.2))
    warnings = found({name: table[codes] for name, codes in arrays.items()}, camera)
    # What is multiples of two in the dark follows from the same table.
    assert [kind for kind in kinds(warnings) if kind not in ("black_level", "read_noise")] == ["missing_codes"], (
        warnings
    )
    lost = np.random.default_rng(8).permutation(1023)[:80]
    warnings = found({name: np.where(np.isin(codes, lost), codes + 1, codes) for name, codes in arrays.items()}, camera)
    assert kinds(warnings) == ["missing_codes"], warnings
    numbers = re.search(r"(\d+) of (\d+) codes from (\d+) to (\d+) never occur \(([\d, .]+)\)", warnings[0]["text"])
    assert numbers and all(int(code) in lost for code in re.findall(r"\d+", numbers[5]))


@pytest.mark.parametrize(("period", "place"), [(16, 7), (8, 3), (11, 0)])
def test_codes_that_are_missing_at_a_distance_are_no_digital_gain(found, period: int, place: int) -> None:
    """Each was brought to its neighbour, which occurs twice as often. A gain of as much moves all codes apart."""
    arrays, camera = recorded(5, frames=40)
    for step in (1, -1):
        lost = {name: np.minimum(codes + step * (codes % period == place), 1023) for name, codes in arrays.items()}
        (told,) = found(lost, camera)
        assert told["kind"] == "missing_codes" and "digital gain of" not in told["text"], told
    spread = {name: np.minimum(np.floor(codes * period / (period - 1)), 1023) for name, codes in arrays.items()}
    assert "stretched_codes" in kinds(found(spread, camera))


def test_codes_that_are_clipped_below_the_top(found) -> None:
    arrays, camera = recorded(5, bits=10, frames=8)
    assert all((codes < 1023).all() or name.startswith("board") for name, codes in arrays.items())
    for most in (800, 600, 400):
        lit = {name: codes if name == "dark" else np.minimum(codes, most) for name, codes in arrays.items()}
        told = next(one for one in found(lit, camera) if one["kind"] == "clipped_below_top")
        assert f" have the code {most}," in told["text"] and "the top code, 1023" in told["text"]
        assert "board_static" in told["text"] and "flat" not in told["text"]
        # Less light, which stays below.
        less = {
            name: codes if name == "dark" else np.minimum(64 + (codes - 64.0) * 0.3, most)
            for name, codes in arrays.items()
        }
        assert "clipped_below_top" not in kinds(found({name: np.rint(codes) for name, codes in less.items()}, camera))
    assert "clipped_below_top" not in kinds(found(arrays, camera)), "at the top code it is saturation"


def test_a_digital_gain_below_one(found) -> None:
    arrays, camera = recorded(6, bits=12, frames=16)
    warnings = found({name: np.rint(codes * 0.8) for name, codes in arrays.items()}, camera)
    assert "doubled_codes" in kinds(warnings), warnings


# --- Pixels that are not like the others ---


def telemetry_row(arrays: dict[str, Array], random: np.random.Generator) -> None:
    for codes in arrays.values():
        codes[:, 47] = random.integers(0, 1024, codes[:, 47].shape)


def info_pixels(arrays: dict[str, Array], random: np.random.Generator) -> None:
    for codes in arrays.values():
        codes[:, 0, :20] = [933, 44, 1000, 5, 0, 496, 1, 700, 0, 1023, *[0] * 10]
        codes[:, 0, 2] = np.arange(len(codes)) * 33 % 1024


def info_column(arrays: dict[str, Array], random: np.random.Generator) -> None:
    for codes in arrays.values():
        codes[:, :, 63] = random.integers(0, 1024, SHAPE[0])


def dark_border(arrays: dict[str, Array], random: np.random.Generator) -> None:
    """Optically black columns: light is missing there in flats and boards."""
    for codes in arrays.values():
        codes[:, :, :3] = arrays["dark"][:, :, :3]


def bright_block(arrays: dict[str, Array], random: np.random.Generator) -> None:
    for codes in arrays.values():
        codes[:, 10:14, 30:40] = np.minimum(codes[:, 10:14, 30:40] + 300, 1023)


PLACES = {
    telemetry_row: ([[47, 47]], [[0, 63]], "row 47 is not like"),
    info_pixels: ([[0, 0]], [[0, 19]], "pixels 0 to 19 of row 0 are not like"),
    info_column: ([[0, 47]], [[63, 63]], "column 63 is not like"),
    dark_border: ([[0, 47]], [[0, 2]], "columns 0 to 2 are not like"),
    bright_block: ([[10, 13]], [[30, 39]], "pixels 30 to 39 of rows 10 to 13 are not like"),
}


@pytest.mark.parametrize("damage", PLACES, ids=lambda f: f.__name__)
def test_odd_places_are_named_and_a_mask_leaves_them_out(cli: Cli, found, tmp_path: Path, damage) -> None:
    arrays, camera = recorded(9, frames=16)
    damage(arrays, np.random.default_rng(1))
    warnings = [w for w in found(arrays, camera) if w["kind"] == "odd_block"]
    assert len(warnings) == 1
    rows, columns, words = PLACES[damage]
    assert words in warnings[0]["text"], warnings[0]["text"]
    assert [b["rows"] for b in warnings[0]["pixels"]] == rows
    assert [b["columns"] for b in warnings[0]["pixels"]] == columns

    command, name = re.search(
        r"`clspeckle (capture check FOLDER --write-mask FOLDER/(\S+))`", warnings[0]["text"]
    ).groups()  # type: ignore[union-attr]
    printed = cli(*command.replace("FOLDER", "set").split()).stdout
    assert f"set/{name}: " in printed and f'"mask": "{name}"' in printed
    mask = iio.imread(tmp_path / "set" / name)
    assert mask.dtype == np.uint8 and mask.shape == SHAPE
    (r, s), (c, d) = rows[0], columns[0]
    assert (mask[r : s + 1, c : d + 1] == 0).all() and (mask == 0).sum() == (s + 1 - r) * (d + 1 - c)
    assert "which other findings may follow from. Mask them first" in warnings[0]["text"]
    assert found(arrays, camera, mask=name) == [], "what was masked misleads nothing"
    again = cli("capture", "check", "set", "--write-mask", f"set/{name}", code=1).stderr
    assert "exists; choose another name with --write-mask" in again
    for other in ("mask.jpg", "mask"):
        told = cli("capture", "check", "set", "--write-mask", other, code=1).stderr
        assert f"--write-mask {other}: the file is written as .png" in told and not (tmp_path / other).exists()


@pytest.mark.parametrize("names", [("board_static",), ("board_moving",), ("dots_static",), ("dots_moving",)], ids=str)
def test_telemetry_is_found_in_laser_light_alone(cli: Cli, found, tmp_path: Path, names: tuple[str, ...]) -> None:
    """A row that changes each frame, without dark frames or flats beside it."""
    cli("capture", "make", "drawn", "--width", 64, "--height", 48, "--frames", 12, "--sequences", ",".join(names))
    clean = json.loads(cli("capture", "check", "drawn", "--json", "-").stdout)["warnings"]
    assert "odd_block" not in kinds(clean)
    arrays = {name: np.load(tmp_path / "drawn" / f"{name}.npy") for name in names}
    random = np.random.default_rng(2)
    for codes in arrays.values():
        codes[:, 47] = random.integers(0, 1024, codes[:, 47].shape)
    for name, codes in arrays.items():
        np.save(tmp_path / "drawn" / f"{name}.npy", codes)
    told = json.loads(cli("capture", "check", "drawn", "--json", "-").stdout)["warnings"]
    (warning,) = [w for w in told if w["kind"] == "odd_block"]
    assert warning["pixels"] == [{"rows": [47, 47], "columns": [0, 63]}], warning


def test_the_written_mask_keeps_the_sets_own(cli: Cli, found, tmp_path: Path) -> None:
    arrays, camera = recorded(9)
    telemetry_row(arrays, np.random.default_rng(1))
    own = np.full(SHAPE, 255, np.uint8)
    own[:, :5] = 0
    (tmp_path / "set").mkdir()
    iio.imwrite(tmp_path / "set" / "own.png", own)
    found(arrays, camera, mask="own.png")
    printed = cli("capture", "check", "set", "--write-mask", "elsewhere.png").stdout
    assert 'once it lies in the set\'s folder, "mask": "elsewhere.png"' in printed
    expected = own.copy()
    expected[47] = 0
    np.testing.assert_array_equal(iio.imread(tmp_path / "elsewhere.png"), expected)


def test_single_pixels_are_counted(found) -> None:
    arrays, camera = recorded(10, frames=16)
    places = np.random.default_rng(2).permutation(48 * 64)[:12]
    rows, columns = places // 64, places % 64
    for codes in arrays.values():
        codes[:, rows[:5], columns[:5]] = np.minimum(codes[:, rows[:5], columns[:5]] + 150, 1023)  # hot
        codes[:, rows[5:9], columns[5:9]] = arrays["dark"][:, rows[5:9], columns[5:9]]  # without light
        codes[:, rows[9:], columns[9:]] = 700  # stuck
    (warning,) = [w for w in found(arrays, camera) if w["kind"] == "odd_pixels"]
    assert "12 single pixels (0.39 %) are not like the others" in warning["text"], warning["text"]
    assert "4 darker" in warning["text"]
    assert sorted((p["rows"][0], p["columns"][0]) for p in warning["pixels"]) == sorted(
        zip(rows.tolist(), columns.tolist())
    )


def test_a_pixel_of_one_frame_is_told_and_a_mask_leaves_it_out(cli: Cli, found, tmp_path: Path) -> None:
    arrays, camera = recorded(21, frames=8)
    arrays["board_static"][3, 20, 30] = 1023
    arrays["dark"][5, 7, 10:13] = [400, 900, 300]
    told = found(arrays, camera)
    assert kinds(told) == ["transient_pixels", "transient_pixels"], told
    dark, board = told
    assert (dark["sequence"], dark["frames"], len(dark["pixels"])) == ("dark", [5], 3)
    assert "frame 5 at 3 pixels of columns 10 to 12 and row 7" in dark["text"]
    assert board["frames"] == [3] and board["pixels"] == [{"rows": [20, 20], "columns": [30, 30]}]
    assert re.search(r"frame 3 at column 30, row 20 \(1023 DN, \d+ DN in the others\)", board["text"])
    command, name = re.search(r"To leave it out, `clspeckle (capture check .*/(\S+))`", board["text"]).groups()  # type: ignore[union-attr]
    cli(*command.replace("FOLDER", "set").split())
    assert (iio.imread(tmp_path / "set" / name) == 0).sum() == 4
    assert found(arrays, camera, mask=name) == []


def smoothed(codes: Array) -> Array:
    return np.rint((codes + sum(np.roll(codes, shift, axis) for shift in (-1, 1) for axis in (1, 2))) / 5)


@pytest.mark.parametrize("fault", ["smoothed", "averaged", "shakes", "slides"])
def test_what_no_raw_frames_show(found, fault: str) -> None:
    arrays, camera = recorded(22, frames=16)
    still = arrays["board_static"]
    if fault == "smoothed":
        told = found({name: smoothed(codes.astype(float)) for name, codes in arrays.items()}, camera)
        assert ("denoised", "dark, flat") in [
            (w["kind"], w["text"].partition("(in ")[2].partition(")")[0]) for w in told
        ]
        assert any("denoises, interpolates or scales its frames" in w["text"] for w in told)
        return
    if fault == "averaged":
        camera = {**camera, "read_noise_dn": 2.8}
        mean = {name: np.rint((codes[1:].astype(float) + codes[:-1]) / 2) for name, codes in arrays.items()}
        (text,) = [w["text"] for w in found(mean, camera) if w["kind"] == "denoised"]
        assert re.search(r"from frame to frame, by a correlation of 0\.(4[5-9]|5[0-5])", text), text
        return
    moved = [t for t in range(1, 16) if fault == "slides" or t % 2]
    for t in moved:  # a quarter of a pixel to the left at once; 0.02 more in each frame
        part = 0.02 * t if fault == "slides" else 0.25
        still[t] = np.rint((1 - part) * still[t] + part * np.roll(still[t], -1, axis=1))
    (warning,) = found(arrays, camera)
    assert warning["kind"] == "picture_moves" and warning["sequence"] == "board_static"
    assert {t for t in moved if fault == "shakes" or t > 6} <= set(warning["frames"]) <= set(moved), warning


@pytest.mark.parametrize("left", [0.3, -0.3])
def test_noise_that_goes_on_along_rows_alone_may_be_the_readouts(found, left: float) -> None:
    """A filter works in both directions; read noise goes on in the order in which pixels are read."""
    white = np.random.default_rng(31).normal(size=(16, SHAPE[0], SHAPE[1] + 1))
    noise = 4.0 * (white[..., 1:] + left * white[..., :-1]) / np.hypot(1.0, left)
    camera = {"bits": 10, "black_level_dn": 64, "read_noise_dn": 4.0}
    (warning,) = found({"dark": np.rint(64 + noise)}, camera)
    assert warning["kind"] == "denoised"
    assert "reads its pixels so (the effect correlated_read_noise), or filters its rows" in warning["text"]


def test_a_mosaic_is_told_and_one_site_has_none(found) -> None:
    arrays, camera = recorded(11, frames=16, shape=(64, 96))
    filters = np.tile([[0.5, 1.0], [0.97, 0.4]], (32, 48))
    mosaic = {name: np.rint((codes - 64.0) * (1 if name == "dark" else filters) + 64) for name, codes in arrays.items()}
    warnings = [w for w in found(mosaic, camera) if w["kind"] == "mosaic"]
    assert len(warnings) == 1
    assert re.match(r"in (?=[^:]*flat)(?=[^:]*board_moving)[^:]*: ", warnings[0]["text"])
    (site,) = {re.search(r"codes(\[:, (\d)::2, (\d)::2\])", w["text"]).groups() for w in warnings}  # type: ignore[union-attr]
    assert site[1:] == ("0", "1"), "the brightest site"
    one = {name: codes[:, int(site[1]) :: 2, int(site[2]) :: 2] for name, codes in mosaic.items()}
    again = found(one, {**camera, "pixel_pitch_um": 2 * 2.9})
    assert kinds(again) == ["fine_speckle"] * 2, again
    assert "Speckle is finer than such pixels, which is a warning of its own" in warnings[0]["text"]
    assert found(one, {**camera, "pixel_pitch_um": 2 * 2.9, "f_number": 12}) == []


@pytest.mark.parametrize("even_columns", [1.0, 0.996])
def test_a_mosaic_of_four_neighbours_each_is_told(found, even_columns: float) -> None:
    """As sensors have it that join four pixels of one filter in the dark; and whose columns differ a little, too."""
    arrays, camera = recorded(11, frames=16, shape=(64, 96))
    filters = np.kron(np.tile([[0.5, 0.97], [1.0, 0.4]], (16, 24)), np.ones((2, 2)))
    filters[:, 0::2] *= even_columns
    mosaic = {name: np.rint((codes - 64.0) * (1 if name == "dark" else filters) + 64) for name, codes in arrays.items()}
    (warning,) = [w for w in found(mosaic, camera) if w["kind"] == "mosaic"]
    assert "the four sites of 4 x 4 pixels" in warning["text"]
    site = re.search(r"codes\[:, (\d)::4, (\d)::4\].* divided by 4 and pixel_pitch_um times 4", warning["text"])
    assert site
    assert site.groups() == ("2", "0"), "the brightest site"
    one = {name: codes[:, int(site[1]) :: 4, int(site[2]) :: 4] for name, codes in mosaic.items()}
    assert "mosaic" not in kinds(found(one, {**camera, "pixel_pitch_um": 4 * 2.9, "f_number": 24}))


def test_light_that_tilts_is_no_mosaic(found) -> None:
    arrays, camera = recorded(11, frames=16, shape=(64, 48))
    tilted = np.linspace(0.4, 1.0, 48)
    uneven = {name: np.rint((codes - 64.0) * (1 if name == "dark" else tilted) + 64) for name, codes in arrays.items()}
    assert "mosaic" not in kinds(found(uneven, camera))


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_all_sequences_name_one_site(found, seed: int) -> None:
    """Of rows with gains of their own two sites are alike, of which chance would choose another in each sequence."""
    arrays, camera = recorded(seed, frames=16, shape=(64, 96))
    rows = np.where(np.arange(64) % 2, 0.95, 1.0)[:, None]
    told = found(
        {name: np.rint((codes - 64.0) * (1 if name == "dark" else rows) + 64) for name, codes in arrays.items()}, camera
    )
    (warning,) = [w for w in told if w["kind"] == "mosaic"]
    assert len(re.findall(r"codes\[:, 0::2, \d::2\]", warning["text"])) == 1


# --- Frames against frames ---


def test_frames_without_light(found) -> None:
    arrays, camera = recorded(12, frames=16)
    for name in ("board_static", "board_moving"):
        arrays[name][1::2] = arrays["dark"][1::2]
    warnings = found(arrays, camera)
    assert kinds(warnings) == ["frames_without_light"] * 2
    for warning in warnings:
        assert warning["frames"] == list(range(1, 16, 2))
        assert "8 of 16 frames (1, 3, 5, 7, 9, 11 and 2 more) have no light, 64." in warning["text"]
        advice = re.search(r"take (codes\[0::2\])$", warning["text"])
        assert advice
        arrays[warning["sequence"]] = eval(advice[1], {"codes": arrays[warning["sequence"]]})
    assert found(arrays, camera) == []
    arrays["flat"][[2, 3, 7]] = arrays["dark"][[2, 3, 7]]
    (warning,) = found(arrays, camera)
    assert warning["frames"] == [2, 3, 7]
    arrays["flat"] = eval(re.search(r"take (.*)$", warning["text"])[1], {"codes": arrays["flat"], "numpy": np})  # type: ignore[index]
    assert found(arrays, camera) == []


def test_torn_frames_are_told_and_left_out(found) -> None:
    """The grabber hands out frame 9 with the upper third of frame 8."""
    arrays, camera = recorded(14, frames=16)
    board = arrays["board_static"].copy()
    rows = board.shape[1] // 3
    board[9, :rows] = board[8, :rows]
    (warning,) = found({**arrays, "board_static": board}, camera)
    assert (warning["kind"], warning["sequence"], warning["frames"]) == ("torn_frames", "board_static", [9])
    advice = re.search(r"or leave those out: take (.*)$", warning["text"])
    assert advice
    arrays["board_static"] = eval(advice[1], {"codes": board, "numpy": np})
    assert found(arrays, camera) == []


def test_a_staircase_is_steps_and_a_smooth_drift_is_none(found) -> None:
    arrays, camera = recorded(13, frames=18)
    flat = arrays["flat"].astype(float)

    def lit(by: Array) -> list[dict[str, Any]]:
        light = np.rint(64 + (flat - 64) * by[:, None, None])
        return found({"dark": arrays["dark"], "flat": light}, camera)

    for steps in ((6, 12), (3, 8, 14)):
        (warning,) = lit(1 - 0.05 * np.searchsorted(steps, np.arange(18), side="right"))
        assert (warning["kind"], warning["frames"]) == ("level_steps", list(steps)), warning
    for smooth in (
        0.9 + 0.1 * np.linspace(0, 1, 18),
        1 - 0.3 * np.exp(-np.arange(18) / 5),
        1 + 0.05 * np.sin(np.arange(18) / 3),
    ):
        (warning,) = lit(smooth)
        assert (warning["kind"], warning["frames"]) == ("level_drifts", []), warning
    assert lit(np.ones(18)) == []


TIMES = np.arange(16)
FLUCTUATIONS = {
    "drift": 1 + 0.02 * TIMES,
    "settles": 1 - 0.3 * np.exp(-TIMES / 3),
    "three_levels": np.choose(TIMES % 3, [1.0, 0.7, 0.4]),
    "flicker": 1 + 0.2 * np.sin(2 * np.pi * TIMES / 5),
    "hunting": 1 + 0.3 * np.exp(-TIMES / 4) * np.cos(TIMES),
    "sawtooth": 1 + 0.1 * (TIMES % 4),
}


@pytest.mark.parametrize("scene", ["flat", "board_static"])
@pytest.mark.parametrize("course", FLUCTUATIONS)
def test_a_level_that_goes_up_and_down_is_told_with_its_frames(found, course: str, scene: str) -> None:
    """Drifts of resting speckle, too, of which no small one is told: it may boil."""
    arrays, camera = recorded(17, frames=16)
    by = FLUCTUATIONS[course]
    arrays[scene] = np.clip(np.rint(64 + (arrays[scene] - 64.0) * by[:, None, None]), 0, 1023)
    (warning,) = [w for w in found(arrays, camera) if w["kind"].startswith("level_")]
    assert warning["sequence"] == scene
    if warning["kind"] == "level_fluctuates":
        np.testing.assert_allclose(by[warning["frames"]], [by.min(), by.max()], rtol=1e-9)
    else:
        assert scene == "flat" and warning["kind"] == "level_drifts"


@pytest.mark.parametrize("seed", range(3))
def test_boiling_and_moving_speckle_fluctuate_by_themselves(found, seed: int) -> None:
    """Fields that are half new each frame, on so few pixels that the level goes by a tenth."""
    random = np.random.default_rng(seed)
    arrays, camera = recorded(18, frames=16, shape=(24, 32))
    shape, frames = (24, 32), []
    field = random.normal(size=shape) + 1j * random.normal(size=shape)
    pupil = np.hypot(np.fft.fftfreq(24)[:, None], np.fft.fftfreq(32)[None, :]) < 0.275
    for _ in range(16):
        field = np.sqrt(0.5) * (field + random.normal(size=shape) + 1j * random.normal(size=shape))
        frames.append(np.abs(np.fft.ifft2(np.fft.fft2(field) * pupil)) ** 2)
    light = 130 * np.stack(frames) / np.mean(frames)
    codes = np.clip(np.rint(64 + light + random.normal(size=light.shape) * 4), 0, 1023)
    assert np.ptp(codes.mean((1, 2))) > 10
    for name in ("board_static", "board_moving"):
        told = found({"dark": arrays["dark"], name: codes}, camera)
        assert "level_fluctuates" not in kinds(told)


# --- Masks, clipping ---


def test_a_mask_with_soft_edges(cli: Cli, found, tmp_path: Path) -> None:
    arrays, camera = recorded(14)
    (tmp_path / "set").mkdir()
    mask = np.full(SHAPE, 255, np.uint8)
    mask[:, :4] = [0, 60, 120, 200]
    iio.imwrite(tmp_path / "set" / "mask.png", mask)
    warnings = found(arrays, camera, mask="mask.png")
    assert kinds(warnings) == ["mask"], "once for all sequences"
    advice = re.search(r"of two values, (numpy\.where.*)$", warnings[0]["text"])
    assert advice and "144 pixels are neither 0 nor 255" in warnings[0]["text"]
    iio.imwrite(tmp_path / "set" / "mask.png", eval(advice[1], {"numpy": np, "mask": mask}))
    assert found(arrays, camera, mask="mask.png") == []


def test_clipping_at_zero(found) -> None:
    arrays, camera = recorded(15)
    below = {name: np.maximum(codes.astype(int) - 64, 0) for name, codes in arrays.items()}
    warnings = [w for w in found(below, {**camera, "black_level_dn": 0}) if w["kind"] == "clipped_at_zero"]
    assert {w["sequence"] for w in warnings} >= {"dark"}
    assert "A diagnosis estimates both behind the clipping" in warnings[0]["text"]


def test_what_is_masked_misleads_no_diagnosis(cli: Cli, tmp_path: Path) -> None:
    """The simulator's own frames with a row of data: a gap, until the written mask is named."""
    folder = tmp_path / "set"
    cli("capture", "make", "set", "--width", 64, "--height", 48, "--frames", 12, "--sequences", "dark,board_moving")
    random = np.random.default_rng(3)
    arrays = {name: np.load(folder / f"{name}.npy") for name in ("dark", "board_moving")}
    telemetry_row(arrays, random)
    for name, codes in arrays.items():
        np.save(folder / f"{name}.npy", codes)

    def verdict() -> str:
        cli("diagnose", "set", "--json", "out.json", "--quiet")
        return str(json.loads((tmp_path / "out.json").read_text())["cause"]["verdict"])

    assert verdict() != "none"
    cli("capture", "check", "set", "--write-mask", "set/odd.png")
    description = json.loads((folder / "capture.json").read_text())
    for sequence in description["sequences"]:
        sequence["mask"] = "odd.png"
    (folder / "capture.json").write_text(json.dumps(description))
    assert verdict() == "none"


def test_inverted_codes_are_named(found) -> None:
    arrays, camera = recorded(4, frames=4)
    told = found({name: 1023 - codes for name, codes in arrays.items()}, camera | {"black_level_dn": 1023 - 64})
    assert {"no_light"} <= set(kinds(told))
    assert all("are the codes inverted, so that 0 is white" in w["text"] for w in told if w["kind"] == "no_light")
    told = found(arrays | {"flat": arrays["dark"][::-1]}, camera)
    assert [w["text"].endswith("there is hardly any light in it") for w in told if w["kind"] == "no_light"] == [True]
