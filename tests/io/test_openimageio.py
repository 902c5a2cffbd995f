"""EXR, Radiance HDR, TGA, BMP and PNM as OpenImageIO writes and reads them: equal values, or a refusal with words.

It brings decoders of its own for all of them but EXR, which is OpenEXR's. At least 40 files of each are counted."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import OpenImageIO as oiio
import pytest
import test_variants as small
import test_variants_hdr as light
from test_variants import SIZES, Dump, blocks, noise

Array = np.ndarray
LEAST = 40


class Variant(NamedTuple):
    """A file; one channel of it, or all but an opacity; what a refusal says; a PNM file's maximum."""

    path: Path
    channel: str = ""
    part: int = 0
    refusal: str = ""
    maximum: int = 0


def written(path: Path, values: Array, names: tuple[str, ...] = (), kind: str = "", **attributes: object) -> Path:
    """A file by OpenImageIO; attributes are those of an ImageSpec, or the file's own, with __ for a colon."""
    values = np.ascontiguousarray(values[..., None] if values.ndim == 2 else values)
    spec = oiio.ImageSpec(values.shape[1], values.shape[0], values.shape[2], kind or str(values.dtype))
    if names:
        spec.channelnames = names
    for name, value in attributes.items():
        if hasattr(spec, name):
            setattr(spec, name, value)
        else:
            spec.attribute(name.replace("__", ":"), value)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec), out.geterror()
    assert out.write_image(values), out.geterror()
    out.close()
    return path


def written_parts(path: Path, parts: dict[str, tuple[str, ...]]) -> None:
    specs = []
    for name, names in parts.items():
        spec = oiio.ImageSpec(40, 28, len(names), "float")
        spec.channelnames = names
        spec.attribute("oiio:subimagename", name)
        specs.append(spec)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), tuple(specs)), out.geterror()
    for index, spec in enumerate(specs):
        assert index == 0 or out.open(str(path), spec, "AppendSubimage"), out.geterror()
        assert out.write_image(np.random.default_rng(index).random((28, 40, spec.nchannels), np.float32))
    out.close()


def seen(variant: Variant) -> tuple[Array, tuple[str, ...]]:
    """The display window as OpenImageIO sees it, what lies outside of the stored pixels 0."""
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(str(variant.path), config)
    assert file, oiio.geterror()
    assert file.seek_subimage(variant.part, 0)
    spec = file.spec()
    pixels = file.read_image(variant.part, 0, 0, spec.nchannels, oiio.UNKNOWN)
    assert pixels is not None, file.geterror()
    file.close()
    pixels = np.asarray(pixels).reshape(spec.height, spec.width, spec.nchannels)
    margin = 64  # more than any of these windows reach beyond the image
    whole = np.zeros((spec.full_height + 2 * margin, spec.full_width + 2 * margin, spec.nchannels), pixels.dtype)
    x, y = spec.x - spec.full_x + margin, spec.y - spec.full_y + margin
    whole[y : y + spec.height, x : x + spec.width] = pixels
    return whole[margin:-margin, margin:-margin], tuple(spec.channelnames)


# --- Files ---

COMPRESSIONS = ("none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab")
PARTS = {"beauty": ("R", "G", "B"), "depth": ("Z",), "normal": ("X", "Y", "Z")}
SETS = (("Y",), ("R", "G", "B"), ("R", "G", "B", "A"), ("Z",), ("ViewLayer.Depth.Z", "ViewLayer.Noisy.R"), ("IR", "Z"))


