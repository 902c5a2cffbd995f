"""What numbers mean: light that is encoded, units, full scales, negative lobes; and frames that cannot be meant."""

from __future__ import annotations

import re
import struct
import sys
from pathlib import Path

import cli_images as images
import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms
from test_cli_scene import CAMERA, LASER, PATTERN, albedo, depth, normal, position, rendered, scene, visibility

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "io"))
import test_variants_pages  # noqa: E402

__all__ = ["scene"]

ARGUMENTS = ["-o", "out", *CAMERA, *PATTERN, *LASER]


def light(ok, folder: Path, *arguments: object) -> tuple[np.ndarray, str]:
    """The ideal image that is rendered, and what is said on the way."""
    result = ok("render", *arguments, "-o", "light", "--save-ideal", "--no-preview")
    return np.load(folder / "light" / "ideal_000000.npy"), result.err


def decoded(values: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1."""
    values = values.astype(float)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def srgb_profile() -> bytes:
    return ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


ENCODED = {
    "gray.png": lambda path: Image.fromarray(images.gray8()).save(path, icc_profile=srgb_profile()),
    "gray.tif": lambda path: Image.fromarray(images.gray8()).save(path, icc_profile=srgb_profile()),
}


@pytest.mark.parametrize("name", ENCODED)
def test_encoded_light_is_decoded_and_told(ok, tmp_path: Path, name: str) -> None:
    ENCODED[name](tmp_path / name)
    values = images.gray8() / 255
    given, told = light(ok, tmp_path, name)
    np.testing.assert_allclose(given, decoded(values), rtol=1e-5, atol=1e-7)
    assert f"{name}: its numbers are encoded for a screen (sRGB, says its ICC profile)" in told
    assert "--transfer linear" in told
    given, told = light(ok, tmp_path, name, "--transfer", "linear")
    np.testing.assert_array_equal(given, values.astype(np.float32))
    assert "warning" not in told


def test_jpeg_is_decoded(ok, tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(images.jpeg())
    given, told = light(ok, tmp_path, "a.jpg")
    np.testing.assert_allclose(given, decoded(images.jpeg_values()), rtol=1e-5, atol=1e-7)
    assert "(sRGB, says the format)" in told


def test_a_file_that_says_nothing_is_linear_unless_told(ok, tmp_path: Path) -> None:
    color = np.random.default_rng(6).integers(0, 256, (images.HEIGHT, images.WIDTH, 3), dtype=np.uint8)
    iio.imwrite(tmp_path / "a.png", color)
    given, told = light(ok, tmp_path, "a.png")
    np.testing.assert_allclose(given, (color / 255).mean(-1), rtol=1e-6)
    assert "encoded" not in told
    given, _ = light(ok, tmp_path, "a.png", "--transfer", "srgb")
    np.testing.assert_allclose(given, decoded(color / 255).mean(-1), rtol=1e-5)  # each color before the mean


def test_albedos_and_patterns_are_light_and_depths_are_not(ok, scene: Path) -> None:
    codes = np.rint(albedo() * 255).astype(np.uint8)
    Image.fromarray(codes).save(scene / "codes.png", icc_profile=srgb_profile())
    np.save(scene / "values.npy", decoded(codes / 255).astype(np.float32))
    Image.fromarray((depth() * 1000).astype(np.uint16)).save(scene / "mm.png", icc_profile=srgb_profile())
    np.save(scene / "m.npy", (depth() * 1000).astype(np.uint16).astype(np.float32) * 0.001)
    given = rendered(ok, scene, "--depth", "mm.png", "--depth-scale", 0.001, "--albedo", "codes.png", *CAMERA)
    expected = rendered(ok, scene, "--depth", "m.npy", "--albedo", "values.npy", *CAMERA)
    assert np.abs(given.astype(int) - expected).max() <= 1
    arguments = [*CAMERA, *LASER, *PATTERN[2:], "--exposure-gain", 30000, "--no-preview", "--format", "npy"]
    for name in ("codes.png", "values.npy"):
        ok("render", "--depth", "z.npy", "--pattern", name, "-o", name + ".out", *arguments)
    frames = [np.load(scene / f"{name}.out" / "frame_000000.npy").astype(int) for name in ("codes.png", "values.npy")]
    assert np.abs(frames[0] - frames[1]).max() <= 1


def profile(**tags: bytes) -> bytes:
    """An ICC profile with nothing but some tags."""
    data, table = b"", b""
    for name, content in tags.items():
        table += struct.pack(">4sII", name.encode(), 132 + 12 * len(tags) + len(data), len(content))
        data += content + bytes(-len(content) % 4)
    whole = bytes(128) + struct.pack(">I", len(tags)) + table + data
    return struct.pack(">I", len(whole)) + whole[4:]


def table(values: np.ndarray) -> bytes:
    return b"curv" + bytes(4) + struct.pack(f">I{len(values)}H", len(values), *values)


def test_a_tone_curve_that_is_a_table_is_decoded(ok, tmp_path: Path) -> None:
    entries = np.rint(65535 * np.linspace(0, 1, 64) ** 3).astype(int)
    curve = table(entries)
    for name, mode in (("gray.png", ("kTRC",)), ("rgb.tif", ("rTRC", "gTRC", "bTRC"))):
        pixels = images.gray8() if name == "gray.png" else images.rgb(images.gray8())
        Image.fromarray(pixels).save(tmp_path / name, icc_profile=profile(**dict.fromkeys(mode, curve)))
        given, told = light(ok, tmp_path, name)
        expected = np.interp(images.gray8() / 255, np.linspace(0, 1, 64), entries / 65535)
        np.testing.assert_allclose(given, expected, rtol=1e-5, atol=1e-7)
        assert "a table of 64 numbers, says its ICC profile" in told
    # sRGB as many profiles have it.
    srgb = np.rint(65535 * decoded(np.linspace(0, 1, 1024))).astype(int)
    Image.fromarray(images.gray8()).save(tmp_path / "srgb.png", icc_profile=profile(kTRC=table(srgb)))
    assert "(sRGB, says its ICC profile)" in light(ok, tmp_path, "srgb.png")[1]


UNKNOWN = {
    "no curve": profile(A2B0=b"mft1" + bytes(44)),
    "cut short": profile(kTRC=b"curv" + bytes(4) + struct.pack(">I", 4000)),
    "another kind": profile(kTRC=b"para" + bytes(4) + struct.pack(">HHI", 9, 0, 65536)),
    "three curves": profile(
        rTRC=table(np.array([0, 65535])), gTRC=table(np.array([0, 9, 65535])), bTRC=b"curv" + bytes(8)
    ),
}


@pytest.mark.parametrize("name", UNKNOWN)
def test_a_curve_that_is_not_known_is_refused_with_a_way_out(ok, refused, tmp_path: Path, name: str) -> None:
    Image.fromarray(images.gray8()).save(tmp_path / "a.png", icc_profile=UNKNOWN[name])
    message = refused("render", "a.png", "-o", "out")
    assert "a.png: its ICC profile has " in message
    for word in re.findall(r"--transfer (\w+)", message):
        given, told = light(ok, tmp_path, "a.png", "--transfer", word)
        expected = images.gray8() / 255
        np.testing.assert_allclose(given, decoded(expected) if word == "srgb" else expected, rtol=1e-5, atol=1e-7)
        assert "warning" not in told


# --- depth ---

MM = (depth() * 1000).astype(np.uint16)
INTEGERS = {
    "mm.png": lambda path: iio.imwrite(path, MM),
    "mm.tif": lambda path: tifffile.imwrite(path, MM),
    "u4.tif": lambda path: tifffile.imwrite(path, MM.astype(np.uint32)),
    "i4.npy": lambda path: np.save(path, MM.astype(np.int32)),
    "u2.npy": lambda path: np.save(path, MM),
    "mm.pgm": lambda path: images.pgm(path, MM, 65535),
}


@pytest.mark.parametrize("name", INTEGERS)
def test_integers_are_no_metres(ok, refused, scene: Path, name: str) -> None:
    INTEGERS[name](scene / name)
    np.save(scene / "m.npy", (MM * 0.001).astype(np.float32))
    message = refused("render", "--depth", name, *ARGUMENTS)
    assert f"{name}: depth must be floating-point metres, not " in message
    advice = re.search(r"(--depth-scale) ([\d.]+)", message)
    assert advice
    np.testing.assert_array_equal(
        rendered(ok, scene, "--depth", name, advice[1], advice[2], *CAMERA),
        rendered(ok, scene, "--depth", "m.npy", *CAMERA),
    )


def test_millimetres_as_metres_are_warned_of(ok, scene: Path) -> None:
    np.save(scene / "mm.npy", depth() * 1000)
    images.exr(scene / "mm.exr", {"Z": depth() * 1000})
    expected = rendered(ok, scene, "--depth", "z.npy", *CAMERA)
    for given in (["--depth", "mm.npy"], ["mm.exr"]):
        told = ok("render", *given, *ARGUMENTS, "--no-preview").err
        assert "m away in the median" in told and "--depth-scale 0.001" in told and "the frame has no light" in told
        frame = rendered(ok, scene, *given, "--depth-scale", 0.001, *CAMERA)
        assert np.abs(frame.astype(int) - expected).max() <= 1
    np.save(scene / "pmm.npy", position() * 1000)
    given = rendered(ok, scene, "--position", "pmm.npy", "--depth-scale", 0.001)
    assert np.abs(given.astype(int) - rendered(ok, scene, "--position", "p.npy")).max() <= 1


@pytest.mark.parametrize("background", [0.0, np.inf, np.nan, 65504.0, 1e10])
def test_backgrounds_are_no_surface(ok, scene: Path, background: float) -> None:
    plane = depth()
    plane[:, 30:] = 0
    np.save(scene / "nothing.npy", plane)
    plane[:, 30:] = background
    np.save(scene / "background.npy", plane)
    np.testing.assert_array_equal(
        rendered(ok, scene, "--depth", "background.npy", *CAMERA),
        rendered(ok, scene, "--depth", "nothing.npy", *CAMERA),
    )


@pytest.mark.parametrize(("scale", "far"), [(1e-6, 1.0), (0.001, 80.0)])
def test_depths_end_in_metres_whatever_their_unit_is(ok, scene: Path, scale: float, far: float) -> None:
    """Micrometres are large numbers, and so are millimetres of a far wall; renderers' background is none of them."""
    plane = depth()
    plane[:, 20:] = far
    plane[:, 30:] = 0
    np.save(scene / "m.npy", plane)
    numbers = (plane / scale).astype(np.float32)
    np.save(scene / "unit.npy", numbers)
    if scale == 1e-6:
        told = ok("render", "--depth", "unit.npy", *ARGUMENTS, "--no-preview").err
        assert "beyond 65504 m; --depth-scale gives the unit of the numbers" in told
    given = rendered(ok, scene, "--depth", "unit.npy", "--depth-scale", scale, *CAMERA)
    expected = rendered(ok, scene, "--depth", "m.npy", *CAMERA)
    assert np.abs(given.astype(int) - expected).max() <= 1 and len(np.unique(given)) > 2
    for background in (65504.0, 1e10):
        numbers[:, 30:] = background
        np.save(scene / "far.npy", numbers)
        np.testing.assert_array_equal(rendered(ok, scene, "--depth", "far.npy", "--depth-scale", scale, *CAMERA), given)


@pytest.mark.parametrize(
    ("plane", "words"), [(-depth(), "depths are negative"), (np.full_like(depth(), 1e10), "all depths are 0, infinite")]
)
def test_a_scene_without_surfaces(ok, scene: Path, plane: np.ndarray, words: str) -> None:
    np.save(scene / "none.npy", plane)
    told = ok("render", "--depth", "none.npy", *ARGUMENTS).err
    assert "none.npy: no pixel has a surface: " + words in told and "the frame has no light" in told


# --- full scale ---


KINDS = {"i1": np.int8, "i2": np.int16, "i4": np.int32, "i8": np.int64, "u4": np.uint32, "u8": np.uint64}
WHOLE = [*(f"{kind}.npy" for kind in KINDS), "i1.tif", "i2.tif", "i4.tif", "u4.tif"]


@pytest.mark.parametrize("name", WHOLE)
def test_integers_that_fill_their_type(ok, tmp_path: Path, name: str) -> None:
    """The number that is advised is the type's largest: half of that of an unsigned one."""
    top = np.iinfo(KINDS[name[:2]]).max
    values = np.full((32, 48), top // 2 + 1, KINDS[name[:2]])
    values[5, 7] = top
    (np.save if name.endswith("npy") else tifffile.imwrite)(tmp_path / name, values)
    told = light(ok, tmp_path, name)[1]
    for pattern, before in ((r"(--full-scale \S+) makes", [name]), (None, [])):
        advice = re.search(pattern, told)[1].split() if pattern else [f"{name}:full_scale={top}"]
        given, said = light(ok, tmp_path, *before, *advice)
        np.testing.assert_allclose(given, values / top, rtol=1e-6)
        assert given.max() == 1 and "full scale" not in said


@pytest.mark.parametrize("name", ["u2.npy", "i2.npy", "i4.npy", "u4.tif", "u2.png", "u2.tif"])
def test_integers_of_unknown_full_scale(ok, tmp_path: Path, name: str) -> None:
    codes = images.gray10()
    kind = {"u2": np.uint16, "i2": np.int16, "i4": np.int32, "u4": np.uint32}[name[:2]]
    path = tmp_path / name
    (np.save if name.endswith("npy") else iio.imwrite if name.endswith("png") else tifffile.imwrite)(
        path, codes.astype(kind)
    )
    told = light(ok, tmp_path, name)[1]
    advice = re.search(r"(--full-scale) (\d+)", told)
    assert advice and f"{name}: its " in told and "of 10 bits" in told or "have 10 bits" in told
    given, told = light(ok, tmp_path, name, advice[1], advice[2])
    np.testing.assert_array_equal(given, images.scaled(codes, 1023))
    assert "warning" not in told


@pytest.mark.parametrize("name", ["u2.npy", "i4.npy", "u4.tif", "u2.png"])
@pytest.mark.parametrize("plane", ["albedo", "visibility", "pattern"])
def test_planes_of_unknown_full_scale(cli, ok, scene: Path, plane: str, name: str) -> None:
    """The rule of the ideal image; what the message names reads the plane."""
    codes = np.rint(1023 * albedo()).astype(int)
    kind = {"u2": np.uint16, "i4": np.int32, "u4": np.uint32}[name[:2]]
    (np.save if name.endswith("npy") else iio.imwrite if name.endswith("png") else tifffile.imwrite)(
        scene / name, codes.astype(kind)
    )
    np.save(scene / "values.npy", (codes / 1023).astype(np.float32))
    patterned = [*LASER, *PATTERN[2:]] if plane == "pattern" else [*LASER, *PATTERN]

    def run(file: str, out: str):
        return cli("render", "--depth", "z.npy", f"--{plane}", file, "-o", out, *CAMERA, *patterned,
                   "--exposure-gain", 30000, "--format", "npy", "--no-preview")  # fmt: skip

    told = run(name, "first").err
    advice = re.search(rf"{re.escape(name)}:full_scale=1023", told)
    assert advice, told
    given, expected = run(advice[0], "given"), run("values.npy", "expected")
    assert given.code == 0 and "warning" not in given.err
    frames = [np.load(scene / folder / "frame_000000.npy") for folder in ("given", "expected")]
    np.testing.assert_array_equal(*frames)
    assert expected.code == 0


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_zeros_and_ones_as_integers(cli, ok, scene: Path, kind: type) -> None:
    """Masks are saved so; 1 of 255 is no light."""
    ones = visibility() > 0.5
    np.save(scene / "ones.npy", ones.astype(kind))
    told = light(ok, scene, "ones.npy")[1]
    advice = re.search(r"if its numbers are 0 and 1, (--full-scale 1) makes 1 mean 1", told)
    assert advice and f"its largest number is 1 of {np.iinfo(kind).max}" in told
    given, told = light(ok, scene, "ones.npy", *advice[1].split())
    np.testing.assert_array_equal(given, ones)
    assert "warning" not in told
    command = ["render", "--depth", "z.npy", *CAMERA, "-o", "out", *PATTERN, *LASER, "--exposure-gain", 30000]
    told = cli(*command, "--visibility", "ones.npy").err
    advice = re.search(r"if its numbers are 0 and 1, (\S+) makes 1 mean 1", told)
    assert advice and cli(*command, "--visibility", advice[1]).err == ""


LARGEST_AND_TOP = [(80.0, 100), (100.0, 100), (200.0, 255), (255.5, 255), (300.0, 1023), (1023.0, 1023),
                   (65535.0, 65535)]  # fmt: skip


def of_another_scale(told: str, plane: str) -> re.Match[str] | None:
    """What is advised, and the number that stands for 1."""
    named = re.search(r"if (?P<top>\d+) stands for 1, (?P<name>\S+) divides them", told)
    return named or re.search(rf"save (?P<save>.*{plane} / \d+.*), if (?P<top>\d+) stands for 1", told)


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize(("largest", "top"), LARGEST_AND_TOP)
@pytest.mark.parametrize("plane", ["albedo", "visibility"])
def test_planes_of_another_scale_are_divided(cli, ok, scene: Path, plane: str, largest, top, whole: bool) -> None:
    """Cutting would make all of them 1. Whole numbers need bits, but 100, where it is the largest."""
    if whole:
        largest, top = (float(top), top) if largest == 255.5 else (largest, 255 if largest == 80 else top)
    scaled = np.linspace(0, largest, depth().size, dtype=np.float32).reshape(depth().shape)
    scaled = np.floor(scaled) if whole else scaled
    np.save(scene / "scaled.npy", scaled)
    command = ["render", "--depth", "z.npy", *CAMERA, "-o", "out", *PATTERN, *LASER, "--exposure-gain", 30000,
               f"--{plane}"]  # fmt: skip
    expected = np.minimum(scaled / np.float32(top), 1)
    for name in ("scaled.npy", "scaled.npy:full_scale=1"):
        advice = of_another_scale(cli(*command, name).err, plane)
        assert advice and int(advice["top"]) == top
        named = advice.groupdict().get("name")
        if named is None:
            np.save(scene / "again.npy", eval(advice["save"], {plane: scaled, "numpy": np}))
            np.testing.assert_array_equal(np.load(scene / "again.npy"), expected)
        assert named in (None, f"scaled.npy:full_scale={top}")
        assert ok(*command, named or "again.npy").err == ""
    images.exr(scene / "scaled.exr", {"Z": depth(), plane: scaled})
    advice = of_another_scale(cli(*[w for w in command[:-1] if w not in ("--depth", "z.npy")], "scaled.exr").err, plane)
    assert advice and int(advice["top"]) == top
    np.testing.assert_array_equal(eval(advice["save"], {plane: scaled, "numpy": np}), expected)


@pytest.mark.parametrize("plane", ["albedo", "visibility"])
def test_planes_that_are_little_or_seldom_above_one_are_cut(cli, ok, scene: Path, plane: str) -> None:
    command = ["render", "--depth", "z.npy", *CAMERA, "-o", "out", *PATTERN, *LASER, "--exposure-gain", 30000,
               f"--{plane}", "above.npy"]  # fmt: skip
    few, all_by_little = visibility().astype(np.float32), 1.05 + 0.25 * visibility().astype(np.float32)
    few[2, 3:6] = 90
    for above in (few, all_by_little):
        np.save(scene / "above.npy", above)
        advice = re.search(rf"save (numpy\.minimum\({plane}, 1\)), which cuts", cli(*command).err)
        assert advice
        np.save(scene / "above.npy", eval(advice[1], {plane: above, "numpy": np}))
        assert ok(*command).err == ""


@pytest.mark.parametrize("plane", ["albedo", "visibility"])
def test_a_plane_without_light_is_the_cause(ok, scene: Path, plane: str) -> None:
    images.exr(scene / "two.exr", {"unused": np.zeros_like(depth()), plane: np.ones_like(depth())})
    command = ["render", "--depth", "z.npy", *CAMERA, "-o", "out", *PATTERN, *LASER, "--exposure-gain", 30000]
    told = ok(*command, f"--{plane}", "two.exr:unused").err
    assert f"the {plane} two.exr:unused is 0 everywhere: it may be another channel or page than meant" in told
    assert "does not meet the scene" not in told
    assert ok(*command, f"--{plane}", f"two.exr:{plane}").err == ""
    images.exr(scene / "all.exr", {"Z": depth(), plane: np.zeros_like(depth())})
    assert f"the {plane} all.exr is 0 everywhere" in ok("render", "all.exr", *command[3:]).err


def test_centimetres_as_metres_are_warned_of(ok, scene: Path) -> None:
    np.save(scene / "cm.npy", depth() * 200)
    advice = re.search(r"takes the numbers as millimetres, (0\.01) as centimetres",
                       ok("render", "--depth", "cm.npy", *ARGUMENTS, "--no-preview").err)  # fmt: skip
    assert advice
    np.save(scene / "m.npy", depth() * 2)
    given = rendered(ok, scene, "--depth", "cm.npy", "--depth-scale", advice[1], *CAMERA)
    expected = rendered(ok, scene, "--depth", "m.npy", *CAMERA)
    assert np.abs(given.astype(int) - expected).max() <= 1


def test_full_scale_is_of_light(ok, refused, scene: Path) -> None:
    np.save(scene / "codes.npy", images.gray10())
    given, told = light(ok, scene, "codes.npy:full_scale=1023")
    np.testing.assert_array_equal(given, images.scaled(images.gray10(), 1023))
    assert "warning" not in told
    np.save(scene / "stack.npy", np.stack([images.gray10()] * 3))
    np.testing.assert_array_equal(light(ok, scene, "stack.npy:page=1,full_scale=1023")[0], given)
    assert "of 10 bits it is full_scale=1023" in refused("render", "codes.npy:full_scale=x", "-o", "out")
    np.save(scene / "mm.npy", MM)
    message = refused("render", "--depth", "mm.npy:full_scale=1000", *ARGUMENTS)
    assert "For depths --depth-scale does it" in message
    ok("render", "--depth", "mm.npy", "--depth-scale", 0.001, *ARGUMENTS)


def test_two_full_scales(ok, refused, tmp_path: Path) -> None:
    np.save(tmp_path / "codes.npy", images.gray10())
    message = refused("render", "codes.npy:full_scale=1023", "--full-scale", 4095, "-o", "out")
    assert "full_scale=1023 behind the file and --full-scale 4095; name one" in message
    for arguments in (["codes.npy:full_scale=1023", "--full-scale", 1023], ["codes.npy", "--full-scale", 1023]):
        np.testing.assert_array_equal(light(ok, tmp_path, *arguments)[0], images.scaled(images.gray10(), 1023))


def test_png_tells_significant_bits(ok, tmp_path: Path) -> None:
    """Codes of 11 bits in the lower ones of 16, and where the format wants them."""
    codes = np.random.default_rng(1).integers(0, 1500, (images.HEIGHT, images.WIDTH), dtype=np.uint16)
    chunk = test_variants_pages.chunk(b"sBIT", b"\x0b")
    (tmp_path / "low.png").write_bytes(test_variants_pages.png(codes, chunk))
    told = light(ok, tmp_path, "low.png")[1]
    assert "if its codes have 11 bits, as its chunk sBIT says, --full-scale 2047 makes" in told
    given, told = light(ok, tmp_path, "low.png", "--full-scale", 2047)
    np.testing.assert_array_equal(given, images.scaled(codes, 2047))
    (tmp_path / "high.png").write_bytes(test_variants_pages.png(codes << 5, chunk))
    assert "warning" not in light(ok, tmp_path, "high.png")[1]


def test_codes_that_fill_their_type_are_no_question(ok, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", images.gray16())
    np.save(tmp_path / "b.npy", images.gray8())
    for name in ("a.npy", "b.npy"):
        assert "warning" not in light(ok, tmp_path, name)[1]


# --- frames that cannot be meant ---


def test_a_frame_without_light(ok, tmp_path: Path) -> None:
    np.save(tmp_path / "dim.npy", np.full((32, 48), 1e-6, np.float32))
    told = ok("render", "dim.npy", "-o", "out").err
    assert "dim.npy: the frame has no light: the brightest number is 1e-06" in told and "--exposure-gain auto" in told
    assert "warning" not in ok("render", "dim.npy", "-o", "auto", "--exposure-gain", "auto").err
    assert "warning" not in ok("render", "dim.npy", "-o", "dark", "--illumination", "dark").err
    np.save(tmp_path / "black.npy", np.zeros((32, 48), np.float32))
    black = ok("render", "black.npy", "-o", "float", "--no-sensor", "--format", "float-npy").err
    assert "the frame has no light" in black


def test_a_black_image_has_another_cause(ok, refused, tmp_path: Path) -> None:
    """No gain helps: the picture is elsewhere, or there is none."""
    images.exr(tmp_path / "passes.exr", {"R": np.zeros_like(images.real()), "IR": images.real()})
    tifffile.imwrite(tmp_path / "pages.tif", np.stack([np.zeros_like(images.gray16()), images.gray16()]))
    for file in ("passes.exr:R", "pages.tif:page=0"):
        told = ok("render", file, "-o", "out").err
        assert "is 0 everywhere: it may be another channel or page than meant" in told and "--exposure-gain" not in told
        assert "FILE:CHANNEL and FILE:page=N" in told
    for file in ("passes.exr:IR", "pages.tif:page=1"):
        assert "warning" not in ok("render", file, "-o", "out").err
    message = refused("render", "passes.exr:R", "-o", "auto", "--exposure-gain", "auto")
    assert "so that no exposure can be chosen. If no light is meant, give --illumination dark and a number" in message
    dark = ok("render", "passes.exr:R", "-o", "auto", "--exposure-gain", 500, "--illumination", "dark").err
    assert "warning" not in dark


def test_normals_that_face_away_are_named(ok, scene: Path) -> None:
    turned = normal() * np.array([1, -1, -1], np.float32)
    np.save(scene / "turned.npy", turned)
    for surface in (["--depth", "z.npy", *CAMERA], ["--position", "p.npy"]):
        told = ok("render", *surface, "--normal", "turned.npy", "-o", "out", *PATTERN, *LASER).err
        advice = re.search(r"save (normals\[\.\.\., :3\] \* \[1, -1, -1\])", told)
        of = "camera" if "--depth" in surface else "laser"
        assert advice and f"turned.npy: 1712 of 1712 normals face away from the {of}" in told
        assert "the frame has no light" in told
        np.save(scene / "again.npy", np.asarray(eval(advice[1], {"normals": turned}), np.float32))
        told = ok(
            "render", *surface, "--normal", "again.npy", "-o", "out", *PATTERN, *LASER, "--exposure-gain", 30000
        ).err
        assert "warning" not in told


def test_normals_that_are_stored_as_colors_are_named(ok, refused, scene: Path) -> None:
    command = ["render", "--depth", "z.npy", *CAMERA, "-o", "out", *PATTERN, *LASER, "--exposure-gain", 30000]
    colors = (normal() + 1) / 2
    np.save(scene / "colors.npy", colors.astype(np.float32))
    told = ok(*command, "--normal", "colors.npy").err
    advice = re.search(r"look encoded as colors, 0 to 1 for -1 to 1: then save (2 \* normals\[\.\.\., :3\] - 1)", told)
    assert advice
    np.save(scene / "again.npy", eval(advice[1], {"normals": colors}).astype(np.float32))
    assert ok(*command, "--normal", "again.npy").err == ""
    codes = np.rint(65535 * colors).astype(np.uint16)
    np.save(scene / "codes.npy", codes)
    advice = re.search(
        r"save (\(normals \* \(2 / 65535\) - 1\)\.astype\(numpy\.float32\))", refused(*command, "--normal", "codes.npy")
    )
    assert advice
    np.save(scene / "again.npy", eval(advice[1], {"normals": codes, "numpy": np}))
    assert ok(*command, "--normal", "again.npy").err == ""
    np.save(scene / "codes.npy", np.rint(255 * colors).astype(np.float32))
    told = ok(*command, "--normal", "codes.npy").err
    advice = re.search(r"look encoded as colors of 8 bits: then save (normals\[\.\.\., :3\] / 255 \* 2 - 1)", told)
    assert advice
    decoded = eval(advice[1], {"normals": np.load(scene / "codes.npy")})
    np.save(scene / "again.npy", decoded)
    assert ok(*command, "--normal", "again.npy").err == ""
    np.save(scene / "scaled.npy", np.rint(127 * normal()).astype(np.int8))
    told = ok(*command, "--normal", "scaled.npy").err
    advice = re.search(r"save (normals\[\.\.\., :3\] / numpy\.maximum\(.*, 1\))", told)
    assert advice
    unit = eval(advice[1], {"normals": np.load(scene / "scaled.npy"), "numpy": np})
    np.save(scene / "again.npy", unit.astype(np.float32))
    assert ok(*command, "--normal", "again.npy").err == ""
    first = np.moveaxis(normal(), -1, 0)
    np.save(scene / "first.npy", first)
    advice = re.search(r"save (numpy\.moveaxis\(array, 0, -1\))", refused(*command, "--normal", "first.npy"))
    assert advice
    np.save(scene / "again.npy", eval(advice[1], {"array": first, "numpy": np}))
    assert ok(*command, "--normal", "again.npy").err == ""


def test_a_pattern_without_light_is_the_cause(ok, scene: Path) -> None:
    images.exr(scene / "two.exr", {"unused": np.zeros((32, 32), np.float32), "IR": np.ones((32, 32), np.float32)})
    command = ["render", "--depth", "z.npy", *CAMERA, "-o", "out", *PATTERN[2:], *LASER, "--exposure-gain", 2000]
    told = ok(*command, "--pattern", "two.exr:unused").err
    assert "two.exr:unused is 0 everywhere: it may be another channel or page than meant, which FILE:CHANNEL" in told
    assert "does not meet the scene" not in told
    assert ok(*command, "--pattern", "two.exr:IR").err == ""


def test_a_frame_that_is_all_at_the_top_code(ok, tmp_path: Path) -> None:
    np.save(tmp_path / "bright.npy", np.full((32, 48), 800, np.int16))
    told = ok("render", "bright.npy", "-o", "out").err
    assert re.search(
        r"bright.npy: \d+ % of the frame is at the top code, where 100 % has light: the mean light is 800", told
    )
    assert "--full-scale N makes N the number that means 1" in told and "--exposure-gain auto finds one" in told
    assert "top code:" not in ok("render", "bright.npy", "-o", "auto", "--exposure-gain", "auto").err
    assert "top code:" not in ok("render", "bright.npy", "-o", "scale", "--full-scale", 1023).err


def test_negative_lobes(ok, refused, scene: Path) -> None:
    lobes = images.real()
    lobes[3:5, 6] = -0.0015
    images.exr(scene / "lobes.exr", {"R": lobes, "G": lobes, "B": lobes})
    message = refused("render", "lobes.exr", "-o", "out")
    assert "pixel (6, 3) is -0.0015" in message and "--clip-negative" in message
    given, told = light(ok, scene, "lobes.exr", "--clip-negative")
    np.testing.assert_array_equal(given, np.maximum(lobes, 0))
    assert f"lobes.exr: 2 of {lobes.size} pixels of the ideal image were negative, down to -0.0015" in told
    plane = albedo()
    plane[7, 11] = -0.5
    np.save(scene / "albedo.npy", plane)
    given = ["--depth", "z.npy", "--albedo", "albedo.npy"]
    assert "--clip-negative" in refused("render", *given, *ARGUMENTS)
    assert "1 of 1728 pixels of the albedo were negative" in ok("render", *given, *ARGUMENTS, "--clip-negative").err


def test_a_refusal_comes_with_what_was_said_before(refused, scene: Path) -> None:
    """Swapped bytes may be the cause of what is refused."""
    np.save(scene / "swapped.npy", (1000 * depth() + 200).astype(np.int16).byteswap())
    message = refused("render", "--depth", "swapped.npy", *ARGUMENTS)
    assert "must be floating-point metres, not int16" in message
    assert "its words look as if their bytes were swapped" in message


@pytest.mark.parametrize("plane", ["ideal image", "albedo", "pattern"])
def test_numbers_of_another_type(ok, scene: Path, plane: str) -> None:
    """Whole numbers by their bytes, as reals; and a few such numbers, which the tails of a beam have."""
    shape = (images.HEIGHT, images.WIDTH) if plane == "ideal image" else depth().shape
    codes = np.random.default_rng(2).integers(1, 1000, shape, dtype=np.int32)
    tails = np.where(codes < 300, 1e-35, codes / 1000).astype(np.float32)
    arguments = {
        "ideal image": ["numbers.npy", "-o", "out"],
        "albedo": ["--depth", "z.npy", "--albedo", "numbers.npy", *ARGUMENTS],
        "pattern": [
            "--depth",
            "z.npy",
            "--pattern",
            "numbers.npy",
            *ARGUMENTS[: 2 + len(CAMERA)],
            *PATTERN[2:],
            *LASER,
        ],
    }[plane]
    for array, told in ((codes.view(np.float32), True), (tails, False)):
        np.save(scene / "numbers.npy", array)
        said = ok("render", *arguments).err
        assert (f"numbers of the {plane} that are not 0 are closer to 0 than 1e-30" in said) == told


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_none(ok, refused, scene: Path, bad: float) -> None:
    values = images.real()
    values[0, :2] = bad
    values[1, 1] = -1
    np.save(scene / "bad.npy", values)
    message = refused("render", "bad.npy", "-o", "out")
    assert f"bad.npy: pixel (0, 0) is {bad}" in message
    options = re.findall(r"--[a-z-]+", message)
    assert options == ["--clip-negative", "--zero-nonfinite"]
    given, told = light(ok, scene, "bad.npy", *options)
    np.testing.assert_array_equal(given, np.where(np.isfinite(values) & (values >= 0), values, 0))
    assert f"bad.npy: 2 of {values.size} pixels of the ideal image were NaN or infinite and were set to 0" in told
    plane = albedo()
    plane[7, 11] = bad
    np.save(scene / "albedo.npy", plane)
    message = refused("render", "--depth", "z.npy", "--albedo", "albedo.npy", *ARGUMENTS)
    assert re.findall(r"--[a-z-]+", message) == ["--zero-nonfinite"]
    ok("render", "--depth", "z.npy", "--albedo", "albedo.npy", *ARGUMENTS, "--zero-nonfinite")


def test_what_holds_for_all_frames_is_said_once(ok, tmp_path: Path) -> None:
    color = np.random.default_rng(6).integers(0, 256, (images.HEIGHT, images.WIDTH, 3), dtype=np.uint8)
    for i in range(4):
        Image.fromarray(np.roll(color, i, axis=0)).save(tmp_path / f"frame_{i}.png", icc_profile=srgb_profile())
    told = ok("render", "frame_*.png", "-o", "out").err
    assert told.count("color channels differ") == 1 and told.count("encoded for a screen") == 1


SOFT = np.clip(8 * np.arange(images.WIDTH) - 100, 0, 255).astype(np.uint8)[None, :].repeat(images.HEIGHT, axis=0)
MASKS = {
    "uint8.npy": SOFT,
    "float.npy": SOFT / np.float32(255),
    "labels.png": SOFT // 60,
}


@pytest.mark.parametrize("name", MASKS)
@pytest.mark.parametrize("option", ["--mask", "--refresh-mask"])
def test_soft_masks_are_told_once(ok, tmp_path: Path, option: str, name: str) -> None:
    """All that is not 0 counts; of two values it is as it was meant."""
    mask = MASKS[name]
    np.save(tmp_path / "frame.npy", np.stack([images.real()] * 2))

    def told(file: str, array: np.ndarray) -> str:
        np.save(tmp_path / file, array) if file.endswith(".npy") else iio.imwrite(tmp_path / file, array)
        if option == "--mask":
            return ok("statistics", "frame.npy", option, file).err
        render = ["render", "frame.npy", "-o", "out", "--no-preview", "--exposure-gain", 300, "--refresh", "mask"]
        return ok(*render, option, file).err

    said = told(name, mask)
    assert said.count("as of a soft edge: all count") == 1
    two = re.search(r"of two values, (numpy\.where\(mask > (\S+), .*\))", said)
    assert two and float(two[2]) == pytest.approx((mask[mask > 0].min() + mask.max()) / 2)
    for values in (eval(two[1], {"numpy": np, "mask": mask}), mask > 0, np.where(mask > 0, 7.0, 0.0)):
        assert told("two.npy", values) == ""


def test_white_that_is_zero_of_fewer_bits(ok, tmp_path: Path) -> None:
    """Counted from 65535, codes of 10 bits would all be next to white."""
    codes = images.gray10()
    tifffile.imwrite(tmp_path / "a.tif", codes, photometric="miniswhite")
    told = light(ok, tmp_path, "a.tif")[1]
    advice = re.search(r"save (tifffile\.imwrite\(.*\)) and take that with (--full-scale) (\d+)", told)
    assert advice and "10 bits" in told
    eval(advice[1], {"tifffile": tifffile, "image": codes, "new_path": tmp_path / "b.tif"})
    given, told = light(ok, tmp_path, "b.tif", advice[2], advice[3])
    np.testing.assert_array_equal(given, images.scaled(1023 - codes, 1023))
    assert "warning" not in told
    tifffile.imwrite(tmp_path / "c.tif", np.uint16(65535) - codes, photometric="miniswhite")
    assert "0 is white" not in light(ok, tmp_path, "c.tif")[1]


def test_a_plane_whose_white_is_zero_of_fewer_bits(ok, scene: Path) -> None:
    """What the message names reads the plane that it says how to save."""
    codes = np.rint(1023 * albedo()).astype(np.uint16)
    tifffile.imwrite(scene / "a.tif", codes, photometric="miniswhite")
    told = ok("render", "--depth", "z.npy", "--albedo", "a.tif", *ARGUMENTS, "--no-preview").err
    advice = re.search(r"save (tifffile\.imwrite\(.*\)) and take new_path:(full_scale=1023)", told)
    assert advice, told
    eval(advice[1], {"tifffile": tifffile, "image": codes, "new_path": scene / "b.tif"})
    np.save(scene / "values.npy", (1 - codes / 1023).astype(np.float32))
    frames = [
        rendered(ok, scene, "--depth", "z.npy", "--albedo", file, *CAMERA)
        for file in (f"b.tif:{advice[2]}", "values.npy")
    ]
    assert np.abs(frames[0].astype(int) - frames[1]).max() <= 1


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
def test_words_with_swapped_bytes_are_told_in_every_format(ok, tmp_path: Path, name: str) -> None:
    """Codes of 10 bits whose bytes were swapped before they were saved. The advice takes that back."""
    codes = np.random.default_rng(3).integers(100, 900, (24, 32)).astype(np.uint16)

    def save(values: np.ndarray) -> None:
        iio.imwrite(tmp_path / name, values)

    save(codes.byteswap())
    _, said = light(ok, tmp_path, name)
    assert f"{name}: its words look as if their bytes were swapped" in said and "none needs more than 10 bits" in said
    assert "If so, save array.byteswap()" in said
    save(iio.imread(tmp_path / name).byteswap())
    image, said = light(ok, tmp_path, name, "--full-scale", 1023)
    assert "swapped" not in said
    np.testing.assert_allclose(image, codes / 1023, rtol=1e-6)
    for harmless in (codes * 64, np.arange(24 * 32).reshape(24, 32) * 80, (codes // 4) * 256):
        save(harmless.astype(np.uint16))
        assert "swapped" not in light(ok, tmp_path, name)[1]
