"""The Debian packages: what each holds and asks for, and that programs are built and run with them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from install_common import BUILD, CC, HERE, ROOT, STRICT, checksum, release, run

VERSION, ABI = release()
LIBRARY, DEVELOPMENT, PROGRAM, PYTHON = f"libclspeckle{ABI}", "libclspeckle-dev", "clspeckle", "python3-clspeckle"


@pytest.fixture(scope="module")
def debs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The packages, by name."""
    folder = tmp_path_factory.mktemp("debs")
    run("cpack", "-G", "DEB", "--config", BUILD / "CPackConfig.cmake", "-B", folder)
    return {path.name.split("_")[0]: path for path in folder.glob("*.deb")}


@pytest.fixture(scope="module")
def unpacked(debs: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("root")
    for package in debs.values():
        run("dpkg-deb", "-x", package, folder)
    return folder


def depends(package: Path) -> set[str]:
    text = run("dpkg-deb", "-f", package, "Depends")
    return {one.split("(")[0].strip() for group in text.split(",") for one in group.split("|")}


def test_each_package_holds_its_part(debs: dict[str, Path]) -> None:
    assert set(debs) == {LIBRARY, DEVELOPMENT, PROGRAM, PYTHON}
    held: dict[str, str] = {}
    for name, package in debs.items():
        assert run("dpkg-deb", "-f", package, "Version").strip() == VERSION
        for line in run("dpkg-deb", "-c", package).splitlines():
            path = line.split()[5]
            if not path.endswith("/"):
                assert path not in held, f"{path} is in {held.get(path)} and {name}"
                held[path] = name
    for part, name in (
        (f"libclspeckle.so.{VERSION}", LIBRARY),
        (f"libclspeckle.so.{ABI}", LIBRARY),
        ("/libclspeckle.so", DEVELOPMENT),
        ("/clspeckle.h", DEVELOPMENT),
        ("/clspeckle.hpp", DEVELOPMENT),
        ("/clspeckle.pc", DEVELOPMENT),
        ("/clspeckleConfig.cmake", DEVELOPMENT),
        ("./usr/bin/clspeckle", PROGRAM),
        ("/gap_check/__main__.py", PROGRAM),
        ("/dist-packages/clspeckle/__init__.py", PYTHON),
        ("/dist-packages/clspeckle/py.typed", PYTHON),
        *((f"/doc/{name}/copyright", name) for name in debs),
    ):
        assert {owner for path, owner in held.items() if path.endswith(part)} == {name}, part


def test_each_package_asks_for_what_it_needs(debs: dict[str, Path]) -> None:
    assert {"libc6", "libclfft2", "libtiff6", "ocl-icd-libopencl1"} <= depends(debs[LIBRARY])
    assert {LIBRARY, "ocl-icd-opencl-dev", "opencl-c-headers"} <= depends(debs[DEVELOPMENT])
    assert {LIBRARY, "libc6", "libopenexr-3-1-30"} <= depends(debs[PROGRAM])
    assert {LIBRARY, "python3", "python3-numpy"} == depends(debs[PYTHON])
    for name in (LIBRARY, PROGRAM):
        assert "pocl-opencl-icd" in run("dpkg-deb", "-f", debs[name], "Recommends")
    control = run("dpkg-deb", "-I", debs[LIBRARY], "shlibs", "postinst")
    assert f"libclspeckle {ABI} {LIBRARY}" in control
    assert "ldconfig" in control


def test_unpacked_packages_serve_c_python_and_the_shell(unpacked: Path, tmp_path: Path) -> None:
    libdir = next(unpacked.rglob("libclspeckle.so")).parent
    paths = {"LD_LIBRARY_PATH": str(libdir), "PKG_CONFIG_PATH": str(libdir / "pkgconfig")}
    flags = run("pkg-config", "--cflags", "--libs", "clspeckle", env=paths).split()
    run(CC, "-std=c99", *STRICT, HERE / "consumer.c", *flags, "-o", tmp_path / "consumer")
    checksum(tmp_path / "consumer", **paths)
    assert VERSION in run(unpacked / "usr" / "bin" / "clspeckle", "--version", env={"LD_LIBRARY_PATH": ""})
    package = unpacked / "usr" / "lib" / "python3" / "dist-packages"
    clean = {name: value for name, value in os.environ.items() if name != "CLSPECKLE_LIBRARY"}
    code = "import clspeckle; print(clspeckle.__file__, clspeckle.version())"
    words = [sys.executable, "-c", code]
    done = subprocess.run(
        words, env={**clean, **paths, "PYTHONPATH": str(package)}, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == [str(package / "clspeckle" / "__init__.py"), VERSION], done.stderr


def test_the_container_is_made_as_the_docs_say() -> None:
    lines = (ROOT / "scripts" / "Dockerfile").read_text().splitlines()
    done = [line.removeprefix("RUN ") for line in lines if line.startswith("RUN ")]
    page = (ROOT / "docs" / "guide" / "install.md").read_text()
    section = page.split("## Debian packages")[1].split("|")[0]
    lines = re.sub(r" \\\n +", " ", section).splitlines()  # one that goes on is one
    told = [line.split("#")[0].strip().strip("()") for line in lines if line.startswith("    ")]
    assert len(told) == 4
    assert done[1:4] == told[:3]
    assert done[0] == "scripts/setup.sh build"
    assert "apt-get install" in done[4]


def on_a_bare_system(stage: Path, folder: Path) -> str:
    """What steps.sh of a folder prints in an empty Debian with that folder; mmdebstrap drops what its hooks print.
    Nothing of this environment gets in."""
    told = folder / "told.txt"
    clean = "env -i DEBIAN_FRONTEND=noninteractive HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin"
    hooks = [
        f'--customize-hook=cp -r {stage} "$1/{stage.name}"',
        f'--customize-hook=chroot "$1" {clean} bash -eu /{stage.name}/steps.sh > {told}',
    ]
    run("mmdebstrap", "--variant=apt", *hooks, "bookworm", folder / "root.tar")
    return told.read_text()


@pytest.mark.nightly
def test_the_containers_first_steps_on_a_bare_system(tmp_path: Path) -> None:
    """What scripts/setup.sh installs is enough to configure the container's build. The build itself is the one
    above."""
    commands = [line.removeprefix("RUN ") for line in (ROOT / "scripts" / "Dockerfile").read_text().splitlines()
                if line.startswith("RUN ")]  # fmt: skip
    assert commands[1].startswith("cmake -S . -B build-deb ")
    stage = tmp_path / "clspeckle"
    stage.mkdir()
    files = run("git", "-C", ROOT, "ls-files", "-co", "--exclude-standard").splitlines()
    for file in (ROOT / name for name in files):
        if file.is_file():
            target = stage / file.relative_to(ROOT)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, target)
    steps = ["cd /clspeckle"]
    if certificate := os.environ.get("PIP_CERT"):  # of a mirror
        shutil.copy(certificate, stage / "mirror.crt")
        steps.append("export PIP_CERT=/clspeckle/mirror.crt REQUESTS_CA_BUNDLE=/clspeckle/mirror.crt")
    (stage / "steps.sh").write_text("\n".join([*steps, *commands[:2], "ls build-deb/CPackConfig.cmake", ""]))
    output = on_a_bare_system(stage, tmp_path)
    assert "Build files have been written to" in output
    assert "build-deb/CPackConfig.cmake" in output


# mmdebstrap leaves a system whose apt brings nothing that is recommended; Debian's own does.
STEPS = """
apt-get -q install -y -o APT::Install-Recommends=true /debs/*.deb gcc libc6-dev pkg-config >/dev/null
cd /debs
cc -std=c99 consumer.c $(pkg-config --cflags --libs clspeckle) -o consumer
./consumer
clspeckle --version
python3 -c 'import numpy, clspeckle; print(clspeckle.simulate(numpy.ones((48, 64)), seed=7).shape)'
clspeckle render gbuffers/sequence.json -o frames --frames 1 --exposure-gain auto --quiet
ls frames
apt-get -q install -y --no-install-recommends python3-torch >/dev/null
python3 torch_pairs.py
"""


@pytest.mark.nightly
def test_packages_on_a_bare_system(debs: dict[str, Path], tmp_path: Path) -> None:
    """apt brings what they ask for into an empty Debian; then C, Python and the shell each make a frame, and PyTorch
    reads pairs."""
    stage = tmp_path / "debs"
    shutil.copytree(ROOT / "examples" / "depth_map" / "gbuffers", stage / "gbuffers")
    for file in (*debs.values(), HERE / "consumer.c", HERE / "torch_pairs.py"):
        shutil.copy(file, stage)
    (stage / "steps.sh").write_text(STEPS)
    output = on_a_bare_system(stage, tmp_path)
    assert "checksum" in output
    assert "(48, 64)" in output
    assert VERSION in output
    assert "frame_000000.png" in output
    assert re.search(r"PyTorch \S+ reads 10 pairs", output)
