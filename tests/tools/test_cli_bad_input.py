"""Whatever is wrong with the input: a clear error that names it, exit code 1, nothing left behind, no crash."""

from __future__ import annotations

import os
import resource
import signal
import struct
import subprocess
import zlib
from collections.abc import Callable
from pathlib import Path

import cli_images as images
import imageio.v3 as iio
import numpy as np
import OpenEXR
import png
import pytest
import tifffile

EXAMPLES = {
    "PNG": "gray16.png",
    "TIFF": "gray16.tiff",
    "EXR": "y_float.exr",
    "HDR": "runs.hdr",
    "NPY": "f8.npy",
    "PGM": "binary16.pgm",
    "JPEG": "gray.jpg",
    "BMP": "gray8.bmp",
    "TGA": "runs.tga",
}


def written(name: str, tmp_path: Path) -> bytes:
    path = tmp_path / name
    images.FORMATS[name][0](path)
    data = path.read_bytes()
    path.unlink()
    return data


@pytest.mark.parametrize("kind", EXAMPLES)
@pytest.mark.parametrize("command", ["render", "statistics"])
def test_truncated_files(cli, tmp_path: Path, kind: str, command: str) -> None:
    """Cut at many places: refused each time, except where only a trailer is lost."""
    data = written(EXAMPLES[kind], tmp_path)
    name = "cut" + Path(EXAMPLES[kind]).suffix
    arguments = ["-o", "out"] if command == "render" else []
    for length in sorted(
        {0, 1, 3, 4, 8, 16, 40, 100, *(len(data) * share // 10 for share in range(1, 10))} | {len(data) - 16}
    ):
        (tmp_path / name).write_bytes(data[:length])
        result = cli(command, name, *arguments)
        assert result.code == 1, f"{length} of {len(data)} bytes were taken: {result.err}"
        assert f"clspeckle: {name}: " in result.err, result.err
        assert result.out == ""
        assert [path.name for path in tmp_path.iterdir()] == [name]


def png_chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def huge_png(path: Path, width: int, height: int) -> None:
    header = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
    data = png_chunk(b"IHDR", header) + png_chunk(b"IDAT", zlib.compress(bytes(100))) + png_chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + data)


def huge_tiff(path: Path, width: int, height: int) -> None:
    tags = [(256, width), (257, height), (258, 16), (259, 1), (262, 1), (273, 8), (277, 1), (278, height), (279, 8)]
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
    path.write_bytes(b"II*\0" + struct.pack("<IH", 8, len(tags)) + entries + bytes(4))


def huge_npy(path: Path, width: int, height: int) -> None:
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': ({height}, {width}), }}".ljust(117).encode() + b"\n"
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(64))


def huge_hdr(path: Path, width: int, height: int) -> None:
    path.write_bytes(images.hdr_header(width, height) + bytes(64))


def huge_pgm(path: Path, width: int, height: int) -> None:
    path.write_bytes(f"P5 {width} {height} 255\n".encode() + bytes(64))


def huge_exr(path: Path, width: int, height: int) -> None:
    """A real file whose data and display window are then enlarged."""
    images.exr(path, {"Y": images.real()})
    data = path.read_bytes()
    window = struct.pack("<4i", 0, 0, images.WIDTH - 1, images.HEIGHT - 1)
    assert data.count(window) == 2
    path.write_bytes(data.replace(window, struct.pack("<4i", 0, 0, width - 1, height - 1)))


HUGE: dict[str, Callable[[Path, int, int], None]] = {
    "huge.png": huge_png,
    "huge.tiff": huge_tiff,
    "huge.npy": huge_npy,
    "huge.hdr": huge_hdr,
    "huge.pgm": huge_pgm,
    "huge.exr": huge_exr,
}