def of_exr(folder: Path) -> Iterator[Variant]:
    kinds = ("half", "float", "uint32")
    for index, (compression, kind) in enumerate(itertools.product(COMPRESSIONS, kinds)):
        size, names = SIZES[index % len(SIZES)], SETS[index % len(SETS)]
        if kind == "uint32":
            values = np.random.default_rng(index).integers(0, 2**24, (*size[::-1], len(names)), dtype=np.uint32)
        else:
            values = np.random.default_rng(index).random((*size[::-1], len(names)), np.float32)
        place = {"x": index - 9, "y": 7 - index, "full_x": index - 9, "full_y": 7 - index} if index % 2 else {}
        if place:
            place |= {"full_width": size[0], "full_height": size[1]}
        order = {"openexr__lineOrder": "decreasingY"} if index % 3 == 0 else {}
        path = folder / f"{compression}_{kind}.exr"
        written(path, values, names, kind, compression=compression, **place, **order)
        yield Variant(path, names[index % len(names)])
    windows = {"inside": (3, 2, 40, 28), "corner": (0, 0, 31, 25), "below": (0, 9, 30, 40), "overscan": (-5, -6, 9, 8)}
    windows |= {"aside": (-5, 6, 40, 20), "away": (-50, -60, 40, 40)}
    for name, (x, y, width, height) in windows.items():
        path = folder / f"window_{name}.exr"
        place = {"x": x, "y": y, "full_x": 0, "full_y": 0, "full_width": width, "full_height": height}
        written(path, light.plane((24, 18), "float"), ("Y",), **place)
        yield Variant(path, refusal="data window" if name == "away" else "")
    for index, (tile, order, size) in enumerate(
        itertools.product((16, 32), ("increasingY", "decreasingY", "randomY"), ((40, 28), (129, 33)))
    ):
        path = folder / f"tiles{tile}_{order}_{size[0]}.exr"
        values = light.plane(size, "half" if index % 2 else "float", index)
        written(path, values, ("Y",), openexr__lineOrder=order, tile_width=tile, tile_height=tile, compression="zip")
        yield Variant(path)
    path = folder / "mipmap.exr"
    image = oiio.ImageBuf(light.plane((64, 32), "float")[..., None].copy())
    image.specmod().channelnames = ("Y",)
    assert oiio.ImageBufAlgo.make_texture(oiio.MakeTxTexture, image, str(path)), oiio.geterror()
    yield Variant(path)
    path = folder / "parts.exr"
    written_parts(path, PARTS)
    for index, (name, names) in enumerate(PARTS.items()):
        for channel in names:
            yield Variant(path, f"{name}.{channel}", index)


RUNS = (
    (8, 2),
    (300, 4),
    (7, 3),
    (9, 300),
    (127, 2),
    (128, 2),
    (255, 3),
    (40, 1),
    (2, 2),
    (1, 40),
    (33, 33),
    (16, 4),
    (8, 8),
    (9, 9),
)


