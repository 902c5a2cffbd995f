"""The Python package as others get it: a source archive that builds by itself, and a wheel that stands alone."""

from __future__ import annotations

import json
import os
import re
import resource
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from install_common import BUILD, ROOT, release, run

LIBRARY = Path(os.environ.get("CLSPECKLE_LIBRARY", BUILD / "lib" / "libclspeckle.so"))
# What a wheel may ask of the system: the C and C++ libraries, and OpenCL's loader.
SYSTEM = re.compile(r"lib(c|m|dl|pthread|gcc_s|stdc\+\+|z|OpenCL)\.so\.\d+|ld-linux.*")
# The folders that the package's library is built of.
BUILT = ("bindings", "capi", "cmake", "core", "diagnosis", "io", "kernels", "tuning")


def tracked() -> set[str]:
    return set(run("git", "-C", ROOT, "ls-files").split("\n")) - {""}


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, ROOT / "scripts" / "wheel.py", "--output", folder, "--library", LIBRARY)
    return folder


@pytest.fixture(scope="module")
def archive(dist: Path) -> Path:
    return next(dist.glob("*.tar.gz"))


@pytest.fixture(scope="module")
def wheel(dist: Path) -> Path:
    return next(dist.glob("*.whl"))


@pytest.fixture(scope="module")
def unpacked(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("archive")
    with tarfile.open(archive) as file:
        file.extractall(folder)
    return next(folder.iterdir())


def test_the_archive_holds_what_the_library_is_built_of_and_nothing_else(unpacked: Path) -> None:
    held = {str(path.relative_to(unpacked)) for path in unpacked.rglob("*") if path.is_file()}
    known = tracked()
    assert {name for name in known if name.split("/")[0] in BUILT} <= held
    assert held - known == {"PKG-INFO"}
    assert {name.split("/")[0] for name in held if "/" in name} == set(BUILT)


def test_cmake_finds_all_that_it_names_in_the_archive(unpacked: Path, tmp_path: Path) -> None:
    run("cmake", "-S", unpacked / "bindings" / "python", "-B", tmp_path, "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON")

    def sources(build: Path, root: Path) -> set[str]:
        files = [Path(entry["file"]) for entry in json.loads((build / "compile_commands.json").read_text())]
        names = {str(file.relative_to(root)) for file in files if file.is_relative_to(root)}
        return {name for name in names if name.split("/")[0] in BUILT}

    # The program's part of io/ is no part of the library.
    assert sources(tmp_path, unpacked) == sources(BUILD, ROOT) - {"io/openexr.cpp"}


def metadata(wheel: Path, name: str) -> str:
    with zipfile.ZipFile(wheel) as file:
        return file.read(next(entry for entry in file.namelist() if entry.endswith(f".dist-info/{name}"))).decode()


def test_the_wheel_says_what_it_is(wheel: Path) -> None:
    text = metadata(wheel, "METADATA")
    version, _ = release()
    author = "Author: The clSpeckle authors"
    for line in (f"Version: {version}", "License-Expression: MIT", author, "Requires-Dist: numpy>=1.24"):
        assert f"\n{line}\n" in text, line
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert "Root-Is-Purelib: false" in metadata(wheel, "WHEEL")


def test_the_wheel_holds_its_libraries_and_their_licences(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as file:
        file.extractall(tmp_path)
        assert file.testzip() is None
    ours = tmp_path / "clspeckle" / "libclspeckle.so"
    vendored = sorted((tmp_path / "clspeckle.libs").glob("*.so*"))
    assert vendored
    glibc = (0, 0)
    for library in (ours, *vendored):
        dynamic = run("readelf", "-d", library)
        for name in re.findall(r"NEEDED.*\[(\S+)\]", dynamic):
            known = SYSTEM.fullmatch(name) or (tmp_path / "clspeckle.libs" / name).is_file()
            assert known, f"{library.name} needs {name}"
        versions = re.findall(r"GLIBC_(\d+)\.(\d+)", run("readelf", "-V", library))
        glibc = max([glibc, *((int(major), int(minor)) for major, minor in versions)])
    assert "[libOpenCL.so.1]" in run("readelf", "-d", ours), "the loader must be the system's"
    tag = re.search(r"py3-none-manylinux_(\d+)_(\d+)_\w+\.whl$", wheel.name)
    assert tag, wheel.name
    assert (int(tag[1]), int(tag[2])) >= glibc
    licences = {path.name for path in tmp_path.glob("*.dist-info/licenses/*.txt")}
    debians = [path for path in vendored if not path.name.startswith("libjbig")]
    packages = {run("dpkg", "-S", f"*/{re.sub('-[0-9a-f]{8}', '', path.name)}").split(":")[0] for path in debians}
    assert {f"{name}.txt" for name in packages} | {"libjs-vega.txt", "libeigen3-dev.txt"} <= licences
    recorded = {line.split(",")[0] for line in metadata(wheel, "RECORD").splitlines()}
    assert {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()} == recorded


TIFF_STRIP = """
import ctypes, sys
tiff = ctypes.CDLL(sys.argv[1])
tiff.TIFFOpen.restype, tiff.TIFFClose.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
strip = ctypes.create_string_buffer(bytes(range(0, 64)))
file = ctypes.c_void_p(tiff.TIFFOpen(sys.argv[2].encode(), sys.argv[3].encode()))
if sys.argv[3] == "w":  # 64 x 8 pixels of one bit
    for tag, value in ((256, 64), (257, 8), (258, 1), (277, 1), (278, 8), (262, 1), (259, int(sys.argv[4]))):
        assert tiff.TIFFSetField(file, tag, value) == 1
    assert tiff.TIFFWriteEncodedStrip(file, 0, strip, ctypes.c_ssize_t(64)) == 64
    tiff.TIFFClose(file)
else:
    seen = ctypes.create_string_buffer(64)
    tiff.TIFFReadEncodedStrip.restype = ctypes.c_ssize_t
    count = tiff.TIFFReadEncodedStrip(file, 0, seen, ctypes.c_ssize_t(64))
    print(count, seen.raw == strip.raw[:64])
"""


def test_the_wheel_holds_nothing_of_libjbig(wheel: Path, tmp_path: Path) -> None:
    """It is under the GPL. The wheel's libtiff says that it reads no JBIG, and reads the rest."""
    with zipfile.ZipFile(wheel) as file:
        file.extractall(tmp_path)
    (jbig,) = (tmp_path / "clspeckle.libs").glob("libjbig*")
    symbols = set(re.findall(r" T (\w+)", run("nm", "-D", jbig)))
    assert "jbg_dec_in" in symbols
    assert not symbols & {"arith_decode", "jbg_split_planes", "jbg_dec_merge_planes"}
    assert not list(tmp_path.glob("*.dist-info/licenses/libjbig*"))
    (ours,) = (tmp_path / "clspeckle.libs").glob("libtiff*")
    for compression, expected, words in ((34661, "-1 False", "this build reads no JBIG"), (8, "64 True", "")):
        image = tmp_path / f"{compression}.tif"
        run(sys.executable, "-c", TIFF_STRIP, "libtiff.so.6", image, "w", compression)
        for library, told in (("libtiff.so.6", "64 True"), (ours, expected)):
            command = [sys.executable, "-c", TIFF_STRIP, str(library), str(image), "r"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            assert done.stdout.strip() == told, done.stderr
            assert library != ours or words in done.stderr


TEN_LINES = """
import numpy as np
import clspeckle
from clspeckle import _library
rows, columns = np.mgrid[0:480, 0:640]
ideal = np.where((rows % 12 < 3) & (columns % 12 < 3), 1.0, 0.05).astype(np.float32)
codes = clspeckle.simulate(ideal, f_number=4.0, seed=7)
assert codes.shape == ideal.shape
assert codes.std() > 0
print(clspeckle.__file__)
print(_library.library()._name)
print(clspeckle.__version__)
"""


def installed(wheel: Path, folder: Path) -> list[str]:
    """What the ten lines print in an empty environment with the wheel and NumPy."""
    run(sys.executable, "-m", "venv", folder)
    run(folder / "bin" / "python", "-m", "pip", "install", "-q", "--disable-pip-version-check", wheel)
    packages = json.loads(run(folder / "bin" / "python", "-m", "pip", "list", "--format=json"))
    assert {package["name"] for package in packages} - {"pip", "setuptools"} == {"clspeckle", "numpy"}
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("CLSPECKLE_", "PYTHON", "LD_"))}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [folder / "bin" / "python", "-c", TEN_LINES]
    done = subprocess.run(command, cwd=folder, env=clean, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    # Processor time: what else runs on the machine is no part of it.
    assert after.ru_utime - before.ru_utime < 60
    return done.stdout.split()


def test_ten_lines_to_a_frame(wheel: Path, tmp_path: Path) -> None:
    """Within a minute."""
    package, library, version = installed(wheel, tmp_path)
    assert Path(package).parent == Path(library).parent
    assert Path(library).is_relative_to(tmp_path)
    assert f"-{version}-" in wheel.name


@pytest.mark.nightly
def test_the_archive_builds_by_itself(archive: Path, tmp_path: Path) -> None:
    run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", tmp_path, archive)
    assert len(installed(next(tmp_path.glob("*.whl")), tmp_path / "venv")) == 3
