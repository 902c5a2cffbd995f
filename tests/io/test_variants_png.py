"""PNG and BMP in many variants: the samples that Pillow and pypng see."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import png
import pytest
from PIL import Image
from test_variants import SIZES, Dump, noise

Array = np.ndarray
KINDS = {"gray": 1, "gray_alpha": 2, "rgb": 3, "rgba": 4}


@pytest.mark.parametrize("interlace", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_pypng(tmp_path: Path, kind: str, interlace: bool) -> None:
    channels = KINDS[kind]
    for size in SIZES:
        for bits in (1, 2, 4, 8, 16) if kind == "gray" else (8, 16):
            rows = noise(size, channels, 2**bits - 1).reshape(size[1], -1)
            writer = png.Writer(*size, greyscale=channels < 3, alpha=channels % 2 == 0, bitdepth=bits,
                                interlace=interlace, compression=int(size[0] % 10))  # fmt: skip
            with (tmp_path / "a.png").open("wb") as stream:
                writer.write(stream, rows.tolist())
            _, _, read, _ = png.Reader(filename=str(tmp_path / "a.png")).read()
            expected = np.array([list(row) for row in read]).reshape(size[1], size[0], channels).astype(np.float64)
            given = Dump(tmp_path / "a.png")
            assert not given.error and given.channels == channels and given.alpha == (channels % 2 == 0)
            shown = given.values[0].reshape(expected.shape)
            np.testing.assert_array_equal(shown.astype(np.float64) * (2**bits - 1), expected * given.full_scale)


@pytest.mark.parametrize("bits", [1, 2, 4, 8])
def test_palettes(tmp_path: Path, bits: int) -> None:
    for index, size in enumerate(SIZES):
        codes = noise(size, 1, 2**bits - 1)
        palette = np.random.default_rng(index).integers(0, 256, (2**bits, 3))
        with (tmp_path / "a.png").open("wb") as stream:
            png.Writer(*size, palette=palette.tolist(), bitdepth=bits, interlace=index % 2 == 1).write(
                stream, codes.tolist()
            )
        Dump(tmp_path / "a.png").check(palette[codes], 255)


@pytest.mark.parametrize("interlace", [False, True])
@pytest.mark.parametrize("bits", [1, 2, 4, 8])
def test_colors_beyond_the_palette_are_refused(tmp_path: Path, bits: int, interlace: bool) -> None:
    for size in SIZES[1:]:
        codes = np.zeros((size[1], size[0]), np.uint8)
        palette = [(9, 8, 7)] * (2**bits - 1)
        for last in (2**bits - 2, 2**bits - 1):
            codes[-1, -1] = last
            with (tmp_path / "a.png").open("wb") as stream:
                writer = png.Writer(*size, palette=palette or [(1, 1, 1)], bitdepth=bits, interlace=interlace)
                writer.write(stream, codes.tolist())
            given = Dump(tmp_path / "a.png")
            if last < len(palette):
                given.check(np.array(palette)[codes], 255)
            else:
                place = f"pixel ({size[0] - 1}, {size[1] - 1})"
                assert f"{place} has the color {last} of its palette, which has {len(palette)}" in given.error


@pytest.mark.parametrize("options", [{}, {"optimize": True}, {"compress_level": 0}, {"compress_type": 2}])
@pytest.mark.parametrize("mode", ["1", "L", "P", "I;16", "RGB"])
def test_pillow(tmp_path: Path, mode: str, options: dict) -> None:
    image = {
        "1": lambda: Image.fromarray(noise((41, 23)) > 127),
        "P": lambda: Image.fromarray(noise((41, 23), 3)).quantize(100),
        "I;16": lambda: Image.fromarray(noise((41, 23), 1, 65535)),
    }.get(  # fmt: skip
        mode, lambda: Image.fromarray(noise((41, 23), len(mode)))
    )()
    image.save(tmp_path / "a.png", **options)
    with Image.open(tmp_path / "a.png") as read:
        expected = np.asarray(read.convert("RGB") if mode == "P" else read).astype(int) * (255 if mode == "1" else 1)
    Dump(tmp_path / "a.png").check(expected, 65535 if mode == "I;16" else 255)


@pytest.mark.parametrize("mode", ["1", "L", "P", "RGB", "RGBA"])
def test_bmp_of_pillow(tmp_path: Path, mode: str) -> None:
    for width in (1, 2, 3, 4, 5, 31, 32, 33):
        if mode == "1":
            image = Image.fromarray(noise((width, 6)) > 127)
        elif mode == "P":
            image = Image.fromarray(noise((width, 6)), "P")
            image.putpalette(np.random.default_rng(width).integers(0, 256, 768, dtype=np.uint8).tobytes())
        else:
            image = Image.fromarray(noise((width, 6), len(mode)))
        image.save(tmp_path / "a.bmp")
        given = Dump(tmp_path / "a.bmp")
        with Image.open(tmp_path / "a.bmp") as read:
            expected = np.asarray(read.convert("RGB") if mode in ("P", "RGBA") else read)
        given.check(expected * (255 if mode == "1" else 1), 255)