def of_hdr(folder: Path) -> Iterator[Variant]:
    """OpenImageIO writes one kind of header; others by hand, in all orders of rows and columns that the format has."""
    for index, size in enumerate([*SIZES, *RUNS]):
        values = np.random.default_rng(index).random((*size[::-1], 3), np.float32) * np.float32(10.0 ** (index % 7 - 3))
        values[::2, ::3] = 0
        yield Variant(written(folder / f"{index}.hdr", values))
        values[:, size[0] // 3 :] = values[:, :1]
        yield Variant(written(folder / f"runs{index}.hdr", values))
    orders = ["-Y {h} +X {w}", "-Y {h} -X {w}", "+Y {h} +X {w}", "+Y {h} -X {w}"]
    for size, order, head in itertools.product(((40, 28), (8, 5), (129, 3)), orders, ("RADIANCE", "RGBE")):
        rgbe = light.pixels_of(size, head == "RGBE")
        path = folder / f"{size[0]}{order[0]}{order[7]}{head}.hdr"
        text = f"#?{head}\nFORMAT=32-bit_rle_rgbe\n\n{order.format(w=size[0], h=size[1])}\n"
        path.write_bytes(text.encode() + light.new_runs(rgbe))
        yield Variant(path, refusal="" if order == orders[0] else "-Y")


def of_tga(folder: Path) -> Iterator[Variant]:
    for size, channels, compression in itertools.product((*SIZES, (255, 2), (256, 2)), (1, 3, 4), ("none", "rle")):
        path = folder / f"{size[0]}_{channels}_{compression}.tga"
        values = blocks(size, channels)
        if channels == 4:
            values[..., 3] |= 1
        values = values.reshape(*size[::-1], channels)
        yield Variant(written(path, values, compression=compression, oiio__UnassociatedAlpha=1))
    for size, runs, way in itertools.product(((40, 28), (7, 5)), (False, True), (0, 0x10, 0x20, 0x30)):
        path = folder / f"way{size[0]}{runs}{way}.tga"
        data = bytearray(small.tga(noise(size).tobytes(), size, 3, 8))
        data[17] = way  # in which corner the first pixel lies
        if runs:
            data[2] |= 8
            data[18:] = b"".join(bytes([0, code]) for code in noise(size).reshape(-1).tolist())
        path.write_bytes(bytes(data))
        yield Variant(path)


def of_bmp(folder: Path) -> Iterator[Variant]:
    for width, height, channels in itertools.product((1, 2, 3, 4, 5, 31, 32, 33), (1, 6), (1, 3, 4)):
        path = folder / f"{width}_{height}_{channels}.bmp"
        yield Variant(written(path, noise((width, height), channels).reshape(height, width, channels)))


def of_pnm(folder: Path) -> Iterator[Variant]:
    for index, (size, kind, maximum) in enumerate(itertools.product(SIZES, (2, 3, 5, 6), (255, 65535, 1023, 100))):
        channels = 1 if kind in (2, 5) else 3
        path = folder / f"{index}.{'pgm' if channels == 1 else 'ppm'}"
        header = next(iter(small.PNM_HEADERS.values()))
        path.write_bytes(small.pnm(kind, noise(size, channels, maximum), maximum, header))
        yield Variant(path, maximum=maximum)
    for index, (size, channels, kind) in enumerate(itertools.product(SIZES, (1, 3), ("uint8", "uint16"))):
        top = np.iinfo(kind).max
        values = noise(size, channels, top).reshape(*size[::-1], channels)
        yield Variant(written(folder / f"own{index}.{'pgm' if channels == 1 else 'ppm'}", values), maximum=top)


FORMATS: dict[str, Callable[[Path], Iterator[Variant]]] = {
    "EXR": of_exr,
    "HDR": of_hdr,
    "TGA": of_tga,
    "BMP": of_bmp,
    "PNM": of_pnm,
}


@pytest.mark.parametrize("name", FORMATS)
def test_openimageio_sees_the_same(tmp_path: Path, name: str) -> None:
    equal, refused = 0, 0
    for variant in FORMATS[name](tmp_path):
        place = str(variant.path) + (f":{variant.channel}" if variant.channel else "")
        given = Dump(Path(place))
        assert bool(variant.refusal) == bool(given.error), f"{place}: {given.error}"
        assert variant.refusal in given.error, place
        if given.error:
            refused += 1
            continue
        expected, names = seen(variant)
        if variant.channel:
            wanted = expected[..., names.index(variant.channel.removeprefix(f"{list(PARTS)[variant.part]}."))]
        else:
            wanted = expected[..., [n for n, channel in enumerate(names) if channel != "A"]]
        got, near = given.values[..., :-1] if given.alpha else given.values, 0.0
        if variant.maximum not in (0, 255, 65535):  # the other one scales them, and rounds in its own way
            got, near = got * (255 if variant.maximum < 256 else 65535) / variant.maximum, 1.0
        wanted = np.squeeze(wanted).astype(np.float32)
        np.testing.assert_allclose(np.squeeze(got), wanted, rtol=0, atol=near, err_msg=place)
        equal += 1
    print(f"\n{name}: {equal} equal, {refused} refused")
    assert equal >= LEAST
