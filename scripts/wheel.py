#!/usr/bin/env python3
"""Makes the source archive of the Python package, and of that archive a wheel that stands alone.

    scripts/wheel.py [--output dist] [--library build/lib/libclspeckle.so]

Needs what `scripts/setup.sh build` installs, and the Python packages of tests/install/requirements.txt. Without
--library the wheel's library is built of the archive alone. What the library is linked with goes into the wheel, with
its licences. Three things do not: the C and C++ libraries, and OpenCL's loader, which must be the system's to find the
system's drivers. libjbig, which is under the GPL, is replaced by packaging/wheel/no_jbig.c. auditwheel names the wheel
after the oldest C library that it runs with.
"""

from __future__ import annotations

import argparse
import base64
import csv
import hashlib
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# In place of the library that Debian's libtiff asks for.
NO_JBIG = ROOT / "packaging" / "wheel" / "no_jbig.c"
# Headers and scripts that become part of the library itself.
COMPILED_IN = ("libeigen3-dev", "libjs-vega", "libstb-dev", "nlohmann-json3-dev")


def run(*command: object, cwd: Path = ROOT, **more: str) -> str:
    """Runs a command, with this Python's programs first; its output is shown if it fails."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    words, env = [str(word) for word in command], {**os.environ, "PATH": path, **more}
    done = subprocess.run(words, cwd=cwd, env=env, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{command[0]} failed:\n{done.stdout}{done.stderr}")
    return done.stdout


def source_archive(output: Path) -> Path:
    """The source archive of this checkout."""
    build = "import sys; from scikit_build_core.build import build_sdist; print(build_sdist(sys.argv[1]))"
    return output / run(sys.executable, "-c", build, output).splitlines()[-1]


def wheel_of(archive: Path, folder: Path, library: Path | None) -> Path:
    """The wheel that pip makes of an archive."""
    options = ["-C", f"cmake.define.CLSP_PYTHON_LIBRARY={library}"] if library else []
    run(sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-w", folder, *options, archive)
    return next(folder.glob("*.whl"))


def package_of(vendored: str) -> str:
    """The Debian package of a library that auditwheel copied: libtiff-4cadf372.so.6.0.0 was libtiff.so.6.0.0."""
    name = re.sub(r"-[0-9a-f]{8}(\.so[.0-9]*)$", r"\1", vendored)
    return run("dpkg", "-S", f"*/{name}").split(":")[0]


def licences(wheel: Path) -> dict[str, bytes]:
    """The licences of all that a wheel holds beside the project's own code, by file name."""
    names = [Path(name).name for name in zipfile.ZipFile(wheel).namelist() if ".libs/lib" in name]
    names = [name for name in names if not name.startswith("libjbig")]  # ours
    packages = sorted({*COMPILED_IN, *map(package_of, names)})
    return {f"{package}.txt": Path("/usr/share/doc", package, "copyright").read_bytes() for package in packages}


def add_licences(wheel: Path) -> None:
    """Puts them beside the project's own, and counts them in the wheel's list of files."""
    added = licences(wheel)
    fresh = wheel.with_suffix(".tmp")
    with zipfile.ZipFile(wheel) as source, zipfile.ZipFile(fresh, "w", zipfile.ZIP_DEFLATED) as target:
        record = next(name for name in source.namelist() if name.endswith(".dist-info/RECORD"))
        rows = io.StringIO(source.read(record).decode())
        lines = csv.writer(rows, lineterminator="\n")
        rows.seek(0, io.SEEK_END)
        for name, text in added.items():
            path = f"{Path(record).parent}/licenses/{name}"
            target.writestr(path, text)
            digest = base64.urlsafe_b64encode(hashlib.sha256(text).digest()).rstrip(b"=").decode()
            lines.writerow([path, f"sha256={digest}", len(text)])
        for entry in source.infolist():
            target.writestr(entry, rows.getvalue() if entry.filename == record else source.read(entry))
    fresh.replace(wheel)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder for both files (dist)")
    parser.add_argument("--library", type=Path, help="a library that is built already")
    given = parser.parse_args()
    output = given.output.resolve()
    output.mkdir(parents=True, exist_ok=True)
    archive = source_archive(output)
    print(archive)
    with tempfile.TemporaryDirectory() as folder:
        wheel = wheel_of(archive, Path(folder), given.library and given.library.resolve())
        repaired, stand_in = Path(folder) / "repaired", Path(folder) / "libjbig.so.0"
        run(os.environ.get("CC", "cc"), "-shared", "-fPIC", "-O2", "-Wl,-soname,libjbig.so.0", NO_JBIG, "-o", stand_in)
        paths = f"{folder}:{os.environ.get('LD_LIBRARY_PATH', '')}"
        run("auditwheel", "repair", "--exclude", "libOpenCL.so.1", "-w", repaired, wheel, LD_LIBRARY_PATH=paths)
        wheel = next(repaired.glob("*.whl"))
        add_licences(wheel)
        print(shutil.move(wheel, output / wheel.name))


if __name__ == "__main__":
    main()