@pytest.mark.parametrize("name", HUGE)
@pytest.mark.parametrize(
    ("width", "height"), [(16384, 16384), (16385, 4), (4, 16385), (2**31 - 1, 2**31 - 1), (0, 5), (5, 0)]
)
def test_headers_that_promise_too_much(program: Path, tmp_path: Path, name: str, width: int, height: int) -> None:
    """Refused quickly and without taking the memory that the header asks for (2 GiB for 16384 x 16384 floats and
    codes)."""
    HUGE[name](tmp_path / name, width, height)

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (60, 60))

    done = subprocess.run(
        [program, "render", name, "-o", "out"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=limit,
        timeout=120,
    )
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode == 1, f"{done.returncode}: {done.stderr}"
    assert f"clspeckle: {name}: " in done.stderr
    assert not (tmp_path / "out").exists()
    # The largest child so far, in KiB; rendering a small image stays far below as well.
    assert usage.ru_maxrss < 1024 * 1024


def test_largest_and_too_large(cli, refused, tmp_path: Path) -> None:
    np.save(tmp_path / "wide.npy", np.ones((2, 16384), np.uint8))
    np.save(tmp_path / "wider.npy", np.ones((2, 16385), np.uint8))
    assert "at most 16384 x 16384" in refused("statistics", "wider.npy")
    assert "at most 16384 x 16384" in refused("render", "wider.npy", "-o", "out")
    frame = cli("statistics", "wide.npy", "--json", "--region", "0,0,16384,1")
    assert frame.code == 0 and frame.json()["frames"][0]["count"] == 16384


def damaged_png(path: Path) -> None:
    data = bytearray(written("gray16.png", path.parent))
    at = data.index(b"IDAT") + 40
    data[at] ^= 1
    path.write_bytes(bytes(data))


def record_npy(path: Path) -> None:
    np.save(path, np.zeros((4, 4), dtype=[("a", "f4"), ("b", "f4")]))


def object_npy(path: Path) -> None:
    np.save(path, np.array([[None, 1], [2, 3]], dtype=object), allow_pickle=True)


def deep_exr(path: Path) -> None:
    samples = np.empty((4, 4), dtype=object)
    for at in np.ndindex(samples.shape):
        samples[at] = np.ones(2, np.float32)
    images.exr(path, {"Z": samples}, type=OpenEXR.deepscanline, compression=OpenEXR.ZIPS_COMPRESSION)


def apart_exr(path: Path) -> None:
    images.exr(
        path,
        {"Y": images.real()},
        displayWindow=(np.array([1000, 1000], np.int32), np.array([1039, 1027], np.int32)),
    )


WRONG: dict[str, tuple[Callable[[Path], object], str]] = {
    "text.txt": (
        lambda p: p.write_text("not an image"),
        "is not a PNG, TIFF, EXR, Radiance HDR, NPY, PNM, JPEG, BMP, TGA or raw",
    ),
    "webp.webp": (lambda p: iio.imwrite(p, images.gray8()), "is a file of the format WebP, which is not read"),
    "frame.raw": (lambda p: p.write_bytes(bytes(100)), "raw frames must be described: WIDTHxHEIGHT,BITS"),
    "named_wrongly.npy": (lambda p: p.write_text("a text with the name of an array"), "is not a PNG"),
    "empty.png": (lambda p: p.write_bytes(b""), "is empty (0 bytes)"),
    "folder.png": (lambda p: p.mkdir(), "neither sequence.json nor PNG"),
    "checksum.png": (damaged_png, "is damaged"),
    "one_row.npy": (lambda p: np.save(p, np.ones(5)), "1 axes"),
    "number.npy": (lambda p: np.save(p, np.float32(5)), "one number"),
    "five_axes.npy": (lambda p: np.save(p, np.ones((2, 3, 4, 5, 6))), "5 axes"),
    "no_pixels.npy": (lambda p: np.save(p, np.ones((0, 5))), "empty array (0 x 5), no side may be 0"),
    "complex.npy": (lambda p: np.save(p, np.ones((5, 5), complex)), "'<c16'"),
    "text.npy": (lambda p: np.save(p, np.array([["a", "b"], ["c", "d"]])), "type '<U1'"),
    "records.npy": (record_npy, "named fields"),
    "objects.npy": (object_npy, "type '|O', Python objects"),
    "complex.tiff": (
        lambda p: tifffile.imwrite(p, images.real().astype(np.complex64)),
        "complex or unknown of 64 bits",
    ),
    "lab.tiff": (
        lambda p: tifffile.imwrite(p, images.rgb(images.gray8()), photometric="cielab"),
        "color space",
    ),
    "deep.exr": (deep_exr, "not a readable EXR file"),
    "windows_apart.exr": (apart_exr, "outside the image"),
    "xyz.hdr": (lambda p: p.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n0000"), "32-bit_rle_xyze"),
    "rotated.hdr": (lambda p: p.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n+X 1 -Y 1\n0000"), "size line"),
    "no_maximum.pgm": (lambda p: p.write_bytes(b"P5 2 2 0\n0000"), "maximum value"),
    "above_maximum.pgm": (lambda p: p.write_bytes(b"P5 2 2 100\n\x01\x02\x03\xff"), "pixel (1, 1) is 255"),
    "letters.pgm": (lambda p: p.write_bytes(b"P2 2 2 100\n1 2 x 4"), "not a number"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_files(refused, tmp_path: Path, name: str) -> None:
    write, word = WRONG[name]
    write(tmp_path / name)
    message = refused("render", name, "-o", "out")
    assert f"clspeckle: {name}: " in message and word in message


def test_missing_files(refused) -> None:
    assert "missing.png: cannot be read: No such file" in refused("render", "missing.png", "-o", "out")
    assert "*.exr: no file matches" in refused("render", "*.exr", "-o", "out")
    assert "missing.png" in refused("statistics", "missing.png")


def test_special_files(refused, tmp_path: Path) -> None:
    """A pipe without a writer would block for ever, /dev/zero would never end."""
    os.mkfifo(tmp_path / "pipe.png")
    assert "not a regular file" in refused("render", "pipe.png", "-o", "out")
    assert "not a regular file" in refused("render", "/dev/zero", "-o", "out")


def test_a_folder_of_several_kinds(refused, tmp_path: Path) -> None:
    (tmp_path / "mixed").mkdir()
    iio.imwrite(tmp_path / "mixed" / "a.png", images.gray8())
    np.save(tmp_path / "mixed" / "b.npy", images.real())
    assert "1 .npy, 1 .png" in refused("render", "mixed", "-o", "out")


@pytest.mark.parametrize(("value", "shown"), [(np.nan, "nan"), (-1.0, "-1"), (np.inf, "inf"), (-np.inf, "-inf")])
def test_bad_pixels_are_named(refused, tmp_path: Path, value: float, shown: str) -> None:
    image = images.real()
    image[5, 3] = value
    image[9, 9] = value
    np.save(tmp_path / "bad.npy", image)
    tifffile.imwrite(tmp_path / "bad.tiff", image)
    images.exr(tmp_path / "bad.exr", {"Y": image})
    for name in ("bad.npy", "bad.tiff", "bad.exr"):
        message = refused("render", name, "-o", "out")
        assert f"{name}: pixel (3, 5) is {shown}" in message and "(2 such pixels in all)" in message


def test_a_bad_frame_of_a_stack_is_named(cli, tmp_path: Path) -> None:
    stack = np.ones((3, 20, 30), np.float32)
    stack[1, 4, 2] = np.nan
    np.save(tmp_path / "stack.npy", stack)
    result = cli("render", "stack.npy", "-o", "out", "--format", "npy-stack", "--no-preview")
    assert result.code == 1 and "stack.npy[1]: pixel (2, 4) is nan" in result.err
    assert not (tmp_path / "out").exists(), "a stack that was begun leaves nothing behind"


def test_values_beyond_single_precision(refused, tmp_path: Path) -> None:
    np.save(tmp_path / "large.npy", np.full((4, 4), 1e300))
    assert "pixel (0, 0) is inf" in refused("render", "large.npy", "-o", "out")


def test_no_output_folder_given(refused, ideal: Path) -> None:
    assert "-o FOLDER" in refused("render", ideal)


def test_output_folder_that_cannot_be_made(refused, ideal: Path, tmp_path: Path) -> None:
    """Below a regular file nobody can make a folder, not even root."""
    (tmp_path / "file").write_text("")
    for folder in ("file", "file/out", "/dev/full/out", "/proc/out"):
        message = refused("render", ideal, "-o", folder, code=3)
        assert folder in message and "-o" in message


def test_disk_that_is_full(program: Path, tmp_path: Path) -> None:
    """A limit on the size of files stands for a full disk: no half file remains, and the message names the file. The
    limit leaves room for what the OpenCL driver writes; smaller ones are tried on the writers alone in
    test_image_io.cpp."""
    np.save(tmp_path / "image.npy", np.random.default_rng(0).random((512, 512), dtype=np.float32))
    done = subprocess.run(
        [program, "render", "image.npy", "-o", "out", "--format", "npy-stack", "--no-preview", "--frames", "40"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (8 << 20, 8 << 20)),
    )
    assert done.returncode == 3, f"{done.returncode} {done.stderr}"
    assert "out/frames.npy: cannot be written: File too large" in done.stderr
    assert not (tmp_path / "out").exists()


def test_standard_output_that_cannot_be_written(program: Path, ideal: Path, tmp_path: Path) -> None:
    for arguments in (
        ["devices"],
        ["--version"],
        ["render", ideal.name, "-o", "out"],
        ["statistics", ideal.name, "--json"],
    ):
        with open("/dev/full", "w") as full:
            done = subprocess.run(
                [program, *arguments], cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, check=False
            )
        assert done.returncode == 3, f"{arguments}: {done.returncode}"
        assert "standard output" in done.stderr


def test_no_device(cli, ideal: Path, tmp_path: Path) -> None:
    """Without any OpenCL platform: exit code 2, what to install, and no folder."""
    (tmp_path / "vendors").mkdir()
    environment = {
        **os.environ,
        "OCL_ICD_VENDORS": str(tmp_path / "vendors"),
        "OPENCL_VENDOR_PATH": str(tmp_path / "vendors"),
    }
    for arguments in (["render", ideal, "-o", "out"], ["statistics", ideal], ["devices"]):
        result = cli(*arguments, env=environment)
        assert result.code == 2, f"{arguments}: {result.code} {result.err}"
        assert "pocl-opencl-icd" in result.err + result.out
    assert not (tmp_path / "out").exists()


def test_a_device_that_does_not_exist(refused, ideal: Path) -> None:
    assert "no such device" in refused("render", ideal, "-o", "out", "--device", "no such device", code=2)


def test_usage_errors(refused) -> None:
    assert 'no command "rendr"; the nearest one is "render"' in refused("rendr")
    assert "subcommand" in refused()
    assert "FILE" in refused("statistics")
    assert "no option --jsn; the nearest one is --json" in refused("devices", "--jsn")
    # A word that is no slip of any.
    assert "no option --overwrite (see clspeckle devices --help)" in refused("devices", "--overwrite")
    assert 'no command "photograph" (see clspeckle --help)' in refused("photograph")


def test_kernel_folder_that_is_wrong(refused, ideal: Path, tmp_path: Path) -> None:
    """A broken kernel override is the device's business: exit code 2 and the compiler's words."""
    (tmp_path / "kernels" / "stages").mkdir(parents=True)
    (tmp_path / "kernels" / "stages" / "phase_state.h").write_text("this is not OpenCL C")  # of all phase kernels
    environment = {**os.environ, "CLSPECKLE_KERNEL_DIR": str(tmp_path / "kernels")}
    assert "phase" in refused("render", ideal, "-o", "out", code=2, env=environment)
    environment["CLSPECKLE_KERNEL_DIR"] = str(tmp_path / "no such folder")
    assert "no such folder" in refused("render", ideal, "-o", "out", env=environment)  # a wrong name is wrong usage


def test_png_of_two_sizes_in_a_row(refused, tmp_path: Path) -> None:
    with (tmp_path / "twice.png").open("wb") as stream:
        png.Writer(4, 4, greyscale=True).write(stream, [[0] * 4] * 4)
    data = (tmp_path / "twice.png").read_bytes()
    at = data.index(b"IHDR") - 4
    (tmp_path / "twice.png").write_bytes(data[: at + 25] + data[at : at + 25] + data[at + 25 :])
    assert "twice.png" in refused("render", "twice.png", "-o", "out")


def test_broken_pipe_is_no_crash(program: Path) -> None:
    done = subprocess.run(
        f"'{program}' render --help | head -n 1", shell=True, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and done.stdout.startswith("Render")
    assert signal.SIGSEGV.name not in done.stderr
